"""WITSML trajectories: stations with raw data, corrections, checks and covariance, read; 1.4.1.1 also written.

The standard names the sensors' axes axial, tran1 and tran2 and says no more than that they are at right angles. Here
they are taken as a vendor's z, x and y, in the convention the caller names: "iscwsa" (SPE 67616: y along the index
mark, x 90 deg before it) unless told otherwise. Inclination and azimuth do not depend on which of the conventions with
z down hole and gravity positive down it is; the toolface does, and a note says so where the toolface of the raw data
contradicts `gtf`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import datetime
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.conventions import named
from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError, InputError, in_file, refused, wrong_kind
from inclinometry.files import writing
from inclinometry.files._quantities import quantities
from inclinometry.files.frame import Column, Frame, unused
from inclinometry.files.survey_file import SurveyFile, corrections_to_native, survey_of, to_vendor, values_of
from inclinometry.files.text import NUMBER
from inclinometry.files.writing import write_bytes
from inclinometry.findings import Finding
from inclinometry.opening import damaged, whole
from inclinometry.rotations import wrap_signed

# What is known of WITSML 1.4.1.1 trajectories: elements, their order and units, from witsml_1411.toml.

GROUPS: Final = ("rawData", "corUsed", "valid", "matrixCov")
NORTHS: Final = {"magnetic north": "magnetic", "true north": "true", "grid north": "grid"}


@lru_cache(maxsize=1)
def _twice(name: str) -> Finding:
    return Finding("input-repeated", {"name": "element", "value": name})


def _data() -> Mapping[str, Any]:
    return tomllib.loads(files("inclinometry.files").joinpath("witsml_1411.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=8)
def _elements(parent: str) -> Mapping[str, tuple[str, str, str]]:
    """Element of "station" or of one of `GROUPS` -> quantity, kind of unit, and unit written ("" when only read).

    >>> _elements("rawData")["gravAxialRaw"]
    ('g.2', 'acceleration', 'm/s2')
    """
    return {name: tuple(entry) for name, entry in _data()[parent].items()}


def _station_texts() -> tuple[str, ...]:
    """Elements of a station that are kept as text."""
    return tuple(_data()["texts"]["station"])


def _factor(name: str, kind: str, uom: str | None) -> float:
    """SI (rad, nT) of one unit of a kind; units are never assumed."""
    known = _data()["uom"][kind]
    if uom is None or uom not in known:
        raise refused("table-unit", {"column": name, "unit": "-" if uom is None else uom[:60], "allowed": tuple(known)})
    return float(known[uom])


LARGEST: Final = 256 * 1024 * 1024
"""Bytes of a file that are parsed; 10,000 stations with everything have some 24 MB."""


def load(path: Path) -> tuple[Any, bytes]:
    """The root element `trajectorys`, as 1.4.1.1 has it, checked for its version, and the bytes of the file."""
    from lxml import etree

    data = whole(path, LARGEST)
    # a document type is where entities are declared; no WITSML document has one
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        line = data[: max(data.find(b"<!DOCTYPE"), data.find(b"<!ENTITY"))].count(b"\n") + 1
        raise FileError(damaged("WITSML", "DOCTYPE or ENTITY"), path=path, line=line)
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, remove_comments=True, remove_pis=True
    )
    try:
        root: Any = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise FileError(damaged("XML", error.msg), path=path, line=error.lineno or 1) from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise FileError(damaged("WITSML", "DOCTYPE"), path=path, line=1)
    own = ["trajectorys", _data()["namespace"], "version", _data()["version"]]
    fits = {f"{{{space}}}{name}": (key, start) for name, space, key, start in [own, *_data()["others"]]}
    if root.tag not in fits:
        raise FileError(Finding("file-section", {"section": _tag("trajectorys")}), path=path, line=root.sourceline)
    key, start = fits[root.tag]
    if not root.get(key, "").startswith(start):
        found, versions = str(root.get(key))[:60], tuple(version for _, version in fits.values())
        known = Finding("file-version", {"format": "WITSML", "version": found, "known": versions})
        raise FileError(known, path=path, line=root.sourceline)
    return (root if root.tag == _tag("trajectorys") else _as_1411(root)), data


def _as_1411(root: Any) -> Any:
    """Elements of WITSML 1.3.1 or 2.x under the names of 1.4.1.1."""
    from lxml import etree

    for element in list(root.iter("*")):
        name = etree.QName(element).localname
        element.tag = _tag(name if name == "MSACorUsed" else name[0].lower() + name[1:])
        if name in ("Md", "Tvd", "MdMn", "MdMx") and len(element) == 1:  # of 2.1, a depth in an element of its own
            element.text = element[0].text
            element.set("uom", element[0].get("uom", ""))
            element.remove(element[0])
    if root.tag == _tag("trajectorys"):
        return root
    title = next(root.iter(_tag("title")), None)  # the first is that of its citation
    _add(root, "name", "" if title is None else text_of(title))
    root.set("uid", root.get("uuid", ""))
    outer = etree.Element(_tag("trajectorys"))
    outer.append(root)
    return outer


def children(element: Any) -> Iterator[tuple[str, Any]]:
    """Children in WITSML's namespace, by name."""
    start = f"{{{_data()['namespace']}}}"
    for child in element:
        if isinstance(child.tag, str) and child.tag.startswith(start):
            yield child.tag[len(start) :], child


def text_of(element: Any) -> str:
    """Text on one line."""
    return " ".join((element.text or "").split())


def quantity_of(path: Path, name: str, element: Any, kind: str) -> float:
    """Value in SI (rad, nT); FileError naming element and line for what is no finite number or has no such unit."""
    text = text_of(element)
    if not NUMBER.fullmatch(text):
        wrong = Finding("input-kind", {"name": name, "value": text[:40], "expected": "number"})
        raise FileError(wrong, path=path, line=element.sourceline)
    try:
        return float(text) * _factor(name, kind, element.get("uom"))
    except InputError as error:
        raise in_file(error, path, element.sourceline) from None


# From a survey to the bytes of a WITSML 1.4.1.1 document.


def document(survey: SurveyFile, convention: str) -> bytes:
    """The whole document, UTF-8."""
    from lxml import etree

    root = etree.Element(_tag("trajectorys"), nsmap={None: _data()["namespace"]})  # type: ignore[dict-item]
    root.set("version", _data()["version"])
    trajectory = etree.SubElement(root, _tag("trajectory"))
    for name, default in (("uidWell", "well"), ("uidWellbore", "wellbore"), ("uid", "trajectory")):
        _set(trajectory, name, survey.header.get(name, default))
    well = next((survey.header[name] for name in ("well", "Well", "WELL") if name in survey.header), "unknown")
    for name in ("nameWell", "nameWellbore", "name"):
        _add(trajectory, name, survey.header.get(name) or (well if name == "nameWell" else "unknown"))
    for name, value in (("mdMn", survey.md.min()), ("mdMx", survey.md.max())):
        _add(trajectory, name, writing.number(float(value)), "m")
    if survey.header.get("serviceCompany"):
        _add(trajectory, "serviceCompany", survey.header["serviceCompany"])
    if survey.azimuth_reference:
        _add(trajectory, "aziRef", f"{survey.azimuth_reference} north")
    turned = to_vendor(survey, convention)
    cells = {key: writing.column(values) for key, values in values_of(turned).items()}
    uids = survey.extra.get("uid") or tuple(str(i + 1) for i in range(len(survey)))
    if len(set(uids)) < len(uids) or not all(uids):
        twice = next(uid for uid in uids if not uid or uids.count(uid) > 1)
        raise refused("input-repeated", {"name": "uid", "value": twice})
    for row, uid in enumerate(uids):
        station = etree.SubElement(trajectory, _tag("trajectoryStation"))
        _set(station, "uid", uid)
        _write_station(station, survey, row, {key: texts[row] for key, texts in cells.items() if texts[row]})
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _tag(name: str) -> str:
    return f"{{{_data()['namespace']}}}{name}"


def _set(element: Any, name: str, text: str) -> None:
    try:
        element.set(name, text)
    except ValueError:
        raise refused("file-characters", {"format": "XML", "text": text[:40]}) from None


def _add(parent: Any, name: str, text: str, uom: str = "") -> None:
    from lxml import etree

    child = etree.SubElement(parent, _tag(name))
    try:
        child.text = text
    except ValueError:
        raise refused("file-characters", {"format": "XML", "text": text[:40]}) from None
    if uom:
        child.set("uom", uom)


def _write_station(station: Any, survey: SurveyFile, row: int, cells: Mapping[str, str]) -> None:
    """The elements of one station, in the order of the schema."""
    texts = _texts(survey, row)
    for name in tuple(_data()["order"]["trajectoryStation"]):
        if name in GROUPS:
            _group(station, name, cells)
        elif name in texts:
            _add(station, name, texts[name])
        elif (element := _elements("station").get(name)) and element[0] in cells:
            _add(station, name, cells[element[0]], element[2])


def _group(station: Any, name: str, cells: Mapping[str, str]) -> None:
    from lxml import etree

    found = [(n, cells[key], unit) for n, (key, _, unit) in _elements(name).items() if unit and key in cells]
    if found:
        group = etree.SubElement(station, _tag(name))
        for child in found:
            _add(group, *child)


def _texts(survey: SurveyFile, row: int) -> dict[str, str]:
    """Texts of a station by element; the type of the station is required by the schema."""
    found = {name: cells[row] for name in _station_texts() if (cells := survey.extra.get(name)) and cells[row]}
    if "typeTrajStation" not in found:
        kind = "gyro north seeking" if survey.w is not None else "magnetic MWD" if survey.b is not None else "unknown"
        found["typeTrajStation"] = kind
    if survey.times and survey.times[row]:
        found["dTimStn"] = _time(survey.times[row])
    if survey.used is not None:
        said = found.get("statusTrajStation", "position")
        found["statusTrajStation"] = (said if said != "rejected" else "position") if survey.used[row] else "rejected"
    return found


def _time(text: str) -> str:
    """Date and time as the schema has them: always both, with T between and a zone; UTC where none is stated."""
    if re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)", text, re.ASCII):
        return text
    try:
        time = datetime.fromisoformat(text)
        return time.isoformat() + ("Z" if time.tzinfo is None else "")
    except ValueError:
        raise wrong_kind("time", text, "date and time") from None


def read_witsml(
    path: str | Path,
    *,
    sheet: str | None = None,
    convention: str = "iscwsa",
    azimuth_reference: str | None = None,
) -> SurveyFile:
    """Read one trajectory (`sheet`: its uid or name) of a WITSML document, version 1.3.1, 1.4.1 or 2.x.

    tran1, tran2 and axial are x, y, z of `convention`. A station of status "rejected" is not used. `corrections` adds
    those of drill string and multi-station. Convergence, from stnGridConUsed or the deprecated stnGridCorUsed, is
    positive where true north is west of grid north, as everywhere in the package. `azimuth_reference` is for a file
    whose `aziRef` is missing or unknown.
    """
    where = Path(path)
    root, data = load(where)
    # the trajectory asked for; FileError listing what there is
    found = [child for name, child in children(root) if name == "trajectory"]
    names = [
        (child.get("uid", ""), next((text_of(e) for n, e in children(child) if n == "name"), "")) for child in found
    ]
    fits = [child for child, name in zip(found, names, strict=True) if sheet is None or sheet in name]
    if len(fits) != 1:
        there = tuple(f"{uid:.60} ({name:.60})" for uid, name in names[:20])
        asked = (sheet or "-")[:60]
        choice = Finding("input-choice", {"name": "trajectory", "value": asked, "allowed": there})
        raise FileError(choice, path=where, line=root.sourceline)
    chosen = fits[0]
    # texts of the trajectory, the north of its azimuths, and the values it states for all stations
    header = {name: str(chosen.get(name)) for name in ("uid", "uidWell", "uidWellbore") if chosen.get(name)}
    north, shared = None, {}
    of_all = {"magDeclUsed": "stnMagDeclUsed", "gridConUsed": "stnGridConUsed", "gridCorUsed": "stnGridCorUsed"}
    for name, child in children(chosen):
        if name == "trajectoryStation" or len(child):
            continue
        if name in header:
            raise FileError(_twice(name), path=where, line=child.sourceline)
        header[name] = f"{text_of(child)} {child.get('uom', '')}".strip()
        if name == "aziRef":
            known = (*NORTHS, "unknown")
            if text_of(child) not in known:
                value = text_of(child)[:60]
                wrong = Finding("input-value", {"name": "aziRef", "value": value, "allowed": ", ".join(known)})
                raise FileError(wrong, path=where, line=child.sourceline)
            north = NORTHS.get(text_of(child))
        if name in of_all:
            shared[of_all[name]] = quantity_of(where, name, child, "angle")
    stations = [_station(where, child) for name, child in children(chosen) if name == "trajectoryStation"]
    if not stations:
        raise FileError(Finding("file-empty", {"what": "stations"}), path=path, line=chosen.sourceline)
    frame = _frame(where, stations, shared, convention)
    frame = replace(frame, north=north, header=header, digest=digest_bytes(data))
    survey = survey_of(frame, convention=convention, azimuth_reference=azimuth_reference)
    _depth_units(where, chosen, stations)
    unread = unused(sorted({name for station in stations for name in station.unread}))
    return replace(survey, findings=(*survey.findings, *unread, *_toolfaces(survey, convention)))


class _Station:
    """One station: values in SI by element, texts by element, the elements no one reads."""

    def __init__(self, line: int, uid: str) -> None:
        self.line = line
        self.values: dict[str, float] = {}
        self.texts: dict[str, str] = {"uid": uid}
        self.unread: set[str] = set()
        self.md_uom, self.md_line = "", line


def _station(path: Path, element: Any) -> _Station:
    station = _Station(element.sourceline, element.get("uid", ""))
    kept = {*_station_texts(), "dTimStn"}
    for name, child in children(element):
        if name in station.texts or name in station.values:
            raise FileError(_twice(name), path=path, line=child.sourceline)
        if name in GROUPS:
            _quantities_of(path, station, name, children(child))
        elif name in kept:
            station.texts[name] = text_of(child)
        else:
            _quantities_of(path, station, "station", [(name, child)])
            if name == "md":
                station.md_uom, station.md_line = child.get("uom", ""), child.sourceline
    if "md" not in station.values:
        raise FileError(Finding("input-missing", {"names": ("md",)}), path=path, line=station.line)
    return station


def _quantities_of(path: Path, station: _Station, group: str, found: Any) -> None:
    known = _elements(group)
    for name, child in found:
        if name not in known:
            station.unread.add(name)
        elif name in station.values:
            raise FileError(_twice(name), path=path, line=child.sourceline)
        else:
            station.values[name] = quantity_of(path, name, child, known[name][1])


def _depth_units(path: Path, chosen: Any, stations: list[_Station]) -> None:
    """FileError where one trajectory's depths are in two units, or its mdMn and mdMx are not its stations'."""
    first = stations[0]
    for station in stations:
        if station.md_uom != first.md_uom:
            several = Finding("table-units", {"column": "md", "units": (first.md_uom[:60], station.md_uom[:60])})
            raise FileError(several, path=path, line=station.md_line)
    unit = _factor("md", "length", first.md_uom)
    kept = [station.values["md"] for station in stations if station.texts.get("statusTrajStation") != "rejected"]
    for name, child in children(chosen):
        if name in ("mdMn", "mdMx"):
            stated = quantity_of(path, name, child, "length")
            # of all stations or of those not rejected: programs differ
            ends = [
                (min if name == "mdMn" else max)(depths)
                for depths in (kept, [s.values["md"] for s in stations])
                if depths
            ]
            found = min(ends, key=lambda end: abs(end - stated))
            # a head may be rounded to whole units; a wrong unit is far beyond that
            if abs(stated - found) > 0.501 * unit + 1e-3 * abs(found):
                given, there = stated / unit, found / unit
                apart = Finding("file-differs", {"name": name, "stated": given, "there": there})
                raise FileError(apart, path=path, line=child.sourceline)


def _frame(path: Path, stations: list[_Station], shared: dict[str, float], convention: str) -> Frame:
    """Stations as columns by the package's names."""
    found: dict[str, Array] = {}
    for group in ("station", *GROUPS):
        for name, (key, _, _) in _elements(group).items():
            default = shared.get(name, np.nan)
            values = np.array([station.values.get(name, default) for station in stations])
            if not np.isnan(values).all():
                before = found.get(key)
                found[key] = values if before is None else _joined(path, stations, name, before, values)
    known = quantities()
    columns: dict[str, Column] = {}
    # corrections in tool axes; the fields themselves are turned with the columns
    start = "corrections."
    corrections = {key.removeprefix(start): values for key, values in found.items() if key.startswith(start)}
    native = corrections_to_native(corrections, named(convention))
    rest = {key: values for key, values in found.items() if not key.startswith(start)}
    for key, values in (rest | {f"{start}{name}": values for name, values in native.items()}).items():
        own = known[key].unit
        # rad to deg and back would cost a digit; what is whole in degrees stays so
        columns[known[key].column] = values if own.factor == 1.0 else np.round(values / own.factor, 12) + 0.0
    groups = {key.partition(".")[0] for key in found} & {"g", "b", "covariance"}
    for key in [key for key in quantities() if key.partition(".")[0] in groups and key not in found]:
        columns[known[key].column] = np.full(len(stations), np.nan)
    for name in ("uid", *_station_texts()):
        texts = tuple(station.texts.get(name, "") for station in stations)
        if any(texts):
            columns[name] = texts
    columns["time"] = tuple(station.texts.get("dTimStn", "") for station in stations)
    status = [station.texts.get("statusTrajStation", "") for station in stations]
    if any(status):
        columns["used"] = tuple("no" if text == "rejected" else "yes" for text in status)
    return Frame(path, columns, np.array([station.line for station in stations]))


def _joined(path: Path, stations: list[_Station], name: str, before: Array, values: Array) -> Array:
    """Two elements for one quantity: corrections add up; two convergences must agree."""
    both = ~(np.isnan(before) | np.isnan(values))
    if name.startswith("mag"):
        return np.where(both, before + values, np.where(np.isnan(before), values, before))
    apart = both & (np.abs(before - values) > 1e-9)
    if apart.any():
        line = stations[int(np.argmax(apart))].line
        raise FileError(Finding("table-same", {"columns": ("stnGridConUsed", "stnGridCorUsed")}), path=path, line=line)
    return np.where(np.isnan(values), before, values)


def _toolfaces(survey: SurveyFile, convention: str) -> tuple[Finding, ...]:
    """A warning where the raw data's toolface is not the one stated."""
    if survey.g is None or survey.toolface is None:
        return ()
    apart = np.degrees(np.abs(wrap_signed(np.arctan2(survey.g[:, 1], -survey.g[:, 0]) - survey.toolface)))
    tilted = np.hypot(survey.g[:, 0], survey.g[:, 1]) > 0.5  # below 3 deg the toolface is noise
    apart = apart[tilted & np.isfinite(apart)]
    # a turned convention makes 90 deg or more, noise less than 5
    if not apart.size or float(np.median(apart)) < 5.0:
        return ()
    return (Finding("wits-toolface", {"off_deg": float(np.median(apart)), "convention": convention}),)


def write_witsml(survey: SurveyFile, path: str | Path, *, convention: str = "iscwsa") -> None:
    """Write a survey as a WITSML 1.4.1.1 trajectory, elements in the order of the schema.

    Units are m, dega, m/s2, nT, dega/30m and m2; numbers the shortest text that reads back the same, angles to 1e-10
    deg. Names and uids come from `header`, station uids and texts such as typeTrajStation from `extra`; a time without
    a zone is UTC. Rotation rates, temperature, gyro toolface, `valid` and other columns have no element.
    """
    write_bytes(document(survey, convention), path)

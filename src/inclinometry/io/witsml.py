"""WITSML 1.4.1.1 trajectories: stations with raw data, corrections, checks and covariance, read and written.

The standard names the sensors' axes axial, tran1 and tran2 and says no more than that they are at right angles. Here
they are taken as a vendor's z, x and y, in the convention the caller names: "iscwsa" (SPE 67616: y along the index
mark, x 90 deg before it) unless told otherwise. Inclination and azimuth do not depend on which of the conventions with
z down hole and gravity positive down it is; the toolface does, and a note says so where the toolface of the raw data
contradicts `gtf`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from inclinometry.attitude.conventions import named
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.core.digest import digest_bytes
from inclinometry.core.errors import FileError
from inclinometry.io import _witsml_schema as schema
from inclinometry.io._quantities import quantities
from inclinometry.io._sheet import Column, Sheet, survey_of
from inclinometry.io._vendor_axes import corrections_to_house
from inclinometry.io._witsml_write import document
from inclinometry.io._witsml_xml import children, load, quantity_of, text_of
from inclinometry.io.atomic import write_bytes
from inclinometry.io.exchange import SurveyFile

_APART: Final = 5.0  # deg between two toolfaces that a turned convention, 90 deg or more, exceeds and noise does not
_ENDS: Final[Mapping[str, Callable[[list[float]], float]]] = MappingProxyType({"mdMn": min, "mdMx": max})
_OF_ALL: Final = {"magDeclUsed": "stnMagDeclUsed", "gridConUsed": "stnGridConUsed", "gridCorUsed": "stnGridCorUsed"}


def read_witsml(
    path: str | Path,
    *,
    trajectory: str | None = None,
    convention: str = "iscwsa",
    azimuth_reference: str | None = None,
) -> SurveyFile:
    """Read one trajectory of a WITSML 1.4.1.1 document.

    Parameters
    ----------
    path : str or Path
    trajectory : str, optional
        uid or name, where the document has more than one.
    convention : str
        Axes and signs of the sensors: tran1, tran2 and axial are this convention's x, y and z.
    azimuth_reference : {"magnetic", "true", "grid"}, optional
        Where `aziRef` is missing or unknown.

    Returns
    -------
    SurveyFile
        A station of status "rejected" is not used. `corrections` is the sum of drill string and multi-station
        corrections. Convergence, from stnGridConUsed or the deprecated stnGridCorUsed, is positive where true north is
        west of grid north, as in the house. Texts of stations are in `extra`, those of the trajectory in `header`.

    Raises
    ------
    FileError
        Not well-formed; a document type or entity; another namespace or version; no station; a uom that is missing or
        unknown, naming the element; an element twice; text, NaN or infinity in a number's place; depths that do not
        increase, that are in several units or not what mdMn and mdMx say; azimuths without a north; each with its line.

    Examples
    --------
    >>> import tempfile
    >>> survey = SurveyFile(md=[9.0], inclination=[0.1], azimuth=[1.0], azimuth_reference="grid")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_witsml(survey, Path(folder, "a.xml"))
    ...     read_witsml(Path(folder, "a.xml")).azimuth_reference
    'grid'
    """
    where = Path(path)
    root, data = load(where)
    chosen = _chosen(where, root, trajectory)
    header, north, shared = _head(where, chosen)
    stations = [_station(where, child) for name, child in children(chosen) if name == "trajectoryStation"]
    if not stations:
        raise FileError("the trajectory has no trajectoryStation", path=path, line=chosen.sourceline)
    sheet = _sheet(where, stations, shared, convention)
    sheet = replace(sheet, north=north, header=header, digest=digest_bytes(data))
    survey = survey_of(sheet, convention=convention, azimuth_reference=azimuth_reference)
    _depth_units(where, chosen, stations)
    unread = sorted({name for station in stations for name in station.unread})
    notes = [f"not read: {', '.join(unread)}"] if unread else []
    return replace(survey, notes=(*survey.notes, *notes, *_toolface_notes(survey, convention)))


def _chosen(path: Path, root: Any, wanted: str | None) -> Any:
    """The trajectory asked for; FileError listing what there is."""
    found = [child for name, child in children(root) if name == "trajectory"]
    names = [
        (child.get("uid", ""), next((text_of(e) for n, e in children(child) if n == "name"), "")) for child in found
    ]
    fits = [child for child, name in zip(found, names, strict=True) if wanted is None or wanted in name]
    if len(fits) != 1:
        there = ", ".join(f"{uid!r} ({name})" for uid, name in names[:20]) or "none"
        problem = f"trajectory {wanted!r} fits {len(fits)}; give the uid of one. There are: {there}"
        raise FileError(problem, path=path, line=root.sourceline)
    return fits[0]


def _head(path: Path, trajectory: Any) -> tuple[dict[str, str], str | None, dict[str, float]]:
    """Texts of the trajectory, the north of its azimuths, and the values it states for all stations."""
    header = {name: str(trajectory.get(name)) for name in ("uid", "uidWell", "uidWellbore") if trajectory.get(name)}
    north, shared = None, {}
    for name, child in children(trajectory):
        if name == "trajectoryStation" or len(child):
            continue
        if name in header:
            raise FileError(f"{name} appears twice in the trajectory; remove one", path=path, line=child.sourceline)
        header[name] = f"{text_of(child)} {child.get('uom', '')}".strip()
        if name == "aziRef":
            known = (*schema.NORTHS, "unknown")
            if text_of(child) not in known:
                problem = f"aziRef is {text_of(child)!r}; allowed: {', '.join(known)}"
                raise FileError(problem, path=path, line=child.sourceline)
            north = schema.NORTHS.get(text_of(child))
        if name in _OF_ALL:
            shared[_OF_ALL[name]] = quantity_of(path, name, child, "angle")
    return header, north, shared


class _Station:
    """One station: values in SI by element, texts by element, the elements nobody reads."""

    def __init__(self, line: int, uid: str) -> None:
        self.line = line
        self.values: dict[str, float] = {}
        self.texts: dict[str, str] = {"uid": uid}
        self.unread: set[str] = set()
        self.md_uom, self.md_line = "", line


def _station(path: Path, element: Any) -> _Station:
    station = _Station(element.sourceline, element.get("uid", ""))
    kept = {*schema.station_texts(), "dTimStn"}
    for name, child in children(element):
        if name in station.texts or name in station.values:
            raise FileError(f"{name} appears twice in a station; remove one", path=path, line=child.sourceline)
        if name in schema.GROUPS:
            _quantities_of(path, station, name, children(child))
        elif name in kept:
            station.texts[name] = text_of(child)
        else:
            _quantities_of(path, station, "station", [(name, child)])
            if name == "md":
                station.md_uom, station.md_line = child.get("uom", ""), child.sourceline
    if "md" not in station.values:
        raise FileError("a station without md; add it or remove the station", path=path, line=station.line)
    return station


def _quantities_of(path: Path, station: _Station, group: str, found: Any) -> None:
    known = schema.elements(group)
    for name, child in found:
        if name not in known:
            station.unread.add(name)
        elif name in station.values:
            raise FileError(f"{name} appears twice in a station; remove one", path=path, line=child.sourceline)
        else:
            station.values[name] = quantity_of(path, name, child, known[name].kind)


def _depth_units(path: Path, chosen: Any, stations: list[_Station]) -> None:
    """FileError where one trajectory's depths are in two units, or its mdMn and mdMx are not its stations'."""
    first = stations[0]
    for count, station in enumerate(stations, 1):
        if station.md_uom != first.md_uom:
            problem = f"md of station {count} is in {station.md_uom!r}, of the first in {first.md_uom!r}"
            raise FileError(f"{problem}; use one unit in a trajectory", path=path, line=station.md_line)
    unit = schema.factor("length", first.md_uom)
    kept = [station.values["md"] for station in stations if station.texts.get("statusTrajStation") != "rejected"]
    for name, child in children(chosen):
        if name in _ENDS:
            stated = quantity_of(path, name, child, "length")
            # of all stations or of those not rejected: programs differ
            ends = [_ENDS[name](depths) for depths in (kept, [s.values["md"] for s in stations]) if depths]
            found = min(ends, key=lambda end: abs(end - stated))
            # a head may be rounded to whole units; a wrong unit is far beyond that
            if abs(stated - found) > 0.501 * unit + 1e-3 * abs(found):
                said = (
                    f"{name} is {text_of(child)} {child.get('uom')}, the stations' {found / unit:.10g} {first.md_uom}"
                )
                problem = f"{said}: is a unit wrong, is the file cut? Correct {name} or remove it"
                raise FileError(problem, path=path, line=child.sourceline)


def _sheet(path: Path, stations: list[_Station], shared: dict[str, float], convention: str) -> Sheet:
    """Stations as columns of the house's."""
    found: dict[str, Array] = {}
    for group in ("station", *schema.GROUPS):
        for name, element in schema.elements(group).items():
            default = shared.get(name, np.nan)
            values = np.array([station.values.get(name, default) for station in stations])
            if not np.isnan(values).all():
                before = found.get(element.key)
                found[element.key] = values if before is None else _joined(path, stations, name, before, values)
    known = quantities()
    columns: dict[str, Column] = {}
    for key, values in _turned(found, convention).items():
        own = known[key].unit
        # rad to deg and back would cost a digit; what is whole in degrees stays so
        columns[known[key].column] = values if own.factor == 1.0 else np.round(values / own.factor, 12) + 0.0
    for key in _lacking(found):
        columns[known[key].column] = np.full(len(stations), np.nan)
    for name in ("uid", *schema.station_texts()):
        texts = tuple(station.texts.get(name, "") for station in stations)
        if any(texts):
            columns[name] = texts
    columns["time"] = tuple(station.texts.get("dTimStn", "") for station in stations)
    status = [station.texts.get("statusTrajStation", "") for station in stations]
    if any(status):
        columns["used"] = tuple("no" if text == "rejected" else "yes" for text in status)
    return Sheet(path, columns, np.array([station.line for station in stations]))


def _joined(path: Path, stations: list[_Station], name: str, before: Array, values: Array) -> Array:
    """Two elements for one quantity: corrections add up; two convergences must agree."""
    both = ~(np.isnan(before) | np.isnan(values))
    if name.startswith("mag"):
        return np.where(both, before + values, np.where(np.isnan(before), values, before))
    apart = both & (np.abs(before - values) > 1e-9)
    if apart.any():
        line = stations[int(np.argmax(apart))].line
        problem = f"{name} contradicts its deprecated form; they have one sign: remove one of them"
        raise FileError(problem, path=path, line=line)
    return np.where(np.isnan(values), before, values)


def _turned(found: dict[str, Array], convention: str) -> dict[str, Array]:
    """Corrections in the house's axes; the fields themselves are turned with the columns."""
    start = "corrections."
    corrections = {key.removeprefix(start): values for key, values in found.items() if key.startswith(start)}
    house = corrections_to_house(corrections, named(convention))
    rest = {key: values for key, values in found.items() if not key.startswith(start)}
    return rest | {f"{start}{name}": values for name, values in house.items()}


def _lacking(found: dict[str, Array]) -> list[str]:
    """Axes of a triad and elements of a covariance that no station has, where others are there."""
    groups = {key.partition(".")[0] for key in found} & {"g", "b", "covariance"}
    return [key for key in quantities() if key.partition(".")[0] in groups and key not in found]


def _toolface_notes(survey: SurveyFile, convention: str) -> list[str]:
    """A note where the raw data's toolface is not the one stated."""
    if survey.g is None or survey.toolface is None:
        return []
    apart = np.degrees(np.abs(wrap_signed(np.arctan2(survey.g[:, 1], -survey.g[:, 0]) - survey.toolface)))
    tilted = np.hypot(survey.g[:, 0], survey.g[:, 1]) > 0.5  # below 3 deg the toolface is noise
    apart = apart[tilted & np.isfinite(apart)]
    if not apart.size or float(np.median(apart)) < _APART:
        return []
    return [
        f"the toolfaces of the raw data are {float(np.median(apart)):.0f} deg (median) from gtf: are their axes in "
        f"another convention than {convention!r}?"
    ]


def write_witsml(survey: SurveyFile, path: str | Path, *, convention: str = "iscwsa") -> None:
    """Write a survey as a WITSML 1.4.1.1 trajectory, elements in the order of the schema.

    Units are m, dega, m/s2, nT, dega/30m and m2; numbers the shortest text that reads back the same, angles to 1e-10
    deg. uid, uidWell, uidWellbore, nameWell, nameWellbore, name, serviceCompany come from `header`, station uids and
    texts such as typeTrajStation from `extra`; a time without a zone is written as UTC. Rotation rates, temperature,
    gyro toolface, `valid`, and other columns have no element in this version and are not written.

    Parameters
    ----------
    survey : SurveyFile
    path : str or Path
    convention : str
        Axes and signs to write the sensors in, as in `read_witsml`.

    Raises
    ------
    InputError
        A text that XML cannot hold; a station uid twice; a time that is not ISO 8601.
    """
    write_bytes(document(survey, convention), path)

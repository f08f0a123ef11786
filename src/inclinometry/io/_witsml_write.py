"""From a survey to the bytes of a WITSML 1.4.1.1 document."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final

from inclinometry.core.errors import InputError
from inclinometry.io import _witsml_schema as schema
from inclinometry.io import _write
from inclinometry.io._columns_out import columns_of
from inclinometry.io._vendor_axes import to_vendor
from inclinometry.io.exchange import SurveyFile

_NAMES: Final = ("nameWell", "nameWellbore", "name")
_XSD_TIME: Final = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)", re.ASCII)
_AZI_REF: Final = {north: text for text, north in schema.NORTHS.items()}


def document(survey: SurveyFile, convention: str) -> bytes:
    """The whole document, UTF-8."""
    from lxml import etree

    root = etree.Element(_tag("trajectorys"), nsmap={None: schema.namespace()})  # type: ignore[dict-item]
    root.set("version", schema.version())
    trajectory = etree.SubElement(root, _tag("trajectory"))
    for name, default in (("uidWell", "well"), ("uidWellbore", "wellbore"), ("uid", "trajectory")):
        _set(trajectory, name, survey.header.get(name, default))
    _head(trajectory, survey)
    turned = to_vendor(survey, convention)
    cells = {c.quantity.key: _write.column(c.values) for c in columns_of(turned) if c.quantity}  # type: ignore[arg-type]
    uids = survey.extra.get("uid") or tuple(str(i + 1) for i in range(len(survey)))
    if len(set(uids)) < len(uids) or not all(uids):
        raise InputError("the stations' uids are not each another; correct extra['uid'] or remove it")
    for row, uid in enumerate(uids):
        station = etree.SubElement(trajectory, _tag("trajectoryStation"))
        _set(station, "uid", uid)
        _station(station, survey, row, {key: texts[row] for key, texts in cells.items() if texts[row]})
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _tag(name: str) -> str:
    return f"{{{schema.namespace()}}}{name}"


def _set(element: Any, name: str, text: str) -> None:
    try:
        element.set(name, text)
    except ValueError:
        raise InputError(f"{name} {text[:40]!r} holds characters XML cannot; remove them") from None


def _add(parent: Any, name: str, text: str, uom: str = "") -> None:
    from lxml import etree

    child = etree.SubElement(parent, _tag(name))
    try:
        child.text = text
    except ValueError:
        raise InputError(f"{name} {text[:40]!r} holds characters XML cannot; remove them") from None
    if uom:
        child.set("uom", uom)


def _head(trajectory: Any, survey: SurveyFile) -> None:
    well = next((survey.header[name] for name in ("well", "Well", "WELL") if name in survey.header), "unknown")
    for name in _NAMES:
        _add(trajectory, name, survey.header.get(name) or (well if name == "nameWell" else "unknown"))
    for name, value in (("mdMn", survey.md.min()), ("mdMx", survey.md.max())):
        _add(trajectory, name, _write.number(float(value)), "m")
    if survey.header.get("serviceCompany"):
        _add(trajectory, "serviceCompany", survey.header["serviceCompany"])
    if survey.azimuth_reference:
        _add(trajectory, "aziRef", _AZI_REF[survey.azimuth_reference])


def _station(station: Any, survey: SurveyFile, row: int, cells: Mapping[str, str]) -> None:
    """The elements of one station, in the order of the schema."""
    texts = _texts(survey, row)
    for name in schema.order("trajectoryStation"):
        if name in schema.GROUPS:
            _group(station, name, cells)
        elif name in texts:
            _add(station, name, texts[name])
        elif (element := schema.elements("station").get(name)) and element.key in cells:
            _add(station, name, cells[element.key], element.written)


def _group(station: Any, name: str, cells: Mapping[str, str]) -> None:
    from lxml import etree

    found = [(n, e) for n, e in schema.elements(name).items() if e.written and e.key in cells]
    if found:
        group = etree.SubElement(station, _tag(name))
        for child, element in found:
            _add(group, child, cells[element.key], element.written)


def _texts(survey: SurveyFile, row: int) -> dict[str, str]:
    """Texts of a station by element; the type of the station is required by the schema."""
    found = {name: cells[row] for name in schema.station_texts() if (cells := survey.extra.get(name)) and cells[row]}
    if "typeTrajStation" not in found:
        kind = "gyro north seeking" if survey.w is not None else "magnetic MWD" if survey.b is not None else "unknown"
        found["typeTrajStation"] = kind
    if survey.times and survey.times[row]:
        found["dTimStn"] = _time(survey.times[row], row)
    if survey.used is not None:
        said = found.get("statusTrajStation", "position")
        found["statusTrajStation"] = (said if said != "rejected" else "position") if survey.used[row] else "rejected"
    return found


def _time(text: str, row: int) -> str:
    """Date and time as the schema has them: always both, with T between and a zone; UTC where none is stated."""
    if _XSD_TIME.fullmatch(text):
        return text
    try:
        time = datetime.fromisoformat(text)
        return time.isoformat() + ("Z" if time.tzinfo is None else "")
    except ValueError:
        raise InputError(f"time {text!r} at station {row + 1}; ISO 8601 is needed") from None

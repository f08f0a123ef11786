"""WITS level 0: a stream of numbered items, read and written by a map of items to quantities with units.

The stream itself names neither quantity nor unit, and raw sensors live in spare items that each vendor fills as it
likes; so nothing is read without a map. `record_7` is that of the survey record of the WITS specification.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from inclinometry.conventions import named
from inclinometry.earth.site import REFERENCES
from inclinometry.errors import FileError, InputError, in_file, not_among, out_of_range, refused, wrong_kind
from inclinometry.files import writing
from inclinometry.files._quantities import Meaning, meaning, quantities
from inclinometry.files.frame import Column, Frame
from inclinometry.files.survey_file import SurveyFile, survey_of, to_vendor, values_of
from inclinometry.files.text import NUMBER, LineReader
from inclinometry.files.toml_keys import load
from inclinometry.files.writing import write_text
from inclinometry.findings import Finding
from inclinometry.opening import too_large

# Frames of a WITS level 0 stream: && on a line, items of four digits and a value, !! on a line.

BEGIN: Final = "&&"
END: Final = "!!"


class WitsFrame(NamedTuple):
    """One frame: the line its && stands in, and item number -> value as text, with the line of each."""

    line: int
    items: dict[str, str]
    lines: dict[str, int]


def read_frames(path: str | Path) -> tuple[list[WitsFrame], list[tuple[int, Finding]], str]:
    """The frames of a stream, line and reason of those that are broken and left out, and the digest of the file.

    Lines between frames are not looked at.
    """
    reader = LineReader(Path(path))
    whole: list[WitsFrame] = []
    broken: list[tuple[int, Finding]] = []
    frame: WitsFrame | None = None
    why: tuple[int, Finding] | None = None

    def close(ended: bool) -> None:
        if frame is None:
            return
        if why is not None:
            broken.append(why)
        elif ended and frame.items:
            whole.append(frame)
        else:
            broken.append((frame.line, Finding("wits-frame", {"lacking": "0000 .. 9999" if ended else END})))

    for block in reader.blocks():
        for line, text in enumerate(map(str.strip, block.lines), block.first):
            if text == BEGIN:
                close(False)
                frame, why = WitsFrame(line, {}, {}), None
            elif text == END and frame is not None:
                close(True)
                frame, why = None, None
            elif text == END:
                broken.append((line, Finding("wits-frame", {"lacking": BEGIN})))
            elif frame is not None and text and why is None:
                wrong = take_item(frame, line, text)
                why = None if wrong is None else (line, wrong)
    close(False)
    if not whole and not broken:
        raise FileError(Finding("file-section", {"section": f"{BEGIN} .. {END}"}), path=path)
    return whole, broken, reader.digest


def take_item(frame: WitsFrame, line: int, text: str) -> Finding | None:
    """Add one item; what is wrong with it, or None."""
    item = re.fullmatch(r"([0-9]{4})(.*)", text)
    if item is None:
        return Finding("wits-item", {"text": text[:40]})
    if item[1] in frame.items:
        return Finding("input-repeated", {"name": "column", "value": item[1]})
    largest = 10_000  # items of one frame; 25 records of 99 items are defined
    if len(frame.items) >= largest:
        return too_large("items of a frame", len(frame.items) + 1, largest)
    frame.items[item[1]] = item[2].strip()
    frame.lines[item[1]] = line
    return None


@dataclass(frozen=True)
class Wits0Map:
    """What the items of a stream are.

    channels : item, four digits (record and item) -> column name with its unit, as in a survey table: "md_ft",
    "inclination_deg", "gx_mg", "bx_nT". Times are read from items 05 (date) and 06 (time) of the depth's record.
    """

    channels: Mapping[str, str]
    convention: str = "native"
    azimuth_reference: str | None = None
    meanings: Mapping[str, Meaning] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "convention", named(self.convention).name)
        if self.azimuth_reference not in (None, *REFERENCES):
            raise not_among("azimuth_reference", str(self.azimuth_reference), REFERENCES)
        found: dict[str, Meaning] = {}
        for item, name in self.channels.items():
            if not re.fullmatch(r"[0-9]{4}", item):
                raise out_of_range("item", item, "0000 .. 9999")
            what = meaning(name)
            if what is None or what.unit is None:
                raise refused("table-unit-missing", {"name": name, "right": ("inclination_deg", "gx_g")})
            twice = next((other for other, seen in found.items() if seen.key == what.key), None)
            if twice is not None:
                raise refused("table-same", {"columns": (twice, item)})
            found[item] = what
        if "md" not in [what.key for what in found.values()]:
            raise refused("input-missing", {"names": ("md_m",)})
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))
        object.__setattr__(self, "meanings", MappingProxyType(found))

    @property
    def depth_item(self) -> str:
        """The item that is the measured depth."""
        return next(item for item, what in self.meanings.items() if what.key == "md")


def record_7(*, feet: bool = False) -> dict[str, str]:
    """The standard survey items of WITS record 7, depths in metres or feet; add the vendor's own spare items.

    >>> Wits0Map(record_7() | {"0722": "gx_g", "0723": "gy_g", "0724": "gz_g"}).depth_item
    '0708'
    """
    unit = "ft" if feet else "m"
    dogleg = "dls_deg_100ft" if feet else "dls_deg_30m"
    return {
        "0708": f"md_{unit}", "0709": f"tvd_{unit}", "0713": "inclination_deg", "0715": "azimuth_deg",
        "0716": "magnetic_toolface_deg", "0717": "toolface_deg", "0718": f"north_{unit}", "0719": f"east_{unit}",
        "0720": dogleg,
    }  # fmt: skip


def read_wits0_map(path: str | Path) -> Wits0Map:
    """Read a map from TOML: `convention`, `azimuth_reference` and the table `[channels]` of item = "column_unit"."""
    settings = load(path, ("convention", "azimuth_reference", "channels"))
    channels = settings.content.get("channels")
    if not isinstance(channels, dict) or not all(isinstance(name, str) for name in channels.values()):
        raise in_file(wrong_kind("channels", str(channels)[:60], "table"), path)
    convention = settings.text("convention") or "native"
    try:
        return Wits0Map(channels, convention, settings.text("azimuth_reference", REFERENCES))
    except InputError as error:
        raise in_file(error, path) from None


def read_wits0(path: str | Path, channels: Wits0Map) -> SurveyFile:
    """Read the survey stations of a WITS level 0 stream; items that are not mapped are in `extra` under their number.

    A frame with the depth and another mapped item is a station; a station sent again unchanged is one station. Other
    frames are passed over. Broken frames do not stop the reading: they are counted in `header` and a finding.
    """
    whole, broken, digest = read_frames(path)
    stations: list[WitsFrame] = []
    passed = again = 0
    for frame in whole:
        mine = [item for item in channels.meanings if _there(frame, item)]
        wrong = next((item for item in mine if not NUMBER.fullmatch(frame.items[item])), None)
        if wrong is not None:
            why = {"name": channels.channels[wrong], "value": frame.items[wrong][:40], "expected": "number"}
            broken.append((frame.lines[wrong], Finding("input-kind", why)))
        elif channels.depth_item not in mine or len(mine) < 2:
            passed += 1
        elif any(
            all(frame.items.get(item) == other.items.get(item) for item in channels.channels) for other in stations[-1:]
        ):
            again += 1
        else:
            stations.append(frame)
    if not stations:
        none = Finding("wits-none", {"item": channels.depth_item, "broken": len(broken)})
        raise FileError(none, path=path, line=broken[0][0] if broken else None)
    total = len(stations) + len(broken) + passed + again
    counts = {"frames": total, "frames_broken": len(broken), "frames_passed_over": passed, "frames_repeated": again}
    header = {name: str(count) for name, count in counts.items()}
    # stations as columns; every mapped item that occurs, and the others as text under their number
    columns: dict[str, Column] = {}
    for item, name in channels.channels.items():
        values = [float(frame.items[item]) if _there(frame, item) else np.nan for frame in stations]
        if not np.isnan(values).all():
            columns[name] = np.array(values)
    columns["time"] = tuple(_time(frame, channels.depth_item[:2]) for frame in stations)
    stamps = {channels.depth_item[:2] + tail for tail in ("05", "06")} if any(columns["time"]) else set()
    others = dict.fromkeys(item for frame in stations for item in frame.items)
    for item in others:
        if item not in channels.channels and item not in stamps:
            columns[item] = tuple(frame.items.get(item, "") for frame in stations)
    rows = np.array([frame.lines[channels.depth_item] for frame in stations])
    table = Frame(Path(path), columns, rows, header=header, digest=digest)
    survey = survey_of(table, convention=channels.convention, azimuth_reference=channels.azimuth_reference)
    if not broken:
        return survey
    line, first = min(broken, key=lambda one: one[0])
    left = Finding("wits-broken", {"broken": len(broken), "line": line, "finding": first})
    return replace(survey, findings=(*survey.findings, left))


def _there(frame: WitsFrame, item: str) -> bool:
    text = frame.items.get(item, "")
    return bool(text) and not (NUMBER.fullmatch(text) and f"{float(text):g}" in ("-9999", "-8888"))


def _time(frame: WitsFrame, record: str) -> str:
    """ISO 8601 from the record's date (YYMMDD) and time (HHMMSS); empty where they are not both there and valid."""
    date, clock = (frame.items.get(record + tail, "") for tail in ("05", "06"))
    try:
        return datetime.strptime(f"{date} {clock.zfill(6)}", "%y%m%d %H%M%S").isoformat() if clock else ""
    except ValueError:
        return ""


def write_wits0(survey: SurveyFile, path: str | Path, channels: Wits0Map) -> None:
    """Write a survey as WITS level 0: one frame a station, with the items that are mapped and known.

    Numbers are the shortest text that reads back the same, to 1e-10 of their unit. What is not mapped is not written;
    items 05 and 06 of the depth's record carry the time.
    """
    norths = (survey.azimuth_reference, channels.azimuth_reference)
    azimuths = "azimuth" in [what.key for what in channels.meanings.values()] and survey.azimuth is not None
    if azimuths and norths[0] != norths[1]:
        raise refused("input-north", {"norths": tuple(map(str, norths))})
    known = values_of(to_vendor(survey, channels.convention))
    texts: dict[str, list[str]] = {}
    for item, what in channels.meanings.items():
        values = known.get(what.key)
        if values is not None and what.unit is not None:
            own = quantities()[what.key].unit
            if own != what.unit:
                values = (values * own.factor - what.unit.offset) / what.unit.factor
                values = np.round(values, 10) + 0.0
            texts[item] = writing.column(values)
    if len(texts) < 2:
        raise refused("table-depth-only", {"present": tuple(known)})
    frames = []
    for row in range(len(survey)):
        items = [f"{item}{cells[row]}" for item, cells in sorted(texts.items()) if cells[row]]
        frames.append("\n".join((BEGIN, *_stamp(survey, row, channels.depth_item[:2]), *items, END)))
    write_text("\n".join(frames) + "\n", path)


def _stamp(survey: SurveyFile, row: int, record: str) -> list[str]:
    text = survey.times[row] if survey.times else ""
    if not text:
        return []
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        raise wrong_kind("time", text, "date and time") from None
    return [f"{record}05{time:%y%m%d}", f"{record}06{time:%H%M%S}"]

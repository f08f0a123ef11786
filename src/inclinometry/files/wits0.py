"""WITS level 0: a stream of numbered items, read and written by a map of items to quantities with units.

The stream itself names neither quantity nor unit, and raw sensors live in spare items that each vendor fills as it
likes; so nothing is read without a map. `record_7` is that of the survey record of the WITS specification.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from inclinometry.conventions import named
from inclinometry.earth.site import REFERENCES
from inclinometry.errors import FileError, InputError
from inclinometry.files import writing
from inclinometry.files._quantities import Meaning, meaning, quantities
from inclinometry.files.exchange import SurveyFile, survey_of, to_vendor, values_of
from inclinometry.files.frame import Column, Frame
from inclinometry.files.text import NUMBER, LineReader
from inclinometry.files.toml_keys import load
from inclinometry.files.writing import write_text

# Frames of a WITS level 0 stream: && on a line, items of four digits and a value, !! on a line.

BEGIN: Final = "&&"
END: Final = "!!"


class WitsFrame(NamedTuple):
    """One frame: the line its && stands in, and item number -> value as text, with the line of each."""

    line: int
    items: dict[str, str]
    lines: dict[str, int]


def read_frames(path: str | Path) -> tuple[list[WitsFrame], list[tuple[int, str]], str]:
    """The frames of a stream, line and reason of those that are broken and left out, and the digest of the file.

    Lines between frames are not looked at.
    """
    reader = LineReader(Path(path))
    whole: list[WitsFrame] = []
    broken: list[tuple[int, str]] = []
    frame: WitsFrame | None = None
    why: tuple[int, str] | None = None

    def close(unended: str = "") -> None:
        if frame is None:
            return
        wrong = why or (
            (frame.line, unended) if unended else None if frame.items else (frame.line, "the frame is empty")
        )
        if wrong is None:
            whole.append(frame)
        else:
            broken.append(wrong)

    for block in reader.blocks():
        for line, text in enumerate(map(str.strip, block.lines), block.first):
            if text == BEGIN:
                close("the frame does not end (!! is missing)")
                frame, why = WitsFrame(line, {}, {}), None
            elif text == END and frame is not None:
                close()
                frame, why = None, None
            elif text == END:
                broken.append((line, "the end of a frame (!!) without its beginning (&&)"))
            elif frame is not None and text and why is None:
                wrong = take_item(frame, line, text)
                why = None if wrong is None else (line, wrong)
    close("the frame does not end (!! is missing): truncated?")
    if not whole and not broken:
        raise FileError("no frame (&& to !!); this is no WITS level 0 stream", path=path)
    return whole, broken, reader.digest


def take_item(frame: WitsFrame, line: int, text: str) -> str | None:
    """Add one item; what is wrong with it, or None."""
    item = re.fullmatch(r"([0-9]{4})(.*)", text)
    if item is None:
        return f"{text[:40]!r} is no item (four digits and a value)"
    if item[1] in frame.items:
        return f"item {item[1]} appears twice in one frame"
    largest = 10_000  # items of one frame; 25 records of 99 items are defined
    if len(frame.items) >= largest:
        return f"more than {largest} items in one frame"
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
            raise InputError(f"azimuth reference {self.azimuth_reference!r}; allowed: {', '.join(REFERENCES)}")
        found: dict[str, Meaning] = {}
        for item, name in self.channels.items():
            if not re.fullmatch(r"[0-9]{4}", item):
                raise InputError(f"item {item!r} is not four digits; give record and item, e.g. 0713")
            try:
                what = meaning(name)
            except InputError as error:
                raise InputError(f"item {item}: {error}") from None
            if what is None or what.unit is None:
                raise InputError(f"item {item}: {name!r} is no quantity with a unit; write e.g. inclination_deg, gx_g")
            twice = next((other for other, seen in found.items() if seen.key == what.key), None)
            if twice is not None:
                raise InputError(f"items {twice} and {item} both give {what.key}; remove one")
            found[item] = what
        if "md" not in [what.key for what in found.values()]:
            raise InputError("the map has no depth; map an item to md_m or md_ft, e.g. 0708")
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
        raise FileError('a table [channels] of lines like 0713 = "inclination_deg" is needed', path=path)
    convention = settings.text("convention") or "native"
    try:
        return Wits0Map(channels, convention, settings.text("azimuth_reference", REFERENCES))
    except InputError as error:
        raise FileError(str(error), path=path) from None


def read_wits0(path: str | Path, channels: Wits0Map) -> SurveyFile:
    """Read the survey stations of a WITS level 0 stream; items that are not mapped are in `extra` under their number.

    A frame with the depth and another mapped item is a station; a station sent again unchanged is one station. Other
    frames are passed over. Broken frames do not stop the reading: they are counted in `header` and named in `notes`.
    """
    whole, broken, digest = read_frames(path)
    stations: list[WitsFrame] = []
    passed = again = 0
    for frame in whole:
        mine = [item for item in channels.meanings if _there(frame, item)]
        wrong = next((item for item in mine if not NUMBER.fullmatch(frame.items[item])), None)
        if wrong is not None:
            why = f"{frame.items[wrong][:40]!r} of item {wrong} ({channels.channels[wrong]}) is not a number"
            broken.append((frame.lines[wrong], why))
        elif channels.depth_item not in mine or len(mine) < 2:
            passed += 1
        elif any(
            all(frame.items.get(item) == other.items.get(item) for item in channels.channels) for other in stations[-1:]
        ):
            again += 1
        else:
            stations.append(frame)
    if not stations:
        reason = f"; the first broken one, line {broken[0][0]}: {broken[0][1]}" if broken else ""
        problem = f"no frame has item {channels.depth_item} and another mapped item; {len(broken)} frames are broken"
        raise FileError(problem + reason, path=path)
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
    return replace(survey, notes=(*survey.notes, *_broken_notes(sorted(broken))))


def _there(frame: WitsFrame, item: str) -> bool:
    text = frame.items.get(item, "")
    return bool(text) and not (NUMBER.fullmatch(text) and f"{float(text):g}" in ("-9999", "-8888"))


def _broken_notes(broken: Sequence[tuple[int, str]]) -> list[str]:
    notes = [f"line {line}: broken frame left out: {why}" for line, why in broken[:20]]
    if len(broken) > 20:
        notes.append(f"{len(broken) - 20} more broken frames were left out")
    return notes


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
        raise InputError(f"azimuths are from {norths[0]} north, the map says {norths[1]}; convert one of them")
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
        raise InputError("nothing that is mapped besides the depth is in the survey; map one of its quantities")
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
        raise InputError(f"time {text!r} at station {row + 1}; ISO 8601 is needed") from None
    return [f"{record}05{time:%y%m%d}", f"{record}06{time:%H%M%S}"]

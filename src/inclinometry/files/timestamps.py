"""Date and time of a row as seconds: ISO stamps, a date and a time, or year, month, day, hour, minute, second apart."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import Final

from inclinometry.errors import FileError
from inclinometry.files._quantities import seconds_of
from inclinometry.files.layout import cut, joined
from inclinometry.files.table import Block

Seconds = Callable[[Sequence[str]], float]
"""Seconds since the first row, by the cells of the columns of time."""

_PARTS: Final = {
    "year": ("year", "yr", "yyyy", "jahr"), "month": ("month", "mon", "monat"), "day": ("day", "tag"),
    "hour": ("hour", "hours", "hr", "hh", "stunde"), "minute": ("minute", "minutes", "min", "mn"),
    "second": ("second", "seconds", "sec", "ss", "sekunde"),
    "millisecond": ("millisecond", "milliseconds", "millis", "msec"), "nanosecond": ("nano", "nanosecond"),
}  # fmt: skip
_WHOLE: Final = ("datetime", "timestamp", "time", "date", "datum", "uhrzeit", "zeit", "clock", "timeofday", "isotime",
                 "loggingtime", "dateandtime", "datetimestamp", "sampletime")  # fmt: skip
_CLOCK: Final = re.compile(r"([01]?\d|2[0-4]):([0-5]\d)(?::((?:[0-5]\d|60)(?:[.,]\d*)?))?\s*([AaPp])?\.?[Mm]?\.?")
_DATE: Final = re.compile(r"(\d{1,4})([-./])(\d{1,2})\2(\d{1,4})")
_ZONE: Final = re.compile(r"(?<=\d)\s*(Z|UTC|GMT|[+-]\d\d:?\d\d)$")
_DAY: Final = 86400.0


def part_of_time(name: str) -> str | None:
    """What of date and time a column's name says: "year" .. "nanosecond", or "whole" where the cells tell.

    Examples
    --------
    >>> [part_of_time(name) for name in ("UTC_Year", "Hour (hh)", "Date/Time", "time_s", "inclination")]
    ['year', 'hour', 'whole', None, None]
    """
    plain = re.sub(r"[(\[].*?[)\]]|[\s_\-./]", "", name).lower()
    plain = plain.removeprefix("utc").removesuffix("utc") or plain
    return "whole" if plain in _WHOLE else next((part for part, names in _PARTS.items() if plain in names), None)


def timed(blocks: Iterator[Block], path: Path) -> Iterator[Block]:
    """Blocks of a plain table with date and time replaced by `time_s`, seconds since the first row.

    A table that has no date and time, or a `time_s` besides, stays as it is.

    Raises
    ------
    FileError
        A cell that is no date or time where that of the first row is; a date whose day may be its month.
    """
    held: list[Block] = []
    rows: list[tuple[int, int]] = []
    for block in blocks:
        rows += [(len(held), k) for k, line in enumerate(block.lines) if line.strip() and line.lstrip()[0] != "#"]
        held.append(block)
        if len(rows) > 1:
            break
    if len(rows) < 2:
        yield from held
        return
    names, first = (held[k].lines[row] for k, row in rows[:2])
    mark = next((mark for mark in "\t;," if mark in "".join(names.split('"')[::2])), ",")
    header, cells = cut(names, mark), cut(first, mark)
    found = _found(header, cells)
    if found is None:
        yield from chain(held, blocks)
        return
    places, seconds = found
    kept = [k for k in range(len(header)) if k not in places]
    last = max(places)
    before = rows[1]
    for number, block in enumerate(chain(held, blocks)):
        out = list(block.lines)
        for row, line in enumerate(block.lines):
            if (number, row) == rows[0]:
                out[row] = joined(["time_s", *(header[k] for k in kept)], mark)
            if (number, row) < before or not line.strip() or line.lstrip()[0] == "#":
                continue
            cells = cut(line, mark)
            if len(cells) <= last:
                continue  # too short: the reader of the table says so
            try:
                time = seconds([cells[k].strip() for k in places])
            except (ValueError, OverflowError) as error:
                raise FileError(_problem(header, cells, places, error), path=path, line=block.first + row) from None
            # an exponent in the place of a point: it goes with decimal points and commas alike
            out[row] = joined([f"{round(time * 1e6)}e-6", *(cells[k] for k in kept if k < len(cells))], mark)
        yield Block(block.first, out, block.plain)


def _problem(header: Sequence[str], cells: Sequence[str], places: Sequence[int], error: Exception) -> str:
    shown = " ".join(cells[k].strip() for k in places)[:60]
    names = ", ".join(repr(header[k].strip()) for k in places)
    why = str(error) if "first" in str(error) else "correct it or remove the row"
    return f"{shown!r} in column {names} is no date and time such as 2026-05-01 12:30:00.5; {why}"


def _found(header: Sequence[str], cells: Sequence[str]) -> tuple[list[int], Seconds] | None:
    """Columns of date and time, and what makes seconds of them; None where there are none."""
    parts = [part_of_time(name.strip()) for name in header]
    stated = any(name.strip() == "time_s" or seconds_of(name.strip()) for name in header)
    if stated or len(cells) < len(header):
        return None
    split = {part: parts.index(part) for part in _PARTS if part in parts}
    if {"hour", "minute"} <= set(split) and all(cells[k].strip() for k in split.values()):
        named = [part for part in ("year", "month", "day") if part in split]
        if len(named) in (0, 3):
            return list(split.values()), _split(list(split))
    texts = {k: cells[k].strip() for k, part in enumerate(parts) if part == "whole"}
    clocks = [k for k, text in texts.items() if _CLOCK.fullmatch(_ZONE.sub("", text))]
    dates = [k for k, text in texts.items() if _DATE.fullmatch(text)]
    stamps = [k for k, text in texts.items() if _stamp_parts(text) is not None]
    of = _Stamps().of
    if stamps:
        return stamps[:1], of
    return ([*dates[:1], *clocks[:1]], of) if clocks else None


def _split(parts: Sequence[str]) -> Seconds:
    """Seconds by columns of year, month, day, hour, minute and second, or of the clock alone."""
    start: list[float] = []
    days: dict[tuple[int, int, int], int] = {}
    scale: Mapping[str, float] = {"hour": 3600.0, "minute": 60.0, "second": 1.0, "millisecond": 1e-3,
                                  "nanosecond": 1e-9}  # fmt: skip
    dated = "year" in parts
    clock = [(k, scale[part]) for k, part in enumerate(parts) if part in scale]

    def seconds(cells: Sequence[str]) -> float:
        time = sum(float(cells[k].replace(",", ".")) * factor for k, factor in clock)
        if dated:
            year, month, day = (int(cells[parts.index(part)]) for part in ("year", "month", "day"))
            key = (year, month, day)
            if key not in days:
                days[key] = datetime(year + 2000 * (year < 100), month, day).toordinal()
            # from the first day, so that no digit of a second is lost
            time += (days[key] - next(iter(days.values()))) * _DAY
        elif start and time < start[1] - 0.5 * _DAY:
            start[0] -= _DAY  # past midnight
        if not start:
            start[:] = [time, time]
        start[1] = time
        return time - start[0]

    return seconds


def _stamp_parts(text: str) -> tuple[str, str] | None:
    """A date and a clock out of one text; None where it is something else."""
    plain = _ZONE.sub("", text)
    date, _, clock = plain.partition("T") if "T" in plain else plain.partition(" ")
    date, clock = date.strip(" ,"), clock.strip()
    return (date, clock) if _DATE.fullmatch(date) and _CLOCK.fullmatch(clock) else None


class _Stamps:
    """Seconds since the first stamp; the date may be missing, the zone must not change."""

    def __init__(self) -> None:
        self._days: dict[str, int] = {}
        self._start: float | None = None
        self._last = 0.0
        self._shift = 0.0
        self._order: str | None = None

    def of(self, cells: Sequence[str]) -> float:
        text = " ".join(cells)
        zone = _ZONE.search(text)
        found = _stamp_parts(text)
        date, clock = found or ("", text[: zone.start()] if zone else text)
        match = _CLOCK.fullmatch(clock.strip())
        if match is None:
            raise ValueError(text)
        hour, minute, second, half = match.groups()
        time = (int(hour) % 12 if half else int(hour)) * 3600.0 + 43200.0 * ((half or "").lower() == "p")
        time += int(minute) * 60.0 + float((second or "0").replace(",", "."))
        if zone and zone[1][0] in "+-":
            time -= (1 if zone[1][0] == "+" else -1) * (int(zone[1][1:3]) * 3600.0 + int(zone[1][-2:]) * 60.0)
        if date:
            if date not in self._days:
                self._days[date] = self._day(date)
            # from the first day, so that no digit of a second is lost
            time += (self._days[date] - next(iter(self._days.values()))) * _DAY
        elif self._start is not None and time + self._shift < self._last - 0.5 * _DAY:
            self._shift += _DAY  # past midnight
        time += self._shift
        self._start = time if self._start is None else self._start
        self._last = time
        return time - self._start

    def _day(self, text: str) -> int:
        """Number of a day; day before month with points, either with slashes where the numbers tell."""
        match = _DATE.fullmatch(text)
        if match is None:
            raise ValueError(text)
        one, mark, two, three = match[1], match[2], match[3], match[4]
        if len(one) == 4:
            return datetime(int(one), int(two), int(three)).toordinal()
        year = int(three) + (2000 if len(three) < 3 else 0)
        a, b = int(one), int(two)
        order = "day" if mark == "." or a > 12 else "month" if b > 12 else self._order or "either"
        if self._days and "either" in (order, self._order):
            raise ValueError("the day or the month may stand first: write 2026-05-01")
        self._order = order
        return datetime(year, *((b, a) if order == "day" else (a, b))).toordinal()

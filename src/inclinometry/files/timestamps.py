"""Date and time of a row as seconds: ISO stamps, a date and a time, or year, month, day, hour, minute, second apart."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import FileError, InputError, in_file, refused
from inclinometry.files._quantities import seconds_of
from inclinometry.findings import Finding

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

    >>> [part_of_time(name) for name in ("UTC_Year", "Hour (hh)", "Date/Time", "time_s", "inclination")]
    ['year', 'hour', 'whole', None, None]
    """
    plain = re.sub(r"[(\[].*?[)\]]|[\s_\-./]", "", name).lower()
    plain = plain.removeprefix("utc").removesuffix("utc") or plain
    return "whole" if plain in _WHOLE else next((part for part, names in _PARTS.items() if plain in names), None)


class Clock:
    """Seconds since the first row by the columns of date and time, where the first row shows that there are any.

    places : of these columns; none where there is no date and time, or a `time_s` besides.
    """

    def __init__(self, path: Path, names: Sequence[str], first: Sequence[str]) -> None:
        found = _found(names, first)
        self.places: list[int] = found[0] if found else []
        self._seconds = found[1] if found else None
        self._path, self._names = path, names

    def of(self, columns: Sequence[Sequence[str]], lines: Iterable[int]) -> Array:
        """Seconds by the cells of the columns of date and time.

        Raises
        ------
        FileError
            A cell that is no date or time where that of the first row is; a date whose day may be its month.
        """
        times: list[float] = []
        if self._seconds is None:
            return np.array(times)
        for cells, line in zip(zip(*columns, strict=True), lines, strict=True):
            texts = [cell.strip() for cell in cells]
            try:
                times.append(round(self._seconds(texts) * 1e6) / 1e6)
            except InputError as error:
                raise in_file(error, self._path, int(line)) from None
            except (ValueError, OverflowError):
                names = tuple(self._names[k].strip() for k in self.places)
                wrong = Finding("table-time", {"columns": names, "value": " ".join(texts)[:60]})
                raise FileError(wrong, path=self._path, line=int(line)) from None
        return np.array(times)


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
            raise refused("table-date", {"value": text})
        self._order = order
        return datetime(year, *((b, a) if order == "day" else (a, b))).toordinal()

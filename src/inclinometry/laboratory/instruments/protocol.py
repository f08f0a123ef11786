"""What an instrument says and how it is asked, as data: nothing in a protocol is ever run."""

from __future__ import annotations

import binascii
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, reduce
from operator import xor
from typing import Final

import numpy as np

from inclinometry.arrays import Array, finite, frozen
from inclinometry.calibration.readings import LARGEST
from inclinometry.constants import KINDS
from inclinometry.conventions import axes_matrix
from inclinometry.errors import not_among, out_of_range, refused, wrong_shape
from inclinometry.files.wits0 import BEGIN, END, WitsFrame, take_item
from inclinometry.findings import Finding, Value


@dataclass(frozen=True, eq=False)
class Sample:
    """One reading of all channels.

    time : s, of arrival, on the reader's clock (never goes back). instrument_time : s, on the instrument's own.
    channels : kind -> (m,) signals in the unit of the protocol, axes and signs mapped. temperature : degC.
    sequence : number the instrument gave it. faults : "range", "stuck", events that damage a sample which is
        otherwise delivered; empty for a good one.
    """

    time: float
    channels: Mapping[str, Array]
    temperature: float | None = None
    sequence: int | None = None
    instrument_time: float | None = None
    faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class InstrumentEvent:
    """Something that happened to the stream: time, s, on the clock of the reader; kind; what it was.

    Of the port: connected, disconnected, unreachable, silent. Of a line: garbage, partial (its beginning or end is
    missing), too-long, checksum. Of a sample: range (a value that the protocol does not allow), stuck (the same values
    again and again), gap (samples that we did not get), repeated. restart: the instrument counts from the beginning
    again. clock: its clock or ours went back. listener: a receiver of the samples failed.
    """

    time: float
    kind: str
    finding: Finding


@cache
def _anchor() -> float:
    return time.time() - time.monotonic()


def steady_clock() -> float:
    """Unix time, s, that never jumps: the date when it was first asked for plus the time since."""
    return _anchor() + time.monotonic()


# Checksums at the end of a line: an asterisk and hexadecimal digits, as NMEA 0183 writes them.

_SUMS: Final[Mapping[str, tuple[Callable[[bytes], int], int]]] = {
    "xor": (lambda data: reduce(xor, data, 0), 2),
    "sum": (lambda data: sum(data) % 256, 2),
    "crc16": (lambda data: binascii.crc_hqx(data, 0xFFFF), 4),
}
CHECKSUMS: Final = ("none", *_SUMS)
"""none; exclusive or; sum modulo 256; CRC-16 with polynomial 0x1021 that starts at 0xFFFF (CCITT-FALSE)."""


def checksum(kind: str, line: bytes) -> str:
    """The checksum of a line, without the asterisk; a leading $ is not counted, as in NMEA 0183."""
    if kind not in CHECKSUMS:
        raise not_among("checksum", kind, CHECKSUMS)
    if kind == "none":
        return ""
    work, digits = _SUMS[kind]
    return f"{work(line.removeprefix(b'$')):0{digits}X}"


def with_checksum(kind: str, line: str) -> str:
    """The line with its asterisk and checksum; as it is for "none".

    >>> with_checksum("xor", "1,2"), with_checksum("none", "1,2")
    ('1,2*2F', '1,2')
    """
    return line if kind == "none" else f"{line}*{checksum(kind, line.encode('ascii'))}"


def without_checksum(kind: str, line: str) -> str | None:
    """The line before its asterisk when the checksum is right; None when it is wrong or missing.

    >>> without_checksum("xor", "1,2*2F"), without_checksum("xor", "1,3*2F")
    ('1,2', None)
    """
    if kind == "none":
        return line
    body, star, given = line.rpartition("*")
    right = checksum(kind, body.encode("ascii", "replace"))
    return body if star and given.strip().upper() == right else None


@dataclass(frozen=True, eq=False)
class ChannelMap:
    """Fields of a line that are the sensors of one triad, in the order x, y, z unless `axes` says otherwise.

    axes : which sensor, with which sign, is the tool's x, y, z, for example ("+y", "-x", "+z").
    scale : factor on the numbers, one for all or one a field. low, high : in `unit`; outside damages the sample.
    """

    fields: Sequence[str]
    unit: str = "counts"
    axes: Sequence[str] = ()
    scale: float | Sequence[float] = 1.0
    low: float = -LARGEST
    high: float = LARGEST
    _order: Array = field(init=False, repr=False)
    _factor: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        most_channels = 64
        put, count = object.__setattr__, len(self.fields)
        put(self, "fields", tuple(self.fields))
        if not 1 <= count <= most_channels:
            raise out_of_range("fields", count, f"1 .. {most_channels}")
        if len(set(self.fields)) != count:
            raise refused("input-repeated", {"name": "fields", "value": repeated(self.fields)})
        if self.axes and (count != 3 or len(self.axes) != 3):
            raise wrong_shape("fields, axes", (count, len(self.axes)), "(3, 3)")
        found = finite(self.scale, "scale")
        if found.shape not in ((), (count,)):
            raise wrong_shape("scale", found.shape, f"({count},)")
        scale = np.broadcast_to(found, (count,))
        if (scale == 0.0).any():
            raise out_of_range("scale", 0.0, "!= 0")
        if not self.low < self.high:
            raise out_of_range("low", self.low, f"< {self.high:g}")
        matrix = axes_matrix((self.axes[0], self.axes[1], self.axes[2])) if self.axes else np.eye(count)
        order = np.abs(matrix).argmax(axis=1)
        put(self, "_order", order)
        put(self, "_factor", frozen(matrix.sum(axis=1) * scale[order]))

    def signals(self, numbers: Sequence[float]) -> Array:
        """Signals (m,) from the numbers of the fields, in their order."""
        values: Array = np.array(numbers)[self._order] * self._factor
        return values

    def numbers(self, signals: Array) -> Array:
        """The numbers a line must hold for these signals; the reverse of `signals`."""
        found = np.empty(len(self.fields))
        found[self._order] = signals / self._factor
        return found


@dataclass(frozen=True)
class TemperatureMap:
    """The field that is a temperature: degC = scale x number + offset, allowed from low to high."""

    field: str
    scale: float = 1.0
    offset: float = 0.0
    low: float = -100.0
    high: float = 400.0

    def __post_init__(self) -> None:
        if self.scale == 0.0:
            raise out_of_range("temperature.scale", 0.0, "!= 0")
        if not self.low < self.high:
            raise out_of_range("temperature.low_degC", self.low, f"< {self.high:g}")


LIMITS: Final[Mapping[str, tuple[float, float, type[int] | type[float]]]] = {
    "interval": (0.0, 3600.0, float),
    "answer": (0.01, 600.0, float),
    "silence": (0.1, 3600.0, float),
    "stuck_after": (0, 1e6, int),
    "longest": (8, 1e6, int),
    "modulus": (0, 1e12, int),
}
"""Lowest and highest value of the numbers of a protocol; those that are no whole numbers are times, s."""


@dataclass(frozen=True, eq=False)
class Protocol:
    """A protocol of lines: give `columns` or `pattern`, or neither for "wits0", frames of WITS level 0.

    In columns "" is a cell without meaning, a delimiter " " any white space. A pattern is a regular expression of the
    whole line whose named groups are the fields; with one, `template` is what the simulated instrument writes.
    """

    name: str
    channels: Mapping[str, ChannelMap]
    framing: str = "line"
    columns: Sequence[str] = ()
    delimiter: str = ","
    pattern: str = ""
    terminator: bytes = b"\r\n"
    query: bytes = b""  #: empty: the instrument sends by itself
    interval: float = 0.1  #: s between queries
    answer: float = 1.0  #: s an answer is waited for
    checksum: str = "none"
    temperature: TemperatureMap | None = None
    sequence: str = ""  #: field that numbers the samples
    modulus: int = 0  #: where the number starts again from 0; 0: never
    time: str = ""  #: field with the instrument's own clock, s
    silence: float = 3.0  #: s without a byte before it is reported
    stuck_after: int = 50  #: identical readings; 0: never
    longest: int = 1024  #: bytes of a line
    serial: Mapping[str, object] = field(default_factory=dict)
    template: str = ""
    description: str = ""
    source: str = ""
    expression: re.Pattern[str] | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "expression", self._compiled())
        if not self.channels:
            raise refused("input-empty", {"name": "channels"})
        if unknown := sorted(set(self.channels) - set(KINDS)):
            raise refused("input-unknown", {"names": tuple(unknown), "known": tuple(KINDS)})
        ordered = {kind: self.channels[kind] for kind in KINDS if kind in self.channels}
        object.__setattr__(self, "channels", ordered)
        for name, allowed in (("framing", ("line", "wits0")), ("checksum", CHECKSUMS)):
            if getattr(self, name) not in allowed:
                raise not_among(name, getattr(self, name), allowed)
        if not self.terminator:
            raise refused("input-empty", {"name": "terminator"})
        if self.framing == "wits0" and self.checksum != "none":
            raise refused("input-not-with", {"name": "checksum", "other": "wits0"})
        for name, (low, high, whole) in LIMITS.items():
            if not low <= getattr(self, name) <= high:
                shown_name = f"{name}_s" if whole is float else name
                raise out_of_range(shown_name, getattr(self, name), f"{low:g} .. {high:g}")
        self._check_fields()

    def _compiled(self) -> re.Pattern[str] | None:
        longest_pattern = 2000
        given = [bool(self.columns), bool(self.pattern), self.framing == "wits0"]
        if sum(given) != 1:
            raise refused("input-one-of", {"names": ("columns", "pattern", 'framing = "wits0"')})
        if self.columns and not self.delimiter:
            raise refused("input-empty", {"name": "delimiter"})
        if len(self.columns) > 1000:
            raise out_of_range("columns", len(self.columns), "1 .. 1000")
        if not self.pattern:
            return None
        if len(self.pattern) > longest_pattern:
            about: dict[str, Value] = {"name": "pattern", "count": len(self.pattern), "most": longest_pattern}
            raise refused("input-long", about)
        try:
            return re.compile(self.pattern, re.ASCII)
        except (re.error, RecursionError, OverflowError) as error:
            raise refused("capture-pattern", {"reason": str(error)}) from None

    def _check_fields(self) -> None:
        """Every field that is used is one a line has, and is used once."""
        used = self.used
        for name, values in (("field", used), ("columns", [name for name in self.columns if name])):
            if len(set(values)) != len(values):
                raise refused("input-repeated", {"name": name, "value": repeated(values)})
        known = set(self.columns) - {""} | set(self.expression.groupindex if self.expression else ())
        if self.framing == "wits0":
            unknown = next((name for name in used if not re.fullmatch(r"[0-9]{4}", name)), None)
            if unknown is not None:
                raise out_of_range("field", unknown, "0000 .. 9999")
        elif missing := tuple(name for name in used if name not in known):
            raise refused("input-unknown", {"names": missing, "known": tuple(sorted(known))})

    @property
    def used(self) -> list[str]:
        """All fields with a meaning."""
        found = [name for channel in self.channels.values() for name in channel.fields]
        found += [self.temperature.field] if self.temperature else []
        return found + [name for name in (self.sequence, self.time) if name]

    @property
    def units(self) -> dict[str, str]:
        """Kind -> unit of its signals."""
        return {kind: channel.unit for kind, channel in self.channels.items()}


# Bytes to lines, within bounds whatever comes.


class Lines:
    """Collects bytes and gives out whole lines."""

    def __init__(self, protocol: Protocol) -> None:
        # after \r\n a bare \n ends a line too: converters between the two are common
        self._end = b"\n" if protocol.terminator.endswith(b"\n") else protocol.terminator
        self._longest = protocol.longest
        self._buffer = b""
        self._skipping = False
        self.overrun = 0
        """How often bytes were thrown away because no line ended; the caller sets it back."""

    @property
    def rest(self) -> bytes:
        """The beginning of a line whose end has not come."""
        return self._buffer

    def clear(self) -> None:
        """Forget what has come; a new connection begins."""
        self._buffer, self._skipping = b"", False

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Whole lines, without their ends and the white space around them; empty lines are passed over."""
        pieces = (self._buffer + data).split(self._end)
        self._buffer = pieces.pop()
        for piece in pieces:
            if self._skipping:
                self._skipping = False
            elif len(piece) > self._longest:
                self.overrun += 1
            elif line := piece.strip():
                yield line
        if len(self._buffer) > self._longest:
            self.overrun += 0 if self._skipping else 1
            self._buffer, self._skipping = self._buffer[-len(self._end) :], True


# From a line, or a frame of WITS level 0, to the values of its fields as text.

Fields = Mapping[str, str]


class Refused(Exception):  # noqa: N818
    """A line that cannot be used: kind of event, and why."""

    def __init__(self, kind: str, finding: Finding) -> None:
        super().__init__(kind)
        self.kind, self.finding = kind, finding


def _unfit(kind: str, line: bytes, fault: str) -> Refused:
    return Refused(kind, Finding("capture-line", {"line": shown(line), "fault": fault}))


class FieldReader:
    """Fields of one line after the other; remembers an open frame."""

    def __init__(self, protocol: Protocol) -> None:
        self._protocol = protocol
        self._frame: WitsFrame | None = None

    def clear(self) -> None:
        """A new connection begins."""
        self._frame = None

    def take(self, line: bytes) -> Fields | None:
        """The fields of a line that completes a sample, None for one that does not.

        Raises Refused: with the kind of event and the reason.
        """
        try:
            text = line.decode("ascii")
        except UnicodeDecodeError:
            raise _unfit("garbage", line, "not ASCII") from None
        if self._protocol.framing == "wits0":
            return self._item(text)
        body = without_checksum(self._protocol.checksum, text)
        if body is None:
            raise _unfit("checksum", line, "wrong checksum")
        if self._protocol.expression is not None:
            match = self._protocol.expression.fullmatch(body.strip())
            if match is None:
                raise _unfit("garbage", line, "not the pattern")
            return {name: value or "" for name, value in match.groupdict().items()}
        cells = body.split(None if self._protocol.delimiter == " " else self._protocol.delimiter)
        columns = self._protocol.columns
        if len(cells) != len(columns):
            about: dict[str, Value] = {"line": shown(line), "cells": len(cells), "expected": len(columns)}
            raise Refused("garbage", Finding("capture-line-cells", about))
        return dict(zip(columns, cells, strict=True))

    def _item(self, text: str) -> Fields | None:
        frame = self._frame
        if text == BEGIN:
            self._frame = WitsFrame(0, {}, {})
            if frame is not None:
                raise _part_of_frame(END)
            return None
        if frame is None:
            if text == END:
                raise _part_of_frame(BEGIN)
            raise _unfit("garbage", text.encode(), "outside a frame")
        if text != END:
            if take_item(frame, 0, text) is not None:
                self._frame = None
                raise _unfit("garbage", text.encode(), "not an item")
            return None
        self._frame = None
        mine = [name for name in self._protocol.used if name in frame.items]
        if not mine:
            return None  # a frame of another record
        missing = next((name for name in self._protocol.used if name not in frame.items), None)
        if missing is not None:
            raise _part_of_frame(missing)
        return frame.items


def _part_of_frame(missing: str) -> Refused:
    return Refused("partial", Finding("capture-frame", {"missing": missing}))


def repeated(names: Sequence[str]) -> str:
    """The first name that occurs twice."""
    return next(name for name in names if list(names).count(name) > 1)


def shown(line: bytes) -> str:
    r"""The beginning of a line as it can be printed.

    >>> shown(b"\xff12")
    "'\\xff12'"
    """
    text = line[:40].decode("ascii", "backslashreplace").replace("'", "")
    printed = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    return f"'{printed}{'...' if len(line) > 40 else ''}'"


# The line an instrument would send for a sample: the reverse of reading one, for simulated instruments.


def encode(protocol: Protocol, sample: Sample) -> bytes:
    """A line, or a frame of WITS level 0, with its end."""
    values: dict[str, str] = {}
    for kind, channel in protocol.channels.items():
        signals = sample.channels.get(kind)
        if signals is None or len(signals) != len(channel.fields):
            have = () if signals is None else (len(signals),)
            raise wrong_shape(f"channels.{kind}", have, f"({len(channel.fields)},)")
        numbers = channel.numbers(signals)
        values.update((name, f"{x:.10g}") for name, x in zip(channel.fields, numbers.tolist(), strict=True))
    if protocol.temperature is not None:
        about, degrees = protocol.temperature, 20.0 if sample.temperature is None else sample.temperature
        values[about.field] = f"{(degrees - about.offset) / about.scale:.6g}"
    if protocol.sequence:
        number = sample.sequence or 0
        values[protocol.sequence] = str(number % protocol.modulus if protocol.modulus else number)
    if protocol.time:
        values[protocol.time] = f"{sample.instrument_time or 0.0:.3f}"
    end = protocol.terminator
    if protocol.framing == "wits0":
        items = [f"{item}{value}" for item, value in sorted(values.items())]
        return b"".join(text.encode("ascii") + end for text in (BEGIN, *items, END))
    if protocol.columns:
        line = protocol.delimiter.join(values.get(name, "0") for name in protocol.columns)
    elif protocol.template:
        line = re.sub(r"\{(\w+)\}", lambda found: values.get(found[1], "0"), protocol.template)
    else:
        raise refused("input-needs", {"name": "pattern", "needed": ("template",)})
    return with_checksum(protocol.checksum, line).encode("ascii") + end


# Bytes to samples and events; knows no port and no thread.


class Decoder:
    """Turns what comes through a port into samples, each delivered once, and says what was wrong with the rest.

    The first line of an instrument that sends by itself without checksum is left out: its beginning may be lost, and
    "23.5" for "123.5" looks like any number. A sample with the number of the one before is one sample. Neither counts
    as lost.
    """

    def __init__(
        self,
        protocol: Protocol,
        on_sample: Callable[[Sample], None],
        on_event: Callable[[InstrumentEvent], None],
        clock: Callable[[], float],
    ) -> None:
        self._protocol, self._on_sample, self._on_event, self._clock = protocol, on_sample, on_event, clock
        self._lines, self._fields = Lines(protocol), FieldReader(protocol)
        self._doubt_first = not protocol.query and protocol.checksum == "none" and protocol.framing == "line"
        self._first = self._doubt_first
        self._time = float("-inf")
        self._ahead = 0.0  # what is added to a clock that went back
        self._sequence: int | None = None
        self._instrument_time: float | None = None
        self._same: tuple[str, ...] = ()
        self._times_same = 0

    def connected(self) -> None:
        """A new connection begins: what is left of the last one is thrown away."""
        if self._lines.rest:
            self._part(self._lines.rest)
        self._lines.clear()
        self._fields.clear()
        self._first = self._doubt_first

    def feed(self, data: bytes) -> int:
        """Take bytes as they come; the number of samples they completed."""
        samples = 0
        for line in self._lines.feed(data):
            if self._first:
                self._first = False
                self._part(line)
                continue
            try:
                fields = self._fields.take(line)
                samples += fields is not None and self._sample(fields, line)
            except Refused as line_refused:
                self.event(line_refused.kind, line_refused.finding)
        if self._lines.overrun:
            self._lines.overrun = 0
            self._first = False
            self.event("too-long", Finding("capture-line-long", {"most": self._protocol.longest}))
        return samples

    def event(self, kind: str, finding: Finding) -> None:
        """Report an event now."""
        self._on_event(InstrumentEvent(self._now(), kind, finding))

    def _part(self, line: bytes) -> None:
        self.event(
            "partial", Finding("capture-line", {"line": shown(line), "fault": "a part of a line"}, severity="note")
        )

    def _within(self, name: str, values: Array, low: float, high: float, unit: str) -> bool:
        """Whether all values are allowed; the first that is not is reported."""
        outside = values[(values < low) | (values > high)]
        if len(outside):
            about: dict[str, Value] = {"name": name, "value": float(outside[0]), "unit": unit, "low": low, "high": high}
            self.event("range", Finding("capture-range", about))
        return not len(outside)

    def _now(self) -> float:
        self._time = max(self._time, self._clock() + self._ahead)
        return self._time

    def _sample(self, fields: Fields, line: bytes) -> bool:
        protocol, faults = self._protocol, []
        channels: dict[str, Array] = {}
        for kind, channel in protocol.channels.items():
            signals = channel.signals([_number(fields, name, line) for name in channel.fields])
            channels[kind] = signals
            if not self._within(kind, signals, channel.low, channel.high, channel.unit):
                faults.append("range")
        about, temperature = self._protocol.temperature, None
        if about is not None:
            temperature = about.scale * _number(fields, about.field, line) + about.offset
            if not self._within("temperature", np.array([temperature]), about.low, about.high, "degC"):
                faults.append("range")
        when = _number(fields, protocol.time, line) if protocol.time else None
        number = _whole(fields, protocol.sequence, line) if protocol.sequence else None
        now = self._clock() + self._ahead
        if now < self._time:
            back = self._time - now
            self._ahead += back
            self.event("clock", Finding("capture-clock-own", {"back_s": back}))
        now = self._now()
        if number is not None and not self._counted(number):
            return False
        before, self._instrument_time = self._instrument_time, when
        if when is not None and before is not None and when < before:
            self.event("clock", Finding("capture-clock", {"before_s": before, "time_s": when}))
        if self._is_stuck(fields):
            faults.append("stuck")
        self._on_sample(Sample(now, channels, temperature, number, when, tuple(dict.fromkeys(faults))))
        return True

    def _counted(self, number: int) -> bool:
        """Whether a sample with this number is new; gaps and restarts are reported."""
        last, self._sequence = self._sequence, number
        if last is None:
            return True
        step = number - last
        if self._protocol.modulus:
            step %= self._protocol.modulus
            if step > self._protocol.modulus // 2:
                step -= self._protocol.modulus
        if step == 0:
            self.event("repeated", Finding("capture-repeated", {"number": number}, severity="note"))
            return False
        if step > 1:
            self.event("gap", Finding("capture-gap", {"count": step - 1, "number": number}))
        if step < 0:
            self._instrument_time = None
            self.event("restart", Finding("capture-restart", {"number": number, "before": last}))
        return True

    def _is_stuck(self, fields: Fields) -> bool:
        limit = self._protocol.stuck_after
        if not limit:
            return False
        same = tuple(fields[name] for channel in self._protocol.channels.values() for name in channel.fields)
        self._times_same = self._times_same + 1 if same == self._same else 1
        self._same = same
        if self._times_same == limit:
            self.event("stuck", Finding("capture-stuck", {"count": int(limit)}))
        return self._times_same >= limit


def _bad_value(line: bytes, name: str, text: str, expected: str) -> Refused:
    about: dict[str, Value] = {"line": shown(line), "name": name, "value": f"{text[:20]!r}", "expected": expected}
    return Refused("garbage", Finding("capture-line-value", about))


def _number(fields: Fields, name: str, line: bytes) -> float:
    text = fields[name]
    if not re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?\s*", text, re.ASCII):
        raise _bad_value(line, name, text, "number")
    value = float(text)
    # what WITS level 0 writes for no value
    if not -LARGEST <= value <= LARGEST or (value in (-9999.0, -8888.0) and name.isdigit()):
        raise _bad_value(line, name, text, "measured value")
    return value


def _whole(fields: Fields, name: str, line: bytes) -> int:
    text = fields[name]
    if not re.fullmatch(r"\s*\d{1,18}(\.0*)?\s*", text, re.ASCII):
        raise _bad_value(line, name, text, "whole number")
    return int(float(text)) if "." in text else int(text)

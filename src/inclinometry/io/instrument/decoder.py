"""Bytes to samples and events; knows no port and no thread."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from inclinometry.core.arrays import Array
from inclinometry.io.instrument.fields import FieldReader, Fields, Refused, shown
from inclinometry.io.instrument.framing import Lines
from inclinometry.io.instrument.protocol import LARGEST, Protocol
from inclinometry.io.instrument.sample import InstrumentEvent, Sample

_NUMBER: Final = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?\s*", re.ASCII)
_WHOLE: Final = re.compile(r"\s*\d{1,18}(\.0*)?\s*", re.ASCII)
NOTHING: Final = (-9999.0, -8888.0)
"""What WITS level 0 writes for no value."""


class Decoder:
    """Turns what comes through a port into samples, each delivered once, and says what was wrong with the rest.

    Parameters
    ----------
    protocol : Protocol
    on_sample, on_event : callables
        Called in the order in which things came.
    clock : callable
        s; where it goes back, times go on from where they were.

    Notes
    -----
    The first line after connecting to an instrument that sends by itself is left out unless it has a checksum: it may
    have lost its beginning, and "23.5" for "123.5" looks like any number. A sample with the number of the one before
    is one sample. Neither is counted as lost.
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
            self.event("partial", f"the connection ended within a line: {shown(self._lines.rest)}")
        self._lines.clear()
        self._fields.clear()
        self._first = self._doubt_first

    def feed(self, data: bytes) -> int:
        """Take bytes as they come; the number of samples they completed."""
        samples = 0
        for line in self._lines.feed(data):
            if self._first:
                self._first = False
                self.event("partial", f"the first line after connecting is left out, it may be a part: {shown(line)}")
                continue
            try:
                fields = self._fields.take(line)
                samples += fields is not None and self._sample(fields, line)
            except Refused as refused:
                self.event(refused.kind, refused.why)
        if self._lines.overrun:
            self._lines.overrun = 0
            self._first = False
            self.event("too-long", f"more than {self._protocol.longest} bytes without the end of a line; thrown away")
        return samples

    def event(self, kind: str, sentence: str) -> None:
        """Report an event now."""
        self._on_event(InstrumentEvent(self._now(), kind, sentence))

    def _now(self) -> float:
        self._time = max(self._time, self._clock() + self._ahead)
        return self._time

    def _sample(self, fields: Fields, line: bytes) -> bool:
        protocol, faults = self._protocol, []
        channels: dict[str, Array] = {}
        for kind, channel in protocol.channels.items():
            signals = channel.signals([_number(fields, name, line) for name in channel.fields])
            channels[kind] = signals
            if not channel.low <= signals.min() <= signals.max() <= channel.high:
                faults.append("range")
                bounds = f"{channel.low:g} to {channel.high:g} {channel.unit}"
                self.event("range", f"{kind} reads {', '.join(f'{v:g}' for v in signals)}; allowed {bounds}")
        temperature = self._temperature(fields, line, faults)
        when = _number(fields, protocol.time, line) if protocol.time else None
        number = _whole(fields, protocol.sequence, line) if protocol.sequence else None
        now = self._read_clock()
        if number is not None and not self._counted(number):
            return False
        self._check_instrument_clock(when)
        if self._is_stuck(fields):
            faults.append("stuck")
        self._on_sample(Sample(now, channels, temperature, number, when, tuple(dict.fromkeys(faults))))
        return True

    def _read_clock(self) -> float:
        now = self._clock() + self._ahead
        if now < self._time:
            back = self._time - now
            self._ahead += back
            self.event("clock", f"our clock went back by {back:.3g} s; times go on from where they were")
        return self._now()

    def _temperature(self, fields: Fields, line: bytes, faults: list[str]) -> float | None:
        about = self._protocol.temperature
        if about is None:
            return None
        degrees = about.scale * _number(fields, about.field, line) + about.offset
        if not about.low <= degrees <= about.high:
            faults.append("range")
            self.event("range", f"temperature is {degrees:g} degC; allowed {about.low:g} to {about.high:g} degC")
        return degrees

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
            self.event("repeated", f"sample {number} came twice; the second one is left out")
            return False
        if step > 1:
            self.event("gap", f"{step - 1} samples are missing before number {number}")
        if step < 0:
            self._instrument_time = None
            self.event("restart", f"the instrument counts from {number} again, after {last}")
        return True

    def _check_instrument_clock(self, when: float | None) -> None:
        before, self._instrument_time = self._instrument_time, when
        if when is not None and before is not None and when < before:
            self.event("clock", f"the instrument's clock went back from {before:g} s to {when:g} s")

    def _is_stuck(self, fields: Fields) -> bool:
        limit = self._protocol.stuck_after
        if not limit:
            return False
        same = tuple(fields[name] for channel in self._protocol.channels.values() for name in channel.fields)
        self._times_same = self._times_same + 1 if same == self._same else 1
        self._same = same
        if self._times_same == limit:
            self.event("stuck", f"the same values came {limit} times in a row; is the converter alive?")
        return self._times_same >= limit


def _number(fields: Fields, name: str, line: bytes) -> float:
    text = fields[name]
    if not _NUMBER.fullmatch(text):
        raise Refused("garbage", f"{name} is {text[:20]!r}, not a number, in {shown(line)}")
    value = float(text)
    if not -LARGEST <= value <= LARGEST or (value in NOTHING and name.isdigit()):
        raise Refused("garbage", f"{name} is {text[:20]!r}, which stands for no value, in {shown(line)}")
    return value


def _whole(fields: Fields, name: str, line: bytes) -> int:
    text = fields[name]
    if not _WHOLE.fullmatch(text):
        raise Refused("garbage", f"{name} is {text[:20]!r}, not the number of a sample, in {shown(line)}")
    return int(float(text)) if "." in text else int(text)

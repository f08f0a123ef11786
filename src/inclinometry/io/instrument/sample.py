"""What comes out of an instrument: samples, and events that say in words what went wrong."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from inclinometry.core.arrays import Array

EVENTS: Final[Mapping[str, str]] = {
    "connected": "the port is open",
    "disconnected": "the port was lost",
    "unreachable": "the port could not be opened",
    "silent": "the port is open and nothing comes",
    "garbage": "a line that is not of this protocol",
    "partial": "a line whose beginning or end is missing",
    "too-long": "bytes without the end of a line",
    "checksum": "a line whose checksum is wrong",
    "range": "a value outside the range the protocol allows",
    "stuck": "the same values again and again",
    "gap": "samples the instrument sent and we did not get",
    "repeated": "a sample that was sent twice",
    "restart": "the instrument counts from the beginning again",
    "clock": "the instrument's clock or ours went back",
    "listener": "a receiver of the samples failed",
}
"""Kinds of event and what each is."""
FAULTS: Final = ("range", "stuck")
"""Events that spoil a sample which is otherwise delivered: they stand in `Sample.faults`."""


@dataclass(frozen=True, eq=False)
class Sample:
    """One reading of all channels.

    time : s, when it arrived, on the clock of the reader (never goes back).
    channels : kind -> (m,) signals in the unit the protocol states, axes and signs mapped.
    temperature : degC, where the instrument sends it.
    sequence : number the instrument gave it, where it does.
    instrument_time : s, on the instrument's own clock, where it sends it.
    faults : of `FAULTS`, what is wrong with it; empty for a good one.
    """

    time: float
    channels: Mapping[str, Array]
    temperature: float | None = None
    sequence: int | None = None
    instrument_time: float | None = None
    faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class InstrumentEvent:
    """Something that happened to the stream: time, s, on the clock of the reader; kind, of `EVENTS`; a sentence."""

    time: float
    kind: str
    sentence: str


_ANCHOR: Final = time.time() - time.monotonic()


def steady_clock() -> float:
    """Unix time, s, that never jumps: the date when this program started plus the time since."""
    return _ANCHOR + time.monotonic()

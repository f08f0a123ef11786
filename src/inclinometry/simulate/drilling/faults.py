"""Faults of a run, each a small record; any number of them can be given to a scenario."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

from inclinometry.core.errors import InputError
from inclinometry.simulate.drilling.checks import inside

CHANNEL_NAMES = tuple(f"{kind}_{axis}" for kind in ("accel", "mag", "gyro") for axis in "xyz")


@dataclass(frozen=True)
class MagLag:
    """The magnetometer is `delay` s behind the other triads, at most 50 ms."""

    delay: float

    def __post_init__(self) -> None:
        inside(self, -0.05, 0.05, delay="s")


@dataclass(frozen=True)
class Dropped:
    """Rows missing at random, `fraction` of them; the stamps of the others stay true."""

    fraction: float

    def __post_init__(self) -> None:
        inside(self, 0.0, 0.9, fraction="")


@dataclass(frozen=True)
class Repeated:
    """Rows written twice with the same stamp, at random, `fraction` of them."""

    fraction: float

    def __post_init__(self) -> None:
        inside(self, 0.0, 1.0, fraction="")


@dataclass(frozen=True)
class Jitter:
    """Stamps that scatter by `sd` s; the sampling itself is even."""

    sd: float

    def __post_init__(self) -> None:
        inside(self, 0.0, 10.0, sd="s")


@dataclass(frozen=True)
class Stuck:
    """One channel ("accel_x" to "gyro_z") that keeps its value from `start` to `stop`, s."""

    channel: str
    start: float = 0.0
    stop: float = math.inf

    def __post_init__(self) -> None:
        if self.channel not in CHANNEL_NAMES:
            raise InputError(f"channel is {self.channel!r}; allowed: {', '.join(CHANNEL_NAMES)}")
        _ordered(self.start, self.stop)


@dataclass(frozen=True)
class Casing:
    """Steel about the tool from `start` to `stop`, s: the field weakened to `left` of itself and `disturbance` (nT rms
    on each axis) added, which changes over `period` s as the tool passes along the string.
    """

    start: float = 0.0
    stop: float = math.inf
    left: float = 0.3
    disturbance: float = 20_000.0
    period: float = 20.0

    def __post_init__(self) -> None:
        inside(self, 0.0, 1.0, left="of the field")
        inside(self, 0.0, 1e6, disturbance="nT")
        inside(self, 0.01, 1e6, period="s")
        _ordered(self.start, self.stop)


Fault: TypeAlias = MagLag | Dropped | Repeated | Jitter | Stuck | Casing


def _ordered(start: float, stop: float) -> None:
    if not start < stop:
        raise InputError(f"a fault from {start} s to {stop} s lasts no time; start must come before stop")

"""The record of a simulated run: readings, and the truth beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from inclinometry.core.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class DrillingTruth:
    """What was true at each sample, (n,).

    azimuth (from magnetic north), inclination, toolface : rad.
    rate : rad/s, of the toolface without torsional vibration.
    clipped : an element was at the end of its range somewhere under the filter.
    """

    azimuth: Array
    inclination: Array
    toolface: Array
    rate: Array
    clipped: Mask


@dataclass(frozen=True, eq=False)
class DrillingSimulation:
    """A run, or a block of one, of n samples.

    time : (n,) s, stamps; interval : s, of the even grid.
    accel, mag, gyro : (n, 3) m/s^2 of apparent gravity (gravity minus acceleration), nT, rad/s, in tool axes.
    temperature : (n,) degC; depth : (n,) m.
    truth : DrillingTruth
    """

    time: Array
    interval: float
    accel: Array
    mag: Array
    gyro: Array
    temperature: Array
    depth: Array
    truth: DrillingTruth

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, which: Index | slice) -> DrillingSimulation:
        """The same of some rows."""
        cut = {f.name: getattr(self, f.name)[which] for f in fields(self) if f.name not in ("interval", "truth")}
        truth = DrillingTruth(**{f.name: getattr(self.truth, f.name)[which] for f in fields(DrillingTruth)})
        return replace(self, **cut, truth=truth)


def joined(parts: Sequence[DrillingSimulation]) -> DrillingSimulation:
    """Blocks of one run, put together again."""
    if len(parts) == 1:
        return parts[0]
    names = [f.name for f in fields(DrillingSimulation) if f.name not in ("interval", "truth")]
    whole: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    truth = {f.name: np.concatenate([getattr(p.truth, f.name) for p in parts]) for f in fields(DrillingTruth)}
    return replace(parts[0], **whole, truth=DrillingTruth(**truth))

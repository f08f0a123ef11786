"""Samples of a moving tool: field vectors in tool axes at equal intervals of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, Mask, finite
from inclinometry.core.errors import InputError

CHANNELS: Final = ("accel", "mag", "gyro")
MOST_JITTER: Final = 0.5
"""Departure of a stamp from the even grid, in intervals, that still counts as even: stamps are rounded and jitter."""


@dataclass(frozen=True, eq=False)
class Samples:
    """An evenly sampled stretch of a run: a block of a stream or a whole record.

    Parameters
    ----------
    time : (n,) array_like
        s, at equal intervals (`interval`) within the jitter of the stamps.
    interval : float
        s, of the even grid; the methods use it and the first stamp, not the differences of stamps.
    accel : (n, 3) array_like, optional
        Apparent gravity in tool axes, m/s^2: gravity minus acceleration, i.e. minus the specific force.
    mag : (n, 3) array_like, optional
        Magnetic flux density, nT.
    gyro : (n, 3) array_like, optional
        Rotation rate of the tool against inertial space, rad/s; about z positive is clockwise looking down hole.
    temperature : (n,) array_like, optional
        degC.
    clipped : (n,) array_like of bool, optional
        Samples of which a channel stood at the end of its range or was missing: never used, but they keep their place.

    Raises
    ------
    InputError
        Shapes that differ, values that are not finite, stamps off the even grid, no triad at all.

    Examples
    --------
    >>> block = Samples([0.0, 0.01, 0.02], 0.01, accel=[[0.0, 0.0, 9.81]] * 3)
    >>> len(block), block.has("mag")
    (3, False)
    """

    time: Array
    interval: float
    accel: Array | None = None
    mag: Array | None = None
    gyro: Array | None = None
    temperature: Array | None = None
    clipped: Mask | None = None

    def __post_init__(self) -> None:
        time = finite(self.time, "time", (None,))
        if not (self.interval > 0.0 and np.isfinite(self.interval)):
            raise InputError(f"the sampling interval is {self.interval} s; it must be positive")
        object.__setattr__(self, "time", time)
        if all(getattr(self, name) is None for name in CHANNELS):
            raise InputError(f"no triad is given; one or more of {', '.join(CHANNELS)} is needed")
        self._take("accel", (3,))
        self._take("mag", (3,))
        self._take("gyro", (3,))
        self._take("temperature", ())
        if self.clipped is not None:
            object.__setattr__(self, "clipped", np.asarray(self.clipped, dtype=np.bool_))
            if self.clipped.shape != time.shape:
                raise InputError(f"clipped has shape {self.clipped.shape}; expected {time.shape}")
        if time.size:
            # rounding of the stamps themselves: a long run counts seconds in large numbers
            slack = MOST_JITTER * self.interval + 4.0 * float(np.spacing(np.abs(time).max()))
            off = np.abs(time - (time[0] + self.interval * np.arange(time.size)))
            if off.max() > slack:
                worst = int(np.argmax(off > slack))
                raise InputError(
                    f"time[{worst}] is {time[worst]:.9g} s, {off[worst] / self.interval:.2f} intervals off the even "
                    f"grid of {self.interval:.6g} s (allowed {MOST_JITTER}); cut the run at its gaps first"
                )

    def _take(self, name: str, trailing: tuple[int, ...]) -> None:
        value: ArrayLike | None = getattr(self, name)
        if value is None:
            return
        array = np.ascontiguousarray(finite(value, name, trailing or None))
        if array.shape != (self.time.size, *trailing):
            raise InputError(f"{name} has shape {array.shape}; expected {(self.time.size, *trailing)}")
        object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.time)

    def has(self, name: str) -> bool:
        """Whether the triad is there: "accel", "mag" or "gyro"."""
        return getattr(self, name) is not None

    def part(self, start: int, stop: int) -> Samples:
        """Samples start to stop - 1, not copied.

        Examples
        --------
        >>> len(Samples([0.0, 0.5, 1.0], 0.5, gyro=[[0.0, 0.0, 1.0]] * 3).part(1, 3))
        2
        """
        # not checked again: a part of an even stretch is even, but its own first stamp may jitter the other way
        cut = object.__new__(Samples)
        object.__setattr__(cut, "interval", self.interval)
        for name in ("time", *CHANNELS, "temperature", "clipped"):
            value = getattr(self, name)
            object.__setattr__(cut, name, None if value is None else value[start:stop])
        return cut

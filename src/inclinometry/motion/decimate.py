"""Fewer samples without what would fold onto them: a low-pass before every n-th sample is taken."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.motion.magnetic.blocks import Held
from inclinometry.motion.samples import CHANNELS, Samples

ATTENUATION_DB: Final = 100.0
"""Of everything above half the new rate; 97 at its very edge."""
PASS: Final = 0.3
"""Of the new rate: up to here the gain is 1 within 1e-5."""
LARGEST: Final = 1000
"""Factor."""


def decimate(samples: Samples, factor: int) -> Samples:
    """Every `factor`-th sample of a run after a low-pass without delay.

    Parameters
    ----------
    samples : Samples
    factor : int
        1 to 1000.

    Returns
    -------
    Samples
        At `factor` times the interval. A sample's stamp is that of the middle of its filter: a live stream delivers 16
        new intervals late, but the stamps are not late. The first and last 16 new intervals of the run, where the
        filter is not full, are not returned. A sample is clipped when any under its filter was; temperature is taken,
        not filtered.

    Raises
    ------
    InputError
        A factor out of range, or one that leaves no interval.

    Notes
    -----
    Sinc under Kaiser's window (Oppenheim and Schafer, Discrete-Time Signal Processing, section 7.5.3), 32 taps per new
    sample, gain 1 at rest. Filtering before turning back mixes no rotation into another as long as it stays in the pass
    band: 0.3 x the new rate.

    Examples
    --------
    >>> time = np.arange(1000) / 1000.0
    >>> slow = decimate(Samples(time, 0.001, accel=np.tile([0.0, 0.0, 9.81], (1000, 1))), 10)
    >>> len(slow), round(float(slow.time[0]), 3), slow.accel[5].round(9)
    (68, 0.16, array([0.  , 0.  , 9.81]))
    """
    return DecimationStream(factor).push(samples)


class DecimationStream:
    """The same block by block; every sample is the same to the last bit however the run is cut.

    After a gap between blocks the filter begins anew.

    Examples
    --------
    >>> stream = DecimationStream(2)
    >>> block = Samples(np.arange(40) * 0.01, 0.01, gyro=np.ones((40, 3)))
    >>> len(stream.push(block)), stream.delay_intervals
    (0, 32)
    """

    def __init__(self, factor: int) -> None:
        if not (isinstance(factor, int | np.integer) and 1 <= factor <= LARGEST):
            raise InputError(f"the factor is {factor!r}; allowed: a whole number from 1 to {LARGEST}")
        self._factor = int(factor)
        self._taps = low_pass(self._factor)
        self._held = Held()

    @property
    def delay_intervals(self) -> int:
        """Samples that must follow before one is delivered."""
        return (self._taps.size - 1) // 2

    def push(self, samples: Samples) -> Samples:
        """Samples that became complete.

        Raises
        ------
        InputError
            Another interval or other triads than before, or a block that begins before the end of the last.
        """
        factor, size = self._factor, self._taps.size
        if not self._held.add(samples):
            self._held.clear()
            self._held.add(samples)
        count = len(self._held)
        if count < size:
            return _thinned(samples.part(0, 0), samples.time[:0], factor, self._taps)
        rows = (count - size) // factor + 1
        whole = (rows - 1) * factor + size
        thinned = _thinned(self._held.cut(0, whole), self._held.stamps(0, whole), factor, self._taps)
        self._held.drop(rows * factor)
        return thinned


@lru_cache(maxsize=32)
def low_pass(factor: int) -> Array:
    """Taps (32 factor + 1,), symmetric, sum 1; the single tap 1 for factor 1.

    Examples
    --------
    >>> taps = low_pass(4)
    >>> taps.size, round(float(taps.sum()), 12)
    (129, 1.0)
    """
    if factor == 1:
        return np.ones(1)
    half = 16 * factor
    place = np.arange(-half, half + 1)
    edge = (PASS + 0.5) / factor  # twice the middle of the transition, cycles per sample
    taps = np.sinc(edge * place) * np.kaiser(2 * half + 1, 0.1102 * (ATTENUATION_DB - 8.7))
    taps = taps / taps.sum()
    taps.flags.writeable = False
    return np.asarray(taps)


def _thinned(samples: Samples, stamps: Array, factor: int, taps: Array) -> Samples:
    """Samples of which every one has its whole filter; none when there is not one."""
    size = taps.size
    rows = (len(samples) - size) // factor + 1 if len(samples) >= size else 0
    middle = slice((size - 1) // 2, (size - 1) // 2 + rows * factor, factor)
    columns: dict[str, Any] = {}
    for name in CHANNELS:
        values = getattr(samples, name)
        if values is not None:
            columns[name] = _filtered(values, factor, taps, rows)
    if samples.temperature is not None:
        columns["temperature"] = samples.temperature[middle]
    if samples.clipped is not None:
        total = np.concatenate([[0], np.cumsum(samples.clipped)])
        first = np.arange(rows) * factor
        columns["clipped"] = total[first + size] > total[first] if rows else np.zeros(0, dtype=np.bool_)
    return Samples(stamps[middle] if rows else stamps[:0], samples.interval * factor, **columns)


def _filtered(values: Array, factor: int, taps: Array, rows: int) -> Array:
    """Rows (rows, 3). Tap after tap over all rows: each sums its products in the same order, wherever it is cut."""
    out = np.zeros((3, rows))
    if not rows:
        return np.ascontiguousarray(out.T)
    whole = -(-values.shape[0] // factor) * factor
    padded = np.zeros((whole, 3))
    padded[: values.shape[0]] = values
    phases = np.ascontiguousarray(padded.reshape(-1, factor, 3).transpose(1, 2, 0))
    part = np.empty_like(out)
    for k, tap in enumerate(taps):
        first = k // factor
        np.multiply(phases[k % factor, :, first : first + rows], tap, out=part)
        out += part
    return np.ascontiguousarray(out.T)


@dataclass(frozen=True)
class Thinning:
    """A factor with what it keeps.

    Attributes
    ----------
    factor : int
    rate_hz : float
        Of the samples kept.
    pass_hz : float
        Up to which nothing is lost.
    """

    factor: int
    rate_hz: float
    pass_hz: float


def thinning(interval: float, most_rpm: float) -> Thinning:
    """Largest factor that keeps the rotation and its lines well inside the pass band.

    Parameters
    ----------
    interval : float
        s, of the samples there are.
    most_rpm : float
        Fastest rotation expected, revolutions per minute.

    Notes
    -----
    The pass band is to reach 20 Hz above the rotation: what the vibration does below that comes down to the band of the
    fit only after it is turned back. At least 100 Hz are kept.

    Examples
    --------
    >>> thinning(0.0005, 600.0).factor
    20
    """
    if not (interval > 0.0 and most_rpm >= 0.0):
        raise InputError(f"interval {interval} s and {most_rpm} rpm: they must be positive and not negative")
    wanted = max((most_rpm / 60.0 + 20.0) / PASS, 100.0)
    factor = int(min(max(np.floor(1.0 / (interval * wanted) + 1e-9), 1), LARGEST))
    return Thinning(factor, 1.0 / (interval * factor), PASS / (interval * factor))

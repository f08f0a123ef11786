"""From what perfect sensors feel to what is written: clipping, low-pass, decimation, noise, steps."""

from __future__ import annotations

import numpy as np

from inclinometry.core.arrays import Array, Mask
from inclinometry.simulate.drilling._physics import Felt
from inclinometry.simulate.drilling.instrument import Instrument, TriadErrors
from inclinometry.simulate.drilling.scenario import Scenario
from inclinometry.simulate.streams import Streams


def low_pass(tool: Instrument) -> Array:
    """Taps of the Hamming-windowed sinc (as scipy.signal.firwin), gain 1 at 0 Hz."""
    if tool.taps == 1:
        return np.ones(1)
    place = np.arange(tool.taps) - (tool.taps - 1) / 2.0
    taps = np.sinc(2.0 * tool.cutoff / tool.rate * place) * np.hamming(tool.taps)
    return np.asarray(taps / taps.sum())


class Reading:
    """The instrument of one run; it keeps the random walks from chunk to chunk.

    `before` and `after` are the internal samples needed on either side of a chunk of `rows` rows.
    """

    def __init__(self, scenario: Scenario, streams: Streams, rows: int) -> None:
        self._tool, self._streams, self._rows = scenario.instrument, streams, rows
        self._taps = low_pass(self._tool)
        half = (self._tool.taps - 1) // 2
        # the first row's filter must end on a multiple of the factor for the decimator to meet it
        self.before = half + (-2 * half) % self._tool.factor
        self.after = half
        self.reach = max(self.before, self.after)
        self._walk = {name: np.zeros(3) for name in ("accel", "mag", "gyro")}

    def read(self, felt: Felt, index: int, warming: Array) -> tuple[Array, Array, Array, Mask]:
        """Rows (n, 3) of accelerometer, magnetometer and gyro, and where one of them clipped."""
        clipped = np.zeros(self._rows, dtype=np.bool_)
        tool = self._tool
        mag = felt.mag + np.asarray(tool.hard_iron)[:, None]
        accel = self._triad("accel", tool.accel, felt.accel, index, warming, clipped)
        magnetic = self._triad("mag", tool.mag, mag, index, warming, clipped)
        gyro = self._triad("gyro", tool.gyro, felt.gyro, index, warming, clipped)
        return accel, magnetic, gyro, clipped

    def _triad(self, name: str, errors: TriadErrors, felt: Array, index: int, warming: Array, clipped: Mask) -> Array:
        signal = (1.0 + np.asarray(errors.scale))[:, None] * felt + np.asarray(errors.bias)[:, None]
        if np.isfinite(errors.reach):
            clipped |= self._under_filter((np.abs(signal) >= errors.reach).any(axis=0))
            signal = np.clip(signal, -errors.reach, errors.reach)
        rows = self._decimated(signal)
        random = self._streams[f"{name} noise.{index}"]
        if errors.noise:
            rows += errors.noise * random.standard_normal(rows.shape)
        rows += warming[:, None] * np.asarray(errors.bias_per_kelvin)
        if errors.walk:
            steps = errors.walk * np.sqrt(self._tool.interval) * random.standard_normal(rows.shape)
            walk = self._walk[name] + np.cumsum(steps, axis=0)
            self._walk[name] = walk[-1]
            rows += walk
        if errors.step:
            rows = np.round(rows / errors.step) * errors.step
        return np.clip(rows, -errors.reach, errors.reach) if np.isfinite(errors.reach) else rows

    def _decimated(self, signal: Array) -> Array:
        """Filtered rows (n, 3), each at the middle of its taps."""
        if self._taps.size == 1:
            return np.ascontiguousarray(signal[:, :: self._tool.factor].T)
        from scipy.signal import upfirdn

        first = (self.before + self.after) // self._tool.factor
        filtered = upfirdn(self._taps, signal, up=1, down=self._tool.factor, axis=-1)
        return np.ascontiguousarray(filtered[:, first : first + self._rows].T)

    def _under_filter(self, bad: Mask) -> Mask:
        """Rows with a bad internal sample within the filter's taps."""
        total = np.concatenate([[0], np.cumsum(bad)])
        first = self.before - self.after + np.arange(self._rows) * self._tool.factor
        return np.asarray(total[first + self._tool.taps] > total[first])

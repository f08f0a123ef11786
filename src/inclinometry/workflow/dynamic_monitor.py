"""How a run shook and turned, window by window, beside its attitude; memory does not grow with the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array
from inclinometry.motion.run_result import Envelope, Excerpt, Spectrogram, Vibration
from inclinometry.motion.samples import CHANNELS, Samples
from inclinometry.motion.timing import rejoined
from inclinometry.workflow.dynamic_thin import Envelopes, Spectra

UNITS: Final = {"accel": "m/s^2", "mag": "nT", "gyro": "rad/s"}
SPEED_OVER: Final = 0.1
"""s over which rotation speed is averaged for its extremes."""
SEGMENT: Final = 256
"""Samples of a spectrum."""
SHOWN: Final = 2000
"""Samples of an excerpt at most."""
EXCERPT: Final = 5.0
"""s of an excerpt at most."""
_FIXED: Final = 0.99
"""Mean of the unit phasor of the toolface above which it hardly turns, and gravity is part of the plain mean."""

Phasor = NDArray[np.complex128]


class _Shaking(NamedTuple):
    """Of one window: rms of a transverse and the axial component, largest magnitude, m/s^2."""

    lateral: float
    axial: float
    peak: float


class Monitor:
    """Takes the even pieces of a run.

    Parameters
    ----------
    window : float
        s, of the vibration rows.
    """

    def __init__(self, window: float) -> None:
        self._window = window
        self._held: list[Samples] = []
        self._size = 0
        self._number = -1
        self._rows: list[tuple[float, ...]] = []
        self._names: tuple[str, ...] = ()
        self._envelopes: Envelopes | None = None
        self._spectra: Spectra | None = None
        self._interval = 0.0
        self._first: Excerpt | None = None
        self._worst: Excerpt | None = None
        self._most = -1.0
        self.clipped = 0
        self.heat: tuple[float, float] | None = None
        """Lowest and highest temperature, degC."""

    def push(self, number: int, samples: Samples) -> None:
        """A piece of stretch `number`."""
        if not len(samples):
            return
        if number != self._number:
            self._rest()
            self._number = number
        self._thin(samples)
        if samples.clipped is not None:
            self.clipped += int(samples.clipped.sum())
        if samples.temperature is not None:
            low, high = float(samples.temperature.min()), float(samples.temperature.max())
            self.heat = (low, high) if self.heat is None else (min(low, self.heat[0]), max(high, self.heat[1]))
        self._held.append(samples)
        self._size += len(samples)
        wanted = max(SEGMENT, round(self._window / samples.interval))
        if self._size < wanted:
            return
        whole = rejoined(self._held)
        start = 0
        while start + wanted <= len(whole):
            self._take(whole.part(start, start + wanted))
            start += wanted
        self._held, self._size = [whole.part(start, len(whole))], len(whole) - start

    def _rest(self) -> None:
        """What is left at the end of a stretch, if it is half a window or more."""
        if self._size and self._size >= 0.5 * self._window / self._held[0].interval:
            self._take(rejoined(self._held))
        self._held, self._size = [], 0

    def _thin(self, samples: Samples) -> None:
        if self._envelopes is None:
            self._names = tuple(name for name in CHANNELS if samples.has(name))
            names = [f"{name}_{axis}" for name in self._names for axis in "xyz"]
            units = [UNITS[name] for name in self._names for _ in "xyz"]
            self._envelopes = Envelopes(names, units, float(samples.time[0]), samples.interval)
            self._interval = samples.interval
        self._envelopes.push(samples.time, np.concatenate([getattr(samples, n) for n in self._names], axis=1))

    def _take(self, window: Samples) -> None:
        time = float(window.time[0] + window.time[-1]) / 2.0
        phasor = _phasor(window)
        shaking = _shaking(window, phasor)
        self._rows.append((time, *shaking, *_speeds(window, phasor)))
        if self._first is None:
            self._first = self._excerpt(window, "first seconds")
        if shaking.lateral > self._most:
            self._most, self._worst = shaking.lateral, self._excerpt(window, "strongest vibration")
        if window.accel is None or len(window) < SEGMENT or abs(window.interval / self._interval - 1.0) > 1e-3:
            return
        if self._spectra is None:
            width = len(window) * window.interval
            frequency = np.arange(SEGMENT // 2 + 1) / (SEGMENT * window.interval)
            self._spectra = Spectra("lateral acceleration", time - width / 2.0, width, frequency)
        self._spectra.push(time, _density(window))

    def _excerpt(self, window: Samples, what: str) -> Excerpt:
        part = window.part(0, min(len(window), SHOWN, max(2, round(EXCERPT / window.interval))))
        channels: dict[str, Array] = {}
        for name in self._names:
            channels |= {f"{name}_{axis}": getattr(part, name)[:, k].copy() for k, axis in enumerate("xyz")}
        units: Mapping[str, str] = {name: UNITS[name.split("_")[0]] for name in channels}
        return Excerpt(what, part.time.copy(), channels, units)

    def finish(self) -> tuple[Vibration, tuple[Envelope, ...], tuple[Excerpt, ...], Spectrogram | None]:
        """Everything, at the end of the run."""
        self._rest()
        columns = np.array(self._rows, dtype=np.float64).reshape(-1, 7).T
        excerpts = tuple(each for each in (self._first, self._worst) if each is not None)
        if len(excerpts) == 2 and excerpts[0].time[0] == excerpts[1].time[0]:
            excerpts = excerpts[:1]
        envelopes = () if self._envelopes is None else self._envelopes.done()
        return Vibration(*columns), envelopes, excerpts, None if self._spectra is None else self._spectra.done()


def _phasor(window: Samples) -> Phasor | None:
    """exp(-i toolface) of each sample but for a constant angle: by the transverse field, else by the gyro."""
    if window.mag is not None:
        field = window.mag[:, 0] + 1j * window.mag[:, 1]
        strength = np.abs(field)
        # a circle about its own middle, unless there is only an arc of it
        return np.asarray(np.where(strength > 0.0, field / np.where(strength > 0.0, strength, 1.0), 1.0))
    if window.gyro is not None:
        return np.asarray(np.exp(-1j * np.cumsum(window.gyro[:, 2]) * window.interval))
    return None


def _shaking(window: Samples, phasor: Phasor | None) -> _Shaking:
    """What is left of the accelerometers without their means and gravity as it turns.

    z = ax + i ay = c0 + c1 exp(-i T) + rest, both constants by least squares: c0 offsets and centripetal acceleration,
    c1 gravity across the hole.
    """
    if window.accel is None:
        return _Shaking(np.nan, np.nan, np.nan)
    good = slice(None) if window.clipped is None or window.clipped.all() else ~window.clipped
    across = (window.accel[:, 0] + 1j * window.accel[:, 1])[good]
    along = window.accel[good, 2] - window.accel[good, 2].mean()
    rest = across - across.mean()
    if phasor is not None:
        u = phasor[good] - phasor[good].mean()
        power = float(np.mean(np.abs(u) ** 2))
        if power > 1.0 - _FIXED**2:
            rest = rest - (np.mean(rest * np.conj(u)) / power) * u
    square = np.abs(rest) ** 2
    return _Shaking(
        float(np.sqrt(square.mean() / 2.0)), float(along.std()), float(np.sqrt((square + along**2).max(initial=0.0)))
    )


def _speeds(window: Samples, phasor: Phasor | None) -> tuple[float, float, float]:
    """Slowest, mean and fastest rotation speed over `SPEED_OVER`, rad/s."""
    if window.gyro is not None:
        rate = window.gyro[:, 2]
    elif phasor is not None and len(window) > 1:
        rate = -np.angle(phasor[1:] * np.conj(phasor[:-1])) / window.interval
    else:
        return np.nan, np.nan, np.nan
    over = max(1, min(len(rate), round(SPEED_OVER / window.interval)))
    means = rate[: len(rate) // over * over].reshape(-1, over).mean(axis=1)
    return float(means.min()), float(rate.mean()), float(means.max())


def _density(window: Samples) -> Array:
    """One-sided spectral density of x and y together (f,), m^2/s^4/Hz: the sum does not depend on the toolface."""
    if window.accel is None:
        return np.empty(0)
    count = len(window) // SEGMENT
    across = window.accel[: count * SEGMENT, :2].reshape(count, SEGMENT, 2)
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(SEGMENT) + 0.5) / SEGMENT)
    lines = np.fft.rfft((across - across.mean(axis=1, keepdims=True)) * hann[:, None], axis=1)
    power = np.mean(np.abs(lines) ** 2, axis=0).sum(axis=1) * window.interval / np.sum(hann**2)
    power[1:-1] *= 2.0
    return np.asarray(power)

"""How a run shook and turned, window by window, beside its attitude: in memory that does not grow with the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array
from inclinometry.constants import FIELD_UNITS, KINDS
from inclinometry.motion.result import CHANNELS, Envelope, Excerpt, Samples, Spectrogram, Vibration
from inclinometry.motion.timing import rejoined

_UNITS: Final = dict(zip(CHANNELS, (FIELD_UNITS[kind] for kind in KINDS), strict=True))
MOST_BINS: Final = 1500
"""Stretches of an envelope; never more than twice as many are held."""
MOST_COLUMNS: Final = 400
"""Columns of a spectrogram, likewise."""
SEGMENT: Final = 256
"""Samples of a spectrum."""
Phasor = NDArray[np.complex128]


class Envelopes:
    """Lowest, mean and highest value of c channels in bins of time."""

    def __init__(self, names: Sequence[str], units: Sequence[str], start: float, width: float) -> None:
        self._names, self._units = list(names), list(units)
        self._start, self._width = start, width
        shape = (2 * MOST_BINS, len(self._names))
        self._low, self._high = np.full(shape, np.inf), np.full(shape, -np.inf)
        self._sum, self._count = np.zeros(shape), np.zeros(2 * MOST_BINS)

    def push(self, time: Array, values: Array) -> None:
        """Take samples (n,) and their channels (n, c), in order of time."""
        if not len(time):
            return
        while time[-1] - self._start >= self._width * 2 * MOST_BINS:
            for held, empty, join in ((self._low, np.inf, np.minimum), (self._high, -np.inf, np.maximum)):
                held[:MOST_BINS] = join(held[::2], held[1::2])
                held[MOST_BINS:] = empty
            _halved(self._sum, MOST_BINS)
            _halved(self._count, MOST_BINS)
            self._width *= 2.0
        place = ((time - self._start) / self._width).astype(np.intp)
        first = np.flatnonzero(np.diff(place, prepend=-1))
        bins = place[first]
        self._low[bins] = np.minimum(self._low[bins], np.minimum.reduceat(values, first))
        self._high[bins] = np.maximum(self._high[bins], np.maximum.reduceat(values, first))
        self._sum[bins] += np.add.reduceat(values, first)
        self._count[bins] += np.diff(first, append=len(time))

    def done(self) -> tuple[Envelope, ...]:
        """What has been seen; bins without a sample are left out."""
        seen = np.flatnonzero(self._count)
        time = np.asarray(self._start + self._width * (seen + 0.5), dtype=np.float64)
        mean = self._sum[seen] / self._count[seen][:, None]
        return tuple(
            Envelope(name, unit, time, self._low[seen, k], mean[:, k], self._high[seen, k])
            for k, (name, unit) in enumerate(zip(self._names, self._units, strict=True))
        )


class Spectra:
    """Mean power spectra of equal stretches of time."""

    def __init__(self, what: str, start: float, width: float, frequency: Array) -> None:
        self._what, self._start, self._width, self._frequency = what, start, width, frequency
        self._sum, self._count = np.zeros((2 * MOST_COLUMNS, len(frequency))), np.zeros(2 * MOST_COLUMNS)

    def push(self, time: float, density: Array) -> None:
        """Take the spectrum (f,) of a window with this middle."""
        while time - self._start >= self._width * 2 * MOST_COLUMNS:
            _halved(self._sum, MOST_COLUMNS)
            _halved(self._count, MOST_COLUMNS)
            self._width *= 2.0
        place = int((time - self._start) / self._width)
        self._sum[place] += density
        self._count[place] += 1.0

    def done(self) -> Spectrogram:
        """What has been seen; NaN where no window was."""
        size = int(np.flatnonzero(self._count)[-1]) + 1 if self._count.any() else 0
        with np.errstate(invalid="ignore"):
            density = self._sum[:size] / self._count[:size, None]
        edges = np.asarray(self._start + self._width * np.arange(size + 1), dtype=np.float64)
        return Spectrogram(self._what, edges, self._frequency, density)


def _halved(held: Array, half: int) -> None:
    """Add up neighbours: the first half then covers what the whole did."""
    held[:half] = held[::2] + held[1::2]
    held[half:] = 0.0


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
        if self._envelopes is None:
            self._names = tuple(name for name in CHANNELS if samples.has(name))
            names = [f"{name}_{axis}" for name in self._names for axis in "xyz"]
            units = [_UNITS[name] for name in self._names for _ in "xyz"]
            self._envelopes = Envelopes(names, units, float(samples.time[0]), samples.interval)
            self._interval = samples.interval
        self._envelopes.push(samples.time, np.concatenate([getattr(samples, n) for n in self._names], axis=1))
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

    def _take(self, window: Samples) -> None:
        time = float(window.time[0] + window.time[-1]) / 2.0
        # exp(-i toolface) of each sample but for a constant angle: by the transverse field, else by the gyro
        if window.mag is not None:
            field = window.mag[:, 0] + 1j * window.mag[:, 1]
            strength = np.abs(field)
            # a circle about its own middle, unless there is only an arc of it
            phasor = np.asarray(np.where(strength > 0.0, field / np.where(strength > 0.0, strength, 1.0), 1.0))
        elif window.gyro is not None:
            phasor = np.asarray(np.exp(-1j * np.cumsum(window.gyro[:, 2]) * window.interval))
        else:
            phasor = None
        shaking = _shaking(window, phasor)
        self._rows.append((time, *shaking, *_speeds(window, phasor)))
        lateral = shaking[0]
        if self._first is None:
            self._first = self._excerpt(window, "first seconds")
        if lateral > self._most:
            self._most, self._worst = lateral, self._excerpt(window, "strongest vibration")
        if window.accel is None or len(window) < SEGMENT or abs(window.interval / self._interval - 1.0) > 1e-3:
            return
        if self._spectra is None:
            width = len(window) * window.interval
            frequency = np.arange(SEGMENT // 2 + 1) / (SEGMENT * window.interval)
            self._spectra = Spectra("lateral acceleration", time - width / 2.0, width, frequency)
        self._spectra.push(time, _density(window))

    def _excerpt(self, window: Samples, what: str) -> Excerpt:
        shown = 2000  # samples of an excerpt at most
        excerpt = 5.0  # s of an excerpt at most
        part = window.part(0, min(len(window), shown, max(2, round(excerpt / window.interval))))
        channels: dict[str, Array] = {}
        for name in self._names:
            channels |= {f"{name}_{axis}": getattr(part, name)[:, k].copy() for k, axis in enumerate("xyz")}
        units: Mapping[str, str] = {name: _UNITS[name.split("_")[0]] for name in channels}
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


def _shaking(window: Samples, phasor: Phasor | None) -> tuple[float, float, float]:
    """Of a window, rms of a transverse and the axial component and largest magnitude, m/s^2.

    What is left of the accelerometers without their means and gravity as it turns.

    z = ax + i ay = c0 + c1 exp(-i T) + rest, both constants by least squares: c0 offsets and centripetal acceleration,
    c1 gravity across the hole.
    """
    if window.accel is None:
        return np.nan, np.nan, np.nan
    good = slice(None) if window.clipped is None or window.clipped.all() else ~window.clipped
    across = (window.accel[:, 0] + 1j * window.accel[:, 1])[good]
    along = window.accel[good, 2] - window.accel[good, 2].mean()
    rest = across - across.mean()
    if phasor is not None:
        u = phasor[good] - phasor[good].mean()
        power = float(np.mean(np.abs(u) ** 2))
        # mean of the unit phasor of the toolface above which it hardly turns, and gravity is part of the plain mean
        fixed = 0.99
        if power > 1.0 - fixed**2:
            rest = rest - (np.mean(rest * np.conj(u)) / power) * u
    square = np.abs(rest) ** 2
    peak = float(np.sqrt((square + along**2).max(initial=0.0)))
    return float(np.sqrt(square.mean() / 2.0)), float(along.std()), peak


def _speeds(window: Samples, phasor: Phasor | None) -> tuple[float, float, float]:
    """Slowest, mean and fastest rotation speed over 0.1 s, rad/s."""
    if window.gyro is not None:
        rate = window.gyro[:, 2]
    elif phasor is not None and len(window) > 1:
        rate = -np.angle(phasor[1:] * np.conj(phasor[:-1])) / window.interval
    else:
        return np.nan, np.nan, np.nan
    over = max(1, min(len(rate), round(0.1 / window.interval)))
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

"""Random numbers by chunk of the run, and Gaussian noise limited to a band, with its exact derivatives.

Every draw belongs to a chunk of fixed length, so no result depends on how a run is cut or how long it is.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array
from inclinometry.simulate.drilling.scenario import Band
from inclinometry.simulate.streams import Streams

EDGE: Final = 0.1
"""Softness of a band's edges: standard deviation of the Gaussian edge over the band's lower end."""

SOFTEST: Final = 0.01
"""The same over the rate of the grid, at most."""

KERNEL: Final = 6.0
"""Half length of the kernel in standard deviations of its Gaussian window: cut off at 1.5e-8."""


FORGOTTEN: Final = 1e-10
"""Where the impulse response of a filter with skirts is cut off."""


class Chunked:
    """White Gaussian noise by sample number, negative numbers too, drawn chunk by chunk."""

    def __init__(self, streams: Streams, chunk: int) -> None:
        self.streams, self.chunk = streams, chunk
        self._kept: dict[tuple[str, int], Array] = {}

    def white(self, name: str, start: int, stop: int) -> Array:
        """Unit normal numbers of samples start to stop - 1."""
        first, last = start // self.chunk, (stop - 1) // self.chunk
        for key in [key for key in self._kept if key[0] == name and not first <= key[1] <= last]:
            del self._kept[key]
        parts = [self._draw(name, index) for index in range(first, last + 1)]
        offset = first * self.chunk
        return np.concatenate(parts)[start - offset : stop - offset]

    def _draw(self, name: str, index: int) -> Array:
        key = (name, index)
        if key not in self._kept:
            self._kept[key] = self.streams[f"{name}.{index}"].standard_normal(self.chunk)
        return self._kept[key]


class BandNoise:
    """Samples of one continuous band-limited Gaussian process, and of its first two derivatives where edges are sharp.

    With skirts, white numbers on the internal grid go through the impulse response of a Butterworth filter. With sharp
    edges they go through a kernel that is a smooth function of time: the difference of two sinc functions under a
    Gaussian window, so the edges of the spectrum are error functions and at half the lower end it is down by 130 dB.
    Derivatives are those of the kernel, hence exact, and any shift of time is allowed.
    """

    def __init__(self, band: Band, rate: float, name: str, noise: Chunked, reach: int) -> None:
        from scipy.fft import next_fast_len

        self._name, self._noise = name, noise
        # a soft upper edge must end before half the rate of the grid
        self._band, self._rate, self._width = band, rate, min(EDGE * band.low, SOFTEST * rate)
        self._gain = 1.0
        self._skirted = _butterworth(band, rate) if band.order else None
        if self._skirted is None:
            self._half = int(np.ceil(KERNEL * rate / (2.0 * np.pi * self._width)))
        else:
            self._half = self._skirted.size // 2
        self._gain = band.rms / float(np.sqrt(np.sum(self._kernel(0, 0.0) ** 2)))
        self._size = int(next_fast_len(noise.chunk + 2 * reach + 2 * self._half + 2, real=True))
        self._spectra: dict[tuple[int, float], NDArray[np.complex128]] = {}

    def at(self, start: int, stop: int, orders: tuple[int, ...] = (0,), shift: float = 0.0) -> list[Array]:
        """Derivatives of the given orders at samples start to stop - 1, `shift` s later."""
        half = self._half
        transform = np.fft.rfft(self._noise.white(self._name, start - half, stop + half), self._size)
        return [self._filtered(transform, order, shift)[2 * half : 2 * half + stop - start] for order in orders]

    def _filtered(self, transform: NDArray[np.complex128], order: int, shift: float) -> Array:
        key = (order, shift)
        if key not in self._spectra:
            self._spectra[key] = np.fft.rfft(self._kernel(order, shift), self._size)
        return np.fft.irfft(transform * self._spectra[key], self._size)

    def _kernel(self, order: int, shift: float) -> Array:
        """The kernel's derivative at the grid, `shift` s later."""
        if self._skirted is not None:
            return self._gain * self._skirted
        t = np.arange(-self._half, self._half + 1) / self._rate + shift
        high, low = (_sinc(2.0 * np.pi * f, t) for f in (self._band.high, self._band.low))
        s = [a - b for a, b in zip(high, low, strict=True)]
        c = (2.0 * np.pi * self._width) ** 2
        g0 = np.exp(-0.5 * c * t**2)
        g1, g2 = -c * t * g0, (c * c * t**2 - c) * g0
        return self._gain * (g0 * s[0], g1 * s[0] + g0 * s[1], g2 * s[0] + 2.0 * g1 * s[1] + g0 * s[2])[order]


def _butterworth(band: Band, rate: float) -> Array:
    """Impulse response, an odd number of taps, until it has decayed to FORGOTTEN."""
    from scipy.signal import butter, sos2zpk, sosfilt

    sections = butter(band.order, [band.low, band.high], btype="bandpass", fs=rate, output="sos")
    slowest = float(np.abs(sos2zpk(sections)[1]).max())
    half = int(np.ceil(0.5 * np.log(FORGOTTEN) / np.log(slowest)))
    return np.asarray(sosfilt(sections, np.eye(1, 2 * half + 1)[0]))


def _sinc(w: float, t: Array) -> tuple[Array, Array, Array]:
    """sin(w t) / t and its first two derivatives."""
    x = w * t
    small = np.abs(x) < 1e-2
    safe = np.where(small, 1.0, t)
    sine, cosine = np.sin(w * safe), np.cos(w * safe)
    zero = sine / safe
    one = (w * cosine - zero) / safe
    two = (-w * w * sine - 2.0 * one) / safe
    # the closed forms divide small differences by small times; both leave 1e-9 or less at the joint
    y = x * x
    near = (
        w * (1.0 - y / 6.0 + y * y / 120.0),
        w * w * x * (-1.0 / 3.0 + y / 30.0 - y * y / 840.0),
        w**3 * (-1.0 / 3.0 + y / 10.0 - y * y / 168.0),
    )
    return tuple(np.where(small, a, b) for a, b in zip(near, (zero, one, two), strict=True))  # type: ignore[return-value]

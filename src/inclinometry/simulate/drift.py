"""Noise colours of a gyro: angle random walk, bias instability, and what warms up."""

from __future__ import annotations

import numpy as np

from inclinometry.core.arrays import Array


def white_rate(generator: np.random.Generator, shape: tuple[int, ...], arw: float, interval: float) -> Array:
    """White rate noise averaged over `interval` s, rad/s; `arw` is the angle random walk, rad/sqrt(s).

    Examples
    --------
    0.005 deg/sqrt(h) over one second is 0.3 deg/h:

    >>> noise = white_rate(np.random.default_rng(1), (100000,), np.radians(0.005) / 60.0, 1.0)
    >>> float(np.degrees(noise.std() * 3600.0).round(2))
    0.3
    """
    return np.asarray(generator.standard_normal(shape) * (arw / np.sqrt(interval)))


def flicker_rate(generator: np.random.Generator, shape: tuple[int, ...], instability: float) -> Array:
    """Flicker (1/f) noise along the last axis, in the unit of `instability`.

    Parameters
    ----------
    generator : Generator
    shape : tuple of int
    instability : float
        Bias instability B of the density B^2/(2 pi f), whose Allan deviation is flat at sqrt(2 ln 2/pi) B = 0.664 B.

    Notes
    -----
    White noise through the fractional filter (1 - z^-1)^-1/2, with as much history before the first sample as there are
    samples: slower changes than that are bias. Kasdin N.J., "Discrete simulation of colored noise", Proc. IEEE 83,
    1995, equation (116); IEEE Std 952-1997, annex C.

    Examples
    --------
    >>> flicker_rate(np.random.default_rng(1), (2, 60), 1.0).shape
    (2, 60)
    """
    length = shape[-1]
    size = 2 * length
    k = np.arange(1.0, size)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    padded = 1 << (2 * size - 1).bit_length()
    white = generator.standard_normal((*shape[:-1], size))
    shaped = np.fft.irfft(np.fft.rfft(white, padded) * np.fft.rfft(response, padded), padded)
    return np.asarray(instability * shaped[..., length:size])

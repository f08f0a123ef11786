"""Angles: wrapping and circular means; radians inside, degrees only where a name says so."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite

TAU = 2.0 * np.pi


def wrap_positive(angle: ArrayLike) -> Array:
    """Wrap to [0, 2 pi), as azimuth and toolface are printed.

    Examples
    --------
    >>> float(np.degrees(wrap_positive(np.radians(-90.0))))
    270.0
    """
    wrapped = np.mod(np.asarray(angle, dtype=np.float64), TAU)
    # a tiny negative angle rounds up to 2 pi itself, which is outside the half-open range
    return np.where(wrapped >= TAU, 0.0, wrapped)


def wrap_signed(angle: ArrayLike) -> Array:
    """Wrap to [-pi, pi), as differences of angles are.

    Examples
    --------
    >>> float(np.degrees(wrap_signed(np.radians(350.0))).round(9))
    -10.0
    """
    return np.asarray(wrap_positive(np.asarray(angle, dtype=np.float64) + np.pi) - np.pi)


def circular_mean(angle: ArrayLike, axis: int | None = None) -> Array:
    """Direction of the mean unit phasor, in [0, 2 pi).

    Examples
    --------
    >>> float(np.degrees(circular_mean(np.radians([350.0, 20.0]))).round(9))
    5.0
    """
    values = finite(angle, "angle")
    return wrap_positive(np.arctan2(np.sin(values).mean(axis=axis), np.cos(values).mean(axis=axis)))

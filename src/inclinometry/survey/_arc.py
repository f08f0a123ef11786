"""Weights of the interpolation on an arc and their derivatives by the dogleg, without cancellation at either end.

All four weights are even functions of the dogleg beta. Instead of their derivative, which needs a direction of change
that a straight interval does not have, they carry the derivative divided by beta: it has a limit at beta = 0, and what
it is multiplied with, beta dbeta, is linear in the changes of the two directions.
"""

from __future__ import annotations

from math import factorial
from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array

SERIES: Final = 0.5
"""Angle, rad, below which a difference is taken from its series."""
# (cos x - sin(x)/x) / x^2 by powers of x^2; the first term left out is 3e-18
TERMS: Final = tuple((-1.0) ** k * 2 * k / factorial(2 * k + 1) for k in range(1, 8))


class Even(NamedTuple):
    """An even function of the dogleg: value, and derivative divided by the dogleg."""

    value: Array
    slope: Array


class Weights(NamedTuple):
    """Direction t = t_p p + t_q q and displacement r = s (r_p p + r_q q), with p = t1 + t2 and q = t2 - t1."""

    t_p: Even
    t_q: Even
    r_p: Even
    r_q: Even


def weights(f: Array, dogleg: Array, *, slopes: bool = True) -> Weights:
    """Weights at the fractions f (m,) of intervals with doglegs (m,), rad; f beyond 1 continues the circle.

    Without `slopes` the slopes are zeros: two thirds of the work saved where only points are wanted.
    """
    phi, half, rest = f - 0.5, np.full_like(f, 0.5), 0.5 * (1.0 - f)
    cos_half, sinc_half = cosine(half, dogleg, slopes), sinc(half, dogleg, slopes)
    walked = sinc(0.5 * f, dogleg, slopes)
    return Weights(
        _scaled(0.5, _quotient(cosine(phi, dogleg, slopes), cos_half)),
        _scaled(phi, _quotient(sinc(phi, dogleg, slopes), sinc_half)),
        _scaled(0.5 * f, _quotient(_product(walked, cosine(rest, dogleg, slopes)), cos_half)),
        _scaled(-f * rest, _quotient(_product(walked, sinc(rest, dogleg, slopes)), sinc_half)),
    )


def cosine(c: Array, dogleg: Array, slopes: bool = True) -> Even:
    """cos(c beta)."""
    x = c * dogleg
    return Even(np.cos(x), -c * c * _sinc(x) if slopes else np.zeros_like(x))


def sinc(c: Array, dogleg: Array, slopes: bool = True) -> Even:
    """sin(c beta) / (c beta)."""
    x = c * dogleg
    return Even(_sinc(x), c * c * bend(x) if slopes else np.zeros_like(x))


def bend(x: Array) -> Array:
    """Derivative of sin(x)/x divided by x: (cos x - sin(x)/x) / x^2, -1/3 at 0."""
    small = np.abs(x) < SERIES
    safe = np.where(small, 1.0, x)
    return np.where(small, np.polynomial.polynomial.polyval(x * x, TERMS), (np.cos(safe) - _sinc(safe)) / safe**2)


def _sinc(x: Array) -> Array:
    return np.asarray(np.sinc(x / np.pi))


def _scaled(factor: float | Array, u: Even) -> Even:
    return Even(factor * u.value, factor * u.slope)


def _product(u: Even, v: Even) -> Even:
    return Even(u.value * v.value, u.value * v.slope + u.slope * v.value)


def _quotient(u: Even, v: Even) -> Even:
    ratio = u.value / v.value
    return Even(ratio, (u.slope - ratio * v.slope) / v.value)

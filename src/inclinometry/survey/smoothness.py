"""How smooth a hole is: the residual of each station from the arc through its neighbours.

    rho = angle(t, (b t_before + a t_after) / (a + b))

with t the direction of the hole, a and b the courses before and after a station.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array


class Smoothness(NamedTuple):
    """Residuals (n,) of each station from the arc of its neighbours, rad, NaN at both ends, and their scale (n,)."""

    residual: Array
    scale: Array

    def log_likelihood(self, scale: Array | None = None, rows: Array | None = None) -> float:
        """Of Student's t with 3 degrees of freedom, up to a constant."""
        used = slice(None) if rows is None else rows
        spread = (self.scale if scale is None else scale)[used]
        ratio = self.residual[used] / spread
        return float(-2.0 * np.nansum(np.log1p(ratio**2 / 3.0)) - np.nansum(np.log(spread)))


FINEST: Final = np.radians(0.1)
"""Residual below which none is remarkable."""
JUMP: Final = np.radians(10.0)
"""Residual from which a station of a hole is broken: 20 deg of dogleg and back, in one course."""


def smoothness(md: Array, t: Array) -> Smoothness:
    """Of directions (n, 3) at measured depths (n,), m.

    Examples
    --------
    >>> md, bend = np.arange(5.0), np.radians(np.arange(5.0))
    >>> t = np.stack([np.sin(bend), 0.0 * md, np.cos(bend)], axis=1)
    >>> bool(np.nanmax(smoothness(md, t).residual) < 1e-9)
    True
    """
    residual, length = np.full(len(md), np.nan), np.full(len(md), np.nan)
    if len(md) >= 3:
        before, after = np.diff(md)[:-1], np.diff(md)[1:]
        between = after[:, None] * t[:-2] + before[:, None] * t[2:]
        residual[1:-1] = angle_between(t[1:-1], between)
        length[1:-1] = 2.0 * before * after / (before + after)
    known = np.isfinite(residual)
    scale = np.full(len(md), FINEST)
    if known.any():
        # noise of a station, and a change of curvature that grows with the course
        noise = max(1.4826 * float(np.median(residual[known])), FINEST)
        long = known & (length >= 0.3 * np.median(length[known]))
        bend = 1.4826 * float(np.median(residual[long] / length[long])) if long.any() else 0.0
        scale = np.hypot(noise, bend * np.nan_to_num(length))
    return Smoothness(residual, scale)


def angle_between(a: Array, b: Array) -> Array:
    """Angles (...) between vectors of any length."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def scatter(values: Array, md: Array, weight: Array | float = 1.0) -> float:
    """Robust scatter of values (n,) about the line of their neighbours, in their own unit, times a weight (n,)."""
    if len(md) < 5:
        return 0.0
    before, after = np.diff(md)[:-1], np.diff(md)[1:]
    between = (after * values[:-2] + before * values[2:]) / (before + after)
    off = np.abs(values[1:-1] - between) * np.broadcast_to(weight, len(md))[1:-1]
    return 1.4826 * float(np.median(off))


def power(log_ratio: float) -> str:
    """A likelihood ratio in words."""
    return f"1e{int(min(max(log_ratio / np.log(10.0), 0.0), 99.0))}"

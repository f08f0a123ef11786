"""A run of stations, and how smooth its hole is.

    rho = angle(t, (b t_before + a t_after) / (a + b))     residual of a station from the arc of its neighbours

t is the direction of the hole, a and b the courses before and after. rho of a drilled hole is some tenths of a degree;
its likelihood is Student's t of 3 degrees of freedom with the run's own robust scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index
from inclinometry.orientation import angles, dip_angle

FINEST, JUMP = np.radians(0.1), np.radians(10.0)
"""Residual below which none is remarkable; from which a hole is broken (20 deg of dogleg and back, in one course)."""
Channels = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Run:
    """Stations of one run, in the order of depth.

    md : (n,) m; inclination, azimuth : (n,) rad; g, b : (n, 3) m/s^2 and nT in tool axes, or None.
    totals : "g" m/s^2, "b" nT, "dip" rad -> (n,), those that are known.
    channels : sensor -> (n, k) raw channels; fields : the calibration, channels -> g and b; None without one.
    strength_known : whether it knows the strength of its magnetic field. azimuth_reference : the north of the azimuths.
    """

    md: Array
    inclination: Array
    azimuth: Array
    g: Array | None = None
    b: Array | None = None
    totals: Mapping[str, Array] = field(default_factory=dict)
    channels: Channels = field(default_factory=dict)
    fields: Callable[[Channels], tuple[Array, Array]] | None = None
    strength_known: bool = True
    azimuth_reference: str = "true"

    def numbers(self) -> Array:
        """What was read, (n, k): channels, else six axes, else both angles."""
        if self.channels:
            return np.column_stack(list(self.channels.values()))
        if self.g is None or self.b is None:
            return np.column_stack([self.inclination, self.azimuth])
        return np.column_stack([self.g, self.b])

    @classmethod
    def of_fields(cls, md: Array, g: Array, b: Array) -> Run:
        """Of six axes in tool axes, m/s^2 and nT."""
        found = angles(g, b)
        totals = {"g": np.linalg.norm(g, axis=1), "b": np.linalg.norm(b, axis=1), "dip": dip_angle(g, b)}
        return cls(md, found.inclination, found.azimuth, g, b, totals)

    def rows(self, rows: Index) -> Run:
        """Some of the stations; the calibration, whose temperatures are those of all, is left out."""

        def some(values: Array | None) -> Array | None:
            return None if values is None else values[rows]

        totals, channels = ({k: v[rows] for k, v in held.items()} for held in (self.totals, self.channels))
        angles_ = self.inclination[rows], self.azimuth[rows]
        return Run(self.md[rows], *angles_, some(self.g), some(self.b), totals, channels, None, self.strength_known)


# How smooth a hole is.


class Smoothness(NamedTuple):
    """Residuals (n,) of each station from the arc of its neighbours, rad, NaN at both ends, and their scale (n,)."""

    residual: Array
    scale: Array

    def log_likelihood(self, scale: Array | None = None, rows: Array | slice = slice(None)) -> float:
        """Of Student's t with 3 degrees of freedom, up to a constant."""
        spread = (self.scale if scale is None else scale)[rows]
        return float(-2.0 * np.nansum(np.log1p((self.residual[rows] / spread) ** 2 / 3.0)) - np.nansum(np.log(spread)))


def smoothness(md: Array, t: Array) -> Smoothness:
    """Of directions (n, 3) at measured depths (n,), m; the scale is noise and a change of curvature with the course."""
    residual, length = np.full(len(md), np.nan), np.full(len(md), np.nan)
    if len(md) >= 3:
        before, after = np.diff(md)[:-1], np.diff(md)[1:]
        residual[1:-1] = angle_between(t[1:-1], after[:, None] * t[:-2] + before[:, None] * t[2:])
        length[1:-1] = 2.0 * before * after / (before + after)
    known = residual > 1e-9  # a section taken to be straight tells nothing of the rest
    if not known.any():
        return Smoothness(residual, np.full(len(md), FINEST))
    noise = max(1.4826 * float(np.median(residual[known])), FINEST)
    long = known & (length >= 0.3 * np.median(length[known]))
    bend = 1.4826 * float(np.median(residual[long] / length[long])) if long.any() else 0.0
    return Smoothness(residual, np.hypot(noise, bend * np.nan_to_num(length)))


def angle_between(a: Array, b: Array) -> Array:
    """Angles (...) between vectors of any length."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def scatter(values: Array, md: Array, weight: Array | float = 1.0) -> float:
    """Robust scatter of values (n,) about the line of their neighbours, in their own unit, times a weight (n,)."""
    if len(md) < 5:
        return 0.0
    before, after = np.diff(md)[:-1], np.diff(md)[1:]
    off = np.abs(values[1:-1] - (after * values[:-2] + before * values[2:]) / (before + after))
    return 1.4826 * float(np.median(off * np.broadcast_to(weight, len(md))[1:-1]))


def last_digit(values: Array) -> float:
    """Last digit of values: 1, 0.1, .. 1e-5."""
    return next(
        (float(s) for s in 10.0 ** -np.arange(5) if (np.abs(values / s - np.round(values / s)) < 1e-5).all()), 1e-5
    )

"""Drill holes: from depth, dip and azimuth to positions from the collar, straight where nothing was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen
from inclinometry.errors import InputError
from inclinometry.survey.path import Path, checked_stations, minimum_curvature


@dataclass(frozen=True, eq=False)
class Hole:
    """A hole from its collar to its end.

    path : stations, with one at the collar (depth 0) and one at the end; tvd counts from the collar.
    shots : how many of them were measured.
    notes : where the hole was taken to be straight.
    """

    path: Path
    shots: int
    notes: tuple[str, ...]


def inclination_of_dip(dip: ArrayLike, *, down_positive: bool) -> Array:
    """Inclination from the vertical, rad, of a dip from the horizontal.

    Examples
    --------
    >>> np.degrees(inclination_of_dip(np.radians([-90.0, -60.0, 10.0]), down_positive=False)).round(9)
    array([  0.,  30., 100.])
    """
    sign = -1.0 if down_positive else 1.0
    return np.asarray(0.5 * np.pi + sign * finite(dip, "dip"))


def drill_hole(depth: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike, end: float | None = None) -> Hole:
    """A hole by minimum curvature, from one shot or more.

    Parameters
    ----------
    depth : (n,) array_like
        Along the hole from the collar, m, zero or more, increasing.
    inclination, azimuth : (n,) array_like
        rad.
    end : float, optional
        Depth at which the hole ends, m; the last shot when not given.

    Raises
    ------
    InputError
        As `minimum_curvature`; a depth above the collar, an end above the last shot, a hole without length.

    Notes
    -----
    Above the first shot and below the last one the hole goes straight on in their directions.

    Examples
    --------
    >>> path = drill_hole([50.0], np.radians([30.0]), np.radians([90.0]), 100.0).path
    >>> path.md.tolist(), float(path.east[-1].round(6))
    ([0.0, 50.0, 100.0], 50.0)
    """
    md, slope, heading = checked_stations(depth, inclination, azimuth, least=1)
    notes = []
    shots = len(md)
    if md[0] < 0.0:
        raise InputError(f"the first depth is {md[0]:g} m, above the collar")
    if end is not None and end < md[-1] - 1e-6:
        raise InputError(f"the hole ends at {end:g} m, above its last shot at {md[-1]:g} m")
    if md[-1] == 0.0 and not end:
        raise InputError("a single shot at the collar, and no end depth; the length of the hole is not known")
    if shots == 1:
        notes.append("a single shot: a straight hole")
    if md[0] > 0.0:
        notes += [f"straight from the collar to the first shot at {md[0]:g} m"] if shots > 1 else []
        md, slope, heading = (
            np.concatenate([[first], x]) for first, x in ((0.0, md), (slope[0], slope), (heading[0], heading))
        )
    if end is not None and end > md[-1] + 1e-6:
        notes += [f"straight from the last shot at {md[-1]:g} m to the end at {end:g} m"] if shots > 1 else []
        md, slope, heading = (np.append(x, last) for x, last in ((md, end), (slope, slope[-1]), (heading, heading[-1])))
    return Hole(minimum_curvature(frozen(md), slope, heading), shots, tuple(notes))

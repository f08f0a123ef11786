"""Two surveys of one hole side by side: how far apart they put it, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.rotations import dcm
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.survey.path import Path, interpolate


@dataclass(frozen=True, eq=False)
class Comparison:
    """Differences of two paths at m common depths, second less first.

    md : (m,) m.
    north, east, tvd : (m,) m.
    separation : (m,) distance of the two points, m.
    high_side, lateral, along_hole : (m,) the difference in the axes of the first path: up across the hole, to its
        right looking down hole, down along it, m.
    inclination, azimuth : (m,) rad; azimuth in [-pi, pi), worth little where the hole is near vertical.
    """

    md: Array
    north: Array
    east: Array
    tvd: Array
    separation: Array
    high_side: Array
    lateral: Array
    along_hole: Array
    inclination: Array
    azimuth: Array


def compare_paths(first: Path, second: Path, md: ArrayLike | None = None) -> Comparison:
    """Differences of two paths at common depths.

    Parameters
    ----------
    first, second : Path
        From the same start and with azimuth from the same north; what they differ by in either comes out as a
        difference of the surveys.
    md : (m,) array_like, optional
        Depths that both paths cover, m; by default the stations of either between the ends of both.

    Raises
    ------
    InputError
        When the paths have no depth in common, or `md` goes beyond one of them.

    Examples
    --------
    >>> from inclinometry.survey.path import minimum_curvature
    >>> vertical = minimum_curvature([0.0, 100.0], [0.0, 0.0], [0.0, 0.0])
    >>> leaning = minimum_curvature([0.0, 100.0], np.radians([1.0, 1.0]), [0.0, 0.0])
    >>> found = compare_paths(vertical, leaning, [100.0])
    >>> float(found.north[0].round(4)), float(found.separation[0].round(4)), float(found.along_hole[0].round(4))
    (1.7452, 1.7453, -0.0152)
    """
    if md is None:
        low, high = max(first.md[0], second.md[0]), min(first.md[-1], second.md[-1])
        if low > high:
            raise InputError(
                f"the paths run from {first.md[0]:.10g} to {first.md[-1]:.10g} m and from {second.md[0]:.10g} to "
                f"{second.md[-1]:.10g} m; they have no depth in common"
            )
        both = np.union1d(first.md, second.md)
        md = both[(both >= low) & (both <= high)]
    one, two = interpolate(first, md), interpolate(second, md)
    apart = np.stack([two.north - one.north, two.east - one.east, two.tvd - one.tvd], axis=-1)
    high_side, lateral, along = np.einsum("mij,mj->im", dcm(one.azimuth, one.inclination, 0.0), apart)
    columns = (
        *(one.md, *apart.T, np.linalg.norm(apart, axis=1), high_side, lateral, along),
        *(two.inclination - one.inclination, wrap_signed(two.azimuth - one.azimuth)),
    )
    for values in columns:
        values.flags.writeable = False
    return Comparison(*columns)

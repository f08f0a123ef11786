"""Which magnetometer channel lies along which accelerometer channel: found from the constancy of the dip.

The angle between gravity and the magnetic field is the same in every attitude, but only when both are expressed in the
same axes. Readings in a few different attitudes therefore tell the 48 signed permutations apart, up to one sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from math import degrees
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.conventions import Axes, axes_matrix, axes_names
from inclinometry.attitude.orientation import dip_angle
from inclinometry.core.arrays import Array, finite, within
from inclinometry.core.errors import InputError

RATIO: Final = 3.0
"""A rival must scatter this many times more: 95 % point of sqrt(F(3, 3)), four attitudes of equal quality."""


@dataclass(frozen=True)
class Mapping:
    """One signed permutation: the magnetometer channels that lie along the accelerometer's x, y, z."""

    axes: Axes
    dip: float  # mean over the attitudes, rad, positive down
    scatter: float  # standard deviation over the attitudes, rad
    right_handed: bool  # False for a mapping that mirrors the triad

    @property
    def matrix(self) -> Array:
        """Matrix (3, 3) from magnetometer channels to accelerometer axes."""
        return axes_matrix(self.axes)


@dataclass(frozen=True)
class MappingRanking:
    """All mappings, best first, and what can be said of the choice."""

    mappings: tuple[Mapping, ...]
    ambiguous: bool
    explanation: str

    @property
    def best(self) -> Mapping:
        """The mapping with the least scatter; of a pair of opposite sign the one explained in `find_mapping`."""
        return self.mappings[0]


def find_mapping(
    accelerometer: ArrayLike, magnetometer: ArrayLike, *, dip: float | None = None, tolerance: float = 0.01
) -> MappingRanking:
    """Rank the 48 signed permutations from magnetometer to accelerometer axes by the scatter of the dip.

    Parameters
    ----------
    accelerometer : (K, 3) array_like
        Gravity in K >= 4 well spread attitudes, any unit. Opposite for accelerometers that report specific force.
    magnetometer : (K, 3) array_like
        Magnetometer channels in the same attitudes, any unit.
    dip : float, optional
        Expected dip, rad. It settles the sign of all three channels together, to which constancy of the dip is blind:
        reversed channels give a dip as constant, of opposite sign. Without it the mapping between two right-handed
        triads comes first.
    tolerance : float
        Scatter, rad, that noise and calibration errors may cause (default 0.01 rad, about 0.6 deg).

    Returns
    -------
    MappingRanking
        `ambiguous` is True when a second pair of mappings scatters less than 3 times the best or less than
        `tolerance`, or when the best itself scatters more than `tolerance`; `explanation` says which.

    Raises
    ------
    InputError
        Fewer than four attitudes, unequal counts, a zero vector.

    Notes
    -----
    A rotation common to both triads leaves the dip alone and cannot be seen here.

    Examples
    --------
    >>> from inclinometry.attitude.orientation import fields
    >>> g, b = fields([0.1, 1.0, 2.5, 4.0], [0.3, 1.2, 2.0, 0.8], [0.5, 3.0, 1.0, 5.0], 1.2)
    >>> ranking = find_mapping(g, b[:, [1, 0, 2]])
    >>> ranking.best.axes, ranking.best.right_handed, ranking.ambiguous
    (('-y', '-x', '-z'), True, False)
    """
    a = finite(accelerometer, "accelerometer", (3,))
    m = finite(magnetometer, "magnetometer", (3,))
    if a.shape != m.shape or a.ndim != 2 or len(a) < 4:
        raise InputError(
            f"accelerometer has shape {a.shape}, magnetometer {m.shape}; both must be (K, 3) with K >= 4 attitudes"
        )
    wanted = None if dip is None else float(within(dip, "dip", -np.pi / 2, np.pi / 2, "rad"))
    found = [_mapping(a, m, matrix) for matrix in _signed_permutations()]
    # a mapping and its opposite scatter alike but for rounding: rank the pairs, then order each pair
    pairs = sorted((_ordered(one, _opposite(one, found), wanted) for one in found[:24]), key=lambda p: p[0].scatter)
    ranked = tuple(mapping for pair in pairs for mapping in pair)
    ambiguous, explanation = _judge(pairs, wanted, tolerance)
    return MappingRanking(ranked, ambiguous, explanation)


def _signed_permutations() -> list[Array]:
    """All 48, the right-handed ones first."""
    matrices = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return sorted(matrices, key=lambda matrix: -np.linalg.det(matrix))


def _mapping(a: Array, m: Array, matrix: Array) -> Mapping:
    dips = dip_angle(a, m @ matrix.T)
    return Mapping(axes_names(matrix), float(dips.mean()), float(dips.std(ddof=1)), bool(np.linalg.det(matrix) > 0.0))


def _opposite(one: Mapping, others: list[Mapping]) -> Mapping:
    axes = axes_names(-one.matrix)
    return next(other for other in others if other.axes == axes)


def _ordered(one: Mapping, other: Mapping, dip: float | None) -> tuple[Mapping, Mapping]:
    """The right-handed one first, unless the expected dip says otherwise."""
    if dip is not None and abs(other.dip - dip) < abs(one.dip - dip):
        return other, one
    return one, other


def _judge(pairs: list[tuple[Mapping, Mapping]], dip: float | None, tolerance: float) -> tuple[bool, str]:
    best, rival = pairs[0][0], pairs[1][0]
    text = f"magnetometer {', '.join(best.axes)} along x, y, z: dip {degrees(best.dip):.2f} deg, scatter "
    text += f"{degrees(best.scatter):.3f} deg; next best {', '.join(rival.axes)}: {degrees(rival.scatter):.3f} deg."
    if best.scatter > tolerance:
        text += f" No mapping keeps the dip constant to {degrees(tolerance):.3g} deg: calibrate, or look for magnetic "
        return True, text + "disturbance or readings out of order."
    if rival.scatter < max(RATIO * best.scatter, tolerance):
        return True, text + " The attitudes do not tell these apart: add some at other inclinations and toolfaces."
    if dip is None:
        text += f" The same channels reversed give dip {degrees(-best.dip):.2f} deg: the site's dip tells which."
    elif abs(best.dip - dip) > 10.0 * tolerance:
        text += f" The dip differs from the expected {degrees(dip):.2f} deg by more than noise does."
    return False, text

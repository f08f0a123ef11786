"""A bottom-hole assembly as a beam in a hole: Euler-Bernoulli elements, walls as contacts. No checks.

x counts up the hole from the bit, deflection toward the low side from the axis of the hole. An element between two
nodes is cubic (Hermite), which is exact at the nodes for a load that is even along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array, Index, Mask
from inclinometry.core.errors import ConvergenceError

_TOUCH: Final = 1e-9  # m
_PULL: Final = 1e-9  # of the largest load of a node: rounding
_ROUNDS: Final = 2  # changes of contact for each degree of freedom before the slower way
_PATIENCE: Final = 50


@dataclass(frozen=True, eq=False)
class Beam:
    """Nodes and what lies between them.

    x : (n,) m.  stiffness : (n - 1,) E I, N m^2.  load : (n - 1,) N/m across the hole where it is level.
    gap : (n,) m between body and wall at the nodes; inf where no contact is possible.
    clamped : whether the upper end lies on the low side along the hole.
    """

    x: Array
    stiffness: Array
    load: Array
    gap: Array
    clamped: bool = True


@dataclass(frozen=True, eq=False)
class Shape:
    """The beam at rest, all (n,).

    deflection : m.  slope : rad.  contact : 1 at the low side, -1 at the high side, 0 free.  force : on the wall, N.
    """

    x: Array
    deflection: Array
    slope: Array
    contact: Array
    force: Array


def bent(beam: Beam, share: float, curvature: float, touching: Sequence[int] | Array) -> Shape:
    """The shape of least energy within the walls.

    Parameters
    ----------
    beam : Beam
    share : float
        Of the load that acts across the hole: the sine of inclination.
    curvature : float
        Of the hole, rad/m, positive where inclination increases down the hole.
    touching : (n,) int
        Contacts to start from.

    Raises
    ------
    ConvergenceError
        The contacts do not settle.
    """
    band, force = _assembled(beam, share, curvature)
    bounded = np.zeros(2 * len(beam.x), dtype=bool)
    bounded[::2] = np.isfinite(beam.gap)
    wall = np.zeros(len(bounded))
    wall[::2] = np.where(np.isfinite(beam.gap), beam.gap, 0.0)
    # without play the low side and the high side are one place
    held = bounded & (wall == 0.0)
    side = np.zeros(len(bounded), dtype=np.intp)
    side[::2] = np.where(bounded[::2], np.asarray(touching, dtype=np.intp), 0)
    if beam.clamped:
        held[-2:], side[-2] = True, 1
    problem = _Problem(band, force, wall, bounded & ~held, held)
    values, side = _settled(problem, side) or _descended(problem, side * held)
    pressed = force - _times(band, values)
    contact = np.where(held, np.sign(pressed), side)[::2]
    return Shape(beam.x, values[::2], values[1::2], np.where(bounded[::2], contact, 0.0), pressed[::2])


class _Problem(NamedTuple):
    """Stiffness, load, walls (2n,), which deflections they bound, and what is held in place."""

    band: Array
    force: Array
    wall: Array
    bounded: Mask
    held: Mask

    def loosest(self, values: Array, side: Index) -> int | None:
        """The contact that would have to pull hardest, None where all push."""
        pull = np.where(self.bounded, -side * (self.force - _times(self.band, values)), 0.0)
        worst = int(np.argmax(pull))
        return worst if pull[worst] > _PULL * np.abs(self.force).max(initial=1e-12) else None


def _settled(problem: _Problem, start: Index) -> tuple[Array, Index] | None:
    """Close the contact passed furthest, else open the one that pulls hardest; None where that goes in circles."""
    side = start.copy()
    for _ in range(_ROUNDS * len(side)):
        values = _solved(problem.band, problem.force, problem.held | (side != 0), side * problem.wall)
        past = np.where(problem.bounded, np.abs(values) - problem.wall, 0.0)
        worst = int(np.argmax(past))
        if past[worst] > _TOUCH:
            side[worst] = 1 if values[worst] > 0.0 else -1
            continue
        loose = problem.loosest(values, side)
        if loose is None:
            return values, side
        side[loose] = 0
    return None


def _descended(problem: _Problem, start: Index) -> tuple[Array, Index]:
    """The same by steps that stay between the walls and never gain energy: slower, but it ends."""
    side, values = start.copy(), start * problem.wall
    for _ in range(_PATIENCE * len(side)):
        fixed = problem.held | (side != 0)
        aim = _solved(problem.band, problem.force, fixed, values)
        step = aim - values
        beyond = problem.bounded & ~fixed & (np.abs(aim) > problem.wall + _TOUCH)
        if beyond.any():
            room = np.where(beyond, np.sign(aim) * problem.wall - values, 0.0)
            share = np.divide(room, step, out=np.full(len(step), np.inf), where=beyond)
            first = int(np.argmin(share))
            values = values + share[first] * step
            side[first] = int(np.sign(aim[first]))
            values[first] = side[first] * problem.wall[first]
            continue
        values = aim
        loose = problem.loosest(values, side)
        if loose is None:
            return values, side
        side[loose] = 0
    raise ConvergenceError(
        "the contacts of the assembly with the wall do not settle; check diameters and positions of the stabilisers"
    )


def _assembled(beam: Beam, share: float, curvature: float) -> tuple[Array, Array]:
    """Lower band (4, 2n) of the stiffness matrix and the load (2n,)."""
    span = np.diff(beam.x)
    size = 2 * len(beam.x)
    band, force = np.zeros((4, size)), np.zeros(size)
    one = np.ones_like(span)
    block = np.array(
        [
            [12 * one, 6 * span, -12 * one, 6 * span],
            [6 * span, 4 * span**2, -6 * span, 2 * span**2],
            [-12 * one, -6 * span, 12 * one, -6 * span],
            [6 * span, 2 * span**2, -6 * span, 4 * span**2],
        ]
    ) * (beam.stiffness / span**3)
    first = 2 * np.arange(len(span))
    for column in range(4):
        for row in range(column, 4):
            np.add.at(band[row - column], first + column, block[row, column])
    weight = beam.load * share
    # a curved hole is a straight beam's initial bend: E I (v'' - curvature)^2 / 2
    moment = beam.stiffness * curvature
    parts = (weight * span / 2, weight * span**2 / 12 - moment, weight * span / 2, -weight * span**2 / 12 + moment)
    for place, part in enumerate(parts):
        np.add.at(force, first + place, part)
    return band, force


def _times(band: Array, values: Array) -> Array:
    total = band[0] * values
    for step in range(1, len(band)):
        total[step:] += band[step, :-step] * values[:-step]
        total[:-step] += band[step, :-step] * values[step:]
    return np.asarray(total)


def _solved(band: Array, force: Array, fixed: Mask, values: Array) -> Array:
    """Deflections and slopes with those of `fixed` given."""
    from scipy.linalg import solveh_banded

    right = np.where(fixed, values, force - _times(band, np.where(fixed, values, 0.0)))
    reduced = band.copy()
    # the fixed ones are taken out of the equations and put back as identities
    reduced[0, fixed] = band[0].max()
    right[fixed] *= band[0].max()
    for step in range(1, len(band)):
        reduced[step, :-step][fixed[:-step] | fixed[step:]] = 0.0
    return np.asarray(solveh_banded(reduced, right, lower=True))

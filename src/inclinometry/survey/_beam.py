"""A bottom-hole assembly as a beam in a hole: Euler-Bernoulli elements, walls as contacts. No checks.

x counts up the hole from the bit, deflection toward the low side from the axis of the hole. An element between two
nodes is cubic (Hermite), which is exact at the nodes for a load that is even along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import ConvergenceError

_TOUCH: Final = 1e-9  # m
_ROUNDS: Final = 30  # changes of contact allowed for each node


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
    contact = np.zeros(2 * len(beam.x), dtype=np.intp)
    contact[::2] = np.where(np.isfinite(beam.gap), np.asarray(touching, dtype=np.intp), 0)
    wall = np.zeros(len(contact))
    wall[::2] = np.where(np.isfinite(beam.gap), beam.gap, 0.0)
    held = np.zeros(len(contact), dtype=bool)
    if beam.clamped:
        held[-2:], contact[-2] = True, 1
    for _ in range(_ROUNDS * len(beam.x)):
        values = _solved(band, force, held | (contact != 0), contact * wall)
        pressed = force - _times(band, values)
        past = np.where(np.isfinite(beam.gap), np.abs(values[::2]) - wall[::2], 0.0)
        worst = int(np.argmax(past))
        if past[worst] > _TOUCH:
            contact[2 * worst] = 1 if values[2 * worst] > 0.0 else -1
            continue
        pull = np.where(held, 0.0, -contact * pressed)
        loose = int(np.argmax(pull))
        if pull[loose] <= 1e-9 * np.abs(force).max(initial=1.0):
            return Shape(beam.x, values[::2], values[1::2], contact[::2].astype(float), pressed[::2])
        contact[loose] = 0
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

"""Direction of the hole as a constant-rate motion: what the passes over windows carry, and one step of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inclinometry.attitude.rotations import quaternion_from_dcm
from inclinometry.core.arrays import Array
from inclinometry.motion._hole_direction import azimuth_unknown, clean, turned
from inclinometry.motion.result import BITS, METHODS, Attitude

BIASED: Final = sum(BITS[name] for name in ("disturbed", "step", "aliased", "axes", "stuck"))
"""Flags of rows that may be off together: no evidence for a bend of the hole."""
DOUBTFUL: Final = BIASED | sum(BITS[name] for name in ("clipped", "vibration", "misfit", "not-still"))
"""Flags of rows whose uncertainty is counted larger."""
DELAYED: Final = 2.0
"""Azimuth by the angle that the field is turned by a delay: 1 / cos D at most, 2 at a dip of 60 deg."""
LOW_WEIGHT: Final = 0.1
"""Weight below which a row is flagged as a misfit."""


class Row(NamedTuple):
    """One row as the passes see it; matrix and covariance are None where it was refused."""

    time: float
    matrix: Array | None
    covariance: Array | None
    rate: float
    quality: float
    flags: int

    @property
    def doubtful(self) -> bool:
        """Whether its own method doubts it."""
        return bool(self.flags & DOUBTFUL)

    @property
    def evidence(self) -> bool:
        """Whether the row may testify to a bend."""
        return self.known and not self.flags & BIASED

    @property
    def known(self) -> bool:
        """Whether the row tells a whole direction."""
        if self.matrix is None or self.covariance is None:
            return False
        return not azimuth_unknown(self.matrix, self.covariance)


class Common(NamedTuple):
    """Standard deviations of what all rows share: rad about horizontal axes, rad about the vertical, s of delay."""

    tilt: float
    turn: float
    delay: float

    def covariance(self, step: Step, matrix: Array) -> Array:
        """Share (3, 3) of a row, tool axes; what a delay turns is no more than the row itself is unsure of."""
        down = matrix[:, 2]
        speed = step.rate if np.isfinite(step.rate) else 0.0
        delayed = (DELAYED * speed * self.delay) ** 2
        if step.row.covariance is not None:
            # the row's own variance of azimuth
            level = max(float(down[:2] @ down[:2]), 1e-12)
            delayed = min(delayed, float(down[:2] @ step.row.covariance[:2, :2] @ down[:2]) / level**2)
        spread = np.array([self.tilt**2, self.tilt**2, self.turn**2 + delayed])
        return np.asarray((matrix * spread) @ matrix.T)


@dataclass(frozen=True, eq=False)
class Belief:
    """Frame of the hole, its rate of turn (2,) rad/s in it, and the covariance (4, 4) of offset and rate."""

    time: float
    frame: Array
    rate: Array
    covariance: Array


class Step(NamedTuple):
    """One row done.

    predicted, belief : before and after the row; None before the first attitude.
    matrix, covariance : of the tool; None where there is none to give.
    roll, roll_variance : of the tool in the frame of `belief`.
    factor : on the row's covariance: doubt, noise scale and weight together.
    weight : robust weight of the row's measurement; 0 where it had none.
    """

    row: Row
    predicted: Belief | None
    belief: Belief | None
    matrix: Array | None
    covariance: Array | None
    rate: float
    roll: float
    roll_variance: float
    factor: float
    weight: float
    quality: float


def transition(dt: float) -> Array:
    """Offset and rate after dt seconds (4, 4)."""
    f = np.eye(4)
    f[0, 2] = f[1, 3] = dt
    return f


def process(dt: float, direction_walk: float, rate_walk: float) -> Array:
    """Covariance (4, 4) that dt seconds add: white noise on the rate's derivative and on the direction's."""
    q, along = rate_walk**2, direction_walk**2
    block = q * np.array([[dt**3 / 3.0, 0.5 * dt**2], [0.5 * dt**2, dt]])
    block[0, 0] += along * dt
    return np.asarray(np.kron(block, np.eye(2)))


def predicted_frame(belief: Belief, dt: float) -> Array:
    """Frame of the hole dt seconds on."""
    return clean(turned(belief.frame, belief.rate * dt))


def updated(predicted: Belief, offset: Array, noise: Array) -> Belief:
    """Belief after a measured offset; Joseph's form, and the frame moved so that the offset is 0 again."""
    p = predicted.covariance
    gain = np.linalg.solve(p[:2, :2] + noise, p[:2]).T
    keep = np.eye(4)
    keep[:, :2] -= gain
    covariance = keep @ p @ keep.T + gain @ noise @ gain.T
    change = gain @ offset
    frame = clean(turned(predicted.frame, change[:2]))
    return Belief(predicted.time, frame, predicted.rate + change[2:], 0.5 * (covariance + covariance.T))


def attitude_of(steps: list[Step], north: str, method: str, common: Common, notes: tuple[str, ...] = ()) -> Attitude:
    """Rows of a pass as the common result; measured rows with a low weight are flagged as misfits.

    common : what all rows share; added to every row.
    """
    size = len(steps)
    quaternion, covariance = np.full((size, 4), np.nan), np.full((size, 3, 3), np.nan)
    flags = np.array([step.row.flags for step in steps], dtype=np.uint32)
    for place, step in enumerate(steps):
        if step.matrix is None or step.covariance is None:
            continue
        quaternion[place] = quaternion_from_dcm(step.matrix)
        covariance[place] = step.covariance + common.covariance(step, step.matrix)
        if step.belief is not None and step.row.matrix is not None and step.weight < LOW_WEIGHT:
            flags[place] |= BITS["misfit"]
    return Attitude(
        time=np.array([step.row.time for step in steps]),
        quaternion=quaternion,
        covariance=covariance,
        rate=np.array([step.rate for step in steps]),
        quality=np.array([step.quality for step in steps]),
        flags=flags,
        method=np.full(size, METHODS.index(method), dtype=np.uint8),
        north=north,
        notes=notes,
    )

"""The forward pass over windows: prediction, adaptive factor, robust weight, update, one row at a time."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Protocol

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.motion._hole_direction import (
    Seen,
    azimuth_unknown,
    carried,
    rolled,
    see,
    with_azimuth,
)
from inclinometry.motion._window_model import (
    LOW_WEIGHT,
    Belief,
    Row,
    Step,
    predicted_frame,
    process,
    transition,
    updated,
)
from inclinometry.motion.adaptive import fading_factor, sage_husa, sage_husa_share, yang_factor_three, yang_factor_two
from inclinometry.motion.result import BITS
from inclinometry.motion.robust import huber_weight, igg3_weight
from inclinometry.uncertainty.propagation import UNKNOWN

LEAST_WEIGHT: Final = 1e-6
"""Of a rejected row: it keeps its roll with a thousandfold standard deviation."""
PRIOR_WINDOWS: Final = 30
"""Windows' worth of trust in the rows' own covariance before Sage-Husa has seen any."""
FADING_MEMORY: Final = 0.95
LARGEST: Final = 4.0
"""Normalised innovation that Sage-Husa does not learn from and quality calls hopeless."""
AGREE: Final = 3.0
"""Normalised distance up to which two rows tell the same direction."""
PATIENCE: Final = 12
"""Rows rejected one after another after which flagged ones are evidence too: a wrong reference flags them all."""
STEADY: Final = 1e-2
"""Speed of rotation, rad/s, below which a tool is taken not to rotate in a window that does not tell."""
ROLL_WANDER: Final = 1e-4
"""Standard deviation, rad/s, of the mean speed of a tool that does not rotate."""


class Tuning(Protocol):
    """What of `WindowFilterSettings` the recursion needs."""

    @property
    def huber(self) -> float | None: ...
    @property
    def igg3(self) -> tuple[float, float] | None: ...
    @property
    def adaptive_two(self) -> float | None: ...
    @property
    def adaptive_three(self) -> tuple[float, float] | None: ...
    @property
    def forgetting(self) -> float | None: ...
    @property
    def least_noise(self) -> float: ...
    @property
    def fading(self) -> float | None: ...
    @property
    def doubt(self) -> float: ...
    @property
    def direction_walk(self) -> float: ...
    @property
    def rate_walk(self) -> float: ...
    @property
    def rate_sigma(self) -> float: ...
    @property
    def roll_share(self) -> float: ...
    @property
    def longest_bridge(self) -> float: ...


class Recursion:
    """State of the forward pass; `step` takes a row with the attitudes beside it."""

    def __init__(self, tuning: Tuning) -> None:
        self._tuning = tuning
        self._belief: Belief | None = None
        self._seen_at = 0.0
        self._roll, self._roll_variance, self._rate = 0.0, UNKNOWN**2, float("nan")
        self._scale, self._counted = 1.0, 0
        self._rejected = 0
        self._spread: Array | None = None
        self._noise = np.zeros((2, 2))

    def step(self, row: Row, before: Row | None, after: Row | None) -> Step:
        """Take one row in; `before` and `after` are the nearest rows that had an attitude."""
        if self._belief is not None and row.time - self._seen_at > self._tuning.longest_bridge:
            self._belief = None
        if self._belief is None:
            return self._start(row, after)
        predicted = self._predict(self._belief, row.time)
        rate = row.rate if np.isfinite(row.rate) else self._rate
        self._carry_roll(rate, row.time - self._belief.time, told=bool(np.isfinite(row.rate)))
        if row.matrix is None or row.covariance is None:
            return self._bridge(row, predicted, rate)
        return self._update(row, row.matrix, row.covariance, self._adapted(predicted, row, before, after))

    def _start(self, row: Row, after: Row | None) -> Step:
        matrix, covariance = row.matrix, row.covariance
        if matrix is None or covariance is None or azimuth_unknown(matrix, covariance):
            return Step(row, None, None, matrix, covariance, row.rate, 0.0, 0.0, 1.0, 0.0, row.quality)
        full = np.diag([0.0, 0.0, self._tuning.rate_sigma**2, self._tuning.rate_sigma**2])
        full[:2, :2] = covariance[:2, :2]
        belief = Belief(row.time, matrix, np.zeros(2), full)
        apart = self._contradiction(belief, after)
        if apart > AGREE:
            doubted = row._replace(flags=row.flags | BITS["start"])
            wide = 2.0 * apart**2 * covariance
            return Step(doubted, None, None, matrix, wide, row.rate, 0.0, 0.0, 1.0, 0.0, 0.0)
        variance = float(covariance[2, 2])
        return self._done(Step(row, None, belief, matrix, covariance, row.rate, 0.0, variance, 1.0, 1.0, row.quality))

    def _contradiction(self, belief: Belief, after: Row | None) -> float:
        """Normalised distance of the first row from the next, for a robust filter: either may be the outlier."""
        if self._tuning.igg3 is None and self._tuning.huber is None:
            return 0.0
        if after is None or after.matrix is None or after.covariance is None:
            return 0.0
        seen = see(belief.frame, with_azimuth(after.matrix, after.covariance, belief.frame[2]), after.covariance)
        return _size(seen.offset, belief.covariance[:2, :2] + seen.noise)

    def _predict(self, belief: Belief, time: float) -> Belief:
        dt = time - belief.time
        f = transition(dt)
        moved = f @ belief.covariance @ f.T
        added = process(dt, self._tuning.direction_walk, self._tuning.rate_walk)
        if self._tuning.fading is not None and self._spread is not None:
            moved = moved * fading_factor(self._spread, added[:2, :2], self._noise, moved[:2, :2], self._tuning.fading)
        return Belief(time, predicted_frame(belief, dt), belief.rate, moved + added)

    def _carry_roll(self, rate: float, dt: float, *, told: bool) -> None:
        if not np.isfinite(rate) or (abs(rate) > STEADY and not told):
            self._roll_variance = UNKNOWN**2
            return
        self._roll += rate * dt
        spread = (self._tuning.roll_share * abs(rate) + ROLL_WANDER) * dt
        self._roll_variance = min(self._roll_variance + spread**2, UNKNOWN**2)

    def _bridge(self, row: Row, predicted: Belief, rate: float) -> Step:
        self._belief = predicted
        matrix, covariance = carried(predicted.frame, predicted.covariance[:2, :2], self._roll, self._roll_variance)
        quality = max(1.0 - (row.time - self._seen_at) / self._tuning.longest_bridge, 0.0)
        return Step(
            row, predicted, predicted, matrix, covariance, rate, self._roll, self._roll_variance, 1.0, 0.0, quality
        )

    def _adapted(self, predicted: Belief, row: Row, before: Row | None, after: Row | None) -> Belief:
        """Prediction with its direction doubted by Yang's factor where this row and a neighbour agree against it."""
        tuning = self._tuning
        if tuning.adaptive_two is None and tuning.adaptive_three is None:
            return predicted
        found = self._agreement(predicted, row, before, after)
        if found is None:
            return predicted
        middle, noise = found
        size = _size(middle, predicted.covariance[:2, :2] + noise)
        factor = 1.0 if tuning.adaptive_two is None else float(yang_factor_two(size, tuning.adaptive_two))
        if tuning.adaptive_three is not None:
            factor = min(factor, float(yang_factor_three(size, *tuning.adaptive_three)))
        # never wider than the bend that was seen: at factor 0 the rows stand alone
        most = 2.0 * float(middle @ middle)
        extra = min((1.0 / max(factor, 1e-12) - 1.0) * 0.5 * float(np.trace(predicted.covariance[:2, :2])), most)
        return replace(predicted, covariance=predicted.covariance + np.diag([extra, extra, 0.0, 0.0]))

    def _agreement(
        self, predicted: Belief, row: Row, before: Row | None, after: Row | None
    ) -> tuple[Array, Array] | None:
        """Mean offset of this row and the neighbour it agrees with best, with its noise; None when with neither."""
        own = self._testimony(predicted, row, row.time)
        best, least = None, AGREE
        for each in (before, after):
            other = None if each is None else self._testimony(predicted, each, row.time)
            if own is None or other is None:
                continue
            apart = _size(own[0] - other[0], own[1] + other[1])
            if apart < least:
                least, best = apart, (0.5 * (own[0] + other[0]), 0.25 * (own[1] + other[1]))
        return best

    def _testimony(self, predicted: Belief, row: Row, time: float) -> tuple[Array, Array] | None:
        """Offset and noise of a row from the prediction for `time`; None when the row is no evidence."""
        if row.matrix is None or row.covariance is None or not row.known:
            return None
        if not row.evidence and self._rejected < PATIENCE:
            return None
        seen = see(predicted.frame, row.matrix, row.covariance)
        return seen.offset - predicted.rate * (row.time - time), seen.noise * self._scale

    def _update(self, row: Row, matrix: Array, covariance: Array, predicted: Belief) -> Step:
        step, seen, size = measured(self._tuning, row, matrix, covariance, predicted, self._scale)
        doubt = self._tuning.doubt**2 if row.doubtful else 1.0
        self._rejected = self._rejected + 1 if step.weight < LOW_WEIGHT else 0
        self._learn(seen.offset, doubt * seen.noise, predicted.covariance[:2, :2], size)
        return self._done(step)

    def _done(self, step: Step) -> Step:
        self._belief, self._seen_at = step.belief, step.row.time
        self._roll, self._roll_variance = step.roll, step.roll_variance
        if np.isfinite(step.rate):
            self._rate = step.rate
        return step

    def _learn(self, offset: Array, noise: Array, spread: Array, size: float) -> None:
        """Scale of the rows' covariance by Sage-Husa, and the spread of innovations for strong tracking."""
        tuning = self._tuning
        if tuning.forgetting is not None and size < LARGEST:
            share = sage_husa_share(tuning.forgetting, self._counted + PRIOR_WINDOWS)
            inverse = np.linalg.inv(noise)
            innovation, part = np.sqrt(0.5 * offset @ inverse @ offset), 0.5 * np.trace(inverse @ spread)
            self._scale = float(sage_husa([[self._scale]], [innovation], [[part]], share, tuning.least_noise)[0, 0])
            self._counted += 1
        square = np.outer(offset, offset)
        old = self._spread
        self._spread = square if old is None else (FADING_MEMORY * old + square) / (1.0 + FADING_MEMORY)
        self._noise = noise * self._scale


def measured(
    tuning: Tuning, row: Row, matrix: Array, covariance: Array, predicted: Belief, scale: float
) -> tuple[Step, Seen, float]:
    """Row taken into a prediction with its robust weight; also how it was seen, and its normalised innovation."""
    matrix = with_azimuth(matrix, covariance, predicted.frame[2])
    doubt = tuning.doubt**2 if row.doubtful else 1.0
    seen = see(predicted.frame, matrix, covariance)
    size = _size(seen.offset, predicted.covariance[:2, :2] + seen.noise * (doubt * scale))
    weight = 1.0
    if tuning.huber is not None:
        weight = float(huber_weight(size, tuning.huber))
    if tuning.igg3 is not None:
        weight = float(igg3_weight(size, *tuning.igg3))
    factor = doubt * scale / max(weight, LEAST_WEIGHT)
    belief = updated(predicted, seen.offset, seen.noise * factor)
    out, joint = rolled(belief.frame, belief.covariance[:2, :2], matrix, factor * covariance)
    roll = see(belief.frame, out, joint).roll
    quality = min(row.quality, max(1.0 - size / LARGEST, 0.0))
    known = row._replace(matrix=matrix)
    step = Step(known, predicted, belief, out, joint, row.rate, roll, float(joint[2, 2]), factor, weight, quality)
    return step, seen, size


def _size(offset: Array, spread: Array) -> float:
    """Normalised length of an offset: 1 on the average when the spread is right."""
    return float(np.sqrt(0.5 * offset @ np.linalg.solve(spread, offset)))

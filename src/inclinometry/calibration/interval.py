"""When a tool is due for calibration: as long as it keeps its limit with a stated reliability, by its own drift.

    (10) r(t)^2 = e' G e,  e ~ N(0, P + lambda t Q),  due = largest t with P(r > L) <= 1 - reliability

r is the azimuth error, rms at the attitudes required. It is the end-of-period reliability of NCSLI RP-1, predicted from
variables instead of from a count of passes and failures.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.calibration.drift import MULTIPLIERS, DriftModel, DriftState, azimuth_weight
from inclinometry.constants import DIP
from inclinometry.history import DAYS_PER_YEAR

LONGEST: Final = 5.0
"""No interval is longer, years: a drift that has not been seen yet cannot be excluded."""


@dataclass(frozen=True)
class Requirement:
    """What is required of a tool: its azimuth error, rms over azimuth and toolface at these inclinations, rad.

    limit : L. reliability : of keeping it until the due date. inclinations, dip : where it is required.
    """

    limit: float = float(np.radians(0.5))
    reliability: float = 0.95
    inclinations: Sequence[float] = (float(np.radians(60.0)),)
    dip: float = DIP

    def __post_init__(self) -> None:
        within(self.limit, "limit", 1e-6, np.pi, "rad")
        within(self.reliability, "reliability", 0.5, 0.9999)

    @property
    def weight(self) -> Array:
        """G (24, 24), mean over the inclinations."""
        return np.asarray(azimuth_weight(np.asarray(self.inclinations, dtype=np.float64), self.dip).mean(axis=0))


class Growth:
    """Probability of being beyond the limit as it grows, for n mixtures of J components.

    The quadratic form is taken for a scaled chi-square with its mean tr(GP) and variance 2 tr((GP)^2) (Satterthwaite).
    Covariance (n, J, 24, 24) now, drift Q (24, 24), weights (n, J), multipliers lambda (J,) or (n, J); `shift` (24,) is
    the mean change of the parameters a year, by shock and heat that are to be expected.
    """

    def __init__(
        self,
        covariance: Array,
        drift: Array,
        weights: Array,
        multipliers: Array,
        requirement: Requirement,
        shift: Array | None = None,
    ) -> None:
        g = requirement.weight
        now, later = g @ covariance, g @ drift
        self._first = np.trace(now, axis1=-2, axis2=-1), np.trace(later)
        squares = np.einsum("...pq,...qp->...", now, now), np.einsum("...pq,qp->...", now, later)
        self._second = (*squares, float(np.sum(later * later.T)))
        self._weights, self._multipliers, self._limit = weights, multipliers, requirement.limit
        moved = np.zeros(len(g)) if shift is None else shift
        self._shift = float(moved @ g @ moved), now @ (g @ moved) @ moved, float(moved @ later @ g @ moved)

    def beyond(self, tau: Array, years: Array | None = None) -> Array:
        """P(r > L) (n,) after a time tau (n,) of the tool's clock and calendar years (n,)."""
        from scipy.stats import chi2

        t = np.asarray(tau)[:, None] * self._multipliers
        y = (np.asarray(tau) if years is None else np.asarray(years))[:, None] ** 2
        mean = self._first[0] + t * self._first[1] + y * self._shift[0]
        square = self._second[0] + 2.0 * t * self._second[1] + t**2 * self._second[2]
        square = square + 2.0 * y * (self._shift[1] + t * self._shift[2])
        scale = square / mean
        return np.asarray((self._weights * chi2.sf(self._limit**2 / scale, mean / scale)).sum(axis=1))

    def longest(self, allowed: float, rate: Array | None = None, most: float = LONGEST) -> Array:
        """Years (n,), at most so many, until P(r > L) is `allowed`; rate (n,): the clock's years in a calendar year."""
        size = len(self._weights)
        speed = np.ones(size) if rate is None else rate
        low, high = np.zeros(size), np.full(size, most)
        for _ in range(40):
            middle = (low + high) / 2.0
            good = self.beyond(middle * speed, middle) <= allowed
            low, high = np.where(good, middle, low), np.where(good, high, middle)
        return np.asarray(low)


@dataclass(frozen=True)
class Due:
    """When a tool is due.

    date : to be calibrated on. years : from the last calibration or run. beyond_now : P(r > L) on that day.
    longest : whether it is due only because no interval is longer than `LONGEST`.
    """

    date: datetime.date
    years: float
    beyond_now: float
    longest: bool


def due_date(
    state: DriftState,
    model: DriftModel,
    last: datetime.date,
    requirement: Requirement | None = None,
    *,
    hours_per_year: float | None = None,
    doses_per_year: Sequence[float] = (0.0, 0.0),
    calibrated: datetime.date | None = None,
) -> Due:
    """When a tool is due.

    Parameters
    ----------
    state : DriftState
        After the last calibration, or run that followed it.
    model : DriftModel
    last : datetime.date
        Of that calibration or run.
    requirement : Requirement, optional
        Default: 0.5 deg at inclination 60, kept with 95 %.
    hours_per_year : float, optional
        That it will work. Default: as many as the fleet's tools.
    doses_per_year : (shock, heat)
        To be expected.
    calibrated : datetime.date, optional
        Day of the last calibration, when runs followed it: no run makes an interval longer than `LONGEST`.

    Examples
    --------
    >>> zero = np.zeros((24, 24))
    >>> q = np.diag(np.tile([0.0, 0.0, 0.0, 1e-6], 6))  # 1e-3 of the field a square root of a year
    >>> model = DriftModel("X", q, zero, np.zeros((24, 2)), 1.0, 1.0, 0.0, DIP, 1, 1, "", "", "")
    >>> weights = np.where(MULTIPLIERS == 1.0, 1.0, 0.0)
    >>> state = DriftState(weights, np.zeros((9, 24)), np.tile(1e-12 * np.eye(24), (9, 1, 1)))
    >>> import datetime
    >>> round(due_date(state, model, datetime.date(2026, 1, 1)).years, 2)
    1.79
    """
    asked = Requirement() if requirement is None else requirement
    rate = float(model.clock(np.array(1.0), np.array(hours_per_year or model.hours_per_year)))
    off = state.means - state.mean
    spread = state.covariances + off[:, :, None] * off[:, None, :]
    shift = model.effects @ np.asarray(doses_per_year, dtype=np.float64)
    growth = Growth(spread[None], model.drift, state.weights[None], MULTIPLIERS, asked, shift)
    most = LONGEST - (0.0 if calibrated is None else (last - calibrated).days / DAYS_PER_YEAR)
    years = float(growth.longest(1.0 - asked.reliability, np.array([rate]), max(most, 0.0))[0])
    days = int(np.floor(years * DAYS_PER_YEAR))
    return Due(last + datetime.timedelta(days=days), years, float(growth.beyond(np.zeros(1))[0]), years > 0.999 * most)

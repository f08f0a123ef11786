"""Robust adaptive filter of windows: the direction of the hole followed through outlying, refused and missing rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.attitude.rotations import dcm_from_quaternion
from inclinometry.core.arrays import within
from inclinometry.core.errors import InputError
from inclinometry.motion._window_model import Common, Row, Step, attitude_of
from inclinometry.motion._window_recursion import Recursion
from inclinometry.motion.adaptive import sage_husa_share, yang_factor_three
from inclinometry.motion.result import Attitude
from inclinometry.motion.robust import igg3_weight

LEAST_VARIANCE: Final = 1e-16
"""Of a row about any axis, rad^2: rows that claim to be exact stay invertible."""
_RANGES: Final = {
    "huber": (0.1, 100.0, ""),
    "adaptive_two": (0.1, 100.0, ""),
    "least_noise": (1e-6, 1.0, ""),
    "fading": (1.0, 1e3, ""),
    "doubt": (1.0, 1e3, ""),
    "direction_walk": (0.0, 1.0, "rad/s^0.5"),
    "rate_walk": (0.0, 1.0, "rad/s^1.5"),
    "rate_sigma": (1e-12, 1.0, "rad/s"),
    "roll_share": (0.0, 1.0, ""),
    "common_tilt": (0.0, 1.0, "rad"),
    "common_turn": (0.0, 3.0, "rad"),
    "common_delay": (0.0, 0.1, "s"),
    "longest_bridge": (0.0, 1e7, "s"),
}


@dataclass(frozen=True, kw_only=True)
class WindowFilterSettings:
    """Which parts of the robust adaptive filter are on, and how fast a hole may bend; None switches a part off.

    Parameters
    ----------
    huber : float, optional
        k of `huber_weight` on normalised innovations.
    igg3 : (k0, k1), optional
        Of `igg3_weight`; huber and igg3 exclude each other.
    adaptive_two : float, optional
        c of `yang_factor_two`, on the mean of a row and the neighbour that agrees with it.
    adaptive_three : (c0, c1), optional
        Of `yang_factor_three`. The published c0 is 1 to 1.5; 2.5 loses less on a straight hole (two rows out of many
        agree by chance) and follows a bend as fast.
    forgetting : float, optional
        b of `sage_husa_share`: a common scale of the rows' covariances is learnt.
    least_noise : float
        Floor of that scale.
    fading : float, optional
        Softening of strong tracking, `fading_factor`.
    doubt : float
        Factor on the standard deviation of rows that their own method flagged as doubtful. Those flagged for what may
        put neighbours off together ("disturbed", "step", ...) are no evidence for a bend until twelve were rejected.
    direction_walk : float
        rad/s^0.5, random walk of the direction.
    rate_walk : float
        rad/s^1.5, random walk of its rate; the default lets it change by 1e-5 rad/s (a dogleg of 3 deg/30 m drilled at
        20 m/h) in ten minutes.
    rate_sigma : float
        rad/s, of the rate at the start.
    roll_share : float
        Share of the mean speed by which it may be off where the toolface is carried through a row without an attitude.
    common_tilt, common_turn : float
        rad, standard deviation of errors that all rows share (calibration, reference), about each horizontal axis and
        about the vertical. They are added to the result; the rows' own covariance should not hold them. The
        defaults, 0.006 and 0.011 deg, are of a perfectly calibrated tool in simulated drilling; state your own.
    common_delay : float
        s, standard deviation of the delay between magnetometer and accelerometer, which turns the azimuth of all rows
        of one speed alike (twice the angle turned meanwhile at most dips). About the vertical no more than a row's own
        variance is taken for common: a delay that was found no longer counts.
    longest_bridge : float
        s, without an attitude, after which the filter starts anew.

    Raises
    ------
    InputError
        A value out of its range, both weights at once.
    """

    huber: float | None = None
    igg3: tuple[float, float] | None = (1.5, 4.0)
    adaptive_two: float | None = None
    adaptive_three: tuple[float, float] | None = (2.5, 5.0)
    forgetting: float | None = 0.97
    least_noise: float = 0.25
    fading: float | None = None
    doubt: float = 3.0
    direction_walk: float = 0.0
    rate_walk: float = 4e-7
    rate_sigma: float = 3e-5
    roll_share: float = 0.01
    common_tilt: float = 1e-4
    common_turn: float = 2e-4
    common_delay: float = 1e-4
    longest_bridge: float = 1800.0

    def __post_init__(self) -> None:
        for name, (low, high, unit) in _RANGES.items():
            if getattr(self, name) is not None:
                within(getattr(self, name), name, low, high, unit)
        if self.huber is not None and self.igg3 is not None:
            raise InputError(
                f"huber is {self.huber:g} and igg3 {self.igg3}; choose one weight and give None for the other"
            )
        if self.igg3 is not None:
            igg3_weight(0.0, *self.igg3)
        if self.adaptive_three is not None:
            yang_factor_three(0.0, *self.adaptive_three)
        if self.forgetting is not None:
            sage_husa_share(self.forgetting, 0)


class RobustStream:
    """`robust_filter` fed block by block; the same rows to the last bit.

    A row comes out when the next row with an attitude has come in: a bend and an outlier differ only in what follows.
    """

    def __init__(self, settings: WindowFilterSettings | None = None) -> None:
        chosen = settings or WindowFilterSettings()
        self._recursion = Recursion(chosen)
        self._settings = chosen
        self._waiting: list[Row] = []
        self._before: Row | None = None
        self._last: float = -np.inf
        self._north: str | None = None

    @property
    def common(self) -> Common:
        """Standard deviations of what all rows share."""
        chosen = self._settings
        return Common(chosen.common_tilt, chosen.common_turn, chosen.common_delay)

    def push(self, rows: Attitude) -> Attitude:
        """Rows that became complete.

        Raises
        ------
        InputError
            Rows that are not after the last one, or count azimuth from another north.
        """
        return self._result(self.steps(rows))

    def finish(self) -> Attitude:
        """The rows still waiting for a neighbour."""
        return self._result(self.last_steps())

    def steps(self, rows: Attitude) -> list[Step]:
        """As `push`, with what a backward pass needs."""
        if self._north not in (None, rows.north):
            raise InputError(f"the rows count azimuth from {rows.north} north, those before from {self._north}")
        self._north = rows.north
        done: list[Step] = []
        for place in range(len(rows)):
            row = _row(rows, place)
            if not row.time > self._last:
                raise InputError(f"time[{place}] is {row.time:.9g} s, not after {self._last:.9g} s; sort the rows")
            self._last = row.time
            if row.matrix is not None:
                done += self._release(row)
            self._waiting.append(row)
            if row.time - self._waiting[0].time > self._settings.longest_bridge or all(
                w.matrix is None for w in self._waiting
            ):
                done += self._release(None)
        return done

    def last_steps(self) -> list[Step]:
        """As `finish`."""
        return self._release(None)

    def _release(self, after: Row | None) -> list[Step]:
        done = []
        for row in self._waiting:
            done.append(self._recursion.step(row, self._before, after))
            self._before = row if row.matrix is not None else self._before
        self._waiting = []
        return done

    def _result(self, steps: list[Step]) -> Attitude:
        return attitude_of(steps, self._north or "magnetic", "robust", self.common)


def robust_filter(rows: Attitude, settings: WindowFilterSettings | None = None) -> Attitude:
    """Filter window attitudes into the direction of the hole, robustly; toolface stays that of each window.

    Parameters
    ----------
    rows : Attitude
        Of windows that share no samples, from any method; refused rows are bridged. Rows that know no azimuth count for
        inclination only.
    settings : WindowFilterSettings, optional

    Returns
    -------
    Attitude
        A row for each row given. Rows with a weight below 0.1 carry the flag "misfit", their direction is the filter's.
        Refused rows keep their flags and have an attitude: direction predicted with growing uncertainty, toolface
        carried by the mean speed where that is known and otherwise with the uncertainty of an unknown angle. Rows
        before the first with an azimuth are returned as they came; first rows that the next one contradicts are
        flagged "start" and their uncertainty covers the contradiction, for either may be the outlier. The
        covariance holds when the rows' own does and their errors are independent; what all rows share does not average
        out and is stated by `common_tilt` and `common_turn`.

    Raises
    ------
    InputError
        Times that do not increase.

    Notes
    -----
    State: rotation vector (x, y) of the hole's direction in a frame that moves with it, and its rate; the rate walks at
    random. The toolface is not filtered: while the string turns, a window's toolface says nothing about the next. It
    takes part through its correlation with the direction's error (`_hole_direction.rolled`).

    Each row: prediction; Yang's factor on the mean of the row and the neighbour, before or after, that agrees with it
    (two rows that agree against the prediction are a bend, one alone is an outlier); weight of the normalised
    innovation t = sqrt(v' S^-1 v / 2), S = P + R, which divides R; update.

    Examples
    --------
    >>> from inclinometry.motion.result import refusals
    >>> rows = refusals([5.0, 15.0], ["clipped"], "magnetic", "magnetic")
    >>> bool(robust_filter(rows).refused.all())
    True
    """
    stream = RobustStream(settings)
    steps = stream.steps(rows) + stream.last_steps()
    return attitude_of(steps, rows.north, "robust", stream.common, rows.notes)


def _row(rows: Attitude, place: int) -> Row:
    q = rows.quaternion[place]
    known = not np.isnan(q[0])
    return Row(
        float(rows.time[place]),
        dcm_from_quaternion(q) if known else None,
        rows.covariance[place] + LEAST_VARIANCE * np.eye(3) if known else None,
        float(rows.rate[place]),
        float(rows.quality[place]),
        int(rows.flags[place]),
    )

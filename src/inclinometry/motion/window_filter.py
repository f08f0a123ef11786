"""Robust adaptive filter of windows: the direction of the hole followed through outlying, refused and missing rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from inclinometry.attitude.rotations import dcm_from_quaternion
from inclinometry.core.errors import InputError
from inclinometry.core.settings import Range, Settings
from inclinometry.motion._window_model import Common, Row, Step, attitude_of
from inclinometry.motion._window_recursion import Recursion
from inclinometry.motion.adaptive import sage_husa_share, yang_factor_three
from inclinometry.motion.result import Attitude
from inclinometry.motion.robust import igg3_weight

LEAST_VARIANCE: Final = 1e-16
"""Of a row about any axis, rad^2: rows that claim to be exact stay invertible."""


@dataclass(frozen=True, kw_only=True)
class WindowFilterSettings(Settings):
    """Which parts of the robust adaptive filter are on, and how fast a hole may bend; None switches a part off.

    Rows flagged for what may put neighbours off together ("disturbed", "step", ...) are no evidence for a bend until
    twelve were rejected. The common standard deviations are of errors that all rows share; they are added to the
    result, the rows' own covariance should not hold them.
    """

    huber: Annotated[float | None, Range(0.1, 100.0), "k of `huber_weight`; excludes igg3."] = None
    igg3: Annotated[tuple[float, float] | None, "(k0, k1) of `igg3_weight`."] = (1.5, 4.0)
    adaptive_two: Annotated[float | None, Range(0.1, 100.0), "c of `yang_factor_two`, on two rows that agree."] = None
    adaptive_three: Annotated[
        tuple[float, float] | None,
        "(c0, c1) of `yang_factor_three`.",
    ] = (2.5, 5.0)
    forgetting: Annotated[float | None, "b of `sage_husa_share`: a common scale of covariances is learnt."] = 0.97
    least_noise: Annotated[float, Range(1e-6, 1.0), "Floor of that scale."] = 0.25
    fading: Annotated[float | None, Range(1.0, 1e3), "Softening of strong tracking, `fading_factor`."] = None
    doubt: Annotated[float, Range(1.0, 1e3), "On the standard deviation of rows flagged as doubtful."] = 3.0
    direction_walk: Annotated[float, Range(0.0, 1.0, "rad/s^0.5"), "Random walk of the direction."] = 0.0
    rate_walk: Annotated[float, Range(0.0, 1.0, "rad/s^1.5"), "Of its rate: 1e-5 rad/s in ten minutes."] = 4e-7
    rate_sigma: Annotated[float, Range(1e-12, 1.0, "rad/s"), "Of the rate at the start."] = 3e-5
    roll_share: Annotated[float, Range(0.0, 1.0), "Of the mean speed, where the toolface is carried over a gap."] = 0.01
    common_tilt: Annotated[float, Range(0.0, 1.0, "rad"), "Common to all rows, about horizontal axes."] = 1e-4
    common_turn: Annotated[float, Range(0.0, 3.0, "rad"), "Common to all rows, about the vertical."] = 2e-4
    common_delay: Annotated[float, Range(0.0, 0.1, "s"), "Between magnetometer and accelerometer."] = 1e-4
    longest_bridge: Annotated[float, Range(0.0, 1e7, "s"), "Without an attitude; then the filter starts anew."] = 1800.0

    def __post_init__(self) -> None:
        super().__post_init__()
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

"""Robust adaptive filter of windows: the direction of the hole followed through outlying, refused and missing rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Mask
from inclinometry.errors import out_of_order, out_of_range, refused
from inclinometry.findings import Finding
from inclinometry.motion._hole_direction import (
    azimuth_unknown,
    carried,
    clean,
    observe,
    rolled,
    turned,
    with_azimuth,
)
from inclinometry.motion.result import BITS, CHANNELS, LARGEST_BREAK, METHODS, Attitude, Samples, joined
from inclinometry.motion.robust import (
    fading_factor,
    huber_weight,
    igg3_weight,
    sage_husa,
    sage_husa_share,
    yang_factor_three,
    yang_factor_two,
)
from inclinometry.rotations import dcm_from_quaternion, quaternion_from_dcm
from inclinometry.settings import Range, Settings
from inclinometry.tabular import check_record
from inclinometry.uncertainty import UNKNOWN

# Equal windows of a stream of samples, the same however the stream is cut into blocks.


Columns = dict[str, NDArray[Any]]


class Stream(Protocol):
    """What every recursive method is."""

    def push(self, samples: Samples) -> Attitude:
        """Rows that became complete."""
        ...

    def finish(self) -> Attitude:
        """The last rows, and what was found."""
        ...


class WindowBuffer:
    """Collects blocks and hands out whole windows of `seconds`; a gap closes the window.

    Windows are cut from one contiguous copy, so that sums over them do not depend on the blocks; a window's grid starts
    at the stamp of its own first sample.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._interval = 0.0
        self._parts: list[Columns] = []
        self._held = 0

    def push(self, block: Samples) -> list[Samples]:
        """Windows that became complete."""
        if not len(block):
            return []
        columns, done = columns_of(block), []
        if self._held:
            first = self._parts[0]
            if block.interval != self._interval or columns.keys() != first.keys():
                raise refused("input-block")
            at = float(columns["time"][0])
            slack = LARGEST_BREAK * block.interval + 4.0 * float(np.spacing(abs(at)))
            if not abs(at - (first["time"][0] + block.interval * self._held)) <= slack:
                done = self.finish()
        self._interval = block.interval
        self._parts.append(columns)
        self._held += len(block)
        size = max(round(self._seconds / block.interval), 1)
        if self._held < size:
            return done
        held = joined_columns(self._parts)
        whole = self._held // size * size
        done += [self._window(held, start, start + size) for start in range(0, whole, size)]
        self._held -= whole
        self._parts = [{name: values[whole:].copy() for name, values in held.items()}] if self._held else []
        return done

    def finish(self) -> list[Samples]:
        """The rest, when it fills a good part of a window."""
        held, parts = self._held, self._parts
        self._held, self._parts = 0, []
        # a rest of half a window is a window of its own
        if not held or held < 0.5 * max(round(self._seconds / self._interval), 1):
            return []
        return [self._window(joined_columns(parts), 0, held)]

    def _window(self, held: Columns, start: int, stop: int) -> Samples:
        cut = {name: values[start:stop] for name, values in held.items() if name != "time"}
        return Samples(held["time"][start] + self._interval * np.arange(stop - start), self._interval, **cut)


class WindowStream:
    """Windows of `seconds` reduced one by one as they become complete; `nothing` is the table without rows."""

    def __init__(self, seconds: float, reduce: Callable[[Samples], Attitude], nothing: Attitude) -> None:
        self._buffer, self._reduce, self._nothing = WindowBuffer(seconds), reduce, nothing

    def push(self, samples: Samples) -> Attitude:
        """Rows of the windows that became complete with this block.

        Raises
        ------
        InputError
            A block without the triads needed, or unlike those before it.
        """
        return self._rows(self._buffer.push(samples))

    def finish(self) -> Attitude:
        """The row of the rest, when it fills half a window."""
        return self._rows(self._buffer.finish())

    def _rows(self, windows: list[Samples]) -> Attitude:
        rows = [self._reduce(bridged(window)) for window in windows]
        return joined([self._nothing, *rows]) if rows else self._nothing

    def whole(self, samples: Samples) -> Attitude:
        """Rows of a run given at once."""
        return joined([self.push(samples), self.finish()])


def columns_of(block: Samples) -> Columns:
    """Time, marks and what channels there are."""
    clipped = np.zeros(len(block), np.bool_) if block.clipped is None else block.clipped
    found: Columns = {"time": block.time, "clipped": clipped}
    for name in (*CHANNELS, "temperature"):
        values = getattr(block, name)
        if values is not None:
            found[name] = values
    return found


def joined_columns(parts: list[Columns]) -> Columns:
    """One contiguous stretch."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def bridged(window: Samples) -> Samples:
    """The window with its missing samples (all channels held) predicted; clipped samples stay marked."""
    if window.clipped is None or not window.clipped.any():
        return window
    triads = {name: getattr(window, name) for name in CHANNELS if window.has(name)}
    lost = window.clipped & (np.arange(len(window)) > 0)  # of the first sample nothing tells
    for values in triads.values():
        lost[1:] &= (values[1:] == values[:-1]).all(axis=1)
    most_lost = 0.3  # of a window, beyond which too little is left to predict from
    if not lost.any() or lost.mean() > most_lost:
        return window
    found: dict[str, Any] = {
        name: np.stack([_predicted(column, lost) for column in values.T], axis=1) for name, values in triads.items()
    }
    return replace(window, clipped=window.clipped & ~lost, **found)


def _predicted(values: Array, lost: Mask) -> Array:
    """Values (n,) with the lost ones those of least prediction error by the series' own autoregression.

    Janssen A.J.E.M., Veldhuis R.N.J., Vries L.B., IEEE Trans. ASSP 34, 1986. A mean of shaking samples with single
    ones held or left out errs by the shaking itself over the root of their number.
    """
    from scipy.linalg import solve_toeplitz, solveh_banded

    order, places = min(32, values.size // 8), np.flatnonzero(lost)
    series = np.where(lost, np.interp(np.arange(values.size), np.flatnonzero(~lost), values[~lost]), values)
    for _ in range(2 if order else 0):  # the first pass knows the spectrum from lines across the gaps
        mean = float(series.mean())
        x = series - mean
        lags = np.array([float(x[: x.size - k] @ x[k:]) for k in range(order + 1)])
        if not lags[0] > 1e-18 * x.size * (mean**2 + lags[0]):
            break
        lags[0] *= 1.0 + 1e-9
        error = np.append(1.0, -solve_toeplitz(lags[:-1], lags[1:]))
        weights = np.correlate(error, error, "full")
        known = np.pad(np.where(lost, 0.0, x), order, "reflect", reflect_type="odd")
        right = -np.convolve(known, weights, "valid")[places]
        apart = [places[k:] - places[: places.size - k] for k in range(min(order + 1, places.size))]
        band = [np.where(d <= order, weights[order + np.minimum(d, order)], 0.0) for d in apart if d.min() <= order]
        matrix = np.stack([np.pad(one, (places.size - one.size, 0)) for one in band[::-1]])
        series[places] = mean + solveh_banded(matrix, right)
    return series


# Direction of the hole as a constant-rate motion: what the passes over windows carry, and one step of it.

BIASED: Final = sum(BITS[name] for name in ("disturbed", "step", "aliased", "axes", "stuck"))
"""Flags of rows that may be off together: no evidence for a bend of the hole."""
LOW_WEIGHT: Final = 0.1
"""Weight below which a row is flagged as a misfit."""


class Row(NamedTuple):
    """One row as the passes see it; matrix and covariance are None where it was refused.

    covariance : its own part. common : (3, 3) the part shared with other rows, 0 where a method does not separate it.
    """

    time: float
    matrix: Array | None
    covariance: Array | None
    common: Array
    rate: float
    quality: float
    flags: int

    @property
    def suspect(self) -> bool:
        """Whether its own method flags it: its uncertainty is counted larger."""
        suspect = BIASED | sum(BITS[name] for name in ("clipped", "vibration", "misfit", "not-still"))
        return bool(self.flags & suspect)

    @property
    def usable_for_bend(self) -> bool:
        """Whether the row may testify to a bend."""
        return self.has_direction and not self.flags & BIASED

    @property
    def has_direction(self) -> bool:
        """Whether the row tells a whole direction."""
        if self.matrix is None or self.covariance is None:
            return False
        return not azimuth_unknown(self.matrix, self.covariance + self.common)


@dataclass(frozen=True, eq=False)
class Belief:
    """Frame of the hole, its rate of turn (2,) rad/s in it, and the covariance (4, 4) of offset and rate.

    common : (2, 2) the offset's shared part; it does not average out and is not in the covariance.
    """

    time: float
    frame: Array
    rate: Array
    covariance: Array
    common: Array

    def tool(self, matrix: Array, covariance: Array, common: Array) -> tuple[Array, Array, Array]:
        """Attitude, covariance and common part (3, 3) of a tool whose roll a row has measured, with its own two."""
        part = rolled(self.frame, self.common, matrix, common + 1e-16 * np.eye(3))[1]
        return *rolled(self.frame, self.covariance[:2, :2] + self.common, matrix, covariance + common), part

    def carried(self, roll: float, variance: float) -> tuple[Array, Array, Array]:
        """The same of a roll that no row measures."""
        whole = carried(self.frame, self.covariance[:2, :2] + self.common, roll, variance)
        return *whole, carried(self.frame, self.common, roll, variance)[1]


class Step(NamedTuple):
    """One row done."""

    row: Row
    # predicted, belief: before and after the row; None before the first attitude
    predicted: Belief | None
    belief: Belief | None
    # matrix, covariance, common: of the tool; None where there is none to give
    matrix: Array | None
    covariance: Array | None
    common: Array | None
    rate: float
    # roll, roll_variance: of the tool in the frame of `belief`
    roll: float
    roll_variance: float
    factor: float  #: on the row's covariance: flags, noise scale and weight together
    weight: float  #: robust weight of the row's measurement; 0 where it had none
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
    frame, covariance = clean(turned(predicted.frame, change[:2])), 0.5 * (covariance + covariance.T)
    return Belief(predicted.time, frame, predicted.rate + change[2:], covariance, predicted.common)


def shared(predicted: Belief, common: Array) -> tuple[Belief, Array]:
    """The prediction, and what a row's noise is larger by, where they share no more than the smaller of two parts.

    What one of them has more of `common` (2, 2), of inclination or of azimuth, is an error of its own: in rows before a
    lag was known, or of another speed.
    """
    down = predicted.frame[:2, 2] if np.hypot(*predicted.frame[:2, 2]) > 1e-6 else np.array([1.0, 0.0])
    axes = np.array([[down[0], -down[1]], [down[1], down[0]]]) / np.hypot(*down)
    old, new = (np.diagonal(axes.T @ part @ axes) for part in (predicted.common, common))
    less, more = ((axes * np.maximum(part, 0.0)) @ axes.T for part in (old - new, new - old))
    keep = (axes * np.sqrt(np.minimum(new / np.maximum(old, 1e-300), 1.0))) @ axes.T
    covariance = predicted.covariance.copy()
    covariance[:2, :2] += less
    return replace(predicted, covariance=covariance, common=keep @ predicted.common @ keep.T), more


def attitude_of(steps: list[Step], north: str, method: str, findings: tuple[Finding, ...] = ()) -> Attitude:
    """Rows of a pass as the common result; measured rows with a low weight are flagged as misfits."""
    size = len(steps)
    quaternion, covariance = np.full((size, 4), np.nan), np.full((2, size, 3, 3), np.nan)
    flags = np.array([step.row.flags for step in steps], dtype=np.uint32)
    for place, step in enumerate(steps):
        if step.matrix is None or step.covariance is None:
            continue
        quaternion[place] = quaternion_from_dcm(step.matrix)
        covariance[:, place] = step.covariance, step.covariance if step.common is None else step.common
        if step.belief is not None and step.row.matrix is not None and step.weight < LOW_WEIGHT:
            flags[place] |= BITS["misfit"]
    return Attitude(
        time=np.array([step.row.time for step in steps]),
        quaternion=quaternion,
        covariance=covariance[0],
        common=covariance[1],
        rate=np.array([step.rate for step in steps]),
        quality=np.array([step.quality for step in steps]),
        flags=flags,
        method=np.full(size, METHODS.index(method), dtype=np.uint8),
        north=north,
        findings=findings,
    )


# The forward pass over windows: prediction, adaptive factor, robust weight, update, one row at a time.

LARGEST: Final = 4.0
"""Normalised innovation that Sage-Husa does not learn from and quality calls hopeless."""
AGREE: Final = 3.0
"""Normalised distance up to which two rows tell the same direction."""


class Recursion:
    """State of the forward pass; `step` takes a row with the attitudes beside it."""

    def __init__(self, tuning: WindowFilterSettings) -> None:
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
        belief = self._belief
        dt = row.time - belief.time
        f = transition(dt)
        moved = f @ belief.covariance @ f.T
        added = process(dt, self._tuning.direction_walk, self._tuning.rate_walk)
        if self._tuning.fading is not None and self._spread is not None:
            moved = moved * fading_factor(self._spread, added[:2, :2], self._noise, moved[:2, :2], self._tuning.fading)
        predicted = Belief(row.time, predicted_frame(belief, dt), belief.rate, moved + added, belief.common)
        rate = row.rate if np.isfinite(row.rate) else self._rate
        # rad/s below which a tool is taken not to rotate in a window that does not tell
        if not np.isfinite(rate) or (abs(rate) > 1e-2 and not bool(np.isfinite(row.rate))):
            self._roll_variance = UNKNOWN**2
        else:
            self._roll += rate * dt
            # 1e-4 rad/s: standard deviation of the mean speed of a tool that does not rotate
            spread = (self._tuning.roll_share * abs(rate) + 1e-4) * dt
            self._roll_variance = min(self._roll_variance + spread**2, UNKNOWN**2)
        if row.matrix is None or row.covariance is None:
            self._belief = predicted
            tool = predicted.carried(self._roll, self._roll_variance)
            quality = max(1.0 - (row.time - self._seen_at) / self._tuning.longest_bridge, 0.0)
            return Step(row, predicted, predicted, *tool, rate, self._roll, self._roll_variance, 1.0, 0.0, quality)
        return self._update(row, row.matrix, row.covariance, self._adapted(predicted, row, before, after))

    def _start(self, row: Row, after: Row | None) -> Step:
        matrix, covariance = row.matrix, row.covariance
        if matrix is None or covariance is None:
            return Step(row, None, None, None, None, None, row.rate, 0.0, 0.0, 1.0, 0.0, row.quality)
        total = covariance + row.common
        if azimuth_unknown(matrix, total):
            return Step(row, None, None, matrix, total, None, row.rate, 0.0, 0.0, 1.0, 0.0, row.quality)
        full = np.diag([0.0, 0.0, self._tuning.rate_sigma**2, self._tuning.rate_sigma**2])
        full[:2, :2] = covariance[:2, :2]
        belief = Belief(row.time, matrix, np.zeros(2), full, row.common[:2, :2])
        apart, robust = 0.0, self._tuning.igg3 is not None or self._tuning.huber is not None
        if robust and after is not None and after.matrix is not None and after.covariance is not None:
            # normalised distance of the first row from the next: either may be the outlier
            level = with_azimuth(after.matrix, after.covariance + after.common, belief.frame[2])
            own, more = shared(belief, observe(belief.frame, level, after.common)[1])
            offset, noise, _ = observe(belief.frame, level, after.covariance)
            apart = _size(offset, own.covariance[:2, :2] + noise + more)
        if apart > AGREE:
            flagged_row = row._replace(flags=row.flags | BITS["start"])
            wide = 2.0 * apart**2 * covariance + row.common
            return Step(flagged_row, None, None, matrix, wide, None, row.rate, 0.0, 0.0, 1.0, 0.0, 0.0)
        variance = float(total[2, 2])
        common = row.common if row.common.any() else None
        step = Step(row, None, belief, matrix, total, common, row.rate, 0.0, variance, 1.0, 1.0, row.quality)
        return self._done(step)

    def _adapted(self, predicted: Belief, row: Row, before: Row | None, after: Row | None) -> Belief:
        """Prediction with its direction flagged by Yang's factor where this row and a neighbour agree against it."""
        tuning = self._tuning
        if tuning.adaptive_two is None and tuning.adaptive_three is None:
            return predicted
        # mean offset of this row and the neighbour it agrees with best, with its noise; None when with neither
        own = self._measurement(predicted, row, row.time)
        found, least = None, AGREE
        for each in (before, after):
            other = None if each is None else self._measurement(predicted, each, row.time)
            if own is None or other is None:
                continue
            apart = _size(own[0] - other[0], own[1] + other[1])
            if apart < least:
                least, found = apart, (0.5 * (own[0] + other[0]), 0.25 * (own[1] + other[1]))
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

    def _measurement(self, predicted: Belief, row: Row, time: float) -> tuple[Array, Array] | None:
        """Offset and noise of a row from the prediction for `time`; None when the row is no evidence."""
        if row.matrix is None or row.covariance is None or not row.has_direction:
            return None
        # after twelve rejected one after another flagged ones are evidence too: a wrong reference flags them all
        if not row.usable_for_bend and self._rejected < 12:
            return None
        offset, noise, _ = observe(predicted.frame, row.matrix, row.covariance)
        more = shared(predicted, observe(predicted.frame, row.matrix, row.common)[1])[1]
        return offset - predicted.rate * (row.time - time), noise * self._scale + more

    def _update(self, row: Row, matrix: Array, covariance: Array, predicted: Belief) -> Step:
        step, offset, noise, size = measured(self._tuning, row, matrix, covariance, predicted, self._scale)
        self._rejected = self._rejected + 1 if step.weight < LOW_WEIGHT else 0
        # scale of the rows' covariance by Sage-Husa, and the spread of innovations for strong tracking
        tuning = self._tuning
        if tuning.forgetting is not None and size < LARGEST:
            # 30 windows' worth of trust in the rows' own covariance before any was seen
            share = sage_husa_share(tuning.forgetting, self._counted + 30)
            inverse = np.linalg.inv(noise)
            innovation = np.sqrt(0.5 * offset @ inverse @ offset)
            part = 0.5 * np.trace(inverse @ predicted.covariance[:2, :2])
            self._scale = float(sage_husa([[self._scale]], [innovation], [[part]], share, tuning.least_noise)[0, 0])
            self._counted += 1
        square = np.outer(offset, offset)
        old = self._spread
        memory = 0.95
        self._spread = square if old is None else (memory * old + square) / (1.0 + memory)
        self._noise = noise * self._scale
        return self._done(step)

    def _done(self, step: Step) -> Step:
        self._belief, self._seen_at = step.belief, step.row.time
        self._roll, self._roll_variance = step.roll, step.roll_variance
        if np.isfinite(step.rate):
            self._rate = step.rate
        return step


def measured(
    tuning: WindowFilterSettings, row: Row, matrix: Array, covariance: Array, predicted: Belief, scale: float
) -> tuple[Step, Array, Array, float]:
    """Row taken into a prediction with its robust weight; also its offset, that one's noise, and how large it is."""
    matrix = with_azimuth(matrix, covariance + row.common, predicted.frame[2])
    widening = tuning.suspect_factor**2 if row.suspect else 1.0
    predicted, more = shared(predicted, observe(predicted.frame, matrix, row.common)[1])
    offset, noise, _ = observe(predicted.frame, matrix, widening * covariance)
    size = _size(offset, predicted.covariance[:2, :2] + noise * scale + more)
    weight = 1.0
    if tuning.huber is not None:
        weight = float(huber_weight(size, tuning.huber))
    if tuning.igg3 is not None:
        weight = float(igg3_weight(size, *tuning.igg3))
    # a rejected row keeps its roll with a thousandfold standard deviation
    factor = widening * scale / max(weight, 1e-6)
    belief = updated(predicted, offset, (noise * scale + more) / max(weight, 1e-6))
    out, joint, common = belief.tool(matrix, factor * covariance, row.common)
    roll = observe(belief.frame, out, joint)[2]
    quality = min(row.quality, max(1.0 - size / LARGEST, 0.0))
    known, kept = row._replace(matrix=matrix), common if row.common.any() else None
    step = Step(known, predicted, belief, out, joint, kept, row.rate, roll, float(joint[2, 2]), factor, weight, quality)
    return step, offset, noise, size


def _size(offset: Array, spread: Array) -> float:
    """Normalised length of an offset: 1 on the average when the spread is right."""
    return float(np.sqrt(0.5 * offset @ np.linalg.solve(spread, offset)))


@dataclass(frozen=True, kw_only=True)
class WindowFilterSettings(Settings):
    """Which parts of the robust adaptive filter are on, and how fast a hole may bend; None switches a part off.

    Rows flagged for what may put neighbours off together ("disturbed", "step", ...) are no evidence for a bend until
    twelve were rejected.
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
    suspect_factor: Annotated[float, Range(1.0, 1e3), "On the standard deviation of rows flagged as suspect."] = 3.0
    direction_walk: Annotated[float, Range(0.0, 1.0, "rad/s^0.5"), "Random walk of the direction."] = 0.0
    rate_walk: Annotated[float, Range(0.0, 1.0, "rad/s^1.5"), "Of its rate: 1e-5 rad/s in ten minutes."] = 4e-7
    rate_sigma: Annotated[float, Range(1e-12, 1.0, "rad/s"), "Of the rate at the start."] = 3e-5
    roll_share: Annotated[float, Range(0.0, 1.0), "Of the mean speed, where the toolface is carried over a gap."] = 0.01
    longest_bridge: Annotated[float, Range(0.0, 1e7, "s"), "Without an attitude; then the filter starts again."] = (
        1800.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.huber is not None and self.igg3 is not None:
            raise out_of_range("huber, igg3", f"{self.huber:g}, {self.igg3}", "huber | igg3")
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
        self.settings = chosen
        self._waiting: list[Row] = []
        self._before: Row | None = None
        self._last: float = -np.inf
        self._north: str | None = None

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
            raise refused("input-north", {"norths": (self._north, rows.north)})
        self._north = rows.north
        done: list[Step] = []
        for place in range(len(rows)):
            q, whole, common = rows.quaternion[place], rows.covariance[place], rows.common[place]
            known = not np.isnan(q[0])
            # where a method does not tell them apart, rows count as independent
            common = common if known and np.trace(common) < np.trace(whole) else np.zeros((3, 3))
            row = Row(
                float(rows.time[place]),
                dcm_from_quaternion(q) if known else None,
                whole - (1.0 - 1e-4) * common + 1e-16 * np.eye(3) if known else None,  # stays invertible
                common,
                float(rows.rate[place]),
                float(rows.quality[place]),
                int(rows.flags[place]),
            )
            if not row.time > self._last:
                raise out_of_order("time", row.time, self._last, int(place) + 1)
            self._last = row.time
            if row.matrix is not None:
                done += self._release(row)
            self._waiting.append(row)
            if row.time - self._waiting[0].time > self.settings.longest_bridge or all(
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
        return attitude_of(steps, self._north or "magnetic", "robust")


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
        covariance holds when the rows' own does. What they share (`Attitude.common`) does not average out and is added;
        rows that do not tell it apart count as independent.

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
    check_record(rows, Attitude, "robust_filter")
    stream = RobustStream(settings)
    steps = stream.steps(rows) + stream.last_steps()
    return attitude_of(steps, rows.north, "robust", rows.findings)

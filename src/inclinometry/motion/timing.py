"""Raw time stamps and channels, in blocks of any size, cut into evenly sampled stretches; nothing is mended silently.

Small gaps keep the grid: places without a reading hold the reading before them and are marked `clipped`. Larger gaps,
and a clock that leaves the grid, end the stretch. Rows that repeat the row before them are dropped and counted; time
that runs backwards is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, within
from inclinometry.errors import InputError
from inclinometry.motion.decimate import MOST_JITTER, NOBODY, Grid, fit_grid
from inclinometry.motion.result import CHANNELS, Samples
from inclinometry.motion.window_filter import columns_of, joined_columns

# What was found in a run's time stamps, and the sentences that say so.

LISTED: Final = 20
"""Gaps and intervals that are kept one by one."""


class Gap(NamedTuple):
    """A place where a stretch was cut: s of the last stamp before and the first after, and why."""

    before: float
    after: float
    reason: str


@dataclass
class TimingReport:
    """What was found in the stamps so far.

    Attributes
    ----------
    rows, repeats, shared, filled : int
        Rows read; rows dropped because they repeat the row before; because the place nearest to their stamp was taken;
        places of the grid without a reading.
    stretches : int
    intervals : list of float
        s, of the stretches, without repetition.
    jitter, most_jitter : float
        s, largest root mean square and largest single departure of stamps from the grid.
    gaps : list of Gap
        The first `LISTED`; `cuts` counts all.
    missing : dict
        Channel -> readings that were not numbers.
    absent : tuple of str
        Triads without any value among the first rows, left out.
    """

    rows: int = 0
    repeats: int = 0
    shared: int = 0
    filled: int = 0
    stretches: int = 0
    cuts: int = 0
    intervals: list[float] = field(default_factory=list)
    jitter: float = 0.0
    most_jitter: float = 0.0
    gaps: list[Gap] = field(default_factory=list)
    missing: dict[str, int] = field(default_factory=dict)
    absent: tuple[str, ...] = ()

    def add_interval(self, interval: float) -> None:
        """Note the interval of a stretch, once."""
        if interval not in self.intervals and len(self.intervals) <= LISTED:
            self.intervals.append(interval)

    def notes(self) -> tuple[str, ...]:
        """Sentences for the user; none where nothing had to be mended."""
        said = []
        if self.repeats:
            said.append(f"{self.repeats} of {self.rows} rows repeat the row before them (stamp and readings): dropped")
        if self.shared:
            said.append(f"the stamps of {self.shared} rows are nearest to a place that is taken: dropped")
        if self.filled:
            said.append(f"{self.filled} samples are missing in small gaps: their places are kept and not used")
        for gap in self.gaps:
            said.append(f"the run was cut between {gap.before:.9g} s and {gap.after:.9g} s: {gap.reason}")
        if self.cuts > len(self.gaps):
            said.append(f"and at {self.cuts - len(self.gaps)} more places likewise")
        if len(self.intervals) > 1:
            said.append(
                "the sampling interval changes: " + ", ".join(f"{one:.6g} s" for one in self.intervals[:LISTED])
            )
        if self.intervals and self.jitter > 0.1 * min(self.intervals):
            said.append(f"the stamps jitter by {self.jitter:.3g} s (root mean square, the worst stretch)")
        for name, count in self.missing.items():
            said.append(f"{name} has no value in {count} of {self.rows} rows: these samples are not used")
        for triad in self.absent:
            said.append(f"{triad} has no value in the first rows: the triad is left out")
        return tuple(said)


GATHERED: Final = 1024
"""Rows the grid of a stretch is fitted to."""
FEWEST: Final = 16
"""Rows that can tell a grid from chance."""
FOLLOWED: Final = 64
"""Stamps whose mean departure tells that the clock leaves the grid,"""
_NONE: Final = np.zeros((FOLLOWED, 2), dtype=np.int64)


@dataclass(frozen=True, kw_only=True)
class TimingSettings:
    """What is tolerated.

    Parameters
    ----------
    fill : int
        Most missing samples in a row that keep the grid, their places marked; more cut the stretch. Default 5: less
        than a tenth of a window of any method.
    most_missing : float
        Share of the first rows in which a triad may have no value; more is taken for a slower sensor and refused.
    """

    fill: int = 5
    most_missing: float = 0.5

    def __post_init__(self) -> None:
        within(self.fill, "fill", 0, 1000, "samples")
        within(self.most_missing, "most_missing", 0.0, 1.0)


class Piece(NamedTuple):
    """Samples of stretch `number`; pieces of one number follow each other without a gap."""

    number: int
    samples: Samples


class StretchCutter:
    """Stream of raw rows -> pieces of even stretches, the same whatever blocks the rows come in.

    Parameters
    ----------
    settings : TimingSettings, optional

    Notes
    -----
    The first `GATHERED` rows of a stretch are held back to find the grid (`fit_grid`); pieces carry the times of the
    grid. A channel without a number holds its last value, and the sample is marked `clipped`.

    Examples
    --------
    >>> cutter = StretchCutter()
    >>> time = np.delete(np.arange(40) * 0.01, [10, 11])
    >>> pieces = [*cutter.push(time, gyro=np.ones((38, 3))), *cutter.finish()]
    >>> [(piece.number, len(piece.samples), int(piece.samples.clipped.sum())) for piece in pieces]
    [(0, 40, 2)]
    >>> cutter.report.notes()
    ('2 samples are missing in small gaps: their places are kept and not used',)
    """

    def __init__(self, settings: TimingSettings | None = None) -> None:
        self.settings = settings or TimingSettings()
        self.report = TimingReport()
        self._given: tuple[str, ...] | None = None  # names of the columns of the first block
        self._kept: tuple[str, ...] | None = None  # of them, those with values among the first rows
        self._time = np.empty(0)  # rows that wait for a grid
        self._rows = np.empty((0, 0))
        self._last: tuple[float, Array] | None = None  # last row read
        self._grid: Grid | None = None
        self._place = -1  # of the grid, last sample given out
        self._stamp = 0.0  # its stamp
        self._held = np.empty(0)  # its readings, mended
        self._before = NOBODY
        self._trace = _NONE  # of the stamps before: departure, places skipped
        self._known: float | None = None
        self._ragged = 0

    def push(
        self,
        time: ArrayLike,
        accel: ArrayLike | None = None,
        mag: ArrayLike | None = None,
        gyro: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
    ) -> list[Piece]:
        """Rows in, pieces that became certain out.

        Parameters
        ----------
        time : (n,) array_like
            s.
        accel, mag, gyro : (n, 3) array_like, optional
            As `Samples`, but NaN where there is no value.
        temperature : (n,) array_like, optional

        Raises
        ------
        InputError
            Time not finite or running backwards, one stamp with different readings, stamps too irregular for any grid,
            a triad missing in most rows, columns other than in the first block.
        """
        t = finite(time, "time", (None,))
        # the columns side by side, (n, m)
        given = {"accel": accel, "mag": mag, "gyro": gyro, "temperature": temperature}
        names = tuple(name for name, value in given.items() if value is not None)
        if self._given is None:
            if not set(names) & set(CHANNELS):
                raise InputError(f"no triad is given; one or more of {', '.join(CHANNELS)} is needed")
            self._given = names
            self._rows = np.empty((0, sum(1 if name == "temperature" else 3 for name in names)))
        if names != self._given:
            raise InputError(f"this block has {', '.join(names)}; the blocks before had {', '.join(self._given)}")
        parts = []
        for name in names:
            width = 1 if name == "temperature" else 3
            part = np.asarray(given[name], dtype=np.float64).reshape(-1, width)
            if len(part) != t.size:
                raise InputError(f"{name} has {len(part)} rows, time {t.size}; they must be the same")
            parts.append(part)
        rows = np.concatenate(parts, axis=1)
        if t.size == 0:
            return []
        fresh = self._in_order(t, rows)
        self._last = (float(t[-1]), rows[-1].copy())
        self.report.rows += t.size
        self._time = np.concatenate([self._time, t[fresh]])
        self._rows = np.concatenate([self._rows, rows[fresh]])
        return self._advance(final=False)

    def finish(self) -> list[Piece]:
        """The pieces still held back; the cutter is empty afterwards."""
        return self._advance(final=True)

    def _in_order(self, t: Array, rows: Array) -> Mask:
        """Rows (n,) that do not repeat the one before; InputError where time runs backwards."""
        first = t[0] - 1.0 if self._last is None else self._last[0]
        before = np.concatenate([[first], t[:-1]])
        back = np.flatnonzero(t < before)
        if back.size:
            row = int(back[0])
            raise InputError(
                f"time of row {self.report.rows + row} is {t[row]:.12g} s, that of the row before {before[row]:.12g} s;"
                " time must not run backwards: sort the rows, or cut the run where the clock was set"
            )
        same = t == before
        at = np.flatnonzero(same)
        above = rows[at - 1]
        if at.size and at[0] == 0 and self._last is not None:
            above[0] = self._last[1]
        differs = ((rows[at] != above) & ~(np.isnan(rows[at]) & np.isnan(above))).any(axis=1)
        if differs.any():
            row = int(at[differs.argmax()])
            raise InputError(
                f"rows {self.report.rows + row - 1} and {self.report.rows + row} have one time, {t[row]:.12g} s, and "
                "different readings; give stamps finer than the sampling interval, or row number times interval"
            )
        self.report.repeats += at.size
        return np.asarray(~same)

    def _advance(self, *, final: bool) -> list[Piece]:
        pieces: list[Piece] = []
        while self._time.size > (0 if final else 1):
            if self._grid is None:
                if self._time.size < GATHERED and not final:
                    break
                # grid of the stretch that starts with the first row held back
                if self._kept is None:
                    self._kept = self._present(self._rows[:GATHERED])
                grid, self._place = self._fitted(self._time[:GATHERED]), -1
                self._before, self._trace = NOBODY, _NONE
                self.report.add_interval(grid.interval)
                self.report.jitter = max(self.report.jitter, grid.jitter)
                self.report.stretches += 1
                self._grid = grid
            pieces += self._run(self._grid, final=final)
        return pieces

    def _fitted(self, t: Array) -> Grid:
        """Grid of the stamps before the first large gap."""
        steps = np.diff(t)
        usual = float(np.median(steps)) if steps.size else np.inf
        ends = np.flatnonzero(steps > (self.settings.fill + 1.5) * usual)
        count = int(ends[0]) + 1 if ends.size else t.size
        if count < FEWEST:
            interval = self._known or usual
            if not np.isfinite(interval):
                raise InputError(f"{t.size} rows; a sampling interval needs 2 or more")
            return Grid(float(t[0]), interval, 0.0)
        while count >= FEWEST:
            # a rate that changes among these rows leaves a shorter beginning with a grid of its own
            grid = fit_grid(t[:count], self._known)
            if grid is not None:
                self._known = grid.interval
                return grid
            count //= 2
        raise _no_grid(float(t[0]))

    def _present(self, rows: Array) -> tuple[str, ...]:
        """Triads with values; what is held until the first of them."""
        kept, start = [], 0
        self._held = np.zeros(rows.shape[1])
        for name in self._given or ():
            width = 1 if name == "temperature" else 3
            good = np.isfinite(rows[:, start : start + width]).all(axis=1)
            if good.any():
                kept.append(name)
                self._held[start : start + width] = rows[good.argmax(), start : start + width]
            share = 1.0 - float(good.mean())
            if name in CHANNELS and good.any() and share > self.settings.most_missing:
                raise InputError(
                    f"{name} has no value in {100.0 * share:.0f} % of the first {len(rows)} rows (allowed "
                    f"{100.0 * self.settings.most_missing:.0f} %): bring a slower sensor to the times of the others, "
                    "or leave it out"
                )
            start += width
        if not set(kept) & set(CHANNELS):
            raise InputError(f"no triad has a value in the first {len(rows)} rows")
        self.report.absent = tuple(name for name in self._given or () if name not in kept)
        return tuple(kept)

    def _run(self, grid: Grid, *, final: bool) -> list[Piece]:
        """Rows held back that lie on the grid, given out; the grid is given up at the first that does not."""
        places, off, self._before = grid.places(self._time, self._before, final=final)
        step = np.diff(places, prepend=self._place)
        fine = 1 << 20  # departures are summed as whole parts of an interval, so that sums do not depend on the blocks
        trace = np.stack([np.rint(off * fine).astype(np.int64), np.where(step < 1, 2, step - 1)], axis=1)
        trace[0, 1] = 0 if self._place < 0 else trace[0, 1]
        trace = np.concatenate([self._trace, trace])
        total = np.cumsum(trace, axis=0)
        drift, uneven = ((total[FOLLOWED:] - total[:-FOLLOWED]) / FOLLOWED).T
        most_drift = 0.25  # intervals of mean departure that tell that the clock leaves the grid
        most_uneven = 0.45  # empty places, and twice the places taken already, a stamp, from which the rate has changed
        lost = (step > self.settings.fill + 1) | (np.abs(drift) > most_drift * fine) | (uneven > most_uneven)
        count = int(lost.argmax()) if lost.any() else places.size
        pieces = self._pieces(grid, step[:count], off[:count])
        if lost.any():
            # give up the grid, and say why
            after = float(self._time[count])
            missing = int(step[count]) - 1
            if missing > self.settings.fill:
                reason = f"about {missing} samples are missing"
                self._ragged = 0
            else:
                reason = f"the stamps leave the grid of {grid.interval:.9g} s"
                self._ragged = self._ragged + 1 if self._place < FEWEST else 0
                if self._place >= GATHERED:
                    # a long stretch tells the interval better than its first rows did
                    self._known = grid.interval * (1.0 + (float(drift[count]) / fine) / self._place)
            # stretches in succession that leave their grid within `FEWEST` rows: the stamps are no clock's
            if self._ragged > 5:
                raise _no_grid(after)
            self.report.cuts += 1
            if len(self.report.gaps) < LISTED:
                self.report.gaps.append(Gap(self._stamp, after, reason))
            self._grid = None
        self._trace = trace[-FOLLOWED:]
        self._time, self._rows = self._time[count:], self._rows[count:]
        return pieces

    def _pieces(self, grid: Grid, step: Index, off: Array) -> list[Piece]:
        """Samples at every place up to the last, the empty ones holding the reading before."""
        own = step > 0
        size = step.size
        if not own.any():
            self.report.shared += size
            return []
        self.report.shared += int(size - own.sum())
        step = step[own]
        rows, bad = self._mended(self._rows[:size][own])
        source = np.repeat(np.arange(1, step.size + 1), step)
        empty = np.ones(source.size, dtype=np.bool_)
        empty[np.cumsum(step) - 1] = False
        source[empty] -= 1
        values = np.concatenate([self._held[None], rows])[source]
        clipped = np.concatenate([[True], bad])[source] | empty
        numbers = np.arange(self._place + 1, self._place + 1 + source.size)
        self.report.filled += int(empty.sum())
        self.report.most_jitter = max(self.report.most_jitter, float(np.abs(off).max()) * grid.interval)
        self._place, self._held, self._stamp = int(numbers[-1]), rows[-1].copy(), float(self._time[:size][own][-1])
        columns: dict[str, Array] = {}
        start = 0
        for name in self._given or ():
            width = 1 if name == "temperature" else 3
            if name in (self._kept or ()):
                part = values[:, start : start + width]
                columns[name] = part[:, 0] if name == "temperature" else part
            start += width
        times = np.asarray(grid.start + grid.interval * numbers, dtype=np.float64)
        samples = Samples(times, grid.interval, clipped=clipped, **columns)
        return [Piece(self.report.stretches - 1, samples)]

    def _mended(self, rows: Array) -> tuple[Array, Mask]:
        """Readings with the last number of their channel where there is none; samples (n,) without a triad's value."""
        good = np.isfinite(rows)
        bad = np.zeros(len(rows), dtype=np.bool_)
        start = 0
        for name in self._given or ():
            width = 1 if name == "temperature" else 3
            if name in CHANNELS and name in (self._kept or ()):
                part = ~good[:, start : start + width]
                bad |= part.any(axis=1)
                for axis, count in zip("xyz", part.sum(axis=0), strict=True):
                    if count:
                        channel = f"{name}_{axis}"
                        self.report.missing[channel] = self.report.missing.get(channel, 0) + int(count)
            start += width
        if good.all():
            return rows, bad
        whole = np.concatenate([self._held[None], rows])
        latest = np.where(np.concatenate([np.ones((1, rows.shape[1]), bool), good]), np.arange(len(whole))[:, None], 0)
        np.maximum.accumulate(latest, axis=0, out=latest)
        return np.take_along_axis(whole, latest, axis=0)[1:], bad


def _no_grid(time: float) -> InputError:
    return InputError(
        f"the stamps about {time:.9g} s lie on no even grid: they depart from it by more than {MOST_JITTER} of an "
        "interval (rms); give better stamps or, if no rows are missing, row number times sampling interval"
    )


class Stretches(NamedTuple):
    """Even stretches of a whole record, and what was found in its stamps."""

    samples: tuple[Samples, ...]
    report: TimingReport


def cut_stretches(
    time: ArrayLike,
    accel: ArrayLike | None = None,
    mag: ArrayLike | None = None,
    gyro: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    *,
    settings: TimingSettings | None = None,
) -> Stretches:
    """Even stretches of a whole record; parameters and errors as `StretchCutter.push`.

    Examples
    --------
    >>> time = np.concatenate([np.arange(50) * 0.01, 2.0 + np.arange(50) * 0.01])
    >>> found = cut_stretches(time, accel=np.ones((100, 3)))
    >>> [len(one) for one in found.samples], found.report.notes()[0]
    ([50, 50], 'the run was cut between 0.49 s and 2 s: about 150 samples are missing')
    """
    cutter = StretchCutter(settings)
    pieces = [*cutter.push(time, accel, mag, gyro, temperature), *cutter.finish()]
    numbers = dict.fromkeys(piece.number for piece in pieces)
    return Stretches(
        tuple(rejoined([piece.samples for piece in pieces if piece.number == number]) for number in numbers),
        cutter.report,
    )


def rejoined(parts: list[Samples]) -> Samples:
    """Samples of pieces that follow each other on one grid."""
    if len(parts) == 1:
        return parts[0]
    return Samples(interval=parts[0].interval, **joined_columns([columns_of(part) for part in parts]))

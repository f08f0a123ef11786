"""Raw time stamps and channels, in blocks of any size, cut into evenly sampled stretches; nothing is repaired silently.

Small gaps keep the grid: places without a reading hold the reading before them and are marked `clipped`; a window
predicts them from their neighbours (`window_filter.bridged`). Larger gaps, and a clock that leaves the grid, end the
stretch. Rows that repeat the row before them are dropped and counted; time that runs backwards is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite
from inclinometry.errors import InputError, refused, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.motion.decimate import MOST_JITTER, NOBODY, Grid, fit_grid
from inclinometry.motion.result import CHANNELS, Samples
from inclinometry.motion.window_filter import columns_of, joined_columns

# What was found in a run's time stamps, and the sentences that say so.

LISTED: Final = 20
"""Gaps and intervals that are kept one by one."""


@dataclass
class TimingReport:
    """What was found in the stamps so far."""

    # rows, repeats, shared, filled: rows read; rows dropped because they repeat the row before; because the place
    # nearest to their stamp was taken; places of the grid without a reading
    rows: int = 0
    repeats: int = 0
    shared: int = 0
    filled: int = 0
    stretches: int = 0
    cuts: int = 0
    intervals: list[float] = field(default_factory=list)  #: s, of the stretches, without repetition
    # jitter, most_jitter: s, largest root mean square and largest single departure of stamps from the grid
    jitter: float = 0.0
    most_jitter: float = 0.0
    first_cut: dict[str, Value] = field(default_factory=dict)  #: values of its finding
    missing: dict[str, int] = field(default_factory=dict)  #: channel -> readings that were not numbers
    absent: tuple[str, ...] = ()  #: triads without any value among the first rows, left out

    def add_interval(self, interval: float) -> None:
        """Note the interval of a stretch, once."""
        if interval not in self.intervals and len(self.intervals) <= LISTED:
            self.intervals.append(interval)

    def findings(self) -> tuple[Finding, ...]:
        """What had to be repaired: notes, and a warning of triads that are left out."""
        found: list[tuple[str, dict[str, Value]]] = []
        if self.repeats:
            dropped: dict[str, Value] = {"count": self.repeats, "total": self.rows, "reason": "repeat the row before"}
            found.append(("motion-rows-dropped", dropped))
        if self.shared:
            dropped = {"count": self.shared, "total": self.rows, "reason": "nearest to a place already filled"}
            found.append(("motion-rows-dropped", dropped))
        if self.filled:
            found.append(("motion-samples-filled", {"count": self.filled}))
        if self.cuts:
            found.append(("motion-cut", {**self.first_cut, "count": self.cuts}))
        if len(self.intervals) > 1:
            found.append(("motion-interval-changes", {"intervals_s": tuple(self.intervals[:LISTED])}))
        if self.intervals and self.jitter > 0.1 * min(self.intervals):
            found.append(("motion-jitter", {"jitter_s": self.jitter}))
        for name, count in self.missing.items():
            found.append(("motion-channel-gaps", {"channel": name, "count": count, "total": self.rows}))
        notes = tuple(Finding(code, values, severity="note") for code, values in found)
        return (*notes, Finding("motion-triad-absent", {"triads": self.absent})) if self.absent else notes


GATHERED: Final = 1024
"""Rows the grid of a stretch is fitted to."""
MOST_FILLED: Final = 5
"""Missing samples in a row that keep the grid, less than a tenth of a window of any method; more cut the stretch."""
FEWEST: Final = 16
"""Rows that can tell a grid from chance."""
FOLLOWED: Final = 64
"""Stamps whose mean departure tells that the clock leaves the grid."""


class Piece(NamedTuple):
    """Samples of stretch `number`; pieces of one number follow each other without a gap."""

    number: int
    samples: Samples


class StretchCutter:
    """Stream of raw rows -> pieces of even stretches, the same whatever blocks the rows come in.

    The first `GATHERED` rows of a stretch are held back to find the grid (`fit_grid`); pieces carry the times of the
    grid. A channel without a number holds its last value, and the sample is marked `clipped`.
    """

    def __init__(self) -> None:
        self.report = TimingReport()
        self._given: tuple[str, ...] | None = None  # names of the columns of the first block
        self._kept: tuple[str, ...] | None = None  # of them, those with values among the first rows
        self._time = np.empty(0)  # rows that wait for a grid
        self._rows = np.empty((0, 0))
        self._last: tuple[float, Array] | None = None  # last row read
        self._grid: Grid | None = None
        self._place = -1  # of the grid, last sample given out
        self._stamp = 0.0  # its stamp
        self._held = np.empty(0)  # its readings, repaired
        self._before = NOBODY
        self._trace = np.zeros((FOLLOWED, 2), dtype=np.int64)  # of the stamps before: departure, places skipped
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
        """Rows in, NaN where there is no value; pieces that became certain out.

        InputError: time not finite or running backwards, one stamp with different readings, stamps too irregular for
        any grid, a triad missing in most rows, columns other than in the first block.
        """
        t = finite(time, "time", (None,))
        # the columns side by side, (n, m)
        given = {"accel": accel, "mag": mag, "gyro": gyro, "temperature": temperature}
        names = tuple(name for name, value in given.items() if value is not None)
        if self._given is None:
            if not set(names) & set(CHANNELS):
                raise refused("input-triads", {"lacking": CHANNELS, "needed": CHANNELS})
            self._given = names
            self._rows = np.empty((0, sum(1 if name == "temperature" else 3 for name in names)))
        if names != self._given:
            raise refused("input-block")
        parts = []
        for name in names:
            width = 1 if name == "temperature" else 3
            part = np.asarray(given[name], dtype=np.float64).reshape(-1, width)
            if len(part) != t.size:
                raise wrong_shape(name, part.shape, str((t.size, width)))
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
            values: dict[str, Value] = {"name": "time_s", "value": float(t[row]), "before": float(before[row])}
            raise self._row_wrong("input-order", row, values)
        same = t == before
        at = np.flatnonzero(same)
        above = rows[at - 1]
        if at.size and at[0] == 0 and self._last is not None:
            above[0] = self._last[1]
        differs = ((rows[at] != above) & ~(np.isnan(rows[at]) & np.isnan(above))).any(axis=1)
        if differs.any():
            row = int(at[differs.argmax()])
            raise self._row_wrong("motion-time-repeated", row, {"time_s": float(t[row])})
        self.report.repeats += at.size
        return np.asarray(~same)

    def _row_wrong(self, code: str, row: int, values: dict[str, Value]) -> InputError:
        row += self.report.rows
        return InputError(Finding(code, values | {"row": row + 1}, (row,), "refused"))

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
                self._before, self._trace = NOBODY, np.zeros_like(self._trace)
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
        ends = np.flatnonzero(steps > (MOST_FILLED + 1.5) * usual)
        count = int(ends[0]) + 1 if ends.size else t.size
        if count < FEWEST:
            interval = self._known or usual
            if not np.isfinite(interval):
                raise refused("input-few", {"name": "rows", "count": int(t.size), "least": 2})
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
            # more than half is taken for a slower sensor
            if name in CHANNELS and good.any() and share > 0.5:
                values: dict[str, Value] = {"triad": name, "missing_percent": 100.0 * share, "count": len(rows)}
                raise refused("motion-triad-slow", values)
            start += width
        if not set(kept) & set(CHANNELS):
            raise refused("motion-triad-absent", {"triads": self._given or ()})
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
        lost = (step > MOST_FILLED + 1) | (np.abs(drift) > most_drift * fine) | (uneven > most_uneven)
        count = int(lost.argmax()) if lost.any() else places.size
        pieces = self._pieces(grid, step[:count], off[:count])
        if lost.any():
            # give up the grid, and say where
            after = float(self._time[count])
            if step[count] > MOST_FILLED + 1:
                self._ragged = 0
            else:
                self._ragged = self._ragged + 1 if self._place < FEWEST else 0
                if self._place >= GATHERED:
                    # a long stretch tells the interval better than its first rows did
                    self._known = grid.interval * (1.0 + (float(drift[count]) / fine) / self._place)
            # stretches in succession that leave their grid within `FEWEST` rows: the stamps are no clock's
            if self._ragged > 5:
                raise _no_grid(after)
            self.report.cuts += 1
            if self.report.cuts == 1:
                intervals = (after - self._stamp) / grid.interval
                stamps = {"before_s": self._stamp, "after_s": after, "interval_s": grid.interval}
                self.report.first_cut = {**stamps, "intervals": intervals}
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
    return refused("motion-no-grid", {"time_s": time, "most": MOST_JITTER})


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
) -> Stretches:
    """Even stretches of a whole record; parameters and errors as `StretchCutter.push`.

    Examples
    --------
    >>> time = np.concatenate([np.arange(50) * 0.01, 2.0 + np.arange(50) * 0.01])
    >>> found = cut_stretches(time, accel=np.ones((100, 3)))
    >>> [len(one) for one in found.samples], found.report.findings()[0].code
    ([50, 50], 'motion-cut')
    """
    cutter = StretchCutter()
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

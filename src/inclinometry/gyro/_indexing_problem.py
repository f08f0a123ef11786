"""Readings at index positions as batches of stations with equally many rows; noise and spikes found from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inclinometry.core.arrays import Array, Index, Mask
from inclinometry.core.errors import InputError
from inclinometry.gyro._indexing_fit import Columns, Solved, design, solve
from inclinometry.uncertainty.coverage import chi_square_tail

LEVEL = 1e-3
"""Chance of calling anything in a clean file a spike (or noisy), over the whole file."""

FEWEST = 2.5
"""Degrees of freedom that an estimated noise must exceed for its uncertainty to be finite."""

ALIKE = 30.0
"""Degrees of freedom that the likeness of sensors of one kind is worth."""

MANY = 8
"""Stations from which a median over them tells the noise in spite of spikes."""

_APART = 10.83  # chi-square with one degree of freedom at 1e-3: how much better a spike must explain than the next row
_BATCH = 2_000_000  # elements of a design held at once
_ROUNDS = 6  # of reweighting at most
_SETTLED = 3e-3  # relative change of the noise that no longer matters: 1e5 degrees of freedom know it no better


@dataclass(frozen=True, eq=False)
class Batch:
    """Stations with equally many rows."""

    stations: Index  # (S,) place of the station in the file
    rows: Index  # (S, P) rows of the file
    index: Array  # (S, P)
    time: Array  # (S, P) centred, over its half range; 0 without time
    second: Array  # (S,) the half range, s
    values: Array  # (S, P, m) less the known offset
    tensor: Array  # (S or 1, 1, m, 3), as it broadcasts
    relative: Array  # (S, P, m) sd of a reading over the channel's noise
    columns: Columns
    damping: float
    used: Mask = field(default_factory=lambda: np.ones((0, 0), dtype=np.bool_))  # (S, P)

    def solve(self, noise: Array, keep: Mask | None = None) -> Solved:
        """Fit with the channels' noise (m,); of the stations `keep` where given."""
        part = slice(None) if keep is None else keep
        tensor = np.broadcast_to(self.tensor, (*self.values.shape, 3))[part]
        matrix = design(self.index[part], self.time[part], tensor, self.columns, self.damping)
        weight = self.used[part][..., None] / (self.relative[part] * noise)
        return solve(matrix, self.values[part], weight, self.columns)


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviation (m,) of one reading, and how well it is known."""

    sd: Array
    dof: float | None = None  # None: given
    inside: bool = False  # the tested readings themselves weigh in it

    def tail(self, drop: Array, freedom: Array) -> Array:
        """Chance of a chi-square so large in `freedom` degrees of freedom."""
        from scipy.special import fdtrc

        if self.dof is None:
            return chi_square_tail(drop, freedom)
        rest, others = np.full_like(drop, self.dof), np.ones_like(drop)
        if self.inside:
            # the noise as the other readings know it: studentised externally
            rest = np.maximum(self.dof - freedom, 0.0)
            others = np.maximum(self.dof - drop, 1e-12 * self.dof) / np.maximum(rest, 1e-12)
        ratio = drop / freedom / others
        return np.where(rest > 0.0, fdtrc(freedom, np.maximum(rest, 1e-12), ratio), 1.0)

    @property
    def widening(self) -> float:
        """Variance of Student's t: what an estimated noise adds to every variance."""
        return 1.0 if self.dof is None else self.dof / (self.dof - 2.0)

    def shrunk(self, drop: Array, freedom: Array) -> Array:
        """Factor by which the variance shrinks when readings that cost `drop` are left out."""
        if self.dof is None or not self.inside:
            return np.ones_like(drop)
        return np.maximum(self.dof - drop, 0.0) / np.maximum(self.dof - freedom, 1e-12)


def slices(shape: tuple[int, int], channels: int) -> Iterator[slice]:
    """Parts of a batch whose design stays within memory."""
    step = max(1, _BATCH // (shape[1] * channels * (3 + 2 * channels)))
    return (slice(start, start + step) for start in range(0, shape[0], step))


def pooled_noise(batches: Sequence[Batch], clean: Mask, names: Sequence[str]) -> Noise:
    """Noise of each channel from the residuals of all stations that are clean (n,).

    The residuals of a channel are set against its redundancy (readings less the unknowns they pay for); over many
    stations their median, so that spikes not yet found do not count.
    """
    largest = max(float(np.abs(batch.values).max()) for batch in batches)
    # readings without any noise; and a bias along the tool is told from the field by its prior alone, which rounding
    # loses where the noise is too much smaller than that
    sharpest = max(float(batch.columns.prior.max(initial=0.0)) for batch in batches)
    floor = max(1e-13 * largest, 3e-5 / np.sqrt(sharpest) if sharpest > 0.0 else 1e-100, 1e-100)
    gain = _gains(batches)
    sd = np.full(len(names), max(1e-3 * largest, floor))
    dof = 0.0
    for _ in range(_ROUNDS):
        square, redundancy = _station_squares(batches, sd, clean)
        _check_redundancy(redundancy, names)
        before, sd = sd, np.maximum(np.sqrt(_shared(_typical(square, redundancy), redundancy, gain)), floor)
        dof = float(redundancy.sum())
        if np.all(np.abs(sd - before) < _SETTLED * sd):
            break
    if dof <= FEWEST:
        raise InputError(
            f"noise is not given and {dof:.1f} degrees of freedom are too few to estimate it from; give the noise of "
            "one reading, or measure more stations or positions"
        )
    return Noise(sd, dof, inside=len(square) < MANY)


def _gains(batches: Sequence[Batch]) -> Array:
    """Reading per field (m,) of each channel, by which the noises of sensors of one kind compare."""
    rows = np.mean([np.linalg.norm(batch.tensor, axis=-1).mean(axis=(0, 1)) for batch in batches], axis=0)
    return np.asarray(np.where(rows > 0.0, rows, 1.0))


def _shared(variance: Array, redundancy: Array, gain: Array) -> Array:
    """Variances (m,) drawn together where each rests on few residuals: a weight that collapses is worse than none."""
    own = redundancy.sum(axis=0)
    common = np.sum(own * variance / gain**2) / np.sum(own)
    alike = ALIKE / (1.0 + own / ALIKE)  # many residuals speak for themselves
    return np.asarray((own * variance + alike * common * gain**2) / (own + alike))


def _station_squares(batches: Sequence[Batch], sd: Array, clean: Mask) -> tuple[Array, Array]:
    """Squared residuals and redundancies (n, m) of the clean stations."""
    squares, redundancies = [], []
    for batch in batches:
        keep = clean[batch.stations]
        if not keep.any():
            continue
        fit = batch.solve(sd, keep)
        weighted = np.where(batch.used[keep][..., None], fit.residual / batch.relative[keep], 0.0)
        squares.append(np.sum(weighted**2, axis=1))
        redundancies.append(np.maximum(fit.redundancy, 0.0))
    return np.concatenate(squares), np.concatenate(redundancies)


def _check_redundancy(redundancy: Array, names: Sequence[str]) -> None:
    poor = np.flatnonzero(redundancy.sum(axis=0) < 1e-6)
    if len(poor):
        raise InputError(
            f"noise is not given and the readings of the {names[poor[0]]} sensor are all needed for the result: no "
            "residual is left to estimate it from; give the noise of one reading, or measure at more positions"
        )


def _typical(square: Array, redundancy: Array) -> Array:
    """Variance (m,) of one reading from squared residuals and redundancies (n, m) of stations."""
    from scipy.special import gammaincinv

    if len(square) < MANY:
        return np.asarray(square.sum(axis=0) / redundancy.sum(axis=0))
    median = 2.0 * gammaincinv(0.5 * np.maximum(redundancy, 1e-3), 0.5)
    usable = redundancy > 0.1
    ratio = np.where(usable, square / np.where(usable, median, 1.0), np.nan)
    if not usable.any(axis=0).all():
        return np.asarray(square.sum(axis=0) / redundancy.sum(axis=0))
    # stations the median calls ordinary are then pooled, which wastes less of them
    centre = np.nanmedian(ratio, axis=0)
    ordinary = square <= centre * (redundancy + 5.0 * np.sqrt(2.0 * redundancy) + 15.0)
    return np.asarray(np.sum(square * ordinary, axis=0) / np.sum(redundancy * ordinary, axis=0))


def find_spikes(batch: Batch, noise: Noise, total: int) -> tuple[Batch, Mask]:
    """Leave out rows that disagree with the others; (S,) stations with a spike that cannot be told apart.

    A row goes when its deletion statistic is too large for chance (over all `total` readings), when it explains the
    misfit clearly better than any other row, and when redundancy remains without it.
    """
    used, unsure = batch.used.copy(), np.zeros(len(batch.rows), dtype=np.bool_)
    open_ = np.ones(len(batch.rows), dtype=np.bool_)
    channels = float(batch.values.shape[-1])
    for _ in range(1 + batch.rows.shape[1] // 20):
        current = _with_used(batch, used)
        fit = current.solve(noise.sd, open_)
        place = np.flatnonzero(open_)
        statistic = np.maximum(np.nan_to_num(fit.statistic, nan=0.0), 0.0)
        drops = np.sort(statistic, axis=1)
        worst, margin = drops[:, -1], drops[:, -1] - drops[:, -2]
        likely = noise.tail(worst, np.full_like(worst, channels)) * total > LEVEL
        clear = margin > _APART * noise.shrunk(worst, np.full_like(worst, channels))
        out = ~likely & clear & (fit.dof - channels >= 1.0)
        unsure[place[~likely & ~out]] = True
        row = np.argmax(statistic, axis=1)
        used[place[out], row[out]] = False
        open_ = np.zeros_like(open_)
        open_[place[out]] = True
        if not out.any():
            break
    return _with_used(batch, used), unsure


def _with_used(batch: Batch, used: Mask) -> Batch:
    return replace(batch, used=used)

"""Averaging over index positions: what turns with the sensors is field, what does not is bias and drift."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, Mask, finite, frozen, within
from inclinometry.errors import not_among, out_of_order, out_of_range, refused, wrong_shape
from inclinometry.findings import Value
from inclinometry.gyro.bias_walk import bias_walk, walk_covariance
from inclinometry.gyro.result import IndexAverage
from inclinometry.rotations import wrap_signed
from inclinometry.uncertainty import chi_square_tail

IndexTurns: TypeAlias = Literal["clockwise", "counterclockwise"]
"""Which way index angles count, looking down hole."""

# Least squares for many stations at once: arrays in and out, no checks.


class Columns(NamedTuple):
    """Which unknown each column of the design is: v_x, v_y[, v_z], a bias of each free channel[, a drift of each]."""

    field: int  #: 2, or 3 when z is seen
    biased: Index  #: indices of channels whose bias is fitted
    drift: bool
    prior: Array  #: (q,) information (1/sd^2) of each column before the readings, about zero

    def width(self, channels: int) -> int:
        """Number of unknowns of a station."""
        return self.field + len(self.biased) + channels * self.drift

    def bias_slots(self) -> slice:
        """Columns of the biases."""
        return slice(self.field, self.field + len(self.biased))


class Solved(NamedTuple):
    """Fits of S stations of P rows and m channels; q unknowns."""

    estimate: Array  #: (S, q)
    covariance: Array  #: (S, q, q)
    residual: Array  #: (S, P, m) reading minus model
    chi_square: Array  #: (S,) prior included
    dof: Array  #: (S,)
    determined: Mask  #: (S,)
    redundancy: Array  #: (S, m) readings of a channel less the unknowns they pay for
    statistic: Array  #: (S, P) drop in chi-square when a row is left out; NaN where the others cannot replace it


def design(index: Array, time: Array, tensor: Array, columns: Columns, damping: float) -> Array:
    """Design (S, P, m, q): the readings of row k are N R_z(index_k) diag(damping, damping, 1) v + bias + drift time.

    index, time : (S, P); tensor (S, P, m, 3); time as it shall be used, i.e. centred and scaled.
    """
    channels = tensor.shape[-2]
    cosine, sine = damping * np.cos(index)[..., None], damping * np.sin(index)[..., None]
    x, y = tensor[..., 0], tensor[..., 1]
    out = np.zeros((*tensor.shape[:-1], columns.width(channels)))
    out[..., 0] = x * cosine - y * sine
    out[..., 1] = x * sine + y * cosine
    if columns.field == 3:
        out[..., 2] = tensor[..., 2]
    for place, channel in enumerate(columns.biased):
        out[:, :, channel, columns.field + place] = 1.0
    if columns.drift:
        first = columns.field + len(columns.biased)
        for channel in range(channels):
            out[:, :, channel, first + channel] = time
    return out


def solve(matrix: Array, values: Array, weight: Array, columns: Columns) -> Solved:
    """Weighted least squares of every station; weight (S, P, m) is 1/sd, zero for what is left out."""
    stations, rows, channels, width = matrix.shape
    whitened = matrix * weight[..., None]
    flat = whitened.reshape(stations, rows * channels, width)
    target = (values * weight).reshape(stations, rows * channels, 1)
    normal = flat.swapaxes(1, 2) @ flat + np.diag(columns.prior)
    # scale (S, q) of the unknowns; x and y share one, so that positions that do not see y show as undetermined
    diagonal = np.diagonal(normal, axis1=1, axis2=2).copy()
    diagonal[:, :2] = diagonal[:, :2].sum(axis=1, keepdims=True)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    # rounding leaves about 1e-16
    determined = np.linalg.eigvalsh(scaled)[:, 0] > 1e-10
    # what is not determined is only reported as such, its numbers are never used
    scaled[~determined] = np.eye(width)
    inverse = np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :])
    estimate = inverse @ (flat.swapaxes(1, 2) @ target)
    # one step of refinement: large biases cost the normal equations digits
    estimate += inverse @ (flat.swapaxes(1, 2) @ (target - flat @ estimate) - columns.prior[:, None] * estimate)
    left = (target - flat @ estimate).reshape(stations, rows, channels)
    estimate = estimate[..., 0]
    used = weight > 0.0
    leverage = np.einsum("skmq,sqr,sknr->skmn", whitened, inverse, whitened, optimize=True)
    return Solved(
        estimate=estimate,
        covariance=inverse,
        residual=values - (matrix @ estimate[:, None, :, None])[..., 0],
        chi_square=np.sum(left**2, axis=(1, 2)) + estimate**2 @ columns.prior,
        dof=used.sum(axis=(1, 2)) + np.count_nonzero(columns.prior) - float(width),
        determined=determined,
        redundancy=used.sum(axis=1) - np.einsum("skmm->sm", leverage),
        statistic=_deletion(left, leverage, np.asarray(used.any(axis=2))),
    )


def _deletion(left: Array, leverage: Array, used: Mask) -> Array:
    """Drop in chi-square (S, P) when a row is left out: r' (1 - H)^-1 r of the row's own block."""
    own = np.eye(left.shape[-1]) - leverage
    # share of a row that its residual must keep for the others to say anything about it
    replaceable = used & (np.linalg.eigvalsh(own)[..., 0] > 1e-6)
    own[~replaceable] = np.eye(left.shape[-1])
    drop = np.einsum("skm,skm->sk", left, np.linalg.solve(own, left[..., None])[..., 0])
    return np.where(replaceable, drop, np.nan)


# Readings at index positions as batches of stations with equally many rows; noise and spikes found from them.

LEVEL = 1e-3
"""Chance of calling anything in a clean file a spike (or noisy), over the whole file."""


MANY = 8
"""Stations from which a median over them tells the noise in spite of spikes."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Stations with equally many rows."""

    stations: Index  #: (S,) place of the station in the file
    rows: Index  #: (S, P) rows of the file
    index: Array  #: (S, P)
    time: Array  #: (S, P) centred, over its half range; 0 without time
    second: Array  #: (S,) the half range, s
    values: Array  #: (S, P, m) less the known offset
    tensor: Array  #: (S or 1, 1, m, 3), as it broadcasts
    relative: Array  #: (S, P, m) sd of a reading over the channel's noise
    columns: Columns
    damping: float
    used: Mask = field(default_factory=lambda: np.ones((0, 0), dtype=np.bool_))  #: (S, P)

    def matrix(self, part: slice | Mask = slice(None)) -> Array:
        """Design (S, P, m, q) of the stations."""
        tensor = np.broadcast_to(self.tensor, (*self.values.shape, 3))[part]
        return design(self.index[part], self.time[part], tensor, self.columns, self.damping)

    def whitened(self, noise: Array) -> Array:
        """Design over the standard deviations of the readings; zero for what is left out."""
        return np.asarray(self.matrix() * (self.used[..., None] / (self.relative * noise))[..., None])

    def solve(self, noise: Array, keep: Mask | None = None) -> Solved:
        """Fit with the channels' noise (m,); of the stations `keep` where given."""
        part = slice(None) if keep is None else keep
        matrix = self.matrix(part)
        weight = self.used[part][..., None] / (self.relative[part] * noise)
        return solve(matrix, self.values[part], weight, self.columns)


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviation (m,) of one reading, and how well it is known."""

    sd: Array
    dof: float | None = None  #: None: given
    inside: bool = False  #: the tested readings themselves weigh in it

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
    # two million elements of a design are held at once
    step = max(1, 2_000_000 // (shape[1] * channels * (3 + 2 * channels)))
    return (slice(start, start + step) for start in range(0, shape[0], step))


def pooled_noise(batches: Sequence[Batch], clean: Mask) -> Noise:
    """Noise of each channel from the residuals of all stations that are clean (n,).

    The residuals of a channel are set against its redundancy (readings less the unknowns they pay for); over many
    stations their median, so that spikes not yet found do not count.
    """
    largest = max(float(np.abs(batch.values).max()) for batch in batches)
    # readings without any noise; and a bias along the tool is told from the field by its prior alone, which rounding
    # loses where the noise is too much smaller than that
    sharpest = max(float(batch.columns.prior.max(initial=0.0)) for batch in batches)
    floor = max(1e-13 * largest, 3e-5 / np.sqrt(sharpest) if sharpest > 0.0 else 1e-100, 1e-100)
    # reading per field (m,) of each channel, by which the noises of sensors of one kind compare
    rows = np.mean([np.linalg.norm(batch.tensor, axis=-1).mean(axis=(0, 1)) for batch in batches], axis=0)
    gain = np.where(rows > 0.0, rows, 1.0)
    sd = np.full(len(gain), max(1e-3 * largest, floor))
    dof = 0.0
    for _ in range(6):
        square, redundancy = _station_squares(batches, sd, clean)
        poor = np.flatnonzero(redundancy.sum(axis=0) < 1e-6)
        if len(poor):
            raise refused("gyro-noise-unknown", {"freedom": 0.0})
        # variances (m,) drawn together where each rests on few residuals: a weight that collapses is worse than none
        variance = typical_variance(square, redundancy)
        own = redundancy.sum(axis=0)
        common = np.sum(own * variance / gain**2) / np.sum(own)
        # the likeness of sensors of one kind is worth 30 degrees of freedom; many residuals speak for themselves
        alike = 30.0 / (1.0 + own / 30.0)
        before = sd
        sd = np.maximum(np.sqrt((own * variance + alike * common * gain**2) / (own + alike)), floor)
        dof = float(redundancy.sum())
        # 1e5 degrees of freedom know the noise no better
        if np.all(np.abs(sd - before) < 3e-3 * sd):
            break
    # for the uncertainty of an estimated noise to be finite
    if dof <= 2.5:
        raise refused("gyro-noise-unknown", {"freedom": dof})
    return Noise(sd, dof, inside=len(square) < MANY)


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


def typical_variance(square: Array, redundancy: Array) -> Array:
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
        # chi-square with one degree of freedom at 1e-3: so much better than the next row must a spike explain
        clear = margin > 10.83 * noise.shrunk(worst, np.full_like(worst, channels))
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


# The index schemes as data, and whether a file's positions are those of its scheme.


@dataclass(frozen=True)
class Scheme:
    """A way of turning the sensors about the tool axis."""

    name: str  #: as on the command line
    positions_deg: tuple[float, ...]  #: index angles in order of visit; empty where any will do
    minimum: int  #: different positions (for a fixed order: visits) a station needs
    # whether a drift of the bias is fitted; None: where time is given and there are 6 readings or more
    drift: bool | None
    sentence: str  #: what it is good for


SCHEMES: Final[Mapping[str, Scheme]] = MappingProxyType(
    {
        scheme.name: scheme
        for scheme in (
            Scheme("two", (0.0, 180.0), 2, False, "Two positions: bias removed; needs sensors along x and y."),
            Scheme("four", (0.0, 90.0, 180.0, 270.0), 4, False, "Four positions: bias removed, drift is not."),
            Scheme(
                "mirrored",
                (0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0),
                8,
                True,
                "Four positions there and back: bias and linear drift removed at no cost in noise.",
            ),
            Scheme("n", (), 3, None, "Three or more positions in any order: bias removed; drift from 6 readings on."),
            Scheme("carousel", (), 8, True, "Continuous rotation: bias and linear drift removed."),
        )
    }
)
"""Index schemes by name."""


TOLERANCE: Final = np.pi / 180.0
"""rad off the scheme's position that are allowed; positions closer than that coincide."""


def scheme_named(name: str) -> Scheme:
    """The scheme of a name, or an error that lists them."""
    if name not in SCHEMES:
        raise not_among("scheme", str(name), SCHEMES)
    return SCHEMES[name]


def check_positions(scheme: Scheme, labels: Index, index: Array) -> None:
    """Raise unless the positions (S, P) of every station are those of the scheme, repeats in place allowed."""
    if scheme.positions_deg:
        # nearly always all stations hold exactly the scheme's positions, one reading each
        wanted = np.radians(scheme.positions_deg)
        unlike: Mask = np.ones(len(index), dtype=np.bool_)
        if index.shape[1] == len(wanted):
            unlike = np.asarray(~(np.abs(wrap_signed(index - wanted)) <= TOLERANCE).all(axis=1))
        for place in np.flatnonzero(unlike):
            _check_visits(scheme, int(labels[place]), index[place])
        return
    # number (S,) of positions further apart than the tolerance, around the circle
    turned = np.sort(np.mod(index, 2.0 * np.pi), axis=1)
    gaps = np.diff(turned, axis=1, append=turned[:, :1] + 2.0 * np.pi)
    apart = np.count_nonzero(gaps > TOLERANCE, axis=1)
    # a dense rotation has no gap at all, but the ground it covers counts
    covered = np.floor(np.where(gaps > TOLERANCE, 0.0, gaps).sum(axis=1) / TOLERANCE)
    different = np.asarray(np.maximum(np.maximum(1, apart), covered), dtype=np.intp)
    poor = np.flatnonzero(different < scheme.minimum)
    if len(poor):
        at = poor[0]
        values: dict[str, Value] = {
            "station": int(labels[at]), "index_deg": _degrees(index[at]),
            "scheme": scheme.name, "needed": scheme.minimum,
        }  # fmt: skip
        raise refused("gyro-positions-few", values)


def check_times(labels: Index, time: Array) -> None:
    """Raise unless time (S, P) increases within every station."""
    wrong = np.argwhere(np.diff(time, axis=1) <= 0.0)
    if len(wrong):
        at, row = wrong[0]
        before, after = time[at, row : row + 2].tolist()
        raise out_of_order(f"time[{int(labels[at])}]", after, before, int(row) + 2)


def _check_visits(scheme: Scheme, label: int, index: Array) -> None:
    """One station whose rows are not one reading a position: repeats in place and whole cycles are as good."""
    found, wanted = _visits(index), np.radians(scheme.positions_deg)
    named: dict[str, Value] = {"station": label, "scheme": scheme.name, "needed_deg": scheme.positions_deg}
    if len(index) < len(wanted) or len(found) < len(_visits(wanted)):
        raise refused("gyro-positions-other", named | {"index_deg": _degrees(index)})
    for cycles in range(1, len(found) // 2 + 1):
        expected = _visits(np.tile(wanted, cycles))
        if len(expected) == len(found) and (np.abs(wrap_signed(found - expected)) <= TOLERANCE).all():
            return
    raise refused("gyro-positions-other", named | {"index_deg": _degrees(found)})


def _visits(index: Array) -> Array:
    """Positions with repeats in place struck out."""
    return np.asarray(index[np.concatenate([[True], np.abs(wrap_signed(np.diff(index))) > TOLERANCE])])


def _degrees(index: Array) -> tuple[float, ...]:
    """Positions as a finding shows them, the first twelve."""
    return tuple((np.degrees(index[:12]).round(2) + 0.0).tolist())


# What the index average is given, checked and cut into batches of stations.


@dataclass(frozen=True, eq=False)
class Table:
    """The readings, checked; stations in the order of the file."""

    labels: Index  #: (n,)
    starts: Index  #: (n + 1,) rows where stations begin
    index: Array
    signals: Array
    time: Array | None
    offset: Array  #: (n or 1, m)

    def groups(self) -> list[Index]:
        """Places of the stations with equally many rows, by number of rows."""
        counts = np.diff(self.starts)
        return [np.flatnonzero(counts == rows) for rows in np.unique(counts)]

    def rows(self, places: Index) -> Index:
        """(S, P) rows of stations with equally many."""
        count = self.starts[places[0] + 1] - self.starts[places[0]]
        return np.asarray(self.starts[places][:, None] + np.arange(count))

    def check_scheme(self, plan: Scheme) -> None:
        """Positions and times of every station."""
        for places in self.groups():
            rows = self.rows(places)
            check_positions(plan, self.labels[places], self.index[rows])
            if self.time is not None:
                check_times(self.labels[places], self.time[rows])


def read_table(
    station: ArrayLike,
    index: ArrayLike,
    signals: ArrayLike,
    time: ArrayLike | None,
    offset: ArrayLike | None,
) -> Table:
    """Check the columns and cut them into stations."""
    labels = np.asarray(station)
    values = finite(signals, "signals", (None, None))
    if labels.ndim != 1 or len(labels) == 0 or not np.issubdtype(labels.dtype, np.integer):
        raise wrong_shape("station", f"{labels.shape} {labels.dtype}", "(K,) int, K > 0")
    size, channels = len(labels), values.shape[-1]
    if values.shape != (size, channels) or channels == 0:
        raise wrong_shape("signals", values.shape, f"({size}, m)")
    starts = np.flatnonzero(np.concatenate([[True], labels[1:] != labels[:-1], [True]]))
    own = labels[starts[:-1]]
    if len(np.unique(own)) < len(own):
        again = next(int(label) for place, label in enumerate(own) if label in own[:place])
        raise refused("gyro-station-again", {"station": again})
    known = finite(np.zeros(channels) if offset is None else offset, "offset", (channels,))
    if known.shape not in ((channels,), (len(own), channels)):
        raise wrong_shape("offset", known.shape, f"({channels},) | ({len(own)}, {channels})")
    return Table(
        labels=own,
        starts=starts,
        index=finite(index, "index", (size,)),
        signals=values,
        time=None if time is None else finite(time, "time", (size,)),
        offset=known.reshape(-1, channels),
    )


def read_axes(tensor: ArrayLike | None, table: Table) -> Array:
    """The tensor (n or 1, m, 3)."""
    channels, stations = table.signals.shape[1], len(table.labels)
    if tensor is None:
        if channels > 3:
            raise refused("input-missing", {"names": ("tensor",)})
        return np.eye(3)[None, :channels]
    axes = finite(tensor, "tensor", (channels, 3))
    axes = axes[None] if axes.ndim == 2 else axes
    if not np.any(axes, axis=-1).all():
        raise refused("sensor-vector-zero", {"name": "tensor"})
    if axes.shape[0] not in (1, stations):
        raise wrong_shape("tensor", axes.shape, f"({channels}, 3) | ({stations}, {channels}, 3)")
    return axes


def read_noise(noise: ArrayLike | None, shape: tuple[int, ...]) -> tuple[Array, Array | None]:
    """Sd of each reading over the channel's, and the channel's (m,) where given."""
    if noise is None:
        return np.ones(shape), None
    given = finite(noise, "noise", (shape[1],))
    if np.any(given <= 0.0):
        raise out_of_range("noise", float(given.min()), "> 0")
    if given.shape not in (shape, shape[1:]):
        raise wrong_shape("noise", given.shape, f"({shape[1]},) | {shape}")
    level = np.sqrt(np.mean(np.broadcast_to(given, shape) ** 2, axis=0))
    return np.broadcast_to(given, shape) / level, level


def read_offset_sd(offset_sd: ArrayLike | None, axes: Array) -> Array:
    """Prior sd (m,) of what is left of the bias."""
    along = np.asarray((np.abs(axes[..., 2]) > np.hypot(axes[..., 0], axes[..., 1])).any(axis=0))  # see mostly z
    if offset_sd is None:
        return np.where(along, 0.0, np.inf)
    sd = np.asarray(offset_sd, dtype=np.float64)
    if sd.shape != along.shape or np.isnan(sd).any() or np.any(sd < 0.0):
        raise out_of_range("offset_sd", str(sd.tolist()), f"{len(along)} x >= 0")
    if np.isinf(sd[along]).any():
        raise refused("gyro-offset-along")
    return sd


def fits_drift(plan: Scheme, drift: bool | None, table: Table, places: Index) -> bool:
    """Whether stations with equally many rows get a drift."""
    wanted = plan.drift if drift is None else drift
    count = int(table.starts[places[0] + 1] - table.starts[places[0]])
    if wanted is None:
        # from six readings on a scheme with free positions can afford a drift
        return table.time is not None and count >= 6
    if wanted and table.time is None:
        raise refused("gyro-time-missing", {"station": int(table.labels[places[0]]), "scheme": plan.name})
    return wanted


def make_batches(
    table: Table, places: Index, axes: Array, relative: Array, known: Array, drift: bool, damping: float
) -> list[Batch]:
    """Stations with equally many rows, in parts."""
    rows = table.rows(places)
    # a view along the tool of less than a tenth of the length is a misalignment
    bounded = np.isfinite(known) & (np.abs(axes[..., 2]) > 0.1 * np.linalg.norm(axes, axis=-1)).any(axis=0)
    seen = bool(bounded.any())
    # what is not told from the field along the tool goes into the bias
    mixed = np.zeros_like(bounded) if seen else (axes[..., 2] != 0.0).any(axis=0)
    sd = np.where(mixed, np.inf, known)
    free = sd > 0.0
    width = 3 if seen else 2
    prior = np.concatenate([np.zeros(width), 1.0 / np.maximum(sd[free], 1e-150) ** 2])
    prior = np.concatenate([prior, np.zeros(axes.shape[1] * drift)])
    columns = Columns(width, np.flatnonzero(free), drift, prior)
    time = np.zeros(rows.shape) if table.time is None else table.time[rows] - table.time[rows].mean(axis=1)[:, None]
    second = np.maximum(np.abs(time).max(axis=1), 1e-300)
    values = table.signals[rows] - table.offset[places if len(table.offset) > 1 else [0]][:, None, :]
    return [
        Batch(
            stations=places[part],
            rows=rows[part],
            index=table.index[rows[part]],
            time=time[part] / second[part][:, None],
            second=second[part],
            values=values[part],
            tensor=axes[places[part] if len(axes) > 1 else [0]][:, None],
            relative=relative[rows[part]],
            columns=columns,
            damping=damping,
            used=np.ones(rows[part].shape, dtype=np.bool_),
        )
        for part in slices((rows.shape[0], rows.shape[1]), axes.shape[1])
    ]


def average_index(
    station: ArrayLike,  # (K,); readings of a station must be consecutive
    index: ArrayLike,  # (K,) rad, the middle of the reading where the sensors turn meanwhile
    signals: ArrayLike,  # (K, m) x, or x and y, or x, y and z, or the rows of the tensor
    *,
    scheme: str,
    time: ArrayLike | None = None,  # s; needed where a drift is fitted
    noise: ArrayLike | None = None,  # (m,) or (K, m) of one reading; from the residuals of all stations when absent
    tensor: ArrayLike | None = None,  # N, (m, 3) or (n, m, 3); x, y, z when absent
    offset: ArrayLike | None = None,  # known part of the bias, (m,) or (n, m)
    # (m,) inf: nothing known; finite for a channel that sees mostly z, whose bias no turn separates from the field.
    # When absent inf across the tool, 0 along it
    offset_sd: ArrayLike | None = None,
    sweep: float = 0.0,  # rad turned while one reading is averaged
    drift: bool | None = None,  # as the scheme says when absent
    # variance of the bias's step over the noise's; when absent from the readings (`bias_walk`) if the noise is stated,
    # else part of the noise
    walk: float | None = None,
    sound: ArrayLike | None = None,  # (n,) stations from which noise and walk are estimated; all when absent
    index_turns: IndexTurns = "clockwise",  # looking down hole; the wrong way mirrors the field of a single sensor
) -> IndexAverage:
    """Field of gyros or accelerometers in tool axes at index 0, without bias and, where the scheme can, linear drift.

    Per station: signals = N R_z(index) diag(a, a, 1) v + offset + bias + drift (t - t_mean) + noise, with
    a = sin(sweep/2)/(sweep/2). One x sensor at 0, 90, 180, 270 deg gives v_x = (x0 - x180)/2, v_y = (x90 - x270)/2:
    steps A and B of the fibre-optic gyro inclinometer patent of 2015. The covariance is that of the weighted least
    squares, multiplied by chi-square/dof where the station is flagged "noisy".
    """
    table, batches, given = index_batches(
        station, index, signals, scheme=scheme, time=time, noise=noise, tensor=tensor, offset=offset,
        offset_sd=offset_sd, sweep=sweep, drift=drift, index_turns=index_turns,
    )  # fmt: skip
    # positions and sensors must tell field, bias and drift apart
    for batch in batches:
        level = np.ones(batch.values.shape[-1]) if given is None else given
        lost = np.flatnonzero(~batch.solve(level).determined)
        if len(lost) == 0:
            continue
        station, positions = int(table.labels[batch.stations[lost[0]]]), _degrees(batch.index[lost[0]])
        values = {"station": station, "channels": batch.values.shape[-1], "index_deg": positions}
        raise refused("gyro-positions-blind", values)
    every = np.ones(len(table.labels), dtype=np.bool_) if sound is None else np.asarray(sound, dtype=np.bool_)
    if not every.any():
        raise refused("input-empty", {"name": "sound"})
    if every.shape != table.labels.shape:
        raise wrong_shape("sound", every.shape, str(table.labels.shape))
    return _averaged(batches, given, table, walk, every)


def index_batches(
    station: ArrayLike,
    index: ArrayLike,
    signals: ArrayLike,
    *,
    scheme: str,
    time: ArrayLike | None,
    noise: ArrayLike | None,
    tensor: ArrayLike | None,
    offset: ArrayLike | None,
    offset_sd: ArrayLike | None,
    sweep: float,
    drift: bool | None = None,
    index_turns: IndexTurns = "clockwise",
) -> tuple[Table, list[Batch], Array | None]:
    """What `average_index` is given, checked, as batches; the noise of each channel where it is."""
    plan = scheme_named(scheme)
    table = read_table(station, index, signals, time, offset)
    table.check_scheme(plan)
    if index_turns not in get_args(IndexTurns):
        raise not_among("index_turns", str(index_turns), get_args(IndexTurns))
    if index_turns == "counterclockwise":
        table = replace(table, index=-table.index)
    axes = read_axes(tensor, table)
    relative, given = read_noise(noise, table.signals.shape)
    known = read_offset_sd(offset_sd, axes)
    damping = float(np.sinc(within(sweep, "sweep", 0.0, np.pi, "rad") / (2.0 * np.pi)))
    batches = [
        batch
        for rows in table.groups()
        for batch in make_batches(table, rows, axes, relative, known, fits_drift(plan, drift, table, rows), damping)
    ]
    return table, batches, given


def _averaged(batches: list[Batch], given: Array | None, table: Table, walk: float | None, every: Mask) -> IndexAverage:
    """Noise, spikes, final fit."""
    stations, (total, channels) = len(table.labels), table.signals.shape
    noise = pooled_noise(batches, every) if given is None else Noise(given)
    found = [find_spikes(batch, noise, total) for batch in batches]
    batches = [batch for batch, _ in found]
    if given is None:
        noise = pooled_noise(batches, every)
    if walk is None:
        walk = 0.0 if given is None else _walk_of(found, noise, stations, every)
    out = _Sums(stations, channels)
    for batch, unsure in found:
        out.take(batch, batch.solve(noise.sd), noise, unsure, walk)
    left_out = [
        (int(table.labels[batch.stations[s]]), int(batch.rows[s, p]))
        for batch in batches
        for s, p in np.argwhere(~batch.used)
    ]
    left_out.sort(key=lambda pair: pair[1])
    return IndexAverage(
        field=frozen(out.field),
        covariance=frozen(out.covariance),
        bias=frozen(out.bias + table.offset),
        drift=frozen(out.drift),
        chi_square=frozen(out.chi_square),
        dof=frozen(out.dof),
        noise=frozen(noise.sd),
        flags=tuple(
            tuple(name for name, on in (("spike", s), ("noisy", n)) if on)
            for s, n in zip(out.spike.tolist(), out.noisy.tolist(), strict=True)
        ),
        left_out=tuple(left_out),
        noise_freedom=np.inf if noise.dof is None else noise.dof,
    )


def _noisy(fit: Solved, noise: Noise, unsure: Mask, stations: int) -> Mask:
    """Stations (S,) that disagree within themselves by more than the noise."""
    likely = noise.tail(fit.chi_square, np.maximum(fit.dof, 1e-9)) * stations
    return np.asarray(unsure | ((fit.dof > 0.0) & (likely < LEVEL)))


def _walk_of(found: Sequence[tuple[Batch, Mask]], noise: Noise, stations: int, every: Mask) -> float:
    """Walk of the bias as `bias_walk` finds it, of stations that lack no reading and are not noisy."""
    parts = []
    for batch, unsure in found:
        whole = every[batch.stations] & batch.used.all(axis=1) & ~_noisy(batch.solve(noise.sd), noise, unsure, stations)
        size, channels = batch.values.shape[1:]
        spread = np.broadcast_to(batch.relative * noise.sd, batch.values.shape)[whole]
        parts.append((
            np.repeat(batch.stations[whole], size), batch.index[whole].ravel(),
            batch.values[whole].reshape(-1, channels), spread.reshape(-1, channels),
        ))  # fmt: skip
    return max((bias_walk(*part) for part in parts if len(part[0])), default=0.0)


class _Sums:
    """The result as it is put together from batches."""

    def __init__(self, stations: int, channels: int) -> None:
        self.field = np.full((stations, 3), np.nan)
        self.covariance = np.full((stations, 3, 3), np.nan)
        self.bias, self.drift = np.zeros((stations, channels)), np.zeros((stations, channels))
        self.chi_square, self.dof = np.zeros(stations), np.zeros(stations)
        self.spike, self.noisy = np.zeros(stations, dtype=np.bool_), np.zeros(stations, dtype=np.bool_)

    def take(self, batch: Batch, fit: Solved, noise: Noise, unsure: Mask, walk: float) -> None:
        """Store one batch; the covariance of noisy stations is inflated to what their residuals say.

        That of the others grows by the walk of the bias, which the residuals of the noisy ones hold already.
        """
        at, columns = batch.stations, batch.columns
        free = np.maximum(fit.dof, 1e-9)
        noisy = _noisy(fit, noise, unsure, len(self.field))
        inflation = np.where(noisy & (fit.dof > 0.0), np.maximum(1.0, fit.chi_square / free), 1.0)
        covariance = fit.covariance * (noise.widening * inflation)[:, None, None]
        if walk:
            by_reading = np.einsum("sqr,spmr->sqpm", fit.covariance, batch.whitened(noise.sd))
            covariance += np.where(noisy, 0.0, 1.0)[:, None, None] * walk_covariance(by_reading, walk)
        seen = slice(0, columns.field)
        self.field[at, seen] = fit.estimate[:, seen]
        self.covariance[at, seen, seen] = covariance[:, seen, seen]
        self.bias[np.ix_(at, columns.biased)] = fit.estimate[:, columns.bias_slots()]
        if columns.drift:
            self.drift[at] = fit.estimate[:, columns.bias_slots().stop :] / batch.second[:, None]
        self.chi_square[at], self.dof[at] = fit.chi_square, fit.dof
        self.noisy[at], self.spike[at] = noisy, ~batch.used.all(axis=1)

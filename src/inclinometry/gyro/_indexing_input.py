"""What the index average is given, checked and cut into batches of stations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, Index, Mask, finite, within
from inclinometry.core.errors import InputError
from inclinometry.gyro._indexing_fit import Columns
from inclinometry.gyro._indexing_problem import Batch, slices
from inclinometry.gyro._indexing_schemes import DRIFT_ROWS, Scheme, check_positions, check_times


@dataclass(frozen=True, eq=False)
class Table:
    """The readings, checked; stations in the order of the file."""

    labels: Index  # (n,)
    starts: Index  # (n + 1,) rows where stations begin
    index: Array
    signals: Array
    time: Array | None
    offset: Array  # (n or 1, m)
    tolerance: float

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
            check_positions(plan, self.labels[places], self.index[rows], self.tolerance)
            if self.time is not None:
                check_times(self.labels[places], self.time[rows])


def read_table(
    station: ArrayLike,
    index: ArrayLike,
    signals: ArrayLike,
    time: ArrayLike | None,
    offset: ArrayLike | None,
    tolerance: float,
) -> Table:
    """Check the columns and cut them into stations."""
    labels = np.asarray(station)
    values = finite(signals, "signals", (None, None))
    if labels.ndim != 1 or len(labels) == 0 or not np.issubdtype(labels.dtype, np.integer):
        raise InputError(
            f"station has shape {labels.shape} and type {labels.dtype}; expected (K,) whole numbers, K > 0"
        )
    size, channels = len(labels), values.shape[-1]
    if values.shape != (size, channels) or channels == 0:
        raise InputError(f"signals have shape {values.shape}; expected ({size}, m), one row for each of station")
    starts = np.flatnonzero(np.concatenate([[True], labels[1:] != labels[:-1], [True]]))
    own = labels[starts[:-1]]
    if len(np.unique(own)) < len(own):
        again = next(int(label) for place, label in enumerate(own) if label in own[:place])
        raise InputError(f"station {again} comes back after another one; put its rows together or number it anew")
    known = finite(np.zeros(channels) if offset is None else offset, "offset", (channels,))
    if known.shape not in ((channels,), (len(own), channels)):
        raise InputError(f"offset has shape {known.shape}; expected ({channels},) or ({len(own)}, {channels})")
    return Table(
        labels=own,
        starts=starts,
        index=finite(index, "index", (size,)),
        signals=values,
        time=None if time is None else finite(time, "time", (size,)),
        offset=known.reshape(-1, channels),
        tolerance=float(within(tolerance, "tolerance", 1e-9, np.pi / 4, "rad")),
    )


def read_axes(tensor: ArrayLike | None, table: Table) -> Array:
    """The tensor (n or 1, m, 3)."""
    channels, stations = table.signals.shape[1], len(table.labels)
    if tensor is None:
        if channels > 3:
            raise InputError(f"signals have {channels} channels; without a tensor they can only be x, y and z")
        return np.eye(3)[None, :channels]
    axes = finite(tensor, "tensor", (channels, 3))
    axes = axes[None] if axes.ndim == 2 else axes
    if axes.shape[0] not in (1, stations) or not np.any(axes, axis=-1).all():
        raise InputError(f"tensor has shape {axes.shape}; expected ({stations}, {channels}, 3), no sensor of all zeros")
    return axes


def _along(axes: Array) -> Mask:
    """Channels (m,) that see mostly the field along the tool."""
    return np.asarray((np.abs(axes[..., 2]) > np.hypot(axes[..., 0], axes[..., 1])).any(axis=0))


def _sees_z(axes: Array) -> Mask:
    """Channels (m,) whose view along the tool is more than a misalignment: a tenth of their length."""
    return np.asarray((np.abs(axes[..., 2]) > 0.1 * np.linalg.norm(axes, axis=-1)).any(axis=0))


def channel_names(axes: Array) -> Sequence[str]:
    """What messages call the channels."""
    count = axes.shape[1]
    return list("xyz"[:count]) if count <= 3 else [f"{place + 1}." for place in range(count)]


def read_noise(noise: ArrayLike | None, shape: tuple[int, ...]) -> tuple[Array, Array | None]:
    """Sd of each reading over the channel's, and the channel's (m,) where given."""
    if noise is None:
        return np.ones(shape), None
    given = finite(noise, "noise", (shape[1],))
    if given.shape not in (shape, shape[1:]) or np.any(given <= 0.0):
        raise InputError(f"noise has shape {given.shape}, least value {given.min():g}; expected positive ({shape[1]},)")
    level = np.sqrt(np.mean(np.broadcast_to(given, shape) ** 2, axis=0))
    return np.broadcast_to(given, shape) / level, level


def read_offset_sd(offset_sd: ArrayLike | None, axes: Array) -> Array:
    """Prior sd (m,) of what is left of the bias."""
    along = _along(axes)
    if offset_sd is None:
        return np.where(along, 0.0, np.inf)
    sd = np.asarray(offset_sd, dtype=np.float64)
    if sd.shape != along.shape or np.isnan(sd).any() or np.any(sd < 0.0):
        raise InputError(f"offset_sd is {sd}; expected {len(along)} values of 0 or more, inf where nothing is known")
    if np.isinf(sd[along]).any():
        raise InputError(
            "offset_sd is inf for a sensor along the tool axis; turning about it does not tell its bias from the "
            "field: give a finite one, from the calibration"
        )
    return sd


def fits_drift(plan: Scheme, drift: bool | None, table: Table, places: Index) -> bool:
    """Whether stations with equally many rows get a drift."""
    wanted = plan.drift if drift is None else drift
    count = int(table.starts[places[0] + 1] - table.starts[places[0]])
    if wanted is None:
        return table.time is not None and count >= DRIFT_ROWS
    if wanted and table.time is None:
        remedy = "give time_s" + ("" if plan.positions_deg else ", or do not fit a drift")
        label = table.labels[places[0]]
        raise InputError(f"station {label}: scheme {plan.name!r} fits a drift but time is missing; {remedy}")
    return wanted


def make_batches(
    table: Table, places: Index, axes: Array, relative: Array, known: Array, drift: bool, damping: float
) -> list[Batch]:
    """Stations with equally many rows, in parts."""
    rows = table.rows(places)
    bounded = np.isfinite(known) & _sees_z(axes)
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

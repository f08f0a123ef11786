"""Stations read more than once: found, checked for contradiction, averaged, and their scatter put to use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.io.table import Table

SAME_ANGLE = np.radians(1e-6)
CONTRADICTION = np.radians(0.5)
SAME_TEMPERATURE = 2.0
ENOUGH_SCATTER = 6  # degrees of freedom from which a channel's own scatter is preferred to its triad's


class Repeats(NamedTuple):
    """Which rows are one station.

    first : (k,) first row of each averaged station, in the file's order.
    group : (n,) the averaged station each row belongs to.
    size : (k,) rows in each.
    notes : what was averaged.
    """

    first: NDArray[np.intp]
    group: NDArray[np.intp]
    size: NDArray[np.intp]
    notes: tuple[str, ...]

    def mean(self, values: Array) -> Array:
        """Mean over the rows of each station: (n, ...) -> (k, ...)."""
        total = np.zeros((len(self.first), *values.shape[1:]))
        # deviations from the first reading, so that equal readings average to exactly themselves
        np.add.at(total, self.group, values - values[self.first][self.group])
        return np.asarray(values[self.first] + total / self.size.reshape(-1, *[1] * (values.ndim - 1)))

    def sum(self, values: Array) -> Array:
        """Sum over the rows of each station."""
        total = np.zeros((len(self.first), *values.shape[1:]))
        np.add.at(total, self.group, values)
        return total

    def sd_of_mean(self, values: Array, own: Array | None) -> Array | None:
        """Standard deviation of each station's mean, (k, m).

        The larger of what the file states (`own`, of each row's mean) and of the scatter between repeats, pooled over
        the file, sqrt(sum (x - mean)^2 / sum (n_k - 1)) / sqrt(n_k). With few repeats the triad's channels are pooled
        as well. None when there is neither.
        """
        size = self.size[:, None]
        stated = None if own is None else np.sqrt(self.sum(own**2)) / size
        free = len(self.group) - len(self.first)
        if free == 0:
            return stated
        variance = np.sum((values - self.mean(values)[self.group]) ** 2, axis=0) / free
        if free < ENOUGH_SCATTER:
            variance = np.full_like(variance, variance.mean())
        scatter = np.sqrt(variance) / np.sqrt(size)
        if stated is None:
            return scatter if variance.any() else None
        return np.asarray(np.maximum(scatter, stated))


def find_repeats(
    table: Table,
    station: Sequence[str],
    settings: tuple[Array, Array, Array] | None,
    temperature: Array | None,
    roll_set: Sequence[str],
) -> Repeats:
    """Rows with one station name, one setting (1e-6 deg) and one temperature (2 degC) are one station.

    Without settings nothing is averaged: the tool may have been held otherwise each time.

    Raises
    ------
    FileError
        One name with settings more than 0.5 deg apart, or in two roll sets; names both lines.
    """
    rows_of: dict[str, list[int]] = {}
    for row, name in enumerate(station):
        rows_of.setdefault(name, []).append(row)
    group = np.arange(len(station))
    notes: list[str] = []
    for name, rows in rows_of.items():
        if len(rows) == 1:
            continue
        if settings is None:
            notes.append(f"station {name} appears {len(rows)} times; without rig angles each row is kept")
            continue
        _check(table, name, rows, settings, roll_set)
        for cluster in _clusters(rows, settings, temperature):
            group[cluster] = cluster[0]
            if len(cluster) > 1:
                notes.append(f"station {name} was read {len(cluster)} times; mean used")
    first, group = np.unique(group, return_inverse=True)
    return Repeats(first, group, np.bincount(group, minlength=len(first)), _shortened(notes))


def _check(
    table: Table, name: str, rows: list[int], settings: tuple[Array, Array, Array], roll_set: Sequence[str]
) -> None:
    def shown(row: int) -> str:
        angles = ", ".join(f"{np.degrees(a[row]):.6g}" for a in settings)
        return f"azimuth, inclination, toolface {angles} deg in line {table.lines[row]}"

    index = np.array(rows)
    apart = np.any([np.abs(wrap_signed(a[index] - a[rows[0]])) > CONTRADICTION for a in settings], axis=0)
    if apart.any():
        row = int(index[apart.argmax()])
        problem = f"station {name!r} is repeated with contradictory angles: {shown(rows[0])}, {shown(row)}"
        raise table.error(f"{problem}; correct one or rename it", row)
    other = next((row for row in rows if roll_set and roll_set[row] != roll_set[rows[0]]), None)
    if other is not None:
        problem = f"station {name!r} is in roll set {roll_set[rows[0]]!r} in line {table.lines[rows[0]]}"
        raise table.error(f"{problem} and in {roll_set[other]!r} here; correct one", other)


def _clusters(rows: list[int], settings: tuple[Array, Array, Array], temperature: Array | None) -> list[list[int]]:
    """Rows of one name that were taken at one setting and one temperature."""
    clusters: list[list[int]] = []
    left = np.array(rows)
    while left.size:
        near = np.all([np.abs(wrap_signed(a[left] - a[left[0]])) <= SAME_ANGLE for a in settings], axis=0)
        if temperature is not None:
            near &= np.abs(temperature[left] - temperature[left[0]]) <= SAME_TEMPERATURE
        clusters.append(left[near].tolist())
        left = left[~near]
    return clusters


def _shortened(notes: list[str], most: int = 10) -> tuple[str, ...]:
    if len(notes) <= most:
        return tuple(notes)
    return (*notes[:most], f"and {len(notes) - most} more repeated stations likewise")

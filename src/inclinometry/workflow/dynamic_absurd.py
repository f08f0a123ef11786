"""Single values of a run that no sensor reads: markers of other programs for a missing value, and broken bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array, Mask

MARKERS: Final = (-999.25, -9999.25, -999999.0)
"""Values that well log files write where there is none; whole numbers that could be readings are not among them."""
MOST: Final = {"accelerometer": 2000.0, "magnetometer": 9e4, "gyro": 1000.0}
"""m/s^2 (200 g), nT, rad/s: beyond any reading of a tool that works, when it stands alone."""
ALONE: Final = 0.01
"""Share of rows up to which such values stand alone; more are a unit or a calibration that is wrong."""


class Absurd:
    """Finds such values block by block, blanks their rows and says so.

    Parameters
    ----------
    names : mapping
        Kind of sensor -> its columns.
    """

    def __init__(self, names: Mapping[str, tuple[str, ...]]) -> None:
        self._names = names
        self._rows = 0
        self._first: dict[str, tuple[int, float]] = {}  # column -> row from 1, value as in the file
        self._counts: dict[str, int] = {}

    def blanked(self, kind: str, signals: Array, vectors: Array) -> Array:
        """Vectors (n, 3) in SI with NaN where such a value is among the `signals` (n, m) of the file."""
        bad: Mask = np.array(np.isin(signals, MARKERS))
        far: Mask = np.asarray(np.abs(np.nan_to_num(vectors)) > MOST[kind])
        if far.any() and float(np.mean(np.any(far, axis=1))) <= ALONE:
            np.logical_or(bad, self._columns(far, np.abs(signals)), out=bad)
        if not bad.any():
            return vectors
        for place in np.flatnonzero(bad.any(axis=0)):
            column, rows = self._names[kind][place], np.flatnonzero(bad[:, place])
            self._first.setdefault(column, (self._rows + int(rows[0]) + 1, float(signals[rows[0], place])))
            self._counts[column] = self._counts.get(column, 0) + rows.size
        return np.where(bad if bad.shape == vectors.shape else np.any(bad, axis=1, keepdims=True), np.nan, vectors)

    def counted(self, rows: int) -> None:
        """So many rows are done."""
        self._rows += rows

    def notes(self) -> tuple[str, ...]:
        """A sentence for each column."""
        return tuple(
            f"{column} is {value:.6g} in row {row}: no reading"
            + (f" (and {self._counts[column] - 1} more of its values)" if self._counts[column] > 1 else "")
            + "; taken for missing"
            for column, (row, value) in self._first.items()
        )

    def _columns(self, far: Mask, size: Array) -> Mask:
        """Which signals (n, m) made a vector so large: the largest of the row, where the channels are not x, y, z."""
        if far.shape == size.shape:
            return far
        largest = np.nan_to_num(size).argmax(axis=1)
        return np.asarray(np.any(far, axis=1, keepdims=True) & (np.arange(size.shape[1]) == largest[:, None]))

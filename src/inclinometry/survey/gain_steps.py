"""A gain that changes midway along a run, told by the length of the field, which no hole changes.

From station k on one sensor, or a whole triad, is 1 / gamma times as sensitive. The length B of the field before tells:

    B^2 = gamma^2 v_i^2 + (|v|^2 - v_i^2)        of sensor i,        B^2 = gamma^2 |v|^2        of the triad

by least squares over the stations from k on. It is one where lengths scatter a fifth as much with the change undone.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import VECTORS

_LEAST: Final = {VECTORS[0]: 0.02, VECTORS[1]: 0.1}
"""Logarithm of a gain that is named: neither two tools' scales nor iron in the assembly make it."""
_BESIDE: Final = 4
"""Stations there must be on each side of a change."""


class Step(NamedTuple):
    """A change of gain: sensor in words, first row of the changed ones, its factor there, scatter before and undone."""

    sensor: str
    row: int
    factor: float
    scatter: float
    undone: float


def gain_step(kind: str, values: Array) -> Step | None:
    """The change of gain that makes the field of a triad as long as it was, if one does.

    Parameters
    ----------
    kind : {"accelerometer", "magnetometer"}
    values : (n, 3)
        Its field along the run, in any unit.

    Returns
    -------
    Step or None
        `scatter` and `undone` are the 90th percentile of the distances of the lengths from their median, as a share.

    Examples
    --------
    >>> b = 5e4 * np.random.default_rng(1).normal(size=(40, 3))
    >>> b /= np.linalg.norm(b, axis=1, keepdims=True)
    >>> gain_step("magnetometer", b) is None
    True
    >>> b[25:, 1] *= 0.5
    >>> gain_step("magnetometer", b)[:2]
    ('magnetometer y', 25)
    """
    scatter = _scatter(np.linalg.norm(values, axis=1))
    squares = values**2
    length = np.sum(squares, axis=1)
    best: tuple[float, Step] | None = None
    if len(values) < 2 * _BESIDE or scatter < 0.5 * _LEAST[kind] or not (length > 0.0).all():
        return None
    for row in range(_BESIDE, len(values) - _BESIDE + 1):
        usual = float(np.median(length[:row]))
        for sensor, seen in ((kind, length), *((f"{kind} {'xyz'[i]}", squares[:, i]) for i in range(3))):
            there = seen[row:]
            size = float(np.sum(there**2))
            gain = float(np.sum((usual - length[row:] + there) * there)) / size if size > 0.0 else 0.0
            if gain <= 0.0 or abs(np.log(gain)) < 2.0 * _LEAST[kind]:
                continue
            fixed = length.copy()
            fixed[row:] += (gain - 1.0) * there
            lengths = np.sqrt(np.maximum(fixed, 0.0))
            left = float(np.std(lengths / np.median(lengths)))
            if best is None or left < best[0]:
                best = left, Step(sensor, row, float(1.0 / np.sqrt(gain)), scatter, _scatter(lengths))
    return best[1] if best is not None and best[1].undone < 0.2 * scatter else None


def _scatter(lengths: Array) -> float:
    middle = float(np.median(lengths))
    return float(np.percentile(np.abs(lengths / middle - 1.0), 90.0))

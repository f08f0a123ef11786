"""A channel that rests at an end of its range along a run: the same extreme reading where the field falls short.

A converter at its end gives one number for every larger field. So readings that agree to the last digit at an end of a
channel are saturated where the field of its triad is shorter than at the other stations; the tool turned to one
attitude again has the same reading and the whole length.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, Mask

_FEWEST: Final = 3
"""Stations that agree at an end."""
_SHORT: Final = 5.0
"""Standard deviations of the lengths by which a field falls short."""


class Clipped(NamedTuple):
    """Rests of a channel: axis, readings at its ends, rows there, largest lack of its field's length as a share."""

    axis: int
    ends: tuple[float, ...]
    rows: Index
    lack: float


def clipped_channels(readings: Array, lengths: Array) -> list[Clipped]:
    """The channels of a triad that rest at an end.

    Parameters
    ----------
    readings : (n, m)
        Channels as they were read.
    lengths : (n,)
        Of the field that they give.

    Examples
    --------
    >>> b = 5e4 * np.random.default_rng(1).normal(size=(40, 3)).round(4)
    >>> b *= 5e4 / np.linalg.norm(b, axis=1, keepdims=True)
    >>> clipped_channels(b, np.linalg.norm(b, axis=1))
    []
    >>> b[:, 1] = np.minimum(b[:, 1], 3e4)
    >>> found = clipped_channels(b, np.linalg.norm(b, axis=1))[0]
    >>> found.axis, found.ends, len(found.rows)
    (1, (30000.0,), 8)
    """
    at_ends = [_ends(column) for column in readings.T]
    resting = np.any([mask for ends in at_ends for _, mask in ends] or [np.zeros(len(lengths), dtype=bool)], axis=0)
    free = lengths[~resting]
    if not resting.any() or len(free) < 4:
        return []
    middle = float(np.median(free))
    spread = max(1.4826 * float(np.median(np.abs(free - middle))), 0.001 * middle)
    short = (middle - lengths) / spread
    found = []
    for axis, ends in enumerate(at_ends):
        # what a field lacks at one end, not what iron adds to it or another channel takes
        lacking = [(value, at) for value, at in ends if (short[at] > -3.0).all() and (short[at] > _SHORT).sum() >= 2]
        if lacking:
            rows = np.flatnonzero(np.any([at for _, at in lacking], axis=0))
            lack = float(1.0 - lengths[rows].min() / middle)
            found.append(Clipped(axis, tuple(value for value, _ in lacking), rows, lack))
    return found


def _ends(column: Array) -> list[tuple[float, Mask]]:
    """Extreme readings that agree at more stations than any other reading does, and where."""
    inner = column[(column > column.min()) & (column < column.max())]
    if not len(inner):
        return []
    usual = int(np.unique(inner, return_counts=True)[1].max())
    ends = ((float(value), column == value) for value in (column.min(), column.max()))
    return [(value, at) for value, at in ends if at.sum() >= max(_FEWEST, 2 * usual)]

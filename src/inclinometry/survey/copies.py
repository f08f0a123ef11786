"""Rows of a table that repeat earlier ones: the longest repeated block, and what chance has of making it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, Mask


class Block(NamedTuple):
    """Rows first, first + 1, .. that stand once more at copy, copy + 1, ..; chance: expected number of such blocks."""

    first: int
    copy: int
    rows: int
    chance: float


def copied_rows(values: Array) -> list[tuple[int, int]]:
    """Single rows that equal others to the last digit in a table in which chance makes no such pair.

    Parameters
    ----------
    values : (n, k)
        With so many digits that numbers of a column hardly ever agree; else nothing is found.

    Returns
    -------
    list of (earlier row, later row)

    Examples
    --------
    >>> readings = np.random.default_rng(1).normal(size=(40, 6))
    >>> readings[25] = readings[4]
    >>> copied_rows(readings), copied_rows(readings.round(1))
    ([(4, 25)], [])
    """
    _, first, number = np.unique(values, axis=0, return_index=True, return_inverse=True)
    earlier = first[number.reshape(-1)]
    later = np.flatnonzero(earlier != np.arange(len(values)))
    others = np.delete(values, later, axis=0)
    if not len(later) or len(later) > max(3, 0.05 * len(values)) or len(others) < 8:
        return []
    pairs = 0.5 * len(others) * (len(others) - 1)
    counts = (np.unique(column, return_counts=True)[1] for column in others.T)
    alike = [max(0.5 * float(np.sum(count * (count - 1))), 1.0) / pairs for count in counts]
    # numbers of a row hang together: as if half of them stood for the rest
    if pairs * float(np.sqrt(np.prod(alike))) > 1e-4:
        return []
    return [(int(earlier[row]), int(row)) for row in later]


def copied_block(values: Array, least: int = 3) -> Block | None:
    """The longest block of rows that stands twice, without overlap.

    Rows that equal the one before count as one of a block, so that a section of constant values is none.

    Parameters
    ----------
    values : (n, k)
    least : int
        Different neighbours in a block, at least.

    Returns
    -------
    Block or None
        `chance` is the number of such blocks that the equal rows elsewhere in the table lead to expect.

    Examples
    --------
    >>> angles = np.random.default_rng(1).normal(size=(40, 2))
    >>> copied_block(angles) is None
    True
    >>> angles[30:34] = angles[10:14]
    >>> copied_block(angles)[:3]
    (10, 30, 4)
    """
    if len(values) < 2 * least:
        return None
    number = np.unique(values, axis=0, return_inverse=True)[1].reshape(-1)
    starts = np.flatnonzero(np.concatenate([[True], number[1:] != number[:-1]]))
    seen = number[starts]
    if len(seen) < 2 * least:
        return None
    best = _longest(seen, least)
    if best is None:
        return None
    first, copy, size = best
    chance = _chance(seen, np.arange(copy, copy + size), size)
    ends = np.append(starts[1:], len(values))
    rows = min(int(ends[place + size - 1] - starts[place]) for place in (first, copy))
    return Block(int(starts[first]), int(starts[copy]), rows, chance)


def _longest(seen: Index, least: int) -> tuple[int, int, int] | None:
    """First row, first row of the copy and length of the longest block that stands twice."""
    count, best = len(seen), None
    words = np.stack([seen[k : count - least + 1 + k] for k in range(least)], axis=1)
    where: dict[bytes, list[int]] = {}
    for place, word in enumerate(words):
        earlier = where.setdefault(word.tobytes(), [])
        for first in earlier[:20]:
            size = 0
            while place + size < count and first + size < place and seen[first + size] == seen[place + size]:
                size += 1
            if size >= least and (best is None or size > best[2]):
                best = first, place, size
        earlier.append(place)
    return best


def _chance(seen: Index, copy: Index, size: int) -> float:
    """Expected number of repeated blocks of a size, from pairs of equal rows, and of equal successors, elsewhere."""
    kept = np.ones(len(seen), dtype=bool)
    kept[copy] = False
    pairs = 0.5 * kept.sum() * (kept.sum() - 1)
    equal = _pairs(seen[kept])
    both: Mask = kept[1:] & kept[:-1]
    next_too = _pairs(np.unique(np.stack([seen[:-1], seen[1:]], axis=1)[both], axis=0, return_inverse=True)[1])
    share = (equal + 0.5) / (pairs + 1.0)
    follows = (next_too + share) / (equal + 1.0)  # an equal row is followed by one more often than by chance
    whole = 0.5 * len(seen) ** 2
    return float(max(whole * share**size, equal * follows ** (size - 1)))


def _pairs(numbers: Index) -> float:
    """Pairs of equal numbers."""
    counts = np.unique(numbers, return_counts=True)[1].astype(float)
    return float(np.sum(counts * (counts - 1.0)) / 2.0)

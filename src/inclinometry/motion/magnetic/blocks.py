"""Blocks of one run put together again."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.motion.samples import MOST_JITTER, Samples

BREAK: Final = 2.0 * MOST_JITTER - 1e-3
"""Intervals by which a block may begin late and still continue the one before: both stamps may jitter."""
_COLUMNS: Final = tuple(field.name for field in fields(Samples) if field.name not in ("time", "interval"))


class Held:
    """Samples of a stream that are still needed, and their stamps.

    The stamps are kept apart: those of a cut would jitter against its first one by more than a whole block's may.

    Examples
    --------
    >>> held = Held()
    >>> [held.add(Samples([t], 0.5, gyro=[[0.0, 0.0, t]])) for t in (7.0, 7.5, 9.0)]
    [True, True, False]
    >>> held.stamps(0, 2), held.cut(1, 2).gyro
    (array([7. , 7.5]), array([[0. , 0. , 7.5]]))
    """

    def __init__(self) -> None:
        self._blocks: list[Samples] = []
        self._stamps: list[Array] = []
        self._last: Samples | None = None

    def __len__(self) -> int:
        return sum(len(block) for block in self._blocks)

    def add(self, block: Samples) -> bool:
        """Take a block unless there is a gap before it; whether it was taken.

        Raises
        ------
        InputError
            Another interval, other triads, or a block that begins before the end of the last.
        """
        if self._last is not None and not _follows(self._last, block):
            return False
        if len(block):
            self._blocks.append(block)
            self._stamps.append(block.time)
            self._last = block
        return True

    def clear(self) -> None:
        """Forget everything, also what came before."""
        self._blocks, self._stamps, self._last = [], [], None

    def stamps(self, start: int, stop: int) -> Array:
        """Stamps as they were given."""
        self._merge()
        return self._stamps[0][start:stop]

    def cut(self, start: int, stop: int) -> Samples:
        """Samples start to stop - 1, with even times that begin at 0."""
        self._merge()
        return self._blocks[0].part(start, stop)

    def drop(self, count: int) -> None:
        """Forget the first ones."""
        self._merge()
        rest, stamps = self._blocks[0].part(count, len(self)), self._stamps[0][count:]
        self._blocks, self._stamps = ([rest], [stamps]) if len(rest) else ([], [])

    def _merge(self) -> None:
        """One block of all, on an even grid."""
        if not self._blocks:
            raise InputError("no samples are held")
        if len(self._blocks) == 1 and self._blocks[0].time is not self._stamps[0]:
            return
        interval = self._blocks[0].interval
        columns = {name: _column(name, self._blocks) for name in _COLUMNS}
        even = np.asarray(interval * np.arange(len(self)), dtype=np.float64)
        self._blocks, self._stamps = [Samples(even, interval, **columns)], [np.concatenate(self._stamps)]


def _column(name: str, blocks: list[Samples]) -> Any:
    """One column of several blocks."""
    parts = [getattr(block, name) for block in blocks]
    if name == "clipped" and any(part is not None for part in parts):
        parts = [np.zeros(len(b), dtype=np.bool_) if p is None else p for b, p in zip(blocks, parts, strict=True)]
    if parts[0] is None or len(parts) == 1:
        return parts[0]
    return np.concatenate(parts)


def _follows(last: Samples, block: Samples) -> bool:
    """Whether a block continues the last one without a gap."""
    names = ("accel", "mag", "gyro", "temperature")
    if last.interval != block.interval or any((getattr(last, n) is None) != (getattr(block, n) is None) for n in names):
        raise InputError(
            f"a block has the interval {block.interval:.6g} s or triads unlike the one before ({last.interval:.6g} s); "
            "feed one run to a stream and begin another stream for the next"
        )
    if not len(block):
        return True
    off = float(block.time[0] - last.time[-1]) / block.interval - 1.0
    if off < -BREAK:
        raise InputError(
            f"a block begins at {block.time[0]:.9g} s, before the last one's end at {last.time[-1]:.9g} s; sort the run"
        )
    return off <= BREAK

"""Equal windows of a stream of samples, the same however the stream is cut into blocks."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.errors import InputError
from inclinometry.motion.samples import CHANNELS, MOST_JITTER, Samples

LEAST_SHARE: Final = 0.5
"""Share of a window that the rest of a record must fill to be a window of its own."""
LARGEST_BREAK: Final = 2.0 * MOST_JITTER - 1e-3
"""Departure of a block's first stamp from the window's grid, in intervals, that is a gap: both stamps may jitter."""

Columns = dict[str, NDArray[Any]]


class WindowBuffer:
    """Collects blocks and hands out whole windows of `seconds`; a gap closes the window.

    Windows are cut from one contiguous copy, so that sums over them do not depend on the blocks; a window's grid starts
    at the stamp of its own first sample.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._interval = 0.0
        self._parts: list[Columns] = []
        self._held = 0

    def push(self, block: Samples) -> list[Samples]:
        """Windows that became complete."""
        if not len(block):
            return []
        columns, done = columns_of(block), []
        if self._held and not self._continues(columns, block.interval):
            done = self.finish()
        self._interval = block.interval
        self._parts.append(columns)
        self._held += len(block)
        size = max(round(self._seconds / block.interval), 1)
        if self._held < size:
            return done
        held = joined_columns(self._parts)
        whole = self._held // size * size
        done += [self._window(held, start, start + size) for start in range(0, whole, size)]
        self._held -= whole
        self._parts = [{name: values[whole:].copy() for name, values in held.items()}] if self._held else []
        return done

    def finish(self) -> list[Samples]:
        """The rest, when it fills a good part of a window."""
        held, parts = self._held, self._parts
        self._held, self._parts = 0, []
        if not held or held < LEAST_SHARE * max(round(self._seconds / self._interval), 1):
            return []
        return [self._window(joined_columns(parts), 0, held)]

    def _window(self, held: Columns, start: int, stop: int) -> Samples:
        cut = {name: values[start:stop] for name, values in held.items() if name != "time"}
        return Samples(held["time"][start] + self._interval * np.arange(stop - start), self._interval, **cut)

    def _continues(self, columns: Columns, interval: float) -> bool:
        first = self._parts[0]
        if interval != self._interval or columns.keys() != first.keys():
            raise InputError(
                f"a block has the interval {interval:.6g} s or channels unlike those before it "
                f"({self._interval:.6g} s); feed one run to a stream and start another for the next"
            )
        at = float(columns["time"][0])
        slack = LARGEST_BREAK * interval + 4.0 * float(np.spacing(abs(at)))
        return bool(abs(at - (first["time"][0] + interval * self._held)) <= slack)


def columns_of(block: Samples) -> Columns:
    """Time, marks and what channels there are."""
    clipped = np.zeros(len(block), np.bool_) if block.clipped is None else block.clipped
    found: Columns = {"time": block.time, "clipped": clipped}
    for name in (*CHANNELS, "temperature"):
        values = getattr(block, name)
        if values is not None:
            found[name] = values
    return found


def joined_columns(parts: list[Columns]) -> Columns:
    """One contiguous stretch."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

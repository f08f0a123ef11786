"""Equal windows of a stream of samples, the same however the stream is cut into blocks."""

from __future__ import annotations

from dataclasses import fields
from typing import Final

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.motion.samples import MOST_JITTER, Samples

LEAST_SHARE: Final = 0.5
"""Share of a window that the rest of a record must fill to be a window of its own."""
LARGEST_BREAK: Final = 2.0 * MOST_JITTER - 1e-3
"""Departure of a block's first stamp from the window's grid, in intervals, that is a gap: both stamps may jitter."""


class WindowBuffer:
    """Collects blocks and hands out whole windows of `seconds`; a gap closes the window.

    Windows are cut from one contiguous copy, so that sums over them do not depend on the blocks.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._parts: list[Samples] = []
        self._held = 0

    def push(self, block: Samples) -> list[Samples]:
        """Windows that became complete."""
        if not len(block):
            return []
        done: list[Samples] = []
        if self._held and not self._continues(block):
            done = self.finish()
        self._parts.append(block)
        self._held += len(block)
        size = self._size(block.interval)
        if self._held < size:
            return done
        held = _joined(self._parts)
        whole = self._held // size * size
        done += [held.part(start, start + size) for start in range(0, whole, size)]
        self._held -= whole
        self._parts = [held.part(whole, len(held))] if self._held else []
        return done

    def finish(self) -> list[Samples]:
        """The rest, when it fills a good part of a window."""
        held, parts = self._held, self._parts
        self._held, self._parts = 0, []
        if not held or held < LEAST_SHARE * self._size(parts[0].interval):
            return []
        return [_joined(parts)]

    def _size(self, interval: float) -> int:
        return max(round(self._seconds / interval), 1)

    def _continues(self, block: Samples) -> bool:
        first = self._parts[0]
        if block.interval != first.interval or any(
            block.has(name) != first.has(name) for name in ("accel", "mag", "gyro")
        ):
            raise InputError(
                f"a block has the interval {block.interval:.6g} s or triads unlike those before it "
                f"({first.interval:.6g} s); feed one run to a stream and start another for the next"
            )
        expected = first.time[0] + first.interval * self._held
        slack = LARGEST_BREAK * first.interval + 4.0 * float(np.spacing(np.abs(block.time[0])))
        return bool(abs(block.time[0] - expected) <= slack)


def _joined(parts: list[Samples]) -> Samples:
    """One contiguous stretch; the stamps keep their jitter, the grid is that of the first."""
    first = parts[0]
    columns = {}
    for field in fields(Samples):
        if field.name in ("time", "interval"):
            continue
        values = [getattr(part, field.name) for part in parts]
        if field.name == "clipped" and any(value is not None for value in values):
            values = [np.zeros(len(p), np.bool_) if v is None else v for p, v in zip(parts, values, strict=True)]
        columns[field.name] = None if values[0] is None else np.concatenate(values)
    size = sum(len(part) for part in parts)
    return Samples(first.time[0] + first.interval * np.arange(size), first.interval, **columns)

"""Blocks of one run put together again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Final

import numpy as np

from inclinometry.core.errors import InputError
from inclinometry.motion.samples import MOST_JITTER, Samples

BREAK: Final = 2.0 * MOST_JITTER - 1e-3
"""Intervals by which a block may begin late and still continue the one before: both stamps may jitter."""


def merged(blocks: Sequence[Samples]) -> Samples:
    """One block of several that follow each other; clipped where any says so.

    Examples
    --------
    >>> parts = [Samples([k * 0.5], 0.5, gyro=[[0.0, 0.0, 1.0]]) for k in range(3)]
    >>> merged(parts).time
    array([0. , 0.5, 1. ])
    """
    if len(blocks) == 1:
        return blocks[0]
    columns: dict[str, Any] = {}
    for field in fields(Samples):
        if field.name in ("time", "interval"):
            continue
        parts = [getattr(block, field.name) for block in blocks]
        if field.name == "clipped" and any(part is not None for part in parts):
            parts = [np.zeros(len(b), dtype=np.bool_) if p is None else p for b, p in zip(blocks, parts, strict=True)]
        columns[field.name] = None if parts[0] is None else np.concatenate(parts)
    time, interval = np.concatenate([block.time for block in blocks]), blocks[0].interval
    # the grid is held against the first stamp, which may itself have jittered
    early = min(float((time - interval * np.arange(time.size)).min()), float(time[0]))
    late = max(float((time - interval * np.arange(time.size)).max()), float(time[0]))
    if max(late - time[0], time[0] - early) > MOST_JITTER * interval:
        time = 0.5 * (early + late) + interval * np.arange(time.size)
    return Samples(time, interval, **columns)


def follows(last: Samples, block: Samples) -> bool:
    """Whether a block continues the last one without a gap.

    Raises
    ------
    InputError
        Another interval, other triads, or a block that begins before the end of the last.
    """
    names = ("accel", "mag", "gyro", "temperature")
    if last.interval != block.interval or any((getattr(last, n) is None) != (getattr(block, n) is None) for n in names):
        raise InputError(
            f"a block has the interval {block.interval:.6g} s or triads unlike the one before ({last.interval:.6g} s); "
            "feed one run to a stream and begin another stream for the next"
        )
    off = float(block.time[0] - last.time[-1]) / block.interval - 1.0
    if off < -BREAK:
        raise InputError(
            f"a block begins at {block.time[0]:.9g} s, before the last one's end at {last.time[-1]:.9g} s; sort the run"
        )
    return off <= BREAK

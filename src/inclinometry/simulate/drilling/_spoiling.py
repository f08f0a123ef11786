"""Faults of the record: channels that stick, stamps that jitter, rows lost or written twice."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.simulate.drilling.faults import Dropped, Fault, Jitter, Repeated, Stuck
from inclinometry.simulate.drilling.record import DrillingSimulation
from inclinometry.simulate.streams import Streams


class Spoiling:
    """The faults of one run; remembers from chunk to chunk what a stuck channel shows."""

    def __init__(self, faults: tuple[Fault, ...], streams: Streams) -> None:
        self._faults, self._streams = faults, streams
        self._shown: dict[int, float] = {}

    def spoil(self, block: DrillingSimulation, index: int) -> DrillingSimulation:
        """The chunk as it is recorded."""
        for number, fault in enumerate(self._faults):
            random = self._streams[f"fault {number}.{index}"]
            if isinstance(fault, Stuck):
                block = self._stick(block, fault, number)
            elif isinstance(fault, Jitter):
                block = replace(block, time=block.time + fault.sd * random.standard_normal(len(block)))
            elif isinstance(fault, Dropped):
                block = block.rows(np.flatnonzero(random.random(len(block)) >= fault.fraction))
            elif isinstance(fault, Repeated):
                block = block.rows(np.repeat(np.arange(len(block)), 1 + (random.random(len(block)) < fault.fraction)))
        return block

    def _stick(self, block: DrillingSimulation, fault: Stuck, number: int) -> DrillingSimulation:
        name, axis = fault.channel.split("_")
        column = "xyz".index(axis)
        rows: Array = getattr(block, name).copy()
        stuck = np.flatnonzero((block.time >= fault.start) & (block.time < fault.stop))
        if stuck.size:
            rows[stuck, column] = self._shown.setdefault(number, float(rows[stuck[0], column]))
        changed: dict[str, Any] = {name: rows}
        return replace(block, **changed)

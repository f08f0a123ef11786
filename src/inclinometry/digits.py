"""What the digits of channels show: a value that is kept, and coarse steps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inclinometry.arrays import Array
from inclinometry.findings import Finding


def longest_stretch(column: Array) -> tuple[int, int]:
    """First row of the longest stretch of one value in (n,), and the row after its last."""
    edges = np.flatnonzero(column[1:] != column[:-1]) + 1
    starts, stops = np.append(0, edges), np.append(edges, len(column))
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])


def coarse_steps(channels: Mapping[str, Array], strengths: Mapping[str, float]) -> list[Finding]:
    """Triads (n, m) whose readings are in steps of 0.5 % or more of their field, `strengths` in the unit of these.

    Seven different values or more in one grid, of a step that a number of decimal places does not make finer.
    """
    found = []
    for kind, values in channels.items():
        distinct = np.unique(values)
        step = float(np.diff(distinct).min(initial=np.inf))
        share = step / strengths[kind] if strengths[kind] > 0.0 else 0.0
        whole = (distinct - distinct[0]) / step
        if len(distinct) >= 7 and share >= 0.005 and np.allclose(whole, np.round(whole), rtol=1e-6):
            found.append(Finding("sensor-steps", {"kind": kind, "step": step, "step_percent": 100.0 * share}))
    return found

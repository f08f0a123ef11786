"""A temperature campaign at the stand: whether the tool has reached its target and is even inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.workflow.laboratory.live import LiveFeed

OVER: Final = 60.0
"""s over which the drift of the temperature is looked at."""
LEAST: Final = 10.0
EVEN: Final = 0.2
"""degC a minute; a tool that warms slower is even inside to a few tenths of a degree."""
NEAR: Final = 3.0
"""degC from the target; the fit uses what was measured, so that nearness only spreads the range well."""


@dataclass(frozen=True)
class Heat:
    """measured : degC now; rate : degC a minute, NaN when not known yet; even, near : as named."""

    measured: float
    rate: float
    even: bool
    near: bool


def heat_of(feed: LiveFeed | None, target: float) -> Heat | None:
    """How the temperature stands against a target in degC; None for an instrument that sends none."""
    if feed is None:
        return None
    window = feed.window(OVER)
    good = np.isfinite(window.temperature)
    if not good.any():
        return None
    time, temperature = window.time[good], window.temperature[good]
    now = float(temperature[-10:].mean())
    rate = float("nan")
    if time[-1] - time[0] >= LEAST:
        rate = 60.0 * float(np.polyfit(time - time[0], temperature, 1)[0])
    return Heat(now, rate, bool(abs(rate) <= EVEN), bool(abs(now - target) <= NEAR))

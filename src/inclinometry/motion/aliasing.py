"""Sampling too slow for the rotation."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.motion.finding import Finding
from inclinometry.motion.turning import Turning

MOST_STEP: Final = 0.75 * np.pi
"""Rotation between samples, rad, beyond which its direction is no longer sure."""
SAMPLES_A_TURN: Final = 8.0
"""Needed to follow a speed that changes."""
LOST: Final = 0.5
"""Turns by which gyro and field may differ."""
LOST_SHARE: Final = 0.02
"""Of the turns made, the same: what a gyro's scale error leaves."""


def aliasing_findings(turning: Turning, interval: float) -> list[Finding]:
    """Whether the phase between samples is ambiguous, and the rate that would be needed.

    Notes
    -----
    Without a gyro a steady rotation faster than half a turn a sample looks like a slower one and cannot be told; one
    that changes its speed passes through half a turn and is.
    """
    if not turning.by:
        return []
    share = turning.step / MOST_STEP
    turns = turning.span / (2.0 * np.pi)
    lost = abs(turning.lost) / (LOST + LOST_SHARE * turns)
    # lost turns with steps that are small are a matter of axes or of the field, not of sampling
    if not (share > 1.0 or (lost > 1.0 and turning.step > 0.5 * MOST_STEP)):
        return []
    speed = turning.step / interval
    text = (
        f"sampled every {interval:.4g} s, too slowly for the rotation: {speed * 30.0 / np.pi:.0f} rpm needs "
        f"{SAMPLES_A_TURN * speed / (2.0 * np.pi):.0f} Hz or more"
    )
    return [Finding("aliased", turning.by, float(max(share, 1.0)), True, text)]

"""A temperature campaign: the same positions at several temperatures, in the order that moves the oven least."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inclinometry.calibration.plans import Plan
from inclinometry.core.arrays import within
from inclinometry.core.errors import InputError

LOW, HIGH = -60.0, 250.0
"""Temperatures of any oven, degC."""
CLOSEST = 5.0
"""Two steps nearer to each other than this, degC, tell a polynomial nothing."""


def campaign(plan: Plan, temperatures: Sequence[float]) -> tuple[Plan, tuple[float, ...]]:
    """All positions of a plan at each temperature, and the target temperature of each, degC.

    Parameters
    ----------
    plan : Plan
    temperatures : sequence of float
        degC, at least two, in the order in which the oven is to reach them.

    Raises
    ------
    InputError
        Fewer than two temperatures, two alike, or one no oven has.

    Notes
    -----
    A reading is used with the temperature measured, not with its target: a ramp will do as well as a soak, as long as
    the tool is even inside. The degree of the polynomial is chosen by the fit, which also states the range it holds in.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> hot, target = campaign(plans.twelve(), [20.0, 80.0])
    >>> len(hot), target[0], target[-1]
    (24, 20.0, 80.0)
    """
    targets = within(list(temperatures), "temperatures", LOW, HIGH, "degC")
    apart = np.diff(np.sort(targets))
    if targets.size < 2 or (apart.size and apart.min() < CLOSEST):
        raise InputError(
            f"the temperatures are {', '.join(f'{t:g}' for t in targets)} degC; give two or more, {CLOSEST:g} apart"
        )
    times = len(targets)
    sets = tuple(f"{t:g}:{name}" if name else "" for t in targets for name in (plan.roll_set or [""] * len(plan)))
    repeated = Plan(
        f"{plan.name} at {times} temperatures",
        np.tile(plan.azimuth, times),
        np.tile(plan.inclination, times),
        np.tile(plan.toolface, times),
        sets if any(sets) else (),
    )
    return repeated, tuple(float(t) for t in np.repeat(targets, len(plan)))

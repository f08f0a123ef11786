"""Plans by name, the optimal one among them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from inclinometry.calibration import plans
from inclinometry.calibration.design import CRITERIA, optimal_plan
from inclinometry.calibration.plans import Plan
from inclinometry.core.errors import InputError
from inclinometry.workflow.simulate import plan_named

LEAST_INCLINATION = np.radians(1.0)
"""Azimuth is aimed no nearer to the vertical than this, rad: there it grows without bound whatever the plan."""


def aimed_range(inclination_range: tuple[float, float], criterion: str) -> tuple[float, float]:
    """The range a plan is aimed at: the one asked for, kept off the vertical where the criterion is an azimuth."""
    low, high = inclination_range
    if criterion == "inclination":
        return low, high
    return max(low, LEAST_INCLINATION), min(high, np.pi - LEAST_INCLINATION)


def make_plan(
    name: str,
    *,
    number: int = 24,
    inclination_range: tuple[float, float] = (np.radians(10.0), np.radians(90.0)),
    criterion: str = "azimuth",
    rig_sd: float = np.radians(0.1),
    dip: float = np.radians(70.0),
    first_inclination: float = np.pi / 4.0,
    azimuth: float = 0.0,
    rolls: int | None = None,
    seed: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """A plan by name; angles in rad. The options that a plan does not know are for the others."""
    if name == "twelve":
        return plans.twelve(rolls=3 if rolls is None else rolls)
    if name == "rotations":
        return plans.rotations(first_inclination, azimuth, 8 if rolls is None else rolls)
    if name != "optimal":
        return plan_named(name)
    if criterion not in CRITERIA:
        raise InputError(f"criterion {criterion!r} is unknown; allowed: {', '.join(CRITERIA)}")
    return optimal_plan(
        number,
        inclination_range=aimed_range(inclination_range, criterion),
        criterion=CRITERIA[criterion],
        rig_sd=rig_sd,
        dip=dip,
        seed=seed,
        progress=progress,
    )

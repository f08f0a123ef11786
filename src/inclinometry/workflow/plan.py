"""Plans by name, the optimal one among them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.calibration import plans
from inclinometry.calibration.design import CRITERIA, RIG_SD, least_drift, optimal_plan
from inclinometry.calibration.plans import FIRST_INCLINATION, Plan
from inclinometry.constants import DIP, INCLINATION_RANGE
from inclinometry.errors import not_among, refused
from inclinometry.findings import Finding
from inclinometry.workflow.simulate import PLANS, plan_named


def aimed_range(inclination_range: tuple[float, float], criterion: str) -> tuple[float, float]:
    """The range a plan is aimed at: the one asked for, kept off the vertical where the criterion is an azimuth."""
    low, high = inclination_range
    if criterion == "inclination":
        return low, high
    # azimuth is aimed no nearer to the vertical than this, rad: there it grows without bound whatever the plan
    least_inclination = np.radians(1.0)
    return max(low, least_inclination), min(high, np.pi - least_inclination)


def gain_of_repeats(plan: Plan, count: int) -> str:
    """What `count` positions visited once more at the end of a plan buy; `plan` is without them."""
    shown = [100.0 * least_drift(one) for one in (plan.repeated(count), plan)]
    return (
        f"with them a zero that drifts shows from {shown[0]:.2g} % of full scale on over the run, without from "
        f"{shown[1]:.2g} %"
    )


def advice(name: str) -> tuple[Finding, ...]:
    """What a person should know before using a plan.

    Examples
    --------
    >>> advice("twelve")
    ()
    """
    if name == "six":
        return (Finding("work-plan-six"),)
    return (Finding("work-plan-rotations"),) if name == "rotations" else ()


def plan_file(name: str) -> Path | None:
    """The file a plan is read from; None for a plan known by name."""
    return None if name in PLANS or name == "optimal" else Path(name)


USUAL: Final[Mapping[str, Mapping[str, Any]]] = {
    "twelve": {"rolls": 3, "azimuths": 3},
    "rotations": {"first_inclination": FIRST_INCLINATION, "azimuth": 0.0, "rolls": 8},
    "optimal": {
        "number": 24,
        "inclination_range": INCLINATION_RANGE,
        "criterion": "azimuth",
        "rig_sd": RIG_SD,
        "dip": DIP,
        "seed": 1,
    },
}
"""What a plan can be told, and what it takes when it is not: of a usual stand and tool, rad; the others are fixed."""


def make_plan(name: str, *, progress: Callable[[float], None] | None = None, **given: Any) -> Plan:
    """A plan by name; `given`: what `USUAL` names, None for what is not said.

    Raises
    ------
    InputError
        An unknown name or criterion; an option that the plan does not know.
    """
    known = USUAL.get(name, {})
    said = {option: value for option, value in given.items() if value is not None}
    for option in (one for one in said if one not in known):
        of_angles = option in ("inclination_range", "rig_sd", "dip", "first_inclination", "azimuth")
        flag = option.replace("_", "-") + ("-deg" if of_angles else "")
        raise refused("input-not-with", {"name": f"--{flag}", "other": f"plan {name}"})
    chosen = {**known, **said}
    if name == "twelve":
        return plans.twelve(**chosen)
    if name == "rotations":
        return plans.rotations(**chosen)
    if name != "optimal":
        return plan_named(name)
    aim = chosen["criterion"]
    if aim not in CRITERIA:
        raise not_among("--criterion", aim, CRITERIA)
    aimed = {"inclination_range": aimed_range(chosen["inclination_range"], aim), "criterion": CRITERIA[aim]}
    return optimal_plan(chosen.pop("number"), **{**chosen, **aimed}, progress=progress)

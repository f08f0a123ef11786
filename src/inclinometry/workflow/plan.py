"""Plans by name, the optimal one among them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from inclinometry.calibration import plans
from inclinometry.calibration.design import CRITERIA, RIG_SD, least_drift, optimal_plan
from inclinometry.calibration.plans import FIRST_INCLINATION, Plan
from inclinometry.constants import DIP, INCLINATION_RANGE
from inclinometry.errors import InputError
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


def advice(name: str) -> tuple[str, ...]:
    """What a person should know before using a plan.

    Examples
    --------
    >>> advice("twelve")
    ()
    """
    if name == "six":
        return (
            "six positions determine no tool by themselves: they complete the history of one that has been calibrated "
            "before, and its full calibrations take twelve or more",
        )
    if name != "rotations":
        return ()
    return (
        "two turns at one azimuth hardly tell the zero of the toolface dial from a tilt of the rig across the plane of "
        "the turns: state what is known of the stand when calibrating (--level-sd-deg, --north-deg and --north-sd-deg, "
        "--dip-sd-deg), or add turns at a second azimuth",
    )


def plan_file(name: str) -> Path | None:
    """The file a plan is read from; None for a plan known by name."""
    return None if name in PLANS or name == "optimal" else Path(name)


def make_plan(
    name: str,
    *,
    number: int | None = None,
    inclination_range: tuple[float, float] | None = None,
    criterion: str | None = None,
    rig_sd: float | None = None,
    dip: float | None = None,
    first_inclination: float | None = None,
    azimuth: float | None = None,
    rolls: int | None = None,
    azimuths: int | None = None,
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """A plan by name; angles in rad.

    Raises
    ------
    InputError
        An unknown name or criterion; an option that the plan has no use for.
    """
    given = {
        "number": number,
        "inclination_range": inclination_range,
        "criterion": criterion,
        "rig_sd": rig_sd,
        "dip": dip,
        "first_inclination": first_inclination,
        "azimuth": azimuth,
        "rolls": rolls,
        "azimuths": azimuths,
        "seed": seed,
    }
    # what each plan can be told; the others are fixed
    uses = {
        "twelve": {"rolls", "azimuths"},
        "rotations": {"first_inclination", "azimuth", "rolls"},
        "optimal": {"number", "inclination_range", "criterion", "rig_sd", "dip", "seed"},
    }
    in_degrees = ("inclination_range", "rig_sd", "dip", "first_inclination", "azimuth")
    for option, value in given.items():
        if value is not None and option not in uses.get(name, ()):
            flag = option.replace("_", "-") + ("-deg" if option in in_degrees else "")
            users = ", ".join(plan for plan, used in uses.items() if option in used)
            raise InputError(f"plan {name} has no use for --{flag}; leave it out (it is for {users})")
    if name == "twelve":
        return plans.twelve(3 if rolls is None else rolls, 3 if azimuths is None else azimuths)
    if name == "rotations":
        return plans.rotations(
            FIRST_INCLINATION if first_inclination is None else first_inclination,
            0.0 if azimuth is None else azimuth,
            8 if rolls is None else rolls,
        )
    if name != "optimal":
        return plan_named(name)
    # the optimal plan; what was not said has the values of a usual stand and tool
    aim = "azimuth" if criterion is None else criterion
    if aim not in CRITERIA:
        raise InputError(f"criterion {aim!r} is unknown; allowed: {', '.join(CRITERIA)}")
    work = INCLINATION_RANGE if inclination_range is None else inclination_range
    return optimal_plan(
        24 if number is None else number,
        inclination_range=aimed_range(work, aim),
        criterion=CRITERIA[aim],
        rig_sd=RIG_SD if rig_sd is None else rig_sd,
        dip=DIP if dip is None else dip,
        seed=1 if seed is None else seed,
        progress=progress,
    )

"""The plans a session can be opened with: by name, aimed at the tool's range, adaptive, or over temperatures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from inclinometry.calibration.plans import Plan
from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.progress import Goal
from inclinometry.laboratory.registry import RegisteredRig, find_tool
from inclinometry.laboratory.session import campaign
from inclinometry.laboratory.verification import protocols
from inclinometry.workflow.plan import aimed_range, make_plan

ADAPTIVE: Final = "adaptive"
CALIBRATING: Final = ("twelve", "orthogonal", "half", "two-face", "rotations", "optimal", ADAPTIVE)
"""Names a calibration can be opened with; a verification takes those of `protocols`."""


@dataclass(frozen=True)
class GuidedPlan:
    """What was chosen: a name, how many positions (optimal only), temperatures of a campaign, degC."""

    name: str
    number: int | None = None
    temperatures: tuple[float, ...] = ()


def plan_for(wanted: GuidedPlan, ledger: Ledger, serial: str, rig: RegisteredRig) -> tuple[Plan, dict[str, Any]]:
    """The positions to begin with, and what the session record keeps of the choice.

    An adaptive plan begins with the one position that tells most and is continued by `progress.proposal`.

    Raises
    ------
    InputError
        An unknown name, a number for a plan that has its own, temperatures that are none.
    """
    if wanted.number is not None and wanted.name != "optimal":
        raise InputError(f"plan {wanted.name} has its own number of positions; leave the number out")
    settings: dict[str, Any] = {}
    if wanted.name in protocols():
        plan = protocols()[wanted.name].plan
    elif wanted.name == ADAPTIVE:
        low, high = rig.inclination
        plan = Plan(ADAPTIVE, np.zeros(1), np.array([float(min(max(0.0, low), high))]), np.zeros(1))
        settings["settings"] = {"adaptive": True}
    elif wanted.name in CALIBRATING:
        if wanted.name != "optimal":
            plan = make_plan(wanted.name)
        else:
            tool = find_tool(ledger, serial)
            span = Goal().inclination_range if tool is None else tool.inclination_range
            sd = float(np.sqrt(np.mean(np.square(rig.sd))))
            plan = make_plan("optimal", number=wanted.number, inclination_range=aimed_range(span, "azimuth"), rig_sd=sd)
    else:
        raise InputError(f"plan {wanted.name!r} is unknown; allowed: {', '.join((*CALIBRATING, *protocols()))}")
    if wanted.temperatures:
        plan, targets = campaign(plan, wanted.temperatures)
        settings["settings"] = {**settings.get("settings", {}), "target_degC": list(targets)}
    return plan, settings

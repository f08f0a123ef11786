"""The plans a session can be opened with: by name, aimed at the tool's range, adaptive, or over temperatures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from inclinometry.calibration.plans import Plan
from inclinometry.errors import not_among, refused
from inclinometry.laboratory.drift import CHECK, refuse_check
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.progress import Goal
from inclinometry.laboratory.registry import RegisteredRig, find_tool
from inclinometry.laboratory.session import positions_at_temperatures
from inclinometry.laboratory.verification import protocols
from inclinometry.workflow.plan import aimed_range, make_plan

ADAPTIVE: Final = "adaptive"
CALIBRATING: Final = ("twelve", "orthogonal", "half", "two-face", "rotations", "optimal", ADAPTIVE, CHECK)
"""Names a calibration can be opened with; a verification takes those of `protocols`."""


def plan_for(
    name: str,
    ledger: Ledger,
    serial: str,
    rig: RegisteredRig,
    *,
    number: int | None = None,
    temperatures: Sequence[float] = (),
) -> tuple[Plan, dict[str, Any]]:
    """The positions to begin with, and what the session record keeps of the choice.

    `number` for the optimal plan only; temperatures of a campaign in degC. An adaptive plan begins with the one
    position that tells most and is continued by `progress.proposal`.
    """
    if number is not None and name != "optimal":
        raise refused("input-not-with", {"name": "number", "other": name})
    settings: dict[str, Any] = {}
    if name == CHECK:
        refuse_check(ledger, serial)
        if temperatures:
            raise refused("input-not-with", {"name": "temperatures", "other": CHECK})
    if name in protocols():
        plan = protocols()[name]
    elif name == ADAPTIVE:
        low, high = rig.inclination
        plan = Plan(ADAPTIVE, np.zeros(1), np.array([float(min(max(0.0, low), high))]), np.zeros(1))
        settings["settings"] = {"adaptive": True}
    elif name in CALIBRATING:
        if name != "optimal":
            plan = make_plan(name)
        else:
            tool = find_tool(ledger, serial)
            span = Goal().inclination_range if tool is None else tool.inclination_range
            sd = float(np.sqrt(np.mean(np.square(rig.sd))))
            plan = make_plan("optimal", number=number, inclination_range=aimed_range(span, "azimuth"), rig_sd=sd)
    else:
        raise not_among("plan", name, (*CALIBRATING, *protocols()))
    if temperatures:
        plan, targets = positions_at_temperatures(plan, temperatures)
        settings["settings"] = {**settings.get("settings", {}), "target_degC": list(targets)}
    return plan, settings

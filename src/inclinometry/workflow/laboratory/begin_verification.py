"""Opening a verification on the stand, with the limits it will be judged by."""

from __future__ import annotations

import itertools
from typing import Any, Final

import numpy as np

from inclinometry.calibration.acceptance import Limits
from inclinometry.calibration.plans import Plan
from inclinometry.core.errors import InputError
from inclinometry.store.ledger import Ledger
from inclinometry.workflow.laboratory.agreed_limits import limits_content
from inclinometry.workflow.laboratory.registry import RegisteredRig, find_rig
from inclinometry.workflow.laboratory.session import Session, open_session
from inclinometry.workflow.laboratory.verification import protocol

_SLACK: Final = 1e-9


def begin_verification(
    ledger: Ledger, calibration: str, protocol_name: str, *, author: str, limits: Limits | None = None
) -> Session:
    """Open a session at the positions of a protocol, on the rig of the calibration.

    Parameters
    ----------
    calibration : str
        Id of its record.
    protocol_name : str
        See `verification.protocols`. Positions that the rig cannot be set to are left out; the plan's name says so.
    limits : Limits, optional
        What the errors will be held against; their own uncertainty when not given.

    Raises
    ------
    InputError
        An unknown protocol, a rig that can be set to none of its positions.
    LedgerError
        No such calibration.
    """
    record = ledger.get("calibration", calibration)
    made = ledger.get("session", record.keys["session"])
    rig = find_rig(ledger, made.body["rig"])
    if rig is None:
        raise InputError(f"rig {made.body['rig']!r} of the calibration is not registered; register it first")
    plan = reachable(protocol(protocol_name).plan, rig)
    settings: dict[str, Any] = {"calibration": calibration, "limits": "" if limits is None else limits.name}
    if limits is not None:
        settings["settings"] = {"limits": limits_content(limits)}
    if made.body.get("site"):
        settings["site"] = made.body["site"]
    return open_session(
        ledger, record.keys["serial"], plan, rig=rig.name, author=author, purpose="verify", settings=settings
    )


def reachable(plan: Plan, rig: RegisteredRig) -> Plan:
    """The positions of a plan that lie within the limits of a rig's dials; InputError when none does."""
    inside = np.ones(len(plan), dtype=bool)
    for name in ("azimuth", "inclination", "toolface"):
        low, high = getattr(rig, name)
        turned = getattr(plan, name)[:, None] + (0.0 if name == "inclination" else 2.0 * np.pi * np.arange(-1, 2))
        turned = np.atleast_2d(turned)
        inside &= np.any((turned >= low - _SLACK) & (turned <= high + _SLACK), axis=1)
    if not inside.any():
        raise InputError(f"rig {rig.name!r} can be set to none of the positions of {plan.name}; choose another one")
    if inside.all():
        return plan
    sets = tuple(itertools.compress(plan.roll_set, inside)) if plan.roll_set else ()
    name = f"{plan.name}, {int(inside.sum())} of {len(plan)} positions within reach of the rig"
    return Plan(name, plan.azimuth[inside], plan.inclination[inside], plan.toolface[inside], sets)

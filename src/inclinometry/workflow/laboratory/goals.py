"""What a session wants to reach, from what was agreed when it was opened and from the tool's own range."""

from __future__ import annotations

from typing import Any

import numpy as np

from inclinometry.store.ledger import Ledger
from inclinometry.workflow.laboratory.registry import find_tool
from inclinometry.workflow.laboratory.session import Session
from inclinometry.workflow.laboratory.standing import Goal


def goal_of(ledger: Ledger, session: Session) -> Goal:
    """The goal of a session: `settings["wanted"]` in degrees, the attitude range of its tool."""
    wanted: dict[str, Any] = dict(session.settings.get("wanted", {}))
    tool = find_tool(ledger, session.serial)
    return Goal(
        u_azimuth=_radians(wanted.get("u_azimuth_deg")),
        u_inclination=_radians(wanted.get("u_inclination_deg")),
        inclination_range=Goal().inclination_range if tool is None else tool.inclination_range,
        criterion=str(wanted.get("criterion", "azimuth")),
    )


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else float(np.radians(degrees))

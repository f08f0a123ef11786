"""The limits agreed when a verification is opened: kept with the session, held to when it is judged."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from inclinometry.calibration.acceptance import JUDGED, Limits
from inclinometry.core.errors import InputError
from inclinometry.store.ledger import LedgerError
from inclinometry.workflow.laboratory.session import Session

OWN: Final = "laboratory"
"""Name of limits the laboratory states itself."""


def limits_content(limits: Limits) -> dict[str, Any]:
    """Limits in degrees, as a session keeps them."""
    angles = {name: getattr(limits, name) for name in JUDGED}
    return {
        "name": limits.name,
        "source": limits.source,
        **{f"{name}_deg": None if value is None else _degrees(value) for name, value in angles.items()},
        "min_inclination_deg_for_azimuth": _degrees(limits.min_inclination_for_azimuth),
        "guard": limits.guard,
    }


def limits_of(session: Session) -> Limits | None:
    """The limits agreed when a verification was opened; None when it is held against its own uncertainty."""
    content = dict(session.settings.get("settings", {})).get("limits")
    return None if not content else limits_from(content)


def limits_from(content: dict[str, Any]) -> Limits:
    """Limits of `limits_content`; InputError for a source that is not named, no limit, values out of range.

    Examples
    --------
    >>> limits_from({"name": "own", "source": "contract 7", "azimuth_deg": 1.0}).guard
    'none'
    """
    source = str(content.get("source") or "").strip()
    if not source:
        raise InputError("the limits have no source; name the document the figures come from")
    angles = {name: content.get(f"{name}_deg") for name in JUDGED}
    if all(value is None for value in angles.values()):
        raise InputError("there is no limit; give at least one of inclination, azimuth, toolface")
    low = content.get("min_inclination_deg_for_azimuth") or 0.0
    inclination, azimuth, toolface = (None if v is None else float(np.radians(v)) for v in angles.values())
    return Limits(
        str(content.get("name") or OWN),
        source,
        inclination,
        azimuth,
        toolface,
        float(np.radians(low)),
        str(content.get("guard") or "none"),
    )


def _degrees(angle: float) -> float:
    return round(float(np.degrees(angle)), 9)


def held_to(session: Session, calibration: str, limits: Limits | None) -> Limits | None:
    """The limits to judge a session by; what was agreed at its opening is not changed once there are results.

    Raises
    ------
    LedgerError
        Another calibration or other limits than agreed.
    """
    agreed_with = session.settings.get("calibration")
    if not agreed_with:
        return limits
    if agreed_with != calibration:
        raise LedgerError(f"this verification was opened for calibration {agreed_with}, not for {calibration}")
    agreed = limits_of(session)
    if limits is not None and (agreed is None or limits_content(limits) != limits_content(agreed)):
        name = "the errors' own uncertainty" if agreed is None else f"limits {agreed.name!r}"
        raise LedgerError(
            f"this verification was opened with {name}; it is not judged by {limits.name!r}: open another one for that"
        )
    return agreed

"""What a certificate needs: what ISO/IEC 17025 asks of it, and that no warning is open."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from typing import Any

from inclinometry.calibration.decision import DISAGREES
from inclinometry.calibration.expected import expected_gravity_sd
from inclinometry.calibration.result import Calibration
from inclinometry.constants import GRAVITY_SPREAD
from inclinometry.errors import InputError
from inclinometry.files.json_codec import findings_in
from inclinometry.findings import Finding, without_notes
from inclinometry.laboratory.certificate.laboratory import Laboratory, Order, Standard
from inclinometry.laboratory.placeholders import stated
from inclinometry.sensors import Tool


class NonconformingError(InputError):
    """The verification failed or does not agree, and no one agreed to certify that."""


class OpenWarningsError(InputError):
    """Warnings are open, and no one accepted them with a reason."""


def stated_country(code: str) -> bool:
    """Whether two letters may be those of a country: ISO 3166-1 leaves AA, QM to QZ, XA to XZ and ZZ to its users."""
    of_users = re.fullmatch("AA|Q[M-Z]|X[A-JL-Z]|ZZ", code)  # XK is used for Kosovo
    return bool(code) and not of_users


def stated_due(due: date | None, day: date | None) -> bool:
    """Whether a day up to which a standard's calibration holds is one, for a standard that was used on `day`."""
    longest = 20  # years for which a standard may be calibrated; a later due date is none that anyone set
    return due is not None and due.year <= (day or date.today()).year + longest


def missing(laboratory: Laboratory | None, order: Order, standards: Sequence[Standard]) -> list[str]:
    """What a document lacks to be titled a certificate (ISO/IEC 17025:2017, 7.8.2.1 and 7.8.4.1), by key."""
    lab = laboratory or Laboratory("-")
    day = order.performed_to or order.performed_from or order.issued
    named = [stated(one.name) and stated(one.certificate) and stated_due(one.due, day) for one in standards]
    there = {
        "laboratory": stated(lab.name) and stated(lab.address) and stated_country(lab.country),
        "customer": stated(order.customer),
        "item": stated(order.serial),
        "performed": order.performed_from is not None,
        "traceability": stated(lab.traceability) or stated(order.rig_traceability),
        "environment": stated(order.environment) or order.temperature_degC is not None,
        "condition": stated(order.condition),
        "procedure": stated(lab.procedure),
        "standards": bool(named) and all(named),
        "standards_due": day is None or not any(one.overdue(day) for one in standards),
        "signatory": stated(lab.authoriser),
    }
    return [key for key, said in there.items() if not said]


def missing_said(key: str, record: Mapping[str, Any], say: Callable[..., str]) -> str:
    """What is missing, and where it is stated."""
    return say(f"missing_{key}", names=", ".join(overdue(record))) if key == "standards_due" else say(f"missing_{key}")


def overdue(record: Mapping[str, Any]) -> list[str]:
    """Reference standards whose own calibration had run out when they were used, each with its day."""
    day = record["dates"]["performed_to"] or record["dates"]["issued"]
    return [f"{one['name']} ({one['due']})" for one in record["standards"] if one["due"] and one["due"] < day]


def open_warnings(calibration: Calibration, verification: Mapping[str, Any] | None) -> list[Finding]:
    """What speaks against relying on a calibration and its verification, each code with its values once."""
    judged = () if verification is None else without_notes(findings_in(verification["report"]))
    found: list[Finding] = []
    for one in (*without_notes(calibration.findings), *two_accelerometers(calibration.tool), *judged):
        if all((one.code, one.values) != (other.code, other.values) for other in found):
            found.append(one)
    return found


def accepted_warnings(
    warnings: Sequence[Finding], reason: str, laboratory: Laboratory | None, order: Order
) -> dict[str, Any] | None:
    """Who accepted the open warnings, when and why; OpenWarningsError where no one did."""
    if not warnings:
        return None
    if not stated(reason):
        raise OpenWarningsError(Finding("certificate-open-warnings", {"finding": tuple(warnings)}))
    by = "" if laboratory is None else laboratory.authoriser
    day = "" if order.issued is None else order.issued.isoformat()
    return {"by": by, "on": day, "reason": reason.strip(), "findings": [one.stored() for one in warnings]}


def nonconforming(verification: Mapping[str, Any] | None) -> bool:
    """Whether a certificate would state that the tool does not conform or agree."""
    return verification is not None and verification["verdict"] in ("fail", DISAGREES)


def only_conforming(verification: Mapping[str, Any] | None) -> None:
    """NonconformingError where it is `nonconforming`."""
    if nonconforming(verification):
        raise NonconformingError(Finding("certificate-failed"))


def other_tool(what: str, tool: str, calibrated: str) -> Finding:
    """That an order, calibration or verification is of another tool than the one that was calibrated."""
    about = {"what": what, "tool": f"{tool:.60}", "calibrated": f"{calibrated:.60}"}
    return Finding("certificate-other-tool", about)


def two_accelerometers(tool: Tool) -> list[Finding]:
    """The condition under which two accelerometers have an uncertainty of inclination."""
    triad = tool.triads.get("accelerometer")
    if triad is None or triad.rank != 2:
        return []
    sd = expected_gravity_sd(tool)
    where = "strength of gravity not stated" if sd == GRAVITY_SPREAD else "strength of gravity stated at both places"
    return [Finding("certificate-two-accelerometers", {"percent": 100.0 * float(sd), "where": where})]

"""What ISO/IEC 17025 asks of a calibration certificate, and what of it a document lacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from inclinometry.laboratory.certificate.laboratory_toml import Laboratory, Order, Standard


def missing(laboratory: Laboratory | None, order: Order, standards: Sequence[Standard]) -> list[str]:
    """What a document lacks to be titled a certificate (ISO/IEC 17025:2017, 7.8.2.1 and 7.8.4.1), by key."""
    lab = laboratory or Laboratory("-")
    day = order.performed_to or order.performed_from or order.issued
    stated = {
        "laboratory": bool(laboratory is not None and laboratory.address and laboratory.country),
        "customer": bool(order.customer),
        "item": bool(order.serial),
        "performed": order.performed_from is not None,
        "traceability": bool(lab.traceability or order.rig_traceability),
        "environment": bool(order.environment or order.temperature_degC),
        "condition": bool(order.condition),
        "procedure": bool(lab.procedure),
        "standards": bool(standards) and all(one.certificate and one.due for one in standards),
        "standards_due": day is None or not any(one.overdue(day) for one in standards),
        "signatory": bool(lab.authoriser),
    }
    return [key for key, there in stated.items() if not there]


def missing_said(key: str, record: Mapping[str, Any], say: Callable[..., str]) -> str:
    """What is missing, and where it is stated."""
    return say(f"missing_{key}", names=", ".join(overdue(record))) if key == "standards_due" else say(f"missing_{key}")


def overdue(record: Mapping[str, Any]) -> list[str]:
    """Reference standards whose own calibration had run out when they were used, each with its day."""
    day = record["dates"]["performed_to"] or record["dates"]["issued"]
    return [f"{one['name']} ({one['due']})" for one in record["standards"] if one["due"] and one["due"] < day]

"""What a certificate says of laboratory, order and rig, from the records of the ledger."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from typing import Any

from inclinometry.core.errors import InputError
from inclinometry.io.laboratory_toml import Laboratory, Order, laboratory_from
from inclinometry.store.ledger import Ledger, Record
from inclinometry.workflow.laboratory.registry import find_site, find_tool


def laboratory_of(ledger: Ledger, session: Record) -> Laboratory:
    """The laboratory of a session's site; InputError when the site names none."""
    site = find_site(ledger, str(session.body.get("site", "")))
    if site is None or not site.laboratory:
        raise InputError(
            "the laboratory is not known: name it with the site of the session (name, address, country), or give it"
        )
    return laboratory_from(dict(site.laboratory))


def authorised(laboratory: Laboratory, wanted: tuple[str, str], author: str) -> Laboratory:
    """The laboratory with who answers for the certificate: nobody is not allowed (ISO/IEC 17025, 7.8.2.1 o)."""
    if any(wanted):
        return replace(laboratory, authoriser=wanted[0] or author, authoriser_role=wanted[1])
    return laboratory if laboratory.authoriser else replace(laboratory, authoriser=author)


def _rig(ledger: Ledger, name: str, seq: int) -> tuple[str, str]:
    """Traceability and place of a rig as it was when the tool was calibrated; as they are now where none was stated."""
    then = ledger.find("rig", name=name, newest=True, after=seq, limit=1)
    now = ledger.latest("rig", name=name)
    bodies = [record.body for record in (*then, now) if record is not None]
    traceability, place = (next((str(b[key]) for b in bodies if b.get(key)), "") for key in ("traceability", "place"))
    return traceability, place


def order(
    ledger: Ledger,
    session: Record,
    calibration: Record,
    verification: Record | None,
    today: date,
    said: Mapping[str, Any],
) -> Order:
    """What was ordered and done, from the records of session, tool, rig and readings; `said` goes before them."""
    body = {**session.body, **{name: value for name, value in said.items() if value}}
    tool = find_tool(ledger, session.keys["serial"])
    days = sorted(ledger.get("reading", name).created[:10] for name in calibration.body["readings"])
    days = days or [calibration.created[:10]]
    last = days[-1] if verification is None else max(days[-1], verification.created[:10])
    about = body.get("environment", {})
    first = date.fromisoformat(days[0])
    traceability, place = _rig(ledger, body["rig"], session.seq)
    return Order(
        customer=body.get("customer") or (tool.customer if tool else ""),
        reference=body.get("order", ""),
        item=tool.name if tool else "",
        manufacturer=tool.manufacturer if tool else "",
        serial=session.keys["serial"],
        condition=body.get("condition", ""),
        plan=body["plan"]["name"],
        rig=body["rig"],
        rig_traceability=traceability,
        rig_place=place,
        environment=str(about.get("text", "")),
        received=_day(body.get("received", "")),
        performed_from=first,
        performed_to=date.fromisoformat(last),
        issued=today,
        temperature_degC=_pair(about, "temperature_degC"),
        humidity_percent=_pair(about, "humidity_percent"),
        interval_months=tool.interval_months if tool else None,
    )


def _day(text: str) -> date | None:
    try:
        return date.fromisoformat(text[:10])
    except ValueError:
        return None


def _pair(about: Mapping[str, Any], key: str) -> tuple[float, float] | None:
    """Lowest and highest of a list, or of one number."""
    value = about.get(key)
    numbers = value if isinstance(value, list) else [value]
    if not numbers or any(isinstance(x, bool) or not isinstance(x, int | float) for x in numbers):
        return None
    return float(min(numbers)), float(max(numbers))

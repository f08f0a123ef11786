"""What ISO/IEC 17025 asks of a calibration certificate, and what of it a document lacks."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from functools import cache
from importlib.resources import files
from typing import Any, Final

from inclinometry.laboratory.certificate.laboratory_toml import Laboratory, Order, Standard

LONGEST_INTERVAL: Final = 20
"""Years for which a reference standard may be calibrated; a later due date is none that anybody set."""


@cache
def _placeholders() -> frozenset[str]:
    text = files("inclinometry.laboratory.certificate").joinpath("templates", "placeholders.json").read_text("utf-8")
    return frozenset(_letters(one) for of_language in json.loads(text).values() for one in of_language)


def _letters(text: str) -> str:
    """Letters and digits alone, small, in one form."""
    return "".join(c for c in unicodedata.normalize("NFKC", text).casefold() if c.isalnum())


def stated(text: str) -> bool:
    """Whether a text says anything: a dash, "n/a", "not stated", "tbd" are no more than an empty field.

    Examples
    --------
    >>> [stated(text) for text in ("QP-12", "-", "N. N.", "not stated", "нет", "不详")]
    [True, False, False, False, False, False]
    """
    parts = [_letters(part) for part in re.split(r"[\n,;，；、]", text)]
    whole = _letters(text)
    return whole not in _placeholders() and any(part and part not in _placeholders() for part in parts)


def stated_country(code: str) -> bool:
    """Whether two letters may be those of a country: ISO 3166-1 leaves AA, QM to QZ, XA to XZ and ZZ to its users."""
    of_users = re.fullmatch("AA|Q[M-Z]|X[A-JL-Z]|ZZ", code)  # XK is used for Kosovo
    return bool(code) and not of_users


def stated_due(due: date | None, day: date | None) -> bool:
    """Whether a day up to which a standard's calibration holds is one, for a standard that was used on `day`."""
    return due is not None and due.year <= (day or date.today()).year + LONGEST_INTERVAL


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

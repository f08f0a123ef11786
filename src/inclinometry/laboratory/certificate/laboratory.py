"""Who calibrates and for whom: the facts of a certificate that no measurement gives."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Annotated, Any

from annotated_types import MaxLen

from inclinometry.errors import out_of_range, refused
from inclinometry.laboratory.ledger.chain import invisible

LONGEST = 500
"""Characters of one text."""


@dataclass(frozen=True)
class Standard:
    """A reference standard: what the angles and fields of a laboratory are traced to the SI by.

    certificate : number of its own calibration certificate.
    due : day up to which its calibration holds; None where none is stated.
    """

    name: str
    certificate: Annotated[str, MaxLen(200)] = ""
    due: datetime.date | None = None
    description: Annotated[str, MaxLen(2000)] = ""
    retired: bool = False

    def overdue(self, day: datetime.date) -> bool:
        """Whether its own calibration had run out on a day."""
        return self.due is not None and self.due < day

    @property
    def cited(self) -> str:
        """How a certificate names it.

        >>> Standard("Theodolite T2", "D-17", datetime.date(2027, 3, 1)).cited
        'Theodolite T2 (D-17, 2027-03-01)'
        """
        about = ", ".join(filter(None, (self.certificate, "" if self.due is None else self.due.isoformat())))
        return f"{self.name} ({about})" if about else self.name


@dataclass(frozen=True)
class Laboratory:
    """A calibration laboratory as its certificates name it.

    country : two capital letters (ISO 3166-1). place : of the calibration; the address when empty.
    accreditation : body and number; empty without one. authoriser : who authorises the certificate.
    traceability : how the rig's angles and the fields are traced to the SI. procedure : number and title.
    """

    name: str
    address: str = ""
    country: str = ""
    place: str = ""
    accreditation: str = ""
    email: str = ""
    phone: str = ""
    authoriser: str = ""
    authoriser_role: str = ""
    traceability: str = ""
    procedure: str = ""

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise refused("input-empty", {"name": "name"})
        for key, text in self.__dict__.items():
            shown_whole(key, text)
        code = self.country
        if code and not (len(code) == 2 and code.isascii() and code.isalpha() and code.isupper()):
            raise out_of_range("country", f"{code!r:.40}", "AA .. ZZ")


@dataclass(frozen=True)
class Order:
    """What was ordered, in which state it came, under what conditions it was done.

    received, performed_from, performed_to, issued : dates; None where not known.
    temperature_degC, humidity_percent : lowest and highest during the work; None where not measured.
    rig_traceability, rig_place : how the rig's angles are traced to the SI, where it stands.
    interval_months : until the next calibration, only where it was agreed with the customer.
    """

    customer: str = ""
    customer_address: str = ""
    reference: str = ""
    item: str = ""
    manufacturer: str = ""
    serial: str = ""
    condition: str = ""
    plan: str = ""
    rig: str = ""
    rig_traceability: str = ""
    rig_place: str = ""
    environment: str = ""
    received: datetime.date | None = None
    performed_from: datetime.date | None = None
    performed_to: datetime.date | None = None
    issued: datetime.date | None = None
    temperature_degC: tuple[float, float] | None = None  # noqa: N815
    humidity_percent: tuple[float, float] | None = None
    interval_months: int | None = None

    def __post_init__(self) -> None:
        days = [d for d in (self.received, self.performed_from, self.performed_to, self.issued) if d is not None]
        if days != sorted(days):
            raise refused("certificate-dates", {"dates": tuple(day.isoformat() for day in days)})
        if self.interval_months is not None and not 1 <= self.interval_months <= 120:
            raise out_of_range("interval_months", self.interval_months, "1 .. 120")


_LINES = ("address", "place", "customer_address", "traceability", "rig_traceability", "condition", "environment")
"""Texts that may have several lines."""


def shown_whole(key: str, text: str) -> None:
    """InputError for what no page shows: control characters, marks that turn the direction of writing."""
    hidden = next((c for c in text if not (c.isprintable() or (c == "\n" and key in _LINES))), None)
    if hidden is not None:
        raise invisible(key, text, hidden)


def begun(day: datetime.date, name: str) -> datetime.date:
    """The day on which something was done, as `name` states it; InputError for one that has begun nowhere on Earth."""
    now = datetime.datetime.now(datetime.UTC)
    if day > (now + datetime.timedelta(hours=14)).date():  # the first islands are that far ahead
        raise out_of_range(name, str(day), f"<= {now:%Y-%m-%d}")
    return day


LABORATORY = tuple(Laboratory.__dataclass_fields__)
ORDER = tuple(Order.__dataclass_fields__)


def laboratory_from(about: dict[str, Any]) -> Laboratory:
    """The laboratory in a mapping of texts, as a site of the ledger holds it; keys it does not know are left out."""
    texts = {key: str(about[key]) for key in LABORATORY if about.get(key)}
    # older records may hold what is refused now: it is left out
    lines = {
        key: [*text.splitlines()] if key in _LINES else [" ".join(text.splitlines())] for key, text in texts.items()
    }
    shown = {key: "\n".join("".join(c for c in line if c.isprintable()) for line in lines[key]) for key in lines}
    return Laboratory(**{"name": ""} | shown)

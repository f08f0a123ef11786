"""lab.toml: who calibrates and for whom, the facts of a certificate that no measurement gives."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inclinometry.errors import FileError, InputError
from inclinometry.files import toml_keys
from inclinometry.opening import whole

LONGEST = 500
"""Characters of one text."""


@dataclass(frozen=True)
class Standard:
    """A reference standard as a certificate cites it.

    certificate : number of its own calibration certificate.
    due : day up to which that holds; None where none is stated.
    """

    name: str
    certificate: str = ""
    due: datetime.date | None = None

    def overdue(self, day: datetime.date) -> bool:
        """Whether its own calibration had run out on a day."""
        return self.due is not None and self.due < day


@dataclass(frozen=True)
class Laboratory:
    """A calibration laboratory as its certificates name it.

    name, address : of the laboratory; lines of the address separated by line ends.
    country : two capital letters (ISO 3166-1).
    place : where the calibration was performed; the address when empty.
    accreditation : body and number; empty when the laboratory is not accredited.
    authoriser, authoriser_role : who answers for the certificate.
    traceability : how the rig's angles and the fields are traced to the SI.
    procedure : number and title of the calibration procedure.
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
            raise InputError("the laboratory has no name; a certificate names it")
        for key, text in self.__dict__.items():
            _shown_whole(key, text)
        code = self.country
        if code and not (len(code) == 2 and code.isascii() and code.isalpha() and code.isupper()):
            raise InputError(f"country is {code!r:.40}; two capital letters are needed, as DE (ISO 3166-1)")


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
            said = ", ".join(day.isoformat() for day in days)
            raise InputError(f"received, performed_from, performed_to, issued are {said}: none may be before the last")
        if self.interval_months is not None and not 1 <= self.interval_months <= 120:
            raise InputError(f"interval_months is {self.interval_months}; allowed 1 to 120, or none")


_LINES = ("address", "place", "customer_address", "traceability", "rig_traceability", "condition", "environment")
"""Texts that may have several lines."""


def _shown_whole(key: str, text: str) -> None:
    """InputError for what no page shows: control characters, marks that turn the direction of writing."""
    hidden = next((c for c in text if not (c.isprintable() or (c == "\n" and key in _LINES))), None)
    if hidden is not None:
        where = text.index(hidden) + 1
        raise InputError(
            f"{key} has the character U+{ord(hidden):04X} in place {where}, which no page shows; take it out"
        )


def begun(day: datetime.date, name: str) -> datetime.date:
    """The day on which something was done, as `name` states it; InputError for one that has begun nowhere on Earth."""
    now = datetime.datetime.now(datetime.UTC)
    if day > (now + datetime.timedelta(hours=14)).date():  # the first islands are that far ahead
        raise InputError(
            f"{name} is {day}, a day to come; today is {now:%Y-%m-%d}: state the day on which it was done, or set the "
            "clock of this computer"
        )
    return day


_LABORATORY = tuple(Laboratory.__dataclass_fields__)
_ORDER = tuple(Order.__dataclass_fields__)


def read_laboratory(path: str | Path) -> tuple[Laboratory, Order, tuple[Standard, ...]]:
    """Read lab.toml: the laboratory's keys, a table [order] with those of the order, [[standards]] that were used.

    What it leaves out is taken from the settings of the bench whose ledger it names.

    Raises
    ------
    FileError
        Wrong syntax, with its line; an unknown key, with the closest; no name; a value of the wrong kind.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "lab.toml").write_text('name = "Stand 1"\\ncountry = "DE"\\n[order]\\ncustomer = "A"\\n')
    ...     laboratory, order, standards = read_laboratory(Path(folder, "lab.toml"))
    >>> laboratory.country, order.customer, standards
    ('DE', 'A', ())
    """
    settings = toml_keys.load(path, (*_LABORATORY, "order", "standards", "ledger", "logo"))
    about = settings.content.get("order", {})
    if not isinstance(about, dict):
        raise FileError(f"order is {about!r:.40}; a table [order] is needed", path=path)
    order = toml_keys.Settings(path, about, _ORDER)
    try:
        known, standards, _ = _of_ledger(settings)
        named = Laboratory(**{**known, **_texts(settings, _LABORATORY)})
        return named, Order(**_order(order)), _standards(settings) or standards
    except FileError:
        raise
    except TypeError:
        raise FileError("key 'name' is missing; a certificate names the laboratory", path=path) from None
    except InputError as error:
        raise FileError(str(error), path=path) from None


def read_logo(path: str | Path) -> bytes | None:
    """The logo that lab.toml names, or that of the ledger it names; None where there is none.

    Raises
    ------
    FileError
        No such file, no PNG or SVG picture that stands by itself.
    """
    from inclinometry.laboratory.registry import LARGEST_LOGO, logo_kind

    settings = toml_keys.load(path, (*_LABORATORY, "order", "standards", "ledger", "logo"))
    named = settings.text("logo")
    if named is None:
        return _of_ledger(settings)[2]
    picture = Path(path).parent / named
    try:
        data = whole(picture, LARGEST_LOGO)
        logo_kind(data)
    except FileError as error:
        raise FileError(f"logo: {error.problem}", path=picture) from None
    except ValueError as error:
        raise FileError(f"logo: {error}", path=picture) from None
    return data


def _of_ledger(settings: toml_keys.Settings) -> tuple[dict[str, str], tuple[Standard, ...], bytes | None]:
    """What the settings of a bench say of the laboratory, its reference standards and its logo."""
    where = settings.text("ledger")
    if where is None:
        return {}, (), None
    from inclinometry.laboratory.ledger.ledger import Ledger
    from inclinometry.laboratory.registry import find_laboratory, find_logo, standards

    at = where if "://" in where else str(Path(settings.path).parent / where)
    with Ledger(at, read_only=True) as ledger:
        found, logo = find_laboratory(ledger), find_logo(ledger)
        used = tuple(Standard(one.name, one.certificate, one.due) for one in standards(ledger) if not one.retired)
    return {} if found is None else dict(found.__dict__), used, None if logo is None else logo[1]


def _standards(settings: toml_keys.Settings) -> tuple[Standard, ...]:
    rows, keys, path = settings.content.get("standards", []), ("name", "certificate", "due"), settings.path
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise FileError("standards are tables: [[standards]], each with name, certificate and due", path=path)
    found = []
    for row in rows:
        one = toml_keys.Settings(path, row, keys)
        texts = _texts(one, ("name", "certificate"))
        if not texts.get("name"):
            raise FileError(
                "a reference standard under [[standards]] has no name; give name, certificate, due", path=path
            )
        found.append(Standard(**texts, due=None if "due" not in row else _date(one, "due")))
    return tuple(found)


def _date(settings: toml_keys.Settings, key: str) -> datetime.date:
    value = settings.content[key]
    if isinstance(value, datetime.datetime):
        return value.date()
    if isinstance(value, datetime.date):
        return value
    raise FileError(f"{key} is {value!r:.40}; a date is needed, as {key} = 2026-05-01", path=settings.path)


def laboratory_from(about: dict[str, Any]) -> Laboratory:
    """The laboratory in a mapping of texts, as a site of the ledger holds it; keys it does not know are left out."""
    texts = {key: str(about[key]) for key in _LABORATORY if about.get(key)}
    # records of before may hold what is refused now: it is left out
    lines = {
        key: [*text.splitlines()] if key in _LINES else [" ".join(text.splitlines())] for key, text in texts.items()
    }
    shown = {key: "\n".join("".join(c for c in line if c.isprintable()) for line in lines[key]) for key in lines}
    return Laboratory(**{"name": ""} | shown)


def _texts(settings: toml_keys.Settings, keys: tuple[str, ...]) -> dict[str, str]:
    found = {}
    for key in keys:
        text = settings.text(key)
        if text is not None:
            if len(text) > LONGEST:
                raise FileError(f"{key} has {len(text)} characters; allowed {LONGEST}", path=settings.path)
            found[key] = text.strip().replace("\r\n", "\n")
            try:
                _shown_whole(key, found[key])
            except InputError as error:
                raise FileError(str(error), path=settings.path) from None
    return found


def _order(settings: toml_keys.Settings) -> dict[str, Any]:
    ranges = {"temperature_degC": (-100.0, 300.0), "humidity_percent": (0.0, 100.0)}
    dates = ("received", "performed_from", "performed_to", "issued")
    plain = tuple(key for key in _ORDER if key not in (*dates, *ranges, "interval_months"))
    found: dict[str, Any] = dict(_texts(settings, plain))
    for key in dates:
        if key in settings.content:
            found[key] = _date(settings, key)
            try:
                begun(found[key], key)
            except InputError as error:
                raise FileError(str(error), path=settings.path) from None
    for key, limits in ranges.items():
        if key in settings.content:
            found[key] = _range(settings, key, *limits)
    months = settings.number("interval_months", 1, 120)
    if months is not None:
        if months != int(months):
            raise FileError(f"interval_months is {months:g}; whole months are needed", path=settings.path)
        found["interval_months"] = int(months)
    return found


def _range(settings: toml_keys.Settings, key: str, low: float, high: float) -> tuple[float, float]:
    value = settings.content[key]
    numbers = isinstance(value, list) and len(value) == 2 and all(type(x) in (int, float) for x in value)
    if not numbers or not (all(map(math.isfinite, value)) and low <= value[0] <= value[1] <= high):
        wanted = f"lowest and highest are needed, within {low:g} to {high:g}, as {key} = [21.5, 23.0]"
        raise FileError(f"{key} is {value!r:.40}; {wanted}", path=settings.path)
    return float(value[0]), float(value[1])

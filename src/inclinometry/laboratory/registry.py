"""What a laboratory has: tools, rigs and sites, each changed by recording it anew."""

from __future__ import annotations

import calendar
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import date
from threading import Lock
from typing import Any, Final, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from sqlalchemy import func, select

from inclinometry.arrays import within
from inclinometry.calibration.conventions import USUAL, Dials
from inclinometry.calibration.start import Stand, stand_within
from inclinometry.conventions import current_name
from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.engine import KINDS, TABLES
from inclinometry.laboratory.ledger.ledger import Ledger, Record

MOST = 100_000
"""No list of tools is longer."""


@dataclass(frozen=True)
class RegisteredTool:
    """A tool of a customer.

    triads : kind -> what is known of its sensors: number of channels, unit, axes ("+x+y+z"), any JSON values.
    interval_months : agreed months between calibrations; None when none is agreed, and then nothing is ever due.
    inclination_range : where it will work, rad.
    """

    serial: str
    name: str
    triads: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    manufacturer: str = ""
    customer: str = ""
    description: str = ""
    convention: str = "native"
    inclination_range: tuple[float, float] = (float(np.radians(10.0)), float(np.radians(90.0)))
    interval_months: int | None = None
    retired: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "convention", current_name(self.convention))


@dataclass(frozen=True)
class RegisteredRig:
    """A stand: standard deviations of its three settings, rad; limits of its settings, rad; where its angles come from.

    dials : how its dials count; the limits are those of azimuth, inclination and toolface in the conventions.
    """

    name: str
    sd: tuple[float, float, float]
    azimuth: tuple[float, float] = (0.0, 2.0 * np.pi)
    inclination: tuple[float, float] = (0.0, np.pi)
    toolface: tuple[float, float] = (0.0, 2.0 * np.pi)
    description: str = ""
    traceability: str = ""
    place: str = ""
    driver: Mapping[str, Any] = field(default_factory=dict)
    dials: Dials = USUAL

    @property
    def stand(self) -> Stand:
        """The settings a plan may use."""
        return stand_within(self.azimuth, self.inclination, self.toolface)


@dataclass(frozen=True)
class RegisteredSite:
    """Fields at the stand where they are known: m/s^2, nT, rad; the laboratory's name and address for certificates.

    latitude : geodetic, north positive, rad; decides the sign of the Earth rate that gyros are calibrated on.
    """

    name: str
    g: float | None = None
    b: float | None = None
    dip: float | None = None
    laboratory: Mapping[str, str] = field(default_factory=dict)
    description: str = ""
    latitude: float | None = None

    @property
    def fields(self) -> dict[str, float | None]:
        """What is known of the fields, as `session.bench_readings` takes it."""
        return {"g": self.g, "b": self.b, "dip": self.dip, "latitude": self.latitude}


def put_tool(ledger: Ledger, tool: RegisteredTool, *, author: str) -> Record:
    """Register a tool, or record what changed.

    Raises
    ------
    InputError
        A range of inclinations that is none, a serial number or text that cannot be recorded.
    """
    low, high = within(tool.inclination_range, "inclination_range", 0.0, np.pi, "rad")
    if low > high:
        raise InputError(f"inclination_range is {low:g} to {high:g} rad; the first must not exceed the second")
    if tool.interval_months is not None and not 1 <= tool.interval_months <= 120:
        raise InputError(f"interval_months is {tool.interval_months}; allowed 1 to 120, or none")
    body = {
        "name": tool.name,
        "triads": {kind: dict(about) for kind, about in tool.triads.items()},
        "manufacturer": tool.manufacturer,
        "customer": tool.customer,
        "description": tool.description,
        "convention": tool.convention,
        "range_deg": {"inclination": _degrees(tool.inclination_range)},
        "interval_months": tool.interval_months,
        "retired": tool.retired,
    }
    return ledger.append("tool", {"serial": tool.serial}, body, author=author)


def find_tool(ledger: Ledger, serial: str) -> RegisteredTool | None:
    """The tool as it is now; None when it was never registered."""
    record = ledger.latest("tool", serial=serial)
    return None if record is None else _tool(record)


def tools(ledger: Ledger, *, limit: int = 1000, after: str = "") -> list[RegisteredTool]:
    """Tools by serial number, beyond `after`."""
    return [_tool(record) for record in ledger.current("tool", limit=limit, after=after)]


def put_rig(ledger: Ledger, rig: RegisteredRig, *, author: str) -> Record:
    """Register a rig, or record what changed."""
    within(rig.sd, "sd of the rig", 0.0, np.radians(10.0), "rad")
    limits = {name: _degrees(getattr(rig, name)) for name in ("azimuth", "inclination", "toolface")}
    stand_within(rig.azimuth, rig.inclination, rig.toolface, candidates=1)  # refuses limits that are none
    body: dict[str, Any] = {
        "sd_deg": _degrees(rig.sd),
        "stand": limits,
        "description": rig.description,
        "traceability": rig.traceability,
        "place": rig.place,
        "driver": dict(rig.driver),
    }
    if rig.dials != USUAL:
        body["dials"] = asdict(rig.dials)
    return ledger.append("rig", {"name": rig.name}, body, author=author)


def find_rig(ledger: Ledger, name: str) -> RegisteredRig | None:
    """The rig as it is now; None when it was never registered."""
    record = ledger.latest("rig", name=name)
    return None if record is None else _rig(record)


def rig_of(ledger: Ledger, session: str) -> RegisteredRig | None:
    """The rig of a session as it was when the session was opened: its uncertainty is not changed after the readings."""
    opened = ledger.get("session", session)
    found = ledger.find("rig", name=opened.body["rig"], newest=True, after=opened.seq, limit=1)
    return _rig(found[0]) if found else None


def dials_of(ledger: Ledger, rig: str, before: int = 0) -> Dials:
    """How a rig's dials are known to count, by the records before a place in the chain, by all of them when 0."""
    found = ledger.find("rig", name=rig, newest=True, after=before, limit=1)
    return _rig(found[0]).dials if found else USUAL


def rigs(ledger: Ledger) -> list[RegisteredRig]:
    """Rigs by name."""
    return [_rig(record) for record in ledger.current("rig")]


def put_site(ledger: Ledger, site: RegisteredSite, *, author: str) -> Record:
    """Register a site, or record what changed."""
    body: dict[str, Any] = {"laboratory": dict(site.laboratory), "description": site.description}
    if site.g is not None:
        body["g_mps2"] = float(within(site.g, "g", 9.5, 10.1, "m/s^2"))
    if site.b is not None:
        body["b_nT"] = float(within(site.b, "b", 5e3, 2e5, "nT"))
    if site.dip is not None:
        body["dip_deg"] = float(np.degrees(within(site.dip, "dip", -np.pi / 2, np.pi / 2, "rad")).round(9))
    if site.latitude is not None:
        latitude = within(site.latitude, "latitude", -np.pi / 2, np.pi / 2, "rad")
        body["latitude_deg"] = float(np.degrees(latitude).round(9))
    return ledger.append("site", {"name": site.name}, body, author=author)


def find_site(ledger: Ledger, name: str) -> RegisteredSite | None:
    """The site as it is now; None when it was never registered."""
    record = ledger.latest("site", name=name)
    return None if record is None else _site(record)


def sites(ledger: Ledger) -> list[RegisteredSite]:
    """Sites by name."""
    return [_site(record) for record in ledger.current("site")]


def months_after(day: date, months: int) -> date:
    """The same day of a later month, or its last.

    Examples
    --------
    >>> months_after(date(2026, 1, 31), 1)
    datetime.date(2026, 2, 28)
    """
    year, month = divmod(day.year * 12 + day.month - 1 + months, 12)
    return date(year, month + 1, min(day.day, calendar.monthrange(year, month + 1)[1]))


def _degrees(values: tuple[float, ...]) -> list[float]:
    return [float(x) for x in np.degrees(values).round(9)]


def _pair(values: list[float]) -> tuple[float, float]:
    low, high = (float(x) for x in np.radians(values))
    return low, high


def _tool(record: Record) -> RegisteredTool:
    body = record.body
    return RegisteredTool(
        record.keys["serial"],
        body["name"],
        body["triads"],
        body.get("manufacturer", ""),
        body.get("customer", ""),
        body.get("description", ""),
        body.get("convention", "native"),
        _pair(body.get("range_deg", {}).get("inclination", [10.0, 90.0])),
        body.get("interval_months"),
        body.get("retired", False),
    )


def _rig(record: Record) -> RegisteredRig:
    body = record.body
    azimuth, inclination, toolface = (float(x) for x in np.radians(body["sd_deg"]))
    limits = {name: _pair(pair) for name, pair in body.get("stand", {}).items()}
    return RegisteredRig(
        record.keys["name"],
        (azimuth, inclination, toolface),
        **limits,
        description=body.get("description", ""),
        traceability=body.get("traceability", ""),
        place=body.get("place", ""),
        driver=body.get("driver", {}),
        dials=Dials(**body.get("dials", {})),
    )


def _site(record: Record) -> RegisteredSite:
    body = record.body
    dip, latitude = (
        None if degrees is None else float(np.radians(degrees))
        for degrees in (body.get("dip_deg"), body.get("latitude_deg"))
    )
    return RegisteredSite(
        record.keys["name"],
        body.get("g_mps2"),
        body.get("b_nT"),
        dip,
        body.get("laboratory", {}),
        body.get("description", ""),
        latitude,
    )


_LISTED: Final = 20_000
"""Extracts kept for one ledger; a record never changes, so an extract never grows old."""
T = TypeVar("T")


@dataclass(frozen=True)
class Listed:
    """A record without its body."""

    kind: str
    id: str
    seq: int
    created: str
    author: str
    keys: Mapping[str, Any]


def listed(ledger: Ledger, kind: str, *, limit: int = 50, before: int = 0, **keys: Any) -> list[Listed]:
    """Records of a kind with these keys, newest first, before the place `before` (0: from the end).

    Parameters
    ----------
    ledger : Ledger
    kind : str
        See `inclinometry.laboratory.ledger.engine.KINDS`.
    limit, before : int
    **keys
        Columns of the kind.
    """
    table, names = TABLES[kind], KINDS[kind].keys
    columns = [table.c[name] for name in ("id", "seq", "created", "author", *names)]
    query = select(*columns).order_by(table.c.seq.desc()).limit(limit)
    for name, value in keys.items():
        query = query.where(table.c[name] == value)
    if before:
        query = query.where(table.c.seq < before)
    with ledger.snapshot() as connection:
        rows = connection.execute(query).all()
    return [
        Listed(kind, row.id, row.seq, row.created, row.author, {name: getattr(row, name) for name in names})
        for row in rows
    ]


_KEPT: WeakKeyDictionary[Ledger, dict[tuple[str, str], Any]] = WeakKeyDictionary()
_LOCK = Lock()


def extract(ledger: Ledger, one: Listed, what: str, make: Callable[[Record], T]) -> T:
    """What `make` finds in the body of a listed record, read and worked out only once in a process.

    Parameters
    ----------
    what : str
        Name of the extract, the same for the same `make`.
    """
    with _LOCK:
        kept = _KEPT.setdefault(ledger, {})
        if (what, one.id) in kept:
            found: T = kept[what, one.id]
            return found
    found = make(ledger.get(one.kind, one.id))
    with _LOCK:
        kept[what, one.id] = found
        while len(kept) > _LISTED:
            del kept[next(iter(kept))]
    return found


def due_days(ledger: Ledger, tools: Sequence[RegisteredTool]) -> dict[str, date]:
    """Serial number -> day on which the next calibration is due, for many tools at once.

    Tools that are retired or without an agreed interval are left out.
    """
    asked = {tool.serial: tool.interval_months for tool in tools if tool.interval_months and not tool.retired}
    if not asked:
        return {}
    certified, registered = TABLES["certificate"], TABLES["tool"]
    with ledger.snapshot() as connection:
        last = _days(connection, certified, func.max(certified.c.created), asked)
        first = _days(connection, registered, func.min(registered.c.created), [s for s in asked if s not in last])
    found = {serial: months_after(day, asked[serial] or 0) for serial, day in last.items()}
    return {**first, **found}


def _days(connection: Any, table: Any, created: Any, serials: Any) -> dict[str, date]:
    names = list(serials)
    found = {}
    for start in range(0, len(names), 500):
        query = (
            select(table.c.serial, created.label("created"))
            .where(table.c.serial.in_(names[start : start + 500]))
            .group_by(table.c.serial)
        )
        found.update({row.serial: date.fromisoformat(row.created[:10]) for row in connection.execute(query)})
    return found

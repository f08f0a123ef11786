"""What a laboratory has: tools, rigs, sites, reference standards, itself; each changed by recording it again."""

from __future__ import annotations

import calendar
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, asdict, dataclass, field, fields, is_dataclass, replace
from datetime import date
from functools import cache
from threading import Lock
from typing import Annotated, Any, Final, NamedTuple, TypeVar, get_args, get_type_hints
from weakref import WeakKeyDictionary

import numpy as np
from annotated_types import Interval, MaxLen
from sqlalchemy import func, select

from inclinometry.arrays import Array, within
from inclinometry.calibration.conventions import USUAL, Dials
from inclinometry.calibration.initial_values import Stand, stand_within
from inclinometry.conventions import current_name
from inclinometry.digest import digest_bytes
from inclinometry.errors import out_of_range, refused
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.laboratory import Laboratory, Standard, laboratory_from
from inclinometry.laboratory.ledger.engine import KINDS, TABLES
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError, Record

T = TypeVar("T")


class ExternalField(NamedTuple):
    """What a field is called outside the program: in a body of the interface, and where a record keeps it.

    With a unit in the name; what ends in _deg is an angle, in radians inside.

    limits : lowest and highest value, in that unit; None where there are none.
    """

    name: str
    stored: str
    limits: tuple[float, float] | None = None


MONTHS: Final = range(1, 121)
"""Intervals between calibrations that can be agreed."""
Text = Annotated[str, MaxLen(2000)]
Pair = tuple[float, float]
Vectors = Mapping[str, Array]
"""Kind of triad -> (m,)."""


@dataclass(frozen=True)
class RegisteredTool:
    """A tool of a customer.

    triads : kind -> what is known of its sensors: number of channels, unit, axes ("+x+y+z"), any JSON values.
    interval_months : agreed months between calibrations; None when none is agreed, and then nothing is ever due.
    inclination_range : where it will work, rad.
    """

    serial: str
    name: Text
    triads: Annotated[Mapping[str, Mapping[str, Any]], MaxLen(3)] = field(default_factory=dict)
    manufacturer: Text = ""
    customer: Text = ""
    description: Text = ""
    convention: str = "native"
    inclination_range: Annotated[
        Pair, ExternalField("inclination_range_deg", "range_deg.inclination", (0.0, 180.0))
    ] = (
        float(np.radians(10.0)),
        float(np.radians(90.0)),
    )
    interval_months: Annotated[int | None, Interval(ge=MONTHS[0], le=MONTHS[-1])] = None
    retired: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "convention", current_name(self.convention))


@dataclass(frozen=True)
class RegisteredRig:
    """A stand: standard deviations of its three settings, rad; limits of its settings, rad; where its angles come from.

    dials : how its dials count; the limits are those of azimuth, inclination and toolface in the conventions.
    """

    name: str
    sd: Annotated[tuple[float, float, float], ExternalField("sd_deg", "sd_deg", (0.0, 10.0))]
    azimuth: Annotated[Pair, ExternalField("azimuth_deg", "stand.azimuth", (-360.0, 720.0))] = (0.0, 2.0 * np.pi)
    inclination: Annotated[Pair, ExternalField("inclination_deg", "stand.inclination", (0.0, 180.0))] = (0.0, np.pi)
    toolface: Annotated[Pair, ExternalField("toolface_deg", "stand.toolface", (-360.0, 720.0))] = (0.0, 2.0 * np.pi)
    description: Text = ""
    traceability: Text = ""
    place: Text = ""
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
    g: Annotated[float | None, ExternalField("g_mps2", "g_mps2", (9.5, 10.1))] = None
    b: Annotated[float | None, ExternalField("b_nT", "b_nT", (5e3, 2e5))] = None
    dip: Annotated[float | None, ExternalField("dip_deg", "dip_deg", (-90.0, 90.0)), Interval(ge=-90.0, le=90.0)] = None
    latitude: Annotated[
        float | None, ExternalField("latitude_deg", "latitude_deg", (-90.0, 90.0)), Interval(ge=-90.0, le=90.0)
    ] = None
    laboratory: Annotated[Mapping[str, Text], MaxLen(20)] = field(default_factory=dict)
    description: Text = ""


def declared(of: Any, first: int = 1) -> tuple[tuple[Field[Any], Any, ExternalField], ...]:
    """Fields of what is registered beside its key, with their types and what they are called outside.

    `first` is 0 for a record that has no key.
    """
    return _declared(of)[first:]


@cache
def _declared(of: Any) -> tuple[tuple[Field[Any], Any, ExternalField], ...]:
    hints = get_type_hints(of, include_extras=True)
    found = []
    for one in fields(of):
        marks = getattr(hints[one.name], "__metadata__", ())
        place = next((mark for mark in marks if isinstance(mark, ExternalField)), ExternalField(one.name, one.name))
        found.append((one, hints[one.name], place))
    return tuple(found)


def limits_of(of: type[Any], name: str) -> tuple[float, float]:
    """Lowest and highest value of a number or of each number of a field, in the unit it has outside."""
    limits = next((place.limits for one, _, place in declared(of) if one.name == name), None)
    return limits or (-np.inf, np.inf)


def external_value(name: str, value: Any) -> Any:
    """A value as it is written outside under this name."""
    if name.endswith("_deg") and value is not None:
        return np.degrees(value).round(9).tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, Mapping):
        return {key: external_value("", inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value


def to_record_body(one: Any, first: int = 1) -> dict[str, Any]:
    """The body of the record of a tool, rig or site, or of another record whose fields are `declared`."""
    body: dict[str, Any] = {}
    for field_, _, (name, place, _) in declared(type(one), first):
        group, _, last = place.rpartition(".")
        (body.setdefault(group, {}) if group else body)[last] = external_value(name, getattr(one, field_.name))
    return body


def from_record_body(of: type[T], key: str, said: Mapping[str, Any]) -> T:
    """The tool, rig or site of which a record or a body of the interface says this; the rest as declared."""
    return of(key, **given(of, said))  # type: ignore[call-arg]


def given(of: type[Any], said: Mapping[str, Any], first: int = 1) -> dict[str, Any]:
    """The fields of a record of which a stored body or one of the interface says this, by name."""
    inner = {
        f"{group}.{name}": x for group, about in said.items() if isinstance(about, Mapping) for name, x in about.items()
    }
    flat, found = {**said, **inner}, {}
    for one, hint, (name, place, _) in declared(of, first):
        if is_dataclass(hint):
            names = [f.name for f in fields(hint)]
            found[one.name] = hint(**{n: flat[p] for n in names for p in (n, f"{place}.{n}") if p in flat})  # type: ignore[operator]
        elif name in flat or place in flat:
            value = flat[name] if name in flat else flat[place]
            if name.endswith("_deg") and value is not None:
                value = np.radians(value).tolist()
            if isinstance(value, str) and date in get_args(hint):
                value = date.fromisoformat(value)
            if hint == Vectors:
                value = {kind: np.array(numbers) for kind, numbers in value.items()}
            found[one.name] = tuple(value) if isinstance(value, list) else value
    return found


def _within_limits(one: T, *names: str) -> T:
    """What is to be registered, its numbers (or those named) as floats; InputError outside the limits declared."""
    found: dict[str, Any] = {}
    for field_, _, (name, _, limits) in declared(type(one)):
        value = getattr(one, field_.name)
        if limits is not None and value is not None and (not names or field_.name in names):
            span = np.radians(limits) if name.endswith("_deg") else limits
            unit = {"g_mps2": "m/s^2", "b_nT": "nT"}.get(name, "rad")
            number = within(value, field_.name, float(span[0]), float(span[1]), unit).tolist()
            found[field_.name] = tuple(number) if isinstance(number, list) else number
    return replace(one, **found)  # type: ignore[type-var]


def put_tool(ledger: Ledger, tool: RegisteredTool, *, author: str) -> Record:
    """Register a tool, or record what changed.

    Raises InputError: A range of inclinations that is none, a serial number or text that cannot be recorded.
    """
    low, high = _within_limits(tool).inclination_range
    if low > high:
        raise out_of_range("inclination_range", (low, high), "low <= high")
    if tool.interval_months is not None and not MONTHS[0] <= tool.interval_months <= MONTHS[-1]:
        raise out_of_range("interval_months", tool.interval_months, f"{MONTHS[0]} .. {MONTHS[-1]}")
    return ledger.append("tool", {"serial": tool.serial}, to_record_body(tool), author=author)


def find_tool(ledger: Ledger, serial: str) -> RegisteredTool | None:
    """The tool as it is now; None when it was never registered."""
    record = ledger.latest("tool", serial=serial)
    return None if record is None else from_record_body(RegisteredTool, serial, record.body)


def tools(ledger: Ledger, *, limit: int = 1000, after: str = "") -> list[RegisteredTool]:
    """Tools by serial number, beyond `after`."""
    return [
        from_record_body(RegisteredTool, record.keys["serial"], record.body)
        for record in ledger.current("tool", limit=limit, after=after)
    ]


def put_rig(ledger: Ledger, rig: RegisteredRig, *, author: str) -> Record:
    """Register a rig, or record what changed."""
    stand_within(rig.azimuth, rig.inclination, rig.toolface, candidates=1)  # refuses limits that are none
    body = to_record_body(_within_limits(rig, "sd"))
    if rig.dials == USUAL:
        del body["dials"]
    return ledger.append("rig", {"name": rig.name}, body, author=author)


def find_rig(ledger: Ledger, name: str) -> RegisteredRig | None:
    """The rig as it is now; None when it was never registered."""
    record = ledger.latest("rig", name=name)
    return None if record is None else from_record_body(RegisteredRig, name, record.body)


def rig_of(ledger: Ledger, session: str) -> RegisteredRig | None:
    """The rig of a session as it was when the session was opened: its uncertainty is not changed after the readings."""
    opened = ledger.get("session", session)
    found = ledger.find("rig", name=opened.body["rig"], newest=True, after=opened.seq, limit=1)
    return from_record_body(RegisteredRig, found[0].keys["name"], found[0].body) if found else None


def dials_of(ledger: Ledger, rig: str, before: int = 0) -> Dials:
    """How a rig's dials are known to count, by the records before a place in the chain, by all of them when 0."""
    found = ledger.find("rig", name=rig, newest=True, after=before, limit=1)
    return from_record_body(RegisteredRig, rig, found[0].body).dials if found else USUAL


def rigs(ledger: Ledger) -> list[RegisteredRig]:
    """Rigs by name."""
    return [from_record_body(RegisteredRig, record.keys["name"], record.body) for record in ledger.current("rig")]


def put_site(ledger: Ledger, site: RegisteredSite, *, author: str) -> Record:
    """Register a site, or record what changed."""
    body = {name: value for name, value in to_record_body(_within_limits(site)).items() if value is not None}
    return ledger.append("site", {"name": site.name}, body, author=author)


def find_site(ledger: Ledger, name: str) -> RegisteredSite | None:
    """The site as it is now; None when it was never registered."""
    record = ledger.latest("site", name=name)
    return None if record is None else from_record_body(RegisteredSite, name, record.body)


def not_registered(kind: str, name: str) -> LedgerError:
    """The error of a tool, rig or site that is not in the ledger."""
    return LedgerError(Finding("session-not-registered", {"kind": kind, "name": f"{name:.80}"}))


def registered_site(ledger: Ledger, name: str) -> RegisteredSite:
    """The site of a name; LedgerError when it was never registered."""
    found = find_site(ledger, name)
    if found is None:
        raise not_registered("site", name)
    return found


def sites(ledger: Ledger) -> list[RegisteredSite]:
    """Sites by name."""
    return [from_record_body(RegisteredSite, record.keys["name"], record.body) for record in ledger.current("site")]


# Reference standards and the laboratory itself: events of the ledger, so that a program that does not know them reads
# the ledger as before. The newest event of a subject is how it is now.

LARGEST_LOGO: Final = 200_000
"""Bytes of a logo."""


def put_standard(ledger: Ledger, standard: Standard, *, author: str) -> Record:
    """Register a reference standard, or record what changed."""
    keys = {"subject_kind": "standard", "subject": standard.name, "action": "registered"}
    return ledger.append("event", keys, {"details": to_record_body(standard)}, author=author)


def find_standard(ledger: Ledger, name: str) -> Standard | None:
    """The standard as it is now; None when it was never registered."""
    record = ledger.latest("event", subject_kind="standard", subject=name, action="registered")
    return None if record is None else from_record_body(Standard, name, record.body["details"])


def standards(ledger: Ledger) -> list[Standard]:
    """Reference standards by name."""
    newest = {r.keys["subject"]: r for r in ledger.find("event", subject_kind="standard", action="registered")}
    return [from_record_body(Standard, name, newest[name].body["details"]) for name in sorted(newest)]


def logo_kind(data: bytes) -> str:
    """ "png" or "svg"; an SVG that refers to anything outside itself is refused."""
    if len(data) > LARGEST_LOGO:
        raise refused("file-large", {"what": "bytes", "size": len(data), "most": LARGEST_LOGO})
    kind = "png" if data.startswith(b"\x89PNG\r\n\x1a\n") else "svg" if b"<svg" in data[:2000] else ""
    lowered = data.lower()
    foreign = (b"<!doctype", b"<!entity", b"<script", b"<foreignobject", b'href="http', b"href='http", b"url(http")
    if not kind or (kind == "svg" and any(mark in lowered for mark in foreign)):
        raise refused("session-logo")
    import typst

    try:
        # what draws the certificate draws the logo: if it can, it can
        typst.compile(
            b"#set page(width: auto, height: auto)\n#image(bytes(json(bytes(sys.inputs.data))), height: 10mm)",
            sys_inputs={"data": str(list(data))},
        )
    except typst.TypstError as error:
        raise refused("file-format", {"format": kind.upper(), "reason": error.message[:120]}) from None
    return kind


def put_laboratory(ledger: Ledger, laboratory: Laboratory, *, author: str, logo: bytes | None = None) -> Record:
    """Record what the laboratory says on certificates; without `logo` it stays, an empty one removes it."""
    kept = dict(_settings(ledger).get("logo", {}))
    details: dict[str, Any] = {name: value for name, value in asdict(laboratory).items() if value}
    documents: list[tuple[str, bytes]] = []
    if logo:
        media = {"png": "image/png", "svg": "image/svg+xml"}[logo_kind(logo)]
        kept, documents = {"digest": digest_bytes(logo), "media_type": media}, [(media, logo)]
    if kept and logo != b"":
        details["logo"] = kept
    keys = {"subject_kind": "laboratory", "subject": "settings", "action": "recorded"}
    return ledger.append_all([Draft("event", keys, {"details": details}, documents)], author=author)[0]


def _settings(ledger: Ledger) -> Mapping[str, Any]:
    record = ledger.latest("event", subject_kind="laboratory", subject="settings", action="recorded")
    return {} if record is None else record.body["details"]


def find_laboratory(ledger: Ledger) -> Laboratory | None:
    """The laboratory as it is now; None when nothing was recorded of it."""
    about = dict(_settings(ledger))
    return laboratory_from(about) if about else None


def find_logo(ledger: Ledger) -> tuple[str, bytes] | None:
    """Media type and bytes of the laboratory's logo; None when it has none."""
    about = _settings(ledger).get("logo")
    return ledger.document(str(about["digest"])) if about else None


def months_after(day: date, months: int) -> date:
    """The same day of a later month, or its last.

    >>> months_after(date(2026, 1, 31), 1)
    datetime.date(2026, 2, 28)
    """
    year, month = divmod(day.year * 12 + day.month - 1 + months, 12)
    return date(year, month + 1, min(day.day, calendar.monthrange(year, month + 1)[1]))


def listed(ledger: Ledger, kind: str, *, limit: int = 50, before: int = 0, **keys: Any) -> list[Record]:
    """Records of a kind (`engine.KINDS`) with these keys, newest first, before the place `before` (0: from the end).

    Their bodies are not read: they are empty.
    """
    table, names = TABLES[kind], KINDS[kind].keys
    columns = [table.c[name] for name in ("id", "seq", "created", "author", "version", *names)]
    query = select(*columns).order_by(table.c.seq.desc()).limit(limit)
    for name, value in keys.items():
        query = query.where(table.c[name] == value)
    if before:
        query = query.where(table.c.seq < before)
    with ledger.snapshot() as connection:
        rows = connection.execute(query).all()
    return [
        Record(kind, r.id, r.seq, r.created, r.author, r.version, {name: getattr(r, name) for name in names}, {})
        for r in rows
    ]


def evaluations(ledger: Ledger, serial: str, *, limit: int = 10_000) -> list[Record]:
    """The calibrations of a tool in order, of each session the newest: one set of readings is one calibration."""
    newest = listed(ledger, "calibration", serial=serial, limit=limit)
    return list({one.keys["session"]: one for one in reversed(newest)}.values())


def calibration_before(ledger: Ledger, calibration: Record) -> Record | None:
    """The calibration of a tool by its readings before; None when there is none."""
    found = evaluations(ledger, calibration.keys["serial"])
    place = [one.keys["session"] for one in found].index(calibration.keys["session"])
    return ledger.get("calibration", found[place - 1].id) if place else None


_KEPT: Final[WeakKeyDictionary[Ledger, dict[tuple[str, str], Any]]] = WeakKeyDictionary()
_LOCK: Final = Lock()


def cached_from_record(ledger: Ledger, one: Record, what: str, make: Callable[[Record], T]) -> T:
    """What `make` finds in the body of a listed record, read and worked out only once in a process.

    `what` is the name of the extract, the same for the same `make`.
    """
    with _LOCK:
        kept = _KEPT.setdefault(ledger, {})
        if (what, one.id) in kept:
            found: T = kept[what, one.id]
            return found
    found = make(ledger.get(one.kind, one.id))
    with _LOCK:
        kept[what, one.id] = found
        # extracts kept for one ledger; a record never changes, so an extract never grows old
        while len(kept) > 20_000:
            del kept[next(iter(kept))]
    return found


def due_days(ledger: Ledger, tools: Sequence[RegisteredTool]) -> dict[str, date]:
    """Serial number -> day on which the next calibration is due, for many tools at once.

    Tools that are retired or without an agreed interval are left out.
    """
    asked = {tool.serial: tool.interval_months for tool in tools if tool.interval_months and not tool.retired}
    if not asked:
        return {}
    with ledger.snapshot() as connection:
        last: dict[str, date] = {}
        # from its certificate; from its calibration where it has none; a tool never calibrated is due at once
        made = TABLES["calibration"].c  # readings evaluated again are no newer
        calibrated = select(made.serial, func.min(made.created).label("created")).group_by(made.serial, made.session)
        for table in (TABLES["certificate"], calibrated.subquery()):
            last = {**_days(connection, table, func.max(table.c.created), asked.keys() - last.keys()), **last}
        table = TABLES["tool"]
        first = _days(connection, table, func.min(table.c.created), asked.keys() - last.keys())
    return {**first, **{serial: months_after(day, asked[serial] or 0) for serial, day in last.items()}}


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

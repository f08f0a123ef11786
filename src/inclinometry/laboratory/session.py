"""A guided run of positions: opened, captured reading by reading, resumed after anything, closed; all in the ledger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final

import numpy as np

from inclinometry.arrays import Array, finite, within
from inclinometry.calibration.conventions import USUAL, Dials
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import LARGEST, BenchReadings
from inclinometry.constants import KINDS
from inclinometry.errors import InputError, not_among, out_of_range, refused, wrong_shape
from inclinometry.files.json_codec import findings_in
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.ledger import ConflictError, Draft, Ledger, LedgerError, Record
from inclinometry.laboratory.placeholders import stated
from inclinometry.laboratory.registry import (
    ExternalField,
    RegisteredSite,
    Vectors,
    dials_of,
    find_site,
    given,
    not_registered,
    registered_site,
    to_record_body,
)
from inclinometry.rotations import wrap_positive
from inclinometry.workflow.calibrate import at_site

LOW, HIGH = -60.0, 250.0
"""Temperatures of any oven, degC."""


def positions_at_temperatures(plan: Plan, temperatures: Sequence[float]) -> tuple[Plan, tuple[float, ...]]:
    """All positions of a plan at each temperature (degC, in the order of the oven), and the target temperature of each.

    A reading is used with the temperature measured: a ramp will do as well as a soak, as long as the tool is even
    inside. The fit chooses the degree of the polynomial and states the range it holds in.
    """
    closest = 5.0  # two steps nearer to each other than this, degC, tell a polynomial nothing
    targets = within(list(temperatures), "temperatures", LOW, HIGH, "degC")
    apart = np.diff(np.sort(targets))
    if targets.size < 2 or (apart.size and apart.min() < closest):
        given_degrees = tuple(float(t) for t in targets)
        raise refused("session-temperatures", {"temperatures_degC": given_degrees, "apart_degC": closest})
    times = len(targets)
    sets = tuple(f"{t:g}:{name}" if name else "" for t in targets for name in (plan.roll_set or [""] * len(plan)))
    azimuth, inclination, toolface = (np.tile(x, times) for x in (plan.azimuth, plan.inclination, plan.toolface))
    name = f"{plan.name} at {times} temperatures"
    repeated = Plan(name, azimuth, inclination, toolface, sets if any(sets) else ())
    return repeated, tuple(float(t) for t in np.repeat(targets, len(plan)))


PURPOSES: Final = ("calibrate", "verify", "temperature")
MOST_POSITIONS: Final = 5000
CLOSING: Final = ("finished", "abandoned")
CLOSED: Final = Finding("session-closed", severity="refused")
EVALUATED: Final = "evaluated again"
"""What happened to a session whose site was stated after it was finished."""


@dataclass(frozen=True)
class Position:
    """One position of the plan: number from 1, what the rig's dials (azimuth, inclination, toolface) are to say, rad,
    name of its roll set.
    """

    number: int
    dial: tuple[float, float, float]
    roll_set: str = ""


@dataclass(frozen=True, eq=False)
class Capture:
    """What the sensors said while the tool stood still.

    channels, sd : kind -> (m,) mean over the window and standard deviation of one sample, in `units`.
    drift : kind -> (m,) change over the window by a straight line, in `units`.
    dial : (3,) azimuth, inclination, toolface as the rig's dials say them, rad.
    """

    channels: Vectors
    dial: Annotated[tuple[float, float, float], ExternalField("dial_deg", "dial_deg")]
    count: int = 1
    sd: Vectors = field(default_factory=dict)
    drift: Vectors = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    duration: Annotated[float, ExternalField("duration_s", "duration_s")] = 0.0
    temperature: Annotated[float | None, ExternalField("temperature_degC", "temperature_degC")] = None
    still: bool = True
    how: Annotated[str, ExternalField("captured", "captured")] = "key"
    note: str = ""


@dataclass(frozen=True)
class RecordedReading:
    """A reading as the ledger has it: its record, position and attempt, and the capture."""

    record: str
    number: int
    attempt: int
    created: str
    author: str
    capture: Capture
    rejected: str = ""


@dataclass(frozen=True)
class Session:
    """A session as the ledger has it now.

    taken, attempts : position -> its newest reading, number of readings. closed : "", "finished" or "abandoned".
    settings : as agreed when it was opened; the site as stated last. site : with its fields as known now.
    dials : how the dials count, as known now, or when the session was closed: dials stated wrongly are put right on the
        rig, and the readings stay.
    """

    id: str
    serial: str
    purpose: str
    plan: str
    positions: tuple[Position, ...]
    rig: str
    created: str
    author: str
    taken: Mapping[int, RecordedReading]
    attempts: Mapping[int, int]
    closed: str
    settings: Mapping[str, Any]
    dials: Dials = USUAL
    site: RegisteredSite | None = None

    @property
    def stated(self) -> Mapping[str, Any]:
        """What was stated with the readings: options of the fit, and what an imported file says of its stand."""
        found: Mapping[str, Any] = self.settings.get("settings", {})
        return found

    @property
    def stations(self) -> dict[int, str]:
        """Position with a reading -> name of its station: that of the imported file, or else the position's number."""
        named = dict(enumerate(self.stated.get("station", ()), 1))
        return {row.number: named.get(row.number, str(row.number)) for row in self.valid}

    @property
    def next(self) -> Position | None:
        """The first position of the plan without a valid reading; None when all have one."""
        return next((p for p in self.positions if not self.has(p.number)), None)

    def has(self, number: int) -> bool:
        """Whether the position has a reading that was not rejected."""
        return number in self.taken and not self.taken[number].rejected

    @property
    def valid(self) -> tuple[RecordedReading, ...]:
        """The newest reading of each position that was not rejected, in order of position."""
        return tuple(t for _, t in sorted(self.taken.items()) if not t.rejected)


def open_session(
    ledger: Ledger,
    serial: str,
    plan: Plan,
    *,
    rig: str,
    author: str,
    purpose: str = "calibrate",
    settings: Mapping[str, Any] | None = None,
    dialled: bool = False,
) -> Session:
    """Begin a run of positions with a registered tool on a rig; the session keeps what the dials say at them.

    Settings are further fields of the schema "session-2". `dialled`: the plan holds what the dials say already, as for
    readings that were taken.
    """
    if purpose not in PURPOSES:
        raise not_among("purpose", purpose, PURPOSES)
    if not 1 <= len(plan) <= MOST_POSITIONS:
        raise out_of_range("positions", len(plan), f"1 .. {MOST_POSITIONS}")
    for kind, keys in (("tool", {"serial": serial}), ("rig", {"name": rig})):
        if ledger.latest(kind, **keys) is None:
            raise not_registered(kind, next(iter(keys.values())))
    if site := (settings or {}).get("site"):
        registered_site(ledger, site)
    rows = plan.azimuth, plan.inclination, plan.toolface
    if not dialled:
        rows = dial_angles(dials_of(ledger, rig), rows)
    degrees = np.degrees(np.stack(rows, axis=1)).round(9)
    stated: dict[str, Any] = {"name": plan.name, "positions_deg": degrees.tolist()}
    if plan.roll_set:
        stated["roll_set"] = list(plan.roll_set)
    body = {**(settings or {}), "plan": stated, "rig": rig}
    record = ledger.append("session", {"serial": serial, "purpose": purpose}, body, author=author)
    return load_session(ledger, record.id)


def dial_angles(dials: Dials, setting: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """What dials say at azimuth, inclination, toolface of the conventions, rad: a reversed one from 0 to a full turn.

    >>> dials = Dials("horizontal", azimuth_counts="counterclockwise")
    >>> [float(x) for x in np.degrees(dial_angles(dials, tuple(np.radians([90.0, 30.0, 0.0])))).round(9)]
    [270.0, 60.0, 0.0]
    """
    azimuth, inclination, toolface = dials.dial_readings(*setting)
    if dials.base != USUAL.base or dials.azimuth_counts != USUAL.azimuth_counts:
        azimuth = wrap_positive(azimuth)
    if dials.base != USUAL.base or dials.toolface_counts != USUAL.toolface_counts:
        toolface = wrap_positive(toolface)
    return azimuth, inclination, toolface


def dial_at(dials: Dials, azimuth: float, inclination: float, toolface: float) -> tuple[float, float, float]:
    """`on_dials` of one setting, rad."""
    one, two, three = dial_angles(dials, (np.array(azimuth), np.array(inclination), np.array(toolface)))
    return float(one), float(two), float(three)


def setting_of(dials: Dials, dial: tuple[float, float, float]) -> tuple[float, float, float]:
    """Azimuth, inclination, toolface of the conventions for what the dials say, rad."""
    azimuth, inclination, toolface = (float(x) for x in dials.settings(*np.array(dial)))
    return azimuth, inclination, toolface


def positions_open(session: Session) -> Finding:
    """That positions have no valid reading."""
    open_ = [str(place.number) for place in session.positions if not session.has(place.number)]
    named = ", ".join(open_[:5]) + (", ..." if len(open_) > 5 else "")
    return Finding("session-positions-open", {"positions": named})


def load_session(ledger: Ledger, session: str) -> Session:
    """The session as it stands: after a power cut exactly what was acknowledged."""
    record = ledger.get("session", session)
    body, plan = record.body, record.body["plan"]
    ended, site = _closing(ledger, record.id), site_of(ledger, record)
    sets = plan.get("roll_set") or [""] * len(plan["positions_deg"])
    settings = {name: value for name, value in body.items() if name not in ("plan", "rig")}
    if "wanted" in settings:  # version 1
        settings["target_u_deg"] = settings.pop("wanted")
    places = enumerate(zip(plan["positions_deg"], sets, strict=True), 1)
    positions = tuple(Position(number, _radians(row), name) for number, (row, name) in places)
    taken: dict[int, RecordedReading] = {}
    attempts: dict[int, int] = {}
    for reading in ledger.find("reading", session=record.id, limit=20 * MOST_POSITIONS):
        found = _reading_from_record(reading)
        taken[found.number] = found
        attempts[found.number] = max(attempts.get(found.number, 0), found.attempt)
    numbers = {one.record: number for number, one in taken.items()}
    records = list(numbers)
    for some in (records[start : start + 500] for start in range(0, len(records), 500)):
        for event in ledger.find("event", subject_kind="reading", action="rejected", subject=some):
            number, reason = numbers[event.keys["subject"]], str(event.body.get("reason", ""))
            taken[number] = replace(taken[number], rejected=reason or "rejected")
    return Session(
        record.id,
        record.keys["serial"],
        record.keys["purpose"],
        plan["name"],
        positions,
        body["rig"],
        record.created,
        record.author,
        taken,
        attempts,
        "" if ended is None else str(ended.keys["action"]),
        settings | ({"site": site} if site else {}),
        dials_of(ledger, body["rig"], 0 if ended is None else ended.seq),
        find_site(ledger, site),
    )


def site_of(ledger: Ledger, session: Record) -> str:
    """Name of the site of a session as it was stated last; empty where none was."""
    again = ledger.latest("event", subject_kind="session", subject=session.id, action=EVALUATED)
    return str(session.body.get("site", "") if again is None else again.body["details"]["site"])


def sessions(ledger: Ledger, *, serial: str | None = None, limit: int = 100, before: int = 0) -> list[Record]:
    """Session records, newest first."""
    keys = {} if serial is None else {"serial": serial}
    return ledger.find("session", newest=True, after=before, limit=limit, **keys)


def closing_status(ledger: Ledger, session: str) -> str:
    """What closed a session: "finished", "abandoned", or "" while it is open."""
    found = _closing(ledger, session)
    return "" if found is None else str(found.keys["action"])


def _closing(ledger: Ledger, session: str) -> Record | None:
    events = ledger.find("event", subject_kind="session", subject=session)
    return next((record for record in events if record.keys["action"] in CLOSING), None)


def capture(
    ledger: Ledger, session: str, number: int, taken: Capture, *, author: str, attempt: int | None = None
) -> RecordedReading:
    """Record the reading of a position, from 1, added ones after the plan's; when this returns it survives a power cut.

    `attempt` is the one the caller believes this is: given, a reading another user took meanwhile raises
    ConflictError.
    """
    if closing_status(ledger, session):
        raise LedgerError(CLOSED)
    before = ledger.count("reading", session=session, position=number)
    planned = len(ledger.get("session", session).body["plan"]["positions_deg"])
    follows = number <= planned + 1 or ledger.count("reading", session=session, position=number - 1) > 0
    if not 1 <= number <= MOST_POSITIONS or not follows:
        raise out_of_range("position", number, f"1 .. {planned + 1}")
    if attempt is not None and attempt <= before:
        raise ConflictError(Finding("ledger-conflict", {"ledger": ledger.shown}))
    if attempt is not None and attempt > before + 1:
        raise out_of_range("attempt", attempt, f"<= {before + 1}")
    keys = {"session": session, "position": number, "attempt": before + 1}
    # whoever closes the session at this moment is noticed
    draft = Draft("reading", keys, _capture_body(taken))
    return _reading_from_record(ledger.append_all([draft], author=author, unless=[require_open(session)])[0])


def reading_draft(session: str, number: int, taken: Capture) -> Draft:
    """The record of the first reading of a position, for recording many of a new session in one step."""
    return Draft("reading", {"session": session, "position": number, "attempt": 1}, _capture_body(taken))


def reject(ledger: Ledger, taken: RecordedReading, reason: str, *, author: str) -> None:
    """Leave a reading out from now on; it stays in the ledger with the reason."""
    if not stated(reason):
        raise refused("input-missing", {"names": ("reason",)})
    keys = {"subject_kind": "reading", "subject": taken.record, "action": "rejected"}
    ledger.append("event", keys, {"reason": reason}, author=author)


def close_session(ledger: Ledger, session: str, how: str, *, author: str, reason: str = "") -> None:
    """Close a session: "finished" or "abandoned"; nothing more is captured in it."""
    if how == "abandoned" and not stated(reason):
        raise refused("input-missing", {"names": ("reason",)})
    if closing_status(ledger, session):
        raise LedgerError(CLOSED)
    ledger.append_all([close_session_draft(session, how, reason)], author=author, unless=[require_open(session)])


def close_session_draft(session: str, how: str, reason: str = "") -> Draft:
    """The record that closes a session, for recording it together with what the session gave."""
    if how not in CLOSING:
        raise not_among("how", how, CLOSING)
    return Draft("event", {"subject_kind": "session", "subject": session, "action": how}, {"reason": reason})


def require_open(session: str) -> tuple[str, Mapping[str, Any], Finding]:
    """For what may be recorded only while a session is open: two who finish at once record one result."""
    return "event", {"subject_kind": "session", "subject": session, "action": list(CLOSING)}, CLOSED


def file_statements(readings: BenchReadings) -> dict[str, Any]:
    """What a file says beside its readings, as the settings of a session keep it; `bench_readings` takes it up."""
    reference = {_FIELDS[name][0]: value / _FIELDS[name][1] for name, value in readings.reference.items()}
    said = {"reference": reference, "findings": [one.stored() for one in readings.findings]}
    return {"station": list(readings.station), **{name: value for name, value in said.items() if value}}


_FIELDS: Final = {"g": ("g_mps2", 1.0), "b": ("b_nT", 1.0)} | {
    name: (f"{name}_deg", float(np.radians(1.0))) for name in ("dip", "latitude", "north")
}
"""Reference of readings -> its name in a record and that unit in SI."""


def bench_readings(session: Session) -> BenchReadings:
    """The valid readings as a calibration takes them, dials converted, with the fields of the site.

    What an imported file says of its stand and readings is as in the file. Of captured readings the scatter of the
    samples, where each position has enough of them, is the standard deviation.
    """
    rows = session.valid
    if not rows:
        raise InputError(positions_open(session))
    kinds = [kind for kind in KINDS if kind in rows[0].capture.channels]
    shapes = [{kind: len(signals) for kind, signals in row.capture.channels.items()} for row in rows]
    for row, shape in zip(rows, shapes, strict=True):
        if shape != shapes[0]:
            raise refused("session-channels", {"position": row.number})
    azimuth, inclination, toolface = np.array([row.capture.dial for row in rows]).T
    heat = [row.capture.temperature for row in rows]
    names = {p.number: p.roll_set for p in session.positions}
    roll_set = [names.get(row.number, "") for row in rows]
    said, imported = session.stated, all(row.capture.how == "import" for row in rows)
    kept = {_FIELDS[name][0]: name for name in _FIELDS}
    sd = {
        kind: np.stack([row.capture.sd[kind] / np.sqrt(row.capture.count) for row in rows])
        for kind in kinds
        if all(kind in row.capture.sd for row in rows)
    }
    # from so many samples on, their scatter is taken for the noise of the sensors
    if not imported:
        sd = {} if len(sd) < len(kinds) or any(row.capture.count < 8 for row in rows) else sd
        # one sensor has one noise: what few samples say of it at one position is pooled over all
        sd = {kind: np.broadcast_to(np.sqrt(np.mean(v**2, axis=0)), v.shape) for kind, v in sd.items()}
        sd = {} if any((v <= 0.0).any() for v in sd.values()) else sd
    readings = BenchReadings(
        {kind: np.stack([row.capture.channels[kind] for row in rows]) for kind in kinds},
        azimuth,
        inclination,
        toolface,
        station=list(session.stations.values()),
        sd=sd,
        count=np.array([float(row.capture.count) for row in rows]),
        temperature=None if None in heat else np.array(heat, dtype=float),
        roll_set=roll_set if any(roll_set) else (),
        units=dict(rows[0].capture.units),
        reference={kept[name]: value * _FIELDS[kept[name]][1] for name, value in said.get("reference", {}).items()},
        findings=findings_in(said),
        digest=said.get("imported", "") if imported else "",
    )
    return at_site(session.dials.read(readings), session.site)


def _radians(row: Sequence[float]) -> tuple[float, float, float]:
    azimuth, inclination, toolface = (float(x) for x in np.radians(np.asarray(row, dtype=float)))
    return azimuth, inclination, toolface


def _capture_body(taken: Capture) -> dict[str, Any]:
    dial = finite(taken.dial, "dial", (3,))
    for name, angle in zip(("azimuth", "inclination", "toolface"), dial, strict=True):
        if abs(angle) > 2.0 * np.pi:
            raise out_of_range(f"{name}_deg", float(np.degrees(angle)), "-360 .. 360")
    if taken.temperature is not None:
        # degC that a tool in a laboratory may have
        within(taken.temperature, "temperature", -100.0, 400.0, "degC")
    for kind, signals in taken.channels.items():
        within(finite(signals, kind, (None,)), kind, -LARGEST, LARGEST)
        for name in ("sd", "drift"):
            given = getattr(taken, name).get(kind)
            if given is not None and np.shape(given) != np.shape(signals):
                raise wrong_shape(f"{name}.{kind}", np.shape(given), str(np.shape(signals)))
        within(taken.sd.get(kind, 0.0), f"sd.{kind}", 0.0, LARGEST)
    if taken.count < 1:
        raise out_of_range("count", taken.count, ">= 1")
    vectors: dict[str, Any] = {
        name: {kind: finite(v, f"{kind}.{name}", (None,)) for kind, v in getattr(taken, name).items()}
        for name in ("channels", "sd", "drift")
    }
    body = to_record_body(replace(taken, **vectors), 0)
    return {name: value for name, value in body.items() if value or name not in (*vectors, "note")}


def _reading_from_record(record: Record) -> RecordedReading:
    keys, found = record.keys, Capture(**given(Capture, {"channels": {}, **record.body}, 0))
    return RecordedReading(record.id, keys["position"], keys["attempt"], record.created, record.author, found)

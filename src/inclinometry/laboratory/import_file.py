"""Files of the command line brought into the ledger: bench readings as a session, tool.json as a calibration."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError, InputError, in_file, out_of_range, refused
from inclinometry.files.tool_json import read_calibration
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.laboratory import begun
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, Record
from inclinometry.laboratory.progress import on_rig
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredSite,
    find_rig,
    find_tool,
    not_registered,
    registered_site,
)
from inclinometry.laboratory.results import calibration_body, plain_content
from inclinometry.laboratory.session import (
    MOST_POSITIONS,
    Capture,
    close_session,
    close_session_draft,
    file_statements,
    open_session,
    reading_draft,
)
from inclinometry.workflow.calibrate import Fields, Options, at_site, calibrate, given, readings_at

LARGEST: Final = 5_000_000
"""Bytes of a file; a bench run of thousands of positions has less."""
SHOWN: Final = "the file"


def import_file(
    ledger: Ledger,
    content: bytes,
    serial: str,
    rig: str,
    *,
    author: str,
    site: str = "",
    fields: Fields | None = None,
    options: Options | None = None,
    purpose: str = "calibrate",
    performed: date | None = None,
    doses: Mapping[str, float] | None = None,
) -> Record:
    """Record a CSV of bench readings, as an open session, or tool.json, as a calibration; the content tells which.

    The file holds what the rig's dials say. `fields` are of a site that is not registered; the rig's standard
    deviations are those registered. `performed` is the day of the measurement, `doses` what the tool did before it
    (`drift.DOSES`).
    """
    for kind, name, known in (("tool", serial, find_tool(ledger, serial)), ("rig", rig, find_rig(ledger, rig))):
        if known is None:
            raise not_registered(kind, name)
    known_site = registered_site(ledger, site) if site else None
    found = file_content(content, fields)
    if not isinstance(found, Calibration):
        at_site(found, known_site)
    if performed is not None:
        begun(performed, "performed")
    said: dict[str, Any] = {"imported": digest_bytes(content)}
    if performed is not None:
        said["performed"] = performed.isoformat()
    said |= {name: value for name, value in (doses or {}).items() if value}
    said |= {} if options is None else given(options)
    settings = {**({"site": site} if site else {}), "settings": said}
    if isinstance(found, Calibration):
        _refuse_stated(fields, options)
        _made_before_now(content)
        return record_calibration(ledger, found, serial, rig, settings, author=author)
    azimuth, inclination, toolface = found.dials
    if found.off_stand is not None:  # a session has positions of dials alone
        raise in_file(refused("input-not-with", {"name": "part", "other": "ledger"}), SHOWN)
    said |= file_statements(found)
    plan = Plan("imported", azimuth, inclination, toolface, found.roll_set)
    captures = [_capture(found, row) for row in range(len(plan))]
    session = open_session(
        ledger, serial, plan, rig=rig, author=author, purpose=purpose, settings=settings, dialled=True
    )
    drafts = [reading_draft(session.id, number, taken) for number, taken in enumerate(captures, 1)]
    try:
        ledger.append_all(drafts, author=author)
    except InputError:
        close_session(ledger, session.id, "abandoned", author=author, reason="the file could not be recorded")
        raise
    return ledger.get("session", session.id)


def try_file(content: bytes, rig: RegisteredRig, site: Fields | None, options: Options) -> Calibration:
    """The calibration of a file on a rig, of which nothing is recorded; errors as of `calibrate`."""
    found = file_content(content, site)
    if isinstance(found, Calibration):
        _refuse_stated(None if isinstance(site, RegisteredSite) else site, options)
        return found
    return calibrate(rig.dials.read(found), "joint", on_rig(options, rig))


def _refuse_stated(fields: Fields | None, options: Options | None) -> None:
    if fields is not None or (options is not None and given(options)):
        raise refused("input-not-with", {"name": "site, options", "other": "tool.json"})


def file_content(content: bytes, fields: Fields | None = None) -> BenchReadings | Calibration:
    """Bench readings as `calibrate` reads them, with their dials as they are; or the calibration of a tool.json.

    Raises FileError: too large, empty, neither of the two; with line, value and remedy.
    """
    if not content:
        raise FileError(Finding("file-empty", {"what": "readings"}), path=SHOWN)
    if len(content) > LARGEST:
        raise FileError(Finding("file-large", {"what": "bytes", "size": len(content), "most": LARGEST}), path=SHOWN)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "file")
        path.write_bytes(content)
        try:
            # readings may be JSON too: columns, or an object a line
            if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") and b'"schema"' in content:
                return read_calibration(path)
            found = readings_at(path, fields)
        except FileError as error:
            if b"\0" in content[:1000]:  # a picture, a document
                other = Finding("file-format", {"format": "CSV, tool.json", "reason": "binary content"})
                raise FileError(other, path=SHOWN) from None
            raise in_file(error, SHOWN) from None
    if len(found) > MOST_POSITIONS:
        raise in_file(out_of_range("stations", len(found), f"1 .. {MOST_POSITIONS}"), SHOWN)
    return found


def _made_before_now(content: bytes) -> None:
    """FileError for a calibration whose file says that it is made on a day to come."""
    try:
        day = date.fromisoformat(str(json.loads(content)["created"])[:10])
    except ValueError:  # no date, or none that can be read: it says nothing
        return
    try:
        begun(day, "created")
    except InputError as error:
        raise in_file(error, SHOWN) from None


def _capture(readings: BenchReadings, row: int) -> Capture:
    count = 1.0 if readings.count is None else float(readings.count[row])
    azimuth, inclination, toolface = (float(dial[row]) for dial in readings.dials)
    return Capture(
        {kind: values[row] for kind, values in readings.channels.items()},
        (azimuth, inclination, toolface),
        count=max(1, round(count)),
        sd={kind: values[row] * np.sqrt(count) for kind, values in readings.sd.items()},
        units=dict(readings.units),
        temperature=None if readings.temperature is None else float(readings.temperature[row]),
        how="import",
        note=f"station {readings.station[row]}"[:10_000],
    )


def record_calibration(
    ledger: Ledger, found: Calibration, serial: str, rig: str, settings: Mapping[str, Any], *, author: str
) -> Record:
    """Record a calibration made elsewhere, with an empty session that says where it came from and when."""
    plan = {"name": "imported", "positions_deg": []}
    keys = {"serial": serial, "purpose": "calibrate"}
    body = calibration_body(found, plain_content(found), [], rig, "imported", len(found.residuals.station))
    session = ledger.append("session", keys, {**settings, "plan": plan, "rig": rig}, author=author)
    drafts = [
        Draft("calibration", {"serial": serial, "session": session.id}, body),
        close_session_draft(session.id, "finished", "imported"),
    ]
    return ledger.append_all(drafts, author=author)[0]

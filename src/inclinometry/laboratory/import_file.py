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
from inclinometry.errors import FileError, InputError
from inclinometry.files.bench_csv import read_bench
from inclinometry.files.tool_json import read_calibration
from inclinometry.files.writing import program
from inclinometry.laboratory.certificate.laboratory_toml import begun
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError, Record
from inclinometry.laboratory.registry import find_rig, find_tool
from inclinometry.laboratory.results import expected_table, parameters, plain_content
from inclinometry.laboratory.session import (
    MOST_POSITIONS,
    Capture,
    close_session,
    close_session_draft,
    open_session,
    reading_draft,
)

LARGEST: Final = 5_000_000
"""Bytes of a file; a bench run of thousands of positions has less."""
SHOWN: Final = "the file"
OTHER: Final = "it holds neither bench readings nor a calibration; choose a CSV file or tool.json"


def import_file(
    ledger: Ledger,
    content: bytes,
    serial: str,
    rig: str,
    *,
    author: str,
    site: str = "",
    purpose: str = "calibrate",
    performed: date | None = None,
    doses: Mapping[str, float] | None = None,
) -> Record:
    """Record what a file holds: a CSV of bench readings, or tool.json.

    What kind of file it is, is told from its content; no name that came with it is used.

    Parameters
    ----------
    content : bytes
    serial, rig, site : str
        Tool, rig and site as registered; no site when empty. The file holds what the rig's dials say.
    purpose : {"calibrate", "verify", "temperature"}
        Of the session of readings.
    performed : date, optional
        Day of the measurement, where it is not that of the import.
    doses : mapping, optional
        What the tool did since its calibration before: `laboratory.drift.DOSES`.

    Returns
    -------
    Record
        A session, open, with all readings; or a calibration.

    Raises
    ------
    FileError
        Too large, empty, neither of the two, without rig angles; with line, value and remedy.
    LedgerError
        A tool or rig that is not registered.
    """
    if not content:
        raise FileError("nothing is in it (0 bytes); choose another file", path=SHOWN)
    if len(content) > LARGEST:
        raise FileError(f"{len(content)} bytes are too many; allowed {LARGEST}", path=SHOWN)
    if find_tool(ledger, serial) is None:
        raise LedgerError(f"tool {serial!r} is not registered; register it first")
    if find_rig(ledger, rig) is None:
        raise LedgerError(f"rig {rig!r} is not registered; register it first")
    settings: dict[str, Any] = {"site": site} if site else {}
    settings["settings"] = {"imported": digest_bytes(content)}
    if performed is not None:
        settings["settings"]["performed"] = performed.isoformat()
    settings["settings"] |= {name: value for name, value in (doses or {}).items() if value}
    found = _read(content)
    if performed is not None:
        begun(performed, "performed")
    if isinstance(found, Calibration):
        _made_before_now(content)
        return record_calibration(ledger, found, serial, rig, settings, author=author)
    if found.azimuth is None or found.inclination is None or found.toolface is None:
        raise FileError("no rig angles; the columns azimuth_deg, inclination_deg, toolface_deg are needed", path=SHOWN)
    if len(found.station) > MOST_POSITIONS:
        raise FileError(f"{len(found.station)} stations; allowed {MOST_POSITIONS}", path=SHOWN)
    plan = Plan("imported", found.azimuth, found.inclination, found.toolface, found.roll_set)
    captures = [_capture(found, row) for row in range(len(plan))]
    session = open_session(
        ledger, serial, plan, rig=rig, author=author, purpose=purpose, settings=settings, dialled=True
    )
    drafts = [reading_draft(session.id, number, taken) for number, taken in enumerate(captures, 1)]
    try:
        ledger.append_all(drafts, author=author)
    except InputError as error:
        close_session(ledger, session.id, "abandoned", author=author, reason="the file could not be recorded")
        raise LedgerError(f"the readings cannot be recorded: {error}") from None
    return ledger.get("session", session.id)


def _read(content: bytes) -> BenchReadings | Calibration:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "file")
        path.write_bytes(content)
        try:
            if content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
                return read_calibration(path)
            return read_bench(path)
        except FileError as error:
            if b"\0" in content[:1000]:  # a picture, a document
                raise FileError(OTHER, path=SHOWN) from None
            raise FileError(error.problem, path=SHOWN, line=error.line) from None


def _made_before_now(content: bytes) -> None:
    """FileError for a calibration whose file says that it is made on a day to come."""
    try:
        day = date.fromisoformat(str(json.loads(content)["created"])[:10])
    except ValueError:  # no date, or none that can be read: it says nothing
        return
    try:
        begun(day, "created")
    except InputError as error:
        raise FileError(str(error), path=SHOWN) from None


def _capture(readings: BenchReadings, row: int) -> Capture:
    count = 1.0 if readings.count is None else float(readings.count[row])
    azimuth, inclination, toolface = (float(dial[row]) for dial in readings.dials)
    notes = [f"station {readings.station[row]}", *((*readings.notes, *readings.warnings) if row == 0 else ())]
    return Capture(
        {kind: values[row] for kind, values in readings.channels.items()},
        (azimuth, inclination, toolface),
        count=max(1, round(count)),
        sd={kind: values[row] * np.sqrt(count) for kind, values in readings.sd.items()},
        units=dict(readings.units),
        temperature=None if readings.temperature is None else float(readings.temperature[row]),
        how="import",
        note="; ".join(notes)[:10_000],
    )


def record_calibration(
    ledger: Ledger, found: Calibration, serial: str, rig: str, settings: Mapping[str, Any], *, author: str
) -> Record:
    """Record a calibration made elsewhere, with an empty session that says where it came from and when.

    Parameters
    ----------
    serial, rig : str
        As registered.
    settings : mapping
        Of the session, as `session.open_session` takes them.
    """
    plan = {"name": "imported", "positions_deg": []}
    keys = {"serial": serial, "purpose": "calibrate"}
    body = {
        "tool_json": plain_content(found),
        "method": found.method,
        "readings": [],
        "capability_deg": expected_table(found),
        "summary": {
            "rig": rig,
            "plan": "imported",
            "positions": len(found.residuals.station),
            "warnings": list(found.warnings),
            "parameters": [[name, *pair] for name, pair in parameters(found).items()],
        },
        "program": program(),
    }
    session = ledger.append("session", keys, {**settings, "plan": plan, "rig": rig}, author=author)
    drafts = [
        Draft("calibration", {"serial": serial, "session": session.id}, body),
        close_session_draft(session.id, "finished", "imported"),
    ]
    return ledger.append_all(drafts, author=author)[0]

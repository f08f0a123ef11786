"""Files brought into the ledger: readings, tool.json, and everything that is neither."""

from __future__ import annotations

import json
from datetime import UTC, date, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.errors import FileError, InputError
from inclinometry.laboratory.import_file import LARGEST, import_file
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.results import calibration_of, finish_calibration, history
from inclinometry.laboratory.session import Session, bench_readings, load_session, open_session
from inclinometry.laboratory.verification import begin_verification
from inclinometry.simulate.tool import realistic_tool

HEAD = "station,azimuth_deg,inclination_deg,toolface_deg,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z"


def _csv(session: Session) -> bytes:
    rows = [HEAD]
    for taken in session.valid:
        channels = taken.capture.channels
        values = np.concatenate([np.degrees(taken.capture.dial).round(9), channels["accelerometer"]])
        values = np.concatenate([values, channels["magnetometer"]])
        rows.append(",".join([f"=cmd()|{taken.number}", *(repr(float(x)) for x in values)]))
    return "\n".join(rows).encode()


def test_what_a_file_says_of_its_stand_reaches_a_verification_and_old_sessions_have_none(
    laboratory: Ledger, bench: SimpleNamespace
) -> None:
    """The record keeps fields with their units; a session recorded before has no such settings and reads as ever."""
    text = _csv(bench.calibrated(laboratory, plans.twelve())).decode().splitlines()
    lines = [f"{text[0]},reference_g_m_s2,reference_dip_deg", *(f"{line},9.81,70" for line in text[1:])]
    record = import_file(laboratory, "\n".join(lines).encode(), "IN-7", "stand 1", author="anna")
    assert record.body["settings"]["reference"] == pytest.approx({"g_mps2": 9.81, "dip_deg": 70.0})
    made = finish_calibration(laboratory, record.id, author="anna")
    assert calibration_of(made).tool.triads["accelerometer"].field_strength == 9.81
    judged = begin_verification(laboratory, made.id, "roll-4", author="anna")
    assert judged.settings["settings"]["reference"] == record.body["settings"]["reference"]
    old = {"settings": {"imported": record.body["settings"]["imported"]}}
    before = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="anna", settings=old)
    readings = bench_readings(bench.take(laboratory, before, bench.sensors(realistic_tool(7), 1)))
    assert (dict(readings.reference), readings.station[:2], readings.findings) == ({}, ("1", "2"), ())


@pytest.mark.long
def test_readings_become_a_session(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The same calibration as from the readings captured on the stand, whatever the stations are called."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    record = import_file(laboratory, _csv(session), "IN-7", "stand 1", author="anna")
    seen = load_session(laboratory, record.id)
    assert (len(seen.valid), seen.closed, seen.plan) == (24, "", "imported")
    assert {taken.capture.how for taken in seen.valid} == {"import"}
    assert seen.valid[0].capture.note.startswith("station =cmd()|1")
    first = finish_calibration(laboratory, session.id, author="anna")
    again = finish_calibration(laboratory, record.id, author="anna")
    assert again.body["readings"] == [taken.record for taken in seen.valid]
    pair = [np.array([row[1] for row in one.body["summary"]["parameters"]]) for one in (first, again)]
    np.testing.assert_allclose(pair[1], pair[0], rtol=1e-3, atol=1.0)
    assert verify(laboratory).ok


def test_tool_json_becomes_a_calibration(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Digit by digit, with a closed session that says where it came from."""
    made = bench.finished(laboratory)
    content = json.dumps(made.body["tool_json"]).encode()
    day = date(2020, 5, 1)
    record = import_file(laboratory, content, "IN-7", "stand 1", author="anna", performed=day)
    assert record.kind == "calibration"
    np.testing.assert_array_equal(calibration_of(record).covariance, calibration_of(made).covariance)
    session = load_session(laboratory, record.keys["session"])
    assert session.closed == "finished"
    assert session.settings["settings"]["imported"].startswith("sha256:")
    # recorded last, measured first
    found = history(laboratory, "IN-7")
    assert found.records == [record.id, made.id]
    assert found.measured == [day, date.fromisoformat(made.created[:10])]


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "file-empty"),
        (b"x" * (LARGEST + 1), "file-large"),
        (b"a,b\n1,2\n", "file-column"),
        (HEAD.encode() + b"\nA,0,0,0,1,2,nan,4,5,6\n", "the file"),
        (HEAD.encode() + b"\nA,0,0,0,1,2,=1+1,4,5,6\n", "line 2"),
        (b"{}", "file-empty"),
        (b"\x89PNG\r\n\x1a\n\0\0", "file-format"),
        (b'{"schema": "inclinometry/tool"', "the file"),
        (b"{" * 200_000, "the file"),
        (b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><x>&e;</x>', "the file"),
        (b"PK\x03\x04" + bytes(100), "the file"),
        (b"\xff\xfe\x00\x01" * 50, "the file"),
    ],
)
def test_what_is_neither_is_refused(laboratory: Ledger, content: bytes, problem: str) -> None:
    """Said without a path of the server; nothing is recorded."""
    before = laboratory.head()
    with pytest.raises(FileError) as told:
        import_file(laboratory, content, "IN-7", "stand 1", author="anna")
    found = told.value.finding
    assert problem in (str(told.value) if found is None else f"{found.code} {told.value}")
    assert "/tmp" not in str(told.value)
    assert laboratory.head() == before


def test_a_calibration_of_a_day_to_come_is_refused(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """By its file or by whoever brings it in; today is no day to come, wherever on Earth the laboratory stands."""
    made = bench.finished(laboratory)
    content, today = made.body["tool_json"], datetime.now(UTC)

    def brought(created: str | None, performed: date | None = None) -> str:
        data = json.dumps({**content, "created": created}).encode()
        return import_file(laboratory, data, "IN-7", "stand 1", author="anna", performed=performed).kind

    before = laboratory.head()
    for days in (2, 40_000):
        day = today + timedelta(days=days)
        with refused("input-value", error=FileError, name="created", value=f"{day:%Y-%m-%d}"):
            brought(day.isoformat())
        with refused("input-value", error=InputError, name="performed", value=f"{day:%Y-%m-%d}"):
            brought(None, day.date())
    assert laboratory.head() == before
    for created in (None, "last spring", today.isoformat()):
        assert brought(created, today.date()) == "calibration"


def test_tool_and_rig_must_be_registered(laboratory: Ledger) -> None:
    """Nothing is made up from a file."""
    for serial, rig in (("../../etc", "stand 1"), ("IN-7", "<script>")):
        with refused("session-not-registered", error=LedgerError):
            import_file(laboratory, b"a,b\n1,2\n", serial, rig, author="anna")
    text = (HEAD + "\nA,0,0,0,1,2,3,4,5,6\n").encode()
    with refused("input-choice", name="purpose"):
        import_file(laboratory, text, "IN-7", "stand 1", author="anna", purpose="x")

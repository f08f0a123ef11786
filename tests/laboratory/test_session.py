"""A session: captured, resumed, retaken, conflicting, closed; and it calibrates the tool it was taken with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import ConflictError, Ledger, LedgerError
from inclinometry.laboratory.session import (
    Capture,
    Session,
    bench_readings,
    capture,
    close_session,
    load_session,
    open_session,
    reject,
)
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool


@pytest.fixture
def opened(tmp_path: Path) -> tuple[Ledger, Session]:
    """A ledger with a tool, a rig and an open session of twelve positions."""
    ledger = create(tmp_path / "ledger.sqlite")
    ledger.append("tool", {"serial": "IN-7"}, {"name": "steering tool", "triads": {}}, author="a")
    ledger.append("rig", {"name": "stand 1"}, {"sd_deg": [0.1, 0.1, 0.1]}, author="a")
    return ledger, open_session(ledger, "IN-7", plans.twelve(), rig="stand 1", author="a")


def one(session: Session, number: int, value: float = 1.0) -> Capture:
    """A made-up reading of a position."""
    return Capture({"accelerometer": np.array([value, 2.0, 3.0])}, session.positions[number - 1].dial, 10)


def test_what_was_acknowledged_is_there_after_a_restart(opened: tuple[Ledger, Session]) -> None:
    """A new process sees every capture, and the next position."""
    ledger, session = opened
    for number in (1, 2, 3):
        capture(ledger, session.id, number, one(session, number), author="a")
    with Ledger(ledger.where) as again:
        seen = load_session(again, session.id)
    assert seen.next is not None
    assert seen.next.number == 4
    assert [t.number for t in seen.valid] == [1, 2, 3]
    assert seen.positions == session.positions


def test_a_position_can_be_taken_again_and_rejected(opened: tuple[Ledger, Session]) -> None:
    """The newest reading counts, the old stays; a rejected one leaves its position open."""
    ledger, session = opened
    capture(ledger, session.id, 1, one(session, 1, 1.0), author="a")
    capture(ledger, session.id, 1, one(session, 1, 5.0), author="a")
    seen = load_session(ledger, session.id)
    assert seen.attempts[1] == 2
    assert seen.valid[0].capture.channels["accelerometer"][0] == 5.0
    reject(ledger, seen.taken[1], "bumped", author="a")
    seen = load_session(ledger, session.id)
    assert not seen.has(1)
    assert seen.taken[1].rejected == "bumped"


def test_two_browsers_do_not_overwrite_each_other(opened: tuple[Ledger, Session]) -> None:
    """Both believe to take the first attempt."""
    ledger, session = opened
    capture(ledger, session.id, 1, one(session, 1), author="a", attempt=1)
    with pytest.raises(ConflictError, match="somebody else"):
        capture(ledger, session.id, 1, one(session, 1, 9.0), author="b", attempt=1)
    assert load_session(ledger, session.id).valid[0].author == "a"


def test_a_closed_session_takes_nothing_more(opened: tuple[Ledger, Session]) -> None:
    """And is closed only once."""
    ledger, session = opened
    close_session(ledger, session.id, "abandoned", author="a", reason="power cut")
    with pytest.raises(LedgerError, match="closed"):
        capture(ledger, session.id, 1, one(session, 1), author="a")
    with pytest.raises(LedgerError, match="closed already"):
        close_session(ledger, session.id, "finished", author="a")


def test_what_cannot_be_is_refused(opened: tuple[Ledger, Session]) -> None:
    """Positions outside the plan, degrees for radians, unknown tools."""
    ledger, session = opened
    with pytest.raises(InputError, match="allowed 1 to 13"):
        capture(ledger, session.id, 14, one(session, 1), author="a")
    with pytest.raises(InputError, match="allowed -360 to 360 degrees"):
        capture(ledger, session.id, 1, Capture({"gyro": np.ones(3)}, (0.0, 90.0, 0.0)), author="a")
    with pytest.raises(LedgerError, match="not registered"):
        open_session(ledger, "nobody", plans.twelve(), rig="stand 1", author="a")


def test_a_session_calibrates_the_tool(opened: tuple[Ledger, Session]) -> None:
    """Captured readings give the calibration the same readings give directly."""
    ledger, session = opened
    plan = plans.twelve()
    tool, rig = realistic_tool(1), Rig(dip=np.radians(70.0))
    run = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, seed=1)
    for number in range(1, 13):
        channels = {kind: values[number - 1] for kind, values in run.signals.items()}
        capture(ledger, session.id, number, Capture(channels, session.positions[number - 1].dial), author="a")
    readings = bench_readings(load_session(ledger, session.id), dip=np.radians(70.0))
    found = calibrate_joint(readings, rig_sd=np.radians(0.1))
    truth = tool.triads["accelerometer"].tensor[0]
    np.testing.assert_allclose(found.tool.triads["accelerometer"].tensor[0], truth, atol=0.01 * np.abs(truth).max())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"temperature": 1e300}, "allowed -100 to 400 degC"),
        ({"sd": {"accelerometer": np.array([1.0, -1.0, 1.0])}}, "sd of the accelerometer"),
        ({"sd": {"accelerometer": np.ones(2)}}, "2 values, the reading 3"),
        ({"channels": {"accelerometer": np.array([1e308, 0.0, 0.0])}}, "allowed -1e"),
        ({"dial": (0.0, 6.9, 0.0)}, "inclination dial is at 395"),
        ({"count": 0}, "at least 1 sample"),
    ],
)
def test_readings_that_can_never_be_right_are_refused(
    opened: tuple[Ledger, Session], change: dict[str, object], message: str
) -> None:
    """Before they are in the ledger for ever."""
    ledger, session = opened
    with pytest.raises(InputError, match=message):
        capture(ledger, session.id, 1, replace(one(session, 1), **change), author="a")  # type: ignore[arg-type]
    assert not load_session(ledger, session.id).taken

"""A session: captured, resumed, retaken, conflicting, closed; and it calibrates the tool it was taken with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.conventions import USUAL, WAYS, Dials
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.errors import InputError
from inclinometry.findings import Finding
from inclinometry.laboratory import registry
from inclinometry.laboratory.import_file import import_file
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import ConflictError, Ledger, LedgerError
from inclinometry.laboratory.progress import Goal, proposal, session_progress
from inclinometry.laboratory.results import calibration_of, finish_calibration
from inclinometry.laboratory.session import (
    Capture,
    Session,
    bench_readings,
    capture,
    close_session,
    load_session,
    open_session,
    reject,
    setting_of,
)
from inclinometry.laboratory.verification import begin_verification, finish_verification
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
    for nothing in ("", "-", "n/a", "tbd", "..."):
        with refused("input-missing", names=("reason",)):
            reject(ledger, seen.taken[1], nothing, author="a")
        with refused("input-missing", names=("reason",)):
            close_session(ledger, session.id, "abandoned", author="a", reason=nothing)
    reject(ledger, seen.taken[1], "bumped", author="a")
    seen = load_session(ledger, session.id)
    assert not seen.has(1)
    assert seen.taken[1].rejected == "bumped"


def test_two_browsers_do_not_overwrite_each_other(opened: tuple[Ledger, Session]) -> None:
    """Both believe to take the first attempt."""
    ledger, session = opened
    capture(ledger, session.id, 1, one(session, 1), author="a", attempt=1)
    with refused("ledger-conflict", error=ConflictError):
        capture(ledger, session.id, 1, one(session, 1, 9.0), author="b", attempt=1)
    assert load_session(ledger, session.id).valid[0].author == "a"


def test_a_closed_session_takes_nothing_more(opened: tuple[Ledger, Session]) -> None:
    """And is closed only once."""
    ledger, session = opened
    close_session(ledger, session.id, "abandoned", author="a", reason="power cut")
    with refused("session-closed", error=LedgerError):
        capture(ledger, session.id, 1, one(session, 1), author="a")
    with refused("session-closed", error=LedgerError):
        close_session(ledger, session.id, "finished", author="a")


def test_what_cannot_be_is_refused(opened: tuple[Ledger, Session]) -> None:
    """Positions outside the plan, degrees for radians, unknown tools."""
    ledger, session = opened
    with refused("input-value", name="position"):
        capture(ledger, session.id, 14, one(session, 1), author="a")
    with refused("input-value", name="inclination_deg"):
        capture(ledger, session.id, 1, Capture({"gyro": np.ones(3)}, (0.0, 90.0, 0.0)), author="a")
    with refused("session-not-registered", error=LedgerError):
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
    readings = replace(bench_readings(load_session(ledger, session.id)), reference={"dip": np.radians(70.0)})
    found = calibrate_joint(readings, rig_sd=np.radians(0.1))
    truth = tool.triads["accelerometer"].tensor[0]
    np.testing.assert_allclose(found.tool.triads["accelerometer"].tensor[0], truth, atol=0.01 * np.abs(truth).max())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"temperature": 1e300}, "input-value"),
        ({"sd": {"accelerometer": np.array([1.0, -1.0, 1.0])}}, "input-value"),
        ({"sd": {"accelerometer": np.ones(2)}}, "input-shape"),
        ({"channels": {"accelerometer": np.array([1e308, 0.0, 0.0])}}, "input-value"),
        ({"dial": (0.0, 6.9, 0.0)}, "input-value"),
        ({"count": 0}, "input-value"),
    ],
)
def test_readings_that_can_never_be_right_are_refused(
    opened: tuple[Ledger, Session], change: dict[str, object], message: str
) -> None:
    """Before they are in the ledger for ever."""
    ledger, session = opened
    with refused(message):
        capture(ledger, session.id, 1, replace(one(session, 1), **change), author="a")  # type: ignore[arg-type]
    assert not load_session(ledger, session.id).taken


def test_numbers_of_numpy_are_recorded(opened: tuple[Ledger, Session]) -> None:
    """Of whatever type: a mean, a count and a flag as numpy gives them."""
    ledger, session = opened
    numbers = {"count": np.int64(9), "duration": np.float32(0.5), "temperature": np.float64(20.0), "still": np.bool_(1)}
    found = capture(ledger, session.id, 1, replace(one(session, 1), **numbers), author="a").capture
    assert (found.count, found.duration, found.temperature, found.still) == (9, 0.5, 20.0, True)


# Rigs whose dials count otherwise: sessions keep what the dials say, fits take what it means.


ODD = Dials("horizontal", "counterclockwise", "counterclockwise")
TOOL = realistic_tool(7)


def on_stand(bench: SimpleNamespace, dials: Dials, seed: int = 1):
    """The sensors of a tool on a rig that stands where its dials really mean."""
    read = bench.sensors(TOOL, seed)
    return lambda dial: replace(read(setting_of(dials, dial)), dial=dial)


def stated(ledger: Ledger, dials: Dials, sd: float) -> registry.RegisteredRig:
    rig = registry.RegisteredRig("stand 1", (sd, sd, sd), dials=dials)
    registry.put_rig(ledger, rig, author="anna")
    return rig


@pytest.mark.parametrize("dials", WAYS, ids=lambda way: str(way.way))
def test_a_rig_is_recorded_with_its_dials(laboratory: Ledger, bench: SimpleNamespace, dials: Dials) -> None:
    """One that counts as usual is recorded as before."""
    rig = stated(laboratory, dials, bench.sd)
    assert registry.find_rig(laboratory, "stand 1") == rig
    assert ("dials" in laboratory.current("rig")[0].body) == (dials != USUAL)


def test_dials_that_are_none_are_not_recorded(laboratory: Ledger) -> None:
    with refused("input-field", error=InputError, name="rig.dials.azimuth_counts"):
        laboratory.append("rig", {"name": "x"}, {"sd_deg": [1, 1, 1], "dials": {"azimuth_counts": "left"}}, author="a")


@pytest.mark.long
def test_a_session_shows_and_keeps_what_the_dials_say(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The same tool calibrated and verified on a rig of reversed dials, its wrongly stated readings refused before."""
    registry.put_site(laboratory, registry.RegisteredSite("yard", dip=bench.dip), author="a")
    stated(laboratory, ODD, bench.sd)
    plan = plans.orthogonal()
    session = open_session(laboratory, "IN-7", plan, rig="stand 1", author="a", settings={"site": "yard"})
    shown = np.degrees([p.dial for p in session.positions])
    np.testing.assert_allclose(shown[:, 1], 90.0 - np.degrees(plan.inclination), atol=1e-6)
    np.testing.assert_allclose(shown[:, 0], np.degrees(-plan.azimuth) % 360.0, atol=1e-6)
    assert ((shown[:, [0, 2]] >= 0.0) & (shown[:, [0, 2]] < 360.0)).all()
    session = bench.take(laboratory, session, on_stand(bench, ODD))
    kept = laboratory.find("reading", session=session.id)[0].body["dial_deg"]
    np.testing.assert_allclose(kept, shown[0], atol=1e-9)
    readings = bench_readings(session)
    np.testing.assert_allclose(np.mod(readings.inclination, 2 * np.pi), plan.inclination, atol=1e-9)
    record = finish_calibration(laboratory, session.id, author="a")
    found = calibration_of(record)
    assert str(Finding("bench-dials-read", {"way": ODD.way})) in map(str, found.findings), found.findings
    judged = begin_verification(laboratory, record.id, "spread-12", author="a")
    judged = bench.take(laboratory, judged, on_stand(bench, ODD, 2))
    assert finish_verification(laboratory, judged.id, record.id, author="a").body["verdict"] == "agrees"


def test_dials_stated_wrongly_are_put_right_on_the_rig_and_the_readings_stay(
    laboratory: Ledger, bench: SimpleNamespace
) -> None:
    """Refused, put right, calibrated; what the rig is said to be afterwards changes nothing of what is closed."""
    registry.put_site(laboratory, registry.RegisteredSite("yard", dip=bench.dip), author="a")
    dials = Dials(toolface_counts="counterclockwise")
    plan = plans.orthogonal()
    session = open_session(laboratory, "IN-7", plan, rig="stand 1", author="a", settings={"site": "yard"})
    bench.take(laboratory, session, on_stand(bench, dials))
    with refused("bench-dials-otherwise", error=LedgerError) as error:
        finish_calibration(laboratory, session.id, author="a")
    assert str(dials.way) in str(error.value)
    stated(laboratory, dials, bench.sd)
    record = finish_calibration(laboratory, session.id, author="a")
    stated(laboratory, USUAL, bench.sd)
    assert load_session(laboratory, session.id).dials == dials
    # and a verification on the rig as it is said to be now has no verdict
    judged = begin_verification(laboratory, record.id, "spread-12", author="a")
    bench.take(laboratory, judged, on_stand(bench, dials, 2))
    with refused("bench-dials-otherwise"):
        finish_verification(laboratory, judged.id, record.id, author="a")
    assert laboratory.count("verification") == 0
    stated(laboratory, dials, bench.sd)
    assert finish_verification(laboratory, judged.id, record.id, author="a").body["verdict"] == "agrees"


def test_a_proposed_position_is_planned_from_what_the_dials_mean(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The same proposal whichever way the dials count."""
    goal, places = Goal(u_azimuth=np.radians(0.5)), []
    for dials in (USUAL, ODD):
        rig = stated(laboratory, dials, bench.sd)
        session = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="a")
        session = bench.take(laboratory, session, on_stand(bench, dials), range(1, 9))
        place = proposal(session, goal, rig, session_progress(session, goal, rig))
        places.append((place.azimuth, place.inclination, place.toolface))
    # dials are kept to 1e-9 degrees
    np.testing.assert_allclose(places[0], places[1], atol=1e-6)


def test_a_file_holds_what_the_dials_of_its_rig_say(laboratory: Ledger, bench: SimpleNamespace) -> None:
    stated(laboratory, ODD, bench.sd)
    text = "station,azimuth_deg,inclination_deg,toolface_deg,accel_x,accel_y,accel_z\n1,270,60,0,-0.5,0,0.87\n"
    record = import_file(laboratory, text.encode(), "IN-7", "stand 1", author="a")
    session = load_session(laboratory, record.id)
    np.testing.assert_allclose(np.degrees(session.positions[0].dial), [270.0, 60.0, 0.0])
    found = bench_readings(session)
    np.testing.assert_allclose(np.degrees(np.stack(found.dials, axis=1))[0], [-270.0, 30.0, 0.0], atol=1e-9)


def test_a_site_has_a_latitude_where_it_is_known(laboratory: Ledger) -> None:
    """It reaches the readings; a site without one is recorded as before."""
    registry.put_site(laboratory, registry.RegisteredSite("yard", dip=1.0, latitude=-0.5), author="a")
    registry.put_site(laboratory, registry.RegisteredSite("hall", dip=1.0), author="a")
    found = registry.find_site(laboratory, "yard")
    assert found.latitude == pytest.approx(-0.5)
    assert "latitude_deg" not in laboratory.latest("site", name="hall").body
    text = "station,azimuth_deg,inclination_deg,toolface_deg,gyro_x,gyro_y,gyro_z\n1,0,60,0,5,0,9\n"
    record = import_file(laboratory, text.encode(), "IN-7", "stand 1", author="a", site="yard")
    assert bench_readings(load_session(laboratory, record.id)).reference["latitude"] == pytest.approx(-0.5)
    with refused("input-value", name="latitude"):
        registry.put_site(laboratory, registry.RegisteredSite("x", latitude=2.0), author="a")

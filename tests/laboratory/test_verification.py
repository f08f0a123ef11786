"""Verification on the stand: protocols, verdicts, what cannot be judged; and a campaign over temperature."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.decision import Limits
from inclinometry.calibration.plans import Plan
from inclinometry.files.json_codec import findings_in
from inclinometry.files.limits import limit_names, read_limits
from inclinometry.findings import Finding, without_notes
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.registry import RegisteredRig, put_rig
from inclinometry.laboratory.results import calibration_of, finish_calibration
from inclinometry.laboratory.session import (
    Capture,
    capture,
    load_session,
    open_session,
    positions_at_temperatures,
    reject,
)
from inclinometry.laboratory.verification import (
    begin_verification,
    finish_verification,
    foreseen,
    judged,
    limits_content,
    limits_from,
    limits_of,
    protocols,
    reachable,
)
from inclinometry.simulate.tool import realistic_tool

# six standard deviations of the stand, which errs by 0.1 degrees
LIMITS = Limits("wide", "this test", np.radians(0.6), np.radians(2.0), np.radians(0.6), np.radians(5.0))


def test_a_good_tool_passes_and_the_verdict_is_recorded(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The protocol's positions, errors with their uncertainty, the session closed."""
    calibration = bench.finished(laboratory).id
    session = bench.calibrated(laboratory, protocols()["roll-8"], 9, purpose="verify")
    record = finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    assert record.body["verdict"] == "pass", record.body["report"]["findings"]
    row = record.body["report"]["positions"][3]
    assert row["azimuth"]["decision"] == "pass"
    assert abs(row["azimuth"]["error_deg"]) < row["azimuth"]["U_deg"] < row["azimuth"]["limit_deg"]
    with refused("session-closed", error=LedgerError):
        finish_verification(laboratory, session.id, calibration, author="anna")


@pytest.mark.long
def test_no_verdict_on_a_part_of_the_protocol(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """One of 72 positions, or a reading left out: neither pass nor fail, and the session stays open."""
    calibration = bench.finished(laboratory).id
    session = open_session(laboratory, "IN-7", protocols()["roll-4"], rig="stand 1", author="a", purpose="verify")
    seen = bench.take(laboratory, session, bench.sensors(realistic_tool(7), 9), [1, 2, 4])
    with refused("session-positions-open", error=LedgerError):
        finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    seen = bench.take(laboratory, session, bench.sensors(realistic_tool(7), 10), [3])
    reject(laboratory, seen.taken[2], "shaken", author="a")
    with refused("session-positions-open", error=LedgerError):
        finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    assert laboratory.count("verification") == 0
    bench.take(laboratory, session, bench.sensors(realistic_tool(7), 11), [2])
    record = finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    assert record.body["report"]["protocol"] == {"name": "roll-4", "positions_captured": 4, "positions": 4}


@pytest.mark.long
def test_a_limit_that_no_position_judges_gives_no_verdict(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Azimuth at the vertical; without that limit the tool passes."""
    calibration = bench.finished(laboratory).id
    upright = Plan("upright", *np.radians([[0.0, 90.0], [0.0, 0.0], [0.0, 90.0]]))
    session = bench.calibrated(laboratory, upright, 9, purpose="verify")
    with refused("session-not-inclined", error=LedgerError):
        finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    only = Limits("wide", "this test", LIMITS.inclination, None, None)
    record = finish_verification(laboratory, session.id, calibration, author="anna", limits=only)
    assert record.body["verdict"] == "pass"
    about = {"names": ("azimuth", "toolface"), "why": "at no position"}
    assert Finding("verify-not-judged", about, severity="note") in findings_in(record.body["report"])


@pytest.mark.long
def test_two_who_finish_at_once_record_one_result(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """A verdict and a calibration each; whoever comes second is told."""

    first = bench.calibrated(laboratory, plans.orthogonal())
    found = bench.at_once(*2 * [lambda: finish_calibration(laboratory, first.id, author="anna")])
    assert [one.finding.code for one in found if isinstance(one, LedgerError)] == ["session-closed"]
    assert laboratory.count("calibration") == 1
    calibration = laboratory.find("calibration")[0].id
    session = bench.calibrated(laboratory, protocols()["roll-4"], 9, purpose="verify")
    found = bench.at_once(*2 * [lambda: finish_verification(laboratory, session.id, calibration, author="anna")])
    assert [one.finding.code for one in found if isinstance(one, LedgerError)] == ["session-closed"]
    assert laboratory.count("verification") == 1


@pytest.mark.long
def test_another_tool_fails(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The calibration of one tool with the readings of another."""
    calibration = bench.finished(laboratory).id
    session = open_session(laboratory, "IN-7", protocols()["roll-4"], rig="stand 1", author="a", purpose="verify")
    bench.take(laboratory, session, bench.sensors(realistic_tool(8), 9))
    assert judged(laboratory, session.id, calibration, LIMITS).verdict == "fail"


def test_the_readings_of_the_calibration_do_not_verify_it(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Neither its own session nor another tool's calibration."""
    calibration = bench.finished(laboratory).id
    own = laboratory.get("calibration", calibration).keys["session"]
    with refused("session-closed", error=LedgerError):
        finish_verification(laboratory, own, calibration, author="anna")


@pytest.mark.long
def test_a_campaign_over_temperature_finds_the_coefficients(laboratory: Ledger) -> None:
    """Offsets that grow with temperature: a degree is chosen, the range stated."""
    tool = realistic_tool(7)
    plan, targets = positions_at_temperatures(plans.twelve(), [20.0, 60.0, 100.0])
    session = open_session(laboratory, "IN-7", plan, rig="stand 1", author="a", purpose="temperature")
    generator = np.random.default_rng(1)
    from inclinometry.rotations import dcm

    for position, heat in zip(session.positions, targets, strict=True):
        matrix = dcm(*position.dial)
        channels = {}
        for kind, direction in (("accelerometer", [0.0, 0.0, 1.0]), ("magnetometer", [0.34, 0.0, 0.94])):
            clean = tool.triads[kind].signals(matrix @ direction)
            scale = np.abs(tool.triads[kind].tensor[0]).max()
            channels[kind] = clean + scale * (1e-4 * (heat - 20.0) + 1e-4 * generator.normal(size=clean.shape))
        reading = Capture(channels, position.dial, 20, temperature=heat + float(generator.normal()))
        capture(laboratory, session.id, position.number, reading, author="a")
    found = calibration_of(finish_calibration(laboratory, session.id, author="a"))
    triad = found.tool.triads["accelerometer"]
    assert triad.degree >= 1
    scale = np.abs(tool.triads["accelerometer"].tensor[0]).max()
    np.testing.assert_allclose(triad.offset[1] / scale, 1e-4, rtol=0.1)  # noise of 1e-4 over a span of 80 degrees
    assert found.tool.temperature_range[1] > 95.0


def test_a_campaign_needs_temperatures_that_differ() -> None:
    """One, two alike, one in units of kelvin."""
    plan: Plan = plans.twelve()
    for wrong in ([20.0], [20.0, 22.0], [293.0, 400.0]):
        with refused("session-temperatures", "input-value"):
            positions_at_temperatures(plan, wrong)


# A verification opened with its limits, on the rig of the calibration.


VERIFIABLE = Limits("agreed", "contract 7", *np.radians([0.5, 1.2, 0.6]), np.radians(10.0))


@pytest.fixture
def calibration(laboratory: Ledger, bench: SimpleNamespace) -> str:
    """Id of a recorded calibration."""
    return bench.finished(laboratory).id


def test_the_session_keeps_calibration_and_limits(laboratory: Ledger, calibration: str) -> None:
    """What it will be judged by is agreed before the first reading."""
    limits = replace(VERIFIABLE, guard="expanded-uncertainty")
    made = begin_verification(laboratory, calibration, "roll-4", author="anna", limits=limits)
    seen = load_session(laboratory, made.id)
    assert (seen.purpose, seen.rig, len(seen.positions)) == ("verify", "stand 1", 4)
    assert seen.settings["calibration"] == calibration
    kept = limits_of(seen)
    assert limits_content(kept) == limits_content(limits)
    bare = begin_verification(laboratory, calibration, "roll-4", author="anna")
    assert limits_of(load_session(laboratory, bare.id)) is None


def test_what_was_foreseen_stands_on_the_protocol(laboratory: Ledger, bench: SimpleNamespace, calibration: str) -> None:
    """What the positions will find, and both risks, are kept before the first reading."""
    worth = foreseen(laboratory, calibration, "spread-12").power
    made = begin_verification(laboratory, calibration, "spread-12", author="anna")
    kept = load_session(laboratory, made.id)
    assert kept.settings["settings"]["foreseen"] == [one.stored() for one in worth.findings]
    bench.take(laboratory, made, bench.sensors(realistic_tool(7), 5))
    said = findings_in(finish_verification(laboratory, made.id, calibration, author="anna").body["report"])
    assert [one.values["finding"] for one in said if one.code == "verify-planned"] == list(worth.findings)


@pytest.mark.long
def test_what_was_agreed_is_held_to(laboratory: Ledger, bench: SimpleNamespace, calibration: str) -> None:
    """Neither no limits, nor others, nor another calibration, once there are results."""
    tight = replace(VERIFIABLE, name="contract", guard="expanded-uncertainty")
    wide = Limits("wide", "this test", 0.1, None, None)
    made = begin_verification(laboratory, calibration, "roll-4", author="anna", limits=tight)
    bare = begin_verification(laboratory, calibration, "roll-4", author="anna")
    for session in (made, bare):
        bench.take(laboratory, session, bench.sensors(realistic_tool(7), 9))
        with refused("session-agreed", error=LedgerError):
            finish_verification(laboratory, session.id, calibration, author="anna", limits=wide)
    other = bench.finished(laboratory, 2).id
    with refused("session-agreed", error=LedgerError):
        finish_verification(laboratory, made.id, other, author="anna")
    record = finish_verification(laboratory, made.id, calibration, author="anna")
    assert (record.body["verdict"], record.body["limits"]["name"]) == ("pass", "contract")


@pytest.mark.parametrize("name", limit_names())
def test_limits_survive_being_stated(name: str) -> None:
    """Degrees and back."""
    limits = read_limits(name)
    again = limits_from(limits_content(limits))
    assert limits_content(again) == limits_content(limits)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({"azimuth_deg": 1.0}, "input-empty"),
        ({"source": " ", "azimuth_deg": 1.0}, "input-empty"),
        ({"source": "contract"}, "file-limits"),
        ({"source": "contract", "azimuth_deg": -1.0}, "input-value"),
        ({"source": "contract", "azimuth_deg": 1.0, "guard": "half"}, "input-choice"),
        ({"source": "contract", "azimuth_deg": 1.0, "min_inclination_deg_for_azimuth": 91.0}, "input-value"),
    ],
)
def test_limits_that_are_none_are_refused(content: dict[str, object], problem: str) -> None:
    """Never a limit without a source."""
    with refused(problem):
        limits_from(content)


def test_positions_beyond_the_rig_are_left_out_and_the_plan_says_so(laboratory: Ledger, calibration: str) -> None:
    """A rig that stops at 95 degrees; one that reaches nothing."""
    low = RegisteredRig("stand 1", (0.001, 0.001, 0.001), inclination=(0.0, float(np.radians(95.0))))
    put_rig(laboratory, low, author="anna")
    made = begin_verification(laboratory, calibration, "azimuth", author="anna")
    assert len(made.positions) == 60
    assert "60 of 72" in made.plan
    turned = RegisteredRig("x", (0.001, 0.001, 0.001), azimuth=(float(-np.pi), float(np.pi)))
    assert len(reachable(protocols()["azimuth"], turned)) == 72
    flat = replace(low, inclination=(0.0, 0.1))
    with refused("session-unreachable"):
        reachable(protocols()["roll-4"], flat)


def test_what_is_unknown_is_refused(laboratory: Ledger, calibration: str) -> None:
    """No such calibration, no such protocol."""
    with refused("ledger-not-there", error=LedgerError):
        begin_verification(laboratory, "0" * 32, "roll-4", author="anna")
    with refused("input-choice", name="protocol"):
        begin_verification(laboratory, calibration, "half", author="anna")


def test_what_a_protocol_will_find_is_known_before_it_is_opened(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The protocol that the page offers first is not called too little, before and after; nothing is recorded."""
    record = finish_calibration(laboratory, bench.calibrated(laboratory, plans.twelve()).id, author="anna")
    head = laboratory.head()
    first = next(iter(protocols()))
    told = foreseen(laboratory, record.id, first)
    assert laboratory.head() == head
    assert without_notes(told.findings) == ()
    assert 1.0 < told.power.factor < 4.0
    many = foreseen(laboratory, record.id, "long").power
    assert many.factor < 0.9 * told.power.factor
    session = begin_verification(laboratory, record.id, first, author="anna")
    bench.take(laboratory, session, bench.sensors(realistic_tool(7), 5))
    found = judged(laboratory, session.id, record.id)
    assert without_notes(found.findings) == ()
    # the same stand, the same positions, as many samples: the readings change the draws' last digits
    assert found.power.factor == pytest.approx(told.power.factor, rel=0.02)


def test_what_came_out_as_foreseen_is_said_once(laboratory: Ledger, bench: SimpleNamespace, calibration: str) -> None:
    kept = begin_verification(laboratory, calibration, "spread-12", author="anna")
    bench.take(laboratory, kept, bench.sensors(realistic_tool(7), 9))
    record = finish_verification(laboratory, kept.id, calibration, author="anna")
    found = findings_in(record.body["report"])
    plain = [one.values["finding"] if one.code == "verify-planned" else one for one in found]
    assert len(set(map(str, plain))) == len(plain)
    assert [one.values.get("angle") for one in plain if one.code == "verify-power"].count("all angles") == 1

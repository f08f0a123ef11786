"""Verification on the stand: protocols, verdicts, what cannot be judged; and a campaign over temperature."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.acceptance import Limits
from inclinometry.calibration.plans import Plan
from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.results import calibration_of, finish_calibration
from inclinometry.laboratory.session import Capture, campaign, capture, open_session, reject
from inclinometry.laboratory.verification import finish_verification, judged, protocol
from inclinometry.simulate.tool import realistic_tool

# six standard deviations of the stand, which errs by 0.1 degrees
LIMITS = Limits("wide", "this test", np.radians(0.6), np.radians(2.0), np.radians(0.6), np.radians(5.0))


def calibrated(ledger: Ledger, bench: SimpleNamespace) -> str:
    """Id of a recorded calibration."""
    session = bench.calibrated(ledger, plans.orthogonal())
    return finish_calibration(ledger, session.id, author="anna").id


def test_a_good_tool_passes_and_the_verdict_is_recorded(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The protocol's positions, errors with their uncertainty, the session closed."""
    calibration = calibrated(laboratory, bench)
    session = open_session(laboratory, "IN-7", protocol("roll-8").plan, rig="stand 1", author="a", purpose="verify")
    bench.take(laboratory, session, bench.sensors(realistic_tool(7), 9))
    record = finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    assert record.body["verdict"] == "pass", record.body["report"]["reasons"]
    row = record.body["report"]["positions"][3]
    assert row["azimuth"]["decision"] == "pass"
    assert abs(row["azimuth"]["error_deg"]) < row["azimuth"]["U_deg"] < row["azimuth"]["limit_deg"]
    with pytest.raises(LedgerError, match="closed already"):
        finish_verification(laboratory, session.id, calibration, author="anna")


@pytest.mark.long
def test_no_verdict_on_a_part_of_the_protocol(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """One of 72 positions, or a reading left out: neither pass nor fail, and the session stays open."""
    calibration = calibrated(laboratory, bench)
    session = open_session(laboratory, "IN-7", protocol("roll-4").plan, rig="stand 1", author="a", purpose="verify")
    seen = bench.take(laboratory, session, bench.sensors(realistic_tool(7), 9), [1, 2, 4])
    with pytest.raises(LedgerError, match=r"1 of the 4 positions of 'roll-4' have no valid reading \(3\)"):
        finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    seen = bench.take(laboratory, session, bench.sensors(realistic_tool(7), 10), [3])
    reject(laboratory, seen.taken[2], "shaken", author="a")
    with pytest.raises(LedgerError, match=r"\(2\): there is no verdict yet"):
        finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    assert laboratory.count("verification") == 0
    bench.take(laboratory, session, bench.sensors(realistic_tool(7), 11), [2])
    record = finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    assert record.body["report"]["protocol"] == {"name": "roll-4", "taken": 4, "positions": 4}


@pytest.mark.long
def test_a_limit_that_no_position_judges_gives_no_verdict(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Azimuth at the vertical; without that limit the tool passes."""
    calibration = calibrated(laboratory, bench)
    upright = Plan("upright", *np.radians([[0.0, 90.0], [0.0, 0.0], [0.0, 90.0]]))
    session = open_session(laboratory, "IN-7", upright, rig="stand 1", author="a", purpose="verify")
    bench.take(laboratory, session, bench.sensors(realistic_tool(7), 9))
    with pytest.raises(LedgerError, match="limit of azimuth, and none of these positions"):
        finish_verification(laboratory, session.id, calibration, author="anna", limits=LIMITS)
    only = Limits("wide", "this test", LIMITS.inclination, None, None)
    record = finish_verification(laboratory, session.id, calibration, author="anna", limits=only)
    assert record.body["verdict"] == "pass"
    assert any("does not cover: azimuth, toolface" in reason for reason in record.body["report"]["reasons"])


@pytest.mark.long
def test_two_who_finish_at_once_record_one_result(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """A verdict and a calibration each; whoever comes second is told."""

    def both(finish: Callable[[], object]) -> list[str]:
        refused: list[str] = []
        start = threading.Barrier(2)

        def work() -> None:
            start.wait()
            try:
                finish()
            except LedgerError as error:
                refused.append(str(error))

        threads = [threading.Thread(target=work) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return refused

    first = bench.calibrated(laboratory, plans.orthogonal())
    said = both(lambda: finish_calibration(laboratory, first.id, author="anna"))
    assert said == ["this session is closed already"]
    assert laboratory.count("calibration") == 1
    calibration = laboratory.find("calibration")[0].id
    session = open_session(laboratory, "IN-7", protocol("roll-4").plan, rig="stand 1", author="a", purpose="verify")
    bench.take(laboratory, session, bench.sensors(realistic_tool(7), 9))
    said = both(lambda: finish_verification(laboratory, session.id, calibration, author="anna"))
    assert said == ["this session is closed already"]
    assert laboratory.count("verification") == 1


@pytest.mark.long
def test_another_tool_fails(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The calibration of one tool with the readings of another."""
    calibration = calibrated(laboratory, bench)
    session = open_session(laboratory, "IN-7", protocol("roll-4").plan, rig="stand 1", author="a", purpose="verify")
    bench.take(laboratory, session, bench.sensors(realistic_tool(8), 9))
    assert judged(laboratory, session.id, calibration, LIMITS).verdict == "fail"


def test_the_readings_of_the_calibration_do_not_verify_it(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Neither its own session nor another tool's calibration."""
    calibration = calibrated(laboratory, bench)
    own = laboratory.get("calibration", calibration).keys["session"]
    with pytest.raises(LedgerError, match=r"closed|calibrated with"):
        finish_verification(laboratory, own, calibration, author="anna")
    with pytest.raises(InputError, match="roll-8"):
        protocol("roll-9")


@pytest.mark.long
def test_a_campaign_over_temperature_finds_the_coefficients(laboratory: Ledger) -> None:
    """Offsets that grow with temperature: a degree is chosen, the range stated."""
    tool = realistic_tool(7)
    plan, targets = campaign(plans.twelve(), [20.0, 60.0, 100.0])
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
    assert found.tool.temperature_range is not None
    assert found.tool.temperature_range[1] > 95.0


def test_a_campaign_needs_temperatures_that_differ() -> None:
    """One, two alike, one in units of kelvin."""
    plan: Plan = plans.twelve()
    for wrong in ([20.0], [20.0, 22.0], [293.0, 400.0]):
        with pytest.raises(InputError, match=r"apart|allowed"):
            campaign(plan, wrong)

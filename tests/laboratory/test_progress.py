"""The running fit: what it certifies is what the tool then shows; outliers are named; the proposal helps."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.progress import Goal, proposal, session_progress
from inclinometry.laboratory.registry import find_rig
from inclinometry.laboratory.session import capture, load_session, open_session
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.tool import realistic_tool
from inclinometry.workflow.calibrate import true_errors

LOW = Goal(u_azimuth=float(np.radians(0.6)), inclination_range=(float(np.radians(5.0)), float(np.radians(15.0))))


def test_before_enough_positions_it_says_what_it_waits_for(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """No fit, no uncertainty, not reached."""
    session = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="a")
    seen = session_progress(session, LOW, find_rig(laboratory, "stand 1"))
    assert seen.calibration is None
    assert seen.waiting.code == "session-positions-open"
    session = bench.take(laboratory, session, bench.sensors(realistic_tool(7), 1), [1, 2, 3])
    seen = session_progress(session, LOW, find_rig(laboratory, "stand 1"))
    assert (seen.captured, seen.calibration, seen.reached) == (3, None, False)
    assert seen.waiting


def test_the_uncertainty_certified_covers_the_true_error(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The worst rms error over the range is within the worst expanded uncertainty of a complete run."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    seen = session_progress(session, LOW, find_rig(laboratory, "stand 1"))
    errors = true_errors(seen.calibration.tool, realistic_tool(7), bench.dip, np.radians([5.0, 10.0, 15.0]))
    assert errors[:, 1].max() < seen.u_azimuth
    assert errors[:, 0].max() < seen.u_inclination
    assert seen.outliers == {}


def test_a_misread_dial_is_named_by_its_position(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The toolface of position 17 was off by 2 degrees."""
    session = open_session(laboratory, "IN-7", plans.orthogonal(), rig="stand 1", author="a")
    session = bench.take(laboratory, session, bench.sensors(realistic_tool(7), 1, {17: np.radians(2.0)}))
    seen = session_progress(session, LOW, find_rig(laboratory, "stand 1"))
    assert list(seen.outliers) == [17]
    assert seen.calibration.outliers["17"].values["dial"] == ("toolface",)
    assert not seen.reached


@pytest.mark.long
def test_an_adaptive_run_reaches_what_24_positions_give_with_16(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Wells up to 15 degrees: the position proposed each time, until the uncertainty of the cube is certified."""
    rig = find_rig(laboratory, "stand 1")
    target = session_progress(bench.calibrated(laboratory, plans.orthogonal()), LOW, rig).u_azimuth
    goal = Goal(u_azimuth=target, inclination_range=LOW.inclination_range)
    first = plans.Plan("adaptive", [0.0], [0.0], [0.0])
    session = open_session(laboratory, "IN-7", first, rig="stand 1", author="a")
    read = bench.sensors(realistic_tool(7), 2)
    for number in range(1, 25):
        now = session_progress(session, goal, rig)
        if now.reached:
            break
        place = proposal(session, goal, rig, now)
        dial = (place.azimuth, place.inclination, place.toolface)
        capture(laboratory, session.id, number, read(dial), author="a")
        session = load_session(laboratory, session.id)
    assert now.reached
    assert now.captured <= 16


def test_the_proposal_is_on_the_stand_and_not_taken_twice(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """After the twelve positions."""
    session = bench.calibrated(laboratory, plans.twelve())
    here = find_rig(laboratory, "stand 1")
    place = proposal(session, LOW, here, session_progress(session, LOW, here))
    dials = np.array([row.capture.dial for row in session.valid])
    apart = np.abs(wrap_signed(dials - [place.azimuth, place.inclination, place.toolface])).max(axis=1)
    assert apart.min() > bench.sd
    assert place.value < place.before

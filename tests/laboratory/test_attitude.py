"""Angles of the tool as it stands in the rig: what the dials were set to, wherever they count from."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.laboratory.attitude import earlier_calibration, seen_from_stand, stand_angles
from inclinometry.laboratory.registry import RegisteredRig, put_rig
from inclinometry.laboratory.results import calibration_of, finish_calibration
from inclinometry.laboratory.session import open_session
from inclinometry.rotations import wrap_signed
from inclinometry.sensors import Tool
from inclinometry.simulate.tool import realistic_tool


@pytest.fixture(scope="module")
def made(bench: SimpleNamespace, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """The tool of the stand, calibrated on it."""
    with bench.founded(tmp_path_factory.mktemp("made")) as ledger:
        session = bench.calibrated(ledger, plans.orthogonal())
        record = finish_calibration(ledger, session.id, author="anna")
        yield SimpleNamespace(record=record, session=session, calibration=calibration_of(record), ledger=ledger)


@pytest.mark.parametrize("dial_deg", [(120.0, 90.0, 240.0), (300.0, 35.0, 10.0), (45.0, 120.0, 100.0)])
def test_the_angles_are_those_the_stand_was_set_to(made, bench, dial_deg):
    """To three standard deviations of the settings, 0.1 deg, with the azimuth's 1 / sin I and what the fit leaves."""
    dial = tuple(np.radians(dial_deg))
    seen = bench.sensors(realistic_tool(7), seed=5)(dial)
    found = stand_angles(seen_from_stand(made.calibration, seen.channels), dial)
    apart = np.degrees(wrap_signed(np.subtract(found, dial)))
    assert np.abs(apart * [np.sin(dial[1]), 1.0, np.sin(dial[1])]).max() < 0.6


@pytest.mark.parametrize("inclination_deg", [0.0, 180.0])
def test_at_the_vertical_azimuth_and_toolface_are_shared_out_as_in_the_target(made, bench, inclination_deg):
    dial = tuple(np.radians([70.0, inclination_deg, 200.0]))
    seen = bench.sensors(realistic_tool(7), seed=6)(dial)
    azimuth, inclination, toolface = stand_angles(seen_from_stand(made.calibration, seen.channels), dial)
    assert azimuth == dial[0]
    assert np.degrees(abs(inclination - dial[1])) < 0.6
    assert np.degrees(abs(wrap_signed(toolface - dial[2]))) < 1.0


def test_nothing_is_said_where_nothing_is_known(made, bench):
    """Other channels, one field only."""
    seen = bench.sensors(realistic_tool(7), seed=5)((0.0, 1.0, 0.0)).channels
    assert seen_from_stand(made.calibration, {"accelerometer": seen["accelerometer"]}) is None
    assert seen_from_stand(made.calibration, {kind: x[:2] for kind, x in seen.items()}) is None
    alone = Tool("x", {"accelerometer": made.calibration.tool.triads["accelerometer"]})
    assert seen_from_stand(SimpleNamespace(tool=alone, field_directions={}), seen) is None


def test_only_an_earlier_calibration_on_the_same_rig_counts(made, bench):
    """Its fields are in the axes of that rig."""
    ledger = made.ledger
    again = open_session(ledger, "IN-7", plans.twelve(), rig="stand 1", author="anna")
    assert earlier_calibration(ledger, again).id == made.record.id
    assert earlier_calibration(ledger, made.session) is None
    put_rig(ledger, RegisteredRig("stand 2", (bench.sd,) * 3), author="anna")
    other = open_session(ledger, "IN-7", plans.twelve(), rig="stand 2", author="anna")
    assert earlier_calibration(ledger, other) is None

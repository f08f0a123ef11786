"""A finished session: the calibration recorded, read back to the bit, followed over the years."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.errors import InputError
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredSite,
    put_rig,
    put_site,
)
from inclinometry.laboratory.results import calibration_of, finish_calibration, history, parameters
from inclinometry.laboratory.session import load_session, open_session
from inclinometry.simulate.tool import realistic_tool


def test_a_recorded_calibration_is_read_back(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Its parameters, covariance and table; the session is closed with it."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    record = finish_calibration(laboratory, session.id, author="anna")
    found = calibration_of(record)
    again = calibration_of(laboratory.get("calibration", record.id))
    np.testing.assert_array_equal(found.covariance, again.covariance)
    assert load_session(laboratory, session.id).closed == "finished"
    assert record.body["readings"] == [row.record for row in session.valid]
    table = record.body["capability_deg"]
    assert table["U_azimuth_deg"][0] > table["U_azimuth_deg"][5] > 0.0
    with pytest.raises(LedgerError, match="closed already"):
        finish_calibration(laboratory, session.id, author="anna")
    assert verify(laboratory).ok


def test_the_rig_of_the_opening_is_taken(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Its uncertainty, stated anew when the readings are there, does not change what they certify."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    put_rig(laboratory, RegisteredRig("stand 1", (bench.sd / 10.0,) * 3), author="a")
    found = calibration_of(finish_calibration(laboratory, session.id, author="anna"))
    np.testing.assert_allclose(found.rig.sd, bench.sd, rtol=1e-9)


def test_the_same_reading_at_every_position_is_no_calibration(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The tool was never turned: nothing is recorded that could not be read again."""
    session = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="a")
    same = bench.sensors(realistic_tool(7), 1)((0.3, 1.0, 0.7))
    bench.take(laboratory, session, lambda dial: replace(same, dial=dial))
    with pytest.raises(LedgerError, match="was it turned to each position"):
        finish_calibration(laboratory, session.id, author="anna")
    assert laboratory.count("calibration") == 0


@pytest.mark.parametrize(
    ("turned", "said"),
    [
        ((1.0, 1.0, -1.0), "--toolface-counts counterclockwise"),
        ((-1.0, 1.0, 1.0), "--azimuth-counts counterclockwise"),
        ((-1.0, 1.0, -1.0), "left-handed: the channels of the accelerometer and the magnetometer"),
    ],
)
def test_a_dial_that_counts_the_other_way_is_no_calibration(
    laboratory: Ledger, bench: SimpleNamespace, turned: tuple[float, float, float], said: str
) -> None:
    """As with a file: refused, the option that fits named, and the session stays open."""
    put_site(laboratory, RegisteredSite("yard", dip=bench.dip), author="a")
    session = open_session(laboratory, "IN-7", plans.orthogonal(), rig="stand 1", author="a", settings={"site": "yard"})
    read = bench.sensors(realistic_tool(7), 1)
    dialled = {p.dial: (p.dial[0] * turned[0], p.dial[1], p.dial[2] * turned[2]) for p in session.positions}
    bench.take(laboratory, session, lambda dial: replace(read(dialled[dial]), dial=dial))
    with pytest.raises(LedgerError, match=said):
        finish_calibration(laboratory, session.id, author="anna")
    assert laboratory.count("calibration") == 0
    assert load_session(laboratory, session.id).closed == ""


def test_readings_that_make_no_calibration_leave_the_session_open(laboratory: Ledger) -> None:
    """The reason is said."""
    session = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="a")
    with pytest.raises(LedgerError, match="do not make a calibration"):
        finish_calibration(laboratory, session.id, author="anna")
    assert load_session(laboratory, session.id).closed == ""


@pytest.mark.long
def test_the_history_of_a_steady_tool_stays_within_its_uncertainty(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Two runs of one tool: changes over their uncertainty have a mean square of one; 24 values scatter by 0.3."""
    for seed in (1, 2):
        session = bench.calibrated(laboratory, plans.orthogonal(), seed)
        finish_calibration(laboratory, session.id, author="anna")
    seen = history(laboratory, "IN-7")
    assert len(seen) == 2
    ratio = [seen.change(name)[0][1] / seen.change(name)[1][1] for name in seen.values]
    assert 0.2 < np.mean(np.square(ratio)) < 2.5
    assert list(seen.values) == list(parameters(calibration_of(laboratory.get("calibration", seen.records[0]))))
    with pytest.raises(InputError, match="no calibration"):
        history(laboratory, "another")

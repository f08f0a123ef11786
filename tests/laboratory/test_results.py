"""A finished session: the calibration recorded, read back to the bit, followed over the years."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import date
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.cli import main
from inclinometry.findings import Finding
from inclinometry.laboratory import registry
from inclinometry.laboratory.import_file import import_file
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.results import calibration_of, comparable, finish_calibration, history, parameters
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
    with refused("session-closed", error=LedgerError):
        finish_calibration(laboratory, session.id, author="anna")
    assert verify(laboratory).ok


def test_the_rig_of_the_opening_is_taken(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Its uncertainty, stated anew when the readings are there, does not change what they certify."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    registry.put_rig(laboratory, registry.RegisteredRig("stand 1", (bench.sd / 10.0,) * 3), author="a")
    found = calibration_of(finish_calibration(laboratory, session.id, author="anna"))
    np.testing.assert_allclose(found.rig.sd, bench.sd, rtol=1e-9)


def test_the_same_reading_at_every_position_is_no_calibration(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The tool was never turned: nothing is recorded that could not be read again."""
    session = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="a")
    same = bench.sensors(realistic_tool(7), 1)((0.3, 1.0, 0.7))
    bench.take(laboratory, session, lambda dial: replace(same, dial=dial))
    with pytest.raises(LedgerError) as told:
        finish_calibration(laboratory, session.id, author="anna")
    assert told.value.finding == Finding("ledger-not-turned", severity="refused")
    assert laboratory.count("calibration") == 0


@pytest.mark.parametrize(
    ("turned", "said"),
    [
        ((1.0, 1.0, -1.0), "bench-dials-otherwise"),
        ((-1.0, 1.0, 1.0), "bench-dials-otherwise"),
        ((-1.0, 1.0, -1.0), "bench-left-handed"),
    ],
)
def test_a_dial_that_counts_the_other_way_is_no_calibration(
    laboratory: Ledger, bench: SimpleNamespace, turned: tuple[float, float, float], said: str
) -> None:
    """As with a file: refused, the option that fits named, and the session stays open."""
    registry.put_site(laboratory, registry.RegisteredSite("yard", dip=bench.dip), author="a")
    session = open_session(laboratory, "IN-7", plans.orthogonal(), rig="stand 1", author="a", settings={"site": "yard"})
    read = bench.sensors(realistic_tool(7), 1)
    dialled = {p.dial: (p.dial[0] * turned[0], p.dial[1], p.dial[2] * turned[2]) for p in session.positions}
    bench.take(laboratory, session, lambda dial: replace(read(dialled[dial]), dial=dial))
    with refused(said, error=LedgerError):
        finish_calibration(laboratory, session.id, author="anna")
    assert laboratory.count("calibration") == 0
    assert load_session(laboratory, session.id).closed == ""


def test_readings_that_make_no_calibration_leave_the_session_open(laboratory: Ledger) -> None:
    """The reason is said."""
    session = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="a")
    with refused("session-positions-open", error=LedgerError):
        finish_calibration(laboratory, session.id, author="anna")
    assert load_session(laboratory, session.id).closed == ""


def test_a_tool_is_compared_for_one_field() -> None:
    """At a stand with a stronger field, stated or not, the same sensors have changed in nothing."""
    tool = realistic_tool(7)
    triad = tool.triads["magnetometer"]
    for strength in (1.02 * float(triad.field_strength or 0.0), None):
        there = replace(triad, tensor=1.02 * triad.tensor, field_strength=strength)
        found, unknown = comparable(replace(tool, triads={**tool.triads, "magnetometer": there}), tool)
        assert unknown == (() if strength else ("magnetometer",))
        for name, (value, _) in parameters(tool).items():
            assert found[name][0] == pytest.approx(value, rel=1e-9)
    volts = replace(triad, unit="V")
    found, unknown = comparable(replace(tool, triads={**tool.triads, "magnetometer": volts}), tool)
    assert {name for name, (value, _) in found.items() if np.isnan(value)} == {n for n in found if "magneto" in n}
    assert unknown == ()


@pytest.mark.long
def test_the_history_of_a_steady_tool_stays_within_its_uncertainty(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Two runs of one tool: changes over their uncertainty have a mean square of one; 24 values scatter by 0.3."""
    for seed in (1, 2):
        bench.finished(laboratory, seed)
    seen = history(laboratory, "IN-7")
    assert len(seen) == 2
    ratio = [seen.change(name)[0][1] / seen.change(name)[1][1] for name in seen.values]
    assert 0.2 < np.mean(np.square(ratio)) < 2.5
    assert list(seen.values) == list(parameters(calibration_of(laboratory.get("calibration", seen.records[0])).tool))
    with refused("session-no-calibration"):
        history(laboratory, "another")


def test_the_common_scale_is_left_out_only_where_a_strength_is_not_stated(
    laboratory: Ledger, bench: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """First and last say it, the one between does not: the last change has the common scale, and no note denies it."""
    made = bench.finished(laboratory)
    for month, strength in enumerate((9.832, None, 9.80665), 1):
        content = json.loads(json.dumps(made.body["tool_json"]))
        content["triads"]["accelerometer"]["field_strength"] = strength
        registry.put_tool(laboratory, registry.RegisteredTool("IN-8", "tool"), author="anna")
        day = date(2020, month, 1)
        import_file(laboratory, json.dumps(content).encode(), "IN-8", "stand 1", author="anna", performed=day)
    found = history(laboratory, "IN-8")
    assert ["accelerometer" in kinds for kinds in found.scale_unknown] == [False, True, False]
    change = found.change("accelerometer.tensor[0,0]")[0] / found.values["accelerometer.tensor[0,0]"][0]
    np.testing.assert_allclose(change, [0.0, 0.0, 9.832 / 9.80665 - 1.0], atol=1e-9)
    with pytest.raises(SystemExit):
        main(["ledger", "history", "IN-8", "--ledger", str(tmp_path / "ledger.sqlite")])
    printed = capsys.readouterr()
    assert "IN-8: 3 calibrations" in printed.out
    assert "[session-scale-unknown]" in printed.err
    assert "accelerometer" not in printed.err

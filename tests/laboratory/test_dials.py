"""Rigs whose dials count otherwise: sessions keep what the dials say, fits take what it means."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.conventions import USUAL, WAYS, Dials
from inclinometry.errors import InputError
from inclinometry.laboratory.import_file import import_file
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.progress import Goal, proposal, session_progress
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredSite,
    find_rig,
    find_site,
    put_rig,
    put_site,
)
from inclinometry.laboratory.results import at_the_bench, calibration_of, finish_calibration
from inclinometry.laboratory.session import bench_readings, load_session, open_session, setting_of
from inclinometry.laboratory.verification import begin_verification, finish_verification
from inclinometry.simulate.tool import realistic_tool

ODD = Dials("horizontal", "counterclockwise", "counterclockwise")
TOOL = realistic_tool(7)


def on_stand(bench: SimpleNamespace, dials: Dials, seed: int = 1):
    """The sensors of a tool on a rig that stands where its dials really mean."""
    read = bench.sensors(TOOL, seed)
    return lambda dial: replace(read(setting_of(dials, dial)), dial=dial)


def stated(ledger: Ledger, dials: Dials, sd: float) -> RegisteredRig:
    rig = RegisteredRig("stand 1", (sd, sd, sd), dials=dials)
    put_rig(ledger, rig, author="anna")
    return rig


@pytest.mark.parametrize("dials", WAYS, ids=Dials.words)
def test_a_rig_is_recorded_with_its_dials(laboratory: Ledger, bench: SimpleNamespace, dials: Dials) -> None:
    """One that counts as usual is recorded as before."""
    rig = stated(laboratory, dials, bench.sd)
    assert find_rig(laboratory, "stand 1") == rig
    assert ("dials" in laboratory.current("rig")[0].body) == (dials != USUAL)


def test_dials_that_are_none_are_not_recorded(laboratory: Ledger) -> None:
    with pytest.raises(InputError, match="azimuth_counts"):
        laboratory.append("rig", {"name": "x"}, {"sd_deg": [1, 1, 1], "dials": {"azimuth_counts": "left"}}, author="a")


@pytest.mark.long
def test_a_session_shows_and_keeps_what_the_dials_say(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The same tool calibrated and verified on a rig of reversed dials, its wrongly stated readings refused before."""
    put_site(laboratory, RegisteredSite("yard", dip=bench.dip), author="a")
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
    assert any("--inclination-from horizontal" in note for note in found.notes)
    judged = begin_verification(laboratory, record.id, "spread-12", author="a")
    judged = bench.take(laboratory, judged, on_stand(bench, ODD, 2))
    assert finish_verification(laboratory, judged.id, record.id, author="a").body["verdict"] == "pass"


def test_dials_stated_wrongly_are_put_right_on_the_rig_and_the_readings_stay(
    laboratory: Ledger, bench: SimpleNamespace
) -> None:
    """Refused, put right, calibrated; what the rig is said to be afterwards changes nothing of what is closed."""
    put_site(laboratory, RegisteredSite("yard", dip=bench.dip), author="a")
    dials = Dials(toolface_counts="counterclockwise")
    plan = plans.orthogonal()
    session = open_session(laboratory, "IN-7", plan, rig="stand 1", author="a", settings={"site": "yard"})
    bench.take(laboratory, session, on_stand(bench, dials))
    with pytest.raises(LedgerError) as error:
        finish_calibration(laboratory, session.id, author="a")
    told = at_the_bench(str(error.value))
    assert "with dials that count the toolface counterclockwise the readings fit" in told
    assert "State it on the rig" in told
    assert "--" not in told
    stated(laboratory, dials, bench.sd)
    record = finish_calibration(laboratory, session.id, author="a")
    stated(laboratory, USUAL, bench.sd)
    assert load_session(laboratory, session.id).dials == dials
    # and a verification on the rig as it is said to be now has no verdict
    judged = begin_verification(laboratory, record.id, "spread-12", author="a")
    bench.take(laboratory, judged, on_stand(bench, dials, 2))
    with pytest.raises(LedgerError, match="--toolface-counts counterclockwise the readings fit"):
        finish_verification(laboratory, judged.id, record.id, author="a")
    assert laboratory.count("verification") == 0
    stated(laboratory, dials, bench.sd)
    assert finish_verification(laboratory, judged.id, record.id, author="a").body["verdict"] == "pass"


def test_a_proposed_position_is_planned_from_what_the_dials_mean(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """The same proposal whichever way the dials count."""
    goal, places = Goal(u_azimuth=np.radians(0.5)), []
    for dials in (USUAL, ODD):
        rig = stated(laboratory, dials, bench.sd)
        session = open_session(laboratory, "IN-7", plans.twelve(), rig="stand 1", author="a")
        session = bench.take(laboratory, session, on_stand(bench, dials), range(1, 9))
        place = proposal(session, goal, rig, session_progress(session, goal, rig))
        assert place is not None
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
    put_site(laboratory, RegisteredSite("yard", dip=1.0, latitude=-0.5), author="a")
    put_site(laboratory, RegisteredSite("hall", dip=1.0), author="a")
    found = find_site(laboratory, "yard")
    assert found is not None
    assert found.latitude == pytest.approx(-0.5)
    assert "latitude_deg" not in laboratory.latest("site", name="hall").body
    text = "station,azimuth_deg,inclination_deg,toolface_deg,gyro_x,gyro_y,gyro_z\n1,0,60,0,5,0,9\n"
    session = load_session(laboratory, import_file(laboratory, text.encode(), "IN-7", "stand 1", author="a").id)
    assert bench_readings(session, **found.fields).reference["latitude"] == pytest.approx(-0.5)
    with pytest.raises(ValueError, match="latitude"):
        put_site(laboratory, RegisteredSite("x", latitude=2.0), author="a")


@pytest.mark.parametrize(
    "sentence",
    [
        "channels; --left-handed states that the channels are so",
        "state the dip of the stand (--dip-deg, dip_deg in --site, the column reference_dip_deg, or the form of the "
        "bench) to be sure",
        "state the latitude of the stand (latitude_deg in --site) to be sure",
        "state where the rig's zero points (--north-deg) and the dip (--dip-deg) to be sure",
        "known of it (--level-sd-deg, --north-deg with --north-sd-deg, --dip-sd-deg), or add stations",
        "verify with --stand fit or --stand level; tilted",
        "--nameplate, a data sheet",
    ],
)
def test_no_sentence_of_the_bench_asks_for_an_option(sentence: str) -> None:
    """But one that says where it is to be had."""
    told = at_the_bench(sentence)
    assert told != sentence
    assert told.count("--") == told.count("at the command line")


def test_options_of_the_bench_itself_stay() -> None:
    sentence = "no instrument is attached; start the bench with --instrument"
    assert at_the_bench(sentence) == sentence

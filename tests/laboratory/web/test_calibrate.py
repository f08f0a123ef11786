"""The bench page's logic without a browser: captures, retakes, outliers, the adaptive plan, two pages, a rig."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from nicegui import ui
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.conventions import Dials
from inclinometry.laboratory.attitude import FarError
from inclinometry.laboratory.guided_plans import plan_for
from inclinometry.laboratory.instruments.simulated_instrument import SimulatedInstrument
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import ConflictError
from inclinometry.laboratory.live import CaptureError, LiveFeed
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, find_rig, put_rig, put_tool
from inclinometry.laboratory.session import load_session, open_session, setting_of
from inclinometry.laboratory.web.pages.calibrate.guided import (
    ElsewhereError,
    Guided,
    NoInstrumentError,
    driver_of,
    heat_of,
)
from inclinometry.laboratory.web.pages.calibrate.show_progress import Live
from inclinometry.laboratory.web.words import say

SD = float(np.radians(0.05))


class Motor:
    """A rig that is there when the test says so."""

    name = "motor"

    def __init__(self):
        self.at, self.moving, self.asked = (0.0, 0.0, 0.0), False, 0

    def move(self, azimuth, inclination, toolface):
        self.at, self.moving = (azimuth, inclination, toolface), True

    def position(self):
        return self.at

    def ready(self):
        self.asked += 1
        return not self.moving


class Laboratory:
    """A ledger, a simulated tool whose samples come when the test lets time pass, and pages on it."""

    def __init__(self, folder, rig=None):
        self.ledger = create(folder / "ledger.sqlite")
        put_tool(self.ledger, RegisteredTool("IN-7", "steering tool"), author="anna")
        put_rig(self.ledger, RegisteredRig("stand", (SD, SD, SD)), author="anna")
        self.instrument = SimulatedInstrument(seed=3)
        self.now, self.number, self.heat = 0.0, 0, 20.0
        self.feed = LiveFeed(None, self.instrument.protocol, clock=lambda: self.now)
        self.bench = SimpleNamespace(ledger=self.ledger, feed=self.feed, rig=rig)

    def close(self):
        self.instrument.stop()
        self.ledger.close()

    def open(self, plan, purpose="calibrate", **settings):
        return open_session(
            self.ledger, "IN-7", plan, rig="stand", author="anna", purpose=purpose, settings=settings
        ).id

    def page(self, session, user="anna"):
        visitor = SimpleNamespace(
            bench=self.bench,
            say=lambda key, **v: say("en", key, **v),
            sentence=str,
            number=str,
            language="en",
            require=lambda _: SimpleNamespace(name=user),
        )
        return Guided(visitor, session)

    def rest(self, dial, seconds=6.0, warming=0.0):
        """The tool stands at a setting."""
        self.instrument.stand.move(dial, 0.0, at_once=True)
        for _ in range(round(10.0 * seconds)):
            self.now, self.number, self.heat = self.now + 0.1, self.number + 1, self.heat + 0.1 * warming
            sample = self.instrument.stand.sample(self.number, 0.0)
            self.feed.put(replace(sample, time=self.now, sequence=self.number, temperature=self.heat))

    def run(self, page, count, misread=None):
        """Capture so many positions, each when the tool has come to rest."""
        for _ in range(count):
            off = np.radians(10.0) if page.chosen.number == misread else 0.0
            azimuth, inclination, toolface = page.chosen.dial
            self.rest((azimuth, inclination, toolface + off))
            page.take(reason="the dial says so" if off else "")
            page.judge()
            page.choose_next()


@pytest.fixture
def laboratory(tmp_path):
    made = Laboratory(tmp_path)
    yield made
    made.close()


@pytest.fixture
def page(laboratory):
    """The page of a session of twelve positions."""
    return laboratory.page(laboratory.open(plans.twelve()))


@pytest.fixture
def motorised(tmp_path):
    made = Laboratory(tmp_path, Motor())
    yield made
    made.close()


@pytest.mark.long
def test_a_run_of_positions_ends_in_a_recorded_calibration(laboratory, page):
    laboratory.run(page, 12)
    assert page.session.next is None
    assert not page.open_positions
    # the noise of one reading of this instrument is ten times what the calibration adds to it
    assert page.now.from_calibration[1] < np.radians(0.2) < page.now.noise[1] < page.now.u_azimuth
    record = page.finish()
    assert load_session(laboratory.ledger, page.session.id).closed == "finished"
    assert record.body["summary"]["positions"] == 12


def test_a_retake_is_a_new_attempt_and_the_old_reading_stays(laboratory, page):
    laboratory.run(page, 3)
    page.choose(2)
    laboratory.rest(page.chosen.dial)
    assert page.take().attempt == 2
    assert [r.keys["attempt"] for r in laboratory.ledger.find("reading", session=page.session.id)] == [1, 1, 1, 2]
    assert page.session.taken[2].attempt == 2


def test_a_rejected_reading_opens_its_position_again(laboratory, page):
    laboratory.run(page, 3)
    page.leave_out(2, "somebody leant on the stand")
    assert page.session.taken[2].rejected == "somebody leant on the stand"
    assert page.open_positions[0].number == 2
    page.choose_next()
    laboratory.rest(page.chosen.dial)
    assert page.take().attempt == 2


def test_a_misread_dial_is_named_while_the_tool_is_on_the_stand_and_gone_after_a_retake(laboratory):
    page = laboratory.page(laboratory.open(plans.orthogonal()))
    laboratory.run(page, 16, misread=13)
    assert list(page.now.outliers) == [13]
    assert "toolface" in page.now.outliers[13].values["dial"]
    page.choose(13)
    laboratory.run(page, 1)
    assert not page.now.outliers


@pytest.mark.long
def test_an_adaptive_plan_goes_on_to_the_wanted_uncertainty_and_stops(laboratory):
    rig = find_rig(laboratory.ledger, "stand")
    plan, settings = plan_for("adaptive", laboratory.ledger, "IN-7", rig)
    # the noise of one reading alone gives 0.33 deg
    page = laboratory.page(laboratory.open(plan, **settings, target_u_deg={"u_azimuth_deg": 0.36}))
    page.judge()
    told = []
    while page.open_positions and page.session.attempts.__len__() < 25:
        laboratory.run(page, 1)
        if page.now.calibration is not None and page.gain() is not None:
            told.append(page.gain())
    assert page.now.reached
    assert page.now.u_azimuth <= np.radians(0.36)
    assert page.proposed is None
    assert told, "the page says by how much the next position helps"
    assert all(after < now for now, after in told)
    assert 6 <= len(page.session.valid) < 24


def test_a_page_opened_again_shows_what_the_ledger_has(laboratory):
    session = laboratory.open(plans.twelve())
    laboratory.run(laboratory.page(session), 5)
    again = laboratory.page(session)
    assert (len(again.session.valid), again.chosen.number) == (5, 6)


def test_a_second_page_sees_the_first_and_goes_on(laboratory):
    session = laboratory.open(plans.twelve())
    first, second = laboratory.page(session), laboratory.page(session, "boris")
    assert not second.news()
    laboratory.run(first, 1)
    assert second.news()
    assert second.session.has(1)
    assert second.chosen.number == 2
    assert not second.news()
    first.leave_out(1, "bumped")
    assert second.news()
    assert not second.session.has(1)


def test_of_two_captures_of_one_position_the_second_is_told(laboratory):
    session = laboratory.open(plans.twelve())
    first, second = laboratory.page(session), laboratory.page(session, "boris")
    laboratory.rest(first.chosen.dial)
    first.take()
    laboratory.rest(first.chosen.dial)
    with refused("ledger-conflict", error=ConflictError):
        second.take()
    assert laboratory.ledger.count("reading", session=session) == 1


def test_samples_from_before_a_capture_do_not_count_for_the_next(laboratory, page):
    laboratory.run(page, 1)
    with refused("capture-few", error=CaptureError):
        page.take()


def test_without_an_instrument_nothing_is_captured(laboratory):
    laboratory.bench.feed = None
    page = laboratory.page(laboratory.open(plans.twelve()))
    with pytest.raises(NoInstrumentError):
        page.take()


def test_automatic_capture_waits_until_the_tool_was_turned_and_rests(laboratory, page):
    page.automatic = True
    laboratory.rest(page.chosen.dial, 8.0)
    assert page.ready_by_itself(laboratory.feed.stability())
    page.take("automatic")
    page.choose_next()
    laboratory.rest((0.0, 0.0, 0.0), 8.0)
    assert not page.ready_by_itself(laboratory.feed.stability()), "the tool was not turned since"
    laboratory.rest(page.chosen.dial, 1.0)
    assert not page.ready_by_itself(laboratory.feed.stability())
    laboratory.rest(page.chosen.dial, 8.0)
    assert page.ready_by_itself(laboratory.feed.stability())


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A tool that was calibrated minutes before on a rig turned by hand."""
    made = Laboratory(tmp_path_factory.mktemp("calibrated"))
    page = made.page(made.open(plans.twelve()))
    for position in page.positions:
        page.choose(position.number)
        made.rest(position.dial)
        page.take()
    page.finish()
    yield made
    made.close()


@pytest.mark.parametrize(("number", "off_deg"), [(1, 40.0), (2, 80.0), (3, 90.0)])
def test_a_tool_far_from_the_target_is_captured_with_a_reason_only(calibrated, number, off_deg):
    page = calibrated.page(calibrated.open(plans.orthogonal()))
    page.automatic = True
    page.choose(number)
    azimuth, inclination, toolface = page.chosen.dial
    calibrated.rest((0.5, 1.0, 0.1), 1.0)
    calibrated.rest((azimuth, inclination, toolface + np.radians(off_deg)), 12.0)
    seen = calibrated.feed.stability()
    assert seen.still
    assert page.off_now(seen).far
    assert not page.ready_by_itself(seen)
    for how in ("automatic", "key"):
        with refused("ledger-far-from-target", error=FarError):
            page.take(how)
    assert calibrated.ledger.count("reading", session=page.session.id) == 0
    taken = page.take(reason="the index mark is on the other side")
    note = calibrated.ledger.get("reading", taken.record).body["note"]
    assert note.endswith(": the index mark is on the other side")
    assert f"target {np.degrees(toolface):.1f} deg" in note


def shown(page, monkeypatch):
    """State, colour and word of the verdict; the angles in red."""
    sent = []
    monkeypatch.setattr(ui, "run_javascript", sent.append)
    Live(page).show()
    said, (_, red) = (json.loads(f"[{part}]") for part in re.findall(r"bench\w+\((.*?)\)(?:;|$)", sent[0]))
    return (*said[0][:3], red)


def test_far_from_the_target_is_said_in_red_only_once_a_capture_is_asked_for(calibrated, monkeypatch):
    page = calibrated.page(calibrated.open(plans.orthogonal(), purpose="verify"))
    calibrated.rest((0.5, 1.0, 0.1), 12.0)
    assert shown(page, monkeypatch) == ("turn", "", "Turn it to the target", [])
    with pytest.raises(FarError):
        page.take()
    state, colour, word, red = shown(page, monkeypatch)
    assert (state, colour, word, bool(red)) == ("far", "bad", "Not at the target", True)
    page.choose(2)
    assert shown(page, monkeypatch)[:2] == ("turn", "")


def test_at_the_target_it_is_captured_by_itself_as_before(calibrated):
    page = calibrated.page(calibrated.open(plans.orthogonal()))
    page.automatic = True
    calibrated.rest((0.5, 1.0, 0.1), 1.0)
    calibrated.rest(page.chosen.dial, 12.0)
    seen = calibrated.feed.stability()
    assert not page.off_now(seen).far
    assert page.ready_by_itself(seen)
    assert page.take("automatic").capture.note == ""


def test_a_motorised_rig_that_stands_elsewhere_is_not_captured(motorised):
    motor = motorised.bench.rig
    page = motorised.page(motorised.open(plans.orthogonal()))
    page.choose(7)
    motorised.rest(page.chosen.dial)
    page.turner.poll()
    with refused("web-rig-elsewhere", error=ElsewhereError):
        page.take()
    page.turn()
    assert motor.at == page.chosen.dial
    assert page.rig_state.word == "moving"
    motor.moving = False
    assert page.turner.poll().at(page.chosen.dial)
    motorised.rest(page.chosen.dial)
    assert page.take().number == 7


def test_the_rig_is_asked_once_for_all_pages(motorised):
    session = motorised.open(plans.twelve())
    pages = [motorised.page(session) for _ in range(5)]
    for page in pages:
        page.turner.poll()
    assert motorised.bench.rig.asked == 1


def test_choosing_a_position_does_not_turn_the_rig(motorised):
    page = motorised.page(motorised.open(plans.twelve()))
    page.choose(5)
    page.step(1)
    page.choose_next()
    assert not motorised.bench.rig.moving


def test_a_rig_that_cannot_be_reached_is_said(laboratory):
    driver = {"kind": "scpi", "host": "127.0.0.1", "port": 1, "timeout_s": 0.2}
    put_rig(laboratory.ledger, RegisteredRig("stand", (SD, SD, SD), driver=driver), author="anna")
    page = laboratory.page(laboratory.open(plans.twelve()))
    state = page.turner.poll()
    assert state.word == "lost"
    assert (state.reason.code, state.reason.values["place"]) == ("capture-rig-silent", "127.0.0.1:1")
    assert driver_of(RegisteredRig("by hand", (SD, SD, SD))) is None


def test_a_campaign_waits_for_the_temperature_and_for_an_even_tool(laboratory):
    rig = find_rig(laboratory.ledger, "stand")
    plan, settings = plan_for("twelve", laboratory.ledger, "IN-7", rig, temperatures=(20.0, 60.0))
    page = laboratory.page(laboratory.open(plan, "temperature", **settings))
    page.automatic = True
    laboratory.rest(page.chosen.dial, 12.0)
    assert page.heat().even
    assert page.ready_by_itself(laboratory.feed.stability())
    laboratory.rest(page.chosen.dial, 20.0, warming=0.05)
    assert page.heat().rate == pytest.approx(1.9, abs=0.5)
    assert not page.heat().even
    page.choose(13)
    assert page.target_temperature(13) == 60.0
    assert not page.heat().near
    assert not page.ready_by_itself(laboratory.feed.stability())
    assert heat_of(None, 20.0) is None


def test_a_verification_makes_no_fit_of_its_own(laboratory):
    page = laboratory.page(laboratory.open(plans.twelve(), "verify"))
    laboratory.run(page, 8)
    assert page.verifies
    assert page.now is None
    assert page.proposed is None


def test_the_card_the_motor_and_the_record_have_what_the_dials_of_the_rig_say(motorised):
    dials = Dials("horizontal", azimuth_counts="counterclockwise")
    put_rig(motorised.ledger, RegisteredRig("stand", (SD, SD, SD), dials=dials), author="anna")
    page = motorised.page(motorised.open(plans.Plan("one", *np.radians([[90.0], [30.0], [10.0]]))))
    said = (270.0, 60.0, 10.0)
    assert np.degrees(page.chosen.dial) == pytest.approx(said)
    page.turn()
    assert np.degrees(motorised.bench.rig.at) == pytest.approx(said)
    motorised.bench.rig.moving = False
    page.turner.poll()
    motorised.rest((np.pi / 2, np.radians(30.0), np.radians(10.0)))
    taken = page.take()
    assert np.degrees(taken.capture.dial) == pytest.approx(said)
    assert np.degrees(setting_of(page.session.dials, taken.capture.dial)) == pytest.approx((-270.0, 30.0, 10.0))

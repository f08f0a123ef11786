"""A finished session evaluated again with a site: another calibration of the same readings, the one before stays."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.errors import InputError
from inclinometry.findings import rule, without_notes
from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.certificates import issue, status
from inclinometry.laboratory.import_file import record_calibration
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.registry import RegisteredSite, calibration_before, due_days, find_tool, put_site
from inclinometry.laboratory.results import calibration_of, earlier_judge, evaluate_again, history
from inclinometry.laboratory.session import load_session, open_session
from inclinometry.laboratory.verification import begin_verification

LABORATORY = Laboratory("Stand 1", "Street 1", "NO", authoriser="Anna Berg")


@pytest.fixture
def hall(laboratory: Ledger, bench: SimpleNamespace) -> Ledger:
    """The ledger with the site `hall`, whose dip and field are known."""
    put_site(laboratory, RegisteredSite("hall", b=50_000.0, dip=bench.dip), author="anna")
    return laboratory


def test_the_warning_is_resolved_and_both_calibrations_stay(hall: Ledger, bench: SimpleNamespace) -> None:
    """The numbers are those of a session that was opened with the site; who, when, why and the site are recorded."""
    before = bench.finished(hall)
    session = before.keys["session"]
    assert str(calibration_of(before).findings[0]).startswith(rule("bench-sign-assumed").says[0].partition("{")[0])
    after = evaluate_again(hall, session, "hall", author="boris", reason="the dip was measured")
    found = calibration_of(after)
    assert without_notes(found.findings) == ()
    assert [one.id for one in hall.find("calibration", session=session)] == [before.id, after.id]
    assert after.body["readings"] == before.body["readings"]
    event = hall.latest("event", subject_kind="session", subject=session, action="evaluated again")
    assert (event.author, event.body["reason"]) == ("boris", "the dip was measured")
    assert event.body["details"] == {"site": "hall", "before": before.id} == after.body["settings"]
    at_once = calibration_of(bench.finished(hall, site="hall"))
    np.testing.assert_allclose(found.tool.triads["magnetometer"].tensor, at_once.tool.triads["magnetometer"].tensor)
    assert issue(hall, after.id, None, LABORATORY, author="anna", pdf=False).body["record"]["accepted"] is None
    assert verify(hall).ok


def test_from_then_on_the_session_is_of_that_site(hall: Ledger, bench: SimpleNamespace) -> None:
    """Its own, that of the laboratory on its certificate, that of verifications opened afterwards; stated once more."""
    before = bench.finished(hall)
    session = before.keys["session"]
    evaluate_again(hall, session, "hall", author="anna")
    put_site(hall, RegisteredSite("yard", dip=bench.dip, laboratory={"name": "Yard", "country": "NO"}), author="a")
    after = evaluate_again(hall, session, "yard", author="anna")
    seen = load_session(hall, session)
    assert (seen.settings["site"], seen.closed) == ("yard", "finished")
    assert seen.site.name == "yard"
    assert load_session(hall, begin_verification(hall, after.id, "roll-4", author="a").id).settings["site"] == "yard"
    said = issue(hall, after.id, None, author="anna", pdf=False, authoriser=("Anna", "")).body["record"]
    assert said["laboratory"]["name"] == "Yard"


def test_one_set_of_readings_counts_once(hall: Ledger, bench: SimpleNamespace) -> None:
    """In the history, as the calibration before another, as the judge of the next session, for the day it is due."""
    first = bench.finished(hall, 1)
    second = bench.finished(hall, 2)
    tool = find_tool(hall, "IN-7")
    due = due_days(hall, [tool])
    with Ledger(hall.where, clock=lambda: datetime.now(UTC) + timedelta(days=40)) as later:
        newest = evaluate_again(later, second.keys["session"], "hall", author="anna")
        older = evaluate_again(later, first.keys["session"], "hall", author="anna")
        assert due_days(later, [tool]) == due
        assert list(history(later, "IN-7").records) == [older.id, newest.id]
        assert [calibration_before(later, one) for one in (second, newest, first)] == [older, older, None]
        third = open_session(later, "IN-7", plans.orthogonal(), rig="stand 1", author="anna")
        judge = earlier_judge(later, third)
        assert judge.made == newest.created
        record = issue(later, newest.id, None, LABORATORY, author="anna", pdf=False).body["record"]
    # of two runs; of one run it would be zero
    assert 0.0 < record["adjustment"]["largest_difference_deg"]["azimuth"] < 1.0


def test_a_certificate_of_the_evaluation_before_is_superseded_not_left_beside(
    hall: Ledger, bench: SimpleNamespace
) -> None:
    before = bench.finished(hall)
    old = issue(hall, before.id, None, LABORATORY, author="anna", accept_warnings="field points down", pdf=False)
    after = evaluate_again(hall, before.keys["session"], "hall", author="anna")
    number = old.keys["number"]
    assert status(hall, number).state == "issued"
    with refused("certificate-already", error=LedgerError, number=number):
        issue(hall, after.id, None, LABORATORY, author="anna", pdf=False)
    issue(hall, after.id, None, LABORATORY, supersedes=number, reason="the site was stated", author="anna")
    assert status(hall, number).state == "superseded"


def test_nothing_is_recorded_of_what_is_refused(hall: Ledger, bench: SimpleNamespace) -> None:
    """No such site, a field that contradicts the readings, an open session, a calibration without readings."""
    before = bench.finished(hall)
    session = before.keys["session"]
    put_site(hall, RegisteredSite("elsewhere", dip=float(np.radians(40.0))), author="anna")
    opened = open_session(hall, "IN-7", plans.twelve(), rig="stand 1", author="anna").id
    made = replace(calibration_of(before), warnings=("of before",))
    brought = record_calibration(hall, made, "IN-7", "stand 1", {}, author="anna").keys["session"]
    head = hall.head()
    for which, site, said in (
        (session, "nowhere", "site 'nowhere' is not registered"),
        (session, "elsewhere", "(?i)dip"),
        (opened, "hall", "this session has no calibration; finish it first"),
        (brought, "hall", "comes from tool.json or the tool's history"),
    ):
        with pytest.raises(InputError, match=said):
            evaluate_again(hall, which, site, author="anna")
    assert hall.head() == head

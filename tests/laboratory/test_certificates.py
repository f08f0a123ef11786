"""Certificates in the ledger: issued once, consecutive, voided or superseded, checked, refused."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.decision import Limits
from inclinometry.laboratory import certificates as workflow
from inclinometry.laboratory.certificate.dcc import read_dcc
from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.certificates import certificates, documents, next_number, status, verify_certificate, void
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.progress import Goal, session_progress
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredSite,
    RegisteredTool,
    find_rig,
    put_rig,
    put_site,
    put_tool,
)
from inclinometry.laboratory.results import finish_calibration
from inclinometry.laboratory.session import open_session
from inclinometry.laboratory.verification import finish_verification
from inclinometry.report.words import significant
from inclinometry.sensors import Tool
from inclinometry.simulate.tool import realistic_tool

Made = Callable[..., tuple[str, str]]
LABORATORY = Laboratory("Stand 1", "Street 1", "NO", authoriser="Anna")
WIDE, NARROW = (Limits("shop", "our own", float(np.radians(x)), None, None) for x in (5.0, 0.6))
REASON = "the field points down on this stand"
# the stand has no site: the sign of its field is an open warning
issue = partial(workflow.issue, accept_warnings=REASON)


@pytest.fixture
def made(laboratory: Ledger, bench: SimpleNamespace) -> Made:
    """made(seed, limits) -> ids of a calibration and its verification."""

    def make(seed: int = 1, limits: Limits = WIDE) -> tuple[str, str]:
        calibration = bench.finished(laboratory, seed).id
        return calibration, checked(laboratory, bench, calibration, seed, limits)

    return make


def checked(ledger: Ledger, bench: SimpleNamespace, calibration: str, seed: int, limits: Limits) -> str:
    """Id of a verification at six positions."""
    tool: Tool = realistic_tool(7)
    twelve = plans.twelve()
    plan = plans.Plan("six of twelve", twelve.azimuth[:6], twelve.inclination[:6], twelve.toolface[:6])
    session = open_session(ledger, "IN-7", plan, rig="stand 1", author="anna", purpose="verify")
    # what the narrow limits find: position 3 set three degrees off
    bench.take(ledger, session, bench.sensors(tool, 100 + seed, tilted={3: 0.05} if limits is NARROW else None))
    return finish_verification(ledger, session.id, calibration, author="anna", limits=limits).id


@pytest.mark.long
def test_from_issue_to_the_auditor(laboratory: Ledger, made: Made) -> None:
    """Number, documents, head of the chain; the check finds nothing; the ledger verifies."""
    calibration, verification = made()
    head, began = str(laboratory.head()), datetime.now(UTC).year
    record = issue(laboratory, calibration, verification, LABORATORY, author="anna")
    year = int(record.keys["number"][:4])
    assert year in (began, datetime.now(UTC).year)
    assert record.keys == {"number": f"{year}-0001", "serial": "IN-7"}
    assert record.body["head"] == head
    content = record.body["record"]
    assert content["item"]["name"] == "steering tool"
    assert content["interval_months"] == 12
    conformity = content["conformity"]
    assert (conformity["statement"], conformity["rule"]) == ("pass", "simple")
    assert list(conformity["judged"]) == ["inclination"]
    assert conformity["judged"]["inclination"]["positions"] == 6
    protocol = content["verification"]["report"]["protocol"]
    assert protocol == {"name": "six of twelve", "positions_captured": 6, "positions": 6}
    files = documents(laboratory, record)
    assert [name for name, _, _ in files.values()] == [f"{year}-0001_IN-7{end}" for end in (".pdf", ".xml", ".json")]
    assert files["pdf"][2].startswith(b"%PDF")
    assert read_dcc(files["dcc"][2]).serial == "IN-7"
    assert verify_certificate(laboratory, record.keys["number"]) == []
    assert verify(laboratory).ok
    assert status(laboratory, record.keys["number"]).state == "issued"


@pytest.mark.long
def test_numbers_are_consecutive_and_begin_anew_each_year(laboratory: Ledger, made: Made) -> None:
    """A number of one's own does not disturb them; a taken one is refused."""
    first, second, third = made(1)[0], made(2)[0], made(3)[0]
    number = issue(laboratory, first, None, LABORATORY, author="a").keys["number"]
    assert number.endswith("-0001")
    assert issue(laboratory, second, None, LABORATORY, author="a", number="X 1").keys["number"] == "X 1"
    with refused("certificate-number-taken", error=LedgerError):
        issue(laboratory, third, None, LABORATORY, author="a", number="X 1")
    year = int(number[:4])
    assert next_number(laboratory, year) == f"{year}-0002"
    assert next_number(laboratory, year + 1) == f"{year + 1}-0001"
    previous = issue(laboratory, third, None, LABORATORY, author="a").body["record"]["adjustment"]["previous"]
    assert previous.startswith("X 1 (")


@pytest.mark.long
def test_what_does_not_belong_is_refused(laboratory: Ledger, bench: SimpleNamespace, made: Made) -> None:
    """Another calibration's verification, a failed one unsaid, a second certificate, no laboratory."""
    (one, good), (two, bad) = made(1), made(2, NARROW)
    for calibration, verification, about, said in (
        (one, bad, LABORATORY, "session-agreed"),
        (two, bad, LABORATORY, "certificate-failed"),
        (one, good, None, "input-missing"),
        (one, good, replace(LABORATORY, country=""), "input-missing"),
    ):
        with refused(said):
            issue(laboratory, calibration, verification, about, author="a")
    with pytest.raises(LedgerError, check=lambda error: error.finding.code == "ledger-not-there"):
        issue(laboratory, good, None, LABORATORY, author="a")
    assert certificates(laboratory) == []
    stated = issue(laboratory, two, bad, LABORATORY, author="a", nonconforming=True)
    assert stated.body["record"]["conformity"]["statement"] == "fail"
    with refused("certificate-already", error=LedgerError, number="-0001"):
        issue(laboratory, two, None, LABORATORY, author="a")


@pytest.mark.long
def test_a_verification_of_another_tool_is_refused(laboratory: Ledger, made: Made) -> None:
    """Though somebody recorded it with this calibration's id."""
    calibration, verification = made()
    body = laboratory.get("verification", verification).body
    put_tool(laboratory, RegisteredTool("IN-8", "another"), author="a")
    keys = {"serial": "IN-8", "calibration": calibration}
    other = laboratory.append("verification", keys, body, author="a").id
    with refused("certificate-other-tool", error=LedgerError, tool="IN-8", calibrated="IN-7"):
        issue(laboratory, calibration, other, LABORATORY, author="a")


def test_void_and_supersede_never_edit(laboratory: Ledger, made: Made) -> None:
    """The old records stay as they were; reasons are asked for; nothing is done twice."""
    (one, good), (two, _) = made(1), made(2)
    first = issue(laboratory, one, good, LABORATORY, author="a").keys["number"]
    for nothing in ("  ", "-", "n/a", "tbd", "..."):
        with refused("ledger-reason", error=LedgerError):
            void(laboratory, first, nothing, author="a")
        with refused("ledger-reason", error=LedgerError):
            issue(laboratory, one, None, LABORATORY, supersedes=first, reason=nothing, author="b")
    second = issue(laboratory, one, None, LABORATORY, supersedes=first, reason="wrong customer", author="b")
    assert second.body["supersedes"] == first
    seen = status(laboratory, first)
    assert (seen.state, seen.by, seen.reason) == ("superseded", second.keys["number"], "wrong customer")
    assert void(laboratory, second.keys["number"], "tool dropped", author="a").state == "void"
    for again in (first, second.keys["number"]):
        with refused("certificate-ended", error=LedgerError):
            void(laboratory, again, "tool dropped", author="a")
        with refused("certificate-ended", error=LedgerError):
            issue(laboratory, two, None, LABORATORY, supersedes=again, reason="wrong customer", author="a")
    third = issue(laboratory, one, good, LABORATORY, author="a")
    assert [found.state for found in certificates(laboratory, serial="IN-7")] == ["issued", "void", "superseded"]
    for number in (first, second.keys["number"], third.keys["number"]):
        assert verify_certificate(laboratory, number) == []
    with pytest.raises(LedgerError, check=lambda error: error.finding.code == "ledger-not-there"):
        status(laboratory, "none")


@pytest.mark.long
def test_a_superseded_calibration_is_not_certified_beside_its_successor(laboratory: Ledger, made: Made) -> None:
    """The certificate that replaced it stands: another one of the old calibration needs a reason."""
    (one, good), (two, _) = made(1), made(2)
    first = issue(laboratory, one, good, LABORATORY, author="a").keys["number"]
    second = issue(laboratory, two, None, LABORATORY, supersedes=first, reason="better", author="a").keys["number"]
    with refused("certificate-already", error=LedgerError, number=second):
        issue(laboratory, one, good, LABORATORY, author="a")


@pytest.mark.long
def test_two_who_issue_at_once(laboratory: Ledger, bench: SimpleNamespace, made: Made) -> None:
    """Different calibrations get different numbers in sequence; the same one is certified once."""
    one, two = made(1)[0], made(2)[0]
    found = bench.at_once(*(partial(issue, laboratory, name, None, LABORATORY, author="a") for name in (one, two, two)))
    (late,) = (one for one in found if isinstance(one, LedgerError))
    numbers = [one.keys["number"] for one in found if one is not late]
    assert sorted(number[-4:] for number in numbers) == ["0001", "0002"]
    assert late.finding is not None
    assert late.finding.code == "certificate-already"


@pytest.mark.long
def test_the_laboratory_of_the_site(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """Taken from the site of the session; order and environment from the session; special characters kept."""
    put_site(
        laboratory, RegisteredSite("hall", laboratory={"name": "Hall <3>", "country": "NO", "fax": "1"}), author="a"
    )
    settings = {
        "site": "hall",
        "customer": "=A1 & #b",
        "received": "2020-01-02",
        "condition": "as new",
        "order": "77",
        "environment": {"temperature_degC": [20.0, 22.0], "humidity_percent": 40},
    }
    session = open_session(laboratory, "IN-7", plans.orthogonal(), rig="stand 1", author="a", settings=settings)
    session = bench.take(laboratory, session, bench.sensors(realistic_tool(7), 5))
    calibration = finish_calibration(laboratory, session.id, author="a").id
    content = issue(laboratory, calibration, None, author="a").body["record"]
    assert content["laboratory"]["name"] == "Hall <3>"
    assert content["customer"] == {"name": "=A1 & #b", "address": "", "reference": "77"}
    assert content["dates"]["received"] == "2020-01-02"
    assert content["environment"] == {"text": "", "temperature_degC": [20.0, 22.0], "humidity_percent": [40.0, 40.0]}


@pytest.mark.long
def test_the_rig_is_traced_and_somebody_answers(laboratory: Ledger, bench: SimpleNamespace, made: Made) -> None:
    """ISO/IEC 17025, 7.8.4.1 c) and 7.8.2.1 o): the rig as it was then, the author where nobody else is named."""
    sd = (bench.sd,) * 3
    put_rig(laboratory, RegisteredRig("stand 1", sd, traceability="NMI cert 12", place="hall 2"), author="a")
    one, two = made(1)[0], made(2)[0]
    put_rig(laboratory, RegisteredRig("stand 1", sd, traceability="NMI cert 13", place="hall 3"), author="a")
    nobody = replace(LABORATORY, authoriser="")
    record = issue(laboratory, one, None, nobody, author="bert")
    method = record.body["record"]["method"]
    assert (method["rig_traceability"], method["rig_place"]) == ("NMI cert 12", "hall 2")
    assert record.body["record"]["laboratory"]["authoriser"] == "bert"
    assert b"NMI cert 12" in documents(laboratory, record)["dcc"][2]
    record = issue(laboratory, two, None, LABORATORY, author="bert", authoriser=("Bert B", "metrologist"))
    issuer = record.body["record"]["laboratory"]
    assert (issuer["authoriser"], issuer["authoriser_role"]) == ("Bert B", "metrologist")


@pytest.mark.long
def test_a_record_that_contradicts_is_named(laboratory: Ledger, made: Made) -> None:
    """Whatever was recorded beside the documents."""
    calibration, verification = made()
    true = issue(laboratory, calibration, verification, LABORATORY, author="a")
    of_files = {("JSON file", "record"), ("PDF", "record"), ("DCC", "record")}
    changes: list[tuple[Callable[[dict[str, Any]], object], set[tuple[str, str]]]] = [
        (lambda record: record["results"]["parameters"][0].update(value=1.0), {("parameters", "calibration")}),
        (lambda record: record["item"].update(serial="IN-9"), of_files),
        (lambda record: record["verification"].update(verdict="fail"), {("record", "verification")}),
        (lambda record: record.update(number="1"), {("record", "certificate")}),
    ]
    for place, (change, wanted) in enumerate(changes):
        keys, body = {"number": f"forged {place}", "serial": "IN-7"}, copy.deepcopy(dict(true.body))
        change(body["record"])
        laboratory.append("certificate", keys, body, author="mallory")
        found = verify_certificate(laboratory, keys["number"])
        assert wanted <= {(one.values["part"], one.values["other"]) for one in found}, found


@pytest.mark.long
@pytest.mark.parametrize("span", [(10.0, 90.0), (12.0, 88.0)])
def test_what_would_be_certified_is_what_is_certified(
    laboratory: Ledger, bench: SimpleNamespace, span: tuple[float, float]
) -> None:
    """The bench's number is one of the certificate's table, to the last bit and as printed; a goal is judged by it."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    rig = find_rig(laboratory, "stand 1")
    goal = Goal(inclination_range=(float(np.radians(span[0])), float(np.radians(span[1]))))
    now = session_progress(session, goal, rig)
    limits = {"u_azimuth": now.u_azimuth, "u_inclination": now.u_inclination}
    assert session_progress(session, replace(goal, **limits), rig).reached
    assert not session_progress(session, replace(goal, u_azimuth=now.u_azimuth * (1.0 - 1e-12)), rig).reached
    calibration = finish_calibration(laboratory, session.id, author="anna", goal=goal).id
    table = issue(laboratory, calibration, None, LABORATORY, author="anna").body["record"]["results"]["uncertainty"]
    # 12 to 88 deg is covered by the rows from 10 to 90 deg
    rows = [n for n, x in enumerate(table["inclination_deg"]) if 10.0 <= x <= 90.0]
    assert np.degrees(now.covered).round(9).tolist() == [10.0, 90.0]
    alone = table["from_calibration"]
    for name, value, part in zip(
        ("inclination", "azimuth"), (now.u_inclination, now.u_azimuth), now.from_calibration, strict=True
    ):
        certified = max(table[f"U_{name}_deg"][n] for n in rows)
        assert float(np.degrees(value)) == certified
        assert significant(float(np.degrees(value))) == significant(certified)
        assert float(np.degrees(part)) == max(alone[f"U_{name}_deg"][n] for n in rows)
    recorded = laboratory.get("calibration", calibration).body["capability_deg"]
    assert recorded["U_azimuth_deg"] == table["U_azimuth_deg"]


def test_a_goal_below_the_noise_of_one_reading_is_never_reached(laboratory: Ledger, bench: SimpleNamespace) -> None:
    """No calibration betters what one reading scatters; the bench knows by how much."""
    session = bench.calibrated(laboratory, plans.orthogonal())
    rig = find_rig(laboratory, "stand 1")
    now = session_progress(session, Goal(), rig)
    assert 0.0 < now.noise[1] < now.u_azimuth <= np.hypot(now.noise[1], now.from_calibration[1]) * (1.0 + 1e-12)
    low = session_progress(session, Goal(u_azimuth=0.9 * now.noise[1]), rig)
    assert not low.reached

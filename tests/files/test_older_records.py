"""Files of the versions that kept sentences are read for ever, and their ledger is found sound."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from inclinometry.files import json_codec
from inclinometry.files.allan_json import read_allan
from inclinometry.files.corrections_json import read_corrections
from inclinometry.files.json_codec import findings_in, restored
from inclinometry.files.scale_json import read_scale
from inclinometry.files.tool_json import read_calibration, write_calibration
from inclinometry.files.verification_json import read_verification
from inclinometry.findings import Finding, example, room, rooms
from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.certificates import issue, verify_certificate
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.exchange import restore
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.progress import goal_of
from inclinometry.laboratory.results import calibration_of
from inclinometry.laboratory.session import load_session, sessions
from inclinometry.laboratory.verification import recorded

OLDER = Path(__file__).parents[1] / "reference" / "older"
TOOL = OLDER.with_name("tool-json") / "tool-2.json"


@pytest.mark.parametrize("name", rooms())
def test_what_is_stored_reads_back_equal(name: str) -> None:
    """Through JSON: values, rows, severity, findings within findings."""
    for code in room(name):
        found = example(code)._replace(rows=(0, 7), severity="note")
        assert restored(json.loads(json_codec.canonical(found.stored()))) == found


GONE = [
    ({"code": "fit-gone"}, "fit-gone: name md_m"),
    ({"code": "../words"}, "../words: name md_m"),
    ({"values": {}}, "input-empty"),
    ({"values": {"name": {"a": 1}}}, "input-empty: name {'a': 1}"),
]


@pytest.mark.parametrize(("change", "text"), GONE)
def test_a_code_of_another_version_is_shown_with_its_values(change: dict[str, Any], text: str) -> None:
    """With its severity and rows; a value that a sentence lacks is no error."""
    kept = Finding("input-empty", {"name": "md_m"}, (4,), severity="note").stored() | change
    assert restored(kept) == Finding("record-text", {"text": text}, (4,), "note")
    assert str(restored(kept)) == text


def test_sentences_of_files_are_findings_as_they_were_written() -> None:
    correction = read_corrections(OLDER / "corrections.json")
    assert correction.findings == (restored("toolfaces leave a gap"),)
    assert correction.information.shape == (5, 5)
    assert correction.parameters["MBX"].prior == 70.0
    assert len(read_scale(OLDER / "scale.json").observable) == 5
    assert findings_in(read_allan(OLDER / "allan.json")) == (restored("one"),)
    json_codec.stored(OLDER / "planned.json", "planned-verification", 3)


def test_an_older_verification_is_of_its_calibration(tmp_path: Path) -> None:
    """Also when its tool.json is written anew."""
    again = tmp_path / "tool.json"
    write_calibration(read_calibration(TOOL), again)
    for path in (TOOL, again):
        found = findings_in(read_verification(OLDER / "verify.json", read_calibration(path))["report"])
        assert [str(one) for one in found] == ["few positions", "inclination at 2", "level assumed"]


@pytest.fixture
def ledger(tmp_path: Path) -> Any:
    """The older export in a new ledger."""
    with create(tmp_path / "ledger.sqlite") as made:
        restore(made, OLDER / "export-2.zip")
        yield made


def test_an_older_ledger_is_sound(ledger: Ledger) -> None:
    """Chain, calibration, verification and certificate; sentences are findings."""
    assert verify(ledger).ok
    assert verify_certificate(ledger, "2026-0001") == []
    (calibration,), (verification,) = ledger.find("calibration"), ledger.find("verification")
    assert [one.code for one in calibration_of(calibration).findings if one.severity == "warning"] == ["record-text"]
    report = recorded(verification)["report"]
    assert report["protocol"] == {"name": "spread-12", "positions_captured": 12, "positions": 12}
    assert [str(one) for one in findings_in(report)] == verification.body["report"]["reasons"]
    (wanted,) = [one for one in sessions(ledger) if "wanted" in one.body]
    assert goal_of(ledger, load_session(ledger, wanted.id)).u_azimuth is not None


def test_a_certificate_of_an_older_verification_is_issued_again(ledger: Ledger) -> None:
    """With findings; the one before stays, and both agree with their records."""
    (calibration,), (verification,) = ledger.find("calibration"), ledger.find("verification")
    about = Laboratory("Stand 1", "Street 1", "NO", authoriser="Anna Berg")
    how: dict[str, Any] = {"supersedes": "2026-0001", "reason": "customer", "accept_warnings": "field points down"}
    made = issue(ledger, calibration.id, verification.id, about, author="anna", pdf=False, **how)
    content = made.body["record"]
    (warned,) = findings_in(content)
    assert str(warned) == ledger.find("certificate")[0].body["record"]["warnings"][0]
    assert content["accepted"]["findings"] == content["findings"]
    assert verify_certificate(ledger, "2026-0001") == verify_certificate(ledger, made.keys["number"]) == []
    assert verify(ledger).ok

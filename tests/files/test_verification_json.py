"""verify.json: every position in degrees, bound to one calibration of one tool."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration.conformity import Verification
from inclinometry.calibration.decision import Limits
from inclinometry.errors import FileError
from inclinometry.files.json_codec import findings_in, restored
from inclinometry.files.tool_json import read_calibration
from inclinometry.files.verification_json import read_verification, write_verification
from inclinometry.findings import Finding

from .json_records import changed

FINDINGS = (
    restored("inclination at 2", "note"),
    Finding("verify-not-judged", {"names": ("toolface",), "why": "at no position"}, severity="note"),
    Finding("input-empty", {"name": "md_m"}),
)
TOOL = Path(__file__).parents[1] / "reference" / "convention-house" / "tool.json"
LIMITS = Limits("mine", "works standard 7", np.radians(0.1), np.radians(1.0), None, np.radians(3.0), "none")


@pytest.fixture(scope="module")
def calibration():
    return read_calibration(TOOL)


def verification():
    """Two positions; at the vertical one azimuth and toolface are not judged."""
    errors = np.radians([[0.05, 0.2, -0.1], [-0.15, np.nan, np.nan]])
    return Verification(
        station=("1", "2"),
        dials=np.radians([[120.0, 30.0, 240.0], [0.0, 0.0, 0.0]]),
        true_inclination=np.radians([30.0, 0.0]),
        errors=errors,
        u=np.radians([[0.01, 0.05, 0.02], [0.01, np.nan, np.nan]]),
        limits=np.radians([[0.1, 1.0, np.nan], [0.1, 1.0, np.nan]]),
        decision=(("pass", "pass", "not judged"), ("fail", "not judged", "not judged")),
        coverage_factor=2.0,
        verdict="fail",
        limits_name="mine",
        limits_source="works standard 7",
        inputs={"readings": "sha256:00"},
        findings=FINDINGS,
    )


def test_every_position_in_degrees(tmp_path, calibration):
    write_verification(tmp_path / "verify.json", verification(), LIMITS, calibration)
    content = read_verification(tmp_path / "verify.json", calibration)
    assert (content["verdict"], content["tool"]) == ("fail", calibration.tool.name)
    first, second = content["report"]["positions"]
    dials = [first[f"{name}_deg"] for name in ("azimuth", "inclination", "toolface")]
    assert (first["position"], dials) == ("1", [120.0, 30.0, 240.0])
    assert first["azimuth"] == {"error_deg": pytest.approx(0.2), "U_deg": pytest.approx(0.1), "limit_deg":
                                pytest.approx(1.0), "decision": "pass"}  # fmt: skip
    assert first["toolface"]["limit_deg"] is None
    assert second["azimuth"] == {"error_deg": None, "U_deg": None, "limit_deg": pytest.approx(1.0),
                                 "decision": "not judged"}  # fmt: skip
    assert second["inclination"]["error_deg"] == pytest.approx(-0.15)
    assert findings_in(content["report"]) == FINDINGS
    assert content["limits"] == {
        "name": "mine", "source": "works standard 7", "guard": "none",
        "min_inclination_deg_for_azimuth": pytest.approx(3.0), "inclination_deg": pytest.approx(0.1),
        "azimuth_deg": pytest.approx(1.0), "toolface_deg": None,
    }  # fmt: skip
    # no limits were agreed
    write_verification(tmp_path / "none.json", replace(verification(), verdict="agrees"), None, calibration)
    assert read_verification(tmp_path / "none.json", calibration)["limits"] is None


def test_a_file_of_version_1_without_agreed_limits_is_read_without_them(tmp_path, calibration):
    """What it calls limits and pass nobody had agreed: U is that of k = 2, near the vertical a tilt's."""
    path = tmp_path / "verify.json"
    write_verification(path, verification(), LIMITS, calibration)
    old = json.loads(path.read_text()) | {"version": 1, "verdict": "pass"}
    report = old["report"]
    report["coverage_factor"] = 3.64
    del report["findings"]
    report["warnings"] = ["few positions"]
    report["reasons"] = ["every judged angle is within its limit at every position", "level assumed"]
    for row in report["positions"]:
        for name in ("inclination", "azimuth", "toolface"):
            one = row[name]
            one["decision"] = one["decision"].replace("fail", "pass")
            one["U_deg"] = None if one["U_deg"] is None else 1.82 * one["U_deg"]
    path.write_text(json.dumps(old))
    content = read_verification(path, calibration)
    assert content["verdict"] == "pass"  # limits that were agreed stay
    said = [(one.severity, str(one)) for one in findings_in(content["report"])]
    assert said == [("warning", "few positions"), *(("note", text) for text in report["reasons"])]
    path.write_text(json.dumps(old | {"limits": {"name": "certificate", "source": "derived: ..."}}))
    content = read_verification(path, calibration)
    assert (content["verdict"], content["limits"], content["report"]["coverage_factor"]) == ("agrees", None, 2.0)
    assert list(map(str, findings_in(content["report"]))) == ["few positions"]  # no reasons of a pass that is none
    first, second = content["report"]["positions"]
    assert first["inclination"] == {"error_deg": pytest.approx(0.05), "U_deg": pytest.approx(0.02), "limit_deg": None,
                                    "decision": "agrees"}  # fmt: skip
    assert first["toolface"]["decision"] == "not judged"
    # the length of a tilt: sqrt(ln p(2) / ln p(3.64)) = 0.613 instead of 2 / 3.64
    assert second["inclination"]["U_deg"] == pytest.approx(0.02 * 1.82 * 0.6130, rel=1e-3)


def test_it_is_of_one_calibration_of_one_tool(tmp_path, calibration):
    path = tmp_path / "verify.json"
    write_verification(path, verification(), LIMITS, calibration)
    with refused("record-calibration-other", error=FileError):
        read_verification(path, replace(calibration, findings=(restored("another"),)))
    other = replace(calibration, tool=replace(calibration.tool, name="another"))
    with refused("record-tool-other", error=FileError):
        read_verification(path, other)


@pytest.mark.parametrize(
    ("cells", "lost"),
    [
        ({"decision": "pass", "error_deg": None}, True),
        ({"decision": "fail", "U_deg": None}, True),
        ({"decision": "not judged", "error_deg": None}, False),
        ({"decision": "pass", "error_deg": None, "limit_deg": None}, False),
    ],
)
def test_what_is_judged_has_a_number(tmp_path, calibration, cells, lost):
    path = tmp_path / "verify.json"
    write_verification(path, verification(), LIMITS, calibration)
    changed(path, lambda content: content["report"]["positions"][0]["azimuth"].update(cells))
    if not lost:
        assert read_verification(path, calibration)["verdict"] == "fail"
        return
    with refused("input-missing", error=FileError):
        read_verification(path, calibration)

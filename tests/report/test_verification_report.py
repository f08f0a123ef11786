"""The verification report."""

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.calibration.conformity import Verification
from inclinometry.files.json_codec import restored
from inclinometry.findings import example
from inclinometry.report.verification import verification_report

from .pages import check

NAMES = ("pass", "inconclusive", "fail", "not judged")


@pytest.fixture
def found():
    size = 12
    random = np.random.default_rng(5)
    u = np.radians(0.05) * np.ones((size, 3))
    limits = np.radians([0.2, 0.6, 0.5]) * np.ones((size, 3))
    limits[0, 1:] = np.inf
    u[0, 1:] = np.pi / np.sqrt(3.0)
    decision = [["pass"] * 3 for _ in range(size)]
    decision[0] = ["pass", "not judged", "not judged"]
    dials = random.uniform(0.0, 2.0, (size, 3))
    return Verification(
        [str(k) for k in range(size)], dials, dials[:, 1], 0.04 * u * random.standard_normal((size, 3)), u, limits,
        decision, 2.0, "pass", "shop", "sheet 4", "A7", {"readings": "sha256:1"},
    )  # fmt: skip


def test_pass(found):
    page = check(verification_report(found))
    assert page.text.index("PASS") < page.text.index("A7 keeps the limits “shop” at 12 independent positions")
    assert "FAIL" not in page.text
    assert page.tags.count("svg") == 6
    assert "undefined" in page.text
    assert verification_report(found) == verification_report(found)


@pytest.mark.long
def test_fail_with_guard_band(found):
    decision = [list(row) for row in found.decision]
    decision[3][0], decision[4][1] = "fail", "inconclusive"
    page = check(verification_report(replace(found, decision=decision, verdict="fail")))
    assert "FAIL" in page.text
    assert "does not keep" in page.text
    assert "guard band" in page.text


def test_nothing_judged(found):
    none = replace(found, limits=np.full((12, 3), np.inf), decision=[["not judged"] * 3 for _ in range(12)])
    assert "not judged" in check(verification_report(none)).text


@pytest.mark.long
def test_hostile_names(found):
    evil = "<img src=x onerror=alert(1)>"
    sharp = replace(
        found, station=[evil] * 12, tool=evil, limits_name=evil, limits_source=evil, findings=(restored(evil),) * 2
    )
    assert check(verification_report(sharp)).text.count(evil) >= 12 + 5


@pytest.mark.long
def test_a_pass_with_warnings_is_not_green(found):
    doubted = verification_report(replace(found, findings=(example("verify-freedom"),)))
    assert 'class="verdict good"' in verification_report(found)
    assert 'class="verdict warn"' in doubted
    assert "PASS, with reservations" in check(doubted).text


def test_errors_at_two_settings_are_no_curve(found):
    dials = found.dials.copy()
    dials[:, 1] = np.where(np.arange(12) % 2, 0.5, 1.0)
    page = check(verification_report(replace(found, dials=dials)))
    assert "Error curve: error of inclination" not in page.text
    assert "Error curve: error of azimuth" in page.text
    assert page.tags.count("svg") == 5

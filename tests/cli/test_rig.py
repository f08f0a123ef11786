"""Another stand: a calibrated tool finds how it stands, and is verified there; two files of one tool side by side."""

import dataclasses
import re

import numpy as np
import pytest

from inclinometry.files.tool_json import read_calibration, write_calibration
from inclinometry.sensors import Tool, Triad

STAND = ("--new-stand", "--base-tilt-deg", 3, "--north-offset-deg", 30)


@pytest.fixture
def other(run, bench):
    """tool.json, and other.csv of the same tool on a second stand, tilted by 3 deg with its zero 30 deg from north."""
    bench("twelve", "--seed", 1)
    assert run("calibrate readings.csv -o tool.json").status == 0
    again = ("simulate", "bench", "--plan", "orthogonal", "--tool", "truth.json", "--seed", 2, "--rig-sd-deg", 0.05)
    assert run(*again, *STAND, "-o", "other.csv").status == 0


def test_orient_finds_the_stand(run, other, tmp_path):
    (tmp_path / "site.toml").write_text("declination_deg = 4.5\nsigma_declination_deg = 0.2\n")
    found = run("rig orient other.csv --calibration tool.json --site site.toml --json").json
    truth = {"tilt": 3.0, "zero_from_magnetic_north": 30.0, "zero_from_true_north": 34.5}
    for key, value in truth.items():
        here = found["found"][key]
        assert abs(here["deg"] - value) < 2.0 * here["u_deg"], key
    assert found["found"]["zero_from_true_north"]["u_deg"] == pytest.approx(0.2, abs=0.02)
    assert found["found"]["inclination_zero"]["deg"] == pytest.approx(0.0, abs=0.1)
    shown = run("rig orient other.csv --calibration tool.json").ok()
    assert "levelled zero from magnetic north" in shown.out


@pytest.mark.long
def test_verify_there(run, other):
    """Review, A25: a good tool on a second stand failed, and no option said that it was another one."""
    failed = run("verify other.csv --calibration tool.json --json")
    assert failed.status == 1
    assert "verify-other-stand" in [one["code"] for one in failed.json["findings"]]
    fitted = run("verify other.csv --calibration tool.json --stand fit -o v.json --report v.html").ok()
    assert "Agreement with the certificate: AGREES" in fitted.out
    # a certificate takes it, and says that the orientation was fitted
    run("certificate tool.json --verification v.json -o c.pdf --record c.json --json").ok()
    level = ("verify", "other.csv", "--calibration", "tool.json", "--stand", "level", "--north-deg", 30)
    assert run(*level).status == 1  # it is not level
    assert run(*level, "--level-sd-deg", 3, "--north-sd-deg", 1).status == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--north-deg", 30), "[input-not-with]"),
        (("--stand", "fit", "--level-sd-deg", 1), "[input-not-with]"),
        (("--stand", "level", "--north-sd-deg", 1), "[input-needs]"),
        (("--azimuth-from", "gyro"), "[input-triads]"),
    ],
)
def test_options_that_say_nothing_are_refused(run, other, options, words):
    run("verify other.csv --calibration tool.json", *options).refused(words)


@pytest.mark.long
def test_two_files_of_one_tool(run, bench):
    """Review, C12: 24 positions against two turns; compare took one file and said "not applicable" of the other."""
    bench("orthogonal", "--seed", 1)
    turns = ("simulate", "bench", "--plan", "rotations", "--tool", "truth.json", "--seed", 2, "--rig-sd-deg", 0.1)
    assert run(*turns, "-o", "turns.csv").status == 0
    command = ("compare", "readings.csv", "turns.csv", "--methods", "orthogonal,rotations", "--truth", "truth.json")
    found = run(*command, "--json", "--report", "two.html").json
    assert found["methods"] == ["orthogonal", "rotations"]
    assert [c["name"] for c in found["coefficients"][:5]] == ["K", "cos x", "cos y", "cos z", "bias"]
    assert len(found["coefficients"]) == 30
    scores = [c["difference"] / c["u_difference"] for c in found["coefficients"]]
    # thirty, correlated: of one tool they agree
    assert np.max(np.abs(scores)) < 5.0
    for name in ("expected_u_deg_1", "expected_u_deg_2", "difference_rms_deg", "true_error_rms_deg_1"):
        assert len(found[name]["azimuth"]) == len(found["inclination_deg"])
    shown = run(*command)
    assert re.search(r"readings.csv┃.*\n.* \(orthogonal\)┃", shown.out)
    assert "1 cos x" in shown.out


@pytest.mark.long
def test_drift_between_two_calibrations(run, bench, tmp_path):
    bench("orthogonal", "--seed", 1)
    assert run("calibrate readings.csv -o old.json").status == 0
    assert run("simulate bench --plan orthogonal --tool truth.json --seed 5 -o b.csv").status == 0
    assert run("calibrate b.csv -o new.json").status == 0
    calibration = read_calibration(tmp_path / "new.json")
    old = calibration.tool
    shifted = {
        k: Triad(k, t.tensor, t.offset + (5.0 if k == "accelerometer" else 0.0), t.unit, t.field_strength)
        for k, t in old.triads.items()
    }
    drifted = dataclasses.replace(calibration, tool=Tool(old.name, shifted, old.covariance, old.noise))
    write_calibration(drifted, tmp_path / "new.json")
    found = run("compare old.json new.json --json").json
    bias = [c for c in found["coefficients"] if c["name"] == "bias"]
    assert all(c["difference"] / c["u_difference"] > 4.0 for c in bias if c["kind"] == "accelerometer")
    assert all(abs(c["difference"] / c["u_difference"]) < 4.0 for c in bias if c["kind"] == "magnetometer")


def test_methods_are_for_two_files(run, bench):
    bench()
    run("compare readings.csv --methods joint,twelve").refused("[input-needs]")

"""Each command as a user runs it: what it writes is what the contract says and agrees with the truth."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from inclinometry.cli.demo import show_hot_run
from inclinometry.simulate.gyro import hot_run
from inclinometry.workflow.demo import Demo
from inclinometry.workflow.hot_run import reduce_hot_run, rms_degrees

SURVEY = (
    "md_m,inclination_deg,azimuth_deg,azimuth_reference,toolface_deg,magnetic_toolface_deg,g_total,b_total_nT,dip_deg,"
    "u_inclination_deg,u_azimuth_deg,u_toolface_deg,flags"
)


def rows(path):
    with Path(path).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("plan", ["twelve", "orthogonal", "half", "two-face", "rotations"])
def test_plan_writes_settings_that_can_be_simulated(run, plan):
    assert run("plan", plan, "-o", "plan.csv").status == 0
    assert {"station", "azimuth_deg", "inclination_deg", "toolface_deg"} <= set(rows("plan.csv")[0])
    assert run("simulate", "bench", "--plan", "plan.csv", "-o", "readings.csv").status == 0
    assert len(rows("readings.csv")) == len(rows("plan.csv"))


def test_plan_optimal_keeps_to_its_number_and_is_reproducible(run):
    for name in ("a.csv", "b.csv"):
        done = run("plan", "optimal", "-n", 12, "--inclination-range-deg", 0, 20, "-o", name, "--json")
        assert done.status == 0, done.err
        assert done.json["stations"] == 12
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


@pytest.mark.parametrize(
    ("plan", "method"),
    [
        ("twelve", "joint"),
        ("twelve", "twelve"),
        ("orthogonal", "orthogonal"),
        ("two-face", "orthogonal"),
        ("rotations", "rotations"),
    ],
)
def test_calibrate_finds_the_truth(run, bench, plan, method):
    bench(plan)
    done = run("calibrate", "readings.csv", "-o", "tool.json", "--method", method, "--report", "report.html")
    assert done.status == 0, done.err
    tool, truth = json.loads(Path("tool.json").read_text()), json.loads(Path("truth.json").read_text())
    wanted = {
        "schema", "version", "tool", "created", "method", "inputs", "convention", "triads", "covariance",
        "field_directions", "rig", "residuals", "temperature_range_degC", "warnings",
    }  # fmt: skip
    assert wanted <= set(tool)
    names = tool["covariance"]["parameters"]
    sd = dict(zip(names, np.sqrt(np.diagonal(tool["covariance"]["matrix"])), strict=True))
    for kind in ("accelerometer", "magnetometer"):
        assert {"tensor", "offset", "unit"} <= set(tool["triads"][kind])
        off = np.subtract(tool["triads"][kind]["tensor"], truth["triads"][kind]["tensor"])
        spread = [[sd[f"{kind}.tensor[{i},{j}]"] for j in range(3)] for i in range(3)]
        # 18 normal deviates exceed 5 standard uncertainties once in 10^5 runs, and the seed is fixed
        assert np.abs(off / spread).max() < 5.0
    assert Path("report.html").read_text(encoding="utf-8").lstrip().startswith("<!doctype html>")


def test_same_input_gives_the_same_bytes(run, bench):
    bench()
    for name in ("a.json", "b.json"):
        assert run("calibrate", "readings.csv", "-o", name, "--report", f"{name}.html").status == 0
    assert Path("a.json").read_bytes() == Path("b.json").read_bytes()
    assert Path("a.json.html").read_bytes() == Path("b.json.html").read_bytes()
    assert b"\r" not in Path("a.json").read_bytes()


def test_compare_says_what_applies_and_what_does_not(run, bench):
    bench()
    done = run("compare", "readings.csv", "--truth", "truth.json", "--json")
    assert done.status == 0, done.err
    methods = {m["method"]: m for m in done.json["methods"]}
    assert methods["joint"]["applicable"]
    assert methods["twelve"]["applicable"]
    assert not methods["orthogonal"]["applicable"]
    assert "plan" in methods["orthogonal"]["reason"]
    # the joint fit promises less and the table shows it
    joint, twelve = (np.array(methods[m]["expected_u_deg"]["azimuth"]) for m in ("joint", "twelve"))
    assert (joint < twelve).all()
    assert run("compare", "readings.csv").out.count("joint") == 1


def test_verify_passes_the_tool_and_fails_another(run, bench):
    bench("orthogonal")
    assert run("calibrate", "readings.csv", "-o", "tool.json").status == 0
    again = ("simulate", "bench", "--plan", "twelve", "--tool", "truth.json", "--seed", 9, "--rig-sd-deg", 0.05)
    assert run(*again, "-o", "check.csv").status == 0
    done = run("verify", "check.csv", "--calibration", "tool.json", "--report", "verify.html", "--json")
    assert (done.status, done.json["verdict"]) == (0, "pass"), done.err
    assert run("simulate", "bench", "--plan", "twelve", "--seed", 5, "-o", "other.csv").status == 0
    done = run("verify", "other.csv", "--calibration", "tool.json")
    assert done.status == 1
    assert "FAIL" in done.out
    done = run("verify", "readings.csv", "--calibration", "tool.json")
    assert done.status == 2
    assert "independent" in done.err


def test_survey_has_the_columns_and_the_angles(run, bench):
    bench("orthogonal")
    assert run("calibrate", "readings.csv", "-o", "tool.json").status == 0
    assert run("simulate", "well", "--truth", "truth.json", "-o", "raw.csv", "--path", "path.csv").status == 0
    done = run("survey", "raw.csv", "--calibration", "tool.json", "-o", "survey.csv", "--report", "survey.html")
    assert done.status == 0, done.err
    assert Path("survey.csv").read_text().splitlines()[0] == SURVEY
    for found, true in zip(rows("survey.csv"), rows("path.csv"), strict=True):
        off = float(found["inclination_deg"]) - float(true["inclination_deg"])
        assert abs(off) < 4.5 * float(found["u_inclination_deg"])
        turn = (float(found["azimuth_deg"]) - float(true["azimuth_deg"]) + 180.0) % 360.0 - 180.0
        assert abs(turn) < 4.5 * float(found["u_azimuth_deg"])
        assert found["azimuth_reference"] == "magnetic"
        assert float(found["g_total"]) == pytest.approx(9.80665, abs=0.03)
        assert float(found["b_total_nT"]) == pytest.approx(50000.0, abs=200.0)


def test_survey_turns_to_the_north_the_site_asks_for(run, bench):
    bench("orthogonal")
    run("calibrate", "readings.csv", "-o", "tool.json")
    run("simulate", "well", "--truth", "truth.json", "-o", "raw.csv")
    assert run("survey", "raw.csv", "--calibration", "tool.json", "-o", "magnetic.csv").status == 0
    site = 'north_reference = "grid"\ndeclination_deg = 5.0\nconvergence_deg = 1.5\nsigma_declination_deg = 0.4\n'
    Path("site.toml").write_text(site)
    assert run("survey", "raw.csv", "--calibration", "tool.json", "--site", "site.toml", "-o", "grid.csv").status == 0
    for magnetic, grid in zip(rows("magnetic.csv"), rows("grid.csv"), strict=True):
        turn = (float(grid["azimuth_deg"]) - float(magnetic["azimuth_deg"])) % 360.0
        assert turn == pytest.approx(3.5, abs=1e-6)
        assert grid["azimuth_reference"] == "grid"
        assert float(grid["u_azimuth_deg"]) >= 0.4 - 1e-9


def test_readings_of_a_log_with_a_plan(run):
    assert run("simulate", "log", "--plan", "twelve", "-o", "log.csv", "--truth", "truth.json").status == 0
    assert run("plan", "twelve", "-o", "plan.csv").status == 0
    done = run("readings", "log.csv", "--plan", "plan.csv", "-o", "readings.csv")
    assert done.status == 0, done.err
    assert len(rows("readings.csv")) == 12
    assert run("calibrate", "readings.csv", "-o", "tool.json").status == 0
    tool, truth = json.loads(Path("tool.json").read_text()), json.loads(Path("truth.json").read_text())
    # 500 samples a rest: 3 mg / 22 and 20 nT / 22, a few parts in 10^5 of full scale
    for kind, full in (("accelerometer", 9.8), ("magnetometer", 5e4)):
        assert np.allclose(tool["triads"][kind]["tensor"], truth["triads"][kind]["tensor"], atol=2e-4 * full)
    run("plan", "orthogonal", "-o", "other.csv")
    done = run("readings", "log.csv", "--plan", "other.csv", "-o", "no.csv")
    assert done.status == 2
    assert "24 positions" in done.err
    assert not Path("no.csv").exists()


def test_temperature_campaign_is_seen_and_extrapolation_flagged(run, bench):
    bench("twelve", "--temperature-degC", 20, 60, 100, "--temperature-degree", 1)
    done = run("calibrate", "readings.csv", "-o", "tool.json", "--json")
    assert done.status == 0, done.err
    tool = json.loads(Path("tool.json").read_text())
    assert tool["temperature_range_degC"] == [20.0, 100.0]
    assert len(tool["triads"]["accelerometer"]["temperature_coefficients"]) == 1
    Path("raw.csv").write_text(
        "md_m,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z,temperature_degC\n0,-300,20,1500,500,-60,1400,150\n"
    )
    done = run("survey", "raw.csv", "--calibration", "tool.json", "-o", "survey.csv")
    assert done.status == 0, done.err
    assert "temperature" in rows("survey.csv")[0]["flags"]


def test_demo_runs_and_leaves_its_pages(run):
    done = run("demo", "--output", "out", "--json")
    assert done.status == 0, done.err
    assert {p.name for p in Path("out").glob("*")} >= {
        "index.html",
        "comparison.png",
        "xsens",
        "cave",
        "twelve",
        "gyro",
    }
    found = done.json
    assert found["xsens"]["poses"] == 38
    assert found["cave"]["axis_spread_deg"] < 0.27
    assert found["verification"] == "pass"
    assert {p.name for p in Path("out/gyro").glob("*")} == {"hot_run.png", "gyro.html", "scale.html"}
    assert "gyro/gyro.html" in Path("out/index.html").read_text(encoding="utf-8")
    rms = found["hot_run"]["rms_deg"]
    assert rms["joint, scale followed"] < 0.5 * min(rms["uncompensated"], rms["patent, closed form"])


def test_demo_shows_the_hot_run_side_by_side(capsys):
    found = reduce_hot_run(hot_run(8))
    show_hot_run(Demo(Path("out"), hot_run=found, hot_runs_rms=rms_degrees([found])))
    said = capsys.readouterr().out
    for name, rms in rms_degrees([found]).items():
        row = next(line for line in said.splitlines() if name in line)
        assert row.count(f"{rms:.3f}") == 2  # this run, and "many" of one


def test_help_is_there_for_every_command_and_has_an_example(run):
    for command in ("plan", "readings", "calibrate", "compare", "verify", "survey", "demo"):
        done = run(command, "--help")
        assert done.status == 0
        assert "Example: inclinometry" in done.out
    assert "Example: inclinometry" in run("simulate", "bench", "--help").out


def test_help_and_import_load_nothing_heavy():
    heavy = "{'scipy', 'numba', 'matplotlib', 'jsonschema'}"
    for code in (
        "import inclinometry",
        "from inclinometry.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass",
    ):
        check = f"{code}\nimport sys; bad = {heavy} & set(sys.modules); sys.exit(str(bad) if bad else 0)"
        done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

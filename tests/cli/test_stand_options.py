"""What a user says of the stand, the dials and the converter, and files of a single sensor."""

import json

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.rotations import dcm

from .tables import rows_of


@pytest.fixture
def turned(run):
    """Readings of two turns at 45 and 135 degrees."""
    run("plan rotations --first-inclination-deg 45 -o plan.csv")
    run("simulate bench --plan plan.csv --seed 2 --rig-sd-deg 0.1 -o turned.csv")
    return "turned.csv"


def worst_azimuth(ran):
    assert ran.status == 0, ran.err
    return max(ran.json["expected_u_deg"]["from_calibration"]["azimuth"][1:])


def test_the_stand_stated(run, turned):
    plain = run("calibrate", turned, "-o", "plain.json", "--json")
    assert "bench-stand-assumed" in [one["code"] for one in plain.json["findings"]]
    said = ["--level-sd-deg", 0.02, "--north-deg", 0, "--north-sd-deg", 0.02, "--dip-deg", 70, "--dip-sd-deg", 0.02]
    told = run("calibrate", turned, "-o", "told.json", *said, "--toolface-sd-deg", 0.1, "--json")
    assert not {one["code"] for one in told.json["findings"]} & {"bench-stand-assumed", "bench-stand-needed"}
    assert told.json["rig_sd_deg"][2] == pytest.approx(0.1)
    assert worst_azimuth(told) < 0.5 * worst_azimuth(plain)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--north-sd-deg", 0.1], "--north-sd-deg needs --north-deg"),
        (["--north-sd-deg", 91], "--north-sd-deg is 91; allowed: 0 .. 90"),
        (["--dip-deg", 91], "--dip-deg is 91; allowed: -90 .. 90"),
        (["--method", "rotations", "--dip-sd-deg", 0.1], "--dip-sd-deg does not apply to --method rotations"),
        (["--method", "field", "--north-deg", 1], "--north-deg does not apply to --method field"),
        (["--gyro-step", 1], "--gyro-step needs gyro"),
        (["--mag-step", -1], "--mag-step is -1; allowed: 0 .. "),
    ],
)
def test_refused(run, turned, options, words):
    run("calibrate", turned, "-o", "tool.json", *options).refused(words)


def test_plans(run):
    assert run("plan rotations -o turns.csv").status == 0
    assert run("plan twelve --rolls 4 --azimuths 5 -o more.csv").status == 0
    assert {row["inclination_deg"] for row in rows_of("turns.csv")} == {"30", "120"}
    rows = rows_of("more.csv")
    assert len(rows) == 4 + 5 * 4
    assert len({row["azimuth_deg"] for row in rows}) == 5
    run("plan orthogonal --azimuths 5 -o none.csv").refused("--azimuths does not apply to plan orthogonal")


@pytest.mark.long
@pytest.mark.parametrize("column", ["accel_1", "accel_x", "mag_1"])
@pytest.mark.parametrize("method", ["joint", "twelve"])
def test_one_sensor(run, tmp_path, column, method):
    """The paper's own case: the parametric vector and the zero signal of one elementary sensor."""
    plan, sensor = plans.twelve(), np.array([300.0, -400.0, 1200.0])
    field = [0.0, 0.0, 1.0] if column.startswith("accel") else [0.5, 0.0, np.sqrt(0.75)]
    signals = dcm(plan.azimuth, plan.inclination, plan.toolface) @ field @ sensor + 17.0
    dials = np.degrees([plan.azimuth, plan.inclination, plan.toolface]).T
    rows = [f"{a:g},{i:g},{t:g},{float(u)!r}" for (a, i, t), u in zip(dials, signals, strict=True)]
    head = f"azimuth_deg,inclination_deg,toolface_deg,{column}"
    (tmp_path / "one.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    run("calibrate one.csv -o one.json --method", method, "--report", "one.html").ok()
    triads = json.loads((tmp_path / "one.json").read_text(encoding="utf-8"))["triads"]
    (triad,) = triads.values()
    # exact readings: what is left is rounding of the sums, 1e-12 of full scale, and of the 12 digits printed
    assert triad["tensor"][0] == pytest.approx(sensor.tolist(), abs=1e-6)
    assert triad["offset"][0] == pytest.approx(17.0, abs=1e-6)


def test_positions_visited_twice_are_in_the_plan_and_say_what_they_buy(run):
    done = run("plan twelve --repeats 2 -o plan.csv").ok()
    assert "2 positions visited once more at the end: with them a zero that drifts shows from" in done.out
    assert run("simulate bench --plan plan.csv -o readings.csv").status == 0
    assert run("calibrate readings.csv --json").json["stations"] == 14
    run("plan twelve --repeats 3 -o other.csv").refused("repeats is 3; allowed: 0 .. 2")

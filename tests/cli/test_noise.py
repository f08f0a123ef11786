"""The noise commands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from inclinometry.cli.output import plain
from inclinometry.files.allan_json import read_allan

PLAN = {"latitude-deg": 60.0, "inclination-deg": 30.0, "arw-deg-sqrt-h": 0.005, "azimuth-deg": 0.2}


@pytest.fixture
def log(run):
    rng = np.random.default_rng(1)
    table = np.column_stack([0.1 * np.arange(2000), rng.standard_normal((2000, 4))])
    header = "time_s,gyro_x_deg_h,gyro_y_deg_h,accel_x_mg,accel_y_mg"
    np.savetxt("log.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    return "log.csv"


@pytest.fixture
def plan(run):
    """gyro plan as of `PLAN`, with other options."""
    return lambda *more, **change: run(
        "gyro", "plan", *(word for n, v in {**PLAN, **change}.items() for word in (f"--{n}", v)), *more
    )


@pytest.mark.long
def test_allan_writes_all_it_says(run, log):
    done = run("allan", log, "-o", "allan.json", "--report", "allan.html").ok()
    assert re.search(r"(?s)angle.*random.*walk,.*deg/√h", done.out)
    assert "4 channels written to allan.json, report to allan.html" in done.out
    assert len(read_allan("allan.json")["channels"]) == 4
    assert Path("allan.html").read_text(encoding="utf-8").startswith("<!doctype html>")


def test_allan_prints_what_it_writes(run, log):
    assert run("allan", log, "-o", "allan.json", "--json").ok().json == plain(read_allan("allan.json"))


def test_allan_refuses_before_it_writes(run, log):
    run("allan", log, "-o", log).refused("same file")
    Path("gap.csv").write_text("time_s,gyro_x,gyro_y\n0,1,2\n1,2,1\n2,1,1\n9,1,2\n")
    run("allan gap.csv -o allan.json").refused("gap.csv, line 5: ", "[input-uneven]")
    assert not Path("allan.json").exists()


def test_plan_all_round(plan):
    done = plan().ok()
    assert all(word in done.out for word in ("best", "median", "worst", "floor"))


def test_plan_of_one_azimuth_follows_the_level_law(plan):
    """0.1475 deg after 240 s: section 8 of the north-seeking theory, one gyro level at latitude 45."""
    change = {"latitude-deg": 45.0, "inclination-deg": 0.0, "azimuth-deg": 0.1475, "at-azimuth-deg": 30.0}
    found = plan("--json", **change, gyros=1, **{"move-s": 2.0}).ok().json["cases"]["as given"]
    # four digits of 0.1475
    assert found["time_s"] == pytest.approx(240.0, rel=1e-3)
    assert found["time_with_moves_s"] == pytest.approx(found["time_s"] + 6.0)
    assert found["azimuth_deg"] == 30.0


def test_the_impossible_is_said(plan):
    steep = {"inclination-deg": 80.0, "scale-sd-percent": 1.0}
    done = plan("--json", **steep).ok()
    assert done.json["cases"]["worst"]["time_s"] is None
    assert done.json["cases"]["best"]["time_s"] > 0.0
    assert "third gyro" in done.err
    assert "over a day" in plan(**steep).ok().out


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("latitude-deg", 95.0, "[input-value]"),
        ("latitude-deg", 90.0, "[input-value]"),
        ("inclination-deg", 200.0, "is 200"),
        ("arw-deg-sqrt-h", -0.1, "is -0.1"),
        ("arw-deg-sqrt-h", 0.0, "[input-value]"),
        ("azimuth-deg", 0.0, "[input-value]"),
        ("azimuth-deg", "nan", "is nan"),
        ("scale-sd-percent", -1.0, "--scale-sd-percent"),
        ("gyros", 3, "--gyros"),
        ("axes", 4, "--axes"),
        ("at-azimuth-deg", 400.0, "--at-azimuth-deg"),
        ("level-sd-deg", 11.0, "--level-sd-deg"),
    ],
)
def test_wrong_values_are_refused(plan, option, value, words):
    plan(**{option: value}).refused(words)

"""The noise commands, called as functions."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from inclinometry.cli.noise import allan, plan_gyro
from inclinometry.cli.output import plain
from inclinometry.errors import FileError, InputError
from inclinometry.files.allan_json import read_allan

PLAN = {"latitude_deg": 60.0, "inclination_deg": 30.0, "arw_deg_sqrt_h": 0.005, "azimuth_deg": 0.2}


@pytest.fixture
def log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    table = np.column_stack([0.1 * np.arange(2000), rng.standard_normal((2000, 4))])
    header = "time_s,gyro_x_deg_h,gyro_y_deg_h,accel_x_mg,accel_y_mg"
    np.savetxt("log.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    return Path("log.csv")


@pytest.mark.long
def test_allan_writes_all_it_says(log, capsys):
    allan(log, output_=Path("allan.json"), report=Path("allan.html"))
    out = capsys.readouterr().out
    assert "angle random walk, deg/√h" in out
    assert "4 channels written to allan.json, report to allan.html" in out
    assert len(read_allan("allan.json")["channels"]) == 4
    assert Path("allan.html").read_text(encoding="utf-8").startswith("<!doctype html>")


def test_allan_prints_what_it_writes(log, capsys):
    allan(log, output_=Path("allan.json"), json=True)
    assert json.loads(capsys.readouterr().out) == plain(read_allan("allan.json"))


def test_allan_refuses_before_it_writes(log):
    with pytest.raises(FileError, match="same file"):
        allan(log, output_=log)
    Path("gap.csv").write_text("time_s,gyro_x,gyro_y\n0,1,2\n1,2,1\n2,1,1\n9,1,2\n")
    with pytest.raises(FileError, match=r"gap.csv, line 5: time_s 9 is 7 s after"):
        allan(Path("gap.csv"), output_=Path("allan.json"))
    assert not Path("allan.json").exists()


def test_plan_all_round(capsys):
    plan_gyro(**PLAN)
    out = capsys.readouterr().out
    for word in ("best", "median", "worst", "floor"):
        assert word in out


def test_plan_of_one_azimuth_follows_the_level_law(capsys):
    """0.1475 deg after 240 s: section 8 of the north-seeking theory, one gyro level at latitude 45."""
    plan_gyro(
        latitude_deg=45.0, inclination_deg=0.0, arw_deg_sqrt_h=0.005, azimuth_deg=0.1475, at_azimuth_deg=30.0,
        gyros=1, move_s=2.0, json=True,
    )  # fmt: skip
    found = json.loads(capsys.readouterr().out)["cases"]["as given"]
    # four digits of 0.1475
    assert found["time_s"] == pytest.approx(240.0, rel=1e-3)
    assert found["time_with_moves_s"] == pytest.approx(found["time_s"] + 6.0)
    assert found["azimuth_deg"] == 30.0


def test_the_impossible_is_said(capsys):
    plan_gyro(**PLAN | {"inclination_deg": 80.0, "json": True, "scale_sd_percent": 1.0})
    done = capsys.readouterr()
    found = json.loads(done.out)
    assert found["cases"]["worst"]["time_s"] is None
    assert found["cases"]["best"]["time_s"] > 0.0
    assert "third gyro" in done.err
    plan_gyro(**PLAN | {"inclination_deg": 80.0, "scale_sd_percent": 1.0})
    assert "over a day" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"latitude_deg": 95.0}, "--latitude-deg is 95 degrees; allowed -90 to 90"),
        ({"latitude_deg": 90.0}, "at the pole there is no north"),
        ({"inclination_deg": 200.0}, "--inclination-deg is 200"),
        ({"arw_deg_sqrt_h": -0.1}, "--arw-deg-sqrt-h is -0.1"),
        ({"arw_deg_sqrt_h": 0.0}, "--arw-deg-sqrt-h is 0; give more"),
        ({"azimuth_deg": 0.0}, "--azimuth-deg is 0; give more"),
        ({"azimuth_deg": float("nan")}, "--azimuth-deg is nan"),
        ({"scale_sd_percent": -1.0}, "--scale-sd-percent"),
        ({"gyros": 3}, "gyros is 3"),
        ({"axes": 4}, "axes is 4"),
        ({"at_azimuth_deg": 400.0}, "--at-azimuth-deg"),
        ({"level_sd_deg": 11.0}, "--level-sd-deg"),
    ],
)
def test_wrong_values_are_refused(change, words, capsys):
    with pytest.raises(InputError, match=words):
        plan_gyro(**PLAN | change)
    assert capsys.readouterr().out == ""

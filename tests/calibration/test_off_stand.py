"""Readings off the stand: the errors they leave, their scatter, one that is wrong; files and commands."""

import json
from dataclasses import replace

import numpy as np
import pytest
from benchmarks import off_stand
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.off_stand import GRID, OffStand
from inclinometry.calibration.readings import BenchReadings
from inclinometry.cli import main
from inclinometry.files.bench_csv import read_bench, read_plan, write_bench, write_plan
from inclinometry.workflow.calibrate import Options, calibrate

CODES = {"bench-off-scatter", "bench-off-far"}


def readings(seed, scatter=30.0, fault=0.0):
    bench, plan = off_stand.Bench(np.random.default_rng(seed)), plans.twelve()
    run = bench.on_stand(plan)
    off = BenchReadings(bench.off_stand(plans.off_stand(), scatter, fault), station=[f"off {k}" for k in range(12)])
    dials = (plan.azimuth, plan.inclination, plan.toolface)
    return BenchReadings(run, *dials, reference={"dip": off_stand.DIP, "b": off_stand.FIELD}, off_stand=off)


@pytest.mark.long
def test_errors_on_a_magnetic_stand():
    """Twelve positions alone err by 0.16 to 0.3 deg here."""
    error, u = np.moveaxis(np.array([off_stand.one(30.0, 0.0, seed) for seed in range(20, 26)]), 1, 0)
    assert (np.sqrt(np.mean(error[:, 0, 1:] ** 2, axis=(0, 2))) < 0.085).all()
    assert np.sqrt(np.mean(error[:, 1, 3] ** 2)) < 0.025
    assert 0.88 < np.mean(np.abs(error) < 1.96 * u) < 0.99


def test_scatter_is_found_and_a_small_one_named():
    known = {"magnetometer": 30.0 / off_stand.FIELD}
    for scatter, stated, said in ((30.0, None, set()), (100.0, None, set()), (100.0, known, {"bench-off-scatter"})):
        found = calibrate_joint(readings(3, scatter), off_scatter=stated)
        assert {one.code for one in found.findings} & CODES == said
        if stated is None:
            assert 0.6 * scatter < found.off_scatter["magnetometer"] * off_stand.FIELD < 1.6 * scatter


def test_a_wrong_reading_is_named():
    (said,) = (one for one in calibrate_joint(readings(4, fault=900.0)).findings if one.code in CODES)
    assert said.code == "bench-off-far"
    assert str(said.values["station"]).startswith("off ")


def test_rows_are_derivatives():
    rng = np.random.default_rng(1)
    coefficients = {
        kind: np.concatenate([np.eye(3), np.zeros((3, 1))], axis=1)[None] + 0.05 * rng.normal(size=(1, 3, 4))
        for kind in ("accelerometer", "magnetometer")
    }
    columns = {"accelerometer": slice(0, 12), "magnetometer": slice(12, 24)}
    signals = {kind: rng.normal(size=(4, 3)) for kind in coefficients}
    apart = OffStand(signals, np.ones((4, 1)), np.array([g[0] for g in GRID]), np.ones(4))
    at = apart.linear(coefficients, columns, 24)
    for kind, place in columns.items():
        for k in range(12):
            step = np.zeros(12)
            step[k] = 1e-6
            moved = {**coefficients, kind: coefficients[kind] + step.reshape(1, 3, 4)}
            slope = (apart.linear(moved, columns, 24).off - at.off) / 1e-6
            np.testing.assert_allclose(at.rows[..., place.start + k], slope, atol=1e-4)


def test_files(tmp_path):
    run = readings(1)
    write_bench(run, tmp_path / "run.csv")
    back = read_bench(tmp_path / "run.csv")
    assert len(back) == 12
    assert len(back.off_stand) == 12
    np.testing.assert_array_equal(back.off_stand.channels["magnetometer"], run.off_stand.channels["magnetometer"])
    write_plan(replace(plans.twelve(), off_stand=plans.off_stand()), tmp_path / "plan.csv")
    plan = read_plan(tmp_path / "plan.csv")
    assert (len(plan), len(plan.off_stand)) == (12, 12)
    text = (tmp_path / "run.csv").read_text()
    for old, new, code in (("off,off 1", "of,off 1", "input-choice"), ("stand,1,0", "stand,1,", "table-empty")):
        assert old in text
        (tmp_path / "bad.csv").write_text(text.replace(old, new))
        with refused(code):
            read_bench(tmp_path / "bad.csv")


def test_commands(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for line in (
        "plan twelve --off-stand -o plan.csv",
        "simulate bench --plan plan.csv --off-stand-scatter-nT 60 -o run.csv",
        "calibrate run.csv --json",
    ):
        capsys.readouterr()
        with pytest.raises(SystemExit) as stopped:
            main(line.split())
        assert stopped.value.code == 0
    told = json.loads(capsys.readouterr().out)
    with refused("input-not-with"):
        calibrate(read_bench("run.csv"), "twelve", Options())
    assert told["off_stand"]["readings"] == 12
    assert 30.0 < told["off_stand"]["scatter_nT"] < 110.0
    assert "bench-off-stand" in {one["code"] for one in told["findings"]}

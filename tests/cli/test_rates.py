"""The command for rate tables: from a file of steps to a tool.json that a survey can use."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.rate_table import table_rates
from inclinometry.calibration.readings import BenchReadings
from inclinometry.cli.rates import table
from inclinometry.constants import EARTH_RATE
from inclinometry.errors import FileError, IdentifiabilityError, InputError
from inclinometry.files.bench_csv import write_raw_survey
from inclinometry.files.survey_csv import read_survey_csv
from inclinometry.files.tool_json import read_calibration, write_calibration
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.hole import simulate_survey
from inclinometry.simulate.tool import realistic_tool
from inclinometry.survey.reduce import reduce_survey
from inclinometry.tabular import axes

LATITUDE = np.radians(55.0)
DEG_H = np.radians(1.0 / 3600.0)
FOG = 0.03 * DEG_H
SENSITIVITY = 0.5 * DEG_H * np.random.default_rng(1).normal(size=(3, 3))
TOOL = realistic_tool(
    3,
    sensors={"accelerometer": 3, "magnetometer": 3, "gyro": 3},
    bits=None,
    noise={"accelerometer": 1e-3, "magnetometer": 10.0, "gyro": FOG},
)
MOUNTS = np.radians([[0, 0], [180, 0], [90, 0], [90, 90], [90, 180], [90, 270]])
SPEEDS = np.radians([-10.0, -2.0, 2.0, 10.0])


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "site.toml").write_text("latitude_deg = 55.0\n")
    return tmp_path


def write_steps(path, *, rate_unit=1.0, unit="rad_s", heat=None, speeds=SPEEDS, sensitivity=SENSITIVITY):
    """Steps of the tool's gyros; rates written in degrees times `rate_unit`."""
    inclination, toolface = np.repeat(MOUNTS, len(speeds), axis=0).T
    rate = np.tile(speeds, len(MOUNTS))
    gyro = TOOL.triads["gyro"]
    down = dcm(0.0 * rate, inclination, toolface)[..., 2]
    seen = gyro.signals(table_rates(inclination, toolface, rate, LATITUDE) / EARTH_RATE)
    seen = seen + down @ sensitivity.T + FOG * np.random.default_rng(2).normal(size=seen.shape)
    tail = f"_{unit}" if unit else ""
    names = ["station", "inclination_deg", "toolface_deg", "rate_deg_s", *(f"gyro_{a}{tail}" for a in axes(3))]
    columns = [
        np.arange(len(rate)),
        np.degrees(inclination),
        np.degrees(toolface),
        np.degrees(rate) * rate_unit,
        *seen.T,
    ]
    if heat is not None:
        names.append("temperature_degC")
        columns.append(np.broadcast_to(heat, rate.shape))
    rows = [",".join(repr(float(v)) for v in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([",".join(names), *rows]) + "\n")
    return path


def bench_tool(path):
    """A joint calibration of all three triads, the gyro's included."""
    plan = plans.orthogonal()
    run = simulate_bench(TOOL, Rig(latitude=LATITUDE), plan.azimuth, plan.inclination, plan.toolface, seed=1)
    readings = BenchReadings(
        run.signals, run.azimuth, run.inclination, run.toolface, units=run.units, reference=run.reference
    )
    write_calibration(calibrate_joint(readings, rig_sd=0.0, diagnose=False, name="SN 7"), path)
    return path


def survey_error(tool):
    """Largest azimuth error of a tool, rad, with its g-sensitivity in the readings."""
    random = np.random.default_rng(4)
    inclination, (azimuth, toolface) = random.uniform(0.3, 2.8, 50), random.uniform(0.0, 6.28, (2, 50))
    path = (10.0 * np.arange(50), inclination, azimuth, toolface)
    true = simulate_survey(TOOL, *path, dip=1.2, latitude=LATITUDE, noise={}, seed=1)
    down = dcm(azimuth, inclination, toolface)[..., 2]
    channels = {"accelerometer": true.signals["accelerometer"], "gyro": true.signals["gyro"] + down @ SENSITIVITY.T}
    found = reduce_survey(true.md, channels, tool)
    assert found.azimuth_reference == "true"
    return np.abs(wrap_signed(found.azimuth - true.azimuth)).max()


def made(**more):
    """The calibration that the command makes of steps.csv at site.toml."""
    table(Path("steps.csv"), site=Path("site.toml"), output_=Path("tool.json"), **more)
    return read_calibration("tool.json")


def test_the_gyro_of_a_tool_is_replaced(folder, capsys):
    write_steps(folder / "steps.csv")
    old = bench_tool(folder / "old.json")
    before, found = read_calibration(old), made(calibration=old, g_sensitivity=True)
    printed = capsys.readouterr()
    assert "scale, rad/s per deg/s" in printed.out
    assert "g-sensitivity, rad/s per g" in printed.out
    assert "is significant" in printed.err
    assert found.tool.name == "SN 7"
    for kind in ("accelerometer", "magnetometer"):
        np.testing.assert_array_equal(found.tool.triads[kind].tensor, before.tool.triads[kind].tensor)
        np.testing.assert_array_equal(found.tool.noise[kind], before.tool.noise[kind])
    # nothing ties the gyro to the rest, and the rest is as uncertain as it was
    np.testing.assert_array_equal(found.tool.covariance[:24, :24], before.tool.covariance[:24, :24])
    assert (found.tool.covariance[:24, 24:] == 0.0).all()
    assert (np.diagonal(found.tool.covariance)[24:] > 0.0).all()
    assert found.dip == before.dip
    assert set(found.inputs) == {"readings", "rate table", "tool"}
    assert any("g-sensitivity" in str(one) for one in found.findings)
    u = np.sqrt(np.diagonal(found.tool.covariance)[24:]).reshape(3, 4)
    true = TOOL.triads["gyro"]
    # twelve parameters within 4.5 of their own: exceeded by chance once in 10^4
    assert (np.abs(found.tool.triads["gyro"].tensor[0] - true.tensor[0]) < 4.5 * u[:, :3]).all()
    assert (np.abs(found.tool.triads["gyro"].offset[0] - true.offset[0]) < 4.5 * u[:, 3]).all()
    # 0.5 deg/h per g in 8.6 deg/h of horizontal Earth rate is degrees of azimuth, unless it is known
    assert np.degrees(survey_error(found.tool)) < 0.5
    ignorant = Tool("x", {**found.tool.triads, "gyro": Triad("gyro", true.tensor, true.offset)})
    assert np.degrees(survey_error(ignorant)) > 2.0


def test_without_a_tool_it_is_one_of_gyros_alone(folder, capsys):
    write_steps(folder / "steps.csv", heat=21.5)
    found = made(tool="SN 9", created="2024-05-01", json=True)
    printed = capsys.readouterr()
    content = json.loads(printed.out)
    assert content["tool"] == "SN 9"
    assert content["degrees_of_freedom"] == 3 * (24 - 4)
    assert content["g_sensitivity"] is None
    assert content["g_sensitivity_by_chance"] < 1e-6
    assert "[fit-g-needed]" in printed.err
    assert list(found.tool.triads) == ["gyro"]
    assert found.method == "rate-table"
    assert found.tool.temperature_range == (21.5, 21.5)
    assert found.residuals.values["gyro"].shape == (24, 3)


def test_temperatures_that_were_not_used_are_said(folder, capsys):
    write_steps(folder / "steps.csv", heat=np.tile([20.0, 20.0, 60.0, 60.0], len(MOUNTS)))
    assert any("2 temperatures" in str(one) for one in made().findings)
    assert made(temperature_degree=1).tool.triads["gyro"].degree == 1
    capsys.readouterr()


def test_temperatures_at_which_the_two_calibrations_hold(folder, capsys):
    old = read_calibration(bench_tool(folder / "old.json"))
    for span, heat, want, said in (((15.0, 30.0), 21.0, (21.0, 21.0), False), ((40.0, 60.0), 21.0, (40.0, 60.0), True)):
        tool = Tool("x", old.tool.triads, old.tool.covariance, old.tool.noise, span)
        write_calibration(type(old)(**{**old.__dict__, "tool": tool}), folder / "old.json")
        write_steps(folder / "steps.csv", heat=heat)
        found = made(calibration=folder / "old.json")
        assert found.tool.temperature_range == want
        assert any("the rest of the tool at" in str(one) for one in found.findings) is said
    capsys.readouterr()


def test_a_survey_takes_its_azimuth_from_the_gyro_where_asked(run, folder, monkeypatch):
    monkeypatch.chdir(folder)
    bench_tool(folder / "tool.json")
    path = (10.0 * np.arange(1, 6), np.full(5, 0.8), np.linspace(0.5, 4.0, 5), np.linspace(0.0, 5.0, 5))
    true = simulate_survey(TOOL, *path, dip=1.2, latitude=LATITUDE, declination=0.1, seed=1)
    write_raw_survey(folder / "raw.csv", true.md, true.signals)
    found = {}
    for name, more in {"magnetometer": (), "gyro": ("--azimuth-from", "gyro")}.items():
        run("survey raw.csv --calibration tool.json --site site.toml -o out.csv", *more).ok()
        found[name] = read_survey_csv("out.csv")
    assert set(found["magnetometer"]["azimuth_reference"]) == {"magnetic"}
    assert set(found["gyro"]["azimuth_reference"]) == {"true"}
    turned = wrap_signed(found["gyro"]["azimuth"] - found["magnetometer"]["azimuth"])
    # 0.03 deg/h in 8.6: half a degree of gyro azimuth, a tenth of it from the magnetometer
    np.testing.assert_allclose(turned, 0.1, atol=np.radians(3.0))
    assert run("survey raw.csv --calibration tool.json -o o.csv --azimuth-from sun").status == 2


SLOW = {"speeds": np.array([-0.5, 0.5]), "rate_unit": np.radians(1.0)}


@pytest.mark.parametrize(
    ("steps", "more", "error", "words"),
    [
        # whole degrees per second give themselves away; others by the scale factor the unit allows
        ({"rate_unit": np.radians(1.0)}, {}, InputError, "table-radians"),
        (SLOW, {}, InputError, "work-rate-scale"),
        ({"unit": "deg_s"}, {}, InputError, "work-rate-scale"),
        ({}, {"temperature_degree": 1}, InputError, "input-needs"),
        ({"heat": 20.0}, {"temperature_degree": 1}, IdentifiabilityError, "fit-few"),
        ({"speeds": np.array([0.1, 0.1])}, {"g_sensitivity": True}, IdentifiabilityError, "fit-undetermined"),
        ({}, {"site": "nowhere.toml"}, InputError, "input-missing"),
        ({}, {"output_": "steps.csv"}, FileError, "input-same-file"),
    ],
)
def test_wrong_input(folder, steps, more, error, words):
    write_steps(folder / "steps.csv", **steps)
    Path("nowhere.toml").write_text("declination_deg = 3.0\n")
    paths = {"site": Path(more.get("site", "site.toml")), "output_": Path(more.get("output_", "tool.json"))}
    with refused(words, error=error):
        table(Path("steps.csv"), **more | paths)
    assert not Path("tool.json").exists()


def test_rates_in_radians_where_only_the_earlier_calibration_tells(folder):
    write_steps(folder / "steps.csv", **SLOW, unit="")
    old = bench_tool(folder / "old.json")
    with refused("work-rate-scale"):
        made(calibration=old)
    assert not Path("tool.json").exists()

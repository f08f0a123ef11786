"""From columns to field vectors: units, calibrations, missing readings."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.files.run_file import RunBlock, open_run
from inclinometry.sensors import Tool, Triad
from inclinometry.workflow.dynamic_signals import Signals, temperature_findings

from ..refusals import refused

SITE = Site(g=9.8, b=50_000.0)
RNG = np.random.default_rng(5)


def opened(tmp_path, header, row):
    (tmp_path / "run.csv").write_text(f"{header}\n{row}\n")
    return open_run(tmp_path / "run.csv")


def calibration(**triads):
    names = {"accel": "accelerometer", "mag": "magnetometer", "gyro": "gyro"}
    tool = Tool("SN 7", {names[k]: triad for k, triad in triads.items()}, temperature_range=(10.0, 100.0))
    return Calibration(
        tool, "test", {}, {}, tool.parameter_names, tool.covariance, Rig(np.zeros(0), None, None, {}),
        Residuals((), {}, {}, np.zeros(0)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("unit", "size", "wanted"),
    [("", 9.8, 9.8), ("_m_s2", 9.8, 9.8), ("_g", 1.0, STANDARD_GRAVITY), ("_mg", 1000.0, STANDARD_GRAVITY)],
)
def test_units_of_acceleration(tmp_path, unit, size, wanted):
    run = opened(tmp_path, f"time_s,accel_x{unit},accel_y{unit},accel_z{unit}", f"0,0,0,{size}")
    found = Signals(run, SITE).fields(next(run.blocks()))
    assert found["accel"][0, 2] == pytest.approx(wanted, rel=1e-15)


def test_units_of_field_and_rate(tmp_path):
    names = [f"mag_{a}_uT" for a in "xyz"] + [f"gyro_{a}_deg_s" for a in "xyz"]
    run = opened(tmp_path, "time_s," + ",".join(names), "0,20,0,45,0,0,180")
    found = Signals(run, SITE).fields(next(run.blocks()))
    np.testing.assert_allclose(found["mag"], [[20e3, 0, 45e3]], rtol=1e-15)
    np.testing.assert_allclose(found["gyro"], [[0, 0, np.pi]], rtol=1e-15)


REFUSED = {
    "accel_x_V,accel_y_V,accel_z_V": "input-unit",
    "mag_x_deg_s,mag_y_deg_s,mag_z_deg_s": "input-unit",
    "accel_1,accel_2,accel_3": "input-axes",
    "accel_x,accel_y": "input-axes",
}


@pytest.mark.parametrize("names", REFUSED)
def test_columns_only_a_calibration_can_read(tmp_path, names):
    run = opened(tmp_path, f"time_s,{names}", "0" + ",1" * len(names.split(",")))
    with refused(REFUSED[names]):
        Signals(run, SITE)


@pytest.mark.parametrize(
    ("triad", "row", "code", "reading"),
    [
        ("accel", "0,0,0,1", "motion-size", 1.0),
        ("mag", "0,20,0,45", "motion-size", 49.24),
        ("gyro", "0,0,0,720", "motion-size", 6875.0),
        ("accel", "0,0,0,0", "motion-size", 0.0),
    ],
)
def test_values_in_another_unit_than_stated(tmp_path, triad, row, code, reading):
    run = opened(tmp_path, "time_s," + ",".join(f"{triad}_{axis}" for axis in "xyz"), row)
    with refused(code) as caught:
        Signals(run, SITE).fields(next(run.blocks()))
    values = caught.value.finding.values
    assert values["reading"] == pytest.approx(reading, rel=1e-3)


def test_a_calibrated_tool_of_four_skewed_sensors_and_temperature(tmp_path):
    """Signals by the tool's own equation come back as the field, whatever temperature, and NaN stays where it is."""
    triads = {
        "accel": Triad("accelerometer", [RNG.normal(size=(4, 3)), 1e-3 * RNG.normal(size=(4, 3))],
                       [RNG.normal(size=4), 1e-3 * RNG.normal(size=4)], "V", 9.81),
        "mag": Triad("magnetometer", [3.0 * np.eye(3), 1e-3 * RNG.normal(size=(3, 3))], [np.ones(3), np.zeros(3)]),
        "gyro": Triad("gyro", np.eye(3), np.zeros(3), "deg/h", g_sensitivity=RNG.normal(size=(3, 3))),
    }  # fmt: skip
    n = 50
    heat = RNG.uniform(10.0, 90.0, n)
    fields = {kind: RNG.normal(size=(n, 3)) for kind in ("accelerometer", "magnetometer", "gyro")}
    signals = {t.kind: t.signals(fields[t.kind], heat if t.degree else None) for t in triads.values()}
    signals["gyro"] = (
        signals["gyro"] + fields["accelerometer"] * 9.81 / STANDARD_GRAVITY @ triads["gyro"].g_sensitivity.T
    )
    signals["accelerometer"][3, 1] = np.nan
    names = [*(f"accel_{k}_V" for k in range(1, 5)), *(f"mag_{a}" for a in "xyz"), *(f"gyro_{a}_deg_h" for a in "xyz")]
    run = opened(tmp_path, "time_s," + ",".join(names) + ",temperature_degC", "0" + ",1" * 11)
    found = Signals(run, SITE, calibration(**triads)).fields(RunBlock(np.arange(n), signals, heat))
    # 1e-9: the normal equations of four random axes lose some digits of sixteen
    good = np.arange(n) != 3
    np.testing.assert_allclose(found["accel"][good], 9.81 * fields["accelerometer"][good], atol=1e-9)
    np.testing.assert_allclose(found["mag"], 50_000.0 * fields["magnetometer"], atol=1e-6)
    np.testing.assert_allclose(found["gyro"][good], EARTH_RATE * fields["gyro"][good], atol=1e-12)
    # a gyro whose gravity is not known has no reading either
    assert np.isnan(found["accel"][3]).all()
    assert np.isnan(found["gyro"][3]).all()


def test_temperature_holds_its_last_value(tmp_path):
    triad = Triad("magnetometer", [np.eye(3), 0.01 * np.eye(3)], np.zeros((2, 3)), reference_temperature=20.0)
    run = opened(tmp_path, "time_s,mag_x,mag_y,mag_z,temperature_degC", "0,1,1,1,20")
    signals = Signals(run, SITE, calibration(mag=triad))
    blocks = [[np.nan, 30.0, np.nan], [np.nan, 40.0]]
    found = [
        signals.fields(RunBlock(np.arange(len(t)), {"magnetometer": np.ones((len(t), 3))}, np.array(t))) for t in blocks
    ]
    np.testing.assert_allclose(found[0]["temperature"], [30.0] * 3)
    np.testing.assert_allclose(found[1]["temperature"], [30.0, 40.0])
    np.testing.assert_allclose(found[1]["mag"][:, 0], 50_000.0 / np.array([1.1, 1.2]))


def test_a_calibration_of_another_tool(tmp_path):
    run = opened(tmp_path, "time_s,mag_x_nT,mag_y_nT,mag_z_nT", "0,1,1,1")
    other = {
        "input-uncalibrated": calibration(accel=Triad("accelerometer", np.eye(3), np.zeros(3))),
        "input-channels": calibration(mag=Triad("magnetometer", np.ones((4, 3)) + np.eye(4, 3), np.zeros(4))),
        "input-plane": calibration(mag=Triad("magnetometer", np.diag([1.0, 1.0, 0.0]), np.zeros(3))),
        "input-temperature": calibration(mag=Triad("magnetometer", [np.eye(3)] * 2, np.zeros((2, 3)))),
    }
    for code, record in other.items():
        with refused(code):
            Signals(run, SITE, record)
    with refused("fit-units", kind="magnetometer", unit="nT", other="V"):
        Signals(run, SITE, calibration(mag=Triad("magnetometer", np.eye(3), np.zeros(3), "V")))
    with refused("input-strength"):
        Signals(run, Site(), calibration(mag=Triad("magnetometer", np.eye(3), np.zeros(3))))


def test_a_run_hotter_than_the_calibration():
    record = calibration(mag=Triad("magnetometer", np.eye(3), np.zeros(3)))
    assert temperature_findings((20.0, 90.0), record) == []
    (hot,) = temperature_findings((20.0, 140.0), record)
    assert hot.values == {"low_degC": 20.0, "high_degC": 140.0, "from_degC": 10.0, "to_degC": 100.0}
    assert temperature_findings((20.0, 140.0), None) == temperature_findings(None, record) == []


def test_single_values_that_are_no_readings_are_missing(tmp_path):
    run = opened(tmp_path, "time_s,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z", "0,0,0,9.8,20000,0,40000")
    accel, mag = np.tile([0.0, 0.0, 9.8], (400, 1)), np.tile([2e4, 0.0, 4e4], (400, 1))
    accel[50, 1], accel[60, 0], mag[70, 2] = 1e6, -999.25, -99999.0
    signals = Signals(run, SITE)
    found = signals.fields(RunBlock(np.arange(400.0), {"accelerometer": accel, "magnetometer": mag}, None))
    assert np.argwhere(np.isnan(found["accel"])).tolist() == [[50, 1], [60, 0]]
    assert np.argwhere(np.isnan(found["mag"])).tolist() == [[70, 2]]
    assert [(*one.values.values(), one.rows) for one in signals.out_of_range.findings()] == [
        ("accel_x", -999.25, 61, 1, (60,)),
        ("accel_y", 1e6, 51, 1, (50,)),
        ("mag_z", -99999.0, 71, 1, (70,)),
    ]
    # the next block counts on; many of them are no single values
    accel[:, 1] = 3000.0
    again = signals.fields(RunBlock(np.arange(400.0), {"accelerometer": accel, "magnetometer": mag}, None))
    assert np.isnan(again["accel"]).sum() == 1
    assert signals.out_of_range.findings()[0].values["count"] == 2

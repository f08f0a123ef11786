"""Logs for noise analysis: even sampling, units."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration.readings import LARGEST
from inclinometry.errors import FileError
from inclinometry.files.log_csv import read_even_log


def write(folder, time, header="time_s,gyro_x_deg_h,gyro_y_deg_h", values="1,2"):
    path = folder / "log.csv"
    path.write_text("\n".join([header, *(f"{t},{values}" for t in time)]) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "unit", "factor"),
    [
        ("gyro_x_deg_h,gyro_y_deg_h", "rad/s", np.pi / 180.0 / 3600.0),
        ("gyro_x_deg_s,gyro_y_deg_s", "rad/s", np.pi / 180.0),
        ("gyro_x_rad_s,gyro_y_rad_s", "rad/s", 1.0),
        ("gyro_x,gyro_y", "counts", 1.0),
        ("accel_1_mg,accel_2_mg", "m/s^2", 9.80665e-3),
        ("mag_x_uT,mag_y_uT", "nT", 1e3),
    ],
)
def test_units(tmp_path, header, unit, factor):
    log = read_even_log(write(tmp_path, [0.0, 0.5, 1.0, 1.5], f"time_s,{header}"))
    (kind,) = log.channels
    assert log.units[kind] == unit
    # a unit's factor is a product of two roundings at most
    np.testing.assert_allclose(log.channels[kind], factor * np.array([[1.0, 2.0]] * 4), rtol=1e-15)
    assert log.names[kind] == tuple("_".join(name.split("_")[:2]) for name in header.split(","))
    assert (log.dt, log.time[0], len(log)) == (0.5, 0.0, 4)


def test_stamps_rounded_to_milliseconds_pass(tmp_path):
    time = np.round(np.arange(1000) / 400.0, 3)
    assert read_even_log(write(tmp_path, time)).dt == pytest.approx(0.0025, rel=1e-3)


HUNDRED, NINE = np.arange(100.0), np.arange(9.0)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (HUNDRED + 3.0 * (HUNDRED >= 40), "input-uneven"),
        (HUNDRED + 0.7 * (HUNDRED == 7), "input-uneven"),
        (NINE + 0.51 * (NINE == 4), "input-uneven"),
        (np.concatenate([np.arange(500.0), 499.0 + np.arange(1, 500) * 1.02]), "input-uneven"),
        ([0.0, 1.0], "input-few rows"),
        ([0.0, 1.0, 1.0], "input-order"),
        ([0.0, 2.0, 1.0], "input-order"),
    ],
)
def test_times_that_are_not_even_are_named_with_their_line(tmp_path, time, words):
    with refused(words, error=FileError):
        read_even_log(write(tmp_path, time))


def test_three_samples_are_enough_and_half_an_interval_is_no_gap(tmp_path):
    log = read_even_log(write(tmp_path, [5.0, 5.5, 6.0]))
    assert (log.time[0], log.dt, len(log)) == (5.0, 0.5, 3)
    assert read_even_log(write(tmp_path, NINE + 0.5 * (NINE == 4))).dt == 1.0


def test_date_and_time_are_the_time_of_a_log(tmp_path):
    time = [f"2026-05-01T10:00:0{k / 2}" for k in range(4)]
    assert read_even_log(write(tmp_path, time, "time,gyro_x_deg_h,gyro_y_deg_h")).dt == 0.5


def test_the_largest_reading_is_allowed_and_the_first_beyond_it_is_named(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(f"time_s,gyro_x\n0,{LARGEST!r}\n1,0\n2,{-1.5 * LARGEST!r}\n3,{2.0 * LARGEST!r}\n")
    with refused("input-value", error=FileError, name="gyro_x"):
        read_even_log(path)

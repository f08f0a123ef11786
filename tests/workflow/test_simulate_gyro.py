"""Simulated gyro runs: what is written obeys the equations it claims to and is the same every time."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.earth.gravity import normal_gravity
from inclinometry.earth.rate import earth_rate
from inclinometry.files.gyro_csv import read_gyro_run
from inclinometry.rotations import dcm, rotation_z
from inclinometry.workflow.simulate_gyro import POSITIONS, gyro_run, write_gyro, write_gyro_truth

DEG_H = np.radians(1.0) / 3600.0
QUIET = {"arw": 0.0, "accelerometer_noise": 0.0}


@pytest.mark.long
@pytest.mark.parametrize("scheme", POSITIONS)
@pytest.mark.parametrize(("axes", "gyros"), [(2, 2), (3, 2), (2, 1)])
def test_without_noise_the_file_holds_the_fields_turned_by_the_index(tmp_path, scheme, axes, gyros):
    latitude, bias = np.radians(-33.0), 2.5 * DEG_H
    turned = {"scheme": scheme, "latitude": latitude, "bias": bias, "axes": axes, "gyros": gyros}
    run = gyro_run(4, stations=3, **turned, **QUIET)
    write_gyro(run, tmp_path / "raw.csv")
    read = read_gyro_run(tmp_path / "raw.csv")
    np.testing.assert_allclose(np.degrees(read.index), np.tile(POSITIONS[scheme], 3), atol=1e-9)
    count = 1 if gyros == 1 else axes
    for row, at in enumerate(read.station):
        # a second way: NED to tool, then the passive turn by the index, station by station
        turned = rotation_z(read.index[row]) @ dcm(run.azimuth[at], run.inclination[at], run.toolface[at])
        rate = turned @ earth_rate(latitude) / run.scale[at] + bias
        np.testing.assert_allclose(read.channels["gyro"][row] * DEG_H, rate[:count], atol=1e-12 * EARTH_RATE)
        down = normal_gravity(latitude, 0.0) * turned[:axes, 2]
        np.testing.assert_allclose(read.channels["accelerometer"][row], down, atol=1e-11)


def test_every_scheme_listens_equally_long():
    """The dwell is the station's: the noise of one reading grows with the root of the number of positions."""
    noise = {}
    for scheme, positions in POSITIONS.items():
        run = gyro_run(1, scenario="cool", stations=2, scheme=scheme, dwell=400.0)
        noise[scheme] = run.noise["gyro"] / np.sqrt(len(positions))
    # one formula, no randomness
    np.testing.assert_allclose(list(noise.values()), noise["four"], rtol=1e-12)


def test_hot_and_cool():
    hot = gyro_run(1, scenario="hot", stations=20)
    cool = gyro_run(1, scenario="cool", stations=20)
    assert np.ptp(hot.temperature) > 90.0
    assert np.ptp(hot.scale) > 0.0
    assert set(cool.temperature.tolist()) == {20.0}
    assert set(cool.scale.tolist()) == {1.0}
    np.testing.assert_array_equal(hot.inclination, cool.inclination)


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        run = gyro_run(seed, stations=4)
        write_gyro(run, tmp_path / f"{name}.csv")
        write_gyro_truth(run, seed, tmp_path / f"{name}.json")
    for ending in ("csv", "json"):
        first, same, other = ((tmp_path / f"{name}.{ending}").read_bytes() for name in "abc")
        assert first == same
        assert first != other
        assert b"\r" not in first


def test_a_spike_is_where_it_was_asked_for():
    clean = gyro_run(1, stations=4)
    hit = gyro_run(1, stations=4, spike=(2, 1, 5.0 * DEG_H))
    off = hit.gyro - clean.gyro
    assert np.argwhere(off).tolist() == [[2 * 4 + 1, 0]]
    assert off.max() == pytest.approx(5.0 * DEG_H, rel=1e-9)
    with refused("input-value", name="spike.station", value=4):
        gyro_run(1, stations=4, spike=(4, 0, 1.0))


def test_the_drift_is_that_of_the_request():
    rate = 3.0 * DEG_H / 3600.0
    run = gyro_run(1, stations=3, drift=rate, arw=0.0)
    still = gyro_run(1, stations=3, arw=0.0)
    np.testing.assert_allclose(run.gyro - still.gyro, np.outer(run.time, [rate, rate]), atol=1e-12 * EARTH_RATE)


def test_the_truth_is_what_was_simulated(tmp_path):
    run = gyro_run(7, stations=5, latitude=np.radians(60.0))
    write_gyro_truth(run, 7, tmp_path / "t.json")
    truth = json.loads((tmp_path / "t.json").read_text())
    assert truth["schema"] == "inclinometry/gyro-truth"
    assert (truth["seed"], truth["latitude_deg"]) == (7, pytest.approx(60.0, abs=1e-9))
    assert {len(column) for column in truth["stations"].values()} == {5}
    # printed to 1e-10 deg
    for name in ("inclination", "azimuth", "toolface"):
        np.testing.assert_allclose(np.radians(truth["stations"][f"{name}_deg"]), getattr(run, name), atol=2e-12)
    assert truth["stations"]["scale"] == run.scale.tolist()
    assert truth["stations"]["md_m"] == [30.0, 60.0, 90.0, 120.0, 150.0]


def test_requests_that_cannot_be():
    with refused("input-choice", name="scenario", value="warm", allowed=("hot", "cool")):
        gyro_run(1, scenario="warm")
    with refused("input-choice", name="scheme", value="six"):
        gyro_run(1, scheme="six")
    with refused("input-value", name="stations", value=1.0):
        gyro_run(1, stations=1)

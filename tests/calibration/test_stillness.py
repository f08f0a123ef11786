"""Still stations: nothing lost, nothing invented, whatever the units, rates, gaps and hands."""

from __future__ import annotations

import gzip
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import coded, fits, refused

from inclinometry.calibration.norm import calibrate_norm
from inclinometry.calibration.stillness import sd_of_mean, stations_from_log, still_intervals


def simulated(rng, rests, rate=100.0, noise=0.01, moves=2.0, start_moving=True, channels=3):
    """A log that goes from pose to pose by smooth turns with shaking; returns time, signals, [(start, stop)]."""
    level, parts, found, at = rng.normal(size=channels), [], [], 0
    for index, rest in enumerate(rests):
        if index or start_moving:
            n = int(moves * rate)
            s = np.linspace(0, 1, n)[:, None]
            target = rng.normal(size=channels)
            shake = 0.3 * rng.normal(size=(n, channels)) * np.sin(np.pi * s)
            parts.append(level + (target - level) * (3 * s**2 - 2 * s**3) + shake)
            level, at = target, at + n
        n = int(rest * rate)
        parts.append(np.tile(level, (n, 1)))
        found.append((at, at + n))
        at += n
    signals = np.concatenate(parts)
    return np.arange(len(signals)) / rate, signals + rng.normal(0, noise, signals.shape), found


def overlaps(pairs, truth):
    return [[(a, b) for a, b in pairs if a < stop and b > start] for start, stop in truth]


@pytest.mark.parametrize("rate", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("seed", range(3))
def test_every_rest_is_found_once_and_inside(rate, seed):
    rng = np.random.default_rng(seed)
    time, signals, truth = simulated(rng, rng.uniform(2.5, 8.0, 12), rate)
    found = still_intervals(time, signals)
    assert len(found) == len(truth)
    for (hit,), (start, stop) in zip(overlaps(found.pairs(), truth), truth, strict=True):
        # a quarter second of window on either side may go, and some samples of a slow start may come
        assert hit[0] >= start - 0.3 * rate
        assert hit[1] <= stop + 0.3 * rate
        assert hit[1] - hit[0] >= (stop - start) - 0.6 * rate


def test_short_rests_in_long_motion_without_initial_rest():
    rng = np.random.default_rng(5)
    time, signals, truth = simulated(rng, [2.0] * 5, moves=20.0)
    assert [len(h) for h in overlaps(still_intervals(time, signals).pairs(), truth)] == [1] * 5


def test_units_and_extra_channels_do_not_matter():
    rng = np.random.default_rng(6)
    time, signals, _ = simulated(rng, [4.0] * 6, channels=6)
    scaled = signals * [1e-6, 1.0, 1e6, 9.8, 5e4, 1.0] + [0, 1e3, 0, 0, -7e6, 0]
    assert still_intervals(time, signals).pairs() == still_intervals(time, scaled).pairs()
    idle = np.column_stack([signals, np.full(len(time), 7.0)])
    assert still_intervals(time, idle).pairs() == still_intervals(time, signals).pairs()


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_a_still_log_is_still_in_any_unit(unit):
    """Windows of five samples, whose quietest fiftieth, where the search starts, is a ninth of the noise."""
    noise = np.random.default_rng(0).normal(0.0, unit, (600, 3))
    assert still_intervals(np.arange(600.0), noise).pairs() == [(0, 600)]


def test_coarse_counts():
    """Noise well below one count: the rests are flat, and the rounding noise of a count takes the floor's place."""
    rng = np.random.default_rng(7)
    time, signals, truth = simulated(rng, [4.0] * 8, noise=0.002)
    found = still_intervals(time, np.round(signals / 0.05) * 0.05)
    assert [len(h) for h in overlaps(found.pairs(), truth)] == [1] * 8


def test_a_gap_in_time_parts_two_stations():
    rng = np.random.default_rng(8)
    signals = rng.normal(0, 0.01, (2000, 3))
    time = np.arange(2000) / 100.0 + np.where(np.arange(2000) >= 900, 60.0, 0.0)
    assert still_intervals(time, signals).pairs() == [(0, 900), (900, 2000)]


def test_a_knock_does_not_part_a_station_a_move_does():
    rng = np.random.default_rng(9)
    time = np.arange(4000) / 100.0
    signals = rng.normal(0, 0.01, (4000, 1)) + np.where(time > 30, 3.0, 0.0)[:, None]
    signals[1000:1010] += 1.0
    moved = signals.copy()
    moved[1010:] += 0.5
    assert len(still_intervals(time, signals)) == 2
    assert len(still_intervals(time, moved)) == 3


def test_too_short_and_creeping_are_reported():
    rng = np.random.default_rng(10)
    time, signals, truth = simulated(rng, [5.0, 1.1, 5.0, 5.0])
    found = still_intervals(time, signals, shortest=2.0)
    assert [len(h) for h in overlaps(found.pairs(), truth)] == [1, 0, 1, 1]
    assert any(fits(why, ["fit-rest-short"], {"least_s": 2.0}) for _, _, why in found.dropped)
    assert "fit-rest-short" in coded(found.findings)
    # a slow turn of 15 noise levels a second between two rests
    turn = np.concatenate([np.zeros(800), np.linspace(0, 1.2, 800), np.full(800, 1.2)])
    jolt = np.where(np.abs(np.arange(2400) - 800) < 30, 40.0, 0) * rng.normal(size=2400) * 0.1
    jolt += np.where(np.abs(np.arange(2400) - 1600) < 30, 40.0, 0) * rng.normal(size=2400) * 0.1
    creeping = still_intervals(np.arange(2400) / 100, (turn + jolt + rng.normal(0, 0.01, 2400))[:, None])
    assert len(creeping) == 2
    assert "fit-rest-turning" in coded(creeping.findings)


def test_xsens_all_poses_and_the_fit_within_one_sigma():
    """The 38 poses of the log without its initial rest being used, and imu_tk's parameters from their first second."""
    data = files("inclinometry.workflow").joinpath("demo_data", "xsens_mti", "xsens_acc.txt.gz").read_bytes()
    log = np.array(gzip.decompress(data).split(), dtype=float).reshape(-1, 4)
    readings, found = stations_from_log(log[:, 0], {"accelerometer": log[:, 1:]})
    assert len(readings) == 38
    assert fits(readings.findings[0], ["fit-still"], {"stations": 38})
    first = np.array([log[a : a + 100, 1:].mean(axis=0) for a, _ in found.pairs()])
    fit = calibrate_norm(first, 9.81744)
    sigma = fit.uncertainty
    assert np.all(np.abs(fit.bias - [33124.2, 33275.2, 32364.4]) < sigma["bias"])
    assert np.all(np.abs(1 / fit.scale - [414.459, 412.010, 414.649]) < sigma["conversion"])
    assert np.all(np.abs(fit.misalignment - [0.0033593, -0.00890639, 0.0213341]) < sigma["misalignment"])
    # whole poses are a different, longer average of poses that creep by up to a count: two of their smaller sigmas
    whole = calibrate_norm(readings.channels["accelerometer"], 9.81744)
    assert np.all(np.abs(whole.bias - [33124.2, 33275.2, 32364.4]) < 2 * whole.uncertainty["bias"])
    assert whole.rms < 0.00112


def test_rests_in_the_hand_are_stations_too():
    """MPU-9150: the hand trembles two hundred times more than a table; every pose of two seconds is still found."""
    path = Path(__file__).parents[1] / "reference" / "mpu9150" / "imu0.log.gz"
    log = np.array(gzip.decompress(path.read_bytes()).split(), float).reshape(-1, 6)
    readings, _ = stations_from_log(np.arange(len(log)) / 100, {"accelerometer": log[:, :3], "gyro": log[:, 3:]})
    assert len(readings) == 22
    fit = calibrate_norm(readings.channels["accelerometer"], 9.81)
    np.testing.assert_allclose(fit.bias, [0.1029, 0.0970, 0.3446], atol=3 * fit.uncertainty["bias"].max())


def test_station_values():
    rng = np.random.default_rng(11)
    time, signals, _ = simulated(rng, [10.0] * 5)
    warmth = 20.0 + time / 100.0
    readings, found = stations_from_log(
        time, {"accelerometer": signals}, temperature=warmth, units={"accelerometer": "V"}
    )
    (a, b) = found.pairs()[2]
    np.testing.assert_allclose(readings.channels["accelerometer"][2], signals[a:b].mean(axis=0))
    assert readings.temperature[2] == pytest.approx(warmth[a:b].mean())
    assert readings.count[2] == b - a
    assert readings.units["accelerometer"] == "V"
    # white noise of 0.01 over a thousand samples; ten block means tell it to a quarter
    np.testing.assert_allclose(readings.sd["accelerometer"], 0.01 / np.sqrt(1000), rtol=1.2)
    np.testing.assert_allclose(found.noise_sd, 0.01, rtol=0.05)


def test_sd_of_mean_sees_slow_noise():
    rng = np.random.default_rng(12)
    slow = np.repeat(rng.normal(size=(10, 1)), 50, axis=0)
    assert sd_of_mean(slow)[0] > 3 * slow.std() / np.sqrt(500)
    assert sd_of_mean(rng.normal(size=(10, 2))).shape == (2,)


@pytest.mark.long
def test_a_million_samples():
    rng = np.random.default_rng(13)
    signals = rng.normal(size=(1_000_000, 6))
    found = still_intervals(np.arange(1e6) / 100, signals)
    assert found.pairs() == [(0, 1_000_000)]


@pytest.mark.parametrize(
    ("time", "signals", "words"),
    [
        ([0.0, 1.0, 0.5, 2.0] * 30, np.zeros((120, 1)), "input-order"),
        (np.arange(5.0), np.zeros((5, 1)), "input-few samples"),
        (np.arange(500.0), np.zeros((500, 2)), "fit-signals-constant"),
        (np.arange(500.0), np.zeros((400, 2)), "input-shape channels"),
        (np.arange(1.0), np.zeros((1, 2)), "input-few samples"),
    ],
)
def test_bad_logs(time, signals, words):
    with refused(words):
        still_intervals(time, signals)


def test_a_log_of_gaps_and_a_log_without_rest():
    rng = np.random.default_rng(14)
    pieces = (np.arange(300) // 3) * 100.0 + (np.arange(300) % 3) * 0.01
    with refused("fit-log-gaps"):
        still_intervals(pieces, rng.normal(size=(300, 1)))
    with refused("fit-never-still"):
        stations_from_log(np.arange(300) / 100, {"gyro": rng.normal(size=(300, 3))}, shortest=10.0)
    with refused("input-choice", name="channels"):
        stations_from_log(np.arange(300) / 100, {"compass": rng.normal(size=(300, 3))})
    with refused("input-shape", name="accelerometer"):
        stations_from_log(np.arange(300) / 100, {"accelerometer": rng.normal(size=(299, 3))})

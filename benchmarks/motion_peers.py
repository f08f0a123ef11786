"""Attitude from gyro, accelerometer and magnetometer beside VQF, Madgwick, Mahony and Fusion: real motion and drilling.

    python -m benchmarks.motion_peers [--json] [--rounds 7] [--draws 3]

Real motion: three trials of BROAD (tests/reference/broad), scored as their authors score: root mean square of the
total, heading and inclination error over the samples in motion, nothing aligned. Filters as their authors set them: VQF
(vqf) as it comes; Madgwick beta 0.12 and Mahony Kp 0.74, Ki 0.0012 (ahrs), the best for all 39 trials as published
with the data; Fusion (imufusion) as in its example: gain 0.5, both rejections 10 deg, recovery after 5 s, gyro bias
removed by its own means. Speed: the longest trial eight times over, one core, medians of rounds that alternate between
the filters.

Drilling: the simulated scenarios at 200 Hz, 60 s, inclination and azimuth error after the first 10 s; the peers and the
filter of this package as they are for real motion, none told that it is in a hole. The truth is synthetic.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # figures are for one core

import ahrs
import imufusion
import numpy as np
import vqf

from benchmarks import broad
from benchmarks.broad import FOLDER, KNOWN, peer_readings, score, shipped
from inclinometry.motion.complementary.filter import complementary_attitude
from inclinometry.motion.complementary.offline.smoothed import complementary_smoothed
from inclinometry.motion.result import Samples
from inclinometry.rotations import (
    dcm_from_quaternion,
    quaternion_from_dcm,
    quaternion_multiply,
    wrap_signed,
)
from inclinometry.simulate.drilling import SCENARIOS, simulate_drilling

TRIALS = tuple(KNOWN)
WEST = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])  # north-west-up components to east-north-up
KINDS = ("total", "heading", "inclination")
SETTLED = 10.0
REPEATS = 8


def _first(force: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Sensor to north-west-up from the first sample: where Madgwick and Mahony start."""
    up = force[0]
    north = np.cross(np.cross(up, field[0]), up)
    rows = np.array([north, np.cross(up, north), up])
    return quaternion_from_dcm(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _madgwick(samples: Samples) -> np.ndarray:
    gyro, force, field = peer_readings(samples)
    found = ahrs.filters.Madgwick(
        gyr=gyro, acc=force, mag=field, Dt=samples.interval, gain=0.12, q0=_first(force, field)
    )
    return quaternion_multiply(WEST, found.Q)


def _mahony(samples: Samples) -> np.ndarray:
    gyro, force, field = peer_readings(samples)
    start = quaternion_multiply(WEST, _first(force, field))
    return ahrs.filters.Mahony(gyr=gyro, acc=force, mag=field, Dt=samples.interval, k_P=0.74, k_I=0.0012, q0=start).Q


def _fusion(samples: Samples) -> np.ndarray:
    rate = 1.0 / samples.interval
    settings, bias_settings = imufusion.AhrsSettings(), imufusion.BiasSettings()
    settings.sample_rate, settings.convention, settings.gain = rate, imufusion.CONVENTION_ENU, 0.5
    settings.gyroscope_range, settings.rejection_timeout = 2000.0, round(5.0 * rate)
    settings.acceleration_rejection, settings.magnetic_rejection = 10.0, 10.0
    bias_settings.sample_rate = rate
    peer, bias = imufusion.Ahrs(), imufusion.Bias()
    peer.set_settings(settings)
    bias.set_settings(bias_settings)
    gyros, forces, fields = peer_readings(samples)
    found = np.empty((len(gyros), 4))
    for row, (gyro, force, field) in enumerate(zip(np.degrees(gyros), forces / 9.81, fields, strict=True)):
        peer.update(bias.update(gyro), force, field)
        found[row] = peer.get_quaternion()
    return found


METHODS = broad.METHODS | {"Madgwick": _madgwick, "Mahony": _mahony, "Fusion": _fusion}


def real_motion() -> dict:
    """Errors of every trial and their mean."""
    table: dict = {}
    for name in TRIALS:
        trial = shipped(FOLDER / f"{name}.npz")
        found = {method: score(run(trial.samples), trial) for method, run in METHODS.items()}
        table[name] = {method: dict(zip(KINDS, errors, strict=True)) for method, errors in found.items()}
    table["mean"] = {
        method: {kind: float(np.mean([table[name][method][kind] for name in TRIALS])) for kind in errors}
        for method, errors in table[TRIALS[0]].items()
    }
    return table


def speed(rounds: int) -> dict:
    """Samples a second of the compiled filters, and ratios to VQF round by round."""
    one = shipped(FOLDER / f"{TRIALS[-1]}.npz").samples
    long = [np.tile(part, (REPEATS, 1)) for part in peer_readings(one)]
    gyro, force, field = long
    interval = one.interval
    samples = Samples(interval * np.arange(len(gyro)), interval, accel=-force, mag=1000.0 * field, gyro=gyro)
    calls: dict[str, Callable[[], object]] = {
        "VQF": lambda: vqf.VQF(interval).updateBatch(*long),
        "ours": lambda: complementary_attitude(samples),
        "VQF, offline": lambda: vqf.offlineVQF(*long, interval),
        "ours, offline": lambda: complementary_smoothed(samples),
    }
    rates: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds + 1):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            rates[name].append(len(samples) / (time.perf_counter() - start))

    def ratio(one: str, other: str) -> float:
        return statistics.median(a / b for a, b in zip(rates[one][1:], rates[other][1:], strict=True))

    return {
        "M samples/s": {name: statistics.median(values[1:]) / 1e6 for name, values in rates.items()},
        "times VQF": ratio("ours", "VQF"),
        "times VQF, offline": ratio("ours, offline", "VQF, offline"),
    }


def drilling(draws: int) -> dict:
    """Root mean square error of inclination and azimuth, deg, of every scenario and filter."""
    table: dict = {}
    for name in SCENARIOS:
        squares: dict[str, list] = {method: [] for method in METHODS}
        for seed in range(1, draws + 1):
            run = simulate_drilling(name, seed, duration=60.0)
            samples = Samples(run.time, run.interval, accel=run.accel, mag=run.mag, gyro=run.gyro)
            later = run.time > SETTLED
            for method, call in METHODS.items():
                tool = dcm_from_quaternion(call(samples)[later])[:, :, 2]  # its z axis: east, north, up
                inclination = np.arctan2(np.hypot(tool[:, 0], tool[:, 1]), -tool[:, 2])
                azimuth = wrap_signed(np.arctan2(tool[:, 0], tool[:, 1]) - run.truth.azimuth[later])
                squares[method].append(
                    [np.mean((inclination - run.truth.inclination[later]) ** 2), np.mean(azimuth**2)]
                )
        table[name] = {
            method: [float(v) for v in np.degrees(np.sqrt(np.mean(values, axis=0)))]
            for method, values in squares.items()
        }
    return table


def run(rounds: int = 7, draws: int = 3) -> dict:
    """All figures."""
    return {"broad": real_motion(), "speed": speed(rounds), "drilling": drilling(draws), "draws": draws}


def report(results: dict) -> None:
    """Print the tables."""
    print("BROAD, rms error in motion, deg: total / heading / inclination")
    for method in METHODS:
        cells = []
        for name in (*TRIALS, "mean"):
            cells.append(" / ".join(f"{value:5.2f}" for value in results["broad"][name][method].values()))
        print(f"  {method:14s} " + "   ".join(cells))
    for method in ("Madgwick", "Mahony"):
        rows = [KNOWN[name][method] for name in TRIALS]
        print(f"  {method + ', print':14s} " + "   ".join(" / ".join(f"{v:5.2f}" for v in row) for row in rows))
    print("speed, M samples/s: " + ", ".join(f"{k} {v:.2f}" for k, v in results["speed"]["M samples/s"].items()))
    print(f"  times VQF {results['speed']['times VQF']:.2f}, offline {results['speed']['times VQF, offline']:.2f}")
    print(f"drilling, {results['draws']} seeds, inclination / azimuth rms after {SETTLED:g} s, deg")
    for name, row in results["drilling"].items():
        print(f"  {name:14s} " + ", ".join(f"{method} {a:.3f} / {b:.3f}" for method, (a, b) in row.items()))


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--draws", type=int, default=3)
    options = parser.parse_args()
    results = run(options.rounds, options.draws)
    print(json.dumps(results, indent=1)) if options.json else report(results)


if __name__ == "__main__":
    main()

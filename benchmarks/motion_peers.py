"""Attitude from gyro, accelerometer and magnetometer beside VQF, Madgwick, Mahony and Fusion: real motion and drilling.

    python benchmarks/motion_peers.py [--json] [--rounds 7] [--draws 3]

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
from pathlib import Path

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # figures are for one core

import ahrs
import imufusion
import numpy as np
import vqf

from inclinometry.motion.complementary.filter import complementary_attitude
from inclinometry.motion.complementary.offline.smoothed import complementary_smoothed
from inclinometry.motion.result import Samples
from inclinometry.rotations import (
    dcm_from_quaternion,
    quaternion_conjugate,
    quaternion_from_dcm,
    quaternion_multiply,
    wrap_signed,
)
from inclinometry.simulate.drilling import SCENARIOS, simulate_drilling

FOLDER = Path(__file__).parents[1] / "tests" / "reference" / "broad"
TRIALS = ("02_undisturbed_slow_rotation_B", "16_undisturbed_fast_translation_B", "24_disturbed_tapping_A")
# published with the data for the best settings of all 39 trials: total, heading, inclination, deg
PUBLISHED = {
    "Madgwick": ((1.497, 1.264, 0.802), (4.825, 3.703, 3.094), (1.768, 1.243, 1.258)),
    "Mahony": ((2.966, 2.891, 0.664), (20.277, 17.672, 10.008), (2.146, 1.892, 1.013)),
}
HALF = np.sqrt(0.5)
ENU = np.array([0.0, HALF, HALF, 0.0])  # north-east-down components to east-north-up, and back
WEST = np.array([HALF, 0.0, 0.0, HALF])  # north-west-up components to east-north-up
SETTLED = 10.0
REPEATS = 8


class Motion:
    """Readings as the peers want them: rate in rad/s, specific force, field in uT; rows of three, contiguous."""

    def __init__(self, interval: float, gyro: np.ndarray, force: np.ndarray, field: np.ndarray) -> None:
        self.interval = interval
        self.gyro, self.force, self.field = (np.ascontiguousarray(part) for part in (gyro, force, field))

    def samples(self) -> Samples:
        """As this package wants them."""
        return Samples(
            self.interval * np.arange(len(self.gyro)), self.interval,
            accel=-self.force, mag=1000.0 * self.field, gyro=self.gyro,
        )  # fmt: skip


def load(name: str) -> tuple[Motion, np.ndarray, np.ndarray]:
    """Readings, true quaternions to east-north-up and which samples count."""
    with np.load(FOLDER / f"{name}.npz") as stored:
        whole = {part: np.cumsum(stored[part], axis=1).T for part in ("gyro", "specific_force", "field", "quaternion")}
        values = {part: whole[part] * stored[f"{part}_scale"] for part in whole}
        first, last = stored["movement"]
        interval = 1.0 / float(stored["sampling_rate"])
    counted = whole["quaternion"][:, 0] != -32768
    counted[:first], counted[last:] = False, False
    return Motion(interval, values["gyro"], values["specific_force"], values["field"]), values["quaternion"], counted


def score(found: np.ndarray, true: np.ndarray, counted: np.ndarray) -> dict[str, float]:
    """Root mean square errors, deg, as `calculateRMSE` of the publication."""
    true = true[counted] / np.linalg.norm(true[counted], axis=1, keepdims=True)
    w, x, y, z = quaternion_multiply(found[counted], quaternion_conjugate(true)).T
    errors = {
        "total": 2.0 * np.arccos(np.clip(np.abs(w), 0.0, 1.0)),
        "heading": 2.0 * np.arctan(np.abs(z / w)),
        "inclination": 2.0 * np.arcsin(np.clip(np.hypot(x, y), 0.0, 1.0)),
    }
    return {name: float(np.degrees(np.sqrt(np.mean(values**2)))) for name, values in errors.items()}


def _own(method: Callable) -> Callable[[Motion], np.ndarray]:
    return lambda motion: quaternion_multiply(ENU, quaternion_conjugate(method(motion.samples()).quaternion))


def _first(motion: Motion) -> np.ndarray:
    """Sensor to north-west-up from the first sample: where Madgwick and Mahony start."""
    up, field = motion.force[0], motion.field[0]
    north = np.cross(np.cross(up, field), up)
    rows = np.array([north, np.cross(up, north), up])
    return quaternion_from_dcm(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _madgwick(motion: Motion) -> np.ndarray:
    found = ahrs.filters.Madgwick(
        gyr=motion.gyro, acc=motion.force, mag=motion.field, Dt=motion.interval, gain=0.12, q0=_first(motion)
    )
    return quaternion_multiply(WEST, found.Q)


def _mahony(motion: Motion) -> np.ndarray:
    start = quaternion_multiply(WEST, _first(motion))
    return ahrs.filters.Mahony(
        gyr=motion.gyro, acc=motion.force, mag=motion.field, Dt=motion.interval, k_P=0.74, k_I=0.0012, q0=start
    ).Q


def _fusion(motion: Motion) -> np.ndarray:
    rate = 1.0 / motion.interval
    settings, bias_settings = imufusion.AhrsSettings(), imufusion.BiasSettings()
    settings.sample_rate, settings.convention, settings.gain = rate, imufusion.CONVENTION_ENU, 0.5
    settings.gyroscope_range, settings.rejection_timeout = 2000.0, round(5.0 * rate)
    settings.acceleration_rejection, settings.magnetic_rejection = 10.0, 10.0
    bias_settings.sample_rate = rate
    peer, bias = imufusion.Ahrs(), imufusion.Bias()
    peer.set_settings(settings)
    bias.set_settings(bias_settings)
    found = np.empty((len(motion.gyro), 4))
    rows = zip(np.degrees(motion.gyro), motion.force / 9.81, motion.field, strict=True)
    for row, (gyro, force, field) in enumerate(rows):
        peer.update(bias.update(gyro), force, field)
        found[row] = peer.get_quaternion()
    return found


METHODS: dict[str, Callable[[Motion], np.ndarray]] = {
    "ours": _own(complementary_attitude),
    "VQF": lambda m: vqf.VQF(m.interval).updateBatch(m.gyro, m.force, m.field)["quat9D"],
    "Madgwick": _madgwick,
    "Mahony": _mahony,
    "Fusion": _fusion,
    "ours, offline": _own(complementary_smoothed),
    "VQF, offline": lambda m: vqf.offlineVQF(m.gyro, m.force, m.field, m.interval)["quat9D"],
}


def real_motion() -> dict:
    """Errors of every trial and their mean."""
    table: dict = {}
    for name in TRIALS:
        motion, true, counted = load(name)
        table[name] = {method: score(run(motion), true, counted) for method, run in METHODS.items()}
    table["mean"] = {
        method: {kind: float(np.mean([table[name][method][kind] for name in TRIALS])) for kind in errors}
        for method, errors in table[TRIALS[0]].items()
    }
    return table


def speed(rounds: int) -> dict:
    """Samples a second of the compiled filters, and ratios to VQF round by round."""
    motion, _, _ = load(TRIALS[-1])
    long = Motion(motion.interval, *(np.tile(part, (REPEATS, 1)) for part in (motion.gyro, motion.force, motion.field)))
    samples = long.samples()
    calls: dict[str, Callable[[], object]] = {
        "VQF": lambda: vqf.VQF(long.interval).updateBatch(long.gyro, long.force, long.field),
        "ours": lambda: complementary_attitude(samples),
        "VQF, offline": lambda: vqf.offlineVQF(long.gyro, long.force, long.field, long.interval),
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
            motion = Motion(run.interval, run.gyro, -run.accel, run.mag / 1000.0)
            later = run.time > SETTLED
            for method, call in METHODS.items():
                tool = dcm_from_quaternion(call(motion)[later])[:, :, 2]  # its z axis: east, north, up
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
    for method, rows in PUBLISHED.items():
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

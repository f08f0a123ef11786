"""BROAD, real motion with an optical reference: rms errors of each trial beside those of VQF, Madgwick and Mahony.

    python -m benchmarks.broad [--trials FOLDER] [--plot broad.png] [--json]

Without --trials the three that come with the tests (tests/reference/broad). With it every .hdf5 of a folder, as the
authors publish them (Laidig, Caruso, Cereatti, Seel, Data 6 (7), 72, 2021, CC BY 4.0), read as `inclinometry dynamic`
reads them, through the shipped profile. Scored as the authors score: root mean square over the samples in motion,
nothing aligned. VQF runs where it is installed; otherwise what version 2.1.2 gave on the three trials stands there.
Madgwick and Mahony are as published with the data, with the settings that are best for all 39 trials.
--plot draws estimated and true angles of the last trial.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.files.profile import reading_with
from inclinometry.files.run_file import open_run
from inclinometry.motion.complementary.filter import complementary_attitude
from inclinometry.motion.complementary.offline.smoothed import complementary_smoothed
from inclinometry.motion.result import Attitude, Samples
from inclinometry.orientation import angles
from inclinometry.rotations import dcm_from_quaternion, quaternion_conjugate, quaternion_multiply
from inclinometry.workflow.dynamic_signals import Signals

try:
    import vqf
except ImportError:
    vqf = None

FOLDER = Path(__file__).parents[1] / "tests" / "reference" / "broad"
HALF = np.sqrt(0.5)
ENU = np.array([0.0, HALF, HALF, 0.0])  # north-east-down components to east-north-up, and back
# total, heading, inclination, deg: published with the data for the best settings of all 39 trials; VQF 2.1.2 by its own
# defaults, total alone
KNOWN = {
    "02_undisturbed_slow_rotation_B": {
        "VQF": (1.382,), "VQF, offline": (1.014,), "Madgwick": (1.497, 1.264, 0.802), "Mahony": (2.966, 2.891, 0.664),
    },
    "16_undisturbed_fast_translation_B": {
        "VQF": (0.742,), "VQF, offline": (0.576,), "Madgwick": (4.825, 3.703, 3.094),
        "Mahony": (20.277, 17.672, 10.008),
    },
    "24_disturbed_tapping_A": {
        "VQF": (1.546,), "VQF, offline": (1.160,), "Madgwick": (1.768, 1.243, 1.258), "Mahony": (2.146, 1.892, 1.013),
    },
}  # fmt: skip


def _own(method: Callable[[Samples], Attitude]) -> Callable[[Samples], Array]:
    return lambda samples: quaternion_multiply(ENU, quaternion_conjugate(method(samples).quaternion))


def peer_readings(samples: Samples) -> tuple[Array, Array, Array]:
    """Rate in rad/s, specific force and field in uT as other filters take them: rows of three, contiguous."""
    assert samples.gyro is not None and samples.accel is not None and samples.mag is not None  # noqa: PT018
    gyro, force, field = (np.ascontiguousarray(p) for p in (samples.gyro, -samples.accel, samples.mag / 1000.0))
    return gyro, force, field


METHODS: dict[str, Callable[[Samples], Array]] = {
    "ours": _own(complementary_attitude),
    "ours, offline": _own(complementary_smoothed),
}
"""Filter -> quaternions from the sensor to east-north-up; VQF where it is installed."""
if vqf is not None:
    METHODS["VQF"] = lambda s: vqf.VQF(s.interval).updateBatch(*peer_readings(s))["quat9D"]
    METHODS["VQF, offline"] = lambda s: vqf.offlineVQF(*peer_readings(s), s.interval)["quat9D"]


class Trial(NamedTuple):
    """samples, true quaternions from the sensor to east-north-up (n, 4), and which samples count."""

    samples: Samples
    true: Array
    counted: Array


def shipped(path: Path) -> Trial:
    """A trial of tests/reference/broad."""
    with np.load(path) as stored:
        whole = {part: np.cumsum(stored[part], axis=1).T for part in ("gyro", "specific_force", "field", "quaternion")}
        gyro, force, field, true = (whole[part] * stored[f"{part}_scale"] for part in whole)
        (first, last), interval = stored["movement"], 1.0 / float(stored["sampling_rate"])
    counted = whole["quaternion"][:, 0] != -32768
    counted[:first], counted[last:] = False, False
    time = interval * np.arange(len(gyro))
    return Trial(Samples(time, interval, accel=-force, mag=1000.0 * field, gyro=gyro), true, counted)


def published(path: Path) -> Trial:
    """A trial as its authors publish it."""
    import h5py

    with h5py.File(path) as file:
        true, moving = file["opt_quat"][:], file["movement"][:] > 0
    with reading_with("broad"):
        run = open_run(path)
        block = next(iter(run.blocks(10_000_000)))
        fields = Signals(run, Site()).fields(block)
    interval = float((block.time[-1] - block.time[0]) / (len(block.time) - 1))
    counted = moving & np.isfinite(true).all(axis=1)
    samples = Samples(block.time, interval, accel=-fields["accel"], mag=fields["mag"], gyro=fields["gyro"])
    return Trial(samples, true, counted)


def score(found: Array, trial: Trial) -> tuple[float, float, float]:
    """Root mean square of total, heading and inclination error, deg, of quaternions to east-north-up, as published."""
    true = trial.true[trial.counted]
    true = true / np.linalg.norm(true, axis=1, keepdims=True)
    w, x, y, z = quaternion_multiply(found[trial.counted], quaternion_conjugate(true)).T
    parts = (
        2.0 * np.arccos(np.clip(np.abs(w), 0.0, 1.0)),
        2.0 * np.arctan(np.abs(z / w)),
        2.0 * np.arcsin(np.clip(np.hypot(x, y), 0.0, 1.0)),
    )
    total, heading, inclination = (float(np.degrees(np.sqrt(np.mean(part**2)))) for part in parts)
    return total, heading, inclination


def load(path: Path) -> Trial:
    """A trial in either form."""
    return shipped(path) if path.suffix == ".npz" else published(path)


def errors_of(trial: Trial, name: str) -> dict[str, tuple[float, ...]]:
    """Errors of every filter on one trial; of those that are not installed what is known."""
    known = KNOWN.get(name, {})
    return known | {method: score(found(trial.samples), trial) for method, found in METHODS.items()}


def run(folder: Path = FOLDER, plot: Path | None = None) -> dict[str, Any]:
    """Errors of every trial of a folder, and their means."""
    paths = sorted(path for path in folder.iterdir() if path.suffix in (".npz", ".hdf5"))
    if not paths:
        raise SystemExit(f"{folder} has no trial (.hdf5 or .npz)")
    table: dict[str, Any] = {}
    for path in paths:
        trial = load(path)
        table[path.stem] = errors_of(trial, path.stem)
        if plot is not None and path == paths[-1]:
            draw(trial, complementary_attitude(trial.samples), path.stem, plot)
    names = [name for name in table[paths[0].stem] if all(name in errors for errors in table.values())]
    table["mean"] = {name: (float(np.mean([errors[name][0] for errors in table.values()])),) for name in names}
    return table


def draw(trial: Trial, found: Attitude, name: str, path: Path) -> None:
    """Estimated and true inclination, azimuth and toolface, and the error of the attitude with its uncertainty."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    true = np.full((len(trial.true), 3), np.nan)
    ned = quaternion_conjugate(quaternion_multiply(ENU, trial.true[trial.counted]))
    matrix = dcm_from_quaternion(ned)
    true[trial.counted] = np.degrees(np.stack(angles(matrix[:, :, 2], matrix[:, :, 0])[:3], axis=1))
    seen = np.degrees(np.stack(found.angles[:3], axis=1))
    u = np.degrees(np.stack(found.u[:3], axis=1))
    figure, axes = plt.subplots(6, 1, figsize=(10, 13), sharex=True, height_ratios=[2, 1] * 3, layout="constrained")
    time = trial.samples.time
    for k, title in enumerate(("inclination", "azimuth", "toolface")):
        axes[2 * k].plot(time, true[:, k], ".", markersize=1, color="0.5", label="cameras")
        axes[2 * k].plot(time, seen[:, k], ".", markersize=0.6, label="complementary")
        axes[2 * k].set_ylabel(f"{title}, deg")
        off = (seen[:, k] - true[:, k] + 180.0) % 360.0 - 180.0
        axes[2 * k + 1].fill_between(time, -2 * u[:, k], 2 * u[:, k], color="0.85", label="±2 u")
        axes[2 * k + 1].plot(time, off, ".", markersize=0.6)
        axes[2 * k + 1].set(ylabel="error", ylim=(-10, 10))
    axes[0].set_title(name.replace("_", " "))
    axes[0].legend(markerscale=8)
    axes[1].legend()
    axes[-1].set_xlabel("s")
    figure.savefig(path, dpi=80)
    plt.close(figure)


def report(results: dict[str, Any]) -> None:
    """Print the table."""
    print("BROAD, rms error in motion, deg: total / heading / inclination; where vqf is not installed its total alone")
    for trial, errors in results.items():
        print(trial.replace("_", " "))
        for name, values in errors.items():
            print(f"  {name:14s} " + " / ".join(f"{value:6.2f}" for value in values))


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=Path, default=FOLDER, metavar="FOLDER")
    parser.add_argument("--plot", type=Path, default=None)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    results = run(options.trials, options.plot)
    print(json.dumps(results, indent=1)) if options.json else report(results)


if __name__ == "__main__":
    main()

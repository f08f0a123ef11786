"""Robust and adaptive filtering of window attitudes, part by part; why raw vibrating samples must not be re-weighted.

    python -m benchmarks.motion_robust [--json] [--seeds 20]

Windows of 10 s of a hole that bends slowly; the truth is drawn here. Errors are root mean squares over seeds of the
angle between the true and the estimated direction of the hole, deg; "squared" is the mean of e' P^-1 e / 3 of the whole
attitude, 1 for an honest covariance.
"""

from __future__ import annotations

import argparse
import json
import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # figures are for one core

import numpy as np  # noqa: E402

from inclinometry.attitude.rotations import (  # noqa: E402
    dcm,
    dcm_from_quaternion,
    quaternion_from_dcm,
    rotation_exp,
    rotation_log,
)
from inclinometry.motion.result import METHODS, Attitude  # noqa: E402
from inclinometry.motion.robust import huber_weight, igg3_weight  # noqa: E402
from inclinometry.motion.window_filter import WindowFilterSettings, robust_filter  # noqa: E402
from inclinometry.motion.window_smoother import smooth_windows  # noqa: E402

WINDOWS, INTERVAL = 240, 10.0
TILT, TURN = float(np.radians(0.03)), float(np.radians(0.06))
"""Standard deviation of a window's tilt and of its azimuth: the 10 s figures of 5 g drilling."""
CASES = (
    "clean",
    "5 % outliers",
    "20 % outliers",
    "step of 1 deg",
    "slow build",
    "noise twice as stated",
    "refused run",
)
OFF = WindowFilterSettings(igg3=None, adaptive_three=None)


def variants() -> dict[str, WindowFilterSettings]:
    """Name -> settings: each part alone on the plain filter, then together."""
    plain = {"igg3": None, "adaptive_three": None}
    return {
        "plain": OFF,
        "Huber": WindowFilterSettings(**{**plain, "huber": 1.345}),
        "IGG-III": WindowFilterSettings(**{**plain, "igg3": (1.5, 4.0)}),
        "Yang three": WindowFilterSettings(**{**plain, "adaptive_three": (1.5, 5.0)}),
        "Yang two": WindowFilterSettings(**{**plain, "adaptive_two": 1.5}),
        "Sage-Husa": WindowFilterSettings(**{**plain, "forgetting": 0.97}),
        "tracking": WindowFilterSettings(**{**plain, "fading": 1.0}),
        "IGG-III + Yang two": WindowFilterSettings(adaptive_three=None, adaptive_two=1.5),
        "IGG-III + Yang three": WindowFilterSettings(),
        "... + Sage-Husa": WindowFilterSettings(forgetting=0.97),
        "... + tracking": WindowFilterSettings(fading=1.0),
    }


def hole(case: str, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Azimuth and inclination (k,), rad."""
    place = np.arange(WINDOWS) * INTERVAL
    inclination = np.radians(30.0) + 2e-6 * place * random.standard_normal()
    azimuth = np.radians(60.0) + 2e-6 * place * random.standard_normal()
    if case == "step of 1 deg":
        inclination = inclination + np.radians(1.0) * (place >= 0.5 * place[-1])
    if case == "slow build":
        inclination = inclination + 1e-5 * np.maximum(place - 600.0, 0.0)
    return azimuth, inclination


def windows(case: str, seed: int) -> tuple[Attitude, np.ndarray]:
    """Rows with the covariance they would state, and the true matrices (k, 3, 3)."""
    random = np.random.default_rng(seed)
    azimuth, inclination = hole(case, random)
    truth = dcm(azimuth, inclination, random.uniform(0.0, 2.0 * np.pi, WINDOWS))
    level = np.array([[TILT**2, 0, 0], [0, TILT**2, 0.5 * TILT * TURN], [0, 0.5 * TILT * TURN, TURN**2]])
    covariance = truth @ level @ np.swapaxes(truth, 1, 2)
    error = np.einsum("kij,kj->ki", truth @ np.linalg.cholesky(level), random.standard_normal((WINDOWS, 3)))
    scale = np.ones(WINDOWS)
    if case.endswith("outliers"):
        share = float(case.split()[0]) / 100.0
        scale = np.where(random.random(WINDOWS) < share, random.uniform(8.0, 40.0, WINDOWS), 1.0)
    if case == "noise twice as stated":
        scale = scale * 2.0
    matrix = rotation_exp(error * scale[:, None]) @ truth
    quaternion = quaternion_from_dcm(matrix)
    if case == "refused run":
        quaternion[100:130], covariance[100:130] = np.nan, np.nan
    return _rows(quaternion, covariance), truth


def _rows(quaternion: np.ndarray, covariance: np.ndarray) -> Attitude:
    size = len(quaternion)
    return Attitude(
        time=INTERVAL * np.arange(size),
        quaternion=quaternion,
        covariance=covariance,
        rate=np.full(size, 12.6),
        quality=np.ones(size),
        flags=np.zeros(size, dtype=np.uint32),
        method=np.full(size, METHODS.index("magnetic"), dtype=np.uint8),
        north="magnetic",
    )


def errors(found: Attitude, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle between the directions (k,), deg, and e' P^-1 e / 3 (k,)."""
    matrix = dcm_from_quaternion(found.quaternion)
    e = rotation_log(matrix @ np.swapaxes(truth, 1, 2))
    angle = np.degrees(np.linalg.norm(np.cross(matrix[:, 2], truth[:, 2]), axis=1))
    return angle, np.einsum("ki,kij,kj->k", e, np.linalg.inv(found.covariance), e) / 3.0


def compare(case: str, seeds: int) -> dict:
    """Every variant on one case: filter and smoother."""
    table: dict[str, dict] = {}
    drawn = [windows(case, seed) for seed in range(seeds)]
    for name, settings in variants().items():
        entry = {}
        for pass_name, call in (("filter", robust_filter), ("smoother", smooth_windows)):
            both = [errors(call(rows, settings), truth) for rows, truth in drawn]
            angle = np.array([each[0] for each in both])
            entry[pass_name] = {
                "rms_deg": float(np.sqrt(np.mean(angle**2))),
                "largest_deg": float(np.median(angle.max(axis=1))),
                "squared": float(np.mean([each[1] for each in both])),
            }
        table[name] = entry
    return table


def raw_samples(seeds: int) -> dict:
    """Inclination from raw vibrating samples in the hole's own frame, with and without re-weighting.

    Lateral vibration 15-200 Hz of 5 g rms and one shock of 20-50 g a second, 2 kHz, decimated to 200 Hz after an
    anti-aliasing filter, windows of 10 s: a shock has no net velocity, so its parts cancel in a plain mean; a weight that
    removes its peak leaves the rest.
    """
    from scipy import signal

    fast, slow, seconds, g = 2000.0, 200.0, 60, 9.81
    low = signal.firwin(81, 80.0, fs=fast)
    band = signal.butter(4, [15.0, 200.0], "bandpass", fs=fast, output="sos")
    tilt = {name: [] for name in ("mean", "Huber", "IGG-III")}
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        size = int(fast * seconds)
        lateral = signal.sosfiltfilt(band, random.standard_normal(size))
        lateral *= 5.0 * g / lateral.std()
        for second in range(seconds):
            at = int(fast * second + random.integers(0, int(fast) - 6))
            peak = random.uniform(20.0, 50.0) * g * np.cos(random.uniform(0.0, 2.0 * np.pi))
            lateral[at : at + 6] += peak * np.sin(2.0 * np.pi * (np.arange(6) + 0.5) / 6.0)
        across = signal.lfilter(low, 1.0, lateral)[:: int(fast / slow)] + g * np.sin(np.radians(30.0))
        for window in across.reshape(-1, int(10 * slow)):
            for name, value in weighted_means(window).items():
                tilt[name].append(np.degrees((value - g * 0.5) / (g * np.cos(np.radians(30.0)))))
    return {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in tilt.items()}


def weighted_means(values: np.ndarray) -> dict[str, float]:
    """Plain mean, and means re-weighted until they stand."""
    found = {"mean": float(values.mean())}
    for name, weight in (("Huber", huber_weight), ("IGG-III", igg3_weight)):
        centre = float(np.median(values))
        scale = 1.4826 * float(np.median(np.abs(values - centre)))
        for _ in range(20):
            w = weight((values - centre) / scale)
            centre = float(w @ values / w.sum())
        found[name] = centre
    return found


def run(seeds: int = 20) -> dict:
    """Everything this benchmark measures."""
    return {"windows": {case: compare(case, seeds) for case in CASES}, "raw_deg": raw_samples(6), "seeds": seeds}


def report(result: dict) -> None:
    """Print the tables."""
    print(
        f"direction of the hole, {WINDOWS} windows of {INTERVAL:g} s, {result['seeds']} seeds: rms deg (largest) square"
    )
    for case, table in result["windows"].items():
        print(f"  {case}")
        for name, entry in table.items():
            cells = [f"{p} {e['rms_deg']:.4f} ({e['largest_deg']:.3f}) {e['squared']:8.2f}" for p, e in entry.items()]
            print(f"    {name:22s} {'   '.join(cells)}")
    print("inclination from raw samples under 5 g and shocks, 10 s windows, rms deg")
    for name, value in result["raw_deg"].items():
        print(f"    {name:8s} {value:.4f}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of tables")
    parser.add_argument("--seeds", type=int, default=20, help="runs a case (default 20)")
    options = parser.parse_args()
    result = run(options.seeds)
    print(json.dumps(result, indent=1)) if options.json else report(result)


if __name__ == "__main__":
    main()

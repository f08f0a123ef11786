"""Robust and adaptive filtering of window attitudes, part by part; why raw vibrating samples must not be re-weighted.

    python -m benchmarks.motion_robust [--json] [--seeds 6]

Windows of 10 s of a hole that bends slowly; the truth is drawn here. Errors are root mean squares over seeds of the
angle between the true and the estimated direction of the hole, deg; "squared" is the mean of e' P^-1 e / 3 of the whole
attitude, 1 for an honest covariance.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks import command
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.motion.result import (
    BITS,
    METHODS,
    Attitude,
    Samples,
)
from inclinometry.motion.robust import huber_weight, igg3_weight
from inclinometry.motion.window_filter import WindowFilterSettings, robust_filter
from inclinometry.motion.window_smoother import smooth_windows
from inclinometry.rotations import (
    dcm,
    dcm_from_quaternion,
    quaternion_from_dcm,
    rotation_exp,
    rotation_log,
    wrap_signed,
)
from inclinometry.simulate.drilling import DrillingSimulation, simulate_drilling

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


def variants() -> dict[str, WindowFilterSettings]:
    """Name -> settings: each part alone on the plain filter, then together."""
    off = {"igg3": None, "adaptive_three": None, "forgetting": None}
    both = {"forgetting": None}
    return {
        "plain": WindowFilterSettings(**off),
        "Huber": WindowFilterSettings(**{**off, "huber": 1.345}),
        "IGG-III": WindowFilterSettings(**{**off, "igg3": (1.5, 4.0)}),
        "Yang two": WindowFilterSettings(**{**off, "adaptive_two": 1.5}),
        "Yang three": WindowFilterSettings(**{**off, "adaptive_three": (2.5, 5.0)}),
        "Sage-Husa": WindowFilterSettings(**{**off, "forgetting": 0.97}),
        "strong tracking": WindowFilterSettings(**{**off, "fading": 1.0}),
        "Huber + Yang three": WindowFilterSettings(**{**both, "igg3": None, "huber": 1.345}),
        "IGG-III + Yang three": WindowFilterSettings(**both),
        "... + Sage-Husa": WindowFilterSettings(),
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
    """Angle between the directions (k,), deg, and e' P^-1 e / 3 (k,), of the rows that are not flagged as a start."""
    settled = (found.flags & BITS["start"]) == 0
    matrix = dcm_from_quaternion(found.quaternion)
    e = rotation_log(matrix @ np.swapaxes(truth, 1, 2))
    angle = np.degrees(np.linalg.norm(np.cross(matrix[:, 2], truth[:, 2]), axis=1))
    return angle[settled], np.einsum("ki,kij,kj->k", e, np.linalg.inv(found.covariance), e)[settled] / 3.0


def compare(case: str, seeds: int) -> dict:
    """Every variant on one case: filter and smoother."""
    table: dict[str, dict] = {}
    drawn = [windows(case, seed) for seed in range(seeds)]
    for name, settings in variants().items():
        entry = {}
        for pass_name, call in (("filter", robust_filter), ("smoother", smooth_windows)):
            both = [errors(call(rows, settings), truth) for rows, truth in drawn]
            angle = np.concatenate([each[0] for each in both])
            entry[pass_name] = {
                "rms_deg": float(np.sqrt(np.mean(angle**2))),
                "largest_deg": float(np.median([each[0].max() for each in both])),
                "squared": float(np.mean(np.concatenate([each[1] for each in both]))),
            }
        table[name] = entry
    return table


def raw_samples(seeds: int) -> dict:
    """Inclination from raw vibrating samples, de-rotated by the true toolface, with and without re-weighting.

    Everything but the weights is ideal, so that they alone differ: vibration and shocks have no net velocity, their
    parts cancel in a Hann mean; a weight that takes off the peaks leaves what belonged to them.
    """
    table = {}
    for scenario in ("smooth", "vibration-5g", "stick-slip"):
        off: dict[str, list[float]] = {}
        for seed in range(seeds):
            for name, value in _raw_windows(simulate_drilling(scenario, seed, duration=60.0)):
                off.setdefault(name, []).append(value)
        table[scenario] = {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in off.items()}
    return table


def _raw_windows(sim: DrillingSimulation) -> Iterator[tuple[str, float]]:
    """Name of the mean and its error, deg, over windows of 10 s."""
    high = np.cos(sim.truth.toolface) * sim.accel[:, 0] - np.sin(sim.truth.toolface) * sim.accel[:, 1]
    size = round(10.0 / sim.interval)
    for start in range(0, len(high) - size + 1, size):
        inclination = sim.truth.inclination[start]
        for name, value in weighted_means(high[start : start + size]).items():
            error = -value - STANDARD_GRAVITY * np.sin(inclination)
            yield name, float(np.degrees(error / (STANDARD_GRAVITY * np.cos(inclination))))


def weighted_means(values: np.ndarray) -> dict[str, float]:
    """Plain and Hann means, and Hann means re-weighted until they stand."""
    hann = np.hanning(len(values))
    found = {"mean": float(values.mean()), "Hann mean": float(hann @ values / hann.sum())}
    for name, weight in (("Hann, Huber", huber_weight), ("Hann, IGG-III", igg3_weight)):
        centre = float(np.median(values))
        scale = 1.4826 * float(np.median(np.abs(values - centre)))
        for _ in range(20):
            w = hann * weight((values - centre) / scale)
            centre = float(w @ values / w.sum())
        found[name] = centre
    return found


def drilling(seeds: int) -> dict:
    """Windows of the magnetic method on simulated drilling in which a magnetised body is passed three times for 8 s.

    The body adds 3000 nT toward east; the windows touched by it know nothing of it unless their method flags them.
    """
    table: dict[str, dict] = {}
    for scenario in ("vibration-5g", "stick-slip"):
        off: dict[str, list[np.ndarray]] = {}
        for seed in range(seeds):
            rows = magnetic_attitude(_passing(simulate_drilling(scenario, seed, duration=300.0)))
            for name, found in (("windows", rows), ("filter", robust_filter(rows)), ("smoother", smooth_windows(rows))):
                good = ~found.refused
                turn = np.stack([found.angles.inclination - np.radians(30.0), found.angles.azimuth - np.radians(60.0)])
                off.setdefault(name, []).append(np.degrees(wrap_signed(turn[:, good])))
        table[scenario] = {
            name: [float(v) for v in np.sqrt(np.mean(np.square(np.hstack(parts)), axis=1))]
            for name, parts in off.items()
        }
    return table


def _passing(sim: DrillingSimulation) -> Samples:
    """The run with the body's field in its magnetometer."""
    east = dcm(sim.truth.azimuth, sim.truth.inclination, sim.truth.toolface)[:, :, 1]
    near = np.zeros(len(sim))
    for at in (70.0, 150.0, 230.0):
        near += 3000.0 * ((sim.time >= at) & (sim.time < at + 8.0))
    return Samples(sim.time, sim.interval, accel=sim.accel, mag=sim.mag + near[:, None] * east, gyro=sim.gyro)


def run(seeds: int = 6) -> dict:
    """Everything this benchmark measures."""
    return {
        "windows": {case: compare(case, seeds) for case in CASES},
        "raw_deg": raw_samples(seeds),
        "drilling_deg": drilling(2),
        "seeds": seeds,
    }


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
    print("inclination from raw vibrating samples, 10 s windows, true toolface, rms deg")
    for scenario, table in result["raw_deg"].items():
        print(f"    {scenario:14s} " + "   ".join(f"{name} {value:.4f}" for name, value in table.items()))

    print(
        "windows of the magnetic method, a magnetised body passed three times in 300 s: rms inclination, azimuth, deg"
    )
    for scenario, table in result["drilling_deg"].items():
        cells = (f"{name} {value[0]:.4f} {value[1]:.4f}" for name, value in table.items())
        print(f"    {scenario:14s} " + "   ".join(cells))


if __name__ == "__main__":
    command(__doc__, run, report)

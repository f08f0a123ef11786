"""Real measurements: what this project gets beside what others published.

    python -m benchmarks.real_data [--json] [--roll-test-file FILE.csv]

Xsens MTi log (Tedaldi, Pretto, Menegatti 2014), two MPU-9150 (Mikov, Reginya, Moschevikin 2020), four cave-survey
instruments (Underwood); the logs come with the project, their origins are in the ORIGIN.md beside them. The roll test
of an inclinometer channel (36 rolls of 10 degrees: angle_deg,counts) is read from a file of yours: its licence is not
known. The cave figures published are means over both ways round (either roll set held out); both are shown.
"""

from __future__ import annotations

import gzip
import json
import time
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks import command
from benchmarks.measure import laps
from inclinometry.calibration.field import calibrate_field
from inclinometry.calibration.norm import NormFit, calibrate_norm, unit
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.rollset import roll_harmonics
from inclinometry.calibration.stillness import stations_from_log, still_intervals

DATA = files("inclinometry.workflow").joinpath("demo_data")
MPU = Path(__file__).parents[1] / "tests" / "reference" / "mpu9150"
GRAVITY = 9.81744
IMU_TK_FIT_S = 0.54  # fitting time stated for imu_tk on this log
IMU_TK = {
    "bias, counts": (33124.2, 33275.2, 32364.4),
    "1/scale, counts/(m/s2)": (414.459, 412.010, 414.649),
    "misalignment, rad": (0.0033593, -0.00890639, 0.0213341),
    "cost": (0.120131,),
    "pose-mean rms, m/s2": (0.00112,),
}
MPU_RMS = {"imu0": (0.213, 0.055), "imu1": (0.233, 0.054)}
# spread of the tool axis and scatter of the dip, deg: best of the peer's three methods, and a plain joint least squares
CAVE = {
    "BB": {"peer": (0.633, 0.25), "plain": (0.719, 0.20), "allowed": 0.72},
    "CF": {"peer": (0.422, 0.27), "plain": (0.521, 0.22), "allowed": 0.53},
    "FG": {"peer": (1.193, 0.34), "plain": (1.193, 0.22), "allowed": 1.20},
    "HC": {"peer": (0.286, 0.44), "plain": (0.260, 0.13), "allowed": 0.27},
}
ROLL_TEST = {
    "offset": -12.19,
    "amplitude": 10003.17,
    "phase_deg": 176.516,
    "residual_rms": 4.98,
    "residual_max": 15.27,
    "second_harmonic": 6.0,
}


def table_of(source: bytes, columns: int) -> np.ndarray:
    """Numbers of a compressed log."""
    return np.array(gzip.decompress(source).split(), dtype=float).reshape(-1, columns)


def poses_like_imu_tk(t: np.ndarray, x: np.ndarray) -> list[tuple[int, int]]:
    """Norm of the variances over 101 samples below 6 x that of the first 50 s, for 100 samples or more."""
    window = np.lib.stride_tricks.sliding_window_view(x - x.mean(axis=0), 101, axis=0)
    moving = np.linalg.norm(window.var(axis=-1, ddof=1), axis=1)
    limit = 6.0 * np.linalg.norm(x[: np.searchsorted(t, t[0] + 50.0)].var(axis=0, ddof=1))
    still = np.concatenate([[False], moving < limit, [False]])
    edges = np.flatnonzero(still[1:] != still[:-1]).reshape(-1, 2) + 50
    return [(int(a), int(b)) for a, b in edges if b - a >= 100]


def figures_of(fit: NormFit) -> dict[str, list[float]]:
    """The parameters as imu_tk prints them."""
    return {
        "bias, counts": fit.bias.tolist(),
        "1/scale, counts/(m/s2)": (1.0 / fit.scale).tolist(),
        "misalignment, rad": fit.misalignment.tolist(),
        "cost": [fit.cost],
    }


def in_sigmas(fit: NormFit) -> float:
    """Largest distance from imu_tk's parameters, in standard uncertainties of `fit`."""
    u = fit.uncertainty
    pairs = (
        (fit.bias, "bias, counts", u["bias"]),
        (1.0 / fit.scale, "1/scale, counts/(m/s2)", u["conversion"]),
        (fit.misalignment, "misalignment, rad", u["misalignment"]),
    )
    return float(max(np.max(np.abs(value - IMU_TK[name]) / sd) for value, name, sd in pairs))


def xsens() -> dict:
    """The fit with imu_tk's own detector, and with the detector of the project."""
    log = table_of((DATA / "xsens_mti" / "xsens_acc.txt.gz").read_bytes(), 4)
    t, x = log[:, 0], log[:, 1:]
    poses = poses_like_imu_tk(t, x)
    samples = np.concatenate([x[a : a + 100] for a, _ in poses])
    fit = calibrate_norm(samples, GRAVITY)
    means = np.linalg.norm(fit.field(np.array([x[a:b].mean(axis=0) for a, b in poses])), axis=1) - GRAVITY
    ours = {**figures_of(fit), "pose-mean rms, m/s2": [float(np.sqrt(np.mean(means**2)))]}
    seconds = min(laps(lambda: calibrate_norm(samples, GRAVITY), 15))
    readings, found = stations_from_log(t, {"accelerometer": x})
    first = calibrate_norm(np.array([x[a : a + 100].mean(axis=0) for a, _ in found.pairs()]), GRAVITY)
    whole = calibrate_norm(readings.channels["accelerometer"], GRAVITY)
    return {
        "poses": len(poses),
        "ours": ours,
        "published": {k: list(v) for k, v in IMU_TK.items()},
        "fit_s": seconds,
        "published_fit_s": IMU_TK_FIT_S,
        "ratio": seconds / IMU_TK_FIT_S,
        "own_detector": {
            "poses": len(readings),
            "seconds": min(laps(lambda: still_intervals(t, x), 3)),
            "sigmas_first_100_samples": in_sigmas(first),
            "sigmas_whole_poses": in_sigmas(whole),
            "whole_pose_rms": whole.rms,
        },
    }


def standstill(rate: np.ndarray) -> np.ndarray:
    """Samples with 60 quiet ones (below 0.13 rad/s) before and after, as the authors of the logs select them."""
    quiet, count = np.zeros(len(rate), dtype=bool), 60
    for i, calm in enumerate(rate < 0.13):
        if calm:
            count += 1
            quiet[i] = count > 60
        else:
            quiet[i - 60 : i + 1] = False
            count = 0
    return quiet


def mpu9150(name: str) -> dict:
    """S, NO, B of raw = M a + B as the authors print them."""
    log = table_of((MPU / f"{name}.log.gz").read_bytes(), 6)
    printed = (MPU / f"their_run_{name}.txt").read_text(encoding="utf-8").splitlines()
    published = np.array(printed[2].strip("[] ").split(), dtype=float)
    samples = log[standstill(np.linalg.norm(log[:, 3:], axis=1)), :3]
    fit = calibrate_norm(samples, 9.81, robust=False)
    m = np.linalg.inv(fit.inverse)
    ours = np.array([m[0, 0] - 1, m[1, 1] - 1, m[2, 2] - 1, m[1, 2], m[0, 1], m[0, 2], *fit.bias])
    before = float(np.sqrt(np.mean((np.linalg.norm(samples, axis=1) - 9.81) ** 2)))
    return {
        "ours": ours.tolist(),
        "published": published.tolist(),
        "largest_difference": float(np.max(np.abs(ours - published))),
        "rms": [before, fit.rms],
        "published_rms": list(MPU_RMS[name]),
        "fit_s": min(laps(lambda: calibrate_norm(samples, 9.81, robust=False), 15)),
        "published_fit_s": float(printed[0].split(":")[1].split()[0]),
    }


def cave_shots(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Accelerometer and magnetometer in tool axes: the instrument's Z, X, Y become x, y, z."""
    raw = json.loads((DATA / "sap6_cave" / f"{name}.json").read_text(encoding="utf-8"))
    mag, grav = np.array(raw["mag"]) * [1, 1, -1], np.array(raw["grav"])
    grav = np.column_stack([-grav[:, 1], -grav[:, 0], grav[:, 2]])
    return grav[:, [2, 0, 1]], mag[:, [2, 0, 1]]


def held_out(name: str, train: np.ndarray, test: np.ndarray) -> dict:
    """Calibrate on `train` (8 free shots, 8 rolls), score on `test` (8 rolls at another target)."""
    grav, mag = cave_shots(name)
    readings = BenchReadings(
        {"accelerometer": grav[train], "magnetometer": mag[train]},
        roll_set=[""] * 8 + ["1"] * 8,
        station=[f"shot {i}" for i in train],
    )
    begin = time.perf_counter()
    calibration = calibrate_field(readings)
    seconds = time.perf_counter() - begin
    down, b = (
        v / np.linalg.norm(v, axis=1, keepdims=True)
        for v in (
            calibration.tool.triads["accelerometer"].field(grav[test]),
            calibration.tool.triads["magnetometer"].field(mag[test]),
        )
    )
    east = np.cross(down, b)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    axis = np.column_stack([np.cross(east, down)[:, 2], east[:, 2], down[:, 2]])
    mean = axis.mean(axis=0) / np.linalg.norm(axis.mean(axis=0))
    apart = np.degrees(np.arctan2(np.linalg.norm(np.cross(axis, mean), axis=1), axis @ mean))
    return {
        "spread_deg": float(np.sqrt(np.mean(apart**2))),
        "dip_sd_deg": float(np.degrees(np.arcsin(np.sum(down * b, axis=1))).std()),
        "pointing_deg": float(np.degrees(calibration.rig.nuisance["pointing"][0])),
        "warnings": list(map(str, calibration.findings)),
        "seconds": seconds,
    }


def cave(name: str) -> dict:
    """Shots 0-15 against the second roll set, the other way round, and the mean of both."""
    free, one, two = np.arange(8), np.arange(8, 16), np.arange(16, 24)
    forth, back = held_out(name, np.r_[free, one], two), held_out(name, np.r_[free, two], one)
    both = {key: (forth[key] + back[key]) / 2.0 for key in ("spread_deg", "dip_sd_deg")}
    return {"first_to_second": forth, "second_to_first": back, "mean": both, **CAVE[name]}


def roll_test(path: Path) -> dict:
    """The harmonics of a real roll."""
    angle, counts = np.loadtxt(path, delimiter=",", skiprows=1).T
    fit = roll_harmonics(np.radians(angle), counts)
    ours = {
        "offset": fit.offset,
        "amplitude": fit.amplitude,
        "phase_deg": float(np.degrees(fit.phase)),
        "residual_rms": fit.residual_rms,
        "residual_max": fit.residual_max,
        "second_harmonic": fit.second_amplitude,
    }
    return {"ours": ours, "published": ROLL_TEST}


NORM = ((60, 0), (60, 1), (60, 5), (24, 0))


def norm_outliers(outliers: int, poses: int = 60, runs: int = 100) -> dict:
    """Error of the length of the field at other attitudes, %: as called, by least squares; runs that are warned of."""
    squares = np.zeros(2)
    warned = 0
    for number in range(runs):
        rng = np.random.default_rng([number, poses, outliers])
        signals = 5e4 * unit(rng.normal(size=(poses, 3)))
        tensor, offset = np.eye(3) + 0.05 * rng.normal(size=(3, 3)), 3000.0 * rng.normal(size=3)
        signals = signals @ tensor.T + offset + 50.0 * rng.normal(size=(poses, 3))
        signals[rng.choice(poses, outliers, replace=False)] += 1500.0 * rng.normal(size=(outliers, 3))
        other = 5e4 * unit(rng.normal(size=(500, 3))) @ tensor.T + offset
        fits = [calibrate_norm(signals, 5e4, kind="magnetometer", robust=robust) for robust in (True, False)]
        squares += [np.mean((np.linalg.norm(fit.field(other), axis=1) / 5e4 - 1.0) ** 2) for fit in fits]
        warned += bool(fits[0].findings)
    robust, plain = (100.0 * np.sqrt(squares / runs)).tolist()
    return {"robust_percent": robust, "least_squares_percent": plain, "warned": warned / runs}


def run(roll_test_file: str | None = None) -> dict:
    """Everything, as one record."""
    result = {
        "xsens": xsens(),
        "mpu9150": {name: mpu9150(name) for name in MPU_RMS},
        "cave": {name: cave(name) for name in CAVE},
        "norm": {f"{poses} poses, {count} outliers": norm_outliers(count, poses) for poses, count in NORM},
    }
    if roll_test_file is not None:
        result["roll_test"] = roll_test(Path(roll_test_file))
    return result


def report(result: dict) -> None:
    """One table: quantity, ours, published."""
    x = result["xsens"]
    print(f"{'quantity':44s} {'ours':>36s} {'published':>36s}")

    def row(name: str, ours, published) -> None:
        print(f"{name:44s} {ours:>36s} {published:>36s}")

    def join(values, digits: int = 6) -> str:
        return " ".join(f"{v:.{digits}g}" for v in values)

    row("Xsens: poses, imu_tk's detector", str(x["poses"]), "38")
    for name, published in x["published"].items():
        row(f"Xsens: {name}", join(x["ours"][name]), join(published))
    row("Xsens: fitting, s", f"{x['fit_s']:.4f}", f"{x['published_fit_s']} (ratio {x['ratio']:.3f}, allowed 0.1)")
    own = x["own_detector"]
    row("Xsens: poses, our detector", f"{own['poses']} in {own['seconds']:.3f} s", "38")
    row("   same cost: largest distance, sigmas", f"{own['sigmas_first_100_samples']:.2f}", "within 1")
    row("   whole poses: largest distance, sigmas", f"{own['sigmas_whole_poses']:.2f}", "(poses creep)")
    for name, m in result["mpu9150"].items():
        for part, values in (("S", slice(0, 3)), ("NO", slice(3, 6)), ("B", slice(6, 9))):
            ours, published = (" ".join(f"{v:.4f}" for v in m[k][values]) for k in ("ours", "published"))
            row(f"MPU-9150 {name}: {part}", ours, published)
        row(f"MPU-9150 {name}: rms before, after, m/s2", join(m["rms"], 3), join(m["published_rms"], 3))
        row(f"MPU-9150 {name}: fitting, s", f"{m['fit_s']:.4f}", f"{m['published_fit_s']:.2f}")
    for name, n in result["norm"].items():
        row(f"norm, {name}: error %, warned", f"{n['robust_percent']:.3f}, {n['warned']:.2f}",
            f"least squares {n['least_squares_percent']:.3f}")  # fmt: skip
    for name, c in result["cave"].items():
        forth = c["first_to_second"]
        published = f"peer {c['peer'][0]} plain {c['plain'][0]} allowed {c['allowed']}"
        row(f"cave {name}: spread, shots 0-15 -> 16-23, deg", f"{forth['spread_deg']:.3f}", published)
        row(f"cave {name}: spread, mean of both ways, deg", f"{c['mean']['spread_deg']:.3f}", published)
        dips = f"{forth['dip_sd_deg']:.2f}, both ways {c['mean']['dip_sd_deg']:.2f}"
        row(f"cave {name}: dip scatter, deg", dips, f"peer {c['peer'][1]} plain {c['plain'][1]}")
        for warning in forth["warnings"]:
            print(f"   {warning}")
    for name, ours in result.get("roll_test", {"ours": {}})["ours"].items():
        row(f"roll test: {name}", f"{ours:.6g}", f"{result['roll_test']['published'][name]:.6g}")


if __name__ == "__main__":
    command(__doc__, run, report)

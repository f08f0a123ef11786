"""Attitude while drilling: every method on the named scenarios, against the truth and the reference figures.

    python -m benchmarks.motion [--json] [--draws 5]

Runs of 60 s at 200 Hz, `--draws` seeds of each scenario; the error is the rms over windows and seeds. A row that is
refused has no error and is counted apart. The normalised squared error is the mean of e' P^-1 e / 3, e the small
rotation between found and true attitude and P its stated covariance: 1 is honest. The truth is synthetic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks import command
from benchmarks.measure import rms_deg
from inclinometry.earth.site import Site
from inclinometry.motion.automatic import ChooserSettings, choose_attitude
from inclinometry.motion.inertial.filter import inertial_attitude
from inclinometry.motion.inertial.smoother import smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.motion.result import (
    FLAGS,
    Attitude,
    Samples,
)
from inclinometry.motion.static import StaticSettings
from inclinometry.motion.window_filter import robust_filter
from inclinometry.rotations import (
    dcm,
    dcm_from_quaternion,
    wrap_signed,
)
from inclinometry.simulate.drilling import SCENARIOS, simulate_drilling
from inclinometry.simulate.drilling.scenario import MagLag

NAMES = ("smooth", "vibration-5g", "vibration-20g", "stick-slip", "sliding", "stationary", "fast")
WINDOWS = (2, 5, 10, 30)
# scenario and window, s -> rms inclination, azimuth, deg: Hann-weighted least squares (600 rpm: plain mean), 6 seeds
REFERENCE = {
    ("vibration-5g", 2): (0.221, 0.465),
    ("vibration-5g", 5): (0.046, 0.091),
    ("vibration-5g", 10): (0.026, 0.053),
    ("vibration-5g", 30): (0.016, 0.034),
    ("vibration-20g", 10): (0.103, 0.213),
    ("smooth", 2): (0.021, 0.040),
    ("600 rpm, swinging", 10): (0.136, 0.283),
}
PUBLISHED = (0.5, 1.35)
SPACING = 10.0
"""s, between the rows of filter, smoother and robust filter, as the windows of 10 s."""
HOLE = SCENARIOS["vibration-5g"].hole


def swinging(rpm: float):
    """vibration-5g at another mean speed."""
    scenario = SCENARIOS["vibration-5g"]
    return replace(scenario, rotation=replace(scenario.rotation, speed=rpm * 2.0 * np.pi / 60.0))


def known_site() -> Site:
    """What is known of the place: strengths and dip are references."""
    return Site(g=HOLE.gravity, b=HOLE.field, dip=HOLE.dip, latitude=HOLE.latitude, declination=HOLE.declination)


def methods(
    magnetic: dict | None = None, inertial: dict | None = None, static: dict | None = None
) -> dict[str, Callable[[Samples], Attitude]]:
    """Name -> what is done with a run; with further settings of the magnetic, inertial and static methods."""
    more, site = magnetic or {}, known_site()
    filtering = InertialSettings(window=SPACING, **(inertial or {}))
    at_rest = StaticSettings(window=SPACING, **(static or {}))

    def windows(seconds: float, overlap: float = 0.5) -> Callable[[Samples], Attitude]:
        return lambda samples: magnetic_attitude(
            samples, MagneticSettings(window_s=seconds, overlap=overlap, site=site, **more)
        )

    chosen = ChooserSettings(window=SPACING, magnetic=MagneticSettings(**more), inertial=filtering, static=at_rest)
    auto = {f"auto {SPACING:g} s": lambda samples: choose_attitude(samples, chosen, site)}
    return (
        auto
        | {f"magnetic {seconds} s": windows(float(seconds)) for seconds in WINDOWS}
        | {
            "robust": lambda samples: robust_filter(windows(SPACING, 0.0)(samples)),
            "filter": lambda samples: inertial_attitude(samples, filtering, site),
            "smoother": lambda samples: smoothed_attitude(samples, filtering, site),
        }
    )


def drawn(name: str, seed: int):
    """A scenario with a tool whose errors are drawn, as large as the methods are told they may be; so is its delay."""
    random = np.random.default_rng([seed, 77])
    scenario = SCENARIOS[name]
    tool = scenario.instrument

    def three(sd) -> tuple:
        return tuple(float(v) for v in random.normal(0.0, sd, 3))

    gyro = replace(tool.gyro, bias=three(3e-3), scale=three(2e-3))
    made = replace(
        tool, lever=three(0.02), hard_iron=three((100.0, 100.0, 10.0)), accel=replace(tool.accel, bias=three(0.01)),
        gyro=gyro,
    )  # fmt: skip
    return replace(scenario, instrument=made, faults=(MagLag(float(random.normal(0.0, DELAY))),))


DELAY = 1e-4
"""s, standard deviation of the magnetometer's delay."""
TOLD = (
    {
        "offset_sigma": 100.0,
        "axial_sigma": 10.0,
        "accel_sigma": 0.01,
        "lever_sigma": 0.02,
        "delay_sigma_s": DELAY,
        "lag_sigma_s": 0.0,
        "coupling_sigma": 0.0,
        "mag_scale_sigma": 0.0,
    },
    {
        "hard_iron_sigma": (100.0, 100.0, 10.0),
        "accel_bias_sigma": 0.01,
        "lever_sigma": 0.02,
        "gyro_bias_sigma": 3e-3,
        "gyro_scale_sigma": 2e-3,
        "coupling_sigma": 0.0,
        "delay_sigma_s": 0.0,
    },
    {"accel_sigma": 0.01, "mag_sigma": 100.0, "mag_axial_sigma": 10.0, "mag_scale_sigma": 0.0},
)
"""Settings of the magnetic, inertial and static methods for such tools."""


def stamped_late(seed: int) -> float:
    """s, by which the stamps of a drawn tool are off its accelerometers' samples."""
    return float(np.random.default_rng([seed, 78]).normal(0.0, DELAY))


def samples_of(run, late: float = 0.0) -> Samples:
    """What an estimator sees of a run, its stamps late."""
    return Samples(run.time + late, run.interval, run.accel, run.mag, run.gyro, run.temperature)


def rotation_errors(found: Attitude, run):
    """Small rotations e (k, 3), rad, of rows not refused, and their covariances; found = (1 + [e x]) true."""
    good = ~found.refused
    at, truth = found.time[good], run.truth
    toolface = np.interp(at, run.time, np.unwrap(truth.toolface))
    azimuth = np.interp(at, run.time, np.unwrap(truth.azimuth))
    true = dcm(azimuth, np.interp(at, run.time, truth.inclination), toolface)
    turn = dcm_from_quaternion(found.quaternion[good]) @ np.swapaxes(true, 1, 2)
    e = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )
    return e, found.covariance[good]


def scored(found: list[Attitude], runs: list) -> dict:
    """Rms errors, stated uncertainty, normalised squared error, share refused and why."""
    angles = {"inclination": [], "azimuth": [], "toolface": []}
    stated = {"inclination": [], "azimuth": []}
    squared, flags, refused, rows = [], dict.fromkeys(FLAGS, 0), 0, 0
    for one, run in zip(found, runs, strict=True):
        good = ~one.refused
        rows, refused = rows + len(one), refused + int((~good).sum())
        for row in np.flatnonzero(~good):
            for name in one.names(row):
                flags[name] += 1
        if not good.any():
            continue
        e, spread = rotation_errors(one, run)
        squared.append(np.einsum("ki,kij,kj->k", e, np.linalg.inv(spread), e) / 3.0)
        for name, values in angles.items():
            true = np.interp(one.time[good], run.time, np.unwrap(getattr(run.truth, name)))
            values.append(wrap_signed(getattr(one.angles, name)[good] - true))
        for name, values in stated.items():
            values.append(getattr(one.u, name)[good])
    result = {"rows": rows, "refused": refused / rows if rows else None}
    result["why refused"] = {name: count for name, count in flags.items() if count}
    if squared:
        result |= {f"{name}_deg": rms_deg(np.concatenate(values)) for name, values in angles.items()}
        result |= {f"u_{name}_deg": rms_deg(np.concatenate(values)) for name, values in stated.items()}
        result["normalised squared error"] = float(np.mean(np.concatenate(squared)))
    return result


def run(draws: int = 5, tools: int = 20) -> dict:
    """Everything as numbers: `draws` seeds of the scenarios as named, `tools` with errors drawn."""
    return {
        "draws": draws,
        "table": table(draws, list(NAMES), lambda name, seed: name, methods())
        | table(draws, ["600 rpm, swinging"], lambda *_: swinging(600.0), methods()),
        "drawn tools": table(tools, list(NAMES), drawn, honest(), stamped_late),
        "drawn": tools,
        "reference": {f"{name}, {seconds} s": pair for (name, seconds), pair in REFERENCE.items()},
        "published_deg": PUBLISHED,
    }


def honest() -> dict[str, Callable[[Samples], Attitude]]:
    """The methods whose stated covariance is held against tools whose errors are drawn."""
    ways = methods(*TOLD)
    return {name: ways[name] for name in ("auto 10 s", "magnetic 10 s", "robust", "filter", "smoother")}


def table(
    draws: int,
    names: list[str],
    made: Callable,
    ways: dict[str, Callable[[Samples], Attitude]],
    late: Callable[[int], float] = lambda seed: 0.0,
) -> dict:
    """Scenario -> method -> scores."""
    found = {}
    for name in names:
        runs = [simulate_drilling(made(name, seed), seed) for seed in range(1, draws + 1)]
        cells = [samples_of(one, late(seed)) for seed, one in enumerate(runs, 1)]
        found[name] = {way: scored([method(one) for one in cells], runs) for way, method in ways.items()}
    return found


def report(result: dict) -> None:
    """Print the tables."""
    print(
        f"Rms error of inclination / azimuth, deg; {result['draws']} seeds; z2: normalised squared error, 1 is honest"
    )
    for name, ways in result["table"].items():
        print(f"\n{name}")
        for way, one in ways.items():
            print(f"  {way:14s} {_cells(one)}{_beside(result, name, way)}")
    print(f"\nTools whose errors are drawn, {result['drawn']} of them")
    for name, ways in result["drawn tools"].items():
        print(f"\n{name}")
        for way, one in ways.items():
            print(f"  {way:14s} {_cells(one)}")


def _cells(one: dict) -> str:
    lost = "" if not one["refused"] else f"  refused {100 * one['refused']:.0f} % ({', '.join(one['why refused'])})"
    if "inclination_deg" not in one:
        return f"{'none':>34s}{lost}"
    pair = f"{one['inclination_deg']:.4f} / {one['azimuth_deg']:.4f}"
    stated = f"u {one['u_inclination_deg']:.4f} / {one['u_azimuth_deg']:.4f}"
    return f"{pair:>18s}  {stated}  z2 {one['normalised squared error']:.2f}{lost}"


def _beside(result: dict, name: str, way: str) -> str:
    pair = result["reference"].get(f"{name}, {way.removeprefix('magnetic ')}")
    return "" if pair is None else f"  reference {pair[0]:g} / {pair[1]:g}"


if __name__ == "__main__":
    command(__doc__, run, report)

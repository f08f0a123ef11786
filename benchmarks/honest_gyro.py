"""Whether a gyro run's own ellipse holds the end of the true well; nothing of the package's simulators is used.

    python -m benchmarks.honest_gyro [--runs 60] [--plans 12 24] [--scene NAME] [--json]

A tool of three gyros and three accelerometers (factors, axes and offsets off by 1 %) is calibrated on a stand whose
dials are off by 0.02 to 0.1 deg, all variances estimated; then it is turned to four positions at each of 31 stations
30 m apart, from 2 deg of inclination to anywhere between 20 and 88, its scale following the temperature. A reading has
noise of 0.015 deg/h and 0.1 mg. NEES: mean squared error over stated variance (1 is honest) of the bottom hole in plan,
and of the stations' azimuths; share of bottom holes inside the ellipse of 95 %; root mean square of the azimuths, deg,
from the sixth station on.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import command
from benchmarks.honest_certificate import PLANS, bottom
from benchmarks.measure import turned
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.earth.site import Site
from inclinometry.files.gyro_csv import read_gyro_run, write_gyro_run
from inclinometry.position.propagation import gyro_sources, propagate
from inclinometry.position.well import well_survey
from inclinometry.uncertainty import ellipsoid_factor
from inclinometry.workflow.gyro import GyroOptions, north_run

G, RATE, LATITUDE = 9.806199, 7.292115e-5, np.pi / 4.0
DEG_H = np.radians(1.0) / 3600.0 / RATE
NOISE = {"accelerometer": 1e-4, "gyro": 0.015 * DEG_H}
"""Of one reading, shares of gravity and of the Earth rate."""
FIELD = {"accelerometer": np.array([0.0, 0.0, 1.0]), "gyro": np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)])}
STATIONS = 31


class Scene(NamedTuple):
    """What is wrong with the gyros since the calibration, deg/h: a step of the bias a reading, a bias of each (sd)."""

    walk: float = 0.0
    bias: float = 0.0


SCENES = {
    "the model holds": Scene(),
    "bias walks, 0.02 deg/h a reading": Scene(0.02),
    "bias of 0.5 deg/h": Scene(0.0, 0.5),
}


def read(tool, field, rng):
    """Signals of a tool (tensor, offset of each kind) in fields (n, 3)."""
    return {
        kind: values @ tool[kind][0].T + tool[kind][1] + NOISE[kind] * rng.standard_normal(values.shape)
        for kind, values in field.items()
    }


def calibrated(tool, plan, rng):
    """The certificate of a tool, as a user gets it."""
    dial = np.radians(np.exp(rng.uniform(np.log(0.02), np.log(0.1))))
    settings = [getattr(plan, name) for name in ("azimuth", "inclination", "toolface")]
    actual = [values + dial * rng.standard_normal(len(plan)) for values in settings]
    signals = read(tool, {kind: turned(*actual) @ down for kind, down in FIELD.items()}, rng)
    return calibrate_joint(BenchReadings(signals, *settings, reference={"g": G, "w": RATE}), name="bench")


def measured(tool, scene: Scene, inclination, azimuth, rng):
    """Readings of a run, through its file."""
    station, index = np.repeat(np.arange(STATIONS), 4), np.tile(np.radians([0.0, 90.0, 180.0, 270.0]), STATIONS)
    toolface = rng.uniform(0.0, 2.0 * np.pi, STATIONS)
    temperature = np.linspace(20.0, 140.0, STATIONS)
    heat, (slope, bend) = (temperature - 20.0) / 100.0, rng.standard_normal(2)
    scale = 1.0 + 0.005 * slope * heat + 0.003 * bend * heat**2 + 0.0005 * rng.standard_normal(STATIONS)
    matrix = turned(azimuth[station], inclination[station], toolface[station] + index)
    field = {kind: matrix @ down for kind, down in FIELD.items()}
    field["gyro"] = field["gyro"] / scale[station][:, None]
    signals = read(tool, field, rng)
    steps = scene.walk * DEG_H * rng.standard_normal(signals["gyro"].shape)
    signals["gyro"] = signals["gyro"] + np.cumsum(steps, axis=0) + scene.bias * DEG_H * rng.standard_normal(3)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        write_gyro_run(
            path,
            station=[f"{n + 1}" for n in station],
            md=30.0 * station,
            index=index,
            channels=signals,
            letters=dict.fromkeys(signals, "xyz"),
            units=dict.fromkeys(signals, "counts"),
            temperature=temperature[station],
            time=60.0 * np.arange(len(station)),
        )
        return read_gyro_run(path)


def one(seed: int, name: str, scene: Scene) -> tuple[float, float, float]:
    """Squared distance of the bottom hole found in stated variances, mean of the azimuths', and their mean square."""
    rng = np.random.default_rng([seed, int(name)])
    tool = {kind: (np.eye(3) + 0.01 * rng.standard_normal((3, 3)), 0.01 * rng.standard_normal(3)) for kind in NOISE}
    calibration = calibrated(tool, PLANS[name](), rng)
    inclination = np.linspace(np.radians(2.0), np.radians(rng.uniform(20.0, 88.0)), STATIONS)
    azimuth = rng.uniform(0.0, 2.0 * np.pi) + np.radians(1.5) * np.cumsum(rng.standard_normal(STATIONS))
    here = Site(latitude=LATITUDE, g=G, north_reference="true")
    found = north_run(
        measured(tool, scene, inclination, azimuth, rng), here, calibration, GyroOptions(g_sensitivity=0.0)
    ).survey
    well = well_survey(found.md, found.inclination, found.azimuth, here)
    covariance = propagate(well, sources=gyro_sources(found, well)).covariance[-1, :2, :2]
    # where the well begins is known, its attitude there too
    pairs = (found.inclination, inclination), (found.azimuth, azimuth)
    begun = [np.append(own[:1], true[1:]) for own, true in pairs]
    off = (bottom(found.md, found.inclination, found.azimuth) - bottom(found.md, *begun))[:2]
    error = ((found.azimuth - azimuth + np.pi) % (2.0 * np.pi) - np.pi)[5:]
    return (
        float(off @ np.linalg.solve(covariance, off)),
        float(np.mean((error / found.u_azimuth[5:]) ** 2)),
        float(np.mean(np.degrees(error) ** 2)),
    )


def run(runs: int = 60, plans: Sequence[str] = tuple(PLANS), scene: Sequence[str] = tuple(SCENES)) -> Iterator[dict]:
    """A row a scene and plan."""
    limit = float(ellipsoid_factor(0.95, 2)) ** 2
    for what in scene:
        for name in plans:
            found = np.array([one(seed, name, SCENES[what]) for seed in range(runs)])
            yield {
                "scene": what,
                "positions": int(name),
                "runs": runs,
                "nees": float(found[:, 0].mean() / 2.0),
                "nees_azimuth": float(found[:, 1].mean()),
                "inside": float(np.mean(found[:, 0] < limit)),
                "azimuth_deg": float(np.sqrt(found[:, 2].mean())),
            }


def report(rows: Iterator[dict]) -> None:
    """A line a scene and plan, as they come."""
    print(f"{'scene':34}{'positions':>10}{'runs':>6}{'NEES':>7}{'azimuth':>9}{'inside':>8}{'azimuth, deg':>14}")
    for row in rows:
        print(
            f"{row['scene']:34}{row['positions']:10d}{row['runs']:6d}{row['nees']:7.2f}{row['nees_azimuth']:9.2f}"
            f"{row['inside']:8.3f}{row['azimuth_deg']:14.3f}",
            flush=True,
        )


if __name__ == "__main__":
    command(__doc__, run, report)

"""Whether azimuths of uncalibrated gyros are as wrong as `gyro north` says; an own simulator.

    python -m benchmarks.gyro_axes [--runs 40] [--scene NAME] [--json]

A run of 60 stations, inclination from 2 deg to anywhere between 20 and 88 and azimuth walking by 1.5 deg a station, at
latitude 0 to 75 deg, four index positions of two gyros and two accelerometers, noise of 0.015 deg/h of a station, no
thermometer; the scale factor follows one of five laws. Coverage: share of azimuths within 1.96 standard uncertainties.
u/error: median uncertainty over the median error as a normal distribution has it. Gross: beyond 1 deg and 5 u, and
unflagged.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import command
from inclinometry.earth.site import Site
from inclinometry.files.gyro_csv import read_gyro_run, write_gyro_run
from inclinometry.workflow.gyro import GyroOptions, north_run

EARTH, GRAVITY, STATIONS = 15.041067, 9.80665, 60
LATITUDES = (0.0, 31.5, 45.0, 60.0, 75.0)
SCALES = (
    lambda n, rng: np.ones(n.size),
    lambda n, rng: np.linspace(0.99, 1.01, n.size),
    lambda n, rng: 1.0 + np.cumsum(0.001 * rng.normal(size=n.size)),
    lambda n, rng: 1.0 + 0.01 * np.sin(n / 6.0),
    lambda n, rng: 1.0 + 0.01 * (-1.0) ** (n // 15),
)


class Scene(NamedTuple):
    """Standard deviation of an element: misalignment, deg, and g-sensitivity, deg/h/g; what the options state."""

    misalignment: float = 0.2
    sensitivity: float = 0.1
    stated: tuple[float, float] | None = None
    gyros: int = 2
    latitudes: Sequence[float] = LATITUDES


SCENES = {
    "ordinary, ignored": Scene(stated=(0.0, 0.0)),
    "ordinary": Scene(),
    "ordinary, one gyro": Scene(gyros=1),
    "ordinary, three gyros": Scene(gyros=3),
    "misalignment alone": Scene(sensitivity=0.0),
    "g-sensitivity alone": Scene(misalignment=0.0),
    "perfect": Scene(0.0, 0.0),
    "perfect, stated": Scene(0.0, 0.0, (0.0, 0.0)),
    "a tenth, stated": Scene(0.02, 0.01, (0.02, 0.01)),
}


def one(seed: int, scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of azimuth and their standard uncertainties, deg, and whether a station is flagged."""
    rng = np.random.default_rng([seed, 28])
    latitude, number = np.radians(scene.latitudes[seed % len(scene.latitudes)]), np.arange(STATIONS)
    scale = SCALES[seed // len(scene.latitudes) % len(SCALES)](number, rng)
    inclination = np.radians(np.linspace(2.0, rng.uniform(20.0, 88.0), STATIONS))
    azimuth = rng.uniform(0.0, 2.0 * np.pi) + np.radians(1.5) * np.cumsum(rng.normal(size=STATIONS))
    toolface = rng.uniform(0.0, 2.0 * np.pi, STATIONS)
    axes = np.eye(3) + np.radians(scene.misalignment) * rng.normal(size=(3, 3))
    pull, bias = scene.sensitivity * rng.normal(size=(3, 3)), rng.normal(size=3)
    rows = []
    for n in number:
        for index in np.radians([0.0, 90.0, 180.0, 270.0]):
            ci, si, ca, sa = np.cos(inclination[n]), np.sin(inclination[n]), np.cos(azimuth[n]), np.sin(azimuth[n])
            ct, st = np.cos(toolface[n] + index), np.sin(toolface[n] + index)
            # north, east, down to high side, right, along; then turned about the tool axis
            body = np.array([[ct, st, 0.0], [-st, ct, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
                [[ci * ca, ci * sa, -si], [-sa, ca, 0.0], [si * ca, si * sa, ci]]
            )
            rate = EARTH * body @ [np.cos(latitude), 0.0, -np.sin(latitude)]
            reading = (axes @ rate + pull @ body[:, 2]) / scale[n] + bias * [1.0, 1.0, 0.05]
            # the mean of two gyros at four positions has half the noise of a reading
            noise = 0.015 * np.sqrt(2.0 * min(scene.gyros, 2))
            rows.append((*(GRAVITY * body[:, 2] + 1e-3 * rng.normal(size=3)), *(reading + noise * rng.normal(size=3))))
    table = np.array(rows)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        write_gyro_run(
            path,
            station=[f"{n + 1}" for n in np.repeat(number, 4)],
            md=30.0 * np.repeat(number, 4),
            index=np.tile(np.radians([0.0, 90.0, 180.0, 270.0]), STATIONS),
            channels={"accelerometer": table[:, :2], "gyro": table[:, 3 : 3 + scene.gyros]},
            letters={"accelerometer": "xy", "gyro": "xyz"[: scene.gyros]},
            units={"accelerometer": "m/s^2", "gyro": "deg/h"},
        )
        readings = read_gyro_run(path)
    turn, pull_sd = scene.stated or (None, None)
    if scene.stated:
        turn, pull_sd = np.radians(scene.stated) / [1.0, 3600.0]
    stated = {"misalignment": turn, "g_sensitivity": pull_sd}
    along = {"z_bias_sd": np.radians(0.05) / 3600.0} if scene.gyros == 3 else {}
    here = Site(latitude=float(latitude), g=GRAVITY, north_reference="true")
    survey = north_run(readings, here, None, GyroOptions(hole="down", **stated, **along)).survey
    error = (survey.azimuth - azimuth + np.pi) % (2.0 * np.pi) - np.pi
    flagged = np.array([bool(set(row) - {"vertical"}) for row in survey.flags])
    return np.degrees(error), np.degrees(survey.u_azimuth), flagged


def run(runs: int = 40, scene: Sequence[str] = tuple(SCENES)) -> Iterator[dict]:
    """A row a scene."""
    for name in scene:
        error, u, flagged = (
            np.concatenate(part) for part in zip(*(one(n, SCENES[name]) for n in range(runs)), strict=True)
        )
        gross = np.abs(error) > np.maximum(1.0, 5.0 * u)
        yield {
            "scene": name,
            "stations": error.size,
            "azimuth_deg": float(np.sqrt(np.mean(error**2))),
            "median_deg": float(np.median(np.abs(error))),
            "z": float(np.sqrt(np.mean((error / u) ** 2))),
            "coverage": float(np.mean(np.abs(error) < 1.96 * u)),
            "u_over_error": float(0.6745 * np.median(u) / np.median(np.abs(error))),
            "u_median_deg": float(np.median(u)),
            "gross_unflagged": int((gross & ~flagged).sum()),
            "flagged": int(flagged.sum()),
        }


def report(rows: Iterator[dict]) -> None:
    """A line a scene, as they come."""
    print(
        f"{'scene':24}{'stations':>9}{'rms':>8}{'median':>8}{'z':>6}{'coverage':>10}{'u/error':>9}{'u':>7}{'gross':>7}{'flagged':>9}"
    )
    for row in rows:
        print(
            f"{row['scene']:24}{row['stations']:9d}{row['azimuth_deg']:8.3f}{row['median_deg']:8.3f}{row['z']:6.2f}"
            f"{row['coverage']:10.3f}{row['u_over_error']:9.2f}{row['u_median_deg']:7.3f}{row['gross_unflagged']:7d}"
            f"{row['flagged']:9d}",
            flush=True,
        )


if __name__ == "__main__":
    command(__doc__, run, report)

"""Simulated gyro runs as files: readings, site and the truth beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.earth.gravity import normal_gravity
from inclinometry.errors import not_among
from inclinometry.files import json_codec
from inclinometry.files.gyro_csv import write_gyro_run
from inclinometry.files.writing import write_bytes
from inclinometry.simulate.gyro import GyroSensors, GyroSimulation, Spike, hot_run, simulate_gyro_run
from inclinometry.simulate.tool import Streams

POSITIONS: Final = {
    "two": (0.0, 180.0),
    "four": (0.0, 90.0, 180.0, 270.0),
    "mirrored": (0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0),
    "n": tuple(np.arange(0.0, 360.0, 45.0).tolist()),
    "carousel": tuple(np.arange(0.0, 720.0, 5.0).tolist()),
}
"""Index positions a simulated run visits, deg."""


def gyro_run(
    seed: int,
    noise_seed: int | None = None,
    *,
    scenario: str = "hot",
    stations: int = 60,
    scheme: str = "four",
    latitude: float = float(np.pi / 4),
    arw: float = float(np.radians(0.005)) / 60.0,
    dwell: float = 60.0,
    bias: float = 0.0,
    drift: float = 0.0,
    axes: int = 2,
    gyros: int = 2,
    accelerometer_noise: float = 5e-4,
    spike: tuple[int, int, float] | None = None,
) -> GyroSimulation:
    """A simulated run, SI and radians; with another `noise_seed` the same hole is run again.

    scenario : "hot" (20 to 140 degC, the scale follows) or "cool" (20 degC throughout, scale 1).
    axes : 2 (x, y), 3 (z too) for gyros; accelerometers get the same; gyros : 1 for a single gyro, x.
    """
    for name, value, allowed in (("scenario", scenario, ("hot", "cool")), ("scheme", scheme, POSITIONS)):
        if value not in allowed:
            raise not_among(name, value, allowed)
    path = hot_run(seed, stations, latitude=latitude)
    if scenario == "cool":
        path = path._replace(temperature=np.full(stations, 20.0), scale=np.ones(stations))
    tensor = np.eye(3)[:axes]
    # the dwell is the whole station's: every scheme listens as long
    positions = np.radians(POSITIONS[scheme])
    sensors = GyroSensors(
        gyro_tensor=tensor[:1] if gyros == 1 else tensor,
        accelerometer_tensor=tensor,
        gyro_bias=bias,
        gyro_drift=drift,
        arw=arw,
        accelerometer_noise=accelerometer_noise,
    )
    streams = Streams(seed if noise_seed is None else noise_seed, "gyro-run")
    return simulate_gyro_run(
        30.0 * np.arange(1.0, stations + 1.0),
        path.inclination,
        path.azimuth,
        streams["toolface"].uniform(0.0, 2.0 * np.pi, stations),
        latitude=latitude,
        scale=path.scale,
        temperature=path.temperature,
        positions=positions,
        dwell=dwell / len(positions),
        settle=0.0 if scheme == "carousel" else 5.0,
        g=float(normal_gravity(latitude, 0.0)),
        sensors=sensors,
        spikes=[] if spike is None else [Spike(spike[0], spike[1], 0, spike[2])],
        seed=streams["rows"],
    )


def write_gyro(run: GyroSimulation, path: str | Path) -> None:
    """Write the readings as `gyro north` reads them, rates in deg/h."""
    degrees = np.degrees(run.gyro) * 3600.0
    letters = {"accelerometer": "xyz"[: run.accelerometer.shape[1]], "gyro": "xyz"[: run.gyro.shape[1]]}
    write_gyro_run(
        path,
        station=[str(int(s)) for s in run.station],
        md=run.md,
        index=run.index,
        channels={"accelerometer": run.accelerometer, "gyro": degrees},
        letters=letters,
        units={"accelerometer": "m/s^2", "gyro": "deg/h"},
        temperature=run.temperature,
        time=run.time,
    )


def write_gyro_truth(run: GyroSimulation, seed: int, path: str | Path) -> None:
    """Write the truth of every station."""
    first = np.flatnonzero(np.diff(run.station, prepend=-1))

    def degrees(values: Array) -> Array:
        return np.asarray(np.round(np.degrees(values), 10), dtype=np.float64)

    content = {
        "schema": "inclinometry/gyro-truth",
        "version": 1,
        "seed": seed,
        "latitude_deg": float(degrees(np.array(run.latitude))),
        "noise_of_one_gyro_reading_deg_h": float(np.degrees(run.noise["gyro"]) * 3600.0),
        "stations": {
            "md_m": run.md[first],
            "temperature_degC": run.temperature[first],
            "inclination_deg": degrees(run.inclination),
            "azimuth_deg": degrees(run.azimuth),
            "toolface_deg": degrees(run.toolface),
            "scale": run.scale,
        },
    }
    write_bytes(json_codec.canonical(content), path)

"""The real measurements that come with the package, in the package's types."""

from __future__ import annotations

import gzip
import json
from importlib.resources import files

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.stillness import StillIntervals, sd_of_mean, stations_from_log
from inclinometry.digest import digest_bytes

XSENS_SETTLED, XSENS_SAMPLES = 50, 100
XSENS_GRAVITY = 9.81744
"""Local gravity stated with the Xsens log, m/s^2."""


def xsens_log() -> tuple[Array, Array, str]:
    """Time (n,) s, accelerometer counts (n, 3) of a real Xsens MTi, and the digest of the file.

    Source: Tedaldi, Pretto, Menegatti, ICRA 2014.
    """
    data = files("inclinometry.workflow").joinpath("demo_data", "xsens_mti", "xsens_acc.txt.gz").read_bytes()
    table = np.array(gzip.decompress(data).split(), dtype=np.float64).reshape(-1, 4)
    return table[:, 0], table[:, 1:], digest_bytes(data)


def xsens_stations() -> tuple[BenchReadings, StillIntervals]:
    """The poses of the Xsens log, found by the package's own detector; one second of each once it has settled.

    The poses creep: means over a whole pose move the parameters by up to two standard uncertainties.
    """
    time, counts, digest = xsens_log()
    _, found = stations_from_log(time, {"accelerometer": counts})
    first = [counts[start + XSENS_SETTLED :][:XSENS_SAMPLES] for start, _ in found.pairs()]
    return BenchReadings(
        {"accelerometer": np.array([samples.mean(axis=0) for samples in first])},
        sd={"accelerometer": np.array([sd_of_mean(samples) for samples in first])},
        count=np.array([float(len(samples)) for samples in first]),
        reference={"g": XSENS_GRAVITY},
        findings=found.findings,
        digest=digest,
    ), found


def cave_instrument(name: str) -> BenchReadings:
    """The 24 shots of a real hand-held cave-survey instrument, mapped to tool axes.

    Shots 1-8 are free, 9-16 and 17-24 two sets of 8 rolls about the tool axis, the instrument's y, at a fixed target.
    Tool axes are the instrument's z (taken as index mark), x, y. Source: furbrain, CircuitPython_mag_cal.
    """
    data = files("inclinometry.workflow").joinpath("demo_data", "sap6_cave", f"{name}.json").read_bytes()
    raw = json.loads(data)
    mag, grav = np.array(raw["mag"]), np.array(raw["grav"])
    # the makers' maps from chip axes to instrument axes: "+x+y-z" and "-y-x+z"
    b = np.stack([mag[:, 0], mag[:, 1], -mag[:, 2]], axis=1)
    g = np.stack([-grav[:, 1], -grav[:, 0], grav[:, 2]], axis=1)
    to_tool = [2, 0, 1]
    rolls = [""] * 8 + ["1"] * 8 + ["2"] * 8
    channels = {"accelerometer": g[:, to_tool], "magnetometer": b[:, to_tool]}
    return BenchReadings(channels, roll_set=rolls, units={"magnetometer": "uT"}, digest=digest_bytes(data))

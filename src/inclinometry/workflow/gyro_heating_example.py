"""A simulated run into a hot hole through the methods that find north and scale factor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.gyro.closed_form import solve_fixed_arctan2, solve_patent
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.result import North
from inclinometry.gyro.tracking import ScaleTrack, quadratic_belief, smooth_scale
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.gyro import HotRun

JOINT, FIXED, PATENT = "joint, scale followed", "uncompensated", "patent, closed form"


def reduce_hot_run(run: HotRun) -> tuple[dict[str, North], dict[str, Array], ScaleTrack]:
    """North by the classical closed form with scale 1, by the patent's, and jointly with the scale followed.

    Returned by method: north; azimuth found less true (n,), rad, NaN where it fails; then the scale factor of `JOINT`.
    """
    size = len(run.a)
    high = np.stack([run.a, run.b], axis=1)
    gravity = STANDARD_GRAVITY * np.stack(
        [-np.sin(run.inclination), np.zeros(size), np.cos(run.inclination)], axis=1
    )  # the rates are turned back to the high side already: toolface 0
    readings = gravity, EARTH_RATE * high, run.latitude
    # standard deviation stated for a component of gravity, m/s^2: next to nothing, as the simulated one is exact
    gravity_sd = 1e-5
    spread, down = run.noise**2 * np.eye(2), gravity_sd**2 * np.eye(3)
    turning = EARTH_RATE**2 * spread
    track = smooth_scale(
        high, np.tile(spread, (size, 1, 1)), run.inclination, run.latitude, run.temperature, quadratic_belief()
    )
    stations = {
        FIXED: solve_fixed_arctan2(*readings, gravity_covariance=down, rate_covariance=turning),
        PATENT: solve_patent(*readings, gravity_covariance=down, rate_covariance=turning, history=1.0),
        JOINT: estimate_north(
            *readings,
            gravity_covariance=down,
            rate_covariance=turning,
            scale=track.law,
        ),
    }
    errors = {name: wrap_signed(found.azimuth - run.azimuth) for name, found in stations.items()}
    return stations, errors, track


def rms_degrees(runs: Iterable[Mapping[str, Array]]) -> dict[str, float]:
    """Root mean square azimuth error of each method over all stations at which it gives one, deg."""
    errors: dict[str, list[Array]] = {}
    for run in runs:
        for name, error in run.items():
            errors.setdefault(name, []).append(error)
    return {name: float(np.degrees(np.sqrt(np.nanmean(np.concatenate(e) ** 2)))) for name, e in errors.items()}

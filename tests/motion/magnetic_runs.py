"""Simulated runs for the tests of the magnetic attitude, and what is scored of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.motion.result import Attitude, Samples
from inclinometry.rotations import dcm, dcm_from_quaternion, rotation_log, wrap_signed
from inclinometry.simulate.drilling import SCENARIOS, DrillingSimulation, Scenario, simulate_drilling
from inclinometry.simulate.drilling.scenario import Rotation

EXACT = {"delay_sigma_s": 0.0, "lag_sigma_s": 0.0, "coupling_sigma": 0.0, "accel_sigma": 1e-4, "axial_sigma": 0.1}
KNOWN = {**EXACT, "offset_sigma": 2.0}
"""Settings for the scenarios' tools, which have no offsets, one clock and no collar."""

FIVE = SCENARIOS["vibration-5g"]
RPM = np.pi / 30.0


def spun(rpm: float, scenario: Scenario = FIVE) -> Scenario:
    """The scenario at an even speed."""
    return replace(scenario, rotation=Rotation(rpm * RPM))


MORE = {
    "swing-600": replace(FIVE, rotation=replace(FIVE.rotation, speed=600.0 * RPM)),
    "steady-120": spun(120.0),
}


@lru_cache(maxsize=64)
def run_of(name: str, seed: int, duration: float = 60.0) -> DrillingSimulation:
    """A named run."""
    return simulate_drilling(MORE.get(name) or SCENARIOS[name], seed, duration=duration)


def samples_of(run: DrillingSimulation, gyro: bool = True, start: int = 0, stop: int | None = None) -> Samples:
    """What the tool recorded of it."""
    cut = slice(start, stop)
    return Samples(
        run.time[cut],
        run.interval,
        run.accel[cut],
        run.mag[cut],
        run.gyro[cut] if gyro else None,
        clipped=run.truth.clipped[cut],
    )


def errors(found: Attitude, run: DrillingSimulation) -> Array:
    """Rotation vectors (k, 3), tool axes, rad, from truth to the rows that were not refused."""
    good = ~found.refused
    at = found.time[good]
    angle = [np.interp(at, run.time, np.unwrap(getattr(run.truth, n))) for n in ("azimuth", "inclination", "toolface")]
    return rotation_log(dcm_from_quaternion(found.quaternion[good]) @ np.swapaxes(dcm(*angle), 1, 2))


class Score(NamedTuple):
    """rms in degrees, mean normalised square over three components."""

    inclination: float
    azimuth: float
    toolface: float
    nees: float
    rows: int
    refused: int


def score(found: Iterable[tuple[Attitude, DrillingSimulation]]) -> Score:
    """Over windows and seeds."""
    squares, nees, refused = [], [], 0
    for attitude, run in found:
        good, off = ~attitude.refused, errors(attitude, run)
        at, angles = attitude.time[good], attitude.angles
        truth = [np.interp(at, run.time, np.unwrap(getattr(run.truth, n))) for n in ("inclination", "azimuth")]
        squares.append(
            np.stack(
                [
                    wrap_signed(angles.inclination[good] - truth[0]) ** 2,
                    wrap_signed(angles.azimuth[good] - truth[1]) ** 2,
                    off[:, 2] ** 2,
                ],
                axis=1,
            )
        )
        nees.append(np.einsum("ki,kij,kj->k", off, np.linalg.inv(attitude.covariance[good]), off) / 3.0)
        refused += int((~good).sum())
    rms = np.degrees(np.sqrt(np.concatenate(squares).mean(axis=0)))
    all_nees = np.concatenate(nees)
    return Score(*map(float, rms), float(all_nees.mean()), all_nees.size, refused)


def scored(name: str, window_s: float, gyro: bool, seeds: Iterable[int] = range(5), **settings: float) -> Score:
    """A scenario through the method."""
    chosen = MagneticSettings(window_s=window_s, **{**KNOWN, **settings})
    runs = [run_of(name, seed) for seed in seeds]
    return score((magnetic_attitude(samples_of(run, gyro), chosen), run) for run in runs)

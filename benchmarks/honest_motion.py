"""Tools that turn too slowly to be told from one that stands, heave and are shaken: is the stated u of azimuth honest?

    python -m benchmarks.honest_motion [--runs 8] [--json]

Every row is a motion and a method, over runs whose sensor errors are drawn from the settings' priors. The tool rests
for a while, then turns about the vertical at a constant rate, with heave of a rig along the tool, or shaken so much
that the filter begins anew; or it is pulled through a bent hole. Error and u are root mean squares of azimuth over all
rows that have an attitude, z2 the mean of (error / u)^2 (1 is honest), `coverage` the share within 1.96 u, of azimuth
and of inclination. A row is flagged where it bears one of `FLAGGED`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks import command
from inclinometry.arrays import Array
from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.filter import gyro_attitude, inertial_attitude
from inclinometry.motion.inertial.smoother import continuous_survey, smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.result import BITS, METHODS, Attitude, Samples
from inclinometry.rotations import (
    dcm,
    dcm_from_quaternion,
    quaternion_from_dcm,
    rotation_exp,
    rotation_log,
)

INTERVAL = 0.01
LATITUDE, DIP, FIELD, GRAVITY = float(np.radians(50.0)), float(np.radians(65.0)), 50_000.0, 9.80665
SITE = Site(latitude=LATITUDE, g=GRAVITY, dip=DIP, dip_sigma=1e-3, b=FIELD, declination=0.0)
FLAGGED = ("disturbed", "misfit", "clipped", "unobservable", "vibration")
STATION = float(np.radians(0.2))
"""rad, of a north-seeking station's azimuth; its inclination is ten times better."""


class Run(NamedTuple):
    """Readings, the tool's matrices (n, 3, 3), and the seed of what is drawn besides."""

    samples: Samples
    matrix: Array
    seed: int


def turning(degrees_a_second: float, rest_s: float, turn_s: float) -> Array:
    """Matrices of a tool at 45 deg of inclination that rests and then turns about the vertical."""
    time = INTERVAL * np.arange(round((rest_s + turn_s) / INTERVAL))
    return dcm(np.radians(30.0 + degrees_a_second * np.maximum(time - rest_s, 0.0)), np.pi / 4, np.radians(100.0))


def wireline(seconds: float = 300.0) -> Array:
    """Matrices of a tool pulled at 1 m/s through a hole that turns and builds by 3 deg in 30 m, rolling slowly."""
    time = INTERVAL * np.arange(round(seconds / INTERVAL))
    azimuth = 30.0 + 0.12 * time + 2.0 * np.sin(2.0 * np.pi * time / 120.0)
    return dcm(np.radians(azimuth), np.radians(20.0 + 0.05 * time), np.radians(40.0 + 0.4 * time))


def measured(
    matrix: Array,
    seed: int,
    *,
    heave: float = 0.0,
    along_tool: bool = False,
    period: float = 8.0,
    shaken: tuple[float, float] = (0.0, 0.0),
    bias: float | None = None,
) -> Run:
    """Readings of a tool whose errors are drawn from the default settings' priors.

    heave : m/s^2, amplitude along the tool, or along the vertical and, half of it, north; period : s, of it.
    shaken : s, from and to which 20 m/s^2 swing at a third of a hertz. bias : rad/s, of the gyro; drawn.
    """
    draw, told, size = np.random.default_rng(seed), InertialSettings(), (len(matrix), 3)
    time = INTERVAL * np.arange(len(matrix))
    steps = rotation_log(matrix[:-1] @ np.swapaxes(matrix[1:], 1, 2)) / INTERVAL
    # what the strapdown takes for the rate at a sample: between two steps their mean
    rate = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]]) + matrix @ earth_rate(LATITUDE)
    gyro_bias = draw.normal(0.0, told.gyro_bias_sigma, 3) if bias is None else np.full(3, bias)
    gyro = (rate + gyro_bias) / (1.0 - draw.normal(0.0, told.gyro_scale_sigma, 3))
    gyro += draw.normal(0.0, told.gyro_noise / np.sqrt(INTERVAL), size)
    along = matrix[:, 2] if along_tool else np.array([0.5, 0.0, 1.0])
    moved = heave * np.sin(2.0 * np.pi * time / period + draw.uniform(0.0, 6.28))[:, None] * along
    inside = (time >= shaken[0]) & (time < shaken[1])
    moved[inside] += 20.0 * np.sin(2.0 * np.pi * 0.33 * time[inside])[:, None] * [1.0, 0.5, 0.2]
    force = np.einsum("nij,nj->ni", matrix, [0.0, 0.0, GRAVITY] - moved) + draw.normal(0.0, told.accel_bias_sigma, 3)
    field = FIELD * matrix @ [np.cos(DIP), 0.0, np.sin(DIP)] + draw.normal(0.0, 60.0, 3)
    return Run(
        Samples(
            time,
            INTERVAL,
            accel=force + draw.normal(0.0, told.accel_noise, size),
            mag=field + draw.normal(0.0, told.mag_noise, size),
            gyro=gyro,
        ),
        matrix,
        seed,
    )


def station(run: Run, place: int) -> Attitude:
    """A north-seeking station at a sample, with its errors drawn."""
    matrix = run.matrix[place]
    covariance = matrix @ np.diag([STATION / 10.0, STATION / 10.0, STATION]) ** 2 @ matrix.T
    error = np.random.default_rng([run.seed, place]).multivariate_normal(np.zeros(3), covariance)
    return Attitude(
        time=run.samples.time[[place]],
        quaternion=quaternion_from_dcm(rotation_exp(-error) @ matrix)[None],
        covariance=covariance[None],
        rate=np.zeros(1),
        quality=np.ones(1),
        flags=np.zeros(1, dtype=np.uint32),
        method=np.full(1, METHODS.index("gyro"), dtype=np.uint8),
        north="true",
    )


def gyro_alone(run: Run) -> Attitude:
    """From a station at the first sample."""
    return gyro_attitude(run.samples, None, SITE, station(run, 0))


def between_stations(run: Run) -> Attitude:
    """From a station at the first sample to one at the last."""
    return continuous_survey(run.samples, station(run, 0), station(run, len(run.matrix) - 1), None, SITE)


def with_field(method: Callable[..., Attitude], bias: float | None = None) -> Callable[[Run], Attitude]:
    """A method of gyro, gravity and field, by its default settings but for the gyro's bias."""
    told = None if bias is None else InertialSettings(gyro_bias_sigma=bias)
    return lambda run: method(run.samples, told, SITE)


MEMS = float(np.radians(0.5))
SPEEDS = (0.0, 0.005, 0.02, 0.1, 0.2, 0.5, 1.0, 1.8)
METHODS_OF: dict[str, Callable[[Run], Attitude]] = {
    "filter": with_field(inertial_attitude),
    "smoother": with_field(smoothed_attitude),
    "gyro alone": gyro_alone,
    "between stations": between_stations,
}
TOLD = {"filter": with_field(inertial_attitude, MEMS), "smoother": with_field(smoothed_attitude, MEMS)}
UNTOLD = {name: METHODS_OF[name] for name in TOLD}
GYRO = {name: METHODS_OF[name] for name in ("gyro alone", "between stations")}
CASES: dict[str, tuple[Callable[[int], Run], dict[str, Callable[[Run], Attitude]]]] = {
    **{
        f"rests 40 s, turns {rate:g} deg/s": (
            lambda seed, rate=rate: measured(turning(rate, 40.0, 100.0), seed),
            METHODS_OF,
        )
        for rate in SPEEDS
    },
    "turns 0.2 deg/s from the start": (lambda seed: measured(turning(0.2, 0.0, 140.0), seed), METHODS_OF),
    "heave along the tool, 8 s": (
        lambda seed: measured(turning(0.1, 40.0, 100.0), seed, heave=0.1, along_tool=True),
        METHODS_OF,
    ),
    "heave along the tool, 15 s": (
        lambda seed: measured(turning(0.1, 40.0, 100.0), seed, heave=0.1, along_tool=True, period=15.0),
        METHODS_OF,
    ),
    "shaken to a restart": (
        lambda seed: measured(turning(0.2, 40.0, 100.0), seed, shaken=(60.0, 75.0)),
        METHODS_OF,
    ),
    "rests, gyro off by 0.5 deg/s, stated": (lambda seed: measured(turning(0.0, 140.0, 0.0), seed, bias=MEMS), TOLD),
    "the same, not stated": (lambda seed: measured(turning(0.0, 140.0, 0.0), seed, bias=MEMS), UNTOLD),
    "wireline, 1 m/s": (lambda seed: measured(wireline(), seed), GYRO),
    "wireline, heave": (lambda seed: measured(wireline(), seed, heave=0.1), GYRO),
}
"""Motion -> readings for a seed, and the methods that reduce them."""


def score(motion: str, method: str, found: list[tuple[Attitude, Run]]) -> dict:
    """Of all rows but those of the first five seconds; error, u, last and last_u (of the last rows) in degrees."""
    error, u, tilt, flagged, refused, last = [], [], [], [], [], []
    for rows, run in found:
        true = run.matrix[np.rint(rows.time / INTERVAL).astype(int)]
        late, good = rows.time > 5.0, ~rows.refused
        quaternion = np.where(good[:, None], rows.quaternion, [1.0, 0.0, 0.0, 0.0])
        e = rotation_log(dcm_from_quaternion(quaternion) @ np.swapaxes(true, 1, 2))
        down = true[:, :, 2]
        turned, spread = np.einsum("ki,ki->k", down, e), np.einsum("ki,kij,kj->k", down, rows.covariance, down)
        keep = late & good
        error.append(turned[keep])
        u.append(np.sqrt(spread[keep]))
        tilt.append(((rows.angles.inclination - np.arccos(true[:, 2, 2])) / rows.u.inclination)[keep])
        flagged.append((rows.flags[late] & sum(BITS[name] for name in FLAGGED)) != 0)
        refused.append(~good[late])
        last.append((turned[keep][-1], np.sqrt(spread[keep][-1])) if keep.any() else (np.nan, np.nan))
    e, s = np.concatenate(error), np.concatenate(u)

    def rms(values: Array) -> float:
        return float(np.degrees(np.sqrt(np.mean(np.square(values)))))

    ends = np.array(last)
    return {
        "motion": motion,
        "method": method,
        "error": rms(e),
        "u": rms(s),
        "z2": float(np.mean((e / s) ** 2)),
        "coverage": float(np.mean(np.abs(e) < 1.96 * s)),
        "inclination": float(np.mean(np.abs(np.concatenate(tilt)) < 1.96)),
        "flagged": float(np.mean(np.concatenate(flagged))),
        "refused": float(np.mean(np.concatenate(refused))),
        "last": rms(ends[:, 0]),
        "last_u": rms(ends[:, 1]),
    }


def run(runs: int = 8, only: str = "") -> list[dict]:
    """All motions whose name contains `only`."""
    rows = []
    for motion, (drawn, methods) in CASES.items():
        if only not in motion:
            continue
        records = [drawn(seed) for seed in range(runs)]
        rows += [score(motion, name, [(method(r), r) for r in records]) for name, method in methods.items()]
    return rows


def report(rows: list[dict]) -> None:
    """One line a motion and method."""
    names = ("error", "u", "z2", "cover", "incl.", "flagged", "refused", "last", "u last")
    print(f"{'motion':38}{'method':25}" + "".join(f"{name:>9}" for name in names))
    for motion, method, *values in map(dict.values, rows):
        print(f"{motion:38}{method:25}" + "".join(f"{value:9.3f}" for value in values))


if __name__ == "__main__":
    command(__doc__, run, report)

"""A simulated fleet: tools that drift, are shaken, heated, mounted and calibrated, and beside them what was true.

No public set of repeated calibrations of directional tools is known; the sizes of the drift are assumed, and are of the
size of the published one-sigma terms of magnetic tools.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import date, timedelta

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, within
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.history import DAYS_PER_YEAR, ToolHistory, tool_from_relative
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import BenchSimulation, Rig, simulate_bench
from inclinometry.simulate.tool import Seed, Streams
from inclinometry.uncertainty import symmetric_root

_FIELD = 50000.0  # nT
_MG = 1e-3  # one mg, of the full field


def drift_variance(
    accelerometer: tuple[float, float, float] = (0.3e-3 * STANDARD_GRAVITY, 2e-4, 1e-4),
    magnetometer: tuple[float, float, float] = (60.0, 4e-4, 1.5e-4),
    package: float = 2e-4,
    magnetometer_scale: float = 5e-4,
    field: float = _FIELD,
) -> Array:
    """Variance (24, 24) a year of the relative parameters, from standard deviations per square root of a year.

    accelerometer, magnetometer: offset of a sensor (m/s^2, nT), its own scale, each of its two tilts (rad). package:
    turn of all sensors about each tool axis, rad. magnetometer_scale is shared by all; field in nT.
    """
    found = np.zeros((24, 24))
    for place, (offset, scale, tilt), full in ((0, accelerometer, STANDARD_GRAVITY), (12, magnetometer, field)):
        block = np.full((3, 4), tilt**2)
        block[np.arange(3), np.arange(3)] = scale**2
        block[:, 3] = (offset / full) ** 2
        found[place : place + 12, place : place + 12] = np.diag(block.ravel())
    for axis in range(3):
        turned = np.tile(_turn(axis).ravel(), 2)
        found += package**2 * np.outer(turned, turned)
    common = np.zeros((3, 4))
    common[np.arange(3), np.arange(3)] = 1.0
    shared = np.concatenate([np.zeros(12), common.ravel()])
    return found + magnetometer_scale**2 * np.outer(shared, shared)


def _turn(axis: int) -> Array:
    """Change (3, 4) of E and o of a triad turned by a small angle about an axis of the tool."""
    found = np.zeros((3, 4))
    after, last = (axis + 1) % 3, (axis + 2) % 3
    found[after, last], found[last, after] = 1.0, -1.0
    return found


def mounting_variance(size: float = 1.0) -> Array:
    """Reproducibility (24, 24) between mountings: what moves when a tool is taken down and put up again.

    An offset of 0.1 mg and 22 nT a sensor, 1e-4 of scale and tilt, 1.8e-4 rad of the package about each axis and 1e-3
    about the tool's, all times `size`.
    """
    found = drift_variance((0.1 * _MG * STANDARD_GRAVITY, 1e-4, 1e-4), (22.0, 1e-4, 1e-4), 1.8e-4, 0.0)
    turned = np.tile(_turn(2).ravel(), 2)
    return np.asarray(size**2 * (found + 1e-6 * np.outer(turned, turned)))


def shock_and_heat() -> Array:
    """Effects (24, 2) of one dose of shock and of one hot hour on the relative parameters.

    A shock moves the x and y magnetometers by +60 and -40 nT and the z accelerometer by 0.25 mg, an hour of heat all
    magnetometer scales by -6e-6.
    """
    found = np.zeros((24, 2))
    found[[15, 19, 11], 0] = 60.0 / _FIELD, -40.0 / _FIELD, 0.25 * _MG
    found[[12, 17, 22], 1] = -6e-6
    return found


@dataclass(frozen=True, eq=False)
class FleetScene:
    """How a fleet ages and is calibrated: covariance V of a certificate, drift Q, mounting R, effects B of doses.

    gap, last_gap : years between calibrations, uniform, and before the last. freedom : of Student's t for all errors.
    multiplier_sd : of the logarithm of a tool's drift variance. hours : of operation a year.
    doses : mean shock doses and hot hours a year; a tool's own are log-normal about them with a factor of 2.
    rig_error, jumps : rig number, or (tool, calibration) before which it happens -> (24,) added.
    """

    tools: int
    covariance: Array
    calibrations: int = 7
    drift: Array = field(default_factory=drift_variance)
    mounting: Array = field(default_factory=lambda: np.zeros((24, 24)))
    effects: Array = field(default_factory=lambda: np.zeros((24, 2)))
    gap: tuple[float, float] = (0.3, 1.0)
    last_gap: float = 0.5
    multiplier_sd: float = 0.0
    doses: tuple[float, float] = (0.0, 0.0)
    hours: float = 1000.0
    freedom: float | None = None
    rigs: int = 1
    rig_error: dict[int, ArrayLike] = field(default_factory=dict)
    jumps: dict[tuple[int, int], ArrayLike] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FleetSimulation:
    """A simulated fleet.

    histories : one a tool.
    truth : (tools, calibrations, 24) relative parameters at each calibration, mounting errors not in them.
    multipliers : (tools,) drift variance of each in units of the type's.
    """

    histories: Sequence[ToolHistory]
    truth: Array
    multipliers: Array


def simulate_fleet(
    scene: FleetScene, *, type: str = "simulated", first: date = date(2020, 1, 1), seed: Seed
) -> FleetSimulation:
    """Histories of a fleet; the first calibrations lie within a year about `first`."""
    n, most, p = scene.tools, scene.calibrations, 24
    certificate = finite(scene.covariance, "covariance", (p, p))
    for tool, number in scene.jumps:
        within(tool, "jumps: tool", 0, n - 1)
        within(number, "jumps: calibration", 1, most - 1)
    streams = Streams(seed, "fleet")

    def draw(name: str, root: Array, shape: tuple[int, ...]) -> Array:
        random = streams[name]
        white = random.standard_normal((*shape, p))
        if scene.freedom is not None:  # of unit variance all the same
            chi = random.chisquare(scene.freedom, shape) / (scene.freedom - 2.0)
            white /= np.sqrt(chi)[..., None]
        return np.asarray(white @ root.T)

    gaps = streams["gap"].uniform(*scene.gap, (n, most - 1))
    gaps[:, -1] = scene.last_gap
    start = streams["start"].uniform(0.0, 1.0, n)
    days = np.rint(DAYS_PER_YEAR * (start[:, None] + np.cumsum(np.column_stack([np.zeros(n), gaps]), axis=1))).astype(
        int
    )
    tau = np.diff(days, axis=1) / DAYS_PER_YEAR
    multipliers = np.exp(scene.multiplier_sd * streams["multiplier"].standard_normal(n))
    rough = np.exp(np.log(2.0) * streams["rough"].standard_normal((n, 2)))
    doses = streams["doses"].poisson(np.array(scene.doses) * rough[:, None] * tau[..., None]).astype(float)
    hours = scene.hours * rough[:, :1] * tau
    steps = np.sqrt(multipliers[:, None] * tau)[..., None] * draw("drift", symmetric_root(scene.drift), (n, most - 1))
    steps += doses @ scene.effects.T
    for (tool, number), change in scene.jumps.items():
        steps[tool, number - 1] += np.asarray(change)
    made = draw("made", np.diag(np.tile([1e-2] * 3 + [5e-3], 6)), (n,))
    truth = made[:, None] + np.concatenate([np.zeros((n, 1, p)), np.cumsum(steps, axis=1)], axis=1)
    found = (
        truth
        + draw("certificate", symmetric_root(certificate), (n, most))
        + draw("mounting", symmetric_root(scene.mounting), (n, most))
    )
    rigs = streams["rig"].integers(0, scene.rigs, (n, most))
    for number, error in scene.rig_error.items():
        found += np.where((rigs == number)[..., None], np.asarray(error), 0.0)
    blank = np.zeros((n, 1))
    histories = [
        ToolHistory(
            f"SIM-{i + 1:04d}",
            type,
            [first + timedelta(days=int(day)) for day in days[i]],
            found[i],
            np.broadcast_to(certificate, (most, p, p)),
            np.concatenate([blank[i], hours[i]]),
            np.concatenate([blank[i], doses[i, :, 0]]),
            np.concatenate([blank[i], doses[i, :, 1]]),
            [f"rig {r + 1}" for r in rigs[i]],
        )
        for i in range(n)
    ]
    return FleetSimulation(histories, truth, multipliers)


def simulate_calibrations(
    tool: Tool, truth: ArrayLike, rig: Rig, settings: ArrayLike, *, bits: int | None = None, seed: Seed
) -> list[BenchSimulation]:
    """Bench readings of one tool at each calibration; truth (K, 24) relative to `tool`, mounting errors added."""
    azimuth, inclination, toolface = finite(settings, "settings", (3,)).T
    streams = Streams(seed, "calibrations")
    return [
        simulate_bench(
            tool_from_relative(tool, values, np.zeros((24, 24))), rig, azimuth, inclination, toolface,
            bits=bits, seed=streams[str(number)],
        )
        for number, values in enumerate(finite(truth, "truth", (24,)))
    ]  # fmt: skip

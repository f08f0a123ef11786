"""How long a gyro inclinometer has to stand still for a wanted uncertainty of azimuth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inclinometry.allan import FLAT
from inclinometry.arrays import Array, Mask, frozen, within
from inclinometry.constants import EARTH_RATE
from inclinometry.errors import not_among, out_of_range, refused
from inclinometry.findings import Finding
from inclinometry.gyro.closed_form import expected_rates
from inclinometry.tabular import Column, Tabular, degrees, in_degrees
from inclinometry.uncertainty import UNKNOWN

VERTICAL = float(np.radians(1.0))
"""Inclination nearer to the vertical than which azimuth is no use and the gyro toolface is planned for, rad."""
LONGEST = 86400.0
"""A standstill, s, longer than which is not planned: no gyro's bias is worth that trust."""
AZIMUTHS = 720
"""Azimuths over which best, median and worst are looked for."""


@dataclass(frozen=True)
class GyroSetup:
    """What the azimuth depends on besides place and attitude; rates in rad/s, angles in rad."""

    arw: float  #: angle random walk N of one gyro, rad/sqrt(s)
    bias_instability: float = 0.0  #: B; what flicker leaves in the mean over the index positions, whatever the time
    scale_sd: float = 0.003  #: prior relative standard uncertainty of the scale factor
    gyros: int = 2  #: 1 or 2 across the tool
    axes: int = 2  #: 2, or 3 with a gyro along the tool, whose bias no turn about the tool axis removes
    axial_bias_sd: float = 0.0  #: of that bias after calibration
    tilt_sd: float = 0.0  #: of the level by the accelerometers (their standard uncertainty over gravity)
    positions: Sequence[float] = (0.0, np.pi / 2.0, np.pi, 1.5 * np.pi)  #: index angles visited in turn for equal times

    def __post_init__(self) -> None:
        limits = {"arw": 0.1, "bias_instability": 0.1, "scale_sd": 1.0, "axial_bias_sd": 0.1, "tilt_sd": 0.5}
        for name, high in limits.items():
            within(getattr(self, name), name, 0.0, high)
        if self.arw == 0.0:
            raise out_of_range("arw", 0.0, "> 0")
        for name, allowed in (("gyros", (1, 2)), ("axes", (2, 3))):
            if getattr(self, name) not in allowed:
                raise not_among(name, str(getattr(self, name)), map(str, allowed))
        if np.linalg.matrix_rank(_functions(self.positions), tol=1e-6) < 3:
            raise refused("gyro-positions-alike", {"index_deg": tuple(map(float, np.degrees(self.positions)))})


@dataclass(frozen=True, eq=False, repr=False)
class StandstillPlan(Tabular):
    """Time of standing still for a wanted azimuth, over azimuths of the hole."""

    azimuth: Array  #: (n,) rad
    time: Array  #: (n,) s on all index positions together; infinite where a day is not enough
    floor: Array  #: (n,) standard uncertainty of azimuth that is left after any time, rad
    moving: float  #: s spent between index positions, not in `time`
    wanted: float  #: standard uncertainty, rad
    findings: tuple[Finding, ...]  #: what limits the azimuth and what would help

    def at(self, share: float) -> int:
        """Row of the azimuth at a share of the order of times: 0 the best, 0.5 the median, 1 the worst."""
        order = np.lexsort((self.floor, self.time))
        return int(order[round(share * (len(order) - 1))])

    def to_dict(self) -> dict[str, Column]:
        """One row an azimuth: the time to stand still, and the uncertainty that any time leaves."""
        return {**in_degrees(self, "azimuth"), "time_s": self.time, "floor_deg": degrees(self.floor)}


def standstill_time(
    latitude: float,
    inclination: float,
    azimuth_sd: float,
    setup: GyroSetup,
    *,
    azimuth: float | None = None,
    move_time: float = 0.0,
) -> StandstillPlan:
    """Time of standing still for `azimuth_sd`; all round without `azimuth`, gyro toolface within 1 deg of the vertical.

    The joint estimate's Fisher information. One gyro across, turned to three or more even positions in total time T,
    gives each cross-axis rate sigma = N sqrt(2/T), two give N / sqrt(T). With D the squared areas |E x dE/dpsi| and
    r = sigma^2 / scale_sd^2: var(psi) = sigma^2 (|E|^2 + r) / (D + r |dE/dpsi|^2). Level, one gyro, scale known:
    sigma_psi = sqrt(2) N / (sqrt(T) we cos(latitude)).
    """
    place = float(within(latitude, "latitude", -np.pi / 2.0, np.pi / 2.0, "rad"))
    if abs(place) > np.radians(89.9):
        raise out_of_range("latitude", float(np.degrees(place)), "-89.9 .. 89.9 deg")
    lean = float(within(inclination, "inclination", 0.0, np.pi, "rad"))
    wanted = float(within(azimuth_sd, "azimuth_sd", 0.0, UNKNOWN, "rad"))
    if wanted == 0.0:
        raise out_of_range("azimuth_sd", 0.0, "> 0")
    moving = float(within(move_time, "move_time", 0.0, 1e6, "s")) * (len(setup.positions) - 1)
    rows = np.linspace(0.0, 2.0 * np.pi, AZIMUTHS, endpoint=False)
    if azimuth is not None:
        rows = np.array([float(within(azimuth, "azimuth", -2.0 * np.pi, 2.0 * np.pi, "rad"))])
    # s, that have left nothing of white noise
    floor = azimuth_sigma(place, lean, rows, 1e12, setup)
    # bisection in the logarithm of time, every azimuth at once; infinite where a day is not enough
    low, high = np.full(len(rows), -18.0), np.full(len(rows), np.log(LONGEST))
    possible = azimuth_sigma(place, lean, rows, LONGEST, setup) <= wanted
    for _ in range(60):
        middle = (low + high) / 2.0
        enough = azimuth_sigma(place, lean, rows, np.exp(middle), setup) <= wanted
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    time = np.where(possible, np.exp(high), np.inf)
    found = []
    if np.sin(lean) < np.sin(VERTICAL):
        found.append(Finding("gyro-plan-vertical"))
    if setup.axes == 3 and setup.axial_bias_sd == 0.0:
        found.append(Finding("gyro-plan-axial"))
    found += _remedies(place, lean, rows, wanted, setup)
    return StandstillPlan(frozen(rows), frozen(time), frozen(floor), moving, wanted, tuple(found))


def azimuth_sigma(latitude: float, inclination: float, azimuth: Array, time: float | Array, setup: GyroSetup) -> Array:
    """Standard uncertainty of azimuth (n,), rad, after standing still for `time` s, (n,) or one; angles in rad.

    Within 1 deg of the vertical that of the gyro toolface. Never more than that of an unknown angle.
    """
    cross, axial = _rate_variances(setup, np.asarray(time, dtype=np.float64))
    vertical = np.sin(inclination) < np.sin(VERTICAL)
    # a hair off the vertical, where toolface alone is undefined and its sum with azimuth is not
    inclination = float(np.clip(inclination, 1e-6, np.pi - 1e-6))
    whole = np.stack(expected_rates(azimuth, inclination, latitude))
    e = whole[: setup.axes]
    level = np.cos(latitude)
    slope = np.stack(
        [-level * np.sin(azimuth) * np.cos(inclination), -level * np.cos(azimuth),
         -level * np.sin(azimuth) * np.sin(inclination)]
    )[: setup.axes]  # fmt: skip
    # rates across the tool have weight 1, the one along it less or more
    weight = np.ones((setup.axes, len(azimuth)))
    if setup.axes == 3:
        weight[2] = cross / axial
    length, steep = (weight * e**2).sum(axis=0), (weight * slope**2).sum(axis=0)
    area = sum(
        weight[i] * weight[j] * (e[i] * slope[j] - e[j] * slope[i]) ** 2
        for i in range(setup.axes)
        for j in range(i + 1, setup.axes)
    )
    prior = cross / max(setup.scale_sd, 1e-12) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = area + prior * steep
        variance = cross * (length + prior) / spread
        gain = weight * ((length + prior) * slope - (weight * e * slope).sum(axis=0) * e) / spread
        variance = variance + setup.tilt_sd**2 * _tilt_gain(gain, whole, inclination, vertical)
    known = np.isfinite(variance)
    return np.asarray(np.minimum(np.sqrt(np.where(known, variance, np.inf)), UNKNOWN))


def _functions(positions: Sequence[float]) -> Array:
    beta = np.asarray(positions, dtype=np.float64)
    return np.stack([np.cos(beta), np.sin(beta), np.ones_like(beta)], axis=1)


def _rate_variances(setup: GyroSetup, time: Array) -> tuple[Array, Array]:
    """Variances of a cross-axis rate and of the axial one, in squared Earth rates.

    The variance of flicker in a weighted mean of contiguous means follows from its generalised covariance
    t^2 ln|t| / (2 pi) between the ends of the positions; it depends on the order of positions, not on the time.
    """
    weights = np.linalg.pinv(_functions(setup.positions))[:2]
    number = len(setup.positions)
    ends = np.abs(np.subtract.outer(np.arange(number + 1.0), np.arange(number + 1.0)))
    general = ends**2 * np.log(np.where(ends > 0.0, ends, 1.0)) / (2.0 * np.pi)
    steps = -np.diff(np.pad(weights, ((0, 0), (1, 1))), axis=1)
    # mean over the directions of x and y, because the toolface is not planned; a second gyro halves everything
    flicker = float(np.einsum("ai,ij,aj->", steps, general, steps)) / 2.0
    white = float((weights**2).sum()) / 2.0 * number
    share = setup.arw**2 / time
    cross = (share * white + setup.bias_instability**2 * flicker) / setup.gyros
    axial = share + (FLAT * setup.bias_instability) ** 2 + setup.axial_bias_sd**2
    return cross / EARTH_RATE**2, axial / EARTH_RATE**2


def _tilt_gain(gain: Array, earth: Array, inclination: float, vertical: bool) -> Array:
    """Variance (n,) of azimuth for a unit of the level's: inclination errs by 1, toolface by 1 / sin inclination.

    gain : (axes, n) of azimuth by the rates.
    earth : (3, n) X, Y, Z; d/d inclination is (-Z, 0, X), and an error of toolface turns the rates across the tool.
    """
    x, y, z = earth
    by_inclination = np.stack([z, 0.0 * y, -x])[: len(gain)]
    by_toolface = np.stack([-y, x, 0.0 * y])[: len(gain)]
    turned = (gain * by_toolface).sum(axis=0)
    if vertical:
        turned = turned + np.sign(np.cos(inclination))
    return np.asarray((gain * by_inclination).sum(axis=0) ** 2 + (turned / np.sin(inclination)) ** 2)


def _remedies(latitude: float, inclination: float, azimuth: Array, wanted: float, setup: GyroSetup) -> list[Finding]:
    """Where no time is enough: how often, and which single improvement would do."""

    def left(other: GyroSetup, rows: Array) -> Mask:
        return np.asarray(azimuth_sigma(latitude, inclination, rows, LONGEST, other) > wanted)

    lost = left(setup, azimuth)
    if not lost.any():
        return []
    better = {
        "scale factor ten times better known": replace(setup, scale_sd=setup.scale_sd / 10.0),
        "third gyro, along the tool": replace(setup, axes=3),
        "quarter of the angle random walk": replace(setup, arw=setup.arw / 4.0),
        "half the bias instability": replace(setup, bias_instability=setup.bias_instability / 2.0),
        "half the error of the level": replace(setup, tilt_sd=setup.tilt_sd / 2.0),
    }
    still = {what: left(other, azimuth[lost]).mean() for what, other in better.items() if other != setup}
    full = tuple(what for what, share in still.items() if share == 0.0)
    part = tuple(what for what, share in still.items() if 0.0 < share < 0.5)
    share = 100.0 * float(lost.mean())
    return [Finding("gyro-plan-limit", {"share_percent": share, "enough": full, "helpful": part})]

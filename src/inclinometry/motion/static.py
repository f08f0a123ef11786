"""Attitude of a tool at rest, window by window: mean gravity with the mean field or with the Earth rate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.site import Site
from inclinometry.errors import out_of_range, refused
from inclinometry.motion.reference import COVERAGE, departure, dip_sigma, referenced, strength_sigma
from inclinometry.motion.result import BITS, METHODS, Attitude, Samples, refusals
from inclinometry.motion.window_filter import WindowStream
from inclinometry.motion.window_smoother import batch_means, covariance_of_mean, rounding_variance
from inclinometry.orientation import dip_angle, dip_jacobian, inclination_toolface
from inclinometry.rotations import cross_matrix, dcm, quaternion_from_dcm, rotation_exp
from inclinometry.settings import Range, Settings
from inclinometry.tabular import check_record
from inclinometry.uncertainty import UNKNOWN
from inclinometry.wahba import VectorAttitude, solve_davenport, solve_svd, solve_triad

# One window of a still tool: means, their covariance, the attitude, and whether it may be believed.


@dataclass(frozen=True)
class Limits:
    """Settings, references and which triad tells north."""

    settings: StaticSettings
    site: Site | None
    north: str  #: "mag" or "gyro"
    method: str = "static"

    def of(self, name: str, what: str) -> float:
        """Setting of a triad: `what` is "sigma" or "resolution"."""
        return float(getattr(self.settings, f"{name}_{what}"))

    def sigma(self, name: str) -> Array:
        """Standard deviations (3,) of what calibration left."""
        across = self.of(name, "sigma")
        axial = getattr(self.settings, f"{name}_axial_sigma", None)
        return np.array([across, across, across if axial is None else axial])


class Mean(NamedTuple):
    """Mean of a triad, its batch means, the covariance of the mean by rounding and calibration, and its life.

    life : "all" channels change, "never" does one, or "one" does not while the others take five values and more.
    """

    value: Array  #: (3,)
    batches: Array  #: (b, 3)
    fixed: Array  #: (3, 3)
    life: str

    @property
    def sigma(self) -> float:
        """Standard uncertainty of the mean's direction, rad."""
        own = covariance_of_mean(self.batches) + self.fixed
        return max(float(np.sqrt(np.trace(own) / 3.0) / np.linalg.norm(self.value)), 1e-12)


class Solution(NamedTuple):
    """Attitude (3, 3), how e follows the two vectors (3, 6), and its covariance by the reference dip (3, 3)."""

    matrix: Array
    response: Array
    reference: Array


Solve = Callable[[Mean, Mean, Limits], Solution]


def by_triad(g: Mean, b: Mean, limits: Limits) -> Solution:
    """Gravity as it is; the field tells azimuth only, its dip does not count."""
    pair = np.stack([g.value, b.value])
    found = solve_triad(pair, _directions(float(dip_angle(g.value, b.value))), [g.sigma, b.sigma])
    north, east, down = found.dcm.T
    per_g = 1.0 / np.linalg.norm(g.value)
    ratio = (down @ b.value) / (north @ b.value)
    by_g = per_g * (cross_matrix(down) - ratio * np.outer(down, east))
    return Solution(found.dcm, np.hstack([by_g, np.outer(down, east) / (north @ b.value)]), np.zeros((3, 3)))


def by_davenport(g: Mean, b: Mean, limits: Limits) -> Solution:
    """Both weighted; see `_weighted`."""
    return _weighted(g, b, limits, solve_davenport)


def by_svd(g: Mean, b: Mean, limits: Limits) -> Solution:
    """Both weighted; see `_weighted`."""
    return _weighted(g, b, limits, solve_svd)


def _weighted(
    g: Mean, b: Mean, limits: Limits, solve: Callable[[ArrayLike, ArrayLike, ArrayLike], VectorAttitude]
) -> Solution:
    """Wahba's solution with the site's dip; where it states none the dip is measured, which leaves TRIAD's response.

    e = P sum w x dw / s^2 with P the solution's own covariance and dw the errors of the directions w.
    """
    dip, spread = _dip_reference(limits)
    if dip is None:
        simple = by_triad(g, b, limits)
        found = solve(np.stack([g.value, b.value]), _directions(float(dip_angle(g.value, b.value))), [g.sigma, b.sigma])
        return simple._replace(matrix=found.dcm)
    sigmas = [g.sigma, float(np.hypot(b.sigma, spread))]
    found = solve(np.stack([g.value, b.value]), _directions(dip), sigmas)
    blocks = []
    for mean, sigma in zip((g, b), sigmas, strict=True):
        length = float(np.linalg.norm(mean.value))
        blocks.append(found.covariance @ cross_matrix(mean.value / length) / (sigma**2 * length))
    slope = found.dcm @ np.array([-np.sin(dip), 0.0, np.cos(dip)])
    column = blocks[1] @ slope * np.linalg.norm(b.value) * spread
    return Solution(found.dcm, np.hstack(blocks), np.outer(column, column))


def reduce_window(window: Samples, limits: Limits, solve: Solve) -> Attitude:
    """One row."""
    settings = limits.settings
    window.need("accel", *(("gyro",) if limits.north == "gyro" else ()))
    time = float(window.time[0] + 0.5 * window.interval * (len(window) - 1))
    name = "magnetic" if limits.north == "mag" else "true"
    used = np.ones(len(window), np.bool_) if window.clipped is None else np.logical_not(window.clipped)
    share = 1.0 - float(used.mean())
    if share > settings.most_clipped:
        return refusals([time], ["clipped"], limits.method, name)
    if used.sum() < 2 * settings.batches:
        raise refused("input-few", {"name": "samples", "count": int(used.sum()), "least": 2 * settings.batches})
    g = _mean(window, "accel", used, limits)
    second = _mean(window, limits.north, used, limits) if window.has(limits.north) else None
    flags = {"clipped"} if share > 0.0 else set()
    flags |= {"stuck"} if "never" in (g.life, second.life if second else "") else set()
    if "one" in (g.life, second.life if second else ""):
        return refusals([time], sorted({*flags, "stuck"}), limits.method, name)
    solution, unknown = _solve(g, second, limits, solve, flags)
    if solution is None:
        return refusals([time], sorted({*flags, "misfit"}), limits.method, name)
    told = {} if second is None or unknown else _references(g, second, limits)
    seen: tuple[Array, Array, Array] | None = None
    if second is not None and not unknown and limits.north == "mag":
        noise = np.zeros((6, 6))
        noise[:3, :3], noise[3:, 3:] = covariance_of_mean(g.batches), covariance_of_mean(second.batches)
        extra, far = departure(g.value, second.value, _fixed(g, second) + noise, limits.site)
        if far:
            return refusals([time], sorted({*flags, "axes", "disturbed"}), limits.method, name)
        second = second._replace(fixed=second.fixed + extra**2 * np.eye(3))
        fixed = _fixed(g, second)
        # both weighted have had the site's dip already
        if not extra and limits.site is not None and limits.method == "static":
            seen = referenced(g.value, second.value, fixed + noise, fixed, limits.site, settings.mag_scale_sigma)
    errors = _batch_errors(g, second, solution)
    shake = float(np.sqrt(np.mean(np.sum((np.asarray(window.accel)[used] - g.value) ** 2, axis=1))))
    rate = _rate(window, used, errors)
    # largest departure of a quarter of the window from its mean, rad
    quarters = batch_means(errors if limits.north == "mag" else _batch_errors(g, None, solution), 4)
    turned = float(np.linalg.norm(quarters - quarters.mean(axis=0), axis=1).max())
    if turned > settings.most_turn:
        return refusals([time], sorted({*flags, "not-still"}), limits.method, name)
    ratios = {
        "vibration": shake / settings.shake,
        "not-still": max(turned / settings.turn, abs(rate) / settings.spin),
        **told,
    }
    flags |= {what for what, ratio in ratios.items() if ratio > 1.0}
    spread = solution.response @ _fixed(g, second) @ solution.response.T
    total = covariance_of_mean(errors) + spread + solution.reference
    down = solution.matrix[:, 2]
    total = total + (2.0 * UNKNOWN**2 * np.outer(down, down) if unknown else 0.0)
    covariance = np.asarray(0.5 * (total + total.T))
    common, matrix = covariance if unknown else spread + solution.reference, solution.matrix
    if seen is not None:
        matrix = rotation_exp(solution.response @ seen[0]) @ matrix
        covariance, common = (solution.response @ part @ solution.response.T for part in seen[1:])
    return _row(time, matrix, (covariance, common), rate, max(ratios.values()), flags, limits)


def _mean(window: Samples, name: str, used: Mask, limits: Limits) -> Mean:
    values = getattr(window, name)[used]
    fixed = rounding_variance(values, limits.of(name, "resolution")) + limits.sigma(name) ** 2
    distinct = sorted(np.unique(column).size for column in values.T)
    # five distinct values of its neighbours: noise that wide reaches two codes
    life = "never" if distinct[2] == 1 else ("one" if distinct[0] == 1 and distinct[1] >= 5 else "all")
    return Mean(values.mean(axis=0), batch_means(values, limits.settings.batches), np.diag(fixed), life)


def _solve(g: Mean, second: Mean | None, limits: Limits, solve: Solve, flags: set[str]) -> tuple[Solution | None, bool]:
    """The attitude, and whether its azimuth is unknown; None when gravity itself is missing."""
    if np.linalg.norm(g.value) < 1e-6:
        return None, True
    if second is not None:
        sine = np.linalg.norm(np.cross(g.value, second.value))
        # below this the field tells no azimuth
        if sine > 1e-3 * np.linalg.norm(g.value) * np.linalg.norm(second.value):
            return solve(g, second, limits), False
    flags |= {"no-field", "unobservable"} if limits.north == "mag" else {"unobservable"}
    inclination, toolface = inclination_toolface(g.value)
    matrix = dcm(0.0, inclination, toolface)
    by_g = cross_matrix(matrix[:, 2]) / np.linalg.norm(g.value)
    return Solution(matrix, np.hstack([by_g, np.zeros((3, 3))]), np.zeros((3, 3))), True


def _batch_errors(g: Mean, second: Mean | None, solution: Solution) -> Array:
    """Each batch's departure from the window, as a rotation vector (b, 3)."""
    parts = [g.batches - g.value, np.zeros_like(g.batches) if second is None else second.batches - second.value]
    return np.asarray(np.hstack(parts) @ solution.response.T)


def _fixed(g: Mean, second: Mean | None) -> Array:
    """Covariance (6, 6) of the two means by rounding and calibration."""
    fixed = np.zeros((6, 6))
    fixed[:3, :3] = g.fixed
    if second is not None:
        fixed[3:, 3:] = second.fixed
    return fixed


def _rate(window: Samples, used: Mask, errors: Array) -> float:
    """Mean speed about the tool axis: measured, else the slope of the batches (e grows against the rotation)."""
    if window.gyro is not None:
        return float(window.gyro[used, 2].mean())
    place = np.arange(len(errors)) - 0.5 * (len(errors) - 1)
    seconds = window.interval * len(window) / len(errors)
    return float(-(place @ errors[:, 2]) / (place @ place) / seconds)


def _references(g: Mean, second: Mean, limits: Limits) -> dict[str, float]:
    """How far strength and dip are off their references, over what is allowed."""
    u = covariance_of_mean(second.batches) + second.fixed
    direction = second.value / np.linalg.norm(second.value)
    u_strength = float(np.sqrt(direction @ u @ direction))
    slopes = dip_jacobian(g.value, second.value)
    u_dip = float(
        np.sqrt(slopes[:3] @ (covariance_of_mean(g.batches) + g.fixed) @ slopes[:3] + slopes[3:] @ u @ slopes[3:])
    )
    # strength of the second vector, its standard deviation, and the flag of a miss
    if limits.north == "gyro":
        strength, spread, flag = (None if limits.site is None else EARTH_RATE), 0.0, "misfit"
    elif limits.site is None:
        strength, spread, flag = None, 0.0, "disturbed"
    else:
        strength, spread, flag = limits.site.b, strength_sigma(limits.site), "disturbed"
    dip, dip_spread = _dip_reference(limits)
    found = 0.0
    if strength is not None:
        found = abs(float(np.linalg.norm(second.value)) - strength) / (COVERAGE * float(np.hypot(u_strength, spread)))
    if dip is not None:
        off = abs(float(dip_angle(g.value, second.value)) - dip)
        found = max(found, off / (COVERAGE * float(np.hypot(u_dip, dip_spread))))
    return {flag: found}


def _dip_reference(limits: Limits) -> tuple[float | None, float]:
    """Dip of the second vector, rad, and its standard deviation."""
    site = limits.site
    if site is None:
        return None, 0.0
    if limits.north == "gyro":
        return (None if site.latitude is None else -site.latitude), site.latitude_sigma or 0.0
    return site.dip, dip_sigma(site)


def _directions(dip: float) -> Array:
    """Down, and the second vector's direction (2, 3) in north-east-down."""
    return np.array([[0.0, 0.0, 1.0], [np.cos(dip), 0.0, np.sin(dip)]])


def _row(
    time: float,
    matrix: Array,
    covariance: tuple[Array, Array],
    rate: float,
    worst: float,
    flags: set[str],
    limits: Limits,
) -> Attitude:
    """`covariance` is the whole one, and what the windows of a run have in common of it."""
    row = Attitude(
        time=np.array([time]),
        quaternion=quaternion_from_dcm(matrix)[None],
        covariance=covariance[0][None],
        common=covariance[1][None],
        rate=np.array([rate]),
        quality=np.array([max(1.0 - worst, 0.0)]),
        flags=np.array([sum(BITS[flag] for flag in flags)], dtype=np.uint32),
        method=np.array([METHODS.index(limits.method)], dtype=np.uint8),
        north="magnetic" if limits.north == "mag" else "true",
    )
    # rad, of azimuth, beyond which a steep tool is called vertical
    if row.u.azimuth[0] > 0.1 and "unobservable" not in flags and abs(matrix[2, 2]) > np.cos(0.1):
        row.flags[0] |= BITS["vertical"]
    return row


@dataclass(frozen=True, kw_only=True)
class StaticSettings(Settings):
    """What a window of a tool at rest is, and when it is not believed."""

    window: Annotated[float, Range(1e-3, 86400.0, "s"), "Length of a window."] = 10.0
    batches: Annotated[int, Range(8, 1000), "Parts of a window whose means tell the uncertainty of its mean."] = 16
    shake: Annotated[float, Range(1e-6, 1e3, "m/s^2"), 'Rms of the acceleration; beyond it "vibration".'] = 0.5
    turn: Annotated[float, Range(1e-6, np.pi, "rad"), 'A quarter window from the whole; beyond it "not-still".'] = (
        float(np.radians(0.2))
    )
    most_turn: Annotated[float, Range(1e-6, np.pi, "rad"), "The same; beyond it refused."] = float(np.radians(2.0))
    spin: Annotated[float, Range(1e-9, 100.0, "rad/s"), 'Mean speed; beyond it "not-still".'] = float(np.radians(1.0))
    most_clipped: Annotated[float, Range(0.0, 0.5), "Share of clipped samples beyond which it is refused."] = 0.02
    accel_sigma: Annotated[float, Range(0.0, 1.0, "m/s^2"), "What calibration left on each axis."] = 0.0
    mag_sigma: Annotated[float, Range(0.0, 1e5, "nT"), "The same of the magnetometer."] = 0.0
    mag_scale_sigma: Annotated[
        float, Range(0.0, 0.1), "Of each scale error and coupling, where the site is compared with the field."
    ] = 3e-3
    mag_axial_sigma: Annotated[float | None, Range(0.0, 1e5, "nT"), "Along the tool, where another than across."] = None
    gyro_sigma: Annotated[float, Range(0.0, 1e-2, "rad/s"), "The same of the gyro."] = float(np.radians(0.1 / 3600.0))
    accel_resolution: Annotated[float, Range(0.0, 1.0, "m/s^2"), 'Step of "stuck" readings.'] = 0.01
    mag_resolution: Annotated[float, Range(0.0, 1e4, "nT"), "The same of the magnetometer."] = 10.0
    gyro_resolution: Annotated[float, Range(0.0, 1e-2, "rad/s"), "The same of the gyro."] = 1e-5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.turn > self.most_turn:
            raise out_of_range("turn", float(self.turn), f"<= {self.most_turn:g} (most_turn)")


class StaticStream(WindowStream):
    """`static_attitude`, or `static_davenport` where `weighted`, fed block by block; the same rows to the last bit."""

    def __init__(
        self, settings: StaticSettings | None = None, site: Site | None = None, *, weighted: bool = False
    ) -> None:
        super().__init__(*_parts(settings, site, "mag", by_davenport if weighted else by_triad))


class NorthSeekingStream(WindowStream):
    """`north_seeking_attitude` fed block by block, the same rows to the last bit; by Davenport's q where `weighted`."""

    def __init__(
        self, settings: StaticSettings | None = None, site: Site | None = None, *, weighted: bool = False
    ) -> None:
        super().__init__(*_parts(settings, site, "gyro", by_davenport if weighted else by_triad))


def static_attitude(samples: Samples, settings: StaticSettings | None = None, site: Site | None = None) -> Attitude:
    """Attitude of a still tool from mean gravity and mean magnetic field, by TRIAD: gravity is taken as it is.

    Parameters
    ----------
    samples : Samples
        With `accel`; without `mag`, inclination and toolface are found and azimuth is stated as unknown.
    settings : StaticSettings, optional
    site : Site, optional
        Its strength and dip, where given, are what the field is compared with.

    Returns
    -------
    Attitude
        A row a window, and one for the rest when it fills half a window; north "magnetic". The covariance is that of
        the window's own mean: noise with its correlation up to a batch, rounding, and the `*_sigma` of the settings.
        A magnetic disturbance that no reference shows is not in it.

    Raises
    ------
    InputError
        No accelerometer, or windows of fewer samples than two a batch.

    Notes
    -----
    Small errors of gravity g and field b turn the triad north, east, down by
    e = d x dg/|g| + d [east.db - (b_down/|g|) east.dg] / b_north (`angles_jacobian`); the batches' deviations are
    turned into e first, and their long-run covariance is taken there (`covariance_of_mean`).

    Examples
    --------
    >>> from inclinometry.orientation import fields
    >>> g, b = fields(np.radians(60.0), np.radians(30.0), np.radians(100.0), np.radians(65.0))
    >>> noise = np.random.default_rng(0)
    >>> still = Samples(np.arange(1000) / 100.0, 0.01, accel=9.81 * g + noise.normal(0, 0.03, (1000, 3)),
    ...                 mag=50e3 * b + noise.normal(0, 50, (1000, 3)))
    >>> rows = static_attitude(still)
    >>> [float(np.degrees(x[0]).round(2)) for x in rows.angles[:3]]
    [30.0, 60.0, 99.96]
    """
    check_record(samples, Samples, "static_attitude")
    return StaticStream(settings, site).whole(samples)


def static_davenport(samples: Samples, settings: StaticSettings | None = None, site: Site | None = None) -> Attitude:
    """As `static_attitude`, by Davenport's q: gravity and field weighted by their uncertainty.

    The field tilts the attitude only where the site states the dip; without it the dip is measured and all three
    solutions are the same. Use it when gravity is the poorer of the two.

    Examples
    --------
    >>> still = Samples(np.arange(64.0), 1.0, accel=[[0, 0, 9.81]] * 64, mag=[[2e4, 0, 4e4]] * 64)
    >>> float(static_davenport(still, StaticSettings(window=64.0)).angles.inclination[0])
    0.0
    """
    check_record(samples, Samples, "static_davenport")
    return StaticStream(settings, site, weighted=True).whole(samples)


def static_svd(samples: Samples, settings: StaticSettings | None = None, site: Site | None = None) -> Attitude:
    """As `static_davenport`, by a singular value decomposition.

    Examples
    --------
    >>> still = Samples(np.arange(64.0), 1.0, accel=[[0, 0, 9.81]] * 64, mag=[[2e4, 0, 4e4]] * 64)
    >>> float(static_svd(still, StaticSettings(window=64.0)).angles.inclination[0].round(12))
    0.0
    """
    check_record(samples, Samples, "static_svd")
    return WindowStream(*_parts(settings, site, "mag", by_svd)).whole(samples)


def north_seeking_attitude(
    samples: Samples, settings: StaticSettings | None = None, site: Site | None = None
) -> Attitude:
    """Attitude of a still tool from mean gravity and the Earth's rotation seen by its gyros; north is true.

    Parameters
    ----------
    samples : Samples
        With `accel` and `gyro`.
    settings : StaticSettings, optional
        `gyro_sigma`, the bias left by calibration, decides: azimuth errs by it over the horizontal Earth rate.
    site : Site, optional
        Its latitude, where given, is what the rate is compared with (flag "misfit").

    Returns
    -------
    Attitude
        As `static_attitude`, north "true".

    Raises
    ------
    InputError
        No accelerometer or no gyro.

    Examples
    --------
    >>> from inclinometry.rotations import dcm
    >>> from inclinometry.earth.rate import earth_rate
    >>> c = dcm(1.0, 0.5, 2.0)
    >>> still = Samples(np.arange(64.0), 1.0, accel=np.tile(9.81 * c[:, 2], (64, 1)),
    ...                 gyro=np.tile(c @ earth_rate(0.9), (64, 1)))
    >>> rows = north_seeking_attitude(still, StaticSettings(window=64.0, gyro_resolution=1e-9))
    >>> rows.north, float(rows.angles.azimuth[0].round(9)), float(np.degrees(rows.u.azimuth[0]).round(2))
    ('true', 1.0, 0.61)
    """
    check_record(samples, Samples, "north_seeking_attitude")
    return NorthSeekingStream(settings, site).whole(samples)


def _parts(
    settings: StaticSettings | None, site: Site | None, north: str, solve: Solve
) -> tuple[float, Callable[[Samples], Attitude], Attitude]:
    chosen = settings or StaticSettings()
    limits = Limits(chosen, site, north, "static" if solve is by_triad else "quaternion")
    nothing = refusals([], (), "static", "magnetic" if north == "mag" else "true")
    return chosen.window, partial(reduce_window, limits=limits, solve=solve), nothing

"""A gyro run as every method of north is given it, and the methods on its stations."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.site import Site
from inclinometry.findings import Finding
from inclinometry.gyro.closed_form import CHANGE, solve_patent
from inclinometry.gyro.north import estimate_north, estimate_north_fixed
from inclinometry.gyro.point_mass import ScaleLaw
from inclinometry.gyro.result import IndexAverage, North
from inclinometry.gyro.tracking import ScaleState, ScaleTrack


@dataclass(frozen=True, eq=False)
class Averages:
    """Gravity (m/s^2) and rate (rad/s) of n stations, and the part of their covariances that all readings share.

    gravity_calibration, rate_calibration : (n, 3, 3); for the rate without its scale, scale_calibration (n,), relative.
    gravity_bias, rate_bias : (n,) along the tool, by a sensor's bias there, which turning cannot remove; 0 without.
    gravity_by_calibration, rate_by_calibration : (n, 3, p) by the tool's parameters; p = 0 without covariance.
    """

    gravity: IndexAverage
    rate: IndexAverage
    gravity_calibration: Array
    rate_calibration: Array
    scale_calibration: Array
    gravity_bias: Array
    rate_bias: Array
    gravity_by_calibration: Array
    rate_by_calibration: Array

    @property
    def failed(self) -> Mask:
        """Stations (n,) at which a channel failed: their field is not that of the station."""
        return np.asarray(self.tilted | np.array(["channel" in names for names in self.rate.flags], dtype=np.bool_))

    @property
    def tilted(self) -> Mask:
        """Those (n,) of an accelerometer, whose tilt is not known."""
        return np.array(["channel" in names for names in self.gravity.flags], dtype=np.bool_)

    @property
    def jumped(self) -> Mask:
        """Stations (n,) whose scale factor is not that of the others."""
        return np.array(["scale" in names for names in self.rate.flags], dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class Stations:
    """What every method is given; `gravity_sd` as of `GyroOptions`, 0 where all of gravity is measured.

    Where a channel `failed` (n,) the rate, and gravity if it was an accelerometer, are a neighbour's; the rate is so
    little known that it teaches nothing. `jumped` (n,): the scale factor is not that of the other stations.
    """

    gravity: Array
    gravity_covariance: Array
    rate: Array
    rate_covariance: Array
    latitude: float
    g: float
    hole: str | None
    latitude_sd: float
    gravity_sd: float = 0.0
    failed: Mask = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    jumped: Mask = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    @property
    def measured(self) -> tuple[Array, Array, float]:
        """Gravity, rate and latitude, which every method begins with."""
        return self.gravity, self.rate, self.latitude

    @property
    def spread(self) -> dict[str, Any]:
        """The covariances of both and the strength of gravity, by the names that every method has for them."""
        return {"gravity_covariance": self.gravity_covariance, "rate_covariance": self.rate_covariance, "g": self.g}


def stations_of(averages: Averages, site: Site, hole: str | None, gravity_sd: float = 0.0) -> Stations:
    """What the average and the site say; the site must have a latitude; `gravity_sd` as of `GyroOptions`."""
    latitude, g = site.latitude or 0.0, site.gravity or 0.0
    # share of gravity and of the Earth rate below which no noise is believed: readings without any still are rounded
    rounding = 1e-9
    floor = rounding**2 * np.eye(3)
    gravity = averages.gravity.field
    covariance = averages.gravity.covariance + averages.gravity_calibration + g**2 * floor
    blind = np.isnan(gravity[:, 2])
    if blind.any():
        # the third component is from |g|: to a share of it, what is seen is too long or too short by as much
        across = gravity_sd * np.nan_to_num(gravity[blind])
        covariance[blind] += across[:, :, None] * across[:, None, :]
    rate, failed = averages.rate.field, averages.failed
    rate_covariance = averages.rate.covariance + averages.rate_calibration + EARTH_RATE**2 * floor
    if failed.any():
        sound = np.flatnonzero(~failed)
        near = sound[np.abs(sound - np.arange(len(failed))[:, None]).argmin(axis=1)]
        # a failed station's own numbers may be none of a field at all
        rate = rate[near]
        rate_covariance = rate_covariance[near] * np.where(failed, 1e8, 1.0)[:, None, None]
        tilted = averages.tilted
        gravity = np.where(tilted[:, None], gravity[near], gravity)
        covariance = np.where(tilted[:, None, None], covariance[near], covariance)
    return Stations(
        gravity,
        covariance,
        rate,
        rate_covariance,
        latitude,
        g,
        hole,
        site.latitude_sigma or 0.0,
        gravity_sd if blind.any() else 0.0,
        failed,
        averages.jumped,
    )


def fit_no_azimuth(joint: North, failed: Mask) -> Mask:
    """Stations (n,) whose rates no azimuth explains; none where they are half of the run: then the run is at fault."""
    # squared misfit over its degrees of freedom; of right runs whose scale factor jumps by 5 % it reaches 20
    lost = ~failed & (joint.chi_square > 50.0 * np.maximum(joint.dof, 1.0))
    return np.asarray(lost & (lost.sum() < 0.5 * np.count_nonzero(~failed)))


def without_failed(found: North, averages: Averages, disturbed: Mask) -> North:
    """The result without azimuths where a channel failed or none fits, nor inclinations of an accelerometer's."""
    failed, tilted = averages.failed | disturbed, averages.tilted
    if not failed.any():
        return found
    lost = np.stack([tilted, failed, tilted, failed], axis=1)  # inclination, azimuth, toolface, gyro toolface
    blank = {"inclination": tilted, "azimuth": failed, "toolface": tilted, "gyro_toolface": failed}
    blank |= dict.fromkeys(("scale", "u_scale", "k"), failed)
    changed: dict[str, Any] = {name: np.where(where, np.nan, getattr(found, name)) for name, where in blank.items()}
    return replace(
        found,
        **changed,
        root=["" if gone else own for gone, own in zip(failed, found.root, strict=True)],
        components={name: np.where(lost, np.nan, part) for name, part in found.components.items()},
        # what an estimate of a neighbour's rates is remarkable for is not the station's
        flags=[() if gone else own for gone, own in zip(averages.failed, found.flags, strict=True)],
    )


@dataclass(frozen=True, eq=False)
class ScalePrior:
    """What is known of each station's scale without its own rates.

    law : from the calibration, the history and, where the run is followed, its other stations; None: as `before`.
    before, before_sd : (n,) of a scale factor that the rates do not correct.
    stated, stated_sd : (n,) without any station of the run, by the `state`; `curve` (n, c) its powers of temperature
        less those of the first station, c = 0 where temperature says nothing.
    """

    law: ScaleLaw | None
    before: Array
    before_sd: Array
    stated: Array
    stated_sd: Array
    track: ScaleTrack | None
    findings: tuple[Finding, ...] = ()
    state: ScaleState | None = None
    curve: Array = field(default_factory=lambda: np.zeros((0, 0)))


def solve(method: str, stations: Stations, known: ScalePrior) -> North:
    """Azimuths of the stations of a run by a method: joint, fixed (scale known) or patent."""
    if method == "patent":
        found = solve_patent(
            *stations.measured,
            **stations.spread,
            history=float(known.stated[0]),
            history_sd=float(known.stated_sd[0]),
            change_sd=CHANGE,
        )
        return found if stations.hole is None else _declared(found, stations.hole)
    given = stations.measured
    shared = {**stations.spread, "hole": stations.hole, "latitude_sd": stations.latitude_sd}
    if method == "fixed":
        # a scale that is not corrected errs by what is expected of it and by what is not known of that
        return estimate_north_fixed(*given, scale_sd=np.hypot(known.before_sd, known.before - 1.0), **shared)
    scale = known.before if known.law is None else known.law
    return estimate_north(*given, scale=scale, scale_sd=known.before_sd, **shared)


def _declared(found: North, hole: str) -> North:
    """The closed form where the direction of the hole is stated: nothing is assumed, and up-holes are outside it."""
    if hole == "down":
        return replace(found, flags=[[name for name in row if name != "down-assumed"] for row in found.flags])
    blank = np.array([("down-assumed" in row) for row in found.flags])
    flags = [["up-hole" if name == "down-assumed" else name for name in row] for row in found.flags]
    return replace(
        found,
        flags=flags,
        inclination=np.where(blank, np.pi - found.inclination, found.inclination),
        azimuth=np.where(blank, np.nan, found.azimuth),
        gyro_toolface=np.where(blank, np.nan, found.gyro_toolface),
        scale=np.where(blank, np.nan, found.scale),
        u_scale=np.where(blank, np.nan, found.u_scale),
        k=np.where(blank, np.nan, found.k),
        root=["" if gone else own for gone, own in zip(blank, found.root, strict=True)],
    )

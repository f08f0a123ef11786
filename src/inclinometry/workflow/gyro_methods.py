"""The methods of north by gyro on one set of stations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.site import Site
from inclinometry.gyro.closed_form import CHANGE, solve_patent
from inclinometry.gyro.north import estimate_north, estimate_north_fixed
from inclinometry.gyro.result import North
from inclinometry.gyro.tracking import ScaleTrack
from inclinometry.workflow.gyro_average import Averages


@dataclass(frozen=True, eq=False)
class Stations:
    """What every method is given; `gravity_sd` as of `GyroOptions`, 0 where all of gravity is measured."""

    gravity: Array
    gravity_covariance: Array
    rate: Array
    rate_covariance: Array
    latitude: float
    g: float
    hole: str | None
    latitude_sd: float
    gravity_sd: float = 0.0


def stations_of(averages: Averages, site: Site, hole: str | None, gravity_sd: float = 0.0) -> Stations:
    """What the average and the site say; the site must have a latitude; `gravity_sd` as of `GyroOptions`."""
    latitude, g = site.latitude or 0.0, site.gravity or 0.0
    # share of gravity and of the Earth rate below which no noise is believed: readings without any still are rounded
    rounding = 1e-9
    floor = rounding**2 * np.eye(3)
    field = averages.gravity.field
    covariance = averages.gravity.covariance + averages.gravity_calibration + g**2 * floor
    blind = np.isnan(field[:, 2])
    if blind.any():
        # the third component is from |g|: to a share of it, what is seen is too long or too short by as much
        across = gravity_sd * np.nan_to_num(field[blind])
        covariance[blind] += across[:, :, None] * across[:, None, :]
    return Stations(
        field,
        covariance,
        averages.rate.field,
        averages.rate.covariance + averages.rate_calibration + EARTH_RATE**2 * floor,
        latitude,
        g,
        hole,
        site.latitude_sigma or 0.0,
        gravity_sd if blind.any() else 0.0,
    )


@dataclass(frozen=True, eq=False)
class ScalePrior:
    """What is known of each station's scale without its own rates.

    scale, sd : (n,) from the calibration, the history and, where the run is followed, its other stations.
    stated, stated_sd : (n,) without any station of the run.
    before, before_sd : (n,) the same, widened where the run contradicts it.
    """

    scale: Array
    sd: Array
    before: Array
    before_sd: Array
    stated: Array
    stated_sd: Array
    track: ScaleTrack | None
    notes: tuple[str, ...] = ()


def solve(method: str, stations: Stations, known: ScalePrior) -> North:
    if method == "patent":
        found = solve_patent(
            stations.gravity,
            stations.rate,
            stations.latitude,
            gravity_covariance=stations.gravity_covariance,
            rate_covariance=stations.rate_covariance,
            g=stations.g,
            history=float(known.stated[0]),
            history_sd=float(known.stated_sd[0]),
            change_sd=CHANGE,
        )
        return found if stations.hole is None else _declared(found, stations.hole)
    estimate = estimate_north_fixed if method == "fixed" else estimate_north
    return estimate(
        stations.gravity,
        stations.rate,
        stations.latitude,
        gravity_covariance=stations.gravity_covariance,
        rate_covariance=stations.rate_covariance,
        scale=np.ones(len(stations.rate)) if method == "fixed" else known.scale,
        # a scale that is not corrected errs by what is expected of it and by what is not known of that
        scale_sd=np.hypot(known.before_sd, known.before - 1.0) if method == "fixed" else known.sd,
        g=stations.g,
        hole=stations.hole,
        latitude_sd=stations.latitude_sd,
    )


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

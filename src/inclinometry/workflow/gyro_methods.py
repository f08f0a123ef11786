"""The methods of north by gyro on one set of stations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.gyro.closed_form import solve_patent
from inclinometry.gyro.north import estimate_north, estimate_north_fixed
from inclinometry.gyro.result import North
from inclinometry.gyro.tracking import ScaleTrack
from inclinometry.workflow.gyro_average import Averages


@dataclass(frozen=True, eq=False)
class Stations:
    """What every method is given."""

    gravity: Array
    gravity_covariance: Array
    rate: Array
    rate_covariance: Array
    latitude: float
    g: float
    hole: str | None
    latitude_sd: float


def stations_of(averages: Averages, site: Site, hole: str | None) -> Stations:
    """What the average and the site say; the site must have a latitude."""
    latitude, g = site.latitude or 0.0, site.gravity or 0.0
    return Stations(
        averages.gravity.field,
        averages.gravity.covariance + averages.gravity_calibration,
        averages.rate.field,
        averages.rate.covariance + averages.rate_calibration,
        latitude,
        g,
        hole,
        site.latitude_sigma or 0.0,
    )


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of each station's scale without its own rates.

    scale, sd : (n,) from the calibration, the history and, where the run is followed, its other stations.
    before, before_sd : (n,) without any station of the run.
    """

    scale: Array
    sd: Array
    before: Array
    before_sd: Array
    track: ScaleTrack | None
    notes: tuple[str, ...] = ()


JUMP = 0.002
"""Standard deviation of the scale from station to station by which the closed form follows its history."""


def solve(method: str, stations: Stations, known: Known) -> North:
    if method == "patent":
        found = solve_patent(
            stations.gravity,
            stations.rate,
            stations.latitude,
            gravity_covariance=stations.gravity_covariance,
            rate_covariance=stations.rate_covariance,
            g=stations.g,
            history=float(known.before[0]),
            history_sd=JUMP,
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

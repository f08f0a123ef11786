"""Whether gyro readings can be what they are said to be: units, signs, the latitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.errors import InputError
from inclinometry.findings import Finding
from inclinometry.gyro.axes import AxisPrior
from inclinometry.gyro.result import North
from inclinometry.gyro.run import ScalePrior, Stations, solve
from inclinometry.survey.flags import Check
from inclinometry.survey.gyro_quality import rate_checks
from inclinometry.workflow.gyro_average import LIGHTEST, gravity_off


def check_rates(
    stations: Stations,
    known: ScalePrior,
    joint: North,
    calibration: Array,
    labels: Sequence[str],
    axes: AxisPrior | None = None,
) -> list[Check]:
    """The rates against the Earth's; gravity along the tool is taken from the solution where it is not measured."""
    # what is stated of the scale factor holds on one side of a jump
    sound = np.flatnonzero(~stations.failed & ~stations.jumped)
    gravity, covariance = stations.gravity[sound], stations.gravity_covariance[sound]
    blind = np.isnan(gravity[:, 2])
    gravity[blind, 2] = stations.g * np.cos(joint.inclination[sound][blind])
    covariance[blind, 2, :] = covariance[blind, :, 2] = 0.0
    covariance[blind, 2, 2] = np.mean(np.diagonal(covariance[blind, :2, :2], axis1=1, axis2=2), axis=1)
    # the calibration's errors are common to all stations: their mean does not vanish
    common = float(np.sqrt(np.max(np.linalg.eigvalsh(np.nan_to_num(calibration))))) / EARTH_RATE
    rate_covariance = stations.rate_covariance[sound]
    if axes is not None:
        rate_covariance = rate_covariance + axes.spread(joint, stations.latitude)[sound]
        common = float(np.hypot(common, axes.wide[1]))  # of the g-sensitivity: an error of latitude
    checks = rate_checks(
        gravity,
        stations.rate[sound],
        stations.latitude,
        gravity_covariance=covariance,
        rate_covariance=rate_covariance,
        scale=known.stated[sound],
        scale_sd=known.stated_sd[sound],
        followed=None if known.track is None else (known.track.expected[sound], known.track.expected_sd[sound]),
        g=stations.g,
        labels=[labels[row] for row in sound.tolist()],
        common_sd=common,
    )
    return [replace(check, stations=tuple(int(sound[row]) for row in check.stations)) for check in checks]


def misfit_hint(joint: North, rate: Array) -> list[Finding]:
    """What is said where no station fits."""
    if len(joint) < 2 or sum("misfit" in row for row in joint.flags) < 0.9 * len(joint):
        return []
    size = float(np.median(np.linalg.norm(np.nan_to_num(rate), axis=1)) / EARTH_RATE)
    return [Finding("gyro-misfit", {"share": size})]


def gravity_scale(stations: Stations) -> list[Finding]:
    """What is said where the gravity of three accelerometers is not the site's: the rates say nothing of it."""
    length = np.linalg.norm(stations.gravity, axis=1)
    if not np.isfinite(length).all():
        return []
    unit = stations.gravity / length[:, None]
    sd = np.sqrt(np.einsum("ni,nij,nj->n", unit, stations.gravity_covariance, unit))
    off, sigmas = float(np.median(length / stations.g - 1.0)), float(np.median((length - stations.g) / sd))
    # share, and standard uncertainties, by which the median gravity of a run must be off to be named. Gravity by
    # latitude and height is right to 1e-4.
    heavy = (1e-3, 5.0)
    if abs(off) < heavy[0] or abs(sigmas) < heavy[1]:
        return []
    return [gravity_off(stations.g * (1.0 + off), stations.g)]


def gravity_in_g(stations: Stations) -> Finding | None:
    """What is said where cross-axis accelerometers fit the rates far better when their numbers are taken as g."""
    level = np.hypot(stations.gravity[:, 0], stations.gravity[:, 1])
    if np.isfinite(stations.gravity[:, 2]).any() or level.max() > 1.0 + LIGHTEST:
        return None
    larger = replace(
        stations,
        gravity=stations.gravity * STANDARD_GRAVITY,
        gravity_covariance=stations.gravity_covariance * STANDARD_GRAVITY**2,
    )
    ones, vague_sd = np.ones(len(level)), np.full(len(level), 0.01)  # a scale factor while units are suspect
    vague = ScalePrior(None, ones, vague_sd, ones, vague_sd, None)
    try:
        given, other = (float(np.sum(solve("joint", s, vague).chi_square)) for s in (stations, larger))
    except InputError:
        return None
    if given < 10.0 * len(level) or other > 0.2 * given:
        return None
    return Finding("gyro-accel-in-g", severity="refused")

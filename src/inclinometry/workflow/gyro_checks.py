"""Whether gyro readings can be what they are said to be: units, signs, the latitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.errors import InputError
from inclinometry.gyro.result import North
from inclinometry.survey.flags import Check
from inclinometry.survey.gyro_quality import rate_checks
from inclinometry.workflow.gyro_average import LIGHTEST
from inclinometry.workflow.gyro_methods import ScalePrior, Stations, solve


def check_rates(stations: Stations, known: ScalePrior, joint: North, calibration: Array) -> list[Check]:
    """The rates against the Earth's; gravity along the tool is taken from the solution where it is not measured."""
    gravity, covariance = stations.gravity.copy(), stations.gravity_covariance.copy()
    blind = np.isnan(gravity[:, 2])
    gravity[blind, 2] = stations.g * np.cos(joint.inclination[blind])
    covariance[blind, 2, :] = covariance[blind, :, 2] = 0.0
    covariance[blind, 2, 2] = np.mean(np.diagonal(covariance[blind, :2, :2], axis1=1, axis2=2), axis=1)
    checks = rate_checks(
        gravity,
        stations.rate,
        stations.latitude,
        gravity_covariance=covariance,
        rate_covariance=stations.rate_covariance,
        scale=known.stated,
        scale_sd=known.stated_sd,
        g=stations.g,
    )
    # the calibration's errors are common to all stations: their mean does not vanish
    common = np.sqrt(np.max(np.linalg.eigvalsh(np.nan_to_num(calibration)))) / EARTH_RATE
    covered = 3.0  # standard uncertainties that a faultless run stays within
    return [_widened(check, covered * common) if check.name == "latitude" else check for check in checks]


def _widened(check: Check, more: float) -> Check:
    """The check of latitude with a limit that what all stations share may reach."""
    limit = float(np.hypot(check.limit, more))
    if check.verdict != "fail" or abs(check.value) > limit:
        return check
    reason = f"{check.reason}; within what the calibration leaves open ({np.degrees(limit):.2f} deg)"
    return replace(check, verdict="pass", limit=limit, reason=reason, action="")


def refusal(checks: Sequence[Check], latitude: float) -> str | None:
    """Why the readings cannot belong to this latitude, where they tell its sign."""
    by_name = {check.name: check for check in checks}
    sign, value = by_name["latitude sign"], by_name["latitude"]
    if sign.verdict != "fail":
        return None
    if value.verdict == "fail" and abs(latitude + value.value) > 3.0 * abs(latitude):
        return f"{value.reason}{radians_hint(latitude)}; {value.action}"
    return f"{sign.reason}; {sign.action}"


def radians_hint(latitude: float) -> str:
    """A question that a small latitude raises."""
    return " (is it in radians? latitude_deg takes degrees)" if abs(latitude) < np.radians(1.6) else ""


def misfit_hint(joint: North, rate: Array, latitude: float) -> list[str]:
    """A sentence where no station fits: what would explain that."""
    if len(joint) < 2 or sum("misfit" in row for row in joint.flags) < 0.9 * len(joint):
        return []
    size = float(np.median(np.linalg.norm(np.nan_to_num(rate), axis=1)) / EARTH_RATE)
    return [
        "hardly a station fits the Earth's rate: is the latitude right"
        f"{radians_hint(latitude)}, is one axis alone reversed or swapped, are the rates in another unit (they are "
        f"{size:.3g} of the Earth rate), or is the stated noise too small?"
    ]


def gravity_scale(stations: Stations) -> list[str]:
    """A sentence where the gravity of three accelerometers is not the site's: the rates say nothing of it."""
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
    return [
        f"gravity comes out {100.0 * off:+.2f} % from the site's {stations.g:.5g} m/s^2 ({abs(sigmas):.0f} standard "
        "uncertainties): the scale of the accelerometers has changed, with the temperature perhaps, and with it the "
        "inclination; calibrate them over temperature"
    ]


def gravity_in_g(stations: Stations) -> str | None:
    """A sentence where cross-axis accelerometers fit the rates far better when their numbers are taken as g."""
    level = np.hypot(stations.gravity[:, 0], stations.gravity[:, 1])
    if np.isfinite(stations.gravity[:, 2]).any() or level.max() > 1.0 + LIGHTEST:
        return None
    larger = replace(
        stations,
        gravity=stations.gravity * STANDARD_GRAVITY,
        gravity_covariance=stations.gravity_covariance * STANDARD_GRAVITY**2,
    )
    ones, vague_sd = np.ones(len(level)), np.full(len(level), 0.01)  # a scale factor while units are in doubt
    vague = ScalePrior(ones, vague_sd, ones, vague_sd, ones, vague_sd, None)
    try:
        given, other = (float(np.sum(solve("joint", s, vague).chi_square)) for s in (stations, larger))
    except InputError:
        return None
    if given < 10.0 * len(level) or other > 0.2 * given:
        return None
    return "the accelerometers fit the rates only if their numbers are in g, not m/s^2: name the columns accel_x_g"

"""Whether gyro readings can be what they are said to be: units, signs, the latitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.core.errors import InputError
from inclinometry.gyro.result import North
from inclinometry.survey.checks import Check
from inclinometry.survey.gyro_quality import rate_checks
from inclinometry.workflow.gyro_average import LIGHTEST
from inclinometry.workflow.gyro_methods import Known, Stations, solve

VAGUE: Final = 0.01
"""Standard uncertainty of a scale factor while units are still in doubt."""


def check_rates(stations: Stations, known: Known, joint: North) -> list[Check]:
    """The rates against the Earth's; gravity along the tool is taken from the solution where it is not measured."""
    gravity, covariance = stations.gravity.copy(), stations.gravity_covariance.copy()
    blind = np.isnan(gravity[:, 2])
    gravity[blind, 2] = stations.g * np.cos(joint.inclination[blind])
    covariance[blind, 2, :] = covariance[blind, :, 2] = 0.0
    covariance[blind, 2, 2] = np.mean(np.diagonal(covariance[blind, :2, :2], axis1=1, axis2=2), axis=1)
    return rate_checks(
        gravity,
        stations.rate,
        stations.latitude,
        gravity_covariance=covariance,
        rate_covariance=stations.rate_covariance,
        scale=known.scale,
        scale_sd=known.sd,
        g=stations.g,
    )


def refusal(checks: Sequence[Check], latitude: float) -> str | None:
    """Why the readings cannot belong to this latitude, where they tell its sign."""
    by_name = {check.name: check for check in checks}
    sign, value = by_name["latitude sign"], by_name["latitude"]
    if sign.verdict != "fail":
        return None
    if value.verdict == "fail" and abs(latitude + value.value) > 3.0 * abs(latitude):
        hint = " (is it in radians? latitude_deg takes degrees)" if abs(latitude) < np.radians(1.6) else ""
        return f"{value.reason}{hint}; {value.action}"
    return f"{sign.reason}; {sign.action}"


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
    vague = Known(np.ones(len(level)), np.full(len(level), VAGUE), None, ())
    try:
        given, other = (float(np.sum(solve("joint", s, vague).chi_square)) for s in (stations, larger))
    except InputError:
        return None
    if given < 10.0 * len(level) or other > 0.2 * given:
        return None
    return "the accelerometers fit the rates only if their numbers are in g, not m/s^2: name the columns accel_x_g"

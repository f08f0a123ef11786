"""North and scale factor in closed form from two gyros across the tool, as the patent has it, with its failures named.

Symbols: th inclination, psi azimuth, T toolface, a latitude (north +), s scale factor (true rate = s x reading);
A, B readings turned back to the high side, in units of the Earth rate, so that s A = X and s B = Y with

    X = cos a cos psi cos th + sin a sin th,   Y = -cos a sin psi,   Z = cos a cos psi sin th - sin a cos th
    K = cos a cos th + sin a sin th cos psi    (what the scale factor is seen through)

Source: "Temperature compensation method of a fibre-optic gyro inclinometer", patent application of Wuxi Huilian
Information Technology, 2015, steps C to F; formulas repaired, because the text in circulation lost its roots.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import within
from inclinometry.gyro._closed_parts import (
    CHANGE,
    choose,
    failures,
    north_result,
    placed,
    prepare,
    sensitivity,
    variance,
)
from inclinometry.gyro.formulas import (
    HALF_PI,
    azimuth_arctan2,
    expected_rates,
    high_side,
    patent_azimuth,
    printed_toolface,
    scale_condition,
    scale_roots,
)
from inclinometry.gyro.result import North
from inclinometry.gyro.tilt import STEEPEST

__all__ = [
    "CHANGE",
    "azimuth_arctan2",
    "expected_rates",
    "high_side",
    "patent_azimuth",
    "printed_toolface",
    "scale_condition",
    "scale_roots",
    "solve_fixed_arctan2",
    "solve_patent",
]


def solve_patent(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    gravity_covariance: ArrayLike | None = None,
    rate_covariance: ArrayLike | None = None,
    g: float | None = None,
    history: float | None = None,
    history_sd: float = 0.0,
    change_sd: float | None = None,
) -> North:
    """Steps C to F of the patent for a run of stations: scale factor from the Earth's rate itself, then azimuth.

    Parameters
    ----------
    gravity : (n, 2) or (n, 3) array_like
        Field of gravity in tool axes, m/s^2; z NaN where it is not measured. Inclination is the
        patent's arcsine without z, and comes from z, `g` not used, with it.
    rate : (n, 2) or (n, 3) array_like
        Readings x, y, rad/s, freed of bias; z is not used.
    latitude : float
        rad, north positive.
    gravity_covariance, rate_covariance : (n, m, m) array_like, optional
        Of one station's readings, (m/s^2)^2 and (rad/s)^2, m 2 or 3; one (m, m) serves all. Taken as exact if absent.
    g : float, optional
        Strength of gravity, m/s^2; needed where z is not measured.
    history, history_sd : float, optional
        Scale factor before the first station, and its standard uncertainty. Absent: the first station with a single
        positive root begins the history; stations before it are flagged "history".
    change_sd : float, optional
        Standard deviation of the scale factor's change from one station to the next. With it a scale factor further
        than 4 standard uncertainties from the history is flagged "scale" and is not carried on, unless the next station
        agrees with it; and of two roots that far neither is taken ("history").

    Returns
    -------
    North
        method "patent". Where it fails azimuth and scale are NaN and a flag says why; "vertical" keeps the scale
        factor and the gyro toolface, both of which stay defined. `root` is "" and `k` NaN where nothing was chosen.
        Variances are first order, capped by `North.u`; where it is not given a covariance adds nothing.

    Raises
    ------
    InputError
        Shapes, values not finite, latitude beyond the poles, `g` missing or exceeded by the cross-axis gravity.

    Notes
    -----
    Which root: the claim discards "the one that differs much from the history of the scale factor", the description
    "by the sign of s and the rate of change of the history". So: of two positive roots the one nearer to what the
    scale factors so far and their rate of change foretell. That is safe only where the roots are further apart than
    the scale factor moves: near K = 0 it is not, and an error there is carried on. Implicit differentiation of
    s A = X, s B = Y gives the sensitivities.

    Examples
    --------
    >>> down = [[-4.9, 0.0, 8.48704895708750]]
    >>> x, y, _ = expected_rates(np.radians(40.0), np.radians(30.0), np.radians(45.0))
    >>> north = solve_patent(down, [[7.292115e-5 * x / 1.01, 7.292115e-5 * y / 1.01]], np.radians(45.0))
    >>> float(np.degrees(north.azimuth[0]).round(6)), float(north.scale[0].round(6)), north.root[0]
    (40.0, 1.01, '+')
    """
    attitude, a, b, noise, lat = prepare(gravity, rate, latitude, gravity_covariance, rate_covariance, g)
    th = np.minimum(attitude.inclination, HALF_PI)
    roots, discriminant = scale_roots(a, b, th, lat)
    a2, b2, th2 = a[:, None], b[:, None], th[:, None]
    psi = azimuth_arctan2(a2, b2, roots, th2, lat)
    by_scale, by_azimuth = sensitivity(roots, psi, th2, lat)
    u_roots = np.sqrt(sum(variance(by_scale, part[:, None]) for part in noise.values()))
    named = failures(attitude, a, b, discriminant, noise, lat)
    chosen, flags = choose(roots, u_roots, named, history, history_sd, change_sd)
    lost, pick = chosen < 0, (np.arange(len(a)), np.maximum(chosen, 0))
    return north_result(
        attitude,
        np.where(lost, np.nan, psi[pick]),
        np.where(lost, np.nan, roots[pick]),
        np.where(lost, np.nan, u_roots[pick]),
        np.where(lost[:, None], np.nan, by_azimuth[pick]),
        noise,
        flags,
        lat,
        "patent",
    )


def solve_fixed_arctan2(
    gravity: ArrayLike,
    rate: ArrayLike,
    latitude: float,
    *,
    scale: ArrayLike = 1.0,
    u_scale: ArrayLike = 0.0,
    gravity_covariance: ArrayLike | None = None,
    rate_covariance: ArrayLike | None = None,
    g: float | None = None,
) -> North:
    """The classical closed form: azimuth by `azimuth_arctan2` with a scale factor that is given, not found.

    Parameters
    ----------
    scale, u_scale : (n,) array_like or float
        True rate over reading, and its standard uncertainty (component "scale").
    gravity, rate, latitude, gravity_covariance, rate_covariance, g
        As for `solve_patent`.

    Returns
    -------
    North
        method "fixed"; NaN and flagged when vertical (gyro toolface kept), horizontal or up.

    Raises
    ------
    InputError
        As `solve_patent`; scale not positive.

    Notes
    -----
    dpsi = -tan a tan th sin psi ds for an error of the scale factor. Two readings for one unknown: not the estimate
    of least variance, even with the scale factor known.

    Examples
    --------
    One per cent of scale, east at 80 deg:

    >>> x, y, _ = expected_rates(np.radians(90.0), np.radians(80.0), np.radians(45.0))
    >>> gravity = 9.8 * np.array([[-np.sin(np.radians(80.0)), 0.0, np.cos(np.radians(80.0))]])
    >>> north = solve_fixed_arctan2(gravity, [[7.292115e-5 * x, 7.292115e-5 * y]], np.radians(45.0), u_scale=0.01)
    >>> float(np.degrees(north.azimuth[0]).round(6)), float(np.degrees(north.u("azimuth")[0]).round(2))
    (90.0, 3.25)
    """
    attitude, a, b, noise, lat = prepare(gravity, rate, latitude, gravity_covariance, rate_covariance, g)
    s = np.broadcast_to(within(scale, "scale", 1e-3, 1e3), a.shape)
    u = np.broadcast_to(within(u_scale, "u_scale", 0.0, np.inf), a.shape)
    th = np.minimum(attitude.inclination, HALF_PI)
    lost = attitude.up | attitude.horizontal
    psi = np.where(lost, np.nan, azimuth_arctan2(a, b, s, th, lat))
    # derivatives in the vertical: a hair from it, where azimuth and toolface are numbers
    hair = np.maximum(th, STEEPEST)
    a, th = a + np.sin(lat) * (np.sin(hair) - np.sin(th)) / s, hair
    sine, cosine = -s * b * np.cos(th), s * a - np.sin(lat) * np.sin(th)
    d_sine = [0.0 * a, -s * np.cos(th), s * b * np.sin(th), -s * a * np.cos(th), -b * np.cos(th)]
    d_cosine = [s, 0.0 * a, -np.sin(lat) * np.cos(th), -s * b, a]
    with np.errstate(divide="ignore", invalid="ignore"):
        by = np.stack(
            [(cosine * p - sine * q) / (sine**2 + cosine**2) for p, q in zip(d_sine, d_cosine, strict=True)], -1
        )
    north = north_result(
        attitude, psi, s, u, np.where(lost[:, None], np.nan, by[:, :4]), noise, placed(attitude), lat, "fixed"
    )
    extra = np.where(lost, np.nan, (by[:, 4] * u) ** 2)
    none = np.zeros_like(extra)
    components = {**north.components, "scale": np.stack([none, extra, none, extra], axis=-1)}
    return replace(north, components=components)

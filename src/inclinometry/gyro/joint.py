"""Azimuth and scale factor together: the most probable pair, given the rates and what is known of the scale."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask
from inclinometry.gyro.closed_form import expected_rates
from inclinometry.gyro.result import covariances, per_station, vectors
from inclinometry.rotations import wrap_positive

RIVAL = 25.0
"""Cost by which the second-best azimuth must be worse: five standard uncertainties."""

BENT = (3.0, 5.5)
"""Cost two standard uncertainties away, 4 if Gaussian; outside this range the posterior gives the uncertainty."""

LARGEST = 1e6
"""Earth rates; more is no reading of a gyro at rest."""

SCALES = (0.2, 5.0)
"""Scale factors taken for possible."""


class JointBatch(NamedTuple):
    """n stations, rad; all fields (n,)."""

    azimuth: Array  #: in [0, 2 pi)
    k: Array  #: 1 / scale
    # var_azimuth, cov_azimuth_k, var_k: inverse of the Fisher information, prior included
    var_azimuth: Array
    cov_azimuth_k: Array
    var_k: Array
    cost: Array  #: squared misfit at the solution, in variances: of rates and prior together
    # rival, rival_cost: the second-best azimuth and its cost; NaN and infinite where there is none
    rival: Array
    rival_cost: Array
    ambiguous: Mask  #: another azimuth fits nearly as well
    weak: Mask  #: the posterior is not Gaussian
    # mass, rival_mass: integral of exp(-cost / 2) about the two azimuths, in units of sqrt(2 pi) exp(-cost / 2)
    mass: Array
    # rival_k, rival_var: k and variance of azimuth of the second-best; 0 where there is none
    rival_k: Array
    rival_var: Array
    rival_mass: Array


def solve_joint(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: ArrayLike,
    *,
    scale: ArrayLike = 1.0,
    scale_sd: ArrayLike = np.inf,  # 0: scale known exactly
) -> JointBatch:
    """Most probable azimuth and k = 1/scale of n stations; rates of `high_side` over the Earth rate, z may be NaN.

    Minimises (h - k E(psi))' C^-1 (h - k E(psi)) + (k - k0)^2 / sd^2 with E the Earth rate of azimuth psi in high-side
    axes. k is eliminated in closed form; no square root, no choice of roots, no complex case.
    """
    h = vectors(rates, "rates", LARGEST)
    seen = np.isfinite(h[:, 2])
    wide = covariances(covariance, "covariance", seen, positive=True)
    inc = per_station(inclination, len(h), "inclination", 0.0, np.pi, "rad")
    lat = per_station(latitude, len(h), "latitude", -np.pi / 2, np.pi / 2, "rad")
    k0, sd = prior_of_k(scale, scale_sd, len(h))
    from inclinometry.gyro import _kernels  # here and not above: it brings in numba

    out = np.empty((len(h), _kernels.COLUMNS))
    _kernels.north(*_stations(h, wide, inc, lat, k0, sd), out)
    low, high = out[:, 8] - out[:, 5], out[:, 9] - out[:, 5]
    weak = (out[:, 2] >= _kernels.FLAT**2) | (np.minimum(low, high) < BENT[0]) | (np.maximum(low, high) > BENT[1])
    return JointBatch(
        wrap_positive(out[:, 0]),
        out[:, 1],
        out[:, 2],
        out[:, 3],
        out[:, 4],
        out[:, 5],
        out[:, 6],
        out[:, 7],
        out[:, 7] - out[:, 5] < RIVAL,
        weak,
        out[:, 10],
        *np.where(np.isfinite(out[:, 7]), out[:, 11:].T, 0.0),
    )


def prior_of_k(scale: ArrayLike, scale_sd: ArrayLike, size: int) -> tuple[Array, Array]:
    """Mean and standard deviation (n,) of k = 1/scale."""
    known = per_station(scale, size, "scale", *SCALES)
    sd = per_station(scale_sd, size, "scale_sd", 0.0, np.inf)
    # beyond that nothing at all is known of the scale factor
    return 1.0 / known, np.where(sd > 1e3, np.inf, sd) / known**2


def posterior_sd(
    rates: Array, covariance: Array, inclination: Array, latitude: Array, k0: Array, sd: Array, azimuth: Array
) -> Array:
    """Standard uncertainty (n,) of azimuth about its estimate, rad, from the whole posterior of each station.

    Integrates over azimuth and k; used where the posterior has more than one peak or is flat.
    """
    h = vectors(rates, "rates", LARGEST)
    wide = covariances(covariance, "covariance", np.isfinite(h[:, 2]), positive=True)
    out = np.empty(len(h))
    from inclinometry.gyro import _kernels

    _kernels.spread(*_stations(h, wide, inclination, latitude, k0, sd), np.ascontiguousarray(azimuth), out)
    return out


def _stations(
    h: Array, covariance: Array, inclination: Array, latitude: Array, k0: Array, sd: Array
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """What the kernels take of the stations."""
    with np.errstate(divide="ignore"):
        weight = 1.0 / (sd * sd)
    packed = np.where(np.isfinite(covariance), covariance, np.eye(3))[:, [0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2]]
    inclination, latitude, k0 = (np.ascontiguousarray(one) for one in (inclination, latitude, k0))
    return (
        np.ascontiguousarray(h),
        np.ascontiguousarray(packed),
        inclination,
        latitude,
        k0,
        np.ascontiguousarray(weight),
    )


def earth_in_tool(azimuth: ArrayLike, inclination: ArrayLike, latitude: ArrayLike) -> Array:
    """Earth rate in units of itself in high-side axes (..., 3): X, Y, Z of a tool with toolface 0.

    Examples
    --------
    >>> earth_in_tool(0.0, 0.0, 0.0)
    array([1., 0., 0.])
    """
    return np.stack(np.broadcast_arrays(*expected_rates(azimuth, inclination, latitude)), axis=-1)


def earth_slopes(azimuth: Array, inclination: Array, latitude: Array) -> Array:
    """Derivatives (..., 3 axes, 3) of `earth_in_tool` by azimuth, inclination and latitude."""
    cp, sp = np.cos(azimuth), np.sin(azimuth)
    ct, st = np.cos(inclination), np.sin(inclination)
    ca, sa = np.cos(latitude), np.sin(latitude)
    zero = 0.0 * (cp + ct + ca)
    x = [-ca * sp * ct, -ca * cp * st + sa * ct, -sa * cp * ct + ca * st]
    y = [-ca * cp, zero, sa * sp]
    z = [-ca * sp * st, ca * cp * ct + sa * st, -sa * cp * st - ca * ct]
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in (x, y, z)], axis=-2)

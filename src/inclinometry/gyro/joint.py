"""Azimuth and scale factor together: the most probable pair, given the rates and what is known of the scale."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask
from inclinometry.gyro.closed_form import expected_rates
from inclinometry.gyro.result import covariances, per_station, vectors
from inclinometry.rotations import wrap_positive, wrap_signed

RIVAL = 25.0
"""Cost by which the second-best azimuth must be worse: five standard uncertainties."""

BENT = (3.0, 5.5)
"""Cost two standard uncertainties away, 4 if Gaussian; outside this range the posterior gives the uncertainty."""

LARGEST = 1e6
"""Earth rates; more is no reading of a gyro at rest."""

SCALES = (0.2, 5.0)
"""Scale factors taken for possible."""


class JointBatch(NamedTuple):
    """n stations, rad.

    azimuth : (n,) in [0, 2 pi).
    k : (n,) 1 / scale.
    var_azimuth, cov_azimuth_k, var_k : (n,) inverse of the Fisher information, prior included.
    cost : (n,) squared misfit at the solution, in variances: of rates and prior together.
    rival, rival_cost : (n,) the second-best azimuth and its cost; NaN and infinite where there is none.
    ambiguous, weak : (n,) another azimuth fits nearly as well; the posterior is not Gaussian.
    """

    azimuth: Array
    k: Array
    var_azimuth: Array
    cov_azimuth_k: Array
    var_k: Array
    cost: Array
    rival: Array
    rival_cost: Array
    ambiguous: Mask
    weak: Mask


def solve_joint(
    rates: ArrayLike,
    covariance: ArrayLike,
    inclination: ArrayLike,
    latitude: ArrayLike,
    *,
    scale: ArrayLike = 1.0,
    scale_sd: ArrayLike = np.inf,
) -> JointBatch:
    """Most probable azimuth and k = 1/scale of many stations.

    Parameters
    ----------
    rates : (n, 2) or (n, 3) array_like
        Readings turned to the high side: a = wx cos T - wy sin T, b = wx sin T + wy cos T, and wz, in units of the
        Earth rate; wz may be NaN where it is not measured.
    covariance : (n, 2, 2) or (n, 3, 3) array_like
        Of the rates; one matrix serves all stations.
    inclination, latitude : (n,) array_like
        rad, 0..pi and -pi/2..pi/2; a scalar serves all stations.
    scale, scale_sd : (n,) array_like
        Prior of the scale factor; infinite: nothing, 0: exactly.

    Returns
    -------
    JointBatch

    Raises
    ------
    InputError
        Shapes that do not fit; a covariance that is not positive; angles, scales out of range.

    Notes
    -----
    Minimises (h - k E(psi))' C^-1 (h - k E(psi)) + (k - k0)^2 / sd^2 with E the Earth rate of azimuth psi in high-side
    axes. k is eliminated in closed form; no square root, no choice of roots, no complex case.

    Examples
    --------
    A reading 1 % low, latitude 45, inclination 60, azimuth 90 deg:

    >>> found = solve_joint([[0.99 * 0.75**0.5 * 0.5**0.5, -0.99 * 0.5**0.5]], [1e-6 * np.eye(2)], np.pi / 3, np.pi / 4)
    >>> np.degrees(found.azimuth).round(9), (1 / found.k).round(9)
    (array([90.]), array([1.01010101]))
    """
    h = vectors(rates, "rates", LARGEST)
    seen = np.isfinite(h[:, 2])
    wide = covariances(covariance, "covariance", seen, positive=True)
    inc = per_station(inclination, len(h), "inclination", 0.0, np.pi, "rad")
    lat = per_station(latitude, len(h), "latitude", -np.pi / 2, np.pi / 2, "rad")
    k0, sd = prior_of_k(scale, scale_sd, len(h))
    with np.errstate(divide="ignore"):
        weight = 1.0 / (sd * sd)
    cov = np.where(np.isfinite(wide), wide, np.eye(3))[:, [0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2]]
    from inclinometry.gyro import _kernels  # here and not above: it brings in numba

    out = np.empty((len(h), _kernels.COLUMNS))
    inc, lat, k0, weight = (np.ascontiguousarray(v) for v in (inc, lat, k0, weight))
    _kernels.north(h, np.ascontiguousarray(cov), inc, lat, k0, weight, out)
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

    Integrates over azimuth, k eliminated; used where the posterior has more than one peak or is flat.
    """
    circle = 1440  # azimuths over which a posterior that is not Gaussian is integrated
    psi = 2.0 * np.pi * np.arange(circle) / circle
    spread = np.empty(len(azimuth))
    for n in range(len(azimuth)):
        axes = 3 if np.isfinite(rates[n, -1]) and rates.shape[1] == 3 else 2
        # a shifted circle, so that a narrow peak is met at its top
        model = earth_in_tool(psi + azimuth[n], inclination[n], latitude[n])[:, :axes]
        lower = np.linalg.cholesky(covariance[n, :axes, :axes])
        e, h = np.linalg.solve(lower, model.T), np.linalg.solve(lower, rates[n, :axes])
        p, q = e.T @ h, np.sum(e * e, axis=0)
        w = np.inf if sd[n] == 0.0 else 1.0 / sd[n] ** 2
        k = np.full(circle, k0[n]) if np.isinf(w) else np.maximum((p + k0[n] * w) / np.maximum(q + w, 1e-300), 0.0)
        cost = np.sum((h[:, None] - k * e) ** 2, axis=0)
        if np.isfinite(w):
            cost = cost + w * (k - k0[n]) ** 2 + np.log(q + w)
        density = np.exp(-0.5 * (cost - cost.min()))
        spread[n] = np.sqrt(density @ wrap_signed(psi) ** 2 / density.sum())
    return spread


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

"""Transverse magnetic offset: the centre of the circle that the field describes while the tool turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.motion.magnetic.band import Complex

SECTORS: Final = 36
"""Of the turn, in which the field of a run is remembered until an arc suffices."""
LEAST_ROUNDNESS: Final = 1e-4
"""Of the radius: what a calibrated magnetometer's scale errors and couplings leave of a circle, a least sigma."""


LEAST_SCATTER: Final = 1e-3
"""nT, where there is no field at all."""


@dataclass(frozen=True, eq=False)
class Circle:
    """Centre and radius of the transverse field.

    Attributes
    ----------
    centre : complex
        nT.
    covariance : (2, 2) ndarray
        nT^2, of the real and imaginary part of the centre.
    radius : float
        nT.
    scatter : float
        Standard deviation of the distances from the circle, nT.
    """

    centre: complex
    covariance: Array
    radius: float
    scatter: float


def arc(angle: Array) -> float:
    """Arc covered by an angle (m,) that grows or falls without jumps, rad, at most a full turn.

    Examples
    --------
    >>> arc(np.array([0.5, 1.5, 1.0])), round(arc(np.array([0.0, 100.0])), 3)
    (1.0, 6.283)
    """
    return float(min(np.ptp(angle), 2.0 * np.pi))


def sectors(points: Complex, centre: complex) -> Complex:
    """Sums and numbers (2, SECTORS) of points by their direction from a provisional centre.

    Examples
    --------
    >>> found = sectors(np.array([1.0 + 0.1j, 3.0 + 0.1j, -1.0 + 0.1j]), 0j)
    >>> found[:, 0], int(np.count_nonzero(found[1]))
    (array([4.+0.2j, 2.+0.j ]), 2)
    """
    turn = np.mod(np.angle(points - centre) / (2.0 * np.pi), 1.0)
    place = np.minimum((turn * SECTORS).astype(int), SECTORS - 1)
    found = np.zeros((2, SECTORS), dtype=np.complex128)
    np.add.at(found[0], place, points)
    np.add.at(found[1], place, 1.0)
    return found


def fit_circle(points: Complex, start: complex, prior: Array) -> Circle:
    """Circle of least squared distances, its centre known beforehand to (2, 2) `prior` covariance about `start`.

    Notes
    -----
    Gauss-Newton on |z - h| - R. The variance is that of the distances; as they hang together in time (anomalies, a
    field that changes along the hole), their number is reduced by (1 - r) / (1 + r) with r their correlation from one
    to the next.

    Examples
    --------
    >>> z = 3.0 + 1.0j + 10.0 * np.exp(1j * np.linspace(0.0, 6.0, 50))
    >>> found = fit_circle(z, 0j, 1e4 * np.eye(2))
    >>> round(found.centre.real, 3), round(found.radius, 3)
    (3.0, 10.0)
    """
    information = np.zeros((3, 3))
    information[:2, :2] = np.linalg.inv(prior)
    origin = np.array([start.real, start.imag, 0.0])
    state = np.array([start.real, start.imag, float(np.mean(np.abs(points - start)))])
    variance, covariance = np.inf, prior
    for _ in range(20):
        away = points - complex(state[0], state[1])
        distance = np.maximum(np.abs(away), 1e-9)
        error = distance - state[2]
        variance = max(raised(error), (LEAST_ROUNDNESS * state[2]) ** 2, LEAST_SCATTER**2)
        rows = np.stack([away.real / distance, away.imag / distance, np.ones_like(distance)], axis=1)
        normal = rows.T @ rows / variance + information
        shift = np.linalg.solve(normal, rows.T @ error / variance - information @ (state - origin))
        state = state + shift
        covariance = np.linalg.inv(normal)[:2, :2]
        if float(np.hypot(shift[0], shift[1])) < 1e-6 * state[2]:
            break
    scatter = float(np.std(np.abs(points - complex(state[0], state[1])) - state[2]))
    return Circle(complex(state[0], state[1]), covariance, float(state[2]), scatter)


def raised(error: Array) -> float:
    """Mean square of errors (m,), raised for their hanging together in time so that it gives the variance of means."""
    variance = float(np.mean(error**2))
    if variance == 0.0:
        return 0.0
    r = min(max(float(np.mean(error[1:] * error[:-1])) / variance, 0.0), 0.98)
    return variance * (1.0 + r) / (1.0 - r)

"""Algebraic starting values for a triad in a field of constant strength: ellipsoid or, failing that, sphere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.core.arrays import Array


class Ellipsoid(NamedTuple):
    """Signals lie on |inverse (signals - centre)| = 1; `proper` is False where only a sphere could be fitted."""

    inverse: Array  # (3, 3), symmetric positive definite
    centre: Array  # (3,)
    proper: bool


def algebraic_sphere(signals: Array) -> tuple[Array, float]:
    """Centre and radius of the algebraic least-squares sphere, linear in the unknowns."""
    middle = signals.mean(axis=0)
    # readings that are all the same have no size; any will do, coverage is refused later
    spread = float(np.sqrt(np.mean((signals - middle) ** 2))) or 1.0
    x = (signals - middle) / spread
    design = np.column_stack([2.0 * x, np.ones(len(x))])
    solution = np.linalg.lstsq(design, np.sum(x * x, axis=1), rcond=1e-10)[0]
    radius = np.sqrt(max(float(solution[3] + solution[:3] @ solution[:3]), 1e-12))
    return middle + spread * solution[:3], float(spread * radius)


def algebraic_ellipsoid(signals: Array, rounds: int = 4) -> Ellipsoid:
    """Robust algebraic ellipsoid through (K, 3) signals: linear least squares with the trace of the quadric fixed.

    The quadric x'Qx + 2 q'x + c = 0 with trace Q = 3 is linear in its 9 remaining coefficients, never divides by a
    coefficient that may vanish (a centre at the origin, say), and is invariant under rotation. A few rounds of Huber
    weights keep one wild reading from bending it.
    """
    centre, radius = algebraic_sphere(signals)
    x = (signals - centre) / radius
    u, v, w = x.T
    square = u * u + v * v + w * w
    design = np.column_stack(
        [square - 3 * u * u, square - 3 * v * v, 2 * u * v, 2 * u * w, 2 * v * w, 2 * u, 2 * v, 2 * w, np.ones(len(x))]
    )
    weight = np.ones(len(x))
    coefficients = np.zeros(9)
    for _ in range(rounds):
        coefficients = np.linalg.lstsq(design * weight[:, None], square * weight, rcond=1e-12)[0]
        residual = np.abs(square - design @ coefficients)
        limit = max(3.0 * float(np.median(residual)), 1e-9)
        weight = np.sqrt(np.minimum(1.0, limit / np.maximum(residual, 1e-300)))
    return _from_quadric(coefficients, centre, radius)


def _from_quadric(coefficients: Array, centre: Array, radius: float) -> Ellipsoid:
    """Centre and symmetric root of the quadric, or the sphere where the quadric is not an ellipsoid of sane shape."""
    p, q, uv, uw, vw, lu, lv, lw, constant = coefficients
    # square - p(square - 3uu) - q(square - 3vv) - 2uv.. - 2lu u.. - constant = 0
    quadric = np.array(
        [
            [1 - p - q + 3 * p, -uv, -uw],
            [-uv, 1 - p - q + 3 * q, -vw],
            [-uw, -vw, 1 - p - q],
        ]
    )
    sphere = Ellipsoid(np.eye(3) / radius, centre, False)
    values, vectors = np.linalg.eigh(quadric)
    # axes more unequal than 10 to 1 are the signature of poor coverage, not of a sensor
    if values[0] < 1e-2 * values[-1]:
        return sphere
    middle = np.linalg.solve(quadric, np.array([lu, lv, lw]))
    level = float(constant + middle @ quadric @ middle)
    if not level > 0.0:
        return sphere
    inverse = (vectors * np.sqrt(values / level)) @ vectors.T / radius
    return Ellipsoid(inverse, centre + radius * middle, True)

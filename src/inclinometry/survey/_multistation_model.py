"""Stations under errors of their sensors: corrected fields, invariants against the reference, derivatives. No checks.

A station leaves azimuth, inclination and toolface free; what is left of its six readings is |g|, |b| and the dip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inclinometry.attitude.orientation import dip_angle, dip_jacobian
from inclinometry.core.arrays import Array
from inclinometry.core.lsq import Fit, Normal


class Linear(NamedTuple):
    """Whitened residuals (3n,) and their derivatives (3n, q) by the standardised parameters."""

    residual: Array
    jacobian: Array


@dataclass(frozen=True, eq=False)
class Model:
    """The problem in z, of unit prior covariance: parameters x = root z, the last three those of the reference.

    readings (n, 6), weights (n, p), gain (p, 6, 6), offset (p, 6) : as in `Priors`
    reference (3,) : g, b, dip
    root (p + 3, q) : root root' is the prior covariance
    whitener (n, 3, 3) : inverse Cholesky factors of the covariance of |g|, |b|, dip
    """

    readings: Array
    weights: Array
    gain: Array
    offset: Array
    reference: Array
    root: Array
    whitener: Array

    def fields(self, x: Array) -> tuple[Array, Array]:
        """Corrected fields (n, 6) and the inverse gains (n, 6, 6)."""
        size, active = len(self.offset), self.weights * x[: len(self.offset)]
        gain = (active @ self.gain.reshape(size, 36)).reshape(-1, 6, 6) + np.eye(6)
        inverse = np.asarray(np.linalg.inv(gain), dtype=np.float64)
        return (inverse @ (self.readings - active @ self.offset)[:, :, None])[:, :, 0], inverse

    def by_parameter(self, fields: Array, inverse: Array) -> Array:
        """Derivatives (n, 6, p) of the corrected fields by the sensors' parameters."""
        size = len(self.offset)
        moved = (fields @ self.gain.transpose(2, 0, 1).reshape(6, size * 6)).reshape(-1, size, 6)
        moved = (moved + self.offset) * self.weights[:, :, None]
        return np.asarray(-inverse @ moved.transpose(0, 2, 1))

    def linear(self, z: Array) -> Linear:
        """Whitened residuals and Jacobian at z."""
        x = self.root @ z
        fields, inverse = self.fields(x)
        residual = invariants(fields) - self.reference - x[-3:]
        jacobian = invariants_jacobian(fields) @ self.by_parameter(fields, inverse) @ self.root[:-3] - self.root[-3:]
        whitened = np.einsum("nab,nb->na", self.whitener, residual)
        return Linear(whitened.ravel(), (self.whitener @ jacobian).reshape(-1, len(z)))

    def normal(self, z: Array) -> Normal:
        """Normal equations of the maximum a posteriori estimate."""
        r, j = self.linear(z)
        return Normal(float(r @ r + z @ z), j.T @ r + z, j.T @ j + np.eye(len(z)))


def invariants(fields: Array) -> Array:
    """|g|, |b| and dip (n, 3) of fields (n, 6)."""
    g, b = fields[:, :3], fields[:, 3:]
    return np.stack([np.linalg.norm(g, axis=1), np.linalg.norm(b, axis=1), dip_angle(g, b)], axis=1)


def invariants_jacobian(fields: Array) -> Array:
    """Derivatives (n, 3, 6) of the invariants by the fields."""
    g, b = fields[:, :3], fields[:, 3:]
    rows = np.zeros((len(fields), 3, 6))
    rows[:, 0, :3] = g / np.linalg.norm(g, axis=1, keepdims=True)
    rows[:, 1, 3:] = b / np.linalg.norm(b, axis=1, keepdims=True)
    rows[:, 2] = dip_jacobian(g, b)
    return rows


def root_of(covariance: Array) -> Array:
    """Factor (p, q) with root root' = covariance; directions without variance are left out."""
    scale = np.sqrt(np.diagonal(covariance))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    keep = values > 1e-13 * max(float(values[-1]), np.finfo(float).tiny)
    return np.asarray(scale[:, None] * vectors[:, keep] * np.sqrt(values[keep]))


def left_out(model: Model, fit: Fit[Array], azimuth: Array) -> tuple[Array, Array]:
    """Largest change of azimuth (n,), rad, without each station, and its squared error against the others' prediction.

    Linear about the estimate: dz = C J' (1 - J C J')^-1 r for the rows of one station.
    """
    r, j = model.linear(fit.estimate)
    residual, jacobian = r.reshape(-1, 3), j.reshape(len(azimuth), 3, -1)
    gain = fit.covariance @ np.swapaxes(jacobian, 1, 2)
    predicted = np.linalg.solve(np.eye(3) - jacobian @ gain, residual[:, :, None])
    moved = (gain @ predicted)[:, :, 0] @ (azimuth @ model.root[:-3]).T
    return np.abs(moved).max(axis=1), np.einsum("na,na->n", residual, predicted[:, :, 0])

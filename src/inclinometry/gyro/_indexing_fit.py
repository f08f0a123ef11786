"""Least squares for many stations at once: arrays in and out, no checks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.core.arrays import Array, Index, Mask

DETERMINED = 1e-10
"""Smallest eigenvalue of the scaled normal matrix that still counts as determined; rounding leaves about 1e-16."""

REDUNDANT = 1e-6
"""Smallest share of a row that its residual must keep for the others to say anything about it."""


class Columns(NamedTuple):
    """Which unknown each column of the design is: v_x, v_y[, v_z], a bias of each free channel[, a drift of each]."""

    field: int  # 2, or 3 when z is seen
    biased: Index  # indices of channels whose bias is fitted
    drift: bool
    prior: Array  # (q,) information (1/sd^2) of each column before the readings, about zero

    def width(self, channels: int) -> int:
        """Number of unknowns of a station."""
        return self.field + len(self.biased) + channels * self.drift

    def bias_slots(self) -> slice:
        """Columns of the biases."""
        return slice(self.field, self.field + len(self.biased))


class Solved(NamedTuple):
    """Fits of S stations of P rows and m channels; q unknowns."""

    estimate: Array  # (S, q)
    covariance: Array  # (S, q, q)
    residual: Array  # (S, P, m) reading minus model
    chi_square: Array  # (S,) prior included
    dof: Array  # (S,)
    determined: Mask  # (S,)
    redundancy: Array  # (S, m) readings of a channel less the unknowns they pay for
    statistic: Array  # (S, P) drop in chi-square when a row is left out; NaN where the others cannot replace it


def design(index: Array, time: Array, tensor: Array, columns: Columns, damping: float) -> Array:
    """Design (S, P, m, q): the readings of row k are N R_z(index_k) diag(damping, damping, 1) v + bias + drift time.

    index, time : (S, P); tensor (S, P, m, 3); time as it shall be used, i.e. centred and scaled.
    """
    channels = tensor.shape[-2]
    cosine, sine = damping * np.cos(index)[..., None], damping * np.sin(index)[..., None]
    x, y = tensor[..., 0], tensor[..., 1]
    out = np.zeros((*tensor.shape[:-1], columns.width(channels)))
    out[..., 0] = x * cosine - y * sine
    out[..., 1] = x * sine + y * cosine
    if columns.field == 3:
        out[..., 2] = tensor[..., 2]
    for place, channel in enumerate(columns.biased):
        out[:, :, channel, columns.field + place] = 1.0
    if columns.drift:
        first = columns.field + len(columns.biased)
        for channel in range(channels):
            out[:, :, channel, first + channel] = time
    return out


def solve(matrix: Array, values: Array, weight: Array, columns: Columns) -> Solved:
    """Weighted least squares of every station; weight (S, P, m) is 1/sd, zero for what is left out."""
    stations, rows, channels, width = matrix.shape
    whitened = matrix * weight[..., None]
    flat = whitened.reshape(stations, rows * channels, width)
    target = (values * weight).reshape(stations, rows * channels, 1)
    normal = flat.swapaxes(1, 2) @ flat + np.diag(columns.prior)
    scale = _scale(normal)
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    determined = np.linalg.eigvalsh(scaled)[:, 0] > DETERMINED
    # what is not determined is only reported as such, its numbers are never used
    scaled[~determined] = np.eye(width)
    inverse = np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :])
    estimate = inverse @ (flat.swapaxes(1, 2) @ target)
    # one step of refinement: large biases cost the normal equations digits
    estimate += inverse @ (flat.swapaxes(1, 2) @ (target - flat @ estimate) - columns.prior[:, None] * estimate)
    left = (target - flat @ estimate).reshape(stations, rows, channels)
    estimate = estimate[..., 0]
    used = weight > 0.0
    leverage = np.einsum("skmq,sqr,sknr->skmn", whitened, inverse, whitened, optimize=True)
    return Solved(
        estimate=estimate,
        covariance=inverse,
        residual=values - (matrix @ estimate[:, None, :, None])[..., 0],
        chi_square=np.sum(left**2, axis=(1, 2)) + estimate**2 @ columns.prior,
        dof=used.sum(axis=(1, 2)) + np.count_nonzero(columns.prior) - float(width),
        determined=determined,
        redundancy=used.sum(axis=1) - np.einsum("skmm->sm", leverage),
        statistic=_deletion(left, leverage, np.asarray(used.any(axis=2))),
    )


def _scale(normal: Array) -> Array:
    """Scale (S, q) of the unknowns; x and y share one, so that positions that do not see y show as undetermined."""
    diagonal = np.diagonal(normal, axis1=1, axis2=2).copy()
    diagonal[:, :2] = diagonal[:, :2].sum(axis=1, keepdims=True)
    return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def _deletion(left: Array, leverage: Array, used: Mask) -> Array:
    """Drop in chi-square (S, P) when a row is left out: r' (1 - H)^-1 r of the row's own block."""
    own = np.eye(left.shape[-1]) - leverage
    replaceable = used & (np.linalg.eigvalsh(own)[..., 0] > REDUNDANT)
    own[~replaceable] = np.eye(left.shape[-1])
    drop = np.einsum("skm,skm->sk", left, np.linalg.solve(own, left[..., None])[..., 0])
    return np.where(replaceable, drop, np.nan)

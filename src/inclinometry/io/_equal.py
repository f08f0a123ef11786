"""Equal extremes that the attitudes alone do not give away: judged by noise, and by the field's direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inclinometry.core.arrays import Array

IMPROBABLE = 1e-3
FLAT = 0.1  # share of a channel's largest sensitivity to attitude below which its scatter is that of the sensor
_SWEEPS = 30


def field_basis(values: Array, cosines: Array) -> Array:
    """What a linear sensor sees of one field fixed in the rig, and a one: (n, 4).

    The field's direction is the one that fits channels (n, m) best, found by turns with the sensors' axes.
    """
    turned = cosines.reshape(-1, 3, 3)
    matrix, *_ = np.linalg.lstsq(np.column_stack([cosines, np.ones(len(cosines))]), values, rcond=1e-9)
    field = np.linalg.svd(matrix[:9].T.reshape(-1, 3))[2][0]
    for _ in range(_SWEEPS):
        basis = np.column_stack([turned @ field, np.ones(len(turned))])
        model, *_ = np.linalg.lstsq(basis, values, rcond=1e-9)
        seen = np.einsum("im,nij->nmj", model[:3], turned).reshape(-1, 3)
        field, *_ = np.linalg.lstsq(seen, (values - model[3]).ravel(), rcond=1e-9)
        field /= np.linalg.norm(field) or 1.0
    return np.column_stack([turned @ field, np.ones(len(turned))])


def improbably_equal(values: Array, channel: int, at: NDArray[np.bool_], basis: Array) -> bool:
    """Whether the scatter between stations at one attitude makes it improbable that readings `at` agree exactly.

    The scatter is pooled over all channels (n, m) and attitudes (rows of `basis` (n, 4)) at which an error of the
    attitude matters as little as at these stations. That of n normal readings with standard deviation s, rounded to
    steps d, all agree has the probability (d / (s sqrt(2 pi)))^(n - 1) / sqrt(n) at most.
    """
    attitudes, group = np.unique(basis.round(6) + 0.0, axis=0, return_inverse=True)
    group = group.ravel()
    model, *_ = np.linalg.lstsq(basis, values, rcond=1e-9)
    slope = np.linalg.norm(np.cross(model[:3].T[None], attitudes[:, None, :3]), axis=-1)
    there, size = np.unique(group[at]), np.bincount(group)
    flat = slope <= np.maximum(FLAT * slope.max(axis=0), slope[there, channel].max())
    flat[there, channel] = False
    total = np.stack([np.bincount(group, column) for column in values.T], axis=1)
    left = values - (total / size[:, None])[group]
    squares = np.stack([np.bincount(group, column**2) for column in left.T], axis=1)
    free = int(((size - 1)[:, None] * flat).sum())
    steps = np.diff(np.unique(values))
    if free < 2 or len(steps) == 0:
        return False
    spread, count = np.sqrt(squares[flat].sum() / free), int(at.sum()) - len(there)
    step = steps[steps > 1e-9 * np.abs(values).max()].min(initial=np.inf)
    if count < 2 or not spread > step:
        return False
    return bool((step / (spread * np.sqrt(2.0 * np.pi))) ** count / np.sqrt(count + 1.0) < IMPROBABLE)

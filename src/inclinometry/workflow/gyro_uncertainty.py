"""What a calibration leaves open of readings at index positions and of the field they give."""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.sensors import Tool


def reading_variance(tool: Tool, kind: str, powers: Array) -> Array:
    """Variance (n, m) of a reading by what is not known of the tensor, mean over the directions of the field."""
    triad = tool.triads[kind]
    size, count = triad.degree + 1, triad.count
    own = tool.covariance[tool.slices[kind], tool.slices[kind]].reshape(size, count, 4, size, count, 4)
    mean = np.einsum("psaqsa->spq", own[:, :, :3, :, :, :3]) / 3.0
    return np.asarray(np.einsum("np,spq,nq->ns", powers, mean, powers))


def field_covariance_of_calibration(tool: Tool, kind: str, field: Array, heat: Array | None) -> Array:
    """Covariance (n, 3, 3) of a field from its triad's tensor; offsets are turned away by the index."""
    triad = tool.triads[kind]
    seen = np.nan_to_num(field)
    strength = np.linalg.norm(seen, axis=1, keepdims=True)
    regressor = np.concatenate([seen / (triad.field_strength or strength.mean()), np.zeros((len(seen), 1))], axis=1)
    powers = np.broadcast_to(triad.basis(heat), (len(seen), triad.degree + 1))
    design = (powers[:, :, None] * regressor[:, None, :]).reshape(len(seen), -1)
    size, count = triad.degree + 1, triad.count
    own = tool.covariance[tool.slices[kind], tool.slices[kind]].reshape(size, count, 4, size, count, 4)
    ordered = own.transpose(1, 0, 2, 4, 3, 5).reshape(count, size * 4, count, size * 4)
    inverse = np.broadcast_to(triad.inverse(heat), (len(seen), 3, count))
    signal = np.einsum("np,apbq,nq->nab", design, ordered, design, optimize=True)
    return np.asarray(inverse @ signal @ np.swapaxes(inverse, -1, -2)) * (triad.field_strength or strength.mean()) ** 2

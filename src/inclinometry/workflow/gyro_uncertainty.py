"""What a calibration leaves open of readings at index positions and of the field they give."""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.sensors import Tool, by_parameter


def reading_variance(tool: Tool, kind: str, powers: Array) -> Array:
    """Variance (n, m) of a reading by what is not known of the tensor, mean over the directions of the field."""
    triad = tool.triads[kind]
    size, count = triad.degree + 1, triad.count
    own = tool.covariance[tool.slices[kind], tool.slices[kind]].reshape(size, count, 4, size, count, 4)
    mean = np.einsum("psaqsa->spq", own[:, :, :3, :, :, :3]) / 3.0
    return np.asarray(np.einsum("np,spq,nq->ns", powers, mean, powers))


def field_by_calibration(tool: Tool, kind: str, field: Array, heat: Array | None) -> Array:
    """Derivatives (n, 3, p) of a field by all parameters of the tool; offsets are turned away by the index."""
    triad = tool.triads[kind]
    seen = np.nan_to_num(field)
    strength = triad.field_strength or float(np.linalg.norm(seen, axis=1).mean())
    inverse = np.broadcast_to(strength * triad.inverse(heat), (len(seen), 3, triad.count))
    own = by_parameter(triad, seen / strength, inverse, heat)
    own[..., 3::4] = 0.0
    found = np.zeros((len(seen), 3, len(tool.covariance)))
    found[..., tool.slices[kind]] = own
    return found

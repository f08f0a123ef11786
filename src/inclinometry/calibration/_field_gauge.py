"""What a field calibration cannot see, set by convention: the turn of the tool axes about the tool axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inclinometry.calibration._field_model import Unknowns, turned
from inclinometry.calibration._field_noise import Estimate
from inclinometry.calibration.norm import unit
from inclinometry.core.arrays import Array


def canonical(found: Estimate, flip: bool) -> tuple[Unknowns, Array]:
    """The fit in canonical tool axes, and the projection (P, P) that takes the gauge out of its covariance.

    The turn makes sum axis_0.x + axis_1.y largest over the first two sensors of the first triad, which is the polar
    decomposition of their projections on the x-y plane. Where these are mirror images (the sum is the same for every
    turn), the sensor lying more across the tool axis carries its own axis alone.
    """
    sign = -1.0 if flip else 1.0
    axes = sign * unit(found.at.tensors[0])
    weights = _carriers(axes)
    # the sum after a turn by t is cos t (n0x + n1y) + sin t (n0y - n1x)
    along = weights[0] * axes[0, 0] + weights[1] * axes[1, 1]
    across = weights[0] * axes[0, 1] - weights[1] * axes[1, 0]
    at = turned(found.at, float(np.arctan2(across, along)))
    return at, _projection(found, at, sign, weights)


def _carriers(axes: Array) -> Array:
    """Weights of the first two sensors in the convention."""
    size = np.hypot(axes[0, 0] + axes[1, 1], axes[0, 1] - axes[1, 0])
    if size > 0.3:
        return np.ones(2)
    return np.asarray(np.eye(2)[int(np.argmax(np.linalg.norm(axes[:2, :2], axis=1)))])


def _projection(found: Estimate, at: Unknowns, sign: float, weights: Array) -> Array:
    """I - g c' / (c' g): changes of the parameters with the convention h = n0y - n1x = 0 kept; c is the slope of h."""
    problem, tensor = found.problem, at.tensors[0]
    length = np.linalg.norm(tensor, axis=1)
    axes = tensor / length[:, None]
    slope = np.zeros(problem.size)
    for sensor, axis, factor in ((0, 1, weights[0]), (1, 0, -weights[1])):
        gradient = (np.eye(3)[axis] - axes[sensor] * axes[sensor, axis]) / length[sensor]
        slope[4 * sensor : 4 * sensor + 3] = sign * factor * gradient
    gauge = problem.gauge(at)
    return np.asarray(np.eye(problem.size) - np.outer(gauge, slope) / (slope @ gauge))


def warn_axes(kinds: Sequence[str], at: Unknowns, flip: bool) -> list[str]:
    """A sentence for each triad of three whose sensors do not lie near the tool axes of the same name."""
    out = []
    for kind, tensor in zip(kinds, at.tensors, strict=True):
        if len(tensor) != 3:
            continue
        axes = unit(tensor) * (-1.0 if flip and kind == "accelerometer" else 1.0)
        if np.min(np.diagonal(axes)) < np.cos(np.radians(45.0)):
            found = ", ".join(f"{i + 1} along {_nearest(axis)}" for i, axis in enumerate(axes))
            out.append(
                f"{kind}: sensors lie {found} of the tool; if this is not how it is built, check the axes mapping"
            )
    return out


def _nearest(axis: Array) -> str:
    """The signed tool axis nearest to a direction."""
    i = int(np.argmax(np.abs(axis)))
    return f"{'-' if axis[i] < 0 else '+'}{'xyz'[i]}"

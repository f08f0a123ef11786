"""How well a set of field directions covers the sphere: distinct ones, and whether they all lie on one side."""

from __future__ import annotations

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import IdentifiabilityError

DISTINCT = np.radians(5.0)
"""Directions closer than this count as one."""

ONE_SIDED = 0.05
"""Distance of the origin from the hull of the unit directions beyond which they lie in one open half of the sphere."""


def unit(vectors: Array) -> Array:
    """Vectors divided by their lengths; a zero vector stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def distinct(directions: Array, limit: int = 1000) -> int:
    """Number of directions (K, 3) at least `DISTINCT` apart, counted greedily up to `limit`."""
    left, cosine, count = unit(directions), np.cos(DISTINCT), 0
    while len(left) and count < limit:
        left = left[left @ left[0] < cosine]
        count += 1
    return count


def one_sided(directions: Array) -> Array | None:
    """The direction all (K, 3) directions lean towards, or None when they surround the origin.

    The distance of the convex hull from the origin is the largest margin any plane through the origin can have.
    """
    from scipy.optimize import nnls

    points = unit(directions)
    if len(points) > 500:
        # the hull of many readings is that of their extremes along many fixed directions
        probes = np.random.default_rng(0).normal(size=(400, 3))
        points = points[np.unique(np.argmax(points @ probes.T, axis=0))]
    weights, _ = nnls(np.vstack([points.T, np.full(len(points), 1e3)]), np.array([0.0, 0.0, 0.0, 1e3]))
    nearest = weights @ points / max(float(weights.sum()), 1e-12)
    distance = float(np.linalg.norm(nearest))
    return np.asarray(nearest / distance) if distance > ONE_SIDED else None


def require_coverage(kind: str, directions: Array, needed: int) -> int:
    """Raise in words when directions are too few or all on one side; return the number of distinct ones."""
    count = distinct(directions)
    if count < needed:
        raise IdentifiabilityError(
            f"{kind}: {count} distinct field directions (5 deg apart); at least {needed} are needed: "
            "put the tool into more attitudes, all over the sphere"
        )
    side = one_sided(directions)
    if side is not None:
        axis = int(np.argmax(np.abs(side)))
        raise IdentifiabilityError(
            f"{kind}: all {len(directions)} field directions lie on one side (mostly {'+-'[int(side[axis] < 0)]}"
            f"{'xyz'[axis]}); offset and scale cannot be told apart there: add attitudes turned the other way up"
        )
    return count

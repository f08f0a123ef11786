"""Attitude from two or more directions seen both in tool axes and in reference axes (Wahba's problem), with covariance.

Three solutions: TRIAD trusts the first direction and takes from the second only what the first cannot tell; Davenport's
q and the SVD both give the maximum-likelihood attitude of any number of directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen
from inclinometry.errors import IdentifiabilityError, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding
from inclinometry.orientation import Angles, angles
from inclinometry.rotations import dcm_from_quaternion
from inclinometry.tabular import Column, Tabular, degrees


@dataclass(frozen=True, eq=False, repr=False)
class VectorAttitude(Tabular):
    """Attitude from n directions: dcm (..., 3, 3), reference to tool components, with 2 n - 3 degrees of freedom.

    covariance : of the rotation e, tool axes, rad^2: dcm = (1 + [e x]) true dcm. For small independent errors, equal
        across each direction, and exact references; not scaled by `loss`, which is then chi-square.
    observability : smallest over largest eigenvalue of the Fisher information, 0 for directions on one line.
    """

    dcm: Array
    covariance: Array
    loss: Array
    degrees_of_freedom: int
    observability: Array
    method: str

    @property
    def angles(self) -> Angles:
        """Azimuth (from the reference's x axis), inclination and toolface, for a reference with z down."""
        return angles(self.dcm[..., :, 2], self.dcm[..., :, 0])

    def to_dict(self) -> dict[str, Column]:
        """One row an attitude: its angles, how well the directions agree and how well they determine it."""
        found: dict[str, Column] = {f"{name}_deg": degrees(a).ravel() for name, a in self.angles._asdict().items()}
        return found | {"loss": np.ravel(self.loss), "observability": np.ravel(self.observability)}


def solve_triad(tool: ArrayLike, reference: ArrayLike, sigmas: ArrayLike) -> VectorAttitude:
    """Attitude from exactly two directions, the first (the better one) reproduced exactly; sigmas across each, rad.

    Shuster M.D., Oh S.D., "Three-axis attitude determination from vector observations", J. Guidance and Control 4(1),
    1981, pp. 70-77; covariance in the tool frame, with c = w1.w2:
    P = s1^2 1 + [(s2^2 - s1^2) w1 w1' + s1^2 c (w1 w2' + w2 w1')] / |w1 x w2|^2
    """
    w, v, sigma = _inputs(tool, reference, sigmas)
    if w.shape[-2] != 2:
        raise wrong_shape("tool", w.shape, "(..., 2, 3)")
    _require(np.minimum(_sine(w), _sine(v)) ** 2)
    matrix = _frame(w) @ np.swapaxes(_frame(v), -1, -2)
    w1, w2 = w[..., 0, :, None], w[..., 1, :, None]
    s1, s2 = sigma[..., 0, None, None] ** 2, sigma[..., 1, None, None] ** 2
    cosine = np.sum(w1 * w2, axis=-2, keepdims=True)
    mixed = w1 @ np.swapaxes(w2, -1, -2)
    inner = (s2 - s1) * (w1 @ np.swapaxes(w1, -1, -2)) + s1 * cosine * (mixed + np.swapaxes(mixed, -1, -2))
    covariance = s1 * np.eye(3) + inner / _sine(w)[..., None, None] ** 2
    return _result(w, v, sigma, matrix, covariance, "TRIAD")


def solve_davenport(tool: ArrayLike, reference: ArrayLike, sigmas: ArrayLike) -> VectorAttitude:
    """Maximum-likelihood attitude from n >= 2 directions: the largest eigenvector of Davenport's 4 x 4 matrix.

    Parameters
    ----------
    tool, reference : (..., n, 3) array_like
        Vectors in tool axes and in reference axes; only directions count.
    sigmas : (..., n) array_like
        Standard deviation of each measured direction, rad, in either direction across it.

    Raises
    ------
    InputError
        Wrong shapes, a zero vector, a sigma that is not positive.
    IdentifiabilityError
        When the directions lie along one line, or contradict each other so that two attitudes fit alike.

    Notes
    -----
    Davenport's q-method as in Shuster and Oh (1981), the problem QUEST solves by Newton's method, here by a symmetric
    eigendecomposition that needs no starting value and has no singular attitude. Covariance: inverse of
    sum ((w.Cv) 1 - sym(w (Cv)')) / s^2, the loss function's own curvature.

    Examples
    --------
    >>> found = solve_davenport(np.eye(3), np.eye(3)[[1, 2, 0]], [1e-3, 1e-3, 1e-3])
    >>> found.dcm.round(12) + 0.0
    array([[0., 1., 0.],
           [0., 0., 1.],
           [1., 0., 0.]])
    >>> np.sqrt(found.covariance.diagonal()).round(6)
    array([0.000707, 0.000707, 0.000707])
    """
    w, v, sigma = _inputs(tool, reference, sigmas)
    b = _profile(w, v, sigma)
    trace = np.trace(b, axis1=-2, axis2=-1)[..., None, None]
    twist = np.stack([b[..., 2, 1] - b[..., 1, 2], b[..., 0, 2] - b[..., 2, 0], b[..., 1, 0] - b[..., 0, 1]], axis=-1)
    lower = b + np.swapaxes(b, -1, -2) - trace * np.eye(3)
    top = np.concatenate([trace, twist[..., None, :]], axis=-1)
    k = np.concatenate([top, np.concatenate([twist[..., :, None], lower], axis=-1)], axis=-2)
    _, vectors = np.linalg.eigh(k)
    matrix = dcm_from_quaternion(vectors[..., :, -1])
    return _result(w, v, sigma, matrix, None, "Davenport q")


def solve_svd(tool: ArrayLike, reference: ArrayLike, sigmas: ArrayLike) -> VectorAttitude:
    """Maximum-likelihood attitude from n >= 2 directions by a singular value decomposition; sigmas across each, rad.

    Markley F.L., "Attitude determination using vector observations and the singular value decomposition", J.
    Astronautical Sciences 36(3), 1988. Same estimate and covariance as `solve_davenport`.
    """
    w, v, sigma = _inputs(tool, reference, sigmas)
    left, _, right = np.linalg.svd(_profile(w, v, sigma))
    # a mirror is not an attitude: turn the least determined axis over where needed
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    left = left * np.stack([np.ones_like(sign), np.ones_like(sign), sign], axis=-1)[..., None, :]
    return _result(w, v, sigma, left @ right, None, "SVD")


def _inputs(tool: ArrayLike, reference: ArrayLike, sigmas: ArrayLike) -> tuple[Array, Array, Array]:
    """Unit directions and sigmas, broadcast over the leading axes."""
    w, v = finite(tool, "tool", (None, 3)), finite(reference, "reference", (None, 3))
    count = w.shape[-2]
    if v.shape[-2] != count or count < 2:
        raise wrong_shape("tool, reference", f"{w.shape}, {v.shape}", "(n, 3), (n, 3), n >= 2")
    sigma = finite(sigmas, "sigmas", (count,))
    if not (sigma > 0.0).all():
        raise out_of_range("sigmas", float(sigma.min()), "> 0")
    shape = np.broadcast_shapes(w.shape[:-2], v.shape[:-2], sigma.shape[:-1])
    directions = []
    for vector, name in ((w, "tool"), (v, "reference")):
        length = np.linalg.norm(vector, axis=-1, keepdims=True)
        if not (length > 0.0).all():
            raise refused("sensor-vector-zero", {"name": name})
        directions.append(np.broadcast_to(vector / length, (*shape, count, 3)))
    return directions[0], directions[1], np.broadcast_to(sigma, (*shape, count))


def _profile(w: Array, v: Array, sigma: Array) -> Array:
    """Attitude profile matrix B = sum w v' / sigma^2, scaled to sum of weights 1."""
    weights = sigma**-2.0
    weights = weights / weights.sum(axis=-1, keepdims=True)
    return np.asarray(np.swapaxes(w * weights[..., None], -1, -2) @ v)


def _sine(pair: Array) -> Array:
    """Sine of the angle between the two directions of a pair."""
    return np.asarray(np.linalg.norm(np.cross(pair[..., 0, :], pair[..., 1, :]), axis=-1))


def _frame(pair: Array) -> Array:
    """Right-handed axes, as columns, from a pair of directions: the first, the normal of both, and the third."""
    first = pair[..., 0, :]
    second = np.cross(first, pair[..., 1, :])
    second = second / np.linalg.norm(second, axis=-1, keepdims=True)
    return np.stack([first, second, np.cross(first, second)], axis=-1)


def _require(observability: Array) -> None:
    smallest = 1e-10  # observability below which rounding, divided by it, reaches a microradian: refused
    if observability.size and float(observability.min()) < smallest:
        raise IdentifiabilityError(
            Finding("sensor-directions-parallel", {"observability": float(observability.min()), "least": smallest})
        )


def _result(w: Array, v: Array, sigma: Array, matrix: Array, covariance: Array | None, method: str) -> VectorAttitude:
    """Common end of the three solutions: loss, curvature, covariance from it unless the method has its own."""
    predicted = v @ np.swapaxes(matrix, -1, -2)
    weights = sigma**-2.0
    loss = np.sum(weights * np.sum((w - predicted) ** 2, axis=-1), axis=-1)
    outer = np.swapaxes(w * weights[..., None], -1, -2) @ predicted
    outer = 0.5 * (outer + np.swapaxes(outer, -1, -2))
    curvature = np.trace(outer, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - outer
    values, vectors = np.linalg.eigh(curvature)
    observability = values[..., 0] / values[..., 2]
    if covariance is None:
        _require(observability)
        covariance = (vectors / values[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    degrees_of_freedom = 2 * w.shape[-2] - 3
    return VectorAttitude(
        frozen(matrix), frozen(covariance), frozen(loss), degrees_of_freedom, frozen(observability), method
    )

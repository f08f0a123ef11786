"""Where a field calibration starts: ellipsoid of each triad, rotation between them, tool axis, attitudes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from inclinometry.calibration._field_model import Shots, Unknowns, rotations
from inclinometry.calibration.norm import algebraic_ellipsoid, unit
from inclinometry.core.arrays import Array


def triad_start(signals: Array) -> tuple[Array, Array, bool]:
    """Tensor (m, 3) and offset (m,) in the triad's own axes, and whether the ellipsoid was one.

    More than three sensors see a three-dimensional field: the readings lie in a three-dimensional plane, which singular
    vectors span; the ellipsoid is fitted there. For three sensors the tensor is the one nearest to the nominal axes.
    """
    if signals.shape[1] == 3:
        basis, middle = np.eye(3), np.zeros(3)
    else:
        middle = signals.mean(axis=0)
        basis = np.linalg.svd(signals - middle, full_matrices=False)[2][:3]
    shape = algebraic_ellipsoid((signals - middle) @ basis.T)
    return basis.T @ np.linalg.inv(shape.inverse), middle + basis.T @ shape.centre, shape.proper


def cube() -> Array:
    """The 24 proper rotations that map the axes onto each other, (24, 3, 3)."""
    out = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0.0:
                out.append(matrix)
    return np.array(out)


def rotations_between(a: Array, b: Array, keep: int = 3) -> list[Array]:
    """Proper rotations Q that make a'Qb as constant as possible over the stations, best first, distinct ones only.

    Gauss-Newton on the rotation group from all 24 rotations of the cube at once, and from the linear solution.
    """
    candidates = np.concatenate([cube(), _linear_rotation(a, b)[None]])
    for _ in range(30):
        turned = b @ np.swapaxes(candidates, 1, 2)  # (c, K, 3)
        value = np.einsum("ki,cki->ck", a, turned)
        slope = np.cross(turned, a)  # d(a . w x Qb) = w . (Qb x a)
        value = value - value.mean(axis=1, keepdims=True)
        slope = slope - slope.mean(axis=1, keepdims=True)
        matrix = np.einsum("cki,ckj->cij", slope, slope) + 1e-6 * np.eye(3)
        step = -np.linalg.solve(matrix, np.einsum("cki,ck->ci", slope, value)[..., None])[..., 0]
        size = np.linalg.norm(step, axis=1, keepdims=True)
        candidates = rotations(step * np.minimum(1.0, 0.5 / np.maximum(size, 1e-12))) @ candidates
    spread = np.einsum("ki,cij,kj->ck", a, candidates, b).std(axis=1)
    chosen: list[Array] = []
    for index in np.argsort(spread):
        q = candidates[index]
        if all(np.trace(q @ other.T) < 1.0 + 2.0 * np.cos(np.radians(3.0)) for other in chosen):
            chosen.append(q)
        if len(chosen) == keep:
            break
    return chosen


def _linear_rotation(a: Array, b: Array) -> Array:
    """Rotation nearest to the matrix M of least |a'Mb - s|, linear in M and s."""
    design = np.column_stack([np.einsum("ki,kj->kij", a, b).reshape(len(a), 9), -np.ones(len(a))])
    matrix = np.linalg.svd(design)[2][-1][:9].reshape(3, 3)
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def tool_axis(directions: Sequence[Array], member: Array, sets: int) -> tuple[Array, Array]:
    """Direction whose component stays the same within each roll set, and the three singular values of the scatter.

    directions : one (K, 3) for each triad, all in the same axes.
    """
    rows = [d[member == s] - d[member == s].mean(axis=0) for d in directions for s in range(sets)]
    _, singular, vectors = np.linalg.svd(np.concatenate(rows))
    return vectors[-1], singular


def attitudes(kinds: Sequence[str], fields: Sequence[Array]) -> tuple[Array, float]:
    """Attitude (north-east-down to tool) of each station from its unit fields, and the dip (0 for a single field)."""
    down = fields[0]
    if len(kinds) == 2:
        dip = float(np.arcsin(np.clip(np.mean(np.sum(fields[0] * fields[1], axis=1)), -1.0, 1.0)))
        other = fields[1]
    else:
        # the heading is free: let the tool axis point north
        dip, other = 0.0, np.broadcast_to(np.array([0.0, 0.0, 1.0]), down.shape)
        other = other + 1e-9 * np.array([1.0, 0.0, 0.0])
    north = unit(other - np.sum(other * down, axis=1, keepdims=True) * down)
    east = np.cross(down, north)
    return np.stack([north, east, down], axis=-1), dip


def unknowns(shots: Shots, triads: Sequence[tuple[Array, Array]], between: Array, axis: Array) -> Unknowns:
    """Everything in tool axes: z along `axis` (given in the first triad's own axes), x any direction across it."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    x = unit(helper - (helper @ axis) * axis)
    frame = np.stack([x, np.cross(axis, x), axis])
    tensors, offsets, fields = [], [], []
    for j, (tensor, offset) in enumerate(triads):
        turn = frame if j == 0 else frame @ between
        tensors.append(tensor @ turn.T)
        offsets.append(offset)
        fields.append(unit((shots.signals[j] - offset) @ np.linalg.pinv(tensors[-1]).T))
    attitude, dip = attitudes(shots.kinds, fields)
    pointing = np.array([unit(attitude[shots.member == s, 2, :].mean(axis=0)) for s in range(shots.sets)])
    return Unknowns(tensors, offsets, dip, pointing.reshape(-1, 3), attitude)

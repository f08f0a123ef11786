"""From moments of the signals to a triad: the product of a sensor's vector and the field's direction, taken apart.

A signal U = n . C a + U0 is linear in the nine products n_l a_j and in U0. A plan that determines those ten numbers for
every sensor (twelve, orthogonal) is a fixed matrix, and the rest is the same for all such plans: the products of all
sensors form a matrix of rank one, whose leading right singular vector is the direction a of the field in rig axes, and
the n are the projections on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.calibration.closed import ClosedForm
from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import IdentifiabilityError, InputError

DOWN = (0.0, 0.0, 1.0)
"""Down in rig axes: the field of gravity, and a hint that holds for the magnetic field where the dip is positive."""

_BLOCK = 4096  # calibrations at a time: their moments stay in the cache
_SQUARINGS = 5
_LEAST_SHARE = 0.9  # of the power along one direction; less is not a calibration but a mix-up


@dataclass(frozen=True, eq=False)
class Moments:
    """A plan as a linear map from the K signals of a sensor to its products n_l a_j and its offset.

    weights : (10, K); row 3 j + l gives n_l a_j, row 9 gives U0.
    """

    weights: Array

    @property
    def precision(self) -> Array:
        """(3, 3), [j, l] = inverse variance of n_l a_j for signals of unit variance."""
        return np.asarray(1.0 / np.einsum("rk,rk->r", self.weights[:9], self.weights[:9]).reshape(3, 3))

    @property
    def offset_gain(self) -> Array:
        """(3, 3), [j, l] = minus the regression of U0 on n_l a_j: what a misfit of the product says of the offset."""
        shared = (self.weights[:9] @ self.weights[9]).reshape(3, 3)
        # rounding of a product that is zero by the plan's symmetry is not worth a pass over the data
        return np.where(np.abs(shared) > 1e-12, -shared * self.precision, 0.0)


def unit_direction(value: ArrayLike, name: str) -> Array:
    """`value` (3,) at length 1; an error when it has no length.

    Examples
    --------
    >>> unit_direction([0, 0, 9.8], "gravity")
    array([0., 0., 1.])
    """
    vector = finite(value, name, (3,))
    length = float(np.linalg.norm(vector))
    if vector.ndim != 1 or length == 0.0:
        raise InputError(f"{name} is {np.asarray(value).tolist()}; expected one direction of three components")
    return np.asarray(vector / length)


def solve_moments(
    signals: ArrayLike, moments: Moments, sign_hint: ArrayLike = DOWN, known_direction: ArrayLike | None = None
) -> ClosedForm:
    """Calibrate a triad, or a batch of triads, whose plan determines all products n_l a_j.

    Parameters
    ----------
    signals : (..., K, m) array_like
        Signals at the K stations of the plan.
    moments : Moments
        The plan.
    sign_hint : (3,) array_like
        A direction in rig axes with which the field makes an acute angle: the one fact the signals cannot give.
    known_direction : (3,) array_like, optional
        The field's direction in rig axes where it is trusted; it is then used instead of being found.

    Raises
    ------
    InputError
        Shapes that do not go together, values not finite.
    IdentifiabilityError
        Signals that do not follow one field direction, or a field nearly at right angles to `sign_hint`.
    """
    values = finite(signals, "signals", (moments.weights.shape[1], None))
    batch, (stations, count) = values.shape[:-2], values.shape[-2:]
    flat = values.reshape(-1, stations * count)
    # one matrix for all sensors of all triads: a single product of two large matrices
    spread = np.kron(moments.weights, np.eye(count))
    hint = unit_direction(sign_hint, "sign_hint")
    known = None if known_direction is None else unit_direction(known_direction, "known_direction")
    tensor, offset, direction = np.empty((len(flat), count, 3)), np.empty((len(flat), count)), np.empty((len(flat), 3))
    for first in range(0, len(flat), _BLOCK):
        rows = slice(first, first + _BLOCK)
        moment = spread @ flat[rows].T
        products, level = moment[: 9 * count].reshape(3, 3, count, -1), moment[9 * count :]
        sums = _sums(products)
        a = signed(_leading(sums), hint) if known is None else np.repeat(known[:, None], level.shape[1], axis=1)
        _check_share(sums, a)
        n, u0 = _project(products, level, a, moments)
        tensor[rows], offset[rows], direction[rows] = n.transpose(2, 1, 0), u0.T, a.T
    return ClosedForm(tensor.reshape(*batch, count, 3), offset.reshape(*batch, count), direction.reshape(*batch, 3))


def signed(a: Array, hint: Array) -> Array:
    """The axes a (3, B) with the sign that makes an acute angle with the hint (3,).

    Raises
    ------
    IdentifiabilityError
        Where an axis is so nearly at right angles to the hint that the sign would be a guess.
    """
    along = hint @ a
    if np.abs(along).min() < 0.01:
        raise IdentifiabilityError(
            "the field is within 0.6 degrees of a right angle to sign_hint, which cannot tell its sign; give a "
            "direction in rig axes nearer the field (for a magnetometer: cos dip, 0, sin dip)"
        )
    return np.asarray(np.where(along < 0.0, -a, a))


def _sums(products: Array) -> Array:
    """Sums of squares and products xx, yy, zz, xy, xz, yz (6, B) of all vectors of products, with xx + yy + zz = 1."""
    rows = products.reshape(3, -1, products.shape[-1])
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    sums = np.stack([np.einsum("rb,rb->b", rows[i], rows[j]) for i, j in pairs])
    total = sums[:3].sum(axis=0)
    if not (total > 0.0).all():
        raise IdentifiabilityError("the signals do not change over the plan; are the sensors connected?")
    return np.asarray(sums / total)


def _check_share(sums: Array, a: Array) -> None:
    """Refuse products of which much is not along the direction a (3, B)."""
    (xx, yy, zz, xy, xz, yz), (x, y, z) = sums, a
    share = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z)
    worst = int(np.argmin(share))
    if share[worst] < _LEAST_SHARE:
        raise IdentifiabilityError(
            f"the signals do not follow one field along {a[:, worst].round(3).tolist()} in rig axes: "
            f"{100.0 * (1.0 - share[worst]):.0f} % of their power is elsewhere (allowed "
            f"{100.0 * (1.0 - _LEAST_SHARE):.0f}); check the dial settings, the order of the stations, the channels "
            "and the direction if one was given"
        )


def _leading(sums: Array) -> Array:
    """Leading unit eigenvectors (3, B) of symmetric matrices of unit trace given as xx, yy, zz, xy, xz, yz (6, B).

    The matrix is squared five times, which is 32 steps of the power iteration: for vectors parallel to better than 0.3
    the result is exact to rounding, at a fraction of the cost of a batch of decompositions.
    """
    xx, yy, zz, xy, xz, yz = sums
    for _ in range(_SQUARINGS):
        xx, yy, zz, xy, xz, yz = (
            xx * xx + xy * xy + xz * xz,
            xy * xy + yy * yy + yz * yz,
            xz * xz + yz * yz + zz * zz,
            xx * xy + xy * yy + xz * yz,
            xx * xz + xy * yz + xz * zz,
            xy * xz + yy * yz + yz * zz,
        )
        scale = 1.0 / (xx + yy + zz)
        xx, yy, zz, xy, xz, yz = (v * scale for v in (xx, yy, zz, xy, xz, yz))
    # every column is now along the direction; the one with the largest diagonal element has no cancellation
    in_x, in_y = (xx >= yy) & (xx >= zz), yy >= zz
    a = np.stack([np.where(in_x, p, np.where(in_y, q, r)) for p, q, r in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))])
    return np.asarray(a / np.sqrt(np.einsum("jb,jb->b", a, a)))


def _project(products: Array, level: Array, a: Array, moments: Moments) -> tuple[Array, Array]:
    """Sensor vectors (3, m, B) and offsets (m, B): weighted projections of the products (j, l, m, B) on a (3, B)."""
    weighted = moments.precision[:, :, None] * a[:, None, :]  # (j, l, B)
    weighted /= np.einsum("jlb,jb->lb", weighted, a)
    n = np.einsum("jlmb,jlb->lmb", products, weighted)
    for j, row in zip(*np.nonzero(moments.offset_gain), strict=True):
        level = level + moments.offset_gain[j, row] * (products[j, row] - n[row] * a[j])
    return n, level

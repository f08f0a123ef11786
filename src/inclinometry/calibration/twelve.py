"""The twelve positions of Rogatykh 2018, and their relatives with more steps: harmonics over two axes of the rig.

One roll set upright and one at 90 degrees for each azimuth, p >= 3 equal steps of each. The rig need not be level nor
point to the north: the direction of the field in rig axes comes out with the sensors' parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, frozen
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.dials import (
    ANGLE_TOLERANCE,
    Rows,
    at_azimuth,
    groups,
    positive_inclination,
    same,
    three_dials,
    unequal_steps,
)
from inclinometry.calibration.harmonics import harmonic_weights, harmonics
from inclinometry.calibration.undetermined import undetermined
from inclinometry.errors import IdentifiabilityError, InputError, refused, wrong_kind, wrong_shape
from inclinometry.findings import Finding, Value
from inclinometry.rotations import dcm

# From moments of the signals to a triad: the product of a sensor's vector and the field's direction, taken apart.
#
# A signal U = n . C a + U0 is linear in the nine products n_l a_j and in U0. A plan that determines those ten numbers
# for
# every sensor (twelve, orthogonal) is a fixed matrix, and the rest is the same for all such plans: the products of all
# sensors form a matrix of rank one, whose leading right singular vector is the direction a of the field in rig axes,
# and
# the n are the projections on it.

DOWN = frozen([0.0, 0.0, 1.0])
"""Down in rig axes: the field of gravity, and a hint that holds for the magnetic field where the dip is positive."""


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
        raise wrong_kind(name, str(np.asarray(value).tolist()), "unit vector")
    return np.asarray(vector / length)


def solve_moments(
    signals: ArrayLike, moments: Moments, sign_hint: ArrayLike = DOWN, known_direction: ArrayLike | None = None
) -> ClosedForm:
    """Calibrate a triad, or a batch of triads, whose plan determines all products n_l a_j.

    `sign_hint`: a direction in rig axes with which the field makes an acute angle, the one fact the signals cannot
    give. `known_direction` of the field is used instead of being found.
    """
    values = finite(signals, "signals", (moments.weights.shape[1], None))
    batch, (stations, count) = values.shape[:-2], values.shape[-2:]
    flat = values.reshape(-1, stations * count)
    # one matrix for all sensors of all triads: a single product of two large matrices
    spread = np.kron(moments.weights, np.eye(count))
    hint = unit_direction(sign_hint, "sign_hint")
    known = None if known_direction is None else unit_direction(known_direction, "known_direction")
    tensor, offset, direction = np.empty((len(flat), count, 3)), np.empty((len(flat), count)), np.empty((len(flat), 3))
    block = 4096  # calibrations at a time: their moments stay in the cache
    for first in range(0, len(flat), block):
        rows = slice(first, first + block)
        moment = spread @ flat[rows].T
        products, level = moment[: 9 * count].reshape(3, 3, count, -1), moment[9 * count :]
        # sums of squares and products xx, yy, zz, xy, xz, yz (6, B) of all vectors of products, with xx + yy + zz = 1
        vectors = products.reshape(3, -1, products.shape[-1])
        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        sums = np.stack([np.einsum("rb,rb->b", vectors[i], vectors[j]) for i, j in pairs])
        total = sums[:3].sum(axis=0)
        if not (total > 0.0).all():
            raise IdentifiabilityError(Finding("fit-signals-constant", {"channels": ("all",)}))
        sums = np.asarray(sums / total)
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
        raise IdentifiabilityError(Finding("fit-sign-open"))
    return np.asarray(np.where(along < 0.0, -a, a))


def _check_share(sums: Array, a: Array) -> None:
    """Refuse products of which much is not along the direction a (3, B)."""
    (xx, yy, zz, xy, xz, yz), (x, y, z) = sums, a
    share = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z)
    worst = int(np.argmin(share))
    least_share = 0.9  # of the power along one direction; less is not a calibration but a mix-up
    if share[worst] < least_share:
        raise _elsewhere(a[:, worst], 1.0 - float(share[worst]), 1.0 - least_share)


def _elsewhere(direction: Array, share: float, most: float) -> IdentifiabilityError:
    """The refusal of signals that follow another direction of the field."""
    shares = {"left_percent": 100.0 * share, "allowed_percent": 100.0 * most}
    return IdentifiabilityError(Finding("fit-share", {"direction": str(direction.round(3).tolist()), **shares}))


def _leading(sums: Array) -> Array:
    """Leading unit eigenvectors (3, B) of symmetric matrices of unit trace given as xx, yy, zz, xy, xz, yz (6, B).

    The matrix is squared five times, which is 32 steps of the power iteration: for vectors parallel to better than 0.3
    the result is exact to rounding, at a fraction of the cost of a batch of decompositions.
    """
    xx, yy, zz, xy, xz, yz = sums
    for _ in range(5):
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


def solve_twelve(
    signals: ArrayLike,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    sign_hint: ArrayLike = DOWN,
    known_direction: ArrayLike | None = None,
) -> ClosedForm:
    """Calibrate a triad from one upright roll set and equal turns of azimuth and roll at 90 degrees.

    Equations (17)-(25) of Rogatykh 2018, corrected: the print has sin theta for cos theta in A_A and B_A of (22), which
    damages n2. The field's direction a is the common direction of all n_l a over all sensors, n the projections on it,
    weighted by the inverse variance of each product. This replaces the rules of sign (26), which divide noise by noise
    where a component of a is small. The upright set measures n1 a1 + n2 a2 and n1 a2 - n2 a1 once more.
    """
    moments = _moments(*_layout(azimuth, inclination, toolface))
    return solve_moments(signals, moments, sign_hint, known_direction)


def _moments(azimuth: Array, toolface: Array, upright: Index, rolls: list[Rows]) -> Moments:
    """The plan as a linear map to the products n_l a_j; the names are the paper's."""
    count = len(azimuth)
    level = np.zeros((3, count))  # A, B, C of the upright set
    # turning upright is one angle: azimuth and toolface add
    level[:, upright] = harmonic_weights((azimuth + toolface)[upright])
    # weights (3, 3, K) of the signals in A_A, B_A, C_A (cosine of the roll), A_B, B_B, C_B (sine), A_C, B_C, C_C
    result = np.zeros((3, 3, len(azimuth)))
    over_azimuth = harmonic_weights(np.array([azimuth[rows[0]] for rows in rolls]))
    for weight, rows in zip(over_azimuth.T, rolls, strict=True):
        over_roll = harmonic_weights(toolface[rows])
        result[:, :, rows] = over_roll[:, None, :] * weight[None, :, None]
    (aa, ba, ca), (ab, bb, cb), (ac, bc, cc) = result
    n1 = np.stack([-bb, ab, -ca])
    n2 = np.stack([-ba, aa, cb])
    n3 = np.stack([ac, bc, level[2] - cc])
    # what the upright set says of n1 a1 + n2 a2 and n1 a2 - n2 a1, shared by least squares
    once, twice = float(level[0] @ level[0]), float(bb @ bb)
    gain = twice / (2.0 * twice + once)
    plus, minus = gain * (level[0] - n1[0] - n2[1]), gain * (level[1] - n1[1] + n2[0])
    n1, n2 = n1 + np.stack([plus, minus, 0.0 * plus]), n2 + np.stack([-minus, plus, 0.0 * plus])
    products = np.stack([n1, n2, n3], axis=1).reshape(9, count)  # row 3 j + l
    return Moments(np.concatenate([products, cc[None]]))


def _layout(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> tuple[Array, Array, Index, list[Rows]]:
    """The parts of the plan: azimuths and toolfaces (K,), rows of the upright set, those of each azimuth at 90 deg."""
    a, i, t = positive_inclination(*three_dials(azimuth, inclination, toolface))
    up, flat = same(i, 0.0), same(i, np.pi / 2.0)
    other = np.flatnonzero(~(up | flat))
    if len(other):
        facts: dict[str, Value] = {"row": int(other[0]) + 1, "value_deg": float(np.degrees(i[other[0]]))}
        raise _not_of("twelve", Finding("plan-row", {**facts, "angle": "inclination", "needed_deg": (0.0, 90.0)}))
    upright, rows = np.flatnonzero(up), np.flatnonzero(flat)
    if (why := unequal_steps((a + t)[upright])) is not None:
        raise _not_of("twelve", Finding("plan-part", {"part": "upright rolls", "why": why}))
    rolls = [rows[members] for members in groups(a[rows])]
    if (why := unequal_steps(np.array([a[members[0]] for members in rolls]))) is not None:
        raise _not_of("twelve", Finding("plan-part", {"part": "azimuths at inclination 90 deg", "why": why}))
    for members in rolls:
        if (why := unequal_steps(t[members])) is not None:
            at = float(np.degrees(a[members[0]]))
            raise _not_of("twelve", Finding("plan-rolls", {"dial": "azimuth", "at_deg": at, "why": why}))
    return a, t, upright, rolls


def _not_of(method: str, why: Finding) -> InputError:
    """The refusal of settings that a method has no closed form for."""
    return refused("plan-not-method", {"method": method, "why": why})


def why_not_orthogonal(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> Finding | None:
    """Why the settings are not an orthogonal plan; None when they are.

    What makes the closed form exact is asked for, not a list of positions: the orientations C_k must sum to nothing and
    their elements be uncorrelated, sum_k C_ij C_lm = K/3 for equal elements and 0 otherwise. The rotations of a cube,
    their half and the two-face variant do this, in any order.
    """
    turns = _orientations(azimuth, inclination, toolface)
    if len(turns) < 12:
        return Finding("plan-stations", {"stations": len(turns)})
    mean = turns.mean(axis=0)
    if np.abs(mean).max() > ANGLE_TOLERANCE:
        tool, rig = (int(i) for i in np.unravel_index(np.argmax(np.abs(mean)), (3, 3)))
        facts: dict[str, Value] = {"axis": "xyz"[tool], "rig_axis": "xyz"[rig], "mean": float(mean[tool, rig])}
        return Finding("plan-axis-uneven", facts)
    flat = turns.reshape(len(turns), 9)
    unequal = np.abs(flat.T @ flat / len(turns) - np.eye(9) / 3.0)
    if unequal.max() > 2.0 * ANGLE_TOLERANCE:
        one, two = (int(i) for i in np.unravel_index(np.argmax(unequal), (9, 9)))
        names = tuple(f"C[{'xyz'[i // 3]},{'xyz'[i % 3]}]" for i in (one, two))
        return Finding("plan-orientations", {"elements": names})
    return None


def solve_orthogonal(
    signals: ArrayLike,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    sign_hint: ArrayLike = DOWN,
    known_direction: ArrayLike | None = None,
) -> ClosedForm:
    """Calibrate a triad from the 24 rotations of a cube, or their half: by Schur's lemma sum_k y_k C_k = K/3 n a'.

    This is the least-squares fit: its normal matrix is a multiple of the unit matrix. With `known_direction` it is the
    article's closed form: a constant error of the frame changes no direction cosine, and the scale only by
    1 - cos(error). Not seen: an error e of the stand's inclination zero, which moves the z offset by 2/3 sin e of the
    field unless the plan is the two-face one.
    """
    if (why := why_not_orthogonal(azimuth, inclination, toolface)) is not None:
        raise _not_of("orthogonal", why)
    turns = _orientations(azimuth, inclination, toolface)
    count = len(turns)
    # row 3 j + l: the element C[l, j] that carries n_l a_j
    products = np.transpose(turns, (2, 1, 0)).reshape(9, count) * (3.0 / count)
    weights = np.concatenate([products, np.full((1, count), 1.0 / count)])
    return solve_moments(signals, Moments(weights), sign_hint, known_direction)


def _orientations(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> Array:
    """Rig-to-tool matrices (K, 3, 3) of the settings."""
    return dcm(*three_dials(azimuth, inclination, toolface))


def solve_rotations(
    signals: ArrayLike,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    known_direction: ArrayLike = DOWN,
) -> ClosedForm:
    """Calibrate a triad from two turns about the tool axis, at inclinations d1 and d1 + 90, in a known field.

    The curve fit of "Well Logging Technology" 2009, no. 6, p. 567-570, completed. With (Hc, Hr, Hz) the field along
    high side, right and hole at d1, a sensor reads M cos T + N sin T + P with M = n1 Hc + n2 Hr, N = n1 Hr - n2 Hc,
    P = n3 Hz + U0; at d1 + 90 degrees Hc -> -Hz and Hz -> Hc. Both turns count by their numbers of steps.
    Not immune to a frame that stands wrong: 0.5 degrees of north error give about 0.4 degrees of azimuth error.
    """
    heading, lean, rows, rolls = _turns(azimuth, inclination, toolface)
    a = unit_direction(known_direction, "known_direction")
    hc, hr, hz = dcm(heading, lean, 0.0) @ a
    least_axial = 0.2  # |Hc - Hz|: axial errors grow by sqrt2 over this number
    if abs(hc - hz) < least_axial:
        facts = {"inclination_deg": float(np.degrees(lean)), "first": float(hz), "second": float(hc)}
        raise IdentifiabilityError(Finding("plan-axial", {**facts, "apart": least_axial}))
    values = finite(signals, "signals", (sum(map(len, rows)), None))
    one, two = (harmonics(values[..., r, :], t) for r, t in zip(rows, rolls, strict=True))
    w1, w2 = (float(len(own)) for own in rows)
    power = w1 * (hc * hc + hr * hr) + w2 * (hz * hz + hr * hr)
    n1 = (w1 * (hc * one.cosine + hr * one.sine) + w2 * (hr * two.sine - hz * two.cosine)) / power
    n2 = (w1 * (hr * one.cosine - hc * one.sine) + w2 * (hr * two.cosine + hz * two.sine)) / power
    misfit = sum(
        w * np.square([t.cosine - n1 * c - n2 * hr, t.sine - n1 * hr + n2 * c]).sum(axis=(0, -1))
        for w, t, c in ((w1, one, hc), (w2, two, -hz))
    )
    total = sum(w * np.square([t.cosine, t.sine]).sum(axis=(0, -1)) for w, t in ((w1, one), (w2, two)))
    most_misfit = 0.05  # share of the harmonics' power: 13 degrees, more than any rig stands wrong
    if not (misfit <= most_misfit * total).all():
        raise _elsewhere(a, float(np.max(misfit / total)), most_misfit)
    n3 = (two.mean - one.mean) / (hc - hz)
    offset = (one.mean * hc - two.mean * hz) / (hc - hz)
    tensor = np.stack([n1, n2, n3], axis=-1)
    return ClosedForm(tensor, offset, np.broadcast_to(a, (*tensor.shape[:-2], 3)))


def find_direction(
    signals: ArrayLike,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    sign_hint: ArrayLike = DOWN,
) -> Array:
    """Direction (3,) of the field in rig axes from the two turns themselves, where they show it.

    The complex harmonic z = M - i N of a turn is (n1 + i n2)(Hc - i Hr), and (n1 + i n2)(-Hz - i Hr) in the second.
    Eliminating the sensor, z2 Hc + z1 Hz + i (z1 - z2) Hr = 0 for every sensor: the direction is the null vector.
    Harmonics alike in both turns, as for gravity at 45 and 135 degrees, do not show it.
    """
    heading, lean, rows, rolls = _turns(azimuth, inclination, toolface)
    values = finite(signals, "signals", (sum(map(len, rows)), None))
    if values.ndim != 2:
        raise wrong_shape("signals", values.shape, "(K, m)")
    one, two = (harmonics(values[r], t) for r, t in zip(rows, rolls, strict=True))
    z1, z2 = one.cosine - 1j * one.sine, two.cosine - 1j * two.sine
    system = np.stack([z2, 1j * (z1 - z2), z1], axis=-1)
    _, strength, axes = np.linalg.svd(np.concatenate([system.real, system.imag]))
    least_separation = 0.05  # second of the singular values over the first, where the direction is to be found
    if strength[1] <= least_separation * strength[0]:
        remedy = "Give the dip and the azimuth of the rig's zero, or turn at another inclination"
        raise IdentifiabilityError(undetermined("turns", ("direction of the field",), remedy))
    a = dcm(heading, lean, 0.0).T @ axes[2]
    return signed(a[:, None], unit_direction(sign_hint, "sign_hint"))[:, 0]


def axial_conditioning(first_inclination: float, azimuth: float = 0.0, known_direction: ArrayLike = DOWN) -> float:
    """|Hc - Hz|: how far apart the axial field is in the two turns, of sqrt 2 at best; below 0.2 the method refuses."""
    hc, _, hz = dcm(azimuth, first_inclination, 0.0) @ unit_direction(known_direction, "known_direction")
    return float(abs(hc - hz))


def _turns(
    azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike
) -> tuple[float, float, tuple[Rows, Rows], tuple[Array, Array]]:
    """The two turns: azimuth and inclination of the first, rows and rolls of each."""
    a, i, t = three_dials(azimuth, inclination, toolface)
    # the azimuth of a station that stands upright says nothing; any other fixes the plane
    leaning = np.flatnonzero(~(same(i, 0.0) | same(i, np.pi)))
    if not len(leaning):
        raise _not_of("rotations", Finding("plan-all-upright"))
    wanted = float(a[leaning[0]])
    a, i, t = at_azimuth(a, i, t, wanted)
    elsewhere = np.flatnonzero(~same(a, wanted))
    if len(elsewhere):
        row = int(elsewhere[0])
        at: dict[str, Value] = {"row": row + 1, "angle": "azimuth", "value_deg": float(np.degrees(a[row]))}
        raise _not_of("rotations", Finding("plan-row", {**at, "needed_deg": (float(np.degrees(wanted)),)}))
    turns = groups(i)
    if len(turns) != 2:
        raise _not_of("rotations", Finding("plan-inclinations", {"count": len(turns)}))
    one, two = turns
    if same(i[one[0]] - i[two[0]], np.pi / 2.0):
        one, two = two, one
    d1, d2 = float(i[one[0]]), float(i[two[0]])
    if not same(d2 - d1, np.pi / 2.0):
        at = {"first_deg": float(np.degrees(d1)), "second_deg": float(np.degrees(d2))}
        raise _not_of("rotations", Finding("plan-turns-apart", at))
    for rows in (one, two):
        if (why := unequal_steps(t[rows])) is not None:
            turn = float(np.degrees(i[rows[0]]))
            raise _not_of("rotations", Finding("plan-rolls", {"dial": "inclination", "at_deg": turn, "why": why}))
    return wanted, d1, (one, two), (t[one], t[two])

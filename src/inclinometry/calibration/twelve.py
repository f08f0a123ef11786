"""The twelve positions of Rogatykh 2018, and their relatives with more steps: harmonics over two axes of the rig.

One roll set upright and one at 90 degrees for each azimuth, p >= 3 equal steps of each. The rig need not be level nor
point to the north: the direction of the field in rig axes comes out with the sensors' parameters.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.calibration.bilinear import DOWN, Moments, solve_moments
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.dials import Rows, groups, positive_inclination, same, three_dials, unequal_steps
from inclinometry.calibration.harmonics import harmonic_weights
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError


class _Layout(NamedTuple):
    """The rows of each part of the plan, and the settings written with inclination 0 or 90 degrees."""

    azimuth: Array
    toolface: Array
    upright: Rows  # at inclination 0
    rolls: list[Rows]  # rows at inclination 90, one array an azimuth


def why_not_twelve(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> str | None:
    """Why the settings are not a twelve-position plan, in words; None when they are.

    Rows may be in any order, angles differ by whole turns, and (A, -90, T) counts as (A + 180, 90, T + 180).

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> plan = plans.twelve()
    >>> why_not_twelve(plan.azimuth, plan.inclination, plan.toolface) is None
    True
    >>> why_not_twelve(plan.azimuth, plan.inclination / 2.0, plan.toolface)
    'row 4 has inclination 45 degrees; this plan uses 0 and 90 only'
    """
    found = _layout(azimuth, inclination, toolface)
    return found if isinstance(found, str) else None


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

    Parameters
    ----------
    signals : (..., K, m) array_like
        Signals at the K stations; leading axes are a batch of triads.
    azimuth, inclination, toolface : (K,) array_like
        Rig settings, rad, in any order: p >= 3 equal rolls at inclination 0, and at 90 degrees p >= 3 equal rolls at
        each of p >= 3 equal steps of azimuth.
    sign_hint : (3,) array_like
        A direction in rig axes with which the field makes an acute angle; down when not given.
    known_direction : (3,) array_like, optional
        The field in rig axes where the rig is known to stand true; otherwise it is found.

    Raises
    ------
    InputError
        Settings of another plan (the message says what differs), wrong shapes, values not finite.
    IdentifiabilityError
        Signals that do not follow one field direction, or a field nearly at right angles to `sign_hint`.

    Notes
    -----
    Equations (17)-(25) of Rogatykh 2018, corrected: the print has sin theta for cos theta in A_A and B_A of (22), which
    spoils n2. In the conventions of this package (x is the high side at toolface 0) the harmonics at 90 degrees are

        n1 a = (-B_B, A_B, -C_A),  n2 a = (-B_A, A_A, C_B),  n3 a = (A_C, B_C, C_C(0) - C_C(90)),  U0 = C_C(90)

    (index: harmonic over roll; letter: harmonic over azimuth).
    All three vectors are parallel to the field's direction a in rig axes, over all sensors; a is their common
    direction and n the projections on it, weighted by the inverse variance of each product. This replaces the rules of
    sign (26), which divide noise by noise where a component of a is small. The upright set measures n1 a1 + n2 a2 and
    n1 a2 - n2 a1 once more, which is used.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> plan = plans.twelve()
    >>> dials = plan.azimuth, plan.inclination, plan.toolface
    >>> truth = ClosedForm(np.diag([2.0, 3.0, -4.0]), np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.0, 0.8]))
    >>> found = solve_twelve(truth.signals(*dials), *dials)
    >>> found.tensor.diagonal().round(12), found.offset.round(12), found.direction.round(12) + 0.0
    (array([ 2.,  3., -4.]), array([0.1, 0.2, 0.3]), array([0.6, 0. , 0.8]))
    """
    found = _layout(azimuth, inclination, toolface)
    if isinstance(found, str):
        raise InputError(f"not a twelve-position plan: {found}")
    return solve_moments(signals, _moments(found), sign_hint, known_direction)


def _moments(layout: _Layout) -> Moments:
    """The plan as a linear map to the products n_l a_j; the names are the paper's."""
    count = len(layout.azimuth)
    level = np.zeros((3, count))  # A, B, C of the upright set
    # turning upright is one angle: azimuth and toolface add
    level[:, layout.upright] = harmonic_weights((layout.azimuth + layout.toolface)[layout.upright])
    (aa, ba, ca), (ab, bb, cb), (ac, bc, cc) = _double_harmonics(layout)
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


def _double_harmonics(layout: _Layout) -> Array:
    """Weights (3, 3, K) of the signals in A_A, B_A, C_A (cosine of the roll), A_B, B_B, C_B (sine), A_C, B_C, C_C."""
    result = np.zeros((3, 3, len(layout.azimuth)))
    over_azimuth = harmonic_weights(np.array([layout.azimuth[rows[0]] for rows in layout.rolls]))
    for weight, rows in zip(over_azimuth.T, layout.rolls, strict=True):
        over_roll = harmonic_weights(layout.toolface[rows])
        result[:, :, rows] = over_roll[:, None, :] * weight[None, :, None]
    return result


def _layout(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> _Layout | str:
    """The parts of the plan, or why it is not one."""
    a, i, t = positive_inclination(*three_dials(azimuth, inclination, toolface))
    up, flat = same(i, 0.0), same(i, np.pi / 2.0)
    other = np.flatnonzero(~(up | flat))
    if len(other):
        at = np.degrees(i[other[0]])
        return f"row {other[0] + 1} has inclination {at:.8g} degrees; this plan uses 0 and 90 only"
    upright, rows = np.flatnonzero(up), np.flatnonzero(flat)
    reason = unequal_steps((a + t)[upright])
    if reason is not None:
        return f"upright: {reason}"
    rolls = [rows[members] for members in groups(a[rows])]
    reason = unequal_steps(np.array([a[members[0]] for members in rolls]))
    if reason is not None:
        return f"azimuths at inclination 90: {reason}"
    for members in rolls:
        reason = unequal_steps(t[members])
        if reason is not None:
            return f"rolls at azimuth {np.degrees(a[members[0]]):.8g} degrees: {reason}"
    return _Layout(a, t, upright, rolls)

"""Calibration from the rotations of a cube: 24 positions, the 12 of its half, or the two-face variant."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.rotations import dcm
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.dials import ANGLE_TOLERANCE, three_dials
from inclinometry.calibration.twelve import DOWN, Moments, solve_moments
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError


def why_not_orthogonal(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> str | None:
    """Why the settings are not an orthogonal plan, in words; None when they are.

    What makes the closed form exact is asked for, not a list of positions: the orientations C_k must sum to nothing and
    their elements be uncorrelated, sum_k C_ij C_lm = K/3 for equal elements and 0 otherwise. The rotations of a cube,
    their half and the two-face variant do this, in any order.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> plan = plans.half()
    >>> why_not_orthogonal(plan.azimuth, plan.inclination, plan.toolface) is None
    True
    >>> plan = plans.twelve()
    >>> why_not_orthogonal(plan.azimuth, plan.inclination, plan.toolface)
    'tool axis z does not point equally often both ways along rig axis z: its mean there is 0.25, not 0'
    """
    turns = _orientations(azimuth, inclination, toolface)
    if len(turns) < 12:
        return f"{len(turns)} stations; an orthogonal plan has 24, or the 12 of its half"
    mean = turns.mean(axis=0)
    if np.abs(mean).max() > ANGLE_TOLERANCE:
        tool, rig = (int(i) for i in np.unravel_index(np.argmax(np.abs(mean)), (3, 3)))
        return (
            f"tool axis {'xyz'[tool]} does not point equally often both ways along rig axis {'xyz'[rig]}: "
            f"its mean there is {mean[tool, rig]:.3g}, not 0"
        )
    flat = turns.reshape(len(turns), 9)
    unequal = np.abs(flat.T @ flat / len(turns) - np.eye(9) / 3.0)
    if unequal.max() > 2.0 * ANGLE_TOLERANCE:
        one, two = (int(i) for i in np.unravel_index(np.argmax(unequal), (9, 9)))
        names = [f"C[{'xyz'[i // 3]},{'xyz'[i % 3]}]" for i in (one, two)]
        return f"the orientations are not those of a cube's rotations: sum of {names[0]} {names[1]} is out of balance"
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
    """Calibrate a triad from the 24 rotations of a cube, or their half.

    Parameters
    ----------
    signals : (..., K, m) array_like
        Signals at the K stations; leading axes are a batch of triads.
    azimuth, inclination, toolface : (K,) array_like
        Rig settings, rad, in any order.
    sign_hint : (3,) array_like
        A direction in rig axes with which the field makes an acute angle; down when not given.
    known_direction : (3,) array_like, optional
        The field in rig axes as the bench is believed to stand. With it the method is the article's closed form: a
        constant error of the frame changes no direction cosine, and the scale only by 1 - cos(error). Without it the
        direction is found from the signals and the scale is right as well.

    Raises
    ------
    InputError
        Settings of another plan (the message says what differs), wrong shapes, values not finite.
    IdentifiabilityError
        Signals that do not follow one field direction, or a field nearly at right angles to `sign_hint`.

    Notes
    -----
    By Schur's lemma sum_k y_k C_k = K/3 n a' for any triad on these orientations, and the mean of the signals is the
    offset. This is the least-squares fit: its normal matrix is a multiple of the unit matrix.
    Not seen: an error e of the stand's inclination zero, which moves the z offset by 2/3 sin e of the field
    unless the plan is the two-face one.

    Examples
    --------
    >>> from inclinometry.calibration import plans
    >>> plan = plans.orthogonal()
    >>> dials = plan.azimuth, plan.inclination, plan.toolface
    >>> truth = ClosedForm(np.diag([2.0, 3.0, -4.0]), np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.0, 0.8]))
    >>> found = solve_orthogonal(truth.signals(*dials), *dials)
    >>> found.tensor.diagonal().round(12), found.offset.round(12), found.direction.round(12) + 0.0
    (array([ 2.,  3., -4.]), array([0.1, 0.2, 0.3]), array([0.6, 0. , 0.8]))
    """
    reason = why_not_orthogonal(azimuth, inclination, toolface)
    if reason is not None:
        raise InputError(f"not an orthogonal plan: {reason}")
    turns = _orientations(azimuth, inclination, toolface)
    count = len(turns)
    # row 3 j + l: the element C[l, j] that carries n_l a_j
    products = np.transpose(turns, (2, 1, 0)).reshape(9, count) * (3.0 / count)
    weights = np.concatenate([products, np.full((1, count), 1.0 / count)])
    return solve_moments(signals, Moments(weights), sign_hint, known_direction)


def _orientations(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> Array:
    """Rig-to-tool matrices (K, 3, 3) of the settings."""
    return dcm(*three_dials(azimuth, inclination, toolface))

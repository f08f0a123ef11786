"""A triad in classical terms: scale, misalignment angles and orthogonality, as a view of (N, U0)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array, frozen
from inclinometry.sensors.triad import Triad


@dataclass(frozen=True, eq=False)
class ClassicalView:
    """What a data sheet says of a triad; computed from the tensor, never estimated.

    Parameters
    ----------
    scale : (m,)
        Conversion factor k, signal per unit of field (per full field where the field's strength is not known).
    axes : (m, 3)
        Sensitive axes c, unit vectors in tool axes: N = k |F| c.
    nominal : (m, 3)
        The axis of the tool nearest to each, in either sense.
    misalignment : (m,)
        Angle between the sensitive axis and its nominal place, rad: the installation angle I of well-logging texts, in
        which the main coefficient is k cos I.
    phase : (m,)
        Its installation phase: where the axis leans, counted about the nominal axis from the next axis of the tool in
        the order x, y, z, x toward the one after, rad in [0, 2 pi); so for a sensor along z about z from x.
    from_z, about_z : (m,)
        The same for any axis: its angle from the tool's z and the phase about z from x, rad.
    misalignment_angles : (m, 2)
        The small angles d1, d2 of the axis toward the two other axes of the tool, in the order x, y, z, rad. Positive
        toward the positive axis.
    orthogonality : (m, m)
        Angle between two sensitive axes less 90 degrees, rad, for axes turned to the positive sense of their nominal
        place; the diagonal is 0.
    bias : (m,)
        U0 over k: the offset in units of the field.
    """

    scale: Array
    axes: Array
    nominal: Array
    misalignment: Array
    phase: Array
    from_z: Array
    about_z: Array
    misalignment_angles: Array
    orthogonality: Array
    bias: Array


def classical_view(triad: Triad, temperature: ArrayLike | None = None) -> ClassicalView:
    """Scale, misalignment and orthogonality of a triad at one temperature.

    Parameters
    ----------
    triad : Triad
    temperature : float, optional
        degC; the reference temperature when not given.

    Notes
    -----
    d1 and d2 are atan2(component, component along the nominal axis), which is the small angle of the classical model
    where it is small and keeps its meaning where it is not.

    Examples
    --------
    >>> triad = Triad("accelerometer", [[200.0, 2.0, 0.0], [0.0, 0.0, -100.0], [0.0, 50.0, 0.0]], [4.0, 0.0, 0.0])
    >>> view = classical_view(triad)
    >>> view.scale.round(2), view.nominal[1] + 0.0, np.degrees(view.misalignment_angles[0]).round(3)
    (array([200.01, 100.  ,  50.  ]), array([ 0.,  0., -1.]), array([0.573, 0.   ]))
    """
    at = triad.reference_temperature if temperature is None else temperature
    powers = triad.basis(at)
    n, offset = np.tensordot(powers, triad.tensor, axes=1), powers @ triad.offset
    length = np.linalg.norm(n, axis=-1)
    axes = n / length[:, None]
    place = np.argmax(np.abs(axes), axis=-1)
    rows = np.arange(len(axes))
    sense = np.sign(axes[rows, place])
    nominal = np.zeros_like(axes)
    nominal[rows, place] = sense
    main = np.abs(axes[rows, place])
    others = np.array([[axis for axis in range(3) if axis != at_axis] for at_axis in place])
    across = axes[rows[:, None], others]
    following = np.stack([axes[rows, (place + step) % 3] for step in (1, 2)])
    # turned with a sensor that points along a negative axis, so that the phase is about the nominal axis itself
    phase = np.arctan2(sense * following[1], following[0])
    upright = axes * sense[:, None]
    normal = np.linalg.norm(np.cross(upright[:, None], upright[None, :]), axis=-1)
    angle = np.arctan2(-upright @ upright.T, normal)  # 90 degrees less, without the arc cosine's loss of digits
    scale = length / (triad.field_strength or 1.0)
    return ClassicalView(
        scale=frozen(scale),
        axes=frozen(axes),
        nominal=frozen(nominal),
        misalignment=frozen(np.arctan2(np.linalg.norm(across, axis=-1), main)),
        phase=frozen(wrap_positive(phase)),
        from_z=frozen(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])),
        about_z=frozen(wrap_positive(np.arctan2(axes[:, 1], axes[:, 0]))),
        misalignment_angles=frozen(np.arctan2(across, main[:, None])),
        orthogonality=frozen(np.where(np.eye(len(axes), dtype=bool), 0.0, angle)),
        bias=frozen(offset / scale),
    )

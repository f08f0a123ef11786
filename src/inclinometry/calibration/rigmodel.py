"""The rig as a chain of rotations, with the constant errors it may have and every first derivative.

    C = R_z(T) R_x(inner) R_y(I) R_x(outer) R_z(A)

`outer` is the non-orthogonality between azimuth and inclination axes, `inner` between inclination and toolface axes;
zero for a perfect rig, in which case C is C_tn of the conventions.
"""

from __future__ import annotations

import numpy as np

from inclinometry.attitude.rotations import rotation_x, rotation_y, rotation_z
from inclinometry.core.arrays import Array

NUISANCE = ("inclination_zero", "toolface_zero", "outer_nonorthogonality", "inner_nonorthogonality")
"""Constant rig errors that a joint fit can carry, each an angle in rad."""

# dR(angle)/d(angle) = generator @ R(angle) for the passive rotations of the conventions
_GX = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_GY = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
_GZ = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def orientation(settings: Array, nuisance: Array) -> tuple[Array, Array, Array]:
    """Rig-to-tool matrices and their derivatives.

    Parameters
    ----------
    settings : (K, 3)
        True azimuth, inclination, toolface of each setting, without the constant errors, rad.
    nuisance : (4,)
        Constant errors in the order of `NUISANCE`, rad.

    Returns
    -------
    matrix : (K, 3, 3)
    by_setting : (K, 3, 3, 3)
        [:, d] = derivative by azimuth, inclination, toolface.
    by_nuisance : (4, K, 3, 3)

    Examples
    --------
    >>> matrix, _, _ = orientation(np.array([[0.0, np.pi / 2, 0.0]]), np.zeros(4))
    >>> (matrix[0] @ [0.0, 0.0, 1.0]).round(12) + 0.0
    array([-1.,  0.,  0.])
    """
    azimuth, inclination, toolface = settings.T
    turn_t = rotation_z(toolface + nuisance[1])
    left_inner = turn_t @ rotation_x(nuisance[3])
    left_inclination = left_inner @ rotation_y(inclination + nuisance[0])
    left_outer = left_inclination @ rotation_x(nuisance[2])
    right_azimuth = rotation_z(azimuth)
    right_outer = rotation_x(nuisance[2]) @ right_azimuth
    right_inclination = rotation_y(inclination + nuisance[0]) @ right_outer
    matrix = left_outer @ right_azimuth
    by_inclination = left_inclination @ _GY @ right_outer
    by_toolface = _GZ @ matrix
    by_setting = np.stack([left_outer @ _GZ @ right_azimuth, by_inclination, by_toolface], axis=1)
    by_outer = left_outer @ _GX @ right_azimuth
    by_inner = left_inner @ _GX @ right_inclination
    return matrix, by_setting, np.stack([by_inclination, by_toolface, by_outer, by_inner])

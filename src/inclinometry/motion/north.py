"""Rows counted from true north, counted from magnetic north instead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inclinometry.attitude.rotations import dcm_from_quaternion, quaternion_from_dcm, rotation_z
from inclinometry.earth.site import Site
from inclinometry.motion.result import Attitude


def to_magnetic(rows: Attitude, site: Site | None) -> Attitude | None:
    """The same attitude from magnetic north; None where the site states no declination.

    Parameters
    ----------
    rows : Attitude
        Counted from true north.
    site : Site, optional

    Notes
    -----
    Magnetic north lies the declination D east of true north, so that C_t,magnetic = C_t,true R_z(D)'. Its standard
    deviation is added about the vertical.

    Examples
    --------
    >>> from inclinometry.attitude.rotations import dcm
    >>> from inclinometry.motion.result import METHODS
    >>> one = Attitude(np.zeros(1), quaternion_from_dcm(dcm(1.0, 0.5, 2.0))[None], np.zeros((1, 3, 3)), np.zeros(1),
    ...                np.ones(1), np.zeros(1, dtype=np.uint32), np.zeros(1, dtype=np.uint8), "true")
    >>> found = to_magnetic(one, Site(declination=0.25))
    >>> found.north, round(float(found.angles.azimuth[0]), 9)
    ('magnetic', 0.75)
    """
    if site is None or site.declination is None:
        return None
    quaternion, covariance = rows.quaternion.copy(), rows.covariance.copy()
    good = ~rows.refused
    if good.any():
        matrix = dcm_from_quaternion(quaternion[good]) @ rotation_z(site.declination).T
        quaternion[good] = quaternion_from_dcm(matrix)
        down = matrix[:, :, 2]
        covariance[good] += (site.declination_sigma or 0.0) ** 2 * np.einsum("ki,kj->kij", down, down)
    return replace(rows, quaternion=quaternion, covariance=covariance, north="magnetic")

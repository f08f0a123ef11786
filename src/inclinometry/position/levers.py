"""How far an error of depth, inclination or azimuth at a station moves the courses beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.core.arrays import Array


class Levers(NamedTuple):
    """Derivatives of courses by the measurements at a station, axis (north, east, down) x stations, m or m per rad.

    Each is a tuple of (3, n) by depth, inclination, azimuth.

    own : of the course that ends at the station.
    both : of that and the one that begins there.
    course : inclination and azimuth acting over all of the course that ends at the station.
    own_length, both_length : (n,) half the lengths of those courses: the levers of singular weights.
    course_length : (n,) m.
    """

    own: tuple[Array, Array, Array]
    both: tuple[Array, Array, Array]
    course: tuple[Array, Array, Array]
    own_length: Array
    both_length: Array
    course_length: Array


def levers(md: Array, inclination: Array, azimuth: Array, surface: bool, surface_attitude: bool) -> Levers:
    """Balanced-tangential levers.

    Parameters
    ----------
    md, inclination, azimuth : (n,) m, rad
    surface : bool
        The depth of the first station has an error of its own.
    surface_attitude : bool
        The attitude at the first station is as uncertain as at the second: it takes all of the first course.

    Notes
    -----
    SPE 67616, equations (8) to (13), and the ISCWSA's definition of the error model, Rev 5, section 4.7.1.1: the
    Jacobian of balanced tangential courses, whose difference from minimum curvature doesn't matter to a covariance.
    """
    sine, cosine = np.sin(inclination), np.cos(inclination)
    north, east = np.cos(azimuth), np.sin(azimuth)
    tangent = np.stack([sine * north, sine * east, cosine])
    by_inclination = np.stack([cosine * north, cosine * east, -sine])
    by_azimuth = np.stack([-sine * east, sine * north, np.zeros_like(sine)])
    length = np.concatenate([[0.0], np.diff(md)])
    own, following = 0.5 * length, np.concatenate([0.5 * np.diff(md), [0.0]])
    if surface_attitude:
        own[1] *= 2.0
    mean = np.concatenate([np.zeros((3, 1)), 0.5 * (tangent[:, 1:] + tangent[:, :-1])], axis=1)
    depth_both = mean - np.concatenate([mean[:, 1:], np.zeros((3, 1))], axis=1)
    if surface:
        mean[:, 0] = tangent[:, 0]
    depth_both[:, 0] = 0.0  # the first station's depth error moves nothing that follows
    both = own + following
    both[0] = 0.0  # what is measured at the wellhead is not part of any course
    return Levers(
        (mean, own * by_inclination, own * by_azimuth),
        (depth_both, both * by_inclination, both * by_azimuth),
        (np.zeros_like(mean), length * by_inclination, length * by_azimuth),
        own,
        both,
        length,
    )

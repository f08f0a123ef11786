"""Inclination and toolface of a tool with two or three accelerometers, and how their errors reach them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.orientation import inclination_toolface
from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import InputError
from inclinometry.gyro._input import vectors

STEEPEST = 1e-9
"""Sine of the inclination, and cosine for a tool without z, below which derivatives are taken there instead."""

HEAVIEST = 1e9
"""Any unit of gravity gives less."""

EXCESS = 0.05
"""Share by which cross-axis gravity may exceed gravity before it is refused."""


class Tilt(NamedTuple):
    """n stations.

    inclination, toolface : (n,) rad; without z the inclination is the one below 90 deg.
    by_gravity : (n, 2, 3) derivatives of the two by gravity in tool axes.
    unseen : (n,) no accelerometer sees along the tool: 180 deg - inclination is as likely.
    strength : (n,) gravity, in the unit given.
    """

    inclination: Array
    toolface: Array
    by_gravity: Array
    unseen: Mask
    strength: Array


def tilt(gravity: ArrayLike, g: float | None = None) -> Tilt:
    """Inclination and toolface from gravity in tool axes.

    Parameters
    ----------
    gravity : (n, 2) or (n, 3) array_like
        m/s^2 (any unit when every z is given); z NaN where it is not measured.
    g : float, optional
        Gravity, same unit; needed where z is not measured.

    Raises
    ------
    InputError
        Values that are not finite, z missing without g, cross-axis gravity more than 5 % above g, no gravity at all.

    Notes
    -----
    theta = atan2(hypot(gx, gy), gz), or arcsin(hypot(gx, gy)/g); phi = atan2(gy, -gx).

    Examples
    --------
    >>> found = tilt([[-0.5, 0.0]], g=1.0)
    >>> np.degrees(found.inclination).round(9), found.unseen
    (array([30.]), array([ True]))
    """
    field = vectors(gravity, "gravity", HEAVIEST)
    unseen = np.isnan(field[:, 2])
    if unseen.any() and g is None:
        raise InputError("no accelerometer along the tool and no g: give gravity, m/s^2, or the latitude of the site")
    level = np.hypot(field[:, 0], field[:, 1])
    total = np.where(unseen, 0.0 if g is None else g, np.hypot(level, field[:, 2]))
    ratio = np.divide(level, total, out=np.full(len(level), np.inf), where=total > 0.0)
    bad = ~(total > 0.0) | (unseen & (ratio > 1.0 + EXCESS))
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"station {row + 1}: cross-axis gravity is {level[row]:.6g}, gravity {total[row]:.6g}; it can't be more: "
            "check the unit of the accelerometers (m/s^2) and their calibration"
        )
    whole = np.where(unseen, np.sqrt(np.maximum(total * total - level * level, 0.0)), field[:, 2])
    inclination, toolface = inclination_toolface(np.stack([field[:, 0], field[:, 1], whole], axis=1))
    return Tilt(inclination, toolface, _derivatives(inclination, toolface, total, unseen), unseen, total)


def upward(found: Tilt, rows: Mask) -> Tilt:
    """The same stations with the tool of some `rows` pointing up instead of down."""
    by_gravity = found.by_gravity.copy()
    by_gravity[rows, 0] *= -1.0
    return found._replace(
        inclination=np.where(rows, np.pi - found.inclination, found.inclination), by_gravity=by_gravity
    )


def _derivatives(inclination: Array, toolface: Array, total: Array, unseen: Mask) -> Array:
    sine, cosine = np.sin(inclination), np.cos(inclination)
    ct, st = np.cos(toolface), np.sin(toolface)
    out = np.zeros((len(inclination), 2, 3))
    # with z: turned by what is across; without: only through the length of the cross-axis part
    across = np.where(unseen, 1.0 / np.maximum(cosine, STEEPEST), cosine) / total
    out[:, 0, 0], out[:, 0, 1] = -ct * across, st * across
    out[:, 0, 2] = np.where(unseen, 0.0, -sine / total)
    lever = 1.0 / (np.maximum(sine, STEEPEST) * total)
    out[:, 1, 0], out[:, 1, 1] = st * lever, ct * lever
    return out


def settle_vertical(inclination: Array, azimuth: Array, toolface: Array) -> tuple[Array, Array]:
    """Azimuth and toolface by convention: exactly vertical azimuth is 0 and the whole turn is toolface."""
    vertical = np.sin(inclination) < 1e-15
    hand = np.where(inclination < np.pi / 2, 1.0, -1.0)
    turned = wrap_positive(toolface + hand * azimuth)
    return np.where(vertical, 0.0, azimuth), np.where(vertical, turned, toolface)

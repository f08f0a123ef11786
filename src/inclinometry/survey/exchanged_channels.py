"""Exchanged, cycled or reversed channels of a calibrated tool, told by the lengths of both fields and their angle.

A calibration holds for the channels it was made of. With others gravity, the magnetic field and the dip change from
station to station as the tool turns, by as much as gains and offsets differ between channels, and the hole is rough:

    m^2 = (d|g| / 0.2 %)^2 + (g off 9.81 / 1 %)^2 + (d|b| / 1 %)^2 + (d dip / 0.3 deg)^2 + (rough stations / 1 %)^2

d the 90th percentile of the distances from the median. Each order of the channels is tried, and taken where m falls to
a fifth and is that of a usual run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import permutations
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import STANDARD_GRAVITY, VECTORS
from inclinometry.orientation import dip_angle

Channels = Mapping[str, Array]
"""Sensor -> (n, 3) raw channels."""
Fields = Callable[[Channels], tuple[Array, Array]]
"""Of channels: g and b, (n, 3) m/s^2 and nT."""
Roughness = Callable[[Array, Array], float]
"""Of fields: share of stations off the line of their neighbours."""

_USUAL: Final = 12.0
"""Misfit m of a run with interference and motion."""


def misfit(g: Array, b: Array, rough: float) -> float:
    """How unlike those of one place, and of a hole, fields are: m above."""
    strength, length = np.linalg.norm(g, axis=1), np.linalg.norm(b, axis=1)
    if not (strength.min() > 0.0 and length.min() > 0.0):
        return np.inf
    off = float(np.median(strength)) / STANDARD_GRAVITY - 1.0
    parts = (
        _spread(strength) / float(np.median(strength)) / 0.002,
        max(abs(off) - 0.005, 0.0) / 0.01,
        _spread(length) / float(np.median(length)) / 0.01,
        _spread(dip_angle(g, b)) / np.radians(0.3),
        rough / 0.01,
    )
    return float(np.sqrt(np.sum(np.square(parts))))


def _spread(values: Array) -> float:
    return float(np.percentile(np.abs(values - np.median(values)), 90.0))


def explained(channels: Channels, calibrated: Fields | None, roughness: Roughness) -> str:
    """The order or sign of the channels with which a run is as it should be, in words; empty where none is needed.

    Parameters
    ----------
    channels : mapping
        Of accelerometer and magnetometer, (n, 3).
    calibrated : callable or None
        The calibration; None where the channels are the fields. These are as long and as far apart with both triads
        exchanged alike, so that the orders of one are tried.
    roughness : callable
    """
    if any(np.shape(channels[kind])[-1:] != (3,) for kind in VECTORS):
        return ""
    fields = calibrated or (lambda own: (own[VECTORS[0]], own[VECTORS[1]]))
    seen = fields(channels)
    given = misfit(*seen, roughness(*seen))
    if given < _USUAL:
        return ""
    best, found = min(0.2 * given, _USUAL), []
    for words, other in _orders(channels, one=calibrated is None):
        seen = fields(other)
        left = misfit(*seen, 0.0)
        left = left if left >= best else float(np.hypot(left, roughness(*seen) / 0.01))
        if left < best:
            best = left
        # of six axes one triad mirrored and the other are as good: only the hole is mirrored
        found.append((left, words))
    alike = [words for left, words in found if left <= best * (1.0 if calibrated else 1.05)]
    return " or ".join(alike[:2]) if best < min(0.2 * given, _USUAL) else ""


def _orders(channels: Channels, *, one: bool) -> Iterator[tuple[str, dict[str, Array]]]:
    """Words for a mistake, of one triad or of both, and the channels without it."""
    g, b = VECTORS
    if not one:
        yield "accelerometer and magnetometer exchanged", {g: channels[b], b: channels[g]}
    for kinds, of in ((VECTORS, "both triads"), ((g,), f"the {g}"), ((b,), f"the {b}"))[one:]:
        for order in list(permutations(range(3)))[1:]:
            moved = [axis for axis in range(3) if order[axis] != axis]
            names = " and ".join("xyz"[axis] for axis in moved)
            words = f"channels {names} of {of} exchanged" if len(moved) == 2 else f"the channels of {of} cycled"
            yield words, {kind: channels[kind][:, order] if kind in kinds else channels[kind] for kind in VECTORS}
        # of both triads of a calibrated tool its offsets and skew axes tell; fields are as they were
        for axis in range(3):
            signs = np.where(np.arange(3) == axis, -1.0, 1.0)
            turned = {kind: channels[kind] * signs if kind in kinds else channels[kind] for kind in VECTORS}
            yield f"channel {'xyz'[axis]} of {of} reversed", turned


def strange(g: Array, b: Array, *, known: bool) -> str:
    """What no place on Earth has at most stations, in words: gravity off by 5 %, a field of another size; else empty.

    Parameters
    ----------
    g, b : (n, 3) m/s^2, nT
    known : bool
        Whether the calibration knows the strength of its magnetic field; else b is in 50,000 of that.
    """
    strength, length = np.linalg.norm(g, axis=1), np.linalg.norm(b, axis=1)
    off = np.abs(strength / STANDARD_GRAVITY - 1.0) > 0.05
    if off.mean() > 0.5:
        return f"gravity is more than 5 % off 9.81 m/s2 at {int(off.sum())} of {len(off)} stations"
    low, high = (20_000.0, 70_000.0) if known else (50_000.0 * 20.0 / 70.0, 50_000.0 * 70.0 / 20.0)
    off = (length < low) | (length > high)
    if off.mean() > 0.5:
        return (
            f"the magnetic field is {np.median(length[off]):.4g} nT and the like at {int(off.sum())} of {len(off)} "
            "stations, 20000 to 70000 nT anywhere on Earth"
        )
    return ""

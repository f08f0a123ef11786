"""The index schemes as data, and whether a file's positions are those of its scheme."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, Index, Mask
from inclinometry.core.errors import InputError

DRIFT_ROWS: Final = 6
"""Readings of a station from which a scheme with free positions can afford a drift."""


@dataclass(frozen=True)
class Scheme:
    """A way of turning the sensors about the tool axis.

    name : as on the command line.
    positions_deg : index angles in the order in which they are visited; empty where any will do.
    minimum : different positions (for a fixed order: visits) a station needs.
    drift : whether a drift of the bias is fitted; None: where time is given and there are 6 readings or more.
    sentence : what it is good for.
    """

    name: str
    positions_deg: tuple[float, ...]
    minimum: int
    drift: bool | None
    sentence: str


SCHEMES: Final[Mapping[str, Scheme]] = MappingProxyType(
    {
        scheme.name: scheme
        for scheme in (
            Scheme("two", (0.0, 180.0), 2, False, "Two positions: bias removed; needs sensors along x and y."),
            Scheme("four", (0.0, 90.0, 180.0, 270.0), 4, False, "Four positions: bias removed, drift is not."),
            Scheme(
                "mirrored",
                (0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0),
                8,
                True,
                "Four positions there and back: bias and linear drift removed at no cost in noise.",
            ),
            Scheme("n", (), 3, None, "Three or more positions in any order: bias removed; drift from 6 readings on."),
            Scheme("carousel", (), 8, True, "Continuous rotation: bias and linear drift removed."),
        )
    }
)
"""Index schemes by name."""


def scheme_named(name: str) -> Scheme:
    """The scheme of a name, or an error that lists them."""
    if name not in SCHEMES:
        raise InputError(f"scheme is {name!r}; allowed: {', '.join(SCHEMES)}")
    return SCHEMES[name]


def check_positions(scheme: Scheme, labels: Index, index: Array, tolerance: float) -> None:
    """Raise unless the positions (S, P) of every station are those of the scheme, repeats in place allowed."""
    if scheme.positions_deg:
        for place in np.flatnonzero(~_as_wanted(scheme, index, tolerance)):
            _check_visits(scheme, int(labels[place]), index[place], tolerance)
        return
    different = _different(index, tolerance)
    poor = np.flatnonzero(different < scheme.minimum)
    if len(poor):
        at = poor[0]
        raise InputError(
            f"station {labels[at]}: {different[at]} different index positions ({_listed(index[at])} deg; those within "
            f"{np.degrees(tolerance):g} deg coincide); scheme {scheme.name!r} needs {scheme.minimum} or more: measure "
            "at further positions"
        )


def check_times(labels: Index, time: Array) -> None:
    """Raise unless time (S, P) increases within every station."""
    wrong = np.argwhere(np.diff(time, axis=1) <= 0.0)
    if len(wrong):
        at, row = wrong[0]
        raise InputError(
            f"station {labels[at]}: time goes from {time[at, row]:.10g} s to {time[at, row + 1]:.10g} s at its "
            f"reading {row + 2}; it must increase within a station: put the rows in the order of measurement"
        )


def _as_wanted(scheme: Scheme, index: Array, tolerance: float) -> Mask:
    """Stations (S,) that hold exactly the scheme's positions, one reading each: nearly always all of them."""
    wanted = np.radians(scheme.positions_deg)
    if index.shape[1] != len(wanted):
        return np.zeros(len(index), dtype=np.bool_)
    return np.asarray((np.abs(wrap_signed(index - wanted)) <= tolerance).all(axis=1))


def _check_visits(scheme: Scheme, label: int, index: Array, tolerance: float) -> None:
    """One station whose rows are not one reading a position: repeats in place and whole cycles are as good."""
    found, wanted = _visits(index, tolerance), np.radians(scheme.positions_deg)
    if len(index) < len(wanted) or len(found) < len(_visits(wanted, tolerance)):
        raise InputError(
            f"station {label}: {len(index)} readings at index {_listed(index)} deg; scheme {scheme.name!r} needs "
            f"{_listed(wanted)} deg: measure the missing positions, or use scheme 'n' if there are three or more"
        )
    for cycles in range(1, len(found) // 2 + 1):
        expected = _visits(np.tile(wanted, cycles), tolerance)
        if len(expected) == len(found) and (np.abs(wrap_signed(found - expected)) <= tolerance).all():
            return
    raise InputError(
        f"station {label}: index positions in the order {_listed(found)} deg; scheme {scheme.name!r} needs "
        f"{_listed(wanted)} deg within {np.degrees(tolerance):g} deg, in that order, since what a drift does to the "
        "mean depends on it: put the rows in the order of measurement, or use scheme 'n', which takes any order"
    )


def _visits(index: Array, tolerance: float) -> Array:
    """Positions with repeats in place struck out."""
    return np.asarray(index[np.concatenate([[True], np.abs(wrap_signed(np.diff(index))) > tolerance])])


def _different(index: Array, tolerance: float) -> Index:
    """Number (S,) of positions further apart than the tolerance, around the circle."""
    turned = np.sort(np.mod(index, 2.0 * np.pi), axis=1)
    gaps = np.diff(turned, axis=1, append=turned[:, :1] + 2.0 * np.pi)
    apart = np.count_nonzero(gaps > tolerance, axis=1)
    # a dense rotation has no gap at all, but the ground it covers counts
    covered = np.floor(np.where(gaps > tolerance, 0.0, gaps).sum(axis=1) / tolerance)
    return np.asarray(np.maximum(np.maximum(1, apart), covered), dtype=np.intp)


def _listed(index: Array, most: int = 12) -> str:
    shown = ", ".join(f"{round(float(v), 2) + 0.0:g}" for v in np.degrees(index[:most]))
    return shown if len(index) <= most else f"{shown}, ... ({len(index)} in all)"

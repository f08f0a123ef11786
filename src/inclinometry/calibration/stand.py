"""What a calibration stand can be set to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inclinometry.calibration.dials import ANGLE_TOLERANCE
from inclinometry.core.angles import TAU, wrap_positive
from inclinometry.core.arrays import Array, Mask, finite, frozen, within
from inclinometry.core.errors import InputError

Range = tuple[float, float]

_STEPS_DEG = (90.0, 60.0, 45.0, 30.0, 22.5, 15.0, 10.0, 7.5, 5.0, 2.5, 1.0, 0.5)
_NAMES = ("azimuth", "inclination", "toolface")


@dataclass(frozen=True, eq=False)
class Stand:
    """Settings of each dial that a plan may use, rad; every combination is allowed.

    Parameters
    ----------
    azimuth, inclination, toolface : (n,) array_like
        rad, within two turns.

    Raises
    ------
    InputError
        A dial without a setting, values that are not finite or look like degrees.

    Examples
    --------
    >>> len(Stand(np.radians([0.0, 120.0]), np.radians([0.0, 90.0]), np.radians([0.0, 120.0, 240.0])).positions())
    9
    """

    azimuth: Array
    inclination: Array
    toolface: Array

    def __post_init__(self) -> None:
        for name in _NAMES:
            values = within(finite(getattr(self, name), name, (None,)), name, -TAU, TAU, "rad")
            if values.ndim != 1 or not len(values):
                raise InputError(f"{name} of the stand has shape {values.shape}; give at least one setting, (n,)")
            object.__setattr__(self, name, frozen(values))

    def positions(self) -> Array:
        """Settings (K, 3) azimuth, inclination, toolface that differ.

        With the tool axis along the azimuth axis, up or down, the two dials turn the same way and only one of equal
        orientations is kept: the one of the first azimuth.
        """
        grid = np.meshgrid(self.azimuth, self.inclination, self.toolface, indexing="ij")
        settings = np.stack([x.ravel() for x in grid], axis=1)
        return np.asarray(settings[_first_of_each(settings)])


def stand_within(
    azimuth: Range = (0.0, TAU),
    inclination: Range = (0.0, np.pi),
    toolface: Range = (0.0, TAU),
    candidates: int = 1000,
) -> Stand:
    """A stand free to turn within limits, on a grid of about as many positions as asked for.

    Parameters
    ----------
    azimuth, inclination, toolface : (low, high)
        Limits of each dial, rad; a full turn is taken as such, equal limits fix a dial.
    candidates : int
        How many positions at most (a tenth more may come), evenly in angle: 30 x 22.5 x 30 degrees for 1000 of a free
        stand.

    Examples
    --------
    >>> free = stand_within()
    >>> len(free.positions()), len(free.inclination)
    (1032, 9)
    """
    limits = [_limits(pair, name) for pair, name in zip((azimuth, inclination, toolface), _NAMES, strict=True)]
    if candidates < 1:
        raise InputError(f"candidates is {candidates}; allowed: 1 or more")
    level = [0, 0, 0]
    found = _stand(limits, level)
    while True:
        # the coarsest dial that can still be refined goes first; inclination before the others
        for dial in sorted((1, 2, 0), key=lambda d: level[d]):
            finer = [n + (d == dial) for d, n in enumerate(level)]
            if limits[dial][0] == limits[dial][1] or finer[dial] >= len(_STEPS_DEG):
                continue
            trial = _stand(limits, finer)
            if len(trial.positions()) <= 1.1 * candidates:
                level, found = finer, trial
                break
        else:
            return found


def _limits(pair: Range, name: str) -> Range:
    low, high = within(finite(pair, f"{name} limits", (2,)), f"{name} limits", -TAU, TAU, "rad")
    if low > high:
        raise InputError(f"{name} limits are {low:g} to {high:g} rad; the first must not exceed the second")
    return float(low), float(high)


def _stand(limits: list[Range], level: list[int]) -> Stand:
    return Stand(*(_grid(pair, np.radians(_STEPS_DEG[n])) for pair, n in zip(limits, level, strict=True)))


def _grid(limits: Range, step: float) -> Array:
    """Settings from low to high, no further apart than the step; without the end where it is the start again."""
    low, high = limits
    span = high - low
    count = int(np.ceil(span / step - 1e-9))
    if span >= TAU - ANGLE_TOLERANCE:
        return low + span * np.arange(count) / count
    return np.linspace(low, high, count + 1)


def _first_of_each(settings: Array) -> Mask:
    """Which settings are the first of their orientation."""
    azimuth, inclination, toolface = settings.T
    plumb = np.abs(np.sin(inclination)) < ANGLE_TOLERANCE
    turned = np.where(np.cos(inclination) > 0.0, toolface + azimuth, toolface - azimuth)
    key = np.stack(
        [np.where(plumb, 0.0, wrap_positive(azimuth)), wrap_positive(inclination), np.where(plumb, turned, toolface)],
        axis=1,
    )
    # in units of the tolerance, a turn taken off again where rounding reached it
    turn = round(TAU / ANGLE_TOLERANCE)
    whole = np.mod(np.round(wrap_positive(key) / ANGLE_TOLERANCE), turn)
    keep = np.zeros(len(settings), dtype=bool)
    keep[np.unique(whole, axis=0, return_index=True)[1]] = True
    return keep

"""The analogue-to-digital converter: counts, steps, saturation."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.core.arrays import Array
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.core.errors import InputError

FULL_SCALE: Final[Mapping[str, float]] = MappingProxyType(
    {"accelerometer": 1.25 * STANDARD_GRAVITY, "magnetometer": 65000.0, "gyro": 3e-4}
)
"""Half the range of the converter, m/s^2, nT, rad/s: the converter covers plus and minus this."""

PHYSICAL_UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {"accelerometer": "m/s^2", "magnetometer": "nT", "gyro": "rad/s"}
)
"""Unit of the signals of a tool without a converter."""


def converter_step(kind: str, bits: int) -> float:
    """Physical size of one count of a `bits`-bit converter over +-FULL_SCALE, m/s^2, nT or rad/s.

    Raises
    ------
    InputError
        `bits` outside 2..32.

    Examples
    --------
    >>> round(converter_step("magnetometer", 12), 3)  # nT
    31.738
    """
    _check(bits)
    return 2.0 * FULL_SCALE[kind] / 2.0**bits


def has_step(kind: str, unit: str) -> bool:
    """Whether the size of a count is known for signals in this unit.

    Examples
    --------
    >>> has_step("magnetometer", "nT"), has_step("magnetometer", "V")
    (True, False)
    """
    return unit in ("counts", PHYSICAL_UNITS[kind])


def signal_step(kind: str, unit: str, bits: int) -> float:
    """Size of one count in the unit the signals have.

    Raises
    ------
    InputError
        A unit other than counts and the kind's physical unit: nothing says how large its counts are.
    """
    _check(bits)
    if unit == "counts":
        return 1.0
    if unit == PHYSICAL_UNITS[kind]:
        return converter_step(kind, bits)
    raise InputError(
        f"bits is {bits}, but {kind} signals are in {unit!r}, whose step is not known; allowed: 'counts' or "
        f"{PHYSICAL_UNITS[kind]!r}; else leave bits out, or state 0 at the command line"
    )


def digitise(signals: ArrayLike, step: float, bits: int) -> tuple[Array, NDArray[np.bool_]]:
    """Round to the nearest of 2^bits steps and clip at the ends of the range.

    Parameters
    ----------
    signals : array_like
    step : float
        One count, in the unit of `signals`.
    bits : int

    Returns
    -------
    signals : ndarray
        Multiples of `step`, from -2^(bits - 1) to 2^(bits - 1) - 1 of them.
    saturated : ndarray of bool

    Examples
    --------
    >>> digitise([0.4, 5.2, 9.0], 1.0, 4)[0]
    array([0., 5., 7.])
    """
    _check(bits)
    codes = np.rint(np.asarray(signals, dtype=np.float64) / step)
    low, high = -(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1.0
    return np.clip(codes, low, high) * step, (codes < low) | (codes > high)


def _check(bits: int) -> None:
    if not 2 <= bits <= 32 or int(bits) != bits:
        raise InputError(f"bits is {bits}; allowed: a whole number from 2 to 32, or None for no converter")

"""The static characteristic of a real sensor: noise, a square law, hysteresis; and magnetometers by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.sensors.triad import Triad
from inclinometry.simulate.converter import FULL_SCALE


@dataclass(frozen=True)
class Characteristic:
    """What a sensor does besides U = n a + U0.

    noise : white noise of one reading, m/s^2, nT, rad/s; None for that of the tool.
    square : at full scale the signal is too large by this share of full scale, at half of it by a quarter.
    hysteresis : the signal lags behind the field by up to this share of full scale (Prandtl's play operator), and so
        depends on the readings before it.

    Raises
    ------
    InputError
        Negative noise or hysteresis, shares of more than a tenth.
    """

    noise: float | None = None
    square: float = 0.0
    hysteresis: float = 0.0

    def __post_init__(self) -> None:
        if self.noise is not None and not 0.0 <= self.noise < np.inf:
            raise InputError(f"noise is {self.noise:g}; it must be 0 or more")
        if not (abs(self.square) <= 0.1 and 0.0 <= self.hysteresis <= 0.1):
            raise InputError(
                f"non-linearity {100 * self.square:g} %, hysteresis {100 * self.hysteresis:g} % of full scale; "
                "up to 10 % is allowed"
            )

    def bent(self, clean: Array, triad: Triad) -> Array:
        """Signals (n, m), in the order of reading, of sensors that would give `clean` were they straight.

        Examples
        --------
        >>> one = Triad("magnetometer", 2.0 * np.eye(3), np.zeros(3), field_strength=65000.0)
        >>> Characteristic(square=0.01).bent(np.array([[2.0, 1.0, -1.0]]), one)
        array([[ 2.02 ,  1.005, -0.995]])
        >>> Characteristic(hysteresis=0.05).bent(np.array([[0.0], [1.0], [0.0]]) * [1.0, 1.0, 1.0], one)[:, 0]
        array([0. , 0.9, 0.1])
        """
        full = signal_of(triad, FULL_SCALE[triad.kind])
        value = clean - triad.offset[0]
        found = value + self.square * value**2 / full
        if self.hysteresis:
            width, last = self.hysteresis * full, value[0]
            for row in range(len(value)):
                last = np.clip(last, value[row] - width, value[row] + width)
                found[row] += last - value[row]
        return np.asarray(found + triad.offset[0])


def signal_of(triad: Triad, field: float) -> Array:
    """The signal (m,) that a field of m/s^2, nT or rad/s along its axis makes of each sensor, the offset left out."""
    if triad.field_strength is None:
        raise InputError(f"the {triad.kind} does not know the strength of its field: nothing says what is full scale")
    return np.asarray(np.linalg.norm(triad.tensor[0], axis=1) * (field / triad.field_strength))


MAGNETOMETERS: Final[Mapping[str, Characteristic]] = MappingProxyType(
    {
        "magnetoresistive": Characteristic(noise=20.0),
        # noise, square law and hysteresis of half a per cent of full scale each: what is left after good compensation
        "fluxgate": Characteristic(noise=325.0, square=0.005, hysteresis=0.005),
    }
)
"""Magnetometers as in Rogatykh 2018: azimuth to 0.2-0.5 deg with magnetoresistive sensors, 1.5-2.0 with fluxgates."""

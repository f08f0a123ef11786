"""A group of elementary sensors that see one field: U = N a + U0, for any number of arbitrarily placed axes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import InputError


@dataclass(frozen=True, eq=False)
class Triad:
    """Sensors of one kind: signals U = N(T) a + U0(T), a the unit vector along the field in tool axes.

    Parameters
    ----------
    kind : {"accelerometer", "magnetometer", "gyro"}
    tensor : (m, 3) or (degree + 1, m, 3) array_like
        Parametric tensor N, `unit` per unit direction: conversion factor, sensitive axis and field strength in one.
        With a leading axis, coefficients of the powers of (T - reference_temperature).
    offset : (m,) or (degree + 1, m) array_like
        U0, in `unit`.
    unit : str
        Unit of the signals, e.g. "counts", "V", "m/s^2".
    field_strength : float, optional
        Strength of the field at the calibration, m/s^2, nT or rad/s; without it only directions are known.
    reference_temperature : float
        degC.
    g_sensitivity : (m, 3) array_like, optional
        Of a gyro: `unit` per g of gravity along each tool axis (gravity points down), on top of U. It is taken off by
        `without_gravity` only; it is no part of `parameter_names` nor of a tool's covariance.

    Raises
    ------
    InputError
        Wrong shapes, values not finite, unknown kind, m < 2, axes that all lie along one line, or a g-sensitivity of
        anything but a gyro.

    Notes
    -----
    Equations (10)-(12) of Rogatykh N.P., "Identification of parameters of inclinometer sensors", 2018.

    Examples
    --------
    >>> triad = Triad("accelerometer", [[0, 0, 2], [3, 0, 0], [0, 1, 0]], [10, 0, 0], "counts")
    >>> triad.signals([0, 0, 1])
    array([12.,  0.,  0.])
    >>> triad.field([12, 0, 0])
    array([0., 0., 1.])
    """

    kind: str
    tensor: Array
    offset: Array
    unit: str = "counts"
    field_strength: float | None = None
    reference_temperature: float = 20.0
    g_sensitivity: Array | None = None
    _inverse: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"kind is {self.kind!r}; allowed: {', '.join(KINDS)}")
        tensor = finite(self.tensor, f"{self.kind} tensor", (None, 3))
        offset = finite(self.offset, f"{self.kind} offset", (None,))
        tensor = tensor[None] if tensor.ndim == 2 else tensor
        offset = offset[None] if offset.ndim == 1 else offset
        if tensor.ndim != 3 or tensor.shape[:2] != offset.shape:
            raise InputError(f"{self.kind}: tensor {self.tensor!r} and offset {self.offset!r} do not go together")
        if tensor.shape[1] < 2:
            raise InputError(f"{self.kind}: {tensor.shape[1]} sensor; at least 2 are needed to see a direction")
        if np.linalg.matrix_rank(tensor[0]) < 2:
            raise InputError(f"{self.kind}: all sensitive axes lie along one line; no direction can be found")
        if self.field_strength is not None and not self.field_strength > 0.0:
            raise InputError(f"{self.kind}: field strength is {self.field_strength}; it must be positive")
        if self.g_sensitivity is not None:
            object.__setattr__(self, "g_sensitivity", self._checked_sensitivity(tensor.shape[1]))
        object.__setattr__(self, "tensor", frozen(tensor))
        object.__setattr__(self, "offset", frozen(offset))
        object.__setattr__(self, "_inverse", frozen(np.linalg.pinv(tensor[0])))

    def _checked_sensitivity(self, count: int) -> Array:
        if self.kind != "gyro":
            raise InputError(f"{self.kind}: g_sensitivity is given; only gyros have one, leave it out")
        sensitivity = finite(self.g_sensitivity, "g_sensitivity", (count, 3))  # type: ignore[arg-type]
        if sensitivity.ndim != 2:
            raise InputError(f"g_sensitivity has shape {sensitivity.shape}; expected ({count}, 3)")
        return frozen(sensitivity)

    @property
    def count(self) -> int:
        """Number of sensors, m."""
        return int(self.tensor.shape[1])

    @property
    def degree(self) -> int:
        """Degree of the temperature polynomial; 0 for a triad that does not know temperature."""
        return int(self.tensor.shape[0]) - 1

    @property
    def full(self) -> bool:
        """Whether the sensors see all three components of the field."""
        return bool(np.linalg.matrix_rank(self.tensor[0]) == 3)

    def basis(self, temperature: ArrayLike | None) -> Array:
        """Powers of (T - reference), shape (..., degree + 1); a missing temperature is an error unless degree is 0."""
        if self.degree == 0:
            shape = () if temperature is None else np.shape(temperature)
            return np.ones((*shape, 1))
        if temperature is None:
            raise InputError(f"{self.kind}: this calibration depends on temperature; give temperature_degC")
        difference = finite(temperature, "temperature") - self.reference_temperature
        return np.asarray(difference[..., None] ** np.arange(self.degree + 1))

    def signals(self, direction: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Signals (..., m) for field directions (..., 3); equation (11)."""
        a = finite(direction, "direction", (3,))
        powers = self.basis(temperature)
        tensor = np.tensordot(powers, self.tensor, axes=1)
        return np.asarray((tensor @ a[..., None])[..., 0] + powers @ self.offset)

    def field(self, signals: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Field (..., 3) in tool axes, in units of the calibration's field; equation (12), pseudo-inverse when m > 3.

        Its length is 1 where the field is as strong as at the calibration. With two sensors (or coplanar axes) the
        result is the projection of the field on the plane they see.
        """
        u = finite(signals, f"{self.kind} signals", (self.count,))
        if self.degree == 0:
            return np.asarray((u - self.offset[0]) @ self._inverse.T)
        powers = self.basis(temperature)
        tensor = np.tensordot(powers, self.tensor, axes=1)
        return np.asarray((np.linalg.pinv(tensor) @ (u - powers @ self.offset)[..., None])[..., 0])

    def inverse(self, temperature: ArrayLike | None = None) -> Array:
        """N^-1 (or pseudo-inverse), shape (..., 3, m), at a temperature."""
        if self.degree == 0:
            return self._inverse
        return np.asarray(np.linalg.pinv(np.tensordot(self.basis(temperature), self.tensor, axes=1)))

    def without_gravity(self, signals: ArrayLike, gravity_direction: ArrayLike) -> Array:
        """Signals (..., m) freed from what gravity adds to a gyro: U - G g.

        Parameters
        ----------
        signals : (..., m) array_like
            In `unit`.
        gravity_direction : (..., 3) array_like
            Gravity in tool axes in units of g: its direction, down, for a tool at rest.

        Returns
        -------
        (..., m) ndarray
            The signals as they are where no g-sensitivity is known.

        Examples
        --------
        >>> gyro = Triad("gyro", np.eye(3), np.zeros(3), "deg/h", g_sensitivity=0.5 * np.eye(3))
        >>> gyro.without_gravity([10.0, 0.0, 0.5], [0.0, 0.0, 1.0])
        array([10.,  0.,  0.])
        """
        u = finite(signals, f"{self.kind} signals", (self.count,))
        if self.g_sensitivity is None:
            return u
        return np.asarray(u - finite(gravity_direction, "gravity_direction", (3,)) @ self.g_sensitivity.T)

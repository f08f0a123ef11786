"""Elementary sensors that see one field: U = N a + U0, for any number of arbitrarily placed axes, one included."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, finite, frozen
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import InputError

_IN_PLANE = 1e-6
"""Share of the field across the plane of two sensors below which they do not tell how it changes there."""


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
        Wrong shapes, values not finite, unknown kind, no sensor, several that all lie along one line, or a
        g-sensitivity of anything but a gyro.

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
        if tensor.shape[1] < 1:
            raise InputError(f"{self.kind}: no sensor; give at least one row of the tensor")
        if not tensor[0].any():
            raise InputError(f"{self.kind}: the tensor is zero; such a sensor sees nothing")
        if tensor.shape[1] > 1 and np.linalg.matrix_rank(tensor[0]) < 2:
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
    def rank(self) -> int:
        """Number of components of the field that the sensors see: 1, 2 or 3."""
        return int(np.linalg.matrix_rank(self.tensor[0]))

    @property
    def full(self) -> bool:
        """Whether the sensors see all three components of the field."""
        return self.rank == 3

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
        result is the projection of the field on the plane they see, with one sensor that on its axis.
        """
        u = finite(signals, f"{self.kind} signals", (self.count,))
        if self.degree == 0:
            return np.asarray((u - self.offset[0]) @ self._inverse.T)
        powers = self.basis(temperature)
        tensor = np.tensordot(powers, self.tensor, axes=1)
        return np.asarray((np.linalg.pinv(tensor) @ (u - powers @ self.offset)[..., None])[..., 0])

    def field_of_length(
        self, signals: ArrayLike, side: ArrayLike, temperature: ArrayLike | None = None, length: ArrayLike = 1.0
    ) -> tuple[Array, Array]:
        """Field (..., 3) of a triad that sees a plane, its third component from the known length of the field.

        Parameters
        ----------
        signals : (..., m) array_like
        side : (..., 3) array_like
            A direction in tool axes on that side of the plane to which the field points, e.g. (0, 0, 1) for gravity in
            a hole that goes down.
        temperature : (...) array_like, optional
            degC.
        length : (...) array_like
            Strength of the field in units of that at the calibration.

        Returns
        -------
        field : (..., 3) ndarray
            In the plane where the part seen is as long as the field or longer.
        unseen : (..., 3) ndarray
            The unit vector across the plane, on the side stated.

        Raises
        ------
        InputError
            A triad that sees three components, or one.

        Notes
        -----
        a = p + sqrt(length^2 - |p|^2) n with the part p seen in the plane and n across it.

        Examples
        --------
        >>> pair = Triad("accelerometer", [[2, 0, 0], [0, 3, 0]], [0, 0])
        >>> pair.field_of_length([1.0, 0.0], [0, 0, 1.0])[0].round(4)
        array([0.5  , 0.   , 0.866])
        """
        if self.rank != 2:
            raise InputError(f"the {self.kind} sees {self.rank} components; a known length adds the third to two")
        part = self.field(signals, temperature)
        tensor = np.tensordot(self.basis(temperature), self.tensor, axes=1)
        across = np.linalg.svd(tensor)[2][..., 2, :]
        across = across * np.where(np.sum(across * finite(side, "side", (3,)), axis=-1) < 0.0, -1.0, 1.0)[..., None]
        rest = np.maximum(np.asarray(length, dtype=np.float64) ** 2 - np.sum(part**2, axis=-1), 0.0)
        across = np.broadcast_to(across, part.shape)
        return part + np.sqrt(rest)[..., None] * across, across

    def inverse_at(self, field: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Derivatives (..., 3, m) of the field by the signals where the field is (..., 3): N^-1.

        Of a triad that sees a plane and a field of known length: (1 - n a' / (a.n)) N^+, NaN where the field lies in
        the plane and a small signal says nothing of the component across it.
        """
        inverse = self.inverse(temperature)
        if self.rank != 2:
            return inverse
        a = finite(field, "field", (3,))
        n = np.linalg.svd(np.tensordot(self.basis(temperature), self.tensor, axes=1))[2][..., 2, :]
        along = np.sum(a * n, axis=-1)
        along = np.where(np.abs(along) < _IN_PLANE, np.nan, along)[..., None, None]
        return np.asarray(inverse - n[..., :, None] * (a[..., None, :] @ inverse) / along)

    def by_length(self, field: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Derivative (..., 3) of a field of known length by the logarithm of that length: |a|^2 n / (a.n).

        Nought for a triad that sees three components; NaN where the field lies in the plane that two sensors see.
        """
        a = finite(field, "field", (3,))
        if self.rank != 2:
            return np.zeros_like(a)
        n = np.linalg.svd(np.tensordot(self.basis(temperature), self.tensor, axes=1))[2][..., 2, :]
        along = np.sum(a * n, axis=-1, keepdims=True)
        return np.asarray(
            np.sum(a * a, axis=-1, keepdims=True) * n / np.where(np.abs(along) < _IN_PLANE, np.nan, along)
        )

    def inverse(self, temperature: ArrayLike | None = None) -> Array:
        """N^-1 (or pseudo-inverse), shape (..., 3, m), at a temperature."""
        if self.degree == 0:
            return self._inverse
        return np.asarray(np.linalg.pinv(np.tensordot(self.basis(temperature), self.tensor, axes=1)))

    def inverse_powers(self, low: float, high: float) -> Array:
        """N^-1 as coefficients (p + 1, 3, m) of the powers of (T - reference), good to 1e-8 of itself from low to high.

        N is the polynomial that was found; its inverse is none, but one of few powers serves a firmware that only
        multiplies and adds.

        Examples
        --------
        >>> warm = np.stack([np.eye(3), 1e-3 * np.eye(3)])
        >>> triad = Triad("accelerometer", warm, np.zeros((2, 3)))
        >>> powers = triad.inverse_powers(0.0, 100.0)
        >>> at = float(np.polyval(powers[::-1, 0, 0], 80.0 - 20.0))
        >>> abs(at - 1.0 / 1.06) < 1e-8
        True
        """
        if self.degree == 0:
            return self._inverse[None]
        middle, half = (low + high) / 2.0, max((high - low) / 2.0, 1e-3)
        x = np.cos(np.pi * (np.arange(24) + 0.5) / 24.0)
        exact = self.inverse(middle + half * x).reshape(24, -1)
        size = np.abs(exact).max()
        for power in range(1, 16):
            found = np.polynomial.chebyshev.chebfit(x, exact, power)
            if np.abs(np.polynomial.chebyshev.chebval(x, found).T - exact).max() < 1e-8 * size:
                break
        else:
            raise InputError(f"{self.kind}: the sensors change too much between {low:g} and {high:g} degC")
        columns = []
        for column in found.T:
            inside = np.polynomial.Chebyshev(column, [middle - half, middle + half])
            about = inside(np.polynomial.Polynomial([self.reference_temperature, 1.0]))
            columns.append(np.pad(about.coef, (0, power + 1 - len(about.coef))))
        powers: Array = np.stack(columns, axis=1).astype(np.float64).reshape(power + 1, 3, self.count)
        return powers

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

"""Checks of what comes into the room: one value a station, vectors and covariances with or without z."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import InputError

SKEW = 1e-6
"""Share by which a covariance may miss being symmetric and positive before it is refused."""


def numbers(value: ArrayLike, name: str) -> Array:
    """float64, NaN allowed; InputError for what is no number."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as numbers: {error}") from None


def per_station(value: ArrayLike, size: int, name: str, low: float, high: float, unit: str = "") -> Array:
    """One value for each of `size` stations, within low..high; a scalar serves all."""
    given = numbers(value, name)
    if given.shape not in ((), (1,), (size,)):
        raise InputError(f"{name} has shape {given.shape}; expected one value, or ({size},)")
    bad = ~((given >= low) & (given <= high))
    if bad.any():
        worst = float(np.atleast_1d(given)[np.atleast_1d(bad)][0])
        in_unit = f" {unit}" if unit else ""
        raise InputError(f"{name} is {worst:.10g}{in_unit}; allowed {low:g} to {high:g}{in_unit}")
    return np.broadcast_to(given, (size,))


def one_value(value: ArrayLike, name: str, low: float, high: float, unit: str = "") -> float:
    """A single value within low..high."""
    return float(per_station(value, 1, name, low, high, unit)[0])


def vectors(value: ArrayLike, name: str, largest: float, size: int | None = None) -> Array:
    """Vectors (n, 3); z NaN where it is not measured, x and y finite."""
    given = numbers(value, name)
    shaped = given.ndim == 2 and given.shape[1] in (2, 3) and size in (None, given.shape[0])
    if not shaped:
        count = "n" if size is None else size
        raise InputError(f"{name} has shape {given.shape}; expected ({count}, 2) or ({count}, 3)")
    out = np.full((len(given), 3), np.nan)
    out[:, : given.shape[1]] = given
    bad = ~(np.abs(out) <= largest)
    bad[:, 2] &= ~np.isnan(out[:, 2])
    if bad.any():
        row, axis = np.argwhere(bad)[0].tolist()
        raise InputError(
            f"{name}[{row}, {axis}] is {out[row, axis]:.6g}; every value must be finite and at most {largest:g} "
            "(z may be NaN where it is not measured)"
        )
    return out


def covariances(value: ArrayLike, name: str, seen: Mask, *, positive: bool) -> Array:
    """Covariances (n, 3, 3), rows and columns of z NaN where z is not `seen`; one matrix serves all stations."""
    given, size = numbers(value, name), len(seen)
    if given.ndim == 2:
        given = np.broadcast_to(given, (size, *given.shape))
    if given.ndim != 3 or given.shape[0] != size or given.shape[1:] not in ((2, 2), (3, 3)):
        raise InputError(f"{name} has shape {given.shape}; expected ({size}, 2, 2) or ({size}, 3, 3)")
    out = np.full((size, 3, 3), np.nan)
    axes = given.shape[1]
    out[:, :axes, :axes] = given
    out[~seen, 2, :] = out[~seen, :, 2] = np.nan
    if seen.any() and axes == 2:
        raise InputError(f"{name} is 2 x 2, but z is measured; give 3 x 3 matrices, or leave z out")
    bad = _impossible(out, seen, positive)
    if bad.any():
        row = int(np.argmax(bad))
        need = "positive" if positive else "not negative"
        raise InputError(
            f"{name}[{row}] is {given[row].tolist()}; a covariance is finite, symmetric and {need}: give the noise"
        )
    return out


def _impossible(matrices: Array, seen: Mask, positive: bool) -> Mask:
    """Matrices that are no covariances, looked at by 2 x 2 minors and, with z, the determinant."""
    bad = np.zeros(len(matrices), dtype=bool)
    variance = np.diagonal(matrices, axis1=1, axis2=2)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        used = seen if j == 2 else np.ones(len(seen), dtype=bool)
        with np.errstate(invalid="ignore", over="ignore"):
            product, cross = variance[:, i] * variance[:, j], matrices[:, i, j]
            fits = (variance[:, i] >= 0.0) & (variance[:, j] >= 0.0) & np.isfinite(product)
            fits &= np.abs(cross - matrices[:, j, i]) <= SKEW * np.sqrt(np.maximum(product, 0.0))
            fits &= cross**2 < product if positive else cross**2 <= product * (1.0 + SKEW)
        bad |= used & ~fits
    whole = seen & ~bad
    if positive and whole.any():
        bad[whole] |= ~(np.linalg.det(matrices[whole] / _size(matrices[whole])) > 0.0)
    return bad


def _size(matrices: Array) -> Array:
    """Mean variance (n, 1, 1), so that determinants neither over- nor underflow."""
    return np.asarray(np.trace(matrices, axis1=1, axis2=2)[:, None, None] / 3.0)

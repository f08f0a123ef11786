"""Fields in another unit than their columns name, told by their length: gravity and the Earth's magnetic field.

Gravity is 9.81 m/s^2 within 1 %, the magnetic field 20,000 to 70,000 nT, and no two units in use differ by less than
these ranges: of the factors between units one at most brings a length into its range.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import STANDARD_GRAVITY

_GRAVITY: Final = (
    (STANDARD_GRAVITY, "g", "m/s2", "gx_g"),
    (STANDARD_GRAVITY / 1000.0, "mg", "m/s2", "gx_mg"),
    (1.0 / STANDARD_GRAVITY, "m/s2", "g", "gx_m_s2"),
    (1000.0 / STANDARD_GRAVITY, "m/s2", "mg", "gx_m_s2"),
    (1000.0, "g", "mg", "gx_g"),
    (0.001, "mg", "g", "gx_mg"),
)
_MAGNETIC: Final = (
    (1e3, "uT", "nT", "bx_uT"),
    (1e-3, "nT", "uT", "bx_nT"),
    (1e5, "gauss", "nT", "bx_gauss"),
    (1e-5, "nT", "gauss", "bx_nT"),
    (1e2, "mG or uT", "nT or gauss", "bx_mG or bx_uT"),
    (1e-2, "nT or gauss", "mG or uT", "bx_nT or bx_gauss"),
)
"""Factor to the field as it is, the unit that it is in, the one that is named, the column as it should be called."""


def misnamed_unit(g: Array, b: Array) -> str:
    """The unit that makes a field as long as it is everywhere on Earth, in words; empty where none is needed.

    Parameters
    ----------
    g, b : (n, 3) m/s^2, nT
        As their columns name them.

    Examples
    --------
    >>> g, b = np.tile([0.0, 0.0, 1.0], (5, 1)), np.tile([2e4, 0.0, 4e4], (5, 1))
    >>> misnamed_unit(9.81 * g, b), misnamed_unit(g, b)[:39]
    ('', 'gravity is 1 m/s2, 9.81 everywhere on E')
    """
    strength, length = float(np.median(np.linalg.norm(g, axis=1))), float(np.median(np.linalg.norm(b, axis=1)))
    if not 0.7 < strength / STANDARD_GRAVITY < 1.4:
        for factor, unit, named, column in _GRAVITY:
            if abs(factor * strength / STANDARD_GRAVITY - 1.0) < 0.05:
                return (
                    f"gravity is {strength:.4g} m/s2, 9.81 everywhere on Earth, which it is in {unit} where {named} is "
                    f"named: name the unit in the columns, as {column}"
                )
    if not 10_000.0 < length < 140_000.0:
        for factor, unit, named, column in _MAGNETIC:
            if 20_000.0 <= factor * length <= 70_000.0:
                return (
                    f"the magnetic field is {length:.4g} nT, 20000 to 70000 nT anywhere on Earth, which it is in "
                    f"{unit} where {named} is named: name the unit in the columns, as {column}"
                )
    return ""

"""Rig settings of a table: degrees in, radians out, and the signs that they were never degrees."""

from __future__ import annotations

import numpy as np

from inclinometry.core.angles import wrap_positive
from inclinometry.core.arrays import Array
from inclinometry.io.columns import ANGLES
from inclinometry.io.table import Table

_LIMITS = {"azimuth_deg": 360.0, "inclination_deg": 180.0, "toolface_deg": 360.0}


def read_settings(table: Table) -> tuple[Array, Array, Array] | None:
    """Azimuth, inclination, toolface (n,), rad; None when the table has none of them. Errors as `need_settings`."""
    return need_settings(table) if any(name in table for name in ANGLES) else None


def need_settings(table: Table) -> tuple[Array, Array, Array]:
    """Azimuth, inclination, toolface (n,), rad.

    Raises
    ------
    FileError
        One of the three is missing, values out of range, angles that look like radians.
    """
    dips = [name for name in table.header if name.lower() in ("dip", "dip_deg")]
    if dips and "inclination_deg" not in table:
        # in mines and caves dip is the angle of the tool below the horizon; here it is that of the magnetic field
        raise table.error(
            f"column 'inclination_deg' is missing; if {dips[0]!r} is the angle of the tool from the horizontal, name "
            "it inclination_deg and state --inclination-from horizontal (positive downwards) or horizontal-up "
            "(positive upwards); the dip of the magnetic field at the stand is reference_dip_deg"
        )
    table.require(ANGLES)
    degrees = [table.number(name) for name in ANGLES]
    for name, values in zip(ANGLES, degrees, strict=True):
        limit = _LIMITS[name]
        bad = np.abs(values) > limit
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            raise table.error(f"{name} is {values[row]:g}; allowed {-limit:g} to {limit:g} deg", row)
    if look_like_radians(*degrees):
        reach = ", ".join(f"{n} {np.abs(v).max():.5g}" for n, v in zip(ANGLES, degrees, strict=True))
        raise table.error(f"the angles look like radians (largest: {reach}); convert them to degrees")
    azimuth, inclination, toolface = map(np.radians, degrees)
    return azimuth, inclination, toolface


def look_like_radians(azimuth: Array, inclination: Array, toolface: Array) -> bool:
    """Whether columns said to be degrees hold radians.

    True when nothing exceeds what radians can be (inclination pi, the others 2 pi), and read as radians the toolface or
    the azimuth visits at least three quadrants, as a plan does. Settings in whole quarters of a degree are believed to
    be degrees: a fine scan 0, 1, .. 6 deg near vertical is a real plan, and radians of a plan are never such numbers.

    Examples
    --------
    >>> zero, turn = np.zeros(4), np.arange(4) * 90.0
    >>> look_like_radians(zero, zero + 90.0, turn), look_like_radians(zero, zero + 1.5708, np.radians(turn))
    (False, True)
    """
    if len(toolface) < 4 or np.abs(inclination).max() > 3.15:
        return False
    if max(np.abs(azimuth).max(), np.abs(toolface).max()) > 6.2833:
        return False
    quarters = 4.0 * np.concatenate([azimuth, inclination, toolface])
    if (np.abs(quarters - np.round(quarters)) < 1e-9).all():
        return False
    return any(len(np.unique(np.floor(wrap_positive(a + 0.3) / (np.pi / 2.0)))) >= 3 for a in (azimuth, toolface))

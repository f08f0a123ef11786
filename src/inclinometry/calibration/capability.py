"""What a calibrated tool can promise: uncertainty of its angles over the whole range of attitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.orientation import fields
from inclinometry.core.arrays import Array, within
from inclinometry.core.errors import InputError
from inclinometry.sensors.sensitivity import angle_sensitivity
from inclinometry.sensors.tool import Tool

ANGLES = ("inclination", "azimuth", "toolface", "magnetic_toolface")


@dataclass(frozen=True, eq=False)
class Capability:
    """Standard uncertainties over inclination, azimuth and toolface, rad.

    inclination : (n,) rad
    components : name -> (n, azimuths, toolfaces, 4) variances by cause, rad^2; last axis as `ANGLES`
    """

    inclination: Array
    components: dict[str, Array]

    @property
    def variance(self) -> Array:
        """(n, azimuths, toolfaces, 4) total variance."""
        return np.asarray(sum(self.components.values()))

    def worst(self) -> Array:
        """(n, 4) standard uncertainty at the worst azimuth and toolface of each inclination."""
        return np.asarray(np.sqrt(self.variance.max(axis=(1, 2))))

    def rms(self) -> Array:
        """(n, 4) root mean square over azimuth and toolface."""
        return np.asarray(np.sqrt(self.variance.mean(axis=(1, 2))))


def capability(
    tool: Tool,
    inclination: ArrayLike,
    dip: float,
    *,
    azimuths: int = 12,
    toolfaces: int = 12,
    temperature: float = 20.0,
) -> Capability:
    """Uncertainty of one reading of a tool over attitudes, from its own calibration.

    Parameters
    ----------
    tool : Tool
        With accelerometer and magnetometer, three seen components each.
    inclination : (n,) array_like
        rad; 0 and pi are refused, where azimuth and toolface do not exist apart.
    dip : float
        Of the magnetic field where the tool will work, rad.
    azimuths, toolfaces : int
        Equal steps of each over which the worst and the mean are taken.

    Examples
    --------
    >>> from inclinometry.sensors.triad import Triad
    >>> kinds = ("accelerometer", "magnetometer")
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in kinds}, 1e-8 * np.eye(24))
    >>> capability(tool, np.radians([30.0, 90.0]), np.radians(70.0)).worst().shape
    (2, 4)
    """
    missing = {"accelerometer", "magnetometer"} - {k for k, t in tool.triads.items() if t.full}
    if missing:
        raise InputError(f"the {sorted(missing)[0]} with three seen components is needed for all three angles")
    if azimuths < 1 or toolfaces < 1:
        raise InputError(f"azimuths is {azimuths}, toolfaces {toolfaces}; at least 1 of each is needed")
    values = np.atleast_1d(within(inclination, "inclination", 1e-6, np.pi - 1e-6, "rad"))
    turn = 2.0 * np.pi * np.arange(azimuths) / azimuths
    roll = 2.0 * np.pi * np.arange(toolfaces) / toolfaces
    grid = np.meshgrid(values, turn, roll, indexing="ij")
    g, b = fields(grid[1], grid[0], grid[2], within(dip, "dip", -np.pi / 2, np.pi / 2, "rad"))
    heat = np.full(grid[0].shape, temperature)
    sensitivity = angle_sensitivity(tool, {"accelerometer": g, "magnetometer": b}, heat)
    parts = {n: np.diagonal(c, axis1=-2, axis2=-1) for n, c in sensitivity.components(tool).items()}
    return Capability(values, parts)

"""What the sensors of a tool move by after their calibration: a random walk, as its history says or as assumed."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.constants import STANDARD_GRAVITY, VECTORS
from inclinometry.errors import InputError
from inclinometry.history import DAYS_PER_YEAR, PARAMETERS
from inclinometry.sensors import Tool

ORDINARY_FIELD: Final = 50_000.0
"""nT, for a calibration that does not know the strength of the magnetic field at its stand."""


@dataclass(frozen=True)
class Stability:
    """Standard deviations of what the sensors have moved by a year after their calibration.

    accelerometer_offset : m/s^2, of each axis.
    accelerometer_scale : relative, of each axis.
    accelerometer_axis : rad, of each sensitive axis toward each of the two others.
    magnetometer_offset : nT; magnetometer_scale; magnetometer_axis.
    source : where they come from.
    """

    accelerometer_offset: float
    accelerometer_scale: float
    magnetometer_offset: float
    magnetometer_scale: float
    accelerometer_axis: float = 0.0
    magnetometer_axis: float = 0.0
    source: str = "stated"


ASSUMED: Final = Stability(
    0.002,
    0.00025,
    35.0,
    0.0008,
    source="half of the terms AB, AS, MB and MS of the ISCWSA's MWD error model, revision 5.1, a year",
)
"""What is assumed of a tool whose history nobody has looked at. The model's terms (0.004 m/s^2, 0.0005, 70 nT, 0.0016)
are of tools in service, calibrated some time ago; half of them in the first year reaches them in the fourth.
"""


def aged(tool: Tool, years: float, stability: Stability = ASSUMED) -> Tool:
    """The tool with what its parameters may have moved by since the calibration, beside the calibration's covariance.

    Parameters
    ----------
    tool : Tool
        As calibrated.
    years : float
        Since then, 0 to 50.
    stability : Stability

    Returns
    -------
    Tool
        Its `stability` is the covariance of that move; of gyros nothing is known, theirs is zero.

    Raises
    ------
    InputError
        A time out of range.

    Notes
    -----
    A random walk, as `inclinometry.calibration.drift` follows it, equation (1): variance grows with time. The field b
    that the sensors have come to see of the field a is (I + E) a + o; from U = N b + U0 follow dN = N E and dU0 = N o.

    Examples
    --------
    >>> from inclinometry.sensors import Triad
    >>> tool = aged(Tool("1", {"magnetometer": Triad("magnetometer", np.eye(3), np.zeros(3), field_strength=5e4)}), 4.0)
    >>> float(np.sqrt(tool.stability[3, 3]) * 5e4)  # offset of x, nT: twice that of a year
    70.0
    """
    since = float(within(years, "time since the calibration", 0.0, 50.0, "years"))
    found = np.zeros_like(tool.covariance)
    for kind, (offset, scale, axis), field in zip(
        VECTORS,
        (
            (stability.accelerometer_offset, stability.accelerometer_scale, stability.accelerometer_axis),
            (stability.magnetometer_offset, stability.magnetometer_scale, stability.magnetometer_axis),
        ),
        (STANDARD_GRAVITY, ORDINARY_FIELD),
        strict=True,
    ):
        if kind not in tool.triads:
            continue
        triad = tool.triads[kind]
        relative = np.full((3, 4), axis**2)
        relative[:, :3][np.eye(3, dtype=bool)] = scale**2
        relative[:, 3] = (offset / (triad.field_strength or field)) ** 2
        moved = np.kron(triad.tensor[0], np.eye(4))
        here = np.arange(tool.slices[kind].start, tool.slices[kind].start + 4 * triad.count)
        found[np.ix_(here, here)] = since * (moved * relative.ravel()) @ moved.T
    return replace(tool, stability=found)


def from_drift(drift: Array, source: str) -> Stability:
    """The stability of a type of tools by the drift of its fleet, axes of a kind pooled.

    Parameters
    ----------
    drift : (24, 24) ndarray
        Variance of the relative parameters a year, `inclinometry.calibration.drift.DriftModel.drift`, times that of the
        tool's own multiplier where it has one.
    source : str

    Examples
    --------
    >>> from inclinometry.simulate.fleet import drift_variance
    >>> found = from_drift(drift_variance(), "simulated fleet")
    >>> round(found.magnetometer_offset), round(found.accelerometer_offset, 5)
    (60, 0.00294)
    """
    variance = np.diagonal(drift)
    sd: dict[str, float] = {}
    for kind, prefix, field in zip(VECTORS, ("accel", "mag"), (STANDARD_GRAVITY, ORDINARY_FIELD), strict=True):
        places = {"offset": [f"{prefix}_{axis}_offset" for axis in "xyz"]}
        places["scale"] = [f"{prefix}_{axis}_{axis}" for axis in "xyz"]
        places["axis"] = [f"{prefix}_{axis}_{other}" for axis in "xyz" for other in "xyz" if axis != other]
        for name, rows in places.items():
            size = float(np.sqrt(np.mean([variance[PARAMETERS.index(row)] for row in rows])))
            sd[f"{kind}_{name}"] = size * (field if name == "offset" else 1.0)
    return Stability(**sd, source=source)


def years_between(calibrated: datetime.date, run: datetime.date) -> float:
    """Years from a calibration to a run; InputError for a run before it.

    Examples
    --------
    >>> round(years_between(datetime.date(2025, 1, 1), datetime.date(2026, 1, 1)), 3)
    0.999
    """
    days = (run - calibrated).days
    if days < 0:
        raise InputError(
            f"the site's date, {run}, is {-days} days before the calibration of {calibrated}; correct one of them, or "
            "state --age-days"
        )
    return days / DAYS_PER_YEAR

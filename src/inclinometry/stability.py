"""What the sensors of a tool move by after their calibration: a random walk, as its history says or as assumed."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.constants import KIND_PREFIX, STANDARD_GRAVITY
from inclinometry.errors import refused
from inclinometry.history import DAYS_PER_YEAR, PARAMETERS
from inclinometry.sensors import Tool

_FIELDS: Final = {"accelerometer": STANDARD_GRAVITY, "magnetometer": 50_000.0}
"""m/s^2 and nT, for a calibration that does not know the strength of the field at its stand."""


@dataclass(frozen=True)
class Stability:
    """Standard deviations of the change of sensors in a year after their calibration; `source` names their origin.

    accelerometer_offset, magnetometer_offset : m/s^2 and nT, of each axis. Scales are relative.
    accelerometer_axis, magnetometer_axis : rad, of each sensitive axis toward each of the two others.
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
"""What is assumed of a tool whose history no one has looked at. The model's terms (0.004 m/s^2, 0.0005, 70 nT, 0.0016)
are of tools in service, calibrated some time ago; half of them in the first year reaches them in the fourth.
"""


def add_stability(tool: Tool, years: float, stability: Stability = ASSUMED) -> Tool:
    """The tool with the covariance of its change since the calibration, 0 to 50 years, as `stability`; gyros have none.

    A random walk, `inclinometry.calibration.drift`, equation (1): variance grows with time. The sensors now see the
    field b = (I + E) a + o of the field a; from U = N b + U0 follow dN = N E and dU0 = N o.
    """
    since = float(within(years, "years", 0.0, 50.0, "years"))
    found = np.zeros_like(tool.covariance)
    for kind, field in _FIELDS.items():
        if kind not in tool.triads:
            continue
        offset, scale, axis = (getattr(stability, f"{kind}_{name}") for name in ("offset", "scale", "axis"))
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

    drift : (24, 24) variance a year of the relative parameters, times the tool's own multiplier where it has one.
    """
    variance = np.diagonal(drift)
    sd: dict[str, float] = {}
    for kind, field in _FIELDS.items():
        prefix = KIND_PREFIX[kind]
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
        raise refused("sensor-calibrated-later", {"run": str(run), "calibrated": str(calibrated), "days": -days})
    return days / DAYS_PER_YEAR

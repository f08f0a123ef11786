"""A simulated well, and the survey a tool would bring back from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite
from inclinometry.constants import EARTH_RATE, LATITUDE
from inclinometry.errors import out_of_range, refused, wrong_shape
from inclinometry.rotations import dcm, wrap_positive
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import field_direction
from inclinometry.simulate.sensing import Characteristic, Sensed, sense
from inclinometry.simulate.tool import Seed, Streams


@dataclass(frozen=True)
class WellProfile:
    """A well that goes down, builds, holds and, where `final` is given, drops; m, rad, rates positive in rad/m.

    start, hold, final : inclinations of the three straight parts, of hold_length and final_length.
    azimuth : from magnetic north; turn_rate : of azimuth below the kickoff.
    """

    kickoff: float = 300.0
    start: float = np.radians(0.5)
    build_rate: float = np.radians(3.0) / 30.0
    hold: float = np.radians(60.0)
    hold_length: float = 900.0
    drop_rate: float = np.radians(2.0) / 30.0
    final: float | None = None
    final_length: float = 300.0
    azimuth: float = np.radians(75.0)
    turn_rate: float = 0.0
    spacing: float = 30.0

    def __post_init__(self) -> None:
        for name in ("kickoff", "hold_length", "final_length", "spacing", "build_rate", "drop_rate"):
            value, above = getattr(self, name), name in ("spacing", "build_rate", "drop_rate")
            if not (value > 0.0 if above else value >= 0.0):
                raise out_of_range(name, value, "> 0" if above else ">= 0")


class WellPath(NamedTuple):
    """Stations of a well: measured depth, m; inclination, azimuth from magnetic north, toolface, rad; all (n,)."""

    md: Array
    inclination: Array
    azimuth: Array
    toolface: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class SurveySimulation(Sensed):
    """What the tool reported at n stations, by kind (n, m) in `units`, and the truth: rad, m, degC, m/s^2, nT.

    clean : signals without noise and converter. sd : of the means; empty without repeats.
    azimuth : from magnetic north. g, b, dip : true field at the well.
    """

    md: Array
    inclination: Array
    azimuth: Array
    toolface: Array
    magnetic_toolface: Array
    temperature: Array | None
    g: float | None
    b: float | None
    dip: float


def well_path(profile: WellProfile, seed: Seed) -> WellPath:
    """Stations of a well at equal spacing from the surface, the last one at its end; toolface is random."""
    build = abs(profile.hold - profile.start) / profile.build_rate
    lengths, inclinations = [profile.kickoff, build, profile.hold_length], [profile.start, profile.hold, profile.hold]
    if profile.final is not None:
        lengths += [abs(profile.final - profile.hold) / profile.drop_rate, profile.final_length]
        inclinations += [profile.final, profile.final]
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    md = np.arange(0.0, ends[-1], profile.spacing)
    md = np.append(md, ends[-1])
    inclination = np.interp(md, ends, [profile.start, *inclinations])
    azimuth = wrap_positive(profile.azimuth + profile.turn_rate * np.maximum(md - profile.kickoff, 0.0))
    return WellPath(md, inclination, azimuth, Streams(seed, "well")["toolface"].uniform(0.0, 2.0 * np.pi, md.size))


def simulate_survey(
    tool: Tool,
    md: ArrayLike,
    inclination: ArrayLike,
    azimuth: ArrayLike,
    toolface: ArrayLike,
    *,
    g: float | None = None,
    b: float | None = None,
    dip: float,
    latitude: float = LATITUDE,
    declination: float = 0.0,
    noise: Mapping[str, ArrayLike] | None = None,
    bits: int | None = None,
    repeats: int = 1,
    temperature: ArrayLike | None = None,
    characteristic: Mapping[str, Characteristic] | None = None,
    seed: Seed,
) -> SurveySimulation:
    """Raw readings of a tool that is still at the stations of a well; azimuth from magnetic north.

    Without g (m/s^2) and b (nT) the fields are those of the calibration. noise, bits, repeats, characteristic: as
    `simulate_bench`.
    """
    path = WellPath(*map(finite, (md, inclination, azimuth, toolface), WellPath._fields))
    if path.md.ndim != 1 or any(v.shape != path.md.shape for v in path):
        raise wrong_shape(", ".join(WellPath._fields), ", ".join(str(v.shape) for v in path), "(n,)")
    heat = None if temperature is None else np.broadcast_to(finite(temperature, "temperature"), path.md.shape)
    orientation = dcm(path.azimuth, path.inclination, path.toolface)
    local = {"accelerometer": g, "magnetometer": b, "gyro": EARTH_RATE}
    north = {kind: field_direction(kind, dip, latitude, declination) for kind in tool.triads}
    fields = {kind: orientation @ north[kind] * field_ratio(tool, kind, local[kind]) for kind in tool.triads}
    streams = Streams(seed, "survey")
    sensed = sense(
        tool, fields, streams, noise=noise, bits=bits, repeats=repeats, temperature=heat, characteristic=characteristic
    )
    return SurveySimulation(
        md=path.md,
        inclination=path.inclination,
        azimuth=wrap_positive(path.azimuth),
        toolface=wrap_positive(path.toolface),
        magnetic_toolface=wrap_positive(path.azimuth + path.toolface),
        temperature=heat,
        g=_strength(tool, "accelerometer", g),
        b=_strength(tool, "magnetometer", b),
        dip=dip,
        **vars(sensed),
    )


def field_ratio(tool: Tool, kind: str, local: float | None) -> float:
    """Local field strength over that of the calibration; 1 when the local one is not given."""
    strength = tool.triads[kind].field_strength
    if local is None or (kind == "gyro" and strength is None):
        return 1.0
    if strength is None:
        raise refused("simulate-strength", {"kind": kind})
    if not local > 0.0:
        raise out_of_range(f"{kind}.field", float(local), "> 0")
    return local / strength


def _strength(tool: Tool, kind: str, local: float | None) -> float | None:
    if local is not None or kind not in tool.triads:
        return local
    return tool.triads[kind].field_strength

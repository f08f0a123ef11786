"""Simulated bench calibrations: the readings, and beside them everything that was true."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen
from inclinometry.constants import DIALS, DIP, KINDS, LATITUDE
from inclinometry.errors import not_among, out_of_range, refused, wrong_shape
from inclinometry.rotations import dcm, rotation_exp, rotation_x, rotation_y, rotation_z
from inclinometry.sensors import Tool
from inclinometry.simulate.sensing import Characteristic, Sensed, sense, sense_batch
from inclinometry.simulate.tool import Seed, Streams, ToolBatch
from inclinometry.tabular import check_record


@dataclass(frozen=True)
class Misread:
    """A dial written down wrongly: the record says `size` rad more than what was set.

    station counts from 0; dial is "azimuth", "inclination" or "toolface".
    """

    station: int
    dial: str
    size: float

    def __post_init__(self) -> None:
        if self.dial not in DIALS:
            raise not_among("dial", self.dial, DIALS)


@dataclass(frozen=True)
class Bump:
    """A station (from 0) at which the tool was knocked by `size` rad about a random axis after the dials were read."""

    station: int
    size: float


@dataclass(frozen=True, eq=False)
class Rig:
    """Three frames on a base neither level nor pointed at north: C = R_z(T) R_x(inner) R_y(I) R_x(outer) R_z(A).

    Angles in rad. base_tilt is about the horizontal axis at azimuth tilt_axis (None: drawn for each calibration).
    north_offset is the azimuth of the rig's zero from magnetic north; setting_sd of each dial, common to all triads;
    the zeros are added to every dialled angle. declination places the Earth rate, with the latitude.
    """

    dip: float = DIP
    latitude: float = LATITUDE
    declination: float = 0.0
    base_tilt: float = 0.0
    tilt_axis: float | None = None
    north_offset: float = 0.0
    setting_sd: Array | float = 0.0
    inclination_zero: float = 0.0
    toolface_zero: float = 0.0
    outer: float = 0.0
    inner: float = 0.0
    faults: Sequence[Misread | Bump] = ()

    def __post_init__(self) -> None:
        numbers = ("dip", "latitude", "declination", "base_tilt", "north_offset", "inclination_zero", "toolface_zero")
        for name in (*numbers, "outer", "inner"):
            finite(getattr(self, name), name)
        if self.tilt_axis is not None:
            finite(self.tilt_axis, "tilt_axis")
        spread = finite(self.setting_sd, "setting_sd")
        if spread.shape not in ((), (3,)) or (spread < 0.0).any():
            raise out_of_range("setting_sd", str(spread.tolist()), ">= 0 | 3 x >= 0")
        object.__setattr__(self, "setting_sd", frozen(np.broadcast_to(spread, (3,))))
        object.__setattr__(self, "faults", tuple(self.faults))

    def attitude(self, tilt_axis: ArrayLike | None = None) -> Array:
        """Rotation (..., 3, 3) from magnetic north, east, down to rig axes; tilt_axis (...) replaces the rig's own."""
        axis = self.tilt_axis if tilt_axis is None else tilt_axis
        if axis is None:
            if self.base_tilt != 0.0:
                raise refused("input-missing", {"names": ("tilt_axis",)})
            axis = 0.0
        psi = np.asarray(axis, dtype=np.float64)
        tilt = rotation_z(-psi) @ rotation_x(self.base_tilt) @ rotation_z(psi)
        return np.asarray(tilt @ rotation_z(self.north_offset))

    def direction(self, kind: str, tilt_axis: ArrayLike | None = None) -> Array:
        """True unit field direction (..., 3) in rig axes for a kind of triad."""
        return np.asarray(self.attitude(tilt_axis) @ field_direction(kind, self.dip, self.latitude, self.declination))

    def orientation(self, settings: ArrayLike) -> Array:
        """Rotation (..., 3, 3) from rig to tool axes at true settings (..., 3) of azimuth, inclination, toolface."""
        a, i, t = np.moveaxis(finite(settings, "settings", (3,)), -1, 0)
        if self.inner == 0.0 and self.outer == 0.0:
            return dcm(a, i, t)
        upper = rotation_z(t) @ rotation_x(self.inner) @ rotation_y(i)
        return np.asarray(upper @ rotation_x(self.outer) @ rotation_z(a))

    def zeros(self) -> Array:
        """Constant errors (3,) of azimuth, inclination, toolface; the azimuth's is `north_offset`, not here."""
        return np.array([0.0, self.inclination_zero, self.toolface_zero])


def field_direction(kind: str, dip: float, latitude: float, declination: float) -> Array:
    """Unit vector (3,) along the field in magnetic north, east, down.

    The Earth rate is (cos lat, 0, -sin lat) from true north, which lies `declination` west of magnetic north.
    """
    if kind == "accelerometer":
        return np.array([0.0, 0.0, 1.0])
    if kind == "magnetometer":
        return np.array([np.cos(dip), 0.0, np.sin(dip)])
    level = np.cos(latitude)
    return np.array([level * np.cos(declination), -level * np.sin(declination), -np.sin(latitude)])


@dataclass(frozen=True, eq=False, kw_only=True)
class BenchSimulation(Sensed):
    """One simulated calibration of K stations: readings by kind (K, m), in `units`, and the truth; angles in rad.

    azimuth and so on : read from the dials, misreadings included; setting_errors are true minus intended.
    reference : what a bench knows of its fields: "g" m/s^2, "b" nT, "dip" rad.
    orientation : (K, 3, 3) true rotation from rig to tool axes, bumps included.
    clean : signals without noise and converter. sd, count : of means; empty and None without repeats.
    """

    azimuth: Array
    inclination: Array
    toolface: Array
    count: Array | None
    temperature: Array | None
    reference: Mapping[str, float]
    tool: Tool
    rig: Rig
    setting_errors: Array
    orientation: Array
    field_directions: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class BenchBatch:
    """Many simulated calibrations at once; fields as in `BenchSimulation` with a leading axis of draws.

    signals, clean : kind -> (draws, K, m).
    setting_errors : (draws, K, 3).
    field_directions : kind -> (draws, 3).
    """

    signals: Mapping[str, Array]
    clean: Mapping[str, Array]
    setting_errors: Array
    field_directions: Mapping[str, Array]


def simulate_bench(
    tool: Tool,
    rig: Rig,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    noise: Mapping[str, ArrayLike] | None = None,
    bits: int | None = None,
    repeats: int = 1,
    temperature: ArrayLike | None = None,
    characteristic: Mapping[str, Characteristic] | None = None,
    seed: Seed,
) -> BenchSimulation:
    """Readings of a true tool on a true rig at the stations of a plan.

    Parameters
    ----------
    tool : Tool
    rig : Rig
    azimuth, inclination, toolface : (K,) array_like
        Intended settings, rad.
    noise : mapping of kind to float or (m,) array_like, optional
        White noise of one reading, in the unit of the signals; a kind not named has none. The tool's own when absent.
    bits : int, optional
        Quantise and clip as a converter of so many bits does; the tool's signals must be counts of such a converter or
        m/s^2, nT, rad/s. Not quantised when absent.
    repeats : int
        Readings averaged at each station, without moving the rig between them.
    temperature : float or (K,) array_like, optional
        degC. Default: the triads' reference temperature.
    characteristic : mapping of kind to Characteristic, optional
        What bends the sensors' characteristic.
    seed : int, SeedSequence or Generator
        The rig's errors depend on it alone, not on the noise, the bits or the tool.

    Raises
    ------
    InputError
        Settings of different lengths, a faulty station that is not there, impossible bits or repeats.

    Examples
    --------
    >>> from inclinometry.simulate.tool import random_tool
    >>> turns = np.radians([0, 120, 240])
    >>> run = simulate_bench(random_tool(1), Rig(), turns, np.full(3, 1.0), turns, bits=12, seed=1)
    >>> run.signals["accelerometer"].shape
    (3, 3)
    """
    check_record(tool, Tool, "simulate_bench")
    record = _settings(azimuth, inclination, toolface)
    size = len(record)
    heat = None if temperature is None else np.broadcast_to(finite(temperature, "temperature"), (size,))
    streams = Streams(seed, "bench")
    errors, tilt_axis = _rig_draw(rig, streams, 1, size)
    orientation = _bumped(rig, streams, rig.orientation(record + errors[0]))
    directions = {kind: rig.direction(kind, tilt_axis[0]) for kind in tool.triads}
    fields = {kind: orientation @ direction for kind, direction in directions.items()}
    sensed = sense(
        tool, fields, streams, noise=noise, bits=bits, repeats=repeats, temperature=heat, characteristic=characteristic
    )
    # the record (K, 3) with the misreadings in it
    written = record.copy()
    for fault in rig.faults:
        if isinstance(fault, Misread):
            _check_station(fault, len(record))
            written[fault.station, DIALS.index(fault.dial)] += fault.size
    return BenchSimulation(
        azimuth=written[:, 0],
        inclination=written[:, 1],
        toolface=written[:, 2],
        count=None if repeats == 1 else np.full(size, float(repeats)),
        temperature=heat,
        reference=bench_reference(tool, rig.dip),
        tool=tool,
        rig=replace(rig, tilt_axis=float(tilt_axis[0])),
        setting_errors=errors[0],
        orientation=orientation,
        field_directions=directions,
        **vars(sensed),
    )


def simulate_off_stand(
    tool: Tool,
    rig: Rig,
    attitudes: ArrayLike,
    scatter: float,
    *,
    noise: Mapping[str, ArrayLike] | None = None,
    bits: int | None = None,
    repeats: int = 1,
    temperature: ArrayLike | None = None,
    characteristic: Mapping[str, Characteristic] | None = None,
    seed: Seed,
) -> Sensed:
    """Readings of a true tool held by hand away from the stand, in the same field.

    attitudes : (K, 3) azimuth, inclination, toolface, rad, kept to some 5 degrees. scatter : nT of each component of
    the magnetic field from place to place. The others as in `simulate_bench`.
    """
    streams = Streams(seed, "off stand")
    held = finite(attitudes, "attitudes", (None, 3))
    turned = dcm(*(held + np.radians(5.0) * streams["hand"].normal(size=held.shape)).T)
    fields = {kind: turned @ field_direction(kind, rig.dip, rig.latitude, rig.declination) for kind in tool.triads}
    if "magnetometer" in fields:
        strength = tool.triads["magnetometer"].field_strength
        if strength is None:
            raise refused("simulate-strength", {"kind": "magnetometer"})
        fields["magnetometer"] = fields["magnetometer"] + scatter / strength * streams["place"].normal(size=held.shape)
    heat = None if temperature is None else np.broadcast_to(finite(temperature, "temperature"), (len(held),))
    more: dict[str, Any] = {"noise": noise, "bits": bits, "repeats": repeats, "characteristic": characteristic}
    return sense(tool, fields, streams, temperature=heat, **more)


def simulate_benches(
    tools: ToolBatch,
    rig: Rig,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    draws: int | None = None,
    noise: Mapping[str, float] | None = None,
    bits: int | None = None,
    seed: Seed,
) -> BenchBatch:
    """Many calibrations at once for Monte-Carlo: each draw with its own tool, rig errors, tilt axis and noise.

    Parameters
    ----------
    tools : ToolBatch
        One tool a draw, or a single one for all of them.
    rig : Rig
        Without faults.
    azimuth, inclination, toolface : (K,) array_like
        Intended settings, rad.
    draws : int, optional
        Default: as many as there are tools.
    noise, bits, seed
        As in `simulate_bench`.

    Raises
    ------
    InputError
        As `simulate_bench`; faults in the rig; a number of tools that is neither 1 nor `draws`.

    Examples
    --------
    >>> from inclinometry.simulate.tool import random_tools
    >>> turns = np.radians([0, 120, 240])
    >>> run = simulate_benches(random_tools(1, 100), Rig(), turns, np.full(3, 1.0), turns, bits=12, seed=1)
    >>> run.signals["magnetometer"].shape
    (100, 3, 3)
    """
    check_record(tools, ToolBatch, "simulate_benches")
    record = _settings(azimuth, inclination, toolface)
    number = len(tools) if draws is None else draws
    if len(tools) not in (1, number):
        raise wrong_shape("tools", (len(tools),), f"(1,) | ({number},)")
    if rig.faults:
        raise refused("input-not-with", {"name": "rig.faults", "other": "simulate_benches"})
    streams = Streams(seed, "bench")
    errors, tilt_axis = _rig_draw(rig, streams, number, len(record))
    orientation = rig.orientation(record + errors)
    directions = {kind: rig.direction(kind, tilt_axis) for kind in tools.tensor}
    fields = {kind: (orientation @ direction[:, None, :, None])[..., 0] for kind, direction in directions.items()}
    signals, clean = sense_batch(tools, fields, streams, noise=noise, bits=bits)
    return BenchBatch(signals, clean, errors, directions)


def bench_reference(tool: Tool, dip: float) -> dict[str, float]:
    """What a bench knows of its fields: "g", "b" and "dip", for the triads the tool has."""
    known: dict[str, float] = {}
    for kind, name in zip(KINDS[:2], ("g", "b"), strict=True):
        strength = tool.triads[kind].field_strength if kind in tool.triads else None
        if strength is not None:
            known[name] = strength
    if "magnetometer" in tool.triads:
        known["dip"] = dip
    return known


def _settings(azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> Array:
    """The intended settings (K, 3)."""
    angles = [finite(v, name) for v, name in zip((azimuth, inclination, toolface), DIALS, strict=True)]
    if any(v.shape != angles[0].shape or v.ndim != 1 for v in angles):
        raise wrong_shape(", ".join(DIALS), ", ".join(str(v.shape) for v in angles), "(K,)")
    return np.stack(angles, axis=-1)


def _rig_draw(rig: Rig, streams: Streams, draws: int, size: int) -> tuple[Array, Array]:
    """Setting errors (draws, K, 3), zeros included, and tilt axes (draws,)."""
    white = streams["rig.settings"].standard_normal((draws, size, 3))
    errors = white * rig.setting_sd + rig.zeros()
    if rig.tilt_axis is not None:
        return errors, np.full(draws, rig.tilt_axis)
    return errors, streams["rig.tilt"].uniform(0.0, 2.0 * np.pi, draws)


def _check_station(fault: Misread | Bump, size: int) -> None:
    if not 0 <= fault.station < size:
        raise out_of_range("station", fault.station, f"0 .. {size - 1}")


def _bumped(rig: Rig, streams: Streams, orientation: Array) -> Array:
    """Orientations (K, 3, 3) with each bump's turn about a random axis applied."""
    turned = orientation.copy()
    for number, fault in enumerate(f for f in rig.faults if isinstance(f, Bump)):
        _check_station(fault, len(orientation))
        axis = streams[f"rig.bump.{number}"].standard_normal(3)
        turned[fault.station] = rotation_exp(fault.size * axis / np.linalg.norm(axis)) @ turned[fault.station]
    return turned

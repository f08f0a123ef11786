"""Simulated bench calibrations: the readings, and beside them everything that was true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.attitude.rotations import rotation_exp
from inclinometry.core.arrays import Array, finite
from inclinometry.core.constants import KINDS
from inclinometry.core.errors import InputError
from inclinometry.sensors.tool import Tool
from inclinometry.simulate.rig import DIALS, Bump, Misread, Rig
from inclinometry.simulate.sensing import Characteristic, sense, sense_batch
from inclinometry.simulate.streams import Seed, Streams
from inclinometry.simulate.tool import ToolBatch


@dataclass(frozen=True, eq=False)
class BenchSimulation:
    """One simulated calibration of K stations; angles in rad.

    signals : kind -> (K, m), what the tool reported (means, where readings were repeated), in `units`.
    azimuth, inclination, toolface : (K,) the record of the dials, misreadings included.
    sd : kind -> (K, m) standard deviation of the means; empty without repeats.
    count : (K,) readings per station; None without repeats.
    temperature : (K,) degC, or None.
    units : kind -> unit of the signals.
    reference : what a bench knows of its fields: "g" m/s^2, "b" nT, "dip" rad, where the tool has the triad.
    tool, rig : the truth; the rig's tilt axis as it was drawn.
    setting_errors : (K, 3) true minus intended azimuth, inclination, toolface (zeros and random parts).
    orientation : (K, 3, 3) true rotation from rig to tool axes, bumps included.
    field_directions : kind -> (3,) true unit field in rig axes.
    clean : kind -> (K, m) signals without noise and converter.
    saturated : kind -> (K, m) bool, readings that left the converter's range.
    """

    signals: Mapping[str, Array]
    azimuth: Array
    inclination: Array
    toolface: Array
    sd: Mapping[str, Array]
    count: Array | None
    temperature: Array | None
    units: Mapping[str, str]
    reference: Mapping[str, float]
    tool: Tool
    rig: Rig
    setting_errors: Array
    orientation: Array
    field_directions: Mapping[str, Array]
    clean: Mapping[str, Array]
    saturated: Mapping[str, NDArray[np.bool_]]


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
        degC; the triads' reference temperature when not given.
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
    record = _settings(azimuth, inclination, toolface)
    size = len(record)
    degrees = None if temperature is None else np.broadcast_to(finite(temperature, "temperature"), (size,))
    streams = Streams(seed, "bench")
    errors, tilt_axis = _rig_draw(rig, streams, 1, size)
    orientation = _bumped(rig, streams, rig.orientation(record + errors[0]))
    directions = {kind: rig.direction(kind, tilt_axis[0]) for kind in tool.triads}
    fields = {kind: orientation @ direction for kind, direction in directions.items()}
    sensed = sense(
        tool,
        fields,
        streams,
        noise=noise,
        bits=bits,
        repeats=repeats,
        temperature=degrees,
        characteristic=characteristic,
    )
    written = _written(rig, record)
    return BenchSimulation(
        azimuth=written[:, 0],
        inclination=written[:, 1],
        toolface=written[:, 2],
        count=None if repeats == 1 else np.full(size, float(repeats)),
        temperature=degrees,
        units={kind: triad.unit for kind, triad in tool.triads.items()},
        reference=bench_reference(tool, rig.dip),
        tool=tool,
        rig=replace(rig, tilt_axis=float(tilt_axis[0])),
        setting_errors=errors[0],
        orientation=orientation,
        field_directions=directions,
        **sensed._asdict(),
    )


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
        As many as there are tools when not given.
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
    record = _settings(azimuth, inclination, toolface)
    number = len(tools) if draws is None else draws
    if len(tools) not in (1, number):
        raise InputError(f"{len(tools)} tools for {number} draws; give one tool, or one for each draw")
    if rig.faults:
        raise InputError("gross faults are simulated one calibration at a time; use simulate_bench")
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
        raise InputError(f"settings have shapes {[v.shape for v in angles]}; expected (K,) for all three")
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
        raise InputError(f"{fault} is at a station that is not there; stations are 0 to {size - 1}")


def _bumped(rig: Rig, streams: Streams, orientation: Array) -> Array:
    """Orientations (K, 3, 3) with each bump's turn about a random axis applied."""
    turned = orientation.copy()
    for number, fault in enumerate(f for f in rig.faults if isinstance(f, Bump)):
        _check_station(fault, len(orientation))
        axis = streams[f"rig.bump.{number}"].standard_normal(3)
        turned[fault.station] = rotation_exp(fault.size * axis / np.linalg.norm(axis)) @ turned[fault.station]
    return turned


def _written(rig: Rig, record: Array) -> Array:
    """The record (K, 3) with the misreadings in it."""
    written = record.copy()
    for fault in rig.faults:
        if isinstance(fault, Misread):
            _check_station(fault, len(record))
            written[fault.station, DIALS.index(fault.dial)] += fault.size
    return written

"""From true fields in tool axes to what the sensors report: noise, converter, repeats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.core.arrays import Array, finite
from inclinometry.core.errors import InputError
from inclinometry.sensors.tool import Tool
from inclinometry.simulate.characteristic import Characteristic
from inclinometry.simulate.converter import digitise, signal_step
from inclinometry.simulate.streams import Streams
from inclinometry.simulate.tool import ToolBatch


class Sensed(NamedTuple):
    """Signals of each kind of triad, (n, m)."""

    signals: dict[str, Array]
    sd: dict[str, Array]  # of the mean of repeated readings; empty without repeats
    clean: dict[str, Array]  # of straight sensors without noise and converter
    saturated: dict[str, NDArray[np.bool_]]


def sense(
    tool: Tool,
    fields: Mapping[str, Array],
    streams: Streams,
    *,
    noise: Mapping[str, ArrayLike] | None = None,
    bits: int | None = None,
    repeats: int = 1,
    temperature: Array | None = None,
    drift: Mapping[str, Array] | None = None,
    characteristic: Mapping[str, Characteristic] | None = None,
) -> Sensed:
    """What a tool reports for fields (n, 3) in tool axes, in units of each triad's field strength.

    Parameters
    ----------
    noise : mapping of kind to float or (m,) array_like, optional
        White noise of one reading, signal units; a kind not named has none. The tool's own when absent.
    bits : int, optional
        Quantise and clip as a converter of so many bits does.
    repeats : int
        Readings averaged.
    temperature : (n,) ndarray, optional
        degC; each triad's reference temperature when absent.
    drift : mapping of kind to (n, m) ndarray, optional
        Added to the clean signals, signal units.
    characteristic : mapping of kind to Characteristic, optional
        What bends the sensors' characteristic; the clean signals stay those of straight ones.

    Raises
    ------
    InputError
        Unknown unit for a converter, bits or repeats out of range, negative noise.

    Examples
    --------
    >>> from inclinometry.simulate.tool import random_tool
    >>> sense(random_tool(1), {"accelerometer": np.eye(3)}, Streams(1, "bench")).signals["accelerometer"].shape
    (3, 3)
    """
    if repeats < 1:
        raise InputError(f"repeats is {repeats}; at least 1 reading is needed")
    out = Sensed({}, {}, {}, {})
    for kind, field in fields.items():
        triad = tool.triads[kind]
        degrees = triad.reference_temperature if temperature is None else temperature
        clean = triad.signals(field, np.broadcast_to(degrees, field.shape[:-1]))
        if drift is not None and kind in drift:
            clean = clean + drift[kind]
        spread = finite((tool.noise if noise is None else noise).get(kind, 0.0), f"{kind} noise")
        step = None if bits is None else signal_step(kind, triad.unit, bits)
        out.clean[kind] = clean
        if characteristic is not None and kind in characteristic:
            clean = characteristic[kind].bent(clean, triad)
        out.signals[kind], sd, out.saturated[kind] = read_sensors(
            clean, spread, step, bits, repeats, streams[f"{kind}.noise"]
        )
        if repeats > 1:
            out.sd[kind] = sd
    return out


def sense_batch(
    tools: ToolBatch,
    fields: Mapping[str, Array],
    streams: Streams,
    *,
    noise: Mapping[str, float] | None = None,
    bits: int | None = None,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Signals and clean signals (draws, n, m) of each kind for fields (draws, n, 3): one tool a draw, or one for all.

    Examples
    --------
    >>> from inclinometry.simulate.tool import random_tools
    >>> fields = {"accelerometer": np.tile(np.eye(3), (5, 1, 1))}
    >>> sense_batch(random_tools(1, 5), fields, Streams(1, "bench"))[0]["accelerometer"].shape
    (5, 3, 3)
    """
    signals, clean = {}, {}
    for kind, field in fields.items():
        clean[kind] = field @ tools.tensor[kind].swapaxes(-1, -2) + tools.offset[kind][:, None, :]
        spread = finite((tools.noise if noise is None else noise).get(kind, 0.0), f"{kind} noise")
        step = None if bits is None else signal_step(kind, tools.units[kind], bits)
        signals[kind], _, _ = read_sensors(clean[kind], spread, step, bits, 1, streams[f"{kind}.noise"])
    return signals, clean


def read_sensors(
    clean: Array, noise: Array, step: float | None, bits: int | None, repeats: int, random: np.random.Generator
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Mean of `repeats` readings of clean signals (..., m), its standard deviation, and where a reading saturated.

    A converter that says the same every time hides an error of up to half a step: the standard deviation is never
    below that of the step, step / sqrt 12, unless the readings scatter over more than half a step themselves.
    """
    if (noise < 0.0).any():
        raise InputError(f"noise is {noise}; a standard deviation cannot be negative")
    readings = clean + noise * random.standard_normal((repeats, *clean.shape))
    over = np.zeros(readings.shape, dtype=np.bool_)
    if step is not None and bits is not None:
        readings, over = digitise(readings, step, bits)
    saturated = np.logical_or.reduce(over, axis=0)
    if repeats == 1:
        return readings[0], np.zeros(clean.shape), saturated
    scatter = readings.std(axis=0, ddof=1)
    floor = 0.0 if step is None else step
    sd = np.where(scatter < floor / 2.0, floor / np.sqrt(12.0), scatter / np.sqrt(repeats))
    return readings.mean(axis=0), sd, saturated

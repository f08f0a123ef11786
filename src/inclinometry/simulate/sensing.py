"""From true fields in tool axes to what the sensors report: noise, converter, repeats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, finite, within
from inclinometry.errors import out_of_range, refused
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.tool import FULL_SCALE, Streams, ToolBatch, digitise, signal_step

# The static characteristic of a real sensor: noise, a square law, hysteresis; and magnetometers by name.


@dataclass(frozen=True)
class Characteristic:
    """Errors of a sensor besides U = n a + U0, as shares of full scale, at most a tenth; noise in m/s^2, nT, rad/s.

    square : the signal is too large by this share at full scale, by a quarter of it at half scale.
    hysteresis : the signal lags behind the field by up to this (Prandtl's play operator), so it depends on earlier
        readings.
    """

    noise: float | None = None
    square: float = 0.0
    hysteresis: float = 0.0

    def __post_init__(self) -> None:
        if self.noise is not None and not 0.0 <= self.noise < np.inf:
            raise out_of_range("noise", float(self.noise), ">= 0")
        within(self.square, "square", -0.1, 0.1)
        within(self.hysteresis, "hysteresis", 0.0, 0.1)

    def apply_nonlinearity(self, clean: Array, triad: Triad) -> Array:
        """Signals (n, m), in the order of reading, of sensors that would give `clean` were they straight."""
        full = signal_of(triad, FULL_SCALE[triad.kind])
        value = clean - triad.offset[0]
        found = value + self.square * value**2 / full
        if self.hysteresis:
            width, last = self.hysteresis * full, value[0]
            for row in range(len(value)):
                last = np.clip(last, value[row] - width, value[row] + width)
                found[row] += last - value[row]
        return np.asarray(found + triad.offset[0])


def signal_of(triad: Triad, field: float) -> Array:
    """The signal (m,) that a field of m/s^2, nT or rad/s along its axis makes of each sensor, the offset left out."""
    if triad.field_strength is None:
        raise refused("simulate-strength", {"kind": triad.kind})
    return np.asarray(np.linalg.norm(triad.tensor[0], axis=1) * (field / triad.field_strength))


MAGNETOMETERS: Final[Mapping[str, Characteristic]] = MappingProxyType(
    {
        "magnetoresistive": Characteristic(noise=20.0),
        # noise, square law and hysteresis of half a per cent of full scale each: what is left after good compensation
        "fluxgate": Characteristic(noise=325.0, square=0.005, hysteresis=0.005),
    }
)
"""Magnetometers as in Rogatykh 2018: azimuth to 0.2-0.5 deg with magnetoresistive sensors, 1.5-2.0 with fluxgates."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensed:
    """Signals of each kind of triad, (n, m), in `units`.

    sd : of the mean of repeated readings; empty without repeats. clean : of straight sensors without noise and
        converter.
    """

    signals: Mapping[str, Array]
    sd: Mapping[str, Array]
    clean: Mapping[str, Array]
    saturated: Mapping[str, NDArray[np.bool_]]
    units: Mapping[str, str]


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

    noise : of one reading, signal units; the tool's own by default, else none for a kind not named.
    bits : quantise and clip. drift : (n, m) added to the clean signals. `characteristic` does not change these.
    """
    if repeats < 1:
        raise out_of_range("repeats", repeats, ">= 1")
    signals, sds, straight, saturated = {}, {}, {}, {}
    for kind, field in fields.items():
        triad = tool.triads[kind]
        degrees = triad.reference_temperature if temperature is None else temperature
        clean = triad.signals(field, np.broadcast_to(degrees, field.shape[:-1]))
        if drift is not None and kind in drift:
            clean = clean + drift[kind]
        spread = finite((tool.noise if noise is None else noise).get(kind, 0.0), f"{kind}.noise")
        step = None if bits is None else signal_step(kind, triad.unit, bits)
        straight[kind] = clean
        if characteristic is not None and kind in characteristic:
            clean = characteristic[kind].apply_nonlinearity(clean, triad)
        random = streams[f"{kind}.noise"]
        signals[kind], sd, saturated[kind] = read_sensors(clean, spread, step, bits, repeats, random)
        if repeats > 1:
            sds[kind] = sd
    units = {kind: triad.unit for kind, triad in tool.triads.items()}
    return Sensed(signals=signals, sd=sds, clean=straight, saturated=saturated, units=units)


def sense_batch(
    tools: ToolBatch,
    fields: Mapping[str, Array],
    streams: Streams,
    *,
    noise: Mapping[str, float] | None = None,
    bits: int | None = None,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Signals and clean signals (draws, n, m) by kind for fields (draws, n, 3): one tool a draw, or one for all."""
    signals, clean = {}, {}
    for kind, field in fields.items():
        clean[kind] = field @ tools.tensor[kind].swapaxes(-1, -2) + tools.offset[kind][:, None, :]
        spread = finite((tools.noise if noise is None else noise).get(kind, 0.0), f"{kind}.noise")
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
        raise out_of_range("noise", float(noise.min()), ">= 0")
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

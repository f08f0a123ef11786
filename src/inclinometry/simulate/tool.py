"""True tools to be found again: the wild ones of the Monte-Carlo scenarios and realistic ones."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, TypeAlias, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, within
from inclinometry.constants import DEG_PER_HOUR, EARTH_RATE, KINDS, STANDARD_GRAVITY
from inclinometry.errors import not_among, out_of_range, refused, wrong_kind
from inclinometry.rotations import dcm_from_quaternion
from inclinometry.sensors import Tool, Triad

Seed: TypeAlias = int | np.random.SeedSequence | np.random.Generator


class Streams:
    """Named generators of one seed: one more stream, or draws from it, do not change the others.

    `purpose` separates the streams of different simulations with the same seed. A Generator as seed is drawn from once.
    """

    def __init__(self, seed: Seed, purpose: str) -> None:
        self._purpose = purpose
        if isinstance(seed, np.random.SeedSequence):
            self._root = seed
        elif isinstance(seed, np.random.Generator):
            self._root = np.random.SeedSequence(seed.integers(0, 2**63, size=2).tolist())
        else:
            if isinstance(seed, bool) or int(seed) != seed:
                raise wrong_kind("seed", repr(seed), "whole number")
            if seed < 0:
                raise out_of_range("seed", int(seed), ">= 0")
            self._root = np.random.SeedSequence(int(seed))

    def __getitem__(self, name: str) -> np.random.Generator:
        # the name's checksum is a spawn key: streams do not depend on the order in which they are asked for
        key = (*self._root.spawn_key, zlib.crc32(f"{self._purpose}.{name}".encode()))
        return np.random.default_rng(np.random.SeedSequence(self._root.entropy, spawn_key=key))


def white_rate(generator: np.random.Generator, shape: tuple[int, ...], arw: float, interval: float) -> Array:
    """White rate noise averaged over `interval` s, rad/s; `arw` is the angle random walk, rad/sqrt(s)."""
    return np.asarray(generator.standard_normal(shape) * (arw / np.sqrt(interval)))


def flicker_rate(generator: np.random.Generator, shape: tuple[int, ...], instability: float) -> Array:
    """Flicker (1/f) noise along the last axis, of density B^2/(2 pi f), B the bias instability (Allan: 0.664 B, flat).

    White noise through the fractional filter (1 - z^-1)^-1/2, with as much history before the first sample as there are
    samples: slower changes are bias. Kasdin, "Discrete simulation of colored noise", Proc. IEEE 83, 1995, equation
    (116); IEEE Std 952-1997, annex C. sqrt(2 ln 2/pi) = 0.664.
    """
    length = shape[-1]
    size = 2 * length
    k = np.arange(1.0, size)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    padded = 1 << (2 * size - 1).bit_length()
    white = generator.standard_normal((*shape[:-1], size))
    shaped = np.fft.irfft(np.fft.rfft(white, padded) * np.fft.rfft(response, padded), padded)
    return np.asarray(instability * shaped[..., length:size])


# The analogue-to-digital converter: counts, steps, saturation.

FULL_SCALE: Final[Mapping[str, float]] = MappingProxyType(
    {"accelerometer": 1.25 * STANDARD_GRAVITY, "magnetometer": 65000.0, "gyro": 3e-4}
)
"""Half the range of the converter, m/s^2, nT, rad/s: the converter covers plus and minus this."""

PHYSICAL_UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {"accelerometer": "m/s^2", "magnetometer": "nT", "gyro": "rad/s"}
)
"""Unit of the signals of a tool without a converter."""


def converter_step(kind: str, bits: int) -> float:
    """Physical size of one count of a converter of 2 to 32 bits over +-FULL_SCALE, m/s^2, nT or rad/s."""
    _check(bits)
    return 2.0 * FULL_SCALE[kind] / 2.0**bits


def has_step(kind: str, unit: str) -> bool:
    """Whether the size of a count is known for signals in this unit.

    Examples
    --------
    >>> has_step("magnetometer", "nT"), has_step("magnetometer", "V")
    (True, False)
    """
    return unit in ("counts", PHYSICAL_UNITS[kind])


def signal_step(kind: str, unit: str, bits: int) -> float:
    """Size of one count in the unit the signals have.

    Raises
    ------
    InputError
        A unit other than counts and the kind's physical unit: nothing says how large its counts are.
    """
    _check(bits)
    if unit == "counts":
        return 1.0
    if unit == PHYSICAL_UNITS[kind]:
        return converter_step(kind, bits)
    raise refused("simulate-unit", {"kind": kind, "unit": unit, "allowed": ("counts", PHYSICAL_UNITS[kind])})


def digitise(signals: ArrayLike, step: float, bits: int) -> tuple[Array, NDArray[np.bool_]]:
    """Round to multiples of `step`, clip at the ends of 2^bits of them; the second result marks clipped readings."""
    _check(bits)
    codes = np.rint(np.asarray(signals, dtype=np.float64) / step)
    low, high = -(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1.0
    return np.clip(codes, low, high) * step, (codes < low) | (codes > high)


def _check(bits: int) -> None:
    if not 2 <= bits <= 32 or int(bits) != bits:
        raise out_of_range("bits", bits, "2, 3 .. 32")


TRIADS: Final[Mapping[str, int]] = MappingProxyType({"accelerometer": 3, "magnetometer": 3})
"""Sensors of each kind in the usual tool; a gyro triad is added by naming it."""
NOISE: Final[Mapping[str, float]] = MappingProxyType(
    {"accelerometer": 0.3e-3 * STANDARD_GRAVITY, "magnetometer": 20.0, "gyro": 0.05 * DEG_PER_HOUR}
)
"""White noise of one reading, m/s^2, nT, rad/s."""

_Draw = Callable[[Streams, str, int, int, float], tuple[Array, Array, Array]]


class Design(TypedDict, total=False):
    """How tools are drawn; all optional.

    sensors : number of sensors of each triad.
    bits : signals in counts of a converter over +-1.25 g, +-65 uT, +-62 deg/h; None: in m/s^2, nT, rad/s.
    g, b : field strengths at the calibration, m/s^2 and nT.
    noise : white noise of one reading, m/s^2, nT, rad/s; a kind not named has none. It never changes the tools drawn.
    """

    sensors: Mapping[str, int]
    bits: int | None
    g: float
    b: float
    noise: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class ToolBatch:
    """True tools of one design, one a draw: by kind tensor (draws, m, 3), offset (draws, m), noise, all in `units`.

    field_strength : of the field the tensors are for, m/s^2, nT, rad/s.
    """

    tensor: Mapping[str, Array]
    offset: Mapping[str, Array]
    noise: Mapping[str, float]
    units: Mapping[str, str]
    field_strength: Mapping[str, float]

    def __len__(self) -> int:
        return len(next(iter(self.tensor.values())))

    def tool(self, draw: int, name: str = "simulated") -> Tool:
        """The tool of one draw."""
        triads = {
            kind: Triad(kind, tensor[draw], self.offset[kind][draw], self.units[kind], self.field_strength[kind])
            for kind, tensor in self.tensor.items()
        }
        return Tool(name, triads, noise={kind: np.array(sd) for kind, sd in self.noise.items()})


def nominal_axes(count: int) -> Array:
    """Directions (m, 3) in tool axes of a usual layout of `count` sensors: x; x, y; x, y, z; a cone for more.

    The cone about z has half angle arccos(1/sqrt 3), which sees all directions equally well: sum of c c^T = m/3 I.
    """
    if count < 1:
        raise out_of_range("count", count, ">= 1")
    if count <= 3:
        return np.eye(3)[:count]
    turn = 2.0 * np.pi * np.arange(count) / count
    plane = np.sqrt(2.0 / 3.0)
    return np.stack([plane * np.cos(turn), plane * np.sin(turn), np.full(count, np.sqrt(1.0 / 3.0))], axis=-1)


def random_tools(seed: Seed, draws: int, **design: Unpack[Design]) -> ToolBatch:
    """Tools about which nothing may be assumed, for Monte-Carlo.

    Conversion factors U(0.95, 1.05), offsets U(-0.05, 0.05) of the full field, sensor axes a random rotation of the
    nominal ones plus N(0, 0.1) per component, made unit vectors again (about 8 degrees from orthogonal).
    """
    return _tools(_draw_extreme_tools, seed, draws, **design)


def realistic_tools(seed: Seed, draws: int, **design: Unpack[Design]) -> ToolBatch:
    """Tools as a workshop builds them; arguments as `random_tools`.

    Conversion factors U(0.95, 1.05), each axis 1 to 2 degrees from its nominal direction, offsets N(0, 20 mg), N(0, 400
    nT), N(0, 1 deg/h).
    """
    return _tools(_workshop, seed, draws, **design)


def random_tool(seed: Seed, *, temperature_degree: int = 0, **design: Unpack[Design]) -> Tool:
    """One tool of `random_tools`, with a temperature polynomial of the given degree.

    Examples
    --------
    >>> random_tool(3, temperature_degree=2).triads["accelerometer"].degree
    2
    """
    return with_temperature(random_tools(seed, 1, **design).tool(0), seed, temperature_degree)


def realistic_tool(seed: Seed, *, temperature_degree: int = 0, **design: Unpack[Design]) -> Tool:
    """One tool of `realistic_tools`, with a temperature polynomial of the given degree.

    Examples
    --------
    >>> realistic_tool(3, sensors={"accelerometer": 4, "gyro": 2}).triads["gyro"].count
    2
    """
    return with_temperature(realistic_tools(seed, 1, **design).tool(0), seed, temperature_degree)


def with_temperature(tool: Tool, seed: Seed, degree: int) -> Tool:
    """The tool with random dependence on temperature of a degree 0 to 4; unchanged at the reference temperature.

    Per degC, each sensor's conversion factor changes by N(0, 1e-4) of itself, its axis by N(0, 1e-5) rad, its offset by
    N(0, 3e-5) of the full field (0.03 mg, 1.5 nT). Each higher power is 1/200 of the one below: all matter only over a
    hundred degrees.
    """
    if not 0 <= degree <= 4:
        raise out_of_range("degree", degree, "0 .. 4")
    if degree == 0:
        return tool
    streams, triads = Streams(seed, "tool"), {}
    for kind, triad in tool.triads.items():
        random = streams[f"{kind}.temperature"]
        tensor, offset = triad.tensor[0], triad.offset[0]
        size = np.linalg.norm(tensor, axis=-1)
        shrink = (1.0 / 200.0) ** np.arange(degree)
        factor = 1e-4 * random.standard_normal((degree, triad.count))
        turn = 1e-5 * random.standard_normal((degree, triad.count, 3))
        shift = 3e-5 * random.standard_normal((degree, triad.count))
        tensors = shrink[:, None, None] * (factor[..., None] * tensor + turn * size[:, None])
        triads[kind] = Triad(
            kind,
            np.concatenate([tensor[None], tensors]),
            np.concatenate([offset[None], shrink[:, None] * shift * size]),
            triad.unit,
            triad.field_strength,
            triad.reference_temperature,
        )
    return Tool(tool.name, triads, noise=tool.noise)


def _tools(
    draw: _Draw,
    seed: Seed,
    draws: int,
    sensors: Mapping[str, int] = TRIADS,
    bits: int | None = 12,
    g: float = STANDARD_GRAVITY,
    b: float = 50000.0,
    noise: Mapping[str, float] = NOISE,
) -> ToolBatch:
    """Draw axes, factors and offsets of each kind, and put them into signal units."""
    unknown = (set(sensors) | set(noise)) - set(KINDS)
    if not sensors:
        raise refused("input-empty", {"name": "sensors"})
    if unknown:
        raise not_among("sensors, noise", ", ".join(sorted(unknown)), KINDS)
    for name, value in (("g", g), ("b", b)):
        if not value > 0.0:
            raise out_of_range(name, value, "> 0")
    within(list(noise.values()), "noise", 0.0, np.inf)
    streams = Streams(seed, "tool")
    strength = {"accelerometer": g, "magnetometer": b, "gyro": EARTH_RATE}
    tensors, offsets, sd = {}, {}, {}
    kinds = [kind for kind in KINDS if kind in sensors]
    for kind in kinds:
        unit = 1.0 if bits is None else converter_step(kind, bits)
        axes, factors, shift = draw(streams, kind, draws, sensors[kind], strength[kind])
        tensors[kind] = axes * (factors * strength[kind] / unit)[..., None]
        offsets[kind] = shift / unit
        sd[kind] = float(noise.get(kind, 0.0)) / unit
    units = {kind: PHYSICAL_UNITS[kind] if bits is None else "counts" for kind in kinds}
    return ToolBatch(tensors, offsets, sd, units, {kind: strength[kind] for kind in kinds})


def _draw_extreme_tools(
    streams: Streams, kind: str, draws: int, count: int, strength: float
) -> tuple[Array, Array, Array]:
    """Axes (draws, m, 3), conversion factors (draws, m) and physical offsets (draws, m) of the scenarios."""
    rotation = random_rotations(streams[f"{kind}.rotation"], draws)
    axes = nominal_axes(count) @ rotation + 0.1 * streams[f"{kind}.axes"].standard_normal((draws, count, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    factors = streams[f"{kind}.factors"].uniform(0.95, 1.05, (draws, count))
    offsets = strength * streams[f"{kind}.offsets"].uniform(-0.05, 0.05, (draws, count))
    return axes, factors, offsets


def _workshop(streams: Streams, kind: str, draws: int, count: int, strength: float) -> tuple[Array, Array, Array]:
    """As `_draw_extreme_tools`, for tools built with ordinary care; the offsets do not depend on the field."""
    nominal = nominal_axes(count)
    random = streams[f"{kind}.axes"]
    aside = np.cross(nominal, random.standard_normal((draws, count, 3)))
    aside /= np.linalg.norm(aside, axis=-1, keepdims=True)
    angle = np.radians(random.uniform(1.0, 2.0, (draws, count)))[..., None]
    axes = nominal * np.cos(angle) + aside * np.sin(angle)
    sd = {"accelerometer": 0.02 * STANDARD_GRAVITY, "magnetometer": 400.0, "gyro": DEG_PER_HOUR}[kind]
    factors = streams[f"{kind}.factors"].uniform(0.95, 1.05, (draws, count))
    return axes, factors, sd * streams[f"{kind}.offsets"].standard_normal((draws, count))


def random_rotations(random: np.random.Generator, draws: int) -> Array:
    """Rotation matrices (draws, 3, 3), uniform over all rotations.

    A normal 4-vector points uniformly over the sphere of unit quaternions (Shoemake, Graphics Gems III, 1992).
    """
    quaternion = random.standard_normal((draws, 4))
    return dcm_from_quaternion(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True))

"""Simulated gyro surveys: stations with indexed readings, a hot run, and one gyro seeking north."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, within
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.earth.rate import earth_rate, horizontal_rate
from inclinometry.errors import wrong_shape
from inclinometry.rotations import dcm, rotation_z, wrap_positive
from inclinometry.simulate.tool import Seed, Streams, flicker_rate, white_rate

FOUR_POSITIONS = tuple(np.radians([0.0, 90.0, 180.0, 270.0]).tolist())
"""Index angles 0, 90, 180, 270 deg, rad."""

_CROSS = np.eye(3)[:2]


@dataclass(frozen=True, eq=False)
class GyroSensors:
    """Errors of the sensors of an indexed gyro tool; perfect x and y sensors by default, 3 rows of tensors with z.

    gyro_bias : rad/s; gyro_drift, of every gyro : rad/s per second; flicker : bias instability (`flicker_rate`), rad/s.
    arw : angle random walk, rad/sqrt(s). accelerometer_noise : sd of one reading, m/s^2.
    """

    gyro_tensor: Array = field(default_factory=_CROSS.copy)
    accelerometer_tensor: Array = field(default_factory=_CROSS.copy)
    gyro_bias: float | Array = 0.0
    accelerometer_bias: float | Array = 0.0
    gyro_drift: float = 0.0
    arw: float = 0.0
    flicker: float = 0.0
    accelerometer_noise: float = 0.0

    def __post_init__(self) -> None:
        for name in ("gyro", "accelerometer"):
            tensor = finite(getattr(self, f"{name}_tensor"), f"{name}_tensor", (None, 3))
            finite(getattr(self, f"{name}_bias"), f"{name}_bias")
            object.__setattr__(self, f"{name}_tensor", tensor)
        finite(self.gyro_drift, "gyro_drift")
        for name in ("arw", "flicker", "accelerometer_noise"):
            within(getattr(self, name), name, 0.0, np.inf)


@dataclass(frozen=True)
class Spike:
    """An outlier added to one reading of one gyro, rad/s."""

    station: int
    position: int
    channel: int
    size: float


@dataclass(frozen=True, eq=False)
class GyroSimulation:
    """Readings at P index positions of n stations, K = n P rows, and beside them the truth (n,); rad, m/s^2, rad/s.

    time : s, middle of the reading. scale : true rate = scale x reading. azimuth : from true north.
    noise : "gyro" -> sd of one reading from the angle random walk; "accelerometer" -> its sd.
    clean : gyro readings without bias, drift, noise and spikes.
    """

    station: Index
    md: Array
    index: Array
    temperature: Array
    time: Array
    accelerometer: Array
    gyro: Array
    noise: Mapping[str, float]
    inclination: Array
    azimuth: Array
    toolface: Array
    scale: Array
    latitude: float
    clean: Array


def simulate_gyro_run(
    md: ArrayLike,
    inclination: ArrayLike,
    azimuth: ArrayLike,
    toolface: ArrayLike,
    *,
    latitude: float,
    scale: ArrayLike = 1.0,
    temperature: ArrayLike = 20.0,
    positions: ArrayLike = FOUR_POSITIONS,
    dwell: float = 60.0,
    settle: float = 5.0,
    travel: float = 120.0,
    g: float = STANDARD_GRAVITY,
    sensors: GyroSensors | None = None,
    spikes: Sequence[Spike] = (),
    seed: Seed,
) -> GyroSimulation:
    """Readings of gyros and accelerometers that are turned about the tool axis at every station.

    reading = (N R_z(index) C_tn w)/scale + bias + drift t + noise, w the Earth rate in north, east, down; azimuth from
    true north, toolface at index 0. Each is averaged over `dwell` s after `settle`; `travel` between stations. Bias
    drifts from the start of the run on; flicker runs from reading to reading as if there were no travel.
    """
    given = {"md": md, "inclination": inclination, "azimuth": azimuth, "toolface": toolface}
    path = [finite(v, name) for name, v in given.items()]
    if any(v.ndim != 1 or v.shape != path[0].shape for v in path):
        raise wrong_shape(", ".join(given), ", ".join(str(v.shape) for v in path), "(n,)")
    index = finite(positions, "positions", (None,))
    within([dwell, g], "dwell, g", 1e-9, np.inf)
    within([settle, travel], "settle, travel", 0.0, np.inf)
    size = len(path[0])
    true_scale = np.broadcast_to(within(scale, "scale", 1e-3, 1e3), (size,))
    use, streams = GyroSensors() if sensors is None else sensors, Streams(seed, "gyro")
    block = rotation_z(index) @ dcm(path[2], path[1], path[3])[:, None]
    rate = (block @ earth_rate(latitude)).reshape(-1, 3) / np.repeat(true_scale, len(index))[:, None]
    gravity = g * block[..., 2].reshape(-1, 3)
    start = np.arange(size)[:, None] * (len(index) * (dwell + settle) + travel)
    time = (start + settle + 0.5 * dwell + np.arange(len(index)) * (dwell + settle)).ravel()
    clean, level = rate @ use.gyro_tensor.T, gravity @ use.accelerometer_tensor.T
    scatter = streams["accelerometer.noise"].standard_normal(level.shape)
    shape = (len(use.gyro_tensor), len(time))
    noise = white_rate(streams["gyro.white"], shape, use.arw, dwell)
    noise = noise + flicker_rate(streams["gyro.flicker"], shape, use.flicker)
    errors = noise.T + use.gyro_bias + use.gyro_drift * time[:, None]
    return GyroSimulation(
        station=np.repeat(np.arange(1, size + 1), len(index)),
        md=np.repeat(path[0], len(index)),
        index=np.tile(index, size),
        temperature=np.repeat(np.broadcast_to(finite(temperature, "temperature"), (size,)), len(index)),
        time=time,
        accelerometer=level + use.accelerometer_bias + use.accelerometer_noise * scatter,
        gyro=clean + errors + _spikes(spikes, (size, len(index), clean.shape[1])),
        noise={"gyro": use.arw / np.sqrt(dwell), "accelerometer": use.accelerometer_noise},
        inclination=path[1],
        azimuth=wrap_positive(path[2]),
        toolface=wrap_positive(path[3]),
        scale=true_scale,
        latitude=latitude,
        clean=clean,
    )


def _spikes(spikes: Sequence[Spike], shape: tuple[int, int, int]) -> Array:
    out = np.zeros(shape)
    for spike in spikes:
        place = (spike.station, spike.position, spike.channel)
        for name, at, size in zip(("station", "position", "channel"), place, shape, strict=True):
            within(at, f"spike.{name}", 0, size - 1)
        out[place] += spike.size
    return out.reshape(-1, shape[2])


class HotRun(NamedTuple):
    """A run into a hot hole; (n,) each, rad, degC, rates in units of the Earth rate.

    a, b : readings of the two cross-axis gyros turned back to the high side, X/scale and Y/scale plus noise.
    clean_a, clean_b : the same without noise; noise : its standard deviation; latitude : rad.
    """

    temperature: Array
    scale: Array
    inclination: Array
    azimuth: Array
    a: Array
    b: Array
    clean_a: Array
    clean_b: Array
    noise: float
    latitude: float


def hot_run(
    seed: Seed, stations: int = 60, *, noise: float = np.radians(0.015) / 3600.0, latitude: float = np.pi / 4
) -> HotRun:
    """Stations from 20 to 140 degC with a scale factor that follows the temperature; `noise` of each rate, rad/s.

    T linear plus 0.3 x cumulated N(0, 2); d = (T - 20)/100; scale = 1 + N(0, 0.005) d + N(0, 0.003) d^2 + N(0, 0.0005).
    Inclination linear from 2 to U(20, 88) deg, within 1 to 88; azimuth walks 1.5 deg a station. X = cos lat cos azi cos
    inc + sin lat sin inc, Y = -cos lat sin azi.
    """
    within(stations, "stations", 2, np.inf)
    draw = Streams(seed, "hot-run")
    temperature = np.linspace(20.0, 140.0, stations)
    temperature = temperature + 0.3 * np.cumsum(2.0 * draw["temperature"].standard_normal(stations))
    d, (one, two) = (temperature - 20.0) / 100.0, draw["scale"].standard_normal(2)
    scale = 1.0 + 0.005 * one * d + 0.003 * two * d**2 + 0.0005 * draw["scale.noise"].standard_normal(stations)
    inclination = np.radians(np.clip(np.linspace(2.0, draw["inclination"].uniform(20.0, 88.0), stations), 1.0, 88.0))
    steps = np.cumsum(1.5 * draw["azimuth.steps"].standard_normal(stations))
    azimuth = wrap_positive(np.radians(draw["azimuth"].uniform(0.0, 360.0) + steps))
    rate = (dcm(azimuth, inclination, 0.0) @ earth_rate(latitude)) / (EARTH_RATE * scale[:, None])
    sd = float(noise) / EARTH_RATE
    noisy = rate[:, :2] + sd * draw["noise"].standard_normal((stations, 2))
    return HotRun(
        temperature, scale, inclination, azimuth, noisy[:, 0], noisy[:, 1], rate[:, 0], rate[:, 1], sd, latitude
    )


class NorthSeeking(NamedTuple):
    """Readings (runs, n), rad/s, of one level gyro turned about the vertical by `angle` (n,), rad, at `time` (n,), s.

    azimuth : (runs,) of the sensor at index 0 from true north, rad.
    """

    angle: Array
    time: Array
    rate: Array
    azimuth: Array


def simulate_north_seeking(
    index: ArrayLike,
    *,
    interval: float = 1.0,
    latitude: float,
    arw: float = 0.0,
    flicker: float = 0.0,
    drift: float = 0.0,
    bias: float = 0.0,
    scale: float = 1.0,
    sweep: float = 0.0,
    runs: int = 1,
    seed: Seed,
) -> NorthSeeking:
    """Many runs of one gyro in a level tool that looks for north, at random azimuths.

    Parameters
    ----------
    index : (n,) array_like
        Index angle of each reading, rad (the middle of it).
    interval : float
        s over which a reading is averaged, and from one to the next.
    latitude : float
        rad.
    arw, flicker, drift, bias : float
        rad/sqrt(s), rad/s, rad/s per second (a gyro that warms up), rad/s.
    scale : float
        True rate over reading.
    sweep : float
        Angle turned while a reading is averaged, rad.
    runs : int
    seed : int, SeedSequence or Generator

    Notes
    -----
    r = w cos(lat) cos(azimuth + index)/scale + bias + drift (t - t_mean) + noise.

    Examples
    --------
    >>> seen = simulate_north_seeking(FOUR_POSITIONS, latitude=0.0, runs=3, seed=1)
    >>> turned = np.arctan2(seen.rate[:, 3] - seen.rate[:, 1], seen.rate[:, 0] - seen.rate[:, 2])
    >>> bool(np.allclose(np.exp(1j * turned), np.exp(1j * seen.azimuth)))
    True
    """
    angle = finite(index, "index", (None,))
    within(interval, "interval", 1e-9, np.inf)
    streams, shape = Streams(seed, "north-seeking"), (int(runs), len(angle))
    azimuth: Array = streams["azimuth"].uniform(0.0, 2.0 * np.pi, shape[0])
    time = np.asarray((np.arange(len(angle)) + 0.5) * interval, dtype=np.float64)
    size = float(horizontal_rate(latitude)) * float(np.sinc(sweep / (2.0 * np.pi))) / scale
    seen = size * np.cos(azimuth[:, None] + angle)
    noise = white_rate(streams["white"], shape, arw, interval) + flicker_rate(streams["flicker"], shape, flicker)
    return NorthSeeking(angle, time, np.asarray(seen + bias + drift * (time - time.mean()) + noise), azimuth)

"""A continuous log of a tool that is moved from pose to pose: still periods with motion between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, finite, within
from inclinometry.constants import DIP, EARTH_RATE, LATITUDE, STANDARD_GRAVITY
from inclinometry.errors import InputError
from inclinometry.rotations import dcm, rotation_exp, rotation_log
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import field_direction
from inclinometry.simulate.sensing import sense
from inclinometry.simulate.tool import Seed, Streams


@dataclass(frozen=True, eq=False)
class LogSimulation:
    """A log of n samples and P poses.

    time : (n,) s.
    signals, clean, saturated : kind -> (n, m), in `units`.
    still : (P, 2) true start and end of each still period, s.
    pose : (n,) number of the pose a sample was taken in, -1 while moving.
    orientation : (n, 3, 3) true rotation from north-east-down to tool axes.
    rate : (n, 3) true turning rate of the tool, in tool axes, rad/s, without the Earth's.
    """

    time: Array
    signals: Mapping[str, Array]
    clean: Mapping[str, Array]
    saturated: Mapping[str, NDArray[np.bool_]]
    units: Mapping[str, str]
    still: Array
    pose: NDArray[np.int64]
    orientation: Array
    rate: Array


def simulate_log(
    tool: Tool,
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    *,
    dwell: ArrayLike = 5.0,
    move: ArrayLike = 2.0,
    rate: float = 100.0,
    shake: float = 1.0,
    dip: float = DIP,
    latitude: float = LATITUDE,
    noise: Mapping[str, ArrayLike] | None = None,
    drift: Mapping[str, ArrayLike] | None = None,
    bits: int | None = None,
    seed: Seed,
) -> LogSimulation:
    """Samples of a tool that rests in each pose and is carried smoothly, with some shaking, to the next.

    Parameters
    ----------
    azimuth, inclination, toolface : (P,) array_like
        Poses in order, rad; azimuth from magnetic (and true) north.
    dwell : float or (P,) array_like
        Length of each still period, s.
    move : float or (P - 1,) array_like
        Length of each move, s.
    rate : float
        Samples per second.
    shake : float
        Rms acceleration of the hand at the middle of a move, per axis, m/s^2.
    dip, latitude : float
        rad.
    noise : mapping of kind to float or (m,) array_like, optional
        White noise of one sample, signal units; the tool's own when absent.
    drift : mapping of kind to float or (m,) array_like, optional
        Steady change of the offsets, signal units per second.
    bits : int, optional
        As in `simulate_bench`; a converter made for the Earth rate saturates when the tool is turned.
    seed : int, SeedSequence or Generator

    Raises
    ------
    InputError
        Poses of different lengths, times or rates out of range.

    Notes
    -----
    Between poses the tool turns about one fixed axis by s(u) = 10 u^3 - 15 u^4 + 6 u^5 of the way, whose rate and
    acceleration vanish at both ends.

    Examples
    --------
    >>> from inclinometry.simulate.tool import realistic_tool
    >>> log = simulate_log(realistic_tool(1, bits=None), [0, 1], [0.5, 1.5], [0, 0], rate=10, seed=1)
    >>> log.still
    array([[ 0.,  5.], [ 7., 12.]])
    """
    a, i, t = (finite(v, n) for v, n in ((azimuth, "azimuth"), (inclination, "inclination"), (toolface, "toolface")))
    if a.ndim != 1 or not a.shape == i.shape == t.shape or not a.size:
        raise InputError(f"poses have shapes {a.shape}, {i.shape}, {t.shape}; expected (P,) for all three")
    poses = dcm(a, i, t)
    # start and end of each still period (P, 2)
    count = len(poses)
    rests = np.broadcast_to(within(dwell, "dwell", 1e-3, 1e6, "s"), (count,))
    moves = np.broadcast_to(within(move, "move", 1e-3, 1e6, "s"), (count - 1,))
    starts = np.concatenate([[0.0], np.cumsum(rests[:-1] + moves)])
    still = np.stack([starts, starts + rests], axis=-1)
    within(rate, "rate", 1e-3, 1e6, "per second")
    time = np.arange(int(np.floor(still[-1, 1] * rate + 1e-9)) + 1) / rate
    # where each sample is on its way
    leg = np.searchsorted(still[:, 0], time, side="right") - 1
    end = still[leg, 1]
    moving = time > end
    length = np.where(moving, np.append(still[1:, 0], np.inf)[leg] - end, 1.0)
    # a sample at the very end of the log may lie a rounding error behind it
    u = np.where(moving & np.isfinite(length), (time - end) / length, 0.0)
    turned = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    bell = 16.0 * u**2 * (1.0 - u) ** 2
    pose = np.where(moving & np.isfinite(length), -1, leg).astype(np.int64)
    way = _Way(leg.astype(np.int64), pose, turned, 1.875 * bell / length, bell)
    steps = np.concatenate([rotation_log(poses[1:] @ poses[:-1].swapaxes(-1, -2)), np.zeros((1, 3))])
    orientation = rotation_exp(way.turned[:, None] * steps[way.leg]) @ poses[way.leg]
    # the rotation is passive: the axes turn against the vector that turns the components
    turning = -way.speed[:, None] * steps[way.leg]
    streams = Streams(seed, "log")
    jolt = shake * way.bell[:, None] * streams["shake"].standard_normal(turning.shape)
    north = {kind: field_direction(kind, dip, latitude, 0.0) for kind in tool.triads}
    fields = {kind: orientation @ north[kind] + _motion(tool, kind, turning, jolt) for kind in tool.triads}
    slope = {kind: time[:, None] * finite(value, f"{kind} drift") for kind, value in (drift or {}).items()}
    sensed = sense(tool, fields, streams, noise=noise, bits=bits, drift=slope)
    units = {kind: triad.unit for kind, triad in tool.triads.items()}
    signals, clean, saturated = sensed.signals, sensed.clean, sensed.saturated
    return LogSimulation(time, signals, clean, saturated, units, still, way.pose, orientation, turning)


class _Way(NamedTuple):
    """How far each sample is between two poses."""

    leg: NDArray[np.int64]  # pose at or behind
    pose: NDArray[np.int64]  # the same, -1 while moving
    turned: Array  # share of the turn to the next pose that is done
    speed: Array  # its rate, 1/s
    bell: Array  # the same rate with 1 at the middle of the move


def _motion(tool: Tool, kind: str, turning: Array, jolt: Array) -> Array | float:
    """What moving adds to the field (n, 3), in units of the triad's field strength."""
    strength = tool.triads[kind].field_strength
    if kind == "gyro":
        return turning / (strength or EARTH_RATE)
    return jolt / (strength or STANDARD_GRAVITY) if kind == "accelerometer" else 0.0

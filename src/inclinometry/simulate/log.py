"""A continuous log of a tool that is moved from pose to pose: still periods with motion between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, finite, within
from inclinometry.constants import DIP, EARTH_RATE, LATITUDE, STANDARD_GRAVITY
from inclinometry.errors import wrong_shape
from inclinometry.rotations import dcm, rotation_exp, rotation_log
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import field_direction
from inclinometry.simulate.sensing import Sensed, sense
from inclinometry.simulate.tool import Seed, Streams


@dataclass(frozen=True, eq=False, kw_only=True)
class LogSimulation(Sensed):
    """A log of n samples and P poses: signals by kind (n, m) in `units`, and the truth.

    still : (P, 2) true start and end of each still period, s. pose : (n,) its number, -1 while moving.
    orientation : (n, 3, 3) from north-east-down to tool axes. rate : (n, 3) of turning, rad/s, without the Earth's.
    """

    time: Array
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
    """Samples of a tool that rests in each pose (`dwell` s) and is carried smoothly to the next (`move` s).

    Between poses it turns about one fixed axis by s(u) = 10 u^3 - 15 u^4 + 6 u^5 of the way: rate and acceleration
    vanish at both ends. `shake`: rms of the hand at the middle of a move, per axis, m/s^2. `drift`: of the offsets,
    signal units per second. A converter (`bits`) made for the Earth rate saturates when the tool turns.
    """
    a, i, t = (finite(v, n) for v, n in ((azimuth, "azimuth"), (inclination, "inclination"), (toolface, "toolface")))
    if a.ndim != 1 or not a.shape == i.shape == t.shape or not a.size:
        raise wrong_shape("azimuth, inclination, toolface", f"{a.shape}, {i.shape}, {t.shape}", "(P,)")
    poses = dcm(a, i, t)
    # start and end of each still period (P, 2)
    count = len(poses)
    rests = np.broadcast_to(within(dwell, "dwell", 1e-3, 1e6, "s"), (count,))
    moves = np.broadcast_to(within(move, "move", 1e-3, 1e6, "s"), (count - 1,))
    starts = np.concatenate([[0.0], np.cumsum(rests[:-1] + moves)])
    still = np.stack([starts, starts + rests], axis=-1)
    within(rate, "rate", 1e-3, 1e6, "Hz")
    time = np.arange(int(np.floor(still[-1, 1] * rate + 1e-9)) + 1) / rate
    # where each sample is on its way
    leg = np.searchsorted(still[:, 0], time, side="right") - 1
    end = still[leg, 1]
    moving = time > end
    length = np.where(moving, np.append(still[1:, 0], np.inf)[leg] - end, 1.0)
    # a sample at the very end of the log may lie a rounding error behind it
    u = np.where(moving & np.isfinite(length), (time - end) / length, 0.0)
    turned = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    bell = 16.0 * u**2 * (1.0 - u) ** 2  # the rate with 1 at the middle of the move
    pose = np.where(moving & np.isfinite(length), -1, leg)
    steps = np.concatenate([rotation_log(poses[1:] @ poses[:-1].swapaxes(-1, -2)), np.zeros((1, 3))])
    orientation = rotation_exp(turned[:, None] * steps[leg]) @ poses[leg]
    # the rotation is passive: the axes turn against the vector that turns the components
    turning = -(1.875 * bell / length)[:, None] * steps[leg]
    streams = Streams(seed, "log")
    jolt = shake * bell[:, None] * streams["shake"].standard_normal(turning.shape)
    north = {kind: field_direction(kind, dip, latitude, 0.0) for kind in tool.triads}
    fields = {kind: orientation @ north[kind] + _motion(tool, kind, turning, jolt) for kind in tool.triads}
    slope = {kind: time[:, None] * finite(value, f"{kind}.drift") for kind, value in (drift or {}).items()}
    sensed = sense(tool, fields, streams, noise=noise, bits=bits, drift=slope)
    return LogSimulation(time=time, still=still, pose=pose, orientation=orientation, rate=turning, **vars(sensed))


def _motion(tool: Tool, kind: str, turning: Array, jolt: Array) -> Array | float:
    """What moving adds to the field (n, 3), in units of the triad's field strength."""
    strength = tool.triads[kind].field_strength
    if kind == "gyro":
        return turning / (strength or EARTH_RATE)
    return jolt / (strength or STANDARD_GRAVITY) if kind == "accelerometer" else 0.0

"""What the filter knows at the end of a window, and the taking out of estimated errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array, frozen
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.earth.rate import earth_rate, horizontal_rate
from inclinometry.earth.site import Site
from inclinometry.errors import wrong_shape
from inclinometry.rotations import quaternion_exp, quaternion_multiply, rotation_exp
from inclinometry.settings import Range, Settings


@dataclass(frozen=True, kw_only=True)
class InertialSettings(Settings):
    """Settings of `inertial_attitude`, `gyro_attitude`, `smoothed_attitude` and `continuous_survey`."""

    window: Annotated[float, Range(0.2, 600.0, "s"), "Between two updates with gravity; spacing of the rows."] = 5.0
    gyro_noise: Annotated[float, Range(1e-9, 1.0, "rad/sqrt(s)"), "Angle random walk."] = 3e-5
    gyro_bias_sigma: Annotated[float, Range(0.0, 1.0, "rad/s"), "Prior standard uncertainty."] = 3e-3
    gyro_bias_walk: Annotated[float, Range(0.0, 0.1, "rad/s/sqrt(s)"), "Its random walk."] = 1e-6
    gyro_scale_sigma: Annotated[float, Range(0.0, 0.1), "Relative; times the rate the largest error of all."] = 2e-3
    gyro_scale_walk: Annotated[float, Range(0.0, 0.01, "1/sqrt(s)"), "Its random walk."] = 1e-7
    accel_noise: Annotated[float, Range(1e-6, 100.0, "m/s^2"), "Of a sample at rest; shaking is measured."] = 0.03
    accel_bias_sigma: Annotated[float, Range(0.0, 10.0, "m/s^2"), "Prior standard uncertainty."] = 0.02
    accel_bias_walk: Annotated[float, Range(0.0, 1.0, "m/s^2/sqrt(s)"), "Its random walk."] = 1e-5
    mag_noise: Annotated[float, Range(1e-3, 1e5, "nT"), "Of one sample, at least; more where samples show it."] = 50.0
    hard_iron_sigma: Annotated[
        float | tuple[float, float, float],
        Range(0.0, 1e5, "nT"),
        "One number or x, y, z; along the tool hardly anything else bounds the azimuth.",
    ] = 150.0
    mag_scale_sigma: Annotated[float, Range(0.0, 0.1), "Of scale errors and couplings."] = 0.0
    hard_iron_walk: Annotated[float, Range(0.0, 1e3, "nT/sqrt(s)"), "Its random walk."] = 0.05
    gain_sigma: Annotated[float, Range(0.0, 0.1), "Gain of the accelerometers across, relative to along."] = 2e-4
    ripple_sigma: Annotated[float, Range(0.0, 0.1), "The same of the anti-alias filter at 10 turns a second."] = 1e-3
    coupling_sigma: Annotated[float, Range(0.0, 0.1, "rad"), "Axes of the gyro against the accelerometers'."] = 2e-3
    delay_sigma_s: Annotated[float, Range(0.0, 0.1, "s"), "By which a triad is out of step with the others."] = 1e-4
    lever_arm: Annotated[tuple[float, float, float], Range(-1.0, 1.0, "m"), "From the axis of rotation."] = (
        0.0,
        0.0,
        0.0,
    )
    lever_sigma: Annotated[float, Range(0.0, 1.0, "m"), "Its standard uncertainty."] = 0.02
    gate: Annotated[float, Range(1.0, 1e6, "variances"), "Innovation beyond which a measurement is refused."] = 36.0
    weight: Annotated[Callable[[Array], Array] | None, "Of normalised innovations of gravity, to [0, 1]."] = None
    still_rate: Annotated[float, Range(0.0, 1.0, "rad/s"), "Turn a gyro alone must exclude to hold a tool."] = 2e-5
    still_accel: Annotated[float, Range(0.0, 100.0, "m/s^2"), "Accelerometers' scatter beyond which it is not."] = 0.2
    creep: Annotated[float, Range(0.0, 0.1, "rad/sqrt(s)"), "What a tool that is held may turn unseen."] = 1e-6
    u_limit: Annotated[float, Range(1e-6, 3.0, "rad"), "Uncertainty at which quality is 0."] = float(np.radians(2.0))

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.shape(self.lever_arm) != (3,):
            raise wrong_shape("lever_arm", np.shape(self.lever_arm), "(3,)")
        if np.shape(self.hard_iron_sigma) not in ((), (3,)):
            raise wrong_shape("hard_iron_sigma", np.shape(self.hard_iron_sigma), "() | (3,)")

    def prior(self, attitude: Array, dip_sigma: float) -> Array:
        """Covariance (16, 16) before the first sample, `attitude` (3, 3) that of the attitude."""
        three = np.ones(3)
        spread = [
            self.gyro_bias_sigma * three,
            self.gyro_scale_sigma * three,
            self.accel_bias_sigma * three,
            self.hard_iron_sigma * three,
            [dip_sigma],
        ]
        covariance = np.diag(np.concatenate([np.zeros(3), *(np.asarray(s, dtype=np.float64) for s in spread)]) ** 2)
        covariance[:3, :3] = attitude
        return covariance

    def step_variances(self, interval: float, attitude: float) -> Array:
        """Variances (16,) that one step adds to the errors; the attitude's walk (rad/sqrt(s)) is given."""
        walks = (
            attitude,
            self.gyro_bias_walk,
            self.gyro_scale_walk,
            self.accel_bias_walk,
            self.hard_iron_walk,
        )
        return frozen(np.append(np.repeat(walks, 3) ** 2, 0.0) * interval)


# Settings and site together: gravity and Earth rate in the axes the filter works in.


@dataclass(frozen=True, eq=False)
class Model:
    """What a window is reduced with.

    magnetic : whether the field is used.
    blind : azimuth is not known, so that the horizontal Earth rate points anywhere: a filter that is linear in the
        azimuth's error would draw wrong conclusions from it. It is then left out and counted as noise.
    """

    settings: InertialSettings
    site: Site
    magnetic: bool
    blind: bool = False

    @property
    def gravity(self) -> float:
        """m/s^2."""
        return STANDARD_GRAVITY if self.site.gravity is None else self.site.gravity

    @property
    def spin(self) -> Array:
        """Earth rate (3,) in north, east, down of the north that is used; zero without a latitude."""
        if self.site.latitude is None:
            return np.zeros(3)
        w = earth_rate(self.site.latitude)
        if self.blind:
            return np.array([0.0, 0.0, w[2]])
        # east of true north, magnetic north sees the Earth's axis turned west
        turn = (self.site.declination or 0.0) if self.magnetic else 0.0
        return np.array([w[0] * np.cos(turn), -w[0] * np.sin(turn), w[2]])

    @property
    def gyro_noise(self) -> float:
        """Angle random walk, rad/sqrt(s): the gyro's, and that which turns as far in a window as a rate not known."""
        if self.site.latitude is None:
            unknown = EARTH_RATE
        else:
            level = float(horizontal_rate(self.site.latitude))
            # rad, a declination that no site states
            askew = 0.2 if self.magnetic and self.site.declination is None else 0.0
            unknown = level * (1.0 if self.blind else askew)
        return float(np.hypot(self.settings.gyro_noise, unknown * np.sqrt(self.settings.window)))

    def gain(self, rate: Array) -> float:
        """Standard uncertainty of the accelerometers' gain across the tool, at rates (n, 3) of a window, rad/s."""
        # the settings' ripple is stated for ten turns a second
        fast = float(np.mean(rate[:, 2] ** 2)) / (20.0 * np.pi) ** 2
        return float(np.hypot(self.settings.gain_sigma, self.settings.ripple_sigma * fast))


# Measurements at the end of a window, and the tape on which a window is noted for the backward pass.

NO_GATE: Final = 1e30


class Tape(NamedTuple):
    """What the backward pass needs of a window; no rows when it is not wanted.

    steps : (n, 13); updates : (n + 6, 34); error : (16,) taken out at the end.
    """

    steps: Array
    updates: Array
    error: Array


def blank_tape(size: int) -> Tape:
    """A tape for a window of `size` samples."""
    # and for the measurements at its end: gravity, standstill
    return Tape(np.zeros((size, 13)), np.zeros((size + 6, 34)), np.zeros(16))


NO_TAPE: Final = Tape(np.zeros((0, 13)), np.zeros((0, 34)), np.zeros(16))


NOMINAL = 20
"""Quaternion 0-3, gyro bias 4-6, gyro scale 7-9, accelerometer bias 10-12, hard iron 13-15, dip 16."""
STATES = 16


class Shaking(NamedTuple):
    """What is known of vibration and lever arm."""

    # (3,) m^2/s^4, variance of a window's mean by the tapers beside zero frequency, north, east, down; over windows in
    # which it was of one level
    scatter: Array
    bands: Array  #: (2, 2) the same of the tapers of 2 and of 3 turns alone; horizontal, vertical
    lever: Array  #: (3,) m, position of the accelerometers; the next is its inverse covariance, (3, 3)
    information: Array
    windows: int  #: seen in all; the next: of these, since the level of shaking last rose
    level: int
    # (4, 4) of what moves more slowly than a window and shows in no taper, from the innovations of gravity north, east,
    # down and along the tool: sums over windows, each a twentieth less than the next, of their square over its variance
    # s, of (square - s) / s^2, of 1 / s^2 and of 1
    slow: Array


@dataclass(frozen=True, eq=False)
class State:
    """Estimates at an instant."""

    # (20,) quaternion (north-east-down to tool), gyro bias, gyro scale, accelerometer bias, hard iron, dip
    nominal: Array
    covariance: Array  #: (16, 16) of estimate minus truth
    offset: Array  #: (16,) expected estimate minus truth; zero but where a start is linearised again
    last: Array  #: (3,) gyro sample before the window
    strength: float  #: nT, of the reference field
    field_variance: float  #: nT^2, of the noise that successive samples of the field show, averaged over windows
    shaking: Shaking  #: of the tool, as far as known
    #: (3,) of the tool, north, east, down, averaged over some minutes; zero at the start and while it turns
    axis: Array

    @property
    def quaternion(self) -> Array:
        """(4,) of north-east-down to tool."""
        return self.nominal[:4]


def corrected(state: State, error: Array) -> State:
    """The state with an error (16,) taken out.

    The attitude's part of the covariance is turned with the tool, so that it stays what it was in north, east, down:
    an azimuth of which nothing is known must not leak into the level when the level is corrected.
    """
    nominal = state.nominal.copy()
    turned = quaternion_multiply(quaternion_exp(-error[:3]), nominal[:4])
    nominal[:4] = turned / np.linalg.norm(turned)
    nominal[4:17] -= error[3:]
    turn = error_transition(error)
    covariance = turn @ state.covariance @ turn.T
    return replace(
        state, nominal=nominal, covariance=0.5 * (covariance + covariance.T), offset=turn @ (state.offset - error)
    )


def error_transition(error: Array) -> Array:
    """Matrix (16, 16) that takes errors from before to after an error was taken out."""
    turn = np.eye(STATES)
    turn[:3, :3] = rotation_exp(-error[:3])
    return turn

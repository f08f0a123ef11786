"""Attitude of a moving tool in real time: strapdown with gravity and field observed in the almost-inertial frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import InputError
from inclinometry.motion.result import METHODS, Attitude, Samples
from inclinometry.settings import Range, Settings
from inclinometry.tabular import check_record

# Settings of the filter in the almost-inertial frame.


@dataclass(frozen=True, kw_only=True)
class ComplementarySettings(Settings):
    """What the filter takes the tool, its surroundings and its sensors to be.

    Acceleration is the second derivative of a place that stays within bounds (`sway_m`): that, not the strength of
    vibration, limits what gravity's average can be spoiled by.
    """

    every: Annotated[int, "A row for every so many samples."] = 1
    update_s: Annotated[float, Range(1e-3, 1.0, "s"), "Between two observations; samples between are summed."] = 0.1
    start_s: Annotated[float, Range(0.0, 60.0, "s"), "Gravity and field are averaged for the first attitude."] = 1.0
    gravity: Annotated[float, Range(9.0, 10.5, "m/s^2"), "Of the site."] = 9.81
    accel_error: Annotated[float, Range(0.0, 1.0, "m/s^2"), "Sd of the accelerometer's bias; added to every row."] = (
        0.03
    )
    sway_m: Annotated[float, Range(1e-4, 10.0, "m"), "Sd of the tool's horizontal place about its own middle."] = 0.2
    sway_s: Annotated[float, Range(1e-3, 60.0, "s"), "How long one excursion of it lasts."] = 1.0
    unevenness: Annotated[float, Range(1.0, 1e5, "nT"), "Sd of the field between places, and of its errors."] = 1200.0
    unevenness_s: Annotated[float, Range(1e-3, 600.0, "s"), "From one such place to an independent one."] = 4.0
    field_walk: Annotated[float, Range(0.0, 1e4, "nT/sqrt(s)"), "Change of the mean field."] = 20.0
    rate_noise: Annotated[float, Range(1e-9, 1.0, "rad/sqrt(s)"), "Angle random walk."] = float(np.radians(0.02))
    rate_error: Annotated[float, Range(0.0, 0.1), "Relative error of the gyro's scale and axes."] = 1e-3
    bias_sigma: Annotated[float, Range(1e-9, 1.0, "rad/s"), "Of the gyro's bias at the start."] = float(np.radians(0.5))
    bias_walk: Annotated[float, Range(0.0, 0.1, "rad/s/sqrt(s)"), "Its change."] = float(np.radians(0.003))
    rest_rate: Annotated[float, Range(1e-9, 1.0, "rad/s"), "Scatter of rate of a tool at rest."] = float(
        np.radians(2.0)
    )
    rest_gravity: Annotated[float, Range(1e-9, 10.0, "m/s^2"), "Scatter of gravity of a tool at rest."] = 0.5
    rest_s: Annotated[float, Range(0.0, 60.0, "s"), "For so long both must hold."] = 1.5
    gate: Annotated[float, Range(1.0, 1e6), "Misfit of the field, in unevennesses, that counts as disturbed."] = 2.0
    accept_s: Annotated[float, Range(0.1, 1e6, "s"), "A field that stays different is then the new one."] = 20.0
    iron_ratio: Annotated[float, "Share of the field's variance hard iron must explain; inf: never."] = 1.0
    iron_s: Annotated[float, Range(1.0, 1e6, "s"), "Memory of the sums that find it."] = 100.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (isinstance(self.every, int) and self.every >= 1):
            raise InputError(f"every is {self.every}; it must be a whole number of samples, 1 or more")
        if not self.iron_ratio >= 0.0:
            raise InputError(f"iron_ratio is {self.iron_ratio:g}; it must be 0 or more")


class ComplementaryStream:
    """The filter fed block by block, for a rig that runs it live; see `complementary_attitude`.

    Parameters
    ----------
    interval : float
        s, between samples.
    settings : ComplementarySettings, optional
    magnetometer : bool
        Whether the samples will have the field; without it the azimuth is counted from an arbitrary direction.

    Examples
    --------
    >>> stream = ComplementaryStream(0.01, magnetometer=False)
    >>> part = Samples([0.0, 0.01], 0.01, accel=[[0.0, 0.0, 9.81]] * 2, gyro=[[0.0, 0.0, 0.0]] * 2)
    >>> len(stream.push(part)), len(stream.finish())
    (2, 0)
    """

    def __init__(
        self, interval: float, settings: ComplementarySettings | None = None, *, magnetometer: bool = True
    ) -> None:
        from inclinometry.motion.complementary import _recursions

        self._kernel = _recursions
        self.interval, self.settings, self.magnetometer = interval, settings or ComplementarySettings(), magnetometer
        self._par, self._size = parameters(interval, self.settings, magnetometer)
        self._state = np.zeros(_recursions.STATE)
        self._state[0] = 1.0
        self._count = np.zeros(_recursions.COUNT, dtype=np.int64)
        self._history = np.empty((1, 0))

    def push(self, samples: Samples) -> Attitude:
        """Take the next samples and return their rows.

        Raises
        ------
        InputError
            Samples at another interval, without gyro or accelerometer, or without the magnetometer announced.
        """
        if abs(samples.interval - self.interval) > 1e-9 * self.interval:
            raise InputError(
                f"samples come every {samples.interval:.9g} s, the stream was opened for {self.interval:.9g} s; "
                "open another stream for them"
            )
        if samples.gyro is None or samples.accel is None:
            missing = "gyro" if samples.gyro is None else "accel"
            raise InputError(f"the samples have no {missing}; this method needs gyro and accelerometer")
        if not self.magnetometer:
            gyro, accel, mag = samples.gyro, samples.accel, np.empty((0, 3))
        else:
            if samples.mag is None:
                raise InputError("the samples have no mag; open the stream with magnetometer=False or give the field")
            gyro, accel, mag = samples.gyro, samples.accel, samples.mag
        size = len(samples)
        good = np.ones(size, dtype=np.bool_) if samples.clipped is None else ~samples.clipped
        every = self.settings.every
        first = -int(self._count[self._kernel.C_SEEN]) % every
        rows = len(range(first, size, every))
        quaternion, covariance = np.empty((rows, 4)), np.empty((rows, 3, 3))
        rate, quality, flags = np.empty(rows), np.empty(rows), np.empty(rows, dtype=np.uint32)
        self._kernel.advance(
            gyro, accel, mag, good, self._par, self._size, every, self._state, self._count,
            quaternion, covariance, rate, quality, flags, self._history,
        )  # fmt: skip
        return Attitude(
            time=samples.time[first::every].copy(),
            quaternion=quaternion,
            covariance=covariance,
            rate=rate,
            quality=quality,
            flags=flags,
            method=np.full(rows, METHODS.index("complementary"), dtype=np.uint8),
            north="magnetic",
        )

    def finish(self) -> Attitude:
        """No row is held back: nothing more."""
        none = np.empty((0, 3))
        return self.push(Samples(np.empty(0), self.interval, accel=none, mag=none, gyro=none))

    @property
    def bias(self) -> Array:
        """Gyro bias (3,) as far as it is known, rad/s."""
        from inclinometry.motion.complementary import _kernels as kernels

        return self._state[kernels.N_BIAS : kernels.N_BIAS + 3].copy()

    def notes(self) -> tuple[str, ...]:
        """What a user should know of the run so far: drift of an azimuth without field, hard iron removed."""
        from inclinometry.motion.complementary import _kernels as kernels

        state = self._state
        if not self.magnetometer:
            covariance = state[self._kernel.AT_COVARIANCE :].reshape(kernels.STATES, kernels.STATES)
            drift = float(np.degrees(np.sqrt(covariance[kernels.FIELD + 1, kernels.FIELD + 1])))
            return (
                "without a magnetometer azimuth is counted from an arbitrary direction, which has drifted by "
                f"{drift:.2g} deg (standard deviation)",
            )
        iron = state[kernels.N_IRON : kernels.N_IRON + 3]
        said = []
        if iron.any():
            said.append(
                f"hard iron of {', '.join(f'{value:.0f}' for value in iron)} nT (x, y, z) was found and removed"
            )
        doubt = float(state[self._kernel.AT_SLOW + kernels.S_WORST])
        level = float(np.hypot(state[kernels.N_FIELD], state[kernels.N_FIELD + 1]))
        if doubt > self.settings.unevenness**2:
            added = min(float(np.degrees(np.sqrt(doubt) / max(level, 1.0))), 180.0)
            said.append(
                "strength or dip of the field changed for longer than unevenness lasts: up to "
                f"{added:.2g} deg of uncertainty were added to the azimuth"
            )
        return tuple(said)


def complementary_attitude(samples: Samples, settings: ComplementarySettings | None = None) -> Attitude:
    """Attitude of every sample (or every k-th) from gyro, accelerometer and, where there is one, magnetometer.

    Parameters
    ----------
    samples : Samples
        With gyro and accel; mag is optional.
    settings : ComplementarySettings, optional

    Returns
    -------
    Attitude
        A row for every `settings.every` samples; azimuth from magnetic north, or flagged "unobservable".

    Raises
    ------
    InputError
        Samples without gyro or accelerometer.

    Notes
    -----
    The gyro turns the tool into a level frame that is nearly inertial. There, over blocks of `update_s`, a Kalman
    filter of 12 error states uses four facts: the second integral of apparent gravity less gravity is a place, which
    stays within `sway_m`; the field is the same everywhere but for its unevenness; at rest speed is nil and the rate is
    the bias. The idea of low-passing gravity in that frame is that of Laidig and Seel, Information Fusion 91, 2023;
    here the third-order low-pass, its start and the gains for bias and heading follow from the covariance.

    Examples
    --------
    >>> field = [20e3, 0.0, 45e3]
    >>> still = Samples(0.01 * np.arange(300), 0.01, [[0.0, 0.0, 9.81]] * 300, [field] * 300, [[0.0, 0.0, 0.0]] * 300)
    >>> found = complementary_attitude(still)
    >>> bool(found.angles.inclination[-1] < 1e-9), len(found)
    (True, 300)
    """
    check_record(samples, Samples, "complementary_attitude")
    stream = ComplementaryStream(samples.interval, settings, magnetometer=samples.has("mag"))
    return replace(stream.push(samples), notes=stream.notes())


def parameters(interval: float, settings: ComplementarySettings, magnetometer: bool) -> tuple[Array, int]:
    """Settings in the units of the kernels, and the samples in a block."""
    from inclinometry.motion.complementary import _kernels as k

    s = settings
    size = max(1, round(s.update_s / interval))
    t = size * interval
    par = np.zeros(k.PAR)
    values = {
        k.DT: interval,
        k.TAU: t,
        k.G: s.gravity,
        k.R_SWAY: s.sway_m**2 * s.sway_s / t,
        k.R_SPEED: 0.02**2,  # m/s that a tool at rest may move
        k.R_BIAS: np.radians(0.02) ** 2 / t,  # rad/s sqrt(s): what a second at rest tells of the bias
        k.R_FIELD: s.unevenness**2 * s.unevenness_s / t,
        k.UNEVEN: s.unevenness**2,
        k.FRESH: 60.0,  # s at rest after which the field tells nothing new
        k.Q_NOISE: s.rate_noise**2 * t,
        k.Q_RATE: s.rate_error**2 * t,
        k.Q_BIAS: s.bias_walk**2 * t,
        k.Q_FIELD: s.field_walk**2 * t * magnetometer,
        k.GATE: s.gate**2,
        k.REST_RATE: s.rest_rate**2,
        k.REST_GRAVITY: s.rest_gravity**2,
        k.REST_BOUND: np.radians(2.0),  # rad/s: a tool that turns evenly faster than this is not at rest
        k.REST_TIME: s.rest_s,
        k.A_REST: -np.expm1(-t / 0.5),
        k.A_MISFIT: -np.expm1(-t / 1.0),
        k.KEEP: np.exp(-t / s.iron_s),
        k.IRON: s.iron_ratio,
        k.ACCEPT: s.accept_s,
        k.USE_MAG: float(magnetometer),
        k.START: max(1.0, round(s.start_s / interval)),
        k.P_BIAS: s.bias_sigma**2,
        k.P_SPEED: 0.5**2,  # m/s, standard deviation when the filter starts
        k.P_SLOPE: 0.1**2,  # rad, the same of the level frame
        k.BRIDGE: 10.0,  # m/s^2 that a bridged sample's acceleration may be wrong by
        k.PLACE: s.unevenness_s,
        k.SCALE: s.rate_error**2,
        k.A_TREND: -np.expm1(-t / 10.0),  # s over which a rate counts as steady
        k.LONGEST: 24.0,  # s of a calm stretch over which the bias is taken for constant
        k.LEAST_TURN: np.radians(0.2) ** 2,  # rad/s: a tool that turns as fast must be seen to do so
        k.A_SWAY: -np.expm1(-0.2 * t / s.sway_s),
        k.A_SPEED: -np.expm1(-t / 4.0),  # s
        k.A_FIELD: -np.expm1(-t / s.unevenness_s),
        k.A_LASTING: -np.expm1(-t / 15.0),  # s over which what lasts is judged
        k.MOST_SWAY: 3.0 * s.sway_m**2 * s.sway_s / t,
        k.MOST_SPEED: 1.0**2,  # m/s: from there on it says nothing
        k.A_DOUBT: -np.expm1(-t / 100.0),  # s over which the mean field is a mean
        k.LEAST_SLOPE: (s.accel_error / s.gravity) ** 2,
    }
    for place, value in values.items():
        par[place] = value
    return par, size

"""What is known of a whole run once it has been reduced: for its file, its report and the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from inclinometry.attitude.orientation import SWITCH
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import InputError
from inclinometry.motion.result import BITS


@dataclass(frozen=True, eq=False)
class AttitudeRows:
    """Windows (k,) of a run in order of time; angles and rates are NaN where refused or unknown.

    time : s, the instant a row is valid for.
    inclination, azimuth, toolface : rad.
    u_inclination, u_azimuth, u_toolface : standard uncertainties, rad, site and calibration included.
    rate : mean rotation speed, rad/s, positive clockwise looking down hole.
    quality : 0 to 1, as `Attitude.quality`.
    flags : bits of `FLAGS`.
    method : places in `METHODS`.
    quaternion : (k, 4), scalar first, of the rotation from north-east-down to tool components, north that of the
        azimuth: v_tool = q v_ned q*; it has no singularity at the vertical. NaN where azimuth + toolface is not known.
    magnetic_toolface, u_magnetic_toolface : azimuth + toolface and its standard uncertainty, rad, from magnetic north
        whatever the azimuth is counted from; of a gyro's rows from true north (gyro toolface).
    north : what azimuth is counted from, places in `inclinometry.earth.site.REFERENCES`.
    """

    time: Array
    inclination: Array
    azimuth: Array
    toolface: Array
    u_inclination: Array
    u_azimuth: Array
    u_toolface: Array
    rate: Array
    quality: Array
    flags: NDArray[np.uint32]
    method: NDArray[np.uint8]
    north: NDArray[np.uint8]
    quaternion: Array
    magnetic_toolface: Array
    u_magnetic_toolface: Array

    def __post_init__(self) -> None:
        for each in fields(self):
            shape = getattr(self, each.name).shape
            wanted = (len(self.time), 4) if each.name == "quaternion" else self.time.shape
            if shape != wanted:
                raise InputError(f"{each.name} has shape {shape}; expected {wanted}")

    def __len__(self) -> int:
        return len(self.time)

    @property
    def refused(self) -> Mask:
        """Rows (k,) without an attitude."""
        return np.isnan(self.inclination)

    def steep(self, switch: float) -> Mask:
        """Rows (k,) of an inclination below the switch, rad: steered by the magnetic toolface."""
        return np.asarray(self.inclination < switch)

    def names(self, row: int) -> tuple[str, ...]:
        """Names of the flags of one row."""
        return tuple(name for name, bit in BITS.items() if int(self.flags[row]) & bit)

    def count(self, flag: str) -> int:
        """Rows that carry a flag."""
        return int(np.count_nonzero(self.flags & np.uint32(BITS[flag])))


@dataclass(frozen=True, eq=False)
class Vibration:
    """How the tool shook and turned, one row (v,) a window; NaN where the channels for it are absent.

    time : s, middle of the window.
    lateral : rms of one transverse component once its mean and the turning gravity are taken off, m/s^2.
    axial : rms along the tool, m/s^2.
    peak : largest magnitude of what is left in any direction, m/s^2.
    slowest, mean, fastest : rotation speed, averaged over 0.1 s, rad/s.
    """

    time: Array
    lateral: Array
    axial: Array
    peak: Array
    slowest: Array
    mean: Array
    fastest: Array

    def __len__(self) -> int:
        return len(self.time)

    @property
    def stick_slip(self) -> Array:
        """Stick-slip index (v,): half the spread of the rotation speed over its mean; NaN below 1 rpm.

        Notes
        -----
        (fastest - slowest) / (2 mean); 0 for steady rotation, 1 where the tool stops once a cycle.
        """
        turning = np.abs(self.mean) > 2.0 * np.pi / 60.0
        return np.where(turning, (self.fastest - self.slowest) / (2.0 * np.where(turning, np.abs(self.mean), 1.0)),
                        np.nan)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Envelope:
    """A channel over the whole run: lowest, mean and highest value in each of (e,) equal stretches of time.

    name : the channel, e.g. "accel_x"; `unit` its unit, e.g. "m/s^2".
    time : s, middle of each stretch.
    """

    name: str
    unit: str
    time: Array
    low: Array
    mean: Array
    high: Array


@dataclass(frozen=True, eq=False)
class Excerpt:
    """Samples as they came: channel -> (n,) values at time (n,) s.

    what : what it shows, e.g. "first seconds", "strongest vibration".
    units : channel -> unit.
    """

    what: str
    time: Array
    channels: Mapping[str, Array]
    units: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Spectrogram:
    """Power spectral density (s, f) of an acceleration over time; NaN where there are no samples.

    what : what it is of, e.g. "lateral acceleration".
    time : (s + 1,) edges of the stretches, s.
    frequency : (f,) Hz.
    density : (s, f) one-sided, m^2/s^4/Hz.
    """

    what: str
    time: Array
    frequency: Array
    density: Array


@dataclass(frozen=True)
class RunCounts:
    """Sizes of a run.

    samples, missing : rows read; rows of which a channel was missing, clipped or repeated.
    start, stop : first and last time, s.
    interval : usual sampling interval, s.
    stretches : pieces sampled without a gap.
    """

    samples: int
    missing: int
    start: float
    stop: float
    interval: float
    stretches: int


@dataclass(frozen=True, eq=False)
class DynamicRun:
    """A reduced run.

    rows : attitude, one row a window.
    vibration : how the tool shook and turned.
    envelopes, excerpts, spectrogram : the channels, thinned; spectrogram None without an accelerometer.
    counts : sizes.
    method : what was asked for, a key of `workflow.dynamic_methods.METHODS`.
    window : length wanted of a window, s.
    north : what azimuths are to be counted from; single rows say it of themselves.
    notes : sentences for the user.
    inputs : name -> digest.
    tool : name of the calibrated tool, "" without a calibration.
    switch : rad, inclination below which rows are steered by the magnetic toolface.
    """

    rows: AttitudeRows
    vibration: Vibration
    envelopes: tuple[Envelope, ...]
    excerpts: tuple[Excerpt, ...]
    spectrogram: Spectrogram | None
    counts: RunCounts
    method: str
    window: float
    north: str
    notes: tuple[str, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    tool: str = ""
    switch: float = SWITCH

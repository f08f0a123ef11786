"""What every method of the motion package takes and returns: samples; attitude with covariance, quality and flags."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, Mask, finite, increasing
from inclinometry.constants import ANGLES, FIELD_UNITS, KIND_PREFIX, RPM
from inclinometry.earth.site import REFERENCES
from inclinometry.errors import out_of_range, refused, wrong_shape
from inclinometry.findings import Finding, Severity, Value
from inclinometry.orientation import SWITCH, Angles, angles
from inclinometry.rotations import dcm_from_quaternion
from inclinometry.tabular import Column, Tabular, channel_columns, degrees, draw, in_degrees
from inclinometry.uncertainty import UNKNOWN


class Fault(NamedTuple):
    """What a check found in a window: code and values of the `Finding` that counts such windows over a run.

    flag : a name of `FLAGS`.
    where : channel or triads, e.g. "accel_x", "mag".
    refuse : whether a method that needs `where` must not use the window.
    """

    code: str
    values: Mapping[str, Value]
    flag: str
    where: str
    refuse: bool

    def counted(self, windows: int, total: int) -> Finding:
        """The finding of a run with such windows; that it has no magnetometer is no news to its user."""
        severity: Severity = "warning" if self.refuse and self.code != "motion-no-magnetometer" else "note"
        return Finding(self.code, {**self.values, "windows": windows, "total": total}, severity=severity)


def distinct(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings in their order, each once."""
    kept: list[Finding] = []
    for one in found:
        kept += [] if one in kept else [one]
    return tuple(kept)


CHANNELS: Final = ("accel", "mag", "gyro")
MOST_JITTER: Final = 0.5
"""Departure of a stamp from the even grid, in intervals, that still counts as even: stamps are rounded and jitter."""
LARGEST_BREAK: Final = 2.0 * MOST_JITTER - 1e-3
"""The same of a block's first stamp from the grid of the block before, beyond which it is a gap: both may jitter."""


@dataclass(frozen=True, eq=False, repr=False)
class Samples(Tabular):
    """An evenly sampled stretch of a run: a block of a stream or a whole record.

    Parameters
    ----------
    time : (n,) array_like
        s, at equal intervals (`interval`) within the jitter of the stamps.
    interval : float
        s, of the even grid; the methods use it and the first stamp, not the differences of stamps.
    accel : (n, 3) array_like, optional
        Apparent gravity in tool axes, m/s^2: gravity minus acceleration, i.e. minus the specific force.
    mag : (n, 3) array_like, optional
        Magnetic flux density, nT.
    gyro : (n, 3) array_like, optional
        Rotation rate of the tool against inertial space, rad/s; about z positive is clockwise looking down hole.
    temperature : (n,) array_like, optional
        degC.
    clipped : (n,) array_like of bool, optional
        Samples of which a channel stood at the end of its range or was missing: never used, but they keep their place.

    Raises
    ------
    InputError
        Shapes that differ, values that are not finite, stamps off the even grid, no triad at all.

    Examples
    --------
    >>> block = Samples([0.0, 0.01, 0.02], 0.01, accel=[[0.0, 0.0, 9.81]] * 3)
    >>> len(block), block.has("mag")
    (3, False)
    """

    time: Array
    interval: float
    accel: Array | None = None
    mag: Array | None = None
    gyro: Array | None = None
    temperature: Array | None = None
    clipped: Mask | None = None

    def __post_init__(self) -> None:
        time = finite(self.time, "time", (None,))
        if not (self.interval > 0.0 and np.isfinite(self.interval)):
            raise out_of_range("interval", float(self.interval), "> 0")
        object.__setattr__(self, "time", time)
        if all(getattr(self, name) is None for name in CHANNELS):
            raise refused("input-triads", {"lacking": CHANNELS, "needed": CHANNELS})
        self._take("accel", (3,))
        self._take("mag", (3,))
        self._take("gyro", (3,))
        self._take("temperature", ())
        if self.clipped is not None:
            object.__setattr__(self, "clipped", np.asarray(self.clipped, dtype=np.bool_))
            if self.clipped.shape != time.shape:
                raise wrong_shape("clipped", self.clipped.shape, str(time.shape))
        if time.size:
            # rounding of the stamps themselves: a long run counts seconds in large numbers
            slack = MOST_JITTER * self.interval + 4.0 * float(np.spacing(np.abs(time).max()))
            off = np.abs(time - (time[0] + self.interval * np.arange(time.size)))
            if off.max() > slack:
                worst = int(np.argmax(off > slack))
                values = {"row": worst, "time_s": float(time[worst]), "off": float(off[worst] / self.interval)}
                raise refused("input-uneven", values)

    def _take(self, name: str, trailing: tuple[int, ...]) -> None:
        value: ArrayLike | None = getattr(self, name)
        if value is None:
            return
        array = np.ascontiguousarray(finite(value, name, trailing or None))
        if array.shape != (self.time.size, *trailing):
            raise wrong_shape(name, array.shape, str((self.time.size, *trailing)))
        object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.time)

    def has(self, name: str) -> bool:
        """Whether the triad is there: "accel", "mag" or "gyro"."""
        return getattr(self, name) is not None

    def need(self, *names: str) -> None:
        """Refuse samples that lack one of these triads."""
        if lacking := tuple(name for name in names if not self.has(name)):
            raise refused("input-triads", {"lacking": lacking, "needed": names})

    def part(self, start: int, stop: int) -> Samples:
        """Samples start to stop - 1, not copied.

        Examples
        --------
        >>> len(Samples([0.0, 0.5, 1.0], 0.5, gyro=[[0.0, 0.0, 1.0]] * 3).part(1, 3))
        2
        """
        # not checked again: a part of an even stretch is even, but its own first stamp may jitter the other way
        cut = object.__new__(Samples)
        object.__setattr__(cut, "interval", self.interval)
        for name in ("time", *CHANNELS, "temperature", "clipped"):
            value = getattr(self, name)
            object.__setattr__(cut, name, None if value is None else value[start:stop])
        return cut

    def to_dict(self) -> dict[str, Column]:
        """One row a sample: time, the channels of the triads there are, temperature."""
        triads = {kind: getattr(self, prefix) for kind, prefix in KIND_PREFIX.items() if self.has(prefix)}
        found: dict[str, Column] = {"time_s": self.time, **channel_columns(triads, FIELD_UNITS)}
        return found | ({} if self.temperature is None else {"temperature_degC": self.temperature})


METHODS: Final = (
    "static",  # mean gravity and field of a tool at rest
    "quaternion",  # the same by Davenport's q: both weighted
    "magnetic",  # de-rotated by the magnetic phase
    "mean",  # plain mean in the de-rotated frame
    "gyro",  # strapdown quaternion, gravity and Earth rate
    "filter",  # 15-state filter with gravity and field
    "robust",  # robust adaptive filter of windows
    "smoother",  # backward pass
    "survey",  # gyro-only continuous survey closed at two stations
)
"""Names of the methods; `Attitude.method` holds places in this list."""

FLAGS: Final = {
    "clipped": "a channel stood at the end of its range; a mean of clipped samples is biased",
    "stuck": "a channel did not change while the others did",
    "gap": "samples are missing",
    "aliased": "sampled too slowly for the rotation: the phase between samples is ambiguous",
    "no-field": "no usable magnetic field: inside casing, disturbed, or no magnetometer",
    "little-arc": "the tool turned too little for the centre of the magnetic circle to be seen",
    "offset": "transverse magnetic offsets were not removed: too little arc, and no calibration states them",
    "disturbed": "the strength or dip of the field is off its reference or changes",
    "vibration": "vibration so strong that its mean no longer vanishes within the uncertainty wanted",
    "not-still": "the tool moved in a window treated as still",
    "step": "magnetometer and accelerometer are out of step in time",
    "axes": "the magnetometer's and accelerometer's axes contradict each other: a wrong axis map",
    "misfit": "gravity, field and rate contradict each other beyond their uncertainty: a scale, clock or axis is off",
    "start": "the filter had not settled",
    "drift": "azimuth rests on the gyro alone since its last update; its uncertainty grows",
    "vertical": "azimuth and toolface are hardly defined; use azimuth + toolface",
    "unobservable": "nothing in the data determines the azimuth",
    "whirl": "the tool circles in the hole: an axis that leans as it does shifts the mean of gravity",
}
"""What a flag means; bit k of `Attitude.flags` is the k-th name."""

BITS: Final = {name: 1 << place for place, name in enumerate(FLAGS)}


@dataclass(frozen=True, eq=False, repr=False)
class Attitude(Tabular):
    """Attitude of a moving tool, one row a window (k)."""

    time: Array  #: s, the instant the row's attitude is valid for; strictly increasing
    # (k, 4) scalar first, of the rotation from north-east-down to tool components, `quaternion_from_dcm(dcm(A, I, T))`;
    # NaN in a row that was refused
    quaternion: Array
    # (k, 3, 3) of the small rotation vector e in tool axes, rad^2: dcm = (1 + [e x]) true dcm. NaN where refused; a
    # direction about which nothing is known has the square of `UNKNOWN` as variance or more, never infinity
    covariance: Array
    # mean rotation speed about the tool axis, rad/s, positive clockwise looking down hole; NaN where unknown
    rate: Array
    # 1 far inside all limits of the method, 0 at one of them or refused: the least of clip(1 - value / limit, 0, 1)
    quality: Array
    flags: NDArray[np.uint32]  #: bits of `FLAGS`; `names` lists them
    method: NDArray[np.uint8]  #: places in `METHODS`
    north: str  #: "magnetic", "true" or "grid": what azimuth is counted from
    findings: tuple[Finding, ...] = ()  #: what was chosen and why, what was found and removed
    # (k, 3, 3) the part of the covariance by errors that all rows of the run share (offsets, scales, lags): it does not
    # average out. All of it where a method does not separate it
    common: Array = None  # type: ignore[assignment]  # told in __post_init__

    def __post_init__(self) -> None:
        if vars(self)["common"] is None:
            object.__setattr__(self, "common", self.covariance)
        size = len(self.time)
        wanted = {"quaternion": (size, 4), "covariance": (size, 3, 3), "common": (size, 3, 3)}
        for each in fields(self):
            if each.name in ("time", "north", "findings"):
                continue
            shape = wanted.get(each.name, (size,))
            if getattr(self, each.name).shape != shape:
                raise wrong_shape(each.name, getattr(self, each.name).shape, str(shape))

    def __len__(self) -> int:
        return len(self.time)

    @property
    def refused(self) -> NDArray[np.bool_]:
        """Rows (k,) without an attitude; their flags say why."""
        return np.asarray(np.isnan(self.quaternion[:, 0]))

    @property
    def angles(self) -> Angles:
        """Inclination, azimuth, toolface and azimuth + toolface (k,), rad; NaN where refused."""
        good = ~self.refused
        matrix = dcm_from_quaternion(self.quaternion[good])
        found = angles(matrix[:, :, 2], matrix[:, :, 0]) if good.any() else ()
        columns = [np.full(len(self), np.nan) for _ in Angles._fields]
        for column, values in zip(columns, found, strict=False):
            column[good] = values
        return Angles(*columns)

    @property
    def u(self) -> Angles:
        """Standard uncertainty (k,) of the `angles`, rad; never more than that of an angle nothing is known of."""
        return self._spread(self.covariance)

    @property
    def u_common(self) -> Angles:
        """The part of `u` (k,) that all rows of the run share, rad."""
        return Angles(*map(np.minimum, self._spread(self.common), self.u))

    def _spread(self, covariance: Array) -> Angles:
        """Standard deviations (k,) of the angles by the rotation vector's covariance (k, 3, 3)."""
        good = ~self.refused
        columns = [np.full(len(self), np.nan) for _ in Angles._fields]
        if good.any():
            rows = angle_rows(self.quaternion[good])
            variance = np.einsum("kai,kij,kaj->ka", rows, covariance[good], rows)
            spread = np.minimum(np.sqrt(np.where(np.isfinite(variance), np.maximum(variance, 0.0), np.inf)), UNKNOWN)
            for place, column in enumerate(columns):
                column[good] = spread[:, place]
        return Angles(*columns)

    def names(self, row: int) -> tuple[str, ...]:
        """Names of the flags of one row."""
        return tuple(name for name, bit in BITS.items() if int(self.flags[row]) & bit)

    def to_dict(self) -> dict[str, Column]:
        """One row a window: time, angles, their standard uncertainties, speed, quality, method and flags."""
        found: dict[str, Column] = {"time_s": self.time}
        for start, three in (("", self.angles), ("u_", self.u)):
            found |= {f"{start}{name}_deg": degrees(getattr(three, name)) for name in ANGLES}
        return found | _judged_columns(self)

    def plot(self, ax: Any = None) -> Any:
        """Inclination, azimuth and toolface by time on matplotlib axes, which are returned."""
        lines = {name: (self.time, np.degrees(getattr(self.angles, name))) for name in ANGLES}
        return draw(ax, lines, "time, s", f"angle, deg (azimuth from {self.north} north)", ".")


def angle_rows(quaternion: ArrayLike) -> Array:
    """Derivatives (k, 4, 3) of inclination, azimuth, toolface and azimuth + toolface by the rotation vector e.

    dcm = (1 + [e x]) true dcm; with h = (-cos T, sin T, 0) and n = (sin T, cos T, 0):

        dI = -n.e,  dA = -h.e / sin I,  dT = -e_z + cot I h.e,  d(A + T) = -e_z - tan(I/2) h.e.
    """
    matrix = dcm_from_quaternion(finite(quaternion, "quaternion", (4,)))
    down = matrix[:, :, 2]
    sine = np.hypot(down[:, 0], down[:, 1])
    plumb = sine < 1e-12
    safe = np.where(plumb, 1.0, sine)
    h = np.stack(
        [np.where(plumb, -1.0, down[:, 0] / safe), np.where(plumb, 0.0, down[:, 1] / safe), 0.0 * sine], axis=1
    )
    n = np.stack([h[:, 1], -h[:, 0], 0.0 * sine], axis=1)
    z = np.broadcast_to([0.0, 0.0, 1.0], h.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        upright = down[:, 2] > 0.0
        half = np.where(upright, sine / (1.0 + np.where(upright, down[:, 2], 0.0)), (1.0 - down[:, 2]) / sine)[:, None]
        by_azimuth = np.where(plumb[:, None], np.inf, -h / np.where(plumb, 1.0, sine)[:, None])
        by_toolface = np.where(plumb[:, None], np.inf, -z + (down[:, 2] / safe)[:, None] * h)
    return np.stack([-n, by_azimuth, by_toolface, -z - half * h], axis=1)


def joined(parts: Sequence[Attitude]) -> Attitude:
    """Rows of several results of one run, in order of time; findings that repeat are given once.

    Raises
    ------
    InputError
        Nothing to join, parts that count azimuth from different norths, rows out of order.
    """
    if not parts:
        raise refused("input-few", {"name": "results", "count": 0, "least": 1})
    norths = {part.north for part in parts}
    if len(norths) > 1:
        raise refused("input-north", {"norths": tuple(sorted(norths))})
    columns = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Attitude)
        if field.name not in ("north", "findings")
    }
    time = columns["time"]
    increasing(time, "time")
    findings = distinct(one for part in parts for one in part.findings)
    return Attitude(**columns, north=parts[0].north, findings=findings)


def refusals(time: ArrayLike, names: Sequence[str], method: str, north: str) -> Attitude:
    """Rows without an attitude at the times (k,), all for the same reasons."""
    at = finite(time, "time", (None,))
    size = len(at)
    bits = sum(BITS[name] for name in names)
    return Attitude(
        time=at,
        quaternion=np.full((size, 4), np.nan),
        covariance=np.full((size, 3, 3), np.nan),
        rate=np.full(size, np.nan),
        quality=np.zeros(size),
        flags=np.full(size, bits, dtype=np.uint32),
        method=np.full(size, METHODS.index(method), dtype=np.uint8),
        north=north,
    )


def _judged_columns(rows: Attitude | AttitudeRows) -> dict[str, Column]:
    """Speed, quality, method and flags of the rows."""
    names = {code: "|".join(n for n, bit in BITS.items() if code & bit) for code in set(rows.flags.tolist())}
    return {
        "rpm": rows.rate * RPM,
        "quality": rows.quality,
        "method": [METHODS[place] for place in rows.method],
        "flags": [names[code] for code in rows.flags.tolist()],
    }


# What is known of a whole run once it has been reduced: for its file, its report and the terminal.


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeRows(Tabular):
    """Windows (k,) of a run in order of time; angles, rad, and rates are NaN where refused or unknown."""

    time: Array  #: s, the instant a row is valid for
    inclination: Array
    azimuth: Array
    toolface: Array
    # u_inclination, u_azimuth, u_toolface: standard uncertainties, rad, site and calibration included
    u_inclination: Array
    u_azimuth: Array
    u_toolface: Array
    rate: Array  #: mean rotation speed, rad/s, positive clockwise looking down hole
    quality: Array  #: 0 to 1, as `Attitude.quality`
    flags: NDArray[np.uint32]  #: bits of `FLAGS`
    method: NDArray[np.uint8]  #: places in `METHODS`
    north: NDArray[np.uint8]  #: what azimuth is counted from, places in `inclinometry.earth.site.REFERENCES`
    # (k, 4), scalar first, of the rotation from north-east-down to tool components, north that of the azimuth:
    # v_tool = q v_ned q*; it has no singularity at the vertical. NaN where azimuth + toolface is not known
    quaternion: Array
    # magnetic_toolface, u_magnetic_toolface: azimuth + toolface and its standard uncertainty, rad, from magnetic north
    # whatever the azimuth is counted from; of a gyro's rows from true north (gyro toolface)
    magnetic_toolface: Array
    u_magnetic_toolface: Array
    # u_common_*: the part of the uncertainty, rad, by errors that all rows share (offsets, scales, lags, site): it does
    # not average out. All of it where a method does not separate it
    u_common_inclination: Array = None  # type: ignore[assignment]  # told in __post_init__
    u_common_azimuth: Array = None  # type: ignore[assignment]
    u_common_toolface: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for name in ANGLES:
            if getattr(self, f"u_common_{name}") is None:
                object.__setattr__(self, f"u_common_{name}", getattr(self, f"u_{name}"))
        for each in fields(self):
            shape = getattr(self, each.name).shape
            wanted = (len(self.time), 4) if each.name == "quaternion" else self.time.shape
            if shape != wanted:
                raise wrong_shape(each.name, shape, str(wanted))

    def __len__(self) -> int:
        return len(self.time)

    @property
    def refused(self) -> Mask:
        """Rows (k,) without an attitude."""
        return np.isnan(self.inclination)

    @property
    def u_random_inclination(self) -> Array:
        """The part (k,) of `u_inclination` that is the window's own, rad: it averages out."""
        return self._own("inclination")

    @property
    def u_random_azimuth(self) -> Array:
        """The same of the azimuth."""
        return self._own("azimuth")

    @property
    def u_random_toolface(self) -> Array:
        """The same of the toolface."""
        return self._own("toolface")

    def _own(self, name: str) -> Array:
        whole, common = getattr(self, f"u_{name}"), getattr(self, f"u_common_{name}")
        return np.asarray(np.sqrt(np.maximum(whole**2 - common**2, 0.0)))

    def steep(self, switch: float) -> Mask:
        """Rows (k,) of an inclination below the switch, rad: steered by the magnetic toolface."""
        return np.asarray(self.inclination < switch)

    def names(self, row: int) -> tuple[str, ...]:
        """Names of the flags of one row."""
        return tuple(name for name, bit in BITS.items() if int(self.flags[row]) & bit)

    def count(self, flag: str) -> int:
        """Rows that carry a flag."""
        return int(np.count_nonzero(self.flags & np.uint32(BITS[flag])))

    def to_dict(self) -> dict[str, Column]:
        """One row a window: time, angles, their standard uncertainties, speed, quality, method and flags."""
        angles = in_degrees(self, *ANGLES, *(f"u_{name}" for name in ANGLES), *(f"u_common_{name}" for name in ANGLES))
        found: dict[str, Column] = {"time_s": self.time, **angles, **_judged_columns(self)}
        return found | {"azimuth_reference": [REFERENCES[place] for place in self.north]}

    def plot(self, ax: Any = None) -> Any:
        """Inclination, azimuth and toolface by time on matplotlib axes, which are returned."""
        lines = {name: (self.time, np.degrees(getattr(self, name))) for name in ANGLES}
        return draw(ax, lines, "time, s", "angle, deg", ".")


@dataclass(frozen=True, eq=False, repr=False)
class Vibration(Tabular):
    """How the tool shook and turned, one row (v,) a window; NaN where the channels for it are absent."""

    time: Array  #: s, middle of the window
    lateral: Array  #: rms of one transverse component without its mean and the turning gravity, m/s^2
    axial: Array  #: rms along the tool, m/s^2
    peak: Array  #: largest magnitude of the rest in any direction, m/s^2
    # slowest, mean, fastest: rotation speed, averaged over 0.1 s, rad/s
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

    def to_dict(self) -> dict[str, Column]:
        """One row a window: rms and peak of the vibration, rotation speeds, stick-slip index."""
        found: dict[str, Column] = {"time_s": self.time}
        found |= {f"{name}_m_s2": getattr(self, name) for name in ("lateral", "axial", "peak")}
        found |= {f"{name}_rpm": getattr(self, name) * RPM for name in ("slowest", "mean", "fastest")}
        return found | {"stick_slip": self.stick_slip}


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


@dataclass(frozen=True, eq=False, repr=False)
class DynamicRun(Tabular):
    """A reduced run."""

    rows: AttitudeRows  #: attitude, one row a window
    vibration: Vibration
    # envelopes, excerpts, spectrogram: the channels, thinned; spectrogram None without an accelerometer
    envelopes: tuple[Envelope, ...]
    excerpts: tuple[Excerpt, ...]
    spectrogram: Spectrogram | None
    counts: RunCounts
    method: str  #: as asked for, a key of `workflow.dynamic_methods.METHODS`
    window: float  #: wanted length of a window, s
    north: str  #: what azimuths are to be counted from; single rows have their own
    inputs: Mapping[str, str] = field(default_factory=dict)  #: name -> digest
    tool: str = ""  #: name of the calibrated tool, "" without a calibration
    switch: float = SWITCH  #: rad, inclination below which rows are steered by the magnetic toolface
    findings: tuple[Finding, ...] = ()  #: of site, columns, stamps, sensors, windows and methods

    def to_dict(self) -> dict[str, Column]:
        """One row a window, as `rows`."""
        return self.rows.to_dict()

    def plot(self, ax: Any = None) -> Any:
        """Inclination, azimuth and toolface by time on matplotlib axes, which are returned."""
        return self.rows.plot(ax)

"""Bench readings: what the rig was set to and what the sensors said, one row a station."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Index, finite, frozen, not_degrees, within
from inclinometry.calibration.result import readings_text
from inclinometry.constants import DIALS, KINDS
from inclinometry.digest import digest_bytes
from inclinometry.errors import not_among, out_of_range, refused, wrong_shape
from inclinometry.findings import Finding
from inclinometry.tabular import Column, Tabular, channel_columns, draw, in_degrees

LARGEST = 1e15
"""No reading may be larger: from here on squares and sums of readings lose the digits a calibration needs."""


@dataclass(frozen=True, eq=False, repr=False)
class BenchReadings(Tabular):
    """One row a station; angles in radians, signals in whatever unit the tool reports.

    Parameters
    ----------
    channels : mapping of kind to (K, m) array_like
        Signals of each triad; kinds are "accelerometer", "magnetometer", "gyro".
    azimuth, inclination, toolface : (K,) array_like, optional
        Rig settings as dialled, rad. All three, or none for a field calibration.
    station : sequence of str, optional
        Names of the stations. Default: "1".."K".
    sd : mapping of kind to (K, m) array_like
        Standard deviation of the values in `channels` (of the mean, where several readings were averaged).
    count : (K,) array_like, optional
        How many readings each row is the mean of.
    temperature : (K,) array_like, optional
        degC.
    roll_set : sequence of str, optional
        Stations with the same non-empty name were taken at one inclination and azimuth, rolled about the tool axis.
    units : mapping of kind to str
        Unit of the signals. Default: "counts".
    reference : mapping
        What is known of the fields at the stand, constants over the run: "g" (m/s^2), "b" (nT), "dip",
        "latitude" and "north", the azimuth of the rig's zero from magnetic north (rad).
    findings : tuple of Finding
        What the reader did that belongs into the record, as notes (averaged repeats, still intervals of a log), and
        what may be wrong with the readings (saturated channel, column not used).
    step : mapping of kind to float or (m,) array_like
        Step of the converter, in the unit of the signals; 0 for none. What is not given is found channel by channel
        where the readings clearly lie on a grid, see `converter_steps`.
    digest : str, optional
        SHA-256 of the source file, or of the arrays when built in memory.
    counted : sequence of str
        How the dials themselves count, where azimuth, inclination and toolface were converted from them: the fields of
        `inclinometry.calibration.conventions.Dials`, which sets it.
    serial : str
        Serial number of the tool, where the readings state it.
    off_stand : BenchReadings, optional
        Readings of the same tool in attitudes away from the stand, without rig settings.

    Raises
    ------
    InputError
        Shapes that do not go together, values that are not finite or beyond 1e15, unknown kinds, angles that look
        like degrees.
    """

    channels: Mapping[str, Array]
    azimuth: Array | None = None
    inclination: Array | None = None
    toolface: Array | None = None
    station: Sequence[str] = ()
    sd: Mapping[str, Array] = field(default_factory=dict)
    count: Array | None = None
    temperature: Array | None = None
    roll_set: Sequence[str] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    reference: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    digest: str = ""
    step: Mapping[str, ArrayLike] = field(default_factory=dict)
    counted: Sequence[str] = ()
    serial: str = ""
    off_stand: BenchReadings | None = None

    def __post_init__(self) -> None:
        if not self.channels or set(self.channels) - set(KINDS):
            raise not_among("channels", ", ".join(sorted(self.channels)), KINDS)
        given = {k: finite(self.channels[k], k, (None, None)) for k in KINDS if k in self.channels}
        channels = {k: frozen(within(values, k, -LARGEST, LARGEST)) for k, values in given.items()}
        size = len(next(iter(channels.values())))
        for kind, values in channels.items():
            if values.ndim != 2 or len(values) != size:
                raise wrong_shape(kind, values.shape, f"({size}, m)")
        put = object.__setattr__
        put(self, "channels", MappingProxyType(channels))
        for name in ("azimuth", "inclination", "toolface", "temperature", "count"):
            value = getattr(self, name)
            if value is not None:
                put(self, name, frozen(finite(value, name, (size,))))
        lacking = tuple(name for name in DIALS if getattr(self, name) is None)
        if 0 < len(lacking) < 3:
            raise refused("input-missing", {"names": lacking})
        if self.inclination is not None:
            not_degrees(self.inclination, "inclination")
        sd = {k: _spread(v, k, channels[k].shape) for k, v in self.sd.items() if k in channels}
        if self.count is not None and (self.count < 1.0).any():
            raise out_of_range("count", float(self.count.min()), ">= 1")
        put(self, "sd", MappingProxyType({k: frozen(v) for k, v in sd.items()}))
        put(self, "station", tuple(self.station) or tuple(str(i + 1) for i in range(size)))
        put(self, "roll_set", tuple(self.roll_set))
        for name, names in (("station", self.station), ("roll_set", self.roll_set)):
            if names and len(names) != size:
                raise wrong_shape(name, (len(names),), f"({size},)")
        put(self, "step", MappingProxyType({k: frozen(_step(k, v, self.step.get(k))) for k, v in channels.items()}))
        put(self, "units", MappingProxyType({k: self.units.get(k, "counts") for k in channels}))
        put(self, "reference", MappingProxyType(dict(self.reference)))
        put(self, "findings", tuple(self.findings))
        if not self.digest:
            put(self, "digest", digest_bytes(b"".join(v.tobytes() for v in self._arrays())))

    def _arrays(self) -> list[Array]:
        dials = [v for v in (self.azimuth, self.inclination, self.toolface, self.temperature) if v is not None]
        return [*self.channels.values(), *dials]

    def __repr__(self) -> str:
        return readings_text(self)

    def __len__(self) -> int:
        return len(self.station)

    @property
    def dials(self) -> tuple[Array, Array, Array]:
        """Azimuth, inclination, toolface as dialled, rad; an error when the readings have none."""
        if self.azimuth is None or self.inclination is None or self.toolface is None:
            raise refused("bench-no-angles")
        return self.azimuth, self.inclination, self.toolface

    def take(self, rows: Sequence[int] | Index) -> BenchReadings:
        """The readings at the given rows, in that order; the digest stays that of the source."""
        index = np.asarray(rows, dtype=int)

        def pick(values: Array | None) -> Array | None:
            return None if values is None else values[index]

        return BenchReadings(
            {k: v[index] for k, v in self.channels.items()},
            pick(self.azimuth),
            pick(self.inclination),
            pick(self.toolface),
            [self.station[i] for i in index],
            {k: v[index] for k, v in self.sd.items()},
            pick(self.count),
            pick(self.temperature),
            [self.roll_set[i] for i in index] if self.roll_set else (),
            self.units,
            self.reference,
            self.findings,
            self.digest,
            self.step,
            self.counted,
            self.serial,
            self.off_stand,
        )

    def rounding(self, kind: str) -> Array:
        """Least standard deviation (K, m) that a reading can have, given the step of the converter.

        Rounding is step / sqrt(12). Where k stations of a channel read the same, its rounding was the same: their mean
        is no better than one of them, so that each counts as sqrt(k) times as uncertain.
        """
        step, values = np.asarray(self.step[kind]), self.channels[kind]
        # not compared to the last bit: a stated step may be one the file could not print exactly
        codes = np.round((values - values.min(axis=0)) / np.where(step > 0.0, step, 1.0))
        equal = np.empty(codes.shape)
        for sensor, column in enumerate(codes.T):
            _, which, counts = np.unique(column, return_inverse=True, return_counts=True)
            equal[:, sensor] = counts[which]
        return np.asarray(step * np.sqrt(equal / 12.0))

    def to_dict(self) -> dict[str, Column]:
        """One row a station: settings, temperature, count and channels, under the names they have in a file."""
        found: dict[str, Column] = {"station": list(self.station)}
        if self.azimuth is not None:
            found |= in_degrees(self, *DIALS)
        if self.temperature is not None:
            found["temperature_degC"] = self.temperature
        if self.count is not None:
            found["count"] = self.count
        if self.roll_set:
            found["roll_set"] = list(self.roll_set)
        return found | channel_columns(self.channels, self.units)

    def plot(self, ax: Any = None, kind: str | None = None) -> Any:
        """Signals of one triad, the first where none is named, by station on matplotlib axes, which are returned."""
        kind = kind or next(iter(self.channels))
        if kind not in self.channels:
            raise not_among("kind", kind, self.channels)
        columns = channel_columns({kind: self.channels[kind]}, {})
        number = np.arange(1, len(self) + 1)
        lines = {name: (number, column) for name, column in columns.items()}
        return draw(ax, lines, "station", f"{kind}, {self.units[kind]}", "o-")


def converter_steps(values: Array) -> Array:
    """Step (m,), a power of ten, of a converter or a printed table on which each channel lies; 0 where none shows.

    Channel by channel, so that one in another unit leaves the others theirs; those of one step are judged together.
    """
    steps: Array = np.zeros(values.shape[1])
    for digits in range(10):
        fits = (np.round(values, digits) == values).all(axis=0) & (steps == 0.0)
        alike, step = values[:, fits], 10.0**-digits
        if not fits.any():
            continue
        # steps that readings must span before they are taken for those of a converter
        # different values from which a common step is no coincidence; a perfect tool in the cube shows three
        clear = len(np.unique(alike)) >= 7 and np.ptp(alike, axis=0).max() >= 64 * step
        steps[fits] = step if clear else np.nan
        if steps.all():
            break
    return np.asarray(np.nan_to_num(steps))


def _step(kind: str, values: Array, given: ArrayLike | None) -> Array:
    """The step (m,) of each channel's converter as given, or as the readings show it."""
    if given is None:
        return converter_steps(values)
    step = within(given, f"step.{kind}", 0.0, LARGEST)
    if step.shape not in ((), values.shape[1:]):
        raise wrong_shape(f"step.{kind}", step.shape, str(values.shape[1:]))
    return np.broadcast_to(step, values.shape[1:])


def _spread(value: ArrayLike, kind: str, shape: tuple[int, ...]) -> Array:
    """Standard deviations (K, m), none of them negative."""
    sd = finite(value, f"{kind}.sd")
    if sd.max(initial=0.0) > LARGEST:
        raise out_of_range(f"{kind}.sd", float(sd.max()), f"0 .. {LARGEST:g}")
    if sd.shape not in ((), shape[1:], shape):
        raise wrong_shape(f"{kind}.sd", sd.shape, str(shape))
    if (sd < 0.0).any():
        raise out_of_range(f"{kind}.sd", float(sd.min()), ">= 0")
    return np.broadcast_to(sd, shape)

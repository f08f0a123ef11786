"""Whether the readings of a window can be believed: clipping, stuck channels, sampling, field, axes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Mask, within
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.digits import longest_stretch
from inclinometry.earth.site import Site
from inclinometry.errors import out_of_range
from inclinometry.findings import Finding, Value
from inclinometry.motion.axes import AxesCheck
from inclinometry.motion.decimate import aliasing_faults
from inclinometry.motion.reference import FieldOff, SiteCheck, field_faults, field_off, field_strength
from inclinometry.motion.result import BITS, CHANNELS, Attitude, Fault, Samples
from inclinometry.motion.turning import Turning, find_harmonics, find_turning
from inclinometry.motion.window_filter import bridged
from inclinometry.rotations import wrap_signed

LEAST_RUN: Final = 20
"""Samples of one value from which a channel may be stuck,"""
RELATIVE: Final = 1e-5
"""Movement, of the vectors' length, below which neighbours count as still as well."""


def clipped_samples(values: Array, reach: float | None) -> Mask:
    """Samples (n,) of one channel that stand at the end of its range: a known one, or one that shows by a pile."""
    at = np.zeros(values.size, dtype=np.bool_)
    if reach is not None:
        at |= np.abs(values) >= reach * (1.0 - 1e-3)
    for sign in (1.0, -1.0):
        found = _samples_at_maximum(sign * values)
        if found is not None:
            at |= found
    return at


def _samples_at_maximum(values: Array) -> Mask | None:
    """Samples at the largest value when it is a rail."""
    top = float(values.max())
    at = values == top
    count = int(at.sum())
    # samples at one extreme value from which they may be a rail
    if count < 5 or count == values.size:
        return None
    runs = int(np.count_nonzero(at[1:] & ~at[:-1])) + int(at[0])
    distinct, often = np.unique(values, return_counts=True)
    step = float(np.diff(distinct).min())
    near = int(often[:-1][distinct[:-1] >= top - 1.5 * max(top - distinct[-2], step)].sum())
    # a motion that repeats to the last bit visits every value as often; the other end may be a rail as well
    inner = int(often[1:-1].max(initial=1))
    # steps of the converter: a still tool's noise does not reach so far
    far = top - float(np.median(values)) > 10.0 * step
    # a string that sticks rests at the least speed, which is no rail: ranges are about symmetric
    outer = abs(top) >= 0.8 * abs(float(distinct[0]))
    # three separate visits; a rotating field's own turning points pile by 2.4
    return at if runs >= 3 and count >= 4.0 * max(near, inner, 1) and far and outer else None


def _step(values: Array) -> float:
    """Smallest difference between values that occur: the converter's step, or about nothing."""
    distinct = np.unique(values)
    return float(np.diff(distinct).min()) if distinct.size > 1 else 0.0


def clipping_faults(window: Samples, ranges: Mapping[str, float]) -> tuple[list[Fault], Mask]:
    """Channels that clip, and the samples (n,) at a rail; by the ranges of triads that are known, in their units."""
    found: list[Fault] = []
    marked = np.zeros(len(window), dtype=np.bool_)
    for triad in CHANNELS:
        values = getattr(window, triad)
        if values is None:
            continue
        reach = ranges.get(triad)
        for axis, column in zip("xyz", values.T, strict=True):
            channel, at = f"{triad}_{axis}", clipped_samples(column, reach)
            if at.any():
                found.append(Fault("motion-clipped", {"channel": channel}, "clipped", channel, False))
                marked |= at
            elif reach is not None:
                # least distance of a range from the mean, in standard deviations: of a low-passed channel more was cut
                # off before the filter than is left in it, 12 g under 5 g rms (0.4 deg) still looks like 4
                margin, least = (reach - abs(float(column.mean()))) / max(float(column.std()), 1e-12), 4.5
                if margin < least:
                    found.append(Fault("motion-clipped", {"channel": channel}, "clipped", channel, True))
    return found, marked


def stuck_faults(window: Samples) -> list[Fault]:
    """Channels that kept one value while their neighbours moved too far for that.

    While a transverse channel of amplitude A stays within one step q of its converter, its partner cannot change by
    more than sqrt(8 q A); three times that is asked for. An axial channel has no partner: it is stuck when it never
    changes although the noise of its neighbours is wider than two steps; a gyro's also when the field turned otherwise.
    """
    found = []
    for triad in CHANNELS:
        values = getattr(window, triad)
        if values is None or len(values) < LEAST_RUN:
            continue
        for place, axis in enumerate("xyz"):
            run = longest_stretch(values[:, place])
            if run[1] - run[0] < max(LEAST_RUN, 0.1 * len(values)):
                continue
            if place < 2:
                partner = values[:, 1 - place]
                step = max(_step(partner), _step(values[:, place]))
                moved = float(np.ptp(partner[run[0] : run[1]]))
                alive = bool(
                    moved > max(3.0 * np.sqrt(8.0 * step * _largest(values)), 4.0 * step, RELATIVE * _largest(values))
                )
            elif triad == "gyro" and window.mag is not None:
                alive = _turned_otherwise(values[run[0], 2], window.mag[run[0] : run[1]], window.interval)
            else:
                alive = run[1] - run[0] == len(values) and _axial_alive(values, turning=triad == "mag")
            if alive:
                channel, share = f"{triad}_{axis}", 100.0 * (run[1] - run[0]) / len(values)
                said: dict[str, Value] = {"channel": channel, "share_percent": share}
                found.append(Fault("motion-stuck", said, "stuck", channel, True))
    return found


def held_faults(window: Samples) -> list[Fault]:
    """Rows that repeat all readings of the row before although the tool shakes: a sensor slower than its record."""
    parts = [getattr(window, triad) for triad in CHANNELS if window.has(triad)]
    values = np.concatenate(parts, axis=1)
    same = (values[1:] == values[:-1]).all(axis=1)
    if window.clipped is not None:
        same = same[~window.clipped[1:]]
    share = float(same.mean()) if same.size else 0.0
    most_held = 0.05  # share of rows that may repeat the row before
    if share <= most_held or min(np.unique(column).size for column in parts[0].T) < LEAST_RUN:
        return []
    return [Fault("motion-rows-repeat", {"share_percent": 100.0 * share}, "stuck", "all", False)]


def _turned_otherwise(speed: float, mag: Array, interval: float) -> bool:
    """Whether the field turned by another angle than an axial gyro that always reads `speed`."""
    strength = np.linalg.norm(mag, axis=1)
    # of the strength: scatter up to which the field's angle can be compared with a gyro
    if float(strength.std()) > 0.03 * float(strength.mean()):
        return False
    path = np.cumsum(-wrap_signed(np.diff(np.arctan2(mag[:, 1], mag[:, 0]))))
    otherwise = 4.0  # rad, beside a tenth of the angle: a disturbed field wanders by less
    if abs(path[-1] - speed * interval * path.size) > otherwise + 0.1 * abs(path[-1]):
        return True
    # the right mean speed, but the field turns now faster, now slower
    x = np.arange(path.size) - 0.5 * (path.size - 1)
    uneven = path - path.mean() - x * float(x @ path / max(float(x @ x), 1.0))
    return float(np.ptp(uneven)) > otherwise


def _axial_alive(values: Array, *, turning: bool) -> bool:
    """Whether the neighbours' noise is wider than two of their steps, so that an axial channel must have moved."""
    size = _largest(values)
    for column in values[:, :2].T:
        # fourth differences: a field that turns by phi a sample leaves size phi^4, noise sqrt(70) of its deviation
        noise = float(np.sqrt(np.mean(np.diff(column, 4) ** 2) / 70.0)) if column.size > 4 else 0.0
        phi = float(np.quantile(np.abs(np.diff(column)), 0.99)) / max(size, 1e-12) if turning else 0.0
        if noise > 2.0 * _step(column) + size * phi**4 + RELATIVE * size:
            return True
    return False


def _largest(values: Array) -> float:
    """Largest length of the vectors."""
    return float(np.sqrt(np.einsum("ij,ij->i", values, values).max()))


@dataclass(frozen=True, kw_only=True)
class HealthSettings:
    """What is known of the sensors: ends of ranges, of both signs, in m/s^2, nT and rad/s.

    Without them clipping shows only where samples pile up, not where a filter came after the clipping. `believe_axes`
    takes units, signs and axes as they are.
    """

    accel_range: float | None = None
    mag_range: float | None = None
    gyro_range: float | None = None
    believe_axes: bool = False

    def __post_init__(self) -> None:
        for name in ("accel_range", "mag_range", "gyro_range"):
            value = getattr(self, name)
            if value is not None and not float(within(value, name, 0.0, 1e9)) > 0.0:
                raise out_of_range(name, float(value), "> 0")

    @property
    def ranges(self) -> dict[str, float]:
        """Triad -> end of its range, where known."""
        known = {"accel": self.accel_range, "mag": self.mag_range, "gyro": self.gyro_range}
        return {triad: value for triad, value in known.items() if value is not None}


@dataclass(frozen=True, eq=False)
class WindowHealth:
    """What was found in a window, whose missing samples are predicted and those at the end of a range marked.

    off : the window's field against the site's.
    """

    samples: Samples
    turning: Turning
    faults: tuple[Fault, ...]
    off: FieldOff

    @property
    def flags(self) -> int:
        """Bits of `FLAGS`."""
        return int(sum(BITS[name] for name in {one.flag for one in self.faults}))

    def unusable(self, triad: str) -> bool:
        """Whether a triad must not be used."""
        return any(one.refuse and triad in one.where for one in self.faults)

    def has(self, flag: str) -> bool:
        """Whether a flag was raised."""
        return any(one.flag == flag for one in self.faults)


class HealthCheck:
    """Windows of a run, one after the other, compared with strength and dip of the site; remembers what was found.

    >>> rng = np.random.default_rng(0)
    >>> still = Samples(np.arange(500) / 100.0, 0.01, accel=[0, 0, 9.81] + rng.normal(0, 0.03, (500, 3)))
    >>> [one.code for one in HealthCheck().check(still).faults]
    ['motion-no-magnetometer']
    """

    def __init__(self, settings: HealthSettings | None = None, site: Site | None = None) -> None:
        self._settings = settings or HealthSettings()
        self._site = site
        self._axes = AxesCheck(site)
        self._counts: Counter[tuple[str, str, bool]] = Counter()
        self._first: dict[tuple[str, str, bool], Fault] = {}
        self._windows = 0
        self._site_check = SiteCheck(site)

    def check(self, window: Samples) -> WindowHealth:
        """Faults of the next window; InputError where units, signs or axes contradict each other over several."""
        faults, marked = clipping_faults(window, self._settings.ranges)
        faults += stuck_faults(window) + held_faults(window)
        if share := 0.0 if window.clipped is None else float(window.clipped.mean()):
            faults.append(Fault("motion-samples-missing", {"share_percent": 100.0 * share}, "gap", "all", False))
        faults += _accelerometer_fault(window)
        lame = window.mag is not None and any(one.refuse and one.where.startswith("gyro") for one in faults)
        judged = replace(window, gyro=None) if lame else window
        turning = find_turning(judged)
        aliased = aliasing_faults(turning, window.interval)
        field = field_faults(judged, turning, self._site)
        faults += aliased + field
        strength, scatter, steady = field_strength(judged, self._site)
        found = None if aliased else find_harmonics(judged, turning)
        off = field_off(judged, found, self._site, strength=strength, scatter=scatter)
        # m/s^2, range of the accelerometers at rest: by the means of such windows the site is compared with the field
        if judged.accel is not None and judged.mag is not None and np.ptp(judged.accel, axis=0).max() < 0.5:
            self._site_check.add(judged.accel.mean(axis=0), judged.mag.mean(axis=0), 0.0)
        if not self._settings.believe_axes and not any(
            one.refuse for one in faults if one.flag in ("stuck", "clipped")
        ):
            faults += self._axes.add(judged, turning, found, field_usable=steady, phase_usable=not aliased)
            if steady and not aliased:
                faults += self._axes.against(turning) + self._axes.dip(off)
        self._windows += 1
        self._counts.update({(one.code, one.where, one.refuse) for one in faults})
        for one in faults:
            self._first.setdefault((one.code, one.where, one.refuse), one)
        if marked.any():
            already = np.zeros(len(window), np.bool_) if window.clipped is None else window.clipped
            window = replace(window, clipped=already | marked)
        return WindowHealth(bridged(window), turning, tuple(faults), off)

    def findings(self, besides: tuple[str, ...] = ()) -> tuple[Finding, ...]:
        """Each kind of fault once, with the number of windows, but those of some flags."""
        found = [
            one.counted(self._counts[key], self._windows) for key, one in self._first.items() if one.flag not in besides
        ]
        asked = any(one.code == "motion-dip-axes" for one in found)  # whether the site is the right one
        return (*(() if asked else self._site_check.findings()), *found, *self._axes.findings())


def add_flag_reasons(row: Attitude, health: WindowHealth) -> Attitude:
    """The row with the reason that samples were marked for: missing ones are a gap, not clipped."""
    if health.has("clipped") or not health.has("gap"):
        return row
    clipped = (row.flags & np.uint32(BITS["clipped"])).astype(np.bool_)
    swap = np.uint32(BITS["clipped"] | BITS["gap"])
    return replace(row, flags=np.where(clipped, row.flags ^ swap | np.uint32(BITS["gap"]), row.flags))


def _accelerometer_fault(window: Samples) -> list[Fault]:
    """An accelerometer that does not even feel gravity."""
    if window.accel is None or not len(window):
        return []
    sensed = float(np.sqrt(np.mean(np.sum(window.accel**2, axis=1))))
    least_sensed = 0.5 * STANDARD_GRAVITY  # m/s^2: gravity and shaking together are more
    if sensed >= least_sensed:
        return []
    return [Fault("motion-no-gravity", {"sensed_m_s2": sensed}, "misfit", "accel", True)]

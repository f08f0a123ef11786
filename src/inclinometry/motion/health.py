"""Whether the readings of a window can be believed: clipping, stuck channels, sampling, field, axes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Mask, within
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.motion.axes import AxesCheck
from inclinometry.motion.decimate import aliasing_findings
from inclinometry.motion.reference import FieldOff, SiteCheck, field_findings, field_off, field_strength
from inclinometry.motion.result import BITS, CHANNELS, Attitude, Finding, Samples
from inclinometry.motion.turning import Turning, find_harmonics, find_turning
from inclinometry.rotations import wrap_signed

LEAST_RUN: Final = 20
"""Samples of one value from which a channel may be stuck,"""
RELATIVE: Final = 1e-5
"""Movement, of the vectors' length, below which neighbours count as still as well."""


def rails(values: Array, reach: float | None) -> Mask:
    """Samples (n,) of one channel that stand at the end of its range: a known one, or one that shows by a pile.

    Examples
    --------
    >>> wave = np.sin(np.arange(2000.0)) + 0.1 * np.sin(17.0 * np.arange(2000.0) ** 1.1)
    >>> int(rails(np.clip(wave, -0.8, 0.8), None).sum() - (abs(wave) >= 0.8).sum()), int(rails(wave, None).sum())
    (0, 0)
    """
    at = np.zeros(values.size, dtype=np.bool_)
    if reach is not None:
        at |= np.abs(values) >= reach * (1.0 - 1e-3)
    for sign in (1.0, -1.0):
        found = _pile(sign * values)
        if found is not None:
            at |= found
    return at


def _pile(values: Array) -> Mask | None:
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


def clipping_findings(window: Samples, ranges: Mapping[str, float]) -> tuple[list[Finding], Mask]:
    """Channels that clip, and the samples (n,) at a rail.

    Parameters
    ----------
    window : Samples
    ranges : mapping
        Triad -> end of its range, of both signs, in its unit; absent where it is not known.
    """
    found: list[Finding] = []
    marked = np.zeros(len(window), dtype=np.bool_)
    for triad in CHANNELS:
        values = getattr(window, triad)
        if values is None:
            continue
        reach = ranges.get(triad)
        for axis, column in zip("xyz", values.T, strict=True):
            at = rails(column, reach)
            count = int(at.sum())
            if count:
                share = count / len(window)
                text = f"{triad}_{axis} stood at the end of its range in {100.0 * share:.2g} % of the samples"
                found.append(Finding("clipped", f"{triad}_{axis}", 1.0 + share, False, text))
                marked |= at
            elif reach is not None:
                # least distance of a range from the mean, in standard deviations: of a low-passed channel more was cut
                # off before the filter than is left in it, 12 g under 5 g rms (0.4 deg) still looks like 4
                margin, least = (reach - abs(float(column.mean()))) / max(float(column.std()), 1e-12), 4.5
                if margin < least:
                    text = (
                        f"{triad}_{axis}: the end of its range is {max(margin, 0.0):.1f} standard deviations away; "
                        "samples were cut off before the filter"
                    )
                    found.append(Finding("clipped", f"{triad}_{axis}", least / max(margin, 0.1), True, text))
    return found, marked


def stuck_findings(window: Samples) -> list[Finding]:
    """Channels that kept one value while their neighbours moved too far for that.

    Notes
    -----
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
            # the longest stretch of one value: first and last + 1 sample
            edges = np.flatnonzero(np.diff(values[:, place]) != 0.0) + 1
            starts, stops = np.append(0, edges), np.append(edges, len(values))
            best = int(np.argmax(stops - starts))
            run = int(starts[best]), int(stops[best])
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
                share = (run[1] - run[0]) / len(values)
                text = f"{triad}_{axis} kept one value in {100.0 * share:.0f} % of a window while the others moved"
                found.append(Finding("stuck", f"{triad}_{axis}", 1.0 + share, True, text))
    return found


def held_findings(window: Samples) -> list[Finding]:
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
    text = (
        f"{100.0 * share:.0f} % of the rows repeat the readings of the row before: sampled faster than the sensors are"
    )
    return [Finding("stuck", "all", share / most_held, False, text)]


def _turned_otherwise(speed: float, mag: Array, interval: float) -> bool:
    """Whether the field turned by another angle than an axial gyro that always reads `speed`."""
    strength = np.linalg.norm(mag, axis=1)
    # of the strength: scatter up to which the field's angle can be held against a gyro
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
    """What is known of the sensors.

    Parameters
    ----------
    accel_range, mag_range, gyro_range : float, optional
        End of the range, of both signs: m/s^2, nT, rad/s. Without it clipping shows only where samples pile up, not
        where a filter came after the clipping.
    believe_axes : bool
        Take units, signs and axes as they are, whatever speaks against them.
    """

    accel_range: float | None = None
    mag_range: float | None = None
    gyro_range: float | None = None
    believe_axes: bool = False

    def __post_init__(self) -> None:
        for name in ("accel_range", "mag_range", "gyro_range"):
            value = getattr(self, name)
            if value is not None and not float(within(value, name, 0.0, 1e9)) > 0.0:
                raise InputError(f"{name} is {value}; it must be positive")

    @property
    def ranges(self) -> dict[str, float]:
        """Triad -> end of its range, where known."""
        known = {"accel": self.accel_range, "mag": self.mag_range, "gyro": self.gyro_range}
        return {triad: value for triad, value in known.items() if value is not None}


@dataclass(frozen=True, eq=False)
class WindowHealth:
    """Findings of one window.

    Attributes
    ----------
    samples : Samples
        The window; samples at the end of a range are marked as clipped.
    turning : Turning
    findings : tuple of Finding
    off : FieldOff
        The window's field against the site's.
    """

    samples: Samples
    turning: Turning
    findings: tuple[Finding, ...]
    off: FieldOff

    @property
    def flags(self) -> int:
        """Bits of `FLAGS`."""
        return int(sum(BITS[name] for name in {one.flag for one in self.findings}))

    def spoilt(self, triad: str) -> bool:
        """Whether a triad must not be used."""
        return any(one.refuse and triad in one.where for one in self.findings)

    def has(self, flag: str) -> bool:
        """Whether a flag was raised."""
        return any(one.flag == flag for one in self.findings)


class HealthCheck:
    """Windows of a run, one after the other; remembers what was found.

    Parameters
    ----------
    settings : HealthSettings, optional
    site : Site, optional
        Field strength and dip that are expected.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> still = Samples(np.arange(500) / 100.0, 0.01, accel=[0, 0, 9.81] + rng.normal(0, 0.03, (500, 3)))
    >>> [one.flag for one in HealthCheck().check(still).findings]
    ['no-field']
    """

    def __init__(self, settings: HealthSettings | None = None, site: Site | None = None) -> None:
        self._settings = settings or HealthSettings()
        self._site = site
        self._axes = AxesCheck(site)
        self._counts: Counter[tuple[str, str]] = Counter()
        self._first: dict[tuple[str, str], str] = {}
        self._windows = 0
        self._site_check = SiteCheck(site)

    def check(self, window: Samples) -> WindowHealth:
        """Findings of the next window.

        Raises
        ------
        InputError
            Units, signs or axes that contradict each other over several windows, naming the remedy.
        """
        findings, marked = clipping_findings(window, self._settings.ranges)
        findings += stuck_findings(window) + held_findings(window)
        if share := 0.0 if window.clipped is None else float(window.clipped.mean()):
            text = f"{100.0 * share:.2g} % of the samples are missing or marked"
            findings.append(Finding("gap", "all", 1.0 + share, False, text))
        findings += _dead(window)
        lame = window.mag is not None and any(one.refuse and one.where.startswith("gyro") for one in findings)
        judged = replace(window, gyro=None) if lame else window
        turning = find_turning(judged)
        aliased = aliasing_findings(turning, window.interval)
        field = field_findings(judged, turning, self._site)
        findings += aliased + field
        strength, scatter, steady = field_strength(judged, self._site)
        found = None if aliased else find_harmonics(judged, turning)
        off = field_off(judged, found, self._site, strength=strength, scatter=scatter)
        # m/s^2, range of the accelerometers at rest: by the means of such windows the site is held against the field
        if judged.accel is not None and judged.mag is not None and np.ptp(judged.accel, axis=0).max() < 0.5:
            self._site_check.add(judged.accel.mean(axis=0), judged.mag.mean(axis=0), 0.0)
        if not self._settings.believe_axes and not any(
            one.refuse for one in findings if one.flag in ("stuck", "clipped")
        ):
            findings += self._axes.add(judged, turning, found, field_usable=steady, phase_usable=not aliased)
            if steady and not aliased:
                findings += self._axes.against(turning) + self._axes.dip(off)
        self._windows += 1
        for key in {(one.flag, one.where) for one in findings}:
            self._counts[key] += 1
        for one in findings:
            self._first.setdefault((one.flag, one.where), one.text)
        if marked.any():
            already = np.zeros(len(window), np.bool_) if window.clipped is None else window.clipped
            window = replace(window, clipped=already | marked)
        return WindowHealth(window, turning, tuple(findings), off)

    def notes(self, besides: tuple[str, ...] = ()) -> tuple[str, ...]:
        """A sentence for each kind of finding, with the number of windows; without some flags."""
        said = tuple(
            f"{text} (and the like in {self._counts[key]} of {self._windows} windows)" if self._windows > 1 else text
            for key, text in self._first.items()
            if key[0] not in besides
        )
        asked = any("right site file" in text for text in said)
        return (*(() if asked else self._site_check.notes("at rest")), *said, *self._axes.notes())


def named(row: Attitude, health: WindowHealth) -> Attitude:
    """The row with the reason that samples were marked for: missing ones are a gap, not clipped."""
    if health.has("clipped") or not health.has("gap"):
        return row
    clipped = (row.flags & np.uint32(BITS["clipped"])).astype(np.bool_)
    swap = np.uint32(BITS["clipped"] | BITS["gap"])
    return replace(row, flags=np.where(clipped, row.flags ^ swap | np.uint32(BITS["gap"]), row.flags))


def _dead(window: Samples) -> list[Finding]:
    """An accelerometer that does not even feel gravity."""
    if window.accel is None or not len(window):
        return []
    sensed = float(np.sqrt(np.mean(np.sum(window.accel**2, axis=1))))
    least_sensed = 0.5 * STANDARD_GRAVITY  # m/s^2: gravity and shaking together are more
    if sensed >= least_sensed:
        return []
    text = f"the accelerometer reads {sensed:.3g} m/s^2 (root mean square), less than half of gravity"
    return [Finding("misfit", "accel", least_sensed / max(sensed, 1e-9), True, text)]

"""Whether the readings of a window can be believed: clipping, stuck channels, sampling, field, axes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.core.arrays import within
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site
from inclinometry.motion.axes import AxesCheck
from inclinometry.motion.clipping import clipping_findings, held_findings, stuck_findings
from inclinometry.motion.decimate import aliasing_findings
from inclinometry.motion.dip_check import FieldOff, field_findings, field_off, field_strength
from inclinometry.motion.finding import Finding
from inclinometry.motion.reference import SiteDoubt
from inclinometry.motion.result import BITS, Attitude
from inclinometry.motion.samples import Samples
from inclinometry.motion.turning import Turning, find_harmonics, find_turning

STILL: Final = 0.5
"""m/s^2, range of the accelerometers in a window at rest, by whose means the site is held against the field."""
LEAST_FELT: Final = 0.5 * STANDARD_GRAVITY
"""m/s^2: gravity and shaking together are more."""


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
        self._site_doubt = SiteDoubt(site)

    def check(self, window: Samples) -> WindowHealth:
        """Findings of the next window.

        Raises
        ------
        InputError
            Units, signs or axes that contradict each other over several windows, naming the remedy.
        """
        findings, marked = clipping_findings(window, self._settings.ranges)
        findings += stuck_findings(window) + held_findings(window) + _missing(window) + _dead(window)
        lame = window.mag is not None and any(one.refuse and one.where.startswith("gyro") for one in findings)
        judged = replace(window, gyro=None) if lame else window
        turning = find_turning(judged)
        aliased = aliasing_findings(turning, window.interval)
        field = field_findings(judged, turning, self._site)
        findings += aliased + field
        strength = field_strength(judged, self._site)
        found = None if aliased else find_harmonics(judged, turning)
        off = field_off(judged, found, self._site, strength=strength.off, scatter=strength.scatter)
        if judged.accel is not None and judged.mag is not None and np.ptp(judged.accel, axis=0).max() < STILL:
            self._site_doubt.add(judged.accel.mean(axis=0), judged.mag.mean(axis=0), 0.0)
        if not self._settings.believe_axes and not any(
            one.refuse for one in findings if one.flag in ("stuck", "clipped")
        ):
            findings += self._axes.add(judged, turning, found, field_usable=strength.steady, phase_usable=not aliased)
            if strength.steady and not aliased:
                findings += self._axes.against(turning) + self._axes.dip(off)
        self._note(findings)
        if marked.any():
            already = np.zeros(len(window), np.bool_) if window.clipped is None else window.clipped
            window = replace(window, clipped=already | marked)
        return WindowHealth(window, turning, tuple(findings), off)

    def _note(self, findings: list[Finding]) -> None:
        self._windows += 1
        for key in {(one.flag, one.where) for one in findings}:
            self._counts[key] += 1
        for one in findings:
            self._first.setdefault((one.flag, one.where), one.text)

    def notes(self, besides: tuple[str, ...] = ()) -> tuple[str, ...]:
        """A sentence for each kind of finding, with the number of windows; without some flags."""
        said = tuple(
            f"{text} (and the like in {self._counts[key]} of {self._windows} windows)" if self._windows > 1 else text
            for key, text in self._first.items()
            if key[0] not in besides
        )
        asked = any("right site file" in text for text in said)
        return (*(() if asked else self._site_doubt.notes("at rest")), *said, *self._axes.notes())


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
    felt = float(np.sqrt(np.mean(np.sum(window.accel**2, axis=1))))
    if felt >= LEAST_FELT:
        return []
    text = f"the accelerometer reads {felt:.3g} m/s^2 (root mean square), less than half of gravity"
    return [Finding("misfit", "accel", LEAST_FELT / max(felt, 1e-9), True, text)]


def _missing(window: Samples) -> list[Finding]:
    if window.clipped is None:
        return []
    share = float(window.clipped.mean())
    if not share:
        return []
    text = f"{100.0 * share:.2g} % of the samples are missing or marked"
    return [Finding("gap", "all", 1.0 + share, False, text)]

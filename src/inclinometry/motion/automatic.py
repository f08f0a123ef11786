"""The method that suits each window of a run, chosen from what the window shows, and said."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from inclinometry.arrays import within
from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.findings import Finding, Value
from inclinometry.motion.inertial.filter import GyroStream, InertialStream
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import MagneticStream
from inclinometry.motion.reference import azimuth_uncertainty, to_magnetic, widened
from inclinometry.motion.result import BITS, METHODS, Attitude, Samples, distinct, joined, refusals
from inclinometry.motion.static import StaticSettings, static_attitude
from inclinometry.motion.window_checks import HealthCheck, HealthSettings, WindowHealth, add_flag_reasons
from inclinometry.motion.window_filter import WindowBuffer
from inclinometry.motion.window_smoother import LazyStream, single
from inclinometry.tabular import check_record

TURNING: Final = 2.0 * np.pi
"""Rotation in a window, rad, from which it is called rotating, below it sliding."""


LONGEST: Final = 600.0
"""s, of a window."""


@dataclass(frozen=True, kw_only=True)
class ChooserSettings:
    """Settings of the methods that are chosen from; their windows are set to `window` and laid side by side."""

    window: float = 10.0  #: s, 0.5 to 600
    static: StaticSettings = field(default_factory=StaticSettings)
    magnetic: MagneticSettings = field(default_factory=MagneticSettings)
    inertial: InertialSettings = field(default_factory=InertialSettings)
    health: HealthSettings = field(default_factory=HealthSettings)  #: what is known of the sensors

    def __post_init__(self) -> None:
        within(self.window, "window", 0.5, LONGEST, "s")


class AttitudeChooser:
    """`choose_attitude` fed block by block; the same rows to the last bit."""

    def __init__(self, settings: ChooserSettings | None = None, site: Site | None = None) -> None:
        self._settings = settings or ChooserSettings()
        self._site = site
        self._health = HealthCheck(self._settings.health, site)
        self._buffer: WindowBuffer | None = None
        self._magnetic: dict[bool, MagneticStream] = {}  # with and without the gyro
        self._filter = LazyStream(lambda: InertialStream(self._inertial(), site))
        self._gyro = LazyStream(lambda: GyroStream(self._inertial(), site))
        self._counts: Counter[tuple[str, str]] = Counter()
        self._interval, self._size, self._phased = 0.0, 0, False
        self._end = -np.inf
        self._short = 0
        self._north = "magnetic"

    def push(self, samples: Samples) -> Attitude:
        """Rows of the windows that became complete with this block, which must have an accelerometer."""
        samples.need("accel")
        if not len(samples):
            return self._none()
        if self._buffer is None:
            # what the first block settles: the length of the windows and the north
            self._interval = samples.interval
            self._size = max(round(self._settings.window / samples.interval), 1)
            if samples.has("mag"):
                chosen = self._magnetic_settings(use_gyro=True)
                try:
                    self._size = chosen.nodes(samples.interval) * chosen.node(samples.interval)
                    self._phased = True
                except InputError:
                    self._phased = False  # too sparse to turn gravity back by the phase; at rest the mean still serves
            self._north = "true" if samples.has("gyro") and not samples.has("mag") else "magnetic"
            self._buffer = WindowBuffer(self._size * samples.interval)
        return self._rows(self._buffer.push(samples))

    def finish(self) -> Attitude:
        """No rows (what is left is shorter than a window), but what was chosen and found."""
        rows = self._none() if self._buffer is None else self._rows(self._buffer.finish())
        found = [*self._summary_notes(), *self._health.findings()]
        for stream in self._magnetic.values():
            told = {"motion-block-gaps", "motion-no-window", *(one.code for one in found)}
            found += [one for one in stream.finish().findings if one.code not in told]
        return replace(rows, findings=distinct(found))

    def _magnetic_settings(self, *, use_gyro: bool) -> MagneticSettings:
        site, given = self._site or self._settings.magnetic.site, self._settings.magnetic
        use = given.use_gyro and use_gyro
        return replace(given, window_s=self._settings.window, overlap=0.0, site=site, use_gyro=use)

    def _inertial(self) -> InertialSettings:
        return replace(self._settings.inertial, window=min(self._size * self._interval, LONGEST))

    def _none(self) -> Attitude:
        return refusals([], (), "static", self._north)

    def _rows(self, windows: list[Samples]) -> Attitude:
        rows = []
        for window in windows:
            if len(window) != self._size:
                self._short += 1
                continue
            if window.time[0] > self._end + 1.9 * window.interval:
                self._filter.restart()
                self._gyro.restart()
            self._end = float(window.time[-1])
            health = self._health.check(window)
            row, kind, outcome = self._choose(health)
            row = add_flag_reasons(row, health)
            self._counts[kind, outcome] += 1
            rows.append(replace(row, flags=row.flags | np.uint32(health.flags), findings=()))
        return joined(rows) if rows else self._none()

    def _choose(self, health: WindowHealth) -> tuple[Attitude, str, str]:
        """Route one window: its row, what the tool did ("moving" where nothing tells), the method or "refused"."""
        # what a tool that shakes does
        kind = "rotating" if health.turning.span >= TURNING else "sliding"
        window, kind = health.samples, kind if health.turning.by else "moving"
        field = window.has("mag") and not health.unusable("mag")
        usable = not health.unusable("accel")
        refused: Attitude | None = None
        if usable and (shake := _shake(window)) < self._settings.static.shake:
            row = (
                self._add_field_departure(self._static(window), health)
                if field
                else self._static(replace(window, mag=None))
            )
            if not bool(row.refused[0]) and not int(row.flags[0]) & BITS["not-still"]:
                if field:
                    for stream in self._magnetic.values():
                        stream.rest(window)
                if field or not self._gyro_is_usable(health):
                    return self._accept_row(health, row, "still", good=field)
                kind = "still"
            refused = row if shake == 0.0 else None
        if usable and field and self._phased:
            # row of the window; without the gyro where that is damaged
            use = self._gyro_is_usable(health)
            if use not in self._magnetic:
                self._magnetic[use] = MagneticStream(self._magnetic_settings(use_gyro=use))
            row = self._add_field_departure(self._magnetic[use].push(health.samples), health)
            if not bool(row.refused[0]):
                return self._magnetic_or_filtered_row(health, row, kind)
            refused = row
        carried = self._row_from_gyro(health) if usable and self._gyro_is_usable(health) else None
        if carried is not None:
            outcome = "refused" if bool(carried.refused[0]) else METHODS[int(carried.method[0])]
            return carried, kind, outcome
        if not self._gyro_is_usable(health):
            self._filter.restart()
            self._gyro.restart()
        if kind == "still" and usable:
            return self._static(replace(window, mag=None)), kind, "static"
        return refused if refused is not None else self._refusal(health), kind, "refused"

    def _accept_row(self, health: WindowHealth, row: Attitude, kind: str, *, good: bool) -> tuple[Attitude, str, str]:
        """A row that needs no filter; the filters are told of the window."""
        if self._gyro_is_usable(health):
            clean = good and not _has_flagged_samples(health.samples)
            self._filter.take(health.samples, good=clean, wanted=False)
            self._gyro.take(health.samples, good=not _has_flagged_samples(health.samples), wanted=False)
        return row, kind, METHODS[int(row.method[0])]

    def _magnetic_or_filtered_row(self, health: WindowHealth, row: Attitude, kind: str) -> tuple[Attitude, str, str]:
        """A magnetic row, or the filter's where the field is disturbed and the gyro knows the azimuth better."""
        disturbed = bool(int(row.flags[0] | health.flags) & BITS["disturbed"])
        if not (disturbed and self._gyro_is_usable(health)):
            return self._accept_row(health, row, kind, good=True)
        other = self._filter.take(health.samples, good=False, wanted=True)
        self._gyro.take(health.samples, good=not _has_flagged_samples(health.samples), wanted=False)
        if other is not None and single(other) and other.u.azimuth[0] < row.u.azimuth[0]:
            row = other
        return row, kind, METHODS[int(row.method[0])]

    def _gyro_is_usable(self, health: WindowHealth) -> bool:
        """Whether a gyro can carry the attitude."""
        return health.samples.has("gyro") and not health.unusable("gyro")

    def _static(self, window: Samples) -> Attitude:
        settings = replace(self._settings.static, window=len(window) * window.interval)
        return static_attitude(window, settings, self._site)

    def _add_field_departure(self, row: Attitude, health: WindowHealth) -> Attitude:
        """The row with what the field's departure from the site's adds to its uncertainty."""
        return widened(row, azimuth_uncertainty(health.off, self._site))

    def _row_from_gyro(self, health: WindowHealth) -> Attitude | None:
        """Row by gyro: of the filter that began in a good field, else of the gyro that finds north itself."""
        window = health.samples
        whole = not _has_flagged_samples(window)
        row = self._filter.take(window, good=False, wanted=True) if window.has("mag") else None
        lone = self._gyro.take(window, good=whole, wanted=not single(row))
        if single(row):
            return row
        if lone is None or self._north == "true":
            return lone
        if not single(lone):
            return replace(lone, north=self._north)
        return to_magnetic(lone, self._site)

    def _refusal(self, health: WindowHealth) -> Attitude:
        """A refused row with the faults for reasons."""
        found = {one.flag for one in health.faults if one.refuse}
        if not health.samples.has("mag"):
            found.add("no-field")
        time = float(health.samples.time[0] + 0.5 * self._interval * (len(health.samples) - 1))
        row = refusals([time], sorted(found or {"unobservable"}), "magnetic", self._north)
        return replace(row, rate=np.array([health.turning.mean]))

    def _summary_notes(self) -> list[Finding]:
        """What the tool did and what was chosen, how often."""
        total, length = sum(self._counts.values()), self._size * self._interval
        if not total:
            return [Finding("motion-no-window", {"window_s": length})]
        kinds: list[Value] = []
        for kind in ("still", "sliding", "rotating", "moving"):
            for (each, method), count in sorted(self._counts.items()):
                if each == kind:
                    kinds.append(Finding("motion-kind", {"kind": kind, "method": method, "count": count}))
        found = [
            Finding("motion-windows", {"total": total, "window_s": length, "kinds": tuple(kinds)}, severity="note")
        ]
        return found + ([Finding("motion-rests", {"count": self._short}, severity="note")] if self._short else [])


def choose_attitude(samples: Samples, settings: ChooserSettings | None = None, site: Site | None = None) -> Attitude:
    """Attitude of a run by the method that suits each window.

    Parameters
    ----------
    samples : Samples
        With `accel`; more triads allow more methods.
    settings : ChooserSettings, optional
    site : Site, optional
        Strength and dip of the field are compared with the readings; latitude lets a gyro find north.

    Returns
    -------
    Attitude
        A row a window: at its middle, and by the filters at its last sample. `method` says which, `findings` how often
        and what was found. North is "magnetic", or "true" where there is a gyro and no magnetometer.

    Raises
    ------
    InputError
        No accelerometer; units, signs or axes that contradict each other.

    Notes
    -----
    A window that does not shake and does not turn is still: the mean serves ("static"). Otherwise gravity is turned
    back by the magnetic phase ("magnetic", "mean"). Where the field is missing or disturbed beyond use, or the magnetic
    row was refused, the 15-state filter carries on from the last good field ("filter"); it is run only for such windows
    and the two minutes before them. Where there was no good field yet, the gyro seeks north itself
    ("gyro"). A window that none of them can serve is refused, with the reasons among its flags.

    Examples
    --------
    >>> from inclinometry.orientation import fields
    >>> time = np.arange(4000) / 200.0
    >>> g, b = fields(np.full(4000, 1.0), 0.5, 9.0 * time, 1.1)
    >>> rows = choose_attitude(Samples(time, 0.005, accel=9.81 * g, mag=50_000.0 * b))
    >>> print(rows.findings[0], [round(float(x), 6) for x in rows.angles.inclination])
    Windows of 10 s: 2 (rotating: magnetic 2). The flags of a window give the reason why it is refused. [0.5, 0.5]
    """
    check_record(samples, Samples, "choose_attitude")
    chooser = AttitudeChooser(settings, site)
    first, last = chooser.push(samples), chooser.finish()
    return joined([first, last])


def _shake(window: Samples) -> float:
    """Root mean square of the acceleration about its mean, m/s^2, of the samples that are not marked."""
    accel = window.accel if window.clipped is None else window.accel[~window.clipped]  # type: ignore[index]
    if accel is None or not len(accel):
        return np.inf
    return float(np.sqrt(np.mean(np.sum((accel - accel.mean(axis=0)) ** 2, axis=1))))


def _has_flagged_samples(window: Samples) -> bool:
    return window.clipped is not None and bool(window.clipped.any())

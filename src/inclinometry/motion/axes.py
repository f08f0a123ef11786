"""Units, signs and axes of a run that contradict each other: told from windows, refused with the remedy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import RPM, STANDARD_GRAVITY
from inclinometry.conventions import AXES, axes_matrix, find_mapping, named
from inclinometry.earth.site import Site
from inclinometry.errors import InputError, refused
from inclinometry.findings import Finding, Value
from inclinometry.motion.reference import FAR_DIP, FieldOff, dip_fault
from inclinometry.motion.result import Fault, Samples
from inclinometry.motion.turning import LEAST_TURNS, Harmonics, Turning
from inclinometry.orientation import dip_angle

ENOUGH: Final = 3
"""Windows that must agree."""

SURE: Final = 5
"""Windows that must agree on an exchange of axes or on a gyro's unit: inside casing the field does anything."""
KEPT: Final = 12
"""Windows that are looked at together, the latest."""
SLACK: Final = 0.06
"""rad, scatter of the dip that offsets of uncalibrated sensors may cause."""
UP: Final = -0.3
"""Axial gravity, of its strength, below which the accelerometer is believed to report specific force (or the hole to
climb at 107 deg)."""
GRAVITY_UNITS: Final = {"g": STANDARD_GRAVITY, "mg": STANDARD_GRAVITY / 1000.0}

TURNED_TO: Final = {"x": ("y,z,x", "z,y,-x"), "y": ("z,x,y", "x,z,-y")}
"""Axes that bring one of the file to z, where it points down the hole and where it points up."""


def expected_dip(site: Site | None) -> float | None:
    """The site's dip, rad, else that of a dipole where the latitude determines its sign."""
    if site is None or site.dip is not None:
        return None if site is None else site.dip
    # from 30 deg on the sign of the dip is that of the latitude, wherever the magnetic poles are
    if site.latitude is None or abs(site.latitude) < float(np.radians(30.0)):
        return None
    return float(np.arctan(2.0 * np.tan(site.latitude)))


def _mirrored(windows: int) -> InputError:
    return refused("motion-field-mirrored", {"windows": windows, "total": windows})


@dataclass
class AxesCheck:
    """Collects windows and says what contradicts; what was right once is not asked again, for axes do not change.

    The site's dip settles the sign of gravity.
    """

    site: Site | None = None
    _slopes: list[float] = field(default_factory=list)
    _axes: list[int] = field(default_factory=list)
    _speeds: list[float] = field(default_factory=list)
    _strengths: list[float] = field(default_factory=list)
    _gravity: list[float] = field(default_factory=list)
    _along: list[int] = field(default_factory=list)
    _believed: bool = False
    _turns: bool = False
    _seen: list[Harmonics] = field(default_factory=list)
    _against: int = 0
    _right: int = 0
    _up: int = 0
    _climbs: bool = False
    _rates: Array = field(default_factory=lambda: np.zeros(3))
    _samples: int = 0

    def add(
        self, window: Samples, turning: Turning, found: Harmonics | None, *, field_usable: bool, phase_usable: bool
    ) -> list[Fault]:
        """Look at one more window; InputError where units, signs or channels are wrong, with what would be right.

        `found` where the phase is usable; `field_usable`, `phase_usable`: whether the window has an undisturbed field,
        and an angle from sample to sample, to be judged by.
        """
        if window.gyro is not None:
            self._rates = self._rates + np.sum(window.gyro**2, axis=0)
            self._samples += len(window)
        if window.gyro is not None and not self._turns:
            self._gyro(window.gyro, turning, judged=window.mag is not None, sampled=phase_usable)
        if self._believed:
            return []
        if window.mag is not None:
            strength = np.linalg.norm(window.mag, axis=1)
            if not (float(strength.std()) > 0.2 * float(strength.mean())):
                self._strengths = [*self._strengths, float(strength.mean())][-KEPT:]
                if len(self._strengths) >= ENOUGH:
                    units = {"uT": 1e3, "gauss": 1e5, "mgauss": 1e2, "T": 1e9}
                    # nT, of the Earth's field
                    _unit("magnetometer", "nT", float(np.median(self._strengths)), 18_000.0, 72_000.0, units)
            if field_usable:
                self._field_axis(window.mag)
        if not phase_usable:
            return []
        faults = self._fields(found, field_usable=field_usable)
        if turning.span > LEAST_TURNS * 2.0 * np.pi and window.accel is not None and not self._believed:
            self._gravity_axis(window.accel, turning.angle)
        return faults

    def against(self, turning: Turning) -> list[Fault]:
        """A steady field that turns against the gyro, in a window of its own; InputError in several in succession."""
        if turning.by != "gyro" or self._turns or not np.isfinite(turning.slope):
            return []
        # rad, rotation from which the field and a gyro can be compared with each other
        if turning.span > 1.0:
            # a mirrored gyro makes their ratio -1
            wrong = abs(turning.slope + 1.0) < 0.3
            right = not wrong
        else:
            # rad, of a tool that swings to and fro
            swings = turning.swing > 0.004
            clearly = 4.0  # times by which one sense of rotation leaves less than the other
            wrong, right = swings and turning.mirror < 1.0 / clearly, swings and turning.mirror > clearly
        # a window that does not tell is as good or bad as those before it
        self._against = 0 if right else self._against + wrong
        if self._against >= ENOUGH:
            raise _mirrored(self._against)
        return [Fault("motion-field-mirrored", {}, "axes", "mag and gyro", True)] if self._against else []

    def dip(self, off: FieldOff) -> list[Fault]:
        """A dip that is not the site's in a strong, steady field: nothing can be made of the window.

        InputError where it has the other sign in several windows and was never right.
        """
        expected = None if self.site is None else self.site.dip
        if expected is None or not np.isfinite(off.dip):
            return []
        margin = 4.0  # standard deviations allowed to the dip of a single window, beside `SLACK`
        limit = SLACK + margin * off.u
        if off.off <= limit:
            self._right += 1
            return []
        opposite = abs(expected) > np.radians(10.0) and abs(off.dip + expected) < FAR_DIP + margin * off.u
        self._up = self._up + 1 if opposite else 0
        if self._up >= ENOUGH and not self._right:
            raise self._signrefused(off.dip, expected, self._seen)
        # axes that were right once are right: then it is the field
        return [dip_fault(off.dip, expected, believed=self._right >= ENOUGH)]

    def findings(self) -> list[Finding]:
        """What is possible but not likely."""
        return [*self._free(), *([Finding("motion-climbs")] if self._climbs else [])]

    def _free(self) -> list[Finding]:
        """A tool that turns about no axis of its own."""
        total = float(self._rates.sum())
        lively = 0.2  # rad/s, root mean square rate of a tool that moves: beyond any bias
        along = 0.7  # share of z in the rotation below which it is not that of a tool in a hole, whose z lies along it
        alone = 0.95  # share of another axis from which it is the hole's, wrongly named
        if not total > self._samples * lively**2 or self._rates[2] > along * total or self._rates.max() > alone * total:
            return []
        x, y, z = (float(100.0 * one / total) for one in self._rates)
        return [Finding("motion-free", {"x_percent": x, "y_percent": y, "z_percent": z})]

    def _signs(self, seen: list[Harmonics]) -> tuple[str, ...]:
        """Which statements of axes and signs make a run right whose dip or gravity has the wrong sign."""
        fits = []
        dip = expected_dip(self.site)
        # what is often met: option, convention, and axes before it
        stated = (
            ("--convention specific-force", "specific-force", AXES),
            ("--convention z-up", "z-up", AXES),
            ("--axes=x,-y,-z", "native", ("x", "-y", "-z")),
        )
        for option, name, axes in stated if seen else ():
            turn, convention = axes_matrix(axes).T, named(name)
            accel = np.concatenate([one.accel for one in seen]) @ turn @ convention.matrix("accelerometer").T
            mag = np.concatenate([one.mag for one in seen]) @ turn @ convention.matrix("magnetometer").T
            right = float(np.median(accel[:, 2] / np.linalg.norm(accel, axis=1))) > UP
            if dip is not None and np.isfinite(mag).all():
                right &= abs(float(np.median(dip_angle(accel, mag))) - dip) < 0.5 * abs(dip)
            if right:
                fits.append(option)
        return tuple(fits) or ("--convention", "--axes")

    def _signrefused(self, dip: float, expected: float, seen: list[Harmonics]) -> InputError:
        values: dict[str, Value] = {"name": "dip", "value": float(np.degrees(dip)), "unit": "deg"}
        return refused(
            "motion-signs", values | {"expected": f"{np.degrees(expected):.0f}", "options": self._signs(seen)}
        )

    def _fields(self, found: Harmonics | None, *, field_usable: bool) -> list[Fault]:
        """Strength of gravity, and its angle to the field."""
        if found is None:
            return []
        strength = np.linalg.norm(found.accel, axis=1)
        self._climbs |= bool((found.accel[:, 2] < UP * strength).all())
        # uncertainty, of the strength, with which gravity's strength tells units and its axial part the sign
        if not (strength.min() > 0.0 and found.u_accel < 0.15 * float(strength.mean())):
            return []
        if not field_usable:
            found = Harmonics(found.accel, np.full_like(found.mag, np.nan), found.u_accel, found.turned)
        self._seen = [*self._seen, found][-KEPT:]
        if len(self._seen) < ENOUGH:
            return []
        strength = float(np.median([np.linalg.norm(one.accel, axis=1).mean() for one in self._seen]))
        _unit("accelerometer", "m/s2", strength, 0.8 * STANDARD_GRAVITY, 1.2 * STANDARD_GRAVITY, GRAVITY_UNITS)
        return self._mapping()

    def _gyro(self, gyro: Array, turning: Turning, *, judged: bool, sampled: bool) -> None:
        """Which gyro axis turns, how fast, and whether the field turns with it."""
        size = np.abs(gyro).mean(axis=0)
        self._speeds = [*self._speeds, float(size.max())][-KEPT:]
        most_speed = 220.0  # rad/s, 2100 rpm: faster than any string
        if len(self._speeds) >= ENOUGH and min(self._speeds) > most_speed:
            raise refused("motion-size", too_fast(float(np.median(self._speeds)), most_speed))
        if float(size.max()) > 1.0:
            self._axes = [*self._axes, int(size.argmax()) if size.max() > 5.0 * size[2] else 2][-KEPT:]
            if len(self._axes) >= ENOUGH and 2 not in self._axes:
                raise _along("gyro", self._axes[-1], "the tool turns about it", ("--axes",))
        if judged and turning.by == "gyro" and turning.span > 4.0 * np.pi and np.isfinite(turning.slope):
            self._slopes = [*self._slopes, turning.slope][-KEPT:]
            if len(self._slopes) >= SURE:
                slopes = np.array(self._slopes)
                # opposite is told only when sampled fast enough
                if sampled and (slopes < -0.5).all():
                    raise _mirrored(len(slopes))
                units = {"deg/s": np.pi / 180.0, "deg/h": np.pi / 180.0 / 3600.0, "rpm": np.pi / 30.0}
                for unit, factor in units.items():
                    if (np.abs(slopes / factor - 1.0) < 0.2).all():
                        times = 1.0 / float(np.median(slopes))
                        raise refused("motion-gyro-unit", {"times": times, "unit": unit, "factor": factor})
                self._turns = bool((np.abs(slopes - 1.0) < 0.2).all())

    def _field_axis(self, mag: Array) -> None:
        """Which channel keeps its value while the other two go round: it lies along the hole."""
        low, middle, high = np.sort(mag.var(axis=0))
        # a circle worth looking at: rms of a transverse channel about its mean, of the strength
        size = (0.05 * float(np.linalg.norm(mag, axis=1).mean())) ** 2
        if low > 0.02 * middle or middle < 0.3 * high or middle < size:
            return
        self._along = [*self._along, int(mag.var(axis=0).argmin())][-KEPT:]
        if len(self._along) >= SURE and 2 not in self._along:
            # without a gyro the accelerometer's z may be as wrong
            options = ("--magnetometer-axes",) if self._speeds else ("--axes", "--magnetometer-axes")
            raise _along("mag", self._along[-1], "constant while the tool turns", options)

    def _gravity_axis(self, accel: Array, angle: Array) -> None:
        """Gravity lies along z and goes round in x and y; what is constant across the hole is the lever arm's."""
        if float(np.mean(np.sum(accel**2, axis=1))) < (0.5 * STANDARD_GRAVITY) ** 2:
            return  # gravity is not in any channel
        transverse = accel[:, 0] + 1j * accel[:, 1]
        round_ = max(abs(np.mean(transverse * np.exp(sign * angle))) for sign in (1j, -1j))
        self._gravity = [*self._gravity, float(np.hypot(accel[:, 2].mean(), round_))][-KEPT:]
        if len(self._gravity) < SURE or max(self._gravity) > 0.8 * STANDARD_GRAVITY:
            return
        strength = float(np.median(self._gravity))
        _unit("accelerometer", "m/s2", strength, 0.8 * STANDARD_GRAVITY, 1.2 * STANDARD_GRAVITY, GRAVITY_UNITS)
        raise refused("motion-axis-accel", {"gravity_m_s2": strength})

    def _mapping(self) -> list[Fault]:
        """Whether the dip is constant, and of the site's sign."""
        usable = [one for one in self._seen if np.isfinite(one.mag).all()]
        dip = None if self.site is None else self.site.dip
        # 5 % of uncertainty: with it gravity's direction tells axes
        sure = [one for one in usable if one.turned and one.u_accel < 0.05 * STANDARD_GRAVITY]
        if len(sure) < ENOUGH:
            self._sign(usable if len(usable) >= ENOUGH else self._seen)
            return []
        usable = sure
        accel, mag = np.concatenate([one.accel for one in usable]), np.concatenate([one.mag for one in usable])
        u = float(np.median([one.u_accel for one in usable])) / STANDARD_GRAVITY
        slack = SLACK + 4.0 * u
        dips = dip_angle(accel, mag)
        scatter = float(dips.std(ddof=1))
        off = 0.0 if dip is None else abs(float(dips.mean()) - dip)
        if scatter <= slack and off <= FAR_DIP + slack:
            self._sign(usable)
            self._believed = True
            return []
        if len(sure) < SURE:
            return []
        if dip is not None and scatter <= slack and abs(float(dips.mean()) + dip) < FAR_DIP:
            self._sign(usable)
        mappings, _, _ = find_mapping(accel, mag, dip=dip, tolerance=slack)
        fits = [one for one in mappings if one.scatter <= slack and one.axes != AXES]
        fits = [one for one in fits if dip is None or abs(one.dip - dip) <= slack]
        seen: dict[str, Value] = {"scatter_deg": float(np.degrees(scatter)), "off_deg": float(np.degrees(off))}
        if not fits:
            return [Fault("motion-dip-scatters", seen, "axes", "mag", False)]
        seen["axes"] = tuple(",".join(one.axes) for one in fits[:3])
        raise refused("motion-mag-axes-dip" if scatter <= slack else "motion-mag-axes", seen)

    def _sign(self, usable: list[Harmonics]) -> None:
        """Gravity that points up: specific force, most likely."""
        accel, mag = (np.concatenate([getattr(one, name) for one in usable]) for name in ("accel", "mag"))
        dip = expected_dip(self.site)
        if dip is not None and abs(dip) > np.radians(10.0) and np.isfinite(mag).all():
            found = float(np.median(dip_angle(accel, mag)))
            if abs(found + dip) < 0.5 * abs(dip):
                raise self._signrefused(found, dip, usable)
        else:
            down = float(np.median(accel[:, 2] / np.linalg.norm(accel, axis=1)))
            if down < UP:
                values: dict[str, Value] = {"name": "gravity along the tool", "value": 100.0 * down, "unit": "%"}
                raise refused("motion-signs", values | {"expected": "> 0", "options": self._signs(usable)})


def too_fast(speed: float, most: float) -> dict[str, Value]:
    """Values of a gyro that reads more than any string turns, rad/s."""
    return {"sensor": "gyro", "reading": speed * RPM, "unit": "rpm", "allowed": f"<= {most * RPM:.0f}"}


def _along(triad: str, place: int, evidence: str, options: tuple[str, ...]) -> InputError:
    """Another channel than z lies along the hole."""
    axis = "xyz"[place]
    down, up = TURNED_TO[axis]
    values: dict[str, Value] = {"channel": f"{triad}_{axis}", "evidence": evidence, "expected": f"{triad}_z"}
    return refused("motion-axis", values | {"axis": axis, "options": options, "down": down, "up": up})


def _unit(sensor: str, unit: str, strength: float, low: float, high: float, others: dict[str, float]) -> None:
    """Refuse a strength that is right in another unit."""
    if low <= strength <= high:
        return
    for other, factor in others.items():
        if low <= strength * factor <= high:
            said: dict[str, Value] = {"sensor": sensor, "reading": strength, "unit": unit}
            raise refused("motion-unit", said | {"other": other, "factor": factor})

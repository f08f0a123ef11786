"""What a window can be trusted for: flags, quality, refusal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from inclinometry.attitude.orientation import dip_angle
from inclinometry.attitude.rotations import quaternion_from_dcm
from inclinometry.core.arrays import Array
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.motion.magnetic.demodulate import MOST_TURN
from inclinometry.motion.magnetic.settings import MagneticSettings
from inclinometry.motion.magnetic.window import LEAST_FIELD_NT, WindowFit, attitude_of
from inclinometry.motion.reference import departure, doubted
from inclinometry.motion.samples import Samples

DISTURBED: Final = 0.02
"""Of the radius: scatter of the transverse field about its circle, less its noise; departure of the strength."""
NO_FIELD: Final = 0.2
"""Scatter above which there is no field to turn back by."""
DISTURBED_DIP: Final = float(np.radians(1.0))
WORTHLESS: Final = 6.0
"""Times `SHAKEN`, from which a window is refused: linear covariance and the small mean of shaking no longer hold."""
SHAKEN: Final = float(np.radians(0.5))
"""Uncertainty of inclination that is called too much vibration."""
OFFSET: Final = float(np.radians(0.5))
"""Turn of the transverse field by an unknown offset that is worth a flag."""
GRAVITY_SLACK: Final = 0.1
"""m/s^2, allowed between the gravity found and the expected one, beside five of its standard deviations."""
LEVEL: Final = 0.02
"""Sine of inclination, or cosine of the angle of b to the horizon, below which azimuth is hardly or not defined."""
MEAN: Final = 1.2
"""Sums taken by the regressors up to which the fit was a plain mean."""


@dataclass(frozen=True)
class Verdict:
    """Row of a result: NaN attitude where refused."""

    quaternion: Array
    covariance: Array
    flags: tuple[str, ...]
    quality: float
    method: str
    said: str = ""


def stuck(samples: Samples) -> bool:
    """Whether a transverse channel stands still while its partner moves: it is refused."""
    for triad in (samples.accel, samples.mag):
        if triad is not None and len(triad):
            # nearly always the first few samples tell
            still = [bool((triad[:20, k] == triad[0, k]).all() and (triad[:, k] == triad[0, k]).all()) for k in (0, 1)]
            if still[0] != still[1]:
                return True
    return False


def judge(window: WindowFit, settings: MagneticSettings, is_stuck: bool) -> Verdict:
    """Flags and quality of a window, and its attitude unless it is refused."""
    method = "mean" if window.taken < MEAN else "magnetic"
    refused = _refusals(window, settings, is_stuck)
    if refused:
        return _refused(refused, method)
    off = departure(window.gravity, window.field, window.covariance, settings.site)
    if off.far:
        return _refused(("disturbed", "axes"), method, off.text)
    doubtful = replace(window, covariance=doubted(window.covariance, off.extra))
    matrix, covariance = attitude_of(doubtful)
    if _tilt(covariance, matrix) > WORTHLESS * SHAKEN:
        return _refused(("vibration",), method)
    flags, worst = _doubts(window, settings, covariance, matrix)
    return Verdict(quaternion_from_dcm(matrix), covariance, flags, float(np.clip(1.0 - worst, 0.0, 1.0)), method)


def _refused(names: tuple[str, ...], method: str, said: str = "") -> Verdict:
    """No attitude, for these reasons."""
    return Verdict(np.full(4, np.nan), np.full((3, 3), np.nan), names, 0.0, method, said)


def _tilt(covariance: Array, matrix: Array) -> float:
    """Standard uncertainty of inclination, rad; 0 near the vertical."""
    down = matrix[:, 2]
    level = float(np.hypot(down[0], down[1]))
    across = np.array([down[1], -down[0]]) / max(level, 1e-12)
    return float(np.sqrt(across @ covariance[:2, :2] @ across)) if level > LEVEL else 0.0


def _refusals(window: WindowFit, settings: MagneticSettings, is_stuck: bool) -> tuple[str, ...]:
    """Names of what forbids an attitude."""
    transverse = float(np.hypot(window.field[0], window.field[1]))
    strength = float(np.linalg.norm(window.field))
    down = window.gravity / max(float(np.linalg.norm(window.gravity)), 1e-9)
    across = float(np.linalg.norm(np.cross(down, window.field))) / max(strength, 1e-9)
    unphased = transverse < max(LEAST_FIELD_NT, 3.0 * window.offset_sigma)
    found = {
        "clipped": window.clipped > settings.clipped_share,
        "stuck": is_stuck,
        "aliased": window.turn > MOST_TURN,
        "no-field": unphased or window.circle.scatter > NO_FIELD * window.circle.radius,
        "axes": window.mirrored,
        "unobservable": unphased or across < LEVEL,
    }
    return tuple(name for name, yes in found.items() if yes)


def _doubts(
    window: WindowFit, settings: MagneticSettings, covariance: Array, matrix: Array
) -> tuple[tuple[str, ...], float]:
    """Names of what is doubtful, and the largest share of a limit that is used up."""
    level = float(np.hypot(matrix[0, 2], matrix[1, 2]))
    tilt = _tilt(covariance, matrix)
    transverse = float(np.hypot(window.field[0], window.field[1]))
    shares = {
        "clipped": window.clipped / max(settings.clipped_share, 1e-12),
        "disturbed": max(window.ripple / window.circle.radius / DISTURBED, _off_site(window, settings.site)),
        "vibration": tilt / SHAKEN,
        "offset": window.offset_sigma / transverse / OFFSET,
        "misfit": _gravity_misfit(window, settings.site),
        "aliased": window.turn / MOST_TURN,
    }
    flags = [name for name, share in shares.items() if share > 1.0]
    if window.clipped > 0.0 and "clipped" not in flags:
        flags.append("clipped")
    if not window.constants.seen:
        flags.append("little-arc")
    if level <= max(LEVEL, 3.0 * tilt):
        flags.append("vertical")
    if window.stepped:
        flags.append("step")
    return tuple(flags), max(shares.values())


def _gravity_misfit(window: WindowFit, site: Site | None) -> float:
    """Departure of gravity's strength from the expected one, over what is allowed."""
    gravity = site.gravity if site is not None and site.gravity is not None else STANDARD_GRAVITY
    strength = float(np.linalg.norm(window.gravity))
    along = window.gravity / max(strength, 1e-9)
    sigma = float(np.sqrt(along @ window.covariance[:3, :3] @ along))
    return abs(strength - gravity) / (GRAVITY_SLACK + 5.0 * sigma)


def _off_site(window: WindowFit, site: Site | None) -> float:
    """Departure of strength and dip from the site's, over what is allowed; zero where the site states none."""
    worst = 0.0
    if site is not None and site.b is not None:
        worst = abs(float(np.linalg.norm(window.field)) / site.b - 1.0) / DISTURBED
    if site is not None and site.dip is not None:
        worst = max(worst, abs(float(dip_angle(window.gravity, window.field)) - site.dip) / DISTURBED_DIP)
    return worst

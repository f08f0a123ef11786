"""How far the field of a window is from the site's: dip, strength, steadiness; and what that means for an azimuth."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.attitude.orientation import dip_angle
from inclinometry.attitude.rotations import dcm_from_quaternion
from inclinometry.core.arrays import Array
from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.motion.finding import Finding
from inclinometry.motion.result import Attitude
from inclinometry.motion.samples import Samples
from inclinometry.motion.turning import BATCHES, Harmonics, Turning
from inclinometry.motion.window_smoother import batch_means

# Whether there is a magnetic field to steer by: inside casing or beside steel there is not.

LEAST_NT: Final = 3000.0
"""Strength below which there is no field: an eighth of the weakest on Earth."""
NO_FIELD: Final = 0.2
"""Departure of the strength from the site's, and scatter within a window, of the strength: not the Earth's field,"""
DISTURBED: Final = 0.05
"""and the Earth's with something beside it. A calibrated tool's offsets leave 1 to 2 %."""
RESTLESS: Final = 0.6
"""rad, root mean square of the field's phase about the gyro's angle beyond which it does not turn with the tool,"""
UNEASY: Final = 0.15
"""and beyond which it is doubtful. A gyro's scale error drifts, which is taken off."""
TURNED: Final = np.pi
"""Rotation, rad, from which a field's phase must follow it."""


def field_findings(window: Samples, turning: Turning, site: Site | None) -> list[Finding]:
    """Missing or disturbed magnetic field.

    Parameters
    ----------
    window : Samples
    turning : Turning
    site : Site, optional
        Its strength, where given, is what the field is held against.
    """
    if window.mag is None:
        return [Finding("no-field", "mag", np.inf, True, "there is no magnetometer")]
    strength = np.sqrt(np.einsum("ij,ij->i", window.mag, window.mag))
    shares = [_strength(strength, site), _scatter(strength), _phase(turning)]
    worst = max(shares, key=lambda one: one[0])
    found = [Finding("no-field", "mag", value, True, text) for value, _, text in [worst] if value > 1.0]
    doubt = max(shares, key=lambda one: one[1])
    if not found and doubt[1] > 1.0:
        found.append(Finding("disturbed", "mag", doubt[1], False, doubt[2]))
    return found


class FieldStrength(NamedTuple):
    """What no exchange of axes or signs can change.

    off, scatter : departure of the strength from the site's, 0 without a site, and variation in the window, of it.
    steady : whether the strength is right and constant.
    """

    off: float
    scatter: float
    steady: bool


def field_strength(window: Samples, site: Site | None) -> FieldStrength:
    """The field's strength in a window."""
    if window.mag is None:
        return FieldStrength(0.0, 0.0, False)
    strength = np.sqrt(np.einsum("ij,ij->i", window.mag, window.mag))
    wrong, varied = _strength(strength, site), _scatter(strength)
    steady = max(*wrong[:2], *varied[:2]) <= 1.0
    return FieldStrength(wrong[1] * DISTURBED, varied[1] * DISTURBED, steady)


def _strength(strength: Array, site: Site | None) -> tuple[float, float, str]:
    """Strength over what it may be: for no field, for a disturbed one, in words."""
    mean = float(strength.mean())
    if site is None or site.b is None:
        return LEAST_NT / max(mean, 1.0), 0.0, f"the field is only {mean:.0f} nT strong"
    off = abs(mean / site.b - 1.0)
    return off / NO_FIELD, off / DISTURBED, f"the field is {mean:.0f} nT strong, the site's {site.b:.0f} nT"


def _scatter(strength: Array) -> tuple[float, float, str]:
    # of means over a twentieth of the window: noise of single samples does not count
    size = max(strength.size // 20, 1)
    means = strength[: strength.size // size * size].reshape(-1, size).mean(axis=1)
    scatter = float(means.std() / max(float(means.mean()), 1.0))
    return scatter / NO_FIELD, scatter / DISTURBED, f"the field's strength changes by {100.0 * scatter:.0f} %"


def _phase(turning: Turning) -> tuple[float, float, str]:
    if turning.by != "gyro" or not np.isfinite(turning.restless) or turning.span < TURNED or turning.slope < 0.0:
        return 0.0, 0.0, ""
    text = f"the transverse field does not turn with the tool: {np.degrees(turning.restless):.0f} deg about the gyro"
    return turning.restless / RESTLESS, turning.restless / UNEASY, text


WEAK: Final = (0.8 * STANDARD_GRAVITY, 1.2 * STANDARD_GRAVITY)
"""m/s^2, strength of gravity with which its direction is believed."""
MOST_U: Final = 0.05
"""rad, uncertainty of a dip that tells something."""
UNSURE: Final = 3.0
"""Standard deviations by which a dip must be off before it counts."""
OFF: Final = 0.02
"""Departure and scatter of the strength, of it, from which they count."""
STEEPEST: Final = 0.05
"""Least cosine of the dip that is used."""


class FieldOff(NamedTuple):
    """A window's field against the site's.

    dip : rad, mean; NaN where the window does not tell.
    off : rad, root mean square departure from the site's dip (without a site from its own mean); 0 where unknown.
    u : rad, standard uncertainty of the dip.
    strength, scatter : departure from the site's strength and variation within the window, of it.
    """

    dip: float
    off: float
    u: float
    strength: float
    scatter: float


def field_off(
    window: Samples, found: Harmonics | None, site: Site | None, *, strength: float, scatter: float
) -> FieldOff:
    """Dip of a window, whether the tool turns, slides or rests.

    Parameters
    ----------
    window : Samples
        With accelerometer and magnetometer, or the dip is NaN.
    found : Harmonics, optional
        Of a window that turned or rested.
    site : Site, optional
    strength, scatter : float
        As in the result.

    Notes
    -----
    A window without harmonics (a tool that slides) is turned back sample by sample by the magnetic phase; offsets stay.
    """
    accel, mag, u = (None, None, np.inf) if found is None else (found.accel, found.mag, found.u_accel)
    if found is None and window.accel is not None and window.mag is not None:
        accel, mag, u = _turned_back(window)
    expected = None if site is None else site.dip
    nothing = FieldOff(np.nan, 0.0, np.inf, strength, scatter)
    if accel is None or mag is None or not (np.isfinite(mag).all() and np.linalg.norm(mag, axis=1).all()):
        return nothing
    size = np.linalg.norm(accel, axis=1)
    if not (WEAK[0] < float(size.mean()) < WEAK[1] and u < MOST_U * STANDARD_GRAVITY):
        return nothing
    dips = dip_angle(accel, mag)
    mean = float(dips.mean())
    off = float(np.sqrt(np.mean((dips - (mean if expected is None else expected)) ** 2)))
    return FieldOff(mean, off, u / STANDARD_GRAVITY, strength, scatter)


def _turned_back(window: Samples) -> tuple[Array | None, Array | None, float]:
    """Gravity and field (1, 3) with the transverse field along x, and gravity's uncertainty."""
    used = slice(None) if window.clipped is None else ~window.clipped
    accel, mag = window.accel[used], window.mag[used]  # type: ignore[index]
    size = np.hypot(mag[:, 0], mag[:, 1]) if len(mag) else np.zeros(0)
    if len(mag) < 2 * BATCHES or not size.all():
        return None, None, np.inf
    phase = (mag[:, 0] - 1j * mag[:, 1]) / size
    across = (accel[:, 0] + 1j * accel[:, 1]) * phase
    turned = np.stack([across.real, across.imag, accel[:, 2]], axis=1)
    spread = batch_means(turned, BATCHES).var(axis=0, ddof=1) / BATCHES
    field = np.array([[float(size.mean()), 0.0, float(mag[:, 2].mean())]])
    return turned.mean(axis=0)[None], field, float(np.sqrt(spread.sum() / 3.0))


class RunDip:
    """Dip of a whole run, however the tool moves: in g.b = |g| |b| sin(dip) shaking averages out.

    Parameters
    ----------
    site : Site, optional
        Its gravity stands for the mean of an accelerometer that shakes.

    Examples
    --------
    >>> run = RunDip(Site(dip=1.0))
    >>> run.add(Samples([0.0], 0.1, accel=[[0.0, 0.0, 9.80665]], mag=[[20e3, 0.0, 40e3]]))
    >>> round(run.dip, 3)
    1.107
    """

    def __init__(self, site: Site | None) -> None:
        self._gravity = (site.gravity if site is not None else None) or STANDARD_GRAVITY
        self._dots, self._squares, self._count = 0.0, 0.0, 0

    def add(self, samples: Samples) -> None:
        """Samples of the run; those that are missing or clipped are passed over."""
        if samples.accel is None or samples.mag is None:
            return
        used = slice(None) if samples.clipped is None else ~samples.clipped
        accel, mag = samples.accel[used], samples.mag[used]
        self._dots += float(np.sum(accel * mag))
        self._squares += float(np.sum(mag**2))
        self._count += len(mag)

    @property
    def dip(self) -> float:
        """rad; NaN before a sample with gravity and field."""
        strength = np.sqrt(self._squares * self._count) * self._gravity
        return float(np.arcsin(np.clip(self._dots / strength, -1.0, 1.0))) if strength > 0.0 else float("nan")


def azimuth_doubt(off: FieldOff, site: Site | None) -> float:
    """rad, standard uncertainty of azimuth in a field that is off by so much: its share over the cosine of the dip.

    Notes
    -----
    A disturbance that turns or stretches the field by x of its strength turns its horizontal part by up to x / cos D;
    what lies across the meridian is not seen, so that the part that is seen is the estimate.

    Examples
    --------
    >>> round(azimuth_doubt(FieldOff(1.1, 0.05, 0.001, 0.0, 0.0), Site(dip=1.0)), 4)
    0.0924
    """
    noise = UNSURE * float(np.hypot(off.u, (site.dip_sigma or 0.0) if site is not None else 0.0))
    # only what its own uncertainty does not explain: a dip hardly known says little against an attitude known well
    turned = float(np.sqrt(max(off.off**2 - noise**2, 0.0)))
    uneven = UNSURE * (site.b_sigma or 0.0) / site.b if site is not None and site.b else 0.0
    parts = [turned] + [one if one > max(OFF, uneven) else 0.0 for one in (off.strength, off.scatter)]
    dip = site.dip if site is not None and site.dip is not None else off.dip
    level = float(np.cos(dip)) if np.isfinite(dip) else 1.0
    return float(np.linalg.norm(parts)) / max(level, STEEPEST)


def widened(row: Attitude, doubt: float) -> Attitude:
    """The rows with the uncertainty `doubt` (rad) of azimuth added where theirs is less than a third of it."""
    if not doubt > 0.0:
        return row
    spread = row.u.azimuth
    short = ~row.refused & (UNSURE * np.nan_to_num(spread, nan=np.inf) < doubt)
    if not short.any():
        return row
    covariance = row.covariance.copy()
    down = dcm_from_quaternion(row.quaternion[short])[:, :, 2]
    covariance[short] += doubt**2 * down[:, :, None] * down[:, None, :]
    return replace(row, covariance=covariance)

"""Whether there is a magnetic field to steer by: inside casing or beside steel there is not."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.motion.finding import Finding
from inclinometry.motion.samples import Samples
from inclinometry.motion.turning import Turning

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

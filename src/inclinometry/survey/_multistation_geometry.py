"""What the geometry of a run can tell of its sensors' errors, and refusal of one that cannot."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.attitude.orientation import angles, angles_jacobian
from inclinometry.core.angles import TAU
from inclinometry.core.arrays import Array
from inclinometry.core.errors import IdentifiabilityError, InputError

FEWEST: Final = 4
"""Stations of three invariants each; fewer leave nothing to judge the fit by."""

STEEP: Final = float(np.radians(5.0))
"""Inclination below which toolface and azimuth give way to the magnetic toolface."""

WIDE_GAP: Final = float(np.radians(100.0))
"""Gap between toolfaces from which the transverse biases rest on their priors (public multi-station practice)."""

LOST: Final = float(np.radians(3.0))
"""Standard deviation of azimuth from the axial bias alone beyond which a run is refused.

It is what 600 nT, a strong interference, do to a hole level east or west where the horizontal field is weak (12 uT).
"""

_GROSS: Final = ((0.9, 1.1), (0.7, 1.4))  # |g|, |b| over their references: other units or no such place
_GROSS_DIP: Final = float(np.radians(15.0))


def refuse_gross(measured: Array, reference: Array) -> None:
    """Refuse invariants (n, 3) that no sensor error explains: other units, axes or signs than assumed."""
    middle = np.median(measured, axis=0)
    for k, (name, unit) in enumerate((("|g|", "m/s^2"), ("|b|", "nT"))):
        low, high = _GROSS[k]
        if not low < middle[k] / reference[k] < high:
            raise InputError(
                f"the stations' median {name} is {middle[k]:.6g} {unit}, the reference {reference[k]:.6g}: "
                "no sensor error is that large; check the unit and the reference"
            )
    off = np.abs(measured[:, 2] - reference[2]).max()
    if np.median(np.abs(measured[:, 2] - reference[2])) > _GROSS_DIP:
        raise InputError(
            f"dips differ from the reference by up to {np.degrees(off):.1f} deg: axes swapped or a sign reversed "
            "between accelerometers and magnetometers, not sensor errors; check the convention of the file"
        )


def toolface_gap(fields: Array) -> float:
    """Largest gap between the toolfaces of stations (n, 6), rad; of magnetic toolfaces where no station is inclined."""
    found = angles(fields[:, :3], fields[:, 3:])
    inclined = np.sin(found.inclination) > np.sin(STEEP)
    turned = np.sort(found.toolface[inclined] if inclined.any() else found.magnetic_toolface)
    return float(np.diff(turned, append=turned[0] + TAU).max())


def heading_jacobian(fields: Array) -> Array:
    """Derivatives (n, 6) of azimuth by the fields; of magnetic toolface at stations too steep for an azimuth."""
    rows = angles_jacobian(fields[:, :3], fields[:, 3:])
    inclination = angles(fields[:, :3], fields[:, 3:]).inclination
    steep = np.sin(inclination) < np.sin(STEEP)
    return np.where(steep[:, None], rows[:, 3], rows[:, 1])


def refuse_few(stations: int) -> None:
    """Refuse a run of too few stations."""
    if stations < FEWEST:
        raise IdentifiabilityError(
            f"{stations} stations; a multi-station analysis needs at least {FEWEST}, at different toolfaces: "
            "add stations of the same run"
        )


def refuse_one_toolface(gap: float, allowed: float) -> None:
    """Refuse toolfaces that leave a gap wider than the priors allow."""
    if gap > allowed:
        raise IdentifiabilityError(
            f"all toolfaces lie within {np.degrees(TAU - gap):.0f} deg (largest gap {np.degrees(gap):.0f}, allowed "
            f"{np.degrees(allowed):.0f} deg): transverse biases cannot be told from scale and reference errors; add "
            "stations with the tool turned, e.g. rotation shots"
        )


def refuse_axial(spread: float, prior_nt: float, left_nt: float) -> None:
    """Refuse a run that leaves the axial bias, and with it the azimuth, open; `spread` is its part of azimuth, rad."""
    if spread > LOST:
        raise IdentifiabilityError(
            f"near-horizontal east-west all along: the axial magnetometer bias, known to {prior_nt:.0f} nT before, is "
            f"known to {left_nt:.0f} nT after and leaves azimuth uncertain by {np.degrees(spread):.1f} deg (allowed "
            f"{np.degrees(LOST):.0f}); add stations of another direction or state a tighter axial_sigma"
        )

"""What a departure of the field from the site's strength and dip means for an attitude."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.attitude.orientation import dip_angle, dip_jacobian
from inclinometry.core.arrays import Array
from inclinometry.earth.site import Site

DIP_SIGMA: Final = float(np.radians(0.2))
STRENGTH_SIGMA: Final = 130.0
"""Of a reference without its own: rad and nT (ISCWSA error model for MWD, MDI and MFI of a global model)."""
COVERAGE: Final = 3.0
"""Standard deviations a reference may be missed by."""
FAR_DIP: Final = 0.12
"""rad, between the dip and the site's: no disturbance that leaves the strength right, but axes or signs."""
FAR_STRENGTH: Final = 0.2
"""Share of the strength: not the Earth's field."""
SURE: Final = 5.0
"""Standard deviations of the window beyond these."""


class Departure(NamedTuple):
    """Of one window.

    dip, strength : departures over what is allowed; 0 without a reference.
    extra : nT, standard deviation of a further error of the field, per axis, that the departure gives away: the part
        that no uncertainty explains; as large across the departure as along it.
    far : whether no attitude may be built on the field.
    text : a sentence for the user where it is far.
    """

    dip: float
    strength: float
    extra: float
    far: bool
    text: str


def departure(gravity: Array, field: Array, covariance: Array, site: Site | None) -> Departure:
    """Hold the field of a window against the site.

    Parameters
    ----------
    gravity, field : (3,) ndarray
        Means, m/s^2 and nT.
    covariance : (6, 6) ndarray
        Of both.
    site : Site, optional

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> place = Site(b=50e3, dip=1.0)
    >>> g, b = np.array([0.0, 0.0, 9.8]), 50e3 * np.array([np.cos(1.3), 0.0, np.sin(1.3)])
    >>> found = departure(g, b, np.zeros((6, 6)), place)
    >>> found.far, round(found.extra)
    (True, 14476)
    """
    if site is None:
        return Departure(0.0, 0.0, 0.0, False, "")
    size = float(np.linalg.norm(field))
    excess, far, said = np.zeros(2), False, []
    shares = [0.0, 0.0]
    if site.dip is not None:
        slopes = dip_jacobian(gravity, field)
        own = float(np.sqrt(slopes @ covariance @ slopes))
        allowed = COVERAGE * float(np.hypot(own, DIP_SIGMA if site.dip_sigma is None else site.dip_sigma))
        off = float(dip_angle(gravity, field)) - site.dip
        shares[0], excess[0] = abs(off) / allowed, size * max(abs(off) - allowed, 0.0)
        if abs(off) > FAR_DIP + SURE * own:
            far = True
            said.append(f"the dip is {np.degrees(off):.1f} deg off the site's")
    if site.b is not None and size > 0.0:
        along = field / size
        own = float(np.sqrt(along @ covariance[3:, 3:] @ along))
        allowed = COVERAGE * float(np.hypot(own, STRENGTH_SIGMA if site.b_sigma is None else site.b_sigma))
        off = size - site.b
        shares[1], excess[1] = abs(off) / allowed, max(abs(off) - allowed, 0.0)
        if abs(off) > FAR_STRENGTH * site.b + SURE * own:
            far = True
            said.append(f"the field is {size:.0f} nT strong, the site's {site.b:.0f} nT")
    text = f"{' and '.join(said)}: axes or signs that are wrong, steel nearby, or another site" if said else ""
    return Departure(shares[0], shares[1], float(np.hypot(*excess)), far, text)


def doubted(covariance: Array, extra: float) -> Array:
    """Covariance (6, 6) of gravity and field with the further error of the field."""
    wider = covariance.copy()
    wider[[3, 4, 5], [3, 4, 5]] += extra**2
    return wider

"""What a departure of the field from the site's strength and dip means for an attitude."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from inclinometry.attitude.orientation import dip_angle, dip_jacobian
from inclinometry.attitude.rotations import dcm_from_quaternion, quaternion_from_dcm, rotation_z
from inclinometry.core.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.motion.result import Attitude

# Rows counted from true north, counted from magnetic north instead.


def to_magnetic(rows: Attitude, site: Site | None) -> Attitude | None:
    """The same attitude from magnetic north; None where the site states no declination.

    Parameters
    ----------
    rows : Attitude
        Counted from true north.
    site : Site, optional

    Notes
    -----
    Magnetic north lies the declination D east of true north, so that C_t,magnetic = C_t,true R_z(D)'. Its standard
    deviation is added about the vertical.

    Examples
    --------
    >>> from inclinometry.attitude.rotations import dcm
    >>> from inclinometry.motion.result import METHODS
    >>> one = Attitude(np.zeros(1), quaternion_from_dcm(dcm(1.0, 0.5, 2.0))[None], np.zeros((1, 3, 3)), np.zeros(1),
    ...                np.ones(1), np.zeros(1, dtype=np.uint32), np.zeros(1, dtype=np.uint8), "true")
    >>> found = to_magnetic(one, Site(declination=0.25))
    >>> found.north, round(float(found.angles.azimuth[0]), 9)
    ('magnetic', 0.75)
    """
    if site is None or site.declination is None:
        return None
    quaternion, covariance = rows.quaternion.copy(), rows.covariance.copy()
    good = ~rows.refused
    if good.any():
        matrix = dcm_from_quaternion(quaternion[good]) @ rotation_z(site.declination).T
        quaternion[good] = quaternion_from_dcm(matrix)
        down = matrix[:, :, 2]
        covariance[good] += (site.declination_sigma or 0.0) ** 2 * np.einsum("ki,kj->kij", down, down)
    return replace(rows, quaternion=quaternion, covariance=covariance, north="magnetic")


DIP_SIGMA: Final = float(np.radians(0.2))
STRENGTH_SIGMA: Final = 130.0
"""Of a reference without its own: rad and nT (ISCWSA error model for MWD, MDI and MFI of a global model)."""
COVERAGE: Final = 3.0
"""Standard deviations a reference may be missed by."""
FAR_DIP: Final = 0.12
"""rad, between the dip and the site's: no disturbance that leaves the strength right, but axes or signs."""
FAR_STRENGTH: Final = 0.2
"""Share of the strength: not the Earth's field."""
ENOUGH: Final = 3
"""Windows that must agree before a site is doubted,"""
ALIKE: Final = 0.2
"""and the scatter of their fields, of their departure from the site's, up to which they are one field."""
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
            seen, stated = np.degrees((off + site.dip, site.dip))
            said.append(f"the dip comes out as {seen:.1f} deg, the site's is {stated:.1f} deg")
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


@dataclass
class SiteDoubt:
    """Windows that agree with each other on a field that is not the site's: another place, more likely than steel.

    Parameters
    ----------
    site : Site, optional

    Examples
    --------
    >>> from inclinometry.earth.site import Site
    >>> doubt = SiteDoubt(Site(dip=1.2))
    >>> for _ in range(3):
    ...     doubt.add(np.array([0.0, 0.0, 9.8]), np.array([np.cos(1.1), 0.0, np.sin(1.1)]), 0.0)
    >>> doubt.notes("at rest")[0].partition(":")[0]
    'the site says dip 68.8 deg, all 3 windows at rest show 63.0'
    """

    site: Site | None
    _count: int = 0
    _sums: Array = field(default_factory=lambda: np.zeros((2, 2)))
    _missed: Array = field(default_factory=lambda: np.zeros(2))

    def add(self, gravity: Array, field_: Array, u: float) -> None:
        """Gravity and field (3,) of a window, in any unit and nT, and the standard uncertainty of the dip, rad."""
        site = self.site
        if site is None or not (np.linalg.norm(gravity) > 0.0 and np.linalg.norm(field_) > 0.0):
            return
        seen = np.array([float(dip_angle(gravity, field_)), float(np.linalg.norm(field_))])
        self._count += 1
        self._sums = self._sums + np.stack([seen, seen**2])
        sigmas = (
            float(np.hypot(DIP_SIGMA if site.dip_sigma is None else site.dip_sigma, u)),
            STRENGTH_SIGMA if site.b_sigma is None else site.b_sigma,
        )
        for place, known in enumerate((site.dip, site.b)):
            self._missed[place] += known is not None and abs(seen[place] - known) > COVERAGE * sigmas[place]

    def notes(self, kind: str) -> tuple[str, ...]:
        """A sentence where all windows of this kind miss the site alike."""
        if self._count < ENOUGH or self.site is None:
            return ()
        mean = self._sums[0] / self._count
        scatter = np.sqrt(np.maximum(self._sums[1] / self._count - mean**2, 0.0))
        said = []
        for place, known in enumerate((self.site.dip, self.site.b)):
            if known is None or self._missed[place] < self._count or scatter[place] > ALIKE * abs(mean[place] - known):
                continue
            pair = (f"dip {np.degrees(known):.1f} deg", f"{np.degrees(mean[0]):.1f}")
            pair = pair if place == 0 else (f"a field of {known:.0f} nT", f"{mean[1]:.0f}")
            said.append(f"the site says {pair[0]}, all {self._count} windows {kind} show {pair[1]}")
        return (f"{'; '.join(said)}: is this the right site file, or does steel go with the tool?",) if said else ()


def doubted(covariance: Array, extra: float) -> Array:
    """Covariance (6, 6) of gravity and field with the further error of the field."""
    wider = covariance.copy()
    wider[[3, 4, 5], [3, 4, 5]] += extra**2
    return wider

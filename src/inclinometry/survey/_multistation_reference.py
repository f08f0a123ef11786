"""What the fields at a run's stations should be, and how well that is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inclinometry.core.arrays import Array, within
from inclinometry.core.errors import InputError
from inclinometry.earth.magnetic import reference_errors
from inclinometry.earth.site import Site
from inclinometry.survey._multistation_priors import published


@dataclass(frozen=True, kw_only=True)
class FieldReference:
    """What |g|, m/s^2, |b|, nT, and dip, rad, should be; standard deviations of what is common to the run.

    g_random, b_random, dip_random : standard deviations of the field itself from station to station (disturbances);
        counted beside the noise that stations state of their own.
    """

    g: float
    b: float
    dip: float
    g_sigma: float
    b_sigma: float
    dip_sigma: float
    g_random: float = 0.0
    b_random: float = 0.0
    dip_random: float = 0.0

    def __post_init__(self) -> None:
        within(self.g, "reference g", 9.5, 10.1, "m/s^2")
        within(self.b, "reference b", 5e3, 2e5, "nT")
        within(self.dip, "reference dip", -np.pi / 2, np.pi / 2, "rad")
        for name, most in (("g", 1.0), ("b", 1e5), ("dip", np.pi)):
            within(getattr(self, f"{name}_sigma"), f"{name}_sigma", 0.0, most)
            within(getattr(self, f"{name}_random"), f"{name}_random", 0.0, most)

    @property
    def values(self) -> Array:
        """g, b, dip."""
        return np.array([self.g, self.b, self.dip])

    @property
    def sigmas(self) -> Array:
        """Their standard deviations, common to the run."""
        return np.array([self.g_sigma, self.b_sigma, self.dip_sigma])

    @property
    def randoms(self) -> Array:
        """Standard deviations from station to station."""
        return np.array([self.g_random, self.b_random, self.dip_random])


def reference_of_site(site: Site, kind: str = "WMM") -> FieldReference:
    """The reference that a site states; what it lacks of uncertainty is that of a kind of geomagnetic reference.

    Parameters
    ----------
    site : Site
        With b, dip and gravity (`earth.magnetic.complete_site` fills b and dip from a model).
    kind : str
        As in `earth.magnetic.reference_errors`.

    Raises
    ------
    InputError
        The site knows no b, dip or gravity.

    Examples
    --------
    >>> found = reference_of_site(Site(g=9.81, b=50_000.0, dip=1.2, b_sigma=45.0))
    >>> found.b_sigma, round(float(np.degrees(found.dip_sigma)), 2)
    (45.0, 0.22)
    """
    g, b, dip = site.gravity, site.b, site.dip
    if g is None or b is None or dip is None:
        lacking = [name for name, value in (("g", g), ("b", b), ("dip", dip)) if value is None]
        raise InputError(
            f"the site has no {', '.join(lacking)}; a multi-station analysis compares with them: give them"
        )
    errors, own = reference_errors(kind), published()["reference"]
    return FieldReference(
        g=g,
        b=b,
        dip=dip,
        g_sigma=own["g_m_s2"] if site.gravity_sigma is None else site.gravity_sigma,
        b_sigma=errors.b if site.b_sigma is None else site.b_sigma,
        dip_sigma=errors.dip if site.dip_sigma is None else site.dip_sigma,
        g_random=own["g_random_m_s2"],
        b_random=errors.b_random,
        dip_random=errors.dip_random,
    )

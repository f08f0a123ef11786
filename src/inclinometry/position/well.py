"""A surveyed well as error models see it: stations, true vertical depths, azimuths from every north, the place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array, finite, frozen, within
from inclinometry.core.constants import EARTH_RATE
from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.survey.path import minimum_curvature

NORTHS: Final = ("true", "grid")
"""Norths that positions may be counted from."""


@dataclass(frozen=True, eq=False)
class WellSurvey:
    """n stations of a well; see `well_survey`.

    md, tvd : (n,) m, from the same datum.
    inclination, azimuth : (n,) rad; azimuth from true north.
    site : Site
    north : {"true", "grid"}
        What north and east of the results are counted from.
    surface : bool
        Whether the first station is the wellhead, whose depth has an error of its own; otherwise the survey is tied to
        a station whose uncertainty is `tie`.
    tie : (3, 3) covariance of the first station's position north, east, down, m^2.
    """

    md: Array
    inclination: Array
    azimuth: Array
    tvd: Array
    site: Site
    north: str = "true"
    surface: bool = True
    tie: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        md = finite(self.md, "md", (None,))
        if len(md) < 2:
            raise InputError(f"the survey has {len(md)} station; a path needs two or more")
        if (np.diff(md) <= 0.0).any():
            row = int(np.argmax(np.diff(md) <= 0.0))
            raise InputError(f"md goes from {md[row]:g} to {md[row + 1]:g} m at station {row + 2}; it must increase")
        columns = {
            "md": md,
            "inclination": within(self.inclination, "inclination", 0.0, np.pi, "rad"),
            "azimuth": finite(self.azimuth, "azimuth"),
            "tvd": finite(self.tvd, "tvd"),
        }
        for name, column in columns.items():
            if column.shape != md.shape:
                raise InputError(f"{name} has shape {column.shape}, md has {md.shape}; one value a station is needed")
            object.__setattr__(self, name, frozen(column))
        if self.north not in NORTHS:
            raise InputError(f"north is {self.north!r}; allowed: {', '.join(NORTHS)}")
        object.__setattr__(self, "tie", frozen(finite(self.tie, "tie", (3, 3))))

    def __len__(self) -> int:
        return len(self.md)

    @property
    def result_azimuth(self) -> Array:
        """Azimuth (n,) from the north of the results, rad, in [0, 2 pi)."""
        return convert_azimuth(self.azimuth, "true", self.north, self.site)

    def variables(self, vertical: float) -> Mapping[str, Any]:
        """Lower-case variables of the formulas; those that the site doesn't know are left out.

        Parameters
        ----------
        vertical : float
            Inclination, rad, below which a station has no azimuth of its own to differ from the next one's.
        """
        found: dict[str, Any] = {"md": self.md, "tvd": self.tvd, "inc": self.inclination, "earthrate": EARTH_RATE}
        found["k"] = np.where(self.inclination > np.pi / 2, -1.0, 1.0)  # switch of canted accelerometers, SPE 90408
        found["azt"] = found["az"] = self.azimuth
        if self.site.declination is not None:
            found["azm"] = convert_azimuth(self.azimuth, "true", "magnetic", self.site)
        found["mdprev"], found["incprev"] = _before(self.md), _before(self.inclination)
        # counted on from this station's azimuth, so that the difference of the two is the short way round
        turn = wrap_signed(self.azimuth - _before(self.azimuth))
        turn = np.where(_before(self.inclination) < vertical, 0.0, turn)
        for name in ("azt", "az", "azm"):
            if name in found:
                found[f"{name}prev"] = found[name] - turn
        known = {
            "gfield": self.site.gravity,
            "bfield": self.site.b,
            "dip": self.site.dip,
            "latitude": self.site.latitude,
        }
        return MappingProxyType({**found, **{name: value for name, value in known.items() if value is not None}})


def _before(column: Array) -> Array:
    return np.concatenate([column[:1], column[:-1]])


def well_survey(
    md: ArrayLike,
    inclination: ArrayLike,
    azimuth: ArrayLike,
    site: Site,
    reference: str = "true",
    *,
    tvd: ArrayLike | None = None,
    north: str | None = None,
    tie: ArrayLike | None = None,
) -> WellSurvey:
    """Stations of a well for `inclinometry.position.propagation.propagate`.

    Parameters
    ----------
    md : (n,) array_like
        Measured depth, m, increasing.
    inclination, azimuth : (n,) array_like
        rad.
    site : Site
        Whatever the error model's formulas need of it: gravity, b, dip, declination, convergence, latitude.
    reference : {"magnetic", "true", "grid"}
        The north that `azimuth` is counted from.
    tvd : (n,) array_like, optional
        True vertical depth, m, from the datum of md; by minimum curvature where not given, md at a vertical start.
    north : {"true", "grid"}, optional
        The north of the results; grid where the azimuths are from grid north, else true.
    tie : (3, 3) array_like, optional
        Covariance, m^2, of the first station's position. Where md starts at 0 the first station is the wellhead, whose
        depth has the error of a measured depth too.

    Returns
    -------
    WellSurvey

    Raises
    ------
    InputError
        Depths that don't increase, with the station; values that are not finite or out of range; a reference that
        the site cannot turn into true north.

    Examples
    --------
    >>> site = Site(declination=0.05)
    >>> float(well_survey([0, 30], [0, 0.1], [1.0, 1.0], site, "magnetic").azimuth[1])
    1.05
    """
    angle = finite(azimuth, "azimuth")
    true = angle if reference == "true" else convert_azimuth(angle, reference, "true", site)
    target = north or ("grid" if reference == "grid" else "true")
    if target == "grid" and site.convergence is None:
        raise InputError("the site has no convergence; positions from grid north need it: give the convergence")
    depths = finite(md, "md", (None,))
    if tvd is None:
        first = float(depths[0]) if len(depths) else 0.0
        tvd = minimum_curvature(depths, inclination, true, start=(0.0, 0.0, first)).tvd
    return WellSurvey(
        depths,
        finite(inclination, "inclination"),
        true,
        finite(tvd, "tvd"),
        site,
        target,
        bool(len(depths)) and depths[0] == 0.0,
        np.zeros((3, 3)) if tie is None else finite(tie, "tie", (3, 3)),
    )

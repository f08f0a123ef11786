"""A surveyed well as error models see it: stations, depths, azimuths from every north, the place; ellipses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite, frozen, increasing, within
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.site import Site, convert_azimuth
from inclinometry.errors import SiteError, not_among, refused, wrong_shape
from inclinometry.findings import Finding
from inclinometry.rotations import dcm, wrap_positive, wrap_signed
from inclinometry.survey.path import minimum_curvature
from inclinometry.tabular import Column, Tabular, in_degrees
from inclinometry.uncertainty import ellipsoid_factor


class HorizontalEllipse(NamedTuple):
    """Horizontal ellipses.

    major, minor : (...) semi-axes, m.
    direction : (...) of the major axis from the north of the covariance, rad, in [0, pi).
    """

    major: Array
    minor: Array
    direction: Array


class Ellipsoid(NamedTuple):
    """Ellipsoids in space.

    semi_axes : (..., 3) m, largest first.
    directions : (..., 3, 3) unit vectors north, east, down, one row a semi-axis.
    """

    semi_axes: Array
    directions: Array


def horizontal_ellipse(covariance: ArrayLike, probability: float | None = None) -> HorizontalEllipse:
    """Ellipse of north and east.

    Parameters
    ----------
    covariance : (..., 3, 3) or (..., 2, 2) array_like
        North, east (, down), m^2.
    probability : float, optional
        That the ellipse holds the true position of a normal distribution, e.g. 0.95; one standard deviation along each
        axis where not given, which holds 39.3 %.

    Returns
    -------
    HorizontalEllipse

    Raises
    ------
    InputError
        Values that are not finite, negative variances, a probability outside (0, 1).

    Examples
    --------
    >>> found = horizontal_ellipse([[4.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 1.0]])
    >>> float(found.major), float(found.minor), float(np.degrees(found.direction))
    (3.0, 2.0, 90.0)
    """
    matrix = _covariance(covariance, (2, 3))
    nn, ee, ne = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 0, 1]
    middle, half = 0.5 * (nn + ee), np.hypot(0.5 * (nn - ee), ne)
    direction = np.mod(wrap_positive(0.5 * np.arctan2(2.0 * ne, nn - ee)), np.pi)
    major = middle + half
    # the product of the axes, for the difference of two large numbers would lose the small one
    with np.errstate(invalid="ignore", divide="ignore"):
        minor = np.where(major > 0.0, (nn * ee - ne**2) / np.where(major > 0.0, major, 1.0), 0.0)
    factor = 1.0 if probability is None else ellipsoid_factor(probability, 2)
    return HorizontalEllipse(factor * np.sqrt(major), factor * np.sqrt(np.maximum(minor, 0.0)), direction)


def ellipsoid(covariance: ArrayLike, probability: float | None = None) -> Ellipsoid:
    """Ellipsoid in space.

    Parameters
    ----------
    covariance : (..., 3, 3) array_like
        North, east, down, m^2.
    probability : float, optional
        That the ellipsoid holds the true position; one standard deviation along each axis where not given (19.9 %).

    Returns
    -------
    Ellipsoid

    Raises
    ------
    InputError
        As `horizontal_ellipse`.

    Examples
    --------
    >>> ellipsoid(np.diag([1.0, 4.0, 9.0])).semi_axes
    array([3., 2., 1.])
    """
    values, vectors = np.linalg.eigh(_covariance(covariance, (3,)))
    factor = 1.0 if probability is None else ellipsoid_factor(probability, 3)
    axes = factor * np.sqrt(np.maximum(values, 0.0))[..., ::-1]
    return Ellipsoid(axes, np.swapaxes(vectors, -1, -2)[..., ::-1, :])


def hole_covariance(covariance: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike) -> Array:
    """Covariance (..., 3, 3), m^2, from north, east, down to high side, lateral (right of it), along hole.

    The axes are (cos I cos A, cos I sin A, -sin I), (-sin A, cos A, 0), (sin I cos A, sin I sin A, cos I): the rows of
    C_tn at toolface 0. At a vertical station the azimuth decides where the high side is taken.
    """
    matrix = _covariance(covariance, (3,))
    turn = dcm(azimuth, inclination, 0.0)
    return np.asarray(turn @ matrix @ np.swapaxes(turn, -1, -2))


def hole_sigmas(covariance: ArrayLike, inclination: ArrayLike, azimuth: ArrayLike) -> Array:
    """Standard deviations (..., 3), m, high side, lateral and along hole; see `hole_covariance`.

    Examples
    --------
    >>> hole_sigmas(np.diag([1.0, 4.0, 9.0]), 0.0, 0.0)
    array([1., 2., 3.])
    """
    variances = np.diagonal(hole_covariance(covariance, inclination, azimuth), axis1=-2, axis2=-1)
    return np.asarray(np.sqrt(np.maximum(variances, 0.0)))


def _covariance(value: ArrayLike, sizes: tuple[int, ...]) -> Array:
    matrix = finite(value, "covariance", (None, None))
    if matrix.shape[-1] != matrix.shape[-2] or matrix.shape[-1] not in sizes:
        raise wrong_shape("covariance", matrix.shape, ", ".join(f"(..., {size}, {size})" for size in sizes))
    if (np.diagonal(matrix, axis1=-2, axis2=-1) < 0.0).any():
        raise refused("position-covariance", {"name": "covariance"})
    return matrix


@dataclass(frozen=True, eq=False, repr=False)
class WellSurvey(Tabular):
    """n stations of a well; see `well_survey`.

    md, tvd : (n,) m, from the same datum.
    inclination, azimuth : (n,) rad; azimuth from `reference`.
    site : Site
    north : {"true", "grid"}
        What north and east of the results are counted from.
    surface : bool
        Whether the first station is the wellhead, whose depth has an error of its own; otherwise the survey is tied to
        a station whose uncertainty is `tie`.
    tie : (3, 3) covariance of the first station's position north, east, down, m^2.
    reference : {"true", "grid"}
        The north of the azimuths: true, which error models need, or grid where the site has no convergence.
    """

    md: Array
    inclination: Array
    azimuth: Array
    tvd: Array
    site: Site
    north: str = "true"
    surface: bool = True
    tie: Array = field(default_factory=lambda: np.zeros((3, 3)))
    reference: str = "true"

    def __post_init__(self) -> None:
        md = finite(self.md, "md", (None,))
        if len(md) < 2:
            raise refused("input-few", {"name": "stations", "count": len(md), "least": 2})
        increasing(md, "md")
        columns = {
            "md": md,
            "inclination": within(self.inclination, "inclination", 0.0, np.pi, "rad"),
            "azimuth": finite(self.azimuth, "azimuth"),
            "tvd": finite(self.tvd, "tvd"),
        }
        for name, column in columns.items():
            if column.shape != md.shape:
                raise wrong_shape(name, column.shape, str(md.shape))
            object.__setattr__(self, name, frozen(column))
        for name in ("north", "reference"):
            if getattr(self, name) not in ("true", "grid"):
                raise not_among(name, getattr(self, name), ("true", "grid"))
        object.__setattr__(self, "tie", frozen(finite(self.tie, "tie", (3, 3))))

    def __len__(self) -> int:
        return len(self.md)

    @property
    def result_azimuth(self) -> Array:
        """Azimuth (n,) from the north of the results, rad, in [0, 2 pi)."""
        return convert_azimuth(self.azimuth, self.reference, self.north, self.site)

    @property
    def true_azimuth(self) -> Array:
        """Azimuth (n,) from true north, rad; InputError where the site has no convergence to find it by."""
        if self.reference == "true":
            return self.azimuth
        return convert_azimuth(self.azimuth, self.reference, "true", self.site)

    def variables(self, vertical: float) -> Mapping[str, Any]:
        """Lower-case variables of the formulas; those that the site doesn't know are left out.

        Parameters
        ----------
        vertical : float
            Inclination, rad, below which a station has no azimuth of its own to differ from the next one's.
        """
        found: dict[str, Any] = {"md": self.md, "tvd": self.tvd, "inc": self.inclination, "earthrate": EARTH_RATE}
        found["k"] = np.where(self.inclination > np.pi / 2, -1.0, 1.0)  # switch of canted accelerometers, SPE 90408
        true = found["azt"] = found["az"] = self.true_azimuth
        if self.site.declination is not None:
            found["azm"] = convert_azimuth(true, "true", "magnetic", self.site)
        found["mdprev"], found["incprev"] = _before(self.md), _before(self.inclination)
        # counted on from this station's azimuth, so that the difference of the two is the short way round
        turn = wrap_signed(true - _before(true))
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

    def to_dict(self) -> dict[str, Column]:
        """One row a station: depth, direction, vertical depth."""
        return {"md_m": self.md, **in_degrees(self, "inclination", "azimuth"), "tvd_m": self.tvd}


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
        Its azimuths from true north; from grid north where they are counted from it, the results too, and the site has
        no convergence: enough for positions, not for an error model.

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
    target = north or ("grid" if reference == "grid" else "true")
    kept = "grid" if reference == target == "grid" and site.convergence is None else "true"
    angle = angle if reference == kept else convert_azimuth(angle, reference, kept, site)
    if kept == "true" and target == "grid" and site.convergence is None:
        raise SiteError(Finding("input-missing", {"names": ("convergence_deg",)}))
    depths = finite(md, "md", (None,))
    if tvd is None:
        first = float(depths[0]) if len(depths) else 0.0
        tvd = minimum_curvature(depths, inclination, angle, start=(0.0, 0.0, first)).tvd
    return WellSurvey(
        depths,
        finite(inclination, "inclination"),
        angle,
        finite(tvd, "tvd"),
        site,
        target,
        bool(len(depths)) and depths[0] == 0.0,
        np.zeros((3, 3)) if tie is None else finite(tie, "tie", (3, 3)),
        kept,
    )

"""What the gyro package returns: rates averaged over index positions, and stations with north and scale factor."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, Mask
from inclinometry.errors import out_of_range, refused, wrong_kind, wrong_shape
from inclinometry.findings import Finding
from inclinometry.tabular import Column, Tabular, degrees, in_degrees
from inclinometry.uncertainty import angle_sd


def numbers(value: ArrayLike, name: str) -> Array:
    """float64, NaN allowed; InputError for what is no number."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise wrong_kind(name, reprlib.repr(value), "array of numbers") from None


def per_station(value: ArrayLike, size: int, name: str, low: float, high: float, unit: str = "") -> Array:
    """One value for each of `size` stations, within low..high; a scalar serves all."""
    given = numbers(value, name)
    if given.shape not in ((), (1,), (size,)):
        raise wrong_shape(name, given.shape, f"() | ({size},)")
    bad = ~((given >= low) & (given <= high))
    if bad.any():
        worst = float(np.atleast_1d(given)[np.atleast_1d(bad)][0])
        raise out_of_range(name, worst, f"{low:g} .. {high:g} {unit}".rstrip())
    return np.broadcast_to(given, (size,))


def one_value(value: ArrayLike, name: str, low: float, high: float, unit: str = "") -> float:
    """A single value within low..high."""
    return float(per_station(value, 1, name, low, high, unit)[0])


def vectors(value: ArrayLike, name: str, largest: float, size: int | None = None) -> Array:
    """Vectors (n, 3); z NaN where it is not measured, x and y finite."""
    given = numbers(value, name)
    shaped = given.ndim == 2 and given.shape[1] in (2, 3) and size in (None, given.shape[0])
    if not shaped:
        count = "n" if size is None else size
        raise wrong_shape(name, given.shape, f"({count}, 2) | ({count}, 3)")
    out = np.full((len(given), 3), np.nan)
    out[:, : given.shape[1]] = given
    bad = ~(np.abs(out) <= largest)
    bad[:, 2] &= ~np.isnan(out[:, 2])
    if bad.any():
        row, axis = np.argwhere(bad)[0].tolist()
        raise out_of_range(f"{name}[{row}, {axis}]", float(out[row, axis]), f"{-largest:g} .. {largest:g}")
    return out


def weights(covariance: Array, seen: Mask) -> Array:
    """Inverse (n, 3, 3) of each covariance; over x and y only, z zero, where z is not `seen`."""
    full = np.where(seen[:, None, None], covariance, np.eye(3))
    full[:, :2, :2] = covariance[:, :2, :2]
    inverse = np.asarray(np.linalg.inv(full))
    inverse[~seen, 2, 2] = 0.0
    return inverse


def covariances(value: ArrayLike, name: str, seen: Mask, *, positive: bool) -> Array:
    """Covariances (n, 3, 3), rows and columns of z NaN where z is not `seen`; one matrix serves all stations."""
    given, size = numbers(value, name), len(seen)
    if given.ndim == 2:
        given = np.broadcast_to(given, (size, *given.shape))
    if given.ndim != 3 or given.shape[0] != size or given.shape[1:] not in ((2, 2), (3, 3)):
        raise wrong_shape(name, given.shape, f"({size}, 2, 2) | ({size}, 3, 3)")
    out = np.full((size, 3, 3), np.nan)
    axes = given.shape[1]
    out[:, :axes, :axes] = given
    out[~seen, 2, :] = out[~seen, :, 2] = np.nan
    if seen.any() and axes == 2:
        raise wrong_shape(name, given.shape, f"({size}, 3, 3)")
    # matrices that are no covariances, looked at by 2 x 2 minors and, with z, the determinant
    bad = np.zeros(len(out), dtype=bool)
    variance = np.diagonal(out, axis1=1, axis2=2)
    skew = 1e-6
    for i, j in ((0, 1), (0, 2), (1, 2)):
        used = seen if j == 2 else np.ones(len(seen), dtype=bool)
        with np.errstate(invalid="ignore", over="ignore"):
            product, cross = variance[:, i] * variance[:, j], out[:, i, j]
            fits = (variance[:, i] >= 0.0) & (variance[:, j] >= 0.0) & np.isfinite(product)
            fits &= np.abs(cross - out[:, j, i]) <= skew * np.sqrt(np.maximum(product, 0.0))
            fits &= cross**2 < product if positive else cross**2 <= product * (1.0 + skew)
        bad |= used & ~fits
    whole = seen & ~bad
    if positive and whole.any():
        # by the mean variance, so that determinants neither over- nor underflow
        mean = np.trace(out[whole], axis1=1, axis2=2)[:, None, None] / 3.0
        bad[whole] |= ~(np.linalg.det(out[whole] / mean) > 0.0)
    if bad.any():
        row = int(np.argmax(bad))
        raise refused("input-covariance", {"name": f"{name}[{row}]", "allowed": "> 0" if positive else ">= 0"})
    return out


FLAGS = {
    "vertical": "azimuth and toolface are hardly defined; use the gyro toolface (azimuth + toolface)",
    "down-assumed": "hole direction not given: down assumed; give --hole",
    "ambiguous": "another azimuth fits the rates nearly as well; a gyro along the tool or a better known scale decides",
    "weak": "the rates hardly depend on azimuth here (near horizontal east-west); u covers the whole likely range",
    "scale": "the scale factor is further from what was expected than its uncertainty allows",
    "misfit": "the rates do not fit the Earth's at this latitude within their uncertainty; no azimuth where none fits",
    "spike": "one index position disagrees with the others and was left out",
    "noisy": "index positions disagree by more than the noise",
    "channel": "a channel failed here: it kept one value, changed its size, or was ten times as noisy; no azimuth",
    "temperature": "outside the temperatures of the calibration; the parameters are extrapolated",
    "complex": "no real scale factor solves the closed form: noise near its double root",
    "double-root": "the two scale factors of the closed form cannot be distinguished (K is zero within noise)",
    "history": "both scale factors of the closed form are possible; earlier ones, if any, are near neither",
    "horizontal": "inclination near 90: a tool without z does not show how near, the closed form loses the quadrant",
    "up-hole": "inclination above 90: outside the closed form",
    "parallel": "the tool is parallel to the Earth's axis: its cross-axis gyros measure no Earth rate",
}
"""What a flag means."""


@dataclass(frozen=True, eq=False)
class IndexAverage:
    """Field in tool axes at index 0, one row a station (n), freed from what does not turn with the index."""

    field: Array  #: (n, 3) in the unit of the readings (or of the calibration's field); z NaN where no channel sees it
    covariance: Array  #: (n, 3, 3); rows and columns of z NaN where z is
    # bias, known offset included, and drift: (n, m) of each channel, per reading unit and per second; drift 0 where it
    # was not fitted
    bias: Array
    drift: Array
    # chi_square, dof: (n,) weighted squared residuals and their degrees of freedom
    chi_square: Array
    dof: Array
    noise: Array  #: (m,) standard deviation of one reading that the covariance rests on
    flags: Sequence[Sequence[str]]  #: per station, names of `FLAGS`
    left_out: Sequence[tuple[int, int]] = ()  #: (station, row) of readings not used
    findings: Sequence[Finding] = ()  #: on the readings of a run
    noise_freedom: float = np.inf  #: of the residuals the noise was estimated from; infinite where given

    def __len__(self) -> int:
        return len(self.field)


@dataclass(frozen=True, eq=False, repr=False)
class North(Tabular):
    """Stations with azimuth from true north; angles in rad, one row a station (n).

    Where the closed form fails azimuth and scale are NaN and the flag says why; the joint estimate is never NaN.
    """

    inclination: Array
    azimuth: Array
    toolface: Array
    gyro_toolface: Array  #: azimuth + toolface, defined when vertical too
    scale: Array  #: true rate = scale x reading
    u_scale: Array
    k: Array  #: K = cos(lat) cos(inc) + sin(lat) sin(inc) cos(azi): the scale factor is not observable where it is zero
    root: Sequence[str]  #: "+" or "-", the sign of K: the root of the closed form that is true
    #: cause -> (n, 4) variances of inclination, azimuth, toolface, gyro toolface, rad^2
    components: Mapping[str, Array]
    # chi_square, dof: misfit of the rates, prior included, and its degrees of freedom
    chi_square: Array
    dof: Array
    flags: Sequence[Sequence[str]]  #: per station, names of `FLAGS`
    method: str  #: "joint", "fixed", "patent" or "tracked"
    # how inclination, azimuth, and the hole's direction to north and east (rows) follow "gravity" and "rate" in tool
    # axes, (n, 4, 3), per m/s^2 and rad/s, the expected 1/scale, "prior", and the latitude, "latitude", (n, 4, 1); of
    # the joint and the fixed estimate only
    response: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.inclination)

    def u(self, name: str) -> Array:
        """Standard uncertainty (n,) of "inclination", "azimuth", "toolface" or "gyro_toolface", rad, all causes.

        Never more than that of an angle about which nothing is known.
        """
        column = ("inclination", "azimuth", "toolface", "gyro_toolface").index(name)
        return angle_sd(self.components, column)

    def to_dict(self) -> dict[str, Column]:
        """One row a station: angles, their standard uncertainties, scale factor, K, root and flags."""
        angles = ("inclination", "azimuth", "toolface", "gyro_toolface")
        found = in_degrees(self, *angles) | {f"u_{name}_deg": degrees(self.u(name)) for name in angles}
        found |= {"scale": self.scale, "u_scale": self.u_scale, "K": self.k}
        return found | {"root": list(self.root), "flags": ["|".join(names) for names in self.flags]}

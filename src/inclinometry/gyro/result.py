"""What the gyro room returns: rates averaged over index positions, and stations with north and scale factor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from inclinometry.core.arrays import Array
from inclinometry.uncertainty.propagation import angle_sd

FLAGS = {
    "vertical": "azimuth and toolface are hardly defined; use the gyro toolface (azimuth + toolface)",
    "down-assumed": "nothing along the tool tells down from up; down is taken: state the direction of the hole",
    "ambiguous": "another azimuth fits the rates nearly as well; a gyro along the tool or a better known scale decides",
    "weak": "the rates hardly depend on azimuth here (near horizontal east-west); u covers the whole likely range",
    "scale": "the scale factor is further from what was expected than its uncertainty allows",
    "misfit": "the rates do not fit the Earth's at this latitude within their uncertainty",
    "spike": "one index position disagrees with the others and was left out",
    "noisy": "index positions disagree by more than the noise",
    "temperature": "outside the temperatures of the calibration; the parameters are extrapolated",
    "complex": "no real scale factor solves the closed form: noise near its double root",
    "double-root": "the two scale factors of the closed form cannot be told apart (K is zero within noise)",
    "history": "both scale factors of the closed form are possible; earlier ones, if any, are near neither",
    "horizontal": "inclination near 90: a tool without z cannot tell how near, and the closed form loses the quadrant",
    "up-hole": "inclination above 90: outside the closed form",
    "parallel": "the tool is parallel to the Earth's axis: its cross-axis gyros see nothing",
}
"""What a flag means."""


@dataclass(frozen=True, eq=False)
class IndexAverage:
    """Field in tool axes at index 0, one row a station (n), freed from what does not turn with the index.

    field : (n, 3) in the unit of the readings (or of the calibration's field); z NaN where no channel sees it.
    covariance : (n, 3, 3); rows and columns of z NaN where z is.
    bias, drift : (n, m) of each channel, per reading unit and per second; drift 0 where it was not fitted.
    chi_square, dof : (n,) weighted squared residuals and their degrees of freedom.
    noise : (m,) standard deviation of one reading that the covariance rests on.
    flags : per station, names of `FLAGS`.
    left_out : (station, row) of readings not used.
    notes : what was estimated; warnings : what may be wrong.
    """

    field: Array
    covariance: Array
    bias: Array
    drift: Array
    chi_square: Array
    dof: Array
    noise: Array
    flags: Sequence[Sequence[str]]
    left_out: Sequence[tuple[int, int]] = ()
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()

    def __len__(self) -> int:
        return len(self.field)


@dataclass(frozen=True, eq=False)
class North:
    """Stations with azimuth from true north; angles in rad, one row a station (n).

    inclination, azimuth, toolface, gyro_toolface : (n,) gyro_toolface is azimuth + toolface, defined when vertical too.
    scale, u_scale : (n,) true rate = scale x reading.
    k : (n,) K = cos(lat) cos(inc) + sin(lat) sin(inc) cos(azi): the scale factor cannot be seen where it is zero.
    root : per station "+" or "-", the sign of K, which is the root of the closed form that is true.
    components : cause -> (n, 4) variances of inclination, azimuth, toolface, gyro toolface, rad^2.
    chi_square, dof : (n,) misfit of the rates, prior included, and its degrees of freedom.
    flags : per station, names of `FLAGS`.
    method : "joint", "fixed", "patent" or "tracked".

    Where the closed form fails azimuth and scale are NaN and the flag says why; the joint estimate is never NaN.
    """

    inclination: Array
    azimuth: Array
    toolface: Array
    gyro_toolface: Array
    scale: Array
    u_scale: Array
    k: Array
    root: Sequence[str]
    components: Mapping[str, Array]
    chi_square: Array
    dof: Array
    flags: Sequence[Sequence[str]]
    method: str
    notes: Sequence[str] = ()

    def __len__(self) -> int:
        return len(self.inclination)

    def u(self, name: str) -> Array:
        """Standard uncertainty (n,) of "inclination", "azimuth", "toolface" or "gyro_toolface", rad, all causes.

        Never more than that of an angle about which nothing is known.
        """
        column = ("inclination", "azimuth", "toolface", "gyro_toolface").index(name)
        return angle_sd(self.components, column)

"""How an error of the tool's parameters or of a reading moves inclination, azimuth and toolface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.orientation import angles_jacobian
from inclinometry.core.arrays import Array
from inclinometry.sensors.tool import Tool
from inclinometry.sensors.triad import Triad

GRAVITY: Final = "strength of gravity"
"""What the third component of two accelerometers hangs on, among the causes of an uncertainty."""


class Sensitivity(NamedTuple):
    """Derivatives of (inclination, azimuth, toolface, magnetic toolface).

    by_parameter : (..., 4, p) by the tool's parameters, in the order of `Tool.covariance`
    by_signal : (..., 4, M) by each sensor's reading, in the order of `kinds`
    by_gravity : (..., 4) by the logarithm of |g|, from which two accelerometers have the third component; else nought
    """

    by_parameter: Array
    by_signal: Array
    kinds: tuple[str, ...]
    by_gravity: Array

    def components(self, tool: Tool, gravity_sd: float = 0.0) -> dict[str, Array]:
        """Covariances (..., 4, 4) of the angles, rad^2, by what causes them.

        The calibration, the noise of one reading and, of two accelerometers, the strength of gravity, whose standard
        uncertainty in units of that at the calibration is `gravity_sd`.
        """
        noise = np.concatenate([tool.noise[kind] for kind in self.kinds])
        spread = self.by_signal * noise
        moved = self.by_parameter @ tool.covariance
        found = {
            "calibration": moved @ np.swapaxes(self.by_parameter, -1, -2),
            "sensor noise": spread @ np.swapaxes(spread, -1, -2),
        }
        gravity = tool.triads.get("accelerometer")
        if gravity_sd > 0.0 and gravity is not None and gravity.rank == 2 and "accelerometer" in self.kinds:
            found[GRAVITY] = gravity_sd**2 * self.by_gravity[..., :, None] * self.by_gravity[..., None, :]
        return found


def angle_sensitivity(
    tool: Tool, fields: Mapping[str, Array], temperature: ArrayLike | None = None, second: str = "magnetometer"
) -> Sensitivity:
    """Sensitivity of the angles of a tool at given fields.

    Parameters
    ----------
    tool : Tool
        With an accelerometer, and a second triad for the azimuth, of three seen components each.
    fields : mapping of kind to (..., 3)
        Fields in tool axes as `Triad.field` returns them (unit length at the calibration's strength). Without the
        second field the rows of azimuth and magnetic toolface are NaN.
    temperature : (...) array_like, optional
        degC, for tools whose parameters depend on it.
    second : str
        Which triad gives the azimuth.

    Notes
    -----
    From U = N a + U0: da = N^-1 (dU - dN a - dU0), then the Jacobian of the angles by the two fields.

    Examples
    --------
    >>> tool = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in ("accelerometer", "magnetometer")})
    >>> here = {"accelerometer": np.array([0.0, 0.0, 1.0]), "magnetometer": np.array([0.6, 0.0, 0.8])}
    >>> angle_sensitivity(tool, here).by_parameter.shape
    (4, 24)
    """
    g = fields["accelerometer"]
    kinds = ("accelerometer", second) if second in fields else ("accelerometer",)
    # inclination and toolface do not care about the second field: any that is not vertical serves
    other = fields.get(second, np.eye(3)[np.abs(g).argmin(axis=-1)])
    jacobian = angles_jacobian(g, other)
    if second not in fields:
        jacobian[..., [1, 3], :] = np.nan
    return field_sensitivity(tool, kinds, jacobian, fields, temperature)


def field_sensitivity(
    tool: Tool,
    kinds: tuple[str, ...],
    jacobian: Array,
    fields: Mapping[str, Array],
    temperature: ArrayLike | None = None,
) -> Sensitivity:
    """Sensitivity of whatever depends on the fields.

    Parameters
    ----------
    tool : Tool
    kinds : tuple of str
        The triads in the order of the columns of `jacobian`.
    jacobian : (..., r, 3 k) ndarray
        Derivatives of r quantities by the components of the k fields.
    fields : mapping of kind to (..., 3)
    temperature : (...) array_like, optional
        degC.
    """
    parameters = np.zeros((*jacobian.shape[:-1], len(tool.parameter_names)))
    signals, by_gravity = [], np.zeros(jacobian.shape[:-1])
    for place, kind in enumerate(kinds):
        triad, field = tool.triads[kind], fields[kind]
        by_field = jacobian[..., 3 * place : 3 * place + 3]
        by_signal = by_field @ triad.inverse_at(field, temperature)
        signals.append(by_signal)
        parameters[..., tool.slices[kind]] = by_parameter(triad, field, by_signal, temperature)
        if kind == "accelerometer" and triad.rank == 2:
            by_gravity = (by_field @ triad.by_length(field, temperature)[..., None])[..., 0]
    return Sensitivity(parameters, np.concatenate(signals, axis=-1), kinds, by_gravity)


def by_parameter(triad: Triad, field: Array, by_signal: Array, temperature: ArrayLike | None = None) -> Array:
    """Derivatives by a triad's parameters of what depends on its signals.

    Parameters
    ----------
    triad : Triad
    field : (..., 3) ndarray
        As `Triad.field` returns it.
    by_signal : (..., k, m) ndarray
        Derivatives of the k quantities by the m signals; `triad.inverse(temperature)` for the field itself.
    temperature : (...) array_like, optional
        degC.

    Returns
    -------
    (..., k, p) ndarray
        In the order of `inclinometry.sensors.tool.parameter_names`.

    Notes
    -----
    U = N a + U0 with U as read: a parameter of sensor s acts as a change of that sensor's signal alone, by minus its
    power of temperature times its regressor (a, 1).

    Examples
    --------
    >>> triad = Triad("accelerometer", 2.0 * np.eye(3), np.zeros(3))
    >>> by_parameter(triad, np.array([0.0, 0.0, 1.0]), triad.inverse())[2, 8:]  # of gz, by the third sensor
    array([-0. , -0. , -0.5, -0.5])
    """
    powers = triad.basis(temperature)
    regressor = np.concatenate([field, np.ones((*field.shape[:-1], 1))], axis=-1)
    moves = -(by_signal[..., :, None, :, None] * powers[..., None, :, None, None] * regressor[..., None, None, None, :])
    return np.asarray(moves.reshape(*moves.shape[:-3], -1))

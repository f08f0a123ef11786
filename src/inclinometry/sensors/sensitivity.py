"""How an error of the tool's parameters or of a reading moves inclination, azimuth and toolface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.attitude.orientation import angles_jacobian
from inclinometry.core.arrays import Array
from inclinometry.sensors.tool import Tool


class Sensitivity(NamedTuple):
    """Derivatives of (inclination, azimuth, toolface, magnetic toolface).

    by_parameter : (..., 4, p) by the tool's parameters, in the order of `Tool.covariance`
    by_signal : (..., 4, M) by each sensor's reading, in the order of `kinds`
    """

    by_parameter: Array
    by_signal: Array
    kinds: tuple[str, ...]

    def components(self, tool: Tool) -> dict[str, Array]:
        """Covariances (..., 4, 4) of the angles, rad^2, by what causes them: the calibration, one reading's noise."""
        noise = np.concatenate([tool.noise[kind] for kind in self.kinds])
        spread = self.by_signal * noise
        moved = self.by_parameter @ tool.covariance
        return {
            "calibration": moved @ np.swapaxes(self.by_parameter, -1, -2),
            "sensor noise": spread @ np.swapaxes(spread, -1, -2),
        }


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
    >>> from inclinometry.sensors.triad import Triad
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
    parameters = np.zeros((*jacobian.shape[:-1], len(tool.parameter_names)))
    signals = []
    for place, kind in enumerate(kinds):
        triad, field = tool.triads[kind], fields[kind]
        by_signal = jacobian[..., 3 * place : 3 * place + 3] @ triad.inverse(temperature)
        signals.append(by_signal)
        powers = triad.basis(temperature)
        regressor = np.concatenate([field, np.ones((*field.shape[:-1], 1))], axis=-1)
        # one parameter of sensor s moves that sensor's signal only, by its power of temperature times its regressor
        moves = -(
            by_signal[..., :, None, :, None] * powers[..., None, :, None, None] * regressor[..., None, None, None, :]
        )
        parameters[..., tool.slices[kind]] = moves.reshape(*moves.shape[:-3], -1)
    return Sensitivity(parameters, np.concatenate(signals, axis=-1), kinds)

"""What a closed-form calibration of one triad returns, and how the readings' errors reach its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite
from inclinometry.calibration.dials import three_dials
from inclinometry.errors import InputError
from inclinometry.rotations import dcm, dcm_derivatives
from inclinometry.sensors import Triad


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Parameters of one triad, or of a batch of triads calibrated at the same dial settings.

    Parameters
    ----------
    tensor : (..., m, 3)
        Parametric tensor N, in the unit of the signals.
    offset : (..., m)
        U0, in the unit of the signals.
    direction : (..., 3)
        Unit vector of the field in rig axes: found by the method, or the one it was given.

    Examples
    --------
    >>> form = ClosedForm(np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    >>> form.signals(0.0, np.pi / 2, 0.0).round(12) + 0.0
    array([-1.,  0.,  0.])
    """

    tensor: Array
    offset: Array
    direction: Array

    @property
    def parameters(self) -> Array:
        """Parameters (..., 4 m) in the order of `sensors.tool.parameter_vector`."""
        joined = np.concatenate([self.tensor, self.offset[..., None]], axis=-1)
        return joined.reshape(*joined.shape[:-2], -1)

    def triad(self, kind: str, unit: str = "counts", field_strength: float | None = None) -> Triad:
        """The same as a Triad; for a single calibration, not a batch."""
        if self.tensor.ndim != 2:
            raise InputError(f"this is a batch of shape {self.tensor.shape[:-2]}; index its arrays and take one")
        return Triad(kind, self.tensor, self.offset, unit, field_strength)

    def signals(self, azimuth: ArrayLike, inclination: ArrayLike, toolface: ArrayLike) -> Array:
        """Signals (..., K, m) predicted at settings (K,), rad; (..., m) at a single setting."""
        turns = dcm(azimuth, inclination, toolface)
        if turns.ndim == 2:
            return np.asarray(((self.tensor @ turns) @ self.direction[..., None])[..., 0] + self.offset)
        seen = np.einsum("kij,...j->...ki", turns, self.direction)
        return np.asarray(seen @ np.swapaxes(self.tensor, -1, -2) + self.offset[..., None, :])


Solver: TypeAlias = Callable[[Array], ClosedForm]
"""Signals (..., K, m) -> ClosedForm, everything else bound (functools.partial)."""


def sensitivity(solver: Solver, signals: ArrayLike) -> Array:
    """Derivative of the parameters by the readings, by central differences of the batched solver in one call.

    Parameters
    ----------
    solver : callable
        Signals (..., K, m) -> ClosedForm.
    signals : (K, m) array_like
        Readings of one triad.

    Returns
    -------
    (4 m, K, m) array
        Dimensionless: parameters and readings share a unit.

    Notes
    -----
    The step is 1e-4 of the span of the signals: the methods are smooth, so the error of the difference is of order
    1e-8, far below what a covariance needs, and rounding stays below 1e-11.

    Examples
    --------
    >>> from functools import partial
    >>> from inclinometry.calibration import plans, twelve
    >>> plan = plans.orthogonal()
    >>> dials = plan.azimuth, plan.inclination, plan.toolface
    >>> truth = ClosedForm(np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    >>> solver = partial(twelve.solve_orthogonal, azimuth=dials[0], inclination=dials[1], toolface=dials[2])
    >>> by_reading = sensitivity(solver, truth.signals(*dials))
    >>> float((by_reading[3] ** 2).sum().round(6))          # variance of an offset: 1/24 of a reading's
    0.041667
    """
    values = finite(signals, "signals", (None, None))
    if values.ndim != 2:
        raise InputError(f"signals has shape {values.shape}; expected (K, m), one triad")
    step = 1e-4 * float(np.ptp(values))
    moves = step * np.eye(values.size).reshape(values.size, *values.shape)
    high, low = solver(values + moves).parameters, solver(values - moves).parameters
    return np.asarray(((high - low) / (2.0 * step)).T.reshape(-1, *values.shape))


def covariance(solvers: Sequence[Solver], signals: Sequence[Array], readings: ArrayLike) -> Array:
    """Joint covariance of the closed-form parameters of one or several triads of a tool.

    Parameters
    ----------
    solvers : sequence of callable
        One a triad, signals (..., K, m) -> ClosedForm.
    signals : sequence of (K, m)
        Readings of each triad, at the same K stations.
    readings : (K, M, M) array_like
        Covariance of the readings of each station over all M sensors of the tool, in the order of `signals`. The errors
        of a rig setting are common to all triads and make it full; see `reading_covariance`.

    Returns
    -------
    (4 M, 4 M) array
        Parameters triad by triad, each in the order of `sensors.tool.parameter_vector`. It is the first-order
        propagation J S J' of the stated covariance, stations independent; an error the stations have in common
        (inclination zero, tilted base) is not in it.

    Raises
    ------
    InputError
        Shapes that do not go together.
    """
    sizes = [np.shape(values)[1] for values in signals]
    total, stations = sum(sizes), len(signals[0])
    spread = finite(readings, "covariance of the readings", (stations, total, total))
    if len(solvers) != len(signals):
        raise InputError(f"{len(solvers)} solvers for the signals of {len(signals)} triads; give one each")
    joint = np.zeros((4 * total, stations, total))
    place = 0
    for solver, values, size in zip(solvers, signals, sizes, strict=True):
        joint[4 * place : 4 * (place + size), :, place : place + size] = sensitivity(solver, values)
        place += size
    return np.asarray(np.einsum("pki,kij,qkj->pq", joint, spread, joint, optimize=True))


def reading_covariance(
    forms: Sequence[ClosedForm],
    azimuth: ArrayLike,
    inclination: ArrayLike,
    toolface: ArrayLike,
    rig_sd: ArrayLike,
    noise_sd: ArrayLike,
) -> Array:
    """Covariance (K, M, M) of the readings of each station: sensor noise plus the errors of the rig's settings.

    Parameters
    ----------
    forms : sequence of ClosedForm
        One a triad, not batches.
    azimuth, inclination, toolface : (K,) array_like
        Rig settings, rad.
    rig_sd : (3,) array_like
        Standard deviation of a setting of azimuth, inclination, toolface, rad.
    noise_sd : (M,) or (K, M) array_like
        Standard deviation of a reading of each sensor, in its unit.

    Examples
    --------
    >>> form = ClosedForm(np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    >>> spread = reading_covariance([form], [0.0], [np.pi / 2], [0.0], [0.0, 0.01, 0.0], [0.0] * 3)
    >>> spread[0].diagonal().round(9) + 0.0          # a tilt of a level tool is seen by z alone
    array([0.    , 0.    , 0.0001])
    """
    turns = dcm_derivatives(*three_dials(azimuth, inclination, toolface))
    slopes = np.concatenate([np.einsum("mi,kdij,j->kmd", f.tensor, turns, f.direction) for f in forms], axis=1)
    slopes = slopes * finite(rig_sd, "rig_sd", (3,))
    noise = np.broadcast_to(finite(noise_sd, "noise_sd", (slopes.shape[1],)), slopes.shape[:2])
    return np.asarray(slopes @ np.swapaxes(slopes, 1, 2) + noise[:, :, None] ** 2 * np.eye(slopes.shape[1]))

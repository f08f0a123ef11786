"""What a closed-form calibration of one triad returns, and how the readings' errors reach its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inclinometry.arrays import Array, finite
from inclinometry.calibration.dials import three_dials
from inclinometry.errors import wrong_shape
from inclinometry.rotations import dcm, dcm_derivatives
from inclinometry.sensors import Triad


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Parameters of one triad, or of a batch of triads calibrated at the same dial settings."""

    tensor: Array  #: (..., m, 3) parametric tensor N, in the unit of the signals
    offset: Array  #: (..., m) U0, in the unit of the signals
    direction: Array  #: (..., 3) unit vector of the field in rig axes: found by the method, or the one it was given

    @property
    def parameters(self) -> Array:
        """Parameters (..., 4 m) in the order of `sensors.parameter_vector`."""
        joined = np.concatenate([self.tensor, self.offset[..., None]], axis=-1)
        return joined.reshape(*joined.shape[:-2], -1)

    def triad(self, kind: str, unit: str = "counts", field_strength: float | None = None) -> Triad:
        """The same as a Triad; for a single calibration, not a batch."""
        if self.tensor.ndim != 2:
            raise wrong_shape("tensor", self.tensor.shape, "(m, 3)")
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
    """Derivative (4 m, K, m) of the parameters by the readings: central differences, the batched solver called once.

    The step is 1e-4 of the span of the signals: the methods are smooth, so the error of the difference is of order
    1e-8, far below what a covariance needs, and rounding stays below 1e-11.
    """
    values = finite(signals, "signals", (None, None))
    if values.ndim != 2:
        raise wrong_shape("signals", values.shape, "(K, m)")
    step = 1e-4 * float(np.ptp(values))
    moves = step * np.eye(values.size).reshape(values.size, *values.shape)
    high, low = solver(values + moves).parameters, solver(values - moves).parameters
    return np.asarray(((high - low) / (2.0 * step)).T.reshape(-1, *values.shape))


def covariance(solvers: Sequence[Solver], signals: Sequence[Array], readings: ArrayLike) -> Array:
    """Joint covariance J S J' (4 M, 4 M) of the closed-form parameters of one or several triads of a tool.

    `readings` (K, M, M) is the covariance at each station over all sensors: errors of a setting are common to all
    triads and make it full. Stations are independent; an error they have in common (inclination zero, tilted base) is
    not in it. Parameters triad by triad, each in the order of `sensors.parameter_vector`.
    """
    sizes = [np.shape(values)[1] for values in signals]
    total, stations = sum(sizes), len(signals[0])
    spread = finite(readings, "readings.covariance", (stations, total, total))
    if len(solvers) != len(signals):
        raise wrong_shape("solvers", (len(solvers),), f"({len(signals)},)")
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

    `rig_sd` (3,) of azimuth, inclination, toolface, rad; `noise_sd` (M,) or (K, M) in the unit of each sensor.
    """
    turns = dcm_derivatives(*three_dials(azimuth, inclination, toolface))
    slopes = np.concatenate([np.einsum("mi,kdij,j->kmd", f.tensor, turns, f.direction) for f in forms], axis=1)
    slopes = slopes * finite(rig_sd, "rig_sd", (3,))
    noise = np.broadcast_to(finite(noise_sd, "noise_sd", (slopes.shape[1],)), slopes.shape[:2])
    return np.asarray(slopes @ np.swapaxes(slopes, 1, 2) + noise[:, :, None] ** 2 * np.eye(slopes.shape[1]))

"""The joint model of a bench run: all triads of a tool share the errors of the rig's settings.

    y_jk = N_j(T_k) C(settings_k + d_k) a_j + U0_j(T_k) + e_jk,   |a_j| = 1
    d_k ~ N(0, diag(rig_sd^2)),   e_jk ~ N(0, sd^2)

(errors in variables). The rig errors d_k are eliminated station by station, so a fit costs
one small dense solve an iteration however many stations there are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from inclinometry.calibration.rigmodel import NUISANCE, orientation
from inclinometry.core.arrays import Array, Index
from inclinometry.core.lsq import Normal


@dataclass(frozen=True, eq=False)
class State:
    """Where the fit is: coefficients kind -> (P, m, 4) = [tensor | offset], directions kind -> (3,), rig errors."""

    coefficients: Mapping[str, Array]
    directions: Mapping[str, Array]
    errors: Array  # (K, 3) rad
    nuisance: Array  # (4,) rad
    # filled by Model.normal: how the eliminated rig errors follow a step of the others
    _elimination: list[tuple[Array, Array]] = field(default_factory=list, repr=False)


@dataclass(frozen=True, eq=False)
class Linear:
    """The model linearised at a state.

    jacobian : (K, M, p) by tool parameters, two tangent angles a triad, nuisance parameters that are fitted
    by_setting : (K, M, 3) by azimuth, inclination, toolface of the station
    residual : (K, M) model minus reading
    """

    jacobian: Array
    by_setting: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class Model:
    """What is given: readings, settings, weights, priors.

    Parameters
    ----------
    signals : kind -> (K, m)
    settings : (K, 3) dialled azimuth, inclination, toolface, rad
    powers : (K, P) powers of temperature
    noise_sd : (K, M) of each reading, over all sensors in the order of `signals`
    rig_sd : (3,) of a setting of azimuth, inclination, toolface, rad; 0 where the dial is trusted
    nuisance_sd : (4,) prior of each constant rig error, rad; 0 where it is not fitted
    field_prior : kind -> (direction (3,), precision (3, 3) in rig axes, 1/rad^2); a triad without one may see its field
        come from anywhere
    """

    signals: Mapping[str, Array]
    settings: Array
    powers: Array
    noise_sd: Array
    rig_sd: Array
    nuisance_sd: Array
    field_prior: Mapping[str, tuple[Array, Array]]

    def with_weights(self, noise_sd: Array, rig_sd: Array) -> Model:
        """The same readings with other standard deviations."""
        return replace(self, noise_sd=noise_sd, rig_sd=rig_sd)

    def take(self, rows: Index) -> Model:
        """The same model on some of its stations."""
        return replace(
            self,
            signals={k: v[rows] for k, v in self.signals.items()},
            settings=self.settings[rows],
            powers=self.powers[rows],
            noise_sd=self.noise_sd[rows],
        )

    def with_powers(self, state: State, powers: Array) -> tuple[Model, State]:
        """Model and state for a polynomial in temperature, its further coefficients starting at zero."""
        coefficients = {}
        for kind, values in state.coefficients.items():
            more = np.zeros((powers.shape[1], *values.shape[1:]))
            more[: min(len(values), len(more))] = values[: len(more)]
            coefficients[kind] = more
        return replace(self, powers=powers), State(coefficients, state.directions, state.errors, state.nuisance)

    @property
    def fitted_nuisance(self) -> Index:
        """Indices of the constant rig errors that are fitted."""
        return np.flatnonzero(self.nuisance_sd > 0.0)

    def sizes(self) -> dict[str, int]:
        """Parameters of each triad's tensor and offset."""
        return {kind: 4 * values.shape[1] * self.powers.shape[1] for kind, values in self.signals.items()}

    def columns(self) -> tuple[dict[str, slice], dict[str, slice], slice, int]:
        """Columns of triad parameters, of field directions, of nuisance parameters, and their number."""
        tool, tangent, start = {}, {}, 0
        for kind, size in self.sizes().items():
            tool[kind], start = slice(start, start + size), start + size
        for kind in self.signals:
            tangent[kind], start = slice(start, start + 2), start + 2
        stop = start + len(self.fitted_nuisance)
        return tool, tangent, slice(start, stop), stop

    def linearise(self, state: State) -> Linear:
        """Model minus reading and its analytic derivatives at a state."""
        matrix, by_setting, by_nuisance = orientation(self.settings + state.errors, state.nuisance)
        tool, tangent, extra, width = self.columns()
        rows = sum(v.shape[1] for v in self.signals.values())
        jacobian = np.zeros((len(self.settings), rows, width))
        settings = np.zeros((len(self.settings), rows, 3))
        residual = np.zeros((len(self.settings), rows))
        start = 0
        for kind, readings in self.signals.items():
            a, coefficients = state.directions[kind], state.coefficients[kind]
            count = readings.shape[1]
            here = slice(start, start + count)
            start += count
            values = np.tensordot(self.powers, coefficients, axes=1)  # (K, m, 4)
            tensor = values[..., :3]
            seen = matrix @ a
            residual[:, here] = (tensor @ seen[..., None])[..., 0] + values[..., 3] - readings
            regressor = np.concatenate([seen, np.ones((len(seen), 1))], axis=1)
            block = (self.powers[:, :, None] * regressor[:, None, :]).reshape(len(seen), -1, 4)
            into = jacobian[:, here, tool[kind]].reshape(len(seen), count, -1, count, 4)
            for sensor in range(count):
                into[:, sensor, :, sensor, :] = block
            jacobian[:, here, tool[kind]] = into.reshape(len(seen), count, -1)
            jacobian[:, here, tangent[kind]] = tensor @ matrix @ tangent_basis(a)
            settings[:, here] = (tensor[:, None] @ (by_setting @ a)[..., None])[..., 0].swapaxes(1, 2)
            for column, index in enumerate(self.fitted_nuisance):
                jacobian[:, here, extra.start + column] = (tensor @ (by_nuisance[index] @ a)[..., None])[..., 0]
        return Linear(jacobian, settings, residual)

    def normal(self, state: State) -> Normal:
        """Normal equations with the rig errors eliminated."""
        at = self.linearise(state)
        _, tangent, extra, _ = self.columns()
        inverse_sd = 1.0 / self.noise_sd
        weighted = at.jacobian * inverse_sd[..., None]
        residual = at.residual * inverse_sd
        cost = float(np.sum(residual**2))
        # station by station: products too small for the linear algebra library to start threads on
        across = weighted.swapaxes(1, 2)
        gradient = (across @ residual[..., None])[..., 0].sum(axis=0)
        hessian = (across @ weighted).sum(axis=0)
        for kind, (direction, precision) in self.field_prior.items():
            basis, off = tangent_basis(state.directions[kind]), state.directions[kind] - direction
            cost += float(off @ precision @ off)
            gradient[tangent[kind]] += basis.T @ precision @ off
            hessian[tangent[kind], tangent[kind]] += basis.T @ precision @ basis
        free = self.fitted_nuisance
        values, sds = state.nuisance[free], self.nuisance_sd[free]
        cost += float(np.sum((values / sds) ** 2))
        gradient[extra] += values / sds**2
        hessian[extra, extra] += np.diag(1.0 / sds**2)
        loose = np.flatnonzero(self.rig_sd > 0.0)
        state._elimination.clear()
        if not len(loose):
            return Normal(cost, gradient, hessian)
        local = at.by_setting[..., loose] * inverse_sd[..., None]
        prior = 1.0 / self.rig_sd[loose] ** 2
        errors = state.errors[:, loose]
        cost += float(np.sum(errors**2 * prior))
        own = local.swapaxes(1, 2) @ local + np.diag(prior)
        cross = across @ local  # (K, p, l)
        pull = (local.swapaxes(1, 2) @ residual[..., None])[..., 0] + errors * prior
        solved = np.linalg.solve(own, np.concatenate([cross.swapaxes(1, 2), pull[..., None]], axis=2))
        follow, shift = solved[..., :-1], solved[..., -1]
        state._elimination.append((follow, shift))
        hessian = hessian - (cross @ follow).sum(axis=0)
        gradient = gradient - (cross @ shift[..., None])[..., 0].sum(axis=0)
        return Normal(cost, gradient, (hessian + hessian.T) / 2.0, float(np.sum(pull * shift)))

    def retract(self, state: State, step: Array) -> State:
        """The state after a step; the eliminated rig errors follow."""
        tool, tangent, extra, _ = self.columns()
        coefficients, directions = {}, {}
        for kind, values in state.coefficients.items():
            coefficients[kind] = values + step[tool[kind]].reshape(values.shape)
            moved = state.directions[kind] + tangent_basis(state.directions[kind]) @ step[tangent[kind]]
            directions[kind] = moved / np.linalg.norm(moved)
        nuisance = state.nuisance.copy()
        nuisance[self.fitted_nuisance] += step[extra]
        errors = state.errors
        if state._elimination:
            follow, shift = state._elimination[0]
            errors = errors.copy()
            errors[:, np.flatnonzero(self.rig_sd > 0.0)] -= shift + follow @ step
        return State(coefficients, directions, errors, nuisance)

    def station_covariance(self, at: Linear) -> Array:
        """Covariance (K, M, M) of a station's readings: sensor noise plus what the rig's errors do to all triads."""
        spread = at.by_setting * self.rig_sd
        covariance = spread @ spread.swapaxes(1, 2)
        index = np.arange(covariance.shape[1])
        covariance[:, index, index] += self.noise_sd**2
        return np.asarray(covariance)

    def prior_information(self, state: State) -> Array:
        """Information (p, p) from the priors on field directions and nuisance parameters."""
        _, tangent, extra, width = self.columns()
        information = np.zeros((width, width))
        for kind, (_, precision) in self.field_prior.items():
            basis = tangent_basis(state.directions[kind])
            information[tangent[kind], tangent[kind]] = basis.T @ precision @ basis
        information[extra, extra] = np.diag(1.0 / self.nuisance_sd[self.fitted_nuisance] ** 2)
        return information

    def nuisance_names(self) -> tuple[str, ...]:
        """Names of the constant rig errors that are fitted."""
        return tuple(NUISANCE[i] for i in self.fitted_nuisance)


def tangent_basis(direction: Array) -> Array:
    """Two unit vectors (3, 2) that complete a unit vector: towards rig +x and rig +y as far as they are tangent.

    For a field straight down they are rig x and rig y, so the tangent angles read as tilts.

    Examples
    --------
    >>> tangent_basis(np.array([0.0, 0.0, 1.0])) + 0.0
    array([[1., 0.],
           [0., 1.],
           [0., 0.]])
    """
    axis = np.eye(3)[0] if abs(direction[0]) < 0.9 else -np.eye(3)[2]
    first = axis - direction * (axis @ direction)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)], axis=1)

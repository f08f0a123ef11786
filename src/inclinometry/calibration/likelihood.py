"""The joint model of a bench run: all triads of a tool share the errors of the rig's settings.

    y_jk = N_j(T_k) C(settings_k + d_k) a_j + U0_j(T_k) + e_jk,   |a_j| = 1
    d_k ~ N(0, diag(rig_sd^2)),   e_jk ~ N(0, sd^2)

(errors in variables). The rig errors d_k are eliminated station by station, so a fit costs
one small dense solve an iteration however many stations there are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array, Index, Mask
from inclinometry.calibration.off_stand import OffStand
from inclinometry.calibration.twelve import DOWN
from inclinometry.least_squares import Normal
from inclinometry.rotations import cross_matrix, rotation_x, rotation_y, rotation_z, wrap_signed

# The rig as a chain of rotations, with the constant errors it may have and every first derivative.
#
# C = R_z(T) R_x(inner) R_y(I) R_x(outer) R_z(A)
#
# `outer` is the non-orthogonality between azimuth and inclination axes, `inner` between inclination and toolface axes;
# zero for a perfect rig, in which case C is C_tn of the conventions.

NUISANCE = ("inclination_zero", "toolface_zero", "outer_nonorthogonality", "inner_nonorthogonality")
"""Constant rig errors that a joint fit can carry, each an angle in rad."""

# dR(angle)/d(angle) = generator @ R(angle) for the passive rotations of the conventions
_GX, _GY, _GZ = 0.0 - cross_matrix(np.eye(3))


def orientation(settings: Array, nuisance: Array) -> tuple[Array, Array, Array]:
    """Rig-to-tool matrices (K, 3, 3) and their derivatives by setting (K, 3, 3, 3) and by nuisance (4, K, 3, 3).

    `settings` (K, 3) are true azimuth, inclination, toolface without the constant errors, rad; `nuisance` (4,) in the
    order of `NUISANCE`, rad.
    """
    azimuth, inclination, toolface = settings.T
    turn_t, turn_a = rotation_z(np.stack([toolface + nuisance[1], azimuth]))
    outer, inner = rotation_x(nuisance[2:])
    turn_i = rotation_y(inclination + nuisance[0])
    left_inner, right_outer = turn_t @ inner, outer @ turn_a
    left_inclination, right_inclination = left_inner @ turn_i, turn_i @ right_outer
    left_outer = left_inclination @ outer
    matrix = left_outer @ turn_a
    by_inclination = left_inclination @ _GY @ right_outer
    by_toolface = _GZ @ matrix
    by_setting = np.stack([left_outer @ _GZ @ turn_a, by_inclination, by_toolface], axis=1)
    by_outer = left_outer @ _GX @ turn_a
    by_inner = left_inner @ _GX @ right_inclination
    return matrix, by_setting, np.stack([by_inclination, by_toolface, by_outer, by_inner])


@dataclass(frozen=True, eq=False)
class State:
    """Where the fit is: coefficients kind -> (P, m, 4) = [tensor | offset], directions kind -> (3,), rig errors."""

    coefficients: Mapping[str, Array]
    directions: Mapping[str, Array]
    errors: Array  #: (K, 3) rad
    nuisance: Array  #: (4,) rad
    structured: Array = field(default_factory=lambda: np.zeros(0))  #: sizes of the structured errors of the model
    # filled by Model.normal: the model there, and how the eliminated rig errors follow a step of the others
    _elimination: list[tuple[Linear, Array, Array]] = field(default_factory=list, repr=False)


class StandAngle(NamedTuple):
    """An angle of the stand as it is known: `name` is "dip" or "north" (azimuth of the rig's zero from magnetic north).

    Both are angles between the magnetic field and gravity as the rig sees them, so they hold on a tilted base too.
    """

    name: str
    value: float  #: rad
    sd: float  #: rad

    def off(self, down: Array, field: Array) -> tuple[float, Array, Array]:
        """Angle found minus known, rad, and its derivatives by unit gravity (3,) and unit field (3,) in rig axes."""
        along = float(down @ field)
        across = np.cross(down, field)  # east
        level = max(float(np.linalg.norm(across)), 1e-3)  # at the poles no angle says anything: keep it finite
        if self.name == "dip":
            return float(np.arctan2(along, level)) - self.value, field / level, down / level
        x = np.array([1.0, 0.0, 0.0])
        east, north = float(across[0]), float(field[0] - down[0] * along)  # of the rig's zero, times cos(dip)
        by_down = north * np.cross(field, x) + east * (along * x + down[0] * field)
        by_field = north * np.cross(x, down) - east * (x - down[0] * down)
        length = max(east**2 + north**2, 1e-6)
        return float(wrap_signed(np.arctan2(east, north) - self.value)), by_down / length, by_field / length


@dataclass(frozen=True, eq=False)
class Linear:
    """The model linearised at a state.

    jacobian : (K, M, p) by tool parameters, two tangent angles a triad, nuisance parameters that are fitted, sizes of
        the structured errors
    by_setting : (K, M, 3) by azimuth, inclination, toolface of the station
    residual : (K, M) model minus reading
    """

    jacobian: Array
    by_setting: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class Model:
    """What is given: readings, settings, weights, priors."""

    signals: Mapping[str, Array]  #: kind -> (K, m)
    settings: Array  #: (K, 3) dialled azimuth, inclination, toolface, rad
    powers: Array  #: (K, P) powers of temperature
    noise_sd: Array  #: (K, M) of each reading, over all sensors in the order of `signals`
    rig_sd: Array  #: (3,) of a setting of azimuth, inclination, toolface, rad; 0 where the dial is trusted
    nuisance_sd: Array  #: (4,) prior of each constant rig error, rad; 0 where it is not fitted
    #: kind -> (direction (3,), precision (3, 3) in rig axes, 1/rad^2); a triad without one may see its field come from
    #: anywhere
    field_prior: Mapping[str, tuple[Array, Array]]
    stand: Sequence[StandAngle] = ()  #: angles of the stand that are known
    #: (3,) which of `rig_sd` were stated; the others may be estimated
    rig_known: Mask = field(default_factory=lambda: np.zeros(3, dtype=bool))
    #: (K, M) least standard deviation of each reading, from the step of the converter; (1, 1) for all alike
    rounding: Array = field(default_factory=lambda: np.zeros((1, 1)))
    #: (K, M, n) what structured errors of unit size do to the readings
    structure: Array = field(default_factory=lambda: np.zeros((1, 1, 0)))
    structure_sd: Array = field(default_factory=lambda: np.zeros(0))  #: (n,) their prior standard deviations
    #: (n,) the dial (0, 1, 2) whose error at one of its values it is; -1 for others
    structure_dial: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    structure_name: tuple[str, ...] = ()  #: (n,) the cause of each
    off_stand: OffStand | None = None

    def with_weights(self, noise_sd: Array, rig_sd: Array, structure_sd: Array | None = None) -> Model:
        """The same readings with other standard deviations."""
        more = self.structure_sd if structure_sd is None else structure_sd
        return replace(self, noise_sd=noise_sd, rig_sd=rig_sd, structure_sd=more)

    def with_structure(
        self, state: State, columns: Array, sd: Array, name: Sequence[str], dial: Sequence[int] = ()
    ) -> tuple[Model, State]:
        """With further structured errors: columns (K, M, n), standard deviations, causes, dials."""
        more = columns.shape[2]
        wide = np.broadcast_to(self.structure, (*columns.shape[:2], len(self.structure_sd)))
        model = replace(
            self,
            structure=np.concatenate([wide, columns], axis=2),
            structure_sd=np.concatenate([self.structure_sd, sd]),
            structure_dial=np.concatenate([self.structure_dial, np.array(dial or [-1] * more, dtype=np.intp)]),
            structure_name=(*self.structure_name, *name),
        )
        return model, replace(state, structured=np.concatenate([state.structured, np.zeros(more)]), _elimination=[])

    def take(self, rows: Index) -> Model:
        """The same model on some of its stations."""
        return replace(
            self,
            signals={k: v[rows] for k, v in self.signals.items()},
            settings=self.settings[rows],
            powers=self.powers[rows],
            noise_sd=self.noise_sd[rows],
            rounding=self.rounding if len(self.rounding) == 1 else self.rounding[rows],
            structure=self.structure if len(self.structure) == 1 else self.structure[rows],
        )

    def with_powers(self, state: State, powers: Array) -> tuple[Model, State]:
        """Model and state for a polynomial in temperature, its further coefficients starting at zero."""
        coefficients = {}
        for kind, values in state.coefficients.items():
            more = np.zeros((powers.shape[1], *values.shape[1:]))
            more[: min(len(values), len(more))] = values[: len(more)]
            coefficients[kind] = more
        return replace(self, powers=powers), replace(state, coefficients=coefficients, _elimination=[])

    @property
    def fitted_nuisance(self) -> Index:
        """Indices of the constant rig errors that are fitted."""
        return np.flatnonzero(self.nuisance_sd > 0.0)

    def sizes(self) -> dict[str, int]:
        """Parameters of each triad's tensor and offset."""
        return {kind: 4 * values.shape[1] * self.powers.shape[1] for kind, values in self.signals.items()}

    def columns(self) -> tuple[dict[str, slice], dict[str, slice], slice, int]:
        """Columns of triad parameters, of field directions, of nuisance parameters, and the number of all.

        Those of the structured errors are the last ones.
        """
        tool, tangent, start = {}, {}, 0
        for kind, size in self.sizes().items():
            tool[kind], start = slice(start, start + size), start + size
        for kind in self.signals:
            tangent[kind], start = slice(start, start + 2), start + 2
        stop = start + len(self.fitted_nuisance)
        return tool, tangent, slice(start, stop), stop + len(self.structure_sd)

    @property
    def parameters(self) -> int:
        """Number of the tool's parameters, the first columns."""
        return sum(self.sizes().values())

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
        if len(self.structure_sd):
            jacobian[..., extra.stop :] = self.structure
            residual += self.structure @ state.structured
        return Linear(jacobian, settings, residual)

    def normal(self, state: State) -> Normal:
        """Normal equations with the rig errors eliminated."""
        at = self.linearise(state)
        _, _, extra, _ = self.columns()
        inverse_sd = 1.0 / self.noise_sd
        weighted = at.jacobian * inverse_sd[..., None]
        residual = at.residual * inverse_sd
        cost = float(np.sum(residual**2))
        # station by station: products too small for the linear algebra library to start threads on
        across = weighted.swapaxes(1, 2)
        gradient = (across @ residual[..., None])[..., 0].sum(axis=0)
        hessian = (across @ weighted).sum(axis=0)
        off, prior, sd = self.field_rows(state)
        known, rows = off / sd, prior / sd[:, None]
        cost += float(known @ known)
        gradient += rows.T @ known
        hessian += rows.T @ rows
        free = self.fitted_nuisance
        values, sds = state.nuisance[free], self.nuisance_sd[free]
        cost += float(np.sum((values / sds) ** 2))
        gradient[extra] += values / sds**2
        hessian[extra, extra] += np.diag(1.0 / sds**2)
        if len(self.structure_sd):
            precise, last = self.structure_sd**-2.0, np.arange(extra.stop, len(gradient))
            cost += float(np.sum(state.structured**2 * precise))
            gradient[last] += state.structured * precise
            hessian[last, last] += precise
        loose = np.flatnonzero(self.rig_sd > 0.0)
        local = at.by_setting[..., loose] * inverse_sd[..., None]
        precision = 1.0 / self.rig_sd[loose] ** 2
        errors = state.errors[:, loose]
        cost += float(np.sum(errors**2 * precision))
        own = local.swapaxes(1, 2) @ local + np.diag(precision)
        cross = across @ local  # (K, p, l)
        pull = (local.swapaxes(1, 2) @ residual[..., None])[..., 0] + errors * precision
        solved = np.linalg.solve(own, np.concatenate([cross.swapaxes(1, 2), pull[..., None]], axis=2))
        follow, shift = solved[..., :-1], solved[..., -1]
        state._elimination[:] = [(at, follow, shift)]
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
            _, follow, shift = state._elimination[0]
            errors = errors.copy()
            errors[:, np.flatnonzero(self.rig_sd > 0.0)] -= shift + follow @ step
        return State(coefficients, directions, errors, nuisance, state.structured + step[extra.stop :])

    def station_covariance(self, at: Linear) -> Array:
        """Covariance (K, M, M) of a station's readings: sensor noise plus what the rig's errors do to all triads."""
        spread = at.by_setting * self.rig_sd
        covariance = spread @ spread.swapaxes(1, 2)
        index = np.arange(covariance.shape[1])
        covariance[:, index, index] += self.noise_sd**2
        return np.asarray(covariance)

    def field_rows(self, state: State) -> tuple[Array, Array, Array]:
        """Known angles and readings off the stand: found minus known (n,), derivatives (n, p), standard deviation (n,).

        Angles in rad; readings off the stand are white.
        """
        _, tangent, _, width = self.columns()
        off: list[float] = []
        sd: list[float] = []
        rows: list[Array] = []
        for kind, (direction, precision) in self.field_prior.items():
            values, vectors = np.linalg.eigh(precision)
            basis, away = tangent_basis(state.directions[kind]), state.directions[kind] - direction
            for value, vector in zip(values, vectors.T, strict=True):
                if value > 0.0:
                    row = np.zeros(width)
                    row[tangent[kind]] = vector @ basis
                    off.append(float(vector @ away))
                    sd.append(float(1.0 / np.sqrt(value)))
                    rows.append(row)
        for known in self.stand:
            field = state.directions["magnetometer"]
            # without accelerometers the rig's own axis stands for the vertical
            difference, by_down, by_field = known.off(state.directions.get("accelerometer", DOWN), field)
            row = np.zeros(width)
            row[tangent["magnetometer"]] = by_field @ tangent_basis(field)
            if "accelerometer" in state.directions:
                row[tangent["accelerometer"]] = by_down @ tangent_basis(state.directions["accelerometer"])
            off.append(difference)
            sd.append(known.sd)
            rows.append(row)
        found = np.array(off), np.reshape(rows, (len(rows), width)), np.array(sd)
        if self.off_stand is None:
            return found
        apart = self.off_stand.linear(state.coefficients, self.columns()[0], width).known(self.off_stand.weight)
        more = (*apart, np.full(len(apart[0]), 1.0))
        first, second, third = (np.concatenate(pair) for pair in zip(found, more, strict=True))
        return first, second, third

    def prior_information(self, state: State) -> Array:
        """Information (p, p) from the priors on field directions and nuisance parameters."""
        _, _, extra, _ = self.columns()
        _, rows, sd = self.field_rows(state)
        information = np.asarray((rows / sd[:, None] ** 2).T @ rows)
        information[extra, extra] = np.diag(1.0 / self.nuisance_sd[self.fitted_nuisance] ** 2)
        last = np.arange(extra.stop, len(information))
        information[last, last] = self.structure_sd**-2.0
        return information

    def nuisance_names(self) -> tuple[str, ...]:
        """Names of the constant rig errors that are fitted."""
        return tuple(NUISANCE[i] for i in self.fitted_nuisance)


def tangent_basis(direction: Array) -> Array:
    """Two unit vectors (3, 2) that complete a unit vector: towards rig +x and rig +y as far as they are tangent.

    For a field straight down they are rig x and rig y, so the tangent angles read as tilts.
    """
    axis = np.eye(3)[0] if abs(direction[0]) < 0.9 else -np.eye(3)[2]
    first = axis - direction * (axis @ direction)
    first /= np.linalg.norm(first)
    (x, y, z), (a, b, c) = direction, first
    # direction x first; numpy's own takes ten times as long for one pair
    return np.array([[a, y * c - z * b], [b, z * a - x * c], [c, x * b - y * a]])

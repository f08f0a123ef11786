"""Likelihood of a field calibration: tool parameters, dip, directions of the roll sets, a free attitude each station.

Everything is in units of the full field: signals are divided by the triad's mean conversion factor. Attitudes are
eliminated station by station (Schur complement), so the normal equations hold only the parameters that are shared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.lsq import Fit, Normal, inverse_spd, levenberg_marquardt

RIDGE = 1e-2
"""Information, 1/rad^2, given to every attitude and set direction: 10 rad, nothing beside a real reading. It keeps the
equations solvable where a direction is a matter of convention (heading without a magnetometer)."""


@dataclass(frozen=True)
class Prior:
    """Standard deviations of what is known of any triad before it is read: angles between axes, spread of scales."""

    angle: float
    spread: float


@dataclass(frozen=True)
class Shots:
    """Readings as the fit sees them. `member` is the roll set of each station, -1 for none."""

    kinds: Sequence[str]
    signals: Sequence[Array]  # (K, m) each, in units of full field
    relative: Sequence[Array]  # (K, m) each, relative standard deviations of the readings, 1 on the average
    member: Array  # (K,)
    sets: int

    @property
    def sizes(self) -> list[int]:
        """Sensors of each triad."""
        return [y.shape[1] for y in self.signals]

    @property
    def columns(self) -> list[slice]:
        """Where each triad's parameters, sensor by sensor (three tensor elements, offset), sit in the vector."""
        edges = np.concatenate([[0], np.cumsum([4 * m for m in self.sizes])]).tolist()
        return [slice(a, b) for a, b in pairwise(edges)]

    @property
    def rows(self) -> list[slice]:
        """Where each triad's readings sit in a station's residuals; the two of pointing come last."""
        edges = np.concatenate([[0], np.cumsum(self.sizes)]).tolist()
        return [slice(a, b) for a, b in pairwise(edges)]

    @property
    def tool(self) -> int:
        """Number of tool parameters; the dip follows, then two tangent angles for each roll set."""
        return 4 * sum(self.sizes)


@dataclass(frozen=True)
class Unknowns:
    """A point of the fit. `attitude` takes north-east-down to tool axes, `pointing` is the tool axis of each set."""

    tensors: Sequence[Array]
    offsets: Sequence[Array]
    dip: float
    pointing: Array  # (S, 3)
    attitude: Array  # (K, 3, 3)


@dataclass(frozen=True)
class Levels:
    """Noise of each triad (units of full field), of pointing (rad), and which blocks of which stations are used."""

    noise: tuple[float, ...]
    pointing: float
    used: Array  # (K, kinds + 1), 1 or 0; the last column is pointing


@dataclass(frozen=True)
class Linear:
    """Whitened residuals r (K, n), their slopes against the attitude, A (K, n, 3), and what is shared, J (K, n, P)."""

    residual: Array
    latent: Array
    shared: Array

    def reduced(self) -> tuple[Array, Array, Array]:
        """(A'A)^-1 (K, 3, 3), and J and r with what the attitude explains taken out."""
        inner = np.linalg.inv(np.swapaxes(self.latent, 1, 2) @ self.latent + RIDGE * np.eye(3))
        project = self.latent @ inner
        back = np.swapaxes(self.latent, 1, 2)
        shared = self.shared - project @ (back @ self.shared)
        residual = self.residual - (project @ (back @ self.residual[..., None]))[..., 0]
        return np.asarray(inner), shared, residual


def cross_matrices(v: Array) -> Array:
    """[v]x of each row: [v]x w = v x w."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def rotations(angle: Array) -> Array:
    """exp [angle]x of each row (Rodrigues)."""
    size = np.linalg.norm(angle, axis=-1)[..., None, None]
    k = cross_matrices(angle)
    safe = np.where(size > 1e-8, size, 1.0)
    one = np.where(size > 1e-8, np.sin(safe) / safe, 1.0)
    two = np.where(size > 1e-8, (1.0 - np.cos(safe)) / safe**2, 0.5)
    return np.asarray(np.eye(3) + one * k + two * (k @ k))


def tangent(u: Array) -> Array:
    """Two unit vectors at right angles to each u and each other, (..., 3, 2)."""
    helper = np.eye(3)[np.argmin(np.abs(u), axis=-1)]
    first = np.cross(u, helper)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(u, first)], axis=-1)


def references(kinds: Sequence[str], dip: float) -> list[tuple[Array, Array]]:
    """Unit field of each triad in north-east-down and its slope against the dip; a lone field counts as down."""
    down = (np.array([0.0, 0.0, 1.0]), np.zeros(3))
    c, s = np.cos(dip), np.sin(dip)
    field = (np.array([c, 0.0, s]), np.array([-s, 0.0, c]))
    return [field if k == "magnetometer" and len(kinds) == 2 else down for k in kinds]


class FieldProblem:
    """Cost, gradient and Hessian at given noise levels; the last linearisation is kept for the step back."""

    def __init__(self, shots: Shots, prior: Prior, levels: Levels) -> None:
        self.shots, self.prior, self.levels = shots, prior, levels
        self._last: tuple[Unknowns, Linear] | None = None

    @property
    def size(self) -> int:
        return self.shots.tool + 1 + 2 * self.shots.sets

    def linear(self, at: Unknowns) -> Linear:
        """Whitened residuals and slopes, by hand: d(N a) = dN a - N [a]x delta for an attitude turned by delta."""
        if self._last is not None and self._last[0] is at:
            return self._last[1]
        shots, levels = self.shots, self.levels
        count, width = len(shots.member), sum(shots.sizes) + 2
        residual, latent = np.zeros((count, width)), np.zeros((count, width, 3))
        shared = np.zeros((count, width, self.size))
        for j, (field, slope) in enumerate(references(shots.kinds, at.dip)):
            rows, columns = shots.rows[j], shots.columns[j]
            weight = levels.used[:, j, None] / (levels.noise[j] * shots.relative[j])
            a = at.attitude @ field
            residual[:, rows] = (a @ at.tensors[j].T + at.offsets[j] - shots.signals[j]) * weight
            latent[:, rows] = -(at.tensors[j] @ cross_matrices(a)) * weight[..., None]
            for i in range(shots.sizes[j]):
                at_column = columns.start + 4 * i
                shared[:, rows.start + i, at_column : at_column + 3] = a * weight[:, i, None]
                shared[:, rows.start + i, at_column + 3] = weight[:, i]
            shared[:, rows, shots.tool] = (at.attitude @ slope @ at.tensors[j].T) * weight
        self._pointing(at, residual, latent, shared)
        linear = Linear(residual, latent, shared)
        self._last = (at, linear)
        return linear

    def _pointing(self, at: Unknowns, residual: Array, latent: Array, shared: Array) -> None:
        """Tool axis of each station of a set against the set's direction, in the two tangent directions."""
        rows = np.flatnonzero(self.shots.member >= 0)
        sets = self.shots.member[rows]
        back = np.swapaxes(tangent(at.pointing)[sets], 1, 2)
        weight = self.levels.used[rows, -1, None] / self.levels.pointing
        axis = at.attitude[rows, 2, :]
        residual[rows, -2:] = (back @ axis[..., None])[..., 0] * weight
        turn = cross_matrices(np.array([0.0, 0.0, 1.0]))
        latent[rows, -2:] = back @ np.swapaxes(at.attitude[rows], 1, 2) @ turn * weight[..., None]
        first = self.shots.tool + 1 + 2 * sets
        for i in range(2):
            shared[rows, residual.shape[1] - 2 + i, first + i] = -weight[:, 0]

    def normal(self, at: Unknowns) -> Normal:
        """Normal equations of the shared parameters."""
        linear = self.linear(at)
        _, shared, residual = linear.reduced()
        hessian = np.einsum("knp,knq->pq", shared, shared, optimize=True)
        gradient = np.einsum("knp,kn->p", linear.shared, residual)
        cost = float(np.sum(linear.residual**2))
        for value, slope in self._prior_rows(at):
            hessian += np.outer(slope, slope)
            gradient += slope * value
            cost += value**2
        gauge = self.gauge(at)
        hessian += np.outer(gauge, gauge) * float(np.mean(np.diagonal(hessian)[: self.shots.tool]))
        extra = np.arange(self.shots.tool, self.size)
        hessian[extra, extra] += RIDGE
        if len(self.shots.kinds) == 1:
            self._pin_headings(at, hessian)
        return Normal(cost, gradient, hessian)

    def _pin_headings(self, at: Unknowns, hessian: Array) -> None:
        """One field alone shows no heading: keep each set's direction from wandering about the vertical."""
        sideways = np.cross(np.array([0.0, 0.0, 1.0]), at.pointing)
        for s, direction in enumerate(sideways):
            own = slice(self.shots.tool + 1 + 2 * s, self.shots.tool + 3 + 2 * s)
            heading = tangent(at.pointing[s]).T @ direction
            hessian[own, own] += (
                np.outer(heading, heading) * float(np.trace(hessian[own, own])) / max(float(heading @ heading), 1e-6)
            )

    def gauge(self, at: Unknowns) -> Array:
        """Unit direction in which all readings stay the same: the tool axes turned about the tool axis."""
        out = np.zeros(self.size)
        turn = cross_matrices(np.array([0.0, 0.0, 1.0]))
        for columns, tensor in zip(self.shots.columns, at.tensors, strict=True):
            out[columns] = np.column_stack([tensor @ turn.T, np.zeros(len(tensor))]).ravel()
        return np.asarray(out / np.linalg.norm(out))

    def _prior_rows(self, at: Unknowns) -> list[tuple[float, Array]]:
        """Whitened value and slope of each prior: cosine between two axes (three sensors), logarithm of each scale."""
        out: list[tuple[float, Array]] = []
        for columns, tensor in zip(self.shots.columns, at.tensors, strict=True):
            length = np.linalg.norm(tensor, axis=1)
            axes = tensor / length[:, None]
            m = len(tensor)
            logs = np.log(length)
            for i in range(m):
                slope = np.zeros((self.size,))
                for j in range(m):
                    share = (1.0 if i == j else 0.0) - 1.0 / m
                    slope[columns.start + 4 * j : columns.start + 4 * j + 3] = share * axes[j] / length[j]
                out.append((float(logs[i] - logs.mean()) / self.prior.spread, slope / self.prior.spread))
            for i, j in ((0, 1), (0, 2), (1, 2)) if m == 3 else ():
                cosine, slope = float(axes[i] @ axes[j]), np.zeros(self.size)
                slope[columns.start + 4 * i : columns.start + 4 * i + 3] = (axes[j] - cosine * axes[i]) / length[i]
                slope[columns.start + 4 * j : columns.start + 4 * j + 3] = (axes[i] - cosine * axes[j]) / length[j]
                out.append((cosine / self.prior.angle, slope / self.prior.angle))
        return out

    def retract(self, at: Unknowns, step: Array) -> Unknowns:
        """Move the shared parameters by `step` and each attitude to its best place for them, to first order."""
        linear = self.linear(at)
        inner, _, _ = linear.reduced()
        ahead = linear.residual + linear.shared @ step
        turn = -(inner @ (np.swapaxes(linear.latent, 1, 2) @ ahead[..., None]))[..., 0]
        tensors, offsets = [], []
        for columns, tensor, offset in zip(self.shots.columns, at.tensors, at.offsets, strict=True):
            block = step[columns].reshape(-1, 4)
            tensors.append(tensor + block[:, :3])
            offsets.append(offset + block[:, 3])
        tilt = step[self.shots.tool + 1 :].reshape(-1, 2)
        pointing = at.pointing + (tangent(at.pointing) @ tilt[..., None])[..., 0]
        pointing = pointing / np.linalg.norm(pointing, axis=1, keepdims=True)
        dip = at.dip + float(step[self.shots.tool])
        return Unknowns(tensors, offsets, dip, pointing, rotations(turn) @ at.attitude)

    def solve(self, start: Unknowns, tolerance: float = 1e-8) -> Fit[Unknowns]:
        """Levenberg-Marquardt from `start`."""
        return levenberg_marquardt(self.normal, start, self.retract, tolerance=tolerance, iterations=200)

    def redundancy(self, at: Unknowns) -> Array:
        """(K, n) share of each residual that the fit does not absorb, 0..1."""
        linear = self.linear(at)
        inner, shared, _ = linear.reduced()
        covariance = inverse_spd(self.normal(at).hessian)
        own = np.einsum("kni,kij,knj->kn", linear.latent, inner, linear.latent)
        common = np.einsum("knp,pq,knq->kn", shared, covariance, shared, optimize=True)
        return np.asarray(np.clip(1.0 - own - common, 0.0, 1.0))

    def with_levels(self, levels: Levels) -> FieldProblem:
        """The same shots at other noise levels."""
        return FieldProblem(self.shots, self.prior, levels)


def upended(at: Unknowns) -> Unknowns:
    """The same readings described in tool axes turned by half a turn about x: the tool axis points the other way."""
    turn = np.diag([1.0, -1.0, -1.0])
    return replace(at, tensors=[n @ turn for n in at.tensors], attitude=turn @ at.attitude, pointing=-at.pointing)


def turned(at: Unknowns, angle: float) -> Unknowns:
    """The same readings described in tool axes turned by `angle` about the tool axis."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(at, tensors=[n @ turn.T for n in at.tensors], attitude=turn @ at.attitude)

"""Steps of a rate table that the others contradict."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.core.arrays import Array, Index

SIGNIFICANCE = 0.001
"""Chance of naming any step of a clean run (Bonferroni over steps and gyros)."""
_FREE = 1e-6  # a step of less redundancy than this cannot be judged by the others
_ENOUGH = 4  # degrees of freedom from which a test within the fuller model is worth having


class Suspect(NamedTuple):
    """A step at odds with the others: its row, and for each gyro off (from 0) reading minus what the others say."""

    row: int
    off: dict[int, float]


class _Pass(NamedTuple):
    t: Array  # (n, m) externally studentised residuals
    dof: int  # of their t distribution


def suspects(u: Array, plain: Array, fuller: Array, spread: Array | None) -> list[Suspect]:
    """Steps to be suspected, worst first.

    u : (K, m) signals.  plain : (K, p) regressors of the fit.  fuller : with gravity too, where that is known: in
    this model, if the steps allow it, gravity that is not fitted cannot be mistaken for bad steps.  spread : (K, m) or
    None.

    Rosner's generalised procedure (Technometrics 25, 1983): the step of the largest externally studentised residual is
    taken out, again and again, and all up to the last significant one are named; so two bad steps cannot hide each
    other. No more than a sixth of the steps is named.
    """
    from scipy.special import stdtr

    count, gyros = u.shape
    matrix = fuller if _allows(fuller) else plain
    kept, order, last = np.arange(count), [], 0
    for _ in range(max(1, count // 6)):
        found = _studentised(u[kept], matrix[kept], None if spread is None else spread[kept])
        if found is None:
            break
        place = int(np.argmax(np.abs(found.t).max(axis=1)))
        order.append(int(kept[place]))
        kept = np.delete(kept, place)
        if 2.0 * stdtr(found.dof, -np.abs(found.t[place]).max()) * count * gyros < SIGNIFICANCE:
            last = len(order)
    bad = order[:last]
    rest = np.setdiff1d(np.arange(count), bad)
    return [_described(u, matrix, spread, rest, row) for row in bad]


def _allows(matrix: Array) -> bool:
    values = np.linalg.svd(matrix, compute_uv=False)
    return matrix.shape[0] - matrix.shape[1] >= _ENOUGH and bool(values[-1] > _FREE * values[0])


def _studentised(u: Array, matrix: Array, spread: Array | None) -> _Pass | None:
    """Of each step against a fit without it; None without redundancy.

    Stated noise is a lower limit: where the others scatter more than it, their scatter counts.
    """
    count, unknown = matrix.shape
    dof = count - unknown - 1
    if dof < 1:
        return None
    t = np.zeros_like(u)
    for gyro in range(u.shape[1]):
        weight = np.ones(count) if spread is None else 1.0 / spread[:, gyro]
        q, _ = np.linalg.qr(matrix * weight[:, None])
        y = u[:, gyro] * weight
        free, residual = 1.0 - np.sum(q**2, axis=1), y - q @ (q.T @ y)
        judged = free > _FREE
        own = residual / np.sqrt(np.where(judged, free, 1.0))
        # readings without any scatter are still only known to their rounding
        least = (
            max(64.0 * np.finfo(float).eps * float(np.abs(y).max()), np.finfo(float).tiny) if spread is None else 1.0
        )
        others = np.sqrt(np.maximum(np.sum(residual**2) - own**2, 0.0) / dof)
        t[:, gyro] = np.where(judged, own / np.maximum(others, least), 0.0)
    return _Pass(t, dof)


def _described(u: Array, matrix: Array, spread: Array | None, rest: Index, row: int) -> Suspect:
    """A suspect beside the steps that are none: in which gyros it is off, and by how much."""
    from scipy.special import stdtr

    rows = np.append(rest, row)
    found = _studentised(u[rows], matrix[rows], None if spread is None else spread[rows])
    if found is None:
        return Suspect(row, {})
    t = np.abs(found.t[-1])
    off = {}
    for gyro in np.flatnonzero((2.0 * stdtr(found.dof, -t) * u.size < SIGNIFICANCE) | (t == t.max())).tolist():
        weight = np.ones(len(rest)) if spread is None else 1.0 / spread[rest, gyro]
        fit = np.linalg.lstsq(matrix[rest] * weight[:, None], u[rest, gyro] * weight, rcond=None)[0]
        off[gyro] = float(u[row, gyro] - matrix[row] @ fit)
    return Suspect(row, off)

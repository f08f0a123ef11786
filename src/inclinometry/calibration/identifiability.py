"""What a plan cannot see, in words.

The singular directions of the trusted-dial model are compared with named physical changes of tool and rig. What a plan
can see but a fit does not carry, a constant error of the rig, is tested from the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.likelihood import NUISANCE, Model, State, tangent_basis
from inclinometry.calibration.variance import Fitted
from inclinometry.findings import Finding, Value


@dataclass(frozen=True, eq=False)
class NullSpace:
    """Directions a plan cannot see.

    rank, size : of the trusted-dial model with whatever priors on field directions it has
    unseen : each direction that is not seen, as part of a sentence
    """

    rank: int
    size: int
    unseen: tuple[Finding, ...]

    @property
    def complete(self) -> bool:
        """Whether every parameter is seen."""
        return self.rank == self.size


def null_space(model: Model, state: State) -> NullSpace:
    """Rank and unseen directions of a plan for the tool at `state`."""
    bare = replace(model, rig_sd=np.zeros(3), nuisance_sd=np.ones(4))
    still = State(state.coefficients, state.directions, np.zeros_like(state.errors), np.zeros(4))
    at = bare.linearise(still)
    tool, tangent, extra, width = bare.columns()
    # 1 rad for 1 rad where an angle is known at all
    known = bare.field_rows(still)[1][:, : extra.start]
    rows = at.jacobian.reshape(-1, width)
    scale = _column_scale(bare, still)
    scales = [np.linalg.norm(c[0, :, :3], axis=1).max() * np.ones(c.shape[1]) for c in still.coefficients.values()]
    row_scale = np.tile(np.concatenate(scales), len(model.settings))
    design = rows[:, : extra.start] * scale[: extra.start] / row_scale[:, None]
    _, values, right = np.linalg.svd(np.concatenate([design, known]), full_matrices=False)
    # a direction whose scaled singular value is below this share of the largest is unseen: rounding, not weak data
    seen = values > 1e-7 * values[0]
    # of fewer equations than parameters what is left of the space is unseen too
    null = np.concatenate([right[~seen], np.linalg.svd(right)[2][len(right) :]])
    rank = int(seen.sum())
    if not len(null):
        return NullSpace(rank, design.shape[1], ())
    names, dictionary = _dictionary(bare, still, tool, tangent)
    dictionary = dictionary / scale[: extra.start]
    # for each unseen direction the fewest named changes that reproduce it, by orthogonal matching pursuit
    unseen: list[Finding] = []
    lengths = np.linalg.norm(dictionary, axis=1)
    unit = dictionary / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    for direction in null:
        chosen: list[int] = []
        left = direction
        while len(chosen) < 4 and np.linalg.norm(left) > 0.1:
            match = np.abs(unit @ left) * np.where(np.arange(len(unit)) < 6, 1.2, 1.0)
            match[chosen] = 0.0
            chosen.append(int(np.argmax(match)))
            part = unit[chosen].T
            left = direction - part @ np.linalg.lstsq(part, direction, rcond=None)[0]
        what = Finding("bench-unseen", {"changes": tuple(names[i] for i in chosen)})
        if len(chosen) == 1:
            what = names[chosen[0]]
        unseen += [] if what in unseen else [what]
    return NullSpace(rank, design.shape[1], tuple(unseen))


def constant_errors(fitted: Fitted) -> dict[str, tuple[float, float]]:
    """Constant rig errors that were not fitted, as the residuals tell them one at a time.

    Returns
    -------
    name -> (estimate, standard uncertainty), rad; the uncertainty is infinite where the parameters imitate the error.
    """
    model = fitted.model
    wide = replace(model, nuisance_sd=np.ones(4))
    at = wide.linearise(fitted.state)
    _, _, extra, _ = wide.columns()
    inverse = np.linalg.inv(model.station_covariance(fitted.at))
    weighted = inverse @ fitted.at.jacobian
    residual = fitted.marginal_residual()
    found = {}
    for index, name in enumerate(NUISANCE):
        if name in model.nuisance_names():
            continue
        effect = at.jacobian[..., extra.start + index]
        white = (inverse @ effect[..., None])[..., 0]
        share = np.tensordot(weighted, effect, axes=([0, 1], [0, 1]))
        whole = float(np.sum(effect * white))
        left = whole - float(share @ fitted.covariance @ share)
        if left < 1e-6 * whole:
            found[name] = (0.0, np.inf)
        else:
            pull = float(np.sum(white * residual))
            pull -= float(share @ fitted.covariance @ np.tensordot(weighted, residual, axes=([0, 1], [0, 1])))
            found[name] = (-pull / left, 1.0 / np.sqrt(left))
    return found


def _column_scale(model: Model, state: State) -> Array:
    """Natural size of each parameter: full scale over the spread of its power of temperature, one radian for angles."""
    _, _, _, width = model.columns()
    scale = np.ones(width)
    powers = 1.0 / np.maximum(np.sqrt(np.mean(model.powers**2, axis=0)), 1e-12)
    start = 0
    for coefficients in state.coefficients.values():
        full = np.linalg.norm(coefficients[0, :, :3], axis=1).max()
        block = np.broadcast_to(full * powers[:, None, None], coefficients.shape).ravel()
        scale[start : start + len(block)] = block
        start += len(block)
    return scale


def _dictionary(
    model: Model, state: State, tool: dict[str, slice], tangent: dict[str, slice]
) -> tuple[list[Finding], Array]:
    """Named small changes as rows of parameter changes, common ones first so that they are preferred."""
    _, _, extra, _ = model.columns()
    names: list[Finding] = []
    rows: list[Array] = []
    tilts = ("tilt of the rig about its east axis", "tilt of the rig about its north axis", "azimuth zero of the rig")
    turns = ("tool axis (about x)", "tool axis (about y)", "toolface zero")
    kinds = list(state.coefficients)

    def add(name: Finding, changes: dict[str, tuple[Array, Array]]) -> None:
        row = np.zeros(extra.start)
        for kind, (coefficient, direction) in changes.items():
            row[tool[kind]] = coefficient.ravel()
            row[tangent[kind]] = tangent_basis(state.directions[kind]).T @ direction
        names.append(name)
        rows.append(row)

    def rotate_model(kind: str, axis: int) -> tuple[Array, Array]:
        change = np.zeros_like(state.coefficients[kind])
        # N e for each row: n -> n x e, the tensor seen from a tool frame turned about `axis`
        change[..., :3] = np.cross(state.coefficients[kind][..., :3], np.eye(3)[axis])
        return change, np.zeros(3)

    def tilted(kind: str, axis: int) -> tuple[Array, Array]:
        return np.zeros_like(state.coefficients[kind]), np.cross(np.eye(3)[axis], state.directions[kind])

    order = (1, 0, 2)
    for number, axis in enumerate(order):
        add(Finding("bench-turn", {"turn": tilts[number]}), {kind: tilted(kind, axis) for kind in kinds})
    for axis in range(3):
        add(Finding("bench-turn", {"turn": turns[axis]}), {kind: rotate_model(kind, axis) for kind in kinds})
    for kind in kinds:
        for number, axis in enumerate(order):
            add(Finding("bench-turn-alone", {"turn": tilts[number], "kind": kind}), {kind: tilted(kind, axis)})
        for axis in range(3):
            add(Finding("bench-turn-alone", {"turn": turns[axis], "kind": kind}), {kind: rotate_model(kind, axis)})
        for sensor, column in product(range(state.coefficients[kind].shape[1]), range(4)):
            change = np.zeros_like(state.coefficients[kind])
            change[0, sensor, column] = 1.0
            add(_element(kind, sensor, column), {kind: (change, np.zeros(3))})
    return names, np.array(rows)


def _element(kind: str, sensor: int, column: int) -> Finding:
    """An element of the tensor, or the offset in the fourth column, as part of a sentence."""
    own: dict[str, Value] = {"kind": kind, "sensor": sensor + 1}
    return Finding("bench-element", own | {"axis": "xyz"[column]}) if column < 3 else Finding("bench-offset", own)

"""The constant errors of a stand and what each does to the readings: dials, axes, backlash and magnetism.

actual = setting + a1 sin v + b1 cos v + a2 sin 2v + b2 cos 2v + q w,   w = +1, -1 by the sense of the last turn
field seen = R_z(T) { (1 + X) R_x(inner) R_y(I) [ R_x(outer) R_z(A) b + ring ] + cradle } + chuck
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.likelihood import NUISANCE, orientation
from inclinometry.calibration.variance import Fitted
from inclinometry.constants import DIALS
from inclinometry.rotations import rotation_x, rotation_y, rotation_z, wrap_signed


class Constants(NamedTuple):
    """Constant errors of one kind."""

    name: str
    columns: Array  #: (K, M, n) what each does to the readings, by rad or in units of the field
    size: float  #: usual size of each


def stand_constants(fitted: Fitted) -> Iterator[Constants]:
    """The constant errors that a stand may have and that are not fitted already; of stated dials only the axes."""
    model, state, at = fitted.model, fitted.state, fitted.at
    steps = wrap_signed(np.diff(model.settings, axis=0, prepend=model.settings[:1]))
    sense = np.sign(steps)
    for row in range(1, len(sense)):
        sense[row] = np.where(sense[row] == 0.0, sense[row - 1], sense[row])
    for dial in np.flatnonzero(~model.rig_known).tolist():
        value, turned = model.settings[:, dial], at.by_setting[..., dial]
        for order, size in ((1, 0.071), (2, 0.035)):
            waves = np.stack([np.sin(order * value), np.cos(order * value)], axis=1)
            yield Constants(f"{DIALS[dial]} dial", turned[..., None] * waves[:, None, :], np.radians(size))
        yield Constants(f"{DIALS[dial]} dial", turned[..., None] * sense[:, None, dial, None], np.radians(0.05))
    settings = model.settings + state.errors
    by_nuisance = orientation(settings, state.nuisance)[2]
    seen = (
        np.concatenate([
            np.tensordot(model.powers, state.coefficients[kind], axes=1)[..., :3]
            @ (by_nuisance @ state.directions[kind])[..., None]
            for kind in model.signals
        ], axis=2)
    )  # fmt: skip
    for name, size in (("inclination_zero", 0.05), ("outer_nonorthogonality", 0.1), ("inner_nonorthogonality", 0.1)):
        place = NUISANCE.index(name)
        if place not in model.fitted_nuisance:
            yield Constants("axes of the stand", seen[place], np.radians(size))
    if "magnetometer" not in model.signals:
        return
    start = 0
    for kind, signals in model.signals.items():
        here = slice(start, start + signals.shape[1])
        start = here.stop
        if kind == "magnetometer":
            break
    tensor = np.tensordot(model.powers, state.coefficients["magnetometer"], axes=1)[..., :3]
    last = rotation_z(settings[:, 2] + state.nuisance[1])
    middle = rotation_x(state.nuisance[3]) @ rotation_y(settings[:, 1] + state.nuisance[0])
    field = middle @ rotation_x(state.nuisance[2]) @ rotation_z(settings[:, 0]) @ state.directions["magnetometer"]

    def magnetic(name: str, what: Array, size: float) -> Constants:
        columns = np.zeros((*at.residual.shape, what.shape[2]))
        columns[:, here] = tensor @ what
        return Constants(name, columns, size)

    yield magnetic("magnetism of the cradle", last, 1.2e-3)
    yield magnetic("magnetism of the ring", (last @ middle)[..., ::2], 6e-4)
    iron = last[..., :, None] * field[:, None, None, :]
    yield magnetic("iron of the cradle", iron.reshape(*iron.shape[:2], 9), 1.2e-3)
    yield magnetic("magnetism of the chuck", np.broadcast_to(np.eye(3), last.shape), 6e-4)

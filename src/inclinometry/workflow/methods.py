"""The one table of identification methods by name, and which of them a set of readings allows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from inclinometry.calibration.direct import (
    calibrate_classical,
    calibrate_orthogonal,
    calibrate_rotations,
    calibrate_twelve,
)
from inclinometry.calibration.field import calibrate_field
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.norm_record import calibrate_norms
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.core.errors import InclinometryError, InputError

METHODS: dict[str, Callable[..., Calibration]] = {
    "joint": calibrate_joint,
    "twelve": calibrate_twelve,
    "orthogonal": calibrate_orthogonal,
    "rotations": calibrate_rotations,
    "classical": calibrate_classical,
    "field": calibrate_field,
    "norm": calibrate_norms,
}


@dataclass(frozen=True, eq=False)
class Attempt:
    """One method on one set of readings: a calibration, or why there is none."""

    method: str
    calibration: Calibration | None
    reason: str = ""


def method(name: str) -> Callable[..., Calibration]:
    """A method by name; InputError lists the names."""
    if name not in METHODS:
        raise InputError(f"method {name!r} is unknown; allowed: {', '.join(METHODS)}")
    return METHODS[name]


def attempt_all(
    readings: BenchReadings, *, rig_sd: float | None = None, level_sd: float | None = None
) -> list[Attempt]:
    """Every method the readings allow, side by side; the others with their reason.

    The joint fit stands twice: as the product's answer, and as plain least squares with trusted dials, which is what a
    fit that does not share the rig's errors between the triads amounts to.
    """
    attempts = []
    level: dict[str, Any] = {} if level_sd is None else {"field_prior": {"accelerometer": ([0.0, 0.0, 1.0], level_sd)}}
    for name, run in METHODS.items():
        if name == "norm":
            continue  # its triads stand in axes of their own: nothing to compare
        known: dict[str, Any] = {} if name == "field" else {"rig_sd": rig_sd, **(level if name == "joint" else {})}
        attempts.append(_attempt(name, partial(run, readings, **known)))
        if name == "joint":
            attempts.append(
                _attempt("least squares", partial(calibrate_joint, readings, rig_sd=0.0, diagnose=False, **level))
            )
    return attempts


def _attempt(name: str, run: Callable[[], Calibration]) -> Attempt:
    try:
        return Attempt(name, run())
    except (InclinometryError, np.linalg.LinAlgError) as error:
        return Attempt(name, None, str(error))

"""The one table of identification methods by name, and which of them a set of readings allows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InclinometryError, InputError
from inclinometry.sensors.tool import Tool

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
    readings: BenchReadings,
    *,
    rig_sd: Array | None = None,
    field_prior: Mapping[str, Any] | None = None,
    reference_sd: Mapping[str, float] | None = None,
    left_handed: bool = False,
    nameplate: Tool | None = None,
) -> list[Attempt]:
    """Every method the readings allow, side by side; the others with their reason: classical without a nameplate.

    Arguments as of `calibrate_joint`, and the nameplate of the classical method.

    Readings with dials that the joint fit refuses are refused: no method is better than what it is given.

    The joint fit stands twice: as the product's answer, and as plain least squares with trusted dials, which is what a
    fit that does not share the rig's errors between the triads amounts to.
    """
    attempts = []
    stand: dict[str, Any] = {"field_prior": field_prior, "reference_sd": reference_sd}
    for name, run in METHODS.items():
        if name == "norm":
            continue  # its triads stand in axes of their own: nothing to compare
        known: dict[str, Any] = {"rig_sd": rig_sd, "left_handed": left_handed, **(stand if name == "joint" else {})}
        if name == "classical":
            known["nameplate"] = nameplate
        run = partial(run, readings, **({} if name == "field" else known))
        attempts.append(_attempt(name, run, strict=name == "joint" and readings.azimuth is not None))
        if name == "joint":
            plain = {"rig_sd": 0.0, "diagnose": False, "left_handed": left_handed, **stand}
            attempts.append(_attempt("least squares", partial(calibrate_joint, readings, **plain)))
    return attempts


def _attempt(name: str, run: Callable[[], Calibration], *, strict: bool = False) -> Attempt:
    try:
        return Attempt(name, run())
    except (InclinometryError, np.linalg.LinAlgError) as error:
        if strict and isinstance(error, InputError):
            raise
        return Attempt(name, None, str(error))

"""From a file of rate-table steps to a calibrated gyro triad, alone or in the tool it belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from inclinometry.attitude.rotations import dcm
from inclinometry.calibration.rate_table import RateCalibration, calibrate_rates, table_rates
from inclinometry.calibration.result import UNSTATED, Calibration, Residuals, Rig
from inclinometry.calibration.temperature import soaks
from inclinometry.core.arrays import Array
from inclinometry.core.constants import EARTH_RATE
from inclinometry.core.digest import digest_file
from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site
from inclinometry.io.rate_csv import RateSteps
from inclinometry.io.tool_json import read_calibration
from inclinometry.sensors.tool import Tool
from inclinometry.sensors.triad import Triad

PER_RADIAN = {"rad/s": 1.0, "deg/s": np.degrees(1.0), "deg/h": np.degrees(3600.0)}
"""Signals in these units for a true rate of 1 rad/s."""


@dataclass(frozen=True, eq=False)
class RateTable:
    """What a run on a rate table gave: the regression, and the calibration with the gyro triad in it."""

    rates: RateCalibration
    calibration: Calibration


def calibrate_on_table(
    steps: RateSteps,
    site: Site,
    *,
    calibration: str | Path | None = None,
    temperature_degree: int = 0,
    g_sensitive: bool = False,
    name: str = "unnamed",
) -> RateTable:
    """Calibrate the gyro triad of a tool on a rate table.

    Parameters
    ----------
    steps : RateSteps
        From `read_rate_steps`.
    site : Site
        With the latitude of the table.
    calibration : str or Path, optional
        tool.json whose gyro triad is to be replaced or added; everything else in it stays as it is.
    temperature_degree : int
    g_sensitive : bool
        Fit the g-sensitivity too.
    name : str
        Of the tool, where no calibration gives one.

    Raises
    ------
    InputError
        A site without latitude, rates in other units than they are said to be.
    IdentifiabilityError
        Steps that leave something undetermined.
    """
    if site.latitude is None:
        raise InputError("the site has no latitude; a gyro on a table sees the Earth turn too: give latitude_deg")
    if temperature_degree and steps.temperature is None:
        raise InputError(f"temperature degree {temperature_degree} asked for; the steps lack temperature_degC: add it")
    old = None if calibration is None else read_calibration(calibration)
    found = calibrate_rates(
        steps.signals,
        table_rates(steps.inclination, steps.toolface, steps.rate, site.latitude, steps.azimuth),
        gravity=dcm(0.0, steps.inclination, steps.toolface) @ [0.0, 0.0, 1.0],
        temperature=steps.temperature,
        degree=temperature_degree,
        sd=steps.sd,
        g_sensitive=g_sensitive,
        unit=steps.unit,
    )
    before = None if old is None else old.tool.triads.get("gyro")
    _check_scale(found.triad, before)
    notes = [*steps.notes, *found.notes, *_heat_notes(steps, temperature_degree)]
    if old is None:
        return RateTable(found, _alone(found, steps, name, notes))
    whole = with_gyro(old, found, {"rate table": steps.digest, "tool": digest_file(calibration or "")}, notes)
    return RateTable(found, whole)


def with_gyro(
    calibration: Calibration, found: RateCalibration, inputs: Mapping[str, str], notes: list[str]
) -> Calibration:
    """A calibration whose gyro triad is the one found; nothing is known to tie it to the other triads.

    The covariance of the rest stays, that of the gyro is a block of its own.
    """
    tool = calibration.tool
    kept = [row for row, name in enumerate(calibration.parameter_names) if not name.startswith("gyro.")]
    own = [row for row, name in enumerate(tool.parameter_names) if not name.startswith("gyro.")]
    triads = {**tool.triads, "gyro": found.triad}
    noise = {**tool.noise, "gyro": found.sd}
    inner = _blocks(tool.covariance[np.ix_(own, own)], found.triad_covariance)
    heat, doubt = _common_range(tool.temperature_range, found.temperature_range)
    renewed = Tool(tool.name, triads, inner, noise, heat)
    names = [calibration.parameter_names[row] for row in kept]
    gyro = [name for name in renewed.parameter_names if name.startswith("gyro.")]
    joint = _blocks(calibration.covariance[np.ix_(kept, kept)], found.triad_covariance)
    residuals = calibration.residuals
    return replace(
        calibration,
        tool=renewed,
        inputs={**calibration.inputs, **inputs},
        field_directions={k: v for k, v in calibration.field_directions.items() if k != "gyro"},
        parameter_names=(*names, *gyro),
        covariance=joint,
        residuals=replace(
            residuals,
            values={k: v for k, v in residuals.values.items() if k != "gyro"},
            standardised={k: v for k, v in residuals.standardised.items() if k != "gyro"},
        ),
        warnings=(*calibration.warnings, *(f"rate table: {note}" for note in [*notes, *doubt])),
    )


def _alone(found: RateCalibration, steps: RateSteps, name: str, notes: list[str]) -> Calibration:
    """A calibration of nothing but gyros."""
    tool = Tool(name, {"gyro": found.triad}, found.triad_covariance, {"gyro": found.sd}, found.temperature_range)
    return Calibration(
        tool,
        "rate-table",
        {"rate table": steps.digest},
        {},
        tool.parameter_names,
        tool.covariance,
        Rig(np.zeros(3)),
        Residuals(
            steps.station,
            {"gyro": found.residuals},
            {"gyro": found.residuals / found.sd},
            np.full(len(steps), 1.0 - found.dof / steps.signals.size),
        ),
        tuple(notes),
    )


def _common_range(
    one: tuple[float, float] | None, other: tuple[float, float] | None
) -> tuple[tuple[float, float] | None, list[str]]:
    """Temperatures at which both calibrations hold; those of the first, and a sentence, where there are none."""
    if one is None or other is None:
        return one or other, []
    low, high = max(one[0], other[0]), min(one[1], other[1])
    if low <= high:
        return (low, high), []
    return one, [f"taken at {other[0]:g} to {other[1]:g} degC, the rest of the tool at {one[0]:g} to {one[1]:g}"]


def _blocks(one: Array, other: Array) -> Array:
    """Block diagonal of two covariances."""
    size = len(one)
    whole = np.zeros((size + len(other),) * 2)
    whole[:size, :size], whole[size:, size:] = one, other
    return whole


def _check_scale(triad: Triad, before: Triad | None) -> None:
    """InputError where the scale found differs from the unit's, or from the earlier calibration's, by 180 / pi."""
    scale = _scale(triad)
    if triad.unit in PER_RADIAN:
        ratio, than = scale / (PER_RADIAN[triad.unit] * EARTH_RATE), f"that of signals in {triad.unit}"
    elif before is not None and (before.unit == triad.unit or UNSTATED in (before.unit, triad.unit)):
        ratio, than = scale / _scale(before), "that of the calibration"
    else:
        return
    if np.degrees(0.5) < ratio < np.degrees(2.0):
        raise InputError(f"the scale factor comes out {ratio:.3g} times {than}: rate_deg_s is in rad/s; convert it")
    if np.radians(0.5) < ratio < np.radians(2.0):
        raise InputError(f"the scale factor comes out {ratio:.3g} times {than}: are the gyro columns in another unit?")


def _scale(triad: Triad) -> float:
    """Typical signal of one gyro along the field."""
    return float(np.exp(np.mean(np.log(np.linalg.norm(triad.tensor[0], axis=1)))))


def _heat_notes(steps: RateSteps, degree: int) -> list[str]:
    if degree or steps.temperature is None or (found := soaks(steps.temperature)) < 2:
        return []
    return [f"the steps were taken at {found} temperatures, but a calibration that does not depend on it was fitted"]

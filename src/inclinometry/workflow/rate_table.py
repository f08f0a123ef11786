"""From a file of rate-table steps to a calibrated gyro triad, alone or in the tool it belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from inclinometry.attitude.rotations import dcm
from inclinometry.calibration.rate_table import RateCalibration, calibrate_rates, table_rates
from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.calibration.temperature import soaks
from inclinometry.core.arrays import Array
from inclinometry.core.digest import digest_file
from inclinometry.core.errors import IdentifiabilityError, InputError
from inclinometry.earth.site import Site
from inclinometry.io.rate_csv import RateSteps
from inclinometry.io.tool_json import read_calibration
from inclinometry.sensors.tool import Tool
from inclinometry.workflow._rate_checks import check_plausible

KEPT = "it is still in the fit, whose uncertainties are wrong: take it again"


@dataclass(frozen=True, eq=False)
class RateTable:
    """What a run on a rate table gave: the regression, and the calibration with the gyro triad in it.

    notes : what a person should know, steps left out included.
    steps : number of steps in the fit.
    """

    rates: RateCalibration
    calibration: Calibration
    notes: tuple[str, ...]
    steps: int


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
        A site without latitude; a FileError for rates or signals in other units, or of another sign, than they are
        said to be.
    IdentifiabilityError
        Steps that leave something undetermined.
    """
    if site.latitude is None:
        raise InputError("the site has no latitude; a gyro on a table sees the Earth turn too: give latitude_deg")
    if temperature_degree and steps.temperature is None:
        raise InputError(f"temperature degree {temperature_degree} asked for; the steps lack temperature_degC: add it")
    old = None if calibration is None else read_calibration(calibration)
    used, found, told = _fitted(steps, site.latitude, temperature_degree, g_sensitive)
    before = None if old is None else old.tool.triads.get("gyro")
    odd = check_plausible(used, found, site.latitude, before)
    notes = [*steps.notes, *told, *odd, *found.notes, *_heat_notes(used, temperature_degree)]
    if old is None:
        return RateTable(found, _alone(found, used, name, notes), tuple(notes), len(used))
    whole = with_gyro(old, found, {"rate table": steps.digest, "tool": digest_file(calibration or "")}, notes)
    return RateTable(found, whole, tuple(notes), len(used))


def _fitted(
    steps: RateSteps, latitude: float, degree: int, g_sensitive: bool
) -> tuple[RateSteps, RateCalibration, list[str]]:
    """The fit, the steps it is made from and sentences on those that the others contradict.

    They are left out where the others determine everything without them.
    """
    found = _regression(steps, latitude, degree, g_sensitive)
    if not found.suspects:
        return steps, found, []
    rest = steps.without([suspect.row for suspect in found.suspects])
    try:
        again = _regression(rest, latitude, degree, g_sensitive)
    except IdentifiabilityError:
        return steps, found, _suspected(steps, found, KEPT)
    return rest, again, [*_suspected(steps, found, "it was left out"), *_suspected(rest, again, KEPT)]


def _regression(steps: RateSteps, latitude: float, degree: int, g_sensitive: bool) -> RateCalibration:
    return calibrate_rates(
        steps.signals,
        table_rates(steps.inclination, steps.toolface, steps.rate, latitude, steps.azimuth),
        gravity=dcm(0.0, steps.inclination, steps.toolface) @ [0.0, 0.0, 1.0],
        temperature=steps.temperature,
        degree=degree,
        sd=steps.sd,
        g_sensitive=g_sensitive,
        unit=steps.unit,
    )


def _suspected(steps: RateSteps, found: RateCalibration, fate: str) -> list[str]:
    """One sentence for each step that the others contradict."""
    sentences = []
    for suspect in found.suspects:
        off = ", ".join(f"{steps.names[gyro]} by {value:+.3g}" for gyro, value in suspect.off.items())
        where = f"line {steps.lines[suspect.row]} (step {steps.station[suspect.row]})"
        sentences.append(f"{where} disagrees with the other steps, {off} {steps.unit}; {fate}")
    return sentences


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


def _heat_notes(steps: RateSteps, degree: int) -> list[str]:
    if degree or steps.temperature is None or (found := soaks(steps.temperature)) < 2:
        return []
    return [f"the steps were taken at {found} temperatures, but a calibration that does not depend on it was fitted"]

"""The record of a field calibration, back in the signals' units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inclinometry.calibration._field_model import FieldProblem, Unknowns, references
from inclinometry.calibration._field_noise import Estimate
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import LEAST_REDUNDANCY, Calibration, Residuals, Rig
from inclinometry.core.arrays import Array, frozen
from inclinometry.core.lsq import inverse_spd
from inclinometry.sensors.tool import Tool
from inclinometry.sensors.triad import Triad

_STRENGTH = {"accelerometer": "g", "magnetometer": "b"}


def assemble(
    readings: BenchReadings,
    name: str,
    found: Estimate,
    at: Unknowns,
    projection: Array,
    scales: Sequence[float],
    notes: Sequence[str],
) -> Calibration:
    """Scale everything back and put it together."""
    problem, shots = found.problem, found.problem.shots
    triads = {
        kind: Triad(
            kind,
            at.tensors[j] * scales[j],
            at.offsets[j] * scales[j],
            readings.units[kind],
            readings.reference.get(_STRENGTH[kind]),
        )
        for j, kind in enumerate(shots.kinds)
    }
    both = len(shots.kinds) == 2
    unit = np.ones(problem.size)
    for columns, scale in zip(shots.columns, scales, strict=True):
        unit[columns] = scale
    covariance = projection @ inverse_spd(problem.normal(at).hessian) @ projection.T * np.outer(unit, unit)
    kept = shots.tool + int(both)
    noise = {k: np.full(shots.sizes[j], problem.levels.noise[j] * scales[j]) for j, k in enumerate(shots.kinds)}
    warm = readings.temperature
    span = None if warm is None else (float(warm.min()), float(warm.max()))
    tool = Tool(name, triads, covariance[: shots.tool, : shots.tool], noise, span)
    names = (*tool.parameter_names, *(("dip",) if both else ()))
    directions = {k: frozen(f) for k, (f, _) in zip(shots.kinds, references(shots.kinds, at.dip), strict=True)}
    return Calibration(
        tool,
        "field",
        {"readings": readings.digest},
        directions,
        names,
        frozen(covariance[:kept, :kept]),
        _rig(found, at.dip, float(np.sqrt(covariance[shots.tool, shots.tool])), both=both),
        _residuals(readings, problem, at, scales, found),
        (*readings.warnings, *notes),
        notes=tuple(readings.notes),
    )


def _rig(found: Estimate, dip: float, dip_sd: float, *, both: bool) -> Rig:
    """The hand that pointed: its error, and the dip that was found."""
    pointing = found.problem.levels.pointing
    freedom = max(float(found.free[:, -1].sum()), 1.0)
    nuisance = {"pointing": (pointing, pointing / float(np.sqrt(2.0 * freedom)))}
    if both:
        nuisance["dip"] = (dip, dip_sd)
    return Rig(frozen([pointing, pointing, 0.0]), nuisance=nuisance)


def _residuals(
    readings: BenchReadings, problem: FieldProblem, at: Unknowns, scales: Sequence[float], found: Estimate
) -> Residuals:
    """Readings minus model in the signals' units, and over their standard deviations."""
    shots = problem.shots
    redundancy = problem.redundancy(at)
    values, standardised = {}, {}
    for j, (kind, (field, _)) in enumerate(zip(shots.kinds, references(shots.kinds, at.dip), strict=True)):
        miss = shots.signals[j] - (at.attitude @ field) @ at.tensors[j].T - at.offsets[j]
        values[kind] = frozen(miss * scales[j])
        left = redundancy[:, shots.rows[j]]
        # a residual the fit absorbs whole has no scatter of its own to be compared with
        sd = problem.levels.noise[j] * shots.relative[j] * np.sqrt(np.where(left > LEAST_REDUNDANCY, left, np.nan))
        standardised[kind] = frozen(miss / sd)
    seen = sum(shots.sizes)
    leverage = 1.0 - redundancy[:, :seen].mean(axis=1)
    return Residuals(tuple(readings.station), values, standardised, frozen(leverage))

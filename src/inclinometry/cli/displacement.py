"""Command that says how a casing moved between readings of an inclinometer probe."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import output
from inclinometry.cli.options import INPUT, Json, OutputOrNone, Report, angle
from inclinometry.errors import InputError
from inclinometry.files.casing_csv import write_displacements
from inclinometry.files.writing import write_text
from inclinometry.survey.displacement import SPIKE_LIMIT, AxisDisplacement, CasingErrors, CheckSums
from inclinometry.workflow.displacement import Movement, casing_movement


def displacement(
    base: Path,
    later: Path,
    /,
    *more: Path,
    unit: Annotated[Literal["digi-25000", "digi-20000", "sin", "deg", "mm"] | None, Parameter(group=INPUT)] = None,
    fixed: Annotated[Literal["bottom", "top"], Parameter(name="--from")] = "bottom",
    spike_limit: float = SPIKE_LIMIT,
    step_sd_mm: float | None = None,
    bias_shift_mm: float = 0.0,
    sensitivity_percent: float = 0.0,
    depth_sd_mm: float = 0.0,
    rotation_deg: float = 0.0,
    output_: OutputOrNone = None,
    report: Report = None,
    json: Json = False,
) -> None:
    """How a casing moved since its base reading, with uncertainty.

    Parameters
    ----------
    base
        Base reading: depth_m, A0, A180 and, where it was read, B0, B180, at depths one step apart.
    later
        A later reading of the same depths.
    more
        Further readings, each against the base reading.
    unit
        Unit of columns that name none: 25000 or 20000 times the sine of the tilt, its sine, degrees, mm over one step.
    fixed
        End of the casing that is taken not to move.
    spike_limit
        Robust standard deviations from the median beyond which a check-sum is a spike.
    step_sd_mm
        Standard uncertainty of the change of one step, mm; from the scatter of the check-sums when not given.
    bias_shift_mm
        Standard uncertainty of a step by a bias that changed between the two runs of a reading, mm; the same at every
        step.
    sensitivity_percent
        Standard uncertainty of the change of the probe's sensitivity since the base reading.
    depth_sd_mm
        Standard uncertainty of a shift of all depths since the base reading, mm.
    rotation_deg
        Standard uncertainty of a rotation of the probe's axes since the base reading.
    output_
        CSV of all readings.
    """
    inputs: dict[str, Path | None] = {"the base reading": base}
    inputs |= {f"reading {n}": path for n, path in enumerate((later, *more), 1)}
    output.claim({"--output": output_, "--report": report}, inputs)
    if not spike_limit > 0.0:
        raise InputError(f"--spike-limit is {spike_limit:g}; it must be positive, e.g. {SPIKE_LIMIT:g}")
    errors = CasingErrors(
        None if step_sd_mm is None else _part(step_sd_mm, "--step-sd-mm", 100.0) / 1000.0,
        _part(bias_shift_mm, "--bias-shift-mm", 100.0) / 1000.0,
        _part(sensitivity_percent, "--sensitivity-percent", 20.0) / 100.0,
        _part(depth_sd_mm, "--depth-sd-mm", 10_000.0) / 1000.0,
        angle(rotation_deg, "--rotation-deg", 0.0, 30.0),
    )
    moved = casing_movement(base, (later, *more), unit, errors, fixed=fixed, spike_limit=spike_limit)
    page = None
    if report is not None:
        from inclinometry.report.displacement import displacement_report

        page = displacement_report(
            moved.base.table.path.stem, moved.base_sums, moved.found, moved.notes, moved.warnings, moved.inputs
        )
    if output_ is not None:
        write_displacements(output_, list(moved.found.items()))
    if page is not None:
        write_text(page, report or "")
    output.warnings(moved.warnings)
    if json:
        output.print_json(_content(moved))
        return
    _show(moved)
    for name, path in (("displacements", output_), ("report", report)):
        if path is not None:
            output.say(f"{name} written to {path}")


def _part(value: float, option: str, high: float) -> float:
    if not 0.0 <= value <= high:
        raise InputError(f"{option} is {value:g}; allowed 0 to {high:g}")
    return value


def _show(moved: Movement) -> None:
    step = 1000.0 * moved.base.reading.step
    rows = [_sums_row(moved.base.table.path.stem, axis, sums, step) for axis, sums in moved.base_sums.items()]
    rows += [_sums_row(n, axis, one.sums, step) for n, d in moved.found.items() for axis, one in d.axes.items()]
    output.table("check-sums, mm a step", ["reading", "axis", "mean", "sd", "robust sd", "spikes"], rows)
    rows = []
    for name, found in moved.found.items():
        for axis, one in found.axes.items():
            worst = int(np.argmax(np.abs(one.displacement)))
            # at the end that is free to move the uncertainty is the largest
            free = 0 if found.fixed == "bottom" else -1
            cells = [_mm(one.displacement[free]), _mm(2.0 * one.u[free], "")]
            cells += [_mm(one.displacement[worst]), _mm(2.0 * one.u[worst], ""), f"{found.depth[worst]:g}"]
            rows.append([name, axis.upper(), *cells])
    end = "top" if next(iter(moved.found.values())).fixed == "bottom" else "bottom"
    header = ["reading", "axis", f"{end} mm", "U mm", "largest mm", "U mm", "at m"]
    output.table("displacement since the base reading", header, rows, "U: expanded uncertainty, k = 2")
    for sentence in moved.notes:
        output.say(sentence)


def _sums_row(name: str, axis: str, sums: CheckSums | None, step: float) -> list[str]:
    if sums is None:
        return [name, axis.upper(), "not judged", "", "", ""]
    figures = [f"{step * value:.3f}" for value in (sums.mean, sums.sd, sums.robust_sd)]
    return [name, axis.upper(), *figures, str(int(sums.spikes.sum()))]


def _mm(metres: float, sign: str = "+") -> str:
    return f"{1000.0 * metres:{sign}.2f}" if np.isfinite(metres) else "not known"


def _content(moved: Movement) -> dict[str, Any]:
    step = 1000.0 * moved.base.reading.step
    return {
        "base": moved.base.table.path.stem,
        "base_check_sums": {axis: _sums(sums, step) for axis, sums in moved.base_sums.items()},
        "readings": {
            name: {
                "fixed": found.fixed,
                "depth_m": found.depth,
                "axes": {axis: _axis(one, step) for axis, one in found.axes.items()},
            }
            for name, found in moved.found.items()
        },
        "notes": moved.notes,
        "warnings": moved.warnings,
        "inputs": moved.inputs,
    }


def _axis(one: AxisDisplacement, step: float) -> dict[str, Any]:
    return {
        "displacement_mm": 1000.0 * one.displacement,
        "u_mm": 1000.0 * one.u,
        "components_u_mm": {name: 1000.0 * part for name, part in one.components.items()},
        "steps_mm": 1000.0 * one.steps,
        "check_sums": _sums(one.sums, step),
        "check_sum_change_mm": step * one.bias_change,
        "spikes": one.spikes,
        "repeated": one.repeated,
    }


def _sums(sums: CheckSums | None, step: float) -> dict[str, Any] | None:
    if sums is None:
        return None
    return {
        "mean_mm": step * sums.mean,
        "sd_mm": step * sums.sd,
        "robust_sd_mm": step * sums.robust_sd,
        "values_mm": step * sums.values,
        "spikes": sums.spikes,
    }

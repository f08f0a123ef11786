"""Command that says how a casing moved between readings of an inclinometer probe."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.files.casing_csv import write_displacements
from inclinometry.survey.displacement import SPIKE_LIMIT, AxisDisplacement, CasingErrors, CheckSums, Displacement
from inclinometry.workflow.displacement import Movement, casing_movement


def displacement(
    base: Path,
    /,
    *later: Path,
    unit: Annotated[str | None, Parameter(group=options.INPUT)] = None,
    sensor_depths: Annotated[
        list[float] | None, Parameter(name="--sensor-depths-m", consume_multiple=True, negative="", group=options.INPUT)
    ] = None,
    fixed: Annotated[Literal["bottom", "top"], Parameter(name="--from")] = "bottom",
    spike_limit: Annotated[float, options.quantity("", 0.0, 1e9, above=True)] = SPIKE_LIMIT,
    step_sd: Annotated[float | None, options.quantity("mm", 0.0, 100.0)] = None,
    bias_shift: Annotated[float, options.quantity("mm", 0.0, 100.0)] = 0.0,
    sensitivity: Annotated[float, options.quantity("percent", 0.0, 20.0)] = 0.0,
    depth_sd: Annotated[float, options.quantity("mm", 0.0, 10_000.0)] = 0.0,
    rotation: options.Sd = 0.0,
    correct: Annotated[
        list[Literal["bias", "rotation", "depth", "sensitivity"]] | None, Parameter(consume_multiple=True, negative="")
    ] = None,
    a0_azimuth: options.AzimuthOrNone = None,
    output_: options.OutputOrNone = None,
    report: options.Report = None,
    json: options.Json = False,
) -> None:
    """How a casing moved since its base reading, with uncertainty.

    Parameters
    ----------
    base
        Base reading: depth_m, A0, A180 and, if read, B0, B180, one step apart.
    later
        Later readings of the same depths, each compared with the base reading. None if the base file has several
        dates: the first is the base.
    unit
        Unit of columns whose names state none: digi-25000 or digi-N, that is N times the sine of the tilt; sin, deg;
        m, mm, ft or in per step.
    sensor_depths
        Of an in-place string: depth of the upper end of sensors 1, 2 .., m. Columns are A(1), A(2) .., a row a reading.
    fixed
        End of the casing that is fixed.
    spike_limit
        Robust standard deviations from the median beyond which a check-sum is a spike.
    step_sd
        Standard uncertainty of the change of one step, mm. Default: from the scatter of the check-sums.
    bias_shift
        Standard uncertainty of a bias change between the two runs of a reading, mm per step.
    sensitivity
        Standard uncertainty of the change of the probe's sensitivity since the base reading.
    depth_sd
        Standard uncertainty of a shift of all depths since the base reading, mm.
    rotation
        Standard uncertainty of a rotation of the probe's axes since the base reading.
    correct
        Errors between the readings to remove where they are found; the uncertainty includes their removal.
    a0_azimuth
        Azimuth that a positive A0 leans to, for the azimuth of the resultant.
    output_
        CSV of all readings.
    """
    inputs: dict[str, Path | None] = {"the base reading": base}
    inputs |= {f"reading {n}": path for n, path in enumerate(later, 1)}
    output.check_outputs({"--output": output_, "--report": report}, inputs)
    errors = CasingErrors(step_sd, bias_shift, sensitivity, depth_sd, rotation)
    moved = casing_movement(
        base, later, unit, errors, fixed=fixed, spike_limit=spike_limit, correct=correct or (),
        sensors=sensor_depths or (),
    )  # fmt: skip
    told = moved.base_sums, moved.found, moved.findings, moved.inputs, moved.base.reading.depth
    with output.reported(report, "displacement:displacement_report", moved.base.table.path.stem, *told):
        if output_ is not None:
            write_displacements(output_, list(moved.found.items()), a0_azimuth)
    output.findings(moved.findings)
    if json:
        output.print_json(_content(moved, a0_azimuth))
        return
    _show(moved, a0_azimuth, not sensor_depths)
    output.print_outputs(output_, report, what="displacements")


def _show(moved: Movement, a0_azimuth: float | None, judged: bool) -> None:
    step = 1000.0 * moved.base.reading.step
    rows = [_sums_row(moved.base.table.path.stem, axis, sums, step) for axis, sums in moved.base_sums.items()]
    names = [list(moved.found)[k] for k in output.spread(len(moved.found), 10)]
    rows += [_sums_row(n, axis, one.sums, step) for n in names for axis, one in moved.found[n].axes.items()]
    if judged:
        output.table("check-sums, mm a step", ["reading", "axis", "mean", "sd", "robust sd", "spikes"], rows)
    rows = []
    for name in names:
        found = moved.found[name]
        for axis, one in found.axes.items():
            worst = int(np.argmax(np.abs(one.displacement)))
            # at the end that is free to move the uncertainty is the largest
            free = 0 if found.fixed == "bottom" else -1
            cells = [_mm(one.displacement[free]), _mm(2.0 * one.u[free], "")]
            cells += [_mm(one.displacement[worst]), _mm(2.0 * one.u[worst], ""), f"{found.depth[worst]:g}"]
            rows.append([name, axis.upper(), *cells])
        if "b" in found.axes:
            free = 0 if found.fixed == "bottom" else -1
            size, u, direction = found.resultant()
            worst = int(np.argmax(size))
            way = "A, B" if a0_azimuth is None else f"to {_azimuth(a0_azimuth + direction[worst]):.0f} deg"
            cells = [_mm(values[row], "") for row in (free, worst) for values in (size, 2.0 * u)]
            rows.append([name, way, *cells, f"{found.depth[worst]:g}"])
    end = "top" if next(iter(moved.found.values())).fixed == "bottom" else "bottom"
    header = ["reading", "axis", f"{end} mm", "U mm", "largest mm", "U mm", "at m"]
    title = f"displacement since the base reading{output.excerpt(len(names), len(moved.found))}"
    output.table(title, header, rows, "U: expanded uncertainty, k = 2")


def _azimuth(angle: Any) -> Any:
    return np.degrees(angle) % 360.0


def _sums_row(name: str, axis: str, sums: CheckSums | None, step: float) -> list[str]:
    if sums is None:
        return [name, axis.upper(), "not judged", "", "", ""]
    figures = [f"{step * value:.3f}" for value in (sums.mean, sums.sd, sums.robust_sd)]
    return [name, axis.upper(), *figures, str(int(sums.spikes.sum()))]


def _mm(metres: float, sign: str = "+") -> str:
    return f"{1000.0 * metres:{sign}.2f}" if np.isfinite(metres) else "not known"


def _content(moved: Movement, a0_azimuth: float | None) -> dict[str, Any]:
    step = 1000.0 * moved.base.reading.step
    return {
        "base": moved.base.table.path.stem,
        "base_check_sums": {axis: _sums(sums, step) for axis, sums in moved.base_sums.items()},
        "readings": {
            name: {
                "fixed": found.fixed,
                "depth_m": found.depth,
                "axes": {axis: _axis(one, step) for axis, one in found.axes.items()},
                "resultant": _resultant(found, a0_azimuth) if "b" in found.axes else None,
            }
            for name, found in moved.found.items()
        },
        "findings": moved.findings,
        "inputs": moved.inputs,
    }


def _resultant(found: Displacement, a0_azimuth: float | None) -> dict[str, Any]:
    size, u, direction = found.resultant()
    azimuth = None if a0_azimuth is None else _azimuth(a0_azimuth + direction)
    return {"displacement_mm": 1000.0 * size, "u_mm": 1000.0 * u, "azimuth_deg": azimuth}


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

"""From a file of bench readings to a calibrated tool, and several methods compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from pathlib import Path

import numpy as np

from inclinometry.attitude.orientation import angles, fields
from inclinometry.calibration.capability import capability
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.core.angles import wrap_signed
from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.earth.site import Site
from inclinometry.io.bench_csv import read_bench
from inclinometry.sensors.tool import Tool
from inclinometry.workflow.methods import Attempt, attempt_all, method


@dataclass(frozen=True)
class Options:
    """What a user may say of a run; each method uses some of it. Angles in rad.

    specific_force : the accelerometer reads -g at rest; for the methods without a rig, which cannot tell
    """

    rig_sd: float | None = None
    level_sd: float | None = None
    inclination_zero_sd: float | None = None
    nonorthogonality_sd: float | None = None
    temperature_degree: int | None = None
    robust: bool = False
    specific_force: bool = False
    name: str = "unnamed"


def calibrate(readings: BenchReadings, method_name: str, options: Options) -> Calibration:
    """Calibrate with a method by name; an option the method cannot use is refused, never ignored."""
    run = method(method_name)
    given = {f.name: getattr(options, f.name) for f in fields_of(Options) if getattr(options, f.name) != f.default}
    given.pop("name", None)
    _refuse_useless(method_name, given)
    if method_name != "joint":
        return run(readings, **given, name=options.name)
    nuisance = {
        "inclination_zero": options.inclination_zero_sd,
        "outer_nonorthogonality": options.nonorthogonality_sd,
        "inner_nonorthogonality": options.nonorthogonality_sd,
    }
    return run(
        readings,
        rig_sd=options.rig_sd,
        nuisance_sd={name: sd for name, sd in nuisance.items() if sd is not None},
        field_prior=None if options.level_sd is None else {"accelerometer": ([0.0, 0.0, 1.0], options.level_sd)},
        temperature_degree=options.temperature_degree,
        robust=options.robust,
        name=options.name,
    )


def _refuse_useless(method_name: str, given: Mapping[str, object]) -> None:
    rigless = method_name in ("field", "norm")
    for option in given:
        if option == "specific_force":
            useful, remedy = rigless, "leave it out: the rig tells the sign of the accelerometer"
        else:
            useful = method_name == "joint" or (option == "rig_sd" and not rigless)
            remedy = "leave it out, or use joint"
        if not useful:
            flag = option.replace("_", "-") + ("-deg" if option.endswith("_sd") else "")
            raise InputError(f"method {method_name} has no use for --{flag}; {remedy}")


INCLINATIONS = np.radians([5.0, 30.0, 60.0, 90.0])
"""Where expected uncertainties are quoted, rad."""


def readings_at(
    path: str | Path, site: Site | None = None, progress: Callable[[int], None] | None = None
) -> BenchReadings:
    """Bench readings of a file, completed by what a site file says of the fields at the stand."""
    readings = read_bench(path, progress=progress)
    return readings if site is None else replace(readings, reference={**readings.reference, **_site_fields(site)})


def _site_fields(site: Site) -> Mapping[str, float]:
    return {name: value for name in ("g", "b", "dip") if (value := getattr(site, name)) is not None}


def dip_of(calibration: Calibration, default: float = np.radians(70.0)) -> float:
    """Dip at the stand as the calibration found it, rad."""
    return default if calibration.dip is None else calibration.dip


def expected_uncertainty(calibration: Calibration, inclination: Array = INCLINATIONS) -> Array | None:
    """Standard uncertainties (n, 4) from the calibration alone, worst over azimuth and toolface; None for one triad."""
    triads = calibration.tool.triads
    if not all(kind in triads and triads[kind].full for kind in ("accelerometer", "magnetometer")):
        return None
    heat = next(iter(triads.values())).reference_temperature
    found = capability(calibration.tool, inclination, dip_of(calibration), temperature=heat)
    return np.asarray(np.sqrt(found.components["calibration"].max(axis=(1, 2))))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Methods side by side.

    attempts : in the order of the table of methods
    inclination : (n,) rad, where the figures below are taken
    uncertainty : method -> (n, 4) expected standard uncertainty from the calibration alone, rad
    error : method -> (n, 3) rms error of inclination, azimuth, toolface against a known truth, rad
    """

    attempts: list[Attempt]
    inclination: Array
    uncertainty: Mapping[str, Array]
    error: Mapping[str, Array]


def compare(
    readings: BenchReadings, *, truth: Tool | None = None, rig_sd: float | None = None, level_sd: float | None = None
) -> Comparison:
    """Run every applicable method on the same readings; rad."""
    attempts = attempt_all(readings, rig_sd=rig_sd, level_sd=level_sd)
    uncertainty, error = {}, {}
    for attempt in attempts:
        if attempt.calibration is None:
            continue
        expected = expected_uncertainty(attempt.calibration)
        if expected is not None:
            uncertainty[attempt.method] = expected
            if truth is not None:
                error[attempt.method] = true_errors(attempt.calibration.tool, truth, dip_of(attempt.calibration))
    return Comparison(attempts, INCLINATIONS, uncertainty, error)


def true_errors(tool: Tool, truth: Tool, dip: float, inclination: Array = INCLINATIONS) -> Array:
    """Rms errors (n, 3) of inclination, azimuth, toolface when noise-free signals of `truth` are read with `tool`."""
    turn = 2.0 * np.pi * np.arange(24) / 24
    grid = np.meshgrid(inclination, turn, turn, indexing="ij")
    g, b = fields(grid[1], grid[0], grid[2], dip)
    heat = np.full(grid[0].shape, truth.triads["accelerometer"].reference_temperature)
    seen = [
        tool.triads[kind].field(truth.triads[kind].signals(field, heat), heat)
        for kind, field in (("accelerometer", g), ("magnetometer", b))
    ]
    found = angles(*seen)
    off = [found.inclination - grid[0], found.azimuth - grid[1], found.toolface - grid[2]]
    return np.stack([np.sqrt(np.mean(wrap_signed(o) ** 2, axis=(1, 2))) for o in off], axis=1)

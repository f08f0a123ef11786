"""Simulated benches and wells in the files the rest of the package reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.arrays import Array, within
from inclinometry.calibration import plans
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.constants import DIALS, DIP
from inclinometry.errors import FileError, not_among, out_of_range, refused
from inclinometry.files.bench_csv import read_plan, write_raw_survey
from inclinometry.files.bench_csv import write_log as write_log_csv
from inclinometry.files.datasheet_toml import read_data_sheet
from inclinometry.files.survey_csv import write_survey_csv
from inclinometry.files.tool_json import read_extras, read_tool
from inclinometry.findings import Finding
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import Misread, Rig, simulate_bench, simulate_off_stand
from inclinometry.simulate.hole import SurveySimulation, WellProfile, simulate_survey, well_path
from inclinometry.simulate.log import LogSimulation, simulate_log
from inclinometry.simulate.sensing import MAGNETOMETERS, Characteristic, signal_of
from inclinometry.simulate.tool import has_step, random_tool, realistic_tool

PLANS = {
    "twelve": plans.twelve,
    "orthogonal": plans.orthogonal,
    "half": plans.half,
    "two-face": plans.two_face,
    "rotations": plans.rotations,
    "six": plans.six,
    "spread": plans.spread,
}
"""Plans that need no design, by name."""

_STAND = ("dip", "latitude", "declination", "base_tilt", "tilt_axis", "north_offset")

BITS = 12
"""Of the usual converter."""


def usual_bits(tool: Tool | None = None) -> int | None:
    """Bits of the converter where none are stated: none for a tool in a unit of which nothing says the step.

    Examples
    --------
    >>> usual_bits(), usual_bits(realistic_tool(1, bits=None))
    (12, 12)
    """
    known = tool is None or all(has_step(kind, triad.unit) for kind, triad in tool.triads.items())
    return BITS if known else None


def plan_named(name: str) -> Plan:
    """A plan by name, or from a CSV file."""
    if name in PLANS:
        return PLANS[name]()
    if Path(name).suffix or Path(name).exists():
        return read_plan(name)
    if name == "optimal":
        raise refused("work-optimal")
    raise not_among("plan", name, (*PLANS, "FILE.csv"))


def bench(
    plan: Plan,
    seed: int,
    *,
    rig: Rig,
    layout: str = "realistic",
    bits: int | None = BITS,
    noise: float = 1.0,
    repeats: int = 1,
    temperature: Array | float | None = None,
    temperature_degree: int = 0,
    truth: tuple[Tool, Rig | None] | None = None,
    characteristic: Mapping[str, Characteristic] | None = None,
    off_stand_scatter: float = 30.0,
) -> tuple[BenchReadings, Tool, dict[str, Any]]:
    """Simulate a bench run of a plan: readings, the tool behind them, and the rest of the truth.

    `noise` is a factor on 0.3 mg and 20 nT; without `bits` signals are in m/s^2 and nT without steps. `truth`: a tool
    and perhaps its stand, to be visited again; that stand replaces base and field of `rig`. `off_stand_scatter` in nT,
    of readings off the stand where the plan has them.
    """
    # how the sensors sit: near the tool's axes, or anywhere
    layouts = {"realistic": realistic_tool, "random": random_tool}
    if layout not in layouts:
        raise not_among("layout", layout, layouts)
    if noise < 0.0:
        raise out_of_range("noise", noise, ">= 0")
    tool = layouts[layout](seed, bits=bits, temperature_degree=temperature_degree) if truth is None else truth[0]
    stand = rig
    if truth is not None and truth[1] is not None:
        # the errors of this visit on the base and in the field of the stand
        stand = replace(rig, **{name: getattr(truth[1], name) for name in _STAND})
    characteristic = characteristic or {}
    sensors: dict[str, Any] = {"noise": _noise(tool, noise, characteristic), "bits": bits, "repeats": repeats}
    sensors |= {"characteristic": characteristic, "seed": seed}
    run = simulate_bench(tool, stand, plan.azimuth, plan.inclination, plan.toolface, temperature=temperature, **sensors)
    off = None
    if plan.off_stand is not None:
        attitudes = np.stack([getattr(plan.off_stand, name) for name in DIALS], axis=1)
        heat = None if temperature is None else float(np.mean(temperature))
        seen = simulate_off_stand(tool, stand, attitudes, off_stand_scatter, temperature=heat, **sensors)
        count = len(attitudes)
        off = BenchReadings(
            seen.signals,
            station=[str(len(plan) + 1 + i) for i in range(count)],
            sd=seen.sd,
            count=None if run.count is None else run.count[:1].repeat(count),
            temperature=None if heat is None else np.full(count, heat),
            units=run.units,
            reference=run.reference,
        )
    readings = BenchReadings(
        run.signals,
        run.azimuth,
        run.inclination,
        run.toolface,
        sd=run.sd,
        count=run.count,
        temperature=run.temperature,
        roll_set=plan.roll_set,
        units=run.units,
        reference=run.reference,
        findings=tuple(
            Finding("fit-saturated", {"kind": kind, "stations": int(hit.any(axis=1).sum())})
            for kind, hit in run.saturated.items()
            if hit.any()
        ),
        off_stand=off,
    )
    extras = {
        "seed": seed,
        "field_directions": dict(run.field_directions),
        "setting_errors_deg": np.degrees(run.setting_errors),
        "rig": stand_content(run.rig),
    }
    return readings, run.tool, extras


def stand_content(rig: Rig) -> dict[str, float]:
    """What a truth.json says of the stand, for `read_truth`."""
    return {f"{name}_deg": float(np.degrees(getattr(rig, name) or 0.0)) for name in _STAND}


def characteristics(
    magnetometer: str | None = None,
    nonlinearity: float = 0.0,
    accelerometer_noise: float | None = None,
    magnetometer_noise: float | None = None,
) -> dict[str, Characteristic]:
    """Characteristic of each kind: a magnetometer by name, a square law for all, their own noises in m/s^2 and nT."""
    if magnetometer is not None and magnetometer not in MAGNETOMETERS:
        raise not_among("magnetometer", magnetometer, MAGNETOMETERS)
    named = Characteristic() if magnetometer is None else MAGNETOMETERS[magnetometer]
    found = {"accelerometer": Characteristic(accelerometer_noise), "magnetometer": named, "gyro": Characteristic()}
    if magnetometer_noise is not None:
        found["magnetometer"] = replace(named, noise=magnetometer_noise)
    return {kind: replace(c, square=c.square + nonlinearity) for kind, c in found.items()}


def _noise(tool: Tool, factor: float, characteristic: Mapping[str, Characteristic]) -> dict[str, Array]:
    """Noise of one reading in signal units: that of the characteristic where it has one, else the tool's, scaled."""
    found = {}
    for kind, own in tool.noise.items():
        stated = characteristic[kind].noise if kind in characteristic else None
        found[kind] = factor * own if stated is None else signal_of(tool.triads[kind], stated)
    return found


def read_visited(path: str | Path) -> tuple[Tool, Rig | None]:
    """Tool and stand of a truth.json; the tool of a tool.json or of a data sheet, which know no stand."""
    tool = read_data_sheet(path)
    return (tool, None) if Path(path).suffix.lower() == ".toml" or not read_extras(path) else read_truth(path)


def read_truth(path: str | Path) -> tuple[Tool, Rig]:
    """Tool and stand of an earlier simulation."""
    stand = read_extras(path).get("rig")
    if not isinstance(stand, Mapping):
        raise FileError(Finding("input-missing", {"names": ("rig",)}), path=path)
    known = [f"{name}_deg" for name in _STAND]
    for name, value in stand.items():
        if name not in known:
            raise FileError(Finding("input-unknown", {"names": (f"rig.{name:.60}",), "known": tuple(known)}), path=path)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 360.0:
            raise FileError(
                Finding("input-value", {"name": f"rig.{name}", "value": f"{value!r:.60}", "allowed": "-360 .. 360"}),
                path=path,
            )
    angles: dict[str, Any] = {name.removesuffix("_deg"): float(np.radians(value)) for name, value in stand.items()}
    return read_tool(path), Rig(**angles)


def misread(text: str, size: int) -> Misread:
    """A fault "STATION:DIAL:DEGREES", e.g. "7:toolface:30"."""
    parts = text.split(":")
    dials = ("azimuth", "inclination", "toolface")
    try:
        station, dial, off = int(parts[0]), parts[1], float(parts[2])
    except (IndexError, ValueError):
        raise out_of_range("misread", text, "STATION:DIAL:DEGREES") from None
    within(station, f"misread {text}: STATION", 1, size)
    if dial not in dials:
        raise not_among(f"misread {text}: DIAL", dial, dials)
    return Misread(station - 1, dial, np.radians(off))


def repeated(plan: Plan, times: int) -> Plan:
    """A plan visited several times over."""
    rolls = [f"{name}.{i + 1}" if name else "" for i in range(times) for name in plan.roll_set]
    azimuth, inclination, toolface = (np.tile(a, times) for a in (plan.azimuth, plan.inclination, plan.toolface))
    return Plan(plan.name, azimuth, inclination, toolface, rolls, plan.off_stand)


def well(
    tool: Tool,
    seed: int,
    *,
    kickoff: float = 300.0,
    inclination: float = np.radians(60.0),
    azimuth: float = np.radians(75.0),
    hold: float = 900.0,
    spacing: float = 30.0,
    dip: float = DIP,
    noise: float = 1.0,
    characteristic: Mapping[str, Characteristic] | None = None,
) -> SurveySimulation:
    """The raw survey of a build-and-hold well; lengths in m, angles in rad, azimuth from magnetic north."""
    characteristic = characteristic or {}
    profile = WellProfile(kickoff=kickoff, hold=inclination, hold_length=hold, azimuth=azimuth, spacing=spacing)
    path = well_path(profile, seed)
    return simulate_survey(
        tool, *path, dip=dip, noise=_noise(tool, noise, characteristic), characteristic=characteristic, seed=seed
    )


def write_well(found: SurveySimulation, path: str | Path, truth: str | Path | None = None) -> None:
    """Raw survey CSV and, where wanted, the true path in the columns of a survey."""
    write_raw_survey(path, found.md, found.signals, found.temperature)
    if truth is not None:
        names = ("md", "inclination", "azimuth", "toolface", "magnetic_toolface")
        write_survey_csv(truth, {**{name: getattr(found, name) for name in names}, "azimuth_reference": "magnetic"})


def log(
    plan: Plan, seed: int, known: Tool | None = None, *, dwell: float = 5.0, move: float = 2.0, rate: float = 100.0
) -> tuple[LogSimulation, Tool]:
    """A log over the positions of a plan, of a tool of the seed where none is known; seconds, samples a second."""
    tool = known or realistic_tool(seed, bits=None)
    return simulate_log(
        tool, plan.azimuth, plan.inclination, plan.toolface, dwell=dwell, move=move, rate=rate, seed=seed
    ), tool


def write_log(found: LogSimulation, path: str | Path) -> None:
    """Log CSV."""
    write_log_csv(path, found.time, found.signals)

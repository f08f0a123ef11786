"""Commands that simulate: a bench, a well, a log; the truth is written beside the data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import Flag, Json, Output
from inclinometry.constants import DIP, STANDARD_GRAVITY
from inclinometry.errors import InputError
from inclinometry.files.bench_csv import write_bench
from inclinometry.files.tool_json import write_truth
from inclinometry.simulate.bench import Rig
from inclinometry.workflow import simulate as use
from inclinometry.workflow.plan import plan_file

AccelNoise = Annotated[float | None, Parameter(name="--accel-noise-mg")]
MagNoise = Annotated[float | None, Parameter(name="--mag-noise-nT")]


def bench(
    *,
    plan: str,
    output_: Output,
    seed: int = 1,
    truth: Path | None = None,
    tool: Path | None = None,
    other_stand: Flag = False,
    layout: str = "realistic",
    rig_sd_deg: float = 0.0,
    base_tilt_deg: float = 0.0,
    north_offset_deg: float = 0.0,
    inclination_zero_deg: float = 0.0,
    dip_deg: float = float(np.degrees(DIP)),
    bits: int | None = None,
    noise: float = 1.0,
    magnetometer: Literal["magnetoresistive", "fluxgate"] | None = None,
    accel_noise: AccelNoise = None,
    mag_noise: MagNoise = None,
    nonlinearity_percent: float = 0.0,
    repeats: int = 1,
    temperature: Annotated[
        list[float] | None, Parameter(name="--temperature-degC", consume_multiple=True, negative="")
    ] = None,
    temperature_degree: int = 0,
    misread: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    json: Json = False,
) -> None:
    """Simulate bench readings of a plan.

    Parameters
    ----------
    plan
        twelve, orthogonal, half, two-face, rotations, or a CSV file of positions.
    output_
        Bench readings CSV.
    seed
        Decides tool, rig errors and noise.
    truth
        Write the tool and stand behind the readings.
    tool
        truth.json of an earlier simulation: visit the same tool on the same stand again. Or tool.json, or a data
        sheet (TOML): that tool on a new stand.
    other_stand
        With --tool: the same tool on another stand, the one of these options.
    layout
        realistic (a few per cent and degrees off) or random (sensors anywhere).
    rig_sd_deg
        Random error of each setting of the rig.
    base_tilt_deg
        Tilt of the rig's base, about a random axis.
    north_offset_deg
        Azimuth of the rig's zero.
    inclination_zero_deg
        Constant error of the inclination dial.
    dip_deg
        Magnetic dip at the bench.
    bits
        Of the converter; 0 for signals without steps. 12 when not given, but none for a --tool whose signals are in
        another unit than counts, m/s2 and nT (a data sheet in V), of which nothing says how large a step is.
    noise
        Factor on 0.3 mg and 20 nT, both triads.
    magnetometer
        magnetoresistive (20 nT of noise) or fluxgate (noise, non-linearity and hysteresis of 0.5 % of full scale each).
    accel_noise
        Noise of one accelerometer reading, instead of --noise.
    mag_noise
        Noise of one magnetometer reading, instead of --noise and of what --magnetometer has.
    nonlinearity_percent
        Square law of every sensor: what it is off at full scale.
    repeats
        Readings averaged at each station.
    temperature
        The whole plan is visited at each of these temperatures.
    temperature_degree
        Degree of the tool's own dependence on temperature.
    misread
        Faults STATION:DIAL:DEGREES, e.g. 7:toolface:30.
    json
        Print a JSON summary.
    """
    output.claim({"--output": output_, "--truth": truth}, {"--plan": plan_file(plan), "--tool": tool})
    places = use.plan_named(plan)
    heat = None
    if temperature:
        places = use.repeated(places, len(temperature))
        heat = np.repeat(np.array(temperature), len(places) // len(temperature))
    rig = Rig(
        dip=options.angle(dip_deg, "--dip-deg", -90.0, 90.0),
        base_tilt=options.angle(base_tilt_deg, "--base-tilt-deg", -180.0, 180.0),
        north_offset=options.angle(north_offset_deg, "--north-offset-deg"),
        setting_sd=options.angle(rig_sd_deg, "--rig-sd-deg", 0.0, options.LARGEST_SD),
        inclination_zero=options.angle(inclination_zero_deg, "--inclination-zero-deg", -180.0, 180.0),
        faults=[use.misread(text, len(places)) for text in misread or ()],
    )
    again = None if tool is None else use.read_visited(tool)
    if other_stand:
        if again is None:
            raise InputError("--other-stand is for a tool visited again: give --tool truth.json")
        again = (again[0], rig)
    found = use.bench(
        places,
        seed,
        rig=rig,
        layout=layout,
        bits=(use.usual_bits(None if again is None else again[0]) if bits is None else bits) or None,
        noise=noise,
        repeats=repeats,
        temperature=heat,
        temperature_degree=temperature_degree,
        truth=again,
        characteristic=use.characteristics(
            magnetometer,
            nonlinearity_percent / 100.0,
            None if accel_noise is None else 1e-3 * STANDARD_GRAVITY * accel_noise,
            mag_noise,
        ),
    )
    write_bench(found.readings, output_)
    if truth is not None:
        write_truth(found.truth, found.extras, truth)
    output.warnings(found.readings.warnings)
    if json:
        output.print_json({"stations": len(found.readings), "output": output_, "truth": truth})
    else:
        output.say(f"{output.counted(len(found.readings), 'station')} written to {output_}")


def well(
    *,
    truth: Path,
    output_: Output,
    seed: int = 1,
    kickoff_m: float = 300.0,
    inclination_deg: float = 60.0,
    azimuth_deg: float = 75.0,
    hold_m: float = 900.0,
    spacing_m: float = 30.0,
    dip_deg: float = float(np.degrees(DIP)),
    noise: float = 1.0,
    magnetometer: Literal["magnetoresistive", "fluxgate"] | None = None,
    accel_noise: AccelNoise = None,
    mag_noise: MagNoise = None,
    nonlinearity_percent: float = 0.0,
    path: Path | None = None,
    json: Json = False,
) -> None:
    """Simulate the raw survey of a build-and-hold well with a simulated tool.

    Parameters
    ----------
    truth
        truth.json of the tool (from simulate bench), or tool.json, or a data sheet (TOML).
    output_
        Raw survey CSV: md_m and the channels.
    seed
        Decides toolfaces and noise.
    kickoff_m
        Depth at which building starts.
    inclination_deg
        Of the hold section.
    azimuth_deg
        From magnetic north.
    hold_m
        Length of the hold section.
    spacing_m
        Between stations.
    dip_deg
        Magnetic dip at the well.
    noise
        Factor on the tool's own noise.
    magnetometer
        magnetoresistive (20 nT of noise) or fluxgate (noise, non-linearity and hysteresis of 0.5 % of full scale each).
    accel_noise
        Noise of one accelerometer reading, instead of --noise.
    mag_noise
        Noise of one magnetometer reading, instead of --noise and of what --magnetometer has.
    nonlinearity_percent
        Square law of every sensor: what it is off at full scale.
    path
        Write the true path (survey CSV columns).
    json
        Print a JSON summary.
    """
    output.claim({"--output": output_, "--path": path}, {"--truth": truth})
    found = use.well(
        use.read_visited(truth)[0],
        seed,
        kickoff=kickoff_m,
        inclination=options.angle(inclination_deg, "--inclination-deg", 0.0, 180.0),
        azimuth=options.angle(azimuth_deg, "--azimuth-deg"),
        hold=hold_m,
        spacing=spacing_m,
        dip=options.angle(dip_deg, "--dip-deg", -90.0, 90.0),
        noise=noise,
        characteristic=use.characteristics(
            magnetometer,
            nonlinearity_percent / 100.0,
            None if accel_noise is None else 1e-3 * STANDARD_GRAVITY * accel_noise,
            mag_noise,
        ),
    )
    use.write_well(found, output_, path)
    if json:
        output.print_json({"stations": len(found.md), "output": output_, "path": path})
    else:
        output.say(f"{output.counted(len(found.md), 'station')} written to {output_}")


def log(
    *,
    plan: str,
    output_: Output,
    seed: int = 1,
    truth: Path | None = None,
    dwell_s: float = 5.0,
    move_s: float = 2.0,
    rate_hz: float = 100.0,
    json: Json = False,
) -> None:
    """Simulate a continuous log: the tool rests at each position of a plan and moves between them.

    Parameters
    ----------
    plan
        Plan by name or CSV file.
    output_
        Log CSV: time_s and the channels.
    seed
        Decides tool, motion and noise.
    truth
        Write the tool behind the log.
    dwell_s
        Rest at each position.
    move_s
        Time between rests.
    rate_hz
        Samples a second.
    json
        Print a JSON summary.
    """
    output.claim({"--output": output_, "--truth": truth}, {"--plan": plan_file(plan)})
    places = use.plan_named(plan)
    found, tool = use.log(places, seed, dwell=dwell_s, move=move_s, rate=rate_hz)
    use.write_log(found, output_)
    if truth is not None:
        write_truth(tool, {"seed": seed}, truth)
    if json:
        output.print_json({"samples": len(found.time), "rests": len(places), "output": output_})
    else:
        output.say(f"{len(found.time)} samples, {output.counted(len(places), 'rest')}, written to {output_}")

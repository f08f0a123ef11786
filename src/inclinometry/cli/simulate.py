"""Commands that simulate: a bench, a well, a log, a gyro run, drilling; the truth is written beside the data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import AlsoWritten, Flag, Input, InputOrNone, Json, Output, Scheme
from inclinometry.constants import DEG_PER_HOUR, DIP, STANDARD_GRAVITY
from inclinometry.errors import InputError

if TYPE_CHECKING:
    from inclinometry.simulate.sensing import Characteristic

# what makes the data is imported by each command: a gyro run needs no bench, drilling neither
DIP_DEG: Final = float(np.degrees(DIP))

SiteWritten: TypeAlias = Annotated[AlsoWritten, Parameter(help="Write the site.toml that goes with it.")]


@Parameter(name="*", group=options.SENSORS)
@dataclass(frozen=True)
class Sensors:
    """Noise of the sensors, and what bends them."""

    noise: float = 1.0
    """Factor on the tool's own noise, 0.3 mg and 20 nT of a simulated one."""
    magnetometer: Literal["magnetoresistive", "fluxgate"] | None = None
    """magnetoresistive (20 nT of noise) or fluxgate (noise, non-linearity and hysteresis of 0.5 % of full scale each);
    the tool's own when not given."""
    accel_noise_mg: float | None = None
    """Noise of one accelerometer reading, instead of --noise."""
    mag_noise_nt: Annotated[float | None, Parameter(name="--mag-noise-nT")] = None
    """Noise of one magnetometer reading, instead of --noise and of what --magnetometer has."""
    nonlinearity_percent: float = 0.0
    """Square law of every sensor: what it is off at full scale."""

    def characteristics(self) -> dict[str, Characteristic]:
        """Of each kind of sensor, in SI units."""
        from inclinometry.workflow.simulate import characteristics

        accelerometer = None if self.accel_noise_mg is None else 1e-3 * STANDARD_GRAVITY * self.accel_noise_mg
        return characteristics(self.magnetometer, self.nonlinearity_percent / 100.0, accelerometer, self.mag_noise_nt)


USUAL: Final = Sensors()


def bench(
    *,
    plan: Annotated[str, Parameter(group=options.INPUT, help=f"A CSV file of positions, or {options.plan_names()}.")],
    output_: Output,
    seed: int = 1,
    truth: AlsoWritten = None,
    tool: InputOrNone = None,
    other_stand: Annotated[Flag, Parameter(group=options.STAND)] = False,
    layout: Literal["realistic", "random"] = "realistic",
    rig_sd_deg: Annotated[float, Parameter(group=options.STAND)] = 0.0,
    base_tilt_deg: Annotated[float, Parameter(group=options.STAND)] = 0.0,
    north_offset_deg: Annotated[float, Parameter(group=options.STAND)] = 0.0,
    inclination_zero_deg: Annotated[float, Parameter(group=options.STAND)] = 0.0,
    dip_deg: Annotated[float, Parameter(group=options.STAND)] = DIP_DEG,
    bits: int | None = None,
    sensors: Sensors = USUAL,
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
    output_
        Bench readings CSV.
    seed
        Decides tool, rig errors and noise.
    truth
        Write the tool and stand behind the readings.
    tool
        truth.json of an earlier simulation: visit the same tool on the same stand again. Or tool.json, or a data sheet
        (TOML): that tool on a new stand. A new tool drawn by the seed when not given.
    other_stand
        With --tool: the same tool on another stand, the one of these options.
    layout
        realistic: a few per cent and degrees off. random: sensors anywhere.
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
        Of the converter; 0 for signals without steps. When not given 12, but none for a --tool whose signals are in
        another unit than counts, m/s2 and nT (a data sheet in V), of which nothing says how large a step is.
    repeats
        Readings averaged at each station.
    temperature
        The whole plan is visited at each of these temperatures; without, no temperature is written.
    temperature_degree
        Degree of the tool's own dependence on temperature.
    misread
        Faults STATION:DIAL:DEGREES, e.g. 7:toolface:30; none when not given.
    """
    from inclinometry.files.bench_csv import write_bench
    from inclinometry.files.tool_json import write_truth
    from inclinometry.simulate.bench import Rig
    from inclinometry.workflow import simulate as use
    from inclinometry.workflow.plan import plan_file

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
    readings, drawn, extras = use.bench(
        places,
        seed,
        rig=rig,
        layout=layout,
        bits=(use.usual_bits(None if again is None else again[0]) if bits is None else bits) or None,
        noise=sensors.noise,
        repeats=repeats,
        temperature=heat,
        temperature_degree=temperature_degree,
        truth=again,
        characteristic=sensors.characteristics(),
    )
    write_bench(readings, output_)
    if truth is not None:
        write_truth(drawn, extras, truth)
    output.warnings(readings.warnings)
    if json:
        output.print_json({"stations": len(readings), "output": output_, "truth": truth})
    else:
        output.say(f"{output.counted(len(readings), 'station')} written to {output_}")


def well(
    *,
    truth: Input,
    output_: Output,
    seed: int = 1,
    kickoff_m: float = 300.0,
    inclination_deg: float = 60.0,
    azimuth_deg: float = 75.0,
    hold_m: float = 900.0,
    spacing_m: float = 30.0,
    dip_deg: float = DIP_DEG,
    sensors: Sensors = USUAL,
    path: AlsoWritten = None,
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
    path
        Write the true path (survey CSV columns).
    """
    from inclinometry.workflow import simulate as use

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
        noise=sensors.noise,
        characteristic=sensors.characteristics(),
    )
    use.write_well(found, output_, path)
    if json:
        output.print_json({"stations": len(found.md), "output": output_, "path": path})
    else:
        output.say(f"{output.counted(len(found.md), 'station')} written to {output_}")


def log(
    *,
    plan: Annotated[str, Parameter(group=options.INPUT, help=f"A CSV file of positions, or {options.plan_names()}.")],
    output_: Output,
    seed: int = 1,
    tool: InputOrNone = None,
    truth: AlsoWritten = None,
    dwell_s: float = 5.0,
    move_s: float = 2.0,
    rate_hz: float = 100.0,
    json: Json = False,
) -> None:
    """Simulate a continuous log: the tool rests at each position of a plan and moves between them.

    Parameters
    ----------
    output_
        Log CSV: time_s and the channels.
    seed
        Decides tool, motion and noise.
    tool
        truth.json, tool.json or a data sheet: this tool, not one of the seed.
    truth
        Write the tool behind the log.
    dwell_s
        Rest at each position.
    move_s
        Time between rests.
    rate_hz
        Samples a second.
    """
    from inclinometry.files.datasheet_toml import read_nameplate
    from inclinometry.files.tool_json import write_truth
    from inclinometry.workflow import simulate as use
    from inclinometry.workflow.plan import plan_file

    output.claim({"--output": output_, "--truth": truth}, {"--plan": plan_file(plan), "--tool": tool})
    places = use.plan_named(plan)
    known = None if tool is None else read_nameplate(tool)
    found, made = use.log(places, seed, known, dwell=dwell_s, move=move_s, rate=rate_hz)
    use.write_log(found, output_)
    if truth is not None:
        write_truth(made, {"seed": seed}, truth)
    if json:
        output.print_json({"samples": len(found.time), "rests": len(places), "output": output_})
    else:
        output.say(f"{len(found.time)} samples, {output.counted(len(places), 'rest')}, written to {output_}")


def gyro(
    *,
    output_: Output,
    seed: int = 1,
    noise_seed: int | None = None,
    truth: AlsoWritten = None,
    site: SiteWritten = None,
    scenario: Literal["hot", "cool"] = "hot",
    stations: int = 60,
    scheme: Scheme = "four",
    latitude_deg: float = 45.0,
    arw_deg_sqrt_h: float = 0.005,
    dwell_s: float = 400.0,
    bias_deg_h: float = 1.0,
    drift_deg_h_h: float = 0.0,
    axes: Literal[2, 3] = 2,
    gyros: Literal[1, 2] = 2,
    accel_sd_m_s2: float = 0.0005,
    spike: str | None = None,
    json: Json = False,
) -> None:
    """Simulate a gyro run: readings at the index positions of each station.

    Parameters
    ----------
    output_
        Readings CSV, as gyro north reads them.
    seed
        Decides well, temperature, scale factor and noise.
    noise_seed
        Run the same hole again: decides toolfaces and noise alone. When not given, --seed decides them too.
    truth
        Write the true angles and scale factors.
    scenario
        hot: 20 to 140 degC, the scale factor follows; cool: 20 degC, scale 1.
    stations
        Number of stations, 30 m apart.
    latitude_deg
        North positive.
    arw_deg_sqrt_h
        Angle random walk of the gyros.
    dwell_s
        Time at a station, shared by its positions.
    bias_deg_h
        Of every gyro.
    drift_deg_h_h
        Of the bias.
    axes
        3: gyro and accelerometer along the tool too.
    gyros
        1: a single gyro across the tool.
    accel_sd_m_s2
        Noise of one accelerometer reading.
    spike
        A fault STATION:POSITION:DEG_H, e.g. 3:2:5; none when not given.
    """
    from inclinometry.files.writing import write_text
    from inclinometry.workflow import simulate_gyro as use

    output.claim({"--output": output_, "--truth": truth, "--site": site}, {})
    if axes == 3 and gyros == 1:
        raise InputError("--axes 3 goes with --gyros 2: a gyro along the tool beside two across")
    if not 2 <= stations <= 100_000:
        raise InputError(f"--stations is {stations}; allowed 2 to 100000")
    values = (("--arw-deg-sqrt-h", arw_deg_sqrt_h, 10.0), ("--accel-sd-m-s2", accel_sd_m_s2, 1.0))
    for name, value, high in (*values, ("--dwell-s", dwell_s, 1e6)):
        low = 1e-3 if name == "--dwell-s" else 0.0
        if not low <= value <= high:
            raise InputError(f"{name} is {value:g}; allowed {low:g} to {high:g}")
    request = use.GyroRunRequest(
        scenario,
        stations,
        scheme,
        options.angle(latitude_deg, "--latitude-deg", -89.0, 89.0),
        np.radians(arw_deg_sqrt_h) / 60.0,
        dwell_s,
        bias_deg_h * DEG_PER_HOUR,
        drift_deg_h_h * DEG_PER_HOUR / 3600.0,
        axes,
        gyros,
        accel_sd_m_s2,
        None if spike is None else _spike(spike, stations, len(use.POSITIONS[scheme])),
    )
    run, _ = use.gyro_run(request, seed, noise_seed)
    use.write_gyro(run, output_)
    if truth is not None:
        use.write_gyro_truth(run, seed, truth)
    if site is not None:
        write_text(f'latitude_deg = {latitude_deg:.10g}\nnorth_reference = "true"\n', site)
    if json:
        output.print_json({"stations": stations, "readings": len(run.station), "output": output_, "truth": truth})
    else:
        output.say(f"{output.counted(stations, 'station')}, {len(run.station)} readings, written to {output_}")


def _spike(text: str, stations: int, positions: int) -> tuple[int, int, float]:
    """STATION:POSITION:DEG_H, both counted from 1."""
    try:
        station, position, size = text.split(":")
        found = int(station), int(position), float(size)
    except ValueError:
        raise InputError(f"--spike is {text!r}; write STATION:POSITION:DEG_H, e.g. 3:2:5") from None
    if not (1 <= found[0] <= stations and 1 <= found[1] <= positions and np.isfinite(found[2])):
        raise InputError(f"--spike is {text!r}; stations 1 to {stations}, positions 1 to {positions}")
    return found[0] - 1, found[1] - 1, found[2] * DEG_PER_HOUR


def drilling(
    *,
    output_: Output,
    scenario: Literal[
        "smooth", "vibration-5g", "vibration-20g", "stick-slip", "sliding", "stationary", "fast", "whirl"
    ] = "stick-slip",
    seed: int = 1,
    duration_s: float | None = None,
    inclination_deg: float | None = None,
    azimuth_deg: float | None = None,
    truth: AlsoWritten = None,
    site: SiteWritten = None,
    json: Json = False,
) -> None:
    """Simulate a tool that drills: readings while it turns and shakes.

    Parameters
    ----------
    output_
        Run as dynamic reads it, .parquet or .csv: time_s, accel, mag, gyro, temperature_degC.
    scenario
        How the string moves.
    seed
        Decides all that is random.
    duration_s
        Length of the run; the scenario's own when not given.
    inclination_deg
        Of the hole; the scenario's own when not given.
    azimuth_deg
        Of the hole, from magnetic north; the scenario's own when not given.
    truth
        Write the true angles, .parquet or .csv.
    """
    from inclinometry.files.writing import write_text
    from inclinometry.workflow import simulate_drilling as use

    output.claim({"--output": output_, "--truth": truth, "--site": site}, {})
    request = use.DrillingRequest(
        scenario,
        seed,
        duration_s,
        options.angle_or_none(inclination_deg, "--inclination-deg", 0.0, 180.0),
        options.angle_or_none(azimuth_deg, "--azimuth-deg"),
    )
    with output.working("simulating") as progress:
        samples = use.write_drilling(request, output_, truth, progress=progress)
    if site is not None:
        write_text(use.site_text(request.chosen.hole), site)
    if json:
        output.print_json(
            {
                "scenario": scenario,
                "summary": request.chosen.summary,
                "samples": samples,
                "sampling_interval_s": request.chosen.instrument.interval,
                "output": output_,
                "truth": truth,
            }
        )
        return
    output.say(request.chosen.summary)
    output.say(f"{output.counted(samples, 'sample')} written to {output_}" + (f", truth to {truth}" if truth else ""))

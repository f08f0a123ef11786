"""Commands that simulate: a bench, a well, a log, a gyro run, drilling; the truth is written beside the data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

import numpy as np
from cyclopts import Parameter

from inclinometry.arrays import finite, within
from inclinometry.cli import options, output
from inclinometry.constants import DEG_PER_HOUR, DIP
from inclinometry.errors import out_of_range, refused

if TYPE_CHECKING:
    from inclinometry.simulate.sensing import Characteristic

# what makes the data is imported by each command: a gyro run needs no bench, drilling neither

Turn: TypeAlias = Annotated[float, options.quantity("deg", -180.0, 180.0, group=options.STAND)]
Plan: TypeAlias = Annotated[
    str, Parameter(group=options.INPUT, help=f"A CSV file of positions, or {options.plan_names()}.")
]
SiteWritten: TypeAlias = Annotated[options.AlsoWritten, Parameter(help="Write the site.toml of the run.")]


@Parameter(name="*", group=options.SENSORS)
@dataclass(frozen=True)
class Sensors:
    """Noise of the sensors, and what bends them."""

    noise: float = 1.0
    """Factor on the tool's noise (0.3 mg and 20 nT for a simulated tool)."""
    magnetometer: Literal["magnetoresistive", "fluxgate"] | None = None
    """magnetoresistive (20 nT of noise) or fluxgate (noise, non-linearity and hysteresis of 0.5 % of full scale each);
    Default: the tool's own."""
    accel_noise: Annotated[float | None, options.quantity("mg")] = None
    """Noise of one accelerometer reading, instead of --noise."""
    mag_noise: Annotated[float | None, options.quantity("nT")] = None
    """Noise of one magnetometer reading, instead of --noise and --magnetometer."""
    nonlinearity: Annotated[float, options.quantity("percent")] = 0.0
    """Quadratic error of every sensor at full scale."""

    def characteristics(self) -> dict[str, Characteristic]:
        """Of each kind of sensor, in SI units."""
        from inclinometry.workflow.simulate import characteristics

        return characteristics(self.magnetometer, self.nonlinearity, self.accel_noise, self.mag_noise)


USUAL: Final = Sensors()


def bench(
    *,
    plan: Plan,
    output_: options.Output,
    seed: int = 1,
    truth: options.AlsoWritten = None,
    tool: options.InputOrNone = None,
    new_stand: Annotated[options.Flag, Parameter(group=options.STAND)] = False,
    layout: Literal["realistic", "random"] = "realistic",
    rig_sd: Annotated[options.Sd, Parameter(group=options.STAND)] = 0.0,
    base_tilt: Turn = 0.0,
    north_offset: Annotated[options.Azimuth, Parameter(group=options.STAND)] = 0.0,
    inclination_zero: Turn = 0.0,
    dip: Annotated[options.Dip, Parameter(group=options.STAND)] = DIP,
    bits: int | None = None,
    sensors: Sensors = USUAL,
    repeats: int = 1,
    temperature: Annotated[
        list[float] | None, Parameter(name="--temperature-degC", consume_multiple=True, negative="")
    ] = None,
    temperature_degree: int = 0,
    misread: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    off_stand_scatter: Annotated[float, options.quantity("nT")] = 30.0,
    json: options.Json = False,
) -> None:
    """Simulate bench readings of a plan.

    Parameters
    ----------
    output_
        Bench readings CSV.
    seed
        Seed of tool, rig errors and noise.
    truth
        Write the tool and stand behind the readings.
    tool
        truth.json of an earlier simulation: the same tool on the same stand. tool.json or a data sheet (TOML): that
        tool on a new stand. Default: a new tool drawn by the seed.
    new_stand
        With --tool: the same tool on a new stand, described by these options.
    layout
        realistic: errors of a few per cent and degrees. random: sensors in any direction.
    rig_sd
        Standard deviation of a dial setting.
    base_tilt
        Tilt of the rig's base about a random axis.
    north_offset
        Azimuth of the rig's zero.
    inclination_zero
        Constant error of the inclination dial.
    dip
        Magnetic dip at the bench.
    bits
        Bits of the converter; 0 for none. If not given: 12; none if the signals of --tool are not in counts, m/s2 and
        nT.
    repeats
        Readings averaged at each station.
    temperature
        Visit the whole plan at each of these temperatures. Without it no temperature is written.
    temperature_degree
        Degree of the tool's temperature dependence.
    misread
        Faults STATION:DIAL:DEGREES, e.g. 7:toolface:30. Default: none.
    off_stand_scatter
        Readings off the stand, if the plan has them: scatter of each component of the magnetic field.
    """
    from inclinometry.files.bench_csv import write_bench
    from inclinometry.files.tool_json import write_truth
    from inclinometry.simulate.bench import Rig
    from inclinometry.workflow import simulate as use
    from inclinometry.workflow.plan import plan_file

    output.check_outputs({"--output": output_, "--truth": truth}, {"--plan": plan_file(plan), "--tool": tool})
    places = use.plan_named(plan)
    heat = None
    if temperature:
        places = use.repeated(places, len(temperature))
        heat = np.repeat(np.array(temperature), len(places) // len(temperature))
    rig = Rig(
        dip=dip,
        base_tilt=base_tilt,
        north_offset=north_offset,
        setting_sd=rig_sd,
        inclination_zero=inclination_zero,
        faults=[use.misread(text, len(places)) for text in misread or ()],
    )
    again = None if tool is None else use.read_visited(tool)
    if new_stand:
        if again is None:
            raise refused("input-needs", {"name": "--new-stand", "needed": ("--tool",)})
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
        off_stand_scatter=off_stand_scatter,
    )
    write_bench(readings, output_)
    if truth is not None:
        write_truth(drawn, extras, truth)
    output.findings(readings.findings)
    told = {"stations": len(readings), "output": output_, "truth": truth}
    off = readings.off_stand
    more = f" and {output.counted(len(off), 'reading')} off the stand" if off else ""
    _done(output.counted(len(readings), "station") + more, json, told | ({"off_stand": len(off)} if off else {}))


def well(
    *,
    truth: options.Input,
    output_: options.Output,
    seed: int = 1,
    kickoff: Annotated[float, options.quantity("m", 0.0, 2e4)] = 300.0,
    inclination: options.Inclination = 60.0 * options.SI["deg"],
    azimuth: options.Azimuth = 75.0 * options.SI["deg"],
    hold: Annotated[float, options.quantity("m", 0.0, 2e4)] = 900.0,
    spacing: Annotated[float, options.quantity("m", 0.0, 2e4, above=True)] = 30.0,
    dip: options.Dip = DIP,
    sensors: Sensors = USUAL,
    path: options.AlsoWritten = None,
    json: options.Json = False,
) -> None:
    """Simulate the raw survey of a build-and-hold well with a simulated tool.

    Parameters
    ----------
    truth
        truth.json of the tool (from simulate bench), or tool.json, or a data sheet (TOML).
    output_
        Raw survey CSV: md_m and the channels.
    seed
        Seed of toolfaces and noise.
    kickoff
        Depth at which building starts.
    inclination
        Inclination of the hold section.
    azimuth
        From magnetic north.
    hold
        Length of the hold section.
    spacing
        Between stations.
    dip
        Magnetic dip at the well.
    path
        Write the true path (survey CSV columns).
    """
    from inclinometry.workflow import simulate as use

    output.check_outputs({"--output": output_, "--path": path}, {"--truth": truth})
    found = use.well(
        use.read_visited(truth)[0],
        seed,
        kickoff=kickoff,
        inclination=inclination,
        azimuth=azimuth,
        hold=hold,
        spacing=spacing,
        dip=dip,
        noise=sensors.noise,
        characteristic=sensors.characteristics(),
    )
    use.write_well(found, output_, path)
    _done(output.counted(len(found.md), "station"), json, {"stations": len(found.md), "output": output_, "path": path})


def log(
    *,
    plan: Plan,
    output_: options.Output,
    seed: int = 1,
    tool: options.InputOrNone = None,
    truth: options.AlsoWritten = None,
    dwell: Annotated[float, options.quantity("s")] = 5.0,
    move: Annotated[float, options.quantity("s")] = 2.0,
    rate: Annotated[float, options.quantity("hz")] = 100.0,
    json: options.Json = False,
) -> None:
    """Simulate a continuous log: the tool rests at each position of a plan and moves between them.

    Parameters
    ----------
    output_
        Log CSV: time_s and the channels.
    seed
        Seed of tool, motion and noise.
    tool
        truth.json, tool.json or a data sheet. Default: a tool drawn by the seed.
    truth
        Write the tool behind the log.
    dwell
        Rest at each position.
    move
        Time between rests.
    rate
        Samples per second.
    """
    from inclinometry.files.datasheet_toml import read_data_sheet
    from inclinometry.files.tool_json import write_truth
    from inclinometry.workflow import simulate as use
    from inclinometry.workflow.plan import plan_file

    output.check_outputs({"--output": output_, "--truth": truth}, {"--plan": plan_file(plan), "--tool": tool})
    places = use.plan_named(plan)
    known = None if tool is None else read_data_sheet(tool)
    found, made = use.log(places, seed, known, dwell=dwell, move=move, rate=rate)
    use.write_log(found, output_)
    if truth is not None:
        write_truth(made, {"seed": seed}, truth)
    what = f"{len(found.time)} samples, {output.counted(len(places), 'rest')},"
    _done(what, json, {"samples": len(found.time), "rests": len(places), "output": output_})


def gyro(
    *,
    output_: options.Output,
    seed: int = 1,
    noise_seed: int | None = None,
    truth: options.AlsoWritten = None,
    site: SiteWritten = None,
    scenario: Literal["hot", "cool"] = "hot",
    stations: int = 60,
    scheme: options.Scheme = "four",
    latitude: Annotated[float, options.quantity("deg", -89.0, 89.0)] = 45.0 * options.SI["deg"],
    arw: Annotated[float, options.quantity("deg_sqrt_h", 0.0, 10.0)] = 0.005 * options.SI["deg_sqrt_h"],
    dwell: Annotated[float, options.quantity("s", 1e-3, 1e6)] = 400.0,
    bias: Annotated[float, options.quantity("deg_h")] = options.SI["deg_h"],
    drift: Annotated[float, options.quantity("deg_h_h")] = 0.0,
    axes: Literal[2, 3] = 2,
    gyros: Literal[1, 2] = 2,
    accel_sd: Annotated[float, options.quantity("m_s2", 0.0, 1.0)] = 0.0005,
    outlier: str | None = None,
    json: options.Json = False,
) -> None:
    """Simulate a gyro run: readings at the index positions of each station.

    Parameters
    ----------
    output_
        Write the readings, for gyro north.
    seed
        Seed of well, temperature, scale factor and noise.
    noise_seed
        Run the same hole again: seed of toolfaces and noise. If not given, --seed is used.
    truth
        Write the true angles and scale factors.
    scenario
        hot: 20 to 140 degC, the scale factor follows; cool: 20 degC, scale 1.
    stations
        Number of stations, 30 m apart.
    latitude
        North positive.
    arw
        Angle random walk of the gyros.
    dwell
        Time at a station, all positions together.
    bias
        Of every gyro.
    drift
        Of the bias.
    axes
        3: gyro and accelerometer along the tool too.
    gyros
        1: a single gyro across the tool.
    accel_sd
        Noise of one accelerometer reading.
    outlier
        A fault STATION:POSITION:DEG_H, e.g. 3:2:5. Default: none.
    """
    from inclinometry.files.writing import write_text
    from inclinometry.workflow import simulate_gyro as use

    output.check_outputs({"--output": output_, "--truth": truth, "--site": site}, {})
    if axes == 3 and gyros == 1:
        raise refused("input-needs", {"name": "--axes 3", "needed": ("--gyros 2",)})
    if not 2 <= stations <= 100_000:
        raise out_of_range("--stations", stations, "2 .. 100000")
    run = use.gyro_run(
        seed,
        noise_seed,
        scenario=scenario,
        stations=stations,
        scheme=scheme,
        latitude=latitude,
        arw=arw,
        dwell=dwell,
        bias=bias,
        drift=drift,
        axes=axes,
        gyros=gyros,
        accelerometer_noise=accel_sd,
        spike=None if outlier is None else _outlier(outlier, stations, len(use.POSITIONS[scheme])),
    )
    use.write_gyro(run, output_)
    if truth is not None:
        use.write_gyro_truth(run, seed, truth)
    if site is not None:
        write_text(f'latitude_deg = {np.degrees(latitude):.10g}\nnorth_reference = "true"\n', site)
    what = f"{output.counted(stations, 'station')}, {len(run.station)} readings,"
    _done(what, json, {"stations": stations, "readings": len(run.station), "output": output_, "truth": truth})


def _outlier(text: str, stations: int, positions: int) -> tuple[int, int, float]:
    """STATION:POSITION:DEG_H, both counted from 1."""
    try:
        station, position, size = text.split(":")
        found = int(station), int(position), float(size)
    except ValueError:
        raise out_of_range("--outlier", text, "STATION:POSITION:DEG_H") from None
    for name, value, most in zip(("STATION", "POSITION"), found, (stations, positions), strict=False):
        within(value, f"--outlier {text}: {name}", 1, most)
    finite(found[2], f"--outlier {text}: DEG_H")
    return found[0] - 1, found[1] - 1, found[2] * DEG_PER_HOUR


def drilling(
    *,
    output_: options.Output,
    scenario: Literal[
        "smooth", "vibration-5g", "vibration-20g", "stick-slip", "sliding", "stationary", "fast", "whirl"
    ] = "stick-slip",
    seed: int = 1,
    duration: Annotated[float | None, options.quantity("s")] = None,
    inclination: options.InclinationOrNone = None,
    azimuth: options.AzimuthOrNone = None,
    truth: options.AlsoWritten = None,
    site: SiteWritten = None,
    json: options.Json = False,
) -> None:
    """Simulate a tool that drills: readings while it turns and shakes.

    Parameters
    ----------
    output_
        Write the run, for dynamic, .parquet or .csv: time_s, accel, mag, gyro, temperature_degC.
    scenario
        Motion of the drill string.
    seed
        Seed of everything random.
    duration
        Length of the run. Default: the scenario's own.
    inclination
        Of the hole. Default: the scenario's own.
    azimuth
        Of the hole, from magnetic north. Default: the scenario's own.
    truth
        Write the true angles, .parquet or .csv.
    """
    from inclinometry.files.writing import write_text
    from inclinometry.workflow import simulate_drilling as use

    output.check_outputs({"--output": output_, "--truth": truth, "--site": site}, {})
    request = use.DrillingRequest(scenario, seed, duration, inclination, azimuth)
    with output.working("simulating") as progress:
        samples = use.write_drilling(request, output_, truth, progress=progress)
    if site is not None:
        write_text(use.site_text(request.chosen.hole), site)
    summary, interval = request.chosen.summary, request.chosen.instrument.interval
    told = {"scenario": scenario, "summary": summary, "samples": samples, "sampling_interval_s": interval}
    _done(f"{summary}\n{output.counted(samples, 'sample')}", json, {**told, "output": output_, "truth": truth})


def _done(what: str, json: bool, content: Mapping[str, object]) -> None:
    """What was simulated and where it is; JSON names the truth beside it too."""
    if json:
        output.print_json(content)
    else:
        truth = f", truth to {content['truth']}" if content.get("truth") else ""
        output.print_line(f"{what} written to {content['output']}{truth}")

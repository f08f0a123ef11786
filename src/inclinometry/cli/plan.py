"""Commands before a calibration: plan the positions, find the still stations of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from inclinometry.calibration.plans import PlanName
from inclinometry.cli import options, output
from inclinometry.cli.options import InputOrNone, Json, Output
from inclinometry.files.bench_csv import write_bench, write_plan

Range = Annotated[tuple[float, float] | None, Parameter(negative="")]


def plan(
    name: Literal[PlanName, "optimal"],
    /,
    *,
    output_: Output,
    number: Annotated[int | None, Parameter(name=["--number", "-n"])] = None,
    inclination_range_deg: Range = None,
    criterion: Literal["azimuth", "inclination", "trace"] | None = None,
    rig_sd_deg: float | None = None,
    dip_deg: float | None = None,
    first_inclination_deg: float | None = None,
    azimuth_deg: float | None = None,
    rolls: int | None = None,
    azimuths: int | None = None,
    seed: int | None = None,
    repeats: int = 0,
    json: Json = False,
) -> None:
    """Write the rig settings of a calibration plan.

    Parameters
    ----------
    name
        The plan.
    output_
        CSV with station, azimuth_deg, inclination_deg, toolface_deg.
    number
        Stations of an optimal plan; 24 when not given.
    inclination_range_deg
        Where the tool will work, which an optimal plan is aimed at; 10 90 when not given.
    criterion
        What an optimal plan minimises over that range; azimuth when not given.
    rig_sd_deg
        Random error of a setting of the rig an optimal plan is for; 0.1 when not given.
    dip_deg
        Magnetic dip at the bench an optimal plan is for; 70 when not given.
    first_inclination_deg
        First of the two inclinations of rotations, 30 when not given; the second is 90 degrees more.
    azimuth_deg
        Azimuth of rotations; 0 when not given.
    rolls
        Equal rolls a turn, of twelve (3 when not given) and rotations (8).
    azimuths
        Equal azimuths of twelve at which the tool lies; 3 when not given.
    seed
        Of the search for an optimal plan; 1 when not given.
    repeats
        Positions visited once more at the end, 1 or 2: they show sensors that drift during the run.
    """
    from inclinometry.workflow.plan import advice, gain_of_repeats, make_plan, plan_file

    output.claim({"--output": output_}, {"plan": plan_file(name)})
    with output.working("searching the plan") as progress:
        found = make_plan(
            name,
            number=number,
            inclination_range=options.inclination_range(inclination_range_deg, "--inclination-range-deg"),
            criterion=criterion,
            rig_sd=options.sd(rig_sd_deg, "--rig-sd-deg"),
            dip=options.angle_or_none(dip_deg, "--dip-deg", -90.0, 90.0),
            first_inclination=options.angle_or_none(first_inclination_deg, "--first-inclination-deg", 0.0, 180.0),
            azimuth=options.angle_or_none(azimuth_deg, "--azimuth-deg"),
            rolls=rolls,
            azimuths=azimuths,
            seed=seed,
            progress=progress,
        )
    whole = found.repeated(repeats)
    gain = gain_of_repeats(found, repeats) if repeats and name != "six" else ""
    write_plan(whole, output_)
    output.warnings(advice(name))
    if json:
        told = {"plan": found.name, "stations": len(whole), "output": output_, "warnings": advice(name)}
        output.print_json(told | ({"repeats": gain} if gain else {}))
        return
    output.say(f"{found.name}: {output.counted(len(whole), 'station')} written to {output_}")
    if gain:
        output.say(f"  {output.counted(repeats, 'position')} visited once more at the end: {gain}")


def readings(
    log: Path,
    /,
    *,
    output_: Output,
    plan: InputOrNone = None,
    window_s: float = 0.5,
    shortest_s: float = 1.0,
    json: Json = False,
) -> None:
    """Find the still stations of a continuous log and write one reading for each.

    Parameters
    ----------
    log
        CSV with time_s and the channels.
    output_
        Bench readings CSV: means, standard deviation of one sample, count.
    plan
        Positions visited, in order; adds the rig angles, which are not known without.
    window_s
        Time over which stillness is judged.
    shortest_s
        Shortest rest that counts.
    """
    from inclinometry.files.bench_csv import read_plan
    from inclinometry.files.profile import Profile, current, reading_with
    from inclinometry.workflow.stations import readings_of_log

    output.claim({"--output": output_}, {"the log": log, "--plan": plan})
    with reading_with(Profile(units=current().units)):  # --profile says what the log is, --units both
        positions = None if plan is None else read_plan(plan)
    with output.reading(log) as progress:
        found, intervals = readings_of_log(
            log,
            plan=positions,
            window=window_s,
            shortest=shortest_s,
            progress=progress,
        )
    write_bench(found, output_)
    if json:
        output.print_json({"stations": len(found), "output": output_, "notes": found.notes})
        return
    output.say(f"{output.counted(len(found), 'still station')} written to {output_}")
    for sentence in intervals.report():
        output.say(f"  {sentence}")

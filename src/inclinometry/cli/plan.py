"""Commands before a calibration: plan the positions, find the still stations of a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter, Token

from inclinometry.calibration.plans import PlanName
from inclinometry.cli import options, output
from inclinometry.cli.options import InputOrNone, Json, Output
from inclinometry.errors import out_of_range
from inclinometry.files.bench_csv import write_bench, write_plan


def _range(type_: Any, tokens: Sequence[Token]) -> tuple[float, float]:
    """Two inclinations in rad, the lower first."""
    low, high = (float(token.value) for token in tokens)
    if not 0.0 <= low < high <= 180.0:
        raise out_of_range(tokens[0].keyword or "", f"{low:g} .. {high:g}", "0 <= LOW < HIGH <= 180")
    return radians(low), radians(high)


def plan(
    name: Literal[PlanName, "optimal"],
    /,
    *,
    output_: Output,
    number: Annotated[int | None, Parameter(name=["--number", "-n"])] = None,
    inclination_range: Annotated[
        tuple[float, float] | None,
        Parameter(name="--inclination-range-deg", negative="", converter=_range, n_tokens=2),
    ] = None,
    criterion: Literal["azimuth", "inclination", "trace"] | None = None,
    rig_sd: options.SdOrNone = None,
    dip: options.DipOrNone = None,
    first_inclination: options.InclinationOrNone = None,
    azimuth: options.AzimuthOrNone = None,
    rolls: int | None = None,
    azimuths: int | None = None,
    seed: int | None = None,
    repeats: int = 0,
    off_stand: options.Flag = False,
    json: Json = False,
) -> None:
    """Write the rig settings of a calibration plan.

    Parameters
    ----------
    name
        The plan.
    output_
        Table to write: station, azimuth_deg, inclination_deg, toolface_deg.
    number
        Stations of an optimal plan. Default: 24.
    inclination_range
        Optimal plan: inclinations at which the tool will work. Default: 10 90.
    criterion
        Optimal plan: what it minimises over that range. Default: azimuth.
    rig_sd
        Optimal plan: standard deviation of a dial setting. Default: 0.1.
    dip
        Optimal plan: magnetic dip at the stand. Default: 70.
    first_inclination
        Plan rotations: first of its two inclinations; the second is 90 degrees more. Default: 30.
    azimuth
        Plan rotations: its azimuth. Default: 0.
    rolls
        Plans twelve and rotations: rolls per turn, equally spaced. Default: 3 and 8.
    azimuths
        Plan twelve: azimuths of the lying tool, equally spaced. Default: 3.
    seed
        Optimal plan: seed of the search. Default: 1.
    repeats
        Positions repeated at the end, 1 or 2; they show drift during the run.
    off_stand
        Add twelve attitudes away from the stand, by hand and without dials: they show the magnetism of the stand.
    """
    from inclinometry.calibration.plans import off_stand as away
    from inclinometry.workflow.plan import advice, gain_of_repeats, make_plan, plan_file

    output.check_outputs({"--output": output_}, {"plan": plan_file(name)})
    with output.working("searching the plan") as progress:
        found = make_plan(
            name,
            number=number,
            inclination_range=inclination_range,
            criterion=criterion,
            rig_sd=rig_sd,
            dip=dip,
            first_inclination=first_inclination,
            azimuth=azimuth,
            rolls=rolls,
            azimuths=azimuths,
            seed=seed,
            progress=progress,
        )
    whole = found.repeated(repeats)
    if off_stand:
        whole = replace(whole, off_stand=away())
    gain = gain_of_repeats(found, repeats) if repeats and name != "six" else ""
    write_plan(whole, output_)
    output.findings(advice(name))
    if json:
        told = {"plan": found.name, "stations": len(whole), "output": output_, "findings": advice(name)}
        told |= {"off_stand": len(whole.off_stand)} if whole.off_stand else {}
        output.print_json(told | ({"repeats": gain} if gain else {}))
        return
    away_too = f" and {output.counted(len(whole.off_stand), 'attitude')} off the stand" if whole.off_stand else ""
    output.print_line(f"{found.name}: {output.counted(len(whole), 'station')}{away_too} written to {output_}")
    if gain:
        output.print_line(f"  {output.counted(repeats, 'position')} visited once more at the end: {gain}")


def readings(
    log: Path,
    /,
    *,
    output_: Output,
    plan: InputOrNone = None,
    window: Annotated[float, options.quantity("s", 0.0, 1e6, above=True)] = 0.5,
    shortest: Annotated[float, options.quantity("s", 0.0, 1e6, above=True)] = 1.0,
    json: Json = False,
) -> None:
    """Find the still stations of a continuous log and write one reading for each.

    Parameters
    ----------
    log
        CSV with time_s and the channels.
    output_
        Bench readings to write: means, standard deviation of one sample, count.
    plan
        Plan of the positions, in order; adds the rig angles to the readings.
    window
        Time over which stillness is judged.
    shortest
        Shortest rest that counts.
    """
    from inclinometry.files.bench_csv import read_plan
    from inclinometry.files.profile import Profile, current, reading_with
    from inclinometry.workflow.stations import readings_of_log

    output.check_outputs({"--output": output_}, {"the log": log, "--plan": plan})
    with reading_with(Profile(units=current().units)):  # --profile says what the log is, --units both
        positions = None if plan is None else read_plan(plan)
    with output.reading(log) as progress:
        found, intervals = readings_of_log(log, plan=positions, window=window, shortest=shortest, progress=progress)
    write_bench(found, output_)
    if json:
        output.print_json({"stations": len(found), "output": output_, "findings": found.findings})
        return
    output.print_line(f"{output.counted(len(found), 'still station')} written to {output_}")
    for one in intervals.findings:
        output.print_line(f"  {one}")

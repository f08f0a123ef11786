"""Command: simulate fleet, a ledger with years of certified calibrations, run files, and the truth beside them."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from cyclopts import Parameter

from inclinometry.arrays import Array
from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.cli import output
from inclinometry.cli.extras import need
from inclinometry.cli.options import Json, Output
from inclinometry.constants import DIP
from inclinometry.errors import FileError, out_of_range, system_reason
from inclinometry.files.tool_json import write_truth
from inclinometry.files.writing import write_bytes, write_text
from inclinometry.findings import Finding
from inclinometry.history import ToolHistory, tool_from_relative
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import BenchSimulation, Rig, simulate_bench
from inclinometry.simulate.fleet import FleetScene, FleetSimulation, simulate_calibrations, simulate_fleet
from inclinometry.simulate.tool import Streams, realistic_tool
from inclinometry.workflow.simulate import stand_content

if TYPE_CHECKING:
    from inclinometry.laboratory.ledger.ledger import Ledger

AUTHOR: Final = "simulation"
LABORATORY: Final = ("Simulated laboratory", "nowhere", "ZZ")
"""Name, address, country; ZZ is a code that no country has."""
RIG_SD: Final = float(np.radians(0.1))
"""Of a setting of the simulated rigs, rad."""
JUMP: Final = 8e-3
"""Offset by which the x magnetometer of a tool jumps, of the full field: 400 nT."""
_BITS: Final = 16


def simulate(
    *,
    output_: Output,
    tools: int = 10,
    calibrations: int = 4,
    runs: int = 3,
    samples: int = 20000,
    jumps: int = 0,
    ledger: Annotated[Path | None, Parameter(help="Its ledger (SQLite). Default: lab.sqlite in the folder.")] = None,
    type_: Annotated[str, Parameter(name="--type")] = "simulated",
    seed: int = 1,
    json: Json = False,
) -> None:
    """Simulate a fleet: tools that drift, calibrated over years on two rigs, and runs; about a second a calibration.

    Certificates are digital, without their PDF.

    Parameters
    ----------
    output_
        Folder, to be made: runs/, named TOOL_RUN_DATE.parquet, truth/ and lab.toml.
    tools
        Number of tools.
    calibrations
        Calibrations per tool, twelve positions each; the last is half a year after the one before.
    runs
        Of each tool.
    samples
        Of a run, a hundred a second.
    jumps
        Number of tools whose x magnetometer jumps by 400 nT before their last calibration.
    type_
        Under which the tools are registered.
    seed
        Seed of everything but the times in the ledger.
    """
    need("pyarrow", "sqlalchemy")
    for name, value, low, high in (
        ("tools", tools, 1, 5000),
        ("calibrations", calibrations, 2, 40),
        ("runs", runs, 0, 1000),
        ("samples", samples, 100, 1 << 26),
        ("jumps", jumps, 0, tools),
    ):
        if not low <= value <= high:
            raise out_of_range(f"--{name}", value, f"{low} .. {high}")
    place = output_ / "lab.sqlite" if ledger is None else ledger
    for path in (output_, place):
        if path.exists():
            raise FileError(Finding("fleet-there"), path=path)
    if not place.parent.is_dir() and ledger is not None:
        raise FileError(Finding("file-folder-absent", {"folder": str(place.parent)}), path=place)
    # made beside, and put in place when all of it is there
    draft = output_.with_name(f".{output_.name}.part")
    shutil.rmtree(draft, ignore_errors=True)
    try:
        draft.mkdir(parents=True)
    except OSError as error:
        raise FileError(Finding("file-unwritable", {"reason": system_reason(error)}), path=output_) from None
    try:
        with output.working(f"{tools * calibrations} calibrations") as progress:
            made = _fleet(draft, tools, calibrations, runs, samples, jumps, type_, seed, progress)
        if ledger is not None:
            shutil.move(draft / "lab.sqlite", ledger)
        draft.rename(output_)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    if json:
        output.print_json(
            {"output": output_, "ledger": place, "tools": tools, "calibrations": made, "runs": tools * runs}
        )
        return
    output.print_line(
        f"{output.counted(tools, 'tool')}, {output.counted(made, 'certified calibration')} in {place}, "
        f"{output.counted(tools * runs, 'run')} in {output_ / 'runs'}, the truth in {output_ / 'truth'}"
    )


def _fleet(
    folder: Path, tools: int, calibrations: int, runs: int, samples: int, jumps: int, type_: str, seed: int,
    progress: Callable[[float], None] | None,
) -> int:  # fmt: skip
    from inclinometry.laboratory.ledger.admin import create
    from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool

    change = np.zeros(24)
    change[15] = JUMP
    scene = FleetScene(
        tools, np.zeros((24, 24)), calibrations, multiplier_sd=0.6, rigs=2,
        jumps={(i, calibrations - 1): change for i in range(tools - jumps, tools)},
    )  # fmt: skip
    found = simulate_fleet(scene, type=type_, first=date(2026 - calibrations, 1, 1), seed=seed)
    streams = Streams(seed, "simulated fleet")
    nominal = [realistic_tool(streams[f"tool {i}"], bits=_BITS) for i in range(tools)]
    rows = []
    for i, (tool, history) in enumerate(zip(nominal, found.histories, strict=True)):
        plan = plans.twelve()
        settings = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
        rig = Rig(DIP, setting_sd=RIG_SD)
        benches = simulate_calibrations(tool, found.truth[i], rig, settings, bits=_BITS, seed=streams[f"bench {i}"])
        rows += [(history.date[k], i, k, one) for k, one in enumerate(benches)]
    rows.sort(key=lambda row: row[:2])
    _truth(folder / "truth", found, nominal)
    named = zip(("name", "address", "country"), LABORATORY, strict=True)
    write_text("".join(f'{name} = "{value}"\n' for name, value in named), folder / "lab.toml")
    for i in range(tools):
        _runs(folder, found, nominal[i], i, runs, samples, streams[f"runs {i}"])
    with create(folder / "lab.sqlite", sign=False) as ledger:  # no laboratory signs what was simulated
        for name in sorted({name for history in found.histories for name in history.rig}):
            put_rig(ledger, RegisteredRig(name, (RIG_SD, RIG_SD, RIG_SD)), author=AUTHOR)
        for history in found.histories:
            put_tool(ledger, RegisteredTool(history.serial, type_), author=AUTHOR)
        numbers: dict[int, int] = {}
        for count, (day, owner, place, bench) in enumerate(rows, 1):
            numbers[day.year] = numbers.get(day.year, 0) + 1
            _certified(ledger, found.histories[owner], place, bench, f"{day.year}-{numbers[day.year]:04d}")
            if progress is not None:
                progress(count / len(rows))
    return len(rows)


def _certified(ledger: Ledger, history: ToolHistory, place: int, bench: BenchSimulation, number: str) -> None:
    """Calibrate, record and certify, as on the day of the readings."""
    from inclinometry.laboratory import certificates
    from inclinometry.laboratory.certificate.laboratory import Laboratory
    from inclinometry.laboratory.import_file import record_calibration

    day = history.date[place]
    readings = BenchReadings(
        bench.signals, bench.azimuth, bench.inclination, bench.toolface, units=bench.units, reference=bench.reference
    )
    found = calibrate_joint(readings, rig_sd=RIG_SD, diagnose=False, name=history.serial)
    doses = {"hours": float(np.asarray(history.hours)[place])}
    settings = {"settings": {"performed": day.isoformat(), **doses}}
    record = record_calibration(ledger, found, history.serial, history.rig[place], settings, author=AUTHOR)
    certificates.issue(
        ledger, record.id, None, Laboratory(*LABORATORY), author=AUTHOR, number=number,
        now=datetime(day.year, day.month, day.day, tzinfo=UTC), pdf=False,
        accept_warnings="simulated readings",
    )  # fmt: skip


def _truth(folder: Path, found: FleetSimulation, nominal: list[Tool]) -> None:
    """The tools as they are after their last calibration, and how each went."""
    folder.mkdir()
    for i, (tool, history) in enumerate(zip(nominal, found.histories, strict=True)):
        now = tool_from_relative(tool, found.truth[i, -1], np.zeros((24, 24)), history.serial)
        extras = {
            "rig": stand_content(Rig(DIP)),
            "drift_multiplier": float(found.multipliers[i]),
            "dates": [day.isoformat() for day in history.date],
            "rigs": list(history.rig),
            "relative_parameters": found.truth[i],
        }
        write_truth(now, extras, folder / f"{history.serial}.json")


def _runs(
    folder: Path, found: FleetSimulation, nominal: Tool, tool: int, runs: int, samples: int, random: np.random.Generator
) -> None:
    """Runs of a tool that leans and turns slowly, as counts, between its calibrations and up to 100 days after."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    history = found.histories[tool]
    (folder / "runs").mkdir(exist_ok=True)
    first, last = history.date[0], history.date[-1]
    days = np.sort(random.choice((last - first).days + 100, runs, replace=False))
    lines = ["run,date,inclination_deg,azimuth_deg,toolface_start_deg,toolface_rate_deg_s"]
    passed = np.array([(day - first).days for day in history.date], dtype=np.float64)
    for number, day in enumerate(days.tolist(), 1):
        values = np.array([np.interp(day, passed, column) for column in found.truth[tool].T])
        now = tool_from_relative(nominal, values, np.zeros((24, 24)))
        time = np.arange(samples) / 100.0
        inclination, azimuth, start = random.uniform([5.0, 0.0, 0.0], [90.0, 360.0, 360.0])
        rate = 15.0  # deg/s
        at: list[Array] = [np.full(samples, np.radians(x)) for x in (azimuth, inclination)]
        seen = simulate_bench(now, Rig(DIP), at[0], at[1], np.radians(start + rate * time), bits=_BITS, seed=random)
        columns = {"time_s": time}
        for kind, prefix in (("accelerometer", "accel"), ("magnetometer", "mag")):
            columns |= {f"{prefix}_{axis}": seen.signals[kind][:, k] for k, axis in enumerate("xyz")}
        target = io.BytesIO()
        pq.write_table(pa.table(columns), target)
        name, when = f"R{number}", (first + timedelta(days=day)).isoformat()
        write_bytes(target.getvalue(), folder / "runs" / f"{history.serial}_{name}_{when}.parquet")
        lines.append(f"{name},{when},{inclination:.6f},{azimuth:.6f},{start:.6f},{rate:g}")
    write_text("\n".join(lines) + "\n", folder / "truth" / f"{history.serial}_runs.csv")

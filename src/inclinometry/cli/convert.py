"""Command that turns a survey of one format into another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import Convention, Flag, Ignore, InputOrNone, Json
from inclinometry.errors import refused
from inclinometry.files.profile import current
from inclinometry.workflow.convert import Conversion
from inclinometry.workflow.convert import convert as convert_file

Form = Literal["csv", "xlsx", "parquet", "las", "witsml", "p7", "wits"]
Target = Literal["csv", "csv-excel", "xlsx", "parquet", "las", "witsml", "p7", "wits", "survex", "therion", "compass"]


def convert(
    source: Path,
    target: Path,
    /,
    *,
    from_: Annotated[Form | None, Parameter(name="--from", group=options.INPUT)] = None,
    to: Annotated[Target | None, Parameter(group=options.OUTPUT)] = None,
    convention: Annotated[
        Convention,
        Parameter(help="Axes and signs of the source. Default: by its format; native for a table."),
    ] = None,
    azimuth_reference: Annotated[Literal["magnetic", "true", "grid"] | None, Parameter(group=options.INPUT)] = None,
    depth_unit: Annotated[Literal["m", "ft", "ftUS"] | None, Parameter(group=options.INPUT)] = None,
    map_: Annotated[InputOrNone, Parameter(name="--map")] = None,
    check: Flag = False,
    ignore: Ignore = (),
    json: Json = False,
) -> None:
    """Turn a survey of one format into another, and say what the other cannot hold.

    Parameters
    ----------
    source
        CSV, .xlsx, Parquet, LAS, WITSML, P7 or WITS file.
    target
        File to write.
    from_
        Format of the source. Default: by its ending.
    to
        Format of the target. Default: by its ending. csv-excel has semicolons, decimal commas and a byte-order
        mark; survex, therion and compass are written as legs.
    azimuth_reference
        North of the azimuths if the source states none.
    depth_unit
        Unit of depth if a P7 file states none.
    map_
        TOML map of the items of a WITS stream.
    check
        Check the run: units, axes, depths, single stations; refuse one that cannot be true.
    """
    if ignore and not check:
        raise refused("input-needs", {"name": "--ignore", "needed": ("--check",)})
    output.check_outputs({"the target": target}, {"the source": source, "--map": map_})
    with output.busy(f"converting {source.name}"):
        done = convert_file(
            source,
            target,
            from_format=from_,
            to_format=to,
            convention=convention,
            azimuth_reference=azimuth_reference,
            sheet=current().sheet,
            depth_unit=depth_unit,
            channels=map_,
            check=check,
            ignored=ignore,
        )
    _show(done, target, json)


def _show(done: Conversion, target: Path, json: bool) -> None:
    """What was written, what the reader found and what the target does not hold."""
    found = (*done.survey.findings, *done.findings)
    output.findings((*found, *done.lost))
    if json:
        output.print_json(
            {
                "stations": len(done.survey),
                "from": done.source,
                "to": done.target,
                "lost": [one.plain() for one in done.lost],
                "findings": found,
                "output": target,
            }
        )
        return
    output.print_line(f"{output.counted(len(done.survey), 'station')} written to {target}")

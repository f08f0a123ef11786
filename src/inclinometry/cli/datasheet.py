"""Command that makes a tool out of the data sheet values of its sensors."""

from __future__ import annotations

from pathlib import Path

from inclinometry.cli import output
from inclinometry.cli.bench import show_parameters
from inclinometry.cli.options import Flag, Json, Output
from inclinometry.digest import digest_file
from inclinometry.errors import refused
from inclinometry.files.datasheet_toml import TEMPLATE, read_datasheet
from inclinometry.files.tool_json import write_calibration
from inclinometry.files.writing import write_text


def datasheet(sheet: Path | None = None, /, *, output_: Output, template: Flag = False, json: Json = False) -> None:
    """Make a tool out of the data sheet values of its sensors: scale K, axes C, offset U0.

    Parameters
    ----------
    sheet
        Data sheet, TOML: for each triad unit, per, scale, offset or bias, axes or misalignment_deg, uncertainties.
    output_
        Write tool.json, for survey, verify and simulate; or the template.
    template
        Write a data sheet to fill in instead.
    """
    output.check_outputs({"--output": output_}, {"the data sheet": sheet})
    if (sheet is None) != template:
        raise refused("input-one-of", {"names": ("SHEET", "--template")})
    if sheet is None:
        write_text(TEMPLATE, output_)
        output.print_line(f"template written to {output_}")
        return
    found = read_datasheet(sheet)
    write_calibration(found, output_)
    output.findings(found.findings)
    if json:
        output.print_json({"tool": found.tool.name, "output": output_, "digest": digest_file(output_)})
        return
    show_parameters(found)
    output.print_line(f"written to {output_}")

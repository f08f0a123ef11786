"""Command that writes the coefficients of a tool as a firmware or another program takes them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import OutputOrNone
from inclinometry.errors import FileError
from inclinometry.findings import Finding


def coefficients(
    tool: Path,
    /,
    *,
    format_: Annotated[
        Literal["table", "json", "c", "csv"] | None, Parameter(name="--format", group=options.OUTPUT)
    ] = None,
    output_: OutputOrNone = None,
    temperature: Annotated[float | None, Parameter(name="--temperature-degC")] = None,
) -> None:
    """Coefficients of a tool as a firmware takes them: a = W (U - U0), W the inverse of N, and the classical views.

    Parameters
    ----------
    tool
        tool.json or truth.json
    format_
        table: on the terminal. json: every view. c: header with single-precision constants. csv: one line per sensor.
        If not given: by the ending of the output (.json, .h, .csv), else table.
    output_
        File to write. Default: standard output.
    temperature
        Temperature of the coefficients. Default: reference temperature of the calibration; json and c then have W and
        U0 as polynomials.
    """
    from inclinometry.files.coefficients import coefficients as read_coefficients
    from inclinometry.files.coefficients import coefficients_c, coefficients_csv, coefficients_json
    from inclinometry.files.writing import write_text

    output.check_outputs({"--output": output_}, {"the tool": tool})
    endings = {".json": "json", ".h": "c", ".csv": "csv"}
    chosen = format_ or (endings.get(output_.suffix.lower(), "table") if output_ else "table")
    if chosen == "table" and output_ is not None:
        raise FileError(Finding("file-ending", {"ending": output_.suffix, "allowed": tuple(endings)}), path=output_)
    content = read_coefficients(tool, temperature)
    if chosen == "table":
        show_coefficients(content)
        return
    form = {"json": coefficients_json, "c": coefficients_c, "csv": coefficients_csv}
    text = form[chosen](content)
    if output_ is None:
        output.print_line(text.rstrip("\n"))
    else:
        write_text(text, output_)
        output.print_line(f"written to {output_}")


def show_coefficients(content: dict[str, Any]) -> None:
    """Views of each triad on the terminal."""
    for kind, triad in content["triads"].items():
        unit, field = triad["unit"], triad["field_unit"]
        rows, views = [], []
        for i, sensor in enumerate(triad["sensors"]):
            rows.append([str(i + 1), *(f"{v:.7g}" for v in (*triad["inverse"][:, i], triad["offset"][i]))])
            cosines = (f"{v:+.6f}" for v in sensor["cosines"])
            angles = (f"{sensor[f'installation_{n}_deg']:.3f}" for n in ("angle", "phase"))
            views.append(
                [str(i + 1), f"{sensor['K']:.7g}", f"{sensor['bias']:.5g}", *cosines, sensor["nominal"], *angles]
            )
        head = ["sensor", "W x", "W y", "W z", f"U0 {unit}"]
        output.table(f"{kind} at {triad['temperature_degC']:g} degC: a = W (U - U0), columns of W", head, rows)
        head = ["sensor", f"K {unit} per {field}", f"bias {field}", *(f"cos {axis}" for axis in "xyz")]
        title = f"{kind}: factor K, bias U0/K, cosines, installation angle and phase"
        output.table(title, [*head, "axis", "I deg", "phase deg"], views)

"""Commands that say what a file is understood to be, and which names, plans, limits and codes there are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from inclinometry.cli import output
from inclinometry.cli.options import InputOrNone, Json, OutputOrNone

if TYPE_CHECKING:
    from inclinometry.workflow.check import Look


def check(
    file: Path,
    /,
    *,
    output_: OutputOrNone = None,
    calibration: InputOrNone = None,
    site: InputOrNone = None,
    json: Json = False,
) -> int:
    """What a file is understood to be, which commands could take it, whether it can be true; exit status 1 if not.

    Parameters
    ----------
    file
        Text with any separator, .gz, Excel, Parquet, LAS, HDF5, .npz, .mat, JSON of arrays.
    output_
        Write a draft of a profile (TOML) to complete and use as --profile.
    calibration
        tool.json of the raw channels; checks them as survey does.
    site
        site.toml; the fields of a run are compared with it.
    """
    from inclinometry.files.writing import write_text
    from inclinometry.workflow.check import look

    output.check_outputs({"--output": output_}, {"the file": file, "--calibration": calibration, "--site": site})
    with output.busy(f"looking at {file.name}"):
        seen = look(file, calibration, site)
    output.findings(seen.findings, notes=True)
    status = 1 if seen.refused else 0
    if output_ is not None:
        write_text(seen.draft, output_)
    if json:
        output.print_json(
            {
                "layout": seen.layout,
                "rows": seen.rows,
                "columns": [
                    {**column._asdict(), "here": column.here or None, "remark": str(column.remark or "")}
                    for column in seen.columns
                ],
                "conventions": [candidate._asdict() for candidate in seen.candidates],
                "uses": seen.uses,
                "refused": seen.refused,
                "findings": seen.findings,
            }
        )
        return status
    _show(file, seen)
    able = [command for command, lacking in seen.uses.items() if not lacking]
    taken = f"accepted by {'; '.join(able)}" if able else "accepted by no command as it is"
    refused = f"; refused: {', '.join(seen.refused)}" if seen.refused else ""
    output.print_line(f"{seen.layout}; {seen.rows:,} rows; {taken}{refused}")
    if output_ is not None:
        output.print_line(f"draft of a profile written to {output_}: complete it, then give --profile {output_}")
    elif not able:
        again = file if output.named(str(file)) == str(file) else "-"
        output.print_line(f"write a draft of a profile: inclinometry check {again} -o profile.toml")
    return status


def _show(file: Path, seen: Look) -> None:
    """Columns, conventions and commands on the terminal."""
    output.print_line(f"{file}: {seen.layout}; {seen.rows:,} rows")
    rows = []
    for column in seen.columns:
        low, high = (f"{value:.6g}" if np.isfinite(value) else "" for value in (column.low, column.high))
        rows.append([column.name, column.here or "not known", low, high, str(column.remark or "")])
    output.table("columns", ["in the file", "taken as", "lowest", "highest", "remark"], rows)
    if seen.candidates:
        header = ["convention", "dip deg", "scatter deg", "z points down"]
        fits = [
            [c.convention, f"{c.dip_deg:.2f}", f"{c.scatter_deg:.3f}", f"{c.share_down:.0%}"] for c in seen.candidates
        ]
        output.table("how each convention of axes fits", header, fits)
    for command, lacking in seen.uses.items():
        output.print_line(f"{command}: {lacking or 'accepted'}")


def list_(
    what: Literal["plans", "limits", "tool-codes", "profiles", "formats", "columns", "conventions", "findings"], /
) -> None:
    """Names that other commands take.

    Parameters
    ----------
    what
        plans, limits of a verification, tool codes, profiles of files, formats, columns of tables, axes conventions,
        codes of findings.
    """
    for name, about in _listed(what):
        output.print_line(f"{name:32} {about}".rstrip())


def _listed(what: str) -> list[tuple[str, str]]:
    if what == "profiles":
        from inclinometry.files.profile import read_profile, shipped

        return [(name, read_profile(name).title) for name in shipped()]
    if what == "plans":
        from inclinometry.workflow.simulate import PLANS

        rows = [(name, f"{len(make().azimuth)} positions") for name, make in PLANS.items()]
        return [*rows, ("optimal", "designed for a stand: see `inclinometry plan --help`")]
    if what == "limits":
        from inclinometry.files.limits import limit_names

        places = {
            "limits": "of a verification",
            "quality_limits": "of gravity, field and dip",
            "repeat_limits": "of repeats",
        }
        return [(name, about) for folder, about in places.items() for name in limit_names(folder)]
    if what == "tool-codes":
        from inclinometry.files.tool_code_json import tool_code_names

        return [(name, "") for name in tool_code_names()]
    if what == "formats":
        from inclinometry.workflow.convert import FORMATS

        rows = [
            (name, ", ".join([*form.endings, *([] if form.read else ["written only"])]))
            for name, form in FORMATS.items()
        ]
        return [*rows, ("read only", ".gz, .h5, .hdf5, .npz, .mat, .json as tables of columns")]
    if what == "findings":
        from inclinometry.findings import codes, example, say
        from inclinometry.language import current_language

        return [(code, say(example(code), current_language())) for code, one in codes().items() if one.means]
    if what == "conventions":
        from inclinometry.conventions import CONVENTIONS

        return [(c.name, "specific force" if c.specific_force else "gravity") for c in CONVENTIONS]
    from inclinometry.files._quantities import quantities
    from inclinometry.files.columns import KNOWN, UNIT_LABELS

    rows = [(name, "") for name in sorted(KNOWN)]
    rows += [
        (f"{kind}_x, {kind}_1 .. {kind}_m", f"and with a unit: {', '.join(UNIT_LABELS)}")
        for kind in ("accel", "mag", "gyro")
    ]
    return [*rows, *((q.column, f"of a survey; LAS {q.las}") for q in quantities().values() if q.column not in KNOWN)]

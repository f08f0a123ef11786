"""The manual, as it was built into the package."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inclinometry.cli import output
from inclinometry.cli.options import OUTPUT, Flag, Json
from inclinometry.errors import FileError
from inclinometry.findings import Finding


def manual(*, where: Annotated[Flag, Parameter(group=OUTPUT)] = False, json: Json = False) -> None:
    """Open the manual in the browser.

    Parameters
    ----------
    where
        Print the path of its first page instead.
    """
    page = Path(str(files("inclinometry"))) / "manual" / "index.html"
    if not page.is_file():
        raise FileError(Finding("option-manual"), path=page.parent)
    if json:
        output.print_json({"manual": page})
        return
    output.print_line(str(page))
    if not where:
        import webbrowser

        webbrowser.open(page.as_uri())

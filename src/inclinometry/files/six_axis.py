"""Survey tables as CSV: six-axis stations, or angles alone, with the unit of every column in its name."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.conventions import Convention, named
from inclinometry.errors import FileError, InputError
from inclinometry.files import writing
from inclinometry.files._quantities import is_number, meaning
from inclinometry.files.columns import SURVEY
from inclinometry.files.exchange import KINDS, VECTORS, Sheet, SurveyFile, survey_of
from inclinometry.files.exchange import _to_native as turned
from inclinometry.files.survey_csv import column_texts, columns_of
from inclinometry.files.table import Progress, read_table

# From tool axes to those of a file, for the writers; the reverse is done where columns are read.

CORRECTED: Final = {"g": ("gx", "gy", "gz"), "b": ("bx", "by", "bz")}
"""Corrections that are vectors: field -> their names in `SurveyFile.corrections`."""


def to_vendor(file: SurveyFile, convention: str) -> SurveyFile:
    """The survey with its vectors, and their corrections, in a vendor's axes and signs.

    Raises
    ------
    InputError
        There is no convention of that name.

    Examples
    --------
    >>> to_vendor(SurveyFile(md=[9.0], g=[[1.0, 2.0, 9.0]]), "iscwsa").g
    array([[-2.,  1.,  9.]])
    """
    vendor = named(convention)
    # the matrix is orthogonal: its transpose leads back
    parts: dict[str, Any] = {
        name: turned(getattr(file, name), vendor.matrix(KINDS[name]).T)
        for name in VECTORS
        if getattr(file, name) is not None
    }
    return replace(file, corrections=corrections_back(file.corrections, vendor), **parts)


def corrections_back(corrections: Mapping[str, Array], vendor: Convention) -> dict[str, Array]:
    """Corrections in the vendor's axes from those in tool axes."""
    return _corrections(corrections, {field: vendor.matrix(KINDS[field]).T for field in CORRECTED})


def corrections_to_native(corrections: Mapping[str, Array], vendor: Convention) -> dict[str, Array]:
    """Corrections in tool axes from those in the vendor's."""
    return _corrections(corrections, {field: vendor.matrix(KINDS[field]) for field in CORRECTED})


def _corrections(corrections: Mapping[str, Array], matrices: Mapping[str, Array]) -> dict[str, Array]:
    found = dict(corrections)
    for field, names in CORRECTED.items():
        given = [corrections[name] for name in names if name in corrections]
        if given:
            absent = np.zeros(given[0].shape)  # one that is not stated is no correction
            vector = np.stack([corrections.get(name, absent) for name in names], axis=1)
            for name, values in zip(names, turned(vector, matrices[field]).T, strict=True):
                if name in found or np.nan_to_num(values).any():
                    found[name] = values
    return found


class _AllButDepth(frozenset[str]):
    """The columns whose cells may be empty."""

    def __contains__(self, name: object) -> bool:
        try:
            what = meaning(str(name))
        except InputError:
            return True
        return what is None or what.key != "md"


def read_csv(
    path: str | Path,
    *,
    convention: str = "native",
    azimuth_reference: str | None = None,
    progress: Progress | None = None,
) -> SurveyFile:
    """Read a survey from a CSV file by the names of its columns.

    Parameters
    ----------
    path : str or Path
        CSV as `table.read_table` understands it, e.g. `md_m, gx_m_s2, gy_m_s2, gz_m_s2, bx_nT, by_nT, bz_nT`, or `MD
        (ft), Inc (deg), Azi (deg), GX(g), ...`, or the survey file of `survey_csv`; survey_columns.toml lists the
        names. Cells besides the depth may be empty. Columns that are not known become `extra`.
    convention : str
        Axes and signs of the sensors in the file: native, iscwsa, specific-force or z-up.
    azimuth_reference : {"magnetic", "true", "grid"}, optional
        Where the file has no column `azimuth_reference` and no azimuth that says it in its name.
    progress : callable, optional
        Called with the number of bytes read so far.

    Raises
    ------
    FileError
        As `table.read_table`, with the line; no depth, a unit missing or unknown, two columns for one quantity, an
        incomplete triad, a value out of range, depths that do not increase, azimuths without their north.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("MD (ft);Incl [deg];Op\\n100;1,5;me\\n200;3;me\\n")
    ...     survey = read_csv(Path(folder, "a.csv"))
    >>> survey.md, np.degrees(survey.inclination), survey.extra["Op"]
    (array([30.48, 60.96]), array([1.5, 3. ]), ('me', 'me'))
    """
    table = read_table(path, progress, numeric=is_number, gaps=_AllButDepth())
    sheet = Sheet(table.path, table.columns, table.lines, header_row=table.header_line, digest=table.digest)
    return survey_of(sheet, convention=convention, azimuth_reference=azimuth_reference)


def read_six_axis(
    path: str | Path,
    *,
    convention: str = "native",
    azimuth_reference: str | None = None,
    progress: Progress | None = None,
) -> SurveyFile:
    """Read stations of which gravity and magnetic field are there, all six axes at every depth; else as `read_csv`.

    Raises
    ------
    FileError
        As `read_csv`; no gravity, no magnetic field, an empty cell in one of the six columns.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("Depth(m),Gx(g),Gy(g),Gz(g),Mx(uT),My(uT),Mz(uT)\\n9,0,0,1,20,0,45\\n")
    ...     six = read_six_axis(Path(folder, "a.csv"), convention="native")
    >>> six.g, six.b
    (array([[0.     , 0.     , 9.80665]]), array([[20000.,     0., 45000.]]))
    """
    found = read_csv(path, convention=convention, azimuth_reference=azimuth_reference, progress=progress)
    for field, columns in (("g", "gx_m_s2, gy_m_s2, gz_m_s2"), ("b", "bx_nT, by_nT, bz_nT")):
        values = getattr(found, field)
        if values is None:
            raise FileError(f"no six axes; columns {columns}, or others with their units, are needed", path=path)
        empty = np.isnan(values).any(axis=1)
        if empty.any():
            depth = found.md[int(np.argmax(empty))]
            raise FileError(f"one of {columns} is empty at {depth:.12g} m; fill it in or remove the row", path=path)
    return found


def write_excel_csv(file: SurveyFile, path: str | Path) -> None:
    """The same as a spreadsheet set to a decimal comma opens it: semicolons, commas, a byte-order mark.

    Raises
    ------
    InputError
        A line break in a text.
    """
    names, columns = _cells(file)
    numbers = {column.name for column in columns_of(file) if not isinstance(column.values, tuple)} | {"g_total"}
    text = io.StringIO()
    writer = csv.writer(text, delimiter=";", lineterminator="\r\n")
    writer.writerow(names)
    commas = ([c.replace(".", ",") for c in cells] if name in numbers else cells
              for name, cells in zip(names, columns, strict=True))  # fmt: skip
    writer.writerows(zip(*commas, strict=True))
    writing.write_bytes(text.getvalue().encode("utf-8-sig"), path)


def write_csv(file: SurveyFile, path: str | Path, *, comment: str | None = None) -> None:
    """Write a survey as CSV; one with inclinations has all columns of the survey file (`survey_csv`) first.

    The header texts of `file` are not written: CSV has no place for them. Lines of `comment` stand above the names,
    after `#`, which readers skip.

    Raises
    ------
    InputError
        A line break in a text.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_csv(SurveyFile(md=[0, 30], tvd=[0, 29.5]), Path(folder, "a.csv"))
    ...     Path(folder, "a.csv").read_text()
    'md_m,tvd_m\\n0,0\\n30,29.5\\n'
    """
    names, columns = _cells(file)
    writing.write_columns(names, columns, path, comment.splitlines() if comment else ())


def _cells(file: SurveyFile) -> tuple[list[str], list[Sequence[str]]]:
    cells: dict[str, Sequence[str]] = {}
    for column in columns_of(file):
        cells[column.name] = column_texts(column)
    if file.inclination is not None:
        # the contract of the survey file names this one without its unit
        total = {"g_total_m_s2": "g_total"}
        cells = {total.get(name, name): texts for name, texts in cells.items()}
        empty = ("",) * len(file)
        cells = {name: cells.get(name, empty) for name in SURVEY} | cells
    return list(cells), list(cells.values())

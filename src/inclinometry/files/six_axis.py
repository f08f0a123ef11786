"""Survey tables as CSV: six-axis stations, or angles alone, with the unit of every column in its name."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from inclinometry.errors import FileError
from inclinometry.files import writing
from inclinometry.files._quantities import is_depth, is_number
from inclinometry.files.columns import SURVEY
from inclinometry.files.excel import sheet_blocks
from inclinometry.files.foreign import Read
from inclinometry.files.frame import Column
from inclinometry.files.las import las_frame
from inclinometry.files.parquet import parquet_pieces
from inclinometry.files.survey_file import SurveyFile, columns_of, survey_of
from inclinometry.files.table import TableFile
from inclinometry.files.text import Progress
from inclinometry.findings import Finding


def read_survey(
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
    ...     survey = read_survey(Path(folder, "a.csv"))
    >>> survey.md, np.degrees(survey.inclination), survey.extra["Op"]
    (array([30.48, 60.96]), array([1.5, 3. ]), ('me', 'me'))
    """
    return _survey(path, convention, azimuth_reference, progress=progress)


def _survey(
    path: str | Path,
    convention: str,
    azimuth_reference: str | None,
    read: Read | None = None,
    progress: Progress | None = None,
) -> SurveyFile:
    opened = TableFile(path, progress, read=read, north=azimuth_reference)
    gaps = [name for name in opened.take(is_number) if not is_depth(name)]
    frame = opened.read(is_number, gaps)
    return survey_of(frame, convention=convention, azimuth_reference=azimuth_reference)


def read_excel(
    path: str | Path, *, sheet: str | None = None, convention: str = "native", azimuth_reference: str | None = None
) -> SurveyFile:
    """Read a survey from a sheet (the first by default) of an .xlsx workbook; columns as for `read_survey`.

    A formula that was never calculated has no value and is refused.
    """
    return _survey(path, convention, azimuth_reference, lambda where: sheet_blocks(where, sheet))


def read_parquet(path: str | Path, *, convention: str = "native", azimuth_reference: str | None = None) -> SurveyFile:
    """Read a survey from a Parquet file; columns as for `read_survey`, units in their names or metadata."""
    return _survey(path, convention, azimuth_reference, parquet_pieces)


def read_las(path: str | Path, *, convention: str = "native", azimuth_reference: str | None = None) -> SurveyFile:
    """Read a survey from LAS 1.2 or 2.0; mnemonics as the names of columns of `read_survey`.

    The file's own NULL is unknown. `azimuth_reference` is for a file without the parameter AZIREF.
    """
    return _survey(path, convention, azimuth_reference, lambda where: iter([las_frame(where)]))


def read_six_axis(
    path: str | Path,
    *,
    convention: str = "native",
    azimuth_reference: str | None = None,
    progress: Progress | None = None,
) -> SurveyFile:
    """Read stations of which gravity and magnetic field are there, all six axes at every depth; else as `read_survey`.

    Raises
    ------
    FileError
        As `read_survey`; no gravity, no magnetic field, an empty cell in one of the six columns.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("Depth(m),Gx(g),Gy(g),Gz(g),Mx(uT),My(uT),Mz(uT)\\n9,0,0,1,20,0,45\\n")
    ...     six = read_six_axis(Path(folder, "a.csv"), convention="native")
    >>> six.g, six.b
    (array([[0.     , 0.     , 9.80665]]), array([[20000.,     0., 45000.]]))
    """
    found = read_survey(path, convention=convention, azimuth_reference=azimuth_reference, progress=progress)
    for field, columns in (("g", ("gx_m_s2", "gy_m_s2", "gz_m_s2")), ("b", ("bx_nT", "by_nT", "bz_nT"))):
        values = getattr(found, field)
        if values is None:
            raise FileError(Finding("input-missing", {"names": columns}), path=path)
        empty = np.argwhere(np.isnan(values))
        if empty.size:
            row, column = empty[0].tolist()
            raise FileError(Finding("input-empty", {"name": columns[column]}), path=path, row=row + 1)
    return found


def write_excel_csv(file: SurveyFile, path: str | Path) -> None:
    """The same as a spreadsheet set to a decimal comma opens it: semicolons, commas, a byte-order mark.

    Raises
    ------
    InputError
        A line break in a text.
    """
    columns = _cells(file)
    text = io.StringIO()
    writer = csv.writer(text, delimiter=";", lineterminator="\r\n")
    writer.writerow(columns)
    commas = (
        v if isinstance(v, tuple) else [cell.replace(".", ",") for cell in writing.column(v)] for v in columns.values()
    )
    writer.writerows(zip(*commas, strict=True))
    writing.write_bytes(text.getvalue().encode("utf-8-sig"), path)


def write_csv(file: SurveyFile, path: str | Path, *, comment: str | None = None) -> None:
    """Write a survey as CSV; one with inclinations has all columns of the survey file (`survey_csv`) first.

    The header texts of `file` are not written: CSV has no place for them. Lines of `comment` stand above the names,
    after `#`, which readers skip.
    """
    writing.write_columns(_cells(file), path, comment.splitlines() if comment else ())


def _cells(file: SurveyFile) -> dict[str, Column]:
    cells = columns_of(file)
    if file.inclination is not None:
        # the contract of the survey file names this one without its unit
        cells = {"g_total" if name == "g_total_m_s2" else name: values for name, values in cells.items()}
        empty = ("",) * len(file)
        cells = {name: cells.get(name, empty) for name in SURVEY} | cells
    return cells

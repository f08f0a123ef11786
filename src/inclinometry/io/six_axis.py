"""Survey tables as CSV: six-axis stations, or angles alone, with the unit of every column in its name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from inclinometry.core.errors import FileError, InputError
from inclinometry.io import _write
from inclinometry.io._columns_out import column_texts, columns_of
from inclinometry.io._lines import Progress
from inclinometry.io._quantities import is_number, meaning
from inclinometry.io._sheet import Sheet, survey_of
from inclinometry.io.columns import SURVEY
from inclinometry.io.exchange import SurveyFile
from inclinometry.io.table import read_table


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
    convention: str = "house",
    azimuth_reference: str | None = None,
    progress: Progress | None = None,
) -> SurveyFile:
    """Read a survey from a CSV file by the names of its columns.

    Parameters
    ----------
    path : str or Path
        CSV as `table.read_table` understands it, e.g. `md_m, gx_m_s2, gy_m_s2, gz_m_s2, bx_nT, by_nT, bz_nT`, or `MD
        (ft), Inc (deg), Azi (deg), GX(g), ...`, or the survey file of `survey_csv`; survey_columns.toml lists the
        names. Cells besides the depth may be empty. Columns the house does not know become `extra`.
    convention : str
        Axes and signs of the sensors in the file: house, iscwsa, specific-force or z-up.
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
    convention: str = "house",
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
    ...     six = read_six_axis(Path(folder, "a.csv"), convention="house")
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


def write_csv(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as CSV; one with inclinations has all columns of the survey file (`survey_csv`) first.

    The header texts of `file` are not written: CSV has no place for them.

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
    cells: dict[str, Sequence[str]] = {}
    for column in columns_of(file):
        cells[column.name] = column_texts(column)
    if file.inclination is not None:
        # the contract of the survey file names this one without its unit
        total = {"g_total_m_s2": "g_total"}
        cells = {total.get(name, name): texts for name, texts in cells.items()}
        empty = ("",) * len(file)
        cells = {name: cells.get(name, empty) for name in SURVEY} | cells
    _write.write_columns(list(cells), list(cells.values()), path)

"""Raw survey stations in, survey stations out; the columns of both are contracts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, frozen
from inclinometry.errors import out_of_order, refused, wrong_shape
from inclinometry.files import writing
from inclinometry.files.columns import RAW_SURVEY, SERIALS, SURVEY, SURVEY_QUANTITIES, numbers_among
from inclinometry.files.frame import Frame
from inclinometry.files.signals import read_serial, read_signals, read_temperature
from inclinometry.files.table import TableFile, read_table
from inclinometry.files.text import Progress
from inclinometry.findings import Finding, Value
from inclinometry.tabular import Column, Tabular, channel_columns


@dataclass(frozen=True, eq=False, repr=False)
class RawSurvey(Tabular):
    """Raw stations of one run, in the order of depth.

    md : (n,) m, strictly increasing. channels : kind -> (n, m) in `units`. temperature : (n,) degC, or None.
    extra : other columns of the file, as text. findings : of the reader.
    lines : (n,) line of the file of each station. digest : SHA-256 of the file. serial : of the tool, "" unknown.
    """

    md: Array
    channels: Mapping[str, Array]
    temperature: Array | None
    units: Mapping[str, str]
    extra: Mapping[str, tuple[str, ...]]
    findings: tuple[Finding, ...]
    lines: NDArray[np.int64]
    digest: str
    serial: str = ""

    def __len__(self) -> int:
        return len(self.md)

    def to_dict(self) -> dict[str, Column]:
        """One row a station: depth, channels and temperature, under the names they have in a file."""
        found: dict[str, Column] = {"md_m": self.md, **channel_columns(self.channels, self.units)}
        return found | ({} if self.temperature is None else {"temperature_degC": self.temperature})


def read_raw_survey(path: str | Path | TableFile, *, progress: Progress | None = None) -> RawSurvey:
    """Read raw stations: `md_m` (or `md_ft`), the channels as in bench readings, `temperature_degC`, anything else.

    A table whose names have been looked at may be given as it is, open.

    Raises
    ------
    FileError
        As `table.read_table`; no channels; depths that do not increase, naming both lines.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "raw.csv").write_text("md_ft,accel_x,accel_y\\n100,1,2\\n200,3,4\\n")
    ...     raw = read_raw_survey(Path(folder, "raw.csv"))
    >>> raw.md, raw.channels["accelerometer"][0]
    (array([30.48, 60.96]), array([1., 2.]))
    """
    opened = path if isinstance(path, TableFile) else TableFile(path, progress)
    table = opened.read(numbers_among(RAW_SURVEY))
    table.unknown((*RAW_SURVEY, *SERIALS))
    table = table.downwards(table.depth()[0])
    name, md = table.depth()
    check_increasing(table, name, table.number(name))
    signals = read_signals(table)
    temperature = read_temperature(table)
    return RawSurvey(
        md,
        MappingProxyType({kind: frozen(values) for kind, values in signals.values.items()}),
        temperature,
        MappingProxyType(signals.units),
        MappingProxyType({name: cells for name, cells in table.columns.items() if isinstance(cells, tuple)}),
        signals.findings,
        table.lines,
        table.digest,
        read_serial(table),
    )


def check_increasing(table: Frame, name: str, values: Array) -> None:
    """FileError naming both lines where a column does not strictly increase."""
    back = np.flatnonzero(np.diff(values) <= 0.0)
    if back.size:
        row = int(back[0]) + 1
        raise table.error(falls(name, values, row - 1, row), row)


def falls(name: str, values: Array, before: int, row: int) -> Finding:
    """The refusal of a value, in a row, that turns back or repeats the one of a row before."""
    return out_of_order(name, float(values[row]), float(values[before]), int(row) + 1).finding


def differs(table: Frame, name: str, value: Value, other: Value, before: int, station: str | None = None) -> Finding:
    """The refusal of a value other than that in a row before, of the same station or of all."""
    facts: dict[str, Value] = {"name": name, "value": value, "other": other, "line": int(table.lines[before])}
    if station is None:
        return Finding("readings-constant-differs", facts)
    return Finding("readings-station-differs", {"station": station, **facts})


def write_survey_csv(path: str | Path, columns: Mapping[str, ArrayLike | Sequence[str] | str]) -> None:
    """Write survey stations; the names, units and order of the columns are fixed.

    `md` (m) is required; angles, `dip` and `u_inclination`, `u_azimuth`, `u_toolface` in rad, `g_total` in m/s^2,
    `b_total` in nT; `azimuth_reference` and `flags` are one text or one a station. What is missing, and NaN, becomes an
    empty cell.
    """
    writing.write_columns(survey_cells(columns), path)


def survey_cells(
    columns: Mapping[str, ArrayLike | Sequence[str] | str],
) -> dict[str, Array | Sequence[str] | None]:
    """The columns of a survey file; parameters and errors as `write_survey_csv`."""
    unknown = sorted(set(columns) - set(SURVEY_QUANTITIES))
    if unknown or "md" not in columns:
        if unknown:
            raise refused("input-unknown", {"names": tuple(unknown), "known": tuple(SURVEY_QUANTITIES)})
        raise refused("input-missing", {"names": ("md",)})
    size = int(np.size(np.asarray(columns["md"], dtype=np.float64)))
    return {column: _cells(name, column, columns.get(name), size) for name, column in SURVEY_QUANTITIES.items()}


def _cells(name: str, column: str, value: ArrayLike | Sequence[str] | str | None, size: int) -> Array | Sequence[str]:
    found: Array | Sequence[str]
    if value is None:
        return [""] * size
    if name in ("azimuth_reference", "flags"):
        found = [value] * size if isinstance(value, str) else [str(v) for v in np.atleast_1d(np.asarray(value))]
    else:
        found = np.asarray(value, dtype=np.float64).ravel()
        if np.isinf(found).any():
            raise refused("input-finite", {"name": name})
        if column.endswith("_deg"):
            found = writing.degrees(found)
        if name in ("azimuth", "toolface", "magnetic_toolface"):
            found = np.where(found == 360.0, 0.0, found)  # 360 - 1e-12 rounds up to what is printed as 0
    if len(found) != size:
        raise wrong_shape(name, (len(found),), f"({size},)")
    return found


def read_survey_csv(path: str | Path) -> dict[str, Array | tuple[str, ...]]:
    """Read a survey file back into the mapping that `write_survey_csv` takes; empty cells are NaN.

    Raises
    ------
    FileError
        As `table.read_table`; a column of the contract is missing; depths that do not increase.
    """
    table = read_table(path, gaps=[*(name for name in SURVEY if name != "md_m"), "temperature_degC"])
    table.require(SURVEY)
    check_increasing(table, "md_m", table.number("md_m"))
    found: dict[str, Array | tuple[str, ...]] = {}
    for name, column in SURVEY_QUANTITIES.items():
        values = table.columns[column]
        found[name] = (
            frozen(np.radians(values)) if column.endswith("_deg") and not isinstance(values, tuple) else values
        )
    return found

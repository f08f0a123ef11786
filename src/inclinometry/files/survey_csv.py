"""Raw survey stations in, survey stations out; the columns of both are contracts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, frozen
from inclinometry.constants import FOOT
from inclinometry.errors import InputError
from inclinometry.files import writing
from inclinometry.files._quantities import EXTRA, Quantity, from_si, meaning, quantities
from inclinometry.files.columns import RAW_SURVEY, SURVEY, numbers_among
from inclinometry.files.exchange import SurveyFile
from inclinometry.files.signals import read_signals, read_temperature
from inclinometry.files.table import Progress, Table, read_table
from inclinometry.tabular import Column, Tabular, channel_columns

# From a survey to the columns of a table: names with units, numbers in them, texts; what is unknown is left out.


@dataclass(frozen=True, eq=False)
class OutColumn:
    """One column: numbers with their quantity, or texts."""

    name: str
    values: Array | tuple[str, ...]
    quantity: Quantity | None = None


def columns_of(file: SurveyFile) -> list[OutColumn]:
    """All that a survey knows, as columns; a quantity without a single value has none.

    Examples
    --------
    >>> [c.name for c in columns_of(SurveyFile(md=[0, 30], g=[[0, 0, 9.8]] * 2, extra={"rig": ("A", "A")}))]
    ['md_m', 'gx_m_s2', 'gy_m_s2', 'gz_m_s2', 'rig']
    """
    found = []
    for key, quantity in quantities().items():
        # the values of one quantity; None where the file is silent. A triad or covariance is there whole or not at all
        group, _, place = key.partition(".")
        value = getattr(file, group)
        if isinstance(value, Mapping):
            value = value.get(place)
        if value is None or np.isnan(value).all():
            values = None
        elif value.ndim == 1:
            values = np.asarray(value)
        else:
            values = np.asarray(value[(slice(None), *map(int, place))])
        if values is not None:
            found.append(OutColumn(quantity.column, from_si(values, quantity), quantity))
        if key == "azimuth" and file.azimuth_reference is not None:
            found.append(OutColumn("azimuth_reference", (file.azimuth_reference,) * len(file)))
    return found + _texts(file)


def _texts(file: SurveyFile) -> list[OutColumn]:
    found = []
    for name in ("used", "valid"):
        mask = getattr(file, name)
        if mask is not None:
            found.append(OutColumn(name, tuple("1" if yes else "0" for yes in mask)))
    if file.times is not None and any(file.times):
        found.append(OutColumn("time", tuple(file.times)))
    return found + [OutColumn(_extra_name(name), tuple(cells)) for name, cells in file.extra.items()]


def _extra_name(name: str) -> str:
    """A name under which the column is not taken for one of the package's when it is read."""
    try:
        taken = meaning(name) is not None or name.startswith(EXTRA)
    except InputError:
        taken = True
    return f"{EXTRA}{name}" if taken else name


def column_texts(column: OutColumn) -> Sequence[str]:
    """Numbers as the shortest text that reads back the same, texts as they are."""
    return column.values if isinstance(column.values, tuple) else writing.column(column.values)


_QUANTITIES = {
    "md": "md_m",
    "inclination": "inclination_deg",
    "azimuth": "azimuth_deg",
    "azimuth_reference": "azimuth_reference",
    "toolface": "toolface_deg",
    "magnetic_toolface": "magnetic_toolface_deg",
    "g_total": "g_total",
    "b_total": "b_total_nT",
    "dip": "dip_deg",
    "u_inclination": "u_inclination_deg",
    "u_azimuth": "u_azimuth_deg",
    "u_toolface": "u_toolface_deg",
    "flags": "flags",
}
"""Name inside the package (SI, rad, nT) -> column of the file."""


@dataclass(frozen=True, eq=False, repr=False)
class RawSurvey(Tabular):
    """Raw stations of one run, in the order of depth.

    md : (n,) measured depth, m, strictly increasing.
    channels : kind -> (n, m) signals.
    temperature : (n,) degC, or None.
    units : kind -> unit of the signals.
    extra : other columns of the file, as text.
    notes : findings of the reader.
    lines : (n,) line of the file each station stands in.
    digest : SHA-256 of the file.
    """

    md: Array
    channels: Mapping[str, Array]
    temperature: Array | None
    units: Mapping[str, str]
    extra: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...]
    lines: NDArray[np.int64]
    digest: str

    def __len__(self) -> int:
        return len(self.md)

    def to_dict(self) -> dict[str, Column]:
        """One row a station: depth, channels and temperature, under the names they have in a file."""
        found: dict[str, Column] = {"md_m": self.md, **channel_columns(self.channels, self.units)}
        return found | ({} if self.temperature is None else {"temperature_degC": self.temperature})


def read_raw_survey(path: str | Path, *, progress: Progress | None = None) -> RawSurvey:
    """Read raw stations: `md_m` (or `md_ft`), the channels as in bench readings, `temperature_degC`, anything else.

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
    table = read_table(path, progress, numeric=numbers_among(RAW_SURVEY))
    table.unknown(RAW_SURVEY)
    if "md_m" in table and "md_ft" in table:
        raise table.error("both 'md_m' and 'md_ft' give the depth; remove one")
    name = "md_ft" if "md_ft" in table else "md_m"
    values = table.number(name)
    check_increasing(table, name, values)
    md, signals = frozen(values * FOOT) if name == "md_ft" else values, read_signals(table)
    temperature = read_temperature(table)
    return RawSurvey(
        md,
        MappingProxyType({kind: frozen(values) for kind, values in signals.values.items()}),
        temperature,
        MappingProxyType(signals.units),
        MappingProxyType({name: cells for name, cells in table.columns.items() if isinstance(cells, tuple)}),
        signals.notes,
        table.lines,
        table.digest,
    )


def check_increasing(table: Table, name: str, values: Array) -> None:
    """FileError naming both lines where a column does not strictly increase."""
    back = np.flatnonzero(np.diff(values) <= 0.0)
    if back.size:
        row = int(back[0]) + 1
        how = "repeats" if values[row] == values[row - 1] else "is less than"
        before = f"{values[row - 1]:.12g} in line {table.lines[row - 1]}"
        problem = f"{name} {values[row]:.12g} {how} {before}; it must increase from row to row"
        raise table.error(f"{problem}: sort the rows and keep one of each", row)


def write_survey_csv(path: str | Path, columns: Mapping[str, ArrayLike | Sequence[str] | str]) -> None:
    """Write survey stations; the names, units and order of the columns are fixed.

    Parameters
    ----------
    path : str or Path
    columns : mapping
        `md` (n,) m; `inclination`, `azimuth`, `toolface`, `magnetic_toolface`, `dip` and the standard uncertainties
        `u_inclination`, `u_azimuth`, `u_toolface`, rad; `g_total`, m/s^2; `b_total`, nT; `azimuth_reference` and
        `flags`, one text or one a station. What is missing, and NaN, becomes an empty cell; `md` is required.

    Raises
    ------
    InputError
        An unknown name, a column of another length, infinity.
    """
    names, cells = survey_cells(columns)
    writing.write_columns(names, cells, path)


def survey_cells(
    columns: Mapping[str, ArrayLike | Sequence[str] | str],
) -> tuple[tuple[str, ...], list[list[str]]]:
    """Names and cells of the columns of a survey file; parameters and errors as `write_survey_csv`."""
    unknown = sorted(set(columns) - set(_QUANTITIES))
    if unknown or "md" not in columns:
        problem = f"unknown survey columns {unknown}" if unknown else "no column 'md'"
        raise InputError(f"{problem}; allowed: {', '.join(_QUANTITIES)}")
    size = int(np.size(np.asarray(columns["md"], dtype=np.float64)))
    return SURVEY, [_cells(name, column, columns.get(name), size) for name, column in _QUANTITIES.items()]


def _cells(name: str, column: str, value: ArrayLike | Sequence[str] | str | None, size: int) -> list[str]:
    if value is None:
        return [""] * size
    if name in ("azimuth_reference", "flags"):
        texts = [value] * size if isinstance(value, str) else [str(v) for v in np.atleast_1d(np.asarray(value))]
    else:
        numbers = np.asarray(value, dtype=np.float64).ravel()
        if np.isinf(numbers).any():
            raise InputError(f"{name} is infinite at station {int(np.isinf(numbers).argmax())}; use NaN for unknown")
        if column.endswith("_deg"):
            numbers = writing.degrees(numbers)
        if name in ("azimuth", "toolface", "magnetic_toolface"):
            numbers = np.where(numbers == 360.0, 0.0, numbers)  # 360 - 1e-12 rounds up to what is printed as 0
        texts = writing.column(numbers)
    if len(texts) != size:
        raise InputError(f"{name} has {len(texts)} values; md has {size}")
    return texts


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
    for name, column in _QUANTITIES.items():
        values = table.columns[column]
        found[name] = (
            frozen(np.radians(values)) if column.endswith("_deg") and not isinstance(values, tuple) else values
        )
    return found

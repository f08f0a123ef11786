"""Steps of a rate table: `station, inclination_deg, toolface_deg[, azimuth_deg], rate_deg_s, gyro_x, ..`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Index, frozen
from inclinometry.constants import FOOT, KINDS
from inclinometry.files import writing
from inclinometry.files.columns import GYRO_RUN, KIND_PREFIX, PARTS, UNIT_LABELS, channel, numbers_among
from inclinometry.files.signals import Signals, read_kind, read_signals, read_temperature
from inclinometry.files.survey_csv import survey_cells
from inclinometry.files.table import Progress, Table, read_table
from inclinometry.tabular import Column, Tabular, channel_columns, in_degrees

# Gyro runs: readings at index positions in, stations with scale factor out.

CORRECTED = ("gyro_x_corrected_deg_h", "gyro_y_corrected_deg_h", "gyro_z_corrected_deg_h")
STATION = ("scale", "u_scale", "root", "K", "temperature_degC", *CORRECTED)
"""Columns of a station file beyond those of the survey file."""


@dataclass(frozen=True, eq=False, repr=False)
class GyroReadings(Tabular):
    """Readings of one run in the order they were taken; n stations of several index positions, K readings.

    station : (K,) number of the station, from 0, of each reading.
    labels : (n,) what the file calls the stations.
    md : (n,) m; all different, increasing or decreasing.
    index : (K,) rad.
    channels : kind -> (K, m) signals.
    letters : kind -> axes of the channels, e.g. "xy"; "" where they are numbered.
    sd : kind -> (K, m) standard deviations, where the file has them.
    units : kind -> unit.
    temperature, time : (K,) degC, s, or None.
    notes, lines, digest : as elsewhere.
    """

    station: Index
    labels: tuple[str, ...]
    md: Array
    index: Array
    channels: Mapping[str, Array]
    letters: Mapping[str, str]
    sd: Mapping[str, Array]
    units: Mapping[str, str]
    temperature: Array | None
    time: Array | None
    notes: tuple[str, ...]
    lines: NDArray[np.int64]
    path: Path
    digest: str

    def __len__(self) -> int:
        return len(self.labels)

    def mean(self, values: Array) -> Array:
        """Mean (n,) over the readings of each station."""
        return np.asarray(np.bincount(self.station, values) / np.bincount(self.station))

    def to_dict(self) -> dict[str, Column]:
        """One row a reading: station, depth, index position and channels, under the names they have in a file."""
        found: dict[str, Column] = {"station": [self.labels[place] for place in self.station]}
        found |= {"md_m": self.md[self.station], **in_degrees(self, "index")}
        for name, values in (("temperature_degC", self.temperature), ("time_s", self.time)):
            found |= {} if values is None else {name: values}
        return found | channel_columns(self.channels, self.units)


def read_gyro_run(path: str | Path, *, progress: Progress | None = None) -> GyroReadings:
    """Read `station, md_m, index_deg, temperature_degC, time_s`, `accel_x, accel_y[, accel_z]`, `gyro_x_deg_h ...`.

    One row is one reading at one index position; the rows of a station stand together. `temperature_degC` and `time_s`
    may be absent; one gyro (x) is enough where the index gives y.

    Raises
    ------
    FileError
        As `table.read_table`; a station in two places or at two depths; depths that repeat or change direction; an
        index that looks like radians.

    Examples
    --------
    >>> import tempfile
    >>> rows = "station,md_m,index_deg,accel_x,gyro_x_deg_h\\n1,10,0,-5,9\\n1,10,180,5,-8\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "raw.csv").write_text(rows)
    ...     run = read_gyro_run(Path(folder, "raw.csv"))
    >>> len(run), run.letters["gyro"], run.units["gyro"]
    (1, 'x', 'deg/h')
    """
    table = read_table(path, progress, numeric=numbers_among(GYRO_RUN), timed=True)
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(GYRO_RUN)]
    station, labels = _stations(table)
    md = _depths(table, station)
    unused += [f"column {n!r} is not used in a gyro run" for n in table.header if n.startswith("mag_") and channel(n)]
    values: dict[str, Array] = {}
    sd: dict[str, Array] = {}
    units: dict[str, str] = {}
    letters: dict[str, str] = {}
    for kind, prefix in (("accelerometer", "accel"), ("gyro", "gyro")):
        found = read_kind(table, kind)
        if found is None:
            raise table.error(f"no {kind}; add columns {prefix}_x and {prefix}_y")
        values |= found.values
        units |= found.units
        sd |= _positive(table, found)
        axes = "".join(name.split("_")[1] for name in found.names[kind])
        letters[kind] = axes if axes.isalpha() else ""
    return GyroReadings(
        station,
        labels,
        md,
        frozen(np.radians(_index(table))),
        MappingProxyType({kind: frozen(array) for kind, array in values.items()}),
        MappingProxyType(letters),
        MappingProxyType(sd),
        MappingProxyType(units),
        read_temperature(table),
        table.number("time_s") if "time_s" in table else None,
        tuple(unused),
        table.lines,
        table.path,
        table.digest,
    )


def _positive(table: Table, found: Signals) -> dict[str, Array]:
    """Standard deviations of the readings, none of them zero."""
    for kind, sd in found.sd.items():
        if (sd <= 0.0).any():
            row, column = np.argwhere(sd <= 0.0)[0].tolist()
            name = f"{found.names[kind][column]}_sd"
            raise table.error(f"{name} is 0; a reading has some noise: give it, or leave out the column", row)
    return found.sd


def _stations(table: Table) -> tuple[Index, tuple[str, ...]]:
    """Number of the station of each row, and the labels; the rows of a station must stand together."""
    names = table.text("station")
    labels: list[str] = []
    seen: dict[str, int] = {}
    numbers = np.empty(len(names), dtype=np.intp)
    for row, name in enumerate(names):
        if row and name == names[row - 1]:
            numbers[row] = numbers[row - 1]
            continue
        if name in seen:
            first = int(table.lines[seen[name]])
            raise table.error(
                f"station {name!r} was already in line {first}; keep its rows together, one name each", row
            )
        if not name.strip():
            raise table.error("the station has no name; number the stations", row)
        seen[name] = row
        numbers[row] = len(labels)
        labels.append(name)
    return numbers, tuple(labels)


def _depths(table: Table, station: Index) -> Array:
    name = "md_ft" if "md_ft" in table else "md_m"
    values = table.number(name)
    first = np.flatnonzero(np.diff(station, prepend=-1))
    md = values[first]
    off = values != md[station]
    if off.any():
        row = int(np.argmax(off))
        raise table.error(f"{name} {values[row]:g} differs from {md[station[row]]:g} of the same station above it", row)
    steps = np.diff(md)
    wrong = (steps == 0.0) | (np.sign(steps) != np.sign(steps[0] if steps.size else 1.0))
    if wrong.any():
        at = int(np.argmax(wrong)) + 1
        how = "repeats" if steps[at - 1] == 0.0 else "turns back"
        problem = f"{name} {md[at]:.12g} {how} after {md[at - 1]:.12g} in line {table.lines[first[at - 1]]}"
        raise table.error(f"{problem}; a run goes one way: sort the stations and keep one of each", int(first[at]))
    return frozen(md * FOOT) if name == "md_ft" else frozen(md)


def _index(table: Table) -> Array:
    values = table.number("index_deg")
    turns = 36000.0
    if (np.abs(values) > turns).any():
        row = int(np.argmax(np.abs(values) > turns))
        raise table.error(f"index_deg is {values[row]:g}; allowed {-turns:g} to {turns:g} deg", row)
    spread = float(np.ptp(values))
    if 0.0 < spread <= 2.0 * np.pi + 1e-6 and not np.allclose(values, np.round(values), atol=1e-6):
        raise table.error(f"index_deg spans {spread:.4g} only, as radians would; give degrees")
    return values


def write_gyro_stations(path: str | Path, columns: Mapping[str, object]) -> None:
    """Write stations.csv: the columns of the survey file, then those of `STATION`.

    Parameters
    ----------
    path : str or Path
    columns : mapping
        As `survey_csv.write_survey_csv` takes them, and those of `STATION`: `root` is text, all others numbers; those
        of `PARTS` where they are known.
    """
    own = {name: columns[name] for name in STATION}
    names, cells = survey_cells({k: v for k, v in columns.items() if k not in (*STATION, *PARTS)})  # type: ignore[misc]
    size = len(cells[0])
    extra: list[Sequence[str]] = []
    for name in STATION:
        value = own[name]
        if name == "root":
            extra.append([str(v) for v in value])  # type: ignore[attr-defined]
        else:
            numbers = np.full(size, np.nan) if value is None else np.asarray(value, dtype=np.float64)
            extra.append(writing.column(np.where(np.isfinite(numbers), numbers, np.nan)))
    parts = {name: columns[name] for name in PARTS if name in columns}
    extra += [writing.column(np.asarray(value, dtype=np.float64)) for value in parts.values()]
    writing.write_columns([*names, *STATION, *parts], [*cells, *extra], path)


def write_gyro_run(
    path: str | Path,
    *,
    station: Sequence[str],
    md: Array,
    index: Array,
    channels: Mapping[str, Array],
    letters: Mapping[str, str],
    units: Mapping[str, str],
    temperature: Array | None = None,
    time: Array | None = None,
) -> None:
    """Write readings as `read_gyro_run` reads them; arrays have one row a reading, angles in rad."""
    names = ["station", "md_m", "index_deg"]
    cells: list[Sequence[str]] = [list(station), writing.column(md), writing.column(writing.degrees(index))]
    if temperature is not None:
        names.append("temperature_degC")
        cells.append(writing.column(temperature))
    suffixes = {label: f"_{suffix}" for suffix, label in UNIT_LABELS.items() if suffix != "counts"}
    for kind, values in channels.items():
        for axis, column in zip(letters[kind], values.T, strict=True):
            names.append(f"{KIND_PREFIX[kind]}_{axis}{suffixes.get(units[kind], '')}")
            cells.append(writing.column(column))
    if time is not None:
        names.append("time_s")
        cells.append(writing.column(time))
    writing.write_columns(names, cells, path)


FASTEST = 3600.0
"""No table turns a tool faster, deg/s."""
_LIMITS = {"inclination_deg": 180.0, "toolface_deg": 360.0, "azimuth_deg": 360.0, "rate_deg_s": FASTEST}


@dataclass(frozen=True, eq=False)
class RateSteps:
    """Steps of a tool on a rate table, one row a step; angles in rad.

    station : names.
    inclination, toolface : (K,) of the tool as mounted.
    azimuth : (K,) from true north; NaN where it is not given.
    rate : (K,) rad/s, clockwise seen from above.
    signals, sd : (K, m) of the gyros and, where the file has it, the standard deviation of each; else None.
    temperature : (K,) degC, or None.
    unit : of the signals.
    names : of the m columns of the gyros.
    lines : (K,) of the file, from 1.
    notes : findings of the reader.
    path, digest : of the file, SHA-256.
    """

    station: tuple[str, ...]
    inclination: Array
    toolface: Array
    azimuth: Array
    rate: Array
    signals: Array
    sd: Array | None
    temperature: Array | None
    unit: str
    names: tuple[str, ...]
    lines: tuple[int, ...]
    notes: tuple[str, ...]
    path: Path
    digest: str

    def __len__(self) -> int:
        return len(self.rate)

    @property
    def axes(self) -> str | None:
        """ "xyz" or "xy" where the columns are named after the tool's axes; None where they are numbered."""
        letters = "".join(name.split("_")[1] for name in self.names)
        return letters if set(letters) <= set("xyz") else None

    def without(self, rows: Sequence[int]) -> RateSteps:
        """The other steps."""
        kept = np.delete(np.arange(len(self)), list(rows))
        arrays = ("inclination", "toolface", "azimuth", "rate", "signals", "sd", "temperature")
        given = {name: values[kept] for name in arrays if (values := getattr(self, name)) is not None}
        station, lines = tuple(self.station[row] for row in kept), tuple(self.lines[row] for row in kept)
        return replace(self, station=station, lines=lines, **given)


def read_rate_steps(path: str | Path, *, progress: Progress | None = None) -> RateSteps:
    """Read the steps of a rate table.

    Parameters
    ----------
    path : str or Path
        CSV as `table.read_table` understands it. `azimuth_deg` (from true north) is needed, and its cells may be empty,
        but where the table is at rest.

    Raises
    ------
    FileError
        As `table.read_table`; values out of range, rates that look like radians per second, a table at rest without
        azimuth, no gyro.

    Examples
    --------
    >>> import tempfile
    >>> rows = "inclination_deg,toolface_deg,rate_deg_s,gyro_x,gyro_y\\n0,0,10,1,2\\n90,0,-10,3,1\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "steps.csv").write_text(rows)
    ...     steps = read_rate_steps(Path(folder, "steps.csv"))
    >>> np.degrees(steps.rate).round(9)
    array([ 10., -10.])
    """
    # columns of the steps of a rate table, besides the gyros'
    rate_steps = ("station", "inclination_deg", "toolface_deg", "azimuth_deg", "rate_deg_s", "temperature_degC")
    table = read_table(path, progress, numeric=numbers_among(rate_steps), gaps=("azimuth_deg",))
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(rate_steps)]
    degrees = {name: _within(table, name) for name in _LIMITS if name != "azimuth_deg" or name in table}
    rate = degrees["rate_deg_s"]
    if looks_like_radians(rate):
        reach = f"largest {np.abs(rate).max():.5g}"
        raise table.error(f"rate_deg_s looks like radians per second ({reach}); convert it to degrees per second")
    azimuth = degrees.get("azimuth_deg", np.full(len(table), np.nan))
    lost = np.flatnonzero((rate == 0.0) & np.isnan(azimuth))
    if lost.size:
        raise table.error("the table is at rest here; give azimuth_deg, from true north", int(lost[0]))
    signals = read_signals(table)
    if "gyro" not in signals.values:
        raise table.error("no gyro columns; add gyro_x, gyro_y, gyro_z, with a unit where there is one (gyro_x_deg_h)")
    others = [kind for kind in KINDS if kind in signals.values and kind != "gyro"]
    notes = [*signals.notes, *unused, *(f"{kind} columns are not used on a rate table" for kind in others)]
    station = table.text("station") if "station" in table else tuple(str(i + 1) for i in range(len(table)))
    found = signals.sd.get("gyro")
    return RateSteps(
        station,
        frozen(np.radians(degrees["inclination_deg"])),
        frozen(np.radians(degrees["toolface_deg"])),
        frozen(np.radians(azimuth)),
        frozen(np.radians(rate)),
        signals.values["gyro"],
        found if found is not None and (found > 0.0).all() else None,
        read_temperature(table),
        signals.units["gyro"],
        signals.names["gyro"],
        tuple(table.lines.tolist()),
        tuple(notes),
        table.path,
        table.digest,
    )


def _within(table: Table, name: str) -> Array:
    values, limit = table.number(name), _LIMITS[name]
    bad = np.abs(values) > limit
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise table.error(f"{name} is {values[row]:g}; allowed {-limit:g} to {limit:g}", row)
    return values


def looks_like_radians(rate: Array) -> bool:
    """Whether rates said to be in deg/s are in rad/s.

    True when two or more different speeds are no multiples of 0.01 themselves, but become whole degrees per second, to
    a hundredth, when taken for radians per second. Only tables set in degrees give themselves away like that.

    Examples
    --------
    >>> looks_like_radians(np.array([0.1745, -0.1745, 0.5236])), looks_like_radians(np.array([0.5, 1.0, 0.0]))
    (True, False)
    """
    speed = np.unique(np.abs(rate[rate != 0.0]))
    if len(speed) < 2:
        return False
    own = np.abs(speed * 100.0 - np.round(speed * 100.0)) > 1e-6
    turned = np.degrees(speed)
    whole = np.abs(turned - np.round(turned)) < 0.01
    return bool(own.any() and whole.all() and (turned > 0.5).all())

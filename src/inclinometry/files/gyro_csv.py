"""Steps of a rate table: `station, inclination_deg, toolface_deg[, azimuth_deg], rate_deg_s, gyro_x, ..`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Index, frozen
from inclinometry.errors import not_among
from inclinometry.files import writing
from inclinometry.files.columns import GYRO_RUN, KIND_PREFIX, PARTS, UNIT_LABELS, channel, numbers_among
from inclinometry.files.frame import Frame, unused
from inclinometry.files.signals import Signals, read_signals, read_temperature
from inclinometry.files.survey_csv import differs, falls, survey_cells
from inclinometry.files.table import read_table
from inclinometry.files.text import Progress
from inclinometry.findings import Finding, Value
from inclinometry.gyro.indexing import IndexTurns
from inclinometry.tabular import Column, Tabular, channel_columns, in_degrees

# Gyro runs: readings at index positions in, stations with scale factor out.

CORRECTED = ("gyro_x_corrected_deg_h", "gyro_y_corrected_deg_h", "gyro_z_corrected_deg_h")
STATION = ("scale", "u_scale", "root", "K", "temperature_degC", *CORRECTED)
"""Columns of a station file beyond those of the survey file."""


@dataclass(frozen=True, eq=False, repr=False)
class GyroReadings(Tabular):
    """Readings of one run in the order they were taken; n stations of several index positions, K readings.

    station : (K,) number of the station, from 0. labels : (n,) their names. md : (n,) m, increasing or decreasing.
    index : (K,) rad, as the file counts it; index_turns : which way it counts, looking down hole.
    channels, sd : kind -> (K, m). letters : kind -> axes, e.g. "xy"; "" where they are numbered.
    temperature, time : (K,) degC, s, or None.
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
    findings: tuple[Finding, ...]
    lines: NDArray[np.int64]
    path: Path
    digest: str
    index_turns: IndexTurns = "clockwise"

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def clockwise(self) -> Array:
        """The index (K,) counted clockwise looking down hole, rad."""
        return self.index if self.index_turns == "clockwise" else -self.index

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


def read_gyro_run(
    path: str | Path, *, index_turns: IndexTurns = "clockwise", progress: Progress | None = None
) -> GyroReadings:
    """Read `station, md_m, index_deg, temperature_degC, time_s`, `accel_x, accel_y[, accel_z]`, `gyro_x_deg_h ...`.

    One row is one reading at one index position; the rows of a station stand together. `temperature_degC` and `time_s`
    may be absent; one gyro (x) is enough where the index gives y.

    Parameters
    ----------
    path : str or Path
    index_turns : {"clockwise", "counterclockwise"}
        Which way the file's index angles count, looking down hole. Counted the other way azimuths come out mirrored:
        channels x and y show that, a single channel does not.
    progress : callable, optional

    Raises
    ------
    InputError
        Another value of `index_turns`.
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
    if index_turns not in get_args(IndexTurns):
        raise not_among("index_turns", str(index_turns), get_args(IndexTurns))
    table = read_table(path, progress, numeric=numbers_among(GYRO_RUN), timed=True)
    findings = table.unknown(GYRO_RUN)
    station, labels = _stations(table)
    md = _depths(table, station)
    findings += unused(n for n in table.names if n.startswith("mag_") and channel(n))
    wanted = {"accelerometer": "accel", "gyro": "gyro"}
    found = read_signals(table, tuple(wanted))
    letters: dict[str, str] = {}
    for kind, prefix in wanted.items():
        if kind not in found.values:
            raise table.error(table.lacking(f"{prefix}_x", f"{prefix}_y"))
        axes = "".join(name.split("_")[1] for name in found.names[kind])
        letters[kind] = axes if axes.isalpha() else ""
    return GyroReadings(
        station,
        labels,
        md,
        frozen(np.radians(_index(table))),
        MappingProxyType({kind: frozen(array) for kind, array in found.values.items()}),
        MappingProxyType(letters),
        MappingProxyType(_positive(table, found)),
        MappingProxyType(found.units),
        read_temperature(table),
        table.number("time_s") if "time_s" in table else None,
        findings,
        table.lines,
        table.path,
        table.digest,
        index_turns,
    )


def _positive(table: Frame, found: Signals) -> dict[str, Array]:
    """Standard deviations of the readings, none of them zero."""
    for kind, sd in found.sd.items():
        if (sd <= 0.0).any():
            row, column = np.argwhere(sd <= 0.0)[0].tolist()
            values: dict[str, Value] = {"name": f"{found.names[kind][column]}_sd", "value": 0, "allowed": "> 0"}
            raise table.error(Finding("input-value", values), row)
    return found.sd


def _stations(table: Frame) -> tuple[Index, tuple[str, ...]]:
    """Number of the station of each row, and the labels; the rows of a station must stand together."""
    names = table.text("station")
    labels: list[str] = []
    seen: set[str] = set()
    numbers = np.empty(len(names), dtype=np.intp)
    for row, name in enumerate(names):
        if row and name == names[row - 1]:
            numbers[row] = numbers[row - 1]
            continue
        if name in seen:
            raise table.error(Finding("gyro-station-again", {"station": name}), row)
        if not name.strip():
            raise table.error(Finding("input-empty", {"name": "station"}), row)
        seen.add(name)
        numbers[row] = len(labels)
        labels.append(name)
    return numbers, tuple(labels)


def _depths(table: Frame, station: Index) -> Array:
    name, metres = table.depth()
    values = table.number(name)
    first = np.flatnonzero(np.diff(station, prepend=-1))
    md = values[first]
    off = values != md[station]
    if off.any():
        row = int(np.argmax(off))
        value, other, where = float(values[row]), float(md[station[row]]), int(first[station[row]])
        raise table.error(differs(table, name, value, other, where, table.text("station")[row]), row)
    steps = np.diff(md)
    wrong = (steps == 0.0) | (np.sign(steps) != np.sign(steps[0] if steps.size else 1.0))
    if wrong.any():
        at = int(np.argmax(wrong)) + 1
        row = int(first[at])
        raise table.error(falls(name, values, int(first[at - 1]), row), row)
    return frozen(metres[first])


def _index(table: Frame) -> Array:
    values = table.within("index_deg", -36000.0, 36000.0)
    spread = float(np.ptp(values))
    if 0.0 < spread <= 2.0 * np.pi + 1e-6 and not np.allclose(values, np.round(values), atol=1e-6):
        raise table.error(Finding("table-radians", {"columns": ("index_deg",), "most": float(np.abs(values).max())}))
    return values


def write_gyro_stations(path: str | Path, columns: Mapping[str, Any]) -> None:
    """Write stations.csv: the columns of the survey file, then those of `STATION`, and those of `PARTS` where known."""
    cells = survey_cells({k: v for k, v in columns.items() if k not in (*STATION, *PARTS)})
    for name in (*STATION, *(name for name in PARTS if name in columns)):
        value = columns[name]
        if name == "root":
            cells[name] = [str(v) for v in value]
        else:
            numbers = np.asarray(np.full(np.size(columns["md"]), np.nan) if value is None else value, dtype=np.float64)
            cells[name] = np.where(np.isfinite(numbers), numbers, np.nan)
    writing.write_columns(cells, path)


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
    suffixes = {label: f"_{suffix}" for suffix, label in UNIT_LABELS.items() if suffix != "counts"}
    signals = {
        f"{KIND_PREFIX[kind]}_{axis}{suffixes.get(units[kind], '')}": column
        for kind, values in channels.items()
        for axis, column in zip(letters[kind], values.T, strict=True)
    }
    start = {"station": station, "md_m": md, "index_deg": writing.degrees(index), "temperature_degC": temperature}
    writing.write_columns({**start, **signals, "time_s": time}, path)


@dataclass(frozen=True, eq=False)
class RateSteps:
    """Steps of a tool on a rate table, one row a step; angles in rad.

    inclination, toolface : (K,) of the tool as mounted. azimuth : (K,) from true north; NaN where it is not given.
    rate : (K,) rad/s, clockwise seen from above. signals, sd : (K, m) of the gyros, in `unit`. temperature : (K,) degC.
    names : of the m columns of the gyros. lines : (K,) of the file, from 1.
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
    findings: tuple[Finding, ...]
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
    """Read the steps of a rate table; `azimuth_deg`, from true north, is needed where the table is at rest."""
    # columns of the steps of a rate table, besides the gyros'
    rate_steps = ("station", "inclination_deg", "toolface_deg", "azimuth_deg", "rate_deg_s", "temperature_degC")
    table = read_table(path, progress, numeric=numbers_among(rate_steps), gaps=("azimuth_deg",))
    findings = table.unknown(rate_steps)
    fastest = 3600.0  # deg/s; no table turns a tool faster
    limits = {"inclination_deg": 180.0, "toolface_deg": 360.0, "azimuth_deg": 360.0, "rate_deg_s": fastest}
    degrees = {
        name: table.within(name, -most, most) for name, most in limits.items() if name != "azimuth_deg" or name in table
    }
    rate = degrees["rate_deg_s"]
    if looks_like_radians(rate):
        raise table.error(Finding("table-radians", {"columns": ("rate_deg_s",), "most": float(np.abs(rate).max())}))
    azimuth = degrees.get("azimuth_deg", np.full(len(table), np.nan))
    lost = np.flatnonzero((rate == 0.0) & np.isnan(azimuth))
    if lost.size:
        needed: dict[str, Value] = {"name": "rate_deg_s = 0", "needed": ("azimuth_deg",)}
        raise table.error(Finding("input-needs", needed), int(lost[0]))
    signals = read_signals(table)
    if "gyro" not in signals.values:
        raise table.error(table.lacking("gyro_x", "gyro_y", "gyro_z"))
    findings += unused(name for kind, names in signals.names.items() if kind != "gyro" for name in names)
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
        (*signals.findings, *findings),
        table.path,
        table.digest,
    )


def looks_like_radians(rate: Array) -> bool:
    """Whether rates said to be in deg/s are in rad/s.

    True when two or more different speeds are no multiples of 0.01 themselves, but become whole degrees per second, to
    a hundredth, when taken for radians per second. This finds only tables that were set in whole degrees.
    """
    speed = np.unique(np.abs(rate[rate != 0.0]))
    if len(speed) < 2:
        return False
    own = np.abs(speed * 100.0 - np.round(speed * 100.0)) > 1e-6
    turned = np.degrees(speed)
    whole = np.abs(turned - np.round(turned)) < 0.01
    return bool(own.any() and whole.all() and (turned > 0.5).all())

"""Bench readings: `station, azimuth_deg, inclination_deg, toolface_deg, temperature_degC, accel_x, ..` and back."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from inclinometry.calibration.readings import BenchReadings
from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError, InputError
from inclinometry.io import _write
from inclinometry.io._channels import Signals, read_signals, read_temperature
from inclinometry.io._clipping import Settings, constant_channel, saturation_notes
from inclinometry.io._lines import Progress
from inclinometry.io._repeats import Repeats, find_repeats
from inclinometry.io._settings import read_settings
from inclinometry.io.columns import BENCH, KIND_PREFIX, REFERENCES, UNIT_LABELS, numbers_among
from inclinometry.io.table import Table, read_table

_REFERENCE_LIMITS = {
    "reference_g_m_s2": (9.5, 10.0, "m/s^2"),
    "reference_b_nT": (1e3, 1e6, "nT"),
    "reference_dip_deg": (-90.0, 90.0, "deg"),
}


def read_bench(path: str | Path, *, progress: Progress | None = None) -> BenchReadings:
    """Read the stations of a calibration or verification run.

    Parameters
    ----------
    path : str or Path
        CSV as `table.read_table` understands it. Columns: `station`, `azimuth_deg`, `inclination_deg`, `toolface_deg`
        (all three, or none for the field method), `temperature_degC`, any of the triads `accel_`, `mag_`, `gyro_` with
        axes `x, y, z`, or `x, y`, or `1, 2, .. m`, optionally with a unit (`accel_x_m_s2`); `<channel>_sd` (standard
        deviation of one reading), `count` (readings averaged in a row), `roll_set`, and the constants of the stand
        `reference_g_m_s2`, `reference_b_nT`, `reference_dip_deg`.
    progress : callable, optional
        Called with the number of bytes read.

    Returns
    -------
    BenchReadings
        Repeated stations averaged; `sd` is that of the mean. `notes` names what was averaged, `warnings` what was
        not used, and channels that look saturated.

    Raises
    ------
    FileError
        With file, line, value and remedy; see the rules of `table`, `_settings`, `_repeats` and `_clipping`.

    Examples
    --------
    >>> import tempfile
    >>> rows = "station,accel_x,accel_y\\nA,1,2\\nB,3,1\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "bench.csv").write_text(rows)
    ...     readings = read_bench(Path(folder, "bench.csv"))
    >>> readings.channels["accelerometer"]
    array([[1., 2.],
           [3., 1.]])
    """
    table = read_table(path, progress, numeric=numbers_among(BENCH))
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(BENCH)]
    signals, settings = read_signals(table), read_settings(table)
    temperature, count = read_temperature(table), _count(table)
    station, roll_set = _stations(table), table.text("roll_set") if "roll_set" in table else ()
    try:
        with np.errstate(over="raise", invalid="raise"):
            repeats = find_repeats(table, station, settings, temperature, roll_set)
            doubts = [*signals.notes, *unused, *_suspicions(table, signals, settings, repeats)]
            return _merged(table, signals, settings, temperature, count, station, roll_set, repeats, doubts)
    except (InputError, FloatingPointError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"these readings cannot be used: {error}", path=path) from None


def _merged(
    table: Table,
    signals: Signals,
    settings: Settings | None,
    temperature: Array | None,
    count: Array | None,
    station: Sequence[str],
    roll_set: Sequence[str],
    repeats: Repeats,
    warnings: Sequence[str],
) -> BenchReadings:
    averaged = len(repeats.first) < len(table)
    if count is None and averaged:
        count = np.ones(len(table))
    sd: dict[str, Array] = {}
    for kind, values in signals.values.items():
        own = signals.sd.get(kind)
        if own is not None and count is not None:
            own = own / np.sqrt(count)[:, None]
        spread = repeats.sd_of_mean(values, own)
        if spread is not None:
            sd[kind] = spread
    azimuth, inclination, toolface = (None,) * 3 if settings is None else (a[repeats.first] for a in settings)
    return BenchReadings(
        {kind: repeats.mean(values) for kind, values in signals.values.items()},
        azimuth,
        inclination,
        toolface,
        [station[i] for i in repeats.first],
        sd,
        None if count is None else repeats.sum(count),
        None if temperature is None else repeats.mean(temperature),
        [roll_set[i] for i in repeats.first] if any(roll_set) else (),
        signals.units,
        _reference(table),
        repeats.notes,
        table.digest,
        warnings=warnings,
    )


def _stations(table: Table) -> tuple[str, ...]:
    if "station" not in table:
        return tuple(str(i + 1) for i in range(len(table)))
    names = table.text("station")
    if "" in names:
        raise table.error("station is empty; give it a name or remove the row", names.index(""))
    return names


def _count(table: Table) -> Array | None:
    if "count" not in table:
        return None
    values = table.number("count")
    bad = (values < 1.0) | (values != np.floor(values))
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise table.error(f"count is {values[row]:g}; it must be a whole number from 1", row)
    return values


def _reference(table: Table) -> dict[str, float]:
    """The fields at the stand, SI (nT for b) and radians."""
    reference: dict[str, float] = {}
    for name, (low, high, unit) in _REFERENCE_LIMITS.items():
        if name not in table:
            continue
        values = table.number(name)
        value = float(values[0])
        other = np.flatnonzero(values != value)
        if other.size:
            row = int(other[0])
            problem = f"{name} is {value:.10g} in line {table.lines[0]} and {values[row]:.10g} here"
            raise table.error(f"{problem}; it must be the same in the whole file", row)
        if not low <= value <= high:
            raise table.error(f"{name} is {value:.10g}; allowed {low:g} to {high:g} {unit}", 0)
        key = {"reference_g_m_s2": "g", "reference_b_nT": "b", "reference_dip_deg": "dip"}[name]
        reference[key] = float(np.radians(value)) if key == "dip" else value
    return reference


def _suspicions(table: Table, signals: Signals, settings: Settings | None, repeats: Repeats) -> list[str]:
    """Notes on channels that rest on a rail; FileError for one that never changes."""
    notes: list[str] = []
    for kind, values in signals.values.items():
        names = signals.names[kind]
        stuck = constant_channel(values, names, settings)
        if stuck is not None:
            if stuck[1]:
                raise table.error(stuck[0])
            notes.append(stuck[0])
        notes += saturation_notes(kind, values, names, settings, repeats.group)
    return notes


def write_bench(readings: BenchReadings, path: str | Path) -> None:
    """Write readings so that `read_bench` gives them back.

    Angles are rounded to 1e-10 deg; everything else is printed so that it reads back to the same bits. The standard
    deviation is written as that of one reading.

    Parameters
    ----------
    readings : BenchReadings
    path : str or Path

    Notes
    -----
    The unit stands in the channels' names (`accel_x_m_s2`) where it is one the reader knows; counts need none.
    """
    names, columns = ["station"], [list(readings.station)]
    if readings.azimuth is not None:
        for name, angle in zip(("azimuth_deg", "inclination_deg", "toolface_deg"), readings.dials, strict=True):
            names.append(name)
            columns.append(_write.column(_write.degrees(angle)))
    if readings.temperature is not None:
        names.append("temperature_degC")
        columns.append(_write.column(readings.temperature))
    _add_channels(readings, names, columns)
    if readings.count is not None:
        names.append("count")
        columns.append(_write.column(readings.count))
    if readings.roll_set:
        names.append("roll_set")
        columns.append(list(readings.roll_set))
    for name, key in zip(REFERENCES, ("g", "b", "dip"), strict=True):
        if key in readings.reference:
            value = readings.reference[key]
            names.append(name)
            columns.append([_write.number(float(_write.degrees(value)) if key == "dip" else value)] * len(readings))
    _write.write_columns(names, columns, path)


def _add_channels(readings: BenchReadings, names: list[str], columns: list[list[str]]) -> None:
    suffixes = {label: f"_{suffix}" for suffix, label in UNIT_LABELS.items() if label != "counts"}
    repeats = np.ones(len(readings)) if readings.count is None else readings.count
    for kind, values in readings.channels.items():
        tail = suffixes.get(readings.units[kind], "")
        channels = [f"{KIND_PREFIX[kind]}_{axis}{tail}" for axis in axes(values.shape[1])]
        names += channels
        columns += [_write.column(column) for column in values.T]
        if kind in readings.sd:
            names += [f"{name}_sd" for name in channels]
            columns += [_write.column(column * np.sqrt(repeats)) for column in readings.sd[kind].T]


def axes(count: int) -> list[str]:
    """Names of a triad's axes: x, y, z for two or three, else 1..m.

    Examples
    --------
    >>> axes(2), axes(4)
    (['x', 'y'], ['1', '2', '3', '4'])
    """
    return ["x", "y", "z"][:count] if count <= 3 else [str(i + 1) for i in range(count)]

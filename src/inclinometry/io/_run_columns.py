"""What the columns of a run mean, and whether their values can be: shared by all formats of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from inclinometry.calibration.readings import LARGEST
from inclinometry.core.arrays import Array
from inclinometry.core.errors import FileError
from inclinometry.io._channels import COLDEST, HOTTEST, read_signals
from inclinometry.io.columns import LOG, UNIT_LABELS, channel
from inclinometry.io.table import Table

_SPELLED: Final = {
    **{label.lower(): label for label in UNIT_LABELS.values()},
    **{key.lower(): label for key, label in UNIT_LABELS.items()},
    "m/s2": "m/s^2", "m/s²": "m/s^2", "µt": "uT", "°/s": "deg/s", "°/h": "deg/h",
}  # fmt: skip
_PLAIN_UNITS: Final = {"time_s": ("s", "seconds"), "temperature_degC": ("degc", "°c", "celsius", "deg c")}


class RunHeader(NamedTuple):
    """The columns of a run that are read.

    names : kind -> columns as the file names them.
    units : kind -> unit label.
    temperature : whether there is a temperature.
    notes : what a person should know.
    """

    names: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    temperature: bool
    notes: tuple[str, ...]

    @property
    def wanted(self) -> tuple[str, ...]:
        """Every column that is read, time first."""
        names = [name for kind in self.names.values() for name in kind]
        return ("time_s", *names, *(["temperature_degC"] if self.temperature else []))


def run_header(path: Path, header: Sequence[str], line: int, stated: Mapping[str, str] | None = None) -> RunHeader:
    """The columns of a run by their names, in a `line` (0: no text file), and by the units `stated` apart from them.

    Raises
    ------
    FileError
        As `open_run`.
    """
    named = {_with_unit(path, name, (stated or {}).get(name)): name for name in header}
    empty = np.empty(0)
    table = Table(
        path,
        tuple(named),
        MappingProxyType(dict.fromkeys(named, empty)),
        np.empty(0, dtype=np.int64),
        line,
        "",
    )
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(LOG)]
    try:
        table.require(["time_s"])
        signals = read_signals(table)
    except FileError as error:
        if line:
            raise
        raise FileError(error.problem, path=path) from None
    unused += [f"column {c.name!r} was not used" for c in map(channel, table.header) if c is not None and c.sd]
    names = {kind: tuple(named[name] for name in found) for kind, found in signals.names.items()}
    return RunHeader(
        MappingProxyType(names),
        MappingProxyType(signals.units),
        "temperature_degC" in table,
        tuple(unused),
    )


def _with_unit(path: Path, name: str, stated: str | None) -> str:
    """A column's name with the unit stated apart from it; FileError where the two contradict each other."""
    found = channel(name)
    if not stated or (found is None and name not in _PLAIN_UNITS):
        return name
    if found is None:
        if stated.strip().lower() not in _PLAIN_UNITS[name]:
            raise FileError(f"column {name!r} has the unit {stated!r}, which its name contradicts", path=path)
        return name
    label = _SPELLED.get(stated.strip().lower())
    if label is None:
        known = ", ".join(UNIT_LABELS.values())
        raise FileError(f"column {name!r} has the unit {stated!r}, which is not known; use {known}", path=path)
    own = next((key for key, value in UNIT_LABELS.items() if value == found.unit and name.endswith(f"_{key}")), None)
    if own is not None:
        if found.unit != label:
            raise FileError(f"column {name!r} has the unit {stated!r}, which its name contradicts", path=path)
        return name
    key = next(key for key, value in UNIT_LABELS.items() if value == label)
    return f"{name}_{key}"


class Problem(NamedTuple):
    """A value that cannot be used: index of its row, what is wrong."""

    row: int
    text: str


class RunCheck:
    """Finds the first value that cannot be used, piece by piece of a run.

    Examples
    --------
    >>> check = RunCheck()
    >>> check.accept({"time_s": np.array([0.0, 1.0])})
    >>> check.problem({"time_s": np.array([1.0, 0.5])}).row
    1
    """

    def __init__(self) -> None:
        self._last = -np.inf

    def problem(self, columns: Mapping[str, Array]) -> Problem | None:
        """The first row with a time that is missing or goes back, or a value no sensor reports; None if all is well."""
        found = [_of_column(name, values) for name, values in columns.items()]
        found.append(self._backward(columns["time_s"]))
        return min((problem for problem in found if problem is not None), default=None)

    def accept(self, columns: Mapping[str, Array]) -> None:
        """The piece was well: the next one follows it."""
        if columns["time_s"].size:
            self._last = float(columns["time_s"][-1])

    def _backward(self, time: Array) -> Problem | None:
        before = np.concatenate([[self._last], time[:-1]])
        back = time < before
        if not back.any():
            return None
        row = int(np.argmax(back))
        return Problem(
            row,
            f"time_s {time[row]:.12g} is less than {before[row]:.12g} before it; time must not run backwards: sort the "
            "rows, or cut the run where the clock was set",
        )


def _of_column(name: str, values: Array) -> Problem | None:
    if name == "temperature_degC":
        low, high = COLDEST, HOTTEST
    else:
        low, high = -LARGEST, LARGEST
    bad = (values < low) | (values > high)
    if name == "time_s":
        bad |= np.isnan(values)
    if not bad.any():
        return None
    row = int(np.argmax(bad))
    value = values[row]
    if np.isnan(value):
        return Problem(row, f"column {name!r} is empty; every row needs its time: fill it in or remove the row")
    if np.isinf(value):
        return Problem(row, f"column {name!r} is {value}; a value must be finite: correct it or leave it empty")
    doubt = ": is it in another unit?" if name == "temperature_degC" else ": correct it or leave it empty"
    return Problem(row, f"column {name!r} is {value:g}; allowed {low:g} to {high:g}{doubt}")

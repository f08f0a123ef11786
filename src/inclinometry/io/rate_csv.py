"""Steps of a rate table: `station, inclination_deg, toolface_deg[, azimuth_deg], rate_deg_s, gyro_x, ..`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from inclinometry.core.arrays import Array, frozen
from inclinometry.core.constants import KINDS
from inclinometry.io._channels import read_signals, read_temperature
from inclinometry.io._lines import Progress
from inclinometry.io.columns import numbers_among
from inclinometry.io.table import Table, read_table

RATE_STEPS = ("station", "inclination_deg", "toolface_deg", "azimuth_deg", "rate_deg_s", "temperature_degC")
"""Columns of the steps of a rate table, besides the gyros'."""

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
    table = read_table(path, progress, numeric=numbers_among(RATE_STEPS), gaps=("azimuth_deg",))
    unused = [f"column {name!r} is not known and was not used" for name in table.unknown(RATE_STEPS)]
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
    return RateSteps(
        station,
        frozen(np.radians(degrees["inclination_deg"])),
        frozen(np.radians(degrees["toolface_deg"])),
        frozen(np.radians(azimuth)),
        frozen(np.radians(rate)),
        signals.values["gyro"],
        _stated(signals.sd),
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


def _stated(sd: Mapping[str, Array]) -> Array | None:
    """Standard deviations where all are positive; a mean without scatter says nothing."""
    found = sd.get("gyro")
    return found if found is not None and (found > 0.0).all() else None


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

"""Plans: `station, azimuth_deg, inclination_deg, toolface_deg, roll_set`."""

from __future__ import annotations

from pathlib import Path

from inclinometry.calibration.plans import Plan
from inclinometry.io import _write
from inclinometry.io._settings import need_settings
from inclinometry.io.columns import ANGLES, PLAN, numbers_among
from inclinometry.io.table import read_table


def read_plan(path: str | Path) -> Plan:
    """Read a plan; its name is the file's without the ending.

    Raises
    ------
    FileError
        As `table.read_table`; an angle column is missing, out of range, or looks like radians.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "mine.csv").write_text("azimuth_deg,inclination_deg,toolface_deg\\n0,90,0\\n")
    ...     read_plan(Path(folder, "mine.csv")).name
    'mine'
    """
    table = read_table(path, numeric=numbers_among(PLAN))
    table.unknown(PLAN)
    settings = need_settings(table)
    roll_set = table.text("roll_set") if "roll_set" in table else ()
    return Plan(Path(path).stem, *settings, roll_set if any(roll_set) else ())


def write_plan(plan: Plan, path: str | Path) -> None:
    """Write a plan, angles rounded to 1e-10 deg; stations are numbered from 1."""
    columns = [[str(i + 1) for i in range(len(plan))]]
    columns += [_write.column(_write.degrees(a)) for a in (plan.azimuth, plan.inclination, plan.toolface)]
    names = ["station", *ANGLES]
    if plan.roll_set:
        names.append("roll_set")
        columns.append(list(plan.roll_set))
    _write.write_columns(names, columns, path)

"""Attitude of a moving tool as a table: one row a window, blank where it was refused."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import RPM
from inclinometry.earth.site import REFERENCES
from inclinometry.errors import in_file, not_among
from inclinometry.files import writing
from inclinometry.files.parquet import write_table
from inclinometry.files.run_file import checked_ending
from inclinometry.files.table import read_table
from inclinometry.motion.result import BITS, METHODS, AttitudeRows
from inclinometry.orientation import SWITCH
from inclinometry.rotations import dcm, quaternion_from_dcm

COLUMNS: Final = (
    "time_s", "inclination_deg", "azimuth_deg", "azimuth_reference", "toolface_deg", "u_inclination_deg",
    "u_azimuth_deg", "u_toolface_deg", "rpm", "method", "quality", "flags", "q_w", "q_x", "q_y", "q_z",
    "magnetic_toolface_deg", "u_magnetic_toolface_deg", "toolface_type",
    "u_common_inclination_deg", "u_common_azimuth_deg", "u_common_toolface_deg", "u_random_inclination_deg",
    "u_random_azimuth_deg", "u_random_toolface_deg",
)  # fmt: skip
"""The contract of the attitude file, in its order; what follows `flags` is absent from older files."""

_TEXT: Final = ("azimuth_reference", "method", "flags", "toolface_type")
_QUATERNION: Final = ("q_w", "q_x", "q_y", "q_z")
_DEGREES: Final = {name: name.removesuffix("_deg") for name in COLUMNS if name.endswith("_deg")}


def write_attitude(
    rows: AttitudeRows, path: str | Path, header: Mapping[str, str] | None = None, *, switch: float = SWITCH
) -> None:
    """Write attitude.csv or attitude.parquet, by the ending of the name, whole or not at all.

    `header` is metadata `inclinometry.header` of a Parquet file; CSV has no place for it. `toolface_type` is magnetic
    below the inclination `switch`, rad, and gravity from there on.
    """
    # columns of the contract, texts as lists
    found: dict[str, Array | list[str]] = {}
    for name in COLUMNS:
        if name in _DEGREES:
            angles = writing.degrees(getattr(rows, _DEGREES[name]))
            found[name] = (
                np.where(angles == 360.0, 0.0, angles)
                if name.endswith(("azimuth_deg", "toolface_deg")) and name[:2] != "u_"
                else angles
            )
    names = {code: "|".join(name for name, bit in BITS.items() if int(code) & bit) for code in np.unique(rows.flags)}
    found |= {
        "time_s": np.asarray(np.round(rows.time, 9) + 0.0),
        "azimuth_reference": [REFERENCES[n] for n in rows.north],
        "rpm": np.asarray(np.round(rows.rate * RPM, 6) + 0.0),
        "method": [METHODS[n] for n in rows.method],
        "quality": np.asarray(np.round(rows.quality, 6) + 0.0),
        "flags": [names[code] for code in rows.flags],
        "toolface_type": [
            "" if lost else ("magnetic" if steep else "gravity")
            for lost, steep in zip(rows.refused, rows.steep(switch), strict=True)
        ],
        **{name: np.asarray(np.round(rows.quaternion[:, k], 12) + 0.0) for k, name in enumerate(_QUATERNION)},
    }
    columns = {name: found[name] for name in COLUMNS}
    if checked_ending(path) == ".csv":
        writing.write_columns(columns, path)
        return
    units = {**dict.fromkeys(_DEGREES, "deg"), "time_s": "s", "rpm": "1/min"}
    write_table(columns, units, {"schema": "inclinometry/attitude", "version": "1", **(header or {})}, path)


def read_attitude(path: str | Path) -> AttitudeRows:
    """Read what `write_attitude` has written.

    Raises
    ------
    FileError
        Not found or no such table; a column of the contract is missing; a method, flag or reference no one knows.

    Examples
    --------
    >>> import tempfile
    >>> one, none = np.ones(1), np.full(1, np.nan)
    >>> small = np.zeros(1, dtype=np.uint8)
    >>> rows = AttitudeRows(5 * one, none, none, none, none, none, none, one, 0 * one,
    ...                     np.array([1], dtype=np.uint32), small, small, np.full((1, 4), np.nan), none, none)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_attitude(rows, Path(folder, "a.parquet"))
    ...     back = read_attitude(Path(folder, "a.parquet"))
    >>> back.names(0), bool(back.refused[0]), round(float(back.rate[0]), 6)
    (('clipped',), True, 1.0)
    """
    where = Path(path)
    checked_ending(where)
    table = read_table(where, numeric=lambda name: name in COLUMNS and name not in _TEXT, gaps=COLUMNS)
    table.require(COLUMNS[: COLUMNS.index("flags") + 1])
    there = [name for name in COLUMNS if name in table.names]
    columns = _later({name: table.text(name) if name in _TEXT else table.number(name) for name in there})
    # the random part is what the common one leaves of the whole
    angles = {
        name: np.radians(columns[column])
        for column, name in _DEGREES.items()
        if column in columns and not column.startswith("u_random_")
    }
    north = _places(columns["azimuth_reference"], REFERENCES, where, "azimuth_reference")
    flags = [sum(_bit(where, name) for name in text.split("|") if name) for text in columns["flags"]]
    return AttitudeRows(
        time=columns["time_s"],
        **angles,
        rate=columns["rpm"] / RPM,
        quality=columns["quality"],
        flags=np.array(flags, dtype=np.uint32),
        method=_places(columns["method"], METHODS, where, "method").astype(np.uint8),
        north=north.astype(np.uint8),
        quaternion=np.stack([columns[name] for name in _QUATERNION], axis=1),
    )


def _later(columns: dict[str, Any]) -> dict[str, Any]:
    """With the columns that older files have not: the quaternion of the angles; nothing is known of the toolface."""
    blank = np.full(len(columns["time_s"]), np.nan)
    if not set(_QUATERNION) <= set(columns):
        angles = [np.radians(columns[f"{name}_deg"]) for name in ("azimuth", "inclination", "toolface")]
        known = np.isfinite(angles).all(axis=0)
        quaternion = np.full((len(blank), 4), np.nan)
        if known.any():
            quaternion[known] = quaternion_from_dcm(dcm(*(one[known] for one in angles)))
        columns |= dict(zip(_QUATERNION, quaternion.T, strict=True))
    return {name: blank for name in COLUMNS if name.endswith("magnetic_toolface_deg")} | columns


def _places(texts: Any, known: tuple[str, ...], path: Path, column: str) -> Any:
    place = {name: n for n, name in enumerate(known)}
    lost = next((text for text in texts if text not in place), None)
    if lost is not None:
        raise in_file(not_among(column, f"{lost!r:.60}", known), path)
    return np.array([place[text] for text in texts], dtype=np.int64)


def _bit(path: Path, name: str) -> int:
    if name not in BITS:
        raise in_file(not_among("flags", f"{name!r:.60}", BITS), path)
    return BITS[name]

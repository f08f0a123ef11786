"""From the columns of any table to a survey: units, ranges, axes, norths; each refusal names its row."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Mask, finite, frozen
from inclinometry.constants import ANGLES
from inclinometry.conventions import Convention, named
from inclinometry.earth.site import REFERENCES
from inclinometry.earth.site import REFERENCES as NORTHS
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import EXTRA, Meaning, Quantity, meaning, quantities
from inclinometry.files.columns import closest
from inclinometry.files.writing import number
from inclinometry.tabular import Column as TableColumn
from inclinometry.tabular import Tabular

VECTORS: Final = ("g", "b", "w")
"""Optional fields in tool axes, three numbers a station."""

MEASURED: Final = ("g", "b", "dip", "earth_rate", "latitude", "dogleg_severity")
"""Names in `SurveyFile.measured`: m/s^2, nT, rad, rad/s, rad, rad/m."""

REFERENCE: Final = ("g", "b", "dip", "declination", "convergence", "latitude", "earth_rate")
"""Names in `SurveyFile.reference`: m/s^2, nT, rad, rad, rad, rad, rad/s."""

CORRECTIONS: Final = ("gx", "gy", "gz", "bx", "by", "bz", "sag_inclination", "sag_azimuth", "sensor_offset")
"""Names in `SurveyFile.corrections`, added to what was measured: m/s^2, nT, rad, rad, m."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class SurveyFile(Tabular):
    """Stations of one well or run as a file of any format holds them; None, or NaN at a station, where it is silent.

    md : (n,) measured depth, m; strictly increasing over the stations that are used (a repeated shot is not).
    inclination, azimuth, toolface, magnetic_toolface, gyro_toolface : (n,) rad; toolface is the gravity toolface.
    azimuth_reference : "magnetic", "true" or "grid"; required with an azimuth.
    north, east, tvd : (n,) m from the well's origin.
    g, b, w : (n, 3) gravity, m/s^2 (the field: positive down, not the specific force), magnetic flux density, nT, and
        rotation rate, rad/s, in tool axes: x = index mark, y = 90 deg clockwise of it looking down hole,
        z down hole. The reader of a format has already mapped that format's own axes and signs.
    measured : name of `MEASURED` -> (n,), what the file says was found.
    reference : name of `REFERENCE` -> (n,), what was expected, or the correction between norths.
    corrections : name of `CORRECTIONS` -> (n,).
    sigma : name of `ANGLES` -> (n,), standard uncertainty of that angle.
    covariance : (n, 3, 3) of the position in north, east, vertical (down), m^2, at one standard deviation.
    used, valid : (n,) bool, or None where the file does not say: taken into the definitive survey; passed its checks.
    times : (n,) ISO 8601 texts, empty where unknown.
    temperature : (n,) degC.
    extra : other columns, as (n,) texts.
    header : well, run, units, originals: whatever the head of the file says, as texts.
    notes : findings of the reader.
    digest : SHA-256 of the file read.

    Raises
    ------
    InputError
        Depths that do not increase, another shape, infinity, an unknown name, an azimuth without its north.

    Examples
    --------
    >>> survey = SurveyFile(md=[0, 30], inclination=[0, 0.1], reference={"dip": 1.2})
    >>> len(survey), survey.reference["dip"]
    (2, array([1.2, 1.2]))
    >>> SurveyFile(md=[0, 30], azimuth=[1, 1])
    Traceback (most recent call last):
    inclinometry.errors.InputError: azimuths without a north; give azimuth_reference: magnetic, true, grid
    """

    md: Array
    inclination: Array | None = None
    azimuth: Array | None = None
    azimuth_reference: str | None = None
    toolface: Array | None = None
    magnetic_toolface: Array | None = None
    gyro_toolface: Array | None = None
    north: Array | None = None
    east: Array | None = None
    tvd: Array | None = None
    g: Array | None = None
    b: Array | None = None
    w: Array | None = None
    measured: Mapping[str, Array] = field(default_factory=dict)
    reference: Mapping[str, Array] = field(default_factory=dict)
    corrections: Mapping[str, Array] = field(default_factory=dict)
    sigma: Mapping[str, Array] = field(default_factory=dict)
    covariance: Array | None = None
    used: Mask | None = None
    valid: Mask | None = None
    times: tuple[str, ...] | None = None
    temperature: Array | None = None
    extra: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    header: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    digest: str = ""

    def __post_init__(self) -> None:
        size = len(finite(self.md, "md", (None,)))
        if not size:
            raise InputError("a survey without stations; give one at least")
        keep: dict[str, Any] = {"md": frozen(self.md), "used": self.used, "valid": self.valid}
        for name in ("used", "valid"):
            if keep[name] is not None:
                keep[name] = np.array(_shaped(keep[name], name, (size,)), dtype=np.bool_)
        _increasing(keep["md"], keep["used"])
        # optional quantities with one number a station
        station = (
            "inclination",
            "azimuth",
            "toolface",
            "magnetic_toolface",
            "gyro_toolface",
            "north",
            "east",
            "tvd",
            "temperature",
        )
        for name in (*station, *VECTORS, "covariance"):
            shape = (size, 3, 3) if name == "covariance" else (size, 3) if name in VECTORS else (size,)
            value = getattr(self, name)
            keep[name] = None if value is None else frozen(_shaped(value, name, shape))
        allowed = {"measured": MEASURED, "reference": REFERENCE, "corrections": CORRECTIONS, "sigma": ANGLES}
        for name, names in allowed.items():
            values = getattr(self, name)
            unknown = sorted(set(values) - set(names))
            if unknown:
                raise InputError(f"{name} {unknown} unknown; allowed: {', '.join(names)}")
            spread = {k: np.full(size, v, dtype=np.float64) if np.ndim(v) == 0 else v for k, v in values.items()}
            keep[name] = MappingProxyType({k: frozen(_shaped(v, f"{name} {k}", (size,))) for k, v in spread.items()})
        for name, texts in (("times", self.times), *self.extra.items()):
            if texts is not None and len(texts) != size:
                raise InputError(f"{name} has {len(texts)} texts; md has {size} stations")
        if self.azimuth_reference not in (None, *NORTHS) or (self.azimuth is not None and not self.azimuth_reference):
            found = f"{self.azimuth_reference!r} as a north" if self.azimuth_reference else "azimuths without a north"
            raise InputError(f"{found}; give azimuth_reference: {', '.join(NORTHS)}")
        for name in ("extra", "header"):
            keep[name] = MappingProxyType(dict(getattr(self, name)))
        for name, value in keep.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.md)

    def to_dict(self) -> dict[str, TableColumn]:
        """One row a station: what the survey has, under the names of columns in files."""
        from inclinometry.files.survey_csv import columns_of

        return {c.name: list(c.values) if isinstance(c.values, tuple) else c.values for c in columns_of(self)}

    def same_as(self, other: SurveyFile, *, rtol: float = 0.0, atol: float = 0.0) -> bool:
        """Whether all that is not `notes`, `header` and `digest` agrees within the tolerances; NaN equals NaN."""
        names = (f.name for f in fields(self) if f.name not in ("notes", "header", "digest"))
        return all(_alike(getattr(self, name), getattr(other, name), rtol, atol) for name in names)


def _shaped(value: Any, name: str, shape: tuple[int, ...]) -> Any:
    """The value as an array of the shape; NaN stands for what is unknown, infinity for nothing."""
    try:
        array = np.asarray(value, dtype=np.bool_ if name in ("used", "valid") else np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as numbers: {error}") from None
    if array.shape != shape:
        raise InputError(f"{name} has shape {array.shape}; expected {shape}")
    if np.isinf(array).any():
        raise InputError(f"{name} is infinite at station {np.argwhere(np.isinf(array))[0, 0] + 1}; use NaN for unknown")
    return array


def _increasing(md: Array, used: Mask | None) -> None:
    row = first_not_increasing(md, used)
    if row is not None:
        before = md[:row] if used is None else md[:row][used[:row]]
        raise InputError(f"md is {md[row]:.12g} m at station {row + 1} after {before[-1]:.12g} m; it must increase")


def first_not_increasing(md: Array, used: Mask | None = None) -> int | None:
    """Index of the first used station that is not deeper than the used one before it, or None.

    Examples
    --------
    >>> first_not_increasing(np.array([0.0, 30.0, 30.0])), first_not_increasing(np.array([0.0, 30.0]))
    (2, None)
    """
    rows = None if used is None else np.flatnonzero(used)
    depths = md if rows is None else md[rows]
    back = np.flatnonzero(depths[1:] <= depths[:-1])
    if not back.size:
        return None
    return int(back[0] + 1 if rows is None else rows[back[0] + 1])


def _alike(a: Any, b: Any, rtol: float, atol: float) -> bool:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_alike(a[k], b[k], rtol, atol) for k in a)
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.shape == b.shape and bool(np.allclose(a, b, rtol, atol, equal_nan=True))
    return type(a) is type(b) and bool(a == b)


Column: TypeAlias = Array | tuple[str, ...]
KINDS: Final = {"g": "accelerometer", "b": "magnetometer", "w": "gyro"}


@dataclass(frozen=True, eq=False)
class Sheet:
    """A table as its file holds it.

    columns : name -> (n,) numbers, NaN where empty, or texts.
    units : unit of a column where it stands apart from the name.
    rows : (n,) number of each row in the file, from 1; `word` is what the file calls it: line or row.
    place : what the error names besides the file, e.g. the sheet of a workbook.
    north : of the azimuths, where the head of the file says it.
    header, digest : as in SurveyFile.
    """

    path: Path
    columns: Mapping[str, Column]
    rows: NDArray[np.int64]
    units: Mapping[str, str] = field(default_factory=dict)
    word: str = "line"
    place: str = ""
    header_row: int | None = None
    north: str | None = None
    header: Mapping[str, str] = field(default_factory=dict)
    digest: str = ""

    def error(self, problem: str, row: int | None = None) -> FileError:
        """An error about one row, or about the header."""
        line = self.header_row if row is None else int(self.rows[row])
        return row_error(self.path, problem, line, self.word, self.place)


def row_error(path: str | Path, problem: str, row: int | None, word: str = "row", place: str = "") -> FileError:
    """A FileError that counts rows where the file has no lines.

    Examples
    --------
    >>> str(row_error("a.xlsx", "no number", 3, place="sheet 'run 2'"))
    "a.xlsx: sheet 'run 2', row 3: no number"
    """
    if word == "line":
        return FileError(problem, path=path, line=row)
    where = ", ".join(part for part in (place, f"{word} {row}" if row is not None else "") if part)
    error = FileError(f"{where}: {problem}" if where else problem, path=path)
    error.line = row
    return error


def survey_of(sheet: Sheet, *, convention: str = "native", azimuth_reference: str | None = None) -> SurveyFile:
    """The survey a table holds.

    Parameters
    ----------
    sheet : Sheet
    convention : str
        Axes and signs of the sensors in the file, as `conventions.named` knows them.
    azimuth_reference : {"magnetic", "true", "grid"}, optional
        Where the file does not say it.

    Raises
    ------
    FileError
        No depth or nothing besides it; a unit that is missing or unknown; two columns for one quantity, an incomplete
        triad; depths that do not increase; a value out of range; azimuths without, or with more than one, north.
    """
    vendor = named(convention)
    # what each column of the package's own is; one column a quantity
    meanings: dict[str, Meaning] = {}
    taken: dict[str, str] = {}
    for name in sheet.columns:
        try:
            what = meaning(name, sheet.units.get(name), sheet.columns.keys())
        except InputError as error:
            raise sheet.error(str(error)) from None
        if what is None:
            continue
        if what.key in taken:
            raise sheet.error(f"columns {taken[what.key]!r} and {name!r} both give {what.key}; remove one")
        taken[what.key] = name
        meanings[name] = what
    found: dict[str, Array] = {}
    for name, what in meanings.items():
        if what.unit is not None:
            values = _numbers(sheet, name, what)
            # a column without a single value is a column that is not there
            if what.key == "md" or not np.isnan(values).all():
                found[what.key] = values
    texts = {what.key: name for name, what in meanings.items() if what.unit is None}
    if "md" not in found:
        near = closest("md_m", list(sheet.columns))
        hint = f" (is it {near!r}?)" if near else ""
        raise sheet.error(f"no depth; add a column md_m or md_ft{hint}; columns found: {_shown(list(sheet.columns))}")
    if len(found) == 1:
        raise sheet.error(f"nothing besides the depth is known; columns found: {_shown(list(sheet.columns))}")
    flags = {key: _flags(sheet, texts[key]) for key in ("used", "valid") if key in texts}
    _depths(sheet, found["md"], flags.get("used"))
    extra, times = _texts(sheet, meanings, texts.get("times"))
    north = _north(sheet, meanings, texts.get("azimuth_reference"), "azimuth" in found, azimuth_reference)
    parts = _parts(sheet, found, {what.key for what in meanings.values()}, vendor)
    return SurveyFile(
        **parts,
        azimuth_reference=north,
        used=flags.get("used"),
        valid=flags.get("valid"),
        times=times,
        extra=extra,
        header=dict(sheet.header),
        notes=_doubts(parts.get("g"), parts.get("b")),
        digest=sheet.digest,
    )


def _shown(names: Sequence[str]) -> str:
    return ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")


def _numbers(sheet: Sheet, name: str, what: Meaning) -> Array:
    """One column in SI, rad, nT or degC, within its range."""
    values, quantity = sheet.columns[name], quantities()[what.key]
    if isinstance(values, tuple):
        row = next((i for i, text in enumerate(values) if text), 0)
        raise sheet.error(f"{values[row]!r} in column {name!r} is not a number; correct it", row)
    if what.unit is None:
        return values
    infinite = np.isinf(values)
    if infinite.any():
        raise sheet.error(f"column {name!r} is infinite; correct it or leave it empty", int(np.argmax(infinite)))
    turned = values if what.unit[1:] == (1.0, 0.0) else values * what.unit.factor + what.unit.offset
    _within(sheet, name, values, turned, quantity)
    return turned


def _within(sheet: Sheet, name: str, values: Array, turned: Array, quantity: Quantity) -> None:
    unit = quantity.unit
    # a full turn in radians may exceed 360 deg by rounding
    slack = 1e-9 * max(abs(quantity.low), abs(quantity.high))
    bad = (turned < (quantity.low - slack) * unit.factor) | (turned > (quantity.high + slack) * unit.factor)
    if bad.any():
        row = int(np.argmax(bad))
        allowed = f"{quantity.low:g} to {quantity.high:g} {unit.label}"
        raise sheet.error(f"column {name!r} is {values[row]:.10g}; allowed {allowed}: is the unit right?", row)


def _depths(sheet: Sheet, md: Array, used: Mask | None) -> None:
    if np.isnan(md).any():
        raise sheet.error("the depth is empty; fill it in or remove the row", int(np.argmax(np.isnan(md))))
    row = first_not_increasing(md, used)
    if row is not None:
        last = int(np.flatnonzero(np.ones(row, bool) if used is None else used[:row])[-1])
        how = "repeats" if md[row] == md[last] else "is less than"
        problem = f"the depth {md[row]:.12g} m {how} {md[last]:.12g} m in {sheet.word} {sheet.rows[last]}"
        raise sheet.error(f"{problem}; it must increase: sort the rows and keep one of each", row)


def _flags(sheet: Sheet, name: str) -> Mask | None:
    """A column of yes and no; None where it is all empty."""
    values = sheet.columns[name]
    texts = values if isinstance(values, tuple) else tuple(map(number, values.tolist()))
    if not any(texts):
        return None
    yes_no = {"1": True, "true": True, "yes": True, "y": True, "0": False, "false": False, "no": False, "n": False}
    for row, text in enumerate(texts):
        if text.strip().lower() not in yes_no:
            raise sheet.error(f"column {name!r} is {text!r}; allowed: 1, 0, true, false, yes, no", row)
    return np.array([yes_no[text.strip().lower()] for text in texts], dtype=np.bool_)


def _texts(
    sheet: Sheet, meanings: Mapping[str, Meaning], time: str | None
) -> tuple[dict[str, tuple[str, ...]], tuple[str, ...] | None]:
    """Columns that are not read, as text, and the times; times that are not ISO 8601 are such a column."""
    extra: dict[str, tuple[str, ...]] = {}
    for name, values in sheet.columns.items():
        if name not in meanings:
            cells = values if isinstance(values, tuple) else tuple(map(number, values.tolist()))
            if any(cells):
                extra[name.removeprefix(EXTRA)] = cells
    if time is None:
        return extra, None
    stamps = sheet.columns[time]
    texts = stamps if isinstance(stamps, tuple) else tuple(map(number, stamps.tolist()))
    if all(_is_iso(text) for text in texts):
        return extra, texts if any(texts) else None
    return {**extra, time: texts}, None


def _is_iso(text: str) -> bool:
    # "20250101" and the like are dates to Python, but rather numbers in a column of times
    if text and "-" not in text:
        return False
    try:
        return not text or datetime.fromisoformat(text) is not None
    except ValueError:
        return False


def _north(
    sheet: Sheet, meanings: Mapping[str, Meaning], column: str | None, needed: bool, given: str | None
) -> str | None:
    """The north of the azimuths, from its column, the name of the azimuths, or the caller; they may not disagree."""
    if given is not None and given not in REFERENCES:
        raise InputError(f"azimuth reference {given!r} is not known; allowed: {', '.join(REFERENCES)}")
    in_name = next((what.north for what in meanings.values() if what.north), None)
    stated = None if column is None else _one_north(sheet, column)
    if sheet.north is not None and sheet.north not in REFERENCES:
        raise sheet.error(f"azimuth reference is {sheet.north!r}; allowed: {', '.join(REFERENCES)}")
    found = list(dict.fromkeys(n for n in (stated, in_name, sheet.north, given) if n))
    if len(found) > 1:
        raise sheet.error(f"azimuths are said to be from {' and from '.join(found)} north; correct one of them")
    if needed and not found:
        allowed = ", ".join(REFERENCES)
        raise sheet.error(
            f"azimuths without a north; add a column azimuth_reference ({allowed}) or give --azimuth-reference"
        )
    return found[0] if found else None


def _one_north(sheet: Sheet, column: str) -> str | None:
    values = sheet.columns[column]
    texts = values if isinstance(values, tuple) else tuple(map(number, values.tolist()))
    first: str | None = None
    for row, text in enumerate(texts):
        north = text.strip().lower()
        if north and north not in REFERENCES:
            raise sheet.error(f"column {column!r} is {text!r}; allowed: {', '.join(REFERENCES)}", row)
        if first and north and north != first:
            raise sheet.error(f"the azimuths are from {first} north above and from {north} north here; use one", row)
        first = first or north or None
    return first


def _parts(sheet: Sheet, found: Mapping[str, Array], there: Collection[str], vendor: Convention) -> dict[str, Any]:
    """The arguments of SurveyFile from columns by key."""
    parts: dict[str, Any] = {}
    size = len(found["md"])
    for key, values in found.items():
        group, _, place = key.partition(".")
        if not place:
            parts[key] = values
        elif group in VECTORS:
            parts.setdefault(group, np.full((size, 3), np.nan))[:, int(place)] = values
        elif group == "covariance":
            i, j = map(int, place)
            matrix = parts.setdefault(group, np.full((size, 3, 3), np.nan))
            matrix[:, i, j] = matrix[:, j, i] = values
        else:
            parts.setdefault(group, {})[place] = values
    for group in (*VECTORS, "covariance"):
        lacking = [q.column for k, q in quantities().items() if k.startswith(f"{group}.") and k not in there]
        if group in parts and lacking:
            raise sheet.error(f"column {lacking[0]!r} is missing; a triad or covariance is given whole or not at all")
    for group in VECTORS:
        if group in parts:
            parts[group] = _to_native(parts[group], vendor.matrix(KINDS[group]))
    return parts


def _to_native(values: Array, matrix: Array) -> Array:
    """Components in tool axes; unknown where a component they are made of is unknown."""
    turned = np.nan_to_num(values) @ matrix.T + 0.0
    turned[np.isnan(values) @ (np.abs(matrix.T) > 1e-12)] = np.nan
    return np.asarray(turned)


def _doubts(g: Array | None, b: Array | None) -> tuple[str, ...]:
    """Fields of a strength the Earth has nowhere: the unit may be wrong, or the channels not calibrated."""
    notes = []
    for field_, name, low, high, unit in ((g, "gravity", 9.0, 10.6, "m/s^2"), (b, "magnetic field", 15e3, 90e3, "nT")):
        if field_ is None:
            continue
        strength = np.linalg.norm(field_, axis=1)
        if np.isfinite(strength).any() and not low <= (middle := float(np.nanmedian(strength))) <= high:
            notes.append(
                f"the {name} comes out at {middle:.5g} {unit} (median); the Earth's is {low:g} to {high:g}: is the "
                "unit in the header right, are the channels calibrated?"
            )
    return tuple(notes)

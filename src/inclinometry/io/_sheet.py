"""From the columns of any table to a survey: units, ranges, axes, norths; each refusal names its row."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inclinometry.attitude.conventions import Convention, named
from inclinometry.core.arrays import Array, Mask
from inclinometry.core.errors import FileError, InputError
from inclinometry.earth.site import REFERENCES
from inclinometry.io._quantities import EXTRA, Meaning, Quantity, meaning, quantities
from inclinometry.io._write import number
from inclinometry.io.columns import closest
from inclinometry.io.exchange import VECTORS, SurveyFile, first_not_increasing

Column: TypeAlias = Array | tuple[str, ...]
KINDS: Final = {"g": "accelerometer", "b": "magnetometer", "w": "gyro"}
_YES_NO: Final = {"1": True, "true": True, "yes": True, "y": True, "0": False, "false": False, "no": False, "n": False}


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


def survey_of(sheet: Sheet, *, convention: str = "house", azimuth_reference: str | None = None) -> SurveyFile:
    """The survey a table holds.

    Parameters
    ----------
    sheet : Sheet
    convention : str
        Axes and signs of the sensors in the file, as `attitude.conventions.named` knows them.
    azimuth_reference : {"magnetic", "true", "grid"}, optional
        Where the file does not say it.

    Raises
    ------
    FileError
        No depth or nothing besides it; a unit that is missing or unknown; two columns for one quantity, an incomplete
        triad; depths that do not increase; a value out of range; azimuths without, or with more than one, north.
    """
    vendor = named(convention)
    meanings = _meanings(sheet)
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


def _meanings(sheet: Sheet) -> dict[str, Meaning]:
    """What each column of the house's is; one column a quantity."""
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
    return meanings


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
    low, high = ((limit + side) * unit.factor + unit.offset for limit, side in
                 ((quantity.low, -slack), (quantity.high, slack)))  # fmt: skip
    bad = (turned < low) | (turned > high)
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
    for row, text in enumerate(texts):
        if text.strip().lower() not in _YES_NO:
            raise sheet.error(f"column {name!r} is {text!r}; allowed: 1, 0, true, false, yes, no", row)
    return np.array([_YES_NO[text.strip().lower()] for text in texts], dtype=np.bool_)


def _texts(
    sheet: Sheet, meanings: Mapping[str, Meaning], time: str | None
) -> tuple[dict[str, tuple[str, ...]], tuple[str, ...] | None]:
    """Columns the house does not read, as text, and the times; times that are not ISO 8601 are such a column."""
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
            parts[group] = _to_house(parts[group], vendor.matrix(KINDS[group]))
    return parts


def _to_house(values: Array, matrix: Array) -> Array:
    """Components in the house's axes; unknown where a component they are made of is unknown."""
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

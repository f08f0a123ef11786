"""From the columns of any table to a survey: units, ranges, axes, norths; each refusal names its row."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array, Mask, finite, frozen
from inclinometry.constants import ANGLES
from inclinometry.conventions import Convention, named
from inclinometry.earth.site import REFERENCES
from inclinometry.earth.site import REFERENCES as NORTHS
from inclinometry.errors import InputError
from inclinometry.files import writing
from inclinometry.files._quantities import EXTRA, Meaning, Quantity, from_si, meaning, quantities
from inclinometry.files.columns import closest
from inclinometry.files.frame import Column, Frame
from inclinometry.tabular import Column as TableColumn
from inclinometry.tabular import Tabular

VECTORS: Final = ("g", "b", "w")
"""Optional fields in tool axes, three numbers a station."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class SurveyFile(Tabular):
    """Stations of one well or run as a file of any format holds them; None, or NaN at a station, where it is silent.

    SI, rad; g (the field, down), b, w in tool axes: readers have mapped a format's own. md increases over the stations
    that are `used` (a repeated shot is not). toolface : gravity. reference : what was expected, or the correction
    between norths. covariance : of north, east, down, m^2, one standard deviation. sigma : standard uncertainty of an
    angle. valid : passed its checks. times : ISO 8601, "" where unknown. extra : other columns, as texts.
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
        toolfaces = ("toolface", "magnetic_toolface", "gyro_toolface")
        station = ("inclination", "azimuth", *toolfaces, "north", "east", "tvd", "temperature")
        for name in (*station, *VECTORS, "covariance"):
            shape = (size, 3, 3) if name == "covariance" else (size, 3) if name in VECTORS else (size,)
            value = getattr(self, name)
            keep[name] = None if value is None else frozen(_shaped(value, name, shape))
        axes = ("gx", "gy", "gz", "bx", "by", "bz")  # corrections are added to what was measured
        allowed = {
            "measured": ("g", "b", "dip", "earth_rate", "latitude", "dogleg_severity"),  # the last in rad/m
            "reference": ("g", "b", "dip", "declination", "convergence", "latitude", "earth_rate"),
            "corrections": (*axes, "sag_inclination", "sag_azimuth", "sensor_offset"),
            "sigma": ANGLES,
        }
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
        return {name: list(v) if isinstance(v, tuple) else v for name, v in columns_of(self).items()}


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

    >>> first_not_increasing(np.array([0.0, 30.0, 30.0])), first_not_increasing(np.array([0.0, 30.0]))
    (2, None)
    """
    rows = None if used is None else np.flatnonzero(used)
    depths = md if rows is None else md[rows]
    back = np.flatnonzero(depths[1:] <= depths[:-1])
    if not back.size:
        return None
    return int(back[0] + 1 if rows is None else rows[back[0] + 1])


KINDS: Final = {"g": "accelerometer", "b": "magnetometer", "w": "gyro"}


def survey_of(frame: Frame, *, convention: str = "native", azimuth_reference: str | None = None) -> SurveyFile:
    """The survey a table holds; `azimuth_reference` is for a file that does not state it."""
    vendor = named(convention)
    # what each column of the package's own is; one column a quantity
    meanings: dict[str, Meaning] = {}
    taken: dict[str, str] = {}
    for name in frame.columns:
        try:
            what = meaning(name, None, frame.columns.keys())
        except InputError as error:
            raise frame.error(str(error)) from None
        if what is None:
            continue
        if what.key in taken:
            raise frame.error(f"columns {taken[what.key]!r} and {name!r} both give {what.key}; remove one")
        taken[what.key] = name
        meanings[name] = what
    found: dict[str, Array] = {}
    for name, what in meanings.items():
        if what.unit is not None:
            values = _numbers(frame, name, what)
            # a column without a single value is a column that is not there
            if what.key == "md" or not np.isnan(values).all():
                found[what.key] = values
    texts = {what.key: name for name, what in meanings.items() if what.unit is None}
    if "md" not in found:
        near = closest("md_m", list(frame.columns))
        hint = f" (is it {near!r}?)" if near else ""
        raise frame.error(f"no depth; add a column md_m or md_ft{hint}; columns found: {frame.shown}")
    if len(found) == 1:
        raise frame.error(f"nothing besides the depth is known; columns found: {frame.shown}")
    flags = {key: _flags(frame, texts[key]) for key in ("used", "valid") if key in texts}
    _depths(frame, found["md"], flags.get("used"))
    extra, times = _texts(frame, meanings, texts.get("times"))
    north = _north(frame, meanings, texts.get("azimuth_reference"), "azimuth" in found, azimuth_reference)
    parts = _parts(frame, found, {what.key for what in meanings.values()}, vendor)
    return SurveyFile(
        **parts,
        azimuth_reference=north,
        used=flags.get("used"),
        valid=flags.get("valid"),
        times=times,
        extra=extra,
        header=dict(frame.header),
        notes=_doubts(parts.get("g"), parts.get("b")),
        digest=frame.digest,
    )


def _numbers(frame: Frame, name: str, what: Meaning) -> Array:
    """One column in SI, rad, nT or degC, within its range."""
    values, quantity = frame.columns[name], quantities()[what.key]
    if isinstance(values, tuple):
        row = next((i for i, text in enumerate(values) if text), 0)
        raise frame.error(f"{values[row]!r} in column {name!r} is not a number; correct it", row)
    if what.unit is None:
        return values
    infinite = np.isinf(values)
    if infinite.any():
        raise frame.error(f"column {name!r} is infinite; correct it or leave it empty", int(np.argmax(infinite)))
    turned = values if what.unit[1:] == (1.0, 0.0) else values * what.unit.factor + what.unit.offset
    _within(frame, name, values, turned, quantity)
    return turned


def _within(frame: Frame, name: str, values: Array, turned: Array, quantity: Quantity) -> None:
    unit = quantity.unit
    # a full turn in radians may exceed 360 deg by rounding
    slack = 1e-9 * max(abs(quantity.low), abs(quantity.high))
    bad = (turned < (quantity.low - slack) * unit.factor) | (turned > (quantity.high + slack) * unit.factor)
    if bad.any():
        row = int(np.argmax(bad))
        allowed = f"{quantity.low:g} to {quantity.high:g} {unit.label}"
        raise frame.error(f"column {name!r} is {values[row]:.10g}; allowed {allowed}: is the unit right?", row)


def _depths(frame: Frame, md: Array, used: Mask | None) -> None:
    if np.isnan(md).any():
        raise frame.error("the depth is empty; fill it in or remove the row", int(np.argmax(np.isnan(md))))
    row = first_not_increasing(md, used)
    if row is not None:
        last = int(np.flatnonzero(np.ones(row, bool) if used is None else used[:row])[-1])
        how = "repeats" if md[row] == md[last] else "is less than"
        problem = f"the depth {md[row]:.12g} m {how} {md[last]:.12g} m in {frame.word} {frame.lines[last]}"
        raise frame.error(f"{problem}; it must increase: sort the rows and keep one of each", row)


def _flags(frame: Frame, name: str) -> Mask | None:
    """A column of yes and no; None where it is all empty."""
    values = frame.columns[name]
    texts = texts_of(values)
    if not any(texts):
        return None
    yes_no = {"1": True, "true": True, "yes": True, "y": True, "0": False, "false": False, "no": False, "n": False}
    for row, text in enumerate(texts):
        if text.strip().lower() not in yes_no:
            raise frame.error(f"column {name!r} is {text!r}; allowed: 1, 0, true, false, yes, no", row)
    return np.array([yes_no[text.strip().lower()] for text in texts], dtype=np.bool_)


def _texts(
    frame: Frame, meanings: Mapping[str, Meaning], time: str | None
) -> tuple[dict[str, tuple[str, ...]], tuple[str, ...] | None]:
    """Columns that are not read, as text, and the times; times that are not ISO 8601 are such a column."""
    extra: dict[str, tuple[str, ...]] = {}
    for name, values in frame.columns.items():
        if name not in meanings:
            cells = texts_of(values)
            if any(cells):
                extra[frame.bare.get(name, name).removeprefix(EXTRA)] = cells
    if time is None:
        return extra, None
    texts = texts_of(frame.columns[time])
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
    frame: Frame, meanings: Mapping[str, Meaning], column: str | None, needed: bool, given: str | None
) -> str | None:
    """The north of the azimuths, from its column, the name of the azimuths, or the caller; they may not disagree."""
    if given is not None and given not in REFERENCES:
        raise InputError(f"azimuth reference {given!r} is not known; allowed: {', '.join(REFERENCES)}")
    in_name = next((what.north for what in meanings.values() if what.north), None)
    stated = None if column is None else _one_north(frame, column)
    if frame.north is not None and frame.north not in REFERENCES:
        raise frame.error(f"azimuth reference is {frame.north!r}; allowed: {', '.join(REFERENCES)}")
    found = list(dict.fromkeys(n for n in (stated, in_name, frame.north, given) if n))
    if len(found) > 1:
        raise frame.error(f"azimuths are said to be from {' and from '.join(found)} north; correct one of them")
    if needed and not found:
        allowed = ", ".join(REFERENCES)
        raise frame.error(
            f"azimuths without a north; add a column azimuth_reference ({allowed}) or give --azimuth-reference"
        )
    return found[0] if found else None


def _one_north(frame: Frame, column: str) -> str | None:
    values = frame.columns[column]
    texts = texts_of(values)
    first: str | None = None
    for row, text in enumerate(texts):
        north = text.strip().lower()
        if north and north not in REFERENCES:
            raise frame.error(f"column {column!r} is {text!r}; allowed: {', '.join(REFERENCES)}", row)
        if first and north and north != first:
            raise frame.error(f"the azimuths are from {first} north above and from {north} north here; use one", row)
        first = first or north or None
    return first


def _parts(frame: Frame, found: Mapping[str, Array], there: Collection[str], vendor: Convention) -> dict[str, Any]:
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
            raise frame.error(f"column {lacking[0]!r} is missing; a triad or covariance is given whole or not at all")
    for group in VECTORS:
        if group in parts:
            parts[group] = _turned(parts[group], vendor.matrix(KINDS[group]))
    return parts


def _turned(values: Array, matrix: Array) -> Array:
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


# From a survey to the columns of a table: names with units, numbers in them, texts; what is unknown is left out.


def columns_of(file: SurveyFile) -> dict[str, Column]:
    """All that a survey knows, as columns; a quantity without a single value has none.

    >>> list(columns_of(SurveyFile(md=[0, 30], g=[[0, 0, 9.8]] * 2, extra={"rig": ("A", "A")})))
    ['md_m', 'gx_m_s2', 'gy_m_s2', 'gz_m_s2', 'rig']
    """
    values, found = values_of(file), dict[str, Column]()
    for key, quantity in quantities().items():
        if key in values:
            found[quantity.column] = values[key]
        if key == "azimuth" and file.azimuth_reference is not None:
            found["azimuth_reference"] = (file.azimuth_reference,) * len(file)
    for name in ("used", "valid"):
        mask = getattr(file, name)
        if mask is not None:
            found[name] = tuple("1" if yes else "0" for yes in mask)
    if file.times is not None and any(file.times):
        found["time"] = tuple(file.times)
    return found | {_extra_name(name): tuple(cells) for name, cells in file.extra.items()}


def values_of(file: SurveyFile) -> dict[str, Array]:
    """Key of a quantity -> values in the unit of its column, of every quantity that has one at some station."""
    found: dict[str, Array] = {}
    for key, quantity in quantities().items():
        group, _, place = key.partition(".")
        value = getattr(file, group)
        if isinstance(value, Mapping):
            value = value.get(place)
        # a triad or covariance is there whole or not at all
        if value is not None and not np.isnan(value).all():
            values = value if value.ndim == 1 else value[(slice(None), *map(int, place))]
            found[key] = from_si(np.asarray(values), quantity)
    return found


def _extra_name(name: str) -> str:
    """A name under which the column is not taken for one of the package's when it is read."""
    try:
        taken = meaning(name) is not None or name.startswith(EXTRA)
    except InputError:
        taken = True
    return f"{EXTRA}{name}" if taken else name


def texts_of(column: Column) -> tuple[str, ...]:
    """Numbers as the shortest text that reads back the same, texts as they are."""
    return column if isinstance(column, tuple) else tuple(writing.column(column))


# From tool axes to those of a file, for the writers; the reverse is done where columns are read.


def to_vendor(file: SurveyFile, convention: str) -> SurveyFile:
    """The survey with its vectors, and their corrections, in a vendor's axes and signs.

    >>> to_vendor(SurveyFile(md=[9.0], g=[[1.0, 2.0, 9.0]]), "iscwsa").g
    array([[-2.,  1.,  9.]])
    """
    vendor = named(convention)
    # the matrix is orthogonal: its transpose leads back
    parts: dict[str, Any] = {
        name: _turned(getattr(file, name), vendor.matrix(KINDS[name]).T)
        for name in VECTORS
        if getattr(file, name) is not None
    }
    return replace(file, corrections=corrections_to_native(file.corrections, vendor, back=True), **parts)


def corrections_to_native(
    corrections: Mapping[str, Array], vendor: Convention, *, back: bool = False
) -> dict[str, Array]:
    """Corrections in tool axes from those in the vendor's, or `back`."""
    found = dict(corrections)
    for vector_of, names in {"g": ("gx", "gy", "gz"), "b": ("bx", "by", "bz")}.items():
        matrix = vendor.matrix(KINDS[vector_of])
        given = [corrections[name] for name in names if name in corrections]
        if given:
            absent = np.zeros(given[0].shape)  # one that is not stated is no correction
            vector = np.stack([corrections.get(name, absent) for name in names], axis=1)
            for name, values in zip(names, _turned(vector, matrix.T if back else matrix).T, strict=True):
                if name in found or np.nan_to_num(values).any():
                    found[name] = values
    return found

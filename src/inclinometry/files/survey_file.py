"""From the columns of any table to a survey: units, ranges, axes, norths; each refusal names its row."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
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
from inclinometry.errors import InputError, not_among, out_of_order, refused, wrong_kind, wrong_shape
from inclinometry.files import writing
from inclinometry.files._quantities import (
    EXTRA,
    Meaning,
    Quantity,
    columns_called,
    from_si,
    meaning,
    quantities,
)
from inclinometry.files.columns import closest
from inclinometry.files.frame import Column, Frame
from inclinometry.findings import Finding, Value
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
    findings: tuple[Finding, ...] = ()
    digest: str = ""

    def __post_init__(self) -> None:
        size = len(finite(self.md, "md", (None,)))
        if not size:
            raise refused("input-few", {"name": "stations", "count": 0, "least": 1})
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
                values = {"names": tuple(f"{name}.{one}" for one in unknown), "known": names}
                raise refused("input-unknown", values)
            spread = {k: np.full(size, v, dtype=np.float64) if np.ndim(v) == 0 else v for k, v in values.items()}
            keep[name] = MappingProxyType({k: frozen(_shaped(v, f"{name} {k}", (size,))) for k, v in spread.items()})
        for name, texts in (("times", self.times), *self.extra.items()):
            if texts is not None and len(texts) != size:
                raise wrong_shape(name, (len(texts),), f"({size},)")
        if self.azimuth_reference not in (None, *NORTHS) or (self.azimuth is not None and not self.azimuth_reference):
            raise not_among("azimuth_reference", str(self.azimuth_reference), NORTHS)
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
    except (TypeError, ValueError):
        raise wrong_kind(name, str(value)[:60], "array of numbers") from None
    if array.shape != shape:
        raise wrong_shape(name, array.shape, str(shape))
    if np.isinf(array).any():
        raise refused("input-finite", {"name": name})
    return array


def _increasing(md: Array, used: Mask | None) -> None:
    rows = first_not_increasing(md, used)
    if rows is not None:
        raise out_of_order("md", float(md[rows[1]]), float(md[rows[0]]), rows[1] + 1)


def first_not_increasing(md: Array, used: Mask | None = None) -> tuple[int, int] | None:
    """Indices of the first two used stations in a row of which the second is not deeper, or None.

    >>> first_not_increasing(np.array([0.0, 30.0, 30.0])), first_not_increasing(np.array([0.0, 30.0]))
    ((1, 2), None)
    """
    rows = np.arange(len(md)) if used is None else np.flatnonzero(used)
    back = np.flatnonzero(np.diff(md[rows]) <= 0.0)
    return (int(rows[back[0]]), int(rows[back[0] + 1])) if back.size else None


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
            if columns_called(name) == ("dls_deg_30m",):
                continue  # it is computed from the angles
            raise frame.error(error.finding) from None
        if what is None:
            continue
        if what.key in taken:
            raise frame.error(Finding("table-same", {"columns": (taken[what.key], name)}))
        taken[what.key] = name
        meanings[name] = what
    frame = frame.downwards(taken.get("md"))
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
        raise frame.error(Finding("table-near", {"name": near, "right": "md_m"}) if near else frame.lacking("md_m"))
    if len(found) == 1:
        raise frame.error(Finding("table-depth-only", {"present": frame.names[:20]}))
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
        findings=(*frame.findings, *_strengths(parts.get("g"), parts.get("b"))),
        digest=frame.digest,
    )


def _numbers(frame: Frame, name: str, what: Meaning) -> Array:
    """One column in SI, rad, nT or degC, within its range."""
    values, quantity = frame.columns[name], quantities()[what.key]
    if isinstance(values, tuple):
        row = next((i for i, text in enumerate(values) if text), 0)
        raise frame.error(Finding("input-kind", {"name": name, "value": values[row], "expected": "number"}), row)
    if what.unit is None:
        return values
    infinite = np.isinf(values)
    if infinite.any():
        raise frame.error(Finding("input-finite", {"name": name}), int(np.argmax(infinite)))
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
        allowed = f"{quantity.low:g} .. {quantity.high:g} {unit.label}"
        value = float(values[row])
        raise frame.error(Finding("input-value", {"name": name, "value": value, "allowed": allowed}), row)


def _depths(frame: Frame, md: Array, used: Mask | None) -> None:
    if np.isnan(md).any():
        raise frame.error(Finding("table-empty", {"column": "md"}), int(np.argmax(np.isnan(md))))
    rows = first_not_increasing(md, used)
    if rows is not None:
        before, row = rows
        wrong = out_of_order("md", float(md[row]), float(md[before]), int(row) + 1)
        raise frame.error(wrong.finding, row)


def _flags(frame: Frame, name: str) -> Mask | None:
    """A column of yes and no; None where it is all empty."""
    values = frame.columns[name]
    texts = texts_of(values)
    if not any(texts):
        return None
    yes_no = {"1": True, "true": True, "yes": True, "y": True, "0": False, "false": False, "no": False, "n": False}
    for row, text in enumerate(texts):
        if text.strip().lower() not in yes_no:
            allowed = "1, 0, true, false, yes, no"
            raise frame.error(Finding("input-value", {"name": name, "value": text, "allowed": allowed}), row)
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
        raise not_among("azimuth_reference", given, REFERENCES)
    in_name = next((what.north for what in meanings.values() if what.north), None)
    stated = None if column is None else _one_north(frame, column)
    if frame.north is not None and frame.north not in REFERENCES:
        raise frame.error(_no_north("azimuth_reference", frame.north))
    found = list(dict.fromkeys(n for n in (stated, in_name, frame.north, given) if n))
    if len(found) > 1:
        raise frame.error(Finding("input-north", {"norths": tuple(found)}))
    if needed and not found:
        raise frame.error(Finding("table-north", {"allowed": REFERENCES}))
    return found[0] if found else None


def _no_north(column: str, text: str) -> Finding:
    return Finding("input-value", {"name": column, "value": text, "allowed": ", ".join(REFERENCES)})


def _one_north(frame: Frame, column: str) -> str | None:
    values = frame.columns[column]
    texts = texts_of(values)
    first: str | None = None
    for row, text in enumerate(texts):
        north = text.strip().lower()
        if north and north not in REFERENCES:
            raise frame.error(_no_north(column, text), row)
        if first and north and north != first:
            raise frame.error(Finding("input-north", {"norths": (first, north)}), row)
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
            raise frame.error(frame.lacking(*lacking))
    for group in VECTORS:
        if group in parts:
            parts[group] = _turned(parts[group], vendor.matrix(KINDS[group]))
    return parts


def _turned(values: Array, matrix: Array) -> Array:
    """Components in tool axes; unknown where a component they are made of is unknown."""
    turned = np.nan_to_num(values) @ matrix.T + 0.0
    turned[np.isnan(values) @ (np.abs(matrix.T) > 1e-12)] = np.nan
    return np.asarray(turned)


def _strengths(g: Array | None, b: Array | None) -> Iterator[Finding]:
    """Fields of a strength the Earth has nowhere: the unit may be wrong, or the channels not calibrated."""
    for vectors, quantity, si, low, high in (
        (g, "gravity", "m/s2", 9.0, 10.6),
        (b, "magnetic field", "nT", 15e3, 90e3),
    ):
        median = _median(vectors)
        if not low <= median <= high and not np.isnan(median):
            usual: dict[str, Value] = {"quantity": quantity, "si": si, "low": low, "high": high}
            yield Finding("table-total", usual | {"median": median})


def _median(vectors: Array | None) -> float:
    """Of the strengths; NaN where there are none."""
    strength = np.empty(0) if vectors is None else np.linalg.norm(vectors, axis=1)
    return float(np.nanmedian(strength)) if np.isfinite(strength).any() else np.nan


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

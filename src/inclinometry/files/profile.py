"""A profile: how the file of another instrument or program becomes the package's columns, stated once in TOML."""

from __future__ import annotations

import codecs
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, NamedTuple

from inclinometry.conventions import named
from inclinometry.errors import FileError, InputError, in_file, not_among, out_of_range, refused, wrong_kind
from inclinometry.files._quantities import (
    channel_in_counts,
    dimension_of,
    meaning,
    quantities,
    same_unit,
    seconds_of,
    unit_factor,
)
from inclinometry.files.columns import KIND_PREFIX, PREFIXES, TEXT, UNIT_LABELS, channel, is_number, spelled
from inclinometry.files.toml_keys import Settings, parsed
from inclinometry.opening import LARGEST_SETTINGS, damaged, not_text, whole

USUAL_UNITS: Final = ("m", "ft", "deg", "rad", "g", "mg", "nT", "uT", "gauss", "degC", "counts")
"""Units that a profile or --units usually states."""

ENCODINGS: Final = ("utf-8", "cp1251", "cp866", "koi8-r", "gb18030", "cp1252")
"""Encodings that a profile usually states."""

SEPARATORS: Final = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}


class Reading(NamedTuple):
    """A column as the package takes it: name here, value here = factor * value there + offset, north by its name."""

    name: str
    factor: float = 1.0
    offset: float = 0.0
    north: str | None = None


@dataclass(frozen=True)
class Profile:
    """How a file is laid out and what its columns are; a column goes by its name in the file, or its number from 1.

    separator : " " is any number of blanks; None where the names show it. skip : lines before the names or first row.
    columns : -> name here, with its unit ("accel_x_mg"); "" leaves it out. given : -> unit, where the name has another.
    blank : -> what an empty cell says ("-9999"); null : the same for all. units : of columns without, one a dimension.
    sheet : of a workbook. encoding : of a text. deleted : column -> its texts in rows that are left out. second_row :
    cells of a row that follows another and is left out: of a second set of sensors. prefix : of the rows, other lines
    are left out.
    axes : kind -> axis of the file ("-x") for x, y, z of the tool. constants : columns the file lacks -> their value.
    """

    title: str = ""
    separator: str | None = None
    skip: int = 0
    header: bool = True
    units_row: bool = False
    columns: Mapping[str, str] = field(default_factory=dict)
    given: Mapping[str, str] = field(default_factory=dict)
    units: tuple[str, ...] = ()
    axes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rate_hz: float | None = None
    constants: Mapping[str, float | str] = field(default_factory=dict)
    blank: Mapping[str, str] = field(default_factory=dict)
    roll_sets: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    null: float | None = None
    sheet: str | None = None
    deleted: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    second_row: int = 0
    prefix: str = ""
    encoding: str | None = None

    @property
    def lays_out(self) -> bool:
        """Whether more than the names of the columns differs from a plain table."""
        plain = Profile(
            self.title, columns=self.columns, given=self.given, units=self.units, axes=self.axes, null=self.null
        )
        return (
            self != replace(plain, roll_sets=self.roll_sets, sheet=self.sheet, encoding=self.encoding)
            or "" in self.columns.values()
        )

    @property
    def states_layout(self) -> bool:
        """Whether it says how the lines are cut; else that is found."""
        return self.separator is not None or bool(self.skip) or not self.header or self.units_row

    def key_of(self, name: str) -> str:
        """The name of a column in the profile: its own, its number, or one that differs in capitals alone."""
        bare = name.removeprefix("column ")
        alike = [key for key in self.columns if key.casefold() == bare.casefold()]
        return name if name in self.columns else alike[0] if len(alike) == 1 else bare

    def reading(self, name: str, numeric: Callable[[str], bool], beside: Collection[str] = ()) -> Reading:
        """What the column `name` is, `beside` others, for a reader that takes `numeric` names as numbers.

        Raises
        ------
        InputError
            A unit that is not known, of something else, or that contradicts the profile; a name that may be two things.
        """
        key = self.key_of(name)
        if key in self.columns:
            self.check_unit(name, stated_unit(name), key)
            return self._turned(_converted(self.columns[key], self.given.get(key)))
        plain = name if numeric(name) else spelled(name)
        if numeric(plain) or plain in TEXT:
            return self._turned(Reading(plain))
        if numeric("time_s") and (factor := seconds_of(name, self.units)) is not None:
            return Reading("time_s", factor)
        counts = channel_in_counts(name, self.units, beside)
        if counts is not None and numeric(counts):
            return self._turned(Reading(counts))
        found = {r for stated in (None, *self.units) if (r := self._known(name, stated, numeric)) is not None}
        if len(found) > 1:
            readings = tuple(sorted(reading.name for reading in found))
            raise refused("table-ambiguous", {"column": name, "readings": readings})
        return self._turned(found.pop()) if found else Reading(name)

    def check_unit(self, name: str, stated: str | None, key: str) -> None:
        """InputError where the file states a unit of a column that the profile contradicts."""
        here = self.given.get(key) or _own_unit(self.columns[key])
        if stated and here and not same_unit(stated, here):
            raise refused("table-units", {"column": name, "units": (stated, here)})

    def _known(self, name: str, stated: str | None, numeric: Callable[[str], bool]) -> Reading | None:
        """A column by the vocabulary of survey files, its unit in its name or stated for all of its dimension."""
        try:
            what = meaning(name, stated)
        except InputError:
            return None
        if what is None or what.unit is None:
            return None
        quantity = quantities()[what.key]
        if stated is not None and dimension_of(stated) != quantity.dimension:
            return None
        if numeric(quantity.column):
            own = quantity.unit.factor
            return Reading(quantity.column, what.unit.factor / own, what.unit.offset / own, what.north)
        group, _, axis = what.key.partition(".")
        kind = {"g": "accel", "b": "mag", "w": "gyro"}.get(group)
        if kind is None or axis not in ("0", "1", "2"):
            return None
        start = f"{kind}_{'xyz'[int(axis)]}"
        suffix = {label.replace("^", ""): end for end, label in UNIT_LABELS.items()}.get(what.unit.label)
        if suffix is not None and numeric(f"{start}_{suffix}"):
            return Reading(f"{start}_{suffix}")
        return Reading(f"{start}_nT", what.unit.factor) if group == "b" and numeric(f"{start}_nT") else None

    def _turned(self, found: Reading) -> Reading:
        """The same under the axis of the tool, with its sign."""
        if not self.axes:
            return found
        signal = channel(found.name)
        if signal is not None and signal.kind in self.axes and signal.axis in "xyz":
            place, sign = self._place(signal.kind, signal.axis)
            start = f"{KIND_PREFIX[signal.kind]}_"
            name = found.name.replace(start + signal.axis, start + "xyz"[place], 1)
            sign = 1.0 if signal.sd else sign
            return Reading(name, sign * found.factor, sign * found.offset)
        try:
            what = None if signal is not None else meaning(found.name)
        except InputError:
            what = None
        group, _, axis = ("", "", "") if what is None else what.key.partition(".")
        kind = {"g": "accelerometer", "b": "magnetometer", "w": "gyro"}.get(group, "")
        if what is None or what.unit is None or kind not in self.axes or axis not in ("0", "1", "2"):
            return found
        place, sign = self._place(kind, "xyz"[int(axis)])
        quantity = quantities()[f"{group}.{place}"]
        return Reading(quantity.column, sign * found.factor * what.unit.factor / quantity.unit.factor)

    def _place(self, kind: str, axis: str) -> tuple[int, float]:
        """The tool's axis that lies along this axis of the file, and its sign."""
        axes = self.axes[kind]
        place = next(k for k, found in enumerate(axes) if found[-1] == axis)
        return place, -1.0 if axes[place].startswith("-") else 1.0


def stated_unit(name: str) -> str | None:
    """The unit a name of the file states."""
    try:
        what = meaning(name)
    except InputError:
        return None
    return what.unit.label if what is not None and what.unit is not None else None


def with_unit(name: str, unit: str | None) -> str:
    """The name with the unit that stands apart from it, unless it says it itself.

    Raises
    ------
    InputError
        Name and unit contradict each other; a unit of a channel that is not known.
    """
    own = _own_unit(name) or stated_unit(name)
    if not unit or (own is None and channel(name) is None and describes(name)):
        return name
    if own is not None:
        if not same_unit(own, unit) and dimension_of(unit) is not None:
            raise refused("table-units", {"column": name, "units": (own, unit)})
        return name
    if channel(name) is None:
        return f"{name} ({unit})"
    plain = unit if dimension_of(unit) else unit.lower()
    found = next((end for end in UNIT_LABELS if same_unit(end, unit) or plain == end.lower()), None)
    if found is None:
        raise refused("table-unit", {"column": name, "unit": unit, "allowed": tuple(UNIT_LABELS.values())})
    return name if found == "counts" else f"{name.removesuffix('_sd')}_{found}{'_sd' * name.endswith('_sd')}"


def _own_unit(name: str) -> str | None:
    """The unit a name of the package states."""
    signal = channel(name)
    if signal is not None:
        return None if signal.unit == "counts" else name.removesuffix("_sd").split("_", 2)[2]
    return next((end for end in ("deg", "m", "ft", "degC", "nT", "s", "m_s2") if name.endswith(f"_{end}")), None)


def _converted(name: str, unit: str | None) -> Reading:
    """A column named here, from the unit it has in the file."""
    if unit is None:
        return Reading(name)
    own = _own_unit(name)
    if own is None:
        raise refused("table-unit-missing", {"name": name, "right": (f"{name}_{unit}",)})
    factor, offset = unit_factor(unit, own)
    return Reading(name, factor, offset)


PLAIN: Final = Profile()
_CURRENT: ContextVar[Profile] = ContextVar("profile", default=PLAIN)
_USED: ContextVar[list[str] | None] = ContextVar("used", default=None)


def current() -> Profile:
    """The profile tables are read with now."""
    used = _USED.get()
    if used is not None:
        used.append("read")
    return _CURRENT.get()


@contextmanager
def reading_with(
    profile: Profile | str | Path | None,
    units: str | None = None,
    null: float | None = None,
    sheet: str | None = None,
) -> Iterator[list[str]]:
    """Tables opened within are read with this profile; yields a list that is empty until one has been.

    A number that is declared `null` stands for an empty cell; `sheet` is that of a workbook, survey or trajectory.

    Examples
    --------
    >>> import tempfile
    >>> from inclinometry.files.table import read_table
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.txt").write_text("MD INC\\n100 1.5\\n")
    ...     with reading_with(Profile(separator=" "), "ft,deg"):
    ...         table = read_table(Path(folder, "a.txt"))
    >>> table.number("md_m"), table.number("inclination_deg")
    (array([30.48]), array([1.5]))
    """
    found = _CURRENT.get() if profile is None else profile if isinstance(profile, Profile) else read_profile(profile)
    if units is not None:
        words = tuple(word.strip() for word in units.split(",") if word.strip())
        for word in words:
            if dimension_of(word) is None:
                raise not_among("--units", word, USUAL_UNITS)
        found = replace(found, units=(*words, *found.units))
    if null is not None:
        found = replace(found, null=null)
    if sheet is not None:
        found = replace(found, sheet=sheet)
    # within another one, that one was of use as well
    outer = _USED.get()
    used: list[str] = [] if outer is None else outer
    tokens = _CURRENT.set(found), _USED.set(used)
    try:
        yield used
    finally:
        _CURRENT.reset(tokens[0])
        _USED.reset(tokens[1])


def with_constants(**constants: float | str) -> Profile:
    """The profile tables are read with now, and a column with one value for each name.

    >>> dict(with_constants(azimuth_reference="true").constants)
    {'azimuth_reference': 'true'}
    """
    found = _CURRENT.get()
    return replace(found, constants={**found.constants, **constants})


def shipped() -> tuple[str, ...]:
    """Names of the profiles that come with the package.

    >>> "sap6" in shipped()
    True
    """
    folder = files("inclinometry.files") / "profiles"
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")))


def read_profile(name: str | Path) -> Profile:
    """A profile that is shipped, by its name, or one's own, by its file."""
    path = Path(name)
    if str(name) in shipped():
        text = (files("inclinometry.files") / "profiles" / f"{name}.toml").read_text(encoding="utf-8")
    elif path.suffix.lower() != ".toml":
        raise not_among("profile", str(name), (*shipped(), "*.toml"))
    else:
        try:
            text = whole(path, LARGEST_SETTINGS).decode("utf-8")
        except UnicodeDecodeError as error:
            raise FileError(not_text("utf-8", error.reason), path=path) from None
    try:
        return _profile(Settings(path, parsed(text), _TYPES).content)
    except FileError:
        raise
    except InputError as error:
        raise in_file(error, path) from None
    except tomllib.TOMLDecodeError as error:
        raise FileError(damaged("TOML", error), path=path) from None


_TYPES: Final[Mapping[str, type | tuple[type, ...]]] = {
    "title": str, "separator": str, "skip": int, "header": bool, "units_row": bool, "columns": dict, "units": list,
    "axes": dict, "convention": str, "rate_hz": (int, float), "constants": dict, "roll_sets": dict,
    "null": (int, float), "sheet": str,
    "deleted": dict, "second_row": int, "encoding": str, "prefix": str,
}  # fmt: skip


def _profile(content: dict[str, Any]) -> Profile:
    for key, value in content.items():
        wanted = _TYPES[key]
        if not isinstance(value, wanted) or (isinstance(value, bool) and wanted is not bool):
            raise wrong_kind(key, str(value), _KINDS.get(wanted, "number"))
    separator = content.get("separator")
    if separator is not None and separator not in SEPARATORS:
        raise not_among("separator", separator, SEPARATORS)
    if content.get("skip", 0) < 0:
        raise out_of_range("skip", content["skip"], ">= 0")
    rate = content.get("rate_hz")
    if rate is not None and not 0.0 < rate < 1e6:
        raise out_of_range("rate_hz", rate, "> 0, < 1e6")
    try:
        codecs.lookup(content.get("encoding", "utf-8"))
    except LookupError:
        raise not_among("encoding", content["encoding"], ENCODINGS) from None
    columns, given, blank = _columns(content.get("columns", {}))
    units = tuple(map(str, content.get("units", [])))
    for unit in units:
        if dimension_of(unit) is None:
            raise not_among("units", unit, USUAL_UNITS)
    return Profile(
        title=content.get("title", ""),
        separator=None if separator is None else SEPARATORS[separator],
        skip=content.get("skip", 0),
        header=content.get("header", True),
        units_row=content.get("units_row", False),
        columns=columns,
        given=given,
        units=units,
        axes=_axes(content),
        rate_hz=None if rate is None else float(rate),
        constants=_constants(content.get("constants", {})),
        blank=blank,
        roll_sets=_roll_sets(content.get("roll_sets", {})),
        null=None if "null" not in content else float(content["null"]),
        sheet=content.get("sheet"),
        deleted={name: tuple(map(str, texts)) for name, texts in content.get("deleted", {}).items()},
        second_row=content.get("second_row", 0),
        prefix=content.get("prefix", ""),
        encoding=content.get("encoding"),
    )


def _columns(entries: dict[str, Any]) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
    """Names here, units there, and what an empty cell says, by the name in the file."""
    columns: dict[str, str] = {}
    given: dict[str, str] = {}
    blank: dict[str, str] = {}
    for name, entry in entries.items():
        here = entry.get("name") if isinstance(entry, dict) else entry
        if not isinstance(here, str) or (isinstance(entry, dict) and set(entry) - {"name", "unit", "blank"}):
            pattern = '{ name = "mag_x_nT", unit = "gauss", blank = "-9999" }'
            raise _entry(f"columns.{name}", entry, pattern)
        columns[name] = here
        if isinstance(entry, dict) and "unit" in entry:
            given[name] = str(entry["unit"])
        if isinstance(entry, dict) and "blank" in entry:
            blank[name] = str(entry["blank"])
        _converted(here, given.get(name))
    return columns, given, blank


def _constants(content: dict[str, Any]) -> dict[str, float | str]:
    for name, value in content.items():
        if isinstance(value, bool) or not isinstance(value, str | int | float) or value != value:
            raise wrong_kind(f"constants.{name}", str(value), "number")
    return {name: value if isinstance(value, str) else float(value) for name, value in content.items()}


def _roll_sets(content: dict[str, Any]) -> dict[str, tuple[int, int]]:
    """First and last row of each set, one after the other."""
    before = 0
    for name, rows in content.items():
        if not isinstance(rows, list) or [type(row) for row in rows] != [int, int] or not before < rows[0] < rows[1]:
            raise _entry(f"roll_sets.{name}", rows, f"[{before + 1}, {before + 8}]")
        before = rows[1]
    return {name: (first, last) for name, (first, last) in content.items()}


def _entry(name: str, value: object, pattern: str) -> InputError:
    return refused("table-profile-entry", {"name": name, "value": str(value), "pattern": pattern})


_KINDS: Final[Mapping[object, str]] = {
    str: "text", int: "whole number", bool: "true or false", dict: "table", list: "list",
}  # fmt: skip


def _axes(content: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    """From the three axes of each kind, or from a named convention."""
    found: dict[str, tuple[str, ...]] = {}
    if "convention" in content and "axes" in content:
        raise refused("input-one-of", {"names": ("convention", "axes")})
    if "convention" in content:
        vendor = named(content["convention"])
        for kind in PREFIXES.values():
            # rows of the matrix: the tool's axes in the file's
            rows = vendor.matrix(kind)
            found[kind] = tuple(("-" if row.min() < 0 else "") + "xyz"[int(abs(row).argmax())] for row in rows)
    for prefix, axes in content.get("axes", {}).items():
        kind = PREFIXES.get(prefix, prefix)
        letters = [str(axis).removeprefix("+").removeprefix("-") for axis in axes] if isinstance(axes, list) else []
        if kind not in PREFIXES.values() or sorted(letters) != ["x", "y", "z"]:
            raise _entry(f"axes.{prefix}", axes, '["y", "-x", "z"]')
        found[kind] = tuple(str(axis).removeprefix("+") for axis in axes)
    return found


def describes(name: str) -> bool:
    """Whether a name is one of the package's own columns."""
    return is_number(name) or name in TEXT

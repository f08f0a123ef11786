"""A profile: how the file of another instrument or program becomes the package's columns, stated once in TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, NamedTuple

from inclinometry.conventions import named
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import dimension_of, meaning, quantities, unit_factor
from inclinometry.files.columns import KIND_PREFIX, PREFIXES, TEXT, UNIT_LABELS, channel, closest, is_number

SEPARATORS: Final = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}


class Reading(NamedTuple):
    """A column as the package takes it: its name here, and value here = factor * value there + offset."""

    name: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Profile:
    """How a file is laid out and what its columns are.

    separator : "," or ";" or a tab or a blank (any number of them); None where the line of names tells.
    skip : lines before the names (or before the first row, where there are no names).
    header : whether there is a line of names; columns are numbered from 1 otherwise.
    units_row : whether a line of units follows the names.
    columns : name or number in the file -> name here, with its unit ("accel_x_mg"); "" for a column to be left out.
    given : name or number in the file -> unit it is in, where the name here has another.
    units : units of columns that state none, one a dimension ("ft", "deg", "gauss", "mg").
    axes : kind of sensor -> for x, y, z of the tool, the axis of the file with its sign ("y", "-x", "z").
    rate_hz : rows a second, where the file has no time.
    constants : columns the file lacks -> their one value.
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

    @property
    def lays_out(self) -> bool:
        """Whether more than the names of the columns differs from a plain table."""
        plain = Profile(self.title, columns=self.columns, given=self.given, units=self.units, axes=self.axes)
        return self != plain or "" in self.columns.values()

    def reading(self, name: str, numeric: Callable[[str], bool]) -> Reading:
        """What the column `name` is for a reader that takes `numeric` names as numbers.

        Raises
        ------
        InputError
            A unit that is not known, or of something else.
        """
        key = name if name in self.columns else name.removeprefix("column ")
        if key in self.columns:
            found = _converted(self.columns[key], self.given.get(key))
            stated = None if key in self.given else self._known(name, numeric)
            if stated is not None and stated.name == found.name and stated[1:] != found[1:]:
                raise InputError(
                    f"column {name!r} states a unit that the profile's {found.name} is not in; "
                    "leave the column out of the profile, or give its unit there"
                )
            return self._turned(found)
        if numeric(name) or name in TEXT:
            return self._turned(Reading(name))
        known = self._known(name, numeric)
        return Reading(name) if known is None else self._turned(known)

    def _known(self, name: str, numeric: Callable[[str], bool]) -> Reading | None:
        """A column by the vocabulary of survey files, where its unit is in its name or stated for its dimension."""
        for stated in (None, *self.units):
            try:
                what = meaning(name, stated)
            except InputError:
                continue
            if what is None or what.unit is None:
                continue
            quantity = quantities()[what.key]
            group, _, axis = what.key.partition(".")
            kind = {"g": "accel", "b": "mag", "w": "gyro"}.get(group)
            if numeric(quantity.column):
                own = quantity.unit
                return Reading(
                    quantity.column, what.unit.factor / own.factor, (what.unit.offset - own.offset) / own.factor
                )
            if kind is not None and axis in ("0", "1", "2"):
                start = f"{kind}_{'xyz'[int(axis)]}"
                suffix = {label.replace("^", ""): end for end, label in UNIT_LABELS.items()}.get(what.unit.label)
                if suffix is not None and numeric(f"{start}_{suffix}"):
                    return Reading(f"{start}_{suffix}")
                if numeric(f"{start}_nT") and group == "b":
                    return Reading(f"{start}_nT", what.unit.factor)
        return None

    def _turned(self, found: Reading) -> Reading:
        """The same under the axis of the tool, with its sign."""
        signal = channel(found.name)
        axes = self.axes.get(signal.kind) if signal is not None else None
        if signal is None or axes is None or signal.axis not in "xyz":
            return found
        place = next(k for k, axis in enumerate(axes) if axis[-1] == signal.axis)
        sign = -1.0 if axes[place].startswith("-") and not signal.sd else 1.0
        start = f"{KIND_PREFIX[signal.kind]}_"
        name = found.name.replace(start + signal.axis, start + "xyz"[place], 1)
        return Reading(name, sign * found.factor, sign * found.offset)


def _converted(name: str, unit: str | None) -> Reading:
    """A column named here, from the unit it has in the file."""
    if unit is None:
        return Reading(name)
    signal = channel(name)
    own = (
        UNIT_LABELS[name.removesuffix("_sd").split("_", 2)[2]]
        if signal is not None and signal.unit != "counts"
        else None
    )
    if own is None:
        own = next((end for end in ("deg", "m", "ft", "degC", "nT", "s") if name.endswith(f"_{end}")), None)
    if own is None:
        raise InputError(f"{name!r} states no unit; {unit!r} cannot be converted into it: give the name with its unit")
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
def reading_with(profile: Profile | str | Path | None, units: str | None = None) -> Iterator[list[str]]:
    """Tables opened within are read with this profile; yields a list that is empty until one has been.

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
                raise InputError(
                    f"unit {word!r} is not known; give units such as m, ft, deg, rad, g, mg, nT, uT, gauss, degC"
                )
        found = replace(found, units=(*words, *found.units))
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

    Examples
    --------
    >>> dict(with_constants(azimuth_reference="true").constants)
    {'azimuth_reference': 'true'}
    """
    found = _CURRENT.get()
    return replace(found, constants={**found.constants, **constants})


def shipped() -> tuple[str, ...]:
    """Names of the profiles that come with the package.

    Examples
    --------
    >>> "sap6" in shipped()
    True
    """
    folder = files("inclinometry.files") / "profiles"
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")))


def read_profile(name: str | Path) -> Profile:
    """A profile that is shipped, by its name, or one's own, by its file.

    Raises
    ------
    FileError
        No such profile or file; a key, column, unit or axis that is not known, with the allowed ones.

    Examples
    --------
    >>> read_profile("mpu").rate_hz
    100.0
    """
    path = Path(name)
    if str(name) in shipped():
        text = (files("inclinometry.files") / "profiles" / f"{name}.toml").read_text(encoding="utf-8")
    elif path.suffix.lower() != ".toml":
        raise InputError(f"profile {str(name)!r} is not known; shipped: {', '.join(shipped())}, or give a .toml file")
    else:
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            raise FileError("there is no such file; check the name", path=path) from None
        except (OSError, UnicodeDecodeError) as error:
            raise FileError(f"cannot be read ({error})", path=path) from None
    try:
        return _profile(tomllib.loads(text))
    except (InputError, tomllib.TOMLDecodeError) as error:
        raise FileError(str(error), path=path) from None


_TYPES: Final[Mapping[str, type | tuple[type, ...]]] = {
    "title": str, "separator": str, "skip": int, "header": bool, "units_row": bool, "columns": dict, "units": list,
    "axes": dict, "convention": str, "rate_hz": (int, float), "constants": dict,
}  # fmt: skip


def _profile(content: dict[str, Any]) -> Profile:
    for key, value in content.items():
        if key not in _TYPES:
            near = closest(key, list(_TYPES))
            raise InputError(
                f"key {key!r} is not known; {f'did you mean {near}?' if near else ''} allowed: {', '.join(_TYPES)}"
            )
        wanted = _TYPES[key]
        if not isinstance(value, wanted) or (isinstance(value, bool) and wanted is not bool):
            raise InputError(f"{key} is {value!r}; {_kind(wanted)} is needed")
    separator = content.get("separator")
    if separator is not None and separator not in SEPARATORS:
        raise InputError(f"separator {separator!r} is not known; allowed: {', '.join(SEPARATORS)}")
    if content.get("skip", 0) < 0:
        raise InputError(f"skip is {content['skip']}; a number of lines is needed")
    rate = content.get("rate_hz")
    if rate is not None and not 0.0 < rate < 1e6:
        raise InputError(f"rate_hz is {rate!r}; allowed 0 to 1e6 rows a second")
    columns, given = {}, {}
    for name, entry in content.get("columns", {}).items():
        here = entry.get("name") if isinstance(entry, dict) else entry
        if not isinstance(here, str) or (isinstance(entry, dict) and set(entry) - {"name", "unit"}):
            raise InputError(
                f'columns: {name!r} is {entry!r}; write "accel_x_g", or {{ name = "mag_x_nT", unit = "gauss" }}'
            )
        columns[name] = here
        if isinstance(entry, dict) and "unit" in entry:
            given[name] = str(entry["unit"])
        _converted(here, given.get(name))
    units = tuple(map(str, content.get("units", [])))
    for unit in units:
        if dimension_of(unit) is None:
            raise InputError(f"unit {unit!r} is not known")
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
        constants={name: v if isinstance(v, str) else float(v) for name, v in content.get("constants", {}).items()},
    )


def _kind(wanted: type | tuple[type, ...]) -> str:
    words = {str: "a text", int: "a whole number", bool: "true or false", dict: "a table", list: "a list"}
    return words[wanted] if isinstance(wanted, type) else "a number"


def _axes(content: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    """From the three axes of each kind, or from a named convention."""
    found: dict[str, tuple[str, ...]] = {}
    if "convention" in content:
        vendor = named(content["convention"])
        for kind in PREFIXES.values():
            # rows of the matrix: the tool's axes in the file's
            rows = vendor.matrix(kind)
            found[kind] = tuple(("-" if row.sum() < 0 else "") + "xyz"[int(abs(row).argmax())] for row in rows)
    for prefix, axes in content.get("axes", {}).items():
        kind = PREFIXES.get(prefix, prefix)
        letters = [str(axis).lstrip("+-") for axis in axes] if isinstance(axes, list) else []
        if kind not in PREFIXES.values() or sorted(letters) != ["x", "y", "z"]:
            raise InputError(
                f'axes: {prefix} = {axes!r}; write accelerometer = ["y", "-x", "z"]: each axis once, with its sign'
            )
        found[kind] = tuple(str(axis).removeprefix("+") for axis in axes)
    return found


def describes(name: str) -> bool:
    """Whether a name is one of the package's own columns."""
    return is_number(name) or name in TEXT

"""What a column of a survey file holds, by its name and unit; the names are data in survey_columns.toml."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import InputError, refused
from inclinometry.files.columns import PARTS, channel, closest

EXTRA = "extra_"
"""Begins the name of a column that is not read, where it would be taken for one that is."""

_BRACKETED = re.compile(r"(?P<name>.*?)\s*[(\[{（](?P<unit>[^()\[\]{}（）]*)[)\]}）]\s*")
Candidates: TypeAlias = tuple[tuple[str, str | None], ...]
"""Keys a name may mean, each with the north the name says."""

_BETWEEN = re.compile(r"[\s_\-.,]+")


class Unit(NamedTuple):
    """value in SI (rad, nT, degC) = factor * value + offset."""

    label: str
    factor: float
    offset: float


@dataclass(frozen=True)
class Quantity:
    """One quantity of a survey file.

    key : place in SurveyFile, e.g. "md", "g.0", "reference.dip", "covariance.01". las : mnemonic in LAS.
    column : the package's name of the column, with its unit. unit : that unit; its offset is zero.
    low, high : what the column may hold, in that unit.
    """

    key: str
    column: str
    unit: Unit
    dimension: str
    las: str
    low: float
    high: float


class Meaning(NamedTuple):
    """What a column is: a number in a unit, or text (`key` says which), perhaps with a north in its name."""

    key: str
    unit: Unit | None
    north: str | None = None


@lru_cache(maxsize=1)
def _data() -> Mapping[str, Any]:
    return tomllib.loads(files("inclinometry.files").joinpath("survey_columns.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=1)
def quantities() -> Mapping[str, Quantity]:
    """Every numeric quantity by its key, in the order files are written in.

    >>> quantities()["g.0"].column, quantities()["g.0"].las
    ('gx_m_s2', 'GX')
    """
    found = {}
    for key, entry in _data()["column"].items():
        dimension = entry["dimension"]
        own = _data()["units"][dimension]
        column = f"{entry['names'][0]}_{own['suffix']}"
        unit = next(u for u in _units(dimension).values() if u.label == own["native"])
        found[key] = Quantity(key, column, unit, dimension, entry["las"], entry["low"], entry["high"])
    return found


@lru_cache(maxsize=1)
def quantities_by_column() -> Mapping[str, Quantity]:
    """Every numeric quantity by the package's name of its column.

    >>> quantities_by_column()["gx_m_s2"].key
    'g.0'
    """
    return {quantity.column: quantity for quantity in quantities().values()}


@lru_cache(maxsize=16)
def _units(dimension: str) -> Mapping[str, Unit]:
    """Spelling -> unit; a spelling that begins with = keeps its case."""
    entries = {k: v for k, v in _data()["units"][dimension].items() if isinstance(v, dict)}
    return {
        word: Unit(label, entry["factor"], entry.get("offset", 0.0))
        for label, entry in entries.items()
        for word in entry["spelled"]
    }


def _unit(text: str, dimension: str) -> Unit | None:
    known = _units(dimension)
    plain = text.strip().replace("²", "2").replace("º", "°")
    return known.get(f"={plain}") or known.get(re.sub(r"[\s_/^*.()]+", "", plain).lower())


@lru_cache(maxsize=1)
def _names() -> Mapping[str, Candidates]:
    """Squashed name -> (key, north) of all that go by it."""
    found: dict[str, Candidates] = {}
    for key, entry in _data()["column"].items():
        for name in dict.fromkeys(map(_squashed, entry["names"])):
            found[name] = (*found.get(name, ()), (key, None))
    for north, names in _data()["north"].items():
        for name in names:
            found[name] = (("azimuth", north),)
    return found


@lru_cache(maxsize=1)
def _texts() -> Mapping[str, str]:
    return {name: key for key, names in _data()["text"].items() for name in names}


@lru_cache(maxsize=1)
def words_beyond_ascii() -> frozenset[str]:
    """Names and units that show the encoding of a text: two letters of Chinese, three of Russian at least."""
    names = {*_names(), *_texts(), *(word for known in _data()["hole"].values() for word in known)}
    units = (word for dimension in _data()["units"] for word in _units(dimension))
    return frozenset(word for word in (*names, *units) if word.isalpha() and len(word.encode()) > len(word) + 2)


def _squashed(name: str) -> str:
    return _BETWEEN.sub("", name).lower()


@lru_cache(maxsize=1)
def _wrapping() -> re.Pattern[str]:
    return re.compile(rf"(?:{'|'.join(_data()['wrapped']['patterns'])})(?=$|\s*[(\[])", re.IGNORECASE)


def _unwrapped(name: str) -> str:
    """The name without what a program writes around it, as Shimmer its device and CAL; `Dip°` is `Dip °`."""
    name = re.sub(r"(?<=[^\W\d])(?=[°º]$)", " ", name)
    return _wrapping().sub(lambda found: found[1], name, count=1)


def meaning(name: str, stated: str | None = None, beside: Collection[str] = ()) -> Meaning | None:
    """What a column is by its name and a unit `stated` apart from it; None for a column that is not read.

    The columns `beside` it show a table of the package's own, whose contract fixes some units.
    >>> meaning("GX(g)").key, meaning("MD (ft)").unit.factor, meaning("AZ", "g").key, meaning("AZ", "deg").key
    ('g.0', 0.3048, 'g.2', 'azimuth')
    """
    if name.startswith(EXTRA) or name in ("flags", "toolface_type", *PARTS):
        return None
    name = _unwrapped(name)
    if _squashed(name) in _texts():
        return Meaning(_texts()[_squashed(name)], None)
    # candidates and the unit as written; None where no beginning of the name is known.
    # The longest beginning whose remainder is a unit of its quantity counts: az_m_s2 is az in m/s^2, not azm in s2.
    bracketed = _BRACKETED.fullmatch(name)
    if bracketed:
        candidates = _names().get(_squashed(bracketed["name"]))
        split = None if candidates is None else (candidates, bracketed["unit"])
    else:
        words = [word for word in _BETWEEN.split(name.strip()) if word]
        found = []
        longest = max(map(len, _names()))  # more words than its letters are no known name
        for count in range(min(len(words), longest), 0, -1):
            candidates = _names().get("".join(words[:count]).lower())
            if candidates is not None:
                found.append((candidates, "_".join(words[count:]) or None))
        fit = (
            one for one in found if any(_unit(one[1] or stated or "", quantities()[key].dimension) for key, _ in one[0])
        )
        split = next(fit, found[0] if found else None)
    if split is None:
        near = closest(name, [q.column for q in quantities().values()], 0.9)
        if near:
            raise refused("table-near", {"name": name, "right": near})
        return None
    candidates, written = split
    known = quantities()
    met = any(_unit(written or stated or "", known[key].dimension) for key, _ in candidates)
    unsure = not met and _squashed(name).startswith(tuple(_data()["unsure"]["names"]))
    if unsure or (written and written.endswith("sd") and channel(name) is not None):
        return None  # of another trade; the standard deviation of a channel
    written = _one_unit(name, written, stated) or _contract(name, beside)
    # the one candidate whose dimension has the unit
    if written is None:
        raise refused("table-unit-missing", {"name": name, "right": tuple(known[key].column for key, _ in candidates)})
    fits = [(key, north, _unit(written, known[key].dimension)) for key, north in candidates]
    fits = [fit for fit in fits if fit[2] is not None]
    if len(fits) != 1:
        allowed = dict.fromkeys(u.label for key, _ in candidates for u in _units(known[key].dimension).values())
        raise refused("table-unit", {"column": name, "unit": written, "allowed": tuple(allowed)})
    return Meaning(*fits[0][:1], fits[0][2], fits[0][1])


def azimuths(names: Collection[str], stated: Collection[str] = ()) -> dict[int, str | None]:
    """Places of the azimuths, each with the north that its name states.

    >>> azimuths(["MD", "AZIM_TN", "Azi"], ["m", "deg"])
    {1: 'true', 2: None}
    """
    found: dict[int, str | None] = {}
    for k, name in enumerate(names):
        for unit in (None, *stated):
            with suppress(InputError):
                if (what := meaning(name, unit)) is not None and what.key == "azimuth":
                    found[k] = what.north
    return found


def columns_called(name: str) -> tuple[str, ...]:
    """The package's columns that go by a name without its unit.

    >>> columns_called("INC"), columns_called("INC (deg)")
    (('inclination_deg',), ())
    """
    return tuple(quantities()[key].column for key, _ in _names().get(_squashed(name), ()))


def channel_in_counts(name: str, stated: Collection[str] = (), beside: Collection[str] = ()) -> str | None:
    """The channel in counts that a name means, if it or `stated` has that unit; None for another column.

    A name of two sensors (gx) is the gyro's where a column `beside` it is of an accelerometer alone.
    >>> channel_in_counts("Gx (counts)"), channel_in_counts("gx", ["counts"], ["ax"])
    ('accel_x', 'gyro_x')
    """
    bracketed = _BRACKETED.fullmatch(name)
    base, unit = (bracketed["name"], bracketed["unit"]) if bracketed else (name, "")
    if dimension_of(unit) != "counts" and (unit or "counts" not in stated):
        return None
    kinds = [column[:2] for column in columns_called(base) if re.match("[gbw][xyz]_", column)]
    if len(kinds) > 1:
        alone = [columns_called(other) for other in beside]
        kinds = kinds[1:] if any(len(one) == 1 and one[0][:1] == "g" for one in alone) else kinds[:1]
    prefixes = {"g": "accel", "b": "mag", "w": "gyro"}
    return f"{prefixes[kinds[0][0]]}_{kinds[0][1]}" if kinds else None


def _one_unit(name: str, written: str | None, stated: str | None) -> str | None:
    """The unit from the name or from beside it; both may state it, if they agree."""
    stated = stated.strip() if stated else None
    if not (written and stated):
        return written or stated or None
    if not same_unit(written, stated):
        raise refused("table-units", {"column": name, "units": (written, stated)})
    return stated


def same_unit(one: str, other: str) -> bool:
    """Whether two spellings are the same unit of some quantity.

    >>> same_unit("F", "ft"), same_unit("m", "ft")
    (True, False)
    """
    return one == other or any(_unit(one, d) == _unit(other, d) is not None for d in _data()["units"])


def dimension_of(unit: str) -> str | None:
    """What is measured in this unit; None where it is not known, or may be of two quantities (F: feet or Fahrenheit).

    >>> dimension_of("ft"), dimension_of("gauss"), dimension_of("G"), dimension_of("furlong"), dimension_of("F")
    ('length', 'magnetic', 'magnetic', None, None)
    """
    known = _data()["units"]
    exact = [dimension for dimension in known if f"={unit.strip()}" in _units(dimension)]
    found = exact or [dimension for dimension in known if _unit(unit, dimension) is not None]
    return found[0] if len(found) == 1 else None


def unit_factor(unit: str, own: str) -> tuple[float, float]:
    """Factor and offset that turn values in `unit` into values in `own`.

    >>> unit_factor("ft", "m"), unit_factor("gauss", "nT")
    ((0.3048, 0.0), (100000.0, 0.0))
    """
    for dimension in _data()["units"]:
        one, two = _unit(unit, dimension), _unit(own, dimension)
        if one is not None and two is not None:
            return one.factor / two.factor, (one.offset - two.offset) / two.factor
    raise refused("table-unit-convert", {"unit": unit, "own": own})


def to_si(unit: str) -> tuple[str, float]:
    """The unit inside of a channel's unit, and its factor; counts, and what is not known, stay.

    >>> to_si("mg"), to_si("counts")
    (('m/s^2', 0.00980665), ('counts', 1.0))
    """
    inside = {"acceleration": "m/s^2", "magnetic": "nT", "rate": "rad/s", "voltage": "V"}.get(dimension_of(unit) or "")
    return (unit, 1.0) if inside is None else (inside, unit_factor(unit, inside)[0])


def hole_names(what: str) -> tuple[str, ...]:
    """Squashed names of a column of drill holes: "hole", "depth", "dip" .. of shots, "x" .. "end" of collars, "casing".

    >>> hole_names("dip")[:3]
    ('dip', 'dipangle', 'plunge')
    """
    return tuple(_data()["hole"][what])


def factor_of(name: str, names: Collection[str], own: str, stated: Collection[str] = ()) -> float | None:
    """Factor to the unit `own` of a column named one of `names` (squashed); None for another column.

    The unit is in the name, or one of those `stated` for the whole file.
    >>> factor_of("End depth (ft)", ["enddepth"], "m"), factor_of("X", ["x"], "m", ["deg", "m"])
    (0.3048, 1.0)
    """
    name = _unwrapped(name)
    bracketed = _BRACKETED.fullmatch(name)
    words = [word for word in _BETWEEN.split(name.strip()) if word]
    splits = [(bracketed["name"], bracketed["unit"])] if bracketed else [
        ("".join(words[:count]), "_".join(words[count:])) for count in range(len(words), 0, -1)
    ]  # fmt: skip
    unit = next((unit for base, unit in splits if _squashed(base) in names), None)
    if unit is None:
        return None
    if not unit:
        unit = next((word for word in stated if dimension_of(word) == dimension_of(own)), "")
    usual = "deg" if own == "rad" else own
    if not unit:
        raise refused("table-unit-missing", {"name": name, "right": (f"{_BETWEEN.sub('_', name).lower()}_{usual}",)})
    try:
        return unit_factor(unit, own)[0]
    except InputError:
        raise refused("table-unit", {"column": name, "unit": unit, "allowed": (usual,)}) from None


def seconds_of(name: str, stated: Collection[str] = ()) -> float | None:
    """Seconds in the unit of a column of time; None for another column, and where neither it nor `stated` has a unit.

    >>> seconds_of("Time (ms)"), seconds_of("TimeUS"), seconds_of("t"), seconds_of("t", ["s"])
    (0.001, 1e-06, None, 1.0)
    """
    spelled = _data()["time"]["spelled"].get(_squashed(_unwrapped(name)))
    if spelled is not None:
        return unit_factor(spelled, "s")[0]
    try:
        return factor_of(name, _data()["time"]["names"], "s", stated)
    except InputError:
        return None


def listed_axis(name: str, stated: Collection[str] = (), alone: bool = False) -> tuple[str, float] | None:
    """The axis ("north", "east", "tvd") of a column of positions and its factor to metres; None for another column.

    alone : whether positions are all there is: x, y and "z" are axes, too.

    >>> listed_axis("+N/-S (ft)"), listed_axis("E(+) (m)"), listed_axis("North Reference", ["m"])
    (('north', 0.3048), ('east', 1.0), None)
    """
    plain = re.sub(r"\(\s*[-+\u2212]\s*\)|[+\u2212]", "", name)  # of N(+) and +N/-S
    for axis, names in (*_data()["listed"].items(), *(_data()["positions"].items() if alone else ())):
        if (factor := factor_of(plain, names, "m", stated)) is not None:
            return axis, factor
    return None


def _contract(name: str, beside: Collection[str]) -> str | None:
    for start, entry in _data()["contract"].items():
        if (name == start or name.startswith(f"{start}_")) and all(other in beside for other in entry["beside"]):
            return str(entry["unit"])
    return None


def is_number(name: str) -> bool:
    """Whether a column will be read as numbers; a name that will be refused need not be.

    >>> is_number("Gx (m/s2)"), is_number("azimuth_reference"), is_number("Gx")
    (True, False, False)
    """
    beside = [other for entry in _data()["contract"].values() for other in entry["beside"]]
    try:
        found = meaning(name, beside=beside)
    except InputError:
        return False
    return found is not None and found.unit is not None


def is_depth(name: str) -> bool:
    """Whether a column is the depth along the hole, in a unit that is known."""
    try:
        found = meaning(name)
    except InputError:
        return False
    return found is not None and found.key == "md"


def from_si(values: Array, quantity: Quantity) -> Array:
    """Values in the unit of the package's column; turned ones are rounded to 1e-10, so that 120 deg prints as 120."""
    unit = quantity.unit
    return values if unit.factor == 1.0 else np.asarray(np.round(values / unit.factor, 10) + 0.0)

"""What is known of WITSML 1.4.1.1 trajectories: elements, their order and units, from witsml_1411.toml."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any, Final, NamedTuple

from inclinometry.core.errors import InputError

GROUPS: Final = ("rawData", "corUsed", "valid", "matrixCov")
NORTHS: Final = {"magnetic north": "magnetic", "true north": "true", "grid north": "grid"}


class Element(NamedTuple):
    """A quantity's element: its key in `_quantities`, the kind of its unit, the unit written ("" when only read)."""

    key: str
    kind: str
    written: str


@lru_cache(maxsize=1)
def _data() -> Mapping[str, Any]:
    return tomllib.loads(files("inclinometry.io").joinpath("witsml_1411.toml").read_text(encoding="utf-8"))


def version() -> str:
    """The version of the schema."""
    return str(_data()["version"])


def namespace() -> str:
    """The XML namespace."""
    return str(_data()["namespace"])


def order(parent: str) -> tuple[str, ...]:
    """The children of trajectory or trajectoryStation, as the schema orders them."""
    return tuple(_data()["order"][parent])


@lru_cache(maxsize=8)
def elements(parent: str) -> Mapping[str, Element]:
    """Element -> quantity, of "station" or of one of `GROUPS`.

    Examples
    --------
    >>> elements("rawData")["gravAxialRaw"]
    Element(key='g.2', kind='acceleration', written='m/s2')
    """
    return {name: Element(*entry) for name, entry in _data()[parent].items()}


def station_texts() -> tuple[str, ...]:
    """Elements of a station that are kept as text."""
    return tuple(_data()["texts"]["station"])


def factor(kind: str, uom: str | None) -> float:
    """SI (rad, nT) of one unit.

    Raises
    ------
    InputError
        No unit, or one that is not of this kind; units are never assumed.

    Examples
    --------
    >>> factor("length", "ft")
    0.3048
    """
    known = _data()["uom"][kind]
    if uom is None:
        raise InputError(f"has no uom; add one of {', '.join(known)}")
    if uom not in known:
        raise InputError(f"has uom {uom!r}; allowed: {', '.join(known)}")
    return float(known[uom])

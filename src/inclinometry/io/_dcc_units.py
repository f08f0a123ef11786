"""Units as the D-SI writes them."""

from __future__ import annotations

import re
from typing import Final

DEGREE: Final = r"\degree"
_UNITS: Final = {
    "counts": r"\one",
    "V": r"\volt",
    "mV": r"\milli\volt",
    "uV": r"\micro\volt",
    "µV": r"\micro\volt",
    "A": r"\ampere",
    "mA": r"\milli\ampere",
    "Hz": r"\hertz",
    "kHz": r"\kilo\hertz",
    "T": r"\tesla",
    "mT": r"\milli\tesla",
    "uT": r"\micro\tesla",
    "µT": r"\micro\tesla",
    "nT": r"\nano\tesla",
    "m/s2": r"\metre\second\tothe{-2}",
    "m/s^2": r"\metre\second\tothe{-2}",
    "rad/s": r"\radian\second\tothe{-1}",
    "deg/s": r"\degree\second\tothe{-1}",
    "deg/h": r"\degree\hour\tothe{-1}",
}


def unit(text: str) -> str | None:
    r"""The D-SI form of a unit of the house; None for one the SI does not know, which a reader must be told.

    Examples
    --------
    >>> unit("mV/K^2")
    '\\milli\\volt\\kelvin\\tothe{-2}'
    >>> unit("g") is None
    True
    """
    main, power = text, 0
    found = re.fullmatch(r"(.+?)/K(?:\^(\d))?", text)
    if found is not None:
        main, power = found[1], int(found[2] or 1)
    known = _UNITS.get(main)
    if known is None or not power:
        return known
    heat = rf"\kelvin\tothe{{-{power}}}"
    return heat if known == r"\one" else known + heat


def product(one: str, other: str) -> str:
    r"""The unit of a product.

    Examples
    --------
    >>> product("\\volt", "\\one"), product("\\volt", "\\volt")
    ('\\volt', '\\volt\\volt')
    """
    parts = [part for part in (one, other) if part != r"\one"]
    return "".join(parts) or r"\one"

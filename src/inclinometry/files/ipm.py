"""Tool codes from IPM files, the tables in which programs of well planning exchange error models."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

from inclinometry.errors import FileError, InputError, in_file, not_among, refused, wrong_kind
from inclinometry.findings import Finding
from inclinometry.opening import LARGEST_SETTINGS, whole
from inclinometry.position.tool_code import UNITS, Term, ToolCode, term

_TIES: Final = {"r": "random", "s": "systematic", "w": "well", "g": "global", "n": ""}
_VECTORS: Final = ("e", "d", "i", "a", "l", "m", "n")
_UNITS: Final = {"-": "-", "d": "deg", "m": "m", "im": "1/m", "nt": "nT", "dnt": "deg.nT"}
_VARIABLES: Final = {
    "inc": "Inc", "azm": "AzM", "azt": "AzT", "azi": "AzT", "tmd": "MD", "mdprev": "MDPrev", "dmd": "(MD - MDPrev)",
    "tvd": "TVD", "gtot": "GField", "mtot": "BField", "dip": "Dip", "lat": "Latitude",
    "erot": "(3600 * EarthRate * Cos(Latitude))",
}  # fmt: skip
"""Variable -> formula in those of a tool code; erot is the horizontal earth rate per hour, as magnitudes in d are."""
_NEARLY: Final = "0.00000001"
"""Inclination, rad, whose weights are those of a vertical station: IPM has none of its own."""
_COLUMNS: Final = ("name", "vector", "tie-on", "unit", "value", "formula")


class _Row(NamedTuple):
    vector: str
    unit: str
    value: float
    formula: str


def read_ipm(path: str | Path) -> ToolCode:
    """A tool code from an IPM file: rows of name, vector, tie-on, unit, value, formula between tabs.

    Rows of one name and tie-on are one error. A lateral error l moves azimuth by l / sin I; a misalignment m is two
    independent errors, up and sideways. A row of vector or tie-on n is a value that formulas name.

    Raises
    ------
    FileError
        With the line: an unknown vector, tie-on or unit, a formula with another variable such as tfo (toolface).
    """
    data = whole(path, LARGEST_SETTINGS)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # descriptions with signs of units
    head: dict[str, str] = {}
    values: dict[str, str] = {}
    groups: dict[tuple[str, str], list[_Row]] = {}
    lines: dict[str, int] = {}
    for line, content in enumerate(text.splitlines(), 1):
        if content.startswith("#"):
            key, _, said = content[1:].partition(":")
            head[key.strip().lower()] = said.strip()
        elif content.strip():
            try:
                name, tie, row = _row([cell.strip() for cell in content.split("\t")], values)
            except InputError as error:
                raise in_file(error, path, line) from None
            if "n" in (tie, row.vector):
                values[name.lower()] = f"({row.value * UNITS[_UNITS[row.unit]]!r} * ({row.formula}))"
                continue
            lines.setdefault(name, line)
            groups.setdefault((name, tie), []).append(row)
            if row.vector == "m":
                groups.setdefault((f"{name} sideways", tie), []).append(row._replace(vector="l"))
    ties: Mapping[str, list[str]] = {name: [tie for other, tie in groups if other == name] for name, _ in groups}
    terms = []
    for (name, tie), rows in groups.items():
        try:
            terms.append(_term(name if len(ties[name]) == 1 else f"{name} {_TIES[tie]}", tie, rows))
        except InputError as error:
            raise in_file(error, path, lines[name.removesuffix(" sideways")]) from None
    if not terms:
        raise FileError(Finding("input-empty", {"name": "IPM"}), path=path)
    title = head.get("shortname") or head.get("tool name") or Path(path).stem
    return ToolCode(name=title, terms=tuple(terms), source=Path(path).name, description=head.get("description", ""))


def _row(cells: list[str], values: Mapping[str, str]) -> tuple[str, str, _Row]:
    """Name, tie-on and the rest of a row, its formula in the variables of a tool code."""
    if len(cells) != len(_COLUMNS):
        raise refused("table-row-width", {"cells": len(cells), "columns": len(_COLUMNS)})
    name, vector, tie, unit, value, formula = cells
    vector, tie, unit = vector.lower(), tie.lower(), unit.lower()
    for what, cell, allowed in (("vector", vector, _VECTORS), ("tie-on", tie, _TIES), ("unit", unit, _UNITS)):
        if cell not in allowed:
            raise not_among(f"{name}.{what}", cell, allowed)
    try:
        size = float(value)
    except ValueError:
        raise wrong_kind(f"{name}.value", value, "number") from None
    if unit != "d" and re.search(r"\berot\b", formula, re.IGNORECASE):
        raise not_among(f"{name}.unit", unit, ("d",))
    for known in sorted(values, key=len, reverse=True):  # their names may have hyphens
        own = re.compile(rf"(?<!\w){re.escape(known)}(?!\w)", re.IGNORECASE)
        formula = values[known].join(own.split(formula))
    return name, tie, _Row(vector, unit, size, formula)


def _term(name: str, tie: str, rows: list[_Row]) -> Term:
    """One error: what its rows do to depth, inclination and azimuth, in sizes of the first."""
    first, sums = rows[0], dict[str, list[str]](depth=[], inclination=[], azimuth=[])
    for row in rows:
        formula = re.sub(r"(?<![\w.])[A-Za-z_]\w*", lambda one: _VARIABLES.get(one[0].lower(), one[0]), row.formula)
        if (row.value, row.unit) != (first.value, first.unit):
            formula = (
                f"{row.value * UNITS[_UNITS[row.unit]]!r} / {first.value * UNITS[_UNITS[first.unit]]!r} * ({formula})"
            )
        of = {"i": "inclination", "a": "azimuth", "l": "azimuth", "m": "inclination"}.get(row.vector, "depth")
        sums[of].append(f"({formula}) / Sin(Inc)" if row.vector == "l" else formula)
    depth, slope, turn = (f"({') + ('.join(parts)})" if parts[1:] else "".join(parts) or "0" for parts in sums.values())
    weights = (depth, slope, turn)
    found = term(name, first.value, _UNITS[first.unit], _TIES[tie], weights)
    at = found.azimuth.evaluate(dict.fromkeys(found.azimuth.names, 0.7) | {"inc": 0.0, "mdprev": 0.1})
    if abs(at) < 1e12:
        return found  # an azimuth that is finite moves nothing at a vertical station
    up, across = (re.sub(r"\bInc\b", _NEARLY, one) for one in (f"({slope})", f"({turn}) * Sin(Inc)"))
    singular = (f"{up} * Cos(AzT) - {across} * Sin(AzT)", f"{up} * Sin(AzT) + {across} * Cos(AzT)", "0")
    return term(name, first.value, _UNITS[first.unit], _TIES[tie], weights, singular)

"""From a survey to the columns of a table: names with units, numbers in them, texts; what is unknown is left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.core.errors import InputError
from inclinometry.io import _write
from inclinometry.io._quantities import EXTRA, Quantity, from_si, meaning, quantities
from inclinometry.io.exchange import SurveyFile


@dataclass(frozen=True, eq=False)
class OutColumn:
    """One column: numbers with their quantity, or texts."""

    name: str
    values: Array | tuple[str, ...]
    quantity: Quantity | None = None


def columns_of(file: SurveyFile) -> list[OutColumn]:
    """All that a survey knows, as columns; a quantity without a single value has none.

    Examples
    --------
    >>> [c.name for c in columns_of(SurveyFile(md=[0, 30], g=[[0, 0, 9.8]] * 2, extra={"rig": ("A", "A")}))]
    ['md_m', 'gx_m_s2', 'gy_m_s2', 'gz_m_s2', 'rig']
    """
    found = []
    for key, quantity in quantities().items():
        values = _at(file, key)
        if values is not None:
            found.append(OutColumn(quantity.column, from_si(values, quantity), quantity))
        if key == "azimuth" and file.azimuth_reference is not None:
            found.append(OutColumn("azimuth_reference", (file.azimuth_reference,) * len(file)))
    return found + _texts(file)


def _at(file: SurveyFile, key: str) -> Array | None:
    """The values of one quantity; None where the file is silent. A triad or covariance is there whole or not at all."""
    group, _, place = key.partition(".")
    value = getattr(file, group)
    if isinstance(value, Mapping):
        value = value.get(place)
    if value is None or np.isnan(value).all():
        return None
    if value.ndim == 1:
        return np.asarray(value)
    return np.asarray(value[(slice(None), *map(int, place))])


def _texts(file: SurveyFile) -> list[OutColumn]:
    found = []
    for name in ("used", "valid"):
        mask = getattr(file, name)
        if mask is not None:
            found.append(OutColumn(name, tuple("1" if yes else "0" for yes in mask)))
    if file.times is not None and any(file.times):
        found.append(OutColumn("time", tuple(file.times)))
    return found + [OutColumn(_extra_name(name), tuple(cells)) for name, cells in file.extra.items()]


def _extra_name(name: str) -> str:
    """A name under which the column is not taken for one of the house's when it is read."""
    try:
        taken = meaning(name) is not None or name.startswith(EXTRA)
    except InputError:
        taken = True
    return f"{EXTRA}{name}" if taken else name


def column_texts(column: OutColumn) -> Sequence[str]:
    """Numbers as the shortest text that reads back the same, texts as they are."""
    return column.values if isinstance(column.values, tuple) else _write.column(column.values)

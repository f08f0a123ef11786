"""From the house's axes to those of a file, for the writers; the reverse is done where columns are read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from inclinometry.attitude.conventions import Convention, named
from inclinometry.core.arrays import Array
from inclinometry.io._sheet import KINDS
from inclinometry.io._sheet import _to_house as turned
from inclinometry.io.exchange import VECTORS, SurveyFile

CORRECTED: Final = {"g": ("gx", "gy", "gz"), "b": ("bx", "by", "bz")}
"""Corrections that are vectors: field -> their names in `SurveyFile.corrections`."""


def to_vendor(file: SurveyFile, convention: str) -> SurveyFile:
    """The survey with its vectors, and their corrections, in a vendor's axes and signs.

    Raises
    ------
    InputError
        There is no convention of that name.

    Examples
    --------
    >>> to_vendor(SurveyFile(md=[9.0], g=[[1.0, 2.0, 9.0]]), "iscwsa").g
    array([[-2.,  1.,  9.]])
    """
    vendor = named(convention)
    parts: dict[str, Any] = {
        name: _back(getattr(file, name), vendor, name) for name in VECTORS if getattr(file, name) is not None
    }
    return replace(file, corrections=corrections_back(file.corrections, vendor), **parts)


def _back(values: Array, vendor: Convention, field: str) -> Array:
    # the matrix is orthogonal: its transpose leads back
    return turned(values, vendor.matrix(KINDS[field]).T)


def corrections_back(corrections: Mapping[str, Array], vendor: Convention) -> dict[str, Array]:
    """Corrections in the vendor's axes from those in the house's."""
    return _corrections(corrections, {field: vendor.matrix(KINDS[field]).T for field in CORRECTED})


def corrections_to_house(corrections: Mapping[str, Array], vendor: Convention) -> dict[str, Array]:
    """Corrections in the house's axes from those in the vendor's."""
    return _corrections(corrections, {field: vendor.matrix(KINDS[field]) for field in CORRECTED})


def _corrections(corrections: Mapping[str, Array], matrices: Mapping[str, Array]) -> dict[str, Array]:
    found = dict(corrections)
    for field, names in CORRECTED.items():
        given = [corrections[name] for name in names if name in corrections]
        if given:
            absent = np.zeros(given[0].shape)  # one that is not stated is no correction
            vector = np.stack([corrections.get(name, absent) for name in names], axis=1)
            for name, values in zip(names, turned(vector, matrices[field]).T, strict=True):
                if name in found or np.nan_to_num(values).any():
                    found[name] = values
    return found

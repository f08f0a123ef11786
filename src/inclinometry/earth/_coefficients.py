"""Gauss coefficients of the models, from the files that wmm-calculator and ppigrf carry; read once, never fetched."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from inclinometry.core.arrays import Array, frozen
from inclinometry.core.errors import InputError
from inclinometry.earth._harmonics import Coefficients

_WMM_YEARS = 5.0


@cache
def wmm2025_coefficients() -> Coefficients:
    """WMM2025: values at 2025 and what their yearly change makes of them in 2030."""
    from wmm import wmm_calc

    calculator = wmm_calc()
    content = calculator.load_coeffs()
    if content["model_name"] != "WMM-2025":
        raise InputError(f"the installed wmm-calculator carries {content['model_name']}; install one with WMM-2025")
    g, h, g_rate, h_rate = (_square(content[k], calculator.nmax) for k in ("g", "h", "g_sv", "h_sv"))
    epoch = float(content["epoch"])
    g, h = np.stack([g, g + _WMM_YEARS * g_rate]), np.stack([h, h + _WMM_YEARS * h_rate])
    return Coefficients(frozen([epoch, epoch + _WMM_YEARS]), frozen(g), frozen(h))


@cache
def igrf14_coefficients() -> Coefficients:
    """IGRF-14: every five years from 1900 to 2030."""
    from ppigrf import ppigrf

    tables = ppigrf.read_shc(ppigrf.shc_fn_igrf14)
    years = tables[0].index.year.to_numpy(dtype=np.float64)
    degree = max(n for n, _ in tables[0].columns)
    found = []
    for table in tables:
        square = np.zeros((len(years), degree + 1, degree + 1))
        for n, m in table.columns:
            square[:, n, m] = table[(n, m)]
        found.append(frozen(square))
    return Coefficients(frozen(years), found[0], found[1])


def _square(values: Sequence[float], degree: int) -> Array:
    """By degree and order, from a row that runs (unused), (1, 0), (1, 1), (2, 0), ..."""
    square = np.zeros((degree + 1, degree + 1))
    rows, columns = np.tril_indices(degree + 1)
    square[rows[1:], columns[1:]] = values[1 : len(rows)]
    return square

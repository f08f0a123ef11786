"""Uncertainty budget of a certificate: expanded uncertainty over inclination, and which cause brings how much of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.expected import ALL_ANGLES, certified_factor, expanded, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, INCLINATIONS, SHORT_INCLINATIONS
from inclinometry.stability import ASSUMED, aged
from inclinometry.uncertainty import coverage_probability

Record = dict[str, Any]


def uncertainty_table(calibration: Calibration, months: int | None) -> Record | None:
    """Expanded uncertainty over inclination, worst azimuth and toolface; None where none is known.

    After the agreed interval of `months` too, where there is one.
    """
    found = expected_uncertainty(calibration, INCLINATIONS)
    if not found.angles:
        return None
    second = found.azimuth_from
    k, freedom = certified_factor(calibration), calibration.degrees_of_freedom
    table: Record = {
        "coverage_factor": k,
        "coverage_probability": round(coverage_probability(COVERAGE_FACTOR), 4),
        "degrees_of_freedom": freedom if math.isfinite(freedom) else None,
        "azimuth_from": second,
        "dip_deg": None if second is None else float(np.degrees(found.dip)),
        "dip_assumed": second is not None and found.dip_from == "assumed",
        "temperature_degC": found.temperature,
        "inclination_deg": np.degrees(INCLINATIONS).round(9).tolist(),
    }
    one, alone = (np.degrees(expanded(u, k)) for u in (found.of_one_reading, found.from_calibration))
    columns = {f"U_{name}_deg": ALL_ANGLES.index(name) for name in found.angles}
    table |= {key: one[:, place].tolist() for key, place in columns.items()}
    table["from_calibration"] = {key: alone[:, place].tolist() for key, place in columns.items()}
    if months is not None:
        # what the sensors may have moved by when the next calibration is due
        later = replace(calibration, tool=aged(calibration.tool, months / 12.0))
        end = np.degrees(expanded(expected_uncertainty(later, INCLINATIONS).of_one_reading, k))
        table["end_of_interval"] = {key: end[:, place].tolist() for key, place in columns.items()}
        table["end_of_interval_source"] = ASSUMED.source
    return table


def uncertainty_budget(calibration: Calibration) -> Record | None:
    """Standard uncertainty of one reading by cause where the whole is largest; None where none is known.

    The calibration by what it was made with, where it knows: each dial, the noise of its readings, what was assumed of
    the stand; otherwise triad by triad, with what the correlation of their parameters adds (a root with the sign of the
    variance). The noise of the reading triad by triad; of two accelerometers the strength of gravity.
    """
    tool, inclination = calibration.tool, SHORT_INCLINATIONS
    whole = expected_uncertainty(calibration, inclination)
    if not whole.angles:
        return None
    causes: dict[tuple[str, str | None], Array] = {
        (name, None): part for name, part in whole.components.items() if name not in ("calibration", "sensor noise")
    }
    left = whole.components["calibration"]
    for name, share in calibration.shares.items():
        causes["calibration", name] = share[:, None, None, [0, 1, 2, 2]] * left
    for kind in tool.triads:
        block = np.zeros_like(tool.covariance)
        block[tool.slices[kind], tool.slices[kind]] = tool.covariance[tool.slices[kind], tool.slices[kind]]
        quiet = {other: noise if other == kind else 0.0 * noise for other, noise in tool.noise.items()}
        own = replace(calibration, tool=replace(tool, covariance=block, noise=quiet))
        parts = expected_uncertainty(own, inclination).components
        causes["noise", kind] = parts["sensor noise"]
        if not calibration.shares:
            left = left - parts["calibration"]
            causes["calibration", kind] = parts["calibration"]
    if not calibration.shares:
        causes["correlation", None] = left
    rows = []
    for (cause, of), part in causes.items():
        found = {}
        for place in (ALL_ANGLES.index(name) for name in whole.angles):
            flat = whole.variance[..., place].reshape(len(inclination), -1)
            value = part[..., place].reshape(len(inclination), -1)[np.arange(len(flat)), flat.argmax(axis=1)]
            found[ALL_ANGLES[place]] = np.degrees(np.sign(value) * np.sqrt(np.abs(value))).tolist()
        if any(abs(u) > 1e-9 for us in found.values() for u in us):
            named = cause if cause in ("calibration", "noise", "correlation") else "gravity"
            rows.append({"cause": named, "kind": of, "u_deg": found})
    return {"inclination_deg": np.degrees(inclination).round(9).tolist(), "components": rows}

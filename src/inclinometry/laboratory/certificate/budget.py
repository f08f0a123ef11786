"""Uncertainty budget of a certificate: expanded uncertainty over inclination, and which cause brings how much of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.expected import ALL_ANGLES, Certified, ExpectedUncertainty, expanded, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.constants import COVERAGE_FACTOR, SHORT_INCLINATIONS
from inclinometry.stability import ASSUMED, add_stability
from inclinometry.uncertainty import coverage_probability

Record = dict[str, Any]


def expanded_columns(found: ExpectedUncertainty, k: float) -> Record:
    """Expanded uncertainties over inclination, worst azimuth and toolface, degrees: of one reading, and below
    "from_calibration" from the calibration alone.
    """
    return {
        "inclination_deg": np.degrees(found.inclination).round(9).tolist(),
        **_columns(found, found.of_one_reading, k),
        "from_calibration": _columns(found, found.from_calibration, k),
    }


def _columns(found: ExpectedUncertainty, u: Array, k: float) -> dict[str, list[float]]:
    shown = np.degrees(expanded(u, k))
    return {f"U_{name}_deg": shown[:, ALL_ANGLES.index(name)].tolist() for name in found.angles}


def uncertainty_table(certified: Certified, found: ExpectedUncertainty, months: int | None) -> Record | None:
    """Expanded uncertainty over `INCLINATIONS`, worst azimuth and toolface; None where none is known.

    After the agreed interval of `months` too, where there is one.
    """
    calibration, k, freedom = certified
    if not found.angles:
        return None
    second = found.azimuth_from
    table: Record = {
        "coverage_factor": k,
        "coverage_probability": round(coverage_probability(COVERAGE_FACTOR), 4),
        "degrees_of_freedom": freedom if np.isfinite(freedom) else None,
        "azimuth_from": second,
        "dip_deg": None if second is None else float(np.degrees(found.dip)),
        "dip_assumed": second is not None and found.dip_from == "assumed",
        "temperature_degC": found.temperature,
        **expanded_columns(found, k),
    }
    if months is not None:
        # what the sensors may have moved by when the next calibration is due
        later = replace(calibration, tool=add_stability(calibration.tool, months / 12.0))
        end = expected_uncertainty(later, found.inclination).of_one_reading
        table["end_of_interval"] = _columns(found, end, k)
        table["end_of_interval_source"] = ASSUMED.source
    return table


def uncertainty_budget(calibration: Calibration, found: ExpectedUncertainty) -> Record | None:
    """Standard uncertainty of one reading by cause where the whole, `found`, is largest; None where none is known.

    The calibration by what it was made with, where it knows: each dial, the noise of its readings, what was assumed of
    the stand; otherwise triad by triad, with what the correlation of their parameters adds (a root with the sign of the
    variance). The noise of the reading triad by triad; of two accelerometers the strength of gravity.
    """
    tool, inclination = calibration.tool, np.array(SHORT_INCLINATIONS)
    if not found.angles:
        return None
    rows_of_short = np.searchsorted(found.inclination, inclination)
    components = {name: part[rows_of_short] for name, part in found.components.items()}
    whole = np.asarray(sum(components.values()))
    causes: dict[tuple[str, str | None], Array] = {
        (name, None): part for name, part in components.items() if name not in ("calibration", "sensor noise")
    }
    left = components["calibration"]
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
        brought = {}
        for name in found.angles:
            flat, own_flat = (x[..., ALL_ANGLES.index(name)].reshape(len(inclination), -1) for x in (whole, part))
            value = own_flat[np.arange(len(flat)), flat.argmax(axis=1)]
            brought[name] = np.degrees(np.sign(value) * np.sqrt(np.abs(value))).tolist()
        if any(abs(u) > 1e-9 for us in brought.values() for u in us):
            named = cause if cause in ("calibration", "noise", "correlation") else "gravity"
            rows.append({"cause": named, "kind": of, "u_deg": brought})
    return {"inclination_deg": np.degrees(inclination).round(9).tolist(), "components": rows}

"""The numbers of the page on fleets: what plans and histories tell, before any reading is taken."""

from __future__ import annotations

import numpy as np
from benchmarks.fleet_statistics import run_section
from tests.position.test_fleet_code import contained, model_of

from inclinometry.arrays import Array
from inclinometry.calibration import plans
from inclinometry.calibration.drift import azimuth_sd
from inclinometry.calibration.drift_check import after_check, plan_information
from inclinometry.position.fleet_code import fleet_tool_code
from inclinometry.simulate.fleet import drift_variance, mounting_variance
from support.figures import table

HEAD = ("azimuth, degrees", "at 5", "at 30", "at 60", "at 90")
J = {
    name: plan_information(plan()) for name, plan in (("12", plans.twelve), ("24", plans.orthogonal), ("6", plans.six))
}


def _row(name: str, covariance: Array) -> list[str]:
    return [name, *(f"{u:.3f}" for u in np.degrees(azimuth_sd(covariance)))]


def _prior(times: float, reproducibility: Array | None = None) -> Array:
    """Half a year after six calibrations of twelve positions, with so many times the drift variance."""
    drift = times * drift_variance()
    state = np.linalg.inv(J["12"]) + (0.0 if reproducibility is None else reproducibility)
    for _ in range(5):
        state = after_check(state + 0.65 * drift, J["12"], reproducibility)
    return np.asarray(state + 0.5 * drift)


def bought() -> dict[str, str]:
    """What a history buys."""
    prior = _prior(1.0)
    rows = [
        _row("12 positions alone", np.linalg.inv(J["12"])),
        _row("24 positions alone", np.linalg.inv(J["24"])),
        _row("drift of a year", drift_variance()),
        _row("prediction after half a year, no check", prior),
        _row("six positions and history", after_check(prior, J["6"])),
        _row("twelve positions and history", after_check(prior, J["12"])),
    ]
    rows += [
        _row(f"six and history, drift variance times {times:g}", after_check(_prior(times), J["6"]))
        for times in (0.25, 4.0, 16.0)
    ]
    mounting = mounting_variance()
    rows += [
        _row("twelve alone, mountings that differ", np.linalg.inv(J["12"]) + mounting),
        _row("six and history, mountings that differ", after_check(_prior(1.0, mounting), J["6"], mounting)),
    ]
    return {"fleet_prior": table(HEAD, rows)}


def in_the_hole() -> dict[str, str]:
    """What two analysed runs in a year do for the prediction at its end."""
    names = {"prediction, 12 months": "prediction a year after the last calibration", "with two runs": "with two runs"}
    rows = [
        [f"{names[name]}: {what}", *(f"{u:.3f}" for u in row[key]), f"{row['nees']:.2f}"]
        for name, row in run_section().items()
        for what, key in (("errors made", "made"), ("said", "said"))
    ]
    return {"fleet_runs": table((*HEAD, "squared error / said"), rows)}


def ellipsoids() -> dict[str, str]:
    """Share of wells within the ellipsoid of their type's tool code."""
    made = fleet_tool_code(model_of(drift_variance(), mounting_variance()), np.linalg.inv(J["12"]), 2.0, name="X")
    return {"fleet_wells": f"{100.0 * contained(made.code, made.covariance, 10_000, 1):.1f}"}


def everything() -> dict[str, str]:
    """All of them."""
    return bought() | in_the_hole() | ellipsoids()

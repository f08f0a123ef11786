"""Optimal plans beside the classical ones and the figures of the specification.

    python -m benchmarks.design [--json]

Standard deviation of azimuth from the calibration alone, at the worst azimuth and toolface, joint model over both
triads: 0.3 mg and 20 nT in 50 uT, each with the rounding of 12 bits; dip 70; prior of 5 deg on the field directions.
The criterion is the worst over inclinations 10 to 90 deg. Times are of one core.
"""

from __future__ import annotations

import statistics
import time
from functools import partial

import numpy as np

from benchmarks import command
from benchmarks.measure import laps
from inclinometry.calibration import plans
from inclinometry.calibration.design import evaluate_plan, next_position, optimal_plan, plan_value
from inclinometry.calibration.initial_values import stand_within

SHOWN_DEG = (5.0, 10.0, 30.0, 60.0, 90.0)
RIGS_DEG = (0.0, 0.1)
CLASSICAL = {"the paper's 12": plans.twelve(), "half cube 12": plans.half(), "cube 24": plans.orthogonal()}
BESIDE = {12: "the paper's 12", 16: "cube 24", 24: "cube 24"}
# the specification's table; plan or number of aimed stations, rig sd in deg
SPECIFIED = {
    ("the paper's 12", 0.0): (0.168, 0.104, 0.063, 0.054, 0.057),
    ("half cube 12", 0.0): (0.169, 0.106, 0.067, 0.057, 0.053),
    ("cube 24", 0.0): (0.119, 0.075, 0.047, 0.040, 0.037),
    ("the paper's 12", 0.1): (0.198, 0.119, 0.071, 0.064, 0.072),
    ("half cube 12", 0.1): (0.441, 0.233, 0.107, 0.088, 0.080),
    ("cube 24", 0.1): (0.140, 0.085, 0.053, 0.047, 0.048),
    (12, 0.0): (0.113, 0.075, 0.062, 0.071, 0.074),
    (16, 0.0): (0.096, 0.064, 0.053, 0.060, 0.064),
    (24, 0.0): (0.078, 0.052, 0.043, 0.049, 0.052),
    (12, 0.1): (0.163, 0.097, 0.073, 0.086, 0.097),
    (16, 0.1): (0.128, 0.078, 0.064, 0.072, 0.077),
    (24, 0.1): (0.102, 0.062, 0.048, 0.055, 0.062),
}
DENSE_DEG = np.arange(10.0, 90.1, 2.5)


def azimuth_deg(plan, rig_deg: float, inclination_deg=SHOWN_DEG) -> list[float]:
    """Worst azimuth sd of a plan at inclinations, deg."""
    found = evaluate_plan(plan, np.radians(inclination_deg), rig_sd=np.radians(rig_deg))
    return [float(x) for x in np.degrees(found.from_calibration[:, 1])]


def classical() -> list[dict]:
    """The plans that need no search."""
    return [
        {
            "plan": name,
            "rig_sd_deg": rig,
            "azimuth_sd_deg": azimuth_deg(plan, rig),
            "specified_deg": SPECIFIED[name, rig],
            "criterion_deg": max(azimuth_deg(plan, rig, DENSE_DEG)),
        }
        for rig in RIGS_DEG
        for name, plan in CLASSICAL.items()
    ]


def aimed() -> list[dict]:
    """Plans aimed at inclinations 10 to 90 deg; the criterion is judged on a finer grid than it was searched on."""
    rows = []
    for rig in RIGS_DEG:
        for stations, beside in BESIDE.items():
            start = time.process_time()
            plan = optimal_plan(stations, rig_sd=np.radians(rig))
            seconds = time.process_time() - start
            specified = SPECIFIED[stations, rig]
            rows.append(
                {
                    "stations": stations,
                    "rig_sd_deg": rig,
                    "azimuth_sd_deg": azimuth_deg(plan, rig),
                    "specified_deg": specified,
                    "found_deg": max(azimuth_deg(plan, rig, DENSE_DEG)),
                    "required_deg": max(specified[1:]),
                    "classical": beside,
                    "classical_deg": max(azimuth_deg(CLASSICAL[beside], rig, DENSE_DEG)),
                    "seconds": seconds,
                }
            )
    return rows


def near_vertical() -> list[dict]:
    """16 positions aimed at near-vertical wells against the 24 of the cube."""
    rows = []
    for low in (1.0, 5.0):
        for rig in RIGS_DEG:
            limits = np.radians([low, 15.0])
            plan = optimal_plan(16, inclination_range=(limits[0], limits[1]), rig_sd=np.radians(rig))
            shown = np.linspace(low, 15.0, 8)
            ours, cube = azimuth_deg(plan, rig, shown), azimuth_deg(plans.orthogonal(), rig, shown)
            rows.append(
                {"range_deg": (low, 15.0), "rig_sd_deg": rig, "aimed_16_deg": max(ours), "cube_24_deg": max(cube)}
            )
    return rows


def times() -> dict:
    """How long the next position and the value of a plan take."""
    captured, candidates = plans.twelve(), len(stand_within().positions())
    taken = {}
    for name, call in (("next position", next_position), ("value of a plan", plan_value)):
        taken[name] = statistics.median(laps(partial(call, captured), 15))
    return {"candidates": candidates, "seconds": taken}


def run() -> dict:
    """Everything this benchmark measures."""
    return {"classical": classical(), "aimed": aimed(), "near_vertical": near_vertical(), "times": times()}


def report(result: dict) -> None:
    """Tables side by side."""
    heads = "/".join(f"{i:g}" for i in SHOWN_DEG)
    print(f"azimuth sd, deg, at inclination {heads}; worst over 10-90 deg")
    for rig in RIGS_DEG:
        print(f"\nrig sd {rig:g} deg\n{'plan':18}{'found':34}{'specified':34}{'worst':>7}{'allowed':>9}{'s':>6}")
        for row in (r for r in result["classical"] if r["rig_sd_deg"] == rig):
            _line(row["plan"], row, f"{row['criterion_deg']:7.4f}")
        for row in (r for r in result["aimed"] if r["rig_sd_deg"] == rig):
            tail = f"{row['found_deg']:7.4f}{row['required_deg']:9.3f}{row['seconds']:6.1f}"
            _line(f"aimed {row['stations']}", row, tail)
    print("\nnear vertical: worst azimuth sd of 16 aimed positions, and of the 24 of the cube")
    for row in result["near_vertical"]:
        low, high = row["range_deg"]
        pair = f"{row['aimed_16_deg']:.4f}, cube {row['cube_24_deg']:.4f}"
        print(f"inclination {low:g} to {high:g} deg, rig sd {row['rig_sd_deg']:g} deg: {pair}")
    taken = result["times"]
    print(
        f"\n{taken['candidates']} candidates: "
        + ", ".join(f"{k} {1e3 * v:.0f} ms" for k, v in taken["seconds"].items())
    )


def _line(name: str, row: dict, tail: str) -> None:
    print(f"{name:18}{_row(row['azimuth_sd_deg']):34}{_row(row['specified_deg']):34}{tail}")


def _row(values) -> str:
    return "/".join(f"{x:.4f}".removeprefix("0") for x in values)


if __name__ == "__main__":
    command(__doc__, run, report)

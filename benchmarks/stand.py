"""What it is worth to state what is known of the stand: the joint fit against the closed form of each shipped plan.

    python -m benchmarks.stand [--json] [--draws 40]

Random tools near their nominal axes (0.3 mg, 20 nT, no converter), dip 70. The stand is level, pointed at north and its
dip known within 0.05 degrees, drawn anew for each tool; the closed form takes these angles as they are stated, the
joint fit by default knows nothing of them, and stated it is told their values and standard deviations and that of each
dial. All three read the same simulated readings. Scored on noise-free readings of the true tool at inclinations 20, 45
and 70.
"""

from __future__ import annotations

import numpy as np

from benchmarks import command
from inclinometry.calibration import plans
from inclinometry.calibration.closed_form_results import (
    calibrate_orthogonal,
    calibrate_rotations,
    calibrate_twelve,
)
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InclinometryError
from inclinometry.simulate.bench import (
    Rig,
    simulate_bench,
)
from inclinometry.simulate.tool import realistic_tool
from inclinometry.workflow.calibrate import true_errors

DIP, STAND_SD = np.radians(70.0), np.radians(0.05)
INCLINATIONS = np.radians([20.0, 45.0, 70.0])
PLANS = {
    "twelve": (plans.twelve(), calibrate_twelve),
    "orthogonal": (plans.orthogonal(), calibrate_orthogonal),
    "half": (plans.half(), calibrate_orthogonal),
    "two-face": (plans.two_face(), calibrate_orthogonal),
    "rotations": (plans.rotations(), calibrate_rotations),
    "rotations 45/135": (plans.rotations(np.pi / 4.0), calibrate_rotations),
}
# standard deviation of azimuth, inclination, toolface in degrees
DIALS = {"0": (0.0,) * 3, "0.1": (0.1,) * 3, "0.3": (0.3,) * 3, "roll +-1": (0.0, 0.0, 1.0 / np.sqrt(3.0))}
METHODS = ("default", "stated", "closed form")


def one(plan: plans.Plan, closed, dials: str, seed: int) -> tuple[dict[str, np.ndarray], int]:
    """Squared errors (inclination, azimuth), rad^2, of each method on one simulated run; how many refused it."""
    rng = np.random.default_rng(seed)
    tool = realistic_tool(seed, bits=None)
    written = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    sd = np.radians(DIALS[dials])
    draws = (
        np.sqrt(3.0) * rng.uniform(-1.0, 1.0, written.shape)
        if dials.startswith("roll")
        else rng.normal(size=written.shape)
    )
    tilt, north, dip = STAND_SD * rng.normal(size=2), STAND_SD * rng.normal(), DIP + STAND_SD * rng.normal()
    rig = Rig(dip=dip, base_tilt=float(np.hypot(*tilt)), tilt_axis=float(np.arctan2(*tilt)), north_offset=north)
    run = simulate_bench(tool, rig, *(written + sd * draws).T, seed=seed)
    known = {**run.reference, "dip": DIP, "north": 0.0}
    readings = BenchReadings(run.signals, *written.T, units=run.units, reference=known)
    found, refused = {}, 0
    for name, call in (
        ("default", lambda: calibrate_joint(readings)),
        (
            "stated",
            lambda: calibrate_joint(
                readings,
                rig_sd=sd,
                field_prior={"accelerometer": ([0.0, 0.0, 1.0], STAND_SD)},
                reference_sd={"dip": STAND_SD, "north": STAND_SD},
                diagnose=False,
            ),
        ),
        ("closed form", lambda: closed(readings)),
    ):
        try:
            found[name] = np.mean(true_errors(call().tool, tool, dip, INCLINATIONS)[:, :2] ** 2, axis=0)
        except InclinometryError:
            refused += 1
    return found, refused


def run(draws: int = 40) -> dict:
    """Rms errors in degrees by plan, dials, method."""
    rows = []
    for name, (plan, closed) in PLANS.items():
        for dials in DIALS:
            results = [one(plan, closed, dials, seed) for seed in range(1, draws + 1)]
            rms = {
                method: np.degrees(np.sqrt(np.mean([f[method] for f, _ in results if method in f], axis=0))).tolist()
                for method in METHODS
            }
            rows.append({"plan": name, "dials": dials, "refused": sum(r for _, r in results), "rms deg": rms})
    worst = max(max(np.divide(row["rms deg"]["stated"], row["rms deg"]["closed form"])) for row in rows)
    return {"draws": draws, "rows": rows, "worst stated over closed form": float(worst)}


def lines(result: dict) -> list[str]:
    """The table in Markdown."""
    head = ["plan", "dials, deg"]
    head += [f"{angle}, {method}" for angle in ("inclination", "azimuth") for method in METHODS]
    table = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in result["rows"]:
        cells = [f"{row['rms deg'][method][angle]:.3f}" for angle in (0, 1) for method in METHODS]
        table.append("| " + " | ".join([row["plan"], row["dials"], *cells]) + " |")
    return table


def report(result: dict) -> None:
    """Print the table."""
    print(f"rms error of the calibration alone, deg, {result['draws']} tools a row; stand known within 0.05 deg")
    print("\n".join(lines(result)))
    print(f"refused: {sum(row['refused'] for row in result['rows'])}")
    print(
        f"joint with the stand stated over the closed form, worst: {result['worst stated over closed form']:.3f}",
        end="",
    )
    print(" (allowed 1.05)")


if __name__ == "__main__":
    command(__doc__, run, report)

"""The adaptive plan: how many positions until the uncertainty of the 24-position plan is certified.

    python -m benchmarks.adaptive [--runs 12] [--json]

By design: with sensors as noisy as stated, the worst U(azimuth) over the range falls below that of the 24 orthogonal
positions after so many positions, beside the smallest fixed optimal plan that reaches it. In simulation: tools and rigs
with drawn errors, captured and judged as the bench does it; the sensors' noise is what the samples of a reading show.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks import command
from inclinometry.calibration import plans
from inclinometry.calibration.design import NOISE, optimal_plan, plan_value
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.progress import AIM, Goal, Progress, _next_position, proposal, session_progress
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, find_rig, put_rig, put_tool
from inclinometry.laboratory.session import Capture, capture, load_session, open_session
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

RANGES = ((1.0, 15.0), (5.0, 15.0), (10.0, 60.0), (10.0, 90.0))
RIGS = (0.03, 0.1)
SIMULATED = (5.0, 15.0)
RIG_SD = float(np.radians(0.1))
MOST = 40
SAMPLES = 50
"""Averaged in a reading; their scatter tells the noise."""


def run(runs: int = 12) -> dict:
    """Positions needed, by design for each range and rig, and in simulated runs for wells up to 15 degrees."""
    design = [_by_design(span, sd) for span in RANGES for sd in RIGS]
    needed = [_simulated(seed) for seed in range(runs)]
    return {"design": design, "simulated": {"range_deg": SIMULATED, "rig_sd_deg": 0.1, "needed": needed}}


def _by_design(span: tuple[float, float], sd: float) -> dict:
    """Positions of an adaptive run without noise, and of the smallest fixed optimal plan that reaches as much."""
    about = {"inclination_range": tuple(np.radians(span)), "rig_sd": float(np.radians(sd))}
    target = plan_value(plans.orthogonal(), **about)
    goal = Goal(u_azimuth=2.0 * target / AIM, inclination_range=about["inclination_range"])
    taken = np.zeros((0, 3))
    while len(taken) < MOST:
        place = _next_position(taken, goal, Progress(len(taken), None, "", np.nan, np.nan, {}, False), about)
        taken = np.vstack([taken, [place.azimuth, place.inclination, place.toolface]])
        if place.value <= target:
            break
    fixed = next(n for n in range(9, MOST) if plan_value(optimal_plan(n, **about), **about) <= target)
    return {
        "range_deg": span,
        "rig_sd_deg": sd,
        "needed": len(taken),
        "best fixed": fixed,
        "u_deg": float(np.degrees(target)),
    }


def _simulated(seed: int) -> int:
    """Positions of one adaptive run whose goal is what a 24-position run of the same tool certified."""
    goal = Goal(inclination_range=tuple(np.radians(SIMULATED)))
    tool = realistic_tool(seed)
    with tempfile.TemporaryDirectory() as folder, create(Path(folder) / "ledger.sqlite") as ledger:
        put_tool(ledger, RegisteredTool("T", "simulated"), author="bench")
        put_rig(ledger, RegisteredRig("R", (RIG_SD, RIG_SD, RIG_SD)), author="bench")
        rig = find_rig(ledger, "R")
        session = open_session(ledger, "T", plans.orthogonal(), rig="R", author="bench")
        for position in session.positions:
            reading = _reading(tool, position.dial, seed, position.number)
            capture(ledger, session.id, position.number, reading, author="bench")
        target = session_progress(load_session(ledger, session.id), goal, rig).from_calibration[1]
        session = open_session(ledger, "T", plans.Plan("adaptive", [0.0], [0.0], [0.0]), rig="R", author="bench")
        for number in range(1, MOST + 1):
            now = session_progress(session, goal, rig)
            if now.from_calibration[1] <= target:
                break
            # what a calibration can do about a goal is beside the noise of one reading
            wanted = Goal(u_azimuth=float(np.hypot(target, now.noise[1])), inclination_range=goal.inclination_range)
            place = proposal(session, wanted, rig, now)
            dial = (place.azimuth, place.inclination, place.toolface)
            capture(ledger, session.id, number, _reading(tool, dial, seed + 1000, number), author="bench")
            session = load_session(ledger, session.id)
        return len(session.valid)


def _reading(tool, dial, seed: int, number: int) -> Capture:
    stand = Rig(dip=np.radians(70.0), setting_sd=RIG_SD)
    angles = ([x] for x in dial)
    random = np.random.default_rng([seed, number, 1])
    # of the mean of a reading: what the design assumes, 12 bits and the sensors' noise
    noise = {k: NOISE[k] * np.linalg.norm(t.tensor[0], axis=1) for k, t in tool.triads.items()}
    found = simulate_bench(tool, stand, *angles, noise=noise, seed=np.random.SeedSequence([seed, number]))
    spread = {k: np.sqrt(random.chisquare(SAMPLES - 1, len(v)) / (SAMPLES - 1) * SAMPLES) for k, v in noise.items()}
    sd = {k: v * spread[k] for k, v in noise.items()}
    return Capture({kind: values[0] for kind, values in found.signals.items()}, dial, SAMPLES, sd=sd)


def report(found: dict) -> None:
    """Print both tables."""
    print("positions until the worst U(azimuth) of the 24 orthogonal positions is reached, by design")
    for row in found["design"]:
        low, high = row["range_deg"]
        where = f"inclination {low:g}-{high:g} deg, rig {row['rig_sd_deg']:g} deg"
        print(f"  {where}: {row['needed']:2d}, best fixed plan {row['best fixed']}")
    needed = np.array(found["simulated"]["needed"])
    low, high = found["simulated"]["range_deg"]
    print(
        f"in {len(needed)} simulated runs, {low:g}-{high:g} deg, rig 0.1 deg: median {np.median(needed):g}, "
        f"{np.mean(needed <= 16):.0%} need at most 16, most {needed.max()}"
    )


if __name__ == "__main__":
    command(__doc__, run, report)

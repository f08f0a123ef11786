"""Dials that count in another way than was said: how many pass in silence, and how many right files are refused.

    python -m benchmarks.conventions [--draws 10000] [--fits 40]

Random tools (scales 5 %, of a workshop or with axes turned at random), any rig (tilt to 20 deg, any north), dip -85 to
85, rig sd to 0.5 deg, 12-bit converters, on the plans twelve, orthogonal, half, two-face, rotations and an optimal one.
The dip is stated to 0.5 deg, the rig's zero is not. Every draw is judged at the linear start of the fit, where the
dials are judged; some go through the whole fit. A case is silent when it is neither refused nor named in a warning.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from benchmarks import command
from inclinometry.calibration import plans
from inclinometry.calibration.conventions import Dials, check_axes, check_dials
from inclinometry.calibration.design import optimal_plan
from inclinometry.calibration.initial_values import fix_signs, starting_state
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import Model
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InclinometryError, settled
from inclinometry.findings import without_notes
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import random_tool, realistic_tool

INCLINATIONS = ("vertical", "other-end", "horizontal", "horizontal-up")
COUNTS = ("clockwise", "counterclockwise")
WAYS = [Dials(i, a, t) for i in INCLINATIONS for a in COUNTS for t in COUNTS]


def case(seed, plan, way):
    """Readings of a random tool on a random rig whose dials count in a way of their own."""
    draw = np.random.default_rng(seed)
    layout = (realistic_tool, random_tool)[seed // 6 % 2]
    dip = np.radians(draw.uniform(-85.0, 85.0))
    rig = Rig(
        dip=dip,
        base_tilt=np.radians(draw.uniform(0.0, 20.0)),
        north_offset=draw.uniform(0.0, 2.0 * np.pi),
        setting_sd=np.radians(draw.uniform(0.0, 0.5)),
    )
    run = simulate_bench(layout(seed), rig, plan.azimuth, plan.inclination, plan.toolface, bits=12, seed=seed)
    shown = as_shown(way, plan)
    stated = {"dip": float(np.clip(dip + np.radians(draw.normal(0.0, 0.5)), -1.57, 1.57))}
    return BenchReadings(run.signals, *shown, units=run.units, reference=stated)


def as_shown(way, plan):
    """What dials that count in a way of their own show at the settings of a plan."""
    shown = way.settings(plan.azimuth, plan.inclination, plan.toolface)
    # each reading is its own inverse but the one from the horizontal upwards
    return (shown[0], plan.inclination - np.pi / 2.0, shown[2]) if way.inclination_from == "horizontal-up" else shown


def judged(readings):
    """What the checks before the fit say: "refused", "named" or "silent"."""
    size = len(readings)
    ones = np.ones((size, sum(v.shape[1] for v in readings.channels.values())))
    settings = np.stack(readings.dials, axis=1)
    model = Model(readings.channels, settings, np.ones((size, 1)), ones, np.zeros(3), np.zeros(4), {})
    try:
        # the directions as good as a fit finds them; at one azimuth the start takes the stand for level
        u = np.radians(0.3 if np.ptp(settings[:, 0]) else 30.0)
        start, assumed = fix_signs(starting_state(model), readings.reference, {}, u**2 * np.eye(4))
        said = settled([*assumed, *check_dials(readings), *check_axes(start)])
    except InclinometryError:
        return "refused"
    return "named" if said else "silent"


def fitted(readings):
    """The same through the whole fit."""
    try:
        found = calibrate_joint(readings)
    except InclinometryError:
        return "refused"
    return "named" if without_notes(found.findings) else "silent"


def run(draws=10_000, fits=40):
    """Counts of what became of right and of misread files, by plan."""
    kinds = {name: getattr(plans, name)() for name in ("twelve", "orthogonal", "half", "two_face", "rotations")}
    kinds["optimal"] = optimal_plan(16, restarts=1)
    counts = {}
    for name, judge, number in (("start", judged, draws), ("fit", fitted, fits)):
        for which, ways in (("right", WAYS[:1]), ("misread", WAYS[1:])):
            for draw in range(number):
                plan = list(kinds)[draw % len(kinds)]
                way = ways[(draw // 12) % len(ways)]
                if which == "misread" and np.array_equal(as_shown(way, kinds[plan]), as_shown(WAYS[0], kinds[plan])):
                    continue  # at one azimuth of 0 it counts alike either way
                told = judge(case(draw, kinds[plan], way))
                counts.setdefault(f"{name} {which} {plan}", Counter())[told] += 1
                if (which, told) in (("right", "refused"), ("misread", "silent")):
                    print(f"{name}: {which} file {told}: plan {plan}, seed {draw}, {way.way}", flush=True)
    return {key: dict(value) for key, value in counts.items()}


def report(results):
    """Print the counts."""
    print(f"{'judged at, file, plan':32} {'refused':>8} {'named':>8} {'silent':>8}")
    for key, value in results.items():
        print(f"{key:32} " + " ".join(f"{value.get(told, 0):8}" for told in ("refused", "named", "silent")))


if __name__ == "__main__":
    command(__doc__, run, report)

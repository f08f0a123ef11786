"""The numbers of the page on moving tools; `docs/computed.py` puts them into it.

    python docs/support/motion_figures.py

prints them. All come from the benchmarks, with the seeds the page names.
"""

from __future__ import annotations

import numpy as np
from benchmarks import honest_drilling, honest_motion, motion, motion_findings, motion_robust

from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.result import FLAGS
from inclinometry.motion.window_filter import WindowFilterSettings
from inclinometry.simulate.drilling import SCENARIOS
from support.figures import table

DRAWS, TOOLS, SEEDS, STRINGS, SLOW_RUNS = 5, 16, 6, 40, 24
VQF = {
    "VQF": {"smooth": (0.014, 2.809), "vibration-5g": (0.026, 2.831), "stick-slip": (0.129, 3.690),
            "sliding": (0.060, 1.066), "fast": (0.042, 13.003)},
    "offline VQF": {"smooth": (0.014, 0.966), "vibration-5g": (0.025, 0.999), "stick-slip": (0.086, 1.465),
                    "sliding": (0.012, 2.631), "fast": (0.045, 5.472)},
}  # fmt: skip
"""vqf 2.1.2, where it is not installed: what `python -m benchmarks.motion_findings` measured with it."""


def pair(values: tuple[float, float], places: int = 3) -> str:
    """Inclination / azimuth."""
    return " / ".join(f"{value:.{places}f}" for value in values)


def words() -> dict[str, str]:
    """Scenarios and flags as the package has them."""
    rows = [[f"`{name}`", SCENARIOS[name].summary] for name in motion.NAMES]
    return {
        "scenario_words": table(["scenario", "what happens"], rows),
        "motion_flags": table(["flag", "meaning"], [[f"`{name}`", text] for name, text in FLAGS.items()]),
        "clipped_share": f"{100.0 * MagneticSettings().clipped_share:g} %",
        "least_arc": f"{np.degrees(MagneticSettings().least_arc):.0f}",
        "igg3": " and ".join(f"{k:g}" for k in WindowFilterSettings().igg3 or ()),
    }


def scenarios() -> dict[str, str]:
    """The benchmark's two tables."""
    found = motion.run(DRAWS, TOOLS)
    ways = list(next(iter(found["table"].values())))
    given = [
        [f"`{name}`, {seconds} s", pair(want), _cell(found["table"][name][f"magnetic {seconds} s"])]
        for (name, seconds), want in motion.REFERENCE.items()
    ]
    some = list(next(iter(found["drawn tools"].values())))
    honest = [[f"`{name}`", *(_honest(cells[way]) for way in some)] for name, cells in found["drawn tools"].items()]
    return {
        **{
            f"scenario_{angle}": table(
                ["scenario", *ways],
                [[f"`{name}`", *(_one(cells[way], angle) for way in ways)] for name, cells in found["table"].items()],
            )
            for angle in ("inclination", "azimuth")
        },
        "motion_reference": table(["scenario, window", "reference", "found"], given),
        "honest_table": table(["scenario", *some], honest),
        "scenario_draws": str(DRAWS),
        "scenario_refused": _refused(found["table"]),
        "honest_tools": str(TOOLS),
    }


def _refused(cells: dict) -> str:
    """What share of the rows was refused, where any was."""
    lost = [
        f"{100.0 * one['refused']:.0f} % of {way} in `{name}` ({', '.join(one['why refused'])})"
        for name, ways in cells.items()
        for way, one in ways.items()
        if one["refused"]
    ]
    return f"Refused: {'; '.join(lost)}." if lost else "No window was refused."


def _one(one: dict, angle: str) -> str:
    """Error of one angle."""
    return f"{one[f'{angle}_deg']:.3f}" if f"{angle}_deg" in one else "none"


def _cell(one: dict) -> str:
    """Errors, and what was refused."""
    lost = f", {100.0 * one['refused']:.0f} % refused" if one["refused"] else ""
    return (pair((one["inclination_deg"], one["azimuth_deg"])) if "inclination_deg" in one else "none") + lost


def _honest(one: dict) -> str:
    """Error, stated uncertainty and their ratio."""
    if "inclination_deg" not in one:
        return "refused"
    lost = f", {100.0 * one['refused']:.0f} % refused" if one["refused"] else ""
    return f"{one['normalised squared error']:.2f} ({one['azimuth_deg']:.3f}, {one['u_azimuth_deg']:.3f}){lost}"


def strings() -> dict[str, str]:
    """What a drill string does, with tools whose errors are drawn, and whether the stated uncertainty covers it."""
    found = honest_drilling.run(STRINGS)
    rows = [
        [
            name,
            *(
                f"{one[angle]['rms']:.3f} / {one[angle]['u']:.3f}, {one[angle]['z2']:.2f}, {one[angle]['coverage']:.2f}"
                for angle in ("inclination", "azimuth")
            ),
            f"{100.0 * one['doubted']:.0f} %",
        ]
        for name, one in found["scenarios"].items()
    ]
    return {
        "strings_table": table(["what happens", "inclination", "azimuth", "flagged"], rows),
        "strings_tools": str(STRINGS),
    }


def findings() -> dict[str, str]:
    """What does not work, measured."""
    found = motion_findings.run(SEEDS)
    single, clip = found["instantaneous"], found["clipping"]
    weights = {(row["k0"], row["k1"]): row["rms_deg"] for row in found["raw weights"]}
    orders = [
        [f"{row['rpm']:g}", way, _steps(row[way]["steps to overflow"]), f"{row[way]['stated_deg']:.2g}"]
        for row in found["first order"]
        for way in ("first order", "exact")
    ]
    return {
        "finding_seeds": str(SEEDS),
        "single_samples": pair((single["inclination_deg"], single["azimuth_deg"]), 0),
        "means_table": _means(found["means"]),
        "skirts_table": table(
            ["below 15 Hz", *found["skirts"][0]["rms_deg"]],
            [[_skirt(row["order"]), *(pair(value) for value in row["rms_deg"].values())] for row in found["skirts"]],
        ),
        "aliasing_table": table(
            ["decimation", "error, deg"], [[name, pair(value)] for name, value in found["aliasing"].items()]
        ),
        "clipping_table": table(["range", "error, deg"], [[name, pair(row["rms_deg"])] for name, row in clip.items()]),
        "arc_table": table(
            ["arc, deg", "circle fitted, deg", "worst, deg", "left alone, deg"],
            [
                [
                    f"{row['arc_deg']:.0f}",
                    *(f"{row[name]:.2f}" for name in ("circle_deg", "largest_deg", "left alone_deg")),
                ]
                for row in found["short arc"]
            ],
        ),
        "weights_table": table(
            ["$k_0$, $k_1$", "error, deg"],
            [["none" if k0 is None else f"{k0:g}, {k1:g}", pair(value)] for (k0, k1), value in weights.items()],
        ),
        "order_table": table(
            ["rpm", "transition", "steps until it overflows", "stated about the vertical, deg"], orders
        ),
        "walking_table": _walking(found["walking filters"]),
    }


def _means(rows: list[dict]) -> str:
    ways = list(rows[0]["rms_deg"])
    body = [[f"{row['scenario']}, {row['window_s']} s", *(pair(row["rms_deg"][way]) for way in ways)] for row in rows]
    return table(["run, window", *ways], body)


def _skirt(order: int) -> str:
    return f"{6 * order} dB an octave" if order else "a sharp edge"


def _steps(count: int | None) -> str:
    return "never" if count is None else f"{count} ({count * 0.005:.0f} s at 200 Hz)"


def _walking(measured: dict) -> str:
    cells = VQF | measured
    names = list(next(iter(cells.values())))
    rows = [[way, *(pair(cells[way][name], 2) for name in names)] for way in cells]
    return table(["filter", *(f"`{name}`" for name in names)], rows)


def robust() -> dict[str, str]:
    """Filters of windows, part by part; raw samples re-weighted; a magnetised body passed."""
    cases = {case: motion_robust.compare(case, 1) for case in motion_robust.CASES}
    ways = ("plain", "Huber", "IGG-III", "Yang three", "strong tracking", "IGG-III + Yang three", "... + Sage-Husa")
    rows = [
        [case, *(f"{one[way]['filter']['rms_deg']:.3f} ({one[way]['filter']['squared']:.1f})" for way in ways)]
        for case, one in cases.items()
    ]
    raw, passing = motion_robust.raw_samples(2), motion_robust.drilling(1)
    kinds, passes = (list(next(iter(part.values()))) for part in (raw, passing))
    return {
        "robust_table": table(["case", *ways], rows),
        "raw_table": table(
            ["scenario", *kinds], [[f"`{n}`", *(f"{one[k]:.3f}" for k in kinds)] for n, one in raw.items()]
        ),
        "passing_table": table(
            ["scenario", *passes], [[f"`{n}`", *(pair(one[k]) for k in passes)] for n, one in passing.items()]
        ),
    }


def slow() -> dict[str, str]:
    """Motions by methods: is the stated uncertainty honest where a tool hardly turns, heaves, or is shaken?"""
    rows = honest_motion.run(SLOW_RUNS)
    head = ["motion", "method", "error", "u", "z²", "within 1.96 u", "the same, inclination", "flagged", "refused"]
    cells = [
        [
            row["motion"],
            row["method"],
            *(f"{row[name]:.2f}" for name in ("error", "u", "z2", "coverage", "inclination")),
            *(f"{100.0 * row[name]:.0f} %" for name in ("flagged", "refused")),
        ]
        for row in rows
    ]
    return {"slow_table": table(head, cells), "slow_runs": str(SLOW_RUNS)}


def everything() -> dict[str, str]:
    """All of them."""
    return words() | scenarios() | strings() | robust() | findings() | slow()


if __name__ == "__main__":
    for key, text in everything().items():
        print(f"{key}:\n{text}\n")

"""The numbers of the page on moving tools, worked out when the documentation is built.

    python docs/support/motion_figures.py

prints them. All come from the benchmarks, with the seeds the page names.
"""

from __future__ import annotations

from benchmarks import motion, motion_findings, motion_robust

from inclinometry.motion.result import FLAGS
from inclinometry.motion.window_filter import WindowFilterSettings
from inclinometry.simulate.drilling import SCENARIOS
from support.figures import table

DRAWS, TOOLS, SEEDS = 5, 10, 6
VQF = {
    "VQF": {"smooth": (0.014, 2.809), "vibration-5g": (0.026, 2.831), "stick-slip": (0.129, 3.690),
            "sliding": (0.060, 1.066), "fast": (0.042, 13.003)},
    "offline VQF": {"smooth": (0.014, 0.966), "vibration-5g": (0.025, 0.999), "stick-slip": (0.086, 1.465),
                    "sliding": (0.012, 2.631), "fast": (0.045, 5.472)},
}  # fmt: skip
"""vqf 2.1.2, where it is not installed: what `python benchmarks/motion_findings.py` measured with it."""


def pair(values: tuple[float, float], places: int = 3) -> str:
    """Inclination / azimuth."""
    return " / ".join(f"{value:.{places}f}" for value in values)


def words() -> dict[str, str]:
    """Scenarios and flags as the package has them."""
    rows = [[f"`{name}`", SCENARIOS[name].summary] for name in motion.NAMES]
    return {
        "scenario_words": table(["scenario", "what happens"], rows),
        "motion_flags": table(["flag", "meaning"], [[f"`{name}`", text] for name, text in FLAGS.items()]),
        "igg3": " and ".join(f"{k:g}" for k in WindowFilterSettings().igg3 or ()),
    }


def scenarios() -> dict[str, str]:
    """The benchmark's two tables."""
    found = motion.run(DRAWS, TOOLS)
    ways = list(next(iter(found["table"].values())))
    rows = [[f"`{name}`", *(_cell(cells[way]) for way in ways)] for name, cells in found["table"].items()]
    given = [
        [f"`{name}`, {seconds} s", pair(want), _cell(found["table"][name][f"magnetic {seconds} s"])]
        for (name, seconds), want in motion.REFERENCE.items()
    ]
    some = list(next(iter(found["drawn tools"].values())))
    honest = [[f"`{name}`", *(_honest(cells[way]) for way in some)] for name, cells in found["drawn tools"].items()]
    return {
        "scenario_table": table(["scenario", *ways], rows),
        "reference_table": table(["scenario, window", "reference", "found"], given),
        "honest_table": table(["scenario", *some], honest),
        "scenario_draws": str(DRAWS),
        "honest_tools": str(TOOLS),
    }


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


def everything() -> dict[str, str]:
    """All of them."""
    return words() | scenarios() | robust() | findings()


if __name__ == "__main__":
    for key, text in everything().items():
        print(f"{key}:\n{text}\n")

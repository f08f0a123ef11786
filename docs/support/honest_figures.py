"""The numbers of the page on what no reading can show; `docs/computed.py` puts them into it.

    python docs/support/honest_figures.py

prints them. The table of the bench takes half an hour of one core; `RUNS` is how many tools each cell has.
"""

from __future__ import annotations

import numpy as np
from benchmarks import honest_bench, plausibility

from inclinometry.constants import EARTH_RATE
from inclinometry.orientation import angles, fields
from inclinometry.rotations import rotation_z, wrap_signed
from support.figures import table

RUNS = 30
DIP, FIELD = np.radians(70.0), 50_000.0  # of the table of invisible effects, nT
LATITUDE = np.radians(60.0)


def bench() -> dict[str, str]:
    """Scenes by plans: coverage of 95 %, error and u at 30 and 90 degrees, and how often something was said."""
    rows = []
    for row in honest_bench.run(RUNS)["rows"]:
        least = [min(row[f"{angle}_coverage"]) for angle in ("azimuth", "inclination")]
        whole = [float(np.mean(row[f"{angle}_coverage"])) for angle in ("azimuth", "inclination")]
        sizes = [f"{row[f'{angle}_error'][at]:.3f} / {row[f'{angle}_u'][at]:.3f}" for angle, at in SHOWN]
        cells = [f"{mean:.2f} ({low:.2f})" for mean, low in zip(whole, least, strict=True)]
        rows.append(
            [row["scene"], row["plan"].removesuffix(" positions"), *sizes, *cells, f"{100.0 * row['worded']:.0f} %"]
        )
    head = ["scene", "positions", "azimuth at 30", "azimuth at 90", "inclination at 90"]
    return {"honest_bench": table([*head, "azimuth inside", "inclination inside", "said something"], rows)}


SHOWN = (("azimuth", 1), ("azimuth", 3), ("inclination", 3))


def _moved(down, field, *, at: float, azimuth: float = np.pi / 2) -> tuple[float, float]:
    """Largest error of inclination and azimuth over toolface, deg, when the fields seen are changed."""
    toolface = np.linspace(0.0, 2.0 * np.pi, 73)
    g, b = fields(np.full(73, azimuth), np.full(73, np.radians(at)), toolface, DIP)
    found = angles(down(g), field(g, b, toolface))
    off = wrap_signed(found.azimuth - azimuth)
    return float(np.degrees(np.abs(found.inclination - np.radians(at)).max())), float(np.degrees(np.abs(off).max()))


def invisible() -> dict[str, str]:
    """What each effect of ordinary size does to a tool at inclination 60, azimuth 90, dip 70, and what shows it."""

    def same(g):
        return g

    along = np.array([0.0, 0.0, 1.0])
    lag = np.radians(360.0 * 120.0 / 60.0 * 2.5e-3)
    rows = []

    def add(effect: str, size: str, inclination: float | None, azimuth: float | None, shown: str) -> None:
        cells = ["–" if value is None else f"{max(round(value, 6), 0.0):.2g}" for value in (inclination, azimuth)]
        rows.append([effect, size, *cells, shown])

    part = 200.0 / FIELD
    moved = _moved(same, lambda g, b, t: b + part * along, at=60.0)
    add("bench: cradle magnetised along the tool", "200 nT", *moved, "the tool end for end in the cradle")
    add("bench: its zero not at north", "0.1 deg", None, 0.1, "a second tool, a sun or gyro azimuth of the stand")
    add(
        "bench: field drifts while one station is read",
        "10 nT",
        *_moved(same, lambda g, b, t: b + 2e-4 * along, at=60.0),
        "a base station magnetometer",
    )
    turn = rotation_z(np.radians(0.1))
    add(
        "bench: index mark of the tool not where the toolface dial has it",
        "0.1 deg",
        *_moved(lambda g: g @ turn.T, lambda g, b, t: b @ turn.T, at=60.0),
        "two marks a half turn apart (toolface itself errs by 0.1)",
    )
    tilt = np.radians(0.05)
    lean = np.array([[1.0, 0.0, -tilt], [0.0, 1.0, 0.0], [tilt, 0.0, 1.0]])
    add(
        "tool: housing not along the axis of the sensors' cradle",
        "0.05 deg",
        *_moved(lambda g: g @ lean.T, lambda g, b, t: b @ lean.T, at=60.0),
        "turns in V-blocks on the housing",
    )
    pulled = 30.0 / FIELD * np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    turns = "rolls by 45 degrees, inclinations between; plan optimal"
    add(
        "tool: cubic part of the accelerometer, positions along the axes",
        "3e-4",
        *_moved(lambda g: g + 3e-4 * (g**3 - g), lambda g, b, t: b, at=60.0),
        turns,
    )
    add(
        "tool: the accelerometer multiplies its axes, positions along them",
        "1e-3",
        *_moved(lambda g: g + 1e-3 * g * np.roll(g, -1, axis=-1), lambda g, b, t: b, at=60.0),
        turns,
    )
    add(
        "tool: magnetometer feels gravity, 12 positions",
        "30 nT/g",
        *_moved(same, lambda g, b, t: b + g @ pulled.T, at=60.0),
        "24 positions; a coil that turns the field",
    )
    add(
        "hole: magnetisation along the assembly",
        "200 nT",
        *moved,
        "stations in another direction; more non-magnetic length",
    )
    add("hole: declination of the reference", "0.3 deg", None, 0.3, "a field measured near by; a gyro run")
    add(
        "hole: sag and misalignment in the hole",
        "0.1 deg",
        0.1,
        0.1 / np.sin(np.radians(60.0)),
        "sag from the assembly's drawing; two tools",
    )
    add(
        "drilling: lag of the field in the collar at a constant 120 rpm",
        "2.5 ms",
        *_moved(same, lambda g, b, t: b @ rotation_z(lag).T, at=60.0),
        "one change of speed, or a stop",
    )
    add(
        "gyro: bias of the axis along the hole, one position",
        "0.05 deg/h",
        None,
        float(np.degrees(np.radians(0.05) / 3600.0 / (EARTH_RATE * np.cos(LATITUDE)))),
        "readings half a turn apart",
    )
    add(
        "gyro: turn about the vertical slower than its bias is known",
        "0.02 deg/h",
        None,
        0.02,
        "a second station (an error an hour)",
    )
    across = np.array([1.0, 0.0, 0.0])
    aged = _moved(lambda g: g + 0.002 / 9.81 * across, lambda g, b, t: b + 35.0 / FIELD * across, at=60.0)
    add("any: zeros aged by half of the ISCWSA's AB, MB", "2 mm/s², 35 nT", *aged, "six positions; the tool's history")
    head = ["effect", "ordinary size", "inclination, deg", "azimuth, deg", "what shows it"]
    return {"invisible": table(head, rows)}


def whole_runs(runs: int = 200, right: int = 2000) -> dict[str, str]:
    """Mistakes of whole runs along a hole: the share that is named, and false alarms."""
    rows = [
        [str(row["fault"]), *(f"{100.0 * row[name]:.0f} %" for name in ("named", "refused")), row["honest"] or "–"]
        for row in plausibility.faults(runs)
    ]
    alarms = {(seed, what) for seed, _, what, _ in plausibility.right(right)}
    real, doubted = plausibility.real()
    return {
        "whole_runs": table(["mistake", "named", "refused", "not named"], rows),
        "whole_runs_false": f"{len(alarms)} of {3 * right}",
        "whole_runs_real": f"{len({name for name, _ in doubted})} of {real}",
    }


def whole_benches(runs: int = 20, right: int = 2000, visits: int = 100) -> dict[str, str]:
    """The same of bench readings."""
    rows = [
        [str(row["fault"]), *(f"{100.0 * row[name]:.0f} %" for name in ("said", "refused"))]
        for row in plausibility.bench_faults(runs)
    ]
    alarms, again, copies = plausibility.bench_right(right, visits)
    return {
        "whole_benches": table(["mistake", "refused or warned of", "refused"], rows),
        "whole_benches_false": f"{len({seed for seed, _ in alarms})} of {right}",
        "own_readings": f"{copies} of {visits}",
        "own_readings_false": f"{again} of {visits}",
    }


def everything() -> dict[str, str]:
    """All of them."""
    return bench() | invisible() | whole_runs() | whole_benches()


if __name__ == "__main__":
    for name, value in everything().items():
        print(f"{name}: {value}")

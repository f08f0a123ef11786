"""Minimum curvature beside wellpathpy and welleng: times, and how far apart they end.

    python -m benchmarks.path [--json] [--rounds 9]

Every figure that is judged is a ratio of two measurements of the same round; rounds alternate between the programs and
medians are given. Each program is called as its users do, with what it wants: wellpathpy in degrees, welleng's
geometry alone (no error model), ours with its checks. One core.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable

import numpy as np
import wellpathpy
from welleng.utils import MinCurve

from benchmarks import command
from benchmarks.measure import alternating
from inclinometry.survey.path import interpolate, minimum_curvature

STATIONS = 1_000_000
WELL = 10_000.0  # length, m, of every case: what one ends at then means something
FEW = 300  # a usual well
POINTS = 100_000
WANTED = {"times_fastest_peer": 3.0, "difference_m": 1e-9}


def case(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth, inclination and azimuth of a well that builds, drops and turns, unevenly surveyed."""
    random = np.random.default_rng(4)
    md = np.cumsum(random.uniform(0.5, 1.5, count))
    md = WELL * (md - md[0]) / (md[-1] - md[0])
    noise = np.radians(0.05) * random.standard_normal((2, count))
    inclination = np.radians(60.0 + 25.0 * np.sin(md / 700.0)) + noise[0]
    return md, inclination, np.radians(200.0 + 120.0 * np.sin(md / 1100.0)) + noise[1]


def programs(count: int) -> dict[str, Callable[[], np.ndarray]]:
    """Name -> call that returns north, east and tvd (3, n)."""
    md, inclination, azimuth = case(count)
    slope_deg, heading_deg = np.degrees(inclination), np.degrees(azimuth)

    def ours() -> np.ndarray:
        path = minimum_curvature(md, inclination, azimuth)
        return path.north, path.east, path.tvd

    def first() -> np.ndarray:
        tvd, north, east, _ = wellpathpy.mincurve.minimum_curvature(md, slope_deg, heading_deg)
        return north, east, tvd

    def second() -> np.ndarray:
        return MinCurve(md, inclination, azimuth, frame="nev").poss.T

    return {"inclinometry": ours, "wellpathpy": first, "welleng": second}


def points() -> dict[str, Callable[[], np.ndarray]]:
    """Name -> call that interpolates a usual well at many depths."""
    md, inclination, azimuth = case(FEW)
    wanted = np.random.default_rng(1).uniform(0.0, WELL, POINTS)
    path, other = minimum_curvature(md, inclination, azimuth), MinCurve(md, inclination, azimuth, frame="nev")

    def ours() -> np.ndarray:
        found = interpolate(path, wanted)
        return found.north, found.east, found.tvd

    return {"inclinometry": ours, "welleng": lambda: other.interpolate(wanted, angles=True)[0].T}


def extended(count: int) -> np.ndarray:
    """North, east and tvd (3, n) in extended precision."""
    md, inclination, azimuth = (column.astype(np.longdouble) for column in case(count))
    sine = np.sin(inclination)
    t = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(inclination)])
    p, q = t[:, 1:] + t[:, :-1], t[:, 1:] - t[:, :-1]
    tangent = np.sqrt(np.sum(q * q, axis=0) / np.sum(p * p, axis=0))
    step = 0.5 * np.diff(md) * tangent / np.arctan(tangent) * p
    return np.concatenate([np.zeros((3, 1), np.longdouble), np.cumsum(step, axis=1)], axis=1)


def evaluate(table: dict[str, Callable[[], np.ndarray]], rounds: int) -> dict:
    """Medians of times and of ratios taken round by round, and largest distances to us along one axis."""
    times = alternating(table, rounds)
    ours, own = np.array(table["inclinometry"]()), times["inclinometry"]
    peers = [name for name in table if name != "inclinometry"]
    ratios = {
        name: statistics.median(peer / mine for peer, mine in zip(times[name], own, strict=True)) for name in peers
    }
    return {
        "ms": {name: 1e3 * statistics.median(values) for name, values in times.items()},
        "ratios": ratios,
        "times_fastest_peer": min(ratios.values()),
        "difference_m": {name: float(np.abs(np.array(table[name]()) - ours).max()) for name in peers},
    }


def run(rounds: int = 9) -> dict:
    """Everything this benchmark measures."""
    result = {
        "stations": {str(count): evaluate(programs(count), rounds) for count in (FEW, STATIONS)},
        "points": evaluate(points(), rounds),
    }
    exact = extended(STATIONS)
    result["error_m"] = {
        name: float(np.abs(np.array(call()) - exact).max()) for name, call in programs(STATIONS).items()
    }
    large = result["stations"][str(STATIONS)]
    result["fulfilled"] = {
        "times_fastest_peer": large["times_fastest_peer"] >= WANTED["times_fastest_peer"],
        "difference_m": max(part["difference_m"]["wellpathpy"] for part in result["stations"].values())
        <= WANTED["difference_m"],
    }
    return result


def report(result: dict) -> None:
    """Print the tables."""
    print(f"minimum curvature of a {WELL:g} m well, one core, medians of ratios of the same round")
    rows = [(f"{count} stations", part) for count, part in result["stations"].items()]
    for name, part in [*rows, (f"{POINTS} points between {FEW} stations", result["points"])]:
        print(f"  {name}: {part['ms']['inclinometry']:.3f} ms")
        for peer, ratio in part["ratios"].items():
            print(f"    {peer:12s} {ratio:7.1f} times as long; largest difference {part['difference_m'][peer]:.1e} m")
    print(f"  wanted beside the fastest peer: {WANTED['times_fastest_peer']:g} times, {WANTED['difference_m']:.0e} m")
    print("largest error of a position against extended precision, 1e6 stations")
    for name, error in result["error_m"].items():
        print(f"    {name:12s} {error:.1e} m")
    verdict = {True: "yes", False: "NO"}
    print("fulfilled: " + ", ".join(f"{name} {verdict[ok]}" for name, ok in result["fulfilled"].items()))


if __name__ == "__main__":
    command(__doc__, run, report)

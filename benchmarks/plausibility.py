"""Mistakes in whole runs: which share is named, and how often a right run is doubted.

    python -m benchmarks.plausibility [--runs N] [--right N] [--real] [--json]

Nothing of the package makes the holes: shapes, courses, tortuosity, sensor errors and readings are drawn here from
seeds 0, 1, .. `named` is the share of runs in which the check that is meant spoke (of a single station: of that
station), `said` that in which any did. A right run that is refused or warned of is a false alarm.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.plausibility import check_whole, taken_before
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InclinometryError, settled
from inclinometry.files.bench_csv import saturation
from inclinometry.findings import Finding, without_notes
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool
from inclinometry.survey.holes import check_holes
from inclinometry.survey.plausibility import check_run
from inclinometry.survey.run import Run

RIGHT_SEED = 1_000_000
"""Seeds of the right runs begin here, those of the faults at 0."""
ALONG = np.array([0.0, 0.0, 1.0])


class Well(NamedTuple):
    """A simulated run: md m; inclination, azimuth deg as a file has them; g m/s2, b nT in tool axes."""

    shape: str
    md: np.ndarray
    inclination: np.ndarray
    azimuth: np.ndarray
    g: np.ndarray
    b: np.ndarray
    inside: np.ndarray  # tangents without errors


# Shapes: depths and angles (deg) between which a hole bends evenly; (md, inclination, azimuth).


def _vertical(r):
    end = r.uniform(400, 3500)
    away = r.uniform(0, 360)
    return [(0, 0, away), (end / 2, r.uniform(0.0, 1.2), away), (end, r.uniform(0.0, 2.0), away + r.uniform(-60, 60))]


def _build(r):
    kick, rate, hold = r.uniform(100, 1500), r.uniform(0.7, 6.0), r.uniform(15, 75)
    a = r.uniform(0, 360)
    top = kick + 30.0 * hold / rate
    return [
        (0, 0, a),
        (kick, 0, a),
        (top, hold, a),
        (top + r.uniform(300, 2500), hold + r.uniform(-3, 3), a + r.uniform(-6, 6)),
    ]


def _s_shape(r):
    nodes = _build(r)[:3]
    md, inclination, a = nodes[-1]
    end, last = md + r.uniform(200, 1200), r.uniform(0, 10)
    drop = end + 30.0 * (inclination - last) / r.uniform(0.8, 3.0)
    return [*nodes, (end, inclination, a), (drop, last, a + r.uniform(-5, 5)), (drop + r.uniform(100, 800), last, a)]


def _horizontal(r):
    kick, rate, a = r.uniform(300, 2500), r.uniform(2.0, 12.0), r.uniform(0, 360)
    land = kick + 30.0 * 90.0 / rate
    nodes = [(0, 0, a), (kick, 0, a), (land, r.uniform(87, 93), a)]
    for _ in range(r.integers(2, 9)):
        nodes.append((nodes[-1][0] + r.uniform(100, 350), r.uniform(85, 96), a + r.uniform(-6, 6)))
    return nodes


def _turn(r):
    nodes = _build(r)[:3]
    md, inclination, a = nodes[-1]
    for _ in range(r.integers(1, 4)):
        turn = r.uniform(-100, 100)
        md += 30.0 * abs(turn) * np.sin(np.radians(inclination)) / r.uniform(1.0, 4.0) + 60.0
        a += turn
        inclination = float(np.clip(inclination + r.uniform(-20, 20), 10, 92))
        nodes.append((md, inclination, a))
    return nodes


def _short_radius(r):
    kick, a = r.uniform(500, 2000), r.uniform(0, 360)
    land = kick + 90.0 / r.uniform(25.0, 58.0) * 30.0
    return [(kick - 200, 0.5, a), (kick, 0.5, a), (land, 90, a), (land + r.uniform(50, 250), r.uniform(87, 93), a)]


def _sidetrack(r):
    start, i, a = r.uniform(1000, 3000), r.uniform(0, 60), r.uniform(0, 360)
    away, up = r.uniform(-12, 12), r.uniform(0, 6)  # off a whipstock in a course or two
    nodes = [(start, i, a), (start + 300, i, a), (start + 300 + r.uniform(15, 60), i + up, a + away)]
    i, a = i + up, a + away
    return [*nodes, (nodes[-1][0] + r.uniform(300, 900), min(i + r.uniform(0, 40), 92), a + r.uniform(-20, 20))]


def _mine(r):
    i, a, end = r.uniform(20, 100), r.uniform(0, 360), r.uniform(80, 900)
    return [
        (0, i, a),
        (end, float(np.clip(i + end / 100 * r.uniform(-3, 3), 5, 120)), a + end / 100 * r.uniform(-3, 3)),
    ]


def _up(r):
    i, a = r.uniform(95, 150), r.uniform(0, 360)
    end = r.uniform(40, 280) if r.random() < 0.7 else r.uniform(280, 700)
    return [(0, i, a), (end, i + r.uniform(-4, 4), a + r.uniform(-4, 4))]


def _slant(r):
    i, a, end = r.uniform(12, 45), r.uniform(0, 360), r.uniform(500, 2500)
    if r.random() < 0.3:
        a = r.uniform(0, 5)
    turn, hold = r.uniform(-60, 80), r.uniform(0, 0.4) * end
    return [(0, i, a), (hold, i, a), (end, float(np.clip(i + r.uniform(-8, 25), 10, 60)), a + turn)]


def _crossing(r):
    a, end = r.uniform(0, 360), r.uniform(200, 1200)
    return [
        (0, r.uniform(74, 84), a),
        (end / 4, 88, a),
        (3 * end / 4, 91, a + r.uniform(-10, 10)),
        (end, r.uniform(96, 104), a),
    ]


SHAPES = {
    "vertical": _vertical,
    "build and hold": _build,
    "S": _s_shape,
    "horizontal": _horizontal,
    "turn": _turn,
    "short radius": _short_radius,
    "sidetrack": _sidetrack,
    "mine hole": _mine,
    "up hole": _up,
    "river crossing": _crossing,
    "slant": _slant,
}


def _depths(r, start, end, sharp):
    """Courses of many habits, with stations between at a casing shoe, gaps, and parts of a gyro multishot."""
    habit = r.choice(["stand", "metric", "joint", "multishot", "mixed"], p=[0.4, 0.25, 0.1, 0.15, 0.1])
    spacing = {
        "stand": r.uniform(26, 30),
        "metric": r.choice([5.0, 10.0, 15.0, 20.0, 25.0, 30.0]),
        "joint": r.uniform(8.5, 10),
        "multishot": r.choice([1.0, 2.0, 5.0, 10.0]),
        "mixed": 30.0,
    }[habit]
    if sharp:
        spacing = min(spacing, 10.0)
    spacing = max(spacing, (end - start) / 400.0)
    md = np.arange(start + (0.0 if r.random() < 0.5 else r.uniform(0, spacing)), end, spacing)
    if habit in ("stand", "joint"):
        md = md + r.normal(0.0, 0.02 * spacing, md.size).clip(-0.3 * spacing, 0.3 * spacing)
    if habit == "mixed" and md.size > 6:
        first = md[r.integers(1, md.size - 3)]
        md = np.union1d(md, first + np.arange(1.0, 60.0, r.choice([1.0, 2.0, 5.0])))
    if r.random() < 0.35 and md.size > 4:  # a station taken again at a shoe or after a trip
        md = np.union1d(md, md[r.integers(1, md.size - 1)] + r.uniform(0.3, 0.9 * spacing))
    if r.random() < 0.25 and md.size > 12:  # a gap behind casing, or a tool that failed
        first = r.integers(2, md.size - 8)
        md = np.delete(md, np.arange(first, first + r.integers(1, 6)))
    if r.random() < 0.3:  # projected to the bit, or the last shot on bottom
        md = np.append(md, md[-1] + (r.uniform(2.0, 25.0) if r.random() < 0.8 else r.uniform(25.0, 400.0)))
    md = md[(md >= 0) & (md <= 14_000)]
    md = np.round(md, int(r.choice([1, 2, 2, 3])))
    return md[np.concatenate([[True], np.diff(md) > 0.05])]


def well(seed: int, shape: str | None = None) -> Well:
    """A right run."""
    r = np.random.default_rng(seed)
    shape = shape or list(SHAPES)[seed % len(SHAPES)]
    nodes = np.array(SHAPES[shape](r), dtype=float)
    md = _depths(r, nodes[0, 0], nodes[-1, 0], shape == "short radius")
    if md.size < 5:
        md = np.linspace(nodes[0, 0], nodes[-1, 0], 9)
    i, a = (np.interp(md, nodes[:, 0], nodes[:, c]) for c in (1, 2))
    t = _tangent(i, a)
    # tortuosity: slides and rotations, of 10 to 200 m
    wave = r.uniform(20, 200)
    size = np.radians(r.choice([0.05, 0.2, 0.5]))
    for direction in _across(t):
        phase = r.uniform(0, 2 * np.pi, 3)
        bends = sum(np.sin(2 * np.pi * md / (wave * k) + p) for k, p in zip((1.0, 1.7, 2.9), phase, strict=True)) / 2.0
        t = t + size * bends[:, None] * direction
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    kind = r.choice(["gyro", "mwd", "rough"], p=[0.3, 0.55, 0.15])
    noise, heading = {"gyro": (0.02, 0.05), "mwd": (0.08, 0.35), "rough": (0.25, 0.9)}[kind]
    high, lateral = _across(t)
    seen = t + np.radians(noise * r.normal(size=(md.size, 1))) * high
    # azimuth errs as sin I in a hole, and as the tilt does in a vertical one
    sideways = np.hypot(heading * np.sqrt(1.0 - t[:, 2] ** 2), noise)
    seen = seen + np.radians(sideways * r.normal(size=md.size))[:, None] * lateral
    seen = seen + np.radians(r.normal(0.0, 0.1)) * high  # sag
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    inclination = np.degrees(np.arctan2(np.hypot(seen[:, 0], seen[:, 1]), seen[:, 2]))
    azimuth = np.degrees(np.arctan2(seen[:, 1], seen[:, 0])) % 360.0
    g, b = _axes(r, inclination, azimuth)
    digits = int(r.choice([1, 2, 2, 3]))
    return Well(shape, md, inclination.round(digits), azimuth.round(digits) % 360.0, g, b, t)


def _tangent(i, a):
    i, a = np.radians(i), np.radians(a)
    return np.stack([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)], axis=1)


def _across(t):
    """Two unit vectors across each tangent: up the high side, and level (of a vertical hole: north and east)."""
    level = np.cross(ALONG, t)
    size = np.linalg.norm(level, axis=1, keepdims=True)
    level = np.where(size > 1e-6, level / np.maximum(size, 1e-12), np.array([0.0, 1.0, 0.0]))
    return np.cross(level, t), level


def _axes(r, inclination, azimuth):
    """Six axes with errors of sensors, an assembly's field, and toolfaces of a turned or of a sliding tool."""
    n = inclination.size
    if r.random() < 0.7:
        toolface = r.uniform(0, 2 * np.pi, n)
    else:
        toolface = np.repeat(r.uniform(0, 2 * np.pi, n // 5 + 1), 5)[:n] + r.normal(0, 0.2, n)
    i, a = np.radians(inclination), np.radians(azimuth)
    dip, field = np.radians(r.uniform(40, 80) * r.choice([1, 1, 1, -1])), r.uniform(30e3, 60e3)
    ca, sa, ci, si, ct, st = np.cos(a), np.sin(a), np.cos(i), np.sin(i), np.cos(toolface), np.sin(toolface)

    def tool(north, east, down):
        x = north * ca + east * sa
        y = -north * sa + east * ca
        high, z = ci * x - si * down, si * x + ci * down
        return np.stack([ct * high + st * y, -st * high + ct * y, z], axis=1)

    g = 9.81 * tool(0.0, 0.0, 1.0)
    b = field * tool(np.cos(dip), 0.0, np.sin(dip))
    # the angles of these axes err a little: bias, scale and noise
    g = g * (1.0 + r.normal(0, 5e-4, 3)) + r.normal(0, 0.003, 3) + r.normal(0, 0.002, (n, 3))
    b = (
        b * (1.0 + r.normal(0, 1.6e-3, 3))
        + r.normal(0, 70.0, 3)
        + r.normal(0, 35.0, (n, 3))
        + r.normal(0, 300.0) * ALONG
    )
    if r.random() < 0.2:  # steel of the casing above, which fades
        b = b + (r.normal(0, 1500.0, 3) * np.exp(-np.arange(n)[:, None] / r.uniform(0.4, 2.0)))
    return g.round(4), b.round(1)


def table(one: Well) -> Run:
    """The run as a table of angles."""
    return Run(one.md, np.radians(one.inclination), np.radians(one.azimuth))


def axes(one: Well) -> Run:
    """The run as six axes."""
    return Run.of_fields(one.md, one.g, one.b)


# Faults. Each returns what the checks are given and the stations that are wrong, () for all; None where there is none.


REFUSED: Final = "refused by the reader"


def _changed(one: Well, *, md=None, inclination=None, azimuth=None) -> Run | str:
    md = one.md if md is None else md
    inclination = one.inclination if inclination is None else inclination
    azimuth = one.azimuth if azimuth is None else azimuth
    if (np.diff(md) <= 0).any() or md[-1] > 20e3 or inclination.max() > 180.0 or azimuth.max() >= 360.0:
        return REFUSED
    return Run(md, np.radians(inclination), np.radians(azimuth))


def _row(r, one: Well) -> int:
    return int(r.integers(2, max(one.md.size - 2, 3)))


def _set(values, row, value):
    changed = values.copy()
    changed[row] = value
    return changed


def _feet(r, one):
    return _changed(one, md=one.md / 0.3048), ()


def _half_feet(r, one):
    row = one.md.size // 2
    return _changed(one, md=np.where(np.arange(one.md.size) >= row, one.md / 0.3048, one.md)), ()


def _ten_last(r, one):
    return _changed(one, md=_set(one.md, -1, one.md[-1] * 10.0)), ()


def _one_depth(r, one):
    row = _row(r, one)
    return _changed(one, md=_set(one.md, row, one.md[row] + r.choice([-10.0, 10.0, 20.0]))), ()


def _from_midway(name, size, least=0.0) -> Callable:
    """An angle, or the depth, is off from the middle of the run on, where the hole is inclined as much there, deg."""

    def fault(r, one):
        row = one.md.size // 2
        if one.inclination[row - 1 : row + 1].min() < least:
            return None, ()
        values = np.where(np.arange(one.md.size) >= row, getattr(one, name) + size, getattr(one, name))
        return _changed(one, **{name: values % 360.0 if name == "azimuth" else values}), ()

    return fault


def _constant(name: str, value: float, *, least: float = 5.0) -> Callable:
    """An angle that has one value at every station of a run that is inclined and measured."""

    def fault(r, one):
        if np.median(one.inclination) < least or one.md.size < 12:
            return None, ()
        return _changed(one, **{name: np.full(one.md.size, value)}), ()

    return fault


def _kept_azimuth(r, one):
    """An azimuth that keeps its value from the middle of the run on."""
    row = one.md.size // 2
    if one.inclination[row:].min() < 5.0 or one.md.size < 24:
        return None, ()
    rows = np.arange(row, one.md.size)
    return _changed(one, azimuth=_set(one.azimuth, rows, one.azimuth[row])), tuple(rows)


def _slope(r, one):
    """Inclination in per cent of slope, as of a well that the reader of angles takes."""
    one = well(int(r.integers(1_000_000)), "build and hold")
    if not 48.0 < one.inclination.max() < 60.9 or one.md[0] > 100.0:
        return None, ()
    return _changed(one, inclination=(100.0 * np.tan(np.radians(one.inclination))).round(1)), ()


def _vertical_depths(r, one):
    """True vertical depths under the name of measured ones, of a hole with even courses that bends."""
    course = np.diff(one.md)
    if np.mean(np.abs(course / np.median(course) - 1.0) < 0.05) < 0.9 or np.ptp(one.inclination) < 20.0:
        return None, ()
    if one.inclination.max() > 85.0 or one.md.size < 12:
        return None, ()
    down = np.cos(np.radians(one.inclination))
    return _changed(one, md=(one.md[0] + np.append(0.0, np.cumsum(course * (down[1:] + down[:-1]) / 2.0))).round(2)), ()


def _feet_onwards(r, one):
    """Depths that are counted on in feet from the middle of an even run."""
    course = np.diff(one.md)
    if np.mean(np.abs(course / np.median(course) - 1.0) < 0.05) < 0.9 or one.md.size < 12:
        return None, ()
    course[course.size // 2 :] /= 0.3048
    return _changed(one, md=(one.md[0] + np.append(0.0, np.cumsum(course))).round(2)), ()


def _grads_onwards(r, one):
    row = one.md.size // 2
    below = np.arange(one.md.size) >= row
    if one.md.size < 12 or not 20.0 < one.inclination[row] < 150.0 or one.azimuth[below].max() >= 323.0:
        return None, ()
    if one.azimuth[row] < 60.0:
        return None, ()
    return _changed(one, inclination=np.where(below, one.inclination / 0.9, one.inclination),
                    azimuth=np.where(below, one.azimuth / 0.9, one.azimuth)), ()  # fmt: skip


def _grads(r, one):
    return _changed(one, inclination=one.inclination / 0.9, azimuth=one.azimuth / 0.9), ()


def _grads_below(r, one):
    """Azimuths as of a hole that nowhere heads beyond 324 deg."""
    if one.azimuth.max() >= 323.0 or one.inclination.max() > 162.0:
        return None, ()
    return _grads(r, one)


def _one_in_radians(name: str) -> Callable:
    def fault(r, one):
        if one.inclination.max() < 20.0:
            return None, ()
        return _changed(one, **{name: np.radians(getattr(one, name)).round(4)}), ()

    return fault


def _exchanged(r, one):
    return _changed(one, inclination=one.azimuth, azimuth=one.inclination), ()


def _radians(r, one):
    return _changed(one, inclination=np.radians(one.inclination).round(4), azimuth=np.radians(one.azimuth).round(4)), ()


def _horizon(r, one):
    return _changed(one, inclination=np.abs(90.0 - one.inclination)), ()


def _other_end(r, one):
    return _changed(one, inclination=180.0 - one.inclination), ()


def _half_turn(r, one):
    return _changed(one, azimuth=(one.azimuth + 180.0) % 360.0), ()


def _mirror(r, one):
    return _changed(one, azimuth=(360.0 - one.azimuth) % 360.0), ()


def _quadrant(r, one):
    """An azimuth by an arctangent of one argument: half a turn off where north is negative."""
    wrong = (one.azimuth > 90.0) & (one.azimuth < 270.0)
    if min(np.sum(wrong & (one.inclination > 20.0)), np.sum(~wrong & (one.inclination > 20.0))) < 2:
        return None, ()
    return _changed(one, azimuth=np.where(wrong, (one.azimuth + 180.0) % 360.0, one.azimuth)), ()


def _magnetic(r, one):
    return _changed(one, azimuth=(one.azimuth + r.uniform(3, 12)) % 360.0), ()


def _pasted(r, one):
    row = int(r.integers(1, max(one.md.size - 5, 2)))
    rows = np.arange(row, min(row + 5, one.md.size))
    return _changed(one, inclination=_set(one.inclination, rows, one.inclination[row]),
                    azimuth=_set(one.azimuth, rows, one.azimuth[row])), ()  # fmt: skip


def _pasted_axes(r, one):
    row = int(r.integers(1, max(one.md.size - 5, 2)))
    rows = np.arange(row, min(row + 5, one.md.size))
    return Run.of_fields(one.md, _set(one.g, rows, one.g[row]), _set(one.b, rows, one.b[row])), ()


def _rows_exchanged(r, one):
    row = _row(r, one)
    t = _tangent(one.inclination, one.azimuth)
    apart = np.degrees(np.arccos(np.clip(t @ t[row], -1.0, 1.0)))
    far = np.flatnonzero((apart > 3.0) & (np.arange(one.md.size) > 0) & (np.arange(one.md.size) < one.md.size - 1))
    if not far.size:
        return None, ()
    other = int(far[np.abs(far - row).argmin()])
    order = np.arange(one.md.size)
    order[[row, other]] = order[[other, row]]
    return _changed(one, inclination=one.inclination[order], azimuth=one.azimuth[order]), (row, other)


def _digit(column: str, size: float) -> Callable:
    def fault(r, one):
        row = _row(r, one)
        values = getattr(one, column)
        if column == "azimuth" and not 20.0 < one.inclination[row] < 160.0:
            return None, ()
        sign = 1.0 if r.random() < 0.5 else -1.0
        if column == "inclination" and not 0.0 <= values[row] + sign * size <= 180.0:
            sign = -sign
        wrong = (values[row] + sign * size) % 360.0
        return _changed(one, **{column: _set(values, row, wrong)}), (row,)

    return fault


def _axis_digit(name: str, size: float) -> Callable:
    def fault(r, one):
        row, axis = _row(r, one), int(r.integers(3))
        changed = {"g": one.g.copy(), "b": one.b.copy()}
        changed[name][row, axis] += size * (1.0 if r.random() < 0.5 else -1.0)
        return Run.of_fields(one.md, changed["g"], changed["b"]), (row,)

    return fault


def _copied_readings(r, one):
    """Two single readings, each given again at another depth, tool and all."""
    size = one.md.size
    if size < 12:
        return None, ()
    here = r.choice(np.arange(1, size - 1), 4, replace=False)
    g, b = one.g.copy(), one.b.copy()
    g[here[:2]], b[here[:2]] = g[here[2:]], b[here[2:]]
    return Run.of_fields(one.md, g, b), tuple(here[:2])


def _clipped(share: float) -> Callable:
    def fault(r, one):
        """An axis of the magnetometer that ends at a share of its largest reading."""
        axis, b = int(r.integers(2)), one.b.copy()
        end = np.round(share * np.abs(b[:, axis]).max())
        clipped = np.abs(b[:, axis]) > end
        if clipped.sum() < 3 or clipped.mean() > 0.8:
            return None, ()
        b[:, axis] = np.clip(b[:, axis], -end, end)
        return Run.of_fields(one.md, one.g, b), tuple(np.flatnonzero(clipped))

    return fault


def _unit(g: float, b: float) -> Callable:
    return lambda r, one: (Run.of_fields(one.md, g * one.g, b * one.b), ())


def raw(one: Well, seed: int, change: Callable | None = None) -> Run:
    """The run as raw channels of a tool with its calibration, `change` made to them."""
    tool, size = realistic_tool(seed), {"accelerometer": 9.80665, "magnetometer": float(np.median(_lengths(one.b)))}
    given = {"accelerometer": one.g, "magnetometer": one.b}
    channels = {kind: tool.triads[kind].signals(v / size[kind]).round(1) for kind, v in given.items()}
    channels = channels if change is None else change(channels)

    def fields_of(some):
        g, b = (size[kind] * tool.triads[kind].field(some[kind]) for kind in size)
        return g, b

    return replace(Run.of_fields(one.md, *fields_of(channels)), channels=channels, fields=fields_of)


def _lengths(values):
    return np.linalg.norm(values, axis=1)


def _raw(change: Callable) -> Callable:
    return lambda r, one: (raw(one, int(r.integers(1_000_000)), change), ())


def _raw_clipped(channels):
    mag = channels["magnetometer"]
    end = np.round(0.8 * np.abs(mag[:, 0]).max())
    return {**channels, "magnetometer": np.column_stack([mag[:, 0].clip(-end, end), mag[:, 1:]])}


def _turned(order, signs) -> Callable:
    def fault(r, one):
        return Run.of_fields(one.md, one.g[:, order] * signs, one.b[:, order] * signs), ()

    return fault


class Fault(NamedTuple):
    """A mistake: what makes it, the names of the checks that may name it, and what no reading shows of it."""

    make: Callable
    names: tuple[str, ...]
    honest: str = ""


FAULTS = {
    "depths in feet under metres": Fault(_feet, ("depths",), "where courses are no stand of pipe"),
    "second half of the depths in feet": Fault(_half_feet, ("depths",)),
    "last depth times 10": Fault(_ten_last, ("depths",)),
    "one depth 10 or 20 m off": Fault(_one_depth, ("depths",), "where courses have no habit"),
    "depths 100 m off from midway": Fault(
        _from_midway("md", 100.0), ("depths",), "courses of no habit, or that divide 100 m"
    ),
    "depths 20 m less from midway": Fault(_from_midway("md", -20.0), ("depths",), "where courses have no habit"),
    "inclination and azimuth exchanged": Fault(
        _exchanged, ("columns", "units"), "in a straight hole that does not begin at the top"
    ),
    "both angles in radians": Fault(_radians, ("units",)),
    "inclination alone in radians, over 20 deg": Fault(_one_in_radians("inclination"), ("units",), "rough readings"),
    "azimuth alone in radians, over 20 deg": Fault(_one_in_radians("azimuth"), ("units",), "rough azimuths"),
    "both angles in grads": Fault(_grads, ("units",), "azimuths below 360, no level part"),
    "both angles in grads, azimuths below 360": Fault(_grads_below, ("units",), "no level part"),
    "inclination from the horizontal": Fault(_horizon, ("columns",), "in a hole that does not begin vertical"),
    "inclination from the other end": Fault(_other_end, ("columns",), "in a hole of a mine"),
    "azimuth half a turn off": Fault(_half_turn, ("direction",), "always: the hole is as smooth"),
    "azimuth mirrored": Fault(_mirror, ("direction",), "always: the hole is as smooth"),
    "azimuth of another north": Fault(_magnetic, ("direction",), "always: the hole is as smooth"),
    "azimuth 6 deg off from midway, inclined over 20 deg": Fault(
        _from_midway("azimuth", 6.0, 20.0), ("direction",), "a turn of the hole looks so"
    ),
    "azimuth 12 deg off from midway, inclined over 20 deg": Fault(
        _from_midway("azimuth", 12.0, 20.0), ("direction",), "a turn of the hole looks so"
    ),
    "azimuth 30 deg off from midway, inclined over 20 deg": Fault(
        _from_midway("azimuth", 30.0, 20.0), ("direction",), "where the hole turns as sharply elsewhere"
    ),
    "inclination 12 deg off from midway, inclined over 20 deg": Fault(
        _from_midway("inclination", 12.0, 20.0), ("direction",), "a build looks so"
    ),
    "inclination 28 deg off from midway, inclined over 20 deg": Fault(
        _from_midway("inclination", 28.0, 20.0), ("direction", "columns"), "where the hole bends as sharply elsewhere"
    ),
    "both angles in grads from midway, inclined over 20 deg": Fault(
        _grads_onwards, ("direction", "columns"), "a turn of a few deg looks so"
    ),
    "azimuth 0 at every station, inclined": Fault(_constant("azimuth", 0.0), ("constant",), "coarse digits"),
    "azimuth 90 at every station, inclined": Fault(_constant("azimuth", 90.0), ("constant",), "coarse digits"),
    "inclination 0 at every station": Fault(_constant("inclination", 0.0), ("constant",), "rough azimuths"),
    "azimuth kept from midway, inclined": Fault(_kept_azimuth, ("constant", "direction"), "coarse digits"),
    "inclination in per cent of slope, beyond 48 deg": Fault(_slope, ("columns",)),
    "true vertical depths under measured, even courses": Fault(_vertical_depths, ("depths",)),
    "depths counted on in feet from midway, even courses": Fault(_feet_onwards, ("depths",)),
    "half the quadrants wrong, the hole turns, over 20 deg": Fault(_quadrant, ("direction", "columns", "station")),
    "one reading at five depths, angles": Fault(_pasted, ("repeats",), "in a straight part with few digits"),
    "one reading at five depths, six axes": Fault(_pasted_axes, ("repeats",)),
    "two stations exchanged, over 3 deg apart": Fault(
        _rows_exchanged, ("order", "station"), "where they differ by less"
    ),
    "one inclination 1 deg off": Fault(_digit("inclination", 1.0), ("station",), "a bend of 2 deg/30 m looks so"),
    "one inclination 10 deg off": Fault(_digit("inclination", 10.0), ("station", "direction")),
    "one azimuth 10 deg off, inclined over 20 deg": Fault(_digit("azimuth", 10.0), ("station",), "4 deg of hole"),
    "one azimuth 100 deg off, inclined over 20 deg": Fault(_digit("azimuth", 100.0), ("station", "direction")),
    "y and z of both triads exchanged": Fault(_turned([0, 2, 1], 1.0), ("axes",), "a tool that never turns"),
    "x and z of both triads exchanged": Fault(_turned([2, 1, 0], 1.0), ("axes",), "a tool that never turns"),
    "x, y, z of both triads cycled": Fault(_turned([1, 2, 0], 1.0), ("axes",), "a tool that never turns"),
    "z of both triads reversed": Fault(_turned([0, 1, 2], [1.0, 1.0, -1.0]), ("axes",), "in a hole of a mine"),
    "all axes of both triads reversed": Fault(_turned([0, 1, 2], -1.0), ("axes",), "in a hole of a mine"),
    "y of both triads reversed": Fault(_turned([0, 1, 2], [1.0, -1.0, 1.0]), ("axes",), "always: the hole is mirrored"),
    "single readings again at other depths": Fault(_copied_readings, ("repeats",), "one reading in a straight part"),
    "one axis of b clipped at 80 %": Fault(_clipped(0.8), ("totals",), "under three stations at the end"),
    "b in uT under nT": Fault(_unit(1.0, 1e-3), ("units",)),
    "g in g under m/s2": Fault(_unit(1.0 / 9.80665, 1.0), ("units",)),
    "raw: y and z of both triads exchanged": Fault(
        _raw(lambda some: {kind: v[:, [0, 2, 1]] for kind, v in some.items()}), ("axes",)
    ),
    "raw: accelerometer and magnetometer exchanged": Fault(
        _raw(lambda some: dict(zip(some, reversed(some.values()), strict=True))), ("axes",)
    ),
    "raw: y of both triads reversed": Fault(
        _raw(lambda some: {kind: v * [1.0, -1.0, 1.0] for kind, v in some.items()}),
        ("axes",),
        "a tool whose offsets and skew axes are small",
    ),
    "raw: x of the magnetometer clipped at 80 %": Fault(
        _raw(_raw_clipped), ("totals",), "under three stations at the end"
    ),
    "one axis of b 900 nT off": Fault(_axis_digit("b", 900.0), ("totals", "station"), "across the field"),
    "one axis of b 9000 nT off": Fault(_axis_digit("b", 9000.0), ("totals", "station")),
    "one axis of g 0.1 m/s2 off": Fault(_axis_digit("g", 0.1), ("totals", "station"), "across gravity"),
    "one axis of g 1 m/s2 off": Fault(_axis_digit("g", 1.0), ("totals", "station")),
}


def named(found: list[Finding], fault: Fault, rows: tuple[int, ...]) -> bool:
    """Whether a finding is of the group that is meant, and of one of the stations that are wrong."""
    return any(one.group in fault.names and (not rows or set(rows) & set(one.rows)) for one in found)


def faults(runs: int, only: str = "") -> list[dict[str, object]]:
    """Share named of each fault, over shapes."""
    rows = []
    for place, (words, fault) in enumerate(FAULTS.items()):
        if only not in words:
            continue
        count = said = meant = refused = 0
        for k in range(runs):
            seed = place * 10_000 + k
            made, stations = fault.make(np.random.default_rng(seed), well(seed))
            if made is None:
                continue
            count += 1
            if made is REFUSED:  # a range that the reader of the file keeps
                meant, said, refused = meant + 1, said + 1, refused + 1
                continue
            found = check_run(made)
            said += bool(found)
            refused += any(one.severity == "refused" for one in found)
            meant += named(found, fault, stations)
        rows.append({"fault": words, "runs": count, "named": meant / max(count, 1), "said": said / max(count, 1),
                     "refused": refused / max(count, 1), "honest": fault.honest})  # fmt: skip
    return rows


def assumed(seed: int) -> dict[str, Run]:
    """Right tables with rows that nobody measured: a vertical section, a landed one, a plan, a plan of few digits."""
    r, one = np.random.default_rng([seed, 7]), well(seed, ("build and hold", "horizontal", "S")[seed % 3])
    upright = one.md < r.uniform(0.2, 1.0) * one.md[np.argmax(one.inclination > 3.0)]
    away = np.where(upright, r.choice([0.0, 123.4]), one.azimuth)
    landed = np.arange(one.md.size) >= one.md.size - r.integers(2, 8)
    made = {"vertical section": (one.md, np.where(upright, 0.0, one.inclination), away)}
    made["landed"] = one.md, np.where(landed, 90.0, one.inclination), np.where(landed, 180.0, one.azimuth)
    nodes = np.array(SHAPES[("build and hold", "S", "horizontal", "slant")[seed % 4]](r))
    md = np.arange(nodes[0, 0], nodes[-1, 0], r.choice([10.0, 28.5, 30.0, 100.0]))
    digits = int(r.choice([0, 1, 2, 6]))
    angles = (np.interp(md, nodes[:, 0], nodes[:, c]).clip(0.0).round(digits) for c in (1, 2))
    made["plan"] = md, *angles
    flat = np.full(md.size, r.uniform(0, 360).__round__(1))
    made["plan in one plane"] = md, np.interp(md, nodes[:, 0], nodes[:, 1]).clip(0.0).round(digits), flat
    made["straight slant"] = md, np.full(md.size, 45.0), flat
    # landing: the well is where its rows say it is
    if abs(one.inclination[~landed][-1] - 90.0) > 4.0:
        del made["landed"]
    else:
        turned = (one.azimuth - one.azimuth[~landed][-1] + 180.0) % 360.0
        made["landed"] = one.md, made["landed"][1], np.where(landed, 180.0, turned)
    return {what: Run(md, np.radians(i), np.radians(a)) for what, (md, i, a) in made.items()}


def right(runs: int, first: int = RIGHT_SEED) -> list[tuple[int, str, str, Finding]]:
    """False alarms: seed, shape, kind ("angles", "axes", "raw channels", or as `assumed`), the doubt."""
    found = []
    for seed in range(first, first + runs):
        one = well(seed)
        kinds = {"angles": table(one), "axes": axes(one), "raw channels": raw(one, seed)} | assumed(seed)
        for what, run in kinds.items():
            found += [(seed, one.shape, what, doubt) for doubt in check_run(run)]
    return found


REFERENCE: Final = Path(__file__).parents[1] / "tests" / "reference"


def real() -> tuple[int, list[tuple[str, Finding]]]:
    """Real and published runs that come with the tests: how many, and what was doubted of them."""
    runs: dict[str, Run] = {}
    for path in sorted((REFERENCE / "iscwsa-mwd").glob("well?.csv")):
        md, *angles = _columns(path, ("md_m", "inclination_deg", "azimuth_deg"))
        runs[path.stem] = Run(md, *(np.radians(angle) for angle in angles))
    places = ("run", "md", "gx", "gy", "gz", "bx", "by", "bz")
    numbers = np.stack(_columns(REFERENCE / "msa" / "msa_runs.csv", places), axis=1)
    for k, part in enumerate(np.split(numbers, np.flatnonzero(np.diff(numbers[:, 0])) + 1), 1):
        runs[f"six axes {k}"] = Run.of_fields(part[:, 1], part[:, 2:5], part[:, 5:])
    return len(runs), [(name, doubt) for name, run in runs.items() for doubt in check_run(run)]


def _columns(path: Path, names: tuple[str, ...]) -> list[np.ndarray]:
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return [np.array([float(row[name]) for row in rows]) for name in names]


# Tables of drill holes.


def holes(seed: int) -> dict[str, Run]:
    """A right table of holes: planned or measured collars, compass or gyro, wedges, up and down, few shots or many."""
    r = np.random.default_rng([seed, 3])
    spacing, digits = float(r.choice([3.0, 6.0, 10.0, 25.0, 30.0, 50.0])), int(r.choice([0, 1, 1, 2]))
    noise, heading = r.choice([0.03, 0.1, 0.3]), r.choice([0.1, 0.5, 1.5])
    design, away = r.uniform(0.0, 45.0), r.uniform(0.0, 360.0)
    fan = spacing < 10.0 and r.random() < 0.4
    found = {}
    for k in range(r.integers(2, 30)):
        md = np.arange(int(r.choice([1, 2, 3, 4, 8, 20, 40]))) * spacing + (0.0 if r.random() < 0.7 else spacing)
        i = (r.uniform(0.0, 150.0) if fan else design + r.normal(0.0, 5.0)) + r.normal(0.0, 1.5) * md / 30.0 * 0.5
        a = away + r.normal(0.0, 10.0) + r.normal(0.0, 1.5) * md / 30.0 * 0.5
        if r.random() < 0.1 and md.size > 2:  # a wedge
            i = i + np.where(md > md[md.size // 2], r.uniform(-3.0, 3.0), 0.0)
        i = i + noise * r.normal(size=md.size)
        a = a + heading * r.normal(size=md.size)
        if r.random() < 0.5:  # the collar as it was set out
            i[0], a[0] = i[0] + r.normal(0.0, 1.0), a[0] + r.normal(0.0, 2.0)
        turned, i = i < 0.0, np.abs(i).clip(0.0, 180.0)
        a = np.where(turned, a + 180.0, a) % 360.0
        found[f"H{k}"] = Run(md, np.radians(i.round(digits)), np.radians(a.round(digits)))
    return found


def _shot(change: Callable) -> Callable:
    """One shot of one inclined hole of two shots or more is changed."""

    def fault(r, table):
        names = [name for name, run in table.items() if len(run.md) > 1 and np.sin(run.inclination).min() > 0.3]
        if not names:
            return None, ""
        name = names[r.integers(len(names))]
        run, row = table[name], int(r.integers(len(table[name].md)))
        i, a = run.inclination.copy(), run.azimuth.copy()
        i[row], a[row] = change(i[row], a[row])
        return table | {name: Run(run.md, i, a)}, name

    return fault


HOLE_FAULTS = {
    "one dip of the other sign": _shot(lambda i, a: (np.pi - i, a)),
    "one azimuth 100 deg off": _shot(lambda i, a: (i, a + np.radians(100.0))),
    "one azimuth half a turn off": _shot(lambda i, a: (i, a + np.pi - 1e-3)),
    "one shot of dip 0, azimuth 0": _shot(lambda i, a: (np.pi / 2.0, 0.0)),
    "one dip 20 deg off": _shot(lambda i, a: (i + np.radians(20.0), a)),
}


def hole_tables(runs: int, first: int = 0) -> tuple[list[tuple[str, int, float]], list[tuple[int, Finding]]]:
    """Share of tables in which the hole is named, by mistake; what is said of right ones."""
    rows = []
    for words, make in HOLE_FAULTS.items():
        count = hit = 0
        for seed in range(first, first + runs):
            made, name = make(np.random.default_rng(seed), holes(seed))
            if made is not None:
                count += 1
                hit += any(one.values.get("hole") == name for one in check_holes(made))
        rows.append((words, count, hit / max(count, 1)))
    right_ones = range(first, first + runs)
    return rows, [(seed, one) for seed in right_ones for one in without_notes(check_holes(holes(seed)))]


# The bench.

PLANS = {"twelve": plans.twelve(), "orthogonal": plans.orthogonal(), "half": plans.half(), "two-face": plans.two_face()}


def bench(seed: int, *, plan: str | None = None, dials_deg: float | None = None, visit: int = 0) -> BenchReadings:
    """A right run at a bench: dials good to 0.02 to 0.5 deg, a stand that leans and is off north, noise of counts.

    Another visit is to the same tool on the same stand, with errors of its own.
    """
    r = np.random.default_rng(seed)
    p = PLANS[plan or list(PLANS)[seed % len(PLANS)]]
    sd = float(r.choice([0.02, 0.1, 0.2, 0.3, 0.5])) if dials_deg is None else dials_deg
    lean, off, dip = np.radians([r.uniform(0.0, 1.0), r.uniform(-10.0, 10.0), r.uniform(30.0, 80.0)])
    toward = float(np.random.default_rng([seed, 1]).uniform(0.0, 2.0 * np.pi))
    rig = Rig(dip=dip, setting_sd=np.radians(sd), base_tilt=lean, tilt_axis=toward, north_offset=off)
    tool = realistic_tool(seed)
    noise = dict.fromkeys(tool.triads, float(r.choice([0.1, 0.5, 2.0])))
    run = simulate_bench(tool, rig, p.azimuth, p.inclination, p.toolface, noise=noise, repeats=4, seed=seed + visit)
    channels = {kind: run.signals[kind].copy() for kind in ("accelerometer", "magnetometer")}
    return BenchReadings(channels, run.azimuth, run.inclination, run.toolface, reference={"dip": dip})


def _bench_fault(words: str, seed: int) -> BenchReadings:
    """The run with a mistake."""
    words, _, plan = words.partition(", plan ")
    run, r = bench(seed, dials_deg=0.1, plan=plan or None), np.random.default_rng(seed)
    channels = {kind: values.copy() for kind, values in run.channels.items()}
    azimuth, inclination, toolface = (values.copy() for values in run.dials)
    reference, mag, size = dict(run.reference), channels["magnetometer"], len(run)
    full = np.abs(mag - mag.mean(axis=0)).max()
    first, second = r.choice(size, 2, replace=False)
    if words.startswith("two azimuths"):
        apart = np.abs(np.sin((azimuth[:, None] - azimuth[None]) / 2.0)) > 0.3
        pairs = np.argwhere(apart)
        first, second = pairs[r.integers(len(pairs))] if len(pairs) else (first, second)
        azimuth[[first, second]] = azimuth[[second, first]]
    changes: dict[str, Callable[[], object]] = {
        "azimuth reversed": lambda: np.negative(azimuth, out=azimuth),
        "toolface reversed": lambda: np.negative(toolface, out=toolface),
        "azimuth and toolface reversed": lambda: (
            np.negative(azimuth, out=azimuth),
            np.negative(toolface, out=toolface),
        ),
        "inclination from the other end": lambda: np.subtract(np.pi, inclination, out=inclination),
        "azimuth in grads": lambda: np.divide(azimuth, 0.9, out=azimuth),
        "magnetometer y reversed": lambda: np.negative(mag[:, 1], out=mag[:, 1]),
        "stated dip of the wrong sign": lambda: reference.update(dip=-reference["dip"]),
        "magnetometer saturated at 60 %": lambda: np.clip(
            mag, -0.6 * np.abs(mag).max(), 0.6 * np.abs(mag).max(), out=mag
        ),
        "magnetometer drifts by 30 %": lambda: mag.__iadd__(np.linspace(0.0, 0.3 * full, size)[:, None]),
        "gain of the magnetometer halves midway": lambda: mag[size // 2 :].__imul__(0.5),
        "gain of one channel halves midway": lambda: mag[size // 2 :, 1].__imul__(0.5),
        "gain of the magnetometer falls by a tenth midway": lambda: mag[size // 2 :].__imul__(0.9),
        "gain of one channel falls by a tenth midway": lambda: mag[size // 2 :, 1].__imul__(0.9),
        "inclination from the horizontal": lambda: np.subtract(np.pi / 2.0, inclination, out=inclination),
        "inclination and toolface exchanged": lambda: _swap(inclination, toolface),
        "magnetometer y saturated at 60 %, whole counts": lambda: _whole(channels, 0.6, slice(1, 2)),
        "magnetometer saturated at 80 %, whole counts": lambda: _whole(channels, 0.8, slice(0, 3)),
        "magnetometer y saturated at 80 %, whole counts": lambda: _whole(channels, 0.8, slice(1, 2)),
        "gain of the magnetometer drifts by 30 %": lambda: mag.__imul__(np.linspace(1.0, 1.3, size)[:, None]),
        "azimuth in radians": lambda: np.radians(azimuth, out=azimuth),
        "all dials in radians": lambda: [np.radians(dial, out=dial) for dial in (azimuth, inclination, toolface)],
        "accelerometer and magnetometer exchanged": lambda: channels.update(
            accelerometer=channels["magnetometer"], magnetometer=channels["accelerometer"]
        ),
        "y of both triads reversed": lambda: [np.negative(v[:, 1], out=v[:, 1]) for v in channels.values()],
        "two rows exchanged": lambda: [
            values.__setitem__([first, second], values[[second, first]]) for values in channels.values()
        ],
    }
    changes.get(words, lambda: None)()
    return BenchReadings(channels, azimuth, inclination, toolface, reference=reference)


def _swap(one: np.ndarray, other: np.ndarray) -> None:
    one[:], other[:] = other.copy(), one.copy()


def _whole(channels: dict[str, np.ndarray], share: float, some: slice) -> None:
    """Whole counts, and a magnetometer that ends at a share of its largest reading."""
    for values in channels.values():
        np.round(values, out=values)
    mag = channels["magnetometer"][:, some]
    end = np.round(share * np.abs(mag).max())
    np.clip(mag, -end, end, out=mag)


BENCH_FAULTS = (
    "azimuth reversed",
    "toolface reversed",
    "azimuth and toolface reversed",
    "inclination from the other end",
    "azimuth in grads",
    "magnetometer y reversed",
    "stated dip of the wrong sign",
    "magnetometer saturated at 60 %",
    "magnetometer saturated at 80 %, whole counts",
    "magnetometer y saturated at 60 %, whole counts",
    "magnetometer y saturated at 80 %, whole counts",
    "magnetometer drifts by 30 %",
    "gain of the magnetometer drifts by 30 %",
    "azimuth in radians",
    "all dials in radians",
    "accelerometer and magnetometer exchanged",
    "y of both triads reversed",
    "gain of the magnetometer halves midway",
    "gain of one channel halves midway",
    "two azimuths exchanged",
    "two rows exchanged",
    "two azimuths exchanged, plan twelve",
    "two rows exchanged, plan twelve",
    "gain of the magnetometer falls by a tenth midway",
    "gain of the magnetometer falls by a tenth midway, plan twelve",
    "gain of one channel falls by a tenth midway",
    "gain of one channel falls by a tenth midway, plan twelve",
    "inclination from the horizontal",
    "inclination and toolface exchanged",
)

_SPOKEN = {
    "bench-dials-otherwise", "bench-mistake", "bench-drift", "bench-left-handed", "bench-axes-against",
    "bench-axes-against-dials", "bench-axes-skewed", "bench-fit-poor", "bench-uncertainty-absurd",
    "bench-angle-contradicted", "bench-direction-contradicted",
}  # fmt: skip
"""Findings that name a mistake: what is said of every run of such positions does not count."""


def bench_faults(runs: int) -> list[dict[str, object]]:
    """Share of runs at a bench refused, and refused or warned of, by the calibration as a whole."""
    rows = []
    for words in BENCH_FAULTS:
        refused = said = 0
        for k in range(runs):
            run = _bench_fault(words, 50_000 + k)
            mag = run.channels["magnetometer"]
            rail = saturation("magnetometer", mag, "xyz", run.dials, np.arange(len(run)))  # as the file's reader
            try:
                said += bool(_SPOKEN & {one.code for one in calibrate_joint(run).findings}) or bool(rail)
            except InclinometryError:
                refused, said = refused + 1, said + 1
        rows.append({"fault": words, "runs": runs, "refused": refused / runs, "said": said / runs})
    return rows


def _said(run: BenchReadings) -> list[str]:
    """What is said of a run before its fit, as it is and in whole counts."""
    counts = [values for raw in run.channels.values() for values in (raw, np.round(raw))]
    rails = [saturation("magnetometer", values, "xyz", run.dials, np.arange(len(run))) for values in counts]
    return [*map(str, settled(check_whole(run))), *(note for notes in rails for note in notes)]


def bench_right(runs: int, visits: int) -> tuple[list[tuple[int, str]], int, int]:
    """False alarms of the bench: what was said of right runs; second visits taken for copies; copies found."""
    alarms = []
    for seed in range(RIGHT_SEED, RIGHT_SEED + runs):
        try:
            alarms += [(seed, sentence) for sentence in _said(bench(seed))]
        except InclinometryError as error:
            alarms.append((seed, str(error)))
    again = copies = 0
    for seed in range(RIGHT_SEED, RIGHT_SEED + visits):
        first, r = bench(seed, dials_deg=0.1), np.random.default_rng(seed)
        try:
            found = calibrate_joint(first)
        except InclinometryError:
            continue
        order = r.permutation(len(first))
        moved = {kind: v[order] + r.uniform(-0.3, 0.3, v.shape) for kind, v in first.channels.items()}
        copy = BenchReadings(moved, *(dial[order] for dial in first.dials))
        copies += taken_before(copy, found)
        again += taken_before(bench(seed, dials_deg=0.1, visit=10_000_000), found)
    return alarms, again, copies


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200, help="runs of each fault")
    parser.add_argument("--right", type=int, default=2000)
    parser.add_argument("--first", type=int, default=RIGHT_SEED)
    parser.add_argument("--only", default="", help="faults whose name has this")
    parser.add_argument(
        "--bench", type=int, default=0, help="runs of each fault at a bench, and 100 times as many right"
    )
    parser.add_argument("--holes", type=int, default=0, help="tables of drill holes, of each mistake and right")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--real", action="store_true", help="the real and published runs that come with the tests")
    options = parser.parse_args()
    if options.real:
        count, found = real()
        for name, doubt in found:
            print(name, doubt.severity, doubt.code, doubt)
        print(f"false alarms {len({name for name, _ in found})} of {count} real and published runs")
        return
    if options.holes:
        shares, wrong = hole_tables(options.holes)
        for words, count, share in shares:
            print(f"{words:54} {count:4} named {share:.2f}")
        for seed, one in wrong[:30]:
            print(seed, one.severity, one)
        print(f"false alarms {len({seed for seed, _ in wrong})} of {options.holes} right tables")
        return
    if options.bench:
        for row in bench_faults(options.bench):
            print(f"{row['fault']:54} {row['runs']:4} said {row['said']:.2f} refused {row['refused']:.2f}")
        wrong, again, copies = bench_right(100 * options.bench, 5 * options.bench)
        for seed, sentence in wrong[:20]:
            print(seed, sentence)
        alarmed = len({seed for seed, _ in wrong})
        print(
            f"false alarms {alarmed} of {100 * options.bench} right runs; of {5 * options.bench} second visits {again} "
        )
        print(f"taken for copies, of as many copies {copies} found")
        return
    rows, alarms = faults(options.runs, options.only), right(options.right, options.first)
    count = 3 * options.right + sum(len(assumed(options.first + k)) for k in range(options.right))
    false = len({(seed, what) for seed, _, what, _ in alarms}) / max(count, 1)
    if options.json:
        print(json.dumps({"faults": rows, "false_alarms": false}))
        return
    for row in rows:
        shares = " ".join(f"{name} {row[name]:.2f}" for name in ("named", "said", "refused"))
        print(f"{row['fault']:54} {row['runs']:4} {shares}")
    for seed, shape, what, doubt in alarms[:60]:
        print(seed, shape, what, doubt.severity, doubt.code, doubt)
    print(f"false alarms {100.0 * false:.2f} % of {count} runs")


if __name__ == "__main__":
    main()

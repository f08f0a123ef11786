"""The demo's run while drilling: what single samples say, a textbook filter and this package, against the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.attitude.orientation import angles
from inclinometry.attitude.rotations import dcm, dcm_from_quaternion, quaternion_from_dcm
from inclinometry.core.arrays import Array
from inclinometry.io.atomic import write_text
from inclinometry.io.run_file import open_run
from inclinometry.io.site_toml import read_site
from inclinometry.motion.run_result import DynamicRun
from inclinometry.report.digits import significant
from inclinometry.report.dynamic_truth import Found, errors_of, methods_figure, rms_of
from inclinometry.simulate.drilling import DrillingSimulation, simulate_drilling
from inclinometry.workflow.dynamic import DynamicOptions, dynamic_run, write_dynamic
from inclinometry.workflow.simulate_drilling import DrillingRequest, site_text, write_drilling

TEXTBOOK_GAIN: Final = 0.041
"""rad/s: Madgwick's own gain for gyros, accelerometers and magnetometers."""

SCENARIO: Final = "stick-slip"
SEED: Final = 1
DURATION: Final = 60.0
"""s"""
METHOD: Final = "auto"
WINDOW: Final = 10.0
"""s"""
PICTURE: Final = "stick_slip.png"
RAW, TEXTBOOK, OURS = "single samples", "textbook filter (Madgwick 2010)", "inclinometry"

Quaternion = tuple[float, float, float, float]


def textbook_filter(run: DrillingSimulation, gain: float = TEXTBOOK_GAIN) -> Array:
    """Attitude by the gradient-descent filter of textbooks: rotations (n, 3, 3) from north-east-down to tool.

    Notes
    -----
    Source: S. O. H. Madgwick, "An efficient orientation filter for inertial and inertial/magnetic sensor arrays",
    2010, equations (25), (34), (42) to (47). Two favours are done to it: it starts at the true attitude, and the gyros
    turn it by the exact exponential; his first-order step loses 0.8 % of the speed at 600 rpm and 200 Hz.
    """
    start = dcm(run.truth.azimuth[0], run.truth.inclination[0], run.truth.toolface[0])
    w, x, y, z = (float(v) for v in quaternion_from_dcm(start))
    q: Quaternion = (w, -x, -y, -z)  # his is the attitude of the tool against the Earth: the inverse
    found = np.empty((len(run), 4))
    for row, readings in enumerate(zip(_unit(run.accel), _unit(run.mag), run.gyro.tolist(), strict=True)):
        q = _step(q, *readings, run.interval, gain)
        found[row] = q
    return dcm_from_quaternion(found * [1.0, -1.0, -1.0, -1.0])


def _unit(vectors: Array) -> list[list[float]]:
    unit: list[list[float]] = (vectors / np.linalg.norm(vectors, axis=1)[:, None]).tolist()
    return unit


def _step(q: Quaternion, down: list[float], field: list[float], w: list[float], dt: float, gain: float) -> Quaternion:
    """Turned by the gyros, then a step of length gain * dt down the slope of the misfit."""
    north, east, along = _in_earth(q, field)
    slopes = _slope(q, 0.0, 1.0, down), _slope(q, math.hypot(north, east), along, field)
    slope = [a + b for a, b in zip(*slopes, strict=True)]
    size = math.sqrt(sum(v * v for v in slope)) or 1.0
    moved = [a - gain * dt * s / size for a, s in zip(_turned(q, w, dt), slope, strict=True)]
    norm = math.sqrt(sum(v * v for v in moved))
    return moved[0] / norm, moved[1] / norm, moved[2] / norm, moved[3] / norm


def _turned(q: Quaternion, w: list[float], dt: float) -> Quaternion:
    """The product of q and exp(w dt / 2)."""
    speed = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    c, s = math.cos(0.5 * speed * dt), math.sin(0.5 * speed * dt) / speed if speed > 0.0 else 0.5 * dt
    x, y, z = s * w[0], s * w[1], s * w[2]
    q0, q1, q2, q3 = q
    return (
        q0 * c - q1 * x - q2 * y - q3 * z,
        q1 * c + q0 * x + q2 * z - q3 * y,
        q2 * c + q0 * y - q1 * z + q3 * x,
        q3 * c + q0 * z + q1 * y - q2 * x,
    )


def _in_earth(q: Quaternion, m: list[float]) -> tuple[float, float, float]:
    """A reading in Earth axes."""
    q0, q1, q2, q3 = q
    return (
        m[0] * (1 - 2 * (q2 * q2 + q3 * q3)) + 2 * m[1] * (q1 * q2 - q0 * q3) + 2 * m[2] * (q1 * q3 + q0 * q2),
        2 * m[0] * (q1 * q2 + q0 * q3) + m[1] * (1 - 2 * (q1 * q1 + q3 * q3)) + 2 * m[2] * (q2 * q3 - q0 * q1),
        2 * m[0] * (q1 * q3 - q0 * q2) + 2 * m[1] * (q2 * q3 + q0 * q1) + m[2] * (1 - 2 * (q1 * q1 + q2 * q2)),
    )


def _slope(q: Quaternion, bx: float, bz: float, s: list[float]) -> Quaternion:
    """J' f: how the misfit between a field (bx, 0, bz) in Earth axes and its reading s changes with q."""
    q0, q1, q2, q3 = q
    f1 = 2 * bx * (0.5 - q2 * q2 - q3 * q3) + 2 * bz * (q1 * q3 - q0 * q2) - s[0]
    f2 = 2 * bx * (q1 * q2 - q0 * q3) + 2 * bz * (q0 * q1 + q2 * q3) - s[1]
    f3 = 2 * bx * (q0 * q2 + q1 * q3) + 2 * bz * (0.5 - q1 * q1 - q2 * q2) - s[2]
    return (
        -2 * bz * q2 * f1 + 2 * (bz * q1 - bx * q3) * f2 + 2 * bx * q2 * f3,
        2 * bz * q3 * f1 + 2 * (bx * q2 + bz * q0) * f2 + 2 * (bx * q3 - 2 * bz * q1) * f3,
        -2 * (2 * bx * q2 + bz * q0) * f1 + 2 * (bx * q1 + bz * q3) * f2 + 2 * (bx * q0 - 2 * bz * q2) * f3,
        2 * (bz * q1 - 2 * bx * q3) * f1 + 2 * (bz * q2 - bx * q0) * f2 + 2 * bx * q1 * f3,
    )


def true_course(run: DrillingSimulation) -> Found:
    """The truth at every sample."""
    return Found(run.time, run.truth.inclination, run.truth.azimuth)


def raw_course(run: DrillingSimulation) -> Found:
    """What every sample says on its own."""
    found = angles(run.accel, run.mag)
    return Found(run.time, found.inclination, found.azimuth)


def textbook_course(run: DrillingSimulation) -> Found:
    """What the textbook filter says."""
    turn = textbook_filter(run)
    found = angles(turn[:, :, 2], turn[:, :, 0])
    return Found(run.time, found.inclination, found.azimuth)


def our_course(found: DynamicRun) -> Found:
    """Windows of this package that were not refused, with their uncertainty."""
    rows, good = found.rows, ~found.rows.refused
    spread = rows.u_inclination[good], rows.u_azimuth[good]
    return Found(rows.time[good], rows.inclination[good], rows.azimuth[good], spread)


@dataclass(frozen=True, eq=False)
class DemoDrilling:
    """The run, what was found, and rms errors (name -> inclination, azimuth, deg)."""

    run: DrillingSimulation
    found: DynamicRun
    rms_deg: Mapping[str, tuple[float, float]]


def drill(folder: Path) -> DemoDrilling:
    """Simulate into files, find the attitude in three ways, draw them against the truth."""
    from inclinometry.report.figure import save_png

    folder.mkdir(parents=True, exist_ok=True)
    request = DrillingRequest(SCENARIO, SEED, DURATION)
    write_drilling(request, folder / "run.parquet", folder / "truth.parquet")
    write_text(site_text(request.chosen.hole), folder / "site.toml")
    site = read_site(folder / "site.toml")
    found = dynamic_run(open_run(folder / "run.parquet"), site, options=DynamicOptions(METHOD, WINDOW))
    write_dynamic(found, folder / "attitude.csv")
    run = simulate_drilling(request.chosen, SEED)
    shown = {RAW: raw_course(run), TEXTBOOK: textbook_course(run), OURS: our_course(found)}
    truth = true_course(run)
    rpm = 30.0 / np.pi * run.truth.rate
    save_png(methods_figure(truth, rpm, shown), folder / PICTURE)
    errors = {name: errors_of(one, truth) for name, one in shown.items()}
    return DemoDrilling(run, found, {name: (rms_of(e[0]), rms_of(e[1])) for name, e in errors.items()})


def drilling_sentences(found: DemoDrilling) -> list[str]:
    """What the picture shows, for the terminal and the page."""
    top = 30.0 / np.pi * float(found.run.truth.rate.max())
    lines = [
        f"simulated stick-slip, 0 to {top:.0f} rpm, 5 g rms and a shock a second; rms error of inclination and azimuth:"
    ]
    for name, (inclination, azimuth) in found.rms_deg.items():
        lines.append(f"{name}: {significant(inclination)} and {significant(azimuth)} deg")
    return lines

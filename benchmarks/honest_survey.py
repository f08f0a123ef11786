"""Multi-station analysis on runs of an independent simulator: scenes by error, stated uncertainty, coverage, z2.

    python -m benchmarks.honest_survey [--runs N] [--scene NAME] [--json]

Nothing of the package makes the runs: rotations, sensor errors and the azimuth of a reading are written here. Sensors
are drawn from the ISCWSA's model, the reference is off by 130 nT and 0.2 deg, each reading has noise of 0.0015 m/s^2
and 30 nT; the analysis is told nothing of this beyond its published priors. `error` and `u` are root mean squares in
deg, `coverage` the share of azimuths within 1.96 u, `z2` the mean of (error / u)^2, `warned` the share of runs with a
warning that errors are not of the size stated or a station does not fit. Beside them: the same analysis told the priors
and the noise the runs were drawn with, which no other estimator beats in the mean square, and least squares of three
magnetometer biases, with its root mean square, its median and the share of groups of ten runs in which its median is
better than the analysis'.

Then level east-west: A, the well of the shipped runs, and B, 10 to 40 stations that rotate, slide or do both,
inclination 80 to 95, azimuth within 20 deg of east-west, interference of up to 2000 nT, noise 15 to 60 nT, dip 50 to
75; and B with what sharpens it. `predicted` is what the warning promised of it, for the same wells without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from benchmarks import command
from benchmarks.measure import turned
from inclinometry.errors import IdentifiabilityError
from inclinometry.orientation import angles_jacobian
from inclinometry.survey.multistation import MultiStation, multistation
from inclinometry.survey.multistation_priors import FieldReference, KnownAzimuth, published_priors
from inclinometry.survey.stations import Stations
from inclinometry.uncertainty import propagate

G, B = 9.81, 50_000.0
NOISE = np.repeat([0.0015, 30.0], 3)
SENSORS = {"AB": 0.004, "AS": 0.0005, "MB": 70.0, "MS": 0.0016, "MXY": 0.00035}


class Scene(NamedTuple):
    """Ends of a hole, deg, or a level hole that wanders about its azimuth, and what is out of the ordinary.

    across, along, spike : interference across the tool, along it (sd) and at one station, nT
    sensors, noise, reference : errors over the ordinary ones
    exact : `along` is the interference itself
    slides : stations one after another with one toolface
    curve : stations above the hole, each 6 deg less inclined
    """

    inclination: tuple[float, float]
    azimuth: tuple[float, float]
    wanders: bool = False
    count: int = 25
    across: float = 0.0
    along: float = 600.0
    spike: float = 0.0
    sensors: float = 1.0
    noise: float = 1.0
    reference: float = 1.0
    dip: float = 70.0
    exact: bool = False
    slides: tuple[int, ...] = ()
    curve: int = 0


HOLES = {
    "build": Scene((8.0, 87.0), (285.0, 288.0)),
    "near vertical": Scene((3.0, 8.0), (40.0, 100.0)),
    "level, north-south": Scene((88.6, 91.4), (3.0, 7.0), wanders=True),
    "level, east-west": Scene((88.6, 91.4), (268.0, 272.0), wanders=True),
    "turn": Scene((10.0, 60.0), (20.0, 120.0), count=40),
    "tangent": Scene((44.0, 46.0), (130.0, 132.0)),
}
SCENES = HOLES | {
    f"{name}, {across:g} nT across": HOLES[name]._replace(across=across)
    for across in (500.0, 2000.0)
    for name in ("near vertical", "level, north-south")
}
SCENES |= {
    "build, 3000 nT along": HOLES["build"]._replace(along=3000.0),
    **{f"{name}, sensors 3 times as bad": HOLES[name]._replace(sensors=3.0) for name in ("build", "near vertical")},
    "tangent, sensors 3 times as bad": HOLES["tangent"]._replace(sensors=3.0),
    "build, noise 4 times as large": HOLES["build"]._replace(noise=4.0),
    "turn, reference off by 3 times its u": HOLES["turn"]._replace(reference=3.0),
    "turn, 1000 nT at one station": HOLES["turn"]._replace(spike=1000.0),
    "build, 6 stations": HOLES["build"]._replace(count=6),
}
"""What the model has, then what it has not."""


def lateral(rng: np.random.Generator) -> Scene:
    """A scene of B."""
    count, middle = int(rng.integers(10, 41)), rng.uniform(81.3, 93.7)
    azimuth, slides, most = rng.choice([90.0, 270.0]) + rng.uniform(-18.3, 18.3), [0], int(rng.choice([1, 4, 12]))
    while slides[-1] < count:
        slides.append(slides[-1] + int(rng.integers(1, most + 1)))
    return Scene(
        (middle - 1.3, middle + 1.3), (azimuth - 1.7, azimuth + 1.7), wanders=True, count=count, exact=True,
        along=rng.choice([-1.0, 1.0]) * rng.uniform(0.0, 2000.0), noise=rng.uniform(0.5, 2.0),
        dip=rng.uniform(50.0, 75.0), slides=tuple(slides[1:-1]),
    )  # fmt: skip


def drawn(scene: Scene, rng: np.random.Generator):
    """Readings (n, 3), (n, 3), true azimuth (n,) and the reference given of one run."""
    part = np.linspace(0.0, 1.0, scene.count)
    along, across = part, part
    if scene.wanders:
        along, across = (0.5 + 0.5 * np.sin(np.arange(scene.count) * rate) for rate in (0.9, 0.47))
    inclination = np.radians(scene.inclination[0] + along * np.diff(scene.inclination))
    azimuth = np.radians(scene.azimuth[0] + across * np.diff(scene.azimuth))
    toolface = rng.uniform(0.0, 2.0 * np.pi, scene.count)
    if scene.slides:
        block = np.searchsorted(scene.slides, np.arange(scene.count), side="right")
        toolface = toolface[block] + 0.1 * rng.normal(size=scene.count)
    inclination[: scene.curve] = np.radians(scene.inclination[0] - 6.0 * np.arange(scene.curve, 0, -1))
    dip = np.radians(scene.dip)
    attitude = turned(azimuth, inclination, toolface)
    g, b = attitude @ [0.0, 0.0, G], attitude @ [B * np.cos(dip), 0.0, B * np.sin(dip)]
    sd = {name: scene.sensors * size for name, size in SENSORS.items()}
    gain_g, gain_b = (np.eye(3) + np.diag(sd[name] * rng.normal(size=3)) for name in ("AS", "MS"))
    gain_b[np.triu_indices(3, 1)] += sd["MXY"] * rng.normal(size=3)
    side = rng.uniform(0.0, 2.0 * np.pi)
    bias = sd["MB"] * rng.normal(size=3) + [
        scene.across * np.cos(side), scene.across * np.sin(side), scene.along * (1.0 if scene.exact else rng.normal())
    ]  # fmt: skip
    noise = scene.noise * rng.normal(size=(scene.count, 6)) * NOISE
    g, b = g @ gain_g.T + sd["AB"] * rng.normal(size=3) + noise[:, :3], b @ gain_b.T + bias + noise[:, 3:]
    off = scene.reference * rng.normal(size=3) * [0.003, 130.0, np.radians(0.2)]
    b[scene.count // 2, 0] += scene.spike
    reference = FieldReference(
        g=G - off[0], b=B - off[1], dip=dip - off[2], g_sigma=0.01, b_sigma=130.0, dip_sigma=np.radians(0.2)
    )
    return g, b, azimuth, reference


def azimuth_of(g, b):
    """Azimuth (n,) of readings."""
    total = np.linalg.norm(g, axis=1)
    east = (g[:, 0] * b[:, 1] - g[:, 1] * b[:, 0]) * total
    return np.arctan2(east, b[:, 2] * (g[:, 0] ** 2 + g[:, 1] ** 2) - g[:, 2] * (g[:, 0] * b[:, 0] + g[:, 1] * b[:, 1]))


def of_biases(g, b, reference: FieldReference):
    """Fields after least squares of three biases of the magnetometers against the reference."""

    def residual(x):
        field = b - 100.0 * x
        total = np.linalg.norm(field, axis=1)
        dip = np.arcsin(np.sum(g * field, axis=1) / np.linalg.norm(g, axis=1) / total)
        return np.concatenate([total - reference.b, (dip - reference.dip) * reference.b])

    return b - 100.0 * least_squares(residual, np.zeros(3), x_scale="jac").x


def error_of(g, b, azimuth):
    """Measured less true azimuth, deg."""
    return np.degrees((azimuth_of(g, b) - azimuth + np.pi) % (2.0 * np.pi) - np.pi)


WARNED = {
    "survey-prior",
    "survey-chi-square",
    "survey-station-odd",
}


def one(scene: Scene, rng: np.random.Generator) -> dict[str, float]:
    """Mean squares of one run."""
    g, b, azimuth, reference = drawn(scene, rng)
    stations = Stations(30.0 * np.arange(len(g)), g, b)
    found = multistation(stations, reference)
    told = np.square(scene.sensors * np.repeat(list(SENSORS.values()), 3))
    told[8] += scene.along**2
    told[6:8] += 0.5 * scene.across**2
    noise = np.diag(np.square(scene.noise * NOISE))
    true = replace(published_priors(), covariance=np.diag(told), noise=noise, sized=())
    wide = scene.reference
    known = replace(reference, g_sigma=0.003 * wide, b_sigma=130.0 * wide, dip_sigma=np.radians(0.2) * wide)
    best = multistation(stations, known, true).corrected
    error, u = errors(found, azimuth)
    return {
        "raw": np.mean(error_of(g, b, azimuth) ** 2),
        "error": np.mean(error**2),
        "u": np.mean(u**2),
        "coverage": np.mean(np.abs(error) < 1.96 * u),
        "z2": np.mean((error / u) ** 2),
        "warned": float(any(each.code in WARNED for each in found.findings)),
        "told": np.mean(error_of(best.g, best.b, azimuth) ** 2),
        "biases": np.mean(error_of(g, of_biases(g, b, reference), azimuth) ** 2),
    }


def errors(found: MultiStation, azimuth, kept=slice(None)) -> tuple[np.ndarray, np.ndarray]:
    """Error and standard uncertainty (n,) of the azimuth of corrected stations, deg."""
    after = found.corrected
    u = np.degrees(np.sqrt(propagate(angles_jacobian(after.g, after.b), after.field_covariance())[:, 1, 1]))
    return error_of(after.g, after.b, azimuth)[kept], u[kept]


class Help(NamedTuple):
    """What B is given: stations of the curve, an azimuth known to `sigma` deg but `off` deg wrong, the true size."""

    curve: int = 0
    sigma: float = 0.0
    off: float = 0.0
    axial: float | None = None


LEVEL = {
    "A": None,
    "B": Help(),
    "B, size of the interference stated": Help(axial=1157.0),
    "B, one azimuth known to 0.5 deg": Help(sigma=0.5),
    "B, one azimuth known to 0.5 deg, 4 deg wrong": Help(sigma=0.5, off=4.0),
    "B, two stations of the curve": Help(curve=2),
}


def level(runs: int = 400, name: Sequence[str] = tuple(LEVEL)) -> dict[str, dict[str, float]]:
    """Runs level east-west: root mean squares of the azimuths of the lateral, median, honesty, shares warned of."""
    results = {}
    for case in name:
        given, rows, refused = LEVEL[case] or Help(), [], 0
        for number in range(runs):
            rng = np.random.default_rng([16, number])
            scene = HOLES["level, east-west"] if LEVEL[case] is None else lateral(rng)
            g, b, azimuth, reference = drawn(scene._replace(curve=given.curve, count=scene.count + given.curve), rng)
            middle, known = len(g) // 2, ()
            if given.sigma:
                told = np.degrees(azimuth[middle]) + given.off + given.sigma * rng.normal()
                known = (KnownAzimuth(30.0 * middle, np.radians(told), np.radians(given.sigma)),)
            stations = Stations(30.0 * np.arange(len(g)), g, b)
            try:
                found = multistation(stations, reference, published_priors(axial_sigma=given.axial), known=known)
            except IdentifiabilityError:
                refused += 1
                continue
            (error, u), kept = errors(found, azimuth, slice(given.curve, None)), slice(given.curve, None)
            raw, squares = np.mean(error_of(g, b, azimuth)[kept] ** 2), np.mean(error**2)
            advice = [one.values for one in found.findings if one.code == "survey-axial-prior"]
            rows.append({
                "raw": raw, "error": squares, "u": np.mean(u**2), "z2": np.mean((error / u) ** 2),
                "coverage": np.mean(np.abs(error) < 1.96 * u), "worse": float(squares > raw),
                "contradicted": float(any(one.code == "survey-known-off" for one in found.findings)),
                "advised": float(bool(advice)),
                **{f"{key}": advice[0][f"{key}_deg"] ** 2 if advice else np.nan for key in ("now", "curve", "known")},
            })  # fmt: skip
        column = {key: np.array([row[key] for row in rows]) for key in rows[0]}
        roots = ("raw", "error", "u", "now", "curve", "known")
        results[case] = {k: float(np.sqrt(np.nanmean(v)) if k in roots else v.mean()) for k, v in column.items()}
        results[case] |= {"median": float(np.median(np.sqrt(column["error"]))), "refused": refused / runs}
    return results


def run(runs: int = 60, scene: Sequence[str] = tuple(SCENES)) -> dict:
    """Scenes: root mean squares over their runs, and medians of the runs' own."""
    results = {}
    for name in scene:
        rows = []
        for number in range(runs):
            with suppress(IdentifiabilityError):  # few stations may all have one toolface
                rows.append(one(SCENES[name], np.random.default_rng([15, number])))
        column = {key: np.array([row[key] for row in rows]) for key in rows[0]}
        angles = ("raw", "error", "u", "told", "biases")
        results[name] = {k: float(np.sqrt(v.mean()) if k in angles else v.mean()) for k, v in column.items()}
        results[name] |= {f"median_{k}": float(np.median(np.sqrt(column[k]))) for k in angles}
        tens = {k: np.median(np.sqrt(column[k][: len(rows) // 10 * 10]).reshape(-1, 10), axis=1) for k in angles}
        results[name]["tens_better"] = (
            float(np.mean(tens["biases"] < tens["error"])) if len(rows) >= 10 else float("nan")
        )
    return {"runs": runs, "scenes": results, "level": level(runs) if len(scene) == len(SCENES) else {}}


def report(result: dict) -> None:
    """Table: root mean squares, medians of the runs in brackets."""
    print(
        f"{'scene':37}{'raw':>14}{'error':>14}{'u':>7}{'coverage':>10}{'z2':>6}{'warned':>8}{'told':>14}{'biases':>14}"
        f"{'better':>8}"
    )
    for name, row in result["scenes"].items():
        raw, error, told, biases = (
            f"{row[key]:.3f} ({row[f'median_{key}']:.3f})" for key in ("raw", "error", "told", "biases")
        )
        print(
            f"{name:37}{raw:>14}{error:>14}{row['u']:7.3f}{row['coverage']:10.3f}{row['z2']:6.2f}{row['warned']:8.2f}"
            f"{told:>14}{biases:>14}{row['tens_better']:8.2f}"
        )
    print(f"\n{result['runs']} runs a scene; azimuth, deg, root mean squares and (medians of the runs)\n")
    print(
        f"{'level east-west':48}{'raw':>7}{'error':>15}{'u':>7}{'coverage':>10}{'z2':>6}{'worse':>7}{'warned of':>11}"
    )
    for name, row in result["level"].items():
        error = f"{row['error']:.3f} ({row['median']:.3f})"
        print(
            f"{name:48}{row['raw']:7.3f}{error:>15}{row['u']:7.3f}{row['coverage']:10.3f}{row['z2']:6.2f}"
            f"{row['worse']:7.2f}{row['contradicted']:11.3f}"
        )
    for name in result["level"].keys() & {"B"}:
        now, curve, known = (result["level"][name][key] for key in ("now", "curve", "known"))
        print(f"predicted by the warning: {now:.3f}; two stations of the curve {curve:.3f}, an azimuth {known:.3f}")


if __name__ == "__main__":
    command(__doc__, run, report)

"""Stated uncertainty of a bench calibration where rig and sensors are worse than the model: a simulator of its own.

    python -m benchmarks.honest_bench --runs 60
    python -m benchmarks.honest_bench --plan "12 positions" --scene "magnetised cradle, 200 nT"

Readings are drawn here, without anything of the package: dials that err at random and alike at each value, eccentric,
with backlash, read wrongly; sensors that bend, drift, wander, feel gravity; a cradle that is magnetised. The tool is
calibrated as a user does, with nothing stated. Its azimuth and inclination are those of readings without noise.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks import command
from benchmarks.measure import turn, turned
from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InclinometryError
from inclinometry.findings import without_notes
from inclinometry.sensors import angle_sensitivity

FIELD, GRAVITY, DIP = 50000.0, 9.81, np.radians(70.0)
INCLINATIONS = (5.0, 30.0, 60.0, 90.0)
PLANS = {
    "12 positions": plans.twelve,
    "14, two of them twice": lambda: plans.twelve().repeated(2),
    "24 positions": plans.orthogonal,
}
OF_TIME = ("drift 1 mg, 60 nT, 5e-4", "wander 0.3 mg, 20 nT a position")
"""Scenes in which a position visited twice tells something."""


@dataclass(frozen=True)
class Scene:
    """What is wrong, deg where nothing else is said; dials as azimuth, inclination, toolface."""

    random: tuple[float, float, float] = (0.03, 0.03, 0.03)
    repeating: float = 0.0  # of each dial at each of its values
    shape: str = "normal"  # of the random part: normal, uniform, student (3 degrees of freedom)
    eccentric: tuple[float, float] = (0.0, 0.0)  # first and second harmonic
    backlash: float = 0.0
    misread: float = 0.0  # one dial at one station
    inclination_zero: float = 0.0
    axes: float = 0.0  # of the rig, not perpendicular
    bent: float = 0.0  # quadratic and cubic part of each sensor, of full scale
    products: float = 0.0  # of an accelerometer's axes
    by_gravity: float = 0.0  # nT a g
    cradle: float = 0.0  # nT
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)  # over the run: g, nT, of the scale
    wander: tuple[float, float] = (0.0, 0.0)  # a step: g, nT
    bits: int = 0
    field_drift: float = 0.0  # nT
    hysteresis: float = 0.0  # nT by which each axis of the magnetometer stays behind
    stated: float = 0.0  # standard deviation of the dials that the user states; 0 states nothing


USUAL = Scene((0.1, 0.1, 0.1))
SCENES = {
    "the model holds": USUAL,
    "uniform errors": replace(USUAL, shape="uniform"),
    "Student errors, 3 dof": replace(USUAL, shape="student"),
    "repeating errors, 0.1": Scene((0.02, 0.02, 0.02), repeating=0.1),
    "half repeating, 0.07": Scene((0.07, 0.07, 0.07), repeating=0.07),
    "dials 0.5, 0.02, 0.02": Scene((0.5, 0.02, 0.02)),
    "dials 0.02, 0.02, 0.5": Scene((0.02, 0.02, 0.5)),
    "one dial misread by 2": replace(USUAL, misread=2.0),
    "one dial misread by 1": replace(USUAL, misread=1.0),
    "backlash 0.15": Scene(backlash=0.15),
    "backlash 0.05": Scene(backlash=0.05),
    "eccentric 0.15, 0.07": Scene(eccentric=(0.15, 0.07)),
    "axes not perpendicular, 0.2": Scene(axes=0.2),
    "inclination zero 0.15": Scene(inclination_zero=0.15),
    "drift 1 mg, 60 nT, 5e-4": Scene(drift=(1e-3, 60.0, 5e-4)),
    "wander 0.3 mg, 20 nT a position": Scene(wander=(3e-4, 20.0)),
    "converter of 12 bit": Scene(bits=12),
    "sensors bent, 1e-3": Scene(bent=1e-3),
    "accelerometer's axes multiplied, 1e-3": Scene(products=1e-3),
    "magnetometer feels gravity, 30 nT/g": Scene(by_gravity=30.0),
    "magnetised cradle, 200 nT": Scene(cradle=200.0),
    "field drifts by 30 nT": Scene(field_drift=30.0),
    "accelerometer drifts by 0.5 mg": Scene(drift=(5e-4, 0.0, 0.0)),
    "magnetic hysteresis, 100 nT": Scene(hysteresis=100.0),
    "dials 0.1 stated as 0.02": replace(USUAL, stated=0.02),
}


def stood(dials: np.ndarray, scene: Scene, rng: np.random.Generator) -> np.ndarray:
    """Angles (K, 3) at which the tool stood, rad, when the dials were set to those given."""
    size, found = len(dials), dials.copy()
    draw = {
        "normal": lambda: rng.standard_normal(size),
        "uniform": lambda: np.sqrt(3.0) * rng.uniform(-1.0, 1.0, size),
        "student": lambda: rng.standard_t(3.0, size) / np.sqrt(3.0),
    }[scene.shape]
    for j in range(3):
        own = dials[:, j]
        error = scene.random[j] * draw()
        values, place = np.unique(np.round(np.degrees(own) % 360.0, 6), return_inverse=True)
        error += scene.repeating * rng.standard_normal(len(values))[place]
        first, second = rng.uniform(0.0, 2.0 * np.pi, 2)
        error += scene.eccentric[0] * np.sin(own + first) + scene.eccentric[1] * np.sin(2.0 * own + second)
        way = np.sign(np.diff(own, prepend=own[-1]))
        for k in range(size):
            way[k] = way[k] or (way[k - 1] if k else 1.0)
        found[:, j] += np.radians(error + scene.backlash * way)
    if scene.misread:
        found[rng.integers(size), rng.integers(3)] += np.radians(scene.misread) * rng.choice([-1.0, 1.0])
    found[:, 1] += np.radians(scene.inclination_zero) * rng.choice([-1.0, 1.0])
    return found


def drawn(dials: np.ndarray, scene: Scene, rng: np.random.Generator) -> tuple[dict, dict]:
    """Signals (K, 3) of both triads, and kind -> (tensor, offset) they follow without their flaws."""
    at = stood(dials, scene, rng)
    size = len(at)
    outer, inner = np.radians(scene.axes) * rng.standard_normal(2)
    tilt = np.radians(2.0) * rng.standard_normal(2)
    base = turn(tilt[0], 1, 2) @ turn(tilt[1], 2, 0) @ turn(np.radians(20.0) * rng.standard_normal(), 0, 1)
    down, field = base @ [0.0, 0.0, 1.0], base @ [np.cos(DIP), 0.0, np.sin(DIP)]
    held = rng.standard_normal(3)
    held *= scene.cradle / FIELD / np.linalg.norm(held)
    pulled = scene.by_gravity / FIELD * rng.standard_normal((3, 3))
    products = scene.products * rng.standard_normal((3, 3))
    seen = {"accelerometer": np.zeros((size, 3)), "magnetometer": np.zeros((size, 3))}
    for k, (azimuth, inclination, toolface) in enumerate(at):
        attitude = (
            turn(toolface, 0, 1) @ turn(inner, 1, 2) @ turn(inclination, 2, 0) @ turn(outer, 1, 2) @ turn(azimuth, 0, 1)
        )
        g = attitude @ down
        moving = np.array([scene.field_drift / FIELD * k / size, 0.0, 0.0])
        seen["accelerometer"][k] = g + products @ (g * np.roll(g, -1))
        seen["magnetometer"][k] = attitude @ (field + moving) + turn(toolface, 0, 1) @ held + pulled @ g
    signals, truth = {}, {}
    time = np.linspace(-1.0, 0.0, size)[:, None]  # the tool is that of the end of the run, when it leaves the stand
    of = {
        "accelerometer": (GRAVITY, 2e-5, scene.drift[0], scene.wander[0]),
        "magnetometer": (FIELD, 20.0 / FIELD, scene.drift[1] / FIELD, scene.wander[1] / FIELD),
    }
    for kind, (unit, noise, drift, step) in of.items():
        tensor, offset = np.eye(3) + 0.02 * rng.standard_normal((3, 3)), 0.02 * rng.standard_normal(3)
        y = seen[kind] @ tensor.T
        if kind == "magnetometer":
            way = np.sign(np.diff(y, axis=0, prepend=y[-1:]))
            y = y - scene.hysteresis / FIELD * way
        square, cube = scene.bent * rng.choice([-1.0, 1.0], (2, 3))
        y = y + square * y**2 + cube * y**3 + offset
        walk = np.cumsum(step * rng.standard_normal(y.shape), axis=0)
        y = y * (1.0 + scene.drift[2] * time) + drift * time + walk - walk[-1]
        y = y + noise * rng.standard_normal(y.shape)
        if scene.bits:
            least = 4.0 / 2**scene.bits
            y = least * np.round(y / least)
        signals[kind], truth[kind] = unit * y, (unit * tensor, unit * offset)
    return signals, truth


def errors(tool, truth) -> tuple[np.ndarray, np.ndarray]:
    """Errors and stated u (4, 64, 2) of inclination and azimuth, rad, at each of `INCLINATIONS` over 64 attitudes."""
    around = np.radians(np.arange(0.0, 360.0, 45.0))
    inclination, azimuth, toolface = np.meshgrid(np.radians(INCLINATIONS), around, around, indexing="ij")
    attitude = turned(azimuth, inclination, toolface)
    seen = {"accelerometer": attitude @ [0.0, 0.0, 1.0], "magnetometer": attitude @ [np.cos(DIP), 0.0, np.sin(DIP)]}
    read = {}
    for kind, (tensor, offset) in truth.items():
        triad = tool.triads[kind]
        read[kind] = (seen[kind] @ tensor.T + offset - triad.offset[0]) @ np.linalg.inv(triad.tensor[0]).T
    g, b = read["accelerometer"], read["magnetometer"]
    g = g / np.linalg.norm(g, axis=-1, keepdims=True)
    east = np.cross(g, b)
    found = np.arctan2(east[..., 2], np.cross(east, g)[..., 2])
    off = np.stack(
        [
            np.arctan2(np.hypot(g[..., 0], g[..., 1]), g[..., 2]) - inclination,
            (found - azimuth + np.pi) % (2.0 * np.pi) - np.pi,
        ],
        axis=-1,
    )
    slope = angle_sensitivity(tool, seen, np.full(azimuth.shape, 20.0)).by_parameter[..., :2, :]
    u = np.sqrt(np.einsum("...ip,pq,...iq->...i", slope, tool.covariance, slope))
    return off.reshape(len(INCLINATIONS), -1, 2), u.reshape(len(INCLINATIONS), -1, 2)


def one(plan: str, scene: Scene, seed: int) -> dict | None:
    """Mean squares (4, 2) of a run, what it said; None where it was refused."""
    at, rng = PLANS[plan](), np.random.default_rng([15, seed])
    dials = np.stack([at.azimuth, at.inclination, at.toolface], axis=1)
    signals, truth = drawn(dials, scene, rng)
    rig_sd = np.radians(scene.stated) if scene.stated else None
    try:
        found = calibrate_joint(BenchReadings(signals, *dials.T, reference={"dip": DIP, "north": 0.0}), rig_sd=rig_sd)
    except InclinometryError:
        return None
    off, u = errors(found.tool, truth)
    return {
        "square": np.mean(off**2, axis=1),
        "stated": np.mean(u**2, axis=1),
        "inside": np.mean(np.abs(off) < 1.96 * u, axis=1),
        "warned": bool(without_notes(found.findings)),
        "accused": bool(found.outliers),
        "causes": [name for one in found.findings for name in _causes(one.values)],
        "said": list(map(str, found.findings)),
    }


def _causes(values: Mapping[str, object]) -> tuple[str, ...]:
    """Causes that a finding names."""
    named = values.get("causes", values.get("cause", ()))
    return (named,) if isinstance(named, str) else named if isinstance(named, tuple) else ()


def run(
    runs: int = 40, scene: Sequence[str] = tuple(SCENES), plan: Sequence[str] = tuple(PLANS), words: bool = False
) -> dict:
    """Scenes by plans: rms error, u (deg) and coverage of 95 % at each inclination, azimuth and inclination apart."""
    rows = []
    for name in scene:
        for positions in plan:
            if "twice" in positions and name not in OF_TIME:
                continue
            found = [one(positions, SCENES[name], seed) for seed in range(runs)]
            kept = [row for row in found if row is not None]
            mean = {key: np.mean([row[key] for row in kept], axis=0) for key in ("square", "stated", "inside")}
            said = Counter(re.sub(r"[-+]?\d[\d.e+-]*", "#", text) for row in kept for text in set(row["said"]))
            row = {"scene": name, "plan": positions, "runs": runs, "refused": runs - len(kept)}
            for place, angle in ((1, "azimuth"), (0, "inclination")):
                row[f"{angle}_error"] = np.degrees(np.sqrt(mean["square"][:, place])).tolist()
                row[f"{angle}_u"] = np.degrees(np.sqrt(mean["stated"][:, place])).tolist()
                row[f"{angle}_coverage"] = mean["inside"][:, place].tolist()
            row["warned"] = float(np.mean([entry["warned"] for entry in kept]))
            row["worded"] = float(np.mean([bool(entry["said"]) for entry in kept]))
            row["said"] = dict(said.most_common(5))
            rows.append(row)
    return {"inclinations_deg": list(INCLINATIONS), "rows": rows, "words": words}


def report(result: dict) -> None:
    """One line a scene and plan: error / u (coverage) at each inclination."""
    for row in result["rows"]:
        parts = [f"{row['scene']:38}{row['plan']:22}warned {row['warned']:.2f}, worded {row['worded']:.2f} "]
        for angle in ("azimuth", "inclination"):
            columns = zip(row[f"{angle}_error"], row[f"{angle}_u"], row[f"{angle}_coverage"], strict=True)
            parts.append(" ".join(f"{error:.3f}/{u:.3f} ({inside:.2f})" for error, u, inside in columns))
        print("  ".join(parts), flush=True)
        for text, count in row["said"].items() if result["words"] else ():
            print(f"      {count:4} {text}")


if __name__ == "__main__":
    command(__doc__, run, report)

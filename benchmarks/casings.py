"""Casings that moved, and readings with an error: how often a right pair is warned of, and which errors are named.

    python -m benchmarks.casings [--right N] [--runs N] [--json]

Nothing of the package makes the casings: profile, movement, bias, noise and rounding are drawn here from seeds. A right
pair has a bias of the probe that changed between the readings, alike in both runs, depths good to millimetres and a
movement: none, shear zones, a block that tilts, creep, a wall that bends. `size` is the false movement of the upper end
over the expanded uncertainty that `displacement` states there.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from inclinometry.survey.displacement import FALSE_MOVEMENTS, CasingReading, displacement

RIGHT_SEED: Final = 1_000_000
"""Seeds of the right pairs begin here, those of the errors at 0."""
DIGI: Final = 25_000.0


class Casing(NamedTuple):
    """A casing and how it is read: the sine of the tilt (2, n) of any depth m, then and now."""

    depth: np.ndarray
    step: float
    then: Callable[[np.ndarray], np.ndarray]
    moved: np.ndarray
    noise: float
    depth_sd: float
    kind: str


def _profile(r: np.random.Generator, length: float) -> Callable[[np.ndarray], np.ndarray]:
    """Lean of drilling, waves, and kinks at couplings 3 m apart."""
    waves = [(r.uniform(6.0, 60.0), r.uniform(0.0, 6.3), r.normal(scale=0.008, size=2)) for _ in range(3)]
    lean = r.normal(scale=0.02, size=2)
    joints = np.arange(-3.0, length + 6.0, 3.0)
    kinks = r.normal(scale=r.choice([0.001, 0.003, 0.006]), size=(2, len(joints)))

    def tilt(z: np.ndarray) -> np.ndarray:
        smooth = sum((a[:, None] * np.sin(2.0 * np.pi * z / wave + p) for wave, p, a in waves), lean[:, None])
        return smooth + np.stack([np.interp(z, joints, one) for one in kinks])

    return tilt


def _movement(r: np.random.Generator, z: np.ndarray, step: float, kind: str) -> np.ndarray:
    """Change of the sine of the tilt (2, n) that moves the upper end by half a millimetre to a decimetre."""
    size, away, n = np.exp(r.uniform(np.log(5e-4), np.log(0.1))), r.uniform(0.0, 2.0 * np.pi), len(z)
    foot = r.uniform(0.3, 0.95) * z[-1]
    up = np.maximum(foot - z, 0.0)
    shape = np.zeros(n)
    if kind == "shear":
        for _ in range(r.integers(1, 4)):
            place, wide = r.integers(0, n - 4), r.integers(1, 5)
            shape[place : place + wide] += r.uniform(0.2, 1.0) / wide
    elif kind == "tilt":
        shape = (up > 0.0) * 1.0
    elif kind == "creep":
        shape = up ** r.choice([0.5, 1.0, 2.0]) * (up > 0.0)
    elif kind == "wall":
        shape = np.sin(np.pi * np.minimum(up / foot, 1.0) * r.uniform(0.8, 1.8))
    shape = size * shape / max(np.abs(np.cumsum(shape)).max() * step, 1e-9)
    aside = 0.2 * shape * r.normal()
    return np.stack([np.cos(away) * shape - np.sin(away) * aside, np.sin(away) * shape + np.cos(away) * aside])


KINDS: Final = ("none", "shear", "tilt", "creep", "wall")


def casing(seed: int) -> Casing:
    """A casing of 10 to 60 m, read every half metre, metre or two feet."""
    r = np.random.default_rng(seed)
    step = float(r.choice([0.5, 0.5, 0.6096, 1.0]))
    z = step * np.arange(1, int(r.uniform(10.0, 60.0) / step) + 1)
    kind = KINDS[seed % len(KINDS)]
    moved = _movement(r, z, step, kind)
    return Casing(z, step, _profile(r, z[-1]), moved, r.uniform(1.0, 5.0), r.uniform(0.0, 0.004), kind)


def pair(
    one: Casing, seed: int, bias_shift: float = 0.0, angle: float = 0.0, shift: float = 0.0
) -> tuple[CasingReading, CasingReading]:
    """Two readings in whole digits; of the later one the bias of run 0 of A (sine), the axes, the depths are off."""
    r = np.random.default_rng([seed, 7])
    found = []
    bias = r.normal(scale=20.0, size=2)
    for later in (False, True):
        bias = bias + r.normal(scale=5.0 * later, size=2)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) if later else np.eye(2)
        runs = []
        for sign in (1.0, -1.0):
            z = one.depth + r.normal(scale=one.depth_sd, size=len(one.depth)) + shift * later
            tilt = turn @ (one.then(z) + one.moved * later)
            runs.append(DIGI * sign * tilt + bias[:, None] + r.normal(scale=one.noise, size=tilt.shape))
        if later:
            runs[0][0] += DIGI * bias_shift
        faces = {axis: np.round(np.stack([run[k] for run in runs], axis=1)) / DIGI for k, axis in enumerate("ab")}
        found.append(CasingReading(one.depth, one.step, faces, "later" if later else "base"))
    return found[0], found[1]


def said(one: Casing, seed: int, **errors: float) -> list[str]:
    """Codes that warn of a pair."""
    found = displacement(*pair(one, seed, **errors)).findings
    return [each.code for each in found if each.severity != "note"]


def right(runs: int) -> tuple[Counter[str], Counter[str]]:
    """Codes that warn of right pairs, and the movements of those warned of as false ones."""
    codes: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    for seed in range(RIGHT_SEED, RIGHT_SEED + runs):
        one = casing(seed)
        warned = said(one, seed)
        codes.update(set(warned))
        kinds.update([one.kind] if set(warned) & {code for code, *_ in FALSE_MOVEMENTS.values()} else [])
    return codes, kinds


def effect(one: Casing, name: str) -> float:
    """False movement of the upper end, m, for a unit of an error."""
    if name == "bias_shift":
        return 0.5 * one.step * len(one.depth)
    way = np.array([[0.0, 1.0], [-1.0, 0.0]]) @ one.then(one.depth) if name == "angle" else one.then(one.depth + 5e-4)
    way = way if name == "angle" else (way - one.then(one.depth - 5e-4)) / 1e-3
    return float(np.linalg.norm(one.step * way.sum(axis=1)))


def named(name: str, size: float, runs: int) -> float:
    """Share of pairs in which an error of a size is named, whatever moved."""
    codes = {"bias_shift": "bias", "angle": "rotation", "shift": "depth"}
    count = 0
    for seed in range(runs):
        one = casing(seed)
        u = displacement(*pair(one, seed)).axes["a"].u[0]
        most = {"bias_shift": 1.0, "angle": np.radians(10.0), "shift": 0.5}[name]
        value = min(2.0 * u * size / max(effect(one, name), 1e-9), most)
        count += FALSE_MOVEMENTS[codes[name]][0] in said(one, seed, **{name: float(value)})
    return count / runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--right", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    codes, kinds = right(asked.right)
    sizes = (0.5, 1.0, 2.0, 4.0, 8.0)
    found = {name: [named(name, size, asked.runs) for size in sizes] for name in ("bias_shift", "angle", "shift")}
    if asked.json:
        print(json.dumps({"right": asked.right, "codes": codes, "kinds": kinds, "sizes": sizes, "named": found}))
        return
    print(f"right pairs: {asked.right}; warned of, by code: {dict(codes)}; as false movement, by kind: {dict(kinds)}")
    print(f"named, of {asked.runs}, at false movements of {sizes} U:")
    for name, shares in found.items():
        print(f"  {name:10s} " + "  ".join(f"{share:.2f}" for share in shares))


if __name__ == "__main__":
    main()

"""The batch kernel, six channels to three angles, against numpy and against the machine's memory and arithmetic.

    python -m benchmarks.kernel [--json] [--rounds 15]

Every figure that is judged is a ratio of two measurements of the same round; rounds alternate between all measurements
and medians are given, so that a slow minute of a shared machine hits both sides. One core unless the name says
otherwise. Bytes are what an algorithm must move: 9 doubles a sample for the kernel, 3 an element for the triad.

The arithmetic limit is the time of the operations of one sample, counted in the source, each kind at the rate at which
this machine runs a loop of nothing else, one kind after the other: 104 additions, multiplications or fused pairs,
3 divisions, 2 square roots. Comparisons, selections, signs, loads and stores count as free.
"""

from __future__ import annotations

import math
import os
import statistics
from collections.abc import Callable
from functools import partial

import numba
import numpy as np

from benchmarks import command
from benchmarks.measure import alternating
from inclinometry import compiled as _kernels
from inclinometry.channels import angles_from_channels

SAMPLES = 2_000_000  # 144 MB in and out, beyond any cache
RESIDENT = 4096  # 295 kB, in the second-level cache
TRIAD = 4_000_000
BLOCK = 16_384
TAU = 2.0 * np.pi
FUSED, DIVISIONS, ROOTS = 104, 3, 2
WANTED = {"times_numpy": 3.5, "of_limit": 0.6}
FAST = {"fastmath": {"contract"}, "error_model": "numpy"}


@numba.njit(**FAST)
def triad(a, b, c, scale):
    """STREAM triad."""
    for i in range(a.size):
        a[i] = b[i] + scale * c[i]


@numba.njit(**FAST)
def fused_loop(a, b):
    """128 fused multiply-adds an element in eight independent chains."""
    for i in range(a.size):
        p, q, r, s = b[i], b[i] + 1.0, b[i] + 2.0, b[i] + 3.0
        t, u, v, w = b[i] + 4.0, b[i] + 5.0, b[i] + 6.0, b[i] + 7.0
        for _ in range(16):
            p, q, r, s = p * 0.5 + 1.0, q * 0.5 + 1.0, r * 0.5 + 1.0, s * 0.5 + 1.0
            t, u, v, w = t * 0.5 + 1.0, u * 0.5 + 1.0, v * 0.5 + 1.0, w * 0.5 + 1.0
        a[i] = ((p + q) + (r + s)) + ((t + u) + (v + w))


@numba.njit(**FAST)
def division_loop(a, b):
    """One division an element."""
    for i in range(a.size):
        a[i] = 1.5 / b[i]


@numba.njit(**FAST)
def root_loop(a, b):
    """One square root an element."""
    for i in range(a.size):
        a[i] = math.sqrt(b[i])


class Blocked:
    """The same angles by numpy in blocks that stay in the cache, every array made first.

    Leaves out what the kernel does besides (vertical rows, gaps), so the comparison favours numpy.
    """

    def __init__(self, c: np.ndarray) -> None:
        self.matrices, self.offsets = c[:18].reshape(2, 3, 3), c[18:].reshape(2, 3)
        self.raw, self.g, self.b, self.work = (np.empty((3, BLOCK)) for _ in range(4))
        self.mask = np.empty(BLOCK, dtype=bool)

    def calibrate(self, channels: list[np.ndarray], which: int, out: np.ndarray) -> np.ndarray:
        width = channels[0].size
        for k, channel in enumerate(channels):
            np.subtract(channel, self.offsets[which, k], out=self.raw[k, :width])
        if width < BLOCK:
            return self.matrices[which] @ self.raw[:, :width]
        return np.dot(self.matrices[which], self.raw, out=out)

    def __call__(self, channels: list[np.ndarray], out: list[np.ndarray]) -> None:
        for start in range(0, out[0].size, BLOCK):
            part = slice(start, start + BLOCK)
            self.block([u[part] for u in channels], [angle[part] for angle in out])

    def block(self, channels: list[np.ndarray], out: list[np.ndarray]) -> None:
        inclination, azimuth, toolface = out
        gx, gy, gz = self.calibrate(channels[:3], 0, self.g)
        bx, by, bz = self.calibrate(channels[3:], 1, self.b)
        level, one, two = self.work[:, : gx.size]
        np.multiply(gx, gx, out=level)
        np.multiply(gy, gy, out=one)
        level += one
        np.sqrt(level, out=one)
        np.arctan2(one, gz, out=inclination)
        np.multiply(gx, bx, out=one)
        np.multiply(gy, by, out=two)
        one += two
        one *= gz
        np.multiply(bz, level, out=two)
        two -= one
        np.multiply(gx, by, out=one)
        np.multiply(gy, bx, out=bx)
        one -= bx
        np.multiply(gz, gz, out=bz)
        level += bz
        np.sqrt(level, out=level)
        one *= level
        np.arctan2(one, two, out=azimuth)
        np.negative(gx, out=gx)
        np.arctan2(gy, gx, out=toolface)
        mask = self.mask[: gx.size]
        for angle in (azimuth, toolface):
            np.less(angle, 0.0, out=mask)
            np.multiply(mask, TAU, out=one)
            angle += one


def case(count: int) -> tuple[list[np.ndarray], np.ndarray, list[np.ndarray]]:
    """Channels, coefficients and outputs already touched."""
    rng = np.random.default_rng(5)
    c = np.concatenate([np.eye(3).ravel() + 0.01 * rng.standard_normal(9) for _ in range(2)] + [np.full(6, 0.02)])
    return [rng.standard_normal(count) for _ in range(6)], c, [np.zeros(count) for _ in range(3)]


def measurements() -> dict[str, tuple[Callable[[], object], int, int]]:
    """Name -> (call, times it is called a round, elements of a call)."""
    channels, c, out = case(SAMPLES)
    rows = np.ascontiguousarray(np.stack(channels, axis=-1))
    few, _, few_out = case(RESIDENT)
    small, small_out = np.random.default_rng(1).uniform(0.5, 1.5, 2048), np.empty(2048)
    a, b, d = (np.ones(TRIAD) for _ in range(3))
    blocked = Blocked(c)
    calibration = (c[:9].reshape(3, 3), c[18:21], c[9:18].reshape(3, 3), c[21:])
    return {
        "numpy": (lambda: blocked(channels, out), 1, SAMPLES),
        "kernel": (lambda: angles_from_channels(channels, *calibration, out=out, threads=1), 1, SAMPLES),
        "kernel, rows (n, 6)": (lambda: angles_from_channels(rows, *calibration, out=out, threads=1), 1, SAMPLES),
        "kernel, all cores": (lambda: angles_from_channels(channels, *calibration, out=out), 1, SAMPLES),
        "kernel, in cache": (lambda: _kernels.from_channels(*few, c, *few_out), 400, RESIDENT),
        "triad": (lambda: triad(a, b, d, 2.0), 2, TRIAD),
        "fused": (lambda: fused_loop(small_out, small), 40, 128 * small.size),
        "division": (lambda: division_loop(small_out, small), 400, small.size),
        "root": (lambda: root_loop(small_out, small), 400, small.size),
    }


def agreement() -> float:
    """Largest difference between numpy and kernel for random fields, rad."""
    channels, c, out = case(100_000)
    other = [np.empty(100_000) for _ in range(3)]
    Blocked(c)(channels, other)
    _kernels.from_channels(*channels, c, *out)
    difference = np.abs(np.array(out) - other)
    return float(np.minimum(difference, TAU - difference).max())


def measure(rounds: int) -> dict[str, list[float]]:
    """Name -> seconds an element, one figure a round; the first round only warms up."""
    table = measurements()

    def repeated(call: Callable[[], object], calls: int) -> None:
        for _ in range(calls):
            call()

    found = alternating({name: partial(repeated, call, calls) for name, (call, calls, _) in table.items()}, rounds)
    return {name: [t / (table[name][1] * table[name][2]) for t in times] for name, times in found.items()}


def evaluate(times: dict[str, list[float]]) -> dict[str, object]:
    """Medians of rates, and of ratios taken round by round."""

    def ratio(value: Callable[[dict[str, float]], float]) -> float:
        return statistics.median(value(dict(zip(times, row, strict=True))) for row in zip(*times.values(), strict=True))

    def limit(t: dict[str, float]) -> float:
        return FUSED * t["fused"] + DIVISIONS * t["division"] + ROOTS * t["root"]

    ratios = {
        "times_numpy": ratio(lambda t: t["numpy"] / t["kernel"]),
        "of_triad_bandwidth": ratio(lambda t: (72.0 / t["kernel"]) / (24.0 / t["triad"])),
        "of_arithmetic_limit": ratio(lambda t: limit(t) / t["kernel"]),
        "of_rate_in_cache": ratio(lambda t: t["kernel, in cache"] / t["kernel"]),
        "rows_to_channels": ratio(lambda t: t["kernel"] / t["kernel, rows (n, 6)"]),
        "all_cores_to_one": ratio(lambda t: t["kernel"] / t["kernel, all cores"]),
    }
    return {
        "million_per_second": {name: 1e-6 / statistics.median(values) for name, values in times.items()},
        "ratios": ratios,
        "cores": os.cpu_count(),
        "largest_difference_to_numpy_rad": agreement(),
        "fast_enough": {
            "times_numpy": ratios["times_numpy"] >= WANTED["times_numpy"],
            "of_limit": max(ratios["of_triad_bandwidth"], ratios["of_arithmetic_limit"]) >= WANTED["of_limit"],
        },
    }


def report(result: dict) -> None:
    """Print the ratios, and the rates they come from."""
    ratios, verdict = result["ratios"], {True: "yes", False: "NO"}
    print(f"kernel, one core, {SAMPLES} samples from memory, medians of ratios")
    print(f"  times numpy in 16k blocks        {ratios['times_numpy']:6.2f}   wanted {WANTED['times_numpy']}")
    print(f"  of the triad's bandwidth         {ratios['of_triad_bandwidth']:6.2f}   wanted {WANTED['of_limit']} here")
    print(f"  of the arithmetic limit          {ratios['of_arithmetic_limit']:6.2f}   or here, whichever binds")
    print(f"  of its own rate in the cache     {ratios['of_rate_in_cache']:6.2f}")
    print(f"  rows (n, 6) to channels          {ratios['rows_to_channels']:6.2f}")
    print(f"  all {result['cores']} cores to one               {ratios['all_cores_to_one']:6.2f}")
    print("fast enough: " + ", ".join(f"{name} {verdict[ok]}" for name, ok in result["fast_enough"].items()))
    print(f"largest difference to numpy {result['largest_difference_to_numpy_rad']:.1e} rad (close to parallel fields)")
    print("rates on this machine, million a second")
    for name, rate in result["million_per_second"].items():
        print(f"  {name:32s} {rate:9.0f}")


def run(rounds: int = 15) -> dict:
    """Everything this benchmark measures."""
    return evaluate(measure(rounds))


if __name__ == "__main__":
    command(__doc__, run, report)

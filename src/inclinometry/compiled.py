"""Compiled loops: six raw channels to inclination, azimuth and toolface. Arrays in and out, no checks.

The one module that knows numba. Importing it imports numba and compiles (or loads from the cache), so import it where a
kernel is called. Where numba is not installed (the extra `fast`) the decorators do nothing: every loop runs as the
Python it is written in, with the same result to rounding, some hundred times slower.

The loops have no branch, so that the compiler turns them into vector instructions. Two things make that possible: an
arctangent of selections, one division and a polynomial; and the single rewriting rule "contract" (fused multiply-add)
instead of full fast mathematics, which would be free to assume that no value is NaN.
"""

from __future__ import annotations

import math as math  # the kernels take it from here
from collections.abc import Callable
from functools import wraps
from types import SimpleNamespace
from typing import Any, Final, TypeVar, cast

import numpy as np

from inclinometry.arrays import Array

try:
    import numba as _installed
except ImportError:  # not installed, or not for this numpy
    numba: Any = None
else:
    numba = _installed

COMPILED: Final = numba is not None
"""Whether the loops are machine code."""


class _NoType:
    """Stands for every type of a signature that no one compiles."""

    def __getattr__(self, name: str) -> _NoType:
        return self

    def __call__(self, *_: object, **__: object) -> _NoType:
        return self


types: Any = _NoType() if numba is None else numba.types
if numba is None:
    # as machine code does: a root of -1 is NaN and 1 / 0 infinite, where Python's own module and numbers raise
    _numpy: Any = SimpleNamespace(
        sqrt=np.sqrt, sin=np.sin, cos=np.cos, atan2=np.arctan2, acos=np.arccos, exp=np.exp, floor=np.floor,
        copysign=np.copysign, radians=np.radians, isnan=np.isnan, pi=math.pi, inf=math.inf, nan=math.nan,
    )  # fmt: skip
    math = _numpy

# what the signatures of all compiled loops are made of
VECTOR = types.Array(types.float64, 1, "C", readonly=True)
VECTOR_OUT = types.Array(types.float64, 1, "C")
MATRIX = types.Array(types.float64, 2, "C", readonly=True)
MATRIX_OUT = types.Array(types.float64, 2, "C")

# cot(pi/8): directions nearer an axis than a sixteenth of a turn are measured from it, the others from the diagonal
COT_EIGHTH: Final = 1.0 + math.sqrt(2.0)
# pi/4 in two parts; the first has 49 bits, so that eight times it is exact and a sum is rounded once
EIGHTH_HIGH: Final = math.floor(math.pi / 4.0 * 2.0**49) / 2.0**49
EIGHTH_LOW: Final = (math.pi / 4.0 - EIGHTH_HIGH) + 3.061616997868383e-17  # the end is pi/4 less its double

FAST: Final[dict[str, Any]] = {"fastmath": {"contract"}, "error_model": "numpy"}
Function = TypeVar("Function", bound=Callable[..., object])


def inlined(function: Function) -> Function:
    """A formula to be pasted into the loops that use it."""
    if numba is None:
        return function
    return cast(Function, numba.njit(forceinline=True, **FAST)(function))


def compiled(*signatures: Any, sums_in_any_order: bool = False) -> Callable[[Function], Function]:
    """Compile at once and keep the machine code on disk; where nothing can be written, in memory only.

    Long sums are vectors, too, where their order does not matter.
    """
    how = {**FAST, "fastmath": {"contract", "reassoc"}} if sums_in_any_order else FAST

    def build(function: Function) -> Function:
        if numba is None:
            return cast(Function, _run_without_warnings(function))
        try:
            kernel = numba.njit([*signatures], nogil=True, cache=True, **how)(function)
        except (RuntimeError, OSError):  # no folder that can be written, or a full disk
            kernel = numba.njit([*signatures], nogil=True, **how)(function)
        return cast(Function, kernel)

    return build


def _run_without_warnings(function: Callable[..., object]) -> Callable[..., object]:
    """The loop as it stands; what is infinite or no number is not commented, as in machine code."""

    @wraps(function)
    def run(*arguments: object) -> object:
        with np.errstate(all="ignore"):
            return function(*arguments)

    return run


@inlined
def coefficients(c: Any) -> Any:
    """Matrices by rows, then offsets, read before a loop: for all the compiler knows, an output could overlap them."""
    return (
        c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16],
        c[17], c[18], c[19], c[20], c[21], c[22], c[23],
    )  # fmt: skip


@inlined
def calibrated(ux: Any, uy: Any, uz: Any, vx: Any, vy: Any, vz: Any, k: Any) -> Any:
    """Gravity and magnetic field of a sample, in units of the calibration's."""
    ux, uy, uz, vx, vy, vz = ux - k[18], uy - k[19], uz - k[20], vx - k[21], vy - k[22], vz - k[23]
    return (
        k[0] * ux + k[1] * uy + k[2] * uz,
        k[3] * ux + k[4] * uy + k[5] * uz,
        k[6] * ux + k[7] * uy + k[8] * uz,
        k[9] * vx + k[10] * vy + k[11] * vz,
        k[12] * vx + k[13] * vy + k[14] * vz,
        k[15] * vx + k[16] * vy + k[17] * vz,
    )


@inlined
def _first_quadrant(y: float, x: float) -> tuple[float, float]:
    """(k, a) with atan2(y, x) = k pi/4 + a for y, x >= 0 up to half the largest double; NaN for 0, 0."""
    near = y * COT_EIGHTH < x
    far = x * COT_EIGHTH < y
    numerator = y if near else (-x if far else y - x)
    denominator = x if near else (y if far else y + x)
    k = 0.0 if near else (2.0 if far else 1.0)
    t = numerator / denominator
    s = t * t
    # atan(t) = t + t^3 P(t^2); P interpolates at Chebyshev nodes of [0, 0.43^2] in 60 digits, relative error 1.2e-17
    p = -0.018063777120179373 * s + 0.038287791742721684
    p = p * s - 0.0505150527527373
    p = p * s + 0.05851406329714426
    p = p * s - 0.06663704267491102
    p = p * s + 0.07692123568913695
    p = p * s - 0.09090901906566907
    p = p * s + 0.11111110946780015
    p = p * s - 0.1428571428377946
    p = p * s + 0.1999999999999109
    p = p * s - 0.33333333333333326
    return k, t * s * p + t


@inlined
def _half_turn(y: float, x: float) -> float:
    """atan2(y, x) in [0, pi], for y >= 0."""
    k, a = _first_quadrant(y, abs(x))
    k = 4.0 - k if x < 0.0 else k
    a = -a if x < 0.0 else a
    return k * EIGHTH_HIGH + (k * EIGHTH_LOW + a)


@inlined
def _full_turn(y: float, x: float) -> float:
    """atan2(y, x) in [0, 2 pi)."""
    k, a = _first_quadrant(abs(y), abs(x))
    k = 4.0 - k if x < 0.0 else k
    a = -a if x < 0.0 else a
    k = 8.0 - k if y < 0.0 else k
    a = -a if y < 0.0 else a
    angle = k * EIGHTH_HIGH + (k * EIGHTH_LOW + a)
    # a tiny negative angle rounds up to 2 pi itself, which is outside the half-open range
    return 0.0 if angle >= 2.0 * math.pi else angle


@inlined
def _attitude(gx: float, gy: float, gz: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """Inclination, azimuth and toolface; all three NaN where one of them is."""
    level = gx * gx + gy * gy
    sine = (gx * by - gy * bx) * math.sqrt(level + gz * gz)
    cosine = bz * level - gz * (gx * bx + gy * by)
    # exactly vertical the whole turn is called toolface: of the tool that hangs, or of the one that stands on its head
    vertical = level == 0.0
    hand = math.copysign(1.0, gz)
    cosine = 1.0 if vertical else cosine
    toolface_sine = -hand * by if vertical else gy
    toolface_cosine = hand * bx if vertical else -gx
    inclination = _half_turn(math.sqrt(level), gz)
    azimuth = _full_turn(sine, cosine)
    toolface = _full_turn(toolface_sine, toolface_cosine)
    invalid = (inclination + azimuth + toolface) * 0.0  # 0 or NaN
    return inclination + invalid, azimuth + invalid, toolface + invalid


@compiled(types.void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR_OUT, VECTOR_OUT, VECTOR_OUT))
def from_channels(
    ux: Array,
    uy: Array,
    uz: Array,
    vx: Array,
    vy: Array,
    vz: Array,
    c: Array,
    inclination: Array,
    azimuth: Array,
    toolface: Array,
) -> None:
    """Angles of n samples kept channel by channel; `c` holds the 24 coefficients."""
    k = coefficients(c)
    for i in range(inclination.size):
        gx, gy, gz, bx, by, bz = calibrated(ux[i], uy[i], uz[i], vx[i], vy[i], vz[i], k)
        inclination[i], azimuth[i], toolface[i] = _attitude(gx, gy, gz, bx, by, bz)


@compiled(types.void(MATRIX, VECTOR, VECTOR_OUT, VECTOR_OUT, VECTOR_OUT))
def from_rows(signals: Array, c: Array, inclination: Array, azimuth: Array, toolface: Array) -> None:
    """Angles of n samples kept row by row (n, 6), sorted into channels a block at a time."""
    block = 128  # longer ones leave the memory idle while they compute
    u = np.empty((6, block))
    count = inclination.size
    for start in range(0, count, block):
        stop = min(start + block, count)
        n = stop - start
        for i in range(n):
            for k in range(6):
                u[k, i] = signals[start + i, k]
        angles = inclination[start:stop], azimuth[start:stop], toolface[start:stop]
        from_channels(u[0, :n], u[1, :n], u[2, :n], u[3, :n], u[4, :n], u[5, :n], c, *angles)

"""Six raw channels to inclination, azimuth and toolface, for arrays of any length."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.arrays import Array, finite
from inclinometry.errors import out_of_range, refused, wrong_kind, wrong_shape
from inclinometry.rotations import wrap_positive

WORTH_THREADS: Final = 1_000_000
"""Samples above which several threads share the work."""

Channels: TypeAlias = tuple[Array, ...]


class ChannelAngles(NamedTuple):
    """Inclination in [0, pi], azimuth and toolface in [0, 2 pi), rad, each (n,)."""

    inclination: Array
    azimuth: Array
    toolface: Array


def angles_from_channels(
    signals: NDArray[np.floating] | Sequence[ArrayLike],
    matrix_g: ArrayLike,
    offset_g: ArrayLike,
    matrix_b: ArrayLike,
    offset_b: ArrayLike,
    *,
    out: Sequence[Array] | None = None,
    threads: int | None = None,
) -> ChannelAngles:
    """Calibrate six channels and turn them into angles.

    Parameters
    ----------
    signals : sequence of six (n,) arrays, or (n, 6) ndarray
        Three channels of the accelerometers, then three of the second triad (magnetometers or gyros), in the units of
        the offsets. Fastest, and without a copy, as six contiguous float64 arrays or as the columns of a
        Fortran-ordered array; rows (n, 6) in C order run at about two thirds of that. Anything else is copied first.
    matrix_g, matrix_b : (3, 3) array_like
        Signals to field, any unit of field: g = matrix_g (u_g - offset_g). The inverse of a triad's tensor.
    offset_g, offset_b : (3,) array_like
    out : three (n,) float64 arrays, optional
        Inclination, azimuth, toolface are written here and nothing is allocated; contiguous, overlapping neither each
        other nor the signals. A `ChannelAngles` of an earlier call will do.
    threads : int, optional
        Used above 1e6 samples only. Default: all cores this process may use; never more than those.

    Returns
    -------
    ChannelAngles
        Azimuth is magnetic, or true when the second triad is gyros. Exactly vertical azimuth is 0 and toolface is the
        magnetic toolface, as in `angles`.

    Raises
    ------
    InputError
        Shapes that do not fit, coefficients not finite, signals that are not real numbers, `out` that cannot be used.

    Notes
    -----
    This is the one place where values are not checked: a stream of samples has gaps. A row that holds a NaN or an
    infinity, or where g is zero or b is zero along the horizon, gives NaN for all three angles and touches no other
    row. b parallel to g only to within rounding is not noticed: its azimuth is noise.

    The formulas are those of `angles`. Components of the fields must lie between 1e-75 and 1e75 (squares are formed);
    below, a tool counts as vertical when gx^2 + gy^2 vanishes. The arctangent errs by 4.5e-16 rad at most (2.3 units in
    the last place below pi/4), by 6.7e-16 where almost a whole turn is rounded to 0.

    Short arrays go through numpy until the compiled kernel is in memory, because loading it takes longer than they
    do; all arrays where numba is not installed; the two agree to rounding.

    Examples
    --------
    >>> from inclinometry.orientation import fields
    >>> g, b = fields(np.radians([45.0, 350.0]), np.radians([30.0, 90.0]), np.radians([100.0, 0.0]), np.radians(68.0))
    >>> counts = [*(500.0 * g.T + 20.0), *(300.0 * b.T)]
    >>> found = angles_from_channels(counts, np.eye(3) / 500.0, [20.0] * 3, np.eye(3) / 300.0, np.zeros(3))
    >>> np.degrees(found.inclination), np.degrees(found.azimuth)
    (array([30., 90.]), array([ 45., 350.]))
    """
    source = _source(signals)
    count = source.shape[0] if isinstance(source, np.ndarray) else source[0].size
    coefficients = _coefficients(matrix_g, offset_g, matrix_b, offset_b)
    result = ChannelAngles(*(np.empty(count) for _ in range(3))) if out is None else _checked_out(out, count, source)
    workers = _workers(threads)
    # of fewer samples numpy answers sooner than numba can be imported
    if (count < 20_000 and "inclinometry.compiled" not in sys.modules) or not _compiled():
        _plain(source, coefficients, result)
    elif count <= WORTH_THREADS or workers == 1:
        _kernel(source, coefficients, result)
    else:
        _shared(source, coefficients, result, workers)
    return result


def _source(signals: NDArray[np.floating] | Sequence[ArrayLike]) -> Array | Channels:
    """Rows (n, 6) in C order or six contiguous channels, float64; copied only where they are neither."""
    if isinstance(signals, np.ndarray):
        rows = _numbers(signals, "signals")
        if rows.ndim != 2 or rows.shape[1] != 6:
            raise wrong_shape("signals", rows.shape, "(n, 6)")
        if rows.strides[0] != rows.itemsize:
            return np.require(rows, requirements=["C", "A"])
        signals = tuple(rows.T)
    if len(signals) != 6:
        raise wrong_shape("signals", (len(signals),), "(n, 6)")
    channels = tuple(
        np.require(_numbers(channel, f"signals[{k}]"), requirements=["C", "A"]) for k, channel in enumerate(signals)
    )
    shapes = [channel.shape for channel in channels]
    if len(shapes[0]) != 1 or len(set(shapes)) != 1:
        raise wrong_shape("signals", ", ".join(map(str, shapes)), "6 x (n,)")
    return channels


def _numbers(value: ArrayLike, name: str) -> Array:
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":
        raise wrong_kind(name, str(array.dtype), "array of numbers")
    return array.astype(np.float64, copy=False)


def _coefficients(matrix_g: ArrayLike, offset_g: ArrayLike, matrix_b: ArrayLike, offset_b: ArrayLike) -> Array:
    """Everything the kernel needs in one (24,) array: matrices by rows, then offsets."""
    given = {"matrix_g": matrix_g, "matrix_b": matrix_b, "offset_g": offset_g, "offset_b": offset_b}
    parts = []
    for name, value in given.items():
        array, shape = finite(value, name), (3, 3) if name.startswith("matrix") else (3,)
        if array.shape != shape:
            raise wrong_shape(name, array.shape, str(shape))
        parts.append(array.ravel())
    return np.concatenate(parts)


def _checked_out(out: Sequence[Array], count: int, source: Array | Channels) -> ChannelAngles:
    if len(out) != 3:
        raise wrong_shape("out", (len(out),), "(3,)")
    others = [source] if isinstance(source, np.ndarray) else list(source)
    for array, name in zip(out, ChannelAngles._fields, strict=True):
        fits = isinstance(array, np.ndarray) and array.dtype == np.float64 and array.shape == (count,)
        if not (fits and array.flags.carray):
            found = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
            raise wrong_shape(f"out.{name}", found, f"float64 ({count},), C-contiguous, writeable")
        if any(np.may_share_memory(array, other) for other in others):
            raise refused("sensor-memory-shared", {"name": f"out.{name}"})
        others.append(array)
    return ChannelAngles(*out)


def _workers(threads: int | None) -> int:
    if threads is not None and threads < 1:
        raise out_of_range("threads", threads, ">= 1")
    # the cores this process may use, where the system can tell
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    return cores if threads is None else min(threads, cores)


def _compiled() -> bool:
    """Whether there is a kernel; without numba numpy is far quicker than its loop."""
    from inclinometry.compiled import COMPILED  # here and not above: it brings in numba

    return COMPILED


def _kernel(source: Array | Channels, coefficients: Array, result: ChannelAngles) -> None:
    from inclinometry import compiled as _kernels

    if isinstance(source, np.ndarray):
        _kernels.from_rows(source, coefficients, *result)
    else:
        arrays = [*source, coefficients, *result]
        _kernels.from_channels(*arrays)


def _shared(source: Array | Channels, coefficients: Array, result: ChannelAngles, workers: int) -> None:
    """One piece per thread; the kernel releases the interpreter lock."""
    count = result.inclination.size
    # whole vectors in every piece but the last, so that the digits do not depend on the number of threads
    whole = 1024
    edges = [count * k // workers // whole * whole for k in range(workers)] + [count]

    def piece(start: int, stop: int) -> None:
        part = slice(start, stop)
        _kernel(_part(source, part), coefficients, ChannelAngles(*(angle[part] for angle in result)))

    with ThreadPoolExecutor(workers - 1) as pool:
        pending = [pool.submit(piece, start, stop) for start, stop in pairwise(edges[:-1])]
        piece(edges[-2], edges[-1])
        for task in pending:
            task.result()


def _part(source: Array | Channels, part: slice) -> Array | Channels:
    return source[part] if isinstance(source, np.ndarray) else tuple(channel[part] for channel in source)


def _plain(source: Array | Channels, coefficients: Array, result: ChannelAngles) -> None:
    """The same in numpy, block by block: a second implementation for short arrays."""
    matrices, offsets = coefficients[:18].reshape(2, 3, 3), coefficients[18:].reshape(2, 3, 1)
    plain_block = 16_384
    for start in range(0, result.inclination.size, plain_block):
        part = slice(start, start + plain_block)
        piece = _part(source, part)
        u = np.stack(piece, axis=-1).T if isinstance(piece, tuple) else piece.T
        with np.errstate(invalid="ignore", over="ignore"):
            g = matrices[0] @ (u[:3] - offsets[0])
            b = matrices[1] @ (u[3:] - offsets[1])
            level = g[0] ** 2 + g[1] ** 2
            vertical = level == 0.0
            hand = np.copysign(1.0, g[2])
            sine = (g[0] * b[1] - g[1] * b[0]) * np.sqrt(level + g[2] ** 2)
            cosine = np.where(vertical, 1.0, b[2] * level - g[2] * (g[0] * b[0] + g[1] * b[1]))
            toolface_sine = np.where(vertical, -hand * b[1], g[1])
            toolface_cosine = np.where(vertical, hand * b[0], -g[0])
            inclination = np.arctan2(np.sqrt(level), g[2])
            azimuth = wrap_positive(np.arctan2(sine, cosine))
            toolface = wrap_positive(np.arctan2(toolface_sine, toolface_cosine))
            undefined = vertical & (g[2] == 0.0)
            undefined |= (sine == 0.0) & (cosine == 0.0)
            undefined |= (toolface_sine == 0.0) & (toolface_cosine == 0.0)
            invalid = np.where(undefined, np.nan, (inclination + azimuth + toolface) * 0.0)
            angles = inclination + invalid, azimuth + invalid, toolface + invalid
        for into, angle in zip(result, angles, strict=True):
            into[part] = angle

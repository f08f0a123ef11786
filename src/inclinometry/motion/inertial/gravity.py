"""A window's gravity: its mean through a taper in the almost-inertial frame, and the noise shaking leaves in it."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from inclinometry.attitude.rotations import cross_matrix, dcm_from_quaternion
from inclinometry.core.arrays import Array, frozen
from inclinometry.motion.inertial.model import Model
from inclinometry.motion.inertial.state import STATES, Shaking
from inclinometry.motion.inertial.tape import Ends
from inclinometry.motion.samples import Samples

MEMORY: Final = 10
"""Windows over which the noise that shaking leaves in gravity is averaged."""
FREE: Final = 10 / 3.0
"""Degrees of freedom of that noise in one window and direction: 4 tapers in 3 directions less the lever arm."""
LEAST_SHARE: Final = 0.15
"""Of the noise beside zero frequency that is always taken to reach zero."""
ROUGHER: Final = 6.0
"""Times the mean of the windows before that the noise of one window must be, mean of three directions, for a new level.

Its 10 degrees of freedom do so by chance once in a million windows.
"""
TURNS: Final = (2, 3)
"""Turns a window of the tapers that see noise beside zero frequency; below 2 they would see gravity."""


@lru_cache(maxsize=32)
def tapers(size: int, interval: float) -> Array:
    """Hann taper (sum 1), the taper times cosine and sine of 2 and 3 turns, and their second derivatives (n, 10).

    All of them and their slopes vanish at both ends, so that a bounded position shows in them only by its product with
    the second derivative.
    """
    phase = 2.0 * np.pi * (np.arange(size) + 0.5) / size
    scale = (2.0 * np.pi / (size * interval)) ** 2
    found = [(1.0 - np.cos(phase)) / size]
    bends = [np.cos(phase) / size * scale]
    for turns in TURNS:
        for wave in (np.cos, np.sin):
            parts = [(turns, 1.0), (turns - 1, -0.5), (turns + 1, -0.5)]
            found.append(sum((weight * wave(n * phase) for n, weight in parts), np.zeros(size)) / size)
            bends.append(sum((-scale * n * n * weight * wave(n * phase) for n, weight in parts), np.zeros(size)) / size)
    return frozen(np.ascontiguousarray(np.stack([*found, *bends], axis=1)))


def learnt(before: Shaking, tapered: Array, sensitivity: Array, floor: float) -> Shaking:
    """Vibration and lever arm from the tapers that gravity does not reach.

    Parameters
    ----------
    tapered : (4, 3); sensitivity : (4, 3, 3), their slopes by the lever arm.
    floor : variance of the Hann mean without any vibration.
    """
    residual = tapered - sensitivity @ before.lever
    own = 2.0 * np.mean(residual**2, axis=0)
    # a tool that stood still and now shakes: what it was like before tells nothing
    anew = not before.windows or bool(np.mean(own / np.maximum(before.scatter, floor)) > ROUGHER)
    count = 1 if anew else before.level + 1
    scatter, bands = own if anew else before.scatter, before.bands
    lever, information = before.lever, before.information
    for _ in range(3 if anew else 1):  # the first window finds both from nothing
        weight = 1.0 / np.maximum(0.5 * scatter, 0.5 * floor)
        information = before.information + np.einsum("mni,n,mnj->ij", sensitivity, weight, sensitivity)
        step = np.linalg.solve(information, np.einsum("mni,n,mn->i", sensitivity, weight, residual))
        left = residual - sensitivity @ step
        seen = 2.0 * np.sum(left**2, axis=0) / FREE
        lever = before.lever + step
        scatter = seen if count == 1 else before.scatter + (seen - before.scatter) / min(count, MEMORY)
        square = (left**2).reshape(2, -1, 3).mean(axis=1)
        apart = np.stack([square[:, :2].mean(axis=1), square[:, 2]], axis=1)
        bands = apart if count == 1 else before.bands + (apart - before.bands) / min(count, MEMORY)
    return Shaking(scatter, bands, lever, information, before.windows + 1, count)


def at_zero(shaking: Shaking) -> Array:
    """Shares (3,) of the scatter that a mean feels, north, east, down.

    What shakes about a fixed place has no mean acceleration: its spectrum falls towards zero frequency, and is taken
    to do so as a + c f^2 through both bands (4 1/3 and 9 1/3 squared turns a window; the mean has 1/3), the more
    firmly the more windows were seen.
    """
    low, high = shaking.bands
    middle = np.maximum(0.5 * (low + high), 1e-300)
    seen = min(shaking.level, MEMORY)
    share = np.clip(1.0 - 1.3 * seen / (seen + 1.0) * (high - low) / middle, LEAST_SHARE, 1.0)
    return np.asarray(share[[0, 0, 1]])


def measure_gravity(
    shaking: Shaking, nominal: Array, sums: Array, window: Samples, model: Model, ends: Ends
) -> tuple[float, Shaking]:
    """Apparent gravity through the Hann taper, put into the filter.

    Returns
    -------
    Largest squared normalised innovation, negative when one was beyond the gate, and the shaking as now known.

    Notes
    -----
    With psi the attitude error in north, east, down, the mean of c' a is g + g x psi_mean - mean(c') d(bias), and
    psi_mean = psi_end - D (bias, scale), D the drift from mean to end that the loop has summed.
    """
    from inclinometry.motion.inertial import _recursions as kernels

    settings, g = model.settings, model.gravity
    kept = sums[: kernels.DRIFT].reshape(-1, 12)
    half = len(kept) // 2
    # a lever arm accelerates by the second derivative of c' r; by parts, twice, that falls on the taper
    levers = -kept[half:, 3:].reshape(-1, 3, 3)
    shaking = learnt(shaking, kept[1:half, :3], levers[1:], _white(len(window), model))
    matrix, cross = dcm_from_quaternion(nominal[:4]), g * cross_matrix([0.0, 0.0, 1.0])
    rows = np.zeros((3, STATES))
    rows[:, :3] = cross @ matrix.T
    rows[:, 3:9] = -cross @ sums[kernels.DRIFT : kernels.COUNTS].reshape(3, 6)
    rows[:, 9:12] = -kept[0, 3:].reshape(3, 3)
    residual = kept[0, :3] - levers[0] @ shaking.lever - [0.0, 0.0, g]
    variance = _variance(shaking, levers[0], float(matrix[2, 2]), window, model)
    axes = range(3 if model.site.gravity is not None else 2)
    if settings.weight is not None:
        t = np.array([ends.surprise(rows[i], residual[i], variance[i]) for i in axes])
        variance[: len(t)] /= np.maximum(settings.weight(t), 1e-12)
    found = [ends.measure(rows[i], float(residual[i]), float(variance[i]), settings.gate) for i in axes]
    return (-1.0 if min(found) < 0.0 else max(found)), shaking


def _white(size: int, model: Model) -> float:
    """Variance of a Hann mean of samples at rest."""
    return 1.5 * model.settings.accel_noise**2 / size


def _variance(shaking: Shaking, lever: Array, cosine: float, window: Samples, model: Model) -> Array:
    """Variances (3,) of a window's gravity: shaking, lever arm, walk of the gyro, and errors that do not average.

    The strength of gravity and the gain across the tool (by sin^2 I) are the same in every window: the vertical, which
    they spoil, is given their variance times the number of windows, so that it never tells more than one would.
    """
    g, size = model.gravity, len(window)
    seen = min(shaking.level, MEMORY)
    variance = shaking.scatter * at_zero(shaking) * (1.0 + 2.0 / (FREE * seen))
    variance += np.einsum("ni,ij,nj->n", lever, np.linalg.inv(shaking.information), lever)
    variance = np.maximum(variance, _white(size, model))
    variance[:2] += model.gyro_noise**2 * size * window.interval / 3.0 * g**2
    strength = np.hypot(model.site.gravity_sigma or 0.0, model.gain(np.asarray(window.gyro)) * g * (1.0 - cosine**2))
    variance[2] += shaking.windows * strength**2
    return np.asarray(variance)

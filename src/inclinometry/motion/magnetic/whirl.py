"""Whirl: lateral acceleration that circles in the hole, found in the rotary spectrum over the angle turned."""

from __future__ import annotations

import numpy as np

from inclinometry.arrays import Array
from inclinometry.motion.magnetic.phase import Complex


def whirl_acceleration(lateral: Complex, angle: Array) -> float:
    """What circles (`one_handed`) both in the hole and as the turning tool sees it, m/s^2 rms.

    Shaking to and fro along an axis of the tool has two hands there, but one in the hole at each order next to it.
    """
    return min(one_handed(lateral, angle), one_handed(lateral * np.exp(1j * angle), angle))


def one_handed(lateral: Complex, angle: Array) -> float:
    """Lateral acceleration (m,) that circles one way and not the other, m/s^2 rms.

    Vibration to and fro has the same power at both hands of the rotary spectrum (Gonella J., Deep-Sea Research 19,
    1972), an axis that circles at one. A whirl keeps a ratio to the rotation (Vandiver J.K., Nicholson J.W., Shyu R.J.,
    SPE Drilling Engineering 5, 1990): the spectrum is one over the angle turned, rad, not over time. 0 where nothing
    stands out, and for a tool that turns less than twice.
    """
    from scipy.special import fdtri

    way = np.maximum.accumulate(angle * np.sign(angle[-1] - angle[0]))
    turned = float(way[-1] - way[0])
    if turned < 4.0 * np.pi:
        return 0.0
    # even steps of the angle; where the tool stands still nothing is lost but what is not whirl
    at = np.interp(np.linspace(way[0], way[-1], angle.size), way, np.arange(angle.size))
    left = np.minimum(at.astype(int), angle.size - 2)
    even = lateral[left] + (at - left) * (lateral[left + 1] - lateral[left])
    taper = np.hanning(even.size)
    power = np.abs(np.fft.fft(even * taper)) ** 2 / (even.size * float(taper @ taper))
    half = (even.size - 1) // 2
    rotation_signs = np.stack([power[1 : half + 1], power[: -half - 1 : -1]])
    # below half an order lies what the fit has left of gravity
    # bins that are independent of each other: two thirds under the taper; where the speed changes, the low orders of a
    # band of vibration come from the fastest stretch alone
    speed = np.gradient(way)
    free = 2.0 / 3.0 * float(speed.mean() / speed.max()) ** 2
    rotation_signs = rotation_signs[:, max(1, int(0.5 * turned / (2.0 * np.pi))) :]
    total = np.concatenate([np.zeros((2, 1)), np.cumsum(rotation_signs, axis=1)], axis=1)
    largest = 0.0
    # bins taken together: an axis that rolls circles at one order, one that slips at many
    for width in (1, 2, 4, 8, 16, 32):
        size = max(24, 2 * width)  # of the other hand
        if size > rotation_signs.shape[1]:
            break
        own = total[:, width:] - total[:, :-width]
        first = np.clip(np.arange(own.shape[1]) + (width - size) // 2, 0, rotation_signs.shape[1] - size)
        other = (total[:, first + size] - total[:, first])[::-1] * (width / size)
        # ratio of mean powers that chance exceeds once in 10^7: F of two degrees a bin
        chance = fdtri(max(2.0, 2.0 * free * width), max(2.0, 2.0 * free * size), 1.0 - 1e-7)
        stands = own > chance * other
        if stands.any():
            largest = max(largest, float((own - other)[stands].max()))
    # below 1 m/s^2 a whirl does not matter: leaning by 0.1 deg it shifts gravity by 0.2 mg
    return float(np.sqrt(largest)) if largest > 1.0 else 0.0

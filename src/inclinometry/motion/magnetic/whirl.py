"""Whirl: lateral acceleration that circles in the hole, found in the rotary spectrum over the angle turned."""

from __future__ import annotations

from typing import Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.motion.magnetic.phase import Complex

WIDTHS: Final = (1, 2, 4, 8, 16, 32)
"""Bins of the spectrum that are taken together: an axis that rolls circles at one order, one that slips at many."""
LEAST: Final = 1.0
"""m/s^2 below which a whirl does not matter: leaning by 0.1 deg it shifts gravity by 0.2 mg."""
BESIDE: Final = 24
"""Bins of the other hand that a bin is held against, at the least."""


def whirl_acceleration(lateral: Complex, angle: Array) -> float:
    """Lateral acceleration that circles one way round and not the other, m/s^2 (root mean square of its length).

    Parameters
    ----------
    lateral : (m,) ndarray
        Acceleration across the hole as a complex number in axes that stand in the hole, without gravity and without
        what turns with the tool.
    angle : (m,) ndarray
        Angle the tool has turned, rad.

    Returns
    -------
    float
        0 where nothing stands out, and for a tool that turns less than twice.

    Notes
    -----
    Vibration to and fro shows the same power at both hands of the rotary spectrum (Gonella J., Deep-Sea Research 19,
    1972), an axis that circles in the hole at one of them. A whirl keeps a ratio to the rotation (Vandiver J.K.,
    Nicholson J.W., Shyu R.-J., SPE Drilling Engineering 5, 1990), so that the spectrum is one over the angle turned,
    not over time.

    Examples
    --------
    >>> turned = np.linspace(0.0, 120.0, 1000)
    >>> rng = np.random.default_rng(0)
    >>> shaking = rng.normal(size=(1000, 2)) @ [20.0, 20.0j]
    >>> whirl_acceleration(shaking, turned), round(whirl_acceleration(shaking + 10.0 * np.exp(-4j * turned), turned))
    (0.0, 10)
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
    hands = np.stack([power[1 : half + 1], power[: -half - 1 : -1]])
    # below half an order lies what the fit has left of gravity
    # bins that are independent of each other: two thirds under the taper; where the speed changes, the low orders of a
    # band of vibration come from the fastest stretch alone
    speed = np.gradient(way)
    free = 2.0 / 3.0 * float(speed.mean() / speed.max()) ** 2
    hands = hands[:, max(1, int(0.5 * turned / (2.0 * np.pi))) :]
    total = np.concatenate([np.zeros((2, 1)), np.cumsum(hands, axis=1)], axis=1)
    largest = 0.0
    for width in WIDTHS:
        size = max(BESIDE, 2 * width)
        if size > hands.shape[1]:
            break
        own = total[:, width:] - total[:, :-width]
        first = np.clip(np.arange(own.shape[1]) + (width - size) // 2, 0, hands.shape[1] - size)
        other = (total[:, first + size] - total[:, first])[::-1] * (width / size)
        # ratio of mean powers that chance exceeds once in 10^7: F of two degrees a bin
        chance = fdtri(max(2.0, 2.0 * free * width), max(2.0, 2.0 * free * size), 1.0 - 1e-7)
        stands = own > chance * other
        if stands.any():
            largest = max(largest, float((own - other)[stands].max()))
    return float(np.sqrt(largest)) if largest > LEAST**2 else 0.0

"""Accelerations of the tool in the axes of the hole: x to the high side, y right of it looking down, z down hole."""

from __future__ import annotations

import numpy as np

from inclinometry.core.arrays import Array, Index
from inclinometry.simulate.drilling._noise import BandNoise, Chunked
from inclinometry.simulate.drilling._turning import Drive
from inclinometry.simulate.drilling.scenario import Shocks, Vibration, Whirl


class Shaking:
    """Vibration, shocks and whirl of one run."""

    def __init__(self, vibration: Vibration, rate: float, drive: Drive, noise: Chunked, reach: int) -> None:
        self._vibration, self._rate, self._drive, self._noise = vibration, rate, drive, noise
        lateral, axial = vibration.lateral, vibration.axial
        self._bands = [
            (axis, BandNoise(band, rate, name, noise, reach))
            for axis, band, name in ((0, lateral, "lateral x"), (1, lateral, "lateral y"), (2, axial, "axial"))
            if band is not None and band.rms > 0.0
        ]
        self._whirl_phase = noise.streams["whirl"].uniform(0.0, 2.0 * np.pi)

    def at(self, start: int, stop: int) -> Array:
        """Acceleration (3, n), m/s^2, of internal samples start to stop - 1."""
        total = np.zeros((3, stop - start))
        for axis, band in self._bands:
            total[axis] += band.at(start, stop)[0]
        if self._vibration.shocks is not None:
            self._blows(total, self._vibration.shocks, "shocks", start, stop)
        if self._vibration.whirl is not None:
            self._whirling(total, self._vibration.whirl, start, stop)
        return total

    def _whirling(self, total: Array, whirl: Whirl, start: int, stop: int) -> None:
        """The axis at e exp(i f) accelerates by e (i f'' - f'^2) exp(i f); f is `ratio` times the angle turned."""
        turned = self._drive.at(np.arange(start, stop) / self._rate)
        cosine, sine = self._whirl_direction(whirl, turned.angle)
        inwards = whirl.eccentricity * (whirl.ratio * turned.rate) ** 2
        along = whirl.eccentricity * whirl.ratio * turned.acceleration
        total[0] -= inwards * cosine + along * sine
        total[1] -= inwards * sine - along * cosine
        if whirl.contacts is not None:
            self._blows(total, whirl.contacts, "contacts", start, stop, whirl)

    def _whirl_direction(self, whirl: Whirl, turned: Array) -> tuple[Array, Array]:
        phase = whirl.ratio * turned + self._whirl_phase
        return np.cos(phase), np.sin(phase)

    def _blows(
        self, total: Array, shocks: Shocks, name: str, start: int, stop: int, whirl: Whirl | None = None
    ) -> None:
        """Add full sines in random lateral directions, or towards the middle of the hole where the tool whirls."""
        length = max(2, round(shocks.length * self._rate))
        pulse = np.sin(2.0 * np.pi * (np.arange(length) + 0.5) / length)
        chunk = self._noise.chunk
        for index in range((start - length) // chunk, (stop - 1) // chunk + 1):
            first, peak, angle = self._draw_blows(shocks, name, index)
            if whirl is None:
                direction = np.stack([np.cos(angle), np.sin(angle)])
            else:
                direction = -np.stack(self._whirl_direction(whirl, self._drive.at(first / self._rate).angle))
            where = first[:, None] - start + np.arange(length)
            seen = (where >= 0) & (where < stop - start)
            for axis in range(2):
                blow = (direction[axis] * peak)[:, None] * pulse
                np.add.at(total[axis], where[seen], blow[seen])

    def _draw_blows(self, shocks: Shocks, name: str, index: int) -> tuple[Index, Array, Array]:
        """First samples, peaks and directions of the blows that begin in a chunk."""
        random, chunk = self._noise.streams[f"{name}.{index}"], self._noise.chunk
        count = random.poisson(shocks.rate * chunk / self._rate)
        first = index * chunk + np.sort(random.integers(0, chunk, count))
        return first, random.uniform(shocks.low, shocks.high, count), random.uniform(0.0, 2.0 * np.pi, count)

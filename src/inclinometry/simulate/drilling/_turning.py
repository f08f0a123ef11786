"""The angle the string turns the tool through, as a formula of time, with its first two derivatives."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.simulate.drilling.scenario import Rotation, StickSlip, Swing
from inclinometry.simulate.streams import Streams

WANDERS: Final = 8
SLOWEST_WANDER: Final = 0.005
FASTEST_WANDER: Final = 0.05


class Angle(NamedTuple):
    """An angle (rad) with its rate (rad/s) and acceleration (rad/s^2), (n,) each."""

    angle: Array
    rate: Array
    acceleration: Array

    def plus(self, other: Angle) -> Angle:
        return Angle(*(a + b for a, b in zip(self, other, strict=True)))


class Drive:
    """Rotation without torsional vibration. The angle is a closed formula: nothing is summed up, no error grows."""

    def __init__(self, rotation: Rotation, streams: Streams) -> None:
        random = streams["rotation"]
        drawn, self._phase = random.uniform(0.0, 2.0 * np.pi, 2)
        self._rotation = rotation
        self._wander_phase = random.uniform(0.0, 2.0 * np.pi, WANDERS)
        low, high = np.log(SLOWEST_WANDER), np.log(FASTEST_WANDER)
        self._wander_rate = 2.0 * np.pi * np.exp(random.uniform(low, high, WANDERS))
        self._start = 0.0
        first = float(self.at(np.zeros(1)).angle[0])
        self._start = (drawn if rotation.toolface is None else rotation.toolface) - first

    def at(self, time: Array) -> Angle:
        swing = self._rotation.swing
        if isinstance(swing, StickSlip):
            angle, envelope = self._stick_slip(time, swing)
        else:
            angle, envelope = self._swinging(time, swing), None
        if self._rotation.ripple and self._rotation.speed:
            angle = angle.plus(self._ripple(time, envelope))
        if self._rotation.wander:
            angle = angle.plus(self._wander(time))
        return angle._replace(angle=angle.angle + self._start)

    def _swinging(self, time: Array, swing: Swing | None) -> Angle:
        """Speed (1 + depth sin(w t + p))."""
        speed = self._rotation.speed
        if swing is None:
            return Angle(speed * time, np.full_like(time, speed), np.zeros_like(time))
        w, amplitude = 2.0 * np.pi * swing.rate, speed * swing.depth
        sine, cosine = np.sin(w * time + self._phase), np.cos(w * time + self._phase)
        return Angle(speed * time - amplitude / w * cosine, speed + amplitude * sine, amplitude * w * cosine)

    def _stick_slip(self, time: Array, swing: StickSlip) -> tuple[Angle, Angle]:
        """Still while stuck, then speed / (1 - stick) (1 - cos 2 pi x) for x from 0 to 1; and the ripple's envelope."""
        speed, slip = self._rotation.speed, 1.0 - swing.stick
        periods = time * swing.rate + self._phase / (2.0 * np.pi)
        whole = np.floor(periods)
        x = np.maximum(periods - whole - swing.stick, 0.0) / slip
        pace = swing.rate / slip
        sine, cosine = np.sin(2.0 * np.pi * x), np.cos(2.0 * np.pi * x)
        angle = Angle(
            speed / swing.rate * (whole + x - sine / (2.0 * np.pi)),
            speed / slip * (1.0 - cosine),
            speed / slip * 2.0 * np.pi * pace * sine,
        )
        # the square of the speed's own shape: the ripple dies faster than the rotation and never reverses it
        q0, q1, q2 = 0.5 * (1.0 - cosine), np.pi * pace * sine, 2.0 * (np.pi * pace) ** 2 * cosine
        q2 = np.where(x > 0.0, q2, 0.0)
        return angle, Angle(q0 * q0, 2.0 * q0 * q1, 2.0 * (q1 * q1 + q0 * q2))

    def _ripple(self, time: Array, envelope: Angle | None) -> Angle:
        w = 2.0 * np.pi * self._rotation.ripple_rate
        size = self._rotation.ripple * self._rotation.speed / w
        sine, cosine = size * np.sin(w * time), size * np.cos(w * time)
        if envelope is None:
            return Angle(-cosine, w * sine, w * w * cosine)
        e0, e1, e2 = envelope
        return Angle(-cosine * e0, w * sine * e0 - cosine * e1, w * w * cosine * e0 + 2.0 * w * sine * e1 - cosine * e2)

    def _wander(self, time: Array) -> Angle:
        size = self._rotation.wander * np.sqrt(2.0 / WANDERS)
        total = Angle(np.zeros_like(time), np.zeros_like(time), np.zeros_like(time))
        for w, phase in zip(self._wander_rate, self._wander_phase, strict=True):
            sine, cosine = size * np.sin(w * time + phase), size * np.cos(w * time + phase)
            total = total.plus(Angle(sine, w * cosine, -w * w * sine))
        return total

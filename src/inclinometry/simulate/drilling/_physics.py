"""What perfect sensors feel on the internal grid: accelerometer, magnetometer and gyro from one kinematics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.earth.rate import earth_rate
from inclinometry.simulate.drilling._noise import BandNoise, Chunked
from inclinometry.simulate.drilling._shaking import Shaking
from inclinometry.simulate.drilling._turning import Angle, Drive
from inclinometry.simulate.drilling.faults import Casing, MagLag
from inclinometry.simulate.drilling.scenario import Hole, Scenario


class Felt(NamedTuple):
    """(3, n) tool components on the internal grid, m/s^2, nT, rad/s; toolface and the rate of the drive, (n,)."""

    accel: Array
    mag: Array
    gyro: Array
    toolface: Array
    rate: Array


class Physics:
    """The motion of one run and what it does to the sensors."""

    def __init__(self, scenario: Scenario, noise: Chunked, reach: int) -> None:
        self._scenario, self._hole = scenario, scenario.hole
        self._rate = scenario.instrument.rate
        self._drive = Drive(scenario.rotation, noise.streams)
        self._shaking = Shaking(scenario.vibration, self._rate, self._drive, noise, reach)
        torsion = scenario.rotation.torsion
        self._torsion = None if torsion is None else BandNoise(torsion, self._rate, "torsion", noise, reach)
        self._lag = sum(fault.delay for fault in scenario.faults if isinstance(fault, MagLag))
        self._casings = [fault for fault in scenario.faults if isinstance(fault, Casing)]
        self._casing_phase = noise.streams["casing"].uniform(0.0, 2.0 * np.pi, (3, 3))
        self._earth = _about_z(earth_rate(self._hole.latitude)[:, None], self._hole.declination)

    def at(self, start: int, stop: int) -> Felt:
        time = np.arange(start, stop) / self._rate
        drive = self._drive.at(time)
        torsion = self._twist(start, stop, (0, 1, 2))
        angle = drive if torsion is None else drive.plus(Angle(*torsion))
        turn = np.cos(angle.angle), np.sin(angle.angle)
        path = path_at(self._hole, time)
        gyro, accel = self._turned(path, angle, turn)
        accel += _to_tool(_to_hole(self._gravity(), path) - self._shaking.at(start, stop), turn)
        gyro += _to_tool(_to_hole(self._earth, path), turn)
        if self._lag:
            turn, path = self._lagging(time, start, stop)
        mag = _to_tool(_to_hole(self._field(time - self._lag), path), turn)
        return Felt(accel, mag, gyro, angle.angle, drive.rate)

    def _turned(self, path: Path, angle: Angle, turn: tuple[Array, Array]) -> tuple[Array, Array]:
        """Rate of the tool against the Earth, and what the lever arm adds to apparent gravity.

        w = T' z + I' y_h + A' d, with y_h the level axis across the hole and d down; -(w' x r + w x (w x r)).
        """
        cosine, sine = turn
        zero = np.zeros_like(cosine)
        axis = np.stack([zero, zero, np.ones_like(cosine)])
        rate, change = angle.rate * axis, angle.acceleration * axis
        if path.inclination_rate or path.azimuth_rate:
            across = np.stack([sine, cosine, zero])
            down = _to_tool(_to_hole(np.array([[0.0], [0.0], [1.0]]), path), turn)
            slow = path.inclination_rate * across
            # axes that stand still in space turn backwards in the tool; y_h itself turns about the vertical
            change = change + path.azimuth_rate * (-_cross(rate + slow, down)) - _cross(rate, slow)
            rate = rate + slow + path.azimuth_rate * down
        lever = np.asarray(self._scenario.instrument.lever)[:, None]
        if not lever.any():
            return rate, np.zeros_like(rate)
        return rate, -(_cross(change, lever) + _cross(rate, _cross(rate, lever)))

    def _twist(self, start: int, stop: int, orders: tuple[int, ...], shift: float = 0.0) -> list[Array] | None:
        return None if self._torsion is None else self._torsion.at(start, stop, orders, shift)

    def _lagging(self, time: Array, start: int, stop: int) -> tuple[tuple[Array, Array], Path]:
        """Where the tool pointed when the late magnetometer looked."""
        angle = self._drive.at(time - self._lag).angle
        twist = self._twist(start, stop, (0,), -self._lag)
        if twist is not None:
            angle = angle + twist[0]
        return (np.cos(angle), np.sin(angle)), path_at(self._hole, time - self._lag)

    def _gravity(self) -> Array:
        return np.array([[0.0], [0.0], [self._hole.gravity]])

    def _field(self, time: Array) -> Array:
        """Flux density in NED, nT, (3, 1) or, in casing, (3, n)."""
        dip = self._hole.dip
        field = self._hole.field * np.array([[np.cos(dip)], [0.0], [np.sin(dip)]])
        for casing in self._casings:
            inside = (time >= casing.start) & (time < casing.stop)
            wave = np.zeros((3, time.size))
            for k in range(3):  # three tones an octave and a bit apart, each axis on its own
                w = 2.0 * np.pi / casing.period * (1.0, 2.3, 5.1)[k]
                wave += np.sqrt(2.0 / 3.0) * np.sin(w * time + self._casing_phase[:, k : k + 1])
            field = np.where(inside, casing.left * field + casing.disturbance * wave, field)
        return field


class Path(NamedTuple):
    """Direction of the hole, (1,) or (n,), rad, and its constant rates, rad/s."""

    inclination: Array
    azimuth: Array
    inclination_rate: float
    azimuth_rate: float


def path_at(hole: Hole, time: Array) -> Path:
    """Where the hole points; arrays of one element when it does not bend."""
    bend = hole.build * hole.penetration, hole.turn * hole.penetration
    run = time if any(bend) else np.zeros(1)
    return Path(hole.inclination + bend[0] * run, hole.azimuth + bend[1] * run, *bend)


def _about_z(v: Array, angle: Array | float) -> Array:
    """Components (3, ...) in axes turned by `angle` about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * v[0] + s * v[1], c * v[1] - s * v[0], v[2] + 0.0 * c])


def _to_hole(v: Array, path: Path) -> Array:
    """NED components (3, 1 or n) in the axes of the hole: high side, right, down hole."""
    level = _about_z(v, path.azimuth)
    c, s = np.cos(path.inclination), np.sin(path.inclination)
    return np.stack([c * level[0] - s * level[2], level[1] + 0.0 * c, s * level[0] + c * level[2]])


def _to_tool(v: Array, turn: tuple[Array, Array]) -> Array:
    """Components in the axes of the hole (3, 1 or n) to tool axes (3, n); cosine and sine of the toolface."""
    c, s = turn
    return np.stack([c * v[0] + s * v[1], c * v[1] - s * v[0], np.broadcast_to(v[2], c.shape)])


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])

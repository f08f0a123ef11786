"""A simulated run: turning, shaking, sensors, faults; the readings of a tool that drills, the truth beside them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Index, Mask
from inclinometry.earth.rate import earth_rate
from inclinometry.errors import not_among, out_of_range
from inclinometry.rotations import wrap_positive
from inclinometry.simulate.drilling.scenario import (
    SCENARIOS,
    Band,
    Casing,
    Dropped,
    Fault,
    Hole,
    Instrument,
    Jitter,
    MagLag,
    Repeated,
    Rotation,
    Scenario,
    Shocks,
    StickSlip,
    Stuck,
    Swing,
    TriadErrors,
    Vibration,
    Whirl,
)
from inclinometry.simulate.tool import Seed, Streams


class Chunked:
    """White Gaussian noise by sample number, negative numbers too, drawn chunk by chunk."""

    def __init__(self, streams: Streams, chunk: int) -> None:
        self.streams, self.chunk = streams, chunk
        self._kept: dict[tuple[str, int], Array] = {}

    def white(self, name: str, start: int, stop: int) -> Array:
        """Unit normal numbers of samples start to stop - 1."""
        first, last = start // self.chunk, (stop - 1) // self.chunk
        for key in [key for key in self._kept if key[0] == name and not first <= key[1] <= last]:
            del self._kept[key]
        for key in [(name, index) for index in range(first, last + 1)]:
            if key not in self._kept:
                self._kept[key] = self.streams[f"{name}.{key[1]}"].standard_normal(self.chunk)
        parts = [self._kept[name, index] for index in range(first, last + 1)]
        offset = first * self.chunk
        return np.concatenate(parts)[start - offset : stop - offset]


class BandNoise:
    """Samples of one continuous band-limited Gaussian process, and of its first two derivatives where edges are sharp.

    With skirts, white numbers on the internal grid go through the impulse response of a Butterworth filter. With sharp
    edges they go through a kernel that is a smooth function of time: the difference of two sinc functions under a
    Gaussian window, so the edges of the spectrum are error functions and at half the lower end it is down by 130 dB.
    Derivatives are those of the kernel, hence exact, and any shift of time is allowed.
    """

    def __init__(self, band: Band, rate: float, name: str, noise: Chunked, reach: int) -> None:
        from scipy.fft import next_fast_len

        self._name, self._noise = name, noise
        # a soft upper edge must end before half the rate of the grid
        # softness of a band's edges: standard deviation of the Gaussian edge over the band's lower end
        # the same over the rate of the grid, at most
        self._band, self._rate, self._width = band, rate, min(0.1 * band.low, 0.01 * rate)
        self._gain = 1.0
        self._skirted = _butterworth(band, rate) if band.order else None
        if self._skirted is None:
            # half length of the kernel in standard deviations of its Gaussian window: cut off at 1.5e-8
            self._half = int(np.ceil(6.0 * rate / (2.0 * np.pi * self._width)))
        else:
            self._half = self._skirted.size // 2
        self._gain = band.rms / float(np.sqrt(np.sum(self._kernel(0, 0.0) ** 2)))
        self._size = int(next_fast_len(noise.chunk + 2 * reach + 2 * self._half + 2, real=True))
        self._spectra: dict[tuple[int, float], NDArray[np.complex128]] = {}

    def at(self, start: int, stop: int, orders: tuple[int, ...] = (0,), shift: float = 0.0) -> list[Array]:
        """Derivatives of the given orders at samples start to stop - 1, `shift` s later."""
        half = self._half
        transform = np.fft.rfft(self._noise.white(self._name, start - half, stop + half), self._size)
        found = []
        for key in [(order, shift) for order in orders]:
            if key not in self._spectra:
                self._spectra[key] = np.fft.rfft(self._kernel(*key), self._size)
            found.append(np.fft.irfft(transform * self._spectra[key], self._size)[2 * half : 2 * half + stop - start])
        return found

    def _kernel(self, order: int, shift: float) -> Array:
        """The kernel's derivative at the grid, `shift` s later."""
        if self._skirted is not None:
            return self._gain * self._skirted
        t = np.arange(-self._half, self._half + 1) / self._rate + shift
        high, low = (_sinc(2.0 * np.pi * f, t) for f in (self._band.high, self._band.low))
        s = [a - b for a, b in zip(high, low, strict=True)]
        c = (2.0 * np.pi * self._width) ** 2
        g0 = np.exp(-0.5 * c * t**2)
        g1, g2 = -c * t * g0, (c * c * t**2 - c) * g0
        return self._gain * (g0 * s[0], g1 * s[0] + g0 * s[1], g2 * s[0] + 2.0 * g1 * s[1] + g0 * s[2])[order]


def _butterworth(band: Band, rate: float) -> Array:
    """Impulse response, an odd number of taps, until it has decayed to 1e-10."""
    from scipy.signal import butter, sos2zpk, sosfilt

    sections = butter(band.order, [band.low, band.high], btype="bandpass", fs=rate, output="sos")
    slowest = float(np.abs(sos2zpk(sections)[1]).max())
    # where the impulse response of a filter with skirts is cut off
    half = int(np.ceil(0.5 * np.log(1e-10) / np.log(slowest)))
    return np.asarray(sosfilt(sections, np.eye(1, 2 * half + 1)[0]))


def _sinc(w: float, t: Array) -> tuple[Array, Array, Array]:
    """sin(w t) / t and its first two derivatives."""
    x = w * t
    small = np.abs(x) < 1e-2
    safe = np.where(small, 1.0, t)
    sine, cosine = np.sin(w * safe), np.cos(w * safe)
    zero = sine / safe
    one = (w * cosine - zero) / safe
    two = (-w * w * sine - 2.0 * one) / safe
    # the closed forms divide small differences by small times; both leave 1e-9 or less at the joint
    y = x * x
    near = (
        w * (1.0 - y / 6.0 + y * y / 120.0),
        w * w * x * (-1.0 / 3.0 + y / 30.0 - y * y / 840.0),
        w**3 * (-1.0 / 3.0 + y / 10.0 - y * y / 168.0),
    )
    return tuple(np.where(small, a, b) for a, b in zip(near, (zero, one, two), strict=True))  # type: ignore[return-value]


WANDERS: Final = 8


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
        slowest_wander = 0.005
        fastest_wander = 0.05
        low, high = np.log(slowest_wander), np.log(fastest_wander)
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
        self._tone_phase = noise.streams["tones"].uniform(0.0, 2.0 * np.pi, len(vibration.tones))

    def at(self, start: int, stop: int) -> Array:
        """Acceleration (3, n), m/s^2, of internal samples start to stop - 1."""
        total = np.zeros((3, stop - start))
        for axis, band in self._bands:
            total[axis] += band.at(start, stop)[0]
        if self._vibration.shocks is not None:
            self._blows(total, self._vibration.shocks, "shocks", start, stop)
        if self._vibration.whirl is not None:
            self._whirling(total, self._vibration.whirl, start, stop)
        time = np.arange(start, stop) / self._rate
        for tone, phase in zip(self._vibration.tones, self._tone_phase, strict=True):
            total[2] += tone.size * np.sin(2.0 * np.pi * tone.rate * time + phase)
        return total

    def tilted(self, start: int, stop: int) -> tuple[Array, Array] | None:
        """Slope of the axis in the hole (high side, right), rad, and its rate, rad/s, while the tool whirls tilted."""
        whirl = self._vibration.whirl
        if whirl is None or not whirl.tilt:
            return None
        turned = self._drive.at(np.arange(start, stop) / self._rate)
        cosine, sine = self._whirl_direction(whirl, turned.angle)
        slope = whirl.tilt * np.stack([cosine, sine])
        return slope, whirl.ratio * turned.rate * whirl.tilt * np.stack([-sine, cosine])

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


class Sensed(NamedTuple):
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
        # twenty time constants of what came before a chunk: what is left of its beginning is 2e-9
        self._memory = int(np.ceil(20.0 * scenario.instrument.eddy * self._rate))
        reach += self._memory
        self._torsion = None if torsion is None else BandNoise(torsion, self._rate, "torsion", noise, reach)
        self._lag = sum(fault.delay for fault in scenario.faults if isinstance(fault, MagLag))
        self._casings = [fault for fault in scenario.faults if isinstance(fault, Casing)]
        self._casing_phase = noise.streams["casing"].uniform(0.0, 2.0 * np.pi, (3, 3))
        self._earth = _about_z(earth_rate(self._hole.latitude)[:, None], self._hole.declination)

    def at(self, start: int, stop: int) -> Sensed:
        time = np.arange(start, stop) / self._rate
        drive = self._drive.at(time)
        torsion = self._twist(start, stop, (0, 1, 2))
        angle = drive if torsion is None else drive.plus(Angle(*torsion))
        turn = np.cos(angle.angle), np.sin(angle.angle)
        path = path_at(self._hole, time)
        # rate of the tool against the Earth, and what the lever arm adds to apparent gravity.
        # w = T' z + I' y_h + A' d, with y_h the level axis across the hole and d down; -(w' x r + w x (w x r)).
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
        gyro, accel = (
            (rate, np.zeros_like(rate))
            if not lever.any()
            else (rate, -(_cross(change, lever) + _cross(rate, _cross(rate, lever))))
        )
        apparent = _to_hole(np.array([[0.0], [0.0], [self._hole.gravity]]), path) - self._shaking.at(start, stop)
        tilted = self._shaking.tilted(start, stop)
        accel += _to_tool(apparent if tilted is None else _leaning(apparent, tilted[0]), turn)
        gyro += _to_tool(_to_hole(self._earth, path), turn)
        if tilted is not None:
            gyro += _to_tool(np.stack([-tilted[1][1], tilted[1][0], zero]), turn)
        if self._scenario.instrument.eddy:
            mag = self._delayed(start, stop)
            return Sensed(accel, mag, gyro, angle.angle, drive.rate)
        if self._lag:
            turn, path = self._lagging(time, start, stop)
        mag = _to_tool(_to_hole(self._field(time - self._lag), path), turn)
        return Sensed(accel, mag, gyro, angle.angle, drive.rate)

    def _delayed(self, start: int, stop: int) -> Array:
        """Flux density in the collar, whose currents let what turns through late: the external field, convolved."""
        from scipy.signal import lfilter

        eddy = self._scenario.instrument.eddy
        first = start - self._memory
        at = np.arange(first, stop) / self._rate
        turn, path = self._lagging(at, first, stop)
        outside = _to_tool(_to_hole(self._field(at - self._lag), path), turn)
        # exact for a field that goes straight from one internal sample to the next
        x = 1.0 / (eddy * self._rate)
        keep = float(np.exp(-x))
        share = (1.0 - keep) / x
        inside = lfilter([1.0 - share, share - keep], [1.0, -keep], outside[:2], axis=-1)
        return np.concatenate([inside, outside[2:]])[:, start - first :]

    def _twist(self, start: int, stop: int, orders: tuple[int, ...], shift: float = 0.0) -> list[Array] | None:
        return None if self._torsion is None else self._torsion.at(start, stop, orders, shift)

    def _lagging(self, time: Array, start: int, stop: int) -> tuple[tuple[Array, Array], Path]:
        """Where the tool pointed when the late magnetometer looked."""
        angle = self._drive.at(time - self._lag).angle
        twist = self._twist(start, stop, (0,), -self._lag)
        if twist is not None:
            angle = angle + twist[0]
        return (np.cos(angle), np.sin(angle)), path_at(self._hole, time - self._lag)

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


def _leaning(v: Array, slope: Array) -> Array:
    """Components in the axes of the hole (3, n) as a tool sees them whose axis leans by `slope` (2, n), rad."""
    return np.stack([v[0] - slope[0] * v[2], v[1] - slope[1] * v[2], v[2] + slope[0] * v[0] + slope[1] * v[1]])


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@dataclass(frozen=True, eq=False)
class DrillingTruth:
    """What was true at each sample, (n,).

    azimuth (from magnetic north), inclination, toolface : rad.
    rate : rad/s, of the toolface without torsional vibration.
    clipped : an element was at the end of its range somewhere under the filter.
    """

    azimuth: Array
    inclination: Array
    toolface: Array
    rate: Array
    clipped: Mask


@dataclass(frozen=True, eq=False)
class DrillingSimulation:
    """A run, or a block of one, of n samples.

    time : (n,) s, stamps; interval : s, of the even grid.
    accel, mag, gyro : (n, 3) m/s^2 of apparent gravity (gravity minus acceleration), nT, rad/s, in tool axes.
    temperature : (n,) degC; depth : (n,) m.
    truth : DrillingTruth
    """

    time: Array
    interval: float
    accel: Array
    mag: Array
    gyro: Array
    temperature: Array
    depth: Array
    truth: DrillingTruth

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, which: Index | slice) -> DrillingSimulation:
        """The same of some rows."""
        cut = {f.name: getattr(self, f.name)[which] for f in fields(self) if f.name not in ("interval", "truth")}
        truth = DrillingTruth(**{f.name: getattr(self.truth, f.name)[which] for f in fields(DrillingTruth)})
        return replace(self, **cut, truth=truth)


def joined(parts: Sequence[DrillingSimulation]) -> DrillingSimulation:
    """Blocks of one run, put together again."""
    if len(parts) == 1:
        return parts[0]
    names = [f.name for f in fields(DrillingSimulation) if f.name not in ("interval", "truth")]
    whole: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    truth = {f.name: np.concatenate([getattr(p.truth, f.name) for p in parts]) for f in fields(DrillingTruth)}
    return replace(parts[0], **whole, truth=DrillingTruth(**truth))


def low_pass(tool: Instrument) -> Array:
    """Taps of the Hamming-windowed sinc (as scipy.signal.firwin), gain 1 at 0 Hz."""
    if tool.taps == 1:
        return np.ones(1)
    place = np.arange(tool.taps) - (tool.taps - 1) / 2.0
    taps = np.sinc(2.0 * tool.cutoff / tool.rate * place) * np.hamming(tool.taps)
    return np.asarray(taps / taps.sum())


class Reading:
    """The instrument of one run; it keeps the random walks from chunk to chunk.

    `before` and `after` are the internal samples needed on either side of a chunk of `rows` rows.
    """

    def __init__(self, scenario: Scenario, streams: Streams, rows: int) -> None:
        self._tool, self._streams, self._rows = scenario.instrument, streams, rows
        self._taps = low_pass(self._tool)
        half = (self._tool.taps - 1) // 2
        # the first row's filter must end on a multiple of the factor for the decimator to meet it
        self.before = half + (-2 * half) % self._tool.factor
        self.after = half
        self.reach = max(self.before, self.after)
        self._walk = {name: np.zeros(3) for name in ("accel", "mag", "gyro")}

    def read(self, sensed: Sensed, index: int, warming: Array) -> tuple[Array, Array, Array, Mask]:
        """Rows (n, 3) of accelerometer, magnetometer and gyro, and where one of them clipped."""
        clipped = np.zeros(self._rows, dtype=np.bool_)
        tool = self._tool
        mag = sensed.mag + np.asarray(tool.hard_iron)[:, None]
        accel = self._triad("accel", tool.accel, sensed.accel, index, warming, clipped)
        magnetic = self._triad("mag", tool.mag, mag, index, warming, clipped)
        gyro = self._triad("gyro", tool.gyro, sensed.gyro, index, warming, clipped)
        return accel, magnetic, gyro, clipped

    def _triad(self, name: str, errors: TriadErrors, sensed: Array, index: int, warming: Array, clipped: Mask) -> Array:
        signal = (1.0 + np.asarray(errors.scale))[:, None] * sensed + np.asarray(errors.bias)[:, None]
        if errors.coupling:
            signal += np.reshape(errors.coupling, (3, 3)) @ sensed
        if np.isfinite(errors.reach):
            clipped |= self._under_filter((np.abs(signal) >= errors.reach).any(axis=0))
            signal = np.clip(signal, -errors.reach, errors.reach)
        # filtered rows (n, 3), each at the middle of its taps
        if self._taps.size == 1:
            rows = np.ascontiguousarray(signal[:, :: self._tool.factor].T)
        else:
            from scipy.signal import upfirdn

            first = (self.before + self.after) // self._tool.factor
            filtered = upfirdn(self._taps, signal, up=1, down=self._tool.factor, axis=-1)
            rows = np.ascontiguousarray(filtered[:, first : first + self._rows].T)
        random = self._streams[f"{name} noise.{index}"]
        if errors.noise:
            rows += errors.noise * random.standard_normal(rows.shape)
        rows += warming[:, None] * np.asarray(errors.bias_per_kelvin)
        if errors.walk:
            steps = errors.walk * np.sqrt(self._tool.interval) * random.standard_normal(rows.shape)
            walk = self._walk[name] + np.cumsum(steps, axis=0)
            self._walk[name] = walk[-1]
            rows += walk
        if errors.step:
            rows = np.round(rows / errors.step) * errors.step
        return np.clip(rows, -errors.reach, errors.reach) if np.isfinite(errors.reach) else rows

    def _under_filter(self, bad: Mask) -> Mask:
        """Rows with a bad internal sample within the filter's taps."""
        total = np.concatenate([[0], np.cumsum(bad)])
        first = self.before - self.after + np.arange(self._rows) * self._tool.factor
        return np.asarray(total[first + self._tool.taps] > total[first])


def recorded(
    block: DrillingSimulation, index: int, faults: tuple[Fault, ...], streams: Streams, shown: dict[int, float]
) -> DrillingSimulation:
    """The chunk with the faults of the run; `shown` remembers from chunk to chunk what a stuck channel shows."""
    for number, fault in enumerate(faults):
        random = streams[f"fault {number}.{index}"]
        if isinstance(fault, Stuck):
            name, axis = fault.channel.split("_")
            column = "xyz".index(axis)
            rows: Array = getattr(block, name).copy()
            stuck = np.flatnonzero((block.time >= fault.start) & (block.time < fault.stop))
            if stuck.size:
                rows[stuck, column] = shown.setdefault(number, float(rows[stuck[0], column]))
            changed: dict[str, Any] = {name: rows}
            block = replace(block, **changed)
        elif isinstance(fault, Jitter):
            block = replace(block, time=block.time + fault.sd * random.standard_normal(len(block)))
        elif isinstance(fault, Dropped):
            block = block.rows(np.flatnonzero(random.random(len(block)) >= fault.fraction))
        elif isinstance(fault, Repeated):
            block = block.rows(np.repeat(np.arange(len(block)), 1 + (random.random(len(block)) < fault.fraction)))
    return block


def simulate_drilling(scenario: str | Scenario, seed: Seed, *, duration: float | None = None) -> DrillingSimulation:
    """Readings of a tool that drills, and the truth; a longer run begins with the same numbers as a shorter one.

    gyro = w + C w_e, mag = C b + hard iron, accel = C g - R_z(T) a - w x (w x r) - w' x r, where C = R_z(T) R_y(I)
    R_z(A), w = T' z + I' y_h + A' d, r the lever, a the acceleration in hole axes. Computed at the internal rate,
    clipped, filtered without delay, decimated; then noise, bias and steps are added. Truth is exact at the stamps.
    """
    blocks = list(_chunks(_scenario(scenario), seed, duration, endless=False))
    return joined(blocks)


def drilling_blocks(
    scenario: str | Scenario, seed: Seed, *, duration: float | None = None, block: int = 4096
) -> Iterator[DrillingSimulation]:
    """The rows of `simulate_drilling`, bit for bit, in blocks; memory does not grow with `duration`, even infinite."""
    if block < 1:
        raise out_of_range("block", block, ">= 1")
    return _blocks(_chunks(_scenario(scenario), seed, duration, endless=True), int(block))


def _scenario(scenario: str | Scenario) -> Scenario:
    if isinstance(scenario, Scenario):
        return scenario
    if scenario not in SCENARIOS:
        raise not_among("scenario", str(scenario), SCENARIOS)
    return SCENARIOS[scenario]


def _chunks(scenario: Scenario, seed: Seed, duration: float | None, endless: bool) -> Iterator[DrillingSimulation]:
    """Check, then simulate chunk after chunk, each cut to the duration."""
    length = scenario.duration if duration is None else duration
    if not length >= 0.5 * scenario.instrument.interval or (math.isinf(length) and not endless):
        least = scenario.instrument.interval
        raise out_of_range("duration", float(length), f"{least:g} s <= t < inf")
    if math.isfinite(length):
        end = float(path_at(scenario.hole, np.array([length])).inclination[0])
        if not 0.0 <= end <= math.pi:
            raise out_of_range("hole.build: inclination", end, "0 .. pi rad")
    return _generate(scenario, Streams(seed, "drilling"), length)


def _generate(scenario: Scenario, streams: Streams, length: float) -> Iterator[DrillingSimulation]:
    """Equal chunks, the last cut: it is simulated whole, so that a longer run begins with the same numbers."""
    tool = scenario.instrument
    # internal samples drawn together, and at most simulated together; a constant of the numbers, never an option
    chunk = 2**15
    rows = max(1, chunk // tool.factor)
    # draws go by internal samples: two instruments of the same internal rate feel the same vibration
    noise = Chunked(streams, chunk)
    reading = Reading(scenario, streams, rows)
    physics = Physics(scenario, noise, reading.reach)
    shown: dict[int, float] = {}
    total = round(length / tool.interval) if math.isfinite(length) else math.inf
    index = 0
    while index * rows < total:
        first = index * rows * tool.factor
        sensed = physics.at(first - reading.before, first + rows * tool.factor + reading.after)
        block = _read(scenario, reading, sensed, index, rows)
        block = block.rows(slice(0, int(min(rows, total - index * rows))))
        yield recorded(block, index, scenario.faults, streams, shown)
        index += 1


def _read(scenario: Scenario, reading: Reading, sensed: Sensed, index: int, rows: int) -> DrillingSimulation:
    """The chunk as read, with its truth."""
    tool, hole = scenario.instrument, scenario.hole
    time = np.arange(index * rows, (index + 1) * rows) * tool.factor / tool.rate
    warming = hole.heating * time
    accel, mag, gyro, clipped = reading.read(sensed, index, warming)
    path = path_at(hole, time)
    middle = slice(reading.before, reading.before + rows * tool.factor, tool.factor)
    truth = DrillingTruth(
        azimuth=wrap_positive(np.broadcast_to(path.azimuth, time.shape)),
        inclination=np.broadcast_to(path.inclination, time.shape).copy(),
        toolface=wrap_positive(sensed.toolface[middle]),
        rate=sensed.rate[middle].copy(),
        clipped=clipped,
    )
    depth = hole.depth + hole.penetration * time
    return DrillingSimulation(time, tool.interval, accel, mag, gyro, hole.temperature + warming, depth, truth)


def _blocks(chunks: Iterable[DrillingSimulation], block: int) -> Iterator[DrillingSimulation]:
    waiting: list[DrillingSimulation] = []
    count = 0
    for chunk in chunks:
        waiting.append(chunk)
        count += len(chunk)
        if count < block:
            continue
        whole, start = joined(waiting), 0
        while count >= block:
            yield whole.rows(slice(start, start + block))
            start, count = start + block, count - block
        waiting = [whole.rows(slice(start, None))]
    if count:
        yield joined(waiting)

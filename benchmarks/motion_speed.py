"""Demodulation and the error-state filter: samples and updates a second beside plain numpy, and 1e7 steps at 600 rpm.

    python -m benchmarks.motion_speed [--json] [--rounds 7] [--steps 1e7]

Processor time of one core, medians of rounds that alternate between all measurements; ratios are of the same run. The
plain demodulation is whole-array numpy; the plain filter is the textbook's as filterpy has it: dense 15 by 15 matrices,
prediction, one scalar update in Joseph form. Both do the arithmetic of ours, not its flags and rows. An update of ours
is a prediction, a measurement of the field and the running sums for gravity, with 16 states.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np

from benchmarks import command
from inclinometry.earth.site import Site
from inclinometry.motion.inertial.filter import InertialStream, inertial_attitude
from inclinometry.motion.inertial.state import (
    InertialSettings,
    Model,
)
from inclinometry.motion.inertial.window import (
    filter_window,
    initial_state,
    reinitialise_attitude,
)
from inclinometry.motion.magnetic import _kernels
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.motion.result import Samples
from inclinometry.orientation import fields

FAST, SLOW = 2000.0, 200.0  # Hz
STEP = 20  # samples of a node at 2 kHz
INCLINATION, AZIMUTH, DIP = 0.5, 1.0, 1.1
SITE = Site(g=9.81, dip=DIP, b=5e4)
TEN_TURNS = 20.0 * np.pi  # rad/s: 600 rpm
BLOCK = 20_000
WANTED = {"demodulation, samples a second": 20e6, "filter, updates a second": 1e6, "filterpy, updates a second": 5e4}


def spinning(count: int, rate: float, *, seed: int, first: int = 0, turning: float = TEN_TURNS) -> Samples:
    """Readings at `rate` Hz of a tool that turns steadily; the gyro 0.1 % and 1e-3 rad/s off."""
    draw, stamps = np.random.default_rng(seed), (first + np.arange(count)) / rate
    gravity, field = fields(AZIMUTH, INCLINATION, np.mod(turning * stamps, 2.0 * np.pi), DIP)
    gyro = np.tile([0.0, 0.0, 1.001 * turning + 1e-3], (count, 1))
    return Samples(
        stamps,
        1.0 / rate,
        accel=9.81 * gravity + draw.normal(0.0, 2.0, (count, 3)),
        mag=5e4 * field + draw.normal(0.0, 50.0, (count, 3)),
        gyro=gyro,
    )


class Demodulation:
    """The same sums over nodes by the kernel and by whole arrays."""

    def __init__(self, samples: Samples) -> None:
        self.accel, self.mag = np.asarray(samples.accel), np.asarray(samples.mag)
        self.nodes = len(samples) // STEP
        place = np.arange(len(samples)) % STEP - 0.5 * (STEP - 1)
        self.phase = np.ascontiguousarray(-TEN_TURNS / FAST * place)
        middle = -TEN_TURNS / FAST * (STEP * np.arange(self.nodes) + 0.5 * (STEP - 1))
        self.phasor = np.exp(1j * middle)
        self.u = np.stack([self.phasor.real, self.phasor.imag])

    def kernel(self) -> np.ndarray:
        out = np.zeros((_kernels.COLUMNS, self.nodes))
        _kernels.demodulated(self.accel, self.mag, self.phase, self.u, 0.0, 0.0, STEP, out)
        return out

    def plain(self) -> np.ndarray:
        back = np.exp(-1j * self.phase) * np.repeat(self.phasor.conj(), STEP)
        x = (np.arange(STEP) - 0.5 * (STEP - 1)) / STEP
        far = np.abs(x) / STEP
        rows = [
            *_parts((self.accel[:, 0] + 1j * self.accel[:, 1]) * back), self.accel[:, 2],
            *_parts((self.mag[:, 0] + 1j * self.mag[:, 1]) * back), self.mag[:, 2],
            *_parts(back), np.ones(len(back)),
        ]  # fmt: skip
        out = np.empty((len(rows), self.nodes))
        for row, values in zip(out, rows, strict=True):
            each = values.reshape(self.nodes, STEP)
            row[:] = each @ (1.0 / STEP - far)
            row[1:] += each[:-1] @ np.where(x > 0.0, far, 0.0)
            row[:-1] += each[1:] @ np.where(x < 0.0, far, 0.0)
        return out


def _parts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return values.real, values.imag


def dense(samples: Samples) -> np.ndarray:
    """Attitude, bias, scale, accelerometer bias and hard iron, 15 states, as a library of dense matrices does it."""
    settings, dt, unit = InertialSettings(), samples.interval, np.eye(15)
    x, p = np.zeros(15), settings.prior(np.eye(3), 0.0)[:15, :15]
    noise, variance = (
        np.diag(settings.step_variances(dt, settings.gyro_noise)[:15]),
        np.array([[settings.mag_noise**2]]),
    )
    transition, h = np.eye(15), np.zeros((1, 15))
    for i, (rate, field) in enumerate(zip(np.asarray(samples.gyro), np.asarray(samples.mag), strict=True)):
        angle = TEN_TURNS * dt
        transition[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        transition[:3, 3:6], transition[:3, 6:9] = dt * np.eye(3), np.diag(dt * rate)
        x = transition @ x
        p = transition @ p @ transition.T + noise
        h[0, :3] = 5e4 * np.roll(field / 5e4, i % 2)
        h[0, 12:] = -1.0
        residual = -(h @ x)
        mixed = p @ h.T
        gain = mixed @ np.linalg.inv(h @ mixed + variance)
        x = x + gain @ residual
        keep = unit - gain @ h
        p = keep @ p @ keep.T + gain @ variance @ gain.T
    return x


def measurements() -> dict[str, tuple[Callable[[], object], int]]:
    """Name: call, samples."""
    quick, usual = spinning(400_000, FAST, seed=1), spinning(100_000, SLOW, seed=2)
    nodes = Demodulation(quick)
    ours, plain = nodes.kernel(), nodes.plain()
    if not np.abs(ours - plain).max() < 1e-7 * np.abs(plain).max():
        raise SystemExit("the two demodulations differ")
    long, model = usual.part(0, BLOCK), Model(InertialSettings(window=100.0), SITE, True)
    state = reinitialise_attitude(initial_state(long, model), long, model)
    few = usual.part(0, 1000)
    blocks = [usual.part(a, a + BLOCK) for a in range(0, len(usual), BLOCK)]

    def streamed() -> None:
        stream = InertialStream(None, SITE)
        for block in blocks:
            stream.push(block)

    return {
        "demodulation": (nodes.kernel, len(quick)),
        "demodulation, numpy": (nodes.plain, len(quick)),
        "magnetic attitude, 2 kHz": (
            lambda: magnetic_attitude(quick, MagneticSettings(overlap=0.0, use_gyro=False)),
            len(quick),
        ),
        "filter": (lambda: filter_window(state, long, model, True), len(long)),
        "filter, dense numpy": (lambda: dense(few), len(few)),
        "inertial stream, 200 Hz": (streamed, len(usual)),
        "inertial attitude, 200 Hz": (lambda: inertial_attitude(usual, None, SITE), len(usual)),
    }


def speed(rounds: int) -> dict:
    """Samples a second and ratios."""
    calls = measurements()
    for call, _ in calls.values():
        call()
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, (call, _) in calls.items():
            start = time.process_time()
            call()
            seconds[name].append(time.process_time() - start)
    rates = {name: count / statistics.median(seconds[name]) for name, (_, count) in calls.items()}
    return {
        "samples a second": rates,
        "demodulation times numpy": rates["demodulation"] / rates["demodulation, numpy"],
        "filter times dense numpy": rates["filter"] / rates["filter, dense numpy"],
    }


def endurance(steps: int) -> dict:
    """The whole filter over so many samples at 600 rpm: finite, positive, and how far off at the end."""
    stream, finite, least, refused, windows = InertialStream(None, SITE), True, np.inf, 0, 0
    last = (np.nan, np.nan)
    for number in range(max(steps // BLOCK, 1)):
        rows = stream.push(spinning(BLOCK, SLOW, seed=number, first=number * BLOCK))
        good = ~rows.refused
        windows, refused = windows + len(rows), refused + int(rows.refused.sum())
        finite &= bool(np.isfinite(rows.quaternion[good]).all() and np.isfinite(rows.covariance[good]).all())
        least = min(least, float(np.linalg.eigvalsh(rows.covariance[good]).min(initial=np.inf)))
        if good.any():
            last = float(rows.angles.inclination[good][-1]), float(rows.u.inclination[good][-1])
    return {
        "steps": windows * int(InertialSettings().window * SLOW),
        "finite": finite,
        "smallest eigenvalue, rad^2": least,
        "windows": windows,
        "refused": refused,
        "inclination error at the end, deg": float(np.degrees(last[0] - INCLINATION)),
        "its u, deg": float(np.degrees(last[1])),
    }


def run(rounds: int = 7, steps: int = 10_000_000) -> dict:
    """All figures."""
    return {"speed": speed(rounds), "endurance": endurance(steps), "wanted": WANTED}


def report(results: dict) -> None:
    """Print them."""
    found = results["speed"]
    for name, rate in found["samples a second"].items():
        print(f"{name:28s} {rate / 1e6:8.3f} M samples/s")
    print(f"demodulation: plain numpy x {found['demodulation times numpy']:.1f} (wanted 20 M samples/s)")
    print(f"15-state filter: dense numpy x {found['filter times dense numpy']:.0f} (wanted 1 M updates/s)")
    print("600 rpm: " + ", ".join(f"{name} {value:.6g}" for name, value in results["endurance"].items()))


if __name__ == "__main__":
    command(__doc__, run, report)

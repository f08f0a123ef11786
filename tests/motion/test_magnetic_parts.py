"""The parts of the magnetic attitude against plain numpy: demodulation, band fit, smoother, circle."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.motion.magnetic.demodulate import demodulate
from inclinometry.motion.magnetic.phase import basis, fit, fit_circle, remembered, smooth, untried
from inclinometry.motion.result import Samples

ONE = np.zeros(1, dtype=np.complex128)
FREE = np.zeros((1, 1), dtype=np.complex128)


def triangles(values: np.ndarray, step: int) -> np.ndarray:
    """Means under triangles of twice a node's length about its middle; the definition, node by node."""
    places = np.arange(values.size)
    out = []
    for node in range(values.size // step):
        middle = node * step + 0.5 * (step - 1)
        weight = np.maximum(1.0 - np.abs(places - middle) / step, 0.0)
        # a node's neighbours reach half a node into it, no further
        weight[np.abs(places - middle) >= step] = 0.0
        out.append((weight @ values) / weight.sum())
    return np.array(out)


@pytest.mark.parametrize("gyro", [True, False])
def test_demodulation_is_what_it_says(gyro: bool) -> None:
    """Exact phase data of a smooth rotation: 3e-5 is what a cubic through 40 ms bends off the sine."""
    count, step, interval = 2000, 20, 0.0005
    time = interval * np.arange(count)
    turn = 5.0 * time + 0.3 * np.sin(4.0 * time)
    rate = 5.0 + 1.2 * np.cos(4.0 * time)
    rng = np.random.default_rng(1)
    accel, field = rng.normal(size=(count, 3)), 2e4 * np.exp(-1j * turn)
    mag = np.stack([field.real + 70.0, field.imag - 30.0, np.full(count, 4e4)], axis=1)
    gyros = np.stack([0.0 * rate, 0.0 * rate, rate], axis=1) if gyro else None
    samples = Samples(time, interval, accel, mag, gyros)
    d = demodulate(samples, step, 70.0 - 30.0j, with_gyro=gyro, delay=0.0)
    plain = triangles((accel[:, 0] + 1j * accel[:, 1]) * np.exp(1j * turn), step)
    inner = slice(8, -8)
    np.testing.assert_allclose(d.gravity[inner], plain[inner], atol=3e-5)
    np.testing.assert_allclose(d.axial_gravity, triangles(accel[:, 2], step), atol=1e-12)
    np.testing.assert_allclose(d.field[inner], 2e4, rtol=3e-5)
    middle = interval * (step * np.arange(count // step) + 0.5 * (step - 1))
    np.testing.assert_allclose(d.rate[inner], (5.0 + 1.2 * np.cos(4.0 * middle))[inner], rtol=1e-3)
    np.testing.assert_allclose(d.acceleration[inner], (-4.8 * np.sin(4.0 * middle))[inner], atol=0.15)


@pytest.mark.parametrize("power", [0, 4])
def test_mean_in_coloured_noise(power: int) -> None:
    """The normalised square of means of white noise and of noise of which a steep skirt reaches into the band."""
    count, rng = 200, np.random.default_rng(5)
    of, trust, squares, plain, ours = basis(count), untried(), [], [], []
    ones = np.ones((count, 1))
    for _ in range(400):
        spectrum = np.fft.rfft(rng.normal(size=4 * count))
        at = np.fft.rfftfreq(4 * count) * count / 7.0
        if power:
            spectrum *= np.sqrt(1.0 + 1e3 * np.minimum(at, 5.0) ** power)
        noise = np.fft.irfft(spectrum)[count : 2 * count]
        found = fit(of, noise, ones, ONE, FREE, trust)
        trust = remembered(found.trust)
        squares.append(found.value[0].real ** 2 / found.covariance[0, 0].real)
        plain.append(noise.mean())
        ours.append(found.value[0].real)
    assert 0.75 < np.mean(squares) < 1.25
    if power:
        assert np.std(ours) < 0.1 * np.std(plain)
    else:
        assert np.std(ours) < 1.15 * np.std(plain)


def test_gain_is_the_derivative_of_the_mean() -> None:
    """Weights and noise held: the first coefficient of a slightly changed series."""
    rng = np.random.default_rng(2)
    count = 150
    of = basis(count)
    series = 5.0 + rng.normal(size=count) + 1j * rng.normal(size=count)
    found = fit(of, series, np.ones((count, 1)), ONE, FREE, untried())
    assert found.gain @ (of.tapers @ series) == pytest.approx(found.value[0], abs=1e-9)


def test_prior_decides_where_data_do_not() -> None:
    """Two equal regressors: the one with a prior about 3 +- 1e-3 stays there, the other takes the rest."""
    count = 150
    series = 10.0 + 1e-3 * np.random.default_rng(0).normal(size=count)
    rows = np.ones((count, 2))
    mean, precision = np.array([0.0, 3.0 + 0.0j]), np.diag([0.0, 1e6]).astype(np.complex128)
    found = fit(basis(count), series.astype(np.complex128), rows, mean, precision, untried())
    np.testing.assert_allclose(found.value, [7.0, 3.0], atol=1e-3)
    assert found.covariance[0, 0].real == pytest.approx(1e-6, rel=0.05)


def test_smoother_follows_and_averages() -> None:
    """White noise on a slow bend: a tenth of it is left; on a fast one the smoother shortens and says so."""
    rng = np.random.default_rng(4)
    at = np.arange(1000.0)
    for period, left, half in ((2000.0, 0.15, 60), (40.0, 0.6, 3)):
        phase = np.sin(2.0 * np.pi * at / period)
        errors, sigmas = [], []
        for _ in range(5):
            track = smooth(phase + 1e-2 * rng.normal(size=at.size))
            errors.append(np.sqrt(np.mean((track.phase - phase)[100:-100] ** 2)))
            sigmas.append(track.sigma)
            assert track.half >= half
        assert np.mean(errors) < left * 1e-2
        assert 0.6 < np.mean(sigmas) / np.mean(errors) < 1.6


def test_circle_centre_and_its_covariance() -> None:
    """Two hundred full circles: the normalised square of the centre; the least roundness makes it cautious."""
    rng = np.random.default_rng(6)
    squares = []
    for _ in range(200):
        z = 300.0 - 200.0j + 2e4 * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, 400))
        z = z + 20.0 * (rng.normal(size=400) + 1j * rng.normal(size=400))
        found = fit_circle(z, 0j, 500.0**2 * np.eye(2))
        off = np.array([found.centre.real - 300.0, found.centre.imag + 200.0])
        squares.append(off @ np.linalg.solve(found.covariance, off) / 2.0)
    assert 0.75 < np.mean(squares) < 1.25

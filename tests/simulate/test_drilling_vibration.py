"""Vibration and shocks: spectra, rms, derivatives, no velocity left behind."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from inclinometry.simulate.drilling import Scenario, simulate_drilling
from inclinometry.simulate.drilling.scenario import Band, Hole, Instrument, Rotation, Shocks, Tone, Vibration, Whirl

EVERY = Instrument(factor=1, taps=1)


def shaken(vibration=Vibration(), rotation=Rotation(toolface=0.0), duration=100.0, seed=1):  # noqa: B008
    """Acceleration (3, n) of a vertical tool, from its accelerometers."""
    scenario = Scenario(hole=Hole(0.0), rotation=rotation, vibration=vibration, instrument=EVERY)
    run = simulate_drilling(scenario, seed, duration=duration)
    return (np.array([0.0, 0.0, scenario.hole.gravity]) - run.accel).T


def spectrum(x, seconds=2.0):
    """One-sided density; the window's side lobes are 92 dB down."""
    return signal.welch(x, 2000.0, window="blackmanharris", nperseg=int(2000 * seconds), detrend=False)


@pytest.mark.parametrize("order", [0, 2])
def test_bands_have_their_rms_and_axes_are_independent(order):
    vibration = Vibration(Band(15.0, 200.0, 50.0, order), Band(5.0, 80.0, 20.0, order))
    a = shaken(vibration)
    # 2 x bandwidth x time independent values: 2e4 and more, so 0.5 % and for the correlation 0.7 %
    np.testing.assert_allclose(a.std(axis=1), [50.0, 50.0, 20.0], rtol=0.025)
    assert np.abs(np.corrcoef(a) - np.eye(3)).max() < 0.04


def test_sharp_bands_are_flat_inside_and_empty_outside():
    f, density = spectrum(shaken(Vibration(Band(15.0, 200.0, 50.0)))[0])
    inside = density[(f > 20.0) & (f < 195.0)]
    level = 50.0**2 / 185.0
    # about 130 degrees of freedom a line: 12 %
    assert inside.mean() == pytest.approx(level, rel=0.03)
    assert inside.std() < 0.2 * level
    outside = density[(f > 2.5) & (f < 7.5) | (f > 215.0)]
    assert outside.max() < 1e-8 * level  # what the window lets through
    assert density[0] < 1e-8 * level


def test_skirts_are_those_of_a_butterworth_filter():
    f, density = spectrum(shaken(Vibration(Band(15.0, 200.0, 50.0, 2)), duration=400.0)[1])
    sections = signal.butter(2, [15.0, 200.0], btype="bandpass", fs=2000.0, output="sos")
    gain = np.abs(signal.sosfreqz(sections, f, fs=2000.0)[1]) ** 2
    expected = gain * 50.0**2 / np.trapezoid(gain, f)
    some = (f > 3.0) & (f < 900.0)
    # 520 degrees of freedom a line; averaged over eleven lines 2 %, and the slope of the skirt within them
    ratio = np.convolve(density[some] / expected[some], np.ones(11) / 11, mode="valid")
    np.testing.assert_allclose(ratio, 1.0, atol=0.12)


def test_torsion_is_one_process_with_its_derivatives():
    band = Band(3.0, 30.0, 0.01)
    scenario = Scenario(hole=Hole(0.0, latitude=0.0), rotation=Rotation(torsion=band, toolface=3.0), instrument=EVERY)
    run = simulate_drilling(scenario, 5, duration=100.0)
    assert run.truth.toolface.std() == pytest.approx(0.01, rel=0.05)
    f, density = spectrum(run.truth.toolface)
    level = 0.01**2 / 27.0
    assert density[(f > 5.0) & (f < 28.0)].mean() == pytest.approx(level, rel=0.06)
    assert density[(f > 33.0)].max() < 1e-7 * level
    # the gyro feels the derivative: central differences of a 30 Hz process err by (w h)^2 / 6 = 1.5e-3
    slope = (run.truth.toolface[2:] - run.truth.toolface[:-2]) / (2.0 * run.interval)
    np.testing.assert_allclose(run.gyro[1:-1, 2], slope, atol=2e-3 * slope.std() * 4.0)
    assert (run.truth.rate == 0.0).all()


def test_blows_leave_no_velocity_and_come_from_all_sides():
    a = shaken(Vibration(shocks=Shocks(2.0, 200.0, 500.0)), duration=200.0)
    assert (a[2] == 0.0).all()
    size = np.hypot(a[0], a[1])
    starts = np.flatnonzero((size > 0.0) & (np.roll(size, 1) == 0.0))
    # 400 expected; Poisson 5 %, and a few run into each other
    assert len(starts) == pytest.approx(400, abs=80)
    alone = [i for i in starts if 0 < i < size.size - 8 and size[i + 6] == 0.0 and (size[i : i + 6] > 0.0).all()]
    pulses = np.array([a[:2, i : i + 6] for i in alone])
    peak = np.abs(np.hypot(*pulses.transpose(1, 0, 2))).max(axis=1)
    assert peak.min() >= 200.0
    assert peak.max() <= 500.0
    assert peak.mean() == pytest.approx(350.0, rel=0.05)
    np.testing.assert_allclose(pulses.sum(axis=2), 0.0, atol=1e-10)
    direction = pulses[:, :, 1] / peak[:, None]
    assert np.abs(direction.mean(axis=0)).max() < 0.15  # 400 directions: 0.035


def test_vibration_stands_in_the_hole_while_the_tool_turns():
    rotation = Rotation(math.tau * 2.0, toolface=0.0)
    vibration = Vibration(Band(40.0, 100.0, 30.0), shocks=Shocks(1.0, 100.0, 100.0))
    turned, still = shaken(vibration, rotation, 2.0), shaken(vibration, Rotation(toolface=0.0), 2.0)
    angle = math.tau * 2.0 * np.arange(4000) / 2000.0
    np.testing.assert_allclose((turned[0] + 1j * turned[1]) * np.exp(1j * angle), still[0] + 1j * still[1], atol=1e-9)


def test_one_option_does_not_disturb_the_draws_of_another():
    lateral, axial = Band(15.0, 200.0, 50.0), Band(5.0, 80.0, 20.0)
    both = shaken(Vibration(lateral, axial), duration=1.0)
    np.testing.assert_array_equal(both[2], shaken(Vibration(axial=axial), duration=1.0)[2])
    twice = shaken(Vibration(replace(lateral, rms=100.0)), duration=1.0)
    np.testing.assert_allclose(twice[:2], 2.0 * both[:2], rtol=1e-9, atol=1e-9)


def test_an_axis_that_leans_as_it_whirls_leaves_a_constant_along_the_tool():
    """tilt e (ratio omega)^2: the centripetal acceleration is seen under a constant angle."""
    omega, tilt = 4.0 * math.pi, math.radians(0.1)
    spinning = Rotation(omega, toolface=0.0)
    upright, leaning = (
        shaken(Vibration(whirl=Whirl(-4.0, 0.006, tilt=angle)), spinning, duration=10.0) for angle in (0.0, tilt)
    )
    assert abs(upright[2].mean()) < 1e-9
    assert -leaning[2].mean() == pytest.approx(tilt * 0.006 * 16.0 * omega**2, rel=1e-3)
    np.testing.assert_allclose(leaning[:2].mean(axis=1), 0.0, atol=1e-3)


def test_tones_shake_along_the_hole_with_the_size_and_rate_asked_for():
    found = shaken(Vibration(tones=(Tone(1.0, 0.5), Tone(6.0, 20.0))), duration=10.0)[2]
    lines = np.abs(np.fft.rfft(found)) / found.size * 2.0
    assert lines[10] == pytest.approx(0.5, rel=1e-6)
    assert lines[60] == pytest.approx(20.0, rel=1e-6)

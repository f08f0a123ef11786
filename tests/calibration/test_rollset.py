"""Roll-set harmonics by construction, and the figures of a published roll test on a synthetic twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inclinometry.calibration.rollset import roll_harmonics
from inclinometry.core.errors import IdentifiabilityError, InputError


@given(
    st.floats(-1e4, 1e4),
    st.floats(1.0, 1e4),
    st.floats(-3.1, 3.1),
    st.integers(3, 40),
    st.randoms(use_true_random=False),
)
def test_exact_at_any_rolls(offset, amplitude, phase, count, random):
    roll = np.sort([2 * np.pi * (k + 0.3 * random.random()) / count for k in range(count)])
    fit = roll_harmonics(roll, offset + amplitude * np.sin(roll + phase))
    # twelve digits of the largest number in the sum is what a 3 x 3 solve leaves
    size = 1e-11 * (abs(offset) + amplitude)
    assert fit.offset == pytest.approx(offset, abs=size)
    assert fit.amplitude == pytest.approx(amplitude, abs=size)
    assert np.sin(fit.phase - phase) == pytest.approx(0.0, abs=1e-7)
    assert fit.residual_max <= 10 * size


def test_equal_steps_are_the_fourier_sums():
    rng = np.random.default_rng(0)
    roll, signal = np.arange(36) * np.pi / 18, rng.normal(size=36)
    fit = roll_harmonics(roll, signal)
    assert fit.offset == pytest.approx(signal.mean(), abs=1e-14)
    assert fit.amplitude == pytest.approx(abs(signal @ np.exp(1j * roll)) / 18, abs=1e-14)
    assert fit.second_amplitude == pytest.approx(abs(signal @ np.exp(2j * roll)) / 18, abs=1e-14)


def test_synthetic_twin_of_the_roll_test():
    """The published constants with a 6-count second harmonic and noise made orthogonal to every harmonic fitted."""
    roll = np.radians(np.arange(36) * 10.0)
    rng = np.random.default_rng(3)
    columns = np.column_stack([np.ones(36), *(f(n * roll) for n in (1, 2) for f in (np.cos, np.sin))])
    noise = rng.normal(size=36)
    noise -= columns @ np.linalg.lstsq(columns, noise)[0]
    # 4.98^2 * 33 is the whole residual, of which 6^2 * 36 / 2 is the second harmonic
    noise *= np.sqrt((4.98**2 * 33 - 6.0**2 * 18) / (noise @ noise))
    signal = -12.19 + 10003.17 * np.sin(roll + np.radians(176.516)) + 6.0 * np.sin(2 * roll + 1.0) + noise
    fit = roll_harmonics(roll, signal)
    assert fit.offset == pytest.approx(-12.19, abs=1e-9)
    assert fit.amplitude == pytest.approx(10003.17, abs=1e-8)
    assert np.degrees(fit.phase) == pytest.approx(176.516, abs=1e-9)
    assert fit.residual_rms == pytest.approx(4.98, abs=1e-9)
    assert fit.second_amplitude == pytest.approx(6.0, abs=1e-9)
    assert fit.second_phase == pytest.approx(1.0, abs=1e-9)


def test_uncertainties_match_their_scatter():
    rng, roll = np.random.default_rng(1), np.radians(np.arange(12) * 30.0)
    fits = [roll_harmonics(roll, 5 + 2 * np.sin(roll + 0.4) + rng.normal(0, 0.05, 12)) for _ in range(600)]
    for name in ("offset", "amplitude", "phase"):
        scatter = np.std([getattr(f, name) for f in fits])
        stated = np.sqrt(np.mean([getattr(f, name + "_sd") ** 2 for f in fits]))
        # scatter of 600 draws is known to 3 %, four of which make the band
        assert stated == pytest.approx(scatter, rel=0.12)


def test_three_rolls_leave_nothing_over():
    fit = roll_harmonics(np.radians([0, 120, 240]), [1.0, 2.0, 4.0])
    assert fit.residual_rms == 0.0
    assert fit.second_amplitude is None


def test_a_constant_signal_has_no_phase_but_no_trouble_either():
    fit = roll_harmonics(np.radians([0, 90, 180, 270]), np.full(4, 3.0))
    assert fit.amplitude == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite([fit.phase, fit.phase_sd, fit.amplitude_sd]).all()


def test_clustered_second_harmonic_is_not_told():
    fit = roll_harmonics(np.radians([0, 0.001, 90, 90.001, 180, 180.001]), np.arange(6.0))
    assert fit.second_amplitude is None


@pytest.mark.parametrize(
    ("roll", "signal", "error", "words"),
    [
        ([0.0, 1.0], [1.0, 2.0], IdentifiabilityError, "at least 3"),
        ([0.0, 0.01, 0.02], [1.0, 2.0, 3.0], IdentifiabilityError, "span only"),
        ([0.0, 1.0, 2.0], [1.0, 2.0], InputError, "shape"),
    ],
)
def test_bad_rolls(roll, signal, error, words):
    with pytest.raises(error, match=words):
        roll_harmonics(roll, signal)

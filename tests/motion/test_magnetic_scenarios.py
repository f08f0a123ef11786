"""Errors and honesty of the magnetic attitude on the simulated scenarios, with the gyro and without."""

from __future__ import annotations

import numpy as np
import pytest

from .magnetic_runs import scored

# rms of inclination and azimuth, deg: the reference figures of a Hann-weighted least squares with lever regressors
FIGURES = {
    ("vibration-5g", 2.0): (0.221, 0.465),
    ("vibration-5g", 5.0): (0.046, 0.091),
    ("vibration-5g", 10.0): (0.026, 0.053),
    ("vibration-5g", 30.0): (0.016, 0.034),
    ("vibration-20g", 10.0): (0.103, 0.213),
    ("swing-600", 10.0): (0.136, 0.283),
    # others: twice what is reached, so that a change for the worse is seen
    ("steady-120", 2.0): (0.065, 0.12),
    ("smooth", 10.0): (0.008, 0.018),
    ("stick-slip", 2.0): (0.09, 0.17),
    ("stick-slip", 10.0): (0.026, 0.045),
    ("sliding", 10.0): (0.022, 0.043),
    ("stationary", 10.0): (0.007, 0.015),
    ("fast", 10.0): (0.045, 0.03),
    ("whirl", 10.0): (0.009, 0.02),
}


@pytest.mark.long
@pytest.mark.parametrize("gyro", [True, False])
@pytest.mark.parametrize(("name", "window"), FIGURES)
def test_errors_and_covariance(name: str, window: float, gyro: bool) -> None:
    """Five seeds of a minute. The normalised square, a mean over a few dozen overlapping windows, should be 0.8 to 1.3,
    0.6 to 1.4 allowed; with 15 windows of 30 s, 10 of them independent, it scatters by a quarter: up to 1.9. Still or
    sliding it is smaller: half of what is stated there are offsets of the sensors, which these tools do not have."""
    found = scored(name, window, gyro)
    inclination, azimuth = FIGURES[name, window]
    assert found.inclination <= inclination
    assert found.azimuth <= azimuth
    assert found.refused == 0
    low = 0.3 if name in ("sliding", "stationary") else 0.6
    assert low < found.nees < (1.9 if window == 30.0 else 1.4)


def test_clearly_better_than_the_figures() -> None:
    """Four times at 10 s: sequences of narrow band instead of one Hann window, and a phase that is smoothed."""
    found = scored("vibration-5g", 10.0, True)
    assert found.inclination < 0.0065
    assert found.azimuth < 0.015


@pytest.mark.long
def test_gyro_carries_the_toolface() -> None:
    """Without one the phase at an instant is the magnetometer's, 50 nT of 22 700: a third of the error with one."""
    with_gyro, without = scored("vibration-5g", 10.0, True), scored("vibration-5g", 10.0, False)
    assert with_gyro.toolface < 0.5 * without.toolface


def test_gyro_matters_for_gravity_at_high_speed() -> None:
    """At 600 rpm, 9 g of centripetal acceleration turn with the noise of the phase into noise of gravity."""
    assert scored("swing-600", 10.0, True).azimuth < 0.4 * scored("swing-600", 10.0, False).azimuth


@pytest.mark.parametrize("inclination", [3.0, 90.0, 120.0])
def test_any_inclination(inclination: float) -> None:
    """Same vibration; errors of the direction of the axis stay, so those of azimuth grow with 1 / sin I."""
    from dataclasses import replace

    from inclinometry.motion.magnetic.phase import MagneticSettings
    from inclinometry.motion.magnetic.window import magnetic_attitude
    from inclinometry.simulate.drilling import simulate_drilling

    from .magnetic_runs import FIVE, KNOWN, samples_of, score

    hole = replace(FIVE.hole, inclination=float(np.radians(inclination)), azimuth=float(np.radians(200.0)))
    runs = [simulate_drilling(replace(FIVE, hole=hole), seed, duration=60.0) for seed in range(2)]
    found = score((magnetic_attitude(samples_of(run), MagneticSettings(**KNOWN)), run) for run in runs)
    assert found.inclination < 0.01
    assert found.azimuth * np.sin(np.radians(inclination)) < 0.02
    assert 0.5 < found.nees < 1.8  # 22 overlapping windows

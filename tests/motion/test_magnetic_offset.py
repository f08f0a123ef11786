"""Delay of the magnetometer: found, with its uncertainty, and taken off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.motion.magnetic.clocks import clock_offset
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import magnetic_attitude
from inclinometry.simulate.drilling import SCENARIOS, DrillingSimulation, simulate_drilling
from inclinometry.simulate.drilling.scenario import MagLag

from .magnetic_runs import KNOWN, samples_of, score

CHOSEN = MagneticSettings(**KNOWN)


def late(name: str, delay: float, seed: int) -> DrillingSimulation:
    return simulate_drilling(replace(SCENARIOS[name], faults=(MagLag(delay),)), seed, duration=40.0)


@pytest.mark.parametrize("gyro", [True, False])
@pytest.mark.parametrize("delay", [0.0, 0.0007, 0.004, -0.002])
def test_delay_is_found(delay: float, gyro: bool) -> None:
    """To 0.05 ms, and inside three of its standard deviations."""
    for seed in range(2):
        found = clock_offset(samples_of(late("vibration-5g", delay, seed), gyro), CHOSEN)
        assert abs(found.delay_s - delay) < 5e-5
        assert abs(found.delay_s - delay) < 3.0 * found.sigma_s
        assert found.significant == (delay != 0.0)
        assert np.isnan(found.gyro_lag_s) != gyro
        if gyro:
            # gyro and accelerometer are in step: the gyro is early against the late magnetometer
            assert abs(found.gyro_lag_s + delay) < 3.0 * found.gyro_sigma_s


@pytest.mark.parametrize("gyro", [True, False])
def test_even_rotation_tells_nothing(gyro: bool) -> None:
    """The phase lag is then a constant like any other."""
    found = clock_offset(samples_of(late("smooth", 0.004, 1), gyro), CHOSEN)
    assert found.sigma_s > 0.005
    assert not found.significant


@pytest.mark.parametrize("gyro", [True, False])
def test_delay_is_taken_off(gyro: bool) -> None:
    """4 ms at 120 rpm turn gravity against the field by 2.9 deg, azimuth by 1; corrected, the figures stand."""
    runs = [late("vibration-5g", 0.004, seed) for seed in range(2)]
    rows = [(magnetic_attitude(samples_of(run, gyro), CHOSEN), run) for run in runs]
    found = score(rows)
    assert found.inclination < 0.026
    assert found.azimuth < 0.053
    assert all("step" in rows[0][0].names(row) for row in range(len(rows[0][0])))
    (delay,) = [one for one in rows[0][0].findings if one.code in ("motion-late", "motion-mag-lag")]
    assert delay.values["late_ms"] == pytest.approx(4.0, abs=0.1)


def test_delay_that_is_known_is_no_step() -> None:
    run = late("smooth", 0.004, 1)
    found = magnetic_attitude(samples_of(run), replace(CHOSEN, mag_delay_s=0.004))
    assert score([(found, run)]).azimuth < 0.053
    blind = magnetic_attitude(samples_of(run), CHOSEN)
    assert score([(blind, run)]).azimuth > 0.9


def test_run_that_cannot_tell() -> None:
    run = late("smooth", 0.0, 1)
    with refused("input-few", name="samples"):
        clock_offset(samples_of(run, stop=100), CHOSEN)

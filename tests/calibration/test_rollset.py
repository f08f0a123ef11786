"""Roll-set harmonics by construction, and the figures of a published roll test on a synthetic twin."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.rollset import roll_harmonics, second_harmonics
from inclinometry.errors import IdentifiabilityError, InputError
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool
from inclinometry.workflow.simulate import bench, characteristics


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


class TestSecondHarmonics:
    """Of a bench run: which of its causes is there, and none where there is none."""

    def run(self, rolls=8, rig=0.0, seed=1, **words):
        plan = plans.twelve(rolls, 3)
        stand = Rig(dip=np.radians(70.0), setting_sd=np.radians(rig))
        return bench(plan, seed, rig=stand, characteristic=characteristics(**words)).readings

    def test_half_a_per_cent_of_square_law_on_a_perfect_rig_is_named(self):
        """At 0134526: no warning, and the rig blamed for 0.07 to 0.11 deg."""
        readings = self.run(nonlinearity=0.005)
        said = [w for w in calibrate_joint(readings).warnings if w.startswith("second harmonic of the rolls")]
        assert any("accelerometer 1 is not linear" in w for w in said)
        found = second_harmonics(readings)
        for kind in ("accelerometer", "magnetometer"):
            # at full scale, 2048 counts, the law is 0.5 per cent; a square law in proportion to the swing
            wanted = 0.005 * found.swing[kind] / 2048.0
            assert (np.abs(found.square[kind] - wanted)[:2] < 4.0 * found.u_square[kind][:2]).all()
        assert abs(found.unevenness) < 5.0 * found.u_unevenness
        assert not any("turns unevenly" in w for w in said)

    def test_an_eccentric_dial_is_told_from_it(self):
        e = np.radians(0.5) * np.exp(1j * np.radians(40.0))
        plan = plans.twelve(8, 3)
        stood = plan.toolface + (e * np.exp(-1j * plan.toolface)).real
        tool = realistic_tool(1, bits=None)
        run = simulate_bench(tool, Rig(), plan.azimuth, plan.inclination, stood, seed=1)
        readings = BenchReadings(run.signals, plan.azimuth, plan.inclination, plan.toolface, reference=run.reference)
        found = second_harmonics(readings)
        assert found.unevenness == pytest.approx(e, abs=4.0 * found.u_unevenness)
        assert len(found.sentences) == 1
        assert "turns unevenly" in found.sentences[0]
        assert re.search("most at toolface (39|40|41) deg", found.sentences[0])  # u is 1 deg

    def test_none_where_there_is_none(self):
        """False alarms 1 in 1000 at most: none in 40, whatever the rig and number of rolls."""
        for seed in range(20):
            for rolls, rig in ((6, 0.3), (8, 0.1)):
                assert not second_harmonics(self.run(rolls, rig, seed)).sentences
        assert second_harmonics(self.run(5)) is None
        assert second_harmonics(BenchReadings({"accelerometer": np.eye(3)})) is None

    def test_a_published_channel_has_one(self):
        """A real accelerometer over 36 rolls: amplitude 10003 counts, second harmonic 6.0, residual rms 4.98."""
        roll = np.radians(np.arange(0.0, 360.0, 10.0))
        left = np.sqrt((33 * 4.98**2 - 18 * 6.0**2) / 31)  # what the second harmonic leaves of the residual
        for phase in np.radians([0.0, 40.0]):
            counts = -12.19 + 10003.17 * np.sin(roll + np.radians(176.516)) + 6.0 * np.cos(2.0 * roll - phase)
            counts = counts + left * np.random.default_rng(1).normal(size=36)
            found = second_harmonics(
                BenchReadings({"accelerometer": np.stack([counts, counts], axis=1)}, 0 * roll, 0 * roll + 1.57, roll)
            )
            second = found.second["accelerometer"][0, 0]
            u = found.u["accelerometer"][0, 0]
            assert abs(second) == pytest.approx(6.0, abs=4.0 * u)
            assert u == pytest.approx(left * np.sqrt(2.0 / 36.0), rel=0.35)  # 31 degrees of freedom
            assert all("it is not linear, or the tool turns unevenly" in sentence for sentence in found.sentences)
            assert len(found.sentences) == 2

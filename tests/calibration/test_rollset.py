"""Roll-set harmonics by construction, and the figures of a published roll test on a synthetic twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f, t
from tests.refusals import refused

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


def test_uncertainties_are_those_of_least_squares_carried_on():
    """Offset, amplitude and phase of 7 uneven rolls: derivatives by each reading against differences."""
    rng = np.random.default_rng(5)
    roll = np.sort(rng.uniform(0.0, 2.0 * np.pi, 7))
    signal = 5.0 + 2.0 * np.sin(roll + 0.4) + rng.normal(0.0, 0.05, 7)
    fit = roll_harmonics(roll, signal)
    assert fit.residual_rms == pytest.approx(np.sqrt(np.sum(fit.residual**2) / 4.0))
    assert fit.residual_max == pytest.approx(np.abs(fit.residual).max())
    np.testing.assert_allclose(fit.residual, signal - fit.offset - fit.amplitude * np.sin(roll + fit.phase), atol=1e-12)
    for name in ("offset", "amplitude", "phase"):
        ends = [[getattr(roll_harmonics(roll, signal + way), name) for way in h * np.eye(7)] for h in (1e-5, -1e-5)]
        slope = np.subtract(*ends) / 2e-5
        assert getattr(fit, name + "_sd") == pytest.approx(fit.residual_rms * np.linalg.norm(slope), rel=1e-6)
    table = fit.to_dict()
    assert table["phase_deg"][0] == pytest.approx(np.degrees(fit.phase))
    assert table["u_phase_deg"][0] == pytest.approx(np.degrees(fit.phase_sd))
    # of six or more rolls the second harmonic is told beside the first, of five not
    second = roll_harmonics(roll, signal + 0.7 * np.sin(2.0 * roll + 0.2))
    assert second.second_amplitude == pytest.approx(0.7, abs=0.2)
    assert roll_harmonics(roll[:5], signal[:5]).second_amplitude is None
    assert roll_harmonics(roll[:6], signal[:6]).second_amplitude is not None


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
    # four places for five unknowns
    fit = roll_harmonics(np.radians([0, 0.001, 0.002, 90, 180, 250]), np.arange(6.0))
    assert fit.second_amplitude is None


@pytest.mark.parametrize(
    ("roll", "signal", "error", "words"),
    [
        ([0.0, 1.0], [1.0, 2.0], IdentifiabilityError, "fit-undetermined"),
        ([0.0, 0.01, 0.02], [1.0, 2.0, 3.0], IdentifiabilityError, "fit-undetermined"),
        ([0.0, 1.0, 2.0], [1.0, 2.0], InputError, "input-shape signal"),
    ],
)
def test_bad_rolls(roll, signal, error, words):
    with refused(words, error=error):
        roll_harmonics(roll, signal)


class TestSecondHarmonics:
    """Of a bench run: which of its causes is there, and none where there is none."""

    def run(self, rolls=8, rig=0.0, seed=1, **words):
        plan = plans.twelve(rolls, 3)
        stand = Rig(dip=np.radians(70.0), setting_sd=np.radians(rig))
        return bench(plan, seed, rig=stand, characteristic=characteristics(**words))[0]

    def test_half_a_per_cent_of_square_law_on_a_perfect_rig_is_named(self):
        """At 0134526: no warning, and the rig blamed for 0.07 to 0.11 deg."""
        readings = self.run(nonlinearity=0.005)
        said = [one for one in calibrate_joint(readings).findings if one.code == "bench-roll-square"]
        assert ("accelerometer", 1) in [(one.values["kind"], one.values["sensor"]) for one in said]
        found = second_harmonics(readings)
        for kind in ("accelerometer", "magnetometer"):
            # at full scale, 2048 counts, the law is 0.5 per cent; a square law in proportion to the swing
            wanted = 0.005 * found.swing[kind] / 2048.0
            assert (np.abs(found.square[kind] - wanted)[:2] < 4.0 * found.u_square[kind][:2]).all()
        assert abs(found.unevenness) < 5.0 * found.u_unevenness
        assert "bench-roll-uneven" not in {one.code for one in found.findings}

    def test_an_eccentric_dial_is_told_from_it(self):
        e = np.radians(0.5) * np.exp(1j * np.radians(40.0))
        plan = plans.twelve(8, 3)
        stood = plan.toolface + (e * np.exp(-1j * plan.toolface)).real
        tool = realistic_tool(1, bits=None)
        run = simulate_bench(tool, Rig(), plan.azimuth, plan.inclination, stood, seed=1)
        readings = BenchReadings(run.signals, plan.azimuth, plan.inclination, plan.toolface, reference=run.reference)
        found = second_harmonics(readings)
        assert found.unevenness == pytest.approx(e, abs=4.0 * found.u_unevenness)
        (said,) = found.findings
        assert said.code == "bench-roll-uneven"
        assert said.values["at_deg"] == pytest.approx(40.0, abs=1.5)  # u is 1 deg

    def test_readings_without_noise_give_both_causes_back(self):
        """Sensors in every phase, uneven rolls, two swings: exact to the second order of the causes."""
        e, q = 1e-3 * np.exp(0.7j), np.array([2e-3, -1e-3, 3e-3])
        rng, rows = np.random.default_rng(6), []
        for inclination, swing, count in ((1.0, 1.0, 9), (0.6, 0.5, 7)):
            read = 2.0 * np.pi * (np.arange(count) + 0.3 * rng.random(count)) / count
            stood = read + (e * np.exp(-1j * read)).real
            v = swing * np.cos(stood[:, None] + [0.3, 1.9, 3.0])
            rows.append(np.column_stack([0.0 * read, 0.0 * read + inclination, read, v + q * v**2]))
        azimuth, inclination, toolface, *v = np.concatenate(rows).T
        v = np.stack(v, axis=1) + 1e-6 * rng.normal(size=(16, 3))
        found = second_harmonics(BenchReadings({"accelerometer": 7.0 * v}, azimuth, inclination, toolface))
        assert found.sets == ("azimuth 0, inclination 57.2958", "azimuth 0, inclination 34.3775")
        assert found.freedom == (9 - 5) + (7 - 5)
        assert found.unevenness == pytest.approx(e, abs=2e-5)
        np.testing.assert_allclose(found.square["accelerometer"], q, atol=2e-5)
        np.testing.assert_allclose(found.swing["accelerometer"], 7.0, rtol=1e-2)
        assert len(found.findings) == 4

    def test_the_uncertainties_are_the_scatter(self):
        """Noise alone, 200 runs: of the second harmonic, of the unevenness and of the square laws."""
        rng = np.random.default_rng(7)
        roll = np.tile(np.radians(np.arange(0.0, 360.0, 45.0)), 3)
        azimuth = np.repeat([0.0, 1.0, 2.0], 8)
        clean = 1000.0 * np.cos(roll[:, None] + [0.0, np.pi / 2.0])
        off, named = {"second": [], "unevenness": [], "square": []}, 0
        for _ in range(200):
            noisy = clean + rng.normal(0.0, 1.0, clean.shape)
            found = second_harmonics(BenchReadings({"accelerometer": noisy}, azimuth, 0.0 * roll + 1.5, roll))
            off["second"].append(abs(found.second["accelerometer"] / found.u["accelerometer"]) ** 2 / 2.0)
            off["unevenness"].append(abs(found.unevenness / found.u_unevenness) ** 2 / 2.0)
            off["square"].append((found.square["accelerometer"] / found.u_square["accelerometer"]) ** 2)
            named += len(found.findings)
        assert found.freedom == 9
        # squares of Student's t, the variance from 9 to 18 degrees of freedom; a tenth of chance
        for name, squares in off.items():
            assert 0.9 < np.mean(squares) < 1.35, name
        assert named <= 2  # one in a thousand

    def test_where_it_is_hardly_significant_it_is_not_named(self):
        """An unevenness and a square law below and above what one run in a thousand shows by chance: Fisher's F, t."""
        rng = np.random.default_rng(8)
        roll = np.tile(np.radians(np.arange(0.0, 360.0, 45.0)), 3)
        azimuth = np.repeat([0.0, 1.0, 2.0], 8)
        noise = rng.normal(0.0, 1.0, (24, 2))

        def run(size, square=0.0):
            v = 1000.0 * np.cos((roll + size * np.cos(roll))[:, None] + [0.0, np.pi / 2.0])
            v = v + 1e-3 * square * v**2 * [1.0, 0.0] + noise
            return second_harmonics(BenchReadings({"accelerometer": v}, azimuth, 0.0 * roll + 1.5, roll))

        sizes = 1e-3 * np.linspace(0.5, 9.0, 28)
        found = [run(size) for size in sizes]
        ratio = np.array([abs(one.unevenness) / one.u_unevenness for one in found])
        named = np.array([any(said.code == "bench-roll-uneven" for said in one.findings) for one in found])
        limit = np.sqrt(2.0 * f.isf(1e-3 / 3.0, 2, 9))
        assert named.any()
        assert not named.all()
        np.testing.assert_array_equal(named, ratio > limit)
        found = [run(0.0, size) for size in 1e-3 * np.linspace(0.5, 12.0, 24)]
        ratio = [one.square["accelerometer"][0] / one.u_square["accelerometer"][0] for one in found]
        square = [[said.values["sensor"] for said in one.findings if said.code == "bench-roll-square"] for one in found]
        named = [1 in sensors for sensors in square]
        assert 0 < sum(named) < 24
        np.testing.assert_array_equal(named, np.array(ratio) > t.isf(1e-3 / 6.0, 9))

    def test_sensors_in_one_phase_are_named_each_by_its_own_significance(self):
        """Two of three sets alike, so that nothing tells the causes apart: Fisher's F of the largest of 6 harmonics."""
        rng = np.random.default_rng(9)
        roll = np.tile(np.radians(np.arange(0.0, 360.0, 45.0)), 3)
        azimuth = np.repeat([0.0, 2.0 * np.pi - 1e-12, 2.0], 8)  # a full turn is the start again
        noise, limit = rng.normal(0.0, 1.0, (24, 2)), np.sqrt(2.0 * f.isf(1e-3 / 4.0, 2, 8 - 5 + 16 - 5))
        named, ratio = [], []
        for size in np.linspace(0.0, 6.0, 25):
            v = 1000.0 * np.cos(roll)[:, None] * [1.0, -1.0] + size * np.cos(2.0 * roll)[:, None] * [1.0, 0.0] + noise
            found = second_harmonics(BenchReadings({"accelerometer": v}, azimuth, 0.0 * roll + 1.5, roll))
            assert len(found.sets) == 2
            sensors = [said.values["sensor"] for said in found.findings if said.code == "bench-roll-second"]
            named.append([k in sensors for k in (1, 2)])
            ratio.append((np.abs(found.second["accelerometer"]) / found.u["accelerometer"]).max(axis=0))
        np.testing.assert_array_equal(named, np.array(ratio) > limit)
        assert 0 < np.sum(named) < 25

    def test_none_where_there_is_none(self):
        """False alarms 1 in 1000 at most: none in 40, whatever the rig and number of rolls."""
        for seed in range(20):
            for rolls, rig in ((6, 0.3), (8, 0.1)):
                assert not second_harmonics(self.run(rolls, rig, seed)).findings
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
            assert [said.code for said in found.findings] == ["bench-roll-second"] * 2

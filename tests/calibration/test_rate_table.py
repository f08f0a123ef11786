"""Gyros on known rates: exact without noise, honest with it, and clear about what the steps leave open."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, f, t
from tests.refusals import fits, refused

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.rate_table import (
    calibrate_rates,
    g_sensitivity_at_stand,
    scaled_design,
    suspects,
    table_rates,
)
from inclinometry.calibration.readings import BenchReadings
from inclinometry.constants import EARTH_RATE
from inclinometry.earth.rate import earth_rate
from inclinometry.errors import IdentifiabilityError
from inclinometry.rotations import dcm
from inclinometry.sensors import parameter_vector
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

LATITUDE = np.radians(55.0)
DEG_H = np.radians(1.0 / 3600.0)
SETTING_SD = np.radians(0.02)
SPEEDS = np.radians([-20.0, -5.0, 5.0, 20.0])
MOUNTS = np.radians([[0, 0], [90, 0], [90, 90], [180, 0], [90, 180], [90, 270], [54.7, 45], [125.3, 225]])


def steps(mounts=MOUNTS, speeds=SPEEDS):
    """Rates and gravity (K, 3) of every mounting at every speed."""
    inclination, toolface = np.repeat(mounts, len(speeds), axis=0).T
    rate = np.tile(speeds, len(mounts))
    rates = table_rates(inclination, toolface, rate, LATITUDE)
    return rates, dcm(0.0 * rate, inclination, toolface) @ [0.0, 0.0, 1.0]


def gyros(seed=1, count=3, degree=0):
    """Tensors per rad/s (degree + 1, m, 3), offsets (degree + 1, m) and g-sensitivity (m, 3) in arbitrary units."""
    random = np.random.default_rng(seed)
    shrink = (0.002 ** np.arange(degree + 1))[:, None, None]
    axes = np.concatenate([np.eye(3), random.normal(size=(count, 3))])[:count]
    tensor = shrink * 5000.0 * (axes + 0.02 * random.normal(size=(degree + 1, count, 3)))
    return tensor, 3.0 * shrink[..., 0] * random.normal(size=(degree + 1, count)), 0.2 * random.normal(size=(count, 3))


def signals_of(truth, rates, gravity, heat=None):
    tensor, offset, sensitivity = truth
    powers = np.ones((len(rates), 1)) if heat is None else (heat - 40.0)[:, None] ** np.arange(len(tensor))
    here = np.tensordot(powers, tensor, axes=1)
    return (here @ rates[..., None])[..., 0] + powers @ offset + gravity @ sensitivity.T


class TestExact:
    @pytest.mark.parametrize("count", [2, 3, 5])
    def test_without_noise_everything_comes_back(self, count):
        rates, gravity = steps()
        truth = gyros(count=count)
        found = calibrate_rates(signals_of(truth, rates, gravity), rates, gravity=gravity, g_sensitive=True, unit="V")
        # rounding of signals of about 2000 against coefficients of 1: 1e-12 times the condition of the design
        np.testing.assert_allclose(found.triad.tensor[0] / EARTH_RATE, truth[0][0], rtol=0, atol=1e-7)
        np.testing.assert_allclose(found.triad.offset[0], truth[1][0], atol=1e-10)
        np.testing.assert_allclose(found.g_sensitivity, truth[2], atol=1e-10)
        assert found.triad.unit == "V"
        assert found.triad.field_strength == EARTH_RATE
        assert len(found.parameter_names) == 7 * count == len(found.covariance)

    def test_a_temperature_campaign(self):
        rates, gravity = steps()
        heat = np.tile(np.array([-10.0, 40.0, 90.0]), len(rates))
        rates, gravity = np.repeat(rates, 3, axis=0), np.repeat(gravity, 3, axis=0)
        truth = gyros(degree=2)
        u = signals_of(truth, rates, gravity, heat)
        found = calibrate_rates(u, rates, gravity=gravity, temperature=heat, degree=2, g_sensitive=True)
        assert found.triad.reference_temperature == 40.0
        assert found.temperature_range == (-10.0, 90.0)
        np.testing.assert_allclose(found.triad.tensor / EARTH_RATE, truth[0], rtol=0, atol=1e-6)
        np.testing.assert_allclose(found.triad.offset, truth[1], atol=1e-9)

    def test_it_is_ordinary_weighted_least_squares(self):
        rates, gravity = steps()
        random = np.random.default_rng(3)
        sd = random.uniform(0.1, 0.5, (len(rates), 3))
        u = signals_of(gyros(), rates, gravity) + sd * random.normal(size=sd.shape)
        found = calibrate_rates(u, rates, gravity=gravity, g_sensitive=True, sd=sd)
        matrix = np.concatenate([rates / EARTH_RATE, np.ones((len(rates), 1)), gravity], axis=1)
        for sensor in range(3):
            weight = np.diag(sd[:, sensor] ** -2)
            covariance = np.linalg.inv(matrix.T @ weight @ matrix)
            direct = covariance @ matrix.T @ weight @ u[:, sensor]
            rows = [*range(4 * sensor, 4 * sensor + 4), *range(12 + 3 * sensor, 15 + 3 * sensor)]
            # the dumb normal equations have columns of sizes 1 and 5000: the square of that in digits is lost
            np.testing.assert_allclose(found.covariance[np.ix_(rows, rows)], covariance, rtol=1e-6, atol=1e-14)
            np.testing.assert_allclose(found.triad.offset[0, sensor], direct[3], rtol=1e-6)
            np.testing.assert_allclose(found.g_sensitivity[sensor], direct[4:], rtol=1e-6)
        assert found.dof == 3 * (len(rates) - 7)
        assert found.covariance[0, 4] == 0.0


class TestHonest:
    @pytest.mark.long
    @pytest.mark.parametrize("stated", [True, False])
    @pytest.mark.parametrize("g_sensitive", [True, False])
    def test_errors_are_what_the_covariance_says(self, stated, g_sensitive):
        rates, gravity = steps(MOUNTS[:6], SPEEDS[[0, 3]])
        tensor, offset, sensitivity = gyros()
        truth = (tensor, offset, sensitivity * g_sensitive)
        clean = signals_of(truth, rates, gravity)
        random = np.random.default_rng(7)
        total, draws = np.zeros(0), 400
        squares = []
        for _ in range(draws):
            u = clean + 0.3 * random.normal(size=clean.shape)
            found = calibrate_rates(u, rates, gravity=gravity, g_sensitive=g_sensitive, sd=0.3 if stated else None)
            got = parameter_vector(found.triad)
            want = np.concatenate([tensor[0] * EARTH_RATE, offset[0][:, None]], axis=1).ravel()
            total = got - want
            if g_sensitive:
                total = np.concatenate([total, (found.g_sensitivity - sensitivity).ravel()])
            squares.append(total**2 / np.diagonal(found.covariance))
        mean = np.mean(squares, axis=0)
        if stated:
            low, high = chi2.ppf([1e-5, 1 - 1e-5], draws) / draws
            assert (low < mean).all()
            assert (mean < high).all()
        else:
            # Student's t with 5 or 8 degrees of freedom, widened to variance 1; its fourth moment makes the mean of
            # 400 squares uncertain by sqrt((3 (n - 2) / (n - 4) - 1) / 400), 0.14 for n = 5, taken 4.5 times
            np.testing.assert_allclose(mean, 1.0, atol=0.63)
            assert np.mean(mean) == pytest.approx(1.0, abs=0.15)

    @pytest.mark.long
    def test_the_chance_is_uniform_where_gravity_does_nothing(self):
        rates, gravity = steps(MOUNTS[:6], SPEEDS[[0, 3]])
        tensor, offset, sensitivity = gyros(count=2)
        clean = signals_of((tensor, offset, 0.0 * sensitivity), rates, gravity)
        random = np.random.default_rng(5)
        for sd in (None, 0.3):
            chance = [
                calibrate_rates(clean + 0.3 * random.normal(size=clean.shape), rates, gravity=gravity, sd=sd).chance
                for _ in range(300)
            ]
            # twice the lesser of two uniforms: P(< 0.1) = 1 - 0.95^2; 300 draws scatter by 0.017
            assert np.mean(np.array(chance) < 0.1) == pytest.approx(0.0975, abs=0.06)

    def test_significance_is_said(self):
        rates, gravity = steps()
        truth = gyros()
        u = signals_of(truth, rates, gravity) + 0.05 * np.random.default_rng(1).normal(size=(len(rates), 3))
        asked = calibrate_rates(u, rates, gravity=gravity, g_sensitive=True)
        assert asked.chance < 1e-6
        assert fits(asked.findings[0], ["fit-g-significant"], {"remedy": "Keep it"})
        unasked = calibrate_rates(u, rates, gravity=gravity)
        assert unasked.chance == asked.chance
        assert unasked.findings[0].code == "fit-g-needed"
        none = signals_of((*truth[:2], 0.0 * truth[2]), rates, gravity)
        none = none + 0.05 * np.random.default_rng(1).normal(size=none.shape)
        (one,) = calibrate_rates(none, rates, gravity=gravity, g_sensitive=True).findings
        assert (one.code, one.values["verdict"]) == ("fit-g-significant", "not significant")
        assert calibrate_rates(none, rates, gravity=gravity).findings == ()
        assert calibrate_rates(none, rates).chance is None

    def test_noise_understated_is_said(self):
        rates, gravity = steps()
        u = signals_of(gyros(), rates, gravity) + np.random.default_rng(1).normal(size=(len(rates), 3))
        found = calibrate_rates(u, rates, gravity=gravity, g_sensitive=True, sd=0.1)
        assert found.findings[-1].code == "fit-misfit"

    def test_the_tool_keeps_the_block_of_its_own_parameters(self):
        rates, gravity = steps()
        found = calibrate_rates(signals_of(gyros(), rates, gravity), rates, gravity=gravity, g_sensitive=True, sd=0.1)
        np.testing.assert_array_equal(found.triad_covariance, found.covariance[:12, :12])
        assert found.uncertainty["gyro.g_sensitivity[2,1]"] > 0.0


class TestAgainstTheTextbook:
    """The F test, Student's t and the noise, each written out a second time."""

    def noisy(self, size=0.3, seed=2):
        rates, gravity = steps()
        weak = gyros()
        u = signals_of((*weak[:2], 0.3 * weak[2]), rates, gravity)
        return rates, gravity, u + size * np.random.default_rng(seed).normal(size=u.shape)

    def left(self, u, *columns):
        matrix = np.concatenate(columns, axis=1)
        matrix = matrix / np.abs(matrix).max(axis=0)
        residual = u - matrix @ np.linalg.lstsq(matrix, u, rcond=None)[0]
        return np.sum(residual**2, axis=0), len(matrix) - matrix.shape[1], residual, matrix

    @pytest.mark.parametrize("count", [1, 3])
    def test_the_chance_is_fishers_of_two_nested_models(self, count):
        rates, gravity, u = self.noisy()
        u, ones = u[:, :count], np.ones((len(u), 1))
        without, *_ = self.left(u, rates, ones)
        with_, dof, residual, matrix = self.left(u, rates, ones, gravity)
        chance = f.sf((without - with_) / 3.0 / (with_ / dof), 3, dof)
        found = calibrate_rates(u, rates, gravity=gravity, g_sensitive=True)
        assert found.chance == pytest.approx(min(1.0, count * chance.min()), rel=1e-6)
        stated = calibrate_rates(u, rates, gravity=gravity, g_sensitive=True, sd=0.3)
        chance = chi2.sf((without - with_) / 0.3**2, 3)
        assert stated.chance == pytest.approx(min(1.0, count * chance.min()), rel=1e-6)
        assert stated.chi_square == pytest.approx(with_.sum() / 0.3**2)
        assert stated.dof == found.dof == count * dof == pytest.approx(found.chi_square)
        # noise of each gyro from its own residuals; the covariance that of Student's t
        np.testing.assert_allclose(found.sd, np.sqrt(with_ / dof))
        np.testing.assert_allclose(found.residuals, residual, atol=1e-9)
        spread = np.linalg.inv(matrix.T @ matrix)[4:, 4:] * with_[0] / (dof - 2.0)
        np.testing.assert_allclose(found.covariance[4 * count : 4 * count + 3, 4 * count : 4 * count + 3], spread)

    def test_the_covariance_of_a_temperature_campaign_has_the_order_of_its_names(self):
        """Each gyro by its own least squares; between gyros nothing."""
        rates, gravity = (np.repeat(v, 2, axis=0) for v in steps())
        heat = np.tile([10.0, 50.0], len(rates) // 2)
        u = np.random.default_rng(3).normal(size=(len(rates), 2))
        found = calibrate_rates(u, rates, gravity=gravity, temperature=heat, degree=1, g_sensitive=True, sd=[0.3, 0.6])
        assert found.triad.reference_temperature == 30.0
        plain = np.concatenate([rates / EARTH_RATE, np.ones((len(rates), 1))], axis=1)
        design = np.concatenate([plain, plain * (heat - 30.0)[:, None], gravity], axis=1)
        size = np.abs(design).max(axis=0)
        inverse = np.linalg.inv((design / size).T @ (design / size)) / np.outer(size, size)
        best = inverse @ design.T @ u
        seen = 0
        for sensor, sd in ((0, 0.3), (1, 0.6)):
            rows = [4 * sensor + k for k in range(4)] + [8 + 4 * sensor + k for k in range(4)]
            rows += [16 + 3 * sensor + k for k in range(3)]
            scale = np.sqrt(np.diag(inverse))
            np.testing.assert_allclose(
                found.covariance[np.ix_(rows, rows)] / np.outer(scale, scale),
                sd**2 * inverse / np.outer(scale, scale), atol=1e-6,
            )  # fmt: skip
            values = np.concatenate([parameter_vector(found.triad), found.g_sensitivity.ravel()])[rows]
            np.testing.assert_allclose(values / scale, best[:, sensor] / scale, atol=1e-6)
            seen += len(rows)
            others = np.setdiff1d(np.arange(22), rows)
            assert not found.covariance[np.ix_(rows, others)].any()
            assert found.parameter_names[rows[-1]] == f"gyro.g_sensitivity[{sensor},2]"
        assert seen == len(found.covariance) == len(found.parameter_names)
        np.testing.assert_allclose(found.sd, [0.3, 0.6])
        table = found.to_dict()
        assert len(next(iter(table.values()))) == 2

    @pytest.mark.parametrize("spread", [None, 0.3])
    def test_a_suspect_is_a_step_that_a_fit_without_it_does_not_predict(self, spread):
        rates, _, u = self.noisy()
        u[9, 1] += 3.0
        u[20] -= [2.5, 0.0, 4.0]
        plain = scaled_design(rates, None, None, 20.0, 0)[0]
        sd = None if spread is None else np.full(u.shape, spread)
        found = suspects(u, plain, plain, sd)
        assert [one.row for one in found] == [20, 9]
        clean = np.setdiff1d(np.arange(32), [9, 20])
        for one in found:
            predicted = plain[one.row] @ np.linalg.lstsq(plain[clean], u[clean], rcond=None)[0]
            for gyro, off in one.off.items():
                assert off == pytest.approx(u[one.row, gyro] - predicted[gyro], rel=1e-6)
        assert list(found[0].off) == [0, 2]
        assert list(found[1].off) == [1]

    @pytest.mark.parametrize("size", [0.97, 1.03])
    def test_a_step_is_named_from_one_in_a_thousand_on(self, size):
        """Its t and the degrees of freedom from a fit without it, times the numbers tried (Bonferroni)."""
        rates, _, u = self.noisy()
        u = u[:, :2]
        plain = scaled_design(rates, None, None, 20.0, 0)[0]
        rest = np.delete(np.arange(32), 7)
        fit, left, *_ = np.linalg.lstsq(plain[rest], u[rest], rcond=None)
        gain = plain[7] @ np.linalg.inv(plain[rest].T @ plain[rest]) @ plain[7]
        sd = np.sqrt(left / 27.0 * (1.0 + gain))
        for gyro in range(2):
            bad = u.copy()
            bad[7] = plain[7] @ fit
            bad[7, gyro] += size * t.isf(0.001 / 64.0 / 2.0, 27) * sd[gyro]
            assert [(one.row, list(one.off)) for one in suspects(bad, plain, plain, None)] == (
                [(7, [gyro])] if size > 1.0 else []
            )

    def test_many_gyros_are_tried_and_clean_ones_left_alone(self):
        rates, _ = steps()
        plain = scaled_design(rates, None, None, 20.0, 0)[0]
        random = np.random.default_rng(9)
        # one in a thousand runs of 16 gyros: of 60 hardly one
        assert sum(bool(suspects(random.normal(size=(32, 16)), plain, plain, None)) for _ in range(60)) <= 1

    def test_no_more_than_a_sixth_is_named_and_gravity_is_not_taken_for_bad_steps(self):
        rates, gravity, u = self.noisy(0.01)
        plain, fuller = (scaled_design(rates, pull, None, 20.0, 0)[0] for pull in (None, gravity))
        u = signals_of(gyros(), rates, gravity) + 1e-3 * np.random.default_rng(1).normal(size=u.shape)
        assert suspects(u, plain, fuller, None) == []
        u[:9] += 50.0 * np.random.default_rng(2).normal(size=(9, 3))
        assert len(suspects(u, plain, fuller, None)) <= 32 // 6

    def test_a_latitude_of_the_wrong_sign_looks_as_if_the_earth_turned_otherwise(self):
        """The axial part of the Earth's rate stands still with the tool, as gravity does."""
        rates, gravity = steps()
        inclination, toolface = np.repeat(MOUNTS, len(SPEEDS), axis=0).T
        wrong = table_rates(inclination, toolface, np.tile(SPEEDS, len(MOUNTS)), -LATITUDE)
        tensor, offset, _ = gyros()
        u = signals_of((tensor, offset, np.zeros((3, 3))), rates, gravity)
        u += 5e-3 * np.random.default_rng(1).normal(size=u.shape)
        (one,) = calibrate_rates(u, wrong, gravity=gravity).findings
        off = 2.0 * np.degrees(EARTH_RATE * np.sin(LATITUDE)) * 3600.0
        assert one.code == "fit-rate-off"
        assert one.values["rate_deg_h"] == pytest.approx(off, rel=0.05)

    def test_how_much_the_residuals_exceed_a_stated_noise(self):
        rates, gravity, u = self.noisy()
        (one,) = calibrate_rates(u, rates, gravity=gravity, g_sensitive=True, sd=0.1).findings[1:]
        left, dof, *_ = self.left(u, rates, np.ones((32, 1)), gravity)
        assert one.values["times"] == pytest.approx(np.sqrt(left.sum() / 3 / dof) / 0.1)
        assert len(calibrate_rates(u, rates, gravity=gravity, g_sensitive=True, sd=0.3).findings) == 1

    def test_a_gyro_that_scatters_is_named_with_how_many_times(self):
        rates, _, _ = self.noisy()
        tensor, offset, _ = gyros()
        tensor = tensor * np.array([1.0, 3.0, 10.0])[:, None]  # gains apart do not count
        noise = np.random.default_rng(4).normal(size=(32, 3)) * [1.0, 3.0, 60.0]
        u = signals_of((tensor, offset, np.zeros((3, 3))), rates, np.zeros((32, 3))) + noise
        (one,) = calibrate_rates(u, rates).findings
        left, *_ = self.left(u, rates, np.ones((32, 1)))
        size = np.sqrt(left) / np.linalg.norm(tensor[0], axis=1)
        assert fits(
            one, ["bench-channel-noisy"], {"sensor": 3, "times": pytest.approx(size[2] / np.sort(size)[1], rel=2e-3)}
        )
        assert calibrate_rates(u[:, :2], rates).findings == ()

    @pytest.mark.parametrize("count", [8, 32])
    def test_it_is_named_from_three_times_on_where_that_is_no_chance(self, count):
        """Of few steps by Fisher's F of two scatters, one in ten thousand for the worst of three."""
        rates = np.random.default_rng(6).normal(size=(count, 3))
        tensor, offset, _ = gyros()
        noise, named, wanted = np.random.default_rng(7).normal(size=(count, 3)), [], []
        for size in np.geomspace(1.0, 40.0, 30):
            u = signals_of((tensor, offset, np.zeros((3, 3))), rates, np.zeros((count, 3))) + noise * [1.0, 1.0, size]
            left, dof, *_ = self.left(u, rates, np.ones((count, 1)))
            scatter = np.sqrt(left / dof) / np.linalg.norm(calibrate_rates(u, rates).triad.tensor[0], axis=1)
            ratio = scatter[2] / np.sort(scatter)[1]
            wanted.append(bool(ratio > 3.0 and 3.0 * f.sf(ratio**2, dof, dof) < 0.001))
            named.append(
                any(fits(one, ["bench-channel-noisy"], {"sensor": 3}) for one in calibrate_rates(u, rates).findings)
            )
        assert named == wanted
        assert 0 < sum(named) < 30


class TestTable:
    def test_whole_turns_average_the_horizontal_earth_rate_out(self):
        inclination, toolface, rate = 0.7, 2.0, 0.1
        azimuth = 2.0 * np.pi * np.arange(72) / 72
        matrix = dcm(azimuth, np.full(72, inclination), np.full(72, toolface))
        inertial = matrix @ (earth_rate(LATITUDE) + [0.0, 0.0, rate])
        want = table_rates(inclination, toolface, rate, LATITUDE)
        np.testing.assert_allclose(inertial.mean(axis=0), want, atol=1e-15)

    def test_clockwise_seen_from_above_is_positive_down(self):
        # the azimuth of a tool turning clockwise grows: the rate about its down-hole axis is positive hanging plumb
        assert table_rates(0.0, 0.0, 0.1, 0.0)[2] == pytest.approx(0.1)
        assert table_rates(np.pi, 0.0, 0.1, 0.0)[2] == pytest.approx(-0.1)

    def test_at_rest_it_is_the_earth_rate(self):
        found = table_rates([0.5, 0.5], [1.0, 1.0], [0.0, 0.1], LATITUDE, [2.0, np.nan])
        np.testing.assert_allclose(found[0], dcm(2.0, 0.5, 1.0) @ earth_rate(LATITUDE), atol=1e-20)
        assert np.linalg.norm(found[1]) == pytest.approx(0.1 - EARTH_RATE * np.sin(LATITUDE))

    @pytest.mark.parametrize("azimuth", [None, [np.nan, 1.0]])
    def test_at_rest_the_azimuth_is_needed(self, azimuth):
        with refused("input-missing", names=("azimuth",)):
            table_rates([0.5, 0.5], 1.0, [0.0, 0.1], LATITUDE, azimuth)

    def test_latitude_in_degrees(self):
        with refused("input-value", name="latitude"):
            table_rates(0.5, 1.0, 0.1, 55.0)


class TestWhatIsMissing:
    @pytest.mark.parametrize(
        ("mounts", "words"),
        [
            ([[0, 0], [90, 0], [180, 0], [45, 0]], "y"),
            ([[0, 0], [90, 90], [180, 0], [45, 90]], "x"),
            ([[90, 0], [90, 90], [90, 45]], "z"),
            ([[0, 0], [90, 45], [180, 0], [45, 45]], "(0.71, 0.71, 0.00)"),
        ],
    )
    def test_an_axis_about_which_nothing_turned(self, mounts, words):
        rates, _ = steps(np.radians(mounts))
        with refused("fit-constant", error=IdentifiabilityError, what="rate", axis=words):
            calibrate_rates(np.ones((len(rates), 3)), rates)

    def test_too_few_steps(self):
        rates, _ = steps(MOUNTS[:3], SPEEDS[[0, 3]])
        with refused("fit-few", error=IdentifiabilityError):
            calibrate_rates(np.ones((6, 3)), rates)
        assert calibrate_rates(1e3 * rates, rates, sd=1.0).dof == 6

    def test_one_temperature_for_degree_one(self):
        rates, _ = steps()
        with refused("fit-few", error=IdentifiabilityError):
            calibrate_rates(np.ones((len(rates), 3)), rates, temperature=np.full(len(rates), 20.0), degree=1)

    def test_an_axis_turned_about_at_one_temperature_only(self):
        rates, _ = steps()
        heat = np.where(np.abs(rates[:, 1]) > 0.01, 20.0, np.tile([20.0, 60.0], len(rates) // 2))
        with refused("fit-undetermined", error=IdentifiabilityError):
            calibrate_rates(np.ones((len(rates), 3)), rates, temperature=heat, degree=1)

    def test_one_speed_in_one_sense_cannot_tell_gravity_from_rate(self):
        rates, gravity = steps(MOUNTS, SPEEDS[[3]])
        with refused("fit-undetermined", error=IdentifiabilityError):
            calibrate_rates(np.ones((len(rates), 3)), rates, gravity=gravity, g_sensitive=True, sd=1.0)
        # and where nobody asked for it there is nothing to say
        assert calibrate_rates(1e3 * rates, rates, gravity=gravity).chance is None

    def test_gravity_that_never_changes(self):
        rates, _ = steps()
        gravity = np.tile([0.0, 0.0, 1.0], (len(rates), 1))
        with refused("fit-constant", error=IdentifiabilityError):
            calibrate_rates(np.ones((len(rates), 3)), rates, gravity=gravity, g_sensitive=True)

    @pytest.mark.parametrize(
        ("more", "code"),
        [
            ({"degree": 1}, "input-needs temperature_degree"),
            ({"degree": 4}, "input-value temperature_degree"),
            ({"g_sensitive": True}, "input-needs g-sensitivity"),
            ({"gravity": np.full((32, 3), 9.8)}, "input-value gravity[0, 0]"),
            ({"gravity": np.full((32, 3), 1.2)}, "input-value gravity[0, 0]"),
            ({"gravity": np.ones((3, 3))}, "input-shape gravity"),
            ({"temperature": np.ones(3)}, "input-shape temperature"),
            ({"sd": 0.0}, "input-value sd"),
            ({"sd": np.ones(2)}, "input-shape sd"),
        ],
    )
    def test_input(self, more, code):
        rates, _ = steps()
        with refused(code):
            calibrate_rates(np.ones((32, 3)), rates, **more)

    def test_shapes(self):
        rates, _ = steps()
        with refused("input-shape", name="signals"):
            calibrate_rates(np.ones(32), rates)
        with refused("input-shape", name="rates"):
            calibrate_rates(np.ones((31, 3)), rates)


class TestAtTheStand:
    """Second stage of an ordinary bench run: attitudes from the joint fit, latitude from the map."""

    NOISE = 0.02 * DEG_H

    def run(self, size, seed=5, setting_sd=SETTING_SD, sensitivity=None):
        kinds = {"accelerometer": 3, "gyro": 3}
        noise = {"accelerometer": 1e-4, "gyro": self.NOISE}
        tool = realistic_tool(3, sensors=kinds, bits=None, noise=noise)
        rig = Rig(latitude=LATITUDE, setting_sd=setting_sd, base_tilt=np.radians(1.0), tilt_axis=0.3, north_offset=0.2)
        plan = plans.orthogonal()
        true = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, seed=seed)
        if sensitivity is None:
            sensitivity = size * DEG_H * np.random.default_rng(seed).normal(size=(3, 3))
        gravity = true.orientation @ true.field_directions["accelerometer"]
        signals = {**true.signals, "gyro": true.signals["gyro"] + gravity @ sensitivity.T}
        readings = BenchReadings(
            signals, true.azimuth, true.inclination, true.toolface, units=true.units, reference=true.reference
        )
        return tool, true, sensitivity, readings

    def test_it_is_found_from_24_positions(self):
        tool, _, sensitivity, readings = self.run(0.5)
        assert len(readings) == 24
        found = g_sensitivity_at_stand(readings, calibrate_joint(readings, diagnose=False), LATITUDE)
        u = np.sqrt(np.diagonal(found.covariance))
        # nine components and twelve parameters: 4 standard uncertainties are exceeded once in 750 such runs
        assert (np.abs(found.g_sensitivity - sensitivity).ravel() < 4.0 * u[12:]).all()
        assert (u[12:] < 0.03 * DEG_H).all()
        assert (np.abs(parameter_vector(found.triad) - parameter_vector(tool.triads["gyro"])) < 4.0 * u[:12]).all()
        assert found.chance < 1e-10

    def test_and_not_where_there_is_none(self):
        _, _, _, readings = self.run(0.0)
        found = g_sensitivity_at_stand(readings, calibrate_joint(readings, diagnose=False), LATITUDE)
        assert found.chance > 0.01

    def test_along_the_axes_it_looks_like_another_latitude_to_the_joint_fit(self):
        # w + c g in the meridian: the latitude found is that of the sum, to the noise; north does not move
        size = 0.5 * DEG_H
        axes = (
            realistic_tool(3, sensors={"accelerometer": 3, "gyro": 3}, bits=None).triads["gyro"].tensor[0] / EARTH_RATE
        )
        tool, true, _, readings = self.run(0.0, setting_sd=0.0, sensitivity=size * axes)
        found = calibrate_joint(readings, diagnose=False, rig_sd=0.0)
        down, axis = (found.field_directions[k] for k in ("accelerometer", "gyro"))
        seen = -np.arcsin(axis @ down)
        polar = earth_rate(LATITUDE)
        assert seen == pytest.approx(np.arctan2(-polar[2] - size, polar[0]), abs=np.radians(0.1))
        assert np.degrees(abs(seen - LATITUDE)) > 0.5
        want = true.field_directions["gyro"]
        north = [np.arctan2(*(v - (v @ down) * down)[[1, 0]]) for v in (axis, want)]
        assert north[0] == pytest.approx(north[1], abs=np.radians(0.2))
        # the latitude of the stand brings it to light
        again = g_sensitivity_at_stand(readings, found, LATITUDE)
        u = np.sqrt(np.diagonal(again.covariance))[12:]
        assert (np.abs(again.g_sensitivity - size * axes).ravel() < 4.0 * u).all()
        assert (np.abs(again.triad.tensor[0] / tool.triads["gyro"].tensor[0].max() - axes / axes.max()) < 0.005).all()

    @pytest.mark.long
    def test_stations_left_out_of_the_fit_are_left_out_here(self):
        _, _, _, readings = self.run(0.5)
        signals = {k: v.copy() for k, v in readings.channels.items()}
        signals["gyro"][7] += 5.0 * EARTH_RATE
        spoilt = replace(readings, channels=signals)
        robust = calibrate_joint(spoilt, robust=True)
        found = g_sensitivity_at_stand(spoilt, robust, LATITUDE)
        assert len(robust.residuals.station) == len(found.residuals) == 23
        renamed = replace(spoilt, station=[f"s{i}" for i in range(24)])
        with refused("fit-stations-other"):
            g_sensitivity_at_stand(renamed, robust, LATITUDE)

    def test_what_it_needs(self):
        _, _, _, readings = self.run(0.0)
        alone = replace(readings, channels={"accelerometer": readings.channels["accelerometer"]}, sd={}, units={})
        with refused("input-triads"):
            g_sensitivity_at_stand(alone, calibrate_joint(alone, diagnose=False), LATITUDE)
        with refused("fit-undetermined", error=IdentifiabilityError):
            g_sensitivity_at_stand(readings, calibrate_joint(readings, diagnose=False), np.pi / 2)

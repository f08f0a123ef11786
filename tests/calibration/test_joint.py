"""The joint estimator is indifferent to everything that should not matter, and says what should be said."""

import dataclasses

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint, fit_once
from inclinometry.calibration.readings import BenchReadings
from inclinometry.rotations import dcm
from inclinometry.sensors import parameter_vector
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool, realistic_tool

BOTH = ("accelerometer", "magnetometer")
PLANS = [plans.twelve(), plans.orthogonal()]


def truth(tool):
    return np.concatenate([parameter_vector(t) for t in tool.triads.values()])


@pytest.fixture(scope="module")
def known(sensor_noise):
    tool = random_tool(3)
    return tool, sensor_noise(tool, 12)


@pytest.fixture(scope="module")
def usual(bench, known):
    """A run of 24 positions with ordinary errors."""
    return bench(plans.orthogonal(), known[0], Rig(setting_sd=np.radians(0.1)), bits=12, seed=5)[0]


def codes(found):
    """Codes of what a calibration says."""
    return [one.code for one in found.findings]


def same(one, other, kinds=BOTH, rtol=1e-7):
    """Equal parameters, as far as the fit's stopping rule goes: 1e-10 standard deviations, variances included."""
    for kind in kinds:
        size = np.abs(one.tool.triads[kind].tensor).max()
        np.testing.assert_allclose(
            parameter_vector(one.tool.triads[kind]), parameter_vector(other.tool.triads[kind]), atol=rtol * size
        )


class TestInvariance:
    def test_order_of_stations(self, usual, known):
        order = np.random.default_rng(1).permutation(24)
        # without what is looked for in the order of the stations: drift and wander
        one, other = (calibrate_joint(run, diagnose=False) for run in (usual, usual.take(order)))
        same(one, other)
        np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-5, atol=1e-9 * one.covariance.max())
        assert other.residuals.station == tuple(str(i + 1) for i in order)
        np.testing.assert_allclose(one.rig.errors[order], other.rig.errors, atol=1e-9)

    @pytest.mark.long
    @pytest.mark.parametrize("angle", [0.7, -2.0, np.pi])
    def test_a_turned_rig_turns_the_fields_and_nothing_else(self, usual, angle):
        one = calibrate_joint(usual)
        other = calibrate_joint(dataclasses.replace(usual, azimuth=usual.azimuth + angle))
        same(one, other)
        np.testing.assert_allclose(one.tool.covariance, other.tool.covariance, rtol=1e-5, atol=1e-8)
        c, s = np.cos(angle), np.sin(angle)
        for kind in BOTH:
            x, y, z = other.field_directions[kind]
            np.testing.assert_allclose(
                one.field_directions[kind], [c * x + s * y, -s * x + c * y, z], atol=1e-9
            )  # the same direction, seen from a rig whose zero lies elsewhere

    def test_a_toolface_zero_turns_the_sensors_about_the_tool_axis(self, usual):
        angle = 0.3
        one, other = (
            calibrate_joint(usual),
            calibrate_joint(dataclasses.replace(usual, toolface=usual.toolface + angle)),
        )
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        for kind in BOTH:
            before, after = one.tool.triads[kind].tensor[0], other.tool.triads[kind].tensor[0]
            np.testing.assert_allclose(after @ turn, before, atol=1e-7 * np.abs(before).max())

    def test_full_turns_of_a_dial_change_nothing(self, usual):
        more = 2 * np.pi * np.random.default_rng(2).integers(-2, 3, (2, 24))
        other = dataclasses.replace(usual, azimuth=usual.azimuth + more[0], toolface=usual.toolface + more[1])
        same(calibrate_joint(usual), calibrate_joint(other))

    def test_gain_and_bias_of_a_channel_touch_its_row_only(self, usual):
        gain, bias = np.array([1.0, -1e-3, 250.0]), np.array([0.0, 5.0, -1e4])
        changed = {**usual.channels, "magnetometer": usual.channels["magnetometer"] * gain + bias}
        noise = {"accelerometer": 0.6, "magnetometer": np.full(3, 0.7)}
        one = calibrate_joint(usual, noise_sd=noise)
        other = calibrate_joint(
            dataclasses.replace(usual, channels=changed),
            noise_sd={**noise, "magnetometer": 0.7 * np.abs(gain)},
            left_handed=True,  # the reversed channel makes it so
        )
        same(one, other, ("accelerometer",))
        before, after = one.tool.triads["magnetometer"], other.tool.triads["magnetometer"]
        np.testing.assert_allclose(after.tensor[0] / gain[:, None], before.tensor[0], atol=1e-7 * 2000)
        np.testing.assert_allclose((after.offset[0] - bias) / gain, before.offset[0], atol=1e-7 * 2000)
        u = np.sqrt(np.diag(other.tool.covariance)).reshape(6, 4)[3:] / np.abs(gain)[:, None]
        np.testing.assert_allclose(u, np.sqrt(np.diag(one.tool.covariance)).reshape(6, 4)[3:], rtol=1e-5)

    def test_order_of_channels_permutes_rows(self, usual):
        order = [2, 0, 1]
        changed = {k: v[:, order] for k, v in usual.channels.items()}
        one, other = calibrate_joint(usual), calibrate_joint(dataclasses.replace(usual, channels=changed))
        for kind in BOTH:
            np.testing.assert_allclose(
                other.tool.triads[kind].tensor[0], one.tool.triads[kind].tensor[0][order], atol=1e-4
            )
            np.testing.assert_allclose(
                other.tool.triads[kind].offset[0], one.tool.triads[kind].offset[0][order], atol=1e-4
            )

    def test_order_of_kinds_in_the_mapping_does_not_matter(self, usual):
        changed = dict(reversed(usual.channels.items()))
        one, other = calibrate_joint(usual), calibrate_joint(dataclasses.replace(usual, channels=changed))
        same(one, other, rtol=0.0)
        assert one.parameter_names == other.parameter_names

    def test_the_same_input_gives_the_same_bits(self, usual):
        one, other = calibrate_joint(usual, robust=True), calibrate_joint(usual, robust=True)
        assert one.covariance.tobytes() == other.covariance.tobytes()
        assert repr(one) == repr(other)


def within_bounds(found, tool, factor=5.0):
    """Every parameter within `factor` of its stated uncertainty of the truth."""
    u = np.sqrt(np.diag(found.tool.covariance))
    off = np.abs(truth(found.tool) - truth(tool)) / u
    assert off.max() < factor, f"parameter off by {off.max():.1f} standard uncertainties"


LAYOUTS = [
    {"accelerometer": 3, "magnetometer": 3, "gyro": 3},
    {"accelerometer": 6, "magnetometer": 3},
    {"accelerometer": 2, "magnetometer": 2},
    {"accelerometer": 3, "magnetometer": 5, "gyro": 2},
    {"accelerometer": 4},
    {"magnetometer": 3},
    {"gyro": 3},
]


@pytest.mark.parametrize("sensors", LAYOUTS, ids=lambda s: "-".join(f"{v}{k[0]}" for k, v in s.items()))
@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
def test_any_number_of_sensors_of_any_kind(bench, sensor_noise, sensors, plan):
    tool = random_tool(11, sensors=sensors)
    readings, true = bench(plan, tool, Rig(setting_sd=np.radians(0.05)), bits=12, seed=4)
    found = fit_once(readings, sensor_noise(tool, 12), np.radians(0.05))
    within_bounds(found, tool)
    for kind in sensors:
        assert found.tool.triads[kind].count == sensors[kind]
        off = np.degrees(np.linalg.norm(found.field_directions[kind] - true.field_directions[kind]))
        assert off < 0.5  # twelve settings of 0.05 deg; the gyro's Earth rate is the least well seen
    assert found.covariance.shape == (len(found.parameter_names),) * 2


def test_redundant_sensors_do_better_than_the_three_of_them(bench, sensor_noise):
    tool = random_tool(12, sensors={"accelerometer": 6, "magnetometer": 3})
    readings, _ = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), bits=12)
    noise = {kind: sd[0] for kind, sd in sensor_noise(tool, 12).items()}
    three = dataclasses.replace(
        readings,
        channels={**readings.channels, "accelerometer": readings.channels["accelerometer"][:, :3]},
        digest="",
        step={},
    )
    six, few = fit_once(readings, noise, 1.75e-3), fit_once(three, noise, 1.75e-3)
    u6 = np.sqrt(np.diag(six.tool.covariance))[:12]
    u3 = np.sqrt(np.diag(few.tool.covariance))[:12]
    assert (u6 < u3).all()  # the other three say how the rig stood


def test_units_strengths_digest_and_name_are_kept(bench):
    tool = realistic_tool(1, bits=None)
    readings, _ = bench(plans.twelve(), tool, Rig())
    found = calibrate_joint(readings, name="SN 7")
    assert {k: t.unit for k, t in found.tool.triads.items()} == {"accelerometer": "m/s^2", "magnetometer": "nT"}
    assert found.tool.triads["accelerometer"].field_strength == readings.reference["g"]
    assert found.tool.triads["magnetometer"].field_strength == readings.reference["b"]
    assert found.inputs == {"readings": readings.digest}
    assert found.tool.name == "SN 7"
    assert found.method == "joint"


def test_repeated_readings_count_with_their_scatter(bench):
    tool = random_tool(2, bits=None)
    readings, _ = bench(plans.orthogonal(), tool, Rig(), repeats=50)
    found = calibrate_joint(readings, rig_sd=0.0)
    within_bounds(found, tool)
    for kind in BOTH:
        # 24 scatters of 50 readings: good to 1 / sqrt(2 * 24 * 49) = 2 %
        np.testing.assert_allclose(found.tool.noise[kind], tool.noise[kind], rtol=0.1)
    # and a converter that says the same fifty times does not count as exact
    scatter = {k: v.copy() for k, v in readings.sd.items()}
    scatter["accelerometer"][3, 1] = 0.0
    within_bounds(calibrate_joint(dataclasses.replace(readings, sd=scatter), rig_sd=0.0), tool)


class TestRigOfUnknownOrientation:
    @pytest.mark.long
    @pytest.mark.parametrize("offset", [0.0, 90.0, 180.0, -135.0])
    @pytest.mark.parametrize("dip", [70.0, 30.0, -60.0])
    def test_tilted_and_turned_with_the_dip_known(self, bench, sensor_noise, offset, dip):
        tool = random_tool(8)
        rig = Rig(
            dip=np.radians(dip),
            base_tilt=np.radians(20.0),
            tilt_axis=0.4,
            north_offset=np.radians(offset),
            setting_sd=np.radians(0.05),
        )
        readings, true = bench(plans.orthogonal(), tool, rig, bits=12)
        found = calibrate_joint(readings, noise_sd=sensor_noise(tool, 12))
        within_bounds(found, tool)
        for kind in BOTH:
            np.testing.assert_allclose(found.field_directions[kind], true.field_directions[kind], atol=np.radians(0.15))
        (said,) = (one for one in found.findings if one.code == "bench-base-tilted")
        assert said.values["tilt_deg"] == pytest.approx(20.0, abs=0.1)

    def test_southern_hemisphere_without_a_dip_says_what_it_took(self, bench):
        tool = random_tool(8)
        readings, _ = bench(plans.orthogonal(), tool, Rig(dip=np.radians(-60.0)), bits=12, reference={})
        found = calibrate_joint(readings)
        assert "bench-sign-assumed" in codes(found)
        # whichever it took, it is the tool or its mirror image
        sign = np.sign(found.field_directions["magnetometer"][0])
        np.testing.assert_allclose(
            sign * found.tool.triads["magnetometer"].tensor, tool.triads["magnetometer"].tensor, atol=5.0
        )

    def test_a_prior_on_the_field_decides_the_sign(self, bench):
        tool = random_tool(8)
        readings, _ = bench(plans.orthogonal(), tool, Rig(dip=np.radians(-60.0)), bits=12, reference={})
        up = [0.5, 0.0, -np.sqrt(0.75)]
        found = calibrate_joint(readings, field_prior={"magnetometer": (up, 0.1)})
        np.testing.assert_allclose(found.field_directions["magnetometer"], up, atol=0.01)
        assert "bench-sign-assumed" not in codes(found)


class TestSwappedChannels:
    def test_accelerometer_and_magnetometer(self, bench, refused):
        readings, _ = bench(plans.orthogonal(), realistic_tool(1), Rig(), bits=12)
        swapped = dict(zip(BOTH, reversed(readings.channels.values()), strict=True))
        with refused("bench-triads-exchanged"):
            calibrate_joint(dataclasses.replace(readings, channels=swapped))

    @pytest.mark.parametrize("dip", [82.0, 84.0])
    def test_accelerometer_and_magnetometer_where_the_field_is_steep(self, bench, dip):
        # a stand that leans by 6 or 8 deg looks so too
        readings, _ = bench(plans.orthogonal(), realistic_tool(1), Rig(dip=np.radians(dip)), bits=12)
        swapped = dict(zip(BOTH, reversed(readings.channels.values()), strict=True))
        found = calibrate_joint(dataclasses.replace(readings, channels=swapped))
        assert "bench-triads-exchanged" in codes(found)

    @pytest.mark.long
    @pytest.mark.parametrize("kind", BOTH)
    def test_x_and_y(self, bench, kind, refused):
        readings, _ = bench(plans.orthogonal(), realistic_tool(1), Rig(), bits=12)
        changed = {**readings.channels, kind: readings.channels[kind][:, [1, 0, 2]]}
        exchanged = dataclasses.replace(readings, channels=changed)
        if kind == "magnetometer":
            # an accelerometer may read specific force and is right-handed then; two reversed dials look like this
            with refused("bench-left-handed"):
                calibrate_joint(exchanged)
        found = calibrate_joint(exchanged, left_handed=True)
        (said,) = (one for one in found.findings if one.code == "bench-axes-exchanged")
        assert said.values == {"kind": kind, "axes": ("y", "x", "z")}
        assert "bench-axes-exchanged" not in codes(calibrate_joint(readings))


class TestNoiseFree:
    @pytest.mark.long
    @pytest.mark.parametrize("plan", [plans.twelve(), plans.orthogonal(), plans.two_face(), plans.half()])
    def test_perfect_readings_give_the_tool_itself(self, bench, plan):
        tool = random_tool(4, bits=None)
        readings, _ = bench(plan, tool, Rig(base_tilt=0.05, tilt_axis=1.0), noise={})
        found = calibrate_joint(readings)
        for kind in BOTH:
            size = np.abs(tool.triads[kind].tensor).max()
            # an iterative fit to data of 1e-16 relative rounding
            np.testing.assert_allclose(found.tool.triads[kind].tensor, tool.triads[kind].tensor, atol=1e-8 * size)
            np.testing.assert_allclose(found.tool.triads[kind].offset, tool.triads[kind].offset, atol=1e-8 * size)
        assert np.isfinite(found.covariance).all()
        assert np.isfinite(found.residuals.leverage).all()
        assert np.degrees(found.rig.sd).max() < 1e-5
        assert not found.outliers


class TestRecord:
    def test_residuals_add_up(self, usual):
        found = calibrate_joint(usual)
        for kind in BOTH:
            predicted = found.tool.triads[kind].signals(
                dcm(usual.azimuth, usual.inclination, usual.toolface) @ found.field_directions[kind]
            )
            # at the dialled settings, to first order in rig errors of 2 mrad: second order is 2e-6 of 2000 counts
            np.testing.assert_allclose(found.residuals.values[kind], usual.channels[kind] - predicted, atol=0.03)
        assert ((found.residuals.leverage > 0) & (found.residuals.leverage < 1)).all()

    def test_leverages_sum_to_the_number_of_parameters(self, bench, known):
        tool, noise = known
        readings, _ = bench(plans.orthogonal(), tool, Rig(), bits=12)
        found = fit_once(readings, noise, 0.0)
        # the trace of a hat matrix counts its parameters: 24 of the tool, 4 tangent angles
        assert 6 * found.residuals.leverage.sum() == pytest.approx(28.0, rel=1e-9)

    def test_standardised_residuals_have_unit_spread(self, bench, known):
        tool, noise = known
        squares = []
        for seed in range(20):
            readings, _ = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), bits=12, seed=seed)
            found = fit_once(readings, noise, np.radians(0.1))
            squares += [np.mean(found.residuals.standardised[k] ** 2) for k in BOTH]
        # 20 runs of 24 * 6 residuals, correlated by 28 parameters and the rig: good to about 3 %
        assert np.sqrt(np.mean(squares)) == pytest.approx(1.0, abs=0.08)

    def test_errors_of_the_rig_are_found_within_their_uncertainty(self, bench, known):
        tool, noise = known
        scores = []
        for seed in range(20):
            readings, true = bench(plans.orthogonal(), tool, Rig(setting_sd=np.radians(0.1)), bits=12, seed=seed)
            found = fit_once(readings, noise, np.radians(0.1))
            scores.append((found.rig.errors - true.setting_errors) ** 2 / found.rig.errors_sd**2)
        # 20 * 72 errors, strongly correlated within a run: about 20 * 20 independent, 3.5 % on the root
        assert np.sqrt(np.mean(scores)) == pytest.approx(1.0, abs=0.12)

    def test_repr_names_what_matters(self, usual):
        text = repr(calibrate_joint(usual, name="SN 7"))
        for word in ("SN 7", "method joint", "24 stations", "accelerometer 1 (counts)", "below the rig's horizon", "±"):
            assert word in text

    def test_result_is_frozen(self, usual):
        found = calibrate_joint(usual)
        with pytest.raises(dataclasses.FrozenInstanceError):
            found.method = "other"


class TestStandardisedResiduals:
    @pytest.mark.long
    def test_honest_runs_of_the_shortest_plan(self, bench):
        """Twelve positions leave single residuals 1e-6 of their reading's variance; they once stood at -207 sigma."""
        for seed in range(1, 16):
            readings, _ = bench(plans.twelve(), random_tool(seed), Rig(setting_sd=np.radians(0.1)), bits=12, seed=seed)
            found = calibrate_joint(readings, diagnose=False)
            values = np.concatenate([v.ravel() for v in found.residuals.standardised.values()])
            judged = values[np.isfinite(values)]
            # 72 residuals, 28 parameters, variances estimated: the rms scatters by about 1 / sqrt(2 x 44) = 0.11; of
            # 15 x 72 normal residuals one in 2000 such sets has one beyond 5
            assert 0.5 < np.sqrt(np.mean(judged**2)) < 1.6
            assert np.abs(judged).max() < 5.0

    def test_a_reading_that_the_fit_follows_is_not_judged(self):
        """Only one station leans: it alone tells the sensors' parts along the tool, whatever it reads."""
        toolface = np.radians(np.arange(0.0, 360.0, 30.0))
        inclination = np.where(np.arange(12) == 4, np.radians(40.0), np.pi / 2)
        skewed = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.5, 0.6]])
        signals = 1000.0 * dcm(np.zeros(12), inclination, toolface) @ [0.0, 0.0, 1.0] @ skewed.T
        signals += np.random.default_rng(1).normal(0.0, 0.5, signals.shape)
        readings = BenchReadings({"accelerometer": signals}, np.zeros(12), inclination, toolface)
        found = calibrate_joint(readings, noise_sd={"accelerometer": 0.5}, rig_sd=0.0, diagnose=False)
        values = found.residuals.standardised["accelerometer"]
        assert np.isnan(values[4]).all()
        rest = np.delete(values, 4, axis=0)
        assert np.isfinite(rest).all()
        # 33 residuals with 11 degrees of freedom a sensor: good to 1 / sqrt(2 x 24)
        assert np.sqrt(np.mean(rest**2)) == pytest.approx(1.0, abs=0.45)

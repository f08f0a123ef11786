"""The Earth rate as the second field of a survey: true north, the latitude check, signs that cannot be told apart."""

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.constants import EARTH_RATE
from inclinometry.earth.site import Site
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.hole import simulate_survey
from inclinometry.simulate.tool import realistic_tool
from inclinometry.survey.flags import FLAGS
from inclinometry.survey.reduce import reduce_survey
from inclinometry.uncertainty import UNKNOWN

LATITUDE, DECLINATION, DIP = np.radians(50.0), np.radians(7.0), np.radians(65.0)
KINDS = {"accelerometer": 3, "magnetometer": 3, "gyro": 3}
FOG = 2e-3 * EARTH_RATE
NOISE = {"accelerometer": 1e-3, "magnetometer": 20.0, "gyro": FOG}
HERE = Site(latitude=LATITUDE)


def tool_of(seed=2, kinds=("accelerometer", "gyro"), degree=0):
    sensors = {kind: KINDS[kind] for kind in kinds}
    noise = {kind: NOISE[kind] for kind in kinds}
    return realistic_tool(seed, sensors=sensors, bits=None, noise=noise, temperature_degree=degree)


def path_of(count=40, seed=1):
    random = np.random.default_rng(seed)
    inclination = np.radians(random.uniform(5.0, 175.0, count))
    azimuth, toolface = random.uniform(0.0, 2 * np.pi, (2, count))
    return 10.0 * np.arange(count), inclination, azimuth, toolface


def surveyed(tool, path=None, *, seed=3, **more):
    """Azimuths of the truth count from magnetic north, which lies DECLINATION east of true."""
    fields = {"dip": DIP, "latitude": LATITUDE, "declination": DECLINATION}
    return simulate_survey(tool, *(path_of() if path is None else path), **{**fields, **more}, seed=seed)


class TestNorth:
    def test_a_perfect_gyro_gives_true_azimuth(self):
        tool = tool_of()
        true = surveyed(tool, noise={})
        found = reduce_survey(true.md, true.signals, tool, site=HERE)
        assert found.azimuth_reference == "true"
        # rounding grows by 1/sin(inclination), up to 11
        close = {"rtol": 0.0, "atol": np.radians(1e-9)}
        np.testing.assert_allclose(wrap_signed(found.azimuth - true.azimuth - DECLINATION), 0.0, **close)
        np.testing.assert_allclose(found.inclination, true.inclination, **close)
        np.testing.assert_allclose(wrap_signed(found.toolface - true.toolface), 0.0, **close)
        turned = found.azimuth + found.toolface - found.magnetic_toolface
        np.testing.assert_allclose(wrap_signed(turned), 0.0, **close)
        np.testing.assert_allclose(found.latitude, LATITUDE, **close)
        np.testing.assert_allclose(found.rate_total, EARTH_RATE, rtol=1e-12)
        assert np.isnan(found.b_total).all()
        assert np.isnan(found.dip).all()
        assert not any(found.flags)

    @pytest.mark.parametrize("north", ["magnetic", "true"])
    def test_it_is_never_turned_to_magnetic_north(self, north):
        tool = tool_of()
        true = surveyed(tool, noise={})
        plain = reduce_survey(true.md, true.signals, tool)
        # and a declination is neither asked for nor used
        for site in (Site(north_reference=north), Site(north_reference=north, declination=0.3, declination_sigma=0.1)):
            found = reduce_survey(true.md, true.signals, tool, site=site)
            assert found.azimuth_reference == plain.azimuth_reference == "true"
            np.testing.assert_array_equal(found.azimuth, plain.azimuth)
            assert set(found.components) == {"calibration", "sensor noise"}
            assert found.findings == ()

    def test_grid_takes_the_convergence_alone(self):
        tool = tool_of()
        true = surveyed(tool, noise={})
        plain = reduce_survey(true.md, true.signals, tool)
        site = Site(north_reference="grid", convergence=0.03, convergence_sigma=0.001)
        found = reduce_survey(true.md, true.signals, tool, site=site)
        assert found.azimuth_reference == "grid"
        np.testing.assert_allclose(wrap_signed(found.azimuth - plain.azimuth), -0.03, atol=1e-12)
        assert set(found.components) == {"calibration", "sensor noise", "convergence"}
        with refused("earth-site-lacks"):
            reduce_survey(true.md, true.signals, tool, site=Site(north_reference="grid"))

    def test_its_uncertainty_is_honest(self):
        tool = tool_of()
        true = surveyed(tool, path_of(3000, 4))
        found = reduce_survey(true.md, true.signals, tool)
        error = wrap_signed(found.azimuth - true.azimuth - DECLINATION) / found.u_azimuth
        # a mean of 3000 squares scatters by sqrt(2 / 3000) = 0.026
        assert np.mean(error**2) == pytest.approx(1.0, abs=0.11)

    def test_the_uncertainty_of_the_calibration_counts(self):
        plain = tool_of()
        size = len(plain.parameter_names)
        tool = Tool("x", plain.triads, 1e-6 * EARTH_RATE**2 * np.eye(size), plain.noise)
        true = surveyed(tool)
        found = reduce_survey(true.md, true.signals, tool)
        assert (found.components["calibration"][:, 1] > 0.0).all()
        # a vertical tool knows its gyro toolface and nothing else of its north
        down = surveyed(tool, ([0.0], [0.0], [1.0], [0.5]))
        hung = reduce_survey(down.md, down.signals, tool)
        assert hung.u("magnetic_toolface")[0] < 0.1
        assert hung.u_azimuth[0] <= UNKNOWN

    def test_temperature(self):
        tool = tool_of(degree=2)
        heat = np.linspace(20.0, 120.0, 40)
        true = surveyed(tool, noise={}, temperature=heat)
        found = reduce_survey(true.md, true.signals, tool, temperature=heat)
        np.testing.assert_allclose(wrap_signed(found.azimuth - true.azimuth - DECLINATION), 0.0, atol=1e-10)


class TestBoth:
    TOOL = tool_of(kinds=KINDS)

    def test_the_magnetometer_stays_the_azimuth(self):
        true = surveyed(self.TOOL, noise={})
        found = reduce_survey(true.md, true.signals, self.TOOL)
        assert found.azimuth_reference == "magnetic"
        np.testing.assert_allclose(wrap_signed(found.azimuth - true.azimuth), 0.0, atol=1e-11)
        np.testing.assert_allclose(found.latitude, LATITUDE, atol=1e-11)
        same = reduce_survey(true.md, true.signals, self.TOOL, second="magnetometer")
        np.testing.assert_array_equal(same.azimuth, found.azimuth)

    def test_unless_the_gyro_is_asked_for(self):
        true = surveyed(self.TOOL)
        found = reduce_survey(true.md, true.signals, self.TOOL, second="gyro")
        assert found.azimuth_reference == "true"
        error = wrap_signed(found.azimuth - true.azimuth - DECLINATION) / found.u_azimuth
        assert np.mean(error**2) == pytest.approx(1.0, abs=1.0)  # 40 squares scatter by 0.22
        np.testing.assert_allclose(found.dip, DIP, atol=0.01)
        alone = {k: v for k, v in true.signals.items() if k != "magnetometer"}
        np.testing.assert_allclose(reduce_survey(true.md, alone, self.TOOL).azimuth, found.azimuth, atol=1e-13)

    def test_a_triad_that_is_not_there(self):
        true = surveyed(tool_of())
        with refused("input-triads"):
            reduce_survey(true.md, true.signals, tool_of(), second="magnetometer")
        with refused("input-choice", name="second"):
            reduce_survey(true.md, true.signals, tool_of(), second="accelerometer")

    def test_two_gyros(self):
        plain = self.TOOL.triads
        cut = Triad("gyro", plain["gyro"].tensor[0][:2], plain["gyro"].offset[0][:2], field_strength=EARTH_RATE)
        tool = Tool("x", {**plain, "gyro": cut})
        true = surveyed(tool, noise={})
        found = reduce_survey(true.md, true.signals, tool)
        assert found.azimuth_reference == "magnetic"
        assert "survey-gyro-unused" in coded(found.findings)
        assert np.isnan(found.latitude).all()
        with refused("survey-components"):
            reduce_survey(true.md, true.signals, tool, second="gyro")


class TestFlags:
    def flags(self, change=None, site=HERE, tool=None, **fields):
        tool = tool_of() if tool is None else tool
        true = surveyed(tool, **fields)
        channels = dict(true.signals) if change is None else change(dict(true.signals))
        found = reduce_survey(true.md, channels, tool, site=site)
        assert set().union(*found.flags) <= set(FLAGS)
        return found

    def test_a_good_survey_has_next_to_none(self):
        tool = tool_of()
        true = surveyed(tool, path_of(3000, 5))
        found = reduce_survey(true.md, true.signals, tool, site=HERE)
        for name in ("latitude", "rate"):
            assert np.mean([name in row for row in found.flags]) < 0.006  # 0.27 % of a normal beyond three sigma

    def test_another_latitude(self):
        found = self.flags(site=Site(latitude=LATITUDE + np.radians(3.0)))
        assert all("latitude" in row for row in found.flags)
        assert "survey-sign" not in coded(found.findings)
        assert not any("latitude" in row for row in self.flags(site=None).flags)

    def test_another_rate(self):
        def stronger(channels):
            channels["gyro"] = channels["gyro"].copy()
            channels["gyro"][7] += 0.1 * EARTH_RATE
            return channels

        found = self.flags(stronger)
        assert "rate" in found.flags[7]
        assert sum("rate" in row for row in found.flags) <= 2

    def test_a_calibration_that_does_not_state_the_earth_rate_knows_it_all_the_same(self):
        plain = tool_of()
        gyro = plain.triads["gyro"]
        nameless = Triad("gyro", gyro.tensor, gyro.offset, gyro.unit)
        tool = Tool("x", {**plain.triads, "gyro": nameless}, noise=plain.noise)
        true = surveyed(plain)
        found = reduce_survey(true.md, true.signals, tool, site=HERE)
        np.testing.assert_array_equal(found.rate_total, reduce_survey(true.md, true.signals, plain).rate_total)
        # while a gyro whose scale has changed shows it
        worn = Tool("x", {**plain.triads, "gyro": Triad("gyro", 1.05 * gyro.tensor, gyro.offset)}, noise=plain.noise)
        assert sum("rate" in row for row in reduce_survey(true.md, true.signals, worn).flags) > 35

    @pytest.mark.parametrize("wrong", ["site", "gyro", "accelerometer"])
    def test_three_signs_that_cannot_be_told_apart(self, wrong):
        def reverse(channels):
            return channels if wrong == "site" else {**channels, wrong: -channels[wrong]}

        plain = tool_of()
        # without offsets a reversed signal is a reversed field
        triads = {k: Triad(k, t.tensor, 0.0 * t.offset, t.unit, t.field_strength) for k, t in plain.triads.items()}
        site = Site(latitude=-LATITUDE) if wrong == "site" else HERE
        found = self.flags(reverse, site, Tool("x", triads, noise=plain.noise))
        assert coded(found.findings).count("survey-sign") == 1
        assert all("latitude" in row for row in found.flags)

    def test_near_the_equator_a_sign_says_nothing(self):
        found = self.flags(site=Site(latitude=np.radians(-5.0)), latitude=np.radians(5.0))
        assert "survey-sign" not in coded(found.findings)


class TestGravity:
    def test_the_g_sensitivity_is_taken_off(self):
        plain = tool_of()
        sensitivity = 0.05 * EARTH_RATE * np.random.default_rng(1).normal(size=(3, 3))
        gyro = plain.triads["gyro"]
        aware = Triad("gyro", gyro.tensor, gyro.offset, gyro.unit, gyro.field_strength, g_sensitivity=sensitivity)
        tool = Tool("x", {**plain.triads, "gyro": aware}, noise=plain.noise)
        true = surveyed(plain, noise={})
        down = dcm(true.azimuth, true.inclination, true.toolface)[..., 2]
        channels = {**true.signals, "gyro": true.signals["gyro"] + down @ sensitivity.T}
        found = reduce_survey(true.md, channels, tool, site=HERE)
        np.testing.assert_allclose(wrap_signed(found.azimuth - true.azimuth - DECLINATION), 0.0, atol=1e-11)
        unaware = reduce_survey(true.md, channels, plain, site=HERE)
        assert np.degrees(np.abs(wrap_signed(unaware.azimuth - true.azimuth - DECLINATION))).max() > 1.0

"""From raw channels to stations: exact, honest, and remarkable stations flagged."""

import tracemalloc

import numpy as np
import pytest
from scipy.stats import chi2
from tests.refusals import coded, refused

from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.orientation import fields
from inclinometry.rotations import wrap_positive, wrap_signed
from inclinometry.sensors import Tool, Triad, parameter_vector, triad_from_vector
from inclinometry.simulate.hole import WellProfile, simulate_survey, well_path
from inclinometry.simulate.tool import random_tool, realistic_tool
from inclinometry.survey.flags import FLAGS
from inclinometry.survey.reduce import reduce_survey
from inclinometry.uncertainty import UNKNOWN

BOTH = ("accelerometer", "magnetometer")
DIP = np.radians(65.0)


def attitudes(count, seed=1, low=1.0, high=179.0):
    random = np.random.default_rng(seed)
    inclination = np.radians(random.uniform(low, high, count))
    azimuth, toolface = random.uniform(0.0, 2 * np.pi, (2, count))
    return 10.0 * np.arange(count), inclination, azimuth, toolface


def surveyed(tool, path, **more):
    return simulate_survey(tool, *path, dip=DIP, seed=3, **more)


def uncertain(tool, size=0.3, seed=1):
    """The tool with a full, correlated covariance of about `size` signal units in every parameter."""
    count = len(tool.parameter_names)
    root = np.random.default_rng(seed).normal(size=(count, count)) * size / np.sqrt(count)
    return Tool(tool.name, tool.triads, root @ root.T, tool.noise, tool.temperature_range)


@pytest.mark.parametrize("make", [random_tool, realistic_tool])
@pytest.mark.parametrize("sensors", [{"accelerometer": 3, "magnetometer": 3}, {"accelerometer": 6, "magnetometer": 4}])
def test_a_perfect_tool_returns_the_path(make, sensors):
    tool = make(1, sensors=sensors)
    path = attitudes(500)
    true = surveyed(tool, path, noise={})
    found = reduce_survey(true.md, true.signals, tool)
    close = {"rtol": 0.0, "atol": np.radians(1e-9)}
    np.testing.assert_allclose(found.inclination, true.inclination, **close)
    # rounding of signals grows by 1/sin(inclination), here by 57
    for name in ("azimuth", "toolface", "magnetic_toolface"):
        np.testing.assert_allclose(wrap_signed(getattr(found, name) - getattr(true, name)), 0.0, **close)
    np.testing.assert_allclose(found.dip, DIP, **close)
    np.testing.assert_allclose(found.g_total, STANDARD_GRAVITY, rtol=1e-12)
    np.testing.assert_allclose(found.b_total, 50000.0, rtol=1e-12)
    assert found.azimuth_reference == "magnetic"
    assert (found.u_inclination >= 0.0).all()
    assert len(found) == 500


def test_a_well_from_top_to_bottom():
    tool = realistic_tool(2)
    path = well_path(WellProfile(), seed=1)
    true = simulate_survey(tool, *path, dip=DIP, seed=1, bits=12)
    found = reduce_survey(true.md, true.signals, uncertain(tool, 0.1), calibration_dip=DIP)
    error = np.abs(wrap_signed(found.azimuth - true.azimuth)) / found.u_azimuth
    assert (np.abs(found.inclination - true.inclination) < 5 * found.u_inclination).all()
    assert (error < 5).all()
    text = repr(found)
    assert f"Survey: {len(path.md)} stations, azimuth from magnetic north, deg" in text
    assert len(text.splitlines()) <= 13


class TestUncertainty:
    @pytest.mark.parametrize("degree", [0, 1])
    def test_tools_drawn_from_the_covariance(self, degree):
        count = 600
        nominal = uncertain(random_tool(2, temperature_degree=degree), 0.3)
        md, inclination, azimuth, toolface = attitudes(count, 4, 10.0, 170.0)
        heat = np.random.default_rng(5).uniform(15.0, 25.0, count)
        random = np.random.default_rng(6)
        draws = random.multivariate_normal(np.zeros(len(nominal.covariance)), nominal.covariance, count, method="svd")
        path = simulate_survey(nominal, md, inclination, azimuth, toolface, dip=DIP, noise={}, temperature=heat, seed=1)
        channels = {k: np.empty_like(v) for k, v in path.signals.items()}
        for row, draw in enumerate(draws):
            for kind, triad in nominal.triads.items():
                mine = triad_from_vector(triad, parameter_vector(triad) + draw[nominal.slices[kind]])
                seen = triad.field(path.signals[kind][row], heat[row])
                noise = nominal.noise[kind] * random.normal(size=3)
                channels[kind][row] = mine.signals(seen, heat[row]) + noise
        found = reduce_survey(md, channels, nominal, temperature=heat)
        low, high = chi2.ppf([1e-4, 1 - 1e-4], count)
        for name in ("inclination", "azimuth", "toolface", "magnetic_toolface"):
            error = wrap_signed(getattr(found, name) - getattr(path, name))
            assert low < np.sum((error / found.u(name)) ** 2) < high, name

    def test_components_keep_their_names_and_add_up(self):
        tool = uncertain(random_tool(2))
        true = surveyed(tool, attitudes(20))
        found = reduce_survey(true.md, true.signals, tool)
        assert set(found.components) == {"calibration", "sensor noise"}
        for column, name in enumerate(("inclination", "azimuth", "toolface", "magnetic_toolface")):
            total = sum(part[:, column] for part in found.components.values())
            np.testing.assert_allclose(found.u(name), np.sqrt(total))

    def test_nothing_known_wrong_means_nothing_uncertain(self):
        exact = random_tool(2)
        tool = Tool("exact", exact.triads)
        true = surveyed(tool, attitudes(20))
        found = reduce_survey(true.md, true.signals, tool)
        assert (found.u_azimuth == 0.0).all()
        assert (found.u_inclination == 0.0).all()

    def test_towards_the_vertical_it_grows_as_one_over_the_sine_up_to_that_of_a_circle(self):
        tool = uncertain(realistic_tool(2))
        inclination = np.radians([1e-7, 1e-3, 1.0, 2.0])
        md, zero = np.arange(4.0), np.zeros(4)
        true = surveyed(tool, (md, inclination, zero + 1.0, zero + 2.0), noise={})
        found = reduce_survey(md, true.signals, tool)
        assert found.u_azimuth[0] == found.u_toolface[0] == UNKNOWN
        assert found.u_azimuth[2] / found.u_azimuth[3] == pytest.approx(2.0, rel=0.05)
        assert np.isfinite(found.u("magnetic_toolface")).all()
        np.testing.assert_allclose(found.u("magnetic_toolface"), found.u("magnetic_toolface")[3], rtol=0.2)
        assert ["vertical" in row for row in found.flags] == [True, True, False, False]

    def test_exactly_vertical(self):
        tool = uncertain(realistic_tool(2))
        perfect = Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in BOTH}, 1e-6 * np.eye(24))
        north = np.array([[np.cos(DIP), 0.0, np.sin(DIP)]])
        found = reduce_survey([0.0], {"accelerometer": [[0.0, 0.0, 1.0]], "magnetometer": north}, perfect)
        assert found.inclination[0] == 0.0
        assert found.u_azimuth[0] == found.u_toolface[0] == UNKNOWN
        assert 0.0 < found.u_inclination[0] < 0.01
        assert 0.0 < found.u("magnetic_toolface")[0] < 0.01
        assert list(found.flags[0]) == ["vertical"]
        assert [(one.values["flag"], one.severity) for one in found.findings] == [("vertical", "note")]
        assert tool.noise["accelerometer"].shape == (3,)


class TestNorth:
    PATH = attitudes(30, 7)

    def run(self, **site):
        tool = uncertain(random_tool(2))
        true = surveyed(tool, self.PATH, noise={})
        return true, reduce_survey(true.md, true.signals, tool, site=Site(**site))

    @pytest.mark.parametrize(
        ("north", "turn_deg", "sigma"), [("true", 5.0, 0.004), ("grid", 3.0, 0.005), ("magnetic", 0.0, 0.0)]
    )
    def test_the_declination_is_applied_once_and_only_where_asked(self, north, turn_deg, sigma):
        """True is magnetic plus declination, grid is true minus convergence; each brings its own uncertainty."""
        turns = {"declination": np.radians(5.0), "convergence": np.radians(2.0)}
        true, found = self.run(north_reference=north, **turns, declination_sigma=0.004, convergence_sigma=0.003)
        _, plain = self.run()
        np.testing.assert_allclose(wrap_signed(found.azimuth - true.azimuth), np.radians(turn_deg), atol=1e-10)
        assert found.azimuth_reference == north
        np.testing.assert_array_equal(found.azimuth, wrap_positive(found.azimuth))
        np.testing.assert_allclose(found.u_azimuth, np.minimum(np.hypot(plain.u_azimuth, sigma), UNKNOWN))

    def test_its_uncertainty_is_a_component_of_azimuth_alone(self):
        _, found = self.run(north_reference="true", declination=0.1, declination_sigma=0.004)
        _, plain = self.run()
        np.testing.assert_allclose(found.components["declination"][:, 1], 0.004**2)
        assert (found.components["declination"][:, [0, 2, 3]] == 0.0).all()
        np.testing.assert_array_equal(found.u_inclination, plain.u_inclination)

    def test_a_declination_without_sigma_is_said(self):
        _, found = self.run(north_reference="true", declination=0.1)
        assert "survey-declination-sd" in coded(found.findings)

    @pytest.mark.parametrize("site", [{"north_reference": "true"}, {"north_reference": "grid", "declination": 0.1}])
    def test_a_north_that_cannot_be_reached_is_an_error(self, site):
        with refused("earth-site-lacks"):
            self.run(**site)


class TestFlags:
    def flags(self, change=None, site=None, temperature=None, tool=None, calibration_dip=None, **field):
        tool = uncertain(realistic_tool(2), 0.05) if tool is None else tool
        true = surveyed(tool, attitudes(20, 8, 20.0, 160.0), **field)
        channels = dict(true.signals)
        if change is not None:
            channels = change(channels)
        found = reduce_survey(
            true.md, channels, tool, site=site, temperature=temperature, calibration_dip=calibration_dip
        )
        names = {name for row in found.flags for name in row}
        assert {one.values["flag"] for one in found.findings if one.code == "survey-flagged"} == names
        assert names <= set(FLAGS)
        return names, found

    HERE = Site(g=STANDARD_GRAVITY, g_sigma=0.001, b=50000.0, b_sigma=100.0, dip=DIP, dip_sigma=np.radians(0.2))

    @pytest.mark.parametrize(
        ("given", "flags"),
        [
            ({"site": HERE}, set()),
            ({"calibration_dip": DIP}, set()),
            ({}, set()),
            ({"site": HERE, "g": 1.003 * STANDARD_GRAVITY}, {"g"}),
            ({"g": 1.02 * STANDARD_GRAVITY}, {"g"}),  # no place on Earth differs so much from another
            ({"site": HERE, "b": 51000.0}, {"b"}),
            ({"b": 51000.0}, set()),  # without a reference it may be so
            ({"site": Site(dip=DIP + np.radians(2.0), dip_sigma=np.radians(0.2))}, {"dip"}),
            ({"calibration_dip": DIP + np.radians(15.0)}, {"dip"}),
        ],
    )
    def test_what_is_flagged(self, given, flags):
        assert self.flags(**given)[0] == flags

    @pytest.mark.parametrize("given", ["site", "stand"])
    def test_swapped_magnetometer_columns_are_caught_by_the_dip(self, given):
        def swap(channels):
            return {**channels, "magnetometer": channels["magnetometer"][:, [1, 0, 2]]}

        where = {"site": self.HERE} if given == "site" else {"calibration_dip": DIP}
        names, found = self.flags(swap, **where)
        assert "dip" in names
        assert sum("dip" in row for row in found.flags) > len(found) / 2

    def test_one_disturbed_station(self):
        def disturb(channels):
            b = channels["magnetometer"].copy()
            b[7] *= 1.1
            return {**channels, "magnetometer": b}

        _, found = self.flags(disturb, site=self.HERE)
        assert [k for k, row in enumerate(found.flags) if row] == [7]

    def test_temperature(self):
        plain = realistic_tool(2)
        tool = Tool("x", plain.triads, noise=plain.noise, temperature_range=(20.0, 80.0))
        heat = np.linspace(0.0, 100.0, 20)
        _, found = self.flags(tool=tool, temperature=heat)
        # five degrees beyond the soaks are still the calibration's
        assert [("temperature" in row) for row in found.flags] == list((heat < 15.0) | (heat > 85.0))
        _, unknown = self.flags(temperature=heat)  # a tool that does not say over which range it was calibrated
        assert not any("temperature" in row for row in unknown.flags)

    def test_false_flags_are_as_rare_as_three_sigma(self):
        tool = uncertain(realistic_tool(3), 0.02)
        true = simulate_survey(tool, *attitudes(3000, 9, 20.0, 160.0), dip=DIP, seed=4)
        exact = Site(g=STANDARD_GRAVITY, g_sigma=0.0, b=50000.0, b_sigma=0.0, dip=DIP, dip_sigma=0.0)
        found = reduce_survey(true.md, true.signals, tool, site=exact)
        for name in ("g", "b", "dip"):
            # noise alone, the calibration being exact here and taken as uncertain: fewer than the 0.27 % of a normal
            assert np.mean([name in row for row in found.flags]) < 0.0060


class TestTriads:
    def test_accelerometer_alone(self):
        tool = uncertain(random_tool(2, sensors={"accelerometer": 3}))
        true = surveyed(tool, attitudes(10), noise={})
        found = reduce_survey(true.md, true.signals, tool)
        np.testing.assert_allclose(found.inclination, true.inclination, atol=1e-11)
        np.testing.assert_allclose(wrap_signed(found.toolface - true.toolface), 0.0, atol=1e-11)
        assert np.isnan(found.azimuth).all()
        assert np.isnan(found.dip).all()
        assert np.isnan(found.b_total).all()
        assert (found.u_azimuth == UNKNOWN).all()
        assert (found.u_toolface < 0.2).all()
        assert all("no-azimuth" in row for row in found.flags)
        # and a site that wants true azimuths has none to turn
        there = reduce_survey(true.md, true.signals, tool, site=Site(north_reference="true", declination=0.1))
        np.testing.assert_array_equal(there.inclination, found.inclination)
        assert np.isnan(there.azimuth).all()

    def test_the_readings_may_lack_the_magnetometer_of_the_tool(self):
        tool = uncertain(random_tool(2))
        true = surveyed(tool, attitudes(10), noise={})
        found = reduce_survey(true.md, {"accelerometer": true.signals["accelerometer"]}, tool)
        assert all("no-azimuth" in row for row in found.flags)
        whole = reduce_survey(true.md, true.signals, tool)
        np.testing.assert_allclose(found.u_inclination, whole.u_inclination, rtol=1e-9)

    def test_without_strengths_totals_are_unknown(self):
        triads = {k: Triad(k, np.eye(3), np.zeros(3)) for k in BOTH}
        found = reduce_survey(
            [0.0], {"accelerometer": [[-0.5, 0, 0.8]], "magnetometer": [[0.4, 0, 0.7]]}, Tool("1", triads)
        )
        assert np.isnan(found.g_total).all()
        assert np.isnan(found.b_total).all()

    def test_temperature_is_used(self):
        tool = random_tool(2, temperature_degree=2)
        heat = np.linspace(20.0, 150.0, 15)
        true = surveyed(tool, attitudes(15), noise={}, temperature=heat)
        found = reduce_survey(true.md, true.signals, tool, temperature=heat)
        np.testing.assert_allclose(wrap_signed(found.azimuth - true.azimuth), 0.0, atol=1e-10)


@pytest.mark.long
def test_two_hundred_thousand_stations_in_little_memory():
    count = 200_000
    tool = uncertain(random_tool(2))
    true = simulate_survey(tool, *attitudes(count, 3), dip=DIP, seed=1)
    tracemalloc.start()
    found = reduce_survey(true.md, true.signals, tool, calibration_dip=DIP)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # all sensitivities at once would be 4 * 24 numbers a station, 154 MB, and the products twice that
    assert peak < 300e6
    # blocks leave no seams
    rows = [0, 19_999, 20_000, 20_001, count - 1]
    few = reduce_survey(true.md[rows], {k: v[rows] for k, v in true.signals.items()}, tool)
    np.testing.assert_allclose(found.u_azimuth[rows], few.u_azimuth, rtol=1e-12)
    np.testing.assert_allclose(found.azimuth[rows], few.azimuth, rtol=1e-12)


ROWS = {k: np.ones((3, 3)) * [100.0, 500.0, 900.0] + 50.0 * np.eye(3) for k in BOTH}
WARM = random_tool(2, temperature_degree=1)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"md": [0.0, 10.0, 10.0]}, "input-order"),
        ({"md": [0.0, 20.0, 10.0]}, "input-order"),
        ({"md": [0.0, np.nan, 2.0]}, "input-finite"),
        ({"md": [0.0, 1.0]}, "input-shape"),
        ({"md": 3.0}, "input-shape"),
        ({"md": "deep"}, "input-kind"),
        ({"md": []}, "input-empty"),
        ({"accelerometer": None}, "input-triads"),
        ({"gyro": np.ones((3, 3))}, "input-uncalibrated"),
        ({"magnetometer": np.ones((3, 4))}, "input-channels"),
        ({"magnetometer": np.ones((2, 3))}, "input-shape"),
        ({"magnetometer": np.full((3, 3), np.nan)}, "input-finite"),
        ({"magnetometer": [["a"] * 3] * 3}, "input-kind"),
        (
            {"tool": random_tool(2, sensors={"accelerometer": 3, "magnetometer": 2}), "magnetometer": np.ones((3, 2))},
            "survey-components",
        ),
        ({"tool": WARM}, "input-temperature"),
        ({"temperature": [20.0]}, "input-shape"),
        ({"temperature": [20.0, np.nan, 20.0]}, "input-finite"),
        ({"tool": Tool("1", {k: Triad(k, np.eye(3), np.zeros(3)) for k in BOTH})}, "sensor-fields-parallel"),
        ({"calibration_dip": 70.0}, "input-value"),  # in degrees
    ],
)
def test_what_is_no_run(change, code):
    given = {"md": [0.0, 1.0, 2.0], "tool": random_tool(2), **ROWS, **change}
    md, tool = given.pop("md"), given.pop("tool")
    channels = {k: given.pop(k) for k in (*BOTH, "gyro") if k in given}
    with refused(code):
        reduce_survey(md, {k: v for k, v in channels.items() if v is not None}, tool, **given)


class TestTwoAccelerometers:
    """The third component of gravity from its known strength, its sign from the way the hole goes."""

    @pytest.mark.parametrize(("hole", "turn"), [("down", 0.0), ("up", np.pi)])
    def test_angles_and_uncertainties(self, hole, turn):
        noise = {"accelerometer": 0.003, "magnetometer": 20.0}
        tool = realistic_tool(2, sensors={"accelerometer": 2, "magnetometer": 3}, bits=None, noise=noise)
        random = np.random.default_rng(1)
        count = 400
        inclination = np.abs(turn - random.uniform(0.05, 1.3, count))
        azimuth, toolface = random.uniform(0.0, 6.28, (2, count))
        g, b = fields(azimuth, inclination, toolface, np.radians(70.0))
        channels = {
            kind: tool.triads[kind].signals(field)
            + tool.noise[kind] * random.normal(size=(count, len(tool.noise[kind])))
            for kind, field in (("accelerometer", g), ("magnetometer", b))
        }
        found = reduce_survey(np.arange(count), channels, tool, hole=hole, gravity_sd=0.0)
        for name, true in (("inclination", inclination), ("azimuth", azimuth), ("toolface", toolface)):
            score = wrap_signed(getattr(found, name) - true) / found.u(name)
            # 400 of them: their rms is good to 1/sqrt(800) = 3.5 %
            assert np.sqrt(np.mean(score**2)) == pytest.approx(1.0, abs=0.12), name
        assert found.findings[0].values["hole"] == hole

    def test_the_strength_of_gravity_here_is_used(self):
        tool = realistic_tool(2, sensors={"accelerometer": 2}, bits=None)
        g, _ = fields(0.5, np.radians(60.0), 0.3, 0.0)
        stand = tool.triads["accelerometer"].field_strength
        here = 1.002 * stand
        signals = {"accelerometer": tool.triads["accelerometer"].signals(1.002 * g)[None]}
        right = reduce_survey([0.0], signals, tool, site=Site(g=here))
        assert np.degrees(right.inclination) == pytest.approx(60.0, abs=1e-9)
        # tan(60 deg) of two per mille, to the second order
        wrong = reduce_survey([0.0], signals, tool)
        assert np.degrees(wrong.inclination - right.inclination) == pytest.approx(0.2, abs=0.01)
        assert [one.severity for one in wrong.findings if one.code == "survey-two-accelerometers"] == ["warning"]

    def test_gravity_in_their_plane_is_flagged(self):
        tool = realistic_tool(2, sensors={"accelerometer": 2}, bits=None)
        g, _ = fields(0.5, np.radians([40.0, 90.0]), 0.3, 0.0)
        found = reduce_survey([0.0, 1.0], {"accelerometer": tool.triads["accelerometer"].signals(g)}, tool)
        # at 90 deg all that is seen of it is the misalignment of a degree or two, whose root drowns in 0.3 mg
        assert "g-in-plane" in found.flags[1]
        assert "g-in-plane" not in found.flags[0]
        assert "no-azimuth" in found.flags[0]

    def test_along_the_axis_the_hole_tells_no_sign(self):
        tool = Tool("1", {"accelerometer": Triad("accelerometer", [[1.0, 0, 0], [0, 0, 1.0]], [0.0, 0.0])})
        with refused("survey-accelerometers-along"):
            reduce_survey([0.0], {"accelerometer": [[0.5, 0.5]]}, tool)

    def test_one_accelerometer_gives_no_inclination(self):
        tool = Tool("1", {"accelerometer": Triad("accelerometer", [[1.0, 0, 0]], [0.0])})
        with refused("survey-components"):
            reduce_survey([0.0], {"accelerometer": [[0.5]]}, tool)

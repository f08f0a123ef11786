"""What a plan can and cannot see, against the rank of a matrix differentiated numerically, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.identifiability import constant_errors, null_space
from inclinometry.calibration.initial_values import starting_state
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import NUISANCE, Model
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.variance import fit
from inclinometry.errors import IdentifiabilityError
from inclinometry.sensors import parameter_vector
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.tool import random_tool

ROLLS = 45.0 * np.arange(8)


def plan(name, rows):
    """Rows of azimuth, inclination, toolface, deg."""
    return Plan(name, *np.radians(np.array(rows, dtype=float)).T)


def rotations(*turns):
    return plan("turns", [(a, i, t) for a, i in turns for t in ROLLS])


def worst(found, tool):
    true = np.concatenate([parameter_vector(t) for t in tool.triads.values()])
    seen = np.concatenate([parameter_vector(t) for t in found.tool.triads.values()])
    return np.abs((seen - true) / np.sqrt(np.diag(found.tool.covariance))).max()


def turned(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.broadcast_to(np.eye(3), (*np.shape(angle), 3, 3)).copy()
    matrix[..., i, i] = matrix[..., j, j] = c
    matrix[..., i, j], matrix[..., j, i] = s, -s
    return matrix


def rank(settings, direction, constant=None):
    """Rank and number of parameters of one sensor triad N = 1 on a plan; `constant`: which rig error is unknown too."""

    def readings(x):
        zero, toolface, outer, inner = np.zeros(4) if constant is None else x[-1] * (np.arange(4) == constant)
        a, i, t = settings.azimuth, settings.inclination, settings.toolface
        matrix = turned(2, t + toolface) @ turned(0, np.full_like(t, inner)) @ turned(1, i + zero)
        matrix = matrix @ turned(0, np.full_like(t, outer)) @ turned(2, a)
        side = np.linalg.svd(direction[None])[2][1:]
        field = direction + x[12:14] @ side
        return ((matrix @ (field / np.linalg.norm(field))) @ x[:9].reshape(3, 3).T + x[9:12]).ravel()

    x = np.concatenate([np.eye(3).ravel(), np.zeros(5 if constant is None else 6)])
    h = 1e-6
    slope = np.stack([(readings(x + d) - readings(x - d)) / (2 * h) for d in h * np.eye(len(x))], axis=1)
    # numerical derivatives are good to 1e-9; singular values of what is seen are above 0.01
    return int((np.linalg.svd(slope)[1] > 1e-6).sum()), len(x)


def codes(found):
    """Codes of what a calibration says."""
    return [one.code for one in found.findings]


BLIND = {"bench-stand-assumed", "bench-stand-needed"}
DOWN = np.array([0.0, 0.0, 1.0])
DIPPING = np.array([np.cos(1.2), 0.0, np.sin(1.2)])


class TestRotationsAtOneAzimuth:
    def test_at_45_and_135_toolface_zero_and_tilt_are_one(self, bench):
        tool = random_tool(3)
        readings, true = bench(rotations((0, 45), (0, 135)), tool, Rig(setting_sd=1e-3), bits=12)
        assert rank(rotations((0, 45), (0, 135)), DOWN) == (13, 14)
        found = calibrate_joint(readings)
        (said,) = (one for one in found.findings if one.code == "bench-stand-assumed")
        (unseen,) = said.values["unseen"]
        turns = {one.values["turn"]: one.values["kind"] for one in unseen.values["changes"]}
        assert turns == dict.fromkeys(["toolface zero", "tilt of the rig about its north axis"], "accelerometer")
        # it did not guess: the uncertainty of the unseen direction is that of the assumed level stand, 0.2 degrees
        u = np.degrees(found.uncertainty["accelerometer.direction.east"])
        assert 0.1 < u < 0.21
        # honest as long as the stand is as level as assumed
        assert worst(found, tool) < 5.0
        tilt = found.field_directions["accelerometer"] - true.field_directions["accelerometer"]
        assert np.linalg.norm(tilt) < 3 * np.radians(0.2)

    @pytest.mark.parametrize(
        "cure",
        [
            rotations((0, 30), (0, 120)),
            rotations((0, 45), (0, 135), (90, 45)),
            rotations((0, 0), (0, 90)),
        ],
        ids=["30/120", "second azimuth", "0/90"],
    )
    def test_other_inclinations_or_another_azimuth_cure_it(self, bench, cure):
        tool = random_tool(3)
        readings, _ = bench(cure, tool, Rig(setting_sd=1e-3), bits=12)
        assert rank(cure, DOWN) == (14, 14)
        found = calibrate_joint(readings)
        assert not set(codes(found)) & BLIND
        assert worst(found, tool) < 6.0  # 24 parameters, variances from 16 stations

    def test_a_prior_on_level_is_used_instead(self, bench):
        tool = random_tool(3)
        readings, _ = bench(rotations((0, 45), (0, 135)), tool, Rig(setting_sd=1e-3), bits=12)
        level = np.radians(0.05)
        found = calibrate_joint(readings, field_prior={"accelerometer": (DOWN, level)})
        assert not set(codes(found)) & BLIND
        assert found.uncertainty["accelerometer.direction.east"] == pytest.approx(level, rel=0.1)
        assert worst(found, tool) < 6.0


@pytest.mark.long
@pytest.mark.parametrize("settings", [plans.twelve(), plans.orthogonal(), plans.half(), plans.two_face()])
def test_the_classical_plans_see_everything_of_any_tool(bench, settings):
    for direction in (DOWN, DIPPING):
        assert rank(settings, direction) == (14, 14)
    for sensors in ({"accelerometer": 3, "magnetometer": 3}, {"accelerometer": 2, "gyro": 5}):
        readings, _ = bench(settings, random_tool(1, sensors=sensors), Rig(base_tilt=0.1, tilt_axis=0.5), bits=12)
        assert not set(codes(calibrate_joint(readings))) & BLIND


class TestPlansThatCannotDo:
    @pytest.mark.parametrize(
        ("settings", "named"),
        [
            (rotations((0, 45), (90, 45), (200, 45)), ("bench-offset", None)),
            (plan("no roll", [(a, i, 0) for a in (0, 90, 180, 270) for i in (0, 45, 90, 135)]), ("bench-element", "y")),
            (rotations((0, 90), (90, 90), (200, 90)), ("bench-element", "z")),
        ],
        ids=["one inclination", "no roll", "lying only"],
    )
    def test_the_accelerometer_names_what_is_missing(self, bench, settings, named, refused):
        readings, _ = bench(settings, random_tool(2, sensors={"accelerometer": 3}), Rig(), bits=12)
        with refused("bench-plan-blind", IdentifiabilityError) as said:
            calibrate_joint(readings)
        assert said[0].values["size"] == 14
        unseen = said[0].values["unseen"]
        parts = unseen.values.get("changes", (unseen,))
        assert named in [(one.code, one.values.get("axis")) for one in parts]

    @pytest.mark.parametrize("rows", [[(10, 20, 30)] * 16, [(a, 0, t) for a in (0, 90) for t in ROLLS]])
    def test_hopeless_plans_are_one_readable_line(self, bench, rows, refused):
        readings, _ = bench(plan("poor", rows), random_tool(2), Rig(), bits=12)
        with refused("bench-plan-blind", IdentifiabilityError) as said:
            calibrate_joint(readings)
        assert said[0].values["size"] == 28
        assert len(str(said[0])) < 500


ERROR = np.radians(0.1)
RIG = {"inclination_zero": "inclination_zero", "outer_nonorthogonality": "outer", "inner_nonorthogonality": "inner"}


class TestConstantErrorsOfTheRig:
    def run(self, bench, settings, name, seed=3):
        tool = random_tool(seed, bits=None)
        rig = Rig(setting_sd=np.radians(0.02), **{RIG[name]: ERROR})
        return tool, bench(settings, tool, rig, seed=seed)[0]

    @pytest.mark.long
    @pytest.mark.parametrize("settings", [plans.orthogonal(), plans.two_face(), plans.twelve()], ids=lambda p: p.name)
    @pytest.mark.parametrize("name", list(RIG))
    def test_is_seen_by_the_joint_model_and_found(self, bench, settings, name):
        # single-face plans too: their closed forms cannot see an inclination zero, the sensors together can
        assert rank(settings, DIPPING, NUISANCE.index(name)) == (15, 15)
        tool, readings = self.run(bench, settings, name)
        found = calibrate_joint(readings, nuisance_sd={name: np.radians(1.0)})
        estimate, u = found.rig.nuisance[name]
        assert u < np.radians(0.04)  # a dial's own repeating errors look alike
        assert abs(estimate - ERROR) < 4 * u
        assert found.uncertainty[f"rig.{name}"] == pytest.approx(u)
        assert worst(found, tool) < 6.0

    @pytest.mark.long
    @pytest.mark.parametrize("name", list(RIG))
    def test_is_warned_of_when_it_is_not_fitted(self, bench, name):
        _, readings = self.run(bench, plans.orthogonal(), name)
        words = name.replace("_", " ")
        (said,) = (one for one in calibrate_joint(readings).findings if one.code == "bench-rig-error")
        assert said.values["error"] == words
        fitted = calibrate_joint(readings, nuisance_sd={name: np.radians(1.0)})
        assert words not in [one.values.get("error") for one in fitted.findings]

    def test_costs_the_closed_form_what_the_specification_says(self, bench):
        from inclinometry.calibration.closed_form_results import calibrate_orthogonal

        tool = random_tool(3, bits=None, g=9.80665, b=50000.0)
        for settings, expected in ((plans.orthogonal(), 2 / 3 * np.sin(ERROR)), (plans.two_face(), 0.0)):
            readings, _ = bench(settings, tool, Rig(inclination_zero=ERROR), noise={})
            found = calibrate_orthogonal(readings).tool.triads["accelerometer"]
            # offset of the tool axes: N^-1 dU0, along z 2/3 g sin(error)
            shift = np.linalg.pinv(tool.triads["accelerometer"].tensor[0]) @ (
                found.offset[0] - tool.triads["accelerometer"].offset[0]
            )
            assert np.abs(shift[2]) == pytest.approx(expected, abs=1e-5)  # 1.16 mg, to second order in the error

    def test_a_toolface_zero_is_a_matter_of_definition(self, bench):
        readings, _ = bench(plans.orthogonal(), random_tool(1), Rig(toolface_zero=0.01), bits=12)
        assert rank(plans.orthogonal(), DIPPING, NUISANCE.index("toolface_zero")) == (14, 15)
        prior = np.radians(0.5)
        found = calibrate_joint(readings, nuisance_sd={"toolface_zero": prior})
        estimate, u = found.rig.nuisance["toolface_zero"]
        assert abs(estimate) < 1e-6
        assert u == pytest.approx(prior, rel=1e-3)  # nothing was learnt
        assert "bench-rig-error" not in codes(found)

    @pytest.mark.long
    def test_clean_rigs_are_not_warned_of(self, bench):
        for seed in range(10):
            readings, _ = bench(plans.orthogonal(), random_tool(seed), Rig(setting_sd=1e-3), seed=seed, bits=12)
            # three errors, four standard uncertainties, variances estimated: one false word in some thousand runs
            assert "bench-rig-error" not in codes(calibrate_joint(readings))

    def test_several_at_once(self, bench):
        tool = random_tool(5, bits=None)
        rig = Rig(setting_sd=np.radians(0.02), inclination_zero=2e-3, outer=-1e-3, inner=1.5e-3)
        readings, _ = bench(plans.two_face(), tool, rig)
        found = calibrate_joint(readings, nuisance_sd=dict.fromkeys(RIG, np.radians(1.0)))
        for name, true in zip(RIG, (2e-3, -1e-3, 1.5e-3), strict=True):
            estimate, u = found.rig.nuisance[name]
            assert abs(estimate - true) < 4 * u
        assert worst(found, tool) < 6.0
        assert "inclination" in repr(found)


@pytest.mark.parametrize("settings", [plans.twelve(), plans.orthogonal()], ids=lambda p: p.name)
def test_an_error_that_was_not_fitted_is_what_a_fit_with_it_finds(bench, settings):
    """Estimate and uncertainty of each alone, from residuals, against a fit that carries it."""
    rig = Rig(setting_sd=np.radians(0.05), inclination_zero=2e-3, outer=-1e-3, inner=1.5e-3)
    readings, _ = bench(settings, random_tool(3, bits=None), rig)
    sd = np.concatenate([np.full(v.shape, 0.5) for v in readings.channels.values()], axis=1)
    dials = np.stack(readings.dials, axis=1)
    model = Model(readings.channels, dials, np.ones((len(dials), 1)), sd, np.full(3, np.radians(0.05)), np.zeros(4), {})
    here = fit(model, starting_state(model))
    found = constant_errors(here)
    assert list(found) == list(NUISANCE)
    for place, name in enumerate(NUISANCE):
        wide = replace(model, nuisance_sd=np.eye(4)[place])
        carried = fit(wide, here.state)
        column = wide.columns()[2]
        u = float(np.sqrt(carried.covariance[column, column][0, 0]))
        if name == "toolface_zero":
            assert found[name] == (0.0, np.inf)
            assert u == pytest.approx(1.0, rel=1e-3)
            continue
        assert found[name][1] == pytest.approx(u, rel=0.01)
        # errors of three standard uncertainties: a hundredth of one is not linear
        assert found[name][0] == pytest.approx(carried.state.nuisance[place], abs=0.05 * u)
    assert "inclination_zero" not in constant_errors(fit(replace(model, nuisance_sd=np.eye(4)[0]), here.state))


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e4])
def test_what_is_unseen_is_two_changes_in_any_unit_of_the_signals(bench, unit):
    """Rolls at 45 and 135 degrees: the zero of the toolface and a tilt, and nothing else is needed to say so."""
    readings, _ = bench(rotations((0, 45), (0, 135)), random_tool(3, sensors={"accelerometer": 3}), Rig())
    signals = {"accelerometer": unit * readings.channels["accelerometer"]}
    dials = np.stack(readings.dials, axis=1)
    model = Model(signals, dials, np.ones((16, 1)), np.full((16, 3), unit), np.zeros(3), np.zeros(4), {})
    found = null_space(model, starting_state(model))
    assert (found.rank, found.size, found.complete) == (13, 14, False)
    (unseen,) = found.unseen
    # about the axis that stays in the plane of the turns
    assert {one.values["turn"] for one in unseen.values["changes"]} == {
        "tilt of the rig about its north axis",
        "toolface zero",
    }


@pytest.mark.parametrize("count", [2, 3, 4])
def test_too_few_stations_are_counted(bench, count):
    readings, _ = bench(plans.orthogonal(), random_tool(1), Rig(), bits=12)
    with refused("fit-few", error=IdentifiabilityError):
        calibrate_joint(readings.take(range(count)))

"""Verification at independent positions: honest tools pass as often as stated, wrong ones fail."""

import dataclasses

import numpy as np
import pytest
from tests.refusals import coded, fits, refused

from inclinometry.calibration import plans
from inclinometry.calibration.closed_form_results import calibrate_orthogonal
from inclinometry.calibration.conformity import verify
from inclinometry.calibration.decision import Limits, agreement_factor
from inclinometry.calibration.joint import calibrate_joint, fit_once
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InputError
from inclinometry.sensors import Tool, Triad
from inclinometry.simulate.bench import Misread, Rig
from inclinometry.simulate.tool import random_tool

WIDE = Limits("wide", "for this test", np.radians(1.0), np.radians(2.0), np.radians(1.5))
LEVEL = {"accelerometer": ([0.0, 0.0, 1.0], np.radians(5.0))}


def positions(seed, count=8, lowest=0.1):
    random = np.random.default_rng(seed)
    return Plan(
        "independent",
        random.uniform(0.0, 2 * np.pi, count),
        random.uniform(lowest, 2.5, count),
        random.uniform(0.0, 2 * np.pi, count),
    )


@pytest.fixture(scope="module")
def pair(bench):
    """A calibration, the tool and the rig it came from, and readings at other positions."""
    tool, rig = (
        random_tool(3),
        Rig(setting_sd=np.radians(0.05), base_tilt=np.radians(3.0), tilt_axis=1.0, north_offset=0.3),
    )
    calibration = calibrate_joint(bench(plans.orthogonal(), tool, rig, bits=12)[0], name="SN 7")
    return calibration, tool, rig, bench(positions(1), tool, rig, bits=12, seed=77)[0]


def with_tensor(calibration, kind, change):
    """The calibration with one triad's tensor multiplied from the right."""
    triads = dict(calibration.tool.triads)
    old = triads[kind]
    triads[kind] = Triad(kind, old.tensor @ change, old.offset, old.unit, old.field_strength)
    tool = Tool(calibration.tool.name, triads, calibration.tool.covariance, calibration.tool.noise)
    return dataclasses.replace(calibration, tool=tool)


def turned(angle, axis=2):
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = s, -s
    return matrix


class TestAgainstTheCertificate:
    @pytest.mark.long
    @pytest.mark.parametrize(
        ("plan", "rig_deg", "prior"),
        [
            (plans.twelve(), 0.1, None),
            (plans.orthogonal(), 0.0, None),
            (plans.rotations(np.radians(30.0)), 0.1, None),
            # toolface zero and tilt inseparable: as uncertain as the level of the stand, and correlated
            (plans.rotations(), 0.0, LEVEL),
        ],
        ids=["twelve", "orthogonal", "rotations 30/120", "rotations 45/135"],
    )
    def test_errors_are_as_large_as_stated_and_honest_tools_pass(self, bench, sensor_noise, plan, rig_deg, prior):
        draws, scores, passed = 40, [], 0
        for seed in range(draws):
            tool = random_tool(seed)
            rig = Rig(
                setting_sd=np.radians(rig_deg), base_tilt=np.radians(2.0), tilt_axis=float(seed), north_offset=0.2
            )
            calibration = fit_once(
                bench(plan, tool, rig, seed=seed, bits=12)[0],
                sensor_noise(tool, 12),
                np.radians(rig_deg),
                field_prior=prior,
            )
            found = verify(bench(positions(seed), tool, rig, seed=seed + 1000, bits=12)[0], calibration)
            scores.append(np.mean((found.errors / found.u) ** 2, axis=0))
            passed += found.verdict == "agrees"
        # 40 calibrations, each one error common to its eight positions: rms good to 1/sqrt(2 * 40 * 2) = 8 % at worst
        np.testing.assert_allclose(np.sqrt(np.mean(scores, axis=0)), 1.0, atol=0.25)
        assert passed >= draws - 3  # 99 % each: four or more fail with 0.1 %

    def test_a_pass_on_a_coarse_stand_confirms_nothing_and_says_so(self, pair):
        calibration, _, _, readings = pair
        for sd, said in ((0.0, False), (1.0, True)):
            rig = dataclasses.replace(calibration.rig, sd=np.full(3, np.radians(sd)))
            found = verify(readings, dataclasses.replace(calibration, rig=rig))
            assert ("verify-detects-little" in coded(found.findings)) is said

    def test_says_what_it_held_against_what(self, pair):
        calibration, _, _, readings = pair
        found = verify(readings, calibration)
        assert found.verdict == "agrees"
        assert (found.limits_name, found.limits_source, np.isinf(found.limits).all()) == ("", "", True)
        assert found.tool == "SN 7"
        assert found.inputs == {"readings": readings.digest, "calibration readings": calibration.inputs["readings"]}
        inside = int(np.sum(np.abs(found.errors) <= 2.0 * found.u))
        assert fits(found.findings[0], ["verify-agreement"], {"inside": inside, "total": 24, "k": 2.0})
        # two-sided 99 % over 24 judged errors: 0.005 / 24 in each tail, 3.53 standard deviations of a known rig
        known = dataclasses.replace(calibration.rig, freedom=np.full(3, np.inf))
        sure = verify(readings, dataclasses.replace(calibration, rig=known))
        assert (sure.findings[0].code, sure.findings[0].values["beyond"]) == ("verify-agreement", 0)
        assert sure.findings[0].values["factor"] == pytest.approx(3.53, abs=0.005)
        assert 3.6 < agreement_factor(24, calibration.rig.freedom) < 4.5
        assert (found.coverage_factor, sure.coverage_factor) == (2.0, 2.0)
        assert {d for row in found.decision for d in row} == {"agrees"}

    @pytest.mark.parametrize(
        ("kind", "angle", "axis", "named"),
        [
            ("accelerometer", 1.5, 1, "inclination"),
            ("magnetometer", 2.0, 2, "azimuth"),
            ("magnetometer", 2.0, 0, "azimuth"),
        ],
    )
    def test_a_wrong_tool_fails(self, pair, kind, angle, axis, named):
        calibration, _, _, readings = pair
        found = verify(readings, with_tensor(calibration, kind, turned(np.radians(angle), axis)))
        assert found.verdict == "does not agree"
        assert any(fits(one, ["verify-angle"], {"of": "U", "angle": named}) for one in found.findings)

    def test_another_tool_fails(self, bench, pair):
        calibration, _, rig, _ = pair
        assert verify(bench(positions(1), random_tool(4), rig, bits=12)[0], calibration).verdict == "does not agree"

    def test_a_misread_dial_fails_and_is_named(self, bench, pair):
        calibration, tool, rig, _ = pair
        wrong = dataclasses.replace(rig, faults=(Misread(4, "azimuth", np.radians(3.0)),))
        found = verify(bench(positions(1), tool, wrong, bits=12)[0], calibration)
        assert found.verdict == "does not agree"
        # the record says 3 degrees more than what was set, so the tool reads less
        one = next(one for one in found.findings if fits(one, ["verify-angle"], {"of": "U", "angle": "azimuth"}))
        assert (one.values["count"], one.values["total"], one.values["station"]) == (1, 8, "5")
        assert one.values["error_deg"] < 0.0


class TestAgainstLimits:
    def test_errors_are_those_of_the_definition(self, bench):
        # noise-free, level: measured angles minus dials
        tool = random_tool(2, bits=None)
        calibration = calibrate_joint(bench(plans.orthogonal(), tool, Rig(), noise={})[0])
        settings = positions(3)
        readings, _ = bench(settings, tool, Rig(), noise={})
        off = verify(readings, with_tensor(calibration, "magnetometer", turned(np.radians(0.5)).T), WIDE)
        np.testing.assert_allclose(off.dials[:, 1], settings.inclination)
        np.testing.assert_allclose(off.true_inclination, np.abs(settings.inclination), atol=1e-9)
        np.testing.assert_allclose(off.errors[:, [0, 2]], 0.0, atol=1e-9)
        # the sense is that of the turn; it is largest where the field crosses the tool axis
        assert 0.1 < np.degrees(np.abs(off.errors[:, 1])).max() < 2.0

    def test_limits_decide_and_none_is_not_judged(self, pair):
        calibration, _, _, readings = pair
        assert verify(readings, calibration, WIDE).verdict == "pass"
        narrow = dataclasses.replace(WIDE, inclination=np.radians(0.3))
        found = verify(readings, with_tensor(calibration, "accelerometer", turned(np.radians(1.5), 1)), narrow)
        assert found.verdict == "fail"
        assert fits(found.findings[0], ["verify-angle"], {"of": "limit", "angle": "inclination"})
        free = verify(readings, calibration, dataclasses.replace(narrow, inclination=None))
        assert free.verdict == "pass"
        assert {row[0] for row in free.decision} == {"not judged"}
        assert found.limits_name == "wide"
        assert found.limits_source == "for this test"

    def test_a_limit_below_the_uncertainty_of_the_comparison_is_warned_of(self, pair):
        calibration, _, _, readings = pair
        hopeless = dataclasses.replace(WIDE, inclination=np.radians(0.001))
        # agreed before the readings were taken, they are decided on and warned of; else refused
        found = verify(readings, calibration, hopeless, agreed=True)
        assert any(fits(one, ["verify-uncertain"], {"angle": "inclination"}) for one in found.findings)
        assert "verify-uncertain" not in coded(verify(readings, calibration, WIDE).findings)

    @pytest.mark.parametrize(("name", "share"), [("inclination", 0.4), ("azimuth", 0.9), ("toolface", 0.1)])
    def test_a_limit_the_stand_cannot_verify_is_refused_with_what_would_do(self, pair, name, share):
        """U of the comparison is at most half the limit; the limit and the rig that are named are then accepted."""
        calibration, _, _, readings = pair
        column = ["inclination", "azimuth", "toolface"].index(name)
        expanded = 2.0 * float(verify(readings, calibration).u[:, column].max())
        limits = dataclasses.replace(WIDE, **dict.fromkeys(("inclination", "azimuth", "toolface")))
        for one in (1.99, share):
            with refused("verify-limit-narrow") as raised:
                verify(readings, calibration, dataclasses.replace(limits, **{name: one * expanded}))
        (narrow,) = raised.value.finding.values["limits"]
        assert narrow.values["angle"] == name
        give = narrow.values["least_deg"]
        assert 2.0 <= np.radians(give) / expanded < 2.2
        found = verify(readings, calibration, dataclasses.replace(limits, **{name: float(np.radians(give))}))
        assert found.verdict == "pass"
        if name != "inclination":  # noise and calibration alone are more than half of such a limit
            return
        # a rig as good as named, the calibration's share unchanged, verifies a limit a little below
        with refused("verify-limit-narrow") as raised:
            verify(readings, calibration, dataclasses.replace(limits, **{name: 1.9 * expanded}))
        (narrow,) = raised.value.finding.values["limits"]
        better = np.radians(narrow.values["rig_deg"][0])
        rig = dataclasses.replace(calibration.rig, sd=np.full(3, better))
        other = dataclasses.replace(calibration, rig=rig)
        assert verify(readings, other, dataclasses.replace(limits, **{name: 1.9 * expanded})).verdict == "pass"

    def test_guard_bands_make_the_doubtful_inconclusive(self, pair):
        calibration, _, _, readings = pair
        plain = verify(readings, calibration, WIDE)
        row = int(np.abs(plain.errors[:, 0]).argmax())
        just = abs(plain.errors[row, 0]) + plain.u[row, 0]  # within the limit by one standard uncertainty
        limits = dataclasses.replace(WIDE, inclination=just)
        assert verify(readings, calibration, limits, agreed=True).verdict == "pass"
        guarded = dataclasses.replace(limits, guard="expanded-uncertainty")
        guarded = verify(readings, calibration, guarded, agreed=True)
        assert guarded.decision[row][0] == "inconclusive"
        assert guarded.verdict == "fail"
        wide = verify(readings, calibration, dataclasses.replace(WIDE, guard="expanded-uncertainty"))
        assert wide.verdict == "pass"

    def test_near_the_vertical_only_inclination_is_judged(self, bench, pair):
        calibration, tool, rig, _ = pair
        level = dataclasses.replace(rig, base_tilt=0.0, setting_sd=0.0)
        calibration = calibrate_joint(bench(plans.orthogonal(), tool, level, bits=12)[0])
        upright = Plan("upright", *np.radians([[0, 90, 0, 0], [0, 0, 4, 30], [0, 50, 0, 0]]))
        readings, _ = bench(upright, tool, level, bits=12)
        found = verify(readings, calibration, WIDE)
        assert [list(row) for row in found.decision[:2]] == [["pass", "not judged", "not judged"]] * 2
        assert found.decision[3][1] == "pass"
        assert np.isfinite(found.u).all()
        later = verify(readings, calibration, dataclasses.replace(WIDE, min_inclination_for_azimuth=np.radians(5.0)))
        assert later.decision[2][1] == "not judged"
        assert later.decision[3][1] != "not judged"


def test_constant_errors_of_the_rig_that_were_fitted_do_not_count_against_the_tool(bench):
    tool = random_tool(5)
    rig = Rig(inclination_zero=np.radians(0.5), outer=np.radians(-0.3), setting_sd=np.radians(0.02))
    readings, _ = bench(plans.two_face(), tool, rig, bits=12)
    sd = np.radians(1.0)
    calibration = calibrate_joint(readings, nuisance_sd={"inclination_zero": sd, "outer_nonorthogonality": sd})
    found = verify(bench(positions(2), tool, rig, bits=12, seed=9)[0], calibration)
    assert found.verdict == "agrees"
    assert np.degrees(np.abs(found.errors[:, 0])).max() < 0.15


def test_a_closed_form_is_verified_too(bench):
    tool, rig = random_tool(3), Rig(setting_sd=np.radians(0.05))
    calibration = calibrate_orthogonal(bench(plans.orthogonal(), tool, rig, bits=12)[0])
    assert verify(bench(positions(1), tool, rig, bits=12, seed=9)[0], calibration).verdict == "agrees"


def test_means_of_many_readings_are_less_uncertain(bench, pair):
    calibration, _, _, readings = pair
    many = dataclasses.replace(readings, count=np.full(len(readings), 100.0))
    assert (verify(many, calibration).u < verify(readings, calibration).u).all()


def test_temperature_far_from_the_calibration_is_warned_of(bench):
    tool, rig = random_tool(3), Rig(setting_sd=np.radians(0.05))
    calibration = calibrate_joint(bench(plans.orthogonal(), tool, rig, bits=12, temperature=20.0)[0])
    warm = bench(positions(1), tool, rig, bits=12, seed=9, temperature=60.0)[0]
    assert any(
        fits(one, ["verify-temperature"], {"here_high_degC": 60.0}) for one in verify(warm, calibration).findings
    )
    near = bench(positions(1), tool, rig, bits=12, seed=9, temperature=22.0)[0]
    assert "verify-temperature" not in coded(verify(near, calibration).findings)


class TestRefusals:
    def test_the_same_readings(self, bench):
        readings, _ = bench(plans.orthogonal(), random_tool(1), Rig(), bits=12)
        with refused("bench-readings-own", how="unchanged"):
            verify(readings, calibrate_joint(readings))

    def test_part_of_the_same_readings(self, bench):
        readings, _ = bench(plans.orthogonal(), random_tool(1), Rig(), bits=12)
        with refused("bench-readings-own", how="unchanged"):
            verify(readings.take(range(6)), calibrate_joint(readings))

    def test_another_number_of_sensors(self, bench, pair):
        other = random_tool(1, sensors={"accelerometer": 3, "magnetometer": 4})
        with refused("input-channels", kind="magnetometer", channels=4, calibrated=3):
            verify(bench(positions(1), other, Rig())[0], pair[0])

    def test_no_angles(self, pair):
        calibration, _, _, readings = pair
        with refused("bench-no-angles"):
            verify(BenchReadings(readings.channels), calibration)

    def test_a_calibration_without_a_rig(self, pair):
        calibration, _, _, readings = pair
        with refused("verify-no-orientation"):
            verify(readings, dataclasses.replace(calibration, field_directions={}))

    @pytest.mark.parametrize("change", [{"inclination": -0.1}, {"azimuth": np.nan}, {"guard": "always"}])
    def test_limits_that_make_no_sense(self, change):
        with pytest.raises(InputError) as raised:
            dataclasses.replace(WIDE, **change)
        assert next(iter(change)) in str(raised.value.finding.values)


@pytest.mark.long
def test_good_tools_pass_at_the_vertical_as_often_as_stated(bench):
    """There the error of inclination is the length of a tilt in two directions, whichever the rig errs in."""
    tool, rig = random_tool(3), Rig(setting_sd=np.radians(0.05))
    degrees = [[0, 90, 180, 270, 30, 200], [0] * 6, [0, 90, 180, 270, 45, 135]]
    upright = Plan("upright", *np.radians(np.array(degrees, dtype=float)))
    found = []
    for seed in range(30):
        calibration = calibrate_joint(bench(plans.two_face(), tool, rig, bits=12, seed=1000 + seed)[0])
        found.append(verify(bench(upright, tool, rig, bits=12, seed=seed)[0], calibration))
    assert sum(one.verdict == "agrees" for one in found) >= 29
    # not by being so wide that nothing fails
    assert max(np.abs(one.errors[:, 0] / one.u[:, 0]).max() for one in found) > 1.0
    expanded = np.degrees(found[0].coverage_factor * found[0].u[:, 0])
    assert np.all(expanded < 5.0 * 0.05)


@pytest.mark.long
def test_judged_at_two_sigma_the_tilt_has_the_probability_of_two_sigma(bench):
    """At least 95.4 % of the errors lie within U."""
    tool, rig = random_tool(3), Rig(setting_sd=np.radians(0.05))
    calibration = calibrate_joint(bench(plans.two_face(), tool, rig, bits=12)[0])
    upright = Plan("upright", np.zeros(400), np.zeros(400), np.tile(np.radians([0.0, 90.0]), 200))
    readings, _ = bench(upright, tool, rig, bits=12, seed=4)
    found = verify(readings, calibration, Limits("own", "this test", np.radians(0.5), None, None))
    inside = np.mean(found.errors[:, 0] <= found.coverage_factor * found.u[:, 0])
    assert inside > 0.954 - 0.03  # the rig errs in one direction: rather more
    assert found.coverage_factor == 2.0

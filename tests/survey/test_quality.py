"""Quality of six-axis stations: published case, draws, limits, what geometry hides."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.magnetic import reference_errors
from inclinometry.orientation import angles_jacobian, fields
from inclinometry.survey.axial import axial_correction
from inclinometry.survey.flags import OFF, unjudged
from inclinometry.survey.multistation import invariants
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.quality import (
    BLINDNESS,
    FieldLimits,
    distance_limit,
    judge_fields,
    residual_covariance,
    sensor_sigmas,
    with_sensors,
)
from inclinometry.survey.stations import Stations

# sensor terms of the ISCWSA MWD model Rev 5.1
MWD = {
    **{"ABXY-TI1S": 0.004, "ABXY-TI2S": 0.004, "ABZ": 0.004, "ASXY-TI1S": 0.0005, "ASZ": 0.0005},
    **{"MBXY-TI1S": 70.0, "MBZ": 70.0, "MSXY-TI3S": 0.0016, "MSZ": 0.0016, "AMIL": 220.0, "SAGE": 0.0035},
}
G, B, DIP = 9.81, 50_000.0, np.radians(70.0)
SITE = FieldReference(
    g=G,
    b=B,
    dip=DIP,
    g_sigma=0.0015,
    b_sigma=130.0,
    dip_sigma=np.radians(0.2),
    b_random=60.0,
    dip_random=np.radians(0.08),
)


def stations(azimuth_deg, inclination_deg, toolface_deg=40.0, *, scale=(1.0, 1.0), dip=DIP, axial=0.0):
    turned = np.broadcast_arrays(*(np.atleast_1d(np.radians(a)) for a in (azimuth_deg, inclination_deg, toolface_deg)))
    g, b = fields(*turned, dip)
    return Stations(np.arange(len(g)) * 30.0, G * scale[0] * g, B * scale[1] * b + np.array([0.0, 0.0, axial]))


def names(quality):
    return {check.name: check for check in quality.checks}


@pytest.mark.parametrize("toolface_deg", [0.0, 45.0, 90.0, 200.0])
def test_public_case_of_a_dynamic_check(toolface_deg):
    """0.9495 sigma, within 5 %: B 46475.6 (46644.9) nT, dip 57.96 (58.04), G 9.803 (9.8), inclination 45, true azimuth
    45, declination 4.24. The case does not print its covariance; here it is that of sensors and axial interference of
    the MWD model and of the BGGM with the disturbance of the field. Its toolface is not given: any does."""
    errors = reference_errors("BGGM")
    site = FieldReference(g=9.8, b=46644.9, dip=np.radians(58.04), g_sigma=0.0015, b_sigma=errors.b,
                          dip_sigma=errors.dip, b_random=errors.b_random, dip_random=errors.dip_random)  # fmt: skip
    g, b = fields(np.radians([45.0 - 4.24]), np.radians(45.0), np.radians(toolface_deg), np.radians(57.96))
    found = judge_fields(with_sensors(Stations([0.0], 9.803 * g, 46475.6 * b), MWD), site)
    assert found.distance[0] == pytest.approx(0.9495, rel=0.05)
    assert found.verdicts == ("pass",)


@pytest.mark.long
def test_residuals_of_drawn_tools_have_the_stated_covariance():
    random, count = np.random.default_rng(7), 20_000
    true = stations(60.0, 50.0)
    bias, scale = sensor_sigmas(MWD)
    both = np.concatenate([true.g, true.b], axis=1)
    both = both * (1.0 + random.normal(0.0, 1.0, (count, 6)) * scale) + random.normal(0.0, 1.0, (count, 6)) * bias
    run = with_sensors(Stations(np.arange(count) * 1.0, both[:, :3], both[:, 3:]), MWD)
    found = judge_fields(run, SITE)
    reference = random.normal(0.0, 1.0, (count, 3)) * np.hypot(SITE.sigmas, SITE.randoms)
    residual = found.difference - reference
    middle = judge_fields(with_sensors(true, MWD), SITE)
    # standard deviation of 20,000 draws: 0.5 %; four of them
    np.testing.assert_allclose(residual.std(axis=0), middle.sigma[0], rtol=0.02)
    covariance = residual_covariance(
        with_sensors(true, MWD), invariants(np.concatenate([true.g, true.b], axis=1))[1], SITE
    )[0]
    squares = np.einsum("na,ab,nb->n", residual, np.linalg.inv(covariance), residual)
    assert squares.mean() == pytest.approx(3.0, rel=0.03)  # chi-square with 3 degrees of freedom, 0.6 % by chance
    assert (np.sqrt(squares) > distance_limit(3.0, np.array([3]))[0]).mean() < 0.005  # 0.0027 expected


def test_good_stations_pass_with_their_figures():
    found = judge_fields(with_sensors(stations([30.0, 80.0], [40.0, 60.0]), MWD), SITE)
    assert found.verdict == "pass"
    assert found.verdicts == ("pass", "pass")
    assert found.off(0) == ""
    assert {one.severity for one in found.findings} == {"note"}
    assert repr(found).startswith("FieldQuality: 2 rows\n")
    # a judgement is itself and no other, columns are not compared
    assert found in {found}
    assert found != judge_fields(with_sensors(stations([30.0, 80.0], [40.0, 60.0]), MWD), SITE)


@pytest.mark.parametrize(
    ("scale", "dip_off", "failing", "cause"),
    [
        ((1.01, 1.0), 0.0, {"gravity", "distance"}, "g"),
        ((1.0, 1.03), 0.0, {"magnetic field", "distance"}, "b"),
        ((1.0, 1.0), 3.0, {"dip", "distance"}, "d"),
        ((1.05, 1.1), 0.0, {"gravity", "magnetic field", "distance"}, "gb"),
        ((1.0, 1.03), 3.0, {"magnetic field", "dip", "distance"}, "b"),
        ((1.01, 1.0), 3.0, {"gravity", "dip", "distance"}, "gd"),
        ((1.05, 1.1), 3.0, {"gravity", "magnetic field", "dip", "distance"}, "gb"),
    ],
)
def test_what_fails_says_why_and_what_next(scale, dip_off, failing, cause):
    run = stations([30.0, 80.0], [40.0, 60.0], scale=scale, dip=DIP - np.radians(dip_off))
    found = judge_fields(with_sensors(run, MWD), SITE)
    assert found.verdict == "fail"
    assert found.verdicts == ("fail", "fail")
    assert {name for name, check in names(found).items() if check.verdict == "fail"} == failing
    assert {check.reason.code for check in found.checks if check.verdict == "fail"} == {"survey-off"}
    assert {check.reason.values["advice"] for check in found.checks if check.verdict == "fail"} == {OFF[cause]}
    assert set(found.off(0).split("|")) == {{"gravity": "g", "magnetic field": "b"}.get(one, one) for one in failing}


def test_dip_is_said_in_degrees():
    found = judge_fields(with_sensors(stations([30.0], [40.0], dip=DIP - np.radians(3.0)), MWD), SITE)
    assert names(found)["dip"].reason.values["off"] == pytest.approx(-3.0)


def test_one_bad_station_among_many_is_an_event():
    run = stations(30.0, np.linspace(20.0, 60.0, 10))
    b = np.array(run.b)
    b[4] *= 1.05
    found = judge_fields(with_sensors(Stations(run.md, run.g, b), MWD), SITE)
    check = names(found)["magnetic field"]
    assert check.stations == (4,)
    assert (check.reason.values["advice"], check.reason.values["total"]) == (OFF["few"], 10)
    assert found.verdicts.count("fail") == 1


def test_the_three_together_see_what_each_alone_does_not():
    """Half-way to each limit against the grain of the correlation."""
    run = with_sensors(stations(30.0, 40.0), MWD)
    _, rows = invariants(np.concatenate([run.g, run.b], axis=1))
    covariance = residual_covariance(run, rows, SITE)[0]
    values, vectors = np.linalg.eigh(covariance / np.sqrt(np.outer(covariance.diagonal(), covariance.diagonal())))
    small = vectors[:, 0] * np.sqrt(covariance.diagonal()) * np.sqrt(values[0]) * 4.0
    assert (np.abs(small) < 3.0 * np.sqrt(covariance.diagonal())).all()
    shifted = replace(SITE, g=G - small[0], b=B - small[1], dip=DIP - small[2])
    found = judge_fields(run, shifted)
    assert found.distance[0] == pytest.approx(4.0, rel=0.01)  # the rows move a little with the reference
    assert {n for n, c in names(found).items() if c.verdict == "fail"} == {"distance"}
    assert (found.off(0), found.checks[3].reason.values["advice"]) == ("distance", OFF[""])


def test_distance_limit_is_as_rare_as_k_sigma():
    # chi-square quantiles of 0.9973
    np.testing.assert_allclose(distance_limit(3.0, np.array([1, 2, 3])), [3.0, 3.4393, 3.7625], atol=1e-4)
    assert np.isnan(distance_limit(3.0, np.array([0]))).all()


def test_fixed_limits_replace_those_they_name():
    run = with_sensors(stations(30.0, 40.0, scale=(1.0, 1.007)), MWD)  # 350 nT
    limits = FieldLimits("mine", "contract", b=300.0)
    assert judge_fields(run, SITE).verdicts == ("pass",)
    found = judge_fields(run, SITE, limits=limits)
    assert found.verdicts == ("fail",)
    assert found.limit[0, 1] == 300.0
    assert found.limit[0, 2] == pytest.approx(3.0 * found.sigma[0, 2])
    exact = judge_fields(run, SITE, limits=FieldLimits("mine", "contract", b=350.0))
    assert exact.verdicts == ("pass",)  # on the limit


def test_no_uncertainty_is_not_judged():
    site = FieldReference(g=G, b=B, dip=DIP, g_sigma=0.0, b_sigma=0.0, dip_sigma=0.0)
    found = judge_fields(stations(30.0, 40.0, scale=(1.0, 2.0)), site)
    assert found.verdict == "not judged"
    assert found.verdicts == ("not judged",)
    assert {check.verdict for check in found.checks} == {"not judged"}
    assert found.checks[0].reason == unjudged("no uncertainty is known")
    fixed = judge_fields(stations(30.0, 40.0, scale=(1.0, 2.0)), site, limits=FieldLimits("mine", "contract", b=300.0))
    assert fixed.verdicts == ("fail",)
    assert names(fixed)["gravity"].verdict == "not judged"


def test_dip_at_the_magnetic_pole_is_not_judged():
    pole = FieldReference(g=G, b=B, dip=np.radians(89.9), g_sigma=0.0015, b_sigma=130.0, dip_sigma=np.radians(0.2))
    found = judge_fields(with_sensors(stations(30.0, 40.0, dip=np.radians(89.9)), MWD), pole)
    check = names(found)["dip"]
    assert check.verdict == "not judged"
    assert check.reason == unjudged("the field is vertical within its limit")
    assert found.verdict == "pass"


def test_axial_interference_hides_near_horizontal_east_west():
    found = judge_fields(with_sensors(stations([90.0, 20.0], [90.0, 50.0], axial=0.0), MWD), SITE)
    check = names(found)["axial interference seen"]
    assert check.verdict == "not judged"
    assert check.stations == (0,)
    assert check.reason.code == "survey-axial-hidden"
    assert found.undetected_azimuth[0] > np.radians(5.0) > found.undetected_azimuth[1]
    # and indeed: 600 nT there turn azimuth by 2 deg and pass
    hidden = judge_fields(with_sensors(stations(90.0, 90.0, axial=600.0), MWD), SITE)
    assert hidden.verdicts == ("pass",)


def test_undetected_azimuth_is_that_of_the_interference_on_the_limit():
    run = with_sensors(stations(40.0, 50.0), {"ABZ": 0.004, "MBX": 70.0, "MBY": 70.0})
    stated = judge_fields(run, SITE).undetected_azimuth[0]
    by_bz = abs(angles_jacobian(run.g, run.b)[0, 1, 5])
    _, rows = invariants(np.concatenate([run.g, run.b], axis=1))
    spread = residual_covariance(run, rows, SITE)[0, 1:, 1:]
    residual = rows[0, 1:, 5] * stated / by_bz
    assert np.sqrt(residual @ np.linalg.inv(spread) @ residual) == pytest.approx(3.0, rel=1e-9)


@pytest.mark.long
def test_after_an_axial_correction_the_reference_is_not_counted_twice():
    random, count = np.random.default_rng(11), 800
    noise = np.diag([0.002] * 3 + [40.0] * 3) ** 2
    site = FieldReference(g=G, b=B, dip=DIP, g_sigma=0.001, b_sigma=130.0, dip_sigma=np.radians(0.2))
    true = stations(40.0, 50.0)
    residuals = []
    for error in random.multivariate_normal(np.zeros(6), noise, count):
        off = random.normal(0.0, 1.0, 3) * site.sigmas
        moved = replace(site, g=G + off[0], b=B + off[1], dip=DIP + off[2])
        run = Stations([0.0], true.g + error[:3], true.b + error[3:] + [0.0, 0.0, 500.0])
        residuals.append(judge_fields(axial_correction(run, moved).stations, moved).difference[0])
    run = Stations([0.0], true.g, true.b + [0.0, 0.0, 500.0], noise=noise[None])
    found = judge_fields(axial_correction(run, site).stations, site)
    # 800 draws: 2.5 %; three of them
    np.testing.assert_allclose(np.std(residuals, axis=0), found.sigma[0], rtol=0.075)
    assert BLINDNESS["axial"][0] in [one.values["blind"] for one in found.findings]
    # one combination of b and dip is zero by construction: two degrees of freedom are left
    assert found.distance_limit[0] == pytest.approx(distance_limit(3.0, np.array([2]))[0])


def test_declination_of_the_wrong_sign_is_said_to_be_invisible():
    found = judge_fields(with_sensors(stations(30.0, 40.0), MWD), SITE)
    assert found.findings[0].values["blind"] == BLINDNESS["declination"][0]


def test_terms_of_an_error_model_become_sensors():
    bias, scale = sensor_sigmas({"ABX": 1e-3, "ABY": 2e-3, "MBXY_TI1S": 70.0, "MBZ": 30.0, "AMIL": 40.0, "DRFR": 0.35})
    np.testing.assert_allclose(bias, [1e-3, 2e-3, 0.0, 70.0, 70.0, 50.0])
    assert not scale.any()
    with refused("survey-term-contradicts"):
        sensor_sigmas({"MBXY-TI1S": 70.0, "MBXY-TI2S": 80.0})
    with refused("input-missing", names=("ABX .. MSZ",)):
        sensor_sigmas({"DRFR": 0.35})
    with refused("input-repeated", value="sensors"):
        with_sensors(with_sensors(stations(30.0, 40.0), MWD), MWD)


@pytest.mark.parametrize("k", [0.5, 10.0, float("nan")])
def test_k_out_of_range(k):
    with refused("input-value", "input-finite"):
        judge_fields(stations(30.0, 40.0), SITE, k=k)


@pytest.mark.parametrize("values", [
    {}, {"b": 0.0}, {"dip": -1.0}, {"g": float("inf")}, {"g": 10.1}, {"b": 1.01e5}, {"dip": 3.15},
])  # fmt: skip
def test_limits_without_sense(values):
    with refused("input-one-of", "input-value", "input-finite"):
        FieldLimits("mine", "contract", **values)

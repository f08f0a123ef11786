"""What the page on moving tools says in words about the numbers that are worked out for it; few seeds each."""

from importlib import import_module

import numpy as np
import pytest

SEEDS = 2


figures = pytest.fixture(lambda: import_module("support.motion_figures"))


@pytest.fixture
def findings(figures):
    return figures.motion_findings


def test_single_samples_say_nothing(findings):
    found = findings.instantaneous(findings.runs("vibration-5g", SEEDS))
    # a direction drawn from the whole sphere would be off by sqrt(60^2 + 39^2) = 72 deg
    assert found["inclination_deg"] > 45.0
    assert found["azimuth_deg"] > 50.0


def test_the_mean_under_a_taper_beats_the_plain_one_and_from_5_s_on_the_regression(findings):
    cases = findings.runs("vibration-5g", SEEDS)
    hann, plain, fitted = (
        findings.window_rms(cases, 10.0, way)
        for way in (findings.hann_mean, findings.plain_mean, findings.hann_least_squares)
    )
    assert plain[0] > 5.0 * hann[0]
    assert fitted[0] > 1.5 * hann[0]
    assert hann[0] < 0.026  # the reference figure of windows of 10 s


def test_the_regression_finds_gravity_and_lever_arm_exactly_where_nothing_shakes(findings):
    """Independent of vibration: the reductions of the benchmark are themselves right."""
    size = 4000
    phase = 12.0 * np.arange(size) / 200.0 + 2.0 * np.sin(np.arange(size) / 100.0)
    rate = np.gradient(phase, 1.0 / 200.0)
    back = np.exp(1j * phase)
    rows = np.stack([np.ones(size), rate**2 * back, 1j * np.gradient(rate, 1 / 200.0) * back], axis=1)
    gravity = rows @ np.array([3.0 - 4.0j, 0.02 + 0.01j, -0.02 - 0.01j])
    assert findings.hann_least_squares(gravity, rows) == pytest.approx(3.0 - 4.0j, abs=1e-9)
    assert findings.hann_mean(np.full(size, 2.0 + 1.0j)) == pytest.approx(2.0 + 1.0j)
    assert findings.igg3(2.0 + 1.0j + 0.1 * np.exp(1j * np.arange(size))) == pytest.approx(2.0 + 1.0j, abs=1e-3)


def test_decimating_without_a_filter_is_at_least_28_times_worse(findings):
    found = findings.aliasing(SEEDS)
    filtered, bare = (found[f"{way}, vibration to 200 Hz"][0] for way in ("filtered", "not filtered"))
    assert bare > 28.0 * filtered


def test_clipping_costs_what_the_lost_share_of_gravity_is(findings):
    """|x| stays below 8 g with probability erf(8 / 5 sqrt 2) = 0.89: so much of transverse gravity is left."""
    found = findings.clipping(SEEDS)["8 g"]["rms_deg"][0]
    left = 0.89 * np.tan(np.radians(30.0))
    assert found == pytest.approx(30.0 - np.degrees(np.arctan(left)), rel=0.15)


def test_a_circle_through_a_short_arc_errs_by_tens_of_degrees(findings):
    rows = findings.short_arc(SEEDS)
    assert rows[0]["arc_deg"] < 20.0
    assert rows[0]["circle_deg"] > 30.0
    assert rows[-1]["circle_deg"] < 0.1
    assert all(row["left alone_deg"] < 0.6 for row in rows)


def test_weights_on_samples_that_shake_make_them_worse_the_harder_they_weigh(findings):
    none, hard, *_, soft = (row["rms_deg"][0] for row in findings.raw_weights(findings.runs("vibration-5g", SEEDS)))
    assert hard > 2.0 * soft
    assert soft > 5.0 * none


def test_a_first_order_transition_overflows_at_the_rate_it_should(findings):
    """Variances across the axis grow by 1 + (w h)^2 a step; a float ends at exp(709.8)."""
    growth = np.log1p((120.0 * findings.RPM * 0.005) ** 2)
    step = np.eye(6)
    step[:3, :3] -= 0.005 * findings._cross([0.0, 0.0, 120.0 * findings.RPM])
    found = findings._until_overflow(step)
    assert found == pytest.approx((709.8 + np.log(1e2)) / growth, rel=0.01)
    # an exact one never does
    c, s = np.cos(0.0628), np.sin(0.0628)
    step[:2, :2] = [[c, s], [-s, c]]
    assert findings._until_overflow(step) is None


def test_scores_of_a_perfect_and_of_a_wrong_answer(figures):
    """The benchmark's own arithmetic: an error of one standard deviation in every direction scores 1."""
    from inclinometry.motion.result import Attitude
    from inclinometry.rotations import dcm, quaternion_from_dcm, rotation_exp

    bench = figures.motion
    run = bench.simulate_drilling("stick-slip", 1, duration=10.0)
    rows = np.arange(100, 2000, 100)
    truth = run.truth
    e = np.tile(np.radians([0.01, -0.01, 0.01]), (len(rows), 1))
    true = dcm(truth.azimuth[rows], truth.inclination[rows], truth.toolface[rows])
    # dcm = (1 + [e x]) true: the active rotation by e
    turned = np.stack([rotation_exp(one) @ matrix for one, matrix in zip(e, true, strict=True)])
    nothing = np.zeros(len(rows))
    found = Attitude(
        run.time[rows], quaternion_from_dcm(turned), np.tile(np.radians(0.01) ** 2 * np.eye(3), (len(rows), 1, 1)),
        nothing, nothing, nothing.astype(np.uint32), nothing.astype(np.uint8), "magnetic",
    )  # fmt: skip
    e_found, _ = bench.rotation_errors(found, run)
    assert e_found == pytest.approx(e, abs=1e-8)
    assert bench.scored([found], [run])["normalised squared error"] == pytest.approx(1.0, abs=1e-4)


def test_the_scenarios_stay_at_or_below_the_reference_figures(figures):
    """One seed, so that an unlucky one may be half as bad again."""
    bench = figures.motion
    ways = bench.methods()
    for name, seconds in (("vibration-5g", 10), ("vibration-20g", 10), ("smooth", 2)):
        run = bench.simulate_drilling(name, 1)
        one = bench.scored([ways[f"magnetic {seconds} s"](bench.samples_of(run))], [run])
        assert one["inclination_deg"] < 1.5 * bench.REFERENCE[name, seconds][0]
        assert one["azimuth_deg"] < 1.5 * bench.REFERENCE[name, seconds][1]
        assert one["refused"] == 0.0


def test_every_flag_is_explained(figures):
    from inclinometry.motion.result import FLAGS

    text = figures.words()["motion_flags"]
    assert all(f"`{name}`" in text for name in FLAGS)


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["120 rpm, swinging", "120 rpm, even", "400 rpm, even", "stick-slip, 120 rpm", "backward whirl, even"]
)
def test_what_a_drill_string_does_is_covered(figures, name):
    """Twenty tools of three windows that err together: 0.95 of the angles wanted, 0.8 allowed to so few."""
    drilling = figures.honest_drilling
    found = drilling.scored([drilling.reduced(drilling.drawn(name, seed), seed) for seed in range(1, 21)])
    for angle in ("inclination", "azimuth"):
        assert found[angle]["coverage"] > 0.8
        assert 0.1 < found[angle]["z2"] < 2.0
    assert name != "backward whirl, even" or found["doubted"] > 0.95

"""The scale factor over a run against batch regression, dense conditioning of Gaussians, and known truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.errors import InputError
from inclinometry.gyro.joint import earth_in_tool, solve_joint
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.result import FLAGS
from inclinometry.gyro.tracking import (
    ScaleBelief,
    ScaleTracker,
    quadratic_belief,
    smooth_scale,
    track_scale,
    walking_belief,
)
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.gyro import hot_run

LATITUDE = np.radians(45.0)
rad = np.radians
BOTH = pytest.mark.parametrize("follow", [track_scale, smooth_scale])


class Run:
    """Stations well away from K = 0, with a scale drawn from a belief."""

    def __init__(self, seed: int, size: int, belief: ScaleBelief, sigma: float, inclination: Any = (5.0, 35.0)) -> None:
        rng = np.random.default_rng(seed)
        self.temperature = np.linspace(20.0, 140.0, size) + rng.normal(0.0, 1.0, size)
        powers = belief.basis(self.temperature)
        coefficients = rng.multivariate_normal(belief.coefficients, belief.covariance)
        heat = np.append(20.0, self.temperature)
        wander = np.cumsum(belief.walk * np.sqrt(np.abs(np.diff(heat))) * rng.normal(size=size))
        self.scale = powers @ coefficients + wander + belief.jitter * rng.normal(size=size)
        self.inclination, self.azimuth = rad(np.linspace(*inclination, size)), rng.uniform(0.0, 2.0 * np.pi, size)
        model = earth_in_tool(self.azimuth, self.inclination, LATITUDE)[:, :2]
        self.rates = model / self.scale[:, None] + sigma * rng.normal(size=(size, 2))
        self.covariance = np.tile(sigma**2 * np.eye(2), (size, 1, 1))

    @property
    def input(self) -> tuple[Any, ...]:
        return self.rates, self.covariance, self.inclination, LATITUDE, self.temperature

    def own(self) -> tuple[Any, Any]:
        """What each station's rates alone say of its scale: value and variance."""
        found = solve_joint(self.rates, self.covariance, self.inclination, LATITUDE)
        return 1.0 / found.k, found.var_k / found.k**4


def shared(belief: ScaleBelief, temperature: Any) -> Any:
    """Covariance of the scale between stations, jitter left out."""
    powers = belief.basis(temperature)
    walked = np.cumsum(np.abs(np.diff(temperature, prepend=belief.reference_temperature))) * belief.walk**2
    return powers @ belief.covariance @ powers.T + np.minimum.outer(walked, walked)


def conditioned(prior: Any, mean: Any, value: Any, variance: Any, used: Any, asked: int) -> tuple[float, float]:
    """Mean and variance of one station's smooth scale, given the measurements of those used."""
    gain = np.linalg.solve(prior[np.ix_(used, used)] + np.diag(variance[used]), prior[used, asked])
    return mean[asked] + gain @ (value[used] - mean[used]), prior[asked, asked] - gain @ prior[used, asked]


BELIEFS = {
    "quadratic": quadratic_belief(),
    "walk": walking_belief(walk=0.0003),
    "walk, jitter": walking_belief(walk=0.0003, jitter=0.0004),
    "quadratic and walk": quadratic_belief(walk=0.0002),
    "constant": ScaleBelief(np.array([1.001]), np.array([[0.003**2]]), jitter=0.0003),
}


@pytest.mark.parametrize("name", BELIEFS)
def test_online_is_the_regression_on_the_stations_before_and_whole_run_that_on_all_others(name: str) -> None:
    belief = BELIEFS[name]
    run = Run(1, 30, belief, 2e-4)
    value, variance = run.own()
    prior, mean = shared(belief, run.temperature), belief.basis(run.temperature) @ belief.coefficients
    noise = variance + belief.jitter**2
    online, whole = track_scale(*run.input, belief), smooth_scale(*run.input, belief)
    assert online.learnt.all()
    assert whole.learnt.all()
    everyone = np.arange(30)
    for track, used in ((online, lambda n: everyone[:n]), (whole, lambda n: np.delete(everyone, n))):
        for n in range(30):
            expected, spread = conditioned(prior, mean, value, noise, used(n), n)
            total = np.sqrt(spread + belief.jitter**2)
            # joint estimates are Gaussian in k, not in the scale, and their variance is taken at the found azimuth:
            # relative changes of a few sigma_s / s = 1e-3 in the variances
            assert abs(track.expected[n] - expected) < 0.02 * total, (n, track.expected[n], expected, total)
            assert track.expected_sd[n] == pytest.approx(total, rel=0.01)
            own = 1.0 / (1.0 / total**2 + 1.0 / variance[n])
            assert track.scale_sd[n] ** 2 == pytest.approx(own, rel=0.02)
            assert abs(track.scale[n] - own * (expected / total**2 + value[n] / variance[n])) < 0.02 * np.sqrt(own)


@BOTH
def test_what_is_known_afterwards_is_the_linear_regression_of_all_stations(follow: Any) -> None:
    belief = BELIEFS["quadratic"]
    run = Run(2, 40, belief, 2e-4)
    value, variance = run.own()
    powers, noise = belief.basis(run.temperature), variance + belief.jitter**2
    information = np.linalg.inv(belief.covariance) + powers.T / noise @ powers
    mean = np.linalg.solve(
        information, np.linalg.solve(belief.covariance, belief.coefficients) + powers.T @ (value / noise)
    )
    known = follow(*run.input, belief).belief
    sd = np.sqrt(np.diagonal(np.linalg.inv(information)))
    assert (np.abs(known.coefficients - mean) < 0.03 * sd).all()  # as above
    np.testing.assert_allclose(
        known.covariance / np.outer(sd, sd), np.linalg.inv(information) / np.outer(sd, sd), atol=0.03
    )
    assert known.temperature_range == (run.temperature.min(), run.temperature.max())


def hot(seeds: range, noise_deg_h: float) -> Any:
    for seed in seeds:
        run = hot_run(seed, noise=rad(noise_deg_h) / 3600.0)
        size = len(run.a)
        rates = np.stack([run.a, run.b], axis=1)
        yield run, (rates, np.tile(run.noise**2 * np.eye(2), (size, 1, 1)), run.inclination, run.latitude)


@pytest.mark.long
def test_hot_runs_the_scale_learnt_and_its_uncertainty_are_honest() -> None:
    scores: dict[str, list[Any]] = {}
    for run, given in hot(range(40), 0.015):
        for name, follow in (("online", track_scale), ("whole", smooth_scale)):
            track = follow(*given, run.temperature, quadratic_belief())
            found = solve_joint(*given, scale=track.expected, scale_sd=track.expected_sd)
            sure = ~found.weak & ~found.ambiguous
            off = wrap_signed(found.azimuth - run.azimuth)
            scores.setdefault(f"{name} azimuth", []).extend((off / np.sqrt(found.var_azimuth))[sure])
            scores.setdefault(f"{name} expected", []).extend((track.expected - run.scale) / track.expected_sd)
            scores.setdefault(f"{name} scale", []).extend((track.scale - run.scale) / track.scale_sd)
    for name, z in scores.items():
        # 2400 stations; expectations within a run share their errors, so some 40 x 8 independent ones: 2.6 sigma is 0.1
        assert 0.9 < np.sqrt(np.mean(np.square(z))) < 1.1, name


@pytest.mark.long
def test_hot_runs_the_north_estimated_from_the_track_is_honest() -> None:
    z = []
    for run, given in hot(range(40, 60), 0.015):
        track = track_scale(*given, run.temperature, quadratic_belief())
        size = len(run.a)
        rng = np.random.default_rng(size)
        si, ci = np.sin(run.inclination), np.cos(run.inclination)
        g_sd = 1e-4 * STANDARD_GRAVITY
        gravity = STANDARD_GRAVITY * np.stack([-si, 0.0 * si, ci], axis=1) + g_sd * rng.normal(size=(size, 3))
        found = estimate_north(
            gravity, given[0] * EARTH_RATE, run.latitude, gravity_covariance=g_sd**2 * np.eye(3),
            rate_covariance=given[1] * EARTH_RATE**2, scale=track.expected, scale_sd=track.expected_sd,
        )  # fmt: skip
        sure = np.array([not set(f) & {"weak", "ambiguous", "vertical"} for f in found.flags])
        z.extend((wrap_signed(found.azimuth - run.azimuth) / found.u("azimuth"))[sure])
        assert set().union(*found.flags) <= set(FLAGS)
    assert 0.9 < np.sqrt(np.mean(np.square(z))) < 1.1  # 1200 stations: 2.6 sigma of the rms is 0.053, errors shared


@pytest.mark.long
def test_hot_runs_learning_helps_and_the_whole_run_beats_online() -> None:
    errors: dict[str, list[Any]] = {}
    for run, given in hot(range(60, 100), 0.0045):
        use = {"fixed": (1.0, 0.0), "truth": (run.scale, 0.0)}
        for name, follow in (("online", track_scale), ("whole", smooth_scale)):
            track = follow(*given, run.temperature, quadratic_belief())
            use[name] = (track.expected, track.expected_sd)
        for name, (scale, sd) in use.items():
            found = solve_joint(*given, scale=scale, scale_sd=sd)
            errors.setdefault(name, []).extend(wrap_signed(found.azimuth - run.azimuth))
    rms = {name: float(np.sqrt(np.mean(np.square(v)))) for name, v in errors.items()}
    assert rms["truth"] < rms["whole"] < 1.02 * rms["online"]
    assert rms["online"] < 0.35 * rms["fixed"]


@pytest.mark.long
@BOTH
def test_where_the_rates_fix_a_smooth_scale_azimuth_is_as_good_as_with_the_truth(follow: Any) -> None:
    belief, off = quadratic_belief(jitter=0.0), {"found": [], "truth": []}  # type: ignore[var-annotated]
    for seed in range(30):
        run = Run(seed, 60, belief, 3e-4, (2.0, 40.0))
        track = follow(*run.input, belief)
        for name, scale, sd in (("found", track.expected, track.expected_sd), ("truth", run.scale, 0.0)):
            found = solve_joint(*run.input[:4], scale=scale, scale_sd=sd)
            off[name].extend(wrap_signed(found.azimuth - run.azimuth))
    # 2 % of the information is in the first stations of an online run; the same noise, so the ratio is steady to 1 %
    assert np.std(off["found"]) < 1.05 * np.std(off["truth"])


def test_order_of_stations_matters_online_only() -> None:
    belief, order = quadratic_belief(), np.random.default_rng(3).permutation(30)
    run = Run(3, 30, belief, 2e-4)

    def mixed(follow: Any) -> tuple[Any, Any]:
        rates, covariance, inclination, latitude, temperature = run.input
        return follow(*run.input, belief), follow(
            rates[order], covariance[order], inclination[order], latitude, temperature[order], belief
        )

    one, two = mixed(smooth_scale)
    np.testing.assert_allclose(two.expected, one.expected[order], atol=1e-8)  # iterated to 1e-9 of the precisions
    np.testing.assert_allclose(two.expected_sd, one.expected_sd[order], rtol=1e-6)
    np.testing.assert_allclose(two.belief.coefficients, one.belief.coefficients, atol=1e-8)
    early, late = mixed(track_scale)
    assert np.abs(late.expected - early.expected[order]).max() > 1e-4
    # what is known at the end is the same whatever the order
    sd = np.sqrt(np.diagonal(early.belief.covariance))
    assert (np.abs(late.belief.coefficients - early.belief.coefficients) < 0.05 * sd).all()


def test_online_knows_nothing_of_later_stations() -> None:
    run, belief = Run(4, 20, quadratic_belief(), 2e-4), quadratic_belief()
    short = track_scale(*(v if np.ndim(v) == 0 else v[:12] for v in run.input), belief)
    full = track_scale(*run.input, belief)
    # rounding alone: batches of 12 and of 20 may go through other registers
    np.testing.assert_allclose(full.scale[:12], short.scale, rtol=1e-13)
    np.testing.assert_allclose(full.expected_sd[:12], short.expected_sd, rtol=1e-12)


@BOTH
def test_a_run_of_one_expects_what_was_believed(follow: Any) -> None:
    belief = quadratic_belief(1.002)
    run = Run(5, 1, belief, 1e-3)
    track = follow(*run.input, belief)
    expected, sd = belief.predict(run.temperature)
    np.testing.assert_allclose(track.expected, expected, rtol=1e-15)
    np.testing.assert_allclose(track.expected_sd, sd, rtol=1e-12)
    assert len(track) == 1
    assert track.scale_sd[0] < sd[0]


@BOTH
def test_at_one_temperature_stations_are_averaged(follow: Any) -> None:
    belief = ScaleBelief(np.array([1.0]), np.array([[0.01**2]]))
    run = Run(6, 25, belief, 1e-3)
    heat = np.full(25, 20.0)
    track = follow(*run.input[:4], heat, belief)
    value, variance = run.own()
    weight = 1.0 / np.append(variance, 0.01**2)
    wanted = weight @ np.append(value, 1.0) / weight.sum()
    assert abs(track.belief.coefficients[0] - wanted) < 0.05 / np.sqrt(weight.sum())  # variances at the found azimuth
    assert track.belief.covariance[0, 0] == pytest.approx(1.0 / weight.sum(), rel=0.05)


@BOTH
def test_nothing_is_learnt_where_k_is_zero(follow: Any) -> None:
    size, belief = 10, quadratic_belief(sd=0.003)
    inclination = np.full(size, rad(60.0))
    azimuth = np.full(size, np.arccos(-1.0 / np.tan(inclination[0])))
    rng = np.random.default_rng(7)
    noise = 1e-3 * rng.normal(size=(size, 2))
    rates = earth_in_tool(azimuth, inclination, LATITUDE)[:, :2] / 1.003 + noise
    heat = np.linspace(20.0, 30.0, size)
    track = follow(rates, np.tile(1e-6 * np.eye(2), (size, 1, 1)), inclination, LATITUDE, heat, belief)
    # the scale reaches a station only through the curvature: per mille of what was known
    assert (track.scale_sd > 0.9 * track.expected_sd).all()
    assert (
        np.abs(track.belief.coefficients - belief.coefficients) < 0.4 * np.sqrt(np.diagonal(belief.covariance))
    ).all()
    assert np.trace(track.belief.covariance) > 0.8 * np.trace(belief.covariance)


@BOTH
def test_one_station_that_is_far_off_teaches_nothing_and_is_told(follow: Any) -> None:
    belief = quadratic_belief()
    run = Run(8, 30, belief, 2e-4)
    clean = follow(*run.input, belief)
    run.rates[10] *= 1.05
    spoilt = follow(*run.input, belief)
    assert spoilt.learnt.tolist() == [n != 10 for n in range(30)]
    assert "1 of 30" in spoilt.notes[0]
    assert clean.notes == ()
    assert np.abs(spoilt.expected - clean.expected).max() < 0.001


@pytest.mark.long
@BOTH
def test_the_next_run_starts_with_what_this_one_taught(follow: Any) -> None:
    belief = quadratic_belief(sd=0.003, jitter=0.0003)
    fresh, taught = [], []
    for seed in range(20):
        first = Run(seed, 40, belief, 2e-4)
        known = follow(*first.input, belief).belief
        second = Run(seed, 40, belief, 1e-3)  # same draw of the coefficients
        for out, start in ((fresh, belief), (taught, known)):
            track = follow(*second.input, start)
            out.append(((track.expected - second.scale)[:5], track.expected_sd[:5]))
    off = {name: np.sqrt(np.mean([np.square(e) for e, _ in v])) for name, v in (("f", fresh), ("t", taught))}
    assert off["t"] < 0.7 * off["f"]
    z = np.array([e / s for e, s in taught])
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.2  # 20 runs of 5 stations: 2.6 sigma is 0.18


def test_a_scale_that_has_wandered_is_expected_where_it_stands_and_less_surely_away_from_it() -> None:
    fresh = walking_belief(walk=0.0005)
    belief = replace(fresh, wandered=(0.002, 4e-8, 80.0))
    scale, sd = belief.predict([80.0, 100.0, 60.0])
    at_home, known = fresh.predict([20.0, 20.0, 20.0])
    np.testing.assert_allclose(scale, at_home + 0.002, rtol=1e-12)
    np.testing.assert_allclose(sd**2, known**2 + 4e-8 + 0.0005**2 * np.array([0.0, 20.0, 20.0]), rtol=1e-12)


@pytest.mark.long
@BOTH
def test_a_wandering_scale_is_not_believed_where_the_next_run_starts_far_away(follow: Any) -> None:
    belief, z = walking_belief(walk=0.0005), []
    for seed in range(20):
        run = Run(seed, 60, belief, 2e-4)
        known = follow(*run.input, belief).belief
        again = follow(*run.input[:4], run.temperature, known)  # the same hole once more, from 20 degC on
        z.append((again.expected[0] - run.scale[0]) / again.expected_sd[0])
    assert np.sqrt(np.mean(np.square(z))) < 1.5  # 20 draws: 2.6 sigma is 0.4


def test_belief_predicts_the_spread_of_its_own_draws() -> None:
    belief, rng = quadratic_belief(), np.random.default_rng(9)
    draws = rng.multivariate_normal(belief.coefficients, belief.covariance, 4000)
    heat = np.array([0.0, 20.0, 80.0, 140.0])
    scale, sd = belief.predict(heat)
    seen = np.std(draws @ belief.basis(heat).T + belief.jitter * rng.normal(size=(4000, 4)), axis=0)
    np.testing.assert_allclose(sd, seen, rtol=0.03)  # 2.6 sigma of 4000 draws
    np.testing.assert_array_equal(scale, 1.0)


@BOTH
@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        (0, [[np.nan, 0.1]] * 3, "rates"),
        (0, [0.6, -0.7, 0.1], "shape"),
        (1, np.zeros((3, 2, 2)), "positive"),
        (1, np.eye(4), "shape"),
        (2, [0.5, 0.5], "inclination"),
        (2, 4.0, "inclination"),
        (3, 2.0, "latitude"),
        (4, 20.0, "temperature"),
        (4, [20.0, 1e5, 1e6], "temperature"),
        (4, [20.0, 30.0], "2 temperatures for 3 stations"),
        (4, [20.0, np.nan, 30.0], r"temperature\[1\] is nan"),
        (5, quadratic_belief(scale=7.0), "scale"),
    ],
)
def test_wrong_input_is_refused(follow: Any, place: int, value: Any, says: str) -> None:
    use: list[Any] = [
        np.tile([[0.6, -0.7]], (3, 1)), np.tile(1e-6 * np.eye(2), (3, 1, 1)), 0.5, 0.8, [20.0, 30.0, 40.0],
        quadratic_belief(),
    ]  # fmt: skip
    use[place] = value
    with pytest.raises(InputError, match=says):
        follow(*use)


@BOTH
def test_a_scale_known_exactly_is_followed_without_a_warning(follow: Any) -> None:
    belief = quadratic_belief(sd=0.0, slope_sd=0.0, bend_sd=0.0, jitter=0.0)
    run = Run(10, 5, belief, 1e-3)
    track = follow(*run.input, belief)
    np.testing.assert_allclose(track.expected, 1.0, rtol=1e-15)
    assert (track.expected_sd < 1e-8).all()  # of a scale the ninth digit is nobody's business


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ScaleBelief(np.ones(4), np.eye(4)), "1 to 3"),
        (lambda: ScaleBelief(np.ones(2), np.eye(3)), "1 to 3"),
        (lambda: ScaleBelief(np.array([1.0]), np.array([[-1.0]])), "must not be negative"),
        (lambda: ScaleBelief(np.array([np.nan]), np.array([[1.0]])), "nan"),
        (lambda: quadratic_belief(walk=-1.0), "walk is -1; allowed 0"),
        (lambda: quadratic_belief(walk=np.inf), "walk"),
        (lambda: quadratic_belief(jitter=np.nan), "jitter"),
        (lambda: quadratic_belief(reference_temperature=np.nan), "temperature"),
        (lambda: ScaleBelief(np.ones(1), np.eye(1), wandered=(np.nan, 0.0, 20.0)), "wander"),
        (lambda: quadratic_belief(sd=-0.001), "sd"),
        (lambda: quadratic_belief().predict(np.nan), "temperature"),
    ],
)
def test_a_belief_that_makes_no_sense_is_refused(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


def test_the_stream_is_the_run_to_the_last_bit() -> None:
    run = Run(3, 20, quadratic_belief(), 2e-4)
    track = track_scale(*run.input, quadratic_belief())
    tracker = ScaleTracker(quadratic_belief(), LATITUDE)
    given = zip(run.rates, run.covariance, run.inclination, run.temperature, strict=True)
    steps = [tracker.add(*station) for station in given]
    np.testing.assert_array_equal([step.scale for step in steps], track.scale)
    np.testing.assert_array_equal([step.scale_sd for step in steps], track.scale_sd)
    np.testing.assert_array_equal(tracker.belief.covariance, track.belief.covariance)
    # and the azimuths are those of the joint estimate with what was expected
    found = solve_joint(*run.input[:3], LATITUDE, scale=track.expected, scale_sd=track.expected_sd)
    np.testing.assert_array_equal([step.azimuth for step in steps], found.azimuth)
    with pytest.raises(InputError, match="temperature is None; it is needed"):
        tracker.add(run.rates[0], run.covariance[0], 0.1)


@BOTH
@pytest.mark.parametrize("scale", [0.8, 1.0152, 1.05, 1.2])  # 1.0152: five standard uncertainties
def test_a_statement_that_the_readings_contradict_is_widened_and_named(follow: Any, scale: float) -> None:
    belief = quadratic_belief(sd=0.003)
    run = Run(4, 20, ScaleBelief(np.array([scale]), np.array([[0.0]])), 2e-4)
    track = follow(*run.input, belief)
    assert track.prior.coefficients[0] == pytest.approx(scale, abs=2e-3)  # the step of the scales tried
    assert track.prior.covariance[0, 0] ** 0.5 >= abs(scale - 1.0) - 2e-3
    assert any("contradicts the readings" in note for note in track.notes)
    # from the second station on online, everywhere afterwards; u of one station is some 4e-4
    np.testing.assert_allclose(track.scale[2:], scale, atol=3e-3)
    # the same belief where it holds stays as it is
    calm = follow(*Run(4, 20, belief, 2e-4).input, belief)
    assert calm.prior is belief
    assert not calm.notes

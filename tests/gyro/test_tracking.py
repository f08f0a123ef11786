"""The scale factor over a run: its temperatures, what is known before and after, against known truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.gyro.joint import earth_in_tool, solve_joint
from inclinometry.gyro.north import estimate_north
from inclinometry.gyro.point_mass import Rates, solve_law
from inclinometry.gyro.result import FLAGS
from inclinometry.gyro.tracking import ScaleState, ScaleTracker, quadratic_belief, smooth_scale, track_scale
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.gyro import hot_run

LATITUDE = np.radians(45.0)
rad = np.radians
OWN = 0.0005
BOTH = pytest.mark.parametrize("follow", [track_scale, smooth_scale])


class Run:
    """Stations well away from K = 0, with a scale drawn from a belief and 0.0005 of each station's own."""

    def __init__(self, seed: int, size: int, belief: ScaleState, sigma: float, inclination: Any = (5.0, 35.0)) -> None:
        rng = np.random.default_rng(seed)
        self.temperature = np.linspace(20.0, 140.0, size) + rng.normal(0.0, 1.0, size)
        powers = belief.basis(self.temperature)
        coefficients = rng.multivariate_normal(belief.coefficients, belief.covariance)
        self.scale = powers @ coefficients + OWN * rng.normal(size=size)
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


@BOTH
def test_what_is_known_afterwards_is_the_linear_regression_of_all_stations(follow: Any) -> None:
    belief = quadratic_belief()
    run = Run(2, 40, belief, 2e-4)
    value, variance = run.own()
    powers, noise = belief.basis(run.temperature), variance + OWN**2
    information = np.linalg.inv(belief.covariance) + powers.T / noise @ powers
    mean = np.linalg.solve(
        information, np.linalg.solve(belief.covariance, belief.coefficients) + powers.T @ (value / noise)
    )
    known = follow(*run.input, belief).state
    sd = np.sqrt(np.diagonal(np.linalg.inv(information)))
    # a walk that the run does not rule out makes what is known of slope and bend up to twice as wide
    own = np.sqrt(np.diagonal(known.covariance))
    assert (np.abs(known.coefficients - mean) < 1.5 * own).all()
    assert (own > 0.9 * sd).all()
    assert (own[1:] < 2.5 * sd[1:]).all()
    assert known.temperature_range == (run.temperature.min(), run.temperature.max())


def hot(seeds: range, noise_deg_h: float) -> Any:
    for seed in seeds:
        run = hot_run(seed, noise=rad(noise_deg_h) / 3600.0)
        size = len(run.a)
        rates = np.stack([run.a, run.b], axis=1)
        yield run, (rates, np.tile(run.noise**2 * np.eye(2), (size, 1, 1)), run.inclination, run.latitude)


def azimuths(given: Any, track: Any) -> Any:
    rates, covariance, inclination, latitude = given
    high = np.pad(rates, ((0, 0), (0, 1)), constant_values=np.nan)
    wide = np.pad(covariance, ((0, 0), (0, 1), (0, 1)), constant_values=np.nan)
    return solve_law(Rates(high, wide, inclination, latitude), track.law)


@pytest.mark.long
def test_hot_runs_the_scale_learnt_and_its_uncertainty_are_honest() -> None:
    scores: dict[str, list[Any]] = {}
    for run, given in hot(range(20), 0.015):
        for name, follow in (("online", track_scale), ("whole", smooth_scale)):
            track = follow(*given, run.temperature, quadratic_belief())
            found = azimuths(given, track)
            off = wrap_signed(found.found.azimuth - run.azimuth)
            scores.setdefault(f"{name} azimuth", []).extend(off / found.azimuth_sd)
            scores.setdefault(f"{name} expected", []).extend((track.expected - run.scale) / track.expected_sd)
            scores.setdefault(f"{name} scale", []).extend((track.scale - run.scale) / track.scale_sd)
    for name, z in scores.items():
        # 1200 stations; expectations within a run share their errors, some 20 x 8 are independent: 2.6 sigma is 0.14
        # online the next station may be a jump of 3 %, with 0.3 % probability: that alone is 0.0016 of u of what is
        # expected, whose error is 0.001. Its own rates rule the jump out, so u of azimuth and scale holds on both sides
        least = 0.45 if name == "online expected" else 0.86
        assert least < np.sqrt(np.mean(np.square(z))) < 1.14, name


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
            rate_covariance=given[1] * EARTH_RATE**2, scale=track.law,
        )  # fmt: skip
        sure = np.array([not set(f) & {"weak", "ambiguous", "vertical"} for f in found.flags])
        z.extend((wrap_signed(found.azimuth - run.azimuth) / found.u("azimuth"))[sure])
        assert set().union(*found.flags) <= set(FLAGS)
    assert 0.9 < np.sqrt(np.mean(np.square(z))) < 1.1  # 1200 stations: 2.6 sigma of the rms is 0.053, errors shared


@pytest.mark.long
def test_hot_runs_learning_helps_and_the_whole_run_beats_online() -> None:
    errors: dict[str, list[Any]] = {}
    for run, given in hot(range(60, 80), 0.0045):
        found = {name: solve_joint(*given, scale=s, scale_sd=0.0) for name, s in (("fixed", 1.0), ("truth", run.scale))}
        for name, follow in (("online", track_scale), ("whole", smooth_scale)):
            found[name] = azimuths(given, follow(*given, run.temperature, quadratic_belief())).found
        for name, one in found.items():
            errors.setdefault(name, []).extend(wrap_signed(one.azimuth - run.azimuth))
    rms = {name: float(np.sqrt(np.mean(np.square(v)))) for name, v in errors.items()}
    assert rms["truth"] < rms["whole"] < 1.02 * rms["online"]
    assert rms["online"] < 0.35 * rms["fixed"]


def test_online_knows_nothing_of_later_stations() -> None:
    run, belief = Run(4, 20, quadratic_belief(), 2e-4), quadratic_belief()
    short = track_scale(*(v if np.ndim(v) == 0 else v[:12] for v in run.input), belief)
    full = track_scale(*run.input, belief)
    np.testing.assert_array_equal(full.scale[:12], short.scale)
    np.testing.assert_array_equal(full.expected_sd[:12], short.expected_sd)


@BOTH
def test_a_run_of_one_expects_what_was_believed(follow: Any) -> None:
    belief = quadratic_belief(1.002, 0.003, reference_temperature=80.0)
    track = follow([[0.7, -0.1]], [1e-6 * np.eye(2)], 0.1, LATITUDE, [80.0], belief)
    assert track.expected[0] == pytest.approx(
        1.002, abs=1e-3
    )  # the part that may not hold is cut where no rate reaches
    # the statement, and that it may not hold
    assert 0.003 < track.expected_sd[0] < 0.007
    assert len(track) == 1
    assert track.scale_sd[0] < track.expected_sd[0]


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
    # the rates bound the scale only where they fit no azimuth at all: 0.01 here; sigma / |K| would be 0.001
    assert track.scale_sd.min() > 0.003
    assert (np.abs(track.state.coefficients - belief.coefficients) < np.sqrt(np.diagonal(belief.covariance))).all()


@BOTH
def test_one_station_that_is_far_off_moves_no_other(follow: Any) -> None:
    belief = quadratic_belief()
    run = Run(8, 30, belief, 2e-4)
    clean = follow(*run.input, belief)
    run.rates[10] *= 1.05
    spoilt = follow(*run.input, belief)
    assert abs(spoilt.scale[10] * 1.05 - clean.scale[10]) < 0.003
    # online the scale may have moved for good: the station after it is less sure
    others = np.delete(np.arange(30), 10)
    off = np.abs(spoilt.scale - clean.scale)[others] / np.hypot(spoilt.scale_sd, clean.scale_sd)[others]
    assert off.max() < 2.5


@pytest.mark.long
@BOTH
def test_the_next_run_starts_with_what_this_one_taught(follow: Any) -> None:
    belief = quadratic_belief(sd=0.003)
    fresh, taught = [], []
    for seed in range(20):
        first = Run(seed, 40, belief, 2e-4)
        known = follow(*first.input, belief).state
        second = Run(seed, 40, belief, 1e-3)  # same draw of the coefficients
        for out, start in ((fresh, belief), (taught, known)):
            track = follow(*second.input, start)
            out.append(((track.expected - second.scale)[:5], track.expected_sd[:5]))
    # without each station's own deviation, which no other station knows
    off = {name: np.mean([np.square(e) for e, _ in v]) - OWN**2 for name, v in (("f", fresh), ("t", taught))}
    assert off["t"] < 0.7**2 * off["f"]
    z = np.array([e / s for e, s in taught])
    # 20 runs of 5 stations: 2.6 sigma is 0.18. Online the first stations do not yet show how fast the scale walks: all
    # steps up to 3 % are equally probable, and the u of what is expected is four times its error
    assert (0.8 if follow is smooth_scale else 0.2) < np.sqrt(np.mean(z**2)) < 1.2


def test_belief_predicts_the_spread_of_its_own_draws() -> None:
    belief, rng = quadratic_belief(), np.random.default_rng(9)
    draws = rng.multivariate_normal(belief.coefficients, belief.covariance, 4000)
    heat = np.array([0.0, 20.0, 80.0, 140.0])
    scale, sd = belief.predict(heat)
    seen = np.std(draws @ belief.basis(heat).T, axis=0)
    np.testing.assert_allclose(sd, seen, rtol=0.03)  # 2.6 sigma of 4000 draws
    np.testing.assert_array_equal(scale, 1.0)


@BOTH
@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        (0, [[np.nan, 0.1]] * 3, "input-value"),
        (0, [0.6, -0.7, 0.1], "input-shape"),
        (1, np.zeros((3, 2, 2)), "input-covariance"),
        (1, np.eye(4), "input-shape"),
        (2, [0.5, 0.5], "input-shape"),
        (2, 4.0, "input-value"),
        (3, 2.0, "input-value"),
        (4, 20.0, "input-shape"),
        (4, [20.0, 1e5, 1e6], "input-value"),
        (4, [20.0, 30.0], "input-shape"),
        (4, [20.0, np.nan, 30.0], "input-finite"),
        (5, quadratic_belief(scale=7.0), "input-value"),
    ],
)
def test_wrong_input_is_refused(follow: Any, place: int, value: Any, says: str) -> None:
    use: list[Any] = [
        np.tile([[0.6, -0.7]], (3, 1)), np.tile(1e-6 * np.eye(2), (3, 1, 1)), 0.5, 0.8, [20.0, 30.0, 40.0],
        quadratic_belief(),
    ]  # fmt: skip
    use[place] = value
    with refused(says):
        follow(*use)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ScaleState(np.ones(4), np.eye(4)), "input-shape"),
        (lambda: ScaleState(np.ones(2), np.eye(3)), "input-shape"),
        (lambda: ScaleState(np.array([1.0]), np.array([[-1.0]])), "input-value"),
        (lambda: ScaleState(np.array([np.nan]), np.array([[1.0]])), "input-finite"),
        (lambda: quadratic_belief(reference_temperature=np.nan), "input-value"),
        (lambda: quadratic_belief(sd=-0.001), "input-value"),
        (lambda: quadratic_belief().predict(np.nan), "input-finite"),
    ],
)
def test_a_belief_that_makes_no_sense_is_refused(make: Any, says: str) -> None:
    with refused(says):
        make()


def test_the_stream_is_the_run_to_the_last_bit() -> None:
    run = Run(3, 20, quadratic_belief(), 2e-4)
    track = track_scale(*run.input, quadratic_belief())
    tracker = ScaleTracker(quadratic_belief(), LATITUDE)
    given = zip(run.rates, run.covariance, run.inclination, run.temperature, strict=True)
    steps = [tracker.add(*station) for station in given]
    np.testing.assert_array_equal([step.scale for step in steps], track.scale)
    np.testing.assert_array_equal([step.scale_sd for step in steps], track.scale_sd)
    np.testing.assert_array_equal(tracker.state.covariance, track.state.covariance)
    found = azimuths(run.input[:4], track)
    np.testing.assert_allclose([step.azimuth for step in steps], found.found.azimuth, rtol=1e-13)
    np.testing.assert_allclose([step.azimuth_sd for step in steps], found.azimuth_sd, rtol=1e-12)
    with refused("input-missing", names=("temperature",)):
        tracker.add(run.rates[0], run.covariance[0], 0.1)


@BOTH
@pytest.mark.parametrize("scale", [0.8, 1.0152, 1.05, 1.2])  # 1.0152: five standard uncertainties
def test_a_statement_that_the_readings_contradict_is_named(follow: Any, scale: float) -> None:
    belief = quadratic_belief(sd=0.003)
    run = Run(4, 20, ScaleState(np.array([scale]), np.array([[0.0]])), 2e-4)
    track = follow(*run.input, belief)
    assert track.contradicted
    assert "gyro-scale-contradicted" in coded(track.findings)
    # from the third station on online, everywhere afterwards; u of one station is some 4e-4
    np.testing.assert_allclose(track.scale[2:], scale, atol=3e-3)
    calm = follow(*Run(4, 20, belief, 2e-4).input, belief)
    assert not calm.contradicted
    assert not calm.findings


def test_what_is_known_afterwards_holds_at_the_temperatures_of_the_run() -> None:
    belief, z = quadratic_belief(sd=0.003), []
    for seed in range(6):
        run = Run(seed, 30, belief, 2e-4)
        known = smooth_scale(*run.input, belief).state
        scale, sd = known.predict(run.temperature[[0, 15, 29]])
        z.extend((scale - run.scale[[0, 15, 29]]) / np.hypot(sd, OWN))
    # 18 deviates, some shared: three standard uncertainties of their rms
    assert np.sqrt(np.mean(np.square(z))) < 1.6

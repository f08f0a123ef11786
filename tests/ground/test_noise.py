"""Allan deviation and the noise fitted to it: a second implementation, closed forms, and honest uncertainties."""

from __future__ import annotations

import allantools
import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.allan import FLAT, allan_deviation, covariance_tensor, design, fit_noise

DT = 0.1


def flicker(size, rng):
    """Flicker noise with B = 1 averaged over the samples: fractional differences (Kasdin 1995), four to a sample."""
    from scipy.signal import fftconvolve

    k = np.arange(1, 4 * size)
    impulse = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    fine = fftconvolve(impulse, rng.standard_normal(4 * size))[: 4 * size]
    return fine.reshape(size, 4).mean(axis=1)


def record(size, rng, n=1.0, b=0.0, k=0.0):
    white = n / np.sqrt(DT) * rng.standard_normal(size)
    walk = k * np.sqrt(DT) * np.cumsum(rng.standard_normal(size)) if k else 0.0
    return white + walk + (b * flicker(size, rng) if b else 0.0)


def test_equals_allantools():
    rate = 3.0 + np.random.default_rng(1).standard_normal((1001, 2)).cumsum(axis=0)
    curve = allan_deviation(rate, DT)
    for channel in range(2):
        tau, oracle, *_ = allantools.oadev(rate[:, channel], rate=1.0 / DT, data_type="freq", taus=curve.tau)
        np.testing.assert_allclose(curve.tau, tau, rtol=1e-12)
        np.testing.assert_allclose(curve.channel(channel).deviation, oracle, rtol=1e-12)


def test_against_the_definition():
    rate = np.random.default_rng(2).standard_normal(40)
    curve = allan_deviation(rate, 1.0, [5.0])
    means = np.array([rate[k : k + 5].mean() for k in range(36)])
    assert curve.deviation[0] == pytest.approx(np.sqrt(np.mean((means[5:] - means[:-5]) ** 2) / 2.0), rel=1e-12)


def test_a_constant_rate_and_the_unit_do_not_matter():
    rate = np.random.default_rng(3).standard_normal(500)
    one, other = allan_deviation(rate, DT), allan_deviation(7.0 * rate + 100.0, DT)
    # the mean of 1e2 costs two digits
    np.testing.assert_allclose(other.deviation, 7.0 * one.deviation, rtol=1e-11)


def test_a_ramp_follows_its_closed_form():
    curve = allan_deviation(0.3 * np.arange(300) * DT, DT)
    np.testing.assert_allclose(curve.deviation, 0.3 * curve.tau / np.sqrt(2.0), rtol=1e-9)


def test_covariance_of_the_curve_against_all_pairs():
    """Every pair of second differences of a short record, written out as matrices."""
    size, factor = 60, np.array([1, 3, 7, 20])
    t = np.abs(np.subtract.outer(np.arange(size + 1.0), np.arange(size + 1.0)))
    general = (-t / 2.0, t**2 * np.log(np.where(t > 0.0, t, 1.0)) / (2.0 * np.pi), t**3 / 12.0, (t == 0.0) * 1.0)
    differences = []
    for m in factor:
        rows = np.zeros((size + 1 - 2 * m, size + 1))
        for k in range(len(rows)):
            rows[k, [k, k + m, k + 2 * m]] = np.array([1.0, -2.0, 1.0]) / np.sqrt(2.0) / m
        differences.append(rows)
    tensor = covariance_tensor(factor, size)
    for term, g in enumerate(general):
        dumb = [[2.0 * np.mean((a @ g @ b.T) ** 2) for b in differences] for a in differences]
        # 1e-5: flicker beyond 20 differences is its asymptote
        np.testing.assert_allclose(tensor[:, :, term, term], dumb, rtol=1e-5)
        means = [np.mean(np.diagonal(a @ g @ a.T)) for a in differences]
        np.testing.assert_allclose(design(factor.astype(float))[:, term], means, rtol=1e-10)
        slopes = [a @ np.arange(size + 1.0) ** 2 / 2.0 for a in differences]
        dumb = [
            [4.0 * np.mean(np.outer(x, y) * (a @ g @ b.T)) for b, y in zip(differences, slopes, strict=True)]
            for a, x in zip(differences, slopes, strict=True)
        ]
        np.testing.assert_allclose(
            tensor[:, :, term, 4] + tensor[:, :, 4, term], dumb, rtol=1e-4, atol=1e-6 * np.abs(dumb).max()
        )


def test_covariance_of_a_long_record_is_sampled_well_enough():
    """Lags between the kinks are left out; the white term is known in closed form at factor 1: 2 (1 + 1/2) / n."""
    size = 100_000
    tensor = covariance_tensor(np.array([1, 1000]), size)
    assert tensor[0, 0, 0, 0] == pytest.approx(3.0 / (size - 1), rel=1e-4)
    # c of white noise is piecewise linear over +-2 m: 4 int c^2 = 2 m (mean square of the triangle wave)
    u = np.linspace(0.0, 2.0, 100_001)
    shape = np.where(u < 1.0, 1.0 - 1.5 * u, (u - 2.0) / 2.0)
    exact = 4.0 * np.trapezoid(shape**2, u) * 1000 / 1000**2 / (size - 2000)
    assert tensor[1, 1, 0, 0] == pytest.approx(exact, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize("truth", [(1.0, 0.0, 0.0), (1.0, 0.5, 0.0), (1.0, 0.0, 0.15), (1.0, 0.7, 0.2)])
def test_uncertainties_are_honest(truth):
    """Squared errors over stated variance: chi-square over 100 records for N, roughly for B and K where seen."""
    rng, runs = np.random.default_rng(4), 100
    scores, covered = np.full((runs, 3), np.nan), np.zeros((runs, 3), bool)
    for run in range(runs):
        model = fit_noise(allan_deviation(record(10_000, rng, *truth), DT))
        for place, (found, value) in enumerate(zip(model.coefficients.values(), truth, strict=True)):
            covered[run, place] = found.limit >= value
            if found.seen and value:
                scores[run, place] = ((found.value - value) / found.u) ** 2
    # 4 standard deviations of a mean of 100 squares: 0.57
    assert abs(np.mean(scores[:, 0]) - 1.0) < 0.57
    for place in (1, 2):
        if truth[place]:
            assert np.isfinite(scores[:, place]).mean() > 0.8
            assert 0.4 < np.nanmean(scores[:, place]) < 2.0
    # 95 % less 4 standard deviations of a share of 100
    assert (covered.mean(axis=0) > 0.86).all()


@pytest.mark.long
def test_what_is_not_there_is_a_limit():
    rng = np.random.default_rng(5)
    seen = [fit_noise(allan_deviation(record(4000, rng), DT)).rate_random_walk.seen for _ in range(40)]
    # two standard deviations: 2.5 %, chi-square skewness doubles it; 7 of 40 is four standard deviations from 5 %
    assert sum(seen) < 7
    model = fit_noise(allan_deviation(record(4000, rng), DT))
    assert not model.bias_instability.seen
    assert np.isnan(model.bias_instability.value)
    assert 0.0 < model.bias_instability.limit < 1.0


def test_quantisation_and_ramp_are_found():
    rng = np.random.default_rng(6)
    size = 20_000
    angle = 0.2 * rng.standard_normal(size + 1)
    rate = np.diff(angle) / DT + record(size, rng, 0.05) + 1e-3 * np.arange(size) * DT
    model = fit_noise(allan_deviation(rate, DT), quantisation=True, ramp=True)
    # the ramp changes by a thousandth over the record against noise of 1e-3: better than 1 %
    assert model.ramp.value == pytest.approx(1e-3, rel=0.01)
    assert abs(model.quantisation.value - 0.2) < 4.0 * model.quantisation.u
    assert abs(model.angle_random_walk.value - 0.05) < 4.0 * model.angle_random_walk.u
    assert model.chi_square < 40.0 + model.dof


def test_the_fit_follows_units_of_rate_and_time():
    rate = record(8000, np.random.default_rng(7), 1.0, 0.5, 0.1)
    one = fit_noise(allan_deviation(rate, DT))
    other = fit_noise(allan_deviation(3.0 * rate, 100.0 * DT))
    for name, factor in (("angle_random_walk", 30.0), ("bias_instability", 3.0), ("rate_random_walk", 0.3)):
        a, b = getattr(one, name), getattr(other, name)
        # the iteration stops at 1e-9
        assert (b.value, b.u, b.limit) == pytest.approx((factor * a.value, factor * a.u, factor * a.limit), rel=1e-6)


def test_the_model_is_the_sum_of_its_parts():
    model = fit_noise(allan_deviation(record(20_000, np.random.default_rng(8), 1.0, 0.7, 0.1), DT))
    n, b, k = (c.value for c in model.coefficients.values())
    t = np.array([0.5, 20.0, 900.0])
    expected = np.sqrt(n**2 / t + (FLAT * b) ** 2 + k**2 * t / 3.0)
    np.testing.assert_allclose(model.rate_sigma(t), expected, rtol=1e-12)
    np.testing.assert_allclose(model.deviation(t), expected, rtol=1e-12)
    assert model.rate_sigma(20.0).shape == ()
    assert set(model.parts(t)) == set(model.coefficients)


def test_noise_of_another_kind_is_noticed():
    rate = record(10_000, np.random.default_rng(9)) + 1.0 * np.sin(np.arange(10_000) * DT)
    model = fit_noise(allan_deviation(rate, DT))
    assert model.chi_square > 20.0 * model.dof


@pytest.mark.parametrize(
    ("rate", "dt", "taus", "words"),
    [
        ([1.0, 2.0], 1.0, None, "input-shape"),
        ([1.0, np.nan, 2.0], 1.0, None, "input-finite"),
        (np.zeros(9), 0.0, None, "input-value"),
        (np.zeros(9), 1.0, [5.0], "input-value"),
        (np.zeros(9), 1.0, [0.1], "input-value"),
    ],
)
def test_bad_records_are_refused(rate, dt, taus, words):
    with refused(words):
        allan_deviation(rate, dt, taus)


def test_what_cannot_be_fitted_is_refused():
    with refused("allan-short"):
        fit_noise(allan_deviation(np.arange(20.0), 1.0))
    with refused("allan-constant"):
        fit_noise(allan_deviation(np.full(200, 5.0), 1.0))
    with refused("input-shape", name="curve.deviation"):
        fit_noise(allan_deviation(np.random.default_rng(1).standard_normal((200, 2)), 1.0))

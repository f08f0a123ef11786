"""Gyro stations against the Earth's rotation: what must pass, what must fail, what cannot be told."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.errors import InputError
from inclinometry.survey.gyro_quality import MISREAD, SAME_SIGN, rate_checks, rate_unit_suspect, refusal

G = 9.81
SIGMA = np.radians(0.015) / 3600.0
TILT = 1e-4 * G


def stations(latitude_deg, count=30, seed=1, noise=1.0, inclination=(5.0, 70.0)):
    """Gravity and rate in tool axes, station by station, with nothing of the package."""
    random = np.random.default_rng(seed)
    gravity, rate = np.empty((count, 3)), np.empty((count, 3))
    a = np.radians(latitude_deg)
    earth = EARTH_RATE * np.array([np.cos(a), 0.0, -np.sin(a)])
    for row in range(count):
        i = np.radians(random.uniform(*inclination))
        p, t = random.uniform(0.0, 2.0 * np.pi, 2)
        rz = lambda x: np.array([[np.cos(x), np.sin(x), 0], [-np.sin(x), np.cos(x), 0], [0, 0, 1]])  # noqa: E731
        ry = np.array([[np.cos(i), 0, -np.sin(i)], [0, 1, 0], [np.sin(i), 0, np.cos(i)]])
        turn = rz(t) @ ry @ rz(p)
        gravity[row] = turn @ [0.0, 0.0, G] + noise * random.normal(0.0, TILT, 3)
        rate[row] = turn @ earth + noise * random.normal(0.0, SIGMA, 3)
    return gravity, rate


def without_z(field):
    return field * [1.0, 1.0, np.nan]


def judge(gravity, rate, latitude_deg, **more):
    eye = np.broadcast_to(np.eye(3), (len(rate), 3, 3))
    noise = {"gravity_covariance": TILT**2 * eye, "rate_covariance": SIGMA**2 * eye, "g": G}
    return {c.name: c for c in rate_checks(gravity, rate, np.radians(latitude_deg), **{**noise, **more})}


FINE = ["gyro-horizontal-fits", "gyro-latitude-fits", "gyro-sign-fits"]


def verdicts(checks):
    return tuple(checks[name].verdict for name in ("horizontal Earth rate", "latitude", "latitude sign"))


def shapes(gravity, rate):
    return (
        (gravity, rate),
        (gravity, without_z(rate)),
        (without_z(gravity), rate),
        (without_z(gravity), without_z(rate)),
    )


@pytest.mark.long
@pytest.mark.parametrize("latitude", [-75.0, -30.0, 20.0, 60.0])
def test_the_right_latitude_passes_with_two_and_three_axes(latitude):
    for gravity, rate in shapes(*stations(latitude)):
        found = judge(gravity, rate, latitude)
        assert verdicts(found) == ("pass", "pass", "pass"), found
        assert [check.reason.code for check in found.values()] == FINE


def test_a_wrong_latitude_fails_and_the_one_found_is_right():
    gravity, rate = stations(50.0)
    for w in (rate, without_z(rate)):
        found = judge(gravity, w, 52.0)
        assert found["latitude"].verdict == "fail"
        # value is best minus stated; its uncertainty is a third of the limit, 4 of them is once in 16000
        assert abs(found["latitude"].value - np.radians(-2.0)) < 4.0 / 3.0 * found["latitude"].limit
        assert found["latitude sign"].verdict == "pass"
        assert found["latitude"].reason.code == "gyro-latitude-off"
        assert refusal(list(found.values()), np.radians(52.0)) is None
        # of the wrong hemisphere: what mends the sign mends the latitude
        found = judge(gravity, w, -50.0)
        assert found["latitude"].verdict == found["latitude sign"].verdict == "fail"
        said = refusal(list(found.values()), np.radians(-50.0))
        assert (said.code, said.severity) == ("gyro-latitude-sign", "refused")


@pytest.mark.long
@pytest.mark.parametrize("three_axis", [True, False])
def test_the_uncertainty_of_latitude_is_honest(three_axis):
    pulls = []
    for seed in range(60):
        gravity, rate = stations(45.0, 15, seed)
        check = judge(gravity, rate if three_axis else without_z(rate), 45.0)["latitude"]
        pulls.append(3.0 * check.value / check.limit)
    # chi-square of 60 degrees of freedom over 60: 0.51 to 1.64 within 3.3 sigma; residual inflation makes it smaller
    assert 0.4 < np.mean(np.square(pulls)) < 1.64


@pytest.mark.long
def test_a_common_scale_error_is_covered_by_its_uncertainty():
    pulls = []
    for seed in range(40):
        gravity, rate = stations(45.0, 30, seed)
        k = 1.0 + np.random.default_rng(seed + 1000).normal(0.0, 0.01)
        check = judge(gravity, without_z(k * rate), 45.0, scale_sd=0.01)["latitude"]
        pulls.append(3.0 * check.value / check.limit)
    # chi-square band of 40 runs at 3.3 sigma: at most 1.8; the joint treatment may overstate
    assert 0.05 < np.mean(np.square(pulls)) < 1.8


LATITUDE, GRAVITY, GYRO = (-1, 1, 1), (1, -1, 1), (1, 1, -1)


@pytest.mark.long
@pytest.mark.parametrize(("z_gravity", "z_rate"), [(True, True), (True, False), (False, False)])
def test_changes_of_sign_cannot_be_told_apart_and_are_all_named(z_gravity, z_rate):
    gravity, rate = stations(40.0)

    def sign(s, d, w):
        g, r = d * gravity, w * rate
        return judge(g if z_gravity else without_z(g), r if z_rate else without_z(r), 40.0 * s)["latitude sign"]

    found = [sign(*which) for which in (LATITUDE, GRAVITY, GYRO, (-1, -1, -1))]
    for check in found:
        assert check.verdict == "fail"
        assert check.reason.values["mistake"] == SAME_SIGN
    # the same misfit up to the search over azimuth (steps to 1e-4 of a station's standard deviation)
    np.testing.assert_allclose([check.value for check in found], found[0].value, rtol=1e-4)
    # two of them cancel
    for two in ((-1, -1, 1), (-1, 1, -1), (1, -1, -1)):
        assert sign(*two).verdict == "pass"


@pytest.mark.parametrize("count", [3, 30])
def test_with_z_of_the_gyro_alone_reversed_accelerometers_are_told_apart(count):
    gravity, rate = stations(40.0, count)
    for s, d, w in (LATITUDE, GYRO, GRAVITY):
        check = judge(without_z(d * gravity), w * rate, 40.0 * s)["latitude sign"]
        assert check.verdict == "fail"
        assert check.reason.code == ("gyro-accel-sign" if d < 0 else "gyro-latitude-sign")
        assert check.reason.values.get("mistake", ()) in ((), (SAME_SIGN[0], SAME_SIGN[2]))


def test_a_vertical_tool_without_a_gyro_along_it_cannot_tell_the_sign():
    gravity, rate = stations(50.0, inclination=(0.0, 0.01))
    assert judge(gravity, without_z(rate), -50.0)["latitude sign"].verdict == "not judged"
    told = judge(gravity, rate, -50.0)["latitude sign"]
    assert told.verdict == "fail"
    assert told.reason.values["mistake"] == SAME_SIGN
    assert judge(gravity, without_z(rate), 50.0)["latitude"].verdict == "pass"


@pytest.mark.parametrize("latitude", [-30.0, 60.0])
def test_a_vertical_tool_without_a_gyro_along_it_knows_the_latitude_as_well_as_the_scale(latitude):
    gravity, rate = stations(latitude, 5, noise=0.0, inclination=(0.0, 0.01))
    check = judge(gravity, without_z(rate), latitude, scale_sd=0.01)["latitude"]
    # k cos(latitude) is all that is seen; the scale of a station is its own and one that all share, three of each
    share = np.sqrt(1.0 + 1.0 / 5.0)
    assert check.limit == pytest.approx(3.0 * 0.01 * share / np.tan(np.radians(abs(latitude))), rel=0.03)


def test_the_equator_has_no_sign():
    assert judge(*stations(0.0), 0.0)["latitude sign"].verdict == "not judged"


def test_a_single_station_of_two_axes_determines_no_latitude():
    gravity, rate = stations(50.0, 1)
    assert judge(gravity, without_z(rate), 50.0)["latitude"].verdict == "not judged"
    assert judge(gravity, rate, 50.0)["latitude"].verdict == "pass"


def test_horizontal_runs_without_a_gyro_along_the_tool_are_not_judged():
    gravity, rate = stations(50.0, inclination=(89.99, 90.01))
    assert judge(gravity, without_z(rate), 50.0)["horizontal Earth rate"].verdict == "not judged"
    assert judge(gravity, rate, 50.0)["horizontal Earth rate"].verdict == "pass"


@pytest.mark.long
@pytest.mark.parametrize("latitude", [90.0, -90.0])
def test_at_a_pole_nothing_is_not_finite_by_accident(latitude):
    for gravity, rate in shapes(*stations(latitude)):
        found = judge(gravity, rate, latitude)
        assert found["horizontal Earth rate"].verdict == "not judged"
        assert found["latitude"].verdict == "pass"


def test_a_disturbed_station_is_named_and_a_wrong_scale_blamed_on_all():
    gravity, rate = stations(45.0)
    rate[7] *= 1.05
    check = judge(gravity, rate, 45.0)["horizontal Earth rate"]
    assert (check.verdict, check.stations) == ("fail", (7,))
    assert (check.reason.code, check.reason.values["station"]) == ("gyro-horizontal", "8")
    check = judge(gravity, 1.05 * rate, 45.0)["horizontal Earth rate"]
    assert len(check.stations) > 20
    assert check.reason.code == "gyro-horizontal"
    # a scale that is stated undoes it
    assert judge(*stations(45.0)[:1], 1.05 * stations(45.0)[1], 45.0, scale=1 / 1.05)["latitude"].verdict == "pass"


def test_a_station_fails_where_its_horizontal_rate_leaves_the_limit_that_is_told():
    gravity, rate = stations(45.0, 1, noise=0.0)
    # of two axes the horizontal rate is all that a station tells: what is chance and what is not are one limit
    for share, verdict in ((0.97, "pass"), (1.03, "fail")):
        size = 1e-3
        for _ in range(5):
            check = judge(gravity, without_z((1.0 + size) * rate), 45.0)["horizontal Earth rate"]
            size *= share * check.limit / check.value
        assert check.value == pytest.approx(share * check.limit, rel=1e-3)
        assert check.verdict == verdict


@pytest.mark.parametrize("three_axis", [True, False])
def test_the_uncertainty_of_the_horizontal_rate_is_honest(three_axis):
    from inclinometry.survey import gyro_quality

    gravity, rate = stations(45.0, 2000, inclination=(5.0, 50.0))
    scale = 1.0 + np.random.default_rng(9).normal(0.0, 0.002, (2000, 1))
    eye = np.broadcast_to(np.eye(3), (2000, 3, 3))
    shown = scale * rate if three_axis else without_z(scale * rate)
    read = gyro_quality._readings(gravity, shown, TILT**2 * eye, SIGMA**2 * eye, 1.0, 0.002, G)
    found, sd = gyro_quality._horizontal(read, np.radians(45.0))
    pull = np.mean(np.square((found - np.cos(np.radians(45.0))) / sd))
    # chi-square of 2000: standard deviation sqrt(2/2000) = 0.032
    assert abs(pull - 1.0) < 0.12


@pytest.mark.parametrize(("latitude", "seed"), [(30.0, 1), (60.0, 2)])
def test_hardly_any_noise_hides_no_valley_of_the_azimuth(latitude, seed):
    """A hundredth of the usual noise: valleys of the misfit are narrower than the grid in which they are looked for."""
    gravity, rate = stations(latitude, 60, seed, 0.01, (0.0, 180.0))
    eye = np.broadcast_to(1e-4 * np.eye(3), (60, 3, 3))
    noise = {"gravity_covariance": TILT**2 * eye, "rate_covariance": SIGMA**2 * eye}
    assert verdicts(judge(gravity, without_z(rate), latitude, scale_sd=0.01, **noise)) == ("pass", "pass", "pass")


def test_a_rate_shown_in_another_unit_and_its_scale_are_the_same_stations():
    gravity, rate = stations(45.0)
    eye = np.broadcast_to(np.eye(3), (30, 3, 3))
    given = judge(gravity, rate, 45.0)
    for scale in (0.3, 2.5):
        shown = judge(gravity, rate / scale, 45.0, scale=scale, rate_covariance=(SIGMA / scale) ** 2 * eye)
        for name, check in given.items():
            assert shown[name].value == pytest.approx(check.value, rel=1e-6, abs=1e-9), name
            assert shown[name].verdict == check.verdict


def test_a_faultless_run_of_many_stations_passes():
    assert verdicts(judge(*stations(45.0, 1500), 45.0)) == ("pass", "pass", "pass")


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"latitude_deg": 91.0}, "input-value"),
        ({"scale": 0.0}, "input-value"),
        ({"scale_sd": -0.1}, "input-value"),
        ({"rate_covariance": np.zeros((30, 3, 3))}, "input-covariance"),
        ({"gravity_covariance": np.full((30, 3, 3), np.nan)}, "input-covariance"),
        ({"g": None, "gravity": without_z(stations(1.0)[0])}, "input-needs"),
        ({"gravity": stations(1.0, 29)[0]}, "input-shape"),
        ({"rate": stations(1.0)[1] * [np.nan, 1, 1]}, "input-value"),
    ],
)
def test_bad_input_is_refused(change, code):
    gravity, rate = stations(1.0)
    with refused(code):
        judge(**{"gravity": gravity, "rate": rate, "latitude_deg": 1.0, **change})


@pytest.mark.parametrize("three", [2, 3])
def test_mistakes_of_unit_are_named(three):
    rate = stations(45.0)[1][:, :three]
    assert rate_unit_suspect(rate) is None
    for name, factor in MISREAD:
        assert name in rate_unit_suspect(rate / factor).values["cause"]
    assert rate_unit_suspect(rate + 1e-3).values["cause"][-1] == "the tool moved"
    assert rate_unit_suspect(0.01 * rate).values["cause"][-1] == "the tool is nearly parallel to the Earth's axis"
    assert rate_unit_suspect(1e-9 * rate).values["cause"] == ("no usual mistake of unit",)
    assert rate_unit_suspect(0.0 * rate).code == "gyro-channels-zero"


def test_the_plausible_range_includes_its_ends():
    for edge, inside, outside in ((0.02, 1.0001, 0.9999), (5.0, 0.9999, 1.0001)):
        assert rate_unit_suspect([[edge * inside * EARTH_RATE, 0.0]]) is None
        assert rate_unit_suspect([[edge * outside * EARTH_RATE, 0.0]])
    for bad in ([], [1.0, 2.0], [[np.nan, 1.0]]):
        with pytest.raises(InputError):
            rate_unit_suspect(bad)

"""Averages over index positions: exact without noise, honest with it, and spikes are named."""

import numpy as np
import pytest
from scipy import stats
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.gyro.indexing import SCHEMES, Noise, average_index
from inclinometry.rotations import rotation_z

FOUR = np.radians([0.0, 90.0, 180.0, 270.0])
MIRRORED = np.radians(SCHEMES["mirrored"].positions_deg)


def rows(stations, positions, field, *, channels=2, bias=0.0, drift=0.0, noise=0.0, interval=60.0, seed=1):
    """Readings of a perfect triad, written out reading by reading."""
    rng = np.random.default_rng(seed)
    station, index, time, signals = [], [], [], []
    for s in range(stations):
        for k, angle in enumerate(positions):
            t = (k - (len(positions) - 1) / 2) * interval
            seen = rotation_z(angle) @ np.atleast_2d(field)[s % len(np.atleast_2d(field))]
            station.append(s + 1)
            index.append(angle)
            time.append(1e4 * s + t)
            signals.append(seen[:channels] + bias + drift * t + noise * rng.standard_normal(channels))
    return np.array(station), np.array(index), np.array(signals), np.array(time)


def test_one_x_sensor_at_four_positions_is_the_half_difference_of_the_patent():
    rng = np.random.default_rng(3)
    signals = rng.normal(size=(4 * 50, 1))
    found = average_index(np.repeat(np.arange(50), 4), np.tile(FOUR, 50), signals, scheme="four", noise=[1.0])
    xp, yp, xm, ym = signals.reshape(50, 4).T
    expected = np.stack([(xp - xm) / 2, (yp - ym) / 2], axis=-1)
    np.testing.assert_allclose(found.field[:, :2], expected, atol=1e-14)  # rounding of numbers about 1
    # half a difference of two readings: variance 1/2, nothing in common
    np.testing.assert_allclose(found.covariance[:, :2, :2], np.broadcast_to(np.eye(2) / 2, (50, 2, 2)), atol=1e-14)
    np.testing.assert_allclose(found.bias[:, 0], signals.reshape(50, 4).mean(axis=1), atol=1e-14)
    assert np.isnan(found.field[:, 2]).all()
    np.testing.assert_array_equal(found.dof, 1.0)


def test_two_sensors_at_four_positions_halve_the_variance_again():
    station, index, signals, _ = rows(3, FOUR, [3.0, -4.0, 5.0], bias=np.array([7.0, -2.0]), noise=0.1)
    found = average_index(station, index, signals, scheme="four", noise=[0.1, 0.1])
    x, y = signals.reshape(3, 4, 2).transpose(2, 0, 1)
    v_x = (x[:, 0] - x[:, 2] - y[:, 1] + y[:, 3]) / 4
    v_y = (x[:, 1] - x[:, 3] + y[:, 0] - y[:, 2]) / 4
    np.testing.assert_allclose(found.field[:, :2], np.stack([v_x, v_y], -1), atol=1e-13)
    np.testing.assert_allclose(found.covariance[0, 0, 0], 0.01 / 4)


@pytest.mark.parametrize(
    ("scheme", "positions", "drift"),
    [
        ("two", FOUR[[0, 2]], 0.0),
        ("four", FOUR, 0.0),
        ("mirrored", MIRRORED, 1e-3),
        ("n", np.radians([10.0, 130.0, 250.0]), 0.0),
        ("n", np.radians([0, 77, 201, 340, 15, 100, 290.0]), -2e-3),
        ("carousel", np.linspace(0.0, 12 * np.pi, 300), 5e-3),
    ],
)
def test_bias_and_drift_do_not_reach_the_field(scheme, positions, drift):
    fields = np.array([[3.0, -4.0, 5.0], [0.1, 0.2, -9.0]])
    station, index, signals, time = rows(4, positions, fields, channels=3, bias=np.array([7.0, -2.0, 0.0]))
    signals[:, :2] += drift * (time - 1e4 * (station - 1))[:, None]
    found = average_index(station, index, signals, scheme=scheme, time=time, noise=[0.1, 0.1, 0.1])
    np.testing.assert_allclose(found.field, fields[[0, 1, 0, 1]], atol=1e-10)  # rounding of times of 1e4 s
    np.testing.assert_allclose(found.bias, [[7.0, -2.0, 0.0]] * 4, atol=1e-10)
    np.testing.assert_allclose(found.drift[:, :2], drift, atol=1e-12)
    assert set(found.flags) == {()}


def test_a_drift_spoils_four_positions_and_not_the_mirrored_order():
    d = 1e-3
    four = rows(1, FOUR, [1.0, 0.0, 0.0], channels=1, drift=d)
    found = average_index(*four[:3], scheme="four", noise=[1.0])
    # by hand: the second reading of each pair is 120 s later
    np.testing.assert_allclose(found.field[0, :2] - [1.0, 0.0], [-60.0 * d, -60.0 * d], atol=1e-15)
    mirrored = rows(1, MIRRORED, [1.0, 0.0, 0.0], channels=1, drift=d)
    without = average_index(*mirrored[:3], time=mirrored[3], scheme="mirrored", drift=False, noise=[1.0])
    fitted = average_index(*mirrored[:3], time=mirrored[3], scheme="mirrored", noise=[1.0])
    for average in (without, fitted):  # the order alone removes it, the fit costs nothing
        np.testing.assert_allclose(average.field[0, :2], [1.0, 0.0], atol=1e-14)
        np.testing.assert_allclose(average.covariance[0, :2, :2], np.eye(2) / 4, atol=1e-14)


def test_against_plain_least_squares_with_skewed_sensors_and_unequal_noise():
    rng = np.random.default_rng(5)
    tensor = rng.normal(size=(2, 4, 3))
    offset, sd = rng.normal(size=(2, 4)), rng.uniform(0.5, 2.0, (18, 4))
    prior = np.array([0.3, 0.2, np.inf, 0.0])
    tensor[:, 2, 2] *= 0.01  # the third, whose bias is free, lies across
    index, time = rng.uniform(0, 2 * np.pi, 18), np.sort(rng.uniform(0, 100, 18))
    station = np.repeat([4, 2], 9)
    signals = rng.normal(size=(18, 4))
    found = average_index(
        station, index, signals, scheme="n", time=time, noise=sd, tensor=tensor, offset=offset, offset_sd=prior,
        sweep=0.4,
    )  # fmt: skip
    damp = np.diag([np.sin(0.2) / 0.2, np.sin(0.2) / 0.2, 1.0])
    for place in range(2):
        use = slice(9 * place, 9 * place + 9)
        equations, right = [], []
        for angle, t, row, noise in zip(index[use], time[use] - time[use].mean(), signals[use], sd[use], strict=True):
            for j in range(4):
                bias, drift = np.eye(4)[j], np.eye(4)[j] * t
                part = np.concatenate([tensor[place, j] @ rotation_z(angle) @ damp, bias, drift])
                equations.append(part / noise[j])
                right.append((row[j] - offset[place, j]) / noise[j])
        for j, known in enumerate(prior):
            if np.isfinite(known):
                equations.append(np.eye(11)[3 + j] / max(known, 1e-6))
                right.append(0.0)
        matrix = np.array(equations)
        best = np.linalg.lstsq(matrix, np.array(right), rcond=None)[0]
        # the dumb version approximates an exactly known bias by one known to 1e-6
        np.testing.assert_allclose(found.field[place], best[:3], atol=1e-8)
        np.testing.assert_allclose(found.covariance[place], np.linalg.inv(matrix.T @ matrix)[:3, :3], atol=1e-8)
        np.testing.assert_allclose(found.drift[place], best[7:], atol=1e-8)
        np.testing.assert_allclose(found.bias[place], best[3:7] + offset[place], atol=1e-8)
        assert found.dof[place] == 36 + 2 - 10  # a bias known exactly is no unknown
        np.testing.assert_allclose(found.chi_square[place], np.sum((matrix @ best - right) ** 2), rtol=1e-6)


def test_stations_do_not_know_each_other_and_turning_the_index_turns_the_field():
    station, index, signals, _ = rows(5, FOUR, [3.0, -4.0, 5.0], noise=0.3)
    all_at_once = average_index(station, index, signals, scheme="n", noise=[0.3, 0.3])
    pick = station == 4
    alone = average_index(station[pick], index[pick], signals[pick], scheme="n", noise=[0.3, 0.3])
    np.testing.assert_allclose(alone.field[0], all_at_once.field[3], rtol=1e-13)
    turned = average_index(station, index + 0.7, signals, scheme="n", noise=[0.3, 0.3])
    back = all_at_once.field[:, :2] @ rotation_z(-0.7)[:2, :2].T
    np.testing.assert_allclose(turned.field[:, :2], back, atol=1e-12)


def test_sweep_restores_what_averaging_over_an_angle_takes():
    # readings averaged numerically over the turn of each: the mean of the cosine over 30 deg
    steps, turn = 20000, np.radians(30.0)
    fine = (np.arange(12 * steps) + 0.5) / steps * turn
    mean = np.cos(fine).reshape(12, steps).mean(axis=1)[:, None]
    middle = (np.arange(12) + 0.5) * turn
    found = average_index(np.ones(12, int), middle, mean, scheme="n", noise=[1.0], sweep=turn)
    np.testing.assert_allclose(found.field[0, :2], [1.0, 0.0], atol=1e-9)  # midpoint rule, (turn/steps)^2/24


def test_noise_is_estimated():
    station, index, signals, time = rows(400, MIRRORED, [3.0, -4.0, 0.0], noise=np.array([0.1, 0.4]))
    found = average_index(station, index, signals, scheme="mirrored", time=time)
    # 400 stations of 16 readings and 6 unknowns: 2000 a channel and so 1.6 % on the sd; 4 sd
    np.testing.assert_allclose(found.noise, [0.1, 0.4], rtol=0.065)
    assert found.noise_freedom == pytest.approx(4000.0)
    spread = (found.field[:, :2] - [3.0, -4.0]) / np.sqrt(np.diagonal(found.covariance[:, :2, :2], axis1=1, axis2=2))
    assert np.mean(spread**2) == pytest.approx(1.0, abs=0.2)  # 800 values: 0.05 each sd
    # the likeness of the channels draws very different noises together by 1e-3 each
    assert np.mean(found.chi_square / found.dof) == pytest.approx(1.0, abs=5e-3)
    few = average_index(station[:8], index[:8], signals[:8], scheme="mirrored", time=time[:8])
    assert few.noise_freedom == pytest.approx(10.0)


def test_chi_square_is_that_of_its_degrees_of_freedom():
    station, index, signals, _ = rows(3000, FOUR, [1.0, 2.0, 0.0], noise=0.2)
    found = average_index(station, index, signals, scheme="four", noise=[0.2, 0.2])
    np.testing.assert_array_equal(found.dof, 4.0)
    assert found.chi_square.mean() == pytest.approx(4.0, abs=4 * np.sqrt(8 / 3000))
    assert sum(map(bool, found.flags)) == 0  # chance of any in the file: 0.1 % each for two tests; this seed has none


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("scheme", "positions"), [("four", FOUR), ("mirrored", MIRRORED)])
def test_one_spike_is_left_out_and_named(known, scheme, positions):
    station, index, signals, time = rows(40, positions, [3.0, -4.0, 0.0], noise=0.1)
    row = 7 * len(positions) + 2
    clean = average_index(station, index, signals, scheme=scheme, time=time, noise=[0.1, 0.1])
    signals[row, 1] += 5.0
    found = average_index(station, index, signals, scheme=scheme, time=time, noise=[0.1, 0.1] if known else None)
    assert found.left_out == ((8, row),)
    assert [place for place, flags in enumerate(found.flags) if flags] == [7]
    assert found.flags[7] == ("spike",)
    np.testing.assert_allclose(found.field[7, :2], [3.0, -4.0], atol=5 * 0.1)  # and not off by a quarter of 5
    assert found.covariance[7, 0, 0] > clean.covariance[7, 0, 0] * 0.9
    assert found.dof[7] == clean.dof[7] - 2
    np.testing.assert_allclose(found.noise, 0.1, rtol=0.4)  # 80 degrees of freedom a channel at least: 4 sd of 8 %


def test_a_spike_that_cannot_be_told_apart_is_only_noisy():
    station, index, signals, _ = rows(20, FOUR, [3.0, -4.0, 0.0], channels=1, noise=0.1)
    signals[9, 0] += 5.0  # with one sensor all four positions explain it equally well
    found = average_index(station, index, signals, scheme="four", noise=[0.1])
    assert found.left_out == ()
    assert found.flags[2] == ("noisy",)
    assert sum(map(bool, found.flags)) == 1
    ratio = found.covariance[2, 0, 0] / found.covariance[0, 0, 0]
    assert ratio == pytest.approx(found.chi_square[2] / found.dof[2])


def test_a_single_station_finds_its_own_spike_without_being_told_the_noise():
    station, index, signals, _ = rows(1, np.linspace(0, 4 * np.pi, 24, endpoint=False), [3.0, -4.0, 0.0], noise=0.1)
    signals[5, 0] += 3.0
    found = average_index(station, index, signals, scheme="n")
    assert found.left_out == ((1, 5),)
    assert found.flags == (("spike",),)
    np.testing.assert_allclose(found.noise, 0.1, rtol=0.6)  # 20 degrees of freedom a channel


def test_several_spikes_in_a_long_rotation():
    turns = np.linspace(0.0, 20 * np.pi, 400)
    station, index, signals, time = rows(10, turns, [3.0, -4.0, 0.0], channels=1, noise=0.1, interval=1.0)
    spoilt = [15, 120, 333, 2100]
    signals[spoilt, 0] += [3.0, -2.0, 2.5, 9.0]
    found = average_index(station, index, signals, scheme="carousel", time=time)
    assert [row for _, row in found.left_out] == spoilt
    np.testing.assert_allclose(found.noise, 0.1, rtol=0.05)  # 4000 readings: 4 sd


def test_readings_without_any_noise_raise_no_flags():
    station, index, signals, _ = rows(30, FOUR, np.random.default_rng(1).normal(size=(30, 3)), bias=100.0)
    found = average_index(station, index, signals, scheme="four")
    assert set(found.flags) == {()}


def test_readings_that_are_all_zero_do_no_harm():
    station, index, signals, _ = rows(3, FOUR, [0.0, 0.0, 0.0])
    found = average_index(station, index, signals, scheme="four")
    np.testing.assert_array_equal(found.field[:, :2], 0.0)


def test_stations_with_different_numbers_of_rows_keep_their_own_tensor():
    rng = np.random.default_rng(8)
    counts, field = [5, 3, 9, 5, 3, 7], np.array([3.0, -4.0, 5.0])
    tensor = np.eye(3) + 0.1 * rng.normal(size=(6, 3, 3))
    bias = np.array([7.0, -2.0, 0.5])
    parts = [rows(1, np.linspace(0.1, 6.0, count), field, channels=3) for count in counts]
    station, index = np.repeat(np.arange(6) * 10, counts), np.concatenate([part[1] for part in parts])
    which = np.repeat(np.arange(6), counts)
    signals = np.einsum("kij,kjl,l->ki", tensor[which], rotation_z(index), field) + bias
    options = {"scheme": "n", "time": np.arange(len(index)) * 1.0, "noise": [0.1] * 3, "tensor": tensor}
    found = average_index(station, index, signals, offset=[0.0, 0.0, 0.5], **options)
    np.testing.assert_allclose(found.field, [field] * 6, atol=1e-12)
    np.testing.assert_allclose(found.bias, [bias] * 6, atol=1e-11)
    # 3 m readings; 3 field, 2 biases, and where there are six readings 3 drifts
    np.testing.assert_array_equal(found.dof, [10, 4, 19, 10, 4, 13])
    back = average_index(station[::-1], index[::-1], signals[::-1], scheme="n", noise=[0.1] * 3, tensor=tensor[::-1])
    assert len(back) == 6  # any order of stations


@pytest.mark.long
@pytest.mark.parametrize("noise", [None, [1.0, 1.0]])
def test_clean_files_are_hardly_ever_accused(noise):
    rng = np.random.default_rng(6)
    accused = 0
    for _ in range(200):
        signals = rng.normal(size=(48, 2))
        found = average_index(np.repeat(np.arange(12), 4), np.tile(FOUR, 12), signals, scheme="four", noise=noise)
        accused += any(found.flags)
    assert accused <= 3  # two tests at 0.1 % a file: 0.4 expected, more than 3 once in a thousand


def test_a_doubtful_reading_is_judged_by_the_noise_of_the_others():
    """One left out of an ordinary regression: the variance without it, its externally studentised residual."""
    rng = np.random.default_rng(5)
    design, size = np.c_[np.ones(9), rng.normal(size=(9, 2))], 9
    y = rng.normal(size=size)
    hat = design @ np.linalg.pinv(design)
    residual = y - hat @ y
    dof = size - 3.0
    variance = residual @ residual / dof
    drop = residual**2 / (1.0 - np.diagonal(hat)) / variance
    noise, one = Noise(np.ones(1), dof, inside=True), np.ones(size)
    without = np.empty(size)
    for row in range(size):
        rest = np.delete(np.arange(size), row)
        left = y[rest] - design[rest] @ np.linalg.lstsq(design[rest], y[rest], rcond=None)[0]
        without[row] = left @ left / (dof - 1.0)
    np.testing.assert_allclose(noise.shrunk(drop, one), without / variance, rtol=1e-10)
    studentised = drop * variance / without
    np.testing.assert_allclose(noise.tail(drop, one), 2.0 * stats.t.sf(np.sqrt(studentised), dof - 1.0), rtol=1e-10)
    # noise that is given, or estimated from many other stations, is not changed by one reading
    for other in (Noise(np.ones(1)), Noise(np.ones(1), dof)):
        np.testing.assert_array_equal(other.shrunk(drop, one), one)
    np.testing.assert_allclose(Noise(np.ones(1)).tail(drop, one), stats.chi2.sf(drop, 1), rtol=1e-10)
    np.testing.assert_allclose(Noise(np.ones(1), dof).tail(drop, one), stats.f.sf(drop, 1, dof), rtol=1e-10)
    assert Noise(np.ones(1), dof).widening == pytest.approx(stats.t(dof).var())


def test_a_known_bias_along_the_tool_limits_what_is_known_of_z():
    station, index, signals, _ = rows(2, FOUR, [3.0, -4.0, 5.0], channels=3)
    found = average_index(station, index, signals, scheme="four", noise=[0.1] * 3, offset_sd=[np.inf, np.inf, 0.5])
    np.testing.assert_allclose(found.covariance[:, 2, 2], 0.01 / 4 + 0.25)
    np.testing.assert_allclose(found.field[:, 2], 5.0)
    known = average_index(station, index, signals, scheme="four", noise=[0.1] * 3)
    np.testing.assert_allclose(known.covariance[:, 2, 2], 0.01 / 4)


def test_repeats_in_place_and_whole_cycles_are_the_same_scheme():
    for positions in (np.repeat(FOUR, 3), np.tile(FOUR, 2)):
        station, index, signals, _ = rows(2, positions, [3.0, -4.0, 5.0])
        found = average_index(station, index, signals, scheme="four", noise=[0.1, 0.1])
        np.testing.assert_allclose(found.field[:, :2], [[3.0, -4.0]] * 2, atol=1e-13)


def test_the_angle_read_is_used_and_not_the_nominal_one():
    positions = FOUR + np.radians([0.5, -0.4, 0.9, 0.1])
    station, index, signals, _ = rows(1, positions, [3.0, -4.0, 5.0])
    found = average_index(station, index, signals, scheme="four", noise=[0.1, 0.1])
    np.testing.assert_allclose(found.field[0, :2], [3.0, -4.0], atol=1e-13)


def call(scheme, degrees, *, channels=2, stations=1, **options):
    station, index, signals, time = rows(stations, np.radians(degrees), [3.0, -4.0, 5.0], channels=channels, noise=0.1)
    options.setdefault("noise", [0.1] * channels)
    if options.pop("timed", False):
        options["time"] = time
    return average_index(station, index, signals, scheme=scheme, **options)


@pytest.mark.parametrize(
    ("scheme", "degrees", "options", "code"),
    [
        ("six", [0, 90], {}, "input-choice"),
        ("two", [0, 180], {"channels": 1}, "gyro-positions-blind"),
        ("four", [0, 90, 180], {}, "gyro-positions-other"),
        ("four", [0, 180, 90, 270], {}, "gyro-positions-other"),
        ("four", [0, 90, 180, 272], {}, "gyro-positions-other"),
        ("four", [0, 90, 180, 180], {}, "gyro-positions-other"),
        ("mirrored", [0, 90, 180, 270, 0, 90, 180, 270], {"timed": True}, "gyro-positions-other"),
        ("mirrored", SCHEMES["mirrored"].positions_deg, {}, "gyro-time-missing"),
        ("carousel", range(0, 360, 10), {}, "gyro-time-missing"),
        ("n", [0, 120, 120.3], {}, "gyro-positions-few"),
        ("n", [0, 120], {}, "gyro-positions-few"),
        ("carousel", [0, 90, 180, 270] * 3, {"timed": True}, "gyro-positions-few"),
        ("two", [0, 180], {"noise": None}, "gyro-noise-unknown"),
        ("four", [0, 90, 180, 270], {"time": [0, 1, 1, 2]}, "input-order"),
        ("four", [0, 90, 180, 270], {"noise": [0.1, 0.0]}, "input-value"),
        ("four", [0, 90, 180, 270], {"noise": [0.1]}, "input-shape"),
        ("four", [0, 90, 180, 270], {"channels": 3, "offset_sd": [1, 1, np.inf]}, "gyro-offset-along"),
        ("four", [0, 90, 180, 270], {"offset_sd": [1, -1]}, "input-value"),
        ("four", [0, 90, 180, 270], {"offset": np.zeros((7, 2))}, "input-shape"),
        ("four", [0, 90, 180, 270], {"tensor": np.zeros((2, 3))}, "sensor-vector-zero"),
        ("four", [0, 90, 180, 270], {"sweep": 7.0}, "input-value"),
    ],
)
def test_what_cannot_be_used_is_named_with_the_remedy(scheme, degrees, options, code):
    with refused(code) as caught:
        call(scheme, degrees, **options)
    if code.startswith(("input-", "sensor-")):  # codes of any argument name the one refused
        assert caught.value.finding.values["name"].partition("[")[0] in (options or ["scheme"])


def test_columns_that_do_not_go_together():
    with refused("gyro-station-again"):
        average_index([1, 2, 1], [0.0, 2.0, 4.0], np.zeros((3, 2)), scheme="n")
    with refused("input-shape", name="signals"):
        average_index([1, 1, 1], [0.0, 2.0, 4.0], np.zeros((4, 2)), scheme="n")
    with refused("input-missing", names=("tensor",)):
        average_index([1, 1, 1], [0.0, 2.0, 4.0], np.zeros((3, 4)), scheme="n")
    with refused("input-shape", name="station"):
        average_index([1.5, 1, 1], [0.0, 2.0, 4.0], np.zeros((3, 2)), scheme="n")


def test_the_bad_station_is_named_among_good_ones():
    station, index, signals, _ = rows(5, FOUR, [3.0, -4.0, 5.0], noise=0.1)
    index[[13, 14]] = index[[14, 13]]
    with pytest.raises(InputError) as caught:
        average_index(station, index, signals, scheme="four", noise=[0.1, 0.1])
    needed = (0.0, 90.0, 180.0, 270.0)
    wanted = {"station": 4, "scheme": "four", "needed_deg": needed, "index_deg": (0.0, 180.0, 90.0, 270.0)}
    assert caught.value.finding.values == wanted

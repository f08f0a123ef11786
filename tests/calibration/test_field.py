"""Field calibration: simulated tools come back within an honest covariance; real cave instruments beat the peer."""

from __future__ import annotations

import json
from importlib.resources import files

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import fdtri
from tests.refusals import coded, fits, refused

from inclinometry.calibration._field_model import (
    Estimate,
    FieldProblem,
    Shots,
    Unknowns,
    bad_shots,
    estimate,
    first_levels,
    rotations,
    tangent,
    turned,
)
from inclinometry.calibration.field import _begin, _shots, calibrate_field, cube, rotations_between
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import IdentifiabilityError

DIP = np.radians(68.0)
SCALE = {"accelerometer": 9.8, "magnetometer": 48e3}


def roll_matrix(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def simulated(rng, free=24, sets=2, rolls=8, noise=0.002, pointing=0.005, skew=0.03, sensors=3, mount=None):
    """Readings and the true {kind: (tensor, offset)}; `mount` turns the magnetometer's sensors."""
    attitude = list((cube()[rng.permutation(24)] @ Rotation.random(random_state=rng).as_matrix())[:free])
    attitude = [Rotation.from_rotvec(rng.normal(0, 0.2, 3)).as_matrix() @ r for r in attitude]
    roll_set = [""] * len(attitude)
    for s in range(sets):
        base = Rotation.random(random_state=rng).as_matrix()
        for i in range(rolls):
            tilt = Rotation.from_rotvec([*rng.normal(0, pointing, 2), 0.0]).as_matrix()
            attitude.append(roll_matrix(2 * np.pi * i / rolls + rng.normal(0, 0.1)) @ tilt @ base)
            roll_set.append(str(s + 1))
    attitude = np.array(attitude)
    fields = {"accelerometer": [0.0, 0.0, 1.0], "magnetometer": [np.cos(DIP), 0.0, np.sin(DIP)]}
    channels, truth = {}, {}
    for kind, f in fields.items():
        axes = np.eye(3) if sensors == 3 else np.vstack([np.eye(3), rng.normal(size=(sensors - 3, 3))])
        if mount is not None and kind == "magnetometer":
            axes = axes @ mount
        tensor = SCALE[kind] * (axes + rng.normal(0, skew, (sensors, 3)))
        offset = SCALE[kind] * rng.normal(0, 0.05, sensors)
        clean = attitude @ f @ tensor.T + offset
        channels[kind] = clean + rng.normal(0, noise * SCALE[kind], clean.shape)
        truth[kind] = tensor, offset
    return BenchReadings(channels, roll_set=roll_set), truth


def in_canonical_axes(truth):
    """The true parameters turned about z as the convention says."""
    n = next(iter(truth.values()))[0]
    n = n / np.linalg.norm(n, axis=1, keepdims=True)
    turn = roll_matrix(np.arctan2(n[0, 1] - n[1, 0], n[0, 0] + n[1, 1]))
    return {kind: (tensor @ turn.T, offset) for kind, (tensor, offset) in truth.items()}


def vector(truth):
    return np.concatenate([np.column_stack([n, u]).ravel() for n, u in truth.values()])


def fitted(calibration):
    return {kind: (t.tensor[0], t.offset[0]) for kind, t in calibration.tool.triads.items()}


def normalised_square(calibration, truth):
    """Squared error in the metric of the covariance, and its dimension (the gauge is taken out)."""
    miss = vector(fitted(calibration)) - vector(in_canonical_axes(truth))
    sd = np.sqrt(np.diagonal(calibration.tool.covariance))
    values, vectors = np.linalg.eigh(calibration.tool.covariance / np.outer(sd, sd))
    keep = values > 1e-9
    return float(np.sum((vectors.T @ (miss / sd))[keep] ** 2 / values[keep])), int(keep.sum())


def kept_by_convention(calibration, convention):
    """The convention's value, and its standard uncertainty as a share of what its parts have by themselves."""
    kind, triad = next(iter(calibration.tool.triads.items()))

    def value(x):
        n = x.reshape(-1, 4)[:, :3]
        return convention(n / np.linalg.norm(n, axis=1, keepdims=True))

    x = np.column_stack([triad.tensor[0], triad.offset[0]]).ravel()
    step = 1e-6 * SCALE[kind]
    slope = np.array([(value(x + e) - value(x - e)) / (2.0 * step) for e in step * np.eye(len(x))])
    own = calibration.tool.covariance[calibration.tool.slices[kind], calibration.tool.slices[kind]]
    return value(x), np.sqrt(abs(slope @ own @ slope) / (slope**2 @ np.diagonal(own)))


def cave(name):
    """Shots of a cave instrument in tool axes: instrument Z, X, Y become x, y, z."""
    text = files("inclinometry.workflow").joinpath("demo_data", "sap6_cave", f"{name}.json").read_text()
    raw = json.loads(text)
    mag, grav = np.array(raw["mag"]) * [1, 1, -1], np.array(raw["grav"])
    grav = np.column_stack([-grav[:, 1], -grav[:, 0], grav[:, 2]])
    return grav[:, [2, 0, 1]], mag[:, [2, 0, 1]]


def cave_scores(name, train, held_out):
    """Spread of the tool axis and scatter of the dip, degrees, over held-out rolls at one target."""
    grav, mag = cave(name)
    channels = {"accelerometer": grav[train], "magnetometer": mag[train]}
    tool = calibrate_field(BenchReadings(channels, roll_set=[""] * 8 + ["1"] * 8)).tool
    down = tool.triads["accelerometer"].field(grav[held_out])
    b = tool.triads["magnetometer"].field(mag[held_out])
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    east = np.cross(down, b)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    axis = np.column_stack([np.cross(east, down)[:, 2], east[:, 2], down[:, 2]])
    mean = axis.mean(axis=0) / np.linalg.norm(axis.mean(axis=0))
    apart = np.degrees(np.arctan2(np.linalg.norm(np.cross(axis, mean), axis=1), axis @ mean))
    dip = np.degrees(np.arcsin(np.sum(down * b, axis=1)))
    return np.array([np.sqrt(np.mean(apart**2)), dip.std()])


FREE, FIRST, SECOND = np.arange(8), np.arange(8, 16), np.arange(16, 24)


@pytest.mark.parametrize(("name", "spread"), [("BB", 0.72), ("CF", 0.53), ("FG", 1.20), ("HC", 0.27)])
def test_cave_instruments_held_out(name, spread):
    assert cave_scores(name, np.r_[FREE, FIRST], SECOND)[0] <= spread


# the published figures are means over both ways round: either roll set held out. HC is 0.287 there, its peer 0.286:
# with all 24 shots in the fit it is still 0.265, the hand's share.
@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "spread", "dip"), [("BB", 0.72, 0.25), ("CF", 0.53, 0.27), ("FG", 1.20, 0.34), ("HC", 0.29, 0.44)]
)
def test_cave_instruments_both_ways_round(name, spread, dip):
    one = cave_scores(name, np.r_[FREE, FIRST], SECOND)
    other = cave_scores(name, np.r_[FREE, SECOND], FIRST)
    assert np.all((one + other) / 2 <= [spread, dip])


def test_the_badly_pointed_shot_of_instrument_fg_is_named():
    """Shot 13 points 5 degrees beside its seven companions."""
    grav, mag = cave("FG")
    readings = BenchReadings(
        {"accelerometer": grav, "magnetometer": mag},
        roll_set=[""] * 8 + ["1"] * 8 + ["2"] * 8,
        station=[f"shot {i}" for i in range(24)],
    )
    odd = {"what": "pointing", "station": "shot 13"}
    assert any(fits(one, ["fit-shot-odd"], odd) for one in calibrate_field(readings).findings)


@pytest.mark.long
@pytest.mark.parametrize(
    "options", [{"free": 8, "sets": 2}, {"free": 16, "sets": 1}, {"noise": 3e-4, "pointing": 5e-4, "rolls": 4}]
)
def test_covariance_is_honest(options):
    """Normalised squared error over 24 simulated tools within the 99.9 % chi-square band, noise levels estimated."""
    squares, size = [], 0
    for seed in range(24):
        readings, truth = simulated(np.random.default_rng(seed), **options)
        square, size = normalised_square(calibrate_field(readings), truth)
        squares.append(square)
    assert size == 23
    # four standard deviations of a mean of 24; upwards also the share of estimating three levels from some 25 squares
    band = 4 * np.sqrt(2 * size / 24)
    assert size - band < np.mean(squares) < (size + band) * 1.15


@pytest.mark.long
def test_noise_and_pointing_levels_are_found():
    found = []
    for seed in range(8):
        readings, _ = simulated(np.random.default_rng(100 + seed), sets=4)
        calibration = calibrate_field(readings)
        noise = [calibration.tool.noise[k][0] / SCALE[k] for k in SCALE]
        found.append([*noise, calibration.rig.nuisance["pointing"][0]])
    # t scale is 0.9 of the normal's; 8 campaigns of some 60 degrees of freedom know each level to 6 %
    np.testing.assert_allclose(np.mean(found, axis=0), [0.0018, 0.0018, 0.0045], rtol=0.15)


def test_exact_readings_come_back():
    readings, truth = simulated(np.random.default_rng(1), noise=0.0, pointing=0.0)
    calibration = calibrate_field(readings)
    for kind, (tensor, offset) in in_canonical_axes(truth).items():
        triad = calibration.tool.triads[kind]
        # what is left is the pull of the priors against readings trusted to 1e-5
        np.testing.assert_allclose(triad.tensor[0], tensor, atol=1e-6 * SCALE[kind])
        np.testing.assert_allclose(triad.offset[0], offset, atol=1e-6 * SCALE[kind])
        assert np.abs(calibration.residuals.values[kind]).max() < 1e-5 * SCALE[kind]
    assert calibration.rig.nuisance["dip"][0] == pytest.approx(DIP, abs=1e-6)
    # what is set by convention is not uncertain, and what the others are by it; central differences good to 1e-9
    off, share = kept_by_convention(calibration, lambda n: n[0, 1] - n[1, 0])
    assert abs(off) < 1e-12
    assert share < 1e-4
    # without a reference the sign of gravity is an assumption, and said
    assert [(one.code, one.severity) for one in calibration.findings] == [("fit-force-assumed", "warning")]


@pytest.mark.long
@pytest.mark.parametrize("index", range(24))
def test_any_mounting_of_the_magnetometer_is_found(index):
    readings, truth = simulated(np.random.default_rng(7), mount=cube()[index])
    calibration = calibrate_field(readings)
    assert normalised_square(calibration, truth)[0] < 60  # chi-square of 23 exceeds this once in 3e4
    named = any(fits(one, ["bench-axes-exchanged"], {"kind": "magnetometer"}) for one in calibration.findings)
    assert named == (not np.allclose(cube()[index], np.eye(3)))


def test_five_sensors():
    readings, truth = simulated(np.random.default_rng(3), sensors=5, noise=1e-3)
    square, size = normalised_square(calibrate_field(readings), truth)
    assert size == 39
    assert square < 85  # chi-square of 39 exceeds this once in 3e4


@pytest.mark.parametrize("kind", ["accelerometer", "magnetometer"])
def test_one_triad_alone(kind):
    readings, truth = simulated(np.random.default_rng(4), sets=3)
    alone = BenchReadings({kind: readings.channels[kind]}, roll_set=readings.roll_set)
    calibration = calibrate_field(alone)
    square, size = normalised_square(calibration, {kind: truth[kind]})
    assert size == 11
    assert square < 38  # chi-square of 11 exceeds this once in 1e4
    assert "dip" not in calibration.rig.nuisance
    assert calibration.parameter_names == calibration.tool.parameter_names


def test_specific_force_by_option_and_by_the_reference_dip():
    readings, truth = simulated(np.random.default_rng(5))
    channels = {**readings.channels, "accelerometer": -readings.channels["accelerometer"]}
    tensor, offset = truth["accelerometer"]
    truth = {"accelerometer": (-tensor, -offset), "magnetometer": truth["magnetometer"]}
    told = calibrate_field(BenchReadings(channels, roll_set=readings.roll_set), specific_force=True)
    found = calibrate_field(BenchReadings(channels, roll_set=readings.roll_set, reference={"dip": 1.1}))
    np.testing.assert_allclose(vector(fitted(told)), vector(fitted(found)), rtol=1e-9)
    # the convention for x uses where the sensors point, not the sign of what they read
    flipped = {k: (n * (-1 if k == "accelerometer" else 1), u) for k, (n, u) in truth.items()}
    expected = in_canonical_axes(flipped)["accelerometer"][0]
    np.testing.assert_allclose(found.tool.triads["accelerometer"].tensor[0], -expected, atol=0.05)
    assert any(fits(one, ["fit-force-assumed"], {"what": "specific force"}) for one in found.findings)
    wrong = calibrate_field(
        BenchReadings(channels, roll_set=readings.roll_set, reference={"dip": 1.1}), specific_force=False
    )
    assert "fit-dip-off" in coded(wrong.findings)


def test_a_magnetic_object_beside_one_shot_is_named_and_does_little_harm():
    readings, truth = simulated(np.random.default_rng(6), noise=1e-3)
    b = readings.channels["magnetometer"].copy()
    b[5] += [3000.0, -2000.0, 1500.0]
    bad = BenchReadings({**readings.channels, "magnetometer": b}, roll_set=readings.roll_set)
    calibration = calibrate_field(bad)
    assert any(fits(one, ["fit-shot-odd"], {"station": "6", "what": "magnetometer"}) for one in calibration.findings)
    assert normalised_square(calibration, truth)[0] < 60
    assert abs(calibration.residuals.standardised["magnetometer"][5]).max() > 10


def test_a_badly_pointed_roll_is_named():
    readings, _ = simulated(np.random.default_rng(8), sets=3)
    away = Rotation.from_rotvec([0.1, 0.0, 0.0]).as_matrix()
    channels = {k: v.copy() for k, v in readings.channels.items()}
    channels["accelerometer"][26] = away @ channels["accelerometer"][26]
    channels["magnetometer"][26] = away @ channels["magnetometer"][26]
    found = calibrate_field(BenchReadings(channels, roll_set=readings.roll_set)).findings
    assert any(fits(one, ["fit-shot-odd"], {"what": "pointing", "station": "27"}) for one in found)


def test_a_clean_campaign_names_a_shot_once_in_a_hundred_and_a_wild_one_comes_first():
    random, free = np.random.default_rng(23), np.tile([2.2, 2.2, 1.3], (24, 1))

    def named(square, free=free):
        return bad_shots(Estimate(None, None, square, free, (8.0 + free) / (8.0 + square), ()))

    # squares in units of a scale of t, whose square is 0.82 of the variance: so weighted they are as many as expected
    clean = [named(random.chisquare(free) / 0.82) for _ in range(4000)]
    assert 15 < sum(map(bool, clean)) < 65  # 40 of 4000, and four standard deviations
    wild = random.chisquare(free) / 0.82
    wild[5, 1], wild[17, 2], wild[3, 0] = 100.0, 60.0, 200.0
    assert named(wild) == [(3, 0), (5, 1), (17, 2)]
    # nothing to compare with, nothing that the fit leaves: not judged
    alone = np.where(np.arange(24)[:, None] < 1, free, 0.0)
    assert named(wild, free=alone) == []
    absorbed = free.copy()
    absorbed[3, 0] = 1e-3
    assert named(wild, free=absorbed) == [(5, 1), (17, 2)]


def test_units_do_not_matter():
    readings, _ = simulated(np.random.default_rng(9))
    one = calibrate_field(readings)
    channels = {k: 1e-3 * v for k, v in readings.channels.items()}
    other = calibrate_field(BenchReadings(channels, roll_set=readings.roll_set))
    np.testing.assert_allclose(1e-3 * vector(fitted(one)), vector(fitted(other)), rtol=1e-6, atol=1e-9)


def test_turning_the_world_changes_nothing():
    """Stations come in any order and the rolls start anywhere: the answer is the same."""
    readings, _ = simulated(np.random.default_rng(10))
    order = np.random.default_rng(0).permutation(len(readings))
    shuffled = calibrate_field(readings.take(order))
    one = vector(fitted(calibrate_field(readings)))
    sd = np.sqrt(np.diagonal(shuffled.tool.covariance))
    np.testing.assert_allclose(one, vector(fitted(shuffled)), atol=0.02 * sd.max())


def test_given_sd_weights_readings():
    readings, truth = simulated(np.random.default_rng(11), noise=1e-3)
    sd = {k: np.where(np.arange(len(readings))[:, None] % 2, 2.0, 1.0) * np.ones((1, 3)) for k in SCALE}
    channels = {
        k: v + 1e-3 * SCALE[k] * np.sqrt(3) * np.random.default_rng(12).normal(size=v.shape) * (sd[k] > 1)
        for k, v in readings.channels.items()
    }
    calibration = calibrate_field(BenchReadings(channels, roll_set=readings.roll_set, sd=sd))
    assert normalised_square(calibration, truth)[0] < 60
    # noisy ones deviate by twice as much, and by as much of their own standard deviation
    left = calibration.residuals.standardised["accelerometer"]
    assert np.nanstd(left[1::2]) == pytest.approx(np.nanstd(left[::2]), rel=0.25)


def test_a_wild_shot_tells_no_more_than_one_left_out():
    """The one that points most along the tool, by which the sensor along it is known best."""
    readings, _ = simulated(np.random.default_rng(4), free=12, sets=3)
    gravity = readings.channels["accelerometer"]
    row = int(np.abs(gravity[:12, 2]).argmax())
    wild = gravity.copy()
    wild[row] += [3.0, -2.0, 4.0]
    kept = [i for i in range(len(gravity)) if i != row]

    def known(signals, rows):
        rolls = [readings.roll_set[i] for i in rows]
        tool = calibrate_field(BenchReadings({"accelerometer": signals[rows]}, roll_set=rolls)).tool
        return np.sqrt(np.diagonal(tool.covariance)[10:]) / tool.noise["accelerometer"][2]

    np.testing.assert_allclose(known(wild, list(range(len(gravity)))), known(gravity, kept), rtol=0.02)


def test_rotations_between_two_triads_are_distinct_and_the_right_one_is_first():
    random = np.random.default_rng(26)
    a, true = random.normal(size=(20, 3)), Rotation.random(random_state=27).as_matrix()
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    # b at one angle to each a, whichever way about it
    across = np.cross(a, random.normal(size=(20, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    found = rotations_between(a, (0.8 * a + 0.6 * across) @ true)
    np.testing.assert_allclose(found[0], true, atol=1e-6)
    assert len(found) > 1
    apart = [Rotation.from_matrix(q @ other.T).magnitude() for n, q in enumerate(found) for other in found[:n]]
    assert np.degrees(min(apart)) > 3.0


def test_gyro_lone_sets_and_temperature_are_said():
    readings, _ = simulated(np.random.default_rng(13))
    channels = {**readings.channels, "gyro": np.zeros((len(readings), 3))}
    rolls = ["alone", *list(readings.roll_set)[1:]]
    warm = np.linspace(20, 25, len(readings))
    calibration = calibrate_field(BenchReadings(channels, roll_set=rolls, temperature=warm, reference={"b": 48e3}))
    assert any(fits(one, ["fit-unused"], {"kind": "gyro"}) for one in calibration.findings)
    assert any(fits(one, ["fit-roll-single"], {"sets": ("alone",)}) for one in calibration.findings)
    assert calibration.tool.temperature_range == (20.0, 25.0)
    assert calibration.tool.triads["magnetometer"].field_strength == 48e3
    assert calibration.method == "field"
    assert np.all((calibration.residuals.leverage >= 0) & (calibration.residuals.leverage <= 1))


def one_sided(readings):
    keep = [i for i in range(len(readings)) if readings.channels["accelerometer"][i, 2] > 2.0]
    return readings.take(keep)


def test_refusals_in_words():
    readings, _ = simulated(np.random.default_rng(14))
    with refused("fit-no-rolls", error=IdentifiabilityError):
        calibrate_field(BenchReadings(readings.channels))
    with refused("fit-one-side", error=IdentifiabilityError):
        calibrate_field(one_sided(readings))
    few = readings.take([0, 0, 1, 1, *range(24, 28)])
    with pytest.raises(IdentifiabilityError):
        calibrate_field(few)
    with refused("input-one-of"):
        calibrate_field(BenchReadings({"gyro": np.zeros((5, 3))}))
    with refused("input-few", count=2):
        calibrate_field(BenchReadings({"magnetometer": np.zeros((5, 2))}))
    for name, value in (("axis_angle_sd", 1.1), ("axis_angle_sd", 0.9e-4), ("scale_spread_sd", 1.1)):
        with refused("input-value", name=name):
            calibrate_field(readings, **{name: value})
    two = [i for i in range(len(readings)) if i < 26]
    lone = {"accelerometer": readings.channels["accelerometer"][two]}
    with refused("fit-undetermined", error=IdentifiabilityError):
        calibrate_field(BenchReadings(lone, roll_set=[readings.roll_set[i] for i in two]))


def test_noise_that_drowns_the_parameters_is_refused():
    readings, _ = simulated(np.random.default_rng(20), free=8, sets=1, noise=0.1)
    # across the tool axis one roll set and few free shots tell least: a sensor's axis, not its offset
    with refused("fit-shots-few", error=IdentifiabilityError, shots=16, sets=("1",)) as raised:
        calibrate_field(readings)
    assert raised.value.finding.values["parameter"].values["axis"] in "xy"


def test_too_few_rolls_to_tell_the_pointing_error():
    readings, _ = simulated(np.random.default_rng(21), sets=1, rolls=2)
    assert any(fits(one, ["fit-noise-expected"], {"of": "pointing"}) for one in calibrate_field(readings).findings)


def test_shots_that_leave_a_parameter_open_are_refused():
    """Two roll sets 10 degrees apart and nothing else: the scale along the tool axis is a guess."""
    rng = np.random.default_rng(15)
    attitude = []
    for tilt in (1.5, 1.7):
        base = Rotation.from_euler("yx", [tilt, 0.3]).as_matrix()
        attitude += [roll_matrix(a) @ base for a in np.arange(8) * np.pi / 4]
    fields = {"accelerometer": [0, 0, 1.0], "magnetometer": [np.cos(DIP), 0, np.sin(DIP)]}
    channels = {k: np.array(attitude) @ f + rng.normal(0, 0.003, (16, 3)) for k, f in fields.items()}
    with pytest.raises(IdentifiabilityError):
        calibrate_field(BenchReadings(channels, roll_set=["1"] * 8 + ["2"] * 8))


@pytest.fixture
def problem():
    rng = np.random.default_rng(16)
    readings, truth = simulated(rng, free=4, sets=2, rolls=3, sensors=4)
    signals = [readings.channels[k] / SCALE[k] for k in SCALE]
    member = np.array([-1] * 4 + [0] * 3 + [1] * 3)
    shots = Shots(list(SCALE), signals, [np.ones_like(s) for s in signals], member, 2)
    pointing = rng.normal(size=(2, 3))
    at = Unknowns(
        [truth[k][0] / SCALE[k] for k in SCALE],
        [truth[k][1] / SCALE[k] for k in SCALE],
        0.9,
        pointing / np.linalg.norm(pointing, axis=1, keepdims=True),
        Rotation.random(10, random_state=rng).as_matrix(),
    )
    return FieldProblem(shots, (0.1, 0.1), first_levels(2, member)), at


def moved(at, shots, step, turn):
    """A second, plain way to step: shared parameters by `step`, attitudes by `turn`."""
    tensors, offsets = [], []
    for columns, tensor, offset in zip(shots.columns, at.tensors, at.offsets, strict=True):
        block = step[columns].reshape(-1, 4)
        tensors.append(tensor + block[:, :3])
        offsets.append(offset + block[:, 3])
    tilt = step[shots.tool + 1 :].reshape(-1, 2)
    pointing = at.pointing + np.einsum("sij,sj->si", tangent(at.pointing), tilt)
    pointing /= np.linalg.norm(pointing, axis=1, keepdims=True)
    return Unknowns(tensors, offsets, at.dip + step[shots.tool], pointing, rotations(turn) @ at.attitude)


def test_rotations_are_those_of_their_vectors():
    vectors = np.random.default_rng(24).normal(size=(20, 3)) * np.geomspace(1e-12, 3.0, 20)[:, None]
    vectors[0] = 0.0
    np.testing.assert_allclose(rotations(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-14)


def test_a_step_moves_what_is_shared_and_each_attitude_to_its_best_place(problem):
    problem, at = problem
    shots = problem.shots
    step = 1e-3 * np.random.default_rng(25).normal(size=problem.size)
    ahead = problem.retract(at, step)
    # of all turns of an attitude that of least squares with the residuals that the step leaves, and the ridge
    linear = problem.linear(at)
    left = linear.residual + linear.shared @ step
    turn = np.zeros((len(shots.member), 3))
    for k, latent in enumerate(linear.latent):
        rows = np.vstack([latent, 0.1 * np.eye(3)])
        turn[k] = np.linalg.lstsq(rows, -np.append(left[k], np.zeros(3)), rcond=None)[0]
    plain = moved(at, shots, step, turn)
    for name in ("tensors", "offsets", "dip", "pointing", "attitude"):
        np.testing.assert_allclose(getattr(ahead, name), getattr(plain, name), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(ahead.pointing, axis=1), 1.0, atol=1e-14)


def test_slopes_against_finite_differences(problem):
    problem, at = problem
    shots, size = problem.shots, problem.size
    linear = problem.linear(at)
    h = 1e-6  # truncation 1e-12 and rounding 1e-10 of residuals of some hundreds
    for p in range(shots.tool + 1):
        step = h * np.eye(size)[p]
        ahead = problem.linear(moved(at, shots, step, np.zeros((10, 3)))).residual
        back = problem.linear(moved(at, shots, -step, np.zeros((10, 3)))).residual
        np.testing.assert_allclose((ahead - back) / (2 * h), linear.shared[:, :, p], atol=1e-4)
    for axis in range(3):
        turn = h * np.tile(np.eye(3)[axis], (10, 1))
        ahead = problem.linear(moved(at, shots, np.zeros(size), turn)).residual
        back = problem.linear(moved(at, shots, np.zeros(size), -turn)).residual
        np.testing.assert_allclose((ahead - back) / (2 * h), linear.latent[:, :, axis], atol=1e-4)


def test_prior_slopes_against_finite_differences():
    rng = np.random.default_rng(17)
    shots = Shots(["magnetometer"], [rng.normal(size=(5, 3))], [np.ones((5, 3))], np.zeros(5, int), 1)
    problem = FieldProblem(shots, (0.1, 0.2), first_levels(1, shots.member))
    at = Unknowns(
        [np.eye(3) + rng.normal(0, 0.2, (3, 3))], [np.zeros(3)], 0.0, np.array([[0, 0, 1.0]]), np.eye(3)[None]
    )
    rows = problem._prior_rows(at)
    lengths = np.linalg.norm(at.tensors[0], axis=1)
    axes, logs = at.tensors[0] / lengths[:, None], np.log(lengths)
    # each pair of axes once, about 90 degrees; each scale about their mean
    wanted = [*(logs - logs.mean()) / 0.2, *(axes @ axes.T)[np.triu_indices(3, 1)] / 0.1]
    np.testing.assert_allclose([value for value, _ in rows], wanted, rtol=1e-12)
    for p in range(shots.tool):
        step = 1e-6 * np.eye(problem.size)[p]
        ahead = [v for v, _ in problem._prior_rows(moved(at, shots, step, np.zeros((1, 3))))]
        back = [v for v, _ in problem._prior_rows(moved(at, shots, -step, np.zeros((1, 3))))]
        np.testing.assert_allclose((np.array(ahead) - back) / 2e-6, [s[p] for _, s in rows], atol=1e-7)


def test_a_block_tells_what_student_s_t_of_eight_degrees_of_freedom_tells():
    """Expected information of a location in q dimensions, of normal noise of the same scale, by its integral."""
    shots = _shots(simulated(np.random.default_rng(22), noise=1e-3)[0], [])[0]
    prior = (0.1, 0.1)
    begin = _begin(shots, prior, {}, None, [])[0]
    found = estimate(FieldProblem(shots, prior, first_levels(2, shots.member)), begin)
    some = (slice(0, 24, 8), 0)  # of free shots
    q = found.free[some]
    levels = (np.arange(20_000) + 0.5) / 20_000
    square = q[:, None] * fdtri(q[:, None], 8.0, levels)  # of the length of a draw
    told = np.mean((8.0 + q[:, None]) ** 2 * square / (8.0 + square) ** 2, axis=1) / q
    # the middle of 20,000 cells instead of the integral: the last cell's tail
    np.testing.assert_allclose(found.problem.levels.used[some] ** 2, told, rtol=2e-3)


def test_the_gauge_is_a_symmetry(problem):
    problem, at = problem
    cost = problem.normal(at).cost
    assert problem.normal(turned(at, 0.7)).cost == pytest.approx(cost, rel=1e-12)
    assert abs(problem.normal(at).gradient @ problem.gauge(at)) < 1e-9 * cost


def test_eliminating_the_attitudes_is_the_full_solution(problem):
    """One step of the reduced equations against one step of the full least squares over everything."""
    problem, at = problem
    linear = problem.linear(at)
    count, rows, size = linear.shared.shape
    full = np.zeros((count * rows, size + 3 * count))
    full[:, :size] = linear.shared.reshape(-1, size)
    for k in range(count):
        full[k * rows : (k + 1) * rows, size + 3 * k : size + 3 * k + 3] = linear.latent[k]
    # the ridge on attitudes is part of the model here; that on the shared parameters is added after the elimination
    normal = full.T @ full + 1e-2 * np.diag([0.0] * size + [1.0] * (3 * count))
    schur = normal[:size, :size] - normal[:size, size:] @ np.linalg.solve(normal[size:, size:], normal[size:, :size])
    _, shared, residual = linear.reduced()
    np.testing.assert_allclose(np.einsum("knp,knq->pq", linear.shared, shared), schur, atol=1e-9 * np.abs(schur).max())
    rhs = full.T @ linear.residual.ravel()
    gradient = rhs[:size] - normal[:size, size:] @ np.linalg.solve(normal[size:, size:], rhs[size:])
    ours = np.einsum("knp,kn->p", linear.shared, residual)
    np.testing.assert_allclose(ours, gradient, atol=1e-9 * np.abs(gradient).max())


def test_mirrored_first_two_sensors_still_have_a_convention():
    """Of five sensors one is wired backwards: no turn about z brings the first along x and the second along y."""
    readings, _ = simulated(np.random.default_rng(3), sensors=5, noise=1e-3)
    channels = {k: v * [1.0, -1.0, 1.0, 1.0, 1.0] for k, v in readings.channels.items()}
    calibration = calibrate_field(BenchReadings(channels, roll_set=readings.roll_set))
    first = calibration.tool.triads["accelerometer"].tensor[0]
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    assert np.linalg.det(first[:2, :2]) < -0.9
    # the one that lies more across the tool axis carries its own: the first x, or the second y
    leader = int(np.argmin(np.abs(first[:2, 2])))
    assert first[leader, leader] > 0.9
    off, share = kept_by_convention(calibration, lambda n: n[leader, 1 - leader])
    assert abs(off) < 1e-12
    assert share < 1e-4

"""Simulated bench: exact without noise, with exactly the errors that were asked for."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.rotations import dcm, rotation_x, rotation_y, rotation_z
from inclinometry.simulate.bench import Bump, Misread, Rig, simulate_bench, simulate_benches
from inclinometry.simulate.tool import random_tool, random_tools, realistic_tool

CUBE = np.radians(
    [(a, i, t) for a, i in ((0, 90), (180, 90), (0, 0), (0, 180), (90, 90), (270, 90)) for t in (0, 90, 180, 270)]
).T
SDS = np.radians([0.1, 0.2, 0.3])
DIP = np.radians(70.0)


def turn(rotation):
    """Angle of a rotation matrix; the skew part keeps its digits near zero."""
    skew = rotation - rotation.swapaxes(-1, -2)
    sine = np.linalg.norm([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=0) / 2
    return np.arctan2(sine, (np.trace(rotation, axis1=-2, axis2=-1) - 1) / 2)


def test_without_noise_the_inverse_of_the_triad_returns_the_field():
    tool = random_tool(1, sensors={"accelerometer": 3, "magnetometer": 5, "gyro": 4})
    run = simulate_bench(tool, Rig(), *CUBE, noise={}, seed=1)
    level = {
        "accelerometer": [0.0, 0.0, 1.0],
        "magnetometer": [np.cos(DIP), 0.0, np.sin(DIP)],
        "gyro": [0.5, 0.0, -np.sqrt(0.75)],  # latitude 60
    }
    for kind, direction in level.items():
        # rounding of signals of some thousand counts, relative
        np.testing.assert_allclose(tool.triads[kind].field(run.signals[kind]), dcm(*CUBE) @ direction, atol=1e-13)
    assert run.reference == {"g": 9.80665, "b": 50000.0, "dip": DIP}
    assert run.count is None
    assert run.sd == {}


def test_base_tilt_turns_all_fields_by_the_same_angle():
    rig = Rig(base_tilt=np.radians(5.0), tilt_axis=0.7, north_offset=0.4)
    level = Rig()
    gravity = rig.direction("accelerometer")
    assert np.degrees(np.arccos(gravity[2])) == pytest.approx(5.0)
    assert gravity @ [np.cos(0.7), np.sin(0.7), 0.0] == pytest.approx(0.0, abs=1e-15)  # the axis stays level
    # whatever the base does, the angle between the fields is that of the site
    assert gravity @ rig.direction("magnetometer") == pytest.approx(np.sin(DIP))
    assert rig.direction("gyro") @ rig.direction("magnetometer") == pytest.approx(
        level.direction("gyro") @ level.direction("magnetometer")
    )


def test_declination_separates_true_from_magnetic_north():
    east = Rig(declination=np.radians(10.0), latitude=0.0)
    # magnetic north lies east of true north: seen from magnetic north the Earth rate points west
    np.testing.assert_allclose(
        east.direction("gyro"), [np.cos(np.radians(10)), -np.sin(np.radians(10)), 0.0], atol=1e-15
    )


def test_axes_that_are_not_orthogonal():
    rig = Rig(outer=1e-3, inner=-2e-3)
    a, i, t = 0.3, 1.1, 2.0
    expected = rotation_z(t) @ rotation_x(-2e-3) @ rotation_y(i) @ rotation_x(1e-3) @ rotation_z(a)
    np.testing.assert_allclose(rig.orientation([a, i, t]), expected, atol=1e-15)
    # and the limit: 0 and nearly 0 agree
    np.testing.assert_allclose(Rig(inner=1e-12).orientation([a, i, t]), Rig().orientation([a, i, t]), atol=2e-12)


def test_zeros_shift_every_station_by_the_same_angle():
    rig = Rig(inclination_zero=1e-3, toolface_zero=-2e-3)
    run = simulate_bench(random_tool(1), rig, *CUBE, noise={}, seed=1)
    np.testing.assert_allclose(run.orientation, dcm(CUBE[0], CUBE[1] + 1e-3, CUBE[2] - 2e-3), atol=1e-15)
    np.testing.assert_array_equal(run.inclination, CUBE[1])


def test_rig_errors_are_common_to_the_triads_and_have_the_stated_spread():
    tools = random_tools(1, 4000, bits=None)
    run = simulate_benches(tools, Rig(setting_sd=SDS), *CUBE, noise={}, seed=3)
    # 96000 settings each: the standard deviation scatters by 0.23 %
    np.testing.assert_allclose(run.setting_errors.std(axis=(0, 1)), SDS, rtol=0.012)
    assert np.abs(run.setting_errors.mean(axis=(0, 1))).max() < 5 * SDS.max() / np.sqrt(96000)
    for kind, tensor in tools.tensor.items():
        field = np.linalg.solve(tensor[:, None], (run.signals[kind] - tools.offset[kind][:, None])[..., None])[..., 0]
        angles = CUBE.T + run.setting_errors
        expected = dcm(*np.moveaxis(angles, -1, 0)) @ Rig().direction(kind)
        np.testing.assert_allclose(field, expected, atol=1e-11)  # tensors of condition below 100


def test_random_tilt_axes_are_uniform_and_fixed_ones_stay():
    rig = Rig(base_tilt=np.radians(5.0))
    run = simulate_benches(random_tools(1, 1), rig, *CUBE, draws=4000, seed=3)
    level = run.field_directions["accelerometer"]
    np.testing.assert_allclose(level[:, 2], np.cos(np.radians(5.0)), rtol=1e-14)
    assert np.abs(level[:, :2].mean(axis=0)).max() < 5 * np.sin(np.radians(5.0)) / np.sqrt(2 * 4000)
    with refused("input-missing", names=("tilt_axis",)):
        rig.direction("accelerometer")
    given = Rig(base_tilt=np.radians(5.0), tilt_axis=0.7)
    fixed = simulate_benches(random_tools(1, 1), given, *CUBE, draws=3, seed=3).field_directions["accelerometer"]
    np.testing.assert_array_equal(fixed, np.tile(given.direction("accelerometer"), (3, 1)))


def test_white_noise_has_the_stated_spread_and_mean_zero():
    tools = random_tools(1, 1)
    run = simulate_benches(tools, Rig(setting_sd=SDS), *CUBE, draws=2000, noise={"magnetometer": 3.0}, seed=5)
    residual = run.signals["magnetometer"] - run.clean["magnetometer"]
    assert residual.std() == pytest.approx(3.0, rel=0.01)  # 144000 values: 0.2 %
    assert abs(residual.mean()) < 5 * 3.0 / np.sqrt(residual.size)
    assert np.array_equal(run.signals["accelerometer"], run.clean["accelerometer"])


def test_quantisation_adds_a_twelfth_of_the_step_squared():
    tools = random_tools(1, 3000)
    run = simulate_benches(tools, Rig(setting_sd=0.1), *CUBE, noise={}, bits=12, seed=5)
    for kind in tools.tensor:
        residual = run.signals[kind] - run.clean[kind]
        assert np.array_equal(run.signals[kind], np.rint(run.signals[kind]))
        assert np.abs(residual).max() <= 0.5
        assert residual.var() == pytest.approx(1 / 12, rel=0.01)  # 216000 values: 0.2 %
    physical = simulate_benches(random_tools(1, 3000, bits=None), Rig(setting_sd=0.1), *CUBE, noise={}, bits=12, seed=5)
    step = 130000.0 / 4096
    np.testing.assert_allclose(physical.signals["magnetometer"], run.signals["magnetometer"] * step, atol=1e-6)


def test_strong_fields_saturate_and_say_so():
    run = simulate_bench(realistic_tool(1, b=80000.0), Rig(), *CUBE, bits=12, seed=1)
    assert run.signals["magnetometer"].max() == 2047
    assert run.signals["magnetometer"].min() == -2048
    assert np.array_equal(run.saturated["magnetometer"], np.abs(run.clean["magnetometer"]) > 2047)
    assert not run.saturated["accelerometer"].any()


def test_seeds_reproduce_and_noise_options_leave_the_rig_alone():
    tool, rig = random_tool(1), Rig(setting_sd=SDS, base_tilt=0.1)
    first = simulate_bench(tool, rig, *CUBE, bits=12, seed=9)
    again = simulate_bench(tool, rig, *CUBE, bits=12, seed=9)
    quiet = simulate_bench(random_tool(2), rig, *CUBE, noise={}, repeats=3, seed=9)
    other = simulate_bench(tool, rig, *CUBE, bits=12, seed=10)
    for kind in tool.triads:
        assert np.array_equal(first.signals[kind], again.signals[kind])
        assert not np.array_equal(first.signals[kind], other.signals[kind])
    assert np.array_equal(first.setting_errors, quiet.setting_errors)
    assert np.array_equal(first.orientation, quiet.orientation)
    np.testing.assert_array_equal(first.field_directions["accelerometer"], quiet.field_directions["accelerometer"])


def test_batch_and_single_form_agree():
    tools, rig = random_tools(1, 1), Rig(setting_sd=SDS, base_tilt=0.1)
    one = simulate_bench(tools.tool(0), rig, *CUBE, bits=12, seed=4)
    many = simulate_benches(tools, rig, *CUBE, bits=12, seed=4)
    for kind in tools.tensor:
        np.testing.assert_array_equal(one.signals[kind], many.signals[kind][0])


def test_repeats_average_the_noise_down_and_report_it():
    tool = random_tool(1)
    stations = np.tile(CUBE, 20)
    run = simulate_bench(tool, Rig(), *stations, noise={"accelerometer": 5.0}, repeats=25, seed=4)
    assert run.count is not None
    assert (run.count == 25).all()
    residual = run.signals["accelerometer"] - run.clean["accelerometer"]
    assert residual.std() == pytest.approx(1.0, rel=0.1)  # 1440 values: 1.9 %
    assert np.sqrt(np.mean(run.sd["accelerometer"] ** 2)) == pytest.approx(1.0, rel=0.03)
    quantised = simulate_bench(tool, Rig(), *CUBE, noise={}, bits=12, repeats=5, seed=4)
    np.testing.assert_allclose(quantised.sd["magnetometer"], 1 / np.sqrt(12))


def test_a_misread_dial_changes_the_record_and_nothing_else():
    tool = random_tool(1)
    clean = simulate_bench(tool, Rig(setting_sd=SDS), *CUBE, seed=4)
    faulty = simulate_bench(tool, Rig(setting_sd=SDS, faults=[Misread(5, "toolface", 0.5)]), *CUBE, seed=4)
    assert np.array_equal(clean.signals["magnetometer"], faulty.signals["magnetometer"])
    difference = np.array(faulty.toolface) - np.array(clean.toolface)
    assert np.flatnonzero(difference).tolist() == [5]
    assert difference[5] == pytest.approx(0.5)
    assert np.array_equal(clean.inclination, faulty.inclination)


def test_a_bump_turns_one_station_by_its_size_for_all_triads():
    tool = random_tool(1, noise={})
    clean = simulate_bench(tool, Rig(), *CUBE, seed=4)
    faulty = simulate_bench(tool, Rig(faults=[Bump(7, 0.02)]), *CUBE, seed=4)
    angle = turn(faulty.orientation @ clean.orientation.swapaxes(-1, -2))
    np.testing.assert_allclose(angle, np.where(np.arange(24) == 7, 0.02, 0.0), atol=1e-14)
    for kind in tool.triads:
        moved = np.any(faulty.signals[kind] != clean.signals[kind], axis=-1)
        assert np.flatnonzero(moved).tolist() == [7]
    assert np.array_equal(faulty.toolface, clean.toolface)


def test_temperature_of_each_station_is_used():
    tool = realistic_tool(1, temperature_degree=1, noise={})
    warm = simulate_bench(tool, Rig(), *CUBE, temperature=np.linspace(20, 120, 24), seed=1)
    cold = simulate_bench(tool, Rig(), *CUBE, seed=1)
    assert cold.temperature is None
    np.testing.assert_allclose(warm.signals["accelerometer"][0], cold.signals["accelerometer"][0], rtol=1e-14)
    for kind, triad in tool.triads.items():
        field = triad.field(warm.signals[kind], warm.temperature)
        np.testing.assert_allclose(field, warm.orientation @ warm.field_directions[kind], atol=1e-13)


def bench(rig=None, plan=CUBE, **options):
    return simulate_bench(random_tool(1), Rig(**rig or {}), *plan, seed=1, **options)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: bench({"faults": [Bump(24, 0.1)]}), "input-value"),
        (lambda: bench({"faults": [Misread(-1, "azimuth", 0.1)]}), "input-value"),
        (lambda: bench(repeats=0), "input-value"),
        (lambda: bench(bits=40), "input-value"),
        (lambda: bench(noise={"accelerometer": -1.0}), "input-value"),
        (lambda: bench(plan=([0.0], [0.0], [0.0, 1.0])), "input-shape"),
        (lambda: Rig(setting_sd=-1.0), "input-value"),
        (lambda: Rig(setting_sd=[0.1, 0.1]), "input-value"),
        (lambda: Rig(tilt_axis=np.inf), "input-finite"),
        (lambda: Misread(0, "roll", 0.1), "input-choice"),
        (lambda: simulate_benches(random_tools(1, 3), Rig(), *CUBE, draws=5, seed=1), "input-shape"),
        (lambda: simulate_benches(random_tools(1, 3), Rig(faults=[Bump(0, 0.1)]), *CUBE, seed=1), "input-not-with"),
    ],
)
def test_impossible_benches_are_refused(build, message):
    with refused(message):
        build()

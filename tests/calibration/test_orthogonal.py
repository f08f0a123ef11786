"""The cube's rotations: the printed index sets, isotropy, what a rig that stands wrong does and does not spoil."""

from functools import partial

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.closed import ClosedForm, sensitivity
from inclinometry.calibration.twelve import solve_orthogonal, why_not_orthogonal
from inclinometry.rotations import dcm, rotation_exp

EXACT = 1e-14  # sums of 24 numbers of order one
PLANS = [plans.orthogonal(), plans.half(), plans.two_face()]
DIP = np.radians(70.0)
NORTH_DOWN = np.array([np.cos(DIP), 0.0, np.sin(DIP)])


def dials_of(plan):
    return plan.azimuth, plan.inclination, plan.toolface


def random_truth(rng, sensors=3, batch=()):
    a = rng.normal(size=(*batch, 3))
    a[..., 2] = np.abs(a[..., 2]) + 0.1
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
    return ClosedForm(rng.normal(size=(*batch, sensors, 3)), rng.normal(size=(*batch, sensors)), a)


@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
@pytest.mark.parametrize("sensors", [1, 2, 3, 5])
def test_exact_for_any_sensors_rig_and_order(plan, sensors):
    rng = np.random.default_rng(sensors)
    order = rng.permutation(len(plan))
    dials = tuple(v[order] + 2 * np.pi * rng.integers(-1, 2, len(order)) for v in dials_of(plan))
    truth = random_truth(rng, sensors, (100,))
    found = solve_orthogonal(truth.signals(*dials), *dials)
    assert np.abs(found.tensor - truth.tensor).max() < EXACT
    assert np.abs(found.offset - truth.offset).max() < EXACT
    assert np.abs(found.direction - truth.direction).max() < EXACT


def rows(signals, *numbers):
    return sum(signals[n - 1] for n in numbers)


def article_accelerometers(u):
    """The closed form as printed (first line) and completed, for specific force; u (24, m); G K cosines and K Bias."""
    x = (rows(u, 1, 5, 18, 24) - rows(u, 3, 7, 20, 22)) / 8
    y = (rows(u, 4, 8, 17, 23) - rows(u, 2, 6, 19, 21)) / 8
    z = (rows(u, 13, 14, 15, 16) - rows(u, 9, 10, 11, 12)) / 8
    return np.stack([x, y, z], axis=-1), u.mean(axis=0)


def article_fluxgates(u, dip):
    """Index sets of the fluxgates, D_N and D_D of each axis joined by the horizontal and vertical field; (24, m)."""
    n = [
        rows(u, 9, 13, 17, 21) - rows(u, 11, 15, 19, 23),
        rows(u, 12, 16, 20, 24) - rows(u, 10, 14, 18, 22),
        rows(u, 1, 2, 3, 4) - rows(u, 5, 6, 7, 8),
    ]
    d = [
        rows(u, 3, 7, 20, 22) - rows(u, 1, 5, 18, 24),
        rows(u, 2, 6, 19, 21) - rows(u, 4, 8, 17, 23),
        rows(u, 9, 10, 11, 12) - rows(u, 13, 14, 15, 16),
    ]
    return (np.cos(dip) * np.stack(n, axis=-1) + np.sin(dip) * np.stack(d, axis=-1)) / 8, u.mean(axis=0)


def test_the_printed_index_sets_are_this_closed_form():
    rng = np.random.default_rng(4)
    dials = dials_of(plans.orthogonal())
    truth = ClosedForm(rng.normal(size=(3, 3)), rng.normal(size=3), np.array([0.0, 0.0, 1.0]))
    u = truth.signals(*dials) + 1e-3 * rng.normal(size=(24, 3))
    found = solve_orthogonal(u, *dials, known_direction=[0.0, 0.0, 1.0])
    cosines, bias = article_accelerometers(u)
    assert np.allclose(
        found.tensor, -cosines, atol=EXACT
    )  # the tensor is for the field, the article's for its reaction
    assert np.allclose(found.offset, bias, atol=EXACT)
    magnetic = ClosedForm(truth.tensor, truth.offset, NORTH_DOWN)
    u = magnetic.signals(*dials) + 1e-3 * rng.normal(size=(24, 3))
    found = solve_orthogonal(u, *dials, known_direction=NORTH_DOWN)
    cosines, bias = article_fluxgates(u, DIP)
    assert np.allclose(found.tensor, cosines, atol=EXACT)
    assert np.allclose(found.offset, bias, atol=EXACT)


@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
def test_normal_matrix_is_diagonal(plan):
    """With the direction known: K/3 for each of n, K for the offset; so standard errors are s/sqrt(8), s/sqrt(24)."""
    dials = dials_of(plan)
    design = np.column_stack([dcm(*dials) @ NORTH_DOWN, np.ones(len(plan))])
    count = len(plan)
    assert np.abs(design.T @ design - np.diag([count / 3] * 3 + [count])).max() < EXACT
    truth = ClosedForm(np.eye(3), np.zeros(3), NORTH_DOWN)
    solver = partial(
        solve_orthogonal, azimuth=dials[0], inclination=dials[1], toolface=dials[2], known_direction=NORTH_DOWN
    )
    by_reading = sensitivity(solver, truth.signals(*dials))
    variance = np.einsum("pkm,pkm->p", by_reading, by_reading).reshape(3, 4)
    assert np.allclose(variance[:, :3], 3.0 / count, rtol=1e-9)  # linear in the readings: differences are exact
    assert np.allclose(variance[:, 3], 1.0 / count, rtol=1e-9)


@pytest.mark.parametrize("plan", PLANS, ids=lambda p: p.name)
@pytest.mark.parametrize("believed", [[0.0, 0.0, 1.0], NORTH_DOWN])
def test_a_constant_error_of_the_frame_changes_no_cosine_and_the_scale_by_1_minus_cos(plan, believed):
    rng = np.random.default_rng(7)
    dials = dials_of(plan)
    for degrees in (0.5, 1.0, 5.0):
        axis = np.cross(believed, rng.normal(size=3))
        error = np.radians(degrees)
        a = rotation_exp(error * axis / np.linalg.norm(axis)) @ believed
        truth = ClosedForm(rng.normal(size=(3, 3)), rng.normal(size=3), a)
        signals = truth.signals(*dials)
        trusted = solve_orthogonal(signals, *dials, known_direction=believed)
        assert np.abs(trusted.tensor / np.cos(error) - truth.tensor).max() < EXACT
        assert np.abs(trusted.offset - truth.offset).max() < EXACT
        found = solve_orthogonal(signals, *dials)
        assert np.abs(found.tensor - truth.tensor).max() < EXACT  # nor the scale, when the direction is found


def with_dial_errors(plan, truth, azimuth=0.0, inclination=0.0, toolface=0.0):
    return truth.signals(plan.azimuth + azimuth, plan.inclination + inclination, plan.toolface + toolface)


def offset_error(plan, error, a):
    truth = ClosedForm(np.eye(3), np.zeros(3), np.asarray(a))
    signals = with_dial_errors(plan, truth, inclination=error)
    return solve_orthogonal(signals, *dials_of(plan), known_direction=a).offset


def test_inclination_zero_of_the_stand_is_seen_as_bias_by_one_face_and_not_by_two():
    """Figures of the source: 0.1 degrees give 2/3 sin e on z, 1.16 mg and 54 nT of 50 uT; 0.00 with two faces."""
    error = np.radians(0.1)
    gravity = offset_error(plans.orthogonal(), error, [0.0, 0.0, 1.0])
    assert abs(gravity[2]) == pytest.approx(2.0 / 3.0 * np.sin(error), rel=1e-9)
    assert abs(gravity[2]) == pytest.approx(1.16e-3, abs=5e-6)
    magnetic = offset_error(plans.orthogonal(), error, NORTH_DOWN)
    assert 50000.0 * abs(magnetic[2]) == pytest.approx(54.0, abs=1.0)
    assert np.abs(gravity[:2]).max() < EXACT
    for a in ([0.0, 0.0, 1.0], NORTH_DOWN):
        assert np.abs(offset_error(plans.two_face(), error, a)).max() < EXACT


def test_a_constant_roll_zero_turns_every_triad_about_z_and_nothing_else():
    plan, error = plans.orthogonal(), np.radians(0.7)
    truth = random_truth(np.random.default_rng(2))
    found = solve_orthogonal(with_dial_errors(plan, truth, toolface=error), *dials_of(plan))
    assert np.abs(found.tensor - truth.tensor @ dcm(0.0, 0.0, error)).max() < EXACT
    assert np.abs(found.offset - truth.offset).max() < EXACT


def test_any_isotropic_set_will_do_and_a_turned_cube_is_one():
    plan = plans.orthogonal()
    dials = plan.azimuth + 0.3, plan.inclination, plan.toolface
    truth = random_truth(np.random.default_rng(9))
    assert np.abs(solve_orthogonal(truth.signals(*dials), *dials).tensor - truth.tensor).max() < EXACT


@pytest.mark.parametrize(
    ("dials", "code"),
    [
        (dials_of(plans.twelve()), "plan-axis-uneven"),
        ([v[:11] for v in dials_of(plans.half())], "plan-stations"),
        ([v[:-1] for v in dials_of(plans.orthogonal())], "plan-axis-uneven"),
        ([np.tile(v, 6) for v in ([0.0, np.pi], [0.0, np.pi], [0.0, np.pi / 2])], "plan-axis-uneven"),
        ([np.repeat(v, 6) for v in ([0, 0, 0, 0], [0, 0, np.pi, np.pi], [0, np.pi, 0, np.pi])], "plan-orientations"),
    ],
)
def test_another_plan_is_refused_with_the_reason(dials, code):
    assert code == why_not_orthogonal(*dials).code
    with refused("plan-not-method", method="orthogonal"):
        solve_orthogonal(np.zeros((len(dials[0]), 3)), *dials)


def test_a_dial_off_by_more_than_rounding_is_another_plan():
    plan = plans.orthogonal()
    moved = plan.inclination + np.radians(1e-3) * (np.arange(24) == 3)
    assert why_not_orthogonal(plan.azimuth, moved, plan.toolface) is not None
    rounded = [np.radians(np.round(np.degrees(v), 6)) for v in dials_of(plan)]
    assert why_not_orthogonal(*rounded) is None
    with refused("input-shape", name="azimuth, inclination, toolface"):
        why_not_orthogonal(plan.azimuth, plan.inclination, plan.toolface[:5])


def test_what_is_out_of_balance_is_named():
    """Hanging and standing, eight rolls each: means are nothing, the z axis alone lies along the rig's."""
    roll = np.tile(np.radians(np.arange(0.0, 360.0, 45.0)), 2)
    inclination = np.repeat([0.0, np.pi], 8)
    why = why_not_orthogonal(0.0 * roll, inclination, roll)
    assert why.values["elements"] == ("C[z,z]", "C[z,z]")
    # a cube of which two stations, opposite in all they see, stand elsewhere: the worst pair of elements, by a loop
    dials = [
        np.concatenate([v, more])
        for v, more in zip(
            dials_of(PLANS[0]),
            ([0.3, 0.3, 0.3, 0.3], [0.4, 0.4, np.pi - 0.4, np.pi - 0.4], [0.2, 0.2 + np.pi, 0.2, 0.2 + np.pi]),
            strict=True,
        )
    ]
    dials = [np.concatenate([v, v + turn]) for v, turn in zip(dials, (np.pi, 0.0, 0.0), strict=True)]
    turns = dcm(*dials)
    assert np.abs(turns.mean(axis=0)).max() < 1e-12
    worst = {}
    for i, j, k, m in np.ndindex(3, 3, 3, 3):
        wanted = 1.0 / 3.0 if (i, j) == (k, m) else 0.0
        worst[i, j, k, m] = abs(np.mean(turns[:, i, j] * turns[:, k, m]) - wanted)
    i, j, k, m = max(worst, key=lambda pair: round(worst[pair], 12))
    pair = (f"C[{'xyz'[i]},{'xyz'[j]}]", f"C[{'xyz'[k]},{'xyz'[m]}]")
    assert why_not_orthogonal(*dials).values["elements"] == pair

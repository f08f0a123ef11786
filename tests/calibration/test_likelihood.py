"""The joint model against a second one written with loops, finite differences, dense algebra and scipy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from inclinometry.calibration.likelihood import Model, StandAngle, State, tangent_basis
from inclinometry.calibration.variance import fit

KINDS = ("accelerometer", "magnetometer", "gyro")


def turn(axis, angle):
    """Passive rotation about a coordinate axis, written from its definition: components in the turned frame."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = s, -s
    return matrix


def predicted(model, state):
    """Readings (K, M) of the model, sensor by sensor."""
    inclination_zero, toolface_zero, outer, inner = state.nuisance
    rows = []
    for station, (a, i, t) in enumerate(model.settings + state.errors):
        chain = turn(2, t + toolface_zero) @ turn(0, inner) @ turn(1, i + inclination_zero) @ turn(0, outer)
        matrix = chain @ turn(2, a)
        row = []
        for kind in model.signals:
            here = sum(p * c for p, c in zip(model.powers[station], state.coefficients[kind], strict=True))
            row += [sensor[:3] @ matrix @ state.directions[kind] + sensor[3] for sensor in here]
        rows.append(row)
    return np.array(rows)


def unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def make(seed, sensors, degree=0, stations=14, rig=(1e-3, 2e-3, 3e-3), nuisance=(0.01, 0.02, 0.03, 0.04), priors=()):
    """A model and a state with nothing special about either: no zeros, no symmetry."""
    random = np.random.default_rng(seed)
    settings = random.uniform(-3.0, 3.0, (stations, 3))
    powers = random.uniform(-1.0, 1.0, (stations, 1)) ** np.arange(degree + 1)
    coefficients, directions = {}, {}
    for kind, count in sensors.items():
        coefficients[kind] = random.normal(size=(degree + 1, count, 4)) * 0.2 ** np.arange(degree + 1)[:, None, None]
        coefficients[kind][0, :, :3] += 3.0 * np.eye(5, 3)[:count]
        directions[kind] = unit(random.normal(size=3))
    nuisance = np.array(nuisance)
    free = np.where(nuisance > 0.0, 1.0, 0.0)
    state = State(
        coefficients,
        directions,
        np.where(np.array(rig) > 0.0, 1e-3, 0.0) * random.normal(size=(stations, 3)),
        0.01 * free * random.normal(size=4),
    )
    field_prior = {
        kind: (unit(directions[kind] + 0.03 * random.normal(size=3)), np.diag([100.0, 400.0, 900.0])) for kind in priors
    }
    total = sum(sensors.values())
    model = Model(
        {kind: np.zeros((stations, count)) for kind, count in sensors.items()},
        settings,
        powers,
        random.uniform(0.5e-3, 2e-3, (stations, total)),
        np.array(rig),
        nuisance,
        field_prior,
    )
    noise = 1e-3 * random.normal(size=(stations, total))
    readings = predicted(model, state) + noise
    starts = np.cumsum([0, *sensors.values()])
    signals = {kind: readings[:, a:b] for kind, a, b in zip(sensors, starts, starts[1:], strict=False)}
    return Model(signals, settings, powers, model.noise_sd, model.rig_sd, nuisance, field_prior), state


def nudged(state, kind=None, coefficient=None, direction=None, errors=None, nuisance=None):
    """A copy of the state with something added to one of its parts; directions stay on the sphere."""
    coefficients, directions = dict(state.coefficients), dict(state.directions)
    if coefficient is not None:
        coefficients[kind] = coefficients[kind] + coefficient
    if direction is not None:
        directions[kind] = unit(directions[kind] + direction)
    return State(
        coefficients,
        directions,
        state.errors + (0.0 if errors is None else errors),
        state.nuisance + (0.0 if nuisance is None else nuisance),
    )


def steps(model, state):
    """(column of the jacobian, state nudged by h) as functions, in the documented order of the parameters."""
    moves = []
    for kind, values in state.coefficients.items():
        for index in np.ndindex(values.shape):
            moves.append((kind, "coefficient", index))
    for kind in state.directions:
        moves += [(kind, "direction", 0), (kind, "direction", 1)]
    moves += [(None, "nuisance", int(i)) for i in np.flatnonzero(model.nuisance_sd)]

    def at(move, h):
        kind, what, index = move
        if what == "coefficient":
            change = np.zeros_like(state.coefficients[kind])
            change[index] = h
            return nudged(state, kind, coefficient=change)
        if what == "direction":
            return nudged(state, kind, direction=h * tangent_basis(state.directions[kind])[:, index])
        return nudged(state, nuisance=h * np.eye(4)[index])

    return moves, at


LAYOUTS = [
    ({"accelerometer": 3, "magnetometer": 3}, 0),
    ({"accelerometer": 2, "magnetometer": 5}, 0),
    ({"accelerometer": 5, "magnetometer": 2, "gyro": 3}, 2),
    ({"gyro": 3}, 1),
]
H = 1e-5
# central differences of functions of size 3: truncation H^2 * 3 / 6 and rounding 3e-16 / H, both below 1e-10
DIFFERENCE = 5e-10


@pytest.mark.parametrize(("sensors", "degree"), LAYOUTS)
class TestLinearisation:
    def test_residual_is_that_of_the_model_written_with_loops(self, sensors, degree):
        model, state = make(1, sensors, degree)
        readings = np.concatenate(list(model.signals.values()), axis=1)
        np.testing.assert_allclose(
            model.linearise(state).residual, predicted(model, state) - readings, atol=1e-14
        )  # rounding of sums of four products of size 3

    def test_jacobian_along_a_step_of_all_parameters(self, sensors, degree):
        model, state = make(2, sensors, degree)
        jacobian = model.linearise(state).jacobian
        free = np.flatnonzero(model.nuisance_sd > 0.0)
        for seed in range(3):
            step = np.random.default_rng(seed).normal(size=jacobian.shape[2])
            ends = [predicted(model, model.retract(state, h * step)) for h in (H, -H)]
            # thirty parameters at once: truncation grows with the square of the step, some 50 times
            np.testing.assert_allclose(jacobian @ step, (ends[0] - ends[1]) / (2 * H), atol=50 * DIFFERENCE)
            moved = model.retract(state, step).nuisance - state.nuisance
            np.testing.assert_allclose(moved[free], step[model.columns()[2]], rtol=1e-12)

    @pytest.mark.long
    def test_jacobian_by_every_parameter(self, sensors, degree):
        model, state = make(2, sensors, degree)
        jacobian = model.linearise(state).jacobian
        moves, at = steps(model, state)
        assert jacobian.shape[2] == len(moves)
        for column, move in enumerate(moves):
            slope = (predicted(model, at(move, H)) - predicted(model, at(move, -H))) / (2 * H)
            np.testing.assert_allclose(jacobian[..., column], slope, atol=DIFFERENCE, err_msg=str(move))

    def test_jacobian_by_every_setting(self, sensors, degree):
        model, state = make(3, sensors, degree)
        by_setting = model.linearise(state).by_setting
        for dial in range(3):
            shift = np.zeros_like(state.errors)
            shift[:, dial] = H
            slope = (predicted(model, nudged(state, errors=shift)) - predicted(model, nudged(state, errors=-shift))) / (
                2 * H
            )
            np.testing.assert_allclose(by_setting[..., dial], slope, atol=DIFFERENCE)


def augmented(model, state):
    """Whitened residual and jacobian of everything at once: parameters, then the rig errors that are free."""
    at = model.linearise(state)
    stations, total, width = at.jacobian.shape
    loose = np.flatnonzero(model.rig_sd > 0.0)
    rows = (1.0 / model.noise_sd)[..., None]
    jacobian = np.zeros((stations * total, width + stations * len(loose)))
    jacobian[:, :width] = (at.jacobian * rows).reshape(-1, width)
    for k in range(stations):
        here = slice(width + k * len(loose), width + (k + 1) * len(loose))
        jacobian[k * total : (k + 1) * total, here] = (at.by_setting[k] * rows[k])[:, loose]
    blocks, residuals = [jacobian], [(at.residual * rows[..., 0]).ravel()]
    for k in range(stations):
        for place, dial in enumerate(loose):
            row = np.zeros(jacobian.shape[1])
            row[width + k * len(loose) + place] = 1.0 / model.rig_sd[dial]
            blocks.append(row[None])
            residuals.append(np.array([state.errors[k, dial] / model.rig_sd[dial]]))
    column = sum(4 * v.shape[1] * model.powers.shape[1] for v in model.signals.values())
    for kind in model.signals:
        if kind in model.field_prior:
            direction, precision = model.field_prior[kind]
            root = np.linalg.cholesky(precision).T
            row = np.zeros((3, jacobian.shape[1]))
            row[:, column : column + 2] = root @ tangent_basis(state.directions[kind])
            blocks.append(row)
            residuals.append(root @ (state.directions[kind] - direction))
        column += 2
    for index in np.flatnonzero(model.nuisance_sd > 0.0):
        row = np.zeros(jacobian.shape[1])
        row[column] = 1.0 / model.nuisance_sd[index]
        column += 1
        blocks.append(row[None])
        residuals.append(np.array([state.nuisance[index] / model.nuisance_sd[index]]))
    return np.concatenate(residuals), np.concatenate(blocks)


@pytest.mark.parametrize("rig", [(1e-3, 2e-3, 3e-3), (0.0, 2e-3, 0.0), (0.0, 0.0, 0.0)])
def test_eliminated_normal_equations_are_those_of_the_dense_problem(rig):
    model, state = make(4, {"accelerometer": 3, "magnetometer": 4}, 1, rig=rig, priors=("magnetometer",))
    residual, jacobian = augmented(model, state)
    normal = model.normal(state)
    hessian, gradient = jacobian.T @ jacobian, jacobian.T @ residual
    p = len(normal.gradient)
    follow = np.linalg.solve(hessian[p:, p:], np.column_stack([hessian[p:, :p], gradient[p:]]))
    scale = np.abs(hessian).max()
    # the dense system has condition numbers up to 1e6 in these units
    np.testing.assert_allclose(normal.hessian, hessian[:p, :p] - hessian[:p, p:] @ follow[:, :-1], atol=1e-9 * scale)
    np.testing.assert_allclose(
        normal.gradient, gradient[:p] - hessian[:p, p:] @ follow[:, -1], atol=1e-9 * np.abs(gradient).max()
    )
    assert normal.cost == pytest.approx(residual @ residual, rel=1e-12)
    assert normal.eliminated == pytest.approx(gradient[p:] @ follow[:, -1], rel=1e-9)

    # a Newton step of the small problem moves the eliminated errors as the dense one would
    dense = -np.linalg.solve(hessian, gradient)
    after = model.retract(state, -np.linalg.solve(normal.hessian, normal.gradient))
    loose = np.flatnonzero(np.array(rig) > 0.0)
    moved = (after.errors - state.errors)[:, loose].ravel()
    np.testing.assert_allclose(moved, dense[p:], atol=1e-8 * np.abs(dense).max())
    still = np.flatnonzero(np.array(rig) == 0.0)
    np.testing.assert_array_equal(after.errors[:, still], state.errors[:, still])


@pytest.fixture(scope="module")
def everything():
    """Trusted dials, a prior on gravity, known dip and north, structured errors with sizes of their own."""
    sensors = {"accelerometer": 3, "magnetometer": 4}
    model, state = make(9, sensors, 1, rig=(0.0, 0.0, 0.0), nuisance=(0.01, 0.0, 0.03, 0.0), priors=("accelerometer",))
    model = replace(model, stand=(StandAngle("dip", 0.4, 0.02), StandAngle("north", 1.0, 0.05)))
    random = np.random.default_rng(3)
    for place, dial in (("x", ()), ("y", (1, 1))):
        columns = random.normal(size=(14, 7, 2))
        model, state = model.with_structure(state, columns, np.array([1e-3, 2e-3]), [place] * 2, dial)
    assert model.structure_name == ("x", "x", "y", "y")
    assert model.structure_dial.tolist() == [-1, -1, 1, 1]
    return model, replace(state, structured=1e-3 * random.normal(size=4))


def test_the_gradient_is_that_of_the_cost_with_every_prior(everything):
    model, state = everything
    normal = model.normal(state)
    random = np.random.default_rng(1)
    for _ in range(5):
        step = random.normal(size=len(normal.gradient)) * np.where(np.arange(len(normal.gradient)) < 60, 1.0, 0.1)
        ends = [model.normal(model.retract(state, h * step)).cost for h in (1e-6, -1e-6)]
        assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(2.0 * normal.gradient @ step, rel=1e-5)
    # and the hessian, of the readings and of the priors
    at = model.linearise(state)
    rows = (at.jacobian / model.noise_sd[..., None]).reshape(-1, at.jacobian.shape[2])
    wanted = rows.T @ rows + model.prior_information(state)
    np.testing.assert_allclose(normal.hessian, wanted, atol=1e-9 * np.abs(wanted).max())
    # each prior's share of the cost is the square of what it is off by
    off, slopes, sd = model.field_rows(state)
    down, field = state.directions["accelerometer"], state.directions["magnetometer"]
    assert off[-2:] == pytest.approx([angle.off(down, field)[0] for angle in model.stand])
    assert sd[-2:].tolist() == [0.02, 0.05]
    readings = np.sum((at.residual / model.noise_sd) ** 2)
    prior = np.sum((off / sd) ** 2) + np.sum((state.structured / model.structure_sd) ** 2)
    free = model.fitted_nuisance
    assert free.tolist() == [0, 2]
    assert model.nuisance_names() == ("inclination_zero", "outer_nonorthogonality")
    prior += np.sum((state.nuisance[free] / model.nuisance_sd[free]) ** 2)
    assert normal.cost == pytest.approx(readings + prior)
    assert slopes.shape == (5, len(normal.gradient))


def test_some_stations_and_a_higher_power_of_temperature_leave_the_readings_as_they_are(everything):
    model, state = everything
    whole, rows = model.linearise(state).residual, np.array([3, 0, 11])
    assert not np.allclose(whole, model.linearise(replace(state, structured=np.zeros(4))).residual)
    some = replace(state, errors=state.errors[rows])
    np.testing.assert_allclose(model.take(rows).linearise(some).residual, whole[rows], atol=1e-14)
    assert model.take(rows).noise_sd.shape == (3, 7)
    powers = np.concatenate([model.powers, model.powers[:, 1:] ** 2], axis=1)
    wider, more = model.with_powers(state, powers)
    np.testing.assert_allclose(wider.linearise(more).residual, whole, atol=1e-14)
    assert more.coefficients["magnetometer"].shape == (3, 4, 4)
    narrow, less = wider.with_powers(more, powers[:, :1])
    np.testing.assert_array_equal(less.coefficients["magnetometer"], state.coefficients["magnetometer"][:1])
    assert narrow.sizes() == {"accelerometer": 12, "magnetometer": 16}


def test_an_angle_of_the_stand_at_the_pole_is_finite():
    down = np.array([0.0, 0.0, 1.0])
    for name, found in (("dip", np.pi / 2.0), ("north", 0.0)):
        off, by_down, by_field = StandAngle(name, 0.1, 0.01).off(down, down)
        assert np.isfinite([*by_down, *by_field]).all()
        assert off == pytest.approx(found - 0.1, abs=2e-3)


def test_covariance_of_the_fit_is_the_block_of_the_dense_inverse():
    model, state = make(5, {"accelerometer": 3, "magnetometer": 3}, stations=24, nuisance=(0.0, 0.0, 0.0, 0.0))
    found = fit(model, state)
    _, jacobian = augmented(model, found.state)
    dense = np.linalg.inv(jacobian.T @ jacobian)[: len(found.covariance), : len(found.covariance)]
    np.testing.assert_allclose(found.covariance, dense, rtol=1e-6, atol=1e-9 * dense.max())


@pytest.mark.long
@pytest.mark.parametrize(
    ("sensors", "rig", "nuisance", "priors"),
    [
        ({"accelerometer": 3, "magnetometer": 3}, (1e-3, 2e-3, 3e-3), (0.0, 0.0, 0.0, 0.0), ()),
        ({"accelerometer": 5, "magnetometer": 2}, (0.0, 1e-3, 1e-3), (0.02, 0.0, 0.0, 0.01), ("magnetometer",)),
        ({"magnetometer": 3}, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), ("magnetometer",)),
    ],
)
def test_the_fit_is_that_of_scipy_over_all_parameters_and_rig_errors(sensors, rig, nuisance, priors):
    model, state = make(6, sensors, stations=18, rig=rig, nuisance=nuisance, priors=priors)
    loose, free = np.flatnonzero(model.rig_sd > 0.0), np.flatnonzero(model.nuisance_sd > 0.0)
    readings = np.concatenate(list(model.signals.values()), axis=1)

    def unpack(x):
        """Directions by latitude and longitude: another chart of the sphere than the fit's."""
        x, coefficients, directions = list(x), {}, {}
        for kind, values in state.coefficients.items():
            coefficients[kind] = np.array([x.pop(0) for _ in range(values.size)]).reshape(values.shape)
        for kind in state.directions:
            up, east = x.pop(0), x.pop(0)
            directions[kind] = np.array([np.cos(up) * np.cos(east), np.cos(up) * np.sin(east), np.sin(up)])
        errors, constants = np.zeros_like(state.errors), np.zeros(4)
        for place in free:
            constants[place] = x.pop(0)
        errors[:, loose] = np.reshape(x, (len(errors), len(loose)))
        return State(coefficients, directions, errors, constants)

    def residual(x):
        s = unpack(x)
        parts = [((predicted(model, s) - readings) / model.noise_sd).ravel()]
        parts.append((s.errors[:, loose] / model.rig_sd[loose]).ravel())
        parts.append(s.nuisance[free] / model.nuisance_sd[free])
        for kind, (direction, precision) in model.field_prior.items():
            parts.append(np.sqrt(np.diag(precision)) * (s.directions[kind] - direction))
        return np.concatenate(parts)

    start = [*(v for c in state.coefficients.values() for v in c.ravel())]
    start += [v for d in state.directions.values() for v in (np.arcsin(d[2]), np.arctan2(d[1], d[0]))]
    start += [*state.nuisance[free], *state.errors[:, loose].ravel()]
    other = least_squares(residual, start, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = fit(model, state)
    best = unpack(other.x)
    assert found.cost == pytest.approx(2.0 * other.cost, rel=1e-9)
    # scipy differentiates numerically: its minimum is good to about 1e-7, a ten-thousandth of a standard deviation
    for kind in sensors:
        np.testing.assert_allclose(found.state.coefficients[kind], best.coefficients[kind], atol=1e-6)
        np.testing.assert_allclose(found.state.directions[kind], best.directions[kind], atol=1e-6)
    np.testing.assert_allclose(found.state.errors, best.errors, atol=1e-6)
    np.testing.assert_allclose(found.state.nuisance, best.nuisance, atol=1e-6)


@pytest.mark.parametrize("direction", [[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0.9, 0.4, 0.1], [0, -1, 0]])
def test_tangent_basis_is_orthonormal_and_turns_right_handed_about_the_direction(direction):
    d = unit(np.array(direction, dtype=float))
    basis = tangent_basis(d)
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(basis.T @ d, 0.0, atol=1e-15)
    np.testing.assert_allclose(np.cross(basis[:, 0], basis[:, 1]), d, atol=1e-15)


def test_a_step_keeps_directions_on_the_sphere_and_leaves_its_start_alone():
    model, state = make(7, {"accelerometer": 3, "magnetometer": 3})
    before = {kind: values.copy() for kind, values in state.coefficients.items()}
    normal = model.normal(state)
    after = model.retract(state, 0.1 * np.ones(len(normal.gradient)))
    for kind in before:
        assert np.linalg.norm(after.directions[kind]) == pytest.approx(1.0, abs=1e-15)
        np.testing.assert_array_equal(state.coefficients[kind], before[kind])


def test_station_covariance_is_the_spread_of_readings_under_random_settings():
    model, state = make(8, {"accelerometer": 3, "magnetometer": 3}, stations=3, rig=(1e-4, 2e-4, 3e-4))
    random = np.random.default_rng(1)
    base = predicted(model, state)
    draws = []
    for _ in range(4000):
        moved = nudged(state, errors=model.rig_sd * random.normal(size=(3, 3)))
        draws.append(predicted(model, moved) - base + model.noise_sd * random.normal(size=base.shape))
    spread = np.einsum("nki,nkj->kij", draws, draws) / len(draws)
    stated = model.station_covariance(model.linearise(state))
    sd = np.sqrt(np.diagonal(stated, axis1=1, axis2=2))
    # relative standard deviation of a variance from 4000 draws is 0.022; 54 elements, so 4.5 of them
    np.testing.assert_allclose(
        spread / sd[:, :, None] / sd[:, None, :], stated / sd[:, :, None] / sd[:, None, :], atol=0.1
    )

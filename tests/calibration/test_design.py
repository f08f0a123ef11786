"""Aimed plans: the information is the joint fit's, the search does what it says, the stand's limits hold."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.design import (
    AZIMUTH,
    CRITERIA,
    INCLINATION,
    NOISE,
    RIG_SD,
    TRACE,
    Problem,
    attitude_variances,
    best_addition,
    evaluate_plan,
    exchange,
    fill,
    information,
    least_drift,
    next_position,
    norm,
    optimal_plan,
    plan_value,
    reductions,
    search,
    whitened,
)
from inclinometry.calibration.expected import expected_uncertainty
from inclinometry.calibration.initial_values import Stand, stand_within
from inclinometry.calibration.joint import fit_once
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import IdentifiabilityError, InputError
from inclinometry.orientation import angles
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.sensors import Tool, Triad, parameter_vector
from inclinometry.simulate.tool import realistic_tool

DEG = np.pi / 180.0
DIP = 70.0 * DEG
COARSE = stand_within(candidates=300)
FIELDS = {"accelerometer": np.array([0.0, 0.0, 1.0]), "magnetometer": np.array([np.cos(DIP), 0.0, np.sin(DIP)])}


def settings_of(plan):
    return np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)


def skewed_tool():
    """Counts and 10-degree misalignments: nothing about it is nominal."""
    random = np.random.default_rng(5)
    triads = {}
    for kind, full in (("accelerometer", 16000.0), ("magnetometer", 0.8)):
        tensor = full * (np.eye(3) + 0.15 * random.normal(size=(3, 3)))
        triads[kind] = Triad(kind, tensor, 0.03 * full * random.normal(size=3))
    return Tool("skewed", triads)


@pytest.fixture(scope="module")
def aimed():
    return optimal_plan(12, stand=COARSE, restarts=2)


# --- the information -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tool", [None, skewed_tool()])
@pytest.mark.parametrize("rig_sd", [0.0, 0.1 * DEG])
def test_information_is_that_of_the_joint_fit(tool, rig_sd):
    about = information(rig_sd, NOISE, DIP, tool)
    settings = settings_of(plans.twelve())
    factors = about.factors(settings)
    ours = about.prior() + np.einsum("kmi,kmj->ij", factors, factors)
    model, state = about.model(settings)
    fit = model.normal(state).hessian * np.outer(about.scale, about.scale)
    size = np.sqrt(np.diagonal(fit))
    # elimination against marginalisation, equal in exact arithmetic; rounding of 12 sums of squares
    np.testing.assert_allclose(ours / np.outer(size, size), fit / np.outer(size, size), atol=1e-11)


def test_promised_covariance_is_what_the_fit_reports(aimed):
    truth = realistic_tool(3)
    noise = {"accelerometer": 5e-4, "magnetometer": 4e-4}
    turns = dcm(aimed.azimuth, aimed.inclination, aimed.toolface)
    signals = {k: truth.triads[k].signals(turns @ FIELDS[k]) for k in FIELDS}
    sd = {k: noise[k] * np.linalg.norm(truth.triads[k].tensor[0], axis=1).max() for k in FIELDS}
    readings = BenchReadings(signals, aimed.azimuth, aimed.inclination, aimed.toolface)
    found = fit_once(readings, sd, 0.1 * DEG, field_prior={k: (FIELDS[k], 5.0 * DEG) for k in FIELDS})
    inclination = np.array([10.0, 45.0, 90.0]) * DEG
    expected = evaluate_plan(aimed, inclination, rig_sd=0.1 * DEG, noise=noise, dip=DIP, tool=truth)
    kept = Tool("", found.tool.triads, found.tool.covariance)
    # readings without error: the fit ends at the truth, to its tolerance of 1e-10 standard deviations
    given = expected_uncertainty(kept, inclination, DIP)
    np.testing.assert_allclose(expected.from_calibration, given.from_calibration, rtol=1e-6)


def test_the_specified_table_of_classical_plans():
    rows = {
        (plans.twelve, 0.0): (0.168, 0.104, 0.063, 0.054, 0.057),
        (plans.half, 0.0): (0.169, 0.106, 0.067, 0.057, 0.053),
        (plans.orthogonal, 0.0): (0.119, 0.075, 0.047, 0.040, 0.037),
        (plans.twelve, 0.1): (0.198, 0.119, 0.071, 0.064, 0.072),
        (plans.half, 0.1): (0.441, 0.233, 0.107, 0.088, 0.080),
        (plans.orthogonal, 0.1): (0.140, 0.085, 0.053, 0.047, 0.048),
    }
    for (plan, rig), row in rows.items():
        found = evaluate_plan(plan(), rig_sd=rig * DEG).from_calibration[:, 1] / DEG
        # figures of three digits, found on a coarser grid of toolfaces
        np.testing.assert_allclose(found, row, atol=0.0011)


@pytest.mark.parametrize("tool", [None, skewed_tool()])
def test_promised_azimuth_against_differences(tool):
    """Variance of azimuth from the covariance by plain differentiation of a reading, at the attitude that is worst."""
    about = information(0.0, NOISE, DIP, tool)
    inclination = 25.0 * DEG
    table = evaluate_plan(plans.orthogonal(), [inclination], rig_sd=0.0, tool=tool)
    factors = about.factors(settings_of(plans.orthogonal()))
    covariance = np.linalg.inv(about.prior() + np.einsum("kmi,kmj->ij", factors, factors))[:24, :24]
    covariance = covariance * np.outer(about.scale[:24], about.scale[:24])
    a, t = np.unravel_index(np.argmax(table.variance[0, :, :, 1]), (24, 24))
    turn = dcm(15.0 * DEG * a, inclination, 15.0 * DEG * t)
    triads = about.tool.triads
    signals = {k: triads[k].signals(turn @ FIELDS[k]) for k in FIELDS}
    start = np.concatenate([parameter_vector(x) for x in triads.values()])

    def azimuth(x):
        block = {k: b.reshape(3, 4) for k, b in zip(FIELDS, np.split(x, 2), strict=True)}
        g, b = (np.linalg.solve(block[k][:, :3], signals[k] - block[k][:, 3]) for k in FIELDS)
        return angles(g, b).azimuth

    step = 1e-6 * about.scale[:24]
    slope = [wrap_signed(azimuth(start + e) - azimuth(start - e)) / (2.0 * e.sum()) for e in np.diag(step)]
    variance = np.array(slope) @ covariance @ np.array(slope)
    # central differences of step 1e-6: error about 1e-9 of the slope
    np.testing.assert_allclose(variance, table.variance[0, a, t, 1], rtol=1e-6)


# --- what an aimed plan does -----------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("n", "rig", "required"), [(12, 0.0, 0.075), (16, 0.1, 0.078), (24, 0.1, 0.062)])
def test_aimed_plans_reach_the_specified_figures(n, rig, required):
    plan = optimal_plan(n, rig_sd=rig * DEG, restarts=3)
    fine = np.linspace(10.0, 90.0, 17) * DEG
    assert evaluate_plan(plan, fine, rig_sd=rig * DEG).from_calibration[:, 1].max() <= required * DEG


@pytest.mark.long
@pytest.mark.parametrize("low", [1.0, 5.0])
def test_sixteen_aimed_at_near_vertical_do_what_the_cube_does_with_24(low):
    where = (low * DEG, 15.0 * DEG)
    plan = optimal_plan(16, inclination_range=where, restarts=2)
    assert plan_value(plan, inclination_range=where) <= plan_value(plans.orthogonal(), inclination_range=where)


@pytest.mark.long
def test_no_plan_beats_the_cube_everywhere():
    """With trusted dials the cube's information on each triad is isotropic, the best there is on average."""
    everywhere = np.array([5.0, 20.0, 45.0, 90.0, 135.0, 160.0, 175.0]) * DEG
    cube = evaluate_plan(plans.orthogonal(), everywhere, rig_sd=0.0).from_calibration[:, :2]
    tried = [optimal_plan(24, criterion=c, rig_sd=0.0, stand=COARSE, restarts=1) for c in CRITERIA.values()]
    tried.append(
        optimal_plan(24, inclination_range=(5 * DEG, 175 * DEG), rig_sd=0.0, stand=COARSE, restarts=1),
    )
    random, positions = np.random.default_rng(1), COARSE.positions()
    tried += [positions[random.choice(len(positions), 24, replace=False)] for _ in range(5)]
    for plan in tried:
        ratio = evaluate_plan(plan, everywhere, rig_sd=0.0).from_calibration[:, :2] / cube
        assert ratio.max() > 1.0


@pytest.mark.long
@pytest.mark.parametrize("criterion", [AZIMUTH, INCLINATION, TRACE])
def test_each_criterion_is_best_served_by_its_own_plan(criterion):
    where = (20.0 * DEG, 70.0 * DEG)
    own = optimal_plan(12, criterion=criterion, inclination_range=where, stand=COARSE, restarts=2)
    value = plan_value(own, criterion=criterion, inclination_range=where)
    for plan in (plans.twelve(), plans.half()):
        assert value < plan_value(plan, criterion=criterion, inclination_range=where)
    for other in set(CRITERIA.values()) - {criterion}:
        plan = optimal_plan(12, criterion=other, inclination_range=where, stand=COARSE, restarts=2)
        # azimuth is the larger part of the trace, so these two end close to each other; searches vary by 2 %
        assert value < 1.02 * plan_value(plan, criterion=criterion, inclination_range=where)


def test_values_agree_with_the_table(aimed):
    where = (30.0 * DEG, 30.0 * DEG)
    table = evaluate_plan(aimed, [30.0 * DEG])
    # 12 steps of azimuth and toolface against 24: the coarse ones are among the fine
    for criterion, found in ((INCLINATION, table.from_calibration[0, 0]), (AZIMUTH, table.from_calibration[0, 1])):
        value = plan_value(aimed, criterion=criterion, inclination_range=where)
        assert 0.98 * found < value < found * (1.0 + 1e-9)
    trace = np.sqrt(table.variance[0, ::2, ::2, :3].sum(axis=-1).max())
    # the same sum, by another route
    np.testing.assert_allclose(plan_value(aimed, criterion=TRACE, inclination_range=where), trace, rtol=1e-9)


def test_the_unit_of_a_tool_does_not_matter():
    tool = Tool("", {k: Triad(k, s * np.eye(3), np.zeros(3)) for k, s in zip(FIELDS, (9.8, 5e4), strict=True)})
    # full field cancels out of every ratio; rounding only
    np.testing.assert_allclose(plan_value(plans.half(), tool=tool), plan_value(plans.half()), rtol=1e-9)


# --- the search ------------------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_plan(aimed):
    again = optimal_plan(12, stand=COARSE, restarts=2)
    assert np.array_equal(settings_of(aimed), settings_of(again))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("doublings", [5, 7])
def test_the_best_addition_is_that_of_trying_each(scale, doublings):
    """In any unit of what is asked; more candidates and attitudes than are compared at first."""
    random = np.random.default_rng(doublings)
    for alike in (False, True):
        # attitudes and candidates nearly alike: few of them do not decide
        factors, gradients = random.normal(size=(300, 2, 6)), random.normal(size=(400, 2, 6))
        if alike:
            gradients /= np.linalg.norm(gradients, axis=2, keepdims=True)
            factors /= np.linalg.norm(factors, axis=2, keepdims=True)
        problem = Problem(factors, np.eye(6), scale * gradients, random.uniform(size=300) < 0.9)
        taken = [int(c) for c in np.flatnonzero(problem.allowed)[:20]]
        here = problem.information(taken)
        np.testing.assert_allclose(here, np.eye(6) + sum(factors[c].T @ factors[c] for c in taken))
        covariance = np.linalg.inv(here)
        taken_off = reductions(whitened(factors, covariance), problem.gradients)
        tried = {}
        for c in set(np.flatnonzero(problem.allowed)) - set(taken):
            inverse = np.linalg.inv(here + factors[c].T @ factors[c])
            variances = np.einsum("grp,pq,grq->g", problem.gradients, inverse, problem.gradients)
            np.testing.assert_allclose(problem.variances(here + factors[c].T @ factors[c]), variances)
            np.testing.assert_allclose(attitude_variances(covariance, problem.gradients) - taken_off[c], variances)
            tried[int(c)] = norm(variances, doublings)
            # a norm: the largest, and at most what as many as large make of it
            assert 1.0 <= tried[int(c)] / variances.max() <= 400.0 ** (0.5**doublings)
        assert tried[best_addition(problem, here, taken, doublings)] == pytest.approx(min(tried.values()), rel=1e-7)


def test_progress_rises_to_one():
    seen = []
    optimal_plan(8, stand=stand_within(candidates=60), restarts=3, progress=seen.append)
    assert seen[0] > 0.0
    assert np.all(np.diff(seen) >= 0.0)
    assert {1 / 3, 2 / 3} <= set(seen)
    assert seen[-1] == 1.0


# --- the plan as an operator meets it --------------------------------------------------------------------------------


def test_order_and_roll_sets():
    plan = optimal_plan(24, stand=COARSE, restarts=1)
    rows = settings_of(plan)[:, [1, 0, 2]].round(9)
    assert plan.name == "optimal"
    assert sorted(map(tuple, rows)) == list(map(tuple, rows))
    assert len(np.unique(rows, axis=0)) == 24
    sets = np.array(plan.roll_set)
    for name in set(sets) - {""}:
        assert (sets == name).sum() > 1
        assert len(np.unique(rows[sets == name, :2], axis=0)) == 1
    places = {tuple(r) for r in rows[sets == "", :2]}
    assert len(places) == (sets == "").sum()


def test_limits_of_the_stand_are_respected():
    limits = {"azimuth": (-30 * DEG, 60 * DEG), "inclination": (0.0, 95 * DEG), "toolface": (0.0, 300 * DEG)}
    stand = stand_within(**limits, candidates=400)
    plan = optimal_plan(12, stand=stand, restarts=1)
    for name, (low, high) in limits.items():
        values = getattr(plan, name)
        assert values.min() >= low - 1e-12
        assert values.max() <= high + 1e-12
        assert set(values) <= set(getattr(stand, name))


def test_captured_stations_count_and_are_not_asked_for_again():
    captured = settings_of(plans.twelve())
    more = optimal_plan(4, start_from=captured, stand=stand_within(), restarts=1)
    both = np.concatenate([captured, settings_of(more)])
    assert len(np.unique(wrap_signed(both).round(9), axis=0)) == 16
    # four aimed stations do more for the aim than the first four of another classical plan
    other = np.concatenate([captured, settings_of(plans.half())[:4]])
    assert plan_value(both) < plan_value(other) < plan_value(captured)


@pytest.mark.long
def test_next_position_is_the_best_of_all():
    captured = settings_of(plans.half())
    found = next_position(captured, stand=COARSE)
    values = [plan_value(np.concatenate([captured, [p]])) for p in COARSE.positions()]
    assert found.before == plan_value(captured)
    assert found.value == plan_value(np.concatenate([captured, [found[:3]]]))
    # it minimises the norm of power 128, within a percent of the worst
    assert min(values) <= found.value <= 1.005 * min(values)


def test_next_positions_alone_make_a_plan_from_nothing():
    rows = np.zeros((0, 3))
    values = []
    for _ in range(14):
        found = next_position(rows, stand=COARSE)
        rows = np.concatenate([rows, [found[:3]]])
        values.append(found.value)
    finite = np.isfinite(values)
    # until every parameter is seen nothing can be expected; then each station helps
    assert not finite[:3].any()
    assert finite[6:].all()
    assert (np.diff(np.array(values)[finite]) <= 0.0).all()
    assert values[-1] < 1.6 * plan_value(optimal_plan(14, stand=COARSE, restarts=1))


def test_a_captured_stand_has_no_next_position():
    stand = Stand(np.zeros(1), np.array([0.5]), np.array([0.0, 1.0]))
    with refused("plan-all-captured"):
        next_position(stand.positions(), stand=stand)


# --- refusals --------------------------------------------------------------------------------------------------------


def test_too_few_stations():
    with refused("fit-few", error=IdentifiabilityError):
        optimal_plan(5, stand=COARSE)
    captured = settings_of(plans.twelve())[:3]
    with refused("fit-few", error=IdentifiabilityError):
        optimal_plan(2, stand=COARSE, start_from=captured)
    assert len(optimal_plan(6, stand=COARSE, restarts=1)) == 6
    assert len(optimal_plan(3, stand=COARSE, start_from=captured, restarts=1)) == 3
    with refused("input-value", name="n"):
        optimal_plan(0, stand=COARSE)


def test_a_stand_that_only_rolls_cannot_calibrate():
    stand = stand_within(azimuth=(0.0, 0.0), inclination=(0.0, 0.0), candidates=50)
    with refused("fit-undetermined", error=IdentifiabilityError):
        optimal_plan(12, stand=stand)


def test_a_plan_that_only_rolls_promises_nothing():
    rolls = np.stack([np.zeros(8), np.zeros(8), np.arange(8) * 45 * DEG], axis=1)
    assert plan_value(rolls) == np.inf
    with refused("fit-undetermined", error=IdentifiabilityError):
        evaluate_plan(rolls)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inclination_range": (0.0, 0.5)}, "inclination_range"),
        ({"inclination_range": (10.0, 90.0)}, "inclination_range"),
        ({"inclination_range": (1.0, 0.5)}, "inclination_range"),
        ({"rig_sd": -0.1}, "rig_sd"),
        ({"rig_sd": 31 * DEG}, "rig_sd"),
        ({"dip": 90 * DEG}, "dip"),
        ({"noise": {"accelerometer": 1e-3}}, "magnetometer"),
        ({"noise": {"accelerometer": 1e-3, "magnetometer": 0.0}}, "magnetometer.noise"),
        ({"tool": Tool("", {"accelerometer": Triad("accelerometer", np.eye(3), np.zeros(3))})}, "magnetometer"),
        ({"restarts": 0}, "restarts"),
        ({"stand": Stand(np.zeros(1), np.array([0.5, 1.0, 2.0]), np.array([0.0, 1.0, 2.0]))}, "<= 9"),
        ({"start_from": [[0.0, 90.0, 0.0]]}, "settings"),
        ({"start_from": np.zeros((2, 2, 3))}, "settings"),
    ],
)
def test_arguments_out_of_range(options, words):
    with pytest.raises(InputError) as raised:
        optimal_plan(12, **{"stand": COARSE, **options})
    assert words in str(raised.value.finding.values)


def test_azimuth_may_be_aimed_to_a_tenth_of_a_degree_from_the_vertical():
    for low, high in ((0.11, 30.0), (150.0, 179.89)):
        assert np.isfinite(plan_value(plans.twelve(), inclination_range=(low * DEG, high * DEG)))
    for low, high in ((0.09, 30.0), (150.0, 179.91)):
        with refused("input-value", name="inclination_range, deg"):
            plan_value(plans.twelve(), inclination_range=(low * DEG, high * DEG))


def test_inclination_alone_may_be_aimed_at_the_vertical():
    where = (0.0, 10.0 * DEG)
    plan = optimal_plan(12, criterion=INCLINATION, inclination_range=where, stand=COARSE, restarts=1)
    value, twelve = (plan_value(p, criterion=INCLINATION, inclination_range=where) for p in (plan, plans.twelve()))
    assert value < twelve


def test_within_a_roll_set_only_the_toolface_changes():
    for plan in (plans.orthogonal(), plans.two_face(), plans.rotations(), plans.twelve(), plans.six(), plans.half()):
        settings = np.degrees([plan.azimuth, plan.inclination]).round(9)
        assert len(plan.roll_set) in (0, len(plan))
        for name in set(plan.roll_set) - {""}:
            assert len(np.unique(settings[:, np.array(plan.roll_set) == name], axis=1).T) == 1
    # a check of a known tool needs no azimuth dial, and no settings between those of its doc
    six = np.degrees([plans.six().azimuth, plans.six().inclination])
    assert set(six[0]) == {0.0}
    assert sorted(six[1]) == [0.0] * 4 + [135.0] * 2


def test_positions_visited_twice_show_a_drift_that_the_plan_alone_hides():
    for plan in (plans.twelve(), plans.rotations()):
        with_them = plan.repeated(2)
        assert len(with_them) == len(plan) + 2
        assert least_drift(with_them) < 0.6 * least_drift(plan)
    with refused("input-value", name="repeats"):
        plans.twelve().repeated(3)
    assert plans.twelve().repeated(1).to_dict()["station"] == [str(n) for n in range(1, 14)]


ANYWHERE = plans.Plan("any", *np.random.default_rng(1).uniform([[0.0], [0.1], [0.0]], [[6.28], [3.0], [6.28]], (3, 14)))


@pytest.mark.parametrize(
    ("louder", "plan"),
    [
        ("", plans.twelve()),
        ("accelerometer", ANYWHERE),
        ("magnetometer", ANYWHERE),
    ],
)
def test_the_least_drift_is_that_of_a_fit_with_drifts(louder, plan):
    """Of the axis and triad that show it least, whichever it is."""
    plan = plan.repeated(1) if plan is not ANYWHERE else plan
    noise = {kind: sd * (2.0 if kind == louder else 1.0) for kind, sd in NOISE.items()}
    about = information(RIG_SD, noise, DIP, None)
    model, state = about.model(settings_of(plan))
    at = model.linearise(state)
    size, count, width = at.jacobian.shape
    # every setting's error a parameter of its own, instead of eliminated
    own = np.zeros((size, count, size, 3))
    own[np.arange(size), :, np.arange(size)] = at.by_setting
    worst = 0.0
    for triad in (slice(0, 3), slice(3, 6)):
        drift = np.linspace(-0.5, 0.5, size)[:, None, None] * np.eye(count)[:, triad]
        rows = np.concatenate([at.jacobian, own.reshape(size, count, -1), drift], axis=2) / model.noise_sd[..., None]
        rows = rows.reshape(size * count, -1)
        normal = rows.T @ rows
        normal[:width, :width] += about.prior()
        dials = np.arange(width, width + 3 * size)
        normal[dials, dials] += RIG_SD**-2.0
        worst = max(worst, np.linalg.eigvalsh(np.linalg.inv(normal)[-3:, -3:])[-1])
    assert least_drift(plan, noise=noise) == pytest.approx(3.0 * np.sqrt(worst), rel=1e-6)


def test_an_exchange_ends_where_no_single_replacement_helps():
    random = np.random.default_rng(0)
    problem = Problem(
        random.normal(size=(40, 2, 5)), 0.1 * np.eye(5), random.normal(size=(30, 1, 5)), np.full(40, True)
    )

    def objective(chosen):
        return norm(problem.variances(problem.information(chosen)), 5)

    chosen, worst = exchange(problem, list(range(6)), np.random.default_rng(1), 5, 20, lambda: None)
    here = objective(chosen)
    assert len(set(chosen)) == 6
    assert here < objective([*range(6)])
    assert worst == pytest.approx(problem.variances(problem.information(chosen)).max())
    for place in range(6):
        rest = chosen[:place] + chosen[place + 1 :]
        assert min(objective([*rest, c]) for c in range(40) if c not in rest) >= here * (1.0 - 1e-9)
    found = [search(problem, 6, 3, restarts, None) for restarts in (1, 2, 5)]
    sizes = [problem.variances(problem.information(one)).max() for one in found]
    assert sizes[0] >= sizes[1] >= sizes[2]
    problem.allowed[:35] = False
    assert sorted(fill(problem, [], 5, 5)) == [35, 36, 37, 38, 39]

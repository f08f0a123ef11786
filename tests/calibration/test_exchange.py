"""The exchange of stations against plain loops on small random problems."""

import numpy as np

from inclinometry.calibration.design import Problem, best_addition, exchange, fill, search


def small_problem(seed=0):
    random = np.random.default_rng(seed)
    factors = random.normal(size=(40, 2, 5))
    gradients = random.normal(size=(30, 1, 5))
    return Problem(factors, 0.1 * np.eye(5), gradients, np.ones(40, dtype=bool))


def objective(problem, chosen, power):
    covariance = np.linalg.inv(problem.information(chosen))
    variances = [sum(h @ covariance @ h for h in rows) for rows in problem.gradients]
    return sum(v**power for v in variances) ** (1.0 / power)


def test_best_addition_is_the_one_a_plain_loop_finds():
    for seed in range(20):
        problem, taken = small_problem(seed), [3, 4]
        values = [np.inf if c in taken else objective(problem, [*taken, c], 32) for c in range(40)]
        assert best_addition(problem, problem.information(taken), taken, 5) == int(np.argmin(values))


def test_best_addition_with_many_attitudes_leaves_none_out():
    """More attitudes than the first few that decide: the bound must not change the answer."""
    random = np.random.default_rng(8)
    problem = Problem(
        random.normal(size=(300, 3, 6)),
        np.eye(6),
        random.normal(size=(500, 1, 6)) / 10.0 + np.eye(6)[random.integers(0, 6, 500), None],
        np.ones(300, dtype=bool),
    )
    values = [objective(problem, [c], 32) for c in range(300)]
    assert best_addition(problem, problem.fixed, [], 5) == int(np.argmin(values))


def test_criterion_falls_monotonically_in_exchange():
    problem = small_problem()
    found = exchange(problem, list(range(6)), np.random.default_rng(1), 5, 20, lambda: None)
    assert len(found.history) > 1
    assert (np.diff(found.history) < 0.0).all()
    assert len(set(found.chosen)) == 6
    # no single replacement helps any more
    here = objective(problem, found.chosen, 32)
    for place in range(6):
        rest = found.chosen[:place] + found.chosen[place + 1 :]
        others = [objective(problem, [*rest, c], 32) for c in range(40) if c not in rest]
        assert min(others) >= here * (1.0 - 1e-9)


def test_more_restarts_are_never_worse():
    problem = small_problem()
    worst = [search(problem, 6, 3, restarts, None).worst for restarts in (1, 2, 5)]
    assert worst[0] >= worst[1] >= worst[2]


def test_fill_never_takes_a_candidate_twice_or_one_not_allowed():
    problem = small_problem()
    problem.allowed[:35] = False
    assert sorted(fill(problem, [], 5, 5)) == [35, 36, 37, 38, 39]

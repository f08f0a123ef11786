"""The small-angle method: right where its assumptions hold, wrong by the paper's equation (9) where they do not."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.classical import hidden_scale_error, nominal_axes, solve_classical
from inclinometry.calibration.closed import ClosedForm
from inclinometry.errors import IdentifiabilityError
from inclinometry.rotations import dcm

EXACT = 1e-14
DOWN = np.array([0.0, 0.0, 1.0])
PLAN = plans.orthogonal()
DIALS = (PLAN.azimuth, PLAN.inclination, PLAN.toolface)


def misaligned(d1, d2, k=1.0):
    """An x sensor of conversion factor k with a unit axis off by d1, d2; y and z in place."""
    axis = np.array([1.0, d1, d2])
    return np.stack([k * axis / np.linalg.norm(axis), [0.0, k, 0.0], [0.0, 0.0, k]])


def test_exact_when_axes_are_in_place_in_either_sense():
    truth = ClosedForm(np.array([[0, -2.0, 0], [0, 0, 3.0], [2.5, 0, 0]]), np.array([1.0, 2.0, 3.0]), DOWN)
    for plan in (PLAN, plans.twelve(), plans.rotations()):
        dials = plan.azimuth, plan.inclination, plan.toolface
        found = solve_classical(truth.signals(*dials), *dials, conversion_factor=[2.0, 3.0, 2.5])
        assert np.abs(found.tensor - truth.tensor).max() < EXACT
        assert np.abs(found.offset - truth.offset).max() < EXACT


@pytest.mark.parametrize(("d1", "d2"), [(0.01, 0.0), (0.05, -0.08), (0.2, 0.1)])
def test_hidden_scale_error_is_equation_9(d1, d2):
    truth = ClosedForm(misaligned(d1, d2, 2.0), np.zeros(3), DOWN)
    found = solve_classical(truth.signals(*DIALS), *DIALS, conversion_factor=2.0)
    across = truth.tensor[0, 1:] / 2.0  # what the method takes for d1, d2: it holds the first component at 1
    expected = 2.0 * (np.sqrt(1.0 + across @ across) - 1.0)
    assert hidden_scale_error(found)[0] == pytest.approx(expected, rel=1e-12)
    assert np.linalg.norm(found.tensor[0]) - 2.0 == pytest.approx(expected, rel=1e-9)  # and the truth is 2 exactly
    assert np.abs(hidden_scale_error(found)[1:]).max() < EXACT


def test_an_error_of_the_data_sheet_stays_in_full():
    truth = ClosedForm(1.02 * np.eye(3), np.zeros(3), DOWN)
    found = solve_classical(truth.signals(*DIALS), *DIALS, conversion_factor=1.0)
    assert np.allclose(found.tensor, np.eye(3), atol=EXACT)


def test_equal_to_least_squares_in_three_unknowns():
    """A second, dumb implementation on a plan whose normal matrix is not diagonal, in a batch."""
    rng = np.random.default_rng(1)
    dials = rng.uniform(0.0, 6.0, (3, 15))
    a = np.array([0.6, 0.0, 0.8])
    seen = dcm(*dials) @ a
    tensor = np.eye(3) + 0.05 * rng.normal(size=(4, 3, 3))
    signals = seen @ tensor.transpose(0, 2, 1) + 0.01 * rng.normal(size=(4, 15, 3))
    found = solve_classical(signals, *dials, known_direction=a, conversion_factor=1.0)
    for b in range(4):
        for s in range(3):
            others = [j for j in range(3) if j != s]
            design = np.column_stack([seen[:, others], np.ones(15)])
            expected = np.linalg.lstsq(design, signals[b, :, s] - seen[:, s], rcond=None)[0]
            assert found.tensor[b, s, s] == pytest.approx(1.0, abs=EXACT)
            assert np.allclose(found.tensor[b, s, others], expected[:2], atol=1e-12)  # normal equations of condition 10
            assert found.offset[b, s] == pytest.approx(expected[2], abs=1e-12)


def test_a_frame_that_stands_wrong_goes_into_the_axes():
    """Trusted dials: a base tilted by 1 degree turns all axes, which the twelve positions would not be fooled by."""
    dials = [
        np.asarray(v) for v in (plans.rotations().azimuth, plans.rotations().inclination, plans.rotations().toolface)
    ]
    tilt = np.radians(1.0)
    truth = ClosedForm(np.eye(3), np.zeros(3), np.array([np.sin(tilt), 0.0, np.cos(tilt)]))
    found = solve_classical(truth.signals(*dials), *dials, conversion_factor=1.0)
    assert np.abs(found.offset).max() > 0.5 * tilt


def test_refusals():
    with refused("fit-axis-off"):
        nominal_axes([[np.cos(np.pi / 6), 0.5, 0.0]])
    with refused("fit-signals-constant"):
        nominal_axes([[0.0, 0.0, 0.0]])
    signals = ClosedForm(np.eye(3), np.zeros(3), DOWN).signals(*DIALS)
    with refused("input-value", name="conversion_factor"):
        solve_classical(signals, *DIALS, conversion_factor=-1.0)
    for rows in (slice(0, 3), slice(0, 4)):
        with refused("fit-undetermined", error=IdentifiabilityError):
            solve_classical(signals[rows], *(v[rows] for v in DIALS), conversion_factor=1.0)

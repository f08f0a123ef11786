"""Two turns about the tool axis: exact where the source says so, refused in words where they show nothing."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.closed import ClosedForm
from inclinometry.calibration.twelve import axial_conditioning, find_direction, solve_rotations
from inclinometry.errors import IdentifiabilityError
from inclinometry.rotations import dcm, rotation_exp

EXACT = 5e-15  # sums of eight numbers of order one over a conditioning of 0.5
DIP = np.radians(68.0)
DOWN, MAGNETIC = np.array([0.0, 0.0, 1.0]), np.array([np.cos(DIP), 0.0, np.sin(DIP)])


def dials_of(plan):
    return plan.azimuth, plan.inclination, plan.toolface


@pytest.mark.parametrize("rolls", [3, 8, 11])
@pytest.mark.parametrize(("inclination", "azimuth"), [(45, 0), (30, 0), (0, 0), (23, 180), (60, 137)])
@pytest.mark.parametrize("a", [DOWN, MAGNETIC], ids=["gravity", "magnetic"])
def test_exact_on_noise_free_data(inclination, azimuth, rolls, a):
    rng = np.random.default_rng(rolls)
    dials = dials_of(plans.rotations(np.radians(inclination), np.radians(azimuth), rolls))
    truth = ClosedForm(rng.normal(size=(50, 4, 3)), rng.normal(size=(50, 4)), np.broadcast_to(a, (50, 3)))
    found = solve_rotations(truth.signals(*dials), *dials, known_direction=a)
    assert np.abs(found.tensor - truth.tensor).max() < EXACT
    assert np.abs(found.offset - truth.offset).max() < EXACT
    assert np.array_equal(found.direction, truth.direction)


def test_equal_to_least_squares_on_noisy_signals_with_unequal_turns():
    """A second, dumb implementation: four unknowns a sensor; the axial part is shared exactly only by equal turns."""
    rng = np.random.default_rng(3)
    parts = [(0.4, i, t) for i, n in ((0.7, 5), (0.7 + np.pi / 2, 5)) for t in 2 * np.pi * np.arange(n) / n + i]
    dials = tuple(rng.permutation(np.array(parts)).T)
    signals = rng.normal(size=3) + dcm(*dials) @ MAGNETIC @ rng.normal(size=(3, 3)) + 1e-3 * rng.normal(size=(10, 3))
    design = np.column_stack([dcm(*dials) @ MAGNETIC, np.ones(10)])
    expected = np.linalg.lstsq(design, signals, rcond=None)[0].T
    found = solve_rotations(signals, *dials, known_direction=MAGNETIC)
    assert np.abs(np.column_stack([found.tensor, found.offset]) - expected).max() < EXACT
    unequal = [(0.4, i, t) for i, n in ((0.7, 4), (0.7 + np.pi / 2, 9)) for t in 2 * np.pi * np.arange(n) / n]
    dials = tuple(np.array(unequal).T)
    signals = dcm(*dials) @ MAGNETIC @ rng.normal(size=(3, 3)) + 1e-3 * rng.normal(size=(13, 3))
    design = np.column_stack([dcm(*dials) @ MAGNETIC, np.ones(13)])
    expected = np.linalg.lstsq(design, signals, rcond=None)[0].T
    found = solve_rotations(signals, *dials, known_direction=MAGNETIC)
    assert np.abs(np.column_stack([found.tensor, found.offset]) - expected).max() < EXACT


def test_conditioning_figures_of_the_source():
    assert axial_conditioning(np.radians(45.0)) == pytest.approx(2**0.5)
    assert axial_conditioning(np.radians(135.0)) == pytest.approx(0.0, abs=1e-15)
    for azimuth in (0.0, 1.0, 2.0):  # at 45 degrees the azimuth does not matter
        assert axial_conditioning(np.pi / 4, azimuth, MAGNETIC) == pytest.approx(2**0.5 * np.sin(DIP))
    assert axial_conditioning(0.0, np.pi, MAGNETIC) == pytest.approx(1.30, abs=0.005)
    assert axial_conditioning(0.0, 0.0, MAGNETIC) == pytest.approx(0.55, abs=0.005)


def test_a_singular_pair_of_inclinations_is_refused_with_the_cure():
    dials = dials_of(plans.rotations(np.radians(135.0)))
    signals = ClosedForm(np.eye(3), np.zeros(3), DOWN).signals(*dials)
    with refused("plan-axial", error=IdentifiabilityError):
        solve_rotations(signals, *dials)


def test_refused_where_the_axial_fields_are_less_than_a_fifth_apart():
    for axial, wrong in ((0.19, True), (0.21, False)):
        # |Hc - Hz| = |sin d + cos d| for gravity
        first = np.arcsin(axial / np.sqrt(2.0)) + 0.75 * np.pi
        dials = dials_of(plans.rotations(first))
        assert axial_conditioning(first) == pytest.approx(axial)
        truth = ClosedForm(np.eye(3), np.zeros(3), DOWN)
        if wrong:
            with refused("plan-axial", error=IdentifiabilityError):
                solve_rotations(truth.signals(*dials), *dials)
        else:
            assert np.abs(solve_rotations(truth.signals(*dials), *dials).tensor - np.eye(3)).max() < 10 * EXACT


def test_refused_where_a_twentieth_of_the_harmonics_does_not_follow_the_direction():
    """What least squares leave of what changes over the rolls, at dips that are wrong by more and more."""
    dials, said = dials_of(plans.rotations(0.0)), []
    turns = dcm(*dials)
    mean = np.array([np.isclose(dials[1], i) / np.isclose(dials[1], i).sum() for i in dials[1]])
    for degrees in np.arange(2.0, 42.0, 4.0):
        a = rotation_exp([np.radians(degrees), np.radians(degrees), 0.0]) @ MAGNETIC
        signals = ClosedForm(np.eye(3), np.zeros(3), a).signals(*dials)
        design = np.column_stack([turns @ MAGNETIC, np.ones(len(turns))])
        left = signals - design @ np.linalg.lstsq(design, signals, rcond=None)[0]
        share = np.sum((left - mean @ left) ** 2) / np.sum((signals - mean @ signals) ** 2)
        said.append(share > 0.05)
        if said[-1]:
            with refused("fit-share", error=IdentifiabilityError):
                solve_rotations(signals, *dials, known_direction=MAGNETIC)
        else:
            solve_rotations(signals, *dials, known_direction=MAGNETIC)
    assert any(said)
    assert not all(said)


def test_signals_of_another_field_are_refused():
    dials = dials_of(plans.rotations())
    signals = ClosedForm(np.eye(3), np.zeros(3), MAGNETIC).signals(*dials)
    with refused("fit-share", error=IdentifiabilityError):
        solve_rotations(signals, *dials)


@pytest.mark.parametrize(("inclination", "azimuth"), [(45, 0), (30, 0), (0, 180), (60, 137)])
def test_the_direction_is_found_where_the_turns_show_it(inclination, azimuth):
    rng = np.random.default_rng(5)
    dials = dials_of(plans.rotations(np.radians(inclination), np.radians(azimuth)))
    truth = ClosedForm(rng.normal(size=(3, 3)), rng.normal(size=3), MAGNETIC)
    signals = truth.signals(*dials)
    assert np.abs(find_direction(signals, *dials) - MAGNETIC).max() < EXACT
    noisy = find_direction(signals + 1e-3 * rng.normal(size=signals.shape), *dials)
    assert np.abs(noisy - MAGNETIC).max() < 0.01  # noise of 1e-3 over a separation not below 0.2
    assert np.abs(find_direction(signals, *dials, sign_hint=-MAGNETIC) + MAGNETIC).max() < EXACT


def test_gravity_at_45_and_135_does_not_show_its_direction():
    """sin 45 = sin 135: the zero of roll and a tilt out of the plane are one to these turns."""
    dials = dials_of(plans.rotations(np.pi / 4))
    signals = ClosedForm(np.eye(3), np.zeros(3), DOWN).signals(*dials)
    noisy = signals + 1e-3 * np.random.default_rng(6).normal(size=signals.shape)
    for values in (signals, noisy):
        with refused("fit-undetermined", error=IdentifiabilityError):
            find_direction(values, *dials)
    away = dials_of(plans.rotations(np.radians(30.0)))
    found = find_direction(ClosedForm(np.eye(3), np.zeros(3), DOWN).signals(*away), *away)
    assert np.abs(found - DOWN).max() < EXACT


def test_inclination_zero_gives_the_bias_of_the_source():
    """0.1 degrees: 1.23 mg on the z accelerometer and 67 nT on the z fluxgate (of 50 uT, dip 70) at 45 degrees."""
    dials, error = dials_of(plans.rotations(np.pi / 4)), np.radians(0.1)
    magnetic = np.array([np.cos(np.radians(70.0)), 0.0, np.sin(np.radians(70.0))])
    found = {}
    for name, a in (("g", DOWN), ("b", magnetic)):
        signals = ClosedForm(np.eye(3), np.zeros(3), a).signals(dials[0], dials[1] + error, dials[2])
        found[name] = abs(solve_rotations(signals, *dials, known_direction=a).offset[2])
    assert found["g"] == pytest.approx(1.23e-3, abs=5e-6)
    assert 50000.0 * found["b"] == pytest.approx(67.0, abs=3.0)


def test_find_direction_takes_one_triad():
    dials = dials_of(plans.rotations())
    with refused("input-shape", name="signals"):
        find_direction(np.zeros((2, 16, 3)), *dials)

"""Twelve positions: exact for any tool on any rig, equal to least squares, and not what the paper printed."""

from functools import partial

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.closed import ClosedForm, covariance, reading_covariance, sensitivity
from inclinometry.calibration.harmonics import harmonics
from inclinometry.calibration.twelve import _layout, _moments, solve_twelve
from inclinometry.errors import IdentifiabilityError
from inclinometry.orientation import angles
from inclinometry.rotations import dcm, rotation_exp

EXACT = 2e-14  # sums of some tens of numbers of order one, each rounded


def dials_of(plan):
    return plan.azimuth, plan.inclination, plan.toolface


def random_truth(rng, sensors=3, batch=()):
    a = rng.normal(size=(*batch, 3))
    a[..., 2] = np.abs(a[..., 2]) + 0.1
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
    return ClosedForm(rng.normal(size=(*batch, sensors, 3)), rng.normal(size=(*batch, sensors)), a)


def assert_same(found, truth, tolerance=EXACT):
    assert np.abs(found.tensor - truth.tensor).max() < tolerance
    assert np.abs(found.offset - truth.offset).max() < tolerance
    assert np.abs(found.direction - truth.direction).max() < tolerance


@pytest.mark.parametrize("sensors", [1, 2, 3, 5])
@pytest.mark.parametrize(("rolls", "azimuths"), [(3, 3), (4, 3), (3, 5), (8, 6)])
def test_exact_for_any_sensors_on_a_rig_of_any_orientation(rolls, azimuths, sensors):
    rng = np.random.default_rng(rolls + 10 * azimuths + sensors)
    dials = dials_of(plans.twelve(rolls, azimuths))
    truth = random_truth(rng, sensors, (200,))
    assert_same(solve_twelve(truth.signals(*dials), *dials), truth)


def scrambled_dials(rng):
    """The plan with every start shifted, rows shuffled, turns added, half of the rows written from the other side."""
    upright = rng.uniform(0, 6) + 2 * np.pi * np.arange(4) / 4
    rows = [(a, 0.0, s - a) for a, s in zip(rng.uniform(0, 6, 4), upright, strict=True)]
    for a in rng.uniform(0, 6) + 2 * np.pi * np.arange(3) / 3:
        rolls = int(rng.integers(3, 6))
        rows += [(a, np.pi / 2, t) for t in rng.uniform(0, 6) + 2 * np.pi * np.arange(rolls) / rolls]
    a, i, t = rng.permutation(np.array(rows)).T
    flip = rng.random(len(a)) < 0.5
    a, i, t = a + np.pi * flip, np.where(flip, -i, i), t + np.pi * flip
    return a + 2 * np.pi * rng.integers(-1, 2, len(a)), i, t


def test_the_moments_are_least_squares():
    """A second, dumb implementation: ten unknowns a sensor from the pseudo-inverse of the design."""
    for dials in (dials_of(plans.twelve()), dials_of(plans.twelve(5, 4)), scrambled_dials(np.random.default_rng(0))):
        turns = dcm(*dials)
        design = np.column_stack([turns.transpose(0, 2, 1).reshape(-1, 9), np.ones(len(turns))])
        found = _moments(*_layout(*dials)).weights
        assert np.abs(found @ design - np.eye(10)).max() < EXACT
        if len({len(rows) for rows in _layout(*dials)[3]}) == 1:  # azimuths of equal weight
            assert np.abs(found - np.linalg.pinv(design)).max() < EXACT


def test_variance_is_within_twelve_percent_of_the_best_possible():
    """White noise at dips 0 to 90: the bound is least squares of n, U0 and the direction jointly, linearised."""
    plan = plans.twelve()
    dials = dials_of(plan)
    turns = dcm(*dials)
    for dip in np.radians([5.0, 40.0, 70.0, 90.0]):
        a = np.array([np.cos(dip), 0.0, np.sin(dip)])
        truth = ClosedForm(np.eye(3), np.zeros(3), a)
        by_reading = sensitivity(
            partial(solve_twelve, azimuth=dials[0], inclination=dials[1], toolface=dials[2], sign_hint=a),
            truth.signals(*dials),
        )
        got = np.einsum("pkm,pkm->p", by_reading, by_reading)
        design = np.kron(np.column_stack([turns @ a, np.ones(12)]), np.eye(3))
        tangent = np.linalg.svd(a[None])[2][1:]
        aim = np.einsum("ij,kjl,dl->kid", truth.tensor, turns, tangent).reshape(36, 2)
        bound = np.diagonal(np.linalg.inv(np.hstack([design, aim]).T @ np.hstack([design, aim])))[:12]
        bound = bound.reshape(4, 3).T.ravel()
        assert (got > bound * (1 - 1e-6)).all()  # differences of the sensitivity are good to 1e-7
        assert got.sum() < 1.12 * bound.sum()  # worst at the horizontal field; 1.01 at dip 70


def test_direction_of_the_rig_is_recovered_and_its_tilt_does_no_harm():
    rng = np.random.default_rng(5)
    dials = dials_of(plans.twelve())
    level = ClosedForm(rng.normal(size=(3, 3)), rng.normal(size=3), np.array([0.0, 0.0, 1.0]))
    for tilt in (0.0, 0.1, 1.0):
        a = rotation_exp([tilt, 0.0, 0.0]) @ [0.0, 0.0, 1.0]
        found = solve_twelve(ClosedForm(level.tensor, level.offset, a).signals(*dials), *dials)
        assert np.abs(found.direction - a).max() < EXACT
        assert np.abs(found.tensor - level.tensor).max() < EXACT


def test_known_direction_is_used_and_a_wrong_one_refused():
    dials = dials_of(plans.twelve())
    truth = ClosedForm(np.eye(3), np.ones(3), np.array([0.0, 0.0, 1.0]))
    signals = truth.signals(*dials)
    assert_same(solve_twelve(signals, *dials, known_direction=[0.0, 0.0, 9.81]), truth)
    with refused("fit-share", error=IdentifiabilityError):
        solve_twelve(signals, *dials, known_direction=[1.0, 0.0, 0.3])


def test_sign_of_the_field_comes_from_the_hint():
    dials = dials_of(plans.twelve())
    truth = ClosedForm(np.eye(3), np.zeros(3), np.array([0.6, 0.0, -0.8]))
    signals = truth.signals(*dials)
    assert_same(solve_twelve(signals, *dials, sign_hint=[1.0, 0.0, 0.0]), truth)
    turned = solve_twelve(signals, *dials)
    assert np.allclose(turned.tensor, -truth.tensor)
    with refused("fit-sign-open", error=IdentifiabilityError):
        solve_twelve(signals, *dials, sign_hint=[0.8, 0.0, 0.6])


@pytest.mark.parametrize("batch", [1, 5000])
def test_refused_from_0_6_degrees_to_a_right_angle_and_a_tenth_of_the_power_on(batch):
    dials = dials_of(plans.twelve())
    truth = ClosedForm(np.eye(3), np.zeros(3), np.array([0.6, 0.0, 0.8]))
    signals = np.repeat(truth.signals(*dials)[None], batch, axis=0)
    for degrees, wrong in ((0.5, True), (0.7, False)):
        across = np.array([0.8, 0.0, -0.6])
        hint = np.cos(np.radians(degrees)) * across + np.sin(np.radians(degrees)) * truth.direction
        if wrong:
            with refused("fit-sign-open", error=IdentifiabilityError):
                solve_twelve(signals, *dials, sign_hint=hint)
        else:
            assert_same(solve_twelve(signals, *dials, sign_hint=hint), truth)
    # of products along the field a share cos^2 lies along a direction beside it
    for share, wrong in ((0.88, True), (0.92, False)):
        angle = np.arccos(np.sqrt(share))
        beside = np.array([0.6 * np.cos(angle), np.sin(angle), 0.8 * np.cos(angle)])
        if wrong:
            with refused("fit-share", error=IdentifiabilityError):
                solve_twelve(signals, *dials, known_direction=beside)
        else:
            found = solve_twelve(signals, *dials, known_direction=beside)
            np.testing.assert_allclose(found.direction, np.broadcast_to(beside, found.direction.shape))


def test_mixed_up_rows_and_dead_sensors_are_not_calibrated():
    dials = dials_of(plans.twelve())
    truth = ClosedForm(np.eye(3), np.zeros(3), np.array([0.6, 0.0, 0.8]))
    mixed = np.random.default_rng(1).permutation(truth.signals(*dials))
    with refused("fit-share", error=IdentifiabilityError):
        solve_twelve(mixed, *dials)
    with refused("fit-signals-constant", error=IdentifiabilityError):
        solve_twelve(np.zeros((12, 3)), *dials)
    with refused("input-kind", name="sign_hint"):
        solve_twelve(mixed, *dials, sign_hint=[0.0, 0.0, 0.0])


def test_covariance_of_two_triads_is_that_of_repeated_calibrations():
    """First-order covariance against 4000 simulated benches with common rig errors; 5 sigma of a sampled variance."""
    rng = np.random.default_rng(8)
    plan = plans.twelve()
    dials = dials_of(plan)
    truth = [ClosedForm(np.eye(3), np.zeros(3), np.array(a)) for a in ([0.0, 0.0, 1.0], [0.6, 0.0, 0.8])]
    rig_sd, noise_sd, draws = np.array([1e-3, 2e-3, 1e-3]), 5e-4, 4000
    solver = partial(solve_twelve, azimuth=dials[0], inclination=dials[1], toolface=dials[2])
    signals = [t.signals(*dials) for t in truth]
    stated = covariance([solver] * 2, signals, reading_covariance(truth, *dials, rig_sd, np.full(6, noise_sd)))
    true_dials = np.stack(dials, axis=-1) + rig_sd * rng.normal(size=(draws, 12, 3))
    turns = dcm(*np.moveaxis(true_dials, -1, 0))
    found = []
    for t in truth:
        readings = np.einsum("mi,bkij,j->bkm", t.tensor, turns, t.direction)
        found.append(solver(readings + noise_sd * rng.normal(size=readings.shape)).parameters)
    sampled = np.cov(np.concatenate(found, axis=-1).T)
    scale = np.sqrt(np.outer(stated.diagonal(), stated.diagonal()))
    assert np.abs((sampled - stated) / scale).max() < 5.0 * np.sqrt(2.0 / draws)
    assert np.abs(stated[:12, 12:] / scale[:12, 12:]).max() > 0.3  # the rig's errors tie the triads together


# ---- the erratum: equations (22), (25) as printed against the paper's own matrices (16) ------------------------------


def paper_rotation(phi, theta, alpha):
    """A_phi A_theta A_alpha of equation (16), written out from the print."""
    cp, sp, ct, st, ca, sa = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    a_phi = np.array([[cp, sp, 0], [-sp, cp, 0], [0, 0, 1]])
    a_theta = np.array([[ct, 0, st], [0, 1, 0], [-st, 0, ct]])
    a_alpha = np.array([[-ca, -sa, 0], [sa, -ca, 0], [0, 0, 1]])
    return a_phi @ a_theta @ a_alpha


def paper_nine(signals, upright):
    """A_A .. C_C at theta = 90 from signals (3 alpha, 3 phi, m), and C_C(0)."""
    turn = np.radians([0.0, 120.0, 240.0])
    over_phi = harmonics(signals, turn)
    nine = {}
    for name, rows in (("A", over_phi.cosine), ("B", over_phi.sine), ("C", over_phi.mean)):
        over_alpha = harmonics(rows, turn)
        nine |= {f"A_{name}": over_alpha.cosine, f"B_{name}": over_alpha.sine, f"C_{name}": over_alpha.mean}
    return nine, upright.mean(axis=0)


def paper_lengths(tensor, offset, a0, printed):
    """|n1|, |n2|, |n3| by (25), as printed or corrected; U0."""
    turn = np.radians([0.0, 120.0, 240.0])
    see = np.array([[tensor @ paper_rotation(p, np.pi / 2, al) @ a0 + offset for p in turn] for al in turn])
    nine, upright = paper_nine(see, np.array([tensor @ paper_rotation(p, 0.0, 0.0) @ a0 + offset for p in turn]))
    n1 = np.sqrt(nine["A_B"] ** 2 + nine["B_B"] ** 2 + nine["C_A"] ** 2)
    if printed:
        n2 = np.sqrt((nine["A_B"] - nine["B_A"]) ** 2 + (nine["A_A"] + nine["B_B"]) ** 2 + nine["C_B"] ** 2)
    else:
        n2 = np.sqrt(nine["A_A"] ** 2 + nine["B_A"] ** 2 + nine["C_B"] ** 2)
    n3 = np.sqrt(nine["A_C"] ** 2 + nine["B_C"] ** 2 + (upright - nine["C_C"]) ** 2)
    return np.stack([n1, n2, n3], axis=-1), nine["C_C"]


def test_printed_25_adds_the_horizontal_part_of_n1_to_n2_and_the_correction_does_not():
    rng = np.random.default_rng(11)
    for _ in range(20):
        truth = random_truth(rng)
        printed, _ = paper_lengths(truth.tensor, truth.offset, truth.direction, printed=True)
        right, offset = paper_lengths(truth.tensor, truth.offset, truth.direction, printed=False)
        assert np.allclose(right, np.abs(truth.tensor), atol=EXACT)
        assert np.allclose(offset, truth.offset, atol=EXACT)
        n1, n2 = truth.tensor[:, 0], truth.tensor[:, 1]
        horizontal = truth.direction[0] ** 2 + truth.direction[1] ** 2
        assert np.allclose(printed[:, 1] ** 2, n2**2 + horizontal * n1**2, atol=EXACT)


def test_the_paper_turned_by_180_degrees_of_roll_is_the_native_convention():
    rng = np.random.default_rng(12)
    for phi, theta, alpha in rng.uniform(0, 6, (20, 3)):
        assert np.allclose(paper_rotation(phi, theta, alpha), dcm(alpha, theta, phi + np.pi), atol=EXACT)


def errors_of_printed_25(tilt, printed=True):
    """rms error in degrees of inclination, toolface, azimuth over tools and attitudes, signs of (26) granted."""
    rng = np.random.default_rng(13)
    dip, errors = np.radians(70.0), []
    tilted = rotation_exp([0.0, np.radians(tilt), 0.0])
    true_a = {"g": np.array([0.0, 0.0, 1.0]), "b": np.array([np.cos(dip), 0.0, np.sin(dip)])}
    for _ in range(60):
        attitude = rng.uniform(0, 2 * np.pi, (3, 50))
        attitude[1] = np.radians(rng.uniform(20.0, 70.0, 50))
        seen = {}
        for name, a in true_a.items():
            # the truth of the scenarios: axes turned at random, 0.1 a component out of square, 5 % of scale
            axes = rotation_exp(rng.normal(size=3)) + 0.1 * rng.normal(size=(3, 3))
            tensor, offset = rng.uniform(0.95, 1.05, (3, 1)) * axes, rng.uniform(-0.05, 0.05, 3)
            lengths, level = paper_lengths(tensor, offset, tilted @ a, printed)
            readings = np.einsum("mi,kij,j->km", tensor, dcm(*attitude), a) + offset
            own = np.copysign(lengths, tensor)
            seen[name] = (readings - level) @ np.linalg.inv(own).T
        found = angles(seen["g"], seen["b"])
        truth = attitude[[1, 2, 0]]
        off = np.stack([found.inclination, found.toolface, found.azimuth]) - truth
        errors.append(np.degrees((off + np.pi) % (2 * np.pi) - np.pi))
    return np.sqrt(np.mean(np.square(errors), axis=(0, 2)))


def test_printed_25_makes_fluxgates_wrong_by_degrees_and_accelerometers_on_a_tilted_base():
    level = errors_of_printed_25(0.0)
    assert 4.5 < level[2] < 12.0  # deg of azimuth, on a level table
    assert level[:2].max() < 1e-6
    tilted = errors_of_printed_25(5.0)
    assert 0.2 < tilted[0] < 0.6
    assert 0.4 < tilted[1] < 2.0
    assert errors_of_printed_25(5.0, printed=False).max() < 1e-6  # rounding of degrees through tan at worst

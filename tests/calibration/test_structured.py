"""Errors with structure: named where the readings show them, and counted where they do not."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.honest_bench import SCENES, Scene, drawn, errors, one
from scipy.stats import norm
from tests.refusals import coded

from inclinometry.calibration import plans
from inclinometry.calibration.conformity import verify
from inclinometry.calibration.initial_values import starting_state
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import Model, orientation
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.structured import (
    MAGNETISED,
    Block,
    Evidence,
    blocks,
    cause_probabilities,
    covariance_of_undetermined,
    fit_structured,
    undetermined_causes,
    with_repeating,
)
from inclinometry.calibration.variance import fit
from inclinometry.constants import DIALS, KINDS
from inclinometry.findings import words
from inclinometry.orientation import angles
from inclinometry.rotations import dcm, rotation_z
from inclinometry.sensors import Tool, Triad

USUAL = Scene((0.1, 0.1, 0.1))


def calibrated(scene, seed=0, plan=plans.orthogonal, **options):
    at, rng = plan(), np.random.default_rng([7, seed])
    dials = np.stack([at.azimuth, at.inclination, at.toolface], axis=1)
    signals, truth = drawn(dials, scene, rng)
    readings = BenchReadings(signals, *dials.T, reference={"dip": np.radians(70.0), "north": 0.0})
    return calibrate_joint(readings, **options), truth


WORSE = {"the dials are worse than stated", *(f"the {dial} dial is worse than stated" for dial in DIALS)}


def causes(found):
    """Causes that the readings show."""
    return [one.values["cause"] for one in found.findings if one.code == "bench-cause-shown"]


def test_a_magnetised_cradle_is_named_and_most_of_it_taken_out():
    found, truth = calibrated(Scene(cradle=400.0))
    assert MAGNETISED in causes(found)
    off, u = errors(found.tool, truth)
    plain, _ = errors(calibrated(Scene(cradle=400.0), diagnose=False)[0].tool, truth)
    assert np.mean(off**2) < 0.5 * np.mean(plain**2)
    assert np.mean(np.abs(off) < 1.96 * u) > 0.85
    assert found.causes["the cradle that holds the tool is magnetised"].any()


def test_a_sensor_that_bends_is_named():
    found, _ = calibrated(Scene(bent=2e-3))
    assert "the accelerometer is not linear" in causes(found)
    for kind in ("accelerometer", "magnetometer"):
        square, cube = found.bent[kind].T
        # where axes read little but 0 and full scale the cubic part is hardly told from a scale
        np.testing.assert_allclose(np.abs(square), 2e-3, rtol=0.2)
        assert (np.abs(cube) < 2.2e-3).all()


def test_three_dials_keep_their_own_standard_deviations():
    found, _ = calibrated(Scene((0.5, 0.02, 0.02)))
    azimuth, inclination, toolface = np.degrees(found.rig.sd)
    assert 0.3 < azimuth < 0.8
    assert max(inclination, toolface) < 0.06


def test_repeating_errors_are_named_and_not_averaged_away():
    found, _ = calibrated(Scene((0.01, 0.01, 0.01), repeating=0.2), plan=plans.twelve)
    # 0.2 deg, of four to nine values of a dial
    sizes = [one.values["sd_deg"] for one in found.findings if one.code == "bench-dial-repeats"]
    assert sizes
    assert all(0.1 < size < 0.4 for size in sizes)


def test_given_noise_does_not_silence_the_test_of_fit():
    noise = {"accelerometer": 2e-4, "magnetometer": 20.0}
    found, _ = calibrated(Scene(cradle=400.0), noise_sd=noise, rig_sd=np.radians(0.03))
    assert MAGNETISED in causes(found)
    loud, _ = calibrated(Scene(), noise_sd={k: v / 5.0 for k, v in noise.items()}, rig_sd=np.radians(0.03))
    assert "the noise of the magnetometer is larger than stated" in causes(loud)


def test_exact_readings_accuse_nobody():
    found, _ = calibrated(Scene((0.0, 0.0, 0.0)))
    assert not causes(found)
    assert not found.outliers


def test_dials_stated_too_good_are_blamed_and_no_station_is():
    for plan in (plans.twelve, plans.orthogonal):
        found, truth = calibrated(USUAL, plan=plan, rig_sd=np.radians(0.02))
        assert WORSE & set(causes(found))
        assert not found.outliers
        off, u = errors(found.tool, truth)
        assert np.mean(np.abs(off) < 1.96 * u) > 0.9


def test_a_misread_station_is_named_where_the_dials_are_as_good_as_stated():
    found, _ = calibrated(SCENES["one dial misread by 2"], rig_sd=np.radians(0.1))
    assert found.outliers
    assert not WORSE & set(causes(found))


def test_a_magnetometer_that_stays_behind_is_named():
    found, truth = calibrated(SCENES["magnetic hysteresis, 100 nT"])
    assert "the magnetometer has hysteresis: it lags where its field rises and falls" in causes(found)
    off, u = errors(found.tool, truth)
    plain, _ = errors(calibrated(SCENES["magnetic hysteresis, 100 nT"], diagnose=False)[0].tool, truth)
    assert np.mean(off[..., 1] ** 2) < 0.5 * np.mean(plain[..., 1] ** 2)
    assert np.mean(np.abs(off) < 1.96 * u) > 0.85


def test_a_drift_that_the_readings_ask_for_is_fitted_beside_a_wander_that_they_hardly_ask_for(monkeypatch):
    """The wider of two causes is preferred only among those that are asked for."""
    size = np.zeros((1, 1))
    drift, wander = (Block(what, np.zeros((1, 1, 1)), change=what) for what in ("drift", "wander"))
    said_of = {"drift": Evidence(drift, 3.2, 1.0, size, size), "wander": Evidence(wander, 1.5, 1.0, size, size)}

    class Run:
        """As much of a fit as the choice asks for."""

        state = None

        @property
        def model(self):
            return self

        def with_structure(self, state, columns, sd, name):
            return self, state

    where = "inclinometry.calibration.structured"
    monkeypatch.setattr(
        f"{where}.cause_probabilities", lambda run, noise, skip: [v for k, v in said_of.items() if k not in skip]
    )
    monkeypatch.setattr(f"{where}.fit_with_variances", lambda *_: Run())
    assert [block.name for block in fit_structured(Run(), frozenset(), True)[1]] == ["drift"]


@pytest.fixture(scope="module", params=[plans.twelve, plans.orthogonal], ids=["twelve", "cube"])
def fitted(request):
    """A run whose variances are all stated, with errors of its own for each value of each dial."""
    at = request.param()
    dials = np.stack([at.azimuth, at.inclination, at.toolface], axis=1)
    signals, _ = drawn(dials, Scene((0.1, 0.1, 0.1), cradle=200.0), np.random.default_rng(3))
    signals = {
        kind: values / {"accelerometer": 9.81, "magnetometer": 50000.0}[kind] for kind, values in signals.items()
    }
    size = len(dials)
    model = Model(
        signals, dials, np.ones((size, 1)), np.full((size, 6), 4e-4), np.full(3, np.radians(0.1)), np.zeros(4), {}
    )
    return fit(*with_repeating(fit(model, starting_state(model))))


def test_evidence_of_a_block_is_the_ratio_of_two_dense_likelihoods(fitted):
    """Parameters integrated out, dials and what repeats of them as noise; the block's errors given the readings."""
    model, at = fitted.model, fitted.at
    count, known = at.residual.size, len(model.structure_sd)
    jacobian = at.jacobian[..., : at.jacobian.shape[2] - known].reshape(count, -1)
    residual = fitted.marginal_residual().ravel()
    covariance = np.zeros((*at.residual.shape, *at.residual.shape))
    rows = np.arange(len(at.residual))
    spread = at.by_setting * model.rig_sd
    covariance[rows, :, rows] = spread @ spread.swapaxes(1, 2) + 4e-4**2 * np.eye(6)
    covariance = covariance.reshape(count, count)
    repeating = np.broadcast_to(model.structure, (*at.residual.shape, known)).reshape(count, known)
    covariance += repeating * model.structure_sd**2 @ repeating.T

    def free(matrix):
        """P = V^-1 - V^-1 J C J' V^-1 and log |V| + log |J' V^-1 J|."""
        inverse = np.linalg.inv(matrix)
        normal = jacobian.T @ inverse @ jacobian
        projector = inverse - inverse @ jacobian @ np.linalg.solve(normal, jacobian.T @ inverse)
        return projector, np.linalg.slogdet(matrix)[1] + np.linalg.slogdet(normal)[1]

    base, log = free(covariance)
    cost = residual @ base @ residual + log
    gain = np.linalg.solve(jacobian.T @ np.linalg.solve(covariance, jacobian), jacobian.T) @ np.linalg.inv(covariance)
    found = cause_probabilities(fitted, frozenset(), skip={"the magnetometer is not linear"})
    assert "the magnetometer is not linear" not in [told.block.name for told in found]
    assert len(found) >= 12
    for told in found:
        columns = told.block.columns.reshape(count, -1)
        ratios = []
        for size in told.block.sizes:
            projector, log = free(covariance + size**2 * columns @ columns.T)
            ratios.append((cost - residual @ projector @ residual - log) / 2.0)
        assert told.ratio == pytest.approx(max(ratios), abs=1e-6)
        assert told.size == told.block.sizes[int(np.argmax(ratios))]
        inner = np.linalg.inv(np.eye(columns.shape[1]) / told.size**2 + columns.T @ base @ columns)
        mean = inner @ columns.T @ base @ residual
        scale = np.abs(inner).max() + np.abs(mean).max() ** 2
        np.testing.assert_allclose(told.spread, inner + np.outer(mean, mean), atol=1e-8 * scale)
        carried = gain @ columns
        np.testing.assert_allclose(told.carried[: len(gain)], carried, atol=1e-6 * np.abs(carried).max())


def test_blocks_are_what_their_causes_do_to_the_readings(fitted):
    """Each simulated in full on the tool as fitted, of the size that is usual."""
    model, state = fitted.model, fitted.state
    turns = orientation(model.settings + state.errors, np.zeros(4))[0]
    size = len(turns)
    known = {block.name: block for block in blocks(fitted, frozenset())}
    time = np.arange(size) / (size - 1.0) - 1.0  # the tool is that of the end
    for start, kind in ((0, "accelerometer"), (3, "magnetometer")):
        tensor, here = state.coefficients[kind][0, :, :3], slice(start, start + 3)
        seen = turns @ state.directions[kind]
        full = np.linalg.norm(tensor, axis=1)
        share = seen @ tensor.T / full
        others = np.setdiff1d(np.arange(6), np.arange(start, start + 3))
        wanted = {
            f"the {kind} drifts during the run": [1e-3 * time[:, None] + 0 * share, 1e-3 * time[:, None] * share],
            f"the {kind} is not linear": [1e-3 * share**2, 1e-3 * share**3],
            f"the response of the {kind} has a cubic part": [3e-4 * share**3],
        }
        if kind == "accelerometer":
            products = seen[:, [0, 1, 2]] * seen[:, [1, 2, 0]]
            wanted["the accelerometer reads products of its axes"] = [
                1e-3 * products[:, [k]] + 0 * share for k in range(3)
            ]
        else:
            down = turns @ state.directions["accelerometer"]
            # 30 nT a g of 50,000
            wanted["the magnetometer is sensitive to gravity"] = [6e-4 * down[:, [k]] + 0 * share for k in range(3)]
            step = np.diff(share, axis=0, prepend=share[:1])
            way = np.where(np.abs(step) > 0.02, np.sign(step), 0.0)
            stays = known[f"the {kind} has hysteresis: it lags where its field rises and falls"].columns
            # 100 nT of 50,000; a sign for each step that nobody can tell
            untold = int(np.sum(way == 0.0))
            assert stays.shape[2] == 3 + untold
            total = np.abs(stays[:, here]).sum(axis=2)
            np.testing.assert_allclose(total, 2e-3 * full * np.ones((size, 1)), rtol=1e-9)
            for sensor in range(3):
                column = [c for c in range(stays.shape[2]) if np.count_nonzero(stays[:, start + sensor, c]) > 1]
                np.testing.assert_allclose(stays[:, start + sensor, column[0]], 2e-3 * full[sensor] * way[:, sensor])
            # 200 nT of 50,000, turning with the tool's roll
            cradle = 4e-3 * tensor @ rotation_z(model.settings[:, 2] + state.errors[:, 2])
            np.testing.assert_allclose(known["the cradle that holds the tool is magnetised"].columns[:, here], cradle)
        for name, causes in wanted.items():
            columns = known[name].columns.reshape(size, 6, 3, len(causes))
            assert not columns[:, others].any()
            for sensor in range(3):
                for place, cause in enumerate(causes):
                    own = np.zeros((size, 3))
                    own[:, sensor] = full[sensor] * cause[:, sensor]
                    np.testing.assert_allclose(columns[:, here, sensor, place], own, atol=1e-15)
            if known[name].at_use is not None:
                fields = {k: turns @ state.directions[k] for k in model.signals}
                use = known[name].at_use(fields) * full[:, None]
                np.testing.assert_allclose(use, np.stack([full * cause for cause in causes], axis=-1), atol=1e-15)
        # a walk of unit steps that ends at nothing: products of its values, less what eight components leave
        walk = known[f"the offset of the {kind} changes at random from station to station"].columns[:, start]
        walk = walk.reshape(size, 3, -1)[:, 0] / full[0]
        left = np.arange(size)[::-1]
        both = np.minimum.outer(left, left)
        assert walk.shape[1] == min(8, size - 1)
        assert np.abs(walk @ walk.T - both).max() < 0.06 * size
        assert np.trace(walk @ walk.T) > 0.95 * np.trace(both)


def test_dials_that_are_stated_are_doubted(fitted):
    stated = replace(fitted, model=replace(fitted.model, rig_known=np.array([True, False, True])))
    known = {block.name: block for block in blocks(stated, {"accelerometer", "magnetometer"})}
    worse = [name for name in known if "worse than stated" in name]
    assert worse == [
        "the azimuth dial is worse than stated",
        "the toolface dial is worse than stated",
        "the dials are worse than stated",
    ]
    sd, size = np.radians(0.1), len(stated.at.residual)
    for dial, name in ((0, worse[0]), (2, worse[1])):
        columns = known[name].columns
        np.testing.assert_allclose(columns[np.arange(size), :, np.arange(size)], sd * stated.at.by_setting[..., dial])
        assert np.count_nonzero(columns.any(axis=1)) <= size
    assert known[worse[2]].columns.shape[2] == 2 * size
    assert not any("larger than stated" in name for name in known)
    exact = replace(stated, model=replace(stated.model, rig_sd=np.zeros(3)))
    for block in blocks(exact, {"accelerometer", "magnetometer"}):
        if block.name == worse[0]:  # a graduation's usual error stands in for one that was stated to be none
            np.testing.assert_allclose(block.columns, known[worse[0]].columns * 1e-3 / sd)
    noise = {block.name: block for block in blocks(stated, {"magnetometer"})}[
        "the noise of the accelerometer is larger than stated"
    ]
    np.testing.assert_allclose(noise.columns.sum(axis=2)[:, :3], 4e-4)
    assert not noise.columns[:, 3:].any()


def test_what_is_not_excluded_counts_by_its_chance():
    """Evidence against a cause takes it out, evidence for it leaves all of it in, whatever else ends with the run."""
    column, unit = np.ones((1, 1)), Block("x", np.zeros((1, 1, 1)))

    def added(ratio, block=unit):
        return float(
            covariance_of_undetermined([Evidence(block, ratio, 1.0, 2.0 * column, 3.0 * column)], np.zeros((1, 1)))[
                0, 0
            ]
        )

    assert added(1.0) == pytest.approx(12.0)  # all of it: 2 x 3 x 2
    assert added(60.0) == pytest.approx(12.0)
    assert added(-20.0) < 1e-6
    levels = [added(ratio) for ratio in np.linspace(-5.0, 0.4, 28)]
    assert (np.diff(levels) >= 0.0).all()
    assert levels[-1] < 12.0
    # one in six where the readings say nothing: an error of 12 that is there so often goes in one run of twenty beyond
    # 1.96 of what is added
    assert norm.sf(norm.isf(0.025) * np.sqrt(added(0.0) / 12.0)) * 2.0 / 6.0 == pytest.approx(0.05, rel=1e-6)
    assert added(5.0, replace(unit, stays=False)) == 0.0
    two = covariance_of_undetermined([Evidence(unit, 1.0, 1.0, 2.0 * column, 3.0 * column)] * 2, np.zeros((1, 1)))
    assert two[0, 0] == pytest.approx(24.0)


def test_what_is_left_open_is_said_in_degrees_of_the_angles():
    """An offset of 0.01 on the accelerometer's x, in the parameters or in the signals in use, or in both."""
    dip = np.radians(70.0)
    directions = {"accelerometer": np.array([0.0, 0.0, 1.0]), "magnetometer": np.array([np.cos(dip), 0.0, np.sin(dip)])}
    triads = {kind: Triad(kind, np.eye(3), np.zeros(3)) for kind in directions}
    tool = Tool("t", triads, 1e-10 * np.eye(24))
    grid = np.radians(np.arange(0.0, 360.0, 15.0))

    def rms(error, inclination):
        azimuth, toolface = (v.ravel() for v in np.meshgrid(grid, grid))
        turns = dcm(azimuth, np.full_like(azimuth, inclination), toolface)
        found = angles(turns @ directions["accelerometer"] + error, turns @ directions["magnetometer"])
        off = found.azimuth - azimuth
        off = (off + np.pi) % (2.0 * np.pi) - np.pi
        return np.degrees(np.sqrt([np.mean((found.inclination - inclination) ** 2), np.mean(off**2)]))

    # to first order: a thousandth of the error, ten times; both angles where the hole leans, inclination everywhere
    rows = 10.0 * np.array([rms(np.array([1e-3, 0.0, 0.0]), np.radians(i)) for i in (5.0, 30.0, 60.0, 90.0)])
    wanted = [pytest.approx(size, rel=0.01) for size in (rows[:, 0].max(), rows[1:, 1].max())]
    column, unit = np.zeros((24, 3)), np.eye(3)  # an error for each sensor alone, of which that of x is there
    column[3, 0] = 0.01  # its offset: tensor element by element, then the offset, a sensor

    def in_use(seen):
        return 0.01 * np.eye(3)[:, :1] + 0.0 * seen["accelerometer"][..., None]

    plain = Block("a cause", np.zeros((1, 1, 1)))
    used = replace(plain, kind="accelerometer", at_use=in_use)
    none = np.zeros((24, 24))
    for block, carried in ((plain, column), (used, 0.0 * column)):
        (said_,) = undetermined_causes(tool, directions, [Evidence(block, 0.0, 1.0, carried, unit)], none)
        assert [said_.values["inclination_deg"], *said_.values["azimuth_deg"]] == wanted
        assert (said_.code, said_.severity, said_.values["causes"]) == ("bench-open", "note", ("a cause",))
    # what calibration and use have in common does no harm
    assert undetermined_causes(tool, directions, [Evidence(used, 0.0, 1.0, column, unit)], none) == []
    # nor what the readings speak against, what ends with the run, or what is below the uncertainty
    assert undetermined_causes(tool, directions, [Evidence(plain, -1.5, 1.0, column, unit)], none) == []
    assert (
        undetermined_causes(tool, directions, [Evidence(replace(plain, stays=False), 0.0, 1.0, column, unit)], none)
        == []
    )
    assert undetermined_causes(tool, directions, [Evidence(plain, 0.0, 1.0, 1e-4 * column, unit)], none) == []
    alone = Tool("t", {"accelerometer": triads["accelerometer"]}, 1e-10 * np.eye(12))
    (said_,) = undetermined_causes(alone, directions, [Evidence(plain, 0.0, 1.0, column[:12], unit)], none[:12, :12])
    assert (said_.values["inclination_deg"], said_.values["azimuth_deg"]) == (wanted[0], ())


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["accelerometer drifts by 0.5 mg", "sensors bent, 1e-3", "magnetic hysteresis, 100 nT"]
)
def test_what_twelve_positions_leave_open_is_named_and_counted(name):
    rows = [one("12 positions", SCENES[name], seed) for seed in range(24)]
    assert np.mean([row["inside"] for row in rows]) > 0.85
    assert np.mean([bool(row["said"]) for row in rows]) > 0.9


@pytest.mark.long
def test_a_drift_near_the_vertical_is_named():
    rows = [one("12 positions", SCENES["accelerometer drifts by 0.5 mg"], seed) for seed in range(24)]
    assert np.mean(["the accelerometer drifts during the run" in row["causes"] for row in rows]) > 0.85
    assert np.mean([row["inside"][0] for row in rows]) > 0.85


@pytest.mark.long
def test_a_dial_misread_by_ten_standard_deviations_is_named_in_twelve_positions():
    runs = 40
    named = 0
    for seed in range(runs):
        found, _ = calibrated(SCENES["one dial misread by 1"], seed, plans.twelve)
        named += bool(found.outliers)
    assert named >= 0.9 * runs  # 95 in 100; three standard errors


@pytest.mark.long
@pytest.mark.parametrize("plan", ["12 positions", "24 positions"])
def test_clean_runs_are_covered_and_not_accused(plan):
    rows = [one(plan, USUAL, seed) for seed in range(40)]
    assert np.mean([row["inside"] for row in rows]) > 0.92
    assert np.mean([row["accused"] for row in rows]) <= 0.05
    assert np.mean([row["warned"] for row in rows]) <= 0.15
    ratio = np.mean([row["square"] for row in rows]) / np.mean([row["stated"] for row in rows])
    assert 0.3 < ratio < 1.3


@pytest.mark.long
@pytest.mark.parametrize("name", ["repeating errors, 0.1", "dials 0.5, 0.02, 0.02", "magnetised cradle, 200 nT"])
def test_stands_that_are_worse_than_the_model_are_covered(name):
    rows = [one("24 positions", SCENES[name], seed) for seed in range(24)]
    assert np.mean([row["inside"] for row in rows]) > 0.88


def test_a_response_that_no_position_shows_is_left_open_by_name():
    """Along its axes a triad reads nothing but 0 and full scale: products vanish and a cubic part is a scale."""
    plan, g = plans.orthogonal(), np.random.default_rng(4)
    settings = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    turned = settings + np.radians(0.02) * g.standard_normal(settings.shape)
    seen = dcm(*turned.T) @ [0.0, 0.0, 1.0]
    signals = seen + 3e-5 * g.standard_normal(seen.shape)
    found = calibrate_joint(BenchReadings({"accelerometer": signals}, *settings.T))
    (note,) = (one for one in found.findings if one.code == "bench-open")
    named = {"the accelerometer reads products of its axes", "the response of the accelerometer has a cubic part"}
    assert named <= set(note.values["causes"])


def test_a_calibration_is_the_tool_of_the_end_of_the_run():
    tool, drift = np.eye(3), np.array([2e-3, -1e-3, 1.5e-3])
    plan, g = plans.orthogonal(), np.random.default_rng(5)
    settings = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    turned = settings + np.radians(0.03) * g.standard_normal(settings.shape)
    seen = dcm(*turned.T) @ [0.0, 0.0, 1.0]
    signals = seen @ tool + np.linspace(-1.0, 0.0, 24)[:, None] * drift + 2e-5 * g.standard_normal(seen.shape)
    found = calibrate_joint(BenchReadings({"accelerometer": signals}, *settings.T))
    assert "bench-end-of-run" in {one.code for one in found.findings}
    triad = found.tool.triads["accelerometer"]
    u = np.sqrt(np.diag(found.tool.covariance))[3::4]
    assert (np.abs(triad.offset[0]) < 3.0 * u).all()
    assert (u < 0.3e-3).all()  # a third of the half of the least of the drifts


def test_a_verification_in_a_magnetised_cradle_says_so():
    found, _ = calibrated(Scene(cradle=400.0))
    plan = plans.spread()
    dials = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    signals, _ = drawn(dials, Scene(cradle=400.0), np.random.default_rng(3))
    judged = verify(BenchReadings(signals, *dials.T), found)
    assert "verify-cradle" in coded(judged.findings)


def test_every_cause_has_its_words():
    """Findings name causes by a word of the catalogue, in three languages."""
    plan = plans.orthogonal()
    turns = dcm(plan.azimuth, plan.inclination, plan.toolface)
    signals = {kind: turns @ [0.6, 0.0, 0.8] for kind in KINDS}
    ones = np.ones((24, 9))
    dials = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    model = Model(
        signals, dials, ones[:, :1], ones, np.full(3, 1e-3), np.zeros(4), {}, rig_known=np.ones(3, dtype=bool)
    )
    assert {block.name for block in blocks(fit(model, starting_state(model)), set())} <= words()

"""Evidence of runs in the hole: what stations show of the tool, without what was known of it before."""

from __future__ import annotations

import datetime
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.fleet_statistics import NOMINAL, V12, analysed_run, run_section
from tests.refusals import refused

from inclinometry.calibration.drift import DriftModel, azimuth_sd, drift_states, fit_drift
from inclinometry.calibration.drift_alarm import innovations
from inclinometry.calibration.interval import due_date
from inclinometry.constants import DIP, STANDARD_GRAVITY
from inclinometry.history import UNSEEN, ToolHistory, tool_from_relative
from inclinometry.orientation import fields
from inclinometry.sensors import Tool
from inclinometry.simulate.fleet import drift_variance
from inclinometry.survey.history_from_run import run_evidence
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import FieldReference, priors_from_tool, published_priors
from inclinometry.survey.reduce import SensorCorrection, correction_of
from inclinometry.survey.stations import Stations

REDUCED = tool_from_relative(NOMINAL, np.zeros(24), V12, "7")


def nees(interference: float, runs: int = 40) -> tuple[float, float]:
    """Squared error a parameter of a prediction a year old and a run together, and of the directions the run shows."""
    random, drift = np.random.default_rng(1), drift_variance()
    together, alone = [], []
    for _ in range(runs):
        truth = np.linalg.cholesky(drift) @ random.standard_normal(24)
        values, covariance = analysed_run(truth, REDUCED, random, interference)
        information = np.linalg.inv(covariance)
        both = np.linalg.inv(np.linalg.inv(drift) + information)
        off = both @ information @ values - truth
        together.append(off @ np.linalg.solve(both, off) / 24.0)
        alone.append((values - truth) @ information @ (values - truth) / 21.0)
    return float(np.mean(together)), float(np.mean(alone))


@pytest.mark.parametrize("interference", [300.0, 100.0])
def test_evidence_errs_as_much_as_it_says_though_300_nt_be_three_times_what_is_stated(interference: float) -> None:
    together, alone = nees(interference)
    # 40 runs of 24 and 21 degrees of freedom: a standard deviation of 0.05
    assert 0.85 < together < 1.15
    assert 0.85 < alone < 1.15


def test_what_a_run_cannot_show_is_left_open() -> None:
    _, covariance = analysed_run(np.zeros(24), REDUCED, np.random.default_rng(2))
    for axis in range(3):  # accelerometers and magnetometers turned together
        turned = np.zeros((3, 4))
        turned[(axis + 1) % 3, (axis + 2) % 3], turned[(axis + 2) % 3, (axis + 1) % 3] = 1.0, -1.0
        both = np.tile(turned.ravel(), 2)
        seen = both @ np.linalg.solve(covariance, both)
        assert seen == pytest.approx(both @ both / UNSEEN**2, rel=0.2)
    after = np.linalg.inv(np.linalg.inv(covariance) + np.linalg.inv(drift_variance()))
    gained = np.sqrt(np.diagonal(after) / np.diagonal(drift_variance()))
    assert gained[[15, 19]].max() < 0.6  # transverse offsets of the magnetometers
    assert gained[23] > 0.9  # the axial one stands behind 300 nT of interference


def correction(spoilt: float = 0.0, tool: Tool | None = REDUCED) -> SensorCorrection:
    random = np.random.default_rng(3)
    turn, inclination = random.uniform(0.0, 6.28, 40), np.radians(np.linspace(5.0, 70.0, 40))
    g, b = fields(np.full(40, 1.0), inclination, turn, DIP)
    g, b = STANDARD_GRAVITY * g + random.normal(0.0, 1.5e-3, (40, 3)), 5e4 * b + random.normal(0.0, 60.0, (40, 3))
    b[7] += spoilt
    reference = FieldReference(g=STANDARD_GRAVITY, b=5e4, dip=DIP, g_sigma=0.002, b_sigma=130.0, dip_sigma=0.0035)
    priors = published_priors() if tool is None else priors_from_tool(tool)
    return correction_of(multistation(Stations(30.0 * np.arange(40.0), g, b), reference, priors), reference, priors)


def test_what_is_no_evidence() -> None:
    run_evidence(correction(), REDUCED)
    with refused("survey-chi-square"):
        run_evidence(correction(1500.0), REDUCED)
    with refused("survey-evidence-priors"):
        run_evidence(correction(tool=None), REDUCED)
    warm = {kind: replace(one, tensor=np.stack([one.tensor[0]] * 2), offset=np.stack([one.offset[0]] * 2))
            for kind, one in REDUCED.triads.items()}  # fmt: skip
    with refused("survey-evidence-priors"):  # a file of an earlier version
        run_evidence(replace(correction(), information=np.zeros((0, 0)), score=np.zeros(0)), REDUCED)
    with refused("survey-calibration", advice="Calibrate it again instead"):
        run_evidence(correction(), Tool("7", warm, np.eye(48) * 1e-8))
    with refused("survey-calibration", reason="it has no full covariance"):
        run_evidence(correction(), Tool("7", REDUCED.triads, np.diag([0.0, *[1e-8] * 23])))


def history(*, runs: bool) -> ToolHistory:
    random = np.random.default_rng(4)
    days = [datetime.date(2024, 1, 1), datetime.date(2025, 1, 1), datetime.date(2025, 7, 1), datetime.date(2026, 1, 1)]
    values, covariance = analysed_run(np.zeros(24), REDUCED, random)
    whole = ToolHistory(
        "7", "X", days, np.stack([np.zeros(24), np.zeros(24), values, np.zeros(24)]),
        np.stack([V12, V12, covariance, V12]), [9.0, 100.0, 30.0, 40.0], run=["", "", "R1", ""],
    )  # fmt: skip
    return whole if runs else whole.calibrations


def test_a_run_sharpens_the_state_and_is_no_calibration() -> None:
    whole, bare = history(runs=True), history(runs=False)
    np.testing.assert_array_equal(bare.hours, [9.0, 100.0, 70.0])
    assert (len(whole), len(bare), bare.run) == (4, 3, ("", "", ""))
    zero = np.zeros((24, 24))
    model = DriftModel("X", drift_variance(), zero, np.zeros((24, 2)), 1.0, 1.0, 0.0, DIP, 1, 1, "", "", "")
    with_run, without = drift_states([whole, bare], model)
    half_a_year = azimuth_sd(without[1].predicted(model, 0.5).covariance)
    assert (azimuth_sd(with_run[2].covariance) < 0.8 * half_a_year)[:3].all()
    found = innovations([whole, bare], model)
    assert list(zip(found.history, found.number, strict=True)) == [(0, 1), (0, 3), (1, 1), (1, 2)]
    # no run makes an interval longer than the longest
    sharp = drift_states([whole.until(3)], replace(model, drift=1e-4 * model.drift))[0][-1]
    due = due_date(sharp, replace(model, drift=1e-4 * model.drift), whole.date[2], calibrated=whole.date[1])
    assert (due.longest, due.date.year) == (True, 2030) or due.date <= datetime.date(2030, 1, 1)
    # the drift of the type is that of its calibrations
    others = [replace(one, serial=str(k)) for one in (whole, bare) for k in range(2)]
    fits = [fit_drift(pair, reproducibility=False, own_drift=False, iterations=3)
            for pair in ([*others[:2], bare], [*others[2:], bare])]  # fmt: skip
    np.testing.assert_array_equal(fits[0].drift, fits[1].drift)
    with refused("input-shape"):
        ToolHistory("7", "X", whole.date[:1], np.zeros((1, 24)), V12[None], run=["R1"])


@pytest.mark.long
def test_two_runs_sharpen_a_prediction_and_leave_it_honest() -> None:
    rows = run_section(tools=100)
    without, with_runs = rows["prediction, 12 months"], rows["with two runs"]
    # by the sizes of the specification .364/.222/.218/.217 to .225/.120/.151/.165
    assert (np.array(with_runs["made"]) < 0.85 * np.array(without["made"])).all()
    assert 0.8 < with_runs["nees"] < 1.15
    assert with_runs["nees"] == pytest.approx(without["nees"], abs=0.05)  # what is off is the drift found, not the runs

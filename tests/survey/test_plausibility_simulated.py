"""Runs, plans and tables of holes that the benchmark draws: right ones are silent, mistakes are named."""

from __future__ import annotations

import pytest
from benchmarks import plausibility

from inclinometry.findings import without_notes
from inclinometry.survey.plausibility import check_run


@pytest.mark.long
def test_right_runs_and_plans_are_not_refused_and_hardly_warned_of():
    runs = [
        (seed, what, run)
        for seed in range(plausibility.RIGHT_SEED, plausibility.RIGHT_SEED + 100)
        for what, run in ({"angles": plausibility.table(plausibility.well(seed))} | plausibility.assumed(seed)).items()
    ]
    found = {(seed, what): without_notes(check_run(run)) for seed, what, run in runs}
    assert not [one for said in found.values() for one in said if one.severity == "refused"]
    assert sum(map(bool, found.values())) <= 0.01 * len(runs)


@pytest.mark.long
@pytest.mark.parametrize(
    ("fault", "least"),
    [
        ("inclination 28 deg off", 0.9),
        ("both angles in grads from midway", 0.6),
        ("azimuth 0 at every", 0.8),
        ("inclination 0 at every", 0.6),
        ("per cent of slope", 0.9),
        ("true vertical depths", 0.9),
        ("counted on in feet", 0.6),
    ],
)
def test_mistakes_of_columns_and_parts_are_named(fault, least):
    (row,) = plausibility.faults(60, fault)
    assert row["named"] >= least


@pytest.mark.long
def test_shots_of_tables_of_holes():
    shares, wrong = plausibility.hole_tables(40)
    assert all(share >= (0.6 if words == "one dip 20 deg off" else 0.9) for words, _, share in shares), shares
    assert len({seed for seed, _ in wrong}) <= 1

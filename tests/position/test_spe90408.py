"""Gyro error models against the covariances printed in Appendix E of SPE 90408."""

import numpy as np
from tests.refusals import refused

from inclinometry.constants import FOOT
from inclinometry.earth.site import Site
from inclinometry.files.tool_code_json import load_tool_code
from inclinometry.position.propagation import Run, propagate, propagate_runs
from inclinometry.position.well import well_survey

NAMES = ("NN", "EE", "VV", "NE", "NV", "EV")
# Elements out of the paper's own band (1 % or 2 units). Well 3 with model 4 below 3000 m is inconsistent in print: its
# north and east disagree with models 3 and 5, which differ from it little. Model 1 on well 2 is 2 to 3 % low where the
# hole turns south.
MISSED = {
    ("well2", "1", "7102", "NE"), ("well2", "1", "9398", "NE"), ("well2", "1", "12500", "NN"),
    ("well2", "1", "12500", "NE"), ("well2", "1", "12500", "EE"), ("well3", "1", "3000", "NN"),
    ("well3", "4", "3000", "NE"), ("well3", "4", "3000", "EE"), ("well3", "4", "3720", "NN"),
    ("well3", "4", "3720", "NE"), ("well3", "4", "4030", "NN"), ("well3", "4", "4030", "NE"),
    ("well3", "4", "4030", "EE"),
}  # fmt: skip


def test_at_least_479_of_492_elements_are_in_the_papers_band(columns, sites, reference):
    read, six = reference
    rows = read("spe90408", "appendix_e.csv")
    cases = {(row["well"], row["model"]) for row in rows}
    missed, count = set(), 0
    for well, model in sorted(cases):
        mine = [row for row in rows if (row["well"], row["model"]) == (well, model)]
        unit = FOOT if mine[0]["md_unit"] == "ft" else 1.0
        column = columns[well[-1]]
        # models 1 and 2 end where the paper's table ends: their accelerometers don't see along a horizontal hole
        end = int(np.searchsorted(column["md"], max(float(row["md"]) for row in mine) * unit + 0.3))
        survey = well_survey(site=sites[well[-1]], **{name: values[:end] for name, values in column.items()})
        covariance = six(propagate(survey, load_tool_code(f"spe90408-model-{model}")).covariance) / unit**2
        for row in mine:
            at = int(np.argmin(np.abs(survey.md - float(row["md"]) * unit)))
            for name, got in zip(NAMES, covariance[at], strict=True):
                expected = float(row[name])
                count += 1
                if abs(got - expected) > max(0.01 * abs(expected), 2.0):
                    missed.add((well, model, row["md"], name))
    assert count == 492
    assert missed == MISSED
    assert count - len(missed) >= 479


def test_a_gyro_that_cannot_see_north_in_a_horizontal_hole_says_so(iscwsa):
    with refused("position-weight"):
        propagate(iscwsa["1"], load_tool_code("spe90408-model-1"))


def test_a_gyro_needs_a_latitude(columns):
    survey = well_survey(site=Site(g=9.81), **columns["1"])
    with refused("position-site"):
        propagate(survey, load_tool_code("spe90408-model-6"))


def test_a_gyro_is_initialised_anew_in_each_run(iscwsa):
    survey, code = iscwsa["2"], load_tool_code("spe90408-model-5")
    middle = len(survey) // 2
    runs = propagate_runs(survey, [Run(0, middle, code), Run(middle + 1, len(survey) - 1, code)])
    drift = runs.sources["run 2: XYZ-GD"]
    assert not drift.vectors[0, : middle + 1].any()
    # what the second run gathers, it gathers from its own first course on
    whole = propagate(survey, code).sources["XYZ-GD"]
    assert np.trace(drift.covariance[-1]) < 0.5 * np.trace(whole.covariance[-1])


def test_a_continuous_gyro_that_never_starts_adds_nothing():
    md = np.arange(0.0, 600.0, 30.0)
    site = Site(latitude=0.9, g=9.81)
    survey = well_survey(md, np.full(len(md), 0.1), np.full(len(md), 1.0), site)
    found = propagate(survey, load_tool_code("spe90408-model-3"))
    for name in ("GRN-INIT", "GXY-GD", "GXY-GRW"):
        np.testing.assert_array_equal(found.sources[name].covariance, np.zeros((len(md), 3, 3)))
    assert found.sources["GB2"].covariance[-1].any()

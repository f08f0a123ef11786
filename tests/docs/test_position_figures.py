"""What the pages on positions and surveys say in words about the numbers that are worked out for them."""

from importlib import import_module

import numpy as np
import pytest

support = pytest.fixture(lambda: [import_module(f"support.{name}") for name in ("position_figures", "survey_figures")])


def test_every_source_of_the_examples_is_in_the_table(support):
    found = support[0].mwd()
    assert len(found["iscwsa_table"].splitlines()) == 2 + 40 + 1  # 27 and 35 terms, 22 of them in both; totals
    assert found["iscwsa_worst"] == "below 1e-12"
    assert float(found["iscwsa_long"]) <= 1.5e-6
    assert float(found["iscwsa_total"]) < 5e-5


def test_the_text_of_the_workbooks_is_not_what_they_calculate(support):
    text = support[0].workbooks()["workbook_table"]
    for line in text.splitlines()[2:]:
        worst = max(float(cell) for cell in line.replace("below", "").split("|")[-3:-1])
        assert worst > 1e-6, line


def test_rev_4_has_the_declination_of_rev_5_in_one(support):
    found = support[0].layers()
    assert float(found["layers_dec"]) == pytest.approx(0.36, abs=5e-4)
    assert float(found["layers_dbh"]) == pytest.approx(5000.0, abs=0.5)


def test_misses_of_the_gyro_models_are_those_of_the_tests(support):
    page = support[0]
    text = page.gyro()
    assert text["gyro_in"] == text["gyro_expected"] == "479"
    assert len(text["gyro_misses"].splitlines()) == 2 + len(page.MISSED)


@pytest.mark.long
def test_drawn_tools_end_where_the_certificate_says(support):
    low, high = map(float, support[0].certificate(2000)["certificate_ratio"].split(" to "))
    assert 0.94 < low < high < 1.06  # nearly four standard deviations of a ratio from 2000 draws


def test_the_narrow_prior_is_incompatible_and_honesty_costs_one_station_in_twenty(support):
    page = support[1]
    usual, narrow, honest = page.forty(), page.forty(230.0), page.forty(true_noise=True)
    assert usual.runs_beyond == honest.runs_beyond == 0
    assert narrow.runs_beyond > 0
    assert narrow.impossible > 0
    for found in (usual, honest):  # the noise that the run shows takes the place of the published one
        assert found.stations_beyond == pytest.approx(0.05, abs=0.03)  # stations of a run share their errors


def test_a_green_light_is_worth_nothing_level_east_west(support):
    lines = support[1].limits()["limit_table"].splitlines()[2:]
    hidden = {tuple(row.split("|")[1:3]): row.split("|")[-2].strip() for row in lines}
    assert float(hidden[" 88 ", " 90 "]) > 30.0
    assert all(float(value) < 2.0 for where, value in hidden.items() if where != (" 88 ", " 90 "))


def test_the_packages_fail_at_the_poles(support):
    from inclinometry.earth.magnetic import wmm2025

    page = support[1]
    assert np.isnan(page._igrf(90.0)).any()
    south = wmm2025(-np.pi / 2, 0.0, 0.0, 2025.0)
    assert page._wmm(-90.0)[2] * float(south.down) < 0.0
    assert abs(page._wmm(89.999999)[1] - page._wmm(89.0)[1]) > 40.0  # nT in a degree, where the field changes by 20

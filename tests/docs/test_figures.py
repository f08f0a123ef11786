"""What the page on identification says in words about the numbers that are worked out for it."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


figures = pytest.fixture(lambda: import_module("support.figures"))


def test_the_erratum_spares_accelerometers_on_a_level_base_only(figures):
    tools = figures.random_tools(1, 100)
    level, tilted = figures.erratum_errors(tools, 0.0), figures.erratum_errors(tools, np.radians(5.0))
    assert level[0] < 1e-6  # degrees: a1 = a2 = 0 for gravity
    assert level[1] > 4.5
    assert tilted[0] > 0.2
    assert tilted[2] > 0.4


def test_the_joint_model_sees_the_inclination_zero_where_the_text_says_so(figures):
    """Two thirds in the 24, none at one azimuth; the toolface zero never. Rounding aside these are exact zeros."""
    share = {name: figures.share_left(plan) for name, plan in figures.PLANS.items()}
    assert 0.6 < share["orthogonal (24)"][0] < 0.72
    assert share["twelve"][0] > 0.3
    for name in ("rotations 45/135", "rotations 30/120"):
        assert share[name][0] < 1e-7
    assert max(values[1] for values in share.values()) < 1e-7


def test_only_the_rotations_at_45_and_135_are_blind(figures):
    rows = figures.identifiability()["blind_table"].splitlines()[2:]
    blind = [row for row in rows if "nothing" not in row]
    assert len(blind) == 1
    assert blind[0].startswith("| rotations 45/135 |")


def test_north_and_roll_errors_cost_what_the_text_says(figures):
    assert float(figures.north_error()["north_error"]) == pytest.approx(0.38, abs=0.06)  # source: 0.38 at dip 68
    trusted, estimated = (float(v) for v in figures.roll_errors(15).values())
    assert 0.15 < trusted < 0.3  # 0.20 in the source
    assert estimated < trusted / 3.0


def test_the_24_positions_are_those_of_the_table(tmp_path):
    """x, y, z of the tool at each number, from the reconstruction of the article's table; A is number 2."""
    from support import drawing

    from inclinometry.calibration import plans

    table = "UEN EDN DWN WUN UWS WDS DES EUS NED ESD SWD WND NWU WSU SEU ENU NUE USE SDE DNE NDW DSW SUW UNW"
    plan = plans.orthogonal()
    dials = zip(plan.azimuth, plan.inclination, plan.toolface, strict=True)
    assert " ".join(drawing.axis_words(*dial).replace(" ", "") for dial in dials) == table
    drawing.positions(tmp_path / "p.svg", plan)
    drawn = (tmp_path / "p.svg").read_text(encoding="utf-8")
    assert drawn.count('class="number"') == 24
    assert "nan" not in drawn


def test_the_classical_method_breaks_where_the_text_says(figures):
    """0.2 deg at a third of a per cent of the data sheet, or at axes leaning by more than 6 deg."""
    assert figures.data_sheet_errors(0.1, 0.33) == pytest.approx(0.2, abs=0.03)
    assert figures.data_sheet_errors(6.0, 0.0) < 0.2 < figures.data_sheet_errors(7.0, 0.0)
    assert figures.data_sheet_errors(1.0, 0.0) < 0.01


def test_magnetometers_give_the_azimuth_of_the_paper(figures):
    """1.5 to 2.0 deg with fluxgates, 0.2 to 0.5 with magnetoresistive sensors, each at ordinary inclinations."""
    fluxgate = figures.closed_forms.sensor_claims("fluxgate", 30, (30.0, 60.0))
    resistive = figures.closed_forms.sensor_claims("magnetoresistive", 30, (30.0, 60.0))
    assert all(1.5 < value < 2.0 for value in fluxgate)
    assert all(0.15 < value < 0.5 for value in resistive)

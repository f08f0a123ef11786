"""What the page on identification says in words about the numbers that are worked out for it."""

from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def figures(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from support import figures

    return figures


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

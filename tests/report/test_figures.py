"""Drawings: no global state, the same bytes, colours of the page."""

import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.report.comparison import MethodCurve, comparison_figure
from inclinometry.report.figure import INK, inline_svg, save_png, save_svg, style

CURVES = [MethodCurve(f"method {n}", np.radians([5.0, 45.0, 90.0]), [1e-4 * n] * 3, [1e-3 * n] * 3) for n in (1, 2, 3)]


@pytest.mark.long
def test_same_bytes_whatever_the_users_settings(tmp_path):
    save_png(comparison_figure(CURVES), tmp_path / "a.png")
    save_svg(comparison_figure(CURVES), tmp_path / "a.svg")
    with matplotlib.rc_context({"font.size": 30.0, "axes.facecolor": "yellow", "svg.fonttype": "path"}):
        save_png(comparison_figure(CURVES), tmp_path / "b.png")
        save_svg(comparison_figure(CURVES), tmp_path / "b.svg")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert INK in (tmp_path / "a.svg").read_text()  # a file of its own has a real colour


def test_nothing_global_is_left_behind():
    before = dict(matplotlib.rcParams)
    inline_svg(comparison_figure(CURVES, title="all"), "one", "methods")
    assert dict(matplotlib.rcParams) == before
    with style():
        assert matplotlib.rcParams["svg.hashsalt"] == "inclinometry"
    assert dict(matplotlib.rcParams) == before


def test_text_is_never_rewritten():
    name = 'id="a" #010203 <b>'
    svg = inline_svg(comparison_figure([CURVES[0]._replace(name=name)]), "one", 'a "quoted" <text>')[0]
    assert 'id="a" #010203 &lt;b&gt;' in svg
    assert "a &#34;quoted&#34; &lt;text&gt;" in svg
    assert "currentColor" in svg


def test_bad_rows_are_named():
    with refused("input-empty", error=InputError, name="rows"):
        comparison_figure([])
    with refused("input-shape", error=InputError, name="odd", shape="(1,)", expected="(2,)"):
        comparison_figure([MethodCurve("odd", [0.1, 0.2], [1e-3], [1e-3, 1e-3])])


def test_importing_the_reports_loads_no_drawing_library():
    code = (
        "import sys, inclinometry.report.calibration, inclinometry.report.survey, inclinometry.report.verification\n"
        "import inclinometry.report.comparison\n"
        "print([m for m in ('matplotlib', 'jinja2', 'scipy', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

"""Formulas of the manual as a browser draws them: subscripts below, powers above, fractions one over the other."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
PAGE = r"""# Formulas

$U_0 = n_1 a_1$ and $k^2$

$$\frac{a}{b}$$
"""
CONF = """
import sys
sys.path[:0] = [{docs!r}]
extensions = ["support.mathml", "myst_parser"]
html_math_renderer, html_theme = "mathml", "basic"
html_static_path, html_css_files = [{static!r}], ["style.css"]
myst_enable_extensions = ["dollarmath"]
"""
MEASURED = """<script>
document.fonts.load("16px InclinometryMath").then(faces => {
    const box = e => e.getBoundingClientRect(), middle = e => (box(e).top + box(e).bottom) / 2;
    const lower = (parent, sign) => [...document.querySelectorAll(parent)].map(
        e => sign * (middle(e.children[1]) - middle(e.children[0])) / box(e.children[0]).height);
    document.title = "measured " + JSON.stringify({
        font: faces.length === 1 && faces[0].status === "loaded",
        subscripts: lower("msub", 1), powers: lower("msup", -1), fractions: lower("mfrac", 1)});
});
</script>"""


@pytest.mark.long
@pytest.mark.skipif(BROWSER is None, reason="no chromium here (Debian: apt install chromium)")
def test_subscripts_stand_below_their_letter(tmp_path):
    """A page of the manual's renderer, style and font; without a font with a MATH table all stand in one line."""
    from sphinx.cmd.build import main

    source, built = tmp_path / "source", tmp_path / "built"
    source.mkdir()
    (source / "index.md").write_text(PAGE)
    docs = ROOT / "docs"
    (source / "conf.py").write_text(CONF.format(docs=str(docs), static=str(docs / "_static")))
    assert main(["-q", "-b", "html", str(source), str(built)]) == 0
    page = built / "index.html"
    page.write_text(page.read_text().replace("</body>", MEASURED + "</body>"))
    drawn = subprocess.run(
        [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files",
         f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=5000", "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=120, check=False,
    ).stdout  # fmt: skip
    found = re.search(r"measured (\{.*?\})<", drawn)
    assert found is not None, drawn[:500]
    seen = json.loads(found[1].replace("&quot;", '"'))
    assert seen["font"]
    for what, number in (("subscripts", 3), ("powers", 1), ("fractions", 1)):
        assert len(seen[what]) == number, seen
        # in heights of the letter; in one line it is next to nothing
        assert min(seen[what]) > 0.2, seen

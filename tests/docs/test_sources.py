"""The chapter on the three sources: its numbers are the code's, the same in three languages, and bear out its words."""

import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from inclinometry.glossary import term

ROOT = Path(__file__).parents[2]
SOURCES = ("rogatykh", "installation-errors", "fog-temperature")
BLOCK = re.compile(r"<!-- (?P<name>\w+) -->(?P<text>.*?)<!-- /(?P=name) -->", re.DOTALL)
CODE = re.compile(r"^```(?:sh|python|toml)\n.*?^```$", re.MULTILINE | re.DOTALL)
USED = {
    "rogatykh": ("inclination", "azimuth", "toolface", "rig", "sensor", "triad", "reading", "magnetometer", "dip"),
    "installation-errors": ("inclination", "azimuth", "toolface", "accelerometer", "offset", "rig", "scale-factor"),
    "fog-temperature": ("inclination", "azimuth", "toolface", "gyro", "accelerometer", "scale-factor", "station"),
}


sources = pytest.fixture(lambda: import_module("support.sources"))


def page(name, language="en"):
    suffix = "" if language == "en" else f".{language}"
    return (ROOT / "docs" / "sources" / f"{name}{suffix}.md").read_text(encoding="utf-8")


def shown(language="en"):
    """Every computed value of the nine pages, or of those of one language."""
    return {one["name"]: one["text"].strip() for name in SOURCES for one in BLOCK.finditer(page(name, language))}


def cells(value):
    """Rows of a table as lists of text, without its head."""
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in value.splitlines()[2:]]


def points(text):
    """Russian decimal commas as points."""
    return re.sub(r"(?<=\d)(?:,|\{,\})(?=\d)", ".", text)


def held_against(found):
    from support import blocks

    written = {name: text for language in ("en", "ru", "zh") for name, text in shown(language).items()}
    assert set(found) <= set(written)
    for name, value in found.items():
        assert blocks.alike(points(written[name]), points(value.strip())), (name, written[name], value)


def test_the_quick_numbers_are_what_the_code_gives(sources):
    found = {}
    for part in sources.QUICK:
        found |= part()
    held_against(found)


@pytest.mark.long
def test_the_long_numbers_are_what_the_code_gives(sources):
    found = {}
    for part in sources.LONG:
        found |= part()
    held_against(found)


@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.parametrize("language", ["ru", "zh"])
def test_a_translation_shows_the_same_numbers_and_the_same_lines(name, language):
    english, other = page(name), page(name, language)
    ours = [one["name"] for one in BLOCK.finditer(english)]
    theirs = [one["name"] for one in BLOCK.finditer(other)]
    assert theirs == [f"{one}_{language}" for one in ours]
    number = re.compile(r"\d+(?:\.\d+)?")
    for one in ours:
        value = shown()[one]
        if "|" in value:  # words differ, numbers do not
            for row, same in zip(cells(value), cells(points(shown(language)[f"{one}_{language}"])), strict=True):
                assert [number.findall(cell) for cell in row] == [number.findall(cell) for cell in same], one
        else:
            assert points(shown(language)[f"{one}_{language}"]) == value
    assert CODE.findall(other) == CODE.findall(english)
    # every equation, step or letter has its row, and so has every erratum
    assert len(re.findall(r"^\|", BLOCK.sub("", other), re.MULTILINE)) == len(
        re.findall(r"^\|", BLOCK.sub("", english), re.MULTILINE)
    )
    assert re.findall(r"\$\$.*?\$\$", other, re.DOTALL) == re.findall(r"\$\$.*?\$\$", english, re.DOTALL)


@pytest.mark.parametrize(("name", "words"), USED.items())
def test_a_translation_takes_its_words_from_the_glossary(name, words):
    russian, chinese = page(name, "ru").lower(), page(name, "zh")
    for word in words:
        assert term(word, "zh") in chinese, word
        # Russian nouns and adjectives are declined: their stems
        stems = [part[: max(2, len(part) - 2)] for part in term(word, "ru").split()]
        assert re.search(r"\w*\s+".join(map(re.escape, stems)), russian), word


def test_links_to_functions_and_pages_lead_somewhere():
    from importlib import import_module

    for path in sorted((ROOT / "docs" / "sources").glob("*.md")):
        text = path.read_text(encoding="utf-8")
        for target in re.findall(r"\{py:(?:func|class)\}`[^<`]+<inclinometry\.([\w.]+)>`", text):
            module, _, name = target.rpartition(".")
            assert hasattr(import_module(f"inclinometry.{module}"), name), f"{path.name}: {target}"
        for target in re.findall(r"\]\((\.\./_static/[\w.]+)\)", text):
            assert (path.parent / target).exists(), f"{path.name}: {target}"
        slugs = {
            re.sub(r"[^\w -]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^#+ (.+)$", text, re.MULTILINE)
        }
        for target in re.findall(r"\]\(#([\w-]+)\)", text):
            assert target in slugs or f"({target})=" in text, f"{path.name}: {target}"
        labels = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs" / "methods").glob("*.md"))
        for target in re.findall(r"\{ref\}`[^<`]+<([\w-]+)>`", text):
            assert f"({target})=" in labels, f"{path.name}: {target}"


def test_the_lines_of_the_paper_give_the_numbers_of_the_page(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    code = next(block for block in CODE.findall(page("rogatykh")) if "n2_printed" in block)
    exec(compile(code.removeprefix("```python").removesuffix("```"), "rogatykh.md", "exec"), names)
    capsys.readouterr()
    values = shown()
    for name, key in (("n1", "rog_n1"), ("n2", "rog_n2"), ("n2_printed", "rog_n2_printed"), ("n3", "rog_n3")):
        assert names[name].item() == pytest.approx(float(values[key]), abs=0.01)  # readings are given to 0.01
    assert names["found"].tensor[0] == pytest.approx([480.0, 822.0, -306.0], abs=0.01)
    # the readings of the lines are those of the table
    assert [row[4] for row in cells(values["rog_readings"])] == [
        f"{u:.2f}".replace("-", "−") for u in names["signals"][:, 0]
    ]


def test_only_two_of_nine_and_one_of_ten_do_not_hold(sources):
    rows = {row[0]: row for row in cells(shown()["rog_nine"])}
    assert {name for name, row in rows.items() if row[1] != row[2]} == {"$A_A$", "$B_A$"}
    exact = {name: worst < 1e-9 for name, (_, worst) in sources.table_one().items()}
    assert [name for name, holds in exact.items() if not holds] == ["A_A(90)"]


def test_signs_by_the_octant_are_a_coin_where_a01_is_zero(sources):
    """600 sensors: a fair coin stays within 0.1 of a half but for once in a million."""
    for a0 in (np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.6, 0.8])):
        n1, n2, n3, ours = sources.right_signs(a0)
        assert n1 == pytest.approx(0.5, abs=0.1)
        assert n3 == pytest.approx(0.5, abs=0.1)
        assert min(n2, ours) > 0.99  # a component within the noise has no sign
    assert min(sources.right_signs(np.array([0.5, 0.5, 0.5**0.5]))) > 0.99


def test_what_the_paper_reports_is_had_but_for_the_toolface():
    rows = cells(shown()["rog_claims"])
    inclination, toolface, toolface_30, fluxgate, resistive, _ = ([*map(float, row[2].split("–"))] for row in rows)
    assert inclination[0] < 0.1 < inclination[1] < 0.15
    assert toolface[0] > 10.0 * 0.2
    assert 0.15 < toolface_30[0] < 0.2
    assert 1.5 < fluxgate[0] < fluxgate[1] < 2.0
    assert 0.15 < resistive[0] < resistive[1] < 0.5


def test_both_methods_of_the_article_agree_to_thousandths_and_a_degree_of_roll_costs_what_is_said(sources):
    values = shown()
    assert all(float(row[-1]) < 0.006 for row in cells(values["art_cosines"]))
    assert all(abs(float(row[3].replace("−", "-"))) < 50.0 for row in cells(values["art_coefficients"]))
    roll, north = ([float(v) for v in row[1:]] for row in cells(values["art_wrong"]))
    assert 0.2 < roll[2] < roll[3] < 0.4
    assert north[2] == 0.0
    assert 0.3 < north[3] < 0.4


def test_the_patent_beats_no_compensation_only_with_the_rate_of_change():
    none, claim, description, joint, known = (float(row[1].split()[0]) for row in cells(shown()["pat_hot"]))
    assert claim > none > description > joint > known
    assert [row[5] for row in cells(shown()["pat_attitudes"])] == ["+", "+", "+", "−", "−", "−", "+"]

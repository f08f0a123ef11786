"""The computed numbers in the pages are those that the code gives, and the pages can be read without being built."""

import re
from importlib import import_module

import pytest

computed = pytest.fixture(lambda: import_module("computed"))


def test_no_page_waits_for_a_number(computed):
    for page in computed.pages():
        text = page.read_text(encoding="utf-8")
        assert "{{" not in text, f"{page.name}: python docs/computed.py puts the numbers in their places"
        marks = re.findall(r"<!-- (/?)(\w+) -->", text)
        opened = [name for closing, name in marks if not closing]
        assert [name for closing, name in marks if closing] == opened, page.name
        assert all(one["text"].strip() for one in computed.BLOCK.finditer(text)), page.name


@pytest.mark.long
def test_the_quick_ones_are_what_the_code_gives(computed):
    """Definitions, exact geometry and one fixed draw; what takes longer is worked out by python docs/computed.py."""
    from support import blocks, figures, gyro_figures, motion_figures, survey_figures

    found = {}
    for part in (
        figures.erratum, figures.claims, figures.hidden_scale, figures.conditioning, figures.directions,
        figures.angle_claims, figures.identifiability, figures.inclination_zero,
        gyro_figures.flags, gyro_figures.printed, gyro_figures.signs, gyro_figures.scale_cost,
        motion_figures.words, survey_figures.limits, survey_figures.axial, survey_figures.reference_errors,
    ):  # fmt: skip
        found |= part()
    text = "".join(page.read_text(encoding="utf-8") for page in computed.pages())
    standing = {one["name"]: one["text"].strip() for one in computed.BLOCK.finditer(text)}
    assert set(found) <= set(standing)
    for name, value in found.items():
        assert blocks.alike(standing[name], value.strip()), (name, standing[name], value)


def test_a_number_is_put_in_its_place_and_replaced_there(computed):
    values = {"n": "5", "t": "| a |\n| --- |\n| 1 |"}
    text = "A line\n  {{ n }} of 7, {{ other }}.\n\n{{ t }}\n\nend"
    once = computed.written(text, values)
    assert once == (
        "A line <!-- n -->5<!-- /n -->\n  of 7, {{ other }}.\n\n<!-- t -->\n| a |\n| --- |\n| 1 |\n\n<!-- /t -->\n\nend"
    )
    assert computed.written(once, values) == once
    assert "<!-- n -->6<!-- /n -->" in computed.written(once, {"n": "6"})

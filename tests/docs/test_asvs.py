"""The table of the web's security: every line of the standard is answered, every test it names is one."""

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
PAGE = TESTS.parent / "docs" / "asvs.md"
# OWASP ASVS 4.0.3, its own table (docs_en, CSV), levels 1 and 2 but chapter 1: section, number of its last line
SECTIONS = {
    "2.1": 12, "2.2": 4, "2.3": 3, "2.4": 5, "2.5": 7, "2.6": 3, "2.7": 6, "2.8": 7, "2.9": 3, "2.10": 4,
    "3.1": 1, "3.2": 4, "3.3": 4, "3.4": 5, "3.5": 3, "3.7": 1, "4.1": 5, "4.2": 2, "4.3": 3,
    "5.1": 5, "5.2": 8, "5.3": 10, "5.4": 3, "5.5": 4, "6.1": 3, "6.2": 6, "6.3": 2, "6.4": 2,
    "7.1": 4, "7.2": 2, "7.3": 4, "7.4": 3,
    "8.1": 4, "8.2": 3, "8.3": 8, "9.1": 3, "9.2": 4, "10.2": 2, "10.3": 3, "11.1": 8,
    "12.1": 3, "12.2": 1, "12.3": 6, "12.4": 2, "12.5": 2, "12.6": 1,
    "13.1": 5, "13.2": 6, "13.3": 2, "13.4": 2, "14.1": 4, "14.2": 6, "14.3": 3, "14.4": 7, "14.5": 4,
}  # fmt: skip
GONE = {"4.1.4", "7.3.2", "13.1.2", "13.2.4", "14.3.1"}
"""Duplicates of other lines, deleted in 4.0.2."""


def test_every_line_of_the_standard_is_answered_once():
    wanted = [f"{section}.{line}" for section, last in SECTIONS.items() for line in range(1, last + 1)]
    found = []
    for cell in re.findall(r"^\| ([\d., -]+) \|", PAGE.read_text("utf-8"), re.MULTILINE):
        for part in cell.split(", "):
            first, _, last = part.partition("-")
            section, _, start = first.rpartition(".")
            assert not last or last.rpartition(".")[0] == section, part
            found += [f"{section}.{line}" for line in range(int(start), int(last.rpartition(".")[2] or start) + 1)]
    assert len(found) == len(set(found))
    assert set(found) == set(wanted) - GONE


def test_every_line_is_tested_or_reasoned_and_every_test_named_is_one():
    there = {
        name
        for path in TESTS.rglob("test_*.py")
        for name in re.findall(r"^(?:async )?def (test_\w+)", path.read_text("utf-8"), re.MULTILINE)
    }
    text = PAGE.read_text("utf-8")
    named = set(re.findall(r"`(test_\w+)`", text))
    assert sorted(named - there) == []
    assert len(named) > 80
    for line in re.findall(r"^\| \d.*\|$", text, re.MULTILINE):
        assert len(line.split("|")[3].strip()) >= 4, line

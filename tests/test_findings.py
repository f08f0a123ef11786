"""The catalogue: every code whole, in three languages, used, and on the page."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path
from string import Formatter

import pytest
from docs.support.finding_page import page

import inclinometry
from inclinometry.findings import LANGUAGES, Finding, _read, codes, entries, example, room, rooms, rule, say, words

SOURCES = Path(inclinometry.__file__).parent
CODES = list(codes())


def fields(text):
    return {(name, spec) for _, name, spec, _ in Formatter().parse(text) if name is not None}


@cache
def texts():
    """The texts of each module that makes findings; codes and names of values are written out, never put together."""
    found = []
    for path in SOURCES.rglob("*.py"):
        source = path.read_text("utf-8")
        if re.search(r"inclinometry\.findings import|errors import .*\brefused\b", source):
            constants = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant))
            found.append({node.value for node in constants if isinstance(node.value, str)})
    return found


@pytest.mark.parametrize("name", rooms())
def test_codes_are_whole(name):
    for code, one in room(name).items():
        assert re.fullmatch(r"[a-z]+(-[a-z]+)+", code)
        phrase = not one.means  # a part of other sentences
        assert all(len(re.sub(r"\{[^}]*\}", "value", text).split()) <= 35 for text in one.sentences), code
        assert phrase or (one.do and one.found), code
        for sentence in one.sentences:
            assert phrase or sentence.endswith((".", "{finding}", "{finding:whole}")), sentence
            # plain English: sentences of 25 words, a value and its unit one word
            assert all(len(part.split()) <= 27 for part in re.split(r"(?<=[.:])\s", sentence)), sentence
            assert {field for field, _ in fields(sentence)} <= set(one.example), sentence


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", rooms())
def test_codes_are_said_in_every_language(name, language):
    messages = {} if language == "en" else entries(_read(f"{name}.{language}.po"))
    for code, one in room(name).items():
        said = say(example(code), language)
        assert "{" not in said
        assert not re.search(r"\d( [^\W\d]+| %|°)\1(?!\w)", said), said  # a unit said twice
        if language == "en":
            continue
        translations = messages[f"{code}\x04" + "\0".join(one.sentences)]
        assert len(translations) == (1 if len(one.says) == 1 else {"ru": 3, "zh": 1}[language])
        for text in translations:
            assert fields(text) == fields(one.sentences[-1]), text


@pytest.mark.parametrize("language", LANGUAGES[1:])
@pytest.mark.parametrize("name", ["words", *rooms()])
def test_translations_are_of_today(name, language):
    """A sentence that was changed or taken out leaves a translation that nobody reads."""
    rules = {} if name == "words" else room(name)
    known = {f"{code}\x04" + "\0".join(one.sentences) for code, one in rules.items()}
    known |= {f"word\x04{one}" for one in words(name) - (set() if name == "words" else words())}
    assert set(entries(_read(f"{name}.{language}.po"))) - {""} == known


@pytest.mark.parametrize("name", rooms())
def test_codes_are_used(name):
    """The module of each names every field of its sentence."""
    counted = {"windows", "total"}  # of `inclinometry.motion.result.Fault`
    for code, one in room(name).items():
        users = [found for found in texts() if code in found]
        assert users, code
        assert {field for field, _ in fields(one.sentences[-1])} <= counted.union(*users), code


def test_every_code_of_the_source_is_in_the_catalogue():
    shape = re.compile(rf"({'|'.join(rooms())})(-[a-z]+)+")
    limits = "gyro-repeat"  # a name of limits, as codes are
    assert {text for found in texts() for text in found if shape.fullmatch(text)} <= {*CODES, limits}


@pytest.mark.parametrize(
    ("count", "said"), [(1, "1 точка имеет"), (3, "3 точки имеют"), (8, "8 точек имеют"), (21, "21 точка имеет")]
)
def test_plurals(count, said):
    found = Finding("run-level-grads", {"count": count, "inclination_deg": 100.1, "log_ratio": 5.0})
    assert say(found, "ru").startswith(said)


def test_numbers_keep_their_size():
    found = example("run-total-calibrated")
    found = found._replace(values={**found.values, "median": 5.012e7, "si": "nT"})
    assert "50120000 nT" in say(found)
    assert "50120000 нТл" in say(found, "ru")


def test_a_value_of_thousands_of_characters_is_cut():
    found = Finding("table-empty", {"column": "a" * 5000 + "/name.csv"})
    assert len(str(found)) < 300
    assert "/name.csv" in str(found)


def test_a_finding_as_plain_data():
    found = Finding("run-depth-digit", {"course_m": 28.5, "md_m": 610.0, "expected_m": 601.5}, (21,))
    plain = found.plain()
    assert (plain["code"], plain["severity"], plain["rows"]) == ("run-depth-digit", "warning", [22])
    assert plain["values"] == {"course_m": 28.5, "md_m": 610.0, "expected_m": 601.5}


def test_the_page_has_every_code():
    text = page()
    assert [code for code in CODES if rule(code).means and f"### {code}\n" not in text] == []


def test_a_terminal_shows_three(capsys):
    from inclinometry.cli import output

    found = [example("run-total"), example("run-depth-digit"), *(example("run-station-off") for _ in range(3))]
    output.findings([found[0]._replace(severity="ignored"), *found[1:]])
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["warning"] * 3 + ["2 more"]
    assert lines[0].endswith("[run-depth-digit]")


PROSE = re.compile(r"(?!--)(?!.*YYYY).*[a-z}] [a-z]{2}")
"""A text that would stay English in other languages; options, units and names in code are said as they are."""
NAMES = {"finite": 1, "within": 1, "increasing": 1, "vectors": 1, "out_of_range": 0, "not_among": 0, "wrong_shape": 0}
NAMES |= {"wrong_kind": 0, "out_of_order": 0}
"""Functions that refuse -> which of their arguments is the name of what is refused."""


def told(node, constants):
    """Texts that an expression may be, of values "{}"."""
    if isinstance(node, ast.JoinedStr):
        return {"".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)}
    if isinstance(node, ast.IfExp):
        return told(node.body, constants) | told(node.orelse, constants)
    if isinstance(node, ast.Tuple):
        return {text for part in node.elts for text in told(part, constants)}
    node = constants.get(node.id) if isinstance(node, ast.Name) else node
    return {node.value} if isinstance(node, ast.Constant) and isinstance(node.value, str) else set()


def test_values_of_the_source_are_translated_or_names():
    """A text of our own is a word, {field:word}, or a name as code, columns and options have it."""
    said = {code: {n for one in rule(code).sentences for n, spec in fields(one) if not spec.endswith(("word", "name"))}
            for code in CODES}  # fmt: skip
    wrong = set()
    for path in SOURCES.rglob("*.py"):
        nodes = list(ast.walk(ast.parse(path.read_text("utf-8"))))
        constants = {
            n.target.id: n.value for n in nodes if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)
        }
        for call in (node for node in nodes if isinstance(node, ast.Call) and node.args):
            first, name = call.args[0], getattr(call.func, "id", "")
            values = [one for one in call.args[NAMES.get(name, 9) :][:1] if name in NAMES]
            if isinstance(first, ast.Constant) and isinstance(call.args[-1], ast.Dict):
                pairs = zip(call.args[-1].keys, call.args[-1].values, strict=True)
                values += [one for key, one in pairs if getattr(key, "value", "") in said.get(first.value, ())]
            wrong |= {text for value in values for text in told(value, constants) if PROSE.match(text)}
    assert wrong == set()

"""The glossary is complete, and no term has two translations anywhere in the package."""

from __future__ import annotations

import json
from importlib.resources import files

import pytest

from inclinometry.glossary import glossary, term
from inclinometry.laboratory.web.words import LANGUAGES, catalogue

TERMS = glossary()


def texts() -> dict[str, dict[str, dict[str, str]]]:
    """Bench and certificate -> language -> key -> text, without what they take from the glossary."""
    words = files("inclinometry.laboratory.web.words")
    certificate = files("inclinometry.laboratory.certificate").joinpath("templates", "certificate_words.json")
    found = json.loads(certificate.read_text("utf-8"))
    return {
        "bench": {
            language: json.loads(words.joinpath(f"{language}.json").read_text("utf-8")) for language in LANGUAGES
        },
        "certificate": {language: found[language] for language in LANGUAGES},
    }


@pytest.mark.parametrize("name", TERMS)
def test_a_term_is_complete(name: str) -> None:
    """In every language, with a definition of one sentence; the key is the English term."""
    found = TERMS[name]
    assert set(found) == {*LANGUAGES, "definition"}
    assert name == found["en"].replace(" ", "-")
    assert all(text and text == text.strip() for text in found.values())
    assert found["definition"].endswith(".")
    assert found["definition"][0].isupper()
    assert not any("\u4e00" <= letter <= "\u9fff" for letter in found["ru"] + found["en"])
    assert all("\u4e00" <= letter <= "\u9fff" for letter in found["zh"])


def test_terms_are_in_order_and_mean_one_thing() -> None:
    """Sorted; no two terms share a translation, but offset and those it is also called by."""
    assert list(TERMS) == sorted(TERMS)
    for language in LANGUAGES:
        said = [found[language] for found in TERMS.values()]
        assert sorted({text for text in said if said.count(text) > 1}) == []


def test_no_text_is_a_term() -> None:
    """Neither bench nor certificate translates a term of its own: it is named in their `terms`."""
    known = {found["en"].casefold() for found in TERMS.values()}
    own = [(which, key) for which, by in texts().items() for key, text in by["en"].items() if text.casefold() in known]
    assert own == []


def test_a_text_is_translated_alike_on_bench_and_certificate() -> None:
    """What is the same in English is the same in the other languages."""
    bench, certificate = texts()["bench"], texts()["certificate"]
    for language in LANGUAGES:
        mine: dict[str, set[str]] = {}
        for key, text in bench["en"].items():
            mine.setdefault(text, set()).add(bench[language][key])
        for key, text in certificate["en"].items():
            assert certificate[language][key] in mine.get(text, {certificate[language][key]}), (language, key)


def test_capitals_follow_the_key() -> None:
    """A text that begins with a capital names its term so."""
    assert [term("Toolface", language) for language in LANGUAGES] == [
        "Toolface",
        "Визирный угол",
        "工具面角",
    ]
    assert catalogue("ru")["bench.toolface"] == "Визирный угол"

"""Sentences of findings that records keep in English are said in the language of who reads them."""

from __future__ import annotations

import re

import pytest

from inclinometry.findings import codes, example
from inclinometry.language import using_language
from inclinometry.report.stored import translated

KEPT = [code for code, one in codes().items() if one.means and code.partition("-")[0] in ("bench", "verify", "fit")]


@pytest.mark.parametrize("language", ["ru", "zh"])
@pytest.mark.parametrize("code", KEPT)
def test_the_sentence_of_a_code_is_recognised(code: str, language: str) -> None:
    if code == "fit-stored":
        return  # a sentence of an older program, which no code says
    with using_language(language):
        said = translated(f"calibration: {example(code)}")
    assert re.search({"ru": "[а-я]{3}", "zh": "[\u4e00-\u9fff]{2}"}[language], said)


def test_other_sentences_stay() -> None:
    with using_language("ru"):
        assert translated("something else happened") == "something else happened"
        assert translated("A7: something else happened") == "A7: something else happened"

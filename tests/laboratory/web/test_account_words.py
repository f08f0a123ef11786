"""What an account is told, on Russian and Chinese pages."""

from __future__ import annotations

import re

import pytest

from inclinometry.laboratory.web.words import sentence


@pytest.mark.parametrize("language", ["ru", "zh"])
@pytest.mark.parametrize("said", [
    "the password has 7 characters; allowed 15 to 128: four or five words are easy to keep",
    "the password is one of the first to be guessed: a common one, a row of keys, a repetition, a date, a name, or two "
    "or three common words; take four or five words that do not belong together",
    "this code was used before; wait for the next one",
    "'1' has a second factor; remove it first, then set up another",
    "the name '1' has a control character; take characters that are seen",
    "the code of the second factor is missing, wrong or was used before",
    "the current password is wrong; nothing was changed",
    "the two passwords differ; nothing was changed",
    "this is not the code of now; check the clocks of the telephone and of the bench",
    "'1' has no second factor",
    "a user needs a name: write the one to log in with",
    "'1' is a new user; give a password of at least 15 characters",
    "password changed", "second factor set up", "second factor removed", "code 59423 of 5a3f", "code 59423",
    "recovery code 5a3f",
])  # fmt: skip
def test_it_is_said_in_the_language_of_the_page(language, said):
    found = sentence(language, said)
    assert not set(re.findall("[A-Za-z]{2,}", found)), found
    assert re.findall(r"\d+", found) == re.findall(r"\d+", said)

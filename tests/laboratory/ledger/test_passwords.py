"""Passwords that are taken and that are not; how they are kept."""

from __future__ import annotations

import unicodedata
from itertools import pairwise

import pytest
from argon2 import PasswordHasher
from tests.refusals import refused

from inclinometry.laboratory.ledger import passwords
from inclinometry.laboratory.ledger.passwords import LONGEST, fits, hashed, strength

CHEAP = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(passwords, "_hasher", lambda: CHEAP)
    passwords._decoy.cache_clear()
    yield
    passwords._decoy.cache_clear()


@pytest.mark.parametrize("password", [
    "quiet granite harbour lamp", "adze jib fen quoit", "четыре слова без связи", "四个互不相关的词语组成的密码口令",
    "kqzvjwmxnbrtplshd", "    well spaced words here", "quiet granite harbour lamp " * 4,
    "table chair window door", "zephyr lantern pickle granite", "fxk29slqpwmz81nv",
    "🙂🚂🌧🪵🐌🧲🪁🎻🧊🪲🪴🧵🛶🪚🧯",
])  # fmt: skip
def test_any_long_phrase_is_taken(password):
    # no rule on capitals, digits or signs; blanks and every script are allowed; nothing is cut off
    stored = hashed(password, ["anna", "Anna Berg", "Laboratory"])
    assert fits(stored, password)
    assert not fits(stored, password + "x")
    assert not fits(stored, password[:-1])


COMMON = (
    "passwordpassword", "passwordpassword1", "P@ssw0rdP@ssw0rd", "123456789012345", "qwertyuiopasdfgh",
    "1qaz2wsx3edc4rfv", "aaaaaaaaaaaaaaaaaaaaaaaa", "abcabcabcabcabcabc", "iloveyouiloveyou", "letmeinletmein!",
    "inclinometry2024", "Inclinometer-1234", "yrtemonilcni2024", "passphrase123456",
    "borehole-borehole", "1q2w3e4r5t6y7u8i9o", "January2026January", "password 2026 october", "borehole metrology",
    "october november", "correcthorsebatterystaple", "correct horse battery staple", "monday tuesday wednesday",
    "red green blue yellow", "drill hole survey", "i love my mother", "a long pass phrase", "йцукенгшщзхъфывапр",
    "зфыыцщкв-зфыыцщкв", "октябрь ноябрь 2026", "!QAZ@WSX#EDC$RFV", "quiet granite harbour",
)  # fmt: skip
# the user's, backwards too, and the laboratory's; for somebody else the same may be a phrase like any other
OWN = ("annaberg", "Anna Berg", "Norge Borehull AS")
OF_NAMES = ("annabergannaberg", "Anna Berg Anna Berg", "grebannagrebanna", "norge borehull as", "NorgeBorehull2024",
            "annaberg12345678")  # fmt: skip
CONTROL = ("a\0bcdefghij klmnop", "quiet granite\tharbour lamp", "\x1b[A granite lamp tide")
OF_LENGTH = ("", "short", "quiet granite ", "two words" + " " * 20, "quiet granite harbour lamp " * 4 + "u" * 21)


@pytest.mark.parametrize(("password", "names", "problem"), [
    *((one, (), "key-password-weak") for one in COMMON),
    *((one, OWN, "key-password-weak") for one in OF_NAMES),
    *((2 * name, (name,), "key-password-weak") for name in ("сергей-иванов", "administrator")),
    *((one, (), "ledger-invisible") for one in CONTROL),
    *((one, (), "input-value") for one in OF_LENGTH),
])  # fmt: skip
def test_what_is_not_taken(password, names, problem):
    with refused(problem) as stopped:
        hashed(password, names)
    assert not password or password not in str(stopped.value)


def test_the_longest_is_taken_and_checked_whole():
    password = "".join(chr(0x4E00 + 37 * number % 7919) for number in range(LONGEST))
    stored = hashed(password)
    assert fits(stored, password)
    assert not fits(stored, password[:-1] + "x")


def test_one_letter_is_one_letter_however_it_is_typed():
    # an accent as a letter of its own or with its letter; full-width letters of a Chinese keyboard
    stored = hashed(unicodedata.normalize("NFD", "crème brûlée à volonté"))
    assert fits(stored, unicodedata.normalize("NFC", "crème brûlée à volonté"))
    assert fits(hashed("quiet granite harbour lamp"), "ｑｕｉｅｔ granite harbour lamp")


def test_a_hash_of_an_older_program_goes_on():
    # shorter than today's least, common, and not normalised
    for password in ("password12", "cafe\u0301 cafe\u0301"):
        assert fits(CHEAP.hash(password), password)


@pytest.mark.parametrize("stored", [None, "", "no hash", "$argon2id$v=19$m=8,t=1,p=1$x$y"])
@pytest.mark.parametrize("password", ["", "nobody has this password", "\ud800", "x" * 10_000])
def test_nothing_fits_what_is_no_hash(stored, password):
    assert not fits(stored, password)


def test_each_hash_has_its_own_salt():
    one, two = (hashed("quiet granite harbour lamp") for _ in range(2))
    assert one != two
    assert len(one.split("$")[4]) * 6 >= 128  # bits of salt


def test_what_is_typed_is_judged_while_it_is_typed():
    values = [strength("quiet granite harbour lamp"[:length]) for length in range(0, 27)]
    assert values[0] == 0.0
    assert values[-1] == 1.0
    assert max(b - a for a, b in pairwise(values)) < 0.5
    assert strength("a" * 10_000) < 1.0  # and soon
    assert strength("AnnaBerg annaberg 1", ["Anna Berg"]) == 0.125

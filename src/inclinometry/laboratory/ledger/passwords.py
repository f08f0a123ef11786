"""Passwords: which are taken, how they are kept.

No digits, no capitals, no change after some months are asked for (NIST SP 800-63B-4, 3.1.1.2; OWASP ASVS 4.0.3, V2.1).
What is refused is what a guesser tries first: common passwords, rows of keys, repetitions, dates, two or three common
words, the name of the user, the laboratory or the program. zxcvbn (D. Wheeler, USENIX Security 2016; MIT), with its
30,000 passwords of leaked lists, estimates how many guesses that takes: of the text as it is typed, of its words
without what stands between them, and of the keys under Cyrillic letters and signs; the least of these counts.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Final

from inclinometry.errors import out_of_range, refused
from inclinometry.laboratory.ledger.chain import invisible

if TYPE_CHECKING:
    from argon2 import PasswordHasher

SHORTEST: Final = 15
"""Characters of a new password, NIST SP 800-63B-4 for one that stands alone; blanks in a row count once."""
LONGEST: Final = 128
_TRIED: Final = (
    *("password", "passphrase", "borehole", "calibration", "certificate", "drilling", "gyro", "inclination", "azimuth"),
    *("toolface", "laboratory", "metrology", "survey", "пароль", "скважина", "密码"),
    *("январь", "февраль", "март", "апрель", "май", "июнь", "июль", "август", "сентябрь", "октябрь", "ноябрь"),
    *("декабрь", "correcthorsebatterystaple", "thequickbrownfoxjumpsoverthelazydog", "maytheforcebewithyou"),
    *("tobeornottobe", "winteriscoming", "openthepodbaydoors"),
)
"""What a user would try who knows what the program is for, and phrases that all have read; zxcvbn knows words."""
_BETWEEN: Final = re.compile(r"[\s_.,;:-]+")


def strength(password: str, words: Iterable[str] = ()) -> float:
    """From 0 to 1, which is enough: the guesses of a user who knows `words` (user, laboratory), and the length."""
    from zxcvbn import zxcvbn

    # a hundred times zxcvbn's highest score: for whoever has a copy of the ledger and a thousand processors, at twenty
    # argon2id hashes of 64 MB a second each, more than a year; three words drawn by lot from 10,000
    least_guesses = 1e12
    # the keys under Cyrillic letters and under signs
    keys = str.maketrans("йцукенгшщзхъфывапролджэячсмитьбюё!@#$%^&*()", "qwertyuiop[]asdfghjkl;'zxcvbnm,.`1234567890")
    names = {
        "inclinometry",
        "inclinometer",
        *(part for word in words for part in (word, *re.split(r"\W+", word)) if len(part) > 2),
    }
    known = [*sorted(names), *_TRIED]
    normal = _normal(password)
    if not normal:
        return 0.0
    together = _BETWEEN.sub("", normal) or normal
    guesses = math.inf
    for text in dict.fromkeys((normal, together, together.casefold().translate(keys))):
        # the better of both ends: a long password is not weak because its beginning is
        ends = {text[:72], text[-72:]}  # zxcvbn's time grows with the square of what it reads
        guesses = min(guesses, max(float(zxcvbn(part, user_inputs=known)["guesses_log10"]) for part in ends))
    return max(0.0, min(1.0, guesses / math.log10(least_guesses), _length(normal) / SHORTEST, _own(normal, names) / 8))


def hashed(password: str, words: Iterable[str] = ()) -> str:
    """The argon2id hash of a password that may be taken.

    Raises InputError: too short, too long, among those that are guessed first; a control character is in it.
    """
    normal = _normal(password)
    control = next((sign for sign in normal if unicodedata.category(sign) in ("Cc", "Cs")), None)
    if control is not None:
        raise invisible("password", normal, control)
    if _length(normal) < SHORTEST or len(normal) > LONGEST:
        raise out_of_range("password.characters", _length(normal), f"{SHORTEST} .. {LONGEST}")
    if strength(normal, words) < 1.0:
        raise refused("key-password-weak")
    return _hasher().hash(normal)


def fits(stored: str | None, password: str) -> bool:
    """Whether the password is the one that was hashed; without a hash it takes as long and is wrong."""
    from argon2.exceptions import InvalidHashError, VerificationError

    given = password[:201]  # older programs took 200
    # older programs hashed what was typed
    for tried in dict.fromkeys((_normal(given), given)):
        try:
            if _hasher().verify(stored or _decoy(), tried):
                return bool(stored)
        except (VerificationError, InvalidHashError, UnicodeEncodeError):
            continue
    return False


def costs() -> dict[str, int]:
    """What argon2id costs here, to be kept beside what `key` encrypts."""
    hasher = _hasher()
    return {name: getattr(hasher, name) for name in ("time_cost", "memory_cost", "parallelism")}


def key(password: str, salt: bytes, length: int, *, time_cost: int, memory_cost: int, parallelism: int) -> bytes:
    """An argon2id key that only the password gives."""
    from argon2.low_level import Type, hash_secret_raw

    return hash_secret_raw(
        _normal(password).encode("utf-8", "replace"), salt, time_cost, memory_cost, parallelism, length, Type.ID
    )


def _own(password: str, known: Iterable[str]) -> int:
    """Characters that are left without what is known, forwards and backwards."""
    text = _BETWEEN.sub("", password.casefold())
    names = {_BETWEEN.sub("", word.casefold()) for word in known}
    for name in sorted(names, key=len, reverse=True):
        for taken in (name, name[::-1]):
            text = text.replace(taken, "") if taken else text
    return len(text)


def _normal(password: str) -> str:
    """One spelling of each character, whatever the keyboard sends (NIST SP 800-63B-4, 3.1.1.2)."""
    return unicodedata.normalize("NFKC", password)


def _length(password: str) -> int:
    return len(re.sub(r"\s+", " ", password.strip()))


@cache
def _hasher() -> PasswordHasher:
    from argon2 import PasswordHasher

    return PasswordHasher()


@cache
def _decoy() -> str:
    return _hasher().hash("no one has this password")

"""A second factor: codes of six digits by time (RFC 6238), and recovery codes for the day the telephone is lost.

The secret is kept encrypted by the password: added bit by bit to an argon2id key of its own salt, which is used once. A
copy of the ledger alone gives no codes.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import re
import secrets
import urllib.parse
from collections.abc import Mapping
from typing import Any, Final

from inclinometry.errors import out_of_range
from inclinometry.laboratory.ledger import passwords

STEP_S: Final = 30
"""Seconds a code is shown."""
_SECRET: Final = 20  # bytes, the length of HMAC-SHA-1 (RFC 4226, section 4)


def code(secret: bytes, step: int, digits: int = 6, algorithm: str = "sha1") -> str:
    """The code of a time step: RFC 4226, section 5.3, with the counter of RFC 6238, section 4.2.

    >>> code(b"12345678901234567890", 59 // STEP_S, digits=8)  # RFC 6238, appendix B
    '94287082'
    """
    digest = hmac.digest(secret, step.to_bytes(8, "big"), algorithm)
    offset = digest[-1] & 15
    number = int.from_bytes(digest[offset : offset + 4], "big") & 0x7FFF_FFFF
    return f"{number % 10**digits:0{digits}d}"


def step_of(secret: bytes, given: str, time: float) -> int | None:
    """The time step, near `time` (s since 1970), whose code was given; None when it is the code of none."""
    now = int(time) // STEP_S
    digits = re.sub(r"[\s-]", "", given).encode()
    near = range(max(0, now - 1), now + 2)  # telephone and bench may differ by a step
    found = [step for step in near if hmac.compare_digest(code(secret, step).encode(), digits)]
    return found[0] if found else None


def new_secret() -> str:
    """A secret as authenticators take it: 160 random bits in base 32."""
    return base64.b32encode(secrets.token_bytes(_SECRET)).decode()


def secret_bytes(text: str) -> bytes:
    """The secret of its base 32; blanks and small letters do not matter.

    Raises InputError: not base 32, or not 160 bits.
    """
    try:
        found = base64.b32decode(re.sub(r"[\s=-]", "", text).upper())
    except (binascii.Error, ValueError):
        found = b""
    if len(found) != _SECRET:
        raise out_of_range("secret.bytes", len(found), str(_SECRET))
    return found


def address(secret: str, name: str) -> str:
    """What an authenticator reads from the square code.

    >>> address("GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ", "anna")
    'otpauth://totp/inclinometry:anna?secret=GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ&issuer=inclinometry'
    """
    return f"otpauth://totp/inclinometry:{urllib.parse.quote(name, safe='')}?secret={secret}&issuer=inclinometry"


def sealed(secret: bytes, password: str) -> dict[str, Any]:
    """The secret as it is kept."""
    salt, costs = secrets.token_bytes(16), passwords.costs()
    key = passwords.key(password, salt, _SECRET, **costs)
    return {"salt": salt.hex(), "secret": _added(secret, key).hex(), **costs}


def opened(kept: Mapping[str, Any], password: str) -> bytes:
    """The secret again; with another password it is nonsense."""
    costs = {name: kept[name] for name in passwords.costs()}
    key = passwords.key(password, bytes.fromhex(kept["salt"]), _SECRET, **costs)
    return _added(bytes.fromhex(kept["secret"]), key)


def recovery_codes() -> list[str]:
    """Codes that each replace one code of the telephone: 120 random bits, so that a plain hash keeps them."""
    letters = [base64.b32encode(secrets.token_bytes(15)).decode() for _ in range(10)]
    return ["-".join(re.findall("......", text)) for text in letters]


def recovery_digest(given: str) -> str:
    """What is kept of a recovery code."""
    return hashlib.sha256(re.sub(r"[\s-]", "", given).upper().encode("utf-8", "replace")).hexdigest()


def _added(one: bytes, other: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(one, other, strict=True))

"""Checksums at the end of a line: an asterisk and hexadecimal digits, as NMEA 0183 writes them."""

from __future__ import annotations

import binascii
from collections.abc import Callable, Mapping
from functools import reduce
from operator import xor
from typing import Final

from inclinometry.core.errors import InputError

_SUMS: Final[Mapping[str, tuple[Callable[[bytes], int], int]]] = {
    "xor": (lambda data: reduce(xor, data, 0), 2),
    "sum": (lambda data: sum(data) % 256, 2),
    "crc16": (lambda data: binascii.crc_hqx(data, 0xFFFF), 4),
}
CHECKSUMS: Final = ("none", *_SUMS)
"""none; exclusive or; sum modulo 256; CRC-16 with polynomial 0x1021 that starts at 0xFFFF (CCITT-FALSE)."""


def checksum(kind: str, line: bytes) -> str:
    """The checksum of a line, without the asterisk; a leading $ is not counted, as in NMEA 0183.

    Parameters
    ----------
    kind : {"none", "xor", "sum", "crc16"}
    line : bytes

    Raises
    ------
    InputError
        An unknown kind.

    Examples
    --------
    >>> checksum("xor", b"$GPGLL,5057.970,N,00146.110,E,142451,A"), checksum("crc16", b"123456789")
    ('27', '29B1')
    """
    if kind not in CHECKSUMS:
        raise InputError(f"checksum is {kind!r}; allowed: {', '.join(CHECKSUMS)}")
    if kind == "none":
        return ""
    work, digits = _SUMS[kind]
    return f"{work(line.removeprefix(b'$')):0{digits}X}"


def with_checksum(kind: str, line: str) -> str:
    """The line with its asterisk and checksum; as it is for "none".

    Examples
    --------
    >>> with_checksum("xor", "1,2"), with_checksum("none", "1,2")
    ('1,2*2F', '1,2')
    """
    return line if kind == "none" else f"{line}*{checksum(kind, line.encode('ascii'))}"


def without_checksum(kind: str, line: str) -> str | None:
    """The line before its asterisk when the checksum is right; None when it is wrong or missing.

    Examples
    --------
    >>> without_checksum("xor", "1,2*2F"), without_checksum("xor", "1,3*2F")
    ('1,2', None)
    """
    if kind == "none":
        return line
    body, star, given = line.rpartition("*")
    right = checksum(kind, body.encode("ascii", "replace"))
    return body if star and given.strip().upper() == right else None

"""Whether a MATLAB file of version 5 is put together as its format says, before scipy's compiled reader believes it."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator

_NUMBERS = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13})
_TEXTS = frozenset({16, 17, 18})
_MATRIX, _PACKED = 14, 15
_CLASSES = range(1, 16)  # cell, structure, object, characters, sparse, numbers
_NUMERIC = range(5, 16)
_SPARSE, _COMPLEX = 5, 0x800
_HEADER, _DEEPEST, _MOST = 128, 20, 1 << 30


def check_elements(data: bytes) -> None:
    """Read the tags of all data elements of a file, not their numbers.

    Raises
    ------
    ValueError
        A version unknown, an element of no known type, larger than its place, or a matrix without its parts.

    References
    ----------
    The MathWorks, MAT-File Format, version 5: data elements, array flags.
    """
    if 0 in data[:4]:
        return  # version 4
    if data[124:128] not in (b"\x00\x01IM", b"\x01\x00MI"):
        raise ValueError(f"neither version 4 nor 5: the header ends in {data[124:128].hex(' ')}")
    _check(data, _HEADER, len(data), "<" if data[126:128] == b"IM" else ">", 0)


def _check(data: bytes, start: int, end: int, order: str, depth: int) -> None:
    if depth > _DEEPEST:
        raise ValueError("matrices nested too deep")
    for kind, at, size in _elements(data, start, end, order):
        if kind == _PACKED:
            unpacking = zlib.decompressobj()
            inner = unpacking.decompress(data[at : at + size], _MOST)
            if not unpacking.eof:
                raise ValueError("a packed element does not end, or is too large")
            _check(inner, 0, len(inner), order, depth + 1)
        elif kind == _MATRIX:
            _check_matrix(data, at, at + size, order, depth)


def _check_matrix(data: bytes, start: int, end: int, order: str, depth: int) -> None:
    parts = list(_elements(data, start, end, order))
    if not parts:
        return  # an empty cell
    kinds = [kind for kind, _, _ in parts]
    if kinds[:3] != [6, 5, 1] or parts[0][2] != 8 or parts[1][2] % 4 or parts[1][2] < 8:
        raise ValueError("a matrix without flags, dimensions and name")
    flags = struct.unpack_from(f"{order}I", data, parts[0][1])[0]
    of, imaginary = flags & 0xFF, bool(flags & _COMPLEX)
    rows = struct.unpack_from(f"{order}{parts[1][2] // 4}i", data, parts[1][1])
    # every value takes a byte at least, but those a sparse matrix leaves out
    if of not in _CLASSES or min(rows) < 0 or (of != _SPARSE and math.prod(rows) > len(data)):
        raise ValueError(f"a matrix of class {of}, dimensions {rows}")
    if of in _NUMERIC:
        needed = 4 + imaginary + 2 * (of == _SPARSE)  # a sparse matrix has the places of its numbers before them
        if len(kinds) < needed or not _NUMBERS.issuperset(kinds[3:]):
            raise ValueError("a matrix of numbers without numbers")
    for kind, at, size in parts[3:]:
        if kind == _MATRIX:
            _check_matrix(data, at, at + size, order, depth + 1)


def _elements(data: bytes, start: int, end: int, order: str) -> Iterator[tuple[int, int, int]]:
    """Type, place and size of each element between two places."""
    while start < end:
        if end - start < 8:
            raise ValueError("an element is cut off")
        kind, size = struct.unpack_from(f"{order}II", data, start)
        if kind >> 16:  # a small element: type and size share a word, its content the next
            kind, size, at = kind & 0xFFFF, kind >> 16, start + 4
            if size > 4:
                raise ValueError("a small element of more than four bytes")
            start += 8
        else:
            at = start + 8
            start = at + size + (0 if kind == _PACKED else -size % 8)
        if kind not in _NUMBERS | _TEXTS | {_MATRIX, _PACKED} or at + size > end:
            raise ValueError(f"an element of type {kind} and {size} bytes")
        yield kind, at, size

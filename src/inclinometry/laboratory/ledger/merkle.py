"""The Merkle tree of RFC 6962, section 2.1: one root for all records, short proofs of what is in it and that it grew.

Leaves are hashed behind a byte 0x00, nodes behind 0x01, so that no node can be taken for a record. The tree of n leaves
is split at the largest power of two below n, which leaves every complete subtree as it is while the tree grows.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import Final

SIZE: Final = 32
"""Bytes of a hash."""
EMPTY: Final = hashlib.sha256().digest()
"""Root of the tree without leaves."""


def leaf_hash(data: bytes) -> bytes:
    """Hash of a leaf."""
    return hashlib.sha256(b"\x00" + data).digest()


def node_hash(left: bytes, right: bytes) -> bytes:
    """Hash of a node from those of its two children."""
    return hashlib.sha256(b"\x01" + left + right).digest()


class Frontier:
    """What appending needs: roots of the complete subtrees along the right edge, one for each 1 in its size."""

    def __init__(self, size: int = 0, peaks: Sequence[bytes] = ()) -> None:
        self.size = size
        self.peaks = list(peaks)

    def extend(self, leaves: Iterable[bytes]) -> None:
        """Append leaves by their hashes."""
        for leaf in leaves:
            found, carry = leaf, self.size
            while carry & 1:
                found, carry = node_hash(self.peaks.pop(), found), carry >> 1
            self.peaks.append(found)
            self.size += 1

    def root(self) -> bytes:
        """Root of the tree."""
        if not self.peaks:
            return EMPTY
        root = self.peaks[-1]
        for peak in reversed(self.peaks[:-1]):
            root = node_hash(peak, root)
        return root


class Tree:
    """A whole tree, from hashes of its leaves: every complete subtree is kept, so that a proof costs a few hashes."""

    def __init__(self, leaves: Iterable[bytes]) -> None:
        level = bytearray(b"".join(leaves))
        self._levels = [level]
        while len(level) >= 2 * SIZE:
            pairs = range(0, len(level) - SIZE, 2 * SIZE)
            level = bytearray(b"".join(hashlib.sha256(b"\x01" + level[at : at + 2 * SIZE]).digest() for at in pairs))
            self._levels.append(level)
        self.size = len(self._levels[0]) // SIZE

    def root(self, size: int | None = None) -> bytes:
        """Root of the first `size` leaves. Default: of all."""
        size = self.size if size is None else size
        return self._node(_height(size), 0, size) if size else EMPTY

    def inclusion(self, index: int, size: int | None = None) -> list[bytes]:
        """Proof that the leaf at a place (from 0) is in the tree of the first `size` leaves (RFC 6962, 2.1.1)."""
        size = self.size if size is None else size
        proof = []
        for level in range(_height(size)):
            sibling = (index >> level) ^ 1
            if sibling << level < size:
                proof.append(self._node(level, sibling, size))
        return proof

    def consistency(self, first: int, second: int | None = None) -> list[bytes]:
        """Proof that the tree of `second` leaves begins with that of `first` (RFC 6962, 2.1.2)."""
        second = self.size if second is None else second
        return self._subproof(first, _height(second), 0, second, True) if 0 < first < second else []

    def _node(self, level: int, index: int, size: int) -> bytes:
        """Root of the leaves from index * 2**level on, at most 2**level of them, none beyond `size`."""
        if (index + 1) << level <= size:
            return bytes(self._levels[level][index * SIZE : (index + 1) * SIZE])
        left = self._node(level - 1, 2 * index, size)
        beyond = (2 * index + 1) << (level - 1) >= size
        return left if beyond else node_hash(left, self._node(level - 1, 2 * index + 1, size))

    def _subproof(self, first: int, level: int, index: int, size: int, whole: bool) -> list[bytes]:
        """SUBPROOF(m, D[n], b) of RFC 6962; `first` counts from the beginning of this subtree."""
        if first == min(size - (index << level), 1 << level):
            return [] if whole else [self._node(level, index, size)]
        half = 1 << (level - 1)
        if (index << level) + half >= size:
            return self._subproof(first, level - 1, 2 * index, size, whole)
        if first <= half:
            right = self._node(level - 1, 2 * index + 1, size)
            return [*self._subproof(first, level - 1, 2 * index, size, whole), right]
        left = self._node(level - 1, 2 * index, size)
        return [*self._subproof(first - half, level - 1, 2 * index + 1, size, False), left]


def _height(size: int) -> int:
    return max(size - 1, 0).bit_length()


def includes(leaf: bytes, index: int, size: int, proof: Sequence[bytes], root: bytes) -> bool:
    """Whether a proof leads from the hash of a leaf at its place (from 0) to the root (RFC 9162, 2.1.3.2)."""
    if not 0 <= index < size:
        return False
    place, last, found = index, size - 1, leaf
    for sibling in proof:
        if last == 0:
            return False
        if place & 1 or place == last:
            found = node_hash(sibling, found)
            while not place & 1 and place:
                place, last = place >> 1, last >> 1
        else:
            found = node_hash(found, sibling)
        place, last = place >> 1, last >> 1
    return last == 0 and found == root


def consistent(first: int, second: int, old: bytes, new: bytes, proof: Sequence[bytes]) -> bool:
    """Whether a proof leads from the root of `first` leaves to that of `second` (RFC 9162, 2.1.4.2)."""
    if not 0 <= first <= second:
        return False
    if first == second:
        return not proof and old == new
    if first == 0:  # everything grew from the empty tree
        return not proof and old == EMPTY
    path = list(proof) if first & (first - 1) else [old, *proof]
    if not path:
        return False
    place, last = first - 1, second - 1
    while place & 1:
        place, last = place >> 1, last >> 1
    was = now = path[0]
    for sibling in path[1:]:
        if last == 0:
            return False
        if place & 1 or place == last:
            was, now = node_hash(sibling, was), node_hash(sibling, now)
            while not place & 1 and place:
                place, last = place >> 1, last >> 1
        else:
            now = node_hash(now, sibling)
        place, last = place >> 1, last >> 1
    return last == 0 and was == old and now == new

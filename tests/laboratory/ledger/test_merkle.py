"""The tree of RFC 6962 against the published vectors of certificate transparency and a dumb second implementation."""

from __future__ import annotations

import hashlib

import pytest

from inclinometry.laboratory.ledger.merkle import EMPTY, Frontier, Tree, consistent, includes, leaf_hash

# leaves and roots of the tests of google/certificate-transparency (merkle_tree_test.cc), which RFC 6962 came from
LEAVES = [
    "", "00", "10", "2021", "3031", "40414243", "5051525354555657", "606162636465666768696a6b6c6d6e6f",
]  # fmt: skip
ROOTS = [
    "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d",
    "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    "aeb6bcfe274b70a14fb067a5e5578264db0fa9b51af5e0ba159158f329e06e77",
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    "4e3bbb1f7b478dcfe71fb631631519a3bca12c9aefca1612bfce4c13a86264d4",
    "76e67dadbcdf1e10e1b74ddc608abd2f98dfb16fbce75277b5232a127f2087ef",
    "ddb89be403809e325750d3d263cd78929c2942b7942a34b77e122c9594a74c8c",
    "5dc9da79a70659a9ad559cb701ded9a2ab9d823aad2f4960cfe370eff4604328",
]
# (place from 1, size) -> proof
INCLUSION = {
    (1, 1): "",
    (1, 8): "96a296d224f285c67bee93c30f8a309157f0daa35dc5b87e410b78630a09cfc7 "
    "5f083f0a1a33ca076a95279832580db3e0ef4584bdff1f54c8a360f50de3031e "
    "6b47aaf29ee3c2af9af889bc1fb9254dabd31177f16232dd6aab035ca39bf6e4",
    (6, 8): "bc1a0643b12e4d2d7c77918f44e0f4f79a838b6cf9ec5b5c283e1f4d88599e6b "
    "ca854ea128ed050b41b35ffc1b87b8eb2bde461e9e3b5596ece6b9d5975a0ae0 "
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    (3, 3): "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    (2, 5): "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d "
    "5f083f0a1a33ca076a95279832580db3e0ef4584bdff1f54c8a360f50de3031e "
    "bc1a0643b12e4d2d7c77918f44e0f4f79a838b6cf9ec5b5c283e1f4d88599e6b",
}
CONSISTENCY = {
    (1, 1): "",
    (1, 8): INCLUSION[1, 8],
    (6, 8): "0ebc5d3437fbe2db158b9f126a1d118e308181031d0a949f8dededebc558ef6a "
    "ca854ea128ed050b41b35ffc1b87b8eb2bde461e9e3b5596ece6b9d5975a0ae0 "
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    (2, 5): "5f083f0a1a33ca076a95279832580db3e0ef4584bdff1f54c8a360f50de3031e "
    "bc1a0643b12e4d2d7c77918f44e0f4f79a838b6cf9ec5b5c283e1f4d88599e6b",
}


def published() -> Tree:
    return Tree(leaf_hash(bytes.fromhex(text)) for text in LEAVES)


def hexes(proof: list[bytes]) -> list[str]:
    return [one.hex() for one in proof]


def test_the_published_vectors() -> None:
    tree = published()
    assert hashlib.sha256().digest() == EMPTY == tree.root(0)
    assert hexes([tree.root(size) for size in range(1, 9)]) == ROOTS
    for (place, size), proof in INCLUSION.items():
        assert hexes(tree.inclusion(place - 1, size)) == proof.split()
    for (first, second), proof in CONSISTENCY.items():
        assert hexes(tree.consistency(first, second)) == proof.split()


# the definitions of RFC 6962 as they are written, on lists


def split(n: int) -> int:
    k = 1
    while 2 * k < n:
        k *= 2
    return k


def dumb_root(leaves: list[bytes]) -> bytes:
    if not leaves:
        return hashlib.sha256(b"").digest()
    if len(leaves) == 1:
        return hashlib.sha256(b"\0" + leaves[0]).digest()
    k = split(len(leaves))
    return hashlib.sha256(b"\1" + dumb_root(leaves[:k]) + dumb_root(leaves[k:])).digest()


def dumb_path(m: int, leaves: list[bytes]) -> list[bytes]:
    if len(leaves) == 1:
        return []
    k = split(len(leaves))
    if m < k:
        return [*dumb_path(m, leaves[:k]), dumb_root(leaves[k:])]
    return [*dumb_path(m - k, leaves[k:]), dumb_root(leaves[:k])]


def dumb_proof(m: int, leaves: list[bytes], whole: bool = True) -> list[bytes]:
    if m == len(leaves):
        return [] if whole else [dumb_root(leaves)]
    k = split(len(leaves))
    if m <= k:
        return [*dumb_proof(m, leaves[:k], whole), dumb_root(leaves[k:])]
    return [*dumb_proof(m - k, leaves[k:], False), dumb_root(leaves[:k])]


SIZES = [*range(1, 18), 31, 33]


@pytest.mark.parametrize("size", SIZES)
def test_against_the_definitions(size: int) -> None:
    """Every root and proof of the trees up to 17 leaves and around 32; no proof serves another place, size or root."""
    leaves = [bytes([k, 7]) for k in range(size)]
    tree, edge = Tree(map(leaf_hash, leaves)), Frontier()
    root = tree.root()
    for m in range(size + 1):
        assert tree.root(m) == dumb_root(leaves[:m]) == edge.root()
        assert Frontier(edge.size, edge.peaks).root() == edge.root()
        edge.extend(leaf_hash(one) for one in leaves[m : m + 1])
    for m in range(size):
        proof = tree.inclusion(m)
        assert proof == dumb_path(m, leaves)
        assert includes(leaf_hash(leaves[m]), m, size, proof, root)
        assert not includes(leaf_hash(b"other"), m, size, proof, root)
        assert not includes(leaf_hash(leaves[m]), m, size, [*proof, root], root)
        assert not any(includes(leaf_hash(leaves[m]), k, size, proof, root) for k in range(-1, size + 2) if k != m)
        assert not proof or not includes(leaf_hash(leaves[m]), m, size, proof[:-1], root)
    for m in range(1, size + 1):
        old, proof = tree.root(m), tree.consistency(m)
        assert proof == dumb_proof(m, leaves)
        assert consistent(m, size, old, root, proof)
        assert not consistent(m, size, root if m < size else EMPTY, root, proof)
        assert m == size or not consistent(m, size, old, EMPTY, proof)
        assert m == size or not consistent(m, size, old, root, [*proof, root])
        assert m == size or not consistent(m, size, old, root, proof[:-1])
    assert consistent(0, size, EMPTY, root, [])
    assert not consistent(0, size, root, root, [])
    assert not consistent(size + 1, size, root, root, [])

"""Random streams by name: one seed, many independent generators, so that one option never disturbs another's draws."""

from __future__ import annotations

import zlib
from typing import TypeAlias

import numpy as np

from inclinometry.core.errors import InputError

Seed: TypeAlias = int | np.random.SeedSequence | np.random.Generator


class Streams:
    """Generators of one seed, each known by its name.

    Parameters
    ----------
    seed : int, SeedSequence or Generator
        A Generator is drawn from once; the same int always gives the same streams.
    purpose : str
        Keeps the streams of different simulations apart when they are given the same seed.

    Examples
    --------
    >>> a, b = Streams(7, "bench"), Streams(7, "bench")
    >>> _ = b["something else"].normal(size=100)
    >>> bool(a["noise"].normal() == b["noise"].normal())
    True
    """

    def __init__(self, seed: Seed, purpose: str) -> None:
        self._purpose = purpose
        if isinstance(seed, np.random.SeedSequence):
            self._root = seed
        elif isinstance(seed, np.random.Generator):
            self._root = np.random.SeedSequence(seed.integers(0, 2**63, size=2).tolist())
        else:
            if isinstance(seed, bool) or int(seed) != seed or seed < 0:
                raise InputError(f"seed is {seed!r}; allowed: an integer of 0 or more")
            self._root = np.random.SeedSequence(int(seed))

    def __getitem__(self, name: str) -> np.random.Generator:
        # the name's checksum is a spawn key: streams do not depend on the order in which they are asked for
        key = (*self._root.spawn_key, zlib.crc32(f"{self._purpose}.{name}".encode()))
        return np.random.default_rng(np.random.SeedSequence(self._root.entropy, spawn_key=key))

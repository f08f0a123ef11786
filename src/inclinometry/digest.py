"""Digests: the identity of an input, recorded with every result."""

from __future__ import annotations

import hashlib
from pathlib import Path

from inclinometry.opening import opened


def digest_bytes(data: bytes) -> str:
    """Return "sha256:" and the hexadecimal SHA-256 of `data`.

    Examples
    --------
    >>> digest_bytes(b"")[:19]
    'sha256:e3b0c44298fc'
    """
    return "sha256:" + hashlib.sha256(data).hexdigest()


def digest_file(path: str | Path) -> str:
    """Digest of a file's bytes, read in pieces; FileError where it cannot be read (`opening.opened`)."""
    with opened(path) as stream:
        return "sha256:" + hashlib.file_digest(stream, "sha256").hexdigest()

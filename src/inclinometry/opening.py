"""Files as they are opened: they end, they are no larger than what is made of them, and what is wrong is said."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Final

from inclinometry.errors import FileError, system_reason
from inclinometry.findings import Finding

LARGEST_SETTINGS: Final = 2_000_000
"""Bytes of a TOML file, which people write."""


@contextmanager
def opened(path: str | Path) -> Iterator[BufferedReader]:
    """The bytes of a file as a stream; folders, pipes and devices are refused."""
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116
        stream = Path(path).open("rb") if stat.S_ISREG(mode) else None  # noqa: SIM115
    except FileNotFoundError:
        raise FileError(Finding("file-absent"), path=path) from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        reason = system_reason(error)
        raise FileError(Finding("file-unreadable", {"reason": reason}), path=path) from None
    if stream is None:
        what = "folder" if stat.S_ISDIR(mode) else "pipe or device"
        raise FileError(Finding("file-not-file", {"what": what}), path=path)
    with stream:
        yield stream


def whole(path: str | Path, largest: int) -> bytes:
    """All bytes of a file; never more than `largest` are in memory.

    Raises
    ------
    FileError
        As `opened`; it cannot be read; larger than `largest` bytes.
    """
    with opened(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        try:
            data = b"" if size > largest else stream.read()
        except OSError as error:
            reason = system_reason(error)
            raise FileError(Finding("file-unreadable", {"reason": reason}), path=path) from None
    if size > largest:
        raise FileError(too_large("bytes", size, largest), path=path)
    return data


def not_text(encoding: str, reason: str) -> Finding:
    """Of bytes that are no text."""
    return Finding("file-text", {"encoding": encoding, "reason": reason})


def damaged(kind: str, reason: object) -> Finding:
    """Of a file that the library of its format does not read; the first line of the reason."""
    lines = str(reason).strip().splitlines() or [type(reason).__name__]
    return Finding("file-format", {"format": kind, "reason": lines[0][:200]})


def too_large(what: str, size: int, most: int) -> Finding:
    """Of a file with more than can be read; `what` is a word of the catalogue."""
    return Finding("file-large", {"what": what, "size": size, "most": most})

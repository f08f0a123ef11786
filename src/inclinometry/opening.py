"""Files as they are opened: they end, they are no larger than what is made of them, and what is wrong is said."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Final

from inclinometry.errors import FileError

LARGEST_SETTINGS: Final = 2_000_000
"""Bytes of a TOML file, which people write."""


@contextmanager
def opened(path: str | Path) -> Iterator[BufferedReader]:
    """The bytes of a file as a stream; folders, pipes and devices are refused."""
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116
        stream = Path(path).open("rb") if stat.S_ISREG(mode) else None  # noqa: SIM115
    except FileNotFoundError:
        raise FileError("there is no such file; check the name", path=path) from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise FileError(f"cannot be read ({getattr(error, 'strerror', None) or error})", path=path) from None
    if stream is None:
        what = "a folder" if stat.S_ISDIR(mode) else "a pipe" if stat.S_ISFIFO(mode) else "a device, which has no end"
        raise FileError(f"this is {what}; give the name of a file", path=path)
    with stream:
        yield stream


def whole(path: str | Path, largest: int, remedy: str = "is it the right file?") -> bytes:
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
            raise FileError(f"cannot be read ({error.strerror or error})", path=path) from None
    if size > largest:
        raise FileError(f"it has {size:,} bytes; allowed {largest:,}: {remedy}", path=path)
    return data

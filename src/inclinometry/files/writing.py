"""Writing: a file whole or not at all, numbers as the shortest text that reads back the same."""

from __future__ import annotations

import csv
import io
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import BinaryIO

import numpy as np

from inclinometry.arrays import Array
from inclinometry.errors import FileError, refused, system_reason
from inclinometry.findings import Finding
from inclinometry.opening import not_text
from inclinometry.tabular import degrees as degrees


@contextmanager
def replacing(path: str | Path) -> Iterator[BinaryIO]:
    """Open a binary stream that becomes `path` only when the block ends without an exception.

    The bytes go to a temporary name in the same folder (a rename across file systems is not atomic), are flushed to the
    disk and renamed. On any exception, KeyboardInterrupt included, the temporary file is removed and what stood at
    `path` before is untouched. A device or pipe (/dev/stdout) cannot be renamed over and is written directly.
    """
    # the file a link points to, so that the link survives; the errors a person can act on
    try:
        target = Path(path).resolve()
        if target.is_dir():
            raise FileError(Finding("file-not-file", {"what": "folder"}), path=path)
        if not target.parent.is_dir():
            raise FileError(Finding("file-folder-absent", {"folder": str(target.parent)}), path=path)
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(Finding("file-unwritable", {"reason": str(error)}), path=path) from None
    if target.exists() and not target.is_file():
        with _readable(path), target.open("wb") as stream:
            yield stream
        return
    scratch = target.with_name(f".{secrets.token_hex(8)}.part")
    mode = target.stat().st_mode & 0o777 if target.exists() else None
    try:
        with _readable(path):
            with scratch.open("xb") as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            if mode is not None:
                scratch.chmod(mode)
            scratch.replace(target)
    except BaseException:
        with suppress(OSError):
            scratch.unlink()
        raise
    # make the rename itself durable where the system can
    with suppress(OSError):
        handle = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def _readable(path: str | Path) -> Iterator[None]:
    """Turn an operating system's error into one line that names the file asked for, not the temporary one."""
    try:
        yield
    except OSError as error:
        reason = system_reason(error)
        raise FileError(Finding("file-unwritable", {"reason": reason}), path=path) from None


def write_bytes(data: bytes, path: str | Path) -> None:
    """Write `data` to `path`, whole or not at all; see `replacing`."""
    with replacing(path) as stream:
        stream.write(data)


def write_text(text: str, path: str | Path) -> None:
    r"""Write `text` as UTF-8 with "\n" line ends on every system; see `replacing`."""
    try:
        data = text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise FileError(not_text("utf-8", error.reason), path=path) from None
    write_bytes(data, path)


def number(value: float) -> str:
    """Shortest text that reads back to the same float64; empty for NaN.

    >>> number(90.0), number(0.1), number(float("nan"))
    ('90', '0.1', '')
    """
    if value != value:
        return ""
    text = repr(float(value))
    return text.removesuffix(".0")


def column(values: Array) -> list[str]:
    """One column of numbers as text."""
    return list(map(number, values.tolist()))


def joined(tables: Sequence[Mapping[str, Array | list[str]]]) -> dict[str, Array | list[str]]:
    """One table below the other; all have the same columns."""
    if len(tables) == 1:
        return dict(tables[0])
    return {
        name: np.concatenate([np.asarray(table[name]) for table in tables])
        if isinstance(first, np.ndarray)
        else [cell for table in tables for cell in table[name]]
        for name, first in tables[0].items()
    }


def write_columns(
    columns: Mapping[str, Array | Sequence[str] | None], path: str | Path, comments: Sequence[str] = ()
) -> None:
    """Write columns of one length, numbers or texts, as comma-separated UTF-8, whole or not at all; None is left out.

    Everything is quoted when a first cell begins with `#`, which would be a comment unquoted. A line break inside a
    cell is an InputError, as the reader takes one line for one row. Comments are lines of their own above the names.
    """
    kept = {name: values for name, values in columns.items() if values is not None}
    first = next(iter(kept.values()))
    ambiguous = not isinstance(first, np.ndarray) and any(cell.startswith("#") for cell in first)
    with replacing(path) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="", write_through=False)
        try:
            text.writelines(f"# {' '.join(comment.split())}\n" for comment in comments)
            writer = csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL if ambiguous else csv.QUOTE_MINIMAL)
            writer.writerow(kept)
            # some rows at a time: all cells of a long table would fill the memory
            for start in range(0, len(first), 10_000):
                part = slice(start, start + 10_000)
                cells = [column(v[part]) if isinstance(v, np.ndarray) else v[part] for v in kept.values()]
                broken = next((cell for texts in cells for cell in texts if "\n" in cell or "\r" in cell), None)
                if broken is not None:
                    raise refused("file-characters", {"format": "CSV", "text": " ".join(broken[:60].split())})
                writer.writerows(zip(*cells, strict=True))
        finally:
            text.detach()


@cache
def program() -> str:
    """Name and version of this program, for records."""
    from importlib.metadata import version  # with what it imports fifty modules, and not every command writes a record

    return f"inclinometry {version('inclinometry')}"

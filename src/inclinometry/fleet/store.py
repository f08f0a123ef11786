"""Where a fleet's files are: a folder, or a bucket of an object store; every file appears whole or not at all."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple
from urllib.parse import quote, unquote

from inclinometry.errors import FileError, InputError, system_reason
from inclinometry.findings import Finding
from inclinometry.opening import opened

STAGED: Final = re.compile(r"^\.[0-9a-f]{16}\.part$")
"""Names of files that are being written."""


class Store(NamedTuple):
    """A folder, by its path, or a bucket, by an address such as s3://bucket/fleet.

    Keys and end point of an object store come from AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION,
    AWS_ENDPOINT_URL.
    """

    address: str

    @property
    def folder(self) -> Path | None:
        """The folder, None of an object store."""
        return None if "://" in self.address else Path(self.address)

    def uri(self, name: str) -> str:
        """Address of a file or folder in it."""
        return f"{self.address.rstrip('/')}/{name}"

    def size(self, name: str) -> int | None:
        """Bytes of a file, None where there is none."""
        found = self.stamp(name)
        return None if found is None else found[0]

    def stamp(self, name: str) -> tuple[int, int] | None:
        """(bytes, time of the last change in ns) of a file, None where there is none."""
        if self.folder is not None:
            try:
                found = (self.folder / name).stat()
            except (FileNotFoundError, NotADirectoryError):
                return None
            return found.st_size, found.st_mtime_ns
        system, root = _system(self.address)
        with _said(self.uri(name)):
            info = system.get_file_info(f"{root}/{name}")
        return (int(info.size), int(info.mtime_ns or 0)) if info.is_file else None

    @contextmanager
    def reading(self, name: str) -> Iterator[BinaryIO]:
        """A file open for reading.

        Raises
        ------
        FileError
            It is not there or cannot be read; it is a device, which has no end.
        """
        if self.folder is not None:
            with opened(self.folder / name) as stream:
                yield stream
            return
        try:
            system, root = _system(self.address)
            with _said(self.uri(name)), system.open_input_file(f"{root}/{name}") as stream:
                yield stream
        except FileNotFoundError:
            raise FileError(Finding("file-absent"), path=self.uri(name)) from None

    def names(self, under: str) -> Iterator[str]:
        """Names of all files below a folder, in no order; nothing where it does not exist."""
        if self.folder is not None:
            for root, _, found in os.walk(self.folder / under):
                place = Path(root).relative_to(self.folder).as_posix()
                yield from (f"{place}/{name}" for name in found)
            return
        import pyarrow.fs as fs

        system, root = _system(self.address)
        with _said(self.uri(under)):
            chosen = fs.FileSelector(f"{root}/{under}", recursive=True, allow_not_found=True)
            for info in system.get_file_info(chosen):
                if info.is_file:
                    yield info.path[len(root) + 1 :]

    @contextmanager
    def staged(self, beside: str = "") -> Iterator[tuple[Path, Any]]:
        """A file to write into and a function that gives it its name; without that it is removed.

        In a folder it is written under a dot name, brought to the disk and renamed; to an object store it is sent in
        one piece. `beside` is the folder, in the store, where the name will be.
        """
        folder = Path(tempfile.gettempdir()) if self.folder is None else self.folder / beside
        with _said(str(folder), written=True):
            folder.mkdir(parents=True, exist_ok=True)
        scratch = folder / f".{secrets.token_hex(8)}.part"

        def publish(name: str) -> None:
            with _said(self.uri(name), written=True):
                if self.folder is None:
                    system, root = _system(self.address)
                    with scratch.open("rb") as source, system.open_output_stream(f"{root}/{name}") as sent:
                        shutil.copyfileobj(source, sent, 1 << 23)
                    return
                with scratch.open("rb+") as stream:
                    os.fsync(stream.fileno())
                target = self.folder / name
                target.parent.mkdir(parents=True, exist_ok=True)
                scratch.replace(target)
                with suppress(OSError):  # where the system can, the rename itself is made durable
                    handle = os.open(target.parent, os.O_RDONLY)
                    try:
                        os.fsync(handle)
                    finally:
                        os.close(handle)

        try:
            with _said(str(folder), written=True):
                yield scratch, publish
        finally:
            with suppress(OSError):
                scratch.unlink(missing_ok=True)

    def remove(self, name: str) -> None:
        """Remove a file; nothing where it is not there."""
        with _said(self.uri(name), written=True):
            if self.folder is not None:
                (self.folder / name).unlink(missing_ok=True)
                return
            system, root = _system(self.address)
            with suppress(FileNotFoundError):
                system.delete_file(f"{root}/{name}")

    def age(self, name: str) -> float:
        """Seconds since the last change of a file; infinite where it is not there."""
        found = self.stamp(name)
        return float("inf") if found is None else time.time() - found[1] / 1e9


@contextmanager
def _said(where: str, written: bool = False) -> Iterator[None]:
    """Errors of a disk or an object store in one line."""
    try:
        yield
    except FileNotFoundError:
        raise
    except OSError as error:
        if isinstance(error, InputError):
            raise
        reason = system_reason(error).splitlines()[0][:300]
        # what is read while a file is written, a damaged page, has no number of the system
        code = "file-unwritable" if written and error.errno else "file-unreadable"
        raise FileError(Finding(code, {"reason": reason}), path=where) from None


@cache
def _system(address: str) -> tuple[Any, str]:
    """The file system of an address and the folder in it."""
    import pyarrow as pa
    import pyarrow.fs as fs

    try:
        system, root = fs.FileSystem.from_uri(address)
    except (pa.ArrowException, ValueError, OSError) as error:
        raise FileError(Finding("fleet-address", {"reason": str(error)[:200]}), path=address) from None
    return system, root.rstrip("/")


def folder_name(text: str) -> str:
    """A serial number or name of a run as part of a path on every system.

    Examples
    --------
    >>> folder_name("IN-7"), folder_name("IN 7/3")
    ('IN-7', 'IN~207~2F3')
    """
    return quote(text, safe="-._").replace("~", "%7E").replace("%", "~")


def plain_name(folder: str) -> str:
    """Inverse of `folder_name`."""
    return unquote(folder.replace("~", "%"))

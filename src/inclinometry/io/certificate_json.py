"""The record of a certificate as a JSON file; its digest, which the certificate bears, is of the file's bytes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from inclinometry.core.digest import digest_bytes
from inclinometry.io import _json
from inclinometry.io.atomic import write_bytes

SCHEMA: Final = "inclinometry/certificate"
VERSION: Final = 1


def record_bytes(record: Mapping[str, Any]) -> bytes:
    """The bytes of the JSON file; the same record gives the same bytes."""
    return _json.canonical(record)


def record_digest(record: Mapping[str, Any]) -> str:
    """SHA-256 of the JSON file, as it is printed on the certificate.

    Examples
    --------
    >>> record_digest({})[:15]
    'sha256:ca3d163b'
    """
    return digest_bytes(record_bytes(record))


def write_certificate(record: Mapping[str, Any], path: str | Path) -> None:
    """Write the record; FileError where it cannot be written."""
    write_bytes(record_bytes(record), path)


def read_certificate(path: str | Path) -> dict[str, Any]:
    """Read the record of a certificate.

    Raises
    ------
    FileError
        Not JSON, another kind of file, a newer version, or content the schema refuses, with the JSON path.
    """
    return checked(_json.load(path), path)


def checked(content: dict[str, Any], where: str | Path) -> dict[str, Any]:
    """The record, when it fits the schema of its version; FileError otherwise."""
    return _json.of_kind(content, where, SCHEMA, version=VERSION)

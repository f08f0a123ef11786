"""Formats that are not read, known by the beginning of a file; the table is data in not_read.toml."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from inclinometry.findings import Finding
from inclinometry.opening import opened


@lru_cache(maxsize=1)
def _table() -> Mapping[str, Any]:
    return tomllib.loads(files("inclinometry.files").joinpath("not_read.toml").read_text(encoding="utf-8"))


def not_read(path: Path, start: bytes) -> Finding | None:
    """The refusal of a file that begins so, if its format is one that is known and not read."""
    text, table, binary = start.decode("latin-1").removeprefix("\xef\xbb\xbf"), _table(), b"\0" in start
    name = next((name for name, begins in table["begins"].items() if text.startswith(tuple(begins))), None)
    if name is None:
        patterns = table["binary" if binary else "text"].items()
        name = next((name for name, begins in patterns if re.match(begins, text)), None)
    if name is None and binary:
        name = table["endings"].get(path.suffix.lower())
    return None if name is None else _refusal(name)


def kind_not_read(path: Path) -> Finding | None:
    """The same of a file that may not be there."""
    if not path.is_file():
        return None
    with opened(path) as stream:
        return not_read(path, stream.read(4096))


def archive_not_read(members: Iterable[str]) -> Finding:
    """The refusal of a ZIP archive that is no workbook."""
    known = _table()["members"]
    return _refusal(next((known[name] for name in members if name in known), "ZIP"))


def _refusal(name: str) -> Finding:
    return Finding("file-kind", {"format": name, "wanted": tuple(_table()["instead"].get(name, (".csv", ".xlsx")))})

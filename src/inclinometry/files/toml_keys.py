"""TOML files with a fixed set of keys: syntax, unknown keys and ranges, each error with its remedy."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from inclinometry.errors import FileError, in_file, not_among, out_of_range, wrong_kind
from inclinometry.files.columns import closest
from inclinometry.findings import Finding
from inclinometry.opening import LARGEST_SETTINGS, whole


class Settings:
    """The keys of one file or of one table in it, whose name is `table`, taken one by one with their checks."""

    def __init__(self, path: str | Path, content: dict[str, Any], keys: Iterable[str], table: str = "") -> None:
        self.path, self.content, self._table, known = path, content, table, list(keys)
        for key in content:
            if key not in known:
                near = closest(key, known)
                name = f"{self.name(key):.80}"
                raise FileError(
                    Finding("table-near", {"name": name, "right": near})
                    if near
                    else Finding("input-unknown", {"names": (name,), "known": tuple(known)}),
                    path=path,
                )

    def name(self, key: str) -> str:
        """A key with the table it is in."""
        return f"{self._table}.{key}" if self._table else key

    def number(self, key: str, low: float, high: float) -> float | None:
        """A finite number in [low, high], or None when the key is not there."""
        if key not in self.content:
            return None
        value = self.content[key]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise in_file(wrong_kind(self.name(key), f"{value!r:.60}", "number"), self.path)
        if not (math.isfinite(value) and low <= value <= high):
            raise in_file(out_of_range(self.name(key), f"{value!r:.60}", f"{low:g} .. {high:g}"), self.path)
        return float(value)

    def needed(self, key: str, low: float, high: float) -> float:
        """A finite number in [low, high] that must be there."""
        value = self.number(key, low, high)
        if value is None:
            raise self.missing(key)
        return value

    def missing(self, key: str) -> FileError:
        """The error of a key that is not there."""
        return FileError(Finding("input-missing", {"names": (self.name(key),)}), path=self.path)

    def text(self, key: str, choices: Iterable[str] = ()) -> str | None:
        """A text that is not empty, one of `choices` where given, or None when the key is not there."""
        if key not in self.content:
            return None
        value, allowed = self.content[key], list(choices)
        if not isinstance(value, str) or not value.strip() or (allowed and value not in allowed):
            name, found = self.name(key), f"{value!r:.60}"
            raise in_file(not_among(name, found, allowed) if allowed else wrong_kind(name, found, "text"), self.path)
        return value


_NESTED: Final = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++\s*+\.\s*+){50}""")


def parsed(text: str) -> dict[str, Any]:
    """The content of a text of TOML.

    Raises
    ------
    tomllib.TOMLDecodeError
        Wrong syntax; keys of more than fifty parts, whose reading would take for ever; brackets nested too deep.
    """
    deep = _NESTED.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise tomllib.TOMLDecodeError(f"a key of more than 50 parts (at line {line}, column 1)")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise tomllib.TOMLDecodeError("brackets nested too deep (at line 1, column 1)") from None


_USUAL: Final = {
    "Invalid value": "not a valid value", "Expected '=' after a key in a key/value pair": "'=' is missing after a name",
    "Expected newline or end of document after a statement": "text after the end of a value",
    "Invalid statement": "not a valid line", "Cannot overwrite a value": "the name occurs twice",
    "Unclosed array": "a closing bracket is missing", "Unclosed inline table": "a closing bracket is missing",
    "Expected ']' at the end of a table declaration": "a closing bracket is missing",
    "Unterminated string": "a closing quote is missing", "Invalid initial character for a key part": "not a valid name",
    "Invalid date or datetime": "not a valid date",
}  # fmt: skip
"""Usual errors of TOML, as words of the catalogue."""


def load(path: str | Path, keys: Iterable[str]) -> Settings:
    """Read a TOML file that may hold `keys`; FileError with the line of wrong syntax, or what a wrong key should be."""
    try:
        text = whole(path, LARGEST_SETTINGS).decode("utf-8-sig")
        return Settings(path, parsed(text), keys)
    except tomllib.TOMLDecodeError as error:
        # "Invalid value (at line 1, column 5)", "... (at end of document)": the error has numbers from Python 3.14 on
        said, _, place = str(error).removesuffix(")").rpartition(" (at ")
        line, column = re.findall(r"\d+", place) or (text.count("\n") + 1, len(text) - text.rfind("\n"))
        at = Finding("file-at-column", {"reason": _USUAL.get(said, said), "column": int(column)})
        found = Finding("file-format", {"format": "TOML", "reason": at})
        raise FileError(found, path=path, line=int(line)) from None
    except UnicodeDecodeError as error:
        reason = f"{error.reason} (byte {error.start})"
        raise FileError(Finding("file-format", {"format": "UTF-8", "reason": reason}), path=path) from None
    except FileError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileError(Finding("file-format", {"format": "TOML", "reason": str(error)}), path=path) from None

"""TOML files with a fixed set of keys: syntax, unknown keys and ranges, each error with its remedy."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from inclinometry.errors import FileError
from inclinometry.files.columns import advice, closest
from inclinometry.opening import LARGEST_SETTINGS, whole


class Settings:
    """The keys of one file, taken one by one with their checks."""

    def __init__(self, path: str | Path, content: dict[str, Any], keys: Iterable[str]) -> None:
        self.path, self.content, known = path, content, list(keys)
        for key in content:
            if key not in known:
                hint = advice(key, known)
                near = closest(key, known)
                hint = hint or (f"did you mean {near}?" if near else f"allowed: {', '.join(known)}")
                raise FileError(f"key {key!r:.80} is not known; {hint}", path=path)

    def number(self, key: str, low: float, high: float) -> float | None:
        """A finite number in [low, high], or None when the key is not there."""
        if key not in self.content:
            return None
        value = self.content[key]
        allowed = f"a number from {low:g} to {high:g} is needed"
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise FileError(f"{key} is {value!r}; {allowed}", path=self.path)
        if not (math.isfinite(value) and low <= value <= high):
            raise FileError(f"{key} is {value}; {allowed}", path=self.path)
        return float(value)

    def text(self, key: str, choices: Iterable[str] = ()) -> str | None:
        """A text that is not empty, one of `choices` where given, or None when the key is not there."""
        if key not in self.content:
            return None
        value, allowed = self.content[key], list(choices)
        if not isinstance(value, str) or not value.strip() or (allowed and value not in allowed):
            wanted = " or ".join(f'"{c}"' for c in allowed) if allowed else "a text"
            raise FileError(f"{key} is {value!r}; {wanted} is needed", path=self.path)
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


def load(path: str | Path, keys: Iterable[str]) -> Settings:
    """Read a TOML file that may hold `keys`; FileError with the line of wrong syntax, or what a wrong key should be."""
    try:
        text = whole(path, LARGEST_SETTINGS).decode("utf-8-sig")
        return Settings(path, parsed(text), keys)
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"line (\d+)", str(error))
        line = int(place[1]) if place else text.count("\n") + 1
        raise FileError(f"not TOML: {error}; a line reads key = value", path=path, line=line) from None
    except UnicodeDecodeError as error:
        raise FileError(f"not UTF-8 text (byte {error.start}); save it as UTF-8", path=path) from None
    except FileError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileError(f"cannot be read ({error})", path=path) from None

"""The few errors of the package; each is a child of the builtin a caller expects.

A message gives the value found, the range allowed and the remedy; a file's error also names file and line. An error is
made of a finding, whose sentence is its message.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from inclinometry.findings import Finding, Value, codes


class InclinometryError(Exception):
    """Everything this package raises on purpose."""

    def __init__(self, finding: Finding) -> None:
        self.finding = finding._replace(severity="refused")
        super().__init__(str(self.finding))


class InputError(InclinometryError, ValueError):
    """A value that cannot be used: wrong shape, not finite, out of range, contradictory."""


class SiteError(InputError):
    """A site that states too little; the remedy belongs in its file."""


def refused(code: str, values: Mapping[str, Value] | None = None) -> InputError:
    """The error of a finding."""
    return InputError(Finding(code, values or {}))


def out_of_range(name: str, value: Value, allowed: str) -> InputError:
    """A value outside its range, which is written in signs: "> 0", "0 .. 90", ">= 2"."""
    return InputError(Finding("input-value", {"name": name, "value": value, "allowed": allowed}))


def wrong_kind(name: str, value: Value, expected: str) -> InputError:
    """A value that is not of its kind; `expected` is a word of the catalogue: "number", "text", "date YYYY-MM-DD"."""
    return InputError(Finding("input-kind", {"name": name, "value": value, "expected": expected}))


def not_among(name: str, value: Value, allowed: Iterable[str]) -> InputError:
    """A value that is none of a few."""
    return InputError(Finding("input-choice", {"name": name, "value": value, "allowed": tuple(allowed)}))


def wrong_shape(name: str, shape: Sequence[int] | str, expected: str) -> InputError:
    """An array that does not fit the others; expected as in "(K, 3)"."""
    shape = shape if isinstance(shape, str) else str(tuple(shape))
    return InputError(Finding("input-shape", {"name": name, "shape": shape, "expected": expected}))


def out_of_order(name: str, value: Value, before: Value, row: int) -> InputError:
    """A value that does not follow the one before it, in a row from 1."""
    return InputError(Finding("input-order", {"name": name, "value": value, "before": before, "row": row}))


def in_file(error: InclinometryError, path: str | Path, line: int | None = None) -> FileError:
    """The same refusal, of a file that its value was read from; without a line, where the error itself says."""
    if line is None and isinstance(error, FileError):
        return FileError(error.finding, path=path, line=error.line, row=error.row)
    return FileError(error.finding, path=path, line=line)


class FileError(InputError):
    """A file that cannot be used; the message names the file and, where there is one, the line, or row of an array."""

    def __init__(self, finding: Finding, *, path: str | Path, line: int | None = None, row: int | None = None) -> None:
        where = f"{path}" + (f", line {line}" if line is not None else f", row {row}" if row is not None else "")
        super().__init__(finding)
        self.args = (f"{where}: {finding}",)
        self.path, self.line, self.row = Path(path), line, row


_SYSTEM: Final = {
    errno.ENOENT: "no such file or folder", errno.EACCES: "permission denied", errno.EPERM: "permission denied",
    errno.EISDIR: "this is a folder", errno.ENOTDIR: "this is not a folder", errno.EEXIST: "it exists already",
    errno.EROFS: "read-only folder", errno.ENOSPC: "the disk is full", errno.EBUSY: "another program uses it",
    errno.ENAMETOOLONG: "the name is too long", errno.ENXIO: "no such device", errno.ENODEV: "no such device",
    errno.EADDRINUSE: "another program uses it", errno.ECONNREFUSED: "connection refused", errno.ETIMEDOUT: "no answer",
}  # fmt: skip
"""Usual errors of the system, as words of the catalogue."""


def system_reason(error: BaseException) -> str:
    """Why the system, or a library, did not do it: a word of the catalogue for the usual reasons, else its own text."""
    usual = _SYSTEM.get(getattr(error, "errno", None) or 0)
    return usual or str(getattr(error, "strerror", None) or error)


class IdentifiabilityError(InclinometryError, ValueError):
    """The readings cannot determine what was asked; the message says which direction and the remedy."""


class ConvergenceError(InclinometryError, ArithmeticError):
    """An iteration did not settle; nothing half-fitted is returned."""


def settled(
    found: Iterable[Finding], ignored: Sequence[str] = (), path: str | Path | None = None
) -> tuple[Finding, ...]:
    """Findings after --ignore, whose names are codes or groups; the first that is still refused raises."""
    rules = {code: rule for code, rule in codes().items() if rule.group} if ignored else {}
    groups = tuple(dict.fromkeys(rule.group for rule in rules.values()))
    if unknown := sorted(set(ignored) - set(rules) - set(groups)):
        raise InputError(Finding("input-ignore-unknown", {"name": unknown[0], "allowed": groups}, severity="refused"))
    kept = []
    for one in found:
        if one.code in ignored or one.group in ignored:
            kept.append(one._replace(severity="ignored"))
        elif one.severity == "refused":
            raise InputError(one) if path is None else FileError(one, path=path)
        else:
            kept.append(one)
    return tuple(kept)

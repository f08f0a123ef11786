"""The command line."""

from __future__ import annotations

import _thread
import errno
import gc
import os
import sys
import threading
import warnings
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from cyclopts import CoercionError, CycloptsError, UnknownOptionError

    from inclinometry.errors import InclinometryError

_RENAMED: Final = {
    "--left-handed": "--left-handed-channels", "--nameplate": "--data-sheet", "--mag-axes": "--magnetometer-axes",
    "--other-stand": "--new-stand", "--spike": "--outlier",
}  # fmt: skip
"""Old name of an option, which is refused -> its name now."""


def main(arguments: list[str] | None = None) -> None:
    """Run a command; exit status 0 done, 1 a verdict of failure, 2 bad input, 3 our own error, 130 interrupted.

    With INCLINOMETRY_TRACEBACK=1 in the environment errors no one foresaw are raised and Python's warnings shown.
    """
    # all matrices here are small: threads only make them slower, many times so on a busy machine
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # what is imported stays: to look for garbage after every 700 objects takes a tenth of the start
    gc.set_threshold(50_000)
    given = sys.argv[1:] if arguments is None else arguments
    if arguments is None:
        sys.unraisablehook = _interrupted_again
    try:
        with warnings.catch_warnings():
            if not _traceback():
                # what a user must know is said in words; a line of source is useless at the bench
                warnings.simplefilter("ignore")
            status = _run(given)
    except KeyboardInterrupt:
        status = _misused("option-interrupted", given, {}, 130)
    except BrokenPipeError:
        # the reader of a pipe has gone: not an error of ours, and nothing more can be said on that stream
        sys.stderr.close()
        status = 0
    except Exception as error:
        if _traceback():
            raise
        # one line and an exit status for an error no one raised on purpose
        what = _one_line(str(error)) or "no more is known"
        # what the system says of a path that a user gave, wherever it is looked at first
        of_names = ["ENAMETOOLONG", "ENOTDIR", "EISDIR", "ELOOP", "EACCES", "EPERM", "EROFS", "ENXIO", "ENODEV"]
        if isinstance(error, MemoryError):
            status = _misused("option-memory", given, {"reason": what})
        elif isinstance(error, OSError) and errno.errorcode.get(error.errno or 0) in of_names and error.filename:
            status = _misused("option-path", given, {"path": f"{error.filename}", "reason": f"{error.strerror}"})
        # by name: numpy may not have been imported, or be what failed to import
        elif isinstance(error, OverflowError) or "LinAlgError" in [kind.__name__ for kind in type(error).__mro__]:
            status = _misused("input-overflow", given, {"name": what})
        else:
            status = _misused("option-internal", given, {"kind": type(error).__name__, "reason": what}, 3)
    sys.exit(status)


def _interrupted_again(lost: sys.UnraisableHookArgs) -> None:
    """Python drops an interruption that comes while it throws an object away: it is raised once more."""
    if lost.exc_type is KeyboardInterrupt:
        threading.Timer(0.05, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(lost)


def _run(arguments: list[str]) -> int:
    """The command's exit status; what a user can repair is said in one line."""
    from cyclopts import CycloptsError

    from inclinometry.cli.general import EMPTY, OLD_IGNORE, general
    from inclinometry.errors import InclinometryError, SiteError, in_file

    try:
        words = [word or EMPTY for word in arguments]
        status = general(words, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        return _unparsed(error, arguments)
    except SiteError as error:
        path = next((value for name, value in pairwise(arguments) if name == "--site"), None)
        return _refused(error if path is None else in_file(error, path), arguments)
    except InclinometryError as error:
        return _refused(error, arguments)
    except ImportError as error:
        from inclinometry.cli.extras import missing

        needed = missing(error)
        if needed is None:
            raise
        return _misused("option-extra", arguments, {"package": needed[0], "extra": needed[1]})
    if any(word.partition("=")[0] == OLD_IGNORE for word in arguments):
        from inclinometry.cli.output import findings
        from inclinometry.findings import Finding

        findings([Finding("option-renamed", {"name": OLD_IGNORE, "now": "--ignore"})])
    return status if isinstance(status, int) else 0


def _unparsed(error: CycloptsError, arguments: list[str]) -> int:
    """Say what is wrong with a command as it was typed."""
    from cyclopts import CoercionError, MissingArgumentError, UnknownOptionError, UnusedCliTokensError

    from inclinometry.errors import InclinometryError

    # a quantity refuses a value with a finding of its own
    cause: object = _unfit(error) if isinstance(error, CoercionError) else None
    cause = error.__cause__ if isinstance(error.__cause__, InclinometryError) else cause
    if isinstance(cause, InclinometryError):
        return _refused(cause, arguments)
    if isinstance(error, UnknownOptionError):
        return _unknown(error, arguments)
    if isinstance(error, UnusedCliTokensError):
        return _misused("option-unexpected", arguments, {"words": _one_line(" ".join(error.unused_tokens or ()))})
    if isinstance(error, MissingArgumentError) and error.argument is not None and not error.tokens_so_far:
        # of a required option that is not there at all the framework says that it "requires an argument"
        code = "option-needed" if error.keyword is None else "option-no-value"
        return _misused(code, arguments, {"name": error.argument.name})
    return _misused("option-usage", arguments, {"reason": _one_line(str(error))})


def _unfit(error: CoercionError) -> InclinometryError | None:
    """The refusal of a value that is none of the choices of its option, or no number; None of another one."""
    from typing import Literal, get_args, get_origin

    from inclinometry.cli.general import as_typed
    from inclinometry.errors import not_among, wrong_kind

    if error.token is None or error.target_type is None or error.msg is not None:
        return None
    name = error.token.keyword or ("" if error.argument is None else error.argument.name.lstrip("-").upper())
    value = as_typed(error.token.value) or '""'
    kinds: list[Any] = [error.target_type]
    for kind in kinds:  # unions of unions
        kinds += [] if get_origin(kind) is Literal else [part for part in get_args(kind) if part is not type(None)]
    choices = [choice for kind in kinds if get_origin(kind) is Literal for choice in get_args(kind)]
    if choices and all(isinstance(choice, str) for choice in choices):
        return not_among(name, value, choices)
    numbers = {float: "number", int: "whole number"}
    expected = [numbers[kind] for kind in kinds if kind in numbers]
    return wrong_kind(name, value, expected[0]) if name and expected else None


def _traceback() -> bool:
    return os.environ.get("INCLINOMETRY_TRACEBACK") == "1"


def _unknown(error: UnknownOptionError, arguments: list[str]) -> int:
    """An option that the command does not have, and what it has instead."""
    from difflib import get_close_matches

    option = _one_line((error.token.keyword or error.token.value).partition("=")[0])
    # other commands name by an option what this one takes as its argument: the tool by --calibration, above all
    for argument in error.argument_collection:
        if option in (f"--{argument.name.lower()}", "--calibration" if argument.name == "TOOL" else ""):
            return _misused("option-argument", arguments, {"name": option, "argument": argument.name})
        if _RENAMED.get(option) in argument.names:
            return _misused("option-renamed", arguments, {"name": option, "now": _RENAMED[option]})
    names = [name for argument in error.argument_collection for name in argument.names]
    # the same but for a slip, or begun alike
    near = [name for name in names if name.startswith(option)] or get_close_matches(option, names, 1, 0.7)
    if near:
        return _misused("option-near", arguments, {"name": option, "near": near[0]})
    return _misused("option-unknown", arguments, {"name": option})


def _misused(code: str, arguments: list[str], values: dict[str, str], status: int = 2) -> int:
    """Say why a command cannot be run as it was given, or has ended."""
    from inclinometry.errors import refused

    return _refused(refused(code, values), arguments, status)


def _refused(error: InclinometryError, arguments: list[str], status: int = 2) -> int:
    """Say a refusal with its code, and how to accept the file in spite of it; with --json as data too."""
    from inclinometry.cli.output import print_json, wrapped
    from inclinometry.errors import FileError

    found = error.finding
    if "--json" in arguments:
        where = {"file": error.path, "line": error.line, "row": error.row} if isinstance(error, FileError) else {}
        print_json({"findings": [found.plain() | where]})
    accepts = f"; --ignore {found.code} accepts the file" if found.group else ""
    line = f"inclinometry: {_one_line(str(error))} [{found.code}{accepts}]"
    print(wrapped(line, sys.stderr), file=sys.stderr)  # noqa: T201
    return status


def _one_line(text: str) -> str:
    from inclinometry.cli.general import as_typed

    return as_typed(" ".join(text.split()))

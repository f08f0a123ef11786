"""The command line."""

from __future__ import annotations

import errno
import gc
import os
import sys
import warnings
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cyclopts import CoercionError

    from inclinometry.errors import InclinometryError


def main(arguments: list[str] | None = None) -> None:
    """Run a command; exit status 0 done, 1 a verdict of failure, 2 bad input, 3 our own error, 130 interrupted.

    With INCLINOMETRY_TRACEBACK=1 in the environment errors no one foresaw are raised and Python's warnings shown.
    """
    # all matrices here are small: threads only make them slower, many times so on a busy machine
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # what is imported stays: to look for garbage after every 700 objects takes a tenth of the start
    gc.set_threshold(50_000)
    try:
        with warnings.catch_warnings():
            if not _traceback():
                # what a user must know is said in words; a line of source is useless at the bench
                warnings.simplefilter("ignore")
            status = _run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        _say("interrupted; nothing half-written")
        status = 130
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
            _say(f"inclinometry: this does not fit into memory ({what}); use less data at a time")
            status = 2
        elif isinstance(error, OSError) and errno.errorcode.get(error.errno or 0) in of_names and error.filename:
            _say(f"inclinometry: {error.filename}: cannot be used ({error.strerror}); check the name and its rights")
            status = 2
        # by name: numpy may not have been imported, or be what failed to import
        elif isinstance(error, OverflowError) or "LinAlgError" in [kind.__name__ for kind in type(error).__mro__]:
            _say(f"inclinometry: this input defeats the arithmetic ({what}); look for values of absurd size in it")
            status = 2
        else:
            name = type(error).__name__
            _say(f"inclinometry: internal error: {name}: {what} (set INCLINOMETRY_TRACEBACK=1 to see where)")
            status = 3
    sys.exit(status)


def _run(arguments: list[str]) -> int:
    """The command's exit status; what a user can repair is said in one line."""
    from cyclopts import CoercionError, CycloptsError, MissingArgumentError, UnknownOptionError, UnusedCliTokensError

    from inclinometry.cli.general import EMPTY, general
    from inclinometry.errors import InclinometryError

    try:
        words = [word or EMPTY for word in arguments]
        status = general(words, exit_on_error=False, print_error=False, result_action="return_value")
    except MissingArgumentError as error:
        # of a required option that is not there at all the framework says that it "requires an argument"
        missing_one = error.argument is not None and error.keyword is None and not error.tokens_so_far
        lacks = "is needed" if missing_one else "needs a value" if not error.tokens_so_far else ""
        text = f"{error.argument.name} {lacks}" if lacks and error.argument is not None else str(error)
        _say(f"inclinometry: {_one_line(text)} (see --help)")
        return 2
    except UnknownOptionError as error:
        option = (error.token.keyword or error.token.value).partition("=")[0]
        # other commands name by an option what this one takes as its argument: the tool by --calibration, above all
        for argument in error.argument_collection:
            if option in (f"--{argument.name.lower()}", "--calibration" if argument.name == "TOOL" else ""):
                remedy = f"give the file by itself, as {argument.name} (see --help)"
                _say(f"inclinometry: {option} is no option here: {remedy}")
                return 2
        text, did_you_mean, near = str(error).partition(" Did you mean ")
        # what the framework takes for near is often another option altogether
        said = text + did_you_mean + near if _alike(option, near.rstrip("?")) else text
        _say(f"inclinometry: {_one_line(said)} (see --help)")
        return 2
    except UnusedCliTokensError as error:
        _say(f"inclinometry: not expected here: {_one_line(' '.join(error.unused_tokens or ()))} (see --help)")
        return 2
    except CycloptsError as error:
        # a quantity refuses a value with a finding of its own
        if isinstance(error.__cause__, InclinometryError):
            return _refused(error.__cause__, arguments)
        unfit = _unfit(error) if isinstance(error, CoercionError) else None
        if unfit is not None:
            return _refused(unfit, arguments)
        _say(f"inclinometry: {_one_line(str(error))} (see --help)")
        return 2
    except InclinometryError as error:
        return _refused(error, arguments)
    except ImportError as error:
        from inclinometry.cli.extras import missing

        needed = missing(error)
        if needed is None:
            raise
        _say(f"inclinometry: {needed}")
        return 2
    return status if isinstance(status, int) else 0


def _unfit(error: CoercionError) -> InclinometryError | None:
    """The refusal of a value that is none of the choices of its option, or no number; None of another one."""
    from typing import Literal, get_args, get_origin

    from inclinometry.cli.general import as_typed
    from inclinometry.errors import not_among, wrong_kind

    if error.token is None:
        return None
    name = error.token.keyword or ("" if error.argument is None else error.argument.name.lstrip("-").upper())
    value = as_typed(error.token.value) or '""'
    if "to float" in str(error.__cause__):  # Python's words for a text that is no number
        return wrong_kind(name, value, "number")
    if error.target_type is None or error.msg is not None:
        return None
    kinds: list[Any] = [error.target_type]
    for kind in kinds:  # unions of unions
        kinds += [] if get_origin(kind) is Literal else [part for part in get_args(kind) if part is not type(None)]
    choices = [choice for kind in kinds if get_origin(kind) is Literal for choice in get_args(kind)]
    if choices and all(isinstance(choice, str) for choice in choices):
        return not_among(name, value, choices)
    numbers = {float: "number", int: "whole number"}
    expected = [numbers[kind] for kind in kinds if kind in numbers]
    return wrong_kind(name, value, expected[0]) if name and expected else None


def _alike(option: str, near: str) -> bool:
    """An option that may have been meant: the same but for a slip, or begun alike."""
    from difflib import SequenceMatcher

    return near.startswith(option) or SequenceMatcher(None, option, near).ratio() > 0.7


def _traceback() -> bool:
    return os.environ.get("INCLINOMETRY_TRACEBACK") == "1"


def _refused(error: InclinometryError, arguments: list[str]) -> int:
    """Say a refusal with its code, and how to accept the file in spite of it; with --json as data too."""
    from inclinometry.errors import FileError

    found = error.finding
    if found is not None and "--json" in arguments:
        from inclinometry.cli.output import print_json

        where = {"file": error.path, "line": error.line, "row": error.row} if isinstance(error, FileError) else {}
        print_json({"findings": [found.plain() | where]})
    accepts = "" if found is None or not found.group else f"; --ignore {found.code} accepts the file"
    _say(f"inclinometry: {_one_line(str(error))}" + ("" if found is None else f" [{found.code}{accepts}]"))
    return 2


def _one_line(text: str) -> str:
    from inclinometry.cli.general import as_typed

    return as_typed(" ".join(text.split()))


def _say(message: str) -> None:
    from inclinometry.cli.output import wrapped

    print(wrapped(message, sys.stderr), file=sys.stderr)  # noqa: T201

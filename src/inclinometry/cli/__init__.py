"""The command line."""

from __future__ import annotations

import errno
import gc
import os
import sys
import warnings
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from cyclopts import UnknownOptionError

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
    try:
        with warnings.catch_warnings():
            if not _traceback():
                # what a user must know is said in words; a line of source is useless at the bench
                warnings.simplefilter("ignore")
            status = _run(given)
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
            status = _misused("option-memory", given, {"reason": what})
        elif isinstance(error, OSError) and errno.errorcode.get(error.errno or 0) in of_names and error.filename:
            status = _misused("option-path", given, {"path": f"{error.filename}", "reason": f"{error.strerror}"})
        # by name: numpy may not have been imported, or be what failed to import
        elif isinstance(error, OverflowError) or "LinAlgError" in [kind.__name__ for kind in type(error).__mro__]:
            status = _misused("input-overflow", given, {"name": what})
        else:
            name = type(error).__name__
            _say(f"inclinometry: internal error: {name}: {what} (set INCLINOMETRY_TRACEBACK=1 to see where)")
            status = 3
    sys.exit(status)


def _run(arguments: list[str]) -> int:
    """The command's exit status; what a user can repair is said in one line."""
    from cyclopts import CycloptsError, MissingArgumentError, UnknownOptionError

    from inclinometry.cli.general import EMPTY, general
    from inclinometry.errors import InclinometryError

    try:
        words = [word or EMPTY for word in arguments]
        status = general(words, exit_on_error=False, print_error=False, result_action="return_value")
    except MissingArgumentError as error:
        # of a required option that is not there at all the framework says that it "requires an argument"
        missing_one = error.argument is not None and error.keyword is None and not error.tokens_so_far
        if missing_one and error.argument is not None:
            return _misused("option-needed", arguments, {"name": error.argument.name})
        return _misused("option-usage", arguments, {"reason": _one_line(str(error))})
    except UnknownOptionError as error:
        return _unknown(error, arguments)
    except CycloptsError as error:
        # a quantity refuses a value with a finding of its own
        if isinstance(error.__cause__, InclinometryError):
            return _refused(error.__cause__, arguments)
        return _misused("option-usage", arguments, {"reason": _one_line(str(error))})
    except InclinometryError as error:
        return _refused(error, arguments)
    except ImportError as error:
        from inclinometry.cli.extras import missing

        needed = missing(error)
        if needed is None:
            raise
        return _misused("option-extra", arguments, {"package": needed[0], "extra": needed[1]})
    from inclinometry.cli.options import OLD_IGNORE

    if any(word.partition("=")[0] == OLD_IGNORE for word in arguments):
        from inclinometry.cli.output import findings
        from inclinometry.findings import Finding

        findings([Finding("option-renamed", {"name": OLD_IGNORE, "now": "--ignore"})])
    return status if isinstance(status, int) else 0


def _traceback() -> bool:
    return os.environ.get("INCLINOMETRY_TRACEBACK") == "1"


def _unknown(error: UnknownOptionError, arguments: list[str]) -> int:
    """An option that the command does not have, and what it has instead."""
    option = (error.token.keyword or error.token.value).partition("=")[0]
    # other commands name by an option what this one takes as its argument: the tool by --calibration, above all
    for argument in error.argument_collection:
        if option in (f"--{argument.name.lower()}", "--calibration" if argument.name == "TOOL" else ""):
            return _misused("option-argument", arguments, {"name": option, "argument": argument.name})
        if _RENAMED.get(option) in argument.names:
            return _misused("option-renamed", arguments, {"name": option, "now": _RENAMED[option]})
    return _misused("option-usage", arguments, {"reason": _one_line(str(error))})


def _misused(code: str, arguments: list[str], values: dict[str, str]) -> int:
    """Say why a command cannot be run as it was given."""
    from inclinometry.errors import refused

    return _refused(refused(code, values), arguments)


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

"""The command line."""

from __future__ import annotations

import errno
import gc
import os
import sys
import warnings
from contextlib import ExitStack
from typing import BinaryIO


def main(arguments: list[str] | None = None) -> None:
    """Run a command; exit status 0 done, 1 a verdict of failure, 2 bad input, 3 our own error, 130 interrupted.

    With INCLINOMETRY_TRACEBACK=1 in the environment errors nobody foresaw are raised and Python's warnings shown.
    """
    # all matrices here are small: threads only make them slower, many times so on a busy machine
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # what is imported stays: to look for garbage after every 700 objects takes a tenth of the start
    gc.set_threshold(50_000)
    try:
        with warnings.catch_warnings():
            if not _traceback():
                # what a user must know is said in words; a line of source is of no use at the bench
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
        # one line and an exit status for an error nobody raised on purpose
        what = _one_line(str(error)) or "no more is known"
        if isinstance(error, MemoryError):
            _say(f"inclinometry: this does not fit into memory ({what}); use less data at a time")
            status = 2
        elif isinstance(error, OSError) and error.errno in _OF_NAMES and error.filename:
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


# what the system says of a path that somebody gave, wherever it is looked at first
_OF_NAMES = {
    *(errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.EACCES, errno.EPERM, errno.EROFS),
    *(errno.ENXIO, errno.ENODEV),
}


def _run(arguments: list[str]) -> int:
    """The command's exit status; what a user can mend is said in one line."""
    from cyclopts import CycloptsError, MissingArgumentError, UnknownOptionError
    from rich.console import Console

    from inclinometry.cli.app import app
    from inclinometry.errors import InclinometryError

    try:
        instead = None if "--help" in arguments else _instead(arguments)
        if instead is not None:
            return instead
        with ExitStack() as stack:
            arguments, stated = _of_tables(_from_stdin(_manners(arguments, stack), stack))
            used = ["no profile"]
            if stated:
                from inclinometry.files.profile import reading_with

                null = _number(stated.get("--null"))
                used = stack.enter_context(reading_with(stated.get("--profile"), stated.get("--units"), null))
            # a page of help as it is written: no smileys for words between colons, no markup in brackets
            console = Console(emoji=False, markup=False, highlight=False)
            status = app(
                arguments, console=console, exit_on_error=False, print_error=False, result_action="return_value"
            )
            if not used:
                _say(f"warning: {' and '.join(stated)} had no table to be used for")
    except MissingArgumentError as error:
        # of a required option that is not there at all the framework says that it "requires an argument"
        missing_one = error.argument is not None and error.keyword is None and not error.tokens_so_far
        text = f"{error.argument.name} is needed" if missing_one and error.argument is not None else str(error)
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
        _say(f"inclinometry: {_one_line(str(error))} (see --help)")
        return 2
    except CycloptsError as error:
        _say(f"inclinometry: {_one_line(str(error))} (see --help)")
        return 2
    except InclinometryError as error:
        _say(f"inclinometry: {_one_line(str(error))}")
        return 2
    except ImportError as error:
        from inclinometry.cli.extras import missing

        needed = missing(error)
        if needed is None:
            raise
        _say(f"inclinometry: {needed}")
        return 2
    return status if isinstance(status, int) else 0


def _instead(arguments: list[str]) -> int | None:
    """The exit status of what runs in the place of one command: a template, or a command for each of many files."""
    from inclinometry.cli.each import many, run_each

    if "--template" in arguments and arguments[:1] != ["datasheet"]:  # which has a template of another kind
        from inclinometry.cli.template import print_template

        return print_template(arguments)
    found = many(arguments)
    return None if found is None else run_each(found, _run)


def _manners(arguments: list[str], stack: ExitStack) -> list[str]:
    """The arguments without the options that every command has.

    -q keeps tables and sentences to itself, -v says on standard error what was understood of each file and how long
    each step took, --open shows the report then, --language is what it is written in.
    """
    if {"-v", "--verbose"} & set(arguments):
        _verbose(stack)
    if {"-q", "--quiet"} & set(arguments):
        from inclinometry.cli.output import console

        console.quiet = True
        stack.callback(setattr, console, "quiet", False)
    if "--open" in arguments:
        import webbrowser
        from pathlib import Path

        from inclinometry.errors import InputError

        at = arguments.index("--report") + 1 if "--report" in arguments else len(arguments)
        if at >= len(arguments):
            raise InputError("--open shows a report; name it with --report")
        page = Path(arguments[at]).resolve().as_uri()
        stack.push(lambda kind, *_: kind is None and webbrowser.open(page))
    rest = [word for word in arguments if word not in ("-q", "--quiet", "-v", "--verbose", "--open")]
    if rest[:2] == ["certificate", "verify"]:  # a command of its own beside the one of its first word
        rest[:2] = ["certificate verify"]
    at = next((k for k, word in enumerate(rest) if word.partition("=")[0] == "--language"), len(rest))
    # a certificate, and a user of the ledger, have a language of their own
    if at < len(rest) and rest[0] not in ("certificate", "ledger"):
        from inclinometry.errors import InputError
        from inclinometry.report.language import LANGUAGES, speaking

        _, told, name = rest.pop(at).partition("=")
        name = name if told else rest.pop(at) if at < len(rest) and not rest[at].startswith("-") else ""
        if not name:
            raise InputError(f"--language needs the name of a language; allowed {', '.join(LANGUAGES)}")
        # the page of a fleet is what its command writes
        options = ("-o", "--output") if rest[:2] == ["fleet", "report"] else ("--report",)
        if rest[:1] != ["demo"] and not any(word.partition("=")[0] in options for word in rest):
            raise InputError(f"--language {name} is the language of a report; name it with {options[-1]}")
        stack.enter_context(speaking(name))
    return rest


def _verbose(stack: ExitStack) -> None:
    import logging
    from time import perf_counter

    from inclinometry.cli.output import named

    log, start = logging.getLogger("inclinometry"), perf_counter()
    before = log.level

    class Lines(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            _say(f"  {named(record.getMessage())}")

    lines = Lines()
    log.addHandler(lines)
    log.setLevel(logging.INFO)
    stack.callback(log.setLevel, before)
    stack.callback(log.removeHandler, lines)
    stack.callback(lambda: _say(f"  altogether {perf_counter() - start:.2f} s"))


_OF_TABLES = {"--profile": "a profile", "--units": "units such as ft,deg", "--null": "a number such as -999.25"}


def _of_tables(arguments: list[str]) -> tuple[list[str], dict[str, str]]:
    """The arguments without --profile, --units and --null, which are of every command that reads a table, and these."""
    from inclinometry.errors import InputError

    rest: list[str] = []
    stated: dict[str, str] = {}
    words = iter(arguments)
    for word in words:
        name, equals, value = word.partition("=")
        if name not in _OF_TABLES or "--help" in arguments:
            rest.append(word)
            continue
        if name in stated:
            raise InputError(f"{name} is given twice; give it once")
        stated[name] = value if equals else next(words, "")
        if not stated[name]:
            raise InputError(f"{name} needs a value: {_OF_TABLES[name]}")
    return rest, stated


def _number(text: str | None) -> float | None:
    from inclinometry.errors import InputError

    try:
        return None if text is None else float(text)
    except ValueError:
        raise InputError(f"--null is {text!r}; a number is needed, such as -999.25") from None


def _from_stdin(arguments: list[str], stack: ExitStack) -> list[str]:
    """A single hyphen among the inputs is a copy of standard input, behind -o standard output; so are pipes."""
    pipes = {word for word in arguments if word != "-" and _is_pipe(word)}
    if "-" not in arguments and not pipes:
        return arguments
    import tempfile
    from pathlib import Path

    from inclinometry.cli.output import called
    from inclinometry.errors import InputError

    found = []
    for place, word in enumerate(arguments):
        if word in pipes and arguments[place - 1] not in ("-o", "--output"):
            copy = Path(stack.enter_context(tempfile.TemporaryDirectory()), Path(word).name)
            _copy_of_pipe(word, str(copy))
            stack.enter_context(called(copy, word))
            found.append(str(copy))
        elif word != "-":
            found.append(word)
        elif place and arguments[place - 1] in ("-o", "--output"):
            if not os.path.exists("/dev/stdout"):  # noqa: PTH110
                raise InputError("-o -: this system has no file for standard output; give a name")
            found.append("/dev/stdout")
        elif any(name.endswith("stdin.txt") for name in found):
            raise InputError("- is given twice; standard input can be read once")
        else:
            copy = Path(stack.enter_context(tempfile.TemporaryDirectory()), "stdin.txt")
            _copy(sys.stdin.buffer, str(copy), "standard input")
            stack.enter_context(called(copy, "standard input"))
            found.append(str(copy))
    return found


def _is_pipe(word: str) -> bool:
    import stat

    try:
        return stat.S_ISFIFO(os.stat(word).st_mode)  # noqa: PTH116
    except (OSError, ValueError):
        return False


def _copy_of_pipe(word: str, copy: str) -> None:
    """What is written into a named pipe or by another command, <(...); refused when nobody writes into it."""
    import select

    from inclinometry.errors import FileError

    patience_s = 5.0
    # to open it as others do would wait for ever
    number = os.open(word, os.O_RDONLY | os.O_NONBLOCK)
    with open(number, "rb") as stream:  # noqa: PTH123
        if not select.select([stream], [], [], patience_s)[0]:
            raise FileError(f"is a pipe into which nothing was written for {patience_s:g} s; name a file", path=word)
        os.set_blocking(number, True)
        _copy(stream, copy, word)


def _copy(stream: BinaryIO, copy: str, name: str) -> None:
    """All that comes out of a pipe, into a file; a pipe may have no end."""
    from inclinometry.errors import FileError

    most = 4 << 30
    with open(copy, "wb") as out:  # noqa: PTH123
        while piece := stream.read(1 << 20):
            out.write(piece)
            if out.tell() > most:
                raise FileError(f"more than {most:,} bytes came; name a file", path=name)


def _traceback() -> bool:
    return os.environ.get("INCLINOMETRY_TRACEBACK") == "1"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _say(message: str) -> None:
    print(message, file=sys.stderr)  # noqa: T201

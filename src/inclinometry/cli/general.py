"""Options that every command has: how files are read, how much is said, how the report is shown."""

from __future__ import annotations

import logging
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from math import isnan
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Final, Literal, TypeAlias

from cyclopts import App, Parameter

from inclinometry.cli.app import app
from inclinometry.errors import FileError, refused
from inclinometry.findings import Finding

_HYPHEN = "\0"
"""What the parser, which would take a hyphen for an option, reads in its place."""
EMPTY = "\1"
"""The same for an empty word, which the parser would leave out."""


def as_typed(text: str) -> str:
    """A word, or a sentence about it, without what stands in the place of a hyphen or of nothing."""
    return text.replace(_HYPHEN, "-").replace(EMPTY, "")


OLD_IGNORE: Final = "--trust-file"
"""Old name of --ignore, still read in this version."""
Flag: TypeAlias = Annotated[bool, Parameter(negative="")]

general = App(help_flags=(), version_flags=(), end_of_options_delimiter="", suppress_keyboard_interrupt=False)


@general.default
def run(
    *words: Annotated[str, Parameter(allow_leading_hyphen=True)],
    quiet: Annotated[bool, Parameter(name=["--quiet", "-q"], negative="")] = False,
    verbose: Annotated[bool, Parameter(name=["--verbose", "-v"], negative="")] = False,
    open_: Annotated[bool, Parameter(name="--open", negative="")] = False,
    template: Flag = False,
    language: Literal["en", "ru", "zh"] | None = None,
    profile: str = "",
    units: str = "",
    null: float = float("nan"),
    sheet: str = "",
) -> int:
    """Run the command that `words` are; its exit status."""
    from rich.console import Console

    words, profile, units, sheet = tuple(map(as_typed, words)), *map(as_typed, (profile, units, sheet))
    if template and words[:1] == ("datasheet",):  # which has a template of another kind
        words = (*words, "--template")
    elif template:
        from inclinometry.cli.template import print_template

        return print_template(words)
    if words[:2] == ("certificate", "verify"):  # a command of its own beside the one of its first word
        words = ("certificate verify", *words[2:])
    with ExitStack() as stack:
        if verbose:
            stack.enter_context(_verbose())
        if quiet:
            from inclinometry.cli.output import console

            console.quiet = True
            stack.callback(setattr, console, "quiet", False)
        words = tuple(_HYPHEN if word == "-" else word for word in words)
        # a page of help as it is written: no smileys for words between colons, no markup in brackets
        plain = Console(emoji=False, markup=False, highlight=False)
        command, bound, _ = app.parse_args(words, console=plain, exit_on_error=False, print_error=False)
        if _HYPHEN in words:
            bound.arguments.update(_streams(bound.arguments, stack))
        # the page of a fleet is what its command writes
        option = "--output" if words[:2] == ("fleet", "report") else "--report"
        page: Path | None = bound.arguments.get("output_" if option == "--output" else "report")
        if open_ and page is None:
            raise refused("input-needs", {"name": "--open", "needed": (option,)})
        if language is not None and "language" in bound.signature.parameters:
            bound.arguments["language"] = language  # of a certificate, or of a user of the ledger
        elif language is not None:
            from inclinometry.language import using_language

            if page is None and words[:1] not in (("demo",), ("explain",), ("list",)):
                raise refused("input-needs", {"name": "--language", "needed": (option,)})
            stack.enter_context(using_language(language))
        stack.enter_context(_tables(profile, units, null, sheet))
        status = command(*bound.args, **bound.kwargs)
    if open_ and page is not None:
        import webbrowser

        webbrowser.open(page.resolve().as_uri())
    return status if isinstance(status, int) else 0


@contextmanager
def _tables(profile: str, units: str, null: float, sheet: str) -> Iterator[None]:
    """Tables are read as stated; where none was read, a warning says so."""
    stated = {"--profile": bool(profile), "--units": bool(units), "--null": not isnan(null), "--sheet": bool(sheet)}
    if not any(stated.values()):
        yield
        return
    from inclinometry.files.profile import reading_with

    with reading_with(profile or None, units or None, None if isnan(null) else null, sheet or None) as used:
        yield
    if not used:
        from inclinometry.cli.output import findings

        findings([Finding("option-unused", {"names": tuple(name for name, given in stated.items() if given)})])


@contextmanager
def _verbose() -> Iterator[None]:
    from inclinometry.cli.output import named, wrapped

    log, start = logging.getLogger("inclinometry"), perf_counter()
    before = log.level

    class Lines(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            print(wrapped(f"  {named(record.getMessage())}", sys.stderr), file=sys.stderr)  # noqa: T201

    lines = Lines()
    log.addHandler(lines)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        print(f"  altogether {perf_counter() - start:.2f} s", file=sys.stderr)  # noqa: T201
        log.removeHandler(lines)
        log.setLevel(before)


def _streams(given: Mapping[str, Any], stack: ExitStack) -> Iterator[tuple[str, Any]]:
    """Arguments of a command: a path `-` is a copy of standard input, as --output standard output; a word stays."""
    from inclinometry.cli.output import path_alias

    copy, most = None, 4 << 30  # bytes
    for name, value in given.items():
        found: list[Any] = []
        for one in value if isinstance(value, tuple) else (value,):
            if one == Path(_HYPHEN) and name == "output_":
                if not os.path.exists("/dev/stdout"):  # noqa: PTH110
                    raise FileError(Finding("file-unwritable", {"reason": "no /dev/stdout"}), path=one)
                found.append(Path("/dev/stdout"))
            elif one == Path(_HYPHEN) and copy is not None:
                raise refused("input-repeated", {"name": "stdin", "value": "-"})
            elif one == Path(_HYPHEN):
                copy = Path(stack.enter_context(tempfile.TemporaryDirectory()), "stdin.txt")
                with copy.open("wb") as out:
                    while piece := sys.stdin.buffer.read(1 << 20):
                        out.write(piece)
                        if out.tell() > most:
                            raise FileError(Finding("option-piped", {"most": most}), path="standard input")
                stack.enter_context(path_alias(copy, "standard input"))
                found.append(copy)
            else:
                found.append(as_typed(one) if isinstance(one, str) else one)
        yield name, tuple(found) if isinstance(value, tuple) else found[0]

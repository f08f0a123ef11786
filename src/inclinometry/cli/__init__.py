"""The command line."""

from __future__ import annotations

import os
import sys


def main(arguments: list[str] | None = None) -> None:
    """Run a command; exit status 0 done, 1 a verdict of failure, 2 bad input, 130 interrupted."""
    # the house's matrices are small: threads only make them slower, many times so on a busy machine
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from cyclopts import CycloptsError

    from inclinometry.cli.app import app
    from inclinometry.core.errors import InclinometryError

    try:
        status = app(
            sys.argv[1:] if arguments is None else arguments,
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
    except CycloptsError as error:
        _fail(_one_line(str(error)) + " (see --help)")
    except InclinometryError as error:
        _fail(_one_line(str(error)))
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)  # noqa: T201
        sys.exit(130)
    except BrokenPipeError:
        # the reader of a pipe has gone: not an error of ours, and nothing more can be said on that stream
        sys.stderr.close()
        sys.exit(0)
    sys.exit(status if isinstance(status, int) else 0)


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _fail(message: str) -> None:
    print(f"inclinometry: {message}", file=sys.stderr)  # noqa: T201
    sys.exit(2)

"""Benchmarks: `python -m benchmarks` runs them all. Figures are for one core, so the linear algebra gets one thread."""

import os
from collections.abc import Callable, Iterator
from typing import Any

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


def command(doc: str | None, run: Callable[..., Any], report: Callable[[Any], object]) -> None:
    """The command line of a benchmark: an option for each parameter of `run`, with its default, and --json."""
    import argparse
    import inspect
    import json

    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a report")
    for name, parameter in inspect.signature(run).parameters.items():
        flag, default = f"--{name.replace('_', '-')}", parameter.default
        if default is False:
            parser.add_argument(flag, action="store_true")
        elif isinstance(default, tuple):
            parser.add_argument(flag, nargs="+", choices=default, default=default, metavar="NAME", help="default all")
        else:
            kind = {int: lambda text: int(float(text)), float: float}.get(type(default), str)
            parser.add_argument(flag, type=kind, default=default, help=f"default {default}")
    given = vars(parser.parse_args())
    as_json = given.pop("json")
    found = run(**given)
    if not as_json:
        report(found)
    elif isinstance(found, Iterator):
        for row in found:
            print(json.dumps(row), flush=True)
    else:
        print(json.dumps(found, indent=1))

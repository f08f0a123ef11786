"""The project in figures: how many files, records, names and imports a successor has to hold in the head.

    python tools/metrics.py [--static] [--write]

Standard library only; reads `src/inclinometry` beside this folder. `calibrate` is run once, in a process of its own, to
count the modules it imports and the processor time it takes. CONTRIBUTING.md shows the table.
"""

from __future__ import annotations

import argparse
import ast
import collections
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import tokenize
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src" / "inclinometry"

LABORATORY = "laboratory/"
"""Folder of the laboratory's wing."""

FORMULAS = {
    # textbook name: (how its file may be called, what stands beside the formula)
    "XYM3": (r"weights?|xym\d?|tool_codes?|iscwsa", r"XYM3"),
    "Allan deviation": (r"allan", r"cumsum|np\.diff|\[2 \* m|m\*\*2"),
    "expanded uncertainty of a certificate": (r"expected|expanded|capability", r"COVERAGE_FACTOR"),
    "sag": (r"sag", r"moment|stiffness|solve\("),
    "Davenport's q": (r"wahba|davenport", r"eigh\("),
    "the patent's root": (r"closed_form|patent|scale", r"sqrt\("),
    "minimum curvature": (r"minimum_curvature|path", r"tan\("),
    "equation (25) of Rogatykh": (r"twelve|closed_forms", r"\(25\)"),
}
"""Eight formulas a newcomer looks for: found when one of two files with the formula's name holds its arithmetic."""


TO_REACH = {
    "lines: core and command line / laboratory": "<= 50,000 / <= 14,000",
    "files: core and command line / laboratory": "<= 200 / <= 60",
    "file median / p95 / largest": "200-300 / <= 650 / <= 900",
    "private functions called once": "<= 15 %",
    "dataclasses and named tuples / upper-case constants": "<= 200 / <= 400",
    "import lines / comments": "<= 3.5 % / >= 3 %",
    "eight formulas found in two guesses": "8 of 8",
    "modules a calibrate run imports": "<= 40",
    "calibrate of 24 stations, processor time": "<= 0.8 s",
    "--help, in starts of a bare interpreter": "<= 12",
}
WAS = {
    "lines: core and command line / laboratory": "76,900 together",
    "files: core and command line / laboratory": "515 together",
    "file median / p95 / largest": "142 / 316 / 394",
    "private functions called once": "29 %",
    "dataclasses and named tuples / upper-case constants": "372 / 1,245",
    "import lines / comments": "6.8 % / 0.5 %",
    "eight formulas found in two guesses": "5 of 8",
    "modules a calibrate run imports": "80",
    "calibrate of 24 stations, processor time": "",
    "--help, in starts of a bare interpreter": "",
}
"""The house at 0134526, and what the second plan of it asks for."""


def parsed() -> dict[Path, tuple[str, ast.Module]]:
    """Text and syntax tree of every module."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(SOURCE.rglob("*.py"))}
    return {path: (text, ast.parse(text)) for path, text in texts.items()}


def static_figures() -> dict[str, str]:
    """What can be counted without running anything."""
    modules = parsed()
    lines = {path: text.count("\n") for path, (text, _) in modules.items()}
    wing = {path for path in modules if path.relative_to(SOURCE).as_posix().startswith(LABORATORY)}
    sizes = sorted(lines.values())
    records = constants = imports = comments = 0
    functions = 0
    defined: dict[tuple[Path, str], int] = {}
    used: collections.Counter[tuple[Path, str]] = collections.Counter()
    for path, (_, tree) in modules.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                functions += 1
                if node.name.startswith("_") and not node.name.startswith("__"):
                    defined[path, node.name] = node.lineno
            elif isinstance(node, ast.ClassDef):
                made = [ast.unparse(d) for d in node.decorator_list] + [ast.unparse(b) for b in node.bases]
                records += any("dataclass" in m or m.endswith("NamedTuple") for m in made)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                used[path, node.id] += 1
            elif isinstance(node, ast.Attribute):
                used[path, node.attr] += 1
            elif isinstance(node, ast.Import | ast.ImportFrom):
                imports += (node.end_lineno or node.lineno) - node.lineno + 1
        for node in tree.body:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                constants += sum(isinstance(t, ast.Name) and t.id.isupper() for t in targets)
        with path.open("rb") as stream:
            tokens = [t for t in tokenize.tokenize(stream.readline) if t.type == tokenize.COMMENT]
        comments += sum(t.line.lstrip().startswith("#") for t in tokens)
    total = sum(sizes)
    once = sum(used[key] == 1 for key in defined)
    found = [name for name, where in FORMULAS.items() if _found(modules, *where)]
    missing = sorted(set(FORMULAS) - set(found))
    in_wing = sum(lines[p] for p in wing)
    return {
        "lines: core and command line / laboratory": f"{total - in_wing} / {in_wing}",
        "files: core and command line / laboratory": f"{len(modules) - len(wing)} / {len(wing)}",
        "file median / p95 / largest": f"{statistics.median(sizes):g} / {sizes[int(0.95 * len(sizes))]} / {sizes[-1]}",
        "private functions called once": f"{100 * once / functions:.0f} %",
        "dataclasses and named tuples / upper-case constants": f"{records} / {constants}",
        "import lines / comments": f"{100 * imports / total:.1f} % / {100 * comments / total:.1f} %",
        "eight formulas found in two guesses": f"{len(found)} of {len(FORMULAS)}"
        + (f" (not {', '.join(missing)})" if missing else ""),
    }


def _found(modules: dict[Path, tuple[str, ast.Module]], stem: str, formula: str) -> bool:
    """Whether one of the first two files of that name, in the order of the alphabet, holds the formula."""
    named = [path for path in modules if re.search(stem, path.stem) and not path.stem.startswith("_")]
    exact = [path for path in named if re.fullmatch(stem, path.stem)] or named
    return any(re.search(formula, modules[path][0]) for path in exact[:2])


_RUN = """
import json, sys, time
from inclinometry.cli import main
sys.argv = ["inclinometry", *sys.argv[1:]]
try:
    main()
except SystemExit:
    pass
mine = sum(name.split(".")[0] == "inclinometry" for name in sys.modules)
print("\\n" + json.dumps({"modules": mine, "seconds": time.process_time(), "numba": "numba" in sys.modules}))
"""


def running_figures() -> dict[str, str]:
    """What needs the package to run: modules a calibration imports, processor time, start beside a bare interpreter."""
    with tempfile.TemporaryDirectory() as folder:
        # compiled once and kept, as where the program is installed, whatever the environment says
        environment = {**os.environ, "PYTHONPATH": str(SOURCE.parent), "PYTHONPYCACHEPREFIX": f"{folder}/compiled"}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)

        def run(*words: str) -> dict[str, float]:
            command = [sys.executable, "-c", _RUN, *words]
            done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True)
            return json.loads(done.stdout.splitlines()[-1])

        run("simulate", "bench", "--plan", "orthogonal", "-o", "readings.csv")
        calibrate = run("calibrate", "readings.csv", "-o", "tool.json")
        calibrate = run("calibrate", "readings.csv", "-o", "again.json")
        # in turn, so that both meet the same load
        starts = [
            (
                _wall([sys.executable, "-c", "pass"], environment),
                _wall([sys.executable, "-m", "inclinometry", "--help"], environment),
            )
            for _ in range(20)
        ]
    bare, help_ = (min(times) for times in zip(*starts, strict=True))
    return {
        "modules a calibrate run imports": f"{calibrate['modules']}",
        "calibrate of 24 stations, processor time": f"{calibrate['seconds']:.2f} s",
        "--help, in starts of a bare interpreter": f"{help_ / bare:.1f}",
    }


def _wall(command: list[str], environment: dict[str, str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, env=environment, capture_output=True, check=True)
    return time.perf_counter() - start


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the table into CONTRIBUTING.md")
    parser.add_argument("--static", action="store_true", help="only what can be counted without running anything")
    given = parser.parse_args()
    figures = static_figures() | ({} if given.static else running_figures())
    for name, value in figures.items():
        print(f"{name:54} {value:22} {TO_REACH[name]}")
    if given.write:
        rows = [f"| {name} | {WAS[name]} | {value} | {TO_REACH[name]} |" for name, value in figures.items()]
        table = "\n".join(["| | was | is | to reach |", "|---|---|---|---|", *rows])
        page = SOURCE.parents[1] / "CONTRIBUTING.md"
        text = page.read_text(encoding="utf-8")
        block = f"<!-- metrics -->\n{table}\n<!-- /metrics -->"
        page.write_text(re.sub(r"<!-- metrics -->.*<!-- /metrics -->", block, text, flags=re.S), encoding="utf-8")


if __name__ == "__main__":
    main()

"""The project in figures: how much a successor has to hold in the head.

    python tools/metrics.py            print them beside the table of CONTRIBUTING.md; exit 1 where one has risen
    python tools/metrics.py --write    write them into the table; a figure that rose needs --why "its reason"

Standard library only; reads `src/inclinometry` beside this folder. `calibrate` is run in a process of its own, to count
the modules it imports and the processor time it takes. Times are printed and never fail: machines are noisy.
"""

from __future__ import annotations

import argparse
import ast
import collections
import functools
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import turns

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "inclinometry"
PAGE = ROOT / "CONTRIBUTING.md"

WING = ("laboratory", "fleet")
"""Folders of the laboratory's wing."""

FORMULAS = {
    # textbook name: (how its file may be called, what stands beside the formula)
    "XYM3": (r"weights?|xym\d?|tool_codes?|iscwsa", r"XYM3"),
    "Allan deviation": (r"allan", r"cumsum|np\.diff|\[2 \* m|m\*\*2"),
    "expanded uncertainty of a certificate": (r"expected|expanded|capability", r"return .*\bk \* |coverage_factor\("),
    "sag": (r"sag", r"moment|stiffness|solve\("),
    "Davenport's q": (r"wahba|davenport", r"eigh\("),
    "the patent's root": (r"closed_form|patent|scale", r"sqrt\(discriminant\)"),
    "minimum curvature": (r"minimum_curvature|path", r"tan\(beta ?/ ?2\)"),
    "equation (25) of Rogatykh": (r"twelve|closed_forms", r"\(25\)"),
}
"""Eight formulas a newcomer looks for: found when one of two files with the formula's name holds its arithmetic."""

LONG_DOCSTRING = 6
LONG_FUNCTION = 60
"""Lines of an internal docstring, of a function without its docstring, from which on it counts as long."""

ERRORS = re.compile(r"(?!Value|Type|Key|OS|Runtime|Index|Lookup|Attribute|Timeout|System|Unicode|TOMLDecode)\w+Error")
"""Names of the package's errors, not of Python's."""

FALLS = {"eight formulas found in two guesses"}
"""Figures that are good when they are high."""

TIMES = {"calibrate of 24 stations, processor time, s", "--help, in starts of a bare interpreter"}
"""Figures that are printed and not held."""


@functools.cache
def public_names() -> set[str]:
    """Names that `inclinometry` offers."""
    return set(re.findall(r'"(\w+)"', (SOURCE / "__init__.py").read_text(encoding="utf-8"))) | set(
        re.findall(r"\b(\w+) as \1\b", "".join(p.read_text(encoding="utf-8") for p in SOURCE.glob("__init__.pyi")))
    )


@functools.cache
def commands() -> set[tuple[str, str]]:
    """Module and function of every command in the table of `cli/app.py`."""
    return set(re.findall(r"\| ([\w.]+):(\w+) \|", (SOURCE / "cli" / "app.py").read_text(encoding="utf-8")))


def static_figures() -> dict[str, float]:
    """What can be counted without running anything."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(SOURCE.rglob("*.py"))}
    modules = {path: (text, ast.parse(text)) for path, text in texts.items()}
    lines = {path: text.count("\n") for path, text in texts.items()}
    wing = {path for path in modules if path.relative_to(SOURCE).parts[0] in WING}
    count: collections.Counter[str] = collections.Counter()
    for path, (_, tree) in modules.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                count["long functions"] += body_lines(node) > LONG_FUNCTION
                if node.name == "calibrate_joint":
                    count["calibrate_joint"] = body_lines(node)
            elif isinstance(node, ast.ClassDef):
                made = [ast.unparse(d) for d in node.decorator_list] + [ast.unparse(b) for b in node.bases]
                count["records"] += any("dataclass" in m or m.endswith("NamedTuple") for m in made)
        for node in tree.body:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                count["constants"] += sum(isinstance(t, ast.Name) and t.id.isupper() for t in targets)
        count["long docstrings"] += len(long_docstrings(path, tree))
    total = sum(lines.values())
    in_wing = sum(lines[path] for path in wing)
    messages = message_words()
    found = sum(_found(texts, *where) for where in FORMULAS.values())
    return {
        "lines": total,
        "lines: core and command line": total - in_wing,
        "lines: laboratory and fleet": in_wing,
        "lines: tests": sum(p.read_text(encoding="utf-8").count("\n") for p in (ROOT / "tests").rglob("*.py")),
        "files": len(modules),
        "longest file": max(lines.values()),
        "records": count["records"],
        "upper-case constants": count["constants"],
        "functions over 60 lines": count["long functions"],
        "lines of calibrate_joint": count["calibrate_joint"],
        "internal docstrings over six lines": count["long docstrings"],
        "errors made of a text": sum(errors_of_text(tree) for _, tree in modules.values()),
        "codes of findings": len(messages),
        "words of a message, mean": round(statistics.fmean(messages), 1),
        "words of a message, most": max(messages),
        "places that parse a sentence": sum(len(PARTS.findall(text)) for text in texts.values()),
        "patterns that translate sentences": sum(
            len(re.findall(r"\(\?P<|\(\.[*+]\)", path.read_text("utf-8")))
            for path in [*(SOURCE / "catalogue").glob("*.po"), *SOURCE.rglob("translations.json")]
        ),
        "widest terminal table on a page": terminal_width(),
        "banned turns of phrase": sum(n for turn, n in turns.counts().items() if turn in turns.banned()),
        "import circles, function-level imports included": len(circles({p: tree for p, (_, tree) in modules.items()})),
        "eight formulas found in two guesses": found,
    }


def errors_of_text(tree: ast.Module) -> int:
    """Errors of the package that are made of a text, not of a finding."""
    calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args)
    named = [node for node in calls if ERRORS.fullmatch(ast.unparse(node.func).split(".")[-1])]
    made = (node.args[0] for node in named)
    return sum(isinstance(one, ast.JoinedStr) or isinstance(getattr(one, "value", None), str) for one in made)


def message_words() -> list[int]:
    """Words of the sentence and the remedy of every code: of a list of texts all, of another value one."""
    entries: dict[str, dict[str, object]] = {}
    for path in (SOURCE / "catalogue").glob("*.toml"):
        entries |= {code: entry for code, entry in tomllib.loads(path.read_text("utf-8")).items() if code != "words"}
    found = []
    for entry in (entry for entry in entries.values() if "means" in entry):
        says, example = entry["says"], {"": "value"} | dict(entry.get("example", {}))
        text = f"{says[-1] if isinstance(says, list) else says} {entry.get('do', '')}"
        for name in re.findall(r"\{(\w+)", text):
            given = example[name]
            listed = isinstance(given, list) and all(isinstance(one, str) for one in given)
            text = re.sub(rf"\{{{name}[^}}]*\}}", " ".join(given) if listed else "value", text)
        found.append(len(text.split()))
    return found


PARTS = re.compile(
    r"str\((?:\w+\.)*(?:error|message|orig|finding|reason|found|said)\)\.(?:startswith|endswith|\w*partition|split\((?!\))|removesuffix)"
    r"|\bin str\((?:\w+\.)*(?:error|message|orig|finding|reason)\)"
    r"|re\.\w+\(.*\w\.(?:message|sentence)\)"
)
"""What takes a sentence apart: of an error, of a finding, of a library."""


def terminal_width() -> int:
    """The widest line of a terminal table that a page shows."""
    pages = [page.read_text(encoding="utf-8") for page in [*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")]]
    return max(len(line) for page in pages for line in page.splitlines() if re.search("[┃━│]", line))


def body_lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function's body after its docstring."""
    body = node.body[1:] if ast.get_docstring(node) else node.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def long_docstrings(path: Path, tree: ast.Module) -> list[tuple[str, int]]:
    """Qualified name and line of long docstrings, those of public names and commands (their help texts) left out."""
    module = ".".join(path.relative_to(SOURCE).with_suffix("").parts).removeprefix("cli.")
    found = []

    def visit(node: ast.AST, within: str) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                name = f"{within}{child.name}"
                if len((ast.get_docstring(child) or "").splitlines()) > LONG_DOCSTRING:
                    found.append((name, child.lineno))
                visit(child, f"{name}.")

    visit(tree, "")
    public = public_names()
    return [(name, at) for name, at in found if name.split(".")[0] not in public and (module, name) not in commands()]


def circles(modules: dict[Path, ast.Module]) -> list[list[str]]:
    """Groups of modules that import each other, imports inside functions included, those for types only left out."""
    names = {".".join(("inclinometry", *p.relative_to(SOURCE).with_suffix("").parts)): p for p in modules}
    names = {name.removesuffix(".__init__"): path for name, path in names.items()}
    edges: dict[str, set[str]] = {}
    for name, path in names.items():
        for_types = {
            id(inner)
            for node in ast.walk(modules[path])
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
            for inner in ast.walk(node)
        }
        wanted = edges[name] = set()
        for node in ast.walk(modules[path]):
            if id(node) in for_types:
                continue
            if isinstance(node, ast.ImportFrom) and node.module:
                wanted |= {full if (full := f"{node.module}.{a.name}") in names else node.module for a in node.names}
            elif isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
        wanted &= names.keys() - {name, "inclinometry"}
    return [sorted(group) for group in _strongly_connected(edges) if len(group) > 1]


def _strongly_connected(edges: dict[str, set[str]]) -> list[list[str]]:
    """Tarjan's components of a graph."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in edges[node]:
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            place = stack.index(node)
            found.append(stack[place:])
            del stack[place:]

    for node in edges:
        if node not in index:
            visit(node)
    return found


def _found(texts: dict[Path, str], stem: str, formula: str) -> bool:
    """Whether one of the first two files of that name, in the order of the alphabet, holds the formula."""
    named = [path for path in texts if re.search(stem, path.stem) and not path.stem.startswith("_")]
    exact = [path for path in named if re.fullmatch(stem, path.stem)] or named
    return any(re.search(formula, texts[path]) for path in exact[:2])


_RUN = """
import json, sys, time
from inclinometry.cli import main
sys.argv = ["inclinometry", *sys.argv[1:]]
try:
    main()
except SystemExit:
    pass
mine = sum(name.split(".")[0] == "inclinometry" for name in sys.modules)
print("\\n" + json.dumps({"modules": mine, "seconds": time.process_time()}))
"""


def running_figures() -> dict[str, float]:
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
        run("calibrate", "readings.csv", "-o", "tool.json")
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
        "modules a calibrate run imports": calibrate["modules"],
        "calibrate of 24 stations, processor time, s": round(calibrate["seconds"], 2),
        "--help, in starts of a bare interpreter": round(help_ / bare, 1),
    }


def _wall(command: list[str], environment: dict[str, str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, env=environment, capture_output=True, check=True)
    return time.perf_counter() - start


_TABLE = re.compile(r"(<!-- metrics -->\n)(.*?)(<!-- /metrics -->)", re.S)


def read_table() -> tuple[list[str], dict[str, list[str]]]:
    """Head of the table of CONTRIBUTING.md, and its rows: name -> was, is, to reach, why it rose."""
    block = _TABLE.search(PAGE.read_text(encoding="utf-8"))
    if block is None:
        raise SystemExit(f"{PAGE.name} has no table between <!-- metrics --> and <!-- /metrics -->")
    head, rule, *rows = block[2].splitlines()
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    return [head, rule], {name: rest for name, *rest in cells}


def main() -> int:
    """Print the figures; the exit status says whether one rose."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the figures into the table of CONTRIBUTING.md")
    parser.add_argument("--why", default="", help="why figures rose, written into their rows")
    parser.add_argument("--static", action="store_true", help="only what can be counted without running anything")
    parser.add_argument("--docstrings", action="store_true", help="list the internal docstrings over six lines")
    given = parser.parse_args()
    if given.docstrings:
        for path in sorted(SOURCE.rglob("*.py")):
            for name, line in long_docstrings(path, ast.parse(path.read_text(encoding="utf-8"))):
                print(f"{path.relative_to(ROOT)}:{line} {name}")
        return 0
    head, rows = read_table()
    figures = static_figures() | ({} if given.static else running_figures())
    risen = []
    for name, value in figures.items():
        was, before, goal, why = rows.setdefault(name, ["", f"{value:g}", "", ""])
        worse = value < float(before) if name in FALLS else value > float(before)
        if worse and name not in TIMES:
            risen.append(f"{name}: {before} in the table, now {value:g}")
        print(f"{name:50} {value:8g}   table {before:>7}   to reach {goal}")
        rows[name] = [was, f"{value:g}", goal, given.why if worse and name not in TIMES else why]
    if given.write and (given.why or not risen):
        table = "\n".join([*head, *(f"| {name} | {' | '.join(row)} |" for name, row in rows.items())])
        text = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(_TABLE.sub(lambda m: f"{m[1]}{table}\n{m[3]}", text), encoding="utf-8")
        return 0
    if risen:
        print("\nrisen: " + "\n       ".join(risen))
        print('take something away, or run tools/metrics.py --write --why "the reason"')
    return int(bool(risen))


if __name__ == "__main__":
    sys.exit(main())

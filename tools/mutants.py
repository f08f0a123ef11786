"""Do the tests bite? Change one thing in the code, run the tests of its room, count the changes nobody noticed.

    python tools/mutants.py [ROOM ...] [--count 400] [--seed 1] [--list]

A change is one of: a comparison (< for <=, == for !=, in for not in), an operator of arithmetic, "and" for "or", a
"not" left out, a number or a truth value, a return that gives None. The sample is drawn from all changes of the rooms
named, the same for the same seed. A copy of the package is changed, never the package. A survivor is printed with its
reason, where tools/mutants.json has one (the change is no fault: it makes no difference, or only a slower one), else as
such; exit status 1 when more than one tenth survived without a reason.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

HOME = Path(__file__).parents[1]
PACKAGE = HOME / "src" / "inclinometry"
REASONS = json.loads((HOME / "tools" / "mutants.json").read_text("utf-8"))
LEAST_KILLED = 0.9
PATIENCE_S = 300.0

ROOMS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "calibration": (("calibration",), ("tests/calibration",)),
    "gyro": (("gyro",), ("tests/gyro",)),
    "closed_form": (("gyro/closed_form.py",), ("tests/gyro/test_closed_form.py", "tests/gyro")),
    "survey": (("survey",), ("tests/survey",)),
    "position": (("position",), ("tests/position",)),
    "files": (("files",), ("tests/files",)),
    "ledger": (("laboratory/ledger",), ("tests/laboratory/ledger", "tests/cli/test_ledger.py")),
    "guard": (
        ("laboratory/web/guard.py",),
        ("tests/laboratory/web/test_guard_rules.py", "tests/laboratory/web/test_guard_sockets.py"),
    ),
    "logins": (
        ("laboratory/web/logins.py", "laboratory/ledger/users.py", "laboratory/ledger/second_factor.py"),
        ("tests/laboratory/web/test_logins.py", "tests/laboratory/ledger/test_second_factor.py"),
    ),
}
"""Room -> its files and folders below src/inclinometry, and the tests that are run, quick ones first."""
ALL = ("calibration", "gyro", "survey", "position", "files", "ledger", "guard", "logins")

COMPARE = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.MatMult: ast.Add,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip


class Mutant(NamedTuple):
    """One change: file below the package, place in its bytes, what stands there, what is put there."""

    path: str
    line: int
    start: int
    end: int
    before: str
    after: str
    room: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.before} -> {self.after}"


def changes(node: ast.AST) -> Iterator[ast.AST]:
    """Every node that may stand in place of this one."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARE:
        yield ast.Compare(node.left, [COMPARE[type(node.ops[0])](), *node.ops[1:]], node.comparators)
    elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
        texts = any(isinstance(side, ast.JoinedStr) or _is_text(side) for side in (node.left, node.right))
        if not texts:
            yield ast.BinOp(node.left, ARITHMETIC[type(node.op)](), node.right)
    elif isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield ast.Constant(node.value + 1 if isinstance(node.value, int) else (node.value * 1.5 or 0.5))
    elif isinstance(node, ast.Return) and node.value is not None and not _is_none(node.value):
        yield ast.Return(ast.Constant(None))


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes that are run: no annotations, no texts, nothing only a type checker reads."""
    yield node
    for name, field in ast.iter_fields(node):
        if name in ("annotation", "returns"):
            continue
        for child in field if isinstance(field, list) else [field]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.JoinedStr | ast.Raise):
                continue
            if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
                continue
            if isinstance(child, ast.Expr) and _is_text(child.value):
                continue
            yield from _code(child)


def mutants(room: str) -> list[Mutant]:
    """All changes of a room."""
    found = []
    for part in ROOMS[room][0]:
        place = PACKAGE / part
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            if "migrations" in path.parts:
                continue
            data = path.read_bytes()
            starts = [0]
            for line in data.splitlines(keepends=True):
                starts.append(starts[-1] + len(line))
            for node in _code(ast.parse(data)):
                for other in changes(node):
                    start = starts[node.lineno - 1] + node.col_offset
                    end = starts[node.end_lineno - 1] + node.end_col_offset
                    after = ast.unparse(ast.fix_missing_locations(other))
                    after = after if isinstance(node, ast.Return | ast.Constant) else f"({after})"
                    before = " ".join(data[start:end].decode().split())
                    name = path.relative_to(PACKAGE).as_posix()
                    found.append(Mutant(name, node.lineno, start, end, before, after, room))
    return found


def killed(mutant: Mutant, copy: Path) -> str:
    """ "" when the tests of the room still pass with the change in a copy of the package, else how they ended."""
    path = copy / "inclinometry" / mutant.path
    data = path.read_bytes()
    path.write_bytes(data[: mutant.start] + mutant.after.encode() + data[mutant.end :])
    around = {
        **os.environ,
        "PYTHONPATH": str(copy),
        "OPENBLAS_NUM_THREADS": "1",
        "NUMBA_CACHE_DIR": str(copy / "numba"),
    }
    try:
        compile(path.read_bytes(), str(path), "exec")
        for tests in ROOMS[mutant.room][1]:
            command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-m", "not long", tests]
            try:
                done = subprocess.run(
                    command, cwd=HOME, env=around, capture_output=True, timeout=PATIENCE_S, check=False
                )
            except subprocess.TimeoutExpired:
                return "never ends"
            if done.returncode not in (0, 5):
                return "noticed"
        return ""
    except SyntaxError:
        return "no program"
    finally:
        path.write_bytes(data)


def main() -> int:
    """Sample, run, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help=", ".join(ROOMS))
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="only print the sample")
    given = parser.parse_args()
    everything = [mutant for room in given.rooms or ALL for mutant in mutants(room)]
    sample = random.Random(given.seed).sample(everything, min(given.count, len(everything)))
    print(f"{len(sample)} of {len(everything)} changes", flush=True)
    if given.list:
        print(*sample, sep="\n")
        return 0
    survivors, began = [], time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        left_out = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc", "manual")
        shutil.copytree(PACKAGE, copy / "inclinometry", ignore=left_out)
        for number, mutant in enumerate(sample, 1):
            how = killed(mutant, copy)
            if not how:
                survivors.append(mutant)
                reason = REASONS.get(f"{mutant.path}: {mutant.before} -> {mutant.after}", "")
                print(f"survived: {mutant}" + (f"  ({reason})" if reason else ""), flush=True)
            elif number % 20 == 0:
                print(f"{number} of {len(sample)}, {time.monotonic() - began:.0f} s", flush=True)
    excused = [m for m in survivors if f"{m.path}: {m.before} -> {m.after}" in REASONS]
    dead = len(sample) - len(survivors)
    print(f"killed {dead} of {len(sample)}; {len(excused)} survivors make no difference")
    counted = len(sample) - len(excused)
    return 0 if dead >= LEAST_KILLED * counted else 1


if __name__ == "__main__":
    raise SystemExit(main())

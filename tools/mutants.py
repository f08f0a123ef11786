"""Do the tests bite? Change one thing in the code, run the tests of its room, count the changes nobody noticed.

    python tools/mutants.py [ROOM ...] [--count 400] [--seed 1] [--list]

First the tests of each room are run once without a change, and it is noted which of them run which line. A change is
held against the tests that run its line, quick ones first; what they let pass, at the end against all of the room, the
long ones too.

A change is one of: a comparison (< for <=, == for !=, in for not in), an operator of arithmetic, "and" for "or", a
"not" left out, a number or a truth value, a return that gives None. The sample is drawn from all changes of the rooms
named, the same for the same seed. A copy of the package is changed, never the package. A survivor is printed with its
reason, where tools/mutants.json has one (the change is no fault: it makes no difference, or only a slower one), else as
such; exit status 1 when more than one tenth survived without a reason.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import NamedTuple

import coverage
import numpy
import pytest
import scipy.linalg
import scipy.optimize
import scipy.stats

HOME = Path(__file__).parents[1]
PACKAGE = HOME / "src" / "inclinometry"
REASONS = json.loads((HOME / "tools" / "mutants.json").read_text("utf-8"))
LEAST_KILLED = 0.9
PATIENCE, PATIENCE_S = 5.0, 30.0  # so many times as long as without a change, and these seconds more
LONGEST_S = 3600.0  # all tests of a room, the long ones too
BYTES = 12 << 30
LOADED = (numpy, scipy.linalg, scipy.optimize, scipy.stats)
"""Imported once, here, for all the processes that run tests."""

ROOMS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "calibration": (("calibration",), ("tests/calibration", "tests/test_results.py")),
    "gyro": (("gyro",), ("tests/gyro", "tests/test_results.py")),
    "closed_form": (("gyro/closed_form.py",), ("tests/gyro/test_closed_form.py", "tests/gyro")),
    "survey": (("survey",), ("tests/survey", "tests/test_results.py")),
    "position": (("position",), ("tests/position", "tests/test_results.py")),
    "files": (("files",), ("tests/files", "tests/position/test_tool_code_json.py")),
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
    """One change: file below the package, line, its text, place in the bytes, what stands there, what is put there."""

    path: str
    line: int
    text: str
    start: int
    end: int
    before: str
    after: str
    room: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.before} -> {self.after}"

    @property
    def key(self) -> str:
        """What a reason is stored under: it holds while the line stands as it is."""
        return f"{self.path}: {self.text}: {self.before} -> {self.after}"


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
            if isinstance(child, ast.keyword) and child.arg == "strict":
                continue  # zip's check of what is equally long
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
            texts, starts = data.decode().splitlines(), [0]
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
                    text = texts[node.lineno - 1].strip()
                    found.append(Mutant(name, node.lineno, text, start, end, before, after, room))
    return found


class Seen(NamedTuple):
    """The tests of a room without a change: seconds of each; file -> line -> tests that run it; what failed."""

    seconds: dict[str, float]
    lines: dict[str, dict[str, list[str]]]
    failed: list[str]

    def running(self, path: str, line: int) -> set[str]:
        """Tests that run a line, which may be a later one of a statement; those of its file when an import runs it."""
        lines = self.lines.get(path, {})
        first = max((int(known) for known in lines if int(known) <= line), default=0)
        names = set(lines.get(str(first), ()))
        if "" in names:
            names.update(*lines.values())
        return names - {""}


class Watch:
    """Plugin of pytest: only the `chosen` tests, quick ones first; notes seconds and failures, with `cover` lines."""

    def __init__(
        self,
        seconds: dict[str, float] | None = None,
        chosen: set[str] | None = None,
        cover: coverage.Coverage | None = None,
    ) -> None:
        self._seconds, self._chosen, self._cover = seconds or {}, chosen, cover
        self.took: dict[str, float] = {}
        self.failed: list[str] = []

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Choose and sort."""
        if self._chosen is not None:
            items[:] = [one for one in items if one.nodeid in self._chosen]
        if self._seconds:
            items.sort(key=lambda one: self._seconds.get(one.nodeid, 0.0))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Time and lines of one test, with what is made for it."""
        if self._cover is not None:
            self._cover.switch_context(item.nodeid)
        began = time.monotonic()
        try:
            return (yield)
        finally:
            self.took[item.nodeid] = time.monotonic() - began
            if self._cover is not None:
                self._cover.switch_context("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a failure."""
        if report.failed:
            self.failed.append(report.nodeid)


def run(
    copy: Path, cache: Path, tests: list[str], watch: Watch, patience_s: float, *, long: bool = False
) -> int | None:
    """Run tests with the package in `copy` in a process of their own: exit status of pytest, None: did not end."""
    child = os.fork()
    if not child:
        status = 70
        try:
            os.setsid()
            os.chdir(HOME)
            os.environ |= {"PYTHONPATH": str(copy), "OPENBLAS_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(cache)}
            sys.path[:0] = [str(copy), str(HOME)]
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
            nothing = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(nothing, stream)
            status = watched(copy, tests if long else ["-m", "not long", *tests], watch)
        finally:
            os._exit(status)
    until = time.monotonic() + patience_s
    while time.monotonic() < until:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def watched(copy: Path, tests: list[str], watch: Watch) -> int:
    """Run tests in this process; with coverage all of them and a record in `copy`, else to the first failure."""
    given = ["-q", "--no-header", "--tb=no", "-p", "no:xdist", *tests]
    cover = watch._cover
    if cover is None:
        return int(pytest.main(["-x", *given], plugins=[watch]))
    cover.start()
    status = pytest.main(given, plugins=[watch])
    cover.stop()
    lines: dict[str, dict[int, list[str]]] = {}
    stored = cover.get_data()
    for file in stored.measured_files():
        name = Path(file).relative_to(copy / "inclinometry").as_posix()
        lines[name] = {line: sorted(set(names)) for line, names in stored.contexts_by_lineno(file).items()}
    (copy / "seen.json").write_text(json.dumps([watch.took, lines, watch.failed]), "utf-8")
    return int(status)


def see(room: str, copy: Path) -> Seen:
    """Run the tests of a room without a change."""
    cover = coverage.Coverage(data_file=None, config_file=False, source=[str(copy / "inclinometry")])
    record = copy / "seen.json"
    record.unlink(missing_ok=True)
    status = run(copy, copy / "numba", list(ROOMS[room][1]), Watch(cover=cover), 3600.0)
    seen = Seen(*json.loads(record.read_text("utf-8"))) if record.exists() else Seen({}, {}, [])
    if status != 0:
        raise SystemExit(f"the tests of {room} fail without a change: {', '.join(seen.failed) or f'status {status}'}")
    return seen


def killed(mutant: Mutant, copy: Path, seen: Seen, *, everything: bool) -> bool:
    """Whether a test notices the change: one of those that run its line, or, with `everything`, one of the room."""
    path = copy / "inclinometry" / mutant.path
    data, times = path.read_bytes(), path.stat()
    compiled = b"inclinometry.compiled import" in data
    chosen = set(seen.seconds) if compiled else seen.running(mutant.path, mutant.line)
    if not chosen and not everything:
        return False
    path.write_bytes(data[: mutant.start] + mutant.after.encode() + data[mutant.end :])
    cache = Path(tempfile.mkdtemp(dir=copy)) if compiled else copy / "numba"  # callers take loops from their own cache
    try:
        compile(path.read_bytes(), str(path), "exec")
        if everything:
            watch = Watch(seen.seconds)
            return run(copy, cache, list(ROOMS[mutant.room][1]), watch, LONGEST_S, long=True) not in (0, 5)
        files = sorted({name.partition("::")[0] for name in chosen})
        patience_s = PATIENCE * sum(seen.seconds[name] for name in chosen) + PATIENCE_S * (1 + 3 * compiled)
        return run(copy, cache, files, Watch(seen.seconds, chosen), patience_s) not in (0, 5)
    except SyntaxError:
        return True
    finally:
        path.write_bytes(data)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        if compiled:
            shutil.rmtree(cache)


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
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        left_out = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc", "manual")
        shutil.copytree(PACKAGE, copy / "inclinometry", ignore=left_out)
        seen = {}
        for room in dict.fromkeys(mutant.room for mutant in sample):
            seen[room] = see(room, copy)
            print(f"{room}: {len(seen[room].seconds)} tests, {time.monotonic() - began:.0f} s", flush=True)
        passed = []
        for number, mutant in enumerate(sample, 1):
            if not killed(mutant, copy, seen[mutant.room], everything=False):
                passed.append(mutant)
                print(f"not by the tests that run it: {mutant}", flush=True)
            if number % 20 == 0:
                print(f"{number} of {len(sample)}, {time.monotonic() - began:.0f} s", flush=True)
        survivors = []
        for mutant in passed:
            if not killed(mutant, copy, seen[mutant.room], everything=True):
                survivors.append(mutant)
                reason = REASONS.get(mutant.key, "")
                print(f"survived: {mutant}" + (f"  ({reason})" if reason else ""), flush=True)
    excused = [m for m in survivors if m.key in REASONS]
    for room in seen:
        of_room = [mutant for mutant in sample if mutant.room == room]
        alive = [mutant for mutant in survivors if mutant.room == room]
        known = sum(mutant in excused for mutant in alive)
        print(f"{room}: killed {len(of_room) - len(alive)} of {len(of_room)}, {known} make no difference")
    dead = len(sample) - len(survivors)
    print(f"killed {dead} of {len(sample)}; {len(excused)} survivors make no difference")
    counted = len(sample) - len(excused)
    return 0 if dead >= LEAST_KILLED * counted else 1


if __name__ == "__main__":
    raise SystemExit(main())

"""A plan carried out: tasks done, results committed in batches, whatever goes wrong named and left for the next run."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable
from typing import NamedTuple

from inclinometry.files.writing import program
from inclinometry.findings import Finding
from inclinometry.fleet.commit import Added
from inclinometry.fleet.plan import Plan, table
from inclinometry.fleet.store import Store, plain_name
from inclinometry.fleet.task import Receipt


class Done(NamedTuple):
    """What a run did.

    made, adopted, removed : files. samples : read. problems : each file that could not be done, and why.
    seconds : of the workers together. version : of the table.
    """

    made: int
    adopted: int
    removed: int
    samples: int
    seconds: float
    problems: tuple[tuple[str, Finding], ...]
    version: int | None


def carry_out(
    store: Store,
    todo: Plan,
    receipts: Iterable[Receipt],
    *,
    progress: Callable[[float], None] | None = None,
    every: float = 20.0,
) -> Done:
    """Take the receipts of a plan's tasks and commit what they name, every `every` seconds.

    New results of a run replace the old ones in the same transaction; results of no run go at the end. An exception,
    Ctrl-C included, commits what was done and goes on.
    """
    of = {task.target: task for task in todo.todo}
    left = Counter(_folder(name) for name in of)
    current = table(store, todo.product)
    behind = dict(todo.behind)
    # a run changes as a whole: its results wait for each other
    waiting: dict[str, dict[str, Added]] = {}
    added: dict[str, Added] = {}
    removed: list[str] = []
    problems: list[tuple[str, Finding]] = []
    made = adopted = samples = gone = 0
    seconds, last = 0.0, time.monotonic()

    def commit() -> None:
        nonlocal added, removed, gone, last
        if added or removed:
            current.commit(added, removed, {"window_ns": str(todo.window_ns), "program": program()})
            gone += len(removed)
        added, removed, last = {}, [], time.monotonic()

    try:
        for number, receipt in enumerate(receipts, 1):
            task, folder = of[receipt.target], _folder(receipt.target)
            seconds, samples = seconds + receipt.seconds, samples + receipt.samples
            if receipt.problem is not None:
                problems.append((task.raw, receipt.problem))
            else:
                made, adopted = made + (not receipt.adopted), adopted + receipt.adopted
                mine = waiting.setdefault(folder, {})
                tool, run, date = (plain_name(part.partition("=")[2]) for part in task.raw.split("/")[1:4])
                mine[receipt.target] = (receipt.size, receipt.rows, (tool, run, date), receipt.digest)
            left[folder] -= 1
            if not left[folder]:
                added |= waiting.pop(folder, {})
                # what is behind is not current any more, even where nothing can take its place
                removed += behind.pop(folder, ())
            if progress is not None:
                progress(number / len(of))
            if time.monotonic() - last > every:
                commit()
        removed += [name for names in behind.values() for name in names]
    finally:
        commit()
    return Done(made, adopted, gone, samples, seconds, tuple(problems), current.version)


def _folder(name: str) -> str:
    return name.rpartition("/")[0]

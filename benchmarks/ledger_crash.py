"""Captures killed in the middle, and many writers at once: what was acknowledged is there, whole and once.

    python -m benchmarks.ledger_crash kills WHERE NUMBER [SEED]
    python -m benchmarks.ledger_crash writers WHERE NUMBER [CAPTURES]

Prints one JSON object. The parent is forked, so it has one thread and has opened no ledger when it does so.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from inclinometry.calibration.plans import Plan
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import ConflictError, Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool
from inclinometry.laboratory.session import Capture, capture, load_session, open_session, sessions

LONGEST = 0.08
"""Longest time a child captures after its first reading, s: some die in the next capture, most after a few."""
POSITIONS = 12
Acknowledge = Callable[[Any], int]


def prepared(where: str) -> None:
    """A ledger with a tool and a rig."""
    with create(where) as ledger:
        put_tool(ledger, RegisteredTool("IN-7", "steering tool"), author="anna")
        put_rig(ledger, RegisteredRig("stand 1", (1e-3, 1e-3, 1e-3)), author="anna")


def plan(count: int = POSITIONS) -> Plan:
    """Any plan of so many positions."""
    turn = np.linspace(0.0, 6.0, count)
    return Plan("any", turn, np.full(count, 1.0), turn)


def taken(value: float) -> Capture:
    """A reading that can be told from all others."""
    return Capture({"accelerometer": np.array([value, 2.5, -1.0])}, (0.1, 1.0, 0.3), 20)


def child(work: Callable[[Acknowledge], None]) -> tuple[int, int]:
    """Process id, and where its acknowledgements are read."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid:
        os.close(writing)
        return pid, reading
    code = 1
    try:
        os.close(reading)
        work(lambda content: os.write(writing, json.dumps(content).encode() + b"\n"))
        code = 0
    finally:
        os._exit(code)


def said(pipe: int) -> list[Any]:
    """All a child acknowledged until it ended; a line cut off was not."""
    with os.fdopen(pipe, "rb") as stream:
        return [json.loads(line) for line in stream.read().splitlines(keepends=True) if line.endswith(b"\n")]


def keep_capturing(where: str, seed: int) -> Callable[[Acknowledge], None]:
    """Resume the newest session, or open one, and capture position by position for ever."""

    def work(acknowledge: Acknowledge) -> None:
        with Ledger(where) as ledger:
            value, ready = float(seed), False
            while True:
                found = sessions(ledger, limit=1)
                session = load_session(ledger, found[0].id) if found else None
                if session is None or session.next is None:
                    session = open_session(ledger, "IN-7", plan(), rig="stand 1", author="anna")
                for position in session.positions:
                    if not session.has(position.number):
                        value += 1e-4
                        done = capture(ledger, session.id, position.number, taken(value), author="anna")
                        if not ready:  # what a process does once, modules and schemas, takes longer than captures do
                            acknowledge("ready")
                            ready = True
                        acknowledge([done.record, value])

    return work


def kills(where: str, number: int, seed: int = 1) -> dict[str, Any]:
    """Kill that many times at random moments; then look for every acknowledged reading and along the chain."""
    prepared(where)
    random_ = random.Random(seed)
    acknowledged: dict[str, float] = {}
    barren = 0
    for turn in range(number):
        pid, pipe = child(keep_capturing(where, turn + 1))
        while os.read(pipe, 1) not in (b"\n", b""):  # "ready": killed in the middle of captures, not before them
            pass
        time.sleep(random_.uniform(0.0, LONGEST))
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        found = said(pipe)
        barren += not found
        acknowledged.update(found)
    with Ledger(where) as ledger:
        lost = [name for name, value in acknowledged.items() if value_of(ledger, name) != value]
        verdict = verify(ledger)
        recorded = ledger.count("reading")
    return {
        "kills": number,
        "without_an_acknowledgement": barren,
        "acknowledged": len(acknowledged),
        "recorded": recorded,
        "lost": len(lost),
        "sound": verdict.ok,
    }


def value_of(ledger: Ledger, name: str) -> float | None:
    """What a reading said; None when there is none."""
    try:
        return float(ledger.get("reading", name).body["channels"]["accelerometer"][0])
    except LedgerError:
        return None


def writers(where: str, number: int, captures: int = 40) -> dict[str, Any]:
    """So many processes want to take the same first reading of every position, and note an event each time."""
    prepared(where)
    with Ledger(where) as ledger:
        session = open_session(ledger, "IN-7", plan(captures), rig="stand 1", author="anna").id
        before = ledger.head().seq

    def compete(name: int) -> Callable[[Acknowledge], None]:
        def work(acknowledge: Acknowledge) -> None:
            with Ledger(where) as ledger:
                for position in range(1, captures + 1):
                    try:
                        capture(ledger, session, position, taken(float(name)), author=f"w{name}", attempt=1)
                        acknowledge(["taken", position])
                    except ConflictError:
                        acknowledge(["conflict", position])
                    keys = {"subject_kind": "session", "subject": session, "action": f"w{name}"}
                    ledger.append("event", keys, {"reason": str(position)}, author=f"w{name}")

        return work

    start = time.perf_counter()
    children = [child(compete(name)) for name in range(number)]
    answers = [said(pipe) for _, pipe in children]
    failed = sum(os.waitpid(pid, 0)[1] != 0 for pid, _ in children)
    seconds = time.perf_counter() - start
    with Ledger(where) as ledger:
        verdict, recorded = verify(ledger), ledger.head().seq - before
        readings, events = ledger.count("reading", session=session), ledger.count("event", subject=session)
    won = [position for answer in answers for what, position in answer if what == "taken"]
    return {
        "writers": number,
        "failed": failed,
        "wanted": number * captures,
        "positions": captures,
        "taken": len(won),
        "taken_twice": len(won) - len(set(won)),
        "conflicts_told": sum(what == "conflict" for answer in answers for what, _ in answer),
        "readings": readings,
        "events": events,
        "sound": verdict.ok,
        "records_per_s": recorded / seconds,
    }


if __name__ == "__main__":
    what, where, *numbers = sys.argv[1:]
    print(json.dumps((kills if what == "kills" else writers)(where, *map(int, numbers))))

"""The ledger: nothing acknowledged is lost, however it is killed; a million readings and ten thousand calibrations.

    python -m benchmarks.ledger [--json] [--kills 200] [--readings 1000000] [--calibrations 10000]

On SQLite, and on PostgreSQL where its server is installed. Every page query is timed as the bench asks it, the middle
of five after one that warms up.
"""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks import command
from benchmarks.postgresql import Server, programs, server
from inclinometry.digest import digest_bytes
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.exchange import backup, export, restore
from inclinometry.laboratory.ledger.ledger import Draft, Ledger
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.session import closing_status, load_session, sessions

ROOT = Path(__file__).parents[1]
LONG, USUAL = 5000, 24
"""Positions of the one long session and of the others."""
TOOLS = 500
BATCH = 5000
WANTED = {"lost": 0, "slowest_page_s": 0.3}
READING = {
    "dial_deg": [0.0, 90.0, 12.5],
    "channels": {"accelerometer": [1.0012, 2.5123, 3.1223], "magnetometer": [1.1, 2.2, 3.3]},
    "sd": {"accelerometer": [1e-3, 1e-3, 1e-3]},
    "units": {"accelerometer": "g", "magnetometer": "nT"},
    "count": 20,
    "duration_s": 2.0,
    "temperature_degC": 21.5,
    "still": True,
    "captured": "key",
}
TOOL_JSON = {f"p{n}": [0.123456789 + n * k for k in range(30)] for n in range(12)}


def crash(what: str, where: str, number: int) -> dict[str, Any]:
    """What `benchmarks.ledger_crash` prints."""
    command = [sys.executable, "-m", "benchmarks.ledger_crash", what, where, str(number)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _session(ledger: Ledger, serial: str, positions: int) -> str:
    plan = {"name": "any", "positions_deg": [[0.0, 90.0, float(n % 360)] for n in range(positions)]}
    keys = {"serial": serial, "purpose": "calibrate"}
    return ledger.append("session", keys, {"plan": plan, "rig": "stand 1"}, author="anna").id


def fill(ledger: Ledger, readings: int, calibrations: int) -> str:
    """A laboratory of many years; the id of its longest session."""
    ledger.append("rig", {"name": "stand 1"}, {"sd_deg": [0.01, 0.01, 0.01]}, author="anna")
    named = [Draft("tool", {"serial": f"IN-{n}"}, {"name": "tool", "triads": {}}) for n in range(TOOLS)]
    ledger.append_all(named, author="anna")
    long = _session(ledger, "IN-0", min(LONG, readings))
    drafts: list[Draft] = []
    left, session, position, every = readings, long, 0, max(readings // calibrations, 1)
    length = min(LONG, readings)
    for done in range(readings):
        if position == length:
            serial = f"IN-{done % TOOLS}"
            session, position, length = f"{done:032x}", 0, USUAL
            plan = {"name": "any", "positions_deg": [[0.0, 90.0, 0.0]] * USUAL}
            drafts.append(
                Draft("session", {"serial": serial, "purpose": "calibrate"}, {"plan": plan, "rig": "stand 1"})
            )
        position += 1
        drafts.append(Draft("reading", {"session": session, "position": position, "attempt": 1}, READING))
        if done % 50 == 0:
            keys = {"subject_kind": "reading", "subject": f"{done:032x}", "action": "rejected"}
            drafts.append(Draft("event", keys, {"reason": "bumped"}))
        if done % every == 0:
            keys = {"serial": f"IN-{done // every % TOOLS}", "session": session}
            drafts.append(Draft("calibration", keys, {"tool_json": TOOL_JSON, "method": "joint", "readings": []}))
        left -= 1
        if len(drafts) >= BATCH or not left:
            ledger.append_all(drafts, author="anna")
            drafts = []
    return long


def pages(ledger: Ledger, long: str) -> dict[str, Callable[[], object]]:
    """What the pages of the bench ask."""
    one = ledger.find("reading", session=long, limit=1)[0]
    named = {"session": "x", "attempt": 1}
    rejected = {"subject_kind": "reading", "subject": one.id, "action": "rejected"}
    return {
        "tools": lambda: ledger.current("tool", limit=100),
        "tool": lambda: ledger.latest("tool", serial="IN-7"),
        "sessions": lambda: sessions(ledger),
        "sessions of a tool": lambda: sessions(ledger, serial="IN-7"),
        "calibrations of a tool": lambda: ledger.find("calibration", serial="IN-7", newest=True, limit=50),
        "newest readings": lambda: ledger.find("reading", newest=True, limit=100),
        "readings from the middle": lambda: ledger.find("reading", after=ledger.head().seq // 2, limit=100),
        "readings counted": lambda: ledger.count("reading"),
        "readings of a session counted": lambda: ledger.count("reading", session=long),
        "a retaken position": lambda: ledger.latest("reading", session=long, position=7),
        "a record": lambda: ledger.get("reading", one.id),
        "rejected?": lambda: ledger.latest("event", **rejected),
        "closed?": lambda: closing_status(ledger, long),
        "events of all kinds": lambda: ledger.find("event", newest=True, limit=100),
        "events of readings": lambda: ledger.find("event", subject_kind="reading", newest=True, limit=100),
        "capture": lambda: ledger.append("reading", {**named, "position": next(_TURN)}, READING, author="anna"),
        "head": ledger.head,
    }  # fmt: skip


_TURN = iter(range(1, 1_000_000))


def middle(call: Callable[[], object], rounds: int = 5) -> float:
    """Time of a call, s."""
    call()
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


@contextmanager
def timed(found: dict[str, float], name: str) -> Iterator[None]:
    """Note the seconds of a block."""
    start = time.perf_counter()
    yield
    found[name] = time.perf_counter() - start


def large(where: str, copy: str, folder: Path, readings: int, calibrations: int) -> dict[str, Any]:
    """Fill, ask, verify, export, import, back up; rates in records a second."""
    seconds: dict[str, float] = {}
    with create(where) as ledger:
        with timed(seconds, "append"):
            long = fill(ledger, readings, calibrations)
        asked = {name: middle(call) for name, call in pages(ledger, long).items()}
        rates = {"long session loaded": middle(lambda: load_session(ledger, long), 1)}
        records = ledger.head().seq
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        with timed(seconds, "verify"):
            sound = verify(ledger).ok
        with timed(seconds, "export"):
            head = export(ledger, folder / "all.zip")
        with create(copy) as second:
            with timed(seconds, "import"):
                same = restore(second, folder / "all.zip") == head
            # indexes and statistics of a ledger that was just imported, too
            asked |= {f"{name}, imported": middle(call) for name, call in pages(second, long).items()}
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
        if "://" not in where:
            with timed(seconds, "backup"):
                backup(ledger, folder / "copy.sqlite")
    return {
        "records": records,
        "sound": sound and same,
        "per_s": {name: records / value for name, value in seconds.items()},
        "pages_s": asked,
        "slowest_page_s": max(asked.values()),
        "long_session_s": rates["long session loaded"],
        "memory_grown_MB": grown / 1024.0,
        "export_MB": (folder / "all.zip").stat().st_size / 1e6,
        "digest": digest_bytes(str(head).encode())[:20],
    }


def measured(address: Callable[[str], str], folder: Path, kills: int, *sizes: int) -> dict[str, Any]:
    """All figures of one engine; `address` gives a new place."""
    folder.mkdir()
    return {
        "kills": crash("kills", address("kills"), kills),
        "writers": [crash("writers", address(f"writers{n}"), n) for n in (2, 8)],
        "large": large(address("large"), address("copy"), folder, *sizes),
    }


def run(kills: int = 200, readings: int = 1_000_000, calibrations: int = 10_000) -> dict[str, Any]:
    """Figures of each engine that is installed."""
    sizes = (kills, readings, calibrations)
    found: dict[str, Any] = {"readings": readings, "calibrations": calibrations, "engines": {}}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found["engines"]["SQLite"] = measured(lambda n: str(folder / f"{n}.sqlite"), folder / "s", *sizes)
    if programs() is not None and os.name == "posix":
        with tempfile.TemporaryDirectory() as name, server() as running:
            found["engines"]["PostgreSQL"] = measured(_new(running), Path(name) / "p", *sizes)
    engines = found["engines"].values()
    found["lost"] = sum(engine["kills"]["lost"] for engine in engines)
    found["slowest_page_s"] = max(engine["large"]["slowest_page_s"] for engine in engines)
    found["ok"] = all(found[name] <= limit for name, limit in WANTED.items()) and all(
        engine["kills"]["sound"] and engine["large"]["sound"] and all(w["sound"] for w in engine["writers"])
        for engine in engines
    )
    return found


def _new(running: Server) -> Callable[[str], str]:
    return lambda _: running.database()


def report(found: dict[str, Any]) -> None:
    """Tables."""
    for name, engine in found["engines"].items():
        one = engine["kills"]
        print(f"\n{name}: {one['kills']} kills, {one['acknowledged']} readings acknowledged, {one['lost']} lost")
        for row in engine["writers"]:
            print(
                f"  {row['writers']} writers: {row['records_per_s']:.0f} records/s, {row['taken']} of "
                f"{row['positions']} positions taken, {row['conflicts_told']} conflicts told"
            )
        big = engine["large"]
        sizes = f"export of {big['export_MB']:.0f} MB, {big['memory_grown_MB']:.0f} MB more memory"
        print(f"  {big['records']} records, {sizes}")
        print("  records/s: " + ", ".join(f"{what} {rate:.0f}" for what, rate in big["per_s"].items()))
        print(f"  session of {LONG} positions loaded in {big['long_session_s']:.2f} s")
        for what, seconds in sorted(big["pages_s"].items(), key=lambda pair: -pair[1])[:8]:
            print(f"  {1e3 * seconds:8.1f} ms  {what}")
    print(f"\nall as wanted: {found['ok']}")


if __name__ == "__main__":
    command(__doc__, run, report)

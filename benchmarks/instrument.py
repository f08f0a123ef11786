"""A day of live data with faults through the real transport: what is lost, what is doubled, and the memory.

    python -m benchmarks.instrument [--json] [--hours 24] [--protocol csv-line]

A simulated instrument sends ten samples a second of its own time, as fast as the reader takes them, with garbage,
cut lines, drop-outs, repeated lines, values out of range and lost connections. The server keeps the number of each
line it sent whole, the receiver that of each sample it was given. Readings are captured into a ledger all the while.

Lost is what was sent whole and did not arrive, from the first line of each connection that was used on: what came
before the port was open and the first line after that do not count. An acknowledged reading is one whose capture
returned; all of them must be in the ledger when it is opened again.
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from tests.laboratory.instruments.faulty_instrument import FaultyInstrument

from benchmarks import command
from inclinometry.calibration.plans import Plan
from inclinometry.laboratory.instruments.protocol import Sample
from inclinometry.laboratory.instruments.protocol_toml import read_protocol
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.live import CaptureError, LiveFeed
from inclinometry.laboratory.registry import (
    RegisteredRig,
    RegisteredTool,
    put_rig,
    put_tool,
)
from inclinometry.laboratory.session import capture, load_session, open_session

RATE = 10.0
FAULTS = {
    "garbage": 0.01,
    "dropout": 0.01,
    "partial": 0.005,
    "encoding": 0.005,
    "endless": 0.0005,
    "repeat": 0.005,
    "outside": 0.002,
}
DISCONNECT = 600.0  # s of the simulation
CAPTURE_EVERY = 900.0  # s of the simulation
WANTED = {"lost": 0, "doubled": 0, "unacknowledged": 0, "memory_growth_MB": 16.0}


class Account:
    """What was sent whole, by connection, and what came, in arrays that do not grow."""

    def __init__(self, count: int) -> None:
        self.link = np.zeros(count + 1, dtype=np.int32)  # of each number: the connection it was sent whole on, 0: none
        self.came = np.zeros(count + 1, dtype=np.uint8)  # how often it came
        self.received = 0
        self.disorder = 0
        self._last = -1

    def sent(self, link: int, number: int) -> None:
        self.link[number] = link

    def take(self, sample: Sample) -> None:
        number = sample.sequence or 0
        self.came[number] += 1
        self.received += 1
        self.disorder += number <= self._last
        self._last = number

    def result(self) -> dict:
        lost = before = 0
        for link in range(1, int(self.link.max()) + 1):
            sent = self.link == link
            came = np.flatnonzero(sent & (self.came > 0))
            missing = np.flatnonzero(sent & (self.came == 0))
            first = came[0] if len(came) else len(self.link)
            lost += int((missing > first).sum())
            before += int((missing < first).sum())
        return {
            "lost": lost,
            "doubled": int((self.came > 1).sum()) + self.disorder,
            "never_sent_whole": int(((self.came > 0) & (self.link == 0)).sum()),
            "before_the_port_was_open": before,
        }


class Captures(threading.Thread):
    """Takes a reading into a ledger every quarter of an hour of the simulation; remembers what was acknowledged."""

    def __init__(self, path: Path, feed: LiveFeed, most: int) -> None:
        super().__init__(daemon=True)
        self.feed, self.acknowledged, self.refused = feed, [], 0
        self.due = CAPTURE_EVERY
        self.ended = threading.Event()
        self.ledger = create(path)
        put_tool(self.ledger, RegisteredTool("IN-7", "steering tool"), author="anna")
        put_rig(self.ledger, RegisteredRig("stand 1", (0.002, 0.002, 0.002)), author="anna")
        turn = np.linspace(0.0, 6.0, most)
        self.session = open_session(
            self.ledger, "IN-7", Plan("long", turn, turn / 2, turn), rig="stand 1", author="anna"
        )

    def run(self) -> None:
        positions = self.session.positions
        while not self.ended.wait(0.01) and len(self.acknowledged) < len(positions):
            latest = self.feed.latest()
            if latest is None or latest.time < self.due:
                continue
            position = positions[len(self.acknowledged)]
            try:
                taken = self.feed.capture(position.dial)
            except CaptureError:
                self.refused += 1
                continue
            capture(self.ledger, self.session.id, position.number, taken, author="anna", attempt=1)
            self.acknowledged.append((position.number, {k: v.tolist() for k, v in taken.channels.items()}))
            self.due = latest.time + CAPTURE_EVERY

    def missing(self, path: Path) -> tuple[int, int]:
        """Acknowledged readings, and how many of them are not in the ledger as they were, after opening it again."""
        self.ledger.close()
        with Ledger(path, read_only=True) as ledger:
            session = load_session(ledger, self.session.id)
            sound = not verify(ledger).faults
            kept = {n: {k: v.tolist() for k, v in t.capture.channels.items()} for n, t in session.taken.items()}
        return len(self.acknowledged), sum(kept.get(n) != c for n, c in self.acknowledged) + (not sound)


def memory() -> float:
    """Resident memory of this process, MB; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6
    except (OSError, AttributeError, ValueError):
        return 0.0


def run(hours: float = 24.0, protocol: str = "csv-line", seed: int = 1) -> dict:
    """Send so many hours of samples and account for each of them."""
    if read_protocol(protocol).query:
        raise ValueError(f"{protocol} waits a second for each answer that is missing; choose a protocol that streams")
    count = int(hours * 3600.0 * RATE)
    account, start, sizes = Account(count), time.perf_counter(), []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "ledger.sqlite")
        faulty = FaultyInstrument(
            FAULTS,
            protocol,
            seed=seed,
            rate=RATE,
            speed=0.0,
            disconnect=DISCONNECT,
            on_line=account.sent,
            last=count,
        )
        with faulty as instrument:

            class Counted(LiveFeed):
                def put(self, sample: Sample) -> None:
                    super().put(sample)
                    account.take(sample)

            feed = Counted(
                instrument.url, instrument.protocol, clock=lambda: account.received / RATE, backoff=(0.01, 0.1)
            )
            captures = Captures(path, feed, max(int(hours * 3600.0 / CAPTURE_EVERY), 1))
            with feed:
                captures.start()
                sizes = _follow(instrument, feed, account, count)
            captures.ended.set()
            captures.join()
        acknowledged, unacknowledged = captures.missing(path)
    steady = sizes[len(sizes) // 5 :] or [0.0]
    result = {
        "hours": hours,
        "protocol": protocol,
        "samples_sent": count,
        "samples_received": account.received,
        **account.result(),
        "captured": acknowledged,
        "unacknowledged": unacknowledged,
        "refused": captures.refused,
        "events": dict(sorted(feed.counts.items())),
        "memory_MB": max(steady),
        "memory_growth_MB": max(steady) - steady[0],
        "seconds": time.perf_counter() - start,
    }
    result["fulfilled"] = {name: result[name] <= most for name, most in WANTED.items()}
    result["fulfilled"]["never_sent_whole"] = result["never_sent_whole"] == 0
    return result


def _follow(instrument: FaultyInstrument, feed: LiveFeed, account: Account, count: int) -> list[float]:
    """Wait for the last sample; the memory at equal shares of the way."""
    sizes: list[float] = []
    quiet = time.monotonic()
    before = -1
    while instrument.sent <= count or time.monotonic() - quiet < 1.0:
        if account.received != before:
            before, quiet = account.received, time.monotonic()
        if instrument.sent >= count * len(sizes) / 20.0:
            sizes.append(memory())
        if time.monotonic() - quiet > 60.0:
            raise RuntimeError(f"nothing came for a minute: {feed.counts}")
        time.sleep(0.02)
    return sizes


def report(result: dict) -> None:
    """Print the table."""
    print(f"{result['hours']:g} h of {result['protocol']}, faults {FAULTS}, disconnected every {DISCONNECT:g} s")
    rate = result["samples_sent"] / result["seconds"]
    print(f"  {result['samples_sent']} samples sent in {result['seconds']:.1f} s ({rate:.0f} a second)")
    print(f"  {result['samples_received']} received: {result['lost']} lost, {result['doubled']} doubled")
    print(f"  before a port was open, or its first line: {result['before_the_port_was_open']}")
    print(f"  {result['captured']} readings acknowledged, {result['unacknowledged']} not in the ledger")
    print(f"  memory {result['memory_MB']:.0f} MB, grown by {result['memory_growth_MB']:.1f} MB after the first fifth")
    print("  " + ", ".join(f"{name} {number}" for name, number in result["events"].items()))
    verdict = {True: "yes", False: "NO"}
    print("fulfilled: " + ", ".join(f"{name} {verdict[bool(ok)]}" for name, ok in result["fulfilled"].items()))


if __name__ == "__main__":
    command(__doc__, run, report)

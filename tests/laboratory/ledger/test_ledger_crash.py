"""Killed, cut off, copied, written by many at once: what was acknowledged is there; nothing is half there."""

from __future__ import annotations

import errno
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.postgresql import Server, programs, server
from tests.refusals import coded, refused

from inclinometry.errors import FileError
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.engine import _WRITE_LOCK
from inclinometry.laboratory.ledger.exchange import backup, export, restore
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError
from inclinometry.laboratory.ledger.verify import verify

from .conftest import TOOL, add

ROOT = Path(__file__).parents[3]
needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")


def crash(what: str, where: str, number: int, more: int) -> dict[str, Any]:
    """Figures of `benchmarks.ledger_crash`."""
    command = [sys.executable, "-m", "benchmarks.ledger_crash", what, where, str(number), str(more)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.long
@needs_fork
def test_what_was_acknowledged_survives_being_killed(place: Callable[[], str]) -> None:
    """SIGKILL at random moments of captures; benchmarks/ledger.py does it 200 times."""
    found = crash("kills", place(), 10, 3)
    assert found["lost"] == 0
    assert found["sound"]
    assert found["acknowledged"] >= found["kills"]
    assert found["acknowledged"] <= found["recorded"] <= found["acknowledged"] + found["kills"]


@pytest.mark.long
@needs_fork
def test_many_writers_at_once_lose_nothing(place: Callable[[], str]) -> None:
    """Each position is taken once, every other writer hears of it, the chain has no gap."""
    found = crash("writers", place(), 4, 12)
    assert found["failed"] == 0
    assert found["sound"]
    assert found["taken"] == found["readings"] == found["positions"]
    assert found["taken_twice"] == 0
    assert found["taken"] + found["conflicts_told"] == found["wanted"] == found["events"]


def test_threads_of_one_program_share_a_ledger(ledger: Ledger) -> None:
    """As the browser pages of one bench do."""
    with ThreadPoolExecutor(6) as pool:
        list(pool.map(lambda name: add(ledger, *[f"T{name}"] * 5), range(6)))
    assert ledger.count("tool") == 30
    assert verify(ledger).ok


def test_a_power_cut_leaves_whole_records(tmp_path: Path) -> None:
    """The write-ahead file cut off anywhere, or its end overwritten: what was on the disk by then is there."""
    path = tmp_path / "a.sqlite"
    sizes = []
    with create(path) as ledger:
        with sqlite3.connect(path) as raw:
            raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        raw.close()
        for number in range(8):
            add(ledger, f"T{number}")
            sizes.append((tmp_path / "a.sqlite-wal").stat().st_size)
        main, log = path.read_bytes(), (tmp_path / "a.sqlite-wal").read_bytes()
    assert sizes == sorted(set(sizes))
    random = np.random.default_rng(7)
    for turn, cut in enumerate([0, *sizes, *random.integers(1, len(log), 12)]):
        copy = tmp_path / f"c{turn}.sqlite"
        copy.write_bytes(main)
        garbage = random.bytes(len(log) - int(cut)) if turn % 2 else b""
        copy.with_name(copy.name + "-wal").write_bytes(log[:cut] + garbage)
        with Ledger(copy) as found:
            assert found.head().seq == sum(size <= cut for size in sizes)
            assert verify(found, copy=True).ok


def test_a_lost_write_ahead_file_is_noticed_by_a_noted_head(tmp_path: Path) -> None:
    """The records in it are gone without a trace in the file itself."""
    path = tmp_path / "a.sqlite"
    with create(path) as ledger:
        add(ledger, "A")
    with Ledger(path) as ledger:
        add(ledger, "B")
        head = ledger.head()
        shutil.copy(path, tmp_path / "b.sqlite")
    with Ledger(tmp_path / "b.sqlite") as copy:
        assert verify(copy, copy=True).ok
        assert "ledger-removed" in coded(verify(copy, copy=True, head=head).faults)


@pytest.mark.long
def test_a_backup_while_others_write_is_one_state(tmp_path: Path) -> None:
    """Every backup verifies and has at least what was recorded before it began."""
    with create(tmp_path / "a.sqlite") as ledger:
        add(ledger, "A")
        stop = threading.Event()

        def write() -> None:
            while not stop.is_set():
                ledger.append_all([Draft("tool", {"serial": "B"}, TOOL)] * 3, author="b")

        writer = threading.Thread(target=write)
        writer.start()
        try:
            for turn in range(4):
                least = ledger.head().seq
                backup(ledger, tmp_path / f"b{turn}.sqlite")
                export(ledger, tmp_path / f"b{turn}.zip")
                with Ledger(tmp_path / f"b{turn}.sqlite") as copy:
                    assert verify(copy, copy=True).ok
                    assert copy.head().seq >= least
                    assert copy.head().seq % 3 == 1
                with create(tmp_path / f"r{turn}.sqlite") as second:
                    assert restore(second, tmp_path / f"b{turn}.zip").seq % 3 == 1
        finally:
            stop.set()
            writer.join()


def test_an_interrupted_export_leaves_no_file_and_an_interrupted_import_nothing(ledger: Ledger, tmp_path: Path) -> None:
    """Ctrl-C in the middle; a verification ends with it as well."""
    ledger.append_all([Draft("tool", {"serial": f"T{n}"}, TOOL) for n in range(600)], author="a")

    def interrupt(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(ledger, tmp_path / "all.zip", progress=interrupt)
    assert not list(tmp_path.glob("*.zip")) + list(tmp_path.glob(".*.part"))
    with pytest.raises(KeyboardInterrupt):
        verify(ledger, progress=interrupt)
    export(ledger, tmp_path / "all.zip")
    with create(tmp_path / "copy.sqlite") as copy:
        with pytest.raises(KeyboardInterrupt):
            restore(copy, tmp_path / "all.zip", progress=interrupt)
        assert copy.head().seq == 0
        assert restore(copy, tmp_path / "all.zip") == ledger.head()


def test_a_ledger_held_by_another_program_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After some patience; reading goes on."""
    monkeypatch.setattr("inclinometry.laboratory.ledger.engine.PATIENCE", 0.05)
    create(tmp_path / "a.sqlite").close()
    other = sqlite3.connect(tmp_path / "a.sqlite", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with Ledger(tmp_path / "a.sqlite") as ledger:
        with refused("ledger-locked", error=LedgerError):
            add(ledger, "A")
        assert ledger.head().seq == 0
        other.execute("ROLLBACK")
        other.close()
        add(ledger, "A")


def test_a_held_database_is_told(postgresql: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lock of another writer that does not end."""
    import psycopg

    monkeypatch.setattr("inclinometry.laboratory.ledger.engine.PATIENCE", 0.2)
    where = postgresql.database()
    with create(where) as ledger, psycopg.connect(where.replace("+psycopg", "")) as other:
        other.execute(f"SELECT pg_advisory_lock({_WRITE_LOCK})")
        with refused("ledger-locked", error=LedgerError):
            add(ledger, "A")


@pytest.mark.long
@pytest.mark.skipif(programs() is None, reason="PostgreSQL's server is not installed")
def test_a_server_that_went_away_and_came_back() -> None:
    """What was acknowledged is there; while it is away the sentence says so."""
    with server() as own, create(own.database()) as ledger:
        add(ledger, "A")
        own.stop()
        with refused("ledger-server", error=LedgerError):
            add(ledger, "B")
        with refused("ledger-server", error=LedgerError):
            ledger.head()
        own.start()
        add(ledger, "C")
        assert [record.keys["serial"] for record in ledger.current("tool")] == ["A", "C"]
        assert verify(ledger).ok


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can make a small disk")
def test_a_full_disk_loses_nothing(tmp_path: Path) -> None:
    """A disk of a few hundred kilobytes: the sentence says so, what was acknowledged stays, work goes on later."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1200k", "none", disk], check=False, capture_output=True
    ).returncode:
        pytest.skip("no small disk can be made here")
    try:
        with create(disk / "a.sqlite") as ledger:
            done = 0

            def work() -> None:
                nonlocal done
                while done < 500:
                    ledger.append("tool", {"serial": "A"}, {**TOOL, "description": "x" * 9000}, author="a")
                    done += 1

            def export_again() -> None:
                for turn in range(20):
                    export(ledger, disk / f"b{turn}.zip")
                    (disk / f"fill{turn}").write_bytes(b"x" * 4000)

            with pytest.raises(LedgerError, check=lambda error: error.finding.code == "ledger-disk-full"):
                work()
            assert ledger.count("tool") == done > 3
            assert verify(ledger).ok
            with pytest.raises(FileError, check=lambda error: error.finding.code == "ledger-disk-full"):
                backup(ledger, disk / "b.sqlite")
            with pytest.raises(
                (FileError, OSError),
                check=lambda error: (
                    error.errno == errno.ENOSPC
                    if isinstance(error, OSError)
                    else error.finding.code == "file-unwritable"
                ),
            ):
                export_again()
            assert not list(disk.glob(".*.part"))
            for extra in (*disk.glob("fill*"), *disk.glob("*.zip")):
                extra.unlink()
            subprocess.run(["mount", "-o", "remount,size=20m", disk], check=True, capture_output=True)
            add(ledger, "B")
            assert ledger.count("tool") == done + 1
    finally:
        subprocess.run(["umount", disk], check=True)

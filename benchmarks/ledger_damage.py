"""A signed ledger damaged: bits flipped anywhere in its file, fields changed by SQL; sound, or named, never read wrong.

    python -m benchmarks.ledger_damage FLIPS EDITS [SEED]

Prints one JSON object. The keys are those of the environment; give them a folder of their own (INCLINOMETRY_KEYS).
"""

from __future__ import annotations

import json
import random
import shutil
import sqlite3
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.ledger_crash import plan, prepared, taken
from inclinometry.errors import InclinometryError
from inclinometry.laboratory.ledger.ledger import Draft, Ledger
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.session import capture, open_session

DOCUMENT = ("application/pdf", b"%PDF-1.7 " + bytes(range(256)) * 8)


def made(path: Path) -> None:
    """A ledger of a session, events, and a certificate with a document."""
    prepared(str(path))
    with Ledger(path) as ledger:
        session = open_session(ledger, "IN-7", plan(), rig="stand 1", author="anna")
        for position in session.positions:
            capture(ledger, session.id, position.number, taken(1.0 + position.number), author="anna")
        from inclinometry.digest import digest_bytes

        body = {"record": {}, "calibration": "c", "documents": {"pdf": digest_bytes(DOCUMENT[1])}, "head": "0"}
        ledger.append_all([Draft("certificate", {"number": "1", "serial": "IN-7"}, body, [DOCUMENT])], author="anna")
    with sqlite3.connect(path) as raw:
        raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    raw.close()


def content(path: Path) -> list[Any]:
    """All that the tables hold."""
    raw = sqlite3.connect(path)
    try:
        names = [name for (name,) in raw.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
        return [(name, raw.execute(f'SELECT * FROM "{name}" ORDER BY 1').fetchall()) for name in names]
    finally:
        raw.close()


def judged(path: Path, whole: list[Any], at: Path) -> str:
    """ "named", "sound and the same", or "sound and changed", which must not be."""
    try:
        with Ledger(path, read_only=True) as ledger:
            ok = verify(ledger, copy=True).ok
    except InclinometryError:
        return "named"
    if not ok:
        return "named"
    shutil.copy(path, at)
    return "sound and the same" if content(at) == whole else "sound and changed"


def run(flips: int, edits: int, seed: int = 1) -> dict[str, Any]:
    """So many copies with a bit flipped, so many with a field changed by SQL."""
    random_ = random.Random(seed)
    found: dict[str, Counter[str]] = {"flips": Counter(), "edits": Counter()}
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        path, copy, looked = (Path(folder) / name for name in ("lab.sqlite", "copy.sqlite", "looked.sqlite"))
        made(path)
        whole, data = content(path), path.read_bytes()
        for _ in range(flips):
            place, bit = random_.randrange(len(data)), random_.randrange(8)
            changed = bytearray(data)
            changed[place] ^= 1 << bit
            copy.write_bytes(changed)
            said = judged(copy, whole, looked)
            found["flips"][said] += 1
            wrong += [f"bit {bit} of byte {place}"] if said == "sound and changed" else []
        raw = sqlite3.connect(path)
        fields = [
            (table, column, rowid)
            for table, rows in whole
            if table != "alembic_version" and rows
            for column in [one[1] for one in raw.execute(f'PRAGMA table_info("{table}")')]
            for (rowid,) in raw.execute(f'SELECT rowid FROM "{table}"')
        ]
        raw.close()
        for table, column, rowid in random_.choices(fields, k=edits):
            copy.write_bytes(data)
            if not edited(copy, table, column, rowid, random_):
                found["edits"]["refused by the database"] += 1
                continue
            said = judged(copy, whole, looked)
            found["edits"][said] += 1
            wrong += [f"{table}.{column} of row {rowid}"] if said != "named" else []
            for end in ("-wal", "-shm"):
                Path(f"{copy}{end}").unlink(missing_ok=True)
    return {name: dict(counts) for name, counts in found.items()} | {"wrong": wrong}


def edited(path: Path, table: str, column: str, rowid: int, random_: random.Random) -> bool:
    """Change one field of one row as somebody with a database program would; False where a constraint forbids it."""
    raw = sqlite3.connect(path)
    try:
        triggers = raw.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            raw.execute(f'DROP TRIGGER "{name}"')
        (old,) = raw.execute(f'SELECT "{column}" FROM "{table}" WHERE rowid = ?', (rowid,)).fetchone()
        new: Any = old
        while new == old:
            if isinstance(old, int):
                new = old + random_.choice([-1, 1, 1000])
            elif isinstance(old, bytes):
                place = random_.randrange(len(old))
                new = old[:place] + bytes([old[place] ^ 1]) + old[place + 1 :]
            else:
                text = str(old or "")
                place = random_.randrange(len(text) + 1)
                new = text[:place] + random_.choice("0123456789abcdef ") + text[place + random_.randrange(2) :]
        raw.execute(f'UPDATE "{table}" SET "{column}" = ? WHERE rowid = ?', (new, rowid))
        for _, text in triggers:
            raw.execute(text)
        raw.commit()
    except sqlite3.IntegrityError:
        return False
    finally:
        raw.close()
    return True


if __name__ == "__main__":
    print(json.dumps(run(*map(int, sys.argv[1:]))))

"""How ledger-0001.sqlite and export-1.zip were made, with the program of that time; kept as a record, never run again.

python make_first.py FOLDER
"""

import sqlite3
import sys
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path

from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.exchange import export
from inclinometry.laboratory.ledger.ledger import Draft, Ledger

TRIAD = {"units": "counts", "axes": ["x", "y", "z"]}
SEALED = "sha256:2689367b205c16ce32ed4200942b8b8b1e262dfc70d9bc9fbc77c49699a4f1df"  # of b"ok"
DRAFTS = (
    Draft(
        "user", {"name": "anna"}, {"role": "metrologist", "active": True, "full_name": "Анна 安娜", "password": None}
    ),
    Draft("site", {"name": "stand house"}, {"g_mps2": 9.8066, "b_nT": 50123.5, "dip_deg": 66.25, "u": {"b_nT": 5.0}}),
    Draft("rig", {"name": "stand 1"}, {"sd_deg": [0.01, 0.01, 0.02], "place": "hall", "driver": {}}),
    Draft("tool", {"serial": "IN-7"}, {"name": "steering tool", "triads": {"accelerometer": TRIAD}}),
    Draft(
        "session",
        {"serial": "IN-7", "purpose": "calibrate"},
        {"plan": {"name": "two", "positions_deg": [[0.0, 90.0, -0.0], [90.0, 1e-09, 180.0]]}, "rig": "stand 1"},
    ),
)


def main(folder: Path) -> None:
    """Make both files."""
    ticks = count()
    path = folder / "ledger-0001.sqlite"
    create(path).close()
    clock = lambda: datetime(2026, 11, 21, 8, tzinfo=UTC) + timedelta(seconds=next(ticks))  # noqa: E731
    with Ledger(path, clock=clock) as ledger:
        session = ledger.append_all(DRAFTS, author="anna")[-1].id
        names = []
        for position, attempt in ((1, 1), (2, 1), (2, 2)):
            body = {
                "dial_deg": [0.0, 90.0, 0.125],
                "channels": {"accelerometer": [1.0, -2.5, 1e22], "magnetometer": [3.0]},
                "count": 9007199254740993,
                "captured": "key",
                "note": "<b>quoted \"text\"</b> 'n' \\ \u00e9\u4e2d",
            }
            keys = {"session": session, "position": position, "attempt": attempt}
            names.append(ledger.append("reading", keys, body, author="boris").id)
        rejected = {"subject_kind": "reading", "subject": names[1], "action": "rejected"}
        ledger.append("event", rejected, {"reason": "bumped", "details": {"deg": 2}}, author="boris")
        made = ledger.append(
            "calibration",
            {"serial": "IN-7", "session": session},
            {"tool_json": {"schema": "tool-1"}, "method": "joint", "readings": [names[0], names[2]], "program": "0.1"},
            author="anna",
        )
        checked = ledger.append(
            "verification",
            {"serial": "IN-7", "calibration": made.id},
            {"verdict": "pass", "limits": {}, "report": {}, "readings": []},
            author="anna",
        )
        body = {
            "record": {"title": "Calibration certificate"},
            "calibration": made.id,
            "verification": checked.id,
            "documents": {"pdf": SEALED},
            "head": str(ledger.head()),
        }
        draft = Draft("certificate", {"number": "2026-0001", "serial": "IN-7"}, body, [("text/plain", b"ok")])
        ledger.append_all([draft], author="anna")
        print(export(ledger, folder / "export-1.zip"))
    with sqlite3.connect(path, isolation_level=None) as raw:
        raw.execute("PRAGMA journal_mode = DELETE")
        raw.execute("PRAGMA page_size = 1024")
        raw.execute("VACUUM")
        raw.execute("PRAGMA journal_mode = WAL")
    raw.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))

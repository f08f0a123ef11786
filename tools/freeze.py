"""What the program does today, written down, so that a change of the project can be compared with it byte for byte.

    python tools/freeze.py FOLDER              # record
    python tools/freeze.py FOLDER --against OLD     # record, then list what differs; exit status 1 if anything does

Everything goes through the command line, which stays where the modules move: `--help` of every command, the outputs of
`demo`, `tool.json` of ten seeds by every method, the record of a certificate, the export of a ledger, the interface of
the laboratory (OpenAPI). Dates are given, not taken from the clock. Standard library only.
"""

from __future__ import annotations

import argparse
import filecmp
import os
import re
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SEEDS = range(1, 11)
METHODS = {"twelve": ("joint", "twelve"), "orthogonal": ("orthogonal",), "rotations": ("rotations",)}
LEDGER = ROOT / "tests" / "reference" / "ledger" / "export-1.zip"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"}


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The program in a folder; output and exit status are recorded, never judged."""
    command = [sys.executable, "-m", "inclinometry", *words]
    return subprocess.run(command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False)


def note(path: Path, done: subprocess.CompletedProcess[str]) -> None:
    """Write down what was said, on both streams, and the exit status."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{done.stdout}\n--- stderr\n{done.stderr}\n--- exit status {done.returncode}\n", encoding="utf-8")


def helps(folder: Path, words: tuple[str, ...] = ()) -> None:
    """`--help` of a command and of the commands under it."""
    done = run(folder, *words, "--help")
    note(folder / "help" / ("-".join(("inclinometry", *words)) + ".txt"), done)
    for box in re.findall(r"╭[^\n]*\n(.*?)╰", done.stdout, flags=re.DOTALL):
        for name in re.findall(r"^│ {1,2}([a-z][a-z0-9-]*)(?: {2}| *│)", box, flags=re.MULTILINE):
            if name not in words:
                helps(folder, (*words, name))


def calibrations(folder: Path) -> None:
    """Readings of ten simulated tools on three plans, by the default and by the method of the plan."""
    folder.mkdir()
    for plan, methods in METHODS.items():
        for seed in SEEDS:
            readings = f"{plan}-{seed}.csv"
            run(folder, "simulate", "bench", "--plan", plan, "--seed", str(seed), "--rig-sd-deg", "0.1", "-o", readings)
            for method in methods:
                name = f"{plan}-{seed}-{method}"
                words = ["--method", method, "--created", "2026-01-01", "--json", "-o", f"{name}.json"]
                note(folder / f"{name}.txt", run(folder, "calibrate", readings, *words))


def certificate(folder: Path, tool: Path) -> None:
    """The record of a certificate; the PDF holds the version of what set it and is left out."""
    folder.mkdir()
    words = ["certificate", str(tool), "--number", "1", "-o", "certificate.pdf", "--record", "record.json"]
    note(folder / "said.txt", run(folder, *words))
    (folder / "certificate.pdf").unlink(missing_ok=True)


def ledger(folder: Path) -> None:
    """A ledger of the first version, read, checked and written again, and the interface of the laboratory over it."""
    folder.mkdir()
    note(folder / "import.txt", run(folder, "ledger", "import", str(LEDGER), "--ledger", "lab.sqlite"))
    note(folder / "verify.txt", run(folder, "ledger", "verify", "--ledger", "lab.sqlite"))
    note(folder / "export.txt", run(folder, "ledger", "export", "export.zip", "--ledger", "lab.sqlite"))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "inclinometry", "bench", "--ledger", "lab.sqlite", "--port", str(port)]
    server = subprocess.Popen(
        command, cwd=folder, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(240):
            time.sleep(0.5)
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/openapi.json") as answer:
                    (folder / "openapi.json").write_bytes(answer.read())
                break
            except OSError:
                continue
    finally:
        server.terminate()
        server.wait()
    for name in ("lab.sqlite", "lab.sqlite-wal", "lab.sqlite-shm"):
        (folder / name).unlink(missing_ok=True)


def differences(new: filecmp.dircmp[str], where: str = "") -> list[str]:
    """One line for each file that differs or stands on one side only."""
    lines = [f"differs: {where}{name}" for name in (*new.diff_files, *new.funny_files)]
    lines += [f"new:     {where}{name}" for name in new.left_only]
    lines += [f"gone:    {where}{name}" for name in new.right_only]
    for name, below in new.subdirs.items():
        lines += differences(below, f"{where}{name}/")
    return lines


def main() -> None:
    """Record, and compare where a record to compare with is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="must not exist yet")
    parser.add_argument("--against", type=Path, help="an earlier record")
    given = parser.parse_args()
    folder: Path = given.folder.resolve()
    folder.mkdir(parents=True)
    steps = {
        "help pages": lambda: helps(folder),
        "calibrations": lambda: calibrations(folder / "calibrate"),
        "certificate": lambda: certificate(
            folder / "certificate", folder / "calibrate" / "orthogonal-1-orthogonal.json"
        ),
        "ledger and interface": lambda: ledger(folder / "ledger"),
        "demo": lambda: note(folder / "demo.txt", run(folder, "demo", "--output", "demo")),
    }
    for name, step in steps.items():
        print(name, flush=True)
        step()
    if given.against is None:
        return
    # by content, not by the time of the last change
    filecmp.clear_cache()
    found = differences(filecmp.dircmp(folder, given.against.resolve(), ignore=[]))
    print("\n".join(found) or "nothing differs")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()

"""What benchmarks share: the clock, a bench as users start it, blocks of pages, rotations apart from the package."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np


def laps(call: Callable[[], object], rounds: int) -> list[float]:
    """Seconds of each of several calls."""
    found = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        found.append(time.perf_counter() - start)
    return found


def alternating(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Name -> seconds of a call, one figure a round, so that all meet the same load; the first round only warms up."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds + 1):
        for name, call in calls.items():
            times[name] += laps(call, 1)
    return {name: values[1:] for name, values in times.items()}


@contextmanager
def served(folder: str | Path, *words: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """The bench as a user starts it, on a free port and with a ledger of its own in a folder: address and process."""
    line = [sys.executable, "-m", "inclinometry", "bench", "--port", "0", "--ledger", "lab.sqlite", *words]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True, cwd=folder) as process:
        try:
            found = (re.search(r"https?://[\w.:\[\]]+", text) for text in process.stdout or ())
            yield next(filter(None, found)).group(), process
        finally:
            process.terminate()
            process.wait(20.0)


def cpu_time(process: subprocess.Popen[str]) -> float:
    """User and system time of a process and its threads, s."""
    fields = Path(f"/proc/{process.pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rms_deg(values) -> float:
    """Root mean square of angles, deg."""
    return float(np.degrees(np.sqrt(np.mean(np.square(values)))))


def rewrite(page: Path, block: str, lines: list[str]) -> None:
    """Write a block of a page anew, between its markers."""
    start, end = f"<!-- {block} -->", f"<!-- /{block} -->"
    before, rest = page.read_text(encoding="utf-8").split(start)
    page.write_text("\n".join([before + start, "", *lines, "", end + rest.split(end)[1]]), encoding="utf-8")


def turn(angle, i: int, j: int) -> np.ndarray:
    """Passive rotations (..., 3, 3) in the plane of axes i and j."""
    found = np.array(np.broadcast_to(np.eye(3), (*np.shape(angle), 3, 3)))
    found[..., i, i] = found[..., j, j] = np.cos(angle)
    found[..., i, j], found[..., j, i] = np.sin(angle), -np.sin(angle)
    return found


def turned(azimuth, inclination, toolface) -> np.ndarray:
    """From north, east, down to tool axes (..., 3, 3)."""
    return turn(toolface, 0, 1) @ turn(inclination, 2, 0) @ turn(azimuth, 0, 1)

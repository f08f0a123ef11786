"""The bench in the browser: from the command to the first page, and how soon it ends."""

from __future__ import annotations

import re
import signal
import statistics
import tempfile
import time
import urllib.request
from typing import Any

from benchmarks import command
from benchmarks.measure import served


def run(rounds: int = 3) -> dict[str, Any]:
    """Medians of the seconds until the server is up, the first and a later page are there, Ctrl-C has ended it."""
    found = [_once() for _ in range(rounds)]
    return {name: statistics.median(one[name] for one in found) for name in found[0]} | {"rounds": rounds}


def _once() -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        with served(folder, "--instrument", "simulated") as (url, process):
            up = time.perf_counter()
            pages = [_seconds(url) for _ in range(5)]
            asked = time.perf_counter()
            process.send_signal(signal.SIGINT)
            process.wait(30)
            ended = time.perf_counter()
    return {
        "up_s": up - began,
        "first_page_s": pages[0],
        "later_page_s": statistics.median(pages[1:]),
        "end_s": ended - asked,
    }


def _seconds(url: str) -> float:
    began = time.perf_counter()
    with urllib.request.urlopen(url) as answer:  # the page with its styles and scripts
        text = answer.read().decode()
    for path in dict.fromkeys(re.findall(r'"(/(?:static|_nicegui)/[^"]+\.(?:css|js))"', text)):
        with urllib.request.urlopen(url.rstrip("/") + path) as answer:
            answer.read()
    return time.perf_counter() - began


def report(found: dict[str, Any]) -> None:
    """Print the figures."""
    print(f"bench, median of {found['rounds']} starts with an empty ledger and a simulated instrument:")
    print(f"  from the command to a listening server {found['up_s']:.2f} s")
    print(f"  first page with its styles and scripts  {found['first_page_s']:.2f} s")
    print(f"  the same again                          {found['later_page_s']:.2f} s")
    print(f"  from Ctrl-C to the end                  {found['end_s']:.2f} s")


if __name__ == "__main__":
    command(__doc__, run, report)

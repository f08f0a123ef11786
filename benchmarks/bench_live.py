"""The live bench page: what the server's process costs with several browsers at ten updates a second.

    python benchmarks/bench_live.py [--json] [--browsers 5] [--seconds 10]

A bench with its demonstration is started as users start it. Each client asks for the page as a browser does, opens the
page's websocket, and counts the live updates that come. CPU time is that of the server's process, simulated instrument
included, of one core; idle is the same server without a client.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import socketio  # type: ignore[import-untyped]

WANTED = {"updates_per_second": 9.0, "share_of_a_core": 1.0}
LIVE = "benchLive("


@contextmanager
def served() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A bench of its own on a free port: process and address."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "inclinometry", "bench", "--demo", "--port", "0"]
        command += ["--ledger", str(Path(folder) / "ledger.sqlite")]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                yield process, _address(process)
            finally:
                process.terminate()
                process.wait(20.0)


def _address(process: subprocess.Popen[str]) -> str:
    for line in process.stdout or ():
        found = re.search(r"https?://[\w.:\[\]]+", line)
        if found:
            return found.group()
    raise RuntimeError("the bench did not start")


def cpu_time(process: int) -> float:
    """User and system time of a process and its threads, s."""
    fields = Path(f"/proc/{process}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


async def browse(address: str, path: str, seconds: float) -> dict[str, float]:
    """One browser: updates a second, bytes of one, s until the page came."""
    begun = time.perf_counter()
    async with httpx.AsyncClient(timeout=30.0) as http:
        page = await http.get(address + path)
        page.raise_for_status()
        cookies = "; ".join(f"{name}={value}" for name, value in http.cookies.items())
    came = time.perf_counter() - begun
    who = re.search(r"'client_id': '([-0-9a-f]+)'", page.text)
    if who is None:
        raise RuntimeError("the page names no client")
    query = f"client_id={who.group(1)}&next_message_id=0&implicit_handshake=true&tab_id={uuid.uuid4()}"
    query += f"&document_id={uuid.uuid4()}"
    client, sizes = socketio.AsyncClient(reconnection=False), []

    async def heard(data: Any) -> None:
        if data.get("code", "").startswith(LIVE):
            sizes.append(len(json.dumps(data, ensure_ascii=False).encode()))

    client.on("run_javascript", heard)
    headers = {"Cookie": cookies, "Origin": address}
    await client.connect(f"{address}?{query}", headers, ["websocket"], socketio_path="/_nicegui_ws/socket.io")
    await asyncio.sleep(2.0)
    sizes.clear()
    await asyncio.sleep(seconds)
    count, size = len(sizes), max(sizes, default=0)
    await client.disconnect()
    return {"updates_per_second": count / seconds, "bytes": size, "page_s": came}


def run(browsers: int = 5, seconds: float = 10.0) -> dict[str, Any]:
    """Updates a second of the slowest browser, CPU time, memory."""
    with served() as (process, address):
        path = re.search(r"/calibrate/[0-9a-f]{32}", httpx.get(address, timeout=30.0).text)
        if path is None:
            raise RuntimeError("no open session on the first page")
        httpx.get(address + path.group(), timeout=30.0)
        idle = _share(process.pid, seconds / 2.0)

        async def all_at_once() -> tuple[list[dict[str, float]], float]:
            clients = [asyncio.create_task(browse(address, path.group(), seconds)) for _ in range(browsers)]
            await asyncio.sleep(4.0)
            share = await asyncio.to_thread(_share, process.pid, max(seconds - 3.0, 1.0))
            return await asyncio.gather(*clients), share

        each, share = asyncio.run(all_at_once())
    return {
        "browsers": browsers,
        "updates_per_second": min(one["updates_per_second"] for one in each),
        "bytes_per_update": max(one["bytes"] for one in each),
        "page_s": max(one["page_s"] for one in each),
        "share_of_a_core": share,
        "share_idle": idle,
        "wanted": WANTED,
    }


def _share(process: int, seconds: float) -> float:
    """CPU time over time."""
    before, begun = cpu_time(process), time.perf_counter()
    time.sleep(seconds)
    return (cpu_time(process) - before) / (time.perf_counter() - begun)


def report(found: dict[str, Any]) -> str:
    """The figures in words."""
    return (
        f"{found['browsers']} browsers on one bench page: {found['updates_per_second']:.1f} updates a second in the "
        f"slowest (wanted {WANTED['updates_per_second']:g}), {found['bytes_per_update']} bytes each; the page came "
        f"in {found['page_s']:.2f} s, {found['browsers']} asked at once; the server takes "
        f"{100.0 * found['share_of_a_core']:.0f} % of a core, {100.0 * found['share_idle']:.0f} % without browsers"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--browsers", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=10.0)
    asked = parser.parse_args()
    found = run(asked.browsers, asked.seconds)
    print(json.dumps(found) if asked.json else report(found))


if __name__ == "__main__":
    main()

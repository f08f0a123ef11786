"""The live bench page: what the server's process costs with several browsers at ten updates a second.

    python -m benchmarks.bench_live [--json] [--browsers 5] [--seconds 10]

A bench with its demonstration is started as users start it. Each client asks for the page as a browser does, opens the
page's websocket, and counts the live updates that come. CPU time is that of the server's process, simulated instrument
included, of one core; idle is the same server without a client.
"""

from __future__ import annotations

import asyncio
import json
import re
import subprocess
import tempfile
import time
import uuid
from typing import Any

import httpx
import socketio  # type: ignore[import-untyped]

from benchmarks import command
from benchmarks.measure import cpu_time, served

WANTED = {"updates_per_second": 9.0, "share_of_a_core": 1.0}
LIVE = "benchLive("


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
    with tempfile.TemporaryDirectory() as folder, served(folder, "--demo") as (address, process):
        path = re.search(r"/calibrate/[0-9a-f]{32}", httpx.get(address, timeout=30.0).text)
        if path is None:
            raise RuntimeError("no open session on the first page")
        httpx.get(address + path.group(), timeout=30.0)
        idle = _share(process, seconds / 2.0)

        async def all_at_once() -> tuple[list[dict[str, float]], float]:
            clients = [asyncio.create_task(browse(address, path.group(), seconds)) for _ in range(browsers)]
            await asyncio.sleep(4.0)
            share = await asyncio.to_thread(_share, process, max(seconds - 3.0, 1.0))
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


def _share(process: subprocess.Popen[str], seconds: float) -> float:
    """CPU time over time."""
    before, begun = cpu_time(process), time.perf_counter()
    time.sleep(seconds)
    return (cpu_time(process) - before) / (time.perf_counter() - begun)


def report(found: dict[str, Any]) -> None:
    """The figures in words."""
    print(
        f"{found['browsers']} browsers on one bench page: {found['updates_per_second']:.1f} updates a second in the "
        f"slowest (wanted {WANTED['updates_per_second']:g}), {found['bytes_per_update']} bytes each; the page came "
        f"in {found['page_s']:.2f} s, {found['browsers']} asked at once; the server takes "
        f"{100.0 * found['share_of_a_core']:.0f} % of a core, {100.0 * found['share_idle']:.0f} % without browsers"
    )


if __name__ == "__main__":
    command(__doc__, run, report)

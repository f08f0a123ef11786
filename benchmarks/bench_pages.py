"""How long the bench's server takes for each page and list when the ledger is large.

    python -m benchmarks.bench_pages [--json] [--readings 1000000] [--calibrations 10000] [--ledger PATH]

A ledger is filled with many tools, one of them calibrated every fortnight for decades; a server is started on it and
every page and route is asked for several times over HTTP. Given is the median, and the first request, which finds
nothing prepared. A ledger named with --ledger is kept and used again.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from benchmarks import command
from inclinometry.calibration import plans
from inclinometry.calibration.conformity import verify
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.files.verification_json import judged_positions
from inclinometry.laboratory import registry
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Draft, Ledger
from inclinometry.laboratory.results import expected_table, parameters, plain_content
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

LIMIT_S = 0.3
TOOLS = 1000
BUSY = "T-0000"
"""The tool that has a tenth of all calibrations."""
ROUNDS = 5
AUTHOR = "benchmark"
SERVE = """
import socket, sys
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.web.app import create_app, run
with Ledger(sys.argv[1]) as ledger, socket.socket() as listening:
    listening.bind(("127.0.0.1", 0))
    port = listening.getsockname()[1]
    run(create_app(ledger), listening, ready=lambda: print(port, flush=True))
"""


def _bodies() -> dict[str, Any]:
    """A calibration of 24 positions and a verification of 72, as the laboratory records them."""
    sd = float(np.radians(0.1))
    rig, tool = Rig(dip=float(np.radians(70.0)), setting_sd=(sd, sd, sd)), realistic_tool(7)
    runs = []
    for plan, seed in ((plans.orthogonal(), 1), (plans.twelve(rolls=12, azimuths=5), 2)):
        made = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, seed=seed)
        runs.append(BenchReadings(made.signals, plan.azimuth, plan.inclination, plan.toolface))
    found = calibrate_joint(runs[0], rig_sd=np.array([sd] * 3), name="T")
    verdict = verify(runs[1], found)
    calibration = {
        "tool_json": plain_content(found),
        "method": found.method,
        "capability_deg": expected_table(found),
        "summary": {"parameters": [[name, *pair] for name, pair in parameters(found.tool).items()]},
    }
    verified = {
        "verdict": verdict.verdict,
        "limits": None,
        "report": judged_positions(verdict),
        "readings": [],
    }
    reading = {
        "dial_deg": [0.0, 90.0, 0.0],
        "channels": {kind: values[0].tolist() for kind, values in runs[0].channels.items()},
        "count": 20,
        "captured": "key",
    }
    return {"calibration": calibration, "verification": verified, "reading": reading}


def fill(ledger: Ledger, readings: int, calibrations: int) -> None:
    """Tools, and their sessions with readings, calibration and closing event."""
    bodies = _bodies()
    registry.put_rig(ledger, registry.RegisteredRig("stand", (0.001, 0.001, 0.001)), author=AUTHOR)
    serials = [f"T-{number:04d}" for number in range(TOOLS)]
    for serial in serials:
        registry.put_tool(ledger, registry.RegisteredTool(serial, "steering tool", interval_months=12), author=AUTHOR)
    each = max(1, readings // max(calibrations, 1))
    plan = {"name": "orthogonal", "positions_deg": [[0.0, 90.0, 0.0]] * 24}
    for start in range(0, calibrations, 100):
        numbers = range(start, min(start + 100, calibrations))
        owners = [BUSY if number % 10 == 0 else serials[number % TOOLS] for number in numbers]
        opened = [
            Draft("session", {"serial": serial, "purpose": "calibrate"}, {"plan": plan, "rig": "stand"})
            for serial in owners
        ]
        sessions = [record.id for record in ledger.append_all(opened, author=AUTHOR)]
        places = [(session, place) for session in sessions for place in range(each)]
        taken = [
            Draft("reading", {"session": one, "position": n % 24 + 1, "attempt": n // 24 + 1}, bodies["reading"])
            for one, n in places
        ]
        ids = [record.id for record in ledger.append_all(taken, author=AUTHOR)]
        ended = []
        for place, (session, serial) in enumerate(zip(sessions, owners, strict=True)):
            body = {**bodies["calibration"], "readings": ids[place * each : (place + 1) * each][:24]}
            ended.append(Draft("calibration", {"serial": serial, "session": session}, body))
            ended.append(Draft("event", {"subject_kind": "session", "subject": session, "action": "finished"}, {}))
        ledger.append_all(ended, author=AUTHOR)


def _finished(ledger: Ledger, bodies: dict[str, Any]) -> dict[str, str]:
    """Some verifications, the newest session and calibration of the busy tool."""
    calibration = ledger.find("calibration", serial=BUSY, newest=True, limit=1)[0]
    draft = Draft("verification", {"serial": BUSY, "calibration": calibration.id}, bodies["verification"])
    made = ledger.append_all([draft] * 200, author=AUTHOR)
    return {"calibration": calibration.id, "verification": made[-1].id, "session": calibration.keys["session"]}


def _places(ids: dict[str, str]) -> dict[str, str]:
    api = "/api/v1"
    return {
        "home": "/",
        "tools": "/tools",
        "tools, from the middle": "/tools?after=T-0500",
        "tool with 1000 calibrations": f"/tools/{BUSY}",
        "tool": "/tools/T-0501",
        "result": f"/results/{ids['calibration']}",
        "verify": f"/verify?calibration={ids['calibration']}",
        "verification": f"/verifications/{ids['verification']}",
        "certificates": "/certificates",
        "certificate, new": f"/certificates/new?calibration={ids['calibration']}",
        "ledger, events": "/ledger",
        "ledger, readings": "/ledger?kind=reading",
        "ledger, search": f"/ledger?kind=reading&key={ids['session']}",
        "import": "/import",
        "calibrate": "/calibrate",
        "api tools": f"{api}/tools",
        "api sessions": f"{api}/sessions",
        "api calibrations": f"{api}/calibrations",
        "api verifications": f"{api}/verifications",
        "api history": f"{api}/tools/{BUSY}/history",
        "api certificates": f"{api}/certificates",
        "api records": f"{api}/ledger/records/reading",
        "api head": f"{api}/ledger/head",
        "csv tools": f"{api}/tables/tools.csv",
    }


def run(*, readings: int = 1_000_000, calibrations: int = 10_000, ledger: str | None = None) -> dict[str, Any]:
    """Fill a ledger, serve it, ask for everything."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(ledger) if ledger else Path(folder, "ledger.sqlite")
        known, began = path.exists(), time.perf_counter()
        with create(path) as store:
            if not known:
                fill(store, readings, calibrations)
            ids = _finished(store, _bodies())
            records = {kind: store.count(kind) for kind in ("reading", "calibration", "session", "tool")}
        filled = time.perf_counter() - began
        server = subprocess.Popen([sys.executable, "-c", SERVE, str(path)], stdout=subprocess.PIPE, text=True)
        try:
            port = int((server.stdout.readline() if server.stdout else "").strip())
            with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=120.0, trust_env=False) as client:
                client.get("/static/bench.css")
                times = {name: _timed(client, place) for name, place in _places(ids).items()}
        finally:
            server.terminate()
            server.wait(20)
    worst = max(times, key=lambda name: times[name]["median_s"])
    slowest = {"worst": worst, "worst_median_s": times[worst]["median_s"]}
    passed = times[worst]["median_s"] < LIMIT_S
    return {"records": records, "filled_s": filled, "pages": times, **slowest, "passed": passed}


def _timed(client: httpx.Client, place: str) -> dict[str, float]:
    seconds = []
    for _ in range(ROUNDS + 1):
        began = time.perf_counter()
        answer = client.get(place)
        seconds.append(time.perf_counter() - began)
        if answer.status_code != 200:
            raise RuntimeError(f"{place}: {answer.status_code} {answer.text[:300]}")
    return {"first_s": seconds[0], "median_s": statistics.median(seconds[1:])}


def report(found: dict[str, Any]) -> None:
    """Print what was measured."""
    lines = [f"records: {found['records']}, filled in {found['filled_s']:.0f} s"]
    lines += [f"{name:32s} {t['median_s']:7.3f} s   first {t['first_s']:7.3f} s" for name, t in found["pages"].items()]
    lines.append(f"slowest: {found['worst']} {found['worst_median_s']:.3f} s (wanted < {LIMIT_S} s)")
    print("\n".join(lines))


if __name__ == "__main__":
    command(__doc__, run, report)

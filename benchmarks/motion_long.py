"""A run of any length through `inclinometry dynamic`: peak memory and rate, Parquet and CSV.

    python -m benchmarks.motion_long [--samples 1e7] [--csv 1e6] [--method auto] [--keep FOLDER]

The run is simulated block by block straight into a file; the command then runs in a process of its own, whose peak
resident memory is what the system counted. 1e7 samples at 200 Hz are 14 hours, 1e8 are six days.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
import time
from pathlib import Path

from benchmarks import command
from inclinometry.workflow.simulate_drilling import DrillingRequest, site_text, write_drilling

SCENARIO = "stick-slip"
MOST_MB = 1000.0


def run(samples: float = 1e7, csv: float = 1e6, method: str = "auto", keep: str | None = None) -> dict[str, object]:
    """Simulate, reduce, and say how much memory and time it took; `keep`: folder where files are left and found."""
    if keep is not None:
        return _run(samples, csv, method, Path(keep))
    with tempfile.TemporaryDirectory() as scratch:
        return _run(samples, csv, method, Path(scratch))


def _run(samples: float, csv: float, method: str, folder: Path) -> dict[str, object]:
    found: dict[str, object] = {"scenario": SCENARIO, "method": method, "most_mb": MOST_MB}
    for ending, count in (("parquet", samples), ("csv", csv)):
        if count:
            found[ending] = _measured(folder, ending, count, method)
    return found


def _measured(folder: Path, ending: str, samples: float, method: str) -> dict[str, float]:
    request = DrillingRequest(SCENARIO, 1)
    interval = request.chosen.instrument.interval
    request = DrillingRequest(SCENARIO, 1, duration=samples * interval)
    path = folder / f"run.{ending}"
    start = time.perf_counter()
    count = path.exists() or write_drilling(request, path)
    simulated = time.perf_counter() - start
    (folder / "site.toml").write_text(site_text(request.chosen.hole), encoding="utf-8")
    words = ["dynamic", str(path), "--site", str(folder / "site.toml"), "--method", method, "--json"]
    words += ["-o", str(folder / "attitude.parquet"), "--report", str(folder / "dynamic.html")]
    seconds, peak, printed = _watched(words, folder / "said.json")
    said = json.loads(re.sub(r"^[^{]*", "", printed))
    return {
        "samples": said["samples"],
        "file_mb": path.stat().st_size / 1e6,
        "simulated_per_s": count / simulated if simulated > 1.0 else float("nan"),
        "seconds": seconds,
        "samples_per_s": said["samples"] / seconds,
        "peak_mb": peak,
        "windows": said["windows"],
        "refused": said["refused"],
    }


def _watched(words: list[str], out: Path) -> tuple[float, float, str]:
    """Seconds, peak resident memory (MB) and output of the command in a process of its own."""
    start = time.perf_counter()
    child = os.fork()
    if child == 0:
        with out.open("wb") as stream:
            os.dup2(stream.fileno(), 1)
        os.execv(sys.executable, [sys.executable, "-m", "inclinometry", *words])
    _, status, usage = os.wait4(child, 0)
    if status:
        raise SystemExit(f"the command ended with status {os.waitstatus_to_exitcode(status)}")
    # kilobytes on Linux, bytes on macOS
    return time.perf_counter() - start, usage.ru_maxrss / (1e3 if sys.platform != "darwin" else 1e6), out.read_text()


def report(found: dict[str, object]) -> None:
    """Print the figures."""
    print(f"scenario {found['scenario']}, method {found['method']}, one process")
    for ending in ("parquet", "csv"):
        each = found.get(ending)
        if isinstance(each, dict):
            print(
                f"{ending:8s} {each['samples']:.3g} samples ({each['file_mb']:.0f} MB): {each['seconds']:.1f} s, "
                f"{each['samples_per_s'] / 1e6:.3f} M samples/s, peak {each['peak_mb']:.0f} MB "
                f"(wanted < {found['most_mb']:.0f}), {each['windows']} windows, {each['refused']} refused"
            )
            if each["peak_mb"] > MOST_MB:
                raise SystemExit(f"more than {MOST_MB:.0f} MB were needed")


if __name__ == "__main__":
    command(__doc__, run, report)

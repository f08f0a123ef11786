"""Time of a certificate: record, PDF/A and digital certificate of a tool verified at 12 and at 480 positions.

    python -m benchmarks.certificate_pdf [--json] [--rounds 7]

The first certificate of a process also loads the libraries that draw and set it; it is measured in a fresh process.
"""

from __future__ import annotations

import datetime
import statistics
import subprocess
import sys
import time

import numpy as np

from benchmarks import command
from inclinometry.calibration import plans
from inclinometry.calibration.conformity import verify
from inclinometry.calibration.decision import Limits
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.files.verification_json import judged_positions as positions
from inclinometry.files.verification_json import stated_limits
from inclinometry.laboratory.certificate.dcc import dcc_bytes
from inclinometry.laboratory.certificate.laboratory import Laboratory, Order
from inclinometry.laboratory.certificate.pdf import certificate_pdf
from inclinometry.laboratory.certificate.record import certificate_record
from inclinometry.laboratory.verification import protocols
from inclinometry.simulate.bench import (
    Rig,
    simulate_bench,
)
from inclinometry.simulate.tool import realistic_tool

WANTED = {"seconds": 2.0}
SD = float(np.radians(0.05))
LABORATORY = Laboratory("Laboratory", "Street 1", "NO", authoriser="Anna")
DAY = datetime.date(2026, 5, 4)
ORDER = Order(customer="Customer", item="tool", serial="7", performed_from=DAY, issued=DAY)


def readings(plan: plans.Plan, seed: int) -> BenchReadings:
    """A simulated tool on a simulated stand."""
    dials = (plan.azimuth, plan.inclination, plan.toolface)
    seen = simulate_bench(
        realistic_tool(7), Rig(dip=float(np.radians(70.0)), setting_sd=(SD, SD, SD)), *dials, seed=seed
    )
    return BenchReadings(seen.signals, *dials, units=seen.units, reference=seen.reference)


def parts(plan: plans.Plan) -> dict[str, float]:
    """Seconds of record, PDF and DCC, and the size of the PDF, for a verification at the positions of a plan."""
    calibration = calibrate_joint(readings(plans.orthogonal(), 1), rig_sd=SD, name="7")
    limits = Limits("wide", "none", 0.02, 0.05, 0.05, 0.08)
    found = verify(readings(plan, 2), calibration, limits)
    seen = {"verdict": found.verdict, "limits": stated_limits(limits), "report": positions(found)}
    times = [time.perf_counter()]
    record = certificate_record(
        calibration,
        LABORATORY,
        ORDER,
        number="2026-0001",
        program="inclinometry",
        verification=seen,
        accept_warnings="wide limits",
    )
    times.append(time.perf_counter())
    pdf = certificate_pdf(record)
    times.append(time.perf_counter())
    dcc_bytes(record)
    times.append(time.perf_counter())
    record_s, pdf_s, dcc_s = np.diff(times).tolist()
    return {"record": record_s, "pdf": pdf_s, "dcc": dcc_s, "total": sum((record_s, pdf_s, dcc_s)), "bytes": len(pdf)}


def first() -> float:
    """Seconds of the first certificate of a process, its libraries included."""
    code = "from benchmarks.certificate_pdf import parts, plans; print(parts(plans.twelve())['total'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout)


def run(rounds: int = 7) -> dict:
    """Everything this benchmark measures: medians of rounds after one that warms up."""
    cases = {"12 positions": plans.twelve(), "480 positions": protocols()["long"]}
    result: dict = {"first_s": statistics.median(first() for _ in range(3)), "cases": {}}
    for name, plan in cases.items():
        seen = [parts(plan) for _ in range(rounds + 1)][1:]
        result["cases"][name] = {key: statistics.median(row[key] for row in seen) for key in seen[0]}
    slowest = max(result["first_s"], *(case["total"] for case in result["cases"].values()))
    result["fulfilled"] = {"seconds": slowest < WANTED["seconds"]}
    return result


def report(result: dict) -> None:
    """Print the table."""
    print("certificate: record + PDF/A + digital certificate, one core, medians")
    print(f"  first of a process     {result['first_s']:.2f} s")
    for name, case in result["cases"].items():
        said = ", ".join(f"{key} {1e3 * case[key]:.0f} ms" for key in ("record", "pdf", "dcc"))
        print(f"  verified at {name:13s} {case['total']:.2f} s ({said}; PDF {case['bytes'] / 1e3:.0f} kB)")
    print(f"  wanted: below {WANTED['seconds']:g} s: {'yes' if result['fulfilled']['seconds'] else 'NO'}")


if __name__ == "__main__":
    command(__doc__, run, report)

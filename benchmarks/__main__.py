"""Run every benchmark, print its tables, and write the figures that docs/figures.md quotes.

    python -m benchmarks [--quick] [--only NAME ...]

Results go to bench-output/NAME.json; the table in docs/figures.md between its bench markers is rewritten from them.
"""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path

from benchmarks import figures, stand
from benchmarks.measure import rewrite

NAMES = (
    "kernel", "closed_forms", "joint", "stand", "conventions", "design", "real_data", "gyro_schemes", "gyro", "path",
    "msa", "position", "certificate", "motion", "honest_drilling", "motion_findings", "motion_robust",
    "motion_speed",
)  # fmt: skip
DRAWS = {"closed_forms": 500, "joint": 800, "stand": 40, "conventions": 3000, "gyro": 600}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the draws, docs/figures.md left alone")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES, help="these alone; other figures stay")
    options = parser.parse_args()
    folder = Path("bench-output")
    folder.mkdir(exist_ok=True)
    results = {}
    for name in options.only:
        print(f"\n== {name} ==", flush=True)
        module = importlib.import_module(f"benchmarks.{name}")
        known = {"draws": DRAWS[name] // (10 if options.quick else 1)} if name in DRAWS else {}
        results[name] = module.run(**known)
        module.report(results[name])
        (folder / f"{name}.json").write_text(json.dumps(results[name], indent=1) + "\n", encoding="utf-8")
    if not options.quick:
        figures.update(results, Path("docs/figures.md"))
        if "stand" in results:
            rewrite(Path("docs/methods/identification.md"), "benchmarks/stand", stand.lines(results["stand"]))


if __name__ == "__main__":
    main()

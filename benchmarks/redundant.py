"""Four accelerometers, one of them off: whether it is named, and what inclination is then.

    python -m benchmarks.redundant [--runs N] [--json]

A tool with noise of 0.3 mg and 50 nT, calibrated at 24 positions, surveys 12 stations; one accelerometer has moved
since. `named`, `wrong`, `open`: shares of runs where it, another or none of the four is named. `error`, `u`: of
inclination, root mean squares, deg; `coverage` of 1.96 u; `before`: error with all four sensors.
"""

from __future__ import annotations

import numpy as np

from benchmarks import command
from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.orientation import angles, fields
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import random_tool
from inclinometry.survey.reduce import reduce_survey

STATIONS, DIP = 12, np.radians(70.0)
NOISE = {"accelerometer": 0.003, "magnetometer": 50.0}
CASES = {"right": 0.0, "right, noise 2 times as large": 0.0, "5 mg off": 0.049, "20 mg off": 0.196, "100 mg off": 0.98}


def run(runs: int = 60) -> dict:
    """By case: shares of runs, and root mean squares."""
    results = {}
    tools = [random_tool(seed, sensors={"accelerometer": 4, "magnetometer": 3}, bits=None) for seed in range(runs)]
    plan, records = plans.orthogonal(), []
    for seed, tool in enumerate(tools):
        bench = simulate_bench(
            tool, Rig(dip=DIP), plan.azimuth, plan.inclination, plan.toolface, seed=seed, noise=NOISE
        )
        readings = BenchReadings(
            bench.signals,
            bench.azimuth,
            bench.inclination,
            bench.toolface,
            units=bench.units,
            reference=bench.reference,
        )
        records.append(calibrate_joint(readings))
    for case, off in CASES.items():
        rows = []
        for seed, (tool, record) in enumerate(zip(tools, records, strict=True)):
            rng = np.random.default_rng([seed, 7])
            inclination, sensor = np.radians(rng.uniform(5.0, 90.0, STATIONS)), int(rng.integers(4))
            azimuth, toolface = rng.uniform(0.0, 6.28, (2, STATIONS))
            true = dict(zip(NOISE, fields(azimuth, inclination, toolface, DIP), strict=True))
            signals = {kind: tool.triads[kind].signals(field) for kind, field in true.items()}
            size = 2.0 if "noise" in case else 1.0
            signals = {kind: each + size * NOISE[kind] * rng.normal(size=each.shape) for kind, each in signals.items()}
            signals["accelerometer"][:, sensor] += off
            found = reduce_survey(30.0 * np.arange(STATIONS), signals, record.tool)
            said = [one.values.get("sensor", "") for one in found.findings if one.code.startswith("sensor-parity")]
            plain = angles(*(record.tool.triads[kind].field(signals[kind]) for kind in NOISE)).inclination
            error, before = np.degrees(found.inclination - inclination), np.degrees(plain - inclination)
            u = np.degrees(found.u_inclination)
            right = said == [str(sensor + 1)]
            rows.append([
                right, bool(said) and not right and said != [""], said == [""], np.mean(error**2), np.mean(u**2),
                np.mean(np.abs(error) < 1.96 * u), np.mean(before**2),
            ])  # fmt: skip
        mean = np.mean(np.array(rows, dtype=float), axis=0)
        mean[[3, 4, 6]] = np.sqrt(mean[[3, 4, 6]])
        results[case] = dict(zip(("named", "wrong", "open", "error", "u", "coverage", "before"), mean, strict=True))
    return results


def report(result: dict) -> None:
    """One row a case."""
    print(f"{'sensor':32}" + "".join(f"{name:>10}" for name in next(iter(result.values()))))
    for case, row in result.items():
        print(f"{case:32}" + "".join(f"{value:10.3f}" for value in row.values()))


if __name__ == "__main__":
    command(__doc__, run, report)

"""A fleet: throughput of one core beside other engines, planning and committing of many files, kills, flipped bits.

    python -m benchmarks.fleet [--files 4] [--rounds 20] [--page docs/methods/fleet.md]

Processor seconds and ratios inside one run are what counts; peers that are not installed are left out. What 10^11
samples would take follows from the rates measured.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import command
from benchmarks.measure import rewrite
from inclinometry.digest import digest_bytes
from inclinometry.files.json_codec import canonical
from inclinometry.files.tool_json import calibration_content
from inclinometry.fleet import audit, raw
from inclinometry.fleet.plan import Plan, table
from inclinometry.fleet.store import Store
from inclinometry.fleet.task import Task, key
from inclinometry.fleet.task import run as do
from inclinometry.fleet.work import carry_out
from inclinometry.orientation import fields
from inclinometry.simulate.tool import realistic_tool

ROWS = 1 << 21
PRODUCTS = ("angles", "windows")


def content() -> dict[str, Any]:
    """A calibrated tool."""
    import inclinometry as im
    from inclinometry.calibration.readings import BenchReadings
    from inclinometry.simulate.bench import Rig, simulate_bench

    plan = im.plans.twelve()
    dials = plan.azimuth, plan.inclination, plan.toolface
    bench = simulate_bench(realistic_tool(1), Rig(np.radians(70.0), setting_sd=0.002), *dials, seed=1)
    readings = BenchReadings(bench.signals, *dials, units=bench.units)
    return json.loads(canonical(calibration_content(im.calibrate_joint(readings))))


def counts(rows: int, seed: int) -> dict[str, Any]:
    """Counts of a tool that moves and is noisy."""
    rng = np.random.default_rng(seed)
    tool, time_s = realistic_tool(1), np.arange(rows) * 0.01
    wave = np.radians(45.0 + 30.0 * np.sin(time_s / 300.0))
    g, b = fields(np.radians(30.0) + 0 * wave, wave, np.radians(10.0) + 0 * wave, np.radians(70.0))
    found = {"time_s": time_s}
    for kind, prefix, field in (("accelerometer", "accel", g), ("magnetometer", "mag", b)):
        u = np.rint(tool.triads[kind].signals(field) + rng.normal(0.0, 20.0, (rows, 3)))
        found |= {f"{prefix}_{axis}": u[:, k] for k, axis in enumerate("xyz")}
    return found


def filled(folder: Path, files: int, rows: int) -> list[raw.Raw]:
    """A fleet of one file a tool."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    store, added = Store(str(folder)), []
    for k in range(files):
        pq.write_table(pa.table(counts(rows, k)), folder.parent / "run.parquet")
        added += raw.add(store, folder.parent / "run.parquet", raw.About(f"IN-{k}", "R", date(2026, 1, 1)), {})
    raw.record(store, added)
    return added


def tasks(folder: Path, runs: list[raw.Raw], product: str, made: dict[str, Any]) -> list[Task]:
    """What a plan asks for, without a ledger."""
    calibration, width = digest_bytes(canonical(made)), 10**9 if product == "windows" else 0
    found = []
    for one in runs:
        name = key(one.digest, calibration, product, width)
        footer = {"product": product, "input": one.digest, "calibration": calibration, "key": name}
        footer |= {"certificate": "", "code": ""}
        target = f"{product}/{one.name.partition('/')[2].rpartition('/')[0]}/part-{name}.parquet"
        found.append(Task(str(folder), one.name, target, product, width, footer, made, one.size))
    return found


def speed(folder: Path, runs: list[raw.Raw], made: dict[str, Any]) -> tuple[dict[str, float], dict[str, float]]:
    """Millions of samples a second of processor time, one core, checksums on; bytes a sample of counts and products."""
    samples, found = sum(one.rows for one in runs), {}
    size = {"counts": sum(one.size for one in runs) / samples}
    for product in PRODUCTS:
        best = np.inf
        for _ in range(4):
            shutil.rmtree(folder / product, ignore_errors=True)
            begun = time.process_time()
            for task in tasks(folder, runs, product, made):
                assert not do(task).problem
            best = min(best, time.process_time() - begun)
        found[f"ours, {product}"] = samples / best / 1e6
        size[product] = sum(one.stat().st_size for one in (folder / product).rglob("*.parquet")) / samples
    peers: dict[str, Callable[[], None]] = {"float32, zstd, whole groups": lambda: _first_plan(folder, runs, made)}
    peers |= {"polars": lambda: _polars(folder, made), "DuckDB": lambda: _duckdb(folder, made)}
    peers["dask.dataframe, our kernel"] = lambda: _dask_dataframe(folder, runs, made)
    for name, peer in peers.items():
        try:
            best = np.inf
            for _ in range(2):
                begun = time.process_time()
                peer()
                best = min(best, time.process_time() - begun)
            found[name] = samples / best / 1e6
        except ImportError:
            print(f"  {name} is not installed")
    return found, size


def _first_plan(folder: Path, runs: list[raw.Raw], made: dict[str, Any]) -> None:
    """float32 in zstd, whole row groups, blocked float64: what the package did before."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from inclinometry.channels import angles_from_channels
    from inclinometry.files.tool_json import calibration_from

    tool = calibration_from(dict(made), "").tool
    g, b = tool.triads["accelerometer"], tool.triads["magnetometer"]
    for one in runs:
        old = folder.parent / "old.parquet"
        if not old.exists():
            source = pq.read_table(folder / one.name)
            floats = pa.table(
                {n: source.column(n).cast("float32" if n != "time_ns" else "int64") for n in source.column_names}
            )
            pq.write_table(floats, old, compression="zstd", compression_level=1, use_dictionary=False,
                           use_byte_stream_split=floats.column_names[1:], row_group_size=1 << 20)  # fmt: skip
        source = pq.ParquetFile(old)
        schema = pa.schema(
            [("time_ns", pa.int64()), *((f"{n}_deg", pa.float32()) for n in ("inclination", "azimuth", "toolface"))]
        )
        with pq.ParquetWriter(folder.parent / "new.parquet", schema, compression="zstd",
                              compression_level=1, use_dictionary=False,
                              use_byte_stream_split=schema.names[1:]) as writer:  # fmt: skip
            for group in range(source.num_row_groups):
                part = source.read_row_group(group)
                channels = tuple(part.column(n).to_numpy().astype(np.float64) for n in part.column_names[1:7])
                angle = angles_from_channels(channels, g.inverse(), g.offset[0], b.inverse(), b.offset[0], threads=1)
                columns = [part.column("time_ns"), *(pa.array(np.degrees(v).astype(np.float32)) for v in angle)]
                writer.write_table(pa.Table.from_arrays(columns, schema=schema))


def _formulas(made: dict[str, Any]) -> list[list[tuple[float, str, float]]]:
    """Each field of the counts as a sum of (weight, channel, offset)."""
    found = []
    for kind, prefix in (("accelerometer", "accel"), ("magnetometer", "mag")):
        entry = made["triads"][kind]
        names = [f"{prefix}_{axis}" for axis in "xyz"]
        for row in np.linalg.inv(np.array(entry["tensor"])).tolist():
            found.append([(w, n, float(o)) for w, n, o in zip(row, names, entry["offset"], strict=True)])
    return found


def _polars(folder: Path, made: dict[str, Any]) -> None:
    import polars as pl

    fields = [
        pl.sum_horizontal(w * (pl.col(n).cast(pl.Float64) - o) for w, n, o in terms).alias(name)
        for terms, name in zip(_formulas(made), ("g0", "g1", "g2", "b0", "b1", "b2"), strict=True)
    ]
    frame = pl.scan_parquet(f"{folder}/raw/tool=*/**/*.parquet").select(pl.col("time_ns"), *fields)
    x, y, z, p, q, r = (pl.col(n) for n in ("g0", "g1", "g2", "b0", "b1", "b2"))
    level = x * x + y * y
    turn = 2.0 * np.pi
    frame.select(
        pl.col("time_ns"),
        pl.arctan2(level.sqrt(), z).degrees().cast(pl.Float32).alias("inclination_deg"),
        (pl.arctan2((x * q - y * p) * (level + z * z).sqrt(), r * level - z * (x * p + y * q)) % turn)
        .degrees()
        .cast(pl.Float32)
        .alias("azimuth_deg"),
        (pl.arctan2(y, -x) % turn).degrees().cast(pl.Float32).alias("toolface_deg"),
    ).sink_parquet(folder.parent / "polars.parquet", compression="lz4")


def _duckdb(folder: Path, made: dict[str, Any]) -> None:
    import duckdb

    # a number without an exponent is a decimal there, and slow
    names = [
        f"{' + '.join(f'({w:.17e}) * ({n}::double - ({o:.17e}))' for w, n, o in terms)} as {name}"
        for terms, name in zip(_formulas(made), ("x", "y", "z", "p", "q", "r"), strict=True)
    ]
    with duckdb.connect() as connection:
        connection.execute("set threads to 1")
        connection.execute(
            f"copy (select time_ns, degrees(atan2(sqrt(x*x+y*y), z))::float as inclination_deg, "
            f"degrees(atan2((x*q-y*p)*sqrt(x*x+y*y+z*z), r*(x*x+y*y)-z*(x*p+y*q)))::float as azimuth_deg, "
            f"degrees(atan2(y, -x))::float as toolface_deg from (select time_ns, {', '.join(names)} "
            f"from read_parquet('{folder}/raw/tool=*/**/*.parquet'))) to '{folder.parent}/duck.parquet' "
            "(format parquet, codec lz4)"
        )


def _dask_dataframe(folder: Path, runs: list[raw.Raw], made: dict[str, Any]) -> None:
    """A data frame a file, mapped by the compiled kernel, in one thread."""
    import dask
    import dask.dataframe as dd
    import pandas as pd

    from inclinometry.channels import angles_from_channels
    from inclinometry.files.tool_json import calibration_from

    tool = calibration_from(dict(made), "").tool
    g, b = tool.triads["accelerometer"], tool.triads["magnetometer"]
    names = [f"{n}_deg" for n in ("inclination", "azimuth", "toolface")]
    channels = [f"{kind}_{axis}" for kind in ("accel", "mag") for axis in "xyz"]

    def mapped(part: pd.DataFrame) -> pd.DataFrame:
        signals = tuple(part[n].to_numpy(np.float64) for n in channels)
        angle = angles_from_channels(signals, g.inverse(), g.offset[0], b.inverse(), b.offset[0], threads=1)
        columns = {n: np.degrees(v).astype(np.float32) for n, v in zip(names, angle, strict=True)}
        return pd.DataFrame({"time_ns": part["time_ns"], **columns})

    meta = pd.DataFrame({"time_ns": np.empty(0, np.int64), **{n: np.empty(0, np.float32) for n in names}})
    with dask.config.set(scheduler="synchronous"):
        frame = dd.read_parquet([str(folder / one.name) for one in runs], columns=["time_ns", *channels])
        frame.map_partitions(mapped, meta=meta).to_parquet(
            folder.parent / "frames", compression="lz4", write_index=False
        )


CORE_HOUR, GIGABYTE_MONTH = 0.05, 0.025
"""Prices assumed, of rented computers and object stores, in a currency of one's own."""


def on_paper(rates: dict[str, float], size: dict[str, float], samples: float = 1e11) -> dict[str, dict[str, float]]:
    """What many samples take on two cores at the rates measured; prices are assumed."""
    found = {}
    for product in PRODUCTS:
        seconds = samples / (2e6 * rates[f"ours, {product}"])
        read, written = samples * size["counts"], samples * size[product]
        found[product] = {
            "hours on two cores": seconds / 3600.0,
            "read, TB": read / 1e12,
            "written, TB": written / 1e12,
            "disk, MB/s": (read + written) / seconds / 1e6,
            f"cores, at {CORE_HOUR:g} an hour": 2.0 * seconds / 3600.0 * CORE_HOUR,
            f"a month of storage, at {GIGABYTE_MONTH:g} a GB": (read + written) / 1e9 * GIGABYTE_MONTH,
        }
    return found


def speed_lines(rates: dict[str, float], size: dict[str, float]) -> list[str]:
    """Tables of the methods' page."""
    ours = rates["ours, angles"]
    lines = ["| one core, page checksums on | million samples a second | processor time |", "|---|---|---|"]
    for name, rate in rates.items():
        times = "" if name == "ours, windows" else f"× {ours / rate:.1f}"
        lines.append(f"| {name} | {rate:.1f} | {times} |")
    paper = on_paper(rates, size)
    lines += ["", f"| 10^11 samples | {' | '.join(paper)} |", f"|---|{'---|' * len(paper)}"]
    for what in paper["angles"]:
        lines.append(f"| {what} | {' | '.join(f'{column[what]:.3g}' for column in paper.values())} |")
    return lines


def kill_lines(found: dict[str, dict[str, int]]) -> list[str]:
    """Table of the methods' page."""
    columns = next(iter(found.values()))
    lines = [f"| way | {' | '.join(columns)} |", f"|---|{'---|' * len(columns)}"]
    return lines + [f"| {way} | {' | '.join(map(str, row.values()))} |" for way, row in found.items()]


def bookkeeping(folder: Path, files: int = 50_000) -> dict[str, float]:
    """Seconds to commit, list and replace names of many files."""
    store = Store(str(folder))
    current = table(store, "windows")
    names = {f"windows/tool=T{k // 50}/run=R{k % 50}/date=2026-01-01/part-{k:020x}.parquet": k for k in range(files)}
    added = {n: (1000, 10, (f"T{k // 50}", f"R{k % 50}", "2026-01-01"), f"{k:064x}") for n, k in names.items()}
    begun = time.perf_counter()
    current.commit(added, (), {})
    commit = time.perf_counter() - begun
    again = table(store, "windows")
    begun = time.perf_counter()
    assert len(again.paths()) == files
    listing = time.perf_counter() - begun
    gone = [n for n in names if "tool=T7/" in n]
    begun = time.perf_counter()
    again.commit({n.replace("part-", "part-f"): added[n] for n in gone}, gone, {})
    return {"commit": commit, "list": listing, "replace one tool": time.perf_counter() - begun}


DRIVER = """
import pickle, sys
from inclinometry.fleet import workers
from inclinometry.fleet.plan import Plan, table
from inclinometry.fleet.store import Store
from inclinometry.fleet.work import carry_out
if __name__ == "__main__":
    todo, way = pickle.load(open(sys.argv[1], "rb")), sys.argv[2]
    there = table(Store(todo.todo[0].address), todo.product).paths()
    todo = todo._replace(todo=tuple(t for t in todo.todo if t.target not in there))
    made = workers.by_processes(todo.todo, 2) if way == "lanes" else workers.by_dask(todo.todo, workers.connect(way))
    done = carry_out(Store(sys.argv[3]), todo, made, every=0.5)
    sys.exit(1 if done.problems else 0)
"""


class Victims:
    """Kills of one round: workers and a driver at random progress, counted in results that have their names."""

    def __init__(self, rng: random.Random, results: int) -> None:
        kinds = ["driver", "worker", "worker", rng.choice(("driver", "worker"))][: rng.choice((3, 4))]
        rng.shuffle(kinds)
        self.waiting = list(zip(kinds, sorted(rng.sample(range(results - 4), len(kinds))), strict=True))
        self.killed: list[str] = []
        self._rng = rng

    def meet(self, driver: subprocess.Popen[bytes], above: int, made: Callable[[], int]) -> None:
        """Kill what is due while a driver runs; workers are below the process `above`."""
        while self.waiting and driver.poll() is None:
            (kind, due), there = self.waiting[0], made()
            pids = [driver.pid] if kind == "driver" else _children(above)
            if there < due or not pids:
                time.sleep(0.002)
                continue
            try:
                os.kill(self._rng.choice(pids), signal.SIGKILL)
            except ProcessLookupError:
                continue
            self.killed.append(f"{kind} at {there}")
            del self.waiting[0]


def kills(folder: Path, runs: list[raw.Raw], made: dict[str, Any], rounds: int, way: str) -> dict[str, int]:
    """Rounds in which workers and drivers are killed at random; whether the table is that of an undisturbed run."""
    import pickle

    todo = Plan("windows", 10**9, tuple(tasks(folder, runs, "windows", made)), {}, 0, ())
    (folder.parent / "plan").write_bytes(pickle.dumps(todo))
    (folder.parent / "driver.py").write_text(DRIVER)
    shutil.rmtree(folder / "windows", ignore_errors=True)
    carry_out(Store(str(folder)), todo, map(do, todo.todo))
    right, rng = audit.digest(Store(str(folder)), "windows"), random.Random(1)
    cluster, address = None, "lanes"
    if way == "dask":
        cluster = subprocess.Popen([sys.executable, "-c", _CLUSTER], stdout=subprocess.PIPE, text=True)
        address = cluster.stdout.readline().strip()
    command = [sys.executable, str(folder.parent / "driver.py"), str(folder.parent / "plan"), address, str(folder)]
    targets = [folder / task.target for task in todo.todo]
    found = dict.fromkeys(("rounds", "equal", "with three kills or more", "workers killed", "drivers killed"), 0)
    for number in range(1, rounds + 1):
        shutil.rmtree(folder / "windows")
        victims, begun = Victims(rng, len(targets)), time.perf_counter()
        for _ in range(20):
            driver = subprocess.Popen(command)
            victims.meet(
                driver, driver.pid if cluster is None else cluster.pid, lambda: sum(t.exists() for t in targets)
            )
            if driver.wait() == 0:
                break
        equal = audit.digest(Store(str(folder)), "windows") == right
        found["rounds"] += 1
        found["equal"] += equal
        found["with three kills or more"] += len(victims.killed) >= 3
        for kind in ("worker", "driver"):
            found[f"{kind}s killed"] += sum(one.startswith(kind) for one in victims.killed)
        print(
            f"  {way} {number}: killed {', '.join(victims.killed)} of {len(targets)}; table "
            f"{'equal' if equal else 'NOT EQUAL'}, {time.perf_counter() - begun:.1f} s",
            flush=True,
        )
    if cluster is not None:
        cluster.terminate()
        cluster.wait()
    return found


# a nanny does not bring back a worker that is killed while it begins: this does, as a service of the system would
_CLUSTER = """
from distributed import LocalCluster
import subprocess, sys, time
if __name__ == "__main__":
    with LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=50) as cluster:
        address = cluster.scheduler_address
        print(address, flush=True)
        command = [sys.executable, "-m", "dask", "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        workers = []
        while True:
            workers = [one for one in workers if one.poll() is None]
            workers += [subprocess.Popen(command, **quiet) for _ in range(2 - len(workers))]
            time.sleep(0.2)
"""


def _children(pid: int) -> list[int]:
    """Worker processes below a process: those that have no child of their own."""
    import psutil

    try:
        below = psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []
    found = []
    for one in below:
        try:
            if "resource_tracker" not in " ".join(one.cmdline()) and not one.children():
                found.append(one.pid)
        except psutil.NoSuchProcess:
            continue
    return found


def flips(folder: Path, runs: list[raw.Raw], made: dict[str, Any], number: int = 200) -> dict[str, int]:
    """Single bits flipped in the stored values: found, harmless, read as wrong numbers."""
    import pyarrow.parquet as pq

    task = tasks(folder, runs[:1], "angles", made)[0]
    path, result = folder / task.raw, folder / task.target
    data, rng = path.read_bytes(), np.random.default_rng(2)
    result.unlink(missing_ok=True)
    do(task)
    right = result.read_bytes()
    group = pq.ParquetFile(path).metadata.row_group(0)
    found = harmless = wrong = 0
    for _ in range(number):
        column = group.column(int(rng.integers(1, 7)))
        place = column.data_page_offset + int(rng.integers(200, column.total_compressed_size))
        spoilt = bytearray(data)
        spoilt[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(spoilt)
        result.unlink(missing_ok=True)
        if do(task).problem:
            found += 1
        elif result.read_bytes() == right:
            harmless += 1
        else:
            wrong += 1
    path.write_bytes(data)
    return {"flips": number, "found": found, "harmless": harmless, "wrong numbers": wrong}


def run(files: int = 4, rounds: int = 20, page: str | None = None) -> None:
    """Measure and print; rounds of kills by lanes and by Dask, 0 leaves them out; tables of the page are rewritten."""
    made = content()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch, "fleet")
        folder.mkdir()
        runs = filled(folder, files, ROWS)
        lines = speed_lines(*speed(folder, runs, made))
        print("\n".join(lines), flush=True)
        if page:
            rewrite(Path(page), "fleet_speed", lines)
        print("bits flipped:", flips(folder, runs, made))
    with tempfile.TemporaryDirectory() as scratch:
        print("50,000 files, s:", {k: round(v, 2) for k, v in bookkeeping(Path(scratch)).items()})
    if not rounds:
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch, "fleet")
        folder.mkdir()
        runs = filled(folder, 40, 500_000)
        lines = kill_lines({way: kills(folder, runs, made, rounds, way) for way in ("lanes", "dask")})
        print("\n".join(lines), flush=True)
        if page:
            rewrite(Path(page), "fleet_kills", lines)


if __name__ == "__main__":
    command(__doc__, run, lambda _: None)

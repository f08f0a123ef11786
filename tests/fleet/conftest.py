"""A small fleet, made once: three tools, two runs each, a ledger with their certificates."""

from __future__ import annotations

import json
import shutil
from datetime import UTC, date, datetime
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import inclinometry as im
from inclinometry.calibration.readings import BenchReadings
from inclinometry.files.json_codec import canonical
from inclinometry.files.tool_json import calibration_content
from inclinometry.laboratory import certificates
from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.import_file import import_file
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.registry import RegisteredRig, RegisteredTool, put_rig, put_tool
from inclinometry.orientation import fields
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

pytest.importorskip("deltalake")
LABORATORY = Laboratory("Laboratory", "Somewhere", "NO")
TOOL = realistic_tool(1)
SAMPLES = 3000


def signals(seed: int, samples: int = SAMPLES) -> dict[str, np.ndarray]:
    """Counts of the tool that leans, turns slowly and shakes; and its angles, deg."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) * 0.01
    inclination, azimuth = np.radians(rng.uniform(5.0, 85.0)), np.radians(rng.uniform(0.0, 360.0))
    toolface = np.radians(rng.uniform(0.0, 360.0)) + 0.3 * time
    g, b = fields(azimuth, inclination, toolface, np.radians(70.0))
    found = {"time_s": time}
    for kind, prefix, field in (("accelerometer", "accel", g), ("magnetometer", "mag", b)):
        counts = np.rint(TOOL.triads[kind].signals(field) + rng.normal(0.0, 20.0, (samples, 3)))
        found |= {f"{prefix}_{axis}": counts[:, k] for k, axis in enumerate("xyz")}
    return found


def write_run(path: Path, columns: dict[str, np.ndarray]) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(columns), path)
    return path


@cache
def calibrated() -> bytes:
    """The tool.json of the one tool of which the fleet has several."""
    plan = im.plans.twelve()
    rig = Rig(np.radians(70.0), setting_sd=np.radians(0.1))
    bench = simulate_bench(TOOL, rig, plan.azimuth, plan.inclination, plan.toolface, seed=0)
    readings = BenchReadings(bench.signals, bench.azimuth, bench.inclination, bench.toolface, units=bench.units)
    return canonical(calibration_content(im.calibrate_joint(readings)))


def certify(ledger: Ledger, serial: str, drift: float, day: date) -> str:
    """Record and certify a calibration whose offset has drifted, counts; the number of the certificate."""
    content = json.loads(calibrated())
    content["triads"]["accelerometer"]["offset"][0] += drift
    record = import_file(ledger, canonical(content), serial, "stand", author="test", performed=day)
    made = certificates.issue(
        ledger, record.id, None, LABORATORY, author="test", now=datetime(2026, 6, 1, tzinfo=UTC),
        accept_warnings="simulated readings",
    )  # fmt: skip
    return str(made.keys["number"])


class Scene(NamedTuple):
    folder: Path

    @property
    def fleet(self) -> str:
        return str(self.folder / "fleet")

    def ledger(self) -> Ledger:
        return Ledger(self.folder / "lab.sqlite")

    def run(self, tool: str, run: str) -> Path:
        return next((self.folder / "fleet" / "raw" / f"tool={tool}" / f"run={run}").rglob("*.parquet"))


@pytest.fixture(scope="session")
def _scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    from inclinometry.fleet import raw
    from inclinometry.fleet.store import Store

    folder = tmp_path_factory.mktemp("fleet")
    with pytest.MonkeyPatch.context() as patch, create(folder / "lab.sqlite", sign=False) as ledger:
        patch.setattr(certificates, "certificate_pdf", lambda *_, **__: b"%PDF")  # its look is tested elsewhere
        put_rig(ledger, RegisteredRig("stand", (0.002, 0.002, 0.002)), author="test")
        store, added = Store(str(folder / "fleet")), []
        for k in range(3):
            serial = f"IN-{k + 1}"
            put_tool(ledger, RegisteredTool(serial, "tool"), author="test")
            certify(ledger, serial, float(k), date(2026, 1, 5))
            for run in ("R1", "R2"):
                path = write_run(
                    folder / "runs" / f"{serial}_{run}_2026-03-0{k + 1}.parquet",
                    signals(10 * k + len(added)),
                )
                what = raw.about(path, "{tool}_{run}_{date}", None, None, None)
                added += raw.add(store, path, what, {})
        raw.record(store, added)
    return Scene(folder)


@pytest.fixture
def scene(_scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Scene:
    """A copy to work in; certificates are issued without drawing them."""
    monkeypatch.setattr(certificates, "certificate_pdf", lambda *_, **__: b"%PDF")
    shutil.copytree(_scene.folder, tmp_path / "scene")
    return Scene(tmp_path / "scene")

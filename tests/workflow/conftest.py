"""Simulated gyro runs as files."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.files.gyro_csv import read_gyro_run, write_gyro_run
from inclinometry.workflow.simulate_gyro import gyro_run, write_gyro

DEG_H = np.radians(1.0) / 3600.0


@pytest.fixture
def simulated(tmp_path):
    """simulated(seed, ...): readings and truth of a run of 20 stations; `change` edits the columns before writing."""

    def make(seed=1, change=None, rows=slice(None), **request):
        run = gyro_run(seed, **{"stations": 20, "dwell": 400.0, "bias": DEG_H, **request})
        path = tmp_path / "raw.csv"
        if change is None:
            write_gyro(run, path)
            return read_gyro_run(path), run
        columns = {
            "station": [str(s) for s in run.station],
            "md": run.md,
            "index": run.index,
            "channels": {"accelerometer": run.accelerometer, "gyro": run.gyro},
            "letters": {"accelerometer": "xyz"[: request.get("axes", 2)], "gyro": "xyz"[: run.gyro.shape[1]]},
            "units": {"accelerometer": "m/s^2", "gyro": "rad/s"},
            "temperature": run.temperature,
            "time": run.time,
        }
        columns = {**columns, **change(columns)}
        write_gyro_run(path, **columns)
        return read_gyro_run(path), run

    return make

"""From a continuous log to bench readings: one row for each still interval, settings from a plan where there is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.stillness import StillIntervals, stations_from_log
from inclinometry.errors import FileError
from inclinometry.files.log_csv import read_log
from inclinometry.findings import Finding


def readings_of_log(
    path: str | Path,
    *,
    plan: Plan | None = None,
    window: float = 0.5,
    shortest: float = 1.0,
    progress: Callable[[int], None] | None = None,
) -> tuple[BenchReadings, StillIntervals]:
    """Still stations of a log; a plan (positions in order) must have as many as there are still intervals.

    window, shortest : s, over which stillness is judged, and the shortest rest that counts.
    """
    log = read_log(path, progress=progress)
    readings, found = stations_from_log(
        log.time, log.channels, temperature=log.temperature, units=log.units, window=window, shortest=shortest
    )
    readings = replace(readings, digest=log.digest, findings=(*log.findings, *readings.findings))
    if plan is None:
        return readings, found
    if len(plan) != len(readings):
        raise FileError(Finding("work-plan", {"rests": len(readings), "positions": len(plan)}), path=path)
    settings = {name: getattr(plan, name) for name in ("azimuth", "inclination", "toolface", "roll_set")}
    return replace(readings, **settings), found

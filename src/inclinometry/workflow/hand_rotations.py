"""From a log of a tool turned by hand between rests to its calibration."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.calibration.hand_rotations import HandRotations, calibrate_hand_rotations, hand_rotations_calibration
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.digest import digest_bytes
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, IdentifiabilityError, InputError, in_file, refused
from inclinometry.files.log_csv import Log, read_log
from inclinometry.files.profile import reading_with
from inclinometry.files.text import Progress
from inclinometry.findings import Finding, Value


def calibrate_log(
    path: str | Path,
    site: Site | None = None,
    *,
    gyro_log: str | Path | None = None,
    gyro_profile: str | None = None,
    specific_force: bool = False,
    name: str = "unnamed",
    progress: Progress | None = None,
) -> tuple[HandRotations, Calibration, BenchReadings]:
    """Calibrate accelerometer and gyro of a log: the fit, its calibration, and the means over the rests.

    `gyro_log`: the gyro's own log, with the same times. `specific_force`: the accelerometer reads +1 g upwards at rest.
    """
    log, triads, units, digest, told = read_both(path, gyro_log, gyro_profile, progress)
    gravity = None if site is None else site.gravity
    if gravity is None:
        gravity = STANDARD_GRAVITY
        values: dict[str, Value] = {"name": "gravity", "value": gravity, "unit": "m/s2", "why": "standard gravity"}
        told.append(Finding("work-assumed", {**values, "needed": ("--site",)}, severity="note"))
    try:
        found = calibrate_hand_rotations(
            log.time, triads["accelerometer"], triads["gyro"], gravity=gravity, gyro_unit=units["gyro"]
        )
    except (InputError, IdentifiabilityError) as error:
        raise in_file(error, path) from None
    record = hand_rotations_calibration(found, digest, units=units, specific_force=specific_force, name=name)
    if "magnetometer" in log.channels:
        told.append(Finding("fit-unused", {"kind": "magnetometer", "methods": ("norm",)}, severity="note"))
    pairs = found.rests.pairs()
    readings = BenchReadings(
        {kind: np.array([values[a:b].mean(axis=0) for a, b in pairs]) for kind, values in triads.items()},
        count=np.array([float(b - a) for a, b in pairs]),
        units=units,
        reference={"g": gravity},
        digest=digest,
    )
    return found, replace(record, findings=(*told, *record.findings)), readings


def read_both(
    path: str | Path,
    gyro_log: str | Path | None = None,
    gyro_profile: str | None = None,
    progress: Progress | None = None,
) -> tuple[Log, dict[str, np.ndarray], dict[str, str], str, list[Finding]]:
    """The log, its accelerometer and gyro with their units, digest and findings; arguments as `calibrate_log`.

    Raises
    ------
    FileError
        As `read_log`; no accelerometer or gyro of three channels; a gyro with other times.
    """
    log = read_log(path, progress=progress)
    channels, units, digest, told = dict(log.channels), dict(log.units), log.digest, list(log.findings)
    if gyro_log is not None:
        if "gyro" in channels:
            raise refused("input-not-with", {"name": "--gyro-log", "other": f"{Path(path).name}: gyro"})
        with reading_with(gyro_profile) if gyro_profile else nullcontext():
            other = read_log(gyro_log, progress=progress)
        _same_times(log, other, path, gyro_log)
        channels["gyro"], units["gyro"] = _three(other, "gyro", gyro_log), other.units["gyro"]
        digest = digest_bytes(f"{log.digest} {other.digest}".encode())
        told += other.findings
    elif gyro_profile is not None:
        raise refused("input-needs", {"name": "--gyro-profile", "needed": ("--gyro-log",)})
    if "gyro" not in channels:
        raise FileError(Finding("input-one-of", {"names": ("gyro_x .. gyro_z", "--gyro-log")}), path=path)
    triads = {
        "accelerometer": _three(log, "accelerometer", path),
        "gyro": channels["gyro"] if gyro_log is not None else _three(log, "gyro", path),
    }
    return log, triads, {kind: units[kind] for kind in triads}, digest, told


_TRIADS: Final = {"accelerometer": ("accel_x .. accel_z",), "gyro": ("gyro_x .. gyro_z",)}


def _three(log: Log, kind: str, path: str | Path) -> np.ndarray:
    """The three channels of a triad."""
    values = log.channels.get(kind)
    if values is None or values.shape[1] != 3:
        raise FileError(Finding("input-missing", {"names": _TRIADS[kind]}), path=path)
    return values


def _same_times(log: Log, other: Log, source: str | Path, path: str | Path) -> None:
    """Refuse two files, `source` the first, that were not sampled together."""
    if len(log) != len(other):
        counts: dict[str, Value] = {"name": "rows", "here": len(other), "there": len(log), "file": Path(source).name}
        raise FileError(Finding("work-rows", counts), path=path)
    off = np.abs(log.time - other.time)
    if off.max() > 0.1 * float(np.median(np.diff(log.time))):
        row = int(np.argmax(off))
        times: dict[str, Value] = {"name": "time", "here": float(other.time[row]), "there": float(log.time[row])}
        raise FileError(Finding("work-rows", {**times, "file": Path(source).name}), path=path, row=row + 1)

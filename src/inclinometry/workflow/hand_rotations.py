"""From a log of a tool turned by hand between rests to its calibration."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np

from inclinometry.calibration.hand_rotations import HandRotations, calibrate_hand_rotations, hand_rotations_calibration
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration, uncoded
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.digest import digest_bytes
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, IdentifiabilityError, InputError
from inclinometry.files.log_csv import Log, read_log
from inclinometry.files.profile import reading_with
from inclinometry.files.text import Progress


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
    log, triads, units, digest, notes = read_both(path, gyro_log, gyro_profile, progress)
    gravity = None if site is None else site.gravity
    if gravity is None:
        gravity = STANDARD_GRAVITY
        notes.append(f"gravity is taken as {gravity:g} m/s2: --site says what it is; the gyro does not depend on it")
    try:
        found = calibrate_hand_rotations(
            log.time, triads["accelerometer"], triads["gyro"], gravity=gravity, gyro_unit=units["gyro"]
        )
    except (InputError, IdentifiabilityError) as error:
        raise FileError(str(error), path=path) from None
    record = hand_rotations_calibration(found, digest, units=units, specific_force=specific_force, name=name)
    if "magnetometer" in log.channels:
        notes.append("the magnetometer was not used: --method norm on the readings of the log calibrates it")
    pairs = found.rests.pairs()
    readings = BenchReadings(
        {kind: np.array([values[a:b].mean(axis=0) for a, b in pairs]) for kind, values in triads.items()},
        count=np.array([float(b - a) for a, b in pairs]),
        units=units,
        reference={"g": gravity},
        digest=digest,
    )
    return found, replace(record, findings=(*uncoded(notes, "note"), *record.findings)), readings


def read_both(
    path: str | Path,
    gyro_log: str | Path | None = None,
    gyro_profile: str | None = None,
    progress: Progress | None = None,
) -> tuple[Log, dict[str, np.ndarray], dict[str, str], str, list[str]]:
    """The log, its accelerometer and gyro with their units, digest and notes; arguments as `calibrate_log`.

    Raises
    ------
    FileError
        As `read_log`; no accelerometer or gyro of three channels; a gyro with other times.
    """
    log = read_log(path, progress=progress)
    channels, units, digest, notes = dict(log.channels), dict(log.units), log.digest, list(log.notes)
    if gyro_log is not None:
        if "gyro" in channels:
            raise InputError(f"--gyro-log is given, and {Path(path).name} has a gyro; leave one of them out")
        with reading_with(gyro_profile) if gyro_profile else nullcontext():
            other = read_log(gyro_log, progress=progress)
        _same_times(log, other, gyro_log)
        channels["gyro"], units["gyro"] = _three(other, "gyro", gyro_log), other.units["gyro"]
        digest = digest_bytes(f"{log.digest} {other.digest}".encode())
        notes += other.notes
    elif gyro_profile is not None:
        raise InputError("--gyro-profile is for --gyro-log; leave it out")
    if "gyro" not in channels:
        raise FileError("no gyro: add gyro_x, gyro_y, gyro_z, or give the gyro's own log by --gyro-log", path=path)
    triads = {
        "accelerometer": _three(log, "accelerometer", path),
        "gyro": channels["gyro"] if gyro_log is not None else _three(log, "gyro", path),
    }
    return log, triads, {kind: units[kind] for kind in triads}, digest, notes


def _three(log: Log, kind: str, path: str | Path) -> np.ndarray:
    """The three channels of a triad."""
    values = log.channels.get(kind)
    if values is None or values.shape[1] != 3:
        have = "none" if values is None else str(values.shape[1])
        raise FileError(f"the {kind} has {have} of the three channels x, y, z that are needed", path=path)
    return values


def _same_times(log: Log, other: Log, path: str | Path) -> None:
    """Refuse two files that were not sampled together."""
    if len(log) != len(other):
        raise FileError(
            f"{len(other)} samples, the accelerometer has {len(log)}; give logs of the same times", path=path
        )
    off = np.abs(log.time - other.time)
    if off.max() > 0.1 * float(np.median(np.diff(log.time))):
        row = int(np.argmax(off))
        said = f"sample {row + 1} is of {other.time[row]:.10g} s, the accelerometer's of {log.time[row]:.10g} s"
        raise FileError(f"{said}; give logs of the same times", path=path)

"""What the sensors of a file show by themselves: rests, the axis the tool turns about, how each convention fits."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.conventions import check_dials
from inclinometry.calibration.stillness import StillIntervals, still_intervals
from inclinometry.conventions import CONVENTIONS, axes_names, find_mapping
from inclinometry.errors import InclinometryError, InputError
from inclinometry.findings import Finding, Value
from inclinometry.orientation import dip_angle

_LEAST_ATTITUDES: Final = 6
_MOST: Final = 2000
"""Attitudes by which conventions are judged."""


class Candidate(NamedTuple):
    """A convention of axes: dip and its scatter over the attitudes, deg, and the share in which z points down."""

    convention: str
    dip_deg: float
    scatter_deg: float
    share_down: float


class Sensors(NamedTuple):
    """What was found; how each convention fits, best first; rests, where the whole run was looked at."""

    findings: tuple[Finding, ...]
    candidates: tuple[Candidate, ...]
    rests: int | None = None


def sensors_of_run(path: Path) -> Sensors:
    """Rests, turning axis and conventions of a run or log.

    Raises
    ------
    InclinometryError
        As `files.run_file.open_run`.
    """
    from inclinometry.files.run_file import open_run

    times: list[Array] = []
    held: dict[str, list[Array]] = {}
    run = open_run(path)
    more = False
    most = 200_000  # rows in which rests are looked for: half an hour at 100 Hz, a third of a second of work
    for block in run.blocks():
        if sum(map(len, times)) >= most:
            more = True
            break
        times.append(block.time)
        for kind, values in block.channels.items():
            held.setdefault(kind, []).append(values)
    time = np.concatenate(times)
    channels = {kind: np.concatenate(parts) for kind, parts in held.items()}
    usable = np.all([np.isfinite(values).all(axis=1) for values in channels.values()], axis=0)
    usable[1:] &= np.diff(time) > 0.0
    time, channels = time[usable], {kind: values[usable] for kind, values in channels.items()}
    notes = []
    rests: StillIntervals | None = None
    try:
        rests = still_intervals(time, np.concatenate([v for k, v in channels.items() if k != "magnetometer"]
                                                     or list(channels.values()), axis=1))  # fmt: skip
    except InputError as error:
        notes.append(Finding("check-no-rests", {"finding": error.finding}, severity="note"))
    if rests is not None:
        notes.append(_rests(time, rests))
    notes += _turning(channels, run.units)
    if rests is None or len(rests) < _LEAST_ATTITUDES:
        return Sensors(tuple(notes), (), None if rests is None or more else len(rests))
    means = {kind: np.array([v[a:b].mean(axis=0) for a, b in rests.pairs()]) for kind, v in channels.items()}
    found = _conventions(means, run.units)
    return Sensors((*notes, *found.findings), found.candidates)


def sensors_of_bench(path: Path) -> Sensors:
    """Conventions of the sensors and of the dials of bench readings; errors as `files.bench_csv.read_bench`."""
    from inclinometry.files.bench_csv import read_bench

    readings = read_bench(path)
    found = _conventions(readings.channels, readings.units)
    dials: list[Finding] = []
    if readings.azimuth is not None:
        try:
            dials = check_dials(readings) or [Finding("check-dials", severity="note")]
        except InclinometryError as error:
            dials = [error.finding]
    return Sensors((*dials, *found.findings), found.candidates)


def sensors_of_survey(path: Path) -> Sensors:
    """Conventions of the sensors of raw stations; errors as `files.survey_csv.read_raw_survey`."""
    from inclinometry.files.survey_csv import read_raw_survey

    raw = read_raw_survey(path)
    return _conventions(raw.channels, raw.units)


def _rests(time: Array, rests: StillIntervals) -> Finding:
    if not len(rests):
        return Finding("check-moving", {"rows": len(time)}, severity="note")
    lengths = np.array([time[b - 1] - time[a] for a, b in rests.pairs()])
    share = lengths.sum() / max(time[-1] - time[0], 1e-9)
    values: dict[str, Value] = {"rows": len(time), "rests": len(rests), "share_percent": 100.0 * float(share)}
    values |= {"shortest_s": float(lengths.min()), "longest_s": float(lengths.max())}
    return Finding("check-rests", values, severity="note")


def _turning(channels: Mapping[str, Array], units: Mapping[str, str]) -> list[Finding]:
    """The axis a tool turns about: the largest rate of a gyro, else the field's component that hardly changes."""
    gyro = channels.get("gyro")
    if gyro is not None and gyro.shape[1] == 3:
        rms = np.sqrt(np.mean(gyro**2, axis=0))
        order = np.argsort(rms)
        if rms[order[2]] > 3.0 * rms[order[1]]:
            return [_turns("xyz"[int(order[2])], "gyro", rms, units)]
    for kind in ("magnetometer", "accelerometer"):
        values = channels.get(kind)
        if values is None or values.shape[1] != 3:
            continue
        moved = np.std(values, axis=0)
        if moved.max() > 0.0 and moved.min() < 0.1 * np.median(moved):
            return [_turns("xyz"[int(np.argmin(moved))], kind, moved, units)]
    return []


def _turns(axis: str, kind: str, changes: Array, units: Mapping[str, str]) -> Finding:
    values: dict[str, Value] = {"axis": axis, "kind": kind, "changes": tuple(changes.tolist())}
    return Finding("check-turning", values | {"unit": units.get(kind, "")}, severity="note")


def _conventions(channels: Mapping[str, Array], units: Mapping[str, str]) -> Sensors:
    """How the dip comes out by each convention; what the dip cannot tell is said."""
    accel, mag = (channels.get(kind) for kind in ("accelerometer", "magnetometer"))
    if accel is None or mag is None or accel.shape[1] != 3 or mag.shape[1] != 3 or len(accel) < _LEAST_ATTITUDES:
        return Sensors((), ())
    step = max(len(accel) // _MOST, 1)
    fields = []
    for kind, values in (("accelerometer", accel), ("magnetometer", mag)):
        part = values[::step]
        fields.append(part - _centre(part) if units.get(kind) == "counts" else part)
    a, b = fields
    candidates = []
    for convention in CONVENTIONS:
        g, field = a @ convention.matrix("accelerometer").T, b @ convention.matrix("magnetometer").T
        dips = np.degrees(dip_angle(g, field))
        candidates.append(
            Candidate(convention.name, float(dips.mean()), float(dips.std(ddof=1)), float(np.mean(g[:, 2] > 0.0)))
        )
    notes = []
    with suppress(InputError):
        mappings, ambiguous, explanation = find_mapping(a, b)
        # the identity, or all channels reversed, is what the conventions above have
        same = mappings[0].axes in (axes_names(np.eye(3)), axes_names(-np.eye(3)))
        if not same and not ambiguous:
            notes.append(explanation._replace(severity="note"))
    spread = max(candidates, key=lambda c: c.scatter_deg).scatter_deg
    if spread > 5.0 and not notes:
        notes.append(Finding("check-dip-scatter", {"scatter_deg": spread}, severity="note"))
    notes.append(Finding("check-convention", severity="note"))
    return Sensors(tuple(notes), tuple(candidates))


def _centre(values: Array) -> Array:
    """Centre of the sphere through readings of a triad; zero where they do not span one."""
    if len(values) < 2 * _LEAST_ATTITUDES:
        return np.zeros(3)
    middle = values.mean(axis=0)
    size = float(np.abs(values - middle).max()) or 1.0
    scaled = (values - middle) / size
    design = np.column_stack([2.0 * scaled, np.ones(len(scaled))])
    found, _, _, singular = np.linalg.lstsq(design, (scaled**2).sum(axis=1), rcond=None)
    return np.zeros(3) if singular[-1] < 0.05 * singular[0] else middle + size * found[:3]

"""What a file is understood to be: its layout, its columns and their units, and the commands that could take it."""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import re
import tempfile
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.calibration.hand_rotations import LEAST_ROTATIONS
from inclinometry.calibration.result import Calibration
from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, IdentifiabilityError, InclinometryError, InputError, in_file
from inclinometry.files import _quantities
from inclinometry.files.casing_csv import face, read_casing
from inclinometry.files.columns import TEXT, channel, is_number
from inclinometry.files.foreign import foreign_pieces
from inclinometry.files.frame import Frame
from inclinometry.files.gyro_csv import read_gyro_run
from inclinometry.files.holes_csv import hole_column, read_collars, read_shots
from inclinometry.files.log_csv import read_even_log, read_log
from inclinometry.files.position_csv import read_well
from inclinometry.files.profile import SEPARATORS, Profile, current, reading_with, stated_unit
from inclinometry.files.site_toml import read_site
from inclinometry.files.six_axis import read_six_axis, read_survey
from inclinometry.files.survey_csv import read_raw_survey
from inclinometry.files.table import TableFile, read_table
from inclinometry.files.table_formats import NUMBER, find_layout, line_of, refuse_legs, with_layout
from inclinometry.files.text import LONGEST_LINE, texts_of
from inclinometry.files.tool_json import read_calibration
from inclinometry.findings import Finding, Value
from inclinometry.opening import opened
from inclinometry.survey.plausibility import check_run
from inclinometry.survey.run import Run
from inclinometry.workflow.allan import noise_of_log
from inclinometry.workflow.check_sensors import Candidate, Sensors, sensors_of_bench, sensors_of_run, sensors_of_survey
from inclinometry.workflow.convert import check_survey
from inclinometry.workflow.field import completed
from inclinometry.workflow.hand_rotations import read_both
from inclinometry.workflow.six_axis import add_site_check, check_raw
from inclinometry.workflow.stations import readings_of_log

LOOKED_AT: Final = 20_000
"""Rows that are looked at; of a longer file the rest is only counted."""
PROBED: Final = 2000
"""Rows that each reader is tried on."""
_TRIED: Final = 100
"""Stations up to which `calibrate` is tried whole: a second of work."""


class ColumnLook(NamedTuple):
    """One column: its name there, its name here ("" where it is not known), lowest and highest value, what is odd."""

    name: str
    here: str
    low: float
    high: float
    remark: Finding | None


@dataclass(frozen=True, eq=False)
class Look:
    """What `inclinometry check` has seen of a file; `rows` counts values in all of it, `draft` is its profile as TOML.

    findings : what is wrong with a run; rate, rests, axes and units that would fit, as notes.
    candidates : how each convention of axes fits the sensors.
    uses : command -> None where it can take the file, else what it lacks.
    """

    layout: str
    rows: int
    columns: tuple[ColumnLook, ...]
    candidates: tuple[Candidate, ...]
    uses: dict[str, Finding | None]
    draft: str
    findings: tuple[Finding, ...] = ()

    @property
    def refused(self) -> tuple[str, ...]:
        """Codes of the findings that refuse the run."""
        return tuple(dict.fromkeys(one.code for one in self.findings if one.severity == "refused"))


def look(path: str | Path, calibration: str | Path | None = None, site: str | Path | None = None) -> Look:
    """Describe a file; with a calibration and a site judge raw channels of a run as `survey` does."""
    path, given = Path(path), current()
    record = None if calibration is None else read_calibration(calibration)
    place = Site() if site is None else completed(read_site(site))[0]
    try:
        return _look(path, given, record, place)
    except FileError as error:
        if error.path == path:
            raise
        # what was looked at is a copy of its beginning
        raise in_file(error, path) from None


def _look(path: Path, given: Profile, record: Calibration | None, site: Site) -> Look:
    with tempfile.TemporaryDirectory() as folder:
        head, lines, whole = _head(path, Path(folder))
        refuse_legs(lines, path)
        profile, layout = (given, "as the profile says") if given.states_layout else find_layout(lines)
        if not given.states_layout:
            profile = with_layout(given, profile)
        if head.suffix != path.suffix and path.suffix != ".gz":
            layout = f"{path.suffix.removeprefix('.')}{layout.removeprefix('text, separated by comma')}"
        with reading_with(profile):
            written = TableFile(head).names
            texts = read_table(head, numeric=lambda name: False, timed=True)
            table = read_table(head, numeric=_numeric(texts), gaps=texts.names, timed=True)
            rows = len(table) if whole is None else whole - int(table.lines[0]) + 1
            probe = head if len(lines) <= PROBED else _beginning(head, Path(folder))
            uses = {command: _lacks(probe, read) for command, read in _READERS.items()}
            columns = tuple(_column(table, name, profile, uses) for name in table.names)
            notes = _notes(table, columns)
            gone = [name for name in written if name not in table.names]
            if gone and "time_s" in table:
                notes.insert(0, Finding("check-time", {"columns": tuple(gone)}, severity="note"))
            raw = record is None and not uses[_RAW] and uses[_SIX_AXES]
            findings = _findings(head, uses, record, site)
            findings += [Finding("check-raw", severity="note")] if raw else []
            # of a text the whole file, else the rows that were copied
            seen = _sensors(path if head.suffix == path.suffix or path.suffix == ".gz" else head, head, uses)
    if rows <= LOOKED_AT:  # what these two ask of the whole log
        for command, whole_log in (("readings", readings_of_log), ("allan", noise_of_log)):
            uses[command] = uses[command] or _lacks(head, whole_log)
    if not uses[_BY_HAND] and seen.rests is not None and seen.rests <= LEAST_ROTATIONS:
        few: dict[str, Value] = {"name": "rests", "count": seen.rests, "least": LEAST_ROTATIONS + 1}
        uses[_BY_HAND] = Finding("input-few", few, severity="refused")
    found = (*findings, *(one for one in seen.findings if one not in notes), *notes)
    return Look(layout, rows, columns, seen.candidates, uses, _draft(profile, columns), found)


def _findings(head: Path, uses: dict[str, Finding | None], record: Calibration | None, site: Site) -> list[Finding]:
    """What is wrong with stations along a hole, by the reader that takes the file."""
    lacking = uses[_RAW]
    if record is not None and lacking is not None:
        raise FileError(Finding("check-not-raw", {"finding": lacking}), path=head)
    commands: tuple[str, ...] = (_SIX_AXES, "position")
    try:
        if record is not None or (uses[_SIX_AXES] and not uses[_RAW]):
            found, commands = check_raw(read_raw_survey(head), record, site), (_RAW,)
        elif not uses[_SIX_AXES]:
            survey = read_survey(head, azimuth_reference="magnetic")
            found = check_survey(survey)
            if survey.g is not None and survey.b is not None:
                found = add_site_check(found, Run.of_fields(survey.md, survey.g, survey.b), site)
        elif not uses["position"]:
            well = read_well(head)
            found = check_run(Run(well.md, well.inclination, well.azimuth))
        else:
            found = check_survey(read_survey(head))
    except InclinometryError:
        if record is not None:
            raise
        return []  # no stations along a hole
    refused = tuple(dict.fromkeys(one.code for one in found if one.severity == "refused"))
    for command in commands if refused else ():
        uses[command] = uses[command] or Finding("check-refused", {"codes": refused}, severity="refused")
    return found


def _beginning(head: Path, folder: Path) -> Path:
    """The first rows in a file of their own."""
    probe = folder / f"beginning-{head.name.removesuffix('.gz')}"
    unpacked: Callable[..., Any] = gzip.open if head.read_bytes()[:2] == b"\x1f\x8b" else open
    with unpacked(head, "rb") as stream:
        probe.write_bytes(b"".join(line for line, _ in zip(stream, range(PROBED), strict=False)))
    return probe


def _sensors(path: Path, head: Path, uses: dict[str, Finding | None]) -> Sensors:
    """What the sensors show, by the reader that takes the file."""
    ways = {
        "readings": (sensors_of_run, path),
        _VERIFY: (sensors_of_bench, head),
        _RAW: (sensors_of_survey, head),
    }
    for command, (look_at, where) in ways.items():
        if not uses[command]:
            with contextlib.suppress(InclinometryError):
                return look_at(where)
    return Sensors((), ())


_DAMAGED: Final = (EOFError, OSError, zlib.error)
"""What a packed file that is damaged ends with; the reader says so."""


def _head(path: Path, folder: Path) -> tuple[Path, list[str], int | None]:
    """A text or table to look at, its lines, and how many the file has where that is not all of it."""
    with opened(path) as stream:
        start = stream.read(4)
    pieces = foreign_pieces(path, hashlib.sha256())
    if pieces is not None:
        # another format: its cells as a plain table, whose beginning is looked at
        texts: list[str] = []
        rows = 0
        for piece in pieces:
            if isinstance(piece, Frame):
                found = zip(*map(texts_of, piece.columns.values()), strict=True)
                lines: Iterable[Any] = found if rows else chain([piece.names], found)
                rows += len(piece) + (not rows)
            else:
                lines = piece.lines
                rows += sum(map(bool, piece.lines))
            texts += map(line_of, islice(lines, LOOKED_AT - len(texts)))
        copy = folder / f"{path.stem}.csv"
        copy.write_text("\n".join(texts) + "\n", encoding="utf-8")
        return copy, texts, rows
    unpacked: Callable[..., Any] = gzip.open if start.startswith(b"\x1f\x8b") else open
    read: list[bytes] = []
    with contextlib.suppress(*_DAMAGED), unpacked(path, "rb") as stream:
        while len(read) <= LOOKED_AT and (line := stream.readline(LONGEST_LINE + 2)):
            read.append(line)
            if len(line) > LONGEST_LINE or b"\0" in line:
                return path, [], None  # no table; the reader says so
    texts = [line.decode("utf-8-sig", "replace") for line in read]
    if len(read) <= LOOKED_AT:
        return path, texts, None
    copy = folder / path.name.removesuffix(".gz")
    copy.write_bytes(b"".join(read[:LOOKED_AT]))
    rows = 0
    with contextlib.suppress(*_DAMAGED), unpacked(path, "rb") as stream:
        while chunk := stream.read(1 << 20):
            rows += chunk.count(b"\n")
    return copy, texts[:LOOKED_AT], rows


def _known(name: str) -> bool:
    return is_number(name) or _quantities.is_number(name)


def _numeric(texts: Frame) -> Callable[[str], bool]:
    """Known names, and every other column whose first rows are numbers."""
    found = set()
    for name in texts.names:
        cells = [cell for cell in texts.text(name) if cell][:200]
        if cells and all(NUMBER.fullmatch(cell) for cell in cells):
            found.add(name)
    return lambda name: name in found or (_known(name) and name not in texts.names)


def _column(table: Frame, name: str, profile: Profile, uses: dict[str, Finding | None]) -> ColumnLook:
    values = table.columns[name]
    here, remark = "", None
    if not uses["displacement"] and (run := face(name)) is not None:
        here = f"axis {run[0].upper()}, run {180 * run[1]}"
    elif not uses["holes"] and hole_column(name):
        here = hole_column(name)
    elif name in TEXT or is_number(name):
        here = name
    else:
        try:
            reading = profile.reading(name, lambda column: _known(column) and is_number(column))
            what = None if reading.name != name else _quantities.meaning(name)
            if reading.name != name:
                here = reading.name
            elif what is not None:
                here = _quantities.quantities()[what.key].column if what.unit is not None else what.key
        except InputError as error:
            remark = error.finding
    if isinstance(values, tuple):
        return ColumnLook(name, here, np.nan, np.nan, remark or _cells("different texts", len(set(values))))
    finite = values[np.isfinite(values)]
    if not finite.size:
        return ColumnLook(name, here, np.nan, np.nan, remark or _cells("empty cells", len(values)))
    gaps = len(values) - finite.size
    low, high = float(finite.min()), float(finite.max())
    if remark is None and (gaps or (low == high and len(finite) > 3)):
        remark = _cells("empty cells", gaps) if gaps else _cells("different values", 1)
    return ColumnLook(name, here, low, high, remark)


def _cells(what: str, count: int) -> Finding:
    return Finding("check-cells", {"what": what, "count": count})


def _notes(table: Frame, columns: tuple[ColumnLook, ...]) -> list[Finding]:
    notes = []
    if "time_s" in table:
        steps = np.diff(table.number("time_s"))
        if steps.size and (steps > 0.0).all():
            middle = float(np.median(steps))
            even = float(np.mean(np.abs(steps - middle) <= 0.5 * middle))
            rate = {"rate_Hz": 1.0 / middle, "uneven_percent": 100.0 * (1.0 - even)}
            notes.append(Finding("check-rate", rate, severity="note"))
    units = {column.name: channel(column.here) for column in columns}
    for what, names in _triads(table, columns):
        values = np.stack([table.number(name) for name in names], axis=1)
        values = values[np.isfinite(values).all(axis=1)]
        if not len(values):
            continue
        size = float(np.median(np.linalg.norm(values, axis=1)))
        here = units[names[0]]
        stated = stated_unit(names[0]) is not None or (here is not None and here.unit != "counts")
        if what != "gyro" and not stated:
            fits = tuple(_units_that_fit(what, size)) or ("counts or volts",)[: here is not None]
            if not fits:
                continue
            length: dict[str, Value] = {"columns": tuple(names), "length": size, "units": fits}
            notes.append(Finding("check-length", length, severity="note"))
    return notes


def _triads(table: Frame, columns: tuple[ColumnLook, ...]) -> list[tuple[str, list[str]]]:
    """Columns of numbers whose names differ in x, y, z alone."""
    found = []
    numbers = [c.name for c in columns if not isinstance(table.columns[c.name], tuple)]
    for name in numbers:
        for place, letter in enumerate(name):
            if letter not in "xX":
                continue
            three = [name[:place] + other + name[place + 1 :] for other in ("xyz" if letter == "x" else "XYZ")]
            if all(other in numbers for other in three):
                signal = channel(name)
                found.append((_kind(name) if signal is None else signal.kind, three))
                break
    return found


_WORDS: Final = {"mag": "magnetometer", "gyr": "gyro", "acc": "accelerometer"}
_LETTERS: Final = {"b": "magnetometer", "h": "magnetometer", "m": "magnetometer", "w": "gyro"} | dict.fromkeys(
    "ga", "accelerometer"
)


def _kind(name: str) -> str:
    """What a triad measures by its name, without the unit behind it: by a word in it, else by its first letter."""
    plain = re.sub(r"[(\[].*", "", name.lower())
    word = next((kind for word, kind in _WORDS.items() if word in plain), None)
    return word or _LETTERS.get(plain[:1], "triad")


def _units_that_fit(kind: str, size: float) -> list[Finding]:
    """Units in which a still tool on the Earth would read this length, and what the field then is."""
    fits = []
    if kind in ("accelerometer", "triad"):
        for unit, one in (("m/s2", STANDARD_GRAVITY), ("g", 1.0), ("mg", 1000.0)):
            if abs(size / one - 1.0) < 0.1:
                gravity = size / one * STANDARD_GRAVITY
                fits.append(Finding("check-unit", {"unit": unit, "name": "gravity", "value": gravity, "own": "m/s2"}))
    if kind in ("magnetometer", "triad"):
        for unit, one in (("nT", 1.0), ("uT", 1e-3), ("gauss", 1e-5), ("mG", 1e-2)):
            if 20_000.0 <= size / one <= 70_000.0:
                fits.append(Finding("check-unit", {"unit": unit, "name": "|b|", "value": size / one, "own": "nT"}))
    return fits


def _calibrated(path: Path, method: str = "") -> None:
    """Refused as `calibrate` refuses it: by the fit itself, or of many stations by what it asks of the columns."""
    from inclinometry.files.bench_csv import read_bench
    from inclinometry.workflow.calibrate import Options, calibrate, usual_method

    readings = read_bench(path)
    method = method or usual_method(readings)
    if method == "joint":
        _ = readings.dials
    if len(readings) <= _TRIED:
        calibrate(readings, method, Options())
    elif method == "norm":
        with contextlib.suppress(IdentifiabilityError):
            calibrate(readings.take(np.arange(_TRIED)), method, Options())


def _verified(path: Path) -> None:
    from inclinometry.files.bench_csv import read_bench

    _ = read_bench(path).dials


def _run(path: Path) -> None:
    from inclinometry.earth.site import Site
    from inclinometry.files.run_file import open_run
    from inclinometry.workflow.dynamic_signals import Signals

    run = open_run(path)
    signals = Signals(run, Site())
    for block in run.blocks():
        signals.fields(block)


_BY_HAND: Final = "calibrate --method hand-rotations"
_VERIFY: Final = "verify"
_RAW: Final = "survey --calibration"
_SIX_AXES: Final = "survey, quality, msa"
_READERS: Final[dict[str, Callable[[Path], object]]] = {
    "calibrate": _calibrated,
    "calibrate --method norm": partial(_calibrated, method="norm"),
    _BY_HAND: read_both,
    _VERIFY: _verified,
    _RAW: read_raw_survey,
    _SIX_AXES: partial(read_six_axis, azimuth_reference="magnetic"),
    "position": read_well,
    "readings": read_log,
    "gyro north": read_gyro_run,
    "dynamic": _run,
    "allan": read_even_log,
    "displacement": read_casing,
    "holes": read_shots,
    "holes --collars": read_collars,
}


def _lacks(path: Path, read: Callable[[Path], object]) -> Finding | None:
    try:
        read(path)
    except InclinometryError as error:
        found = error.finding
        if found.code == "file-column":  # the columns that are there are shown above
            return Finding("input-missing", {"names": found.values["columns"]}, severity="refused")
        return found
    return None


def _draft(profile: Profile, columns: tuple[ColumnLook, ...]) -> str:
    """The profile as TOML, with every column that is not yet known for a person to name."""

    def text(value: str) -> str:
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'

    lines = [f"title = {text(profile.title or 'what instrument or program writes these files')}"]
    if profile.separator is not None:
        lines.append(f"separator = {text(next(n for n, mark in SEPARATORS.items() if mark == profile.separator))}")
    if profile.skip:
        lines.append(f"skip = {profile.skip}")
    if not profile.header:
        lines.append("header = false")
    if profile.units_row:
        lines.append("units_row = true")
    if profile.rate_hz:
        lines.append(f"rate_hz = {profile.rate_hz:g}")
    lines += [f"null = {profile.null:g}"] if profile.null is not None else []
    lines += [f"units = [{', '.join(map(text, profile.units))}]"] if profile.units else []
    lines += ["", "[axes]"] if profile.axes else []
    lines += [f"{kind} = [{', '.join(map(text, axes))}]" for kind, axes in profile.axes.items()]
    lines += ["", "[constants]"] if profile.constants else []
    lines += [f"{name} = {text(v) if isinstance(v, str) else repr(v)}" for name, v in profile.constants.items()]
    lines += ["", "[roll_sets]"] if profile.roll_sets else []
    lines += [f"{text(name)} = {list(rows)}" for name, rows in profile.roll_sets.items()]
    lines += ["", "[columns]", '# name in the file = name here with its unit; "" leaves a column out']
    for column in columns:
        name = column.name if profile.header else column.name.removeprefix("column ")
        if name in profile.columns:
            unit = f", unit = {text(profile.given[name])} }}" if name in profile.given else ""
            here = text(profile.columns[name])
            lines.append(f"{text(name)} = " + (f"{{ name = {here}{unit}" if unit else here))
        elif column.here:
            lines.append(f"# {text(name)} is understood as it is: {column.here}")
        else:
            extra = re.sub(r"\W+", "_", column.name).strip("_")
            lines.append(f"# {text(name)} = {text(f'extra_{extra}')}")
    return "\n".join(lines) + "\n"

"""What a file is understood to be: its layout, its columns and their units, and the commands that could take it."""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import re
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.constants import STANDARD_GRAVITY
from inclinometry.errors import FileError, InclinometryError, InputError
from inclinometry.files import _quantities
from inclinometry.files.columns import TEXT, channel, is_number
from inclinometry.files.layout import opened
from inclinometry.files.profile import PLAIN, SEPARATORS, Profile, current, reading_with
from inclinometry.files.table import LONGEST_LINE, Table, read_table

LOOKED_AT: Final = 20_000
"""Rows that are looked at; of a longer file the rest is only counted."""

_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")


class ColumnLook(NamedTuple):
    """One column: its name there, its name here ("" where it is not known), lowest and highest value, and a remark."""

    name: str
    here: str
    low: float
    high: float
    remark: str


@dataclass(frozen=True, eq=False)
class Look:
    """What `inclinometry check` has seen.

    layout : in words.
    rows : of values, in the whole file.
    columns : in the order of the file.
    notes : rate, axes, units that would fit.
    uses : command -> "" where it can take the file, else what it lacks.
    draft : the profile the file was read with, as TOML.
    """

    layout: str
    rows: int
    columns: tuple[ColumnLook, ...]
    notes: tuple[str, ...]
    uses: dict[str, str]
    draft: str


def look(path: str | Path) -> Look:
    """Understand a file as far as can be told without guessing.

    Raises
    ------
    FileError
        Not found, empty, no table.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.txt").write_text("my logger\\n\\nMD;INC;AZI\\nft;deg;deg\\n100;1,5;20\\n200;3,0;21\\n")
    ...     seen = look(Path(folder, "a.txt"))
    >>> seen.layout
    'text, separated by semicolon, 2 lines before the names, a line of units'
    >>> [(column.name, column.here) for column in seen.columns]
    [('MD (ft)', 'md_m'), ('INC (deg)', 'inclination_deg'), ('AZI (deg)', 'azimuth_deg')]
    """
    path, given = Path(path), current()
    with tempfile.TemporaryDirectory() as folder:
        head, lines, whole = _head(path, Path(folder))
        profile, layout = (given, "as the profile says") if given.lays_out else _layout(lines)
        if not given.lays_out:
            profile = _joined(profile, given)
        if head.suffix != path.suffix and path.suffix != ".gz":
            layout = f"{path.suffix.removeprefix('.')}{layout.removeprefix('text, separated by comma')}"
        with reading_with(profile):
            texts = read_table(head, numeric=lambda name: False)
            table = read_table(head, numeric=_numeric(texts), gaps=texts.header)
            rows = len(table) if whole is None else whole - int(table.lines[0]) + 1
            columns = tuple(_column(table, name, profile) for name in table.header)
            uses = {command: _lacks(head, read) for command, read in _READERS.items()}
    return Look(layout, rows, columns, tuple(_notes(table, columns)), uses, _draft(profile, columns))


def _head(path: Path, folder: Path) -> tuple[Path, list[str], int | None]:
    """A text or table to look at, its lines, and how many the file has where that is not all of it."""
    try:
        with path.open("rb") as stream:
            start = stream.read(4)
    except FileNotFoundError:
        raise FileError("there is no such file; check the name", path=path) from None
    except OSError as error:
        raise FileError(f"cannot be read ({error.strerror})", path=path) from None
    blocks = opened(path, hashlib.sha256())
    if blocks is not None:
        # another format: its cells as a plain table, whose beginning is looked at
        texts: list[str] = []
        rows = 0
        for block in blocks:
            texts += block.lines[: LOOKED_AT - len(texts)]
            rows += sum(bool(line) for line in block.lines)
        copy = folder / f"{path.stem}.csv"
        copy.write_text("\n".join(texts) + "\n", encoding="utf-8")
        return copy, texts, rows
    unpacked: Callable[..., Any] = gzip.open if start.startswith(b"\x1f\x8b") else open
    lines: list[bytes] = []
    with contextlib.suppress(EOFError, OSError), unpacked(path, "rb") as stream:
        while len(lines) <= LOOKED_AT and (line := stream.readline(LONGEST_LINE + 2)):
            lines.append(line)
            if len(line) > LONGEST_LINE or b"\0" in line:
                return path, [], None  # no table; the reader says so
    texts = [line.decode("utf-8-sig", "replace") for line in lines]
    if len(lines) <= LOOKED_AT:
        return path, texts, None
    copy = folder / path.name.removesuffix(".gz")
    copy.write_bytes(b"".join(lines[:LOOKED_AT]))
    with unpacked(path, "rb") as stream:
        rows = sum(chunk.count(b"\n") for chunk in iter(lambda: stream.read(1 << 20), b""))
    return copy, texts[:LOOKED_AT], rows


def _layout(lines: list[str]) -> tuple[Profile, str]:
    """How the lines are cut into cells, and where the names and the rows begin."""
    if not lines:
        return PLAIN, "a table of its own format"
    filled = [
        (k, line.rstrip("\r\n")) for k, line in enumerate(lines[:400]) if line.strip() and line.lstrip()[0] != "#"
    ]
    if not filled:
        return PLAIN, "text without a table"
    best, width, mark = 0.0, 1, ","
    for candidate in ("\t", ";", ",", " "):
        counts = Counter(len(_cells(line, candidate)) for _, line in filled)
        number, times = max(counts.items(), key=lambda item: (item[1] * (item[0] > 1), item[0]))
        share = times / len(filled) if filled and number > 1 else 0.0
        # a later separator must explain clearly more lines: decimal commas look like one
        if share > best + 0.05:
            best, width, mark = share, number, candidate
    table = [(k, _cells(line, mark)) for k, line in filled if len(_cells(line, mark)) == width]
    if not table:
        return PLAIN, "text without a table"
    numbers = [sum(bool(_NUMBER.fullmatch(cell.strip())) for cell in cells) for _, cells in table]
    header = numbers[0] == 0 or (len(table) > 1 and numbers[0] < numbers[1] and numbers[0] * 2 < width)
    units = header and len(table) > 2 and numbers[1] == 0 and numbers[2] > 0 and _units_row(table[1][1])
    first = table[0][0]
    before = sum(1 for line in lines[:first] if line.strip() and line.lstrip()[0] != "#")
    plain = header and not units and mark in ",;\t" and not before
    profile = PLAIN if plain else Profile(separator=mark, skip=first if before else 0, header=header, units_row=units)
    name = next(name for name, text in SEPARATORS.items() if text == mark)
    words = [f"text, separated by {name}", f"{first} lines before the names" if before else ""]
    words += ["no names of columns" if not header else "", "a line of units" if units else ""]
    return profile, ", ".join(word for word in words if word)


def _cells(line: str, mark: str) -> list[str]:
    return line.split() if mark == " " else line.split(mark)


def _units_row(cells: list[str]) -> bool:
    written = [cell.strip().strip("[]()") for cell in cells if cell.strip()]
    known = sum(_quantities.dimension_of(cell) is not None for cell in written)
    return 0 < len(written) <= 2 * known


def _joined(found: Profile, given: Profile) -> Profile:
    """The layout that was found, with the units and columns that were stated."""
    return Profile(
        given.title,
        found.separator,
        found.skip,
        found.header,
        found.units_row,
        given.columns,
        given.given,
        given.units,
        given.axes,
    )


def _known(name: str) -> bool:
    return is_number(name) or _quantities.is_number(name)


def _numeric(texts: Table) -> Callable[[str], bool]:
    """Known names, and every other column whose first rows are numbers."""
    found = set()
    for name in texts.header:
        cells = [cell for cell in texts.text(name) if cell][:200]
        if cells and all(_NUMBER.fullmatch(cell) for cell in cells):
            found.add(name)
    return lambda name: name in found or (_known(name) and name not in texts.header)


def _column(table: Table, name: str, profile: Profile) -> ColumnLook:
    values = table.columns[name]
    here, remark = "", ""
    if name in TEXT or is_number(name):
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
            remark = str(error).partition("; ")[0].partition(" has ")[2] or str(error)
    if isinstance(values, tuple):
        kinds = len(set(values))
        return ColumnLook(name, here, np.nan, np.nan, remark or f"text, {kinds} different")
    finite = values[np.isfinite(values)]
    if not finite.size:
        return ColumnLook(name, here, np.nan, np.nan, remark or "empty")
    gaps = len(values) - finite.size
    low, high = float(finite.min()), float(finite.max())
    remark = remark or (f"{gaps} empty" if gaps else "never changes" if low == high and len(finite) > 3 else "")
    return ColumnLook(name, here, low, high, remark)


def _notes(table: Table, columns: tuple[ColumnLook, ...]) -> list[str]:
    notes = []
    if "time_s" in table:
        steps = np.diff(table.number("time_s"))
        if steps.size and (steps > 0.0).all():
            middle = float(np.median(steps))
            even = float(np.mean(np.abs(steps - middle) <= 0.5 * middle))
            notes.append(
                f"{1.0 / middle:.4g} rows a second{'' if even > 0.999 else f', {1 - even:.1%} of the steps uneven'}"
            )
    for what, names in _triads(table, columns):
        values = np.stack([table.number(name) for name in names], axis=1)
        values = values[np.isfinite(values).all(axis=1)]
        if not len(values):
            continue
        size = float(np.median(np.linalg.norm(values, axis=1)))
        stated = channel(names[0])
        if stated is None or stated.unit == "counts":
            fits = _units_that_fit(what, size)
            notes.append(
                f"{', '.join(names)}: median length {size:.5g}"
                + (f"; that would fit {' or '.join(fits)}" if fits else "; raw counts or volts")
            )
        moved = values.std(axis=0)
        if moved.max() > 0.0 and moved.min() < 0.1 * np.median(moved):
            notes.append(f"{what}: {names[int(np.argmin(moved))]} hardly changes: the tool turns about it")
    return notes


def _triads(table: Table, columns: tuple[ColumnLook, ...]) -> list[tuple[str, list[str]]]:
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
                kind = signal.kind if signal is not None else next(
                    (k for k, marks in _MARKS.items() if any(mark in name.lower() for mark in marks)), "triad"
                )  # fmt: skip
                found.append((kind, three))
                break
    return found


_MARKS: Final = {"magnetometer": ("mag", "b", "h", "m"), "gyro": ("gyr", "w"), "accelerometer": ("acc", "g", "a")}


def _units_that_fit(kind: str, size: float) -> list[str]:
    """Units in which a still tool on the Earth would read this length, with how far off it is."""
    fits = []
    if kind != "magnetometer":
        for unit, one in (("m/s2", STANDARD_GRAVITY), ("g", 1.0), ("mg", 1000.0)):
            if abs(size / one - 1.0) < 0.1:
                fits.append(f"{unit} (gravity {round(size / one - 1.0, 3) + 0.0:+.1%})")
    if kind != "accelerometer":
        for unit, one in (("nT", 1.0), ("uT", 1e-3), ("gauss", 1e-5), ("mG", 1e-2)):
            if 20_000.0 <= size / one <= 70_000.0:
                fits.append(f"{unit} (a field of {size / one / 1000.0:.1f} uT)")
    return fits


def _bench(path: Path) -> None:
    from inclinometry.files.bench_csv import read_bench

    read_bench(path)


def _raw(path: Path) -> None:
    from inclinometry.files.survey_csv import read_raw_survey

    read_raw_survey(path)


def _six_axis(path: Path) -> None:
    from inclinometry.files.six_axis import read_six_axis

    read_six_axis(path, azimuth_reference="magnetic")


def _well(path: Path) -> None:
    from inclinometry.files.position_csv import read_well

    read_well(path)


def _log(path: Path) -> None:
    from inclinometry.files.log_csv import read_log

    read_log(path)


def _run(path: Path) -> None:
    from inclinometry.files.run_file import open_run

    for _ in open_run(path).blocks():
        pass


def _casing(path: Path) -> None:
    from inclinometry.files.casing_csv import read_casing

    read_casing(path)


def _holes(path: Path) -> None:
    from inclinometry.files.holes_csv import read_shots

    read_shots(path)


_READERS: Final[dict[str, Callable[[Path], None]]] = {
    "calibrate, verify": _bench,
    "survey --calibration": _raw,
    "survey, quality, msa": _six_axis,
    "position": _well,
    "readings": _log,
    "dynamic, allan": _run,
    "displacement": _casing,
    "holes": _holes,
}


def _lacks(path: Path, read: Callable[[Path], None]) -> str:
    try:
        read(path)
    except InclinometryError as error:
        text = str(error).partition(": ")[2] or str(error)
        return text.partition("; columns found")[0]
    return ""


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
    lines += [f"units = [{', '.join(map(text, profile.units))}]"] if profile.units else []
    lines += ["", "[axes]"] if profile.axes else []
    lines += [f"{kind} = [{', '.join(map(text, axes))}]" for kind, axes in profile.axes.items()]
    lines += ["", "[constants]"] if profile.constants else []
    lines += [f"{name} = {text(v) if isinstance(v, str) else repr(v)}" for name, v in profile.constants.items()]
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

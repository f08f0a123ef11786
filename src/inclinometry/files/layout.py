"""Files that are no plain table made into one: other formats as lines of cells, and the layout a profile states."""

from __future__ import annotations

import contextlib
import csv
import gzip
import hashlib
import json
import re
import struct
import tokenize
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import UNIT_LABELS
from inclinometry.errors import FileError, InputError
from inclinometry.files._quantities import dimension_of
from inclinometry.files.profile import PLAIN, SEPARATORS, Profile
from inclinometry.files.table import MOST_COLUMNS, Block
from inclinometry.opening import whole

if TYPE_CHECKING:
    from inclinometry.files.exchange import SurveyFile

MOST_VALUES: Final = 100_000_000
"""Of a file that is held in memory whole."""
NUMBER: Final = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
RULE: Final = re.compile(r"[\s+|]*([-=]{2,}[\s+|]*)+")
"""A line drawn below the names."""
LEGS: Final = re.compile(
    r"\W*(data normal )?from\W+to\W+(tape|length|distance)\W+(compass|azimuth|bearing)\W+(clino|inclination)\b.*", re.I
)
"""Above the legs of a cave: names, in a comment or not."""
LOOKED: Final = 400
"""Lines by which a layout is found."""
MOST_UNPACKED: Final = 1 << 30
"""Bytes of a packed file that is unpacked for its reader."""
LARGEST_TEXT: Final = 50_000_000
"""Bytes of a table in JSON, which takes twenty times as much in memory."""
LARGEST_ARRAYS: Final = 500_000_000
"""Bytes of a MATLAB file."""
ROWS: Final = 1 << 15
"""Rows of a block."""

Read: TypeAlias = Callable[[Path], tuple[list[str], Iterable[Sequence[str]]]]
"""Names and rows of a file."""


def opened(path: Path, digest: hashlib._Hash) -> Iterator[Block] | None:
    """Blocks of a file that is no text, a line of names first; None for a text.

    Excel, Parquet, HDF5, npz, mat and JSON by what they begin with, LAS by its first section, and each of them packed
    by gzip. Rows of arrays are counted from 1, their names are line 0.

    Raises
    ------
    FileError
        Damaged; without columns of one length; too many of them.
    """
    try:
        with path.open("rb") as stream:
            start = stream.read(4096)
    except (OSError, ValueError):
        return None  # the reader of texts says what is wrong
    if start.startswith(b"\x1f\x8b"):
        try:
            with gzip.open(path, "rb") as stream:
                start = stream.read(4096)
        except (OSError, EOFError, zlib.error):
            return None
        read = _kind(start)
        if read is None:
            return None
        blocks = _unpacked(path, read)
    else:
        read = _kind(start)
        if read is None:
            return None
        blocks = _lines(path, read)
    first = next(blocks)  # what is refused is refused before its bytes are counted
    with path.open("rb") as stream:
        while chunk := stream.read(1 << 20):
            digest.update(chunk)
    return chain([first], blocks)


def _kind(start: bytes) -> Read | None:
    """What reads a file that begins so; None for a text."""
    kinds = {b"PK\x03\x04": _zipped, b"PAR1": _parquet, b"\x89HDF": _hdf5, b"MATLAB": _mat}
    read: Read | None = next((read for magic, read in kinds.items() if start.startswith(magic)), None)
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    if read is None and text[:1] in (b"{", b"["):
        return _json
    if read is None and text[:2].upper() == b"~V":
        return _las
    if read is None and text[:1] == b"<" and b"trajectorys" in start:
        return _witsml
    if read is None and text[:5] in (b"IOGP,", b"OGP,0", b"OGP,1"):
        return _p7
    return read


def _unpacked(path: Path, read: Read) -> Iterator[Block]:
    """Blocks of a packed file that is no text, by a copy of it for as long as they are read."""
    with TemporaryDirectory(prefix="inclinometry-") as folder:
        copy = Path(folder, path.name.removesuffix(".gz"))
        try:
            with gzip.open(path, "rb") as stream, copy.open("wb") as out:
                for _ in range(MOST_UNPACKED >> 20):
                    out.write(stream.read(1 << 20))
                if stream.read(1):
                    raise FileError(f"it unpacks to more than {MOST_UNPACKED:,} bytes; unpack and split it", path=path)
        except (OSError, EOFError, zlib.error) as error:
            raise FileError(f"damaged where it is compressed ({error}); copy it again", path=path) from None
        try:
            yield from _lines(copy, read)
        except FileError as error:
            raise FileError(error.problem, path=path, line=error.line) from None


def _lines(path: Path, read: Read) -> Iterator[Block]:
    # arrays have rows and no lines: theirs are counted from 1 behind the names
    arrays = read in (_json, _mat, _hdf5, _parquet) or (read == _zipped and _of_numpy(path))
    names, rows = read(path)
    if len(names) > MOST_COLUMNS:
        raise FileError(f"{len(names):,} columns; allowed {MOST_COLUMNS:,}", path=path)
    held, first = [joined(names)], 0 if arrays else 1
    for row in rows:
        held.append(joined(row))
        if len(held) >= ROWS:
            yield _block(first, held)
            first, held = first + len(held), []
    if held:
        yield _block(first, held)


def _block(first: int, lines: list[str]) -> Block:
    text = "".join(lines)
    return Block(first, lines, text.isascii() and "_" not in text)


def joined(cells: Sequence[str], mark: str = ",") -> str:
    """A line of cells between marks, quoted where they hold one."""
    line = mark.join(cells)
    other = "," in line and mark != ","  # of names it would be a second separator
    if line.count(mark) == len(cells) - 1 and '"' not in line and "\n" not in line and "\r" not in line and not other:
        return line
    plain = (cell.replace("\n", " ").replace("\r", " ").replace('"', '""') for cell in cells)
    return mark.join(f'"{cell}"' for cell in plain)


def _arrays(path: Path, found: Mapping[str, Any]) -> tuple[list[str], Iterable[Sequence[str]]]:
    """Columns of the arrays that are as long as most: (n,) by its name, (n, 3) also _x, _y, _z, (n, m) _1 .. _m."""
    arrays: dict[str, Array] = {}
    for name, value in found.items():
        array = np.asarray(value)
        if array.ndim in (1, 2) and array.dtype.kind in "iufbUSO" and array.size:
            arrays[name] = array[:, 0] if array.ndim == 2 and array.shape[1] == 1 else array
    single = [name for name, array in arrays.items() if array.ndim == 2 and array.shape[0] == 1]
    for name in single:
        arrays[name] = arrays[name][0]
    lengths = [len(array) for array in arrays.values()]
    if not lengths:
        raise FileError("no columns of values are in it; arrays of n, or of n rows, are needed", path=path)
    rows = max(set(lengths), key=lambda n: (lengths.count(n), n))
    columns: dict[str, Array] = {}
    for name, array in arrays.items():
        if len(array) != rows:
            if 2 * len(array) > rows:
                raise FileError(f"{name!r} has {len(array)} rows, others {rows}; make them equal", path=path)
            continue
        if array.ndim == 1:
            columns[name] = array
            continue
        if array.shape[1] > MOST_COLUMNS:
            raise FileError(f"{name!r} has {array.shape[1]:,} columns; allowed {MOST_COLUMNS:,}", path=path)
        ends = "xyz" if array.shape[1] == 3 else [str(k + 1) for k in range(array.shape[1])]
        columns |= {_of_axis(name, end): array[:, k] for k, end in enumerate(ends)}
    if rows * len(columns) > MOST_VALUES:
        raise FileError(f"{rows * len(columns):,} values; allowed {MOST_VALUES:,}: split the file", path=path)
    return list(columns), _cells(columns.values(), rows)


def _of_axis(name: str, axis: str) -> str:
    """The name of a column of an array, its axis before its unit: accel_g becomes accel_x_g."""
    unit = re.search(rf"_({'|'.join(UNIT_LABELS)})$| ?[(\[][^()\[\]]*[)\]]$", name)
    return f"{name}_{axis}" if unit is None else f"{name[: unit.start()]}_{axis}{unit[0]}"


def _cells(columns: Iterable[Array], rows: int) -> Iterator[Sequence[str]]:
    """Rows of texts, block by block."""
    held = list(columns)
    for start in range(0, rows, ROWS):
        parts = [part[start : start + ROWS] for part in held]
        yield from zip(*(_texts(part) for part in parts), strict=True)


def _texts(part: Array) -> Sequence[str]:
    if part.dtype.kind in "iufb":
        return ["" if cell == "nan" else cell for cell in map(repr, part.astype(np.float64).tolist())]
    return [
        "" if cell is None else cell.decode("utf-8", "replace") if isinstance(cell, bytes) else str(cell)
        for cell in part.tolist()
    ]


def _json(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    """An object of arrays, or an array of objects; null is an empty cell."""
    text = whole(path, LARGEST_TEXT, "save the table as CSV or Parquet")
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        # one object a line, as loggers write them
        if not str(error).startswith("Extra data"):
            raise FileError(f"not JSON, or damaged ({error})", path=path) from None
        content = [_json_line(line, path, k) for k, line in enumerate(text.splitlines(), 1) if line.strip()]
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        names = list(dict.fromkeys(name for row in content for name in row))
        content = {name: [row.get(name) for row in content] for name in names}
    if not isinstance(content, dict):
        raise FileError("an object of arrays is needed: {name: [values], ...}", path=path)
    found: dict[str, Any] = {}
    for name, value in content.items():
        if not isinstance(value, list):
            continue
        try:
            array = np.array([np.nan if v is None else v for v in value])
        except ValueError:
            raise FileError(f"{name!r} has rows of different lengths; make them equal", path=path) from None
        found[name] = array
    # instruments fill their sets up with NaN: rows that hold nothing anywhere
    numbers = [
        v.astype(float).reshape(len(v), -1) for v in found.values() if v.dtype.kind in "if" and v.ndim and len(v)
    ]
    if len({len(v) for v in numbers}) == 1:
        there = ~np.isnan(np.concatenate(numbers, axis=1)).all(axis=1)
        found = {name: v[there] if v.ndim and len(v) == len(there) else v for name, v in found.items()}
    return _arrays(path, found)


def _json_line(line: bytes, path: Path, number: int) -> dict[str, Any]:
    try:
        row = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise FileError(f"not JSON, or damaged ({error})", path=path, line=number) from None
    if not isinstance(row, dict):
        raise FileError("an object is needed on every line: {name: value, ...}", path=path, line=number)
    return row


def _zipped(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    """A workbook, or numpy's archive of arrays."""
    if not _of_numpy(path):
        from inclinometry.files.excel import sheet_cells

        return sheet_cells(path)
    try:
        with np.load(path, allow_pickle=False) as stored:
            return _arrays(path, {name: stored[name] for name in stored.files})
    except _DAMAGED as error:
        raise FileError(f"not an archive of numpy's, or damaged ({error})", path=path) from None


_DAMAGED = (
    *(OSError, ValueError, TypeError, LookupError, EOFError, RuntimeError, SyntaxError, struct.error),
    *(tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)  # numpy reads the header of an array as Python's own text


def _of_numpy(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except (OSError, RuntimeError, zipfile.BadZipFile):  # RuntimeError: a version of zip unknown
        return path.suffix.lower() == ".npz"


def _mat(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    """MATLAB up to version 7; version 7.3 is HDF5."""
    from scipy.io import loadmat

    from inclinometry.files._mat5 import check_elements

    content = whole(path, LARGEST_ARRAYS, "save the table as CSV or Parquet")
    try:
        check_elements(content)  # of wrong types scipy's reader does not complain, the interpreter crashes
        stored = loadmat(path)
    except Exception as error:
        raise FileError(f"not a MATLAB file, or damaged ({error})", path=path) from None
    found: dict[str, Any] = {}
    for name, array in stored.items():
        if name.startswith("__"):
            continue
        if array.dtype.names and array.size == 1:
            # a structure: its fields, by their own names
            found |= {field: array[field].item() for field in array.dtype.names}
        else:
            found[name] = array
    return _arrays(path, found)


def _hdf5(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    """The datasets of HDF5, by the last part of their names; an attribute unit or units completes the name."""
    import h5py

    found: dict[str, Any] = {}

    def take(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim in (1, 2) and item.size <= MOST_VALUES:
            # version 7.3 of MATLAB stores arrays transposed
            array = item[()].T if "MATLAB_class" in item.attrs else item[()]
            unit = next((item.attrs[key] for key in ("unit", "units") if key in item.attrs), "")
            found[name] = array, unit.decode() if isinstance(unit, bytes) else str(unit)

    try:
        with h5py.File(path, "r") as stored:
            stored.visititems(take)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise FileError(f"not HDF5, or damaged ({error})", path=path) from None
    last = [name.rsplit("/", 1)[-1] for name in found]
    # by the last part of the name where that tells them apart
    names = last if len(set(last)) == len(last) else [name.replace("/", "_") for name in found]
    columns = {_with_unit(name, unit): array for name, (array, unit) in zip(names, found.values(), strict=True)}
    return _arrays(path, columns)


def _parquet(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from inclinometry.files.parquet import _units

    try:
        stored = pq.ParquetFile(path, pre_buffer=False)
        rows, names = stored.metadata.num_rows, list(stored.schema_arrow.names)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise FileError(
            f"not a Parquet file, or a damaged one ({str(error)[:200]}); write it again", path=path
        ) from None
    if rows * len(names) > MOST_VALUES:
        raise FileError(f"{rows * len(names):,} values; allowed {MOST_VALUES:,}: split the file", path=path)
    units = _units(stored.schema_arrow)

    def cells() -> Iterator[Sequence[str]]:
        for batch in stored.iter_batches(ROWS, use_threads=False):
            columns = []
            for column in batch.columns:
                try:
                    columns.append(_texts(column.cast(pa.float64()).to_numpy(zero_copy_only=False)))
                except pa.ArrowException:
                    columns.append(["" if v is None else str(v) for v in column.to_pylist()])
            yield from zip(*columns, strict=True)

    return [_with_unit(name, units.get(name)) for name in names], cells()


def _with_unit(name: str, unit: str | None) -> str:
    """The name with the unit that stands apart from it, unless it says it itself."""
    from inclinometry.files.profile import describes, stated_unit

    return name if not unit or describes(name) or stated_unit(name) else f"{name} ({unit})"


def _las(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    from inclinometry.files.las import las_sheet

    sheet = las_sheet(path)
    names = [_with_unit(name, sheet.units.get(name)) for name in sheet.columns]
    columns = [_texts(c) if isinstance(c, np.ndarray) else c for c in sheet.columns.values()]
    if sheet.north and "azimuth_reference" not in names:
        names.append("azimuth_reference")
        columns.append([sheet.north] * len(sheet.rows))
    return names, zip(*columns, strict=True)


def _witsml(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    from inclinometry.files.witsml import read_witsml

    return _survey(read_witsml(path))


def _p7(path: Path) -> tuple[list[str], Iterable[Sequence[str]]]:
    from inclinometry.files.p7 import read_p7

    surveys = read_p7(path).surveys
    if len(surveys) != 1:
        raise FileError(f"it holds {len(surveys)} surveys; take one out by `inclinometry convert --sheet`", path=path)
    return _survey(next(iter(surveys.values())))


def _survey(file: SurveyFile) -> tuple[list[str], Iterable[Sequence[str]]]:
    from inclinometry.files.survey_csv import column_texts, columns_of

    columns = columns_of(file)
    return [column.name for column in columns], zip(*map(column_texts, columns), strict=True)


def named_lines(lines: list[str]) -> list[str]:
    """The lines, the names without the # before them where a comment right above rows of numbers is their names.

    Only a comment with as many cells, of which none is a number, above the first row of numbers is that.
    """
    place = next((k for k, line in enumerate(lines[:LOOKED]) if line.strip() and line.lstrip()[0] != "#"), 0)
    above = lines[place - 1].lstrip() if place else ""
    if above[:1] != "#":
        return lines
    names = above.lstrip("# ")
    for mark in ("\t", ";", ",", " "):
        row, cells = _roughly(lines[place].strip(), mark), _roughly(names.strip(), mark)
        if len(row) != len(cells) or len(row) < 2 or not all(NUMBER.fullmatch(cell.strip()) for cell in row):
            continue
        if all(cell.strip() and not NUMBER.fullmatch(cell.strip()) for cell in cells):
            return [*lines[: place - 1], names, *lines[place:]]
    return lines


def refuse_legs(lines: list[str], path: Path, first: int = 1) -> None:
    """FileError for the shots of a cave from station to station, which are no stations along a hole."""
    for row, line in enumerate(lines[:LOOKED]):
        if LEGS.fullmatch(line.strip()):
            problem = "legs of a cave (from, to, tape, compass, clino), which Survex, Therion and Compass take"
            remedy = "a cave instrument is calibrated by its calibration shots, with --profile topodroid or sap6"
            raise FileError(f"{problem}; {remedy}", path=path, line=first + row)


def find_layout(lines: list[str]) -> tuple[Profile, str]:
    """How the lines are cut into cells, and where the names and the rows begin."""
    lines = named_lines(lines)
    if not lines:
        return PLAIN, "a table of its own format"
    filled = [
        (k, line.rstrip("\r\n"))
        for k, line in enumerate(lines[:LOOKED])
        if line.strip() and line.lstrip()[0] != "#" and not RULE.fullmatch(line)
    ]
    if not filled:
        return PLAIN, "text without a table"
    best, width, mark = 0.0, 1, ","
    for candidate in ("\t", ";", ",", " "):
        counts = Counter(len(_roughly(line, candidate)) for _, line in filled)
        number, times = max(counts.items(), key=lambda item: (item[1] * (item[0] > 1), item[0]))
        share = times / len(filled) if number > 1 else 0.0
        # a later separator must explain clearly more lines: decimal commas look like one
        if share > best + 0.05:
            best, width, mark = share, number, candidate
    table = [(k, _roughly(line, mark)) for k, line in filled if len(_roughly(line, mark)) == width]
    if not table:
        return PLAIN, "text without a table"
    numbers = [sum(bool(NUMBER.fullmatch(cell.strip())) for cell in cells) for _, cells in table]
    header = numbers[0] == 0 or (len(table) > 1 and numbers[0] < numbers[1] and numbers[0] * 2 < width)
    units = header and len(table) > 2 and numbers[1] == 0 and numbers[2] > 0 and _units_row(table[1][1])
    first = table[0][0]
    before = any(line.strip() and line.lstrip()[0] != "#" for line in lines[:first])
    plain = (
        header and not units and mark in ",;\t" and not before and not (mark == ";" and ", " in "".join(table[0][1]))
    )
    profile = PLAIN if plain else Profile(separator=mark, skip=first if before else 0, header=header, units_row=units)
    name = next(name for name, text in SEPARATORS.items() if text == mark)
    words = [f"text, separated by {name}", f"{first} lines before the names" if before else ""]
    words += ["no names of columns" if not header else "", "a line of units" if units else ""]
    return profile, ", ".join(word for word in words if word)


def _roughly(line: str, mark: str) -> list[str]:
    return line.split() if mark == " " else cut(line, mark)


def _bare(unit: str) -> str:
    """A unit without its brackets: m/(s^2) is m/s^2."""
    return re.sub(r"[\[\]()]", "", unit).strip()


def _units_row(cells: list[str]) -> bool:
    written = [_bare(cell) for cell in cells if cell.strip()]
    known = sum(dimension_of(cell) is not None for cell in written)
    return 0 < len(written) <= 2 * known


def with_layout(given: Profile, found: Profile) -> Profile:
    """What is stated of the columns, with the layout that was found."""
    return replace(given, separator=found.separator, skip=found.skip, header=found.header, units_row=found.units_row)


def with_found_layout(blocks: Iterator[Block], given: Profile, path: Path) -> Iterator[Block]:
    """Blocks of a table, as it stands where its first line is the names; else behind its preamble, with its units.

    A layout is taken only where it is plain to see: names above rows of numbers. Numbers without names are refused.
    """
    first = next(blocks, None)
    if first is None:
        return
    refuse_legs(first.lines, path, first.first)
    first = first._replace(lines=named_lines(first.lines))
    both = chain([first], blocks)
    found, _ = find_layout(first.lines[:LOOKED])
    if found.header and found.lays_out:
        yield from laid_out(both, with_layout(given, found), path)
    elif given.lays_out:
        yield from laid_out(both, given, path)
    else:
        yield from both


def _pointless(value: float) -> str:
    """A number with an exponent for its point, which goes with points and commas alike: 70.1 is 701e-1."""
    whole, _, decimals = repr(value).partition(".")
    return f"{whole}{decimals}e-{len(decimals)}" if decimals and "e" not in decimals else repr(value)


def cut(line: str, mark: str) -> list[str]:
    """Cells of a line."""
    if mark == " ":
        return line.split()
    if '"' in line:
        # a carriage return inside a line, or a quotation mark that opens a cell without end: as it stands
        with contextlib.suppress(csv.Error):
            return next(csv.reader([line], delimiter=mark, skipinitialspace=True))
    return line.split(mark)


def laid_out(blocks: Iterator[Block], profile: Profile, path: Path) -> Iterator[Block]:
    """Blocks of a plain table whose rows keep the numbers of their lines; numbers are left as they are written.

    Raises
    ------
    FileError
        A row of another length than the names, or than the first row where there are none; a comment that may be one.
    """
    mark, kept, width = profile.separator, None, 0
    awaited = ["names"] * profile.header + ["units"] * profile.units_row
    constants = [value if isinstance(value, str) else _pointless(value) for value in profile.constants.values()]
    extra = [*profile.constants, *["time_s"] * bool(profile.rate_hz)]
    blank: list[tuple[int, str]] = []
    count, origin = 0, None
    for first, lines, plain in blocks:
        origin = first if origin is None else origin
        out = [""] * len(lines)
        for row, line in enumerate(lines):
            text = line.strip()
            if first + row < origin + profile.skip or not text or _unread(text, kept is None):
                continue
            mark = mark or next((mark for mark in ("\t", ";", ",") if mark in line), " ")
            between = "\t" if mark == " " else mark
            cells = cut(line, mark)
            if kept is None:
                while cells and not cells[-1].strip():
                    cells.pop()
                width = len(cells)
                names = [cell.strip() if profile.header else f"column {k}" for k, cell in enumerate(cells, 1)]
                kept = [k for k, name in enumerate(names) if profile.columns.get(name.removeprefix("column ")) != ""]
                blank = [(k, profile.blank[key]) for k, name in enumerate(names)
                         if (key := name.removeprefix("column ")) in profile.blank]  # fmt: skip
                if not profile.header:
                    yield Block(first + row, [joined([*(names[k] for k in kept), *extra], between)], False)
            if awaited:
                if awaited.pop(0) == "units":
                    names = _with_units(names, cells, profile, path, first + row)
                if not awaited:
                    out[row] = joined([*(names[k] for k in kept), *extra], between)
                continue
            _check_row(cells, width, text, path, first + row)
            if text[0] == "#":
                continue
            for k, none in blank:
                cells[k] = "" if cells[k].strip() == none else cells[k]
            time = [_pointless(count / profile.rate_hz)] if profile.rate_hz else []
            more = [*(cells[k] for k in kept), *constants, *time]
            out[row] = joined(more, between) if '"' in line or constants else between.join(more)
            count += 1
        yield Block(first, out, plain)


def _unread(text: str, above: bool) -> bool:
    """A comment above the names, or a drawn line."""
    return (above and text[0] == "#") or (text[0] in "-=+|" and RULE.fullmatch(text) is not None)


def _with_units(names: list[str], cells: list[str], profile: Profile, path: Path, line: int) -> list[str]:
    """Names with the units below them; a column the profile names keeps its name, if the unit agrees."""
    found = []
    for name, cell in zip(names, cells + [""] * len(names), strict=False):
        unit = _bare(cell)
        if name not in profile.columns:
            found.append(_with_unit(name, unit))
            continue
        try:
            profile.check_unit(name, unit, name)
        except InputError as error:
            raise FileError(str(error), path=path, line=line) from None
        found.append(name)
    return found


def _check_row(cells: list[str], width: int, text: str, path: Path, line: int) -> None:
    if text[0] == "#":
        if len(cells) == width > 1:
            problem = "this comment has as many cells as a row; delete it, or quote the cell that begins with #"
            raise FileError(problem, path=path, line=line)
    elif len(cells) < width or any(cell.strip() for cell in cells[width:]):
        problem = f"this row has {len(cells)} cells, the first line of the table {width}; complete or remove it"
        raise FileError(problem, path=path, line=line)

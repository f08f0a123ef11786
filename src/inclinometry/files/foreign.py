"""Tables that are no text: Excel, Parquet, HDF5, npz, mat, JSON, LAS, WITSML and P7, their numbers as they are."""

from __future__ import annotations

import gzip
import hashlib
import json
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from inclinometry.arrays import Array
from inclinometry.constants import UNIT_LABELS
from inclinometry.errors import FileError, InputError, in_file
from inclinometry.files.frame import Column, Frame
from inclinometry.files.not_read import not_read
from inclinometry.files.profile import current, with_unit
from inclinometry.files.text import OLD_EXCEL, Block, Progress, whole_text, wide
from inclinometry.findings import Finding
from inclinometry.opening import damaged, opened, too_large, whole

if TYPE_CHECKING:
    from inclinometry.files.survey_file import SurveyFile

MOST_COLUMNS: Final = 1000
MOST_VALUES: Final = 100_000_000
"""Of a file that is held in memory whole."""
MOST_UNPACKED: Final = 1 << 30
"""Bytes of a packed file that is unpacked for its reader."""

Pieces: TypeAlias = Iterator[Frame] | Iterator[Block]
"""Consecutive rows of a table that has columns by name, or of a sheet, whose names are somewhere in it."""
Read: TypeAlias = Callable[[Path], Pieces]


def foreign_pieces(
    path: Path, digest: hashlib._Hash, read: Read | None = None, progress: Progress | None = None
) -> Pieces | None:
    """A file that is no text, piece by piece; None for a text. `digest` is complete behind the last piece.

    Excel, Parquet, HDF5, npz, mat and JSON by what they begin with, LAS by its first section, unless `read` says which;
    each of them packed by gzip, too. Rows of arrays are counted from 1.
    """
    with opened(path) as stream:
        start = stream.read(4096)
    packed = start.startswith(b"\x1f\x8b")
    try:
        if packed:
            with gzip.open(path, "rb") as stream:
                start = stream.read(4096)
    except (OSError, EOFError, zlib.error):
        return None
    if read is None and (found := not_read(path, wide(start) or start)) is not None:
        raise FileError(found, path=path)
    read = read or _kind(start)
    if read is None:
        return None
    if read is _parquet and not packed:
        read = partial(_parquet, progress=progress)
    pieces = _unpacked(path, read) if packed else read(path)
    first: Any = next(pieces)
    width = len(first.columns if isinstance(first, Frame) else first.lines[0])
    if width > MOST_COLUMNS:
        raise FileError(too_large("columns", width, MOST_COLUMNS), path=path)
    return _counted(path, chain([first], pieces), digest)


def _counted(path: Path, pieces: Iterator[Any], digest: hashlib._Hash) -> Iterator[Any]:
    """The pieces, then the bytes of the file: formats are read here and there, not from one end to the other."""
    yield from pieces
    with opened(path) as stream:
        while chunk := stream.read(1 << 20):
            digest.update(chunk)


def _kind(start: bytes) -> Read | None:
    """What reads a file that begins so; None for a text."""
    kinds: dict[bytes, Read] = {
        b"PK\x03\x04": _zipped,
        OLD_EXCEL: _excel,
        b"PAR1": _parquet,
        b"\x89HDF": _hdf5,
        b"MATLAB 7.3": _hdf5,
    }
    read: Read | None = next((read for magic, read in kinds.items() if start.startswith(magic)), None)
    text = (wide(start) or start).removeprefix(b"\xef\xbb\xbf").lstrip()
    if read is None and re.match(rb"\{|\[\s*([\[{\d\"-]|\])", text):
        return _json
    if read is None and re.match(rb"(#[^\n]*\s+)*~[VWC]", text, re.I):
        return _las
    if read is None and re.match(rb"&&\s", text):
        return _wits
    if read is None and text[:1] == b"<" and re.search(rb"<(\w+:)?(trajectorys|Trajectory)\b", text):
        return _witsml
    if read is None and text[:5] in (b"IOGP,", b"OGP,0", b"OGP,1"):
        return _p7
    return read


def _unpacked(path: Path, read: Read) -> Iterator[Any]:
    """Pieces of a packed file that is no text, by a copy of it for as long as they are read."""
    with TemporaryDirectory(prefix="inclinometry-") as folder:
        copy = Path(folder, path.name.removesuffix(".gz"))
        try:
            with gzip.open(path, "rb") as stream, copy.open("wb") as out:
                for _ in range(MOST_UNPACKED >> 20):
                    out.write(stream.read(1 << 20))
                if stream.read(1):
                    raise FileError(too_large("bytes", MOST_UNPACKED + 1, MOST_UNPACKED), path=path)
        except (OSError, EOFError, zlib.error) as error:
            raise FileError(damaged("gzip", error), path=path) from None
        try:
            for piece in read(copy):
                yield replace(piece, path=path) if isinstance(piece, Frame) else piece
        except FileError as error:
            raise in_file(error, path) from None


def _arrays(path: Path, found: Mapping[str, Any]) -> Iterator[Frame]:
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
        raise FileError(Finding("file-empty", {"what": "columns"}), path=path)
    rows = max(set(lengths), key=lambda n: (lengths.count(n), n))
    columns: dict[str, Array] = {}
    for name, array in arrays.items():
        if len(array) != rows:
            if 2 * len(array) > rows:
                raise FileError(_other_shape(name, str(array.shape), str((rows, *array.shape[1:]))), path=path)
            continue
        if array.ndim == 1:
            columns[name] = array
            continue
        if array.shape[1] > MOST_COLUMNS:
            raise FileError(too_large("columns", array.shape[1], MOST_COLUMNS), path=path)
        ends = "xyz" if array.shape[1] == 3 else [str(k + 1) for k in range(array.shape[1])]
        columns |= {_of_axis(name, end): array[:, k] for k, end in enumerate(ends)}
    if rows * len(columns) > MOST_VALUES:
        raise FileError(too_large("values", rows * len(columns), MOST_VALUES), path=path)
    yield Frame(path, {name: _column(array) for name, array in columns.items()}, np.arange(1, rows + 1), word="row")


def _other_shape(name: str, shape: str, expected: str) -> Finding:
    return Finding("input-shape", {"name": name, "shape": shape, "expected": expected})


def _column(array: Array) -> Column:
    """Numbers, or texts."""
    if array.dtype.kind in "iufb":
        return array.astype(np.float64)
    return tuple(map(_text, array.tolist()))


def _text(cell: Any) -> str:
    """A cell as a text of one line."""
    if cell is None:
        return ""
    text = cell.decode("utf-8", "replace") if isinstance(cell, bytes) else str(cell)
    return text.replace("\n", " ").replace("\r", " ")


def _of_axis(name: str, axis: str) -> str:
    """The name of a column of an array, its axis before its unit: accel_g becomes accel_x_g."""
    unit = re.search(rf"_({'|'.join(UNIT_LABELS)})$| ?[(\[][^()\[\]]*[)\]]$", name)
    return f"{name}_{axis}" if unit is None else f"{name[: unit.start()]}_{axis}{unit[0]}"


def _json(path: Path) -> Pieces:
    """An object of arrays, or an array of objects; null is an empty cell."""
    # in memory JSON takes twenty times as much
    text, guess = whole_text(whole(path, 50_000_000), path, current().encoding)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        # one object a line, as loggers write them; the parser says in no other way that the first one ends
        if getattr(error, "msg", "") != "Extra data":
            raise FileError(damaged("JSON", error), path=path) from None
        content = [_json_line(line, path, k) for k, line in enumerate(text.splitlines(), 1) if line.strip()]
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        names = list(dict.fromkeys(name for row in content for name in row))
        content = {name: [row.get(name) for row in content] for name in names}
    if not isinstance(content, dict):
        raise FileError(Finding("table-json"), path=path)
    found: dict[str, Any] = {}
    for name, value in content.items():
        if not isinstance(value, list):
            continue
        try:
            array = np.array([np.nan if v is None else v for v in value])
        except ValueError:
            raise FileError(_other_shape(name, f"({len(value)}, ..)", f"({len(value)}, n)"), path=path) from None
        found[name] = array
    # a record of this program, such as a calibration
    own = str(content.get("schema", "")).startswith("inclinometry/")
    if own and not any(v.dtype.kind in "if" for v in found.values()):
        raise FileError(Finding("table-json"), path=path)
    # instruments fill their sets up with NaN: rows that hold nothing anywhere
    numbers = [
        v.astype(float).reshape(len(v), -1) for v in found.values() if v.dtype.kind in "if" and v.ndim and len(v)
    ]
    if len({len(v) for v in numbers}) == 1:
        there = ~np.isnan(np.concatenate(numbers, axis=1)).all(axis=1)
        found = {name: v[there] if v.ndim and len(v) == len(there) else v for name, v in found.items()}
    return (replace(frame, findings=guess) for frame in _arrays(path, found))


def _json_line(line: str, path: Path, number: int) -> dict[str, Any]:
    try:
        row = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise FileError(damaged("JSON", error), path=path, line=number) from None
    if not isinstance(row, dict):
        raise FileError(Finding("table-json"), path=path, line=number)
    return row


def _excel(path: Path) -> Pieces:
    from inclinometry.files.excel import sheet_blocks

    return sheet_blocks(path, current().sheet)


def _zipped(path: Path) -> Pieces:
    """A workbook, or numpy's archive of arrays."""
    if not _of_numpy(path):
        return _excel(path)
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except _DAMAGED as error:
        raise FileError(damaged("NumPy .npz", error), path=path) from None
    return _arrays(path, arrays)


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


def _hdf5(path: Path) -> Pieces:
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
        raise FileError(damaged("HDF5", error), path=path) from None
    last = [name.rsplit("/", 1)[-1] for name in found]
    # by the last part of the name where that tells them apart
    names = last if len(set(last)) == len(last) else [name.replace("/", "_") for name in found]
    try:
        columns = {with_unit(name, unit): array for name, (array, unit) in zip(names, found.values(), strict=True)}
    except InputError as error:
        raise in_file(error, path) from None
    return _arrays(path, columns)


def _parquet(path: Path, progress: Progress | None = None) -> Pieces:
    from inclinometry.files.parquet import parquet_pieces

    return parquet_pieces(path, progress)


def _las(path: Path) -> Pieces:
    from inclinometry.files.las import las_frame

    return iter([las_frame(path)])


def _north() -> str | None:
    """Of the azimuths, where it is stated for the whole file."""
    stated = current().constants.get("azimuth_reference")
    return None if stated is None else str(stated)


def _witsml(path: Path) -> Pieces:
    from inclinometry.files.witsml import read_witsml

    return _survey(path, read_witsml(path, sheet=current().sheet, azimuth_reference=_north()))


def _wits(path: Path) -> Pieces:
    from inclinometry.files.wits0 import read_record_7

    unit = next((unit for unit in current().units if unit in ("m", "ft")), None)
    return _survey(path, read_record_7(path, unit, _north()))


def _p7(path: Path) -> Pieces:
    from inclinometry.files.p7 import read_p7_survey

    return _survey(path, read_p7_survey(path, azimuth_reference=_north(), sheet=current().sheet))


def _survey(path: Path, file: SurveyFile) -> Iterator[Frame]:
    from inclinometry.files.survey_file import columns_of

    # an item of WITS that nothing names
    columns = {f"item {name}" if name.isdigit() else name: column for name, column in columns_of(file).items()}
    if file.azimuth_reference == _north():
        columns.pop("azimuth_reference", None)  # it is stated for the whole file
    yield Frame(path, columns, np.arange(2, len(file) + 2), 1, findings=file.findings)

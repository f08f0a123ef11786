"""Frames of a WITS level 0 stream: && on a line, items of four digits and a value, !! on a line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from inclinometry.core.errors import FileError
from inclinometry.io._lines import LineReader

BEGIN: Final = "&&"
END: Final = "!!"
_ITEM: Final = re.compile(r"([0-9]{4})(.*)")
_LARGEST: Final = 10_000  # items of one frame; 25 records of 99 items are defined


class Frame(NamedTuple):
    """One frame: the line its && stands in, and item number -> value as text, with the line of each."""

    line: int
    items: dict[str, str]
    lines: dict[str, int]


class Broken(NamedTuple):
    """A frame that cannot be used: the line it fails in and why."""

    line: int
    why: str


class Frames(NamedTuple):
    """All frames of a stream, those that are broken, and the digest of the file."""

    whole: list[Frame]
    broken: list[Broken]
    digest: str


def read_frames(path: str | Path) -> Frames:
    r"""Split a stream into frames; what is broken is listed and left out. Lines between frames are not looked at.

    Raises
    ------
    FileError
        Not text; no frame at all.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.wits").write_text("&&\n07089.5\n!!\n&&\n070810\n&&\n070811\n!!\n")
    ...     found = read_frames(Path(folder, "a.wits"))
    >>> [frame.items for frame in found.whole], found.broken
    ([{'0708': '9.5'}, {'0708': '11'}], [Broken(line=4, why='the frame does not end (!! is missing)')])
    """
    reader = LineReader(Path(path))
    found = Frames([], [], "")
    frame: Frame | None = None
    why: Broken | None = None
    for line, text in _lines(reader):
        if text == BEGIN:
            _close(found, frame, why or (frame and Broken(frame.line, "the frame does not end (!! is missing)")))
            frame, why = Frame(line, {}, {}), None
        elif text == END and frame is not None:
            _close(found, frame, why)
            frame, why = None, None
        elif text == END:
            found.broken.append(Broken(line, "the end of a frame (!!) without its beginning (&&)"))
        elif frame is not None and text:
            why = why or _take(frame, line, text)
    _close(found, frame, why or (frame and Broken(frame.line, "the frame does not end (!! is missing): truncated?")))
    if not found.whole and not found.broken:
        raise FileError("no frame (&& to !!); this is no WITS level 0 stream", path=path)
    return found._replace(digest=reader.digest)


def _lines(reader: LineReader) -> Iterator[tuple[int, str]]:
    for block in reader.blocks():
        for line, text in enumerate(block.lines, block.first):
            yield line, text.strip()


def _take(frame: Frame, line: int, text: str) -> Broken | None:
    """Add one item; what is wrong with it, or None."""
    item = _ITEM.fullmatch(text)
    if item is None:
        return Broken(line, f"{text[:40]!r} is no item (four digits and a value)")
    if item[1] in frame.items:
        return Broken(line, f"item {item[1]} appears twice in one frame")
    if len(frame.items) >= _LARGEST:
        return Broken(line, f"more than {_LARGEST} items in one frame")
    frame.items[item[1]] = item[2].strip()
    frame.lines[item[1]] = line
    return None


def _close(found: Frames, frame: Frame | None, why: Broken | None) -> None:
    if frame is None:
        return
    if why is not None:
        found.broken.append(why)
    elif frame.items:
        found.whole.append(frame)
    else:
        found.broken.append(Broken(frame.line, "the frame is empty"))

"""From a line, or a frame of WITS level 0, to the values of its fields as text."""

from __future__ import annotations

from collections.abc import Mapping

from inclinometry.io._wits0_frames import BEGIN, END, Frame
from inclinometry.io._wits0_frames import _take as take_item
from inclinometry.io.instrument.checksum import without_checksum
from inclinometry.io.instrument.protocol import Protocol

Fields = Mapping[str, str]


class Refused(Exception):  # noqa: N818 - not an error of anybody's: lines like this are expected
    """A line that cannot be used: kind of event, and why."""

    def __init__(self, kind: str, why: str) -> None:
        super().__init__(why)
        self.kind, self.why = kind, why


class FieldReader:
    """Fields of one line after the other; remembers an open frame."""

    def __init__(self, protocol: Protocol) -> None:
        self._protocol = protocol
        self._frame: Frame | None = None

    def clear(self) -> None:
        """A new connection begins."""
        self._frame = None

    def take(self, line: bytes) -> Fields | None:
        """The fields of a line that completes a sample, None for one that does not.

        Raises
        ------
        Refused
            With the kind of event and the reason.
        """
        try:
            text = line.decode("ascii")
        except UnicodeDecodeError:
            raise Refused("garbage", f"{shown(line)} is not ASCII") from None
        if self._protocol.framing == "wits0":
            return self._item(text)
        body = without_checksum(self._protocol.checksum, text)
        if body is None:
            raise Refused("checksum", f"{shown(line)} has a wrong checksum ({self._protocol.checksum})")
        if self._protocol.expression is not None:
            match = self._protocol.expression.fullmatch(body.strip())
            if match is None:
                raise Refused("garbage", f"{shown(line)} does not fit the pattern")
            return {name: value or "" for name, value in match.groupdict().items()}
        cells = body.split(None if self._protocol.delimiter == " " else self._protocol.delimiter)
        columns = self._protocol.columns
        if len(cells) != len(columns):
            raise Refused("garbage", f"{shown(line)} has {len(cells)} cells; {len(columns)} are expected")
        return dict(zip(columns, cells, strict=True))

    def _item(self, text: str) -> Fields | None:
        frame = self._frame
        if text == BEGIN:
            self._frame = Frame(0, {}, {})
            if frame is not None:
                raise Refused("partial", "a frame does not end (!! is missing)")
            return None
        if frame is None:
            if text == END:
                raise Refused("partial", "the end of a frame (!!) without its beginning (&&)")
            raise Refused("garbage", f"{shown(text.encode())} stands outside a frame")
        if text != END:
            wrong = take_item(frame, 0, text)
            if wrong is not None:
                self._frame = None
                raise Refused("garbage", wrong.why)
            return None
        self._frame = None
        mine = [name for name in self._protocol.used if name in frame.items]
        if not mine:
            return None  # a frame of another record
        missing = next((name for name in self._protocol.used if name not in frame.items), None)
        if missing is not None:
            raise Refused("partial", f"a frame has no item {missing}")
        return frame.items


def shown(line: bytes) -> str:
    r"""The beginning of a line as it can be printed.

    Examples
    --------
    >>> shown(b"\xff12")
    "'\\xff12'"
    """
    text = line[:40].decode("ascii", "backslashreplace").replace("'", "")
    return (
        "'"
        + "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
        + ("..." if len(line) > 40 else "")
        + "'"
    )

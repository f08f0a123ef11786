"""Bytes to lines, within bounds whatever comes."""

from __future__ import annotations

from collections.abc import Iterator

from inclinometry.io.instrument.protocol import Protocol


class Lines:
    r"""Collects bytes and gives out whole lines.

    Parameters
    ----------
    protocol : Protocol
        Its terminator, and the longest line.

    Examples
    --------
    >>> from inclinometry.io.instrument.protocol_toml import read_protocol
    >>> lines = Lines(read_protocol("csv-line"))
    >>> list(lines.feed(b"1,2\r\n3,")), list(lines.feed(b"4\n")), lines.rest
    ([b'1,2'], [b'3,4'], b'')
    """

    def __init__(self, protocol: Protocol) -> None:
        # after \r\n a bare \n ends a line too: converters between the two are common
        self._end = b"\n" if protocol.terminator.endswith(b"\n") else protocol.terminator
        self._longest = protocol.longest
        self._buffer = b""
        self._skipping = False
        self.overrun = 0
        """How often bytes were thrown away because no line ended; the caller sets it back."""

    @property
    def rest(self) -> bytes:
        """The beginning of a line whose end has not come."""
        return self._buffer

    def clear(self) -> None:
        """Forget what has come; a new connection begins."""
        self._buffer, self._skipping = b"", False

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Whole lines, without their ends and the white space around them; empty lines are passed over."""
        pieces = (self._buffer + data).split(self._end)
        self._buffer = pieces.pop()
        for piece in pieces:
            if self._skipping:
                self._skipping = False
            elif len(piece) > self._longest:
                self.overrun += 1
            elif line := piece.strip():
                yield line
        if len(self._buffer) > self._longest:
            self.overrun += 0 if self._skipping else 1
            self._buffer, self._skipping = self._buffer[-len(self._end) :], True

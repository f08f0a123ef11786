"""From the bytes of a text file to blocks of lines: encoding, line ends, digest, progress; bounded memory."""

from __future__ import annotations

import codecs
import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from inclinometry.core.errors import FileError

CHUNK = 1 << 20
LONGEST_LINE = 1 << 20
Progress = Callable[[int], None]

_MAGIC = {
    b"PK\x03\x04": "a zip archive (an Excel workbook?); save it as CSV",
    b"\x1f\x8b": "compressed with gzip; unpack it first",
    b"%PDF": "a PDF document; a CSV text is needed",
    b"\x89HDF": "an HDF5 file; a CSV text is needed",
    b"PAR1": "a Parquet file; a CSV text is needed",
}


class Block(NamedTuple):
    """Consecutive lines without their ends; `plain` when ASCII without an underscore, so that float() is strict."""

    first: int
    lines: list[str]
    plain: bool


@dataclass
class LineReader:
    """Reads a file once; `digest` is complete when `blocks` is exhausted."""

    path: Path
    progress: Progress | None = None
    _hash: hashlib._Hash = field(default_factory=hashlib.sha256)

    @property
    def digest(self) -> str:
        """Digest of the bytes read so far, as `core.digest.digest_file` gives for the whole file."""
        return "sha256:" + self._hash.hexdigest()

    def blocks(self) -> Iterator[Block]:
        """Blocks of about one megabyte; FileError for what is not text."""
        carry, line = "", 1
        for text in self._texts():
            *lines, carry = (carry + text).replace("\r\n", "\n").replace("\r", "\n").split("\n")
            if len(carry) > LONGEST_LINE:
                raise FileError(
                    f"this line is longer than {LONGEST_LINE} characters; no table", path=self.path, line=line
                )
            if lines:
                yield _block(line, lines)
                line += len(lines)
        if carry:
            yield _block(line, [carry])

    def _texts(self) -> Iterator[str]:
        """Decoded pieces that never end between a carriage return and its line feed."""
        decoder: codecs.IncrementalDecoder | None = None
        held, done, lines = "", 0, 1
        for chunk in self._chunks():
            decoder = decoder or codecs.getincrementaldecoder(_encoding(chunk, self.path))("strict")
            done += len(chunk)
            try:
                text = held + decoder.decode(chunk, final=not chunk)
            except UnicodeDecodeError as error:
                raise _not_text(error, chunk, lines, self.path) from None
            if "\0" in text:
                raise FileError("not a text file (it holds zero bytes); save it as CSV, UTF-8", path=self.path)
            held = "\r" if chunk and text.endswith("\r") else ""
            lines += text.count("\n")
            yield text[: len(text) - len(held)]
            if self.progress is not None and chunk:
                self.progress(done)

    def _chunks(self) -> Iterator[bytes]:
        """Raw pieces, an empty one last so that the decoder can finish."""
        try:
            with self.path.open("rb") as stream:
                while chunk := stream.read(CHUNK):
                    self._hash.update(chunk)
                    yield chunk
        except FileNotFoundError:
            raise FileError("there is no such file; check the name", path=self.path) from None
        except IsADirectoryError:
            raise FileError("this is a folder; give the name of a file", path=self.path) from None
        except (OSError, ValueError) as error:
            raise FileError(f"cannot be read ({getattr(error, 'strerror', None) or error})", path=self.path) from None
        yield b""


def _block(first: int, lines: list[str]) -> Block:
    text = "".join(lines)
    return Block(first, lines, text.isascii() and "_" not in text)


def _encoding(start: bytes, path: Path) -> str:
    """UTF-8 unless a byte-order mark says otherwise."""
    if start.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        raise FileError("UTF-32 text is not read; save it as UTF-8", path=path)
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for magic, what in _MAGIC.items():
        if start.startswith(magic):
            raise FileError(f"this is {what}", path=path)
    return "utf-8-sig"


def _not_text(error: UnicodeDecodeError, chunk: bytes, line: int, path: Path) -> FileError:
    """The error's position refers to the decoder's buffer, which may begin with bytes kept from the chunk before."""
    piece = bytes(error.object)
    line += piece[: error.start].count(b"\n")
    value = f"byte 0x{piece[error.start]:02x}" if piece else "its end"
    return FileError(f"not {error.encoding} text ({value}, {error.reason}); save it as UTF-8", path=path, line=line)

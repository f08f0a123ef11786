"""Texts of a certificate's PDF as they are drawn, cell by cell, read by nothing but the PDF itself."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any

from pyhanko.pdf_utils.reader import PdfFileReader

_TEXT = re.compile(rb"/(f\d+) [\d.]+ Tf .*?Tm(?:\[(.*?)\]TJ|(\(.*?\)|<.*?>)\s*Tj)\s*\nET", re.DOTALL)
_STRING = re.compile(rb"\(((?:\\.|[^\\()])*)\)|<([0-9A-Fa-f]*)>", re.DOTALL)
_ESCAPED = {b"n": b"\n", b"r": b"\r", b"t": b"\t", b"b": b"\b", b"f": b"\f"}


def texts(pdf: bytes) -> list[str]:
    """Every text of the document in the order in which it is drawn; a cell of a table is one."""
    found = []
    for page in _pages(_of(PdfFileReader(io.BytesIO(pdf)).root["/Pages"])):
        fonts = {
            name.removeprefix("/"): _letters(_of(_of(font)["/ToUnicode"]).data)
            for name, font in _of(_of(page["/Resources"])["/Font"]).items()
        }
        for font, many, one in _TEXT.findall(_of(page["/Contents"]).data):
            strings = _STRING.findall(many or one)
            codes = b"".join(bytes.fromhex(h.decode()) if h else _bytes(s) for s, h in strings)
            letters = fonts[font.decode()]
            said = "".join(letters.get(codes[n : n + 2], "\ufffd") for n in range(0, len(codes), 2))
            found.append(said.replace("\u200b", ""))
    return found


def _of(thing: Any) -> Any:
    return thing.get_object() if hasattr(thing, "get_object") else thing


def _pages(node: Any) -> Iterator[Any]:
    for kid in node["/Kids"]:
        page = _of(kid)
        yield from _pages(page) if page["/Type"] == "/Pages" else [page]


def _letters(cmap: bytes) -> dict[bytes, str]:
    """Code of a glyph -> its letters."""
    found = {}
    for block in re.findall(rb"beginbfchar(.*?)endbfchar", cmap, re.DOTALL):
        for code, letters in re.findall(rb"<([0-9A-Fa-f]+)>\s*<([0-9A-Fa-f]+)>", block):
            found[bytes.fromhex(code.decode())] = bytes.fromhex(letters.decode()).decode("utf-16-be")
    return found


def _bytes(text: bytes) -> bytes:
    """The bytes of a string in parentheses."""

    def one(escape: re.Match[bytes]) -> bytes:
        said = escape[1]
        return bytes([int(said, 8)]) if said.isdigit() else _ESCAPED.get(said, said)

    return re.sub(rb"\\([0-7]{1,3}|.)", one, text, flags=re.DOTALL)

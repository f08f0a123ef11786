"""Reading WITSML's XML without trusting it: no entities, no network, bounded size; values with units."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from inclinometry.core.errors import FileError, InputError
from inclinometry.io import _witsml_schema as schema

LARGEST: Final = 256 * 1024 * 1024
"""Bytes of a file that are parsed; 10,000 stations with everything have some 24 MB."""
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def load(path: Path) -> tuple[Any, bytes]:
    """The root element `trajectorys`, checked for namespace and version, and the bytes of the file."""
    from lxml import etree

    data = _bytes(path)
    # a document type is where entities are declared; no WITSML document has one
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        line = data[: max(data.find(b"<!DOCTYPE"), data.find(b"<!ENTITY"))].count(b"\n") + 1
        raise FileError("a document type or entity is declared; remove it, WITSML has none", path=path, line=line)
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, remove_comments=True, remove_pis=True
    )
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        line = error.lineno or 1
        raise FileError(f"not well-formed XML: {error.msg}; is the file truncated?", path=path, line=line) from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise FileError("a document type is declared; remove it, WITSML has none", path=path, line=1)
    _check_root(path, root)
    return root, data


def _bytes(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        if size > LARGEST:
            problem = f"the file has {size} bytes; allowed: up to {LARGEST}: split it by trajectory"
            raise FileError(problem, path=path)
        return path.read_bytes()
    except FileNotFoundError:
        raise FileError("there is no such file; check the name", path=path) from None
    except (OSError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"cannot be read ({getattr(error, 'strerror', None) or error})", path=path) from None


def _check_root(path: Path, root: Any) -> None:
    wanted = f"{{{schema.namespace()}}}trajectorys"
    if root.tag != wanted:
        problem = f"the root is {root.tag!r}; {wanted!r} (WITSML {schema.version()}) is needed"
        raise FileError(problem, path=path, line=root.sourceline)
    if root.get("version") != schema.version():
        found = root.get("version")
        problem = f"version is {found!r}; {schema.version()!r} is needed: export it so"
        raise FileError(problem, path=path, line=root.sourceline)


def children(element: Any) -> Iterator[tuple[str, Any]]:
    """Children in WITSML's namespace, by name."""
    start = f"{{{schema.namespace()}}}"
    for child in element:
        if isinstance(child.tag, str) and child.tag.startswith(start):
            yield child.tag[len(start) :], child


def text_of(element: Any) -> str:
    """Text on one line."""
    return " ".join((element.text or "").split())


def quantity_of(path: Path, name: str, element: Any, kind: str) -> float:
    """Value in SI (rad, nT); FileError naming element and line for what is no finite number or has no such unit."""
    text = text_of(element)
    if not _NUMBER.fullmatch(text):
        problem = f"{name} is {text[:40]!r}; a finite number is needed: correct it or remove the element"
        raise FileError(problem, path=path, line=element.sourceline)
    try:
        return float(text) * schema.factor(kind, element.get("uom"))
    except InputError as error:
        raise FileError(f"{name} {error}", path=path, line=element.sourceline) from None

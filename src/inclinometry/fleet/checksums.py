"""Digests of the files that a table was committed with: written beside the table, checked whenever they are read."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final

from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError, InputError
from inclinometry.findings import Finding
from inclinometry.fleet.store import STAGED, Store

FOLDER: Final = "_checksums"
"""In the folder of a table; each file in it is named by the SHA-256 of its own bytes."""
_LOG: Final = "_delta_log"


def digest_of(store: Store, name: str) -> str:
    """SHA-256 of a file's bytes; FileError where it cannot be read."""
    found = hashlib.sha256()
    with store.reading(name) as stream:
        while piece := stream.read(1 << 22):
            found.update(piece)
    return f"sha256:{found.hexdigest()}"


def recorded(store: Store, table: str) -> dict[str, set[str]]:
    """Name in the store -> digests with which the file was committed; a result made again may have several.

    Raises
    ------
    FileError
        A file of checksums is damaged.
    """
    found: dict[str, set[str]] = {}
    for name in _files(store, table):
        try:
            with store.reading(name) as stream:
                content = stream.read()
        except FileNotFoundError:
            continue
        except FileError:
            if store.size(name) is None:
                continue  # put together with others meanwhile
            raise
        if not name.endswith(f"-{_mark(content)}.json"):
            raise FileError(Finding("fleet-checksums"), path=store.uri(name))
        for path, digests in json.loads(content).items():
            found.setdefault(f"{table}/{path}", set()).update(digests)
    return found


def record(store: Store, table: str, made: Mapping[str, str] | None = None) -> None:
    """Record the digests of `made`, or of all data of the table, and of its log, where they are not recorded yet.

    Call it behind a commit.
    """
    have, start = recorded(store, table), len(table) + 1
    new = {name: digest for name, digest in (made or {}).items() if digest not in have.get(name, ())}
    # a hint that the log may do without, and which no checksum can follow
    store.remove(f"{table}/{_LOG}/_last_checkpoint")
    for name in store.names(f"{table}/{_LOG}" if made is not None else table):
        plain = name.rpartition("/")[2]
        log = f"/{_LOG}/" in name and plain[:1].isdigit()
        if (log or name.endswith(".parquet")) and name not in have and not STAGED.match(plain):
            new[name] = digest_of(store, name)
    old = _files(store, table)
    if len(old) < 64:  # more are put together
        _write(store, table, {name[start:]: [digest] for name, digest in new.items()})
        return
    for name, digest in new.items():
        have.setdefault(name, set()).add(digest)
    _write(store, table, {name[start:]: sorted(digests) for name, digests in have.items()})
    for name in old:
        store.remove(name)


def damaged(
    store: Store, table: str, have: Mapping[str, set[str]], names: Iterable[str] | None = None
) -> Iterator[str]:
    """Names, of the log or of `names`, whose bytes are not those recorded, or that are gone."""
    if names is None:
        names = there = {name for name in store.names(f"{table}/{_LOG}") if name in have}
        recorded_log = [name for name in have if f"/{_LOG}/" in name]
        # the log before a checkpoint may be cleaned up
        last = max((_number(name) for name in there if ".checkpoint" in name), default=-1)
        yield from (name for name in recorded_log if name not in there and _number(name) > last)
    for name in sorted(names):
        if name in have and digest_of(store, name) not in have[name]:
            yield name


def opened_table(store: Store, table: str, broken: Callable[[str], Finding]) -> tuple[Any, dict[str, set[str]]]:
    """The Delta table, None where there is none, with the digests recorded of it, its log checked against them.

    Raises
    ------
    InputError
        The log is damaged; `broken` makes a finding of why.
    """
    from deltalake import DeltaTable
    from deltalake.exceptions import TableNotFoundError

    have = recorded(store, table)
    for name in damaged(store, table, have):
        raise FileError(broken("SHA-256"), path=store.uri(name))
    try:
        return guarded(lambda: DeltaTable(store.uri(table)), store.uri(table), broken), have
    except TableNotFoundError:
        return None, have


def guarded(read: Callable[[], Any], where: str, broken: Callable[[str], Finding]) -> Any:
    """What `read` gives; InputError for whatever the libraries raise about bytes that no checksum was recorded of."""
    from deltalake.exceptions import TableNotFoundError

    try:
        return read()
    except (TableNotFoundError, InputError, MemoryError):
        raise
    except BaseException as error:
        # a library in Rust that gives up raises what is no Exception
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        said = (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
        raise FileError(broken(said), path=where) from None


def _files(store: Store, table: str) -> list[str]:
    names = (name for name in store.names(f"{table}/{FOLDER}") if name.endswith(".json"))
    return sorted(names)


def _mark(content: bytes) -> str:
    return digest_bytes(content).removeprefix("sha256:")[:20]


def _number(name: str) -> int:
    return int(name.rpartition("/")[2].partition(".")[0])


def _write(store: Store, table: str, digests: Mapping[str, list[str]]) -> None:
    if not digests:
        return
    content = json.dumps(digests, sort_keys=True, separators=(",", ":")).encode()
    with store.staged(f"{table}/{FOLDER}") as (scratch, publish):
        scratch.write_bytes(content)
        publish(f"{table}/{FOLDER}/{time.time_ns():020d}-{_mark(content)}.json")

"""Reaching the database of a ledger: addresses, connections, and its errors as sentences."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from sqlalchemy import create_engine, event
from sqlalchemy.engine import URL, Connection, Engine, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, IntegrityError, NoSuchModuleError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from inclinometry.core.errors import InputError

PATIENCE: Final = 20
"""Seconds a writer waits for another one."""
_WRITE_LOCK: Final = 0x1E_D6E7  # any number, the same for all writers of one PostgreSQL database
_CACHE_KIB: Final = 65_536  # indexes of a million records in memory; the usual 2 MiB makes appending crawl
_REMEDIES: Final = (
    ("disk is full", "free some space on the disk, then try again; nothing was recorded"),
    ("No space left", "free some space on the disk of the server, then try again; nothing was recorded"),
    ("disk I/O", "check the disk and the space on it; nothing was recorded"),
    ("readonly", "the file or its folder cannot be written; check its permissions"),
    ("read-only", "the server does not let this user write; ask its administrator"),
    ("unable to open", "check the path and its permissions"),
    ("not a database", "this file is not a ledger"),
    ("malformed", "the file is damaged; restore a backup"),
    ("decode", "a text in it was changed; run `inclinometry ledger verify`"),
    ("locked", "another program holds the ledger; close it, then try again"),
    ("lock timeout", "another program holds the ledger; close it, then try again"),
    ("append-only", "records are never changed"),
    ("no such table", "the file was changed; run `inclinometry ledger verify`"),
    ("password authentication failed", "check user and password of the address"),
    ("does not exist", "check user and database of the address"),
    ("could not translate host", "check the host of the address"),
    ("failed to resolve host", "check the host of the address"),
    ("connection failed", "check that the server runs and that the address is right"),
    ("connection is bad", "check that the server runs and that the address is right"),
)


class LedgerError(InputError):
    """The ledger refuses, or cannot be used: what happened and what to do."""


class ConflictError(LedgerError):
    """Somebody else recorded the same thing first; nothing was lost, look again."""


def default_path() -> Path:
    """Where the bench keeps its ledger when none is named: in the user's data folder."""
    base = os.environ.get("LOCALAPPDATA") if os.name == "nt" else os.environ.get("XDG_DATA_HOME")
    return Path(base or Path.home() / ".local" / "share") / "inclinometry" / "ledger.sqlite"


def shown(where: str | Path) -> str:
    """An address without its password.

    Examples
    --------
    >>> shown("postgresql://anna:secret@host/lab"), shown("lab.sqlite")
    ('postgresql://anna:***@host/lab', 'lab.sqlite')
    """
    text = str(where)
    if "://" not in text:
        return text
    try:
        url = make_url(text)
        hidden = {key: "***" if "pass" in key else value for key, value in url.query.items()}
        return url.set(query=hidden).render_as_string(hide_password=True)
    except (ArgumentError, ValueError):  # what cannot be read is hidden up to the last @
        return re.sub(r"(password=)[^&]*", r"\1***", re.sub(r"://.*@", "://***@", text))


def engine(where: str | Path, *, create: bool = False, read_only: bool = False) -> Engine:
    """The database engine of a path or an address.

    Parameters
    ----------
    where : str or Path
    create : bool
        The file may be missing.
    read_only : bool
        Nothing will be written; a ledger in a folder that cannot be written can be read then.

    Raises
    ------
    LedgerError
        No such file (unless `create`), not a file, a kind of database that is not supported.
    """
    text = str(where)
    return _server(text) if "://" in text else _file(text, create, read_only)


def _file(text: str, create: bool, read_only: bool) -> Engine:
    path = Path(text)
    try:
        os.fsencode(text)
        if "\0" in text:
            raise ValueError("a NUL character")
        there, plain = path.exists(), path.is_file()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise LedgerError(f"{text!r:.200}: this cannot be the path of a ledger ({reason})") from None
    if there and not plain:
        kind = "a folder" if path.is_dir() else "a device or pipe"
        raise LedgerError(f"{text} is {kind}, not a ledger; name a file")
    if not there and not create:
        raise LedgerError(f"{text}: there is no such ledger; make one with `inclinometry ledger init {text}`")
    address = URL.create("sqlite", database=text)
    if read_only and _sealed(path):
        address = URL.create("sqlite", database=path.resolve().as_uri(), query={"immutable": "1", "uri": "true"})
    made = create_engine(address, poolclass=NullPool if create else None)
    event.listen(made, "connect", _prepare_sqlite)
    event.listen(made, "begin", _begin_sqlite)
    return made


def _sealed(path: Path) -> bool:
    """Whether SQLite could not make the files it needs beside the ledger, and nobody else works on it."""
    folder = path.resolve().parent
    beside = path.resolve().with_name(path.resolve().name + "-wal")
    return not os.access(folder, os.W_OK) and not beside.exists()


def _server(text: str) -> Engine:
    try:
        url = make_url(text)
        backend = url.get_backend_name()
        # the rest of a port or query that cannot be read comes to light here
        made = create_engine(url.set(drivername="postgresql+psycopg"), pool_pre_ping=True)
    except ModuleNotFoundError as error:
        raise LedgerError(
            f"{shown(text)}: {error.name} is not installed; PostgreSQL needs `pip install inclinometry[postgresql]`"
        ) from None
    except (ArgumentError, NoSuchModuleError, ValueError):
        raise LedgerError(
            f"{shown(text)}: this address cannot be used; write postgresql://user:password@host:5432/database, "
            "characters such as @ and / in the password as %40 and %2F"
        ) from None
    if backend not in ("postgresql", "postgres"):
        raise LedgerError(
            f"{shown(text)}: a ledger is a file path (SQLite) or postgresql+psycopg://user:password@host/database"
        )
    if not url.database:
        raise LedgerError(f"{shown(text)} names no database; write postgresql://user:password@host/database")
    event.listen(made, "begin", _begin_postgresql)
    return made


def _prepare_sqlite(connection: Any, _: object) -> None:
    connection.isolation_level = None  # SQLAlchemy's BEGIN below, not the driver's late one
    cursor = connection.cursor()
    for pragma in (
        f"busy_timeout = {PATIENCE * 1000}",
        "foreign_keys = ON",
        "synchronous = FULL",
        "trusted_schema = OFF",
        f"cache_size = -{_CACHE_KIB}",
    ):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _begin_sqlite(connection: Connection) -> None:
    # a writer takes the lock at once: two that both read first and then write would exclude each other for ever
    connection.exec_driver_sql("BEGIN IMMEDIATE" if connection.get_execution_options().get("writing") else "BEGIN")


def _begin_postgresql(connection: Connection) -> None:
    if not connection.get_execution_options().get("writing"):
        return
    # one writer at a time, or two would take the same place in the chain; an acknowledged record is on the disk even
    # where the server is set up to be quicker than that
    connection.exec_driver_sql(
        f"SET LOCAL lock_timeout = '{PATIENCE}s'; SELECT pg_advisory_xact_lock({_WRITE_LOCK}); "
        "SELECT set_config('synchronous_commit', 'on', true) WHERE current_setting('synchronous_commit') = 'off'"
    )


@contextmanager
def translated(where: str) -> Iterator[None]:
    """Errors of the database as sentences."""
    try:
        yield
    except IntegrityError as error:
        cause = str(error.orig)
        if "append-only" in cause:
            raise LedgerError(f"{where}: {cause.splitlines()[0]}") from None
        raise ConflictError(
            f"{where}: somebody else has just recorded this; nothing was lost, load the page again"
        ) from None
    except DBAPIError as error:
        cause = " ".join(str(error.orig).split())[:200]
        remedy = next((text for mark, text in _REMEDIES if mark in cause), "nothing was recorded")
        if error.connection_invalidated:
            remedy = "the connection was lost; load the page again to see whether the last record was kept"
        raise LedgerError(f"{where}: {cause}: {remedy}") from None
    except SQLAlchemyError as error:
        raise LedgerError(f"{where}: the ledger cannot be used ({error})") from None

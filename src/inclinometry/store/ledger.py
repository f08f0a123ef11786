"""The ledger: append records, read them back; nothing is ever changed."""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

from sqlalchemy import ColumnElement, Select, and_, event, func, select
from sqlalchemy import create_engine as _create_engine
from sqlalchemy.engine import Connection, Engine, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, IntegrityError, NoSuchModuleError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from inclinometry.core.digest import digest_bytes
from inclinometry.core.errors import InputError
from inclinometry.store import chain
from inclinometry.store.kinds import KINDS, VERSION, check
from inclinometry.store.schema import CHAIN, DOCUMENT, TABLES

CLOCK_SLACK: Final = timedelta(minutes=2)
"""How far the clock may have gone back since the last record; beyond that nothing is recorded."""
LONGEST_BODY: Final = 20_000_000
LARGEST_DOCUMENT: Final = 100_000_000
_WRITE_LOCK: Final = 0x1E_D6E7  # any number, the same for all writers of one PostgreSQL database


class LedgerError(InputError):
    """The ledger refuses, or cannot be used: what happened and what to do."""


class ConflictError(LedgerError):
    """Somebody else recorded the same thing first; nothing was lost, look again."""


@dataclass(frozen=True)
class Record:
    """One record, as stored.

    kind, id, seq : what it is, its name, its place in the chain (from 1).
    created : UTC, ISO 8601 with microseconds.
    author : name of the user.
    version : of its schema.
    keys, body : what it is found by, and the rest.
    digest : SHA-256 of all of this.
    """

    kind: str
    id: str
    seq: int
    created: str
    author: str
    version: int
    keys: Mapping[str, Any]
    body: Mapping[str, Any]
    digest: str = field(default="", compare=False)


@dataclass(frozen=True)
class Draft:
    """A record to be appended: kind, keys and body, with the files it refers to (media type, bytes)."""

    kind: str
    keys: Mapping[str, Any]
    body: Mapping[str, Any]
    documents: Sequence[tuple[str, bytes]] = ()


def now() -> datetime:
    """The time, UTC."""
    return datetime.now(UTC)


class Ledger:
    """A ledger at a path (SQLite) or a database address (PostgreSQL).

    Parameters
    ----------
    where : str or Path
        Path of a SQLite file, or "postgresql+psycopg://user:password@host/database". It must exist: see
        `inclinometry.store.admin.create`.
    clock : callable, optional
        Gives the time; for tests.
    read_only : bool
        Refuse to append.

    Raises
    ------
    LedgerError
        No such ledger, not a ledger, a ledger of a newer program.
    """

    def __init__(self, where: str | Path, *, clock: Callable[[], datetime] = now, read_only: bool = False) -> None:
        self.where = str(where)
        self.read_only = read_only
        self._clock = clock
        self._engine = engine(where)
        with self._reading() as connection:
            if not self._engine.dialect.has_table(connection, "chain"):
                raise LedgerError(f"{self.shown}: this is not a ledger; make one with `inclinometry ledger init`")

    @property
    def shown(self) -> str:
        """Where it is, without a password."""
        return shown(self.where)

    def close(self) -> None:
        """Release the files and connections."""
        self._engine.dispose()

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- writing -------------------------------------------------------------------------------------------------------

    def append(self, kind: str, keys: Mapping[str, Any], body: Mapping[str, Any], *, author: str) -> Record:
        """Record one thing; when this returns it is on the disk.

        Raises
        ------
        InputError
            A body that does not fit its kind.
        ConflictError
            A record with the same unique keys is already there.
        LedgerError
            Read-only, disk full, a clock that went back.
        """
        return self.append_all([Draft(kind, keys, body)], author=author)[0]

    def append_all(self, drafts: Sequence[Draft], *, author: str) -> list[Record]:
        """Record several things in one step: all of them or none."""
        if self.read_only:
            raise LedgerError(f"{self.shown} was opened for reading only; nothing was recorded")
        ready = [self._ready(draft) for draft in drafts]
        with self._writing() as connection:
            head, last = self._tail(connection)
            created = self._now(last)
            records: list[Record] = []
            for draft, body in ready:
                head, record = self._insert(connection, head, draft, body, created, author)
                records.append(record)
        return records

    def _ready(self, draft: Draft) -> tuple[Draft, str]:
        check(draft.kind, draft.keys, draft.body)
        body = chain.compact(dict(draft.body))
        if len(body) > LONGEST_BODY:
            raise InputError(f"a {draft.kind} record of {len(body)} characters; allowed {LONGEST_BODY}")
        for media_type, data in draft.documents:
            if len(data) > LARGEST_DOCUMENT:
                raise InputError(f"a document ({media_type}) of {len(data)} bytes; allowed {LARGEST_DOCUMENT}")
        return draft, body

    def _now(self, last: str | None) -> str:
        time = self._clock().astimezone(UTC)
        if last is not None and time < datetime.fromisoformat(last) - CLOCK_SLACK:
            raise LedgerError(
                f"the clock says {time:%Y-%m-%d %H:%M:%S} UTC, but the last record is of {last[:19]}: nothing was "
                "recorded; set the clock of this computer"
            )
        return time.isoformat(timespec="microseconds")

    def _insert(
        self, connection: Connection, head: chain.Head, draft: Draft, body: str, created: str, author: str
    ) -> tuple[chain.Head, Record]:
        name, seq = uuid.uuid4().hex, head.seq + 1
        digest = chain.record_digest(draft.kind, name, created, author, VERSION, draft.keys, body)
        link = chain.next_link(head.link, seq, draft.kind, name, created, digest)
        connection.execute(
            CHAIN.insert().values(seq=seq, kind=draft.kind, record=name, created=created, digest=digest, link=link)
        )
        connection.execute(
            TABLES[draft.kind]
            .insert()
            .values(seq=seq, id=name, created=created, author=author, version=VERSION, body=body, **draft.keys)
        )
        for media_type, data in draft.documents:
            key = digest_bytes(data)
            if connection.execute(select(DOCUMENT.c.digest).where(DOCUMENT.c.digest == key)).first() is None:
                connection.execute(DOCUMENT.insert().values(digest=key, media_type=media_type, data=data))
        keys = dict(draft.keys)
        return chain.Head(seq, link), Record(
            draft.kind, name, seq, created, author, VERSION, keys, json.loads(body), digest
        )

    @contextmanager
    def filling(self) -> Iterator[Connection]:
        """A connection that writes records made elsewhere into this ledger, which must be empty."""
        if self.read_only:
            raise LedgerError(f"{self.shown} was opened for reading only; nothing was recorded")
        with self._writing() as connection:
            if self._tail(connection)[0].seq:
                raise LedgerError(f"{self.shown} holds records already; import into a new ledger")
            yield connection

    # -- reading -------------------------------------------------------------------------------------------------------

    def get(self, kind: str, name: str) -> Record:
        """The record of that id; LedgerError when there is none."""
        found = self._select(_query(kind).where(TABLES[kind].c.id == name), kind)
        if not found:
            raise LedgerError(f"there is no {kind} record {name!r:.60} in {self.shown}")
        return found[0]

    def latest(self, kind: str, **keys: Any) -> Record | None:
        """The newest record with these keys, None when there is none."""
        table = TABLES[kind]
        found = self._select(_query(kind).where(_matching(kind, keys)).order_by(table.c.seq.desc()).limit(1), kind)
        return found[0] if found else None

    def find(self, kind: str, *, after: int = 0, limit: int = 1000, newest: bool = False, **keys: Any) -> list[Record]:
        """Records with these keys in order of their place in the chain, beyond `after`; newest first when asked.

        With `newest`, `after` is the place before which to go on (0: from the end).
        """
        column = TABLES[kind].c.seq
        query = _query(kind).where(_matching(kind, keys)).limit(limit)
        if newest:
            query = query.order_by(column.desc())
            query = query.where(column < after) if after else query
        else:
            query = query.where(column > after).order_by(column)
        return self._select(query, kind)

    def current(self, kind: str, *, limit: int = 1000, after: str = "") -> list[Record]:
        """The newest record of each key (tools, rigs, sites, users), by name, beyond the name `after`."""
        table, (key, *_) = TABLES[kind], KINDS[kind].keys
        newest = (
            select(func.max(table.c.seq).label("seq"))
            .where(table.c[key] > after)
            .group_by(table.c[key])
            .order_by(table.c[key])
            .limit(limit)
            .subquery()
        )
        return self._select(_query(kind).join(newest, newest.c.seq == table.c.seq).order_by(table.c[key]), kind)

    def count(self, kind: str, **keys: Any) -> int:
        """How many records of the kind have these keys."""
        with self._reading() as connection:
            query = select(func.count()).select_from(TABLES[kind]).where(_matching(kind, keys))
            return int(connection.execute(query).scalar_one())

    def document(self, digest: str) -> tuple[str, bytes]:
        """Media type and bytes of a file a record refers to; LedgerError when it is not there or was changed."""
        with self._reading() as connection:
            row = connection.execute(select(DOCUMENT).where(DOCUMENT.c.digest == digest)).first()
        if row is None:
            raise LedgerError(f"there is no document {digest:.80} in {self.shown}")
        if digest_bytes(row.data) != digest:
            raise LedgerError(f"document {digest} in {self.shown} was changed; run `inclinometry ledger verify`")
        return row.media_type, row.data

    def head(self) -> chain.Head:
        """The last link of the chain."""
        with self._reading() as connection:
            return self._tail(connection)[0]

    @contextmanager
    def snapshot(self) -> Iterator[Connection]:
        """A connection that sees one state of the whole ledger, however long it reads."""
        level = "REPEATABLE READ" if self._engine.dialect.name == "postgresql" else "SERIALIZABLE"
        frozen = self._engine.execution_options(isolation_level=level)
        with _translated(self.shown), frozen.begin() as connection:
            yield connection

    # -- inside --------------------------------------------------------------------------------------------------------

    def _select(self, query: Select[Any], kind: str) -> list[Record]:
        with self._reading() as connection:
            return [_record(kind, row) for row in connection.execute(query)]

    def _tail(self, connection: Connection) -> tuple[chain.Head, str | None]:
        row = connection.execute(
            select(CHAIN.c.seq, CHAIN.c.link, CHAIN.c.created).order_by(CHAIN.c.seq.desc())
        ).first()
        return (chain.Head(0, chain.GENESIS), None) if row is None else (chain.Head(row.seq, row.link), row.created)

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        with _translated(self.shown), self._engine.connect() as connection:
            yield connection

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        writing = self._engine.execution_options(writing=True)
        with _translated(self.shown), writing.begin() as connection:
            if connection.dialect.name == "postgresql":
                # one writer at a time, or two would take the same place in the chain
                connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_WRITE_LOCK})")
            yield connection


def _query(kind: str) -> Select[Any]:
    if kind not in TABLES:
        raise InputError(f"record kind is {kind!r}; allowed: {', '.join(TABLES)}")
    return select(TABLES[kind], CHAIN.c.digest).join(CHAIN, CHAIN.c.seq == TABLES[kind].c.seq)


def _matching(kind: str, keys: Mapping[str, Any]) -> ColumnElement[bool]:
    unknown = set(keys) - set(KINDS[kind].keys)
    if unknown:
        raise InputError(f"{kind} records are not found by {', '.join(sorted(unknown))}; use {tuple(KINDS[kind].keys)}")
    return and_(True, *(TABLES[kind].c[name] == value for name, value in keys.items()))


def _record(kind: str, row: Any) -> Record:
    keys = {name: getattr(row, name) for name in KINDS[kind].keys}
    return Record(kind, row.id, row.seq, row.created, row.author, row.version, keys, json.loads(row.body), row.digest)


def shown(where: str | Path) -> str:
    """An address without its password."""
    text = str(where)
    return make_url(text).render_as_string(hide_password=True) if "://" in text else text


def engine(where: str | Path, *, create: bool = False) -> Engine:
    """The database engine of a path or an address.

    Raises
    ------
    LedgerError
        No such file (unless `create`), a kind of database that is not supported.
    """
    text = str(where)
    if "://" not in text:
        path = Path(text)
        if not create and not path.is_file():
            raise LedgerError(f"{text}: there is no such ledger; make one with `inclinometry ledger init {text}`")
        made = _create_engine(f"sqlite:///{path}", poolclass=NullPool if create else None)
        event.listen(made, "connect", _prepare_sqlite)
        event.listen(made, "begin", _begin_sqlite)
        return made
    try:
        url = make_url(text)
        if url.get_backend_name() != "postgresql":
            raise LedgerError(
                f"{shown(text)}: a ledger is a file path (SQLite) or postgresql+psycopg://user:password@host/database"
            )
        return _create_engine(url.set(drivername="postgresql+psycopg"), pool_pre_ping=True)
    except (ArgumentError, NoSuchModuleError, ModuleNotFoundError) as error:
        raise LedgerError(
            f"the address of the ledger cannot be used ({error}); PostgreSQL needs "
            "`pip install inclinometry[postgresql]`"
        ) from None


def _prepare_sqlite(connection: Any, _: object) -> None:
    connection.isolation_level = None  # SQLAlchemy's BEGIN below, not the driver's late one
    cursor = connection.cursor()
    for pragma in ("busy_timeout = 20000", "foreign_keys = ON", "synchronous = FULL", "trusted_schema = OFF"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _begin_sqlite(connection: Connection) -> None:
    # a writer takes the lock at once: two that both read first and then write would exclude each other for ever
    connection.exec_driver_sql("BEGIN IMMEDIATE" if connection.get_execution_options().get("writing") else "BEGIN")


@contextmanager
def _translated(where: str) -> Iterator[None]:
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
        remedies = (
            ("disk is full", "free some space on the disk, then try again"),
            ("disk I/O", "check the disk"),
            ("readonly", "the file or its folder cannot be written; check its permissions"),
            ("unable to open", "check the path and its permissions"),
            ("not a database", "this file is not a ledger"),
            ("malformed", "the file is damaged; restore a backup"),
            ("locked", "another program holds the ledger; close it, then try again"),
            ("append-only", "records are never changed"),
        )
        remedy = next((text for mark, text in remedies if mark in cause), "nothing was recorded")
        raise LedgerError(f"{where}: {cause}: {remedy}") from None
    except SQLAlchemyError as error:
        raise LedgerError(f"{where}: the ledger cannot be used ({error})") from None


def default_path() -> Path:
    """Where the bench keeps its ledger when none is named: in the user's data folder."""
    base = os.environ.get("LOCALAPPDATA") if os.name == "nt" else os.environ.get("XDG_DATA_HOME")
    return Path(base or Path.home() / ".local" / "share") / "inclinometry" / "ledger.sqlite"

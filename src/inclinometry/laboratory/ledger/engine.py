"""The database of a ledger: tables and schemas of its records, guards, connections, its errors as findings."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import (
    BigInteger,
    Column,
    ForeignKey,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    column,
    create_engine,
    event,
    inspect,
    select,
    table,
    type_coerce,
)
from sqlalchemy.engine import URL, Connection, Engine, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, IntegrityError, NoSuchModuleError, SQLAlchemyError
from sqlalchemy.pool import NullPool
from sqlalchemy.types import NullType

from inclinometry.digest import digest_bytes
from inclinometry.errors import InputError, not_among, out_of_range, refused, system_reason, wrong_kind
from inclinometry.findings import Finding, Value
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.chain import LedgerError

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator

PATIENCE: Final = 20
"""Seconds a writer waits for another one."""
_WRITE_LOCK: Final = 0x1E_D6E7  # any number, the same for all writers of one PostgreSQL database
# neither engine has a code for all of these: a server that cannot be reached has none, a missing table the general one
_SAID: Final = {
    "disk is full": "ledger-disk-full",
    "No space left": "ledger-disk-full",
    "disk I/O": "ledger-access",
    "readonly": "ledger-access",
    "read-only": "ledger-access",
    "unable to open": "ledger-access",
    "not a database": "ledger-damaged",
    "malformed": "ledger-damaged",
    "decode": "ledger-damaged",
    "no such table": "ledger-damaged",
    "locked": "ledger-locked",
    "lock timeout": "ledger-locked",
    "authentication failed": "ledger-server",
    "does not exist": "ledger-server",
    "translate host": "ledger-server",
    "resolve host": "ledger-server",
    "connection failed": "ledger-server",
    "connection is bad": "ledger-server",
}
"""What a database's own sentence holds -> code; that of no other is ledger-refused."""


class ConflictError(LedgerError):
    """Somebody else recorded the same thing first; nothing was lost, look again."""


def default_path() -> Path:
    """Where the bench keeps its ledger when none is named: in the user's data folder."""
    base = os.environ.get("LOCALAPPDATA") if os.name == "nt" else os.environ.get("XDG_DATA_HOME")
    return Path(base or Path.home() / ".local" / "share") / "inclinometry" / "ledger.sqlite"


def shown(where: str | Path) -> str:
    """An address without its password.

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
    """The database engine of a path or an address; `read_only` opens a ledger in a folder that cannot be written."""
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
        reason = system_reason(error)
        raise no_path(text, reason) from None
    if there and not plain:
        raise no_path(text, "this is a folder" if path.is_dir() else "no such device")
    if not there and not create:
        raise LedgerError(Finding("ledger-absent", {"ledger": text}))
    address = URL.create("sqlite", database=text)
    if read_only and _sealed(path):
        address = URL.create("sqlite", database=path.resolve().as_uri(), query={"immutable": "1", "uri": "true"})
    made = create_engine(address, poolclass=NullPool if create else None)
    event.listen(made, "connect", _prepare_sqlite)
    event.listen(made, "begin", _begin_sqlite)
    return made


def no_path(text: str, reason: object) -> LedgerError:
    """The error of a path that no ledger can have; the reason as the system gives it."""
    return LedgerError(Finding("ledger-access", {"ledger": f"{text!r:.200}", "cause": f"{reason}"}))


def _sealed(path: Path) -> bool:
    """Whether SQLite could not make the files it needs beside the ledger, and no one else works on it."""
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
        raise LedgerError(Finding("ledger-postgresql", {"name": str(error.name)})) from None
    except (ArgumentError, NoSuchModuleError, ValueError):
        raise LedgerError(Finding("ledger-address", {"ledger": shown(text)})) from None
    if backend not in ("postgresql", "postgres") or not url.database:
        raise LedgerError(Finding("ledger-address", {"ledger": shown(text)}))
    event.listen(made, "begin", _begin_postgresql)
    return made


def _prepare_sqlite(connection: Any, _: object) -> None:
    cache_kib = 65_536  # indexes of a million records in memory; the usual 2 MiB makes appending crawl
    connection.isolation_level = None  # SQLAlchemy's BEGIN below, not the driver's late one
    cursor = connection.cursor()
    for pragma in (
        f"busy_timeout = {PATIENCE * 1000}",
        "foreign_keys = ON",
        "synchronous = FULL",
        "trusted_schema = OFF",
        f"cache_size = -{cache_kib}",
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
    """Errors of the database as findings."""
    try:
        yield
    except IntegrityError as error:
        if getattr(error.orig, "sqlite_errorname", "") == "SQLITE_CONSTRAINT_TRIGGER":
            raise LedgerError(refusal(where, error.orig)) from None
        raise ConflictError(Finding("ledger-conflict", {"ledger": where})) from None
    except DBAPIError as error:
        raise LedgerError(refusal(where, error.orig, lost=error.connection_invalidated)) from None
    except UnicodeDecodeError:
        raise LedgerError(chain.changed("document", where)) from None
    except SQLAlchemyError as error:
        raise LedgerError(refusal(where, error)) from None


def refusal(where: str, error: object, *, lost: bool = False) -> Finding:
    """What a database refused; the cause in its own words. `lost`: the connection was."""
    cause = " ".join(str(error).split())[:200].replace('"', "'")
    code = next((code for mark, code in _SAID.items() if mark in cause), "ledger-refused")
    return Finding("ledger-server" if lost else code, {"ledger": where, "cause": cause})


# The kinds of record a ledger holds: what they are found by, and what their body must contain.

MOST_KEY: Final = 2**31 - 1
"""Largest whole number a key may be: what both engines can keep."""


@dataclass(frozen=True)
class Kind:
    """One kind of record.

    name : of the kind and of its table.
    keys : columns it is found by, name -> type; they are not repeated in the body.
    unique : the keys that no two records may share; empty when a later record with the same keys is a new version.
    version : of the records written; records of older versions stay readable for ever.
    """

    name: str
    keys: Mapping[str, type]
    unique: tuple[str, ...] = ()
    version: int = 1


KINDS: Final[Mapping[str, Kind]] = {
    kind.name: kind
    for kind in (
        Kind("tool", {"serial": str}),
        Kind("rig", {"name": str}),
        Kind("site", {"name": str}),
        Kind("session", {"serial": str, "purpose": str}, version=2),
        Kind("reading", {"session": str, "position": int, "attempt": int}, ("session", "position", "attempt")),
        Kind("calibration", {"serial": str, "session": str}, version=2),
        Kind("verification", {"serial": str, "calibration": str}, version=3),
        Kind("certificate", {"number": str, "serial": str}, ("number",)),
        Kind("user", {"name": str}, version=2),
        Kind("event", {"subject_kind": str, "subject": str, "action": str}),
    )
}
"""A tool, rig, site or user is changed by a newer record of the same key; the others are never changed."""


def _items(validator: Any, items: Any, instance: Any, schema: Any) -> Iterator[Any]:
    """The keyword "items", without a validator for each number of a list of numbers: half the time of a reading."""
    from jsonschema import Draft202012Validator

    if items == {"type": "number"} and type(instance) is list and {*map(type, instance)} <= {float, int}:
        return
    yield from Draft202012Validator.VALIDATORS["items"](validator, items, instance, schema) or ()


@cache
def _validator(kind: str, version: int) -> Draft202012Validator:
    from jsonschema import Draft202012Validator
    from jsonschema.validators import extend

    name = f"{kind}-{version}.json"
    try:
        text = files("inclinometry.laboratory.ledger").joinpath("schemas", name).read_text("utf-8")
    except FileNotFoundError:
        about: dict[str, Value] = {"format": kind, "version": str(version), "known": (str(KINDS[kind].version),)}
        raise refused("file-version", about) from None
    made: Draft202012Validator = extend(Draft202012Validator, {"items": _items})(json.loads(text))  # type: ignore[no-untyped-call]
    return made


def check(kind: str, keys: Mapping[str, Any], body: Mapping[str, Any], version: int | None = None) -> Kind:
    """The kind, when keys and body fit it and its schema; else an InputError with the path of the value."""
    if kind not in KINDS:
        raise not_among("kind", f"{kind!r:.60}", KINDS)
    known = KINDS[kind]
    if lacking := tuple(set(known.keys) - set(keys)):
        raise refused("input-missing", {"names": lacking})
    if unknown := tuple(set(keys) - set(known.keys)):
        raise refused("input-unknown", {"names": unknown, "known": tuple(known.keys)})
    for name, wanted in known.keys.items():
        value = keys[name]
        if not fits(wanted, value):
            if wanted is str:
                raise no_text(f"{kind}.{name}", value)
            huge = isinstance(value, int) and value >> 64
            raise out_of_range(f"{kind}.{name}", "> 1e19" if huge else f"{value!r:.60}", f"0 .. {MOST_KEY}")
    version = known.version if version is None else version
    if type(version) is not int:
        raise wrong_kind("version", f"{version!r:.60}", "whole number")
    error = next(iter(_validator(kind, version).iter_errors(body)), None)
    if error is not None:
        where = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in error.absolute_path)
        about = {"name": f"{kind}{where}", "value": f"{error.instance!r:.60}", "reason": error.message[:200]}
        raise refused("input-field", about)
    return known


def plain(text: object) -> bool:
    """Whether this is a text that both engines keep as it is: 1 to 200 printable characters, no blanks at its ends."""
    return isinstance(text, str) and 1 <= len(text) <= 200 and text.isprintable() and text == text.strip()


def no_text(name: str, value: object, most: int = 200) -> InputError:
    """The error of what is not `plain`."""
    return refused("ledger-text", {"name": name, "value": f"{value!r:.60}", "most": most})


def fits(wanted: type, value: object) -> bool:
    """Whether this is what a key of that type may be."""
    return plain(value) if wanted is str else type(value) is int and 0 <= value <= MOST_KEY


# SQLite gives a rowid alias, which a range scan needs, to INTEGER only
_SEQ: Final = BigInteger().with_variant(Integer(), "sqlite")
METADATA: Final = MetaData()

MEDIA: Final = {"pdf": "application/pdf", "dcc": "application/xml", "json": "application/json"}
"""Media types of the documents of a certificate."""


def _texts(*names: str, **how: Any) -> list[Column[Any]]:
    return [Column(name, Text, nullable=False, **how) for name in names]


CHAIN: Final = Table(
    "chain",
    METADATA,
    Column("seq", _SEQ, primary_key=True, autoincrement=False),
    *_texts("kind"),
    *_texts("record", unique=True),
    *_texts("created", "digest", "link"),
)

DOCUMENT: Final = Table(
    "document",
    METADATA,
    Column("digest", Text, primary_key=True),
    Column("media_type", Text, nullable=False),
    Column("data", LargeBinary, nullable=False),
)
"""Files that records refer to by their SHA-256: certificates, uploaded logs."""
STORED: Final = select(DOCUMENT.c.digest, DOCUMENT.c.media_type, type_coerce(DOCUMENT.c.data, NullType()).label("data"))
"""The documents as they stand: SQLite keeps a text or a number in the place of bytes, which would be converted."""


def as_stored(data: object, digest: object) -> bool:
    """Whether a document is bytes, and those of its digest."""
    return isinstance(data, bytes) and digest_bytes(data) == digest


HEAD: Final = Table(
    "head",
    METADATA,
    Column("place", _SEQ, primary_key=True, autoincrement=False),
    Column("seq", _SEQ, nullable=False, index=True),
    *_texts("ledger", "root", "link", "created", "key", "signature"),
    Column("frontier", Text, nullable=True),
)
"""The signed heads, one for each step that recorded something; `frontier` are the peaks of the tree, now and then."""


def _table(kind: Kind) -> Table:
    types = {str: Text, int: Integer}
    columns: list[Column[Any]] = [Column(name, types[wanted], nullable=False) for name, wanted in kind.keys.items()]
    extra = [UniqueConstraint(*kind.unique, name=f"uq_{kind.name}")] if kind.unique else []
    return Table(
        kind.name,
        METADATA,
        Column("seq", _SEQ, ForeignKey("chain.seq"), primary_key=True, autoincrement=False),
        *_texts("id", unique=True),
        *_texts("created", "author"),
        Column("version", Integer, nullable=False),
        *columns,
        *_texts("body"),
        *extra,
    )


TABLES: Final = {name: _table(kind) for name, kind in KINDS.items()}
"""Table of each kind of record."""


@dataclass(frozen=True)
class Record:
    """One record, as stored.

    seq : place in the chain, from 1. created : UTC, ISO 8601 with microseconds.
    version : of its schema. keys, body : what it is found by, and the rest. digest : SHA-256 of all of this.
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


def row_digest(kind: str, row: Any) -> str:
    """Digest of a row as it stands; "" when it holds what no record can (bytes in a text's place, broken UTF-8)."""
    keys = {name: getattr(row, name) for name in KINDS[kind].keys}
    try:
        return chain.record_digest(kind, row.id, row.created, row.author, row.version, keys, row.body)
    except InputError:
        return ""


def record_of(kind: str, row: Any) -> Record:
    """The record of a row that was read together with its digest in the chain.

    Raises LedgerError: the row was changed after it was recorded: what is computed from records is computed from sound
    ones.
    """
    if row_digest(kind, row) != row.digest:
        raise LedgerError(chain.changed(kind, f"{row.seq} ({row.id})"))
    keys = {name: getattr(row, name) for name in KINDS[kind].keys}
    return Record(kind, row.id, row.seq, row.created, row.author, row.version, keys, json.loads(row.body), row.digest)


REVISIONS: Final = ("0001", "0002", "0003")
"""Revisions of the tables this program reads and writes; the last one is what it makes, with signed heads."""
_NAMES: Final = ("chain", "document", *TABLES, "head")
_FUNCTION: Final = " BEGIN RAISE EXCEPTION 'the ledger is append-only: %', TG_TABLE_NAME; END "


def newer(revision: object) -> Finding:
    """That a newer program made a ledger."""
    return Finding("file-version", {"format": "ledger", "version": f"{revision!r:.40}", "known": REVISIONS})


def readable(connection: Connection, where: str) -> None:
    """Refuse what is not a ledger, and a ledger of a newer program (LedgerError)."""
    tables = set(inspect(connection).get_table_names())
    if "chain" not in tables or "alembic_version" not in tables:
        raise LedgerError(Finding("ledger-absent", {"ledger": where}))
    version = select(column("version_num", Text())).select_from(table("alembic_version"))
    found: list[str] = list(connection.execute(version).scalars())
    unknown = [revision for revision in found if revision not in REVISIONS]
    if unknown:
        raise LedgerError(newer(unknown[0]))
    lost = [name for name in _NAMES if name not in tables and (name != "head" or not {*found} & {*REVISIONS[:2]})]
    if lost:
        raise LedgerError(refusal(where, f"no such table: {', '.join(lost)}"))


def protect(connection: Connection) -> None:
    """(Re-)create the triggers that refuse UPDATE, DELETE and TRUNCATE on every table.

    A migration that rebuilds a SQLite table drops its triggers silently: every migration ends with this.
    """
    names = _present(connection)
    if connection.dialect.name == "sqlite":
        for name, text in _sqlite_triggers(names).items():
            connection.exec_driver_sql(f'DROP TRIGGER IF EXISTS "{name}"')
            connection.exec_driver_sql(text)
        return
    escaped = _FUNCTION.replace("%", "%%")
    connection.exec_driver_sql(
        f"CREATE OR REPLACE FUNCTION ledger_append_only() RETURNS trigger LANGUAGE plpgsql AS $${escaped}$$"
    )
    for name in names:
        connection.exec_driver_sql(f'DROP TRIGGER IF EXISTS append_only ON "{name}"')
        connection.exec_driver_sql(
            f'CREATE TRIGGER append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON "{name}" '
            "FOR EACH STATEMENT EXECUTE FUNCTION ledger_append_only()"
        )


def _present(connection: Connection) -> tuple[str, ...]:
    """Tables of the ledger; those of an older program's have no signed heads."""
    signed = inspect(connection).has_table("head")
    return tuple(name for name in _NAMES if signed or name != "head")


def _sqlite_triggers(names: Sequence[str] = _NAMES) -> dict[str, str]:
    return {
        f"{name}_{verb.lower()}": f'CREATE TRIGGER "{name}_{verb.lower()}" BEFORE {verb} ON "{name}" '
        f"BEGIN SELECT RAISE(ABORT, 'the ledger is append-only: {name}'); END"
        for name in names
        for verb in ("UPDATE", "DELETE")
    }


def unprotected(connection: Connection) -> list[str]:
    """Tables whose triggers are missing, switched off or not those of the program."""
    names = _present(connection)
    if connection.dialect.name == "sqlite":
        rows = connection.exec_driver_sql("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'")
        found = {row.name: row.sql for row in rows}
        wrong = {name for name, text in _sqlite_triggers(names).items() if found.get(name) != text}
        return [n for n in names if wrong & {f"{n}_update", f"{n}_delete"}]
    before_any_statement = 2 + 8 + 16 + 32  # pg_trigger.tgtype: before, delete, update, truncate; for statements
    right = connection.exec_driver_sql(
        "SELECT c.relname, p.prosrc FROM pg_trigger t JOIN pg_class c ON c.oid = t.tgrelid "
        "JOIN pg_proc p ON p.oid = t.tgfoid WHERE t.tgname = 'append_only' AND t.tgenabled IN ('O', 'A') "
        f"AND t.tgtype = {before_any_statement} AND t.tgqual IS NULL "
        "AND c.relnamespace = current_schema()::regnamespace"
    )
    sound = {name for name, source in right if source == _FUNCTION}
    return [name for name in names if name not in sound]


def foreign_triggers(connection: Connection) -> list[str]:
    """Triggers of a SQLite ledger that the program did not make: they could change what is recorded."""
    if connection.dialect.name != "sqlite":
        return []
    names = connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type = 'trigger'").scalars().all()
    return sorted(set(names) - set(_sqlite_triggers()))

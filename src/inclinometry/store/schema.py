"""The tables of a ledger and the triggers that make them append-only."""

from __future__ import annotations

from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    Column,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
)
from sqlalchemy.engine import Connection

from inclinometry.store.kinds import KINDS, Kind

# SQLite gives a rowid alias, which a range scan needs, to INTEGER only
_SEQ: Final = BigInteger().with_variant(Integer(), "sqlite")
METADATA: Final = MetaData()

CHAIN: Final = Table(
    "chain",
    METADATA,
    Column("seq", _SEQ, primary_key=True, autoincrement=False),
    Column("kind", Text, nullable=False),
    Column("record", Text, nullable=False, unique=True),
    Column("created", Text, nullable=False),
    Column("digest", Text, nullable=False),
    Column("link", Text, nullable=False),
)

DOCUMENT: Final = Table(
    "document",
    METADATA,
    Column("digest", Text, primary_key=True),
    Column("media_type", Text, nullable=False),
    Column("data", LargeBinary, nullable=False),
)
"""Files that records refer to by their SHA-256: certificates, uploaded logs."""


def _table(kind: Kind) -> Table:
    types = {str: Text, int: Integer}
    columns: list[Column[Any]] = [Column(name, types[wanted], nullable=False) for name, wanted in kind.keys.items()]
    extra = [UniqueConstraint(*kind.unique, name=f"uq_{kind.name}")] if kind.unique else []
    return Table(
        kind.name,
        METADATA,
        Column("seq", _SEQ, ForeignKey("chain.seq"), primary_key=True, autoincrement=False),
        Column("id", Text, nullable=False, unique=True),
        Column("created", Text, nullable=False),
        Column("author", Text, nullable=False),
        Column("version", Integer, nullable=False),
        *columns,
        Column("body", Text, nullable=False),
        *extra,
        *(Index(f"ix_{kind.name}_{name}", name, "seq") for name in kind.keys),
    )


TABLES: Final = {name: _table(kind) for name, kind in KINDS.items()}
"""Table of each kind of record."""


def protect(connection: Connection) -> None:
    """(Re-)create the triggers that refuse UPDATE, DELETE and TRUNCATE on every table.

    A migration that rebuilds a SQLite table drops its triggers silently: every migration ends with this.
    """
    names = ["chain", "document", *TABLES]
    if connection.dialect.name == "sqlite":
        for name in names:
            for verb in ("UPDATE", "DELETE"):
                connection.exec_driver_sql(f'DROP TRIGGER IF EXISTS "{name}_{verb.lower()}"')
                connection.exec_driver_sql(
                    f'CREATE TRIGGER "{name}_{verb.lower()}" BEFORE {verb} ON "{name}" '
                    f"BEGIN SELECT RAISE(ABORT, 'the ledger is append-only: {name}'); END"
                )
        return
    connection.exec_driver_sql(
        "CREATE OR REPLACE FUNCTION ledger_append_only() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN RAISE EXCEPTION 'the ledger is append-only: %%', TG_TABLE_NAME; END $$"
    )
    for name in names:
        connection.exec_driver_sql(f'DROP TRIGGER IF EXISTS append_only ON "{name}"')
        connection.exec_driver_sql(
            f'CREATE TRIGGER append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON "{name}" '
            "FOR EACH STATEMENT EXECUTE FUNCTION ledger_append_only()"
        )


def unprotected(connection: Connection) -> list[str]:
    """Tables whose triggers are missing."""
    names = ["chain", "document", *TABLES]
    if connection.dialect.name == "sqlite":
        found = connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type = 'trigger'").scalars().all()
        return [n for n in names if not {f"{n}_update", f"{n}_delete"} <= set(found)]
    rows = connection.exec_driver_sql(
        "SELECT c.relname FROM pg_trigger t JOIN pg_class c ON c.oid = t.tgrelid "
        "WHERE t.tgname = 'append_only' AND t.tgenabled <> 'D'"
    )
    return sorted(set(names) - set(rows.scalars().all()))

"""The tables of a ledger, as this program uses them; the migrations make them, and their indexes."""

from __future__ import annotations

from typing import Any, Final

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
)

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
    )


TABLES: Final = {name: _table(kind) for name, kind in KINDS.items()}
"""Table of each kind of record."""

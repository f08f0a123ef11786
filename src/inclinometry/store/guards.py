"""The triggers that make a ledger append-only, and which ledgers this program can work with."""

from __future__ import annotations

from typing import Final

from sqlalchemy import Text, column, inspect, select, table
from sqlalchemy.engine import Connection

from inclinometry.store.engine import LedgerError
from inclinometry.store.records import TABLES

REVISIONS: Final = ("0001", "0002")
"""Revisions of the tables this program reads and writes; the last one is what it makes."""
_NAMES: Final = ("chain", "document", *TABLES)
_FUNCTION: Final = " BEGIN RAISE EXCEPTION 'the ledger is append-only: %', TG_TABLE_NAME; END "
_BEFORE_ANY_STATEMENT: Final = 2 + 8 + 16 + 32  # pg_trigger.tgtype: before, delete, update, truncate; for statements


def readable(connection: Connection, where: str) -> None:
    """Refuse what is not a ledger, and a ledger of a newer program.

    Raises
    ------
    LedgerError
    """
    tables = set(inspect(connection).get_table_names())
    if "chain" not in tables or "alembic_version" not in tables:
        raise LedgerError(f"{where}: this is not a ledger; make one with `inclinometry ledger init`")
    version = select(column("version_num", Text())).select_from(table("alembic_version"))
    found: list[str] = list(connection.execute(version).scalars())
    unknown = [revision for revision in found if revision not in REVISIONS]
    if unknown:
        raise LedgerError(f"{where}: the ledger was made by a newer program ({unknown[0]!r:.40}); update inclinometry")
    lost = [name for name in _NAMES if name not in tables]
    if lost:
        raise LedgerError(f"{where}: the tables {', '.join(lost)} are missing; restore a backup")


def protect(connection: Connection) -> None:
    """(Re-)create the triggers that refuse UPDATE, DELETE and TRUNCATE on every table.

    A migration that rebuilds a SQLite table drops its triggers silently: every migration ends with this.
    """
    if connection.dialect.name == "sqlite":
        for name, text in _sqlite_triggers().items():
            connection.exec_driver_sql(f'DROP TRIGGER IF EXISTS "{name}"')
            connection.exec_driver_sql(text)
        return
    escaped = _FUNCTION.replace("%", "%%")
    connection.exec_driver_sql(
        f"CREATE OR REPLACE FUNCTION ledger_append_only() RETURNS trigger LANGUAGE plpgsql AS $${escaped}$$"
    )
    for name in _NAMES:
        connection.exec_driver_sql(f'DROP TRIGGER IF EXISTS append_only ON "{name}"')
        connection.exec_driver_sql(
            f'CREATE TRIGGER append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON "{name}" '
            "FOR EACH STATEMENT EXECUTE FUNCTION ledger_append_only()"
        )


def _sqlite_triggers() -> dict[str, str]:
    return {
        f"{name}_{verb.lower()}": f'CREATE TRIGGER "{name}_{verb.lower()}" BEFORE {verb} ON "{name}" '
        f"BEGIN SELECT RAISE(ABORT, 'the ledger is append-only: {name}'); END"
        for name in _NAMES
        for verb in ("UPDATE", "DELETE")
    }


def unprotected(connection: Connection) -> list[str]:
    """Tables whose triggers are missing, switched off or not those of the program."""
    if connection.dialect.name == "sqlite":
        rows = connection.exec_driver_sql("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'")
        found = {row.name: row.sql for row in rows}
        wrong = {name for name, text in _sqlite_triggers().items() if found.get(name) != text}
        return [n for n in _NAMES if wrong & {f"{n}_update", f"{n}_delete"}]
    right = connection.exec_driver_sql(
        "SELECT c.relname, p.prosrc FROM pg_trigger t JOIN pg_class c ON c.oid = t.tgrelid "
        "JOIN pg_proc p ON p.oid = t.tgfoid WHERE t.tgname = 'append_only' AND t.tgenabled IN ('O', 'A') "
        f"AND t.tgtype = {_BEFORE_ANY_STATEMENT} AND t.tgqual IS NULL "
        "AND c.relnamespace = current_schema()::regnamespace"
    )
    sound = {name for name, source in right if source == _FUNCTION}
    return [name for name in _NAMES if name not in sound]


def strange(connection: Connection) -> list[str]:
    """Triggers of a SQLite ledger that the program did not make: they could change what is recorded."""
    if connection.dialect.name != "sqlite":
        return []
    names = connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type = 'trigger'").scalars().all()
    return sorted(set(names) - set(_sqlite_triggers()))

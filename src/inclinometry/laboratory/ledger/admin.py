"""Making a ledger and bringing an old one up to date."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from sqlalchemy import inspect
from sqlalchemy.engine import Engine
from sqlalchemy.exc import DBAPIError

from inclinometry.errors import system_reason
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.engine import (
    default_path,
    engine,
    newer,
    no_path,
    refusal,
    shown,
    translated,
    unprotected,
)
from inclinometry.laboratory.ledger.keys import Keys
from inclinometry.laboratory.ledger.ledger import Ledger


def create(where: str | Path, *, keys: Keys | None = None, sign: bool | None = None, accepted: bool = False) -> Ledger:
    """Make an empty ledger, or bring an existing one up to date, and open it.

    With `sign` None a new ledger is signed, an old one as it was. `accepted`: a user will answer, by `Ledger.accept`,
    for signatures that were removed; without it such a ledger is refused.
    """
    if "://" not in str(where):
        path = Path(where)
        try:
            if path.is_dir():
                raise no_path(str(where), "this is a folder")
            if not path.parent.is_dir() and path != default_path():
                raise no_path(str(where), "no such file or folder")
            path.parent.mkdir(parents=True, exist_ok=True)
        except (OSError, UnicodeEncodeError) as error:
            reason = system_reason(error)
            raise no_path(str(where), reason) from None
    made = engine(where, create=True)
    try:
        with translated(shown(where)):
            if made.dialect.name == "sqlite":
                _write_ahead(made, where)
            fresh = not inspect(made).has_table("chain")
            _migrate(made)
            with made.connect() as connection:
                bare = unprotected(connection)
    finally:
        made.dispose()
    if bare:
        raise LedgerError(Finding("ledger-unprotected", {"names": tuple(bare)}))
    ledger = Ledger(where, keys=keys)
    try:
        if sign or (sign is None and fresh):
            ledger.begin_signing(accepted=accepted)
    except BaseException:
        ledger.close()
        raise
    return ledger


def _write_ahead(made: Engine, where: str | Path) -> None:
    """Readers do not wait for a writer; the mode cannot be set inside a transaction."""
    try:
        raw = made.raw_connection()
        try:
            raw.cursor().execute("PRAGMA journal_mode = WAL")
        finally:
            raw.close()
    except (sqlite3.Error, DBAPIError) as error:
        raise LedgerError(refusal(shown(where), getattr(error, "orig", None) or error)) from None


def _migrate(made: Engine, revision: str = "head") -> None:
    from alembic import command
    from alembic.config import Config
    from alembic.util import CommandError

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    config.attributes["engine"] = made
    try:
        command.upgrade(config, revision)
    except CommandError as error:
        raise LedgerError(newer(getattr(error.__cause__, "argument", ""))) from None

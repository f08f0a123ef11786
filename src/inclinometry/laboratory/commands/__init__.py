"""Commands of the laboratory; the options that several of them share."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from cyclopts import Parameter

from inclinometry.cli.options import shipped

LedgerAddress: TypeAlias = Annotated[
    str | None,
    Parameter(
        name="--ledger",
        help="SQLite file, or postgresql://user:password@host/database. Default: the one in the user's data folder.",
    ),
]
ProtocolName: TypeAlias = Annotated[
    str,
    Parameter(help=f"Protocol of the instrument: a TOML file, or {shipped('laboratory/instruments/protocols')}."),
]

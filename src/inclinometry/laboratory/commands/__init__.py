"""Commands of the laboratory; the options that several of them share."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from cyclopts import Parameter

from inclinometry.cli.options import shipped

LedgerAddress: TypeAlias = Annotated[
    str | None,
    Parameter(
        name="--ledger",
        help="Path of a SQLite file, or postgresql://user:password@host/database. Default: the one in the user's "
        "data folder.",
    ),
]
ProtocolName: TypeAlias = Annotated[
    str,
    Parameter(
        help=f"How the instrument talks: a TOML file, or a shipped protocol: "
        f"{shipped('laboratory/instruments/protocols')}."
    ),
]

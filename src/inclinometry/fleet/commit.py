"""What is current: a Delta table beside the files, written by the driver alone."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeAlias

from inclinometry.errors import InputError
from inclinometry.fleet.store import Store

BY: Final = ("tool", "run", "date")
"""Partitions of every table."""
Added: TypeAlias = tuple[int, int, tuple[str, str, str]]
"""Of a file that becomes current: bytes, rows, (tool, run, date)."""
_ATTEMPTS: Final = 50  # of a commit when another driver commits at the same moment


class Table:
    """A table of files that are made elsewhere; a transaction adds and removes names.

    Parameters
    ----------
    store : Store
    name : str
        Folder of the table in the store.
    schema : pyarrow.Schema
        Of the files, without the partitions.

    Notes
    -----
    Delta Lake's protocol, by its reference implementation in Rust; any engine that knows it can read the table.
    """

    def __init__(self, store: Store, name: str, schema: Any) -> None:
        import pyarrow as pa

        self._store, self.name = store, name
        self._schema = pa.schema([*schema, *(pa.field(by, pa.string()) for by in BY)])
        self._opened: Any = None

    def paths(self) -> dict[str, int]:
        """Name in the store -> bytes of each file that is current; nothing where the table is not there yet."""
        table = self._table()
        if table is None:
            return {}
        import pyarrow as pa

        found = pa.table(table.get_add_actions(flatten=True))
        sizes = found.column("size_bytes").to_pylist()
        return {f"{self.name}/{path}": size for path, size in zip(found.column("path").to_pylist(), sizes, strict=True)}

    @property
    def version(self) -> int | None:
        """Number of the last transaction; None where the table is not there yet."""
        table = self._table()
        return None if table is None else int(table.version())

    def commit(self, added: Mapping[str, Added], removed: Iterable[str], facts: Mapping[str, str]) -> int:
        """Add and remove files in one transaction; how many names it changed.

        Parameters
        ----------
        added : name in the store -> Added
            A name that is current already is left as it is: two drivers that do the same work agree.
        removed : names in the store
            Names that are not current are passed over.
        facts : mapping
            Of the transaction, kept in the log.
        """
        from deltalake import DeltaTable, Schema
        from deltalake.exceptions import CommitFailedError, DeltaError
        from deltalake.transaction import AddAction, CommitProperties, RemoveAction

        schema = Schema.from_arrow(self._schema)
        gone, start = list(removed), len(self.name) + 1
        for attempt in range(_ATTEMPTS):
            table = self._table()
            try:
                if table is None:
                    table = DeltaTable.create(
                        self._uri, schema=schema, mode="ignore", partition_by=list(BY), name=self.name
                    )
                    table = DeltaTable(self._uri)
                current = self.paths()
                now = int(time.time() * 1000)
                actions: list[Any] = [
                    AddAction(
                        path=name[start:],
                        size=size,
                        partition_values=dict(zip(BY, partition, strict=True)),
                        modification_time=now,
                        data_change=True,
                        stats=json.dumps({"numRecords": rows}),
                    )
                    for name, (size, rows, partition) in added.items()
                    if name not in current
                ]
                actions += [RemoveAction(name[start:], True, now) for name in gone if name in current]
                if actions:
                    table.create_write_transaction(
                        actions,
                        mode="append",
                        schema=schema,
                        partition_by=list(BY),
                        commit_properties=CommitProperties(custom_metadata=dict(facts)),
                    )
                    self._opened = None
                return len(actions)
            except (CommitFailedError, DeltaError) as error:
                # another driver was quicker: look again at what is current
                self._opened = None
                if attempt == _ATTEMPTS - 1:
                    raise InputError(f"{self._uri}: the table cannot be committed to ({str(error)[:200]})") from None
                time.sleep(min(0.05 * 2**attempt, 2.0))
        raise AssertionError

    def said(self) -> Mapping[str, Any]:
        """What was said of the last transaction; nothing where the table is not there yet."""
        table = self._table()
        return {} if table is None else table.history(1)[0]

    @property
    def _uri(self) -> str:
        return self._store.uri(self.name)

    def _table(self) -> Any:
        from deltalake import DeltaTable
        from deltalake.exceptions import TableNotFoundError

        if self._opened is None:
            try:
                self._opened = DeltaTable(self._uri)
            except TableNotFoundError:
                return None
            except OSError as error:
                raise InputError(f"{self._uri}: the table cannot be read ({str(error)[:300]})") from None
        return self._opened

"""What is current: a Delta table beside the files, written by the driver alone."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeAlias

from inclinometry.errors import FileError
from inclinometry.findings import Finding
from inclinometry.fleet import checksums
from inclinometry.fleet.store import Store

BY: Final = ("tool", "run", "date")
"""Partitions of every table."""
Added: TypeAlias = tuple[int, int, tuple[str, str, str], str]
"""Of a file that becomes current: bytes, rows, (tool, run, date), digest."""
_ATTEMPTS: Final = 50  # of a commit when another driver commits at the same moment


class Table:
    """A table of files made elsewhere (Delta Lake, by its Rust library); a transaction adds and removes names.

    `schema` is that of the files, without the partitions.
    """

    def __init__(self, store: Store, name: str, schema: Any) -> None:
        import pyarrow as pa

        self._store, self.name = store, name
        self._schema = pa.schema([*schema, *(pa.field(by, pa.string()) for by in BY)])
        self._opened: Any = None
        self._recorded: dict[str, set[str]] = {}

    def paths(self) -> dict[str, int]:
        """Name in the store -> bytes of each file that is current; nothing where the table is not there yet."""
        table = self._table()
        if table is None:
            return {}
        import pyarrow as pa

        found = checksums.guarded(lambda: pa.table(table.get_add_actions(flatten=True)), self._uri, self._broken)
        sizes = found.column("size_bytes").to_pylist()
        return {f"{self.name}/{path}": size for path, size in zip(found.column("path").to_pylist(), sizes, strict=True)}

    @property
    def recorded(self) -> dict[str, set[str]]:
        """Name in the store -> digests with which the file was committed, where they were recorded."""
        self._table()
        return self._recorded

    @property
    def version(self) -> int | None:
        """Number of the last transaction; None where the table is not there yet."""
        table = self._table()
        return None if table is None else int(table.version())

    def commit(self, added: Mapping[str, Added], removed: Iterable[str], facts: Mapping[str, str]) -> int:
        """Add and remove files in one transaction; the number of names changed.

        An added name that is current with as many bytes is left: two drivers that do the same work agree. Removed names
        that are not current are passed over. `facts` are kept in the log.
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
                    for name, (size, rows, partition, _) in added.items()
                    if current.get(name) != size
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
                if actions or added:
                    checksums.record(self._store, self.name, {name: one[3] for name, one in added.items()})
                return len(actions)
            except (CommitFailedError, DeltaError) as error:
                # another driver was quicker: look again at what is current
                self._opened = None
                if attempt == _ATTEMPTS - 1:
                    raise FileError(Finding("fleet-commit", {"reason": str(error)[:200]}), path=self._uri) from None
                time.sleep(min(0.05 * 2**attempt, 2.0))
        raise AssertionError

    def said(self) -> Mapping[str, Any]:
        """What was said of the last transaction; nothing where the table is not there yet."""
        table = self._table()
        if table is None:
            return {}
        found: Mapping[str, Any] = checksums.guarded(lambda: table.history(1)[0], self._uri, self._broken)
        return found

    @property
    def _uri(self) -> str:
        return self._store.uri(self.name)

    def _broken(self, reason: str) -> Finding:
        # without its checksums nothing says that a result is what was made
        return Finding("fleet-table", {"reason": reason, "folder": self.name, "again": "run --window-s"})

    def _table(self) -> Any:
        if self._opened is None:
            self._opened, self._recorded = checksums.opened_table(self._store, self.name, self._broken)
        return self._opened

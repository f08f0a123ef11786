"""The ledger: append records, read them back; nothing is ever changed."""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

from sqlalchemy import ColumnElement, Select, Table, and_, false, func, select
from sqlalchemy.engine import Connection

from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError, not_among, out_of_range, refused
from inclinometry.findings import Finding, Value
from inclinometry.laboratory.ledger import chain, heads
from inclinometry.laboratory.ledger.chain import LedgerError, missing
from inclinometry.laboratory.ledger.engine import (
    CHAIN,
    DOCUMENT,
    KINDS,
    STORED,
    TABLES,
    ConflictError,
    Draft,
    Record,
    as_stored,
    check,
    default_path,
    engine,
    fits,
    no_text,
    plain,
    readable,
    record_of,
    shown,
    translated,
)
from inclinometry.laboratory.ledger.keys import Keys, explained
from inclinometry.laboratory.ledger.merkle import leaf_hash
from inclinometry.laboratory.ledger.witness import (
    PRINT,
    Witnessed,
    Witnesses,
    ahead,
    ahead_elsewhere,
    begun_at,
    farthest,
    folders_of,
    is_ledger,
    itself,
    keep,
    place_of,
    remembered,
    witnessed,
)
from inclinometry.laboratory.placeholders import stated

LARGEST_DOCUMENT: Final = 100_000_000


class Batch:
    """Records on their way into the tables, linked to what is there; written many at a time."""

    def __init__(self, connection: Connection, head: chain.Head) -> None:
        self.head = head
        self.leaves: list[bytes] = []
        """Hashes in the tree of RFC 6962 of what was added."""
        self._connection = connection
        self._links: list[dict[str, Any]] = []
        self._rows: dict[str, list[dict[str, Any]]] = {}

    def add(
        self, kind: str, name: str, created: str, author: str, version: int, keys: Mapping[str, Any], body: str
    ) -> Record:
        """The record that comes next."""
        seq = self.head.seq + 1
        digest = chain.record_digest(kind, name, created, author, version, keys, body)
        link = chain.next_link(self.head.link, seq, kind, name, created, digest)
        entry = {"seq": seq, "kind": kind, "record": name, "created": created, "digest": digest}
        self._links.append({**entry, "link": link})
        self.leaves.append(leaf_hash(chain.leaf(seq, kind, name, created, digest)))
        row = {"seq": seq, "id": name, "created": created, "author": author, "version": version, **keys, "body": body}
        self._rows.setdefault(kind, []).append(row)
        self.head = chain.Head(seq, link)
        return Record(kind, name, seq, created, author, version, dict(keys), json.loads(body), digest)

    def write(self) -> None:
        """Write what was added: links first, the other tables refer to them."""
        if self._links:
            self._connection.execute(CHAIN.insert(), self._links)
        for kind, rows in self._rows.items():
            self._connection.execute(TABLES[kind].insert(), rows)
        self._links, self._rows = [], {}


def add_document(connection: Connection, media_type: str, data: bytes) -> str:
    """Keep a file, unless it is there already; its digest."""
    key = digest_bytes(data)
    if connection.execute(select(DOCUMENT.c.digest).where(DOCUMENT.c.digest == key)).first() is None:
        connection.execute(DOCUMENT.insert().values(digest=key, media_type=media_type, data=data))
    return key


def body_text(draft: Draft) -> str:
    """The text to be stored of a draft that fits its kind."""
    longest_body = 20_000_000
    check(draft.kind, draft.keys, draft.body)
    body = chain.compact(dict(draft.body))
    if len(body) > longest_body:
        raise out_of_range(f"{draft.kind}.characters", len(body), f"<= {longest_body}")
    for media_type, data in draft.documents:
        if not plain(media_type):
            raise no_text("media_type", media_type)
        if len(data) > LARGEST_DOCUMENT:
            raise out_of_range("document.bytes", len(data), f"<= {LARGEST_DOCUMENT}")
    return body


__all__ = ["ConflictError", "Draft", "Ledger", "LedgerError", "Record", "default_path"]


def now() -> datetime:
    """The time, UTC."""
    return datetime.now(UTC)


def accepted_breaks(events: Sequence[Record]) -> list[dict[str, Any]]:
    """Who accepted a break, when and why; how many records were signed `before`, None in events of older programs, and
    how many were there `after`. Each after those before it that the ledger had lost.
    """
    found: list[dict[str, Any]] = []
    for one in events:
        details = one.body["details"]
        found += details.get("earlier", [])
        about = {"author": one.author, "created": one.created, "reason": str(one.body.get("reason", ""))}
        found.append({**about, "before": details.get("before"), "after": one.seq - 1})
    return found


class Ledger:
    """A ledger at a path (SQLite) or an address (postgresql+psycopg://user:password@host/database).

    The keys, by default those of this computer, sign the heads of a signed ledger. `alone`: its heads go to the witness
    of this computer only, for a ledger that is a witness itself. `clock` is for tests.
    """

    def __init__(
        self,
        where: str | Path,
        *,
        clock: Callable[[], datetime] = now,
        read_only: bool = False,
        keys: Keys | None = None,
        alone: bool = False,
    ) -> None:
        self.where = str(where)
        self.read_only = read_only
        self._clock = clock
        self.shown: Final = shown(where)
        """Where it is, without a password."""
        self.keys: Final = Keys() if keys is None else keys
        self._sealing = heads.Sealing(self.keys, self.shown)
        self._alone = alone
        self._witnesses = Witnesses(self.keys.folder, self.where, send, alone=alone)
        self._seen = -1
        """Record up to which the ledger was once found not to be behind what this computer saw of it."""
        self._unknown = False
        """Whether it holds no signed head, and nothing beside the keys knows it as a signed ledger."""
        self._engine = engine(where, read_only=read_only)
        try:
            with self._reading() as connection:
                readable(connection, self.shown)
        except LedgerError:
            self.close()
            raise

    def time(self) -> datetime:
        """The time by the ledger's clock."""
        return self._clock()

    def close(self) -> None:
        """Release the files and connections; heads on their way to other places are sent."""
        self._witnesses.close()
        self._engine.dispose()

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- writing -------------------------------------------------------------------------------------------------------

    def append(self, kind: str, keys: Mapping[str, Any], body: Mapping[str, Any], *, author: str) -> Record:
        """Record one thing; when this returns it is on the disk. A record with its unique keys raises ConflictError."""
        return self.append_all([Draft(kind, keys, body)], author=author)[0]

    def append_all(
        self,
        drafts: Sequence[Draft],
        *,
        author: str,
        slack: timedelta = timedelta(minutes=2),
        unless: Sequence[tuple[str, Mapping[str, Any], Finding]] = (),
    ) -> list[Record]:
        """Record several things in one step: all of them or none.

        `unless` is what must not be in the ledger yet, looked at in the same step: a kind, keys as for `find`, what to
        say. `slack` is how far the clock may have gone back since the last record; beyond that nothing is recorded.
        """
        self._writable()
        if not plain(author):
            raise no_text("author", author)
        bodies = [body_text(draft) for draft in drafts]
        self._not_behind_others()
        with self._writing() as connection:
            for kind, keys, message in unless:
                if connection.execute(_query(kind).where(_matching(kind, keys)).limit(1)).first():
                    raise ConflictError(message)
            head, last = self._tail(connection)
            created = self._now(last, slack)
            name, first = self._sealing.before(connection, head)
            self._not_behind(connection)
            if not name:
                self._never_signed(connection)
            whole = [*zip(first, map(body_text, first), strict=True), *zip(drafts, bodies, strict=True)]
            records, signed = self._recorded(connection, name, head, created, author, whole)
            for draft in drafts:
                for media_type, data in draft.documents:
                    add_document(connection, media_type, data)
        self._witnesses.publish(signed)
        return records[len(first) :]

    def _writable(self) -> None:
        if self.read_only:
            raise LedgerError(Finding("input-not-with", {"name": "read_only", "other": "append, restore"}))

    def _recorded(
        self, connection: Connection, name: str, head: chain.Head, created: str, author: str,
        drafts: Sequence[tuple[Draft, str]],
    ) -> tuple[list[Record], heads.SignedHead | None]:  # fmt: skip
        """Write drafts with the texts of their bodies behind the last record; sign them in a ledger that has a name."""
        batch = Batch(connection, head)
        records = [
            batch.add(draft.kind, uuid.uuid4().hex, created, author, KINDS[draft.kind].version, draft.keys, body)
            for draft, body in drafts
        ]
        batch.write()
        signed = self._sealing.after(connection, name, batch.leaves, batch.head, created) if name else None
        return records, signed

    def begin_signing(self, *, accepted: bool = False) -> heads.SignedHead | None:
        """Sign the ledger from now on, all that it holds included; None when it is signed already.

        `accepted`: a user answers, by `accept`, for removed signatures; it goes on under its name. Else a ledger
        without a signed head that this computer or a witness knows as signed is refused.
        """
        with self._writing() as connection:
            if heads.newest_head(connection) is not None:
                return None
            head = self._tail(connection)[0]
            name = ""
            if accepted:
                known = remembered(connection, folders_of(self.keys.folder, self.where))
                name = known.head.ledger if known is not None and known.head is not None else ""
            elif head.seq:
                self._never_signed(connection, folders_of(self.keys.folder, self.where))
            signed = self._sealing.begin(connection, head, self._now(None, timedelta.max), name)
        self._witnesses.publish(signed)
        return signed

    def accept(self, reason: str, *, author: str) -> Record:
        """Answer for what a verification found, in words, as an event: the ledger goes on from what it holds now.

        The event keeps the ledger's `head`, how many of its records were signed `before`, as far as this computer and
        its witnesses know, and breaks accepted here that a restored copy does not hold (`earlier`).
        """
        if not stated(reason):
            raise refused("ledger-reason")
        signed_before = self._signed_before()
        kept = self.find("event", limit=1000, subject_kind="ledger", subject="head", action="accepted")
        held = {one["created"] for one in accepted_breaks(kept)}
        with self._writing() as connection:
            head, last = self._tail(connection)
            name = self._sealing.resume(connection, head)
            if not name:
                raise LedgerError(Finding("ledger-unsigned", {"ledger": self.shown}))
            created = self._now(last, timedelta(minutes=2))
            details: dict[str, Any] = {"head": str(head), "before": signed_before}
            if earlier := [one for one in self.keys.breaks(name) if one["created"] not in held]:
                details["earlier"] = earlier
            draft = Draft("event", heads.ACCEPTED, {"reason": reason.strip(), "details": details})
            (record,), signed = self._recorded(connection, name, head, created, author, [(draft, body_text(draft))])
        self.keys.keep_break(name, accepted_breaks([record])[-1])
        self._witnesses.publish(signed)
        return record

    def _signed_before(self) -> int:
        """The last record that was signed, by this ledger's heads and those of its witnesses since the last break."""
        with self._reading() as connection:
            newest = heads.newest_head(connection)
            accepted = self._accepted(connection)
        if newest is None:
            return 0
        kept = witnessed(self.keys.folder, newest.ledger, self.where)[0]
        lost = farthest(kept, newest, accepted)
        return newest.size if lost is None or lost.head is None else lost.head.size

    def record_witness(self, place: str, action: str, *, author: str) -> None:
        """Record that a witness was "named" or "removed", where its list cannot be changed without a trace.

        Nothing is recorded where that is known already, in a ledger that is not signed, or not by the key here.
        """
        newest, public = self.signed_head(), self.keys.public()
        if newest is None or public is None or not self.keys.there:
            return
        if newest.key != public and explained(newest.key, public, self.keys.changes()) is None:
            return
        details = {"place": shown(place), "ledger": newest.ledger}
        known = False
        after = 0
        while rows := self.find("event", after=after, subject_kind="ledger", subject=heads.WITNESS_EVENT["subject"]):
            after = rows[-1].seq
            said = [row.keys["action"] for row in rows if row.body.get("details") == details]
            known = said[-1] == "named" if said else known
        if known != (action == "named"):
            self.append("event", {**heads.WITNESS_EVENT, "action": action}, {"details": details}, author=author)

    def signed_head(self) -> heads.SignedHead | None:
        """The last signed head; None in a ledger that is not signed."""
        with self._reading() as connection:
            return heads.newest_head(connection)

    def own_head(self) -> heads.SignedHead | None:
        """The same, to be handed out: where the laboratory's private key is, its key signed it.

        Raises LedgerError: another key signed it; public.pem holds another key than key.pem.
        """
        newest = self.signed_head()
        public = self.keys.public() if newest is not None and self.keys.there else None
        if newest is not None and public is not None:
            heads.succession(newest, public, self.keys, self.shown)
        return newest

    def not_behind(self) -> None:
        """Refuse to sign upon a ledger that lacks records which this computer saw in it.

        Raises LedgerError: the witness beside the keys has a head of this ledger beyond its end, and no one answered
        for that.
        """
        self._not_behind_others()
        with self._reading() as connection:
            self._not_behind(connection)

    def _not_behind_others(self) -> None:
        """Ask, once while it is open and before anything is locked, those other witnesses that answer at once."""
        if self._alone or self._seen >= 0:
            return
        with self._reading() as connection:
            newest = heads.newest_head(connection)
            accepted = self._accepted(connection)
        lost = None if newest is None else ahead_elsewhere(self.keys.folder, self.where, newest, accepted)
        if newest is not None and lost is not None:
            raise self._explain_rollback(newest, lost)

    def _accepted(self, connection: Connection) -> str:
        """Time when a user last answered for what a verification found; "" for never."""
        times = select(func.max(TABLES["event"].c.created)).where(_matching("event", heads.ACCEPTED))
        return str(connection.execute(times).scalar() or "")

    def _explain_rollback(self, newest: heads.SignedHead, lost: Witnessed) -> LedgerError:
        """The error of a ledger of which a witness remembers more than it holds."""
        if lost.head is None:
            raise TypeError("a head that is not readable is beyond nothing")
        about: dict[str, Value] = {"ledger": self.shown, "record": newest.size, "place": lost.place or self.shown}
        about |= {"signed_record": lost.head.size, "time": lost.head.time[:19]}
        return LedgerError(Finding("ledger-behind", about))

    def _not_behind(self, connection: Connection) -> None:
        newest = heads.newest_head(connection)
        if newest is None:
            return
        if not 0 <= self._seen <= newest.size:
            lost = ahead(self.keys.folder, newest, self._accepted(connection))
            if lost is not None:
                raise self._explain_rollback(newest, lost)
        self._seen = newest.size

    def _never_signed(self, connection: Connection, folders: Sequence[Path] = ()) -> None:
        """Refuse to go on with a ledger that holds no signed head and is known as a signed one, here or in a folder."""
        if self._unknown and not folders:
            return
        beside = self.keys.folder / "heads"
        try:
            known = remembered(connection, folders or [beside])
            by = str(beside) if known is None else known.witness
            signed = known is not None or begun_at(self.keys.folder, self.where) != ""
        except (OSError, FileError):  # the folder of another user
            signed = False
        if signed:
            raise LedgerError(Finding("ledger-signatures-removed", {"ledger": self.shown, "place": by}))
        self._unknown = True

    def correct_clock(self, reason: str, *, author: str) -> Record:
        """Go on after the clock was in the future when something was recorded: as an event, with the time of now."""
        if not stated(reason):
            raise refused("ledger-reason")
        keys = {"subject_kind": "ledger", "subject": "clock", "action": "corrected"}
        draft = Draft("event", keys, {"reason": reason})
        return self.append_all([draft], author=author, slack=timedelta.max)[0]

    def _now(self, last: str | None, slack: timedelta) -> str:
        time = self._clock().astimezone(UTC)
        if last is not None and _time(last) - time > slack:
            raise LedgerError(Finding("ledger-clock", {"now": f"{time:%Y-%m-%d %H:%M:%S}", "last": last[:19]}))
        return time.isoformat(timespec="microseconds")

    @contextmanager
    def filling(self) -> Iterator[Connection]:
        """A connection that writes records made elsewhere into this ledger, which must be empty."""
        self._writable()
        with self._writing() as connection:
            head, _ = self._tail(connection)
            if head.seq:
                raise LedgerError(Finding("ledger-not-empty", {"ledger": self.shown}))
            name, _ = self._sealing.before(connection, head)
            yield connection
            head = self._tail(connection)[0]
            signed = None
            if name:
                self._sealing.resume(connection, head)
                signed = self._sealing.after(connection, name, (), head, self._now(None, timedelta.max))
        self._witnesses.publish(signed)

    # -- reading -------------------------------------------------------------------------------------------------------

    def get(self, kind: str, name: str) -> Record:
        """The record of that id; LedgerError when there is none."""
        found = self._select(_query(kind).where(TABLES[kind].c.id == name), kind) if plain(name) else []
        if not found:
            raise LedgerError(missing(kind, name, self.shown))
        return found[0]

    def latest(self, kind: str, **keys: Any) -> Record | None:
        """The newest record with these keys, None when there is none."""
        table = _table(kind)
        found = self._select(_query(kind).where(_matching(kind, keys)).order_by(table.c.seq.desc()).limit(1), kind)
        return found[0] if found else None

    def find(self, kind: str, *, after: int = 0, limit: int = 1000, newest: bool = False, **keys: Any) -> list[Record]:
        """Records with these keys in order of their place in the chain, beyond `after`; newest first when asked.

        With `newest`, `after` is the place before which to go on (0: from the end). A list as the value of a key finds
        the records that have any of its values.
        """
        last = 2**63 - 1
        column = _table(kind).c.seq
        after, limit = min(max(after, 0), last), min(max(limit, 0), last)
        query = _query(kind).where(_matching(kind, keys)).limit(limit)
        if newest:
            query = query.order_by(column.desc())
            query = query.where(column < after) if after else query
        else:
            query = query.where(column > after).order_by(column)
        return self._select(query, kind)

    def current(self, kind: str, *, limit: int = 1000, after: str = "") -> list[Record]:
        """The newest record of each key (tools, rigs, sites, users), by name, beyond the name `after`."""
        table, (key, *_) = _table(kind), KINDS[kind].keys
        if after and not plain(after):
            raise no_text("after", after)
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
            query = select(func.count()).select_from(_table(kind)).where(_matching(kind, keys))
            return int(connection.execute(query).scalar_one())

    def document(self, digest: str) -> tuple[str, bytes]:
        """Media type and bytes of a file a record refers to; LedgerError when it is not there or was changed."""
        with self._reading() as connection:
            query = STORED.where(DOCUMENT.c.digest == digest if plain(digest) else false())
            row = connection.execute(query).first()
        if row is None:
            raise LedgerError(missing("document", digest, self.shown))
        if not as_stored(row.data, digest):
            raise LedgerError(chain.changed("document", digest))
        return row.media_type, row.data

    def head(self) -> chain.Head:
        """The last link of the chain."""
        with self._reading() as connection:
            return self._tail(connection)[0]

    @contextmanager
    def snapshot(self) -> Iterator[Connection]:
        """A connection that sees one state of the whole ledger, however long it reads."""
        frozen = self._engine
        if frozen.dialect.name == "postgresql":  # SQLite's reader sees one state anyway
            frozen = frozen.execution_options(isolation_level="REPEATABLE READ")
        with translated(self.shown), frozen.begin() as connection:
            yield connection

    # -- inside --------------------------------------------------------------------------------------------------------

    def _select(self, query: Select[Any], kind: str) -> list[Record]:
        with self._reading() as connection:
            return [record_of(kind, row) for row in connection.execute(query)]

    def _tail(self, connection: Connection) -> tuple[chain.Head, str | None]:
        # without the limit PostgreSQL's driver fetches the whole chain
        query = select(CHAIN.c.seq, CHAIN.c.link, CHAIN.c.created).order_by(CHAIN.c.seq.desc()).limit(1)
        row = connection.execute(query).first()
        return (chain.Head(0, chain.GENESIS), None) if row is None else (chain.Head(row.seq, row.link), row.created)

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        with translated(self.shown), self._engine.connect() as connection:
            yield connection

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        writing = self._engine.execution_options(writing=True)
        with translated(self.shown), writing.begin() as connection:
            yield connection


def send(witness: str, head: heads.SignedHead, where: str, folder: Path) -> None:
    """Tell one witness of a head of the ledger `where`; `folder` is that of the keys.

    A ledger records it as an event, signs it in its turn and tells its own witness of it.
    """
    place = place_of(where)
    if witness == PRINT:
        print(f"head {chain.compact(head.statement())}", flush=True)  # noqa: T201
    elif not is_ledger(witness):
        keep(Path(witness), head, place)
    elif not itself(witness, place):
        keys = {"subject_kind": "ledger", "subject": head.ledger, "action": "head"}
        with Ledger(witness, keys=Keys(folder), alone=True) as ledger:
            ledger.append("event", keys, {"details": {**head.statement(), "where": place}}, author="witness")


def _time(created: str) -> datetime:
    try:
        return datetime.fromisoformat(created)
    except ValueError:
        raise LedgerError(chain.changed("chain", created)) from None


def _table(kind: str) -> Table:
    if kind not in TABLES:
        raise not_among("kind", f"{kind!r:.60}", TABLES)
    return TABLES[kind]


def _query(kind: str) -> Select[Any]:
    table = _table(kind)
    return select(table, CHAIN.c.digest).join(CHAIN, CHAIN.c.seq == table.c.seq)


def _matching(kind: str, keys: Mapping[str, Any]) -> ColumnElement[bool]:
    unknown = set(keys) - set(KINDS[kind].keys)
    if unknown:
        raise refused("input-unknown", {"names": tuple(sorted(unknown)), "known": tuple(KINDS[kind].keys)})
    return and_(True, *(_equal(kind, name, value) for name, value in keys.items()))


def _equal(kind: str, name: str, value: Any) -> ColumnElement[bool]:
    # what no record can have finds none; the engines would each complain in their own way
    wanted = value if isinstance(value, list | tuple | set) else [value]
    return TABLES[kind].c[name].in_([one for one in wanted if fits(KINDS[kind].keys[name], one)])

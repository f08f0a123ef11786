"""Signed heads: the laboratory's key says how many records there are and what they all were, at each step."""

from __future__ import annotations

import re
import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from sqlalchemy import func, inspect, select
from sqlalchemy.engine import Connection

from inclinometry.errors import FileError
from inclinometry.files.json_codec import load
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.engine import CHAIN, HEAD, Draft
from inclinometry.laboratory.ledger.keys import Keys, SigningKey, descends, explained, fingerprint, right, signed_bytes
from inclinometry.laboratory.ledger.merkle import SIZE, Frontier, Tree, consistent, leaf_hash

SCHEMA: Final = "inclinometry/ledger-head"
KEY_EVENT: Final = {"subject_kind": "ledger", "subject": "key"}
"""Keys of the event that records how a key was rotated or lost; its action says which."""
ACCEPTED: Final = {"subject_kind": "ledger", "subject": "head", "action": "accepted"}
"""Keys of the event by which a user accepts what verification found, in words, and goes on."""
WITNESS_EVENT: Final = {"subject_kind": "ledger", "subject": "witness"}
"""Keys of the event that records that a witness was "named" or "removed"; details: its place, and the ledger."""


@dataclass(frozen=True)
class SignedHead:
    """What a key says of a ledger.

    ledger : the ledger's own name, 32 hexadecimal digits, given when it was begun.
    size, root : of the tree of RFC 6962 over its records.
    link : the last link of the hash chain, as before.
    time : UTC. key : public key. signature : base64, over everything else.
    """

    ledger: str
    size: int
    root: str
    link: str
    time: str
    key: str
    signature: str

    def statement(self) -> dict[str, Any]:
        """As it is stored, sent and printed."""
        return {"schema": SCHEMA, "version": 1, **vars(self)}

    def signature_is_valid(self) -> bool:
        """Whether the signature is that of the key."""
        return right(self.key, self.signature, signed_bytes(self.statement()))

    def __str__(self) -> str:
        return f"{self.size} of {self.time} (ledger {self.ledger}, root {self.root}, key {fingerprint(self.key)})"


def parse_signed(content: object, where: str | Path) -> SignedHead:
    """A signed head from its JSON content, FileError for another shape; its signature is not looked at."""
    whole = content if isinstance(content, Mapping) else {}
    said: dict[str, Any] = {name: whole.get(name) for name in SignedHead.__dataclass_fields__}
    digits = {"ledger": 32, "root": 64, "link": 64, "key": 64}
    size, texts = said["size"], [one for name, one in said.items() if name != "size"]
    fits = all(isinstance(one, str) and len(one) <= 200 for one in texts) and all(
        re.fullmatch(f"[0-9a-f]{{{length}}}", str(said[name])) for name, length in digits.items()
    )
    if whole.get("schema") != SCHEMA or whole.get("version") != 1 or type(size) is not int or size < 0 or not fits:
        about = {"expected": "signed head", "command": "inclinometry ledger head -o FILE"}
        raise FileError(Finding("ledger-other-file", about), path=where)
    return SignedHead(**said)


def signed_by(key: SigningKey, ledger: str, head: chain.Head, root: bytes, time: str) -> SignedHead:
    """A head signed."""
    bare = SignedHead(ledger, head.seq, root.hex(), head.link, time, key.public, "")
    return replace(bare, signature=key.sign(signed_bytes(bare.statement())))


_COLUMNS: Final = {"size": "seq", "time": "created"}
"""Fields of a signed head whose columns have other names."""


def head_of(row: Any) -> SignedHead:
    """The signed head of a row of its table.

    Raises LedgerError: a user put something else than a head there.
    """
    said = {name: getattr(row, _COLUMNS.get(name, name)) for name in SignedHead.__dataclass_fields__}
    try:
        return parse_signed({"schema": SCHEMA, "version": 1, **said}, "head")
    except FileError:
        raise LedgerError(chain.changed("signed head", row.place)) from None


def newest_head(connection: Connection, *, readable: bool = False) -> SignedHead | None:
    """The last signed head, or the last that can be read; None in a ledger that is not signed."""
    if not inspect(connection).has_table("head"):
        return None
    query = select(HEAD).order_by(HEAD.c.place.desc())
    for row in connection.execute(query if readable else query.limit(1), execution_options={"yield_per": 500}):
        try:
            return head_of(row)
        except LedgerError:
            if not readable:
                raise
    return None


def leaves(connection: Connection, after: int, until: int) -> Iterable[bytes]:
    """Hashes of the leaves of the records beyond `after`, up to `until`, as the chain has them."""
    query = select(CHAIN).where((CHAIN.c.seq > after) & (CHAIN.c.seq <= until)).order_by(CHAIN.c.seq)
    for row in connection.execute(query, execution_options={"yield_per": 500}):
        yield leaf_hash(chain.leaf(row.seq, row.kind, row.record, row.created, row.digest))


def _by_other(newest: SignedHead, keys: Keys, where: str) -> LedgerError:
    about = {"ledger": where, "key": fingerprint(newest.key), "folder": str(keys.folder)}
    return LedgerError(Finding("key-other", about))


def succession(newest: SignedHead, public: str, keys: Keys, where: str) -> Sequence[Mapping[str, Any]]:
    """The changes that lead from the key of a ledger's last head to the laboratory's; none where it is the same.

    Raises LedgerError: another key signed the ledger `where`.
    """
    path = [] if newest.key == public else explained(newest.key, public, keys.changes())
    if path is None:
        raise _by_other(newest, keys, where)
    return path


class Sealing:
    """The signing of one ledger's heads: the tree as far as it is known, and the keys; `where` is for messages."""

    def __init__(self, keys: Keys, where: str) -> None:
        self.keys = keys
        self._where = where
        self._tree = Frontier()
        self._peaks_at = 0

    def begin(self, connection: Connection, head: chain.Head, time: str, name: str) -> SignedHead:
        """The first signed head of a ledger, whose name is made where it has none; it covers all its records."""
        self._tree = Frontier()
        self._tree.extend(leaves(connection, 0, head.seq))
        return self._write(connection, name or uuid.uuid4().hex, head, time)

    def before(self, connection: Connection, head: chain.Head) -> tuple[str, list[Draft]]:
        """Before something is recorded: the ledger's name ("" when it is not signed), what is to be recorded first.

        Refused with records that no head covers, a head the laboratory's key did not sign, or no key: whoever signs now
        would sign what another user has done.
        """
        newest = newest_head(connection)
        if newest is None:
            return "", []
        if not self.keys.there:
            raise _by_other(newest, self.keys, self._where)
        if (head.seq, head.link) != (newest.size, newest.link) or not newest.signature_is_valid():
            raise self._modified(newest.size)
        key = self.keys.signing()
        # whoever signs with the same key needs no word about others
        changes = succession(newest, key.public, self.keys, self._where)
        if (self._tree.size, self._tree.root().hex()) != (newest.size, newest.root):
            self._load(connection, newest)
        events = [Draft("event", {**KEY_EVENT, "action": one["action"]}, {"details": dict(one)}) for one in changes]
        return newest.ledger, events

    def after(
        self, connection: Connection, ledger: str, added: Sequence[bytes], head: chain.Head, time: str
    ) -> SignedHead:
        """The head signed after records were written; `added` are the hashes of their leaves."""
        self._tree.extend(added)
        return self._write(connection, ledger, head, time)

    def resume(self, connection: Connection, head: chain.Head) -> str:
        """The ledger's name, its tree worked out again from whatever the chain holds; for who accepts that."""
        newest = newest_head(connection)
        self._tree = Frontier()
        self._tree.extend(leaves(connection, 0, head.seq))
        self._peaks_at = head.seq
        return "" if newest is None else newest.ledger

    def _load(self, connection: Connection, newest: SignedHead) -> None:
        kept = select(HEAD).where(HEAD.c.frontier.is_not(None)).order_by(HEAD.c.place.desc()).limit(1)
        row = connection.execute(kept).first()
        tree = Frontier()
        if row is not None:
            text = row.frontier
            try:
                peaks = [bytes.fromhex(text[at : at + 2 * SIZE]) for at in range(0, len(text), 2 * SIZE)]
                tree = Frontier(row.seq, peaks)
            except (TypeError, ValueError):
                raise self._modified(newest.size) from None
        self._peaks_at = tree.size
        tree.extend(leaves(connection, tree.size, newest.size))
        # what was read is what was signed, or nothing is built upon it
        if tree.root().hex() != newest.root:
            raise self._modified(newest.size)
        self._tree = tree

    def _write(self, connection: Connection, ledger: str, head: chain.Head, time: str) -> SignedHead:
        made = signed_by(self.keys.make(), ledger, head, self._tree.root(), time)
        peaks = None
        # records between two rows that keep the peaks: so many are read again when a program starts
        if head.seq - self._peaks_at >= 256:
            peaks, self._peaks_at = b"".join(self._tree.peaks).hex(), head.seq
        row = {_COLUMNS.get(name, name): value for name, value in vars(made).items()}
        last = connection.execute(select(func.max(HEAD.c.place))).scalar() or 0
        connection.execute(HEAD.insert(), {**row, "place": last + 1, "frontier": peaks})
        return made

    def _modified(self, size: int) -> LedgerError:
        return LedgerError(Finding("ledger-modified", {"ledger": self._where, "signed_record": size}))


# Heads as files: what a user who does not hold the ledger can check.


def read_head(path: str | Path) -> tuple[SignedHead, dict[str, Any]]:
    """A signed head from its file, with the whole content, where a proof of consistency may be.

    Raises FileError: not a signed head, or one that its key did not sign.
    """
    content = load(path)
    found = parse_signed(content, path)
    if not found.signature_is_valid():
        about = {"place": Path(path).name, "key": fingerprint(found.key)}
        raise FileError(Finding("key-forged", about), path=path)
    return found, content


def check_extension(old: SignedHead, new: SignedHead, content: Mapping[str, Any], public: str | None) -> Finding | None:
    """What is wrong between an old head and a new one with its proof; None when the ledger only grew."""
    if old.ledger != new.ledger:
        return Finding("ledger-another", {"ledger": old.ledger})
    changes = [one for one in content.get("changes", []) if isinstance(one, dict)]
    if not descends(new.key, public or old.key, changes):
        known = fingerprint(public or old.key)
        return Finding("key-not-laboratory", {"key": fingerprint(new.key), "expected": known})
    proof = content.get("consistency", {})
    try:
        if old.size == new.size:
            hashes: list[bytes] = []
        elif proof["from"] != old.size:
            return Finding("ledger-no-proof", {"record": old.size})
        else:
            hashes = [bytes.fromhex(one) for one in proof["proof"]]
    except (KeyError, TypeError, ValueError):
        return Finding("ledger-no-proof", {"record": old.size})
    if consistent(old.size, new.size, bytes.fromhex(old.root), bytes.fromhex(new.root), hashes):
        return None
    return Finding("ledger-rewritten", {"record": old.size, "place": old.time})


def proof_since(connection: Connection, first: int, second: int) -> list[str]:
    """Hashes that prove that the first `second` records of a ledger begin with its first `first` ones."""
    return [one.hex() for one in Tree(leaves(connection, 0, second)).consistency(first, second)]

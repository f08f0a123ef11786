"""The signed heads of a ledger, those in it and those that witnesses keep, against the records as they are."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from sqlalchemy import inspect, select
from sqlalchemy.engine import Connection

from inclinometry.errors import FileError
from inclinometry.findings import Finding, Value
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.engine import HEAD, shown
from inclinometry.laboratory.ledger.heads import ACCEPTED, KEY_EVENT, WITNESS_EVENT, SignedHead, head_of, newest_head
from inclinometry.laboratory.ledger.keys import KeyFaultError, Keys, descends, explained, fingerprint, genuine
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.merkle import Frontier, leaf_hash
from inclinometry.laboratory.ledger.witness import (
    Witnessed,
    begun_at,
    folders_of,
    others,
    remembered,
    silent_witness,
    witnessed,
)

Testimony: TypeAlias = tuple[list[Witnessed], list[Finding], list[Finding]]
"""What `witnessed` gives: heads that are kept, witnesses that do not answer, those that keep none."""


def collect_heads(ledger: Ledger) -> tuple[str, Testimony, Witnessed | None]:
    """The ledger last seen in this place, what the witnesses say of the one that is there, and by which head it is
    known where it holds none of its own."""
    known = None
    with ledger.snapshot() as connection:
        newest = newest_head(connection, readable=True)
        try:
            here = begun_at(ledger.keys.folder, ledger.where)
            if newest is None:
                known = remembered(connection, folders_of(ledger.keys.folder, ledger.where))
        except (OSError, FileError) as error:
            return "", ([], [silent_witness(str(ledger.keys.folder), error)], []), None
    name = here if newest is None else newest.ledger
    if known is not None and known.head is not None:
        name = known.head.ledger
    said = witnessed(ledger.keys.folder, name, ledger.where) if name else ([], [], [])
    return here, said, known


def _public(keys: Keys) -> tuple[tuple[str, ...], list[Finding]]:
    """The keys of this computer, the one of now first; the fault of one that was exchanged."""
    faults: list[Finding] = []
    try:
        now = keys.public()
    except OSError:  # the folder of another user
        return (), []
    except KeyFaultError as error:
        now, faults = error.own, [error.finding]
    return () if now is None else (now, *keys.former(now)), faults


class Signatures:
    """Along the chain with its tree, comparing each signed head with the root of the records it speaks of.

    `public` are the laboratory's keys, the present one first; `here` is the ledger last seen in this place, `known` the
    head by which a ledger that holds none is known to have been signed. A `copy` may end before heads that witnesses
    keep.
    """

    def __init__(
        self,
        connection: Connection,
        ledger: Ledger,
        public: Sequence[str],
        here: str,
        testimony: Testimony,
        known: Witnessed | None,
        *,
        copy: bool = False,
    ) -> None:
        self.newest = newest_head(connection, readable=True)
        self._where = ledger.shown
        self._unreadable: list[Finding] = []
        self._given, self._here, self._remembered = tuple(public), here, known
        ours, self._other_key = _public(ledger.keys)
        self._wanted = self._given or ours
        by_folder = not self._given and bool(ours or self._other_key)
        self._uncompared = ledger.keys.uncompared() if by_folder else None
        self.compared = not self._uncompared if by_folder and ledger.keys.there else None
        """Whether the key that it is verified by is that of key.pem; None where there is none, or a key was given."""
        self._own_changes = ledger.keys.changes() if ours else []
        self._copy = copy
        self.strange = False
        """Whether the last head is signed by another key than the one here, and nothing says that it should not be."""
        self._kept, self._notes = testimony[0], list[Finding]()
        # only who signs tells a witness: on another computer none is expected
        signs = self.newest is not None and (self.newest.key in ours or self._before_the_break() is not None)
        self._own = own = signs and ledger.keys.there
        try:
            self._listed = {shown(one) for one in others(ledger.keys.folder)}
        except FileError:  # the folder of another user
            if own:
                raise
            self._listed = set()
        # place of a witness -> whether it was named, and not removed since
        self._named: dict[str, bool] = {}
        self._lost_witnesses = testimony[2] if own else []
        self._tree = Frontier()
        self._link = chain.GENESIS
        self._own_heads = self._stored(connection) if inspect(connection).has_table("head") else iter(())
        self._next = next(self._own_heads, None)
        self._first = 0 if self._next is None else self._next[0].size
        readable = [(one.head, one.witness, one.place) for one in self._kept if one.head is not None]
        self._elsewhere: dict[str, int] = {}
        self._outside = sorted(readable, key=lambda kept: kept[0].size)
        self._at = 0
        # of what contradicts the records: time of the head, witness, the fault; a user may have accepted it
        self._doubts: list[tuple[str, str, Finding]] = []
        self._agreed: dict[str, int] = {}
        self._changes: list[dict[str, Any]] = []
        self._accepted: list[tuple[str, str, str]] = []
        self._keys = self._successive(connection) if self.newest else []
        self._signers = {*self._wanted, *(key for key, _, _ in self._keys)}
        self._compare(0)

    def _stored(self, connection: Connection) -> Iterator[tuple[SignedHead, str | None]]:
        last = (-1, -1)
        while True:
            beyond = (HEAD.c.seq > last[0]) | ((HEAD.c.seq == last[0]) & (HEAD.c.place > last[1]))
            rows = connection.execute(select(HEAD).where(beyond).order_by(HEAD.c.seq, HEAD.c.place).limit(500)).all()
            if not rows:
                return
            for row in rows:
                try:
                    yield head_of(row), row.frontier
                except LedgerError:
                    self._unreadable.append(chain.changed("signed head", row.place))
            last = (rows[-1].seq, rows[-1].place)

    @staticmethod
    def _successive(connection: Connection) -> list[tuple[str, int, str]]:
        """Each key with the first head that it signed: (key, size, time)."""
        found: list[tuple[str, int, str]] = []
        query = select(HEAD.c.key, HEAD.c.seq, HEAD.c.created).order_by(HEAD.c.place)
        for row in connection.execute(query, execution_options={"yield_per": 500}):
            # others are faults of their own
            whole = isinstance(row.key, str) and re.fullmatch("[0-9a-f]{64}", row.key) and isinstance(row.created, str)
            if whole and (not found or found[-1][0] != row.key):
                found.append((row.key, row.seq, row.created))
        return found

    def step(self, link: Any, row: Any) -> None:
        """One link further."""
        try:
            text = chain.leaf(link.seq, link.kind, link.record, link.created, link.digest)
        except (TypeError, UnicodeEncodeError):  # bytes in a text's place, broken UTF-8: a fault of its own
            text = b""
        self._tree.extend([leaf_hash(text)])
        self._link = str(link.link)
        if link.kind == "event" and row is not None and row.subject_kind == "ledger":
            self._event(row)
        self._compare(link.seq)

    def _event(self, row: Any) -> None:
        try:
            body = json.loads(row.body)
            details, reason = body.get("details", {}), str(body.get("reason", ""))
        except (ValueError, TypeError, AttributeError, RecursionError):
            return
        if row.subject == KEY_EVENT["subject"] and isinstance(details, dict) and genuine(details):
            self._changes.append(details)
        here = "" if self.newest is None else self.newest.ledger  # others were imported into this one
        if row.subject == WITNESS_EVENT["subject"] and isinstance(details, dict) and details.get("ledger") == here:
            self._named[str(details.get("place"))] = row.action == "named"
        if (row.subject, row.action) == (ACCEPTED["subject"], ACCEPTED["action"]):
            earlier = details.get("earlier", []) if isinstance(details, dict) else []
            self._accepted += [(str(one["created"]), str(one["author"]), str(one["reason"])) for one in earlier]
            self._accepted.append((str(row.created), str(row.author), reason))

    def _compare(self, seq: int) -> None:
        """Every head that speaks of the records up to this one."""
        while self._next is not None and self._next[0].size <= seq:
            head, peaks = self._next
            self._judge(head, "", seq)
            if head.size == seq and peaks not in (None, b"".join(self._tree.peaks).hex()):
                # nothing is signed upon them unless they lead to the signed root; changed all the same
                said = chain.changed("signed head", f"{head.size} ({head.time[:19]})")
                self._doubts.append((head.time, "", said))
            self._next = next(self._own_heads, None)
        while self._at < len(self._outside) and self._outside[self._at][0].size <= seq:
            self._judge(*self._outside[self._at][:2], seq)
            self._at += 1

    def _judge(self, head: SignedHead, witness: str, seq: int) -> None:
        if self._forged(head, witness):
            return
        if self.newest is not None and head.ledger != self.newest.ledger:
            self._doubts.append((head.time, witness, Finding("ledger-another", {"ledger": head.ledger})))
        elif self._by_another(head, witness):
            pass
        elif head.size != seq or (self._tree.root().hex(), self._link) != (head.root, head.link):
            said = Finding("ledger-rewritten", {"record": head.size, "place": witness or self._where})
            self._doubts.append((head.time, witness, said))
        elif witness:
            self._agreed[witness] = max(self._agreed.get(witness, 0), head.size)

    def _forged(self, head: SignedHead, witness: str) -> bool:
        """Whether the signature of a head is not that of its key."""
        if head.signature_is_valid():
            return False
        place = f"{witness or self._where}: {head.size} ({head.time[:19]})"
        said = Finding("key-forged", {"place": place, "key": fingerprint(head.key)})
        self._doubts.append(("9999", witness, said))
        return True

    def _by_another(self, head: SignedHead, witness: str) -> bool:
        """Whether a witness keeps a head that no key of the laboratory, and none of the ledger's heads, signed."""
        if not witness or not self._wanted or head.key in self._signers:
            return False
        expected = fingerprint(self._wanted[0])
        said = Finding("key-not-laboratory", {"key": fingerprint(head.key), "expected": expected})
        self._doubts.append((head.time, witness, said))
        return True

    def end(self, seq: int) -> tuple[list[Finding], list[Finding]]:
        """Faults and notes when the last record, `seq`, is passed."""
        while self._next is not None:
            self._lost(self._next[0], "", "", seq)
            self._next = next(self._own_heads, None)
        for head, witness, place in self._outside[self._at :]:
            self._lost(head, witness, place, seq)
        faults = self._other_key
        unreadable = [one.witness for one in self._kept if one.head is None]
        faults += [chain.changed("signed head", witness) for witness in unreadable]
        faults += self._unreadable
        faults += self._lost_witnesses
        faults += self._unlisted()
        faults += self._whole(seq)
        # no one answered for a ledger by a record in it that no one signed
        said = max(self._accepted, default=("", "", "")) if self.newest is not None else ("", "", "")
        first: dict[tuple[str, str], Finding] = {}
        excused = 0
        for time, witness, fault in self._doubts:
            if time <= said[0]:
                excused += 1
            elif fault.code == "ledger-removed":  # of records that are gone the last one says all
                first[fault.code, ""] = fault
            else:  # what follows from the first need not be said a thousand times
                first.setdefault((fault.code, witness), fault)
        faults += first.values()
        for time, author, reason in self._accepted:
            self._note("ledger-accepted", time=time[:19], author=author, reason=reason)
        if excused:
            self._note("ledger-excused", count=excused)
        for place, size in self._elsewhere.items():
            self._note("ledger-copy", place=place, record=size)
        faults += self._of_keys(said)
        return faults, [*self._notes, *self._signed()]

    def _note(self, code: str, **values: Value) -> None:
        self._notes.append(Finding(code, values, severity="note"))

    def _lost(self, head: SignedHead, witness: str, place: str, seq: int) -> None:
        if self._forged(head, witness) or self._by_another(head, witness):
            return
        if witness and self._copy:
            self._elsewhere[place] = max(self._elsewhere.get(place, 0), head.size)
            return
        self._doubts.append((head.time, witness, lost("ledger-removed", "chain", seq + 1, head.size)))

    def _unlisted(self) -> Iterator[Finding]:
        """Faults of witnesses that were named, and that a user took off the list in the folder of the keys."""
        for place in (place for place, named in self._named.items() if named and place not in self._listed):
            if self._own:
                yield Finding("key-witness-unlisted", {"place": place})
            else:
                self._note("key-witness-unlisted", place=place)

    def _whole(self, seq: int) -> Iterator[Finding]:
        """Faults of a ledger whose end is not signed, or that is not the one that was here."""
        if self.newest is None:
            if self._given:
                yield self._stripped(fingerprint(self._given[0]))
            if self._here:
                yield Finding("ledger-another", {"ledger": self._here})
            elif self._remembered is not None and self._remembered.head is not None:
                witness = self._remembered.witness
                if max(self._agreed.values(), default=0) == seq:  # a copy of what was signed later or elsewhere
                    self._note("ledger-copy", place=witness, record=seq)
                    return
                yield self._stripped(witness)
            return
        if self._here and self._here != self.newest.ledger:
            yield Finding("ledger-another", {"ledger": self._here})
        if self.newest.size < seq:
            yield lost("ledger-inserted", "chain", self.newest.size + 1, seq)

    def _stripped(self, place: str) -> Finding:
        return Finding("ledger-signatures-removed", {"ledger": self._where, "place": place})

    def _of_keys(self, accepted: tuple[str, str, str]) -> Iterator[Finding]:
        """Faults of the keys: one that followed another without a word, or that is not the laboratory's."""
        if self.newest is not None and not self._known():
            self._notes += _changed(self.newest.key, self._before_the_break() or (), self.newest.size + 1)
        for (before, _, _), (after, size, time) in zip(self._keys, self._keys[1:], strict=False):
            path = explained(before, after, self._changes)
            self._notes += _changed(before, path or (), size)
            if path is None and time <= accepted[0]:
                self._notes.append(_break(size, after, accepted[2]))
            elif path is None:
                about = {"key": fingerprint(after), "expected": fingerprint(before)}
                yield Finding("key-not-laboratory", about)
        if self.newest is None or not self._wanted or self._known() or self._before_the_break() is not None:
            return
        # one that this laboratory never signed is another's, which is looked at on a computer with a key of its own
        signed = any(one.head is not None and one.head.key in self._wanted for one in self._kept)
        self.strange = not (self._given or self._here or signed)
        if not self.strange:
            about = {"key": fingerprint(self.newest.key), "expected": fingerprint(self._wanted[0])}
            yield Finding("key-not-laboratory", about)

    def _before_the_break(self) -> list[Mapping[str, Any]] | None:
        """How the key here came after that of the last head, which was lost; None where it did not.

        The new key says so itself, in its folder, until the ledger's next record says it, too.
        """
        if self.newest is None or self._given or not self._wanted:
            return None
        path = explained(self.newest.key, self._wanted[0], self._own_changes) or []
        since = next((str(one["time"]) for one in path if one["action"] == "lost"), "")
        # whoever found the key goes on signing with it
        return path if self.newest.time[:19] <= since[:19] else None

    def _known(self) -> bool:
        """Whether the last head is signed by a key of the laboratory, or by one that such a key signed for."""
        return self.newest is not None and any(descends(self.newest.key, one, self._changes) for one in self._wanted)

    def _signed(self) -> Iterator[Finding]:
        """Who signed what, which witnesses agree."""
        if self.newest is None:  # see `unsigned`
            return
        size, by = self.newest.size, fingerprint(self.newest.key)
        if self.strange:
            own = fingerprint(self._wanted[0])
            yield Finding("key-not-here", {"record": size, "key": by, "own": own})
        else:
            whose = "the laboratory's" if self._known() else "compare it with the laboratory's"
            if self._before_the_break() is not None:
                whose = "the laboratory's until it was lost"
            elif self._uncompared:
                whose = "the one in public.pem"
            yield Finding("key-signed", {"record": size, "key": by, "whose": whose}, severity="note")
            if self._uncompared and self._before_the_break() is None:
                yield self._uncompared
        first = min([self._first, *(head.size for head, _, _ in self._outside)])
        if first:
            yield Finding("ledger-unsigned-begin", {"count": first}, severity="note")
        for witness, size in self._agreed.items():
            yield Finding("key-witness-agrees", {"place": witness, "record": size}, severity="note")
        if not self._agreed:
            yield Finding("key-witness-none", severity="note")


def lost(code: str, kind: str, first: int, last: int) -> Finding:
    """Records of the chain, from one to another, that were removed or inserted."""
    return Finding(code, {"kind": kind, "record": f"{first}" if first == last else f"{first} .. {last}"})


def _break(size: int, key: str, reason: str) -> Finding:
    return Finding("key-break", {"record": size, "key": fingerprint(key), "reason": reason})


def _changed(before: str, path: Sequence[Mapping[str, Any]], size: int) -> Iterator[Finding]:
    """Which keys followed one from the record `size` on, and whether each was signed for."""
    for one in path:
        new = str(one["after"])
        if one["action"] == "rotated":
            about: dict[str, Value] = {"record": size, "key": fingerprint(new), "before": fingerprint(before)}
            yield Finding("key-rotated", about, severity="note")
        else:
            yield _break(size, new, str(one["reason"]))
        before = new

"""The signed heads of a ledger, those in it and those that witnesses keep, against the records as they are."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from sqlalchemy import inspect, select
from sqlalchemy.engine import Connection

from inclinometry.errors import FileError
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
    lost_sentence,
    others,
    remembered,
    witnessed,
)


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong: table, row (its place and id), and in words what happened to it."""

    table: str
    row: str
    problem: str

    def __str__(self) -> str:
        return f"{self.table}{'' if self.row == '-' else f' {self.row}'}: {self.problem}"


Testimony: TypeAlias = tuple[list[Witnessed], list[str], list[str]]
"""What `witnessed` gives: heads that are kept, witnesses that do not answer, those that keep none."""


def asked(ledger: Ledger) -> tuple[str, Testimony, Witnessed | None]:
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
            reason = getattr(error, "strerror", None) or error
            silent = f'the witness in {ledger.keys.folder} cannot be asked ("{reason}")'
            return "", ([], [silent], []), None
    name = here if newest is None else newest.ledger
    if known is not None and known.head is not None:
        name = known.head.ledger
    said = witnessed(ledger.keys.folder, name, ledger.where) if name else ([], [], [])
    return here, said, known


def _public(keys: Keys) -> tuple[tuple[str, ...], list[Fault]]:
    """The keys of this computer, the one of now first; the fault of one that was exchanged."""
    faults = []
    try:
        now = keys.public()
    except OSError:  # the folder of another user
        return (), []
    except KeyFaultError as error:
        now, faults = error.own, [Fault("keys", "-", str(error))]
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
        self._unreadable: list[Fault] = []
        self._given, self._here, self._remembered = tuple(public), here, known
        ours, self._other_key = _public(ledger.keys)
        self._wanted = self._given or ours
        by_folder = not self._given and bool(ours or self._other_key)
        self._uncompared = ledger.keys.uncompared() if by_folder else ""
        self.compared = not self._uncompared if by_folder and ledger.keys.there else None
        """Whether the key that it is verified by is that of key.pem; None where there is none, or a key was given."""
        self._own_changes = ledger.keys.changes() if ours else []
        self._copy = copy
        self.strange = False
        """Whether the last head is signed by another key than the one here, and nothing says that it should not be."""
        self._kept, self._notes = testimony[0], list[str]()
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
        name, folder = self.newest.ledger if self.newest else "", ledger.keys.folder
        self._lost_witnesses = [lost_sentence(folder, one, name) for one in testimony[2]] if own else []
        self._tree = Frontier()
        self._link = chain.GENESIS
        self._own_heads = self._stored(connection) if inspect(connection).has_table("head") else iter(())
        self._next = next(self._own_heads, None)
        self._first = 0 if self._next is None else self._next[0].size
        readable = [(one.head, one.witness, one.place) for one in self._kept if one.head is not None]
        self._elsewhere: dict[str, int] = {}
        self._outside = sorted(readable, key=lambda kept: kept[0].size)
        self._at = 0
        # of what contradicts the records: time of the head, and the fault; a user may have answered for it
        self._doubts: list[tuple[str, Fault]] = []
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
                    what = "was changed: it cannot be read as a signed head"
                    self._unreadable.append(Fault("head", f"in place {row.place}", what))
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
                said = "the peaks of the tree that are kept beside it were changed"
                self._doubts.append((head.time, Fault("head", f"{head.size} ({head.time[:19]})", said)))
            self._next = next(self._own_heads, None)
        while self._at < len(self._outside) and self._outside[self._at][0].size <= seq:
            self._judge(*self._outside[self._at][:2], seq)
            self._at += 1

    def _judge(self, head: SignedHead, witness: str, seq: int) -> None:
        where = f"{head.size} ({head.time[:19]})"
        if not head.genuine():
            kept = f", kept by {witness}," if witness else ""
            said = f"its signature{kept} is not that of the key {fingerprint(head.key)}: changed or forged"
            self._doubts.append(("9999", Fault("head", where, said)))
        elif self.newest is not None and head.ledger != self.newest.ledger:
            self._doubts.append((head.time, Fault("head", where, f"is of another ledger ({head.ledger})")))
        elif self._by_another(head, witness, where):
            pass
        elif head.size != seq or (self._tree.root().hex(), self._link) != (head.root, head.link):
            signed = f"by the head that {witness} keeps" if witness else "then"
            said = f"the records up to here are not those that were signed {signed}: rewritten, or an older copy"
            self._doubts.append((head.time, Fault("head", where, said)))
        elif witness:
            self._agreed[witness] = max(self._agreed.get(witness, 0), head.size)

    def _by_another(self, head: SignedHead, witness: str, where: str) -> bool:
        """Whether a witness keeps a head that no key of the laboratory, and none of the ledger's heads, signed."""
        if not witness or not self._wanted or head.key in self._signers:
            return False
        said = f"kept by {witness}: signed by the key {fingerprint(head.key)}, which signed no head of this ledger"
        self._doubts.append((head.time, Fault("head", where, said)))
        return True

    def end(self, seq: int) -> tuple[list[Fault], list[str]]:
        """Faults and notes when the last record, `seq`, is passed."""
        while self._next is not None:
            self._lost(self._next[0], "", "", seq)
            self._next = next(self._own_heads, None)
        for head, witness, place in self._outside[self._at :]:
            self._lost(head, witness, place, seq)
        faults = self._other_key
        unreadable = [one.witness for one in self._kept if one.head is None]
        faults += [Fault("head", "-", f"a line that {witness} keeps is not readable") for witness in unreadable]
        faults += self._unreadable
        faults += [Fault("witness", "-", sentence) for sentence in self._lost_witnesses]
        faults += self._unlisted()
        faults += self._whole(seq)
        # no one answered for a ledger by a record in it that no one signed
        said = max(self._accepted, default=("", "", "")) if self.newest is not None else ("", "", "")
        first: dict[str, Fault] = {}
        excused = 0
        for time, fault in self._doubts:
            if time <= said[0]:
                excused += 1
            elif fault.table == "chain":  # of records that are gone the last one says all
                first[fault.problem] = fault
            else:  # what follows from the first need not be said a thousand times
                first.setdefault(fault.problem, fault)
        faults += first.values()
        for time, author, reason in self._accepted:
            self._notes.append(f"accepted on {time[:19]} by {author}: {reason}")
        if excused:
            self._notes.append(f"older signed heads that contradict the records: {excused}")
        for place, size in self._elsewhere.items():
            self._notes.append(f"this is a copy: the ledger in {place} goes on to record {size}")
        faults += self._of_keys(said[0])
        return faults, [*self._signed(), *self._notes]

    def _lost(self, head: SignedHead, witness: str, place: str, seq: int) -> None:
        kept = f"kept by {witness}" if witness else "in it"
        if not head.genuine():
            said = f"the head {kept} is forged: its key did not sign it"
            self._doubts.append(("9999", Fault("head", str(head.size), said)))
            return
        if self._by_another(head, witness, f"{head.size} ({head.time[:19]})"):
            return
        lost = f"{seq + 1} to {head.size}" if head.size > seq + 1 else f"{head.size}"
        if witness and self._copy:
            self._elsewhere[place] = max(self._elsewhere.get(place, 0), head.size)
            return
        said = f"removed: the ledger ends before the signed head {kept}"
        said += "; a copy that is kept on purpose is verified with --copy" if witness else ""
        self._doubts.append((head.time, Fault("chain", lost, said)))

    def _unlisted(self) -> Iterator[Fault]:
        """Faults of witnesses that were named, and that a user took off the list in the folder of the keys."""
        for place in (place for place, named in self._named.items() if named and place not in self._listed):
            if self._own:
                said = (
                    f"{place} was named as a witness of this ledger and is not on the list any more; name it again "
                    f"with `inclinometry ledger witness {place}`, or take it off with --remove"
                )
                yield Fault("witness", "-", said)
            else:
                self._notes.append(f"its laboratory named {place} as a witness, which is not asked here")

    def _whole(self, seq: int) -> Iterator[Fault]:
        """Faults of a ledger whose end is not signed, or that is not the one that was here."""
        if self.newest is None:
            if self._given:
                by = f"not signed by the key {fingerprint(self._given[0])}"
                yield Fault("head", "-", f"{by}: its signatures were removed, or it never had any")
            if self._here:
                yield Fault("head", "-", "the ledger that was begun in this place is signed, and this one is not")
            elif self._remembered is not None and self._remembered.head is not None:
                known, witness = self._remembered.head, self._remembered.witness
                if max(self._agreed.values(), default=0) == seq:  # a copy of what was signed later or elsewhere
                    self._notes.append(f"all its records are those of a head that {witness} keeps, none is in it")
                    return
                said = (
                    f"record {known.size} of this ledger was signed, says the head that {witness} keeps, and it holds "
                    "no signed head: its signatures were removed"
                )
                yield Fault("head", "-", said)
            return
        if self._here and self._here != self.newest.ledger:
            yield Fault("head", "-", f"another ledger ({self._here}) was begun in this place than stands here now")
        if self.newest.size < seq:
            lost = f"{self.newest.size + 1} to {seq}" if seq > self.newest.size + 1 else f"{seq}"
            said = "not signed: recorded by something else than this program with the laboratory's key"
            yield Fault("chain", lost, said)

    def _of_keys(self, accepted: str) -> Iterator[Fault]:
        """Faults of the keys: one that followed another without a word, or that is not the laboratory's."""
        if self.newest is not None and not self._known():
            self._notes += _changed(self.newest.key, self._before_the_break() or (), self.newest.size + 1)
        for (before, _, _), (after, size, time) in zip(self._keys, self._keys[1:], strict=False):
            path = explained(before, after, self._changes)
            self._notes += _changed(before, path or (), size)
            if path is None and time <= accepted:
                said = f"break: from record {size} on the key is {fingerprint(after)}, accepted by a person"
                self._notes.append(said)
            elif path is None:
                said = f"signed by {fingerprint(after)}, for which the key before did not sign"
                yield Fault("head", f"{size} ({time[:19]})", said)
        if self.newest is None or not self._wanted or self._known() or self._before_the_break() is not None:
            return
        # one that this laboratory never signed is another's, which is looked at on a computer with a key of its own
        signed = any(one.head is not None and one.head.key in self._wanted for one in self._kept)
        self.strange = not (self._given or self._here or signed)
        if not self.strange:
            wanted = fingerprint(self._wanted[0])
            said = f"signed by the key {fingerprint(self.newest.key)}, not by the laboratory's, {wanted}"
            yield Fault("head", str(self.newest.size), said)

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

    def _signed(self) -> Iterator[str]:
        """Sentences: who signed what, which witnesses agree."""
        if self.newest is None:  # see `unsigned`
            return
        size, by = self.newest.size, fingerprint(self.newest.key)
        if self.strange:
            yield (
                f"not proven: it is signed up to record {size} by the key {by}, and the key here is "
                f"{fingerprint(self._wanted[0])}; name the public key of the laboratory whose ledger it is with "
                "`inclinometry ledger verify --key PUBLIC.pem`"
            )
        elif self._before_the_break() is not None:
            yield f"signed up to record {size} by the key {by} (the laboratory's until it was lost)"
        else:
            whose = "the laboratory's" if self._known() else "compare it with the laboratory's"
            if self._uncompared:
                whose = "the one in public.pem"
            yield f"signed up to record {size} by the key {by} ({whose})"
            if self._uncompared:
                yield self._uncompared
        first = min([self._first, *(head.size for head, _, _ in self._outside)])
        if first:
            yield f"its first {first} records were there before it was signed: what they said until then is not proven"
        for witness, size in self._agreed.items():
            yield f"witness {witness}: agrees up to record {size}"
        if not self._agreed:
            yield "no witness of its heads is known here: a cut tail or an older copy would go unnoticed"


def unsigned(*, faulty: bool) -> str:
    """What a ledger without signatures proves; to sign it is no remedy where something is wrong with it."""
    remedy = "" if faulty else "; `inclinometry ledger init` begins to sign"
    return f"not signed: whoever can write to it can rewrite it{remedy}"


def _changed(before: str, path: Sequence[Mapping[str, Any]], size: int) -> Iterator[str]:
    """Sentences: which keys followed one from the record `size` on, and whether each was signed for."""
    old = fingerprint(before)
    for one in path:
        new = fingerprint(str(one["after"]))
        if one["action"] == "rotated":
            yield f"from record {size} on the key is {new}; {old} signed for it"
        else:
            yield (
                f"break: from record {size} on the key is {new}, for which the one before did not sign; "
                f"said to be lost: {one['reason']}"
            )
        old = new

"""How certificates stand, as a signed statement of the ledger: for those who hold a certificate and not the ledger.

Each certificate comes with its entry in the chain and the proof (RFC 6962) that it is among the records of a signed
head, the event that voided or superseded it likewise. That there is no such event up to that head the laboratory says
by its signature. So it says which breaks of the ledger a user accepted: what was recorded before one may be lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from itertools import combinations
from pathlib import Path
from typing import Any, Final, NamedTuple

from sqlalchemy import select

from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError
from inclinometry.files.json_codec import load
from inclinometry.findings import Finding, Value
from inclinometry.laboratory.certificate.record import record_digest
from inclinometry.laboratory.ledger import chain, heads
from inclinometry.laboratory.ledger.chain import LedgerError, missing
from inclinometry.laboratory.ledger.engine import CHAIN
from inclinometry.laboratory.ledger.keys import Public, descends, fingerprint, genuine
from inclinometry.laboratory.ledger.ledger import Ledger, Record, accepted_breaks
from inclinometry.laboratory.ledger.merkle import Tree, includes, leaf_hash
from inclinometry.laboratory.valid_certificates import ended, ending, every

SCHEMA: Final = "inclinometry/certificate-status"
VERSION: Final = 2  # 1 carried no accepted breaks


def make_status(ledger: Ledger, numbers: Sequence[str] = ()) -> dict[str, Any]:
    """The statement, signed, of some certificates or of all; the ledger must not be behind what was seen of it."""
    ledger.not_behind()
    known, ends = {str(one.keys["number"]): one for one in every(ledger, "certificate")}, ended(ledger)
    accepted = every(ledger, "event", **heads.ACCEPTED)
    unknown = [number for number in numbers if number not in known]
    if unknown:
        raise LedgerError(missing("certificate", unknown[0], ledger.shown))
    with ledger.snapshot() as connection:
        head = heads.newest_head(connection)
        if head is None:
            raise LedgerError(Finding("ledger-unsigned", {"ledger": ledger.shown}))
        tree = Tree(heads.leaves(connection, 0, head.size))
        if tree.root().hex() != head.root or not head.signature_is_valid():
            raise LedgerError(Finding("ledger-modified", {"ledger": ledger.shown, "signed_record": head.size}))
        head = _of_now(ledger, head)

        def entry(record: Record) -> dict[str, Any]:
            row = connection.execute(select(CHAIN).where(CHAIN.c.seq == record.seq)).one()
            said = {name: getattr(row, name) for name in ("seq", "kind", "record", "created", "digest")}
            return {**said, "proof": [one.hex() for one in tree.inclusion(record.seq - 1)]}

        rows = []
        for number in numbers or known:
            record, event = known[number], ends.get(number)
            if max(record.seq, event.seq if event else 0) > head.size:
                continue  # recorded while this was read
            state, by, reason = ending(event)
            row: dict[str, Any] = {"number": number, "digest": record_digest(record.body["record"]), "state": state}
            body = {name: value for name, value in record.body.items() if name != "record"}
            row |= {"entry": entry(record), "body": body, "author": record.author, "serial": record.keys["serial"]}
            row["version"] = record.version
            if event is not None:
                row |= {"by": by, "reason": reason, "event": entry(event)}
            rows.append(row)
        breaks = {
            one["created"]: {**one, "entry": entry(record)}
            for record in accepted
            if record.seq <= head.size
            for one in accepted_breaks([record])
        }
    content = {
        "schema": SCHEMA,
        "version": VERSION,
        "head": head.statement(),
        "changes": ledger.keys.changes(),
        "certificates": rows,
        "accepted": list(breaks.values()),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    return ledger.keys.signing().statement(content)


def break_of(one: Mapping[str, Any]) -> Finding:
    """An accepted break of a ledger; older programs did not record what was there before."""
    about: dict[str, Value] = {"time": one["created"][:19], "author": one["author"], "reason": one["reason"]}
    about |= {"before": "?" if one["before"] is None else f"{one['before']}", "after": one["after"]}
    return Finding("ledger-break", about)


def _of_now(ledger: Ledger, head: heads.SignedHead) -> heads.SignedHead:
    """The head signed by the key of now, where another one signed it last and the change is known."""
    key = ledger.keys.signing()
    if head.key == key.public:
        return head
    path = heads.succession(head, key.public, ledger.keys, ledger.shown)
    lost = next((str(one["time"]) for one in path if one["action"] == "lost"), "9999")
    if head.time[:19] > lost[:19]:  # whoever found the key goes on signing with it
        about = {"ledger": ledger.shown, "time": head.time[:19], "key": fingerprint(head.key), "lost": lost[:19]}
        raise LedgerError(Finding("key-after-loss", about))
    end = chain.Head(head.size, head.link)
    return heads.signed_by(key, head.ledger, end, bytes.fromhex(head.root), head.time)


class Status(NamedTuple):
    """A statement that was read and is genuine.

    head : of the ledger at which it holds. changes : of the laboratory's keys.
    rows : number -> how the certificate stands.
    accepted : breaks of the ledger that a user accepted, oldest first; none in a statement of version 1.
    """

    head: heads.SignedHead
    changes: tuple[dict[str, Any], ...]
    rows: Mapping[str, Mapping[str, Any]]
    accepted: tuple[Mapping[str, Any], ...]


def is_status(content: Mapping[str, Any]) -> bool:
    """Whether a JSON file says that it is such a statement."""
    return content.get("schema") == SCHEMA


def read_status(path: str | Path, public: Public) -> Status:
    """The statement of a file, when the laboratory signed it and every proof in it holds.

    Raises FileError: not a statement, not genuine, a proof that does not hold.
    """
    content = load(path)
    if not is_status(content) or content.get("version") not in (1, VERSION):
        raise _not_status(path)
    head = heads.parse_signed(content.get("head"), path)
    changes = tuple(one for one in content.get("changes", ()) if isinstance(one, dict) and genuine(one))
    if not genuine(content) or not head.signature_is_valid():
        about = {"place": Path(path).name, "key": fingerprint(head.key)}
        raise FileError(Finding("key-forged", about), path=path)
    for key in (str(content["key"]), head.key):
        if not any(descends(key, one, changes) for one in public.keys):
            about = {"key": fingerprint(key), "expected": fingerprint(public.keys[0])}
            raise FileError(Finding("key-not-laboratory", about), path=path)
    try:
        rows = {str(row["number"]): row for row in content["certificates"]}
        entries = {n: [row["entry"], *([] if row["state"] == "issued" else [row["event"]])] for n, row in rows.items()}
        wrong = [n for n, found in entries.items() if not all(_included(one, head) for one in found)]
        names = ("author", "created", "reason", "before", "after", "entry")
        accepted = tuple({n: one[n] for n in names} for one in (content["accepted"] if content["version"] > 1 else ()))
        unfounded = [one for one in accepted if not _included(one["entry"], head)]
    except (KeyError, TypeError, ValueError):
        raise _not_status(path) from None
    for name in (*wrong, *(str(one["created"])[:19] for one in unfounded)):
        raise FileError(Finding("certificate-proof", {"name": f"{name:.60}"}), path=path)
    return Status(head, changes, rows, accepted)


def _not_status(path: str | Path) -> FileError:
    about = {"expected": "certificate status", "command": "inclinometry ledger status -o FILE"}
    return FileError(Finding("ledger-other-file", about), path=path)


def _included(entry: Mapping[str, Any], head: heads.SignedHead) -> bool:
    leaf = chain.leaf(*(entry[name] for name in ("seq", "kind", "record", "created", "digest")))
    proof = [bytes.fromhex(one) for one in entry["proof"]]
    return includes(leaf_hash(leaf), entry["seq"] - 1, head.size, proof, bytes.fromhex(head.root))


def two_histories(given: Mapping[str, Status]) -> Finding | None:
    """Which genuine statements, by their files, contradict each other; None when they are of one ledger as it grew.

    The key signed all of them: a ledger cut back, or begun again from a part of it, has issued one of them.
    """
    for (name, one), (other, two) in combinations(given.items(), 2):
        apart = one.head.ledger != two.head.ledger
        if one.head.size == two.head.size and (one.head.root, one.head.link) != (two.head.root, two.head.link):
            apart = True
        if apart or not all(_agree(one, two, number) for number in one.rows.keys() & two.rows.keys()):
            return Finding("certificate-two-histories", {"one": name, "other": other})
    return None


def _agree(one: Status, two: Status, number: str) -> bool:
    """Whether a certificate stands the same in two statements of a ledger, as far as both reach."""
    rows, reach = (one.rows[number], two.rows[number]), min(one.head.size, two.head.size)
    entries, digests = [{**row["entry"], "proof": None} for row in rows], [row["digest"] for row in rows]
    ends = [{**row["event"], "proof": None} if row["state"] != "issued" else None for row in rows]
    known = [(row["state"], end) if end and end["seq"] <= reach else None for row, end in zip(rows, ends, strict=True)]
    both = ends[0] == ends[1] or None in ends  # a certificate ends once
    return entries[0] == entries[1] and digests[0] == digests[1] and known[0] == known[1] and both


def holding(found: Iterable[Status], number: str) -> Status | None:
    """The statement by which a certificate stands: the newest that says void, or by which it ended, or that lists it.

    A break of the ledger can have taken a void back; whoever saw it relies on nothing.
    """

    def rank(one: Status) -> tuple[bool, bool, int, str]:
        state = one.rows[number]["state"]
        return state == "void", state != "issued", one.head.size, one.head.time

    return max((one for one in found if number in one.rows), key=rank, default=None)


def contradiction(
    row: Mapping[str, Any], digest: str, record: Mapping[str, Any] | None, files: Mapping[str, bytes]
) -> Finding | None:
    """What a statement says against files of that number; None when they are what the ledger holds.

    `files` are bytes by the names of the ledger: "pdf", "dcc", "json".
    """
    if row["digest"] != digest:
        return Finding("certificate-not-in-ledger", {"what": "JSON"})
    for name, data in files.items():
        kept = row["body"].get("documents", {}).get(name)
        if kept is not None and kept != digest_bytes(data):
            return Finding("certificate-not-in-ledger", {"what": name.upper()})
    if record is not None:
        entry = row["entry"]
        body = chain.compact({**row["body"], "record": record})
        keys = {"number": row["number"], "serial": row["serial"]}
        given = (entry["kind"], entry["record"], entry["created"], row["author"], row["version"], keys, body)
        if chain.record_digest(*given) != entry["digest"]:
            return Finding("certificate-not-in-ledger", {"what": "JSON"})
    return None

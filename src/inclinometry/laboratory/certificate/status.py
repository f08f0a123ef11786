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
from inclinometry.laboratory.certificate.record import record_digest
from inclinometry.laboratory.certified import ended, ending, every
from inclinometry.laboratory.ledger import chain, heads
from inclinometry.laboratory.ledger.chain import LedgerError, missing
from inclinometry.laboratory.ledger.engine import CHAIN
from inclinometry.laboratory.ledger.keys import Public, descends, fingerprint, genuine
from inclinometry.laboratory.ledger.ledger import Ledger, Record, accepted_breaks
from inclinometry.laboratory.ledger.merkle import Tree, includes, leaf_hash

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
            raise LedgerError(f"{ledger.shown} is not signed; `inclinometry ledger init` begins that")
        tree = Tree(heads.leaves(connection, 0, head.size))
        if tree.root().hex() != head.root or not head.genuine():
            raise LedgerError(f"{ledger.shown} is not what was signed; run `inclinometry ledger verify`")
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


def break_said(one: Mapping[str, Any]) -> str:
    """An accepted break in a sentence."""
    before = "an unknown number of records" if one["before"] is None else f"{one['before']} records"
    accepted = f"accepted on {one['created'][:19]} UTC by {one['author']}: {one['reason']}"
    return f"break of the ledger: {before} before, {one['after']} after; {accepted}"


def _of_now(ledger: Ledger, head: heads.SignedHead) -> heads.SignedHead:
    """The head signed by the key of now, where another one signed it last and the change is known."""
    key = ledger.keys.signing()
    if head.key == key.public:
        return head
    path = heads.succession(head, key.public, ledger.keys, ledger.shown)
    lost = next((str(one["time"]) for one in path if one["action"] == "lost"), "9999")
    if head.time[:19] > lost[:19]:  # whoever found the key goes on signing with it
        raise LedgerError(
            f"{ledger.shown} was signed on {head.time[:19]} UTC by the key {fingerprint(head.key)}, which was lost on "
            f"{lost[:19]} UTC; run `inclinometry ledger verify`"
        )
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
        raise FileError(
            "not a statement of certificates; the file that `inclinometry ledger status -o` writes", path=path
        )
    head = heads.parse_signed(content.get("head"), path)
    changes = tuple(one for one in content.get("changes", ()) if isinstance(one, dict) and genuine(one))
    if not genuine(content) or not head.genuine():
        raise FileError("its signature is not that of its key: changed or forged", path=path)
    for key in (str(content["key"]), head.key):
        if not any(descends(key, one, changes) for one in public.keys):
            known = fingerprint(public.keys[0])
            raise FileError(f"it is signed by the key {fingerprint(key)}, not by the laboratory's, {known}", path=path)
    try:
        rows = {str(row["number"]): row for row in content["certificates"]}
        entries = {n: [row["entry"], *([] if row["state"] == "issued" else [row["event"]])] for n, row in rows.items()}
        wrong = [n for n, found in entries.items() if not all(_included(one, head) for one in found)]
        names = ("author", "created", "reason", "before", "after", "entry")
        accepted = tuple({n: one[n] for n in names} for one in (content["accepted"] if content["version"] > 1 else ()))
        unfounded = [one for one in accepted if not _included(one["entry"], head)]
    except (KeyError, TypeError, ValueError):
        raise FileError(
            "a statement with other contents than this program knows; update inclinometry", path=path
        ) from None
    if wrong:
        raise FileError(f"its proof for certificate {wrong[0]:.60} does not hold", path=path)
    if unfounded:
        raise FileError(f"its proof for the break of {unfounded[0]['created']:.19} does not hold", path=path)
    return Status(head, changes, rows, accepted)


def _included(entry: Mapping[str, Any], head: heads.SignedHead) -> bool:
    leaf = chain.leaf(*(entry[name] for name in ("seq", "kind", "record", "created", "digest")))
    proof = [bytes.fromhex(one) for one in entry["proof"]]
    return includes(leaf_hash(leaf), entry["seq"] - 1, head.size, proof, bytes.fromhex(head.root))


def two_histories(given: Mapping[str, Status]) -> str:
    """What genuine statements, by their files, say against each other; "" when they can be of one ledger as it grew.

    The key signed all of them: a ledger cut back, or begun again from a part of it, has issued one of them.
    """
    ask = "the laboratory has two histories under one key: ask it which one holds, and why there is another"
    for (name, one), (other, two) in combinations(given.items(), 2):
        if one.head.ledger != two.head.ledger:
            return f"{name} is of the ledger {one.head.ledger}, {other} of the ledger {two.head.ledger}; {ask}"
        if one.head.size == two.head.size and (one.head.root, one.head.link) != (two.head.root, two.head.link):
            return f"{name} and {other} speak of other records up to {one.head.size}; {ask}"
        for number in one.rows.keys() & two.rows.keys():
            if not _agree(one, two, number):
                return f"{name} and {other} contradict each other about certificate {number}; {ask}"
    return ""


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
) -> str:
    """What a statement says against files of that number; "" when they are what the ledger holds.

    `files` are bytes by the names of the ledger: "pdf", "dcc", "json".
    """
    if row["digest"] != digest:
        return f"the ledger holds another record under this number, {row['digest']}"
    for name, data in files.items():
        kept = row["body"].get("documents", {}).get(name)
        if kept is not None and kept != digest_bytes(data):
            return f"its {name} file is not the one that the ledger holds"
    if record is not None:
        entry = row["entry"]
        body = chain.compact({**row["body"], "record": record})
        keys = {"number": row["number"], "serial": row["serial"]}
        given = (entry["kind"], entry["record"], entry["created"], row["author"], row["version"], keys, body)
        if chain.record_digest(*given) != entry["digest"]:
            return "its record is not the one that the ledger holds"
    return ""

"""Witnesses: places outside the ledger where its signed heads are kept, so that a cut tail or an old copy is found.

The first is a file beside the keys of this computer, one for each ledger. Others are named in witnesses.txt: a folder,
another ledger, "print". They are served in the background, the newest head first: a share that does not answer holds up
no capture, and the next head tells it all that the earlier ones would have.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

from sqlalchemy import select, tuple_
from sqlalchemy.engine import Connection

from inclinometry.errors import FileError, InclinometryError, InputError, system_reason
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.chain import LedgerError, compact
from inclinometry.laboratory.ledger.engine import CHAIN, TABLES, engine, readable, record_of, shown, translated
from inclinometry.laboratory.ledger.heads import SignedHead, parse_signed
from inclinometry.opening import LARGEST_SETTINGS, opened, too_large, whole

PRINT: Final = "print"
PATIENCE: Final = 5.0
"""Seconds that the end of a program waits for the other witnesses."""
_LONGEST: Final = 10_000_000


def place_of(where: str | Path) -> str:
    """A ledger's place as a witness notes it: an address without its password, or the whole path as it is named.

    Links are not followed: whoever points one at another file would choose the place himself.
    """
    text = str(where)
    return shown(text) if "://" in text else str(Path(text).absolute())


class Witnessed(NamedTuple):
    """A head that a witness keeps: by whom, of which place, None where it is not readable as one."""

    witness: str
    place: str
    head: SignedHead | None


class Witnesses:
    """The witnesses of one ledger; `folder` is that of the keys, `alone` tells the file of this computer only.

    `tell` is called with a witness, a head, the place of the ledger and the folder (`ledger.send`).
    """

    def __init__(
        self, folder: Path, where: str, tell: Callable[[str, SignedHead, str, Path], None], *, alone: bool = False
    ) -> None:
        self._folder, self._where, self._tell = folder, where, tell
        self._others: list[str] | None = [] if alone else None
        self._waiting: SignedHead | None = None
        self._turn = threading.Condition()
        self._thread: threading.Thread | None = None
        self._ended = False

    def publish(self, head: SignedHead | None) -> None:
        """Tell every witness of a head, if any; the file of this computer at once, the others in the background."""
        if head is None:
            return
        try:
            (self._folder / "heads").mkdir(parents=True, exist_ok=True, mode=0o700)
            keep(self._folder / "heads", head, place_of(self._where))
        except (LedgerError, OSError) as error:
            _warn(_unwritten(error, head, str(self._folder / "heads")))
        if self._others is None:
            self._others = others(self._folder)
        if not self._others:
            return
        with self._turn:
            self._waiting = head
            self._turn.notify()
            if self._thread is None:
                self._thread = threading.Thread(target=self._serve, name="witnesses", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Wait, but not long, until the newest head is where it should be."""
        if self._thread is None:
            return
        with self._turn:
            self._ended = True
            self._turn.notify()
        self._thread.join(PATIENCE)
        self._thread, self._ended = None, False

    def _serve(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._waiting is not None or self._ended)
                head, self._waiting = self._waiting, None
            if head is None:
                return
            for one in self._others or []:
                try:
                    self._tell(one, head, self._where, self._folder)
                except (InclinometryError, OSError) as error:
                    _warn(_unwritten(error, head, shown(one)))


def others(folder: Path) -> list[str]:
    """The witnesses beside the file of this computer, as witnesses.txt names them."""
    path = folder / "witnesses.txt"
    try:
        lines = whole(path, LARGEST_SETTINGS).decode().splitlines() if path.exists() else []
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(_unreadable(error), path=path) from None
    return [line.strip() for line in lines if line.strip()]


def name_others(folder: Path, places: list[str]) -> None:
    """Write which witnesses there are beside the file of this computer."""
    from inclinometry.files.writing import write_bytes

    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    write_bytes("".join(f"{place}\n" for place in places).encode(), folder / "witnesses.txt")


def keep(folder: Path, head: SignedHead, place: str) -> None:
    """Append a head to the file of its ledger in a folder that is there: none is made where a disk is not mounted."""
    line = compact({**head.statement(), "where": place}) + "\n"
    try:
        with (folder / f"{head.ledger}.jsonl").open("ab", buffering=0) as stream:  # one write: lines never mix
            stream.write(line.encode())
    except OSError as error:
        raise LedgerError(_unwritten(error, head, str(folder))) from None


def _unwritten(error: Exception, head: SignedHead, place: str) -> Finding:
    """That a witness has not got a head; what else is wrong with it where that is known."""
    if isinstance(error, InclinometryError):
        return error.finding
    reason = system_reason(error)
    return Finding("key-witness-unwritten", {"record": head.size, "place": place, "reason": reason})


def _unreadable(error: Exception) -> Finding:
    """Why a witness cannot be read."""
    if isinstance(error, InclinometryError):
        return error.finding
    return Finding("file-unreadable", {"reason": system_reason(error)})


def silent_witness(place: str, error: Exception) -> Finding:
    """That a witness cannot be asked."""
    return Finding("key-witness-silent", {"place": place, "finding": _unreadable(error)})


def _warn(found: Finding) -> None:
    """The record is kept, and verification says what a witness lacks: no one is held up."""
    sys.stderr.write(f"warning: {found} [{found.code}]\n")


def is_ledger(witness: str) -> bool:
    """Whether a witness is another ledger, not a folder."""
    return "://" in witness or Path(witness).is_file()


def itself(witness: str, place: str) -> bool:
    """Whether a witness is the very ledger: none is a witness of its own."""
    same = place_of(witness) == place
    return same or ("://" not in witness + place and Path(witness).resolve() == Path(place).resolve())


def _lines(text: str, witness: str) -> Iterator[Witnessed]:
    for line in text.splitlines():
        try:
            content = json.loads(line)
            place = str(content.get("where", "")) if isinstance(content, dict) else ""
            yield Witnessed(witness, place, parse_signed(content, witness))
        except (ValueError, FileError, RecursionError):
            yield Witnessed(witness, "", None)


def begun_at(folder: Path, where: str) -> str:
    """The ledger that was last begun or written at a place, by the file of this computer; "" when none was."""
    place = place_of(where)
    # what lies behind a link counts only where none is known by the name that was given
    return _begun_at(folder, place) or ("" if "://" in place else _begun_at(folder, str(Path(place).resolve())))


def _begun_at(folder: Path, place: str) -> str:
    found: tuple[str, str] = ("", "")
    for path in (folder / "heads").glob("*.jsonl"):
        with opened(path) as stream:
            first = stream.readline(_LONGEST)
            stream.seek(max(0, path.stat().st_size - 4096))
            tail = stream.read().splitlines()
        for line in (first, *tail[-1:]):
            for one in _lines(line.decode(errors="replace"), str(path)):
                if one.head is not None and one.place == place:
                    found = max(found, (one.head.time, one.head.ledger))
    return found[1]


def ahead(folder: Path, newest: SignedHead, accepted: str) -> Witnessed | None:
    """The head that the file of this computer keeps farthest beyond the newest of a ledger; None when it has none.

    `accepted` is the time until which a user answered for what is missing, "" for none.
    """
    try:
        path = folder / "heads" / f"{newest.ledger}.jsonl"
        if not path.exists():
            return None
        with opened(path) as stream:
            stream.seek(max(0, stream.seek(0, 2) - 4096))
            last = stream.read().splitlines()[-1:]
            if any(one.head == newest for line in last for one in _lines(line.decode(errors="replace"), "")):
                return None  # as always: the rest need not be read
        kept = [*_kept(path, str(folder / "heads"))]
    except (OSError, FileError):
        return None
    return farthest(kept, newest, accepted)


def ahead_elsewhere(folder: Path, where: str, newest: SignedHead, accepted: str) -> Witnessed | None:
    """The same of the other witnesses, as far as they answer within a moment: no one waits for the rest."""
    moment = 1.5  # s
    kept: list[Witnessed] = []

    def ask(one: str) -> None:
        with suppress(InclinometryError, OSError):
            kept.extend(_asked(one, newest.ledger))

    asked = [threading.Thread(target=ask, args=(one,), daemon=True) for one in _asking(folder, where)]
    for thread in asked:
        thread.start()
    end = time.monotonic() + moment
    for thread in asked:
        thread.join(max(0.0, end - time.monotonic()))
    return farthest([*kept], newest, accepted)


def farthest(kept: list[Witnessed], newest: SignedHead, accepted: str) -> Witnessed | None:
    """The genuine head farthest beyond the newest of a ledger, of those made after `accepted`; None for none."""
    beyond = [(one.head.size, one) for one in kept if one.head is not None and one.head.size > newest.size]
    found = [
        (size, one) for size, one in beyond if one.head and one.head.time > accepted and one.head.signature_is_valid()
    ]
    return max(found, key=lambda pair: pair[0], default=(0, None))[1]


def remembered(connection: Connection, folders: Sequence[Path]) -> Witnessed | None:
    """The head by which a ledger that holds none of its own is known to have been signed; None when nothing knows it.

    It is the same ledger where a link of its chain is one that was signed, or where the record that a head was signed
    with has its time, to the microsecond: both stay where a user removed the heads and recomputed what he changed.
    """
    for folder in folders:
        for path in sorted(folder.glob("*.jsonl")):
            lines = _kept(path, str(folder))
            while block := [*islice(lines, 500)]:
                heads = [one.head for one in block if one.head is not None and 0 < one.head.size < 2**31]
                # compared by the database: a text that is no longer UTF-8 is a fault to be named elsewhere
                link = tuple_(CHAIN.c.seq, CHAIN.c.link).in_([(head.size, head.link) for head in heads])
                created = tuple_(CHAIN.c.seq, CHAIN.c.created).in_([(head.size, head.time) for head in heads])
                same = {*connection.execute(select(CHAIN.c.seq).where(link | created)).scalars()}
                for one in block:
                    if one.head is not None and one.head.size in same and one.head.signature_is_valid():
                        return one
    return None


def folders_of(folder: Path, where: str) -> list[Path]:
    """The folders of this computer where heads are kept: that beside the keys, and those that are witnesses."""
    return [folder / "heads", *(Path(one) for one in _asking(folder, where) if "://" not in one and Path(one).is_dir())]


def witnessed(folder: Path, ledger: str, where: str) -> tuple[list[Witnessed], list[Finding], list[Finding]]:
    """What the witnesses say of a ledger, which is at `where`; `folder` is that of the keys.

    The heads they keep; those that do not answer; those that keep no head of it, or are gone.
    """
    heads: list[Witnessed] = []
    silent: list[Finding] = []
    lost: list[Finding] = []
    for one in [str(folder / "heads"), *_asking(folder, where)]:
        try:
            kept = _asked(one, ledger)
            if not kept:
                lost.append(Finding("key-witness-lost", {"place": shown(one)}))
            heads.extend(kept)
        except (OSError, InputError) as error:
            silent.append(silent_witness(shown(one), error))
    return heads, silent, lost


def _asking(folder: Path, where: str) -> list[str]:
    """The witnesses beside the file of this computer that can be asked of the ledger at `where`."""
    return [one for one in others(folder) if one != PRINT and not itself(one, place_of(where))]


def _asked(witness: str, ledger: str) -> list[Witnessed]:
    """The heads of a ledger that one witness keeps."""
    if is_ledger(witness):
        return [*_recorded(witness, ledger)]
    path = Path(witness) / f"{ledger}.jsonl"
    return [*_kept(path, witness)] if path.exists() else []


def _kept(path: Path, witness: str) -> Iterator[Witnessed]:
    """The heads of a file, one a line."""
    with opened(path) as stream:
        size, largest = os.fstat(stream.fileno()).st_size, 1_000_000_000  # more than a million heads
        if size > largest:
            raise FileError(too_large("bytes", size, largest), path=path)
        while line := stream.readline(_LONGEST):
            yield from _lines(line.decode(errors="replace"), witness)


def _recorded(witness: str, ledger: str) -> Iterator[Witnessed]:
    """Those that another ledger has recorded."""
    event, place = TABLES["event"], shown(witness)
    query = select(event, CHAIN.c.digest).join(CHAIN, CHAIN.c.seq == event.c.seq).order_by(event.c.seq)
    query = query.where((event.c.subject_kind == "ledger") & (event.c.subject == ledger) & (event.c.action == "head"))
    asked = engine(witness, read_only=True)
    try:
        with translated(place), asked.connect() as connection:
            readable(connection, place)
            for row in connection.execute(query, execution_options={"yield_per": 500}):
                yield from _lines(compact(record_of("event", row).body.get("details", {})), place)
    finally:
        asked.dispose()

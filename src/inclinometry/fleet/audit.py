"""The fleet compared with itself: what stands behind a result, what was changed on the disk, what may be deleted."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from inclinometry.errors import FileError, InclinometryError, refused
from inclinometry.findings import Finding
from inclinometry.fleet.checksums import FOLDER, digest_of, recorded
from inclinometry.fleet.commit import Table
from inclinometry.fleet.plan import table
from inclinometry.fleet.raw import CATALOGUE, Raw, catalogue
from inclinometry.fleet.store import STAGED, Store
from inclinometry.fleet.task import VERSION, check_pages, footer_of
from inclinometry.laboratory.valid_certificates import Certificates, Certified

Progress = Callable[[float], None] | None


class Why(NamedTuple):
    """What stands behind a result.

    name : in the store. current : whether it is in the table of its product now. footer : what the file says of itself.
    raw : the counts it was made of, None where the catalogue does not know them.
    certificate : as it stands in the ledger now, None where it is not there.
    problems : none where everything holds.
    """

    name: str
    current: bool
    footer: dict[str, str]
    raw: Raw | None
    certificate: Certified | None
    findings: tuple[Finding, ...]


def why(store: Store, name: str, certificates: Certificates | None) -> Why:
    """From a result to its input, calibration, certificate and code; the folder of a run means its one result.

    Without `certificates` the certificate is known by its number alone.
    """
    name = name_in(store, name)
    if not name.endswith(".parquet"):
        here = [
            path for path in table(store, name.partition("/")[0]).paths() if path.startswith(f"{name.rstrip('/')}/")
        ]
        if len(here) != 1:
            raise refused("fleet-several", {"name": name, "count": len(here)})
        name = here[0]
    product = name.partition("/")[0]
    known = recorded(store, product).get(name)
    if known and digest_of(store, name) not in known:
        raise refused("fleet-result-changed", {"name": name, "reason": "SHA-256"})
    footer = footer_of(store, name)
    if "key" not in footer:
        raise refused("fleet-no-result", {"name": name})
    product = footer["product"].partition("/")[0]
    raws = [raw for raw in catalogue(store) if raw.digest == footer["input"]]
    problems: list[Finding] = []
    raw = raws[0] if raws else None
    if raw is None:
        problems.append(Finding("fleet-input-unknown", {"digest": footer["input"]}))
    found = None
    if certificates is not None and raw is not None:
        found = next((one for one in certificates.of(raw.tool) if one.number == footer["certificate"]), None)
        if found is None:
            problems.append(Finding("fleet-certificate-elsewhere", {"certificate": footer["certificate"]}))
        else:
            digest, _ = certificates.content(found.calibration)
            found = found._replace(digest=digest)
            if digest != footer["calibration"]:
                problems.append(Finding("fleet-calibration-other", {"certificate": found.number}))
            if found.state != "issued":
                why_not = {"state": found.state, "by": found.by, "reason": found.reason}
                problems.append(Finding("fleet-certificate-state", {"certificate": found.number, **why_not}))
    return Why(name, name in table(store, product).paths(), footer, raw, found, tuple(problems))


def name_in(store: Store, path: str) -> str:
    """Name in the store of a file given by its path, its address or that name."""
    if store.folder is None:
        return path.removeprefix(store.address.rstrip("/") + "/")
    if not Path(path).is_absolute() and store.size(path) is not None:
        return path
    try:
        return Path(path).resolve().relative_to(store.folder.resolve()).as_posix()
    except ValueError:
        raise refused("fleet-elsewhere", {"path": str(path), "address": store.address}) from None


def verify(store: Store, progress: Progress = None) -> Iterator[tuple[str, Finding]]:
    """Read everything again; name and finding of each file that is not what it was.

    Every file is compared with the digest recorded when it was committed. A result without one is compared with its
    name, which says what it is made of, and its pages with their checksums.
    """
    runs: list[Raw] = []
    tables: list[Table] = []
    results: list[tuple[str, Table]] = []
    try:
        runs = catalogue(store)
    except FileError as error:
        yield str(error.path), _finding(error)
    for product in VERSION:
        held = table(store, product)
        try:
            results += [(name, held) for name in held.paths()]
            tables.append(held)
        except FileError as error:
            yield str(error.path), _finding(error)
    total = max(len(runs) + len(results), 1)
    digests = {raw.digest for raw in runs}
    for number, raw in enumerate(runs, 1):
        try:
            if digest_of(store, raw.name) != raw.digest:
                yield raw.name, Finding("fleet-raw-changed", {"reason": "SHA-256"})
        except InclinometryError as error:
            yield raw.name, _finding(error)
        if progress is not None:
            progress(number / total)
    for number, (name, held) in enumerate(results, len(runs) + 1):
        try:
            yield from ((name, found) for found in _result(store, name, digests, held.recorded.get(name)))
        except InclinometryError as error:
            yield name, _finding(error)
        if progress is not None:
            progress(number / total)


def _finding(error: InclinometryError) -> Finding:
    return error.finding


def unrecorded(store: Store) -> list[Finding]:
    """A finding for each table of which files have no checksum: those of fleets before there were any."""
    found = []
    for product in (CATALOGUE, *VERSION):
        have = recorded(store, product)
        held = set() if product == CATALOGUE else set(table(store, product).paths())
        log = product if product == CATALOGUE else f"{product}/_delta_log"
        names = {name for name in store.names(log) if not name.rpartition("/")[2].startswith((".", "_"))} | held
        names = {name for name in names if f"/{FOLDER}/" not in name}
        if bare := len(names - have.keys()):
            of = {"bare": bare, "total": len(names)}
            found.append(Finding("fleet-no-checksums", {"table": product, **of}))
    return found


def _result(store: Store, name: str, digests: Collection[str], known: Collection[str] | None) -> Iterator[Finding]:
    if store.size(name) is None:
        yield Finding("fleet-result-gone", {"name": name})
        return
    if known and digest_of(store, name) not in known:
        yield Finding("fleet-result-changed", {"name": name, "reason": "SHA-256"})
        return
    footer = footer_of(store, name)
    if not name.endswith(f"part-{footer.get('key')}.parquet"):
        yield Finding("fleet-result-changed", {"name": name, "reason": "key"})
    elif digests and footer["input"] not in digests:
        yield Finding("fleet-input-unknown", {"digest": footer["input"]})
    if not known:
        check_pages(store, name)


def superfluous(store: Store, days: float) -> list[str]:
    """Files that no one needs: left half-written an hour ago or longer, or results that have not been current for days.

    Counts are never among them.
    """
    hour, day = 3600.0, 86400.0
    found = [name for name in store.names("") if STAGED.match(name.rpartition("/")[2]) and store.age(name) > hour]
    for product in VERSION:
        kept = table(store, product).paths()
        for name in store.names(product):
            left = name.endswith(".parquet") and name not in kept and "/_delta_log/" not in name
            if left and store.age(name) > days * day:
                found.append(name)
    return [name.lstrip("./") for name in found if not name.startswith(CATALOGUE)]


def digest(store: Store, product: str, *, contents: bool = True) -> str:
    """Identity of what is current: SHA-256 of the names, which say what each file is made of, and sizes of all files.

    With `contents` of their bytes instead of the sizes, each of which is read.
    """
    found = hashlib.sha256()
    held = table(store, product)
    for name, size in sorted(held.paths().items()):
        found.update(name.encode() + b"\0")
        if not contents:
            found.update(f"{size}\0".encode())
            continue
        own = hashlib.sha256()
        with store.reading(name) as stream:
            while piece := stream.read(1 << 22):
                found.update(piece)
                own.update(piece)
        known = held.recorded.get(name)
        if known and f"sha256:{own.hexdigest()}" not in known:
            raise refused("fleet-result-changed", {"name": name, "reason": "SHA-256"})
    return f"sha256:{found.hexdigest()}"


def shown(found: Why) -> dict[str, Any]:
    """As a mapping for a person or a program."""
    raw, certified = found.raw, found.certificate
    run = {name: getattr(raw, name, None) for name in ("tool", "run", "date", "source", "source_digest")}
    state: dict[str, str | None] = dict.fromkeys(("state", "since", "superseded_by"))
    if certified is not None:
        state = {"state": certified.state, "since": str(certified.since), "superseded_by": certified.by or None}
    record = None if certified is None else certified.calibration
    return {
        "file": found.name,
        "current": found.current,
        **{name: found.footer[name] for name in ("product", "code", "key")},
        "input": {"digest": found.footer["input"], "file": found.footer.get("raw"), **run},
        "calibration": {"digest": found.footer["calibration"], "record": record},
        "certificate": {"number": found.footer["certificate"], **state},
        "findings": [one.plain() for one in found.findings],
    }

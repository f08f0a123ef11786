"""The fleet held against itself: what stands behind a result, what was touched on the disk, what may be thrown away."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from inclinometry.errors import InclinometryError, InputError
from inclinometry.fleet.plan import table
from inclinometry.fleet.raw import CATALOGUE, Raw, catalogue
from inclinometry.fleet.store import STAGED, Store
from inclinometry.fleet.task import VERSION, footer_of
from inclinometry.laboratory.certified import Certificates, Certified

Progress = Callable[[float], None] | None


class Why(NamedTuple):
    """What stands behind a result.

    name : in the store. current : whether it is in the table of its product now. footer : what the file says of itself.
    raw : the counts it was made of, None where the catalogue does not know them.
    certificate : as it stands in the ledger now, None where it is not there.
    problems : sentences; none where everything holds.
    """

    name: str
    current: bool
    footer: dict[str, str]
    raw: Raw | None
    certificate: Certified | None
    problems: tuple[str, ...]


def why(store: Store, name: str, certificates: Certificates | None) -> Why:
    """From a result to its input, calibration, certificate and code.

    Parameters
    ----------
    name : str
        In the store, or the path of a file in its folder; the folder of a run stands for the one result in it.
    certificates : Certificates, optional
        Of the ledger; without it the certificate is known by its number alone.

    Raises
    ------
    InputError
        No such file, or no result of a fleet.
    """
    name = name_in(store, name)
    if not name.endswith(".parquet"):
        here = [
            path for path in table(store, name.partition("/")[0]).paths() if path.startswith(f"{name.rstrip('/')}/")
        ]
        if len(here) != 1:
            raise InputError(f"{name} has {len(here)} results that are current; name one file")
        name = here[0]
    footer = footer_of(store, name)
    if "key" not in footer:
        raise InputError(f"{name} is no result of a fleet: its footer names no calibration")
    product = footer["product"].partition("/")[0]
    raws = [raw for raw in catalogue(store) if raw.digest == footer["input"]]
    problems: list[str] = []
    raw = raws[0] if raws else None
    if raw is None:
        problems.append(f"the catalogue does not know its input, {footer['input']}")
    found = None
    if certificates is not None and raw is not None:
        found = next((one for one in certificates.of(raw.tool) if one.number == footer["certificate"]), None)
        if found is None:
            problems.append(f"certificate {footer['certificate']} is not in this ledger")
        else:
            digest, _ = certificates.content(found.calibration)
            found = found._replace(digest=digest)
            if digest != footer["calibration"]:
                problems.append("its calibration is not the one the ledger keeps under this certificate")
            if found.state != "issued":
                by = f" by {found.by}" if found.by else ""
                problems.append(f"certificate {found.number} is {found.state}{by} ({found.reason})")
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
        raise InputError(f"{path} is not in the fleet {store.address}; --fleet names another") from None


def verify(store: Store, progress: Progress = None) -> Iterator[str]:
    """Read everything again; a sentence for each file that is not what it was.

    Counts are held against their digest in the catalogue; results against the name that says what they are made of, and
    every page of them against its checksum.
    """
    runs = catalogue(store)
    results = [name for product in VERSION for name in table(store, product).paths()]
    total = max(len(runs) + len(results), 1)
    digests = {raw.digest for raw in runs}
    for number, raw in enumerate(runs, 1):
        try:
            found = hashlib.sha256()
            with store.reading(raw.name) as stream:
                while piece := stream.read(1 << 22):
                    found.update(piece)
            if f"sha256:{found.hexdigest()}" != raw.digest:
                yield f"{raw.name}: its bytes are not those that were added; put it back from a copy"
        except InclinometryError as error:
            yield f"{raw.name}: {error}"
        if progress is not None:
            progress(number / total)
    for number, name in enumerate(results, len(runs) + 1):
        try:
            yield from (f"{name}: {problem}" for problem in _result(store, name, digests))
        except InclinometryError as error:
            yield f"{name}: {error}"
        if progress is not None:
            progress(number / total)


def _result(store: Store, name: str, digests: Iterable[str]) -> Iterator[str]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    footer = footer_of(store, name)
    if not name.endswith(f"part-{footer.get('key')}.parquet"):
        yield "it is another file than its name says; remove it, the next run makes it anew"
    elif footer["input"] not in digests:
        yield f"the catalogue does not know its input, {footer['input']}"
    try:
        with store.reading(name) as stream:
            source = pq.ParquetFile(stream, buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)
            for _ in source.iter_batches(batch_size=1 << 18, use_threads=False):
                pass
    except (pa.ArrowException, OSError) as error:
        yield f"damaged ({str(error).splitlines()[0][:200]}); remove it, the next run makes it anew"


def superfluous(store: Store, days: float) -> list[str]:
    """Files that nobody needs: left half-written an hour ago or longer, or results that have not been current for days.

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
    for name, size in sorted(table(store, product).paths().items()):
        found.update(name.encode() + b"\0")
        if not contents:
            found.update(f"{size}\0".encode())
            continue
        with store.reading(name) as stream:
            while piece := stream.read(1 << 22):
                found.update(piece)
    return f"sha256:{found.hexdigest()}"


def shown(found: Why) -> dict[str, Any]:
    """As a mapping for a person or a program."""
    raw, certified = found.raw, found.certificate
    return {
        "file": found.name,
        "current": found.current,
        "product": found.footer["product"],
        "input": {
            "digest": found.footer["input"],
            "file": found.footer.get("raw"),
            "tool": raw.tool if raw else None,
            "run": raw.run if raw else None,
            "date": raw.date if raw else None,
            "source": raw.source if raw else None,
            "source_digest": raw.source_digest if raw else None,
        },
        "calibration": {
            "digest": found.footer["calibration"],
            "record": certified.calibration if certified else None,
        },
        "certificate": {
            "number": found.footer["certificate"],
            "state": certified.state if certified else None,
            "since": str(certified.since) if certified else None,
            "superseded_by": certified.by or None if certified else None,
        },
        "code": found.footer["code"],
        "key": found.footer["key"],
        "problems": list(found.problems),
    }

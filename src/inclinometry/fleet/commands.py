"""Commands of a fleet: add, plan, run, status, verify, why, clean."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter

from inclinometry.cli import output
from inclinometry.cli.options import Flag, Json
from inclinometry.errors import FileError, InclinometryError, InputError, out_of_range, refused
from inclinometry.findings import Finding
from inclinometry.laboratory.commands import LedgerAddress

if TYPE_CHECKING:
    from inclinometry.fleet.plan import Plan

Address: TypeAlias = Annotated[
    str, Parameter(name="--fleet", help="Folder of the fleet, or s3://bucket/folder of an object store.")
]
Product: TypeAlias = Annotated[
    Literal["windows", "angles"], Parameter(help="Means and scatter of windows, or the angles of every sample.")
]
Window: TypeAlias = Annotated[
    float | None,
    Parameter(
        name="--window-s",
        help="Length of a window. Default: that of the last run, at first 1. Another length recomputes all windows.",
    ),
]


def add(
    files: list[Path],
    /,
    *,
    fleet: Address = "fleet",
    tool: str | None = None,
    run: str | None = None,
    date: str | None = None,
    pattern: str | None = None,
    json: Json = False,
) -> int:
    """Take runs into the fleet: their counts, once and for ever.

    Parameters
    ----------
    files
        Runs, in any format of `dynamic`; or a folder of them.
    tool
        Serial number of the tool in the ledger.
    run
        Name of the run. Default: the file name.
    date
        Day of the run, YYYY-MM-DD.
    pattern
        Place of tool, run and date in the path, e.g. "{tool}/{run}_{date}".
    """
    from inclinometry.fleet import raw
    from inclinometry.fleet.store import Store

    store = Store(fleet)
    try:
        known = {one.name: one for one in raw.catalogue(store)}
    except FileError:
        raise
    except InputError:
        if store.folder is not None and not store.folder.parent.is_dir():
            lacking = Finding("file-folder-absent", {"folder": str(store.folder.parent)})
            raise FileError(lacking, path=store.folder) from None
        known = {}
    paths = [
        one for path in files for one in (sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path])
    ]
    if run is not None and len(paths) > 1 and pattern is None:
        raise refused("input-needs", {"name": "--run", "needed": ("--pattern",)})
    added: list[raw.Raw] = []
    there, problems, gaps = 0, [], []
    try:
        with output.working("adding") as progress:
            for number, path in enumerate(paths, 1):
                try:
                    found = raw.add(store, path, raw.about(path, pattern, tool, run, date), known)
                except InclinometryError as error:
                    problems.append((str(path), error.finding))
                    continue
                there += not found
                added += found
                known |= {one.name: one for one in found}
                gaps += [
                    Finding("fleet-gaps", {"path": str(path), "count": one.gaps}, severity="note")
                    for one in found
                    if one.gaps
                ]
                if progress is not None:
                    progress(number / len(paths))
                if len(added) >= 1000:
                    raw.record(store, added)
                    added = []
    finally:
        raw.record(store, added)
    told, where = _files(problems)
    output.findings([*told, *gaps], where)
    new = len(paths) - there - len(problems)
    if json:
        output.print_json({"added": new, "there_already": there, "refused": _plain(problems)})
    else:
        already = f", {there} there already" if there else ""
        output.print_line(f"{output.counted(new, 'run')} added to {fleet}{already}")
        if problems:
            output.print_line(f"{output.counted(len(problems), 'file')} refused")
    return 1 if problems else 0


def plan(
    *, fleet: Address = "fleet", ledger: LedgerAddress = None, product: Product = "windows", window_s: Window = None,
    json: Json = False,
) -> int:  # fmt: skip
    """Say what would be done: made, replaced, refused and why. Nothing is written."""
    todo = _plan(fleet, ledger, product, window_s)
    left_out = [(raw.name, reason) for raw, reason in todo.refused]
    tools = Counter(task.raw.split("/")[1].removeprefix("tool=") for task in todo.todo)
    behind = sum(map(len, todo.behind.values()))
    if json:
        content = {"product": product, "to_make": len(todo.todo), "by_tool": dict(tools), "to_replace": behind}
        output.print_json(content | {"current": todo.current, "refused": _plain(left_out)})
        return 1 if todo.refused else 0
    if tools:
        output.table(
            f"{product}: {output.counted(len(todo.todo), 'file')} to make",
            ["tool", "files"],
            [[name, str(count)] for name, count in sorted(tools.items())],
        )
    output.print_line(
        f"{len(todo.todo)} to make, {behind} to take out, {todo.current} as wanted, {len(todo.refused)} refused"
    )
    output.findings(*_files(left_out))
    return 1 if todo.refused else 0


def run(
    *,
    fleet: Address = "fleet",
    ledger: LedgerAddress = None,
    product: Product = "windows",
    window_s: Window = None,
    workers: int | None = None,
    threads: int | None = None,
    scheduler: str | None = None,
    json: Json = False,
) -> int:
    """Make what is wanted and not there, replace what is behind; a second run does nothing.

    Interrupted or killed, it goes on where it was: what is done is done.

    Parameters
    ----------
    workers
        Number of processes. Default: one per core.
    threads
        Use threads: less memory, for trusted files.
    scheduler
        Use a Dask scheduler, tcp://host:8786; its workers must see the fleet at the same path.
    """
    from inclinometry.fleet import workers as ways
    from inclinometry.fleet.store import Store
    from inclinometry.fleet.work import carry_out

    if sum(way is not None for way in (workers, threads, scheduler)) > 1:
        raise refused("input-one-of", {"names": ("--workers", "--threads", "--scheduler")})
    for name, number in (("--workers", workers), ("--threads", threads)):
        if number is not None and not 1 <= number <= 1024:
            raise out_of_range(name, number, "1 .. 1024")
    todo = _plan(fleet, ledger, product, window_s)
    client = None
    if scheduler is not None:
        client = ways.connect(scheduler)
        output.print_line(f"dashboard {client.dashboard_link}")
        receipts = ways.by_dask(todo.todo, client)
    elif threads is not None:
        receipts = ways.by_threads(todo.todo, threads)
    else:
        receipts = ways.by_processes(todo.todo, workers or os.cpu_count() or 1)
    try:
        with output.working(product) as progress:
            done = carry_out(Store(fleet), todo, receipts, progress=progress)
    except ways.SchedulerLostError as error:
        output.findings([error.finding])
        return 1
    finally:
        receipts.close()
        if client is not None:
            client.close()
    problems = [*done.problems, *((raw.name, reason) for raw, reason in todo.refused)]
    if json:
        content: dict[str, Any] = {
            "made": done.made,
            "adopted": done.adopted,
            "replaced": done.removed,
            "samples": done.samples,
        }
        output.print_json(
            content | {"work_s": round(done.seconds, 3), "version": done.version, "problems": _plain(problems)}
        )
        return 1 if problems else 0
    adopted = f", {done.adopted} adopted" if done.adopted else ""
    output.print_line(f"{product}: {done.made} made{adopted}, {done.removed} taken out, {todo.current} were as wanted")
    if done.samples:
        rate = done.samples / max(done.seconds, 1e-9) / 1e6
        output.print_line(f"{done.samples} samples in {done.seconds:.1f} s of work, {rate:.2g} million a second")
    output.findings(*_files(problems))
    return 1 if problems else 0


def status(*, fleet: Address = "fleet", ledger: LedgerAddress = None, digest: Flag = False, json: Json = False) -> int:
    """Say what is there, what is behind, and the digest of each table. Exit status 1 where something is to be done.

    Parameters
    ----------
    digest
        Compare the bytes of all results, not only names and sizes.
    """
    from inclinometry.fleet import audit, raw
    from inclinometry.fleet.plan import table
    from inclinometry.fleet.store import Store
    from inclinometry.fleet.task import VERSION

    store = Store(fleet)
    runs = raw.catalogue(store)
    content = {
        "tools": len({one.tool for one in runs}),
        "files": len(runs),
        "samples": sum(one.rows for one in runs),
        "bytes": sum(one.size for one in runs),
    }
    products = {}
    for product in VERSION:
        version = table(store, product).version
        if version is None:
            continue
        todo = _plan(fleet, ledger, product, None)
        products[product] = {
            "version": version,
            "window_s": todo.window_ns / 1e9 or None,
            "current": todo.current,
            "to_make": len(todo.todo),
            "to_take_out": sum(map(len, todo.behind.values())),
            "refused": len(todo.refused),
            "digest": audit.digest(store, product, contents=digest),
        }
    if json:
        output.print_json(content | {"products": products})
    else:
        size = content["bytes"] / 1e6
        output.print_line(
            f"{output.counted(content['tools'], 'tool')}, {output.counted(content['files'], 'file')} of counts, "
            f"{content['samples']} samples, {size:.1f} MB"
        )
        for product, row in products.items():
            output.print_line(
                f"{product}: {row['current']} as wanted, {row['to_make']} to make, {row['to_take_out']} to take out, "
                f"{row['refused']} refused; version {row['version']}"
            )
            output.print_line(f"{product}: table digest {row['digest']}")
    return 1 if any(row["refused"] or row["to_make"] for row in products.values()) else 0


def verify(*, fleet: Address = "fleet", json: Json = False) -> int:
    """Read everything again. Exit status 0 sound, 1 a file is not what it was."""
    from inclinometry.fleet import audit
    from inclinometry.fleet.store import Store

    with output.working("verifying") as progress:
        problems = list(audit.verify(Store(fleet), progress))
    bare = [] if problems else audit.unrecorded(Store(fleet))
    if json:
        output.print_json({"ok": not problems, "problems": _plain(problems), "findings": bare})
        return 1 if problems else 0
    told, files = _files(problems)
    output.findings([*told, *bare], files)
    sound = "every file with a checksum is what it was" if bare else "every file is what it was"
    output.print_line(f"{output.counted(len(problems), 'file')} damaged" if problems else sound)
    return 1 if problems else 0


def why(file: str, /, *, fleet: Address = "fleet", ledger: LedgerAddress = None, json: Json = False) -> int:
    """Say what stands behind a result: input, calibration, certificate, code. Exit status 1 where it does not hold.

    Parameters
    ----------
    file
        A result: its path or name in the fleet, or the folder of a run for its current result.
    """
    from inclinometry.fleet import audit
    from inclinometry.fleet.store import Store
    from inclinometry.laboratory.ledger.ledger import Ledger, default_path
    from inclinometry.laboratory.valid_certificates import Certificates

    with Ledger(default_path() if ledger is None else ledger, read_only=True) as opened:
        found = audit.why(Store(fleet), file, Certificates(opened))
    if json:
        output.print_json(audit.shown(found))
        return 1 if found.findings else 0
    raw, certified = found.raw, found.certificate
    output.print_line(f"{found.name}: {'current' if found.current else 'not current any more'}")
    output.print_line(f"  product      {found.footer['product']}, key {found.footer['key']}, {found.footer['code']}")
    if raw is not None:
        output.print_line(f"  input        tool {raw.tool}, run {raw.run}, {raw.date}: {raw.name}")
        output.print_line(f"               {raw.digest}")
        output.print_line(f"               read from {raw.source} ({raw.source_digest})")
    output.print_line(f"  calibration  {certified.calibration if certified else ''}")
    output.print_line(f"               {found.footer['calibration']}")
    state = f", {certified.state}, holds from {certified.since}" if certified else ""
    output.print_line(f"  certificate  {found.footer['certificate']}{state}")
    output.findings(found.findings)
    return 1 if found.findings else 0


def clean(*, fleet: Address = "fleet", days: float = 7.0, dry_run: Flag = False) -> None:
    """Remove what was left half-written and results that have not been current for days. Counts are never removed.

    Parameters
    ----------
    days
        Keep results replaced within this time, and the earlier states of the table.
    dry_run
        Show what would be removed; remove nothing.
    """
    from inclinometry.fleet import audit
    from inclinometry.fleet.store import Store

    if not days >= 0.0:
        raise out_of_range("--days", days, ">= 0")
    store = Store(fleet)
    found = audit.superfluous(store, days)
    for name in found:
        if dry_run:
            output.print_line(name)
        else:
            store.remove(name)
    output.print_line(f"{output.counted(len(found), 'file')} {'would go' if dry_run else 'removed'}")


def _plan(fleet: str, ledger: str | None, product: str, window_s: float | None) -> Plan:
    from inclinometry.fleet.plan import plan as made
    from inclinometry.fleet.store import Store
    from inclinometry.laboratory.ledger.ledger import Ledger, default_path
    from inclinometry.laboratory.valid_certificates import Certificates

    if window_s is not None and not 1e-6 <= window_s <= 86400.0:
        raise out_of_range("--window-s", window_s, "0.000001 .. 86400")
    if window_s is not None and product != "windows":
        raise refused("input-not-with", {"name": "--window-s", "other": product})
    window_ns = None if window_s is None else round(window_s * 1e9)
    with Ledger(default_path() if ledger is None else ledger, read_only=True) as opened:
        # workers elsewhere have another folder that they are in
        address = fleet if "://" in fleet else str(Path(fleet).resolve())
        return made(Store(address), Certificates(opened), product, window_ns)


def _files(problems: Iterable[tuple[str, Finding]]) -> tuple[list[Finding], list[str]]:
    """Findings, and the files that they are about."""
    pairs = list(problems)
    return [found for _, found in pairs], [name for name, _ in pairs]


def _plain(problems: Iterable[tuple[str, Finding]]) -> list[dict[str, Any]]:
    return [{"file": name, **found.plain()} for name, found in problems]

"""What is to be done: what is wanted less what is there, by names alone."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

from inclinometry.errors import InputError, not_among, out_of_range, refused
from inclinometry.files.writing import program
from inclinometry.findings import Finding
from inclinometry.fleet.commit import Table
from inclinometry.fleet.raw import Raw, catalogue
from inclinometry.fleet.store import Store
from inclinometry.fleet.task import KINDS, VERSION, Task, key, schema
from inclinometry.laboratory.valid_certificates import Certificates, Certified


class Plan(NamedTuple):
    """A product as it is and as it is to be.

    window_ns : length of its windows, 0 of angles. todo : what is to be made.
    behind : folder of a run -> its results that are current and not wanted any more.
    current : how many files are as they are wanted.
    refused : files of counts that nothing can be made of, and why.
    """

    product: str
    window_ns: int
    todo: tuple[Task, ...]
    behind: dict[str, tuple[str, ...]]
    current: int
    refused: tuple[tuple[Raw, Finding], ...]


def table(store: Store, product: str) -> Table:
    """The table of a product."""
    return Table(store, product, schema(product))


def plan(store: Store, certificates: Certificates, product: str = "windows", window_ns: int | None = None) -> Plan:
    """Compare what the catalogue and the ledger ask for with what the table of a product holds.

    A table has windows of one length (that of the last run by default, else 1 s): another length makes all again.
    """
    if product not in VERSION:
        raise not_among("product", product, VERSION)
    if window_ns is not None and product != "windows":
        raise refused("input-not-with", {"name": "window_ns", "other": product})
    if window_ns is not None and window_ns < 1:
        raise out_of_range("window_ns", window_ns, ">= 1")
    runs = catalogue(store)
    current = table(store, product)
    held, known, there = current.paths(), current.recorded, set(store.names(product))
    last = int(current.said().get("window_ns", 10**9)) if window_ns is None else window_ns
    width = last if product == "windows" else 0
    twice = _twice(runs)
    wanted: dict[str, Task] = {}
    left_out: list[tuple[Raw, Finding]] = []
    for raw in runs:
        try:
            if raw.name in twice:
                raise InputError(twice[raw.name])
            certified = certificates.at(raw.tool, date.fromisoformat(raw.date))
            wanted_task = _task(store, raw, certified, certificates, product, width)
        except InputError as error:
            left_out.append((raw, error.finding))
            continue
        digests = tuple(sorted(known.get(wanted_task.target, ())))
        wanted[wanted_task.target] = wanted_task._replace(known=digests)
    # a result that was removed is made again
    todo = tuple(task for name, task in wanted.items() if name not in held or name not in there)
    behind: dict[str, tuple[str, ...]] = {}
    for name in sorted(held.keys() - wanted.keys()):
        folder = name.rpartition("/")[0]
        behind[folder] = (*behind.get(folder, ()), name)
    return Plan(product, width, todo, behind, len(wanted) - len(todo), tuple(left_out))


def _task(store: Store, raw: Raw, certified: Certified, certificates: Certificates, product: str, width: int) -> Task:
    content, units = certificates.content(certified.calibration)[1], certificates.units(certified.calibration)
    for kind in KINDS:
        if kind not in units:
            raise refused("fleet-certificate-lacks", {"certificate": certified.number, "kind": kind})
        if raw.units[kind] != units[kind]:
            (unit, count), (other, number) = raw.units[kind], units[kind]
            raise refused(
                "fleet-certificate-unlike",
                {
                    "certificate": certified.number,
                    "kind": kind,
                    "channels": count,
                    "unit": unit,
                    "certified": number,
                    "certified_unit": other,
                },
            )
    name = key(raw.digest, certified.digest, product, width)
    footer = {
        "product": f"{product}/{VERSION[product]}",
        "input": raw.digest,
        "calibration": certified.digest,
        "certificate": certified.number,
        "key": name,
        "code": program(),
        "raw": raw.name,
        "window_ns": str(width),
    }
    target = f"{product}/{raw.name.partition('/')[2].rpartition('/')[0]}/part-{name}.parquet"
    return Task(store.address, raw.name, target, product, width, footer, content, raw.size)


def _twice(runs: Sequence[Raw]) -> dict[str, Finding]:
    """Files whose tool was somewhere else at the same time: name -> finding."""
    found: dict[str, Finding] = {}
    by_tool: dict[str, list[Raw]] = {}
    for raw in runs:
        if raw.absolute:
            by_tool.setdefault(raw.tool, []).append(raw)
    for tool, own in by_tool.items():
        own.sort(key=lambda raw: raw.first_ns)
        latest = own[0]
        for raw in own[1:]:
            if raw.first_ns < latest.last_ns and raw.run != latest.run:
                for one, other in ((raw, latest), (latest, raw)):
                    found[one.name] = Finding("fleet-twice", {"tool": tool, "run": one.run, "other": other.run})
            latest = max(latest, raw, key=lambda one: one.last_ns)
    return found

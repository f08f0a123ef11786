"""The ledger: what was recorded, by whom, whether it is still what was recorded."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from fastapi import Request
from nicegui import ui

from inclinometry.errors import InclinometryError
from inclinometry.files.json_codec import restored
from inclinometry.laboratory.ledger.chain import parse_head
from inclinometry.laboratory.ledger.engine import KINDS
from inclinometry.laboratory.ledger.ledger import LedgerError, Record
from inclinometry.laboratory.ledger.verify import Verdict, verify
from inclinometry.laboratory.registry import listed
from inclinometry.laboratory.web.api.ledger import HIDDEN
from inclinometry.laboratory.web.frame import Visitor, aside, frame
from inclinometry.laboratory.web.pages.lists import table, to, visible
from inclinometry.laboratory.web.words import catalogue

PAGE: Final = 50
SHOWN_KINDS: Final = tuple(name for name in KINDS if name not in HIDDEN)


@ui.page("/ledger")
def ledger_page(request: Request, kind: str = "event", before: int = 0, key: str = "") -> None:
    """The audit trail of one kind of record, newest first."""
    with frame(request, "ledger.title") as visitor:
        _check(visitor)
        chosen = kind if kind in SHOWN_KINDS else "event"
        found = search(visitor, chosen, key.strip()[:200], max(before, 0))
        with ui.card().classes("panel"):
            _search(visitor, chosen, key)
            for one in found:
                _row(visitor, one)
            if not found:
                ui.label(visitor.say("ledger.none")).classes("dim")
            if len(found) == PAGE:
                ui.link(visitor.say("ledger.older"), to("/ledger", kind=chosen, before=found[-1].seq, key=key))


def search(visitor: Visitor, kind: str, text: str, before: int) -> list[Record]:
    """Records of a kind of which any key is the text, or whose id or place in the chain it is; all without a text.

    Where there is none, those in whose title the text stands as the visitor reads it.
    """
    ledger = visitor.bench.ledger
    if not text:
        return listed(ledger, kind, limit=PAGE, before=before)
    found: dict[int, Record] = {}
    for name, type_ in KINDS[kind].keys.items():
        if type_ is str:
            found |= {one.seq: one for one in listed(ledger, kind, limit=PAGE, before=before, **{name: text})}
    if re.fullmatch("[0-9a-f]{32}", text) and not before:
        with suppress(LedgerError):
            record = ledger.get(kind, text)
            found[record.seq] = record
    if text.isascii() and text.isdigit() and len(text) < 15 and not before:
        found |= {one.seq: one for one in listed(ledger, kind, limit=1, before=int(text) + 1) if one.seq == int(text)}
    if not found:  # a word as the page shows it, in whatever language; so far back as is read in a moment
        farthest = 2_000
        shown = listed(ledger, kind, limit=farthest, before=before)
        found = {one.seq: one for one in shown if text.casefold() in _keys(visitor, one).casefold()}
    return [found[seq] for seq in sorted(found, reverse=True)][:PAGE]


def _check(visitor: Visitor) -> None:
    faults = 50
    say, ledger = visitor.say, visitor.bench.ledger
    with ui.card().classes("panel"):
        head = ledger.head()
        ui.label(say("ledger.records", number=head.seq)).classes("subtitle number")
        ui.label(say("ledger.head", head=str(head))).classes("dim number pre")
        noted = ui.input(say("ledger.noted")).props("maxlength=100").classes("wide")
        box = ui.column()

        async def check() -> None:
            button.disable()
            box.clear()
            with box:
                done = [0.0]
                bar = ui.linear_progress(0.0, show_value=False).props("instant-feedback").classes("wide")
                timer = ui.timer(0.2, lambda: bar.set_value(done[-1]))
            found: Verdict | str
            try:
                wanted = parse_head(noted.value.strip()) if noted.value.strip() else None
                found = await aside(lambda: verify(ledger, head=wanted, progress=done.append))
            except InclinometryError as error:
                found = visitor.problem(error)
            timer.cancel()
            box.clear()
            button.enable()
            with box:
                if isinstance(found, str):
                    ui.label(found).classes("bad")
                else:
                    if found.ok:
                        sound = ui.label(visitor.say("ledger.sound", number=found.records))
                        sound.classes("good" if found.proven else "warn")
                    for sentence in found.silent:
                        ui.label(visitor.sentence(sentence)).classes("warn number")
                    if found.silent:
                        ui.label(visitor.say("ledger.unproven")).classes("warn").props('role="alert"')
                    for fault in found.faults[:faults]:
                        ui.label(visitor.sentence(fault)).classes("bad number")
                    for note in found.findings:
                        ui.label(visitor.sentence(note)).classes("dim number")
                    if len(found.faults) > faults:
                        ui.label(visitor.say("home.more_due", number=len(found.faults) - faults)).classes("bad")

        with ui.row().classes("items-center"):
            button = ui.button(say("ledger.verify"), on_click=check).props("outline no-caps")
            if visitor.user.may("administer"):
                ui.link(say("ledger.export"), "/api/v1/ledger/export").props("download")
                if "://" not in ledger.where:
                    ui.link(say("ledger.backup"), "/api/v1/ledger/backup").props("download")
        ui.label(say("ledger.import_hint")).classes("dim")


def fields(visitor: Visitor, body: Mapping[str, Any], above: str = "") -> list[tuple[str, str, str]]:
    """Field, value and unit of each entry of a record, in the visitor's language; empty ones are left out.

    Matrices, lists of more than a dozen and the whole files a record carries are counted: they are in the raw record.
    """
    most, deepest = 12, 3
    # ends of keys
    units = {"_degC": "°C", "_deg": "°", "_rad": "rad", "_mps2": "m/s²", "_nT": "nT", "_m": "m", "_s": "s"}
    whole_files = ("tool_json", "record")
    # what people called something stays as they wrote it
    given = ("name", "rig", "site", "customer", "description", "manufacturer", "order", "condition", "reason", "note")
    found = []
    for key, value in body.items():
        if value in (None, "", [], {}):
            continue
        ends = ((key.removesuffix(end), unit) for end, unit in units.items() if key.endswith(end))
        name, unit = next(ends, (key, ""))
        field = f"{above}{visitor.sentence(name.replace('_', ' '))}"
        several = value if isinstance(value, list) else [value]
        if isinstance(value, Mapping) and above.count(" · ") + 1 < deepest and key not in whole_files:
            found += fields(visitor, value, f"{field} · ")
            continue
        if isinstance(value, list) and all(isinstance(one, Mapping) and "code" in one for one in value):
            found.append((field, " ".join(visitor.sentence(restored(one)) for one in value), unit))
            continue
        if isinstance(value, Mapping) or len(several) > most or any(isinstance(x, list | Mapping) for x in several):
            text = visitor.say("ledger.entries", number=len(value))
        else:
            text = "; ".join(str(one) if key in given else _value(visitor, one) for one in several)
        found.append((field, text, unit))
    return found


def _value(visitor: Visitor, value: object) -> str:
    """One value; a sentence of the program, a name or a digest as it stands."""
    if isinstance(value, bool):
        return visitor.say("ledger.yes" if value else "ledger.no")
    if isinstance(value, float):
        return f"{value:.7g}"
    return visitor.sentence(str(value))


def _search(visitor: Visitor, kind: str, key: str) -> None:
    say = visitor.say
    with ui.row().classes("form"):
        kinds = {name: say(f"kind.{name}") for name in SHOWN_KINDS}
        chosen = ui.select(kinds, value=kind, label=say("ledger.kind"))
        text = ui.input(say("ledger.key"), value=key).props("maxlength=200")

        def go() -> None:
            ui.navigate.to(to("/ledger", kind=str(chosen.value), key=str(text.value or "").strip()))

        text.on("keydown.enter", go)
        ui.button(say("ledger.search"), on_click=go).props("outline no-caps")


def _keys(visitor: Visitor, one: Record) -> str:
    """What a record is found by, as it is shown: words of the program in the visitor's language, names as they are."""
    ours = {"subject_kind", "subject", "action"} if one.kind == "event" else {"purpose"}
    known = catalogue(visitor.language)

    def word(name: str, value: str) -> str:
        if name == "purpose":
            return known.get(f"purpose.{value}", value)
        used = re.fullmatch(r"((?:recovery )?code) (\w+)(?: of \w+)?", value) if name == "action" else None
        if used is not None:  # of a second factor
            return f"{visitor.sentence(used[1])} {used[2]}"
        return visitor.sentence(value) if name in ours else value

    return ", ".join(word(name, str(value)) for name, value in one.keys.items())


def _row(visitor: Visitor, one: Record) -> None:
    """One record; its body is read when it is opened."""
    longest_shown = 20_000
    keys = _keys(visitor, one)
    # the first characters tell one session from another; the whole is inside
    keys = re.sub(r"\b([0-9a-f]{8})[0-9a-f]{24}\b", r"\1…", keys)
    title = f"{one.seq} · {one.created[:19].replace('T', ' ')} · {one.author} · {keys}"
    with ui.expansion(visible(title)).classes("w-full number").props("dense") as box:
        loaded: list[bool] = []

        def show() -> None:
            if not loaded:
                loaded.append(True)
                record = visitor.bench.ledger.get(one.kind, one.id)
                text = json.dumps(dict(record.body), ensure_ascii=False, indent=1)
                say = visitor.say
                with box:
                    table(
                        (say("ledger.field"), say("results.value"), say("results.unit")), fields(visitor, record.body)
                    )
                    with ui.expansion(say("ledger.raw")).classes("w-full").props("dense"):
                        ui.label(visible(text[:longest_shown])).classes("pre")
                        if len(text) > longest_shown:
                            ui.label(say("ledger.cut", number=longest_shown)).classes("dim")
                    ui.label(f"{one.id} · {record.digest}").classes("dim pre")

        box.on_value_change(visitor.action("read", lambda _: show()))

"""Certificates: the list, one certificate with its documents, declaring it void."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, date, datetime
from typing import Any, Final

from fastapi import HTTPException, Request
from nicegui import ui

from inclinometry.errors import InclinometryError, InputError
from inclinometry.laboratory.certificate.laboratory_toml import (
    LONGEST,
    Laboratory,
    Order,
    Standard,
    begun,
    laboratory_from,
)
from inclinometry.laboratory.certificate.record import words
from inclinometry.laboratory.certificate.requirements import missing
from inclinometry.laboratory.certificates import (
    CertificateStatus,
    certificates,
    digest_of,
    issue,
    status,
    supersede,
    void,
)
from inclinometry.laboratory.ledger.engine import MEDIA
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError, Record
from inclinometry.laboratory.ledger.users import LOCAL, User
from inclinometry.laboratory.registry import (
    extract,
    find_laboratory,
    find_rig,
    find_site,
    find_tool,
    listed,
    standards,
)
from inclinometry.laboratory.web.frame import Visitor, aside, frame
from inclinometry.laboratory.web.pages.lists import Cell, day, table, to, visible
from inclinometry.laboratory.web.pages.verify import verdict_of
from inclinometry.laboratory.web.words import LANGUAGES

# Issuing a certificate: what no measurement says, then the three documents.

OFFERED: Final = 50
LABORATORY: Final = ("name", "address", "country", "place", "accreditation", "traceability", "procedure")
ORDER: Final = ("customer", "order", "condition", "received", "environment")


@ui.page("/certificates/new")
def new_page(request: Request, calibration: str = "", verification: str = "", supersedes: str = "") -> None:
    """A form; first the calibration when none is named."""
    with frame(request, "certificates.new", needs="issue") as visitor, ui.card().classes("panel"):
        ledger = visitor.bench.ledger
        try:
            record = ledger.get("calibration", calibration) if calibration else None
        except LedgerError as error:
            ui.label(visitor.problem(error)).classes("warn")
            record = None
        if record is None:
            found = listed(visitor.bench.ledger, "calibration", limit=OFFERED)
            ui.label(visitor.say("certificates.choose" if found else "verify.no_calibration")).classes("subtitle")
            for one in found:
                ui.link(f"{one.keys['serial']} · {day(one.created)}", to("/certificates/new", calibration=one.id))
            return
        if supersedes:
            ui.label(visitor.say("certificates.replaces", number=supersedes)).classes("warn")
        IssueForm(visitor, record, verification, supersedes)


class IssueForm:
    """Verification, laboratory, order, language.

    Who is logged in answers for the certificate; where nobody logs in, whom the laboratory's settings name.
    """

    def __init__(self, visitor: Visitor, calibration: Record, verification: str, supersedes: str) -> None:
        self._visitor, self._calibration, self._supersedes = visitor, calibration, supersedes
        ledger, say = visitor.bench.ledger, visitor.say
        serial = calibration.keys["serial"]
        ui.label(f"{serial} · {day(calibration.created)} UTC").classes("subtitle number")
        choices = self._verifications(ledger)
        chosen = verification if verification and verification in choices else next((key for key in choices if key), "")
        self.verification = ui.select(choices, value=chosen, label=say("verify.one")).classes("wide")
        self.nonconforming = ui.switch(say("certificates.nonconforming"))
        session = ledger.get("session", calibration.keys["session"])
        ui.label(say("certificates.laboratory")).classes("subtitle")
        # what the site of the session says of the laboratory, what the rig says of traceability
        site, rig = find_site(ledger, str(session.body.get("site", ""))), find_rig(ledger, session.body["rig"])
        found: dict[str, str] = {}
        self._settings = settings = find_laboratory(ledger)
        if site is not None and site.laboratory.get("name"):
            try:
                known = laboratory_from(dict(site.laboratory))
                found = {name: getattr(known, name) for name in LABORATORY}
            except InputError:
                found = {name: str(site.laboratory.get(name, "")) for name in LABORATORY}
        elif settings is not None:
            found = {name: getattr(settings, name) for name in LABORATORY}
        if rig is not None:
            found["traceability"] = found.get("traceability") or rig.traceability
            found["place"] = found.get("place") or rig.place
        self.laboratory = _fields({name: say(f"field.{name}") for name in LABORATORY}, found)
        today = datetime.now(UTC).date()
        self._known = {one.cited: one for one in standards(ledger) if not one.retired}
        usable = [cited for cited, one in self._known.items() if not one.overdue(today)]
        self.standards = ui.select(usable, value=usable, multiple=True, label=say("standards.used")).classes("wide")
        self.standards.props("use-chips").set_visibility(bool(usable))
        late = [cited for cited in self._known if cited not in usable]
        if late:
            ui.label(say("standards.late", names=", ".join(late))).classes("warn")
        ui.label(say("certificates.order")).classes("subtitle")
        stated: dict[str, Any] = {name: session.body.get(name, "") for name in ORDER}
        tool = find_tool(ledger, session.keys["serial"])
        stated["customer"] = stated["customer"] or (tool.customer if tool else "")
        stated["received"] = str(stated["received"])[:10]
        stated["environment"] = str((stated["environment"] or {}).get("text", ""))
        self.order = _fields({name: say(f"order.{name}") for name in ORDER}, stated)
        with ui.row().classes("form"):
            self.language = ui.select(LANGUAGES, value=visitor.language, label=say("frame.language"))
            if supersedes:
                self.reason = ui.input(say("bench.reason")).props("maxlength=2000")
        name, role = self._authoriser(visitor.user)
        self.signatory = None
        if visitor.user == LOCAL:  # nobody has logged in: who answers for it is written here
            self.signatory = _fields(
                {"name": say("field.authoriser"), "role": say("field.authoriser_role")}, {"name": name, "role": role}
            )
        else:
            ui.label(say("certificates.authoriser", name=name))
        self._title = ui.column().classes("w-full").props('aria-live="polite" data-testid="title"')
        for field in (
            *self.laboratory.values(),
            *self.order.values(),
            self.standards,
            *(self.signatory or {}).values(),
        ):
            field.on_value_change(self._look)
        self._look()
        self._problem = ui.label("").classes("bad").props('role="alert" data-testid="form-problem"')
        self.button = ui.button(say("certificates.issue"), on_click=self._issue).props("unelevated no-caps")

    def _authoriser(self, user: User) -> tuple[str, str]:
        """Name and role of who answers for the certificate."""
        if user != LOCAL:
            return user.full_name or user.name, user.role
        return (self._settings.authoriser, self._settings.authoriser_role) if self._settings else ("", "")

    def _look(self) -> None:
        """What the document will be titled, and what it lacks to be a certificate."""
        visitor = self._visitor
        try:
            laboratory = self._laboratory(visitor.user)
        except InputError:
            laboratory = None
        text = {name: str(field.value or "").strip() for name, field in self.order.items()}
        day = datetime.now(UTC).date()
        order = Order(
            customer=text["customer"],
            condition=text["condition"],
            environment=text["environment"],
            serial=self._calibration.keys["serial"],
            performed_from=day,
        )
        lacking = missing(laboratory, order, self._standards())
        self._title.clear()
        with self._title:
            key = "certificates.will_be_report" if lacking else "certificates.will_be_certificate"
            ui.label(visitor.say(key)).classes("warn" if lacking else "good")
            said = words(visitor.language)
            for one in lacking:
                # where a file states it is of no use here: the fields are above
                late = ", ".join(each.name for each in self._standards() if each.overdue(day))
                about = re.split(" ?[(（]", said(f"missing_{one}", names=late))[0]
                ui.label(f"· {about}").classes("dim")

    def _standards(self) -> list[Standard]:
        chosen = [self._known[cited] for cited in self.standards.value]
        return [Standard(one.name, one.certificate, one.due) for one in chosen]

    def _laboratory(self, user: User) -> Laboratory:
        """The laboratory as the form says it, with who answers for the certificate."""
        said = {name: str(field.value or "").strip() for name, field in self.laboratory.items()}
        name, role = self._authoriser(user)
        if self.signatory is not None:
            name, role = (str(self.signatory[key].value or "").strip() for key in ("name", "role"))
        named = Laboratory(**said, authoriser=name, authoriser_role=role)
        if self._settings is not None and self._settings.name == named.name:
            named = replace(named, email=self._settings.email, phone=self._settings.phone)
        return named

    def _verifications(self, ledger: Ledger) -> dict[str, str]:
        say = self._visitor.say
        found = {}
        for one in listed(ledger, "verification", calibration=self._calibration.id, limit=OFFERED):
            verdict, limits = extract(ledger, one, "verdict", verdict_of)
            found[one.id] = f"{day(one.created)} · {say(f'verdict.{verdict}')} · {self._visitor.sentence(limits)}"
        return {**found, "": say("certificates.no_verification")}

    async def _issue(self) -> None:
        self.button.disable()
        try:
            user = self._visitor.require("issue")
            about: dict[str, Any] = {name: str(field.value or "").strip() for name, field in self.order.items()}
            about["received"] = _day(about["received"])
            if about["environment"]:
                about["environment"] = {"text": about["environment"]}
            named = self._laboratory(user)
            wish = {
                "laboratory": named,
                "standards": self._standards(),
                "language": str(self.language.value),
                "nonconforming": bool(self.nonconforming.value),
                "about": about,
            }
            made = await aside(lambda: self._issued(user, wish))
        except InclinometryError as error:
            self._problem.set_text(self._visitor.problem(error))
            self.button.enable()
            return
        ui.navigate.to(to("/certificates", made.keys["number"]))

    def _issued(self, user: User, wish: dict[str, Any]) -> Record:
        ledger, calibration = self._visitor.bench.ledger, self._calibration.id
        verification = str(self.verification.value or "") or None
        if self._supersedes:
            reason = str(self.reason.value or "")
            return supersede(
                ledger, self._supersedes, calibration, verification, reason=reason, author=user.name, **wish
            )
        return issue(ledger, calibration, verification, author=user.name, **wish)


def _fields(labels: dict[str, str], values: dict[str, str]) -> dict[str, ui.input]:
    with ui.row().classes("form"):
        return {
            name: ui.input(label, value=values.get(name, "")).props(f"maxlength={LONGEST}")
            for name, label in labels.items()
        }


def _day(text: str) -> str:
    """A date as it is recorded; InputError when it is none."""
    if not text:
        return ""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        raise InputError(f"received is {text[:40]!r}; write the date as 2026-01-31") from None
    return begun(day, "received").isoformat()


STYLES: Final = {"issued": "good", "void": "bad", "superseded": "warn"}


@ui.page("/certificates")
def certificates_page(request: Request, serial: str = "", before: int = 0) -> None:
    """All certificates, newest first, of one tool when asked."""
    shown = 25
    with frame(request, "certificates.title") as visitor, ui.card().classes("panel"):
        say = visitor.say
        with ui.row().classes("form"):
            text = ui.input(say("tools.serial"), value=serial).props("maxlength=200")
            ui.button(
                say("ledger.search"), on_click=lambda: ui.navigate.to(to("/certificates", serial=text.value.strip()))
            ).props("outline no-caps")
            if visitor.user.may("issue"):
                ui.link(say("certificates.new"), "/certificates/new")
        found = certificates(visitor.bench.ledger, serial=serial or None, limit=shown, before=max(before, 0))
        heads = [say(f"certificates.{key}") for key in ("number", "tool", "issued_on", "state", "customer", "by")]
        table(heads, [_line(visitor, one) for one in found])
        if not found:
            ui.label(say("certificates.none")).classes("dim")
        if len(found) == shown:
            ui.link(say("ledger.older"), to("/certificates", serial=serial, before=found[-1].record.seq))


def _line(visitor: Visitor, one: CertificateStatus) -> tuple[Cell | str, ...]:
    record = one.record
    order = record.body["record"].get("order", {})
    return (
        Cell(one.number, to("/certificates", one.number)),
        Cell(record.keys["serial"], to("/tools", record.keys["serial"])),
        record.created[:10],
        Cell(visitor.say(f"state.{one.state}"), style=STYLES[one.state]),
        str(order.get("customer", "")) if isinstance(order, dict) else "",
        record.author,
    )


@ui.page("/certificates/{number}")
def certificate_page(request: Request, number: str) -> None:
    """One certificate; it is never edited."""
    with frame(request, "certificates.one") as visitor:
        ledger, say = visitor.bench.ledger, visitor.say
        try:
            found = status(ledger, number)
        except LedgerError as error:
            raise HTTPException(404, str(error)) from None
        _status(visitor, found)
        record = found.record
        with ui.card().classes("panel"):
            ui.label(say("certificates.documents")).classes("subtitle")
            with ui.row():
                for name in MEDIA:
                    address = to("/api/v1/certificates", number) + f"/{name}"
                    ui.link(say(f"document.{name}"), address).props("download")
            ui.label(say("certificates.digest", digest=digest_of(record))).classes("dim number pre")
            ui.label(say("ledger.head", head=str(record.body["head"]))).classes("dim number pre")
        if found.state == "issued" and visitor.user.may("issue"):
            _change(visitor, found)


def _status(visitor: Visitor, found: CertificateStatus) -> None:
    say, record = visitor.say, found.record
    with ui.card().classes("panel"):
        ui.label(found.number).classes("subtitle number")
        ui.label(say(f"state.{found.state}")).classes(f"judgement {STYLES[found.state]}")
        if found.reason:
            ui.label(say("certificates.because", reason=visible(found.reason)))
        if found.by:
            ui.link(say("certificates.replaced_by", number=found.by), to("/certificates", found.by))
        if record.body.get("supersedes"):
            old = str(record.body["supersedes"])
            ui.link(say("certificates.replaces", number=old), to("/certificates", old))
        with ui.row():
            ui.link(record.keys["serial"], to("/tools", record.keys["serial"])).classes("number")
            ui.label(f"{day(record.created)} UTC · {record.author}").classes("number")
            ui.link(say("verify.calibration"), f"/results/{record.body['calibration']}")
            if record.body.get("verification"):
                ui.link(say("verify.one"), f"/verifications/{record.body['verification']}")


def _change(visitor: Visitor, found: CertificateStatus) -> None:
    say, number = visitor.say, found.number
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say("certificates.void_ask", number=number))
        reason = ui.input(say("bench.reason")).props("autofocus maxlength=2000").classes("w-full")

        def declare(user: User) -> None:
            void(visitor.bench.ledger, number, str(reason.value or ""), author=user.name)
            ui.navigate.to(to("/certificates", number))

        with ui.row():
            ui.button(say("certificates.void"), on_click=visitor.action("issue", declare)).props(
                "no-caps color=negative"
            )
            ui.button(say("bench.cancel"), on_click=dialog.close).props("flat no-caps")
    with ui.card().classes("panel"):
        ui.label(say("certificates.change")).classes("subtitle")
        ui.label(say("certificates.never_edited")).classes("dim")
        with ui.row().classes("items-center"):
            ui.button(say("certificates.void"), on_click=dialog.open).props("outline no-caps color=negative")
            address = to("/certificates/new", calibration=str(found.record.body["calibration"]), supersedes=number)
            ui.link(say("certificates.supersede"), address)

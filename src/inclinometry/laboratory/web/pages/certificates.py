"""Certificates: the list, one certificate with its documents, declaring it void."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime
from typing import Any, Final

from fastapi import Request
from nicegui import ui

from inclinometry.errors import InputError, wrong_kind
from inclinometry.findings import without_notes
from inclinometry.laboratory import certificates, registry
from inclinometry.laboratory.certificate.laboratory import LONGEST, Laboratory, Order, Standard, begun, laboratory_from
from inclinometry.laboratory.certificate.record import words
from inclinometry.laboratory.certificate.requirements import missing, nonconforming, open_warnings
from inclinometry.laboratory.ledger.engine import MEDIA
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError, Record
from inclinometry.laboratory.ledger.users import LOCAL, User
from inclinometry.laboratory.results import calibration_of, can_be_evaluated_again
from inclinometry.laboratory.session import site_of
from inclinometry.laboratory.verification import recorded
from inclinometry.laboratory.web.frame import Visitor, frame
from inclinometry.laboratory.web.pages.lists import Cell, day, table, to, visible
from inclinometry.laboratory.web.pages.verify import limits_words, verdict_of
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
            found = registry.listed(visitor.bench.ledger, "calibration", limit=OFFERED)
            ui.label(visitor.say("certificates.choose" if found else "verify.no_calibration")).classes("subtitle")
            for one in found:
                ui.link(f"{one.keys['serial']} · {day(one.created)}", to("/certificates/new", calibration=one.id))
            return
        if supersedes:
            ui.label(visitor.say("certificates.replaces", number=supersedes)).classes("warn")
        IssueForm(visitor, record, verification, supersedes)


class IssueForm:
    """Verification, laboratory, order, language.

    Who is logged in signs the certificate; where no one logs in, whom the laboratory's settings name.
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
        self._open = ui.column().classes("w-full").props('aria-live="polite" data-testid="open-warnings"')
        self.accept = ui.input(say("certificates.accept_warnings")).props("maxlength=2000").classes("w-full")
        self.verification.on_value_change(self._warnings)
        self._warnings()
        session = ledger.get("session", calibration.keys["session"])
        ui.label(say("certificates.laboratory")).classes("subtitle")
        self._settings = registry.find_laboratory(ledger)
        known = self._laboratory_of(ledger, session)
        self.laboratory = _fields({name: say(f"field.{name}") for name in LABORATORY}, known)
        today = datetime.now(UTC).date()
        self._known = {one.cited: one for one in registry.standards(ledger) if not one.retired}
        usable = [cited for cited, one in self._known.items() if not one.overdue(today)]
        self.standards = ui.select(usable, value=usable, multiple=True, label=say("standards.used")).classes("wide")
        self.standards.props("use-chips").set_visibility(bool(usable))
        late = [cited for cited in self._known if cited not in usable]
        if late:
            ui.label(say("standards.late", names=", ".join(late))).classes("warn")
        ui.label(say("certificates.order")).classes("subtitle")
        stated: dict[str, Any] = {name: session.body.get(name, "") for name in ORDER}
        tool = registry.find_tool(ledger, session.keys["serial"])
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
        if visitor.user == LOCAL:  # no one has logged in: the signatory is written here
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

    def _laboratory_of(self, ledger: Ledger, session: Record) -> dict[str, str]:
        """What the site of a session, else the settings, say of the laboratory; what the rig says of traceability."""
        site = registry.find_site(ledger, site_of(ledger, session))
        rig = registry.find_rig(ledger, session.body["rig"])
        found: dict[str, str] = {}
        if site is not None and site.laboratory.get("name"):
            try:
                known = laboratory_from(dict(site.laboratory))
                found = {name: getattr(known, name) for name in LABORATORY}
            except InputError:
                found = {name: str(site.laboratory.get(name, "")) for name in LABORATORY}
        elif self._settings is not None:
            found = {name: getattr(self._settings, name) for name in LABORATORY}
        if rig is not None:
            found["traceability"] = found.get("traceability") or rig.traceability
            found["place"] = found.get("place") or rig.place
        return found

    def _authoriser(self, user: User) -> tuple[str, str]:
        """Name and role of the signatory."""
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
                late = ", ".join(each.name for each in self._standards() if each.overdue(day))
                ui.label(f"· {said(f'missing_{one}', names=late)}").classes("dim")

    def _warnings(self) -> None:
        """The warnings that block the issue until they are resolved or accepted."""
        ledger, visitor = self._visitor.bench.ledger, self._visitor
        chosen = str(self.verification.value or "")
        judged = recorded(ledger.get("verification", chosen)) if chosen else None
        calibration = calibration_of(self._calibration)
        found = open_warnings(calibration, judged)
        self._open.clear()
        with self._open:
            if found:
                ui.label(visitor.say("results.open")).classes("subtitle")
            for one in found:
                ui.label(visitor.sentence(one)).classes("warn")
                if one in without_notes(calibration.findings)[-1:] and can_be_evaluated_again(self._calibration):
                    ui.link(visitor.say("results.again"), to("/results", self._calibration.id) + "#site")
        self.accept.set_visibility(bool(found))
        self.nonconforming.set_visibility(nonconforming(judged))
        self.nonconforming.set_value(False)

    def _standards(self) -> list[Standard]:
        return [self._known[cited] for cited in self.standards.value]

    def _laboratory(self, user: User) -> Laboratory:
        """The laboratory as the form says it, with the signatory."""
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
        for one in registry.listed(ledger, "verification", calibration=self._calibration.id, limit=OFFERED):
            verdict, limits = registry.cached_from_record(ledger, one, "verdict", verdict_of)
            said = limits_words(self._visitor, limits)
            found[one.id] = f"{day(one.created)} · {say(f'verdict.{verdict}')} · {said}"
        return {**found, "": say("certificates.no_verification")}

    async def _issue(self) -> None:
        made = await self._visitor.attempt("issue", self._issued, self._problem.set_text, self.button)
        if made is not None:
            ui.navigate.to(to("/certificates", made.keys["number"]))

    def _issued(self, user: User) -> Record:
        about: dict[str, Any] = {name: str(field.value or "").strip() for name, field in self.order.items()}
        about["received"] = _day(about["received"])
        if about["environment"]:
            about["environment"] = {"text": about["environment"]}
        wish: dict[str, Any] = {
            "laboratory": self._laboratory(user),
            "standards": self._standards(),
            "language": str(self.language.value),
            "nonconforming": bool(self.nonconforming.value),
            "accept_warnings": str(self.accept.value or ""),
            "about": about,
        }
        ledger, calibration = self._visitor.bench.ledger, self._calibration.id
        verification = str(self.verification.value or "") or None
        if self._supersedes:
            wish |= {"supersedes": self._supersedes, "reason": str(self.reason.value or "")}
        return certificates.issue(ledger, calibration, verification, author=user.name, **wish)


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
        raise wrong_kind("received", text[:40], "date YYYY-MM-DD") from None
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
        found = certificates.certificates(
            visitor.bench.ledger, serial=serial or None, limit=shown, before=max(before, 0)
        )
        heads = [say(f"certificates.{key}") for key in ("number", "tool", "issued_on", "state", "customer", "by")]
        table(heads, [_line(visitor, one) for one in found])
        if not found:
            ui.label(say("certificates.none")).classes("dim")
        if len(found) == shown:
            ui.link(say("ledger.older"), to("/certificates", serial=serial, before=found[-1].record.seq))


def _line(visitor: Visitor, one: certificates.CertificateStatus) -> tuple[Cell | str, ...]:
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
        found = certificates.status(ledger, number)
        _status(visitor, found)
        record = found.record
        with visitor.panel("certificates.documents"):
            with ui.row():
                for name in MEDIA:
                    address = to("/api/v1/certificates", number) + f"/{name}"
                    ui.link(say(f"document.{name}"), address).props("download")
            ui.label(say("certificates.digest", digest=certificates.digest_of(record))).classes("dim number pre")
            ui.label(say("ledger.head", head=str(record.body["head"]))).classes("dim number pre")
        if found.state == "issued" and visitor.user.may("issue"):
            _change(visitor, found)


def _status(visitor: Visitor, found: certificates.CertificateStatus) -> None:
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


def _change(visitor: Visitor, found: certificates.CertificateStatus) -> None:
    say, number = visitor.say, found.number
    with ui.dialog() as dialog, ui.card().classes("panel"):
        ui.label(say("certificates.void_ask", number=number))
        reason = ui.input(say("bench.reason")).props("autofocus maxlength=2000").classes("w-full")

        def declare(user: User) -> None:
            certificates.void(visitor.bench.ledger, number, str(reason.value or ""), author=user.name)
            ui.navigate.to(to("/certificates", number))

        with ui.row():
            visitor.button("certificates.void", "no-caps color=negative", "issue", declare)
            ui.button(say("bench.cancel"), on_click=dialog.close).props("flat no-caps")
    with visitor.panel("certificates.change"):
        ui.label(say("certificates.never_edited")).classes("dim")
        with ui.row().classes("items-center"):
            ui.button(say("certificates.void"), on_click=dialog.open).props("outline no-caps color=negative")
            address = to("/certificates/new", calibration=str(found.record.body["calibration"]), supersedes=number)
            ui.link(say("certificates.supersede"), address)

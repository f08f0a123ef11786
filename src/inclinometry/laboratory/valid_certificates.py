"""The certificates of a ledger by tool and day: which one holds for a run, which calibrations are a tool's history."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import Any, NamedTuple

from inclinometry.digest import digest_bytes
from inclinometry.errors import InputError, refused
from inclinometry.files.json_codec import canonical
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.chain import missing
from inclinometry.laboratory.ledger.ledger import Ledger, Record


class Certified(NamedTuple):
    """A calibration with the certificate that states it.

    number, state : of the certificate; "issued", "void" or "superseded". by, reason : what superseded it, and why.
    performed : last day of its readings. since : that day, or the earlier one of the certificate it supersedes.
    calibration : id of its record. digest : SHA-256 of its tool.json.
    """

    number: str
    state: str
    by: str
    reason: str
    performed: date
    since: date
    calibration: str
    digest: str


class Certificates:
    """The certificates of a ledger as they stand now; it is read once, and again for the content of a calibration."""

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self._contents: dict[str, tuple[str, dict[str, Any]]] = {}
        self._units: dict[str, Mapping[str, tuple[str, int]]] = {}
        events = ended(ledger)
        self._of: dict[str, list[Certified]] = {}
        since: dict[str, date] = {}
        for record in every(ledger, "certificate"):
            number = record.keys["number"]
            days = record.body["record"]["dates"]
            day = date.fromisoformat(days["performed_to"] or days["performed_from"] or record.created[:10])
            replaced = record.body["supersedes"]
            since[number] = min(day, since[replaced]) if replaced in since else day
            found = Certified(number, *ending(events.get(number)), day, since[number], record.body["calibration"], "")
            self._of.setdefault(record.keys["serial"], []).append(found)

    @property
    def serials(self) -> list[str]:
        """Serial numbers of the tools that have one, in order."""
        return sorted(self._of)

    def of(self, serial: str) -> list[Certified]:
        """All certificates of a tool in the order they were issued."""
        return list(self._of.get(serial, ()))

    def at(self, serial: str, day: date) -> Certified:
        """The certificate that holds on a day: of those issued, the latest that does.

        Raises InputError: none does; says what there is.
        """
        known = self._of.get(serial)
        if not known:
            raise InputError(missing("certificate", serial, self._ledger.shown))
        valid = [one for one in known if one.state == "issued" and one.since <= day]
        if not valid:
            states = [{"number": one.number, "state": one.state, "since": str(one.since)} for one in known]
            has = tuple(Finding("certificate-state", one) for one in states)
            raise refused("certificate-none", {"tool": serial, "day": str(day), "known": has})
        # the later of two of one day
        best = max(valid, key=lambda one: one.since)
        best = [one for one in valid if one.since == best.since][-1]
        return best._replace(digest=self.content(best.calibration)[0])

    def content(self, calibration: str) -> tuple[str, dict[str, Any]]:
        """Digest and content of the tool.json of a calibration's record."""
        if calibration not in self._contents:
            content = dict(self._ledger.get("calibration", calibration).body["tool_json"])
            self._contents[calibration] = (digest_bytes(canonical(content)), content)
        return self._contents[calibration]

    def units(self, calibration: str) -> Mapping[str, tuple[str, int]]:
        """Kind of triad -> (unit, number of sensors) of the tool of a calibration's record."""
        if calibration not in self._units:
            triads = self.content(calibration)[1]["triads"]
            self._units[calibration] = {kind: (str(one["unit"]), len(one["tensor"])) for kind, one in triads.items()}
        return self._units[calibration]


def every(ledger: Ledger, kind: str, **keys: Any) -> list[Record]:
    """All records with these keys, however many, in order of their place in the chain."""
    found: list[Record] = []
    while True:
        page = ledger.find(kind, after=found[-1].seq if found else 0, limit=1000, **keys)
        if not page:
            return found
        found += page


def ended(ledger: Ledger, **keys: Any) -> dict[str, Record]:
    """Number of each certificate that is void or superseded -> the event that ended it."""
    found: dict[str, Record] = {}
    for event in every(ledger, "event", subject_kind="certificate", action=["void", "superseded"], **keys):
        found.setdefault(str(event.keys["subject"]), event)
    return found


def ending(event: Record | None) -> tuple[str, str, str]:
    """State of a certificate by the event that ended it, the number of what superseded it, and why."""
    if event is None:
        return "issued", "", ""
    return event.keys["action"], str(event.body.get("details", {}).get("by", "")), str(event.body.get("reason", ""))

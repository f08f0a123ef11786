"""The calibration certificate as a PDF/A document, made from its record alone."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inclinometry.calibration.conformity import RESERVING
from inclinometry.errors import InputError
from inclinometry.files.verification_json import as_now
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate import record as tables
from inclinometry.laboratory.certificate.record import LETTERS, Words, families, record_digest, words
from inclinometry.laboratory.certificate.requirements import missing_said, overdue
from inclinometry.language import label, using_language
from inclinometry.report.words import plain, significant

if TYPE_CHECKING:
    import typst


Content = dict[str, Any]


def certificate_pdf(
    record: Mapping[str, Any], *, fonts: Sequence[str | Path] = (), logo: bytes | None = None, seal: str = ""
) -> bytes:
    """A certificate as PDF/A-2b; `seal` is the signed text of its square code, number and digest when empty.

    The same record gives the same bytes with the same version of typst and matplotlib. A letter that no font on this
    computer or in the folders `fonts` shows is refused.
    """
    import typst

    with using_language(record["language"]):
        content = _view(dict(record), seal)
    data = json.dumps(content, ensure_ascii=False)
    chosen = families(data, fonts)
    content |= {
        "logo": None if logo is None else list(logo),
        "fonts": list(chosen),
        "mono": ["DejaVu Sans Mono", *chosen],
    }
    day = date.fromisoformat(record["dates"]["issued"])
    try:
        # PDF/A-2b: what archives accept; every font is inside, nothing outside is needed
        made = typst.compile(
            _template(),
            sys_inputs={"data": json.dumps(content, ensure_ascii=False)},
            pdf_standards="a-2b",
            timestamp=datetime(day.year, day.month, day.day, tzinfo=UTC),
            # two fonts show everything but Chinese
            font_paths=_fonts(len(chosen) > 2, tuple(str(folder) for folder in fonts)),
        )
    except typst.TypstError as error:  # which has no code
        lost = re.search(r"the text (.*) could not be displayed", error.message)
        if lost is None:
            raise
        letters = {"letters": lost[1].replace("`", "")}
        raise InputError(Finding("ledger-letters-not-shown", letters, severity="refused")) from None
    if not isinstance(made, bytes):
        raise TypeError("typst returned no document")
    return made


@cache
def _template() -> bytes:
    return files("inclinometry.laboratory.certificate").joinpath("templates", "certificate.typ").read_bytes()


@cache
def _fonts(system: bool, folders: tuple[str, ...]) -> typst.Fonts:
    """Fonts of typst and matplotlib, the same on every computer; those of the system only where letters need them."""
    import matplotlib
    import typst

    own = str(Path(matplotlib.get_data_path(), "fonts", "ttf"))
    return typst.Fonts(include_system_fonts=system, font_paths=[own, *folders])


def qr_text(number: str, digest: str) -> str:
    """What the square code on a certificate says.

    >>> qr_text("2026-0001", "sha256:ab")
    'inclinometry certificate 2026-0001 sha256:ab'
    """
    return f"inclinometry certificate {number} {digest}"


def _view(record: Content, seal: str) -> Content:
    """Ready texts for the template."""
    import segno

    say, number, digest = words(record["language"]), record["number"], record_digest(record)
    # of an older record, limits that no one agreed are none
    for name in ("verification", "as_found"):
        if record.get(name) is not None:
            record = record | {name: as_now(record[name])}
    laboratory = record["laboratory"] or {}
    day = date.fromisoformat(record["dates"]["issued"])
    remarks = tables.sentences(record)
    accepted = record.get("accepted")
    signed = [] if accepted is None else [say("accepted_by", **{**accepted, "by": accepted["by"] or say("not_stated")})]
    # of an older record only a laboratory that is not named is said
    missing = record.get("missing", [] if record["laboratory"] else ["laboratory"])
    kind = "_report" if record.get("title") == "report" else ""
    qr = seal or qr_text(number, digest)
    # the last one is of drawings that keep together, so that no page has but a few lines
    sections = [
        tables.results_section(record, say),
        tables.budget_section(record, say),
        tables.uncertainty_section(record, say),
        tables.verification_section(record, say),
        tables.section(say("remarks"), list=[*remarks, *signed]) if remarks or signed else None,
        tables.parameter_section(record, say),
        tables.classical_section(record, say),
        _inputs(record, digest, say),
        tables.residual_section(record, say),
    ]
    view = {
        "language": record["language"],
        "document_title": f"{say('title' + kind)} {number}",
        "author": laboratory.get("name", ""),
        "digest": digest,
        "date": [day.year, day.month, day.day],
        "title": say("title" + kind),
        "number_line": say("number" + kind, number=number),
        "header": f"{say('title' + kind)} {number}",
        "footer": say("only_item"),
        "page": say("page", page="{page}", pages="{pages}"),
        "laboratory": laboratory.get("name", say("laboratory") + label(": ") + say("not_stated")),
        "letterhead": _letterhead(laboratory, say),
        "is_report": say("is_report"),
        "missing": [missing_said(key, record, say) for key in missing],
        "facts": _facts(record, say),
        **_box(record, remarks, say),
        "authorised": _authorised(laboratory, record, say),
        "qr_says": qr,
        "sections": [part for part in sections if part is not None],
        "end": say("end" + kind, number=number),
    }
    broken: Content = _breakable(view)
    stream = io.BytesIO()
    segno.make(qr, error="m", micro=False).save(stream, kind="svg", border=1, xmldecl=False, svgns=True)
    return broken | {"qr": stream.getvalue().decode("utf-8"), "digest": digest}


def _box(record: Content, remarks: Sequence[str], say: Words) -> Content:
    """The statement of conformity; whoever reads it alone reads what speaks against relying on it."""
    found = record["verification"]
    compared = found is not None and found["limits"] is None
    statement = found["verdict"] if compared else record["conformity"]["statement"]
    warned = []
    if statement != "not assessed":
        judged = [one for one in found["report"]["findings"] if one["severity"] != "note" or one["code"] in RESERVING]
        warned = list(dict.fromkeys([*tables.sentences({"findings": judged}), *remarks]))
    colours = {"pass": "#1a7f37", "reserved": "#8a5a00", "fail": "#c1272d", "not assessed": "#5d6975"}
    colours |= {"agrees": "#5d6975", "does not agree": "#c1272d"}
    return {
        "conformity_colour": colours["reserved" if statement in ("pass", "agrees") and warned else statement],
        "conformity_head": say("agreement" if compared else "conformity"),
        "conformity": [*_conformity(record, say), *warned],
    }


def _letterhead(laboratory: Mapping[str, str], say: Words) -> list[str]:
    lines = [*laboratory.get("address", "").split("\n"), laboratory.get("country", "")]
    contact = " · ".join(filter(None, (laboratory.get("email"), laboratory.get("phone"))))
    number = laboratory.get("accreditation", "")
    accreditation = number and say("accreditation") + label(": ") + number
    return [line for line in (*lines, contact, accreditation) if line]


def _standards(record: Content, say: Words) -> str:
    late = overdue(record) if record.get("standards") else []
    said = []
    for one in record.get("standards", ()):
        text = say("standard", **{name: value or say("not_stated") for name, value in one.items()})
        said.append(f"{text} ({say('overdue')})" if f"{one['name']} ({one['due']})" in late else text)
    return label("; ").join(said)


def _facts(record: Content, say: Words) -> dict[str, list[list[str]]]:
    """Short ones for two columns, long ones for the whole width, each name and text."""
    item, customer, dates, method = record["item"], record["customer"], record["dates"], record["method"]
    laboratory = record["laboratory"] or {}
    who = ", ".join(filter(None, (customer["name"], customer["address"].replace("\n", ", "))))
    sensors = label(", ").join(
        label("{kind} ({count}, {unit})", kind=say(t["kind"]), count=t["sensors"], unit=label(t["unit"]))
        for t in item["triads"]
    )
    performed = " – ".join(dict.fromkeys(filter(None, (dates["performed_from"], dates["performed_to"]))))
    place = laboratory.get("place") or method.get("rig_place") or laboratory.get("address", "").replace("\n", ", ")
    positions = say("positions", count=method["positions"])
    # a plan may be named by its number of positions
    if method["plan"] and not re.fullmatch(rf"{method['positions']} [a-z]+", method["plan"]):
        positions = say("plan_positions", plan=method["plan"], count=method["positions"])
    months = record["interval_months"]
    interval = "" if months is None else say("interval", months=months)
    short = [
        ("item", item["name"]),
        ("customer", who),
        ("manufacturer", item["manufacturer"]),
        ("reference", customer["reference"]),
        ("serial", item["serial"]),
        ("received", dates["received"]),
        ("condition", item["condition"]),
        ("performed", performed),
        ("range", _range(item, say)),
        ("issued", dates["issued"]),
    ]
    long = [
        ("sensors", sensors),
        ("place", place),
        ("environment", _environment(record["environment"], say)),
        ("procedure", laboratory.get("procedure", "")),
        ("method", f"{say.method(method['name'])}{label('; ')}{positions}"),
        ("rig", _rig(method, say)),
        ("standards", _standards(record, say)),
        ("traceability", _traceability(laboratory, method, say)),
        ("interval_of", interval),
        ("supersedes", record["supersedes"] or ""),
    ]
    optional: tuple[str, ...] = ("reference", "manufacturer", "range", "received", "interval_of", "supersedes")
    if record["version"] == 1:  # older certificates named neither
        optional += ("procedure", "standards")
    columns = {}
    for name, pairs in (("short", short), ("long", long)):
        columns[name] = [[say(key), text or say("not_stated")] for key, text in pairs if text or key not in optional]
    return columns


def _range(item: Content, say: Words) -> str:
    span = item["temperature_range_degC"]
    return "" if span is None else _span("range_of", "range_at", span, say)


def _span(between: str, at: str, span: Sequence[float], say: Words) -> str:
    """From the lowest to the highest, or the one value that both are."""
    low, high = (plain(value, 1) for value in span)
    return say(at, low=low) if low == high else say(between, low=low, high=high)


def _rig(method: Content, say: Words) -> str:
    sd = method["rig_sd_deg"]
    said = say("rig_sd", **{name: significant(value) for name, value in sd.items()}) if any(sd.values()) else ""
    return label("; ").join(filter(None, (method["rig"], said)))


def _traceability(laboratory: Mapping[str, str], method: Content, say: Words) -> str:
    """What the laboratory states and what is recorded of the rig's reference, each once."""
    own, rig = laboratory.get("traceability", ""), method.get("rig_traceability", "")
    return "; ".join(filter(None, (own, rig and rig != own and f"{say('rig')} {method['rig']}: {rig}")))


def _environment(about: Content, say: Words) -> str:
    parts = [about["text"]]
    for key, name in (("temperature", "temperature_degC"), ("humidity", "humidity_percent")):
        if about[name] is not None:
            parts.append(_span(key, f"{key}_at", about[name], say))
    return label("; ").join(filter(None, parts))


def _conformity(record: Content, say: Words) -> list[str]:
    statement, rule = record["conformity"]["statement"], record["conformity"]["rule"]
    if record["verification"] is None:
        return [say("not_assessed")]
    limits = record["verification"]["limits"]
    if limits is None:
        return [*tables.agreement(record, say), *_applies(record, say)]
    return [
        say(statement),
        *_applies(record, say),
        f"{say('rule')}{label(': ')}{say(rule)}",
        f"{say('limits_source')}{label(': ')}{limits['source']}",
    ]


def _applies(record: Content, say: Words) -> list[str]:
    """What was judged or compared (ISO/IEC 17025, 7.8.6.2): the protocol, angles and inclinations."""
    judged = record["conformity"].get("judged", {})
    parts = []
    for name, one in judged.items():
        low, high = (plain(value, 2) for value in one["inclination_deg"])
        parts.append(say("judged_at", angle=say(name), count=one["positions"], low=low, high=high))
    left_out = [say(name) for name in LETTERS if name not in judged]
    protocol = record["verification"]["report"].get("protocol")
    agreed = record["verification"]["limits"] is not None
    return [
        *([say("protocol", **protocol)] if protocol else []),
        *([say("applies" if agreed else "compared", parts=label("; ").join(parts))] if parts else []),
        *([say("not_judged" if agreed else "not_compared", angles=label(", ").join(left_out))] if left_out else []),
    ]


def _authorised(laboratory: Mapping[str, str], record: Content, say: Words) -> list[list[str]]:
    who = ", ".join(filter(None, (laboratory.get("authoriser"), laboratory.get("authoriser_role"))))
    dated = f"{record['dates']['issued']}    _____________________________"
    return [[say("authorised"), who or say("not_stated")], [say("signature"), dated]]


def _inputs(record: Content, digest: str, say: Words) -> Content:
    rows = [[say("digest"), digest], *([[say("head"), record["head"]]] if record["head"] else [])]
    rows += [[name, digest] for name, digest in record["inputs"].items()]
    head = [say("input"), "SHA-256"]
    made = tables.table("", head, rows, left=2, size=7.0) | {"columns": ["auto", "fr"]}
    return tables.section(say("inputs"), [record["program"]], tables=[made])


def _breakable(value: Any) -> Any:
    """Long words with places to break, so that no text leaves its column; drawings are left alone."""
    if isinstance(value, str):
        longest_word = 24
        return re.sub(rf"(\S{{{longest_word}}})(?=\S)", "\\1\u200b", value)
    if isinstance(value, dict):
        return {key: item if key == "svg" else _breakable(item) for key, item in value.items()}
    return [_breakable(item) for item in value] if isinstance(value, list) else value

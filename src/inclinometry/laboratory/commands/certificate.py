"""Commands: certificate, and certificate verify for those who hold one and not the ledger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from inclinometry.cli import output
from inclinometry.cli.options import AlsoWritten, Flag, Input, InputOrNone, Json, Output
from inclinometry.errors import FileError, refused
from inclinometry.files.json_codec import findings_in, parse
from inclinometry.files.writing import write_bytes
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.issue import record_from_files
from inclinometry.laboratory.certificate.record import record_bytes, record_digest, words
from inclinometry.laboratory.certificate.requirements import missing_said
from inclinometry.laboratory.certificate.signing import Looked, look, parse_seal, seal, sign_files
from inclinometry.laboratory.ledger.keys import Keys, Public, read_public
from inclinometry.opening import whole


def certificate(
    tool: Path,
    /,
    *,
    output_: Output,
    verification: InputOrNone = None,
    laboratory: InputOrNone = None,
    previous: InputOrNone = None,
    as_found: InputOrNone = None,
    dcc: AlsoWritten = None,
    record: AlsoWritten = None,
    number: str | None = None,
    language: Literal["en", "ru", "zh"] = "en",
    fonts: InputOrNone = None,
    unsigned: Flag = False,
    nonconforming: Flag = False,
    accept_warnings: str = "",
    json: Json = False,
) -> None:
    """Write a calibration certificate: PDF/A, digital certificate (DCC) and JSON record.

    Parameters
    ----------
    tool
        tool.json, written by calibrate.
    output_
        PDF to write.
    verification
        verify.json, written by verify -o. Default: none.
    laboratory
        lab.toml: laboratory, standards and order. If an item of ISO/IEC 17025, 7.8 is missing, the document is titled
        calibration report and names it.
    previous
        tool.json of the previous calibration: adds the values before adjustment.
    as_found
        verify.json of the previous calibration at the same positions: adds results as found.
    dcc
        Write the digital calibration certificate, XML; requires --laboratory.
    record
        Write the record, JSON; its SHA-256 is printed on the certificate.
    number
        Unique number. Default: year and part of a digest of the inputs.
    language
        Of the fixed texts of the PDF.
    fonts
        Folder with further fonts, if a letter is missing.
    unsigned
        Do not sign, even if the laboratory has a key.
    nonconforming
        Certify the nonconformity of a failed verification.
    accept_warnings
        Reason to issue with open warnings; printed with the name of the signatory.
    """
    read = {"verification": verification, "laboratory": laboratory, "previous": previous, "as_found": as_found}
    inputs = {"tool.json": tool, **{f"--{name.replace('_', '-')}": path for name, path in read.items()}}
    output.check_outputs({"--output": output_, "--dcc": dcc, "--record": record}, inputs)
    if fonts is not None and not any(
        path.suffix.lower() in (".ttf", ".otf", ".ttc", ".otc") for path in (fonts.rglob("*") if fonts.is_dir() else ())
    ):
        lacking = Finding("file-empty", {"what": "fonts"}) if fonts.is_dir() else Finding("file-absent")
        raise FileError(lacking, path=fonts)
    how: dict[str, Any] = {**read, "nonconforming": nonconforming, "accept_warnings": accept_warnings}
    made = record_from_files(tool, number=number, language=language, **how)
    keys = Keys()
    sealed = seal(made, keys) if keys.there and not unsigned else None
    from inclinometry.laboratory.certificate.dcc import dcc_bytes

    pdf: bytes | None = _pdf(made, fonts, laboratory, str(sealed or ""))
    xml = None if dcc is None else dcc_bytes(made)
    text: bytes = record_bytes(made)
    if sealed is not None:
        pdf, xml, text = sign_files(made, pdf, xml, sealed, keys)
    files = {path: data for path, data in ((output_, pdf), (dcc, xml), (record, text)) if path is not None and data}
    for path, data in files.items():
        write_bytes(data, path)
    output.findings([*_lacking(made), *findings_in(made)])
    digest, statement = record_digest(made), made["conformity"]["statement"]
    if json:
        about = {name: made[name] for name in ("number", "title", "missing")}
        output.print_json(about | {"digest": digest, "conformity": statement, "written": list(files)})
        return
    output.print_line(f"{made['title']} {made['number']}, conformity {statement}")
    output.print_line(f"record {digest}")
    why = "" if unsigned else ": no laboratory's key is here (`inclinometry ledger key --make`)"
    output.print_line(f"not signed{why}" if sealed is None else f"signed by the key {sealed.key}")
    output.print_line(f"written to {', '.join(map(str, files))}")


def _lacking(record: dict[str, Any]) -> list[Finding]:
    """What the document lacks to be titled a certificate, and where it is stated."""
    where = {
        "laboratory": "name, address, country in lab.toml",
        "customer": "customer in [order]",
        "item": "serial in [order]",
        "performed": "performed_from in [order]",
        "traceability": "traceability in lab.toml",
        "environment": "environment or temperature_degC in [order]",
        "condition": "condition in [order]",
        "procedure": "procedure in lab.toml",
        "standards": "[[standards]] in lab.toml",
        "standards_due": "due of [[standards]] in lab.toml",
        "signatory": "authoriser in lab.toml",
    }
    said = tuple(f"{missing_said(key, record, words('en'))} ({where[key]})" for key in record["missing"])
    return [Finding("session-report-titled", {"count": len(said), "first": said[:2], "items": said})] if said else []


def _pdf(record: dict[str, Any], fonts: Path | None, laboratory: Path | None, sealed: str) -> bytes:
    from inclinometry.laboratory.certificate.laboratory_toml import read_logo
    from inclinometry.laboratory.certificate.pdf import certificate_pdf

    logo = None if laboratory is None else read_logo(laboratory)
    with output.busy("setting the certificate"):
        return certificate_pdf(record, fonts=() if fonts is None else (fonts,), logo=logo, seal=sealed)


def verify(*files: str, key: Input, json: Json = False) -> int:
    """Say whether a certificate is genuine, on any computer, without its ledger. Exit status 0 genuine and not ended,
    1 not, 2 bad input.

    Parameters
    ----------
    files
        PDF, XML or JSON of one certificate, or the text of its square code in quotes. Statements of `ledger status` add
        whether it is issued, void or superseded, and which breaks of the ledger were accepted. If one statement says
        void, it is void. Statements that contradict each other: exit status 1.
    key
        Public key of the laboratory, obtained from the laboratory (`ledger key --public`).
    """
    from inclinometry.laboratory.certificate.status import break_of, holding, is_status, read_status, two_histories

    if not files:
        raise refused("input-missing", {"names": ("FILE",)})
    public = read_public(key)
    given = [(name, _given(name)) for name in files]
    statements = [name for name, data in given if _json(data) is not None and is_status(_json(data) or {})]
    found = {name: read_status(name, public) for name in statements}
    newest = max(found.values(), key=lambda one: (one.head.size, one.head.time), default=None)
    published = public
    if newest is not None:  # keys that came after the published one, or before it
        said = [str(one[end]) for one in newest.changes for end in ("before", "after") if one[end]]
        public = Public(tuple(dict.fromkeys((*public.keys, *said))), public.certificates)
    looked = [(name, data, look(data, name, public)) for name, data in given if name not in statements]
    if newest is not None and not looked:
        about = {"statements": ", ".join(statements), "time": newest.head.time[:19]}
        counts = {"count": len(newest.rows), "record": newest.head.size}
        raise refused("web-statement-alone", {**about, **counts})
    held = {one.number: holding(found.values(), one.number) or newest for _, _, one in looked}
    rows = _judged(looked, held, published, () if newest is None else newest.changes)
    numbers = sorted(number for number in held if number)
    two = two_histories(found)
    mixed = [] if two is None else [two]
    # each once, though every statement since carries it
    accepted = {one["created"]: one for each in found.values() for one in each.accepted}
    breaks = [{name: one[name] for name in one if name != "entry"} for one in accepted.values()]
    if len(numbers) > 1:
        mixed.append(Finding("certificate-files-apart", {"numbers": tuple(numbers)}))
    ok = not mixed and all(row["genuine"] and row["state"] in ("issued", "not known") for row in rows)
    bad = [row for row in rows if row["problem"]]
    output.findings([*(row["problem"] for row in bad), *mixed], [row["file"] for row in bad])
    if json:
        as_of = next((one.head.statement() for one in held.values() if one is not None), None)
        output.print_json({"ok": ok, "problems": mixed, "files": rows, "as_of": as_of, "accepted": breaks})
        return 0 if ok else 1
    _say(rows, held)
    for one in breaks:
        output.print_line(str(break_of(one)))
    return 0 if ok else 1


def _given(name: str) -> bytes:
    """The bytes of a file, or of the text of a square code."""
    if parse_seal(name) is not None:
        return name.encode()
    largest = 100_000_000
    return whole(name, largest)


def _json(data: bytes) -> dict[str, Any] | None:
    try:
        content = parse(data) if data.lstrip()[:1] == b"{" else None
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def _judged(
    looked: Sequence[tuple[str, bytes, Looked]],
    held: Mapping[str, Any],
    published: Public,
    changes: Sequence[dict[str, Any]],
) -> list[dict[str, Any]]:
    """What is said of each file; `held` are the statements by which the certificates stand, by number."""
    from inclinometry.laboratory.certificate.status import contradiction

    digests: dict[str, set[str]] = {}
    for _, _, one in looked:
        digests.setdefault(one.number, set()).add(one.digest)
    rows = []
    for name, data, one in looked:
        by = held[one.number]
        row = by.rows.get(one.number) if by is not None else None
        whole = {"PDF": "pdf", "DCC": "dcc", "JSON": "json"}.get(one.kind)
        problem, open_ = one.problem, one.signer is not None
        if not problem and not _vouched(one.key, row, whole, published, changes):
            problem, open_ = Finding("certificate-key", {"key": one.key}), True
        if not problem and len(digests[one.number]) > 1:
            problem = Finding("certificate-files-apart", {"numbers": (one.number,)})
        if not problem and row is not None:
            problem = contradiction(row, one.digest, one.record, {whole: data} if whole else {})
        state = "not known" if by is None else "not in the ledger" if row is None else str(row["state"])
        rows.append({"file": name, "kind": one.kind, "number": one.number, "digest": one.digest, "key": one.key,
                     "genuine": not problem, "proven": not open_, "problem": problem, "state": state})  # fmt: skip
    return rows


def _vouched(key: str, row: Any, kind: str | None, published: Public, changes: Sequence[dict[str, Any]]) -> bool:
    """Whether a key counts for a file: a published one, one that came from it, or, lost, for what a statement lists."""
    from inclinometry.laboratory.ledger.keys import descends, fingerprint

    later = [str(one["after"]) for one in changes]
    trusted = {*published.keys}
    trusted |= {each for each in later if any(descends(each, one, changes) for one in published.keys)}
    former = {str(one["before"]) for one in changes if one["before"]} | set(later)
    if key not in {fingerprint(one) for one in former - trusted}:
        return True
    return row is not None and (kind is None or kind in row["body"].get("documents", {}))


def _say(rows: list[dict[str, Any]], held: dict[str, Any]) -> None:
    for row in rows:
        number = f" of certificate {row['number']}" if row["number"] else ""
        said = f"genuine, signed by {row['key']}"
        if not row["genuine"]:
            said = "NOT GENUINE" if row["proven"] else "NOT PROVEN"
        name = "square code" if row["kind"] == "square code" else f"{row['file']}: {row['kind']}"
        output.print_line(f"{name}{number}: {said}")
    if None in held.values():
        if any(row["genuine"] for row in rows):  # what the laboratory did not make it cannot end
            output.print_line(
                "whether it was voided or superseded since is not known: no statement of the ledger was given "
                "(`inclinometry ledger status`)"
            )
        return
    for number, by in held.items():
        if not number:
            continue
        as_of = f"as of record {by.head.size} of {by.head.time[:19]} UTC"
        row = by.rows.get(number)
        if row is None:
            output.print_line(f"certificate {number}: not among those that the statement lists, {as_of}")
            continue
        other = f" by {row['by']}" if row.get("by") else ""
        why = f" ({row['reason']})" if row.get("reason") else ""
        output.print_line(f"certificate {number}: {row['state']}{other}{why}, {as_of}")

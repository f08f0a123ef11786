"""Command: certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from inclinometry.cli import output
from inclinometry.cli.options import AlsoWritten, InputOrNone, Json, Output
from inclinometry.files.writing import write_bytes
from inclinometry.laboratory.certificate.issue import record_from_files
from inclinometry.laboratory.certificate.record import missing_said as missing
from inclinometry.laboratory.certificate.record import record_bytes, record_digest, words


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
    json: Json = False,
) -> None:
    """Write a calibration certificate: PDF/A, digital certificate (DCC) and JSON record.

    Parameters
    ----------
    tool
        tool.json, as calibrate writes it.
    output_
        PDF to write.
    verification
        verify.json, as verify writes it with --output; left out when not given.
    laboratory
        lab.toml: laboratory, standards and order. What is missing of what a certificate states (ISO/IEC 17025, 7.8) is
        named on the document, which is then titled calibration report.
    previous
        tool.json of the calibration before, for the values before adjustment; these are left out when not given.
    as_found
        verify.json of that calibration at the same positions: results as found beside those as left.
    dcc
        Write the digital calibration certificate, XML; it needs the laboratory.
    record
        Write the record, JSON; its SHA-256 is printed on the certificate.
    number
        Unique number; year and a part of the inputs' digest when not given.
    language
        Of the fixed texts of the PDF.
    fonts
        Folder with further fonts, where a letter is missing.
    """
    output.claim(
        {"--output": output_, "--dcc": dcc, "--record": record},
        {"tool.json": tool, "--verification": verification, "--laboratory": laboratory, "--previous": previous}
        | {"--as-found": as_found},
    )
    made = record_from_files(
        tool,
        verification=verification,
        laboratory=laboratory,
        previous=previous,
        as_found=as_found,
        number=number,
        language=language,
    )
    files = {output_: _pdf(made, fonts, laboratory)}
    if dcc is not None:
        from inclinometry.laboratory.certificate.dcc import dcc_bytes

        files[dcc] = dcc_bytes(made)
    if record is not None:
        files[record] = record_bytes(made)
    for path, data in files.items():
        write_bytes(data, path)
    output.warnings([*_lacking(made), *made["warnings"]])
    digest, statement = record_digest(made), made["conformity"]["statement"]
    if json:
        summary = {
            "number": made["number"],
            "digest": digest,
            "title": made["title"],
            "missing": made["missing"],
            "conformity": statement,
            "written": list(files),
        }
        output.print_json(summary)
        return
    output.say(f"{made['title']} {made['number']}, conformity {statement}")
    output.say(f"record {digest}")
    output.say(f"written to {', '.join(map(str, files))}")


def _lacking(record: dict[str, Any]) -> list[str]:
    """What the document lacks to be titled a certificate, and where it is stated."""
    said = [missing(key, record, words("en")) for key in record["missing"]]
    return [f"titled calibration report, not certificate; missing: {'; '.join(said)}"] if said else []


def _pdf(record: dict[str, Any], fonts: Path | None, laboratory: Path | None) -> bytes:
    from inclinometry.laboratory.certificate.laboratory_toml import read_logo
    from inclinometry.laboratory.certificate.pdf import certificate_pdf

    logo = None if laboratory is None else read_logo(laboratory)
    with output.busy("setting the certificate"):
        return certificate_pdf(record, fonts=() if fonts is None else (fonts,), logo=logo)

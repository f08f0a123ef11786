"""A certificate from the files that calibrate and verify write, without a ledger."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from inclinometry.digest import digest_bytes, digest_file
from inclinometry.errors import InputError, refused
from inclinometry.files.tool_json import read_calibration
from inclinometry.files.verification_json import read_verification
from inclinometry.files.writing import program
from inclinometry.laboratory.certificate.laboratory import Order
from inclinometry.laboratory.certificate.laboratory_toml import read_laboratory
from inclinometry.laboratory.certificate.record import certificate_record
from inclinometry.laboratory.certificate.requirements import only_conforming, open_warnings, other_tool
from inclinometry.laboratory.ledger.engine import no_text


def record_from_files(
    tool: Path,
    *,
    verification: Path | None = None,
    laboratory: Path | None = None,
    previous: Path | None = None,
    as_found: Path | None = None,
    number: str | None = None,
    language: str = "en",
    today: date | None = None,
    nonconforming: bool = False,
    accept_warnings: str = "",
) -> dict[str, Any]:
    """The record of a certificate; the digest of every file is in it.

    `previous` is the tool.json of the calibration before, `as_found` its verify.json at the positions of
    `verification`. Default number: year and eight digits of the digest of inputs, language and the reason for which
    warnings are accepted. Date of issue: that of lab.toml, `today`, or the clock's.
    """
    calibration = read_calibration(tool)
    if calibration.method == "datasheet":
        raise refused("certificate-datasheet", {"file": str(tool)})
    who, order, standards = (None, Order(), ()) if laboratory is None else read_laboratory(laboratory)
    unnamed = ("", "unnamed")
    name = calibration.tool.name
    if order.serial and name not in unnamed and order.serial != name:
        raise InputError(other_tool("order", order.serial, name))
    issued = order.issued or today or datetime.now(UTC).date()
    order = replace(order, serial=order.serial or ("" if name in unnamed else name), issued=issued)
    judged = None if verification is None else read_verification(verification, calibration)
    if not nonconforming:
        only_conforming(judged)
    before = None if previous is None else read_calibration(previous)
    if before is not None and before.tool.name != calibration.tool.name:
        raise InputError(other_tool("previous calibration", before.tool.name, order.serial))
    found = None
    if as_found is not None:
        if before is None or judged is None:
            raise refused("input-needs", {"name": "--as-found", "needed": ("--previous", "--verification")})
        found = read_verification(as_found, before)
        if _positions(found) != _positions(judged) or found["limits"] != judged["limits"]:
            about = {"as_found": str(as_found), "verification": str(verification)}
            raise refused("certificate-as-found", about)
    given = {"tool.json": tool, "verify.json": verification, "lab.toml": laboratory, "previous tool.json": previous,
             "as-found verify.json": as_found}  # fmt: skip
    inputs = {name: digest_file(path) for name, path in given.items() if path is not None}
    if judged is not None:
        inputs |= {f"verification {n}": d for n, d in judged["inputs"].items() if not n.startswith("calibration ")}
    derived = dict(inputs)
    if open_warnings(calibration, judged):
        derived["accepted"] = accept_warnings.strip()
    return certificate_record(
        calibration,
        who,
        order,
        number=_number(number, order, derived, language),
        program=program(),
        language=language,
        standards=standards,
        verification=judged,
        as_found=found,
        previous=before,
        previous_from="" if before is None or previous is None else f"{previous.name} ({before.method})",
        inputs=inputs,
        accept_warnings=accept_warnings,
    )


def _positions(verification: dict[str, Any]) -> list[tuple[float, ...]]:
    dials = ("azimuth_deg", "inclination_deg", "toolface_deg")
    return [tuple(row[dial] for dial in dials) for row in verification["report"]["positions"]]


def _number(given: str | None, order: Order, inputs: dict[str, str], language: str) -> str:
    if given is None:
        stated = [*sorted(inputs.items()), ("language", language)]  # each language is a record of its own
        year = "" if order.issued is None else f"{order.issued.year}-"
        return year + digest_bytes(repr(stated).encode()).removeprefix("sha256:")[:8]
    if not (1 <= len(given) <= 60 and given.isprintable() and given == given.strip()):
        raise no_text("--number", given, 60)
    return given

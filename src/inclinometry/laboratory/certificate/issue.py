"""A certificate from the files that calibrate and verify write, without a ledger."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from inclinometry.digest import digest_bytes, digest_file
from inclinometry.errors import InputError
from inclinometry.files.tool_json import read_calibration
from inclinometry.files.verification_json import read_verification
from inclinometry.files.writing import program
from inclinometry.laboratory.certificate.laboratory_toml import Order, read_laboratory
from inclinometry.laboratory.certificate.record import certificate_record


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
) -> dict[str, Any]:
    """The record of a certificate; the digest of every file is in it.

    Parameters
    ----------
    tool : Path
        tool.json
    verification : Path, optional
        verify.json of that calibration.
    laboratory : Path, optional
        lab.toml
    previous : Path, optional
        tool.json of the calibration before.
    as_found : Path, optional
        verify.json of that calibration at the positions of `verification`.
    number : str, optional
        Unique to this certificate; year and eight digits of the digest of inputs and language when not given.
    today : date, optional
        Date of issue where lab.toml has none; the clock's when not given.

    Raises
    ------
    InputError
        Files that do not belong together, in one sentence.
    """
    calibration = read_calibration(tool)
    if calibration.method == "datasheet":
        raise InputError(
            f"{tool} was entered from a data sheet, nothing was measured: calibrate the tool to certify it"
        )
    who, order, standards = (None, Order(), ()) if laboratory is None else read_laboratory(laboratory)
    unnamed = ("", "unnamed")
    name = calibration.tool.name
    if order.serial and name not in unnamed and order.serial != name:
        raise InputError(f"the order is for {order.serial!r:.60}, the calibration of {name!r:.60}")
    issued = order.issued or today or datetime.now(UTC).date()
    order = replace(order, serial=order.serial or ("" if name in unnamed else name), issued=issued)
    judged = None if verification is None else read_verification(verification, calibration)
    before = None if previous is None else read_calibration(previous)
    if before is not None and before.tool.name != calibration.tool.name:
        raise InputError(f"the previous calibration is of {before.tool.name!r:.60}, this one of {order.serial!r:.60}")
    found = None
    if as_found is not None:
        if before is None or judged is None:
            raise InputError("--as-found is what the calibration before said: give --previous and --verification, too")
        found = read_verification(as_found, before)
        if _positions(found) != _positions(judged):
            raise InputError(
                f"{as_found} was not verified at the positions of {verification}; verify the same readings"
            )
    given = {"tool.json": tool, "verify.json": verification, "lab.toml": laboratory, "previous tool.json": previous}
    given |= {"as-found verify.json": as_found}
    inputs = {name: digest_file(path) for name, path in given.items() if path is not None}
    if judged is not None:
        inputs |= {f"verification {n}": d for n, d in judged["inputs"].items() if not n.startswith("calibration ")}
    return certificate_record(
        calibration,
        who,
        order,
        number=_number(number, order, inputs, language),
        program=program(),
        language=language,
        standards=standards,
        verification=judged,
        as_found=found,
        previous=before,
        previous_from="" if before is None or previous is None else f"{previous.name} ({before.method})",
        inputs=inputs,
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
        raise InputError(f"--number is {given!r:.80}; 1 to 60 printable characters are needed")
    return given

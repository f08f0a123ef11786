"""A certificate checked against the ledger, years later: do its documents, its record and its calibration agree?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from inclinometry.core.errors import FileError, InputError
from inclinometry.io.certificate_json import checked, record_bytes, record_digest
from inclinometry.io.dcc import read_dcc
from inclinometry.report.certificate_record import printable
from inclinometry.store.ledger import Ledger, LedgerError, Record
from inclinometry.workflow.laboratory.certificates import Standing, status
from inclinometry.workflow.laboratory.results import calibration_of, parameters


@dataclass(frozen=True)
class Check:
    """What was found.

    standing : of the certificate.
    digest : of its record, to be compared with the one on paper.
    problems : sentences; none when everything agrees.
    """

    standing: Standing
    digest: str
    problems: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing contradicts the certificate."""
        return not self.problems


def verify_certificate(ledger: Ledger, number: str) -> Check:
    """Compare a certificate's PDF, DCC and JSON file with its record, and the record with its calibration.

    It says nothing of the rest of the ledger: `ledger verify` does.

    Raises
    ------
    LedgerError
        There is no certificate of that number.
    """
    found = status(ledger, number)
    record = found.record
    problems = [*_own(record), *_files(ledger, record), *_source(ledger, record)]
    return Check(found, record_digest(record.body["record"]), tuple(problems))


def _own(record: Record) -> Iterator[str]:
    content = record.body["record"]
    try:
        checked(content, f"certificate {record.keys['number']}")
    except FileError as error:
        yield f"its record does not fit: {error}"
        return
    if content["number"] != record.keys["number"]:
        yield f"its record is that of number {content['number']}"


def _files(ledger: Ledger, record: Record) -> Iterator[str]:
    content = record.body["record"]
    digest = record_digest(content)
    for name, key in record.body["documents"].items():
        try:
            data = ledger.document(key)[1]
        except LedgerError as error:
            yield f"its {name} file: {error}"
            continue
        if name == "json" and data != record_bytes(content):
            yield "its JSON file is not its record"
        if name == "pdf" and digest.encode() not in data:
            yield "its PDF does not bear the digest of its record"
        if name == "dcc":
            yield from _dcc(data, content, digest)


def _dcc(data: bytes, content: dict[str, Any], digest: str) -> Iterator[str]:
    try:
        said = read_dcc(data)
    except FileError as error:
        yield f"its DCC cannot be read: {error}"
        return
    if (said.number, said.digest) != (content["number"], digest):
        yield "its DCC is of another record"
    values = {row["name"]: row["value"] for row in content["results"]["parameters"]}
    if {name: value for name, (value, _) in said.parameters.items()} != values:
        yield "its DCC states other parameters than its record"


def _source(ledger: Ledger, record: Record) -> Iterator[str]:
    content = record.body["record"]
    try:
        calibration = ledger.get("calibration", record.body["calibration"])
        known = parameters(calibration_of(calibration))
    except InputError as error:
        yield f"its calibration: {error}"
        return
    if calibration.keys["serial"] != record.keys["serial"]:
        yield f"its calibration is of tool {calibration.keys['serial']}"
    stated = {row["name"]: row["value"] for row in content["results"]["parameters"]}
    if stated.keys() != known.keys() or not np.array_equal(list(stated.values()), [v for v, _ in known.values()]):
        yield "it states other parameters than its calibration"
    if content["inputs"].get("calibration record") != f"sha256:{calibration.digest}":
        yield "it was made from another state of its calibration"
    name = record.body["verification"]
    if name is not None:
        try:
            verification = ledger.get("verification", name)
        except LedgerError as error:
            yield f"its verification: {error}"
            return
        if content["verification"] != printable(
            {key: verification.body[key] for key in ("verdict", "limits", "report")}
        ):
            yield "it states another verification than the ledger holds"

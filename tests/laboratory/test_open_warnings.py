"""Open warnings block a certificate until they are resolved, or accepted with a reason that is recorded and printed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from lxml import etree
from tests.refusals import refused

from inclinometry.laboratory.certificate.laboratory import Laboratory
from inclinometry.laboratory.certificates import documents, issue
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.registry import RegisteredSite, put_site

LABORATORY = Laboratory("Stand 1", "Street 1", "NO", authoriser="Anna Berg")


def test_an_open_warning_blocks_until_it_is_accepted_with_a_reason(
    laboratory: Ledger, bench: SimpleNamespace, tmp_path: Path
) -> None:
    """The dip of the stand is not known. Who, when, why and what are in the record, on paper and in the DCC."""
    calibration = bench.finished(laboratory).id
    for reason in ("", "  "):
        with refused("certificate-open-warnings"):
            issue(laboratory, calibration, None, LABORATORY, author="anna", accept_warnings=reason)
    assert laboratory.count("certificate") == 0
    made = issue(laboratory, calibration, None, LABORATORY, author="anna", accept_warnings="field points down")
    accepted = made.body["record"]["accepted"]
    assert (accepted["by"], accepted["reason"]) == ("Anna Berg", "field points down")
    assert accepted["on"] == made.body["record"]["dates"]["issued"]
    assert accepted["findings"] == made.body["record"]["findings"]
    assert len(accepted["findings"]) == 1
    files = documents(laboratory, made)
    said = f"Warnings accepted by Anna Berg on {accepted['on']}: field points down"
    root = etree.fromstring(files["dcc"][2])
    assert any(said in text for text in root.xpath("//dcc:declaration/dcc:content/text()", namespaces=root.nsmap))
    if shutil.which("pdftotext"):
        path = tmp_path / "c.pdf"
        path.write_bytes(files["pdf"][2])
        text = subprocess.run(["pdftotext", path, "-"], capture_output=True, check=True).stdout.decode()
        assert said in " ".join(text.split())
    for nothing in ("", "-", "n/a", "tbd", "..."):
        how = {"supersedes": made.keys["number"], "reason": "customer", "accept_warnings": nothing}
        with refused("certificate-open-warnings"):
            issue(laboratory, calibration, None, LABORATORY, author="anna", **how)


def test_with_the_dip_of_its_site_there_is_nothing_to_accept(laboratory: Ledger, bench: SimpleNamespace) -> None:
    put_site(laboratory, RegisteredSite("hall", dip=float(np.radians(70.0))), author="anna")
    made = issue(laboratory, bench.finished(laboratory, site="hall").id, None, LABORATORY, author="anna", pdf=False)
    assert (made.body["record"]["accepted"], made.body["record"]["findings"]) == (None, [])

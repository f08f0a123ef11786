"""The digital certificate fits PTB's schemas, offline, and gives back the numbers it was made from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lxml import etree
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.laboratory.certificate.dcc import dcc_bytes, read_dcc, unit
from inclinometry.laboratory.certificate.record import record_digest

from .certificates import LABORATORY, NASTY, ORDER, dcc_schema, record, verification

BARE = replace(
    ORDER, received=None, performed_to=None, temperature_degC=None, humidity_percent=None, customer="", condition="",
    rig="", item="", plan="",
)  # fmt: skip


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"head": "3:" + "0" * 64, "supersedes": "2025-0009", "order": replace(ORDER, interval_months=6)},
        {"verification": None, "order": BARE},
        {"verification": verification(0.01)},
        {"verification": verification(None)},
        {"verification": verification(0.3, "expanded-uncertainty")},
        {"laboratory": replace(LABORATORY, address="", accreditation="", email="", phone="", authoriser="",
                               authoriser_role="", traceability="")},
        {"laboratory": replace(LABORATORY, name=NASTY), "order": replace(ORDER, customer=NASTY, serial=NASTY)},
    ],
)  # fmt: skip
def test_every_kind_of_certificate_fits_the_schema(changes: dict[str, Any]) -> None:
    """DCC 3.2.1 and D-SI 2.1.0 as published."""
    schema = dcc_schema()
    assert schema.validate(etree.fromstring(dcc_bytes(record(**changes)))), schema.error_log


def test_the_numbers_come_back_to_four_digits_of_their_uncertainty() -> None:
    """Parameters, their covariance, uncertainties, errors at the judged positions; none has digits without meaning."""
    content = record()
    said, k = read_dcc(dcc_bytes(content)), content["results"]["coverage"]["factor"]
    assert (said.number, said.digest, said.serial) == ("2026-0001", record_digest(content), "IN-7")
    np.testing.assert_allclose(said.covariance, content["results"]["covariance"]["matrix"], rtol=1e-9)
    assert np.linalg.eigvalsh(said.covariance)[0] > 0.0
    for row in content["results"]["parameters"]:
        value, spread = said.parameters[row["name"]]
        # half a digit of the fourth place of U, at most 5e-4 of it
        assert value == pytest.approx(row["value"], abs=5.01e-4 * spread)
        assert spread == pytest.approx(k * row["u"], rel=5.01e-4)
        assert len(f"{spread!r}".replace(".", "").strip("0")) <= 4
    for name, values in said.uncertainty.items():
        np.testing.assert_allclose(values, content["results"]["uncertainty"][f"{name}_deg"], rtol=5.01e-4)
    positions = content["verification"]["report"]["positions"]
    for name, values in said.errors.items():
        rows = [row[name] for row in positions if row[name]["decision"] != "not judged"]
        np.testing.assert_allclose(values[:, 0], [row["error_deg"] for row in rows], atol=5.01e-4 * values[:, 1].max())
        np.testing.assert_allclose(values[:, 1], [row["U_deg"] for row in rows], rtol=5.01e-4)
    assert set(said.errors) == {"inclination", "azimuth", "toolface"}


def test_special_characters_come_back() -> None:
    """As text, not as elements."""
    data = dcc_bytes(record(order=replace(ORDER, customer=NASTY)))
    root = etree.fromstring(data)
    names = root.xpath("//dcc:customer/dcc:name/dcc:content/text()", namespaces=root.nsmap)
    assert names == [" ".join(NASTY.split())]


def test_positions_that_pass_no_guarded_acceptance() -> None:
    """A position inside the limit and outside the acceptance limit is no pass."""
    root = etree.fromstring(dcc_bytes(record(verification=verification(0.3, "expanded-uncertainty"))))
    said = " ".join(root.xpath("//dcc:conformityXMLList/text()", namespaces=root.nsmap)).split()
    decisions = [
        row[name]["decision"]
        for name in ("inclination", "azimuth", "toolface")
        for row in verification(0.3, "expanded-uncertainty")["report"]["positions"]
    ]
    for word, decision in (("pass", "pass"), ("fail", "fail"), ("noPass", "inconclusive")):
        assert said.count(word) == decisions.count(decision)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"laboratory": None}, "input-missing"),
        ({"laboratory": replace(LABORATORY, country="")}, "input-missing"),
        ({"order": replace(ORDER, performed_from=None, performed_to=None)}, "input-missing"),
    ],
)
def test_what_a_dcc_must_state_is_asked_for(changes: dict[str, Any], said: str) -> None:
    """One sentence with the remedy."""
    with refused(said):
        dcc_bytes(record(**changes))


BOMB = b'<!DOCTYPE a [<!ENTITY x "xx"><!ENTITY y "&x;&x;">]><a>&y;</a>'
FETCH = b'<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/hostname">]><a>&x;</a>'


@pytest.mark.parametrize("data", [b"", b"%PDF", b"<a/>", BOMB, FETCH, dcc_bytes(record())[:2000]])
def test_what_is_no_dcc_is_refused(data: bytes) -> None:
    """Nothing is expanded or fetched."""
    with pytest.raises(FileError):
        read_dcc(data)


def test_a_dcc_of_another_program_is_refused() -> None:
    """Its structure is not known."""
    data = dcc_bytes(record()).replace(b"inclinometry_", b"other_")
    with refused("file-format", error=FileError):
        read_dcc(data)


def test_units() -> None:
    """Those of the package; what the SI does not know is said, not guessed."""
    assert unit("V/K") == r"\volt\kelvin\tothe{-1}"
    assert unit("counts/K") == r"\kelvin\tothe{-1}"
    assert unit("furlong") is None

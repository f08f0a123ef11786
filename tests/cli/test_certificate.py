"""From the files of calibrate and verify to a certificate, at the terminal."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

from ..laboratory.certificate.certificates import dcc_schema

LAB = """
name = "Stand & Son"
address = "1 Street\\n2 Town"
country = "NO"
authoriser = "Anna"
[order]
customer = "Driller <1>"
serial = "IN-7"
performed_from = 2026-05-04
issued = 2026-05-06
temperature_degC = [21.5, 23]
"""


@pytest.fixture
def files(run: Any) -> Any:
    """tool.json, check.csv, verify.json and lab.toml in the folder of `run`."""
    bench = ("--seed", "1", "--rig-sd-deg", "0.05")
    run("simulate", "bench", "--plan", "orthogonal", *bench, "-o", "readings.csv", "--truth", "truth.json")
    run("calibrate", "readings.csv", "-o", "tool.json", "--rig-sd-deg", "0.05")
    bench = ("--seed", "2", "--rig-sd-deg", "0.05")
    run("simulate", "bench", "--plan", "twelve", *bench, "--tool", "truth.json", "-o", "check.csv")
    assert run("verify", "check.csv", "--calibration", "tool.json", "-o", "verify.json").status == 0
    Path("lab.toml").write_text(LAB, encoding="utf-8")
    return run


GIVEN = ("--verification", "verify.json", "--laboratory", "lab.toml")


def test_all_three_documents(files: Any) -> None:
    """The record's digest is printed; the digital certificate fits its schema; the number is the same again."""
    out = ("-o", "c.pdf", "--dcc", "c.xml", "--record", "c.json")
    done = files("certificate", "tool.json", *GIVEN, *out, "--json")
    assert done.status == 0, done.err
    assert done.json["digest"] == "sha256:" + hashlib.sha256(Path("c.json").read_bytes()).hexdigest()
    assert done.json["conformity"] == "pass"
    assert Path("c.pdf").read_bytes().startswith(b"%PDF")
    schema = dcc_schema()
    assert schema.validate(etree.parse("c.xml")), schema.error_log
    first = Path("c.pdf").read_bytes()
    again = files("certificate", "tool.json", *GIVEN, *out)
    assert done.json["number"] in again.out
    assert Path("c.pdf").read_bytes() == first


def test_where_the_laboratory_has_a_key_they_are_signed(files: Any) -> None:
    """And anybody with the public key finds them genuine; the digest is that of the record without its seal."""
    out = ("-o", "c.pdf", "--dcc", "c.xml", "--record", "c.json")
    plain = files("certificate", "tool.json", *GIVEN, *out)
    assert "not signed: no laboratory's key is here" in plain.out
    bare = Path("c.json").read_bytes()
    assert files("ledger", "key", "--make", "--public", "laboratory.pem").status == 0
    done = files("certificate", "tool.json", *GIVEN, *out)
    assert "signed by the key" in done.out
    signed = json.loads(Path("c.json").read_bytes())
    assert signed.pop("signature")["seal"].startswith("inclinometry certificate ")
    assert signed == json.loads(bare)
    found = files("certificate", "verify", "c.pdf", "c.xml", "c.json", "--key", "laboratory.pem", "--json").json
    assert [(one["genuine"], one["state"]) for one in found["files"]] == [(True, "not known")] * 3
    files("certificate", "tool.json", *GIVEN, *out, "--unsigned")
    assert Path("c.json").read_bytes() == bare
    found = files("certificate", "verify", "c.pdf", "c.json", "--key", "laboratory.pem")
    assert found.status == 1
    assert found.out.count("NOT GENUINE: it bears no signature") == 2


WRONG = [
    (("none.json", "-o", "c.pdf"), "none.json: there is no such file"),
    (("verify.json", "-o", "c.pdf"), 'schema "inclinometry/tool" is needed'),
    (("tool.json", "-o", "c.pdf", "--verification", "tool.json"), "the file that `verify -o` writes"),
    (("tool.json", "-o", "c.pdf", "--laboratory", "tool.json"), "not TOML"),
    (("tool.json", "-o", "c.pdf", "--dcc", "c.xml"), "a digital certificate states the laboratory"),
    (("tool.json", "-o", "tool.json"), "tool.json"),
    (("tool.json", "-o", "c.pdf", "--number", " "), "--number is"),
    (("tool.json", "-o", "c.pdf", "--language", "fr"), "fr"),
    (("other.json", "-o", "c.pdf", "--verification", "verify.json"), "made with another calibration"),
]


def test_what_does_not_belong_is_one_sentence(files: Any) -> None:
    """Status 2, nothing written."""
    files("calibrate", "readings.csv", "-o", "other.json", "--rig-sd-deg", "0.06")
    for arguments, said in WRONG:
        done = files("certificate", *arguments)
        assert done.status == 2, arguments
        assert said in done.err
        assert not Path("c.pdf").exists()


WRONG_LAB = [
    ("nam = 'x'", "key 'nam' is not known; did you mean name?"),
    ("address = 'x'", "key 'name' is missing"),
    ("name = 'x'\ncountry = 'Norway'", "two capital letters"),
    ("name = 'x'\norder = 3", "a table [order] is needed"),
    ("name = 'x'\n[order]\nreceived = 3", "received is 3; a date is needed"),
    ("name = 'x'\n[order]\nreceived = 2026-05-05\nissued = 2026-05-04", "none may be before the last"),
    ("name = 'x'\n[order]\ntemperature_degC = [30, 20]", "lowest and highest are needed"),
    ("name = 'x'\n[order]\ninterval_months = 1.5", "whole months"),
    ("name = 'x'\n[order]\nserial = 'IN-9'", "the order is for 'IN-9', the calibration of 'IN-7'"),
    (f"name = '{'x' * 501}'", "name has 501 characters; allowed 500"),
]


def test_a_wrong_lab_file_is_one_sentence(files: Any) -> None:
    """With the key and the remedy."""
    text = Path("tool.json").read_text(encoding="utf-8").replace('"tool": "unnamed"', '"tool": "IN-7"')
    Path("named.json").write_text(text, encoding="utf-8")
    for line, said in WRONG_LAB:
        Path("bad.toml").write_text(line, encoding="utf-8")
        done = files("certificate", "named.json", "-o", "c.pdf", "--laboratory", "bad.toml")
        assert done.status == 2, line
        assert said in done.err


def test_the_example_of_the_documentation(files: Any) -> None:
    """lab.toml as the how-to shows it."""
    text = Path(__file__).parents[2].joinpath("docs/howto/certificate.md").read_text(encoding="utf-8")
    Path("lab.toml").write_text(text.split("```toml\n# lab.toml")[1].split("```")[0], encoding="utf-8")
    done = files("certificate", "tool.json", "-o", "c.pdf", "--dcc", "c.xml", *GIVEN)
    assert done.status == 0, done.err
    assert done.err == ""


@pytest.mark.long
def test_what_is_lacking_is_named(files: Any) -> None:
    """A warning each time, and the documents all the same."""
    assert "no laboratory is named" in files("certificate", "tool.json", "-o", "c.pdf").err
    Path("lab.toml").write_text("name = 'x'", encoding="utf-8")
    done = files("certificate", "tool.json", "-o", "c.pdf", "--laboratory", "lab.toml")
    assert "lab.toml does not state authoriser, traceability, customer" in done.err
    assert done.status == 0


def test_a_damaged_verification_is_refused(files: Any) -> None:
    """With the place in the file."""
    text = Path("verify.json").read_text(encoding="utf-8").replace('"verdict": "pass"', '"verdict": "perhaps"')
    Path("verify.json").write_text(text, encoding="utf-8")
    done = files("certificate", "tool.json", "-o", "c.pdf", *GIVEN)
    assert done.status == 2
    assert '$.verdict is "perhaps"; it must be pass or fail' in done.err

"""From the files of calibrate and verify to a certificate, at the terminal."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

from inclinometry.laboratory.certificate.record import words
from inclinometry.laboratory.certificate.requirements import missing_said

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
    run("simulate bench --plan orthogonal", *bench, "-o", "readings.csv", "--truth", "truth.json")
    run("calibrate readings.csv -o tool.json --rig-sd-deg 0.05")
    bench = ("--seed", "2", "--rig-sd-deg", "0.05")
    run("simulate bench --plan twelve", *bench, "--tool", "truth.json", "-o", "check.csv")
    assert run("verify check.csv --calibration tool.json -o verify.json").status == 0
    Path("lab.toml").write_text(LAB, encoding="utf-8")
    return run


GIVEN = ("--verification", "verify.json", "--laboratory", "lab.toml")


def test_open_warnings_are_accepted_with_a_reason_that_the_number_tells(files: Any) -> None:
    """The refusal names the option; another reason is another certificate, with another number."""
    lines = [line.split(",") for line in Path("readings.csv").read_text("utf-8").splitlines() if line[0] != "#"]
    kept = [place for place, name in enumerate(lines[0]) if not name.startswith("reference_")]
    Path("nodip.csv").write_text("\n".join(",".join(line[place] for place in kept) for line in lines), "utf-8")
    assert files("calibrate nodip.csv -o nodip.json --rig-sd-deg 0.05").status == 0
    wanted = ("certificate", "nodip.json", "--laboratory", "lab.toml", "-o", "c.pdf", "--json")
    for nothing in ((), ("--accept-warnings", "n/a")):
        files(*wanted[:-1], *nothing).refused("[certificate-open-warnings]")
    reasons = ("the field points down", "the field points down", "the dip is known: 70 deg")
    one, again, other = (files(*wanted, "--accept-warnings", reason).json["number"] for reason in reasons)
    assert one == again
    assert one != other


def test_all_three_documents(files: Any) -> None:
    """The record's digest is printed; the digital certificate fits its schema; the number is the same again."""
    out = ("-o", "c.pdf", "--dcc", "c.xml", "--record", "c.json")
    done = files("certificate", "tool.json", *GIVEN, *out, "--json").ok()
    assert done.json["digest"] == "sha256:" + hashlib.sha256(Path("c.json").read_bytes()).hexdigest()
    assert done.json["conformity"] == "not assessed"  # no limits were agreed
    assert Path("c.pdf").read_bytes().startswith(b"%PDF")
    schema = dcc_schema()
    assert schema.validate(etree.parse("c.xml")), schema.error_log
    first = Path("c.pdf").read_bytes()
    again = files("certificate", "tool.json", *GIVEN, *out)
    assert done.json["number"] in again.out
    assert Path("c.pdf").read_bytes() == first
    other = files("certificate", "tool.json", *GIVEN, "-o", "ru.pdf", "--language", "ru", "--json")
    assert other.json["number"] != done.json["number"]  # another record


def test_where_the_laboratory_has_a_key_they_are_signed(files: Any) -> None:
    """And anybody with the public key finds them genuine; the digest is that of the record without its seal."""
    out = ("-o", "c.pdf", "--dcc", "c.xml", "--record", "c.json")
    plain = files("certificate", "tool.json", *GIVEN, *out)
    assert "not signed: no laboratory's key is here" in plain.out
    bare = Path("c.json").read_bytes()
    assert files("ledger key --make --public laboratory.pem").status == 0
    done = files("certificate", "tool.json", *GIVEN, *out)
    assert "signed by the key" in done.out
    signed = json.loads(Path("c.json").read_bytes())
    assert signed.pop("signature")["seal"].startswith("inclinometry certificate ")
    assert signed == json.loads(bare)
    found = files("certificate verify c.pdf c.xml c.json --key laboratory.pem --json").json
    assert [(one["genuine"], one["state"]) for one in found["files"]] == [(True, "not known")] * 3
    files("certificate", "tool.json", *GIVEN, *out, "--unsigned")
    assert Path("c.json").read_bytes() == bare
    found = files("certificate verify c.pdf c.json --key laboratory.pem")
    assert found.status == 1
    assert found.err.count("[certificate-unsigned]") == 2


WRONG = [
    (("none.json",), "[file-absent]"),
    (("verify.json",), "[record-kind]"),
    (("tool.json", "--verification", "tool.json"), "verify -o"),
    (("tool.json", "--verification", "damaged.json"), "$.verdict"),
    (("tool.json", "--laboratory", "tool.json"), "TOML"),
    (("tool.json", "--dcc", "c.xml"), "[input-missing]"),
    (("tool.json", "--number", " "), "[ledger-text]"),
    (("tool.json", "--language", "fr"), "fr"),
    (("other.json", "--verification", "verify.json"), "[record-calibration-other]"),
    (("tool.json", "--fonts", "nowhere"), "nowhere: "),
    (("tool.json", "--fonts", "empty"), "empty: The file has no fonts."),
]
WRONG_LAB = [
    ("nam = 'x'", "[table-near]"),
    ("address = 'x'", "[input-missing]"),
    ("name = 'x'\ncountry = 'Norway'", "[input-value]"),
    ("name = 'x'\norder = 3", "[input-kind]"),
    ("name = 'x'\n[order]\nreceived = 3", "[input-kind]"),
    ("name = 'x'\n[order]\nreceived = 2026-05-05\nissued = 2026-05-04", "[certificate-dates]"),
    ("name = 'x'\n[order]\ntemperature_degC = [30, 20]", "[input-value]"),
    ("name = 'x'\n[order]\ninterval_months = 1.5", "[input-kind]"),
    ("name = 'x'\n[order]\nserial = 'IN-9'", "[certificate-other-tool]"),
    (f"name = '{'x' * 501}'", "[input-value]"),
    # a control character, a line end in a name, a mark that turns the direction
    ('name = "Lab\\u0007"', "[ledger-invisible]"),
    ('name = "Lab\\nTwo"', "[ledger-invisible]"),
    ('name = "Lab"\n[order]\ncustomer = "a\\u202eb"', "[ledger-invisible]"),
    (LAB.replace("2026-05-04", "2999-01-01"), "[input-value]"),
    (LAB.replace("2026-05-06", "2999-01-01"), "[input-value]"),
]


def test_what_does_not_belong_is_one_sentence(files: Any) -> None:
    """Status 2, nothing written."""
    files("calibrate readings.csv -o other.json --rig-sd-deg 0.06")
    Path("empty").mkdir()
    for name, to, old, new in (
        ("verify.json", "damaged.json", '"verdict": "agrees"', '"verdict": "perhaps"'),
        ("tool.json", "named.json", '"tool": "unnamed"', '"tool": "IN-7"'),
    ):
        Path(to).write_text(Path(name).read_text("utf-8").replace(old, new), encoding="utf-8")
    files("certificate tool.json -o tool.json").refused("tool.json")
    for arguments, said in WRONG:
        files("certificate", *arguments, "-o", "c.pdf").refused(said)
    for text, said in WRONG_LAB:
        Path("bad.toml").write_text(text, encoding="utf-8")
        files("certificate named.json -o c.pdf --laboratory bad.toml").refused(said)
    assert not Path("c.pdf").exists()


def test_the_example_of_the_documentation(files: Any) -> None:
    """lab.toml as the how-to shows it."""
    text = Path(__file__).parents[2].joinpath("docs/howto/certificate.md").read_text(encoding="utf-8")
    Path("lab.toml").write_text(text.split("```toml\n# lab.toml")[1].split("```")[0], encoding="utf-8")
    done = files("certificate tool.json -o c.pdf --dcc c.xml", *GIVEN).ok()
    assert done.err == ""


@pytest.mark.long
def test_what_failed_is_certified_only_where_it_is_asked_for(files: Any) -> None:
    """As at the bench."""
    files("simulate bench --plan twelve --seed 77 -o off.csv")
    assert files("verify off.csv --calibration tool.json -o verify.json").status == 1
    command = ("certificate", "tool.json", "-o", "c.pdf", *GIVEN, "--accept-warnings", "a trial")
    files(*command).refused("[certificate-failed]")
    assert not Path("c.pdf").exists()
    assert "conformity not assessed" in files(*command, "--nonconforming").out


@pytest.mark.long
def test_what_is_lacking_is_named(files: Any) -> None:
    """A warning each time, and the documents all the same."""
    done = files("certificate tool.json -o c.pdf --record c.json")
    assert "in all: the laboratory: name, address" in done.err
    assert done.out.startswith("report ")
    # what a program calls its settings is of the message, not of the paper
    record = json.loads(Path("c.json").read_bytes())
    for language in ("en", "ru", "zh"):
        paper = [missing_said(key, record, words(language)) for key in record["missing"]]
        assert not re.search(r"[\[(（_]|toml", " ".join(paper))
    text = Path(__file__).parents[2].joinpath("docs/howto/certificate.md").read_text(encoding="utf-8")
    whole = text.split("```toml\n# lab.toml")[1].split("```")[0]
    Path("lab.toml").write_text(re.sub("(?m)^(procedure|authoriser) .*", "", whole), encoding="utf-8")
    done = files("certificate tool.json -o c.pdf", *GIVEN).ok()
    assert "Missing, 2 in all: " in done.err
    assert "(procedure in lab.toml)" in done.err
    assert "(authoriser in lab.toml)" in done.err


def test_results_as_found_are_those_of_the_calibration_before(files: Any) -> None:
    """The same readings by the old parameters; other positions, or no old calibration, are refused."""
    files("simulate bench --plan twelve --tool truth.json --seed 9 -o old.csv")
    files("calibrate old.csv -o old.json --rig-sd-deg 0.05")
    files("verify check.csv --calibration old.json -o found.json")
    given = ("certificate", "tool.json", "-o", "c.pdf", "--record", "c.json", *GIVEN, "--as-found", "found.json")
    files(*given).refused("[input-needs]")
    files(*given, "--previous", "old.json", "--json").ok()
    content = json.loads(Path("c.json").read_bytes())
    rows = [content[key]["report"]["positions"] for key in ("as_found", "verification")]
    assert [row["position"] for row in rows[0]] == [row["position"] for row in rows[1]]
    assert rows[0] != rows[1]
    Path("limits.toml").write_text('source = "Order 17"\ninclination_deg = 1\n', "utf-8")
    files("verify check.csv --calibration old.json --limits limits.toml -o found.json")
    files(*given, "--previous", "old.json").refused("[certificate-as-found]")
    files("simulate bench --plan spread --tool truth.json -o other.csv")
    files("verify other.csv --calibration old.json -o found.json")
    files(*given, "--previous", "old.json").refused("[certificate-as-found]")


def test_the_laboratory_is_stated_once_for_bench_and_command_line(files: Any) -> None:
    """From a file into the ledger, from there into the certificates of both; a standard past its day is said."""
    about = """
name = "Stand & Son"
address = "1 Street"
country = "NO"
procedure = "QP-12"
traceability = "level No. 7"
authoriser = "Anna"
logo = "logo.svg"
[[standards]]
name = "T2"
certificate = "D-17"
due = 2020-01-31
"""
    Path("settings.toml").write_text(about, encoding="utf-8")
    Path("logo.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M0 0h9v9z"/></svg>'
    )
    done = files("ledger laboratory settings.toml --ledger lab.sqlite").ok()
    assert "[web-standard-due]" in done.err
    shown = files("ledger laboratory --ledger lab.sqlite --json").json
    assert (shown["procedure"], shown["logo"], shown["standards"][0]["due"]) == ("QP-12", True, "2020-01-31")
    order = LAB.partition("[order]")[2] + 'condition = "good"\n'
    Path("lab.toml").write_text(f'ledger = "lab.sqlite"\n[order]{order}', encoding="utf-8")
    given = ("certificate", "tool.json", "-o", "c.pdf", "--record", "c.json", *GIVEN)
    done = files(*given).ok()
    assert "T2 (2020-01-31) had run out" in done.err
    content = json.loads(Path("c.json").read_bytes())
    assert (content["title"], content["missing"]) == ("report", ["standards_due"])
    Path("settings.toml").write_text(about.replace("2020", "2030"), encoding="utf-8")
    assert "[web-standard-due]" not in files("ledger laboratory settings.toml --ledger lab.sqlite").err
    assert files(*given).out.startswith("certificate ")
    Path("settings.toml").write_text(about.replace("logo.svg", "none.svg"), encoding="utf-8")
    files("ledger laboratory settings.toml --ledger lab.sqlite").refused("none.svg")

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
    other = files("certificate", "tool.json", *GIVEN, "-o", "ru.pdf", "--language", "ru", "--json")
    assert other.json["number"] != done.json["number"]  # another record


def test_a_day_to_come_is_refused(files: Any) -> None:
    """Of the calibration as of its receipt and issue; nothing is written."""
    text = Path("lab.toml").read_text("utf-8")
    for key in ("performed_from", "issued"):
        lines = [line for line in text.splitlines() if not line.startswith(key)]
        Path("late.toml").write_text("\n".join(lines).replace("[order]", f"[order]\n{key} = 2999-01-01"), "utf-8")
        given = ("--laboratory", "late.toml", "-o", "c.pdf")
        refused = files("certificate", "tool.json", *given)
        assert refused.status == 2
        assert f"late.toml: {key} is 2999-01-01, a day to come; today is 2" in refused.err
        assert not Path("c.pdf").exists()


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
    (("verify.json", "-o", "c.pdf"), "this is a verification (`verify -o`); needed is a calibration"),
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
    done = files("certificate", "tool.json", "-o", "c.pdf")
    assert "titled calibration report, not certificate; missing: the laboratory: name, address" in done.err
    assert done.out.startswith("report ")
    Path("lab.toml").write_text("name = 'x'", encoding="utf-8")
    done = files("certificate", "tool.json", "-o", "c.pdf", "--laboratory", "lab.toml")
    assert "procedure in lab.toml" in done.err
    assert "authoriser in lab.toml" in done.err
    assert done.status == 0


def test_results_as_found_are_those_of_the_calibration_before(files: Any) -> None:
    """The same readings by the old parameters; other positions, or no old calibration, are refused."""
    files("simulate", "bench", "--plan", "twelve", "--tool", "truth.json", "--seed", "9", "-o", "old.csv")
    files("calibrate", "old.csv", "-o", "old.json", "--rig-sd-deg", "0.05")
    files("verify", "check.csv", "--calibration", "old.json", "-o", "found.json")
    given = ("certificate", "tool.json", "-o", "c.pdf", "--record", "c.json", *GIVEN, "--as-found", "found.json")
    done = files(*given)
    assert (done.status, "give --previous and --verification" in done.err) == (2, True)
    done = files(*given, "--previous", "old.json", "--json")
    assert done.status == 0, done.err
    content = json.loads(Path("c.json").read_bytes())
    rows = [content[key]["report"]["positions"] for key in ("as_found", "verification")]
    assert [row["position"] for row in rows[0]] == [row["position"] for row in rows[1]]
    assert rows[0] != rows[1]
    files("simulate", "bench", "--plan", "spread", "--tool", "truth.json", "-o", "other.csv")
    files("verify", "other.csv", "--calibration", "old.json", "-o", "found.json")
    done = files(*given, "--previous", "old.json")
    assert (done.status, "was not verified at the positions of verify.json" in done.err) == (2, True)


def test_a_damaged_verification_is_refused(files: Any) -> None:
    """With the place in the file."""
    text = Path("verify.json").read_text(encoding="utf-8").replace('"verdict": "pass"', '"verdict": "perhaps"')
    Path("verify.json").write_text(text, encoding="utf-8")
    done = files("certificate", "tool.json", "-o", "c.pdf", *GIVEN)
    assert done.status == 2
    assert '$.verdict is "perhaps"; it must be pass or fail' in done.err


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
    done = files("ledger", "laboratory", "settings.toml", "--ledger", "lab.sqlite")
    assert done.status == 0, done.err
    assert "reference standard T2 is past its due date" in done.err
    shown = files("ledger", "laboratory", "--ledger", "lab.sqlite", "--json").json
    assert (shown["procedure"], shown["logo"], shown["standards"][0]["due"]) == ("QP-12", True, "2020-01-31")
    order = LAB.partition("[order]")[2] + 'condition = "good"\n'
    Path("lab.toml").write_text(f'ledger = "lab.sqlite"\n[order]{order}', encoding="utf-8")
    given = ("certificate", "tool.json", "-o", "c.pdf", "--record", "c.json", *GIVEN)
    done = files(*given)
    assert done.status == 0, done.err
    assert "T2 (2020-01-31) had run out" in done.err
    content = json.loads(Path("c.json").read_bytes())
    assert (content["title"], content["missing"]) == ("report", ["standards_due"])
    Path("settings.toml").write_text(about.replace("2020", "2030"), encoding="utf-8")
    assert "past its due date" not in files("ledger", "laboratory", "settings.toml", "--ledger", "lab.sqlite").err
    assert files(*given).out.startswith("certificate ")
    Path("settings.toml").write_text(about.replace("logo.svg", "none.svg"), encoding="utf-8")
    wrong = files("ledger", "laboratory", "settings.toml", "--ledger", "lab.sqlite")
    assert (wrong.status, "none.svg" in wrong.err) == (2, True)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('name = "Lab\\u0007"', "name has the character U+0007 in place 4"),
        ('name = "Lab\\nTwo"', "name has the character U+000A in place 4"),
        ('name = "Lab"\n[order]\ncustomer = "a\\u202eb"', "customer has the character U+202E in place 2"),
    ],
)
def test_what_no_page_shows_is_refused(files: Any, line: str, said: str) -> None:
    """A control character, a line end in a name, a mark that turns the direction."""
    Path("bad.toml").write_text(line + "\n", encoding="utf-8")
    done = files("certificate", "tool.json", "--laboratory", "bad.toml", "-o", "c.pdf")
    assert (done.status, Path("c.pdf").exists()) == (2, False)
    assert f"bad.toml: {said}" in done.err


def test_a_folder_without_fonts_is_refused(files: Any) -> None:
    """One that is not there, and one in which there is none."""
    Path("empty").mkdir()
    for folder, said in (("nowhere", "there is no such folder"), ("empty", "no font is in this folder")):
        done = files("certificate", "tool.json", "--fonts", folder, "-o", "c.pdf")
        assert (done.status, Path("c.pdf").exists()) == (2, False)
        assert said in done.err

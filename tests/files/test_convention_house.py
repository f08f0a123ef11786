"""The convention "native" was once called "house": files, records and options of that time are read for ever."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from tests.refusals import refused

from inclinometry.conventions import current_name, named
from inclinometry.errors import FileError
from inclinometry.files.tool_json import (
    calibration_content,
    read_calibration,
    read_extras,
    read_tool,
    write_calibration,
    write_truth,
)
from inclinometry.files.verification_json import calibration_digest, read_verification
from inclinometry.files.wits0 import read_wits0_map
from inclinometry.laboratory.certificates import verify_certificate
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.exchange import restore
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.verify import verify
from inclinometry.laboratory.registry import find_tool, put_tool
from inclinometry.laboratory.results import calibration_of

OLD = Path(__file__).parents[1] / "reference" / "convention-house"
OLDEST = OLD.parent / "tool-json" / "tool-1.json"


def test_both_names_are_one_convention() -> None:
    """In any case of letters; the old one is never given back."""
    assert named("house") is named("native") is named(" HOUSE ")
    assert named("house").name == "native"
    assert [current_name(name) for name in ("house", "native", "z-up", "")] == ["native", "native", "z-up", ""]


def test_an_old_tool_and_its_old_verification_belong_together() -> None:
    """The digest in verify.json is of the content as it was written then."""
    calibration = read_calibration(OLD / "tool.json")
    found = read_verification(OLD / "verify.json", calibration)
    assert found["verdict"] == "agrees"
    assert found["calibration"] != calibration_digest(calibration)


def test_a_tool_written_anew_still_has_its_old_verification(tmp_path: Path) -> None:
    """The name of the convention is no part of what was calibrated."""
    calibration = read_calibration(OLD / "tool.json")
    write_calibration(calibration, tmp_path / "tool.json")
    found, old = (json.loads((folder / "tool.json").read_text("utf-8")) for folder in (tmp_path, OLD))
    said = [(one["code"], one["values"]["text"]) for one in found["findings"]]
    assert said == [("record-text", text) for text in (*old["warnings"], *old.get("notes", ()))]
    apart = {"convention", "version", "warnings", "notes", "findings"}
    assert {key: old[key] for key in old.keys() - apart} == {key: found[key] for key in found.keys() - apart}
    assert (found["convention"], found["version"]) == ("native", 3)
    read_verification(OLD / "verify.json", read_calibration(tmp_path / "tool.json"))


def test_an_old_verification_is_of_no_other_calibration(tmp_path: Path) -> None:
    """One digit more or less is another calibration, under either name."""
    for name in ("house", "native"):
        content = json.loads((OLD / "tool.json").read_text("utf-8"))
        content["triads"]["magnetometer"]["offset"][0] += 1e-9
        content["convention"] = name
        (tmp_path / "tool.json").write_text(json.dumps(content), encoding="utf-8")
        with refused("record-calibration-other", error=FileError):
            read_verification(OLD / "verify.json", read_calibration(tmp_path / "tool.json"))


def test_the_first_reference_file_is_read_and_written_in_the_new_word() -> None:
    """tool-1.json says house."""
    assert json.loads(OLDEST.read_text("utf-8"))["convention"] == "house"
    assert calibration_content(read_calibration(OLDEST))["convention"] == "native"


def test_an_old_truth_is_read(tmp_path: Path) -> None:
    """And written in the new word."""
    write_truth(read_tool(OLD / "truth.json"), read_extras(OLD / "truth.json"), tmp_path / "truth.json")
    old = (OLD / "truth.json").read_text("utf-8")
    assert (tmp_path / "truth.json").read_text("utf-8") == old.replace('"house"', '"native"')


@pytest.fixture
def ledger(tmp_path: Path) -> Any:
    """The old export in a new ledger."""
    with create(tmp_path / "ledger.sqlite") as made:
        restore(made, OLD / "export.zip")
        yield made


def test_an_old_ledger_is_sound(ledger: Ledger) -> None:
    """Chain, calibration and certificate; nothing recorded is changed."""
    assert verify(ledger).ok
    (record,) = ledger.find("calibration")
    assert record.body["tool_json"]["convention"] == "house"
    assert calibration_content(calibration_of(record))["convention"] == "native"
    assert verify_certificate(ledger, "2026-0001") == []


def test_a_registered_tool_is_read_and_recorded_in_the_new_word(ledger: Ledger) -> None:
    """A change of it records the new name."""
    tool = find_tool(ledger, "IN-7")
    assert tool is not None
    assert tool.convention == "native"
    assert ledger.find("tool")[0].body["convention"] == "house"
    assert put_tool(ledger, tool, author="anna").body["convention"] == "native"


def test_an_old_map_of_a_stream_is_read(tmp_path: Path) -> None:
    """WITS maps name a convention."""
    (tmp_path / "map.toml").write_text('convention = "house"\n[channels]\n0708 = "md_m"\n', encoding="utf-8")
    assert read_wits0_map(tmp_path / "map.toml").convention == "native"

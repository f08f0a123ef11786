"""Why a file is refused, in the language of the page: usual reasons of systems and libraries are words of ours."""

from __future__ import annotations

import errno

import pytest

from inclinometry.errors import FileError, system_reason
from inclinometry.files import json_codec, toml_keys
from inclinometry.findings import LANGUAGES, Finding, say


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ('{"a": }', "a value is missing"), ('{"a": 1 "b": 2}', "a comma or a closing bracket is missing"),
        ('{"a" 1}', "a colon is missing"), ('{"a": 1} x', "text after the end"),
        ("{a: 1}", "a name in double quotes is missing"), ('{"a": "b}', "a closing quote is missing"),
        ('{"a": "b\n"}', "a character that must be escaped"), ('{"a": "\\q"}', "not a valid escape"),
    ],
)  # fmt: skip
def test_json(tmp_path, content, reason):
    path = tmp_path / "a.json"
    path.write_text(content, "utf-8")
    with pytest.raises(FileError) as refusal:
        json_codec.load(path)
    found = refusal.value.finding
    assert (found.code, found.values["reason"].values["reason"], refusal.value.line) == ("file-format", reason, 1)
    assert len({say(found, language) for language in LANGUAGES}) == 3
    assert reason not in say(found, "ru")


@pytest.mark.parametrize(
    ("content", "reason", "line"),
    [
        ("a = \n", "not a valid value", 1), ("a\n", "'=' is missing after a name", 1),
        ("a = 1 2", "text after the end of a value", 1), ("= 1", "not a valid line", 1),
        ("a = 1\na = 2", "the name occurs twice", 2), ("a = [1", "a closing bracket is missing", 1),
        ('a = "b', "a closing quote is missing", 1), ("[a\n", "a closing bracket is missing", 1),
    ],
)  # fmt: skip
def test_toml(tmp_path, content, reason, line):
    path = tmp_path / "a.toml"
    path.write_text(content, "utf-8")
    with pytest.raises(FileError) as refusal:
        toml_keys.load(path, ["a"])
    found = refusal.value.finding
    assert (found.code, found.values["reason"].values["reason"], refusal.value.line) == ("file-format", reason, line)
    assert reason not in say(found, "ru")


def test_errors_of_the_system():
    assert system_reason(PermissionError(errno.EACCES, "Permission denied")) == "permission denied"
    assert system_reason(OSError(errno.EIO, "Input/output error")) == "Input/output error"
    assert system_reason(ValueError("a NUL character")) == "a NUL character"
    found = Finding("file-unreadable", {"reason": system_reason(PermissionError(errno.EACCES, "Permission denied"))})
    assert "нет прав доступа" in say(found, "ru")
    assert "没有权限" in say(found, "zh")

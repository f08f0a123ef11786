"""JSON records: one spelling for one content, and every refusal with its place in the file."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files import json_codec
from inclinometry.files.json_codec import canonical, load, of_kind, shown


def test_one_spelling():
    content = {"b": np.float64(1.0), "a": [1, "x", None, True], "deep": {"none": {}, "rows": [[1.5], []]}}
    deep = '{\n  "none": {},\n  "rows": [\n   [1.5],\n   []\n  ]\n }'
    text = f'{{\n "a": [1, "x", null, true],\n "b": 1.0,\n "deep": {deep}\n}}\n'
    assert canonical(content) == text.encode()
    assert canonical(json.loads(text)) == text.encode()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"a": [1.0, np.nan]}, "input-finite $.a[1]"),
        ({"a": {"b": np.inf}}, "input-finite $.a.b"),
        ({"a": {1: 2}}, "input-kind $.a"),
        ({"a": {1: 2, "1": 3}}, "input-kind $.a"),
        ({"a": b"x"}, "input-kind $.a"),
        ({"a": "\ud800"}, "file-format"),
    ],
)
def test_what_json_cannot_hold(content, words):
    with refused(words):
        canonical(content)


@pytest.mark.parametrize(
    ("data", "line", "words"),
    [
        (b"[1]", None, "input-kind $"),
        (b"null", None, "input-kind $"),
        (b"true", None, "input-kind $"),
        (b'"a"', None, "input-kind $"),
        (b"1.5", None, "input-kind $"),
        (b'{"a": 1,\n"b": }', 2, "file-format"),
        (b'{"a": 1, "a": 2}', None, "file-format"),
        (b'{"a": NaN}', None, "file-format"),
        (b'{"a": 1e999}', None, "file-format"),
        (b'{"a": "\xff"}', None, "file-format"),
        (b"[" * 100_000, None, "file-format"),
    ],
)
def test_files_that_hold_no_record(tmp_path, data, line, words):
    (tmp_path / "a.json").write_bytes(data)
    with refused(words, error=FileError) as caught:
        load(tmp_path / "a.json")
    assert caught.value.line == line


def test_files_that_cannot_be_read_and_a_mark_before_the_text(tmp_path):
    for path, code in (
        (tmp_path / "a.json", "file-absent"),
        (tmp_path, "file-not-file"),
        ("a\0b", "file-unreadable"),
    ):
        with refused(code, error=FileError):
            load(path)
    (tmp_path / "a.json").write_bytes(b"\xef\xbb\xbf{}")
    assert load(tmp_path / "a.json") == {}


def test_the_shipped_schemas_are_valid():
    names = [path.stem for path in (Path(json_codec.__file__).parent / "schemas").glob("*.json")]
    assert len(names) > 15
    for name in names:
        jsonschema.Draft202012Validator.check_schema(json_codec.schema(name))


def test_another_kind_and_a_newer_version():
    kinds = ("inclinometry/tool", "inclinometry/truth")
    with refused("record-kind", error=FileError):
        of_kind({}, "a.json", *kinds)
    with refused("record-kind", error=FileError):
        of_kind({"schema": "inclinometry/allan"}, "a.json", *kinds)
    with refused("file-version", error=FileError):
        of_kind({"schema": "inclinometry/tool", "version": 3}, "a.json", *kinds, version=2)
    for version in (0, True, "1", None):
        with refused("input-missing", error=FileError, names=("$.tool",)):
            of_kind({"schema": "inclinometry/tool", "version": version}, "a.json", *kinds, version=2)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("x" * 58, '"' + "x" * 58 + '"'),
        ("x" * 59, '"' + "x" * 55 + '..."'),
        (list(range(30)), "a list of 30 entries"),
        ({str(k): k for k in range(30)}, "an object of 30 entries"),
        (int("9" * 61), "9" * 57 + "..."),
        ([None, True], "[null, true]"),
    ],
)
def test_values_in_messages_stay_short(value, text):
    assert shown(value) == text

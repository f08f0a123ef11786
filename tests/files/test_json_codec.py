"""JSON records: one spelling for one content, and every refusal with its place in the file."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from inclinometry.errors import FileError, InputError
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
        ({"a": [1.0, np.nan]}, r"\$.a\[1\] is nan"),
        ({"a": {"b": np.inf}}, r"\$.a.b is inf"),
        ({"a": {1: 2}}, r"\$.a: the keys \[1\] are not distinct texts"),
        ({"a": {1: 2, "1": 3}}, "are not distinct texts"),
        ({"a": b"x"}, r"\$.a is a bytes"),
        ({"a": "\ud800"}, "is not Unicode"),
    ],
)
def test_what_json_cannot_hold(content, words):
    with pytest.raises(InputError, match=words):
        canonical(content)


@pytest.mark.parametrize(
    ("data", "line", "words"),
    [
        (b"[1]", None, r"holds \[1\]; an object of JSON is needed"),
        (b"null", None, "holds null; an object of JSON is needed"),
        (b"true", None, "holds true; an object of JSON is needed"),
        (b'"a"', None, 'holds "a"; an object of JSON is needed'),
        (b"1.5", None, "holds 1.5; an object of JSON is needed"),
        (b'{"a": 1,\n"b": }', 2, r"not JSON: Expecting value \(column 6\)"),
        (b'{"a": 1, "a": 2}', None, "key 'a' appears twice in one object"),
        (b'{"a": NaN}', None, "NaN is not a number JSON allows"),
        (b'{"a": 1e999}', None, "1e999 is too large"),
        (b'{"a": "\xff"}', None, "not UTF-8 text .byte 7."),
        (b"[" * 100_000, None, "not usable JSON"),
    ],
)
def test_files_that_hold_no_record(tmp_path, data, line, words):
    (tmp_path / "a.json").write_bytes(data)
    with pytest.raises(FileError, match=words) as caught:
        load(tmp_path / "a.json")
    assert caught.value.line == line


def test_files_that_cannot_be_read_and_a_mark_before_the_text(tmp_path):
    for path, words in (
        (tmp_path / "a.json", "no such file"),
        (tmp_path, "this is a folder; give the name of a file"),
        ("a\0b", "cannot be read"),
    ):
        with pytest.raises(FileError, match=words):
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
    with pytest.raises(FileError, match=r"it states no schema; needed is a calibration or .* `calibrate -o` or `sim"):
        of_kind({}, "a.json", *kinds)
    with pytest.raises(FileError, match="this is noise by Allan deviation"):
        of_kind({"schema": "inclinometry/allan"}, "a.json", *kinds)
    with pytest.raises(FileError, match=r"\$.version is 3, written by a newer release; this one reads version 2"):
        of_kind({"schema": "inclinometry/tool", "version": 3}, "a.json", *kinds, version=2)
    for version in (0, True, "1", None):
        with pytest.raises(FileError, match=r"\$"):
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

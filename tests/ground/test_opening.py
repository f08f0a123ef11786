"""Files as they are opened, their digests, and errors that say where they happened."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from tests.refusals import refused

from inclinometry.digest import digest_bytes, digest_file
from inclinometry.errors import ConvergenceError, FileError, IdentifiabilityError, InclinometryError, InputError
from inclinometry.files import json_codec, toml_keys
from inclinometry.findings import Finding
from inclinometry.opening import LARGEST_SETTINGS, opened, whole

UNIX = pytest.mark.skipif(sys.platform == "win32", reason="devices and pipes of Unix")


def test_a_file_up_to_its_size_and_one_byte_more(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"x" * 1000)
    assert whole(path, 1000) == b"x" * 1000
    with refused("file-large", error=FileError):
        whole(path, 999)


@pytest.mark.parametrize(("read", "largest"), [
    (json_codec.load, 20_000_000), (lambda path: toml_keys.load(path, ()), LARGEST_SETTINGS),
])  # fmt: skip
def test_a_huge_file_is_not_read(tmp_path, read, largest):
    # sparse: it takes no room on the disk, and would take all of the memory
    with (tmp_path / "huge").open("wb") as stream:
        stream.truncate(1 << 40)
    with refused("file-large", error=FileError):
        read(tmp_path / "huge")


@UNIX
@pytest.mark.parametrize("read", [json_codec.load, lambda path: toml_keys.load(path, ()), digest_file])
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom"])
def test_a_device_has_no_end(read, device):
    with refused("file-not-file", error=FileError):
        read(device)


@UNIX
def test_a_pipe_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with refused("file-not-file", error=FileError):
        whole(tmp_path / "pipe", 1000)


@UNIX
def test_what_the_system_says_of_a_name(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for path, said in (
        (tmp_path / "none", "file-absent"),
        (tmp_path, "file-not-file"),
        (tmp_path / ("x" * 300), "file-unreadable"),
        (tmp_path / "file" / "below", "file-unreadable"),
        (tmp_path / "loop", "file-unreadable"),
        ("a\0b", "file-unreadable"),
    ):
        with refused(said, error=FileError), opened(path):
            pass


# FIPS 180-2, appendix B.1
ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_published_vector():
    assert digest_bytes(b"abc") == f"sha256:{ABC}"


def test_a_file_has_the_digest_of_its_bytes(tmp_path):
    data = bytes(range(256)) * 5000  # longer than one buffer
    path = tmp_path / "data.bin"
    path.write_bytes(data)
    assert digest_file(path) == digest_file(str(path)) == digest_bytes(data)


def test_a_file_error_names_file_and_line():
    found = Finding("file-absent")
    error = FileError(found, path="bench.csv", line=3)
    assert str(error) == f"bench.csv, line 3: {found}"
    assert (error.path, error.line) == (Path("bench.csv"), 3)
    assert error.finding == found._replace(severity="refused")
    assert str(FileError(found, path="bench.csv")) == f"bench.csv: {found}"


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (InputError, ValueError),
        (FileError, InputError),
        (IdentifiabilityError, ValueError),
        (ConvergenceError, ArithmeticError),
    ],
)
def test_each_is_also_the_builtin_a_caller_expects(kind, builtin):
    assert issubclass(kind, InclinometryError)
    assert issubclass(kind, builtin)

"""A file is written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.writing import replacing, write_bytes, write_text


def names(folder):
    return [entry.name for entry in folder.iterdir()]


def write_half(path, blow):
    with replacing(path) as stream:
        stream.write(b"half of the new")
        stream.flush()
        raise blow


@pytest.mark.parametrize("blow", [KeyboardInterrupt, SystemExit, ValueError, MemoryError])
def test_an_interrupted_write_leaves_what_was_there(tmp_path, blow):
    path = tmp_path / "a.txt"
    write_text("old", path)
    with pytest.raises(blow):
        write_half(path, blow)
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_nothing_appears_when_the_first_write_is_interrupted(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        write_half(tmp_path / "a.txt", KeyboardInterrupt)
    assert names(tmp_path) == []


def test_the_target_is_untouched_until_the_end(tmp_path):
    path = tmp_path / "a.txt"
    write_bytes(b"old", path)
    with replacing(path) as stream:
        stream.write(b"new")
        stream.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"


def test_a_full_disk_is_a_file_error(tmp_path, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with refused("file-unwritable", error=FileError):
        write_text("text", tmp_path / "a.txt")
    assert names(tmp_path) == []


def test_places_that_cannot_be_written(tmp_path):
    with refused("file-folder-absent", error=FileError):
        write_text("x", tmp_path / "none" / "a.txt")
    with refused("file-not-file", error=FileError):
        write_text("x", tmp_path)
    with refused("file-unwritable", error=FileError):
        write_text("x", "a\0b")
    with refused("file-text", error=FileError):
        write_text("\ud800", tmp_path / "a.txt")
    assert names(tmp_path) == []


def test_a_folder_without_permission(tmp_path, monkeypatch):
    def denied(self, *_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", denied)
    with refused("file-unwritable", error=FileError):
        write_text("x", tmp_path / "a.txt")


def test_links_and_permissions_are_kept(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    write_text("old", real)
    real.chmod(0o640)
    link.symlink_to(real)
    write_text("new", link)
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert real.stat().st_mode & 0o777 == 0o640


def test_a_device_is_written_directly():
    write_text("x", os.devnull)
    assert not Path(os.devnull).is_file()

"""A fleet's files as they are opened: they end, or they are named."""

from __future__ import annotations

from pathlib import Path

from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.fleet.store import Store


def test_what_is_no_file_is_named_and_not_read(tmp_path: Path) -> None:
    """A device in the place of a raw file would be read for ever; a folder, nothing at all."""
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "zero").symlink_to("/dev/zero")
    for name, said in (
        ("raw/zero", "file-not-file"),
        ("raw", "file-not-file"),
        ("raw/none", "file-absent"),
    ):
        with refused(said, error=FileError), Store(str(tmp_path)).reading(name):
            pass

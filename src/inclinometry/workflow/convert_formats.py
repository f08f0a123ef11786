"""Formats that hold several surveys, or need more than a file to be read: what reads and writes them as one survey."""

from __future__ import annotations

from pathlib import Path

from inclinometry.errors import FileError
from inclinometry.files import p7, wits0
from inclinometry.files.survey_file import SurveyFile
from inclinometry.findings import Finding


def write_p7(file: SurveyFile, path: str | Path) -> None:
    """Write a survey as the only one of a P7/17 file; errors as `files.p7.write_p7`."""
    p7.write_p7(p7.p7_file(file), path)


def read_wits(
    path: str | Path,
    *,
    channels: str | Path | None = None,
    azimuth_reference: str | None = None,
    depth_unit: str | None = None,
) -> SurveyFile:
    """The survey in a WITS level 0 stream, by a map of its items in TOML or as record 7; else as `wits0.read_wits0`."""
    if channels is None:
        return wits0.read_record_7(path, depth_unit, azimuth_reference)
    return wits0.read_wits0(path, wits0.read_wits0_map(channels))


def write_wits(file: SurveyFile, path: str | Path, *, channels: str | Path | None = None) -> None:
    """Write a survey as a WITS level 0 stream; errors as `files.wits0.write_wits0`."""
    if channels is None:
        raise FileError(Finding("input-missing", {"names": ("--map",)}), path=path)
    wits0.write_wits0(file, path, wits0.read_wits0_map(channels))

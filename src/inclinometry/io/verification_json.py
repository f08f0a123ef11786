"""verify.json: the verdict of a verification with every position, as a certificate takes it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from inclinometry.calibration.result import Calibration
from inclinometry.core.digest import digest_bytes
from inclinometry.core.errors import FileError
from inclinometry.io import _json
from inclinometry.io.atomic import write_bytes
from inclinometry.io.tool_json import calibration_content

SCHEMA: Final = "inclinometry/verification"
VERSION: Final = 1


def calibration_digest(calibration: Calibration) -> str:
    """What binds a verification to its calibration: the digest of its content, however the file was spelled."""
    return digest_bytes(_json.canonical(calibration_content(calibration)))


def write_verification(
    path: str | Path,
    calibration: Calibration,
    *,
    verdict: str,
    limits: Mapping[str, Any],
    report: Mapping[str, Any],
    inputs: Mapping[str, str],
    program: str,
) -> None:
    """Write verify.json; the same verification gives the same bytes.

    Parameters
    ----------
    calibration : Calibration
        That was verified.
    verdict : str
        "pass" or "fail".
    limits, report : mapping
        Degrees, as a verification is recorded in a ledger.
    inputs : mapping
        Name -> digest.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    content = {
        "schema": SCHEMA,
        "version": VERSION,
        "tool": calibration.tool.name,
        "calibration": calibration_digest(calibration),
        "verdict": verdict,
        "limits": limits,
        "report": report,
        "inputs": inputs,
        "program": program,
    }
    write_bytes(_json.canonical(content), path)


def read_verification(path: str | Path, calibration: Calibration) -> dict[str, Any]:
    """Read verify.json of this calibration.

    Raises
    ------
    FileError
        Another kind of file, a newer version, content the schema refuses, a verification of another tool or of another
        calibration.
    """
    content = _json.of_kind(_json.load(path), path, SCHEMA, version=VERSION)
    if content["tool"] != calibration.tool.name:
        raise FileError(
            f"this verification is of tool {content['tool']!r:.60}, the calibration of {calibration.tool.name!r:.60}",
            path=path,
        )
    if content["calibration"] != calibration_digest(calibration):
        raise FileError("this verification was made with another calibration of the tool; verify again", path=path)
    return content

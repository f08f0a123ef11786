"""From a finished session to a recorded calibration, and what the calibrations of a tool say over the years."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.expected import ALL_ANGLES, certified_factor, expanded, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.constants import INCLINATIONS
from inclinometry.errors import InclinometryError, InputError
from inclinometry.files.json_codec import canonical
from inclinometry.files.tool_json import calibration_content, calibration_from
from inclinometry.files.writing import program
from inclinometry.laboratory.ledger.ledger import Draft, Ledger, LedgerError, Record
from inclinometry.laboratory.progress import Goal, session_progress
from inclinometry.laboratory.registry import extract, find_site, listed, rig_of
from inclinometry.laboratory.session import Session, close_session_draft, load_session, unless_closed
from inclinometry.sensors import parameter_vector

_DIALS: Final = {
    "--inclination-from vertical": "the inclination from the vertical",
    "--inclination-from other-end": "the inclination from the other end",
    "--inclination-from horizontal": "the inclination from the horizontal",
    "--inclination-from horizontal-up": "the inclination from the horizontal, positive above",
    "--azimuth-counts clockwise": "the azimuth clockwise",
    "--azimuth-counts counterclockwise": "the azimuth counterclockwise",
    "--toolface-counts clockwise": "the toolface clockwise",
    "--toolface-counts counterclockwise": "the toolface counterclockwise",
}
_ONE: Final = r"--(?:inclination-from|azimuth-counts|toolface-counts) [a-z-]+"
_ELSEWHERE: Final = r"--(?:(?:level|north|dip|latitude|rig)(?:-sd)?-deg|site|nameplate|stand (?:fit|level|same))"
"""Options of calibrate and verify that the bench does not have."""
_STATED: Final = (
    # the longest first: what follows is part of it
    (
        "State it, or put the column right.",
        "State it on the rig (More, Rigs): the readings stay, and are judged anew.",
    ),
    ("--left-handed states that the channels are so", "a session begun with left-handed channels states that they are"),
    (
        "(--dip-deg, dip_deg in --site, the column reference_dip_deg, or the form of the bench)",
        "(the dip of the site, or the form that begins a calibration)",
    ),
    ("(--dip-deg)", "(the dip of the site)"),
    ("(latitude_deg in --site)", "(the latitude of the site)"),
    ("state the dials, or verify", "state them on the rig (More, Rigs), or verify"),
)


def at_the_bench(sentence: str) -> str:
    """A sentence with each option of the command line replaced by what states it in the bench.

    An option that the bench does not have is said to be of the command line.

    Examples
    --------
    >>> at_the_bench("with --azimuth-counts counterclockwise --toolface-counts counterclockwise the readings fit")
    'with dials that count the azimuth counterclockwise and the toolface counterclockwise the readings fit'
    >>> at_the_bench("(state it with --north-deg)")
    '(state it with calibrate --north-deg at the command line)'
    """
    if "--" not in sentence:
        return sentence
    for said, instead in _STATED:
        sentence = sentence.replace(said, instead)

    def dials(found: re.Match[str]) -> str:
        options = re.findall(_ONE, found[0])
        return f"dials that count {' and '.join(_DIALS.get(option, option) for option in options)}"

    sentence = re.sub(rf"{_ONE}(?: {_ONE})*", dials, sentence)

    def elsewhere(found: re.Match[str]) -> str:
        command = "verify" if found[0].startswith("--stand") else "calibrate"
        return f"{command} {found[0]} at the command line"

    return re.sub(_ELSEWHERE, elsewhere, sentence)


def finish_calibration(
    ledger: Ledger, session: str, *, author: str, goal: Goal | None = None, estimate_rig: bool = False
) -> Record:
    """Fit the session's readings, record the calibration and close the session, in one step.

    Raises
    ------
    LedgerError
        The session is closed, or its readings cannot be fitted; says why.
    """
    # what is said of readings that are all alike, or whose fit has no usable uncertainty
    unturned = "they do not determine the tool; was it turned to each position?"
    seen = load_session(ledger, session)
    if seen.closed:
        raise LedgerError("this session is closed already")
    rig = rig_of(ledger, session)
    if rig is None:
        raise LedgerError(f"rig {seen.rig!r} is not registered; register it first")
    if len(seen.valid) > 1 and _distinct(seen) == 1:
        raise LedgerError(f"these readings do not make a calibration: {unturned}")
    site = find_site(ledger, str(seen.settings.get("site", "")))
    now = session_progress(seen, goal or Goal(), rig, site, estimate_rig=estimate_rig)
    if now.calibration is None:
        raise LedgerError(f"these readings do not make a calibration: {now.waiting}")
    found = now.calibration
    if not np.isfinite(found.covariance).all() or (np.diagonal(found.covariance) < 0.0).any():
        raise LedgerError(f"these readings do not make a calibration: {unturned}")
    outliers = {str(number): sentence for number, sentence in now.outliers.items()}
    return record_fit(ledger, seen, found, author=author, outliers=outliers)


def record_fit(
    ledger: Ledger,
    seen: Session,
    found: Calibration,
    *,
    author: str,
    outliers: Mapping[str, str] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Record:
    """Record what was fitted to the readings of a session and close it, in one step.

    Parameters
    ----------
    outliers : mapping of position to sentence
    settings : mapping, optional
        What else the record is to say of how it was made.

    Raises
    ------
    LedgerError
        The session is closed, or the calibration could not be read again.
    """
    content = plain_content(found)
    # nothing is recorded that could not be read again, for what is recorded stays
    try:
        calibration_from(json.loads(canonical(dict(content))), "the fit")
    except InclinometryError as error:
        raise LedgerError(f"these readings do not make a calibration: {error}") from None
    body = {
        **({"settings": dict(settings)} if settings else {}),
        "tool_json": content,
        "method": found.method,
        "readings": [row.record for row in seen.valid],
        "capability_deg": expected_table(found),
        "summary": {
            "rig": seen.rig,
            "plan": seen.plan,
            "positions": len(seen.valid),
            "warnings": list(found.warnings),
            "outliers": dict(outliers or {}),
            "parameters": [[name, *pair] for name, pair in parameters(found).items()],
        },
        "program": program(),
    }
    drafts = [
        Draft("calibration", {"serial": seen.serial, "session": seen.id}, body),
        close_session_draft(seen.id, "finished"),
    ]
    return ledger.append_all(drafts, author=author, unless=[unless_closed(seen.id)])[0]


def _distinct(seen: Session) -> int:
    """How many readings differ from each other in any sensor."""
    return len({tuple((kind, v.tobytes()) for kind, v in sorted(row.capture.channels.items())) for row in seen.valid})


def plain_content(calibration: Calibration) -> dict[str, Any]:
    """The content of its tool.json as plain lists and mappings."""
    content: dict[str, Any] = json.loads(canonical(calibration_content(calibration)))
    return content


def calibration_of(record: Record) -> Calibration:
    """The calibration of a record of that kind."""
    return calibration_from(dict(record.body["tool_json"]), f"calibration {record.id}")


def expected_table(calibration: Calibration) -> dict[str, Any]:
    """Expanded uncertainties over inclination, worst azimuth and toolface, degrees: of one reading, and below
    "from_calibration" from the calibration alone; empty for a tool that can give no angle.
    """
    found = expected_uncertainty(calibration, INCLINATIONS)
    if not found.angles:
        return {}
    k = certified_factor(calibration)
    one, alone = (np.degrees(expanded(u, k)) for u in (found.of_one_reading, found.from_calibration))
    columns = {f"U_{name}_deg": ALL_ANGLES.index(name) for name in found.angles}
    return {
        "coverage_factor": k,
        "inclination_deg": np.degrees(INCLINATIONS).round(9).tolist(),
        **{key: one[:, place].tolist() for key, place in columns.items()},
        "from_calibration": {key: alone[:, place].tolist() for key, place in columns.items()},
    }


@dataclass(frozen=True, eq=False)
class History:
    """The calibrations of one tool, by the day of their readings.

    measured : last day of the readings of each; created : UTC of its record; records : their ids.
    values, u : parameter -> (n,) estimate and standard uncertainty, in the parameter's unit; NaN where a calibration
        does not have it.
    """

    serial: str
    measured: Sequence[date]
    created: Sequence[str]
    records: Sequence[str]
    values: Mapping[str, Array]
    u: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.created)

    def change(self, parameter: str) -> tuple[Array, Array]:
        """Change of a parameter since the first calibration and its standard uncertainty; two runs are independent."""
        value, u = self.values[parameter], self.u[parameter]
        spread = np.sqrt(u**2 + u[0] ** 2)
        spread[0] = 0.0
        return value - value[0], spread


def history(ledger: Ledger, serial: str, *, limit: int = 200) -> History:
    """How the parameters of a tool went from calibration to calibration.

    Raises
    ------
    InputError
        A tool that was never calibrated.
    """
    records = listed(ledger, "calibration", serial=serial, limit=limit)
    if not records:
        raise InputError(f"tool {serial!r} has no calibration in this ledger")
    days = {
        r.id: extract(
            ledger, r, "measured", lambda one: measured(ledger, one, ledger.get("session", one.keys["session"]))
        )
        for r in records
    }
    records.sort(key=lambda r: (days[r.id][1], r.seq))
    found = [extract(ledger, record, "parameters", recorded_parameters) for record in records]
    names = list(dict.fromkeys(name for one in found for name in one))
    values = {name: np.full(len(found), np.nan) for name in names}
    u = {name: np.full(len(found), np.nan) for name in names}
    for row, one in enumerate(found):
        for name, (value, sd) in one.items():
            values[name][row], u[name][row] = value, sd
    ids = [r.id for r in records]
    return History(serial, [days[name][1] for name in ids], [r.created for r in records], ids, values, u)


def measured(ledger: Ledger, calibration: Record, session: Record) -> tuple[date, date]:
    """First and last day of the readings of a calibration; of a file that was brought in later, the day stated with it.

    Without either the day of the record.
    """
    elsewhere = session.body.get("settings", {}).get("performed")
    days = [elsewhere] if elsewhere else [ledger.get("reading", name).created for name in calibration.body["readings"]]
    found = sorted(date.fromisoformat(day[:10]) for day in days or [calibration.created])
    return found[0], found[-1]


def recorded_parameters(record: Record) -> dict[str, tuple[float, float]]:
    """Parameter -> (estimate, standard uncertainty) of a recorded calibration, from its summary where it has one."""
    summary = record.body.get("summary", {}).get("parameters")
    if summary:
        return {str(name): (float(value), float(sd)) for name, value, sd in summary}
    return parameters(calibration_of(record))


def parameters(calibration: Calibration) -> dict[str, tuple[float, float]]:
    """Parameter of the tool -> (estimate, standard uncertainty), in the parameter's unit."""
    tool = calibration.tool
    estimate = np.concatenate([parameter_vector(triad) for triad in tool.triads.values()])
    sd = np.sqrt(np.diagonal(tool.covariance))
    return dict(zip(tool.parameter_names, zip(estimate.tolist(), sd.tolist(), strict=True), strict=True))

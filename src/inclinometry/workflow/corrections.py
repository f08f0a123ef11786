"""Corrections of six-axis stations by name, in the order the user gives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.errors import FileError, InputError, in_file, not_among, refused
from inclinometry.files.corrections_json import read_corrections
from inclinometry.findings import Finding, Value
from inclinometry.sensors import Tool
from inclinometry.survey.flags import Check
from inclinometry.survey.multistation import Parameter, beyond_errors
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.quality_wiring import wiring_check
from inclinometry.survey.reduce import SensorCorrection
from inclinometry.survey.sag import Bha
from inclinometry.survey.stations import Stations

# Whether a run may be corrected, and whether the estimate of an analysis may be believed and used for this run.

LARGEST: Final = 0.2
"""Share of the reference by which the run's |g| or |b| may be off and still be corrected."""


def refuse_uncorrectable(stations: Stations, reference: FieldReference) -> None:
    """Refuse stations with wrong units, axes or signs: a correction would take the mistake for a sensor error.

    The median |g| or |b| is off by more than a fifth, or other axes and signs explain the dips. Dips that no exchange
    of axes explains are left to the corrections: interference does that.
    """
    for name, unit, fields, wanted in (
        ("gravity", "m/s2", stations.g, reference.g),
        ("|b|", "nT", stations.b, reference.b),
    ):
        found = float(np.median(np.linalg.norm(fields, axis=1)))
        if abs(found / wanted - 1.0) > LARGEST:
            raise beyond_errors(name, unit, found, wanted)
    wiring = wiring_check(stations, reference.dip)
    if wiring.verdict == "fail" and explained(wiring):
        raise InputError(wiring.reason)


def explained(wiring: Check) -> bool:
    """Whether a mistake of axes or signs explains a failed check of the wiring."""
    return wiring.reason.code == "survey-wiring-axes"


def unsettled(wiring: Check) -> list[Finding]:
    """A warning where axes and signs are not known to be right before a correction that takes them for right."""
    return [] if wiring.verdict == "pass" else [wiring.reason]


def refuse_beyond(parameters: Mapping[str, Parameter]) -> None:
    """Refuse an estimate beyond ten times its prior; the message names the one farthest out."""
    out = {name: abs(p.value) / p.prior for name, p in parameters.items() if p.prior > 0.0}
    name = max(out, key=lambda one: out[one], default="")
    # prior standard deviations from which an estimate is no sensor error but a wrong unit, axis or reference
    beyond = 10.0
    if not name or out[name] <= beyond:
        return
    p = parameters[name]
    factor, unit = (np.degrees(1.0), "deg") if p.unit == "rad" else (1.0, p.unit)
    raise refused(
        "work-estimate", {"name": name, "value": factor * p.value, "unit": unit, "times": out[name], "most": beyond}
    )


def matching_correction(
    path: str | Path, tool: str, inputs: Mapping[str, str], stations: Stations
) -> tuple[SensorCorrection, list[Finding]]:
    """A stored correction that may be used for these stations, and findings against it; `inputs` are digests.

    Refused: another tool or calibration; other depths, unless the tool is calibrated and the same; an estimate beyond
    ten times its prior.
    """
    correction = read_corrections(path)
    digests = (correction.inputs.get("tool"), inputs.get("tool"))
    if correction.tool != tool or digests[0] != digests[1]:
        tools = zip((correction.tool, tool), digests, strict=True)
        its, own = (f"{name or '-'} (tool.json {(digest or '-')[:8]})" for name, digest in tools)
        raise FileError(Finding("work-other-tool", {"name": "correction", "its": its, "own": own}), path=path)
    try:
        refuse_beyond(correction.parameters)
    except InputError as error:
        raise in_file(error, path) from None
    raw = inputs.get("raw")
    if raw is not None and correction.inputs.get("raw") == raw:
        return correction, list(correction.findings)
    (first, last), (top, bottom) = correction.md, (float(stations.md[0]), float(stations.md[-1]))
    made: dict[str, Value] = {"stations": correction.stations, "from_m": float(first), "to_m": float(last)}
    if (bottom < first or top > last) and not tool:
        raise FileError(Finding("work-other-run", {**made, "top_m": top, "bottom_m": bottom}), path=path)
    return correction, [Finding("survey-correction-other", made), *correction.findings]


CORRECTIONS: Final = ("axial", "msa", "sag")
"""The corrections by the names used at the command line."""


def correction_steps(text: str | None) -> list[tuple[str, str | None]]:
    """The corrections of a list such as "axial,msa,sag", in its order; a corrections.json does what "msa" does.

    axial after msa is refused: the analysis has estimated the axial field, which the axial correction would discard.
    """
    parts = [part.strip() for part in (text or "").split(",") if part.strip()]
    steps: list[tuple[str, str | None]] = [
        ("msa", part) if part.lower().endswith(".json") else (part.lower(), None) for part in parts
    ]
    names = [name for name, _ in steps]
    for place, name in enumerate(names):
        if name not in CORRECTIONS:
            raise not_among("--correct", name, CORRECTIONS)
        if name in names[:place]:
            raise refused("input-repeated", {"name": "--correct", "value": name})
    if text is not None and not names:
        raise refused("input-empty", {"name": "--correct"})
    if "msa" in names and "axial" in names[names.index("msa") :]:
        raise refused("work-axial-last")
    return steps


def corrected(
    stations: Stations, name: str, reference: FieldReference | None, calibration: Tool | None, bha: Bha | None
) -> tuple[Stations, Any]:
    """Stations after one correction, and what it returned; each adds a line to the history and a source of error.

    `reference` is for axial and msa, `calibration` for the priors of msa, `bha` for sag.
    """
    if name == "sag":
        from inclinometry.survey.sag import correct_stations

        if bha is None:
            raise refused("input-needs", {"name": "--correct sag", "needed": ("--bha",)})
        return correct_stations(stations, bha), None
    if reference is None:
        raise refused("input-needs", {"name": f"--correct {name}", "needed": ("g", "b_nT", "dip_deg")})
    if name == "axial":
        from inclinometry.survey.axial import axial_correction

        axial = axial_correction(stations, reference)
        return axial.stations, axial
    from inclinometry.survey.multistation import multistation

    found = multistation(stations, reference, calibration=calibration)
    return found.corrected, found

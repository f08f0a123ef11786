"""The record of a calibration certificate: everything the certificate says, once, as plain JSON values in degrees.

PDF, digital certificate and JSON file are made from it alone, so they cannot contradict each other.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from inclinometry.calibration.expected import ANGLES, expanded, expected_gravity_sd, expected_uncertainty
from inclinometry.calibration.result import Calibration
from inclinometry.core.angles import wrap_signed
from inclinometry.core.constants import COVERAGE_FACTOR, GRAVITY_SPREAD, INCLINATIONS
from inclinometry.core.errors import InputError
from inclinometry.io._json import canonical
from inclinometry.io.certificate_json import SCHEMA, VERSION, checked
from inclinometry.io.laboratory_toml import Laboratory, Order
from inclinometry.report.tables import Row, classical_rows, differences, parameter_rows
from inclinometry.sensors.tool import Tool

LANGUAGES: Final = ("en", "ru", "zh")
RULES: Final = {"none": "simple", "expanded-uncertainty": "guarded"}

Record = dict[str, Any]


def certificate_record(
    calibration: Calibration,
    laboratory: Laboratory | None,
    order: Order,
    *,
    number: str,
    program: str,
    language: str = "en",
    verification: Mapping[str, Any] | None = None,
    previous: Calibration | None = None,
    previous_from: str = "",
    inputs: Mapping[str, str] | None = None,
    head: str | None = None,
    supersedes: str | None = None,
) -> Record:
    """Everything a certificate says.

    Parameters
    ----------
    calibration : Calibration
    laboratory : Laboratory or None
        None leaves a certificate that names no laboratory and says so.
    order : Order
        With the date of issue.
    number : str
        Unique to this certificate.
    verification : mapping, optional
        "verdict", "limits" and "report" as a verification is recorded, degrees.
    previous : Calibration, optional
        Of the same tool, for the values before adjustment; `previous_from` says which.
    inputs : mapping, optional
        Name -> digest of every file or record this was made from, besides those the calibration names.
    head : str, optional
        Head of the ledger's chain when the certificate was issued.

    Returns
    -------
    dict
        JSON values that fit the schema "certificate-1".

    Raises
    ------
    InputError
        An unknown language, no date of issue, a previous calibration of other sensors.
    """
    if language not in LANGUAGES:
        raise InputError(f"language is {language!r:.20}; allowed: {', '.join(LANGUAGES)}")
    if order.issued is None:
        raise InputError("a certificate needs its date of issue")
    tool = calibration.tool
    record: Record = {
        "schema": SCHEMA,
        "version": VERSION,
        "number": number,
        "language": language,
        "laboratory": None if laboratory is None else dict(laboratory.__dict__),
        "customer": {"name": order.customer, "address": order.customer_address, "reference": order.reference},
        "item": _item(tool, order),
        "dates": _dates(order),
        "method": _method(calibration, order),
        "environment": {
            "text": order.environment,
            "temperature_degC": order.temperature_degC,
            "humidity_percent": order.humidity_percent,
        },
        "results": {
            "uncertainty": _uncertainty(calibration),
            "parameters": _parameters(tool),
            "classical": _classical(tool),
            "covariance": {"parameters": list(tool.parameter_names), "matrix": tool.covariance},
            "residuals": _residuals(calibration),
        },
        "adjustment": None if previous is None else _adjustment(calibration, previous, previous_from),
        "verification": None if verification is None else _verification(verification),
        "conformity": _conformity(verification),
        "interval_months": order.interval_months,
        "warnings": [*calibration.warnings, *_two_accelerometers(calibration.tool)],
        "inputs": {**{f"calibration {n}": d for n, d in calibration.inputs.items()}, **(inputs or {})},
        "head": head,
        "supersedes": supersedes,
        "program": program,
    }
    clean: Record = json.loads(canonical(printable(_plain(record))))
    return checked(clean, f"certificate {number}")


def coverage_probability(k: float) -> float:
    """Of an expanded uncertainty with factor k, normal distribution.

    Examples
    --------
    >>> round(coverage_probability(2.0), 4)
    0.9545
    """
    return math.erf(k / math.sqrt(2.0))


def _item(tool: Tool, order: Order) -> Record:
    return {
        "name": order.item,
        "manufacturer": order.manufacturer,
        "serial": order.serial,
        "condition": order.condition,
        "triads": [
            {
                "kind": kind,
                "sensors": triad.count,
                "unit": triad.unit,
                "degree": triad.degree,
                "reference_temperature_degC": triad.reference_temperature,
            }
            for kind, triad in tool.triads.items()
        ],
        "temperature_range_degC": tool.temperature_range,
    }


def _dates(order: Order) -> Record:
    days = {name: getattr(order, name) for name in ("received", "performed_from", "performed_to", "issued")}
    if days["performed_to"] is None:
        days["performed_to"] = days["performed_from"]
    return {name: None if day is None else day.isoformat() for name, day in days.items()}


def _two_accelerometers(tool: Tool) -> list[str]:
    """The condition under which two accelerometers have an uncertainty of inclination."""
    triad = tool.triads.get("accelerometer")
    if triad is None or triad.rank != 2:
        return []
    sd = expected_gravity_sd(tool)
    why = "two places of which nothing is known" if sd == GRAVITY_SPREAD else "stated at both places"
    return [
        "two accelerometers: the uncertainties of one reading hold where the strength of gravity is known to "
        f"{100.0 * sd:.2g} % of that at the calibration ({why}) and the way the hole goes tells the sign of the "
        "component across both; at the place of the calibration an error of that strength cancels. They grow without "
        "bound toward gravity in the plane of the two"
    ]


def _method(calibration: Calibration, order: Order) -> Record:
    rig = np.broadcast_to(np.degrees(calibration.rig.sd), (3,))
    return {
        "name": calibration.method,
        "plan": order.plan,
        "positions": len(calibration.residuals.station),
        "rig": order.rig,
        "rig_traceability": order.rig_traceability,
        "rig_place": order.rig_place,
        "rig_sd_deg": dict(zip(("azimuth", "inclination", "toolface"), rig.tolist(), strict=True)),
    }


def _uncertainty(calibration: Calibration) -> Record | None:
    """Expanded uncertainty over inclination, worst azimuth and toolface; None where none is known."""
    found = expected_uncertainty(calibration, INCLINATIONS)
    if not found.angles:
        return None
    second = found.azimuth_from
    table: Record = {
        "coverage_factor": COVERAGE_FACTOR,
        "coverage_probability": round(coverage_probability(COVERAGE_FACTOR), 4),
        "azimuth_from": second,
        "dip_deg": None if second is None else float(np.degrees(found.dip)),
        "dip_assumed": second is not None and found.dip_from == "assumed",
        "temperature_degC": found.temperature,
        "inclination_deg": np.degrees(INCLINATIONS).round(9).tolist(),
    }
    one, alone = (np.degrees(expanded(u)) for u in (found.of_one_reading, found.from_calibration))
    columns = {f"U_{name}_deg": ANGLES.index(name) for name in found.angles}
    table |= {key: one[:, place].tolist() for key, place in columns.items()}
    table["from_calibration"] = {key: alone[:, place].tolist() for key, place in columns.items()}
    return table


def _row(row: Row) -> Record:
    return {"name": row.label, "value": row.value, "u": row.uncertainty, "unit": row.unit}


def _parameters(tool: Tool) -> list[Record]:
    return [_row(row) for kind in tool.triads for row in parameter_rows(tool, kind)]


def _classical(tool: Tool) -> dict[str, list[Record]]:
    return {kind: [_row(row) for row in classical_rows(tool, kind)] for kind in tool.triads}


def _residuals(calibration: Calibration) -> list[Record]:
    found = []
    for kind, values in calibration.residuals.standardised.items():
        seen = np.asarray(values)
        known = seen[np.isfinite(seen)]
        found.append(
            {
                "kind": kind,
                "station": list(calibration.residuals.station),
                "standardised": seen,
                "rms": float(np.sqrt(np.mean(known**2))) if known.size else None,
                "largest": float(np.abs(known).max()) if known.size else None,
            }
        )
    return found


def _adjustment(calibration: Calibration, previous: Calibration, previous_from: str) -> Record:
    """The values before, and how far the old and the new coefficients are apart in the angles they give."""
    tool, old = calibration.tool, previous.tool
    if tool.parameter_names != old.parameter_names or any(
        tool.triads[kind].unit != old.triads[kind].unit for kind in tool.triads
    ):
        raise InputError("the previous calibration is of other sensors or of another unit; leave it out")
    apart = differences(tool, old, expected_uncertainty(calibration).dip)
    return {
        "previous": previous_from,
        "parameters": _parameters(old),
        "classical": _classical(old),
        "largest_difference_deg": {name: float(np.degrees(abs(wrap_signed(x)))) for name, x in apart.items()},
    }


def _verification(verification: Mapping[str, Any]) -> Record:
    return {name: verification[name] for name in ("verdict", "limits", "report")}


def _conformity(verification: Mapping[str, Any] | None) -> Record:
    if verification is None:
        return {"statement": "not assessed", "rule": None}
    guard = verification["limits"].get("guard")
    rule = RULES.get(str(guard), "consistency")
    return {"statement": verification["verdict"], "rule": rule, "judged": _scope(verification["report"]["positions"])}


def _scope(positions: Sequence[Mapping[str, Any]]) -> Record:
    """To which results the statement applies: angle -> how many positions, lowest and highest inclination."""
    found: Record = {}
    for name in ("inclination", "azimuth", "toolface"):
        inclinations = [row["inclination_deg"] for row in positions if row[name]["decision"] != "not judged"]
        if inclinations:
            span = [min(inclinations), max(inclinations)]
            found[name] = {"positions": len(inclinations), "inclination_deg": span}
    return found


def _plain(value: Any) -> Any:
    """Lists, mappings and numbers; what is not finite is null."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def printable(value: Any) -> Any:
    """Texts without what no page shows: control characters, half characters, marks that turn the direction."""
    if isinstance(value, str):
        return "".join(c for c in value if c == "\n" or c.isprintable()).strip()
    if isinstance(value, dict):
        return {str(printable(key)): printable(item) for key, item in value.items()}
    return [printable(item) for item in value] if isinstance(value, list) else value

"""The parameters of a multi-station analysis in words, and what a run could not tell of them."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from inclinometry.core.arrays import Array
from inclinometry.report.digits import significant
from inclinometry.report.words import listed
from inclinometry.survey.multistation import MultiStation
from inclinometry.survey.quality import BLIND, FieldQuality

VAGUE: Final = float(np.radians(30.0))
"""Standard uncertainty from which an azimuth is none: the station is vertical."""

LEARNED: Final = 0.2
"""Share of its prior variance below which a parameter counts as not told by the run."""

_TERM: Final = re.compile(r"([AM])([BS])([XYZ])")
_CROSS: Final = re.compile(r"M([XYZ])([XYZ])")
_REFERENCE: Final = re.compile(r"reference (g|b|dip)")
_TOOL: Final = re.compile(r"\w+\.(tensor|offset)\[(\d+)(?:,([012]))?\](?:\.T(\d+))?")
_TOGETHER: Final = 0.95  # correlation from which two parameters are one to the run


def described(name: str) -> str:
    """A parameter in words.

    Examples
    --------
    >>> described("MBZ"), described("ASX"), described("MXY")
    ('axial magnetometer bias (interference included)', 'accelerometer x scale', 'magnetometer x reads of y')
    >>> described("reference dip"), described("accelerometer.offset[0]"), described("magnetometer.tensor[2,0].T1")
    ('dip of the reference', 'offset of sensor 1', 'sensor 3 per field along x, per (degC)^1')
    """
    if name == "MBZ":
        return "axial magnetometer bias (interference included)"
    term, cross, reference = (p.fullmatch(name) for p in (_TERM, _CROSS, _REFERENCE))
    if term:
        kind = {"A": "accelerometer", "M": "magnetometer"}[term[1]]
        return f"{kind} {term[3].lower()} {'bias' if term[2] == 'B' else 'scale'}"
    if cross:
        return f"magnetometer {cross[1].lower()} reads of {cross[2].lower()}"
    if reference:
        return f"{reference[1]} of the reference"
    return _calibrated(name)


def _calibrated(name: str) -> str:
    """A parameter of a calibration in words."""
    found = _TOOL.fullmatch(name)
    if found is None:
        return "axial magnetic interference of the assembly" if name == "axial interference" else "of the calibration"
    heat = f", per (degC)^{found[4]}" if found[4] else ""
    if found[3] is not None:
        return f"sensor {int(found[2]) + 1} per field along {'xyz'[int(found[3])]}{heat}"
    return f"offset of sensor {int(found[2]) + 1}{heat}"


def unit_of(unit: str) -> tuple[str, float]:
    """Unit for the reader and what one of the inner unit is there.

    Examples
    --------
    >>> unit_of("m/s^2"), unit_of("1"), unit_of("nT")[0]
    (('m/s²', 1.0), ('', 1.0), 'nT')
    """
    if unit == "rad":
        return "deg", float(180.0 / np.pi)
    return {"m/s^2": "m/s²", "1": ""}.get(unit, unit), 1.0


def labels(found: MultiStation) -> dict[str, str]:
    """Short names of the parameters that have a prior variance, for drawings."""
    short = {"accelerometer.": "acc ", "magnetometer.": "mag ", "reference ": "ref "}
    names = {}
    for name, p in found.parameters.items():
        if p.prior > 0.0:
            text = name
            for long, brief in short.items():
                text = text.replace(long, brief)
            names[name] = text
    return names


def _counted(names: list[str], size: int, most: int = 6) -> str:
    return listed(names) if len(names) <= most else f"{len(names)} of {size} parameters (the table says which)"


def blind_spots(found: MultiStation, after: FieldQuality, u_azimuth: Array) -> list[str]:
    """What the stations do not determine, a sentence each."""
    known = {name: p for name, p in found.parameters.items() if p.prior > 0.0}
    lines = []
    untold = [name for name, p in known.items() if p.learned < LEARNED]
    if untold:
        names = "all parameters" if len(untold) == len(known) else _counted(untold, len(known))
        lines.append(
            f"The run removed less than {100.0 * LEARNED:.0f} % of the prior variance of {names}: their values and "
            "uncertainties are those of the priors, not of the run."
        )
    keys, matrix = list(found.parameters), found.correlation
    pairs = [
        f"{keys[j]} and {keys[i]}"
        for i in range(len(keys))
        for j in range(i)
        if abs(matrix[i, j]) > _TOGETHER and keys[i] in known and keys[j] in known
    ]
    if pairs:
        lines.append(f"The run sees but one combination of {listed(pairs[:6])}.")
    hidden = after.undetected_azimuth
    if (np.nan_to_num(hidden) > BLIND).any():
        row = int(np.nanargmax(hidden))
        size = f"{significant(float(np.degrees(hidden[row])))}°" if np.isfinite(hidden[row]) else "any size"
        lines.append(
            f"At {after.md[row]:g} m, one station by itself, an axial interference that turns azimuth by {size} would "
            "pass the checks of field and dip; the run as a whole sees more, as the uncertainty of azimuth says."
        )
    able = u_azimuth < VAGUE
    if able.any():
        row = int(np.argmax(np.where(able, u_azimuth, -1.0)))
        u = significant(float(np.degrees(u_azimuth[row])))
        lines.append(
            f"Azimuth remains least known at {after.md[row]:g} m: u = {u}° "
            "(sensors and their correction; declination, misalignment in the hole and sag are not in it)."
        )
    lines.append("The declination does not show in gravity, field strength or dip: no analysis of these can check it.")
    return lines

"""Names of columns: the vocabulary of every table of the package, with the units in the names."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from inclinometry.constants import KIND_PREFIX as KIND_PREFIX
from inclinometry.constants import PREFIXES as PREFIXES
from inclinometry.constants import UNIT_LABELS as UNIT_LABELS
from inclinometry.findings import Finding

TEXT = ("station", "part", "roll_set", "azimuth_reference", "flags")
ANGLES = ("azimuth_deg", "inclination_deg", "toolface_deg")
REFERENCES = ("reference_g_m_s2", "reference_b_nT", "reference_dip_deg")
BENCH = ("station", "part", *ANGLES, "temperature_degC", "count", "roll_set", *REFERENCES)
SERIALS = ("serial", "serial_number", "tool_serial")
RAW_SURVEY = ("md_m", "md_ft", "temperature_degC")
LOG = ("time_s", "temperature_degC")
PLAN = ("station", "part", *ANGLES, "roll_set")
GYRO_RUN = ("station", "md_m", "md_ft", "index_deg", "temperature_degC", "time_s")
SURVEY_QUANTITIES = {
    "md": "md_m", "inclination": "inclination_deg", "azimuth": "azimuth_deg", "azimuth_reference": "azimuth_reference",
    "toolface": "toolface_deg", "magnetic_toolface": "magnetic_toolface_deg", "g_total": "g_total",
    "b_total": "b_total_nT", "dip": "dip_deg", "u_inclination": "u_inclination_deg", "u_azimuth": "u_azimuth_deg",
    "u_toolface": "u_toolface_deg", "flags": "flags",
}  # fmt: skip
"""Name inside the package (SI, rad, nT) -> column of the survey file."""
SURVEY = tuple(SURVEY_QUANTITIES.values())
"""The contract of the survey file, in its order; g_total is in m/s^2."""
PARTS = tuple(
    name.format(part)
    for part in ("common", "random")
    for name in ("u_inclination_{}_deg", "u_azimuth_{}_deg", "correlation_{}")
)
"""Columns behind those of the survey file: what of u the stations of a run share, what is each station's own, and the
correlation of inclination with azimuth in each."""

KNOWN = frozenset({*BENCH, *RAW_SURVEY, *LOG, *PLAN, *GYRO_RUN, *SURVEY})
_CHANNEL = re.compile(
    rf"(?P<kind>{'|'.join(PREFIXES)})_(?P<axis>[xyz]|[1-9]\d{{0,2}})(_(?P<unit>{'|'.join(UNIT_LABELS)}))?(?P<sd>_sd)?"
)
_WITH_UNIT = re.compile(
    rf"(?P<start>({'|'.join(PREFIXES)})_([xyz]|[1-9]\d{{0,2}}))_(?P<unit>(?!sd$).+?)(?P<sd>_sd)?", re.IGNORECASE
)
_SUFFIX = re.compile(
    r"_(deg|rad|degC|degF|K|m|ft|km|mm|cm|s|ms|us|min|h|g|mg|m_s2|counts|V|mV|nT|uT|mT|T|G|gauss|rad_s|deg_s|deg_h)$",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Channel:
    """One column of signals: kind of triad, axis as named ("x" or "1"), unit label; `sd` for its standard deviation."""

    name: str
    kind: str
    axis: str
    unit: str
    sd: bool


def channel(name: str) -> Channel | None:
    """Read a column's name as a channel's, or None.

    >>> channel("accel_x_m_s2_sd")
    Channel(name='accel_x_m_s2_sd', kind='accelerometer', axis='x', unit='m/s^2', sd=True)
    """
    found = _CHANNEL.fullmatch(name)
    if found is None:
        return None
    unit = UNIT_LABELS[found["unit"] or "counts"]
    return Channel(name, PREFIXES[found["kind"]], found["axis"], unit, bool(found["sd"]))


def is_number(name: str) -> bool:
    """Whether a column of this name is read as numbers; every other column is kept as text.

    >>> is_number("mag_4"), is_number("azimuth_deg"), is_number("station"), is_number("operator")
    (True, True, False, False)
    """
    return (name in KNOWN and name not in TEXT) or channel(name) is not None


def numbers_among(names: Iterable[str]) -> Callable[[str], bool]:
    """Which columns a reader of `names` takes as numbers: these and the channels; any other stays text.

    >>> numbers_among(LOG)("time_s"), numbers_among(LOG)("md_m")
    (True, False)
    """
    known = frozenset(names) - frozenset(TEXT)
    return lambda name: name in known or channel(name) is not None


def advice(name: str, known: Iterable[str]) -> Finding | None:
    """What is wrong with a name that is nearly a known one; None when it is simply another column.

    >>> str(advice("inclination_rad", ["inclination_deg"])), advice("operator", ["azimuth_deg"])
    ('Column inclination_rad: unit rad is not accepted. Allowed: inclination_deg.', None)
    """
    names = list(known)
    bases = {_SUFFIX.sub("", k).lower(): k for k in reversed(names) if _SUFFIX.search(k)}
    lowered = name.lower()
    if lowered in bases:
        return Finding("table-unit-missing", {"name": name, "right": (bases[lowered],)})
    if (base := _SUFFIX.sub("", lowered)) != lowered and base in bases and name not in names:
        if lowered == bases[base].lower():
            return _nearly(name, bases[base])
        unit = lowered.removeprefix(base).lstrip("_")
        return Finding("table-unit", {"column": name, "unit": unit, "allowed": (bases[base],)})
    return _nearly(name, closest(name, names, 0.9))


def _nearly(name: str, right: str | None) -> Finding | None:
    return Finding("table-near", {"name": name, "right": right}) if right else None


def channel_advice(name: str) -> Finding | None:
    """What is wrong with a name that begins as a channel's and ends in no unit known here; else None.

    >>> channel_advice("accel_x_bananas").code, channel_advice("Accel_X").values["right"]
    ('table-unit', 'accel_x')
    """
    if channel(name.lower()):
        return _nearly(name, name.lower())
    found = _WITH_UNIT.fullmatch(name)
    if found is None:
        return None
    exact = {unit.lower(): unit for unit in UNIT_LABELS}.get(found["unit"].lower())
    if exact:
        return _nearly(name, f"{found['start'].lower()}_{exact}{found['sd'] or ''}")
    return Finding("table-unit", {"column": name, "unit": found["unit"], "allowed": tuple(UNIT_LABELS)})


def spelled(name: str) -> str:
    """The name as the package writes it, where capitals alone differ.

    >>> spelled("Accel_X_NT"), spelled("Station"), spelled("mag_x_G"), spelled("crew")
    ('accel_x_nT', 'station', 'mag_x_G', 'crew')
    """
    near = None if name.lower().endswith(("_g", "_sd")) else channel_advice(name)  # g or gauss
    right = (
        near.values.get("right", name) if near else {known.lower(): known for known in KNOWN}.get(name.lower(), name)
    )
    return str(right)


def closest(name: str, names: Sequence[str], cutoff: float = 0.6) -> str | None:
    """The known name most like `name`, letter case aside."""
    lowered = {n.lower(): n for n in reversed(list(names))}
    found = difflib.get_close_matches(name.lower(), list(lowered), 1, cutoff)
    return lowered[found[0]] if found else None

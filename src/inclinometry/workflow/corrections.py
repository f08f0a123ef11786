"""Corrections of six-axis stations by name, in the order the user gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from inclinometry.core.errors import InputError
from inclinometry.sensors.tool import Tool
from inclinometry.survey.bha import Bha
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.stations import Stations


@dataclass(frozen=True, eq=False, kw_only=True)
class Means:
    """What corrections may need: the reference field, the tool's calibration (multi-station priors), the assembly."""

    reference: FieldReference | None = None
    calibration: Tool | None = None
    bha: Bha | None = None


@dataclass(frozen=True, eq=False)
class Corrected:
    """Stations after the corrections, and what each of them returned, by its name."""

    stations: Stations
    results: Mapping[str, Any]


def _axial(stations: Stations, means: Means) -> tuple[Stations, Any]:
    from inclinometry.survey.axial import axial_correction

    found = axial_correction(stations, _reference(means, "axial"))
    return found.stations, found


def _multistation(stations: Stations, means: Means) -> tuple[Stations, Any]:
    from inclinometry.survey.multistation import multistation

    found = multistation(stations, _reference(means, "msa"), calibration=means.calibration)
    return found.corrected, found


def _sag(stations: Stations, means: Means) -> tuple[Stations, Any]:
    from inclinometry.survey.sag import correct_stations

    if means.bha is None:
        raise InputError("the correction 'sag' needs the assembly; give --bha bha.toml")
    done = correct_stations(stations, means.bha)
    return done, None


CORRECTIONS: Final[Mapping[str, Callable[[Stations, Means], tuple[Stations, Any]]]] = MappingProxyType(
    {"axial": _axial, "msa": _multistation, "sag": _sag}
)
"""The corrections by the names used at the command line."""


def correction_names(text: str) -> tuple[str, ...]:
    """The corrections of a list such as "axial,msa,sag", in its order.

    Raises
    ------
    InputError
        An unknown name, one given twice, or axial after msa: the analysis has estimated the axial field with everything
        else, and the axial correction would throw that away.

    Examples
    --------
    >>> correction_names("msa, sag")
    ('msa', 'sag')
    """
    names = tuple(part.strip().lower() for part in text.split(",") if part.strip())
    for place, name in enumerate(names):
        if name not in CORRECTIONS:
            raise InputError(f"correction {name!r} is not known; allowed: {', '.join(CORRECTIONS)}")
        if name in names[:place]:
            raise InputError(f"correction {name!r} is given twice; each is made once")
    if not names:
        raise InputError(f"no correction in {text!r}; give one or more of {', '.join(CORRECTIONS)}, with commas")
    if "msa" in names and "axial" in names[names.index("msa") :]:
        raise InputError(
            "axial after msa would throw away the axial field that the multi-station analysis has estimated; give "
            "axial,msa or one of them"
        )
    return names


def apply_corrections(stations: Stations, names: Sequence[str], means: Means) -> Corrected:
    """Apply corrections one after the other.

    Parameters
    ----------
    stations : Stations
    names : sequence of str
        As `correction_names` returns them.
    means : Means

    Returns
    -------
    Corrected
        `results` hold an AxialCorrection, a MultiStation, None for sag; every step leaves a line in the history and its
        residual as a source of error.

    Raises
    ------
    InputError
        As `correction_names`, or means that a correction needs and has not.
    """
    done, results = stations, {}
    for name in correction_names(",".join(names)):
        done, results[name] = CORRECTIONS[name](done, means)
    return Corrected(done, MappingProxyType(results))


def _reference(means: Means, name: str) -> FieldReference:
    if means.reference is None:
        raise InputError(f"the correction {name!r} needs g, b and dip of the site; give --site site.toml with them")
    return means.reference

"""A tool code: an error model as a list of terms, each with magnitude, unit, propagation and weighting formulas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import numpy as np

from inclinometry.core.arrays import finite
from inclinometry.core.errors import InputError
from inclinometry.position.formula import Formula, parse

PROPAGATIONS: Final = ("random", "systematic", "well", "global")
"""What shares one realisation of an error: nothing, the stations of a run, the runs of a well, all wells."""

UNITS: Final[Mapping[str, float]] = MappingProxyType(
    {
        "-": 1.0,
        "m": 1.0,
        "ft": 0.3048,
        "1/m": 1.0,
        "rad": 1.0,
        "deg": np.pi / 180.0,
        "m/s2": 1.0,
        "nT": 1.0,
        "deg.nT": np.pi / 180.0,
        "deg/hr": np.pi / 180.0 / 3600.0,
        "deg/sqr(hr)": np.pi / 180.0 / 60.0,
    }
)
"""Units a magnitude may have, and what one of them is in SI."""

STATION_VARIABLES: Final = frozenset(
    ("md", "tvd", "inc", "azt", "azm", "az", "mdprev", "incprev", "aztprev", "azmprev", "azprev", "k")
)
"""Variables that each station has: depths in m, angles in rad, ...prev of the station before, k -1 beyond 90 deg."""

SITE_VARIABLES: Final = frozenset(("gfield", "bfield", "dip", "latitude", "earthrate"))
"""Variables of the place: m/s^2, nT, rad, rad, rad/s."""

PARAMETERS: Final = frozenset(("noisereductionfactor", "gxyrunningspeed", "gzrunningspeed", "xcltortuosity"))
"""Parameters a tool code may set for its formulas: -, m/s, m/s, rad/m."""

STATES: Final[Mapping[str, str]] = MappingProxyType(
    {f"{axes}_gyro_{kind}": kind for axes in ("xy", "xyz", "z") for kind in ("drift", "random_walk")}
)
"""Variables for what a continuous gyro has accumulated up to the station before."""

VARIABLES: Final = STATION_VARIABLES | SITE_VARIABLES | PARAMETERS | frozenset(STATES)
"""Everything a weighting formula may mention."""


@dataclass(frozen=True, kw_only=True)
class Term:
    """One source of error.

    name, description, source : str
    magnitude : float
        One standard deviation, in `unit`.
    unit : str
        One of `UNITS`.
    propagation : {"random", "systematic", "well", "global"}
    depth, inclination, azimuth : Formula
        Weights of the magnitude in measured depth, inclination and azimuth.
    singular : three Formulas, optional
        Weights north, east, down per metre, in place of inclination and azimuth at vertical stations.
    course : bool
        Whether the term acts over the whole course before the station alone (tangential) and not over half of the
        courses on both sides.
    inclinations : (low, high), rad
        Where the term is active.
    hold : bool
        Whether stations above `inclinations` keep the weight it had at the upper end.
    start : bool
        Whether the weight is that of the first station of each stretch within `inclinations`, kept throughout.
    """

    name: str
    magnitude: float
    unit: str
    propagation: str
    depth: Formula
    inclination: Formula
    azimuth: Formula
    singular: tuple[Formula, Formula, Formula] | None = None
    course: bool = False
    inclinations: tuple[float, float] = (-np.inf, np.inf)
    hold: bool = False
    start: bool = False
    description: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise InputError(f"term {self.name} has the unit {self.unit!r}; known: {', '.join(UNITS)}")
        if self.propagation not in PROPAGATIONS:
            allowed = ", ".join(PROPAGATIONS)
            raise InputError(f"term {self.name} has the propagation {self.propagation!r}; allowed: {allowed}")
        if float(finite(self.magnitude, f"magnitude of {self.name}")) < 0.0:
            raise InputError(f"term {self.name} has magnitude {self.magnitude}; a standard deviation is not negative")
        if all(formula.is_zero for formula in self.formulas) and not self.course:
            raise InputError(f"term {self.name} has no formula that is not 0; say what it does, or leave it out")
        if not self.inclinations[0] <= self.inclinations[1]:
            low, high = np.degrees(self.inclinations)
            raise InputError(f"term {self.name} is for inclinations {low:g} to {high:g} deg; the lower comes first")
        if self.hold and self.start:
            raise InputError(f"term {self.name} both holds its last and keeps its first weight; choose one")

    @property
    def sigma(self) -> float:
        """Magnitude in SI."""
        return self.magnitude * UNITS[self.unit]

    @property
    def formulas(self) -> tuple[Formula, ...]:
        """All its formulas."""
        return (self.depth, self.inclination, self.azimuth, *(self.singular or ()))

    @property
    def state(self) -> str | None:
        """The accumulated variable its azimuth mentions, if any."""
        return next((name for name in STATES if name in self.azimuth.names), None)


def term(
    name: str,
    magnitude: float,
    unit: str,
    propagation: str,
    weights: Sequence[str | float],
    singular: Sequence[str | float] | None = None,
    **options: object,
) -> Term:
    """A term from the text of its formulas.

    Parameters
    ----------
    name, magnitude, unit, propagation
        As in `Term`.
    weights : three texts
        Formulas of depth, inclination, azimuth.
    singular : three texts, optional
    **options
        Other fields of `Term`.

    Raises
    ------
    InputError
        Naming the term: a formula that cannot be read, an unknown variable, function, unit or propagation.

    Examples
    --------
    >>> term("ABZ", 0.004, "m/s2", "systematic", ("0", "-Sin(Inc) / Gfield", "0")).sigma
    0.004
    >>> term("ABZ", 0.004, "m/s2", "systematic", ("0", "-Sin(Incl) / Gfield", "0"))
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: term ABZ: formula ... has the unknown variable 'incl'; known: ...
    """
    try:
        depth, inclination, azimuth = (parse(text, VARIABLES) for text in weights)
        vertical = None if singular is None else tuple(parse(text, VARIABLES) for text in singular)
    except InputError as error:
        raise InputError(f"term {name}: {error}") from None
    return Term(
        name=name,
        magnitude=magnitude,
        unit=unit,
        propagation=propagation,
        depth=depth,
        inclination=inclination,
        azimuth=azimuth,
        singular=vertical,  # type: ignore[arg-type]
        **options,  # type: ignore[arg-type]
    )


@dataclass(frozen=True, kw_only=True)
class ToolCode:
    """An error model.

    name, description, source, revision : str
    terms : tuple of Term
    parameters : lower-case name -> value in SI, of `PARAMETERS`
    inclinations : (low, high), rad
        For which the model was made.
    vertical : float
        Inclination, rad, below which the singular weights are taken.
    surface_attitude : bool
        Whether the attitude at the wellhead is as uncertain as a station (ISCWSA from Revision 5), which doubles the
        weight of the first station below it.
    continuous_above : float, optional
        Inclination, rad, above which a continuous gyro runs and accumulates.
    """

    name: str
    terms: tuple[Term, ...]
    source: str
    revision: str = ""
    description: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    inclinations: tuple[float, float] = (0.0, np.pi)
    vertical: float = np.radians(1e-4)
    surface_attitude: bool = False
    continuous_above: float | None = None

    def __post_init__(self) -> None:
        names = [one.name for one in self.terms]
        twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
        if twice is not None:
            raise InputError(f"tool code {self.name} has the term {twice} twice; names must differ")
        if not self.terms:
            raise InputError(f"tool code {self.name} has no terms; an error model needs at least one")
        unknown = sorted(set(self.parameters) - PARAMETERS)
        if unknown:
            allowed = ", ".join(sorted(PARAMETERS))
            raise InputError(f"tool code {self.name} sets the unknown parameter {unknown[0]!r}; known: {allowed}")
        for one in self.terms:
            self._complete(one)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def _complete(self, one: Term) -> None:
        for formula in one.formulas:
            lost = sorted((formula.names & PARAMETERS) - set(self.parameters))
            if lost:
                raise InputError(
                    f"tool code {self.name}, term {one.name}: formula {formula.text!r} needs the parameter {lost[0]}, "
                    "which the tool code does not set; add it"
                )
        if one.state is not None and self.continuous_above is None and not np.isfinite(one.inclinations).any():
            raise InputError(
                f"tool code {self.name}, term {one.name} accumulates, but from which inclination on is not said; "
                "set continuous_above or the term's inclinations"
            )

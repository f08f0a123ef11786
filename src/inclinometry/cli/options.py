"""Options that several commands share, and the checks of values given in degrees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from cyclopts import Parameter, Token, convert

from inclinometry.conventions import current_name
from inclinometry.errors import InputError

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
Json = Annotated[bool, Parameter(name="--json", negative="")]
Flag = Annotated[bool, Parameter(negative="")]


def _convention(type_: Any, tokens: Sequence[Token]) -> Any:
    """The name of a convention; its old one is taken, too."""
    return convert(type_, [current_name(token.value) for token in tokens])


Convention: TypeAlias = Annotated[
    Literal["native", "iscwsa", "specific-force", "z-up"] | None, Parameter(converter=_convention)
]

LARGEST_SD = 30.0
"""A rig or a stand worse than this, deg, is none."""


def angle(degrees: float, option: str, low: float = -360.0, high: float = 360.0) -> float:
    """An option given in degrees, in rad; refused in degrees when it is outside low..high or not a number.

    Examples
    --------
    >>> angle(180.0, "--azimuth-deg") == np.pi
    True
    """
    if not low <= degrees <= high:
        raise InputError(f"{option} is {degrees:g} degrees; allowed {low:g} to {high:g} degrees")
    return float(np.radians(degrees))


def angle_or_none(degrees: float | None, option: str, low: float = -360.0, high: float = 360.0) -> float | None:
    """The same for an option that may be left out."""
    return None if degrees is None else angle(degrees, option, low, high)


def sd(degrees: float | None, option: str) -> float | None:
    """A standard deviation given in degrees, in rad."""
    return angle_or_none(degrees, option, 0.0, LARGEST_SD)


def gravity_sd(percent: float | None) -> float | None:
    """Standard uncertainty of |g| given in percent of that at the calibration, as a share of it."""
    if percent is not None and not 0.0 <= percent <= 10.0:
        raise InputError(f"--gravity-sd-percent is {percent:g}; allowed 0 to 10")
    return None if percent is None else percent / 100.0


def inclination_range(degrees: tuple[float, float] | None, option: str) -> tuple[float, float] | None:
    """Two inclinations given in degrees, the lower first, in rad."""
    if degrees is None:
        return None
    low, high = degrees
    if not 0.0 <= low < high <= 180.0:
        raise InputError(
            f"{option} is {low:g} to {high:g} degrees; allowed within 0 to 180 degrees, the lower inclination first"
        )
    return float(np.radians(low)), float(np.radians(high))

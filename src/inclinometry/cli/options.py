"""Options that several commands share, declared once with their help, and the checks of values given in degrees.

In `--help` of a command its options stand in the groups below; those that name none stand in the one that `app` gives
the command (Method, Simulation, Options), between them and Output.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

import numpy as np
from cyclopts import Group, Parameter, Token, convert

from inclinometry.errors import InputError

INPUT = Group("Input", sort_key=1)
STAND = Group("Stand", sort_key=2)
DIALS = Group("Dials", sort_key=3)
SENSORS = Group("Sensors", sort_key=4)
OUTPUT = Group("Output", sort_key=9)

Flag = Annotated[bool, Parameter(negative="", show_default=False)]

# files: what is in them each command says itself
Input: TypeAlias = Annotated[Path, Parameter(group=INPUT)]
InputOrNone: TypeAlias = Annotated[Path | None, Parameter(group=INPUT)]
Output: TypeAlias = Annotated[Path, Parameter(name=["--output", "-o"], group=OUTPUT)]
OutputOrNone: TypeAlias = Annotated[Path | None, Parameter(name=["--output", "-o"], group=OUTPUT)]
AlsoWritten: TypeAlias = Annotated[Path | None, Parameter(group=OUTPUT)]
Report: TypeAlias = Annotated[
    Path | None, Parameter(group=OUTPUT, help="Write an HTML report; --language ru or zh: in Russian or Chinese.")
]
Json: TypeAlias = Annotated[
    bool, Parameter(name="--json", negative="", show_default=False, group=OUTPUT, help="Print JSON instead of text.")
]


def _convention(type_: Any, tokens: Sequence[Token]) -> Any:
    """The name of a convention; its old one is taken, too."""
    from inclinometry.conventions import current_name

    return convert(type_, [current_name(token.value) for token in tokens])


Convention: TypeAlias = Annotated[
    Literal["native", "iscwsa", "specific-force", "z-up"] | None,
    Parameter(
        group=INPUT,
        converter=_convention,
        help="Without a calibration: axes and signs of the sensors in the file, see the page on conventions; native "
        "when not given.",
    ),
]
SixAxisForm: TypeAlias = Annotated[
    Literal["csv", "xlsx", "parquet", "las", "witsml", "p7"] | None,
    Parameter(name="--from", group=INPUT, help="Format of the readings; by the ending of a file when not given."),
]
FieldSite: TypeAlias = Annotated[
    Path,
    Parameter(
        group=INPUT,
        help="site.toml with g, b_nT, dip_deg and their sigmas, or latitude_deg, longitude_deg and date.",
    ),
]
GyroSite: TypeAlias = Annotated[Path, Parameter(group=INPUT, help="site.toml with latitude_deg.")]
ModelOrTool: TypeAlias = Annotated[
    Path | None,
    Parameter(group=INPUT, help="tool.json; without it the sensors' errors are those of the ISCWSA MWD model."),
]
AzimuthFrom: TypeAlias = Annotated[
    Literal["magnetometer", "gyro"] | None,
    Parameter(
        help="Triad that gives the azimuth: the magnetometer when not given, where there is one, else the gyro (from "
        "true north)."
    ),
]
GravitySd: TypeAlias = Annotated[
    float | None,
    Parameter(
        help="Of a tool with two accelerometers: standard uncertainty of |g| here against that at the calibration, 0 "
        "at the same place. When not given, that of what the site and the calibration state, 0.3 where one states "
        "nothing."
    ),
]


def _checks(type_: Any, tokens: Sequence[Token]) -> tuple[str, ...]:
    """Names with commas between."""
    return tuple(name.strip() for token in tokens for name in token.value.split(",") if name.strip())


TrustFile: TypeAlias = Annotated[
    tuple[str, ...],
    Parameter(
        group=INPUT,
        negative="",
        converter=_checks,
        n_tokens=1,
        show_default=False,
        help="Check of the whole run that is overruled, which the output records; several with commas: units, columns, "
        "axes, depths, repeats, order, station, direction, totals, place.",
    ),
]
AgeDays: TypeAlias = Annotated[
    float | None,
    Parameter(
        group=INPUT,
        help="With --calibration: days from the calibration to the run, after which the sensors are not where they "
        "were; by the dates of tool.json (calibrate --created) and of the site when not given.",
    ),
]
StabilityFile: TypeAlias = Annotated[
    Path | None,
    Parameter(
        group=INPUT,
        help="stability.toml: what the sensors of this tool move by in a year; half of the AB, AS, MB and MS terms of "
        "the ISCWSA's MWD model when not given.",
    ),
]
SwitchAngle: TypeAlias = Annotated[
    float,
    Parameter(
        help="Inclination below which toolface_type says magnetic: the toolface to steer by is then the magnetic one, "
        "azimuth + toolface (magnetic_toolface_deg of a survey)."
    ),
]
Serial: TypeAlias = Annotated[str, Parameter(group=OUTPUT, help="Serial number for the record.")]
Created: TypeAlias = Annotated[
    str | None,
    Parameter(
        group=OUTPUT,
        help="Date for the record, YYYY-MM-DD or ISO 8601 with the time; none when not given: nothing is "
        "taken from the clock.",
    ),
]
Scheme: TypeAlias = Annotated[
    Literal["two", "four", "mirrored", "n", "carousel"], Parameter(help="Index positions of a station.")
]


def shipped(folder: str) -> str:
    """Names of the files of data in a folder of the package, for a text of help.

    Examples
    --------
    >>> shipped("files/limits")
    'rogatykh-2018-fluxgate, rogatykh-2018-magnetoresistive'
    """
    found = (Path(__file__).parents[1] / folder).iterdir()
    return ", ".join(sorted(path.stem for path in found if path.suffix in (".toml", ".json")))


def plan_names() -> str:
    """Names of the plans that need no design, for a text of help.

    Examples
    --------
    >>> plan_names()
    'twelve, orthogonal, half, two-face, rotations, six, spread'
    """
    from inclinometry.calibration.plans import PlanName

    return ", ".join(get_args(PlanName))


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


def day(text: str, option: str) -> date:
    """A day that an option gives."""
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise InputError(f"{option} is {text!r}; write YYYY-MM-DD") from None


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

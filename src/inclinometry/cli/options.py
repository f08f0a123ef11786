"""Options that several commands share, declared once with their help, and quantities that arrive in SI units.

In `--help` of a command its options stand in the groups below; those that name none stand in the one that `app` gives
the command (Method, Simulation, Options), between them and Output.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, datetime
from math import inf, pi
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias, get_args

from cyclopts import Group, Parameter, Token, convert

from inclinometry.cli.general import OLD_IGNORE, as_typed
from inclinometry.errors import out_of_range, wrong_kind

INPUT = Group("Input", sort_key=1)
STAND = Group("Stand", sort_key=2)
DIALS = Group("Dials", sort_key=3)
SENSORS = Group("Sensors", sort_key=4)
OUTPUT = Group("Output", sort_key=9)

Flag = Annotated[bool, Parameter(negative="", show_default=False)]

_DEG: Final = pi / 180.0
SI: Final = {
    **{"deg": _DEG, "deg_h": _DEG / 3600.0, "deg_h_h": _DEG / 3600.0**2, "deg_sqrt_h": _DEG / 60.0},
    "deg_h_g": _DEG / 3600.0,
    **{"percent": 0.01, "mm": 1e-3, "ms": 1e-3, "mg": 9.80665e-3},
}
"""Unit at the end of an option's name -> what one of it is in SI; those that are not here are what is used inside."""


def quantity(unit: str, low: float = -inf, high: float = inf, *, above: bool = False, **more: Any) -> Parameter:
    """A number whose option ends in its unit: refused outside low..high (`above`: at `low` too), else given in SI."""
    factor = SI.get(unit, 1.0)

    def si(type_: Any, tokens: Sequence[Token]) -> float:
        try:
            value = float(tokens[0].value)
        except ValueError:
            raise wrong_kind(tokens[0].keyword or "", as_typed(tokens[0].value) or '""', "number") from None
        if (high < inf and not (low < value if above else low <= value)) or not value <= high:
            allowed = f"> {low:g}, <= {high:g}" if above else f"{low:g} .. {high:g}"
            raise out_of_range(tokens[0].keyword or "", value, allowed)
        return value * factor

    return Parameter(
        converter=si,
        n_tokens=1,
        name_transform=lambda name: f"{name}_{unit}".strip("_").replace("_", "-"),
        show_default=lambda value: None if value is None else str(float(f"{value / factor:.12g}")),
        **more,
    )


# what is given in degrees of the option arrives in rad; a rig or a stand worse than 30 deg is none
Sd: TypeAlias = Annotated[float, quantity("deg", 0.0, 30.0)]
SdOrNone: TypeAlias = Annotated[float | None, quantity("deg", 0.0, 30.0)]
Azimuth: TypeAlias = Annotated[float, quantity("deg", -360.0, 360.0)]
AzimuthOrNone: TypeAlias = Annotated[float | None, quantity("deg", -360.0, 360.0)]
Inclination: TypeAlias = Annotated[float, quantity("deg", 0.0, 180.0)]
InclinationOrNone: TypeAlias = Annotated[float | None, quantity("deg", 0.0, 180.0)]
Dip: TypeAlias = Annotated[float, quantity("deg", -90.0, 90.0)]
Latitude: TypeAlias = Annotated[float, quantity("deg", -90.0, 90.0)]
DipOrNone: TypeAlias = Annotated[float | None, quantity("deg", -90.0, 90.0)]

# files: what is in them each command says itself
Input: TypeAlias = Annotated[Path, Parameter(group=INPUT)]
InputOrNone: TypeAlias = Annotated[Path | None, Parameter(group=INPUT)]
Output: TypeAlias = Annotated[Path, Parameter(name=["--output", "-o"], group=OUTPUT)]
OutputOrNone: TypeAlias = Annotated[Path | None, Parameter(name=["--output", "-o"], group=OUTPUT)]
AlsoWritten: TypeAlias = Annotated[Path | None, Parameter(group=OUTPUT)]
Report: TypeAlias = Annotated[Path | None, Parameter(group=OUTPUT, help="Write an HTML report.")]
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
        help="Without --calibration: axes and signs of the file. Default: native.",
    ),
]
SixAxisForm: TypeAlias = Annotated[
    Literal["csv", "xlsx", "parquet", "las", "witsml", "p7"] | None,
    Parameter(name="--from", group=INPUT, help="Format of the readings. Default: by file ending."),
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
    Parameter(group=INPUT, help="tool.json. Without it, sensor errors of the ISCWSA MWD model are used."),
]
AzimuthFrom: TypeAlias = Annotated[
    Literal["magnetometer", "gyro"] | None,
    Parameter(help="Sensors of the azimuth. Default: the magnetometer if there is one, else the gyro (true north)."),
]
GravitySd: TypeAlias = Annotated[
    float | None,
    quantity(
        "percent",
        0.0,
        10.0,
        help="Two accelerometers: standard uncertainty of |g| relative to the calibration; 0 at the same place. If "
        "not given, from site and calibration, else 0.3.",
    ),
]


def _checks(type_: Any, tokens: Sequence[Token]) -> tuple[str, ...]:
    """Names with commas between."""
    return tuple(name.strip() for token in tokens for name in token.value.split(",") if name.strip())


Ignore: TypeAlias = Annotated[
    tuple[str, ...],
    Parameter(
        name=["--ignore", OLD_IGNORE],
        group=INPUT,
        negative="",
        converter=_checks,
        n_tokens=1,
        show_default=False,
        help="Ignore these findings of the run, by code or group, with commas; the output records them. Groups: "
        "units, columns, axes, depths, repeats, order, station, direction, totals, place. Old name: "
        + OLD_IGNORE
        + ".",
    ),
]
AgeDays: TypeAlias = Annotated[
    float | None,
    Parameter(
        group=INPUT,
        help="With --calibration: days from calibration to run; adds drift to the uncertainty. Default: from the "
        "dates in tool.json and the site.",
    ),
]
StabilityFile: TypeAlias = Annotated[
    Path | None,
    Parameter(
        group=INPUT,
        help="stability.toml: sensor drift per year. Default: half the AB, AS, MB, MS terms of the ISCWSA MWD model.",
    ),
]
SwitchAngle: TypeAlias = Annotated[
    float,
    quantity(
        "deg",
        0.0,
        90.0,
        help="Inclination below which toolface_type is magnetic; use magnetic_toolface_deg there.",
    ),
]
Serial: TypeAlias = Annotated[str, Parameter(group=OUTPUT, help="Serial number of the tool.")]


def _day_or_time(type_: Any, tokens: Sequence[Token]) -> str:
    """A date as it is written into a record."""
    try:
        datetime.fromisoformat(tokens[0].value)
    except ValueError:
        raise wrong_kind(tokens[0].keyword or "", tokens[0].value, "date and time") from None
    return tokens[0].value


Created: TypeAlias = Annotated[
    str | None,
    Parameter(
        group=OUTPUT,
        converter=_day_or_time,
        n_tokens=1,
        help="Date of the calibration, YYYY-MM-DD or ISO 8601. Default: none.",
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


def day(text: str, option: str) -> date:
    """A day that an option gives."""
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise wrong_kind(option, text, "date YYYY-MM-DD") from None

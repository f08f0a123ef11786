"""What the survey formats of the industry hold in common: the type all their readers give and their writers take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from inclinometry.core.arrays import Array, Mask, finite, frozen
from inclinometry.core.errors import InputError
from inclinometry.earth.site import REFERENCES as NORTHS

STATION: Final = (
    "inclination", "azimuth", "toolface", "magnetic_toolface", "gyro_toolface", "north", "east", "tvd", "temperature",
)  # fmt: skip
"""Optional quantities with one number a station."""

VECTORS: Final = ("g", "b", "w")
"""Optional fields in tool axes, three numbers a station."""

MEASURED: Final = ("g", "b", "dip", "earth_rate", "latitude", "dogleg_severity")
"""Names in `SurveyFile.measured`: m/s^2, nT, rad, rad/s, rad, rad/m."""

REFERENCE: Final = ("g", "b", "dip", "declination", "convergence", "latitude", "earth_rate")
"""Names in `SurveyFile.reference`: m/s^2, nT, rad, rad, rad, rad, rad/s."""

CORRECTIONS: Final = ("gx", "gy", "gz", "bx", "by", "bz", "sag_inclination", "sag_azimuth", "sensor_offset")
"""Names in `SurveyFile.corrections`, added to what was measured: m/s^2, nT, rad, rad, m."""

SIGMA: Final = ("inclination", "azimuth", "toolface")
"""Names in `SurveyFile.sigma`: rad, at one standard deviation."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SurveyFile:
    """Stations of one well or run as a file of any format holds them; None, or NaN at a station, where it is silent.

    md : (n,) measured depth, m; strictly increasing over the stations that are used (a repeated shot is not).
    inclination, azimuth, toolface, magnetic_toolface, gyro_toolface : (n,) rad; toolface is the gravity toolface.
    azimuth_reference : "magnetic", "true" or "grid"; required with an azimuth.
    north, east, tvd : (n,) m from the well's origin.
    g, b, w : (n, 3) gravity, m/s^2 (the field: positive down, not the specific force), magnetic flux density, nT, and
        rotation rate, rad/s, in the house's tool axes: x = index mark, y = 90 deg clockwise of it looking down hole,
        z down hole. The reader of a format has already mapped that format's own axes and signs.
    measured : name of `MEASURED` -> (n,), what the file says was found.
    reference : name of `REFERENCE` -> (n,), what was expected, or the correction between norths.
    corrections : name of `CORRECTIONS` -> (n,).
    sigma : name of `SIGMA` -> (n,), standard uncertainty of that angle.
    covariance : (n, 3, 3) of the position in north, east, vertical (down), m^2, at one standard deviation.
    used, valid : (n,) bool, or None where the file does not say: taken into the definitive survey; passed its checks.
    times : (n,) ISO 8601 texts, empty where unknown.
    temperature : (n,) degC.
    extra : other columns, as (n,) texts.
    header : well, run, units, originals: whatever the head of the file says, as texts.
    notes : findings of the reader.
    digest : SHA-256 of the file read.

    Raises
    ------
    InputError
        Depths that do not increase, another shape, infinity, an unknown name, an azimuth without its north.

    Examples
    --------
    >>> survey = SurveyFile(md=[0, 30], inclination=[0, 0.1], reference={"dip": 1.2})
    >>> len(survey), survey.reference["dip"]
    (2, array([1.2, 1.2]))
    >>> SurveyFile(md=[0, 30], azimuth=[1, 1])
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: azimuths without a north; give azimuth_reference: magnetic, true, grid
    """

    md: Array
    inclination: Array | None = None
    azimuth: Array | None = None
    azimuth_reference: str | None = None
    toolface: Array | None = None
    magnetic_toolface: Array | None = None
    gyro_toolface: Array | None = None
    north: Array | None = None
    east: Array | None = None
    tvd: Array | None = None
    g: Array | None = None
    b: Array | None = None
    w: Array | None = None
    measured: Mapping[str, Array] = field(default_factory=dict)
    reference: Mapping[str, Array] = field(default_factory=dict)
    corrections: Mapping[str, Array] = field(default_factory=dict)
    sigma: Mapping[str, Array] = field(default_factory=dict)
    covariance: Array | None = None
    used: Mask | None = None
    valid: Mask | None = None
    times: tuple[str, ...] | None = None
    temperature: Array | None = None
    extra: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    header: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    digest: str = ""

    def __post_init__(self) -> None:
        size = len(finite(self.md, "md", (None,)))
        if not size:
            raise InputError("a survey without stations; give one at least")
        keep: dict[str, Any] = {"md": frozen(self.md), "used": self.used, "valid": self.valid}
        for name in ("used", "valid"):
            if keep[name] is not None:
                keep[name] = np.array(_shaped(keep[name], name, (size,)), dtype=np.bool_)
        _increasing(keep["md"], keep["used"])
        for name in (*STATION, *VECTORS, "covariance"):
            shape = (size, 3, 3) if name == "covariance" else (size, 3) if name in VECTORS else (size,)
            value = getattr(self, name)
            keep[name] = None if value is None else frozen(_shaped(value, name, shape))
        allowed = {"measured": MEASURED, "reference": REFERENCE, "corrections": CORRECTIONS, "sigma": SIGMA}
        for name, names in allowed.items():
            keep[name] = _named(getattr(self, name), name, names, size)
        for name, texts in (("times", self.times), *self.extra.items()):
            if texts is not None and len(texts) != size:
                raise InputError(f"{name} has {len(texts)} texts; md has {size} stations")
        if self.azimuth_reference not in (None, *NORTHS) or (self.azimuth is not None and not self.azimuth_reference):
            found = f"{self.azimuth_reference!r} as a north" if self.azimuth_reference else "azimuths without a north"
            raise InputError(f"{found}; give azimuth_reference: {', '.join(NORTHS)}")
        for name in ("extra", "header"):
            keep[name] = MappingProxyType(dict(getattr(self, name)))
        for name, value in keep.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.md)

    def same_as(self, other: SurveyFile, *, rtol: float = 0.0, atol: float = 0.0) -> bool:
        """Whether all that is not `notes`, `header` and `digest` agrees within the tolerances; NaN equals NaN."""
        names = (f.name for f in fields(self) if f.name not in ("notes", "header", "digest"))
        return all(_alike(getattr(self, name), getattr(other, name), rtol, atol) for name in names)


def _shaped(value: Any, name: str, shape: tuple[int, ...]) -> Any:
    """The value as an array of the shape; NaN stands for what is unknown, infinity for nothing."""
    try:
        array = np.asarray(value, dtype=np.bool_ if name in ("used", "valid") else np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as numbers: {error}") from None
    if array.shape != shape:
        raise InputError(f"{name} has shape {array.shape}; expected {shape}")
    if np.isinf(array).any():
        raise InputError(f"{name} is infinite at station {np.argwhere(np.isinf(array))[0, 0] + 1}; use NaN for unknown")
    return array


def _named(values: Mapping[str, Any], name: str, allowed: tuple[str, ...], size: int) -> Mapping[str, Array]:
    unknown = sorted(set(values) - set(allowed))
    if unknown:
        raise InputError(f"{name} {unknown} unknown; allowed: {', '.join(allowed)}")
    spread = {k: np.full(size, v, dtype=np.float64) if np.ndim(v) == 0 else v for k, v in values.items()}
    return MappingProxyType({k: frozen(_shaped(v, f"{name} {k}", (size,))) for k, v in spread.items()})


def _increasing(md: Array, used: Mask | None) -> None:
    row = first_not_increasing(md, used)
    if row is not None:
        before = md[:row] if used is None else md[:row][used[:row]]
        raise InputError(f"md is {md[row]:.12g} m at station {row + 1} after {before[-1]:.12g} m; it must increase")


def first_not_increasing(md: Array, used: Mask | None = None) -> int | None:
    """Index of the first used station that is not deeper than the used one before it, or None.

    Examples
    --------
    >>> first_not_increasing(np.array([0.0, 30.0, 30.0])), first_not_increasing(np.array([0.0, 30.0]))
    (2, None)
    """
    rows = np.arange(len(md)) if used is None else np.flatnonzero(used)
    back = np.flatnonzero(np.diff(md[rows]) <= 0.0)
    return int(rows[back[0] + 1]) if back.size else None


def _alike(a: Any, b: Any, rtol: float, atol: float) -> bool:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_alike(a[k], b[k], rtol, atol) for k in a)
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.shape == b.shape and bool(np.allclose(a, b, rtol, atol, equal_nan=True))
    return type(a) is type(b) and bool(a == b)

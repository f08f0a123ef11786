"""From the signals of a run to field vectors in tool axes, SI: by the units of the columns or by a calibration."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from inclinometry.calibration.result import UNSTATED, Calibration, same_units
from inclinometry.core.arrays import Array
from inclinometry.core.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.core.errors import FileError, InputError
from inclinometry.earth.site import Site
from inclinometry.io.columns import KIND_PREFIX
from inclinometry.io.even_log import TO_SI
from inclinometry.io.run_file import RunBlock, RunFile
from inclinometry.sensors.triad import Triad
from inclinometry.workflow.dynamic_absurd import Absurd

INSIDE: Final = {"accelerometer": "m/s^2", "magnetometer": "nT", "gyro": "rad/s"}
_ALLOWED: Final = {
    "accelerometer": ("m/s^2", "g", "mg"),
    "magnetometer": ("nT", "uT"),
    "gyro": ("rad/s", "deg/s", "deg/h"),
}
_LEAST: Final = {"accelerometer": 4.0, "magnetometer": 200.0}
"""Median strength that no run falls below unless its unit is another: shaking only adds to gravity, and no casing takes
all but a hundredth of the field along the hole."""
FASTEST: Final = 210.0
"""rad/s, 2000 rpm: a median rate beyond it is in degrees a second."""


class Signals:
    """Turns blocks of a run into SI, one after the other.

    Parameters
    ----------
    run : RunFile
    site : Site
        Its gravity and field strength serve a calibration that does not know its own.
    calibration : Calibration, optional
        Without one the channels are field vectors in tool axes: m/s^2 (gravity convention), nT, rad/s, or as named.
    turned : kind -> (3, 3) ndarray
        Without a calibration, what takes the channels of a kind to tool axes where they lie otherwise.

    Raises
    ------
    InputError
        Units that do not go together, triads the calibration has not, channels that are not x, y, z.

    Notes
    -----
    A sample of which a channel is missing is NaN in that triad. Temperature holds its last value where it is missing.
    """

    def __init__(
        self,
        run: RunFile,
        site: Site,
        calibration: Calibration | None = None,
        turned: Mapping[str, Array] = MappingProxyType({}),
    ) -> None:
        self._run, self._calibration, self._turned = run, calibration, turned
        self._warm: float | None = None
        self._judged = False
        self.absurd = Absurd(run.names)
        if calibration is None:
            self._factors = {kind: _factor(kind, run.units[kind], names) for kind, names in run.names.items()}
        else:
            same_units({kind: run.units[kind] for kind in run.names}, calibration)
            self._strengths = {kind: _strength(run, calibration, kind, site) for kind in run.names}
            _check_heat(run, calibration)

    def fields(self, block: RunBlock) -> dict[str, Array]:
        """Prefix ("accel", "mag", "gyro") -> (n, 3) in SI, and "temperature" -> (n,) where there is one.

        Raises
        ------
        FileError
            In the first block, values that are in another unit than the columns say.
        """
        heat = None if block.temperature is None else self._held(block.temperature)
        found: dict[str, Array] = {}
        for kind, values in block.channels.items():
            if self._calibration is None:
                found[kind] = values * self._factors[kind]
            else:
                triad = self._calibration.tool.triads[kind]
                found[kind] = self._strengths[kind] * _field(triad, values, heat, found.get("accelerometer"))
            found[kind] = self.absurd.blanked(kind, values, found[kind])
            if kind in self._turned:
                found[kind] = found[kind] @ self._turned[kind].T
        self.absurd.counted(len(block.time))
        if not self._judged:
            self._judged = True
            for kind, vectors in found.items():
                self._judge(kind, vectors)
        named = {KIND_PREFIX[kind]: vectors for kind, vectors in found.items()}
        return named if heat is None else {**named, "temperature": heat}

    def _held(self, temperature: Array) -> Array:
        """Temperature (n,) with the last value where there is none; the first there is before it."""
        good = np.isfinite(temperature)
        if good.all():
            self._warm = float(temperature[-1])
            return temperature
        if self._warm is None:
            self._warm = float(temperature[good][0]) if good.any() else np.nan
        values = np.concatenate([[self._warm], temperature])
        latest = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
        held = values[latest][1:]
        self._warm = float(held[-1])
        return np.asarray(held)

    def _judge(self, kind: str, vectors: Array) -> None:
        """Refuse a unit that cannot be."""
        strength = np.linalg.norm(vectors, axis=1)
        strength = strength[np.isfinite(strength)]
        if not strength.size:
            return
        middle, unit = float(np.median(strength)), INSIDE[kind]
        where = "column's unit, or the calibration" if self._calibration is None else "calibration"
        if middle == 0.0 and kind != "accelerometer":
            return  # a dead triad is found window by window; the others may do without it
        if kind in _LEAST and middle < _LEAST[kind]:
            other = "accel_x_g" if kind == "accelerometer" else "mag_x_uT"
            hint = f" (in another unit? then name the columns {other} and so on)" if self._calibration is None else ""
            raise FileError(
                f"the {kind} reads {middle:.4g} {unit} (median); {_LEAST[kind]:g} or more is expected{hint}: "
                f"check the {where}",
                path=self._run.path,
            )
        if kind == "gyro" and middle > FASTEST:
            raise FileError(
                f"the gyro reads {middle:.4g} rad/s (median), {middle * 30.0 / np.pi:.0f} rpm; up to {FASTEST:g} rad/s "
                f"is expected (in degrees? then name the columns gyro_x_deg_s and so on): check the {where}",
                path=self._run.path,
            )


def _factor(kind: str, unit: str, names: tuple[str, ...]) -> float:
    """What turns uncalibrated channels into SI."""
    axes = [name.removeprefix(f"{KIND_PREFIX[kind]}_")[:1] for name in names]
    if axes != ["x", "y", "z"]:
        raise InputError(
            f"{kind} columns are {', '.join(names)}; without a calibration x, y and z along the tool are needed: "
            "complete them, drop them or give --calibration"
        )
    if unit == UNSTATED:
        return 1.0
    if unit not in _ALLOWED[kind]:
        allowed = ", ".join(_ALLOWED[kind])
        raise InputError(f"the {kind} is in {unit}; without a calibration {allowed} are allowed: convert or calibrate")
    inside, factor = TO_SI.get(unit, (unit, 1.0))
    if inside != INSIDE[kind]:
        raise InputError(f"the {kind} is in {unit}, which is no unit of it")
    return factor


def _strength(run: RunFile, calibration: Calibration, kind: str, site: Site) -> float:
    """Strength of the calibration's field, SI."""
    tool = calibration.tool
    if kind not in tool.triads:
        raise InputError(f"the run has a {kind}, the calibration has none: calibrate it or drop its columns")
    triad = tool.triads[kind]
    if len(run.names[kind]) != triad.count:
        raise InputError(f"{len(run.names[kind])} {kind} channels, the calibration has {triad.count}: another tool?")
    if not triad.full:
        raise InputError(f"the {kind} sees only a plane; three seen components are needed: drop its columns")
    if triad.g_sensitivity is not None and "accelerometer" not in run.names:
        raise InputError("the gyro's g-sensitivity needs the accelerometers, and the run has none: add their columns")
    other = {"accelerometer": site.gravity, "magnetometer": site.b, "gyro": EARTH_RATE}[kind]
    strength = triad.field_strength or other
    if strength is None:
        needed = "a latitude or g" if kind == "accelerometer" else "b_nT"
        raise InputError(f"the calibration does not know the strength of its {kind} field; give the site {needed}")
    return float(strength)


def _check_heat(run: RunFile, calibration: Calibration) -> None:
    hot = [kind for kind in run.names if calibration.tool.triads[kind].degree]
    if hot and not run.header.temperature:
        raise InputError(f"the calibration of the {hot[0]} depends on temperature; add the column temperature_degC")


def _field(triad: Triad, signals: Array, heat: Array | None, gravity: Array | None) -> Array:
    """Field (n, 3) in units of the calibration's; rows with a missing channel are NaN."""
    missing = np.asarray(~np.isfinite(signals).all(axis=1))
    u = np.where(missing[:, None], 0.0, signals)
    if triad.g_sensitivity is not None and gravity is not None:
        missing |= ~np.isfinite(gravity).all(axis=1)
        u = triad.without_gravity(u, np.nan_to_num(gravity) / STANDARD_GRAVITY)
    if triad.degree == 0:
        field = triad.field(u)
    else:
        if heat is None or not np.isfinite(heat).all():
            raise InputError("the calibration depends on temperature, and temperature_degC is empty from the start")
        powers = triad.basis(heat)
        tensor = np.tensordot(powers, triad.tensor, axes=1)
        rest = (u - powers @ triad.offset)[..., None]
        # square systems are solved as they are: a pseudo-inverse a sample takes fifteen times as long
        turned = np.swapaxes(tensor, -1, -2)
        square = triad.count == 3
        field = np.asarray(np.linalg.solve(tensor if square else turned @ tensor, rest if square else turned @ rest))
        field = np.asarray(field[..., 0], dtype=np.float64)
    field[missing] = np.nan
    return np.asarray(field)


def temperature_doubts(run_range: tuple[float, float] | None, calibration: Calibration | None) -> list[str]:
    """A sentence where the run was hotter or colder than the calibration."""
    span = None if calibration is None else calibration.tool.temperature_range
    if span is None or run_range is None or (span[0] <= run_range[0] and run_range[1] <= span[1]):
        return []
    return [
        f"the run was at {run_range[0]:.1f} to {run_range[1]:.1f} degC, the calibration at {span[0]:.1f} to "
        f"{span[1]:.1f} degC: its parameters are extrapolated"
    ]


def tool_name(calibration: Calibration | None) -> str:
    """Name of the calibrated tool, "" without a calibration."""
    return "" if calibration is None else calibration.tool.name

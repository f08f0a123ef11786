"""From the signals of a run to field vectors in tool axes, SI: by the units of the columns or by a calibration."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.calibration.result import UNSTATED, Calibration, same_units
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, refused
from inclinometry.files._quantities import to_si
from inclinometry.files.columns import KIND_PREFIX
from inclinometry.files.run_file import RunBlock, RunFile
from inclinometry.findings import Finding, Value
from inclinometry.motion.axes import too_fast
from inclinometry.parity import consistent
from inclinometry.sensors import Triad

# Single values of a run that no sensor reads: markers of other programs for a missing value, and broken bytes.


class OutOfRange:
    """Finds such values block by block, blanks their rows and says so.

    Parameters
    ----------
    names : mapping
        Kind of sensor -> its columns.
    """

    def __init__(self, names: Mapping[str, tuple[str, ...]]) -> None:
        self._names = names
        self._rows = 0
        self._first: dict[str, tuple[int, float]] = {}  # column -> row from 1, value as in the file
        self._counts: dict[str, int] = {}

    def masked(self, kind: str, signals: Array, vectors: Array) -> Array:
        """Vectors (n, 3) in SI with NaN where such a value is among the `signals` (n, m) of the file."""
        # values that well log files write where there is none; whole numbers that could be readings are not among
        # them
        markers = (-999.25, -9999.25, -999999.0)
        bad: Mask = np.array(np.isin(signals, markers))
        # m/s^2 (200 g), nT, rad/s: beyond any reading of a tool that works, when it stands alone
        most = {"accelerometer": 2000.0, "magnetometer": 9e4, "gyro": 1000.0}
        far: Mask = np.asarray(np.abs(np.nan_to_num(vectors)) > most[kind])
        # share of rows up to which such values stand alone; more are a unit or a calibration that is wrong
        alone = 0.01
        if far.any() and float(np.mean(np.any(far, axis=1))) <= alone:
            np.logical_or(bad, self._columns(far, np.abs(signals)), out=bad)
        if not bad.any():
            return vectors
        for place in np.flatnonzero(bad.any(axis=0)):
            column, rows = self._names[kind][place], np.flatnonzero(bad[:, place])
            self._first.setdefault(column, (self._rows + int(rows[0]) + 1, float(signals[rows[0], place])))
            self._counts[column] = self._counts.get(column, 0) + rows.size
        return np.where(bad if bad.shape == vectors.shape else np.any(bad, axis=1, keepdims=True), np.nan, vectors)

    def counted(self, rows: int) -> None:
        """So many rows are done."""
        self._rows += rows

    def findings(self) -> tuple[Finding, ...]:
        """One for each column."""
        found = []
        for column, (row, value) in self._first.items():
            values: dict[str, Value] = {"channel": column, "value": value, "row": row, "count": self._counts[column]}
            found.append(Finding("motion-no-reading", values, (row - 1,), "note"))
        return tuple(found)

    def _columns(self, far: Mask, size: Array) -> Mask:
        """Which signals (n, m) made a vector so large: the largest of the row, where the channels are not x, y, z."""
        if far.shape == size.shape:
            return far
        largest = np.nan_to_num(size).argmax(axis=1)
        return np.asarray(np.any(far, axis=1, keepdims=True) & (np.arange(size.shape[1]) == largest[:, None]))


class Signals:
    """Turns blocks of a run into SI, one after the other.

    Without a calibration channels are field vectors in tool axes: m/s^2 (gravity convention), nT, rad/s, or as named;
    `turned` takes a kind to tool axes. A calibration without its own strengths has those of the site. A triad with a
    missing channel is NaN in that sample. Temperature holds its last value.
    """

    def __init__(
        self,
        run: RunFile,
        site: Site,
        calibration: Calibration | None = None,
        turned: Mapping[str, Array] = MappingProxyType({}),
    ) -> None:
        self._run, self._turned, self._tool = run, turned, None if calibration is None else calibration.tool
        self._warm: float | None = None
        self._judged = False
        self.out_of_range = OutOfRange(run.names)
        self._left_out: list[tuple[str, int]] = []
        self.contradictions: dict[str, Finding] = {}
        if calibration is None:
            self._factors = {kind: _factor(kind, run.units[kind], names) for kind, names in run.names.items()}
        else:
            same_units({kind: run.units[kind] for kind in run.names}, calibration.tool)
            self._strengths = {kind: _strength(run, calibration, kind, site) for kind in run.names}
            hot = [kind for kind in run.names if calibration.tool.triads[kind].degree]
            if hot and "temperature_degC" not in run.wanted:
                raise refused("input-temperature", {"kind": hot[0]})

    def fields(self, block: RunBlock) -> dict[str, Array]:
        """Prefix ("accel", "mag", "gyro") -> (n, 3) in SI, and "temperature" -> (n,) where there is one.

        Raises
        ------
        FileError
            In the first block, values that are in another unit than the columns say.
        """
        heat = None if block.temperature is None else self._held(block.temperature)
        found: dict[str, Array] = {}
        agreed = self._agreed(block.channels, heat)
        for kind, values in block.channels.items():
            if self._tool is None:
                found[kind] = values * self._factors[kind]
            else:
                field = _field(self._tool.triads[kind], agreed[kind], heat, found.get("accelerometer"))
                found[kind] = self._strengths[kind] * field
            found[kind] = self.out_of_range.masked(kind, values, found[kind])
            if kind in self._turned:
                found[kind] = found[kind] @ self._turned[kind].T
        self.out_of_range.counted(len(block.time))
        if not self._judged:
            self._judged = True
            for kind, vectors in found.items():
                self._judge(kind, vectors)
        named = {KIND_PREFIX[kind]: vectors for kind, vectors in found.items()}
        return named if heat is None else {**named, "temperature": heat}

    def _agreed(self, channels: Mapping[str, Array], heat: Array | None) -> dict[str, Array]:
        """Channels of a block without the sensors that contradict the others, now or in a block before."""
        if self._tool is None or not any(values.shape[1] > 3 for values in channels.values()):
            return dict(channels)
        channels = dict(channels)
        for kind, sensor in self._left_out:
            channels[kind] = np.delete(channels[kind], sensor, axis=1)
        whole = np.flatnonzero(np.isfinite(np.concatenate(list(channels.values()), axis=1)).all(axis=1))
        some = whole[:: max(len(whole) // 1000, 1)]
        judged = {kind: values[some] for kind, values in channels.items() if values.shape[1] > 3}
        if judged and len(some):
            found = consistent(self._tool, judged, None if heat is None else heat[some])
            for one in found.findings:
                self.contradictions.setdefault(str(one.values["kind"]), one._replace(rows=()))
            self._left_out += found.left_out.items()
            self._tool = found.tool
            for kind, sensor in found.left_out.items():
                channels[kind] = np.delete(channels[kind], sensor, axis=1)
        return channels

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
        middle = float(np.median(strength))
        if middle == 0.0 and kind != "accelerometer":
            return  # a dead triad is found window by window; the others may do without it
        # median strength that no run falls below unless its unit is another: shaking only adds to gravity, and no
        # casing takes all but a hundredth of the field along the hole
        least = {"accelerometer": 4.0, "magnetometer": 200.0}
        if middle < least.get(kind, 0.0):
            unit = {"accelerometer": "m/s2", "magnetometer": "nT"}[kind]
            values: dict[str, Value] = {
                "sensor": kind,
                "reading": middle,
                "unit": unit,
                "allowed": f">= {least[kind]:g}",
            }
            raise FileError(Finding("motion-size", values, severity="refused"), path=self._run.path)
        fastest = 210.0  # rad/s, 2000 rpm: a median rate beyond it is in degrees a second
        if kind == "gyro" and middle > fastest:
            raise FileError(Finding("motion-size", too_fast(middle, fastest), severity="refused"), path=self._run.path)


def _factor(kind: str, unit: str, names: tuple[str, ...]) -> float:
    """What turns uncalibrated channels into SI."""
    axes = [name.removeprefix(f"{KIND_PREFIX[kind]}_")[:1] for name in names]
    if axes != ["x", "y", "z"]:
        raise refused("input-axes", {"kind": kind, "columns": names})
    if unit == UNSTATED:
        return 1.0
    allowed = {"accelerometer": ("m/s^2", "g", "mg"), "magnetometer": ("nT", "uT"), "gyro": ("rad/s", "deg/s", "deg/h")}
    if unit not in allowed[kind]:
        raise refused("input-unit", {"kind": kind, "unit": unit, "allowed": allowed[kind]})
    return to_si(unit)[1]


def _strength(run: RunFile, calibration: Calibration, kind: str, site: Site) -> float:
    """Strength of the calibration's field, SI."""
    tool = calibration.tool
    if kind not in tool.triads:
        raise refused("input-uncalibrated", {"kind": kind})
    triad = tool.triads[kind]
    if len(run.names[kind]) != triad.count:
        count = len(run.names[kind])
        raise refused("input-channels", {"kind": kind, "channels": count, "calibrated": triad.count})
    if not triad.full:
        raise refused("input-plane", {"kind": kind})
    if triad.g_sensitivity is not None and "accelerometer" not in run.names:
        raise refused("input-g-sensitive")
    other = {"accelerometer": site.gravity, "magnetometer": site.b, "gyro": EARTH_RATE}[kind]
    strength = triad.field_strength or other
    if strength is None:
        raise refused("input-strength", {"kind": kind})
    return float(strength)


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
            raise refused("input-temperature", {"kind": triad.kind})
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


def temperature_findings(run_range: tuple[float, float] | None, calibration: Calibration | None) -> list[Finding]:
    """A run that was hotter or colder than the calibration."""
    span = None if calibration is None else calibration.tool.temperature_range
    if span is None or run_range is None or (span[0] <= run_range[0] and run_range[1] <= span[1]):
        return []
    low, high = run_range
    return [
        Finding("motion-temperature", {"low_degC": low, "high_degC": high, "from_degC": span[0], "to_degC": span[1]})
    ]

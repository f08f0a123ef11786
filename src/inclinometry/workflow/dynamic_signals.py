"""From the signals of a run to field vectors in tool axes, SI: by the units of the columns or by a calibration."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any, Final, Protocol

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.calibration.result import UNSTATED, Calibration, same_units
from inclinometry.constants import EARTH_RATE, FIELD_UNITS, STANDARD_GRAVITY
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, InputError
from inclinometry.files.columns import KIND_PREFIX
from inclinometry.files.log_csv import TO_SI
from inclinometry.files.run_file import RunBlock, RunFile
from inclinometry.motion.axes import expected_dip
from inclinometry.motion.choose import TURNING
from inclinometry.motion.health import HealthCheck, WindowHealth, named
from inclinometry.motion.reference import FAR_DIP, RunDip, azimuth_uncertainty, widened
from inclinometry.motion.result import BITS, Attitude, Envelope, Finding, Samples, Spectrogram, joined
from inclinometry.motion.window_filter import WindowBuffer
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

    def notes(self) -> tuple[str, ...]:
        """A sentence for each column."""
        return tuple(
            f"{column} is {value:.6g} in row {row}: no reading"
            + (f" (and {self._counts[column] - 1} more of its values)" if self._counts[column] > 1 else "")
            + "; taken for missing"
            for column, (row, value) in self._first.items()
        )

    def _columns(self, far: Mask, size: Array) -> Mask:
        """Which signals (n, m) made a vector so large: the largest of the row, where the channels are not x, y, z."""
        if far.shape == size.shape:
            return far
        largest = np.nan_to_num(size).argmax(axis=1)
        return np.asarray(np.any(far, axis=1, keepdims=True) & (np.arange(size.shape[1]) == largest[:, None]))


# Long signals thinned to what a page shows, in memory that does not grow: bins double when they run out.

MOST_BINS: Final = 1500
"""Stretches of an envelope; never more than twice as many are held."""
MOST_COLUMNS: Final = 400
"""Columns of a spectrogram, likewise."""


class Envelopes:
    """Lowest, mean and highest value of c channels in bins of time.

    Examples
    --------
    >>> thin = Envelopes(["a"], ["nT"], 0.0, 1.0)
    >>> thin.push(np.arange(5000.0), np.arange(5000.0)[:, None])
    >>> found, = thin.done()
    >>> len(found.time), found.low[:3], found.high[-2:]
    (2500, array([0., 2., 4.]), array([4997., 4999.]))
    """

    def __init__(self, names: Sequence[str], units: Sequence[str], start: float, width: float) -> None:
        self._names, self._units = list(names), list(units)
        self._start, self._width = start, width
        shape = (2 * MOST_BINS, len(self._names))
        self._low, self._high = np.full(shape, np.inf), np.full(shape, -np.inf)
        self._sum, self._count = np.zeros(shape), np.zeros(2 * MOST_BINS)

    def push(self, time: Array, values: Array) -> None:
        """Take samples (n,) and their channels (n, c), in order of time."""
        if not len(time):
            return
        while time[-1] - self._start >= self._width * 2 * MOST_BINS:
            for held, empty, join in ((self._low, np.inf, np.minimum), (self._high, -np.inf, np.maximum)):
                held[:MOST_BINS] = join(held[::2], held[1::2])
                held[MOST_BINS:] = empty
            _halved(self._sum, MOST_BINS)
            _halved(self._count, MOST_BINS)
            self._width *= 2.0
        place = ((time - self._start) / self._width).astype(np.intp)
        first = np.flatnonzero(np.diff(place, prepend=-1))
        bins = place[first]
        self._low[bins] = np.minimum(self._low[bins], np.minimum.reduceat(values, first))
        self._high[bins] = np.maximum(self._high[bins], np.maximum.reduceat(values, first))
        self._sum[bins] += np.add.reduceat(values, first)
        self._count[bins] += np.diff(first, append=len(time))

    def done(self) -> tuple[Envelope, ...]:
        """What has been seen; bins without a sample are left out."""
        seen = np.flatnonzero(self._count)
        time = np.asarray(self._start + self._width * (seen + 0.5), dtype=np.float64)
        mean = self._sum[seen] / self._count[seen][:, None]
        return tuple(
            Envelope(name, unit, time, self._low[seen, k], mean[:, k], self._high[seen, k])
            for k, (name, unit) in enumerate(zip(self._names, self._units, strict=True))
        )


class Spectra:
    """Mean power spectra of equal stretches of time.

    Examples
    --------
    >>> thin = Spectra("noise", 0.0, 1.0, np.arange(3.0))
    >>> for second in range(2000):
    ...     thin.push(second + 0.5, np.full(3, float(second)))
    >>> found = thin.done()
    >>> found.density.shape, float(found.density[0, 0]), float(found.time[-1])
    ((500, 3), 1.5, 2000.0)
    """

    def __init__(self, what: str, start: float, width: float, frequency: Array) -> None:
        self._what, self._start, self._width, self._frequency = what, start, width, frequency
        self._sum, self._count = np.zeros((2 * MOST_COLUMNS, len(frequency))), np.zeros(2 * MOST_COLUMNS)

    def push(self, time: float, density: Array) -> None:
        """Take the spectrum (f,) of a window with this middle."""
        while time - self._start >= self._width * 2 * MOST_COLUMNS:
            _halved(self._sum, MOST_COLUMNS)
            _halved(self._count, MOST_COLUMNS)
            self._width *= 2.0
        place = int((time - self._start) / self._width)
        self._sum[place] += density
        self._count[place] += 1.0

    def done(self) -> Spectrogram:
        """What has been seen; NaN where no window was."""
        size = int(np.flatnonzero(self._count)[-1]) + 1 if self._count.any() else 0
        with np.errstate(invalid="ignore"):
            density = self._sum[:size] / self._count[:size, None]
        edges = np.asarray(self._start + self._width * np.arange(size + 1), dtype=np.float64)
        return Spectrogram(self._what, edges, self._frequency, density)


def _halved(held: Array, half: int) -> None:
    """Add up neighbours: the first half then covers what the whole did."""
    held[:half] = held[::2] + held[1::2]
    held[half:] = 0.0


class Stream(Protocol):
    """What every recursive method is."""

    def push(self, samples: Samples) -> Attitude:
        """Rows that became complete."""
        ...

    def finish(self) -> Attitude:
        """The last rows, and what was found."""
        ...


class CheckedStream:
    """A method whose rows are held until the window they lie in has been judged.

    Parameters
    ----------
    stream : Stream
        The method.
    window : float
        s, of the checks.
    site : Site
    needs : tuple of str
        Triads the method's rows rest on.
    carries : bool
        Whether its azimuth is carried by a gyro from the best field it has met; else it is that of each window.
    still : bool
        Whether its rows hold for a tool at rest only.
    """

    def __init__(
        self, stream: Stream, window: float, site: Site, needs: tuple[str, ...], *, carries: bool, still: bool = False
    ) -> None:
        self._stream, self._site, self._needs, self._carries = stream, site, needs, carries
        self._still, self._moved, self._judged_rows = still, 0, 0
        self._buffer, self._check = WindowBuffer(window), HealthCheck(None, site)
        # what windows mean for their rows: start and stop, s, findings, flags refused for, u of azimuth, rad, turned
        self._verdicts: deque[tuple[float, float, WindowHealth, int, float, bool]] = deque()
        self._held: list[Attitude] = []
        self._best = np.inf
        self._misfits = 0
        self._seen = RunDip(site)

    def push(self, samples: Samples) -> Attitude:
        """Rows that became complete and were judged.

        Raises
        ------
        InputError
            As the method, and units, signs or axes that contradict each other (`HealthCheck`).
        """
        self._seen.add(samples)
        self._judge(self._buffer.push(samples))
        self._held.append(self._stream.push(samples))
        return self._released(self._verdicts[-1][1] if self._verdicts else -np.inf)

    def finish(self) -> Attitude:
        """The rows still held, what the method found and what the checks did."""
        self._judge(self._buffer.finish())
        last = self._stream.finish()
        self._held.append(last)
        rows = self._released(np.inf)
        said = self._check.notes(besides=() if "mag" in self._needs else ("no-field", "disturbed"))
        if self._misfits and not said:
            dip, words = expected_dip(self._site)
            off = dip is not None and abs(self._seen.dip - dip) > FAR_DIP
            seen = f"the dip comes out as {np.degrees(self._seen.dip):.1f} deg, {words}; " if off else ""
            said = (
                f"{self._misfits} rows were refused for misfit: {seen}gravity, field and rate contradict each other. "
                "Likely an axis or a sign, a sensor that is late, a scale or the site's dip; the method auto looks at "
                "each window by itself",
            )
        if self._moved:
            said = (
                f"the tool was not at rest in {self._moved} of {self._judged_rows} windows, which are refused: means "
                "of gravity and field are its attitude only while it stands; the method auto takes the others as well",
                *said,
            )
        return replace(rows, notes=tuple(dict.fromkeys((*last.notes, *rows.notes, *said))))

    def _judge(self, windows: list[Samples]) -> None:
        for window in windows:
            health = self._check.check(window)
            refused = sum(BITS[flag] for flag in {one.flag for one in health.findings if self._forbids(one)})
            u_azimuth = azimuth_uncertainty(health.off, self._site) if "mag" in self._needs else 0.0
            if self._carries:
                self._best = u_azimuth = min(self._best, u_azimuth) if window.has("mag") else 0.0
            half = 0.5 * window.interval
            start, stop = float(window.time[0]) - half, float(window.time[-1]) + half
            lean = replace(health, samples=window.part(0, 0))  # the readings themselves are not kept
            turned = health.turning.span >= TURNING
            self._verdicts.append((start, stop, lean, refused, u_azimuth, turned))

    def _forbids(self, one: Finding) -> bool:
        """Whether a finding leaves nothing to be made of the window by this method."""
        # findings that leave nothing to be made of a window; the others the methods know how to deal with
        decisive = ("axes", "stuck", "misfit")
        if not (one.refuse and one.flag in decisive):
            return False
        # a gyro that carries takes no notice of a field that is off
        spared = self._carries and one.flag == "axes" and one.where == "mag"
        return not spared and any(triad in one.where for triad in self._needs)

    def _released(self, until: float) -> Attitude:
        """Rows up to `until`, judged."""
        rows = joined(self._held)
        early = rows.time <= until
        self._held = [_rows(rows, ~early)]
        done = _rows(rows, early)
        self._misfits += int(np.count_nonzero(done.refused & (done.flags & np.uint32(BITS["misfit"]) > 0)))
        parts = []
        for place in range(len(done)):
            one = _rows(done, np.arange(len(done)) == place)
            while len(self._verdicts) > 1 and self._verdicts[0][1] < float(one.time[0]):
                self._verdicts.popleft()
            parts.append(self._judged(one))
        return replace(joined(parts), notes=done.notes) if parts else done

    def _judged(self, row: Attitude) -> Attitude:
        if not self._verdicts:
            return row
        start, stop, health, refused, u_azimuth, turned = self._verdicts[0]
        if not start <= float(row.time[0]) <= stop:
            return row
        row = widened(named(row, health), u_azimuth)
        if self._still:
            moved = turned or bool(int(row.flags[0]) & (BITS["not-still"] | BITS["vibration"]))
            self._judged_rows, self._moved = self._judged_rows + 1, self._moved + moved
            refused |= BITS["not-still"] if moved else 0
        if refused:
            blank = np.full_like(row.quaternion, np.nan), np.full_like(row.covariance, np.nan)
            row = replace(row, quaternion=blank[0], covariance=blank[1], quality=np.zeros(1))
        return replace(row, flags=row.flags | np.uint32(health.flags | refused))


def _rows(rows: Attitude, chosen: Any) -> Attitude:
    """Some of the rows."""
    columns = {one.name: getattr(rows, one.name)[chosen] for one in fields(rows) if one.name not in ("north", "notes")}
    return replace(rows, **columns)


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
        self.out_of_range = OutOfRange(run.names)
        if calibration is None:
            self._factors = {kind: _factor(kind, run.units[kind], names) for kind, names in run.names.items()}
        else:
            same_units({kind: run.units[kind] for kind in run.names}, calibration)
            self._strengths = {kind: _strength(run, calibration, kind, site) for kind in run.names}
            hot = [kind for kind in run.names if calibration.tool.triads[kind].degree]
            if hot and not run.header.temperature:
                raise InputError(
                    f"the calibration of the {hot[0]} depends on temperature; add the column temperature_degC"
                )

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
        middle, unit = float(np.median(strength)), FIELD_UNITS[kind]
        where = "column's unit, or the calibration" if self._calibration is None else "calibration"
        if middle == 0.0 and kind != "accelerometer":
            return  # a dead triad is found window by window; the others may do without it
        # median strength that no run falls below unless its unit is another: shaking only adds to gravity, and no
        # casing takes all but a hundredth of the field along the hole
        least = {"accelerometer": 4.0, "magnetometer": 200.0}
        if middle < least.get(kind, 0.0):
            other = "accel_x_g" if kind == "accelerometer" else "mag_x_uT"
            hint = f" (in another unit? then name the columns {other} and so on)" if self._calibration is None else ""
            raise FileError(
                f"the {kind} reads {middle:.4g} {unit} (median); {least[kind]:g} or more is expected{hint}: "
                f"check the {where}",
                path=self._run.path,
            )
        fastest = 210.0  # rad/s, 2000 rpm: a median rate beyond it is in degrees a second
        if kind == "gyro" and middle > fastest:
            raise FileError(
                f"the gyro reads {middle:.4g} rad/s (median), {middle * 30.0 / np.pi:.0f} rpm; up to {fastest:g} rad/s "
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
    allowed = {"accelerometer": ("m/s^2", "g", "mg"), "magnetometer": ("nT", "uT"), "gyro": ("rad/s", "deg/s", "deg/h")}
    if unit not in allowed[kind]:
        raise InputError(
            f"the {kind} is in {unit}; without a calibration {', '.join(allowed[kind])} are allowed: convert or "
            "calibrate"
        )
    inside, factor = TO_SI.get(unit, (unit, 1.0))
    if inside != FIELD_UNITS[kind]:
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

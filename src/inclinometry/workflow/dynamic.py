"""A run of a moving tool from its file to attitude by window, read block by block: any length in the same memory."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from inclinometry.arrays import Array, Mask, within
from inclinometry.calibration.result import Calibration
from inclinometry.constants import DIP, FIELD_UNITS, STRING_INTERFERENCE
from inclinometry.conventions import AXES, Axes, axes_matrix, named
from inclinometry.earth.site import REFERENCES, Site, convert_azimuth
from inclinometry.errors import FileError, InputError
from inclinometry.files.attitude_file import write_attitude
from inclinometry.files.columns import KIND_PREFIX, PREFIXES
from inclinometry.files.run_file import BLOCK, RunFile
from inclinometry.motion.decimate import unit_warning
from inclinometry.motion.magnetic.phase import LAG_SIGMA, MagneticSettings
from inclinometry.motion.result import (
    BITS,
    CHANNELS,
    Attitude,
    AttitudeRows,
    DynamicRun,
    Envelope,
    Excerpt,
    RunCounts,
    Samples,
    Spectrogram,
    Vibration,
)
from inclinometry.motion.result import METHODS as RESULT_METHODS
from inclinometry.motion.timing import Piece, StretchCutter, rejoined
from inclinometry.orientation import SWITCH, Angles, angles_jacobian, fields
from inclinometry.rotations import TAU, dcm_from_quaternion, quaternion_from_dcm, rotation_z
from inclinometry.sensors import angle_sensitivity
from inclinometry.survey.reduce import turned_to_north
from inclinometry.tabular import check_record
from inclinometry.uncertainty import UNKNOWN
from inclinometry.workflow.dynamic_methods import (
    LONGEST,
    METHODS,
    SHORTEST,
    CarriedAttitude,
    Method,
    MethodName,
    Setup,
    Stream,
    chosen_method,
    gyro_known,
    offset_uncertainty,
)
from inclinometry.workflow.dynamic_signals import Envelopes, Signals, Spectra, temperature_doubts, tool_name
from inclinometry.workflow.field import completed

# From the motion package's attitudes to the rows of a file: the north asked for, and what the calibration adds.

TURNS: Final = 8
"""Toolfaces over which the calibration's share is averaged while the tool turns."""


class Rows:
    """Collects rows; each part of a run comes with the length of its windows.

    Parameters
    ----------
    site : Site
        Its `north_reference` is what azimuths are counted from; a gyro's is never turned to magnetic north.
    calibration : Calibration, optional
    window : float
        s; a tool that turns more than once in it is seen from all sides.
    scale : float
        Without a calibration, standard deviation of each scale error and coupling of the magnetometer; a third of it
        is the accelerometers'.
    """

    def __init__(self, site: Site, calibration: Calibration | None, window: float, scale: float = 0.0) -> None:
        self._scale = scale
        self._site, self._calibration, self._window = site, calibration, window
        self._parts: list[AttitudeRows] = []
        self.notes: list[str] = []
        self.heat: float | None = None
        """degC of the rows to come, for a calibration that depends on it."""

    def __len__(self) -> int:
        return sum(map(len, self._parts))

    def add(self, found: Attitude) -> None:
        """Rows that follow those before.

        Raises
        ------
        InputError
            The site lacks the declination or convergence its north reference needs.
        """
        self.notes += [note for note in found.notes if note not in self.notes]
        if not len(found):
            return
        at = found.angles
        good = ~found.refused
        common = np.stack(found.u_common, axis=1) ** 2
        random = np.stack(found.u, axis=1) ** 2 - common
        if good.any():
            turning = np.abs(np.nan_to_num(found.rate[good])) * self._window > TAU
            seen = Angles(*(column[good] for column in at))
            if self._calibration is not None:
                common[good] += self._by_calibration(self._calibration, seen, turning, found.north)
            elif self._scale:
                common[good] += self._by_scale(seen, turning, found.north)
        azimuth, north, quaternion = np.full(len(found), np.nan), found.north, found.quaternion.copy()
        if good.any():
            turned, variances, north, said = turned_to_north(
                at.azimuth[good], {"own": common[good]}, self._site, found.north
            )
            azimuth[good] = turned
            common[good] = np.sum(list(variances.values()), axis=0)
            # C(A + d, I, T) = C(A, I, T) R_z(d)
            by = rotation_z(turned - at.azimuth[good])
            quaternion[good] = quaternion_from_dcm(dcm_from_quaternion(quaternion[good]) @ by)
            self.notes += [note for note in said if note not in self.notes]
        spread, shared = (np.minimum(np.sqrt(part), UNKNOWN) for part in (common + random, common))
        # share of the uncertainty of an angle nothing is known of from which it is left blank
        nothing = 0.999
        # an angle of which nothing is known is no angle, though the row has others
        unknown = spread >= nothing * UNKNOWN
        self._parts.append(
            AttitudeRows(
                time=found.time,
                inclination=at.inclination,
                azimuth=np.where(unknown[:, 1], np.nan, azimuth),
                toolface=np.where(unknown[:, 2], np.nan, at.toolface),
                u_inclination=spread[:, 0],
                u_azimuth=spread[:, 1],
                u_toolface=spread[:, 2],
                rate=found.rate,
                quality=found.quality,
                flags=found.flags,
                method=found.method,
                north=np.full(len(found), REFERENCES.index(north), dtype=np.uint8),
                # of the filter of any motion it is given all the same: its azimuth counts from an arbitrary direction
                quaternion=np.where(
                    unknown[:, 3:] & (found.method != RESULT_METHODS.index("complementary"))[:, None],
                    np.nan,
                    quaternion,
                ),
                magnetic_toolface=np.where(unknown[:, 3], np.nan, at.magnetic_toolface),
                u_magnetic_toolface=spread[:, 3],
                u_common_inclination=shared[:, 0],
                u_common_azimuth=shared[:, 1],
                u_common_toolface=shared[:, 2],
            )
        )

    def done(self) -> AttitudeRows:
        """All rows."""
        # a run without a whole window has been refused: there is a part
        return AttitudeRows(
            **{
                each.name: np.concatenate([getattr(part, each.name) for part in self._parts])
                for each in dataclasses.fields(AttitudeRows)
            }
        )

    def _by_calibration(self, calibration: Calibration, at: Angles, turning: Mask, source: str) -> Array:
        """Variances (k, 4) of inclination, azimuth and toolfaces by scale factors and couplings of the calibration.

        Offsets are left to the methods, which know whether the tool turned them away; so is the gyro, whose bias and
        scale are states of the filters.
        """
        tool = calibration.tool
        if "accelerometer" not in tool.triads:
            return np.zeros((len(turning), 4))
        heat = None if self.heat is None else np.full(len(turning), self.heat)
        moved = np.zeros((len(turning), 4, len(tool.parameter_names)))
        for g, b in self._seen(at, turning):
            seen = {"accelerometer": g}
            if source == "magnetic" and "magnetometer" in tool.triads:
                seen["magnetometer"] = b
            moved += angle_sensitivity(tool, seen, heat).by_parameter / TURNS
        # exactly vertical azimuth and toolface have no derivative: their uncertainty is unbounded anyway
        moved = np.where(np.isfinite(moved), moved, 0.0)
        moved[..., [".offset[" in name for name in tool.parameter_names]] = 0.0
        return np.asarray(np.einsum("kap,pq,kaq->ka", moved, tool.covariance, moved, optimize=True))

    def _by_scale(self, at: Angles, turning: Mask, source: str) -> Array:
        """Variances (k, 4) by scale errors and couplings, each independent, of sensors that no calibration vouches for.

        A change E of a triad's matrix moves its field v by E v; what turns with the tool averages out.
        """
        moved = np.zeros((2, len(turning), 4, 3, 3))
        for g, b in self._seen(at, turning):
            slopes = angles_jacobian(g, b) / TURNS
            slopes = np.where(np.isfinite(slopes), slopes, 0.0)
            moved[0] += slopes[:, :, :3, None] * g[:, None, None, :]
            moved[1] += slopes[:, :, 3:, None] * b[:, None, None, :]
        by_accel, by_mag = np.sum(moved**2, axis=(3, 4))
        accel_share = 1.0 / 3.0  # scale errors of uncalibrated accelerometers, of those of the magnetometer
        return np.asarray(self._scale**2 * (accel_share**2 * by_accel + (by_mag if source == "magnetic" else 0.0)))

    def _seen(self, at: Angles, turning: Mask) -> Iterator[tuple[Array, Array]]:
        """Directions of gravity and field from `TURNS` sides where the tool turns, else as often from the one."""
        dip = DIP if self._site.dip is None else self._site.dip
        for step in range(TURNS):
            toolface = at.toolface + np.where(turning, TAU * step / TURNS, 0.0)
            yield fields(at.azimuth, at.inclination, toolface, dip)


# How a run shook and turned, window by window, beside its attitude; memory does not grow with the run.

SEGMENT: Final = 256
"""Samples of a spectrum."""
Phasor = NDArray[np.complex128]


class Monitor:
    """Takes the even pieces of a run.

    Parameters
    ----------
    window : float
        s, of the vibration rows.
    """

    def __init__(self, window: float) -> None:
        self._window = window
        self._held: list[Samples] = []
        self._size = 0
        self._number = -1
        self._rows: list[tuple[float, ...]] = []
        self._names: tuple[str, ...] = ()
        self._envelopes: Envelopes | None = None
        self._spectra: Spectra | None = None
        self._interval = 0.0
        self._first: Excerpt | None = None
        self._worst: Excerpt | None = None
        self._most = -1.0
        self.clipped = 0
        self.heat: tuple[float, float] | None = None
        """Lowest and highest temperature, degC."""

    def push(self, number: int, samples: Samples) -> None:
        """A piece of stretch `number`."""
        if not len(samples):
            return
        if number != self._number:
            self._rest()
            self._number = number
        if self._envelopes is None:
            self._names = tuple(name for name in CHANNELS if samples.has(name))
            names = [f"{name}_{axis}" for name in self._names for axis in "xyz"]
            units = [FIELD_UNITS[PREFIXES[name]] for name in self._names for _ in "xyz"]
            self._envelopes = Envelopes(names, units, float(samples.time[0]), samples.interval)
            self._interval = samples.interval
        self._envelopes.push(samples.time, np.concatenate([getattr(samples, n) for n in self._names], axis=1))
        if samples.clipped is not None:
            self.clipped += int(samples.clipped.sum())
        if samples.temperature is not None:
            low, high = float(samples.temperature.min()), float(samples.temperature.max())
            self.heat = (low, high) if self.heat is None else (min(low, self.heat[0]), max(high, self.heat[1]))
        self._held.append(samples)
        self._size += len(samples)
        wanted = max(SEGMENT, round(self._window / samples.interval))
        if self._size < wanted:
            return
        whole = rejoined(self._held)
        start = 0
        while start + wanted <= len(whole):
            self._take(whole.part(start, start + wanted))
            start += wanted
        self._held, self._size = [whole.part(start, len(whole))], len(whole) - start

    def _rest(self) -> None:
        """What is left at the end of a stretch, if it is half a window or more."""
        if self._size and self._size >= 0.5 * self._window / self._held[0].interval:
            self._take(rejoined(self._held))
        self._held, self._size = [], 0

    def _take(self, window: Samples) -> None:
        time = float(window.time[0] + window.time[-1]) / 2.0
        # exp(-i toolface) of each sample but for a constant angle: by the transverse field, else by the gyro
        if window.mag is not None:
            field = window.mag[:, 0] + 1j * window.mag[:, 1]
            strength = np.abs(field)
            # a circle about its own middle, unless there is only an arc of it
            phasor = np.asarray(np.where(strength > 0.0, field / np.where(strength > 0.0, strength, 1.0), 1.0))
        elif window.gyro is not None:
            phasor = np.asarray(np.exp(-1j * np.cumsum(window.gyro[:, 2]) * window.interval))
        else:
            phasor = None
        shaking = _shaking(window, phasor)
        self._rows.append((time, *shaking, *_speeds(window, phasor)))
        lateral = shaking[0]
        if self._first is None:
            self._first = self._excerpt(window, "first seconds")
        if lateral > self._most:
            self._most, self._worst = lateral, self._excerpt(window, "strongest vibration")
        if window.accel is None or len(window) < SEGMENT or abs(window.interval / self._interval - 1.0) > 1e-3:
            return
        if self._spectra is None:
            width = len(window) * window.interval
            frequency = np.arange(SEGMENT // 2 + 1) / (SEGMENT * window.interval)
            self._spectra = Spectra("lateral acceleration", time - width / 2.0, width, frequency)
        self._spectra.push(time, _density(window))

    def _excerpt(self, window: Samples, what: str) -> Excerpt:
        shown = 2000  # samples of an excerpt at most
        excerpt = 5.0  # s of an excerpt at most
        part = window.part(0, min(len(window), shown, max(2, round(excerpt / window.interval))))
        channels: dict[str, Array] = {}
        for name in self._names:
            channels |= {f"{name}_{axis}": getattr(part, name)[:, k].copy() for k, axis in enumerate("xyz")}
        units: Mapping[str, str] = {name: FIELD_UNITS[PREFIXES[name.split("_")[0]]] for name in channels}
        return Excerpt(what, part.time.copy(), channels, units)

    def finish(self) -> tuple[Vibration, tuple[Envelope, ...], tuple[Excerpt, ...], Spectrogram | None]:
        """Everything, at the end of the run."""
        self._rest()
        columns = np.array(self._rows, dtype=np.float64).reshape(-1, 7).T
        excerpts = tuple(each for each in (self._first, self._worst) if each is not None)
        if len(excerpts) == 2 and excerpts[0].time[0] == excerpts[1].time[0]:
            excerpts = excerpts[:1]
        envelopes = () if self._envelopes is None else self._envelopes.done()
        return Vibration(*columns), envelopes, excerpts, None if self._spectra is None else self._spectra.done()


def _shaking(window: Samples, phasor: Phasor | None) -> tuple[float, float, float]:
    """Of a window, rms of a transverse and the axial component and largest magnitude, m/s^2.

    What is left of the accelerometers without their means and gravity as it turns.

    z = ax + i ay = c0 + c1 exp(-i T) + rest, both constants by least squares: c0 offsets and centripetal acceleration,
    c1 gravity across the hole.
    """
    if window.accel is None:
        return np.nan, np.nan, np.nan
    good = slice(None) if window.clipped is None or window.clipped.all() else ~window.clipped
    across = (window.accel[:, 0] + 1j * window.accel[:, 1])[good]
    along = window.accel[good, 2] - window.accel[good, 2].mean()
    rest = across - across.mean()
    if phasor is not None:
        u = phasor[good] - phasor[good].mean()
        power = float(np.mean(np.abs(u) ** 2))
        # mean of the unit phasor of the toolface above which it hardly turns, and gravity is part of the plain mean
        fixed = 0.99
        if power > 1.0 - fixed**2:
            rest = rest - (np.mean(rest * np.conj(u)) / power) * u
    square = np.abs(rest) ** 2
    peak = float(np.sqrt((square + along**2).max(initial=0.0)))
    return float(np.sqrt(square.mean() / 2.0)), float(along.std()), peak


def _speeds(window: Samples, phasor: Phasor | None) -> tuple[float, float, float]:
    """Slowest, mean and fastest rotation speed over 0.1 s, rad/s."""
    if window.gyro is not None:
        rate = window.gyro[:, 2]
    elif phasor is not None and len(window) > 1:
        rate = -np.angle(phasor[1:] * np.conj(phasor[:-1])) / window.interval
    else:
        return np.nan, np.nan, np.nan
    over = max(1, min(len(rate), round(0.1 / window.interval)))
    means = rate[: len(rate) // over * over].reshape(-1, over).mean(axis=1)
    return float(means.min()), float(rate.mean()), float(means.max())


def _density(window: Samples) -> Array:
    """One-sided spectral density of x and y together (f,), m^2/s^4/Hz: the sum does not depend on the toolface."""
    if window.accel is None:
        return np.empty(0)
    count = len(window) // SEGMENT
    across = window.accel[: count * SEGMENT, :2].reshape(count, SEGMENT, 2)
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(SEGMENT) + 0.5) / SEGMENT)
    lines = np.fft.rfft((across - across.mean(axis=1, keepdims=True)) * hann[:, None], axis=1)
    power = np.mean(np.abs(lines) ** 2, axis=0).sum(axis=1) * window.interval / np.sum(hann**2)
    power[1:-1] *= 2.0
    return np.asarray(power)


Progress = Callable[[int], None]
DEFAULT_WINDOW: Final = 10.0
DELAY_SIGMA: Final = 1e-4
"""s: triads sampled together whose anti-alias filters are alike to a few per cent of their delay."""
SCALE_SIGMA: Final = 3e-3
"""Of a triad trimmed once and never calibrated in its housing."""


@dataclass(frozen=True)
class DynamicOptions:
    """How a run is reduced.

    method : a key of `METHODS`.
    window : s, length of a window.
    delay_sigma : s, standard uncertainty of the time by which the sensors are out of step; a speed that changes shows
        more.
    scale_sigma : without a calibration, of each scale error and coupling of the magnetometer, a third of it of the
        accelerometers.
    axial_sigma : nT, standard uncertainty of the field that the string adds along the tool.
    lag, lag_sigma : s, time constant of the eddy currents in the collar and its standard uncertainty: the transverse
        field is late by atan(omega lag); a speed that changes shows it.
    block : samples handled at a time; results do not depend on it.
    gyro_noise, gyro_bias_sigma : of the gyro, rad/sqrt(s) and rad/s, where they are stated; see `gyro_known`.
    allan : content of an allan.json, where there is one.
    convention : without a calibration, axes and signs of the file's sensors, one of `conventions`.
    axes, mag_axes : without a calibration, the file's channels that are x, y and z of the convention: of all triads,
        and of the magnetometer before that.
    switch : rad, inclination below which a row is steered by its magnetic toolface, from there on by gravity's.
    interval : s, between the rows of the complementary filter; the window when not given.

    Raises
    ------
    InputError
        An unknown method; a window out of range.

    Examples
    --------
    >>> DynamicOptions("psychic")
    Traceback (most recent call last):
    inclinometry.errors.InputError: method is 'psychic'; allowed: auto, static, quaternion,
    magnetic, gyro, filter, robust, smoother, complementary
    """

    method: MethodName = "auto"
    window: float = DEFAULT_WINDOW
    block: int = BLOCK
    delay_sigma: float = DELAY_SIGMA
    scale_sigma: float = SCALE_SIGMA
    axial_sigma: float = STRING_INTERFERENCE
    lag: float = 0.0
    lag_sigma: float = LAG_SIGMA
    gyro_noise: float | None = None
    gyro_bias_sigma: float | None = None
    allan: Mapping[str, Any] | None = None
    convention: str | None = None
    axes: Axes | None = None
    mag_axes: Axes | None = None
    switch: float = SWITCH
    interval: float | None = None

    def __post_init__(self) -> None:
        chosen_method(self.method)
        if not SHORTEST <= self.window <= LONGEST:
            raise InputError(f"the window is {self.window:g} s; allowed {SHORTEST:g} to {LONGEST:g} s")
        within(self.delay_sigma, "the standard deviation of the delay", 0.0, 0.01, "s")
        within(self.scale_sigma, "the standard deviation of the scale errors", 0.0, 0.1)
        within(self.axial_sigma, "the standard deviation of the axial interference", 0.0, 1e5, "nT")
        within(self.lag, "the lag of the field", 0.0, 0.05, "s")
        within(self.lag_sigma, "the standard deviation of the lag", 0.0, 0.05, "s")
        if self.gyro_noise is not None:
            within(self.gyro_noise, "the gyro's noise", 1e-9, 1.0, "rad/sqrt(s)")
        if self.gyro_bias_sigma is not None:
            within(self.gyro_bias_sigma, "the standard deviation of the gyro's bias", 0.0, 1.0, "rad/s")
        within(self.switch, "the inclination of the switch of toolfaces", 0.0, 0.5 * np.pi, "rad")
        if self.interval is not None:
            within(self.interval, "the interval between rows", 1e-4, LONGEST, "s")
            if self.method != "complementary":
                raise InputError(f"an interval is for the method complementary; {self.method} has a row a window")
        if self.block < 1:
            raise InputError(f"the block is {self.block} samples; allowed: 1 or more")


def dynamic_run(
    run: RunFile,
    site: Site,
    calibration: Calibration | None = None,
    options: DynamicOptions | None = None,
    *,
    inputs: Mapping[str, str] | None = None,
) -> DynamicRun:
    """Attitude of a run, window by window.

    Parameters
    ----------
    run : RunFile
        From `open_run`; it is read once.
    site : Site
        Its `north_reference` decides what azimuths are counted from; field and gravity are references.
    calibration : Calibration, optional
        Without one the channels are field vectors in tool axes (m/s^2 in the gravity convention, nT, rad/s).
    options : DynamicOptions, optional
    inputs : name -> digest, optional
        Of the other files.

    Returns
    -------
    DynamicRun

    Raises
    ------
    FileError
        As `open_run`; stamps that lie on no grid or run backwards; values in another unit than stated.
    InputError
        A method whose triads the run has not; a calibration of another tool; a site that lacks what its north
        reference needs.
    """
    check_record(run, RunFile, "dynamic_run")
    check_record(site, Site, "dynamic_run")
    chosen = options or DynamicOptions()
    method = chosen_method(chosen.method)
    place, said = completed(site)
    there = {KIND_PREFIX[kind] for kind in run.names}
    missing = [prefix for prefix in method.needs if prefix not in there]
    if missing:
        able = [other for other, each in METHODS.items() if set(each.needs) <= there]
        remedy = ": add columns such as accel_x, accel_y, accel_z (m/s^2, gravity minus acceleration)"
        remedy = f"; it can be reduced with --method {' or '.join(able)}" if able else remedy
        problem = f"the method {chosen.method!r} needs {', '.join(missing)}, which the run has not{remedy}"
        raise FileError(problem, path=run.path)
    # before anything is read: whether azimuths can be turned to the north asked for
    if "magnetometer" in run.names:
        convert_azimuth(0.0, "magnetic", place.north_reference, place)
    elif place.north_reference == "grid":
        convert_azimuth(0.0, "true", "grid", place)
    setup, known = _setup(run, place, calibration, chosen)
    work = _Pipeline(
        Signals(run, place, calibration, _turned(run, calibration, chosen)),
        Rows(place, calibration, chosen.window, chosen.scale_sigma),
        setup,
        method,
    )
    try:
        for block in run.blocks(chosen.block):
            fields = work.signals.fields(block)
            work.take(work.cutter.push(block.time, **fields), len(block.time))
        work.take(work.cutter.finish(), 0)
        for found in work.carried.finish():
            work.rows.add(found)
    except FileError:
        raise
    except InputError as error:
        raise FileError(str(error), path=run.path) from None
    if not len(work.rows):
        length = f"the run lasts {work.stop - work.start:.6g} s, and no stretch of it fills a window"
        raise FileError(f"{length} of {chosen.window:g} s; give a longer run or a shorter window", path=run.path)
    rows = work.rows.done()
    # single windows are refused in the rows, with their flags; so is a run that has no field at all. Where every window
    # is refused for a dip that is not the site's, the site or the axes are wrong, not the windows
    if (rows.refused & (rows.flags & np.uint32(BITS["axes"] | BITS["misfit"]) > 0)).all():
        wrong = next((note for note in work.rows.notes if "the dip comes out as" in note), None)
        if wrong is not None:
            raise FileError(f"no window has an attitude: {wrong}", path=run.path)
    vibration, envelopes, excerpts, spectrogram = work.monitor.finish()
    report = work.cutter.report
    counts = RunCounts(
        work.samples,
        work.monitor.clipped + report.repeats,
        round(work.start, 9) + 0.0,
        round(work.stop, 9) + 0.0,
        report.intervals[0] if report.intervals else float("nan"),
        report.stretches,
    )
    notes = (
        *run.notes,
        *said,
        *known,
        *work.signals.out_of_range.notes(),
        *report.notes(),
        *temperature_doubts(work.monitor.heat, calibration),
        *work.rows.notes,
    )
    return DynamicRun(
        rows,
        vibration,
        envelopes,
        excerpts,
        spectrogram,
        counts,
        chosen.method,
        chosen.window,
        place.north_reference,
        tuple(dict.fromkeys(notes)),
        {"run": run.digest(), **(inputs or {})},
        tool_name(calibration),
        chosen.switch,
    )


def _setup(
    run: RunFile, place: Site, calibration: Calibration | None, options: DynamicOptions
) -> tuple[Setup, tuple[str, ...]]:
    """What the method is made from, and what is to be said of the gyro where there is one."""
    offsets = offset_uncertainty(calibration, place)
    stated = (options.gyro_noise, options.gyro_bias_sigma, options.allan)
    if "gyro" not in run.names:
        if any(one is not None for one in stated):
            raise FileError("the gyro's noise or bias is stated, and the run has no gyro", path=run.path)
        return _made(place, calibration, options, offsets, {}), ()
    known, said = gyro_known(options.gyro_noise, options.gyro_bias_sigma, offsets, options.allan)
    # said where it decides: known from somewhere, or an azimuth that rests on the gyro
    say = bool(known) or options.method == "gyro" or "magnetometer" not in run.names
    return _made(place, calibration, options, offsets, known), (said,) if say else ()


def _made(
    place: Site,
    calibration: Calibration | None,
    options: DynamicOptions,
    offsets: Mapping[str, float],
    gyro: Mapping[str, float],
) -> Setup:
    """What a method is made from, by the options."""
    # a calibration does not tell how the axes lie to the axis of rotation
    coupling = max(MagneticSettings.coupling_sigma, options.scale_sigma / 3.0 if calibration is None else 0.0)
    return Setup(
        place,
        options.window,
        offsets,
        options.delay_sigma,
        options.axial_sigma,
        options.lag,
        options.lag_sigma,
        coupling,
        gyro,
        options.interval,
    )


def _turned(run: RunFile, calibration: Calibration | None, options: DynamicOptions) -> dict[str, Array]:
    """Kind -> matrix (3, 3) that takes its channels to tool axes, where one is stated."""
    if options.convention is None and options.axes is None and options.mag_axes is None:
        return {}
    if calibration is not None:
        raise InputError("a convention or axes are of no use with a calibration, which knows them; leave them out")
    convention = named(options.convention or "native")
    found = {}
    for kind in run.names:
        found[kind] = convention.matrix(kind) @ axes_matrix(options.axes or AXES)
        if kind == "magnetometer":
            found[kind] = found[kind] @ axes_matrix(options.mag_axes or AXES)
    return found


def attitude_stream(
    site: Site, options: DynamicOptions | None = None, calibration: Calibration | None = None
) -> Stream:
    """A method of `dynamic_run` fed block by block: for a rig that wants attitudes while it drills.

    Parameters
    ----------
    site : Site
    options : DynamicOptions, optional
        Method, window, and what is known of the sensors; axes are those of the tool.
    calibration : Calibration, optional
        What it leaves uncertain of the offsets; the samples are field vectors already.

    Returns
    -------
    Stream
        `push(Samples)` gives an `Attitude` with the rows that became complete, `finish()` the last ones and the notes;
        the same rows to the last bit however a run is cut into blocks. Azimuth counts from the method's own north
        (`Attitude.north`). What `dynamic_run` adds to the uncertainty, the share of the calibration's scales and of the
        declination, is not in it.

    Raises
    ------
    InputError
        As `DynamicOptions`; `push` raises what the method raises.

    Examples
    --------
    >>> from inclinometry.motion.result import Samples
    >>> stream = attitude_stream(Site(b=44721.0, dip=1.1071), DynamicOptions("static", 1.0))
    >>> still = Samples(np.arange(250) / 100.0, 0.01, accel=[[0.0, 0.0, 9.81]] * 250, mag=[[2e4, 0.0, 4e4]] * 250)
    >>> [len(stream.push(still.part(start, start + 50))) for start in range(0, 250, 50)]
    [0, 1, 0, 1, 0]
    """
    check_record(site, Site, "attitude_stream")
    chosen = options or DynamicOptions()
    place, _ = completed(site)
    offsets = offset_uncertainty(calibration, place)
    known, _ = gyro_known(chosen.gyro_noise, chosen.gyro_bias_sigma, offsets, chosen.allan)
    return chosen_method(chosen.method).make(_made(place, calibration, chosen, offsets, known))


class _Pipeline:
    """The stages a run passes through."""

    def __init__(self, signals: Signals, rows: Rows, setup: Setup, method: Method) -> None:
        self.signals, self.rows = signals, rows
        self.cutter, self.monitor = StretchCutter(), Monitor(setup.window)
        self.carried = CarriedAttitude(method, setup)
        self.samples, self.start, self.stop = 0, float("nan"), float("nan")

    def take(self, pieces: list[Piece], count: int) -> None:
        """Even pieces that became certain, and the rows read for them."""
        self.samples += count
        for piece in pieces:
            samples = piece.samples
            if not len(samples):
                continue
            said = unit_warning(samples.interval)
            if said:
                raise InputError(said)
            if self.start != self.start:
                self.start = float(samples.time[0])
            self.stop = float(samples.time[-1])
            if samples.temperature is not None:
                self.rows.heat = float(samples.temperature.mean())
            self.monitor.push(piece.number, samples)
            for found in self.carried.push(piece.number, samples):
                self.rows.add(found)


def write_dynamic(found: DynamicRun, path: str | Path) -> None:
    """Write the attitude of a run, CSV or Parquet; digests of the inputs go into the metadata of Parquet."""
    check_record(found, DynamicRun, "write_dynamic")
    header = {"method": found.method, "window_s": f"{found.window:g}"}
    header |= {f"input {name}": text for name, text in found.inputs.items()}
    write_attitude(found.rows, path, header, switch=found.switch)

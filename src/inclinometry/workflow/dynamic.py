"""A run of a moving tool from its file to attitude by window, read block by block: any length in the same memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.attitude.conventions import AXES, Axes, axes_matrix, named
from inclinometry.attitude.orientation import SWITCH
from inclinometry.calibration.result import Calibration
from inclinometry.core.arrays import Array, within
from inclinometry.core.errors import FileError, InputError
from inclinometry.earth.site import Site
from inclinometry.io.attitude_file import write_attitude
from inclinometry.io.columns import KIND_PREFIX
from inclinometry.io.run_file import BLOCK, RunFile
from inclinometry.motion.grid import unit_doubt
from inclinometry.motion.result import BITS
from inclinometry.motion.run_result import DynamicRun, RunCounts
from inclinometry.motion.timing import Piece, StretchCutter
from inclinometry.workflow.dynamic_methods import (
    LONGEST,
    METHODS,
    SHORTEST,
    Carried,
    Method,
    MethodName,
    Setup,
    Stream,
    chosen_method,
    gyro_known,
    offset_doubt,
)
from inclinometry.workflow.dynamic_monitor import Monitor
from inclinometry.workflow.dynamic_rows import Rows
from inclinometry.workflow.dynamic_signals import Signals, temperature_doubts, tool_name
from inclinometry.workflow.field import completed

Progress = Callable[[int], None]
_REMEDY: Final = "add columns such as accel_x, accel_y, accel_z (m/s^2, gravity minus acceleration)"
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
    block : samples handled at a time; results do not depend on it.
    gyro_noise, gyro_bias_sigma : of the gyro, rad/sqrt(s) and rad/s, where they are stated; see `gyro_known`.
    allan : content of an allan.json, where there is one.
    convention : without a calibration, axes and signs of the file's sensors, one of `attitude.conventions`.
    axes, mag_axes : without a calibration, the file's channels that are x, y and z of the convention: of all triads,
        and of the magnetometer before that.
    switch : rad, inclination below which a row is steered by its magnetic toolface, from there on by gravity's.

    Raises
    ------
    InputError
        An unknown method; a window out of range.

    Examples
    --------
    >>> DynamicOptions("psychic")
    Traceback (most recent call last):
    inclinometry.core.errors.InputError: method is 'psychic'; allowed: auto, static, quaternion,
    magnetic, gyro, filter, robust, smoother, complementary
    """

    method: MethodName = "auto"
    window: float = DEFAULT_WINDOW
    block: int = BLOCK
    delay_sigma: float = DELAY_SIGMA
    scale_sigma: float = SCALE_SIGMA
    gyro_noise: float | None = None
    gyro_bias_sigma: float | None = None
    allan: Mapping[str, Any] | None = None
    convention: str | None = None
    axes: Axes | None = None
    mag_axes: Axes | None = None
    switch: float = SWITCH

    def __post_init__(self) -> None:
        chosen_method(self.method)
        if not SHORTEST <= self.window <= LONGEST:
            raise InputError(f"the window is {self.window:g} s; allowed {SHORTEST:g} to {LONGEST:g} s")
        within(self.delay_sigma, "the standard deviation of the delay", 0.0, 0.01, "s")
        within(self.scale_sigma, "the standard deviation of the scale errors", 0.0, 0.1)
        if self.gyro_noise is not None:
            within(self.gyro_noise, "the gyro's noise", 1e-9, 1.0, "rad/sqrt(s)")
        if self.gyro_bias_sigma is not None:
            within(self.gyro_bias_sigma, "the standard deviation of the gyro's bias", 0.0, 1.0, "rad/s")
        within(self.switch, "the inclination of the switch of toolfaces", 0.0, 0.5 * np.pi, "rad")
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
    chosen = options or DynamicOptions()
    method = chosen_method(chosen.method)
    place, said = completed(site)
    _check_triads(run, chosen.method, method)
    _check_north(place, run)
    setup, known = _setup(run, place, calibration, chosen)
    work = _Work(
        run,
        Signals(run, place, calibration, _turned(run, calibration, chosen)),
        Rows(place, calibration, chosen.window, chosen.scale_sigma),
        setup,
        method,
    )
    try:
        for block in run.blocks(chosen.block):
            fields = work.signals.fields(block)
            work.take(work.cutter.push(block.time, **fields), len(block.time))
        work.end()
    except FileError:
        raise
    except InputError as error:
        raise FileError(str(error), path=run.path) from None
    if not len(work.rows):
        length = f"the run lasts {work.stop - work.start:.6g} s, and no stretch of it fills a window"
        raise FileError(f"{length} of {chosen.window:g} s; give a longer run or a shorter window", path=run.path)
    _check_left(work.rows, run)
    vibration, envelopes, excerpts, spectrogram = work.monitor.finish()
    heat = temperature_doubts(work.monitor.heat, calibration)
    notes = (
        *run.notes,
        *said,
        *known,
        *work.signals.absurd.notes(),
        *work.cutter.report.notes(),
        *heat,
        *work.rows.notes,
    )
    return DynamicRun(
        work.rows.done(),
        vibration,
        envelopes,
        excerpts,
        spectrogram,
        work.counts(),
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
    doubt = offset_doubt(calibration, place)
    stated = (options.gyro_noise, options.gyro_bias_sigma, options.allan)
    if "gyro" not in run.names:
        if any(one is not None for one in stated):
            raise FileError("the gyro's noise or bias is stated, and the run has no gyro", path=run.path)
        return Setup(place, options.window, doubt, options.delay_sigma), ()
    known, said = gyro_known(options.gyro_noise, options.gyro_bias_sigma, doubt, options.allan)
    # said where it decides: known from somewhere, or an azimuth that rests on the gyro
    say = bool(known) or options.method == "gyro" or "magnetometer" not in run.names
    return Setup(place, options.window, doubt, options.delay_sigma, known), (said,) if say else ()


def _turned(run: RunFile, calibration: Calibration | None, options: DynamicOptions) -> dict[str, Array]:
    """Kind -> matrix (3, 3) that takes its channels to tool axes, where one is stated."""
    if options.convention is None and options.axes is None and options.mag_axes is None:
        return {}
    if calibration is not None:
        raise InputError("a convention or axes are of no use with a calibration, which knows them; leave them out")
    convention = named(options.convention or "house")
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
    >>> from inclinometry.motion.samples import Samples
    >>> stream = attitude_stream(Site(b=44721.0, dip=1.1071), DynamicOptions("static", 1.0))
    >>> still = Samples(np.arange(250) / 100.0, 0.01, accel=[[0.0, 0.0, 9.81]] * 250, mag=[[2e4, 0.0, 4e4]] * 250)
    >>> [len(stream.push(still.part(start, start + 50))) for start in range(0, 250, 50)]
    [0, 1, 0, 1, 0]
    """
    chosen = options or DynamicOptions()
    place, _ = completed(site)
    doubt = offset_doubt(calibration, place)
    known, _ = gyro_known(chosen.gyro_noise, chosen.gyro_bias_sigma, doubt, chosen.allan)
    return chosen_method(chosen.method).make(Setup(place, chosen.window, doubt, chosen.delay_sigma, known))


@dataclass
class _Work:
    """The rooms a run passes through."""

    run: RunFile
    signals: Signals
    rows: Rows
    setup: Setup
    method: Method
    cutter: StretchCutter = field(default_factory=StretchCutter)
    samples: int = 0
    start: float = float("nan")
    stop: float = float("nan")

    def __post_init__(self) -> None:
        self.monitor = Monitor(self.setup.window)
        self.carried = Carried(self.method, self.setup)

    def take(self, pieces: list[Piece], count: int) -> None:
        """Even pieces that became certain, and the rows read for them."""
        self.samples += count
        for piece in pieces:
            samples = piece.samples
            if not len(samples):
                continue
            doubt = unit_doubt(samples.interval)
            if doubt:
                raise InputError(doubt)
            if self.start != self.start:
                self.start = float(samples.time[0])
            self.stop = float(samples.time[-1])
            if samples.temperature is not None:
                self.rows.heat = float(samples.temperature.mean())
            self.monitor.push(piece.number, samples)
            for found in self.carried.push(piece.number, samples):
                self.rows.add(found)

    def end(self) -> None:
        """What the rooms still hold."""
        self.take(self.cutter.finish(), 0)
        for found in self.carried.finish():
            self.rows.add(found)

    def counts(self) -> RunCounts:
        """Sizes of the run."""
        report = self.cutter.report
        return RunCounts(
            self.samples,
            self.monitor.clipped + report.repeats,
            round(self.start, 9) + 0.0,
            round(self.stop, 9) + 0.0,
            report.intervals[0] if report.intervals else float("nan"),
            report.stretches,
        )


def _check_triads(run: RunFile, name: str, method: Method) -> None:
    """InputError where the run lacks what a method needs."""
    there = {KIND_PREFIX[kind] for kind in run.names}
    missing = [prefix for prefix in method.needs if prefix not in there]
    if not missing:
        return
    able = [other for other, each in METHODS.items() if set(each.needs) <= there]
    remedy = f"; it can be reduced with --method {' or '.join(able)}" if able else ": " + _REMEDY
    raise FileError(f"the method {name!r} needs {', '.join(missing)}, which the run has not{remedy}", path=run.path)


def _check_north(site: Site, run: RunFile) -> None:
    """InputError, before anything is read, where magnetic azimuths cannot be turned to the north asked for."""
    from inclinometry.earth.site import convert_azimuth

    if "magnetometer" in run.names:
        convert_azimuth(0.0, "magnetic", site.north_reference, site)
    elif site.north_reference == "grid":
        convert_azimuth(0.0, "true", "grid", site)


def _check_left(rows: Rows, run: RunFile) -> None:
    """FileError where every window is refused for a dip that is not the site's: the site or the axes, not the windows.

    Single windows are refused in the rows, with their flags; so is a run that has no field at all.
    """
    found = rows.done()
    contradicted = found.flags & np.uint32(BITS["axes"] | BITS["misfit"]) > 0
    if not (found.refused & contradicted).all():
        return
    said = next((note for note in rows.notes if "the dip comes out as" in note), None)
    if said is not None:
        raise FileError(f"no window has an attitude: {said}", path=run.path)


def write_dynamic(found: DynamicRun, path: str | Path) -> None:
    """Write the attitude of a run, CSV or Parquet; digests of the inputs go into the metadata of Parquet."""
    header = {"method": found.method, "window_s": f"{found.window:g}"}
    header |= {f"input {name}": text for name, text in found.inputs.items()}
    write_attitude(found.rows, path, header, switch=found.switch)

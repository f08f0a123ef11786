"""A run of a moving tool from its file to attitude by window, read block by block: any length in the same memory."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.arrays import Array, Mask
from inclinometry.calibration.result import Calibration
from inclinometry.constants import DIP
from inclinometry.conventions import AXES, axes_matrix, named
from inclinometry.earth.site import REFERENCES, Site, convert_azimuth
from inclinometry.errors import FileError, InputError, in_file, refused
from inclinometry.files.attitude_file import write_attitude
from inclinometry.files.columns import KIND_PREFIX
from inclinometry.files.run_file import RunFile
from inclinometry.findings import Finding, Value
from inclinometry.motion.decimate import check_interval
from inclinometry.motion.monitor import Monitor
from inclinometry.motion.result import BITS, Attitude, AttitudeRows, DynamicRun, RunCounts, distinct
from inclinometry.motion.timing import Piece, StretchCutter
from inclinometry.motion.window_filter import Stream
from inclinometry.orientation import Angles, angles_jacobian, fields
from inclinometry.rotations import TAU, dcm_from_quaternion, quaternion_from_dcm, rotation_z
from inclinometry.sensors import angle_sensitivity
from inclinometry.survey.reduce import turned_to_north
from inclinometry.tabular import check_record
from inclinometry.uncertainty import UNKNOWN
from inclinometry.workflow.dynamic_methods import METHODS, CarriedAttitude, DynamicOptions, Method, Setup, chosen_method
from inclinometry.workflow.dynamic_signals import Signals, temperature_findings
from inclinometry.workflow.field import completed

# From the motion package's attitudes to the rows of a file: the north asked for, and what the calibration adds.

TURNS: Final = 8
"""Toolfaces over which the calibration's share is averaged while the tool turns."""


class Rows:
    """Collects rows; each part of a run comes with the length of its windows.

    A gyro's azimuth is never turned to magnetic north. `window`: a tool that turns more than once in it (s) is seen
    from all sides. `scale`: without a calibration, sd of each scale error and coupling of the magnetometer; a third of
    it is taken for the accelerometers.
    """

    def __init__(self, site: Site, calibration: Calibration | None, window: float, scale: float = 0.0) -> None:
        self._scale = scale
        self._site, self._calibration, self._window = site, calibration, window
        self._parts: list[AttitudeRows] = []
        self.told: list[Finding] = []
        self.findings: tuple[Finding, ...] = ()
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
        self.findings = distinct((*self.findings, *found.findings))
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
            turned, variances, north, told = turned_to_north(
                at.azimuth[good], {"own": common[good]}, self._site, found.north
            )
            azimuth[good] = turned
            common[good] = np.sum(list(variances.values()), axis=0)
            # C(A + d, I, T) = C(A, I, T) R_z(d)
            by = rotation_z(turned - at.azimuth[good])
            quaternion[good] = quaternion_from_dcm(dcm_from_quaternion(quaternion[good]) @ by)
            self.told += [one for one in told if one not in self.told]
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
                quaternion=np.where(unknown[:, 3:], np.nan, quaternion),
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
    place, said = completed(site)
    work = _Pipeline(run, place, calibration, chosen)
    rows = work.through(run, chosen)
    # single windows are refused in the rows, with their flags; so is a run that has no field at all. Where every window
    # is refused for a dip that is not the site's, the site or the axes are wrong, not the windows
    if (rows.refused & (rows.flags & np.uint32(BITS["axes"] | BITS["misfit"]) > 0)).all():
        of_dip = (("motion-dip-axes", None), ("motion-field-disturbed", "dip"))
        wrong = next((one for one in work.rows.findings if (one.code, one.values.get("name")) in of_dip), None)
        if wrong is not None:
            raise FileError(wrong._replace(severity="refused"), path=run.path)
    report = work.cutter.report
    counts = RunCounts(
        work.samples,
        work.monitor.clipped + report.repeats,
        round(work.start, 9) + 0.0,
        round(work.stop, 9) + 0.0,
        report.intervals[0] if report.intervals else float("nan"),
        report.stretches,
    )
    findings = (
        *run.findings,
        *said,
        *work.rows.told,
        *work.known,
        *work.signals.out_of_range.findings(),
        *work.signals.contradictions.values(),
        *report.findings(),
        *temperature_findings(work.monitor.heat, calibration),
        *work.rows.findings,
    )
    return DynamicRun(
        rows,
        *work.monitor.finish(),
        counts,
        chosen.method,
        chosen.window,
        place.north_reference,
        {"run": run.digest(), **(inputs or {})},
        "" if calibration is None else calibration.tool.name,
        chosen.switch,
        distinct(findings),
    )


def _method(run: RunFile, place: Site, options: DynamicOptions) -> Method:
    """The method, before anything is read: whether its triads are there, and azimuths can be turned to the north."""
    method = chosen_method(options.method)
    there = {KIND_PREFIX[kind] for kind in run.names}
    missing = [prefix for prefix in method.needs if prefix not in there]
    if missing:
        able = tuple(other for other, each in METHODS.items() if set(each.needs) <= there)
        if not able:
            columns = ("accel_x", "accel_y", "accel_z")
            raise FileError(Finding("input-missing", {"names": columns}, severity="refused"), path=run.path)
        lacks: dict[str, Value] = {"method": options.method, "missing": tuple(missing), "able": able}
        raise FileError(Finding("motion-method-triads", lacks, severity="refused"), path=run.path)
    if "magnetometer" in run.names:
        convert_azimuth(0.0, "magnetic", place.north_reference, place)
    elif place.north_reference == "grid":
        convert_azimuth(0.0, "true", "grid", place)
    return method


def _turned(run: RunFile, calibration: Calibration | None, options: DynamicOptions) -> dict[str, Array]:
    """Kind -> matrix (3, 3) that takes its channels to tool axes, where one is stated."""
    if options.convention is None and options.axes is None and options.magnetometer_axes is None:
        return {}
    if calibration is not None:
        raise refused("input-not-with", {"name": "--convention, --axes", "other": "--calibration"})
    convention = named(options.convention or "native")
    found = {}
    for kind in run.names:
        found[kind] = convention.matrix(kind) @ axes_matrix(options.axes or AXES)
        if kind == "magnetometer":
            found[kind] = found[kind] @ axes_matrix(options.magnetometer_axes or AXES)
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
        `push(Samples)` gives an `Attitude` with the rows that became complete, `finish()` the last and the findings;
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
    return chosen_method(chosen.method).make(Setup(completed(site)[0], chosen, calibration, gyro=True))


class _Pipeline:
    """The stages a run passes through; `known`: what is to be said of the gyro where it decides."""

    def __init__(self, run: RunFile, place: Site, calibration: Calibration | None, options: DynamicOptions) -> None:
        method, gyro = _method(run, place, options), "gyro" in run.names
        if not gyro and (options.gyro_noise, options.gyro_bias_sigma, options.allan) != (None, None, None):
            stated: dict[str, Value] = {
                "name": "--gyro-noise-deg-sqrt-h, --gyro-bias-sd-deg-h, --allan",
                "needed": ("gyro_x", "gyro_y", "gyro_z"),
            }
            raise FileError(Finding("input-needs", stated, severity="refused"), path=run.path)
        setup = Setup(place, options, calibration, gyro=gyro)
        # known from somewhere, or an azimuth that rests on the gyro
        say = bool(setup.gyro) or options.method == "gyro" or "magnetometer" not in run.names
        self.known = (setup.gyro_finding,) if setup.gyro_finding is not None and say else ()
        self.signals = Signals(run, place, calibration, _turned(run, calibration, options))
        self.rows = Rows(place, calibration, options.window, options.scale_sigma)
        self.cutter, self.monitor = StretchCutter(), Monitor(options.window)
        self.carried = CarriedAttitude(method, setup)
        self.samples, self.start, self.stop = 0, float("nan"), float("nan")

    def through(self, run: RunFile, options: DynamicOptions) -> AttitudeRows:
        """All rows of the run; FileError where there is none."""
        try:
            for block in run.blocks(options.block):
                self.take(self.cutter.push(block.time, **self.signals.fields(block)), len(block.time))
            self.take(self.cutter.finish(), 0)
            for found in self.carried.finish():
                self.rows.add(found)
        except FileError:
            raise
        except InputError as error:
            raise in_file(error, run.path) from None
        if not len(self.rows):
            window = {"window_s": options.window}
            raise FileError(Finding("motion-no-window", window, severity="refused"), path=run.path)
        return self.rows.done()

    def take(self, pieces: list[Piece], count: int) -> None:
        """Even pieces that became certain, and the rows read for them."""
        self.samples += count
        for piece in pieces:
            samples = piece.samples
            if not len(samples):
                continue
            check_interval(samples.interval)
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

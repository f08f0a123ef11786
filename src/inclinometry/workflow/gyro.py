"""A gyro run from its readings to stations with north and scale factor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from inclinometry.calibration.result import Calibration
from inclinometry.core.arrays import Array
from inclinometry.core.constants import EARTH_RATE, STANDARD_GRAVITY
from inclinometry.core.errors import FileError, InputError
from inclinometry.earth.site import Site
from inclinometry.gyro.closed_form import solve_patent
from inclinometry.gyro.north import estimate_north, estimate_north_fixed, to_high_side
from inclinometry.gyro.result import North
from inclinometry.gyro.tilt import tilt, upward
from inclinometry.gyro.tracking import (
    ScaleBelief,
    ScaleTrack,
    quadratic_belief,
    smooth_scale,
    track_scale,
    walking_belief,
)
from inclinometry.io.gyro_csv import GyroReadings, write_gyro_stations
from inclinometry.io.scale_json import ScaleRecord
from inclinometry.survey.checks import Check
from inclinometry.survey.flags import HEAT_MARGIN
from inclinometry.survey.gyro import gyro_survey
from inclinometry.survey.gyro_quality import rate_checks, rate_unit_suspect
from inclinometry.survey.reduce import Survey
from inclinometry.workflow.gyro_average import LIGHTEST, Averages, average_run, gravity_suspect

METHODS: Final = ("joint", "patent", "fixed")
PRIORS: Final = ("calibration", "previous", "both", "run")
"""Where what is known of the scale before a station comes from: the calibration alone; the station before; the
stations before and the calibration's temperature curve; or all other stations of the run and that curve."""

LEARNING_WALK: Final = 5e-4
"""Wandering of the scale per root of a degC for the prior "previous"."""

VAGUE: Final = 0.01
"""Standard uncertainty of a scale factor while units are still in doubt."""


@dataclass(frozen=True)
class GyroOptions:
    """How a run is reduced; rates in rad/s, angles in rad.

    scheme : index positions, a key of `inclinometry.gyro.indexing.SCHEMES`.
    method : one of `METHODS`.
    prior : one of `PRIORS`; None: "run" where the file has temperatures, else "calibration".
    scale_sd : standard uncertainty of the scale factor at the reference temperature.
    slope_sd, bend_sd : of its change over 100 degC, linear and square.
    jitter : standard deviation of the scale from station to station.
    history : what an earlier run has taught.
    gyro_sd, accelerometer_sd, z_bias_sd, sweep : as `average_run`.
    hole : "down" or "up" for tools that cannot tell.
    """

    scheme: str = "four"
    method: str = "joint"
    prior: str | None = None
    scale_sd: float = 0.003
    slope_sd: float = 0.005
    bend_sd: float = 0.003
    jitter: float = 0.0005
    history: ScaleRecord | None = None
    gyro_sd: float | None = None
    accelerometer_sd: float | None = None
    z_bias_sd: float | None = None
    sweep: float = 0.0
    hole: str | None = None

    def __post_init__(self) -> None:
        for name, value, allowed in (("scale", self.method, METHODS), ("prior", self.prior, (None, *PRIORS))):
            if value not in allowed:
                raise InputError(f"{name} is {value!r}; allowed: {', '.join(str(a) for a in allowed if a)}")


@dataclass(frozen=True, eq=False)
class GyroRun:
    """A reduced run.

    survey : stations in order of depth.
    north : the same in the order measured, with scale factors.
    md, temperature : (n,) in the order measured; temperature None where the file has none.
    track : how the scale was learnt; None where it was not.
    others : the other methods, for comparison.
    checks : the rates against the Earth's.
    """

    survey: Survey
    north: North
    md: Array
    temperature: Array | None
    track: ScaleTrack | None
    others: Mapping[str, North]
    checks: Sequence[Check]
    tool: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.north)

    def record(self) -> ScaleRecord:
        """The scale factor of the run as a record; InputError where it was not followed."""
        if self.track is None or self.temperature is None:
            raise InputError("the scale factor was not followed over this run: temperature_degC is needed")
        track = self.track
        return ScaleRecord(
            self.tool, track.belief, self.md, track.temperature, track.expected, track.expected_sd, track.scale,
            track.scale_sd, tuple(bool(v) for v in track.learnt), dict(self.inputs),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Stations:
    """What every method is given."""

    gravity: Array
    gravity_covariance: Array
    rate: Array
    rate_covariance: Array
    latitude: float
    g: float
    hole: str | None


def north_run(
    readings: GyroReadings,
    site: Site,
    calibration: Calibration | None = None,
    options: GyroOptions | None = None,
    *,
    inputs: Mapping[str, str] | None = None,
) -> GyroRun:
    """North and scale factor of every station of a run.

    Parameters
    ----------
    readings : GyroReadings
        From `read_gyro_run`.
    site : Site
        Its latitude is needed; gravity is taken from it or from the latitude.
    calibration : Calibration, optional
    options : GyroOptions, optional
    inputs : name -> digest, optional

    Raises
    ------
    FileError
        Readings that cannot be right: units, signs against the latitude, positions.
    InputError
        No latitude; temperatures missing where the prior needs them.
    """
    chosen = options or GyroOptions()
    if site.latitude is None or site.gravity is None:
        raise InputError("the site has no latitude; north by gyro needs it: give latitude_deg")
    averages = average_run(
        readings,
        calibration,
        scheme=chosen.scheme,
        gyro_sd=chosen.gyro_sd,
        accelerometer_sd=chosen.accelerometer_sd,
        z_bias_sd=chosen.z_bias_sd,
        sweep=chosen.sweep,
        g=site.gravity,
    )
    if suspect := rate_unit_suspect(averages.rate.field) or gravity_suspect(averages.gravity.field, site.gravity):
        raise FileError(suspect, path=readings.path)
    stations = _stations(averages, site.latitude, site.gravity, chosen.hole)
    if suspect := _gravity_in_g(stations):
        raise FileError(suspect, path=readings.path)
    heat = None if readings.temperature is None else readings.mean(readings.temperature)
    known = _expected(stations, averages, heat, chosen)
    found = {method: _solve(method, stations, known) for method in METHODS}
    checks = _checks(stations, known, found["joint"])
    if refused := _refusal(checks, site.latitude):
        raise FileError(refused, path=readings.path)
    north = found.pop(chosen.method)
    track = known.track
    if chosen.method != "joint":
        track = None
    flags = _flags(averages, heat, calibration, chosen.history)
    notes = [*readings.notes, *averages.gravity.notes, *averages.rate.notes, *known.notes]
    notes += [f"calibration: {sentence}" for sentence in (calibration.warnings if calibration else ())]
    notes += [f"{c.name}: {c.reason}; {c.action}" for c in checks if c.verdict == "fail"]
    total = np.linalg.norm(averages.gravity.field, axis=1)
    digests = {"raw": readings.digest, **(inputs or {})}
    name = "" if calibration is None else calibration.tool.name
    survey = gyro_survey(
        readings.md, north, site=site, g_total=total, flags=flags, tool=name, inputs=digests, notes=notes
    )
    joined = tuple((*a, *b) for a, b in zip(north.flags, flags, strict=True))
    north = replace(north, flags=joined)
    return GyroRun(survey, north, readings.md, heat, track, found, checks, name, digests)


def _checks(stations: _Stations, known: _Known, joint: North) -> list[Check]:
    """The rates against the Earth's; gravity along the tool is taken from the solution where it is not measured."""
    gravity, covariance = stations.gravity.copy(), stations.gravity_covariance.copy()
    blind = np.isnan(gravity[:, 2])
    gravity[blind, 2] = stations.g * np.cos(joint.inclination[blind])
    covariance[blind, 2, :] = covariance[blind, :, 2] = 0.0
    covariance[blind, 2, 2] = np.mean(np.diagonal(covariance[blind, :2, :2], axis1=1, axis2=2), axis=1)
    return rate_checks(
        gravity,
        stations.rate,
        stations.latitude,
        gravity_covariance=covariance,
        rate_covariance=stations.rate_covariance,
        scale=known.scale,
        scale_sd=known.sd,
        g=stations.g,
    )


def _refusal(checks: Sequence[Check], latitude: float) -> str | None:
    """Why the readings cannot belong to this latitude, where they tell its sign."""
    by_name = {check.name: check for check in checks}
    sign, value = by_name["latitude sign"], by_name["latitude"]
    if sign.verdict != "fail":
        return None
    if value.verdict == "fail" and abs(latitude + value.value) > 3.0 * abs(latitude):
        hint = " (is it in radians? latitude_deg takes degrees)" if abs(latitude) < np.radians(1.6) else ""
        return f"{value.reason}{hint}; {value.action}"
    return f"{sign.reason}; {sign.action}"


def _stations(averages: Averages, latitude: float, g: float, hole: str | None) -> _Stations:
    return _Stations(
        averages.gravity.field,
        averages.gravity.covariance + averages.gravity_calibration,
        averages.rate.field,
        averages.rate.covariance + averages.rate_calibration,
        latitude,
        g,
        hole,
    )


@dataclass(frozen=True, eq=False)
class _Known:
    """What is known of each station's scale without its own rates."""

    scale: Array
    sd: Array
    track: ScaleTrack | None
    notes: tuple[str, ...]


def _expected(stations: _Stations, averages: Averages, heat: Array | None, options: GyroOptions) -> _Known:
    """The prior of each station's scale factor."""
    size = len(stations.rate)
    own = float(np.max(averages.scale_calibration, initial=0.0))
    prior = options.prior or ("calibration" if heat is None else "run")
    if heat is None:
        if prior != "calibration":
            raise InputError(f"prior {prior!r} follows the scale over temperature; add the column temperature_degC")
        if options.history is not None:
            raise InputError("the history gives the scale by temperature; add the column temperature_degC")
        return _Known(np.ones(size), np.full(size, np.hypot(options.scale_sd, own)), None, ())
    belief = _belief(options, own, walking=prior == "previous", start=float(heat[0]))
    notes: tuple[str, ...] = ()
    if prior == "calibration":
        scale, sd = belief.predict(heat)
        return _Known(scale, sd, None, notes)
    follow = smooth_scale if prior == "run" else track_scale
    found = tilt(stations.gravity, stations.g)
    if stations.hole == "up":
        found = upward(found, found.unseen)
    high, covariance = to_high_side(stations.rate, stations.rate_covariance, found.toolface)
    track = follow(high / EARTH_RATE, covariance / EARTH_RATE**2, found.inclination, stations.latitude, heat, belief)
    return _Known(track.expected, track.expected_sd, track, track.notes)


def _belief(options: GyroOptions, own: float, *, walking: bool, start: float) -> ScaleBelief:
    """What is known before the run: of an earlier run, or of the calibration."""
    if options.history is not None:
        return options.history.belief
    sd = float(np.hypot(options.scale_sd, own))
    if walking:
        return walking_belief(1.0, sd, walk=LEARNING_WALK, jitter=options.jitter, reference_temperature=start)
    return quadratic_belief(1.0, sd, slope_sd=options.slope_sd, bend_sd=options.bend_sd, jitter=options.jitter)


def _solve(method: str, stations: _Stations, known: _Known) -> North:
    if method == "patent":
        found = solve_patent(
            stations.gravity,
            stations.rate,
            stations.latitude,
            gravity_covariance=stations.gravity_covariance,
            rate_covariance=stations.rate_covariance,
            g=stations.g,
            history=1.0,
        )
        return found if stations.hole is None else _declared(found, stations.hole)
    estimate = estimate_north_fixed if method == "fixed" else estimate_north
    return estimate(
        stations.gravity,
        stations.rate,
        stations.latitude,
        gravity_covariance=stations.gravity_covariance,
        rate_covariance=stations.rate_covariance,
        scale=np.ones(len(stations.rate)) if method == "fixed" else known.scale,
        scale_sd=known.sd,
        g=stations.g,
        hole=stations.hole,
    )


def _gravity_in_g(stations: _Stations) -> str | None:
    """A sentence where cross-axis accelerometers fit the rates far better when their numbers are taken as g."""
    level = np.hypot(stations.gravity[:, 0], stations.gravity[:, 1])
    if np.isfinite(stations.gravity[:, 2]).any() or level.max() > 1.0 + LIGHTEST:
        return None
    larger = replace(
        stations,
        gravity=stations.gravity * STANDARD_GRAVITY,
        gravity_covariance=stations.gravity_covariance * STANDARD_GRAVITY**2,
    )
    vague = _Known(np.ones(len(level)), np.full(len(level), VAGUE), None, ())
    try:
        given, other = (float(np.sum(_solve("joint", s, vague).chi_square)) for s in (stations, larger))
    except InputError:
        return None
    if given < 10.0 * len(level) or other > 0.2 * given:
        return None
    return "the accelerometers fit the rates only if their numbers are in g, not m/s^2: name the columns accel_x_g"


def _declared(found: North, hole: str) -> North:
    """The closed form where the direction of the hole is stated: nothing is assumed, and up-holes are outside it."""
    if hole == "down":
        return replace(found, flags=[[name for name in row if name != "down-assumed"] for row in found.flags])
    blank = np.array([("down-assumed" in row) for row in found.flags])
    flags = [["up-hole" if name == "down-assumed" else name for name in row] for row in found.flags]
    return replace(
        found,
        flags=flags,
        inclination=np.where(blank, np.pi - found.inclination, found.inclination),
        azimuth=np.where(blank, np.nan, found.azimuth),
        gyro_toolface=np.where(blank, np.nan, found.gyro_toolface),
        scale=np.where(blank, np.nan, found.scale),
        u_scale=np.where(blank, np.nan, found.u_scale),
        k=np.where(blank, np.nan, found.k),
        root=["" if gone else own for gone, own in zip(blank, found.root, strict=True)],
    )


def _flags(
    averages: Averages, heat: Array | None, calibration: Calibration | None, history: ScaleRecord | None
) -> list[tuple[str, ...]]:
    """Flags of the index average and of the temperature."""
    spans = [None if calibration is None else calibration.tool.temperature_range]
    spans.append(None if history is None else history.belief.temperature_range)
    rows = []
    for n in range(len(averages.rate)):
        names = {*averages.gravity.flags[n], *averages.rate.flags[n]}
        for span in spans:
            if heat is not None and span is not None and not span[0] - HEAT_MARGIN <= heat[n] <= span[1] + HEAT_MARGIN:
                names.add("temperature")
        rows.append(tuple(sorted(names)))
    return rows


def write_run(run: GyroRun, path: str | Path) -> None:
    """Write stations.csv, in the order of depth."""
    survey, north = run.survey, run.north
    order = np.argsort(run.md)
    columns: dict[str, object] = {
        name: getattr(survey, name)
        for name in (
            "md", "inclination", "azimuth", "toolface", "magnetic_toolface", "g_total", "b_total", "dip",
            "u_inclination", "u_azimuth", "u_toolface", "azimuth_reference",
        )
    }  # fmt: skip
    columns["flags"] = ["|".join(row) for row in survey.flags]
    columns |= {"scale": north.scale[order], "u_scale": north.u_scale[order], "K": north.k[order]}
    columns |= {"root": [north.root[n] for n in order]}
    columns["temperature_degC"] = None if run.temperature is None else run.temperature[order]
    write_gyro_stations(path, columns)

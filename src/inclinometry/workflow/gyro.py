"""A gyro run from its readings to stations with north and scale factor."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.result import Calibration
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY, STATED_GRAVITY_SD
from inclinometry.earth.gravity import relative_gravity, stated_gravity_sd
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, InputError
from inclinometry.files.gyro_csv import CORRECTED, GyroReadings, write_gyro_stations
from inclinometry.files.scale_json import ScaleRecord
from inclinometry.gyro.closed_form import tilt, upward
from inclinometry.gyro.north import to_high_side
from inclinometry.gyro.result import North
from inclinometry.gyro.tracking import (
    MOST,
    ScaleTrack,
    contradicted,
    quadratic_belief,
    smooth_scale,
    track_scale,
    walking_belief,
    widened,
)
from inclinometry.survey.flags import HEAT_MARGIN, Check
from inclinometry.survey.gyro import gyro_survey
from inclinometry.survey.gyro_quality import rate_unit_suspect
from inclinometry.survey.reduce import Survey, parts_of
from inclinometry.tabular import Column, Tabular, check_record
from inclinometry.workflow.gyro_average import Averages, average_run, gravity_suspect
from inclinometry.workflow.gyro_checks import check_rates, gravity_in_g, gravity_scale, misfit_hint, refusal
from inclinometry.workflow.gyro_errors import run_errors
from inclinometry.workflow.gyro_methods import ScalePrior, Stations, solve, stations_of

METHODS: Final = ("joint", "patent", "fixed")
PRIORS: Final = ("calibration", "previous", "both", "run")
"""Where what is known of the scale before a station comes from: the calibration alone; the station before; the
stations before and the calibration's temperature curve; or all other stations of the run and that curve."""


@dataclass(frozen=True)
class GyroOptions:
    """How a run is reduced; rates in rad/s, angles in rad.

    scheme : index positions, a key of `inclinometry.gyro.indexing.SCHEMES`.
    method : one of `METHODS`.
    prior : one of `PRIORS`; None: "run". Without temperatures the scale wanders from station to station.
    scale_sd : standard uncertainty of the scale factor at the reference temperature.
    slope_sd, bend_sd : of its change over 100 degC, linear and square.
    jitter : standard deviation of the scale from station to station.
    history : what an earlier run has taught.
    gyro_sd, accelerometer_sd, z_bias_sd, sweep : as `average_run`.
    hole : "down" or "up" for tools that cannot tell.
    gravity_sd : of tools without an accelerometer along the hole, whose third component is from |g|: its standard
        uncertainty in units of that in which the others were calibrated; what site and calibration state when None.
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
    gravity_sd: float | None = None

    def __post_init__(self) -> None:
        for name, value, allowed in (("scale", self.method, METHODS), ("prior", self.prior, (None, *PRIORS))):
            if value not in allowed:
                raise InputError(f"{name} is {value!r}; allowed: {', '.join(str(a) for a in allowed if a)}")
        if self.prior is not None and self.method != "joint":
            raise InputError(
                f"the prior {self.prior!r} is for the joint estimate; method {self.method!r} does without: leave it out"
            )


@dataclass(frozen=True, eq=False, repr=False)
class GyroRun(Tabular):
    """A reduced run.

    survey : stations in order of depth.
    north : the same in the order measured, with scale factors.
    md, temperature : (n,) in the order measured; temperature None where the file has none.
    track : how the scale was learnt; None where it was not.
    others : the other methods, for comparison.
    checks : the rates against the Earth's.
    rates : (n, 3) what the gyros read in tool axes at index 0, freed of bias, times the scale factor found (step E of
        the patent); rad/s, NaN where it is not measured or no scale factor was found.
    """

    survey: Survey
    north: North
    md: Array
    temperature: Array | None
    track: ScaleTrack | None
    others: Mapping[str, North]
    checks: Sequence[Check]
    rates: Array
    tool: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.north)

    def record(self) -> ScaleRecord:
        """The scale factor of the run as a record; InputError where it was not followed."""
        if self.track is None or self.temperature is None:
            raise InputError(
                "a record of the scale factor gives it by temperature, for the joint estimate that follows it: add the "
                "column temperature_degC"
            )
        track = self.track
        return ScaleRecord(
            self.tool, track.belief, self.md, track.temperature, track.expected, track.expected_sd, track.scale,
            track.scale_sd, tuple(bool(v) for v in track.learnt), dict(self.inputs),
        )  # fmt: skip

    def to_dict(self) -> dict[str, Column]:
        """One row a station in the order measured: depth, temperature, angles, scale factor and flags."""
        heat = {} if self.temperature is None else {"temperature_degC": self.temperature}
        return {"md_m": self.md, **heat, **self.north.to_dict()}

    def plot(self, ax: Any = None) -> Any:
        """Inclination and azimuth by depth on matplotlib axes, which are returned."""
        return self.survey.plot(ax)


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
    check_record(readings, GyroReadings, "north_run")
    check_record(site, Site, "north_run")
    chosen = options or GyroOptions()
    _check_history(chosen.history, readings, calibration)
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
    stations = stations_of(averages, site, chosen.hole, _gravity_sd(chosen, site, calibration))
    if suspect := gravity_in_g(stations):
        raise FileError(suspect, path=readings.path)
    heat = None if readings.temperature is None else readings.mean(readings.temperature)
    known = _expected(stations, averages, heat, chosen)
    found = {method: solve(method, stations, known) for method in METHODS}
    checks = check_rates(stations, known, found["joint"], averages.rate_calibration)
    if refused := refusal(checks, site.latitude):
        raise FileError(refused, path=readings.path)
    north = found.pop(chosen.method)
    # what the calibration leaves open is common to all stations: following the run does not average it away
    north = replace(north, u_scale=np.hypot(north.u_scale, averages.scale_calibration * north.scale))
    track = known.track
    if chosen.method != "joint":
        track = None
    if track is not None:
        track = replace(track, scale_sd=np.hypot(track.scale_sd, averages.scale_calibration * track.scale))
    flags = _flags(averages, heat, calibration, chosen.history)
    # stations of a sentence, numbered from 1, as the file calls them
    labels = [
        re.sub(r"station (\d+)", lambda m: f"station {readings.labels[int(m[1]) - 1]!r}", c.reason) for c in checks
    ]
    checks = [replace(c, reason=reason) for c, reason in zip(checks, labels, strict=True)]
    inherited = [f"calibration: {sentence}" for sentence in (calibration.warnings if calibration else ())]
    notes = [
        *_remarks(readings, heat, chosen),
        *readings.notes,
        *averages.gravity.warnings,
        *averages.rate.warnings,
        *known.notes,
        *inherited,
    ]
    notes += gravity_scale(stations)
    notes += misfit_hint(found.get("joint", north), stations.rate, site.latitude)
    notes += [f"{c.name}: {c.reason}; {c.action}" for c in checks if c.verdict == "fail"]
    total = np.linalg.norm(averages.gravity.field, axis=1)
    digests = {"raw": readings.digest, **(inputs or {}), **_earlier(chosen.history)}
    name = "" if calibration is None else calibration.tool.name
    errors = run_errors(north, stations, averages, known, calibration, site) if north.response else None
    survey = gyro_survey(
        readings.md, north, site=site, g_total=total, flags=flags, tool=name, inputs=digests, notes=notes,
        errors=errors,
    )  # fmt: skip
    # the calibration's errors go with the noise of the sensors they are of
    own = np.inf if calibration is None else calibration.degrees_of_freedom
    freedom = {
        "accelerometer": min(averages.gravity.noise_freedom, own),
        "gyro": min(averages.rate.noise_freedom, own),
    }
    survey = replace(survey, notes=(*averages.gravity.notes, *averages.rate.notes), freedom=freedom)
    joined = tuple((*a, *b) for a, b in zip(north.flags, flags, strict=True))
    north = replace(north, flags=joined)
    rates = north.scale[:, None] * averages.rate.field
    return GyroRun(survey, north, readings.md, heat, track, found, checks, rates, name, digests)


def _remarks(readings: GyroReadings, heat: Array | None, options: GyroOptions) -> list[str]:
    """What a person should know about the input before anything is computed."""
    found = []
    if heat is not None and heat.max() > 230.0:  # no gyro tool survives that
        found.append(f"temperature reaches {heat.max():.0f} degC: is it in kelvin or degrees Fahrenheit?")
    if options.history is not None and options.history.tool == "":
        found.append("the history names no tool: make sure that it is of this one")
    known = options.history
    if known is not None and heat is not None and np.array_equal(known.md, readings.md):
        same = np.allclose(known.temperature, heat, atol=1e-9)
        found += ["the history has the depths and temperatures of this very run: was it learnt from it?"] * int(same)
    return found


def _earlier(history: ScaleRecord | None) -> dict[str, str]:
    """Digests of the readings that a history rests on."""
    used = [] if history is None else [v for name, v in history.inputs.items() if name.startswith("raw")]
    return {f"raw of earlier run {n}": digest for n, digest in enumerate(used, start=1)}


def _check_history(history: ScaleRecord | None, readings: GyroReadings, calibration: Calibration | None) -> None:
    """A history must be of the same tool and calibration, and of other readings."""
    if history is None:
        return
    name = "" if calibration is None else calibration.tool.name
    if history.tool != name:
        raise InputError(
            f"the history is of tool {history.tool or 'without calibration'!r}, this run of "
            f"{name or 'a tool without calibration'!r}: a scale factor is relative to one tool's own calibration"
        )
    if readings.digest in _earlier(history).values():
        raise InputError("the history was learnt from these very readings; they would count twice: leave it out")


def _gravity_sd(chosen: GyroOptions, site: Site, calibration: Calibration | None) -> float:
    """Relative standard uncertainty of |g| here against that in whose units the accelerometers read."""
    if chosen.gravity_sd is not None:
        return chosen.gravity_sd
    if calibration is not None:
        there = calibration.tool.triads["accelerometer"].field_strength
        return relative_gravity(site.gravity, there, site.gravity_sigma)[1]
    here = site.gravity or STANDARD_GRAVITY
    own = stated_gravity_sd(here) if site.gravity_sigma is None else site.gravity_sigma / here
    # readings in m/s^2 were calibrated somewhere, by a gravity that was stated
    return float(np.hypot(own, STATED_GRAVITY_SD))


def _expected(stations: Stations, averages: Averages, heat: Array | None, options: GyroOptions) -> ScalePrior:
    """What is known of each station's scale factor before and beside its own rates."""
    size = len(stations.rate)
    own = float(np.max(averages.scale_calibration, initial=0.0))
    prior = options.prior or ("run" if size <= MOST else "both")
    if heat is None and options.history is not None:
        raise InputError("the history gives the scale by temperature; add the column temperature_degC")
    start = 0.0 if heat is None else float(heat[0])
    sd = float(np.hypot(options.scale_sd, own))
    if options.history is not None:
        stated = options.history.belief
        doubt = np.zeros_like(stated.covariance)
        doubt[0, 0] = own**2  # the calibration errs in other directions of the tool in the next run
        stated = replace(stated, covariance=stated.covariance + doubt)
    elif heat is None or prior == "previous":
        learning_walk = 5e-4  # wandering of the scale per root of a degC for the prior "previous"
        stated = walking_belief(1.0, sd, walk=learning_walk, jitter=options.jitter, reference_temperature=start)
    else:
        stated = quadratic_belief(1.0, sd, slope_sd=options.slope_sd, bend_sd=options.bend_sd, jitter=options.jitter)
    found = tilt(stations.gravity, stations.g)
    if stations.hole == "up":
        found = upward(found, found.unseen)
    high, covariance = to_high_side(stations.rate, stations.rate_covariance, found.toolface)
    given = high / EARTH_RATE, covariance / EARTH_RATE**2, found.inclination, stations.latitude
    if prior == "calibration":
        at = np.full(size, start) if heat is None else heat
        used = contradicted(*given, at, stated)
        known = used.predict(at)
        return ScalePrior(*known, *known, *stated.predict(at), None, widened(stated, used))
    track = (smooth_scale if prior == "run" else track_scale)(*given, heat, stated)
    before = track.prior.predict(track.temperature), stated.predict(track.temperature)
    return ScalePrior(track.expected, track.expected_sd, *before[0], *before[1], track, track.notes)


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
    columns |= dict(zip(CORRECTED, np.degrees(3600.0 * run.rates[order]).T, strict=True))
    columns |= parts_of(survey.common, survey.random) if survey.common.size else {}
    write_gyro_stations(path, columns)

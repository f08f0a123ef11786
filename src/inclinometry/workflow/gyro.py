"""A gyro run from its readings to stations with north and scale factor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.result import Calibration
from inclinometry.constants import EARTH_RATE, STANDARD_GRAVITY, STATED_GRAVITY_SD
from inclinometry.earth.gravity import relative_gravity, stated_gravity_sd
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, SiteError, not_among, refused
from inclinometry.files.gyro_csv import CORRECTED, GyroReadings, write_gyro_stations
from inclinometry.files.scale_json import ScaleRecord
from inclinometry.findings import Finding
from inclinometry.gyro.axes import axis_prior, corrected_run
from inclinometry.gyro.closed_form import tilt, upward
from inclinometry.gyro.indexing import IndexTurns
from inclinometry.gyro.north import to_high_side
from inclinometry.gyro.point_mass import stated_law
from inclinometry.gyro.result import North
from inclinometry.gyro.run import Averages, ScalePrior, Stations, fit_no_azimuth, solve, stations_of, without_failed
from inclinometry.gyro.run_errors import run_errors
from inclinometry.gyro.tracking import MOST, ScaleTrack, quadratic_belief, smooth_scale, track_scale
from inclinometry.survey.flags import HEAT_MARGIN, Check
from inclinometry.survey.gyro import gyro_survey
from inclinometry.survey.gyro_quality import rate_unit_suspect, refusal
from inclinometry.survey.reduce import Survey, parts_of
from inclinometry.tabular import Column, Tabular, check_record
from inclinometry.workflow.gyro_average import average_run, gravity_suspect
from inclinometry.workflow.gyro_checks import check_rates, gravity_in_g, gravity_scale, misfit_hint
from inclinometry.workflow.six_axis import of_calibration

METHODS: Final = ("joint", "patent", "fixed")
PRIORS: Final = ("calibration", "previous", "both", "run")
"""Where what is known of the scale before a station comes from: the calibration alone; the stations before; the
stations before and the temperature; or all other stations of the run and the temperature."""


@dataclass(frozen=True)
class GyroOptions:
    """How a run is reduced; rates in rad/s, angles in rad.

    scheme : index positions, a key of `inclinometry.gyro.indexing.SCHEMES`.
    method : one of `METHODS`.
    prior : one of `PRIORS`; None: "run". How fast the scale walks from station to station is found from the run.
    scale_sd : standard uncertainty of the scale factor at the first station.
    slope_sd, bend_sd : of its change over 100 degC, linear and square.
    history : what an earlier run has taught.
    gyro_sd, accelerometer_sd, z_bias_sd, sweep : as `average_run`.
    hole : "down" or "up" for tools that cannot tell.
    gravity_sd : of tools without an accelerometer along the hole, whose third component is from |g|: its standard
        uncertainty in units of that in which the others were calibrated; what site and calibration state when None.
    misalignment, g_sensitivity : standard deviation of an element of the gyros' axes, rad, and of their sensitivity to
        gravity, rad/s per g; None: as `axis_prior`.
    """

    scheme: str = "four"
    method: str = "joint"
    prior: str | None = None
    scale_sd: float = 0.003
    slope_sd: float = 0.005
    bend_sd: float = 0.003
    history: ScaleRecord | None = None
    gyro_sd: float | None = None
    accelerometer_sd: float | None = None
    z_bias_sd: float | None = None
    sweep: float = 0.0
    hole: str | None = None
    gravity_sd: float | None = None
    misalignment: float | None = None
    g_sensitivity: float | None = None

    def __post_init__(self) -> None:
        for name, value, allowed in (("scale", self.method, METHODS), ("prior", self.prior, (None, *PRIORS))):
            if value not in allowed:
                raise not_among(name, str(value), filter(None, allowed))
        if self.prior is not None and self.method != "joint":
            raise refused("input-not-with", {"name": f"prior {self.prior}", "other": f"scale {self.method}"})


@dataclass(frozen=True, eq=False, repr=False)
class GyroRun(Tabular):
    """A reduced run: `survey` in order of depth, the rest (n,) in the order measured.

    track : how the scale was learnt; None where it was not. others : other methods. checks : rates against the Earth's.
    rates : (n, 3) in tool axes at index 0, without bias, times the scale factor found (step E of the patent); rad/s,
        NaN where not measured or without a scale.
    index_turns : which way the index of the readings counts, looking down hole.
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
    index_turns: IndexTurns = "clockwise"

    def __len__(self) -> int:
        return len(self.north)

    def record(self) -> ScaleRecord:
        """The scale factor of the run as a record; InputError where it was not followed."""
        if self.track is None or self.temperature is None:
            raise refused("input-missing", {"names": ("temperature_degC",)})
        track = self.track
        return ScaleRecord(
            self.tool, track.state, self.md, track.temperature, track.expected, track.expected_sd, track.scale,
            track.scale_sd, tuple(bool(v) for v in track.observable), dict(self.inputs),
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
    averages, stations = _averaged(readings, site, calibration, chosen)
    heat = None if readings.temperature is None else readings.mean(readings.temperature)
    triad = None if calibration is None else calibration.tool.triads["gyro"]
    pairs = chosen.scheme == "two"
    prior = axis_prior(chosen.misalignment, chosen.g_sensitivity, averages, triad, pairs=pairs)
    known = _expected(stations, averages, heat, chosen)
    found = {"joint": solve("joint", stations, known)}
    checks = check_rates(stations, known, found["joint"], averages.rate_calibration, readings.labels, prior)
    effect = None
    if prior is not None:
        expected = partial(_expected, averages=averages, heat=heat, options=chosen)
        given = stations, averages.rate_bias, prior, known, found["joint"]
        stations, known, found["joint"], effect = corrected_run(*given, expected)
    found |= {method: solve(method, stations, known) for method in METHODS[1:]}
    if effect is not None:
        found = {method: effect.counted(one) for method, one in found.items()}
    disturbed = fit_no_azimuth(found["joint"], averages.failed)
    found = {method: without_failed(one, averages, disturbed) for method, one in found.items()}
    if wrong := refusal(checks, stations.latitude):
        raise FileError(wrong, path=readings.path)
    north = found.pop(chosen.method)
    # what the calibration does not determine is common to all stations: following the run does not average it away
    north = replace(north, u_scale=np.hypot(north.u_scale, averages.scale_calibration * north.scale))
    track = known.track
    if chosen.method != "joint":
        track = None
    if track is not None:
        track = replace(track, scale_sd=np.hypot(track.scale_sd, averages.scale_calibration * track.scale))
        track = track if effect is None else effect.followed(track)
    flags = _flags(averages, heat, calibration, chosen.history)
    findings = [
        Finding("survey-index-turns", {"turns": readings.index_turns}, severity="note"),
        *readings.findings,
        *known.findings,
        *(of_calibration(calibration) if calibration else ()),
        *_remarks(readings, heat, chosen),
        *averages.gravity.findings,
        *averages.rate.findings,
        *gravity_scale(stations),
        *_axes_note(north, chosen),
        *(
            Finding("gyro-misfit-station", {"station": readings.labels[n]}, (int(n),))
            for n in np.flatnonzero(disturbed)
        ),
        *misfit_hint(found.get("joint", north), stations.rate),
        *(c.reason for c in checks if c.verdict == "fail"),
    ]
    total = np.linalg.norm(averages.gravity.field, axis=1)
    digests = {"raw": readings.digest, **(inputs or {}), **_earlier(chosen.history)}
    tool = None if calibration is None else calibration.tool
    name = "" if tool is None else tool.name
    errors = run_errors(north, stations, averages, known, tool, site) if north.response else None
    survey = gyro_survey(
        readings.md, north, site=site, g_total=total, flags=flags, tool=name, inputs=digests, errors=errors
    )  # fmt: skip
    # the calibration's errors go with the noise of the sensors they are of
    own = np.inf if calibration is None else calibration.degrees_of_freedom
    freedom = {
        "accelerometer": min(averages.gravity.noise_freedom, own),
        "gyro": min(averages.rate.noise_freedom, own),
    }
    survey = replace(survey, findings=(*findings, *survey.findings), freedom=freedom)
    joined = tuple((*a, *b) for a, b in zip(north.flags, flags, strict=True))
    north = replace(north, flags=joined)
    rates = north.scale[:, None] * averages.rate.field
    return GyroRun(survey, north, readings.md, heat, track, found, checks, rates, name, digests, readings.index_turns)


def _averaged(
    readings: GyroReadings, site: Site, calibration: Calibration | None, options: GyroOptions
) -> tuple[Averages, Stations]:
    """Gravity and rate of every station; refused where their units cannot be right."""
    if site.latitude is None or site.gravity is None:
        raise SiteError(Finding("input-missing", {"names": ("latitude_deg",)}))
    averages = average_run(
        readings,
        calibration,
        scheme=options.scheme,
        gyro_sd=options.gyro_sd,
        accelerometer_sd=options.accelerometer_sd,
        z_bias_sd=options.z_bias_sd,
        sweep=options.sweep,
        g=site.gravity,
        latitude=site.latitude,
    )
    suspect = rate_unit_suspect(averages.rate.field[~averages.failed])
    if suspect := suspect or gravity_suspect(averages.gravity.field, site.gravity):
        raise FileError(suspect, path=readings.path)
    stations = stations_of(averages, site, options.hole, _gravity_sd(options, site, calibration))
    if suspect := gravity_in_g(stations):
        raise FileError(suspect, path=readings.path)
    return averages, stations


def _axes_note(north: North, options: GyroOptions) -> list[Finding]:
    """What unstated axes of the gyros cost in this run."""
    if "gyro axes" not in north.components or None not in (options.misalignment, options.g_sensitivity):
        return []
    zero = replace(north, components={**north.components, "gyro axes": 0.0 * north.components["gyro axes"]})
    counted, stated = (float(np.degrees(np.nanmedian(one.u("azimuth")))) for one in (north, zero))
    return [Finding("gyro-axes-assumed", {"u_deg": counted, "stated_deg": stated}, severity="note")]


def _remarks(readings: GyroReadings, heat: Array | None, options: GyroOptions) -> list[Finding]:
    """What a person should know about the input before anything is computed."""
    found = []
    if heat is not None and heat.max() > 230.0:  # no gyro tool survives that
        found.append(Finding("gyro-temperature-unit", {"temperature_degC": float(heat.max())}))
    known = options.history
    if known is not None and known.tool == "":
        found.append(Finding("gyro-history-tool"))
    if known is not None and heat is not None and np.array_equal(known.md, readings.md):
        found += [Finding("gyro-history-same")] * int(np.allclose(known.temperature, heat, atol=1e-9))
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
        raise refused("work-other-tool", {"name": "history", "its": history.tool or "-", "own": name or "-"})
    if readings.digest in _earlier(history).values():
        raise refused("work-history-same")


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
        raise refused("input-needs", {"name": "--history", "needed": ("temperature_degC",)})
    # the calibration errs in other directions of the tool in each run
    if options.history is not None:
        stated = options.history.state
        extra = np.zeros_like(stated.covariance)
        extra[0, 0] = own**2
        stated = replace(stated, covariance=stated.covariance + extra)
    else:
        stated = quadratic_belief(
            1.0, float(np.hypot(options.scale_sd, own)), slope_sd=options.slope_sd, bend_sd=options.bend_sd,
            reference_temperature=20.0 if heat is None else float(heat[0]),
        )  # fmt: skip
    # one that stands still says nothing
    at = np.full(size, stated.reference_temperature) if heat is None or prior == "previous" else heat
    before = stated.predict(at)
    found = tilt(stations.gravity, stations.g)
    if stations.hole == "up":
        found = upward(found, found.unseen)
    high, covariance = to_high_side(stations.rate, stations.rate_covariance, found.toolface)
    given = high / EARTH_RATE, covariance / EARTH_RATE**2, found.inclination, stations.latitude
    moves = heat is not None and prior != "previous" and np.ptp(heat) > 1.0
    curve = stated.basis(at)[:, 1:] - stated.basis(at[:1])[:, 1:] if moves else np.zeros((size, 0))
    if prior == "calibration":
        return ScalePrior(stated_law(*before), *before, *before, None, (), stated, curve)
    track = (smooth_scale if prior == "run" else track_scale)(*given, None if prior == "previous" else heat, stated)
    known = (track.expected, track.expected_sd) if track.contradicted else before
    return ScalePrior(track.law, *known, *before, track, track.findings, stated, curve)


def _flags(
    averages: Averages, heat: Array | None, calibration: Calibration | None, history: ScaleRecord | None
) -> list[tuple[str, ...]]:
    """Flags of the index average and of the temperature."""
    spans = [None if calibration is None else calibration.tool.temperature_range]
    spans.append(None if history is None else history.state.temperature_range)
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
    # an angle that a station cannot have has no uncertainty
    none = np.array([not {"channel", "up-hole"}.isdisjoint(row) for row in survey.flags])
    none |= np.isnan(survey.azimuth) & np.array(["misfit" in row for row in survey.flags])
    for name in ("inclination", "azimuth", "toolface"):
        gone = none & np.isnan(getattr(survey, name))
        columns[f"u_{name}"] = np.where(gone, np.nan, survey.u(name))
    columns["flags"] = ["|".join(row) for row in survey.flags]
    columns |= {"scale": north.scale[order], "u_scale": north.u_scale[order], "K": north.k[order]}
    columns |= {"root": [north.root[n] for n in order]}
    columns["temperature_degC"] = None if run.temperature is None else run.temperature[order]
    columns |= dict(zip(CORRECTED, np.degrees(3600.0 * run.rates[order]).T, strict=True))
    parts = parts_of(survey.common, survey.random) if survey.common.size else {}
    columns |= {name: np.where(none, np.nan, np.asarray(part)) for name, part in parts.items()}
    write_gyro_stations(path, columns)

"""The whole way once: real instruments calibrated, simulated benches and a hot gyro run through every method."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration import plans
from inclinometry.calibration.conformity import Verification, verify
from inclinometry.calibration.drift import SIXTY
from inclinometry.calibration.drift_check import plan_information
from inclinometry.calibration.drift_status import FleetStatus, fleet_status
from inclinometry.calibration.field import calibrate_field
from inclinometry.calibration.norm import NormFit, calibrate_norm, calibrate_norms
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.earth.site import Site
from inclinometry.files.bench_csv import read_bench, write_bench, write_raw_survey
from inclinometry.files.position_csv import write_position_csv
from inclinometry.files.run_file import open_run
from inclinometry.files.site_toml import read_site
from inclinometry.files.survey_csv import read_raw_survey
from inclinometry.files.tool_json import read_calibration, write_calibration, write_truth
from inclinometry.files.writing import write_text
from inclinometry.history import PARAMETERS
from inclinometry.motion.result import DynamicRun
from inclinometry.orientation import angles
from inclinometry.position.well import horizontal_ellipse
from inclinometry.report.calibration import calibration_report
from inclinometry.report.dynamic import Found, errors_of, methods_figure, rms_of
from inclinometry.report.gyro import gyro_report, scale_report
from inclinometry.report.page import Entry, entry_of, index_page, linked_back
from inclinometry.report.survey import survey_report
from inclinometry.report.verification import verification_report
from inclinometry.report.words import significant
from inclinometry.rotations import dcm, dcm_from_quaternion, quaternion_from_dcm, wrap_signed
from inclinometry.sensors import Tool
from inclinometry.simulate.bench import Rig
from inclinometry.simulate.drilling import DrillingSimulation, simulate_drilling
from inclinometry.simulate.fleet import FleetScene, simulate_fleet
from inclinometry.simulate.gyro import hot_run
from inclinometry.simulate.hole import SurveySimulation
from inclinometry.survey.gyro import gyro_survey
from inclinometry.survey.path import minimum_curvature
from inclinometry.survey.reduce import Survey, reduce_survey
from inclinometry.survey.stations import Stations
from inclinometry.workflow import simulate
from inclinometry.workflow.calibrate import Comparison, Options, compare, method, true_errors
from inclinometry.workflow.dynamic import dynamic_run, write_dynamic
from inclinometry.workflow.dynamic_methods import DynamicOptions
from inclinometry.workflow.examples import XSENS_GRAVITY, cave_instrument, xsens_stations
from inclinometry.workflow.gyro_heating_example import JOINT, reduce_hot_run, rms_degrees
from inclinometry.workflow.position import WellPosition, read_position
from inclinometry.workflow.simulate_drilling import DrillingRequest, site_text, write_drilling
from inclinometry.workflow.six_axis import Analysis, JudgedStations, msa, quality, read_six_axis, survey_six_axis
from inclinometry.workflow.survey import survey_raw, write_survey

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE: Final = "stick_slip.png"
RAW, TEXTBOOK, OURS = "single samples", "textbook filter (Madgwick 2010)", "inclinometry"

# The demo's run while drilling: what single samples say, a textbook filter and this package, against the truth.

Quaternion = tuple[float, float, float, float]


def textbook_filter(run: DrillingSimulation, gain: float = 0.041) -> Array:
    """Attitude by the gradient-descent filter of textbooks: rotations (n, 3, 3) from north-east-down to tool.

    S. O. H. Madgwick, "An efficient orientation filter for inertial and inertial/magnetic sensor arrays", 2010,
    equations (25), (34), (42) to (47), with his gain, rad/s. It has two advantages here: it starts at the true
    attitude, and it turns by the exact exponential; his first-order step loses 0.8 % of the speed at 600 rpm and 200
    Hz.
    """
    start = dcm(run.truth.azimuth[0], run.truth.inclination[0], run.truth.toolface[0])
    q0, q1, q2, q3 = (float(v) for v in quaternion_from_dcm(start))
    q1, q2, q3 = -q1, -q2, -q3  # his is the attitude of the tool against the Earth: the inverse
    dt = run.interval
    found = np.empty((len(run), 4))
    unit = [(v / np.linalg.norm(v, axis=1)[:, None]).tolist() for v in (run.accel, run.mag)]
    for row, (down, m, w) in enumerate(zip(*unit, run.gyro.tolist(), strict=True)):
        # the magnetic field in Earth axes: its length across the vertical, and along it
        north = m[0] * (1 - 2 * (q2 * q2 + q3 * q3)) + 2 * m[1] * (q1 * q2 - q0 * q3) + 2 * m[2] * (q1 * q3 + q0 * q2)
        east = 2 * m[0] * (q1 * q2 + q0 * q3) + m[1] * (1 - 2 * (q1 * q1 + q3 * q3)) + 2 * m[2] * (q2 * q3 - q0 * q1)
        along = 2 * m[0] * (q1 * q3 - q0 * q2) + 2 * m[1] * (q2 * q3 + q0 * q1) + m[2] * (1 - 2 * (q1 * q1 + q2 * q2))
        q = q0, q1, q2, q3
        slopes = _slope(q, 0.0, 1.0, down), _slope(q, math.hypot(north, east), along, m)
        slope = [a + b for a, b in zip(*slopes, strict=True)]
        size = math.sqrt(sum(v * v for v in slope)) or 1.0
        # turned by the gyros: the product of q and exp(w dt / 2)
        speed = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        c, s = math.cos(0.5 * speed * dt), math.sin(0.5 * speed * dt) / speed if speed > 0.0 else 0.5 * dt
        x, y, z = s * w[0], s * w[1], s * w[2]
        turned = (
            q0 * c - q1 * x - q2 * y - q3 * z,
            q1 * c + q0 * x + q2 * z - q3 * y,
            q2 * c + q0 * y - q1 * z + q3 * x,
            q3 * c + q0 * z + q1 * y - q2 * x,
        )
        # then a step of length gain * dt down the slope of the misfit
        moved = [a - gain * dt * s / size for a, s in zip(turned, slope, strict=True)]
        norm = math.sqrt(sum(v * v for v in moved))
        q0, q1, q2, q3 = moved[0] / norm, moved[1] / norm, moved[2] / norm, moved[3] / norm
        found[row] = q0, q1, q2, q3
    return dcm_from_quaternion(found * [1.0, -1.0, -1.0, -1.0])


def _slope(q: Quaternion, bx: float, bz: float, s: list[float]) -> Quaternion:
    """J' f: how the misfit between a field (bx, 0, bz) in Earth axes and its reading s changes with q."""
    q0, q1, q2, q3 = q
    f1 = 2 * bx * (0.5 - q2 * q2 - q3 * q3) + 2 * bz * (q1 * q3 - q0 * q2) - s[0]
    f2 = 2 * bx * (q1 * q2 - q0 * q3) + 2 * bz * (q0 * q1 + q2 * q3) - s[1]
    f3 = 2 * bx * (q0 * q2 + q1 * q3) + 2 * bz * (0.5 - q1 * q1 - q2 * q2) - s[2]
    return (
        -2 * bz * q2 * f1 + 2 * (bz * q1 - bx * q3) * f2 + 2 * bx * q2 * f3,
        2 * bz * q3 * f1 + 2 * (bx * q2 + bz * q0) * f2 + 2 * (bx * q3 - 2 * bz * q1) * f3,
        -2 * (2 * bx * q2 + bz * q0) * f1 + 2 * (bx * q1 + bz * q3) * f2 + 2 * (bx * q0 - 2 * bz * q2) * f3,
        2 * (bz * q1 - 2 * bx * q3) * f1 + 2 * (bz * q2 - bx * q0) * f2 + 2 * bx * q1 * f3,
    )


def true_course(run: DrillingSimulation) -> Found:
    """The truth at every sample."""
    return Found(run.time, run.truth.inclination, run.truth.azimuth)


def raw_course(run: DrillingSimulation) -> Found:
    """What every sample says on its own."""
    found = angles(run.accel, run.mag)
    return Found(run.time, found.inclination, found.azimuth)


def textbook_course(run: DrillingSimulation) -> Found:
    """What the textbook filter says."""
    turn = textbook_filter(run)
    found = angles(turn[:, :, 2], turn[:, :, 0])
    return Found(run.time, found.inclination, found.azimuth)


def our_course(found: DynamicRun) -> Found:
    """Windows of this package that were not refused, with their uncertainty."""
    rows, good = found.rows, ~found.rows.refused
    spread = rows.u_inclination[good], rows.u_azimuth[good]
    return Found(rows.time[good], rows.inclination[good], rows.azimuth[good], spread)


def drill(folder: Path) -> tuple[DynamicRun, float, dict[str, tuple[float, float]]]:
    """Simulate into files, find the attitude in three ways, draw them against the truth.

    Returns
    -------
    DynamicRun, float, dict
        What this package found, the highest speed, rpm, and name -> rms errors of inclination and azimuth, deg.
    """
    from inclinometry.report.figure import save_png

    folder.mkdir(parents=True, exist_ok=True)
    request = DrillingRequest("stick-slip", SEED, 60.0)
    write_drilling(request, folder / "run.parquet", folder / "truth.parquet")
    write_text(site_text(request.chosen.hole), folder / "site.toml")
    site = read_site(folder / "site.toml")
    found = dynamic_run(open_run(folder / "run.parquet"), site, options=DynamicOptions("auto", 10.0))
    write_dynamic(found, folder / "attitude.csv")
    run = simulate_drilling(request.chosen, SEED)
    shown = {RAW: raw_course(run), TEXTBOOK: textbook_course(run), OURS: our_course(found)}
    truth = true_course(run)
    rpm = 30.0 / np.pi * run.truth.rate
    save_png(methods_figure(truth, rpm, shown), folder / PICTURE)
    errors = {name: errors_of(one, truth) for name, one in shown.items()}
    return found, float(rpm.max()), {name: (rms_of(e[0]), rms_of(e[1])) for name, e in errors.items()}


def drilling_sentences(top: float, rms_deg: Mapping[str, tuple[float, float]]) -> list[str]:
    """What the picture shows, for the terminal and the page, from the highest speed, rpm, and the rms errors."""
    lines = [
        f"simulated stick-slip, 0 to {top:.0f} rpm, 5 g rms and a shock a second; rms error of inclination and azimuth:"
    ]
    for name, (inclination, azimuth) in rms_deg.items():
        lines.append(f"{name}: {significant(inclination)} and {significant(azimuth)} deg")
    return lines


# The end of the demo: a simulated well with a magnetised string, surveyed by the demo's own calibrated tool.

AXIAL_NT: Final = 800.0
"""What the drill string adds to the field along the tool, nT."""


@dataclass(frozen=True, eq=False)
class DemoWell:
    """A well surveyed twice, as it is and with the multi-station analysis, and where it ends.

    stations : as they were read; survey, corrected : before and after.
    error_deg : name -> rms azimuth error beyond 5 deg of inclination, deg.
    judged : quality before and after; analysis : Analysis.
    position : WellPosition by the certificate and the ISCWSA model; off_m : (3,) N, E, V of its end from the truth.
    """

    stations: Stations
    survey: Survey
    corrected: Survey
    error_deg: Mapping[str, float]
    judged: tuple[JudgedStations, JudgedStations]
    analysis: Analysis
    position: WellPosition
    off_m: Array

    @property
    def ellipse_m(self) -> tuple[float, float]:
        """Semi-axes of the ellipse that holds the end of the well with probability 0.95, m."""
        found = self.position.uncertainty
        if found is None:
            return float("nan"), float("nan")
        probability = 0.95
        ellipse = horizontal_ellipse(found.covariance[-1:], probability)
        return float(ellipse.major[0]), float(ellipse.minor[0])


def survey_demo_well(run: SurveySimulation, tensor: Array, tool: Path, folder: Path) -> DemoWell:
    """Write the files of the well, and go the whole way from raw channels to its ellipse.

    `run` is clean of interference; `tensor` (m, 3) the true one of the magnetometers, signal per stand's field.
    """
    from inclinometry.files.corrections_json import write_corrections

    folder.mkdir(parents=True, exist_ok=True)
    share = AXIAL_NT / (run.b or 50_000.0)
    signals = {**run.signals, "magnetometer": run.signals["magnetometer"] + share * tensor[:, 2]}
    write_raw_survey(folder / "raw.csv", run.md, signals, run.temperature)
    declination_deg = 2.5
    lines = [
        "latitude_deg = 60.0",
        'north_reference = "true"',
        f"declination_deg = {declination_deg}",
        "sigma_declination_deg = 0.36",
        f"dip_deg = {np.degrees(run.dip):.6f}",
        "sigma_dip_deg = 0.2",
    ]
    if run.g is not None:
        lines.append(f"g = {run.g:.6f}")
    if run.b is not None:
        lines += [f"b_nT = {run.b:.3f}", "sigma_b_nT = 130.0"]
    write_text("\n".join(lines) + "\n", folder / "site.toml")
    six = read_six_axis(folder / "raw.csv", folder / "site.toml", tool)
    steel_nt = 500.0  # standard deviation of that, as the analysis expects it, nT
    before, analysis = survey_six_axis(six), msa(six, axial_sigma=steel_nt)
    write_corrections(analysis.correction, folder / "corrections.json")
    after = survey_six_axis(six, str(folder / "corrections.json"))
    write_survey(after.survey, folder / "survey.csv")
    position = read_position(
        folder / "survey.csv",
        folder / "site.toml",
        "iscwsa-mwd-rev5.1",
        tool,
        folder / "raw.csv",
        folder / "corrections.json",
    )
    write_position_csv(folder / "position.csv", position.path, position.uncertainty, position.survey.north)
    inclined, declination = run.inclination > np.radians(5.0), float(np.radians(declination_deg))
    errors = {}
    for name, found in {"as it is": before.survey, "multi-station analysis": after.survey}.items():
        wrong = wrap_signed(found.azimuth - run.azimuth - declination)[inclined]
        errors[name] = float(np.degrees(np.sqrt(np.mean(wrong**2))))
    truth = minimum_curvature(run.md, run.inclination, run.azimuth + declination, start=(0.0, 0.0, float(run.md[0])))
    path = position.path
    off = np.array([path.north[-1] - truth.north[-1], path.east[-1] - truth.east[-1], path.tvd[-1] - truth.tvd[-1]])
    judged = quality(six.stations, six.site), quality(analysis.found.corrected, six.site)
    return DemoWell(six.stations, before.survey, after.survey, errors, judged, analysis, position, off)


def well_sentences(found: DemoWell) -> list[str]:
    """What happened to the well, for the head of its page and for the terminal."""
    before, after = (judged.verdict for judged in found.judged)
    raw, better = found.error_deg.values()
    bias = found.analysis.found.parameters["axial interference"]
    major, minor = found.ellipse_m
    north, east, down = found.off_m
    return [
        f"the string adds {AXIAL_NT:.0f} nT along the tool; quality as it is: {before}, after the analysis: {after}",
        "multi-station analysis with the calibration as prior: axial interference "
        f"{bias.value:.0f} +- {bias.u:.0f} nT; rms azimuth error {raw:.2f} deg as it is, {better:.2f} deg after",
        f"the end of the well is off the truth by {north:+.1f} m north, {east:+.1f} m east, {down:+.1f} m down; its "
        f"95 % ellipse by the tool's own certificate and the ISCWSA model is {major:.1f} m by {minor:.1f} m",
    ]


RIG = Rig(dip=np.radians(70.0), setting_sd=np.radians(0.1), base_tilt=np.radians(0.2))
SEED = 1
HOT_SEED = 8
"""A run in which the scale drifts by 1 % and K passes zero, so that every method shows its weakness."""
HOT_RUNS = 30
FLEET_TOOLS = 40


@dataclass(eq=False)
class Demo:
    """What the demo found, filled step by step."""

    folder: Path
    xsens: NormFit | None = None
    xsens_poses: int = 0
    # rms angle of the tool axis about its mean over the held-out rolls, standard deviation of the dip over them, rad
    cave: tuple[float, float] | None = None
    comparisons: dict[str, Comparison] = field(default_factory=dict)
    verification: Verification | None = None
    survey: Survey | None = None
    survey_error: Array | None = None  #: (n, 2) inclination, azimuth, rad
    hot_run: Mapping[str, Array] | None = None  #: method -> azimuth errors, rad, of the run that is pictured
    hot_runs_rms: dict[str, float] = field(default_factory=dict)  #: method -> deg, over HOT_RUNS runs
    well: DemoWell | None = None
    drilling: tuple[float, Mapping[str, tuple[float, float]]] | None = None  #: highest rpm, name -> rms errors, deg
    fleet: FleetStatus | None = None
    pages: list[Entry] = field(default_factory=list)

    def page(self, title: str, name: str, text: str, picture: str = "") -> None:
        """Write a report and remember it for the index, with a picture of the folder where there is one."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(linked_back(text, "../index.html", "All reports"), path)
        self.pages.append(entry_of(title, name, text, picture))


def steps() -> Iterator[tuple[str, Callable[[Demo], None]]]:
    """The steps in order, each with what it does; every file is written whole or not at all."""
    yield "calibrating a real Xsens MTi from its log", _xsens
    yield "calibrating a real cave instrument without a rig", _cave
    for name, plan in {"twelve": plans.twelve, "orthogonal": plans.orthogonal, "rotations": plans.rotations}.items():
        yield f"simulated bench, plan {name}, every method", partial(_bench, name=name, plan=plan())
    yield "verifying the tool at independent positions", _verify
    yield "surveying a simulated well with it", _well
    yield "a hot gyro run, 20 to 140 degC", _hot_run
    yield "quality, multi-station analysis and ellipse of a well drilled with a magnetised string", _magnetised
    yield "drilling with stick-slip: single samples, a textbook filter and this package", _drilling
    yield f"{FLEET_TOOLS} tools and their calibrations of years: drift, due dates, alarms", _fleet
    yield "drawing the methods side by side", _picture


def _xsens(demo: Demo) -> None:
    readings, found = xsens_stations()
    demo.xsens_poses = len(found)
    demo.xsens = calibrate_norm(readings.channels["accelerometer"], XSENS_GRAVITY)
    record = calibrate_norms(readings, specific_force=True, name="Xsens MTi (Tedaldi et al. 2014)")
    _store(demo, "xsens", readings, record)
    demo.page("Xsens MTi, real log: calibration", "xsens/report.html", calibration_report(record, readings=readings))


def _cave(demo: Demo) -> None:
    shots = cave_instrument("HC")
    readings = shots.take(np.arange(16))
    record = calibrate_field(readings, name="SAP6 HC")
    # spread of the tool axis and of the dip over the roll set that the calibration has not seen
    rolls = shots.take(np.arange(16, 24))
    seen = reduce_survey(np.arange(float(len(rolls))), rolls.channels, record.tool)
    axis = dcm(seen.azimuth, seen.inclination, 0.0)[:, 2]
    mean = axis.mean(axis=0) / np.linalg.norm(axis.mean(axis=0))
    off = np.arctan2(np.linalg.norm(np.cross(axis, mean), axis=1), axis @ mean)
    demo.cave = float(np.sqrt(np.mean(off**2))), float(np.std(seen.dip))
    _store(demo, "cave", readings, record)
    demo.page("SAP6 cave instrument, real shots", "cave/report.html", calibration_report(record, readings=readings))


def _bench(demo: Demo, name: str, plan: Plan) -> None:
    readings, truth, extras = simulate.bench(plan, SEED, rig=RIG)
    folder = demo.folder / name
    folder.mkdir(parents=True, exist_ok=True)
    write_bench(readings, folder / "readings.csv")
    write_truth(truth, extras, folder / "truth.json")
    readings = read_bench(folder / "readings.csv")
    known = Options(level_sd=RIG.base_tilt, data_sheet=truth)
    found = compare(readings, truth=truth, options=known)
    demo.comparisons[name] = found
    best = found.attempts[0].calibration
    if best is None:
        return
    tool = best.tool
    record = replace(best, tool=Tool("simulated 1", tool.triads, tool.covariance, tool.noise, tool.temperature_range))
    write_calibration(record, folder / "tool.json")
    others = {a.method: a.calibration for a in found.attempts[1:] if a.calibration is not None}
    text = calibration_report(record, readings=readings, closed_forms=others)
    demo.page(f"simulated bench, plan {name}: calibration", f"{name}/report.html", text)


def _store(demo: Demo, name: str, readings: BenchReadings, record: Calibration) -> None:
    folder = demo.folder / name
    folder.mkdir(parents=True, exist_ok=True)
    write_bench(readings, folder / "readings.csv")
    write_calibration(record, folder / "tool.json")


def _verify(demo: Demo) -> None:
    folder = demo.folder / "orthogonal"
    stand = simulate.read_truth(folder / "truth.json")
    check, *_ = simulate.bench(plans.twelve(4, 5), SEED + 1, rig=replace(RIG, setting_sd=np.radians(0.02)), truth=stand)
    write_bench(check, folder / "check.csv")
    demo.verification = verify(read_bench(folder / "check.csv"), read_calibration(folder / "tool.json"))
    demo.page("verification at independent positions", "orthogonal/verify.html", verification_report(demo.verification))


def _well(demo: Demo) -> None:
    folder = demo.folder / "well"
    folder.mkdir(parents=True, exist_ok=True)
    truth, _ = simulate.read_truth(demo.folder / "orthogonal" / "truth.json")
    run = simulate.well(truth, SEED)
    simulate.write_well(run, folder / "raw.csv", folder / "path.csv")
    found = survey_raw(read_raw_survey(folder / "raw.csv"), read_calibration(demo.folder / "orthogonal" / "tool.json"))
    write_survey(found, folder / "survey.csv")
    off = [found.inclination - run.inclination, (found.azimuth - run.azimuth + np.pi) % (2.0 * np.pi) - np.pi]
    demo.survey, demo.survey_error = found, np.stack(off, axis=1)
    demo.page("simulated well: survey", "well/survey.html", survey_report(found))


def _magnetised(demo: Demo) -> None:
    from inclinometry.report.msa import msa_report
    from inclinometry.report.position import position_report

    stand = demo.folder / "orthogonal"
    truth, _ = simulate.read_truth(stand / "truth.json")
    tensor = truth.triads["magnetometer"].tensor[0]
    found = survey_demo_well(simulate.well(truth, SEED + 2), tensor, stand / "tool.json", demo.folder / "magnetised")
    demo.well, at = found, found.position
    page = msa_report(found.analysis.found, found.stations, found.judged[0].quality, tool=found.survey.tool)
    demo.page("magnetised string: multi-station analysis and quality", "magnetised/msa.html", page)
    page = survey_report(found.corrected)
    demo.page("magnetised string: survey after the analysis", "magnetised/survey.html", page)
    told = at.told | {"notes": well_sentences(found)}
    page = position_report(at.path, at.survey, at.uncertainty, **told)
    demo.page("magnetised string: quality, analysis and where the well is", "magnetised/position.html", page)


def _hot_run(demo: Demo) -> None:
    from inclinometry.report.figure import save_png
    from inclinometry.report.gyro import hot_run_figure

    folder = demo.folder / "gyro"
    folder.mkdir(parents=True, exist_ok=True)
    run = hot_run(HOT_SEED)
    stations, errors, track = reduce_hot_run(run)
    joint = stations[JOINT]
    band = {JOINT: joint.u("azimuth")}
    figure = hot_run_figure(run.temperature, run.inclination, errors, band, run.scale, track)
    save_png(figure, folder / "hot_run.png")
    hot_spacing = 30.0  # m
    depth = hot_spacing * np.arange(1.0, len(joint) + 1.0)
    site = Site(latitude=run.latitude)
    survey = gyro_survey(depth, joint, site=site, tool="a simulated gyro and exact accelerometers")
    others = {name: other for name, other in stations.items() if name != JOINT}
    page = gyro_report(survey, joint, md=depth, temperature=run.temperature, track=track, others=others, site=site)
    title = "simulated hot gyro run: survey by the Earth's rotation"
    demo.page(title, "gyro/gyro.html", page, "gyro/hot_run.png")
    text = scale_report(track, md=depth, tool="a simulated gyro")
    demo.page("simulated hot gyro run: scale factor over temperature", "gyro/scale.html", text)
    demo.hot_run = errors
    demo.hot_runs_rms = rms_degrees(reduce_hot_run(hot_run(seed))[1] for seed in range(HOT_RUNS))


def _drilling(demo: Demo) -> None:
    from inclinometry.report.dynamic import dynamic_report

    found, top, rms_deg = drill(demo.folder / "drilling")
    demo.drilling = top, rms_deg
    page = dynamic_report(found)
    demo.page("simulated drilling with stick-slip: attitude", "drilling/dynamic.html", page)
    head, *lines = drilling_sentences(top, rms_deg)
    picture, sentence = f"drilling/{PICTURE}", f"{head} {'; '.join(lines)}"
    title = "simulated drilling: single samples, textbook filter and this package in one picture"
    demo.pages.append(Entry(title, picture, sentence=sentence, picture=picture))


def _fleet(demo: Demo) -> None:
    from inclinometry.report.fleet import fleet_report

    magnetometer_x, accelerometer_y = np.zeros(24), np.zeros(24)
    magnetometer_x[PARAMETERS.index("mag_x_offset")] = 8e-3  # 400 nT of 50000
    accelerometer_y[PARAMETERS.index("accel_y_offset")] = 3e-3  # 3 mg
    certificate = np.asarray(np.linalg.inv(plan_information(plans.twelve())), dtype=np.float64)
    last = 5
    scene = FleetScene(
        FLEET_TOOLS, certificate, last + 1, multiplier_sd=0.6, rigs=3,
        jumps={(11, last): magnetometer_x, (29, last): accelerometer_y},
    )  # fmt: skip
    histories = simulate_fleet(scene, seed=SEED).histories
    demo.fleet = fleet_status(histories, reproducibility=False)
    title = f"fleet of {FLEET_TOOLS} simulated tools: drift, due dates, alarms"
    demo.page(title, "fleet/fleet.html", fleet_report(demo.fleet))


def fleet_sentences(found: FleetStatus | None) -> list[str]:
    """What the calibrations of a fleet say, for the terminal."""
    if found is None:
        return []
    alarms = [f"{t.history.serial}: {t.alarm.finding}" for t in found.tools if t.alarm and t.alarm.raised]
    overdue = sum(tool.due.date <= found.day for tool in found.tools)
    now, six = np.degrees(np.median([(tool.now[SIXTY], tool.checked[SIXTY]) for tool in found.tools], axis=0))
    return [
        f"{len(found.tools)} tools, {sum(len(t.history) for t in found.tools)} calibrations: {overdue} overdue on "
        f"{found.day}, first {found.tools[0].history.serial}",
        f"azimuth at inclination 60, median: {now:.3f} deg now, {six:.3f} deg after a check of six positions",
        *(f"alarm, {sentence}" for sentence in alarms),
    ]


def _picture(demo: Demo) -> None:
    from inclinometry.report.figure import save_png

    figure, title = methods_compared(40)
    save_png(figure, demo.folder / "comparison.png")
    found = demo.comparisons["twelve"]
    rms = (f"{name} {np.degrees(error[1, 1]):.3f}" for name, error in found.error.items())
    at = np.degrees(found.inclination[1])
    sentence = f"{title}; of the tool above, azimuth at inclination {at:.0f}, deg: {', '.join(rms)}"
    picture = Entry("the methods side by side", "comparison.png", sentence=sentence, picture="comparison.png")
    # every file beside a report is linked from the first of its folder
    linked = {name for page in demo.pages for name in (page.href, page.picture)}
    entries = []
    for page in [*demo.pages, picture]:
        folder = (demo.folder / page.href).parent
        files = sorted(f"{folder.name}/{path.name}" for path in folder.iterdir()) if folder != demo.folder else []
        rest = [name for name in files if name not in linked]
        linked.update(rest)
        entries.append(page._replace(files=rest))
    write_text(index_page("Demonstration", entries), demo.folder / "index.html")


def methods_compared(draws: int) -> tuple[Figure, str]:
    """The methods side by side over simulated tools and rigs, what they do and not what they say; and the title."""
    from inclinometry.report.comparison import MethodCurve, comparison_figure

    inclination = np.radians([1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0])
    squared: dict[str, list[Array]] = {name: [] for name in ("joint", "twelve", "classical")}
    known: dict[str, Any] = {"joint": {"diagnose": False}}
    for seed in range(draws):
        readings, truth, _ = simulate.bench(plans.twelve(), seed, rig=RIG)
        known["classical"] = {"data_sheet": truth}  # at its best: each conversion factor is what the data sheet says
        for name, values in squared.items():
            found = method(name)(readings, **known.get(name, {}))
            values.append(true_errors(found.tool, truth, RIG.dip, inclination) ** 2)
    errors = {name: np.sqrt(np.mean(values, axis=0)) for name, values in squared.items()}
    curves = [MethodCurve(name, inclination, rms[:, 0], rms[:, 1]) for name, rms in errors.items()]
    title = f"12 positions, rig settings: standard deviation 0.1 deg: rms error over {draws} simulated tools"
    return comparison_figure(curves, title=title), title

"""The whole way once: real instruments calibrated, simulated benches and a hot gyro run through every method."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from inclinometry.calibration import plans
from inclinometry.calibration.acceptance import Verification, verify
from inclinometry.calibration.field import calibrate_field
from inclinometry.calibration.norm import NormFit, calibrate_norm
from inclinometry.calibration.norm_record import calibrate_norms
from inclinometry.calibration.plans import Plan
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.core.arrays import Array
from inclinometry.earth.site import Site
from inclinometry.io.atomic import write_text
from inclinometry.io.bench_csv import read_bench, write_bench
from inclinometry.io.survey_csv import read_raw_survey
from inclinometry.io.tool_json import read_calibration, write_calibration, write_truth
from inclinometry.report.calibration import calibration_report
from inclinometry.report.gyro import gyro_report, scale_report
from inclinometry.report.index import Entry, entry_of, index_page
from inclinometry.report.survey import survey_report
from inclinometry.report.verification import verification_report
from inclinometry.sensors.tool import Tool
from inclinometry.simulate.gyro import hot_run
from inclinometry.simulate.rig import Rig
from inclinometry.survey.gyro import gyro_survey
from inclinometry.survey.reduce import Survey, reduce_survey
from inclinometry.workflow import simulate
from inclinometry.workflow.calibrate import Comparison, Options, compare, true_errors
from inclinometry.workflow.demo_drilling import PICTURE, DemoDrilling, drill, drilling_sentences
from inclinometry.workflow.demo_well import DemoWell, survey_demo_well, well_sentences
from inclinometry.workflow.examples import XSENS_GRAVITY, cave_instrument, xsens_stations
from inclinometry.workflow.hot_run import JOINT, HotRunMethods, many_hot_runs, reduce_hot_run, rms_degrees
from inclinometry.workflow.methods import METHODS
from inclinometry.workflow.survey import survey_raw, write_survey

PUBLISHED_XSENS = {
    "bias": (33124.2, 33275.2, 32364.4),
    "counts per m/s2": (414.459, 412.010, 414.649),
    "misalignment": (-0.0033593, -0.00890639, -0.0213341),
}
"""imu_tk's own result on this log (Tedaldi, Pretto, Menegatti 2014), from its released calibration file."""

BENCHES = {"twelve": plans.twelve, "orthogonal": plans.orthogonal, "rotations": plans.rotations}
RIG = Rig(dip=np.radians(70.0), setting_sd=np.radians(0.1), base_tilt=np.radians(0.2))
SEED = 1
HOT_SEED = 8
"""A run in which the scale drifts by 1 % and K passes nought, so that every method shows its weakness."""
HOT_RUNS = 150
HOT_SPACING = 30.0  # m


@dataclass(frozen=True, eq=False)
class Cave:
    """A cave instrument, calibrated on shots 1-16 and judged on the roll set it has not seen."""

    calibration: Calibration
    axis_spread: float  # rms angle of the tool axis about its mean over the held-out rolls, rad
    dip_scatter: float  # standard deviation of the dip over them, rad


@dataclass(eq=False)
class Demo:
    """What the demo found, filled step by step."""

    folder: Path
    xsens: NormFit | None = None
    xsens_poses: int = 0
    cave: Cave | None = None
    comparisons: dict[str, Comparison] = field(default_factory=dict)
    verification: Verification | None = None
    survey: Survey | None = None
    survey_error: Array | None = None  # (n, 2) inclination, azimuth, rad
    hot_run: HotRunMethods | None = None  # the run that is pictured
    hot_runs_rms: dict[str, float] = field(default_factory=dict)  # method -> deg, over HOT_RUNS runs
    well: DemoWell | None = None
    drilling: DemoDrilling | None = None
    pages: list[Entry] = field(default_factory=list)

    def page(self, title: str, name: str, text: str, picture: str = "") -> None:
        """Write a report and remember it for the index, with a picture of the folder where there is one."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(text, path)
        self.pages.append(entry_of(title, name, text, picture))


def steps() -> Iterator[tuple[str, Callable[[Demo], None]]]:
    """The steps in order, each with what it does; every file is written whole or not at all."""
    yield "calibrating a real Xsens MTi from its log", _xsens
    yield "calibrating a real cave instrument without a rig", _cave
    for name in BENCHES:
        yield f"simulated bench, plan {name}, every method", partial(_bench, name=name)
    yield "verifying the tool at independent positions", _verify
    yield "surveying a simulated well with it", _well
    yield "a hot gyro run, 20 to 140 degC", _hot_run
    yield "quality, multi-station analysis and ellipse of a well drilled with a magnetised string", _magnetised
    yield "drilling with stick-slip: single samples, a textbook filter and this package", _drilling
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
    demo.cave = judge_cave(record, shots.take(np.arange(16, 24)))
    _store(demo, "cave", readings, record)
    demo.page("SAP6 cave instrument, real shots", "cave/report.html", calibration_report(record, readings=readings))


def judge_cave(record: Calibration, rolls: BenchReadings) -> Cave:
    """Spread of the tool axis and of the dip over a roll set the calibration has not seen."""
    seen = reduce_survey(np.arange(float(len(rolls))), rolls.channels, record.tool)
    axis = np.stack(
        [
            np.sin(seen.inclination) * np.cos(seen.azimuth),
            np.sin(seen.inclination) * np.sin(seen.azimuth),
            np.cos(seen.inclination),
        ],
        axis=1,
    )
    mean = axis.mean(axis=0) / np.linalg.norm(axis.mean(axis=0))
    off = np.arctan2(np.linalg.norm(np.cross(axis, mean), axis=1), axis @ mean)
    return Cave(record, float(np.sqrt(np.mean(off**2))), float(np.std(seen.dip)))


def _bench(demo: Demo, name: str) -> None:
    run = simulate.bench(BENCHES[name](), SEED, rig=RIG)
    folder = demo.folder / name
    folder.mkdir(parents=True, exist_ok=True)
    write_bench(run.readings, folder / "readings.csv")
    write_truth(run.truth, run.extras, folder / "truth.json")
    readings = read_bench(folder / "readings.csv")
    known = Options(level_sd=RIG.base_tilt, nameplate=run.truth)
    found = compare(readings, truth=run.truth, options=known)
    demo.comparisons[name] = found
    best = found.attempts[0].calibration
    if best is None:
        return
    record = replace(best, tool=_named(best.tool, "simulated 1"))
    write_calibration(record, folder / "tool.json")
    others = {a.method: a.calibration for a in found.attempts[1:] if a.calibration is not None}
    text = calibration_report(record, readings=readings, closed_forms=others)
    demo.page(f"simulated bench, plan {name}: calibration", f"{name}/report.html", text)


def _named(tool: Tool, name: str) -> Tool:
    return Tool(name, tool.triads, tool.covariance, tool.noise, tool.temperature_range)


def _store(demo: Demo, name: str, readings: BenchReadings, record: Calibration) -> None:
    folder = demo.folder / name
    folder.mkdir(parents=True, exist_ok=True)
    write_bench(readings, folder / "readings.csv")
    write_calibration(record, folder / "tool.json")


def _verify(demo: Demo) -> None:
    folder = demo.folder / "orthogonal"
    stand = simulate.read_truth(folder / "truth.json")
    run = simulate.bench(plans.twelve(4, 5), SEED + 1, rig=replace(RIG, setting_sd=np.radians(0.02)), truth=stand)
    write_bench(run.readings, folder / "check.csv")
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
    page = position_report(
        at.path,
        at.survey,
        at.uncertainty,
        azimuth_reference=at.azimuth_reference,
        tool_code=at.tool_code,
        calibration=at.calibration,
        notes=[*well_sentences(found), *at.notes],
        warnings=at.warnings,
        inputs=at.inputs,
    )
    demo.page("magnetised string: quality, analysis and where the well is", "magnetised/position.html", page)


def _hot_run(demo: Demo) -> None:
    from inclinometry.report.figure import save_png
    from inclinometry.report.gyro_figures import hot_run_figure

    folder = demo.folder / "gyro"
    folder.mkdir(parents=True, exist_ok=True)
    found = reduce_hot_run(hot_run(HOT_SEED))
    run, joint = found.run, found.stations[JOINT]
    band = {JOINT: joint.u("azimuth")}
    figure = hot_run_figure(run.temperature, run.inclination, found.errors, band, run.scale, found.track)
    save_png(figure, folder / "hot_run.png")
    depth = HOT_SPACING * np.arange(1.0, len(joint) + 1.0)
    site = Site(latitude=run.latitude)
    survey = gyro_survey(depth, joint, site=site, tool="a simulated gyro and exact accelerometers")
    others = {name: other for name, other in found.stations.items() if name != JOINT}
    page = gyro_report(
        survey, joint, md=depth, temperature=run.temperature, track=found.track, others=others, site=site
    )
    title = "simulated hot gyro run: survey by the Earth's rotation"
    demo.page(title, "gyro/gyro.html", page, "gyro/hot_run.png")
    text = scale_report(found.track, md=depth, tool="a simulated gyro")
    demo.page("simulated hot gyro run: scale factor over temperature", "gyro/scale.html", text)
    demo.hot_run, demo.hot_runs_rms = found, rms_degrees(many_hot_runs(HOT_RUNS))


def _drilling(demo: Demo) -> None:
    from inclinometry.report.dynamic import dynamic_report

    demo.drilling = drill(demo.folder / "drilling")
    page = dynamic_report(demo.drilling.found)
    demo.page("simulated drilling with stick-slip: attitude", "drilling/dynamic.html", page)
    head, *lines = drilling_sentences(demo.drilling)
    picture, sentence = f"drilling/{PICTURE}", f"{head} {'; '.join(lines)}"
    title = "simulated drilling: single samples, textbook filter and this package in one picture"
    demo.pages.append(Entry(title, picture, sentence=sentence, picture=picture))


def _picture(demo: Demo) -> None:
    from inclinometry.report.comparison import MethodCurve, comparison_figure
    from inclinometry.report.figure import save_png

    curves = [
        MethodCurve(name, INCLINATIONS_PICTURED, errors[:, 0], errors[:, 1])
        for name, errors in simulated_errors(PICTURED, BENCHES["twelve"](), INCLINATIONS_PICTURED, DRAWS).items()
    ]
    save_png(comparison_figure(curves, title=picture_title(DRAWS)), demo.folder / "comparison.png")
    found = demo.comparisons["twelve"]
    rms = (f"{name} {np.degrees(error[1, 1]):.3f}" for name, error in found.error.items())
    at = np.degrees(found.inclination[1])
    sentence = f"{picture_title(DRAWS)}; of the tool above, azimuth at inclination {at:.0f}, deg: {', '.join(rms)}"
    picture = Entry("the methods side by side", "comparison.png", sentence=sentence, picture="comparison.png")
    write_text(index_page("Demonstration", [*demo.pages, picture]), demo.folder / "index.html")


DRAWS = 40
PICTURED = ("joint", "twelve", "classical")
INCLINATIONS_PICTURED = np.radians([1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0])


def picture_title(draws: int) -> str:
    """Title of the picture of the methods side by side."""
    return f"12 positions, rig settings good to 0.1 deg: rms error over {draws} simulated tools"


def simulated_errors(methods: Sequence[str], plan: Plan, inclination: Array, draws: int) -> dict[str, Array]:
    """Rms errors (n, 3) of angles, rad, over simulated tools and rigs: what a method does, not what it says."""
    squared: dict[str, list[Array]] = {name: [] for name in methods}
    known: dict[str, Any] = {"joint": {"diagnose": False}}
    for seed in range(draws):
        run = simulate.bench(plan, seed, rig=RIG)
        known["classical"] = {"nameplate": run.truth}  # at its best: each conversion factor is what the nameplate says
        for name in methods:
            found = METHODS[name](run.readings, **known.get(name, {}))
            squared[name].append(true_errors(found.tool, run.truth, RIG.dip, inclination) ** 2)
    return {name: np.sqrt(np.mean(values, axis=0)) for name, values in squared.items()}

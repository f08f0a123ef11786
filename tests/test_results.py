"""Results in a notebook: each can be pickled and copied, is a table with units, prints shortly and draws itself."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import pickle
import pkgutil
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

import inclinometry as im
from inclinometry.allan import allan_deviation
from inclinometry.calibration.comparison import compare_calibrations
from inclinometry.calibration.rate_table import RateCalibration
from inclinometry.calibration.stillness import still_intervals
from inclinometry.files.bench_csv import write_raw_survey
from inclinometry.files.columns import GYRO_RUN, PARTS, SURVEY, channel
from inclinometry.files.survey_file import SurveyFile
from inclinometry.gyro.planning import GyroSetup, standstill_time
from inclinometry.position.propagation import SourceUncertainty
from inclinometry.position.tool_code import ToolCode, term
from inclinometry.position.well import well_survey
from inclinometry.sensors import parameter_names
from inclinometry.simulate.fleet import FleetScene, simulate_fleet
from inclinometry.survey.axial import axial_correction
from inclinometry.survey.gyro import RepeatLimits, compare_runs
from inclinometry.survey.multistation import multistation
from inclinometry.survey.multistation_priors import FieldReference
from inclinometry.survey.quality import judge_fields, with_sensors
from inclinometry.survey.run import Run
from inclinometry.survey.stations import Stations
from inclinometry.tabular import Tabular
from inclinometry.workflow.simulate_drilling import DrillingRequest, write_drilling
from inclinometry.workflow.simulate_gyro import gyro_run, write_gyro

SOURCE = Path(im.__file__).parent
DIP = np.radians(70.0)
FIELDS = {"accelerometer": np.array([0.0, 0.0, 1.0]), "magnetometer": np.array([np.cos(DIP), 0.0, np.sin(DIP)])}
REFERENCE = FieldReference(g=9.81, b=5e4, dip=DIP, g_sigma=0.01, b_sigma=130.0, dip_sigma=0.0035)
HERE = im.Site(latitude=1.0, g=9.81, b=5e4, dip=DIP, declination=0.1, dip_sigma=0.01)


@cache
def readings(seed: int = 1) -> Any:
    """24 stations of a tool with small errors, the units known."""
    plan, random = im.plans.orthogonal(), np.random.default_rng(seed)
    turns = im.dcm(plan.azimuth, plan.inclination, plan.toolface)
    errors = np.random.default_rng(5)
    channels = {}
    for kind, field in FIELDS.items():
        tensor, offset = np.eye(3) + 0.02 * errors.standard_normal((3, 3)), 0.02 * errors.standard_normal(3)
        channels[kind] = turns @ field @ tensor.T + offset + 1e-4 * random.standard_normal((24, 3))
    units = {"accelerometer": "m/s^2", "magnetometer": "nT"}
    return im.BenchReadings(
        channels, plan.azimuth, plan.inclination, plan.toolface, roll_set=plan.roll_set, units=units,
        temperature=np.full(24, 20.0), reference={"dip": DIP}, count=np.full(24, 4.0),
    )  # fmt: skip


@cache
def calibration() -> Any:
    return im.calibrate_joint(readings(), noise_sd=dict.fromkeys(FIELDS, 1e-4), rig_sd=1e-4, name="A7")


@cache
def stations() -> Any:
    inclination, toolface = np.radians(np.linspace(20.0, 60.0, 8)), np.radians(np.arange(8) * 80.0)
    g, b = im.fields(np.radians(40.0), inclination, toolface, DIP)
    return Stations(30.0 * np.arange(8.0), 9.81 * g, 5e4 * b + [0.0, 0.0, 300.0])


@cache
def survey() -> Any:
    g, b = im.fields(np.radians(40.0), np.radians(np.linspace(20.0, 60.0, 8)), 1.0, DIP)
    return im.reduce_survey(30.0 * np.arange(8.0), {"accelerometer": g, "magnetometer": b}, calibration().tool)


@cache
def path() -> Any:
    return im.minimum_curvature(survey().md, survey().inclination, survey().azimuth)


@cache
def survey_file() -> Any:
    return SurveyFile(
        md=[0.0, 30.0], inclination=[0.0, 0.1], azimuth=[1.0, 1.1], azimuth_reference="true", extra={"crew": ("A", "B")}
    )


@cache
def well() -> Any:
    code = ToolCode(name="mine", terms=(term("AZ", 0.3, "deg", "global", ("0", "0", "1")),), source="test")
    return im.propagate(well_survey(survey().md, survey().inclination, survey().azimuth, HERE), code)


@cache
def samples() -> Any:
    time = 0.01 * np.arange(3000)
    noise = np.random.default_rng(1).standard_normal((2, 3000, 3))
    g, b = im.fields(0.7, 0.5, 1.0, DIP)
    return im.Samples(time, 0.01, accel=9.81 * g + 0.01 * noise[0], mag=5e4 * b + 50.0 * noise[1])


@cache
def log_files() -> Any:
    """What is read from files: raw stations, a gyro run and its result, a dynamic run, noise of a log."""
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        channels = {kind: np.asarray(readings().channels[kind])[:3] for kind in FIELDS}
        write_raw_survey(folder / "raw.csv", np.array([10.0, 20.0, 30.0]), channels)
        run = gyro_run(1, stations=5, dwell=400.0)
        write_gyro(run, folder / "gyro.csv")
        write_drilling(DrillingRequest("vibration-5g", 2, duration=20.0), folder / "run.csv")
        noise = np.random.default_rng(1).standard_normal((1000, 2))
        rows = "\n".join(f"{0.1 * n:.1f},{a:.6f},{b:.6f}" for n, (a, b) in enumerate(noise))
        (folder / "log.csv").write_text(f"time_s,gyro_x_deg_h,gyro_y_deg_h\n{rows}\n")
        gyro = im.read_gyro_run(folder / "gyro.csv")
        hole = DrillingRequest("vibration-5g").chosen.hole
        place = im.Site(latitude=hole.latitude, g=hole.gravity, b=hole.field, dip=hole.dip)
        dynamic = im.dynamic_run(im.open_run(folder / "run.csv"), place, None, im.DynamicOptions("magnetic"))
        return {
            "raw": im.read_raw_survey(folder / "raw.csv"),
            "gyro": gyro,
            "north": im.north_run(gyro, im.Site(latitude=np.pi / 4, north_reference="true")),
            "dynamic": dynamic,
            "noise": im.noise_of_log(folder / "log.csv"),
        }


def simulation() -> Any:
    from inclinometry.simulate.bench import Rig

    plan = im.plans.twelve()
    return im.simulate_bench(calibration().tool, Rig(DIP), plan.azimuth, plan.inclination, plan.toolface, seed=1)


def rates() -> Any:
    triad = im.Triad("gyro", np.eye(3), np.zeros(3), "deg/h")
    names = parameter_names(triad)
    return RateCalibration(triad, None, names, np.eye(12), np.zeros((4, 3)), np.ones(3), 1.0, 1, None, None)


def repeats() -> Any:
    limits = RepeatLimits("mine", "contract", 0.004, 0.02, 0.09, 0.17, 10, 35.0)
    one, two = (Run(30.0 * np.arange(12), np.full(12, i), np.full(12, 0.5 + i)) for i in (0.5, 0.501))
    return compare_runs(one, two, limits)


def rests() -> Any:
    return still_intervals(0.01 * np.arange(2000), np.random.default_rng(1).standard_normal((2000, 3)))


def noise_curve() -> Any:
    return allan_deviation(np.random.default_rng(1).standard_normal((256, 2)), 0.1)


@cache
def fleet() -> Any:
    made = simulate_fleet(FleetScene(5, 1e-8 * np.eye(24), calibrations=3), seed=1)
    return im.fleet_status(made.histories, reproducibility=False, own_drift=False, iterations=2)


RESULTS: dict[str, Callable[[], Any]] = {
    "FleetStatus": fleet,
    "ToolHistory": lambda: fleet().tools[0].history,
    "BenchReadings": readings,
    "Calibration": calibration,
    "Residuals": lambda: calibration().residuals,
    "Tool": lambda: calibration().tool,
    "Triad": lambda: calibration().tool.triads["magnetometer"],
    "twelve": lambda: im.calibrate_orthogonal(readings()),
    "classical": lambda: im.calibrate_classical(readings(), data_sheet=calibration().tool),
    "field": lambda: im.calibrate_field(readings()),
    "Plan": im.plans.twelve,
    "ExpectedUncertainty": lambda: im.evaluate_plan(im.plans.twelve()),
    "Verification": lambda: im.verify(readings(2), calibration()),
    "Limits": lambda: im.Limits("mine", "contract", 0.01, 0.02, None),
    "RigOrientation": lambda: im.orient_rig(readings(2), calibration()),
    "RollHarmonics": lambda: im.roll_harmonics(np.arange(8.0), np.sin(np.arange(8.0))),
    "StillIntervals": rests,
    "RateCalibration": rates,
    "TwoCalibrations": lambda: compare_calibrations(calibration(), im.calibrate_orthogonal(readings())),
    "Comparison of methods": lambda: im.compare(readings()),
    "Site": lambda: HERE,
    "VectorAttitude": lambda: im.solve_davenport(np.eye(3), np.eye(3)[[1, 2, 0]], [1e-3, 1e-3, 1e-3]),
    "AllanCurve": noise_curve,
    "NoiseRecord": lambda: log_files()["noise"],
    "RawSurvey": lambda: log_files()["raw"],
    "GyroReadings": lambda: log_files()["gyro"],
    "GyroRun": lambda: log_files()["north"],
    "North": lambda: log_files()["north"].north,
    "ScaleTrack": lambda: log_files()["north"].track,
    "StandstillPlan": lambda: standstill_time(0.9, 0.5, np.radians(0.5), GyroSetup(arw=1e-6)),
    "Samples": samples,
    "Attitude": lambda: im.static_attitude(samples()),
    "DynamicRun": lambda: log_files()["dynamic"],
    "AttitudeRows": lambda: log_files()["dynamic"].rows,
    "AttitudeMeans": lambda: im.average_windows(log_files()["dynamic"].rows),
    "Vibration": lambda: log_files()["dynamic"].vibration,
    "Survey": survey,
    "Stations": stations,
    "MultiStation": lambda: multistation(stations(), REFERENCE),
    "FieldQuality": lambda: judge_fields(with_sensors(stations(), {"ABX": 0.004, "MBX": 70.0}), REFERENCE),
    "AxialCorrection": lambda: axial_correction(stations(), REFERENCE),
    "Comparison of runs": repeats,
    "Path": path,
    "Comparison of paths": lambda: im.compare_paths(path(), path()),
    "WellSurvey": lambda: well().survey,
    "SurveyFile": survey_file,
    "PositionUncertainty": well,
    "cut_stretches": lambda: im.cut_stretches(samples().time, samples().accel),
    "simulate_bench": simulation,
    "simulate_north_seeking": lambda: im.simulate_north_seeking(np.arange(4.0), latitude=0.5, seed=1),
    "angles": lambda: im.angles([0.1, 0.0, 1.0], [1.0, 0.0, 1.0]),
    "propagation": lambda: next(iter(well().sources.values())),
    "interpolate": lambda: im.interpolate(path(), [15.0]),
    "tortuosity": lambda: im.tortuosity(path()),
}
"""One object of every result."""
# each is made once: several take seconds
RESULTS = {name: cache(make) for name, make in RESULTS.items()}

WITHOUT_ROWS = (
    *("cut_stretches", "simulate_bench", "simulate_north_seeking", "angles", "propagation"),
    *("interpolate", "tortuosity"),
)

TABLES = [name for name in RESULTS if name not in WITHOUT_ROWS]
PICTURES = [
    *("BenchReadings", "Calibration", "Verification", "ExpectedUncertainty", "AllanCurve", "NoiseRecord", "GyroRun"),
    *("ScaleTrack", "Attitude", "DynamicRun", "Survey", "Path", "Comparison of paths", "PositionUncertainty"),
]


def same(one: Any, two: Any) -> None:
    """Equal all the way down; arrays to the bit and as writable as they were."""
    assert type(one) is type(two)
    if isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, two)
    elif isinstance(one, Mapping):
        assert list(one) == list(two)
        for name in one:
            same(one[name], two[name])
    elif dataclasses.is_dataclass(one):
        if isinstance(one, SourceUncertainty):
            same(one.covariance, two.covariance)
        for each in (field for field in dataclasses.fields(one) if field.compare):
            left, right = getattr(one, each.name), getattr(two, each.name)
            same(left, right)
            if isinstance(left, np.ndarray) and isinstance(one, Tabular):
                assert left.flags.writeable == right.flags.writeable, each.name
            if isinstance(left, MappingProxyType):
                for name, value in left.items():
                    assert not isinstance(value, np.ndarray) or value.flags.writeable == right[name].flags.writeable
    elif isinstance(one, (tuple, list)):
        assert len(one) == len(two)
        for a, b in zip(one, two, strict=True):
            same(a, b)
    else:
        assert one == two or (one != one and two != two)


def test_every_class_with_rows_is_looked_at() -> None:
    declared = {
        (str(file.relative_to(SOURCE).with_suffix("")).replace("/", "."), name)
        for file in SOURCE.rglob("*.py")
        for name in re.findall(r"^class (\w+)\(Tabular\b", file.read_text("utf-8"), re.MULTILINE)
    }
    made = {type(RESULTS[name]()) for name in TABLES}
    assert {(one.__module__.removeprefix("inclinometry."), one.__name__) for one in made} == declared


@pytest.mark.parametrize("name", RESULTS)
def test_it_pickles_and_copies(name: str) -> None:
    found = RESULTS[name]()
    same(found, pickle.loads(pickle.dumps(found)))
    same(found, copy.deepcopy(found))
    same(found, copy.copy(found))


def test_a_copy_of_a_run_is_the_file_opened_anew(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time_s,accel_x,accel_y,accel_z\n0,1,2,3\n0.1,1,2,3\n")
    run = im.open_run(tmp_path / "run.csv")
    for again in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run), run):
        (block,) = again.blocks()
        np.testing.assert_array_equal(block.channels["accelerometer"], [[1.0, 2.0, 3.0]] * 2)
    assert repr(run).endswith("run.csv; accel_x, accel_y, accel_z")


def test_it_is_unpickled_where_nothing_is_imported_yet(tmp_path: Path) -> None:
    (tmp_path / "tool.pickle").write_bytes(pickle.dumps(calibration().tool))
    told = "import pickle, sys; print(*pickle.load(open(sys.argv[1], 'rb')).triads)"
    done = subprocess.run([sys.executable, "-c", told, tmp_path / "tool.pickle"], capture_output=True, check=True)
    assert done.stdout.split() == [b"accelerometer", b"magnetometer"]


@pytest.mark.parametrize("name", TABLES)
def test_it_is_a_table(name: str) -> None:
    columns = RESULTS[name]().to_dict()
    sizes = {len(column) for column in columns.values()}
    assert len(sizes) == 1
    for title, column in columns.items():
        assert np.ndim(column) == 1, title
        assert re.fullmatch(r"[A-Za-z]\w*", title), title
    # an angle without its unit is the mistake; where a row has a unit of its own, a column says it
    angles = [t for t in columns if re.search(r"inclination|azimuth|toolface|dip|phase|tilt", t)]
    assert all(t.endswith("_deg") or re.match(r"decision|azimuth_reference", t) for t in angles), angles


@pytest.mark.parametrize("name", TABLES)
def test_it_prints_shortly(name: str) -> None:
    found = RESULTS[name]()
    lines = repr(found).splitlines()
    warnings = len(getattr(found, "warnings", ())) + len(getattr(found, "findings", ()))
    assert len(lines) <= 30 + warnings
    assert "array(" not in repr(found)
    html = found._repr_html_()
    assert html.count("<tr>") <= 12
    assert html.startswith("<table>")


def test_repr_is_in_degrees() -> None:
    assert "latitude 57.29577951 deg" in repr(im.Site(latitude=1.0))
    expected = repr(im.evaluate_plan(im.plans.twelve(), rig_sd=0.0))
    assert "inclination_deg" in expected
    assert "1.0471" not in expected  # 60 degrees


def test_columns_of_readings_and_surveys_are_those_of_the_files() -> None:
    for name in RESULTS["BenchReadings"]().to_dict():
        assert channel(name) is not None or name in ("station", "temperature_degC", "count", "roll_set", *_DIALS)
    # the file's g_total states no unit
    assert set(survey().to_dict()) - set(SURVEY) - set(PARTS) == {"g_total_m_s2"}
    assert set(RESULTS["Samples"]().to_dict()) == {"time_s", *(f"accel_{a}_m_s2" for a in "xyz"), *_MAG}
    for name in RESULTS["GyroReadings"]().to_dict():
        assert channel(name) is not None or name in GYRO_RUN


_DIALS = ("azimuth_deg", "inclination_deg", "toolface_deg")
_MAG = ("mag_x_nT", "mag_y_nT", "mag_z_nT")


def test_numbers_of_a_table_are_those_of_the_record() -> None:
    found = survey().to_dict()
    np.testing.assert_allclose(np.radians(found["u_azimuth_deg"]), survey().u_azimuth, atol=1e-12)  # rounded at 1e-10
    tool = calibration().tool
    columns = tool.to_dict()
    tensor = np.concatenate([triad.tensor[0] for triad in tool.triads.values()])
    np.testing.assert_array_equal(np.stack([columns[f"along_{a}"] for a in "xyz"], axis=1), tensor)
    names = [n.replace(".tensor", "") for n in tool.parameter_names]
    u = np.sqrt(np.diagonal(tool.covariance))
    assert columns["u_along_y"][4] == u[names.index("magnetometer[1,1]")]


def test_sensors_of_two_calibrations_are_named_like_those_of_one() -> None:
    columns = RESULTS["TwoCalibrations"]().to_dict()
    assert list(dict.fromkeys(columns["sensor"])) == calibration().tool.to_dict()["sensor"]


def test_a_verification_prints_its_verdict() -> None:
    assert repr(RESULTS["Verification"]()).splitlines()[0].startswith("Verification: 24 rows; verdict agrees")


def test_errors_that_were_not_judged_are_not_drawn() -> None:
    ax = pytest.importorskip("matplotlib.figure").Figure().subplots()
    found = RESULTS["Verification"]()
    found.plot(ax)
    drawn = np.stack([np.isfinite(line.get_ydata()) for line in ax.lines], axis=1)
    np.testing.assert_array_equal(drawn, np.array(found.decision) != "not judged")
    assert not drawn.all()  # at the vertical there is no azimuth


def test_a_tool_that_knows_temperature_has_columns_for_its_powers() -> None:
    warm = im.Triad("magnetometer", np.stack([np.eye(3), 0.1 * np.eye(3)]), np.zeros((2, 3)), "nT")
    columns = im.Tool("1", {"accelerometer": im.Triad("accelerometer", np.eye(2, 3), [0, 0]), "magnetometer": warm})
    table = columns.to_dict()
    assert table["sensor"] == ["accel_x", "accel_y", "mag_x", "mag_y", "mag_z"]
    np.testing.assert_array_equal(table["along_x_T1"], [np.nan, np.nan, 0.1, 0.0, 0.0])


@pytest.mark.parametrize("name", TABLES)
def test_pandas_takes_it(name: str) -> None:
    pandas = pytest.importorskip("pandas")
    found = RESULTS[name]()
    frame = found.to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == list(found.to_dict())


@pytest.mark.parametrize("name", TABLES)
def test_arrow_takes_it(name: str) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    found = RESULTS[name]()
    table = pyarrow.table(found)  # by the stream, as polars and duckdb do
    assert table.column_names == list(found.to_dict())
    for title, column in found.to_dict().items():
        np.testing.assert_array_equal(table[title].to_numpy(zero_copy_only=False), np.asarray(column))


@pytest.mark.parametrize(
    ("package", "remedy", "use"),
    [
        ("pandas", "pip install pandas", lambda: path().to_dataframe()),
        ("pyarrow", 'pip install "inclinometry[formats]"', lambda: path().__arrow_c_stream__()),
        ("matplotlib", 'pip install "inclinometry[report]"', lambda: path().plot()),
    ],
)
def test_a_package_that_is_missing_is_named_with_its_remedy(
    package: str, remedy: str, use: Any, monkeypatch: Any
) -> None:
    path()
    gone = [name for name in sys.modules if name.partition(".")[0] == package]
    for name in {package, *gone}:
        monkeypatch.setitem(sys.modules, name, None)  # what an import of an absent package finds
    with pytest.raises(ModuleNotFoundError, match=re.escape(remedy)) as told:
        use()
    assert told.value.name == package


def test_no_optional_package_is_imported_for_a_table() -> None:
    told = (
        "import sys, inclinometry as im; p = im.minimum_curvature([0, 30], [0, 0], [0, 0]);"
        "p.to_dict(), repr(p), p._repr_html_();"
        "print([n for n in ('pandas', 'pyarrow', 'matplotlib') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", PICTURES)
def test_it_draws_itself_on_the_axes_given(name: str) -> None:
    figure = pytest.importorskip("matplotlib.figure")
    ax = figure.Figure().subplots()
    assert RESULTS[name]().plot(ax) is ax
    assert ax.lines
    labels = ax.get_xlabel() + ax.get_ylabel()
    assert re.search(r", (m|s|deg|m/s|unit)|station|degC", labels), labels


def test_depth_runs_down_however_often_it_is_drawn() -> None:
    ax = pytest.importorskip("matplotlib.figure").Figure().subplots()
    for _ in range(2):
        survey().plot(ax)
        assert ax.yaxis_inverted()


def test_a_path_is_drawn_in_space_on_axes_of_space() -> None:
    ax = pytest.importorskip("matplotlib.figure").Figure().add_subplot(projection="3d")
    assert path().plot(ax) is ax
    assert ax.get_zlabel() == "true vertical depth, m"


def test_without_axes_pyplot_makes_them(monkeypatch: Any) -> None:
    pytest.importorskip("matplotlib").use("agg")
    from matplotlib import pyplot

    ax = path().plot()
    assert ax.figure.number in pyplot.get_fignums()
    pyplot.close(ax.figure)


@pytest.mark.parametrize(
    ("use", "said"),
    [
        (
            lambda: im.calibrate_joint("readings.csv"),
            "calibrate_joint takes readings; read_bench('readings.csv') gives",
        ),
        (lambda: im.calibrate_twelve(Path("a.csv")), "calibrate_twelve takes readings; read_bench('a.csv') gives them"),
        (lambda: im.calibrate_field(np.eye(3)), "calibrate_field takes readings, not a ndarray; read_bench(...) gives"),
        (lambda: im.compare("a.csv"), "compare takes readings; read_bench('a.csv')"),
        (lambda: im.verify(readings(), "tool.json"), "verify takes a calibration; read_calibration('tool.json')"),
        (lambda: im.survey_raw("raw.csv", calibration()), "survey_raw takes raw stations; read_raw_survey('raw.csv')"),
        (lambda: im.survey_raw(log_files()["raw"], calibration().tool), "survey_raw takes a calibration, not a Tool"),
        (lambda: im.reduce_survey([0.0], {}, calibration()), "takes a tool: give the tool of this Calibration"),
        (lambda: im.propagate(survey()), "propagate takes stations of a well, not a Survey"),
        (lambda: im.interpolate(survey(), [1.0]), "interpolate takes a path, not a Survey; minimum_curvature("),
        (lambda: im.north_run("gyro.csv", HERE), "north_run takes readings of a gyro run; read_gyro_run('gyro.csv')"),
        (lambda: im.dynamic_run("run.csv", HERE), "dynamic_run takes a run; open_run('run.csv') gives one"),
        (lambda: im.static_attitude(np.eye(3)), "static_attitude takes samples, not a ndarray; cut_stretches"),
        (lambda: im.expected_uncertainty("tool.json"), "takes a calibration; read_calibration('tool.json')"),
        (lambda: im.evaluate_plan("plan.csv"), "evaluate_plan takes a plan; plans.twelve() gives one"),
    ],
)
def test_what_is_no_record_is_refused_with_what_gives_one(use: Any, said: str) -> None:
    with pytest.raises(TypeError, match=re.escape(said)):
        use()


def test_plans_shows_plans() -> None:
    assert all(isinstance(getattr(im.plans, name)(), im.Plan) for name in dir(im.plans) if name != "Plan")
    assert "twelve" in dir(im.plans)


@pytest.mark.parametrize("room", ["calibration", "gyro", "survey", "position", "files"])
def test_what_was_found_stays_as_it_is_and_compares_without_an_error(room: str) -> None:
    """No field of a result can be set anew; == of arrays is no truth value; a result prints as the tables do."""
    package = importlib.import_module(f"inclinometry.{room}")
    for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        for name, made in vars(importlib.import_module(info.name)).items():
            given = vars(made).get("__dataclass_params__") if isinstance(made, type) else None
            if given is None or made.__module__ != info.name:
                continue
            assert given.frozen or room == "files", name  # a reader of a file goes on
            arrays = any("Array" in str(one.type) for one in dataclasses.fields(made))
            assert not (arrays and given.eq), name
            assert not (issubclass(made, Tabular) and given.repr), name

"""Three scripts as a user writes them, with what the package shows at its door and nothing else."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest
from tests.refusals import refused

import inclinometry as im
from inclinometry.cli import main

CALIBRATE = """
import inclinometry as im

readings = im.read_bench("readings.csv")
calibration = im.calibrate_joint(readings)
print(calibration)
calibration.plot()

# which plan would have told more of the azimuth, for a rig good to 0.05 deg?
for plan in (im.plans.twelve(), im.plans.orthogonal(), im.plans.half()):
    print(plan.name, len(plan), "positions:", im.degrees(im.plan_value(plan, rig_sd=im.radians(0.05))).round(4), "deg")

# a cave instrument's accelerometer alone, in its own axes, from the length of gravity
with im.reading_with("topodroid"):
    shots = im.read_bench("distox2.csv")
norm = im.calibrate_norm(shots.channels["accelerometer"], strength=9.80665)
print(norm.bias)
im.write_calibration(calibration, "tool.json")
"""

POSITION = """
import inclinometry as im

with im.reading_with(None, "ft,deg"):
    survey = im.read_survey("survey.csv")
path = im.minimum_curvature(survey.md, survey.inclination, survey.azimuth)
print(path)

with im.reading_with(None, "ft,deg"):
    found = im.read_position("survey.csv", "site.toml", "iscwsa-mwd-rev5.1")
ellipse = im.horizontal_ellipse(found.uncertainty.covariance[-1], probability=0.95)
print(ellipse.major, "m towards", im.degrees(ellipse.direction), "deg")
axes = found.uncertainty.plot()
axes.figure.savefig("ellipse.png")
"""

DYNAMIC = """
import inclinometry as im

run = im.open_run("run.parquet")
site = im.read_site("site.toml")
attitude = im.dynamic_run(run, site)
im.write_dynamic(attitude, "attitude.csv")

rows = im.read_attitude("attitude.csv")
table = rows.to_dataframe()
print(table[["time_s", "inclination_deg"]].tail(3))
"""


def made(*arguments: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    assert stop.value.code == 0


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("site.toml").write_text(
        "g = 9.80665\nb_nT = 50000\ndip_deg = 70\ndeclination_deg = 3\nconvergence_deg = 0\nlatitude_deg = 60\n"
        'longitude_deg = 10\nheight_m = 0\nnorth_reference = "true"\n'
    )
    pytest.importorskip("matplotlib").use("agg")
    return tmp_path


def ran(script: str, capsys) -> str:
    assert re.findall(r"^(?:import|from) .*", script, re.M) == ["import inclinometry as im"]
    capsys.readouterr()
    exec(compile(script, "script", "exec"), {})
    return capsys.readouterr().out


def test_calibrate_and_compare_plans(folder, capsys):
    made("simulate", "bench", "--plan", "orthogonal", "-o", "readings.csv", "-q")
    shots = Path(__file__).parents[1] / "reference" / "topodroid" / "distox2.csv"
    Path("distox2.csv").write_bytes(shots.read_bytes())
    said = ran(CALIBRATE, capsys)
    assert len(re.findall(r"positions: 0\.\d+ deg", said)) == 3
    assert Path("tool.json").exists()


def test_from_a_survey_to_an_ellipse(folder, capsys):
    rows = "".join(f"{100 * k},{min(3 * k, 45)},{30 + k},true\n" for k in range(30))
    Path("survey.csv").write_text("MD,INC,AZI,azimuth_reference\n" + rows)
    said = ran(POSITION, capsys)
    assert re.search(r"[\d.]+ m towards [\d.]+ deg", said)
    assert Path("ellipse.png").read_bytes().startswith(b"\x89PNG")


def test_attitude_while_drilling(folder, capsys):
    pytest.importorskip("pandas")
    made(
        "simulate",
        "drilling",
        "--scenario",
        "smooth",
        "--seed",
        "1",
        "-o",
        "run.parquet",
        "--truth",
        "truth.parquet",
        "-q",
    )
    said = ran(DYNAMIC, capsys)
    assert "inclination_deg" in said


@pytest.mark.parametrize(
    "given",
    [
        lambda: im.fields(90.0, 45.0, 10.0, 1.2),
        lambda: im.fields(0.0, 0.5, 0.0, 70.0),
        lambda: im.dcm(90.0, 45.0, 10.0),
        lambda: im.Plan("mine", [0.0, 90.0], [0.0, 90.0], [0.0, 90.0]),
        lambda: im.patent_azimuth(0.1, 0.1, 1e-5, 1e-5, 9.8, 60.0),
    ],
)
def test_degrees_in_the_place_of_radians_are_refused(given):
    with refused("input-value", error=im.InputError, allowed=" rad"):
        given()


RECORDS = (
    "Readings",
    "Calibration",
    "Tool",
    "Survey",
    "Site",
    "Plan",
    "Path",
    "Samples",
    "Attitude",
    "RunFile",
    "Run'",
    "PositionUncertainty",
    "Stations",
    "SixAxis",
)


def record_functions() -> list[str]:
    """Public functions whose first argument is a record and no name of a file."""
    found = []
    for name in im.__all__:
        value = getattr(im, name)
        if inspect.isfunction(value):
            first = str(next(iter(inspect.signature(value).parameters.values())).annotation)
            if any(record in first for record in RECORDS) and "str" not in first:
                found.append(name)
    return found


@pytest.mark.parametrize("name", record_functions())
def test_every_function_of_a_record_says_what_it_takes(name):
    function = getattr(im, name)
    more = list(inspect.signature(function).parameters.values())[1:]
    needed = [None for p in more if p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD]
    named = {p.name: 1 for p in more if p.default is p.empty and p.kind is p.KEYWORD_ONLY}
    with pytest.raises(TypeError, match=rf"^{name} takes "):
        function("x.csv", *needed, **named)

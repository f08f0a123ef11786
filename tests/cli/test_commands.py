"""Each command as a user runs it: what it writes is what the contract says and agrees with the truth."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from inclinometry.cli.demo import show_hot_run
from inclinometry.files import json_codec
from inclinometry.files.bench_csv import read_bench
from inclinometry.simulate.gyro import hot_run
from inclinometry.workflow.demo import Demo
from inclinometry.workflow.gyro_heating_example import reduce_hot_run, rms_degrees

from .tables import rows_of

SURVEY = (
    "md_m,inclination_deg,azimuth_deg,azimuth_reference,toolface_deg,magnetic_toolface_deg,g_total,b_total_nT,dip_deg,"
    "u_inclination_deg,u_azimuth_deg,u_toolface_deg,flags,toolface_type,"
    "u_inclination_common_deg,u_azimuth_common_deg,correlation_common,"
    "u_inclination_random_deg,u_azimuth_random_deg,correlation_random"
)


@pytest.mark.parametrize("plan", ["twelve", "orthogonal", "half", "two-face", "rotations"])
def test_plan_writes_settings_that_can_be_simulated(run, plan):
    assert run("plan", plan, "-o", "plan.csv").status == 0
    assert {"station", "azimuth_deg", "inclination_deg", "toolface_deg"} <= set(rows_of("plan.csv")[0])
    assert run("simulate bench --plan plan.csv -o readings.csv").status == 0
    assert len(rows_of("readings.csv")) == len(rows_of("plan.csv"))


@pytest.mark.long
def test_plan_optimal_keeps_to_its_number_and_is_reproducible(run):
    for name in ("a.csv", "b.csv"):
        done = run("plan optimal -n 12 --inclination-range-deg 0 20 -o", name, "--json").ok()
        assert done.json["stations"] == 12
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


@pytest.mark.parametrize(
    ("plan", "method"),
    [
        ("twelve", "joint"),
        pytest.param("twelve", "twelve", marks=pytest.mark.long),
        pytest.param("orthogonal", "orthogonal", marks=pytest.mark.long),
        pytest.param("two-face", "orthogonal", marks=pytest.mark.long),
        pytest.param("rotations", "rotations", marks=pytest.mark.long),
    ],
)
def test_calibrate_finds_the_truth(run, bench, plan, method):
    bench(plan)
    run("calibrate readings.csv -o tool.json --method", method, "--report", "report.html").ok()
    tool, truth = json.loads(Path("tool.json").read_text()), json.loads(Path("truth.json").read_text())
    wanted = {
        "schema", "version", "tool", "created", "method", "inputs", "convention", "triads", "covariance",
        "field_directions", "rig", "residuals", "temperature_range_degC", "findings",
    }  # fmt: skip
    assert wanted <= set(tool)
    names = tool["covariance"]["parameters"]
    sd = dict(zip(names, np.sqrt(np.diagonal(tool["covariance"]["matrix"])), strict=True))
    for kind in ("accelerometer", "magnetometer"):
        assert {"tensor", "offset", "unit"} <= set(tool["triads"][kind])
        off = np.subtract(tool["triads"][kind]["tensor"], truth["triads"][kind]["tensor"])
        spread = [[sd[f"{kind}.tensor[{i},{j}]"] for j in range(3)] for i in range(3)]
        # 18 normal deviates exceed 5 standard uncertainties once in 10^5 runs, and the seed is fixed
        assert np.abs(off / spread).max() < 5.0
    assert Path("report.html").read_text(encoding="utf-8").lstrip().startswith("<!doctype html>")


@pytest.mark.long
def test_same_input_gives_the_same_bytes(run, bench):
    bench()
    for name in ("a.json", "b.json"):
        assert run("calibrate readings.csv -o", name, "--report", f"{name}.html").status == 0
    assert Path("a.json").read_bytes() == Path("b.json").read_bytes()
    assert Path("a.json.html").read_bytes() == Path("b.json.html").read_bytes()
    assert b"\r" not in Path("a.json").read_bytes()


@pytest.mark.long
def test_compare_says_what_applies_and_what_does_not(run, bench):
    bench()
    done = run("compare readings.csv --truth truth.json --json").ok()
    methods = {m["method"]: m for m in done.json["methods"]}
    assert methods["joint"]["applicable"]
    assert methods["twelve"]["applicable"]
    assert not methods["orthogonal"]["applicable"]
    assert methods["orthogonal"]["reason"]["code"] == "plan-not-method"
    # the joint fit states less and the table shows it
    joint, twelve = (np.array(methods[m]["expected_u_deg"]["from_calibration"]["azimuth"]) for m in ("joint", "twelve"))
    # but where the field lies flat: the closed form counts nothing that its readings do not exclude
    assert (joint[:2] < twelve[:2]).all()
    assert (
        len(re.findall("(?m)^ joint", run("compare", "readings.csv").out)) == 2
    )  # a table of inclination, one of azimuth


def test_a_verification_says_before_it_begins_what_it_will_find(run, bench):
    """Of a plan alone: factor and risks; a plan of few positions is called too little before anybody turns a dial."""
    bench("twelve")
    run("calibrate readings.csv -o tool.json --rig-sd-deg 0.1")
    for name, worth in (("spread", True), ("six", False)):
        run("plan", name, "-o", "plan.csv")
        done = run("verify plan.csv --calibration tool.json --planned").ok()
        assert "This check detects (90 %) a tool with" in done.out
        assert "a tool with twice its certified errors agrees" in done.out
        assert "risk" not in done.out  # of a decision, and there are no limits to decide by
        assert ("[verify-detects-little]" in done.err) is not worth
    told = run("verify plan.csv --calibration tool.json --planned --json").json
    assert told["positions"] == 6
    assert told["detected_factor_90_percent"]["times"] > 4.0
    run("verify plan.csv --calibration tool.json --planned --report r.html -o p.json").refused(
        "--report ", "[input-not-with]"
    )
    assert not Path("p.json").exists()


def test_what_is_planned_is_written(run, bench):
    """The protocol before the first reading: positions with limits and risks; the verification itself holds to them."""
    bench("twelve")
    run("calibrate readings.csv -o tool.json --rig-sd-deg 0.1")
    run("plan spread -o plan.csv")
    given = ("--calibration", "tool.json")
    done = run("verify", "plan.csv", *given, "--planned", "-o", "planned.json").ok()
    assert "written to planned.json" in done.out
    content = json_codec.of_kind(
        json_codec.load(Path("planned.json")), "planned.json", "inclinometry/planned-verification", version=3
    )
    assert len(content["positions"]) == 12
    shown = run("verify", "plan.csv", *given, "--planned", "--json").json
    for key, value in content["power"].items():
        # a terminal shows twelve digits; without agreed limits there is no consumer's risk
        assert value is shown[key] if value is None else value == pytest.approx(shown[key], rel=1e-9)
    again = Path("planned.json").read_bytes()
    run("verify", "plan.csv", *given, "--planned", "-o", "planned.json")
    assert Path("planned.json").read_bytes() == again
    bench = ("--rig-sd-deg", "0.1", "--tool", "truth.json", "--plan", "plan.csv", "--seed", "7")
    run("simulate", "bench", *bench, "-o", "check.csv")
    run("verify", "check.csv", *given, "-o", "verify.json")
    held = json_codec.load(Path("verify.json"))["report"]["positions"]
    for before, after in zip(content["positions"], held, strict=True):
        # the azimuth is that of the readings: it differs by the tool's own error
        assert before["inclination"]["U_deg"] == pytest.approx(after["inclination"]["U_deg"], rel=0.05)
        assert (before["inclination"]["limit_deg"], after["inclination"]["limit_deg"]) == (None, None)
        assert before["inclination_deg"] == after["inclination_deg"]
    wrong = run("verify check.csv --calibration planned.json")
    assert "[record-kind]" in wrong.err


@pytest.mark.long
def test_verify_passes_the_tool_and_fails_another(run, bench):
    bench("orthogonal")
    assert run("calibrate readings.csv -o tool.json").status == 0
    again = ("simulate", "bench", "--plan", "twelve", "--tool", "truth.json", "--seed", 9, "--rig-sd-deg", 0.05)
    assert run(*again, "-o", "check.csv").status == 0
    done = run("verify check.csv --calibration tool.json --report verify.html --json")
    assert (done.status, done.json["verdict"], done.json["limits"]) == (0, "agrees", None), done.err
    assert all("limit_deg" not in one["azimuth"] for one in done.json["stations"])
    assert run("simulate bench --plan twelve --seed 5 -o other.csv").status == 0
    done = run("verify other.csv --calibration tool.json")
    assert done.status == 1
    assert "DOES NOT AGREE" in done.out
    assert "PASS" not in done.out + done.err
    assert "FAIL" not in done.out + done.err
    run("verify readings.csv --calibration tool.json").refused("independent")


@pytest.mark.long
def test_survey_has_the_columns_and_the_angles(run, well):
    run("survey raw.csv --calibration tool.json -o survey.csv --report survey.html").ok()
    assert Path("survey.csv").read_text().splitlines()[0] == SURVEY
    for found, true in zip(rows_of("survey.csv"), rows_of("path.csv"), strict=True):
        off = float(found["inclination_deg"]) - float(true["inclination_deg"])
        assert abs(off) < 4.5 * float(found["u_inclination_deg"])
        turn = (float(found["azimuth_deg"]) - float(true["azimuth_deg"]) + 180.0) % 360.0 - 180.0
        assert abs(turn) < 4.5 * float(found["u_azimuth_deg"])
        assert found["azimuth_reference"] == "magnetic"
        assert float(found["g_total"]) == pytest.approx(9.80665, abs=0.03)
        assert float(found["b_total_nT"]) == pytest.approx(50000.0, abs=200.0)


def test_survey_says_by_which_toolface_to_steer(run, well):
    for stated, limit in (((), 5.0), (("--switch-deg", 20), 20.0)):
        assert run("survey raw.csv --calibration tool.json -o survey.csv", *stated).status == 0
        found = rows_of("survey.csv")
        steep = [float(row["inclination_deg"]) < limit for row in found]
        assert [row["toolface_type"] == "magnetic" for row in found] == steep
        assert {row["toolface_type"] for row in found} == {"magnetic", "gravity"}
    # the file with the column is one the other commands take
    assert run("convert survey.csv survey.las").status == 0
    Path("place.toml").write_text("g = 9.80665\nb_nT = 50000\ndip_deg = 70\nlatitude_deg = 60\ndeclination_deg = 0\n")
    known = ("--site", "place.toml", "--tool-code", "iscwsa-mwd-rev5.1")
    run("position", "survey.csv", *known, "-o", "position.csv").ok()
    run("survey raw.csv --calibration tool.json -o survey.csv --switch-deg 100").refused("--switch-deg is 100")


def test_survey_turns_to_the_north_the_site_asks_for(run, well):
    assert run("survey raw.csv --calibration tool.json -o magnetic.csv").status == 0
    site = 'north_reference = "grid"\ndeclination_deg = 5.0\nconvergence_deg = 1.5\nsigma_declination_deg = 0.4\n'
    Path("site.toml").write_text(site)
    assert run("survey raw.csv --calibration tool.json --site site.toml -o grid.csv").status == 0
    for magnetic, grid in zip(rows_of("magnetic.csv"), rows_of("grid.csv"), strict=True):
        turn = (float(grid["azimuth_deg"]) - float(magnetic["azimuth_deg"])) % 360.0
        assert turn == pytest.approx(3.5, abs=1e-6)
        assert grid["azimuth_reference"] == "grid"
        assert float(grid["u_azimuth_deg"]) >= 0.4 - 1e-9


def test_readings_of_a_log_with_a_plan(run):
    assert run("simulate log --plan twelve -o log.csv --truth truth.json").status == 0
    assert run("plan twelve -o plan.csv").status == 0
    run("readings log.csv --plan plan.csv -o readings.csv").ok()
    assert len(rows_of("readings.csv")) == 12
    assert run("calibrate readings.csv -o tool.json").status == 0
    tool, truth = json.loads(Path("tool.json").read_text()), json.loads(Path("truth.json").read_text())
    # 500 samples a rest: 3 mg / 22 and 20 nT / 22, a few parts in 10^5 of full scale
    for kind, full in (("accelerometer", 9.8), ("magnetometer", 5e4)):
        assert np.allclose(tool["triads"][kind]["tensor"], truth["triads"][kind]["tensor"], atol=2e-4 * full)
    run("plan orthogonal -o other.csv")
    run("readings log.csv --plan other.csv -o no.csv").refused("24 positions")
    assert not Path("no.csv").exists()


def test_readings_of_a_log_keep_the_units_of_its_columns(run):
    """A rest's columns are named as the log's: read again, the calibration is in m/s² and nT, not in counts."""
    step = np.repeat([[0.0, 0.0, 9.8], [9.8, 0.0, 0.0], [0.0, -9.8, 0.0]], 300, axis=0)
    noise = np.random.default_rng(1).normal(size=(900, 6))
    values = np.hstack([step + 0.003 * noise[:, :3], 5e3 * step[:, ::-1] + 20.0 * noise[:, 3:]])
    head = "time_s," + ",".join([f"accel_{a}_m_s2" for a in "xyz"] + [f"mag_{a}_nT" for a in "xyz"])
    lines = [",".join(map(str, [0.01 * k, *row.tolist()])) for k, row in enumerate(values)]
    Path("log.csv").write_text("\n".join([head, *lines]) + "\n")
    run("readings log.csv -o rests.csv").ok()
    names = list(rows_of("rests.csv")[0])
    assert {"accel_x_m_s2", "accel_z_m_s2_sd", "mag_y_nT"} <= set(names)
    assert not {"accel_x", "mag_y"} & set(names)
    assert dict(read_bench("rests.csv").units) == {"accelerometer": "m/s^2", "magnetometer": "nT"}


@pytest.mark.long
def test_temperature_campaign_is_seen_and_extrapolation_flagged(run, bench):
    bench("twelve", "--temperature-degC", 20, 60, 100, "--temperature-degree", 1)
    run("calibrate readings.csv -o tool.json --json").ok()
    tool = json.loads(Path("tool.json").read_text())
    assert tool["temperature_range_degC"] == [20.0, 100.0]
    assert len(tool["triads"]["accelerometer"]["temperature_coefficients"]) == 1
    Path("raw.csv").write_text(
        "md_m,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z,temperature_degC\n0,-300,20,1500,500,-60,1400,150\n"
    )
    run("survey raw.csv --calibration tool.json -o survey.csv").ok()
    assert "temperature" in rows_of("survey.csv")[0]["flags"]


@pytest.mark.long
def test_demo_runs_and_leaves_its_pages(run):
    done = run("demo --output out --json").ok()
    assert {p.name for p in Path("out").glob("*")} >= {
        "index.html",
        "comparison.png",
        "xsens",
        "cave",
        "twelve",
        "gyro",
    }
    found = done.json
    assert found["xsens"]["poses"] == 38
    assert found["cave"]["axis_spread_deg"] < 0.27
    assert found["verification"] == "agrees"
    assert {p.name for p in Path("out/gyro").glob("*")} == {"hot_run.png", "gyro.html", "scale.html"}
    # the index: each report with its own verdict and a picture
    index = Path("out/index.html").read_text(encoding="utf-8")
    for report in Path("out").glob("*/*.html"):
        verdict = re.search(r'<p class="sentence">(.*?)</p>', report.read_text(encoding="utf-8"), re.DOTALL)
        assert f'href="{report.relative_to("out").as_posix()}"' in index
        assert verdict is not None
        assert verdict[1] in index
    assert '<p class="badge">AGREES' in index
    for picture in ("gyro/hot_run.png", "drilling/stick_slip.png", "comparison.png"):
        assert f'<img src="{picture}"' in index
        assert Path("out", picture).exists()
    rms = found["hot_run"]["rms_deg"]
    assert rms["joint, scale followed"] < 0.5 * min(rms["uncompensated"], rms["patent, closed form"])


def test_demo_shows_the_hot_run_side_by_side(capsys):
    _, found, _ = reduce_hot_run(hot_run(8))
    show_hot_run(Demo(Path("out"), hot_run=found, hot_runs_rms=rms_degrees([found])))
    said = capsys.readouterr().out
    for name, rms in rms_degrees([found]).items():
        row = next(line for line in said.splitlines() if name in line)
        assert row.count(f"{rms:.3f}") == 2  # this run, and "many" of one


def test_import_loads_nothing_heavy():
    """Nor does --help: test_help."""
    heavy = "{'scipy', 'numba', 'matplotlib', 'jsonschema'}"
    check = f"import inclinometry, sys; bad = {heavy} & set(sys.modules); sys.exit(str(bad) if bad else 0)"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


class TestDatasheet:
    def test_from_data_sheet_to_survey(self, run):
        assert run("datasheet --template -o datasheet.toml").status == 0
        done = run("datasheet datasheet.toml -o plate.json --json")
        assert done.json["tool"] == "SN 0001"
        assert "[record-exact]" in done.err
        assert run("simulate well --truth plate.json -o raw.csv --noise 0").status == 0
        assert run("survey raw.csv --calibration plate.json -o survey.csv").status == 0
        hold = rows_of("survey.csv")[-1]
        assert float(hold["inclination_deg"]) == pytest.approx(60.0, abs=0.1)  # the well wanders by some hundredths
        assert float(hold["azimuth_deg"]) == pytest.approx(75.0, abs=0.2)

    def test_it_is_not_certified(self, run):
        run("datasheet --template -o datasheet.toml")
        run("datasheet datasheet.toml -o plate.json")
        run("certificate plate.json -o certificate.pdf").refused("[certificate-datasheet]")
        assert not Path("certificate.pdf").exists()

    def test_its_bench_needs_no_converter(self, run):
        """Signals in V: nothing says how large a step is, so that none is simulated unless it is asked for."""
        run("datasheet --template -o datasheet.toml")
        bench = ("simulate", "bench", "--plan", "twelve", "--tool", "datasheet.toml", "-o")
        assert run(*bench, "readings.csv").status == 0
        assert run(*bench, "same.csv", "--bits", 0).status == 0
        assert Path("readings.csv").read_bytes() == Path("same.csv").read_bytes()
        run(*bench, "other.csv", "--bits", 16).refused("[simulate-unit]")
        assert not Path("other.csv").exists()

    @pytest.mark.long
    def test_classical_takes_it_and_says_when_it_has_none(self, run):
        run("datasheet --template -o datasheet.toml")
        bench = ("simulate", "bench", "--plan", "orthogonal", "--bits", 0, "-o", "readings.csv", "--truth", "true.json")
        assert run(*bench, "--tool", "datasheet.toml").status == 0
        for sheet in ("datasheet.toml", "true.json"):
            given = ("--method", "classical", "--data-sheet", sheet)
            assert run("calibrate readings.csv -o tool.json", *given).status == 0
        assert "note: classical: classical needs data_sheet" in run("compare -v readings.csv").err
        done = run("compare readings.csv --data-sheet datasheet.toml --truth true.json --json").json
        found = {m["method"]: m for m in done["methods"]}["classical"]
        assert found["applicable"]
        assert max(found["true_error_deg"]["azimuth"]) < 0.3  # exact conversion factors: what noise leaves
        run("calibrate readings.csv -o other.json --method classical").refused("[input-needs]")
        assert not Path("other.json").exists()
        run("calibrate readings.csv -o other.json --data-sheet datasheet.toml").refused("[input-not-with]")

    def test_what_is_not_a_sheet(self, run):
        assert run("datasheet -o tool.json").status == 2
        Path("a.toml").write_text('tool = "1"\n', encoding="utf-8")
        run("datasheet a.toml -o tool.json").refused("a.toml")
        assert not Path("tool.json").exists()


@pytest.mark.long
def test_a_bent_characteristic_is_named_everywhere(run):
    """A square law of 0.5 % of full scale, eight rolls, a perfect rig. At 0134526 nothing was said."""
    assert run("plan twelve --rolls 8 -o plan.csv").status == 0
    run("simulate bench --plan plan.csv --nonlinearity-percent 0.5 -o readings.csv").ok()
    done = run("calibrate readings.csv -o tool.json --report report.html --json")
    assert "bench-roll-square" in [one["code"] for one in done.json["findings"]]
    law = done.json["second_harmonics"]["square_law_percent"]["accelerometer"][0]
    assert law == pytest.approx(0.4, abs=0.1)  # 0.5 at full scale, 1.25 g; found to 0.03 at 1 g
    assert "[bench-roll-square]" in Path("report.html").read_text()
    assert "Harmonics of the roll sets" in Path("report.html").read_text()


class TestSensorsOfASimulation:
    def test_noise_of_each_triad(self, run):
        bench = ("simulate", "bench", "--plan", "orthogonal", "--bits", 0, "--truth", "truth.json")
        quiet = ("--accel-noise-mg", 0, "--mag-noise-nT", 0)
        for name, options in (("none", quiet), ("mag", ("--accel-noise-mg", 0, "--mag-noise-nT", 100))):
            assert run(*bench, "-o", f"{name}.csv", *options).status == 0
        none, mag = rows_of("none.csv"), rows_of("mag.csv")
        x = next(name for name in none[0] if name.startswith("accel_x"))
        assert [r[x] for r in none] == [r[x] for r in mag]
        columns = [name for name in none[0] if name.startswith("mag_")]
        off = [float(b[c]) - float(a[c]) for a, b in zip(none, mag, strict=True) for c in columns]
        assert np.std(off) == pytest.approx(100.0, rel=0.3)  # 72 values, factors within 5 %
        assert run(*bench, "-o", "bad.csv", "--mag-noise-nT=-1").status == 2
        assert not Path("bad.csv").exists()

    @pytest.mark.long
    def test_fluxgates_give_the_azimuth_of_the_paper(self, run):
        """1.5 to 2.0 deg with fluxgates, 0.2 to 0.5 with magnetoresistive sensors; one tool, so within a factor."""
        error = {}
        for name in ("fluxgate", "magnetoresistive"):
            sensors = ("--magnetometer", name)
            bench = ("simulate", "bench", "--plan", "twelve", "--rig-sd-deg", 0.2, "--truth", "truth.json")
            assert run(*bench, "-o", "readings.csv", *sensors).status == 0
            assert run("calibrate readings.csv -o tool.json").status == 0
            well = ("simulate", "well", "--truth", "truth.json", "--path", "path.csv")
            assert run(*well, "-o", "raw.csv", *sensors).status == 0
            assert run("survey raw.csv --calibration tool.json -o survey.csv").status == 0
            pairs = zip(rows_of("survey.csv")[15:], rows_of("path.csv")[15:], strict=True)
            off = [float(a["azimuth_deg"]) - float(b["azimuth_deg"]) for a, b in pairs]
            error[name] = np.sqrt(np.mean(np.square(off)))
        assert 0.8 < error["fluxgate"] < 3.0
        assert error["magnetoresistive"] < 0.5


def test_coefficients_in_every_form(run, bench):
    bench("orthogonal")
    assert run("calibrate readings.csv -o tool.json --created 2026-11-22").status == 0
    shown = run("coefficients", "tool.json").ok()
    assert "installation angle and phase" in shown.out
    for form, mark in (("json", '"inclinometry/coefficients"'), ("c", "2026-11-22"), ("csv", "installation_phase_deg")):
        assert run("coefficients tool.json --format", form, "-o", f"out.{form}").status == 0
        assert mark in Path(f"out.{form}").read_text(encoding="utf-8")
        printed = run("coefficients tool.json --format", form).out
        assert printed.strip() == Path(f"out.{form}").read_text(encoding="utf-8").strip()
    assert run("coefficients tool.json -o tool.h").status == 0  # the name says the form
    assert Path("tool.h").read_bytes() == Path("out.c").read_bytes()
    assert run("coefficients tool.json -o tool.txt").status == 2
    assert run("coefficients", "readings.csv").status == 2


@pytest.mark.long
def test_the_budget_names_its_causes(run, bench):
    bench("twelve")
    done = run("calibrate readings.csv -o tool.json --report report.html --json")
    budget = done.json["budget"]
    parts = {name: u["azimuth"] for name, u in budget["rms_u_deg"].items()}
    assert "reading: converter" in parts
    total = np.sqrt(np.sum(np.square(list(parts.values())), axis=0))
    np.testing.assert_allclose(total, budget["total_rms_u_deg"]["azimuth"], rtol=1e-9)
    # another quantity under a name of its own: the worst attitude is never better than the mean
    assert budget["inclination_deg"] == done.json["expected_u_deg"]["inclination_deg"]
    assert np.all(np.array(done.json["expected_u_deg"]["of_one_reading"]["azimuth"]) > total)
    shares = np.sum([s["azimuth"] for s in budget["share"].values()], axis=0)
    np.testing.assert_allclose(shares, 1.0, rtol=1e-9)
    assert "Where it comes from" in Path("report.html").read_text(encoding="utf-8")


def test_notes_are_for_whoever_asks(run, bench):
    """By -v on the terminal, in the report, in --json; a calibration that leaves something open prints none of it."""
    bench("twelve")
    assert "[bench-open" not in run("calibrate readings.csv -o tool.json").ok().err
    assert "[bench-open" in run("calibrate readings.csv -o tool.json -v --report r.html").ok().err
    assert "[bench-open" in Path("r.html").read_text(encoding="utf-8")
    found = run("calibrate readings.csv -o tool.json --json").ok().json["findings"]
    assert {"note"} == {one["severity"] for one in found if one["code"].startswith("bench-open")}

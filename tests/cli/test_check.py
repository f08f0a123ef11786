"""A file of another's: what is said of it, the profile drafted from it, one answer from every way of giving it."""

from __future__ import annotations

import gzip
import io
import json
import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from inclinometry.findings import example, say
from inclinometry.rotations import dcm, rotation_z

LISTING = (
    "Service company\nwell;A-1\n\nMD;INC;AZI;azimuth_reference\nft;deg;deg;\n"
    "0;0,0;0;true\n1000;10,5;20;true\n2000;20;21;true\n"
)


@pytest.fixture
def listing(run):
    Path("listing.txt").write_text(LISTING)
    return "listing.txt"


def test_what_a_listing_is_understood_to_be(run, listing):
    done = run("check", listing).ok()
    assert "separated by semicolon, 3 lines before the names, a line of units; 3 rows" in done.out
    assert "MD (ft)" in done.out and "position: accepted" in done.out  # noqa: PT018
    uses = run("check", listing, "--json").json["uses"]
    assert uses["position"] is None
    assert uses["calibrate"] == uses["verify"]


def test_from_the_draft_to_the_answer_with_one_option(run, listing):
    assert run("check", listing, "-o", "mine.toml").status == 0
    run("position", listing, "--profile", "mine.toml", "-o", "position.csv").ok()
    plain = "md_m,inclination_deg,azimuth_deg,azimuth_reference\n0,0,0,true\n304.8,10.5,20,true\n609.6,20,21,true\n"
    Path("plain.csv").write_text(plain)
    assert run("position plain.csv -o plain-position.csv").status == 0
    assert Path("position.csv").read_text() == Path("plain-position.csv").read_text()


def test_check_with_the_units_stated(run):
    Path("a.csv").write_text("MD,INC,AZI\n0,0,0\n1000,10.5,20\n")
    done = run("check a.csv --units ft,deg")
    assert re.search(r"MD +│ +md_m", done.out)
    assert "not known" not in done.out


def test_a_profile_without_a_table_is_said(run):
    done = run("list plans --units ft").ok()
    assert "[option-unused]" in done.err


def test_standard_input_and_output(run, monkeypatch):
    run("simulate bench --plan orthogonal -o readings.csv")
    assert run("calibrate readings.csv -o file.json").status == 0
    stream = io.BytesIO(Path("readings.csv").read_bytes())
    monkeypatch.setattr(sys, "stdin", types.SimpleNamespace(buffer=stream))
    assert run("calibrate - -o stdin.json").status == 0
    one, two = (json.loads(Path(name).read_text()) for name in ("file.json", "stdin.json"))
    assert one["triads"] == two["triads"]
    assert run("check - -").status == 2


def test_a_hyphen_is_standard_input_only_for_a_file(run, monkeypatch):
    monkeypatch.setattr(sys, "stdin", types.SimpleNamespace(buffer=io.BytesIO(b"")))
    Path("readings.csv").write_text("")
    command = ["ledger", "enter", "readings.csv", "--serial", "IN-7", "--performed", "2026-05-04", "--rig", "stand"]
    for nothing in ("-", "n/a", "."):
        run(*command, "--supersedes", "2026-0001", "--reason", nothing).refused("--supersedes needs --reason")


def test_readings_of_every_kind_give_one_calibration(run):
    run("simulate bench --plan orthogonal -o readings.csv")
    text = Path("readings.csv").read_text()
    Path("packed.csv.gz").write_bytes(gzip.compress(text.encode()))
    rows = [line.split(",") for line in text.splitlines()]
    columns = {name: [row[k] for row in rows[1:]] for k, name in enumerate(rows[0])}
    numbers = {n: list(map(float, v)) if n not in ("station", "roll_set") else v for n, v in columns.items()}
    Path("readings.json").write_text(json.dumps(numbers))
    Path("blank.txt").write_text("a logger\n" + text.replace(",", " "))
    assert run("check blank.txt -o blank.toml").status == 0
    found = []
    for name in ("readings.csv", "packed.csv.gz", "readings.json", "blank.txt"):
        more = ("--profile", "blank.toml") if name == "blank.txt" else ()
        assert run("calibrate", name, *more, "-o", "tool.json").status == 0
        found.append(json.loads(Path("tool.json").read_text())["triads"])
    assert all(triads == found[0] for triads in found)


def test_units_that_would_fit_a_triad(run):
    rng = np.random.default_rng(1)
    down = rng.normal(size=(20, 3))
    down /= np.linalg.norm(down, axis=1)[:, None]
    rows = [",".join(f"{v:.5f}" for v in (*g, *(48.0 * g))) for g in down]
    Path("imu.csv").write_text("Ax,Ay,Az,Mx,My,Mz\n" + "\n".join(rows) + "\n")
    done = run("check", "imu.csv")
    assert "as in g (gravity" in done.err
    assert "as in uT (|b| 48000 nT)" in done.err
    assert ": accepted\n" not in done.out  # no unit is guessed


def test_a_stated_unit_is_not_called_raw_counts(run):
    """Thrice gravity: a triad that moves, in the unit it states."""
    rows = [f"{29.4 * x:.4f},{29.4 * y:.4f},{29.4 * z:.4f}" for x, y, z in np.eye(3)]
    for names in ("Ax (m/s2),Ay (m/s2),Az (m/s2)", "accel_x_m_s2,accel_y_m_s2,accel_z_m_s2"):
        Path("imu.csv").write_text("\n".join([names, *rows]) + "\n")
        assert "counts or volts" not in run("check", "imu.csv").err
    Path("imu.csv").write_text("\n".join(["accel_x,accel_y,accel_z", *rows]) + "\n")
    assert "as in counts or volts" in run("check", "imu.csv").err
    # without a name that is known the unit alone is missed
    Path("imu.csv").write_text("\n".join(["Ax,Ay,Az", *rows]) + "\n")
    done = run("check", "imu.csv")
    assert ("Unit missing: Ax." in done.out, done.err) == (True, "")


def told(run, name):
    """What `check` says of each command."""
    return run("check", name, "--json").json["uses"]


def agrees(run, uses, command, *arguments):
    """Whether a command refuses a file as `check` does, or takes it where that says so."""
    done = run(*arguments)
    lacking = uses[command]
    return done.status == 0 if lacking is None else done.status == 2 and f"[{lacking['code']}]" in done.err


def test_check_says_what_each_command_does_with_a_gyro_run(run):
    Path("site.toml").write_text("latitude_deg = 60\ng = 9.81\n")
    assert run("simulate gyro -o gyro.csv --site site.toml").status == 0
    uses = told(run, "gyro.csv")
    assert [name for name, lacking in uses.items() if lacking is None] == ["readings", "gyro north"]
    site = ("--site", "site.toml", "-o", "out.csv")
    for command, arguments in {
        "calibrate": ("calibrate", "gyro.csv"),
        "calibrate --method norm": ("calibrate", "gyro.csv", "--method", "norm"),
        "calibrate --method hand-rotations": ("calibrate", "gyro.csv", "--method", "hand-rotations"),
        "gyro north": ("gyro", "north", "gyro.csv", *site),
        "dynamic": ("dynamic", "gyro.csv", *site),
        "allan": ("allan", "gyro.csv", "-o", "noise.json"),
        "readings": ("readings", "gyro.csv", "-o", "readings.csv"),
    }.items():
        assert agrees(run, uses, command, *arguments), command


def test_check_says_what_each_command_does_with_a_log_and_with_its_readings(run):
    """The log has no angles of a rig, its readings have, and three of them do not make a calibration."""
    run("simulate log --plan orthogonal -o log.csv")
    uses = told(run, "log.csv")
    assert uses["calibrate --method hand-rotations"]["code"] == "input-one-of"
    for command, *arguments in (
        ("calibrate", "calibrate", "log.csv"),
        ("calibrate --method norm", "calibrate", "log.csv", "--method", "norm"),
        ("calibrate --method hand-rotations", "calibrate", "log.csv", "--method", "hand-rotations"),
        ("allan", "allan", "log.csv", "-o", "noise.json"),
    ):
        assert agrees(run, uses, command, *arguments), command
    run("simulate bench --plan orthogonal -o bench.csv")
    assert (told(run, "bench.csv")["calibrate"], told(run, "bench.csv")["verify"]) == (None, None)
    Path("few.csv").write_text("\n".join(Path("bench.csv").read_text().splitlines()[:4]) + "\n")
    few = told(run, "few.csv")
    assert few["calibrate"] is not None
    assert agrees(run, few, "calibrate", "calibrate", "few.csv")


@pytest.mark.parametrize(
    ("what", "some"),
    [
        ("plans", "twelve"), ("limits", "rogatykh-2018-fluxgate"), ("tool-codes", "iscwsa-mwd-rev5.1"),
        ("profiles", "sap6"), ("formats", "witsml"), ("columns", "azimuth_deg"), ("conventions", "iscwsa"),
        ("findings", "run-depth-digit"),
    ],
)  # fmt: skip
def test_lists_of_names(run, what, some):
    assert some in run("list", what).out


def test_a_code_is_explained(run):
    done = run("explain", "run-depth-digit")
    assert done.out.startswith("run-depth-digit: ")
    assert "Found: " in done.out
    assert "--ignore run-depth-digit or --ignore depths" in done.out
    entry = run("explain run-depth-digit --json").json
    assert (entry["code"], entry["group"]) == ("run-depth-digit", "depths")
    assert set(entry["example"]) == {"course_m", "md_m", "expected_m"}
    found = example("run-depth-digit")
    for language in ("ru", "zh"):
        assert say(found, language) in run("explain run-depth-digit --language", language).out
    done = run("explain run-channel --json")  # a part of other sentences
    assert done.json["means"] is None
    assert run("explain", "[RUN-depth-digit]").out == run("explain", "run-depth-digit").out
    assert "Values" not in run("explain", "fit-rolls-alone").out  # has none
    run("explain", "../run-depths").refused("[input-code-unknown]")


def test_no_file_no_table(run):
    assert "[file-absent]" in run("check", "nothing.csv").err
    Path("empty.csv").write_text("")
    run("check", "empty.csv").refused("[file-empty]")
    Path("blank.csv").write_text("\n\n# nothing\n")
    assert run("check", "blank.csv").status == 2
    Path("prose.txt").write_text("Dear colleague\nhere are the data\nas promised.\n")
    assert ": accepted\n" not in run("check", "prose.txt").out


def test_looking_without_writing(run):
    run("simulate bench --plan orthogonal -o readings.csv")
    before = set(Path().iterdir())
    assert "nothing was written; -o names a file" in run("calibrate", "readings.csv").out
    assert "output" not in run("calibrate readings.csv --json").json
    assert set(Path().iterdir()) == before
    Path("a.csv").write_text("MD,INC,AZI\n0,0,0\n1000,10.5,20\n")
    done = run("position a.csv --units ft,deg --azimuth-reference true")
    assert "304.80" in done.out
    assert "nothing was written" in done.out
    Path("b.csv").write_text("MD,INC,AZI,azimuth_reference\n0,0,0,grid\n1000,10.5,20,grid\n")
    run("position b.csv --units ft,deg --azimuth-reference true").refused("[table-north-differs]")
    assert (
        run("position b.csv --units ft,deg --azimuth-reference grid").ok().out
        == run("position b.csv --units ft,deg").out
    )


@pytest.mark.long
def test_quiet_and_open(run, monkeypatch):
    run("simulate bench --plan orthogonal -o readings.csv")
    done = run("calibrate readings.csv -o tool.json -q")
    assert (done.status, done.out) == (0, "")
    assert Path("tool.json").exists()
    assert run("list", "plans").out  # no longer quiet
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert run("calibrate readings.csv --report report.html --open").status == 0
    assert opened == [Path("report.html").resolve().as_uri()]
    assert "[input-needs]" in run("calibrate readings.csv --open").err


def test_completion_of_the_shell(run, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", "/bin/bash")
    run("--install-completion").ok()
    script = next(tmp_path.rglob("completions/inclinometry"))
    assert "displacement" in script.read_text()


def test_messages_on_standard_input_name_no_temporary_file(run, monkeypatch):
    for command in ("check", "position"):
        stream = io.BytesIO(b"MD,INC,AZI\n0,0,0\n100,1,2\n")
        monkeypatch.setattr(sys, "stdin", types.SimpleNamespace(buffer=stream))
        done = run(command, "-")
        assert "standard input" in done.out + done.err
        assert "tmp" not in done.out + done.err


def _log(name: str, turn: np.ndarray, sign: float, exchange: bool = False) -> None:
    """Eight rests in different attitudes with slow turns about z between them, in another's axes."""
    rng = np.random.default_rng(4)
    rows, time = [], 0.0
    for k in range(8):
        c = dcm(0.7 * k, 0.3 + 0.15 * k, 0.9 * k)
        for turning in (False, True):
            for step in range(60):
                here = rotation_z(0.05 * step) @ c if turning else c
                g, b = here @ [0.0, 0.0, 1.0], here @ [20.0, 0.0, 45.0]
                w = np.array([0.0, 0.0, 286.0 if turning else 0.0])
                cells = [turn @ (sign * g), turn @ (b[[1, 0, 2]] if exchange else b), turn @ w]
                rows.append([time, *np.concatenate(cells) + rng.normal(0.0, 1e-3, 9)])
                time += 0.05
    names = ["time_s", *(f"{kind}_{axis}_{unit}" for kind, unit in (("accel", "g"), ("mag", "uT"), ("gyro", "deg_s"))
                         for axis in "xyz")]  # fmt: skip
    text = "\n".join(",".join(f"{v:.6f}" for v in row) for row in rows)
    Path(name).write_text(",".join(names) + "\n" + text + "\n")


def test_rests_turning_axis_and_how_each_convention_fits(run):
    _log("native.csv", np.eye(3), 1.0)
    _log("up.csv", np.diag([1.0, -1.0, -1.0]), -1.0)
    dip = np.degrees(np.arctan2(45.0, 20.0))
    for name, right, wrong in (("native.csv", "native", "z-up"), ("up.csv", "z-up", "native")):
        done = run("check", name, "--json")
        found = {c["convention"]: c for c in done.json["conventions"]}
        assert found[right]["dip_deg"] == pytest.approx(dip, abs=0.1)
        assert found[right]["scatter_deg"] < 0.1
        assert found[right]["share_down"] == 1.0
        assert found[wrong]["dip_deg"] == pytest.approx(-dip, abs=0.1)
        notes = {one["code"]: one["values"] for one in done.json["findings"]}
        assert notes["check-rests"]["rests"] == 8
        assert notes["check-turning"]["axis"] == "z"
    _log("exchanged.csv", np.eye(3), 1.0, exchange=True)
    done = run("check", "exchanged.csv")
    assert "[sensor-mapping]" in done.err
    assert "how each convention of axes fits" in done.out


def test_dials_that_count_otherwise_are_said(run):
    run("simulate bench --plan twelve --seed 1 -o readings.csv")
    assert "[check-dials]" in run("check", "readings.csv").err
    lines = [line.split(",") for line in Path("readings.csv").read_text().splitlines()]
    at = lines[0].index("toolface_deg")
    for line in lines[1:]:
        line[at] = str(-float(line[at]) % 360.0)
    Path("reversed.csv").write_text("\n".join(map(",".join, lines)) + "\n")
    assert "toolface counterclockwise" in run("check", "reversed.csv").err


def test_columns_of_casings_and_drill_holes_are_known(run):
    rows = "".join(f"{0.5 * k},{100 + k},{-100 - k},{20 + k},{-20 - k}\n" for k in range(1, 12))
    Path("casing.csv").write_text("depth_m,A0 (sin),A180 (sin),B0 (sin),B180 (sin)\n" + rows.replace("1", "0.001"))
    Path("probe.csv").write_text("depth_m,a0_digi-25000,a180_digi-25000,b0_digi-25000,b180_digi-25000\n" + rows)
    assert "axis A, run 180" in run("check", "probe.csv").out
    Path("holes.csv").write_text("BHID,Depth (m),Dip (deg),Azimuth (deg)\nA,0,-60,10\nA,30,-59,11\n")
    done = run("check", "holes.csv")
    assert re.search(r"Dip \(deg\) +│ +dip", done.out)
    assert "not known" not in done.out


def test_of_a_long_file_every_row_is_counted(run):
    rows = "".join(f"{k / 100},0,0,{1 + (k % 7) * 1e-4}\n" for k in range(30_000))
    Path("long.csv").write_text("time_s,accel_x_g,accel_y_g,accel_z_g\n" + rows)
    done = run("check", "long.csv")
    assert "30,000 rows" in done.out
    assert "[check-rests]" in done.err


def test_verbose_says_what_was_understood_and_how_long_it_took(run):
    Path("a.csv").write_text("MD,INC,AZI,azimuth_reference\n0,0,0,true\n1000,10.5,20,true\n")
    done = run("position a.csv --units ft,deg -v").ok()
    assert "a.csv: 2 rows; 'MD' as md_m, 'INC' as inclination_deg, 'AZI' as azimuth_deg" in done.err
    assert re.search(r"altogether \d+\.\d\d s", done.err)
    assert run("position a.csv --units ft,deg").err == ""


@pytest.mark.parametrize(
    "text",
    [
        "Survey\n\nMD(ft)  Inc(deg)  Azi(deg)\n------  --------  --------\n0  0  0\n1000  10  90\n2,000.0  20  90\n",
        "Глубина, м;Зенитный угол, град;Азимут, град\n0;0,0;0\n304,8;10,0;90\n609,6;20;90\n",
        "井深（ft）,井斜（°）,方位（°）\n0,0,0\n1000,10,90\n2000,20,90\n",
        "Teufe [ft];Inc [°];Azimut [°]\n0,0;0,0;0,0\n1000,0;10,0;90,0\n2000,0;20,0;90,0\n",
    ],
)
def test_listings_of_other_countries_and_programs(run, text):
    Path("listing.txt").write_text(text, encoding="utf-8")
    done = run("position listing.txt --azimuth-reference true -o position.csv").ok()
    assert "303.25" in done.out and "105.32" in done.out  # noqa: PT018


@pytest.mark.parametrize(("names", "unit"), [("Acceleration {}", "m/s2"), ("Accelerometer {}", "g"), ("a{}", "mg")])
def test_the_unit_of_the_names_fits_what_was_read(run, names, unit):
    size = {"m/s2": 9.81, "g": 1.0, "mg": 1000.0}[unit]
    header = ",".join(["time_s", *(names.format(axis) for axis in "xyz")])
    Path("log.csv").write_text(header + "\n" + "".join(f"{k},0,0.001,{size}\n" for k in range(20)))
    assert f"as in {unit} (gravity" in run("check", "log.csv").err
    stated = ",".join(["time_s", *(f"{names.format(axis)} ({unit})" for axis in "xyz")])
    Path("log.csv").write_text(f"{stated}\n1,0,0,1\n2,0,0,1\n")
    assert "counts or volts" not in run("check", "log.csv").err


def test_an_error_of_check_names_the_file_that_was_given(run):
    import openpyxl

    book = openpyxl.Workbook()
    book.active["A1"] = "md_m"
    book.save("empty.xlsx")
    done = run("check", "empty.xlsx")
    assert done.status == 2
    assert done.err.startswith("inclinometry: empty.xlsx, line 1: ")


def test_units_are_stated_for_the_log_and_its_plan(run):
    Path("plan.csv").write_text("azimuth,inclination,toolface\n0,90,0\n0,90,90\n90,90,180\n90,0,270\n")
    assert run("simulate log --plan plan.csv --units deg --seed 1 -o log.csv").status == 0
    run("readings log.csv --plan plan.csv --units deg -o readings.csv").ok()
    assert "toolface_deg" in Path("readings.csv").read_text()

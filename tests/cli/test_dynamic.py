"""dynamic and simulate drilling at the command line."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from inclinometry.files.attitude_file import COLUMNS

from .tables import rows_of

MAGNETIC = ("dynamic", "run.parquet", "--site", "site.toml", "--method", "magnetic")


@pytest.fixture
def simulated(run):
    """run.parquet, truth.parquet and site.toml of 30 s of stick-slip in the folder."""
    files = "-o run.parquet --truth truth.parquet --site site.toml"
    return run(f"simulate drilling --scenario stick-slip --seed 1 --duration-s 30 {files}").ok()


def test_simulate_says_what_it_wrote(simulated, run):
    assert "6000 samples written to run.parquet, truth to truth.parquet" in simulated.out
    done = run("simulate drilling --scenario smooth --duration-s 2 -o a.csv --json")
    assert done.json["samples"] == 400
    with Path("a.csv").open() as stream:
        assert next(csv.reader(stream))[:4] == ["time_s", "accel_x", "accel_y", "accel_z"]
    run("simulate drilling --scenario smooth --duration-s 2 -o b.csv --json").ok()
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_dynamic_writes_a_row_a_window(simulated, run):
    done = run("dynamic run.parquet --site site.toml --method magnetic -o a.csv --report d.html").ok()
    assert "3 windows written to a.csv, report to d.html" in done.out
    rows = rows_of("a.csv")
    assert tuple(rows[0]) == COLUMNS
    assert [float(row["time_s"]) for row in rows] == pytest.approx([5.0, 15.0, 25.0], abs=0.01)
    for row in rows:
        # published 0.5/1.35 deg for such windows
        assert float(row["inclination_deg"]) == pytest.approx(30.0, abs=0.3)
        assert float(row["azimuth_deg"]) == pytest.approx(60.0, abs=0.6)
        assert float(row["rpm"]) == pytest.approx(200.0, abs=1.0)
        assert row["azimuth_reference"] == "magnetic"
        assert 0.0 < float(row["u_azimuth_deg"]) < 1.0
    truth = pq.read_table("truth.parquet")
    at = np.interp(
        [float(row["time_s"]) for row in rows], truth["time_s"], np.unwrap(np.radians(truth["toolface_deg"]))
    )
    off = np.degrees(at) - [float(row["toolface_deg"]) for row in rows]
    assert np.abs((off + 180.0) % 360.0 - 180.0).max() < 5.0
    assert Path("d.html").read_text(encoding="utf-8").startswith("<!doctype html>")


def test_dynamic_for_machines(simulated, run):
    done = run("dynamic run.parquet --site site.toml --method filter -o a.parquet --json").ok()
    assert done.json["samples"] == 6000
    assert done.json["windows"] == 3
    assert done.json["methods"] == {"filter": 3}
    header = json.loads(pq.read_schema("a.parquet").metadata[b"inclinometry.header"])
    assert header["input run"] == done.json["inputs"]["run"]
    assert header["input site"].startswith("sha256:")
    assert header["method"] == "filter"


def test_windows_of_another_length(simulated, run):
    done = run("dynamic run.parquet --site site.toml --method magnetic --window-s 5 -o a.csv --json")
    assert done.json["windows"] == 6


def test_the_default_looks_at_the_data_and_says_what_it_took(simulated, run):
    done = run("dynamic run.parquet --site site.toml -o a.csv").ok()
    assert done.err == ""  # nothing to act upon
    done = run("dynamic run.parquet --site site.toml -o a.csv --json")
    assert {one["severity"] for one in done.json["findings"]} == {"note"}
    (windows,) = [one["values"] for one in done.json["findings"] if one["code"] == "motion-windows"]
    assert (windows["total"], windows["kinds"][0]["values"]["kind"]) == (3, "rotating")


def test_an_accelerometer_that_reports_specific_force_is_refused(simulated, run):
    table = pq.read_table("run.parquet")
    for axis in "xyz":
        place = table.column_names.index(f"accel_{axis}")
        table = table.set_column(place, f"accel_{axis}", pc.negate(table.column(place)))
    pq.write_table(table, "force.parquet")
    done = run("dynamic force.parquet --site site.toml -o a.csv")
    assert done.status == 2
    assert "force.parquet: " in done.err
    assert "specific-force" in done.err
    assert not Path("a.csv").exists()


def test_a_run_without_a_field_is_refused_window_by_window(simulated, run):
    """Accelerometers alone: rows with reasons, exit status 0, and a report that says so."""
    table = pq.read_table("run.parquet").select(["time_s", "accel_x", "accel_y", "accel_z"])
    pq.write_table(table, "bare.parquet")
    done = run("dynamic bare.parquet --site site.toml -o a.csv --report d.html").ok()
    assert "3 windows refused: no-field 3" in done.out
    rows = rows_of("a.csv")
    assert all(row["inclination_deg"] == row["azimuth_deg"] == "" and "no-field" in row["flags"] for row in rows)
    assert "no-field" in Path("d.html").read_text(encoding="utf-8")


def restated(dip: float) -> None:
    """site.toml with another dip than the field's 65 deg."""
    text = Path("site.toml").read_text()
    assert "dip_deg = 65\n" in text
    Path("site.toml").write_text(text.replace("dip_deg = 65\n", f"dip_deg = {dip:g}\n"))


@pytest.mark.parametrize("method", ["auto", "magnetic", "filter"])
def test_a_site_with_another_dip_is_refused_where_it_leaves_nothing(run, method):
    """Whole turns: every window shows 65 deg of dip beside 75 deg stated; blank angles at exit 0 would be no answer."""
    done = run("simulate drilling --scenario smooth --seed 1 --duration-s 40 -o run.csv --site site.toml").ok()
    restated(75.0)
    done = run("dynamic run.csv --site site.toml --method", method, "-o", "a.csv", "--report", "d.html")
    assert done.status == 2
    assert "run.csv: Dip is 65" in done.err
    assert not Path("a.csv").exists()
    assert not Path("d.html").exists()


def test_a_site_with_another_dip_is_named_where_angles_are_left(simulated, run):
    """Stick-slip: toolface by the gyro goes on; both dips are named."""
    restated(55.0)
    done = run("dynamic run.parquet --site site.toml -o a.csv --json").ok()
    # 30 s of shaking leave some tenths of a degree on the mean
    (off,) = [one["values"] for one in done.json["findings"] if one["code"] == "motion-dip-axes"]
    assert off["site_deg"] == pytest.approx(55.0)
    assert off["dip_deg"] == pytest.approx(65.0, abs=0.6)


REFUSED = {
    ("--method", "guess"): "--method: guess",
    ("--window-s", "0.01"): "[input-value]",
    ("-o", "run.parquet"): "is the same file as the run",
    ("-o", "site.toml"): "is the same file as --site",
    ("-o", "a.txt"): "[file-ending]",
    ("-o", "none/a.csv"): "[file-folder-absent]",
    ("--report", "a.csv"): "is the same file as --output",
    ("--calibration", "site.toml"): "site.toml",
    ("--site", "none.toml"): "[file-absent]",
}


@pytest.mark.parametrize("options", REFUSED, ids=" ".join)
def test_dynamic_refuses_and_writes_nothing(simulated, run, options):
    before = {path.name: path.read_bytes() for path in Path().iterdir()}
    words = {"--site": "site.toml", "-o": "a.csv", "--method": "magnetic", **dict([options])}
    done = run("dynamic", "run.parquet", *(word for pair in words.items() for word in pair))
    assert done.status == 2
    assert REFUSED[options] in done.err
    assert {path.name: path.read_bytes() for path in Path().iterdir()} == before


def test_a_bad_line_is_named_and_nothing_written(simulated, run):
    lines = ["time_s,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z"]
    lines += [f"{0.01 * k:.2f},0,{'x' if k == 700 else 0},9.8,20000,0,45000" for k in range(900)]
    Path("run.csv").write_text("\n".join(lines))
    done = run("dynamic run.csv --site site.toml --method magnetic -o a.csv")
    assert done.status == 2
    assert "run.csv, line 702: " in done.err
    assert "[input-kind]" in done.err
    assert not Path("a.csv").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--scenario", "moon"), "--scenario: moon; allowed: smooth"),
        (("--duration-s", 0), "duration_s is 0; allowed: > 0"),
        (("--inclination-deg", 200), "--inclination-deg is 200; allowed: 0 .. 180"),
        (("--truth", "run.parquet"), "is the same file as --output"),
    ],
)
def test_simulate_refuses(run, options, message):
    done = run("simulate drilling -o run.parquet", *options)
    assert done.status == 2
    assert message in done.err
    assert not list(Path().iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ")
def test_an_interruption_leaves_nothing(tmp_path):
    """Simulating a day is stopped while the file grows."""
    command = [
        sys.executable,
        "-m",
        "inclinometry",
        "simulate",
        "drilling",
        "--duration-s",
        "86400",
        "-o",
        "run.parquet",
    ]
    child = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    for _ in range(2400):
        if list(tmp_path.iterdir()):
            break
        time.sleep(0.05)
    time.sleep(0.3)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=120)
    # a shell says 130 for both: Python ends by the signal itself where it came inside a generated piece of code
    assert child.returncode in (130, -signal.SIGINT)
    assert "[option-interrupted]" in err
    assert not list(tmp_path.iterdir())


def test_an_interruption_is_not_lost_while_an_object_is_thrown_away():
    """Python only prints what a weak reference's callback raises; without our hook the command would go on."""
    program = """
import sys, time, weakref
from inclinometry import cli
sys.unraisablehook = cli._interrupted_again
def callback(_): raise KeyboardInterrupt
thrown = type("Object", (), {})()
reference = weakref.ref(thrown, callback)
try:
    del thrown
    time.sleep(20)
except KeyboardInterrupt:
    print("heard")
"""
    told = subprocess.check_output([sys.executable, "-c", program], text=True)
    assert told == "heard\n"

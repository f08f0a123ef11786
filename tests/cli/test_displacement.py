"""displacement as a user runs it: what moved, how sure, and each file that cannot be taken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from .tables import rows_of

DEPTH = 0.5 * np.arange(40)
TILT = np.stack([0.02 + 0.01 * np.sin(DEPTH / 5.0), 0.015 * np.cos(DEPTH / 7.0)])
SHEAR = np.where((DEPTH >= 8.0) & (DEPTH < 9.0), 0.01, 0.0)


def write(name, extra=0.0, seed=1, unit="digi-25000", header="Depth (m),A0,A180,B0,B180", depth=DEPTH, bias=0.001):
    tilt = TILT + [[1.0], [0.0]] * np.broadcast_to(extra, DEPTH.shape)
    runs = np.stack([tilt[0], -tilt[0], tilt[1], -tilt[1]], axis=1) + bias
    runs = runs + 1e-5 * np.random.default_rng(seed).normal(size=runs.shape)
    values = {"digi-25000": 25000.0, "mm": 500.0}[unit] * runs
    width = header.count(",")
    rows = [",".join(f"{v:.10g}" for v in row[: width + 1]) for row in np.column_stack([depth, values])]
    Path(name).write_text("\n".join([header, *rows]) + "\n")


@pytest.fixture
def two(run):
    write("base.csv")
    write("later.csv", SHEAR, 2)


def displace(run, *more, unit="digi-25000"):
    return run("displacement base.csv later.csv", *(("--unit", unit) if unit else ()), *more)


def codes(done):
    return [one["code"] for one in done.json["findings"]]


def test_table_csv_json_and_report(run, two):
    done = displace(run, "-o", "found.csv", "--report", "found.html").ok()
    assert "displacement since the base reading" in done.out
    rows = rows_of("found.csv")
    assert len(rows) == 41
    # two steps of 0.5 m by 0.01: 10 mm; eight standard uncertainties of 0.03 mm
    assert float(rows[0]["a_mm"]) == pytest.approx(10.0, abs=0.25)
    assert float(rows[0]["b_mm"]) == pytest.approx(0.0, abs=0.25)
    assert rows[-1]["a_mm"] == rows[-1]["u_a_mm"] == "0"
    assert rows[-1]["check_sum_a_mm"] == ""
    # twice a bias of 0.001 over 500 mm
    assert float(rows[0]["check_sum_a_mm"]) == pytest.approx(1.0, abs=0.05)
    page = Path("found.html").read_text()
    assert page.count("<svg") == 4
    assert "http" not in page.replace("http://www.w3.org", "")
    found = displace(run, "--json").json["readings"]["later"]["axes"]["a"]
    assert found["displacement_mm"][0] == pytest.approx(float(rows[0]["a_mm"]), abs=1e-5)
    assert found["components_u_mm"]["random"] == found["u_mm"]


def test_one_file_of_all_dates(run):
    write("base.csv")
    write("later.csv", SHEAR, 2)
    head, *base = Path("base.csv").read_text().splitlines()
    later = Path("later.csv").read_text().splitlines()[1:]
    rows = [f"2026-05-0{day},{row}" for day, of in ((1, base), (2, later)) for row in of]
    Path("all.csv").write_text("\n".join([f"Date,{head}", *rows]))
    one = displace(run, "--json").json["readings"]["later"]["axes"]
    found = run("displacement all.csv --unit digi-25000 --json").ok().json["readings"]
    assert (list(found), found["2026-05-02"]["axes"]) == (["2026-05-02"], one)
    run("displacement base.csv --unit digi-25000").refused("input-few", "readings")


def test_an_in_place_string_of_a_campbell_logger(run):
    """Six sensors of 2 m; the third tilts by 0.1 deg: 3.49 mm above it."""
    names = ["TIMESTAMP", "RECORD", "BattV_Min", *(f"Tilt_{axis}({k})" for axis in "AB" for k in range(1, 7))]
    units, of = ["TS", "RN", "Volts", *["Deg"] * 12], ["", "", "Min", *["Smp"] * 12]
    rows = [['"TOA5"', "BH-1", "CR1000", "1031", "CR1000.Std.32", "CPU:ipi.CR1", "4062", "Hourly"], names, units, of]
    for day in range(1, 15):
        tilt = [0.1 * k + 0.1 * (k == 2 and day > 7) for k in range(6)]
        rows.append([f'"2026-05-{day:02d} 12:00:00"', day, 12.6, *tilt, *[0.2] * 6])
    Path("ipi.dat").write_text("\n".join(",".join(map(str, row)) for row in rows) + "\n")
    done = run("displacement ipi.dat --sensor-depths-m 0 2 4 6 8 10 --step-sd-mm 0.05 --json").ok()
    readings, moved = done.json["readings"], 2000.0 * (np.sin(np.radians(0.3)) - np.sin(np.radians(0.2)))
    assert (len(readings), [one["severity"] for one in done.json["findings"]]) == (13, ["note", "note"])
    axes = readings["2026-05-14 12:00:00"]["axes"]
    np.testing.assert_allclose(axes["a"]["displacement_mm"], [moved] * 3 + [0.0] * 4, atol=1e-9)
    before = readings["2026-05-07 12:00:00"]["axes"]["a"]
    assert not any([*axes["b"]["displacement_mm"], *before["displacement_mm"]])
    run("displacement ipi.dat --sensor-depths-m 0 2 4 6 8").refused("file-column")
    assert "10 of 13" in run("displacement ipi.dat --sensor-depths-m 0 2 4 6 8 10 --step-sd-mm 0.05").ok().out
    times = [one for one in run("check ipi.dat --json").json["findings"] if one["code"] == "check-time"]
    assert [one["values"] for one in times] == [{"columns": ["TIMESTAMP"]}]


def test_names_units_and_layouts_of_others(run, two):
    one = displace(run, "--json").json["readings"]
    for name in ("base.csv", "later.csv"):
        text = Path(name).read_text().replace("Depth (m),A0,A180,B0,B180", "Depth,A+,A-,B+,B-")
        # as a spreadsheet of another country writes it
        Path(name).write_text(text.replace(",", ";").replace(".", ","))
    done = displace(run, "--profile", "inclinometer-digi-25000", "--json", unit=None).ok()
    assert done.json["readings"] == one
    assert displace(run, "--units", "m", "--json").json["readings"] == one
    write("base.csv", unit="mm", header="depth_ft,a0_mm,a180_mm", depth=DEPTH / 0.3048)
    write("later.csv", SHEAR, 2, "mm", "depth_ft,a0_mm,a180_mm", DEPTH / 0.3048)
    done = displace(run, "--json", unit=None)
    assert list(done.json["readings"]["later"]["axes"]) == ["a"]
    assert done.json["readings"]["later"]["axes"]["a"]["displacement_mm"][0] == pytest.approx(10.0, abs=0.25)


def test_rows_from_the_bottom_up(run, two):
    one = displace(run, "--json").json["readings"]
    header, *rows = Path("later.csv").read_text().splitlines()
    Path("later.csv").write_text("\n".join([header, *rows[::-1]]) + "\n")
    assert displace(run, "--json").json["readings"] == one


def test_stated_parts_widen_the_band(run, two):
    plain = displace(run, "--json").json["readings"]["later"]["axes"]["a"]
    more = ("--bias-shift-mm", "0.11", "--sensitivity-percent", "0.1", "--depth-sd-mm", "5", "--rotation-deg", "0.2")
    done = displace(run, *more, "--step-sd-mm", "0.16", "--json")
    found = done.json["readings"]["later"]["axes"]["a"]
    assert found["displacement_mm"] == plain["displacement_mm"]
    parts = found["components_u_mm"]
    assert list(parts) == ["random", "bias shift", "sensitivity", "depth", "rotation"]
    assert found["u_mm"][0] == pytest.approx(np.sqrt(sum(part[0] ** 2 for part in parts.values())))
    assert parts["bias shift"][0] == pytest.approx(4.4)
    assert codes(done) == ["holes-fixed-end"]
    assert codes(displace(run, "--json")) == ["holes-fixed-end", "holes-errors-unstated"]


def test_a_single_run_is_taken_and_says_what_it_lacks(run):
    write("base.csv", header="depth_m,A0")
    write("later.csv", SHEAR, 2, header="depth_m,A0")
    done = displace(run).ok()
    assert done.err.count("[holes-unknown]") == 3
    assert "not judged" in done.out
    assert "not known" in done.out
    assert "nan" not in done.out
    assert displace(run, "--json").json["readings"]["later"]["axes"]["a"]["u_mm"][0] is None
    done = displace(run, "--step-sd-mm", "0.1", "--report", "found.html").ok()
    assert "not known" not in done.out


def test_a_spike_and_a_changed_bias_are_named(run, two):
    write("later.csv", SHEAR, 2, bias=np.array([0.002, 0.001, 0.001, 0.001]))
    lines = Path("later.csv").read_text().splitlines()
    cells = lines[11].split(",")
    lines[11] = ",".join([*cells[:2], str(float(cells[2]) + 300.0), *cells[3:]])
    Path("later.csv").write_text("\n".join(lines) + "\n")
    done = displace(run, "-o", "found.csv").ok()
    assert "[holes-bias-shift]" in done.err
    right = displace(run, "--correct", "bias", "rotation", "--json").json
    assert "correction" in right["readings"]["later"]["axes"]["a"]["components_u_mm"]
    # half of the spike of 300 digits is left
    assert right["readings"]["later"]["axes"]["a"]["displacement_mm"][0] == pytest.approx(7.0, abs=0.3)
    (spike,) = [one for one in displace(run, "--json").json["findings"] if one["code"] == "holes-spikes"]
    assert (spike["rows"], spike["values"]["md_m"], spike["values"]["axis"]) == ([11], [5.0], "A")
    assert "spike_a" in Path("found.csv").read_text()


@pytest.mark.parametrize(
    ("row", "column", "value", "words"),
    [
        (5, 0, "2.2", "[holes-depth-step]"),
        (7, 2, "", "later.csv, line 8: Column A180 is empty"),
        (7, 1, "30000", "[input-value]"),
    ],
)
def test_a_file_that_cannot_be_taken_is_named_with_its_line(run, two, row, column, value, words):
    """What else the reader refuses: tests/files/test_casing_csv.py."""
    lines = Path("later.csv").read_text().splitlines()
    cells = lines[row].split(",")
    cells[column] = value
    lines[row] = ",".join(cells)
    Path("later.csv").write_text("\n".join(lines) + "\n")
    displace(run, "-o", "found.csv").refused(words)
    assert not Path("found.csv").exists()


def test_readings_that_do_not_belong_together(run, two):
    displace(run, unit=None).refused("--unit digi-25000", "[readings-unit-unstated]")
    assert "allowed: " in run("displacement base.csv later.csv --unit degrees").err
    same = run("displacement base.csv base.csv --unit sin")
    assert same.status == 2
    write("later.csv", SHEAR, 2, depth=DEPTH + 0.25)
    displace(run).refused("later.csv, line 2: ", "[holes-depths-differ]")
    write("later.csv", SHEAR, 2)
    Path("later.csv").write_text("\n".join(Path("later.csv").read_text().splitlines()[:30]))
    assert "[holes-depths-common]" in displace(run, "--report", "short.html").ok().err
    write("later.csv", SHEAR, 2, header="depth_m,A0,A180")
    assert "[holes-axes-differ]" in displace(run).err
    write("later.csv", SHEAR, 2, header="depth_m,A180,A0,B180,B0")
    assert "[holes-correlation]" in displace(run).err
    Path("twice.csv").write_text(Path("base.csv").read_text())
    assert "[input-repeated]" in run("displacement base.csv twice.csv --unit digi-25000").err


def test_options_out_of_range(run, two):
    assert "--spike-limit is 0; allowed: " in displace(run, "--spike-limit", "0").err
    assert "--step-sd-mm is -1; allowed: " in displace(run, "--step-sd-mm", "-1").err
    assert "--rotation-deg is 90; allowed: " in displace(run, "--rotation-deg", "90").err


def test_several_readings_each_against_the_base(run, two):
    write("third.csv", 2.0 * SHEAR, 3)
    done = run("displacement base.csv later.csv third.csv --unit digi-25000 --from top --json")
    found = {name: one["axes"]["a"]["displacement_mm"] for name, one in done.json["readings"].items()}
    assert list(found) == ["later", "third"]
    assert found["later"][0] == 0.0
    assert found["third"][-1] == pytest.approx(-20.0, abs=0.25)


def test_check_says_that_it_is_a_casing(run, two):
    done = run("check base.csv --profile inclinometer-digi-25000 --json")
    assert done.json["uses"]["displacement"] is None


def test_resultant_to_the_north(run, two):
    done = displace(run, "--a0-azimuth-deg", "350", "-o", "found.csv").ok()
    assert "to 350 deg" in done.out or "to 349 deg" in done.out
    row = rows_of("found.csv")[0]
    assert float(row["resultant_mm"]) == pytest.approx(10.0, abs=0.25)
    assert float(row["azimuth_deg"]) == pytest.approx(350.0, abs=2.0)
    assert displace(run, "--json").json["readings"]["later"]["resultant"]["azimuth_deg"] is None

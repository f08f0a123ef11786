"""Bad input: one clear line, exit status 2, nothing written - or a named warning where the numbers are of use."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest


def edit(change, path="readings.csv", to="bad.csv"):
    """Rewrite a CSV by a function of its rows (lists of text, the header first)."""
    with Path(path).open(newline="", encoding="utf-8") as stream:
        table = list(csv.reader(stream))
    table = change(table) or table
    with Path(to).open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows(table)


def column(table, name):
    return table[0].index(name)


def refused(run, *parts, path="bad.csv", more=()):
    done = run("calibrate", path, "-o", "bad.json", "--report", "bad.html", *more)
    assert done.status == 2, done.out + done.err
    assert done.out == ""
    lines = done.err.strip().splitlines()
    assert len(lines) == 1, done.err
    assert "Traceback" not in done.err
    for part in parts:
        assert part in lines[0], lines[0]
    assert not Path("bad.json").exists()
    assert not Path("bad.html").exists()
    assert not [p for p in Path().iterdir() if p.name.startswith(".") or "tmp" in p.name]


def warned(run, *parts, path="bad.csv"):
    done = run("calibrate", path, "-o", "warned.json")
    assert done.status == 0, done.err
    text = " ".join(done.err.split())
    for part in parts:
        assert part in text, text


def set_cell(row, name, value):
    def change(table):
        table[row][column(table, name)] = value

    return change


def test_missing_column(run, bench):
    bench()

    def drop(table):
        place = column(table, "accel_x")
        return [row[:place] + row[place + 1 :] for row in table]

    edit(drop)
    refused(run, "bad.csv", "accel_x")


@pytest.mark.parametrize("text", ["abc", "1.2.3", "--", "1e"])
def test_text_in_a_number(run, bench, text):
    bench()
    edit(set_cell(3, "mag_y", text))
    refused(run, "bad.csv, line 4", "mag_y", text)


@pytest.mark.parametrize("text", ["nan", "NaN", "inf", ""])
def test_not_finite_or_empty(run, bench, text):
    bench()
    edit(set_cell(5, "accel_z", text))
    refused(run, "bad.csv, line 6", "accel_z")


def test_repeated_station_with_contradictory_angles(run, bench):
    bench()
    edit(set_cell(4, "station", "1"))
    refused(run, "station", "1", "line")


def test_degrees_given_as_radians(run, bench):
    bench()

    def radians(table):
        for row in table[1:]:
            for name in ("azimuth_deg", "inclination_deg", "toolface_deg"):
                row[column(table, name)] = repr(float(row[column(table, name)]) / 57.29577951308232)

    edit(radians)
    refused(run, "radian")


def test_unit_missing(run, bench):
    bench()

    def rename(table):
        table[0][column(table, "inclination_deg")] = "inclination"

    edit(rename)
    refused(run, "inclination_deg")


def test_fewer_stations_than_parameters(run, bench):
    bench()
    edit(lambda table: table[:4])
    refused(run, "3 stations", "parameters")


def test_empty_file_and_header_only(run, bench):
    bench()
    Path("bad.csv").write_text("")
    refused(run, "bad.csv", "empty")
    edit(lambda table: table[:1])
    refused(run, "bad.csv")


def test_missing_file_and_folder(run, bench):
    bench()
    refused(run, "nowhere.csv", path="nowhere.csv")
    done = run("calibrate", "readings.csv", "-o", "no/such/folder/tool.json")
    assert done.status == 2
    assert len(done.err.strip().splitlines()) == 1


def test_unknown_method_and_useless_option(run, bench):
    bench()
    refused(run, "nonsense", "joint", path="readings.csv", more=("--method", "nonsense"))
    refused(run, "--robust", path="readings.csv", more=("--method", "twelve", "--robust"))
    refused(run, "not an orthogonal plan", path="readings.csv", more=("--method", "orthogonal"))


@pytest.mark.long
@pytest.mark.parametrize("change", ["bom", "semicolon", "utf16"])
def test_dialects_are_read(run, bench, change):
    bench()
    text = Path("readings.csv").read_text()
    if change == "bom":
        Path("other.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    elif change == "utf16":
        Path("other.csv").write_bytes(text.encode("utf-16"))
    else:
        # a spreadsheet in a country that writes 9,80665
        Path("other.csv").write_text(text.replace(",", ";").replace(".", ","))
    for path in ("readings.csv", "other.csv"):
        assert run("calibrate", path, "-o", f"{path}.json").status == 0
    triads = [Path(f"{p}.json").read_text().split('"triads"')[1] for p in ("readings.csv", "other.csv")]
    assert triads[0] == triads[1]


def exchange(one, other):
    def change(table):
        pairs = [(column(table, f"{one}{a}"), column(table, f"{other}{a}")) for a in ("x", "y", "z")]
        for row in table[1:]:
            for i, j in pairs:
                row[i], row[j] = row[j], row[i]

    return change


def test_accelerometer_and_magnetometer_swapped(run, bench):
    bench()
    edit(exchange("accel_", "mag_"))
    refused(run, "accelerometer and magnetometer look swapped", "check the column names")


def test_x_and_y_swapped(run, bench):
    bench()

    def change(table):
        i, j = column(table, "mag_x"), column(table, "mag_y")
        for row in table[1:]:
            row[i], row[j] = row[j], row[i]

    edit(change)
    # left-handed then, as with reversed dials: refused unless it is stated
    refused(run, "left-handed: the channels of the magnetometer. A channel is reversed or two are exchanged")
    stated = run("calibrate", "bad.csv", "-o", "stated.json", "--left-handed")
    assert stated.status == 0
    assert "magnetometer channels look swapped" in stated.err


@pytest.mark.parametrize("plan", ["twelve", "orthogonal"])
@pytest.mark.parametrize("dial", ["azimuth", "inclination", "toolface"])
def test_dial_reading_off_by_30_degrees_is_named(run, bench, plan, dial):
    bench(plan)

    def change(table):
        cell = table[6]
        cell[column(table, f"{dial}_deg")] = str(float(cell[column(table, f"{dial}_deg")]) + 30.0)

    edit(change)
    warned(run, "station 6", f"its {dial} dial seems misread")
    off = re.search(r"stood ([-+][\d.]+) deg", run("calibrate", "bad.csv", "-o", "warned.json").err)
    # the rig's own errors of 0.1 deg are in the estimate
    assert float(off[1]) == pytest.approx(-30.0, abs=0.5)


def test_saturated_channel_is_named(run, bench):
    bench("orthogonal", "--seed", 2)

    def change(table):
        place = column(table, "accel_x")
        for row in table[1:]:
            row[place] = str(max(-1023, min(1023, int(float(row[place])))))

    edit(change)
    done = run("calibrate", "bad.csv", "-o", "warned.json")
    # a triad clipped at two thirds of its range cannot be mistaken for a good one
    assert done.status == 2 or "saturated" in done.err


def test_survey_refuses_garbage_and_writes_nothing(run, bench):
    bench("orthogonal")
    run("calibrate", "readings.csv", "-o", "tool.json")
    run("simulate", "well", "--truth", "truth.json", "-o", "raw.csv")
    cases = {
        "duplicate": lambda t: t[3].__setitem__(0, t[2][0]),
        "nan": set_cell(3, "accel_x", "nan"),
        "text": set_cell(3, "md_m", "deep"),
        "missing": lambda t: [row[:3] + row[4:] for row in t],
    }
    for change in cases.values():
        edit(change, "raw.csv")
        done = run("survey", "bad.csv", "--calibration", "tool.json", "-o", "bad_survey.csv")
        assert done.status == 2, done.out
        assert "bad.csv" in done.err or "channels" in done.err
        assert len(done.err.strip().splitlines()) == 1
        assert not Path("bad_survey.csv").exists()
    Path("broken.json").write_text("{")
    assert run("survey", "raw.csv", "--calibration", "broken.json", "-o", "bad_survey.csv").status == 2
    Path("site.toml").write_text('north_reference = "true"\n')
    done = run("survey", "raw.csv", "--calibration", "tool.json", "--site", "site.toml", "-o", "bad_survey.csv")
    assert done.status == 2
    assert "declination" in done.err


def test_survey_with_swapped_magnetometer_axes_raises_the_dip_flag(run, bench):
    bench("orthogonal")
    run("calibrate", "readings.csv", "-o", "tool.json")
    run("simulate", "well", "--truth", "truth.json", "-o", "raw.csv")

    def change(table):
        i, j = column(table, "mag_x"), column(table, "mag_y")
        for row in table[1:]:
            row[i], row[j] = row[j], row[i]

    edit(change, "raw.csv")
    survey = ("survey", "bad.csv", "--calibration", "tool.json", "-o", "survey.csv")
    refused = run(*survey)
    assert refused.status == 2
    assert "channels x and y of the magnetometer exchanged" in " ".join(refused.err.split())
    done = run(*survey, "--trust-file", "axes")
    assert done.status == 0
    assert "flagged dip" in " ".join(done.err.split())

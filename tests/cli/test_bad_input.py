"""Bad input: one clear line, exit status 2, nothing written - or a named warning where the numbers are of use."""

from __future__ import annotations

import csv
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


def set_cell(row, name, value):
    def change(table):
        table[row][column(table, name)] = value

    return change


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("bad.csv", "-o", "bad.json"), "[input-kind]"),
        (("empty.csv", "-o", "bad.json"), "[file-empty]"),
        (("nowhere.csv", "-o", "bad.json"), "nowhere.csv"),
        (("readings.csv", "-o", "no/such/folder/tool.json"), "no/such/folder"),
        (("readings.csv", "-o", "bad.json", "--method", "nonsense"), "joint"),
        (("readings.csv", "-o", "bad.json", "--method", "twelve", "--robust"), "--robust"),
        (("readings.csv", "-o", "bad.json", "--method", "orthogonal"), "[plan-not-method]"),
    ],
)
def test_what_is_refused_is_one_line_and_writes_nothing(run, bench, arguments, words):
    """What is wrong with the readings themselves: test_doors."""
    bench()
    edit(set_cell(3, "mag_y", "abc"))
    Path("empty.csv").write_text("")
    before = sorted(Path().iterdir())
    done = run("calibrate", *arguments, "--report", "bad.html")
    assert (done.status, done.out, len(done.err.strip().splitlines())) == (2, "", 1), done.err
    assert words in done.err
    assert sorted(Path().iterdir()) == before


def swapped(table):
    """x and y of the magnetometer."""
    i, j = column(table, "mag_x"), column(table, "mag_y")
    for row in table[1:]:
        row[i], row[j] = row[j], row[i]


def test_x_and_y_swapped_are_calibrated_where_it_is_stated(run, bench):
    bench()
    edit(swapped)
    stated = run("calibrate bad.csv -o stated.json --left-handed-channels").ok()
    assert "[bench-axes-exchanged]" in stated.err


@pytest.mark.parametrize("plan", ["twelve", "orthogonal"])
@pytest.mark.parametrize("dial", ["azimuth", "inclination", "toolface"])
def test_dial_reading_off_by_30_degrees_is_named(run, bench, plan, dial):
    bench(plan)

    def change(table):
        cell = table[6]
        cell[column(table, f"{dial}_deg")] = str(float(cell[column(table, f"{dial}_deg")]) + 30.0)

    edit(change)
    found = run("calibrate bad.csv -o warned.json --json").json["findings"]
    (said,) = (one["values"] for one in found if one["code"] == "bench-dial-misread")
    assert (said["station"], said["dial"]) == ("6", [dial])
    # the rig's own errors of 0.1 deg are in the estimate
    assert said["off_deg"] == pytest.approx(-30.0, abs=0.5)


def test_saturated_channel_is_named(run, bench):
    bench("orthogonal", "--seed", 2)

    def change(table):
        place = column(table, "accel_x")
        for row in table[1:]:
            row[place] = str(max(-1023, min(1023, int(float(row[place])))))

    edit(change)
    done = run("calibrate bad.csv -o warned.json")
    # a triad clipped at two thirds of its range cannot be mistaken for a good one
    assert done.status == 2 or "[readings-saturated]" in done.err


def test_survey_refuses_garbage_and_writes_nothing(run, well):
    edit(set_cell(3, "md_m", "deep"), "raw.csv")
    edit(lambda table: [row[:3] + row[4:] for row in table], "raw.csv", "lacking.csv")
    Path("broken.json").write_text("{")
    Path("site.toml").write_text('north_reference = "true"\n')
    for words, raw, tool, *more in (
        ("bad.csv, line 4: md_m is deep; expected: number.", "bad.csv", "tool.json"),
        ("[input-channels]", "lacking.csv", "tool.json"),
        ("broken.json", "raw.csv", "broken.json"),
        ("declination", "raw.csv", "tool.json", "--site", "site.toml"),
    ):
        done = run("survey", raw, "--calibration", tool, *more, "-o", "bad_survey.csv")
        assert (done.status, len(done.err.strip().splitlines()), words in done.err) == (2, 1, True), done.err
        assert not Path("bad_survey.csv").exists()


def test_survey_with_swapped_magnetometer_axes_raises_the_dip_flag(run, well):
    edit(swapped, "raw.csv")
    survey = ("survey", "bad.csv", "--calibration", "tool.json", "-o", "survey.csv")
    run(*survey).refused("[run-channels;")
    done = run(*survey, "--ignore", "axes").ok()
    assert "[survey-flagged]" in done.err


def other_gain(table):
    """An accelerometer of 4 % more than the calibration says."""
    at = [column(table, f"accel_{axis}") for axis in "xyz"]
    for row in table[1:]:
        for k in at:
            row[k] = repr(1.04 * float(row[k]))


def test_a_calibration_of_another_tool_ends_a_survey_with_status_1(run, well):
    edit(other_gain, "raw.csv")
    done = run("survey bad.csv --calibration tool.json -o survey.csv")
    assert done.status == 1
    assert done.err.startswith("warning: ")
    assert "[survey-most-off]" in done.err.splitlines()[0]


def test_an_empty_value_is_shown_as_it_was_typed(run, bench):
    bench()
    run("calibrate readings.csv -o tool.json --null", "").refused('--null is ""; expected: number')
    run("calibrate readings.csv -o tool.json --profile", "").ok()


def test_files_of_another_kind_are_refused_as_such(run, bench, well):
    Path("page.csv").write_text("<!DOCTYPE html>\n<html><body>a, b</body></html>\n")
    run("check page.csv").refused("HTML is not read", "[file-kind]")
    run("calibrate tool.json -o other.json").refused("[table-json]")
    run("survey raw.csv --calibration raw.csv -o bad.csv").refused("another kind: text", "[record-kind]")
    assert not [name for name in ("other.json", "bad.csv") if Path(name).exists()]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("calibrate a.csv -o b.json --method jonit", "--method: jonit; allowed: joint, "),
        ("field --latitude-deg abc --longitude-deg 4", "--latitude-deg is abc; expected: number"),
        ("calibrate a.csv -o b.json --dip 70", "Did you mean --dip-deg?"),
        ("calibrate a.csv -o b.json --ignore all", "Unknown option: --ignore. --help has all options."),
        ("calibrate a.csv -o b.json --dip-deg", "--dip-deg needs a value"),
        ("ledger verify lab.sqlite", "Not expected here: lab.sqlite."),
        ("plan twelve -o none/a.csv", "[file-folder-absent]"),
    ],
)
def test_what_is_wrong_with_a_command_is_said_plainly(run, command, said):
    run(command).refused(said)

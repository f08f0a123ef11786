"""shots as a user runs them: a sound tool passes, a bias that turns with the tool fails, depths are held together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from inclinometry.orientation import fields

NAMES = "md_m,gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT"
G, B, DIP = 9.8192, 51_300.0, np.radians(72.7)
ROTATION = ("shots", "rotation", "shots.csv", "--site", "site.toml")
REPEAT = ("shots", "repeat", "first.csv", "second.csv", "--site", "site.toml")
DEPTHS = ("shots", "dual-depth", "pipe.csv", "line.csv", "--sigma-first-m", "0.5", "--sigma-second-m", "1.1")


def write(name, depths, toolfaces_deg, bias_g=0.0, bias_b=0.0, inclination_deg=40.0, header=NAMES):
    g, b = fields(np.radians(60.0), np.radians(inclination_deg), np.radians(toolfaces_deg), DIP)
    g, b = G * g + [bias_g, 0.0, 0.0], B * b + [bias_b, 0.0, 0.0]
    rows = [",".join(f"{value:.10g}" for value in row) for row in np.column_stack([depths, g, b])]
    Path(name).write_text("\n".join([header, *rows]) + "\n")
    Path("site.toml").write_text(
        f"g = {G}\nsigma_g = 0.01\nb_nT = {B}\nsigma_b_nT = 130\ndip_deg = 72.7\nsigma_dip_deg = 0.2\n"
    )


def checks(done):
    return {check["name"]: check for check in done.json["checks"]}


@pytest.mark.parametrize(("bias", "status"), [(0.0, 0), (0.1, 1)])
def test_a_bias_that_turns_with_the_tool_fails(run, bias, status):
    # 0.1 m/s^2 is 25 sigma of the model's accelerometer bias, 0.004 m/s^2
    write("shots.csv", [1500.0] * 4, [0, 90, 180, 270], bias)
    done = run(*ROTATION, "--json")
    assert done.status == status, done.err
    assert done.json["verdict"] == ("pass", "fail")[status]
    found = checks(done)["rotation shots: inclination"]
    assert found["verdict"] == ("pass", "fail")[status]
    # across the high side a bias tilts by bias / g cos I
    assert found["value"] == pytest.approx(np.degrees(bias / G * np.cos(np.radians(40.0))), rel=0.01, abs=1e-6)
    assert (found["code"] == "survey-off") == bool(status)
    done = run(*ROTATION)
    assert ("PASS", "FAIL")[status] in done.out
    assert ("multi-station" in done.err) == bool(status)


def test_equal_depths_give_what_increasing_ones_give(run):
    answers = []
    for depths in ([1500.0] * 4, [1500.0, 1500.3, 1500.1, 1500.1], [1500.0, 1500.1, 1500.2, 1500.3]):
        write("shots.csv", depths, [10, 100, 190, 280], 0.002, 40.0)
        done = run(*ROTATION, "--json").ok()
        answers.append(done.json)
    assert answers[0] == answers[1] == answers[2]
    # semicolons, decimal commas, feet, comments and an empty line come to the same
    lines = Path("shots.csv").read_text().splitlines()[1:]
    rows = [",".join(["4921.26", *line.split(",")[1:]]).replace(",", ";").replace(".", ",") for line in lines]
    header = NAMES.replace("md_m", "MD (ft)").replace(",", ";")
    Path("shots.csv").write_text("\n".join(["# shots", header, "", *rows]) + "\n")
    done = run(*ROTATION, "--json")
    assert done.json == answers[0], done.err


def test_raw_channels_with_a_calibration(bench, run):
    bench("twelve")
    assert run("calibrate readings.csv -o tool.json").status == 0
    run("simulate well --truth truth.json -o raw.csv").ok()
    header, *rows = Path("raw.csv").read_text().splitlines()
    # one depth for stations that are of many: the readers take them, the checks see that they differ
    place = header.split(",").index("md_m")
    cells = [row.split(",") for row in rows[10:16]]
    Path("shots.csv").write_text("\n".join([header, *(",".join([*c[:place], "900", *c[place + 1 :]]) for c in cells)]))
    Path("site.toml").write_text(f"g = 9.82\nb_nT = {B}\ndip_deg = 72.7\n")
    done = run(*ROTATION, "--calibration", "tool.json", "--json")
    assert done.status == 1, done.err
    assert len(done.json["checks"]) == 5


def test_toolfaces_on_one_side_are_not_judged_and_show_no_nan(run):
    write("shots.csv", [1500.0] * 4, [0, 30, 60, 90])
    done = run(*ROTATION)
    assert done.status == 1
    assert "NOT JUDGED" in done.out
    assert "[survey-toolfaces]" in done.err
    assert "nan" not in done.out
    done = run(*ROTATION, "--json")
    assert checks(done)["rotation shots: azimuth"]["value"] is None


def test_bad_shots_are_refused_by_file_and_line(run):
    write("shots.csv", [1500.0, 1500.0, 1530.0], [0, 120, 240])
    run(*ROTATION).refused("shots.csv: ", "[work-apart]")
    write("shots.csv", [1500.0] * 3, [0, 120, 240])
    lines = Path("shots.csv").read_text().splitlines()
    Path("shots.csv").write_text("\n".join([lines[0], "", *lines[1:]]).replace(lines[2], lines[2][:-3] + "e9") + "\n")
    done = run(*ROTATION)
    assert done.status == 2
    assert done.err.count("shots.csv, line 4: bz_nT is ") == 1
    assert "/" not in done.err.split("shots.csv")[0]
    Path("shots.csv").write_text("md,gx_m_s2\n1,2\n")
    assert run(*ROTATION).status == 2


def test_repeated_stations(run):
    depths = np.arange(5) * 30.0 + 900.0
    write("first.csv", depths, [0, 80, 160, 240, 320])
    write("second.csv", depths + 0.2, [180, 260, 340, 60, 140])
    done = run(*REPEAT, "--json").ok()
    assert set(checks(done)) >= {"repeat: inclination", "repeat: azimuth"}
    write("second.csv", depths + 0.2, [180, 260, 340, 60, 140], inclination_deg=42.0)
    done = run(*REPEAT)
    assert done.status == 1
    assert "FAIL: first.csv and second.csv" in done.out
    assert "[survey-off]" in done.err
    # nearer together than the depths are: nothing to compare, and that is no pass
    done = run(*REPEAT, "--apart-m", "0.1")
    assert done.status == 1
    assert "NOT JUDGED" in done.out
    Path("second.csv").write_bytes(Path("first.csv").read_bytes())
    run(*REPEAT).refused("[input-same-file]")


def test_another_tool_is_allowed_more(run):
    write("first.csv", [900.0], [0])
    write("second.csv", [900.0], [0], inclination_deg=40.001)
    limits = [checks(run(*REPEAT, *more, "--json"))["repeat: inclination"]["limit"] for more in ((), ("--other-tool",))]
    # the same tool at the same toolface: the errors of the sensors are the same and cancel
    assert not limits[0] or limits[0] < 0.5 * limits[1]


def test_two_depths(run):
    Path("pipe.csv").write_text("station,md_m\nA,1000\nB,2000\n")
    Path("line.csv").write_text("station,md_ft\nA,3281.0\nB,6568.0\n")
    done = run(*DEPTHS, "--json").ok()
    (check,) = done.json["checks"]
    assert check["value"] == pytest.approx(6568.0 * 0.3048 - 2000.0)
    # root of the sum of squares, SPE 133417
    assert check["limit"] == pytest.approx(3.0 * np.hypot(0.5, 1.1))
    Path("line.csv").write_text("station,md_m\nA,1000\nB,2011\n")
    done = run(*DEPTHS)
    assert done.status == 1
    assert "pipe tally" in done.err
    assert run(*DEPTHS[:4], "--sigma-first-m", "0", "--sigma-second-m", "0").status == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("station,md_m\nA,1000\n", "[work-rows]"),
        ("station,md_m\nA,1000\nC,2000\n", "[work-rows]"),
        ("station,x\nA,1000\n", "md_m or md_ft"),
        ("station,md_m\nA,1000\nB,2000\n", "[input-same-file]"),
        ("station,md_m\nA,1000\nB,\n", "line 3: Column md_m is empty"),
    ],
)
def test_depths_that_cannot_be_compared(run, text, words):
    Path("pipe.csv").write_text("station,md_m\nA,1000\nB,2000\n")
    Path("line.csv").write_text(text)
    run(*DEPTHS).refused(words)

"""A file that cannot be true is refused by its code, and accepted by --ignore, which the output records."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from inclinometry.constants import VECTORS
from inclinometry.files.tool_json import read_calibration
from inclinometry.orientation import fields
from inclinometry.survey.flags import SIGNS

SITE = 'north_reference = "magnetic"\ng = 9.81\nb_nT = 50000.0\ndip_deg = 68.0\n'


def well(change=None):
    """survey.csv: a hole that builds to 60 deg."""
    md = np.arange(0.0, 2000.0, 28.5)
    inclination = np.interp(md, [0, 400, 1300, 2000], [0, 0, 60, 60])
    columns = {"md_m": md, "inclination_deg": inclination, "azimuth_deg": np.full(md.size, 50.0)}
    if change is not None:
        change(columns)
    rows = ["md_m,inclination_deg,azimuth_deg,azimuth_reference"]
    rows += [",".join(f"{v:.4f}" for v in row) + ",grid" for row in zip(*columns.values(), strict=True)]
    Path("survey.csv").write_text("\n".join(rows) + "\n")
    return columns


def axes(order=(0, 1, 2)):
    """run.csv: six axes of the same hole, in another order of channels; site.toml."""
    columns = well()
    md, inclination, azimuth = columns.values()
    r = np.random.default_rng(1)
    g, b = fields(np.radians(azimuth), np.radians(inclination), r.uniform(0, 6.28, md.size), np.radians(68.0))
    g, b = 9.81 * g + r.normal(0, 0.002, g.shape), 5e4 * b + r.normal(0, 30.0, b.shape)
    values = np.column_stack([md, g[:, order], b[:, order]])
    header = "md_m,gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT"
    np.savetxt("run.csv", values, delimiter=",", header=header, comments="", fmt="%.6g")
    Path("site.toml").write_text(SITE)


def codes(done):
    """Codes and severities of what is no note."""
    return [(one["code"], one["severity"]) for one in done.json["findings"] if one["severity"] != "note"]


def test_position(run):
    well()
    assert run("position", "survey.csv").err == ""
    well(lambda columns: columns.update(inclination_deg=180.0 - columns["inclination_deg"]))
    run("position survey.csv -o p.csv").refused("survey.csv: ", "[run-climbs; --ignore run-climbs")
    assert not Path("p.csv").exists()
    done = run("position survey.csv --json")
    assert (done.status, codes(done)) == (2, [("run-climbs", "refused")])
    for option in (("--ignore", "run-climbs"), ("--ignore", "columns"), ("--trust-file", "columns")):
        done = run("position", "survey.csv", *option, "--json").ok()
        assert codes(done) == [("run-climbs", "ignored")]
        assert ("[option-renamed]" in done.err) == ("--trust-file" in option)
    run("position survey.csv --ignore colums").refused("[input-ignore-unknown]")


def test_survey_quality_and_msa(run):
    axes((0, 2, 1))
    for command in (["survey", "run.csv"], ["quality", "run.csv"], ["msa", "run.csv", "-o", "c.json"]):
        run(*command, "--site", "site.toml").refused("run.csv: ", "[run-axis-along;")
    done = run("survey run.csv --site site.toml --ignore axes -o s.csv").ok()
    assert "[run-axis-along]" in done.err
    with Path("s.csv").open() as stream:
        assert next(stream).startswith("# ")  # what was ignored
        assert all("overruled" in row["flags"] for row in csv.DictReader(stream))
    assert run("msa run.csv -o c.json --site site.toml --ignore axes").status == 0
    kept = {one["code"]: one["severity"] for one in json.loads(Path("c.json").read_text())["findings"]}
    assert kept["run-axis-along"] == "ignored"
    axes()
    done = run("quality run.csv --site site.toml --json").ok()
    assert {one["severity"] for one in done.json["findings"]} == {"note"}


def test_convert_and_check(run):
    def feet(columns):
        columns["md_m"] = np.where(columns["md_m"] > 1000.0, columns["md_m"] / 0.3048, columns["md_m"])

    well(feet)
    assert run("convert survey.csv a.las").status == 0
    run("convert survey.csv b.las --check").refused("[run-depths-mixed;")
    assert not Path("b.las").exists()
    done = run("convert survey.csv b.las --check --ignore depths").ok()
    assert "[run-depths-mixed]" in done.err
    run("convert survey.csv b.las --ignore depths").refused("--check")
    assert "[run-depths-mixed]" in run("check", "survey.csv").err


def test_what_was_overruled_stands_in_the_file(run):
    well(lambda columns: columns.update(inclination_deg=180.0 - columns["inclination_deg"]))
    option = ("--ignore", "columns")
    assert run("position survey.csv -o p.csv", *option).status == 0
    assert Path("p.csv").read_text().startswith("# ignored run-climbs: ")
    assert run("convert survey.csv c.csv --check", *option).status == 0
    assert Path("c.csv").read_text().startswith("# ignored run-climbs: ")
    done = run("position", "c.csv", *option, "--json").ok()
    assert done.json["stations"] == 71
    run("position", "c.csv").refused("[run-climbs;")
    assert codes(run("check c.csv --json")) == [("run-climbs", "refused")]


def test_check_agrees_with_position(run):
    well()
    assert "position: accepted" in run("check", "survey.csv").out
    well(lambda columns: columns.update(inclination_deg=180.0 - columns["inclination_deg"]))
    seen = run("check", "survey.csv").out.replace("\n", " ")
    assert "position: accepted" not in seen
    assert "position: The run is refused. To accept it: --ignore run-climbs." in seen


def checked(run, status, *arguments):
    done = run("check", *arguments)
    assert done.status == status, done.out
    return (done.err + done.out).replace("\n", " ")


def test_check_says_what_survey_would_of_six_axes(run):
    axes()
    assert "survey, quality, msa: accepted" in checked(run, 0, "run.csv")
    axes((0, 2, 1))
    seen = checked(run, 1, "run.csv")
    run("survey run.csv --site site.toml").refused("[run-axis-along;")
    assert "survey, quality, msa: The run is refused. To accept it: --ignore run-axis-along." in seen
    assert run("check run.csv --json").json["refused"] == ["run-axis-along"]
    axes()
    header, *rows = Path("run.csv").read_text().splitlines()
    gravity = [row.split(",") for row in rows]
    in_g = [",".join([row[0], *(f"{float(v) / 9.80665:.7f}" for v in row[1:4]), *row[4:]]) for row in gravity]
    Path("unit.csv").write_text("\n".join([header, *in_g]) + "\n")
    assert "[run-unit]" in checked(run, 1, "unit.csv")
    run("survey unit.csv --site site.toml").refused("[run-unit;")
    renamed = header.replace("_m_s2", "_g")
    Path("unit.csv").write_text("\n".join([renamed, *in_g]) + "\n")
    assert checked(run, 0, "unit.csv")
    assert run("survey unit.csv --site site.toml").status == 0
    feet = [",".join([f"{float(row[0]) / 0.3048:.2f}", *row[1:]]) for row in gravity]
    Path("feet.csv").write_text("\n".join([header, *feet]) + "\n")
    assert "[run-depths-feet]" in checked(run, 0, "feet.csv")  # a warning of survey


def test_check_judges_raw_channels_by_their_calibration(run):
    files = ("-o", "readings.csv", "--truth", "t.json")
    run("simulate bench --plan orthogonal --rig-sd-deg 0.05", *files).ok()
    assert run("calibrate readings.csv -o tool.json").status == 0
    tool = read_calibration("tool.json").tool
    md, inclination, azimuth = well().values()
    toolface = np.random.default_rng(2).uniform(0.0, 6.28, md.size)
    fields_of = dict(zip(VECTORS, fields(np.radians(azimuth), np.radians(inclination), toolface, 1.1), strict=True))
    channels = {kind: tool.triads[kind].signals(fields_of[kind]).round(1) for kind in VECTORS}

    def write(md, change=lambda values: values):
        table = np.column_stack([md, *(change(channels[kind]) for kind in VECTORS)])
        header = "md_m,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z"
        np.savetxt("raw.csv", table, delimiter=",", header=header, comments="", fmt="%.2f")

    with_tool = ("raw.csv", "--calibration", "tool.json")
    write(md)
    assert "survey --calibration: accepted" in checked(run, 0, *with_tool)
    assert "[check-raw]" in checked(run, 0, "raw.csv")
    write(md, lambda values: values[:, [0, 2, 1]])
    assert "To accept it: --ignore run-channels." in checked(run, 1, *with_tool)
    run("survey", *with_tool).refused("[run-channels;")
    write(md, lambda values: 10.0 * values)
    assert "[run-total-calibrated]" in checked(run, 1, *with_tool)
    # depths need no calibration
    write(np.where(md > 1000.0, md / 0.3048, md))
    assert "[run-depths-mixed]" in checked(run, 1, "raw.csv")
    run("survey", *with_tool).refused("[run-depths-mixed;")
    # a calibration has no use for fields
    axes()
    run("check survey.csv --calibration tool.json").refused("[check-not-raw]")


def told(run):
    """Causes of findings."""
    return [one["values"].get("cause") for one in run("survey run.csv --site site.toml --json").json["findings"]]


def test_the_dip_of_a_site_with_the_wrong_sign(run):
    axes()
    Path("site.toml").write_text(SITE.replace("68.0", "-68.0"))
    assert SIGNS["unknown"][0] in told(run)
    Path("site.toml").write_text(SITE.replace("68.0", "-68.0") + "latitude_deg = 60.0\n")
    assert SIGNS["site"][0] in told(run)
    Path("site.toml").write_text(SITE.replace("68.0", "-68.0") + "latitude_deg = -60.0\n")
    assert SIGNS["triad"][0] in told(run)


def test_a_place_with_a_longitude_of_the_wrong_sign(run):
    from inclinometry.earth.magnetic import wmm2025

    day = "latitude_deg = 60.0\nlongitude_deg = {}\nheight_m = 0\ndate = 2026-05-01\n"
    true = wmm2025(np.radians(60.0), np.radians(-110.0), 0.0, 2026.33)
    md, inclination, azimuth = well().values()
    toolface = np.random.default_rng(1).uniform(0.0, 6.28, md.size)
    g, b = fields(np.radians(azimuth), np.radians(inclination), toolface, float(true.dip))
    values = np.column_stack([md, 9.819 * g, float(true.b) * b])
    header = "md_m,gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT"
    np.savetxt("run.csv", values, delimiter=",", header=header, comments="", fmt="%.6g")
    Path("site.toml").write_text('north_reference = "true"\n' + day.format(-110.0))
    assert "run-place" not in run("survey run.csv --site site.toml").err
    Path("site.toml").write_text('north_reference = "true"\n' + day.format(110.0))
    run("survey run.csv --site site.toml").refused("[run-place;")


def test_a_formula_that_fails_says_first_what_is_doubted_of_the_run(run):
    """Columns exchanged in a hole that turns: an angle beyond a tool code's range is the smaller half of it."""
    md = np.arange(0.0, 2500.0, 28.5)
    inclination, azimuth = np.interp(md, [300, 1000], [0, 60]), np.interp(md, [300, 2500], [20, 170])
    rows = ["md_m,inclination_deg,azimuth_deg,azimuth_reference"]
    rows += [f"{m:.2f},{a:.3f},{i:.3f},true" for m, i, a in zip(md, inclination, azimuth, strict=True)]
    Path("survey.csv").write_text("\n".join(rows) + "\n")
    Path("site.toml").write_text(SITE.replace("magnetic", "true") + "declination_deg = 3.0\nlatitude_deg = 60.0\n")
    done = run("position survey.csv --site site.toml --tool-code spe90408-model-1")
    done.refused("[run-top-exchanged;")


def test_inclinations_beyond_half_a_turn_beside_azimuths_within_it_are_exchanged_columns(run):
    well()
    text = Path("survey.csv").read_text().splitlines()
    cells = [line.split(",") for line in text[1:]]
    text[1:] = [
        ",".join((md, f"{float(azimuth) + 200.0:.4f}", inclination, north)) for md, inclination, azimuth, north in cells
    ]
    Path("survey.csv").write_text("\n".join(text) + "\n")
    run("position", "survey.csv").refused("inclination_deg is 250", "[readings-exchanged]")


def test_verify_says_its_reservation_in_words_and_in_json(run):
    more = ("--rig-sd-deg", 0.1, "--base-tilt-deg", 0)
    assert run("simulate bench --plan orthogonal", *more, "-o", "r.csv", "--truth", "t.json").status == 0
    assert run("simulate bench --plan spread --tool t.json", *more, "--seed", 9, "-o", "v.csv").status == 0
    assert run("calibrate r.csv --rig-sd-deg 0.1 -o tool.json").status == 0
    limits = 'source = "contract 7"\ninclination_deg = 3.0\nazimuth_deg = 40.0\ntoolface_deg = 9.0\n'
    Path("wide.toml").write_text(limits)
    done = run("verify v.csv --calibration tool.json --limits wide.toml -o verify.json").ok()
    assert "PASS, WITH RESERVATIONS against" in done.out
    assert "PASS against" not in done.out
    assert "40 deg (azimuth)" in done.err
    assert "[verify-detects-little]" in done.err
    assert "verify-wide" in Path("verify.json").read_text()
    done = run("verify v.csv --calibration tool.json --limits wide.toml --json")
    assert "verify-detects-little" in [one["code"] for one in done.json["reservations"]]


def test_quality_does_not_call_what_it_could_not_judge_not_passed(run):
    """Level towards the east |b| and dip do not see the axial field: it is not judged, others pass."""
    md = np.arange(1500.0, 2100.0, 30.0)
    r = np.random.default_rng(1)
    level, east = np.full(md.size, np.radians(89.0)), np.full(md.size, np.radians(90.0))
    g, b = fields(east, level, r.uniform(0, 6.28, md.size), np.radians(68.0))
    values = np.column_stack([md, 9.81 * g + r.normal(0, 1e-3, g.shape), 5e4 * b + r.normal(0, 20.0, b.shape)])
    header = "md_m,gx_m_s2,gy_m_s2,gz_m_s2,bx_nT,by_nT,bz_nT"
    np.savetxt("run.csv", values, delimiter=",", header=header, comments="", fmt="%.6g")
    Path("site.toml").write_text(SITE)
    done = run("quality run.csv --site site.toml")
    last = done.out.strip().splitlines()[-1]
    assert "pass; not judged: axial interference seen" in done.out.replace("\n", " "), last
    assert "not passed" not in done.out

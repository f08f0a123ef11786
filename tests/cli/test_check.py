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

LISTING = (
    "Service company\nwell;A-1\n\nMD;INC;AZI;azimuth_reference\nft;deg;deg;\n"
    "0;0,0;0;true\n1000;10,5;20;true\n2000;20;21;true\n"
)


@pytest.fixture
def listing(run):
    Path("listing.txt").write_text(LISTING)
    return "listing.txt"


def test_what_a_listing_is_understood_to_be(run, listing):
    done = run("check", listing)
    assert done.status == 0
    assert "separated by semicolon, 3 lines before the names, a line of units; 3 rows" in done.out
    assert "MD (ft)" in done.out and "position: can take it as it is" in done.out  # noqa: PT018
    assert "calibrate, verify: no channels" in done.out


def test_from_the_draft_to_the_answer_with_one_option(run, listing):
    assert run("check", listing, "-o", "mine.toml").status == 0
    done = run("position", listing, "--profile", "mine.toml", "-o", "position.csv")
    assert done.status == 0, done.err
    plain = "md_m,inclination_deg,azimuth_deg,azimuth_reference\n0,0,0,true\n304.8,10.5,20,true\n609.6,20,21,true\n"
    Path("plain.csv").write_text(plain)
    assert run("position", "plain.csv", "-o", "plain-position.csv").status == 0
    assert Path("position.csv").read_text() == Path("plain-position.csv").read_text()


def test_units_that_the_names_do_not_state(run):
    Path("a.csv").write_text("MD,INC,AZI,azimuth_reference\n0,0,0,true\n1000,10.5,20,true\n")
    lacking = run("position", "a.csv", "-o", "p.csv")
    assert lacking.status == 2
    assert "md_m" in lacking.err
    assert not Path("p.csv").exists()
    assert run("position", "a.csv", "--units", "ft,deg", "-o", "p.csv").status == 0
    assert "304.8" in Path("p.csv").read_text()
    wrong = run("position", "a.csv", "--units", "yard", "-o", "q.csv")
    assert (wrong.status, "unit 'yard' is not known" in wrong.err) == (2, True)


def test_check_with_the_units_stated(run):
    Path("a.csv").write_text("MD,INC,AZI\n0,0,0\n1000,10.5,20\n")
    done = run("check", "a.csv", "--units", "ft,deg")
    assert re.search(r"MD +│ +md_m", done.out)
    assert "not known" not in done.out


def test_a_profile_without_a_table_is_said(run):
    done = run("list", "plans", "--units", "ft")
    assert done.status == 0
    assert "warning: --units had no table to be used for" in done.err


def test_standard_input_and_output(run, monkeypatch):
    run("simulate", "bench", "--plan", "orthogonal", "-o", "readings.csv")
    assert run("calibrate", "readings.csv", "-o", "file.json").status == 0
    stream = io.BytesIO(Path("readings.csv").read_bytes())
    monkeypatch.setattr(sys, "stdin", types.SimpleNamespace(buffer=stream))
    assert run("calibrate", "-", "-o", "stdin.json").status == 0
    one, two = (json.loads(Path(name).read_text()) for name in ("file.json", "stdin.json"))
    assert one["triads"] == two["triads"]
    assert run("check", "-", "-").status == 2


def test_readings_of_every_kind_give_one_calibration(run):
    run("simulate", "bench", "--plan", "orthogonal", "-o", "readings.csv")
    text = Path("readings.csv").read_text()
    Path("packed.csv.gz").write_bytes(gzip.compress(text.encode()))
    rows = [line.split(",") for line in text.splitlines()]
    columns = {name: [row[k] for row in rows[1:]] for k, name in enumerate(rows[0])}
    numbers = {n: list(map(float, v)) if n not in ("station", "roll_set") else v for n, v in columns.items()}
    Path("readings.json").write_text(json.dumps(numbers))
    Path("blank.txt").write_text("a logger\n" + text.replace(",", " "))
    assert run("check", "blank.txt", "-o", "blank.toml").status == 0
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
    assert "would fit g (gravity +0.0%)" in done.out
    assert "would fit uT (a field of 48.0 uT)" in done.out
    assert "can take it" not in done.out  # no unit is guessed


@pytest.mark.parametrize(
    ("what", "some"),
    [
        ("plans", "twelve"), ("limits", "rogatykh-2018-fluxgate"), ("tool-codes", "iscwsa-mwd-rev5.1"),
        ("profiles", "sap6"), ("formats", "witsml"), ("columns", "azimuth_deg"), ("conventions", "iscwsa"),
    ],
)  # fmt: skip
def test_lists_of_names(run, what, some):
    assert some in run("list", what).out


def test_no_file_no_table(run):
    assert "there is no such file" in run("check", "nothing.csv").err
    Path("empty.csv").write_text("")
    done = run("check", "empty.csv")
    assert done.status == 2
    assert "the file is empty" in done.err
    Path("blank.csv").write_text("\n\n# nothing\n")
    assert run("check", "blank.csv").status == 2
    Path("prose.txt").write_text("Dear colleague\nhere are the data\nas promised.\n")
    assert "can take it" not in run("check", "prose.txt").out


def test_looking_without_writing(run):
    run("simulate", "bench", "--plan", "orthogonal", "-o", "readings.csv")
    before = set(Path().iterdir())
    assert "nothing was written; -o names a file" in run("calibrate", "readings.csv").out
    assert "output" not in run("calibrate", "readings.csv", "--json").json
    assert set(Path().iterdir()) == before
    Path("a.csv").write_text("MD,INC,AZI\n0,0,0\n1000,10.5,20\n")
    done = run("position", "a.csv", "--units", "ft,deg", "--azimuth-reference", "true")
    assert "304.80" in done.out
    assert "nothing was written" in done.out
    Path("b.csv").write_text("MD,INC,AZI,azimuth_reference\n0,0,0,grid\n1000,10.5,20,grid\n")
    done = run("position", "b.csv", "--units", "ft,deg", "--azimuth-reference", "true")
    assert (done.status, "'azimuth_reference' appears twice" in done.err) == (2, True)


@pytest.mark.parametrize("ending", ["las", "xlsx", "parquet", "witsml"])
def test_a_survey_of_any_format_becomes_positions(run, ending):
    Path("a.csv").write_text(
        "md_m,inclination_deg,azimuth_deg,azimuth_reference\n0,0,0,true\n30,1.5,20,true\n60,3,21,true\n"
    )
    assert run("convert", "a.csv", f"a.{ending}").status == 0
    assert run("position", "a.csv", "-o", "plain.csv").status == 0
    assert run("position", f"a.{ending}", "-o", "other.csv").status == 0
    with Path("plain.csv").open() as one, Path("other.csv").open() as two:
        plain, other = (np.genfromtxt(stream, delimiter=",", skip_header=1)[:, :5] for stream in (one, two))
    np.testing.assert_allclose(other, plain, atol=1e-9)


def test_quiet_and_open(run, monkeypatch):
    run("simulate", "bench", "--plan", "orthogonal", "-o", "readings.csv")
    done = run("calibrate", "readings.csv", "-o", "tool.json", "-q")
    assert (done.status, done.out) == (0, "")
    assert Path("tool.json").exists()
    assert run("list", "plans").out  # no longer quiet
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert run("calibrate", "readings.csv", "--report", "report.html", "--open").status == 0
    assert opened == [Path("report.html").resolve().as_uri()]
    assert "name it with --report" in run("calibrate", "readings.csv", "--open").err


def test_each_file_of_a_folder_one_table_one_exit_status(run):
    Path("runs").mkdir()
    Path("out").mkdir()
    for seed in (1, 2, 3):
        run("simulate", "bench", "--plan", "orthogonal", "--seed", seed, "-o", f"runs/tool{seed}.csv")
    done = run("calibrate", "--each", "runs/*.csv", "-o", "out/{stem}.json")
    assert done.status == 0
    assert [path.name for path in sorted(Path("out").iterdir())] == ["tool1.json", "tool2.json", "tool3.json"]
    assert done.out.count("written to out/tool") == 3
    Path("runs/bad.csv").write_text("accel_x,accel_y\n1,x\n")
    done = run("calibrate", "--each", "runs")
    assert done.status == 2
    assert "4 files" in done.out
    assert "bad.csv" in done.out
    assert done.out.count("nothing was written") == 3
    assert "put {stem} into the name" in run("calibrate", "--each", "runs", "-o", "x.json").err
    assert "no such file" in run("calibrate", "--each", "none/*.csv").err
    assert "put {stem} into the name" in run("calibrate", "--each=runs", "--output=x.json").err
    assert "put {stem} into the name" in run("convert", "--each", "runs", "all.las").err
    Path("runs/bad.txt").write_text("")
    assert "two files are called 'bad'" in run("calibrate", "--each", "runs", "-o", "out/{stem}.json").err


def test_completion_of_the_shell(run, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", "/bin/bash")
    done = run("--install-completion")
    assert done.status == 0
    script = next(tmp_path.rglob("completions/inclinometry"))
    assert "displacement" in script.read_text()

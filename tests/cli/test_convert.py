"""The command that converts surveys: what is lost is on the terminal and in the JSON."""

from pathlib import Path

import pytest

ROWS = "md_m,inclination_deg,azimuth_deg,azimuth_reference,crew\n0,0,0,true,A\n30,1.5,359,true,B\n"


@pytest.fixture(autouse=True)
def source(tmp_path):
    (tmp_path / "a.csv").write_text(ROWS)


def test_it_says_what_the_target_does_not_hold(run):
    done = run("convert a.csv b.las")
    assert (done.status, done.out) == (0, "2 stations written to b.las\n")
    assert "warning: Not kept: crew (2 of 2 values)." in done.err
    done = run("convert a.csv b.txt --to las --json")
    assert [(one["code"], one["values"]) for one in done.json["lost"]] == [
        ("work-lost-values", {"names": ["crew"], "lost": 2, "total": 2})
    ]
    assert (done.json["stations"], done.json["from"], done.json["to"]) == (2, "csv", "las")
    assert Path("b.txt").read_text() == Path("b.las").read_text()


def test_there_and_back(run):
    for one, other in (("a.csv", "a.xlsx"), ("a.xlsx", "a.parquet"), ("a.parquet", "back.csv")):
        done = run("convert", one, other)
        assert (done.status, done.err) == (0, "")
    run("convert a.csv again.csv")
    assert Path("back.csv").read_text() == Path("again.csv").read_text()


def test_doubtful_fields_are_said(run):
    Path("six.csv").write_text("md_m,gx_m_s2,gy_m_s2,gz_m_s2\n0,0,0,1\n")
    done = run("convert six.csv six.parquet").ok()
    assert "[table-total]" in done.err


def test_a_target_that_cannot_be_read_back(run):
    Path("u.csv").write_text("md_m,u_inclination_deg\n0,0.1\n30,0.1\n")
    run("convert u.csv u.xml").refused("u.xml: ", "[work-unread]")
    assert not Path("u.xml").exists()


SURVEY = """\
md_m,inclination_deg,azimuth_deg,azimuth_reference,toolface_deg,magnetic_toolface_deg,g_total,b_total_nT,dip_deg,\
u_inclination_deg,u_azimuth_deg,u_toolface_deg,flags
0,0.53163,73.79247,magnetic,341.71199,55.50446,9.81055338,49937.9356,70.00793,0.0273,2.955,2.9704,
30,0.50303,76.31822,magnetic,156.75386,233.07208,9.80813834,50013.8916,70.00797,0.02738,3.1196,3.1317,vertical
60,10.25,75.5,magnetic,109.47724,182.5949,9.81042151,50018.1336,69.97712,0.02785,0.2114,0.2253,
"""
"""As `survey` writes it."""


@pytest.mark.parametrize("target", ["s.las", "s.xlsx", "s.parquet", "s.xml"])
def test_a_survey_goes_through_every_format_to_its_position(run, target):
    Path("survey.csv").write_text(SURVEY)
    Path("site.toml").write_text("declination_deg = 2\n")
    run("position survey.csv --site site.toml -o p.csv")
    assert run("convert", "survey.csv", target).status == 0
    assert run("convert", target, "back.csv").status == 0
    run("position back.csv --site site.toml -o back-p.csv").ok()
    assert Path("back-p.csv").read_text() == Path("p.csv").read_text()
    if target != "s.xml":  # which has no uncertainties
        columns = [row.split(",")[9:12] for row in SURVEY.splitlines()]
        assert [row.split(",")[9:12] for row in Path("back.csv").read_text().splitlines()] == columns


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("a.csv", "a.csv"), "same file"),
        (("a.csv", "b.txt"), "[work-format]"),
        (("a.dat", "b.csv"), "[work-format]"),
        (("a.csv", "b.las", "--sheet", "one"), "[input-not-with]"),
        (("a.csv", "b.las", "--azimuth-reference", "grid"), "[input-north]"),
        (("a.csv", "b.las", "--azimuth-reference", "left"), "left"),
        (("a.csv", "b.las", "--from", "xlsx"), "[file-format]"),
        (("a.csv", "none/b.las"), "[file-folder-absent]"),
        (("none.csv", "b.las"), "[file-absent]"),
    ],
)
def test_refusals(run, arguments, words):
    run("convert", *arguments).refused(words)
    assert not Path("b.las").exists()


def test_legs_for_cave_programs_are_written_and_not_read(run):
    Path("a.csv").write_text(
        "md_m,inclination_deg,azimuth_deg,azimuth_reference,tvd_m\n0,0,0,true,0\n30,10,20,true,29\n"
    )
    for ending in ("svx", "th", "dat"):
        done = run("convert", "a.csv", f"a.{ending}").ok()
        assert "[work-lost-angles]" in done.err
        assert "tvd_m " in done.err
    assert "[work-format]" in run("convert a.svx b.csv").err
    done = run("convert a.csv b.csv --to csv-excel")
    assert (done.status, done.err) == (0, "")
    assert Path("b.csv").read_text(encoding="utf-8-sig").startswith("md_m;")

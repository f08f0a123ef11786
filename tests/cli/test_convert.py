"""The command that converts surveys: what is lost is on the terminal and in the JSON."""

from pathlib import Path

import pytest

ROWS = "md_m,inclination_deg,azimuth_deg,azimuth_reference,crew\n0,0,0,true,A\n30,1.5,359,true,B\n"


@pytest.fixture(autouse=True)
def source(tmp_path):
    (tmp_path / "a.csv").write_text(ROWS)


def test_it_says_what_the_target_does_not_hold(run):
    done = run("convert", "a.csv", "b.las")
    assert (done.status, done.out) == (0, "2 stations written to b.las\n")
    assert "warning: not carried by las: column 'crew' (2 values)" in done.err
    done = run("convert", "a.csv", "b.txt", "--to", "las", "--json")
    assert done.json["lost"] == ["column 'crew' (2 values)"]
    assert (done.json["stations"], done.json["from"], done.json["to"]) == (2, "csv", "las")
    assert Path("b.txt").read_text() == Path("b.las").read_text()


def test_there_and_back(run):
    for one, other in (("a.csv", "a.xlsx"), ("a.xlsx", "a.parquet"), ("a.parquet", "back.csv")):
        done = run("convert", one, other)
        assert (done.status, done.err) == (0, "")
    run("convert", "a.csv", "again.csv")
    assert Path("back.csv").read_text() == Path("again.csv").read_text()


def test_doubtful_fields_are_said(run):
    Path("six.csv").write_text("md_m,gx_m_s2,gy_m_s2,gz_m_s2\n0,0,0,1\n")
    done = run("convert", "six.csv", "six.parquet")
    assert done.status == 0
    assert "gravity comes out at 1 m/s^2" in done.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("a.csv", "a.csv"), "same file"),
        (("a.csv", "b.txt"), "b.txt: the ending '.txt' does not tell the format; give --to"),
        (("a.dat", "b.csv"), "a.dat: the ending '.dat' does not tell the format; give --from"),
        (("a.csv", "b.las", "--sheet", "one"), "--sheet is of no use for csv"),
        (("a.csv", "b.las", "--azimuth-reference", "grid"), "from true and from grid north"),
        (("a.csv", "b.las", "--azimuth-reference", "left"), "left"),
        (("a.csv", "b.las", "--from", "xlsx"), "not an .xlsx workbook"),
        (("a.csv", "none/b.las"), "does not exist"),
        (("none.csv", "b.las"), "no such file"),
    ],
)
def test_refusals(run, arguments, words):
    done = run("convert", *arguments)
    assert done.status == 2
    assert words in done.err
    assert len(done.err.splitlines()) == 1
    assert not Path("b.las").exists()

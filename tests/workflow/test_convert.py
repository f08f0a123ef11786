"""Between formats: what both hold goes round, what one cannot hold is said."""

import sys
import types
from itertools import permutations

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.errors import FileError
from inclinometry.files.six_axis import read_survey, write_csv
from inclinometry.files.survey_file import SurveyFile
from inclinometry.workflow import convert as module
from inclinometry.workflow.convert import FORMATS, Format, convert, format_of, lost, read_survey_file

from ..files.surveys import same

TABLES = {"csv": "a.csv", "xlsx": "a.xlsx", "parquet": "a.parquet", "las": "a.las"}


def survey(**more):
    gap = np.array([0.1, np.nan, 0.3])
    given = {
        "md": [0.0, 30.1, 60.2], "inclination": gap, "azimuth": [0.0, 1.0, 2.0], "azimuth_reference": "grid",
        "toolface": gap, "g": 5.0 + np.arange(9.0).reshape(3, 3) / 3, "b": 1e4 * np.arange(9.0).reshape(3, 3) / 7,
        "w": 1e-5 * np.arange(9.0).reshape(3, 3), "used": [True, False, True], "covariance": np.ones((3, 3, 3)),
        "reference": {"dip": gap, "declination": 0.1}, "measured": {"dogleg_severity": gap * 1e-3, "b": 5e4},
        "corrections": {"sag_inclination": gap * 0.01}, "temperature": gap, "north": gap, "tvd": gap,
        "extra": {"u_azimuth_deg": ("0.1", "0.2", "0.3"), "Temp": ("1", "", "2")},
    }  # fmt: skip
    return SurveyFile(**(given | more))


def put(folder, name, file):
    path = folder / f"in-{TABLES[name]}"
    module._function(FORMATS[name].write)(file, path)
    return path


@pytest.mark.long
@pytest.mark.parametrize(("first", "second"), list(permutations(TABLES, 2)))
def test_every_pair_of_tables_goes_round(tmp_path, first, second):
    source = put(tmp_path, first, survey())
    there = convert(source, tmp_path / TABLES[second])
    assert (there.source, there.target, there.lost) == (first, second, ())
    back = convert(tmp_path / TABLES[second], tmp_path / f"back-{TABLES[first]}")
    assert back.lost == ()
    again = read_survey_file(tmp_path / f"back-{TABLES[first]}", first)
    # written to 1e-10 deg, 1e-10 deg/h
    assert same(again, survey(), rtol=1e-11)


def test_what_a_table_cannot_hold_is_said(tmp_path):
    file = survey(times=("2026-01-02", "", ""), extra={"crew": ("A", "", "B")}, header={"well": "A-1"})
    source = put(tmp_path, "parquet", file)
    assert convert(source, tmp_path / "a.xlsx").lost == ()
    lost = convert(source, tmp_path / "a.las").lost
    assert [one.values for one in lost] == [
        {"names": (name,), "lost": count, "total": count} for name, count in (("time", 1), ("crew", 2))
    ]
    assert coded(convert(source, tmp_path / "a.csv").lost) == ["work-lost-values"]


@pytest.fixture
def narrow(monkeypatch):
    """A format with two digits, no temperature and no word on the north."""
    fake = types.ModuleType("inclinometry.files.narrow")

    def write(file, path):
        rows = [f"{md:.2f},{inc:.2f},{azi:.2f}" for md, inc, azi in
                zip(file.md, np.degrees(file.inclination), np.degrees(file.azimuth), strict=True)]  # fmt: skip
        path.write_text("md_m,inclination_deg,azimuth_deg\n" + "\n".join(rows).replace("nan", "") + "\n")

    fake.read, fake.write = read_survey, write
    monkeypatch.setitem(sys.modules, "inclinometry.files.narrow", fake)
    monkeypatch.setattr(
        module, "FORMATS", {**FORMATS, "narrow": Format((".nar",), "files.narrow:read", "files.narrow:write")}
    )


@pytest.mark.usefixtures("narrow")
def test_lost_digits_and_columns(tmp_path):
    file = SurveyFile(
        md=[0.001, 30.0], inclination=[0.1, np.nan], azimuth=[1.0, 2 * np.pi], azimuth_reference="grid",
        temperature=[20.0, np.nan],
    )  # fmt: skip
    write_csv(file, tmp_path / "a.csv")
    found = convert(tmp_path / "a.csv", tmp_path / "a.nar").lost
    assert coded(found) == ["work-lost-digits"] * 3 + ["work-lost-values"]
    columns = ["md_m", "inclination_deg", "azimuth_deg", "temperature_degC"]
    assert [one.values.get("column") or one.values["names"][0] for one in found] == columns


@pytest.mark.usefixtures("narrow")
def test_what_cannot_be_read_back_is_refused(tmp_path):
    (tmp_path / "a.nar").write_text("nonsense\n")
    with refused("work-unread", error=FileError):
        lost(survey(), tmp_path / "a.nar", "narrow")
    (tmp_path / "a.nar").write_text("md_m,inclination_deg\n1,1\n")
    assert coded(lost(survey(), tmp_path / "a.nar", "narrow")) == ["work-lost-values"]
    (tmp_path / "a.csv").write_text("md_m,tvd_m,crew\n0,0,A\n30.1,,A\n60.2,1,B\n")
    file = SurveyFile(md=[0, 30.1, 60.2], tvd=[0, 1, 1], extra={"crew": ("A", "B", "B")})
    values = [{"names": (name,), "lost": 1, "total": 3} for name in ("tvd_m", "crew")]
    assert [one.values for one in lost(file, tmp_path / "a.csv", "csv")] == values


def test_a_target_nobody_can_read_is_not_left(tmp_path):
    """WITSML has no place for the uncertainties; a depth alone is no survey."""
    (tmp_path / "a.csv").write_text("md_m,u_inclination_deg\n0,0.1\n30,0.1\n")
    with refused("work-unread", error=FileError):
        convert(tmp_path / "a.csv", tmp_path / "b.xml")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
    (tmp_path / "b.xml").write_text("of before")
    with refused("work-unread", error=FileError):
        convert(tmp_path / "a.csv", tmp_path / "b.xml")
    assert (tmp_path / "b.xml").read_text() == "of before"


def test_formats_by_ending():
    endings = [ending for known in FORMATS.values() for ending in known.endings]
    assert len(endings) == len(set(endings))
    for name, known in FORMATS.items():
        for ending in known.endings:
            assert format_of(f"a{ending.upper()}", option="--from" if known.read else "--to") == name
    assert format_of("a.txt") == "csv"  # a table of any kind
    for path in ("a", "a.xlw"):
        with refused("work-format", error=FileError):
            format_of(path)
    with refused("input-choice", name="--from"):
        format_of("a.csv", "ods")


def test_options_go_to_the_reader_that_has_them(tmp_path):
    (tmp_path / "a.txt").write_text("MD (m),AX(g),AY(g),AZ(g),Azi (deg)\n9,0,0,-1,5\n")
    done = convert(
        tmp_path / "a.txt", tmp_path / "b.xlsx", from_format="csv", convention="specific-force",
        azimuth_reference="magnetic",
    )  # fmt: skip
    assert done.survey.azimuth_reference == "magnetic"
    np.testing.assert_allclose(done.survey.g, [[0.0, 0.0, 9.80665]])
    # what is written is in tool axes
    np.testing.assert_allclose(read_survey_file(tmp_path / "b.xlsx", "xlsx").g, [[0.0, 0.0, 9.80665]])
    with refused("input-not-with", name="--sheet"):
        convert(tmp_path / "a.txt", tmp_path / "c.xlsx", from_format="csv", sheet="one")
    with refused("file-ending", error=FileError):
        convert(tmp_path / "a.txt", tmp_path / "c.xlsm", from_format="csv", azimuth_reference="true")
    assert not (tmp_path / "c.xlsx").exists()


MAP = """convention = "native"
azimuth_reference = "grid"
[channels]
0708 = "md_m"
0713 = "inclination_deg"
0715 = "azimuth_deg"
0722 = "gx_g"
0723 = "gy_g"
0724 = "gz_g"
"""


def raw(field="b"):
    """What M7 (b) and G7 (w) hold besides their own texts."""
    random = np.random.default_rng(3)
    g = random.normal(size=(3, 3)) * 5.0
    second = {"b": random.normal(size=(3, 3)) * 3e4} if field == "b" else {"w": random.normal(size=(3, 3)) * 4e-5}
    return SurveyFile(
        md=[10.0, 40.5, 70.0], inclination=[0.1, 0.2, 0.3], azimuth=[1.0, 2.0, 3.0], azimuth_reference="grid", g=g,
        used=[True] * 3, **second,
    )  # fmt: skip


@pytest.mark.parametrize("field", ["b", "w"])
@pytest.mark.parametrize("table", list(TABLES))
def test_raw_records_of_p7_from_and_to_tables(tmp_path, table, field):
    source = put(tmp_path, table, raw(field))
    there = convert(source, tmp_path / "a.p717")
    assert there.lost == ()
    back = convert(tmp_path / "a.p717", tmp_path / TABLES[table])
    found = read_survey_file(tmp_path / TABLES[table], table)
    for name in ("md", "inclination", "azimuth", "g", field):
        # angles to 1e-10 deg, rates to 1e-10 deg/h
        np.testing.assert_allclose(getattr(found, name), getattr(raw(field), name), rtol=1e-10, atol=2e-12)
    assert found.azimuth_reference == "grid"
    assert any(one.severity == "note" for one in back.survey.findings)


def test_surveys_of_p7_by_number(tmp_path):
    convert(put(tmp_path, "csv", raw()), tmp_path / "a.p7")
    text = (tmp_path / "a.p7").read_text()
    more = [line for line in text.splitlines() if line.startswith(("M7", "H7,1,5,1"))]
    assert len(more) >= 4
    with refused("input-choice", error=FileError, name="--sheet"):
        convert(tmp_path / "a.p7", tmp_path / "a.las", sheet="9")
    assert len(convert(tmp_path / "a.p7", tmp_path / "a.las", sheet="1").survey) == 3


def test_what_p7_cannot_hold_is_said(tmp_path):
    file = raw()
    warm = SurveyFile(md=file.md, g=file.g, b=file.b, temperature=[20.0, 21.0, 22.0], extra={"crew": ("A", "B", "C")})
    found = convert(put(tmp_path, "parquet", warm), tmp_path / "a.p7").lost
    assert [one.values["names"] for one in found] == [("temperature_degC",), ("crew",)]


def test_wits_by_its_map(tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    source = put(tmp_path, "csv", raw())
    there = convert(source, tmp_path / "a.wits", channels=tmp_path / "map.toml")
    # what is not mapped is not carried
    assert [name for one in there.lost for name in one.values["names"]] == ["bx_nT", "by_nT", "bz_nT", "used"]
    convert(tmp_path / "a.wits", tmp_path / "b.csv", channels=tmp_path / "map.toml")
    found = read_survey_file(tmp_path / "b.csv", "csv")
    np.testing.assert_allclose(found.g, raw().g, rtol=0, atol=1e-9)  # written to 1e-10 g
    assert found.azimuth_reference == "grid"
    for more in ({"to_format": "wits"}, {"to_format": "wits", "channels": tmp_path / "none.toml"}):
        with refused("input-missing", "file-absent", error=FileError):
            convert(source, tmp_path / "c.wits", **more)
    with refused("input-not-with", name="--map"):
        convert(source, tmp_path / "c.las", channels=tmp_path / "map.toml")
    with refused("input-not-with", name="--convention"):
        convert(tmp_path / "a.wits", tmp_path / "c.las", channels=tmp_path / "map.toml", convention="z-up")


@pytest.mark.parametrize("table", list(TABLES))
def test_witsml_from_and_to_tables(tmp_path, table):
    source = put(tmp_path, table, raw())
    there = convert(source, tmp_path / "a.xml")
    assert all(name.startswith("header.") for one in there.lost for name in one.values["names"])
    convert(tmp_path / "a.xml", tmp_path / TABLES[table])
    found = read_survey_file(tmp_path / TABLES[table], table)
    for name in ("md", "inclination", "azimuth", "g", "b"):
        np.testing.assert_allclose(getattr(found, name), getattr(raw(), name), rtol=1e-10, atol=2e-12)
    with refused("input-choice", error=FileError, name="trajectory"):
        convert(tmp_path / "a.xml", tmp_path / "c.csv", sheet="other")


@pytest.mark.parametrize(("first", "second"), [("a.xml", "a.p7"), ("a.p7", "a.xml"), ("a.xml", "a.wits")])
def test_between_the_formats_of_the_industry(tmp_path, first, second):
    (tmp_path / "map.toml").write_text(MAP)
    convert(put(tmp_path, "csv", raw()), tmp_path / first)
    convert(tmp_path / first, tmp_path / second, channels=tmp_path / "map.toml" if "wits" in second else None)
    convert(
        tmp_path / second, tmp_path / "a.parquet", channels=tmp_path / "map.toml" if second.endswith("wits") else None
    )
    found = read_survey_file(tmp_path / "a.parquet", "parquet")
    for name in ("md", "inclination", "azimuth", "g"):
        np.testing.assert_allclose(getattr(found, name), getattr(raw(), name), rtol=1e-10, atol=1e-9)

"""Between formats: what both hold goes round, what one cannot hold is said."""

import sys
import types
from itertools import permutations

import numpy as np
import pytest

from inclinometry.core.errors import FileError, InputError
from inclinometry.io.exchange import SurveyFile
from inclinometry.io.six_axis import read_csv, write_csv
from inclinometry.workflow import convert as module
from inclinometry.workflow.convert import FORMATS, Format, convert, format_of, lost, read_survey_file

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


@pytest.mark.parametrize(("first", "second"), list(permutations(TABLES, 2)))
def test_every_pair_of_tables_goes_round(tmp_path, first, second):
    source = put(tmp_path, first, survey())
    there = convert(source, tmp_path / TABLES[second])
    assert (there.source, there.target, there.lost) == (first, second, ())
    back = convert(tmp_path / TABLES[second], tmp_path / f"back-{TABLES[first]}")
    assert back.lost == ()
    again = read_survey_file(tmp_path / f"back-{TABLES[first]}", first)
    # written to 1e-10 deg, 1e-10 deg/h
    assert again.same_as(survey(), rtol=1e-11, atol=2e-12)


def test_what_a_table_cannot_hold_is_said(tmp_path):
    file = survey(times=("2026-01-02", "", ""), extra={"crew": ("A", "", "B")}, header={"well": "A-1"})
    source = put(tmp_path, "parquet", file)
    assert convert(source, tmp_path / "a.xlsx").lost == ()
    assert convert(source, tmp_path / "a.las").lost == ("column 'time' (1 values)", "column 'crew' (2 values)")
    assert convert(source, tmp_path / "a.csv").lost == ("texts of the file's head: well",)


@pytest.fixture
def narrow(monkeypatch):
    """A format with two digits, no temperature and no word on the north."""
    fake = types.ModuleType("inclinometry.io.narrow")

    def write(file, path):
        rows = [f"{md:.2f},{inc:.2f},{azi:.2f}" for md, inc, azi in
                zip(file.md, np.degrees(file.inclination), np.degrees(file.azimuth), strict=True)]  # fmt: skip
        path.write_text("md_m,inclination_deg,azimuth_deg\n" + "\n".join(rows).replace("nan", "") + "\n")

    fake.read, fake.write = read_csv, write
    monkeypatch.setitem(sys.modules, "inclinometry.io.narrow", fake)
    monkeypatch.setattr(module, "FORMATS", {**FORMATS, "narrow": Format((".nar",), "narrow:read", "narrow:write")})


@pytest.mark.usefixtures("narrow")
def test_lost_digits_and_columns(tmp_path):
    file = SurveyFile(
        md=[0.001, 30.0], inclination=[0.1, np.nan], azimuth=[1.0, 2 * np.pi], azimuth_reference="grid",
        temperature=[20.0, np.nan],
    )  # fmt: skip
    write_csv(file, tmp_path / "a.csv")
    found = convert(tmp_path / "a.csv", tmp_path / "a.nar").lost
    assert found == (
        "digits of column 'md_m': changes up to 0.001",
        "digits of column 'inclination_deg': changes up to 0.00042",
        "digits of column 'azimuth_deg': changes up to 0.0042",
        "column 'temperature_degC' (1 values)",
    )


@pytest.mark.usefixtures("narrow")
def test_what_cannot_be_read_back_is_said(tmp_path):
    (tmp_path / "a.nar").write_text("nonsense\n")
    assert "cannot be read back" in lost(survey(), tmp_path / "a.nar", "narrow")[0]
    (tmp_path / "a.nar").write_text("md_m,inclination_deg\n1,1\n")
    assert lost(survey(), tmp_path / "a.nar", "narrow") == ("stations: 3 were read, 1 are in the file",)
    (tmp_path / "a.csv").write_text("md_m,tvd_m,crew\n0,0,A\n30.1,,A\n60.2,1,B\n")
    file = SurveyFile(md=[0, 30.1, 60.2], tvd=[0, 1, 1], extra={"crew": ("A", "B", "B")})
    assert lost(file, tmp_path / "a.csv", "csv") == (
        "column 'tvd_m': 1 of 3 values",
        "column 'crew': 1 of 3 values differ",
    )


def test_formats_by_ending():
    endings = [ending for known in FORMATS.values() for ending in known.endings]
    assert len(endings) == len(set(endings))
    for name, known in FORMATS.items():
        for ending in known.endings:
            assert format_of(f"a{ending.upper()}") == name
    for path in ("a.txt", "a.dat", "a", "a.xls"):
        with pytest.raises(FileError, match="give --from: csv, xlsx"):
            format_of(path)
    with pytest.raises(InputError, match="format 'ods' is not known"):
        format_of("a.csv", "ods")


def test_options_go_to_the_reader_that_has_them(tmp_path):
    (tmp_path / "a.txt").write_text("MD (m),AX(g),AY(g),AZ(g),Azi (deg)\n9,0,0,-1,5\n")
    done = convert(
        tmp_path / "a.txt", tmp_path / "b.xlsx", from_format="csv", convention="specific-force",
        azimuth_reference="magnetic",
    )  # fmt: skip
    assert done.survey.azimuth_reference == "magnetic"
    np.testing.assert_allclose(done.survey.g, [[0.0, 0.0, 9.80665]])
    # what is written is in the house's axes
    np.testing.assert_allclose(read_survey_file(tmp_path / "b.xlsx", "xlsx").g, [[0.0, 0.0, 9.80665]])
    with pytest.raises(InputError, match="--sheet is of no use for csv"):
        convert(tmp_path / "a.txt", tmp_path / "c.xlsx", from_format="csv", sheet="one")
    with pytest.raises(FileError, match="macros"):
        convert(tmp_path / "a.txt", tmp_path / "c.xlsm", from_format="csv", azimuth_reference="true")
    assert not (tmp_path / "c.xlsx").exists()

"""Surveys as LAS 2.0: other readers accept what is written, and what others write is read; damage is found."""

import lasio
import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files import las
from inclinometry.files.las import write_las
from inclinometry.files.profile import reading_with
from inclinometry.files.six_axis import read_las
from inclinometry.files.survey_file import SurveyFile

from .surveys import same, saved


def survey(**more):
    gap = np.array([0.1, np.nan, 0.3])
    given = {
        "md": [0.0, 30.1, 60.2], "inclination": gap, "azimuth": [0.0, 1.0, 2.0], "azimuth_reference": "grid",
        "g": np.arange(9.0).reshape(3, 3), "b": 1e4 * np.arange(9.0).reshape(3, 3) + 1 / 3, "used": [True, False, True],
        "covariance": np.ones((3, 3, 3)), "reference": {"dip": gap}, "measured": {"dogleg_severity": gap * 1e-3},
        "temperature": gap, "extra": {"Temp": ("1.5", "", "2"), "u_azimuth_deg": ("0.1", "0.2", "0.3")},
        "header": {"well": "A: 1", "note": "two\n~A lines"},
    }  # fmt: skip
    return SurveyFile(**(given | more))


def dumb(text):
    """Mnemonics, units and rows, by the plain rules of the format."""
    sections, name = {}, ""
    for line in text.splitlines():
        if line.startswith("~"):
            name = line[1]
            sections[name] = []
        elif line.strip() and not line.startswith("#"):
            sections[name].append(line)
    curves = [line.split(":")[0] for line in sections["C"]]
    names = [line.split(".", 1)[0].strip() for line in curves]
    units = [line.split(".", 1)[1].split()[0] if line.split(".", 1)[1].strip() else "" for line in curves]
    well = {line.split(".", 1)[0].strip(): line.split(".", 1)[1].split(":")[0].split() for line in sections["W"]}
    return names, units, well, np.array([[float(v) for v in line.split()] for line in sections["A"]])


def test_round_trip(tmp_path):
    write_las(survey(), tmp_path / "a.las")
    found = read_las(tmp_path / "a.las")
    assert same(found, survey(), rtol=1e-12)
    assert dict(found.header) == dict(survey().header)


def test_texts_are_left_out(tmp_path):
    write_las(survey(times=("2026-01-02", "", ""), extra={"crew": ("A", "B", "C")}), tmp_path / "a.las")
    found = read_las(tmp_path / "a.las")
    assert found.times is None
    assert found.extra == {}


def test_lasio_and_a_dumb_parser_read_what_is_written(tmp_path):
    write_las(survey(), tmp_path / "a.las")
    names, units, well, rows = dumb((tmp_path / "a.las").read_text())
    read = lasio.read(tmp_path / "a.las", mnemonic_case="preserve")
    assert names == [curve.mnemonic for curve in read.curves]
    assert units == [curve.unit for curve in read.curves]
    assert dict(zip(names, units, strict=True)) | {"DEPT": "m", "GX": "m/s2", "BZ": "nT", "INCL": "deg"} == dict(
        zip(names, units, strict=True)
    )
    assert (well["STRT"], well["STOP"], well["STEP"]) == (["m", "0.0"], ["m", "60.2"], ["m", "30.1"])
    assert well["NULL"] == ["-999.25"]
    assert read.params["AZIREF"].value == "grid"
    assert read.well["WELL"].value == "A 1"
    np.testing.assert_array_equal(read["BX"], survey().b[:, 0])  # every digit
    np.testing.assert_array_equal(rows[:, names.index("BX")], survey().b[:, 0])
    assert np.isnan(read["INCL"][1])
    assert rows[1, names.index("INCL")] == -999.25
    assert (tmp_path / "a.las").read_text().startswith("~Version")


def test_a_value_equal_to_null_is_not_lost(tmp_path):
    file = SurveyFile(md=[0, 30], b=[[-999.25, 1, 2], [-9999.25, 3, 4]], inclination=[0.1, np.nan])
    write_las(file, tmp_path / "a.las")
    assert same(read_las(tmp_path / "a.las"), file, rtol=1e-12)


def test_uneven_depths_have_no_step(tmp_path):
    write_las(survey(md=[0.0, 10.0, 60.2]), tmp_path / "a.las")
    assert dumb((tmp_path / "a.las").read_text())[2]["STEP"] == ["m", "0.0"]
    write_las(SurveyFile(md=[5.0, 35.0], tvd=[5.0, 35.0]), tmp_path / "a.las")
    assert dumb((tmp_path / "a.las").read_text())[2]["STEP"] == ["m", "30.0"]
    write_las(SurveyFile(md=[5.0], tvd=[5.0]), tmp_path / "a.las")
    assert dumb((tmp_path / "a.las").read_text())[2]["STEP"] == ["m", "0.0"]
    assert len(read_las(tmp_path / "a.las")) == 1


FOREIGN = """~VERSION INFORMATION
 VERS.                  2.0 :   CWLS LOG ASCII STANDARD -VERSION 2.0
 WRAP.                   NO :   ONE LINE PER DEPTH STEP
~WELL INFORMATION
 STRT.F            328.0000 : START
 STOP.F            656.0000 : STOP
 STEP.F              0.0000 : STEP
 NULL.            -999.2500 : NULL
 WELL.          WELL A-1    : WELL
 RUN .             3        : RUN
~CURVE INFORMATION
 DEPT.F                     : DEPTH
 DEVI.DEG                   : DEVIATION
 HAZI.DEG                   : AZIMUTH
 GX  .G                     : ACCEL X
 GY  .G                     : ACCEL Y
 GZ  .G                     : ACCEL Z
 SQ  .                      : QUALITY
~PARAMETER INFORMATION
 MUD .G/CC       1.20       : MUD WEIGHT
# a comment
~A  DEPT DEVI HAZI GX GY GZ SQ
 328.0000    1.5000  359.5  0.0000  0.0000 -1.0000 1
 # another

 656.0000 -999.2500  1.5    0.0000  0.0000 -1.0000 -999.25
"""


def test_a_file_of_another_program(tmp_path):
    found = read_las(saved(tmp_path / "a.las", FOREIGN), azimuth_reference="true", convention="specific-force")
    np.testing.assert_allclose(found.md, [99.9744, 199.9488])
    np.testing.assert_allclose(np.degrees(found.inclination), [1.5, np.nan])
    np.testing.assert_allclose(found.g[:, 2], 9.80665)
    assert found.extra["SQ"] == ("1", "")
    assert dict(found.header) == {"WELL": "WELL A-1", "RUN": "3", "MUD": "1.2 G/CC"}
    with refused("table-north", error=FileError):
        read_las(tmp_path / "a.las")


def test_wrapped(tmp_path):
    wrapped = (
        FOREIGN.replace("NO :", "YES:").split("~A")[0] + "~A\n328\n1.5 359.5\n0 0 -1 1\n656\n-999.25 1.5\n0 0 -1 1\n"
    )
    found = read_las(saved(tmp_path / "a.las", wrapped), azimuth_reference="true")
    np.testing.assert_allclose(np.degrees(found.azimuth), [359.5, 1.5])
    for tail, words in (
        ("9\n", "table-row-width"),
        ("9 8 7 6 5 4 3 2 1\n", "table-row-width"),
    ):
        with refused(words, error=FileError):
            read_las(saved(tmp_path / "a.las", wrapped + tail), azimuth_reference="true")


def test_a_header_with_fewer_digits_than_the_data(tmp_path):
    deep = FOREIGN.replace("656.0000", "16560.0090").replace(
        "STOP.F            16560.0090", "STOP.F            16560.00"
    )
    (tmp_path / "a.las").write_text(deep)
    assert read_las(tmp_path / "a.las", azimuth_reference="true").md[-1] == pytest.approx(16560.009 * 0.3048)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (FOREIGN.splitlines()[-1], "", "file-differs"),
        ("GX  .G ", "    .G ", "table-unnamed"),
        (FOREIGN[FOREIGN.index(" DEPT.F") : FOREIGN.index("~PARAM")], "", "file-section"),
        (" SQ  .  ", " USED.  ", "input-value USED"),
        ("-1.0000 -999.25\n", "\n", "table-row-width"),
        ("STRT.F            328", "STRT.F            300", "file-differs"),
        ("STOP.F            656.0000", "STOP.F            ", "input-kind STOP"),
        ("-999.2500 : NULL", "         : NULL", "table-null"),
        (" 1.5000 ", " 1.5x00 ", "input-kind DEVI"),
        (" 1.5000 ", " NaN ", "input-kind DEVI"),
        (" 1.5000 ", " 1_5 ", "input-kind DEVI"),
        (" 1.5000 ", " 200 ", "input-value DEVI (DEG)"),
        ("DEPT.F ", "DEPT.M ", "table-units"),
        ("DEPT.F ", "DEPT.  ", "table-unit-missing"),
        ("GX  .G ", "GX  .V ", "table-unit"),
        ("DEPT.F ", "ETIM.F ", "file-column md_m"),
        (" 656.0000 -999", " 328.0000 -999", "file-differs"),
        ("GY  .G ", "GX  .G ", "input-repeated"),
        ("2.0 :", "4.0 :", "file-version"),
        ("~A  DEPT", "~X  DEPT", "file-section"),
        ("~", "-", "file-section"),
        (" VERS. ", " ", "file-section"),
    ],
)
def test_damage(tmp_path, old, new, words):
    (tmp_path / "a.las").write_text(FOREIGN.replace(old, new, -1 if old == "~" else 1))
    with refused(words, error=FileError):
        read_las(tmp_path / "a.las", azimuth_reference="true")


def test_truncated_anywhere_is_one_error_or_all_there(tmp_path):
    write_las(survey(), tmp_path / "a.las")
    text = (tmp_path / "a.las").read_text()
    for size in range(0, len(text) - 1, 7):
        (tmp_path / "b.las").write_text(text[:size])
        try:
            found = read_las(tmp_path / "b.las")
        except FileError:
            continue
        # only digits of the last value can be missing without a trace
        np.testing.assert_array_equal(found.md, survey().md)


def test_not_las(tmp_path):
    for data, words in ((b"", "file-section"), (b"\0" * 50, "file-text"), (b"md_m\n1\n", "file-section")):
        (tmp_path / "a.las").write_bytes(data)
        with refused(words, error=FileError):
            read_las(tmp_path / "a.las")
    with refused("file-absent", error=FileError):
        read_las(tmp_path / "b.las")
    with refused("file-not-file", error=FileError):
        read_las(tmp_path)


def test_old_code_pages(tmp_path):
    (tmp_path / "a.las").write_bytes(FOREIGN.replace("WELL A-1", "Sjø A-1").encode("latin-1"))
    assert read_las(tmp_path / "a.las", azimuth_reference="true").header["WELL"] == "Sjø A-1"


def test_a_north_that_is_none(tmp_path):
    write_las(survey(), tmp_path / "a.las")
    text = (tmp_path / "a.las").read_text()
    with refused("input-value", error=FileError, name="azimuth_reference"):
        read_las(saved(tmp_path / "b.las", text.replace("AZIREF. grid", "AZIREF. rig ")))
    with refused("file-format", error=FileError):
        read_las(saved(tmp_path / "b.las", text.replace('{"well": "A: 1"}', "well = A")))


def test_flags_as_a_curve(tmp_path):
    text = FOREIGN.replace(" SQ  .  ", " USED.  ")
    (tmp_path / "a.las").write_text(text.replace("-1.0000 -999.25", "-1.0000 0"))
    assert read_las(tmp_path / "a.las", azimuth_reference="true").used.tolist() == [True, False]


def test_contradictory_units_are_said_once(tmp_path, caplog):
    """The library's own words on them would stand on the terminal beside the program's."""
    write_las(survey(), tmp_path / "a.las")
    text = (tmp_path / "a.las").read_text()
    start = next(line for line in text.splitlines() if line.startswith("STRT"))
    with refused("table-units", error=FileError):
        read_las(saved(tmp_path / "a.las", text.replace(start, start.replace(".m ", ".ft", 1))))
    assert caplog.records == []


def test_standard_uncertainties_have_a_unit(tmp_path):
    write_las(survey(sigma={"azimuth": np.radians([0.5, np.nan, 400.0])}, extra={}), tmp_path / "a.las")
    names, units, _, _ = dumb((tmp_path / "a.las").read_text())
    assert units[names.index("UAZI")] == "deg"
    np.testing.assert_allclose(
        read_las(tmp_path / "a.las").sigma["azimuth"], np.radians([0.5, np.nan, 400.0]), rtol=1e-12
    )


def test_a_header_of_a_hundred_thousand_curves_is_refused_at_once(tmp_path):
    curves = "".join(f"C{k}.m : x\n" for k in range(100_000))
    with refused("file-large", error=FileError):
        read_las(saved(tmp_path / "a.las", f"~V\nVERS. 2.0:\nWRAP. NO:\n~C\n{curves}~A\n1 2\n"))


def test_a_header_of_repeated_items_is_refused_at_once(tmp_path):
    """The library that reads it compares each with all before it: a block pasted 300 times took a minute."""
    again = "COMP.  A : COMPANY\nDATE.  1 : DATE\n" * 300
    with refused("file-large", error=FileError):
        read_las(saved(tmp_path / "a.las", FOREIGN.replace("~C", f"{again}~C", 1)), azimuth_reference="true")


def test_blocks_of_rows_are_one_table(tmp_path, monkeypatch):
    write_las(survey(), tmp_path / "a.las")
    for size in (1, 2, 3):
        monkeypatch.setattr(las, "_BLOCK", size)
        assert same(read_las(tmp_path / "a.las"), survey(), rtol=1e-12)


@pytest.mark.parametrize(
    ("stop", "code"), [(10_000.015, ""), (9_999.985, ""), (10_000.02, "file-differs"), (9_999.98, "file-beyond")]
)
def test_how_far_head_and_data_may_differ(tmp_path, stop, code):
    """Half of the second decimal, and a millionth of the depth: 16 mm at 10 km; nothing is missing of data beyond."""
    write_las(SurveyFile(md=[0.0, 10_000.0], tvd=[0.0, 9_000.0]), tmp_path / "a.las")
    text = (tmp_path / "a.las").read_text()
    line = next(line for line in text.splitlines() if line.startswith("STOP"))
    (tmp_path / "a.las").write_text(text.replace(line, line.replace("10000.0", f"{stop}")))
    if code != "file-differs":
        found = read_las(tmp_path / "a.las")
        assert (found.md[-1], [one.code for one in found.findings]) == (10_000.0, [code] if code else [])
        return
    with refused("file-differs", error=FileError, name="STOP"):
        read_las(tmp_path / "a.las")


LAS_3 = (
    "~V\nVERS. 3.0 :\nWRAP. NO :\nDLM. COMMA :\n~W\nSTRT.M 9 :\nSTOP.M 90 :\nNULL. -999.25 :\n"
    "~Gyro_Definition\nMD.M :\nINC.DEG :\n~Gyro_Data | Gyro_Definition\n0, 1\n30, 2\n"
)


@pytest.mark.parametrize(
    ("more", "sheet", "expected"),
    [
        ("", None, [1.0, 2.0]),
        ("~MWD_Definition\nMD.M :\nINC.DEG :\n~MWD_Data | MWD_Definition\n0, 3\n", None, "input-choice"),
        ("~MWD_Definition\nMD.M :\nINC.DEG :\n~MWD_Data | MWD_Definition\n0, 3\n", "mwd", [3.0]),
        ("~Gyro_Definition\nMD.M :\nINC.DEG :\n~Gyro_Data | Gyro_Definition\n0, 3\n", "gyro", "input-repeated"),
    ],
)
def test_tables_of_las_3_that_are_no_log(tmp_path, more, sheet, expected):
    path = saved(tmp_path / "a.las", LAS_3 + more)
    with reading_with(None, sheet=sheet):
        if isinstance(expected, str):
            with refused(expected, error=FileError):
                read_las(path)
        else:
            assert np.degrees(read_las(path).inclination).tolist() == pytest.approx(expected)


@pytest.mark.parametrize(("head", "rows"), [((60, 0), (0, 30, 60)), ((0, 60), (60, 30, 0)), ((60, 0), (60, 30, 0))])
def test_a_log_from_the_bottom_up_by_its_header_or_by_its_rows(tmp_path, head, rows):
    start = "~V\nVERS. 2.0 :\nWRAP. NO :\n~W\nSTRT.M {} :\nSTOP.M {} :\n~C\nDEPT.M :\nTVD.M :\n~A\n".format(*head)
    path = saved(tmp_path / "a.las", start + "".join(f"{row} {row}\n" for row in rows))
    found = read_las(path)  # without NULL as well
    assert found.md.tolist() == [0.0, 30.0, 60.0]
    assert [one.code for one in found.findings] == ["survey-bottom-up"] * (rows[0] > 0)

"""Files as people have them, after public layouts: each is read at once, or refused for what it is."""

from __future__ import annotations

import codecs
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.holes_csv import read_shots
from inclinometry.files.position_csv import read_well
from inclinometry.files.profile import reading_with, with_constants
from inclinometry.files.six_axis import read_survey
from inclinometry.files.table import read_table
from inclinometry.workflow.check import look
from inclinometry.workflow.convert import format_of

LAS = """# LAS format log file from PETREL
~VERSION INFORMATION
 VERS.   2.0 : CWLS LOG ASCII STANDARD
 WRAP.   NO  :
~WELL INFORMATION
 STRT.FT    0.0 :
 STOP.FT 3000.0 :
 STEP.FT    0.0 :
 NULL.  -999.25 :
~CURVE INFORMATION
 DEPT.F    : Measured depth
 DEVI.DEG  : Hole deviation
 HAZI.DEG  : Hole azimuth
 GR.GAPI   : Gamma
~A
    0.0    0.00    0.0   50.0
 1000.0   10.00   45.0  -999.25
 2000.0 -999.25 -999.25  60.0
 3000.0   20.00   46.0   61.0
"""
LAS_3 = """~VERSION
VERS. 3.0 : CWLS LOG ASCII STANDARD - VERSION 3.0
WRAP. NO : ONE LINE PER DEPTH STEP
DLM . COMMA : DELIMITING CHARACTER
~WELL
STRT.M 0.0 : First depth
STOP.M 2.0 : Last depth
STEP.M 1.0 : Step
NULL. -999.25 : Null value
~LOG_DEFINITION
DEPT.M : Depth {F}
GR.GAPI : Gamma {F}
~LOG_DATA | LOG_DEFINITION
0.0,50.0
1.0,51.0
~INCLINOMETRY_DEFINITION
MD.M : Measured depth {F}
AZIM.DEG : Borehole azimuth {F}
DEVI.DEG : Borehole deviation {F}
~INCLINOMETRY_DATA | INCLINOMETRY_DEFINITION
0.0,45.0,0.0
304.8,45.0,10.0
609.6,46.0,20.0
"""
LISTING = """                                          Survey Report
Company:   X                         Local Co-ordinate Reference:   Well A-1
Well:      A-1                       North Reference:               Grid
Survey
  Measured                          Vertical
   Depth    Inclination   Azimuth    Depth      +N/-S     +E/-W
  (usft)       (°)          (°)      (usft)     (usft)    (usft)
     0.00       0.00        0.00       0.00      0.00      0.00
  1000.00      10.00       45.00     994.93     61.55     61.55
  2000.00      20.00       46.00    1959.63    242.20    246.43
"""
WITS = "&&\n0708 500.0\n0713 1.50\n0714 100.0\n0715 101.2\n!!\n&&\n0708 530.0\n0713 3.50\n0714 99.0\n0715 100.2\n!!\n"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def well(text: str | bytes, name: str, north: str | None = "true", **more: str):
    """Depths in m, angles in degrees, codes of what was found."""
    Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
    with reading_with(None if north is None else with_constants(azimuth_reference=north), **more):
        found = read_well(name)
    angles = np.degrees(found.inclination), np.degrees(found.azimuth)
    return [x.round(6).tolist() for x in (found.md, *angles)], [one.code for one in found.findings]


UPWARDS = LAS[: LAS.index("~A")].replace("STRT.FT    0.0", "STRT.FT 3000.0").replace("STOP.FT 3000.0", "STOP.FT 0.0")
UPWARDS += "\n".join(["~A", *LAS.splitlines()[:-5:-1]]) + "\n"


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        (LAS, ["work-rows-left-out"]),
        (LAS.replace("STOP.FT 3000.0", "STOP.FT 2990.0"), ["file-beyond", "work-rows-left-out"]),
        (UPWARDS, ["survey-bottom-up", "work-rows-left-out"]),
        (codecs.BOM_UTF16_LE + LAS.encode("utf-16-le"), ["work-rows-left-out"]),
        (LAS.replace(" GR.GAPI   : Gamma\n", " GR.GAPI : Gamma\n GR.GAPI : again\n").replace("50.0\n", "50.0 1\n")
         .replace("-999.25\n", "-999.25 1\n").replace("60.0\n", "60.0 1\n").replace("61.0\n", "61.0 1\n"),
         ["table-unused", "work-rows-left-out"]),
    ],
    ids=["comment first", "beyond STOP", "upwards", "UTF-16", "curve twice"],
)  # fmt: skip
def test_las(text, codes):
    stations, found = well(text, "a.las")
    assert stations == [[0.0, 304.8, 914.4], [0.0, 10.0, 20.0], [0.0, 45.0, 46.0]]
    assert sorted(found) == sorted(codes)


def test_las_that_ends_before_stop_is_cut_off():
    with refused("file-differs", error=FileError, name="STOP"):
        well(LAS.replace("STOP.FT 3000.0", "STOP.FT 3100.0"), "a.las")


def test_las_3():
    assert well(LAS_3, "a.las")[0] == [[0.0, 304.8, 609.6], [0.0, 10.0, 20.0], [45.0, 45.0, 46.0]]


def test_names_over_two_lines_below_a_head_that_states_the_north():
    Path("a.txt").write_text(LISTING, encoding="utf-8")
    found = read_well("a.txt")
    assert (found.azimuth_reference, [one.axis for one in found.listed]) == ("grid", ["tvd", "north", "east"])
    np.testing.assert_allclose(found.md, np.array([0.0, 1000.0, 2000.0]) * 1200 / 3937)
    with refused("input-north", error=FileError):
        well(LISTING, "b.txt", "true")


@pytest.mark.parametrize("head", ["Wellpath Report,,\n,,\n", ",,\nWell A,,\n"])
def test_title_filled_up_with_commas(head):
    assert well(f"{head}MD[m],Inc[deg],Azi[deg]\n0,0,0\n30,1,10\n60,2,10\n", "a.csv")[0][0] == [0.0, 30.0, 60.0]


def test_table_anywhere_in_a_workbook():
    from openpyxl import Workbook

    rows = [["MD (m)", "Inc (deg)", "Azi (deg)"], [0, 0, 0], [304.8, 10, 45], [609.6, 20, 46]]
    book = Workbook()
    sheet = book.active
    for row in [[], [None, "Definitive survey"], [], *([None, *row] for row in rows)]:
        sheet.append(row)
    book.save("offset.xlsx")
    assert well(Path("offset.xlsx").read_bytes(), "b.xlsx")[0] == [[0.0, 304.8, 609.6], [0.0, 10.0, 20.0], [0, 45, 46]]
    book = Workbook()
    book.active.title = "Cover"
    book.active.append(["Survey report"])
    second = book.create_sheet("Survey")
    for row in [["Well A-1"], [], *rows]:
        second.append(row)
    book.save("two.xlsx")
    with refused("input-choice", error=FileError):
        well(Path("two.xlsx").read_bytes(), "c.xlsx")
    assert well(Path("two.xlsx").read_bytes(), "c.xlsx", sheet="Survey")[0][0] == [0.0, 304.8, 609.6]


def test_a_well_of_a_sheet():
    from openpyxl import Workbook

    book = Workbook()
    book.active.append(["Report of 2 wells"])
    sheet = book.create_sheet("Surveys")
    for row in [["Well", "MD (m)", "Inc (deg)", "Azi (deg)"], *(["AB"[k // 3], *MEASURED[k % 3]] for k in range(6))]:
        sheet.append(row)
    book.save("a.xlsx")
    assert well(Path("a.xlsx").read_bytes(), "b.xlsx", sheet="Surveys/B")[0][0] == [0.0, 304.8, 609.6]
    with refused("file-surveys", error=FileError, names=("A", "B")):
        well(Path("a.xlsx").read_bytes(), "b.xlsx", sheet="Surveys")
    with refused("input-choice", error=FileError):
        well(Path("a.xlsx").read_bytes(), "b.xlsx", sheet="Survey/B")


MEASURED = [[0, 0, 0], [304.8, 10, 45], [609.6, 20, 46]]


@pytest.mark.parametrize(
    "head",
    [
        [["Survey", None, None, "Remarks"], ["MD (m)", "Inc (deg)", "Azi (deg)", "Remarks"]],
        [["Measured", "Inclination", "Azimuth", None], ["Depth", None, None, None], ["(m)", "(deg)", "(deg)", None]],
        [["Client:", "A", "Magnetic dip:", "60.1°"], ["MD", "Inc", "Azimuth", "Note"], ["( m )", "( deg )", "( deg )"]],
        [["MD (m)", "Inclination (deg)", "Azimuth", None], [None, None, "True (deg)", "Note"]],
    ],
    ids=["groups", "two rows", "form above", "group of one"],
)
def test_merged_headings_of_a_workbook_and_text_below(head):
    from openpyxl import Workbook

    book = Workbook()
    for row in [["Well A-1"], *head, *MEASURED, [], ["Survey tool", None, "A to B"], [None, 0, None, "MWD tool"]]:
        book.active.append(row)
    book.save("a.xlsx")
    stations, found = well(Path("a.xlsx").read_bytes(), "b.xlsx")
    assert (stations, found) == ([[0.0, 304.8, 609.6], [0.0, 10.0, 20.0], [0.0, 45.0, 46.0]], ["table-below"])


@pytest.mark.parametrize("below", ["End of survey\n", "End of survey at 60.0 m\n\nchecked by A, B\n", "TD reached,,\n"])
@pytest.mark.parametrize("mark", [",", " "])
def test_text_below_a_table_is_said_and_text_within_refused(below, mark):
    text = f"MD_m{mark}Inc_deg{mark}Azi_deg\n0{mark}0{mark}0\n30{mark}1{mark}10\n"
    assert well(text + below, "a.csv") == ([[0.0, 30.0], [0.0, 1.0], [0.0, 10.0]], ["table-below"])
    with refused("table-row-width", "input-kind", "table-empty", error=FileError):
        well(f"{text}{below}60{mark}2{mark}10\n", "a.csv")


@pytest.mark.parametrize("row", ["60", "60,2", "60,x,10", "60,nan,nan", "60,2,"])
def test_a_last_row_of_numbers_that_is_cut_off_is_no_text(row):
    with refused("table-row-width", "input-kind", "input-finite", "input-empty", error=FileError):
        well(f"MD_m,Inc_deg,Azi_deg\n0,0,0\n30,1,10\n{row}\n", "a.csv")


def test_record_7_of_wits_needs_no_map():
    stations, found = well(WITS, "a.wits")
    assert stations == [[500.0, 530.0], [1.5, 3.5], [101.2, 100.2]]
    assert found == ["wits-metres"]
    stations, found = well(WITS, "a.wits", units="ft")
    assert (stations[0], found) == ([152.4, 161.544], [])


def test_witsml_takes_its_north_of_the_option():
    stations = "".join(
        f'<trajectoryStation uid="{md}"><md uom="m">{md}</md><incl uom="dega">{md / 100}</incl>'
        f'<azi uom="dega">{azi}</azi></trajectoryStation>'
        for md, azi in ((0, 10), (100, 20))
    )
    text = (
        '<trajectorys xmlns="http://www.witsml.org/schemas/1series" version="1.4.1.1">'
        f'<trajectory uidWell="W" uidWellbore="B" uid="T"><name>a</name>{stations}</trajectory></trajectorys>'
    )
    assert well(text, "a.xml", "grid")[0] == [[0.0, 100.0], [0.0, 1.0], [10.0, 20.0]]
    with refused("table-north", error=FileError):
        well(text, "a.xml", None)


PETREL = """# WELL TRACE FROM PETREL
# ANGLES ARE GIVEN IN DEGREES
#=====================================================================
      MD              X              Y        AZIM_TN   INCL    DLS    AZIM_GN
#=====================================================================
 0.00000 450000.00 6700000.00 46.0 0.0 0.0 45.0
 304.800 450018.76 6700018.76 46.0 10.0 0.98 45.0
 609.600 450075.11 6700073.82 47.0 20.0 0.98 46.0
"""


def test_azimuths_from_two_norths_of_which_the_option_chooses():
    for north, azimuths in (("true", [46.0, 46.0, 47.0]), ("grid", [45.0, 45.0, 46.0])):
        assert well(PETREL, "a.txt", north, units="m,deg")[0][2] == azimuths
        with reading_with(None, "m,deg"):
            found = read_survey("a.txt", azimuth_reference=north)
        assert np.degrees(found.azimuth).round(6).tolist() == azimuths
    for read in (read_well, read_survey):
        with refused("table-norths", error=FileError, norths=("true", "grid")), reading_with(None, "m,deg"):
            read("a.txt")
    text = "MD (m),Inc (deg),Azi_TN (deg),Azi (deg)\n0,0,1,2\n30,1,3,4\n"
    with refused("table-norths", error=FileError, norths=("Azi_TN (deg)", "Azi (deg)")):
        well(text, "b.csv", None)
    assert [well(text, "b.csv", north)[0][2] for north in ("true", "grid")] == [[1.0, 3.0], [2.0, 4.0]]


@pytest.mark.parametrize(
    "text",
    [
        "MD (m),Inc (deg),Azi (deg),GR,GR\n0,0,0,2,3\n30,1,10,4,5\n",
        "MD (m),Inc (deg),Azi (deg),Note,Note\n0,0,0,a,b\n30,1,10,,\n,,,,\n",
        ",MD (m),Inc (deg),Azi (deg)\n0,0,0,0\n1,30,1,10\n",
        "MD (m),Inc (deg),Azi (deg),DLS\n0,0,0,\n30,1,10,x\n",
    ],
    ids=["a curve twice", "a note twice", "numbers of rows", "a column without unit"],
)
def test_what_is_not_needed_refuses_no_file(text):
    assert well(text, "a.csv")[0] == [[0.0, 30.0], [0.0, 1.0], [0.0, 10.0]]


@pytest.mark.parametrize("name", ["UWI", "wellId", "hid", "BHID", "DDH", "sondaje", "well", "Well_Name", "name"])
def test_wells_of_one_table(name):
    text = f"{name},MD (m),Inc (deg),Azi (deg)\nA,0,0,0\nA,30,1,10\nB,0,0,0\nB,40,2,20\n"
    Path("a.csv").write_text(text)
    assert {hole: len(rows) for hole, rows in read_shots("a.csv").rows.items()} == {"A": 2, "B": 2}
    if name != "name":
        assert well(text, "a.csv", sheet="B")[0][0] == [0.0, 40.0]
        with refused("file-surveys", error=FileError, names=("A", "B")):
            well(text, "a.csv")


def test_names_of_stations_are_no_holes():
    Path("a.csv").write_text("Name,MD (m),Dip (deg),Azi (deg)\nP1,0,-60,0\nP2,30,-60,10\n")
    with refused("file-column hole", error=FileError):
        read_shots("a.csv")


def test_holes_with_the_column_that_position_demands():
    text = "HoleID,Depth (m),Dip (deg),Azimuth (deg),azimuth_reference\nA,0,-60,90,magnetic\nA,30,-60,90,{}\n"
    Path("a.csv").write_text(text.format("magnetic"))
    assert list(read_shots("a.csv").rows) == ["A"]
    Path("a.csv").write_text(text.format("true"))
    with refused("input-north", error=FileError):
        read_shots("a.csv")


SHOT = "{k}, -645, {k}22, 23102, 10209, -5068, 21364, {group}, 0.00, 0.00, 0.00, 0.3000, {status}\n"


def test_deleted_shots_and_second_sensors_are_left_out_and_said():
    shots = [SHOT.format(k=k, group=-1 if k == 3 else 1, status=int(k in (3, 4))) for k in range(1, 7)]
    Path("deleted.csv").write_text("# cal1\n" + "".join(shots))
    Path("two.csv").write_text("# cal1\n" + "".join(shot + "1, 2, 3, 4, 5, 6\n" for shot in shots[:2]))
    with reading_with("topodroid"):
        deleted, two = read_table("deleted.csv"), read_table("two.csv")
    assert (len(deleted), [(one.code, one.values) for one in deleted.findings]) == (
        4,
        [("table-deleted", {"count": 2})],
    )
    assert (len(two), [(one.code, one.values) for one in two.findings]) == (2, [("table-second-set", {"count": 2})])


SIX = ("mag_x", "mag_y", "mag_z", "accel_x", "accel_y", "accel_z")


@pytest.mark.parametrize(
    ("text", "given", "names"),
    [
        ("mX,mY,mZ,ax,ay,az\n1,2,3,4,5,6\n", {"units": "counts"}, SIX),
        ("mX,mY,mZ,Gx,Gy,Gz\n1,2,3,4,5,6\n", {"units": "counts"}, SIX),
        ("mX (LSB),mY (LSB),mZ (LSB),ax (counts),ay (counts),az (counts)\n1,2,3,4,5,6\n", {}, SIX),
        ("gx,gy,gz,ax,ay,az\n1,2,3,4,5,6\n", {"units": "counts"}, ("gyro_x", "gyro_y", "gyro_z", *SIX[3:])),
        ("Started\nRaw:1,2,3,4,5,6,7,8,9\nUni:0.1,0.2,9.8,0,0,0,1,2,3\n\n", {"profile": "motioncal"},
         (*SIX[3:], "gyro_x", "gyro_y", "gyro_z", *SIX[:3])),
    ],
)  # fmt: skip
def test_sensors_in_counts(text, given, names):
    Path("a.csv").write_text(text)
    with reading_with(given.get("profile"), given.get("units")):
        found = read_table("a.csv")
    assert (found.names, len(found)) == (names, 1)


def test_names_of_a_profile_in_small_letters():
    Path("a.json").write_text('[{"gx": 1, "gy": 2, "gz": 3, "mx": 4, "my": 5, "mz": 6}]')
    with reading_with("mag-accel-counts"):
        assert read_table("a.json").names == ("accel_x", "accel_y", "accel_z", "mag_x", "mag_y", "mag_z")


def archive(member: str) -> bytes:
    with zipfile.ZipFile(packed := io.BytesIO(), "w") as file:
        file.writestr(member, "<x/>")
    return packed.getvalue()


@pytest.mark.parametrize(
    ("name", "start", "kind"),
    [
        ("a.min", b" Format                 IAGA-2002               |\nDATE TIME DOY BOUH\n1 2 3 4\n",
         "IAGA-2002"),
        ("a.dlis", b"   1V1.00RECORD 8192Default\0", "DLIS"),
        ("a.top", b"Top\x03\0\0", "PocketTopo"),
        ("a.sgy", ("C 1 CLIENT".ljust(80) + "C 2 LINE".ljust(80)).encode("cp500"), "SEG-Y"),
        ("b.sgy", ("C 1 CLIENT".ljust(80) + "C 2 LINE".ljust(80)).encode() + b"\0", "SEG-Y"),
        ("a.pdf", b"%PDF-1.7\n", "PDF"),
        ("a.docx", archive("word/document.xml"), "Word"),
        ("a.kmz", archive("doc.kml"), "KMZ"),
        ("a.zip", archive("survey.csv"), "ZIP"),
        ("a.ods", archive("content.xml"), "OpenDocument"),
        ("a.png", b"\x89PNG\r\n\x1a\n\0", "PNG"),
        ("a.shp", b"\0\0\x27\x0a\0", "Shapefile"),
        ("a.gdb", b"\x11\0\x55", "Geosoft"),
        ("a.kml", b'<?xml version="1.0"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"/>', "KML"),
        ("a.xml", b'<?xml version="1.0"?>\n<logs xmlns="http://www.witsml.org/schemas/1series"/>', "XML"),
        ("a.json", b'{ "type": "FeatureCollection", "features": [] }', "GeoJSON"),
        ("a.html", b"<!DOCTYPE html><html>", "HTML"),
        ("a.dxf", b"  0\nSECTION\n  2\nHEADER\n", "DXF"),
        ("a.ags", b'"GROUP","PROJ"\n"HEADING","PROJ_ID"\n', "AGS"),
        ("a.bag", b"#ROSBAG V2.0\n", "ROS bag"),
        ("a.tar", b"survey.csv".ljust(257, b"\0") + b"ustar", "tar"),
    ],
)  # fmt: skip
def test_formats_that_are_not_read_are_named(name, start, kind):
    Path(name).write_bytes(start)
    for read in (look, read_well):
        with refused("file-kind", error=FileError, format=kind):
            read(name)


def test_convert_names_a_format_that_is_not_read():
    Path("a.pdf").write_bytes(b"%PDF-1.7\n")
    with refused("file-kind", error=FileError, format="PDF"):
        format_of("a.pdf")


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("Dear colleague,\nplease find the survey of A-1, of 2024-01-03.\nAzimuths are grid; call me.\n", "file-empty"),
        ("import numpy as np\n\ndef f(x, y):\n    return x + y\n\nprint(f(1, 2), 'a', 3)\n", "file-empty"),
        ("[tool]\nname = A\nport = 3\n[log]\nlevel = 2\n", "file-empty"),
        ("1.0\nUndefined\nA-1 450000.0 6700000.0 25.0\n0.0 6700000.0 0.0 0.0\n0.1 6700000.0 30.0 1.0\n",
         "table-names-numbers"),
        ("CAVE\nSURVEY NAME: A\n\nFROM TO LENGTH BEARING INC LEFT\n\nA2 A1 12.0 135.0 5.0 0.0\n", "table-legs"),
        ("#UNITS FEET ORDER=DAV\nA1 A2 12.3 45 -3\n", "table-legs"),
    ],
)  # fmt: skip
def test_texts_without_a_table_are_named(text, code):
    Path("a.txt").write_text(text)
    with refused(code, error=FileError):
        read_well("a.txt")


def test_survex_is_named():
    with refused("table-legs", error=FileError) as stop:
        well("; upper series\n\n*begin upper\n1\t2\t2.83\t329\t-04\n*end upper\n", "a.svx")
    assert stop.value.line == 3

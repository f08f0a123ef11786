"""Surveys in workbooks: values, not formulas; the sheet and the row of whatever is wrong."""

import base64
import datetime
import re
import zipfile
import zlib

import numpy as np
import openpyxl
import pytest
from openpyxl.chart import BarChart
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files import excel
from inclinometry.files.excel import sheet_blocks, write_excel
from inclinometry.files.profile import Profile, reading_with
from inclinometry.files.six_axis import read_excel, read_survey
from inclinometry.files.survey_file import SurveyFile
from inclinometry.workflow.convert import convert

from .surveys import same, survey

NAMES = ["md_m", "inclination_deg", "crew"]


@pytest.fixture
def book(tmp_path):
    def of(*rows, sheet="run 1", more=()):
        path = tmp_path / "a.xlsx"
        workbook = openpyxl.Workbook()
        workbook.active.title = sheet
        for row in rows:
            workbook.active.append(row)
        for title, content in more:
            other = workbook.create_sheet(title)
            for row in content:
                other.append(row)
        workbook.save(path)
        return path

    return of


def repacked(path, to, change):
    """A copy of a workbook, its parts (name -> bytes) changed; of some it may have none."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(to, "w") as archive:
        for name, data in change(parts).items():
            archive.writestr(name, data)
    return to


SHEET = "xl/worksheets/sheet1.xml"


def full():
    texts = {"crew": ("=1+1", "@SUM(A1)", "-2"), "Temp": ("+x", "#N/A", "")}
    return survey(extra=texts, header={"well": "=HYPERLINK(1)", "note": "two\nlines"})


def test_round_trip(tmp_path):
    write_excel(full(), tmp_path / "a.xlsx")
    found = read_excel(tmp_path / "a.xlsx")
    assert same(found, full(), rtol=1e-12)
    assert dict(found.header) == dict(full().header)
    assert found.digest.startswith("sha256:")


def test_no_text_becomes_a_formula(tmp_path):
    write_excel(full(), tmp_path / "a.xlsx")
    workbook = openpyxl.load_workbook(tmp_path / "a.xlsx")
    cells = [cell for sheet in workbook for row in sheet.iter_rows() for cell in row if cell.value is not None]
    assert {cell.data_type for cell in cells} == {"s", "n"}
    risky = [cell for cell in cells if isinstance(cell.value, str) and cell.value[0] in "=+-@"]
    assert len(risky) == 5
    assert all(cell.quotePrefix for cell in risky)
    with zipfile.ZipFile(tmp_path / "a.xlsx") as archive:
        assert not any(b"<f>" in archive.read(name) for name in archive.namelist())


def test_first_sheet_or_the_one_named(book):
    path = book(NAMES, [0, 1, "A"], more=[("run 2", [["MD (ft)", "Inc (deg)"], [100, 2], [200, 3]])])
    assert read_excel(path).extra["crew"] == ("A",)
    np.testing.assert_allclose(read_excel(path, sheet="run 2").md, [30.48, 60.96])
    with refused("input-choice", error=FileError, name="sheet"):
        read_excel(path, sheet="run 3")


def test_empty_rows_and_columns_around_the_table(book):
    path = book([], NAMES, [None, None, None], [0, 1, 7], [30, None, True], [None, "", ""])
    found = read_excel(path)
    np.testing.assert_allclose(np.degrees(found.inclination), [1.0, np.nan])
    assert found.extra["crew"] == ("7", "1")


def test_times_of_excel(book):
    path = book(["md_m", "tvd_m", "time"], [1, 1, datetime.datetime(2026, 1, 2, 3, 4, 5)])
    assert read_excel(path).times == ("2026-01-02T03:04:05",)


def test_cached_results_of_formulas_are_read(book, tmp_path):
    path = book(NAMES, [0, 1, "A"], [30, "=B2*2", "A"])
    with refused("table-formula", error=FileError):
        read_excel(path)

    for more in ([], [[60, 3, "A"]]):  # a row of nothing else
        with refused("table-formula", error=FileError):
            read_excel(book(NAMES, [0, 1, "A"], ["=30", "=B2*2", None], *more))
    path = book(NAMES, [0, 1, "A"], [30, "=B2*2", "A"])

    def computed(parts):
        """What Excel does when it saves: the result beside the formula."""
        sheet, count = re.subn(rb"<f>B2\*2</f><v( ?/>|></v>)", b"<f>B2*2</f><v>2</v>", parts[SHEET])
        assert count == 1
        return parts | {SHEET: sheet}

    found = read_excel(repacked(path, tmp_path / "b.xlsx", computed))
    np.testing.assert_allclose(np.degrees(found.inclination), [1.0, 2.0])


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([], "file-empty"),
        ([NAMES, [0, "#DIV/0!", "A"]], "input-kind inclination_deg"),
        ([NAMES, [0, True, "A"]], "input-kind inclination_deg"),
        ([NAMES, [0, datetime.date(2026, 5, 1), "A"]], "input-kind inclination_deg"),
        ([NAMES, [0, 1, "A"], [], [30, 181, "A"]], "input-value inclination_deg"),
    ],
)
def test_refusals(book, rows, words):
    with refused(words, error=FileError):
        read_excel(book(*rows))


def test_merged_names(tmp_path):
    workbook = openpyxl.Workbook()
    sheet = workbook.active
    sheet.append(["md_m", "accelerometer (g)", None, None])
    sheet.append(["", "x", "y", "z"])
    sheet.append([0, 0, 0, 1])
    sheet.merge_cells("B1:D1")
    workbook.save(tmp_path / "a.xlsx")
    assert read_excel(tmp_path / "a.xlsx").g.tolist() == [[0.0, 0.0, 9.80665]]


def test_files_that_are_no_workbooks(tmp_path):
    write_excel(full(), tmp_path / "a.xlsx")
    whole = (tmp_path / "a.xlsx").read_bytes()
    cases = {
        "text": b"md_m,tvd_m\n0,0\n", "empty": b"", "old": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600),
        "half": whole[: len(whole) // 2],
    }  # fmt: skip
    for name, data in cases.items():
        (tmp_path / name).write_bytes(data)
        with refused("file-format", "file-kind", error=FileError):
            read_excel(tmp_path / name)
    with refused("file-absent", error=FileError):
        read_excel(tmp_path / "none.xlsx")
    with zipfile.ZipFile(tmp_path / "zip", "w") as archive:
        archive.writestr("a.txt", "no workbook")
    with refused("file-kind", error=FileError, format="ZIP"):
        read_excel(tmp_path / "zip")


def test_every_part_of_a_workbook_may_be_damaged(tmp_path):
    write_excel(full(), tmp_path / "a.xlsx")
    for broken in ("xl/workbook.xml", SHEET, "[Content_Types].xml", "xl/styles.xml"):
        for content in (None, b"<broken", b""):

            def change(parts, broken=broken, content=content):
                return {k: v for k, v in (parts | {broken: content}).items() if v is not None}

            try:
                read_excel(repacked(tmp_path / "a.xlsx", tmp_path / "b.xlsx", change))  # styles are not needed
            except FileError:
                continue
            assert broken == "xl/styles.xml"


def test_what_a_workbook_cannot_hold(tmp_path, monkeypatch):
    with refused("file-characters"):
        write_excel(SurveyFile(md=[0], tvd=[0], extra={"a": ("\x07",)}), tmp_path / "a.xlsx")
    monkeypatch.setattr(excel, "ROWS", 3)
    with refused("file-large"):
        write_excel(full(), tmp_path / "a.xlsx")
    monkeypatch.setattr(excel, "LONGEST_TEXT", 3)
    with refused("file-large"):
        write_excel(SurveyFile(md=[0], tvd=[0], extra={"a": ("long",)}), tmp_path / "a.xlsx")
    assert not (tmp_path / "a.xlsx").exists()


def test_a_bomb_is_not_unpacked(tmp_path, monkeypatch):
    write_excel(full(), tmp_path / "a.xlsx")
    monkeypatch.setattr(excel, "_UNPACKED", 1000)
    with refused("file-large", error=FileError):
        read_excel(tmp_path / "a.xlsx")


def test_texts_of_the_head_may_be_empty_and_more_may_stand_beside_them(book):
    head = [["name", "text"], ["well", "A-1"], ["crew", None], [None, "of nothing"], ["run", 3, "a remark"]]
    path = book(NAMES, [0, 1, "A"], more=[("header", head)])
    assert dict(read_excel(path).header) == {"well": "A-1", "crew": "", "run": "3"}
    # another program's sheet of that name is none of ours
    assert dict(read_excel(book(NAMES, [0, 1, "A"], more=[("header", [["key", "text"], *head[1:]])])).header) == {}


def test_standard_uncertainties_are_numbers(tmp_path):
    file = SurveyFile(md=[0.0, 30.0], sigma={"azimuth": [0.01, np.nan], "inclination": [0.001, 0.002]})
    write_excel(file, tmp_path / "a.xlsx")
    rows = list(openpyxl.load_workbook(tmp_path / "a.xlsx")["survey"].iter_rows(values_only=True))
    assert rows[0] == ("md_m", "u_inclination_deg", "u_azimuth_deg")
    assert [type(cell) for cell in rows[1][1:]] == [float, float]
    assert rows[2][2] is None
    assert same(read_excel(tmp_path / "a.xlsx"), file)


def test_a_row_number_that_no_sheet_has(book):
    def change(parts):
        sheet = parts[SHEET].replace(b'r="2"', b'r="1000000000"').replace(b"A2", b"A1000000000")
        return parts | {SHEET: sheet}

    path = book(["md_m", "tvd_m"], [1, 2])
    with refused("file-large", error=FileError):
        read_excel(repacked(path, path, change))


def test_the_last_row_of_a_sheet_is_read(book, monkeypatch):
    path = book(["md_m", "tvd_m"], [1, 2], [3, 4])
    monkeypatch.setattr(excel, "ROWS", 3)
    assert read_excel(path).md.tolist() == [1.0, 3.0]
    monkeypatch.setattr(excel, "ROWS", 2)
    with refused("file-large", error=FileError):
        read_excel(path)


def test_sheets_that_are_no_tables(tmp_path, book):
    workbook = openpyxl.Workbook()
    workbook.create_chartsheet("picture").add_chart(BarChart())
    for row in (NAMES, [0, 1, "A"]):
        workbook.active.append(row)
    workbook.save(tmp_path / "chart.xlsx")
    with refused("input-choice", error=FileError):
        read_excel(tmp_path / "chart.xlsx", sheet="picture")


def test_the_first_sheet_as_it_is(book, monkeypatch):
    """Rows have their numbers, numbers every digit, whatever the blocks."""
    path = book(["md_m", " a  b "], [0.1, None], [], [], [1 / 3, "x\ny"], [True, 2])
    rows = [["md_m", "a b"], [0.1], [], [], [1 / 3, "x y"], [True, 2]]
    assert [(block.first, block.lines) for block in sheet_blocks(path)] == [(1, rows)]
    monkeypatch.setattr(excel, "BLOCK", 2)
    assert [(block.first, block.lines) for block in sheet_blocks(path)] == [
        (1, rows[:2]),
        (3, rows[2:5]),
        (6, rows[5:]),
    ]


def test_other_ways_to_fill_a_sheet(book):
    """A title, a row of units, numbers as texts: as in any table."""
    for rows in ([["Survey of well A", None, None], NAMES, [0, 1, "A"]], [["md", "inc", "crew"], ["m", "deg", ""]]):
        assert np.degrees(read_excel(book(*rows, [30, "1,5", "A"])).inclination[-1]) == pytest.approx(1.5)


def test_under_a_profile_a_workbook_is_a_table_as_any_other(book):
    path = book(["ACME", None], ["Depth", "Incl"], [10, 1.5], [20, 2.5])
    with reading_with(Profile(skip=1, columns={"Depth": "md_m", "Incl": "inclination_deg"})):
        found = read_survey(path)
    np.testing.assert_allclose(found.md, [10.0, 20.0])
    np.testing.assert_allclose(np.degrees(found.inclination), [1.5, 2.5])


def test_a_workbook_that_unpacks_to_little_for_its_size(tmp_path, monkeypatch):
    """What packs a thousandfold is refused from 200 MB on; a text of that size in 10 MB is not."""
    write_excel(full(), tmp_path / "a.xlsx")
    sizes = {"plain": (250_000_000, 5_000_000), "bomb": (250_000_000, 4_000_000), "small": (150_000_000, 1_000_000)}
    for name, (unpacked, packed) in sizes.items():
        entry = zipfile.ZipInfo("x")
        entry.file_size, entry.compress_size = unpacked, packed
        monkeypatch.setattr(zipfile.ZipFile, "infolist", lambda self, entry=entry: [entry])
        if name == "bomb":
            with refused("file-large", error=FileError):
                read_excel(tmp_path / "a.xlsx")
        else:
            assert len(read_excel(tmp_path / "a.xlsx")) == 3


# two sheets of Excel 97: a cover; a title, names in row 3 and two stations, of xlwt
OLD_WORKBOOK = (
    "c-rk)O=uHA6#izj+a@JRliG@{P(s0))_N#jywn)c77s183KbPJZ5JttNm**4xmc|^3W6uaOQ9DpRWJTf1-*F?DtZtEA<=^ePlAGn"
    "HtU<WyD_ObG@w<>e#^Xh^X9$z*?Dhfc3-W8^9%Re3Rs5&@Ste=P*)}slzdJh1gbYp$vU~0lIh~Vg3n6}S*Kw+@UmX6p<M3*6x>sv"
    "69qm{I)f<;Wzu?N6LE;gkPvbVeL^MQQ*fJ75Uo6}CZ^*|w=uoTx=)xMWXUzAeWaTgr?3(m>fUer@kynF>w-iD9<t3lmh_?pFQgw|"
    "x-KkT4RK>Kk@`0)+EqUmK`S?)r*$Kd%A=W<a1r0k2=LX3)n^e`zPWM%l7Fw1*H@9>P*h+J<~bo9F^2$(9$BMdJTs#kIr7jGniZGF"
    "FB&uY>?-;>M(s4BPi2g0KQOANQezoIkHq)(l6>%RBzmEXHtVD5@kn$+KQH-scGBX>(KE>gxtnwJhbp2!z%k(`I)O&!!yFkQ+TU02"
    "e0e=MHXJ+4k~!Y-t#e_QoCr)@mKJ0jEY(=Fn=SS*y~3^TWWJ4QGfkNC&fylD>7Qqvt6bYj{p@4BiR~`qqr~SvAA8iE`xxsYerceP"
    "ZC-jCTR;b$Qxjw_pLz6%9&ziY#N(Kg3wsB7&$RWI-NdVe?6I5n;n#>YG%y>sPDrH*52PyXHb1c$Z<QSa>Xv(}!q!lDc9j|mYe;I9"
    "<oolKN(z<KQprOl&2G!HuC1ro!Lo2!ixyR&DPF4c@JOVsTE$jn{Vdbdilm>G9b475WzRr0&v4<wg$oxhT)6oA5Pb82eNVFPmh!$@"
    "Z~xa>qf~T%lWbXxAVbeIeU=_UnsNiPHTlnWXu@erY|zH}Unnt3y&FhkjK`6z*?;MKLzK^F!-k>X7ecl6U#w-Ef4Ki2x%dJG"
)


def test_a_workbook_of_excel_97(tmp_path):
    path = tmp_path / "a.xls"
    path.write_bytes(zlib.decompress(base64.b85decode(OLD_WORKBOOK)))
    found = read_excel(path, sheet="Survey", azimuth_reference="true")
    assert (found.md.tolist(), np.degrees(found.azimuth).round(6).tolist()) == ([0.0, 30.0], [0.0, 120.25])
    assert found.extra["ok"] == ("1", "1")
    with refused("input-choice", error=FileError, allowed=("Survey",)):
        read_excel(path)
    with refused("file-ending", error=FileError):
        convert(path, tmp_path / "b.xls", sheet="Survey", azimuth_reference="true")

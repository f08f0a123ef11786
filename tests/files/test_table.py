"""The one reader of tables: every dialect it accepts, every error with its place, and nothing but FileError."""

from __future__ import annotations

import gzip
import json
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import coded, refused

from inclinometry.digest import digest_file
from inclinometry.errors import FileError
from inclinometry.files.bench_csv import read_bench, read_plan
from inclinometry.files.columns import numbers_among
from inclinometry.files.log_csv import read_log
from inclinometry.files.profile import reading_with
from inclinometry.files.survey_csv import read_raw_survey, read_survey_csv
from inclinometry.files.table import read_table

from .surveys import saved

LAS_HEAD = "~V\nVERS. 2.0 :\nWRAP. NO :\n~W\nSTRT.m 30 :\nSTOP.m 60 :\nNULL. -999.25 :\n~C\n"
PLAIN = "station,azimuth_deg,mag_x\nA,1.5,-2\nB,2.25,3e2\n"


def read(folder, content):
    path = folder / "t.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_table(path)


def wrong(folder, content):
    """Code, values and line of the refusal."""
    with pytest.raises(FileError) as caught:
        read(folder, content)
    found = caught.value.finding
    return found.code, found.values, caught.value.line


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.rstrip("\n"),
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", " , "),
        PLAIN.replace("\n", ",\n"),
        PLAIN + ",,\n\n   \n",
        "# made on a bench\n#;;;\n\n" + PLAIN + "# the end\n",
        PLAIN.replace("A", '"A"').replace("1.5", '"1.5"'),
        PLAIN.replace("1.5", '"1,5"').replace("2.25", '"2,25"'),
        PLAIN.encode("utf-8-sig"),
        "sep=;\n" + PLAIN.replace(",", ";"),
        PLAIN.encode("utf-16"),
        b"\xfe\xff" + PLAIN.encode("utf-16-be"),
    ],
)
def test_dialects_read_alike(tmp_path, content):
    table = read(tmp_path, content)
    assert table.names == ("station", "azimuth_deg", "mag_x")
    assert table.text("station") == ("A", "B")
    assert table.number("azimuth_deg").tolist() == [1.5, 2.25]
    assert table.number("mag_x").tolist() == [-2.0, 300.0]
    assert table.digest == digest_file(tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("content", "code", "line"),
    [
        (b"", "file-empty", None),
        ("\n\n# only a comment\n", "file-empty", None),
        ("mag_x,mag_y\n", "file-empty", 1),
        ("mag_x,mag_x\n1,2\n", "input-repeated", 1),
        ("mag_x,,mag_y\n1,2,3\n", "table-unnamed", 1),
        ("1,2\n3,4\n", "table-names-numbers", 1),
        ("mag_x,mag_y\n1,2\n1,abc\n", "input-kind", 3),
        ("mag_x,mag_y\n1,1_000\n", "input-kind", 2),
        ("mag_x,mag_y\n1,١\n", "input-kind", 2),
        ("mag_x,mag_y\n1,nan\n", "input-finite", 2),
        ("mag_x,mag_y\n1,-inf\n", "input-finite", 2),
        ("mag_x,mag_y\n1,1e999\n", "input-finite", 2),
        ("mag_x,mag_y\n1,2\n3,\n", "table-empty", 3),
        ("mag_x,mag_y\n1,2\n\n3\n", "table-row-width", 4),
        ("mag_x;mag_y\n1;2;3\n", "table-row-width", 2),
        ("mag_x,mag_y\n1,2,3\n", "table-row-width", 2),
        ("mag_x;mag_y\n1.234,5;2\n", "table-thousands", 2),
        ("mag_x;mag_y\n1,234,567;2\n", "table-thousands", 2),
        ("mag_x;mag_y\n1,234;2,345\n", "table-decimal", 2),
        ("mag_x;mag_y\n1,5;2\n1;2.5\n", "table-decimal-mixed", 2),
        ("mag_x;mag_y\n2.5;2\n1,5;2\n", "table-decimal-mixed", 3),
        ("mag_x;mag_y,mag_z\n1;2,3\n", "table-separators", 1),
        ('mag_x,mag_y\n1,"2\n3,4\n', "table-quote", 2),
        ("station,mag_y\n#1,2\n", "table-comment", 2),
        (gzip.compress(b"mag_x\n1\n" * 9, mtime=0)[:-12], "file-format", None),
        (b"PK\x03\x04rest", "file-format", None),
        (b"mag_x\n1\n\xff\n", "input-kind", 3),
        (b"mag_x\n1\n\xff\xf1\x81\n", "file-text", 3),
        ("mag_x\n1\n".encode("utf-16-le"), "file-text", None),
        (b"\xff\xfe\x00\x00m\x00\x00\x00", "file-text", None),
        (b"\xff\xfem\x00a", "file-text", 1),
        (b"mag_x\n" + b"1" * 3_000_000, "file-large", 2),
        ("mag_x\n" + "x" * 200_000 + "\n", "file-format", 2),
    ],
)
def test_errors_name_the_place_and_the_remedy(tmp_path, content, code, line):
    assert wrong(tmp_path, content)[::2] == (code, line)


def test_files_that_are_none(tmp_path):
    for path, words in (
        (tmp_path / "none.csv", "file-absent"),
        (tmp_path, "file-not-file"),
        ("a\0b", "file-unreadable"),
    ):
        with refused(words, error=FileError):
            read_table(path)


@pytest.mark.parametrize(
    ("header", "name", "words"),
    [
        ("inclination", "inclination_deg", "table-unit-missing"),
        ("azimuth_mrad", "azimuth_deg", "table-near"),
        ("toolface_dg", "toolface_deg", "table-near"),
        ("inclination,azimuth_mrad", "temperature_degC", "file-column"),
        ("rollset", "roll_set", "table-near"),
        ("inclin_angle_deg", "inclination_deg", "table-near"),
    ],
)
def test_a_missing_column_says_what_to_do(tmp_path, header, name, words):
    table = read(tmp_path, f"{header},incl_x\n{'a,' * header.count(',')}b,c\n")
    with refused(words, error=FileError):
        table.require([name])


def test_gaps_only_where_allowed(tmp_path):
    path = tmp_path / "t.csv"
    with refused("input-finite", error=FileError, name="mag_y"):
        read_table(saved(path, "mag_x,mag_y\n1,\n,nan\n"), gaps=["mag_x", "mag_y"])
    path.write_text("mag_x,mag_y\n1,\n,2\n")
    assert np.isnan(read_table(path, gaps=["mag_x", "mag_y"]).number("mag_y")).tolist() == [True, False]


@pytest.mark.long
def test_line_numbers_survive_blank_lines_comments_and_blocks(tmp_path):
    # three blocks of a megabyte; line k holds k, every seventh line is blank or a comment
    rows = ["mag_x,station"] + [f"{k},{'s' * 60}" if k % 7 else ("" if k % 2 else "# c") for k in range(2, 50_000)]
    table = read(tmp_path, "\r\n".join(rows))
    np.testing.assert_array_equal(table.lines, table.number("mag_x"))
    rows[40_000 - 1] = "oops,x"
    assert wrong(tmp_path, "\n".join(rows)) == (
        "input-kind",
        {"name": "mag_x", "value": "oops", "expected": "number"},
        40000,
    )


def test_decimal_comma_in_later_blocks(tmp_path):
    rows = ["station;mag_x"] + [f"{'s' * 60};{k},5" for k in range(40_000)]
    np.testing.assert_array_equal(read(tmp_path, "\n".join(rows)).number("mag_x"), np.arange(40_000) + 0.5)
    rows[30_000] = "s;1.5"
    code, values, _ = wrong(tmp_path, "\n".join(rows))
    assert (code, values["row"], values["other"]) == ("table-decimal-mixed", 30001, "1.5")


@pytest.mark.long
def test_progress_reaches_the_size(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("mag_x\n" + "1\n" * 700_000)
    seen = []
    read_table(path, seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == path.stat().st_size


def test_kinds_of_columns(tmp_path):
    table = read(tmp_path, "operator,mag_x\nAnn,1\n")
    with refused("input-kind", error=FileError, name="operator"):
        table.number("operator")
    assert table.text("mag_x") == ("1.0",)
    assert "mag_x" in table
    assert 1 not in table


def test_columns_are_read_only(tmp_path):
    with pytest.raises(ValueError, match="read-only"):
        read(tmp_path, PLAIN).number("mag_x")[0] = 1.0


READERS = (read_table, read_bench, read_raw_survey, read_survey_csv, read_plan, read_log)
HEADERS = (
    "station,azimuth_deg,inclination_deg,toolface_deg,accel_x,accel_y,accel_x_sd,accel_y_sd,count,roll_set",
    "md_m;mag_1;mag_2;temperature_degC",
    "time_s,gyro_x,gyro_y,gyro_z",
    "azimuth_deg\tinclination_deg\ttoolface_deg",
)
CELL = st.one_of(
    st.floats(allow_nan=True).map(repr),
    st.integers(-400, 400).map(str),
    st.sampled_from(["", " ", "1,5", "1.234,5", "#", '"', "nan", "1_0", "x", "\ufeff", "\x1c", "\u2028"]),
)


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=300))
@example(b"\xff\xfe")
@example(b"\xef\xbb\xbf")
@example(b"accel_x,accel_y\n1e308,1\n-1e308,2\n")
def test_any_bytes_give_a_table_or_a_file_error(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(data)
    for reader in READERS:
        with suppress(FileError):
            reader(path)


@pytest.mark.long
@settings(max_examples=300, deadline=None)
@given(st.data())
def test_any_cells_give_readings_or_a_file_error(tmp_path_factory, data):
    header = data.draw(st.sampled_from(HEADERS))
    mark = next(m for m in ",;\t" if m in header)
    width = header.count(mark) + 1
    rows = data.draw(st.lists(st.lists(CELL, min_size=width, max_size=width), max_size=6))
    path = tmp_path_factory.getbasetemp() / "cells.csv"
    path.write_bytes("\n".join([header, *(mark.join(row) for row in rows)]).encode())
    for reader in READERS:
        with suppress(FileError):
            reader(path)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
def test_numbers_read_back_to_the_bit(tmp_path_factory, values):
    path = tmp_path_factory.getbasetemp() / "bits.csv"
    path.write_text("mag_x\n" + "\n".join(map(repr, values)) + "\n")
    assert read_table(path).number("mag_x").tobytes() == np.array(values, dtype=float).tobytes()


def test_blocks_converted_at_once_are_the_same_to_the_bit(tmp_path, monkeypatch):
    rng = np.random.default_rng(5)
    values = rng.normal(size=(60_000, 3)) * 10.0 ** rng.integers(-9, 9, (60_000, 1))
    lines = [f"{a!r},s_{k % 7} µ,{b!r},{c!r}" for k, (a, b, c) in enumerate(values.tolist())]
    lines[50_000] = "1e-3,,+2.5,-.5"  # the careful way for its block
    quick = read_table(saved(tmp_path / "a.csv", "accel_x,operator,accel_y,accel_z\n" + "\n".join(lines) + "\n"))
    monkeypatch.setattr("inclinometry.files.table_formats.TextTable._quickly", lambda self, block: None)
    careful = read_table(tmp_path / "a.csv")
    for name in ("accel_x", "accel_y", "accel_z"):
        assert quick.number(name).tobytes() == careful.number(name).tobytes()
    assert quick.text("operator") == careful.text("operator")
    assert quick.lines.tolist() == careful.lines.tolist()
    assert quick.number("accel_y")[50_000] == 2.5


@pytest.fixture(scope="module")
def long_table(tmp_path_factory):
    """400,000 rows of two columns, and where in the file the second cell of line 390,002 stands, four characters."""
    path, head, row = tmp_path_factory.mktemp("long") / "a.csv", "accel_x,accel_y\n", "1.5,2.50\n"
    path.write_text(head + row * 400_000)
    return path, len(head) + 390_000 * len(row) + len("1.5,")


@pytest.mark.parametrize("cell", ["x", "nan", "", "1,5"])
def test_a_bad_cell_far_down_is_named_with_its_line(long_table, cell):
    path, place = long_table
    with path.open("r+") as stream:
        stream.seek(place)
        stream.write(cell.ljust(4))
    with refused("input-kind", "input-finite", "table-empty", "table-row-width", error=FileError):
        read_table(path)


def test_thousands_before_a_point_are_no_guess(tmp_path):
    (tmp_path / "a.txt").write_text('md_m,mag_y\n900.00,1\n"1,200.50",2\n"12,345,678.",3\n')
    assert read_table(tmp_path / "a.txt").number("md_m").tolist() == [900.0, 1200.5, 12345678.0]


@pytest.mark.parametrize("name", ["Prüfung", "Größe", "Température", "±5 °C"])
def test_western_letters_of_a_program_that_knows_no_utf_8(tmp_path, name):
    (tmp_path / "a.csv").write_bytes(f"mag_x,{name}\n1,2\n".encode("cp1252"))
    table = read_table(tmp_path / "a.csv")
    assert (table.names, coded(table.findings)) == (("mag_x", name), ["file-encoding"])


HEADINGS = {
    "cp1251 cp866 koi8-r": ("Глубина (м)", "Зенитный угол (град)", "Азимут (град)"),
    "gb18030 gbk": ("井深(米)", "井斜角(度)", "方位角(度)"),
}


@pytest.mark.parametrize("ending", ["csv", "las", "json"])
@pytest.mark.parametrize(("encoding", "names"), [(one, n) for e, n in HEADINGS.items() for one in e.split()])
def test_headings_of_an_old_program_make_words_in_one_encoding(tmp_path, encoding, names, ending):
    table = ",".join(names) + "\n30,1.5,120\n60,2.5,121\n"
    if ending == "las":
        curves = "".join(f"{name.rstrip(')').replace('(', '.')} :\n" for name in names)
        table = LAS_HEAD + curves + "~A\n" + table.partition("\n")[2].replace(",", " ")
    elif ending == "json":
        table = json.dumps(dict(zip(names, [[30, 60], [1.5, 2.5], [120, 121]], strict=True)), ensure_ascii=False)
    (tmp_path / f"a.{ending}").write_bytes(table.encode(encoding))
    found = read_table(tmp_path / f"a.{ending}", numeric=numbers_among(("md_m", "inclination_deg", "azimuth_deg")))
    assert found.number("azimuth_deg").tolist() == [120.0, 121.0]
    assert [(one.code, one.severity) for one in found.findings] == [("file-encoding", "note")]


@pytest.mark.parametrize(
    ("name", "encoding"),
    [("тест", "utf-8"), ("Глубина", "utf-8"), ("温度计", "utf-8"), ("шум", "cp1251"), ("Ð×Þ", "cp1252")],
)
def test_an_encoding_that_is_not_sure_is_stated(tmp_path, name, encoding):
    # UTF-8 with one damaged byte stays UTF-8
    damaged = b"\xe9" if encoding == "utf-8" else b""
    (tmp_path / "a.csv").write_bytes(f"mag_x,{name}\n1,2\n".encode(encoding) + damaged)
    assert wrong(tmp_path, (tmp_path / "a.csv").read_bytes())[0] == "file-text"
    if not damaged:
        (tmp_path / "p.toml").write_text(f'encoding = "{encoding}"\n')
        with reading_with(tmp_path / "p.toml"):
            table = read_table(tmp_path / "a.csv")
        assert (table.names, table.findings) == (("mag_x", name), ())


@pytest.mark.parametrize("count", [20, 21])
def test_twenty_names_are_shown(tmp_path, count):
    names = [f"n{k}" for k in range(count)]
    with refused("file-column", error=FileError, present=tuple(names[:20])):
        read(tmp_path, ",".join(names) + "\n" + ",".join("x" * count) + "\n").require(["md_m"])


def test_a_thousand_columns_are_allowed(tmp_path):
    names = [f"n{k}" for k in range(1001)]
    assert len(read(tmp_path, ",".join(names[:1000]) + "\n" + ",".join("x" * 1000) + "\n").names) == 1000
    code, values, line = wrong(tmp_path, "# wide\n" + ",".join(names) + "\n")
    assert (code, values["size"], values["most"], line) == ("file-large", 1001, 1000, 2)


@pytest.mark.parametrize("first", ["sep=,\n", "sep=\n", "SEP=,\n\n# made by hand\n"])
def test_what_a_spreadsheet_puts_on_top_is_no_header(tmp_path, first):
    told = []
    table = read_table(saved(tmp_path / "t.csv", first + PLAIN), told.append)
    assert table.names == ("station", "azimuth_deg", "mag_x")
    assert table.header_line == first.count("\n") + 1
    assert table.lines.tolist() == [table.header_line + 1, table.header_line + 2]
    assert told == [len(first + PLAIN)]  # every byte


def test_where_a_long_text_or_a_quote_stands(tmp_path):
    for count, shown in ((41, "x" * 37 + "..."), (40, "x" * 40)):
        found = wrong(tmp_path, f"mag_x\n1\n{'x' * count}\n")
        assert found == ("input-kind", {"name": "mag_x", "value": shown, "expected": "number"}, 3)
    assert wrong(tmp_path, 'mag_x,crew\n1,"a"\n2,b\n3,"c\n4,d\n')[::2] == ("table-quote", 4)
    code, values, line = wrong(tmp_path, b"mag_x,crew\n1,\xc3\xa9\n2,a\n3,\xe9\n4,b\n")
    assert (code, "0xe9" in values["reason"], line) == ("file-text", True, 4)


def test_rows_of_a_table_that_are_kept(tmp_path):
    kept = read(tmp_path, PLAIN + "C,3,4\n").rows(np.array([True, False, True]))
    assert (kept.text("station"), kept.number("azimuth_deg").tolist(), len(kept)) == (("A", "C"), [1.5, 3.0], 2)
    assert kept.lines.tolist() == [2, 4]
    with pytest.raises(ValueError, match="read-only"):
        kept.number("mag_x")[0] = 1.0


def test_numbers_that_stand_for_nothing_at_their_limits(tmp_path):
    """One value of a channel may be -999.25, one angle or two channels in a row may not; half a null is a value."""
    assert read(tmp_path, "mag_x,mag_y\n-999.25,1\n2,-999.25\n").number("mag_x")[0] == -999.25
    assert read(tmp_path, "mag_x,mag_y\n-999,-999\n").number("mag_y")[0] == -999.0
    found = wrong(tmp_path, "mag_x,mag_y\n1,2\n-999.25,-9999.25\n")
    assert found == ("table-null", {"column": "mag_x", "value": -999.25}, 3)
    assert wrong(tmp_path, "mag_x,azimuth_deg\n1,-999.25\n")[::2] == ("table-null", 2)
    with reading_with(None, null=-1.0):
        assert read(tmp_path, "mag_x,azimuth_deg\n5,-999.25\n").number("azimuth_deg")[0] == -999.25
        assert wrong(tmp_path, "mag_x\n5\n-1\n") == ("table-empty", {"column": "mag_x"}, 3)

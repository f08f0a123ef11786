"""Surveys as Parquet: types checked, units from the name or the metadata."""

import datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.parquet import write_parquet
from inclinometry.files.run_file import open_run
from inclinometry.files.six_axis import read_parquet
from inclinometry.files.survey_file import SurveyFile

from .surveys import same, survey


@pytest.fixture
def write(tmp_path):
    def of(columns, units=None):
        table = pa.table(columns)
        for place, name in enumerate(table.column_names):
            if units and name in units:
                field = table.schema.field(place).with_metadata({"unit": units[name]})
                table = table.set_column(place, field, table.column(place))
        pq.write_table(table, tmp_path / "a.parquet")
        return tmp_path / "a.parquet"

    return of


def full():
    rates, header = 1e-5 * np.arange(9.0).reshape(3, 3), {"well": "ü-1", "note": "two\nlines"}
    return survey(w=rates, extra={"crew": ("A", "", "ü")}, header=header)


def test_round_trip(tmp_path):
    write_parquet(full(), tmp_path / "a.parquet")
    found = read_parquet(tmp_path / "a.parquet")
    assert same(found, full(), rtol=1e-12)
    assert dict(found.header) == dict(full().header)


def test_units_and_types_are_in_the_schema(tmp_path):
    write_parquet(full(), tmp_path / "a.parquet")
    schema = pq.read_schema(tmp_path / "a.parquet")
    assert schema.field("gx_m_s2").metadata == {b"unit": b"m/s2"}
    assert schema.field("md_m").type == pa.float64()
    assert schema.field("used").type == pa.bool_()
    table = pq.read_table(tmp_path / "a.parquet")
    assert table.column("inclination_deg").null_count == 1


def test_units_may_stand_in_the_metadata(write):
    columns = {"Depth": [100, 200], "AX": [0.0, 0.0], "AY": [0.0, 0.0], "AZ": [1.0, 1.0]}
    found = read_parquet(write(columns, {"Depth": "ft", "AX": "g", "AY": "g", "AZ": "g"}))
    np.testing.assert_allclose(found.md, [30.48, 60.96])
    np.testing.assert_allclose(found.g[:, 2], 9.80665)


def test_types_of_other_writers(write):
    times = [datetime.datetime(2026, 1, 2, 3, 4, 5, tzinfo=datetime.UTC), None]
    columns = {
        "md_m": pa.array([1, 2], pa.int32()),
        "tvd_m": pa.array([1.5, 2.5], pa.float32()),
        "north_m": pa.array([None, None]),
        "time": pa.array(times),
        "used": pa.array([True, True]),
        "crew": pa.array(["A", None]).dictionary_encode(),
        "count": pa.array([7, 8]),
    }
    found = read_parquet(write(columns))
    np.testing.assert_array_equal(found.tvd, [1.5, 2.5])
    assert found.north is None
    assert found.times == ("2026-01-02T03:04:05+00:00", "")
    assert found.extra == {"crew": ("A", ""), "count": ("7", "8")}
    assert found.used.all()


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"md_m": [1.0], "tvd_m": [True]}, "input-kind tvd_m"),
        ({"md_m": [1.0], "tvd_m": [[1.0]]}, "input-kind tvd_m"),
        ({"md_m": [1.0], "tvd_m": [1.0], "blob": [b"1"]}, "input-kind blob"),
        ({"md_m": [1.0], "tvd": [1.0]}, "table-unit-missing"),
        ({"md_m": [1.0, 1.0], "tvd_m": [1.0, 1.0]}, "input-order"),
        ({"md_m": [1.0, 2.0], "tvd_m": [1.0, float("inf")]}, "input-finite tvd_m"),
        ({"md_m": pa.array([], pa.float64())}, "file-empty"),
        ({}, "file-empty"),
    ],
)
def test_refusals(write, columns, words):
    with refused(words, error=FileError):
        read_parquet(write(columns))


def test_a_unit_that_contradicts_the_name(write):
    with refused("table-units", error=FileError):
        read_parquet(write({"md_m": [1.0], "tvd_m": [1.0]}, {"md_m": "ft"}))


def test_damaged_files(tmp_path):
    write_parquet(full(), tmp_path / "a.parquet")
    whole = (tmp_path / "a.parquet").read_bytes()
    damaged = bytearray(whole)
    damaged[10:200] = bytes(190)
    for data in (b"", b"PAR1", b"md_m\n1\n", whole[: len(whole) // 2], whole[40:], bytes(damaged)):
        (tmp_path / "b.parquet").write_bytes(data)
        with refused("file-format", error=FileError):
            read_parquet(tmp_path / "b.parquet")
    with refused("file-absent", error=FileError):
        read_parquet(tmp_path / "c.parquet")
    with refused("file-not-file", error=FileError):
        read_parquet(tmp_path)


@pytest.mark.parametrize("header", [b"{", b"[1]"])
def test_a_damaged_header(tmp_path, header):
    table = pa.table({"md_m": [1.0], "tvd_m": [1.0]}).replace_schema_metadata({b"inclinometry.header": header})
    pq.write_table(table, tmp_path / "a.parquet")
    with refused("file-format", "input-kind", error=FileError):
        read_parquet(tmp_path / "a.parquet")


def test_a_million_stations(tmp_path):
    md = np.arange(1_000_000) * 0.01
    write_parquet(SurveyFile(md=md, inclination=np.full(len(md), 0.5)), tmp_path / "a.parquet")
    assert len(read_parquet(tmp_path / "a.parquet")) == 1_000_000


def test_standard_uncertainties_are_numbers(tmp_path):
    sigma = {name: np.radians([0.1, 0.2, np.nan]) for name in ("inclination", "azimuth", "toolface")}
    file = SurveyFile(md=[0.0, 30.0, 60.0], sigma=sigma)
    write_parquet(file, tmp_path / "a.parquet")
    schema = pq.read_schema(tmp_path / "a.parquet")
    for name in sigma:
        field = schema.field(f"u_{name}_deg")
        assert (field.type, field.metadata) == (pa.float64(), {b"unit": b"deg"})
    assert same(read_parquet(tmp_path / "a.parquet"), file)


@pytest.mark.parametrize(
    ("names", "read"),
    [(("md_m", "tvd_m"), read_parquet), (("time_s", "mag_x", "mag_y"), lambda path: list(open_run(path).blocks()))],
)
def test_a_page_that_was_changed_is_found_by_its_checksum(tmp_path, names, read):
    """Not packed, so that nothing else would notice."""
    path, values = tmp_path / "a.parquet", np.arange(1000.0)
    table = pa.table(dict.fromkeys(names, values))
    pq.write_table(
        table, path, compression="none", use_dictionary=False, write_page_checksum=True, write_statistics=False
    )
    read(path)
    old, new = values[500].tobytes(), np.float64(500.5).tobytes()
    path.write_bytes(path.read_bytes().replace(old, new))
    with refused("file-format", error=FileError) as caught:
        read(path)
    assert caught.value.finding.values["reason"]


def test_names_twice_and_texts_that_are_damaged(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.Table.from_arrays([pa.array([1.0, 2.0])] * 3, names=["md_m", "tvd_m", "tvd_m"]), path)
    with refused("input-repeated", error=FileError):
        read_parquet(path)
    pq.write_table(pa.table({"md_m": [1.0, 2.0], "tvd_m": [1.0, 2.0], "crew": ["AAAA", "BBBB"]}), path,
                   compression="none", use_dictionary=False)  # fmt: skip
    path.write_bytes(path.read_bytes().replace(b"BBBB", b"BB\xff\xff"))
    with refused("file-text", error=FileError):
        read_parquet(path)

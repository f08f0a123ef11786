"""The attitude table: its contract, and both forms alike."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.attitude_file import COLUMNS, read_attitude, write_attitude
from inclinometry.motion.result import BITS, METHODS, AttitudeRows
from inclinometry.rotations import dcm, quaternion_from_dcm

QUATERNION = quaternion_from_dcm(dcm(*np.radians([60.0, 30.0, 0.0])))


@pytest.fixture
def rows():
    angles = np.radians([[30.0, 60.0, 359.99999999999994], [np.nan] * 3, [0.5, 120.0, 10.0]])
    small = np.radians([[0.02, 0.05, 0.03], [np.nan] * 3, [0.02, 4.0, 4.0]])
    return AttitudeRows(
        np.array([5.0, 15.0, 25.0]),
        *angles.T,
        *small.T,
        rate=np.array([4 * np.pi, np.nan, 0.0]),
        quality=np.array([0.8, 0.0, 0.5]),
        flags=np.array([0, BITS["clipped"] | BITS["gap"], BITS["vertical"]], dtype=np.uint32),
        method=np.array([METHODS.index("magnetic")] * 2 + [METHODS.index("gyro")], dtype=np.uint8),
        north=np.array([2, 2, 1], dtype=np.uint8),
        quaternion=np.array([QUATERNION, [np.nan] * 4, [1.0, 0.0, 0.0, 0.0]]),
        magnetic_toolface=np.radians([57.0, np.nan, 130.0]),
        u_magnetic_toolface=np.radians([0.04, np.nan, 0.05]),
    )


def test_the_contract_of_csv(rows, tmp_path):
    write_attitude(rows, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as stream:
        found = list(csv.DictReader(stream))
    assert tuple(found[0]) == COLUMNS
    assert found[0] == {
        "time_s": "5", "inclination_deg": "30", "azimuth_deg": "60", "azimuth_reference": "grid", "toolface_deg": "0",
        "u_inclination_deg": "0.02", "u_azimuth_deg": "0.05", "u_toolface_deg": "0.03", "rpm": "120",
        "method": "magnetic", "quality": "0.8", "flags": "",
        "q_w": "0.836516303738", "q_x": "0.129409522551", "q_y": "-0.224143868042", "q_z": "-0.482962913145",
        "magnetic_toolface_deg": "57", "u_magnetic_toolface_deg": "0.04", "toolface_type": "gravity",
        "u_common_inclination_deg": "0.02", "u_common_azimuth_deg": "0.05", "u_common_toolface_deg": "0.03",
        "u_random_inclination_deg": "0", "u_random_azimuth_deg": "0", "u_random_toolface_deg": "0",
    }  # fmt: skip
    # the hole of the third row is steeper than 5 degrees, that of the second is not known
    assert [row["toolface_type"] for row in found] == ["gravity", "", "magnetic"]
    assert found[1]["inclination_deg"] == found[1]["u_azimuth_deg"] == found[1]["rpm"] == ""
    assert found[1]["flags"] == "clipped|gap"
    assert found[2]["azimuth_reference"] == "true"


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_both_forms_come_back(rows, tmp_path, ending):
    write_attitude(rows, tmp_path / f"a.{ending}")
    back = read_attitude(tmp_path / f"a.{ending}")
    for name in ("inclination", "azimuth", "u_toolface", "rate", "quality", "time"):
        # written in degrees rounded to 1e-10
        np.testing.assert_allclose(getattr(back, name), getattr(rows, name), atol=1e-11, equal_nan=True)
    for name in ("flags", "method", "north"):
        assert np.array_equal(getattr(back, name), getattr(rows, name))


def test_parquet_keeps_units_and_digests(rows, tmp_path):
    write_attitude(rows, tmp_path / "a.parquet", {"run": "sha256:00"})
    schema = pq.read_schema(tmp_path / "a.parquet")
    assert tuple(schema.names) == COLUMNS
    assert schema.field("u_azimuth_deg").metadata == {b"unit": b"deg"}
    header = json.loads(schema.metadata[b"inclinometry.header"])
    assert header == {"schema": "inclinometry/attitude", "version": "1", "run": "sha256:00"}


def test_what_is_refused(rows, tmp_path):
    with refused("file-ending", error=FileError, ending=".txt", allowed=(".parquet", ".csv")):
        write_attitude(rows, tmp_path / "a.txt")
    write_attitude(rows, tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text()
    for old, new, code in (
        (",magnetic,", ",guessed,", "input-choice method"),
        ("clipped", "bent", "input-choice flag"),
        ("grid", "up", "input-choice azimuth_reference"),
    ):
        (tmp_path / "b.csv").write_text(text.replace(old, new, 1))
        with refused(code, error=FileError):
            read_attitude(tmp_path / "b.csv")


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_older_files_had_no_quaternion(rows, tmp_path, ending):
    """It is that of the angles; of the magnetic toolface nothing is known, and of the uncertainty all is common."""
    write_attitude(rows, tmp_path / f"a.{ending}")
    if ending == "csv":
        with (tmp_path / "a.csv").open(newline="") as stream:
            cells = [row[:12] for row in csv.reader(stream)]
        (tmp_path / "a.csv").write_text("\n".join(map(",".join, cells)) + "\n")
    else:
        pq.write_table(pq.read_table(tmp_path / "a.parquet").select(list(COLUMNS[:12])), tmp_path / "a.parquet")
    back = read_attitude(tmp_path / f"a.{ending}")
    turned = quaternion_from_dcm(dcm(*np.radians([120.0, 0.5, 10.0])))
    np.testing.assert_allclose(back.quaternion, [QUATERNION, [np.nan] * 4, turned], atol=1e-11)
    assert np.isnan(back.magnetic_toolface).all()
    np.testing.assert_array_equal(back.u_common_azimuth, back.u_azimuth)
    assert back.names(1) == ("clipped", "gap") or back.names(1) == ("gap", "clipped")


def test_the_common_part_of_the_uncertainty_is_kept(rows, tmp_path):
    told = replace(rows, u_common_azimuth=0.6 * rows.u_azimuth)
    for ending in ("csv", "parquet"):
        write_attitude(told, tmp_path / f"a.{ending}")
        back = read_attitude(tmp_path / f"a.{ending}")
        np.testing.assert_allclose(back.u_common_azimuth, told.u_common_azimuth, atol=1e-11)
        np.testing.assert_allclose(back.u_random_azimuth, 0.8 * rows.u_azimuth, atol=1e-11)
        np.testing.assert_allclose(back.magnetic_toolface, rows.magnetic_toolface, atol=1e-11)


def test_digits_that_are_written(rows, tmp_path):
    """Nanoseconds, 1e-10 deg; a turn is written as none, and no zero has a sign."""
    third = replace(rows, time=np.array([1.0, 2.0, 4.0]) / 3.0, rate=np.array([1.0, np.nan, -1e-12]) / 3.0)
    write_attitude(replace(third, quality=np.array([1.0, 0.0, 2.0]) / 3.0), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as stream:
        found = list(csv.DictReader(stream))
    assert [row["time_s"] for row in found] == ["0.333333333", "0.666666667", "1.333333333"]
    assert [row["rpm"] for row in found] == ["3.183099", "", "0"]
    assert [row["quality"] for row in found] == ["0.333333", "0", "0.666667"]

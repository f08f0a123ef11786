"""Steps of a rate table: read exactly, refused with the line and the remedy."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.gyro_csv import looks_like_radians, read_rate_steps

HEADER = "station,inclination_deg,toolface_deg,azimuth_deg,rate_deg_s,temperature_degC,gyro_x,gyro_y,gyro_z"
ROWS = ["a,90,0,,10,20,1,2,3", "b,90,90,,-10,21,4,5,6", "c,0,0,30,0,22,7,8,9"]


@pytest.fixture
def read(tmp_path):
    def of(header=HEADER, rows=ROWS):
        path = tmp_path / "steps.csv"
        path.write_text("\n".join([header, *rows]) + "\n")
        return read_rate_steps(path)

    return of


def test_everything_is_read(read):
    steps = read()
    assert steps.station == ("a", "b", "c")
    assert len(steps) == 3
    np.testing.assert_allclose(np.degrees(steps.rate), [10.0, -10.0, 0.0])
    np.testing.assert_allclose(np.degrees(steps.inclination), [90.0, 90.0, 0.0])
    np.testing.assert_allclose(np.degrees(steps.toolface), [0.0, 90.0, 0.0])
    np.testing.assert_allclose(np.degrees(steps.azimuth), [np.nan, np.nan, 30.0])
    np.testing.assert_array_equal(steps.signals, np.arange(1.0, 10.0).reshape(3, 3))
    np.testing.assert_array_equal(steps.temperature, [20.0, 21.0, 22.0])
    assert (steps.unit, steps.sd, steps.findings) == ("counts", None, ())
    assert len(steps.digest) > 20


def test_what_may_be_left_out(read):
    steps = read("inclination_deg,toolface_deg,rate_deg_s,gyro_x_deg_h,gyro_y_deg_h", ["0,0,5,1,2", "0,0,-5,3,4"])
    assert steps.station == ("1", "2")
    assert steps.unit == "deg/h"
    assert steps.temperature is None
    assert np.isnan(steps.azimuth).all()
    assert steps.findings[0].values["lacking"] == ("gyro_z",)


def test_standard_deviations_and_columns_of_no_use(read):
    header = "inclination_deg,toolface_deg,rate_deg_s,gyro_x,gyro_y,gyro_x_sd,gyro_y_sd,accel_x,accel_y,operator"
    steps = read(header, ["0,0,5,1,2,0.1,0.2,9,9,me", "0,0,-5,3,4,0.1,0.3,9,8,me"])
    np.testing.assert_array_equal(steps.sd, [[0.1, 0.2], [0.1, 0.3]])
    unused = [one.values["names"] for one in steps.findings if one.code == "table-unused"]
    assert unused == [("operator",), ("accel_x", "accel_y")]
    # a mean whose readings did not scatter at all says nothing of its noise
    assert read(header, ["0,0,5,1,2,0.1,0,9,9,me", "0,0,-5,3,4,0.1,0.3,9,8,me"]).sd is None


@pytest.mark.parametrize(
    ("header", "rows", "words"),
    [
        (HEADER, ["a,90,0,,0,20,1,2,3"], "input-needs rate_deg_s = 0"),
        (HEADER.replace("azimuth_deg,", ""), ["a,90,0,0,20,1,2,3"], "input-needs rate_deg_s = 0"),
        (HEADER, ["a,190,0,,5,20,1,2,3"], "input-value inclination_deg"),
        (HEADER, [*ROWS, "d,0,0,,36000,20,1,2,3"], "input-value rate_deg_s"),
        (HEADER, ["a,90,0,,10,,1,2,3"], "table-empty"),
        (HEADER.replace("rate_deg_s", "rate_rad_s"), ROWS, "table-unit"),
        (HEADER.replace("toolface_deg", "face"), ROWS, "file-column toolface_deg"),
        (HEADER.replace("gyro", "mag"), ROWS, "file-column gyro_x"),
        (HEADER, ["a,90,0,,0.17453,20,1,2,3", "b,90,0,,-0.34907,20,1,2,3"], "table-radians"),
    ],
)
def test_refusals(read, header, rows, words):
    with refused(words, error=FileError):
        read(header, rows)


@pytest.mark.parametrize(
    ("rates", "radians"),
    [
        (np.radians([5.0, -5.0, 10.0, 60.0]), True),
        (np.radians([5.0, 10.0]).round(4), True),
        ([5.0, -5.0, 10.0], False),
        ([0.5, 1.0, 2.0], False),  # may be either: believed
        ([0.1745, -0.1745], False),  # one speed proves nothing
        ([0.0, 0.0], False),
        ([4.1781e-3, 8.3562e-3], False),  # the Earth's rate and its double
    ],
)
def test_what_looks_like_radians(rates, radians):
    assert looks_like_radians(np.asarray(rates)) is radians


def test_steps_that_are_left_out_and_the_axes_of_the_columns(read):
    kept = read().without([1])
    assert (kept.station, kept.lines, len(kept)) == (("a", "c"), (2, 4), 2)
    np.testing.assert_allclose(np.degrees(kept.rate), [10.0, 0.0])
    np.testing.assert_array_equal(kept.signals, [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0]])
    np.testing.assert_array_equal(kept.temperature, [20.0, 22.0])
    assert kept.sd is None
    assert read().axes == "xyz"
    assert read("inclination_deg,toolface_deg,rate_deg_s,gyro_x,gyro_y", ["0,0,5,1,2"]).axes == "xy"
    assert read("inclination_deg,toolface_deg,rate_deg_s,gyro_1,gyro_2", ["0,0,5,1,2"]).axes is None

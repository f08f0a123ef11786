"""Gyro runs that cannot be right: refused in one sentence that names the cause."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.errors import FileError, InputError
from inclinometry.workflow.gyro import GyroOptions, north_run

DEG_H = np.radians(1.0) / 3600.0
HERE = Site(latitude=np.pi / 4, north_reference="true")


def channels(**change):
    """An edit of the columns: kind -> function of its channels."""
    return lambda c: {"channels": {k: change.get(k, lambda v: v)(v) for k, v in c["channels"].items()}}


SWAP = {"accelerometer": lambda v: v[:, ::-1], "gyro": lambda v: v[:, ::-1]}


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (channels(accelerometer=np.negative), "specific force"),
        (channels(gyro=np.negative), "reversed sign"),
        (channels(accelerometer=SWAP["accelerometer"]), "accelerometer channels follow the index only if"),
        (channels(gyro=SWAP["gyro"]), "gyro channels follow the index only if"),
        (channels(**SWAP), "are x and y swapped"),
        (lambda c: {"index": -c["index"]}, "counted the other way|order"),
        (lambda c: {"units": {**c["units"], "gyro": "deg/h"}}, "rad/s given as deg/h"),
        (channels(gyro=lambda v: v * 3600.0), "deg/h given as deg/s|was the bias not removed|Earth rate"),
        (channels(gyro=lambda v: 0.0 * v + 1e-9), "Earth rate"),
        (channels(accelerometer=lambda v: v / 9.80665), "in g, not m/s"),
        (channels(accelerometer=lambda v: v * 102.0), "give its unit in the column's name"),
        (lambda c: {"units": {**c["units"], "gyro": "counts"}}, "give deg/h, deg/s, rad/s in the columns' names"),
        (lambda c: {"time": c["time"][::-1]}, "station '1': time goes from"),
    ],
)
def test_readings_that_cannot_be_right_are_refused(simulated, change, wanted):
    data, _ = simulated(change=change)
    with pytest.raises(FileError, match=wanted) as caught:
        north_run(data, HERE)
    assert "raw.csv" in str(caught.value)


def test_an_index_counted_backwards_is_found_by_any_scheme(simulated):
    data, _ = simulated(change=lambda c: {"index": -c["index"]})
    with pytest.raises(FileError, match="counter-clockwise"):
        north_run(data, HERE, options=GyroOptions(scheme="n"))


@pytest.mark.parametrize("axes", [2, 3])
def test_the_wrong_hemisphere_is_refused(simulated, axes):
    data, _ = simulated(latitude=-np.pi / 4, axes=axes)
    with pytest.raises(FileError, match="latitude given with the wrong sign"):
        north_run(data, HERE)
    assert len(north_run(data, Site(latitude=-np.pi / 4))) == 20


def test_a_latitude_far_off_is_said(simulated):
    data, _ = simulated()
    found = north_run(data, Site(latitude=np.radians(40.0)))
    assert any("+45" in w and w.startswith("latitude") for w in found.survey.warnings)
    # radians in the file of degrees
    with pytest.raises(FileError, match=r"\+4[45]\.\d"):
        north_run(data, Site(latitude=np.radians(0.785)))


@pytest.mark.parametrize("site", [Site(), Site(g=9.81), Site(declination=0.1)])
def test_a_site_without_latitude(simulated, site):
    data, _ = simulated()
    with pytest.raises(InputError, match="latitude"):
        north_run(data, site)


@pytest.mark.parametrize(
    ("scheme", "rows", "wanted"),
    [
        ("four", [0, 1, 2], "station '1': 3 readings at index 0, 90, 180 deg; scheme 'four' needs 0, 90, 180, 270"),
        ("four", [0, 2, 1, 3], "station '1': index positions in the order 0, 180, 90, 270"),
        ("four", [0, 0, 0, 0], "station '1'"),
        ("mirrored", [0, 1, 2, 3], "scheme 'mirrored' needs 0, 90, 180, 270, 270, 180, 90, 0"),
        ("carousel", [0, 1, 2, 3], "scheme 'carousel' needs 8 or more"),
        ("n", [0, 2], "scheme 'n' needs 3 or more"),
    ],
)
def test_positions_that_do_not_make_the_scheme(simulated, scheme, rows, wanted):
    def change(columns):
        keep = [4 * n + row for n in range(20) for row in rows]
        kept = {name: columns[name][keep] for name in ("md", "index", "temperature")}
        kept["station"] = [columns["station"][n] for n in keep]
        return {**kept, "time": None, "channels": {k: v[keep] for k, v in columns["channels"].items()}}

    data, _ = simulated(change=change)
    with pytest.raises(FileError, match=wanted):
        north_run(data, HERE, options=GyroOptions(scheme=scheme))


@pytest.mark.long
def test_a_station_of_a_very_good_gyro_is_not_refused(simulated):
    """Noise of 1e-5 of the Earth rate makes the valleys of the misfit narrow; the right one must still be found."""

    def last(columns):
        kept = {name: columns[name][-4:] for name in ("station", "md", "index", "temperature", "time")}
        return {**kept, "channels": {kind: values[-4:] for kind, values in columns["channels"].items()}}

    for seed in range(30):
        data, run = simulated(seed, last, arw=np.radians(1e-4) / 60.0, accelerometer_noise=1e-5)
        found = north_run(data, HERE)
        assert abs(found.north.inclination[0] - run.inclination[-1]) < 1e-4
        assert not any(check.verdict == "fail" for check in found.checks)

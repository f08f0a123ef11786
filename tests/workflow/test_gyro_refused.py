"""Gyro runs that cannot be right: refused by a code that names the cause."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
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
        (channels(accelerometer=np.negative), "gyro-latitude-sign"),
        (channels(gyro=np.negative), "gyro-latitude-sign"),
        (channels(accelerometer=SWAP["accelerometer"]), "gyro-index-reversed"),
        (channels(gyro=SWAP["gyro"]), "gyro-index-reversed"),
        (channels(**SWAP), "gyro-index-reversed"),
        (lambda c: {"index": -c["index"]}, "gyro-index-reversed"),
        (lambda c: {"units": {**c["units"], "gyro": "deg/h"}}, "gyro-rates-size"),
        (channels(gyro=lambda v: v * 3600.0), "gyro-rates-size"),
        (channels(gyro=lambda v: 0.0 * v + 1e-9), "gyro-fault-value"),
        (channels(accelerometer=lambda v: v / 9.80665), "gyro-accel-in-g"),
        (channels(accelerometer=lambda v: v * 102.0), "gyro-accel-heavy"),
        (lambda c: {"units": {**c["units"], "gyro": "counts"}}, "input-unit"),
        (lambda c: {"time": c["time"][::-1]}, "input-order"),
    ],
)
def test_readings_that_cannot_be_right_are_refused(simulated, change, wanted):
    data, _ = simulated(change=change)
    with pytest.raises(FileError) as caught:
        north_run(data, HERE)
    assert (caught.value.finding.code, caught.value.finding.severity) == (wanted, "refused")
    assert caught.value.path.name == "raw.csv"


def test_an_index_counted_backwards_is_found_by_any_scheme(simulated):
    data, _ = simulated(change=lambda c: {"index": -c["index"]})
    with pytest.raises(FileError) as caught:
        north_run(data, HERE, options=GyroOptions(scheme="n"))
    assert caught.value.finding.values["turns"] == "counterclockwise"


@pytest.mark.parametrize("axes", [2, 3])
def test_the_wrong_hemisphere_is_refused(simulated, axes):
    data, _ = simulated(latitude=-np.pi / 4, axes=axes)
    with pytest.raises(FileError) as caught:
        north_run(data, HERE)
    assert caught.value.finding.values["mistake"][0] == "the latitude"
    assert len(north_run(data, Site(latitude=-np.pi / 4))) == 20


def test_a_latitude_far_off_is_said(simulated):
    data, _ = simulated()
    found = north_run(data, Site(latitude=np.radians(40.0)))
    off = next(one for one in found.survey.findings if one.code == "gyro-latitude-off")
    assert off.values["fitted_deg"] == pytest.approx(45.0, abs=0.5)
    # radians in the file of degrees
    with pytest.raises(FileError) as caught:
        north_run(data, Site(latitude=np.radians(0.785)))
    assert caught.value.finding.code == "gyro-latitude-off"
    assert caught.value.finding.values["fitted_deg"] == pytest.approx(45.0, abs=1.0)


@pytest.mark.parametrize("site", [Site(), Site(g=9.81), Site(declination=0.1)])
def test_a_site_without_latitude(simulated, site):
    data, _ = simulated()
    with refused("input-missing", names=("latitude_deg",)):
        north_run(data, site)


@pytest.mark.parametrize(
    ("scheme", "rows", "wanted"),
    [
        ("four", [0, 1, 2], "gyro-positions-other"),
        ("four", [0, 2, 1, 3], "gyro-positions-other"),
        ("four", [0, 0, 0, 0], "gyro-positions-few"),
        ("mirrored", [0, 1, 2, 3], "gyro-positions-other"),
        ("carousel", [0, 1, 2, 3], "gyro-positions-few"),
        ("n", [0, 2], "gyro-positions-few"),
    ],
)
def test_positions_that_do_not_make_the_scheme(simulated, scheme, rows, wanted):
    def change(columns):
        keep = [4 * n + row for n in range(20) for row in rows]
        kept = {name: columns[name][keep] for name in ("md", "index", "temperature")}
        kept["station"] = [columns["station"][n] for n in keep]
        return {**kept, "time": None, "channels": {k: v[keep] for k, v in columns["channels"].items()}}

    data, _ = simulated(change=change)
    with pytest.raises(FileError) as caught:
        north_run(data, HERE, options=GyroOptions(scheme=scheme))
    assert caught.value.finding.code == wanted
    # as the file calls the station
    assert caught.value.finding.values["station"] == "1"


@pytest.mark.long
def test_a_station_of_a_very_good_gyro_is_not_refused(simulated):
    """Noise of 1e-5 of the Earth rate makes the valleys of the misfit narrow; the right one must still be found."""

    def last(columns):
        kept = {name: columns[name][-4:] for name in ("station", "md", "index", "temperature", "time")}
        return {**kept, "channels": {kind: values[-4:] for kind, values in columns["channels"].items()}}

    for seed in range(30):
        data, run = simulated(seed, last, arw=np.radians(1e-4) / 60.0, accelerometer_noise=1e-5)
        # one station at the end of a hot run: its scale factor is up to 1 % from that at 20 degC
        found = north_run(data, HERE, options=GyroOptions(scale_sd=0.008))
        assert abs(found.north.inclination[0] - run.inclination[-1]) < 1e-4
        assert not any(check.verdict == "fail" for check in found.checks)

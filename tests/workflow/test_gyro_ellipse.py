"""A gyro run's own ellipse: it holds the end of the true well as often as it says, and its file keeps all of it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.errors_json import RunErrors, read_errors, write_errors
from inclinometry.position.propagation import gyro_sources, propagate
from inclinometry.position.well import well_survey
from inclinometry.survey.path import minimum_curvature
from inclinometry.uncertainty import chi_square_limit
from inclinometry.workflow.gyro import GyroOptions, north_run

HERE = Site(latitude=np.pi / 4, north_reference="true")
RATE = np.radians(1.0) / 3600.0


def ellipse(found):
    """Covariance of north and east at the end."""
    survey = found.survey
    well = well_survey(survey.md, survey.inclination, survey.azimuth, HERE)
    return propagate(well, sources=gyro_sources(survey, well)).covariance[-1, :2, :2]


def off(found, run):
    """North and east of the end found less the true ones; the first station is where the well begins."""
    survey = found.survey
    ends = []
    for inclination, azimuth in ((survey.inclination, survey.azimuth), (run.inclination, run.azimuth)):
        begun = [np.append(first[:1], rest[1:]) for first, rest in
                 ((survey.inclination, inclination), (survey.azimuth, azimuth))]  # fmt: skip
        path = minimum_curvature(survey.md, *begun, start=(0.0, 0.0, 0.0))
        ends.append(np.array([path.north[-1], path.east[-1]]))
    return ends[0] - ends[1]


@pytest.mark.long
@pytest.mark.parametrize(
    ("request_", "options"),
    [
        ({}, {"hole": "down", "gravity_sd": 0.0}),
        ({"axes": 3}, {"z_bias_sd": RATE}),
        ({}, {"hole": "down", "gravity_sd": 0.0, "prior": "both"}),
        ({"scenario": "cool"}, {"hole": "down", "gravity_sd": 0.0, "prior": "calibration", "slope_sd": 0.0}),
    ],
)
def test_the_true_end_lies_in_the_ellipse(simulated, request_, options):
    squares = []
    for seed in range(100):
        data, run = simulated(seed, dwell=60.0, stations=30, **request_)
        found = north_run(data, HERE, options=GyroOptions(misalignment=0.0, g_sensitivity=0.0, **options))
        error = off(found, run)
        squares.append(error @ np.linalg.solve(ellipse(found), error))
    # a hundred wells: coverage .95 +- .022, mean of two degrees of freedom 1 +- .1 and, without a scale error to
    # learn, below; the noise is estimated from 240 residuals
    inside = np.mean(np.array(squares) < chi_square_limit(0.95, 2))
    assert inside > 0.95 - 3.0 * 0.022
    assert np.mean(squares) / 2.0 < 1.25


def test_what_stations_share_is_told_from_what_is_their_own(simulated):
    data, _ = simulated(axes=3)
    errors = north_run(data, HERE, options=GyroOptions(z_bias_sd=RATE)).survey.errors
    assert {name for name, one in errors.items() if one.shared} == {
        "accelerometer bias along the tool", "gyro bias along the tool", "scale", "gyro axes",
    }  # fmt: skip
    # a bias along the tool moves the inclination as its sine does, with one sign
    by = errors["accelerometer bias along the tool"].by_parameter[:, 0, 0]
    assert (by < 0.0).all()
    assert np.abs(by[-1]) > np.abs(by[0])


def test_the_causes_make_up_the_stated_uncertainty(simulated):
    data, _ = simulated(axes=3)
    found = north_run(data, HERE, options=GyroOptions(z_bias_sd=RATE))
    for column, stated in ((0, found.survey.u_inclination), (1, found.survey.u_azimuth)):
        total = sum(
            np.einsum("np,pq,nq->n", one.by_parameter[:, column], one.covariance, one.by_parameter[:, column])
            for one in found.survey.errors.values()
        )
        np.testing.assert_allclose(np.sqrt(total), stated, rtol=0.05)


def test_the_file_keeps_all_of_it(simulated, tmp_path):
    data, _ = simulated(axes=3, stations=6)
    survey = north_run(data, HERE, options=GyroOptions(z_bias_sd=RATE)).survey
    run = RunErrors(survey.md, survey.inclination, survey.azimuth, "true", survey.errors)
    write_errors(run, tmp_path / "errors.json")
    back = read_errors(tmp_path / "errors.json")
    assert list(back.errors) == list(survey.errors)
    for name, one in survey.errors.items():
        np.testing.assert_allclose(back.errors[name].by_parameter, one.by_parameter, rtol=1e-12)
        assert back.errors[name].shared == one.shared
    (tmp_path / "errors.json").write_text((tmp_path / "errors.json").read_text().replace('"md_m": [30', '"md_m": [3'))
    well = well_survey(survey.md, survey.inclination, survey.azimuth, HERE)
    with refused("position-depths", station=1, md_m=3.0):
        gyro_sources(read_errors(tmp_path / "errors.json"), well)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"inclinometry/errors"', '"inclinometry/scale"', "gyro north --errors"),
        ('"shared": true', '"shared": 1', "true where the stations of the run share one draw"),
        ('"azimuth_reference": "true"', '"azimuth_reference": "magnetic"', '"true" or "grid"'),
    ],
)
def test_a_wrong_file_is_named(simulated, tmp_path, old, new, says):
    data, _ = simulated(stations=4)
    survey = north_run(data, HERE, options=GyroOptions(hole="down")).survey
    path = tmp_path / "errors.json"
    write_errors(RunErrors(survey.md, survey.inclination, survey.azimuth, "true", survey.errors), path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=says):
        read_errors(path)


def test_the_closed_form_says_nothing_of_what_is_shared(simulated, tmp_path):
    data, _ = simulated(stations=4)
    survey = north_run(data, HERE, options=GyroOptions(method="patent", hole="down")).survey
    with refused("record-errors-unknown"):
        write_errors(RunErrors(survey.md, survey.inclination, survey.azimuth, "true", survey.errors), tmp_path / "e")

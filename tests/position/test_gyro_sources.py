"""Gyro stations as sources of error of a position."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.position.propagation import gyro_sources, propagate
from inclinometry.position.well import well_survey
from inclinometry.survey.reduce import Survey
from inclinometry.uncertainty import AngleErrors

MD = np.arange(0.0, 601.0, 30.0)
INC_SD, AZI_SD = np.radians([0.02, 0.3])


def survey(inclination, azimuth, errors, reference="true"):
    blank, size = np.full(len(MD), np.nan), len(MD)
    columns = (np.full(size, inclination), np.full(size, azimuth), blank, blank, blank, blank, blank)
    return Survey(MD, *columns, {}, reference, [[]] * size, errors=errors)


def cause(inclination, azimuth, shared, sign=1.0):
    """One parameter that moves the inclination, one that moves the azimuth; the hole points to the north."""
    by = np.zeros((len(MD), 4, 2))
    by[:, 0, 0], by[:, 1, 1] = inclination, azimuth * np.asarray(sign)
    by[:, 2, 0], by[:, 3, 1] = inclination, inclination
    return AngleErrors(by, np.eye(2), shared)


def end(inclination, errors):
    well = well_survey(MD, np.full(len(MD), inclination), np.zeros(len(MD)), Site())
    return propagate(well, sources=gyro_sources(survey(inclination, 0.0, errors), well)).covariance[-1]


def test_a_shared_cause_moves_the_end_by_its_lever():
    length, slope = MD[-1] - 15.0, np.radians(50.0)  # all but the half course at the wellhead
    found = end(slope, {"scale": cause(0.0, AZI_SD, True)})
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [0.0, length * np.sin(slope) * AZI_SD, 0.0], atol=1e-12)


def test_a_shared_cause_that_changes_its_sign_half_way_moves_the_end_hardly():
    sign = np.where(np.arange(len(MD)) <= len(MD) // 2, 1.0, -1.0)
    there, back = (end(np.pi / 2, {"scale": cause(0.0, AZI_SD, True, s)})[1, 1] ** 0.5 for s in (1.0, sign))
    assert there == pytest.approx(585.0 * AZI_SD)
    assert back < 30.0 * AZI_SD


def test_inclination_and_azimuth_of_one_cause_stay_correlated():
    one = cause(INC_SD, AZI_SD, True)
    joined = one._replace(by_parameter=one.by_parameter.sum(axis=2, keepdims=True), covariance=np.eye(1))
    found = end(np.pi / 2, {"accelerometer": joined})
    assert found[1, 2] / np.sqrt(found[1, 1] * found[2, 2]) == pytest.approx(-1.0)  # up and to the right, or neither


def test_noise_grows_with_the_root():
    found = end(np.radians(90.0), {"gyro": cause(0.0, AZI_SD, False), "accelerometer": cause(INC_SD, 0.0, False)})
    # twenty courses of 30 m, the last of half a lever, the first station known
    lever = 30.0 * np.sqrt(19 + 0.25)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [0.0, lever * AZI_SD, lever * INC_SD], atol=1e-12)


def test_a_vertical_hole_leans_either_way():
    # of the azimuth nothing is known here, and a vertical hole has none
    found = end(0.0, {"accelerometer": cause(INC_SD, 1e9, False)})
    own = 30.0 * np.sqrt(19 + 0.25) * INC_SD
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [own, own, 0.0], atol=1e-12)


def test_stations_of_the_well_above_the_run_are_left_alone():
    well = well_survey(np.append(-30.0, MD) + 30.0, np.full(len(MD) + 1, 1.0), np.zeros(len(MD) + 1), Site())
    run = survey(1.0, 0.0, {"scale": cause(0.0, AZI_SD, True)})
    moved = Survey(**{**vars(run), "md": MD + 30.0})
    source = gyro_sources(moved, well)[0]
    assert not source.by_angles[0].any()
    assert source.by_angles[1:].any(axis=(1, 2)).all()


def test_wrong_input_is_named():
    well = well_survey(MD + 1.0, np.full(len(MD), 0.5), np.zeros(len(MD)), Site())
    parts = {"gyro": cause(0.0, AZI_SD, False)}
    with refused("position-depths"):
        gyro_sources(survey(0.5, 0.0, parts), well)
    with refused("input-choice", name="azimuth_reference"):
        gyro_sources(survey(0.5, 0.0, parts, "magnetic"), well)
    well = well_survey(MD, np.full(len(MD), 0.5), np.zeros(len(MD)), Site())
    with refused("position-direction"):
        gyro_sources(survey(0.8, 0.0, parts), well)
    with refused("input-missing", names=("errors",)):
        gyro_sources(survey(0.5, 0.0, {}), well)

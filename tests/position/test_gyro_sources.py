"""Gyro stations as sources of error of a position."""

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.position.propagation import gyro_sources, propagate
from inclinometry.position.well import well_survey
from inclinometry.survey.reduce import Survey
from inclinometry.uncertainty import UNKNOWN

MD = np.arange(0.0, 601.0, 30.0)
INC_SD, AZI_SD = np.radians([0.02, 0.3])


def survey(inclination, azimuth, components, reference="true"):
    blank, size = np.full(len(MD), np.nan), len(MD)
    columns = (np.full(size, inclination), np.full(size, azimuth), blank, blank, blank, blank, blank)
    return Survey(MD, *columns, components, reference, [[]] * size)


def variances(inclination_sd, azimuth_sd):
    return np.tile(np.array([inclination_sd, azimuth_sd, 0.0, 0.0]) ** 2, (len(MD), 1))


def end(inclination, components):
    well = well_survey(MD, np.full(len(MD), inclination), np.zeros(len(MD)), Site())
    return propagate(well, sources=gyro_sources(survey(inclination, 0.0, components), well)).covariance[-1]


def test_a_shared_cause_moves_the_end_by_its_lever():
    length, slope = MD[-1] - 15.0, np.radians(50.0)  # all but the half course at the wellhead
    found = end(slope, {"scale": variances(0.0, AZI_SD)})
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [0.0, length * np.sin(slope) * AZI_SD, 0.0], atol=1e-12)


def test_noise_grows_with_the_root():
    found = end(np.radians(90.0), {"gyro": variances(0.0, AZI_SD), "accelerometer": variances(INC_SD, 0.0)})
    # twenty courses of 30 m, the last of half a lever, the first station known
    lever = 30.0 * np.sqrt(19 + 0.25)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [0.0, lever * AZI_SD, lever * INC_SD], atol=1e-12)


def test_a_vertical_hole_leans_either_way():
    # of the azimuth nothing is known here, and a vertical hole has none
    found = end(0.0, {"accelerometer": variances(INC_SD, np.inf), "gyro": variances(0.0, np.nan)})
    own = 30.0 * np.sqrt(19 + 0.25) * INC_SD
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), [own, own, 0.0], atol=1e-12)


def test_an_unknown_azimuth_is_bounded():
    well = well_survey(MD, np.full(len(MD), 0.1), np.zeros(len(MD)), Site())
    source = gyro_sources(survey(0.1, 0.0, {"gyro": variances(0.0, np.inf)}), well)[0]
    assert source.by_angles[3, 2, 1] == UNKNOWN


def test_wrong_input_is_named():
    well = well_survey(MD + 1.0, np.full(len(MD), 0.5), np.zeros(len(MD)), Site())
    parts = {"gyro": variances(0.0, AZI_SD)}
    with pytest.raises(InputError, match="both need the same depths"):
        gyro_sources(survey(0.5, 0.0, parts), well)
    with pytest.raises(InputError, match="from magnetic north"):
        gyro_sources(survey(0.5, 0.0, parts, "magnetic"), well)
    well = well_survey(MD, np.full(len(MD), 0.5), np.zeros(len(MD)), Site())
    with pytest.raises(InputError, match="no uncertainty is known"):
        gyro_sources(survey(0.5, 0.0, {"gyro": np.zeros((len(MD), 4))}), well)

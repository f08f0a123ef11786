"""A survey from six-axis stations is the survey from the raw channels, and keeps what corrections add."""

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.earth.site import Site
from inclinometry.findings import example
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.tool import random_tool
from inclinometry.survey.from_stations import NOISE, survey_from_stations
from inclinometry.survey.from_tool import stations_from_tool, stations_plain
from inclinometry.survey.reduce import reduce_survey
from inclinometry.survey.stations import Source
from inclinometry.uncertainty import UNKNOWN

from .test_from_tool import DIP, surveyed, uncertain

COLUMNS = ("inclination", "azimuth", "toolface", "magnetic_toolface", "g_total", "b_total", "dip")
SITE = Site(
    north_reference="grid",
    declination=np.radians(4.0),
    declination_sigma=np.radians(0.3),
    convergence=np.radians(1.0),
    convergence_sigma=np.radians(0.01),
    g=9.81,
    b=51_000.0,
    dip=DIP,  # tolerances of the dip differ: here with the correlation of the triads, there without
)


@pytest.mark.parametrize("degree", [0, 1])
@pytest.mark.parametrize("site", [None, SITE])
def test_the_same_as_from_the_raw_channels(degree, site):
    tool = replace(uncertain(random_tool(2, temperature_degree=degree), 0.1), temperature_range=(0.0, 60.0))
    heat = np.linspace(10.0, 100.0, 50) if degree else None
    true = surveyed(tool, temperature=heat)
    raw = reduce_survey(true.md, true.signals, tool, temperature=heat, site=site, calibration_dip=DIP)
    stations = stations_from_tool(true.md, true.signals, tool, temperature=heat)
    found = survey_from_stations(stations, site=site, tool=tool, calibration_dip=DIP)
    for name in COLUMNS:
        np.testing.assert_allclose(getattr(found, name), getattr(raw, name), rtol=1e-10, atol=1e-10)
    assert set(found.components) == set(raw.components)
    for name, part in raw.components.items():
        np.testing.assert_allclose(found.components[name], part, rtol=1e-8)
    assert found.azimuth_reference == raw.azimuth_reference
    assert [list(row) for row in found.flags] == [list(row) for row in raw.flags]
    assert found.findings == raw.findings
    assert found.history == stations.history
    assert found.tool == tool.name


def test_many_stations_are_as_few():
    tool = uncertain(random_tool(3))
    true = surveyed(tool, 25_000)
    whole = stations_from_tool(true.md, true.signals, tool)
    few = stations_from_tool(true.md[-3:], {kind: u[-3:] for kind, u in true.signals.items()}, tool)
    one, other = survey_from_stations(whole), survey_from_stations(few)
    np.testing.assert_allclose(one.u_azimuth[-3:], other.u_azimuth, rtol=1e-12)


STEP = example("survey-step")


def test_what_a_correction_leaves_is_a_component():
    stations = stations_plain(
        [0.0, 10.0], [[0, 0, 9.8], [-4.9, 0, 8.5]], [[2e4, 0, 4e4]] * 2, sigma_g=1e-9, sigma_b=10.0
    )
    by_field = np.zeros((2, 6, 1))
    by_field[:, 4] = 1.0  # of the field across the tool
    left = {"left": Source(by_field, np.array([[900.0]]))}
    found = survey_from_stations(stations.corrected(stations.g, stations.b, STEP, left))
    assert found.history == (STEP,)
    assert set(found.components) == {"left", NOISE}
    # across the vertical plane of the tool: 30 nT of the horizontal field
    horizontal = 2e4 * np.cos(found.inclination[1]) + 4e4 * np.sin(found.inclination[1])
    np.testing.assert_allclose(np.sqrt(found.components["left"][1, 1]), 30.0 / horizontal, rtol=1e-12)
    assert found.u_azimuth[0] == UNKNOWN  # exactly vertical
    assert found.flags[0] == ["vertical"]
    np.testing.assert_allclose(found.u("magnetic_toolface")[0], np.hypot(30.0, 10.0) / 2e4, rtol=1e-12)
    clash = stations.corrected(stations.g, stations.b, STEP, {NOISE: left["left"]})
    with refused("input-repeated"):
        survey_from_stations(clash)


def test_strengths_are_held_against_the_site():
    stations = stations_plain([0.0], [[-4.9, 0, 8.487]], [[2e4, 0, 4e4]], sigma_b=10.0)
    here = Site(g=9.8, b=44_721.0, dip=float(np.arcsin((4e4 * 8.487 - 4.9 * 2e4) / (9.8 * 44_721.4))))
    assert survey_from_stations(stations, site=here).flags == [[]]
    assert survey_from_stations(stations, site=replace(here, b=47_000.0)).flags == [["b"]]
    assert survey_from_stations(stations, site=replace(here, g=9.75)).flags == [["g"]]
    assert "dip" in survey_from_stations(stations, site=replace(here, dip=-here.dip)).flags[0]


def test_a_certificate_without_covariance_is_said():
    tool = random_tool(4)
    true = surveyed(tool)
    found = survey_from_stations(stations_from_tool(true.md, true.signals, tool))
    assert found.findings[0].code == "survey-covariance-zero"
    assert set(found.components) == {NOISE}


def test_true_north_is_magnetic_and_declination():
    stations = stations_plain([0.0], [[-4.9, 0, 8.487]], [[2e4, 5e3, 4e4]])
    magnetic = survey_from_stations(stations)
    true = survey_from_stations(stations, site=Site(north_reference="true", declination=0.1))
    np.testing.assert_allclose(wrap_signed(true.azimuth - magnetic.azimuth), 0.1, rtol=1e-12)
    assert "survey-declination-sd" in coded(true.findings)

"""The end of the demo: a magnetised string found, corrected and carried into the ellipse."""

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.files.tool_json import write_calibration
from inclinometry.simulate.bench import Rig
from inclinometry.workflow import simulate
from inclinometry.workflow.demo import AXIAL_NT, survey_demo_well, well_sentences


@pytest.fixture(scope="module")
def well(tmp_path_factory):
    folder = tmp_path_factory.mktemp("well")
    readings, truth, _ = simulate.bench(
        plans.orthogonal(), 5, rig=Rig(dip=np.radians(70.0), setting_sd=np.radians(0.05))
    )
    write_calibration(calibrate_joint(readings), folder / "tool.json")
    run = simulate.well(truth, 6)
    tensor = truth.triads["magnetometer"].tensor[0]
    return survey_demo_well(run, tensor, folder / "tool.json", folder / "out")


def test_the_analysis_finds_the_string_and_the_azimuth_follows(well):
    bias = well.analysis.found.parameters["axial interference"]
    assert abs(bias.value - AXIAL_NT) < 4.0 * bias.u
    raw, better = well.error_deg.values()
    assert better < 0.4 * raw  # 800 nT along the tool cost about 2 deg at 60 deg of inclination
    assert [judged.verdict for judged in well.judged] == ["fail", "pass"]


def test_what_the_analysis_leaves_open_takes_the_place_of_the_interference(well):
    sources = well.position.uncertainty.sources
    assert "multi-station analysis" in sources
    assert not [name for name in sources if name.startswith(("AMI", "calibration"))]


def test_the_end_of_the_well_lies_where_its_ellipse_says(well):
    covariance = well.position.uncertainty.covariance[-1]
    distance = well.off_m @ np.linalg.solve(covariance, well.off_m)
    assert distance < 21.1  # chi-square with three degrees of freedom, once in 10 000
    major, minor = well.ellipse_m
    assert major > minor > 0.0
    assert len(well_sentences(well)) == 3

"""The tool code of a fleet: its terms are the derivatives, its ellipses contain the wells of the fleet's tools."""

import numpy as np
import pytest
from scipy.stats import chi2
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.drift import DriftModel, fit_drift
from inclinometry.calibration.drift_check import plan_information
from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.tool_code_json import load_tool_code, write_tool_code
from inclinometry.history import PARAMETERS
from inclinometry.orientation import angles, fields
from inclinometry.position.fleet_code import _parameters, _weights, at_toolface, fleet_tool_code
from inclinometry.position.propagation import propagate
from inclinometry.position.tool_code import parse
from inclinometry.position.well import well_survey
from inclinometry.simulate.fleet import FleetScene, drift_variance, mounting_variance, simulate_fleet

DIP = np.radians(70.0)
V12 = np.linalg.inv(plan_information(plans.twelve()))


def model_of(drift, reproducibility, sd=0.0):
    return DriftModel(
        "X", drift, reproducibility, np.zeros((24, 2)), 1.0, 1.0, sd, DIP, 200, 1200, "2020-01-01", "2025-01-01",
        "sha256:0",
    )  # fmt: skip


def angles_of(g, b, values):
    """Inclination and azimuth read by a tool with relative parameters (..., 24) in fields (..., 3)."""
    block = values.reshape(*values.shape[:-1], 2, 3, 4)
    read = [
        f + np.einsum("...ij,...j->...i", block[..., k, :, :3], f) + block[..., k, :, 3] for k, f in ((0, g), (1, b))
    ]
    found = angles(*read)
    return np.stack([found.inclination, found.azimuth], axis=-1)


@pytest.mark.parametrize("label", list(_parameters()))
def test_weights_are_the_derivatives_at_the_high_side(label):
    inclination, azimuth = 1.0, 0.7
    g, b = fields(azimuth, inclination, 0.0, DIP)
    moved = _parameters()[label][1]
    step = np.zeros(24)
    for name, size in moved.items():
        step[PARAMETERS.index(name)] = 1e-6 * size
    expected = (angles_of(g, b, step) - angles_of(g, b, -step)) / 2e-6
    known = {"inc": inclination, "azm": azimuth, "azt": azimuth, "dip": DIP}
    found = [float(parse(text).evaluate(known)) for text in _weights(moved)[:2]]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_vertical_weights_are_the_hole_s_direction():
    """Just off the vertical, sin(I) dA and dI as a vector north and east."""
    inclination, azimuth = 1e-3, 0.7
    g, b = fields(azimuth, inclination, 0.0, DIP)
    for _, moved in _parameters().values():
        singular = _weights(moved)[2]
        if singular is None:
            continue
        step = np.zeros(24)
        for name, size in moved.items():
            step[PARAMETERS.index(name)] = 1e-9 * size
        d_i, d_a = (angles_of(g, b, step) - angles_of(g, b, -step)) / 2e-9
        north = np.cos(azimuth) * d_i - np.sin(inclination) * np.sin(azimuth) * d_a
        east = np.sin(azimuth) * d_i + np.sin(inclination) * np.cos(azimuth) * d_a
        found = [float(parse(text).evaluate({"azt": azimuth})) for text in singular[:2]]
        np.testing.assert_allclose(found, [north, east], atol=5e-3)


def test_turning_the_tool_turns_the_parameters():
    values = 1e-6 * np.random.default_rng(1).standard_normal(24)
    turned = fields(0.7, 1.0, 0.6, DIP)
    upright = fields(0.7, 1.0, 0.0, DIP)
    seen = at_toolface(np.array([0.6]))[0] @ values
    np.testing.assert_allclose(angles_of(*turned, values), angles_of(*upright, seen), atol=1e-12)


def test_file_there_and_back(tmp_path):
    made = fleet_tool_code(
        model_of(drift_variance(), mounting_variance()), V12, 2.0, name="X mid-interval",
        beside=load_tool_code("iscwsa-mwd-rev5.1"),
    )  # fmt: skip
    path = tmp_path / "x.json"
    write_tool_code(made.code, path, made.evidence)
    back = load_tool_code(path)
    assert [(t.name, t.magnitude, t.azimuth.text) for t in back.terms] == [
        (t.name, t.magnitude, t.azimuth.text) for t in made.code.terms
    ]
    assert "sha256:0" in back.source
    text = path.read_text()
    assert '"tools": 200' in text
    assert '"calibrations": 1200' in text
    names = {one.name for one in back.terms}
    assert {"DSFS", "ABXH", "MSXYC"} <= names
    assert not {"ABXY-TI1S", "MSXY-TI1S", "ABZ", "MBZ"} & names


def test_refusals(tmp_path):
    with refused("input-value", name="interval"):
        fleet_tool_code(model_of(drift_variance(), np.zeros((24, 24))), V12, 30.0, name="X")
    with refused("position-fleet"):
        fleet_tool_code(model_of(np.zeros((24, 24)), np.zeros((24, 24))), np.zeros((24, 24)), 1.0, name="X")
    made = fleet_tool_code(model_of(drift_variance(), np.zeros((24, 24))), V12, 1.0, name="X")
    with pytest.raises(FileError):
        write_tool_code(made.code, tmp_path / "missing" / "x.json")


def contained(code, covariance, tools, seed):
    """Share of tools, each at a toolface of its own, whose well ends within the 95 % ellipsoid of the code."""
    random = np.random.default_rng(seed)
    md = np.arange(0.0, 3000.1, 30.0)
    inclination = np.radians(np.clip((md - 500.0) / 20.0, 0.02, 60.0))
    azimuth = np.full(len(md), np.radians(70.0))
    site = Site(g=9.81, b=5e4, dip=DIP, declination=0.0)
    survey = well_survey(md, inclination, azimuth, site, "magnetic")
    expected = propagate(survey, code).covariance[-1]
    values, vectors = np.linalg.eigh(covariance)
    drawn = random.standard_normal((tools, 24)) @ (vectors * np.sqrt(np.clip(values, 0.0, None))).T
    toolface = random.uniform(0.0, 2.0 * np.pi, tools)
    upright = np.einsum("npq,nq->np", at_toolface(toolface), drawn)
    g, b = fields(azimuth, inclination, 0.0, DIP)
    read = angles_of(g, b, upright[:, None, :])

    def end(angle):
        i, a = angle[..., 0], angle[..., 1]
        along = np.stack([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)], axis=-1)
        return (0.5 * 30.0 * (along[..., 1:, :] + along[..., :-1, :])).sum(axis=-2)

    off = end(read) - end(np.stack([inclination, azimuth], axis=-1))
    # a course more or less of the first station: the model takes the wellhead's attitude otherwise
    distance = np.einsum("ni,ij,nj->n", off, np.linalg.inv(expected), off)
    return float((distance < chi2.ppf(0.95, 3)).mean())


def test_ellipsoids_contain_the_wells_of_the_type():
    """9-fleet.md, 5: 94 to 96 % of 10,000 drawn tools, the type's covariance known."""
    made = fleet_tool_code(model_of(drift_variance(), mounting_variance()), V12, 2.0, name="X")
    assert 0.94 < contained(made.code, made.covariance, 10_000, 1) < 0.96


@pytest.mark.long
def test_ellipsoids_from_an_estimated_fleet_contain_the_wells():
    """The same with Q and R from 200 simulated tools, against tools drawn from the truth."""
    fleet = simulate_fleet(FleetScene(200, V12, mounting=mounting_variance()), seed=5)
    model = fit_drift(fleet.histories)
    made = fleet_tool_code(model, V12, 2.0, name="X")
    truth = V12 + mounting_variance() + drift_variance()
    assert 0.935 < contained(made.code, truth, 10_000, 2) < 0.97

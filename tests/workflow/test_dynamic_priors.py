"""What is assumed of a tool: the same whatever the method, in every row, and stated at the command line."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.files.run_file import open_run, writing
from inclinometry.workflow.dynamic import dynamic_run
from inclinometry.workflow.dynamic_methods import DynamicOptions
from inclinometry.workflow.simulate_drilling import RUN, DrillingRequest, write_drilling

HOLE = DrillingRequest("vibration-5g").chosen.hole
SITE = Site(latitude=HOLE.latitude, g=HOLE.gravity, b=HOLE.field, dip=HOLE.dip)


def reduced(path, method="magnetic", **options):
    return dynamic_run(open_run(path), SITE, None, DynamicOptions(method, **options)).rows


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    where = tmp_path_factory.mktemp("still") / "run.parquet"
    write_drilling(DrillingRequest("stationary", 2, duration=40.0), where)
    return where


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    where = tmp_path_factory.mktemp("turning") / "run.parquet"
    write_drilling(DrillingRequest("vibration-5g", 2, duration=40.0), where)
    return where


def test_one_tool_has_one_set_of_priors(still):
    """The mean at rest stated 0.01 deg of azimuth, the magnetic rows of the same tool 0.74."""
    rest, magnetic, carried = (reduced(still, method) for method in ("auto", "magnetic", "filter"))
    for name in ("u_inclination", "u_azimuth"):
        # the methods differ in noise, and the filter's first rows in what it has learnt
        np.testing.assert_allclose(getattr(rest, name), getattr(magnetic, name), rtol=0.1)
        np.testing.assert_allclose(getattr(carried, name)[-1], getattr(magnetic, name)[-1], rtol=0.25)


def scaled(path, where, errors):
    """The run with a magnetometer of other scale factors."""
    (block,) = open_run(path).blocks()
    names = [c for c in RUN if c.name[:3] not in ("gyr", "tem")]
    with writing(where, names) as write:
        columns = {f"accel_{a}": block.channels["accelerometer"][:, n] for n, a in enumerate("xyz")}
        field = block.channels["magnetometer"] @ (np.eye(3) + errors).T
        write({"time_s": block.time, **columns, **{f"mag_{a}": field[:, n] for n, a in enumerate("xyz")}})
    return where


@pytest.mark.long
def test_scale_errors_that_no_calibration_took_off_are_in_every_row(turning, tmp_path):
    """Ten triads with 0.3 % in each of nine places: mean square of error over uncertainty 0.4 to 1.7 (1 expected, less
    what the other priors allow); it was above 10."""
    squares = []
    for seed in range(10):
        errors = np.random.default_rng(seed).normal(0.0, 3e-3, (3, 3))
        rows = reduced(scaled(turning, tmp_path / f"{seed}.parquet", errors))
        squares.append(np.mean(((rows.azimuth - HOLE.azimuth) / rows.u_azimuth) ** 2))
    assert 0.3 < np.mean(squares) < 1.7


def test_the_doubts_are_options(turning):
    known = {"axial_sigma": 1.0, "lag_sigma": 0.0}
    plain, sure = reduced(turning, **known), reduced(turning, scale_sigma=0.0, **known)
    assert (sure.u_azimuth < 0.5 * plain.u_azimuth).all()
    assert (reduced(turning, scale_sigma=6e-3, **known).u_azimuth > 1.8 * plain.u_azimuth).all()
    # 220 nT along the tool turn this azimuth by 0.26 deg; the site's dip and strength leave two thirds of it
    steel = np.degrees(np.sqrt(reduced(turning, lag_sigma=0.0).u_azimuth ** 2 - plain.u_azimuth**2))
    np.testing.assert_allclose(steel, 0.17, atol=0.02)
    plain = reduced(turning)
    late = reduced(turning, delay_sigma=1e-3)
    # the speed changes: the delay is found whatever is allowed; the stamps' own is in the toolface
    np.testing.assert_allclose(late.u_azimuth, plain.u_azimuth, rtol=0.1)
    assert (late.u_toolface > 3.0 * plain.u_toolface).all()
    with refused("input-value", error=InputError, name="delay_sigma", value=-1.0):
        DynamicOptions(delay_sigma=-1.0)
    with refused("input-value", error=InputError, name="lag_sigma", value=1.0):
        DynamicOptions(lag_sigma=1.0)
    with refused("input-value", error=InputError, name="axial_sigma", value=-1.0):
        DynamicOptions(axial_sigma=-1.0)
    with refused("input-value", error=InputError, name="scale_sigma", value=0.5):
        DynamicOptions(scale_sigma=0.5)

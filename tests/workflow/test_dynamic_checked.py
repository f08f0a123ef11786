"""Wrong axes and signs give no azimuth under any method; the same for a run of three windows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.motion.result import BITS, Samples, joined
from inclinometry.simulate.drilling import SCENARIOS, simulate_drilling
from inclinometry.workflow.dynamic_methods import METHODS, Setup

HOLE = replace(SCENARIOS["vibration-5g"].hole, inclination=np.radians(30.0), azimuth=np.radians(60.0))
SITE = Site(latitude=HOLE.latitude, g=HOLE.gravity, b=HOLE.field, dip=HOLE.dip)
TURN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
FLIP = np.diag([1.0, -1.0, 1.0])
WRONG = {
    "specific force": {"accel": -np.eye(3)},
    "field turned by 90 deg": {"mag": TURN},
    "field turned by 180 deg": {"mag": TURN @ TURN},
    "field's z reversed": {"mag": np.diag([1.0, 1.0, -1.0])},
    "left-handed": {"accel": FLIP, "mag": FLIP, "gyro": FLIP},
    "gyro reversed": {"gyro": -np.eye(3)},
}


@pytest.fixture(scope="module", params=["vibration-5g", "sliding"])
def run(request):
    return simulate_drilling(replace(SCENARIOS[request.param], hole=HOLE), 3, duration=31.0)


def rows(run, method, wrong):
    columns = {name: getattr(run, name) @ wrong.get(name, np.eye(3)).T for name in ("accel", "mag", "gyro")}
    stream = METHODS[method].make(Setup(SITE))
    samples = Samples(run.time, run.interval, **columns)
    cuts = [samples.part(start, start + 1111) for start in range(0, len(samples), 1111)]
    return joined([*(stream.push(part) for part in cuts), stream.finish()])


def off(found, run):
    """Inclination and azimuth less the truth (2, k), rad."""
    at = found.angles
    azimuth = np.interp(found.time, run.time, np.unwrap(run.truth.azimuth))
    return np.stack(
        [
            at.inclination - np.interp(found.time, run.time, run.truth.inclination),
            np.angle(np.exp(1j * (at.azimuth - azimuth))),
        ]
    )


@pytest.mark.long
@pytest.mark.parametrize("method", ["auto", "magnetic", "filter", "gyro"])
@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_axes_give_no_azimuth_with_a_small_uncertainty(run, method, wrong):
    """Refused with a reason, or covered: three standard uncertainties, of an azimuth known to 60 deg or better."""
    try:
        found = rows(run, method, WRONG[wrong])
    except InputError as refusal:
        if refusal.finding.code in ("motion-signs", "motion-field-mirrored"):
            return
        raise
    u = np.stack([found.u.inclination, found.u.azimuth])
    error = off(found, run)
    told = ~found.refused & (u < np.radians(60.0))
    assert (np.abs(error[told]) < 3.0 * u[told]).all()
    assert found.findings or method == "gyro"  # which may be right


@pytest.mark.parametrize("method", ["auto", "magnetic", "filter"])
def test_right_axes_are_left_alone(run, method):
    found = rows(run, method, {})
    assert len(found) == 3
    assert not (found.flags & np.uint32(BITS["axes"] | BITS["gap"] | BITS["stuck"])).any()
    good = ~found.refused
    assert good.any()
    u = np.stack([found.u.inclination, found.u.azimuth])
    assert (np.abs(off(found, run))[:, good] < 4.0 * u[:, good]).all()


@pytest.mark.parametrize("method", ["magnetic", "filter"])
def test_rows_do_not_depend_on_the_blocks(run, method):
    whole = METHODS[method].make(Setup(SITE))
    samples = Samples(run.time, run.interval, accel=run.accel, mag=run.mag, gyro=run.gyro)
    once = joined([whole.push(samples), whole.finish()])
    cut = rows(run, method, {})
    assert np.array_equal(once.time, cut.time)
    assert np.array_equal(once.quaternion, cut.quaternion, equal_nan=True)
    assert np.array_equal(once.covariance, cut.covariance, equal_nan=True)
    assert np.array_equal(once.flags, cut.flags)


def test_missing_samples_are_a_gap_and_not_clipped():
    """Marked samples that hold nothing before them are no gap that is predicted: too many are refused."""
    run = simulate_drilling(SCENARIOS["vibration-5g"], 1, duration=31.0)
    marked = np.random.default_rng(1).random(len(run.time)) < 0.03
    samples = Samples(run.time, run.interval, accel=run.accel, mag=run.mag, gyro=run.gyro, clipped=marked)
    for method in ("auto", "magnetic"):
        stream = METHODS[method].make(Setup(SITE))
        found = joined([stream.push(samples), stream.finish()])
        assert found.refused.any()
        assert ((found.flags & np.uint32(BITS["gap"])) > 0).all()
        assert not (found.flags & np.uint32(BITS["clipped"])).any()


@pytest.mark.parametrize(
    ("method", "dropped", "scale"), [("auto", 0.02, 0.0), ("filter", 0.02, 3e-3), ("smoother", 0.0, 3e-3)]
)
def test_neither_lost_rows_nor_scales_of_the_field_refuse_a_window(method, dropped, scale):
    """2 % of the rows dropped at random; scale errors of x and y of one standard deviation, of other signs."""
    run = simulate_drilling(replace(SCENARIOS["vibration-5g"], hole=HOLE), 3, duration=31.0)
    held = np.maximum.accumulate(np.arange(len(run.time)) * (np.random.default_rng(1).random(len(run.time)) >= dropped))
    columns = {name: getattr(run, name)[held] for name in ("accel", "mag", "gyro")}
    columns["mag"] = columns["mag"] * [1.0 + scale, 1.0 - scale, 1.0]
    lost = held < np.arange(len(held))
    stream = METHODS[method].make(Setup(SITE))
    found = joined([stream.push(Samples(run.time, run.interval, clipped=lost, **columns)), stream.finish()])
    assert len(found) == 3
    assert not found.refused.any()
    assert (np.abs(found.angles.inclination - HOLE.inclination) < 2.5 * found.u.inclination).all()
    assert np.degrees(found.u.inclination).max() < 0.5


def test_the_calibrated_site_is_not_needed_for_the_gyro():
    """A run without a magnetometer has nothing to be told of the field."""
    run = simulate_drilling(SCENARIOS["stationary"], 1, duration=31.0)
    stream = METHODS["gyro"].make(Setup(SITE))
    found = joined([stream.push(Samples(run.time, run.interval, accel=run.accel, gyro=run.gyro)), stream.finish()])
    assert "motion-no-magnetometer" not in {one.code for one in found.findings}

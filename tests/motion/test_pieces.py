"""Smoothing in pieces: the blocks do not matter at all, the pieces hardly."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from inclinometry.earth.site import Site
from inclinometry.motion.inertial.smoother import smoothed_attitude
from inclinometry.motion.inertial.state import InertialSettings
from inclinometry.motion.magnetic.phase import MagneticSettings
from inclinometry.motion.magnetic.window import MagneticStream
from inclinometry.motion.pieces import SampleSmoother, WindowSmoother
from inclinometry.motion.result import METHODS, Samples, joined
from inclinometry.simulate.drilling import simulate_drilling
from inclinometry.simulate.drilling.scenario import Hole

WINDOW = 1.0


@pytest.fixture(scope="module")
def samples():
    run = simulate_drilling("vibration-5g", 4, duration=400.0)
    return Samples(run.time, run.interval, accel=run.accel, mag=run.mag, gyro=run.gyro)


def smooth(samples):
    return smoothed_attitude(samples, InertialSettings(window=WINDOW), Site(dip=Hole().dip, b=50_000.0))


def fed(stream, samples, cuts=()):
    edges = [0, *cuts, len(samples)]
    return joined([*(stream.push(samples.part(a, b)) for a, b in pairwise(edges)), stream.finish()])


@pytest.mark.long
def test_pieces_agree_with_the_whole(samples):
    """Pieces learn the sensors' constant errors from less, and differ from the whole by no more than that allows."""
    whole = smooth(samples)
    found = fed(SampleSmoother(smooth, WINDOW, most=20_000), samples)
    assert np.array_equal(found.time, whole.time)
    for name in ("inclination", "azimuth", "toolface"):
        off = np.angle(np.exp(1j * (getattr(found.angles, name) - getattr(whole.angles, name))))
        # less data with the same errors: the difference has a variance below that of the pieces
        assert (np.abs(off) < 3.0 * getattr(found.u, name)).all()
    assert found.findings[-1].code == "motion-pieces"
    assert found.findings[-1].values["count"] == 4


@pytest.mark.long
def test_blocks_do_not_matter(samples):
    one = fed(SampleSmoother(smooth, WINDOW, most=20_000), samples)
    other = fed(SampleSmoother(smooth, WINDOW, most=20_000), samples, cuts=(1, 777, 33_333, 33_333, 70_001))
    assert np.array_equal(one.time, other.time)
    assert np.array_equal(one.quaternion, other.quaternion)
    assert np.array_equal(one.covariance, other.covariance)


@pytest.mark.long
def test_a_run_of_one_piece_is_the_batch(samples):
    part = samples.part(0, 20_000)
    assert np.array_equal(fed(SampleSmoother(smooth, WINDOW), part).quaternion, smooth(part).quaternion)
    assert len(SampleSmoother(smooth, WINDOW).finish()) == 0


@pytest.mark.long
def test_windows_are_smoothed_where_there_is_no_gyro(samples):
    bare = Samples(samples.time, samples.interval, accel=samples.accel, mag=samples.mag)
    settings = MagneticSettings(window_s=4.0, overlap=0.0)
    found = fed(WindowSmoother(MagneticStream(settings)), bare)
    cut = fed(WindowSmoother(MagneticStream(settings), most=30), bare, cuts=(5_000, 5_001))
    assert len(found) == 100
    assert {METHODS[n] for n in found.method} == {"smoother"}
    # 30 rows and LEAD on either side against 100: the hole is straight and the far rows weigh little
    assert np.abs(cut.angles.inclination - found.angles.inclination).max() < np.nanmax(found.u.inclination)
    assert len(WindowSmoother(MagneticStream(settings)).finish()) == 0

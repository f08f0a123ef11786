"""The demo's run while drilling: single samples, a textbook filter and this package against the truth."""

import numpy as np
import pytest

from inclinometry.report.dynamic import errors_of, rms_of
from inclinometry.simulate.drilling import simulate_drilling
from inclinometry.workflow.demo import (
    OURS,
    PICTURE,
    RAW,
    TEXTBOOK,
    drill,
    drilling_sentences,
    raw_course,
    textbook_course,
    textbook_filter,
    true_course,
)


@pytest.fixture(scope="module")
def drilled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drilling")
    return drill(folder), folder


def test_the_picture_is_written_and_ours_is_far_below_the_others(drilled):
    (_, _, rms), folder = drilled
    assert (folder / PICTURE).read_bytes()[:4] == b"\x89PNG"
    assert {path.name for path in folder.iterdir()} >= {"run.parquet", "truth.parquet", "site.toml", "attitude.csv"}
    assert list(rms) == [RAW, TEXTBOOK, OURS]
    assert rms[RAW][0] > 40.0  # 5 g of vibration against 1 g of gravity
    assert 0.5 < rms[TEXTBOOK][0] < 30.0
    # the reference figure of windows of 10 s at 120 rpm is .026 and .053
    assert rms[OURS][0] < 0.026
    assert rms[OURS][1] < 0.053


def test_the_sentences_carry_the_numbers(drilled):
    (_, top, rms), _ = drilled
    head, *lines = drilling_sentences(top, rms)
    assert "609 rpm" in head
    assert len(lines) == 3
    assert all(name in line for name, line in zip(rms, lines, strict=True))


def test_the_textbook_filter_holds_a_tool_at_rest():
    """It is no straw man: a tool at rest it holds to less than the noise of a sample."""
    run = simulate_drilling("stationary", 3, duration=20.0)
    off = errors_of(textbook_course(run), true_course(run))
    assert rms_of(off[0]) < 0.1
    assert rms_of(off[1]) < 0.2
    raw = errors_of(raw_course(run), true_course(run))
    assert rms_of(off[0]) < rms_of(raw[0])


def test_the_textbook_filter_returns_to_a_truth_it_was_moved_away_from():
    """A gain of 0.041 rad/s on the quaternion turns by twice that: 4.7 deg/s."""
    run = simulate_drilling("stationary", 3, duration=20.0)
    run.truth.inclination[0] += np.radians(20.0)  # where it starts
    turn = textbook_filter(run)
    tilt = np.degrees(np.arctan2(np.hypot(turn[:, 0, 2], turn[:, 1, 2]), turn[:, 2, 2]))
    assert tilt[0] == pytest.approx(50.0, abs=0.1)
    assert tilt[-1] == pytest.approx(30.0, abs=0.2)
    assert 50.0 - 2.0 * 4.7 - 0.1 < tilt[400] < 45.0  # at 2 s; a part of the step goes to the azimuth


def test_the_textbook_filter_keeps_up_with_fast_turning():
    """Its gyros turn it by the exact exponential: perfect gyros at 600 rpm cost nothing."""
    run = simulate_drilling("fast", 3, duration=5.0)
    c, s = np.cos(run.truth.toolface), np.sin(run.truth.toolface)
    assert np.allclose(np.gradient(np.unwrap(np.arctan2(s, c)), run.interval)[5:-5], run.truth.rate[5:-5], rtol=1e-6)
    run.gyro[:] = np.outer(run.truth.rate, [0.0, 0.0, 1.0])
    turn = textbook_filter(run, gain=0.0)
    tilt = np.degrees(np.arctan2(np.hypot(turn[:, 0, 2], turn[:, 1, 2]), turn[:, 2, 2]))
    assert tilt == pytest.approx(30.0, abs=1e-6)
    toolface = np.arctan2(turn[:, 1, 2], -turn[:, 0, 2])
    drift = np.unwrap(toolface - run.truth.toolface)
    # it starts one step late, as every filter that takes a sample as the turn since the last
    assert np.ptp(drift) < 1e-6

"""Raw stamps: every defect found and said, pieces the same whatever the blocks, stretches the methods accept."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from inclinometry.findings import Finding
from inclinometry.motion.decimate import check_interval, fit_grid
from inclinometry.motion.timing import GATHERED, StretchCutter, cut_stretches, rejoined

from ..refusals import refused

RATE = 200.0


def readings(size: int, seed: int = 0) -> np.ndarray:
    """Noise, so that no reading repeats."""
    return np.random.default_rng(seed).normal(size=(size, 3))


def damaged(seed: int, size: int = 3000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Jitter, small and large gaps, repeated rows, missing values."""
    rng = np.random.default_rng(seed)
    time = np.arange(size) / RATE + rng.uniform(-0.2, 0.2, size) / RATE
    keep = rng.random(size) > 0.01
    keep[1500:1700] = False
    index = np.sort(np.concatenate([np.flatnonzero(keep), rng.choice(np.flatnonzero(keep), 7)]))
    accel, mag = readings(size, seed), readings(size, seed + 1)
    mag[rng.random(size) < 0.005] = np.nan
    return time[index], accel[index], mag[index]


def test_clean_record_is_one_stretch_without_notes() -> None:
    accel = readings(5000)
    found = cut_stretches(np.arange(5000) / RATE, accel)
    (one,) = found.samples
    assert one.interval == 1.0 / RATE
    assert np.array_equal(one.accel, accel)
    assert not one.clipped.any()
    assert found.report.findings() == ()


@pytest.mark.parametrize("rate", [50.0, 285.7142857, 100.0, 1000.0 / 3.0, 400.0, 2000.0, 104.17])
def test_interval_from_stamps_rounded_and_jittered(rate: float) -> None:
    """Slope of 1024 stamps with a fifth of an interval: 0.2 sqrt(12 / 1024^3) / sqrt(3) = 1.2e-5 intervals, 4 sigma."""
    rng = np.random.default_rng(1)
    time = 100.0 + np.arange(1024) / rate + rng.uniform(-0.2, 0.2, 1024) / rate
    grid = fit_grid(time)
    assert grid is not None
    assert grid.interval * rate == pytest.approx(1.0, abs=5e-5)
    # a rate people choose is found exactly
    if float(f"{rate:.4g}") == rate:
        assert grid.interval == pytest.approx(1.0 / rate, rel=1e-12)


def test_small_gap_keeps_the_grid_and_a_large_one_cuts() -> None:
    time = np.arange(400) / RATE
    keep = np.ones(400, bool)
    keep[100:103] = False
    keep[200:206] = False
    accel = readings(400)
    found = cut_stretches(time[keep], accel[keep])
    first, second = found.samples
    assert len(first) == 200
    assert np.flatnonzero(first.clipped).tolist() == [100, 101, 102]
    assert np.array_equal(first.accel[100:103], np.repeat(accel[99:100], 3, axis=0))
    assert np.array_equal(second.accel, accel[206:])
    assert second.time[0] == pytest.approx(206 / RATE, abs=1e-12)
    assert found.report.filled == 3
    filled, cut = found.report.findings()
    assert filled == Finding("motion-samples-filled", {"count": 3}, severity="note")
    assert cut.values["intervals"] == pytest.approx(7.0)


def test_repeated_rows_are_dropped_and_counted() -> None:
    index = np.sort(np.concatenate([np.arange(500), [3, 3, 77, 499]]))
    accel = readings(500)
    accel[77, 1] = np.nan  # a missing value repeats as well
    found = cut_stretches(index / RATE, accel[index])
    assert len(found.samples[0]) == 500
    assert found.report.repeats == 4
    assert found.report.findings()[0] == Finding(
        "motion-rows-dropped", {"count": 4, "total": 504, "reason": "repeat the row before"}, severity="note"
    )


def test_one_stamp_with_two_readings_is_refused() -> None:
    time = np.arange(100) / RATE
    time[50] = time[49]
    with refused("motion-time-repeated") as caught:
        cut_stretches(time, readings(100))
    assert caught.value.finding.rows == (50,)
    assert caught.value.finding.values == {"time_s": 0.245, "row": 51}


def test_time_that_runs_backwards_is_refused_with_row_and_value() -> None:
    time = np.arange(100) / RATE
    time[60:] -= 0.1
    cutter = StretchCutter()
    cutter.push(time[:60], readings(60))
    with refused("input-order") as caught:
        cutter.push(time[60:], readings(40))
    values = {"name": "time_s", "value": pytest.approx(0.2), "before": pytest.approx(0.295), "row": 61}
    assert caught.value.finding.values == values
    with refused("input-finite", name="time[1]"):
        cut_stretches([0.0, np.nan], readings(2))


def test_clock_that_drifts_is_followed_and_said() -> None:
    """Rate off by 300 ppm after the first rows were even: a quarter of a place after 900 rows, cut, then followed."""
    step = np.full(20000, 1.0 / RATE)
    step[2000:] *= 1.0 + 3e-4
    time = np.cumsum(step)
    found = cut_stretches(time, readings(20000))
    assert len(found.samples) == 2
    assert found.samples[1].interval == pytest.approx((1.0 + 3e-4) / RATE, rel=1e-7)
    assert sum(len(one) for one in found.samples) == 20000
    assert found.report.first_cut["intervals"] < 6.0
    for one in found.samples:
        at = np.searchsorted(time, one.time + 0.5 * one.interval) - 1
        assert np.abs(time[at] - one.time).max() <= 0.3 / RATE


def test_strong_jitter_keeps_the_grid() -> None:
    """A fifth of an interval, Gaussian: one stamp in 80 is nearest to a neighbour's place, and is mended."""
    rng = np.random.default_rng(3)
    size = 20000
    time = np.arange(size) / RATE + rng.normal(0.0, 0.2, size) / RATE
    order = np.diff(time, prepend=-1.0) > 0.0  # those that overtook another do not exist
    keep = order & (rng.random(size) > 0.002)
    found = cut_stretches(time[keep], readings(size)[keep])
    assert len(found.samples) <= 3
    for one in found.samples:
        good = ~one.clipped
        row = np.rint(one.time[good] * RATE).astype(int)
        assert np.mean((one.accel[good] == readings(size)[row]).all(axis=1)) > 0.999
    assert "motion-jitter" in {one.code for one in found.report.findings()}


def test_rate_that_changes_is_cut() -> None:
    time = np.concatenate([np.arange(700) / 100.0, 7.0 + np.arange(3000) / 200.0])
    found = cut_stretches(time, readings(3700))
    assert [round(1.0 / one.interval, 6) for one in found.samples][-1] == 200.0
    assert found.samples[0].interval == 0.01
    assert "motion-interval-changes" in {one.code for one in found.report.findings()}
    # the change shows after some stamps have shared a place
    assert sum(len(one) - int(one.clipped.sum()) for one in found.samples) == 3700 - found.report.shared
    assert found.report.shared <= 32


def test_stamps_without_a_grid_are_refused() -> None:
    with refused("motion-no-grid"):
        cut_stretches(np.cumsum(np.random.default_rng(0).exponential(1.0, 2000)), readings(2000))


def test_missing_values_hold_the_last_and_are_counted() -> None:
    accel, mag = readings(300), readings(300, 1)
    mag[0] = np.nan
    mag[100:103, 2] = np.nan
    accel[7, 0] = np.inf
    (one,) = cut_stretches(np.arange(300) / RATE, accel, mag).samples
    assert np.flatnonzero(one.clipped).tolist() == [0, 7, 100, 101, 102]
    assert np.array_equal(one.mag[0], mag[1])  # before the first value, the first value
    assert (one.mag[100:103, 2] == mag[99, 2]).all()
    assert one.accel[7, 0] == accel[6, 0]
    report = cut_stretches(np.arange(300) / RATE, accel, mag).report
    assert report.missing == {"accel_x": 1, "mag_x": 1, "mag_y": 1, "mag_z": 4}


def test_triad_without_values_is_left_out_and_a_slower_one_refused() -> None:
    time, accel = np.arange(300) / RATE, readings(300)
    found = cut_stretches(time, accel, np.full((300, 3), np.nan))
    assert not found.samples[0].has("mag")
    assert found.report.absent == ("mag",)
    assert not found.samples[0].clipped.any()
    slow = np.full((300, 3), np.nan)
    slow[::4] = 1.0
    with refused("motion-triad-slow") as caught:
        cut_stretches(time, accel, slow)
    assert caught.value.finding.values == {"triad": "mag", "missing_percent": 75.0, "count": 300}
    with refused("motion-triad-absent"):
        cut_stretches(time, np.full((300, 3), np.nan))


def test_blocks_must_have_the_same_columns() -> None:
    cutter = StretchCutter()
    cutter.push([0.0], accel=[[0.0, 0.0, 9.8]])
    with refused("input-block"):
        cutter.push([0.1], gyro=[[0.0, 0.0, 9.8]])
    with refused("input-triads", needed=("accel", "mag", "gyro")):
        StretchCutter().push([0.0])
    with refused("input-few", name="rows", least=2):
        cut_stretches([0.0], accel=[[0.0, 0.0, 9.8]])


@settings(max_examples=25, deadline=None)
@given(cuts=st.lists(st.integers(0, 2800), max_size=12), seed=st.integers(0, 50))
@example(cuts=[0, 0, 1, GATHERED, GATHERED + 1], seed=0)
def test_same_pieces_for_any_blocks(cuts: list[int], seed: int) -> None:
    """To the last bit, the report included; blocks of no and of one sample among them."""
    time, accel, mag = damaged(seed)
    whole = cut_stretches(time, accel, mag)
    cutter = StretchCutter()
    edges = [0, *sorted(cuts), len(time)]
    pieces = []
    for start, stop in pairwise(edges):
        pieces += cutter.push(time[start:stop], accel[start:stop], mag[start:stop])
    pieces += cutter.finish()
    assert cutter.report == whole.report
    numbers = list(dict.fromkeys(piece.number for piece in pieces))
    assert len(numbers) == len(whole.samples)
    for number, one in zip(numbers, whole.samples, strict=True):
        again = rejoined([piece.samples for piece in pieces if piece.number == number])
        for name in ("time", "accel", "mag", "clipped"):
            assert np.array_equal(getattr(again, name), getattr(one, name))


def test_damaged_record_loses_nothing() -> None:
    """Every row that was kept is in the stretches at its own time: 0.2 of jitter and the fit leave a quarter."""
    time, accel, mag = damaged(4)
    found = cut_stretches(time, accel, mag)
    assert len(found.samples) == 2
    kept = sum(len(one) for one in found.samples) - found.report.filled
    assert kept + found.report.repeats == len(time)
    one = found.samples[0]
    good = ~one.clipped
    for moment, value in zip(one.time[good][::50], one.accel[good][::50], strict=True):
        row = int(np.flatnonzero((accel == value).all(axis=1))[0])
        assert abs(time[row] - moment) < 0.25 / RATE


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("dropped", [0, 40])
def test_strong_jitter_leaves_the_interval(seed: int, dropped: int) -> None:
    """2 ms on 5 ms: of 64 stamps another interval can look as good, of 1024 none does."""
    rng = np.random.default_rng(seed)
    time = np.arange(4000) / RATE + rng.uniform(-0.002, 0.002, 4000)
    kept = np.sort(rng.choice(4000, 4000 - dropped, replace=False))
    found = cut_stretches(time[kept], readings(kept.size))
    assert len(found.samples) == 1
    # four standard deviations of a slope: 4 * 1.15 ms * sqrt(12 / 1024^3)
    assert abs(found.samples[0].interval - 1.0 / RATE) < 5e-7
    assert (found.report.filled, found.report.shared) == (len(found.samples[0]) - kept.size, 0)
    # 4 ms over sqrt(12)
    assert 0.00105 < found.report.jitter < 0.00125
    assert "motion-jitter" in {one.code for one in found.report.findings()}


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"), (1.0 / 3600.0, "hours")]
)
def test_the_unit_of_stamps_is_guessed(factor: float, unit: str) -> None:
    check_interval(0.005)
    with refused("motion-stamps-unit") as caught:
        check_interval(factor * 0.005)
    assert caught.value.finding.values["unit"] == unit
    with refused("motion-interval"):
        check_interval(1e9)

"""The report of a run in which the tool turned and shook."""

from dataclasses import fields, replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.findings import example
from inclinometry.motion.result import (
    BITS,
    CHANNELS,
    FLAGS,
    METHODS,
    AttitudeRows,
    DynamicRun,
    Envelope,
    Excerpt,
    RunCounts,
    Spectrogram,
    Vibration,
)
from inclinometry.report.dynamic import (
    CHANNEL_WORDS,
    METHOD_WORDS,
    REMEDIES,
    Found,
    attitude_figure,
    clock,
    dynamic_report,
    errors_of,
    methods_figure,
    rms_of,
    stretches,
)
from inclinometry.report.words import plain

from .pages import check

WINDOW = 10.0


def rows(size=60, seed=4):
    """Windows of a turning tool: five refused as clipped, some with vibration that weakens them."""
    draw = np.random.default_rng(seed)
    time = WINDOW * (0.5 + np.arange(size))
    refused = np.isin(np.arange(size), [10, 11, 12, 13, 40])
    flags = np.zeros(size, dtype=np.uint32)
    flags[refused] |= np.uint32(BITS["clipped"])
    flags[20:30] |= np.uint32(BITS["vibration"])
    u = np.radians(np.where(flags > 0, 0.1, 0.03))
    angles = [np.radians(30.0) + u * draw.standard_normal(size), np.radians(359.9 + 0.003 * time) % (2.0 * np.pi)]
    angles.append(draw.uniform(0.0, 2.0 * np.pi, size))
    values = [np.where(refused, np.nan, one) for one in (*angles, u, 2.0 * u, u)]
    rate = 4.0 * np.pi * (1.0 + 0.1 * draw.standard_normal(size))
    method = np.where(np.arange(size) < 30, METHODS.index("magnetic"), METHODS.index("gyro"))
    quality = np.where(refused, 0.0, 0.8)
    north = np.zeros(size, dtype=np.uint8)
    blank = np.full((size, 4), np.nan)
    return AttitudeRows(time, *values, rate, quality, flags, method.astype(np.uint8), north, blank, *blank.T[:2])


def shaking(found, seed=5):
    draw = np.random.default_rng(seed)
    level = 40.0 + 5.0 * draw.standard_normal(len(found))
    return Vibration(found.time, level, 0.4 * level, 8.0 * level, 0.0 * level, found.rate, 2.4 * found.rate)


def make(size=60):
    found = rows(size)
    draw = np.random.default_rng(6)
    edges = np.linspace(0.0, WINDOW * size, 121)
    frequency = np.linspace(0.0, 100.0, 65)
    density = draw.exponential(1.0, (120, 65)) * (0.01 + np.exp(-(((frequency - 40.0) / 20.0) ** 2)))
    density[30:35] = np.nan  # nothing was recorded
    middle = 0.5 * (edges[1:] + edges[:-1])
    envelopes = [
        Envelope(f"accel_{axis}", "m/s2", middle, -300.0 + 0.0 * middle, np.sin(middle), 300.0 + 0.0 * middle)
        for axis in "xyz"
    ]
    at = np.arange(200) / 200.0
    part = Excerpt(
        "strongest vibration", at, {f"mag_{axis}": 1e4 * np.cos(12.0 * at + k) for k, axis in enumerate("xyz")},
        dict.fromkeys(("mag_x", "mag_y", "mag_z"), "nT"),
    )  # fmt: skip
    return DynamicRun(
        rows=found,
        vibration=shaking(found),
        envelopes=tuple(envelopes),
        excerpts=(part,),
        spectrogram=Spectrogram("lateral acceleration", edges, frequency, density),
        counts=RunCounts(120_000, 31, 0.0, WINDOW * size, 0.005, 2),
        method="auto",
        window=WINDOW,
        north="magnetic",
        findings=(example("motion-gyro-known"),),
        inputs={"run": "sha256:7"},
        tool="D3",
    )


@pytest.fixture(scope="module")
def run():
    return make()


@pytest.fixture(scope="module")
def page(run):
    return check(dynamic_report(run))


@pytest.mark.long
def test_the_page_says_what_was_found_and_what_it_rests_on(run, page):
    assert "60 windows in 600 s, 5 refused" in page.text
    assert "Azimuth counts from magnetic north" in page.text
    assert "the calibration's own" in page.text.replace("’", "'")
    assert str(example("motion-gyro-known")) in page.text
    assert "120000, 31 of them missing or clipped" in page.text
    assert dynamic_report(run) == dynamic_report(run)


def test_every_drawing_is_there(page):
    # three angles, speed, vibration, spectrogram, one triad's envelopes, one excerpt
    assert page.tags.count("svg") == 8
    assert page.tags.count("image") >= 1  # the spectrogram is an image inside its drawing


def test_refusals_are_counted_with_what_to_do(page):
    assert "5 of 60 windows (8.3 %) refused" in page.text
    assert REMEDIES["clipped"] in page.text
    assert REMEDIES["vibration"] in page.text
    assert REMEDIES["stuck"] not in page.text
    # those that cost most come first
    assert page.text.index(REMEDIES["clipped"]) < page.text.index(REMEDIES["vibration"])


def test_the_stop_of_a_string_is_said(page):
    # slowest 0, fastest 2.4 times the mean
    assert "Stick-slip index: 1.2 at the median window, 1.2 at the worst; the string stopped in 60 windows" in page.text
    assert "Vibration, lateral: 4.0 g rms at the median window" in page.text  # about 40 m/s2


@pytest.mark.long
def test_the_speed_of_the_sentence_is_that_of_the_table(run):
    """A gyro that reads 1 % too much gives the vibration's mean, not the speed that the windows state."""
    off = replace(run, vibration=replace(run.vibration, mean=1.01 * run.rows.rate))
    low, high = (plain(60.0 / (2.0 * np.pi) * rate, 1) for rate in (run.rows.rate.min(), run.rows.rate.max()))
    assert f"Mean speed of a window: {low} to {high} rpm" in check(dynamic_report(off)).text


def test_words_for_every_flag_method_and_channel():
    assert set(REMEDIES) == set(FLAGS)
    assert set(METHOD_WORDS) == set(METHODS)
    assert set(CHANNEL_WORDS) == set(CHANNELS)


def lost(found):
    """The same windows, all refused."""
    changed = {
        name: np.full(len(found), np.nan)
        for name in ("inclination", "azimuth", "toolface", "u_inclination", "u_azimuth", "u_toolface")
    }
    return replace(found, **changed, flags=np.full(len(found), BITS["no-field"], dtype=np.uint32))


def test_a_run_that_is_refused_whole_still_has_a_page(run):
    nothing = np.full(60, np.nan)
    blind = Vibration(run.rows.time, *[nothing] * 6)
    bare = replace(run, rows=lost(run.rows), vibration=blind, envelopes=(), excerpts=(), spectrogram=None, tool="")
    page = check(dynamic_report(bare))
    assert "No window could be trusted" in page.text
    assert REMEDIES["no-field"] in page.text
    assert "The speed of rotation is not known" in page.text
    assert page.tags.count("svg") == 0
    assert "not calibrated" in page.text


@pytest.mark.long
def test_an_azimuth_that_nothing_is_known_of_is_said(run):
    nothing = np.full(60, np.nan)
    page = check(dynamic_report(replace(run, rows=replace(run.rows, azimuth=nothing, u_azimuth=nothing))))
    assert "azimuth not known" in page.text
    assert page.tags.count("svg") == 7  # no drawing of the azimuth


@pytest.mark.long
def test_two_norths_in_one_run_are_both_named(run):
    mixed = replace(run.rows, north=np.where(np.arange(60) < 30, 0, 1).astype(np.uint8))
    assert "Azimuth counts from magnetic and true north" in check(dynamic_report(replace(run, rows=mixed))).text


@pytest.mark.long
def test_one_window_is_enough_and_none_is_not(run):
    def first(found, count):
        return replace(found, **{one.name: getattr(found, one.name)[:count] for one in fields(found)})

    one = replace(run, rows=first(run.rows, 1), vibration=first(run.vibration, 1))
    assert "1 window in" in check(dynamic_report(one)).text
    with refused("input-empty", error=InputError, name="run.rows"):
        dynamic_report(replace(run, rows=first(run.rows, 0)))


@pytest.mark.long
def test_a_long_run_keeps_its_page_small():
    long = make(20_000)
    text = dynamic_report(long)
    assert len(text) < 3e6  # 500 rows, thinned curves
    assert "The first 500 of 20000 windows" in check(text).text
    assert "55.6 h" in text


def test_refused_stretches_reach_half_way_to_their_neighbours_but_not_across_a_gap():
    time = np.array([1.0, 2.0, 3.0, 100.0, 101.0, 102.0])
    chosen = np.array([True, False, True, True, False, False])
    assert stretches(time, chosen) == [(0.5, 1.0), (2.5, 98.0)]
    assert stretches(time, ~chosen) == [(1.5, 1.0), (100.5, 2.0)]
    alone = np.array([False, False, True, False, False, False])
    assert stretches(time, alone) == [(2.5, 1.25)]  # the neighbour is 97 s away


def test_an_angle_that_leaps_is_drawn_as_dots(run):
    upper = attitude_figure(run.rows, "toolface").axes[0]
    assert upper.get_ylim() == (0.0, 360.0)
    assert attitude_figure(run.rows, "inclination").axes[0].get_ylim()[1] < 31.0


def test_the_unit_of_time_follows_the_length():
    assert [clock(np.array([0.0, span]))[1] for span in (600.0, 601.0, 20_000.0)] == ["s", "min", "h"]


def test_errors_are_taken_at_the_times_of_what_was_found():
    at = np.linspace(0.0, 10.0, 101)
    truth = Found(at, 0.5 + 0.01 * at, (6.2 + 0.05 * at) % (2.0 * np.pi))
    middle = np.array([1.03, 4.5, 8.2])
    shown = Found(middle, 0.5 + 0.01 * middle + 0.002, (6.2 + 0.05 * middle - 0.003) % (2.0 * np.pi))
    inclination, azimuth = errors_of(shown, truth)
    assert inclination == pytest.approx(0.002, abs=1e-12)
    assert azimuth == pytest.approx(-0.003, abs=1e-12)
    assert rms_of(inclination) == pytest.approx(np.degrees(0.002))
    assert np.isnan(rms_of(np.array([np.nan])))


def test_the_picture_against_the_truth_carries_the_numbers():
    draw = np.random.default_rng(1)
    at = np.linspace(0.0, 60.0, 1201)
    truth = Found(at, 0.5 + 0.0 * at, 1.0 + 0.0 * at)
    raw = Found(at, draw.uniform(0.0, np.pi, 1201), draw.uniform(-np.pi, np.pi, 1201))
    mean = Found(at[::100], np.full(13, 0.502), np.full(13, 1.001), (np.full(13, 0.002), np.full(13, 0.002)))
    filtered = Found(at, 0.5 + 0.05 * np.sin(at), 1.0 + 0.1 * np.cos(at))
    figure = methods_figure(truth, 120.0 + 0.0 * at, {"raw": raw, "textbook": filtered, "ours": mean})
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert texts[0] == "truth"
    assert texts[3] == "ours: rms error inclination 0.11°, azimuth 0.057°"
    assert len(figure.axes) == 6

"""Whole runs: each mistake is named, right runs of every shape pass silently."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.plausibility import well
from scipy.spatial.transform import Rotation

from inclinometry.errors import FileError, InputError, settled
from inclinometry.findings import Finding
from inclinometry.orientation import dip_angle, fields
from inclinometry.sensors import Triad
from inclinometry.survey.consistency import check_angles, check_place
from inclinometry.survey.holes import check_holes
from inclinometry.survey.path import directions
from inclinometry.survey.plausibility import check_run, explained, misread_axis
from inclinometry.survey.run import Run, smoothness
from inclinometry.survey.run_stations import copied_block, copied_rows

from .multistation_runs import shipped

REFERENCE = Path(__file__).parents[1] / "reference"
DIP = np.radians(68.0)


def hole(spacing=28.5, noise_deg=0.1, seed=1):
    """Vertical to 400 m, builds to 60 deg at 2 deg/30 m, then turns through south: md, inclination, azimuth, deg."""
    r = np.random.default_rng(seed)
    md = np.round(np.arange(0.0, 2400.0, spacing), 2)
    inclination = np.interp(md, [0, 400, 1300, 2400], [0, 0, 60, 62])
    azimuth = np.interp(md, [0, 1300, 2400], [60, 62, 130])
    i, a = np.radians(inclination), np.radians(azimuth)
    t = np.stack([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)], axis=1)
    t += np.radians(noise_deg) * r.normal(size=t.shape)
    found = np.degrees(np.arctan2(np.hypot(t[:, 0], t[:, 1]), t[:, 2]))
    return md, found.round(2), np.degrees(np.arctan2(t[:, 1], t[:, 0])).round(2) % 360.0


def table(md, inclination, azimuth):
    return Run(np.array(md), np.radians(inclination), np.radians(azimuth))


def axes(order=(0, 1, 2), signs=(1.0, 1.0, 1.0), change=None, seed=1):
    md, inclination, azimuth = hole(seed=seed)
    r = np.random.default_rng(seed)
    toolface = r.uniform(0.0, 2.0 * np.pi, len(md))
    g, b = fields(np.radians(azimuth), np.radians(inclination), toolface, DIP)
    g, b = 9.81 * g + r.normal(0, 0.002, g.shape), 5e4 * b + r.normal(0, 40.0, b.shape)
    if change is not None:
        change(g, b)
    return Run.of_fields(md, g[:, list(order)] * signs, b[:, list(order)] * signs)


def cycled(sensor):
    return Finding("run-channel", {"sensor": sensor, "channels": ("x", "y", "z"), "mistake": "cycled"})


def pair(sensor, *channels):
    return Finding("run-channel", {"sensor": sensor, "channels": channels, "mistake": "exchanged"})


def turned(sensor, channel):
    return Finding("run-channel", {"sensor": sensor, "channels": (channel,), "mistake": "reversed"})


def test_a_right_run_passes_silently():
    assert check_run(table(*hole())) == []
    assert check_run(axes()) == []


@pytest.mark.parametrize("well", ["well1", "well2"])
def test_the_wells_of_the_iscwsa_pass(well):
    with (REFERENCE / "iscwsa-mwd" / f"{well}.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    columns = [np.array([float(row[name]) for row in rows]) for name in ("md_m", "inclination_deg", "azimuth_deg")]
    assert check_run(table(*columns)) == []


def test_the_shipped_runs_of_six_axes_pass():
    for run in shipped():
        assert check_run(Run.of_fields(run.stations.md, run.stations.g, run.stations.b)) == [], run.geometry


def one(run, code, severity="refused", **values):
    """The only finding of a run, its numbers to a part in a hundred."""
    found = check_run(run)
    assert [(finding.code, finding.severity) for finding in found] == [(code, severity)], found
    for name, value in values.items():
        assert found[0].values[name] == (pytest.approx(value, rel=0.01) if isinstance(value, float) else value)
    return found[0]


def codes(run):
    return [finding.code for finding in check_run(run)]


def test_depths_in_feet():
    md, inclination, azimuth = hole()
    one(table(md / 0.3048, inclination, azimuth), "run-depths-feet", "warning", course_m=93.5)
    half = np.where(np.arange(len(md)) >= 40, md / 0.3048, md)
    one(table(half, inclination, azimuth), "run-depths-mixed", station=41, expected_m=1140.0)


@pytest.mark.parametrize("course", [90.0, 98.4, 98.42, 95.25])
def test_courses_of_a_round_number_of_metres_are_no_feet(course):
    _, inclination, azimuth = hole()
    assert check_run(table(np.round(course * np.arange(len(inclination)), 2), inclination, azimuth)) == []


@pytest.mark.parametrize("course", [27.0, 28.5, 30.0])
def test_feet_of_round_courses_or_of_pipe(course):
    _, inclination, azimuth = hole()
    md = course * np.arange(len(inclination)) / 0.3048
    one(table(np.round(md, 2), inclination, azimuth), "run-depths-feet", "warning")
    pipe = md + np.random.default_rng(2).normal(0.0, 1.5, md.size)
    one(table(np.round(pipe, 1), inclination, azimuth), "run-depths-feet", "warning")


@pytest.mark.parametrize(
    ("kind", "channels", "gain", "severity", "sensor", "axis"),
    [
        ("b", slice(None), 0.5, "refused", "magnetometer", "x, y, z"),
        ("b", slice(1, 2), 0.5, "refused", "magnetometer", "y"),
        ("g", slice(0, 1), 2.0, "refused", "accelerometer", "x"),
        ("g", slice(None), 0.9, "warning", "accelerometer", "x, y, z"),
    ],
)
def test_a_gain_that_changes_midway(kind, channels, gain, severity, sensor, axis):
    def change(g, b):
        (g if kind == "g" else b)[50:, channels] *= gain

    values = {"sensor": sensor, "axis": axis, "gain": gain, "station": 51, "md_m": 1425.0}
    found = one(axes(change=change), "run-gain-step", severity, **values)
    assert found.rows == tuple(range(50, len(hole()[0])))


def test_a_field_that_fades_from_the_casing_is_no_gain():
    def casing(g, b):
        b += np.array([4000.0, -3000.0, 9000.0]) * np.exp(-np.arange(len(b)) / 3.0)[:, None]

    assert "run-gain-step" not in codes(axes(change=casing))


@pytest.mark.parametrize(
    ("order", "signs", "mistake"),
    [
        ([0, 2, 1], 1.0, (pair("magnetometer", "y", "z"),)),
        ([1, 2, 0], 1.0, (cycled("magnetometer"),)),
        # with the other triad's the hole is its mirror image, and as smooth
        ([1, 0, 2], 1.0, (pair("accelerometer", "x", "y"), pair("magnetometer", "x", "y"))),
        ([0, 1, 2], [1.0, -1.0, 1.0], (turned("accelerometer", "y"), turned("magnetometer", "y"))),
    ],
)
def test_channels_of_one_triad_of_six_axes(order, signs, mistake):
    def change(g, b):
        b[:] = b[:, order] * signs

    assert one(axes(change=change), "run-channels").values["mistake"] == mistake


def test_the_last_depth_ten_times_too_large():
    md, inclination, azimuth = hole()
    md[-1] *= 10.0
    one(table(md, inclination, azimuth), "run-depth-last-tenfold")


def test_columns_and_units():
    md, inclination, azimuth = hole()
    one(table(md, azimuth, inclination), "run-angles", mistake="Columns of inclination and azimuth are exchanged")
    one(table(md, np.radians(inclination), np.radians(azimuth)), "run-radians", angle="Inclinations and azimuths")
    one(
        table(md, np.abs(90.0 - inclination), azimuth),
        "run-angles",
        mistake="Inclination is counted from the horizontal",
    )
    one(table(md, 180.0 - inclination, azimuth), "run-climbs")


def test_a_level_hole_about_north_in_grads():
    md, r = np.arange(0.0, 1500.0, 30.0), np.random.default_rng(4)
    azimuth = (2.0 * r.normal(size=md.size)) % 360.0
    one(table(md, np.full(md.size, 60.0), azimuth / 0.9), "run-angles", mistake="Azimuths are in grads")


def test_angles_that_nothing_explains():
    md, r = np.arange(0.0, 1500.0, 30.0), np.random.default_rng(4)
    inclination, azimuth = r.uniform(20.0, 160.0, md.size), r.uniform(0.0, 360.0, md.size)
    one(table(md, inclination, azimuth), "run-off-line", total=md.size)
    (found,) = check_angles(axes(), np.radians(r.uniform(20.0, 160.0, 85)), None, "magnetic")
    assert (found.code, found.values["angle"]) == ("run-angle-differs", "inclination")
    assert found.values["mistake"] == "no unit or sign explains it"


def test_a_total_of_a_station_without_sensors():
    md, inclination, azimuth = hole()
    dip = np.where(np.arange(len(md)) == 33, DIP + 0.05, DIP)
    run = replace(table(md, inclination, azimuth), totals={"dip": dip})
    assert one(run, "run-total", "warning", quantity="dip").rows == (33,)


def test_columns_of_a_plan_are_told_by_how_it_begins():
    md = np.arange(0.0, 1500.0, 30.0)
    inclination, azimuth = np.interp(md, [0, 300, 1400], [0, 0, 50]), np.full(len(md), 40.0)
    assert check_run(table(md, inclination, azimuth)) == []
    one(table(md, azimuth, inclination), "run-top-exchanged", "warning")
    one(table(md, 90.0 - inclination, azimuth), "run-top-level", "warning")
    run = table(md, np.where(md > 1000.0, 100.0, np.minimum(md / 10.0, 100.0)), azimuth)
    one(run, "run-level-grads", "warning")


def test_a_wrong_quadrant():
    md, inclination, azimuth = hole()
    wrong = np.where((azimuth > 90.0) & (azimuth < 270.0), (azimuth + 180.0) % 360.0, azimuth)
    tilted = md > 600.0
    found = one(table(md[tilted], inclination[tilted], wrong[tilted]), "run-part", mistake="half a turn")
    assert len(found.rows) == int((azimuth[tilted] > 90.0).sum())


def test_one_reading_at_five_depths():
    md, inclination, azimuth = hole()
    inclination[40:45], azimuth[40:45] = inclination[40], azimuth[40]
    one(table(md, inclination, azimuth), "run-repeated", what="Inclination and azimuth", count=5)

    def pasted(g, b):
        g[30:35], b[30:35] = g[30], b[30]

    one(axes(change=pasted), "run-repeated", what="All six readings", count=5)


def test_a_block_of_rows_pasted_at_other_depths():
    for rows in (3, 5):
        md, inclination, azimuth = hole()
        inclination[50 : 50 + rows], azimuth[50 : 50 + rows] = inclination[42 : 42 + rows], azimuth[42 : 42 + rows]
        found = check_run(table(md, inclination, azimuth))[0]
        assert (found.code, found.severity, found.rows) == (
            "run-block-repeated",
            "refused",
            tuple(range(50, 50 + rows)),
        )

    def pasted(g, b):
        g[50:53], b[50:53] = g[42:45], b[42:45]

    found = check_run(axes(change=pasted))[0]
    assert (found.values["count"], found.values["md_m"], found.values["last_m"]) == (3, 1425.0, 1482.0)


def test_sections_written_as_straight_builds_are_no_copy():
    """Six rows built by one degree each, twice, in a hole that was measured."""
    md, inclination, azimuth = hole(30.0)
    for first in (30, 50):
        inclination[first : first + 6], azimuth[first : first + 6] = 30.0 + np.arange(6.0), 90.0
    assert "repeats" not in [one.group for one in check_run(table(md, inclination, azimuth))]


def test_what_a_plan_repeats_is_no_copy():
    md = np.arange(0.0, 3000.0, 30.0)
    for depths, angles in (
        ([0, 300, 900, 1200, 1800, 3000], [0, 0, 40, 40, 20, 20]),
        ([0, 300, 600, 900, 1200, 1500, 3000], [0, 0, 20, 0, 0, 20, 20]),  # builds twice alike
        ([0, 600, 1500, 1800, 2100, 2400, 3000], [0, 0, 90, 88, 92, 88, 92]),
    ):
        assert check_run(table(md, np.interp(md, depths, angles).round(2), np.full(len(md), 40.0))) == []
    # a level hole read to a degree
    r = np.random.default_rng(2)
    level = table(md, 90.0 + r.integers(-1, 2, md.size), 45.0 + r.integers(0, 2, md.size))
    assert not any(one.group == "repeats" for one in check_run(level))


def test_two_stations_exchanged():
    md, inclination, azimuth = hole()
    rows = np.arange(len(md))
    rows[[20, 23]] = 23, 20
    assert one(table(md, inclination[rows], azimuth[rows]), "run-rows-exchanged", station=21, other=24).rows == (20, 23)


def test_one_digit():
    md, inclination, azimuth = hole()
    inclination[50] += 10.0
    found = one(table(md, inclination, azimuth), "run-station-misread", "warning", mistake="one digit")
    assert found.rows == (50,)
    md, inclination, azimuth = hole()
    azimuth[60] = (azimuth[60] + 100.0) % 360.0
    assert check_run(table(md, inclination, azimuth))[0].rows == (60,)
    assert check_run(table(md, inclination, azimuth))[0].severity == "refused"


@pytest.mark.parametrize(
    ("mistake", "inclination_deg", "azimuth_deg"),
    [
        ("half a turn", 60.0, 301.0),
        ("mirrored", 60.0, 239.0),
        ("other quadrant", 60.0, 59.0),
        ("other end", 120.0, 121.0),
        ("from the horizontal", 30.0, 121.0),
        ("columns exchanged", 121.0, 60.0),
    ],
)
def test_the_reading_that_would_fit_is_named(mistake, inclination_deg, azimuth_deg):
    """A straight hole at inclination 60, azimuth 121; one station was written down wrongly."""
    md = np.arange(0.0, 900.0, 30.0)
    r = np.random.default_rng(1)
    inclination, azimuth = 60.0 + 0.03 * r.normal(size=30), 121.0 + 0.03 * r.normal(size=30)
    inclination[15], azimuth[15] = inclination_deg, azimuth_deg
    found = next(one for one in check_run(table(md, inclination, azimuth)) if one.group == "station")
    assert found.rows == (15,)
    fits = found.values["fits_inclination_deg"], found.values["fits_azimuth_deg"], found.values["mistake"]
    assert fits == (60.0, 121.0, mistake)


def test_the_first_and_the_last_station():
    md, inclination, azimuth = hole()
    azimuth[-1] = (azimuth[-1] - 25.0) % 360.0
    assert one(table(md, inclination, azimuth), "run-station-end", "warning", end="Last").rows == (len(md) - 1,)
    md, inclination, azimuth = hole()
    inclination[0] += 60.0
    assert one(table(md, inclination, azimuth), "run-station-end", "warning", end="First").rows == (0,)
    # a tie-on at the surface, then stations from a shoe on
    deep = md > 1000.0
    tied = table(*(np.insert(values[deep], 0, 0.0) for values in (md, hole()[1], hole()[2])))
    assert check_run(tied) == []


@pytest.mark.parametrize(("order", "channel"), [((0, 2, 1), "y"), ((2, 1, 0), "x"), ((1, 2, 0), "y"), ((2, 0, 1), "x")])
def test_axes_of_both_triads_exchanged(order, channel):
    one(axes(order), "run-axis-along", channel=channel)


@pytest.mark.parametrize("signs", [(1.0, 1.0, -1.0), (-1.0, -1.0, -1.0)])
def test_axes_of_both_triads_reversed(signs):
    one(axes(signs=signs), "run-climbs", advice="Correct the column, or state the axes by --convention or --profile")


def calibrated(change=lambda channels: channels):
    """The run of a tool whose channels differ in gain and offset."""
    run, r = axes(), np.random.default_rng(5)
    tools = {}
    for kind, strength, size in (("accelerometer", 9.80665, 1600.0), ("magnetometer", 5e4, 1500.0)):
        tensor = np.diag(size * (1.0 + 0.03 * r.normal(size=3))) + 10.0 * r.normal(size=(3, 3))
        tools[kind] = Triad(kind, tensor, 30.0 * r.normal(size=3), field_strength=strength)
    given = {"accelerometer": run.g, "magnetometer": run.b}
    channels = {kind: tool.signals(given[kind] / tool.field_strength) for kind, tool in tools.items()}

    def fields_of(channels):
        g, b = (tool.field_strength * tool.field(channels[kind]) for kind, tool in tools.items())
        return g, b

    channels = change(channels)
    seen = Run.of_fields(run.md, *fields_of(channels))
    return replace(seen, channels=channels, fields=fields_of)


def reordered(order, kinds=("accelerometer", "magnetometer")):
    return lambda channels: {k: v[:, order] if k in kinds else v for k, v in channels.items()}


@pytest.mark.parametrize(
    ("change", "mistake"),
    [
        (reordered([0, 2, 1]), pair("both sensors", "y", "z")),
        (reordered([1, 0, 2]), pair("both sensors", "x", "y")),
        (reordered([1, 2, 0]), cycled("both sensors")),
        (reordered([0, 2, 1], ("magnetometer",)), pair("magnetometer", "y", "z")),
        (lambda c: dict(zip(c, reversed(c.values()), strict=True)), pair("accelerometer and magnetometer", *"xyz")),
        (lambda c: {**c, "accelerometer": c["accelerometer"] * [1, -1, 1]}, turned("accelerometer", "y")),
        # the fields of six axes are a mirrored hole; offsets and skew axes of a tool are its own
        (lambda c: {kind: values * [1, -1, 1] for kind, values in c.items()}, turned("both sensors", "y")),
    ],
)
def test_channels_of_a_calibrated_tool(change, mistake):
    assert one(calibrated(change), "run-channels").values["mistake"] == (mistake,)


def test_fields_of_a_calibrated_tool_that_are_none_of_the_earth():
    one(
        calibrated(lambda c: {**c, "magnetometer": 1e3 * c["magnetometer"]}),
        "run-total-calibrated",
        quantity="magnetic field",
        count=85,
    )
    one(
        calibrated(lambda c: {**c, "accelerometer": 1.1 * c["accelerometer"]}),
        "run-total-calibrated",
        quantity="gravity",
        count=85,
    )


def test_a_reading_that_is_no_field_in_another_order_is_no_obstacle():
    run = axes()
    offset = {"accelerometer": np.array([0.5, -0.3, 0.2]), "magnetometer": np.array([900.0, -400.0, 700.0])}
    channels = {k: (v + offset[k])[:, [0, 2, 1]] for k, v in zip(offset, (run.g, run.b), strict=True)}
    # station 1 with x and y exchanged: nothing but the offset
    channels["accelerometer"][0] = offset["accelerometer"][[1, 0, 2]]
    found = explained(channels, lambda own: tuple(own[k] - offset[k] for k in offset), lambda *_: 0.0)
    assert found == (pair("both sensors", "y", "z"),)


@pytest.mark.parametrize(("kind", "axis", "end"), [("b", 0, 15_000.0), ("b", 2, 44_000.0), ("g", 1, 5.0)])
def test_a_channel_of_six_axes_that_is_clipped(kind, axis, end):
    clipped = []

    def clip(g, b):
        values = (g if kind == "g" else b)[:, axis]
        clipped[:] = np.flatnonzero(np.abs(values) > end)
        np.clip(values, -end, end, out=values)

    sensor = {"g": "accelerometer", "b": "magnetometer"}[kind]
    found = one(axes(change=clip), "run-saturated", "warning", sensor=sensor, axis="xyz"[axis])
    assert {abs(reading) for reading in found.values["reading"]} == {end}
    assert found.rows == tuple(clipped)
    assert (found.values["count"], found.values["total"]) == (len(clipped), len(hole()[0]))


def coarse(step, end):
    """Channels through a converter of so few steps that readings agree by chance, which ends at `end` of them."""
    return lambda channels: {kind: step * np.clip(np.round(v / step), -end, end) for kind, v in channels.items()}


def test_a_converter_of_12_bit_that_is_clipped():
    # 1600 counts a gravity
    found = check_run(calibrated(coarse(1.0, 1200)))
    assert {finding.code for finding in found} == {"run-saturated"}
    seen = [tuple(finding.values[name] for name in ("sensor", "axis", "reading", "count")) for finding in found]
    assert ("accelerometer", "y", (1200.0,), 8) in seen
    assert check_run(calibrated(coarse(1.0, 2047))) == []
    assert check_run(calibrated(coarse(4.0, 2047))) == []  # of 10 bit: readings agree, none is clipped


def test_exchanged_axes_are_named_beside_a_clipped_channel():
    def clip(g, b):
        np.clip(b[:, 0], -15_000.0, 15_000.0, out=b[:, 0])

    found = check_run(axes((0, 2, 1), change=clip))
    assert [(one.code, one.severity) for one in found] == [("run-axis-along", "refused"), ("run-saturated", "warning")]
    assert found[0].values["channel"] == "y"


@pytest.mark.parametrize(
    ("g_factor", "b_factor", "unit", "named"),
    [
        (1.0 / 9.80665, 1.0, "g", "m/s2"),
        (1000.0 / 9.80665, 1.0, "mg", "m/s2"),
        (9.80665, 1.0, "m/s2", "g"),
        (9.80665 / 1000.0, 1.0, "m/s2", "mg"),
        (1000.0, 1.0, "mg", "g"),
        (1.0 / 1000.0, 1.0, "g", "mg"),
        (1.0, 1e-3, "uT", "nT"),
        (1.0, 1e-5, "gauss", "nT"),
        (1.0, 1e3, "nT", "uT"),
        (1.0, 1e5, "nT", "gauss"),
        (1.0, 1e-2, "mG or uT", "nT or gauss"),
        (1.0, 1e2, "nT or gauss", "mG or uT"),
    ],
)
def test_a_field_in_another_unit(g_factor, b_factor, unit, named):
    right = axes()
    quantity = "magnetic field" if g_factor == 1.0 else "gravity"
    one(
        Run.of_fields(right.md, g_factor * right.g, b_factor * right.b),
        "run-unit",
        quantity=quantity,
        unit=unit,
        named=named,
    )


@pytest.mark.parametrize(("pairs", "refused"), [([(12, 60)], False), ([(12, 60), (70, 33)], True)])
def test_single_readings_given_again(pairs, refused):
    def paste(g, b):
        for here, there in pairs:
            g[there], b[there] = g[here], b[here]

    found = next(one for one in check_run(axes(change=paste)) if one.code == "run-rows-repeated")
    assert (found.severity == "refused") is refused
    assert found.rows == tuple(sorted(row for pair in pairs for row in pair))
    assert found.values["source_m"][0] == 342.0


def test_a_table_that_is_its_first_half_twice():
    readings = np.random.default_rng(1).normal(size=(20, 6))
    # not single rows that were copied, but a block
    assert copied_rows(readings[[*range(20), *range(20)]]) == []
    assert copied_block(readings[[*range(20), *range(20)]])[:3] == (0, 20, 20)
    assert copied_block(readings[[*range(4), *range(4)]], 4)[:3] == (0, 4, 4)
    assert copied_block(readings[[*range(4), *range(3)]], 4) is None


def test_attitudes_that_come_again_without_noise_are_no_copies():
    md, inclination, azimuth = hole(noise_deg=0.0)
    toolface = np.radians(90.0) * (np.arange(len(md)) % 4)
    g, b = fields(np.radians(azimuth), np.radians(inclination), toolface, DIP)
    run = Run.of_fields(md, (9.81 * g).round(4), (5e4 * b).round(1))
    assert "repeats" not in [one.group for one in check_run(run)]


@pytest.mark.parametrize("turn_deg", [60.0, 110.0])
def test_exchanged_columns_of_a_well_that_turns(turn_deg):
    """Built to 50 deg and turned by slides, both read with the noise of a survey; columns exchanged."""
    md = np.arange(0.0, 2700.0, 28.5)
    r = np.random.default_rng(7)
    inclination = np.interp(md, [0, 300, 1200, 2700], [0.5, 0.5, 50, 55]) + 0.1 * r.normal(size=md.size)
    azimuth = np.interp(md, [0, 1200, 2700], [30, 30, 30 + turn_deg]) + 0.3 * r.normal(size=md.size)
    inclination = np.abs(inclination)
    assert check_run(table(md, inclination, azimuth)) == []
    found = check_run(table(md, azimuth, inclination))
    assert found[0].code in ("run-angles", "run-top-exchanged")


def test_depths_in_feet_of_six_digits():
    """Round courses of metres, written with six digits as many programs do."""
    _, inclination, azimuth = hole()
    md = np.array([float(f"{v:.6g}") for v in 28.5 * np.arange(len(inclination)) / 0.3048])
    one(table(md, inclination, azimuth), "run-depths-feet", "warning")


def test_a_calibrated_run_as_it_should_be_passes():
    assert check_run(calibrated()) == []


def test_two_raw_rows_given_twice_are_warned_of():
    def twice(channels):
        for values in channels.values():
            values[60:62] = values[57:59]
        return channels

    found = one(calibrated(twice), "run-block-repeated", "warning", count=2, md_m=1710.0, last_m=1738.5)
    assert found.rows == (60, 61)


@pytest.mark.parametrize(("kind", "size", "axis"), [("b", 3000.0, 2), ("g", 0.4, 0)])
def test_one_digit_of_an_axis(kind, size, axis):
    def wrong(g, b):
        (g if kind == "g" else b)[33, axis] += size

    found = one(axes(change=wrong), "run-axis-digit", "warning", axis=f"{kind}{'xyz'[axis]}")
    assert found.rows == (33,)


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_of_both_triads_reversed_is_a_mirror(axis):
    """Every number a hypothesis is judged by is that of the right run: no reading shows it."""
    signs = np.where(np.arange(3) == axis, -1.0, 1.0)
    right, mirrored = axes(), axes(signs=signs)
    for name, values in right.totals.items():
        np.testing.assert_allclose(mirrored.totals[name], values, rtol=1e-12)
    ways = (smoothness(run.md, directions(run.inclination, run.azimuth)) for run in (right, mirrored))
    one_way, other = (way.log_likelihood() for way in ways)
    np.testing.assert_allclose(other, one_way, rtol=1e-9)
    assert check_run(mirrored) == []


def test_what_no_reading_shows():
    md, inclination, azimuth = hole()
    for other in ((azimuth + 180.0) % 360.0, (360.0 - azimuth) % 360.0, (azimuth + 7.0) % 360.0):
        assert check_run(table(md, inclination, other)) == []


def test_unusual_but_right_runs_pass():
    r = np.random.default_rng(3)
    # a kink off a whipstock, stations 0.5 m apart at a shoe, a gap of 300 m, a gyro each metre, due north
    md = np.concatenate(
        [np.arange(1000, 1300, 30.0), [1300.5], np.arange(1330, 1400, 1.0), np.arange(1700, 2300, 27.0)]
    )
    inclination = np.interp(md, [1000, 1330, 1345, 2300], [20, 20, 28, 60]) + r.normal(0, 0.15, md.size)
    azimuth = (np.interp(md, [1000, 1330, 1345, 2300], [358, 358, 370, 365]) + r.normal(0, 0.3, md.size)) % 360.0
    assert check_run(table(md, inclination, azimuth)) == []
    vertical = np.arange(0.0, 900.0, 10.0)
    wild = r.uniform(0.0, 360.0, vertical.size)
    assert check_run(table(vertical, r.uniform(0.0, 0.3, vertical.size), wild)) == []
    assert check_run(table([0.0, 30.0], [0.0, 50.0], [0.0, 180.0])) == []  # two stations tell nothing


def test_the_place():
    here, there = {"b": 55_000.0, "dip": np.radians(70.0)}, {"b": 50_000.0, "dip": np.radians(66.0)}
    places = {"": here, "sign of longitude": there}
    assert check_place({"b": 55_200.0, "dip": np.radians(70.3)}, places) == []
    (found,) = check_place({"b": 50_200.0, "dip": np.radians(66.2)}, places)
    assert (found.code, found.values["mistake"]) == ("run-place", "sign of longitude")


def test_angles_beside_six_axes():
    run = axes()
    i, a = run.inclination, run.azimuth
    assert check_angles(run, i, a, "magnetic") == []
    assert check_angles(run, i, a + 0.2, "true", 0.2) == []
    for mistake, inclination, azimuth in (
        ("other end", np.pi - i, a),
        ("grads", i / 0.9, a),
        ("half a turn", i, a + np.pi),
        ("mirrored", i, -a),
    ):
        (found,) = check_angles(run, inclination, azimuth, "magnetic")
        assert (found.code, found.values["mistake"]) == ("run-angle-differs", mistake)
    assert [one.code for one in check_angles(run, i, a, "true", 0.2)] == ["run-north-magnetic"]


def test_a_finding_is_ignored_by_code_or_group():
    md, inclination, azimuth = hole()
    found = check_run(table(md, 180.0 - inclination, azimuth))
    with pytest.raises(FileError) as caught:
        settled(found, (), "a.csv")
    assert caught.value.finding == found[0]
    for name in ("columns", "run-climbs"):
        assert [(one.code, one.severity) for one in settled(found, (name,))] == [("run-climbs", "ignored")]
    with pytest.raises(InputError) as caught:
        settled(found, ("colums",))
    assert caught.value.finding.code == "input-ignore-unknown"


def test_the_axis_that_brings_the_totals_back_is_named_and_none_where_two_are_wrong():
    """Station 4: one axis off, then one axis of each triad, which no single change of a reading explains."""
    random = np.random.default_rng(2)
    turned = Rotation.random(12, random_state=3).as_matrix()
    g, b = 9.81 * turned[:, :, 2], turned @ (50_000.0 * np.array([np.cos(1.2), 0.0, np.sin(1.2)]))
    g, b = g + random.normal(0.0, 1e-3, g.shape), b + random.normal(0.0, 20.0, b.shape)

    def fits():
        totals = {"g": np.linalg.norm(g, axis=1), "b": np.linalg.norm(b, axis=1), "dip": dip_angle(g, b)}
        return misread_axis(g, b, totals, 4)

    right = g[4, 1]
    g[4, 1] += 0.7
    found = fits()
    assert (found["axis"], found["unit"]) == ("gy", "m/s2")
    assert found["fits"] == pytest.approx(right, abs=0.02)
    b[4, 0] += 6000.0
    assert fits() == {}


@pytest.mark.parametrize(("sensor", "axis"), [("g", 0), ("g", 2), ("b", 1), ("b", 2)])
def test_a_channel_that_keeps_one_value_is_named_with_its_stations(sensor, axis):
    one = well(1)
    fields = {"g": one.g.copy(), "b": one.b.copy()}
    fields[sensor][-8:, axis] = fields[sensor][-8, axis]
    found = check_run(Run.of_fields(one.md, **fields))
    rows = tuple(range(len(one.md) - 8, len(one.md)))
    assert [(each.code, each.values["axis"], each.rows) for each in found] == [("sensor-frozen", "xyz"[axis], rows)]


BOARD = np.eye(3) + np.random.default_rng(7).normal(0.0, 0.03, (3, 3))


@pytest.mark.parametrize(
    ("change", "code", "axis"),
    [
        (lambda v: v * [1.05, 1.0, 1.0], "run-gain-step", "x"),
        (lambda v: v + [0.0, 0.03 * np.linalg.norm(v[0]), 0.0], "run-sensor-step", "y"),
        (lambda v: v @ BOARD, "run-sensor-step", "x, y, z"),
    ],
)
def test_a_small_change_of_a_sensor_midway_is_named_and_no_rows_are_exchanged(change, code, axis):
    one = well(5)
    half = np.arange(len(one.b))[:, None] >= len(one.b) // 2
    found = check_run(Run.of_fields(one.md, one.g, np.where(half, change(one.b), one.b)))
    assert [(each.code, each.values["axis"]) for each in found] == [(code, axis)]


def test_a_hole_that_goes_up_alone_is_named():
    r, runs = np.random.default_rng(3), {}
    for k, dip in enumerate(np.linspace(46.0, 86.0, 8)):
        i = np.radians(90.0 - dip + r.normal(0.0, 0.3, 14))
        runs[f"H{k}"] = Run(30.0 * np.arange(14), i, np.radians(90.0 + r.normal(0.0, 0.4, 14) / np.sin(i)))
    assert [one.code for one in check_holes(runs)] == []
    up = runs | {"H0": replace(runs["H0"], inclination=np.pi - runs["H0"].inclination)}
    assert [(one.code, one.severity) for one in check_holes(up)] == [("holes-up", "warning")]

"""Bench readings: what goes in comes out, and each kind of bad input is named."""

from __future__ import annotations

import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.refusals import coded, refused

from inclinometry.calibration import plans
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import FileError
from inclinometry.files.bench_csv import (
    field_basis,
    improbably_equal,
    read_bench,
    saturation,
    write_bench,
    write_log,
    write_raw_survey,
)
from inclinometry.files.log_csv import read_log
from inclinometry.files.profile import Profile, reading_with
from inclinometry.files.survey_csv import read_raw_survey
from inclinometry.files.table import read_table
from inclinometry.findings import Finding, without_notes
from inclinometry.rotations import dcm
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

from .surveys import saved

HEADER = "station,azimuth_deg,inclination_deg,toolface_deg,accel_x,accel_y,accel_z"
ROWS = ["1,0,0,0,1,2,3", "2,0,90,0,4,5,6", "3,0,90,90,7,9,8", "4,120,90,240,3,1,2"]


def read(folder, header=HEADER, rows=ROWS):
    path = folder / "bench.csv"
    return read_bench(saved(path, "\n".join([header, *rows]) + "\n"))


def error(folder, header=HEADER, rows=ROWS):
    with pytest.raises(FileError) as caught:
        read(folder, header, rows)
    return caught.value.finding.code


def warned(path):
    """Codes of the warnings that a file gives rise to, with the values of each."""
    return [(one.code, dict(one.values)) for one in without_notes(read_bench(path).findings)]


def test_the_contract_columns(tmp_path):
    header = (
        "station,azimuth_deg,inclination_deg,toolface_deg,temperature_degC,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z,"
        "gyro_x,gyro_y,gyro_z"
    )
    readings = read(tmp_path, header, [f"S{k},{k},{10 * k},{-k},20.5," + ",".join(str(k**c) for c in range(2, 11))
                                       for k in range(1, 5)])  # fmt: skip
    assert readings.station == ("S1", "S2", "S3", "S4")
    np.testing.assert_allclose(np.degrees(readings.dials), np.outer([1, 10, -1], [1, 2, 3, 4]), rtol=1e-15)
    assert readings.temperature.tolist() == [20.5] * 4
    for kind, first in (("accelerometer", 2), ("magnetometer", 5), ("gyro", 8)):
        powers = np.arange(1.0, 5.0)[:, None] ** (first + np.arange(3))
        np.testing.assert_array_equal(readings.channels[kind], powers)
    assert readings.findings == ()
    assert dict(readings.sd) == {}


@settings(max_examples=40, deadline=None)
@given(st.data(), st.integers(1, 6), st.integers(2, 5))
def test_write_then_read_gives_the_same_readings(tmp_path_factory, data, size, sensors):
    path = tmp_path_factory.getbasetemp() / "round.csv"
    signals = data.draw(arrays(float, (size, sensors), elements=st.floats(-1e9, 1e9), unique=True))
    angles = data.draw(arrays(float, (3, size), elements=st.floats(10.0, 170.0)))
    count = data.draw(st.none() | arrays(float, size, elements=st.integers(1, 9)))
    written = BenchReadings(
        {"magnetometer": signals},
        *np.radians(angles),
        sd={"magnetometer": np.abs(signals) + 1.0},
        count=count,
        roll_set=["a"] * size,
        units={"magnetometer": "nT"},
        reference={"g": 9.81, "dip": 1.25},
        temperature=angles[0],
    )
    write_bench(written, path)
    found = read_bench(path)
    np.testing.assert_array_equal(found.channels["magnetometer"], signals)
    # sd is multiplied and divided by sqrt(count): two roundings
    np.testing.assert_allclose(found.sd["magnetometer"], written.sd["magnetometer"], rtol=4e-16)
    # written to 1e-10 deg
    np.testing.assert_allclose(np.degrees(found.dials), angles, atol=1e-10)
    np.testing.assert_array_equal(found.temperature, angles[0])
    assert found.units == written.units
    assert (found.station, found.roll_set) == (written.station, written.roll_set)
    assert found.reference["g"] == 9.81
    assert found.reference["dip"] == pytest.approx(1.25, abs=1e-12)


def test_same_readings_same_bytes(tmp_path):
    readings = read(tmp_path)
    write_bench(readings, tmp_path / "a.csv")
    write_bench(read_bench(tmp_path / "a.csv"), tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert "120,90,240" in (tmp_path / "a.csv").read_text()


def test_stations_with_awkward_names(tmp_path):
    names = ["#1", "a,b", 'say "x"', "Ж"]
    write_bench(BenchReadings({"gyro": [[1, 2], [2, 3], [3, 5], [4, 4]]}, station=names), tmp_path / "a.csv")
    assert read_bench(tmp_path / "a.csv").station == tuple(names)
    with refused("file-characters"):
        write_bench(BenchReadings({"gyro": [[1, 2]]}, station=["a\nb"]), tmp_path / "b.csv")
    assert not (tmp_path / "b.csv").exists()


def test_numbered_and_two_sensor_triads(tmp_path):
    readings = read(tmp_path, "accel_1,accel_2,accel_3,accel_4,mag_x,mag_y", ["1,2,3,4,5,6", "2,3,4,5,7,7"])
    assert readings.channels["accelerometer"].shape == (2, 4)
    assert readings.channels["magnetometer"].tolist() == [[5, 6], [7, 7]]
    assert readings.azimuth is None
    assert [(one.code, one.values["lacking"]) for one in readings.findings] == [("table-channels", ("mag_z",))]


def test_one_sensor(tmp_path):
    readings = read(tmp_path, "accel_x,mag_1", ["1,5", "2,7"])
    assert readings.channels["accelerometer"].tolist() == [[1], [2]]
    assert readings.channels["magnetometer"].tolist() == [[5], [7]]
    assert [one.values["lacking"] for one in readings.findings] == [("accel_y", "accel_z")]


REFUSED = json.loads((Path(__file__).parents[1] / "reference" / "refused" / "bench.json").read_text("utf-8"))["reader"]


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_is_named_with_its_place(tmp_path, name):
    about = REFUSED[name]
    assert about["says"] == f"[{error(tmp_path, about['lines'][0], about['lines'][1:])}]"


def test_sd_is_that_of_the_mean(tmp_path):
    readings = read(tmp_path, "accel_x,accel_y,accel_x_sd,accel_y_sd,count", ["1,2,3,6,9", "2,3,4,8,16"])
    assert readings.sd["accelerometer"].tolist() == [[1, 2], [1, 2]]


def test_repeats_are_averaged_with_their_scatter(tmp_path):
    rng = np.random.default_rng(5)
    noise = rng.normal(0.0, [0.5, 2.0, 0.5], (40, 5, 3))
    rows = [f"{k},0,{k},0,{x:.9f},{y:.9f},{z:.9f}" for k in range(40) for x, y, z in noise[k] + k]
    rows.append("once,0,90,0,5,5,5")
    readings = read(tmp_path, rows=rows)
    assert len(readings) == 41
    np.testing.assert_allclose(
        readings.channels["accelerometer"][:40] - np.arange(40)[:, None], noise.mean(1), atol=2e-9
    )
    assert readings.count.tolist() == [5.0] * 40 + [1.0]
    # 160 degrees of freedom: relative standard error of a standard deviation 1/sqrt(320) = 5.6 %, three of them
    np.testing.assert_allclose(readings.sd["accelerometer"][0], np.array([0.5, 2.0, 0.5]) / np.sqrt(5.0), rtol=0.17)
    np.testing.assert_allclose(readings.sd["accelerometer"][40], readings.sd["accelerometer"][0] * np.sqrt(5.0))
    (one,) = readings.findings
    assert (one.code, one.values["total"], one.values["stations"]) == (
        "readings-averaged", 40, tuple(map(str, range(10))),
    )  # fmt: skip


def test_few_repeats_pool_the_triad_and_stated_noise_counts_too(tmp_path):
    rows = ["1,0,0,0,1,2,3", "1,0,0,0,3,2,3", *ROWS[1:]]
    # squares of deviations 2, 0, 0 over one degree of freedom each: mean 2/3
    np.testing.assert_allclose(read(tmp_path, rows=rows).sd["accelerometer"][1], np.sqrt(2.0 / 3.0))
    header = HEADER + ",accel_x_sd,accel_y_sd,accel_z_sd"
    sd = read(tmp_path, header, [f"{row},0.1,0.1,5" for row in rows]).sd["accelerometer"]
    np.testing.assert_allclose(sd[0], [np.sqrt(1 / 3), np.sqrt(1 / 3), 5 / np.sqrt(2)])


def test_equal_repeats_give_no_false_certainty(tmp_path):
    readings = read(tmp_path, rows=[ROWS[0], *ROWS])
    assert dict(readings.sd) == {}
    assert readings.channels["accelerometer"][0].tolist() == [1.0, 2.0, 3.0]


def test_what_is_not_a_repeat(tmp_path):
    header = HEADER + ",temperature_degC"
    warm = [f"{row},{t}" for t in (20, 60) for row in ROWS]
    assert len(read(tmp_path, header, warm)) == 8
    assert len(read(tmp_path, header, [f"{row},{t}" for t in (20, 21.5) for row in ROWS])) == 4
    # 0.01 deg apart: another setting of the same station, neither averaged nor refused
    assert len(read(tmp_path, rows=[*ROWS, "4,120.01,90,240,3,1,2"])) == 5
    # a full turn is no difference
    assert len(read(tmp_path, rows=[*ROWS, "2,360,90,0,4,5,7"])) == 4


def test_repeats_without_angles_are_kept_apart(tmp_path):
    readings = read(tmp_path, "station,accel_x,accel_y,roll_set", ["1,1,2,a", "1,2,4,a", "2,3,3,"])
    assert len(readings) == 3
    assert [(one.code, one.values["stations"]) for one in readings.findings if one.code != "table-channels"] == [
        ("readings-rows-kept", ("1",))
    ]
    assert readings.roll_set == ("a", "a", "")


def test_roll_sets_of_a_profile(tmp_path):
    rows = [f"{k},{k},{k * k},{-k}" for k in range(1, 7)]
    with reading_with(Profile(roll_sets={"a": (2, 3), "b": (5, 6)})):
        assert read(tmp_path, "station,accel_x,accel_y,accel_z", rows).roll_set == ("", "a", "a", "", "b", "b")
        short = read(tmp_path, "station,accel_x,accel_y,accel_z", rows[:5])
        own = read(tmp_path, "station,accel_x,accel_y,accel_z,roll_set", [f"{row},mine" for row in rows])
    assert not short.roll_set
    assert (short.findings[-1].code, dict(short.findings[-1].values)) == (
        "readings-sets-unused", {"rows": 5, "expected": 6},
    )  # fmt: skip
    assert own.roll_set == ("mine",) * 6


PLANS = {
    "twelve": plans.twelve(),
    "forty": plans.twelve(8, 4),
    "cube": plans.orthogonal(),
    "half": plans.half(),
    "two-face": plans.two_face(),
    "rotations": plans.rotations(),
    "rotations 0/90": plans.rotations(0.0, np.pi),
}


def angle_rows(plan, convert):
    angles = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    return [f"{k},{a!r},{i!r},{t!r},{k},{k**2},{-k}" for k, (a, i, t) in enumerate(convert(angles).tolist())]


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_radians_are_recognised_and_degrees_never_mistaken(tmp_path, plan):
    assert error(tmp_path, rows=angle_rows(plan, lambda a: a)) == "table-radians"
    assert error(tmp_path, rows=angle_rows(plan, lambda a: a.round(3))) == "table-radians"
    assert len(read(tmp_path, rows=angle_rows(plan, np.degrees))) == len(plan)


@pytest.mark.parametrize(
    "degrees",
    [
        [(0, 0, 0)] * 5,
        [(k * 45, 1.5, k * 90) for k in range(5)],
        [(0, 0.5 * k, 0) for k in range(7)],
        [(0.01 * k, 2.0 + 0.01 * k, 0.013 * k) for k in range(9)],
        [(0, 3, k) for k in range(7)],
        [(0, 3, 0.1 + 0.6 * k) for k in range(5)],
        [(0.003 * k, 90, 0.5 + 0.01 * k) for k in range(5)],
        [(0, 1.57, 1.57), (0, 1.57, 3.14), (0, 1.57, 4.71)],
    ],
)
def test_genuine_small_angles_are_read(tmp_path, degrees):
    rows = [f"{k},{a},{i},{t},{k},{k**2},{-k}" for k, (a, i, t) in enumerate(degrees)]
    assert len(read(tmp_path, rows=rows)) == len(degrees)


def bench(plan, rng, scale, misalignment, noise, low=-np.inf, high=np.inf):
    """A plain simulation: accelerometer of a level rig and magnetometer at dip 70, rounded to whole counts."""
    turned = dcm(plan.azimuth, plan.inclination, plan.toolface)
    dip = np.radians(70.0)
    channels = {}
    for kind, field in (("accelerometer", [0.0, 0.0, 1.0]), ("magnetometer", [np.cos(dip), 0.0, np.sin(dip)])):
        tensor = scale * (np.eye(3) + misalignment * rng.normal(size=(3, 3)))
        values = turned @ field @ tensor.T + 20.0 * rng.normal(size=3)
        values += noise * rng.normal(size=values.shape)
        channels[kind] = np.round(np.clip(values, low, high))
    return BenchReadings(channels, plan.azimuth, plan.inclination, plan.toolface)


@pytest.mark.long
@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_no_false_alarm_of_saturation(tmp_path, plan):
    # aligned and skewed tools, 7 to 15 bits, with and without noise; 2047 counts per g is itself a rail
    rng = np.random.default_rng(11)
    for scale in (100, 1638, 2047, 32000):
        for misalignment in (0.0, 0.1):
            for noise in (0.0, 0.4):
                write_bench(bench(plan, rng, scale, misalignment, noise), tmp_path / "a.csv")
                assert warned(tmp_path / "a.csv") == []


def test_rails_of_converters_are_named(tmp_path):
    rng = np.random.default_rng(12)
    write_bench(bench(plans.twelve(), rng, 3000, 0.02, 0.4, -2048, 2047), tmp_path / "a.csv")
    facts = {"channels": ("accel_x",), "values": ("-2048",), "count": 3}
    assert ("readings-saturated", facts) in warned(tmp_path / "a.csv")
    unsigned = bench(plans.orthogonal(), rng, 2500, 0.02, 0.4, -2048, 2047)
    shifted = {kind: values + 2048 for kind, values in unsigned.channels.items()}
    write_bench(BenchReadings(shifted, *unsigned.dials), tmp_path / "b.csv")
    notes = warned(tmp_path / "b.csv")
    for end in ("0", "4095"):
        assert ("readings-saturated", {"channels": ("accel_z",), "values": (end,), "count": 4}) in notes


def test_clipping_elsewhere_is_named_when_the_other_stations_predict_more(tmp_path):
    rng = np.random.default_rng(13)
    write_bench(bench(plans.orthogonal(), rng, 1638, 0.02, 0.4, high=1400), tmp_path / "a.csv")
    facts = {"channels": ("accel_x",), "values": ("1400",), "count": 4}
    assert ("readings-saturated", facts) in warned(tmp_path / "a.csv")


def simulated(plan, seed, bits, setting_sd=0.0):
    rig = Rig(setting_sd=setting_sd)
    tool = realistic_tool(seed, bits=bits)
    run = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, bits=bits, seed=seed)
    return {kind: run.signals[kind] for kind in ("accelerometer", "magnetometer")}


def said(plan, kind, values):
    angles = (plan.azimuth, plan.inclination, plan.toolface)
    return saturation(kind, values, ["x", "y", "z"], angles, np.arange(len(values)))


@pytest.mark.long
@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_no_false_alarm_in_simulated_runs(plan):
    for seed in range(100):
        for setting_sd in (0.0, np.radians(0.1)):
            for bits in (12, 16, 20):
                for kind, values in simulated(plan, seed, bits, setting_sd).items():
                    assert said(plan, kind, values) == []


@pytest.mark.parametrize("plan", [plans.twelve(), plans.orthogonal(), plans.half()])
def test_a_channel_clipped_at_both_ends(plan):
    # so symmetrically that the fit takes it for less gain: the last digits alone tell
    for seed in range(10):
        values = simulated(plan, seed, 20, np.radians(0.1))["magnetometer"].copy()
        limit = np.round(0.7 * np.abs(values[:, 1]).max())
        values[:, 1] = np.clip(values[:, 1], -limit, limit)
        ends = [int((values[:, 1] == end).sum()) for end in (-limit, limit)]
        notes = said(plan, "magnetometer", values)
        assert bool(notes) == (sum(ends) - 2 >= 2 and max(ends) >= 2), (seed, ends, notes)


def test_two_readings_that_agree_by_chance_say_nothing():
    # at one end of one channel alone; once more at the other end, and saturation cannot be excluded
    plan = plans.twelve()
    values = simulated(plan, 0, 20)["magnetometer"].copy()
    order = np.argsort(values[:, 1])
    values[order[-2], 1] = values[order[-1], 1]
    assert said(plan, "magnetometer", values) == []
    values[order[1], 1] = values[order[0], 1]
    found = said(plan, "magnetometer", values)
    assert {(one.code, one.values["count"]) for one in found} <= {("readings-saturated-maybe", 2)}


def test_a_reading_at_the_end_of_a_converter_that_the_others_predict_is_none_clipped():
    # x points up in three stations and reads 2047, all that 12 bits hold; what lies between foretells the very number
    rng = np.random.default_rng(3)
    angles = [np.append(rng.uniform(0.0, np.pi, 40), [one] * 3) for one in (0.0, np.pi / 2.0, 0.0)]
    gravity = dcm(*angles)[:, :, 2]
    gravity *= np.sign(gravity[-1, 0])
    values = np.round(gravity * [2000.0, 1990.0, 1980.0] + [47.0, 10.0, -10.0])
    assert values[-3:, 0].tolist() == [values[:, 0].max()] * 3 == [2047.0] * 3
    assert saturation("accelerometer", values, "xyz", tuple(angles), np.arange(43)) == []
    values[:, 0] = np.minimum(np.round(gravity[:, 0] * 2600.0 + 47.0), 2047.0)
    assert "readings-saturated" in coded(saturation("accelerometer", values, "xyz", tuple(angles), np.arange(43)))


def test_clipping_in_twelve_positions():
    # the three stations with x up are at one attitude, which the other nine do not predict; only noise tells. A
    # converter of 20 bits has steps far below it; the bound leaves out tools whose other flat stations chance to agree
    plan, found, magnetic = plans.twelve(), 0, 0
    for seed in range(40):
        clean = simulated(plan, seed, 20)
        values = clean["accelerometer"].copy()
        limit = np.round(0.89 * values[:, 0].min())
        values[:, 0] = np.maximum(values[:, 0], limit)
        one = Finding("readings-saturated-maybe", {"channels": ("x",), "values": (f"{limit:.0f}",), "count": 3})
        found += one in said(plan, "accelerometer", values)
        values = clean["magnetometer"].copy()
        values[:, 0] = np.maximum(values[:, 0], np.round(0.89 * values[:, 0].min()))
        magnetic += any(one.values["channels"] == ("x",) for one in said(plan, "magnetometer", values))
    assert found >= 20
    assert magnetic >= 20


def test_equal_readings_of_a_magnetometer_at_one_attitude_say_nothing():
    """Three times the same station: the direction of the field is fitted, and follows what is read there."""
    plan = plans.twelve()
    for seed in range(4):
        clean = simulated(plan, seed, 20)["magnetometer"]
        for index in range(3):
            place = int(np.argmax(clean[:, index]))
            angles = [np.append(one, [one[place]] * 2) for one in (plan.azimuth, plan.inclination, plan.toolface)]
            values = np.vstack([clean, clean[[place, place]]])
            values[[place, 12, 13], index] = np.round(np.sort(clean[:, index])[-2:].mean())
            assert saturation("magnetometer", values, ["x", "y", "z"], tuple(angles), np.arange(14)) == []


def test_a_hundred_thousand_stations_take_memory_in_proportion():
    # half of them read the extreme: an array of stations by stations would take 20 GB
    rng = np.random.default_rng(15)
    azimuth, inclination, toolface = rng.uniform(0.0, np.pi, (3, 100_000))
    gravity = dcm(azimuth, inclination, toolface)[:, :, 2]
    values = np.maximum(np.round(gravity * 1e5), -30_000.0)
    tracemalloc.start()
    notes = saturation("accelerometer", values, "xyz", (azimuth, inclination, toolface), np.arange(100_000))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200e6
    assert (notes[0].values["channels"], notes[0].values["values"]) == (("x",), ("-30000",))


def test_readings_that_are_equal_everywhere_do_not_say_that_some_are_improbably_so():
    """There is no scatter to judge them by: six stations, the first three at one attitude."""
    cosines = dcm(np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]), np.full(6, 0.5), np.zeros(6)).reshape(6, 9)
    at, equal = np.arange(6) < 3, np.full((6, 3), 100.0)
    assert not improbably_equal(equal, 0, at, field_basis(equal, cosines))


def whole_counts(plan, seed):
    """A right run of a realistic tool in whole counts: magnetometer (n, 3), settings."""
    p = {"twelve": plans.twelve, "half": plans.half}[plan]()
    noise = {"accelerometer": 0.5, "magnetometer": 0.5}
    rig = Rig(dip=np.radians(65.0), setting_sd=np.radians(0.1))
    run = simulate_bench(realistic_tool(seed), rig, p.azimuth, p.inclination, p.toolface, noise=noise, seed=seed)
    values = np.round(run.signals["magnetometer"])
    return values, (run.azimuth, run.inclination, run.toolface)


@pytest.mark.parametrize("plan", ["twelve", "half"])
@pytest.mark.parametrize("seed", range(3))
def test_channels_clipped_at_both_ends_of_few_positions(plan, seed):
    """Twelve positions take a channel that rests at both ends for one of less gain; its converter's end tells."""
    values, angles = whole_counts(plan, seed)
    names, rows = ["mag_x", "mag_y", "mag_z"], np.arange(len(values))
    assert saturation("magnetometer", values, names, angles, rows) == []
    end = np.round(0.8 * np.abs(values).max())
    said = saturation("magnetometer", np.clip(values, -end, end), names, angles, rows)
    assert any(f"{end:.0f}" in str(one.values) for one in said), said
    alone = values.copy()
    end = np.round(0.6 * np.abs(values[:, 1]).max())
    alone[:, 1] = np.clip(values[:, 1], -end, end)
    said = saturation("magnetometer", alone, names, angles, rows)
    facts = {"channels": ("mag_y",), "values": (f"{-end:.0f}", f"{end:.0f}")}
    assert any(one.code == "readings-saturated" and facts.items() <= one.values.items() for one in said), said


def test_equal_ends_of_calibrated_or_perfect_channels_say_nothing():
    values, angles = whole_counts("twelve", 1)
    rows = np.arange(len(values))
    end = np.round(0.8 * np.abs(values).max())
    clipped = np.clip(values, -end, end)
    # in a unit the gains are alike, and so may the ends be
    units = ["mag_x_nT", "mag_y_nT", "mag_z_nT"]
    assert "readings-saturated" not in coded(saturation("magnetometer", clipped, units, angles, rows))
    perfect = np.round(1000.0 * dcm(*angles)[:, :, 2])
    assert saturation("accelerometer", perfect, "xyz", angles, rows) == []


@pytest.mark.parametrize(("steps", "improbable"), [(9.0, False), (10.0, True)])
def test_how_much_others_scatter_where_three_readings_agree(steps, improbable):
    """Three readings along gravity, three across it: of each three -s, 0 and s.

    By (1 / (s sqrt(2 pi)))^2 / sqrt(3) < 1e-3 s is 9.6 steps; what agrees is not among the scatter it is judged by.
    """
    turned = dcm(np.zeros(6), np.repeat([0.0, np.pi / 2.0], 3), np.zeros(6))[:, :, 2]
    # one step apart
    values = 1e4 * turned + [0.0, 1.0, 0.0] + steps * np.tile([-1.0, 0.0, 1.0], 2)[:, None]
    values[:3, 2] = 1e4
    basis = np.column_stack([turned, np.ones(6)])
    assert improbably_equal(values, 2, np.arange(6) < 3, basis) is improbable


def test_saturation_without_angles(tmp_path):
    rng = np.random.default_rng(14)
    values = rng.normal(size=(40, 3))
    write_bench(BenchReadings({"accelerometer": np.minimum(values, 0.5)}), tmp_path / "a.csv")
    assert len(warned(tmp_path / "a.csv")) == 3
    write_bench(BenchReadings({"accelerometer": np.round(values)}), tmp_path / "b.csv")
    assert warned(tmp_path / "b.csv") == []


def test_a_repeated_reading_is_no_rail(tmp_path):
    rows = [*ROWS, *["5,0,45,0,2047,1,7"] * 4]
    assert [(one.code, one.values["stations"]) for one in read(tmp_path, rows=rows).findings] == [
        ("readings-averaged", ("5",))
    ]


def test_a_channel_that_never_changes_along_the_hole(tmp_path):
    rolls = [f"{k},0,90,{90 * k},{k},{k**2},7" for k in range(4)]
    one = read(tmp_path, rows=rolls).findings[0]
    assert (one.code, one.severity, one.values["sensor"]) == ("readings-channel-constant", "warning", "accel_z")


def test_unknown_columns_are_noted(tmp_path):
    readings = read(tmp_path, HEADER + ",operator", [f"{row},Ann" for row in ROWS])
    assert [(one.code, one.values["names"]) for one in readings.findings] == [("table-unused", ("operator",))]


def test_numbers_too_large_to_use(tmp_path):
    assert len(read(tmp_path, rows=["1,0,0,0,1,2,3", "2,0,90,0,-1e15,1,1"])) == 2
    for name, reader in (("md_m", read_raw_survey), ("time_s", read_log)):
        with refused("input-value", error=FileError, name="accel_z"):
            reader(saved(tmp_path / "a.csv", f"{name},accel_x,accel_y,accel_z\n1,1,1,1\n2,1,1,1e16\n"))
    with refused("input-value", name="accelerometer[0, 1]"):
        BenchReadings({"accelerometer": [[1.0, 1e16]]})
    with refused("input-value", name="accelerometer.sd"):
        BenchReadings({"accelerometer": [[1.0, 2.0]]}, sd={"accelerometer": [[1.0, 1e16]]})


@pytest.mark.parametrize("name", ["accel_x_bananas", "accel_x_bananas_sd", "mag_1_nt_sd"])
def test_units_that_are_not_known_in_a_log(tmp_path, name):
    with refused("table-unit", "table-near", error=FileError):
        read_log(saved(tmp_path / "log.csv", f"time_s,accel_x,accel_y,{name}\n0,1,2,3\n"))


@pytest.mark.long
def test_a_million_lines(tmp_path):
    rng = np.random.default_rng(0)
    path = tmp_path / "big.csv"
    names = "station,azimuth_deg,inclination_deg,toolface_deg,temperature_degC," + ",".join(
        f"{kind}_{axis}" for kind in ("accel", "mag", "gyro") for axis in "xyz"
    )
    with path.open("w") as stream:
        stream.write(names + "\n")
        for start in range(0, 1_000_000, 10_000):
            cells = rng.integers(-1_000_000, 1_000_000, (10_000, 9))
            stream.writelines(
                f"{start + k},12.5,45.25,310.125,20.5,{','.join(map(str, row))}\n"
                for k, row in enumerate(cells.tolist())
            )
    table = read_table(path)
    assert len(table) == 1_000_000
    np.testing.assert_array_equal(table.number("gyro_z")[-10_000:], cells[:, 8])
    assert table.lines[-1] == 1_000_001


def test_raw_surveys_and_logs_are_read_as_they_were_written(tmp_path):
    channels = {"accelerometer": np.array([[1.5, -2.0, 3.0], [4.0, 5.0, -6.0]]), "gyro": np.array([[7.0], [8.5]])}
    for temperature in (None, np.array([20.5, 21.0])):
        write_raw_survey(tmp_path / "raw.csv", np.array([10.0, 40.5]), channels, temperature)
        write_log(tmp_path / "log.csv", np.array([0.0, 0.25]), channels, temperature)
        raw, log = read_raw_survey(tmp_path / "raw.csv"), read_log(tmp_path / "log.csv")
        assert (raw.md.tolist(), log.time.tolist()) == ([10.0, 40.5], [0.0, 0.25])
        for found in (raw, log):
            assert (found.temperature is None) == (temperature is None)
            for kind, values in channels.items():
                np.testing.assert_array_equal(found.channels[kind], values)
        assert (raw.temperature is None) or raw.temperature.tolist() == [20.5, 21.0]
    table = raw.to_dict()
    assert list(table) == ["md_m", "accel_x", "accel_y", "accel_z", "gyro_x", "temperature_degC"]
    assert (table["accel_y"].tolist(), len(raw)) == ([-2.0, 5.0], 2)
    assert "temperature_degC" not in replace(raw, temperature=None).to_dict()


def test_four_stations_in_radians_are_enough_to_be_seen_and_three_are_not(tmp_path):
    quarter = ["0", "1.5708", "3.1416", "4.7124"]
    rows = [f"{k},0.123,1.5708,{t},{k},{k * k},{-k}" for k, t in enumerate(quarter)]
    assert len(read(tmp_path, rows=rows[:3])) == 3
    # beyond a turn, or beyond pi of inclination, they are none
    for place, value in ((1, "6.5"), (2, "3.2"), (3, "6.3")):
        cells = [row.split(",") for row in rows]
        cells[3][place] = value
        assert len(read(tmp_path, rows=[",".join(c) for c in cells])) == 4


def test_repeats_at_the_limits_of_angle_and_temperature(tmp_path):
    """Within 2 degC one station, beyond it two; 0.5 deg apart a contradiction, below it another setting."""
    header = HEADER + ",temperature_degC"
    for warmer, size in ((22.0, 1), (22.1, 2), (18.0, 1), (17.9, 2)):
        assert len(read(tmp_path, header, ["1,0,10,0,1,2,3,20", f"1,0,10,0,2,3,4,{warmer}"])) == size
    assert len(read(tmp_path, rows=["1,0,10,0,1,2,3", "1,0,10.49,0,2,3,4"])) == 2
    # ten repeated stations are named, of more the others are counted
    rows = [f"{k},0,{10 * k},0,{k},{x},{-k}" for k in range(12) for x in (1, 2)]
    (one,) = read(tmp_path, rows=rows).findings
    assert (one.code, one.severity, one.values["total"]) == ("readings-averaged", "note", 12)
    assert one.values["stations"] == tuple(map(str, range(10)))


def test_readings_averaged_in_a_row_count_in_the_mean_s_deviation(tmp_path):
    """Two rows of 4 and 12 readings at one station: the stated deviations of their means, combined."""
    header = HEADER + ",accel_x_sd,accel_y_sd,accel_z_sd,count"
    rows = ["1,0,0,0,1,2,3,4,4,4,4", "1,0,0,0,1,2,3,6,6,6,9", "2,0,90,0,5,6,7,2,2,2,1"]
    found = read(tmp_path, header, rows)
    assert found.count.tolist() == [13.0, 1.0]
    # 4 / sqrt(4) and 6 / sqrt(9) are both 2; the mean of two has 2 / sqrt(2)
    np.testing.assert_allclose(found.sd["accelerometer"], [[np.sqrt(2.0)] * 3, [2.0] * 3])


def test_names_are_compared_without_case(tmp_path):
    names = "STATION,Azimuth_deg,Inclination_deg,Toolface_Deg,Accel_X_MG,Accel_Y_mg,accel_z_Mg"
    rows = "".join(f"S{k},0,{k},0,{k % 2},{k % 3},{k}\n" for k in range(5))
    found = read_bench(saved(tmp_path / "a.csv", f"{names}\n{rows}"))
    assert (found.station[1], found.channels["accelerometer"][1].tolist()) == ("S1", [1.0, 1.0, 1.0])

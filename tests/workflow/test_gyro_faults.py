"""Channels that fail within a run, the direction of the index, angles that a station cannot have."""

import csv
import dataclasses

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.gyro_csv import read_gyro_run
from inclinometry.gyro.faults import find_faults, rate_density
from inclinometry.gyro.indexing import average_index, index_batches
from inclinometry.gyro.joint import earth_in_tool
from inclinometry.workflow.gyro import GyroOptions, north_run, write_run

HERE, DEG_H, DOWN = Site(latitude=np.pi / 4), np.radians(1.0) / 3600.0, GyroOptions(hole="down")
NOISE = 0.03 * DEG_H  # of one reading: 0.005 deg/sqrt(h) over 100 s


def spoilt(columns, kind, channels, start, of="gyro", last=10**9):
    """From a station on channels keep one value, read a multiple, or are ten times as noisy."""
    values = columns["channels"][of].copy()
    late = np.array([start <= int(s) <= last for s in columns["station"]])
    for place in channels:
        if kind == "one-value":
            values[late, place] = values[late, place][0]
        elif kind == "size":
            values[late, place] *= 2.0
        elif kind == "sign":
            values[late, place] *= -1.0
        else:
            values[late, place] += 10.0 * NOISE * np.random.default_rng(1).standard_normal(late.sum())
    return {"channels": {**columns["channels"], of: values}}


@pytest.mark.parametrize(
    ("kind", "channels", "code"),
    [
        ("one-value", [0], "gyro-fault-value"),
        ("size", [1], "gyro-fault-size"),
        ("sign", [0, 1], "gyro-fault-size"),
        ("noise", [0], "gyro-fault-noise"),
    ],
)
def test_a_channel_that_fails_is_named_and_its_stations_get_no_azimuth(simulated, tmp_path, kind, channels, code):
    data, run = simulated(change=lambda c: spoilt(c, kind, channels, 11))
    found = north_run(data, HERE, options=DOWN)
    values = of(found, code).values
    assert values["channels"] == (tuple(f"gyro_{'xy'[place]}" for place in channels),)
    assert values["stations"] in ("10 .. 20", "11 .. 20")
    assert values["effect"] == "no azimuth there"
    assert values.get("times") == {"size": (2.0,), "sign": (-1.0,)}.get(kind, values.get("times"))
    assert np.isnan(found.north.azimuth[10:]).all()
    assert all(flags == ("channel",) for flags in found.north.flags[10:])
    # the others have the azimuths and uncertainties of a run without the fault: noise is estimated without it
    off = (found.north.azimuth[:9] - run.azimuth[:9] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(off).max() < 5.0 * found.north.u("azimuth")[:9].max() < np.radians(2.0)
    np.testing.assert_allclose(found.north.inclination, run.inclination, atol=1e-3)
    write_run(found, tmp_path / "stations.csv")
    rows = list(csv.DictReader((tmp_path / "stations.csv").read_text().splitlines()))[10:]
    assert {row["azimuth_deg"] + row["u_azimuth_deg"] for row in rows} == {""}
    assert all(row["inclination_deg"] for row in rows)


def of(found, code):
    """The one finding of a code."""
    [one] = [one for one in found.survey.findings if one.code == code]
    return one


def off_deg(found, run):
    off = np.degrees(found.north.azimuth - run.azimuth)
    return np.abs((off + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize(("first", "last"), [(10, 10), (10, 11), (19, 20)])
def test_a_sign_that_changes_at_one_or_two_stations_leaves_no_azimuth_there(simulated, first, last):
    def change(columns):
        one = {
            kind: values[:, :1] for kind, values in spoilt(columns, "sign", [0], first, last=last)["channels"].items()
        }
        return {"channels": {**one, "accelerometer": columns["channels"]["accelerometer"][:, :1]},
                "letters": {"accelerometer": "x", "gyro": "x"}}  # fmt: skip

    data, run = simulated(change=change)
    found = north_run(data, HERE, options=DOWN)
    assert np.isnan(found.north.azimuth[first - 1 : last]).all()
    assert np.nanmax(off_deg(found, run)) < 1.0
    assert np.isfinite(found.north.azimuth).sum() >= 19 - (last - first + 1)


@pytest.mark.parametrize("factor", [0.8, 1.0 / 0.8, 2.0])
def test_a_jump_of_the_scale_factor_is_named_and_keeps_its_azimuths(simulated, factor):
    def change(columns):
        late = np.array([[int(s) >= 10] for s in columns["station"]])
        gyro = columns["channels"]["gyro"] * np.where(late, factor, 1.0)
        return {"channels": {**columns["channels"], "gyro": gyro}}

    for seed in (1, 2):
        data, run = simulated(seed, change)
        found = north_run(data, HERE, options=DOWN)
        effect = "azimuth does not depend on it"
        wanted = {"channels": ("gyro_x", "gyro_y"), "station": "10", "effect": effect}
        assert of(found, "gyro-fault-jump").values == wanted
        assert (off_deg(found, run) < 5.0 * np.degrees(found.north.u("azimuth"))).all()
        assert ["scale" in flags for flags in found.north.flags] == [False] * 9 + [True] * 11


@pytest.mark.parametrize(
    ("kind", "code", "effect"),
    [
        ("size", "gyro-fault-jump", "it is not used"),
        ("one-value", "gyro-fault-value", "it is not used there"),
    ],
)
def test_a_gyro_along_the_tool_that_fails_is_not_used(simulated, kind, code, effect):
    data, run = simulated(change=lambda c: spoilt(c, kind, [2], 6), axes=3)
    found = north_run(data, HERE, options=DOWN)
    said = of(found, code)
    assert said.values["effect"] == effect
    assert "gyro_z" in said.values["channels"] or ("gyro_z",) in said.values["channels"]
    assert "6" in str(said)
    assert np.nanmax(off_deg(found, run)) < 1.0
    assert np.isfinite(found.north.azimuth).all()
    assert not any("noisy" in flags for flags in found.north.flags)


def test_a_gyro_that_doubles_early_is_no_mistake_of_unit(simulated):
    data, _ = simulated(change=lambda c: spoilt(c, "size", [0], 5))
    found = north_run(data, HERE, options=DOWN)
    assert np.isnan(found.north.azimuth[4:]).all()
    assert np.isfinite(found.north.azimuth[:4]).all()


def test_a_fault_without_noise_is_named(simulated):
    data, _ = simulated(
        change=lambda c: spoilt(c, "size", [0], 10), scenario="cool", arw=1e-15, accelerometer_noise=0.0
    )
    found = of(north_run(data, HERE, options=DOWN), "gyro-fault-size")
    assert (found.values["channels"], found.values["times"]) == ((("gyro_x",),), (2.0,))


def test_a_gyro_of_another_size_at_all_stations_is_named(simulated):
    data, _ = simulated(change=lambda c: spoilt(c, "size", [0], 1))
    found = of(north_run(data, HERE, options=DOWN), "gyro-across-unlike")
    assert (found.values["channel"], found.values["other"]) == ("gyro_x", "gyro_y")
    assert found.values["times"] == pytest.approx(2.0, abs=0.05)


def test_an_accelerometer_that_fails_leaves_no_inclination_either(simulated):
    data, _ = simulated(change=lambda c: spoilt(c, "size", [0], 11, "accelerometer"))
    found = north_run(data, HERE, options=DOWN)
    # of two across nothing tells the size of both: one too large looks like the other too small
    said = of(found, "gyro-fault-size")
    assert set(said.values["channels"]) == {("accel_x",), ("accel_y",)}
    assert said.rows == tuple(range(10, 20))
    assert np.isnan(found.north.inclination[10:]).all()
    assert np.isfinite(found.north.azimuth[:10]).all()


def test_a_channel_of_one_value_everywhere_is_refused(simulated):
    data, _ = simulated(change=lambda c: spoilt(c, "one-value", [0], 1))
    with pytest.raises(FileError) as caught:
        north_run(data, HERE)
    assert (caught.value.finding.code, caught.value.finding.severity) == ("gyro-fault-value", "refused")


@pytest.mark.parametrize("digits", [None, 0.1])
@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("moves", [0.0, 0.03])
def test_right_runs_have_no_fault(simulated, digits, axes, moves):
    def change(columns):
        # the scale factor moves by 3 % either way
        steps = np.array([[float(name)] for name in columns["station"]])
        gyro = columns["channels"]["gyro"] / (1.0 + moves * np.sin(steps / 6.0))
        rounded = gyro if digits is None else np.round(gyro / (digits * DEG_H)) * digits * DEG_H
        return {"channels": {**columns["channels"], "gyro": rounded}}

    for seed in range(3):
        data, _ = simulated(seed, change, axes=axes)
        assert not any("channel" in flags for flags in north_run(data, HERE, options=DOWN).north.flags)


def test_stations_that_repeat_a_value_by_their_digits_are_no_fault():
    """A gyro along the tool in a straight hole reads one coarse value everywhere, and should."""
    rng, station, index = np.random.default_rng(1), np.repeat(np.arange(20), 4), np.tile(np.arange(4) * np.pi / 2, 20)
    field = 15.04 * earth_in_tool(0.9, 0.5, 0.8)
    turned = np.stack([
        field[0] * np.cos(index) + field[1] * np.sin(index), field[1] * np.cos(index) - field[0] * np.sin(index),
        np.full(80, field[2]),
    ], axis=1)  # fmt: skip
    signals = np.round(turned + 0.02 * rng.standard_normal(turned.shape), 0)
    _, batches, given = index_batches(
        station, index, signals, scheme="four", time=None, noise=None, tensor=None, offset=None,
        offset_sd=[np.inf, np.inf, 1.0], sweep=0.0,
    )  # fmt: skip
    density = rate_density(np.full(20, 0.5), np.zeros(20), 0.8, 1.0 / DEG_H)
    assert [f for f in find_faults(batches, signals, density, 15.0, noise=given) if f.code == "one-value"] == []


# The direction of the index.


def mirrored(columns):
    """The tool turned the other way: one gyro and one accelerometer, angles still counted up."""
    one = {kind: values[:, :1] for kind, values in columns["channels"].items()}
    return {
        "index": -columns["index"] % (2.0 * np.pi),
        "channels": one,
        "letters": {"accelerometer": "x", "gyro": "x"},
    }


def test_the_direction_of_turning_is_stated(simulated):
    data, run = simulated(change=mirrored, stations=8)
    options = GyroOptions(scheme="n", hole="down")
    wrong = north_run(data, HERE, options=options)
    stated = read_gyro_run(data.path, index_turns="counterclockwise")
    right = north_run(stated, HERE, options=options)
    for found, azimuth in ((wrong, -run.azimuth), (right, run.azimuth)):
        off = (found.north.azimuth - azimuth + np.pi) % (2.0 * np.pi) - np.pi
        assert np.abs(off).max() < 5.0 * found.north.u("azimuth").max()
    assert right.index_turns == "counterclockwise"
    assert right.survey.findings[0].values["turns"] == "counterclockwise"
    with refused("input-choice", name="index_turns", value="left", allowed=("clockwise", "counterclockwise")):
        read_gyro_run(data.path, index_turns="left")


def test_two_sensors_contradict_a_wrong_direction(simulated):
    data, _ = simulated(stations=8)
    stated = dataclasses.replace(data, index_turns="counterclockwise")
    with pytest.raises(FileError) as caught:
        north_run(stated, HERE)
    assert caught.value.finding.values == {"kind": "accelerometer", "turns": "clockwise"}


def test_the_average_of_a_sensor_turned_the_other_way_is_the_mirror_image():
    readings = [[15.0], [2.0], [-5.0], [8.0]]
    index, one = np.radians([0.0, 90.0, 180.0, 270.0]), [1, 1, 1, 1]
    turned = average_index(one, index, readings, scheme="four", noise=[0.01], index_turns="counterclockwise")
    plain = average_index(one, index, readings, scheme="four", noise=[0.01])
    np.testing.assert_allclose(turned.field[0, :2], plain.field[0, :2] * [1.0, -1.0], atol=1e-12)


def test_up_holes_of_the_closed_form_have_neither_azimuth_nor_uncertainty(simulated, tmp_path):
    data, _ = simulated(stations=8)
    found = north_run(data, HERE, options=GyroOptions(method="patent", hole="up"))
    write_run(found, tmp_path / "stations.csv")
    rows = [r for r in csv.DictReader((tmp_path / "stations.csv").read_text().splitlines()) if "up-hole" in r["flags"]]
    assert rows
    assert {row["azimuth_deg"] + row["u_azimuth_deg"] for row in rows} == {""}

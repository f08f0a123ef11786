"""Bench readings: rows taken, converters found, names in a table, shapes that do not go together."""

import dataclasses

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.calibration import plans
from inclinometry.calibration.identifiability import null_space
from inclinometry.calibration.initial_values import Stand, starting_state
from inclinometry.calibration.likelihood import Model
from inclinometry.calibration.norm import calibrate_norm
from inclinometry.calibration.outliers import Outlier
from inclinometry.calibration.rate_table import calibrate_rates
from inclinometry.calibration.readings import BenchReadings, converter_steps
from inclinometry.calibration.rollset import roll_harmonics, second_harmonics
from inclinometry.calibration.structured import blocks
from inclinometry.calibration.variance import estimate_components, fit
from inclinometry.rotations import dcm

RNG = np.random.default_rng(1)
CHANNELS = {"accelerometer": RNG.normal(size=(7, 3)), "gyro": RNG.normal(size=(7, 2))}
DIALS = {name: RNG.uniform(0.0, 3.0, 7) for name in ("azimuth", "inclination", "toolface")}


def full(**more):
    return BenchReadings(
        CHANNELS,
        **DIALS,
        station=list("abcdefg"),
        sd={"accelerometer": [0.1, 0.2, 0.3], "gyro": 0.01},
        count=np.arange(1.0, 8.0),
        temperature=np.linspace(20.0, 26.0, 7),
        roll_set=["r", "r", "", "s", "s", "", ""],
        units={"gyro": "deg/h"},
        reference={"dip": 1.2},
        step={"gyro": [0.1, 0.0]},
        **more,
    )


def test_rows_are_taken_with_all_that_belongs_to_them():
    readings, rows = full(), [5, 0, 3]
    taken = readings.take(rows)
    assert taken.station == ("f", "a", "d")
    assert taken.roll_set == ("", "r", "s")
    assert len(taken) == 3
    for kind in CHANNELS:
        np.testing.assert_array_equal(taken.channels[kind], CHANNELS[kind][rows])
        np.testing.assert_array_equal(taken.sd[kind], readings.sd[kind][rows])
        np.testing.assert_array_equal(taken.step[kind], readings.step[kind])
    for one, other in zip(taken.dials, readings.dials, strict=True):
        np.testing.assert_array_equal(one, other[rows])
    assert taken.count.tolist() == [6.0, 1.0, 4.0]
    assert taken.temperature.tolist() == [25.0, 20.0, 23.0]
    assert taken.digest == readings.digest
    assert (taken.units["accelerometer"], taken.units["gyro"]) == ("counts", "deg/h")
    bare = BenchReadings(CHANNELS).take([1])
    assert bare.azimuth is None
    assert bare.temperature is None
    assert bare.station == ("2",)


def test_the_digest_is_of_signals_and_settings():
    digests = {full().digest, BenchReadings(CHANNELS).digest, BenchReadings(CHANNELS, **DIALS).digest}
    assert len(digests) == 3
    turned = DIALS | {"toolface": DIALS["toolface"] + 1e-9}
    assert BenchReadings(CHANNELS, **turned).digest not in digests
    assert full(digest="own").digest == "own"


def test_the_table_has_the_names_of_a_file():
    table = full().to_dict()
    np.testing.assert_allclose(table["inclination_deg"], np.degrees(DIALS["inclination"]))
    assert table["station"] == list("abcdefg")
    assert table["roll_set"][3] == "s"
    assert {"temperature_degC", "count"} <= set(table)
    np.testing.assert_array_equal(table["gyro_y_deg_h"], CHANNELS["gyro"][:, 1])
    plain = BenchReadings(CHANNELS).to_dict()
    assert not {"azimuth_deg", "temperature_degC", "count", "roll_set"} & set(plain)
    with refused("input-choice", name="kind"):
        full().plot(kind="magnetometer")


def test_a_plot_has_a_line_for_each_channel_and_stations_counted_from_one():
    pytest.importorskip("matplotlib").use("Agg")
    for kind, lines, label in (("gyro", 2, "gyro, deg/h"), (None, 3, "accelerometer, counts")):
        ax = full().plot(kind=kind)
        assert len(ax.lines) == lines
        assert ax.lines[0].get_xdata().tolist() == list(range(1, 8))
        assert ax.get_ylabel() == label


@pytest.mark.parametrize("step", [1.0, 0.1, 0.001])
def test_the_step_of_a_converter_is_found_from_64_of_them_and_seven_values_on(step):
    codes = np.array([0, 9, 20, 31, 45, 52, 64.0])[:, None]
    digits = round(-np.log10(step))

    def found(values):
        return converter_steps(np.round(values * step, digits))[0]

    assert found(codes) == pytest.approx(step)
    assert found(codes[:6].repeat(2, axis=0) * 2.0) == 0.0
    assert found(np.minimum(codes, 63.0)) == 0.0
    mixed = np.column_stack([codes[:, 0] * step, np.sqrt(2.0) * codes[:, 0]])
    np.testing.assert_allclose(converter_steps(np.round(mixed, 15)), [step, 0.0])


def test_readings_of_one_channel_that_agree_were_rounded_alike():
    values = np.array([[1.0, 4.0], [1.0, 5.0], [5.0, 6.0], [1.0, 5.0]])
    rounding = BenchReadings({"gyro": values}, step={"gyro": [1.0, 0.5]}).rounding("gyro")
    alike = np.array([[3, 1], [3, 2], [1, 1], [3, 2]])
    np.testing.assert_allclose(rounding, [1.0, 0.5] * np.sqrt(alike / 12.0))
    assert not BenchReadings({"gyro": values}, step={"gyro": 0.0}).rounding("gyro").any()


@pytest.mark.parametrize(
    ("more", "code"),
    [
        ({"sd": {"gyro": 2e15}}, "input-value gyro.sd"),
        ({"sd": {"gyro": [[0.1, 0.1]]}}, "input-shape gyro.sd"),
        ({"sd": {"gyro": [0.1, -0.1]}}, "input-value gyro.sd"),
        ({"step": {"gyro": -1.0}}, "input-value step.gyro"),
        ({"step": {"gyro": [1.0, 1.0, 1.0]}}, "input-shape step.gyro"),
        ({"roll_set": ["a"]}, "input-shape roll_set"),
        ({"count": np.full(7, 0.5)}, "input-value count"),
        ({"azimuth": np.zeros(7)}, "input-missing inclination"),
    ],
)
def test_what_does_not_go_together(more, code):
    with refused(code):
        BenchReadings(CHANNELS, **more)
    assert BenchReadings(CHANNELS, sd={"gyro": 1e15, "magnetometer": 1.0}, count=np.ones(7)).sd["gyro"].max() == 1e15


def test_records_are_frozen_and_each_is_itself():
    """Their arrays have no one truth of equality: they are compared, and kept in sets, by identity; shown in words."""
    plan = plans.twelve(6, 3)
    dials = np.stack([plan.azimuth, plan.inclination, plan.toolface], axis=1)
    signals = dcm(*dials.T) @ [0.0, 0.0, 1.0] + 1e-3 * np.random.default_rng(2).normal(size=(24, 3))
    signals = {"accelerometer": signals}
    readings = BenchReadings(signals, *dials.T)
    model = Model(signals, dials, np.ones((24, 1)), np.full((24, 3), 1e-3), np.full(3, 1e-3), np.zeros(4), {})
    state = starting_state(model)
    fitted = fit(model, state)
    norm = calibrate_norm(_sphere())
    harmonics = roll_harmonics(np.arange(6.0), np.arange(6.0))
    table = calibrate_rates(np.random.default_rng(4).normal(size=(9, 2)), np.random.default_rng(5).normal(size=(9, 3)))
    records = [
        readings, model, state, fitted, fitted.at, norm, harmonics, second_harmonics(readings), table,
        Stand(*dials.T), estimate_components(model, fitted.at, fitted.state, {"accelerometer"}, True),
        next(iter(blocks(fitted, {"accelerometer"}))), null_space(model, state),
    ]  # fmt: skip
    for record in records:
        assert len({record, record, dataclasses.replace(record)}) == 2
    for record in [*records, Outlier(3, 0.1)]:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(record, dataclasses.fields(record)[0].name, None)
    assert repr(readings).startswith("BenchReadings: 24 stations with rig angles")
    for record in (readings, harmonics, table):
        assert "array(" not in repr(record)


def _sphere():
    points = np.random.default_rng(3).normal(size=(40, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)

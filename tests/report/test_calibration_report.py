"""The calibration report: whole, self-contained, the same every time, for every kind of tool."""

from dataclasses import replace

import numpy as np
import pytest

from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.files.json_codec import restored
from inclinometry.findings import example
from inclinometry.report.calibration import calibration_report
from inclinometry.sensors import Tool, Triad

from .conftest import calibrated
from .pages import check

HOSTILE = '<script>alert(1)</script>"\'&<b> $\\frac{1}$ id="x" \x00\ud800 名前 #010203'


@pytest.mark.long
def test_verdict_comes_first_and_nothing_is_loaded(usual):
    readings, found = usual
    page = check(calibration_report(found, readings=readings))
    words = page.text
    assert words.index("One reading of A7") < words.rindex("What was measured") < words.rindex("Parameters")
    for part in ("inclination within ±", "azimuth within ±", "toolface within ±", "k = 2", found.inputs["readings"]):
        assert part in words
    # three curves, three maps, three dials, two triads
    assert page.tags.count("svg") == 11


@pytest.mark.long
def test_a_tool_without_a_serial_number_is_not_called_unnamed(usual):
    readings, found = usual
    page = calibration_report(replace(found, tool=replace(found.tool, name="unnamed")), readings=readings)
    assert "Calibration of a tool" in page
    assert "unnamed" not in check(page).text


@pytest.mark.long
def test_same_input_same_bytes(usual):
    readings, found = usual
    assert calibration_report(found, readings=readings) == calibration_report(found, readings=readings)


@pytest.mark.long
@pytest.mark.parametrize(
    ("sensors", "given", "drawings"),
    [
        ({"accelerometer": 3}, ("inclination", "toolface"), 6),
        ({"accelerometer": 4, "magnetometer": 5}, ("inclination", "azimuth", "toolface"), 11),
        ({"accelerometer": 3, "gyro": 3}, ("inclination", "azimuth", "toolface"), 11),
        ({"accelerometer": 3, "magnetometer": 2}, ("inclination", "toolface"), 7),
        ({"accelerometer": 3, "magnetometer": 2, "gyro": 3}, ("inclination", "azimuth", "toolface"), 12),
        ({"accelerometer": 8, "magnetometer": 3, "gyro": 3}, ("inclination", "azimuth", "toolface"), 12),
        ({"accelerometer": 2}, ("inclination", "toolface"), 6),
        ({"magnetometer": 3}, (), None),
    ],
)
def test_adapts_to_the_sensors_there_are(sensors, given, drawings):
    if sensors == {"magnetometer": 3}:
        triads = {"magnetometer": Triad("magnetometer", np.eye(3), np.zeros(3))}
        empty = Residuals((), {}, {}, np.zeros(0))
        found = Calibration(Tool("A7", triads), "field", {}, {}, (), np.zeros((0, 0)), Rig(np.zeros(3)), empty)
    else:
        _, found = calibrated(sensors)
    page = check(calibration_report(found))
    for name in ("inclination", "azimuth", "toolface"):
        assert (f"{name} within ±" in page.text) == (name in given)
    if drawings is not None:
        assert page.tags.count("svg") == drawings
    for kind in sensors:
        assert f"Residuals of the {kind}" in page.text or kind == "magnetometer"


@pytest.mark.long
def test_names_from_files_are_only_text():
    readings, found = calibrated({"accelerometer": 3, "magnetometer": 3}, name=HOSTILE, station=[HOSTILE] * 24)
    sharp = replace(found, findings=(restored(HOSTILE),), inputs={HOSTILE: HOSTILE}, method=HOSTILE)
    text = calibration_report(sharp, readings=readings, closed_forms={HOSTILE: found})
    page = check(text)
    assert "script" not in page.tags
    assert "b" not in page.tags
    assert "<script>alert(1)</script>" in page.text
    assert "\x00" not in text
    text.encode("utf-8")


@pytest.mark.long
def test_warnings_turn_the_verdict(usual):
    _, found = usual
    warned = replace(found, findings=(example("bench-station-off"),))
    assert "No warnings" in check(calibration_report(found)).text
    words = check(calibration_report(warned)).text
    assert "Warnings: 1" in words
    assert "settle the warnings below before relying on it" in words
    assert "[bench-station-off]" in words


def test_method_without_covariance_states_no_uncertainty(usual):
    _, found = usual
    tool = Tool("A7", found.tool.triads)
    bare = replace(found, tool=tool, covariance=np.zeros_like(found.covariance), rig=Rig(np.zeros(3)))
    words = check(calibration_report(bare)).text
    assert "The method gives no uncertainty" in words
    assert "were taken as exact" in words
    assert "Expected uncertainty" not in words


@pytest.mark.long
def test_dip_is_said_with_its_source(usual):
    readings, found = usual
    assert "For a dip of 70.0° (that of the calibration stand)" in check(calibration_report(found)).text
    assert "For a dip of 50.0° (given)" in check(calibration_report(found, dip=np.radians(50.0))).text
    lost = replace(found, field_directions={})
    assert "For a dip of 70.0° (stated with the readings)" in check(calibration_report(lost, readings=readings)).text
    words = check(calibration_report(lost)).text
    assert "For a dip of 70.0° (assumed" in words
    assert "nothing is known of one" in words


@pytest.mark.long
def test_other_methods_stand_beside(usual):
    _, found = usual
    _, other = calibrated({"accelerometer": 3})
    moved = Tool("A7", {k: replace(t, offset=t.offset[0] + 0.01) for k, t in found.tool.triads.items()})
    text = calibration_report(found, closed_forms={"itself": found, "moved": replace(found, tool=moved), "less": other})
    words = check(text).text
    assert "Other methods on the same readings" in words
    rows = words.split("joint (this report)")[1]
    # its own signals give its own angles back, to rounding
    assert rows.index("itself") < rows.index("moved") < rows.index("less")
    assert "not stated" in rows


@pytest.mark.long
def test_temperature_outliers_and_many_stations():
    random = np.random.default_rng(1)
    triad = Triad("accelerometer", np.stack([np.eye(3), 1e-4 * np.eye(3)]), np.zeros((2, 3)), "V")
    tool = Tool("A7", {"accelerometer": triad}, 1e-8 * np.eye(24), {"accelerometer": 1e-3}, (5.0, 65.0))
    values = 1e-3 * random.standard_normal((900, 3))
    values[7, 1] = 0.4
    kept = Residuals([f"station {k}" for k in range(900)], {"accelerometer": values}, {"accelerometer": values / 1e-3},
                     np.full(900, 0.01))  # fmt: skip
    rig = Rig(np.full(3, 1e-3), np.zeros((900, 3)), None, {"toolface_zero": (1e-3, 1e-4)})
    down = {"accelerometer": np.array([0.0, 0.0, 1.0])}
    found = Calibration(tool, "joint", {}, down, tool.parameter_names, tool.covariance, rig, kept)
    words = check(calibration_report(found)).text
    assert "polynomial of degree 1 about 20 °C" in words
    assert "5.0 to 65.0 °C" in words
    assert "The first 500 of 900 rows" in words
    assert "toolface zero: 0.0573 ± 0.0057" in words
    assert "V/K" in words

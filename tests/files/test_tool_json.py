"""tool.json and truth.json: exact to the bit, the same bytes for the same content, clear about what is wrong."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.calibration.result import Calibration, Residuals, Rig
from inclinometry.errors import FileError
from inclinometry.files import json_codec
from inclinometry.files.json_codec import restored
from inclinometry.files.tool_json import read_calibration, read_extras, read_tool, write_calibration, write_truth
from inclinometry.findings import Finding
from inclinometry.sensors import Tool, Triad

from .json_records import changed, put

POWER = Finding("verify-power", {"angle": "azimuth", "times": 1.0 / 3.0}, severity="ignored")
FINDINGS = (
    Finding("input-empty", {"name": "md_m"}, (0, 3)),
    Finding(
        "verify-planned", {"finding": Finding("verify-power", {"angle": "azimuth", "times": 2.3})}, severity="note"
    ),
    Finding("verify-not-judged", {"names": ("azimuth", "toolface"), "why": "at no position"}),
    POWER,
    restored("Roll the tool."),
)
"""One with rows, one within another, a list, a number to the bit, a sentence of an older file."""
VERSION_1 = Path(__file__).parents[1] / "reference" / "tool-json" / "tool-1.json"


def unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def make(seed=3, degree=0, sensors=3, inside=True):
    rng = np.random.default_rng(seed)
    kinds = ("accelerometer", "magnetometer")
    triads = {
        kind: Triad(kind, rng.normal(size=(degree + 1, sensors, 3)), rng.normal(size=(degree + 1, sensors)), "counts",
                    None if kind == "magnetometer" else 9.81, 19.3)
        for kind in kinds
    }  # fmt: skip
    size = 8 * sensors * (degree + 1)
    root = rng.normal(size=(size + 5, size + 5))
    joint = root @ root.T
    noise = {kind: rng.uniform(1, 2, sensors) for kind in kinds}
    tool = Tool("SN 1", triads, joint[:size, :size] if inside else joint[:size, :size] * 2, noise, (-10.5, 150.0 / 7.0))
    rig = Rig(rng.uniform(0, 0.01, 3), rng.normal(size=(4, 3)), rng.uniform(size=(4, 3)), {"zero": (0.1 / 3, 1e-300)})
    residuals = Residuals(("1", "2", "Ж", "4"), {k: rng.normal(size=(4, sensors)) for k in kinds},
                          {k: rng.normal(size=(4, sensors)) for k in kinds}, rng.uniform(size=4))  # fmt: skip
    return Calibration(
        tool, "joint", {"readings.csv": "sha256:00"}, {k: unit(rng.normal(size=3)) for k in kinds},
        (*tool.parameter_names, "a", "b", "c", "d", "zero"), joint, rig, residuals, FINDINGS,
    )  # fmt: skip


def same(a, b, rtol=None):
    """Equal to the bit, whatever it is made of; or, with rtol, within that share of the largest of an array."""
    if is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name), rtol) for f in fields(a))
    if isinstance(a, np.ndarray):
        if rtol is None or a.size == 0:
            return a.shape == b.shape and a.tobytes() == b.tobytes()
        return np.array_equal(a, b) or (a.shape == b.shape and bool(np.all(np.abs(a - b) <= rtol * np.abs(a).max())))
    if hasattr(a, "items"):
        return set(a) == set(b) and all(same(a[k], b[k], rtol) for k in a)
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(same(x, y, rtol) for x, y in zip(a, b, strict=True))
    if rtol is not None and isinstance(a, float):
        return a == b or abs(a - b) <= rtol * abs(a)
    return a == b


@pytest.mark.long
@pytest.mark.parametrize("degree", [0, 2])
@pytest.mark.parametrize("sensors", [2, 3, 5])
@pytest.mark.parametrize("inside", [True, False])
def test_every_bit_comes_back(tmp_path, degree, sensors, inside):
    calibration = make(3, degree, sensors, inside)
    path = tmp_path / "tool.json"
    write_calibration(calibration, path)
    assert same(read_calibration(path), calibration)
    assert same(read_tool(path), calibration.tool)
    first = path.read_bytes()
    write_calibration(read_calibration(path), path)
    assert path.read_bytes() == first


def test_a_bare_calibration(tmp_path):
    # a closed form has no rig errors, no covariance, perhaps no field direction
    tool, rig = Tool("", {"gyro": Triad("gyro", np.eye(3), np.zeros(3))}), Rig(np.zeros(3))
    bare = Calibration(tool, "twelve", {}, {}, (), np.zeros((0, 0)), rig, Residuals((), {}, {}, np.zeros(0)))
    write_calibration(bare, tmp_path / "tool.json")
    assert same(read_calibration(tmp_path / "tool.json"), bare)


def test_the_bytes_are_canonical(tmp_path):
    write_calibration(make(), tmp_path / "a.json")
    write_calibration(make(), tmp_path / "b.json", created="2024-05-01")
    text = (tmp_path / "a.json").read_text("utf-8")
    content = json.loads(text)
    assert content["created"] is None
    assert json.loads((tmp_path / "b.json").read_text("utf-8"))["created"] == "2024-05-01"
    assert list(content) == sorted(content)
    assert text.endswith("}\n")
    assert "\r" not in text
    assert "Ж" in text
    assert list(content["triads"]["accelerometer"]) == sorted(
        ["tensor", "offset", "unit", "field_strength", "field_unit", "noise", "reference_temperature_degC"]
    )


def test_the_files_of_all_versions_are_read_for_ever():
    calibration = read_calibration(VERSION_1)
    assert calibration.tool.name == "SN 1"
    # made by products of matrices of 53 rows, whose last bits are the processor's: 53 eps of the largest, a hundredfold
    assert same(calibration, replace(make(), findings=FINDINGS[-1:]), rtol=1e-12)
    calibration = read_calibration(VERSION_1.with_name("tool-2.json"))
    assert calibration.tool.name == "SN 1"
    assert calibration.shares["toolface dial"].shape == (5, 3)


def test_the_shares_of_the_causes_are_kept(tmp_path):
    """An angle that the tool does not give has none."""
    shares = {"azimuth dial": np.full((5, 3), 0.25), "sensor noise": np.full((5, 3), 0.75)}
    shares["sensor noise"][:, 1] = np.nan
    calibration = replace(make(), shares=shares)
    write_calibration(calibration, tmp_path / "tool.json")
    content = json.loads((tmp_path / "tool.json").read_text("utf-8"))
    assert content["version"] == 3
    jsonschema.validate(content, json_codec.schema("tool-3"))
    found = read_calibration(tmp_path / "tool.json").shares
    for name, share in shares.items():
        np.testing.assert_array_equal(found[name], share)


def test_nan_is_refused_with_its_place(tmp_path):
    calibration = make()
    leverage = calibration.residuals.leverage.copy()
    leverage[2] = np.nan
    broken = replace(calibration, residuals=replace(calibration.residuals, leverage=leverage))
    with refused("input-finite", name="$.residuals.leverage[2]"):
        write_calibration(broken, tmp_path / "tool.json")
    with refused("file-format"):
        write_calibration(replace(calibration, method="\ud800"), tmp_path / "tool.json")
    assert list(tmp_path.iterdir()) == []


TRIAD = ("triads", "accelerometer")


@pytest.mark.parametrize(
    ("change", "code", "place"),
    [
        (put("schema", "a"), "record-kind", ""),
        (put("version", 4), "file-version", ""),
        (put("version", "1"), "input-value", "$.version"),
        (put("convention", "z-up"), "input-value", "$.convention"),
        (put("triads", {}), "input-value", "$.triads"),
        (put(*TRIAD, "tensor", 0, 1, "x"), "input-value", "$.triads.accelerometer.tensor[0][1]"),
        (put(*TRIAD, "tensor", 0, 1, True), "input-value", "$.triads.accelerometer.tensor[0][1]"),
        (put(*TRIAD, "tensor", 0, [1, 2]), "input-value", "$.triads.accelerometer.tensor[0]"),
        (put(*TRIAD, "offset", [1, 2]), "input-shape", "$.triads.accelerometer.offset"),
        (put(*TRIAD, "tensor", 0, 1, 10**400), "input-value", "$.triads.accelerometer.tensor[0][1]"),
        (put(*TRIAD, "unit", ""), "input-value", "$.triads.accelerometer.unit"),
        (put(*TRIAD, "unit", "x" * 33), "input-value", "$.triads.accelerometer.unit"),
        (put(*TRIAD, "field_unit", "nT"), "input-choice", "$.triads.accelerometer.field_unit"),
        (put(*TRIAD, "field_strength", -1), "input-value", "$.triads.accelerometer.field_strength"),
        (put(*TRIAD, "field_strength", 0), "input-value", "$.triads.accelerometer.field_strength"),
        (put(*TRIAD, "temperature_coefficients", 0, "power", 2), "input-value", "temperature_coefficients.power"),
        (put(*TRIAD, "noise", 0, -1), "input-value", "$.triads.accelerometer.noise[0]"),
        (put(*TRIAD, "noise", [1, 2]), "input-shape", "$.triads.accelerometer.noise"),
        (put("triads", "compass", {}), "input-value", "$.triads"),
        (put("covariance", "parameters", 0, "x"), "record-names", "$.covariance.parameters"),
        (put("covariance", "matrix", 0, [1]), "input-shape", "$.covariance.matrix[0]"),
        (put("covariance", "matrix", []), "input-shape", "$.covariance.matrix"),
        (put("covariance", "matrix", 2, 2, -1.0), "record-covariance", "$.covariance.matrix[2][2]"),
        (put("covariance", "matrix", 2, 3, 1e3), "record-covariance", "$.covariance.matrix[2][3]"),
        (put("covariance", "matrix", 2, 2, 1e-3), "record-covariance", "$.covariance.matrix"),
        (put("tool_covariance", {"parameters": ["x"], "matrix": [[-2]]}), "record-covariance", "$.tool_covariance"),
        (put("field_directions", "accelerometer", [0, 0, 2]), "input-value", "|$.field_directions.accelerometer|"),
        (put("rig", "sd_rad", [1]), "input-value", "$.rig.sd_rad"),
        (put("temperature_range_degC", [1]), "input-value", "$.temperature_range_degC"),
        (put("findings", [1]), "input-value", "$.findings[0]"),
        (put("findings", 0, "values", "name", {"code": "x"}), "input-value", "$.findings[0].values.name"),
        (put("findings", 0, "severity", "grave"), "input-value", "$.findings[0].severity"),
        (put("findings", 0, "rows", [0]), "input-value", "$.findings[0].rows[0]"),
        (lambda c: c.pop("rig"), "input-missing", "$.rig"),
        (put("surplus", 1), "input-unknown", "$.surplus"),
        (put("residuals", "values", "gyro", [[1], [1, 2]]), "input-shape", "$.residuals.values.gyro[1]"),
    ],
)
def test_errors_name_the_json_path(tmp_path, change, code, place):
    path = tmp_path / "tool.json"
    write_calibration(make(degree=1), path)
    with pytest.raises(FileError) as caught:
        read_calibration(changed(path, change))
    with suppress(FileError):
        read_tool(path)
    found = caught.value.finding
    assert found.code == code
    assert place in str(found)
    assert "\n" not in str(found)
    assert len(str(found)) < 350


def test_the_truth_of_a_simulation_is_no_calibration(tmp_path):
    """What is no record at all: test_json_codec."""
    (tmp_path / "t.json").write_text('{"schema": "inclinometry/truth"}')
    with refused("record-kind", error=FileError):
        read_calibration(tmp_path / "t.json")


def test_truth(tmp_path):
    tool = make(degree=1).tool
    path = tmp_path / "truth.json"
    write_truth(tool, {"seed": 1, "rig": {"sd_deg": np.full(3, 0.1)}, "bits": np.int64(12)}, path)
    found = read_tool(path)
    assert same(found.triads, tool.triads)
    assert same(found.noise, tool.noise)
    assert found.temperature_range == tool.temperature_range
    assert not found.covariance.any()
    assert read_extras(path) == {"seed": 1, "rig": {"sd_deg": [0.1, 0.1, 0.1]}, "bits": 12}
    with refused("record-kind", error=FileError):
        read_calibration(path)
    with refused("input-kind", name="$.extras.x"):
        write_truth(tool, {"x": object()}, path)
    with refused("input-kind", name="$.extras"):
        write_truth(tool, {1: 2, "a": 3}, path)


def test_the_schemas_stand_alone(tmp_path):
    write_truth(make(degree=1).tool, {"seed": 1}, tmp_path / "truth.json")
    write_calibration(make(degree=1), tmp_path / "tool.json")
    for name, version in (("tool", 3), ("truth", 1)):
        content = json.loads((tmp_path / f"{name}.json").read_text("utf-8"))
        jsonschema.validate(content, json_codec.schema(f"{name}-{version}"))
        content["triads"]["accelerometer"]["unit"] = 1
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(content, json_codec.schema(f"{name}-{version}"))


@pytest.mark.parametrize("version", ["tool-1", "tool-2", "tool-3"])
def test_what_the_schemas_share_is_the_same(version):
    tool, truth = json_codec.schema(version)["$defs"], json_codec.schema("truth-1")["$defs"]
    assert {name: tool[name] for name in truth} == truth


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)


@pytest.mark.long
@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["triads", "covariance", "rig", "residuals", "field_directions", "version", "tool"]), JSON)
@example("version", 10**400)
def test_any_content_gives_a_calibration_or_a_file_error(tmp_path_factory, key, value):
    path = tmp_path_factory.getbasetemp() / "any.json"
    write_calibration(make(), path)
    content = json.loads(path.read_text("utf-8"))
    content[key] = value
    path.write_text(json.dumps(content), "utf-8")
    with suppress(FileError):
        read_calibration(path)
    with suppress(FileError):
        read_tool(path)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=100))
def test_any_bytes_give_a_file_error(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "bytes.json"
    path.write_bytes(data)
    with pytest.raises(FileError):
        read_tool(path)


def with_gyro(sensitivity):
    calibration = make()
    gyro = Triad("gyro", np.eye(3), np.zeros(3), "deg/h", g_sensitivity=sensitivity)
    tool = Tool("SN 1", {**calibration.tool.triads, "gyro": gyro})
    return replace(calibration, tool=tool, parameter_names=tool.parameter_names, covariance=tool.covariance)


def test_the_g_sensitivity_of_a_gyro_comes_back(tmp_path):
    path, calibration = tmp_path / "tool.json", with_gyro(np.random.default_rng(1).normal(size=(3, 3)) / 7.0)
    write_calibration(calibration, path)
    assert same(read_calibration(path), calibration)
    content = json.loads(path.read_text())
    jsonschema.validate(content, json_codec.schema("tool-3"))
    write_truth(calibration.tool, {}, tmp_path / "truth.json")
    assert same(read_tool(tmp_path / "truth.json").triads, calibration.tool.triads)
    # and is no key where there is none, so that older files and readers know nothing of it
    write_calibration(with_gyro(None), path)
    assert "g_sensitivity" not in path.read_text()
    assert read_calibration(path).tool.triads["gyro"].g_sensitivity is None


@pytest.mark.parametrize(
    ("kind", "value", "words"),
    [
        ("gyro", [[1, 2, 3], [1, 2, 3]], "input-shape g_sensitivity"),
        ("gyro", [[1, 2], [1, 2], [1, 2]], "input-value $.triads.gyro.g_sensitivity[2]"),
        ("gyro", "much", "input-value $.triads.gyro.g_sensitivity"),
        ("magnetometer", [[1, 2, 3]] * 3, "input-not-with"),
    ],
)
def test_a_g_sensitivity_that_cannot_be(tmp_path, kind, value, words):
    path = tmp_path / "tool.json"
    write_calibration(with_gyro(np.eye(3)), path)
    with refused(words, error=FileError):
        read_calibration(changed(path, put("triads", kind, "g_sensitivity", value)))

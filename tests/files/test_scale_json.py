"""scale.json: to the bit there and back, and refused when it is not what it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.files.scale_json import ScaleRecord, read_scale, write_scale
from inclinometry.gyro.tracking import ScaleState, quadratic_belief

from .json_records import changed, put

COLUMNS = ("md", "temperature", "expected", "expected_sd", "scale", "scale_sd")


def record(belief=None, size=5, seed=1, tool="A7"):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * 1e-3
    learnt = ScaleState(rng.normal(1.0, 1e-2, 3), root @ root.T, 19.9, (21.3, 139.7))
    return ScaleRecord(
        tool,
        belief or learnt,
        *(rng.normal(1.0, 0.1, size) for _ in COLUMNS),
        tuple((rng.random(size) > 0.5).tolist()),
        {"raw": "0" * 64, "site": "1" * 64},
    )


@pytest.mark.parametrize(
    "belief",
    [None, quadratic_belief(), ScaleState(np.array([1.001]), np.array([[1e-4]])), quadratic_belief(sd=1e-150)],
)
@pytest.mark.parametrize("size", [0, 1, 7])
def test_to_the_bit_there_and_back(tmp_path, belief, size):
    written = record(belief, size)
    write_scale(written, tmp_path / "s.json")
    found = read_scale(tmp_path / "s.json")
    assert (found.tool, found.observable, dict(found.inputs)) == (
        written.tool,
        written.observable,
        dict(written.inputs),
    )
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(found, name), getattr(written, name))
    for name in ("coefficients", "covariance"):
        np.testing.assert_array_equal(getattr(found.state, name), getattr(written.state, name))
    for name in ("reference_temperature", "temperature_range"):
        assert getattr(found.state, name) == getattr(written.state, name)
    first = (tmp_path / "s.json").read_bytes()
    write_scale(found, tmp_path / "t.json")
    assert (tmp_path / "t.json").read_bytes() == first
    assert b"\r" not in first


def test_what_is_not_finite_is_not_written(tmp_path):
    broken = replace(record(), scale=np.array([1.0, np.nan, 1.0, 1.0, 1.0]))
    with refused("input-finite", name="$.stations.scale[1]"):
        write_scale(broken, tmp_path / "s.json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (put("schema", "inclinometry/tool"), "scale factors of a gyro"),
        (lambda c: c.pop("schema"), "scale factors of a gyro"),
        (put("version", 4), "version 4"),
        (put("state", "coefficients", []), "$.state.coefficients"),
        (put("state", "coefficients", [1.0, 2.0, 3.0, 4.0]), "$.state.coefficients"),
        (put("state", "coefficients", ["1"]), "$.state.coefficients[0]"),
        (put("state", "coefficients", [1.0]), ""),
        (put("state", "covariance", [[1.0, 0.0, 0.0], [0.0], [0.0, 0.0, 1.0]]), "$.state"),
        (put("state", "covariance", 0, 0, -1.0), ""),
        (put("state", "per_degC", 1.0), "$.state.per_degC"),
        (put("state", "temperature_range_degC", [20.0]), "$.state.temperature_range_degC"),
        (put("state", "temperature_range_degC", [90.0, 20.0]), ""),
        (put("state", "other", 1.0), "other"),
        (put("stations", "observable", [True]), "$.stations.observable"),
        (put("stations", "scale", 0, None), "$.stations.scale[0]"),
        (put("stations", "observable", 0, 1), "$.stations.observable[0]"),
        (lambda c: c["stations"].pop("md_m"), "md_m"),
        (put("tool", 7), "$.tool"),
        (lambda c: c.pop("state"), "state"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, change, place):
    path = tmp_path / "s.json"
    write_scale(record(), path)
    with pytest.raises(FileError) as caught:
        read_scale(changed(path, change))
    assert place in str(caught.value)


def test_what_had_wandered_in_a_file_of_version_1_is_part_of_the_scale_factor(tmp_path):
    path, written = tmp_path / "s.json", record()
    write_scale(written, path)
    wandered = {"walk_per_root_degC": 1e-5, "jitter": 5e-4, "wandered": [2e-4, 3e-8, 77.7]}

    def older(content):
        content |= {"version": 1, "belief": content.pop("state") | wandered}
        content["stations"]["learnt"] = content["stations"].pop("observable")

    changed(path, older)
    found = read_scale(path).state
    np.testing.assert_allclose(found.coefficients - written.state.coefficients, [2e-4, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(found.covariance - written.state.covariance, np.diag([3e-8, 0.0, 0.0]), atol=1e-20)

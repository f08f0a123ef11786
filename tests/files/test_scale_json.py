"""scale.json: to the bit there and back, and refused when it is not what it says."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from inclinometry.errors import FileError, InputError
from inclinometry.files.scale_json import ScaleRecord, read_scale, write_scale
from inclinometry.gyro.tracking import ScaleBelief, quadratic_belief, walking_belief

COLUMNS = ("md", "temperature", "expected", "expected_sd", "scale", "scale_sd")


def record(belief=None, size=5, seed=1, tool="A7"):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * 1e-3
    learnt = ScaleBelief(
        rng.normal(1.0, 1e-2, 3), root @ root.T, 1.3e-5, 2.7e-4, 19.9, (rng.normal() * 1e-4, 3e-9, 77.7), (21.3, 139.7)
    )
    return ScaleRecord(
        tool,
        belief or learnt,
        *(rng.normal(1.0, 0.1, size) for _ in COLUMNS),
        tuple((rng.random(size) > 0.5).tolist()),
        {"raw": "0" * 64, "site": "1" * 64},
    )


@pytest.mark.parametrize(
    "belief", [None, quadratic_belief(), walking_belief(1.001, 0.01), quadratic_belief(jitter=0.0, walk=1e-300)]
)
@pytest.mark.parametrize("size", [0, 1, 7])
def test_to_the_bit_there_and_back(tmp_path, belief, size):
    written = record(belief, size)
    write_scale(written, tmp_path / "s.json")
    found = read_scale(tmp_path / "s.json")
    assert (found.tool, found.learnt, dict(found.inputs)) == (written.tool, written.learnt, dict(written.inputs))
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(found, name), getattr(written, name))
    for name in ("coefficients", "covariance"):
        np.testing.assert_array_equal(getattr(found.belief, name), getattr(written.belief, name))
    for name in ("walk", "jitter", "reference_temperature", "wandered", "temperature_range"):
        assert getattr(found.belief, name) == getattr(written.belief, name)
    first = (tmp_path / "s.json").read_bytes()
    write_scale(found, tmp_path / "t.json")
    assert (tmp_path / "t.json").read_bytes() == first
    assert b"\r" not in first


def test_what_is_not_finite_is_not_written(tmp_path):
    broken = replace(record(), scale=np.array([1.0, np.nan, 1.0, 1.0, 1.0]))
    with pytest.raises(InputError, match=r"\$\.stations\.scale\[1\] is nan"):
        write_scale(broken, tmp_path / "s.json")
    assert list(tmp_path.iterdir()) == []


def changed(*path, value):
    def change(content):
        place = content
        for name in path[:-1]:
            place = place[name]
        place[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (changed("schema", value="inclinometry/tool"), "needed is scale factors of a gyro"),
        (lambda c: c.pop("schema"), "needed is scale factors of a gyro"),
        (changed("version", value=2), "reads version 1"),
        (changed("belief", "coefficients", value=[]), "$.belief.coefficients"),
        (changed("belief", "coefficients", value=[1.0, 2.0, 3.0, 4.0]), "$.belief.coefficients"),
        (changed("belief", "coefficients", value=["1"]), "$.belief.coefficients[0]"),
        (changed("belief", "coefficients", value=[1.0]), "$.belief"),
        (changed("belief", "covariance", value=[[1.0, 0.0, 0.0], [0.0], [0.0, 0.0, 1.0]]), "$.belief"),
        (changed("belief", "covariance", 0, 0, value=-1.0), "must not be negative"),
        (changed("belief", "per_degC", value=1.0), "$.belief.per_degC"),
        (changed("belief", "jitter", value=-1e-4), "$.belief.jitter"),
        (changed("belief", "walk_per_root_degC", value=-1.0), "$.belief.walk_per_root_degC"),
        (changed("belief", "wandered", value=[0.0]), "$.belief.wandered"),
        (changed("belief", "wandered", value=[0.0, -1.0, 20.0]), "$.belief"),
        (changed("belief", "temperature_range_degC", value=[20.0]), "$.belief.temperature_range_degC"),
        (changed("belief", "temperature_range_degC", value=[90.0, 20.0]), "the lower temperature comes first"),
        (changed("belief", "other", value=1.0), "other"),
        (changed("stations", "learnt", value=[True]), "$.stations has columns of different lengths"),
        (changed("stations", "scale", 0, value=None), "$.stations.scale[0]"),
        (changed("stations", "learnt", 0, value=1), "$.stations.learnt[0]"),
        (lambda c: c["stations"].pop("md_m"), "md_m"),
        (changed("tool", value=7), "$.tool"),
        (lambda c: c.pop("belief"), "belief"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, change, wanted):
    path = tmp_path / "s.json"
    write_scale(record(), path)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(FileError) as caught:
        read_scale(path)
    assert wanted in str(caught.value)
    assert "s.json" in str(caught.value)


@pytest.mark.parametrize("text", ["", "[]", "{", "schema: scale", '{"schema": NaN}'])
def test_what_is_no_such_file(tmp_path, text):
    path = tmp_path / "s.json"
    path.write_text(text)
    with pytest.raises(FileError, match=r"s\.json"):
        read_scale(path)
    with pytest.raises(FileError, match="no such file"):
        read_scale(tmp_path / "nothing.json")

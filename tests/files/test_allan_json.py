"""allan.json: units, canonical bytes, what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.allan import AllanCurve, ChannelNoise, Coefficient, NoiseModel, NoiseRecord
from inclinometry.errors import FileError
from inclinometry.files import json_codec
from inclinometry.files.allan_json import allan_content, read_allan, write_allan
from inclinometry.findings import Finding

UNSEEN = Coefficient(float("nan"), float("nan"), 2e-6)


def record(unit="rad/s", kind="gyro"):
    one = np.ones(2)
    curve = AllanCurve(0.1 * one, 1e-5 * one, 50.0 * one, np.array([1, 2]), 0.1, 100)
    model = NoiseModel(Coefficient(1e-6, 1e-8, 1.1e-6), UNSEEN, UNSEEN, None, None, np.eye(3), 3.0, 2)
    return NoiseRecord(
        [ChannelNoise("a_x", kind, unit, curve, model)],
        0.1,
        100,
        {"log": "sha256:1"},
        (Finding("input-empty", {"name": "md_m"}),),
    )


def test_degrees_and_hours(tmp_path):
    write_allan(record(), tmp_path / "allan.json")
    content = read_allan(tmp_path / "allan.json")
    (channel,) = content["channels"]
    assert channel["arw_deg_sqrt_h"] == pytest.approx(np.degrees(1e-6) * 60.0, rel=1e-14)
    assert channel["u_arw_deg_sqrt_h"] == pytest.approx(np.degrees(1e-8) * 60.0, rel=1e-14)
    assert channel["bias_instability_deg_h"] is None
    assert channel["limit_bias_instability_deg_h"] == pytest.approx(np.degrees(2e-6) * 3600.0, rel=1e-14)
    # rad/s/sqrt(s): 3600 for the rate and 60 for the root of an hour
    assert channel["limit_rate_random_walk_deg_h_sqrt_h"] == pytest.approx(np.degrees(2e-6) * 216000.0, rel=1e-14)
    assert channel["deviation_deg_h"] == pytest.approx([np.degrees(1e-5) * 3600.0] * 2, rel=1e-14)
    assert channel["u_deviation_deg_h"] == pytest.approx([np.degrees(1e-6) * 3600.0] * 2, rel=1e-14)


def test_the_same_record_gives_the_same_bytes(tmp_path):
    for name in ("a.json", "b.json"):
        write_allan(record(), tmp_path / name)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": "inclinometry/tool"}, "record-kind"),
        ({"version": 3}, "file-version"),
        ({"samples": "many"}, "input-value $.samples"),
        ({"channels": []}, "input-value $.channels"),
        ({"surplus": 1}, "input-unknown $.surplus"),
    ],
)
def test_other_content_is_refused(tmp_path, change, words):
    content = json.loads(json_codec.canonical(allan_content(record()))) | change
    (tmp_path / "allan.json").write_text(json.dumps(content))
    with refused(words, error=FileError):
        read_allan(tmp_path / "allan.json")


@pytest.mark.parametrize(
    ("unit", "kind", "keys", "hours"),
    [
        # m/s^2 times the root of a second is m/s per root of a second, and there are 60 of these in the root of an hour
        ("m/s^2", "accelerometer", ("velocity_random_walk_m_s_sqrt_h", "bias_instability_m_s2",
                                    "acceleration_random_walk_m_s2_sqrt_h", "deviation_m_s2"), 60.0),
        ("m/s", "accelerometer", ("white_noise_m_s_sqrt_s", "bias_instability_m_s", "random_walk_m_s_per_sqrt_s",
                                  "deviation_m_s"), 1.0),
        ("counts", "gyro", ("white_noise_counts_sqrt_s", "bias_instability_counts", "random_walk_counts_per_sqrt_s",
                            "deviation_counts"), 1.0),
        ("nT", "magnetometer", ("white_noise_nT_sqrt_s", "bias_instability_nT", "random_walk_nT_per_sqrt_s",
                                "deviation_nT"), 1.0),
    ],
)  # fmt: skip
def test_numbers_in_metres_and_hours_or_as_they_are(tmp_path, unit, kind, keys, hours):
    write_allan(record(unit, kind), tmp_path / "allan.json")
    (channel,) = read_allan(tmp_path / "allan.json")["channels"]
    white, bias, walk, deviation = keys
    assert channel[white] == pytest.approx(1e-6 * hours)
    assert channel[f"u_{white}"] == pytest.approx(1e-8 * hours)
    assert channel[f"limit_{bias}"] == pytest.approx(2e-6)
    assert channel[f"limit_{walk}"] == pytest.approx(2e-6 * hours)
    assert (channel[walk], channel[f"u_{walk}"]) == (None, None)
    assert channel[deviation] == pytest.approx([1e-5] * 2)
    assert (channel["chi_square"], channel["degrees_of_freedom"]) == (3.0, 2)

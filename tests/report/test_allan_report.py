"""The noise report."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.allan import ChannelNoise, NoiseRecord, allan_deviation, fit_noise
from inclinometry.findings import Finding
from inclinometry.report.allan import allan_report

from .pages import check


def record(warnings=()):
    rng = np.random.default_rng(1)
    channels = []
    for name, kind, unit in (("gyro_x", "gyro", "rad/s"), ("accel_1", "accelerometer", "counts")):
        curve = allan_deviation(rng.standard_normal(3000) + 0.1 * rng.standard_normal(3000).cumsum(), 0.1)
        channels.append(ChannelNoise(name, kind, unit, curve, fit_noise(curve)))
    return NoiseRecord(channels, 0.1, 3000, {"log": "sha256:77"}, warnings)


@pytest.mark.long
def test_page():
    found = record()
    page = check(allan_report(found))
    for words in ("3000 samples over 300 s", "angle random walk, deg/√h", "random walk, counts/√s", "sha256:77"):
        assert words in page.text
    assert page.tags.count("svg") == 2
    assert "No warnings" in page.text
    # bias instability under a strong random walk
    assert "< " in page.text
    assert allan_report(found) == allan_report(found)


def test_warnings_are_shown_escaped():
    text = allan_report(record([Finding("record-text", {"text": "<b>gyro_x</b>"})]))
    assert "<b>gyro_x" not in text
    assert "<b>gyro_x</b>" in check(text).text

"""From a log at rest to noise, and the signs of a log that was not."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import FileError
from inclinometry.workflow.allan import noise_of_log

SIZE, DT = 4000, 0.1


def write(folder, values, header="gyro_x_deg_h,gyro_y_deg_h"):
    path = folder / "log.csv"
    table = np.column_stack([DT * np.arange(len(values)), values])
    np.savetxt(path, table, delimiter=",", header=f"time_s,{header}", comments="", fmt="%.9g")
    return path


def still(seed=1, columns=2):
    return 10.0 + np.random.default_rng(seed).standard_normal((SIZE, columns))


def test_a_still_log(tmp_path):
    found = noise_of_log(write(tmp_path, still()))
    assert [c.name for c in found.channels] == ["gyro_x", "gyro_y"]
    assert found.kinds == ("gyro",)
    assert not found.findings
    # 1 deg/h a sample of 0.1 s
    expected = np.radians(1.0) / 3600.0 * np.sqrt(DT)
    for channel in found.channels:
        n = channel.model.angle_random_walk
        assert abs(n.value - expected) < 4.0 * n.u
    assert found.inputs["log"].startswith("sha256:")


@pytest.mark.long
@pytest.mark.parametrize("seed", range(8))
def test_rest_is_believed(tmp_path, seed):
    """A strong random walk of rate is noise, not movement."""
    walk = 0.1 * np.random.default_rng(seed).standard_normal((SIZE, 2)).cumsum(axis=0)
    assert not noise_of_log(write(tmp_path, still(100 + seed) + walk)).findings


@pytest.mark.long
@pytest.mark.parametrize("kind", ["knock", "turn", "step"])
def test_a_moving_log_is_noticed(tmp_path, kind):
    values = still()
    if kind == "knock":
        values[1234] += 50.0
    elif kind == "turn":
        values[1000:1500, 0] += 2000.0
    else:
        values[2000:, 0] += 4.0
    found = noise_of_log(write(tmp_path, values))
    assert found.findings[0].code in ("work-jump",)
    assert found.findings[0].values["name"] == "gyro_x"
    at = found.findings[0].values["time_s"]
    if kind != "knock":  # two rests: the longer one is named
        assert found.findings[0].values["rest"] != ()
    # within a stretch of 20 samples
    assert at == pytest.approx({"knock": 123.4, "turn": 100.0, "step": 200.0}[kind], abs=2.0)


def test_a_tool_that_was_carried_about_has_no_noise(tmp_path):
    """D16: noise of a moving log was written with exit 0; the longest rest, which is named, has the noise."""
    values = still()
    time = DT * np.arange(SIZE)
    swing = (time > 60.0) & ((time < 150.0) | (time > 360.0))
    values[swing] += 2000.0 * np.sin(time[swing])[:, None]
    path = write(tmp_path, values)
    with refused("work-moved", error=FileError) as caught:
        noise_of_log(path)
    (rest,) = caught.value.finding.values["rest"]
    start, stop = map(float, rest.removesuffix(" s").split(" .. "))
    assert (start, stop) == pytest.approx((150.0, 360.0), abs=1.0)
    found = noise_of_log(path, start=start, stop=stop)
    expected = np.radians(1.0) / 3600.0 * np.sqrt(DT)
    for channel in found.channels:
        n = channel.model.angle_random_walk
        assert abs(n.value - expected) < 4.0 * n.u
    with refused("input-value", value="150 .. 500", allowed="0 .. 399.9"):
        noise_of_log(path, start=150.0, stop=500.0)


def test_vibration_is_noticed(tmp_path):
    values = still() + 1.0 * np.sin(np.arange(SIZE) * 0.2)[:, None]
    assert noise_of_log(write(tmp_path, values)).findings[0].code == "work-noise-kinds"


def test_a_dead_channel_and_a_short_log_are_refused(tmp_path):
    values = still()
    values[:, 1] = 3.0
    with refused("work-column", error=FileError):
        noise_of_log(write(tmp_path, values))
    with refused("work-column", error=FileError):
        noise_of_log(write(tmp_path, still()[:20]))

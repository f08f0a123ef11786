"""Gross mistakes at a rate table: each is refused and named, single bad steps are found, good runs are left alone."""

from pathlib import Path

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.calibration.rate_table import calibrate_rates, table_rates
from inclinometry.cli.rates import table
from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.gyro_csv import read_rate_steps
from inclinometry.files.tool_json import read_calibration
from inclinometry.workflow.rate_table import calibrate_on_table

LATITUDE = np.radians(45.0)
SITE = Site(latitude=LATITUDE)
GAIN = np.array([[1.004, 0.002, -0.001], [0.001, 0.997, 0.003], [-0.002, 0.001, 1.001]])
SKEWED = np.array([[0.8, 0.1, 0.6], [-0.3, 0.8, 0.5], [-0.5, -0.7, 0.5], [0.6, -0.6, 0.5]])
OFFSET = np.array([1.2, -0.7, 0.4, 0.1])
MOUNTS = ((0, 0), (90, 0), (90, 90), (180, 0))
SPEEDS = (-20, -10, 10, 20)
NOISE = 0.02
PER_DEGREE = {"deg_h": 3600.0, "deg_s": 1.0, "rad_s": np.radians(1.0), "": 3600.0}


def steps(
    path, *, unit="deg_h", stated=1.0, signal=1.0, gain=GAIN, spikes=(), noise=NOISE, mounts=MOUNTS, speeds=SPEEDS,
    sensitivity=0.0, seed=1,
):  # fmt: skip
    """Steps with the stated rate times `stated` and signals times `signal`; spikes (row, gyro, deg/h)."""
    random, gain = np.random.default_rng(seed), np.asarray(gain)
    m, letters = len(gain), "xyz" if len(gain) <= 3 else "1234"
    tail = f"_{unit}" if unit else ""
    lines = ["station,inclination_deg,toolface_deg,rate_deg_s," + ",".join(f"gyro_{a}{tail}" for a in letters[:m])]
    rows = [(mounted, rate) for mounted in mounts for rate in speeds]
    bad = {(row, gyro): size for row, gyro, size in spikes}
    for row, (mounted, rate) in enumerate(rows):
        true = table_rates(*np.radians([*mounted, rate]), latitude=LATITUDE)
        down = table_rates(*np.radians([*mounted, 1.0]), latitude=0.0) / np.radians(1.0)
        own = np.degrees(gain @ true) * 3600.0 + OFFSET[:m] + noise * random.normal(size=m)
        own = own + sensitivity * (gain @ down) + [bad.get((row, gyro), 0.0) for gyro in range(m)]
        own = own / 3600.0 * PER_DEGREE[unit] * signal
        lines.append(",".join(repr(float(v)) for v in (row + 1, *mounted, rate * stated, *own)))
    Path(path).write_text("\n".join(lines) + "\n")
    return Path(path)


def fitted(path, **more):
    rates, _, notes, used = calibrate_on_table(read_rate_steps(path), SITE, **more)
    return rates, notes, used


@pytest.mark.parametrize("unit", list(PER_DEGREE))
@pytest.mark.parametrize("gain", [GAIN, GAIN[:2], SKEWED], ids=["three", "two", "skewed"])
def test_a_good_run_is_left_alone(tmp_path, unit, gain):
    _, notes, used = fitted(steps(tmp_path / "s.csv", unit=unit, gain=gain))
    assert [code for code in coded(notes) if code != "table-channels"] == []
    assert used == 16


@pytest.mark.parametrize("scale", [0.85, 1.18])
def test_a_scale_of_its_own_is_no_mistake_of_unit(tmp_path, scale):
    assert fitted(steps(tmp_path / "s.csv", signal=scale))[1] == ()
    with refused("work-rate-scale", error=FileError):
        fitted(steps(tmp_path / "s.csv", signal=scale**2))


RATES = {
    6.0: "rate_deg_s multiplied by 6",
    1.0 / 6.0: "rate_deg_s in revolutions per minute",
    1.0 / 360.0: "rate_deg_s in revolutions per second",
    np.degrees(1.0): "rate_deg_s converted to degrees twice",
    60.0: "rate_deg_s in degrees per minute",
    0.01 * np.degrees(1.0): "no usual mistake of unit",
}


@pytest.mark.parametrize("stated", list(RATES))
def test_a_rate_in_another_unit(tmp_path, stated):
    # the Earth's rate tells that it is the table's rate, not the signals, wherever both could explain the scale
    with refused("work-rate-scale", error=FileError) as caught:
        fitted(steps(tmp_path / "s.csv", stated=stated))
    mistakes = caught.value.finding.values["mistakes"]
    assert RATES[stated] in mistakes
    assert all(isinstance(one, str) for one in mistakes)


def test_a_rate_in_degrees_per_hour_and_one_in_radians(tmp_path):
    slow = steps(tmp_path / "s.csv", stated=3600.0, speeds=(-0.9, -0.4, 0.3, 0.8))
    with refused("work-rate-scale", error=FileError):
        fitted(slow)
    # 0.7 deg/s in radians is no whole number that would give itself away when read
    with refused("work-rate-scale", error=FileError):
        fitted(steps(tmp_path / "s.csv", stated=np.radians(1.0), speeds=(-0.7, 0.7)))


@pytest.mark.parametrize("said", ["deg_h", "deg_s", "rad_s"])
@pytest.mark.parametrize("true", ["deg_h", "deg_s", "rad_s"])
def test_signals_in_another_unit(tmp_path, said, true):
    path = steps(tmp_path / "s.csv", unit=said, signal=PER_DEGREE[true] / PER_DEGREE[said])
    if said == true:
        assert fitted(path)[1] == ()
        return
    mistake = f"{true.replace('_', '/')} given as {said.replace('_', '/')}"
    with refused("work-rate-scale", mistakes=(mistake,)):
        fitted(path)


def test_where_the_earth_is_not_seen_both_are_named(tmp_path):
    # a rate 57.3 times too small makes 600 deg/h of the vertical Earth rate; noise of 3000 deg/h hides that
    path = steps(tmp_path / "s.csv", unit="rad_s", stated=np.radians(1.0), noise=3000.0, speeds=(-77.7, 77.7))
    with refused("work-rate-scale", error=FileError):
        fitted(path)


def test_one_gyro_in_another_unit_is_named(tmp_path):
    gain = GAIN.copy()
    gain[1] /= 3600.0
    with refused("work-rate-scale", error=FileError):
        fitted(steps(tmp_path / "s.csv", gain=gain))


@pytest.mark.parametrize(("gain", "unit"), [(GAIN, "deg_h"), (GAIN, ""), (SKEWED, "deg_h"), (SKEWED, "")])
def test_a_table_of_the_other_sign(tmp_path, gain, unit):
    # letters give it away by the tensor, numbered gyros by the Earth's rate
    path = steps(tmp_path / "s.csv", gain=gain, unit=unit, stated=-1.0)
    with refused("work-rate-scale", "work-rate", error=FileError):
        fitted(path)
    if len(gain) == 3:
        with refused("work-rate-scale", error=FileError, ratio=-1.0):
            fitted(path, g_sensitive=True)


def test_gyros_of_the_other_sign(tmp_path, capsys):
    with refused("work-rate-scale", error=FileError, ratio=-1.0, mistakes=("sign of every gyro column",)):
        fitted(steps(tmp_path / "s.csv", gain=-GAIN))
    one = GAIN * [[1.0], [-1.0], [1.0]]
    with refused("work-rate-axes", error=FileError):
        fitted(steps(tmp_path / "s.csv", gain=one))
    with refused("work-rate-axes", error=FileError):
        fitted(steps(tmp_path / "s.csv", gain=GAIN[[1, 0, 2]]))
    # counts have no sense of their own: said, and shown with its sign
    (tmp_path / "site.toml").write_text("latitude_deg = 45.0\n")
    path = steps(tmp_path / "s.csv", gain=one, unit="")
    table(path, site=tmp_path / "site.toml", output_=tmp_path / "tool.json")
    printed = capsys.readouterr()
    assert "gyro_y: -y" in printed.err
    assert "[work-rate-axes]" in printed.err
    assert any("-3589" in line for line in printed.out.splitlines())
    # calibrated like that before, it is as expected
    assert not fitted(path, calibration=tmp_path / "tool.json")[1]


@pytest.mark.parametrize("stated", [6.0, 1.0 / 6.0, -1.0, np.degrees(1.0)])
def test_counts_have_no_scale_but_the_earth_s_rate_tells(tmp_path, stated):
    with refused("work-rate", error=FileError):
        fitted(steps(tmp_path / "s.csv", unit="", gain=SKEWED, stated=stated))
    with refused("work-rate", "work-rate-scale", error=FileError):
        fitted(steps(tmp_path / "s.csv", unit="", stated=stated))


def test_the_wrong_hemisphere_and_a_wrong_latitude(tmp_path):
    data = read_rate_steps(steps(tmp_path / "s.csv"))
    with refused("work-rate", error=FileError):
        calibrate_on_table(data, Site(latitude=-LATITUDE))
    # ten degrees off: the vertical Earth rate is smaller by 15.041 (sin 45 - sin 35) deg/h = 2.0 than it should be
    _, _, notes, _ = calibrate_on_table(data, Site(latitude=np.radians(35.0)))
    assert len(notes) == 1
    assert notes[0].code == "fit-rate-off"
    assert notes[0].values["rate_deg_h"] == pytest.approx(2.0, abs=0.1)


def test_a_g_sensitivity_is_advised_where_nothing_else_is_wrong(tmp_path):
    random = np.random.default_rng(2)
    rates = np.concatenate([table_rates(*np.radians([*m, s]), LATITUDE)[None] for m in MOUNTS for s in SPEEDS])
    down = np.concatenate([table_rates(*np.radians([*m, 1.0]), 0.0)[None] for m in MOUNTS for s in SPEEDS])
    down = down / np.radians(1.0)
    clean = np.degrees(rates @ GAIN.T) * 3600.0 + NOISE * random.normal(size=(16, 3))
    pull = np.array([[0.0, 0.5, 0.0], [0.0, 0.1, -0.4], [0.3, 0.0, 0.0]])
    assert coded(calibrate_rates(clean + down @ pull.T, rates, gravity=down).findings) == ["fit-g-needed"]
    assert calibrate_rates(clean, rates, gravity=down).findings == ()


class TestSingleSteps:
    def test_a_spike_is_named_by_its_line_and_left_out(self, tmp_path, capsys):
        (tmp_path / "site.toml").write_text("latitude_deg = 45.0\n")
        path = steps(tmp_path / "s.csv", spikes=[(6, 1, 50.0)])
        table(path, site=tmp_path / "site.toml", output_=tmp_path / "tool.json")
        printed = capsys.readouterr()
        assert printed.err.count("[work-step-off]") == 1
        assert printed.err.count("warning: ") == 1
        assert "15 of 16 steps used" in printed.out
        tool = read_calibration(tmp_path / "tool.json")
        assert any("Line 8" in str(one) for one in tool.findings)
        assert tool.residuals.values["gyro"].shape == (15, 3)
        # as if the step had never been there: noise and offsets within what 11 degrees of freedom scatter
        np.testing.assert_allclose(tool.tool.noise["gyro"], NOISE, rtol=0.8)
        np.testing.assert_allclose(tool.tool.triads["gyro"].offset[0], OFFSET[:3], atol=5.0 * NOISE / 4.0)

    def test_spikes_do_not_hide_each_other(self, tmp_path):
        path = steps(tmp_path / "s.csv", spikes=[(6, 1, 50.0), (9, 1, 50.0)])
        rates, notes, used = fitted(path)
        assert used == 14
        assert {one.values["line"] for one in notes if one.code == "work-step-off"} == {8, 11}
        np.testing.assert_allclose(rates.sd, NOISE, rtol=0.8)

    def test_a_step_all_gyros_contradict(self, tmp_path):
        _, notes, _ = fitted(steps(tmp_path / "s.csv", gain=SKEWED, spikes=[(3, gyro, 20.0) for gyro in range(4)]))
        assert notes[0].values["gyros"] == tuple(f"gyro_{n}_deg_h" for n in "1234")
        np.testing.assert_allclose(notes[0].values["off"], 20.0, atol=1.0)

    def test_without_redundancy_it_stays_and_is_said(self, tmp_path):
        # seven steps for four unknowns: six would leave no noise to speak of
        path = steps(tmp_path / "s.csv", spikes=[(3, 0, 500.0)])
        rows = path.read_text().splitlines()
        path.write_text("\n".join([rows[n] for n in (0, 1, 2, 4, 5, 8, 9, 12)]) + "\n")
        _, notes, used = fitted(path)
        assert used == 7
        assert [one.values["fate"] for one in notes if one.code == "work-step-off"] == ["still in the fit"]

    def test_a_g_sensitivity_is_no_spike(self, tmp_path):
        assert fitted(steps(tmp_path / "s.csv"), g_sensitive=True)[2] == 16
        _, notes, used = fitted(steps(tmp_path / "s.csv", sensitivity=1.0))
        assert used == 16
        assert notes[0].code == "fit-rate-off"
        assert notes[0].values["rate_deg_h"] == pytest.approx(-1.0, abs=0.1)

    @pytest.mark.long
    def test_clean_runs_lose_no_step(self):
        rates = np.concatenate([table_rates(*np.radians([*m, s]), LATITUDE)[None] for m in MOUNTS for s in SPEEDS])
        random, named = np.random.default_rng(3), 0
        for _ in range(600):
            signals = np.degrees(rates) * 3600.0 + NOISE * random.normal(size=(16, 3))
            named += bool(calibrate_rates(signals, rates).suspects)
        # one in a thousand at each of two looks: 1.2 expected, 7 exceeded once in 3000
        assert named <= 7

    def test_stated_noise_is_a_lower_limit(self):
        rates = np.concatenate([table_rates(*np.radians([*m, s]), LATITUDE)[None] for m in MOUNTS for s in SPEEDS])
        signals = np.degrees(rates) * 3600.0 + NOISE * np.random.default_rng(4).normal(size=(16, 3))
        signals[5, 2] += 20.0 * NOISE
        found = calibrate_rates(signals, rates, sd=NOISE)
        assert [(suspect.row, list(suspect.off)) for suspect in found.suspects] == [(5, [2])]
        assert found.suspects[0].off[2] == pytest.approx(20.0 * NOISE, abs=4.0 * NOISE)
        assert not calibrate_rates(signals, rates, sd=20.0 * NOISE).suspects
        # all scatter more than stated: none of them stands out
        assert not calibrate_rates(
            np.degrees(rates) + np.random.default_rng(4).normal(size=(16, 3)), rates, sd=0.1
        ).suspects


def test_a_gyro_of_very_different_noise_is_named(tmp_path):
    rates = np.concatenate([table_rates(*np.radians([*m, s]), LATITUDE)[None] for m in MOUNTS for s in SPEEDS])
    noise = NOISE * np.random.default_rng(5).normal(size=(16, 3)) * [1.0, 1.0, 20.0]
    # as rates, not as signals: a gyro of ten times the gain may scatter ten times as much
    for gain, named in (([1.0, 1.0, 1.0], True), ([1.0, 1.0, 20.0], False)):
        found = calibrate_rates(np.degrees(rates) * 3600.0 * gain + noise, rates).findings
        assert any(one.code == "bench-channel-noisy" and one.values["sensor"] == 3 for one in found) is named

"""The patent's own cases: a scale factor far from what was stated, no thermometer, readings without any noise."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.gyro_csv import read_gyro_run, write_gyro_run
from inclinometry.gyro.closed_form import solve_patent
from inclinometry.rotations import wrap_signed
from inclinometry.simulate.gyro import GyroSensors, Spike, simulate_gyro_run
from inclinometry.workflow.gyro import GyroOptions, north_run, write_run
from inclinometry.workflow.gyro_average import average_run

DEG_H = np.radians(1.0) / 3600.0
DWELL = 60.0
FAR = Site(latitude=np.radians(60.0))


@pytest.fixture
def measured(tmp_path):
    """measured(scale, ...): readings and truth of 24 stations at 0.015 deg/h on each averaged rate."""

    def make(
        scale,
        seed=0,
        *,
        steep=(2.0, 85.0),
        noise=0.015,
        heat=True,
        site=FAR,
        size=24,
        accel=1e-4,
        spikes=(),
        azimuth=None,
    ):
        rng = np.random.default_rng(seed)
        sensors = GyroSensors(
            gyro_bias=3.0 * DEG_H,
            accelerometer_bias=0.05,
            arw=2.0 * noise * DEG_H * np.sqrt(DWELL),  # two gyros in four positions: four readings of each component
            accelerometer_noise=accel,
        )
        wandering = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(rng.normal(0.0, np.radians(1.5), size))
        run = simulate_gyro_run(
            30.0 * np.arange(1.0, size + 1.0),
            np.radians(np.linspace(*steep, size)),
            wandering if azimuth is None else azimuth,
            rng.uniform(0.0, 2.0 * np.pi, size),
            latitude=site.latitude,
            scale=scale,
            dwell=DWELL,
            g=site.gravity,
            sensors=sensors,
            spikes=spikes,
            seed=seed,
        )
        path = tmp_path / "raw.csv"
        write_gyro_run(
            path,
            station=[str(s) for s in run.station],
            md=run.md,
            index=run.index,
            channels={"accelerometer": run.accelerometer, "gyro": run.gyro / DEG_H},
            letters={"accelerometer": "xy", "gyro": "xy"},
            units={"accelerometer": "m/s^2", "gyro": "deg/h"},
            temperature=run.temperature if heat else None,
        )
        return read_gyro_run(path), run

    return make


def reduced(data, site=FAR, **options):
    return north_run(data, site, options=GyroOptions(hole="down", **options))


def rms(errors):
    return float(np.degrees(np.sqrt(np.nanmean(np.square(errors)))))


@pytest.mark.long
@pytest.mark.parametrize("scale", [0.8, 1.05, 1.2])
def test_the_patent_follows_the_tools_own_history_and_the_default_is_as_good(measured, scale):
    off = {name: [] for name in ("patent", "from no history", "joint", "joint, no thermometer")}
    for seed in range(3):
        data, run = measured(scale, seed)
        averages = average_run(data, None, scheme="four", g=FAR.gravity)
        alone = solve_patent(
            averages.gravity.field,
            averages.rate.field,
            FAR.latitude,
            gravity_covariance=averages.gravity.covariance,
            rate_covariance=averages.rate.covariance,
            g=FAR.gravity,
        )
        found = reduced(data, method="patent").north
        assert np.isfinite(found.azimuth).mean() > 0.8
        off["patent"].append(wrap_signed(found.azimuth - run.azimuth))
        off["from no history"].append(wrap_signed(alone.azimuth - run.azimuth))
        joint = reduced(data)
        assert "gyro-scale-contradicted" in coded(joint.survey.findings)
        off["joint"].append(wrap_signed(joint.north.azimuth - run.azimuth))
        cold, _ = measured(scale, seed, heat=False)
        off["joint, no thermometer"].append(wrap_signed(reduced(cold).north.azimuth - run.azimuth))
    # 72 stations; they were 17 to 39 deg with a history that never left 1
    assert rms(off["from no history"]) < 0.4
    assert rms(off["patent"]) <= 1.2 * rms(off["from no history"])
    # judged where the closed form has an azimuth at all: there the joint estimate is not worse
    known = np.isfinite(off["patent"])
    for name in ("joint", "joint, no thermometer"):
        assert rms(np.array(off[name])[known]) <= rms(np.array(off["patent"])[known])


@pytest.mark.long
def test_no_thermometer_is_needed(measured):
    """A constant scale error of 2 %: 2.1 deg as long as nothing was learnt without temperatures."""
    size = {}
    for name, options in {"with": {}, "without": {}, "previous": {"prior": "previous"}}.items():
        off = []
        for seed in range(3):
            data, run = measured(1.02, seed, steep=(2.0, 60.0), heat=name == "with")
            off.append(wrap_signed(reduced(data, **options).north.azimuth - run.azimuth))
        size[name] = rms(off)
    # the wandering that is allowed for costs a little; 72 stations know an rms to 8 %
    assert size["with"] < 0.2
    assert size["without"] < 1.25 * size["with"]
    assert size["previous"] < 1.5 * size["with"]


@pytest.mark.long
def test_what_is_stated_of_the_scale_acts_on_the_patent_too(measured):
    """From 40 deg at latitude 60 on both roots are positive: what is stated decides, or nothing does."""
    data, run = measured(0.8, 2, steep=(40.0, 70.0))
    tight = reduced(data, method="patent").north
    # neither root is near 1 +- 0.003: said so, instead of a wrong azimuth
    assert np.mean(["history" in row for row in tight.flags]) > 0.8
    wide = reduced(data, method="patent", scale_sd=0.2).north
    assert np.isfinite(wide.azimuth).mean() > 0.8
    assert rms(wrap_signed(wide.azimuth - run.azimuth)) < 0.5
    with refused("input-not-with", name="prior run", other="scale patent"):
        GyroOptions(method="patent", prior="run")


@pytest.mark.long
def test_a_true_statement_stands_and_one_disturbed_station_does_not_outvote_it(measured):
    # three of four positions of one gyro moved together look like another rate, not like a spike
    moved = [Spike(7, position, 0, (1.0, 0.0, -1.0)[position] * 2.0 * DEG_H) for position in (0, 2)]
    for spikes in ([], moved):
        data, run = measured(1.0, 3, steep=(2.0, 40.0), spikes=spikes)
        for prior in ("run", "both"):
            found = reduced(data, prior=prior)
            assert "gyro-scale-contradicted" not in coded(found.survey.findings)
            others = np.arange(24) != 7
            assert rms(wrap_signed(found.north.azimuth - run.azimuth)[others]) < 0.25


def test_online_a_wrong_statement_costs_the_first_station_at_most(measured):
    data, run = measured(1.05, 0)
    found = reduced(data, prior="both")
    off = wrap_signed(found.north.azimuth - run.azimuth)
    assert rms(off[1:]) < 0.3
    [said] = [one for one in found.survey.findings if one.code == "gyro-scale-contradicted"]
    assert (said.values["stated"], said.values["sd_percent"]) == pytest.approx((1.0, 0.3))
    assert said.values["fitted"] == pytest.approx(1.05, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize("scale", [0.8, 1.05])
def test_online_a_first_station_where_the_scale_is_not_seen_is_honest_too(measured, scale):
    """K is zero there: what the statement alone said of the first station does not stand once it is contradicted."""
    data, run = measured(scale, 0, steep=(80.0, 80.0), size=16, azimuth=np.radians(95.844 + np.linspace(0.0, 20.0, 16)))
    found = reduced(data, prior="previous")
    off, u = wrap_signed(found.north.azimuth - run.azimuth), found.north.u("azimuth")
    assert "gyro-scale-contradicted" in coded(found.survey.findings)
    # the first station, whose rates and statement fit no azimuth, may have none
    assert np.isfinite(off[1:]).all()
    # sixteen draws: one in 10^4 is further than four standard uncertainties
    assert np.nanmax(np.abs(off / u)) < 4.0


@pytest.mark.long
def test_readings_without_noise_are_accepted_and_exact(measured):
    rng = np.random.default_rng(4)
    for seed in range(12):
        site = Site(latitude=np.radians(rng.choice([-1.0, 1.0]) * rng.uniform(5.0, 80.0)))
        steep, scale = rng.uniform(0.0, 88.0, 2), rng.normal(1.0, 0.002)
        data, run = measured(scale, seed, steep=steep, noise=0.0, accel=0.0, site=site, size=12)
        off = wrap_signed(reduced(data, site).north.azimuth - run.azimuth)
        # rounding of 1e-16 in 15 deg/h and 10 m/s2, over K = 1e-3 and a sine of inclination as small at worst
        assert np.degrees(np.abs(off).max()) < 1e-5


def test_without_noise_a_latitude_of_the_wrong_sign_is_still_named(measured):
    data, _ = measured(1.0, 5, noise=0.0, accel=0.0)
    with pytest.raises(FileError) as caught:
        reduced(data, Site(latitude=-FAR.latitude))
    assert caught.value.finding.code == "gyro-latitude-sign"


@pytest.mark.parametrize(
    "moved",
    [lambda n: 0.97 + 0.001 * n, lambda n: 1.0 + 0.03 * np.sin(n / 6.0), lambda n: 1.0 + 0.03 * (-1.0) ** (n // 10)],
)
def test_a_scale_factor_that_moves_fails_no_check_and_a_wrong_latitude_still_does(measured, moved):
    data, _ = measured(moved(np.arange(60)), 2, steep=(2.0, 60.0), heat=False, size=60)
    assert [check.verdict for check in reduced(data).checks] == ["pass"] * 3
    wrong = reduced(data, Site(latitude=FAR.latitude + np.radians(3.0)))
    assert "fail" in [check.verdict for check in wrong.checks]


@pytest.mark.parametrize("degrees", [-1.0, 1.0])
def test_a_latitude_wrong_by_one_degree_is_named(measured, degrees):
    data, _ = measured(1.0, 2, steep=(2.0, 60.0), heat=False, size=60)
    assert [check.verdict for check in reduced(data).checks] == ["pass"] * 3
    wrong = reduced(data, Site(latitude=FAR.latitude + np.radians(degrees)))
    assert [check.verdict for check in wrong.checks if check.name == "latitude"] == ["fail"]


@pytest.mark.long
def test_near_horizontal_only_what_is_lost_is_flagged(measured):
    """1 mm/s2: u(inclination) is 0.05 deg at 87 and 0.2 at 89 deg, so that 90 is out of reach but for the last few."""
    flagged, z, size = 0, [], 0
    for seed in range(4):
        data, run = measured(1.0, seed, steep=(85.0, 89.9), accel=1e-3)
        # in units of the very |g| here: that of another place would be lost sooner
        north = reduced(data, gravity_sd=0.0, misalignment=0.0, g_sensitivity=0.0).north
        lost = np.array(["horizontal" in row for row in north.flags])
        odd = np.array([bool({"ambiguous", "weak"} & set(row)) for row in north.flags])
        assert not any("vertical" in row for row in north.flags)
        flagged, size = flagged + int(lost.sum()), size + len(north)
        z.append((wrap_signed(north.azimuth - run.azimuth) / north.u("azimuth"))[~lost & ~odd])
    assert flagged < 0.25 * size
    # some 70 deviates: 1 +- 0.09, four of these
    assert 0.64 < np.sqrt(np.mean(np.concatenate(z) ** 2)) < 1.36


@pytest.mark.long
@pytest.mark.parametrize("method", ["joint", "patent", "fixed"])
def test_corrected_rates_are_written(measured, tmp_path, method):
    data, run = measured(1.002, 6, noise=0.0, accel=0.0, steep=(5.0, 25.0))
    found = reduced(data, method=method)
    write_run(found, tmp_path / "stations.csv")
    with (tmp_path / "stations.csv").open() as file:
        rows = list(csv.DictReader(file))
    true = run.clean[::4] / DEG_H * (1.0 if method == "fixed" else 1.002)
    for place, axis in enumerate("xy"):
        written = [float(row[f"gyro_{axis}_corrected_deg_h"]) for row in rows]
        # a scale of 1e-9 in 15 deg/h
        np.testing.assert_allclose(written, true[:, place], atol=1e-6)
    assert all(row["gyro_z_corrected_deg_h"] == "" for row in rows)
    said = [one for one in found.survey.findings if one.code == "gyro-noise-estimated"]
    assert [(one.values["kind"], one.values["unit"], one.severity) for one in said] == [
        ("accelerometer", "m/s^2", "note"), ("gyro", "deg/h", "note"),
    ]  # fmt: skip


def test_a_wrong_scale_of_three_accelerometers_is_named(tmp_path):
    """The patent claims corrected accelerometers; only gravity itself, seen along the tool too, tells of them."""
    for factor in (1.0, 1.004):
        sensors = GyroSensors(
            gyro_tensor=np.eye(3)[:2], accelerometer_tensor=factor * np.eye(3), arw=1e-9, accelerometer_noise=1e-4
        )
        run = simulate_gyro_run(
            30.0 * np.arange(1.0, 7.0),
            np.radians(np.linspace(20.0, 50.0, 6)),
            np.full(6, 0.7),
            np.zeros(6),
            latitude=FAR.latitude,
            g=FAR.gravity,
            sensors=sensors,
            seed=1,
        )
        write_gyro_run(
            tmp_path / "raw.csv",
            station=[str(s) for s in run.station],
            md=run.md,
            index=run.index,
            channels={"accelerometer": run.accelerometer, "gyro": run.gyro / DEG_H},
            letters={"accelerometer": "xyz", "gyro": "xy"},
            units={"accelerometer": "m/s^2", "gyro": "deg/h"},
        )
        found = north_run(read_gyro_run(tmp_path / "raw.csv"), FAR).survey.findings
        off = [one.values["off_percent"] for one in found if one.code == "gyro-gravity-off"]
        assert off == ([pytest.approx(0.4, abs=0.005)] if factor > 1.0 else [])

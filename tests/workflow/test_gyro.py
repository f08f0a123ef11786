"""From a file of readings to north: right without noise, honest with it, and refused where it cannot be right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.earth.site import Site
from inclinometry.errors import InputError
from inclinometry.files.scale_json import read_scale, write_scale
from inclinometry.gyro.result import FLAGS
from inclinometry.rotations import wrap_signed
from inclinometry.workflow.gyro import METHODS, PRIORS, GyroOptions, north_run
from inclinometry.workflow.simulate_gyro import gyro_run

DEG_H = np.radians(1.0) / 3600.0
HERE = Site(latitude=np.pi / 4, north_reference="true")
PERFECT = {"misalignment": 0.0, "g_sensitivity": 0.0}
LOST = {"complex", "double-root", "history", "horizontal", "up-hole", "parallel", "vertical"}
"""Flags that say why the closed form has no azimuth."""


def errors(found, run):
    """Errors over their standard uncertainties: azimuth, inclination, scale."""
    north = found.north
    return np.array(
        [
            wrap_signed(north.azimuth - run.azimuth) / north.u("azimuth"),
            (north.inclination - run.inclination) / north.u("inclination"),
            (north.scale - run.scale) / north.u_scale,
        ]
    )


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def stated(run):
    """Noise as simulated, for schemes that leave no residual."""
    return {"gyro_sd": float(run.noise["gyro"]), "accelerometer_sd": run.noise["accelerometer"]}


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scheme", ["two", "four", "mirrored", "n", "carousel"])
def test_without_noise_or_scale_error_every_scheme_and_method_is_right(simulated, scheme, method):
    data, run = simulated(scenario="cool", scheme=scheme, arw=0.0, accelerometer_noise=0.0, stations=6)
    options = GyroOptions(scheme=scheme, method=method, gyro_sd=1e-6 * DEG_H, accelerometer_sd=1e-9, hole="down")
    found = north_run(data, HERE, options=options).north
    # angles are read from a file that keeps the rates to 1e-16 of 15 deg/h; at 2 deg inclination that is 1e-9 rad
    np.testing.assert_allclose(wrap_signed(found.azimuth - run.azimuth), 0.0, atol=1e-8)
    np.testing.assert_allclose(found.inclination, run.inclination, atol=1e-8)
    np.testing.assert_allclose(wrap_signed(found.toolface - run.toolface), 0.0, atol=1e-8)
    np.testing.assert_allclose(found.scale, 1.0, atol=1e-7)


@pytest.mark.long
@pytest.mark.parametrize(
    ("scheme", "axes", "gyros"),
    [
        ("two", 2, 2),
        ("four", 2, 2),
        ("four", 3, 2),
        ("four", 2, 1),
        ("mirrored", 3, 2),
        ("n", 2, 2),
        ("carousel", 2, 1),
    ],
)
def test_uncertainties_are_honest(simulated, scheme, axes, gyros):
    off = []
    for seed in range(5):
        data, run = simulated(seed, scheme=scheme, axes=axes, gyros=gyros)
        # |g| as simulated is exactly that of the site
        options = GyroOptions(scheme=scheme, gravity_sd=0.0, **PERFECT, **(stated(run) if scheme == "two" else {}))
        off.append(errors(north_run(data, HERE, options=options), run))
    azimuth, inclination, scale = (rms(values) for values in np.transpose(off, (1, 0, 2)))
    # 100 deviates: rms 1 +- 0.071; four of these and 5 % for the noise, itself estimated from 40 or more residuals
    assert 0.68 < azimuth < 1.33
    assert 0.68 < inclination < 1.33
    # the scale follows one curve over a run: of 100 deviates some 4 a run are independent, 20 in all: 1 +- 0.16
    assert 0.45 < scale < 1.6


def test_gravity_that_differs_is_in_the_uncertainty(simulated):
    """Two accelerometers: 0.1 % of |g| is 0.057 deg times the tangent of the inclination."""
    data, run = simulated(scheme="four", axes=2, gyros=2, stations=20)
    exact, unsure = (
        north_run(data, HERE, options=GyroOptions(gravity_sd=sd)).north.u("inclination") for sd in (0.0, 1e-3)
    )
    added = np.sqrt(unsure**2 - exact**2)
    np.testing.assert_allclose(added, 1e-3 * np.tan(run.inclination), rtol=0.02)


@pytest.mark.long
def test_the_hot_run_is_better_than_with_a_fixed_scale(simulated):
    """Scenario of a hole of 20 to 140 degC: what is learnt of the scale is what the azimuth lacked."""
    sizes = {name: [] for name in ("joint", "fixed", "usual axes")}
    for seed in range(8):
        data, run = simulated(seed, stations=40, arw=0.3 * np.radians(0.005) / 60.0)
        found = north_run(data, HERE, options=GyroOptions(**PERFECT))
        north = {"joint": found.north, "fixed": found.others["fixed"]}
        if seed < 4:
            north["usual axes"] = north_run(data, HERE).north
        for name, one in north.items():
            sizes[name].append(wrap_signed(one.azimuth - run.azimuth))
    # 0.033 against 0.23 deg in the scenario of 0.0045 deg/h, there with an arctangent; least squares is better
    assert rms(sizes["joint"]) < 0.6 * rms(sizes["fixed"])
    assert rms(sizes["usual axes"]) < np.radians(0.12)


@pytest.mark.long
@pytest.mark.parametrize("prior", PRIORS)
def test_every_prior_is_honest_and_more_knowledge_is_not_worse(simulated, prior):
    off, u = [], []
    for seed in range(4):
        data, run = simulated(seed)
        found, alone = (north_run(data, HERE, options=GyroOptions(prior=p, **PERFECT)) for p in (prior, "calibration"))
        off.append(errors(found, run))
        u.append(found.north.u_scale / alone.north.u_scale)
    azimuth, inclination, _ = (rms(values) for values in np.transpose(off, (1, 0, 2)))
    # 80 deviates: 1 +- 0.08, four of these
    assert 0.65 < azimuth < 1.35
    assert 0.65 < inclination < 1.35
    if prior in ("both", "run"):
        # the same belief and other stations on top of it, between which the scale may have walked
        assert np.median(u) < 1.0
    assert (found.track is None) == (prior == "calibration")


@pytest.mark.long
def test_the_default_prior_is_the_run_with_temperatures_or_without(simulated):
    data, _ = simulated()
    default, run = north_run(data, HERE), north_run(data, HERE, options=GyroOptions(prior="run"))
    np.testing.assert_array_equal(default.north.azimuth, run.north.azimuth)
    cold = replace(data, temperature=None)
    default, run = north_run(cold, HERE), north_run(cold, HERE, options=GyroOptions(prior="run"))
    np.testing.assert_array_equal(default.north.azimuth, run.north.azimuth)
    record = north_run(data, HERE).record()
    with refused("input-needs", name="--history", needed=("temperature_degC",)):
        north_run(cold, HERE, options=GyroOptions(history=replace(record, inputs={})))


@pytest.mark.long
def test_the_patent_names_its_root_and_its_blanks(simulated):
    """Far from the equator and steep, half of the azimuths are beyond the closed form's single root."""
    blank = 0
    for seed in range(12):
        data, _ = simulated(seed, latitude=np.radians(65.0), stations=40)
        site = Site(latitude=np.radians(65.0))
        found = north_run(data, site, options=GyroOptions(method="patent", hole="down")).north
        lost = np.isnan(found.azimuth)
        np.testing.assert_array_equal(lost, np.isnan(found.scale) | lost)
        for n in range(len(found)):
            assert bool(set(found.flags[n]) & LOST) or not lost[n]
            if np.isfinite(found.k[n]):
                assert found.root[n] == ("+" if found.k[n] > 0 else "-")
            else:
                assert found.root[n] == ""
            assert set(found.flags[n]) <= set(FLAGS)
        blank += int(lost.sum())
        joint = north_run(data, site, options=GyroOptions(hole="down")).north
        assert np.isfinite(joint.azimuth).all()
        assert np.isfinite(joint.scale).all()
    assert blank > 0


@pytest.mark.long
def test_a_constant_bias_leaves_no_trace(simulated):
    still, _ = simulated(change=lambda c: {})
    moved, _ = simulated(
        change=lambda c: {
            "channels": {
                "accelerometer": c["channels"]["accelerometer"] + [0.11, -0.07],
                "gyro": c["channels"]["gyro"] + [7.0 * DEG_H, -3.0 * DEG_H],
            }
        }
    )
    one, other = (north_run(data, HERE).north for data in (still, moved))
    # rounding of 0.1 in 10 m/s^2 and 7 in 15 deg/h
    np.testing.assert_allclose(wrap_signed(one.azimuth - other.azimuth), 0.0, atol=1e-9)
    np.testing.assert_allclose(one.u("azimuth"), other.u("azimuth"), rtol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("turn", [-720.0, -360.0, 17.0, 200.0])
def test_another_zero_of_the_index_is_another_toolface(simulated, turn):
    still, _ = simulated(change=lambda c: {})
    moved, _ = simulated(change=lambda c: {"index": c["index"] + np.radians(turn)})
    options = GyroOptions(scheme="n")
    one, other = (north_run(data, HERE, options=options).north for data in (still, moved))
    np.testing.assert_allclose(wrap_signed(one.azimuth - other.azimuth), 0.0, atol=1e-9)
    # x at index 0 now stands where it stood at index -turn
    np.testing.assert_allclose(wrap_signed(one.toolface - np.radians(turn) - other.toolface), 0.0, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "unit", "factor"),
    [
        ("gyro", "deg/h", 1.0 / DEG_H),
        ("gyro", "deg/s", 1.0 / (3600.0 * DEG_H)),
        ("accelerometer", "g", 1.0 / 9.80665),
        ("accelerometer", "mg", 1e3 / 9.80665),
        ("accelerometer", "counts", 1.0),
    ],
)
def test_units_are_only_names(simulated, kind, unit, factor):
    still, _ = simulated(change=lambda c: {})
    named, _ = simulated(
        change=lambda c: {
            "units": {**c["units"], kind: unit},
            "channels": {**c["channels"], kind: factor * c["channels"][kind]},
        }
    )
    one, other = (north_run(data, HERE).north for data in (still, named))
    np.testing.assert_allclose(wrap_signed(one.azimuth - other.azimuth), 0.0, atol=1e-9)
    np.testing.assert_allclose(one.u("azimuth"), other.u("azimuth"), rtol=1e-9)


def test_a_run_upward_is_listed_from_the_top(simulated):
    data, _ = simulated()
    back = replace(data, md=data.md[::-1].copy())
    options = GyroOptions(prior="calibration", hole="down")
    down, up = north_run(data, HERE, options=options), north_run(back, HERE, options=options)
    np.testing.assert_array_equal(down.survey.azimuth, up.survey.azimuth[::-1])
    np.testing.assert_array_equal(up.survey.md, np.sort(data.md))
    # what belongs to the order of measurement stays in it
    np.testing.assert_array_equal(down.north.azimuth, up.north.azimuth)
    np.testing.assert_array_equal(up.md, back.md)
    assert "survey-bottom-up" in coded(up.survey.findings)


def test_one_station(simulated):
    def first(columns):
        kept = {name: columns[name][:4] for name in ("station", "md", "index", "temperature", "time")}
        return {**kept, "channels": {kind: values[:4] for kind, values in columns["channels"].items()}}

    data, run = simulated(change=first)
    for method in METHODS:
        found = north_run(data, HERE, options=GyroOptions(method=method))
        assert (len(found), len(found.survey)) == (1, 1)
        assert abs(errors(found, run)[0, 0]) < 4.0


@pytest.mark.long
def test_a_tool_without_z_points_where_it_is_told(simulated):
    """Cross-axis readings of a hole and of its mirror image above the horizon are the same: the statement decides."""
    data, _ = simulated(scenario="cool")
    assumed = north_run(data, HERE)
    assert all("down-assumed" in row for row in assumed.survey.flags)
    down = north_run(data, HERE, options=GyroOptions(hole="down"))
    assert not any("down-assumed" in row for row in down.survey.flags)
    np.testing.assert_array_equal(assumed.north.azimuth, down.north.azimuth)
    up = north_run(data, HERE, options=GyroOptions(hole="up"))
    np.testing.assert_allclose(up.north.inclination, np.pi - down.north.inclination, atol=1e-12)
    patent = north_run(data, HERE, options=GyroOptions(hole="up", method="patent")).north
    assert np.isnan(patent.azimuth).all()
    assert all("up-hole" in row for row in patent.flags)


@pytest.mark.long
def test_the_next_run_begins_with_what_the_last_one_taught(simulated, tmp_path):
    first, _ = simulated(1)
    write_scale(north_run(first, HERE, options=GyroOptions(**PERFECT)).record(), tmp_path / "scale.json")
    history = read_scale(tmp_path / "scale.json")
    # the same tool goes down again: another path, the same scale by temperature
    taught = gyro_run(1, stations=20, dwell=400.0, bias=DEG_H)
    assert np.ptp(taught.temperature) > 90.0
    data, _ = simulated(
        2, scenario="cool", change=lambda c: {"temperature": np.full(len(c["md"]), float(taught.temperature[0]))}
    )
    without = north_run(data, HERE, options=GyroOptions(prior="both"))
    with_it = north_run(data, HERE, options=GyroOptions(prior="both", history=history))
    assert without.track is not None
    assert with_it.track is not None
    # what was stated may not hold, with a probability of 5 per cent: that widens both, and leaves a ratio of 0.61
    assert with_it.track.expected_sd[0] < 0.65 * without.track.expected_sd[0]
    assert with_it.north.u_scale[0] < without.north.u_scale[0]


def test_readings_do_not_teach_themselves(simulated):
    data, _ = simulated()
    record = north_run(data, HERE).record()
    with refused("work-history-same"):
        north_run(data, HERE, options=GyroOptions(history=record))


@pytest.mark.long
def test_a_record_needs_temperatures(simulated):
    data, _ = simulated()
    assert len(north_run(data, HERE).record().observable) == 20
    for run in (
        north_run(replace(data, temperature=None), HERE),
        north_run(data, HERE, options=GyroOptions(method="patent")),
    ):
        with pytest.raises(InputError):
            run.record()


def test_temperatures_beyond_the_history_are_flagged(simulated):
    data, _ = simulated()
    record = north_run(data, HERE).record()
    narrow = replace(record, inputs={}, state=replace(record.state, temperature_range=(60.0, 100.0)))
    found = north_run(data, HERE, options=GyroOptions(history=narrow))
    heat = found.temperature
    flagged = np.array(["temperature" in row for row in found.north.flags])
    # a margin of some degrees is allowed, 20 is not
    assert flagged[(heat < 40.0) | (heat > 120.0)].all()
    assert not flagged[(heat > 60.0) & (heat < 100.0)].any()


@pytest.mark.long
@pytest.mark.parametrize(("spike", "line"), [((2, 1, 5.0 * DEG_H), 11), ((0, 3, -2.0 * DEG_H), 5)])
def test_one_spiky_position_is_left_out_and_named(simulated, spike, line):
    data, run = simulated(spike=spike)
    clean, _ = simulated()
    found = north_run(data, HERE)
    assert [n for n, row in enumerate(found.north.flags) if "spike" in row] == [spike[0]]
    [said] = [one for one in found.survey.findings if one.code == "gyro-reading-odd"]
    assert (said.values["line"], said.values["station"], said.rows) == (line, str(spike[0] + 1), (spike[0],))
    assert np.abs(errors(found, run)[0]).max() < 4.5
    others = np.arange(20) != spike[0]
    # the others change only through the noise estimated and the scale learnt
    before = north_run(clean, HERE).north
    assert np.abs(wrap_signed(found.north.azimuth - before.azimuth))[others].max() < 0.5 * before.u("azimuth").min()


@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        ({"method": "best"}, {"value": "best", "allowed": ("joint", "patent", "fixed")}),
        ({"prior": "hope"}, {"name": "prior", "value": "hope"}),
    ],
)
def test_options_that_are_not_there(options, wanted):
    with refused("input-choice", **wanted):
        GyroOptions(**options)


def test_the_same_run_gives_the_same_numbers(simulated):
    data, _ = simulated()
    one, other = north_run(data, HERE), north_run(data, HERE)
    np.testing.assert_array_equal(one.north.azimuth, other.north.azimuth)
    np.testing.assert_array_equal(one.survey.u_azimuth, other.survey.u_azimuth)
    assert one.survey.findings == other.survey.findings


def test_axes_that_nobody_calibrated_are_counted(simulated):
    # two standard deviations of each constant that index positions leave
    turn = np.radians(0.3) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    pull = 0.14 * DEG_H * np.array([[1.0, 1.0], [-1.0, 1.0]])

    def change(columns):
        channels = columns["channels"]
        down = channels["accelerometer"][:, :2] / 9.80665
        return {"channels": {**channels, "gyro": channels["gyro"] + channels["gyro"] @ turn.T + down @ pull.T}}

    data, run = simulated(2, change=change)
    found = north_run(data, HERE, options=GyroOptions(hole="down"))
    assert rms(errors(found, run)[0]) < 1.6  # 3.0 where they are ignored
    [said] = [one for one in found.survey.findings if one.code == "gyro-axes-assumed"]
    assert said.values["u_deg"] > 1.5 * said.values["stated_deg"]
    assert not np.any([set(row) - {"vertical"} for row in found.survey.flags])

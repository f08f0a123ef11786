"""The methods, the gyro's priors, axes and toolfaces that `dynamic` offers, each on a run whose truth is known."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from inclinometry.earth.rate import earth_rate
from inclinometry.earth.site import Site
from inclinometry.errors import FileError
from inclinometry.files.attitude_file import read_attitude, write_attitude
from inclinometry.files.run_file import open_run
from inclinometry.findings import Finding
from inclinometry.motion.result import METHODS, Samples
from inclinometry.rotations import dcm, dcm_from_quaternion, rotation_exp
from inclinometry.workflow.dynamic import attitude_stream, dynamic_run, write_dynamic
from inclinometry.workflow.dynamic_methods import METHODS as CHOICES
from inclinometry.workflow.dynamic_methods import DynamicOptions, MethodName, gyro_known

from ..refusals import refused

LATITUDE, DIP, FIELD, G = np.radians(50.0), np.radians(65.0), 50_000.0, 9.81
SITE = Site(latitude=LATITUDE, g=G, b=FIELD, dip=DIP)
TRUE = Site(latitude=LATITUDE, g=G, b=FIELD, dip=DIP, north_reference="true", declination=0.0, declination_sigma=0.0)
DEG_H, DEG_SQRT_H = np.radians(1.0) / 3600.0, np.radians(1.0) / 60.0
FOG = {"gyro_noise": 0.01 * DEG_SQRT_H, "gyro_bias_sigma": 0.01 * DEG_H}


def write(path, time, **triads):
    names = [f"{triad}_{axis}" for triad in triads for axis in "xyz"]
    table = np.column_stack([time, *triads.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(["time_s", *names]), comments="", fmt="%.10g")
    return path


def tool(toolface, speed, seed=1, *, inclination=30.0, dt=0.05):
    """Gravity, field and rate of a tool at azimuth 60, FOG grade: 0.01 deg/sqrt(h), 0.01 deg/h."""
    rng, size = np.random.default_rng(seed), len(toolface)
    matrix = dcm(np.full(size, np.radians(60.0)), np.full(size, np.radians(inclination)), toolface)
    turning = np.stack([0.0 * speed, 0.0 * speed, speed], axis=1)
    noise = FOG["gyro_noise"] / np.sqrt(dt) * rng.standard_normal((size, 3))
    return {
        "accel": G * matrix[:, :, 2] + rng.normal(0.0, 0.003, (size, 3)),
        "mag": FIELD * matrix @ [np.cos(DIP), 0.0, np.sin(DIP)] + rng.normal(0.0, 50.0, (size, 3)),
        "gyro": matrix @ earth_rate(LATITUDE) + turning + FOG["gyro_bias_sigma"] * rng.standard_normal(3) + noise,
    }


def still(seconds, **options):
    time = np.arange(round(seconds / 0.05)) * 0.05
    return time, tool(np.full(len(time), np.radians(100.0)), np.zeros(len(time)), **options)


def turning(seconds=40.0, speed=2.0):
    time = np.arange(round(seconds / 0.05)) * 0.05
    return time, tool(speed * time, np.full(len(time), speed))


def reduced(path, method="auto", site=SITE, **options):
    return dynamic_run(open_run(path), site, None, DynamicOptions(method, **options))


def off(found, name, true):
    """Departure and its standard uncertainty (k,), deg."""
    difference = np.degrees(getattr(found.rows, name)) - true
    return (difference + 180.0) % 360.0 - 180.0, np.degrees(getattr(found.rows, f"u_{name}"))


def test_every_name_of_the_option_is_a_method():
    assert set(get_args(MethodName)) == set(CHOICES)


@pytest.mark.parametrize("method", ["static", "quaternion"])
def test_a_tool_at_rest(tmp_path, method):
    time, seen = still(40.0)
    found = reduced(write(tmp_path / "a.csv", time, accel=seen["accel"], mag=seen["mag"]), method)
    assert {METHODS[n] for n in found.rows.method} == {method}
    for name, true in (("inclination", 30.0), ("azimuth", 60.0), ("toolface", 100.0), ("magnetic_toolface", 160.0)):
        error, u = off(found, name, true)
        # noise of 0.003 m/s^2 and 50 nT over 200 samples is a tenth of the stated 0.02 m/s^2 and 150 nT
        assert (np.abs(error) < 0.5 * u).all()
        assert (u < 1.0).all()


@pytest.mark.parametrize("method", ["static", "quaternion"])
def test_a_tool_that_turns_has_no_static_attitude(tmp_path, method):
    """Whole turns a batch: means of gravity and field lie along the hole, and inclination would be 0."""
    time, seen = turning(speed=2.0 * np.pi / 0.625)
    found = reduced(write(tmp_path / "a.csv", time, **seen), method)
    assert found.rows.refused.all()
    assert found.rows.count("not-still") == len(found.rows) == 4
    assert Finding("motion-moved", {"count": 4, "total": 4}) in found.findings


def test_robust_bridges_a_disturbed_window(tmp_path):
    time, seen = turning(120.0)
    bad = (time >= 50.0) & (time < 60.0)
    seen["mag"][bad] += [0.0, 0.0, 4000.0]  # steel nearby, along the hole: azimuth of this window is off by degrees
    path = write(tmp_path / "a.csv", time, **seen)
    plain, robust = (reduced(path, method) for method in ("magnetic", "robust"))
    assert {METHODS[n] for n in robust.rows.method} == {"robust"}
    assert len(plain.rows) == len(robust.rows) == 12
    worst, _ = off(plain, "azimuth", 60.0)
    error, u = off(robust, "azimuth", 60.0)
    assert np.abs(worst).max() > 2.0
    assert np.abs(error).max() < 0.3  # a tenth of what the disturbance makes
    assert (np.abs(error) < 3.0 * u).all()


def test_a_fog_finds_north_when_its_grade_is_known(tmp_path):
    """C17: with the priors of any gyro the azimuth is blank after two minutes; with its own it is good to 0.4 deg."""
    time, seen = still(120.0)
    path = write(tmp_path / "a.csv", time, accel=seen["accel"], gyro=seen["gyro"])
    blank = reduced(path, "gyro", TRUE, window=30.0)
    assert np.isnan(blank.rows.azimuth).all()
    values = blank.findings[0].values
    assert (round(values["bias_deg_h"]), values["bias_source"]) == (619, "usual value")
    for method in ("gyro", "static", "quaternion", "auto"):
        found = reduced(path, method, TRUE, window=30.0, **FOG)
        error, u = off(found, "azimuth", 60.0)
        # two standard uncertainties, U; the level's 0.02 m/s^2 and the noise of 30 s make them
        assert (np.abs(error) < 2.0 * u).all()
        assert (u < 1.0).all()
        values = found.findings[0].values
        assert values["noise_deg_sqrt_h"] == pytest.approx(0.01)
        assert values["noise_source"] == "stated"


def test_a_fog_keeps_north_while_the_tool_turns(tmp_path):
    """Two minutes at rest, a minute of turning, a minute at rest: 71 +- 58 deg without, 60 within U with its grade."""
    time = np.arange(4800) * 0.05
    x = np.clip(time - 120.0, 0.0, 60.0)
    toolface = np.radians(100.0) + 0.6 * (0.5 * x - 15.0 / np.pi * np.sin(2.0 * np.pi * x / 60.0))
    seen = tool(toolface, 0.6 * np.sin(np.pi * x / 60.0) ** 2)
    path = write(tmp_path / "a.csv", time, accel=seen["accel"], gyro=seen["gyro"])
    found = reduced(path, "gyro", TRUE, window=20.0, **FOG)
    error, u = off(found, "azimuth", 60.0)
    assert not found.rows.refused.any()
    assert (np.abs(error) < 2.0 * u).all()
    assert (u < 1.0).all()


def curve(**gyro):
    keys = ("arw_deg_sqrt_h", "bias_instability_deg_h", "rate_random_walk_deg_h_sqrt_h")
    channel = {"kind": "gyro", **{key: gyro.get(key) for key in keys}, "limit_arw_deg_sqrt_h": 0.5}
    return {"channels": [channel]}


def sources(said):
    return said.values["noise_source"], said.values["bias_source"]


def test_what_is_stated_stands_above_the_calibration_and_that_above_the_allan_curve():
    allan = curve(arw_deg_sqrt_h=0.02, bias_instability_deg_h=0.05, rate_random_walk_deg_h_sqrt_h=0.1)
    known, said = gyro_known(DynamicOptions(allan=allan), {"gyro": 0.12 * DEG_H})
    assert known["gyro_noise"] == pytest.approx(0.02 * DEG_SQRT_H)
    assert known["gyro_bias_sigma"] == pytest.approx(0.13 * DEG_H)  # 5, 12, 13
    assert known["gyro_bias_walk"] == pytest.approx(0.1 * DEG_H / 60.0)
    assert sources(said) == ("Allan deviation", "calibration")
    stated, said = gyro_known(DynamicOptions(gyro_noise=1e-6, gyro_bias_sigma=2e-7, allan=allan), {"gyro": 1e-6})
    assert (stated["gyro_noise"], stated["gyro_bias_sigma"]) == (1e-6, 2e-7)
    assert sources(said) == ("stated", "stated")
    # an Allan curve does not know the constant part of a bias, and what it does not see it limits
    alone, said = gyro_known(DynamicOptions(allan=curve()), {})
    assert alone == {"gyro_noise": pytest.approx(0.5 * DEG_SQRT_H)}
    assert sources(said) == ("Allan deviation", "usual value")
    with refused("work-allan"):
        gyro_known(DynamicOptions(allan={"channels": [{"kind": "gyro", "white_noise_counts_sqrt_s": 1.0}]}), {})


def test_a_grade_without_a_gyro_is_refused(tmp_path):
    time, seen = still(20.0)
    path = write(tmp_path / "a.csv", time, accel=seen["accel"], mag=seen["mag"])
    with refused("input-needs"):
        reduced(path, **FOG)


def test_quaternions_are_the_attitude_from_the_north_of_the_azimuth(tmp_path):
    """Scalar first, v_tool = q v_ned q*: the matrix of dcm(A, I, T); also after the declination, and from the file."""
    site = Site(b=FIELD, dip=DIP, g=G, declination=0.1, declination_sigma=0.0, north_reference="true")
    time, seen = still(40.0)
    found = reduced(write(tmp_path / "a.csv", time, accel=seen["accel"], mag=seen["mag"]), site=site)
    rows = found.rows
    assert np.degrees(rows.azimuth[0]) == pytest.approx(60.0 + np.degrees(0.1), abs=0.2)
    expected = dcm(rows.azimuth, rows.inclination, rows.toolface)
    np.testing.assert_allclose(dcm_from_quaternion(rows.quaternion), expected, atol=1e-12)
    for name in ("a.parquet", "b.csv"):
        write_dynamic(found, tmp_path / name)
        back = read_attitude(tmp_path / name)
        # written with twelve digits
        np.testing.assert_allclose(back.quaternion, rows.quaternion, atol=1e-12)
        np.testing.assert_allclose(back.magnetic_toolface, rows.magnetic_toolface, atol=1e-11)


def test_a_file_of_before_the_quaternions_is_still_read(tmp_path):
    time, seen = still(20.0)
    found = reduced(write(tmp_path / "a.csv", time, accel=seen["accel"], mag=seen["mag"]))
    write_attitude(found.rows, tmp_path / "new.csv")
    lines = [line.split(",") for line in (tmp_path / "new.csv").read_text().splitlines()]
    kept = lines[0].index("flags") + 1
    (tmp_path / "old.csv").write_text("\n".join(",".join(line[:kept]) for line in lines) + "\n")
    back = read_attitude(tmp_path / "old.csv")
    np.testing.assert_allclose(back.quaternion, found.rows.quaternion, atol=1e-10)
    assert np.isnan(back.magnetic_toolface).all()


@pytest.mark.parametrize(("switch", "kind"), [(5.0, "magnetic"), (2.0, "gravity")])
def test_the_toolface_to_steer_by(tmp_path, switch, kind):
    """At 3 deg of inclination azimuth and toolface are poor and their sum is good."""
    time, seen = still(20.0, inclination=3.0)
    path = write(tmp_path / "a.csv", time, accel=seen["accel"], mag=seen["mag"])
    found = reduced(path, switch=np.radians(switch))
    write_dynamic(found, tmp_path / "out.csv")
    header, first = (line.split(",") for line in (tmp_path / "out.csv").read_text().splitlines()[:2])
    assert first[header.index("toolface_type")] == kind
    error, u = off(found, "magnetic_toolface", 160.0)
    assert (np.abs(error) < u).all()
    assert (u < 0.7 * np.degrees(found.rows.u_toolface)).all()


MAPS = {
    "specific-force": ({"convention": "specific-force"}, {"accel": -np.eye(3)}),
    "z-up": (
        {"convention": "z-up"},
        {"accel": np.diag([-1.0, 1.0, 1.0]), "mag": np.diag([1.0, -1.0, -1.0]), "gyro": np.diag([1.0, -1.0, -1.0])},
    ),
    "x down": ({"axes": ("y", "z", "x")}, dict.fromkeys(("accel", "mag", "gyro"), np.eye(3)[[2, 0, 1]])),
    "another magnetometer": (
        {"magnetometer_axes": ("+y", "+x", "-z")},
        {"mag": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])},
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("name", MAPS)
def test_axes_and_signs_are_stated(tmp_path, name):
    """D12: what was refused with the advice to exchange all signs is reduced once stated; the refusal says how."""
    options, wired = MAPS[name]
    time, seen = turning(60.0)
    file = {triad: values @ wired.get(triad, np.eye(3)).T for triad, values in seen.items()}
    path = write(tmp_path / "a.csv", time, **file)
    option = f"--{next(iter(options)).replace('_', '-')}"
    with pytest.raises(FileError) as caught:
        reduced(path)
    assert option in str(caught.value)
    found, plain = reduced(path, **options), reduced(write(tmp_path / "b.csv", time, **seen))
    np.testing.assert_allclose(found.rows.azimuth, plain.rows.azimuth, atol=1e-9)
    np.testing.assert_allclose(found.rows.inclination, plain.rows.inclination, atol=1e-9)


def test_z_up_is_told_from_specific_force_and_without_a_dip_by_the_latitude(tmp_path):
    time, seen = turning(60.0)
    turned = {
        "accel": seen["accel"] * [-1.0, 1.0, 1.0],
        "mag": seen["mag"] * [1.0, -1.0, -1.0],
        "gyro": seen["gyro"] * [1.0, -1.0, -1.0],
    }
    path = write(tmp_path / "a.csv", time, **turned)
    for site in (SITE, Site(latitude=LATITUDE, g=G)):
        with refused("motion-signs") as caught:
            reduced(path, site=site)
        assert caught.value.finding.values["options"] == ("--convention z-up",)


def test_a_tool_in_free_motion_is_refused(tmp_path):
    """Turned about all axes: no window has an attitude, and the note names the package for such motion."""
    fine = 0.005 * np.arange(8000)
    rate = np.stack([0.8 * np.sin(0.7 * fine), 0.6 * np.cos(0.9 * fine), 0.5 * np.sin(1.3 * fine + 1.0)], axis=1)
    matrix = [dcm(0.6, 0.9, 0.3)]
    for w in rate[:-1]:
        matrix.append(rotation_exp(-0.005 * w) @ matrix[-1])
    matrix = np.array(matrix[::10])
    seen = {"accel": G * matrix[:, :, 2], "mag": FIELD * matrix @ [np.cos(DIP), 0.0, np.sin(DIP)], "gyro": rate[::10]}
    found = reduced(write(tmp_path / "a.csv", fine[::10], **seen))
    assert found.rows.refused.all()
    assert "motion-free" in {one.code for one in found.findings}


@pytest.mark.parametrize("moves", [still, turning])
def test_a_site_file_of_another_place_is_doubted(tmp_path, moves):
    time, seen = moves(40.0)
    path = write(tmp_path / "a.csv", time, accel=seen["accel"], mag=seen["mag"])
    # every window is refused: the run is, and says why
    with refused("motion-dip-axes") as caught:
        reduced(path, site=Site(latitude=LATITUDE, g=G, b=FIELD, dip=np.radians(70.0)))
    values = caught.value.finding.values
    assert (values["dip_deg"], values["site_deg"]) == pytest.approx((65.0, 70.0), abs=0.05)
    assert not {"motion-dip-axes", "motion-site"} & {one.code for one in reduced(path).findings}


@pytest.mark.parametrize("method", ["static", "quaternion", "robust"])
def test_streams_give_the_rows_of_the_whole_run(method):
    time, seen = still(40.0) if method in ("static", "quaternion") else turning(40.0)
    run = Samples(time, 0.05, **seen)
    options = DynamicOptions(method, 5.0, **FOG)
    rows = []
    for size in (len(run), 77):
        stream = attitude_stream(SITE, options)
        parts = [stream.push(run.part(start, min(start + size, len(run)))) for start in range(0, len(run), size)]
        rows.append(np.concatenate([part.quaternion for part in [*parts, stream.finish()]]))
    assert len(rows[0]) == 8
    assert np.array_equal(rows[0], rows[1], equal_nan=True)

"""North with uncertainty: differences for every cause, symmetries, the whole grid of attitudes, honest sigmas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.constants import EARTH_RATE
from inclinometry.earth.rate import earth_rate
from inclinometry.gyro.north import estimate_north, estimate_north_fixed
from inclinometry.gyro.result import FLAGS
from inclinometry.rotations import dcm, wrap_signed
from inclinometry.uncertainty import UNKNOWN

G = 9.81
G_SD = 1e-4 * G
SIGMA = 1e-3 * EARTH_RATE  # 0.015 deg/h
NOISE: dict[str, Any] = {"gravity_covariance": G_SD**2 * np.eye(3), "rate_covariance": SIGMA**2 * np.eye(3)}
NAMES = ("inclination", "azimuth", "toolface", "gyro_toolface")
SINGULAR = {"vertical", "ambiguous", "weak", "horizontal", "down-assumed"}
rad = np.radians


def readings(azimuth: Any, inclination: Any, toolface: Any, latitude: Any, scale: Any = 1.0) -> tuple[Any, Any]:
    """Gravity and gyro readings in tool axes."""
    turn = dcm(*np.broadcast_arrays(*(np.atleast_1d(v).astype(float) for v in (azimuth, inclination, toolface))))
    return G * turn[..., 2], turn @ earth_rate(latitude) / np.reshape(scale, (-1, 1))


def attitudes(seed: int, size: int) -> Any:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, 2.0 * np.pi, size), rng.uniform(0.1, 1.3, size), rng.uniform(0.0, 2.0 * np.pi, size)


def angle_errors(found: Any, truth: Any) -> Any:
    return np.abs(wrap_signed(found - truth))


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("accelerometers", [2, 3])
def test_every_cause_is_that_of_differences(axes: int, accelerometers: int) -> None:
    at, lat, sd = attitudes(1, 60), 0.7, {"scale": 0.004, "latitude": 0.002}
    gravity, rate = readings(*at, lat, 1.002)
    rng = np.random.default_rng(2)
    mix = rng.normal(size=(2, 3, 3))
    cov_g = (G_SD * mix[0]) @ (G_SD * mix[0]).T
    cov_w = (SIGMA * mix[1]) @ (SIGMA * mix[1]).T

    def angles(dg: Any = 0.0, dw: Any = 0.0, ds: float = 0.0, dlat: float = 0.0) -> Any:
        found = estimate_north(
            (gravity + dg)[:, :accelerometers],
            (rate + dw)[:, :axes],
            lat + dlat,
            gravity_covariance=cov_g[:accelerometers, :accelerometers],
            rate_covariance=cov_w[:axes, :axes],
            scale=1.002 + ds,
            scale_sd=sd["scale"],
            latitude_sd=sd["latitude"],
            g=G,
            hole="down",
        )
        return np.stack([getattr(found, n) for n in NAMES], axis=1), found

    def slope(name: str, step: Any, size: float) -> Any:
        return wrap_signed(angles(**{name: step})[0] - angles(**{name: -step})[0]) / (2.0 * size)

    _, base = angles()
    by_g = np.stack([slope("dg", 1e-6 * axis, 1e-6) for axis in np.eye(3)[:accelerometers]], axis=2)
    by_w = np.stack([slope("dw", 1e-6 * EARTH_RATE * a, 1e-6 * EARTH_RATE) for a in np.eye(3)[:axes]], axis=2)
    wanted = {
        "accelerometer": np.einsum("nij,jk,nik->ni", by_g, cov_g[:accelerometers, :accelerometers], by_g),
        "gyro": np.einsum("nij,jk,nik->ni", by_w, cov_w[:axes, :axes], by_w),
        "scale": (slope("ds", 1e-6, 1e-6) * sd["scale"]) ** 2,  # type: ignore[arg-type]
        "latitude": (slope("dlat", 1e-6, 1e-6) * sd["latitude"]) ** 2,  # type: ignore[arg-type]
    }
    sure = np.array([not set(f) & SINGULAR for f in base.flags])
    assert sure.sum() > 20
    for name, variance in wanted.items():
        # central differences: rounding 1e-16/1e-6, lifted by 1/K; floor far below what is added to it
        floor = 1e-6 * base.u("azimuth")[sure, None] ** 2 + 1e-16
        off = np.abs(base.components[name][sure] - variance[sure])
        assert (off <= 2e-3 * variance[sure] + floor).all(), name


@pytest.mark.parametrize("axes", [2, 3])
def test_a_given_scale_carries_its_uncertainty_into_the_azimuth(axes: int) -> None:
    at, lat = attitudes(3, 60), -0.6
    gravity, rate = readings(*at, lat, 0.997)
    # of three axes whose noise is one a scale leaves the azimuth alone
    noise = SIGMA**2 * np.diag([1.0, 2.0, 4.0])[:axes, :axes]
    rate, use = rate[:, :axes], {**NOISE, "rate_covariance": noise, "scale_sd": 0.004}
    found = estimate_north_fixed(gravity, rate, lat, scale=0.997, **use)
    assert np.median(found.components["scale"][:, 1]) > 1e-8
    plus = estimate_north_fixed(gravity, rate, lat, scale=0.997 + 1e-6, **use)
    minus = estimate_north_fixed(gravity, rate, lat, scale=0.997 - 1e-6, **use)
    slope = wrap_signed(plus.azimuth - minus.azimuth) / 2e-6
    sure = np.array([not set(f) & SINGULAR for f in found.flags])
    np.testing.assert_allclose(
        found.components["scale"][sure, 1], (0.004 * slope[sure]) ** 2, rtol=1e-4, atol=1e-12
    )  # differences to 1e-9
    np.testing.assert_allclose(found.u_scale, 0.004, rtol=1e-12)


def test_a_scale_known_exactly_is_the_fixed_estimate() -> None:
    gravity, rate = readings(*attitudes(4, 200), 0.8)
    rate = rate + SIGMA * np.random.default_rng(4).normal(size=rate.shape)
    joint = estimate_north(gravity, rate[:, :2], 0.8, **_two(NOISE), scale=1.001, scale_sd=0.0)
    fixed = estimate_north_fixed(gravity, rate[:, :2], 0.8, **_two(NOISE), scale=1.001)
    np.testing.assert_array_equal(joint.azimuth, fixed.azimuth)
    np.testing.assert_array_equal(joint.u("azimuth"), fixed.u("azimuth"))
    assert (joint.method, fixed.method) == ("joint", "fixed")


@pytest.mark.parametrize("axes", [2, 3])
def test_a_scale_not_known_at_all_is_the_limit_of_one_hardly_known(axes: int) -> None:
    gravity, rate = readings(*attitudes(6, 60), 0.8)
    rate, noise = rate[:, :axes], {**NOISE, "rate_covariance": SIGMA**2 * np.eye(axes)}
    hardly, never = (estimate_north(gravity, rate, 0.8, **noise, scale_sd=sd) for sd in (100.0, np.inf))
    sure = np.array([not set(f) & SINGULAR for f in never.flags])
    assert sure.sum() > 20
    for name in NAMES:
        np.testing.assert_allclose(never.u(name)[sure], hardly.u(name)[sure], rtol=1e-4)
    # what the rates alone tell is not the prior's doing
    assert not never.components["scale"].any()


def _two(noise: dict[str, Any]) -> dict[str, Any]:
    return {**noise, "rate_covariance": noise["rate_covariance"][:2, :2]}


@pytest.mark.parametrize("axes", [2, 3])
def test_turning_the_tool_about_its_axis_turns_only_the_toolface(axes: int) -> None:
    azimuth, inclination, toolface = attitudes(5, 200)
    rng = np.random.default_rng(5)
    high = rng.normal(size=(200, 3)) * SIGMA
    found = []
    for turn in (0.0, 1.234):
        gravity, rate = readings(azimuth, inclination, toolface + turn, 0.8, 1.002)
        spin = dcm(0.0 * azimuth, 0.0 * azimuth, toolface + turn)
        noisy = rate + np.einsum("nij,nj->ni", spin, high)  # the same noise, turned with the tool
        use = {**NOISE, "rate_covariance": SIGMA**2 * np.eye(axes)}
        found.append(estimate_north(gravity, noisy[:, :axes], 0.8, **use))
    one, two = found
    sure = np.array([not set(f) & SINGULAR for f in one.flags])
    assert angle_errors(one.azimuth, two.azimuth)[sure].max() < 1e-10  # rounding over the smallest information
    np.testing.assert_allclose(two.u("azimuth")[sure], one.u("azimuth")[sure], rtol=1e-8)
    assert angle_errors(two.toolface, one.toolface + 1.234).max() < 1e-13
    assert two.flags == one.flags


def test_readings_in_the_southern_hemisphere_are_the_mirrored_ones() -> None:
    azimuth, inclination, toolface = attitudes(6, 200)
    north = estimate_north(*readings(azimuth, inclination, toolface, 0.8), 0.8, **NOISE)
    south = estimate_north(*readings(np.pi - azimuth, inclination, toolface, -0.8), -0.8, **NOISE)
    assert angle_errors(south.azimuth, np.pi - north.azimuth).max() < 1e-12
    np.testing.assert_allclose(south.u("azimuth"), north.u("azimuth"), rtol=1e-9)
    np.testing.assert_allclose(south.k, north.k, atol=1e-12)


def whole_grid(step_deg: float = 10.0) -> Any:
    inclination, azimuth = np.meshgrid(
        rad(np.arange(0.0, 180.5, step_deg)), rad(np.arange(0.0, 359.5, step_deg)), indexing="ij"
    )
    toolface = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, inclination.size)
    return azimuth.ravel(), inclination.ravel(), toolface


def seen_by(gravity: Any, rate: Any, accelerometers: int, axes: int) -> dict[str, Any]:
    return {
        "gravity": gravity[:, :accelerometers],
        "rate": rate[:, :axes],
        "gravity_covariance": G_SD**2 * np.eye(accelerometers),
        "rate_covariance": SIGMA**2 * np.eye(axes),
        "g": G,
    }


def no_nan(found: Any) -> None:
    for name in (*NAMES, "scale", "u_scale", "k", "chi_square", "dof"):
        assert np.isfinite(getattr(found, name)).all(), name
    for name in NAMES:
        assert np.isfinite(found.u(name)).all(), name
        assert (found.u(name) <= UNKNOWN).all()
    assert all(np.isfinite(part).all() for part in found.components.values())
    assert set().union(*found.flags) <= set(FLAGS)


LATITUDES = (-85.0, -60.0, -45.0, -20.0, 0.0, 30.0, 45.0, 70.0, 85.0)


@pytest.mark.long
@pytest.mark.parametrize("scale_sd", [0.0, 0.003, np.inf])
@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("accelerometers", [2, 3])
def test_no_nan_over_the_whole_grid_and_right_where_not_flagged(
    accelerometers: int, axes: int, scale_sd: float
) -> None:
    clear = total = 0
    blind = accelerometers == axes == 2  # no z at all: up-holes have to be said
    for latitude in LATITUDES:
        at = whole_grid()
        gravity, rate = readings(*at, rad(latitude))
        for hole, rows in (("down", at[1] <= np.pi / 2), ("up", at[1] > np.pi / 2)) if blind else ((None, ...),):
            use = seen_by(gravity[rows], rate[rows], accelerometers, axes)
            found = estimate_north(latitude=rad(latitude), scale_sd=scale_sd, hole=hole, **use)
            no_nan(found)
            sure = np.array([not set(f) & SINGULAR for f in found.flags])
            off = np.degrees(angle_errors(found.azimuth, at[0][rows])[sure])
            assert off.max(initial=0.0) < 1e-9, (latitude, off.max())
            clear, total = clear + sure.sum(), total + len(found)
    # most of the grid is not singular; a scale of which nothing is known leaves two roots over much of it
    assert clear > (0.25 if axes == 2 and np.isinf(scale_sd) else 0.7) * total


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("accelerometers", [2, 3])
def test_stated_uncertainty_is_honest_over_the_whole_grid(accelerometers: int, axes: int) -> None:
    rng, squared, scales = np.random.default_rng(8), [], []
    for latitude in LATITUDES:
        azimuth, inclination, toolface = whole_grid(9.0)
        down = inclination <= np.pi / 2
        for hole, rows in (("down", down), ("up", ~down)):
            at = azimuth[rows], inclination[rows], toolface[rows]
            scale = 1.0 / rng.normal(1.0, 0.003, rows.sum())
            gravity, rate = readings(*at, rad(latitude), scale)
            gravity = gravity + G_SD * rng.normal(size=gravity.shape)
            rate = rate + SIGMA * rng.normal(size=rate.shape)
            use = seen_by(gravity, rate, accelerometers, axes)
            found = estimate_north(latitude=rad(latitude), scale_sd=0.003, hole=hole, **use)
            no_nan(found)
            sure = np.array([not set(f) & SINGULAR for f in found.flags])
            squared.append((wrap_signed(found.azimuth - at[0]) / found.u("azimuth"))[sure] ** 2)
            scales.append(((found.scale - scale) / found.u_scale)[sure] ** 2)
    for name, parts in (("azimuth", squared), ("scale", scales)):
        z = np.concatenate(parts)
        # 2.6 sigma of a mean of z^2, and 3 % for the curvature next to flagged places
        assert abs(np.mean(z) - 1.0) < 2.6 * np.sqrt(2.0 / len(z)) + 0.03, (name, np.mean(z), len(z))
        assert np.mean(z > 9.0) < 0.006, name  # Gaussian: 0.0027


def test_singular_places_are_flagged() -> None:
    east, lat = rad(90.0), rad(45.0)
    gravity, rate = readings([1.0, east, east, 0.5, np.pi], [0.0, east, rad(89.9), east, rad(45.0)], 0.3, lat)
    noise = {**NOISE, "rate_covariance": SIGMA**2 * np.eye(2)}
    flags = estimate_north(gravity, rate[:, :2], lat, **noise).flags
    assert "vertical" in flags[0]
    assert "weak" in flags[1]
    assert "weak" in flags[2]
    assert "weak" not in flags[3]
    # K = 0 with the scale not known: two roots meet
    psi = np.arccos(-1.0 / np.tan(rad(60.0)))
    at_double = readings(psi, rad(60.0), 0.0, lat)
    open_scale = estimate_north(at_double[0], at_double[1][:, :2], lat, **noise, scale_sd=np.inf)
    assert set(open_scale.flags[0]) & {"weak", "ambiguous"}
    assert abs(open_scale.k[0]) < 1e-3
    flat = estimate_north(gravity[3:4, :2], rate[3:4, :2], lat, g=G, gravity_covariance=G_SD**2 * np.eye(2),
                          rate_covariance=noise["rate_covariance"])  # fmt: skip
    assert {"down-assumed", "horizontal"} <= set(flat.flags[0])


@pytest.mark.parametrize("stated", [0.6, 1.0, 1.5])
def test_a_scale_is_flagged_beyond_four_of_its_deviations(stated: float) -> None:
    off = 1.0 + 0.01 * np.array([-5.0, -3.0, 3.0, 5.0])
    gravity, rate = readings(np.full(4, 0.3), 0.5, 0.1, 0.8, stated * off)
    quiet = {name: 1e-4 * value for name, value in NOISE.items()}
    found = estimate_north(gravity, rate, 0.8, **quiet, scale=stated, scale_sd=0.01 * stated)
    assert ["scale" in flags for flags in found.flags] == [True, False, False, True]


def test_scale_and_misfit_are_flagged() -> None:
    gravity, rate = readings([0.3, 0.3], [0.5, 0.5], 0.1, 0.8, [1.05, 1.0])
    found = estimate_north(gravity, rate, 0.8, **NOISE)
    assert "scale" in found.flags[0]
    assert found.flags[1] == ()
    elsewhere = estimate_north(gravity, rate, 0.3, **NOISE)
    assert "misfit" in elsewhere.flags[1]


def test_gyro_along_the_tool_tells_down_from_up_and_without_it_hole_does() -> None:
    at = rad([40.0, 100.0, 220.0]), rad([30.0, 150.0, 120.0]), rad([10.0, 20.0, 30.0])
    gravity, rate = readings(*at, 0.8)
    use = seen_by(gravity, rate, 2, 3)
    found = estimate_north(latitude=0.8, **use)
    np.testing.assert_allclose(found.inclination, at[1], atol=1e-9)
    assert angle_errors(found.azimuth, at[0]).max() < 1e-9
    blind = seen_by(gravity, rate, 2, 2)
    up = estimate_north(latitude=0.8, hole="up", **blind)
    np.testing.assert_allclose(up.inclination[1:], at[1][1:], atol=1e-9)
    assert angle_errors(up.azimuth, at[0])[1:].max() < 1e-9
    assert not any("down-assumed" in f for f in up.flags)
    assumed = estimate_north(latitude=0.8, **blind)
    assert all("down-assumed" in f for f in assumed.flags)
    assert (assumed.inclination < np.pi / 2).all()


@pytest.mark.parametrize("inclination", [0.0, 1e-7, 1e-4, np.pi - 1e-4, np.pi])
def test_the_gyro_toolface_is_known_where_azimuth_is_not(inclination: float) -> None:
    rng, size = np.random.default_rng(9), 2000
    azimuth, toolface = rng.uniform(0.0, 2.0 * np.pi, (2, size))
    gravity, rate = readings(azimuth, np.full(size, inclination), toolface, 0.8)
    gravity = gravity + G_SD * rng.normal(size=gravity.shape)
    rate = rate + SIGMA * rng.normal(size=rate.shape)
    found = estimate_north(gravity, rate[:, :2], 0.8, **_two(NOISE))
    assert all("vertical" in f for f in found.flags)
    if inclination > 1.0:
        return  # upside down it is toolface - azimuth that is defined
    z = wrap_signed(found.gyro_toolface - azimuth - toolface) / found.u("gyro_toolface")
    assert abs(np.mean(z**2) - 1.0) < 2.6 * np.sqrt(2.0 / size) + 0.02


def test_where_down_and_up_cannot_be_told_the_uncertainty_spans_both_azimuths() -> None:
    rng = np.random.default_rng(9)
    turns = rng.uniform(0.0, 2.0 * np.pi, (2, 200))
    gravity, rate = readings(turns[0], rng.uniform(rad(55.0), rad(75.0), 200), turns[1], 0.5)
    # the gyro along the tool, which is to decide, is a thousand times noisier than the others
    noise = {"gravity_covariance": G_SD**2 * np.eye(2), "rate_covariance": SIGMA**2 * np.diag([1.0, 1.0, 1e6])}
    given = {**noise, "scale_sd": 0.0, "g": G}
    open_, down, up = (estimate_north(gravity[:, :2], rate, 0.5, hole=hole, **given) for hole in (None, "down", "up"))
    assert all("ambiguous" in flags for flags in open_.flags)
    apart = angle_errors(down.azimuth, up.azimuth)
    far = apart > 0.5
    assert far.sum() > 100
    assert (down.u("azimuth")[far] < 0.01 * apart[far]).all()
    # of two equally likely azimuths the root mean square from one of them is their distance over the root of two
    share = open_.u("azimuth")[far] / apart[far]
    assert share.min() > 0.3
    assert share.max() < 1.0
    likely = np.abs(down.chi_square - up.chi_square)[far] < 0.1
    np.testing.assert_allclose(share[likely], np.sqrt(0.5), rtol=0.05)


def test_root_is_the_sign_of_k() -> None:
    found = estimate_north(*readings([0.0, np.pi], [rad(80.0)] * 2, 0.0, 0.8), 0.8, **NOISE)
    assert found.root == ("+", "-")
    assert found.k[0] > 0.0 > found.k[1]


@settings(max_examples=100, deadline=None)
@given(
    st.floats(0.0, 2.0 * np.pi),
    st.floats(0.0, np.pi),
    st.floats(0.0, 2.0 * np.pi),
    st.floats(rad(-89.0), rad(89.0)),
    st.sampled_from([0.0, 0.003, np.inf]),
    st.sampled_from([(2, 2), (2, 3), (3, 2), (3, 3)]),
    st.floats(0.0, 5.0),
)
@example(0.0, 0.0, 0.0, 0.0, 0.003, (2, 2), 0.0)
@example(np.pi, np.pi / 4, 0.0, np.pi / 4, np.inf, (2, 2), 0.0)
@example(0.0, np.pi / 2, 0.0, 0.0, np.inf, (2, 3), 0.0)
@example(np.pi / 2, np.pi / 2, 0.0, 0.0, 0.003, (3, 2), 0.0)
def test_never_nan(
    azimuth: float, inclination: float, toolface: float, latitude: float, scale_sd: float, seen: Any, noise: float
) -> None:
    gravity, rate = readings(azimuth, inclination, toolface, latitude)
    rate = rate + noise * SIGMA * np.array([1.0, -0.5, 0.3])
    found = estimate_north(latitude=latitude, scale_sd=scale_sd, latitude_sd=1e-4, **seen_by(gravity, rate, *seen))
    no_nan(found)


FIELD: dict[str, Any] = {
    "gravity": [[-5.0, 0.0, 8.4]], "rate": [[4e-5, -5e-5, 1e-5]], "latitude": 0.8, **NOISE,
}  # fmt: skip
NAN3 = np.full((3, 3), np.nan)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"gravity": [[np.nan, 0.0, 8.4]]}, "input-value"),
        ({"gravity": [[-5.0, 0.0]]}, "input-needs"),
        ({"gravity": [[-9.0, 8.0]], "g": G, "gravity_covariance": np.eye(2)}, "gyro-accel-heavy"),
        ({"gravity": [-5.0, 0.0, 8.4]}, "input-shape"),
        ({"rate": [[np.nan, 1e-5, 1e-5]]}, "input-value"),
        ({"rate": [[1e-5, 1e-5, np.inf]]}, "input-value"),
        ({"rate": [[1e-5, 1e-5, 1e-5]] * 2}, "input-shape"),
        ({"rate": "slow"}, "input-kind"),
        ({"latitude": rad(95.0)}, "input-value"),
        ({"latitude": rad(-90.0)}, "input-value"),
        ({"latitude": np.nan}, "input-value"),
        ({"latitude": [0.8, 0.8]}, "input-shape"),
        ({"latitude_sd": -0.1}, "input-value"),
        ({"latitude_sd": np.nan}, "input-value"),
        ({"scale": 0.0}, "input-value"),
        ({"scale": np.nan}, "input-value"),
        ({"scale": [1.0, 1.0]}, "input-shape"),
        ({"scale_sd": -0.003}, "input-value"),
        ({"scale_sd": np.nan}, "input-value"),
        ({"hole": "sideways"}, "input-choice"),
        ({"rate_covariance": np.zeros((3, 3))}, "input-covariance"),
        ({"rate_covariance": -np.eye(3)}, "input-covariance"),
        ({"rate_covariance": NAN3}, "input-covariance"),
        ({"rate_covariance": SIGMA**2 * np.eye(2)}, "input-shape"),
        ({"rate_covariance": np.eye(4)}, "input-shape"),
        ({"gravity_covariance": -np.eye(3)}, "input-covariance"),
        ({"gravity_covariance": NAN3}, "input-covariance"),
        ({"gravity_covariance": G_SD**2 * np.eye(2)}, "input-shape"),
        ({"gravity_covariance": np.eye(3)[None].repeat(2, 0)}, "input-shape"),
    ],
    ids=lambda v: "-".join(f"{k}" for k in v) if isinstance(v, dict) else v[:20],
)
@pytest.mark.parametrize("estimate", [estimate_north, estimate_north_fixed])
def test_wrong_input_is_refused_with_its_value(estimate: Any, wrong: dict[str, Any], says: str) -> None:
    with refused(says):
        estimate(**{**FIELD, **wrong})

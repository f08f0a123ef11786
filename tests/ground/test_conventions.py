"""Vendor conventions: published formulas written out independently, and the traps other programs fell into."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.conventions import (
    CONVENTIONS,
    Convention,
    axes_matrix,
    axes_names,
    find_mapping,
    named,
)
from inclinometry.orientation import angles, dip_angle, fields
from inclinometry.rotations import wrap_signed

G, B = 9.80665, 50000.0


def attitudes(count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(67616)
    azimuth, toolface = rng.uniform(0.0, 360.0, (2, count))
    inclination = rng.uniform(1.0, 179.0, count)
    return azimuth, inclination, toolface, rng.uniform(-75.0, 75.0, count)


def spe_67616_readings(azimuth: np.ndarray, inclination: np.ndarray, toolface: np.ndarray, dip: np.ndarray):  # type: ignore[no-untyped-def]
    """Sensor equations of SPE 67616 (Williamson 2000), degrees: x 90 deg before the high-side mark y, z down hole."""
    a, i, t, d = np.radians([azimuth, inclination, toolface, dip])
    gx = -G * np.sin(i) * np.sin(t)
    gy = -G * np.sin(i) * np.cos(t)
    gz = G * np.cos(i)
    level, down = B * np.cos(d), B * np.sin(d)
    bx = level * np.cos(a) * np.cos(i) * np.sin(t) - down * np.sin(i) * np.sin(t) + level * np.sin(a) * np.cos(t)
    by = level * np.cos(a) * np.cos(i) * np.cos(t) - down * np.sin(i) * np.cos(t) - level * np.sin(a) * np.sin(t)
    bz = level * np.cos(a) * np.sin(i) + down * np.cos(i)
    return (gx, gy, gz), (bx, by, bz)


def spe_67616_angles(g, b) -> tuple[np.ndarray, ...]:  # type: ignore[no-untyped-def]
    """Angle equations of SPE 67616, degrees, with two-argument arctangents."""
    gx, gy, gz = g
    bx, by, bz = b
    total = np.sqrt(gx**2 + gy**2 + gz**2)
    inclination = np.arctan2(np.sqrt(gx**2 + gy**2), gz)
    azimuth = np.arctan2((gx * by - gy * bx) * total, bz * (gx**2 + gy**2) - gz * (gx * bx + gy * by))
    return tuple(np.degrees([inclination, azimuth, np.arctan2(-gx, -gy)]))


def vendor_readings(name: str, g, b) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[no-untyped-def]
    """The same field as each vendor would report it, from the ISCWSA components, by hand."""
    (gx, gy, gz), (bx, by, bz) = g, b
    # index mark m is y of SPE 67616, n (90 deg clockwise looking down) is -x
    table = {
        "iscwsa": ((gx, gy, gz), (bx, by, bz)),
        "specific-force": ((-gy, gx, -gz), (by, -bx, bz)),
        "native": ((gy, -gx, gz), (by, -bx, bz)),
        "z-up": ((-gy, -gx, gz), (by, bx, -bz)),
    }
    accelerometer, magnetometer = table[name]
    return np.stack(accelerometer, axis=-1), np.stack(magnetometer, axis=-1)


def in_tool_axes(convention: Convention, g: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return g @ convention.matrix("accelerometer").T, b @ convention.matrix("magnetometer").T


@pytest.mark.parametrize("name", ["iscwsa", "specific-force", "native", "z-up"])
def test_four_conventions_on_5000_attitudes(name: str) -> None:
    azimuth, inclination, toolface, dip = attitudes(5000)
    readings = spe_67616_readings(azimuth, inclination, toolface, dip)
    published = spe_67616_angles(*readings)
    g, b = vendor_readings(name, *readings)
    found = angles(*in_tool_axes(named(name), g, b))
    # both start from the same readings and round to a few 1e-16 rad; 5e-14 deg is the most seen
    for mine, theirs in zip((found.inclination, found.azimuth, found.toolface), published, strict=True):
        assert np.abs(np.degrees(wrap_signed(mine - np.radians(theirs)))).max() < 1e-13
    assert np.median(np.abs(np.degrees(wrap_signed(found.azimuth - np.radians(azimuth))))) < 1e-13


def test_lookup() -> None:
    assert [convention.name for convention in CONVENTIONS] == ["native", "iscwsa", "specific-force", "z-up"]
    assert named(" Native ").name == "native"
    with refused("input-choice", name="convention"):
        named("nasa")


def test_axes_in_words() -> None:
    for convention in CONVENTIONS:
        for axes in (convention.accelerometer, convention.magnetometer):
            assert axes_names(axes_matrix(axes)) == axes
            # every vendor's triads are right-handed
            assert np.linalg.det(axes_matrix(axes)) == 1.0
    assert named("z-up").gyro == named("z-up").magnetometer
    for bad in (("+x", "+x", "+z"), ("x", "y", "up"), ("*x", "y", "z"), ("", "y", "z")):
        with refused("sensor-axes"):
            Convention("bad", bad)
    with refused("input-choice", name="kind"):
        named("native").matrix("compass")
    with refused("input-finite", name="gyro_toolface_offset"):
        Convention("bad", gyro_toolface_offset=float("nan"))


def test_toolface_offset_per_triad() -> None:
    g, b = fields(1.0, 0.5, 2.0, 1.1)
    both = Convention("turned", accelerometer_toolface_offset=0.3, magnetometer_toolface_offset=0.3)
    found = angles(*in_tool_axes(both, g, b))
    assert found.toolface == pytest.approx(2.3, abs=1e-14)
    assert found.azimuth == pytest.approx(1.0, abs=1e-14)
    # a magnetometer whose mark is 0.2 rad before the accelerometer's
    from inclinometry.rotations import rotation_z

    one = Convention("one", magnetometer_toolface_offset=0.2)
    found = angles(*in_tool_axes(one, g, rotation_z(-0.2) @ b))
    assert found.azimuth == pytest.approx(1.0, abs=1e-14)
    assert found.toolface == pytest.approx(2.0, abs=1e-14)


def test_swapped_xy_of_the_magnetometer_is_caught_by_the_dip() -> None:
    g, b = fields(*np.radians([45.0, 45.0, 75.0, 68.0]))
    swapped = b[[1, 0, 2]]
    assert np.degrees(angles(g, swapped).azimuth) == pytest.approx(344.0, abs=0.5)
    assert np.degrees(dip_angle(g, swapped)) == pytest.approx(15.0, abs=0.6)


def random_positions(count: int, seed: int, dip: float = 1.187) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    azimuth, toolface = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    return fields(azimuth, np.arccos(rng.uniform(-1.0, 1.0, count)), toolface, dip)


@pytest.mark.parametrize("seed", range(5))
def test_four_positions_find_the_mapping(seed: int) -> None:
    g, b = random_positions(4, seed)
    for axes in (("+y", "-x", "+z"), ("+y", "+x", "+z"), ("-z", "+y", "-x"), ("+x", "+y", "+z")):
        matrix = axes_matrix(axes)
        channels = b @ matrix  # the inverse of a permutation is its transpose
        found, _, _ = find_mapping(9.8 * g, 5e4 * channels, dip=1.187)
        assert found[0].axes == axes
        assert found[0].scatter < 1e-14
        assert found[0].dip == pytest.approx(1.187, abs=1e-14)
        assert len({mapping.axes for mapping in found}) == 48
        assert (np.diff([mapping.scatter for mapping in found]) > -1e-12).all()
        # without the site's dip the sign stays open, and this is said
        unsigned, _, explanation = find_mapping(g, channels)
        assert axes in (unsigned[0].axes, unsigned[1].axes)
        assert unsigned[0].right_handed
        assert explanation.code == "sensor-mapping"


def test_mapping_with_noise_and_wrong_dip() -> None:
    g, b = random_positions(8, 11)
    noise = np.random.default_rng(12).normal(0.0, 2e-3, b.shape)
    found, ambiguous, _ = find_mapping(g, b + noise, dip=1.187)
    assert found[0].axes == ("+x", "+y", "+z")
    assert not ambiguous
    assert find_mapping(g, b + noise, dip=0.9)[2].code == "sensor-mapping-dip"


def test_mapping_ambiguities_are_said() -> None:
    # rolling about a vertical axis: z is told from x and y, but not x from y
    g, b = fields(0.3, 0.0, np.arange(4.0), 1.187)
    _, ambiguous, explanation = find_mapping(g, b)
    assert ambiguous
    assert explanation.code == "sensor-mapping-alike"
    _, ambiguous, explanation = find_mapping(random_positions(6, 3)[0], random_positions(6, 4)[1])
    assert ambiguous
    assert explanation.code == "sensor-mapping-none"


def test_mapping_needs_four_positions() -> None:
    g, b = random_positions(3, 1)
    with refused("input-shape", name="accelerometer, magnetometer"):
        find_mapping(g, b)

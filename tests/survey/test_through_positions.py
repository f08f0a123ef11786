"""Inclination and azimuth from positions alone."""

import numpy as np
import pytest

from inclinometry.survey.path import directions, minimum_curvature, through_positions

RADIAN = np.pi / 180.0


def hole(course=30.0, noise=0.0):
    """Vertical, a build with a turn, a tangent."""
    md = np.arange(0.0, 3000.1, course)
    draw = np.random.default_rng(1).standard_normal((2, len(md))) * noise
    inclination = np.abs(np.interp(md, [0, 600, 1500, 3000], [0, 0, 60, 60]) + draw[0])
    azimuth = 75.0 + np.interp(md, [0, 1500, 3000], [0, 0, 30]) + draw[1]
    path = minimum_curvature(md, inclination * RADIAN, azimuth * RADIAN)
    return path, np.stack([path.north, path.east, path.tvd], axis=1)


def off(path, inclination, azimuth):
    """Angle between the directions of a path and others, deg."""
    apart = directions(inclination, azimuth) - directions(path.inclination, path.azimuth)
    return np.linalg.norm(apart, axis=1) / RADIAN


def test_one_arc_is_met_to_a_hundredth_of_a_degree():
    md = np.linspace(0.0, 500.0 * np.pi, 20)
    path = minimum_curvature(md, md / 1000.0, np.full(20, 1.0))
    length, *angles = through_positions(np.stack([path.north, path.east, path.tvd], axis=1), 1e-4)
    np.testing.assert_allclose(length, np.diff(md), rtol=1e-6)
    assert off(path, *angles).max() < 0.005


@pytest.mark.parametrize(
    ("resolution", "noise", "rms", "most"),
    [(1e-4, 0.0, 0.003, 0.005), (1e-3, 0.0, 0.02, 0.04), (0.01, 0.0, 0.05, 0.12), (0.01, 0.2, 0.1, 0.2),
     (0.1, 0.2, 0.22, 0.5)],
)  # fmt: skip
def test_rounded_positions_of_a_well(resolution, noise, rms, most):
    """From one direction to the next alone, positions in cm give 0.15 to 0.2 deg, in dm 2.4 to 3.2 deg rms."""
    path, points = hole(noise=noise)
    length, *angles = through_positions(np.round(points / resolution) * resolution, resolution)
    found = off(path, *angles)
    assert np.sqrt(np.mean(found**2)) < rms
    assert found.max() < most
    assert length.sum() == pytest.approx(3000.0, abs=0.05)


def test_beside_wellpathpy():
    """Its directions follow one from the other, beginning straight down."""
    peer = pytest.importorskip("wellpathpy")
    path, points = hole()
    for resolution, factor in ((1e-9, None), (0.01, 2.0)):
        given = np.round(points / resolution) * resolution
        stations = peer.deviation(path.md, path.inclination / RADIAN, path.azimuth / RADIAN)
        log = type(stations.minimum_curvature())(stations, given[:, 2], given[:, 0], given[:, 1], None).deviation()
        _, *angles = through_positions(given, max(resolution, 1e-4))
        own, theirs = off(path, *angles), off(path, log.inc * RADIAN, log.azi * RADIAN)
        assert theirs.max() < 1e-3 if factor is None else np.mean(own**2) * factor**2 < np.mean(theirs**2)
        assert own.max() < (0.005 if factor is None else 0.12)

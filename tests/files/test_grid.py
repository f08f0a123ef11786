"""Grid convergence: sign, closed forms, and a second way through the coordinates themselves."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.files.site_toml import grid_convergence, map_grid, out_of_area


@pytest.mark.parametrize(("latitude", "longitude", "sign"), [(60, 10, 1), (60, 8, -1), (-60, 10, -1), (-60, 8, 1)])
def test_utm_against_the_formula(latitude, longitude, sign):
    crs = "EPSG:32632" if latitude > 0 else "EPSG:32732"
    found = grid_convergence(crs, *np.radians([latitude, longitude]))
    # north of the equator and east of the central meridian true north leans west on the map: grid north is east of it
    assert np.sign(found.convergence) == sign
    phi, d = np.radians([latitude, longitude - 9.0])
    wanted = np.arctan(np.tan(d) * np.sin(phi))
    # on the ellipsoid a term d^3 sin cos^2 e'^2 more: 1e-7 rad one degree from the meridian
    np.testing.assert_allclose(found.convergence, wanted, atol=1e-8)
    # scale 0.9996 (1 + x^2 / 2 R^2), x = d R cos(latitude)
    np.testing.assert_allclose(found.scale, 0.9996 * (1.0 + (d * np.cos(phi)) ** 2 / 2.0), atol=1e-6)


@pytest.mark.parametrize(
    ("crs", "latitude", "longitude"),
    [
        ("EPSG:32632", 62.3, 11.9),
        ("EPSG:27700", 52.0, 1.0),  # another datum, same grid north
        ("EPSG:3995", 80.0, 15.0),
        ("EPSG:5041", 86.0, -100.0),
        ("EPSG:2154", 44.0, 5.0),
        ("EPSG:26906", 61.25, -150.0),
        ("EPSG:3857", 50.0, 15.0),
    ],
)
def test_a_step_to_true_north_on_the_map(crs, latitude, longitude):
    from pyproj import Proj

    # the bearing on the map of a step of 2e-4 deg along the meridian is minus the convergence
    here, there = (Proj(crs)(longitude, latitude + step) for step in (-1e-4, 1e-4))
    east, north = np.subtract(there, here)
    found = grid_convergence(crs, *np.radians([latitude, longitude]))
    # millimetres of rounding over 22 m are far below; PROJ differentiates numerically to some 1e-7
    np.testing.assert_allclose(found.convergence, -np.arctan2(east, north), atol=1e-6)


def test_shapes_and_longitudes_from_zero():
    latitude = np.radians([[10.0], [20.0]])
    found = grid_convergence("EPSG:32601", latitude, np.radians([-179.0, -178.0, 181.0]))
    assert found.convergence.shape == found.scale.shape == (2, 3)
    np.testing.assert_allclose(found.convergence[:, 0], found.convergence[:, 2], atol=1e-12)


@pytest.mark.parametrize(
    ("crs", "message"),
    [
        ("EPSG:1", "record-grid-unknown"),
        ("UTM 32", "record-grid-unknown"),
        ("", "record-grid-unknown"),
        ("EPSG:4326", "record-grid-unknown"),
        ("EPSG:4978", "record-grid-unknown"),
    ],
)
def test_names_that_are_no_map_grid(crs, message):
    with refused(message):
        map_grid(crs)


def test_a_point_the_grid_cannot_show():
    with refused("record-grid-point"):
        grid_convergence("EPSG:3857", -np.pi / 2, np.radians(10.0))
    with refused("input-value", name="latitude"):
        grid_convergence("EPSG:32632", 60.0, 10.0)


def test_outside_the_area():
    assert out_of_area("EPSG:32632", *np.radians([60.0, 9.0])) is None
    outside = out_of_area("EPSG:32632", *np.radians([60.0, -9.0]))
    assert outside.code == "record-grid-outside"
    assert (outside.values["north_deg"], outside.values["east_deg"]) == (84.0, 12.0)
    # EPSG:3832 reaches over the 180th meridian
    assert out_of_area("EPSG:3832", *np.radians([0.0, 179.0])) is None
    assert out_of_area("EPSG:3832", *np.radians([0.0, -170.0])) is None
    assert out_of_area("+proj=utm +zone=32", *np.radians([0.0, 100.0])) is None

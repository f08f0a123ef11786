"""Misalignment and g-sensitivity: what index positions leave of them, by the full model and by what a run says."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.gyro.axes import AxisPrior, Linearised
from inclinometry.gyro.indexing import SCHEMES, average_index
from inclinometry.gyro.joint import earth_in_tool, solve_joint
from inclinometry.gyro.north import to_high_side
from inclinometry.gyro.point_mass import Rates
from inclinometry.rotations import rotation_z, wrap_signed

rad = np.radians


@pytest.mark.parametrize(("scheme", "gyros"), [("four", 2), ("four", 3), ("two", 2), ("two", 3), ("four", 1)])
def test_what_index_positions_leave_is_these_constants(scheme: str, gyros: int) -> None:
    rng, size = np.random.default_rng(5), 7
    axes, pull = 1e-3 * rng.normal(size=(2, 3, 3))
    azimuth, inclination, toolface = rng.uniform(0.0, 3.0, (3, size))
    earth, down = (
        earth_in_tool(azimuth, inclination, rad(44.0)),
        np.stack([-np.sin(inclination), 0.0 * inclination, np.cos(inclination)], axis=1),
    )
    index = np.tile(rad(SCHEMES[scheme].positions_deg), size)
    station = np.repeat(np.arange(size), len(index) // size)
    turn = rotation_z(index) @ rotation_z(toolface)[station]
    rate, gravity = (np.einsum("kij,kj->ki", turn, field[station]) for field in (earth, down))
    signals = (rate + rate @ axes.T + gravity @ pull.T)[:, :gyros]
    found = average_index(station, index, signals, scheme=scheme, noise=np.full(gyros, 1e-3)).field
    high, _ = to_high_side(found, np.zeros((size, 3, 3)), toolface)
    sizes = np.ones((7 if scheme == "two" else 3) + 3 * (gyros == 3))
    prior = AxisPrior(sizes, sizes, scheme == "two")
    (xx, xy, _), (yx, yy, _), (*_, zz) = axes if gyros > 1 else (axes[0], (-axes[0, 1], axes[0, 0], 0.0), axes[2])
    (gxx, gxy, _), (gyx, gyy, _), (*_, gzz) = pull if gyros > 1 else (pull[0], (-pull[0, 1], pull[0, 0], 0.0), pull[2])
    constants = [xy - yx, gxx + gyy, gxy - gyx]
    constants += [xx - yy, xy + yx, gxx - gyy, gxy + gyx] if scheme == "two" else []
    constants = [*(0.5 * one for one in constants), *((zz - (xx + yy) / 2.0, gzz, 0.0) if gyros == 3 else ())]
    scale = 1.0 + 0.5 * (xx + yy)
    expected = scale * earth + prior.effects(earth, inclination, toolface) @ constants
    seen = slice(0, 3 if gyros == 3 else 2)
    assert high[:, seen] == pytest.approx(expected[:, seen], abs=1e-13)


def test_derivatives_are_differences() -> None:
    rng, size, latitude = np.random.default_rng(2), 9, rad(44.0)
    azimuth, inclination, toolface = rng.uniform(0.2, 1.2, (3, size))
    prior = AxisPrior(np.ones(10), np.ones(10), pairs=True)
    earth, sd = earth_in_tool(azimuth, inclination, latitude), 0.02
    noise = 1e-3**2 * np.tile(np.eye(3), (size, 1, 1))
    at = Linearised.of(Rates(earth, noise, inclination, latitude), prior, toolface, azimuth, np.ones(size))
    by_k = at.each_alone(np.full(size, sd))
    by_azimuth = at.by_azimuth(by_k)
    for place, off in enumerate(np.eye(len(prior.wide)) * 1e-6):
        # what is not in the model comes out in azimuth and k with the other sign: taken off, it would be right
        moved = solve_joint(earth + at.effects @ off, noise, inclination, latitude, scale=1.0, scale_sd=sd)
        assert wrap_signed(moved.azimuth - azimuth) == pytest.approx(-1e-6 * by_azimuth[:, place], rel=1e-3, abs=1e-10)
        assert moved.k - 1.0 == pytest.approx(-1e-6 * by_k[:, place], rel=1e-3, abs=1e-10)

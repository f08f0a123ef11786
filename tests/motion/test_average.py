"""Windows averaged: what is common stays, what is a window's own falls with the root of their number."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from inclinometry.motion.average import average_windows
from inclinometry.motion.result import AttitudeRows

DEG = np.pi / 180.0


def rows(
    inclination: np.ndarray, azimuth: np.ndarray | None = None, *, common: float = 0.2, random: float = 0.02
) -> AttitudeRows:
    """Windows of these directions, deg; uncertainties in deg."""
    size = len(inclination)
    one, small = np.ones(size), np.zeros(size, dtype=np.uint8)
    u, shared = np.hypot(common, random) * DEG * one, common * DEG * one
    azimuth = 60.0 * one if azimuth is None else azimuth
    return AttitudeRows(
        10.0 * np.arange(size), inclination * DEG, azimuth * DEG, one, u, u, u, one, one,
        np.zeros(size, dtype=np.uint32), small, small, np.zeros((size, 4)), one, one, shared, shared, shared,
    )  # fmt: skip


def test_the_mean_is_no_better_than_what_its_windows_share() -> None:
    """Not 0.2 / 10, as for 100 windows thought independent."""
    noise = np.random.default_rng(1).normal(0.0, 0.02, (2, 100))
    found = average_windows(rows(30.0 + noise[0], 60.0 + noise[1]))
    assert found.windows.tolist() == [100]
    np.testing.assert_allclose(np.degrees(found.u_inclination), np.hypot(0.2, 0.002), rtol=1e-3)
    np.testing.assert_allclose(found.u_common_azimuth, 0.2 * DEG)
    assert np.degrees(found.inclination[0]) == pytest.approx(30.0 + noise[0].mean())


@pytest.mark.long
def test_the_stated_uncertainty_of_means_is_honest() -> None:
    """400 runs of 20 windows, one common draw each: mean square of error over u 1 +-0.15."""
    random = np.random.default_rng(2)
    squares = []
    for _ in range(400):
        shared = random.normal(0.0, 0.05)
        found = average_windows(rows(30.0 + shared + random.normal(0.0, 0.1, 20), common=0.05, random=0.1))
        squares.append(((np.degrees(found.inclination[0]) - 30.0) / np.degrees(found.u_inclination[0])) ** 2)
    assert 0.85 < np.mean(squares) < 1.15


def test_a_bend_of_the_hole_begins_a_new_stretch() -> None:
    found = average_windows(rows(np.repeat([30.0, 30.5, 30.5, 31.0], 5)))
    assert found.windows.tolist() == [5, 10, 5]
    np.testing.assert_allclose(np.degrees(found.inclination), [30.0, 30.5, 31.0])
    assert found.start.tolist() == [0.0, 50.0, 150.0]


def test_windows_that_scatter_more_than_they_say_are_not_believed() -> None:
    found = average_windows(rows(30.0 + 0.02 * (-1.0) ** np.arange(10), common=0.0, random=0.001))
    assert found.windows.tolist() == [10]
    assert np.degrees(found.u_inclination[0]) == pytest.approx(0.02 / 3.0, rel=1e-6)


def test_azimuths_about_north_and_windows_without_one() -> None:
    azimuth = np.array([359.99, 0.01, 0.0, np.nan])
    found = average_windows(rows(np.full(4, 30.0), azimuth))
    assert found.windows.tolist() == [4]
    assert min(np.degrees(found.azimuth[0]), 360.0 - np.degrees(found.azimuth[0])) < 1e-6
    blank = rows(np.full(3, np.nan), np.full(3, np.nan))
    assert len(average_windows(blank)) == 0


def test_windows_without_azimuth_say_nothing_of_those_that_have_one() -> None:
    """Wherever they stand: first in a stretch, they took the azimuth of all, and no bend was seen."""
    nan = np.nan
    found = average_windows(rows(30.0 * np.ones(6), np.array([nan, 60.0, 60.02, nan, 61.0, 61.0])))
    assert found.windows.tolist() == [4, 2]
    np.testing.assert_allclose(np.degrees(found.azimuth), [60.01, 61.0])


def test_another_north_is_another_stretch() -> None:
    two = replace(rows(np.full(4, 30.0)), north=np.array([0, 0, 1, 1], dtype=np.uint8))
    assert average_windows(two).windows.tolist() == [2, 2]
    with pytest.raises(TypeError, match="average_windows takes"):
        average_windows([1.0])  # type: ignore[arg-type]


def test_parts_that_are_not_told_apart_are_all_common() -> None:
    plain = rows(np.full(2, 30.0))
    names = {each.name: getattr(plain, each.name) for each in fields(plain) if not each.name.startswith("u_common")}
    assert (AttitudeRows(**names).u_random_azimuth == 0.0).all()


def test_the_work_grows_with_the_rows_and_not_with_their_square(monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns that are worked out of others are asked for as often in a long run as in a short one."""
    asked = []
    plain = AttitudeRows._own
    monkeypatch.setattr(AttitudeRows, "_own", lambda self, name: (asked.append(len(self)), plain(self, name))[1])
    for size in (500, 2000):
        average_windows(rows(np.repeat([30.0, 31.0], size // 2)))
    assert 0 < sum(n for n in asked if n == 2000) <= 4 * sum(n for n in asked if n == 500)

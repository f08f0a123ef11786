"""The common result: its uncertainties against finite differences, its refusals, its joining."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.motion.result import BITS, METHODS, Attitude, Samples, angle_rows, joined, refusals
from inclinometry.rotations import dcm, quaternion_from_dcm, rotation_exp

ATTITUDES = np.radians([[60.0, 30.0, 100.0], [350.0, 1.0, 5.0], [10.0, 120.0, 200.0], [200.0, 89.0, 300.0]])


def one(time: float, azimuth: float = 1.0, sigma: float = 1e-3, north: str = "magnetic") -> Attitude:
    """A single good row."""
    return Attitude(
        time=np.array([time]),
        quaternion=quaternion_from_dcm(dcm(azimuth, 0.5, 2.0))[None],
        covariance=np.eye(3)[None] * sigma**2,
        rate=np.zeros(1),
        quality=np.ones(1),
        flags=np.zeros(1, dtype=np.uint32),
        method=np.full(1, METHODS.index("static"), dtype=np.uint8),
        north=north,
    )


@pytest.mark.parametrize("settings", ATTITUDES)
def test_rows_are_the_slopes_of_the_angles(settings: np.ndarray) -> None:
    """(1 + [e x]) C turned into angles, central differences; 1e-6 rad steps leave 1e-9 of rounding / sin I."""
    azimuth, inclination, toolface = settings
    matrix = dcm(azimuth, inclination, toolface)

    def found(e: np.ndarray) -> np.ndarray:
        row = one(0.0)
        turned = Attitude(**{**row.__dict__, "quaternion": quaternion_from_dcm(rotation_exp(e) @ matrix)[None]})
        return np.array([column[0] for column in turned.angles])

    slopes = np.stack([(found(e) - found(-e)) / 2e-6 for e in 1e-6 * np.eye(3)], axis=1)
    rows = angle_rows(quaternion_from_dcm(matrix)[None])[0]
    np.testing.assert_allclose(rows, slopes, atol=1e-7 / np.sin(inclination))


def test_angles_are_those_the_quaternion_was_made_from() -> None:
    """Round trip of the conventions."""
    row = one(0.0, azimuth=1.25)
    assert [row.angles.azimuth[0], row.angles.inclination[0], row.angles.toolface[0]] == pytest.approx([1.25, 0.5, 2.0])


def test_a_vertical_tool_has_an_uncertain_azimuth_and_a_certain_sum() -> None:
    """Capped, not infinite or NaN."""
    row = Attitude(**{**one(0.0).__dict__, "quaternion": quaternion_from_dcm(dcm(0.3, 0.0, 0.4))[None]})
    assert row.u.azimuth[0] == pytest.approx(np.pi / np.sqrt(3.0))
    assert row.u.magnetic_toolface[0] == pytest.approx(1e-3)


def test_refused_rows_have_no_angles_and_say_why() -> None:
    """NaN angles and uncertainties, names of the flags."""
    rows = joined([one(0.0), refusals([1.0], ["clipped", "aliased"], "magnetic", "magnetic"), one(2.0)])
    assert rows.refused.tolist() == [False, True, False]
    assert np.isnan(rows.angles.azimuth[1])
    assert np.isnan(rows.u.inclination[1])
    assert rows.names(1) == ("clipped", "aliased")
    assert rows.flags[1] == BITS["clipped"] | BITS["aliased"]


def test_joining_refuses_disorder_and_two_norths() -> None:
    """Rows must be in order and count from one north."""
    with refused("input-order"):
        joined([one(1.0), one(0.0)])
    with refused("input-north", norths=("magnetic", "true")):
        joined([one(0.0), one(1.0, north="true")])
    with refused("input-few", name="results", count=0):
        joined([])


def test_samples_must_be_even_finite_and_of_one_length() -> None:
    """The gate of the room."""
    time = np.arange(10) * 0.01
    field = np.ones((10, 3))
    assert Samples(time + 0.004 * np.sin(np.arange(10)), 0.01, mag=field).has("mag")
    with refused("input-uneven"):
        Samples(np.delete(np.append(time, 0.1), 4), 0.01, mag=field)
    with refused("input-shape", name="gyro"):
        Samples(time, 0.01, gyro=field[:5])
    with refused("input-finite", name="accel[0, 0]"):
        Samples(time, 0.01, accel=np.where(np.eye(10, 3), np.nan, field))
    with refused("input-triads", needed=("accel", "mag", "gyro")):
        Samples(time, 0.01)
    with refused("input-value", name="interval"):
        Samples(time, 0.0, accel=field)


def test_a_part_of_an_even_stretch_is_even_however_its_first_stamp_jitters() -> None:
    """Stamps 0.45 of an interval late and early by turns, cut behind a late one."""
    time = 0.01 * np.arange(10) + 0.0045 * np.where(np.arange(10) % 2, 1.0, -1.0)
    time[0] = 0.0
    whole = Samples(time, 0.01, mag=np.ones((10, 3)))
    part = whole.part(3, 9)
    assert len(part) == 6
    assert part.mag is not None
    assert part.mag.base is not None

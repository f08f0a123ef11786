"""In-run against out-run: limits at their edges, depths, the circle."""

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.survey.flags import OFF
from inclinometry.survey.gyro import RepeatLimits, compare_runs
from inclinometry.survey.run import Run

LIMITS = RepeatLimits("test", "test", np.radians(0.23), np.radians(1.0), np.radians(5.0), np.radians(10.0), 10, 35.0)


def run(inclination=30.0, azimuth=100.0, md=None, count=12, north="true"):
    md = 30.0 * np.arange(count) if md is None else np.asarray(md, float)
    spread = [np.radians(np.broadcast_to(np.asarray(v, float), md.shape)) for v in (inclination, azimuth)]
    return Run(md, *spread, azimuth_reference=north)


HAIR = 1e-6
"""deg; two runs that agree, but are two."""


def compared(one, two):
    return compare_runs(one, two, LIMITS)


def by_name(found):
    return {c.name: c.verdict for c in found.checks}


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("inclination", "off_inclination", "off_azimuth", "verdict"),
    [
        (30.0, 0.23, 0.0, "pass"),
        (30.0, 0.2301, 0.0, "fail"),
        (30.0, 0.0, 1.0, "pass"),
        (30.0, 0.0, 1.0001, "fail"),
        (10.0, 0.0, 1.0, "pass"),
        (10.0, 0.0, 1.0001, "fail"),
        (9.9999, 0.0, 5.0, "pass"),
        (9.9999, 0.0, 5.0001, "fail"),
        (175.0, 0.0, 4.9, "pass"),
    ],
)
def test_limits_at_their_edges(sign, inclination, off_inclination, off_azimuth, verdict):
    found = compared(run(inclination), run(inclination + sign * off_inclination, 100.0 + sign * (off_azimuth or HAIR)))
    assert found.verdict == verdict
    assert set(found.verdicts) == {verdict}
    np.testing.assert_allclose(found.inclination, np.radians(sign * off_inclination), atol=1e-12)
    failing = [c for c in found.checks if c.verdict == "fail"]
    assert all(c.reason.values["advice"] == OFF["gyro"] and c.stations == tuple(range(12)) for c in failing)


@pytest.mark.parametrize(("count", "verdict"), [(9, "fail"), (10, "pass")])
def test_ten_stations_are_needed(count, verdict):
    found = compared(run(count=count), run(azimuth=100.0 + HAIR, count=count))
    assert found.verdict == by_name(found)["common stations"] == verdict
    assert by_name(found)["inclination"] == ("pass" if count == 10 else "not judged")
    assert set(found.verdicts) == {"pass" if count == 10 else "not judged"}


def test_azimuth_across_north_takes_the_short_way():
    found = compared(run(azimuth=359.8), run(azimuth=0.3))
    assert found.verdict == "pass"
    np.testing.assert_allclose(np.degrees(found.azimuth), 0.5, atol=1e-9)
    # interpolated halfway between 359 and 1: north, not south
    wave = np.where(np.arange(13) % 2 == 0, 359.0, 1.0)
    found = compared(run(azimuth=HAIR, md=15.0 + 30.0 * np.arange(12)), run(azimuth=wave, count=13))
    np.testing.assert_allclose(np.degrees(found.azimuth), -HAIR, atol=1e-9)


def test_interpolation_is_linear_inside_and_said():
    one = run(20.5, 100.5 + HAIR, md=15.0 + 30.0 * np.arange(12))
    two = run(20.0 + np.arange(13) * 0.0 + np.arange(13) % 2, 100.0 + np.arange(13) % 2, count=13)
    found = compared(one, two)
    np.testing.assert_allclose(np.degrees([found.inclination, found.azimuth]), 0.0, atol=1.1 * HAIR)
    assert found.interpolated.all()
    assert "Out-run interpolated" in [one.values.get("what") for one in found.findings]
    assert not compared(two, run(20.0, 100.0, count=13)).interpolated.any()


def test_nothing_is_extrapolated_nor_carried_over_gaps():
    one = run(count=20)
    found = compared(one, run(azimuth=100.0 + HAIR, md=one.md[3:17]))
    assert found.rows.tolist() == list(range(3, 17))
    kept = np.delete(one.md, [5, 6])
    found = compared(one, run(azimuth=100.0 + HAIR, md=kept))
    assert found.rows.tolist() == [*range(5), *range(7, 20)]
    assert [one.values["count"] for one in found.findings if one.values.get("what") == "No out-run"] == [2]
    apart = compared(one, run(md=one.md + 1e5))
    assert (apart.verdict, len(apart.md)) == ("fail", 0)
    assert np.isnan(apart.statistics["inclination"].mean)
    for size in (0, 1):
        assert len(compared(one, run(count=size)).md) == size
        assert len(compared(run(count=size), one).md) == size


def test_only_the_bad_station_is_named():
    azimuth = np.full(12, 100.0)
    azimuth[4] = 102.0
    found = compared(run(), run(azimuth=azimuth))
    check = next(c for c in found.checks if c.name.endswith("up"))
    assert (check.verdict, check.stations) == ("fail", (4,))
    assert found.verdicts.count("fail") == 1
    assert check.reason.values["advice"] == OFF["gyro few"]


def test_statistics_against_a_plain_sum():
    random = np.random.default_rng(1)
    off = random.normal(0.05, 0.02, 40)
    part = compared(run(count=40), run(30.0 + off, 100.0 + HAIR, count=40)).statistics["inclination"]
    np.testing.assert_allclose(
        np.degrees([part.mean, part.sd, part.rms, part.largest]),
        [off.mean(), off.std(ddof=1), np.sqrt((off**2).mean()), np.abs(off).max()],
        rtol=1e-9,
    )
    assert part.systematic
    even = np.tile([0.05, -0.05], 20)
    assert not compared(run(count=40), run(30.0 + even, 100.0 + HAIR, count=40)).statistics["inclination"].systematic


def test_runs_change_places_with_the_sign():
    one, two = run(30.0, 100.0), run(30.1, 99.7)
    np.testing.assert_allclose(compared(one, two).azimuth, -compared(two, one).azimuth, atol=1e-12)


def test_unknown_azimuth_is_not_judged():
    found = compared(run(2.0, np.nan), run(2.0 + HAIR, 50.0))
    assert found.verdict == "not judged"
    assert by_name(found)["inclination"] == "pass"
    some = np.where(np.arange(12) < 3, np.nan, 100.0 + HAIR)
    found = compared(run(), run(azimuth=some))
    assert found.verdict == "pass"
    assert found.statistics["azimuth"].stations == 9


def test_what_cannot_be_compared_is_refused():
    with refused("input-north"):
        compared(run(), run(north="grid"))
    with refused("input-order", name="out-run.md"):
        compared(run(), run(md=[10.0, 10.0]))
    with refused("input-value", name="in-run.inclination[0]"):
        compared(run(-1.0), run())


@pytest.mark.parametrize("north", ["true", "grid"])
def test_one_run_given_twice_is_refused(north):
    azimuth = 360.0 * np.random.default_rng(1).random(12)
    one = run(azimuth=azimuth, north=north)
    with refused("survey-runs-same"):
        compared(one, one)
    # a part of it, other inclinations, a full turn more, what conversion to another north and back leaves
    for copy in (
        run(azimuth=azimuth[2:8], md=one.md[2:8], north=north),
        run(30.1, azimuth + 360.0 + 1e-10, north=north),
    ):
        with refused("survey-runs-same"):
            compared(one, copy)
    with refused("survey-runs-same"):
        compared(run(1.0, np.nan), run(1.0, np.nan))
    # one station that differs makes it another run, and two alike may be chance
    other = azimuth.copy()
    other[5] += 0.01
    assert compared(one, run(azimuth=other, north=north)).verdict == "pass"
    assert len(compared(run(count=2), run(count=2)).md) == 2

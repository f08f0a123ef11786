"""The robust filter and the smoother of windows: what they follow, what they reject, what they say of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.refusals import refused

from inclinometry.motion._hole_direction import observe, offset_of, rolled, turned
from inclinometry.motion.result import BITS, METHODS, Attitude, joined
from inclinometry.motion.window_filter import RobustStream, WindowFilterSettings, robust_filter
from inclinometry.motion.window_smoother import smooth_windows
from inclinometry.rotations import dcm, dcm_from_quaternion, quaternion_from_dcm, rotation_exp, rotation_log

TILT, TURN = float(np.radians(0.03)), float(np.radians(0.06))
DEFAULT = WindowFilterSettings()
PLAIN = replace(DEFAULT, igg3=None, adaptive_three=None, forgetting=None)


def part(rows: Attitude, which: slice) -> Attitude:
    """Some rows."""
    names = ("time", "quaternion", "covariance", "common", "rate", "quality", "flags", "method")
    return replace(rows, **{name: getattr(rows, name)[which] for name in names})


def same(first: Attitude, second: Attitude) -> bool:
    """To the last bit."""
    names = ("time", "quaternion", "covariance", "rate", "quality", "flags", "method")
    return all(np.array_equal(getattr(first, n), getattr(second, n), equal_nan=True) for n in names)


def run(
    seed: int,
    *,
    size: int = 120,
    inclination: float | np.ndarray = 0.5,
    azimuth: float | np.ndarray = 1.0,
    scale: float | np.ndarray = 1.0,
    rolling: bool = True,
) -> tuple[Attitude, np.ndarray]:
    """Windows of 10 s of a given hole: stated covariance in the level frame, errors `scale` times as large."""
    random = np.random.default_rng(seed)
    toolface = random.uniform(0.0, 6.28, size) if rolling else np.full(size, 2.0)
    truth = dcm(np.broadcast_to(azimuth, size), np.broadcast_to(inclination, size), toolface)
    level = np.array([[TILT**2, 0, 0], [0, TILT**2, 0.5 * TILT * TURN], [0, 0.5 * TILT * TURN, TURN**2]])
    error = np.einsum("kij,kj->ki", truth @ np.linalg.cholesky(level), random.standard_normal((size, 3)))
    rows = Attitude(
        time=10.0 * np.arange(size) + 5.0,
        quaternion=quaternion_from_dcm(rotation_exp(error * np.broadcast_to(scale, size)[:, None]) @ truth),
        covariance=truth @ level @ np.swapaxes(truth, 1, 2),
        rate=np.full(size, 12.0 if rolling else 0.0),
        quality=np.ones(size),
        flags=np.zeros(size, dtype=np.uint32),
        method=np.full(size, METHODS.index("magnetic"), dtype=np.uint8),
        north="magnetic",
    )
    return rows, truth


def refuse(rows: Attitude, which: slice) -> Attitude:
    """Some rows refused, as a magnetic method does inside casing."""
    quaternion, covariance, flags = rows.quaternion.copy(), rows.covariance.copy(), rows.flags.copy()
    quaternion[which], covariance[which], flags[which] = np.nan, np.nan, BITS["no-field"]
    return replace(rows, quaternion=quaternion, covariance=covariance, flags=flags)


def off(found: Attitude, truth: np.ndarray) -> np.ndarray:
    """Angle between true and found direction (k,), deg."""
    return np.degrees(np.linalg.norm(np.cross(dcm_from_quaternion(found.quaternion)[:, 2], truth[:, 2]), axis=1))


def squared(found: Attitude, truth: np.ndarray) -> np.ndarray:
    """e' P^-1 e / 3 (k,)."""
    e = rotation_log(dcm_from_quaternion(found.quaternion) @ np.swapaxes(truth, 1, 2))
    return np.einsum("ki,kij,kj->k", e, np.linalg.inv(found.covariance), e) / 3.0


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def test_offsets_and_frames_are_inverse() -> None:
    """A frame moved by a vector sees its old direction at minus that vector; no turn about z."""
    random = np.random.default_rng(0)
    for _ in range(20):
        frame = dcm(*random.uniform(0.1, 3.0, 3))
        vector = random.uniform(-1.0, 1.0, 2)
        moved = turned(frame, vector)
        np.testing.assert_allclose(moved, rotation_exp([-vector[0], -vector[1], 0.0]) @ frame, atol=1e-14)
        np.testing.assert_allclose(offset_of(frame, moved[2]), vector, atol=1e-13)
        np.testing.assert_allclose(observe(frame, moved, np.eye(3))[2], 0.0, atol=1e-14)


def test_a_row_taken_as_it_is_comes_back() -> None:
    """The direction and its covariance those of the row: attitude and covariance unchanged."""
    random = np.random.default_rng(1)
    matrix, frame = dcm(1.0, 0.5, 2.0), dcm(1.001, 0.5, 0.0)
    root = random.standard_normal((3, 3))
    covariance = root @ root.T
    offset, noise, _ = observe(frame, matrix, covariance)
    found, spread = rolled(turned(frame, offset), noise, matrix, covariance)
    np.testing.assert_allclose(found, matrix, atol=1e-14)
    np.testing.assert_allclose(spread, covariance, rtol=1e-10)


def test_the_update_is_that_of_a_filter_of_three_angles() -> None:
    """Against a plain Kalman update of (e_x, e_y, e_z) with a prior that knows nothing of e_z; errors of 1e-4 rad leave
    1e-8 of second order."""
    random = np.random.default_rng(2)
    root = 1e-4 * random.standard_normal((3, 3))
    covariance, prior = root @ root.T, 4e-9 * np.diag([1.0, 2.0])
    truth = dcm(1.0, 0.7, 2.0)
    matrix = rotation_exp(1e-4 * random.standard_normal(3)) @ truth
    wide = np.diag([*np.diag(prior), 1e4])
    gain = wide @ np.linalg.inv(wide + covariance)
    measured = rotation_log(matrix @ truth.T)
    wanted = gain @ measured
    spread = wide - gain @ wide
    # the same with the direction alone filtered, the prior's frame being the truth: z of the frame is z of the tool
    offset, noise, _ = observe(truth, matrix, covariance)
    keep = prior @ np.linalg.inv(prior + noise)
    frame = turned(truth, keep @ offset)
    found, joint = rolled(frame, prior - keep @ prior, matrix, covariance)
    np.testing.assert_allclose(rotation_log(found @ truth.T), wanted, atol=3e-8)
    np.testing.assert_allclose(joint, spread, atol=1e-3 * spread[2, 2])


@pytest.mark.long
@pytest.mark.parametrize("tuned", [PLAIN, DEFAULT])
@pytest.mark.parametrize("call", [robust_filter, smooth_windows])
@pytest.mark.parametrize("inclination", [0.003, 0.5, 1.6])
def test_covariance_is_honest(tuned, call, inclination) -> None:
    """Rate drawn from the settings' own start and walk; 8 runs of 120 rows. A steady direction errs the same way for
    many rows, so the mean scatters by about 0.15. Near vertical, level and beyond."""
    found = []
    for seed in range(8):
        random = np.random.default_rng(100 + seed)
        rate = 3e-5 * random.standard_normal(2)[:, None] + np.cumsum(
            4e-7 * 10**0.5 * random.standard_normal((2, 120)), 1
        )
        bend = np.cumsum(10.0 * rate, axis=1)
        rows, truth = run(
            seed, inclination=inclination + bend[0], azimuth=1.0 + bend[1] / np.sin(max(inclination, 0.5))
        )
        found.append(np.mean(squared(call(rows, tuned), truth)))
    assert 0.7 < np.mean(found) < 1.3


def test_filter_and_smoother_are_better_than_the_windows() -> None:
    """A straight hole: 0.052 deg of a window's two directions become less than half, then a quarter."""
    rows, truth = run(1)
    raw, ahead, both = (rms(off(found, truth)) for found in (rows, robust_filter(rows), smooth_windows(rows)))
    assert ahead < 0.5 * raw
    assert both < 0.3 * raw


def test_outliers_are_rejected_flagged_and_bridged() -> None:
    """One window in twenty is 20 times worse than it says: the plain filter suffers, the robust one does not notice."""
    scale = np.where(np.arange(120) % 20 == 7, 20.0, 1.0)
    rows, truth = run(2, scale=scale)
    found, plain = robust_filter(rows), robust_filter(rows, PLAIN)
    assert rms(off(found, truth)) < 0.3 * rms(off(plain, truth))
    assert rms(off(found, truth)) < 1.3 * rms(off(robust_filter(run(2)[0]), run(2)[1]))
    named = [place for place in range(120) if "misfit" in found.names(place)]
    assert set(named) <= set(np.flatnonzero(scale > 1.0))
    assert len(named) >= 4
    assert (found.quality[named] == 0.0).all()


@pytest.mark.long
@pytest.mark.parametrize("size_deg", [0.3, 1.0, 5.0])
def test_a_bend_is_followed_at_once(size_deg) -> None:
    """A real dogleg between two windows: no row is left behind; an outlier of the same size is rejected."""
    step = np.radians(size_deg) * (np.arange(120) >= 60)
    rows, truth = run(3, inclination=0.5 + step)
    for call in (robust_filter, smooth_windows):
        assert off(call(rows), truth).max() < 0.15
    lonely, level = run(3, inclination=0.5 + np.radians(size_deg) * (np.arange(120) == 60))
    found = robust_filter(lonely)
    assert off(found, level)[60] > 0.5 * size_deg
    assert "misfit" in found.names(60)


def test_a_slow_build_is_followed_without_delay() -> None:
    """3 deg/30 m at 20 m/h: 1e-5 rad/s from the middle on."""
    bend = 1e-5 * np.maximum(10.0 * (np.arange(240) - 120), 0.0)
    rows, truth = run(4, size=240, inclination=0.5 + bend)
    assert rms(off(robust_filter(rows), truth)) < 0.03
    assert np.mean(squared(robust_filter(rows), truth)) < 1.5


@pytest.mark.long
def test_noise_larger_than_stated_is_learnt() -> None:
    """Twice the stated errors: without Sage-Husa the squared error is about 3, with it 1."""
    pairs = [run(seed, scale=2.0) for seed in range(5)]
    with_it = np.mean([squared(robust_filter(rows), truth)[60:] for rows, truth in pairs])
    without = np.mean([squared(robust_filter(rows, PLAIN), truth)[60:] for rows, truth in pairs])
    assert with_it < 1.4
    assert without > 2.5


def test_refused_rows_are_bridged_with_growing_uncertainty() -> None:
    """Thirty windows in casing: uncertainty grows, the truth stays inside it, the toolface is unknown while turning."""
    whole, _ = run(5)
    rows = refuse(whole, slice(60, 90))
    found, smooth = robust_filter(rows), smooth_windows(rows)
    assert not found.refused.any()
    gap = slice(60, 90)
    assert (np.diff(found.u.inclination[gap]) > 0.0).all()
    assert found.u.toolface[75] == pytest.approx(np.pi / np.sqrt(3.0), rel=1e-3)
    assert (np.abs(found.angles.inclination[gap] - 0.5) < 4.0 * found.u.inclination[gap]).all()
    assert smooth.u.inclination[75] < 0.6 * found.u.inclination[75]
    assert found.names(75) == ("no-field",)
    assert (np.diff(found.quality[gap]) < 0.0).all()


def test_a_tool_that_does_not_turn_keeps_its_toolface_through_a_gap() -> None:
    """Carried by the measured speed, here 0, with its uncertainty."""
    whole, _ = run(6, rolling=False)
    found = robust_filter(refuse(whole, slice(60, 90)))
    assert found.angles.toolface[75] == pytest.approx(2.0, abs=0.01)
    assert 1e-3 < found.u.toolface[75] < 0.05


def test_a_bridge_has_an_end() -> None:
    """Beyond `longest_bridge` the rows stay refused, and the filter starts anew."""
    rows = refuse(run(7)[0], slice(30, 90))
    found = robust_filter(rows, WindowFilterSettings(longest_bridge=200.0))
    np.testing.assert_array_equal(np.flatnonzero(found.refused), np.arange(50, 90))


def test_rows_without_azimuth_count_for_inclination_only() -> None:
    """Casing with gravity: inclination stays as good as before, azimuth is bridged."""
    rows, truth = run(8)
    quaternion, covariance = rows.quaternion.copy(), rows.covariance.copy()
    down = truth[60:90, :, 2]
    covariance[60:90] += 6.6 * down[:, :, None] * down[:, None, :]
    upright = np.array([[np.cos(3.0), np.sin(3.0), 0.0], [-np.sin(3.0), np.cos(3.0), 0.0], [0.0, 0.0, 1.0]])
    turn = dcm_from_quaternion(quaternion[60:90]) @ upright
    quaternion[60:90] = quaternion_from_dcm(turn)
    cased = replace(rows, quaternion=quaternion, covariance=covariance)
    found, bridged = robust_filter(cased), robust_filter(refuse(rows, slice(60, 90)))
    assert off(found, truth).max() < 0.4
    assert found.u.inclination[89] < 0.5 * bridged.u.inclination[89]
    assert found.u.azimuth[89] > 2.0 * found.u.azimuth[59]
    assert found.u.toolface[75] < 0.005


def test_doubtful_rows_weigh_less_and_prove_nothing() -> None:
    """A disturbed field for ten windows, all agreeing: flagged rows do not bend the hole, unflagged ones do."""
    shift = np.radians(1.0) * ((np.arange(120) >= 60) & (np.arange(120) < 70))
    rows, _ = run(9, inclination=1.0, azimuth=1.0 + shift)
    flags = rows.flags.copy()
    flags[60:70] = BITS["disturbed"]
    said, unsaid = robust_filter(replace(rows, flags=flags)), robust_filter(rows)
    assert np.degrees(np.abs(said.angles.azimuth - 1.0).max()) < 0.35
    assert np.degrees(np.abs(unsaid.angles.azimuth - 1.0).max()) > 0.8


@pytest.mark.parametrize(("flag", "late"), [("vibration", 1), ("disturbed", 14)])
def test_a_bend_is_followed_though_all_rows_are_flagged(flag, late) -> None:
    """Shaken rows testify at once; "disturbed" ones, flagged by a wrong reference, after twelve rejections."""
    rows, truth = run(17, inclination=0.5 + np.radians(1.0) * (np.arange(120) >= 60))
    found = robust_filter(replace(rows, flags=np.full(120, BITS[flag], dtype=np.uint32)))
    assert off(found, truth)[60 + late :].max() < 0.2
    assert off(found, truth)[:60].max() < 0.2


def test_a_first_row_that_is_contradicted_is_not_believed() -> None:
    """An outlier at the start: flagged, wide, and the filter starts behind it."""
    rows, truth = run(10, scale=np.where(np.arange(120) == 0, 30.0, 1.0))
    found = robust_filter(rows)
    assert found.names(0) == ("start",)
    assert squared(found, truth)[0] < 10.0
    assert off(found, truth)[1:].max() < 0.2
    later = smooth_windows(rows)
    assert later.names(0) == ("misfit",)
    assert off(later, truth)[0] < 0.1


def test_a_smoother_reaches_rows_before_the_first_attitude() -> None:
    """Five refused rows at the start: nothing for a filter, a prediction backward for the smoother, not too far."""
    whole, truth = run(14)
    rows = refuse(whole, slice(0, 5))
    assert robust_filter(rows).refused[:5].all()
    found = smooth_windows(rows)
    assert off(found, truth)[:5].max() < 0.1
    assert (np.diff(found.u.inclination[:6]) < 0.0).all()
    assert found.u.toolface[0] == pytest.approx(np.pi / np.sqrt(3.0), rel=1e-3)
    short = smooth_windows(rows, WindowFilterSettings(longest_bridge=25.0))
    np.testing.assert_array_equal(short.refused[:6], [True, True, True, False, False, False])


@pytest.mark.parametrize("rolling", [True, False])
def test_what_rows_share_is_stated_and_not_averaged(rolling: bool) -> None:
    """All rows turned by 0.5 deg: azimuth's u covers it, inclination's is the same; less is shared later."""
    rows, truth = run(13, rolling=rolling)
    turn = float(np.radians(0.5))
    down = truth[:, :, 2]
    shared = turn**2 * down[:, :, None] * down[:, None, :]
    shared[60:] *= 0.25
    turned = replace(rows, covariance=rows.covariance + shared, common=shared)
    free = robust_filter(rows)
    for call in (robust_filter, smooth_windows):
        found = call(turned)
        np.testing.assert_allclose(found.u.azimuth[30:60], turn, rtol=0.1)
        np.testing.assert_allclose(found.u.azimuth[-20:], 0.5 * turn, rtol=0.1)
        np.testing.assert_allclose(found.u_common.azimuth[-20:], 0.5 * turn, rtol=0.02)
        assert (found.u.inclination[-20:] < 1.05 * free.u.inclination[-20:]).all()
        np.testing.assert_allclose(found.angles.azimuth[-20:], 1.0, atol=2e-3)


def test_strong_tracking_follows_what_a_plain_filter_lags() -> None:
    """A sudden rate ten times the assumed: the fading factor opens the filter."""
    bend = 3e-4 * np.maximum(10.0 * (np.arange(120) - 60), 0.0)
    rows, truth = run(11, inclination=0.5 + bend)
    plain, tracking = robust_filter(rows, PLAIN), robust_filter(rows, replace(PLAIN, fading=1.0))
    assert off(tracking, truth).max() < 0.7 * off(plain, truth).max()


MIXED = refuse(run(12, size=60, scale=np.where(np.arange(60) % 13 == 5, 25.0, 1.0))[0], slice(20, 27))


@pytest.mark.long
@settings(max_examples=15, deadline=None)
@given(cuts=st.lists(st.integers(0, 60), max_size=8))
def test_a_stream_cut_anyhow_gives_the_same_rows(cuts: list[int]) -> None:
    """Bit by bit, empty and one-row blocks included, refused rows and outliers among them."""
    stream, edges = RobustStream(), [0, *sorted(cuts), 60]
    parts = [stream.push(part(MIXED, slice(a, b))) for a, b in pairwise(edges)]
    assert same(joined([p for p in [*parts, stream.finish()] if len(p)]), robust_filter(MIXED))


def test_rows_come_out_one_window_late() -> None:
    """And a long refusal does not hold them back."""
    stream = RobustStream(WindowFilterSettings(longest_bridge=50.0))
    assert [len(stream.push(part(MIXED, slice(k, k + 1)))) for k in range(5)] == [0, 1, 1, 1, 1]
    late = [len(stream.push(part(MIXED, slice(k, k + 1)))) for k in range(5, 28)]
    assert max(late) <= 8


def test_rows_that_claim_to_be_exact_and_rows_upside_down_do_no_harm() -> None:
    """Zero covariance, and one row that points straight back."""
    rows, truth = run(15, scale=0.0)
    quaternion = rows.quaternion.copy()
    quaternion[50] = quaternion_from_dcm(np.diag([1.0, -1.0, -1.0]) @ truth[50])
    for call in (robust_filter, smooth_windows):
        exact = call(replace(rows, covariance=np.zeros((120, 3, 3))))
        assert off(exact, truth).max() < 1e-4
        found = call(replace(rows, quaternion=quaternion))
        assert off(found, truth).max() < 0.05
        assert "misfit" in found.names(50)


@pytest.mark.long
def test_long_runs_stay_positive() -> None:
    """Twenty thousand seconds of windows: eigenvalues of every covariance stay above zero."""
    rows, truth = run(16, size=2000, scale=np.where(np.arange(2000) % 17 == 3, 30.0, 1.0))
    for call in (robust_filter, smooth_windows):
        found = call(rows)
        assert np.linalg.eigvalsh(found.covariance).min() > 0.0
        assert off(found, truth).max() < 0.12


def test_nothing_and_nothing_known() -> None:
    """Empty in, empty out; all refused in, all refused out; a single row comes back."""
    assert len(robust_filter(part(MIXED, slice(0, 0)))) == 0
    assert robust_filter(part(MIXED, slice(20, 27))).refused.all()
    one = smooth_windows(part(MIXED, slice(0, 1)))
    np.testing.assert_allclose(one.quaternion, MIXED.quaternion[:1], atol=1e-14)
    np.testing.assert_allclose(one.covariance, MIXED.covariance[:1], rtol=0.2, atol=5e-8)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: WindowFilterSettings(huber=1.5), "input-value"),
        (lambda: WindowFilterSettings(igg3=(4.0, 1.0)), "input-value"),
        (lambda: WindowFilterSettings(adaptive_three=(4.0, 1.0)), "input-value"),
        (lambda: WindowFilterSettings(forgetting=1.0), "input-value"),
        (lambda: WindowFilterSettings(rate_walk=-1.0), "input-value"),
        (lambda: robust_filter(part(MIXED, slice(None, None, -1))), "input-order"),
    ],
)
def test_bad_input_is_refused(call, words) -> None:
    """Each message says what is wrong."""
    with refused(words):
        call()


def test_another_north_is_refused() -> None:
    """Rows of one run count azimuth from one north."""
    stream = RobustStream()
    stream.push(part(MIXED, slice(0, 2)))
    with refused("input-north"):
        stream.push(replace(part(MIXED, slice(2, 4)), north="true"))

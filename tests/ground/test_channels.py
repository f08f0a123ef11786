"""The batch kernel against long-double arctangents, the attitude formulas and a second implementation in numpy."""

from __future__ import annotations

import math
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry import channels
from inclinometry import compiled as _kernels
from inclinometry.arrays import Array
from inclinometry.channels import WORTH_THREADS, ChannelAngles, angles_from_channels
from inclinometry.orientation import angles, fields

TAU = 2.0 * np.pi
LONG = np.longdouble
LONG_TAU = LONG("6.28318530717958647692528676655900577")
EYE, ZERO = np.eye(3), np.zeros(3)
# steps below, at and above every edge of the selections: the axes, the diagonals, pi/8 and 3 pi/8
EDGES = np.tan([np.pi / 8.0, np.pi / 4.0, 3.0 * np.pi / 8.0])


def turned(a: Array, b: Array) -> Array:
    """Distance of two angles around the circle."""
    difference = np.abs(np.asarray(a) - b)
    return np.asarray(np.minimum(difference, TAU - difference))


def reference_atan2(y: Array, x: Array) -> Array:
    angle = np.arctan2(y.astype(LONG), x.astype(LONG))
    return np.where(angle < 0.0, angle + LONG_TAU, angle)


def directions() -> tuple[Array, Array]:
    """Pairs (y, x) over all octants, magnitudes from denormal to 4e307, and next to every edge."""
    rng = np.random.default_rng(7)
    phi = rng.uniform(0.0, TAU, 20_000)
    size = 10.0 ** rng.uniform(-300.0, 307.0, phi.size)
    y, x = [size * np.sin(phi)], [size * np.cos(phi)]
    independent = 10.0 ** rng.uniform(-323.0, 307.5, (2, 5_000)) * rng.choice([-1.0, 1.0], (2, 5_000))
    steps = np.array([np.nextafter(e, d) for e in EDGES for d in (-np.inf, e, np.inf)])
    extremes = np.array([1e-12, 1e-300, 5e-324, 2.5e-323, 1.0, 3.0, 4e307])
    first, second = (grid.ravel() for grid in np.meshgrid(np.concatenate([extremes, -extremes, [0.0, -0.0]]), extremes))
    y += [independent[0], np.tile(steps, 2), first, second, first]
    x += [independent[1], np.repeat([1.0, -1.0], steps.size), second, first, -second]
    return np.concatenate(y), np.concatenate(x)


def attitudes(count: int, seed: int = 3) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    azimuth, toolface = rng.uniform(0.0, TAU, (2, count))
    return rng.uniform(np.radians(2.0), np.radians(178.0), count), azimuth, toolface


def tool(count: int, seed: int = 3) -> tuple[ChannelAngles, Array, tuple[Array, Array, Array, Array]]:
    """Attitudes, the signals (n, 6) of a skewed, offset tool in them, and its calibration."""
    rng = np.random.default_rng(seed + 100)
    truth = ChannelAngles(*attitudes(count, seed))
    g, b = fields(truth.azimuth, truth.inclination, truth.toolface, np.radians(68.0))
    tensors = [scale * (np.eye(3) + 0.1 * rng.standard_normal((3, 3))) for scale in (2000.0, 30_000.0)]
    offsets = [scale * rng.standard_normal(3) for scale in (50.0, 500.0)]
    signals = np.concatenate([v @ n.T + u for v, n, u in zip((g, b), tensors, offsets, strict=True)], axis=1)
    return truth, signals, (np.linalg.inv(tensors[0]), offsets[0], np.linalg.inv(tensors[1]), offsets[1])


def both(g: Array, b: Array) -> list[ChannelAngles]:
    """Kernel by channels, kernel by rows, and numpy."""
    rows = np.concatenate(np.broadcast_arrays(g, b), axis=-1)
    c = channels._coefficients(EYE, ZERO, EYE, ZERO)
    plain = ChannelAngles(*(np.empty(len(rows)) for _ in range(3)))
    channels._plain(rows, c, plain)
    return [
        angles_from_channels(list(rows.T), EYE, ZERO, EYE, ZERO),
        angles_from_channels(rows, EYE, ZERO, EYE, ZERO),
        plain,
    ]


def test_arctangent_over_all_octants_and_magnitudes() -> None:
    y, x = directions()
    found = np.array([_kernels._full_turn(a, b) for a, b in zip(y.tolist(), x.tolist(), strict=True)])
    wanted = reference_atan2(y, x)
    error = np.abs(found.astype(LONG) - wanted)
    error = np.minimum(error, np.abs(LONG_TAU - error))
    assert np.all((found >= 0.0) & (found < TAU))
    slack = 8.0 * np.finfo(LONG).eps  # of the reference, where long double is no longer than double
    # half a unit in the last place of an angle above 4 is 4.4e-16, and nothing else shows there
    assert error[found > 0.0].max() <= 4.5e-16 + slack
    # what rounds to a whole turn becomes 0: half a unit, and the 2.4e-16 that the double 2 pi is short
    assert error[found == 0.0].max() <= 6.9e-16 + slack
    # below pi/4 the error is relative: division, polynomial and sum, each of half a unit, across a power of two
    small = (found < np.pi / 4.0) & (found > 1e-290)
    assert np.max(error[small] / np.spacing(found[small])) <= 2.5 + 8.0 * np.finfo(LONG).eps / np.finfo(float).eps


def test_half_turn_equals_full_turn_for_positive_sines() -> None:
    y, x = directions()
    for a, b in zip(np.abs(y).tolist(), x.tolist(), strict=True):
        half, full = _kernels._half_turn(a, b), _kernels._full_turn(a, b)
        assert half == full


@pytest.mark.parametrize("y", [0.0, -0.0])
def test_axes_are_exact(y: float) -> None:
    assert [_kernels._full_turn(y, x) for x in (1.0, -1.0)] == [0.0, np.pi]
    assert [_kernels._full_turn(s, y) for s in (1.0, -1.0)] == [np.pi / 2.0, 1.5 * np.pi]
    assert math.copysign(1.0, _kernels._full_turn(y, 1.0)) == 1.0
    assert math.isnan(_kernels._full_turn(y, 0.0))


@pytest.mark.parametrize("count", [1, 7, 129, 20_001])
def test_kernel_and_numpy_agree_with_the_attitude_formulas(count: int) -> None:
    inclination, azimuth, toolface = attitudes(count)
    g, b = fields(azimuth, inclination, toolface, np.radians(68.0))
    wanted = angles(9.8 * g, 50_000.0 * b)
    for found in both(9.8 * g, 50_000.0 * b):
        for name in ChannelAngles._fields:
            # rounding of the fields, 1e-16, over sin I cos dip >= 0.013, with a few operations each
            assert turned(getattr(found, name), getattr(wanted, name)).max() < 2e-13, name


def test_calibration_brings_back_the_attitude() -> None:
    truth, signals, calibration = tool(5000)
    found = angles_from_channels(signals, *calibration)
    for name in ChannelAngles._fields:
        # as above, times the condition of the tensors (below 3) and offsets of up to a tenth of the signal
        assert turned(getattr(found, name), getattr(truth, name)).max() < 1e-12, name


def test_every_layout_gives_the_same_angles() -> None:
    _, signals, calibration = tool(3001)
    wanted = angles_from_channels([np.ascontiguousarray(u) for u in signals.T], *calibration)
    wide = np.zeros((3001, 12))
    wide[:, ::2] = signals
    unaligned = np.frombuffer(b"\0" + signals.tobytes(), dtype=np.uint8)[1:].view(np.float64).reshape(-1, 6)
    frozen = signals.copy()
    frozen.flags.writeable = False
    layouts = {
        "rows": signals,
        "columns": np.asfortranarray(signals),
        "part of columns": np.asfortranarray(np.concatenate([signals, signals]))[:3001],
        "every other column": wide[:, ::2],
        "backwards": signals[::-1].copy()[::-1],
        "other byte order": signals.astype(">f8"),
        "unaligned": unaligned,
        "read-only": frozen,
        "strided channels": list(signals.T),
        "lists": [u.tolist() for u in signals.T],
    }
    for name, layout in layouts.items():
        for found, angle in zip(angles_from_channels(layout, *calibration), wanted, strict=True):
            # vector and remainder loops may fuse other products: rounding as above
            assert turned(found, angle).max() < 2e-13, name


def test_strength_of_the_fields_does_not_matter() -> None:
    inclination, azimuth, toolface = attitudes(500)
    g, b = fields(azimuth, inclination, toolface, np.radians(-40.0))
    wanted = both(g, b)[0]
    # powers of two scale every intermediate exactly
    for found in (both(g * 2.0**-240, b * 2.0**240)[0], both(g * 2.0**200, b * 2.0**-250)[0]):
        assert all(np.array_equal(x, y) for x, y in zip(found, wanted, strict=True))


@pytest.mark.parametrize("down", [1.0, -1.0])
def test_exactly_vertical_has_azimuth_zero_and_magnetic_toolface(down: float) -> None:
    toolface = np.linspace(0.0, TAU, 41)[:-1]
    b = np.stack([np.cos(toolface), -np.sin(toolface), np.full(40, 2.0)], axis=-1) * 20_000.0
    g = np.tile([0.0, -0.0, 9.8 * down], (40, 1))
    wanted = angles(g, b)
    for found in both(g, b):
        assert np.all(found.azimuth == 0.0)
        assert np.all(found.inclination == (0.0 if down > 0.0 else np.pi))
        assert turned(found.toolface, wanted.toolface).max() < 1e-15  # two roundings
        if down > 0.0:
            assert turned(found.toolface, wanted.magnetic_toolface).max() < 1e-15


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", range(6))
def test_a_gap_spoils_its_own_row_only(bad: float, channel: int) -> None:
    inclination, azimuth, toolface = attitudes(67)
    rows = np.concatenate(fields(azimuth, inclination, toolface, 1.0), axis=-1)
    rows[40, :2] = 0.0  # a vertical row with a gap, too
    holed = rows.copy()
    holed[[3, 40, 66], channel] = bad
    kept = np.delete(np.arange(67), [3, 40, 66])
    for found, whole in zip(both(holed[:, :3], holed[:, 3:]), both(rows[:, :3], rows[:, 3:]), strict=True):
        for angle, clean in zip(found, whole, strict=True):
            assert np.isnan(angle[[3, 40, 66]]).all()
            assert np.array_equal(angle[kept], clean[kept])


@pytest.mark.parametrize(
    ("g", "b"),
    [([0.0, 0.0, 0.0], [1.0, 2.0, 3.0]), ([1.0, 0.0, 1.0], [0.0, 0.0, 0.0]), ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])],
)
def test_no_direction_is_nan(g: list[float], b: list[float]) -> None:
    for found in both(np.array([g]), np.array([b])):
        assert all(np.isnan(angle).all() for angle in found)


def test_tiny_negative_angles_are_zero_not_two_pi() -> None:
    for found in both(np.array([[-1.0, -1e-30, 1.0]]), np.array([[1.0, 0.0, 1.0]])):
        assert found.toolface[0] == 0.0
        assert 0.0 <= found.azimuth[0] < TAU


def test_no_samples() -> None:
    for found in both(np.empty((0, 3)), np.empty((0, 3))):
        assert [angle.shape for angle in found] == [(0,)] * 3


def test_out_is_used_and_nothing_allocated() -> None:
    count = 200_000
    _, signals, calibration = tool(count)
    source = [np.ascontiguousarray(u) for u in signals.T]
    out = ChannelAngles(*np.zeros((3, count)))
    wanted = angles_from_channels(source, *calibration)
    tracemalloc.start()
    try:
        found = angles_from_channels(source, *calibration, out=out)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert all(a is b for a, b in zip(found, out, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(found, wanted, strict=True))
    assert peak < 100_000  # one channel alone is 1.6 MB


@pytest.mark.parametrize("by_rows", [True, False])
def test_threads_do_not_change_a_digit(by_rows: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(channels, "WORTH_THREADS", 10_000)
    monkeypatch.setattr(channels, "_workers", lambda threads: threads or 3)
    _, signals, calibration = tool(10_001)
    source = signals if by_rows else np.asfortranarray(signals)
    single = angles_from_channels(source, *calibration, threads=1)
    for threads in (None, 2, 5):
        several = angles_from_channels(source, *calibration, threads=threads)
        assert all(np.array_equal(a, b) for a, b in zip(single, several, strict=True))


def test_threads_only_above_a_million_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[int] = []
    monkeypatch.setattr(channels, "_shared", lambda *arguments: used.append(arguments[-1]))
    monkeypatch.setattr(channels, "_kernel", lambda *arguments: None)
    monkeypatch.setattr(channels, "_workers", lambda threads: threads or 4)
    for count in (WORTH_THREADS, WORTH_THREADS + 1):
        source = [np.broadcast_to(np.zeros(1), (count,))] * 6
        monkeypatch.setattr(channels, "_source", tuple)
        for threads in (None, 1, 2):
            angles_from_channels(source, EYE, ZERO, EYE, ZERO, threads=threads)
    assert used == [4, 2]


def test_never_more_threads_than_cores() -> None:
    assert channels._workers(1) == 1
    assert channels._workers(100_000) == channels._workers(None)


def test_short_arrays_do_not_load_numba() -> None:
    script = (
        "import sys, numpy as np\n"
        "from inclinometry.channels import angles_from_channels as f\n"
        "e, z = np.eye(3), np.zeros(3)\n"
        "short = f(np.ones((19_999, 6)) * [1, 2, 3, 4, 5, 7], e, z, e, z)\n"
        "assert not {'numba', 'scipy', 'matplotlib'} & set(sys.modules)\n"
        "long = f(np.ones((20_000, 6)) * [1, 2, 3, 4, 5, 7], e, z, e, z)\n"
        "assert 'numba' in sys.modules\n"
        "assert max(abs(a[0] - b[0]) for a, b in zip(short, long)) < 1e-14\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)


@pytest.mark.parametrize("error", [RuntimeError("no locator available"), OSError(28, "No space left on device")])
def test_a_cache_that_cannot_be_written_is_done_without(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []

    def njit(signatures: object, *, cache: bool = False, **_: object) -> object:
        asked.append(cache)
        if cache:
            raise error
        return lambda function: function

    monkeypatch.setattr(_kernels.numba, "njit", njit)
    assert _kernels.compiled("void()")(directions) is directions
    assert asked == [True, False]


GOOD = np.arange(18.0).reshape(3, 6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"signals": np.zeros((3, 5))}, "input-shape"),
        ({"signals": np.zeros(6)}, "input-shape"),
        ({"signals": [np.zeros(3)] * 5}, "input-shape"),
        ({"signals": [np.zeros(3)] * 5 + [np.zeros(4)]}, "input-shape"),
        ({"signals": [np.zeros((3, 1))] * 6}, "input-shape"),
        ({"signals": [["a", "b"]] * 6}, "input-kind"),
        ({"signals": GOOD + 0j}, "input-kind"),
        ({"matrix_g": np.zeros((2, 3))}, "input-shape"),
        ({"matrix_b": np.full((3, 3), np.nan)}, "input-finite"),
        ({"offset_g": [0.0, 0.0]}, "input-shape"),
        ({"offset_b": [0.0, np.inf, 0.0]}, "input-finite"),
        ({"threads": 0}, "input-value"),
        ({"out": [np.zeros(3)] * 2}, "input-shape"),
        ({"out": [np.zeros(3)] * 3}, "sensor-memory-shared"),
        ({"out": [np.zeros(3), np.zeros(3), np.zeros(4)]}, "input-shape"),
        ({"out": [np.zeros(3), np.zeros(3, np.float32), np.zeros(3)]}, "input-shape"),
        ({"out": [np.zeros(6)[::2], np.zeros(3), np.zeros(3)]}, "input-shape"),
        ({"out": [[0.0] * 3, np.zeros(3), np.zeros(3)]}, "input-shape"),
        ({"out": [GOOD.ravel()[:3], np.zeros(3), np.zeros(3)]}, "sensor-memory-shared"),
    ],
)
def test_arguments_that_cannot_be_used(change: dict[str, object], message: str) -> None:
    arguments = {"signals": GOOD, "matrix_g": EYE, "offset_g": ZERO, "matrix_b": EYE, "offset_b": ZERO} | change
    with refused(message):
        angles_from_channels(**arguments)  # type: ignore[arg-type]

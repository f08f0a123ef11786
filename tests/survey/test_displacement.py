"""A simulated casing with a known movement: recovered within its uncertainty, biases without effect, faults seen."""

from __future__ import annotations

import numpy as np
import pytest
from tests.refusals import refused

from inclinometry.errors import InputError
from inclinometry.survey.displacement import CasingErrors, CasingReading, check_reading, check_sums, displacement

N, STEP, SIGMA = 60, 0.5, 1e-4
DEPTH = STEP * np.arange(N)
TILT = {"a": 0.02 + 0.01 * np.sin(DEPTH / 5.0), "b": 0.015 * np.cos(DEPTH / 7.0)}
SHEAR = np.where((DEPTH > 8.0) & (DEPTH < 10.0), 0.004, 0.0)


def read(tilt=TILT, bias=(0.001, 0.001), sigma=0.0, seed=0):
    """What a probe reads: a sine and its bias in each of the two runs, and noise."""
    rng = np.random.default_rng(seed)
    faces = {}
    for axis, s in tilt.items():
        runs = np.stack([s + bias[0], -s + bias[1]], axis=1)
        faces[axis] = runs + sigma * rng.normal(size=runs.shape)
    return CasingReading(DEPTH, STEP, faces)


def codes(found):
    return [one.code for one in found.findings]


def refusal(check, *given):
    with pytest.raises(InputError) as caught:
        check(*given)
    assert caught.value.finding.severity == "refused"
    return caught.value.finding.code


def moved(extra=SHEAR):
    return {axis: s + (extra[axis] if isinstance(extra, dict) else extra) for axis, s in TILT.items()}


def test_a_known_shear_is_found_at_every_depth():
    found = displacement(read(), read(moved()))
    # by hand: what lies below a point moves it
    truth = [STEP * SHEAR[z - 1e-9 <= DEPTH].sum() for z in found.depth]
    # sums of sixty numbers of 0.02
    assert np.allclose(found.axes["a"].displacement, truth, atol=1e-14)
    assert found.depth[-1] == DEPTH[-1] + STEP
    assert found.axes["b"].displacement[-1] == 0.0
    top = displacement(read(), read(moved()), fixed="top")
    # the same shape, held at the other end
    shape = found.axes["a"].displacement
    assert np.allclose(top.axes["a"].displacement, shape - shape[0], atol=1e-14)
    assert top.axes["a"].displacement[0] == 0.0


def test_a_bias_of_both_runs_has_no_effect_and_of_one_run_leans():
    same = displacement(read(), read(bias=(0.004, 0.004)))
    assert np.allclose(same.axes["a"].displacement, 0.0, atol=1e-14)
    assert same.axes["a"].bias_change == pytest.approx(0.006)
    assert (same.findings[0].code, same.findings[0].severity) == ("holes-bias-change", "note")
    # (b1 - b2) / 2 a step over 60 steps of 0.5 m: 0.03 m, which the warning states
    lean = displacement(read(), read(bias=(0.003, 0.001)))
    assert lean.axes["a"].displacement[0] == pytest.approx(0.001 * STEP * N)
    assert [(one.code, one.severity) for one in lean.findings[:2]] == [("holes-bias-shift", "warning")] * 2
    assert lean.findings[0].values["parts"][0].values["false_mm"] == pytest.approx(30.0)


TURN, SHIFT = np.radians(1.0), 0.1
TURNED = {"a": TILT["a"] + TURN * TILT["b"], "b": TILT["b"] - TURN * TILT["a"]}
DEEPER = {"a": 0.02 + 0.01 * np.sin((DEPTH + SHIFT) / 5.0), "b": 0.015 * np.cos((DEPTH + SHIFT) / 7.0)}


@pytest.mark.parametrize("fixed", ["bottom", "top"])
@pytest.mark.parametrize(
    ("tilt", "cause", "code", "value", "true"),
    [
        (TILT, "bias", "holes-bias-shift", "bias_shift_mm", 1e3 * 5e-4 * STEP),
        (TURNED, "rotation", "holes-rotation", "rotation_deg", 1.0),
        (DEEPER, "depth", "holes-depth-shift", "depth_mm", 1e3 * SHIFT),
        ({**TILT, "a": 1.2 * TILT["a"]}, "sensitivity", "holes-sensitivity", "sensitivity_percent", 20.0),
    ],
)
def test_an_error_between_readings_is_named_under_a_shear_and_taken_away(fixed, tilt, cause, code, value, true):
    """By hand what is left is the shear, to two U; each end of the casing serves as the fixed one."""
    base = read(sigma=SIGMA, seed=1)
    tilt = {"a": tilt["a"] + SHEAR, "b": tilt["b"]}
    later = read(tilt, bias=(0.002 if cause == "bias" else 0.001, 0.001), sigma=SIGMA, seed=2)
    later.faces["b"][:, 0] -= 0.001 if cause == "bias" else 0.0
    stated = CasingErrors(bias_shift=1e-3, rotation=0.1, depth=0.1)
    found = displacement(base, later, stated, fixed=fixed)
    (one,) = [one for one in found.findings if one.severity == "warning"]
    assert one.code == code
    u = 0.5 * next(size for name, size in one.values.items() if name.startswith("expanded"))
    assert abs(one.values[value] - true) <= 3.0 * u
    assert u < 0.1 * abs(true)
    right = displacement(base, later, stated, fixed=fixed, correct=[cause])
    assert [one.code for one in right.findings if one.severity == "warning"] == []
    truth = displacement(read(), read(moved({"a": SHEAR, "b": 0.0})), fixed=fixed)
    free = 0 if fixed == "bottom" else -1
    for axis, moves in right.axes.items():
        parts = moves.components
        # what is stated of an error that is taken away no longer counts
        assert {"bias": "bias shift"}.get(cause, cause) not in parts
        u = np.hypot(parts["random"], parts["correction"]) if "correction" in parts else parts["random"]
        assert abs(moves.displacement - truth.axes[axis].displacement)[free] <= 3.0 * u[free]


def test_exchanged_axes_are_refused():
    with refused("holes-correlation", what="axes A and B are exchanged"):
        displacement(read(sigma=SIGMA), read({"a": TILT["b"], "b": TILT["a"]}, sigma=SIGMA, seed=1))


def test_a_shift_of_depths_is_found_of_one_axis():
    one, other = ({"a": each["a"]} for each in (TILT, DEEPER))
    found = displacement(read(one, sigma=SIGMA), read(other, sigma=SIGMA, seed=1))
    assert "holes-depth-shift" in codes(found)


@pytest.mark.parametrize("fixed", ["bottom", "top"])
def test_the_movement_is_within_two_u_for_95_of_100(fixed):
    inside, free, ratios = [], 0 if fixed == "bottom" else -1, []
    truth = displacement(read(), read(moved()), fixed=fixed).axes["a"].displacement
    for seed in range(400):
        one = displacement(read(sigma=SIGMA, seed=2 * seed), read(moved(), sigma=SIGMA, seed=2 * seed + 1), fixed=fixed)
        found = one.axes["a"]
        error = found.displacement - truth
        inside.append(abs(error[free]) <= 2.0 * found.u[free])
        ratios.append(error[free] / found.u[free])
    # 95.4 % of 400 draws within three standard deviations of a count, 3 x sqrt(0.046 x 0.954 / 400)
    assert np.mean(inside) == pytest.approx(0.954, abs=0.032)
    assert np.std(ratios) == pytest.approx(1.0, abs=0.11)


def test_random_errors_grow_as_the_root_of_the_steps():
    one = displacement(read(sigma=SIGMA), read(sigma=SIGMA, seed=1)).axes["a"]
    u = one.components["random"]
    assert np.allclose(u, u[-2] * np.sqrt(np.arange(N, -1, -1)))
    # two readings of two runs each, halved: sigma x step; the scatter of 60 is known to 9 %
    assert u[-2] == pytest.approx(SIGMA * STEP, rel=0.3)


def test_check_sums_without_scatter_say_so():
    assert [one.values["advice"] for one in displacement(read(), read()).findings] == ["State it by --step-sd-mm"] * 2
    assert displacement(read(), read(), CasingErrors(step_sd=1e-4)).findings == ()


def test_a_bias_that_drifts_during_a_run_is_named():
    first, second = read(sigma=SIGMA, seed=7), read(sigma=SIGMA, seed=8)
    assert displacement(first, second).findings == ()
    # warming up: ten times the noise over the first run
    warming = CasingReading(
        DEPTH,
        STEP,
        {axis: runs + [[10.0 * SIGMA, 0.0]] * (DEPTH / DEPTH[-1])[:, None] for axis, runs in second.faces.items()},
    )
    assert "holes-correlation" in codes(displacement(first, warming))


def test_what_repeats_at_a_depth_is_no_error_of_the_movement():
    couplings = np.where(np.arange(N) % 6 == 0, 0.003, 0.0)
    first, second = (read(sigma=SIGMA, seed=seed) for seed in (3, 4))
    plain = displacement(first, second).axes["a"].u[0]
    rough = [
        CasingReading(DEPTH, STEP, {axis: runs + couplings[:, None] for axis, runs in one.faces.items()})
        for one in (first, second)
    ]
    found = displacement(*rough).axes["a"]
    assert found.u[0] == pytest.approx(plain)
    assert not found.spikes.any()
    assert (np.flatnonzero(found.repeated) % 6 == 0).all()
    assert found.repeated.sum() == 10


def test_a_spike_whose_change_is_none_is_repeated_only_where_the_base_reading_has_one():
    """A scatter of the base reading, larger than that of the later one, hides the change of its spike."""
    first, second = read(sigma=3.0 * SIGMA, seed=3), read(sigma=SIGMA / 3.0, seed=4)
    runs = second.faces["a"] + np.where(np.arange(N) == 20, 4.0 * SIGMA, 0.0)[:, None]
    found = displacement(first, CasingReading(DEPTH, STEP, {**second.faces, "a": runs})).axes["a"]
    assert found.sums is not None
    assert found.sums.spikes[20]
    assert not check_sums(first.faces["a"]).spikes[20]
    assert not found.spikes[20]
    assert not found.repeated.any()


@pytest.mark.parametrize("bias", [(0.001, 0.001), (0.004, 0.002)])
def test_a_spike_is_flagged_and_widens_what_is_above_it(bias):
    second = read(sigma=SIGMA, seed=6, bias=bias)
    runs = second.faces["a"].copy()
    runs[30, 1] += 0.01
    spiked = CasingReading(DEPTH, STEP, {**second.faces, "a": runs})
    first = read(sigma=SIGMA, seed=5)
    found, clean = displacement(first, spiked).axes["a"], displacement(first, second).axes["a"]
    assert np.flatnonzero(found.spikes).tolist() == [30]
    assert np.allclose(found.u[31:], clean.u[31:], rtol=0.1)
    # half of 0.01 over a step of 0.5 m
    assert np.sqrt(found.u[0] ** 2 - found.u[31] ** 2) == pytest.approx(0.0025, rel=0.05)
    assert abs(found.displacement[0] - clean.displacement[0]) <= 2.0 * found.u[0]


def test_systematic_parts_are_the_first_order_of_their_causes():
    base, k, shift, turn = read(), 1e-3, 0.01, 1e-3
    found = displacement(base, base, CasingErrors(0.0, 1e-5, k, shift, turn)).axes["a"].components
    lean = STEP * np.cumsum(TILT["a"][::-1])[::-1]
    grown = displacement(base, read({axis: s * (1.0 + k) for axis, s in TILT.items()})).axes["a"].displacement
    # k times more of k: a thousandth
    assert np.allclose(found["sensitivity"], np.abs(grown), rtol=2e-3)
    assert found["sensitivity"][0] == pytest.approx(k * lean[0])
    assert found["bias shift"][0] == pytest.approx(1e-5 * N)
    # axes turned: A reads cos A + sin B
    turned = {"a": np.cos(turn) * TILT["a"] + np.sin(turn) * TILT["b"], "b": TILT["b"]}
    seen = displacement(base, read(turned)).axes["a"].displacement
    # the cosine takes 5e-7 of the lean of 0.6 m
    assert np.allclose(found["rotation"][:-1], np.abs(seen)[:-1], atol=1e-6)
    shifted = {"a": 0.02 + 0.01 * np.sin((DEPTH + shift) / 5.0), "b": TILT["b"]}
    seen = displacement(base, read(shifted)).axes["a"].displacement
    # slopes by differences over 0.5 m of a wave of 31 m: (0.5 / 5)^2 / 6, one-sided at the ends
    assert np.allclose(found["depth"], np.abs(seen), atol=0.02 * np.abs(seen).max())


def test_a_single_run_has_no_check_sums_and_no_random_part_unless_stated():
    base = CasingReading(DEPTH, STEP, {"a": TILT["a"][:, None]})
    now = CasingReading(DEPTH, STEP, {"a": (TILT["a"] + SHEAR)[:, None]})
    found = displacement(base, now).axes["a"]
    assert found.sums is None
    assert found.displacement[0] == pytest.approx(STEP * SHEAR.sum())
    assert np.isnan(found.u[:-1]).all()
    stated = displacement(base, now, CasingErrors(step_sd=1e-4)).axes["a"]
    assert stated.u[0] == pytest.approx(1e-4 * np.sqrt(N))


def test_slope_indicators_figures_for_a_hundred_feet():
    # Slope Indicator, Inclinometer accuracy: 0.007 inch random and 0.005 inch systematic a reading of 2 ft:
    # 0.007 x sqrt(50) + 0.005 x 50 = 0.050 + 0.250 inch
    inch = 0.0254
    found = (
        displacement(read(), read(), CasingErrors(step_sd=0.007 * inch, bias_shift=0.005 * inch)).axes["a"].components
    )
    lowest_fifty = N - 50
    assert found["random"][lowest_fifty] / inch == pytest.approx(0.050, abs=0.0006)
    assert found["bias shift"][lowest_fifty] / inch == pytest.approx(0.250)


def test_faces_that_are_reversed():
    swapped = CasingReading(DEPTH, STEP, {axis: runs[:, ::-1] for axis, runs in read().faces.items()})
    assert refusal(displacement, read(), swapped) == "holes-correlation"
    turned = CasingReading(DEPTH, STEP, {"a": np.stack([TILT["a"], TILT["a"]], axis=1)})
    assert refusal(check_reading, turned) == "holes-correlation"
    assert check_reading(read(sigma=SIGMA)) == []
    noise = CasingReading(DEPTH, STEP, {"a": np.random.default_rng(1).normal(size=(N, 2))})
    assert [one.code for one in check_reading(noise)] == ["holes-correlation"]


def test_a_casing_that_leans_the_other_way_may_have_moved():
    base = CasingReading(DEPTH, STEP, {"a": np.stack([TILT["a"] - 0.02, 0.02 - TILT["a"]], axis=1)})
    over = CasingReading(DEPTH, STEP, {"a": np.stack([0.013 - TILT["a"], TILT["a"] - 0.013], axis=1)})
    (one,) = [found for found in displacement(base, over).findings if found.code == "holes-correlation"]
    assert one.severity == "warning"


def test_rows_that_stand_twice():
    """As `inclinometry.survey.run_stations` finds them of a run: a sheet copied below itself."""
    faces = read(sigma=SIGMA).faces
    copied = {axis: np.concatenate([runs[:40], runs[10:30]]) for axis, runs in faces.items()}
    (one,) = [f for f in check_reading(CasingReading(DEPTH, STEP, copied)) if f.code == "run-block-repeated"]
    assert (one.rows, one.severity) == (tuple(range(40, 60)), "warning")
    assert (one.values["source_m"], one.values["md_m"]) == (DEPTH[10], DEPTH[40])


def test_an_axis_that_was_not_read_hides_a_rotation():
    base = CasingReading(DEPTH, STEP, {"a": read(sigma=SIGMA).faces["a"]})
    now = CasingReading(DEPTH, STEP, {"a": read(sigma=SIGMA, seed=1).faces["a"]})
    assert codes(displacement(base, now, CasingErrors(rotation=0.01))) == ["holes-unknown"]


def test_readings_of_other_depths_or_runs():
    faces = read().faces
    assert refusal(displacement, read(), CasingReading(DEPTH + 0.1, STEP, faces)) == "holes-depths-differ"
    few = CasingReading(DEPTH[:4], STEP, {axis: runs[:4] for axis, runs in faces.items()})
    assert refusal(displacement, read(), few) == refusal(displacement, few, read()) == "holes-depths-differ"
    broken = CasingReading(DEPTH + 0.02 * (np.arange(N) == 30), STEP, faces)
    assert refusal(displacement, read(), broken) == "holes-depths-differ"
    assert refusal(displacement, read(), CasingReading(DEPTH, STEP, {"a": faces["a"]})) == "holes-axes-differ"


def test_a_coarse_probe_that_repeats_itself():
    runs = np.zeros((20, 2))
    runs[3, 0], runs[9, 0] = 1e-4, -1e-4
    for rounding in (0.0, 1e-17):
        sums = check_sums(runs + rounding * np.random.default_rng(1).normal(size=runs.shape))
        assert sums.robust_sd > 1e-6
        assert not sums.spikes.any()


@pytest.mark.parametrize(("rows", "fixed", "severity"), [
    (slice(0, 40), "bottom", "warning"), (slice(0, 40), "top", "note"), (slice(5, N), "bottom", "note"),
])  # fmt: skip
def test_readings_of_partly_other_depths_are_compared_at_the_common_ones(rows, fixed, severity):
    whole, later = read(sigma=SIGMA, seed=1), read(moved(), sigma=SIGMA, seed=2)
    part = CasingReading(DEPTH[rows], STEP, {axis: runs[rows] for axis, runs in later.faces.items()})
    for base, now in ((whole, part), (part, whole)):
        found = displacement(base, now, fixed=fixed)
        assert np.array_equal(found.depth[:-1], DEPTH[rows])
        (one,) = [one for one in found.findings if one.code == "holes-depths-common"]
        assert one.severity == (severity if base is whole else "note")
        assert one.values["count"] == N - len(part.depth)


@pytest.mark.parametrize(("late", "run"), [(True, 0), (True, 1), (False, 0), (False, 1)])
def test_a_spike_says_which_reading_run_and_depth(late, run):
    pair = [read(sigma=SIGMA, seed=5), read(moved(), sigma=SIGMA, seed=6)]
    names = ("January", "June")
    pair = [CasingReading(DEPTH, STEP, one.faces, name) for one, name in zip(pair, names, strict=True)]
    pair[late].faces["a"][30, run] += 0.01
    (one,) = [one for one in displacement(*pair).findings if one.code == "holes-spikes"]
    assert (one.values["reading"], one.values["faces"]) == (names[late], (("A0", "A180")[run],))
    assert (one.values["md_m"], one.rows) == ((DEPTH[30],), (30,))


def test_resultant_and_its_direction():
    found = displacement(read(), read(moved({"a": SHEAR, "b": SHEAR})), CasingErrors(step_sd=1e-4))
    size, u, direction = found.resultant()
    assert size[0] == pytest.approx(np.sqrt(2.0) * STEP * SHEAR.sum())
    assert u[0] == pytest.approx(1e-4 * np.sqrt(N))
    assert np.degrees(direction[0]) == pytest.approx(45.0)
    assert (size[-1], u[-1]) == (0.0, 0.0)

"""Dials that count in another way than was said: what tells them apart, what is refused, and that right files pass."""

import dataclasses

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.closed_form_results import calibrate_rotations, calibrate_twelve
from inclinometry.calibration.conventions import Dials, check_axes, check_dials, check_noise
from inclinometry.calibration.design import optimal_plan
from inclinometry.calibration.initial_values import fix_signs, linear_start, starting_state
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.readings import BenchReadings
from inclinometry.errors import InputError, settled
from inclinometry.findings import Finding
from inclinometry.rotations import dcm, rotation_x
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import random_tool, realistic_tool

USUAL, REVERSED = "clockwise", "counterclockwise"
WAYS = [
    Dials(i, a, t)
    for i in ("vertical", "other-end", "horizontal", "horizontal-up")
    for a in (USUAL, REVERSED)
    for t in (USUAL, REVERSED)
]
PLANS = {
    "twelve": plans.twelve(),
    "orthogonal": plans.orthogonal(),
    "half": plans.half(),
    "two-face": plans.two_face(),
    "rotations": plans.rotations(),
    "rotations 30": plans.rotations(np.radians(30.0)),
    "optimal": optimal_plan(12, restarts=1),
}
MIRROR, TURNED = np.diag([1.0, -1.0, 1.0]), rotation_x(np.pi)


def shown(way, plan):
    """What dials that count in a way of their own show at the settings of a plan."""
    azimuth, inclination, toolface = way.settings(plan.azimuth, plan.inclination, plan.toolface)
    return azimuth, plan.inclination - np.pi / 2 if way.inclination_from == "horizontal-up" else inclination, toolface


def run_of(tool, plan, way=Dials(), *, seed=1, stated=True, **rig):  # noqa: B008
    rig = Rig(**{"dip": np.radians(65.0), "base_tilt": 0.03, "north_offset": 0.4, "setting_sd": 0.002} | rig)
    run = simulate_bench(tool, rig, plan.azimuth, plan.inclination, plan.toolface, bits=12, seed=seed)
    reference = {"dip": rig.dip} if stated else {}
    return BenchReadings(run.signals, *shown(way, plan), units=run.units, reference=reference)


def test_two_reversed_dials_are_a_mirror_or_a_turn_and_inclination_has_two_faces():
    a, i, t = np.random.default_rng(1).uniform(-np.pi, np.pi, (3, 50))
    here = dcm(a, i, t)
    # products of three rotations: rounding of 1e-16 each
    np.testing.assert_allclose(dcm(-a, i, -t), MIRROR @ here @ MIRROR, atol=1e-14)
    np.testing.assert_allclose(dcm(a, np.pi - i, t), TURNED @ dcm(a + np.pi, i, -t), atol=1e-14)
    np.testing.assert_allclose(dcm(a, -i, t), dcm(a + np.pi, i, t + np.pi), atol=1e-14)


def serious(found):
    """Codes of what is no note."""
    return [one.code for one in found.findings if one.severity != "note"]


def found_in(readings, **options):
    """What a calibration says of readings, or what it refuses."""
    try:
        return list(calibrate_joint(readings, **options).findings)
    except InputError as refusal:
        return [refusal.finding]


def ways_of(found):
    """The ways of counting that findings name."""
    causes = [cause for one in found if one.code == "bench-left-handed" for cause in one.values["causes"]]
    named = [way for one in found for way in one.values.get("ways", ())]
    return named + [one.values["way"] for one in causes if getattr(one, "code", "") == "bench-cause-dials"]


@pytest.mark.parametrize("way", WAYS, ids=lambda w: str(w.way))
def test_converted_dials_are_the_settings_again(way):
    plan = PLANS["two-face"]
    readings = run_of(realistic_tool(1), plan, way)
    read = way.read(readings)
    for dial, want in zip(read.dials, (plan.azimuth, plan.inclination, plan.toolface), strict=True):
        np.testing.assert_allclose(dial, want, atol=1e-15)
    assert [one.values["way"] for one in read.findings] == [way.way] * (way != Dials())


@pytest.mark.long
@pytest.mark.parametrize("way", WAYS[1:], ids=lambda w: str(w.way))
def test_a_misread_dial_is_refused_or_named_with_the_options_that_state_it(way):
    readings = run_of(realistic_tool(3), PLANS["twelve"], way)
    assert way.way in ways_of(found_in(readings))
    assert serious(calibrate_joint(way.read(readings))) == []


@pytest.mark.parametrize("plan", PLANS)
def test_inclination_from_the_horizontal_is_named_on_every_plan(plan, refused):
    readings = run_of(realistic_tool(4), PLANS[plan], Dials("horizontal"), base_tilt=0.01)
    with refused("bench-dials-otherwise") as said:
        calibrate_joint(readings)
    assert said[0].values["ways"][0] == Dials("horizontal").way


def test_the_closed_forms_refuse_alike(refused):
    reversed_ = Dials(toolface_counts=REVERSED)
    with refused("bench-dials-otherwise"):
        calibrate_twelve(run_of(realistic_tool(5), PLANS["twelve"], reversed_))
    with refused("bench-left-handed") as said:
        calibrate_rotations(run_of(realistic_tool(5), PLANS["rotations"], reversed_, base_tilt=0.0, north_offset=0.0))
    mirrored = run_of(realistic_tool(5), PLANS["twelve"], Dials(azimuth_counts=REVERSED, toolface_counts=REVERSED))
    assert said[0].values["kinds"] == BOTH
    with refused("bench-left-handed") as said:
        calibrate_twelve(mirrored)
    assert ways_of(said) == [MIRRORED]


def test_channels_wired_left_handed_are_refused_unless_it_is_stated(refused):
    readings = run_of(realistic_tool(6), PLANS["orthogonal"])
    wired = {k: v * ([1.0, -1.0, 1.0] if k == "magnetometer" else 1.0) for k, v in readings.channels.items()}
    wired = dataclasses.replace(readings, channels=wired)
    with refused("bench-left-handed") as said:
        calibrate_joint(wired)
    assert said[0].values["kinds"] == ("magnetometer",)
    assert serious(calibrate_joint(wired, left_handed=True)) == [DIALS]


def test_an_accelerometer_that_reads_specific_force_is_right_handed(refused):
    readings = run_of(realistic_tool(6), PLANS["orthogonal"])
    for kinds in (("accelerometer", "magnetometer"), ("accelerometer",)):
        force = {k: -v if k == "accelerometer" else v for k, v in readings.channels.items() if k in kinds}
        assert serious(calibrate_joint(dataclasses.replace(readings, channels=force))) == []
    # z up, specific force: a vendor's convention, told from a mirror by the magnetometer only
    z_up = {"accelerometer": [1.0, -1.0, -1.0], "magnetometer": [1.0, -1.0, -1.0]}
    turned = {k: v * z_up[k] * (-1.0 if k == "accelerometer" else 1.0) for k, v in readings.channels.items()}
    assert set(serious(calibrate_joint(dataclasses.replace(readings, channels=turned)))) <= {AGAINST, DIALS}
    with refused("bench-left-handed"):
        calibrate_joint(dataclasses.replace(readings, channels={"accelerometer": turned["accelerometer"]}))


@pytest.mark.parametrize("tilt", [np.pi - 0.03, 2.0])
def test_a_rig_that_is_upside_down_is_named_and_right_when_it_is_stated(tilt, refused):
    tool = realistic_tool(6)
    plan = PLANS["orthogonal"]
    # the whole rig with its dials, turned by 180 deg about its azimuth 0
    turned = Dials(base="inverted").settings(plan.azimuth, plan.inclination, plan.toolface)
    rig = Rig(dip=np.radians(70.0), base_tilt=np.pi - tilt, north_offset=0.4, setting_sd=0.002)
    run = simulate_bench(tool, rig, *turned, bits=12, seed=1)
    readings = BenchReadings(
        run.signals, plan.azimuth, plan.inclination, plan.toolface, units=run.units, reference={"dip": rig.dip}
    )
    for force in (1.0, -1.0):
        signals = {k: v * (force if k == "accelerometer" else 1.0) for k, v in readings.channels.items()}
        given = dataclasses.replace(readings, channels=signals)
        with refused("bench-all-reversed"):
            calibrate_joint(given)
        found = calibrate_joint(Dials(base="inverted").read(given)).tool
        for kind, triad in found.triads.items():
            own = tool.triads[kind].tensor[0] * (force if kind == "accelerometer" else 1.0)
            length = np.linalg.norm(own, axis=1)[:, None]
            # gain and axes to 2 %: a tensor of the other sign is off by 200
            assert np.abs((triad.tensor[0] - own) / length).max() < 0.02
    # without a dip the accelerometer's sign hints at it
    unstated = calibrate_joint(dataclasses.replace(readings, reference={}))
    assert "bench-force-or-inverted" in serious(unstated)


def test_dials_of_an_inverted_base_are_those_of_the_rig_turned_round():
    a, i, t = np.random.default_rng(2).uniform(-np.pi, np.pi, (3, 50))
    way = Dials("horizontal-up", REVERSED, base="inverted")
    np.testing.assert_allclose(dcm(*Dials(base="inverted").settings(a, i, t)), dcm(a, i, t) @ TURNED, atol=1e-14)
    np.testing.assert_allclose(way.dial_readings(*way.settings(a, i, t)), (a, i, t), atol=1e-14)
    counts = ("inclination upwards from the horizontal", "azimuth counterclockwise", "rig upside down")
    assert way.way.values["counts"] == counts


def test_a_zero_that_is_stated_tells_the_other_end_from_the_axes_of_a_skewed_tool(refused):
    readings = run_of(random_tool(3), PLANS["orthogonal"], Dials("other-end", toolface_counts=REVERSED))
    (skewed,) = (one for one in calibrate_joint(readings).findings if one.severity == "warning")
    assert (skewed.code, skewed.values["missing"]) == ("bench-axes-skewed", ("azimuth of the rig's zero",))
    stated = dataclasses.replace(readings, reference={**readings.reference, "north": 0.5})
    with refused("bench-zero-opposite"):
        calibrate_joint(stated)
    right = dataclasses.replace(run_of(random_tool(3), PLANS["orthogonal"]), reference=stated.reference)
    assert serious(calibrate_joint(right)) == []


def field_at(plan, way, rows, *, sign=1.0, dip=0.2):
    """Readings without noise of sensors along the rows of both triads on a level rig whose zero points 0.5 rad east."""
    turns = dcm(plan.azimuth, plan.inclination, plan.toolface)
    north = np.array([np.cos(dip) * np.cos(0.5), -np.cos(dip) * np.sin(0.5), np.sin(dip)])
    seen = {"accelerometer": sign * (turns @ DOWN), "magnetometer": turns @ north}
    return BenchReadings({k: 1e3 * v @ np.transpose(rows) for k, v in seen.items()}, *shown(way, plan))


DOWN = np.array([0.0, 0.0, 1.0])
FOUR = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]) / np.sqrt(3.0)
SKEWED = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
SKEWED = SKEWED * np.sign(np.linalg.det(SKEWED))


@pytest.mark.parametrize(
    ("rows", "way", "stated"),
    [
        (FOUR, Dials(azimuth_counts=REVERSED, toolface_counts=REVERSED), {"north": 0.5, "dip": 0.2}),
        (np.vstack([np.eye(3), FOUR[:1]]), Dials("other-end", toolface_counts=REVERSED), {"north": 0.5}),
        (SKEWED, Dials("other-end", azimuth_counts=REVERSED), {"north": 0.5}),
    ],
    ids=["four skewed", "four, three along the axes", "skewed, dip not stated"],
)
def test_two_reversed_dials_are_named_where_no_handedness_tells(rows, way, stated):
    """Measured before: with the rig's zero stated, one in twenty random files with reversed dials passed in silence."""
    misread = dataclasses.replace(field_at(PLANS["orthogonal"], way, rows, sign=-1.0), reference=stated)
    said = found_in(misread, rig_sd=0.0)
    assert way.way in ways_of(said) or "bench-axes-against" in {one.code for one in said}


def test_a_right_file_with_a_stated_stand_has_no_such_note():
    known = {"north": 0.5, "dip": 0.2}
    for rows in (SKEWED, np.vstack([np.eye(3), FOUR[:1]])):
        right = dataclasses.replace(field_at(PLANS["orthogonal"], Dials(), rows), reference=known)
        assert serious(calibrate_joint(right, rig_sd=0.0)) == []


def test_two_reversed_dials_are_the_cause_named_where_the_sign_of_the_field_was_assumed():
    """The magnetometer, made right-handed by assumption, vouched for an accelerometer seen in a mirror."""
    way = Dials(azimuth_counts=REVERSED, toolface_counts=REVERSED)
    found = calibrate_joint(run_of(realistic_tool(7), PLANS["orthogonal"], way, stated=False))
    assert serious(found)[0] == "bench-sign-assumed"
    assert ways_of(found.findings).count(way.way) == 2


def test_one_triad_that_looks_usual_by_chance_does_not_excuse_another():
    """Of 10,000 random tools one, turned half about x, had a magnetometer within 25 deg of its axes and passed."""
    way = Dials("other-end", toolface_counts=REVERSED)
    readings = run_of(random_tool(8694), PLANS["twelve"], way, seed=8694, dip=np.radians(-84.9), north_offset=4.86)
    assert any("inclination from the other end" in one.values["counts"] for one in ways_of(found_in(readings)))


def test_a_residual_is_a_share_of_the_field_of_its_triad_for_the_parameters_it_took():
    """The median over the channels that live; half the readings gone into parameters double the square, at most four
    times."""
    plan = PLANS["orthogonal"]
    readings = field_at(plan, Dials(), np.diag([1.0, 2.0, 4.0]))
    channels = {kind: np.column_stack([v, np.full(24, 7.0)]) for kind, v in readings.channels.items()}  # and a dead one
    model = Model(channels, np.stack(readings.dials, axis=1), np.ones((24, 1)), np.ones((24, 8)), np.zeros(3),
                  np.zeros(4), {})  # fmt: skip
    rows = np.vstack([1e3 * np.diag([1.0, 2.0, 4.0]), np.zeros(3)])
    state = state_of(accelerometer=rows / 1e3, magnetometer=rows / 1e3)
    shares = np.array([0.05, 0.0, 0.0, 0.0, 0.01, 0.1, 0.2, 0.0])  # of the full field of each channel
    residual = np.ones((24, 8)) * shares * [1e3, 2e3, 4e3, 1.0, 1e3, 2e3, 4e3, 1.0]
    size = residual.size
    for freedom, percent in ((size, 10), (size // 2, 14), (size // 3, 17), (size // 4, 20), (1, 20)):
        (said,) = (one for one in check_noise(model, state, residual, freedom) if one.values["kind"] == "magnetometer")
        assert said.values["left_percent"] == pytest.approx(percent, abs=0.5)
        assert said.severity == ("refused" if percent > 15 else "warning")


def test_readings_in_another_order_are_refused(refused):
    readings = run_of(realistic_tool(7), PLANS["orthogonal"])
    order = np.random.default_rng(0).permutation(24)
    shuffled = {k: v[order] for k, v in readings.channels.items()}
    with refused("bench-fit-poor"):
        # without the search for outliers, which would find one in every station
        calibrate_joint(dataclasses.replace(readings, channels=shuffled), diagnose=False)


@pytest.mark.long
def test_a_cheap_tool_on_a_cheap_rig_passes():
    # 4 % of noise and settings good to 2 deg
    tool = realistic_tool(8, noise={"accelerometer": 0.4, "magnetometer": 2000.0})
    for plan in ("twelve", "orthogonal", "two-face"):
        assert calibrate_joint(run_of(tool, PLANS[plan], setting_sd=np.radians(2.0)))


def judged(readings):
    """What is said before the fit, where the dials are judged."""
    ones = np.ones((len(readings), 6))
    settings = np.stack(readings.dials, axis=1)
    model = Model(readings.channels, settings, ones[:, :1], ones, np.zeros(3), np.zeros(4), {})
    # directions as good as a fit finds them; at one azimuth the start takes the stand for level
    u = np.radians(0.3 if np.ptp(settings[:, 0]) else 30.0)
    start, said = fix_signs(starting_state(model), readings.reference, {}, u**2 * np.eye(4))
    return settled([*said, *check_dials(readings), *check_axes(start)])


@pytest.mark.long
@pytest.mark.parametrize("plan", PLANS)
def test_random_files_right_ones_pass_and_no_misread_one_passes_in_silence(plan):
    draw = np.random.default_rng(list(PLANS).index(plan))
    for seed in range(30):
        rig = {
            "dip": np.radians(draw.uniform(-85.0, 85.0)),
            "base_tilt": np.radians(draw.uniform(0.0, 20.0)),
            "north_offset": draw.uniform(0.0, 2.0 * np.pi),
            "setting_sd": np.radians(draw.uniform(0.0, 0.5)),
        }
        tool = (realistic_tool, random_tool)[seed % 2](seed)
        judged(run_of(tool, PLANS[plan], seed=seed, **rig))
        way = WAYS[1 + (seed // 2) % 15]
        if plan.startswith("rotations") and way == Dials(azimuth_counts=REVERSED):
            continue  # azimuth 0 is 0 either way
        try:
            said = judged(run_of(tool, PLANS[plan], way, seed=seed, **rig))
        except InputError:
            continue
        assert said, way


def test_what_dials_do_does_not_hang_on_the_unit_of_the_signals():
    readings = run_of(realistic_tool(5), PLANS["twelve"], Dials(toolface_counts=REVERSED))
    for scale in (1.0, 1e-7):
        channels = {kind: scale * values for kind, values in readings.channels.items()}
        (said,) = check_dials(dataclasses.replace(readings, channels=channels, digest=""))
        assert said.severity == "refused"
        assert Dials(toolface_counts=REVERSED).way in ways_of([said])


def test_what_is_left_unexplained_is_a_share_of_the_field():
    """All round alike, each channel's readings spread over the field by one over the root of three."""
    readings = field_at(PLANS["orthogonal"], Dials(toolface_counts=REVERSED), np.eye(3))
    settings = dcm(*readings.dials)
    left = {
        kind: np.sqrt(linear_start(kind, settings, np.ones((24, 1)), 1e-3 * values)[2] / values.size)
        for kind, values in readings.channels.items()
    }
    (said,) = check_dials(readings)
    assert said.values["left_percent"] == pytest.approx(100.0 * left[said.values["kind"]], rel=1e-6)


def test_at_one_azimuth_no_azimuth_dial_is_blamed():
    readings = run_of(random_tool(3), PLANS["rotations"], Dials("horizontal"), stated=False, base_tilt=0.01)
    (said,) = check_dials(readings)
    counts = [one.values["counts"] for one in ways_of([said])]
    assert len(counts) > 1
    assert "azimuth counterclockwise" not in {count for one in counts for count in one}


def state_of(dip=0.9, **rows):
    """A fit of triads whose sensors lie along these rows; gravity down, the other field north and down by `dip`."""
    other = np.array([np.cos(dip), 0.0, np.sin(dip)])
    coefficients = {kind: np.pad(1e3 * np.asarray(n, dtype=float), ((0, 0), (0, 1)))[None] for kind, n in rows.items()}
    directions = {kind: DOWN if kind == "accelerometer" else other for kind in rows}
    return State(coefficients, directions, np.zeros((1, 3)), np.zeros(4))


EYE = np.eye(3)
CHANNEL = "a channel reversed or two exchanged"
KNOWN = frozenset({"north", "dip", "latitude"})
TURN = Dials("other-end", toolface_counts=REVERSED).way
MIRRORED = Dials(azimuth_counts=REVERSED, toolface_counts=REVERSED).way
CROSSED = Dials("other-end", azimuth_counts=REVERSED).way
SKEW = STAND = "bench-axes-skewed"
AGAINST, DIALS = "bench-axes-against", "bench-axes-against-dials"
NORTH, DIP_NAME = "azimuth of the rig's zero", "dip"
BOTH = ("accelerometer", "magnetometer")
ALONE = {"kinds": ("accelerometer",)}
Y_Z = {"kind": "magnetometer", "channels": ("y", "z")}


@pytest.mark.parametrize(
    ("rows", "stated", "options", "code", "values"),
    [
        # along the tool's axes: nothing, and one that clearly is speaks for a skewed one
        ({"accelerometer": EYE, "magnetometer": EYE}, set(), {}, None, {}),
        ({"accelerometer": EYE, "magnetometer": SKEWED}, set(), {}, None, {}),
        # skewed and right-handed: what is not stated may be counted otherwise
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, KNOWN, {}, None, {}),
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, set(), {}, STAND,
         {"kinds": BOTH, "ways": (TURN, CROSSED), "missing": (NORTH, DIP_NAME)}),
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, {"north"}, {}, STAND,
         {"kinds": BOTH, "ways": (TURN, CROSSED), "missing": (DIP_NAME,)}),
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, {"dip"}, {}, STAND,
         {"kinds": BOTH, "ways": (TURN,), "missing": (NORTH,)}),
        ({"accelerometer": SKEWED, "gyro": SKEWED}, {"north"}, {}, STAND,
         {"kinds": ("accelerometer", "gyro"), "ways": (TURN,), "missing": ("latitude",)}),
        # without a second field no handedness tells, and to state the zero is not enough
        ({"accelerometer": SKEWED}, set(), {}, SKEW,
         ALONE | {"ways": (TURN, MIRRORED, CROSSED), "missing": ("how the dials count",)}),
        ({"accelerometer": SKEWED}, {"north"}, {}, SKEW,
         ALONE | {"ways": (MIRRORED,), "missing": ("how the dials count",)}),
        ({"accelerometer": SKEWED}, {"north"}, {"left_handed": True}, None, {}),
        ({"accelerometer": SKEWED}, set(), {"left_handed": True}, STAND,
         ALONE | {"ways": (TURN,), "missing": (NORTH,)}),
        # against the axes
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, -1.0, -1.0])}, KNOWN, {}, AGAINST, Y_Z),
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, -1.0, -1.0])}, set(), {}, DIALS, Y_Z | {"ways": (TURN,)}),
        ({"accelerometer": np.diag([1.0, -1.0, 1.0]), "magnetometer": EYE}, {"north"}, {"assumed": True}, DIALS,
         {"kind": "accelerometer", "channels": ("y",), "ways": (MIRRORED,)}),
        ({"accelerometer": -EYE, "magnetometer": EYE}, set(), {}, None, {}),
        ({"accelerometer": -EYE, "magnetometer": EYE}, set(), {"assumed": True}, "bench-force-or-inverted", {}),
        # skewed, it reads specific force: a triad beside it tells, and two gyros say nothing against that
        ({"accelerometer": -SKEWED, "magnetometer": EYE, "gyro": EYE[:2]}, KNOWN, {}, None, {}),
        ({"magnetometer": np.vstack([np.diag([1.0, 1.0, -1.0]), FOUR[:1]])}, KNOWN, {}, DIALS,
         {"kind": "magnetometer", "channels": ("3",), "ways": (MIRRORED,)}),
        ({"magnetometer": np.vstack([np.diag([1.0, 1.0, -1.0]), FOUR[:1]])}, set(), {}, DIALS,
         {"kind": "magnetometer", "channels": ("3",), "ways": (TURN, MIRRORED)}),
        # left-handed and skewed
        ({"accelerometer": SKEWED, "magnetometer": SKEWED * [1.0, 1.0, -1.0]}, KNOWN, {}, "bench-left-handed",
         {"kinds": ("magnetometer",), "causes": (CHANNEL, Finding("bench-cause-dials", {"way": MIRRORED}))}),
    ],
)  # fmt: skip
def test_what_the_channels_say_of_the_dials(rows, stated, options, code, values):
    found = check_axes(state_of(**rows), frozenset(stated), **options)
    assert found == ([] if code is None else [Finding(code, values)])


def sign(angle, wanted, found):
    return "bench-cause-sign", angle, pytest.approx(wanted, abs=0.01), pytest.approx(found, abs=0.01)


@pytest.mark.parametrize(
    ("rows", "stated", "kinds", "causes"),
    [
        # gravity stands right: dials that count otherwise would turn it too
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, -1.0, 1.0])}, set(), ("magnetometer",), [CHANNEL]),
        ({"magnetometer": np.diag([1.0, -1.0, 1.0])}, set(), ("magnetometer",), [MIRRORED, CHANNEL]),
        ({"magnetometer": np.diag([1.0, 1.0, -1.0])}, set(), ("magnetometer",), [CROSSED, CHANNEL]),
        ({"accelerometer": np.diag([1.0, -1.0, 1.0]), "magnetometer": np.diag([1.0, -1.0, 1.0])}, set(),
         ("accelerometer", "magnetometer"), [MIRRORED, CHANNEL]),
        # an accelerometer of its own that is skewed, or reads specific force, is turned as well
        ({"accelerometer": -EYE, "magnetometer": np.diag([1.0, -1.0, 1.0])}, set(), ("magnetometer",),
         [MIRRORED, CHANNEL]),
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, 1.0, -1.0])}, {"dip"}, ("magnetometer",),
         [CHANNEL, sign("dip", -51.57, 51.57)]),
        ({"accelerometer": EYE, "gyro": np.diag([1.0, 1.0, -1.0])}, {"latitude"}, ("gyro",),
         [CHANNEL, sign("latitude", 51.57, -51.57)]),
    ],
)  # fmt: skip
def test_left_handed_channels_are_refused_with_what_may_have_made_them_so(rows, stated, kinds, causes):
    (said,) = check_axes(state_of(**rows), frozenset(stated))
    assert (said.code, said.severity, said.values["kinds"]) == ("bench-left-handed", "refused", kinds)
    for one, want in zip(said.values["causes"], causes, strict=True):
        if isinstance(want, str):
            assert one == want
        elif isinstance(want, Finding):
            assert one.values.get("way", one) == want
        else:
            assert (one.code, *(one.values[name] for name in ("angle", "wanted_deg", "found_deg"))) == want
    left = check_axes(state_of(**rows), KNOWN, left_handed=True)
    assert {one.code for one in left} <= {AGAINST, DIALS}

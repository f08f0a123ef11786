"""Dials that count in another way than was said: what tells them apart, what is refused, and that right files pass."""

import dataclasses
import re

import numpy as np
import pytest

from inclinometry.calibration import plans
from inclinometry.calibration.conventions import Dials, check_axes, check_dials, check_noise, figure
from inclinometry.calibration.design import optimal_plan
from inclinometry.calibration.direct import calibrate_rotations, calibrate_twelve
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.likelihood import Model, State
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.start import fix_signs, linear_start, starting_state
from inclinometry.errors import InputError
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


@pytest.mark.parametrize("way", WAYS, ids=lambda w: w.words())
def test_converted_dials_are_the_settings_again(way):
    plan = PLANS["two-face"]
    readings = run_of(realistic_tool(1), plan, way)
    read = way.read(readings)
    for dial, want in zip(read.dials, (plan.azimuth, plan.inclination, plan.toolface), strict=True):
        np.testing.assert_allclose(dial, want, atol=1e-15)
    assert bool(read.notes) == (way != Dials())
    assert all(way.words() in note for note in read.notes)


@pytest.mark.long
@pytest.mark.parametrize("way", WAYS[1:], ids=lambda w: w.words())
def test_a_misread_dial_is_refused_or_named_with_the_options_that_state_it(way):
    readings = run_of(realistic_tool(3), PLANS["twelve"], way)
    try:
        (said,) = {w.split("; ")[1] for w in calibrate_joint(readings).warnings}
    except InputError as refusal:
        said = str(refusal)
    assert way.words() in said
    right = calibrate_joint(way.read(readings))
    assert [w for w in right.warnings if "as stated" not in w] == []


@pytest.mark.parametrize("plan", PLANS)
def test_inclination_from_the_horizontal_is_named_on_every_plan(plan):
    readings = run_of(realistic_tool(4), PLANS[plan], Dials("horizontal"), base_tilt=0.01)
    with pytest.raises(InputError, match=r"with --inclination-from horizontal the readings fit \d+ times better"):
        calibrate_joint(readings)


def test_the_closed_forms_refuse_alike():
    reversed_ = Dials(toolface_counts=REVERSED)
    with pytest.raises(InputError, match="--toolface-counts counterclockwise the readings fit"):
        calibrate_twelve(run_of(realistic_tool(5), PLANS["twelve"], reversed_))
    with pytest.raises(InputError, match="left-handed: the channels of the accelerometer and the magnetometer"):
        calibrate_rotations(run_of(realistic_tool(5), PLANS["rotations"], reversed_, base_tilt=0.0, north_offset=0.0))
    mirrored = run_of(realistic_tool(5), PLANS["twelve"], Dials(azimuth_counts=REVERSED, toolface_counts=REVERSED))
    with pytest.raises(InputError, match="Either two dials count the other way"):
        calibrate_twelve(mirrored)


def test_channels_wired_left_handed_are_refused_unless_it_is_stated():
    readings = run_of(realistic_tool(6), PLANS["orthogonal"])
    wired = {k: v * ([1.0, -1.0, 1.0] if k == "magnetometer" else 1.0) for k, v in readings.channels.items()}
    wired = dataclasses.replace(readings, channels=wired)
    with pytest.raises(InputError, match=r"left-handed: the channels of the magnetometer\. .*--left-handed"):
        calibrate_joint(wired)
    (warning,) = calibrate_joint(wired, left_handed=True).warnings
    assert warning.startswith("magnetometer y runs against the tool's axes")


def test_an_accelerometer_that_reads_specific_force_is_right_handed():
    readings = run_of(realistic_tool(6), PLANS["orthogonal"])
    for kinds in (("accelerometer", "magnetometer"), ("accelerometer",)):
        force = {k: -v if k == "accelerometer" else v for k, v in readings.channels.items() if k in kinds}
        assert calibrate_joint(dataclasses.replace(readings, channels=force)).warnings == ()
    # z up, specific force: a vendor's convention, told from a mirror by the magnetometer only
    z_up = {"accelerometer": [1.0, -1.0, -1.0], "magnetometer": [1.0, -1.0, -1.0]}
    turned = {k: v * z_up[k] * (-1.0 if k == "accelerometer" else 1.0) for k, v in readings.channels.items()}
    assert all("against" in w for w in calibrate_joint(dataclasses.replace(readings, channels=turned)).warnings)
    with pytest.raises(InputError, match="left-handed: the channels of the accelerometer"):
        calibrate_joint(dataclasses.replace(readings, channels={"accelerometer": turned["accelerometer"]}))


def test_a_zero_that_is_stated_tells_the_other_end_from_the_axes_of_a_skewed_tool():
    readings = run_of(random_tool(3), PLANS["orthogonal"], Dials("other-end", toolface_counts=REVERSED))
    assert any("state where the rig's zero points" in w for w in calibrate_joint(readings).warnings)
    stated = dataclasses.replace(readings, reference={**readings.reference, "north": 0.5})
    with pytest.raises(InputError, match="the rig's zero was found"):
        calibrate_joint(stated)
    right = dataclasses.replace(run_of(random_tool(3), PLANS["orthogonal"]), reference=stated.reference)
    assert calibrate_joint(right).warnings == ()


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
    try:
        said = " ".join(calibrate_joint(misread, rig_sd=0.0).warnings)
    except InputError as refusal:
        said = str(refusal)
    assert way.words() in said or "against the tool's axes" in said


def test_a_right_file_with_a_stated_stand_has_no_such_note():
    known = {"north": 0.5, "dip": 0.2}
    for rows in (SKEWED, np.vstack([np.eye(3), FOUR[:1]])):
        right = dataclasses.replace(field_at(PLANS["orthogonal"], Dials(), rows), reference=known)
        assert calibrate_joint(right, rig_sd=0.0).warnings == ()


def test_two_reversed_dials_are_the_cause_named_where_the_sign_of_the_field_was_assumed():
    """The magnetometer, made right-handed by assumption, vouched for an accelerometer seen in a mirror."""
    way = Dials(azimuth_counts=REVERSED, toolface_counts=REVERSED)
    said = calibrate_joint(run_of(realistic_tool(7), PLANS["orthogonal"], way, stated=False)).warnings
    assert "sign of the magnetic field is assumed" in said[0]
    assert sum(way.words() in w for w in said) == 2


def test_one_triad_that_looks_usual_by_chance_does_not_excuse_another():
    """Of 10,000 random tools one, turned half about x, had a magnetometer within 25 deg of its axes and passed."""
    way = Dials("other-end", toolface_counts=REVERSED)
    readings = run_of(random_tool(8694), PLANS["twelve"], way, seed=8694, dip=np.radians(-84.9), north_offset=4.86)
    assert any("--inclination-from other-end" in warning for warning in calibrate_joint(readings).warnings)


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
    check_noise(model, state, residual, size)
    check_noise(model, state, residual, size // 2)
    for freedom, percent in ((size // 3, 17), (size // 4, 20), (1, 20)):
        with pytest.raises(InputError, match=f"leaves {percent} % of the field unexplained in the magnetometer"):
            check_noise(model, state, residual, freedom)


def test_readings_in_another_order_are_refused():
    readings = run_of(realistic_tool(7), PLANS["orthogonal"])
    order = np.random.default_rng(0).permutation(24)
    shuffled = {k: v[order] for k, v in readings.channels.items()}
    with pytest.raises(InputError, match="% of the field unexplained"):
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
    return said + check_dials(readings) + check_axes(start)


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
        assert said, way.words()


def test_what_dials_do_does_not_hang_on_the_unit_of_the_signals():
    readings = run_of(realistic_tool(5), PLANS["twelve"], Dials(toolface_counts=REVERSED))
    said = []
    for scale in (1.0, 1e-7):
        channels = {kind: scale * values for kind, values in readings.channels.items()}
        with pytest.raises(InputError, match="--toolface-counts counterclockwise the readings fit") as refusal:
            check_dials(dataclasses.replace(readings, channels=channels, digest=""))
        said.append(str(refusal.value))
    assert said[0] == said[1]


def test_what_is_left_unexplained_is_a_share_of_the_field():
    """All round alike, each channel's readings spread over the field by one over the root of three."""
    readings = field_at(PLANS["orthogonal"], Dials(toolface_counts=REVERSED), np.eye(3))
    settings = dcm(*readings.dials)
    left = {
        kind: np.sqrt(linear_start(kind, settings, np.ones((24, 1)), 1e-3 * values)[2] / values.size)
        for kind, values in readings.channels.items()
    }
    with pytest.raises(InputError) as refusal:
        check_dials(readings)
    said = re.search(r"as given they leave ([0-9.]+) % of the field unexplained in the (\w+)", str(refusal.value))
    assert float(said[1]) == pytest.approx(100.0 * left[said[2]], rel=0.05)  # two digits


def test_at_one_azimuth_no_azimuth_dial_is_blamed():
    readings = run_of(random_tool(3), PLANS["rotations"], Dials("horizontal"), stated=False, base_tilt=0.01)
    with pytest.raises(InputError, match="cannot tell it from --inclination-from") as refusal:
        check_dials(readings)
    assert "--azimuth-counts" not in str(refusal.value)


def test_how_many_times_in_as_many_digits_as_mean_something():
    shown = {2.345: "2.3", 23.45: "23", 99.4: "99", 99.7: "100", 100.0: "100", 234.5: "200", 23450.0: "20000"}
    assert {times: figure(times) for times in shown} == shown


def state_of(dip=0.9, **rows):
    """A fit of triads whose sensors lie along these rows; gravity down, the other field north and down by `dip`."""
    other = np.array([np.cos(dip), 0.0, np.sin(dip)])
    coefficients = {kind: np.pad(1e3 * np.asarray(n, dtype=float), ((0, 0), (0, 1)))[None] for kind, n in rows.items()}
    directions = {kind: DOWN if kind == "accelerometer" else other for kind in rows}
    return State(coefficients, directions, np.zeros((1, 3)), np.zeros(4))


EYE = np.eye(3)
KNOWN = frozenset({"north", "dip", "latitude"})
TURN = Dials("other-end", toolface_counts=REVERSED).words()
MIRRORED = Dials(azimuth_counts=REVERSED, toolface_counts=REVERSED).words()
CROSSED = Dials("other-end", azimuth_counts=REVERSED).words()
NORTH, DIP_WORDS = "where the rig's zero points (--north-deg)", "the dip (--dip-deg)"


@pytest.mark.parametrize(
    ("rows", "stated", "options", "said"),
    [
        # along the tool's axes: nothing, and one that clearly is speaks for a skewed one
        ({"accelerometer": EYE, "magnetometer": EYE}, set(), {}, None),
        ({"accelerometer": EYE, "magnetometer": SKEWED}, set(), {}, None),
        # skewed and right-handed: what is not stated may be counted otherwise
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, KNOWN, {}, None),
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, set(), {},
         f"({TURN}; or {CROSSED}); state {NORTH} and {DIP_WORDS} to be sure"),
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, {"north"}, {},
         f"({TURN}; or {CROSSED}); state {DIP_WORDS} to be sure"),
        ({"accelerometer": SKEWED, "magnetometer": SKEWED}, {"dip"}, {}, f"({TURN}); state {NORTH} to be sure"),
        ({"accelerometer": SKEWED, "gyro": SKEWED}, {"north"}, {},
         f"({TURN}); state the latitude (latitude_deg in --site) to be sure"),
        # without a second field no handedness tells, and to state the zero is not enough
        ({"accelerometer": SKEWED}, set(), {},
         f"({TURN}; or {MIRRORED}; or {CROSSED}); check which way the dials of the stand count"),
        ({"accelerometer": SKEWED}, {"north"}, {}, f"({MIRRORED}); check which way the dials of the stand count"),
        ({"accelerometer": SKEWED}, {"north"}, {"left_handed": True}, None),
        ({"accelerometer": SKEWED}, set(), {"left_handed": True}, f"({TURN}); state {NORTH} to be sure"),
        # against the axes
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, -1.0, -1.0])}, KNOWN, {},
         "magnetometer y and z run against the tool's axes"),
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, -1.0, -1.0])}, set(), {},
         f"magnetometer y and z run against the tool's axes; {TURN} would look so too"),
        ({"accelerometer": np.diag([1.0, -1.0, 1.0]), "magnetometer": EYE}, {"north"}, {"assumed": True},
         f"accelerometer y runs against the tool's axes; {MIRRORED} would look so too"),
        ({"accelerometer": -EYE, "magnetometer": EYE}, set(), {}, None),
        ({"accelerometer": -EYE, "magnetometer": EYE}, set(), {"assumed": True}, None),
        # skewed, it reads specific force: a triad beside it tells, and two gyros say nothing against that
        ({"accelerometer": -SKEWED, "magnetometer": EYE, "gyro": EYE[:2]}, KNOWN, {}, None),
        ({"magnetometer": np.vstack([np.diag([1.0, 1.0, -1.0]), FOUR[:1]])}, KNOWN, {},
         f"magnetometer 3 runs against the tool's axes; {MIRRORED} would look so too"),
        ({"magnetometer": np.vstack([np.diag([1.0, 1.0, -1.0]), FOUR[:1]])}, set(), {},
         f"magnetometer 3 runs against the tool's axes; {TURN} or {MIRRORED} would look so too"),
        # left-handed and skewed
        ({"accelerometer": SKEWED, "magnetometer": SKEWED * [1.0, 1.0, -1.0]}, KNOWN, {},
         f"which do not lie along the tool's axes. One is reversed, or two are exchanged, or azimuth and toolface "
         f"both count the other way ({MIRRORED})"),
    ],
)  # fmt: skip
def test_what_the_channels_say_of_the_dials(rows, stated, options, said):
    found = check_axes(state_of(**rows), frozenset(stated), **options)
    assert len(found) == (said is not None)
    assert all(sentence.endswith(said) for sentence in found)


@pytest.mark.parametrize(
    ("rows", "stated", "begins", "holds"),
    [
        # gravity stands right: dials that count otherwise would turn it too
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, -1.0, 1.0])}, set(), "the magnetometer. A channel", ""),
        ({"magnetometer": np.diag([1.0, -1.0, 1.0])}, set(), f"the magnetometer. Either two dials count the other way "
         f"({MIRRORED}), or a channel", ""),
        ({"magnetometer": np.diag([1.0, 1.0, -1.0])}, set(), f"the magnetometer. Either two dials count the other way "
         f"({CROSSED}), or a channel", ""),
        ({"accelerometer": np.diag([1.0, -1.0, 1.0]), "magnetometer": np.diag([1.0, -1.0, 1.0])}, set(),
         f"the accelerometer and the magnetometer. Either two dials count the other way ({MIRRORED}), or a", ""),
        # an accelerometer of its own that is skewed, or reads specific force, is turned as well
        ({"accelerometer": -EYE, "magnetometer": np.diag([1.0, -1.0, 1.0])}, set(), "the magnetometer. Either", ""),
        ({"accelerometer": EYE, "magnetometer": np.diag([1.0, 1.0, -1.0])}, {"dip"}, "the magnetometer. A channel",
         "Or the sign of what is stated is wrong: with a dip of -51.57 deg instead of +51.57 the magnetometer is "
         "right-handed."),
        ({"accelerometer": EYE, "gyro": np.diag([1.0, 1.0, -1.0])}, {"latitude"}, "the gyro. A channel",
         "with a latitude of +51.57 deg instead of -51.57 the gyro is right-handed."),
    ],
)  # fmt: skip
def test_left_handed_channels_are_refused_with_what_may_have_made_them_so(rows, stated, begins, holds):
    with pytest.raises(InputError) as refusal:
        check_axes(state_of(**rows), frozenset(stated))
    assert str(refusal.value).startswith(f"left-handed: the channels of {begins}")
    assert holds in str(refusal.value)
    assert ("Or the sign of what is stated" in str(refusal.value)) == bool(holds)
    assert all("against" in sentence for sentence in check_axes(state_of(**rows), KNOWN, left_handed=True))

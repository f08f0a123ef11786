"""Each triad against its mirror image: what decides, and what is said when nothing does."""

import numpy as np
import pytest

from inclinometry.calibration.initial_values import fix_signs, handedness, nearest_axes
from inclinometry.calibration.likelihood import State
from inclinometry.findings import Finding
from inclinometry.rotations import rotation_x, rotation_z

TENSOR = np.array([[[3.0, 1.0, 0.0, 5.0], [0.0, 2.0, 0.0, -6.0], [0.5, 0.0, 4.0, 7.0]]])

SKEWED = np.array([[[1.0, 1.0, 0.0, 5.0], [-1.0, 1.0, 1.0, -6.0], [1.0, -0.5, 1.0, 7.0]]])


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


def signed(kind, direction, reference=None, prior=None):
    """+1 where the triad was kept, -1 where it was reversed, and the warnings."""
    state = State({kind: TENSOR}, {kind: direction}, np.zeros((1, 3)), np.zeros(4))
    priors = {} if prior is None else {kind: (prior, np.eye(3))}
    found, warnings = fix_signs(state, reference or {}, priors)
    sign = 1.0 if np.array_equal(found.directions[kind], direction) else -1.0
    np.testing.assert_array_equal(found.directions[kind], sign * direction)
    # tensor with the field, offset as it was: no signal changes
    np.testing.assert_array_equal(found.coefficients[kind][..., :3], sign * TENSOR[..., :3])
    np.testing.assert_array_equal(found.coefficients[kind][..., 3], TENSOR[..., 3])
    return sign, warnings


@pytest.mark.parametrize("direction", [unit(0.1, -0.2, 1.0), unit(5.0, 0.0, 0.5), unit(0.0, 0.0, 1.0)])
def test_gravity_points_down(direction):
    assert signed("accelerometer", direction) == (1.0, [])
    assert signed("accelerometer", -direction) == (-1.0, [])


def test_gravity_across_the_rig_is_named():
    sign, (said,) = signed("accelerometer", unit(1.0, 0.0, 0.05))
    assert (sign, said.code) == (1.0, "bench-down-assumed")
    assert said.values["off_deg"] == pytest.approx(87.1, abs=0.05)


def assumed(kind, found_deg):
    """The finding of a sign that was assumed where nothing is stated."""
    angle = {"magnetometer": "dip", "gyro": "latitude"}[kind]
    found = pytest.approx(found_deg, abs=0.05)
    return Finding("bench-sign-assumed", {"angle": angle, "kind": kind, "found_deg": found})


def tilted(tilt, axis, north, *vectors):
    """Vectors from magnetic north, east, down to the axes of a rig that is turned to north and then tilted, rad."""
    attitude = rotation_z(-axis) @ rotation_x(tilt) @ rotation_z(axis) @ rotation_z(north)
    return [attitude @ v for v in vectors]


def decided(kind, directions, reference, u=0.002, rows=SKEWED, final=True):
    """+1, -1 for the sign given to the field beside gravity, and the warnings."""
    names = ["accelerometer", kind]
    coefficients = {"accelerometer": SKEWED, kind: rows}
    state = State(coefficients, dict(zip(names, directions, strict=True)), np.zeros((1, 3)), np.zeros(4))
    found, warnings = fix_signs(state, reference, {}, u**2 * np.eye(4) if final else None)
    return float(np.sign(found.directions[kind] @ directions[1])), warnings


@pytest.mark.parametrize(("dip", "tilt", "north"), [(15, 0, 120), (22, 25, 180), (30, 35, 170), (70, 80, 200)])
@pytest.mark.parametrize("axis", [0, 90, 180, 270])
@pytest.mark.parametrize("hemisphere", [1, -1])
def test_the_stated_dip_decides_wherever_the_rig_points_and_leans(dip, tilt, north, axis, hemisphere):
    angle = np.radians(hemisphere * dip)
    down, field = np.array([0.0, 0.0, 1.0]), np.array([np.cos(angle), 0.0, np.sin(angle)])
    g, b = tilted(*np.radians([tilt, axis, north]), down, field)
    for way in (b, -b):
        sign, warnings = decided("magnetometer", (g, way), {"dip": angle})
        np.testing.assert_array_equal(sign * way, b)
        assert warnings == []


@pytest.mark.parametrize("latitude", [60.0, -60.0])
def test_a_gyro_rig_that_faces_south_is_told_by_the_latitude(latitude):
    angle = np.radians(latitude)
    g, w = tilted(0.05, 0.3, np.pi, np.array([0.0, 0.0, 1.0]), np.array([np.cos(angle), 0.0, -np.sin(angle)]))
    for way in (w, -w):
        assert decided("gyro", (g, way), {"latitude": angle})[0] == np.sign(way @ w)


@pytest.mark.parametrize("kind", ["magnetometer", "gyro"])
def test_where_the_invariant_vanishes_the_side_of_the_zero_decides_or_the_assumption_is_named(kind):
    g, field = tilted(0.05, 1.0, np.radians(150.0), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.01]))
    stated = {"dip": 0.01, "latitude": -0.01}
    for way in (field, -field):
        assert decided(kind, (g, way), {**stated, "north": np.radians(140.0)}) == (np.sign(way @ field), [])
        sign, (said,) = decided(kind, (g, way), stated)
        assert sign == -np.sign(way @ field)  # towards the rig's zero, which is wrong here
        assert (said.code, said.values["kind"]) == ("bench-zero-assumed", kind)
        assert said.values["zero_deg"] == pytest.approx(-30.0, abs=1.0)
        # a zero that is known, and at right angles to the field
        sign, (said,) = decided(kind, (g, way), {**stated, "north": np.radians(60.0)})
        assert said.code == "bench-zero-assumed"
        assert said.values["remedy"] == "Point the rig's zero to north"


def test_nothing_stated_is_named_with_what_was_found_and_what_to_state():
    g, b = np.array([0.0, 0.0, 1.0]), unit(0.4, 0.1, 0.9)
    for way in (b, -b):
        sign, said = decided("magnetometer", (g, way), {})
        assert sign == np.sign(way @ b)
        assert said == [assumed("magnetometer", 65.4)]


@pytest.mark.parametrize(
    ("kind", "field", "kept"),
    [
        ("magnetometer", (0.5, 0.2, 0.7), 1.0),
        ("magnetometer", (0.2, 0.1, -0.9), -1.0),
        ("magnetometer", (0.9, 0.1, -0.4), 1.0),
        ("magnetometer", (0.02, 0.9, -0.4), -1.0),
        ("magnetometer", (-0.06, 0.9, 0.02), -1.0),
        ("gyro", (0.2, 0.1, -0.9), 1.0),
    ],
)
def test_what_is_assumed_where_nothing_is_stated(kind, field, kept):
    """Most likely ahead and down; where both cannot be, what is the clearer of the two; a gyro's pole is no guide."""
    for way in (1.0, -1.0):
        sign, said = decided(kind, (np.array([0.0, 0.0, 1.0]), way * unit(*field)), {})
        assert sign == way * kept
        _, _, z = kept * unit(*field)
        angle = np.degrees(np.arcsin(z)) * (1.0 if kind == "magnetometer" else -1.0)
        assert said == [assumed(kind, angle)]


def test_north_decides_only_where_field_and_zero_are_level():
    """A field 1 deg from the vertical, known to 0.5 deg: its azimuth is good to a turn's part, no side is told."""
    down = np.array([0.0, 0.0, 1.0])
    for dip, told in ((89.0, False), (70.0, True)):
        field = np.array([-np.cos(np.radians(dip)), 0.0, np.sin(np.radians(dip))])
        sign, warnings = decided("magnetometer", (down, field), {"north": 0.0}, u=np.radians(0.5))
        assert bool(warnings) != told
        # stated north lies behind the zero as found: the mirror image is taken, where that can be said
        assert sign == (-1.0 if told else 1.0)
    # across north, within 5 deg of a right angle, the side is not told either
    for azimuth, told in ((87.0, False), (83.0, True), (97.0, True), (93.0, False)):
        field = np.array([np.cos(0.5), 0.0, np.sin(0.5)])
        _, warnings = decided("magnetometer", (down, field), {"north": np.radians(azimuth)})
        assert bool(warnings) != told


def test_channels_along_the_tools_axes_are_right_handed_where_nothing_else_decides():
    g, b = tilted(0.0, 0.0, np.radians(120.0), np.array([0.0, 0.0, 1.0]), np.array([0.966, 0.0, 0.259]))
    wired = np.concatenate([np.diag([3.0, 2.0, 4.0]), np.ones((3, 1))], axis=1)[None]
    assert decided("magnetometer", (g, b), {}, rows=wired) == (1.0, [assumed("magnetometer", 15.0)])
    reversed_ = wired * [-1.0, -1.0, -1.0, 1.0]
    assert decided("magnetometer", (g, -b), {}, rows=reversed_)[0] == -1.0
    # a start refuses and says nothing
    assert decided("magnetometer", (g, b), {"dip": 1.2}, final=False) == (1.0, [])


def test_a_contradiction_is_refused_with_both_numbers():
    g, b = np.array([0.0, 0.0, 1.0]), np.array([np.cos(0.7), 0.0, np.sin(0.7)])
    for kind, angle, found, stated in (("magnetometer", "dip", 40.11, 70.0), ("gyro", "latitude", -40.11, -55.0)):
        _, (said,) = decided(kind, (g, b), {angle: np.radians(stated)})
        assert (said.code, said.severity) == (f"bench-{angle}-contradicted", "refused")
        assert said.values["found_deg"] == pytest.approx(found, abs=0.01)
        assert said.values["stated_deg"] == pytest.approx(stated)
        assert said.values["off_deg"] == pytest.approx(abs(stated - found), abs=0.01)
    _, (said,) = decided("magnetometer", (g, b), {"dip": 0.7, "north": np.radians(170.0)})
    assert (said.code, said.severity) == ("bench-zero-opposite", "refused")
    assert [said.values[name] for name in ("zero_deg", "stated_deg")] == [pytest.approx(0.0), pytest.approx(170.0)]
    # within three standard uncertainties of 2 deg it is not refused
    assert decided("magnetometer", (g, b), {"dip": 0.7 + np.radians(5.9)}) == (1.0, [])


def test_the_fits_part_of_what_is_allowed_is_that_of_the_angle_between_both_fields():
    """0.002 rad of either direction, across each other or in one line: 0.16 deg of the angle between them."""
    down = np.array([0.0, 0.0, 1.0])
    for dip in np.radians([40.0, 89.0, 90.0]):
        field = np.array([np.cos(dip), 0.0, np.sin(dip)]) if dip < 1.57 else down
        _, (said,) = decided("magnetometer", (down, field), {"dip": 0.3})
        assert said.values["allowed_deg"] == pytest.approx(6.0, abs=0.05)
        assert said.values["u_deg"] == pytest.approx(0.16, abs=0.005)
    # a rig taken to be level, where no accelerometer says so: 5 deg beside the 5 of the fit
    state = State({"gyro": SKEWED}, {"gyro": unit(1.0, 0.0, -1.0)}, np.zeros((1, 3)), np.zeros(4))
    _, (said,) = fix_signs(state, {"latitude": 1.4}, {}, np.radians(5.0) ** 2 * np.eye(2))
    assert (said.code, said.values["angle"], said.severity) == ("bench-dip-contradicted", "latitude", "refused")
    assert said.values["u_deg"] == pytest.approx(7.07, abs=0.01)


@pytest.mark.long
def test_no_wrong_sign_in_ten_thousand_rigs_that_is_not_named():
    draw = np.random.default_rng(11)
    count = 5000  # of either kind
    unnamed = named = 0
    for kind, down in (("magnetometer", 1.0), ("gyro", -1.0)):
        tilt, axis, north = (draw.uniform(0.0, top, count) for top in (np.radians(85.0), 2.0 * np.pi, 2.0 * np.pi))
        angle = np.radians(draw.uniform(-85.0, 85.0, count))
        attitude = rotation_z(-axis) @ rotation_x(tilt) @ rotation_z(axis) @ rotation_z(north)
        field = np.stack([np.cos(angle), np.zeros(count), down * np.sin(angle)], axis=1)
        truth = np.stack([attitude[:, :, 2], (attitude @ field[..., None])[..., 0]], axis=1)
        seen = truth + np.radians(draw.normal(0.0, 0.3, truth.shape))
        seen /= np.linalg.norm(seen, axis=2, keepdims=True)
        seen[:, 1] *= draw.choice([-1.0, 1.0], (count, 1))
        # what is stated is good to 1 deg, the zero of every other rig to 10
        stated = np.clip(angle + np.radians(draw.normal(0.0, 1.0, count)), -1.57, 1.57)
        pointed = north + np.radians(draw.normal(0.0, 10.0, count))
        for k in range(count):
            known = {"dip": stated[k], "latitude": stated[k]} | ({"north": pointed[k]} if k % 2 else {})
            sign, warnings = decided(kind, seen[k], known, u=np.radians(0.3))
            unnamed += sign * float(seen[k, 1] @ truth[k, 1]) < 0.0 and not warnings
            named += bool(warnings)
    assert unnamed == 0
    # only where the field is all but level and the zero is not stated, or lies across north
    assert named < 0.15 * 2 * count


@pytest.mark.parametrize("kind", ["accelerometer", "magnetometer", "gyro"])
def test_a_prior_overrules_everything(kind):
    direction = unit(0.3, 0.2, 0.9)
    assert signed(kind, direction, {"dip": 1.2}, -direction) == (-1.0, [])
    assert signed(kind, -direction, {"dip": 1.2}, -direction) == (1.0, [])


def test_axes_and_hands():
    skew = SKEWED[0, :, :3]
    assert nearest_axes(skew) is None
    assert handedness(skew) > 0.2
    assert handedness(skew[[1, 0, 2]]) < -0.2
    assert nearest_axes(np.array([[0.1, -5.0, 0.2], [4.0, 0.3, 0.0], [0.0, 0.0, 9.0]])).tolist() == [
        [0.0, -1.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
    ]
    # two sensors along one axis span no volume that has a side
    assert nearest_axes(np.array([[1.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.0, 0.0, 1.0]])) is None
